"""What the physics tests are built from: rigs, and the core's arrays at rest."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rope_twin import Twin
from rope_twin.effects.payload import PayloadParams
from rope_twin.scene.schema import Payload, Scene
from rope_twin.studies.driven_twin import Motion, Speeds, march, still
from validation.rigs import NOTHING, STILL_WATER, Rig, sine
from validation.state_bench import Bench, frequency, lift

__all__ = [
    "NOTHING", "STILL_WATER", "Bench", "Motion", "Rig", "Speeds", "frequency", "lift", "march",
    "sine", "still", "top_tension", "with_nothing_below",
]  # fmt: skip

Vector = NDArray[np.float64]
Heave = Motion


def top_tension(twin: Twin, heave: Heave, seconds: float, every: int = 1) -> Vector:
    """The published top tension [N] after each `every` steps."""
    return np.array([shot.tension_top_n for shot in march(twin, heave, seconds, every)])


def with_nothing_below(scene: Scene) -> Scene:
    """A rig's scene whose lower end is held, with a payload of no mass there.

    No load on a node that is held counts. Its step is the one that scenes with a payload are
    compiled for anyway.
    """
    (line,) = scene.ropes
    nothing = Payload(
        name="nothing", mass_kg=0.0, displaced_volume_m3=0.0, added_mass_kg=(0.0, 0.0, 0.0),
        drag_area_m2=(0.0, 0.0, 0.0),
    )  # fmt: skip
    return replace(
        scene,
        ropes=(replace(line, to=nothing.name),),
        payloads=(nothing,),
        effects=(*scene.effects, PayloadParams()),
    )
