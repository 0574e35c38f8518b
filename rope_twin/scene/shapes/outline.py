"""Shapes of payloads: volume, added mass and drag area along x, y (lateral) and z (vertical).

Source of tables and formulae: DNV-RP-N103 (2017; formerly DNV-RP-H103, 2011), appendix A table A-2
(added mass of three-dimensional bodies in infinite fluid), section 4.6 (added mass of bodies with
vertical sides), appendix B tables B-1 and B-2 (drag). All bodies are solid and fully submerged, far
from surface and seabed. Drag coefficients are those of steady flow; in oscillation with an
amplitude below about the body's size they are larger (the same source: 2.5 and more). A frame or a
flooded body displaces less than its outline: then give the payload's `displaced_volume_m3`.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, sqrt

import numpy as np

from rope_twin.quantity import quantity
from rope_twin.scene.schema import Triple

# Table A-2, rectangular plate moving along its normal, long side b over short side a; C_A on
# ρ·π/4·a²·b. Interpolated over a/b, so that the infinite plate is a point of the table.
_PLATE_SHORT_OVER_LONG = (
    0.0, 1 / 10, 1 / 8, 1 / 6.25, 1 / 5, 1 / 4, 1 / 3.17, 1 / 3, 1 / 2.5, 1 / 2, 1 / 1.59, 1 / 1.5,
    1 / 1.25, 1.0,
)  # fmt: skip
_PLATE_ADDED = (
    1.000, 0.947, 0.934, 0.917, 0.897, 0.872, 0.840, 0.830, 0.801, 0.757, 0.704, 0.690, 0.642,
    0.579,
)  # fmt: skip

# Table A-2, right circular cylinder moving normal to its axis; C_A on ρ·V, over D/L. The
# table ends at D/L = 1/1.2; beyond, C_A falls as 1/D·L, which is 0 for a disc in its own plane.
_CYLINDER_DIAMETER_OVER_LENGTH = (0.0, 1 / 9, 1 / 5, 1 / 2.5, 1 / 1.2)
_CYLINDER_ADDED = (1.00, 0.96, 0.90, 0.78, 0.62)

# Table B-2, rectangular plate normal to the flow, long side over short side; C_D on its area.
_PLATE_LONG_OVER_SHORT = (1.0, 5.0, 10.0)
_PLATE_DRAG = (1.16, 1.20, 1.50)

# Table B-2, square rod along the flow, length over side; C_D on its face. Shorter than 1: a plate.
_ROD_LENGTH_OVER_SIDE = (1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0)
_ROD_DRAG = (1.15, 0.97, 0.87, 0.90, 0.93, 0.95, 0.95)

# Table B-2, circular cylinder along the flow, length over diameter; C_D on its end.
_DISC_LENGTH_OVER_DIAMETER = (0.0, 1.0, 2.0, 4.0, 7.0)
_DISC_DRAG = (1.12, 0.91, 0.85, 0.87, 0.99)

# Table B-1: circular cylinder normal to the flow, subcritical, reduced for its finite length by κ.
_CYLINDER_DRAG = 1.2
_FINITE_LENGTH_OVER_DIAMETER = (2.0, 5.0, 10.0, 20.0, 40.0, 50.0, 100.0)
_FINITE_REDUCTION = (0.58, 0.62, 0.68, 0.74, 0.82, 0.87, 0.98)

_SPHERE_DRAG = 0.5  # table B-2, subcritical


@dataclass(frozen=True, kw_only=True)
class Box:
    """A box: length along x, width along y, height along z."""

    length_m: float = quantity("length along x", "m", 0.01, 100.0)
    width_m: float = quantity("width along y", "m", 0.01, 100.0)
    height_m: float = quantity("height along z", "m", 0.01, 100.0)

    def volume_m3(self) -> float:
        """Return length times width times height [m³]."""
        return self.length_m * self.width_m * self.height_m

    def added_mass_m3(self) -> Triple:
        """Return for each axis that of the plate of its face, with its depth factor [m³]."""
        x, y, z = self.length_m, self.width_m, self.height_m
        return (
            plate_added_m3(y, z) * depth_factor(y * z, x),
            plate_added_m3(x, z) * depth_factor(x * z, y),
            plate_added_m3(x, y) * depth_factor(x * y, z),
        )

    def drag_area_m2(self) -> Triple:
        """Return for each axis C_D of its face and depth, times the face [m²]."""
        x, y, z = self.length_m, self.width_m, self.height_m
        return (
            box_drag(y, z, x) * y * z,
            box_drag(x, z, y) * x * z,
            box_drag(x, y, z) * x * y,
        )


@dataclass(frozen=True, kw_only=True)
class Cylinder:
    """A closed cylinder with a vertical axis."""

    diameter_m: float = quantity("diameter", "m", 0.01, 100.0)
    height_m: float = quantity("height along z", "m", 0.01, 200.0)

    def volume_m3(self) -> float:
        """Return π/4·D²·H [m³]."""
        return 0.25 * pi * self.diameter_m**2 * self.height_m

    def added_mass_m3(self) -> Triple:
        """Return lateral: table A-2; axial: a disc (2/π on 4/3·π·a³) with the depth factor [m³]."""
        ratio = self.diameter_m / self.height_m
        last = _CYLINDER_DIAMETER_OVER_LENGTH[-1]
        across = float(np.interp(ratio, _CYLINDER_DIAMETER_OVER_LENGTH, _CYLINDER_ADDED))
        across *= min(1.0, last / ratio) * self.volume_m3()
        disc = 8.0 / 3.0 * (0.5 * self.diameter_m) ** 3
        along = disc * depth_factor(0.25 * pi * self.diameter_m**2, self.height_m)
        return (across, across, along)

    def drag_area_m2(self) -> Triple:
        """Return lateral: 1.2·κ(H/D) on D·H; axial: C_D(H/D) on the end [m²]."""
        ratio = self.height_m / self.diameter_m
        kappa = float(np.interp(ratio, _FINITE_LENGTH_OVER_DIAMETER, _FINITE_REDUCTION))
        across = _CYLINDER_DRAG * kappa * self.diameter_m * self.height_m
        end = float(np.interp(ratio, _DISC_LENGTH_OVER_DIAMETER, _DISC_DRAG))
        return (across, across, end * 0.25 * pi * self.diameter_m**2)


@dataclass(frozen=True, kw_only=True)
class Sphere:
    """A sphere."""

    diameter_m: float = quantity("diameter", "m", 0.01, 100.0)

    def volume_m3(self) -> float:
        """Return π/6·D³ [m³]."""
        return pi / 6.0 * self.diameter_m**3

    def added_mass_m3(self) -> Triple:
        """Return half its volume on every axis, exact in potential flow (Lamb 1932, §92) [m³]."""
        added = 0.5 * self.volume_m3()
        return (added, added, added)

    def drag_area_m2(self) -> Triple:
        """Return 0.5 times its disc along every axis [m²]."""
        area = _SPHERE_DRAG * 0.25 * pi * self.diameter_m**2
        return (area, area, area)


def plate_added_m3(side_m: float, other_m: float) -> float:
    """Return added mass over ρ of a rectangular plate along its normal [m³]: C_A(b/a)·π/4·a²·b."""
    a, b = min(side_m, other_m), max(side_m, other_m)
    return float(np.interp(a / b, _PLATE_SHORT_OVER_LONG, _PLATE_ADDED)) * 0.25 * pi * a**2 * b


def depth_factor(face_m2: float, depth_m: float) -> float:
    """Return the factor on the plate's added mass for a body of depth h behind its face A.

    1 + √((1 - λ²)/(2·(1 + λ²))), λ = √A/(h + √A) (DNV-RP-N103, 4.6): 1 for a plate, 1.71 for a very
    deep body. A cube gets 0.70 of its volume, compared with 0.68 in table A-2.
    """
    square = (sqrt(face_m2) / (depth_m + sqrt(face_m2))) ** 2
    return 1.0 + sqrt((1.0 - square) / (2.0 * (1.0 + square)))


def box_drag(side_m: float, other_m: float, depth_m: float) -> float:
    """Return C_D of a face a×b with a depth: a plate if shallower than √(a·b), else a rod."""
    ratio = depth_m / sqrt(side_m * other_m)
    if ratio >= 1.0:
        return float(np.interp(ratio, _ROD_LENGTH_OVER_SIDE, _ROD_DRAG))
    longer = max(side_m, other_m) / min(side_m, other_m)
    return float(np.interp(longer, _PLATE_LONG_OVER_SHORT, _PLATE_DRAG))
