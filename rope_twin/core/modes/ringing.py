"""One step of modal oscillators, each driven at its own frequency ([LCD] eq 9).

Le Cunff and Durand (1999); the model and its derivation are described in
rope_twin.viv.modal_response.
"""

from __future__ import annotations

from math import cos, exp, pi, sin, sqrt
from typing import Any, NamedTuple

from numpy.typing import NDArray

from rope_twin.core.jit.decorators import jit, jit_entry
from rope_twin.core.state import Floats

MOST_DAMPED = 0.95  # of critical: modes with higher damping are inactive


class Drive(NamedTuple):
    """Lift and damping coefficients of active modes; places p, modes k."""

    active: NDArray[Any]  # their indices among all modes, (k,)
    omega: Floats  # [rad/s], (k,)
    mass: Floats  # modal [kg], (k,)
    damping: Floats  # modal, at zero amplitude [N·s/m], (k,)
    growing: Floats  # coefficient of damping with (A/d)², (p, k)
    force: Floats  # half of ½·ρ·d·U²·|φ| times length where a mode is excited [N], (p, k)
    square: Floats  # (φ/d)² [1/m²], (k, p)


class ModalState(NamedTuple):
    """State of all modes."""

    place: Floats  # η [m]
    rate: Floats  # -η̇/ω [m]
    angle: Floats  # of the force [rad]


@jit_entry
def advance_modes(h: float, lift: Any, drive: Any, ringing: Any, amplitude: Any, work: Any) -> None:
    """Advance the active modes by h seconds.

    lift: C_l at the places; amplitude: A/d there, before and then after the step; work: scratch,
    (2, k).
    """
    _sum_up(lift, drive, amplitude, work)
    for k in range(drive.active.shape[0]):
        _ring_one(h, drive, ringing, work, k)
    _add_up(drive, ringing, amplitude)


@jit_entry
def sum_amplitudes(drive: Any, ringing: Any, amplitude: Any) -> None:
    """Set A/d at the places to the root of the sum of squares over the modes."""
    _add_up(drive, ringing, amplitude)


@jit
def _sum_up(lift: Any, drive: Any, amplitude: Any, work: Any) -> None:
    """Sum damping and force of each mode over all places."""
    modes = drive.active.shape[0]
    for k in range(modes):
        work[0, k], work[1, k] = drive.damping[k], 0.0
    for p in range(lift.shape[0]):
        square, push = amplitude[p] * amplitude[p], lift[p]
        for k in range(modes):
            work[0, k] += square * drive.growing[p, k]
            work[1, k] += push * drive.force[p, k]


@jit
def _ring_one(h: float, drive: Any, ringing: Any, work: Any, k: int) -> None:
    """Advance c(t + h) of mode k, of unit modal mass, in closed form; then η and η̇ of it."""
    which, omega, mass = drive.active[k], drive.omega[k], drive.mass[k]
    angle, before = ringing.angle[which], ringing.place[which]
    share = min(work[0, k] / (2.0 * mass * omega), MOST_DAMPED)
    damped = omega * sqrt(1.0 - share * share)
    rate = complex(-share * omega, damped)
    turn, ahead = complex(cos(angle), sin(angle)), complex(cos(omega * h), sin(omega * h))
    kept = exp(-share * omega * h) * complex(cos(damped * h), sin(damped * h))
    pushed = turn * _quotient(ahead - kept, 1j * omega - rate, h)
    pushed += turn.conjugate() * (ahead.conjugate() - kept) / (-1j * omega - rate)
    start = complex(omega * (share * before - ringing.rate[which]), damped * before)
    c = kept * start + work[1, k] / mass * pushed
    place = c.imag / damped
    ringing.place[which] = place
    ringing.rate[which] = share * place - c.real / omega
    ringing.angle[which] = (angle + omega * h) % (2.0 * pi)


@jit
def _quotient(rise: Any, rate: Any, h: float) -> Any:
    """Return (e^(iωh) - e^(λh))/(iω - λ), whose limit without damping is h."""
    if abs(rate.real) + abs(rate.imag) < 1e-9 / h:
        return complex(h, 0.0)
    return rise / rate


@jit
def _add_up(drive: Any, ringing: Any, amplitude: Any) -> None:
    for p in range(amplitude.shape[0]):
        amplitude[p] = 0.0
    for k in range(drive.active.shape[0]):
        which = drive.active[k]
        size = ringing.place[which] ** 2 + ringing.rate[which] ** 2
        for p in range(amplitude.shape[0]):
            amplitude[p] += drive.square[k, p] * size
    for p in range(amplitude.shape[0]):
        amplitude[p] = sqrt(amplitude[p])
