"""Every scene that comes with the package runs, under heave and its own winch schedule.

Always 20 s of those that between them have every part of a step; a minute of each of all:
`pytest -m long test/stability/test_scenes_run.py`.
"""

from __future__ import annotations

import math

import golden_states
import numpy as np
import pytest
from small_scene import not_finite

from rope_twin import Twin, load_scene
from rope_twin.scene.load import scene_names
from rope_twin.twin.winch.commands import schedule_samples

SOME_S, LONG_S = 20, 60
SAMPLE_NS = 50_000_000
AMPLITUDE_M, PERIOD_S = 2.0, 9.0


@pytest.mark.parametrize(
    ("name", "seconds"),
    [(name, SOME_S) for name in golden_states.covering()]
    + [pytest.param(name, LONG_S, marks=pytest.mark.long) for name in scene_names()],
)
def test_a_shipped_scene_runs(name: str, seconds: int) -> None:
    """Finite, every step converged, the pull between nothing and the rope's breaking load."""
    scene = load_scene(name)
    twin = Twin(scene)
    omega = 2.0 * math.pi / PERIOD_S
    second_ns = 1_000_000_000
    tensions = []
    for second in range(seconds):
        for stamp in range(second * second_ns, (second + 1) * second_ns + 1, SAMPLE_NS):
            angle = omega * stamp * 1e-9
            z, v = AMPLITUDE_M * math.sin(angle), AMPLITUDE_M * omega * math.cos(angle)
            if second == 0 or stamp > second * second_ns:
                assert twin.submit_heave(stamp, z, v) == ""
        for row in schedule_samples(scene.winch, second * second_ns, (second + 1) * second_ns):
            assert twin.submit_command(row.stamp_ns, row.command) == ""
        twin.advance(round(1.0 / twin.step_s))
        snapshot = twin.snapshot()
        assert not not_finite(snapshot)
        assert not snapshot.not_converged
        tensions += [snapshot.tension_top_min_n, snapshot.tension_top_max_n]
    assert snapshot.time_s == pytest.approx(seconds)
    weakest = min(section.rope.breaking_load_n for section in scene.ropes[0].made_of)
    assert 0.0 <= np.min(tensions) < np.max(tensions) < weakest
    assert np.ptp(tensions) > 0.02 * np.mean(tensions), "the ship heaves"
