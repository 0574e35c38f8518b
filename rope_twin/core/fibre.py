"""Internal variables of a fibre rope: the strain ε_m behind its dynamic stiffness, and its history.

Each element follows core/axial_law: T = S(ε_m) + E_d·(ε - ε_m), dε_m/dt = (T - S(ε_m))/(E_d·τ).

**Dynamic stiffness.** Tests give E_d as a linear function of the mean tension M = S(ε_m), and for
polyester of the amplitude too (Del Vecchio 1992; Francois and Davies 2008): E_d = a + b·M - c·A.
The tension amplitude A is E_d times √2 of the running root mean square of ε - ε_m over τ (exact for
a harmonic motion), so that E_d = (a + b·M)/(1 + c·√2·rms); never below the tangent of S, for else
the solid would create energy. E_d changes from step to step, not within one.

**Working curves** (Syrope: Falkenberg, Åhjem and Yang 2017, OTC-27761). The table is the original
curve, which a rope follows while its mean tension is the highest so far. Below that it follows a
working curve: from the point (ε_h, T_h) of the highest mean tension down to the permanent strain
ε_p = k·ε_h, T = T_h·ξ·(1 - m + m·ξ), ξ = (ε_m - ε_p)/(ε_h - ε_p). T_h rises with M, from the
tension at installation.

**Energy.** W(ε_m) + S·e + E_d·e²/2 with e = ε - ε_m is stored; the rest of T·dε is heat, at the
rate (E_d - S')·e²/τ, and on the original curve what the working curve does not give back.

Elements carry their values where the top element splits or merges; the rope that comes from the
drum has those of the element at the sheave, and where its section begins, the same mean tension.
"""

from __future__ import annotations

from math import exp, sqrt
from typing import Any

from rope_twin.core.axial_law import (
    BEND,
    CARRIED,
    HAT,
    HELD,
    INITIAL,
    LOWER,
    MEAN,
    MIDDLE,
    OVER,
    OWN_ROWS,
    SQUARE,
    START,
    STIFF,
    TENSION_MEAN,
    TENSION_TOP,
    TOP,
    UPPER,
    Fibre,
    FibreLaw,
    relaxed_at,
    sections_law,
    tension_at,
)
from rope_twin.core.elements import section_above
from rope_twin.core.integrator import BDF2, GAMMA, K1, K2, TRAPEZOID
from rope_twin.core.jit.decorators import jit, jit_within
from rope_twin.core.jit.functions import by_type
from rope_twin.core.loads.hooks import kernel
from rope_twin.core.loads.memory import new_memory, remembering
from rope_twin.core.state import (
    CURVATURE,
    DYNAMIC,
    ELEMENTS,
    END,
    HIGHEST,
    PER_AMPLITUDE,
    PER_TENSION,
    PERMANENT,
    POSITION,
    RELAXATION,
    REST,
    SECTION,
    STRETCH2_MIN,
)

SAME_TENSION = 1e-9  # relative: S(ε_m) and M that differ by more belong to different sections
NEWTON_STEPS, HALVINGS = 50, 60
TRIALS = 4  # ghost columns at the end of the arrays (core/payout)


def new_fibre(room: int) -> Fibre:
    """Return the internal variables of a fibre rope with space for `room` nodes, all zero."""
    return Fibre(new_memory(CARRIED, OWN_ROWS, room))


@jit
def strain_on_table(table: Any, section: int, tension: float) -> float:
    """Return the strain at which a section's table holds this tension [N]; it rises everywhere."""
    j = 0
    while (
        j + 1 < table.knot.shape[1]
        and table.knot[section, j + 1] < 1e300
        and tension >= table.tension[section, j + 1]
    ):
        j += 1
    low = table.knot[section, j]
    last = not (j + 1 < table.knot.shape[1] and table.knot[section, j + 1] < 1e300)
    if last or tension <= table.tension[section, j]:
        return float(low + (tension - table.tension[section, j]) / table.slope[section, j])
    high = table.knot[section, j + 1]
    strain = 0.5 * (low + high)
    for _ in range(NEWTON_STEPS):
        T, slope = tension_at(table, section, strain)
        if tension < T:
            high = strain
        else:
            low = strain
        step = strain - (T - tension) / slope
        inside = low < step < high
        before, strain = strain, step if inside else 0.5 * (low + high)
        if abs(strain - before) <= 1e-16 + 4e-16 * abs(strain):
            break
    return float(strain)


