"""Scenes with time-varying current, fluid ramps and vortices that share one compiled step.

Each test has what it is about; the rest of the step is there without a force.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from rope_twin.effects.current import CurrentParams
from rope_twin.effects.fluid_ramp import FluidRampParams, LoadCurve
from rope_twin.effects.payload_shedding import PayloadSheddingParams
from rope_twin.effects.strouhal_forcing import StrouhalForcingParams
from rope_twin.scene.schema import Scene

QUIET = (
    StrouhalForcingParams(drag=0.0),
    PayloadSheddingParams(strouhal=0.2, lift_coefficient=0.0, diameter_m=1.0, area_m2=1.0),
    FluidRampParams(water=LoadCurve(over_time=((0.0, 1.0),))),
)


def in_time(scene: Scene, *more: Any) -> Scene:
    """Return the scene with further effects, each replacing the scene's own of its kind.

    Its current has a vertical part, be it 0, and a factor of time, be it 1; what of QUIET is not
    given is there too.
    """
    effects = {type(own): own for own in (*QUIET, *scene.effects, *more)}
    current = effects[CurrentParams]
    assert isinstance(current, CurrentParams)
    profile = tuple((z, (*velocity, 0.0)[:3]) for z, velocity in current.points)
    over_time = current.over_time or ((0.0, 1.0),)
    effects[CurrentParams] = CurrentParams(profile=profile, over_time=over_time)
    return replace(scene, effects=tuple(effects.values()))
