"""Faulty heave: rates that contradict positions, stuck, slow, jumping, or on another clock."""

from __future__ import annotations

import itertools
import math
import random
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from small_scene import digest, small_scene

from rope_twin import Snapshot
from rope_twin.messages import Level, Status, statuses
from rope_twin.scene.schema import RegularHeave, Scene, SeaState, Ship
from rope_twin.twin.twin import Twin

DELAY_S = 0.15  # the twin runs so far behind the clock
LATENCY_S = 0.01
FAULT_AT_S = 6.0
OMEGA = 2.0 * math.pi / 8.0


@dataclass(frozen=True)
class Sample:
    """A sample on its way: stamp and arrival in twin time [s]."""

    stamp_s: float
    position_m: float
    velocity_m_per_s: float
    arrival_s: float


Fault = Callable[[Sample], Sample | None]


def truth(time_s: float) -> tuple[float, float]:
    """1.5 m every 8 s."""
    return 1.5 * math.sin(OMEGA * time_s), 1.5 * OMEGA * math.cos(OMEGA * time_s)


def usual(folder: Path, sea: SeaState | None = None) -> Scene:
    """The small scene with the usual limits of a ship."""
    scene = replace(small_scene(folder), ship=Ship(motion_ramp_s=2.0))
    return replace(
        scene, sea_state=sea or SeaState(heave=RegularHeave(amplitude_m=1.5, period_s=8))
    )


@dataclass
class Run:
    """Snapshots every 20 ms and the status of heave at each."""

    snapshots: list[Snapshot]
    rows: list[Status]

    def level(self, from_s: float, to_s: float) -> Level:
        """The highest level of a stretch of twin time."""
        return max(row.level for snapshot, row in zip(self.snapshots, self.rows, strict=True)
                   if from_s <= snapshot.time_s < to_s)  # fmt: skip

    def messages(self) -> str:
        return " | ".join(dict.fromkeys(row.message for row in self.rows if row.level))

    def flagged_after_s(self, at_s: float = FAULT_AT_S) -> float:
        """Return the delay to the first status that is not OK; the twin lags by DELAY_S."""
        pairs = zip(self.snapshots, self.rows, strict=True)
        late = [snapshot.time_s + DELAY_S - at_s for snapshot, row in pairs if row.level]
        late = [after_s for after_s in late if after_s >= 0.0]
        return late[0] if late else math.inf


def heave_row(twin: Twin) -> tuple[Snapshot, Status]:
    snapshot = twin.snapshot()
    (row,) = [row for row in statuses(snapshot, None) if row.name == "simulation: input heave"]
    return snapshot, row


def run(
    twin: Twin,
    fault: Fault,
    seconds: float,
    at_s: float = FAULT_AT_S,
    rate_hz: float = 20.0,
    motion: Callable[[float], tuple[float, float]] = truth,
    clocked: bool = False,
) -> Run:
    """Feed a twin by a virtual clock; `fault` makes of each sample from `at_s` on what comes."""
    samples, k = [], -2
    while k / rate_hz < seconds + 1.0:
        stamp_s = k / rate_hz
        sample: Sample | None = Sample(stamp_s, *motion(stamp_s), stamp_s + LATENCY_S)
        if stamp_s >= at_s:
            sample = fault(sample)
        samples += [sample] if sample else []
        k += 1
    samples.sort(key=lambda sample: sample.arrival_s)
    computed = Run([], [])
    while twin.time_ns < seconds * 1e9:
        now_s = twin.time_ns * 1e-9 + DELAY_S
        while samples and samples[0].arrival_s <= now_s:
            one = samples.pop(0)
            received = (round(one.arrival_s * 1e9),) if clocked else ()
            stamp_ns = round(one.stamp_s * 1e9)
            twin.submit_heave(stamp_ns, one.position_m, one.velocity_m_per_s, *received)
        twin.advance(2)
        snapshot, row = heave_row(twin)
        computed.snapshots.append(snapshot)
        computed.rows.append(row)
    return computed


def as_it_is(sample: Sample) -> Sample:
    return sample


def rate(change: Callable[[float], float]) -> Fault:
    return lambda one: replace(one, velocity_m_per_s=change(one.velocity_m_per_s))


