"""Vibration of a rope in its natural modes ([LCD] eqs 1 to 9: Le Cunff and Durand 1999).

y(s, t) = Σ φ_i(s)·η_i(t), M_i·η̈_i + C_i·η̇_i + ω_i²·M_i·η_i = F_i(t): each mode is driven at its
own frequency by ½·ρ·d·U²·C_l(A/d)·|φ_i| over the places that drive it, and damped by the structure
and, elsewhere, by the water. A place drives one mode: among those that lock in there the one that
moves most (shedding.leading_zones). η_i is a convolution of F_i with e^(-ζω·t)·sin(ω_d·t), taken
recursively (eq 9): with λ = -ζω + i·ω_d and c(t) = ∫ F(τ)·e^(λ(t-τ)) dτ,

    c(t + h) = e^(λh)·c(t) + ∫_t^(t+h) F(τ)·e^(λ(t+h-τ)) dτ,    η = Im c/(M·ω_d),

the integral in closed form for a harmonic force: no error of the step but in amplitude, which feeds
lift and damping of the next step. Kept between steps are η and η̇, Re c = M·(η̇ + ζω·η), so that
neither jumps where the damping changes. √(η² + (η̇/ω)²) is the amplitude of a mode; that of a place
is the root of the sum of their squares.
"""

from __future__ import annotations

from math import pi
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rope_twin.viv.lateral_modes import LateralModes, ModeSearch, find_lateral_modes
from rope_twin.viv.shedding import Shedding
from rope_twin.viv.span import Floats, Span, refined

PER_WAVE = 24  # elements per wave at the highest Strouhal frequency: right there to 0.3 %
PER_PERIOD = 6  # steps per period of that frequency
STILL = 1e-6  # d: a mode that is not driven and moves less is left out until it is driven
MOST_DAMPED = 0.95  # of critical: a mode damped more does not ring
GOLDEN = pi * (3.0 - 5.0**0.5)  # rad; times the square of its number a mode's phase at the start:
# in proportion to the number itself, all modes would come together in one pulse
LEAST = 1e-200  # N/m: what stays finite of a mode that nothing damps
MOST_ELEMENTS = 6000
PART = 12  # modes that are looked for at a time beside a running twin


class _Drive(NamedTuple):
    """What water speed and modes make of lift and damping; (places, active) or (active,)."""

    active: NDArray[np.int64]  # modes that are driven or still move
    force: Floats  # ½·ρ·d·U²·|φ| times length where a mode is driven [N]
    damping: Floats  # modal, at rest [N·s/m]
    growing: Floats  # of damping with (A/d)²
    square: Floats  # φ²
    zones: NDArray[np.bool_]  # (places, modes)


class KeptResponse(NamedTuple):
    """What a response goes on from, to the bit."""

    given: Span
    coordinate: Floats  # η [m] of the modes
    rate: Floats  # -η̇/ω [m]
    angle: Floats
    active: NDArray[np.int64]
    time_s: float


