"""Means of a fast-varying quantity between coarse nodes."""

from __future__ import annotations

import numpy as np
import pytest

from rope_twin.vortex.line_model import mean_around

NONE = np.zeros(9)  # no least length


def test_means_of_a_straight_line_and_of_a_kink() -> None:
    """A line's mean is its value at the weight's centre; of |x|, and where it is mirrored."""
    at, s = np.array([-9.0, -5.0, -2.0, 0.0]), np.array([-9.0, -7.5, -3.0, 0.0])
    centres = np.array([-9.0 + 4.0 / 3.0, -5.0 - 1.0 / 3.0, -2.0 - 1.0 / 3.0, -2.0 / 3.0])
    np.testing.assert_allclose(mean_around(at, s, 2.0 * s + 3.0, NONE[:4]), 2.0 * centres + 3.0)
    kink = mean_around(
        np.array([-1.0, 0.0, 1.0]), np.array([-1.0, 0.0, 1.0]), np.array([1, 0, 1.0]), NONE[:3]
    )
    np.testing.assert_allclose(kink, [2.0 / 3.0, 1.0 / 3.0, 2.0 / 3.0])


def test_means_on_coarse_nodes_sum_to_the_integral() -> None:
    """Thirty half waves of sin², five nodes: the shares add up to the integral, ½ of the length."""
    s = np.linspace(-90.0, 0.0, 901)
    at = np.array([-90.0, -61.0, -40.0, -7.0, 0.0])
    values = np.sin(np.pi * s / 3.0) ** 2
    shares = 0.5 * (np.append(np.diff(at), 0.0) + np.append(0.0, np.diff(at)))
    assert (mean_around(at, s, values, NONE[:5]) * shares).sum() == pytest.approx(45.0, rel=1e-12)
    # a node beyond the ends has what the end has: a rope that has been paid out since
    line = 2.0 * s[-31:]
    beyond, there = (mean_around(np.array([x, -1.0]), s[-31:], line, np.full(2, 9.0))[0]
                     for x in (-3.2, -3.0))  # fmt: skip
    assert beyond == there == pytest.approx(-4.0)


def test_mean_of_standing_waves_is_independent_of_the_mesh() -> None:
    """|sin| of half waves of 15 m: its mean, 2/π, on nodes 1 m, 4 m and 10 m apart."""
    s = np.linspace(-300.0, 0.0, 6001)
    values = np.abs(np.sin(np.pi * s / 15.0))
    for step in (1.0, 4.0, 10.0):
        at = np.arange(-300.0, 0.5 * step, step)
        means = mean_around(at, s, values, np.full(len(at), 15.0))
        assert np.abs(means - 2.0 / np.pi).max() < 1e-5


def test_means_of_slightly_shorter_waves_than_given() -> None:
    """Half waves of 12.5 m where 15 m are given: sinc²(1.2) = 0.024 of them is left, on any nodes.

    On every tenth metre they would look like waves of 50 m.
    """
    s = np.linspace(-300.0, 0.0, 6001)
    values = np.cos(2.0 * np.pi * s / 12.5)
    for step in (1.0, 10.0):
        at = np.arange(-300.0, 0.5 * step, step)
        means = mean_around(at, s, values, np.full(len(at), 15.0))
        assert np.abs(means).max() < 1.01 * np.sinc(1.2) ** 2
