"""Modal VIV model: modes and response against closed forms and scipy's integrators."""

from __future__ import annotations

from dataclasses import replace
from math import pi

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import jn_zeros

from rope_twin.errors import InputError
from rope_twin.vortex.line_model import Span, refined
from rope_twin.vortex.modal_response import Drive, ModalResponse, ModalState, advance_modes
from rope_twin.vortex.modes import ModeSearch
from rope_twin.vortex.shedding import Lift, Shedding, leading_zones, nearest_zones
from validation.modal_lines import all_zones, dominant_zones

L, T, M = 300.0, 100e3, 2.05


def string(n: int = 200, speed: float = 0.0, stiffness: float = 0.0) -> Span:
    s = np.linspace(0.0, L, n + 1)
    same = np.ones(n + 1)
    return Span(s, T * same[1:], M * same[1:], 0.02 * same, speed * same, stiffness)


@pytest.mark.parametrize("stiffness", [0.0, 5e4])
def test_frequencies_of_string_and_beam(stiffness: float) -> None:
    """n/(2L)·√(T/m + n²π²EI/(mL²)), second order in the element length."""
    n = np.arange(1, 9)
    exact = 0.5 * n / L * np.sqrt(T / M + (n * pi / L) ** 2 * stiffness / M)
    errors = []
    for elements in (100, 200):
        span = string(elements, stiffness=stiffness)
        computed = ModeSearch(span, 1.02 * exact[-1]).found()
        assert len(computed.frequency) == 8
        errors.append(np.abs(computed.frequency / exact - 1.0).max())
        np.testing.assert_allclose(computed.mass, 0.5 * M * L, rtol=5e-3)
    assert errors[0] < 1.5e-2
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.1)


def test_frequencies_of_a_hanging_chain() -> None:
    """A free lower end: ω = j_{0,n}/2·√(g/L), and its end swings most."""
    n = 2000
    s = np.linspace(0.0, 100.0, n + 1)
    tension = 9.81 * M * 0.5 * (s[1:] + s[:-1])
    span = Span(s, tension, np.full(n, M), np.ones(n + 1), np.zeros(n + 1), end_mass=0.0)
    exact = 0.5 * jn_zeros(0, 4) * np.sqrt(9.81 / 100.0) / (2.0 * pi)
    computed = ModeSearch(span, 1.01 * exact[-1]).found()
    np.testing.assert_allclose(computed.frequency, exact, rtol=2e-3)
    assert (np.abs(computed.shape).argmax(axis=0) == 0).all()


def test_refinement_keeps_weight_and_ends() -> None:
    """Weight of a rope whose tension falls linearly, and its ends."""
    span = string(7)._replace(tension=np.linspace(1e3, 7e3, 7))
    fine = refined(span, 1.0)
    assert len(fine.s) == 301
    assert fine.tension[0] == pytest.approx(500.0 + 1e3 * 0.5 / (L / 7.0), rel=1e-9)
    assert fine.mass @ np.diff(fine.s) == pytest.approx(span.mass @ np.diff(span.s))


def test_the_recursion_equals_scipys_integral() -> None:
    """One mode under lift that does not change: as scipy integrates its equation, any step."""
    shedding = Shedding(
        lift=lambda amplitude: np.full_like(amplitude, 1.0), factor=0.5, zones=dominant_zones
    )
    response = ModalResponse(string(speed=0.2), shedding)
    (mode,) = np.flatnonzero(response.zones.any(axis=0))
    omega, mass = 2.0 * pi * response.frequency[mode], response.modes.mass[mode]
    span = response.span
    force = 0.25 * 1025.0 * 0.02 * 0.04 * np.abs(response.modes.shape[:, mode]) @ span.node_length
    angle = float(response.angle[mode])
    damping = 2.0 * 0.0075 * omega * mass

    def rate(t: float, y: np.ndarray) -> list[float]:
        push = force * np.cos(omega * t + angle)
        return [y[1], (push - damping * y[1]) / mass - omega**2 * y[0]]

    exact = solve_ivp(rate, (0.0, 20.0), [0.0, 0.0], rtol=1e-10, atol=1e-13).y[0, -1]
    for step in (0.04, 4.0):
        again = ModalResponse(string(speed=0.2), shedding)
        for _ in range(round(20.0 / step)):
            again.advance(step)
        assert again.coordinate[mode] == pytest.approx(exact, rel=1e-6)