RATES = {
    "+15 m/s": rate(lambda v: v + 15.0),
    "times 100": rate(lambda v: 100.0 * v),
    "opposite sign": rate(lambda v: -v),
    "times 0.1": rate(lambda v: 0.1 * v),
}


@pytest.mark.parametrize("fault", RATES)
@pytest.mark.parametrize("at_s", [-1.0, FAULT_AT_S])
def test_a_rate_that_contradicts_the_position_is_replaced(
    tmp_path: Path, fault: str, at_s: float
) -> None:
    """Flagged within 2 s; from then on the hang-off moves as it truly does, and so does tension."""
    good = run(Twin(usual(tmp_path)), as_it_is, 14.0)
    bad = run(Twin(usual(tmp_path)), RATES[fault], 14.0, at_s)
    assert good.level(0.0, 14.0) is Level.OK, good.messages()
    assert bad.flagged_after_s(max(at_s, 0.0)) <= 2.0
    assert "position and velocity disagree" in bad.messages()
    late = [k for k, snapshot in enumerate(bad.snapshots) if snapshot.time_s > max(at_s, 0.0) + 2.0]
    pulls = [np.array([one.snapshots[k].tension_top_n for k in late]) for one in (good, bad)]
    assert np.abs(pulls[1] - pulls[0]).max() < 0.1 * pulls[0].std()
    speeds = [[one.snapshots[k].hang_off_velocity_m_per_s[2] for k in late] for one in (good, bad)]
    assert np.abs(np.subtract(*speeds)).max() < 0.05


def test_a_lasting_contradiction_is_an_error_and_clears(tmp_path: Path) -> None:
    """A warning at first, an error after 10 s; 5 s after the sender is right all is well."""

    def fault(one: Sample) -> Sample:
        return replace(one, velocity_m_per_s=0.0) if one.stamp_s < 22.0 else one

    computed = run(Twin(usual(tmp_path)), fault, 32.0)
    assert computed.level(8.0, 14.0) is Level.WARN
    assert computed.level(19.0, 22.0) is Level.ERROR
    assert computed.level(30.0, 32.0) is Level.OK


ALWAYS = [(4.0, -0.2, 10.0), (8.0, 0.2, 20.0), (15.0, -0.2, 20.0), (4.0, 0.2, 100.0)]
SENSORS = [
    pytest.param(*case, marks=[] if case in ALWAYS else pytest.mark.long)
    for case in itertools.product((4.0, 8.0, 15.0), (-0.2, 0.2), (10.0, 20.0, 100.0))
]


@pytest.mark.parametrize(("period_s", "delay_s", "rate_hz"), SENSORS)
def test_noise_and_latency_of_a_real_sensor_are_accepted(
    tmp_path: Path, period_s: float, delay_s: float, rate_hz: float
) -> None:
    """White noise of 5 cm in position, and 0.2 s between position and rate: all is used.

    That such noise moves the rope from sample to sample is said, and nothing else.
    """
    noise, omega = random.Random(3), 2.0 * math.pi / period_s

    def sensor(time_s: float) -> tuple[float, float]:
        rate = 1.5 * omega * math.cos(omega * (time_s - delay_s))
        return 1.5 * math.sin(omega * time_s) + noise.gauss(0.0, 0.05), rate

    computed = run(Twin(usual(tmp_path)), as_it_is, 30.0, rate_hz=rate_hz, motion=sensor)
    assert computed.level(0.0, 30.0) is Level.WARN, computed.messages()
    assert all(words.startswith("its positions scatter by at least")
               for words in computed.messages().split(" | "))  # fmt: skip
    assert "disagree" not in computed.messages()
    assert "rejected" not in computed.messages()


