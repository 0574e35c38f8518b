"""The ship's pose judged by itself: rates, turning, jumps; and what samples a scene needs."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import pytest

from rope_twin import load_scene
from rope_twin.recording.motion_source import FIRST_NS, open_sea
from rope_twin.scene.load import scene_names
from rope_twin.twin.health import SenderClock, StuckDetector
from rope_twin.twin.motion.hang_off import HangOffTrack
from rope_twin.twin.motion.plausibility import end_slope, needed_interval_s, shortest_period_s
from rope_twin.twin.motion.ship_motion import ShipPose, turned
from rope_twin.twin.snapshot import InputHealth
from rope_twin.twin.validity import HeaveSample

STEP_NS, AHEAD_NS, FAULT_NS = 20_000_000, 200_000_000, 8_000_000_000
SCENE = load_scene("ship_6dof")
POSES = [sample.pose for sample in open_sea(SCENE).between(FIRST_NS, 30_000_000_000)]

Change = Callable[[ShipPose], ShipPose]
Motion = tuple[tuple[float, float], tuple[float, float], tuple[float, float]]


def follow(
    change: Change, until_ns: int = 20_000_000_000
) -> tuple[list[InputHealth], list[Motion]]:
    """Health and motion (up, east, north) each 20 ms of a track whose poses are changed."""
    track, poses = HangOffTrack(SCENE), list(POSES)
    health, motion = [], []
    for now_ns in range(STEP_NS, until_ns, STEP_NS):
        while poses[0].stamp_ns <= now_ns + AHEAD_NS:
            pose = poses.pop(0)
            track.submit_pose(change(pose) if pose.stamp_ns >= FAULT_NS else pose)
        up = track.at(now_ns)
        motion.append((up, *track.lateral_at(now_ns)))
        health.append(track.health(now_ns))
    return health, motion


def scaled(vector: tuple[float, float, float], factor: float) -> tuple[float, float, float]:
    x, y, z = vector
    return factor * x, factor * y, factor * z


RATES: dict[str, Change] = {
    "linear +15 m/s": lambda p: replace(p, velocity_m_per_s=(15.0, 0.0, 15.0)),
    "linear, opposite": lambda p: replace(p, velocity_m_per_s=scaled(p.velocity_m_per_s, -1.0)),
    "turning, opposite": lambda p: replace(p, rate_rad_per_s=scaled(p.rate_rad_per_s, -1.0)),
    "turning in degrees": lambda p: replace(p, rate_rad_per_s=scaled(p.rate_rad_per_s, 57.3)),
    "turning times 5": lambda p: replace(p, rate_rad_per_s=scaled(p.rate_rad_per_s, 5.0)),
}


def test_a_ship_on_waves_is_no_fault() -> None:
    health, _ = follow(lambda pose: pose)
    assert {one.fault for one in health} | {one.warning for one in health} == {""}
    assert health[-1].refused == 0


@pytest.mark.parametrize("name", RATES)
def test_rates_that_contradict_the_pose_are_derived_from_it(name: str) -> None:
    """Flagged within 2 s; the hang-off goes on as the ship truly moves, in all directions."""
    _, good = follow(lambda pose: pose)
    health, bad = follow(RATES[name])
    flagged = next(k for k, one in enumerate(health) if one.warning or one.fault)
    assert FAULT_NS - AHEAD_NS <= (flagged + 1) * STEP_NS <= FAULT_NS + 2_000_000_000
    words = "orientation and rate of turn" if "turning" in name else "position and velocity"
    assert words in health[flagged].warning
    assert health[-1].refused == 0
    start = (FAULT_NS + 2_000_000_000) // STEP_NS
    for a, b in zip(good[start:], bad[start:], strict=True):
        for (z, v), (w, u) in zip(a, b, strict=True):
            assert w == pytest.approx(z, abs=2e-3)
            assert u == pytest.approx(v, abs=0.05)


def test_a_twist_in_the_axes_of_the_sea_is_no_twist_of_a_turned_ship() -> None:
    """A ship turned by 90° tows at 3 m/s: REP 103 has its twist in its own axes."""
    quarter = (0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5))
    for axes, agrees in (((0.0, -3.0, 0.0), True), ((3.0, 0.0, 0.0), False)):
        track = HangOffTrack(load_scene("deep_tow_turn"))
        assert turned(quarter, (0.0, -3.0, 0.0)) == pytest.approx((3.0, 0.0, 0.0))
        for k in range(80):
            pose = ShipPose(50_000_000 * k, (0.15 * k, 0.0, 0.0), axes, quarter)
            assert track.submit_pose(pose) == ""
        assert ("disagree" not in track.health(0).warning) == agrees


def test_a_pose_that_leaps_by_500_m_is_refused_for_as_long_as_it_is_impossible() -> None:
    """It used to be believed after 2 s, at 20 MN and more; now no ship could be there for 71 s."""

    def jump(pose: ShipPose) -> ShipPose:
        x, y, z = pose.position_m
        return replace(pose, position_m=(x + 500.0, y, z))

    health, motion = follow(jump, 28_000_000_000)
    assert max(abs(east) for _, (east, _), _ in motion) < 5.0
    assert max(abs(speed) for one in motion for _, speed in one) < 3.0
    flagged = next(k for k, one in enumerate(health) if one.recently_refused)
    assert flagged * STEP_NS <= FAULT_NS
    assert health[-1].stale
    assert "it jumps by 50" in health[-1].refusal


def test_a_stuck_pose_is_refused() -> None:
    """Also if it turns: all numbers must be equal."""
    health, _ = follow(lambda pose: replace(POSES[200], stamp_ns=pose.stamp_ns))
    assert any("the sender is stuck" in one.fault for one in health)
    assert health[-1].stuck > 100


def swung(rate_hz: float, resolution_m: float, repeats: int) -> InputHealth:
    """Health after 30 s of a heave of 0.8 m in 8 s in whole digits; each sample comes so often."""
    track, omega = HangOffTrack(load_scene("shallow_lift")), 2.0 * math.pi / 8.0
    for k in range(round(30.0 * rate_hz)):
        t = (k - k % repeats) / rate_hz
        z = resolution_m * round(0.8 * math.sin(omega * t) / resolution_m)
        stamp_ns = round(k / rate_hz * 1e9)
        assert track.submit(stamp_ns, z, 0.8 * omega * math.cos(omega * t)) == ""
        track.at(stamp_ns)
    return track.health(30_000_000_000)


@pytest.mark.parametrize(
    ("rate_hz", "resolution_m", "repeats", "warned"),
    [
        (10.0, 0.01, 1, False),
        (50.0, 0.001, 1, False),
        (500.0, 1e-6, 1, False),
        (50.0, 0.01, 1, True),
        (100.0, 1e-6, 2, True),
        (50.0, 1e-6, 5, True),
    ],
)
def test_positions_that_move_by_jerks_are_reported(
    rate_hz: float, resolution_m: float, repeats: int, warned: bool
) -> None:
    """A speed of 0.2 m/s between samples is 4 kN on 40 mm wire, whose √(EA·m) is 22 kN·s/m."""
    health = swung(rate_hz, resolution_m, repeats)
    assert ("which the rope feels" in health.warning) == warned
    assert health.refused == 0


def test_equal_values_count_as_stuck_after_a_second() -> None:
    """However often they come, and not before; another value ends it."""
    stuck = StuckDetector()
    assert [stuck.is_stuck(k * 10**8, (1.0, 2.0)) for k in range(12)] == [False] * 10 + [True] * 2
    assert not stuck.varied
    assert not stuck.is_stuck(12 * 10**8, (1.0, 2.1))
    assert stuck.varied
    slow = StuckDetector()
    assert [slow.is_stuck(k * 2 * 10**9, (0.5,)) for k in range(4)] == [False, False, True, True]


def test_stamps_of_zero_are_no_delay_of_the_link() -> None:
    """A fifth of the samples; an `input_delay_s` of 57 years was advised."""
    clock = SenderClock()
    for k in range(100):
        arrival_ns = k * 50_000_000
        clock.take(arrival_ns - (1_800_000_000 * 10**9 if k % 5 == 0 else 30_000_000), arrival_ns)
    assert clock.lateness_s == pytest.approx(0.03)


def test_the_slope_of_a_parabola_is_exact() -> None:
    """However uneven the times."""
    times = [-0.7, -0.4, -0.35, -0.1, 0.0]
    values = [3.0 + 2.0 * t - 4.0 * t * t for t in times]
    assert end_slope(times, values) == pytest.approx(2.0, abs=1e-12)
    assert end_slope(times[-3:], values[-3:]) == pytest.approx(2.0, abs=1e-12)


@pytest.mark.parametrize("period_s", [4.0, 9.0])
def test_the_needed_interval_bounds_the_interpolation(period_s: float) -> None:
    """A sine sampled so is off by 1e-4 of its amplitude at most, and by hardly less."""
    omega, h = 2.0 * math.pi / period_s, needed_interval_s(period_s)
    worst = 0.0
    for phase in range(200):
        t0 = phase * h / 7.0
        z0, z1 = math.sin(omega * t0), math.sin(omega * (t0 + h))
        d0, d1 = (h * omega * math.cos(omega * t) for t in (t0, t0 + h))
        middle = 0.5 * (z0 + z1) + 0.125 * (d0 - d1)
        worst = max(worst, abs(middle - math.sin(omega * (t0 + 0.5 * h))))
    assert 0.9e-4 < worst <= 1.001e-4


def test_a_scene_says_which_periods_matter() -> None:
    """A sine its own, waves those with 95 % of their energy, a record 5 s."""
    assert shortest_period_s(load_scene("smooth_2km")) == 8.0
    assert shortest_period_s(load_scene("deep_lift")) == 5.0
    assert 3.0 < shortest_period_s(load_scene("wave_zone")) < 9.0


def samples_of(name: str) -> list[HeaveSample]:
    sea = open_sea(load_scene(name))
    return [] if sea is None else sea.between(FIRST_NS, 60_000_000_000)


@pytest.mark.parametrize("name", scene_names())
def test_no_shipped_scene_is_flagged_by_its_own_sea(name: str) -> None:
    """A minute of it: nothing refused, no warning, and fast enough."""
    track, samples = HangOffTrack(load_scene(name)), samples_of(name)
    faults = set()
    while samples:
        sample = samples.pop(0)
        now_ns = sample.stamp_ns - AHEAD_NS
        if sample.pose is not None:
            assert track.submit_pose(sample.pose) == ""
        else:
            assert track.submit(sample.stamp_ns, sample.position_m, sample.velocity_m_per_s) == ""
        if now_ns > 0:
            track.at(now_ns)
        health = track.health(now_ns)
        faults |= {health.fault, health.warning}
    assert faults <= {""}
