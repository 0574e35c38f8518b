"""Heave that stops, returns elsewhere or never comes: the twin continues, reports, and rejoins."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from small_scene import not_finite, small_scene

from rope_twin import Snapshot, Twin

SAMPLE_NS = 50_000_000  # 20 Hz
AHEAD_NS = 150_000_000
OMEGA = 0.8


def measured(time_s: float, raised_m: float) -> tuple[float, float]:
    """The ship's heave and its rate."""
    return 1.5 * math.sin(OMEGA * time_s) + raised_m, 1.5 * OMEGA * math.cos(OMEGA * time_s)


def with_a_gap(folder: Path, gap: tuple[float, float], raised_m: float) -> list[Snapshot]:
    """Run eighteen seconds, a snapshot each step; no sample within `gap`, an offset after it."""
    twin = Twin(small_scene(folder))
    snapshots, k = [], 0
    for step in range(1800):
        while k * SAMPLE_NS <= step * twin.step_ns + AHEAD_NS:
            t = k * SAMPLE_NS * 1e-9
            if not gap[0] < t < gap[1]:
                z, v = measured(t, raised_m if t >= gap[1] else 0.0)
                assert twin.submit_heave(k * SAMPLE_NS, z, v) == ""
            k += 1
        twin.advance(1)
        snapshots.append(twin.snapshot())
    return snapshots


@pytest.mark.parametrize("raised_m", [0.0, 1.0, -3.0])
def test_a_gap_of_two_seconds_is_bridged_without_a_jump(tmp_path: Path, raised_m: float) -> None:
    """Finite, marked stale, continuous in position and velocity, and back on the samples.

    A jump adds 6·jump/T² = 0.5 m/s², in 2 s at least: a lift that hangs at rest is not jerked.
    """
    snapshots = with_a_gap(tmp_path, (6.0, 8.0), raised_m)
    assert not [name for snapshot in snapshots for name in not_finite(snapshot)]
    assert not any(snapshot.not_converged for snapshot in snapshots)
    stale = np.array([snapshot.inputs["heave"].stale for snapshot in snapshots])
    times = np.array([snapshot.time_s for snapshot in snapshots])
    assert not stale[times < 6.0].any()
    assert stale[(times > 6.6) & (times < 7.8)].all()
    assert not stale[times > 8.2].any()
    notes = {snapshot.inputs["heave"].note for snapshot in snapshots if 7.0 < snapshot.time_s < 7.5}
    assert all("no sample for" in note for note in notes)
    heave = np.array([snapshot.heave_m for snapshot in snapshots])
    speed = np.array([snapshot.hang_off_velocity_m_per_s[2] for snapshot in snapshots])
    assert np.abs(np.diff(heave)).max() < 0.01 * 6.0
    assert np.abs(np.diff(speed)).max() < 0.05, "the hang-off must not be kicked: 5 m/s² at most"
    jump = float(heave[times < 7.9][-1]) - measured(7.9, raised_m)[0]
    late = times > 8.2 + max(2.0, math.sqrt(6.0 * abs(jump) / 0.5))
    assert late.sum() > 100
    track = np.array([measured(t, raised_m)[0] for t in times[late]])
    assert np.abs(heave[late] - track).max() < 1e-3


def test_position_and_velocity_agree_through_a_gap(tmp_path: Path) -> None:
    """The hang-off velocity is the derivative of its position, also in gap and return."""
    snapshots = with_a_gap(tmp_path, (6.0, 8.0), 1.0)
    heave = np.array([snapshot.heave_m for snapshot in snapshots])
    speed = np.array([snapshot.hang_off_velocity_m_per_s[2] for snapshot in snapshots])
    slope = (heave[2:] - heave[:-2]) / (2.0 * 0.01)
    smooth = np.abs(np.diff(speed, 2)) < 0.01  # away from the kinks where gap and return begin
    assert smooth.mean() > 0.98
    assert np.abs(slope - speed[1:-1])[smooth].max() < 0.01


def test_without_samples_the_ship_lies_still(tmp_path: Path) -> None:
    """No motion, and the note says why."""
    twin = Twin(small_scene(tmp_path))
    before = twin.snapshot()
    twin.advance(300)
    after = twin.snapshot()
    assert after.heave_m == 0.0
    assert after.tension_top_n == pytest.approx(before.tension_top_n, rel=1e-9)
    assert "no sample yet" in after.inputs["heave"].note


def test_late_first_samples_are_joined_smoothly(tmp_path: Path) -> None:
    """The first comes after 5 s, 1.2 m up, when the ramp is over."""
    snapshots = with_a_gap(tmp_path, (-1.0, 5.0), 1.2)
    heave = np.array([snapshot.heave_m for snapshot in snapshots])
    speed = np.array([snapshot.hang_off_velocity_m_per_s[2] for snapshot in snapshots])
    assert not [name for snapshot in snapshots for name in not_finite(snapshot)]
    assert np.abs(np.diff(heave)).max() < 0.01 * 6.0
    assert np.abs(np.diff(speed)).max() < 0.15
    late = np.array([snapshot.time_s > 8.0 for snapshot in snapshots])
    track = np.array([measured(snapshot.time_s, 1.2)[0] for snapshot in snapshots])
    assert np.abs(heave - track)[late].max() < 1e-3
