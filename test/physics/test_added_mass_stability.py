"""Added mass on the left-hand side against added mass as a lagged force.

Source: thesis on ultra-slender structures, Shanghai Jiao Tong University, ch. 3: an oscillator
(m + m_a)·x'' + k·x = 0, whose m_a·x'' is either implicit or taken from the step before.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from rigs import Vector

from validation.stepping import (
    DERIVED_M,
    SECONDS,
    STEPS_S,
    STIFFNESS,
    Oscillator,
    lagged_matrix,
)


def largest_error(positions: Vector, amplitude: float, omega: float, h: float) -> float:
    """Largest distance from x0·cos(ωt) at h, 2h ..."""
    times = h * np.arange(1, len(positions) + 1)
    return float(np.abs(positions - amplitude * np.cos(omega * times)).max())


@pytest.mark.parametrize(("h", "printed"), list(zip(STEPS_S, DERIVED_M, strict=True)))
def test_lagged_added_mass_has_the_published_error(h: float, printed: float) -> None:
    """S1: m 11, m_a 10, k 9, x0 10: largest error over 20 s [m]."""
    step, state = lagged_matrix(11.0, 10.0, h), np.array([10.0, 0.0, -10.0 * STIFFNESS / 21.0])
    positions = []
    for _ in range(round(SECONDS / h)):
        state = step @ state
        positions.append(state[0])
    error = largest_error(np.array(positions), 10.0, math.sqrt(STIFFNESS / 21.0), h)
    assert error == pytest.approx(printed, abs=0.005)


@pytest.mark.parametrize("h", STEPS_S)
def test_lagged_added_mass_is_unstable_above_the_mass(h: float) -> None:
    """S1: the spectral radius passes 1 with m_a = m, at every step."""
    for m, added, stable in ((11.0, 10.0, True), (10.0, 11.0, False), (1.0, 10.0, False)):
        radius = np.abs(np.linalg.eigvals(lagged_matrix(m, added, h))).max()
        assert (radius < 1.0) == stable


@pytest.mark.parametrize(
    ("m", "added", "start"), [(11.0, 10.0, 10.0), (10.0, 11.0, 10.0), (1.0, 10.0, 1.0)]
)
def test_implicit_added_mass_is_bounded_and_of_second_order(
    m: float, added: float, start: float
) -> None:
    """S1 through the twin's own step: bounded, second order, whatever m_a is.

    From 10 m the lightest would go slack, so it starts from 1 m (the problem is linear).
    """
    errors = []
    for h in STEPS_S[:-1]:
        oscillator = Oscillator(m, added, h)
        oscillator.set(start, 0.0)
        positions = np.array([oscillator.step()[0] for _ in range(round(SECONDS / h))])
        assert np.abs(positions).max() <= start
        errors.append(largest_error(positions, start, oscillator.omega, h) / start)
    assert errors[0] < 0.03
    assert errors[3] < 1e-4
    slope = np.polyfit(np.log(STEPS_S[:-1]), np.log(errors), 1)[0]
    assert slope == pytest.approx(2.0, abs=0.2)


@pytest.mark.parametrize(
    ("part", "trapezoidal", "ours"),
    [(0.1, 1.0, 0.9995), (0.5, 1.0, 0.8887), (1.0, 1.0, 0.6356), (10.0, 1.0, 0.0767)],
)
def test_spectral_radius_is_that_of_tr_bdf2(part: float, trapezoidal: float, ours: float) -> None:
    """S2: h/T 0.1, 0.5, 1 and 10. The table's Newmark and Bathe lie between 0.99 and 0.08.

    The exact radius is that of TR-BDF2's stability function (Hosea and Shampine 1996), with
    γ = 2 - √2 and z = iωh: R = (k1·(1 + γz/2)/(1 - γz/2) - k2)/(1 - γz/2).
    """
    oscillator = Oscillator(10.0, 11.0, 1.0)
    h = part * 2.0 * math.pi / oscillator.omega
    oscillator = Oscillator(10.0, 11.0, h)
    columns = []
    for x, v in ((1.0, 0.0), (0.0, 1.0)):
        oscillator.set(x, v)
        columns.append(oscillator.step())
    radius = np.abs(np.linalg.eigvals(np.array(columns).T)).max()
    gamma, z = 2.0 - math.sqrt(2.0), 1j * oscillator.omega * h
    k1 = 1.0 / (gamma * (2.0 - gamma))
    low = 1.0 - 0.5 * gamma * z
    exact = abs((k1 * (1.0 + 0.5 * gamma * z) / low + 1.0 - k1) / low)
    assert radius == pytest.approx(exact, rel=1e-5)
    assert radius == pytest.approx(ours, abs=5e-5)
    assert radius < trapezoidal
