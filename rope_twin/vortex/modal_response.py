"""Response of a rope in its natural modes ([LCD] eqs 1 to 9: Le Cunff and Durand 1999).

y(s, t) = Σ φ_i(s)·η_i(t), M_i·η̈_i + C_i·η̇_i + ω_i²·M_i·η_i = F_i(t): each mode is excited at its
own frequency by ½·ρ·d·U²·C_c·C_l(A/d)·|φ_i| over its power-in zone, and damped by the structure and
elsewhere, by the water. A place excites one mode of those locked in there: the nearest to its
Strouhal frequency, as the paper prints, or the one with the largest response (shedding.py). η_i is
a convolution of F_i with e^(-ζω·t)·sin(ω_d·t), evaluated recursively (eq 9): with λ = -ζω + i·ω_d
and c(t) = ∫ F(τ)·e^(λ(t-τ)) dτ,

    c(t + h) = e^(λh)·c(t) + ∫_t^(t+h) F(τ)·e^(λ(t+h-τ)) dτ,    η = Im c/(M·ω_d),

the integral in closed form for a harmonic force: the only time-stepping error is in the amplitude,
which determines lift and damping of the next step. The state between steps is η and η̇, Re c =
M·(η̇ + ζω·η), so that neither jumps where the damping changes. √((1 - ζ²)·η² + (η̇/ω)²) is the
amplitude of a mode, from critical damping on |η̇|/ω alone: there η creeps back for minutes without
an oscillation. That of a place is the root of the sum of their squares. Strongly damped modes (eqs
7 and 8 beyond critical) are evaluated as forced plus free motion, whose sum is the same.

Eqs 2 to 4 let every mode answer to the forces at the frequencies of all others too; here a mode
answers to its own frequency alone, in which it is at resonance.

The modes reach up to the highest frequency that a current of the last minute could lock in: the
motion of a changed rope is projected on them, and what lies beyond them would be lost.
"""

from __future__ import annotations

from math import cos, exp, pi, sin, sqrt
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rope_twin.core.jit.decorators import jit, jit_entry
from rope_twin.core.state import Floats
from rope_twin.vortex.line_model import EVEN, RecentSpeeds, Span, half_waves, refined
from rope_twin.vortex.modes import MAX_MODES, LateralModes, ModeSearch
from rope_twin.vortex.shedding import Shedding

PER_WAVE = 24  # elements per wave length at the highest Strouhal frequency: 0.3 % error there
PER_PERIOD = 6  # steps per period of that frequency
AMPLITUDE_MIN = 1e-6  # d: a mode without excitation and with less amplitude is inactive
GOLDEN = pi * (3.0 - 5.0**0.5)  # rad; initial phase of a mode over the square of its number
# (proportional to the number itself, all modes would add up to one pulse)
DAMPING_MIN = 1e-200  # N/m: keeps the response of an undamped mode finite
MAX_ELEMENTS = 6000
TOGETHER = 128  # places processed at a time, so that intermediates stay in the cache
PART = 12  # modes computed per call alongside a running twin


class KeptResponse(NamedTuple):
    """Restart data of a response; a restart is bit-identical."""

    given: Span
    coordinate: Floats  # η [m] of the modes
    rate: Floats  # -η̇/ω [m]
    angle: Floats
    active: NDArray[np.int64]
    time_s: float
    elements: int
    fastest: float  # U/d that the modes are made for [1/s]
    recent: Floats  # as of RecentSpeeds


