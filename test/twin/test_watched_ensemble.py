"""Steps that an ensemble records, against those of a fleet with the same inputs."""

from __future__ import annotations

import numpy as np
import pytest

from rope_twin.core.jit.wide import LANES
from rope_twin.core.lanes.step import (
    EAST,
    LOWEST_TENSION,
    MIN_TENSION,
    NORTH,
    PAYLOAD_DEPTH,
    PAYLOAD_DESCENT,
)
from rope_twin.errors import InputError
from rope_twin.scene.load import at_setting, load_scene
from rope_twin.twin.ensemble.ensemble import Ensemble, Variation
from rope_twin.twin.ensemble.fleet import Fleet, FleetInputs
from rope_twin.twin.motion.heave_track import HeaveSeries
from rope_twin.twin.twin import Twin

SECONDS = 20.0


def heaves(members: int, amplitude_m: float) -> list[HeaveSeries]:
    """Return sines of different periods, sampled at 20 Hz."""
    stamps = np.arange(-2, round(SECONDS / 0.05) + 20, dtype=np.int64) * 50_000_000
    time_s = stamps * 1e-9
    made = []
    for k in range(members):
        omega = 2.0 * np.pi / (5.0 + k)
        z, v = np.sin(omega * time_s), omega * np.cos(omega * time_s)
        made.append(HeaveSeries(stamps, amplitude_m * z, amplitude_m * v))
    return made


@pytest.mark.parametrize("members", [LANES, 1])
@pytest.mark.parametrize(
    ("name", "elements", "step_s", "amplitude_m", "slack"),
    [
        ("shallow_lift", 39, 0.05, 0.8, False),
        ("shallow_lift", 39, 0.05, 6.0, True),
        ("lift_off", 6, 0.0025, 0.4, True),  # a rigid body, on a deck at first
    ],
)
def test_watched_steps_are_those_of_a_fleet(
    name: str, elements: int, step_s: float, amplitude_m: float, slack: bool, members: int
) -> None:
    """Top tension, minimum tension, depth, speed and payload tension agree to the bit."""
    scene = at_setting(load_scene(name), elements, step_s)
    moved = heaves(members, amplitude_m)
    ensemble = Ensemble(scene, [Variation((), one) for one in moved], threads=1, watched=True)
    inputs = [border_motion(ensemble, k) for k in range(members)]
    ensemble = Ensemble(scene, [Variation((), one) for one in moved], threads=1, watched=True)
    assert ensemble.lanes().members == (members if members == LANES else 0)
    first = SECONDS / 4.0
    ensemble.advance(first)
    parts = [[ensemble.watched(k)] for k in range(members)]
    ensemble.advance(SECONDS - first)
    for k, own in enumerate(parts):
        own.append(ensemble.watched(k))
    fleet = Fleet(scene, members, elements=elements, step_s=step_s)
    stacked = (np.stack(columns, axis=1) for columns in zip(*inputs, strict=True))
    record = fleet.advance(FleetInputs(*stacked), interval_steps=1)
    assert not record.failures
    for k, own in enumerate(parts):
        top, *samples, line_out = np.concatenate(own).T
        np.testing.assert_array_equal(line_out, inputs[k][2][1:])
        np.testing.assert_array_equal(top, record.top_tension_n[:, k])
        np.testing.assert_array_equal(samples[MIN_TENSION], record.min_tension_n[:, k])
        np.testing.assert_array_equal(samples[PAYLOAD_DEPTH], record.payload_depth_m[:, k])
        np.testing.assert_array_equal(samples[PAYLOAD_DESCENT], record.payload_speed_m_per_s[:, k])
        np.testing.assert_array_equal(samples[LOWEST_TENSION], record.payload_tension_n[:, k])
        share = float((record.min_tension_n[:, k] <= 0.0).mean())
        assert ensemble.figures()[k].slack_share == pytest.approx(share, abs=1e-12)
    slackest = max(one.slack_share for one in ensemble.figures())
    assert (slackest > 0.0) == slack


def border_motion(ensemble: Ensemble, member: int) -> tuple[np.ndarray, ...]:
    """Return heave, its rate, line out and line speed of a member at all step borders."""
    borders = ensemble._members[member].boundaries
    steps = round(SECONDS / ensemble.step_s)
    value, rate = borders.through(0, steps)
    rest_m = ensemble.scene.ship.hang_off_m[2]
    return value[:, 2] - rest_m, rate[:, 2], value[:, 3], rate[:, 3]


def test_ropes_that_meet_are_not_watched() -> None:
    """They step by a twin each, which records nothing."""
    scene = load_scene("bridle_lift")
    with pytest.raises(InputError, match="are not watched; step them with"):
        Ensemble(scene, [Variation()], watched=True)


def test_watched_distance_is_that_of_the_ends() -> None:
    """In the current at rest that of statics; the same to the bit in lanes and alone."""
    scene = at_setting(load_scene("shallow_lift"), 39, 0.05)
    moved = heaves(LANES, 0.8)
    found = []
    for members in (moved, moved[:1]):
        ensemble = Ensemble(scene, [Variation((), one) for one in members], threads=1, watched=True)
        ensemble.advance(SECONDS / 4.0)
        found.append(ensemble.watched(0)[:, [1 + EAST, 1 + NORTH]])
    np.testing.assert_array_equal(*found)
    at_rest = Twin(scene).snapshot().payload_position_m[:2] - np.array(scene.ship.hang_off_m[:2])
    assert np.hypot(*at_rest) > 0.1
    assert found[0][0] == pytest.approx(at_rest, abs=1e-6)
