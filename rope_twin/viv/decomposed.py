"""Which modes a current feeds, by forces taken apart in phase: with added mass fixed or varying.

[GE] Ge, Added mass effect on VIV for flexible risers, 2018; [SJTU] thesis on ultra-slender flexible
structures, ch. 5. For each mode the power Π_r = |Q_r|²/(2·R_r): Q_r the lift ½·C_Lv·ρ·D·U² over its
band, weighted by |φ_r|, R_r the damping outside, c = -½·C_Lv·ρ·D·U²/(A·ω) where C_Lv < 0, with the
structure's 2·m·ω·ζ. The strongest mode takes its band, the next what is left. Where the added mass
varies, f = f_1·√(M_1/(M + Σ C_a·ρ·A·φ²)), iterated with the mean of two successive C_a; f_1 and M_1
are those at C_a = 1.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

import numpy as np

from rope_twin.viv.force_table import ForceTable, fitted_forces
from rope_twin.viv.lateral_modes import MOST, LateralModes, ModeSearch
from rope_twin.viv.shedding import Mask
from rope_twin.viv.span import Floats, Span

ROUNDS = 60
SAME = 1e-6  # C_a that two rounds agree to
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
    zones: Mask  # nodes that drive a mode

    @property
    def dominant(self) -> int:
        """Number of the mode with the largest power, from 1; 0 where none has any."""
        return int(self.power.argmax()) + 1 if self.power.any() else 0

    @property
    def driven(self) -> Floats:
        """Frequency that each node is driven at [Hz], 0 where it is not, (nodes,)."""
        return np.asarray((self.zones * self.frequency).sum(axis=1))


def displaced(span: Span, density: float) -> Floats:
    """Water that the nodes displace [kg]."""
    return density * 0.25 * pi * span.diameter**2 * span.node_length


def search_modes(span: Span, model: Decomposed, part: int = MOST) -> ModeSearch:
    """For the candidates, `part` modes at a time; span.mass is without added mass.

    Raises:
        InputError: the rope is slack somewhere.
    """
    share = 0.5 * (_per_metre(span, model)[1:] + _per_metre(span, model)[:-1])
    moved = span._replace(mass=span.mass + model.fixed_added_mass * share)
    fastest = float((span.speed / span.diameter).max())
    return ModeSearch(moved, 1.5 * model.band[1] * fastest, part)


def analyse(span: Span, model: Decomposed, search: ModeSearch | None = None) -> Excitation:
    """Candidate modes, their power and true frequency; span.mass is without added mass.

    `search`: where the modes were looked for before.

    Raises:
        InputError: the rope is slack somewhere.
    """
    water = displaced(span, model.density)
    modes = (search or search_modes(span, model)).found()
    weight = modes.shape**2
    dry = span.node_mass @ weight
    wet = modes.mass
    added = np.full(len(wet), model.fixed_added_mass)
    frequency = modes.frequency.copy()
    if model.varying:
        for _ in range(ROUNDS):
            reduced = _reduced(frequency, span)
            local = model.table.added_mass_along(model.first_amplitude, reduced)
            mean = ((local * weight) * water[:, None]).sum(axis=0) / (water @ weight)
            mean = 0.5 * (added + mean)
            done = np.abs(mean - added).max(initial=0.0) < SAME
            added = mean
            frequency = modes.frequency * np.sqrt(wet / (dry + added * (water @ weight)))
            if done:
                break
    power, band = _powers(span, model, modes, frequency)
    return Excitation(modes, frequency, added, power, _share_out(power, band, model.candidate))


def _per_metre(span: Span, model: Decomposed) -> Floats:
    return model.density * 0.25 * pi * span.diameter**2


def _reduced(frequency: Floats, span: Span) -> Floats:
    """f·D/U, (nodes, modes); very large in still water."""
    return np.asarray(frequency * (span.diameter / np.maximum(span.speed, STILL))[:, None])


def _powers(
    span: Span, model: Decomposed, modes: LateralModes, frequency: Floats
) -> tuple[Floats, Mask]:
    """Π of each mode, and where its f·D/U lies in the band."""
    reduced, omega = _reduced(frequency, span), 2.0 * pi * frequency
    band: Mask = (reduced >= model.band[0]) & (reduced <= model.band[1])
    lift = model.table.lift_at(np.full_like(reduced, model.first_amplitude), reduced)
    push = 0.5 * model.density * (span.diameter * span.speed**2 * span.node_length)[:, None]
    force = (band * push * np.maximum(lift, 0.0) * np.abs(modes.shape)).sum(axis=0)
    speed = model.first_amplitude * span.diameter[:, None] * omega
    against = (~band * push * np.maximum(-lift, 0.0) / speed * modes.shape**2).sum(axis=0)
    own = 2.0 * model.structural * omega * modes.mass
    return 0.5 * force * force / (against + own), band


def _share_out(power: Floats, band: Mask, least: float) -> Mask:
    """The strongest mode takes its band, the next what is left of its own."""
    zones, taken = np.zeros_like(band), np.zeros(len(band), dtype=bool)
    for mode in np.argsort(-power, kind="stable"):
        if power[mode] <= least * power.max():
            break
        zones[:, mode] = band[:, mode] & ~taken
        taken |= zones[:, mode]
    return zones
