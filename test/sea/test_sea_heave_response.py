"""Closed-form heave RAO of a box hull: limits, equation of motion, invalid hulls."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rope_twin.errors import InputError
from rope_twin.sea.ship_motion import BoxHull, heave_response

G = 9.80665
HULLS = st.builds(
    BoxHull,
    length_m=st.floats(40.0, 300.0),
    breadth_m=st.floats(8.0, 50.0),
    draught_m=st.floats(2.0, 15.0),
    block_coefficient=st.floats(0.5, 1.0),
)


@given(HULLS)
def test_heave_rao_limits_in_long_and_short_waves(hull):
    long, short = heave_response(hull, np.array([1e-3, 1.0]))
    assert long == pytest.approx(1.0, abs=5e-3)
    assert abs(short) < 1e-2


@given(HULLS, st.floats(0.02, 0.4))
def test_heave_rao_amplitude_of_the_published_formula(hull, frequency_hz):
    # Φ_w = η·F with η = 1/√((1 − 2kTα²)² + (A²/(kBα²))²), α = 1
    k = (2 * np.pi * frequency_hz) ** 2 / G
    b, t = hull.breadth_m * hull.block_coefficient, hull.draught_m
    a = 2 * np.sin(k * b / 2) * np.exp(-k * t)
    eta = 1 / np.sqrt((1 - 2 * k * t) ** 2 + (a**2 / (k * b)) ** 2)
    f = np.sqrt((1 - k * t) ** 2 + (a**2 / (k * b)) ** 2)
    force = np.exp(-k * t) * f * 2 / (k * hull.length_m) * np.sin(k * hull.length_m / 2)
    computed = heave_response(hull, np.array([frequency_hz]))[0]
    assert abs(computed) == pytest.approx(abs(eta * force), rel=1e-9)


def test_the_heave_rao_solves_the_equation_of_motion():
    # 2·(kT/ω²)·ẅ + A²/(k·B·ω)·ẇ + w = F·cos ωt, checked in time at quarter periods
    hull, frequency_hz = BoxHull(), 0.08
    omega = 2 * np.pi * frequency_hz
    k = omega**2 / G
    b = hull.breadth_m * hull.block_coefficient
    a = 2 * np.sin(k * b / 2) * np.exp(-k * hull.draught_m)
    response = heave_response(hull, np.array([frequency_hz]))[0]
    t = np.linspace(0.0, 1.0 / frequency_hz, 5)
    turning = np.exp(1j * omega * t)
    w, rate = (response * turning).real, (1j * omega * response * turning).real
    left = 2 * k * hull.draught_m / omega**2 * (-(omega**2) * w) + a**2 / (k * b * omega) * rate + w
    f = np.sqrt((1 - k * hull.draught_m) ** 2 + (a**2 / (k * b)) ** 2)
    force = np.exp(-k * hull.draught_m) * f * np.sinc(k * hull.length_m / (2 * np.pi))
    assert left == pytest.approx(force * np.cos(omega * t), abs=1e-12)


def test_heave_vanishes_in_waves_of_the_hulls_length():
    frequency_hz = np.sqrt(G / (2 * np.pi * 120.0))
    assert abs(heave_response(BoxHull(length_m=120.0), np.array([frequency_hz]))[0]) < 1e-12


def test_heave_lags_by_a_quarter_period_at_resonance():
    frequency_hz = np.sqrt(G / (2 * 7.0)) / (2 * np.pi)  # 2kT = 1
    response = heave_response(BoxHull(length_m=20.0, draught_m=7.0), np.array([frequency_hz]))[0]
    assert np.angle(response) == pytest.approx(-np.pi / 2)


@pytest.mark.parametrize(
    ("name", "value"),
    [("length_m", 0.0), ("breadth_m", np.nan), ("draught_m", -7.0), ("block_coefficient", 1.2)],
)
def test_invalid_hulls_are_rejected(name, value):
    with pytest.raises(InputError, match=f"hull {name}: .*right is "):
        BoxHull(**{name: value})