class ModalResponse:
    """Modal VIV response of a rope, starting without motion.

    Raises:
        InputError: the rope is slack somewhere.
    """

    given: Span  # input
    span: Span  # refined mesh
    modes: LateralModes
    step_s: float  # longest step: interval at which the amplitude is updated

    def __init__(self, span: Span, shedding: Shedding) -> None:
        self.shedding = shedding
        self.time_s = 0.0
        self._elements = 0
        self._recent = RecentSpeeds()
        self._take(span)
        displacement, rate = np.zeros((2, len(self.modes.frequency)))
        self._ringing = ModalState(displacement, rate, _first_angles(len(displacement)))
        self._drive, self.zones = self._driven()  # zones: fraction excited, (places, modes)
        self.amplitude = np.zeros(len(self.span.s))  # A/d of the places

    @property
    def frequency(self) -> Floats:
        """Return the frequencies of the modes that the current may excite [Hz]."""
        return self.modes.frequency

    @property
    def coordinate(self) -> Floats:
        """Return the coordinate η of each mode [m]."""
        return self._ringing.place

    @property
    def angle(self) -> Floats:
        """Return the phase of the force on each mode [rad]."""
        return self._ringing.angle

    @property
    def modal_amplitude(self) -> Floats:
        """Return the amplitude of each mode [m]; 0 for overdamped creep."""
        return np.hypot(self._swing * self._ringing.place, self._ringing.rate)

    @property
    def motion(self) -> Floats:
        """Return the cross-flow displacement of the places [m]."""
        return self.modes.shape @ self.coordinate

    @property
    def dominant_hz(self) -> Floats:
        """Return the frequency of the strongest mode at each place; 0 without one."""
        if not len(self.frequency):
            return np.zeros(len(self.span.s))
        response = np.abs(self.modes.shape) * self.modal_amplitude
        return np.where(response.max(axis=1) > 0.0, self.frequency[response.argmax(axis=1)], 0.0)

    def follow_speed(self, speed: Floats) -> None:
        """Set another water speed at the places [m/s]; the modes are kept."""
        self.span = self.span._replace(speed=speed)
        self._drive, self.zones = self._driven()

    def search(self, span: Span) -> ModeSearch:
        """Return an incremental modal analysis of a changed rope, to be passed to `follow`.

        Raises:
            InputError: it is slack somewhere.
        """
        return self._search(span, self._recent.fastest(span))

    def follow(self, span: Span, search: ModeSearch | None = None) -> None:
        """Update to a changed rope (tension, length or current); the motion continues.

        The motion, with its velocity as the imaginary part, is projected on the new modes.
        `search`: result of an incremental analysis.

        Raises:
            InputError: it is slack somewhere; the old modes are kept.
        """
        ringing = np.stack(self._ringing[:2])
        before, s = np.einsum("nk,jk->jn", self.modes.shape, ringing), self.span.s
        angle = self._ringing.angle
        self._take(span, search)
        s_new = self.span.s
        displacement, rate = (np.interp(s_new - s_new[-1], s - s[-1], values) for values in before)
        momentum = np.stack([displacement, rate]) * self.span.node_mass
        momentum = np.einsum("nk,jn->jk", self.modes.shape, momentum) / self.modes.mass
        shared = min(len(angle), momentum.shape[1])
        angles = _first_angles(momentum.shape[1])
        angles[:shared] = angle[:shared]
        self._ringing = ModalState(momentum[0], momentum[1], angles)
        self._drive, self.zones = self._driven()
        self.amplitude = self._amplitude()

    def advance(self, duration_s: float) -> None:
        """Advance by a duration, in steps of at most `step_s`."""
        steps = max(1, int(np.ceil(duration_s / self.step_s - 1e-9)))
        for _ in range(steps):
            self._advance(duration_s / steps)
        self.time_s += duration_s

    def kept(self) -> KeptResponse:
        """Return the restart data for `take_back`."""
        displacement, rate, angle = (values.copy() for values in self._ringing)
        return KeptResponse(
            self.given, displacement, rate, angle, self._drive.active.copy(), self.time_s,
            self._elements, self._fastest, self._recent.kept(),
        )  # fmt: skip

    def take_back(self, saved: KeptResponse) -> None:
        """Restore a response from its restart data; its modes were those of a search."""
        self._elements = saved.elements
        self._take(saved.given, self._search(saved.given, saved.fastest))
        self._recent.take_back(saved.recent)
        state = (saved.coordinate, saved.rate, saved.angle)
        self._ringing, self.time_s = ModalState(*(values.copy() for values in state)), saved.time_s
        self._drive, self.zones = self._driven(saved.active)
        self.amplitude = self._amplitude()

    def _search(self, span: Span, fastest: float, part: int = PART) -> ModeSearch:
        """Start the search for the modes that lock in at U/d up to `fastest` [1/s].

        The mesh resolves their waves.
        """
        shedding, highest = self.shedding.strouhal * fastest, fastest / self.shedding.band[0]
        wave_speed = float(np.sqrt((span.tension / span.mass).min()))
        length = float(span.s[-1] - span.s[0])
        longest = max(wave_speed / max(shedding, 1e-9) / PER_WAVE, length / MAX_ELEMENTS)
        return ModeSearch(refined(span, longest, EVEN, self._elements), highest, part)

    def _take(self, span: Span, search: ModeSearch | None = None) -> None:
        """Compute the modes up to the highest that the current of the last minute can lock in."""
        if search is None:
            search = self._search(span, self._recent.fastest(span), MAX_MODES)
        fine, modes = search.span, search.found()
        self._fastest = search.max_hz * self.shedding.band[0]
        self._recent.add(self.time_s, span)
        self.given, self.span, self.modes = span, fine, modes
        self._elements = len(fine.tension)
        self.half_wave = half_waves(fine, self.shedding.strouhal)
        self._omega = 2.0 * pi * modes.frequency
        shedding = self.shedding.strouhal * self._fastest
        self.step_s = 1.0 / (PER_PERIOD * shedding) if shedding > 0.0 else np.inf

    def _driven(self, active: NDArray[np.int64] | None = None) -> tuple[Drive, Floats]:
        """Return lift and damping coefficients of the modes, and the zones where each is excited.

        `active`: modes that were excited or moved; None: those that are now.
        """
        span, modes, water = self.span, self.modes, self.shedding
        below, above = water.below_and_above(self._omega, span.diameter, span.speed)
        locked = 1.0 - below - above
        damping = 2.0 * water.structural * self._omega * modes.mass
        growing = np.empty_like(modes.shape)
        for first in range(0, len(locked), TOGETHER):
            at = slice(first, first + TOGETHER)
            c0, c2 = water.damping(
                self._omega, span.diameter[at], span.speed[at], below[at], above[at]
            )
            square = span.node_length[at, None] * modes.shape[at] ** 2
            damping += (c0 * square).sum(axis=0)
            growing[at] = c2 * square
        lift = 0.5 * water.density * span.diameter * span.speed**2 * span.node_length
        moved = np.abs(modes.shape)
        moved *= lift[:, None]
        moved /= np.maximum(damping * self._omega, DAMPING_MIN)
        strouhal = water.strouhal * span.speed / span.diameter
        zones = water.zones(modes.frequency, strouhal, locked, moved)
        self._swing = np.sqrt(
            np.maximum(1.0 - (0.5 * damping / (modes.mass * self._omega)) ** 2, 0.0)
        )
        moving = np.hypot(*self._ringing[:2]) > AMPLITUDE_MIN * float(span.diameter.min())
        if active is None:
            active = np.flatnonzero((zones > 0.0).any(axis=0) | moving)
        shape = modes.shape[:, active]
        drive = Drive(
            active=active,
            omega=self._omega[active],
            mass=modes.mass[active],
            damping=damping[active],
            swing=self._swing[active],
            growing=np.ascontiguousarray(growing[:, active]),
            force=np.ascontiguousarray(0.5 * lift[:, None] * np.abs(shape) * zones[:, active]),
            square=np.ascontiguousarray((shape / span.diameter[:, None]).T ** 2),
        )
        return drive, zones

    def _amplitude(self) -> Floats:
        amplitude = np.zeros(len(self.span.s))
        sum_amplitudes(self._drive, self._ringing, amplitude)
        return amplitude

    def _advance(self, h: float) -> None:
        lift = self.shedding.factor * self.shedding.lift(self.amplitude)
        self.amplitude = self.amplitude.copy()
        work = np.empty((2, len(self._drive.active)))
        advance_modes(h, lift, self._drive, self._ringing, self.amplitude, work)


