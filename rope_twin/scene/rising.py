"""Properties of a payload that differ between ascent and descent through the water."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from rope_twin.quantity import quantity


@dataclass(frozen=True, kw_only=True)
class Rising:
    """Coefficients along z in ascent; the payload's own are then those of descent."""

    added_mass_kg: float | None = quantity("added mass in ascent", "kg", 0.0, 1e8, default=None)
    drag_area_m2: float | None = quantity(
        "drag coefficient times area in ascent", "m²", 0.0, 1e5, default=None
    )

    def check(self) -> str | None:
        """Return a fault if neither is given, or None."""
        if self.added_mass_kg is None and self.drag_area_m2 is None:
            return "no value is given; give added_mass_kg or drag_area_m2, or remove the key"
        return None


@runtime_checkable
class TwoWayShape(Protocol):
    """A shape with another drag in ascent than in descent."""

    def rising_drag_area_m2(self) -> float:
        """Return drag coefficient times projected area along z in ascent [m²]."""
