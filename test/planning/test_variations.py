"""Inputs of a seed where rope and payload feel the waves that the ship answers."""

from __future__ import annotations

import math

import pytest

from rope_twin.effects.waves import WavesParams
from rope_twin.planning.phases import Leg, legs_of
from rope_twin.planning.plan_reader import read_plan, tip_of
from rope_twin.planning.runs import sea_seed, variation
from rope_twin.planning.seas import SeaState, Ship
from rope_twin.recording.motion_source import sea_of_waves
from rope_twin.scene.load import change_scene


def splash() -> tuple[Leg, Ship]:
    """Return the leg of the shipped plan through the splash zone, and its ship."""
    plan, scene = read_plan("splash_zone")
    (leg,) = legs_of(plan, scene, plan.phases[0])
    return leg, Ship(tip_of(plan, scene), plan.bow_of(scene))


def test_ship_and_payload_have_the_same_waves() -> None:
    """The tip's record is that of the scene with the seed's own waves, sample by sample."""
    leg, ship = splash()
    own = variation(leg, ship, SeaState(2.0, 8.0, 180.0, 3.0, 6.0), 77)
    scene = change_scene(leg.scene, own.changes)
    waves = scene.listed(WavesParams)
    assert waves is not None
    assert waves.jonswap is not None
    sea = waves.jonswap
    assert (sea.significant_height_m, sea.peak_period_s, sea.gamma) == (2.0, 8.0, 3.0)
    assert waves.seed == 77
    motion = sea_of_waves(scene)
    assert motion is not None
    assert own.heave is not None
    for k in (0, 50, 333):
        sample = motion.sample(int(own.heave.stamp_ns[k]))
        assert own.heave.position_m[k] == pytest.approx(sample.position_m, abs=1e-9)


def test_heading_counts_from_the_bow() -> None:
    """Waves on the bow of a ship that heads north travel south, 270° from east."""
    plan, scene = read_plan("deep_installation")
    leg, _ = splash()
    ship = Ship(tip_of(plan, scene), math.radians(90.0))
    own = variation(leg, ship, SeaState(1.0, 8.0, 180.0), 5)
    heading = next(one.value for one in own.changes if one.path.endswith("heading_deg"))
    assert heading % 360.0 == pytest.approx(270.0)
    assert own.heave is not None
    assert own.heave.lateral is not None


def test_seeds_differ_by_phase_leg_and_number() -> None:
    """No two runs of a plan have one sea; all are whole numbers below 2^31, and repeat."""
    seeds = [sea_seed(1, p, leg, k) for p in range(4) for leg in range(4) for k in range(64)]
    assert len(set(seeds)) == len(seeds)
    assert all(0 <= seed < 2**31 for seed in seeds)
    assert sea_seed(1, 2, 3, 4) == sea_seed(1, 2, 3, 4) != sea_seed(2, 2, 3, 4)
