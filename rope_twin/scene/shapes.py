"""Available payload shapes, and the payload properties derived from them."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, exp, pi, sqrt

import numpy as np

from rope_twin.errors import SceneError
from rope_twin.quantity import quantity, text
from rope_twin.scene.schema import Payload, Rising, Shape, Triple, TwoWayShape

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
# Beyond 10 it nears that of the infinite plate with the short side over the long one.
_PLATE_LONG_OVER_SHORT = (1.0, 5.0, 10.0)
_PLATE_DRAG, _PLATE_DRAG_INFINITE = (1.16, 1.20, 1.50), 1.90

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
        lateral = float(np.interp(ratio, _CYLINDER_DIAMETER_OVER_LENGTH, _CYLINDER_ADDED))
        lateral *= min(1.0, last / ratio) * self.volume_m3()
        disc = 8.0 / 3.0 * (0.5 * self.diameter_m) ** 3
        axial = disc * depth_factor(0.25 * pi * self.diameter_m**2, self.height_m)
        return (lateral, lateral, axial)

    def drag_area_m2(self) -> Triple:
        """Return lateral: 1.2·κ(H/D) on D·H; axial: C_D(H/D) on the end [m²]."""
        ratio = self.height_m / self.diameter_m
        kappa = float(np.interp(ratio, _FINITE_LENGTH_OVER_DIAMETER, _FINITE_REDUCTION))
        lateral = _CYLINDER_DRAG * kappa * self.diameter_m * self.height_m
        end = float(np.interp(ratio, _DISC_LENGTH_OVER_DIAMETER, _DISC_DRAG))
        return (lateral, lateral, end * 0.25 * pi * self.diameter_m**2)


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
    longer, last = max(side_m, other_m) / min(side_m, other_m), _PLATE_LONG_OVER_SHORT[-1]
    tabulated = float(np.interp(longer, _PLATE_LONG_OVER_SHORT, _PLATE_DRAG))
    return tabulated + (_PLATE_DRAG_INFINITE - tabulated) * (1.0 - last / max(longer, last))


def perforation_factor(open_percent: float) -> float:
    """Return the factor on the added mass along z for a percentage of open area."""
    if open_percent <= 5.0:
        return 1.0
    if open_percent < 34.0:
        return 0.7 + 0.3 * cos(pi * (open_percent - 5.0) / 34.0)
    return exp((10.0 - open_percent) / 28.0)


def _wall_fault(wall_m: float, width_m: float, height_m: float) -> str | None:
    inside = 2.0 * wall_m < width_m and wall_m < height_m
    return None if inside else f"a wall of {wall_m:g} m leaves no inside; give less"


@dataclass(frozen=True, kw_only=True)
class SuctionAnchor:
    """A cylinder open at the bottom, with a top plate that may have hatches."""

    diameter_m: float = quantity("outer diameter", "m", 0.1, 50.0)
    height_m: float = quantity("height along z", "m", 0.1, 60.0)
    wall_m: float = quantity("thickness of wall and top plate", "m", 1e-3, 0.5)
    hatch_percent: float = quantity("open area of the top plate", "%", 0.0, 50.0, default=0.0)

    def check(self) -> str | None:
        """Return a fault if the wall leaves no interior, or None."""
        return _wall_fault(self.wall_m, self.diameter_m, self.height_m)

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
        return _wall_fault(self.wall_m, min(self.length_m, self.width_m), self.height_m)

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
        factor = perforation_factor(self.open_percent)
        x, y, z = self._outline().added_mass_m3()
        return (factor * x, factor * y, factor * z)

    def drag_area_m2(self) -> Triple:
        """Return the closed box's coefficient times the solid area [m²]."""
        solid = 1.0 - 0.01 * self.open_percent
        x, y, z = self._outline().drag_area_m2()
        return (solid * x, solid * y, solid * z)

    def _outline(self) -> Box:
        return Box(length_m=self.length_m, width_m=self.width_m, height_m=self.height_m)


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


SHAPES: dict[str, type[Shape]] = {
    "box": Box,
    "cylinder": Cylinder,
    "sphere": Sphere,
    "suction_anchor": SuctionAnchor,
    "skip": Skip,
    "template": Template,
    "grab": Grab,
}


@dataclass(frozen=True)
class PayloadFigures:
    """Input of the payload effect, along x, y, z; along z in descent, if that differs."""

    mass_kg: float
    volume_m3: float
    added_mass_kg: Triple
    drag_area_m2: Triple
    added_mass_rising_kg: float | None = None  # along z in ascent; None: the same
    drag_area_rising_m2: float | None = None

    @property
    def rising_added_mass_kg(self) -> float:
        """Return the added mass along z in ascent [kg]."""
        rising_kg = self.added_mass_rising_kg
        return self.added_mass_kg[2] if rising_kg is None else rising_kg

    @property
    def rising_drag_area_m2(self) -> float:
        """Return the drag area along z in ascent [m²]."""
        rising_m2 = self.drag_area_rising_m2
        return self.drag_area_m2[2] if rising_m2 is None else rising_m2

    @property
    def differs_rising(self) -> bool:
        """Return whether its properties differ between ascent and descent."""
        sinking = (self.added_mass_kg[2], self.drag_area_m2[2])
        return (self.rising_added_mass_kg, self.rising_drag_area_m2) != sinking


NOTHING = PayloadFigures(0.0, 0.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


def payload_figures(payload: Payload, water_density_kg_per_m3: float) -> PayloadFigures:
    """Return the properties of a payload: explicit keys first, the rest from its shape.

    Raises:
        SceneError: if a property is given by neither.
    """
    shape, volume = payload.shape, payload.displaced_volume_m3
    added, drag = payload.added_mass_kg, payload.drag_area_m2
    rising = payload.rising or Rising()
    rising_drag = rising.drag_area_m2
    if shape is not None:
        volume = shape.volume_m3() if volume is None else volume
        if rising_drag is None and drag is None and isinstance(shape, TwoWayShape):
            rising_drag = shape.rising_drag_area_m2()
        drag = shape.drag_area_m2() if drag is None else drag
        if added is None:
            x, y, z = (water_density_kg_per_m3 * value for value in shape.added_mass_m3())
            added = (x, y, z)
    if volume is None or added is None or drag is None:
        problem = "without a shape its volume, added mass or drag area cannot be known"
        remedy = "add a shape, or displaced_volume_m3, added_mass_kg and drag_area_m2"
        raise SceneError(f"payload '{payload.name}'", problem, remedy)
    return PayloadFigures(payload.mass_kg, volume, added, drag, rising.added_mass_kg, rising_drag)
