"""Axes, frames and ranges: round numbers that hold what they must."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rope_twin.view import overview
from rope_twin.view.charts import decade_range, depth_words, depths_over, round_step, ticks_over
from rope_twin.view.overview import depth_in_words, eye, frame_for, has_left

SPANS = st.floats(1e-6, 1e9)
VALUES = st.floats(-1e6, 1e6)


@given(SPANS, st.integers(2, 12))
def test_steps_are_one_two_five(span: float, most: int) -> None:
    step = round_step(span, most)
    assert float(f"{step:.0e}"[0]) in (1, 2, 5)
    assert span / step <= most * 1.001


@given(SPANS)
def test_ticks_reach_over_the_span_and_are_few(span: float) -> None:
    ticks = ticks_over(span)
    assert ticks[0] == 0.0
    assert ticks[-1] >= span * (1 - 1e-9)
    assert 2 <= len(ticks) <= 9
    assert np.allclose(np.diff(ticks), ticks[1])


def test_ticks_of_a_rope_of_3000_m() -> None:
    assert ticks_over(3000.0).tolist() == [0, 500, 1000, 1500, 2000, 2500, 3000]


@given(VALUES, VALUES)
def test_plots_hold_their_data_and_at_least_two_labels(one: float, other: float) -> None:
    low, high = min(one, other), max(one, other)
    bottom, top = decade_range(low, high)
    assert bottom <= low
    assert high <= top
    # some power of ten has two to six multiples in the range: that is what rerun labels
    counts = []
    for exponent in range(-9, 9):
        step = 10.0**exponent
        counts.append(np.floor(top / step) - np.ceil(bottom / step) + 1)
    assert any(2 <= count <= 6 for count in counts)


@pytest.mark.parametrize(
    ("low", "high", "labels"),
    [
        (259.0, 371.0, (200.0, 300.0, 400.0)),  # top tension [kN]
        (-0.45, 0.38, (-1.0, 0.0, 1.0)),  # heave [m]
        (-2.1, 2.3, (-2.0, -1.0, 0.0, 1.0, 2.0)),  # heave in a storm
        (2999.99, 3020.01, (3000.0, 3010.0, 3020.0)),  # line out [m]: no decade for 1 cm
        (3000.0, 3000.0, (3000.0,)),  # the winch stands
    ],
)
def test_plots_of_a_lift(low: float, high: float, labels: tuple[float, ...]) -> None:
    bottom, top = decade_range(low, high)
    assert all(bottom < label < top for label in labels)
    assert top - bottom < 2.5 * max(high - low, 1.0)


def leaning(east_m: float, north_m: float, depth_m: float) -> np.ndarray:
    s = np.linspace(0.0, 1.0, 21)
    return np.stack([east_m * s**2, north_m * s**2, -depth_m * s], axis=-1)


@pytest.mark.parametrize(
    ("aside_m", "depth_m", "factor"),
    [(10.0, 3000.0, 50), (70.0, 3000.0, 10), (400.0, 1000.0, 1), (0.0, 200.0, 50)],
)
def test_the_needle_is_widened_by_a_round_factor(
    aside_m: float, depth_m: float, factor: int
) -> None:
    assert frame_for(leaning(aside_m, 0.0, depth_m)).factor == factor


@given(st.floats(0.0, 6.28), st.floats(1.0, 300.0), st.floats(50.0, 5000.0))
def test_the_drift_points_to_the_right_wherever_it_goes(
    azimuth: float, aside_m: float, depth_m: float
) -> None:
    rope = leaning(aside_m * np.cos(azimuth), aside_m * np.sin(azimuth), depth_m)
    frame = frame_for(rope)
    position, target = (np.array(point) for point in eye(frame))
    forward = target - position
    right = np.cross(forward, [0.0, 0.0, 1.0])
    drift = frame.place(rope)[-1] * [1.0, 1.0, 0.0]
    assert right @ drift >= 0.0
    # everything is before the eye, inside 55 degrees up and down
    away = (frame.place(rope) - position) @ forward / np.linalg.norm(forward)
    height = np.abs(frame.place(rope)[:, 2] - target[2])
    assert (away > 0.0).all()
    assert (height / away < np.tan(np.radians(27.5))).all()


@pytest.mark.parametrize("aside_m", [0.0, 20.0, 64.0, 150.0])
def test_a_rope_far_aside_is_in_the_picture_with_its_name_and_the_scale(aside_m: float) -> None:
    """The pane shows 0.345 of the eye's distance to either side: measured in a picture."""
    rope = leaning(aside_m, 0.0, 140.0)
    frame = frame_for(rope)
    position, target = (np.array(point) for point in eye(frame))
    half = 0.345 * np.linalg.norm((target - position)[:2])
    name, scale = 0.09 * 140.0, 0.26 * 140.0
    assert frame.place(rope)[:, 0].max() + name < target[0] + half
    assert -scale > target[0] - half