@jit
def _set_working(law: Any, sections: Any, k: int, e: int, highest: float, top: float) -> None:
    """Set the working curve of element e of section k: from the mean tension `highest` at `top`."""
    m, share = law.memory, sections[PERMANENT, k]
    m[INITIAL, e] = 0.0
    if share == 0.0 or not highest > 0.0:
        return
    span, curvature = (1.0 - share) * top, sections[CURVATURE, k]
    m[UPPER, e], m[LOWER, e] = top, share * top
    m[INITIAL, e] = highest * (1.0 - curvature) / span
    m[BEND, e] = highest * curvature / (span * span)


@jit_within
def _working(m: Any, e: int) -> Any:
    return m[UPPER, e], m[LOWER, e], m[INITIAL, e], m[BEND, e]


@jit
def _strain_at(law: Any, k: int, e: int, tension: float) -> float:
    """Return ε_m of element e, of section k, at this mean tension [N]."""
    upper, lower, initial, bend = _working(law.memory, e)
    if initial > 0.0:
        u = upper - lower
        if tension < u * (initial + bend * u):
            if tension <= 0.0:
                return float(lower + tension / initial)
            root = sqrt(initial * initial + 4.0 * bend * tension)
            return float(lower + 2.0 * tension / (initial + root))
    return float(strain_on_table(law.table, k, tension))


@jit
def _dynamic(sections: Any, k: int, M: float, square: float, slope: float) -> float:
    """Return E_d [N] at the mean tension M, mean square of ε - ε_m, and tangent of S."""
    stiff = (sections[DYNAMIC, k] + sections[PER_TENSION, k] * M) / (
        1.0 + sections[PER_AMPLITUDE, k] * sqrt(2.0 * square)
    )
    return float(max(stiff, slope))


@jit
def _adopt(law: Any, sections: Any, k: int, e: int) -> None:
    """Make the carried values of element e those of section k, at the same mean tension."""
    m = law.memory
    M, highest = m[TENSION_MEAN, e], m[TENSION_TOP, e]
    if sections[PERMANENT, k] > 0.0:
        highest = max(highest, M, sections[HIGHEST, k])
        m[TOP, e], m[TENSION_TOP, e] = strain_on_table(law.table, k, highest), highest
    _set_working(law, sections, k, e, highest, m[TOP, e])
    m[MEAN, e] = _strain_at(law, k, e, M)


@jit
def _begin(law: Any, sections: Any, k: int, e: int, held: float) -> None:
    """Set START, E_d and the working curve of element e from its carried values."""
    m = law.memory
    _set_working(law, sections, k, e, m[TENSION_TOP, e], m[TOP, e])
    S, slope = relaxed_at(law.table, k, _working(m, e), m[MEAN, e])
    M = m[TENSION_MEAN, e]
    if abs(S - M) > SAME_TENSION * (abs(S) + abs(M) + 1.0):
        _adopt(law, sections, k, e)
        S, slope = relaxed_at(law.table, k, _working(m, e), m[MEAN, e])
    m[START, e], m[HELD, e] = m[MEAN, e], held
    m[STIFF, e] = _dynamic(sections, k, max(S, 0.0), m[SQUARE, e], slope)


@jit
def _relax(law: Any, rope: Any, k: int, e: int) -> None:
    """Let element e follow S alone: in a static solution, and in a section without relaxation."""
    m, sections, highest = law.memory, rope.sections, rope.sections[HIGHEST, k]
    m[HELD, e], m[HAT, e], m[TOP, e] = 0.0, 0.0, 0.0
    if sections[PERMANENT, k] > 0.0:
        m[TOP, e] = strain_on_table(law.table, k, highest)
    _set_working(law, sections, k, e, highest, m[TOP, e])
    m[TENSION_TOP, e] = highest


