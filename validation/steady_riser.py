"""[GE]'s riser in steady motion, by harmonic balance, as its text may be read: G1.

The check of the response stepped in time (viv.decomposed_response): it shares the table, the modes
and the stiffness with it, but neither steps nor a running mean. With y = Im(Y·e^{iωt}), ω the true
frequency of the mode with most power:

    (K - ω²·M + i·ω·C)·Y = P,    C, M and P from the table at A = |Y|/D and f·D/U

solved again and again until A stays. Places that drive a weaker mode are left out: at ω they lie
above the band, where the water damps.
"""

from __future__ import annotations

from math import inf, nan, pi, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rope_twin.core.state import Floats
from rope_twin.vortex.decomposed_response import upper_bands
from rope_twin.vortex.force_table import ForceTable
from rope_twin.vortex.line_model import Span
from rope_twin.vortex.modes import stiffness
from rope_twin.vortex.power_in import Decomposed, ExcitationSearch, displaced

DIAGONALS = 2  # of the stiffness beside the main one
ROUNDS, SHARE, SAME = 400, 0.4, 1e-7
LEAST = 0.02  # D: as in the response that is stepped
STEADY_DRAG = 1.2  # C_D of the motion in still water


class Reading(NamedTuple):
    """One reading of what the paper leaves open."""

    name: str
    structural: float | None = None  # of critical; None: the model's
    damped: str = "with its water"  # mass that the structure damps; or "dry"
    water: str = "table"  # what of the water damps; "none", or "drag": at least the motion's drag
    drive: float = 1.0  # over the true frequency
    modes: tuple[int, ...] = ()  # to be driven, one for each riser; none: the one with most power
    signed: bool = True  # the lift changes sign with the mode
    read: float = 1.0  # amplitude that the table is asked at, over the motion's


KEPT = Reading("kept: 1.5 % of critical, driven in the mode with most power at its frequency")
READINGS = (
    KEPT,
    Reading("structure undamped", structural=0.0),
    Reading("structure 3 %", structural=0.03),
    Reading("structure 5 %", structural=0.05),
    Reading("structure 1.5 % with the mass without water", damped="dry"),
    Reading("2·m·ω·ζ of 5 % for structure and water together", structural=0.05, water="none"),
    Reading("2·m·ω·ζ of 6 % for both", structural=0.06, water="none"),
    Reading("2·m·ω·ζ of 8 % for both", structural=0.08, water="none"),
    Reading("outside the band drag of the motion, C_D 1.2, where it is more", water="drag"),
    Reading("driven 3 % above the frequency", drive=1.03),
    Reading("driven 3 % below", drive=0.97),
    Reading("driven 6 % below", drive=0.94),
    Reading("driven in the published modes 11, 13 and 14", modes=(11, 13, 14)),
    Reading("lift without the sign of φ", signed=False),
    Reading("A as rms", read=sqrt(0.5)),
)


def forces_at(table: ForceTable, amplitude: Floats, frequency: Floats) -> tuple[Floats, Floats]:
    """Return C_Lv and C_a at A/D and f·D/U, (n,): bilinear, constant beyond the table's ends."""
    i, u = _interval(table.frequency, frequency)
    j, v = _interval(table.amplitude, amplitude)
    both = np.stack([table.lift, table.added_mass])
    low = (1.0 - v) * both[..., i, j] + v * both[..., i, j + 1]
    high = (1.0 - v) * both[..., i + 1, j] + v * both[..., i + 1, j + 1]
    lift, added_mass = (1.0 - u) * low + u * high
    return lift, added_mass


def _interval(knots: Floats, values: Floats) -> tuple[NDArray[np.intp], Floats]:
    """Return the index of the knot below, and the fraction from it to the next."""
    inside = np.clip(values, knots[0], knots[-1])
    i = np.clip(np.searchsorted(knots, inside, side="right") - 1, 0, len(knots) - 2)
    return i, (inside - knots[i]) / (knots[i + 1] - knots[i])


def steady_amplitude(
    span: Span, model: Decomposed, reading: Reading = KEPT, mode: int | None = None
) -> Floats:
    """Return |Y| at all nodes [D]; NaN where no steady motion is found.

    Both ends are held. `mode`: to be driven, from 1; None: the one with most power.
    """
    from scipy.linalg import solve_banded

    excitation, free = ExcitationSearch(span, model).found(), slice(1, -1)
    k = (excitation.dominant if mode is None else mode) - 1
    frequency = reading.drive * float(excitation.frequency[k])
    omega, D = 2.0 * pi * frequency, span.diameter[free]
    reduced = frequency * D / np.maximum(span.speed[free], 1e-6)
    at_zone = excitation.frequency[k] * span.diameter[free] / np.maximum(span.speed[free], 1e-6)
    zone = (at_zone >= model.band[0]) & (at_zone <= model.band[1])
    sign = np.sign(excitation.modes.shape[free, k]) if reading.signed else 1.0
    push = (0.5 * model.density * span.diameter * span.speed**2 * span.node_length)[free]
    drag = 4.0 / (3.0 * pi) * STEADY_DRAG * model.density * (span.diameter * span.node_length)[free]
    water, dry = displaced(span, model.density)[free], span.node_mass[free]
    bands = _both_sides(upper_bands(stiffness(span).tocsr()[1:-1, 1:-1], DIAGONALS + 1))
    damping = model.structural if reading.structural is None else reading.structural
    A, change = np.full(len(D), 0.3), inf
    for _ in range(ROUNDS):
        lift, added = forces_at(model.table, reading.read * A, reduced)
        if not model.varying:
            added = np.full(len(D), model.fixed_added_mass)
        mass = dry + added * water
        speed = np.maximum(reading.read * A, LEAST) * D * omega
        against = push * np.maximum(-lift, 0.0) / speed
        if reading.water == "none":
            against = np.zeros(len(D))
        elif reading.water == "drag":
            against = np.where(lift < 0.0, np.maximum(against, drag * speed), against)
        damped = mass if reading.damped == "with its water" else dry
        matrix = bands.astype(complex)
        matrix[DIAGONALS] += 1j * omega * (against + 2.0 * omega * damping * damped)
        matrix[DIAGONALS] -= omega**2 * mass
        force = push * np.maximum(lift, 0.0) * zone * sign
        moved = np.abs(solve_banded((DIAGONALS, DIAGONALS), matrix, force + 0j)) / D
        change = float(np.abs(moved - A).max())
        A = A + SHARE * (moved - A)
        if change < SAME:
            break
    amplitude = np.zeros(len(span.s))
    amplitude[free] = A if change < SAME else nan
    return amplitude


def mean_rms(span: Span, model: Decomposed, reading: Reading, mode: int | None = None) -> float:
    """Return the mean RMS along the riser, over D."""
    return sqrt(0.5) * float(steady_amplitude(span, model, reading, mode).mean())


def _both_sides(upper: Floats) -> Floats:
    """Convert a symmetric matrix from LAPACK's upper band form to its general band form."""
    lower = np.zeros((DIAGONALS, upper.shape[1]))
    for k in range(1, DIAGONALS + 1):
        lower[k - 1, :-k] = upper[DIAGONALS - k, k:]
    return np.vstack([upper, lower])
