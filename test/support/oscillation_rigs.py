"""Rigs for factors by the Keulegan-Carpenter number of rope and payload, with one compiled step.

Each test has the one that it is about; the other's factors are 1. In calm water there are waves of
no height, and a current that does not change has a factor of time.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from rigs import CALM

from rope_twin.effects.current import CurrentParams
from rope_twin.effects.drag import DragParams, KeuleganCarpenter, RoughnessTable
from rope_twin.effects.payload_oscillation import PayloadOscillationParams
from rope_twin.scene.schema import Scene

ONE = RoughnessTable(roughness=1e-3, rows=((5.0, 1.0),))  # whatever the number
EVEN = ((3.0, 1.0),)


def by_one(drag: DragParams) -> DragParams:
    """Return drag by Keulegan-Carpenter number with a factor of 1."""
    return replace(drag, over_keulegan_carpenter=KeuleganCarpenter(tables=(ONE,)))


def payload_by(
    drag: Any = EVEN, added: Any = EVEN, size_m: float = 1.0, window_s: float = 30.0
) -> PayloadOscillationParams:
    """Return a payload of this size with these factors on drag and added mass."""
    return PayloadOscillationParams(
        size_m=(size_m,) * 3, drag=drag, added_mass=added, window_s=window_s
    )


def oscillating(scene: Scene, *more: Any) -> Scene:
    """Return the scene with further effects, each replacing the scene's own of its kind.

    Its drag and its payload go by their numbers, where `more` does not say how with factors of 1.
    """
    effects = {type(own): own for own in (*scene.effects, payload_by(), *more)}
    drag = effects[DragParams]
    if drag.over_keulegan_carpenter is None:
        effects[DragParams] = by_one(drag)
    return replace(scene, effects=tuple(effects.values()))


def in_time(scene: Scene, *more: Any) -> Scene:
    """Return the rig's `oscillating` scene in waves and in a current with a time factor."""
    found = oscillating(scene, *more)
    effects = {type(own): own for own in (CALM, *found.effects)}
    current = effects[CurrentParams]
    effects[CurrentParams] = replace(current, over_time=current.over_time or ((0.0, 1.0),))
    return replace(found, effects=tuple(effects.values()))
