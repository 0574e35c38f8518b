"""Samples of a lift: the numbers of a snapshot, and tensions of every step between."""

from __future__ import annotations

import numpy as np
import pytest

from rope_twin import load_scene
from rope_twin.planning.lift_monitor import LiftMonitor, LiftSample
from rope_twin.scene.rigging import places
from rope_twin.scene.schema import Scene
from rope_twin.twin.monitors import Monitors
from rope_twin.twin.snapshot import Snapshot
from rope_twin.twin.twin import Twin

EVERY, STEPS = 3, 11


def from_ship(scene: Scene) -> set[str]:
    """Return the names of the ropes that leave the ship; none for a single rope."""
    at_ship = places(scene)
    return {rope.name for rope in scene.ropes if rope.from_ in at_ship and len(scene.ropes) > 1}


def stepped(scene: Scene) -> tuple[list[LiftSample], list[list[Snapshot]]]:
    """Return the samples of a run, and the snapshots of the steps that each of them covers."""
    monitor = LiftMonitor(scene, from_ship(scene), EVERY, STEPS)
    twin = Twin(scene, Monitors(further=(monitor,)))
    twin.advance(STEPS)
    alone, snapshots = Twin(scene), []
    for _ in range(STEPS):
        alone.advance(1)
        snapshots.append(alone.snapshot())
    return list(monitor.take()), [snapshots[k : k + EVERY] for k in range(0, STEPS, EVERY)]


@pytest.mark.parametrize("name", ["lift_off", "two_line_lift", "two_line_loop"])
def test_samples_have_the_numbers_of_snapshots(name: str) -> None:
    """At their own time; tensions at upper ends are the extremes of every step since the last."""
    scene = load_scene(name)
    samples, covered = stepped(scene)
    assert len(samples) == len(covered)
    names = from_ship(scene)
    for sample, steps in zip(samples, covered, strict=True):
        now = steps[-1]
        assert sample.time_s == now.time_s
        hoists = [k for k, rope in enumerate(now.ropes) if rope.name in names]
        tops = [[one.ropes[k].tension_top_n for k in hoists] for one in steps]
        first = [one.tension_top_n for one in steps]
        assert sample.top_max_n == (np.max(tops) if hoists else max(first))
        assert sample.top_min_n == min(first)
        assert sample.payload_n == now.tension_payload_n
        assert sample.depth_m == -now.payload_position_m[2]
        np.testing.assert_array_equal(sample.hang_off_m, now.hang_off_position_m)
        ends = [now.ropes[k].node_position_m[0] for k in hoists] or [now.hang_off_position_m]
        away = now.payload_position_m - np.mean(ends, axis=0)
        assert sample.offset_m == np.hypot(*away[:2])
        lowest = [rope.element_tension_n[-1] for rope in now.ropes]
        assert [rope.lowest_n for rope in sample.ropes][: len(lowest)] == lowest
        elements = [rope.element_tension_n for rope in now.ropes] or [now.element_tension_n]
        assert sample.min_n == min(tension.min() for tension in elements)
        for k, rope in enumerate(now.ropes):
            top = max(one.ropes[k].tension_top_n for one in steps)
            assert sample.ropes[k].max_n == max(rope.element_tension_n.max(), top)
        body = now.body
        deck = None if body is None else (body.deck_reaction_n, body.deck_clearance_m)
        assert sample.deck == deck
    assert (samples[0].deck is None) == (name != "lift_off")
