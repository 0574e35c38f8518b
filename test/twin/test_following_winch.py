"""A winch that follows its measured line out: interpolation, gaps, limits, rounding."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from small_scene import SMALL_SCENE, not_finite

from rope_twin.errors import SceneError
from rope_twin.messages import Level, statuses
from rope_twin.scene.load import following_measured, load_scene
from rope_twin.scene.schema import Scene
from rope_twin.twin.readings import Measurement
from rope_twin.twin.snapshot import Snapshot
from rope_twin.twin.state import decode_state
from rope_twin.twin.twin import Twin
from rope_twin.twin.winch.commands import Payout, WinchCommand
from rope_twin.twin.winch.following import HOLD_S, LineTrack

FOLLOWING = SMALL_SCENE.replace("winch:\n", "winch:\n  follows: measured\n")
STEP_NS, MS = 10_000_000, 1_000_000
MEAN_M, SWING_M, PERIOD_S = 200.0, 2.0, 20.0
OMEGA = 2.0 * math.pi / PERIOD_S


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    path = tmp_path_factory.mktemp("scene") / "following.yaml"
    path.write_text(FOLLOWING)
    return load_scene(path)


@pytest.fixture(scope="module")
def at_rest(scene: Scene) -> Twin:
    return Twin(scene)


def swing(t: float) -> tuple[float, float]:
    """The winch hauls in and pays out by 2 m within 20 s; at rest at t = 0."""
    return MEAN_M + SWING_M * (1.0 - math.cos(OMEGA * t)), SWING_M * OMEGA * math.sin(OMEGA * t)


def steady(t: float) -> tuple[float, float]:
    """It begins to pay out within 2 s, and goes on at 0.5 m/s."""
    v = min(0.25 * t, 0.5)
    return MEAN_M + (0.125 * t * t if t < 2.0 else 0.5 + 0.5 * (t - 2.0)), v


def followed(
    twin: Twin,
    seconds: float,
    motion: Callable[[float], tuple[float, float]],
    every_ns: int = 50 * MS,
    hole_s: tuple[float, float] = (math.inf, math.inf),
    *,
    with_speed: bool = True,
) -> list[Snapshot]:
    """Offer readings 0.2 s ahead, as an input delay does; snapshots after each step."""
    snapshots, next_ns = [], (twin.inputs.newest_ns().get("winch_measured", -every_ns)) + every_ns
    until_ns = twin.time_ns + round(seconds * 1e9)
    while twin.time_ns < until_ns:
        while next_ns <= twin.time_ns + 200 * MS:
            t = next_ns * 1e-9
            if not hole_s[0] < t < hole_s[1]:
                length, speed = motion(t)
                reported = Measurement.of_winch(next_ns, length, speed if with_speed else None)
                assert twin.submit_measurement(reported) == ""
            next_ns += every_ns
        twin.advance(1)
        snapshots.append(twin.snapshot())
    return snapshots


def off(snapshots: list[Snapshot], motion: Callable[[float], tuple[float, float]]) -> np.ndarray:
    return np.array([one.line_out_m - motion(one.time_s)[0] for one in snapshots])


def test_a_swinging_line_is_followed_as_well_as_its_readings_say(at_rest: Twin) -> None:
    """A cubic Hermite polynomial errs by (ω·h)⁴/384 of the amplitude; its rate by √3/216·(ω·h)³·ω.

    The rate of a Hermite cubic errs by h³/216·√3·f⁗ (Birkhoff and Priver 1967).
    """
    h = 1.0  # a slow counter
    twin = at_rest.branch()
    start = followed(twin, 1.3, swing, 200 * MS)
    assert start[0].line_out_m == pytest.approx(MEAN_M, abs=1e-3)
    snapshots: list[Snapshot] = []
    next_ns = 2_000_000_000
    while twin.time_ns < 40_000_000_000:
        while next_ns <= twin.time_ns + 1_300 * MS:
            reported = Measurement.of_winch(next_ns, *swing(next_ns * 1e-9))
            assert twin.submit_measurement(reported) == ""
            next_ns += round(h * 1e9)
        twin.advance(1)
        snapshots.append(twin.snapshot())
    settled = [one for one in snapshots if one.time_s > 6.0]
    error = np.abs(off(settled, swing)).max()
    bound = SWING_M * (OMEGA * h) ** 4 / 384.0
    assert 0.5 * bound < error < 1.001 * bound
    rates = [one.payout_speed_m_per_s - swing(one.time_s)[1] for one in settled]
    assert np.abs(rates).max() < 1.001 * math.sqrt(3.0) / 216.0 * SWING_M * OMEGA**4 * h**3
    line = next(one for one in settled[-1].residuals if one.quantity == "line_out_m")
    assert line.rms < 1e-9, "at the readings themselves the line is the reading"


def test_without_a_line_speed_it_is_derived(at_rest: Twin) -> None:
    """The end slope of a parabola through three readings errs by f‴·h²/3, which over h is small."""
    h = 0.1
    snapshots = followed(at_rest.branch(), 20.0, swing, 100 * MS, with_speed=False)[400:]
    slope = SWING_M * OMEGA**3 * h * h / 3.0
    error = np.abs(off(snapshots, swing)).max()
    assert error < slope * h / 4.0 * 1.5
    assert error > 1e-7


def test_a_hole_of_19_s_makes_no_jump(at_rest: Twin) -> None:
    """The speed is held and ramped to rest, then led over; the tension stays as in a gentle run.

    The winch's limits are 1.5 m/s and 0.3 m/s². Within them the payload of 8 t, with as much added
    mass and its axial oscillation, changes the tension by 16 t · 0.3 m/s² · 2, some 10 kN.
    """
    twin = at_rest.branch()
    before = followed(twin, 5.0, steady)
    snapshots = followed(twin, 60.0, steady, hole_s=(5.2, 24.2))
    time = np.array([one.time_s for one in snapshots])
    line = np.array([one.line_out_m for one in snapshots])
    speed = np.array([one.payout_speed_m_per_s for one in snapshots])
    gap = snapshots[int(np.searchsorted(time, 15.0))]
    stop_s = 0.5 / 0.3
    ran = steady(5.2)[0] + 0.5 * (HOLD_S + 0.5 * stop_s)
    assert gap.line_out_m == pytest.approx(ran, abs=1e-6)
    assert gap.payout_speed_m_per_s == 0.0
    assert gap.inputs["line_following"].stale
    rows = {row.name: row for row in statuses(gap, None)}
    assert rows["simulation: input line following"].level is Level.ERROR
    assert rows["simulation: input winch measured"].level is Level.WARN
    dt = STEP_NS * 1e-9
    assert np.abs(np.diff(line) / dt).max() < 1.5 + 0.5
    assert np.abs(np.diff(speed) / dt).max() < 0.3 * 1.02
    assert not any(not_finite(one) for one in snapshots)
    calm = [one.tension_top_n for one in before]
    tension = [one.tension_top_n for one in snapshots]
    assert max(tension) - max(calm) < 10e3
    assert min(tension) > min(calm) - 10e3
    back = snapshots[int(np.searchsorted(time, 25.0))]
    assert "led over to it" in back.inputs["line_following"].warning
    assert snapshots[-1].line_out_m == pytest.approx(steady(snapshots[-1].time_s)[0], abs=1e-9)
    assert snapshots[-1].inputs["line_following"].warning == ""


def test_rounding_makes_no_steps(scene: Scene, at_rest: Twin) -> None:
    """A counter of 0.1 m at 20 Hz: the line stays within half of that, and its rate smooth."""
    assert scene.winch is not None
    track = LineTrack(MEAN_M, scene.winch, 0.1, "line_following")
    rates, errors = [], []
    for k in range(1200):
        t = k * 0.05
        length, speed = swing(t)
        track.take(k * 50 * MS, round(length, 1), speed)
        if k > 100:
            z, v = track.at((k - 1) * 50 * MS + 20 * MS)
            errors.append(z - swing(t - 0.03)[0])
            rates.append(v - swing(t - 0.03)[1])
    assert np.abs(errors).max() < 0.051
    assert np.abs(rates).max() < 0.01, "interpolated as they came it would be 2 m/s"


def test_a_wrong_length_at_the_start_is_led_over_within_the_limits(at_rest: Twin) -> None:
    """The scene has 200 m out and the ship 230 m: it takes 1.5·e/v with the winch's 1.5 m/s."""
    twin = at_rest.branch()
    snapshots = followed(twin, 40.0, lambda t: (230.0, 0.0))
    speed = np.array([one.payout_speed_m_per_s for one in snapshots])
    assert 1.4 < speed.max() <= 1.5 + 1e-9
    assert "-29." in snapshots[200].inputs["line_following"].warning
    assert snapshots[-1].line_out_m == 230.0