@pytest.mark.parametrize("damped", [0.89, 0.91, 1.0, 1.0 + 1e-14, 1.001, 3.0, 40.0])
def test_the_recursion_of_strongly_damped_modes(damped: float) -> None:
    """Below, at and beyond critical, from a motion, in any step: as scipy integrates them."""
    omega, mass, angle, force, start = 3.0, 20.0, 0.4, 7.0, (0.3, 0.5)

    def rate(t: float, y: np.ndarray) -> list[float]:
        push = 2.0 * force * np.cos(omega * t + angle) / mass
        return [y[1], push - 2.0 * damped * omega * y[1] - omega**2 * y[0]]

    exact = solve_ivp(rate, (0.0, 2.0), start, "LSODA", rtol=1e-12, atol=1e-14).y[:, -1]
    one = np.ones((1, 1))
    damping = np.array([2.0 * damped * omega * mass])
    drive = Drive(
        np.array([0]),
        np.array([omega]),
        np.array([mass]),
        damping,
        one[0],
        0.0 * one,
        force * one,
        one,
    )
    for steps in (1, 40, 1000):
        position, speed = start
        state = ModalState(np.array([position]), np.array([-speed / omega]), np.array([angle]))
        for _ in range(steps):
            advance_modes(2.0 / steps, np.ones(1), drive, state, np.zeros(1), np.empty((2, 1)))
        computed = [state.place[0], -omega * state.rate[0]]
        assert computed == pytest.approx(exact, rel=1e-8, abs=1e-10)


def test_motion_continues_when_the_current_falls() -> None:
    """The modes of a faster current stay for a minute, and with them its motion."""
    fast, slow = string(speed=0.6), string(speed=0.05)
    response = ModalResponse(fast, Shedding(structural=1e-5))
    response.advance(60.0)
    before, modes = response.motion, len(response.frequency)
    response.follow(slow)
    assert len(response.frequency) == modes
    np.testing.assert_allclose(response.motion, before, atol=1e-9)
    for _ in range(61):
        response.advance(1.0)
        response.follow(slow)
    assert len(response.frequency) < modes / 4


def test_steady_amplitude_by_power_balance() -> None:
    """½·∫½ρdU²C_l(A/d)|φ| ds·ω·a = ½·C·(ω·a)²: the first-harmonic balance of power."""
    response = ModalResponse(string(speed=0.2), Shedding(zones=dominant_zones))
    response.advance(60.0)
    (mode,) = np.flatnonzero(response.zones.any(axis=0))
    omega, mass = 2.0 * pi * response.frequency[mode], response.modes.mass[mode]
    a: float = response.modal_amplitude[mode]
    lift = Lift()(a * np.abs(response.modes.shape[:, mode]) / 0.02)
    fed = 0.5 * 1025.0 * 0.02 * 0.04 * (lift * np.abs(response.modes.shape[:, mode]))
    damping = 2.0 * 0.0075 * omega * mass
    # driven everywhere: only the structure damps
    assert fed @ response.span.node_length == pytest.approx(damping * omega * a, rel=0.02)


