"""[GE]'s riser in steady motion by harmonic balance: against a closed form, and the stepped one."""

from __future__ import annotations

from dataclasses import replace
from math import pi

import numpy as np
import pytest

from rope_twin.vortex.decomposed_response import DecomposedResponse
from rope_twin.vortex.force_table import ForceTable
from rope_twin.vortex.line_model import Span
from rope_twin.vortex.power_in import ExcitationSearch, decomposed
from validation.steady_riser import steady_amplitude

L, D, T, M, EI = 90.0, 0.03, 3700.0, 2.268, 3640.0
DENSITY, ZETA, LIFT = 1025.0, 0.04, 0.6


def _riser(speed: np.ndarray) -> Span:
    n = len(speed) - 1
    s, same = np.linspace(0.0, L, n + 1), np.ones(n + 1)
    return Span(s, T * same[1:], M * same[1:], D * same, speed, EI)


def test_steady_amplitude_with_constant_lift() -> None:
    """F/(2·m·ω²·ζ) of the driven mode, with F the share of ½·C_L·ρ·D·U² in it: 4/π."""
    ends = np.array([0.01, 5.0]), np.array([0.0, 9.0])
    table = ForceTable(*ends, np.full((2, 2), LIFT), np.ones((2, 2)))
    model = replace(decomposed(varying=False), table=table, structural=ZETA)
    span = _riser(np.full(181, 0.4))
    actual = ExcitationSearch(span, model).found()
    k = actual.dominant - 1
    moved, shape = D * steady_amplitude(span, model), actual.modes.shape[:, k]
    omega, water = 2.0 * pi * actual.frequency[k], DENSITY * 0.25 * pi * D**2
    push = 0.5 * LIFT * DENSITY * D * 0.4**2 * 4.0 / pi
    expected = push / (2.0 * ZETA * omega**2 * (M + water))
    antinode = np.abs(shape) > 0.999
    # the other modes, off resonance, add their share at right angles
    np.testing.assert_allclose(moved[antinode], expected, rtol=0.02)


@pytest.mark.parametrize(("varying", "margin"), [(False, 0.005), (True, 0.012)])
def test_the_time_domain_response_converges_to_the_harmonic_balance(
    varying: bool, margin: float
) -> None:
    """Mean rms along the riser in a shear [D], stepped by Bathe and read over ten periods."""
    span, model = _riser(np.linspace(0.0, 0.54, 91)), decomposed(varying)
    balanced = steady_amplitude(span, model) / np.sqrt(2.0)
    response = DecomposedResponse(span, model)
    response.remembered = 10.0
    count = int(24.0 / response.step_s)
    motion = np.zeros((count, len(span.s)))
    for row in range(count):
        response.advance(response.step_s)
        motion[row] = response.motion / D
    stepped = motion[count // 2 :].std(axis=0)
    assert balanced.mean() > 10.0 * margin
    assert stepped.mean() == pytest.approx(balanced.mean(), abs=margin)