def test_limits_of_the_winch_do_not_clip_in_silence(at_rest: Twin) -> None:
    """A speed above the winch's limit is followed and reported; a length that cannot be is held."""
    twin = at_rest.branch()
    fast = followed(twin, 30.0, lambda t: (MEAN_M + 1.7 * t, 1.7))[-1]
    assert fast.line_out_m == pytest.approx(MEAN_M + 51.0, abs=1e-6)
    assert "follows +1.70 m/s, beyond the speed limit of 1.5 m/s" in fast.winch_at_limit
    twin = at_rest.branch()
    snapshots = followed(twin, 130.0, lambda t: (max(MEAN_M - 1.4 * t, 30.0), -1.4))
    assert snapshots[-1].line_out_m == 37.5, "three quarters of the least line out"
    assert "cannot be followed" in snapshots[-1].winch_at_limit


def test_commands_are_refused_and_the_study_is_not_claimed(at_rest: Twin) -> None:
    twin = at_rest.branch()
    assert "follows its measured line out" in twin.submit_command(None, WinchCommand("speed", 0.5))
    snapshot = followed(twin, 1.0, swing)[-1]
    assert snapshot.winches[0].mode == "measured"
    assert math.isnan(snapshot.study_error.rms_pct)
    lonely = at_rest.branch()
    lonely.advance(400)
    health = lonely.snapshot().inputs["line_following"]
    assert health.fault == "no line out was measured yet; the line stands"