@pytest.mark.parametrize(
    ("highest_m", "deepest_m", "depths"),
    [
        (0.0, 3000.0, [0, 500, 1000, 1500, 2000, 2500, 3000]),
        (2.0, 3000.0, [0, 500, 1000, 1500, 2000, 2500, 3000]),  # a hang-off at the water heaves
        (25.0, 3.0, [-25, -20, -15, -10, -5, 0, 5]),
        (25.0, -4.0, [-25, -20, -15, -10, -5, 0]),  # all of it in the air
        (40.0, 90.0, [-40, -20, 0, 20, 40, 60, 80, 100]),
        (25.4, 3.0, [-25, -20, -15, -10, -5, 0, 5]),  # a crane tip that heaves
    ],
)
def test_the_depth_scale_begins_at_a_crane_above_the_water(
    highest_m: float, deepest_m: float, depths: list[float]
) -> None:
    assert depths_over(highest_m, deepest_m).tolist() == depths


def test_heights_are_reported_with_a_plus() -> None:
    assert [depth_words(depth) for depth in (-20.0, 0.0, 20.0)] == ["+20", "0", "20"]
    assert depth_in_words(2.44) == "2.4 m depth"
    assert depth_in_words(-7.0) == "7.0 m above the water"


@given(st.floats(0.0, 60.0), st.floats(1.0, 3000.0), st.floats(0.0, 50.0))
def test_all_of_a_rope_from_a_crane_is_in_the_picture(
    height_m: float, length_m: float, aside_m: float
) -> None:
    rope = leaning(min(aside_m, 0.2 * length_m), 0.0, length_m) + np.array([0.0, 0.0, height_m])
    frame = frame_for(rope)
    drawn = frame.place(rope)
    position, target = (np.array(point) for point in eye(frame))
    forward = target - position
    away = (drawn - position) @ forward / np.linalg.norm(forward)
    assert (away > 0.0).all()
    assert (np.abs(drawn[:, 2] - target[2]) / away < np.tan(np.radians(27.5))).all()


def test_a_hang_off_away_from_the_origin_is_in_the_middle_of_the_picture() -> None:
    """Its place was multiplied with the factor of distances sideways: the rope was nowhere."""
    at = np.array([12.0, 15.0, 0.0])
    rope = leaning(2.0, 0.0, 400.0)
    frame, moved = frame_for(rope), frame_for(rope + at)
    assert frame.factor > 1
    assert moved.place(rope + at) == pytest.approx(frame.place(rope))
    assert eye(moved) == eye(frame)


def test_a_ship_under_way_stays_in_the_picture() -> None:
    frame = frame_for(leaning(0.0, 0.0, 400.0))
    assert frame.factor == 50
    assert not has_left(frame, leaning(0.0, 0.0, 400.0) + np.array([2.0, 0.0, 0.0]))
    away = leaning(0.0, 0.0, 400.0) + np.array([3.0, 0.0, 0.0])
    assert has_left(frame, away)
    frame = frame_for(away, frame.gone_m(away))
    assert frame.factor == 20  # so that a ship that surges does not do this at every wave
    assert not has_left(frame, leaning(0.0, 0.0, 400.0) - np.array([2.0, 0.0, 0.0]))


@given(st.floats(0.0, 80.0))
def test_hang_off_and_water_are_in_one_picture(above_m: float) -> None:
    """And a hang-off at the water is seen as ever."""
    position, target = (np.array(point) for point in overview.SurfaceView(above_m).eye())
    forward = (target - position) / np.linalg.norm(target - position)
    up = np.cross(np.cross(forward, [0.0, 0.0, 1.0]), forward)
    for height in (0.0, above_m):
        spot = np.array([0.0, 0.0, height]) - position
        assert abs(spot @ up) / (spot @ forward) < np.tan(np.radians(27.5))
    if above_m == 0.0:
        assert (tuple(position), tuple(target)) == (overview.EYE, overview.TARGET)
