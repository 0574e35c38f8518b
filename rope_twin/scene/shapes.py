"""The shapes that a payload can have, and the figures that follow for the payload effect."""

from __future__ import annotations

from dataclasses import dataclass

from rope_twin.errors import SceneError, phrase
from rope_twin.scene.flooded_shapes import Skip, SuctionAnchor, Template
from rope_twin.scene.outline_shapes import Box, Cylinder, Sphere
from rope_twin.scene.schema import Payload, Shape, Triple

SHAPES: dict[str, type[Shape]] = {
    "box": Box,
    "cylinder": Cylinder,
    "sphere": Sphere,
    "suction_anchor": SuctionAnchor,
    "skip": Skip,
    "template": Template,
}


@dataclass(frozen=True)
class PayloadFigures:
    """What the payload effect needs, along x, y, z."""

    mass_kg: float
    volume_m3: float
    added_mass_kg: Triple
    drag_area_m2: Triple


def payload_figures(payload: Payload, water_density_kg_per_m3: float) -> PayloadFigures:
    """The figures of a payload: its own keys first, its shape for what they leave open.

    Raises:
        SceneError: if a figure is given by neither.
    """
    shape, volume = payload.shape, payload.displaced_volume_m3
    added, drag = payload.added_mass_kg, payload.drag_area_m2
    if shape is not None:
        volume = shape.volume_m3() if volume is None else volume
        drag = shape.drag_area_m2() if drag is None else drag
        if added is None:
            x, y, z = (water_density_kg_per_m3 * value for value in shape.added_mass_m3())
            added = (x, y, z)
    if volume is None or added is None or drag is None:
        what = "without a shape its volume, added mass or drag area cannot be known"
        right = "add a shape, or displaced_volume_m3, added_mass_kg and drag_area_m2"
        raise SceneError(phrase(f"payload '{payload.name}'", what, right))
    return PayloadFigures(payload.mass_kg, volume, added, drag)
