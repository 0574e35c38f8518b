"""What is other for a payload while it rises through the water than while it sinks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from rope_twin.quantity import quantity


@dataclass(frozen=True, kw_only=True)
class Rising:
    """Figures along z while it rises; the payload's own are then those of sinking."""

    added_mass_kg: float | None = quantity("added mass", "kg", 0.0, 1e8, default=None)
    drag_area_m2: float | None = quantity(
        "drag coefficient times area", "m²", 0.0, 1e5, default=None
    )

    def check(self) -> str | None:
        """One of them at least."""
        if self.added_mass_kg is None and self.drag_area_m2 is None:
            return "nothing differs; give added_mass_kg or drag_area_m2, or leave it out"
        return None


@runtime_checkable
class TwoWayShape(Protocol):
    """A shape that knows what drag it has on its way up."""

    def rising_drag_area_m2(self) -> float:
        """Drag coefficient times projected area along z while it rises [m²]."""