def test_a_stuck_sensor_counts_as_missing(tmp_path: Path) -> None:
    """Flagged after 1 s, stale soon after; the last motion dies away, and it heals."""

    def fault(one: Sample) -> Sample:
        stuck = one.stamp_s < 12.0
        return replace(one, position_m=1.2, velocity_m_per_s=0.4) if stuck else one

    computed = run(Twin(usual(tmp_path)), fault, 20.0)
    assert computed.flagged_after_s() <= 1.2
    assert computed.level(7.5, 12.0) is Level.ERROR
    assert "the sender is stuck" in computed.messages()
    speeds = [abs(snapshot.hang_off_velocity_m_per_s[2]) for snapshot in computed.snapshots
              if 11.0 < snapshot.time_s < 11.8]  # fmt: skip
    assert max(speeds) < 0.02
    assert computed.rows[-1].level is not Level.ERROR
    heaves = [
        snapshot.heave_m - truth(snapshot.time_s)[0]
        for snapshot in computed.snapshots
        if snapshot.time_s > 16.0
    ]
    assert np.abs(heaves).max() < 1e-3


@pytest.mark.parametrize("moves", [False, True])
def test_constant_zero_is_stuck_only_in_a_sea(tmp_path: Path, moves: bool) -> None:
    """Zeros from the first sample on."""
    sea = None if moves else SeaState()
    twin = Twin(replace(usual(tmp_path), sea_state=sea) if sea else usual(tmp_path))
    computed = run(twin, as_it_is, 5.0, motion=lambda time_s: (0.0, 0.0))
    assert computed.level(0.0, 5.0) is (Level.ERROR if moves else Level.OK), computed.messages()


def test_a_low_sample_rate_is_warned_of_with_the_rate_needed(tmp_path: Path) -> None:
    """1 Hz where a sine of 8 s needs 0.0705·8 s; the delay that this rate needs is reported."""
    computed = run(Twin(usual(tmp_path)), as_it_is, 12.0, rate_hz=1.0)
    assert computed.flagged_after_s(0.0) <= 2.0
    message = computed.rows[-1].message
    assert "a sample every 1.000 s is too slow: this scene needs one every 0.564 s" in message
    assert "input_delay_s of 0.58 s; at the present rate 1.02 s" in message
    assert computed.level(2.0, 12.0) is not Level.OK


def test_a_delay_that_is_too_short_is_reported(tmp_path: Path) -> None:
    """4 Hz is often enough for this sea, but the twin runs only 0.15 s behind."""
    computed = run(Twin(usual(tmp_path)), as_it_is, 12.0, rate_hz=4.0)
    assert "with one every 0.250 s set input_delay_s to 0.27 s or more" in computed.rows[-1].message


def test_missing_motion_is_an_error_where_required(tmp_path: Path) -> None:
    """After 3 s; in a scene whose ship lies still nothing need come."""
    computed = run(Twin(usual(tmp_path)), lambda one: None, 5.0, at_s=-1.0)
    assert computed.level(0.0, 2.9) is Level.OK
    assert computed.level(3.1, 5.0) is Level.ERROR
    assert "nothing has come for 3 s" in computed.messages()
    still = run(Twin(replace(usual(tmp_path), sea_state=SeaState())), lambda one: None, 5.0, -1.0)
    assert still.level(0.0, 5.0) is Level.OK


def test_rejecting_every_sample_is_an_error(tmp_path: Path) -> None:
    def nonsense(one: Sample) -> Sample:
        return replace(one, position_m=99.0)

    computed = run(Twin(usual(tmp_path)), nonsense, 3.0, at_s=-1.0)
    assert computed.level(0.1, 3.0) is Level.ERROR
    assert "samples was refused" in computed.rows[-1].message


def test_a_rejection_warns_for_a_minute(tmp_path: Path) -> None:
    """It warns for 60 s of twin time, and stays counted."""

    def once(one: Sample) -> Sample:
        return replace(one, position_m=99.0) if one.stamp_s < FAULT_AT_S + 0.04 else one

    computed = run(Twin(usual(tmp_path)), once, 72.0)
    assert computed.level(FAULT_AT_S, 8.0) is Level.WARN
    assert computed.level(60.0, 65.0) is Level.WARN
    assert computed.level(68.0, 72.0) is Level.OK, computed.messages()
    assert computed.rows[-1].values["refused"] == "1"
    assert computed.rows[-1].values["refused in the last 60 s"] == "0"


