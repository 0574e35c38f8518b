"""CUSUM: run lengths against published tables and simulation, self-start without known figures."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import kstest, t

from rope_twin.errors import InputError
from rope_twin.twin.residual_tests import (
    MIN_BLOCKS,
    SETTLING_BLOCKS,
    SlowDrift,
    _normal_of_t,
    limit_for,
    run_length,
)


@pytest.mark.parametrize(
    ("limit", "shift", "published"),
    [
        # Montgomery, Introduction to Statistical Quality Control, table of the tabular CUSUM with
        # k = 1/2 (two-sided), after Lucas 1976
        (4.0, 0.0, 168.0), (4.0, 0.25, 74.2), (4.0, 0.5, 26.6), (4.0, 1.0, 8.38), (4.0, 2.0, 3.34),
        (5.0, 0.0, 465.0), (5.0, 0.25, 139.0), (5.0, 0.5, 38.0), (5.0, 1.0, 10.4), (5.0, 2.0, 4.01),
    ],
)  # fmt: skip
def test_run_lengths_are_the_published_ones(limit: float, shift: float, published: float) -> None:
    """Three figures of the table."""
    assert run_length(limit, shift) == pytest.approx(published, rel=4e-3)


def test_limit_gives_the_run_length_asked_for() -> None:
    """Its inverse; what cannot be is refused."""
    for length in (10.0, 465.4, 40320.0):
        assert run_length(limit_for(length)) == pytest.approx(length, rel=1e-4)
    for wrong in (1.0, 1e9, float("nan")):
        with pytest.raises(InputError, match="average run length"):
            limit_for(wrong)
    with pytest.raises(InputError, match="positive"):
        run_length(0.0)


def test_normal_deviate_of_student_t() -> None:
    """Draws of Student's t become normal."""
    values = [_normal_of_t(float(x), 4) for x in t(4).rvs(2000, random_state=5)]
    assert kstest(values, "norm").pvalue > 0.01


def alarms(offsets: np.ndarray, drift: SlowDrift) -> list[int]:
    """Blocks at which a drift is reported."""
    found = []
    for k, one in enumerate(offsets):
        if drift.take(float(one)) is not None:
            found.append(k)
            drift.restart()
    return found


def test_run_length_without_a_drift_does_not_depend_on_mean_and_spread() -> None:
    """Self-started: within four standard errors of the run length, or longer for the limited q.

    Each run has to settle and to find its reference first.
    """
    rng = np.random.default_rng(2)
    for mean, spread in ((0.0, 200.0), (-900.0, 50.0)):
        found = alarms(mean + spread * rng.standard_normal(60_000), SlowDrift(1.0, 300.0))
        length = 60_000 / len(found) - SETTLING_BLOCKS - MIN_BLOCKS
        error = 300.0 / np.sqrt(len(found))
        assert 300.0 - 4.0 * error < length < 1.5 * 300.0


def test_a_drift_is_found_with_its_size_and_beginning() -> None:
    """40 N a minute in a spread of 150 N from block 60 on: found before 10 minutes have passed."""
    rng, steps = np.random.default_rng(4), np.arange(120)
    offsets = 150.0 * rng.standard_normal(120) - 40.0 * np.clip(steps - 60, 0, None)
    drift = SlowDrift(100.0)
    reports = [drift.take(float(one)) for one in offsets]
    k = next(number for number, one in enumerate(reports) if one is not None)
    found = reports[k]
    assert found is not None
    assert 62 <= k <= 75
    assert abs(k - found.begun - 60) <= 6
    assert found.offset_n < -100.0
    assert drift.level > 1.0


def test_the_reference_does_not_learn_after_the_alarm_and_missing_blocks_do_not_count() -> None:
    """The level stays above 1 while the offset stays; NaN changes nothing."""
    drift = SlowDrift(50.0)
    for _ in range(20):
        assert drift.take(0.0) is None
    levels = []
    for _ in range(30):
        drift.take(400.0)
        levels.append(drift.level)
    assert levels[-1] > 1.0
    assert levels[-1] > levels[10]
    before = drift.level
    assert drift.take(float("nan")) is None
    assert drift.level == before
