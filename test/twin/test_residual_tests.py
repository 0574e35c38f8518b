"""Tests of residuals over minutes: χ² of their variance, scatter, and drift, on made-up series."""

from __future__ import annotations

import json

import numpy as np
import pytest
from scipy.stats import chi2, norm

from rope_twin.twin.residual_tests import (
    FREEDOM_S,
    VARIANCE_S,
    ResidualMonitor,
    ResidualTests,
)
from rope_twin.twin.state_file import deserialise, serialise

S = 1_000_000_000
SIGMA, OWN = 1500.0, 1200.0  # standard uncertainty of a residual, and of the instrument alone


def after(residuals: np.ndarray, rate_hz: float = 2.0) -> ResidualTests | None:
    """Results after all residuals [σ], at even times."""
    monitor = ResidualMonitor()
    for k, one in enumerate(residuals):
        monitor.take(round(k * S / rate_hz), float(one) * SIGMA, SIGMA, OWN)
    return monitor.result


def white(minutes: float, sigma: float = 1.0, seed: int = 1) -> np.ndarray:
    return np.random.default_rng(seed).normal(0.0, sigma, round(120 * minutes))


def test_nothing_is_said_before_two_minutes() -> None:
    assert after(white(1.9)) is None
    assert after(white(2.1)) is not None
    assert after(white(9.0), rate_hz=0.5) is None, "too few in each bin"


def test_a_variance_as_given_is_nothing_odd() -> None:
    for seed in range(20):
        found = after(white(6.0, seed=seed))
        assert found is not None
        assert abs(found.deviate) < 3.0
        assert found.variance == pytest.approx(1.0, abs=0.3)
        assert found.scatter == pytest.approx(SIGMA / OWN, abs=0.2)
        assert (found.span_s, found.drift) == (VARIANCE_S, None)


@pytest.mark.parametrize("sigma", [0.5, 1.3, 1.6])
def test_the_deviate_is_that_of_chi_square(sigma: float) -> None:
    """By SciPy's distribution, in the same degrees of freedom; Wilson-Hilferty is good to 0.1."""
    found = after(white(6.0, sigma))
    assert found is not None
    freedom = VARIANCE_S / FREEDOM_S
    exact = norm.isf(chi2.sf(found.variance * freedom, freedom))
    assert found.deviate == pytest.approx(exact, abs=0.1)


def test_old_residuals_are_forgotten() -> None:
    found = after(np.concatenate([white(6.0, 10.0), white(5.5)]))
    assert found is not None
    assert found.variance < 1.5


def test_results_and_a_drift_are_restored_from_a_state() -> None:
    """They were objects that a new monitor lacks: no state with results could be resumed."""
    monitor, resumed = ResidualMonitor(), ResidualMonitor()
    residuals = white(60.0) + np.where(np.arange(7200) < 3000, 0.0, 2.0)
    for k, one in enumerate(residuals):
        monitor.take(k * S // 2, float(one) * SIGMA, SIGMA, OWN)
    assert monitor.result is not None
    assert monitor.result.drift is not None
    plain = json.loads(json.dumps(serialise(monitor, {}, "monitor")))
    resumed = deserialise(plain, resumed, {}, "monitor")
    assert resumed.result == monitor.result
    for k in range(7200, 7300):
        for one in (monitor, resumed):
            one.take(k * S // 2, SIGMA, SIGMA, OWN)
    assert resumed.result == monitor.result


def test_a_drift_is_found_long_before_it_is_outside_the_interval() -> None:
    """0.05 σ a minute from the 30th on; the sign is its own, and the time about right."""
    minutes = np.arange(120 * 60) / 120.0
    for sign in (1.0, -1.0):
        monitor, found_at = ResidualMonitor(), 0.0
        ramp = sign * 0.05 * np.maximum(minutes - 30.0, 0.0)
        for k, one in enumerate(white(60.0) + ramp):
            monitor.take(round(k * S / 2.0), float(one) * SIGMA, SIGMA, OWN)
            found = monitor.result
            if found is not None and found.drift is not None:
                found_at = minutes[k]
                break
        assert 33.0 < found_at < 55.0
        assert found is not None
        assert found.drift is not None
        assert sign * found.drift > 0.1
        assert abs(found_at - found.drift_s / 60.0 - 30.0) < 10.0


def test_no_drift_in_ten_hours_of_noise() -> None:
    for seed in (2, 3):
        found = after(white(600.0, seed=seed))
        assert found is not None
        assert found.drift is None