class ModalResponse:
    """A rope that vibrates in its modes, from rest.

    Raises:
        InputError: the rope is slack somewhere.
    """

    given: Span  # as it was given
    span: Span  # finer
    modes: LateralModes
    step_s: float  # longest step: the amplitude is taken anew so often

    def __init__(self, span: Span, shedding: Shedding) -> None:
        self.shedding = shedding
        self.time_s = 0.0
        self._take(span)
        self._phasor = np.zeros(len(self.modes.frequency), complex)  # η - i·η̇/ω [m]
        self._angle = _first_angles(len(self.modes.frequency))
        self._drive = self._driven()
        self.amplitude = np.zeros(len(self.span.s))  # of the places [d]

    @property
    def frequency(self) -> Floats:
        """Of the modes that the current may drive [Hz]."""
        return self.modes.frequency

    @property
    def zones(self) -> NDArray[np.bool_]:
        """Where each mode is driven, (places, modes)."""
        return self._drive.zones

    @property
    def coordinate(self) -> Floats:
        """Of each mode, η [m]."""
        return self._phasor.real

    @property
    def modal_amplitude(self) -> Floats:
        """Of each mode [m]."""
        return np.abs(self._phasor)

    @property
    def motion(self) -> Floats:
        """Across the rope at the places [m]."""
        return self.modes.shape @ self.coordinate

    @property
    def dominant_hz(self) -> Floats:
        """Frequency of the mode that moves each place most; 0 where none does."""
        if not len(self.frequency):
            return np.zeros(len(self.span.s))
        share = np.abs(self.modes.shape) * self.modal_amplitude
        return np.where(share.max(axis=1) > 0.0, self.frequency[share.argmax(axis=1)], 0.0)

    def follow_speed(self, speed: Floats) -> None:
        """Another water speed at the places [m/s]; the modes stay."""
        self.span = self.span._replace(speed=speed)
        self._drive = self._driven()

    def search(self, span: Span) -> ModeSearch:
        """For the modes of a rope that has changed, to be followed when it is through.

        Raises:
            InputError: it is slack somewhere.
        """
        fine, highest = self._refined(span)
        return ModeSearch(fine, highest, PART)

    def follow(self, span: Span, search: ModeSearch | None = None) -> None:
        """The rope has changed: other tension, length or current. Motion goes on as it is.

        The motion, with its velocity as the imaginary part, is projected on the new modes.
        `search`: where they were looked for before.

        Raises:
            InputError: it is slack somewhere; the old modes are kept.
        """
        before, s = self.modes.shape @ self._phasor, self.span.s
        angle = self._angle
        self._take(span, search)
        new = self.span.s
        from_top = new[-1] - new
        moved = np.interp(from_top, (s[-1] - s)[::-1], before[::-1].real) + 1j * np.interp(
            from_top, (s[-1] - s)[::-1], before[::-1].imag
        )
        self._phasor = (self.modes.shape.T * self.span.node_mass) @ moved / self.modes.mass
        known = min(len(angle), len(self._phasor))
        self._angle = _first_angles(len(self._phasor))
        self._angle[:known] = angle[:known]
        self._drive = self._driven()
        self.amplitude = self._amplitude()

    def advance(self, duration_s: float) -> None:
        """Go on by a time, in steps of at most `step_s`."""
        if not len(self.frequency):
            self.time_s += duration_s
            return
        steps = max(1, int(np.ceil(duration_s / self.step_s - 1e-9)))
        for _ in range(steps):
            self._advance(duration_s / steps)
        self.time_s += duration_s

    def kept(self) -> KeptResponse:
        """From which `take_back` goes on."""
        phasor = self._phasor
        return KeptResponse(
            self.given, phasor.real.copy(), phasor.imag.copy(), self._angle.copy(),
            self._drive.active.copy(), self.time_s,
        )  # fmt: skip

    def take_back(self, kept: KeptResponse) -> None:
        """Go on from there; its modes were those of a search."""
        self._take(kept.given, self.search(kept.given))
        self._phasor = kept.coordinate + 1j * kept.rate
        self._angle, self.time_s = kept.angle.copy(), kept.time_s
        self._drive = self._driven(kept.active)
        self.amplitude = self._amplitude()

    def _refined(self, span: Span) -> tuple[Span, float]:
        """In elements that are short enough, and the highest frequency that it can lock [Hz]."""
        fastest = float((span.speed / span.diameter).max())
        shedding, highest = self.shedding.strouhal * fastest, fastest / self.shedding.band[0]
        wave_speed = float(np.sqrt((span.tension / span.mass).min()))
        length = float(span.s[-1] - span.s[0])
        longest = max(wave_speed / max(shedding, 1e-9) / PER_WAVE, length / MOST_ELEMENTS)
        return refined(span, longest), highest

    def _take(self, span: Span, search: ModeSearch | None = None) -> None:
        """Modes up to the highest that the current can lock."""
        fine, highest = self._refined(span)
        modes = find_lateral_modes(fine, highest) if search is None else search.found()
        self.given, self.span, self.modes = span, fine, modes
        self._omega = 2.0 * pi * modes.frequency
        shedding = self.shedding.strouhal * float((span.speed / span.diameter).max())
        self.step_s = 1.0 / (PER_PERIOD * shedding) if shedding > 0.0 else np.inf

    def _driven(self, active: NDArray[np.int64] | None = None) -> _Drive:
        """`active`: modes that were driven or moved; None: those that do now."""
        span, modes, water = self.span, self.modes, self.shedding
        locked = water.locked(self._omega, span.diameter, span.speed)
        strouhal = water.strouhal * span.speed / span.diameter
        c0, c2 = water.damping(self._omega, span.diameter, span.speed)
        square = modes.shape**2
        weight = square * span.node_length[:, None]
        own = 2.0 * water.structural * self._omega * modes.mass
        damping = (c0 * weight).sum(axis=0) + own
        lift = 0.5 * water.density * span.diameter * span.speed**2 * span.node_length
        force = lift[:, None] * np.abs(modes.shape)
        moved = force / np.maximum(damping * self._omega, LEAST)
        zones = water.zones(modes.frequency, strouhal, locked, moved)
        moving = self.modal_amplitude > STILL * float(span.diameter.min())
        if active is None:
            active = np.flatnonzero(zones.any(axis=0) | moving)
        return _Drive(
            active=active,
            force=(force * zones)[:, active],
            damping=damping[active],
            growing=(c2 * weight)[:, active],
            square=square[:, active],
            zones=zones,
        )

    def _amplitude(self) -> Floats:
        squares = self.modal_amplitude[self._drive.active] ** 2
        return np.asarray(np.sqrt(self._drive.square @ squares) / self.span.diameter)

    def _advance(self, h: float) -> None:
        drive, some = self._drive, self._drive.active
        omega, angle, phasor = self._omega[some], self._angle[some], self._phasor[some]
        mass = self.modes.mass[some]
        damping = drive.damping + (self.amplitude**2) @ drive.growing
        share = np.minimum(damping / (2.0 * mass * omega), MOST_DAMPED)
        ring = np.sqrt(1.0 - share * share)
        rate = omega * (-share + 1j * ring)
        force = 0.5 * (self.shedding.lift(self.amplitude) @ drive.force) / mass
        turn = np.exp(1j * angle)
        kept, ahead = np.exp(rate * h), np.exp(1j * omega * h)
        pushed = turn * _quotient(ahead - kept, 1j * omega - rate, h)
        pushed += np.conj(turn) * (np.conj(ahead) - kept) / (-1j * omega - rate)
        start = omega * (share * phasor.real - phasor.imag) + 1j * omega * ring * phasor.real
        c = kept * start + force * pushed  # of a unit mass
        place = c.imag / (omega * ring)
        self._phasor[some] = place - 1j * (c.real / omega - share * place)
        self._angle[some] = np.remainder(angle + omega * h, 2.0 * pi)
        self.amplitude = self._amplitude()


def _first_angles(count: int) -> Floats:
    return np.asarray(np.remainder(GOLDEN * np.arange(count, dtype=float) ** 2, 2.0 * pi))


def _quotient(
    rise: NDArray[np.complex128], rate: NDArray[np.complex128], h: float
) -> NDArray[np.complex128]:
    """(e^(iωh) - e^(λh))/(iω - λ), which without any damping is h."""
    small = np.abs(rate) * h < 1e-9
    return np.where(small, h, rise / np.where(small, 1.0, rate))
