"""Power-in analysis of the force-decomposition model, with constant or variable added mass.

[GE] Ge, Added mass effect on VIV for flexible risers, 2018; [SJTU] thesis on ultra-slender flexible
structures, ch. 5. For each mode the power Π_r = |Q_r|²/(2·R_r): Q_r the lift ½·C_Lv·ρ·D·U² over its
power-in band, weighted by |φ_r|, R_r the damping outside, c = -½·C_Lv·ρ·D·U²/(A·ω) where C_Lv < 0,
plus the structural 2·m·ω·ζ. The strongest mode takes its band, the next the remainder; modes of
equal power share. By [GE]'s text (`lock_in` nearest) each place has the mode nearest to 0.17·U/D
instead; it gives the printed modes of the sheared flows and less than half of the printed
amplitudes (docs/validation.md, G1). With variable added mass f = f_1·√(M_1/(M + Σ C_a·ρ·A·φ²)), by
fixed-point iteration with the mean of two successive C_a; f_1 and M_1 are those at C_a = 1.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from typing import NamedTuple

import numpy as np

from rope_twin.core.state import Floats
from rope_twin.vortex.force_table import ForceTable, fitted_forces, solve_added_mass
from rope_twin.vortex.line_model import EVEN, RecentSpeeds, Span, refined
from rope_twin.vortex.modes import MAX_MODES, LateralModes, ModeSearch
from rope_twin.vortex.shedding import nearest_zones, parts_below, share_out

PER_WAVE = 24  # elements per wave length at the highest frequency that can be excited
MAX_ELEMENTS = 6000
ROUNDS = 60
ADDED_MASS_TOL = 1e-6  # convergence of C_a between two rounds
CENTRE = 0.17  # f·D/U of the largest power-in ([GE])
TIE = 0.03  # relative difference of power below which modes share a place
POWER_MIN = 0.03  # of the largest power: a mode below is not expected to be excited soon
SPEED_MIN = 1e-6  # m/s: minimum water speed


@dataclass(frozen=True)
class Decomposed:
    """Parameters of the force-decomposition model, apart from the rope."""

    table: ForceTable
    varying: bool = True  # False: constant added mass coefficient, as below
    fixed_added_mass: float = 1.0
    band: tuple[float, float] = (0.125, 0.2)  # range of f·D/U of power-in (lock-in)
    density: float = 1025.0  # [kg/m³]
    structural: float = 0.015  # damping ratio; not given in [GE]: as in the modal model
    first_amplitude: float = 0.5  # [D], amplitude at which the powers are evaluated
    candidate: float = 0.1  # of the largest power: modes below are excluded
    centre: float = CENTRE  # f·D/U, the frequency that `nearest` compares modes with
    lock_in: str = "strongest"  # or "nearest": the mode that a place excites


def decomposed(varying: bool = True, structural: float = 0.015) -> Decomposed:
    """Return the parameters with the force table of the package."""
    return Decomposed(fitted_forces(), varying, structural=structural)


@dataclass(frozen=True)
class Excitation:
    """Modes and their excitation by the current; (modes,) or (nodes, modes)."""

    modes: LateralModes  # at constant added mass
    frequency: Floats  # natural frequency with the actual added mass [Hz]
    added_mass: Floats  # mean coefficient of each mode, weighted by φ²
    power: Floats  # Π_r [W]
    zones: Floats  # fraction of a node that excites a mode

    @property
    def dominant(self) -> int:
        """Return the number of the mode with the largest power, from 1; 0 where none has any."""
        return int(self.power.argmax()) + 1 if self.power.any() else 0

    @property
    def driven(self) -> Floats:
        """Return the mean excitation frequency of each node [Hz], (nodes,); 0: there is none."""
        total = self.zones.sum(axis=1)
        mean = (self.zones * self.frequency).sum(axis=1) / np.where(total > 0.0, total, 1.0)
        return np.asarray(mean)


def displaced(span: Span, density: float) -> Floats:
    """Return the mass of water displaced at the nodes [kg]."""
    return density * 0.25 * pi * span.diameter**2 * span.node_length


class ExcitationSearch:
    """Incremental power-in analysis: a few modes per call, for use in a real-time run.

    For one group of modes after the other: their shapes, then natural frequencies and powers.
    span.mass is without added mass.

    Raises:
        InputError: the rope is slack somewhere.
    """

    def __init__(
        self,
        span: Span,
        model: Decomposed,
        part: int = MAX_MODES,
        near_hz: tuple[float, float] | None = None,
    ) -> None:
        """Set up the search; `part`: approximate number of modes per call.

        near_hz: range of mode frequencies at constant added mass; slower modes are assumed to have
        no power, and faster ones are not computed.
        """
        self.span, self._model, self._part = span, model, part
        self._slowest, fastest_hz = near_hz or (0.0, np.inf)
        per_metre = 0.5 * (_per_metre(span, model)[1:] + _per_metre(span, model)[:-1])
        moved = span._replace(mass=span.mass + model.fixed_added_mass * per_metre)
        fastest = float((span.speed / span.diameter).max())
        highest = min(1.5 * model.band[1] * fastest, fastest_hz)
        self._search = ModeSearch(moved, highest, part)
        self._expected = self._search.left  # expected number of groups
        self._modes: LateralModes | None = None
        self._parts: list[_Part] = []

    @property
    def left(self) -> int:
        """Return the number of remaining calls."""
        if self._modes is None:
            return self._search.left + 1 + self._expected
        return -(-len(self._modes.frequency) // self._part) - len(self._parts)

    def go_on(self) -> None:
        """Compute the next group, if any is left."""
        if self._search.left:
            self._search.go_on()
        elif self._modes is None:
            self._modes = self._search.found()
        elif self.left:
            first = self._part * len(self._parts)
            which = slice(first, first + self._part)
            shape = np.ascontiguousarray(self._modes.shape[:, which])
            group = LateralModes(self._modes.frequency[which], shape, self._modes.mass[which])
            if float(group.frequency[-1]) >= self._slowest:
                self._parts.append(_excited(self.span, self._model, group))
                return
            added = np.full(len(group.mass), self._model.fixed_added_mass)
            idle = np.zeros(len(added)), np.zeros_like(shape)
            self._parts.append(_Part(group.frequency, added, *idle))

    def found(self) -> Excitation:
        """Complete the search and return the excitation of all modes."""
        while self.left:
            self.go_on()
        modes = self._modes or self._search.found()
        no_modes, no_zones = np.zeros(0), np.zeros((len(self.span.s), 0))
        groups = self._parts or [_Part(no_modes, no_modes, no_modes, no_zones)]
        frequency, added, power, band = (
            np.concatenate(columns, axis=-1) for columns in zip(*groups, strict=True)
        )
        if self._model.lock_in == "nearest":
            order = np.argsort(frequency, kind="stable")  # added mass may change their order
            zones = np.empty_like(band)
            shedding = self._model.centre * self.span.speed / self.span.diameter
            zones[:, order] = nearest_zones(frequency[order], shedding, band[:, order], band)
        else:
            zones = _share_out(power, band, self._model.candidate)
        return Excitation(modes, frequency, added, power, zones)


def near_driven(excitation: Excitation) -> tuple[float, float] | None:
    """Return the frequency range of modes that may soon be excited [Hz]; None: any.

    Frequencies are those at constant added mass; the range extends a tenth beyond the modes that
    have POWER_MIN of the largest power now.
    """
    if not excitation.power.any():
        return None
    driven = excitation.modes.frequency[excitation.power > POWER_MIN * excitation.power.max()]
    return 0.9 * float(driven[0]), 1.1 * float(driven[-1])


class _Part(NamedTuple):
    """Excitation of a group of modes, (modes,) or (nodes, modes)."""

    frequency: Floats
    added_mass: Floats
    power: Floats
    band: Floats


def _excited(span: Span, model: Decomposed, modes: LateralModes) -> _Part:
    """Return natural frequencies with the actual added mass, and the powers at them."""
    square = modes.shape**2
    weight = displaced(span, model.density)[:, None] * square
    dry, wet = np.einsum("n,nk->k", span.node_mass, square), modes.mass
    added = np.full(len(wet), model.fixed_added_mass)
    frequency = modes.frequency.copy()
    if model.varying:
        row = model.table.added_mass_row(model.first_amplitude)
        solve_added_mass(
            model.table.frequency, row, _per_speed(span), np.ascontiguousarray(weight.T),
            modes.frequency, dry, wet, ROUNDS, ADDED_MASS_TOL, added, frequency,
        )  # fmt: skip
    power, band = _powers(span, model, modes, frequency)
    return _Part(frequency, added, power, band)


def fine_enough(
    span: Span, model: Decomposed, kept: int = 0, recent: RecentSpeeds | None = None
) -> Span:
    """Refine a span for waves of the highest frequency that can be excited; a slack rope as is.

    kept: previous number of elements, as in `refined`; recent: past flow, whose waves may still be
    there.
    """
    if not (span.tension > 0.0).all():
        return span  # a slack rope has no modes
    moved = span.mass + _per_metre(span, model)[:-1]
    slowest = float(np.sqrt((span.tension / moved).min()))
    fastest = model.band[1] * (recent or RecentSpeeds()).fastest(span)
    longest = slowest / max(fastest, 1e-9) / PER_WAVE
    return refined(span, max(longest, span.s[-1] / MAX_ELEMENTS), EVEN, kept)


def _per_metre(span: Span, model: Decomposed) -> Floats:
    return model.density * 0.25 * pi * span.diameter**2


def _per_speed(span: Span) -> Floats:
    """Return D/U [s]; very large in still water."""
    return np.asarray(span.diameter / np.maximum(span.speed, SPEED_MIN))


def _powers(
    span: Span, model: Decomposed, modes: LateralModes, frequency: Floats
) -> tuple[Floats, Floats]:
    """Return Π of each mode, and the fraction of each node at which f·D/U is in the band."""
    reduced, omega = frequency * _per_speed(span)[:, None], 2.0 * pi * frequency
    rate, (low, high) = span.speed / span.diameter, model.band
    band = parts_below(rate, frequency / low) - parts_below(rate, frequency / high)
    lift = model.table.lift_along(model.first_amplitude, reduced)
    push = 0.5 * model.density * (span.diameter * span.speed**2 * span.node_length)[:, None]
    force = (band * push * np.maximum(lift, 0.0) * np.abs(modes.shape)).sum(axis=0)
    speed = model.first_amplitude * span.diameter[:, None] * omega
    outside = (1.0 - band) * push * np.maximum(-lift, 0.0)
    hydrodynamic = (outside / speed * modes.shape**2).sum(axis=0)
    structural = 2.0 * model.structural * omega * modes.mass
    return 0.5 * force * force / (hydrodynamic + structural), band


def _share_out(power: Floats, band: Floats, threshold: float) -> Floats:
    """Assign its band to the strongest mode, the remainder to the next.

    Modes below `least` of the largest power get nothing, those slightly above it a part.
    """
    if not power.any():
        return np.zeros_like(band)
    excess = (power / (threshold * power.max()) - 1.0) / TIE
    return share_out(power, band * np.clip(excess, 0.0, 1.0), TIE)
