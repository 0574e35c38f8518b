"""A planned landing of a rigid body: its lowest corner counts, not the hook above its slings."""

from __future__ import annotations

from dataclasses import replace

import pytest

from rope_twin import Twin
from rope_twin.effects.payload import PayloadParams
from rope_twin.effects.rigid_body import RigidBodyParams, Sling
from rope_twin.effects.seabed import SeabedParams
from rope_twin.planning.phases import legs_of
from rope_twin.planning.plan_reader import read_plan, tip_of
from rope_twin.planning.runs import run_seeds
from rope_twin.planning.seas import Ship
from rope_twin.scene.schema import Scene

SLINGS = tuple(
    Sling(to_m=(x, y, 1.25), length_m=7.0, stiffness_n_per_m=5e6, damping_newton_seconds_per_m=1e5)
    for x in (1.8, -1.8)
    for y in (1.3, -1.3)
)
BODY = RigidBodyParams(size_m=(4.0, 3.0, 2.5), hook_mass_kg=600.0, slings=SLINGS)


def with_body(scene: Scene, depth_m: float) -> Scene:
    """The scene with its payload as a rigid body on slings, in shallower water."""
    effects = [BODY if isinstance(effect, PayloadParams) else effect for effect in scene.effects]
    effects = [
        SeabedParams(depth_m=depth_m) if isinstance(effect, SeabedParams) else effect
        for effect in effects
    ]
    (line,) = scene.ropes
    line = replace(line, length_m=depth_m - 20.0, elements=10)
    assert scene.winch is not None
    winch = replace(scene.winch, min_line_out_m=10.0)
    return replace(scene, effects=tuple(effects), ropes=(line,), winch=winch)


def test_a_body_lands_with_its_lowest_corner_at_the_speed_of_the_winch() -> None:
    """It starts as high above the bed as the plan says, and lands in a sea of 5 cm."""
    plan, scene = read_plan("landing")
    scene = with_body(scene, 80.0)
    phase = next(one for one in plan.phases if one.kind == "landing")
    (leg,) = legs_of(plan, scene, phase)
    snapshot = Twin(leg.scene).snapshot()
    assert snapshot.seabed is not None
    assert snapshot.seabed.payload_height_m == pytest.approx(5.0, abs=5e-3)
    middle_m = -float(snapshot.payload_position_m[2])
    assert leg.bed_m == pytest.approx(middle_m + 5.0, abs=5e-3)
    assert leg.bed_m == pytest.approx(80.0 - 1.25, abs=0.05), "half its height above the bed"
    assert leg.to_m - leg.from_m == pytest.approx(5.0 + 2.0, abs=5e-3)
    (row,) = run_seeds(leg, Ship(tip_of(plan, scene), 0.0), plan.sea_state(0.05, 0, 0), [0])
    assert not row["failure"]
    assert row["landing_speed_m_per_s"] == pytest.approx(0.2, abs=0.03)