def _first_angles(count: int) -> Floats:
    return np.asarray(np.remainder(GOLDEN * np.arange(count, dtype=float) ** 2, 2.0 * pi))


LIGHTLY = 0.9  # of critical: up to there the closed form of eq 9 divides by nothing small
EQUAL_ROOTS = 1e-6  # of a step: roots closer than this are one double root


class Drive(NamedTuple):
    """Lift and damping coefficients of active modes; places p, modes k."""

    active: NDArray[Any]  # their indices among all modes, (k,)
    omega: Floats  # [rad/s], (k,)
    mass: Floats  # modal [kg], (k,)
    damping: Floats  # modal, at zero amplitude [N·s/m], (k,)
    swing: Floats  # damped over undamped frequency, 0 from critical damping on, (k,)
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
    share = work[0, k] / (2.0 * mass * omega)
    ringing.angle[which] = (angle + omega * h) % (2.0 * pi)
    if share > LIGHTLY:
        _creep(h, omega, share, work[1, k] / mass, angle, ringing, which)
        return
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


@jit
def _creep(
    h: float, omega: float, share: float, force: float, angle: float, ringing: Any, which: int
) -> None:
    """Advance a strongly damped mode: forced motion sin θ/(2ζω²)·F/M plus free motion.

    force: half of F/M, as everywhere here.
    """
    size = force / (share * omega * omega)
    place = ringing.place[which] - size * sin(angle)
    speed = -omega * ringing.rate[which] - size * omega * cos(angle)
    fallen, lasting, grown = _free(h, omega, share)
    pull = speed + share * omega * place
    ahead = angle + omega * h
    ringing.place[which] = size * sin(ahead) + lasting * place + grown * pull
    change = fallen * place + lasting * pull - share * omega * (lasting * place + grown * pull)
    ringing.rate[which] = -size * cos(ahead) - change / omega


@jit
def _free(h: float, omega: float, share: float) -> tuple[float, float, float]:
    """Return e^(-ζωh) times r·sinh(rh), cosh(rh) and sinh(rh)/r, r² = ω²(ζ² - 1)."""
    square = share * share - 1.0
    root = sqrt(abs(square)) * omega
    kept = exp(-share * omega * h)
    if root * h < EQUAL_ROOTS:
        return kept * square * omega * omega * h, kept, kept * h
    if square < 0.0:
        wave = kept * sin(root * h)
        return -root * wave, kept * cos(root * h), wave / root
    slow = exp((root - share * omega) * h)  # separately, as their factors alone may overflow
    fast = exp(-(root + share * omega) * h)
    odd = 0.5 * (slow - fast)
    return root * odd, 0.5 * (slow + fast), odd / root


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
        size = (drive.swing[k] * ringing.place[which]) ** 2 + ringing.rate[which] ** 2
        for p in range(amplitude.shape[0]):
            amplitude[p] += drive.square[k, p] * size
    for p in range(amplitude.shape[0]):
        amplitude[p] = sqrt(amplitude[p])
