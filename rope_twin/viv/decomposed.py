"""Which modes a current feeds, by forces taken apart in phase: with added mass fixed or varying.

[GE] Ge, Added mass effect on VIV for flexible risers, 2018; [SJTU] thesis on ultra-slender flexible
structures, ch. 5. For each mode the power Π_r = |Q_r|²/(2·R_r): Q_r the lift ½·C_Lv·ρ·D·U² over its
band, weighted by |φ_r|, R_r the damping outside, c = -½·C_Lv·ρ·D·U²/(A·ω) where C_Lv < 0, with the
structure's 2·m·ω·ζ. The strongest mode takes its band, the next what is left; modes of the same
power share. Where the added mass
varies, f = f_1·√(M_1/(M + Σ C_a·ρ·A·φ²)), iterated with the mean of two successive C_a; f_1 and M_1
are those at C_a = 1.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from typing import NamedTuple

import numpy as np

from rope_twin.core.modes.apart import settle_added_mass
from rope_twin.core.modes.sharing import parts_below, share_out
from rope_twin.viv.force_table import ForceTable, fitted_forces
from rope_twin.viv.lateral_modes import MOST, LateralModes, ModeSearch
from rope_twin.viv.span import EVEN, Floats, Span, refined

PER_WAVE = 24  # elements per wave at the highest frequency that can be driven
MOST_ELEMENTS = 6000
ROUNDS = 60
SAME = 1e-6  # C_a that two rounds agree to
TIE = 0.03  # modes whose powers differ by less share a place
NEAR = 0.03  # of the largest power: a mode with less is not driven in the next second either
STILL = 1e-6  # m/s: water slower than this is still


@dataclass(frozen=True)
class Decomposed:
    """What the model needs besides the rope."""

    table: ForceTable
    varying: bool = True  # False: the added mass is the coefficient below everywhere
    fixed_added_mass: float = 1.0
    band: tuple[float, float] = (0.125, 0.2)  # of f·D/U in which a mode can be locked in
    density: float = 1025.0  # [kg/m³]
    structural: float = 0.015  # of critical; not printed in [GE]: as the modal approach has it
    first_amplitude: float = 0.5  # [D], of which the powers are taken
    candidate: float = 0.1  # of the largest power: modes with less are left out


def decomposed(varying: bool = True, structural: float = 0.015) -> Decomposed:
    """With the table that comes with the package."""
    return Decomposed(fitted_forces(), varying, structural=structural)


@dataclass(frozen=True)
class Excitation:
    """Modes and what the current does to each; (modes,) or (nodes, modes)."""

    modes: LateralModes  # at the fixed added mass
    frequency: Floats  # true, with the added mass as it is [Hz]
    added_mass: Floats  # mean coefficient of each mode, weighted by φ²
    power: Floats  # Π_r [W]
    zones: Floats  # part of a node that drives a mode
    locked: Floats  # part of a node at which its f·D/U lies in the band

    @property
    def dominant(self) -> int:
        """Number of the mode with the largest power, from 1; 0 where none has any."""
        return int(self.power.argmax()) + 1 if self.power.any() else 0

    @property
    def driven(self) -> Floats:
        """Frequency that each node is driven at, of what it drives [Hz]; 0: it is not; (nodes,)."""
        whole = self.zones.sum(axis=1)
        mean = (self.zones * self.frequency).sum(axis=1) / np.where(whole > 0.0, whole, 1.0)
        return np.asarray(mean)


def displaced(span: Span, density: float) -> Floats:
    """Water that the nodes displace [kg]."""
    return density * 0.25 * pi * span.diameter**2 * span.node_length


class ExcitationSearch:
    """What a current does to each mode, some modes at a time: for who has no time for all at once.

    Of a group of modes after the other: their shapes, then their true frequencies and powers.
    span.mass is without added mass.

    Raises:
        InputError: the rope is slack somewhere.
    """

    def __init__(
        self,
        span: Span,
        model: Decomposed,
        part: int = MOST,
        near_hz: tuple[float, float] | None = None,
    ) -> None:
        """`part`: about so many modes at a time.

        near_hz: of the modes at the fixed added mass; slower ones are taken to have no power, and
        faster ones are not looked for.
        """
        self.span, self._model, self._part = span, model, part
        self._slowest, fastest_hz = near_hz or (0.0, np.inf)
        share = 0.5 * (_per_metre(span, model)[1:] + _per_metre(span, model)[:-1])
        moved = span._replace(mass=span.mass + model.fixed_added_mass * share)
        fastest = float((span.speed / span.diameter).max())
        highest = min(1.5 * model.band[1] * fastest, fastest_hz)
        self._search = ModeSearch(moved, highest, part)
        self._expected = self._search.left  # parts, as far as is known before
        self._modes: LateralModes | None = None
        self._parts: list[_Part] = []

    @property
    def left(self) -> int:
        """How often it can go on."""
        if self._modes is None:
            return self._search.left + 1 + self._expected
        return -(-len(self._modes.frequency) // self._part) - len(self._parts)

    def go_on(self) -> None:
        """The next ones, if any are left."""
        if self._search.left:
            self._search.go_on()
        elif self._modes is None:
            self._modes = self._search.found()
        elif self.left:
            first = self._part * len(self._parts)
            some = _some(self._modes, slice(first, first + self._part))
            idle = float(some.frequency[-1]) < self._slowest
            self._parts.append(
                _idle(self._model, some) if idle else _excited(self.span, self._model, some)
            )

    def found(self) -> Excitation:
        """Of all of them, with what is left of the search."""
        while self.left:
            self.go_on()
        modes = self._modes or self._search.found()
        none, nowhere = np.zeros(0), np.zeros((len(self.span.s), 0))
        parts = self._parts or [_Part(none, none, none, nowhere)]
        frequency, added, power, band = (
            np.concatenate(own, axis=-1) for own in zip(*parts, strict=True)
        )
        zones = _share_out(power, band, self._model.candidate)
        return Excitation(modes, frequency, added, power, zones, band)


def near_driven(found: Excitation) -> tuple[float, float] | None:
    """Between which frequencies modes may be driven a moment later [Hz]; None: any.

    At the fixed added mass; a tenth beyond those with NEAR of the largest power now.
    """
    if not found.power.any():
        return None
    driven = found.modes.frequency[found.power > NEAR * found.power.max()]
    return 0.9 * float(driven[0]), 1.1 * float(driven[-1])


def analyse(span: Span, model: Decomposed) -> Excitation:
    """Candidate modes, their power and true frequency; span.mass is without added mass.

    Raises:
        InputError: the rope is slack somewhere.
    """
    return ExcitationSearch(span, model).found()


class _Part(NamedTuple):
    """Of some modes, (modes,) or (nodes, modes)."""

    frequency: Floats
    added_mass: Floats
    power: Floats
    band: Floats


def _some(modes: LateralModes, which: slice) -> LateralModes:
    shape = np.ascontiguousarray(modes.shape[:, which])
    return LateralModes(modes.frequency[which], shape, modes.mass[which])


def _idle(model: Decomposed, modes: LateralModes) -> _Part:
    """Of modes that have no power."""
    added = np.full(len(modes.mass), model.fixed_added_mass)
    return _Part(modes.frequency, added, np.zeros(len(added)), np.zeros_like(modes.shape))


def _excited(span: Span, model: Decomposed, modes: LateralModes) -> _Part:
    """True frequencies, and the powers at them."""
    square = modes.shape**2
    weight = displaced(span, model.density)[:, None] * square
    dry, wet = np.einsum("n,nk->k", span.node_mass, square), modes.mass
    added = np.full(len(wet), model.fixed_added_mass)
    frequency = modes.frequency.copy()
    if model.varying:
        row = model.table.added_mass_row(model.first_amplitude)
        settle_added_mass(
            model.table.frequency, row, _per_speed(span), np.ascontiguousarray(weight.T),
            modes.frequency, dry, wet, ROUNDS, SAME, added, frequency,
        )  # fmt: skip
    power, band = _powers(span, model, modes, frequency)
    return _Part(frequency, added, power, band)


def fine_enough(span: Span, model: Decomposed, kept: int = 0) -> Span:
    """In elements for waves of the highest frequency that can be driven; a slack rope as it is.

    kept: as many as there were, as in `refined`.
    """
    if not (span.tension > 0.0).all():
        return span  # of which no modes are found
    moved = span.mass + _per_metre(span, model)[:-1]
    slowest = float(np.sqrt((span.tension / moved).min()))
    fastest = model.band[1] * float((span.speed / span.diameter).max())
    longest = slowest / max(fastest, 1e-9) / PER_WAVE
    return refined(span, max(longest, span.s[-1] / MOST_ELEMENTS), EVEN, kept)


def _per_metre(span: Span, model: Decomposed) -> Floats:
    return model.density * 0.25 * pi * span.diameter**2


def _per_speed(span: Span) -> Floats:
    """D/U [s]; very large in still water."""
    return np.asarray(span.diameter / np.maximum(span.speed, STILL))


def _reduced(frequency: Floats, span: Span) -> Floats:
    """f·D/U, (nodes, modes)."""
    return np.asarray(frequency * _per_speed(span)[:, None])


def _powers(
    span: Span, model: Decomposed, modes: LateralModes, frequency: Floats
) -> tuple[Floats, Floats]:
    """Π of each mode, and the parts of the nodes at which its f·D/U lies in the band."""
    reduced, omega = _reduced(frequency, span), 2.0 * pi * frequency
    turned, (low, high) = span.speed / span.diameter, model.band
    band = parts_below(turned, frequency / low) - parts_below(turned, frequency / high)
    lift = model.table.lift_along(model.first_amplitude, reduced)
    push = 0.5 * model.density * (span.diameter * span.speed**2 * span.node_length)[:, None]
    force = (band * push * np.maximum(lift, 0.0) * np.abs(modes.shape)).sum(axis=0)
    speed = model.first_amplitude * span.diameter[:, None] * omega
    outside = (1.0 - band) * push * np.maximum(-lift, 0.0)
    against = (outside / speed * modes.shape**2).sum(axis=0)
    own = 2.0 * model.structural * omega * modes.mass
    return 0.5 * force * force / (against + own), band


def _share_out(power: Floats, band: Floats, least: float) -> Floats:
    """The strongest mode takes its band, the next what is left of its own.

    Modes of less than `least` of the largest power take nothing, those of a little more a part.
    """
    if not power.any():
        return np.zeros_like(band)
    above = (power / (least * power.max()) - 1.0) / TIE
    return share_out(power, band * np.clip(above, 0.0, 1.0), TIE)