@pytest.mark.parametrize("jump_m", [0.5, 5.0, 14.0, 29.9])
def test_a_jump_in_position_never_jerks_the_rope(tmp_path: Path, jump_m: float) -> None:
    """Flagged at once; taken later or not, it never pulls the rope (29.9 m: 1,338 kN)."""

    def fault(one: Sample) -> Sample:
        return replace(one, position_m=one.position_m + jump_m)

    good = run(Twin(usual(tmp_path)), as_it_is, 16.0)
    bad = run(Twin(usual(tmp_path)), fault, 16.0)
    assert bad.flagged_after_s() <= 0.1
    speeds = np.array([snapshot.hang_off_velocity_m_per_s[2] for snapshot in bad.snapshots])
    assert np.abs(speeds).max() < 7.0
    assert np.abs(np.diff(speeds)).max() / 0.02 < 10.0
    highest = [max(snapshot.tension_top_max_n for snapshot in one.snapshots) for one in (good, bad)]
    assert highest[1] < 1.8 * highest[0]
    if jump_m > 15.0:
        assert max(snapshot.heave_m for snapshot in bad.snapshots) < 3.0


@pytest.mark.parametrize("spoilt", ["jump", "every other second"])
def test_a_valid_position_with_an_invalid_rate_stops_no_run(tmp_path: Path, spoilt: str) -> None:
    """The position is new, its rate impossible: neither may stop the twin, or be followed."""

    def fault(one: Sample) -> Sample | None:
        if spoilt != "jump" and int(one.stamp_s) % 2:
            return None
        position_m = one.position_m + (5.0 if spoilt == "jump" else 0.0)
        return replace(one, position_m=position_m, velocity_m_per_s=10.0 * one.velocity_m_per_s)

    computed = run(Twin(usual(tmp_path)), fault, 20.0)
    assert computed.flagged_after_s() <= 1.0
    assert len(computed.snapshots) == 20.0 / 0.02
    speeds = np.array([snapshot.hang_off_velocity_m_per_s[2] for snapshot in computed.snapshots])
    assert np.abs(speeds).max() < 7.0
    accepted = [snapshot.inputs["heave"].accepted for snapshot in computed.snapshots]
    assert accepted[-1] > accepted[round(9.0 / 0.02)]  # by rates derived from positions
    assert "position and velocity disagree" in computed.messages()


def test_positions_after_a_gap_need_confirmation(tmp_path: Path) -> None:
    """Positions at random after a long gap stay refused, a motion is taken after 0.5 s."""
    draw = random.Random(5)

    def fault(one: Sample) -> Sample | None:
        if one.stamp_s < 10.0:
            return None
        return replace(one, position_m=draw.uniform(-14, 14)) if one.stamp_s < 14.0 else one

    computed = run(Twin(usual(tmp_path)), fault, 20.0)
    accepted = {
        round(snapshot.time_s, 2): snapshot.inputs["heave"].accepted
        for snapshot in computed.snapshots
    }
    assert accepted[13.8] == accepted[7.0]
    assert accepted[16.0] > accepted[13.8]
    assert "it is taken once it has moved plausibly for 0.5 s" in computed.messages()


def test_an_implausible_acceleration_is_rejected(tmp_path: Path) -> None:
    """3 m every 3.2 s: 5.9 m/s and 11.6 m/s²."""
    w = 2.0 * math.pi / 3.2

    def motion(time_s: float) -> tuple[float, float]:
        return 3.0 * math.sin(w * time_s), 3.0 * w * math.cos(w * time_s)

    computed = run(Twin(usual(tmp_path)), as_it_is, 6.0, motion=motion)
    assert computed.flagged_after_s(0.0) < 2.0
    assert "ship.max_hang_off_acceleration_m_per_s2" in computed.messages()