def test_an_input_delay_that_is_too_short_is_reported(at_rest: Twin) -> None:
    """One reading a second, each 0.2 s before it is needed: in between the line is extrapolated."""
    twin = at_rest.branch()
    snapshots = followed(twin, 30.0, swing, 1000 * MS)
    snapshot = snapshots[-1]
    warning = snapshot.inputs["line_following"].warning
    assert "with one every 1.000 s set input_delay_s to 1.02 s or more" in warning
    errors = np.abs(off(snapshots[500:], swing))
    assert errors.max() < 0.2, "it follows all the same: half of 0.2 m/s² · (1 s)² and the leading"


def test_readings_that_come_too_late_are_followed_by_extrapolation(at_rest: Twin) -> None:
    """Each comes 0.3 s after it was needed, one every 0.1 s: they are extrapolated by 0.4 s.

    With an acceleration a and τ = 0.3 to 0.4 s that errs by a·τ²/2 in length and a·τ in speed. As
    the line is led over again and again, z'' = -6·e/T² - 4·e'/T with T = 0.5 s, it lags by
    a·(T²/6 + 2·T·τ/3) besides (derived). The row asks for the delay that is missing: interval,
    lateness and a slot.
    """
    twin, snapshots, omega = at_rest.branch(), [], OMEGA / 3.0

    def slow(t: float) -> tuple[float, float]:
        swung = SWING_M * (1.0 - math.cos(omega * t))
        return MEAN_M + swung, SWING_M * omega * math.sin(omega * t)

    for k in range(400):
        twin.advance(10)
        if k >= 3:
            late_ns = twin.time_ns - 300 * MS
            reported = Measurement.of_winch(late_ns, *slow(late_ns * 1e-9))
            assert twin.submit_measurement(reported) == ""
        snapshots.append(twin.snapshot())
    errors = np.abs(off(snapshots[100:], slow))
    low, high = (t**2 / 2.0 + 0.5**2 / 6.0 + 2.0 * 0.5 * t / 3.0 for t in (0.3, 0.4))
    assert SWING_M * omega**2 * low < errors.max() < SWING_M * omega**2 * high
    rows = {row.name: row for row in statuses(snapshots[-1], None)}
    row = rows["simulation: input line following"]
    assert row.level is Level.WARN
    assert "set input_delay_s to 0.42 s or more" in row.message
    assert rows["simulation: input winch measured"].level is Level.OK


@pytest.mark.parametrize("resolution_m", [0.0, 0.1])
def test_a_burst_of_readings_that_were_held_up_makes_no_jump(
    scene: Scene, resolution_m: float
) -> None:
    """Those of a second come at once, stamped by their arrival: the line would jump by 0.5 m."""
    track = LineTrack(MEAN_M, scene.winch, resolution_m, "line_following")
    readings = [(k, k) for k in range(0, 4000, 50)]  # stamped, measured [ms]
    readings += [(5000 + k / 1000.0, k) for k in range(4000, 5000, 50)]
    readings += [(k, k) for k in range(5050, 9000, 50)]
    lengths, speeds, warned = [], [], 0
    for step in range(1, 800):
        now_ns = step * STEP_NS
        while readings and readings[0][0] * MS <= now_ns + 1200 * MS:
            stamp, true = readings.pop(0)
            track.take(round(stamp * MS), *steady(1e-3 * true))
        length, speed = track.at(now_ns)
        lengths.append(length)
        speeds.append(speed)
        warned += "left out" in track.counter.health(now_ns, False).warning
    steps_m = np.diff(lengths)
    fastest_m = 1.25 * scene.winch.speed_limit_m_per_s * 0.01
    assert np.abs(steps_m).max() < fastest_m + 0.5 * resolution_m  # so much is not known
    assert np.abs(speeds).max() < 2.0
    error = np.array(lengths) - [steady(0.01 * step)[0] for step in range(1, 800)]
    assert np.abs(error).max() < 0.06 + 0.5 * resolution_m
    assert warned > 100


