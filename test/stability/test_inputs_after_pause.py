"""Inputs after a pause or restart: a replay continues unchanged, a ship has moved meanwhile."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rope_twin import Twin
from rope_twin.scene.schema import Winch as WinchScene
from rope_twin.twin.motion.heave_track import HeaveTrack
from rope_twin.twin.winch.commands import WinchCommand
from rope_twin.twin.winch.winch import Winch

SAMPLE_NS, STEP_NS, AHEAD_NS = 50_000_000, 10_000_000, 350_000_000
PAUSE_NS = 4_000_000_000
SCENE = WinchScene(
    speed_limit_m_per_s=2.0,
    acceleration_limit_m_per_s2=0.5,
    min_line_out_m=10.0,
    max_line_out_m=200.0,
)


def heave(at_ns: int, phase: float) -> tuple[float, float]:
    t = at_ns * 1e-9
    return 2.0 * math.sin(0.9 * t + phase), 1.8 * math.cos(0.9 * t + phase)


def feed(track: HeaveTrack, from_ns: int, to_ns: int, phase: float = 0.0) -> list[str]:
    """Feed the samples with from_ns <= stamp < to_ns; return what was refused."""
    stamps = range(-(-from_ns // SAMPLE_NS) * SAMPLE_NS, to_ns, SAMPLE_NS)
    return [message for stamp in stamps if (message := track.submit(stamp, *heave(stamp, phase)))]


def follow(track: HeaveTrack, from_ns: int, to_ns: int, phase: float = 0.0) -> np.ndarray:
    """Step on with samples that come in time; return rows of position and velocity."""
    rows = []
    for now in range(from_ns + STEP_NS, to_ns + 1, STEP_NS):
        if (now + AHEAD_NS) % SAMPLE_NS == 0:
            assert not feed(track, now + AHEAD_NS, now + AHEAD_NS + 1, phase)
        rows.append(track.at(now))
    return np.array(rows)


def started() -> tuple[HeaveTrack, np.ndarray]:
    track = HeaveTrack()
    assert not feed(track, -100_000_000, AHEAD_NS + 1)
    return track, follow(track, 0, PAUSE_NS)


def test_a_repeated_replay_continues_bit_identically() -> None:
    """Every repeated sample is accepted, and the motion equals that without the pause."""
    track, _ = started()
    track.invalidate()
    # from a little before the twin's present on, as a feeding node does
    assert not feed(track, PAUSE_NS - 600_000_000, PAUSE_NS + AHEAD_NS + 1)
    after = follow(track, PAUSE_NS, 2 * PAUSE_NS)
    other, _ = started()
    assert after.tobytes() == follow(other, PAUSE_NS, 2 * PAUSE_NS).tobytes()
    assert track.counter.health(0, False).refused == 0


@pytest.mark.parametrize("phase", [0.5, math.pi, 4.5])
@pytest.mark.parametrize("late_ns", [0, 400_000_000])
def test_a_moved_ship_is_joined_smoothly(phase: float, late_ns: int) -> None:
    """Its samples are accepted from the first on and reached within the time of a rejoining.

    Up to 4 m apart: without the doubt they are refused for a while and then joined within one
    sample, at up to 15 m/s. The cubic adds 6·jump/T² = 0.5 m/s², so it is at most 1.5·jump/T
    faster than the motions it joins.
    """
    track, before = started()
    track.invalidate()
    follow_ns = PAUSE_NS + late_ns
    waiting = [track.at(now) for now in range(PAUSE_NS + STEP_NS, follow_ns + 1, STEP_NS)]
    assert not feed(track, follow_ns + 1, follow_ns + AHEAD_NS + 1, phase)
    after = follow(track, follow_ns, follow_ns + 3 * PAUSE_NS, phase)
    jump = (waiting or [before[-1]])[-1][0] - heave(follow_ns, phase)[0]
    lead_s = max(2.0, math.sqrt(6.0 * abs(jump) / 0.5))
    motion = np.vstack([before, *waiting, after])
    jumps = np.abs(np.diff(motion[:, 0]))
    assert jumps.max() < (1.8 + 1.8 + 1.5 * abs(jump) / lead_s) * 0.01
    times = follow_ns + STEP_NS * np.arange(1, len(after) + 1)
    late = times > follow_ns + round((lead_s + 0.3) * 1e9)
    assert late.any()
    there = np.array([heave(int(at), phase) for at in times[late]])
    assert np.abs(after[late] - there).max() < 1e-3
    assert track.counter.health(0, False).refused == 0


def test_an_invalid_sample_does_not_discard_the_known_samples() -> None:
    """It is rejected, and the known samples are still there for the replay."""
    track, _ = started()
    track.invalidate()
    for z in (math.nan, 99.0):
        assert track.submit(PAUSE_NS + SAMPLE_NS + 1, z, 0.0)
    assert track.submit(PAUSE_NS - 1, 0.0, 0.0), "it is late"
    assert not feed(track, PAUSE_NS, PAUSE_NS + AHEAD_NS + 1)
    other, _ = started()
    after = follow(track, PAUSE_NS, 2 * PAUSE_NS)
    assert after.tobytes() == follow(other, PAUSE_NS, 2 * PAUSE_NS).tobytes()


def test_a_repeated_replay_is_no_step_of_its_clock() -> None:
    """The sender begins again 0.35 s before the present, all of it at once: its stamps run
    backwards and their arrival is late, but its clock is right.
    """

    def play(twin: Twin, from_ns: int, until_ns: int) -> None:
        for now in range(from_ns, until_ns, SAMPLE_NS):
            stamp = now + 200_000_000
            assert not twin.submit_heave(stamp, *heave(stamp, -1.5), received_ns=now)
            if now >= twin.time_ns:
                twin.advance(SAMPLE_NS // twin.step_ns)

    unbroken, resumed = Twin("shallow_lift"), Twin("shallow_lift")
    for twin in unbroken, resumed:
        play(twin, 0, PAUSE_NS)
    resumed.invalidate_inputs()
    for stamp in range(PAUSE_NS - 450_000_000, PAUSE_NS + 200_000_000, SAMPLE_NS):
        received = PAUSE_NS - 350_000_000
        assert not resumed.submit_heave(stamp, *heave(stamp, -1.5), received_ns=received)
    for twin in unbroken, resumed:
        play(twin, PAUSE_NS, 2 * PAUSE_NS)
    was, now = unbroken.snapshot(), resumed.snapshot()
    assert now.node_position_m.tobytes() == was.node_position_m.tobytes()
    assert now.inputs["heave"].refused == 0


def scheduled() -> Winch:
    """A winch that has done 1 s of a plan and knows 0.5 s more of it."""
    winch = Winch(SCENE, 100.0)
    for stamp_ns in range(0, 1_500_000_000, 100_000_000):
        assert not winch.take(stamp_ns, WinchCommand("speed", 1.0), 0)
    for now in range(0, 1_000_000_000, STEP_NS):
        winch.step(now, 0.01)
    return winch


def line_out(winch: Winch, from_ns: int, to_ns: int) -> list[tuple[float, float]]:
    lines = [winch.step(now, 0.01) for now in range(from_ns, to_ns, STEP_NS)]
    return [(line.length_m, line.speed_m_per_s) for line in lines]


def test_a_repeated_winch_schedule_continues() -> None:
    """Done and waiting commands are known: none is rejected, and the line out is the same."""
    winch, other = scheduled(), scheduled()
    winch.invalidate()
    for stamp_ns in range(500_000_000, 1_500_000_000, 100_000_000):
        assert not winch.take(stamp_ns, WinchCommand("speed", 1.0), 1_000_000_000)
    for one in (winch, other):
        assert not one.take(1_500_000_000, WinchCommand("speed", -0.5), 1_200_000_000)
    span = (1_000_000_000, 4_000_000_000)
    assert line_out(winch, *span) == line_out(other, *span)
    assert winch.counter.health(0, False).refused == 0


def test_a_stop_replaces_a_schedule_from_before_the_pause() -> None:
    """It replaces the old schedule from its stamp on."""
    winch = scheduled()
    assert winch.take(1_050_000_000, WinchCommand("speed", 0.0), 1_000_000_000), (
        "without a pause the order holds"
    )
    winch.invalidate()
    assert not winch.take(1_050_000_000, WinchCommand("speed", 0.0), 1_000_000_000)
    assert line_out(winch, 1_000_000_000, 4_000_000_000)[-1][1] == 0.0
    assert winch.take(900_000_000, WinchCommand("speed", 0.0), 4_000_000_000), "late is late"