@pytest.mark.parametrize(
    ("clock_s", "level", "words"),
    [
        (0.0, Level.OK, ""),
        (-0.3, Level.OK, ""),  # refused as late, see below
        (0.5, Level.WARN, "stamps lie 0.49 s ahead of their arrival, 0.2 s are allowed"),
        (1.5, Level.ERROR, "stamps lie 1.49 s ahead of their arrival"),
        (9.0, Level.ERROR, "stamps lie 8.99 s ahead of their arrival"),
    ],
)
def test_the_sensor_clock_offset_is_measured(
    tmp_path: Path, clock_s: float, level: Level, words: str
) -> None:
    """From the start on; a clock that is behind makes every sample late."""

    def fault(one: Sample) -> Sample:
        return replace(one, stamp_s=one.stamp_s + clock_s)

    computed = run(Twin(usual(tmp_path)), fault, 14.0, at_s=-1.0, clocked=True)
    row = computed.rows[-1]
    assert float(row.values["arrival less stamp [s]"]) == pytest.approx(LATENCY_S - clock_s)
    if clock_s < 0.0:
        assert row.level is Level.ERROR
        assert "samples arrive 0.31 s after their stamps" in row.message
        return
    assert row.level is level
    assert words in row.message
    if clock_s > 1.0:
        assert computed.flagged_after_s(0.0) <= 2.0


def test_a_clock_ahead_is_reported_after_three_samples(tmp_path: Path) -> None:
    """At 2 Hz: three early samples are enough, as no link delivers before the stamp."""

    def fault(one: Sample) -> Sample | None:
        kept = abs(2.0 * one.stamp_s - round(2.0 * one.stamp_s)) < 1e-9
        return replace(one, stamp_s=one.stamp_s + 1.5) if kept else None

    computed = run(Twin(usual(tmp_path)), fault, 10.0, clocked=True)
    assert computed.flagged_after_s() <= 1.5
    assert "the sender's clock is ahead" in computed.messages()


def test_one_wrong_stamp_is_not_a_clock_fault(tmp_path: Path) -> None:
    def fault(one: Sample) -> Sample:
        return replace(one, stamp_s=one.stamp_s + (1.5 if one.stamp_s == FAULT_AT_S else 0.0))

    computed = run(Twin(usual(tmp_path)), fault, 12.0, clocked=True)
    assert "clock is ahead" not in computed.messages()


@pytest.mark.parametrize("clock_s", [-9.0, 1.5, 9.0])
def test_the_sensor_clock_is_corrected_on_request(tmp_path: Path, clock_s: float) -> None:
    """The hang-off then moves with the ship, late by the latency of the link."""

    def fault(one: Sample) -> Sample:
        return replace(one, stamp_s=one.stamp_s + clock_s)

    twin = Twin(usual(tmp_path))
    twin.inputs.judge_clocks(0.2, correct=True)
    computed = run(twin, fault, 16.0, at_s=-1.0, clocked=True)
    off = [
        snapshot.heave_m - truth(snapshot.time_s)[0]
        for snapshot in computed.snapshots
        if snapshot.time_s > 6.0
    ]
    assert np.abs(off).max() < 1.5 * OMEGA * 2.0 * LATENCY_S
    assert computed.level(14.0, 16.0) is Level.WARN
    assert "its stamps are corrected by" in computed.rows[-1].message


def test_two_alternating_senders_are_flagged(tmp_path: Path) -> None:
    """Two ships at once: a sample of each in turn."""

    def second(time_s: float) -> tuple[float, float]:
        ahead_s = 0.0 if round(time_s * 40.0) % 2 else 3.0
        return truth(time_s + (ahead_s if time_s >= FAULT_AT_S else 0.0))

    computed = run(Twin(usual(tmp_path)), as_it_is, 12.0, rate_hz=40.0, motion=second)
    assert computed.flagged_after_s() <= 2.0


