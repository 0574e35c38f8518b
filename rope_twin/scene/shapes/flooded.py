"""Shapes that are flooded or perforated: suction anchor, skip, template.

The enclosed water counts as added mass; only the steel displaces water and has buoyancy.
Perforation after DNV-RP-N103 (2017), section 4.6: added mass along z times 1 up to 5 % of open
area, 0.7 + 0.3·cos(π·(p - 5)/34) up to 34 %, e^((10 - p)/28) up to 50 %.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, exp, pi

from rope_twin.quantity import quantity
from rope_twin.scene.schema import Triple
from rope_twin.scene.shapes.outline import Box, Cylinder


def perforation_factor(open_percent: float) -> float:
    """Return the factor on the added mass along z for a percentage of open area."""
    if open_percent <= 5.0:
        return 1.0
    if open_percent < 34.0:
        return 0.7 + 0.3 * cos(pi * (open_percent - 5.0) / 34.0)
    return exp((10.0 - open_percent) / 28.0)


@dataclass(frozen=True, kw_only=True)
class SuctionAnchor:
    """A cylinder open at the bottom, with a top plate that may have hatches."""

    diameter_m: float = quantity("outer diameter", "m", 0.1, 50.0)
    height_m: float = quantity("height along z", "m", 0.1, 60.0)
    wall_m: float = quantity("thickness of wall and top plate", "m", 1e-3, 0.5)
    hatch_percent: float = quantity("open area of the top plate", "%", 0.0, 50.0, default=0.0)

    def check(self) -> str | None:
        """Return a fault if the wall leaves no interior, or None."""
        if 2.0 * self.wall_m >= self.diameter_m or self.wall_m >= self.height_m:
            return f"a wall of {self.wall_m:g} m leaves no inside; give less"
        return None

    def inside_m3(self) -> float:
        """Return the volume of the enclosed water [m³]."""
        bore = self.diameter_m - 2.0 * self.wall_m
        return 0.25 * pi * bore**2 * (self.height_m - self.wall_m)

    def volume_m3(self) -> float:
        """Return the volume of the steel [m³]."""
        return self._outline().volume_m3() - self.inside_m3()

    def added_mass_m3(self) -> Triple:
        """Return that of the closed cylinder plus water; along z reduced by hatches [m³]."""
        x, y, z = self._outline().added_mass_m3()
        inside, open_top = self.inside_m3(), perforation_factor(self.hatch_percent)
        return (x + inside, y + inside, open_top * (z + inside))

    def drag_area_m2(self) -> Triple:
        """Return that of the closed cylinder [m²]."""
        return self._outline().drag_area_m2()

    def _outline(self) -> Cylinder:
        return Cylinder(diameter_m=self.diameter_m, height_m=self.height_m)


@dataclass(frozen=True, kw_only=True)
class Skip:
    """An open box: floor and four walls, flooded; a fairing may close its face."""

    length_m: float = quantity("length along x", "m", 0.1, 50.0)
    width_m: float = quantity("width along y", "m", 0.1, 50.0)
    height_m: float = quantity("height along z", "m", 0.1, 50.0)
    wall_m: float = quantity("thickness of floor and walls", "m", 1e-3, 0.5)
    fairing_drag: float | None = quantity(
        "drag coefficient of a fairing on floor and top, instead of the box's", "", 0.0, 3.0,
        default=None,
    )  # fmt: skip

    def check(self) -> str | None:
        """Return a fault if the wall leaves no interior, or None."""
        if 2.0 * self.wall_m >= min(self.length_m, self.width_m) or self.wall_m >= self.height_m:
            return f"a wall of {self.wall_m:g} m leaves no inside; give less"
        return None

    def inside_m3(self) -> float:
        """Return the volume of the enclosed water [m³]."""
        x, y = self.length_m - 2.0 * self.wall_m, self.width_m - 2.0 * self.wall_m
        return x * y * (self.height_m - self.wall_m)

    def volume_m3(self) -> float:
        """Return the volume of the walls [m³]."""
        return self._outline().volume_m3() - self.inside_m3()

    def added_mass_m3(self) -> Triple:
        """Return that of the closed box plus the enclosed water in every direction [m³]."""
        x, y, z = self._outline().added_mass_m3()
        inside = self.inside_m3()
        return (x + inside, y + inside, z + inside)

    def drag_area_m2(self) -> Triple:
        """Return that of the closed box; along z that of the fairing, if there is one [m²]."""
        x, y, z = self._outline().drag_area_m2()
        if self.fairing_drag is not None:
            z = self.fairing_drag * self.length_m * self.width_m
        return (x, y, z)

    def _outline(self) -> Box:
        return Box(length_m=self.length_m, width_m=self.width_m, height_m=self.height_m)


@dataclass(frozen=True, kw_only=True)
class Template:
    """A frame of beams in the outline of a box, through which water passes."""

    length_m: float = quantity("length along x", "m", 0.1, 100.0)
    width_m: float = quantity("width along y", "m", 0.1, 100.0)
    height_m: float = quantity("height along z", "m", 0.1, 50.0)
    open_percent: float = quantity("open area seen from above", "%", 0.0, 50.0)
    steel_m3: float = quantity("volume of the beams", "m³", 0.0, 1e4)

    def check(self) -> str | None:
        """Return a fault if the beams exceed the outline, or None."""
        if self.steel_m3 > self._outline().volume_m3():
            return f"{self.steel_m3:g} m³ of beams are more than the outline; give less"
        return None

    def volume_m3(self) -> float:
        """Return the volume of the beams [m³]."""
        return self.steel_m3

    def added_mass_m3(self) -> Triple:
        """Return that of the closed box, reduced by the perforation along every axis [m³]."""
        left = perforation_factor(self.open_percent)
        x, y, z = self._outline().added_mass_m3()
        return (left * x, left * y, left * z)

    def drag_area_m2(self) -> Triple:
        """Return the closed box's coefficient times the solid area [m²]."""
        solid = 1.0 - 0.01 * self.open_percent
        x, y, z = self._outline().drag_area_m2()
        return (solid * x, solid * y, solid * z)

    def _outline(self) -> Box:
        return Box(length_m=self.length_m, width_m=self.width_m, height_m=self.height_m)
