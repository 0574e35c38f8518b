"""Default parameters of effects that are added to a scene.

Parameters are taken from the scene where it gives them; the others are typical values at sea: a
current of 0.5 m/s at the surface and 0.1 m/s at the lowest point that the rope reaches, waves of
sea state 4 (STANAG 4194), a seabed 10 m below that point. The uppermost rope's EI is that of a
solid rod, EA·d²/16: an upper bound, for wires that do not slip. Areas of the payload are those of
its shape.
"""

from __future__ import annotations

import dataclasses
from math import pi
from typing import Any

from rope_twin.effects import Effect
from rope_twin.effects.waves import Jonswap, WavesParams
from rope_twin.scene.schema import Scene, Triple
from rope_twin.scene.validation.environment import bed_at, bed_of

SURFACE, BELOW = (0.5, 0.0), (0.1, 0.0)  # m/s
SEA_STATE_4 = Jonswap(significant_height_m=1.9, peak_period_s=8.8)
CLEARANCE_M = 10.0


def suggested(effect: Effect, scene: Scene) -> Any:
    """Return parameters for an effect that the scene does not list, or what is missing."""
    given = _usual(effect.name, scene)
    missing = [
        field
        for field in dataclasses.fields(effect.params)
        if field.default is dataclasses.MISSING
        and field.default_factory is dataclasses.MISSING
        and field.name not in given
    ]
    if missing:
        return "it needs " + ", ".join(f"{field.name} ({_about(field)})" for field in missing)
    params = effect.params(**given)
    complaint = params.check() if hasattr(params, "check") else None
    return f"the scene has no data for it: {complaint}" if complaint else params


def _usual(name: str, scene: Scene) -> dict[str, Any]:
    """Return known or typical parameters; empty if the effect is not applicable or needs more."""
    lowest, line = _lowest_m(scene), scene.ropes[0]
    if name == "drag":
        return {"normal": 1.2, "tangential": 0.02}
    if name == "current" and lowest < 0.0:
        return {"profile": ((0.0, SURFACE), (lowest, BELOW))}
    if name == "waves" and lowest < 0.0:
        bed = bed_of(scene)
        depth = -bed_at(bed, *scene.ship.hang_off_m[:2]) if bed is not None else None
        return {"jonswap": SEA_STATE_4, "depth_m": depth}
    if name == "bending":
        rope = line.made_of[-1].rope  # that from the winch: a chain below it does not bend
        return {"stiffness_n_m2": rope.tangent_n(0.0) * rope.diameter_m**2 / 16.0}
    if name == "seabed" and lowest < 0.0:
        waves = scene.listed(WavesParams)
        known = waves.depth_m if waves is not None else None
        return {"depth_m": CLEARANCE_M - lowest if known is None else known}
    return _by_shape(name, _sides(scene))


def _by_shape(name: str, sides: Triple | None) -> dict[str, Any]:
    """Return parameters from the payload's shape, suspended at the middle of its top."""
    if sides is None:
        return {}
    length, width, height = sides
    if name == "splash_zone":
        return {"height_m": height, "bottom_area_m2": length * width}
    if name == "fairing":
        return {"face_m2": length * width}
    if name == "rigid_body":
        return {"size_m": sides, "pinned_at_m": (0.0, 0.0, 0.5 * height)}
    return {}


def _sides(scene: Scene) -> Triple | None:
    """Return the sides of the payload's outline, or of an equal square if round [m]."""
    shape = scene.payloads[0].shape if scene.payloads else None
    diameter = getattr(shape, "diameter_m", None)
    height = getattr(shape, "height_m", diameter)
    if height is None:
        return None
    square = (0.25 * pi) ** 0.5 * (diameter or 0.0)
    return getattr(shape, "length_m", square), getattr(shape, "width_m", square), height


def _lowest_m(scene: Scene) -> float:
    """Return the lowest z that the first rope reaches [m]."""
    line = scene.ropes[0]
    if line.fixed_at_m is not None:
        return line.fixed_at_m[2]
    most = scene.winch.most_line_out_m if scene.winch else line.length_m
    return scene.ship.hang_off_m[2] - most


def _about(field: dataclasses.Field[Any]) -> str:
    quantity = field.metadata.get("quantity")
    return quantity.about if quantity else str(field.metadata.get("about", ""))