def test_excitation_zones_of_competing_modes() -> None:
    """Nearest modes share the rope; the dominant or leading one takes its band; all take theirs."""
    frequency, shedding = np.array([1.0, 2.0]), np.array([0.2, 1.1, 1.4, 2.1, 2.2])
    locked = np.array([[0, 0], [1, 0], [1, 1], [1, 1], [0, 1]], dtype=float)
    moved = np.array([[1.0, 9.0], [1.0, 9.0], [1.0, 0.1], [9.0, 0.2], [9.0, 0.3]])
    near = nearest_zones(frequency, shedding, locked, moved)
    # the third place reaches from 1.25 to 1.75 Hz: half of it is nearer to either
    expected = [[0, 0], [1, 0], [0.5, 0.5], [0, 1], [0, 1]]
    np.testing.assert_allclose(near, expected, atol=1e-12)
    first = dominant_zones(frequency, shedding, locked, moved)
    assert first.tolist() == [[0, 0], [1, 0], [0, 1], [0, 1], [0, 1]]
    # what places between two move of them: the first mode 0.9 + 0.6, the second 0.04 + 0.5
    leading = leading_zones(frequency, shedding, locked, moved)
    assert leading.tolist() == [[0, 0], [1, 0], [1, 0], [1, 0], [0, 1]]
    assert all_zones(frequency, shedding, locked, moved) is locked


def test_venugopal_damping_outside_the_band() -> None:
    """Venugopal's three parts, typed out for one place and mode."""
    water, omega, d = Shedding(), np.array([2.0 * pi]), np.array([0.1])

    def damping(U: float) -> tuple[float, float]:
        speed = np.array([U])
        below, above = water.below_and_above(omega, d, speed)
        c0, c2 = water.damping(omega, d, speed, below, above)
        return float(c0[0, 0]), float(c2[0, 0])

    still = 0.5 * pi * 1025.0 * 2.0 * pi * 0.01 * 2.0 * 2.0**0.5 / (2.0 * pi * 0.01 / 1.3e-6) ** 0.5
    growing = 0.5 * pi * 1025.0 * 2.0 * pi * 0.01 * 0.25
    assert damping(0.1) == pytest.approx((still + 0.18 * 1025.0 * 0.1 * 0.1, growing))
    assert damping(1.0) == pytest.approx((0.2 * 1025.0 / (2.0 * pi), 0.0))
    assert damping(0.6) == (0.0, 0.0)


def test_no_modal_response_in_still_water() -> None:
    response = ModalResponse(string(), Shedding())
    response.advance(10.0)
    assert response.time_s == 10.0
    assert not response.motion.any()


def test_mode_update_keeps_position_and_velocity() -> None:
    """Modes found again: same place, same velocity; other tension: same place at that instant."""
    response = ModalResponse(string(speed=0.2), Shedding())
    response.advance(30.0)
    before, amplitude = response.motion, response.amplitude
    response.follow(string(speed=0.2))
    np.testing.assert_allclose(response.motion, before, atol=1e-9)
    np.testing.assert_allclose(response.amplitude, amplitude, atol=1e-9)
    tighter = string(speed=0.2)
    response.follow(tighter._replace(tension=1.1 * tighter.tension))
    assert response.motion @ before / (before @ before) == pytest.approx(1.0, abs=0.02)
    response.advance(30.0)
    assert response.amplitude.max() > 0.5


def test_lift_vanishes_at_one_diameter() -> None:
    """Lift vanishes at one diameter and takes power beyond."""
    lift = Lift()
    np.testing.assert_allclose(lift(np.array([0.0, 0.5, 1.0])), [0.3, 0.7, 0.0], atol=1e-12)
    assert lift(np.array([1.2]))[0] < 0.0
    wild = replace(Shedding(), structural=0.0)
    response = ModalResponse(string(speed=0.2), wild)
    response.advance(60.0)
    assert 0.9 < response.amplitude.max() < 1.5


def test_modes_of_a_slack_rope_are_rejected() -> None:
    slack = string()._replace(tension=np.full(200, 0.0))
    with pytest.raises(InputError, match="200 of 200 elements are slack"):
        ModeSearch(slack, 1.0).found()
    with pytest.raises(InputError, match="modes lie below"):
        ModeSearch(string(), 1e4).found()
