"""What ropes meet at besides payloads: joints, and bars that keep two of them apart."""

from __future__ import annotations

from dataclasses import dataclass

from rope_twin.quantity import quantity, text

Triple = tuple[float, float, float]

STEEL_KG_PER_M3 = 7850.0  # of what masses "in air, of steel" are made of
WINCH = "winch"  # the name by which ropes call the ship's first hang-off


@dataclass(frozen=True, kw_only=True)
class Joint:
    """A ring, shackle or hook block: where ropes meet without a payload."""

    name: str = text("its name")
    mass_kg: float = quantity("mass in air, of steel", "kg", 0.0, 1e6, default=0.0)


@dataclass(frozen=True, kw_only=True)
class Tether:
    """What holds a sheave to a fixed point: a constant force, a spring and a damper.

    It pulls along the line to `at_m` with force + stiffness·(l - length) + damping·dl/dt, and
    never pushes.
    """

    at_m: Triple = quantity("the fixed point: x, y, z", "m", -1e4, 1e4)
    force_n: float = quantity("pull at its length", "N", 0.0, 1e8)
    length_m: float = quantity("length at which it pulls with that", "m", 0.0, 1e4, default=0.0)
    stiffness_n_per_m: float = quantity("of its spring", "N/m", 0.0, 1e8, default=0.0)
    damping_newton_seconds_per_m: float = quantity(
        "force per rate of its length", "N·s/m", 0.0, 1e8, default=0.0
    )


@dataclass(frozen=True, kw_only=True)
class Sheave:
    """A sheave over which rope runs from one of the two ropes that end at it into the other.

    A point: the wheel's radius is nothing beside the ropes' lengths. The rope runs until both sides
    pull alike, so that only the sum of their `length_m` stays as it is given.
    """

    name: str = text("its name")
    mass_kg: float = quantity("mass of block and wheel in air, of steel", "kg", 0.0, 1e6,
                              default=0.0)  # fmt: skip
    wheel_inertia_kg: float = quantity(
        "moment of inertia of the wheel over its radius squared", "kg", 0.0, 1e6, default=0.0
    )
    friction: float = quantity(
        "of rope on wheel: pulls differ by exp(friction·angle of wrap) under way", "", 0.0, 1.0,
        default=0.0,
    )  # fmt: skip
    tether: Tether | None = text("what holds it", None)


@dataclass(frozen=True, kw_only=True)
class Strut:
    """A bar, hinged at both ends, as a spreader has: it pulls and pushes.

    Half its mass is at either end; water does not drag at it.
    """

    name: str = text("its name")
    between: tuple[str, str] = text("the payloads or joints at its ends")
    length_m: float = quantity("length", "m", 0.1, 500.0)
    mass_kg: float = quantity("mass in air, of steel", "kg", 0.0, 1e6, default=0.0)
    stiffness_n_per_m: float = quantity("EA over length", "N/m", 1e5, 1e11, default=1e8)
    damping_newton_seconds_per_m: float = quantity(
        "force per rate of its length", "N·s/m", 0.0, 1e9, default=1e5
    )