def test_a_line_set_back_is_led_over_again(scene: Scene) -> None:
    """After a failed step the rope is in an earlier state: the line goes on from there."""
    assert scene.winch is not None
    track = LineTrack(MEAN_M, scene.winch, 0.0, "line_following")
    for k in range(400):
        track.take(k * 50 * MS, *steady(k * 0.05))
    for k in range(1000):
        track.at(k * STEP_NS)
    behind = Payout(steady(10.0)[0] - 0.5, 0.2)
    track.continue_from(behind)
    line = np.array([track.at((1000 + k) * STEP_NS) for k in range(1, 800)])
    assert line[0] == pytest.approx(behind, abs=0.01)
    rate = np.diff(line[:, 1]) / (STEP_NS * 1e-9)
    assert np.abs(rate).max() < 0.3 * 1.02
    assert line[-1] == pytest.approx(steady(1799 * STEP_NS * 1e-9), abs=1e-9)


def test_after_a_cut_the_counter_goes_on_from_the_rope_that_is_left(at_rest: Twin) -> None:
    twin = at_rest.branch()
    followed(twin, 4.0, steady)
    assert twin.submit_cut(None, 120.0) == ""
    snapshots = followed(twin, 4.0, steady)
    assert twin.cut is not None
    left_m, counted_m = twin.cut.left_m, steady(4.0)[0]
    assert snapshots[-1].line_out_m == pytest.approx(left_m + steady(8.0)[0] - counted_m, abs=1e-6)
    speeds = np.array([one.payout_speed_m_per_s for one in snapshots])
    assert np.abs(speeds - 0.5).max() < 1e-6


def test_each_winch_of_two_follows_its_own_counter() -> None:
    scene = following_measured(load_scene("load_transfer"))
    twin = Twin(scene)
    names, out_m = ("winch", "recovery_sheave"), (118.0, 110.0)
    for k in range(30):
        t = k * 0.1
        rows = [
            (name, length + sign * 0.05 * t * t, sign * 0.1 * t, None)
            for name, length, sign in zip(names, out_m, (1.0, -1.0), strict=True)
        ]
        assert twin.submit_measurement(Measurement("winch", k * 100 * MS, tuple(rows))) == ""
    while twin.time_ns < 2_000_000_000:
        twin.advance(1)
    lengths = {rope.name: rope.line_out_m for rope in twin.snapshot().ropes}
    moved = [lengths[line.name] - line.length_m for line in scene.ropes if line.from_ in names]
    assert moved == pytest.approx([0.2, -0.2], abs=1e-6)
    nameless = twin.submit_measurement(Measurement.of_winch(4_000_000_000, 118.0))
    assert "no name is given; name one of winch, recovery_sheave" in nameless


def test_a_scene_without_a_winch_cannot_follow(tmp_path: Path) -> None:
    path = tmp_path / "fixed.yaml"
    path.write_text(re.sub(r"winch:\n(  .*\n)+", "", SMALL_SCENE))
    with pytest.raises(SceneError, match="no winch that could follow"):
        following_measured(load_scene(path))


def test_a_run_resumes_from_a_saved_state_and_goes_on_after_a_pause(at_rest: Twin) -> None:
    twin = at_rest.branch()
    followed(twin, 4.0, swing)
    repeated = Measurement.of_winch(4_100_000_000, *swing(4.1))
    assert "must come in the order" in twin.submit_measurement(repeated)
    resumed = Twin.restore(decode_state(twin.capture().encode(), "memory"), twin.scene)
    for one in (twin, resumed):
        one.invalidate_inputs()
        assert one.submit_measurement(repeated) == ""
    one, other = (followed(each, 6.0, swing)[-1] for each in (twin, resumed))
    assert one.line_out_m == other.line_out_m
    assert one.tension_top_n == other.tension_top_n


def test_an_unknown_thing_to_follow_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "wrong.yaml"
    path.write_text(FOLLOWING.replace("measured", "mesured"))
    with pytest.raises(SceneError, match=r"winch\.follows: 'mesured' is unknown.*'measured'"):
        load_scene(path)