@jit
def _predict(law: Any, rope: Any, stage: Any, kind: int, low: int, high: int) -> None:
    m, work, sections = law.memory, rope.work, rope.sections
    for e in range(low, high):
        k = int(work[SECTION, e])
        rate = sections[RELAXATION, k]
        if rate == 0.0 or stage.time <= 0.0:
            _relax(law, rope, k, e)
            continue
        held = 1.0 / (1.0 + stage.q * rate)
        if kind == TRAPEZOID:
            _begin(law, sections, k, e, held)
            m[HAT, e] = m[START, e] + stage.q * rate * m[OVER, e]
        else:
            m[HAT, e], m[HELD, e] = K1 * m[MIDDLE, e] - K2 * m[START, e], held


# Predict the internal variables of the elements low <= e < high; other laws have none.
predict_law = by_type(
    FibreLaw,
    lambda law, rope, stage, kind, low, high: _predict(law, rope, stage, kind, low, high),
    lambda law, rope, stage, kind, low, high: None,
)


@jit
def _hold(law: Any, rope: Any) -> None:
    m, work = law.memory, rope.work
    for e in range(rope.state.counts[ELEMENTS]):
        if rope.sections[RELAXATION, int(work[SECTION, e])] > 0.0:
            m[HAT, e], m[HELD, e] = m[MEAN, e], 1.0


# Let a fibre rope answer as at the start of the step, at once; other laws always do.
hold_law = by_type(FibreLaw, lambda law, rope: _hold(law, rope), lambda law, rope: None)


@jit_within
def _strain(rope: Any, e: int) -> Any:
    """Return the strain of element e in scratch."""
    work, rest = rope.work, rope.work[REST, e]
    square = STRETCH2_MIN * rest * rest
    for k in range(POSITION, POSITION + 3):
        square += (work[k, e + 1] - work[k, e]) ** 2
    return (sqrt(square) + rope.state.offset[e] - rest) / rest


@kernel("start", Fibre)
def start(fibre: Any, rope: Any, upto: int) -> None:
    """Begin at rest: ε_m is the strain of the static equilibrium, where slack that without load."""
    law, m, sections = sections_law(rope), fibre.memory, rope.sections
    for e in range(rope.state.counts[ELEMENTS]):
        k = int(rope.work[SECTION, e])
        _relax(law, rope, k, e)
        strain = _strain(rope, e)
        S, m[STIFF, e] = relaxed_at(law.table, k, _working(m, e), strain)
        if S < 0.0:
            strain, S = _strain_at(law, k, e, 0.0), 0.0
        m[MEAN, e], m[TENSION_MEAN, e], m[OVER, e], m[SQUARE, e] = strain, S, 0.0, 0.0
        if sections[PERMANENT, k] > 0.0 and strain > m[TOP, e]:
            m[TOP, e], m[TENSION_TOP, e] = strain, S
        if sections[RELAXATION, k] > 0.0:
            _begin(law, sections, k, e, 1.0)
            m[HAT, e] = strain
    n = rope.state.counts[ELEMENTS]
    for r in range(CARRIED):
        m[r, n] = m[r, n - 1]


@kernel("predict", Fibre)
def predict(fibre: Any, rope: Any, stage: Any, kind: int, low: int, high: int) -> None:
    """Do nothing: an element's tension is evaluated before the nodes are (`predict_law`)."""


