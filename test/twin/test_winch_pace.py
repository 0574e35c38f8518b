"""Pacing of a line: it follows commands within its limits and never passes its stop position."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rope_twin.scene.winch import Drum
from rope_twin.scene.winch import Winch as WinchScene
from rope_twin.twin.winch.commands import LineTarget, Payout, WinchCommand
from rope_twin.twin.winch.control_modes import AccelerationLimited, JerkLimited, MotionProfile
from rope_twin.twin.winch.winch import Winch

ROUND_OFF_M = 1e-9
MIN_M, MAX_M = 20.0, 80.0
JERKS = st.one_of(st.none(), st.floats(0.1, 5.0))
STEPS = st.sampled_from([0.01, 0.02, 0.05])


def winch_of(speed: float, acceleration: float, jerk: float | None, start: float) -> Winch:
    scene = WinchScene(
        speed_limit_m_per_s=speed, acceleration_limit_m_per_s2=acceleration,
        min_line_out_m=MIN_M, max_line_out_m=MAX_M, jerk_limit_m_per_s3=jerk,
    )  # fmt: skip
    return Winch(scene, start)


def ran(winch: Winch, seconds: float, step_s: float, begin_s: float = 0.0) -> list[Payout]:
    lines = [winch.line]
    for k in range(round(seconds / step_s)):
        lines.append(winch.step(round((begin_s + k * step_s) * 1e9), step_s))
    return lines


def longest_s(way: float, speed: float, acceleration: float, jerk: float | None) -> float:
    """More than any stop takes: the way at full speed, twice the ramps, and a second."""
    ramp = speed / acceleration + (acceleration / jerk + speed / acceleration if jerk else 0.0)
    return 2.0 * way / speed + 4.0 * ramp + 4.0 * math.sqrt(way / acceleration) + 2.0


@settings(max_examples=25)
@given(
    st.floats(MIN_M, MAX_M), st.floats(MIN_M, MAX_M), st.floats(0.5, 3.0),
    st.floats(0.1, 2.0), JERKS, STEPS,
)  # fmt: skip
def test_from_rest_a_length_is_reached_and_never_passed(
    start: float, goal: float, speed: float, acceleration: float, jerk: float | None, step_s: float
) -> None:
    winch = winch_of(speed, acceleration, jerk, start)
    assert winch.take(None, WinchCommand("length", goal), 0) == ""
    lines = ran(winch, longest_s(abs(goal - start), speed, acceleration, jerk), step_s)
    side = 1.0 if goal >= start else -1.0
    assert max(side * (line.length_m - goal) for line in lines) < ROUND_OFF_M
    assert lines[-1].length_m == pytest.approx(goal, abs=2e-6)
    assert abs(lines[-1].speed_m_per_s) < 1e-4
    assert_within(lines, speed, acceleration, jerk, step_s)


@settings(max_examples=25)
@given(
    st.lists(st.tuples(st.sampled_from(["speed", "length"]), st.floats(-1.0, 1.0)), min_size=1,
             max_size=8),
    st.floats(0.1, 2.0), st.floats(0.1, 2.0), JERKS, STEPS,
)  # fmt: skip
def test_no_limit_is_ever_broken_whatever_is_reported(
    reported: list[tuple[str, float]],
    speed: float,
    acceleration: float,
    jerk: float | None,
    step_s: float,
) -> None:
    winch = winch_of(speed, acceleration, jerk, 50.0)
    lines = [winch.line]
    for number, (kind, value) in enumerate(reported):
        middle, half = 0.5 * (MIN_M + MAX_M), 0.5 * (MAX_M - MIN_M)
        value = middle + half * value if kind == "length" else 2.0 * speed * value
        assert winch.take(None, WinchCommand(kind, value), 0) == ""
        lines += ran(winch, 7.3, step_s, 7.3 * number)[1:]
    assert_within(lines, speed, acceleration, jerk, step_s)
    assert min(line.length_m for line in lines) >= MIN_M - ROUND_OFF_M
    assert max(line.length_m for line in lines) <= MAX_M + ROUND_OFF_M


def assert_within(
    lines: list[Payout], speed: float, acceleration: float, jerk: float | None, step_s: float
) -> None:
    speeds = [line.speed_m_per_s for line in lines]
    rates = [(v1 - v0) / step_s for v0, v1 in pairwise(speeds)]
    assert max(map(abs, speeds)) <= speed * (1.0 + 1e-9)
    assert max(map(abs, rates)) <= acceleration * (1.0 + 1e-6)
    if jerk is not None:  # of mean accelerations of two steps
        changes = [(a1 - a0) / step_s for a0, a1 in pairwise(rates)]
        assert max(map(abs, changes), default=0.0) <= jerk * (1.0 + 1e-6) + 1e-6


@pytest.mark.parametrize("goal", [75.0, 45.2])
def test_stopping_takes_the_time_of_the_quickest_profile(goal: float) -> None:
    """Trapezium of speed, or a triangle if the way is short: D/v + v/a, or 2·√(D/a)."""
    speed, acceleration, way = 1.0, 0.3, goal - 45.0
    winch = winch_of(speed, acceleration, None, 45.0)
    winch.take(None, WinchCommand("length", goal), 0)
    full = way > speed**2 / acceleration
    exact = way / speed + speed / acceleration if full else 2.0 * math.sqrt(way / acceleration)
    lines = ran(winch, exact + 0.2, 0.01)
    arrival = next(k for k, line in enumerate(lines) if goal - line.length_m < 1e-4) * 0.01
    assert arrival == pytest.approx(exact, abs=0.05)


def test_a_jerk_limited_start_is_the_cubic_of_the_closed_form() -> None:
    """t·(j·t²/6) while the acceleration grows, then parabolas."""
    acceleration, jerk, step_s = 0.3, 0.5, 0.01
    winch = winch_of(2.0, acceleration, jerk, 50.0)
    winch.take(None, WinchCommand("speed", 2.0), 0)
    lines = ran(winch, 2.0, step_s)
    grown = acceleration / jerk
    for t in (0.2, 0.5, 1.0, 2.0):
        early = min(t, grown)
        way = jerk * early**3 / 6.0
        if t > grown:
            way += 0.5 * jerk * grown**2 * (t - grown) + 0.5 * acceleration * (t - grown) ** 2
        assert lines[round(t / step_s)].length_m - 50.0 == pytest.approx(way, abs=1e-9)


@pytest.mark.parametrize("pace", [AccelerationLimited(0.3), JerkLimited(0.3, 0.5)])
def test_a_length_given_too_late_is_passed_by_no_more_than_braking_takes(
    pace: MotionProfile,
) -> None:
    line, passed = Payout(100.0, 0.0), 0.0
    for k in range(4000):
        goal = 150.0 if k < 1000 else 107.0
        up = goal > line.length_m
        wish = LineTarget(1.0 if up else -1.0, 20.0 if up else goal, goal if up else 200.0)
        line, _ = pace.move(line, wish, 0.01)
        passed = max(passed, line.length_m)
        if k == 999:
            begin = line
    assert line.length_m == pytest.approx(107.0, abs=1e-5)
    braking = begin.speed_m_per_s**2 / 0.6 + 0.3 * begin.speed_m_per_s / 0.5  # the ramp of jerk
    assert passed <= begin.length_m + braking


@given(st.floats(0.2, 3.0), st.floats(5.0, 80.0), st.floats(0.01, 0.1), st.integers(1, 12))
def test_layers_hold_the_rope_of_their_turns(
    core: float, turns: float, diameter: float, layers: int
) -> None:
    """Sum over layers of turns times circumference, r_k = r_0 + (k - 1/2)·0.9·d."""
    drum = Drum(core_radius_m=core, turns_per_layer=turns)
    radii = [core + (k - 0.5) * 0.9 * diameter for k in range(1, layers + 1)]
    whole = sum(turns * 2.0 * math.pi * radius for radius in radii)
    assert drum.length_m(layers, diameter) == pytest.approx(whole, rel=1e-12)
    assert drum.radius_m(layers, diameter) == pytest.approx(radii[-1], rel=1e-12)
    assert drum.layer_of(whole * (1.0 - 1e-9), diameter) == layers
    assert drum.layer_of(whole * (1.0 + 1e-9), diameter) == layers + 1
