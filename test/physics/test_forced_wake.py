"""The forced wake oscillator stepped in time against its harmonic balance (two programs)."""

from __future__ import annotations

import numpy as np
import pytest

from validation import forced_wake, wake_cylinder

UPRIGHT = forced_wake.SET.upright


def test_stepped_and_harmonic_balance_power_agree() -> None:
    """Within 6 % of the drag's power: the balance leaves out the third harmonic, 5 %."""
    reduced, y = np.array([5.2, 6.0, 6.6, 7.0]), np.array([0.4, 0.8, 0.6, 1.0])
    stepped = forced_wake.mean_power(forced_wake.KEPT, UPRIGHT, reduced, y)
    for at, power in enumerate(stepped):
        balanced = wake_cylinder.mean_power(reduced[at], y[at], *UPRIGHT)
        V = reduced[at] / (2.0 * np.pi)
        drag = forced_wake.DRAG * np.hypot(V, y[at]) * y[at] ** 2 / 2.0
        assert power == pytest.approx(balanced, abs=0.06 * drag)
        assert (power > 0.0) == (balanced > 0.0) == (at != 3)


def test_the_free_vibration_lies_in_the_power_in_region() -> None:
    """Q3's cylinder at V_r 5: y/D 0.724, V_r 5.27 by its own frequency; power comes in there."""
    amplitude, frequency = wake_cylinder.FREE[5.0]
    at = np.array([5.0 / frequency]), np.array([amplitude])
    assert forced_wake.mean_power(forced_wake.KEPT, UPRIGHT, *at) > 0.0


@pytest.mark.parametrize("pair", [forced_wake.SET.upright, forced_wake.SET.inclined])
def test_power_in_region_ends_and_amplitude_in_closed_form(pair: tuple[float, float]) -> None:
    """Root of the balance by numpy, against |1 - (St·V_r)²| = β·V_r and its amplitude."""
    lower, upper = wake_cylinder.ends(pair[0])
    assert lower * upper == pytest.approx(1.0 / forced_wake.SET.strouhal**2, rel=1e-12)
    y = np.linspace(0.02, 1.3, 641)
    for end, outward in ((lower, -1.0), (upper, 1.0)):
        inside, outside = end - 1e-3 * outward, end + 1e-3 * outward
        assert max(wake_cylinder.mean_power(inside, one, *pair) for one in y) > 0.0
        assert max(wake_cylinder.mean_power(outside, one, *pair) for one in y) < 0.0
    for reduced in np.linspace(lower + 0.02, upper - 0.02, 9):
        computed = wake_cylinder.largest_amplitude(reduced, pair)
        assert computed == pytest.approx(wake_cylinder.highest(reduced, pair), rel=1e-6)


def test_the_power_in_region_has_no_hysteresis() -> None:
    """One amplitude of q per forced motion there, from a small or a large initial q."""
    lower, upper = wake_cylinder.ends(UPRIGHT[0])
    reduced, y = np.array([lower + 0.1, lower + 0.3, upper - 0.1]), np.array([0.55, 0.4, 0.7])
    powers = [
        forced_wake.mean_power(forced_wake.KEPT._replace(first=first), UPRIGHT, reduced, y)
        for first in (0.01, 8.0)
    ]
    np.testing.assert_allclose(powers[0], powers[1], rtol=1e-4)
    st, epsilon = forced_wake.SET.strouhal, UPRIGHT[1]
    for at in (lower, upper):  # the cubic's derivative has no root: (Ω² - 1)² > (ε·Ω)²/3
        assert (1.0 - (st * at) ** 2) ** 2 > (epsilon * st * at) ** 2 / 3.0