def test_a_restart_during_a_fault_is_bit_identical(tmp_path: Path) -> None:
    """Disagreement, refusals and a trial are part of a saved state."""

    def fault(one: Sample) -> Sample | None:
        if one.stamp_s < 8.0:
            return replace(one, velocity_m_per_s=0.0)
        if one.stamp_s < 10.6:
            return None
        return replace(one, position_m=one.position_m + 2.0)

    scene = usual(tmp_path)
    for cut_s in (7.5, 10.7, 11.0):
        whole, first = Twin(scene), Twin(scene)
        samples = [fault(one) if one.stamp_s > 6.0 else one
                   for k in range(-2, 300)
                   for one in [Sample(0.05 * k, *truth(0.05 * k), 0.0)]]  # fmt: skip

        def follow(twin: Twin, to_s: float, feed: list[Sample | None]) -> list[Snapshot]:
            snapshots = []
            while twin.time_ns < round(to_s * 1e9):
                now_ns = twin.time_ns + 150_000_000
                while feed and (feed[0] is None or round(feed[0].stamp_s * 1e9) <= now_ns):
                    one = feed.pop(0)
                    if one:
                        stamp_ns = round(one.stamp_s * 1e9)
                        twin.submit_heave(stamp_ns, one.position_m, one.velocity_m_per_s)
                twin.advance(2)
                snapshots.append(twin.snapshot())
            return snapshots

        unbroken = follow(whole, 14.0, list(samples))
        feed = list(samples)
        before = follow(first, cut_s, feed)
        after = follow(Twin.restore(first.capture(), scene), 14.0, feed)
        assert digest(unbroken) == digest([*before, *after])
        rows = [statuses(snapshots[-1], None)[-3:] for snapshots in (unbroken, after)]
        assert rows[0] == rows[1]


@pytest.mark.parametrize(("from_s", "step_s"), [(0.0, 0.7), (0.0, -0.7), (0.0, -9.0), (0.7, -0.7)])
def test_a_clock_step_and_back_does_not_move_the_hang_off(
    tmp_path: Path, step_s: float, from_s: float
) -> None:
    """Three samples decide; the motion keeps its times, and the row says so while they are shifted.

    A clock that was ahead and steps to the right time is not corrected.
    """

    def fault(one: Sample) -> Sample:
        own_s = from_s + (step_s if FAULT_AT_S <= one.stamp_s < 14.0 else 0.0)
        return replace(one, stamp_s=one.stamp_s + own_s)

    computed = run(Twin(usual(tmp_path)), fault, 22.0, at_s=-1.0, clocked=True)
    mends = from_s + step_s == 0.0
    refused = [snapshot.inputs["heave"].refused for snapshot in computed.snapshots]
    steps = [b - a for a, b in itertools.pairwise(refused) if b > a]
    assert steps == [1] * 4, "two samples wait at each step, and no other is refused"
    off = [
        abs(snapshot.heave_m - truth(snapshot.time_s - (0.0 if mends else from_s))[0])
        for snapshot in computed.snapshots
        if 5.0 < snapshot.time_s < (6.0 if mends else 22.0) or 10.0 < snapshot.time_s < 13.8
    ]
    assert max(off) < 0.02 + (1.5 * OMEGA * from_s if mends else 0.0)
    words = f"its stamps are corrected by {-step_s:+.2f} s since its step at 6.1 s"
    assert (words in computed.messages()) is not mends
    assert "disagree" not in computed.messages()
    assert "order of their stamps" not in computed.messages()


def test_samples_of_another_run_are_reported_as_such(tmp_path: Path) -> None:
    """A publisher that starts again with its former epoch: not an order of stamps to be mended."""

    def fault(one: Sample) -> Sample:
        return replace(one, stamp_s=one.stamp_s - 60.0)

    computed = run(Twin(usual(tmp_path)), fault, 8.0, clocked=True)
    words = "s back; sender and twin must share one clock, a replay the twin's epoch"
    assert words in computed.rows[-1].message
    assert "order of their stamps" not in computed.messages()


def test_a_clock_step_across_a_restart_is_bit_identical(tmp_path: Path) -> None:
    scene = usual(tmp_path)
    for cut_s in (6.0, 6.1, 9.0):
        whole, first = Twin(scene), Twin(scene)

        def follow(twin: Twin, from_s: float, to_s: float) -> list[Snapshot]:
            snapshots = []
            for k in range(round(from_s * 20), round(to_s * 20)):
                t = 0.05 * k
                stamp_ns = round((t + 0.2 + (0.7 if t > 5.8 else 0.0)) * 1e9)
                twin.submit_heave(stamp_ns, *truth(t + 0.2), round((t + 0.21) * 1e9))
                twin.advance(5)
                snapshots.append(twin.snapshot())
            return snapshots

        expected = follow(whole, 0.0, 10.0)[round(cut_s * 20) :]
        follow(first, 0.0, cut_s)
        resumed = Twin.restore(first.capture(), scene)
        assert digest(follow(resumed, cut_s, 10.0)) == digest(expected)
