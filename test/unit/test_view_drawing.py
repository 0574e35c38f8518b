"""Axes, frames and ranges: round numbers that hold what they must."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rope_twin.view.overview import eye, frame_for
from rope_twin.view.ticks import decade_range, round_step, ticks_over

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
