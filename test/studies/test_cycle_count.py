"""Rainflow counting while series grow, against the rainflow package on the whole of them."""

from __future__ import annotations

import copy

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from whole_history import count_cycles

from rope_twin.vortex.fatigue import Cycles, RainflowCount, Vector


def cost(cycles: Cycles) -> Vector:
    """Something of range, mean and count that no other cycle gives."""
    used: Vector = cycles.count * cycles.range**3 * (1.0 + 0.01 * cycles.mean)
    return used


def expected(series: Vector) -> float:
    return float(cost(count_cycles(series)).sum())


def taken(values: Vector) -> RainflowCount:
    count = RainflowCount(values.shape[1])
    for row in values:
        count.take(row, cost)
    return count


@given(st.integers(0, 2**31), st.integers(0, 60), st.sampled_from([2, 5, 40]))
def test_it_is_that_of_the_package_after_every_value(seed: int, length: int, size: int) -> None:
    """Ties, standstill and all; a sum asked for on the way changes nothing."""
    values = np.random.default_rng(seed).integers(-size, size + 1, (length, 5)).astype(float)
    count = taken(values[: length // 2])
    halfway = count.total(cost)
    for row in values[length // 2 :]:
        count.take(row, cost)
    assert np.allclose(halfway, [expected(s) for s in values[: length // 2].T], rtol=1e-12)
    assert np.allclose(count.total(cost), [expected(s) for s in values.T], rtol=1e-12)


def test_a_long_ringing_down_closes_nothing_and_is_not_forgotten() -> None:
    """Every range is smaller than the one before: all stay open, beyond any room made before."""
    ringing = np.array([(-1.0) ** k * 0.99**k for k in range(400)])[:, None]
    count = taken(ringing)
    assert count.cycles[0] == 0.0
    assert np.isclose(count.total(cost)[0], expected(ringing[:, 0]), rtol=1e-12)


def test_no_value_is_no_change() -> None:
    """A series that pauses is the one without the pause; one that never begins uses nothing."""
    values = np.random.default_rng(1).normal(size=(40, 3))
    paused = np.repeat(values, 2, axis=0)
    paused[1::2] = np.nan
    paused[:, 2] = np.nan
    used = taken(paused).total(cost)
    assert np.array_equal(used[:2], taken(values).total(cost)[:2])
    assert used[2] == 0.0


def test_a_copy_goes_on_to_the_bit() -> None:
    values = np.random.default_rng(2).normal(size=(200, 4)).cumsum(axis=0)
    count = taken(values[:77])
    other = copy.deepcopy(count)
    for row in values[77:]:
        other.take(row, cost)
    assert np.array_equal(other.total(cost), taken(values).total(cost))
