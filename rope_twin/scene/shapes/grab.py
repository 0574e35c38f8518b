"""Shapes with different drag in ascent and descent."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

from rope_twin.quantity import quantity, text
from rope_twin.scene.schema import Triple
from rope_twin.scene.shapes.outline import Box

# Hoerner 1965, 3-17, and DNV-RP-N103, table B-2: hemispheres along their axis, C_D on their disc.
CUP_INTO, CUP_AGAINST = 1.42, 0.38  # hollow: flow into the opening, flow on the round side
DOME_FLAT, DOME_ROUND = 1.17, 0.42  # solid: flow on the flat side, flow on the round side


@dataclass(frozen=True, kw_only=True)
class Grab:
    """A grab of two shells: an inverted cup when open, an inverted dome when closed and full.

    Drag along z is that of a hollow or a solid hemisphere on its plan area, laterally that of its
    outline, a box; added mass is that of the outline, plus the water under open shells.
    """

    width_m: float = quantity("width along x", "m", 0.1, 20.0)
    length_m: float = quantity("length along y", "m", 0.1, 20.0)
    height_m: float = quantity("height of the shells", "m", 0.1, 20.0)
    solid_m3: float = quantity("volume of steel, including the load if closed", "m³", 0.0, 1e3)
    closed: bool = text("closed and full; false: open and empty", False)

    def check(self) -> str | None:
        """Return a fault if the solid volume exceeds the outline, or None."""
        if self.solid_m3 > self._outline().volume_m3():
            return f"{self.solid_m3:g} m³ are more than its outline; give less"
        return None

    def volume_m3(self) -> float:
        """Return the solid volume [m³]."""
        return self.solid_m3

    def added_mass_m3(self) -> Triple:
        """Return that of the outline, plus half an ellipsoid of water if it is open [m³]."""
        x, y, z = self._outline().added_mass_m3()
        inside = 0.0 if self.closed else pi / 6.0 * self._plan_m2() * self.height_m
        return (x + inside, y + inside, z + inside)

    def drag_area_m2(self) -> Triple:
        """Return lateral drag of the outline; along z in descent: open mouth or round side first
        [m²].
        """
        x, y, _ = self._outline().drag_area_m2()
        return (x, y, (DOME_ROUND if self.closed else CUP_INTO) * self._plan_m2())

    def rising_drag_area_m2(self) -> float:
        """Return drag along z in ascent: round side or flat side first [m²]."""
        return (DOME_FLAT if self.closed else CUP_AGAINST) * self._plan_m2()

    def _plan_m2(self) -> float:
        return self.width_m * self.length_m

    def _outline(self) -> Box:
        return Box(length_m=self.width_m, width_m=self.length_m, height_m=self.height_m)
