"""What ropes meet at besides payloads: joints, and bars that keep two of them apart."""

from __future__ import annotations

from dataclasses import dataclass

from rope_twin.quantity import quantity, text

WINCH = "winch"  # the name by which ropes call the ship's first hang-off


@dataclass(frozen=True, kw_only=True)
class Joint:
    """A ring, shackle or hook block: where ropes meet without a payload."""

    name: str = text("its name")
    mass_kg: float = quantity("mass in air, of steel", "kg", 0.0, 1e6, default=0.0)


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
