"""The forced wake oscillator stepped in time against its harmonic balance (two programs)."""

from __future__ import annotations

import numpy as np
import pytest

from rope_twin.studies.validation import forced_wake, wake_cylinder

UPRIGHT = forced_wake.SET.upright


def test_both_find_the_same_power() -> None:
    """Within 6 % of the drag's power: the balance leaves out the third harmonic, 5 %."""
    reduced, y = np.array([5.2, 6.0, 6.6, 7.0]), np.array([0.4, 0.8, 0.6, 1.0])
    stepped = forced_wake.mean_power(forced_wake.KEPT, UPRIGHT, reduced, y)
    for at, power in enumerate(stepped):
        balanced = wake_cylinder.mean_power(reduced[at], y[at], *UPRIGHT)
        V = reduced[at] / (2.0 * np.pi)
        drag = forced_wake.DRAG * np.hypot(V, y[at]) * y[at] ** 2 / 2.0
        assert power == pytest.approx(balanced, abs=0.06 * drag)
        assert (power > 0.0) == (balanced > 0.0) == (at != 3)


def test_the_region_begins_below_where_the_free_cylinder_vibrates() -> None:
    """Q3's cylinder at V_r 5 keeps y/D 0.724 at 5.27 on its own frequency: power comes in there."""
    amplitude, frequency = wake_cylinder.FREE[5.0]
    at = np.array([5.0 / frequency]), np.array([amplitude])
    assert forced_wake.mean_power(forced_wake.KEPT, UPRIGHT, *at) > 0.0
