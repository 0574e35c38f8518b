"""Connections of ropes in a multi-line scene: joints, sheaves with tethers, spreader bars."""

from __future__ import annotations

from dataclasses import dataclass

from rope_twin.quantity import quantity, text
from rope_twin.scene.winch import BendingSheave

Triple = tuple[float, float, float]


@dataclass(frozen=True, kw_only=True)
class Joint:
    """A ring, shackle or hook block: a connection of ropes without a payload."""

    name: str = text("its name")
    mass_kg: float = quantity("mass in air, of steel", "kg", 0.0, 1e6, default=0.0)


@dataclass(frozen=True, kw_only=True)
class Tether:
    """A constant-tension link or spring-damper that holds a sheave to a fixed point.

    Its tension along the line to `at_m` is force + stiffness·(l - length) + damping·dl/dt, at least
    0.
    """

    at_m: Triple = quantity("fixed point: x, y, z", "m", -1e4, 1e4)
    force_n: float = quantity("tension at its length", "N", 0.0, 1e8)
    length_m: float = quantity("length at this tension", "m", 0.0, 1e4, default=0.0)
    stiffness_n_per_m: float = quantity("spring stiffness", "N/m", 0.0, 1e8, default=0.0)
    damping_newton_seconds_per_m: float = quantity(
        "damping coefficient c", "N·s/m", 0.0, 1e8, default=0.0
    )


@dataclass(frozen=True, kw_only=True)
class Sheave:
    """A sheave over which rope runs between the two ropes that end at it.

    It is a point: the wheel's radius is negligible relative to the ropes' lengths. In the static
    solution rope runs until the tension is equal on both sides, so that only the sum of their
    `length_m` stays as given.
    """

    name: str = text("its name")
    mass_kg: float = quantity("mass of block and wheel in air, of steel", "kg", 0.0, 1e6,
                              default=0.0)  # fmt: skip
    wheel_inertia_kg: float = quantity(
        "moment of inertia of the wheel over its radius squared", "kg", 0.0, 1e6, default=0.0
    )
    friction: float = quantity(
        "friction coefficient: tension ratio exp(friction·angle of wrap), running", "", 0.0, 1.0,
        default=0.0,
    )  # fmt: skip
    tether: Tether | None = text("tether that holds it", None)
    groove: BendingSheave | None = text(
        "its groove, for bends of the rope (`--fatigue` alone)", None, only_judges=True
    )


@dataclass(frozen=True, kw_only=True)
class Strut:
    """A spreader bar, hinged at both ends, in tension and compression.

    Half its mass is at either end; it has no drag.
    """

    name: str = text("its name")
    between: tuple[str, str] = text("payloads or joints at its ends")
    length_m: float = quantity("length", "m", 0.1, 500.0)
    mass_kg: float = quantity("mass in air, of steel", "kg", 0.0, 1e6, default=0.0)
    stiffness_n_per_m: float = quantity("axial stiffness EA/L", "N/m", 1e5, 1e11, default=1e8)
    damping_newton_seconds_per_m: float = quantity(
        "damping coefficient c", "N·s/m", 0.0, 1e9, default=1e5
    )
