"""Available payload shapes, and the payload properties derived from them."""

from __future__ import annotations

from dataclasses import dataclass

from rope_twin.errors import SceneError, phrase
from rope_twin.scene.rising import Rising, TwoWayShape
from rope_twin.scene.schema import Payload, Shape, Triple
from rope_twin.scene.shapes.flooded import Skip, SuctionAnchor, Template
from rope_twin.scene.shapes.grab import Grab
from rope_twin.scene.shapes.outline import Box, Cylinder, Sphere

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
        own = self.added_mass_rising_kg
        return self.added_mass_kg[2] if own is None else own

    @property
    def rising_drag_area_m2(self) -> float:
        """Return the drag area along z in ascent [m²]."""
        own = self.drag_area_rising_m2
        return self.drag_area_m2[2] if own is None else own

    @property
    def differs_rising(self) -> bool:
        """Return whether its properties differ between ascent and descent."""
        sinking = (self.added_mass_kg[2], self.drag_area_m2[2])
        return (self.rising_added_mass_kg, self.rising_drag_area_m2) != sinking


def payload_figures(payload: Payload, water_density_kg_per_m3: float) -> PayloadFigures:
    """Return the properties of a payload: explicit keys first, the rest from its shape.

    Raises:
        SceneError: if a property is given by neither.
    """
    shape, volume = payload.shape, payload.displaced_volume_m3
    added, drag = payload.added_mass_kg, payload.drag_area_m2
    own = payload.rising or Rising()
    rising_drag = own.drag_area_m2
    if shape is not None:
        volume = shape.volume_m3() if volume is None else volume
        if rising_drag is None and drag is None and isinstance(shape, TwoWayShape):
            rising_drag = shape.rising_drag_area_m2()
        drag = shape.drag_area_m2() if drag is None else drag
        if added is None:
            x, y, z = (water_density_kg_per_m3 * value for value in shape.added_mass_m3())
            added = (x, y, z)
    if volume is None or added is None or drag is None:
        what = "without a shape its volume, added mass or drag area cannot be known"
        right = "add a shape, or displaced_volume_m3, added_mass_kg and drag_area_m2"
        raise SceneError(phrase(f"payload '{payload.name}'", what, right))
    return PayloadFigures(payload.mass_kg, volume, added, drag, own.added_mass_kg, rising_drag)