@kernel("settle", Fibre)
def settle(fibre: Any, rope: Any, stage: Any, kind: int, upto: int) -> None:
    """Store ε_m and what follows from it; then hold it, for splits and merges of elements."""
    law, m, work, sections = sections_law(rope), fibre.memory, rope.work, rope.sections
    n = rope.state.counts[ELEMENTS]
    share = 0.0
    if stage.time <= 0.0:
        return
    for e in range(n):
        k = int(work[SECTION, e])
        rate = sections[RELAXATION, k]
        if rate == 0.0:  # what a fibre section above would begin with
            strain = _strain(rope, e)
            S, m[STIFF, e] = relaxed_at(law.table, k, _working(m, e), strain)
            m[CARRIED + MEAN, e], m[CARRIED + TENSION_MEAN, e] = strain, max(S, 0.0)
            continue
        mean, over = _settled(law, rope, stage, k, e)
        S, _ = relaxed_at(law.table, k, _working(m, e), mean)
        m[MIDDLE, e] = mean
        m[CARRIED + MEAN, e], m[CARRIED + TENSION_MEAN, e], m[CARRIED + OVER, e] = mean, S, over
        m[CARRIED + TOP, e], m[CARRIED + TENSION_TOP, e] = m[TOP, e], m[TENSION_TOP, e]
        if sections[PERMANENT, k] > 0.0 and mean > m[TOP, e]:
            m[CARRIED + TOP, e], m[CARRIED + TENSION_TOP, e] = mean, S
        if kind == BDF2:
            share = 1.0 - exp(-2.0 * stage.q * rate / GAMMA)
        m[CARRIED + SQUARE, e] = m[SQUARE, e] + share * (over * over - m[SQUARE, e])
        m[HAT, e], m[HELD, e] = mean, 1.0
    _hold_ghosts(law, rope, stage, n)


@jit
def _settled(law: Any, rope: Any, stage: Any, k: int, e: int) -> Any:
    """Return ε_m and ε - ε_m of the material at the end of a converged stage."""
    m = law.memory
    held, hat, stiff, strain = m[HELD, e], m[HAT, e], m[STIFF, e], _strain(rope, e)
    mean = held * hat + (1.0 - held) * strain
    S, slope = relaxed_at(law.table, k, _working(m, e), mean)
    if S + stiff * (strain - mean) > 0.0:
        return mean, strain - mean
    # slack: ε_m + (q/(E_d·τ))·S(ε_m) = HAT; S is smooth and rises, below HAT where S(HAT) > 0
    g = stage.q * rope.sections[RELAXATION, k] / stiff
    mean = hat
    for _ in range(NEWTON_STEPS):
        S, slope = relaxed_at(law.table, k, _working(m, e), mean)
        step = (mean + g * S - hat) / (1.0 + g * slope)
        mean -= step
        if abs(step) <= 1e-16 + 1e-15 * abs(mean):
            break
    S, slope = relaxed_at(law.table, k, _working(m, e), mean)
    return mean, -S / stiff


@jit
def _hold_ghosts(law: Any, rope: Any, stage: Any, n: int) -> None:
    """Give the ghost elements of a split or merge, and a new top element, the top one's values.

    The lower ghost is the merged element while rope is hauled in. The upper one is in the next
    section, at the same mean tension, where that has come over the sheave.
    """
    m, sections, slots = law.memory, rope.sections, rope.state.s.shape[0]
    top = n - 1
    merged = n - 2 if stage.V < 0.0 and n > 1 else top
    above = section_above(sections, rope.state.s[top])
    if above + 1 < sections.shape[1] and sections[END, above] < rope.state.s[n]:
        above += 1
    for slot in range(slots - TRIALS, slots):
        _copy_element(m, merged if slot == slots - TRIALS else top, slot)
    _copy_element(m, top, n)
    for r in range(CARRIED):  # a node at a connection has no element above it
        m[CARRIED + r, n] = m[CARRIED + r, top]
    if above == int(rope.work[SECTION, top]):
        return
    for slot in (n, slots - TRIALS + 1):
        if sections[RELAXATION, above] == 0.0:
            _relax(law, rope, above, slot)
            continue
        _begin(law, sections, above, slot, 1.0)
        m[HAT, slot] = m[MEAN, slot]


@jit
def _copy_element(m: Any, source: int, target: int) -> None:
    """Copy the stage's values of one element to those of another."""
    for r in range(CARRIED):
        m[r, target] = m[CARRIED + r, source]
    for r in range(START, BEND + 1):
        m[r, target] = m[r, source]


remembering(Fibre, CARRIED)
