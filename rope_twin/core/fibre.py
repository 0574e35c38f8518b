"""Internal variables of a fibre rope: the relaxed strain ε_m, and its history.

Each element follows core/axial_law: T = S(ε_m) + E_d·(ε - ε_m), dε_m/dt = (T - S(ε_m))/(E_d·τ).

**Dynamic stiffness.** Tests give E_d as a linear function of the mean tension M = S(ε_m), and for
polyester of the amplitude too (Del Vecchio 1992; Francois and Davies 2008): E_d = a + b·M - c·A.
The tension amplitude A is E_d times √2 of the running root mean square of ε - ε_m over τ (exact for
a harmonic motion), so that E_d = (a + b·M)/(1 + c·√2·rms). It is at least the tangent of S, since
the solid would create energy otherwise, and constant within a step.

**Working curves** (Syrope: Falkenberg, Åhjem and Yang 2017, OTC-27761). The table is the original
curve, which a rope follows while its mean tension is the maximum in its history. Below that it
follows a working curve from the point (ε_h, T_h) of the maximum mean tension to the permanent
strain ε_p = k·ε_h: T = T_h·ξ·(1 - m + m·ξ), ξ = (ε_m - ε_p)/(ε_h - ε_p). T_h rises with M, from
the tension at installation.

**Energy.** W(ε_m) + S·e + E_d·e²/2 with e = ε - ε_m is stored; the rest of T·dε is dissipated, at
the rate (E_d - S')·e²/τ, plus on the original curve the part that the working curve does not
recover.

Where the top element splits or merges, the elements inherit its values. Rope from the drum starts
with those of the element at the sheave, or, where a section begins, with the same mean tension.
"""

from __future__ import annotations

from math import exp, nan, sqrt
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
from rope_twin.core.jit.functions import anywhere, by_type, by_width
from rope_twin.core.jit.wide import choose, whole
from rope_twin.core.loads.hooks import kernel
from rope_twin.core.loads.memory import declare_internal_variables, new_memory
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


def new_fibre(capacity: int) -> Fibre:
    """Return the internal variables of a fibre rope with space for `room` nodes, all zero."""
    return Fibre(new_memory(CARRIED, OWN_ROWS, capacity))


@jit
def strain_on_table(table: Any, section: int, tension: float) -> float:
    """Return the strain at which a section's table has this tension [N]; the table is monotone."""
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
def _set_working(law: Any, sections: Any, k: int, e: int, highest: Any, top: Any) -> None:
    """Set the working curve of element e of section k: from the mean tension `highest` at `top`."""
    m, permanent = law.memory, sections[PERMANENT, k]
    m[INITIAL, e] = 0.0
    works = (permanent > 0.0) & (highest > 0.0)
    if not anywhere(works):
        return
    span, curvature = (1.0 - permanent) * top, sections[CURVATURE, k]
    m[UPPER, e], m[LOWER, e] = top, permanent * top
    m[INITIAL, e] = choose(works, highest * (1.0 - curvature) / span, 0.0)
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
def _dynamic(sections: Any, k: int, M: Any, square: Any, slope: Any) -> Any:
    """Return E_d [N] at the mean tension M, mean square of ε - ε_m, and tangent of S."""
    stiff = (sections[DYNAMIC, k] + sections[PER_TENSION, k] * M) / (
        1.0 + sections[PER_AMPLITUDE, k] * sqrt(2.0 * square)
    )
    return max(stiff, slope)


@jit
def _adopt_one(m: Any, law: Any, sections: Any, k: int, e: int, others: Any, held: Any) -> Any:
    M, highest = m[TENSION_MEAN, e], m[TENSION_TOP, e]
    if sections[PERMANENT, k] > 0.0:
        highest = max(highest, M, sections[HIGHEST, k])
        m[TOP, e], m[TENSION_TOP, e] = strain_on_table(law.table, k, highest), highest
    _set_working(law, sections, k, e, highest, m[TOP, e])
    m[MEAN, e] = _strain_at(law, k, e, M)
    return held


@jit
def _reject_lanes(m: Any, law: Any, sections: Any, k: int, e: int, others: Any, held: Any) -> Any:
    return choose(others, nan, held)


# Convert the values of element e to section k at the same mean tension; return HELD. In lanes whose
# values are of another section (mask `others`) it is NaN, which rejects the step there.
_adopt = by_width(_adopt_one, _reject_lanes)


@jit
def _begin(law: Any, sections: Any, k: int, e: int, held: Any) -> None:
    """Set START, E_d and the working curve of element e from its carried values."""
    m = law.memory
    _set_working(law, sections, k, e, m[TENSION_TOP, e], m[TOP, e])
    S, slope = relaxed_at(law.table, k, _working(m, e), m[MEAN, e])
    M = m[TENSION_MEAN, e]
    other_section = abs(S - M) > SAME_TENSION * (abs(S) + abs(M) + 1.0)
    if anywhere(other_section):
        held = _adopt(m, law, sections, k, e, other_section, held)
        S, slope = relaxed_at(law.table, k, _working(m, e), m[MEAN, e])
    m[START, e], m[HELD, e] = m[MEAN, e], held
    m[STIFF, e] = _dynamic(sections, k, max(S, 0.0), m[SQUARE, e], slope)


@jit
def _relax_one(m: Any, law: Any, rope: Any, k: int, e: int) -> None:
    sections, highest = rope.sections, rope.sections[HIGHEST, k]
    m[HELD, e], m[HAT, e], m[TOP, e] = 0.0, 0.0, 0.0
    if sections[PERMANENT, k] > 0.0:
        m[TOP, e] = strain_on_table(law.table, k, highest)
    _set_working(law, sections, k, e, highest, m[TOP, e])
    m[TENSION_TOP, e] = highest


@jit
def _relax_lanes(m: Any, law: Any, rope: Any, k: int, e: int) -> None:
    m[HELD, e] = m[HAT, e] = m[TOP, e] = m[TENSION_TOP, e] = m[INITIAL, e] = 0.0


# Make element e follow the static curve S: in a section without relaxation, and in a static
# solution.
_relax = by_width(_relax_one, _relax_lanes)


@jit
def _reject_at_border(m: Any, rope: Any) -> None:
    n = rope.state.counts[ELEMENTS]
    k = whole(rope.work[SECTION, n - 1])
    if k + 1 < rope.sections.shape[1]:
        over = rope.sections[END, k] < rope.state.s[n]
        m[HELD, n - 1] = choose(over, nan, m[HELD, n - 1])


@jit
def _reject_none(m: Any, rope: Any) -> None:
    """Do nothing: one rope begins the next section (`_hold_next`)."""


# Reject the step in lanes where the next section has come over the sheave.
_reject_at_section_end = by_width(_reject_none, _reject_at_border)


@jit
def _predict(law: Any, rope: Any, stage: Any, kind: int, low: int, high: int) -> None:
    m, work, sections = law.memory, rope.work, rope.sections
    for e in range(low, high):
        k = whole(work[SECTION, e])
        rate = sections[RELAXATION, k]
        moves = rate > 0.0
        if not anywhere(moves) or stage.time <= 0.0:
            _relax(m, law, rope, k, e)
            continue
        held = choose(moves, 1.0 / (1.0 + stage.q * rate), nan)  # NaN rejects the lane's step
        if kind == TRAPEZOID:
            _begin(law, sections, k, e, held)
            m[HAT, e] = m[START, e] + stage.q * rate * m[OVER, e]
        else:
            m[HAT, e], m[HELD, e] = K1 * m[MIDDLE, e] - K2 * m[START, e], held
    _reject_at_section_end(m, rope)


# Predict the internal variables of the elements low <= e < high; other laws have none.
predict_law = by_type(
    FibreLaw,
    lambda law, rope, stage, kind, low, high: _predict(law, rope, stage, kind, low, high),
    lambda law, rope, stage, kind, low, high: None,
)


@jit
def _freeze(law: Any, rope: Any) -> None:
    m, work = law.memory, rope.work
    for e in range(rope.state.counts[ELEMENTS]):
        if rope.sections[RELAXATION, int(work[SECTION, e])] > 0.0:
            m[HAT, e], m[HELD, e] = m[MEAN, e], 1.0


# Freeze ε_m at its value at the start of the step; other laws have no ε_m.
freeze_mean_strain = by_type(FibreLaw, lambda law, rope: _freeze(law, rope), lambda law, rope: None)


@jit_within
def _strain(rope: Any, e: int) -> Any:
    """Return the strain of element e in scratch."""
    work, rest = rope.work, rope.work[REST, e]
    square = STRETCH2_MIN * rest * rest
    for k in range(POSITION, POSITION + 3):
        difference = work[k, e + 1] - work[k, e]
        square += difference * difference
    return (sqrt(square) + rope.state.offset[e] - rest) / rest


@kernel("start", Fibre)
def start(fibre: Any, rope: Any, upto: int) -> None:
    """Initialise ε_m to the strain of the static equilibrium, or of zero tension where slack."""
    law, m, sections = sections_law(rope), fibre.memory, rope.sections
    for e in range(rope.state.counts[ELEMENTS]):
        k = int(rope.work[SECTION, e])
        _relax(m, law, rope, k, e)
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


@kernel("predict", Fibre, wide=True)
def predict(fibre: Any, rope: Any, stage: Any, kind: int, low: int, high: int) -> None:
    """Do nothing: the prediction precedes the evaluation of tensions (`predict_law`)."""


@kernel("settle", Fibre, wide=True)
def settle(fibre: Any, rope: Any, stage: Any, kind: int, upto: int) -> None:
    """Store the internal variables of a converged stage; then freeze ε_m for splits and merges."""
    law, m, work, sections = sections_law(rope), fibre.memory, rope.work, rope.sections
    n, last = rope.state.counts[ELEMENTS], -1
    smoothing = 0.0 * sections[RELAXATION, 0]
    if stage.time <= 0.0:
        return
    for e in range(n):
        k = whole(work[SECTION, e])
        rate = sections[RELAXATION, k]
        if not anywhere(rate > 0.0):  # initial values for a fibre section above
            strain = _strain(rope, e)
            S, m[STIFF, e] = relaxed_at(law.table, k, _working(m, e), strain)
            m[CARRIED + MEAN, e], m[CARRIED + TENSION_MEAN, e] = strain, max(S, 0.0)
            continue
        mean, over = _settled(law, rope, stage, k, e)
        S, _ = relaxed_at(law.table, k, _working(m, e), mean)
        m[MIDDLE, e] = mean
        m[CARRIED + MEAN, e], m[CARRIED + TENSION_MEAN, e], m[CARRIED + OVER, e] = mean, S, over
        rises = (sections[PERMANENT, k] > 0.0) & (mean > m[TOP, e])
        m[CARRIED + TOP, e] = choose(rises, mean, m[TOP, e])
        m[CARRIED + TENSION_TOP, e] = choose(rises, S, m[TENSION_TOP, e])
        if kind == BDF2 and k != last:
            smoothing, last = 1.0 - exp(-2.0 * stage.q * rate / GAMMA), k
        m[CARRIED + SQUARE, e] = m[SQUARE, e] + smoothing * (over * over - m[SQUARE, e])
        m[HAT, e], m[HELD, e] = mean, 1.0
    _set_ghosts(m, law, rope, stage, n)


@jit
def _settled(law: Any, rope: Any, stage: Any, k: int, e: int) -> Any:
    """Return ε_m and ε - ε_m of the material at the end of a converged stage."""
    m = law.memory
    held, hat, stiff, strain = m[HELD, e], m[HAT, e], m[STIFF, e], _strain(rope, e)
    mean = held * hat + (1.0 - held) * strain
    S, slope = relaxed_at(law.table, k, _working(m, e), mean)
    over = strain - mean
    slack = S + stiff * over <= 0.0
    if not anywhere(slack):
        return mean, over
    # slack: ε_m + (q/(E_d·τ))·S(ε_m) = HAT; S is smooth and rises, below HAT where S(HAT) > 0
    g = stage.q * rope.sections[RELAXATION, k] / stiff
    root, active = hat, slack
    for _ in range(NEWTON_STEPS):
        S, slope = relaxed_at(law.table, k, _working(m, e), root)
        step = (root + g * S - hat) / (1.0 + g * slope)
        root = choose(active, root - step, root)
        active = active & (abs(step) > 1e-16 + 1e-15 * abs(root))
        if not anywhere(active):
            break
    S, slope = relaxed_at(law.table, k, _working(m, e), root)
    return choose(slack, root, mean), choose(slack, -S / stiff, over)


@jit
def _set_ghosts(m: Any, law: Any, rope: Any, stage: Any, n: int) -> None:
    """Copy the top element's values to the ghost elements of a split or merge and to a new element.

    During haul-in the lower ghost is the merged element. If the next section has come over the
    sheave, the upper ghost belongs to it, at the same mean tension.
    """
    slots, top = rope.state.s.shape[0], n - 1
    for slot in range(slots - TRIALS, slots):
        _copy_element(m, top, slot)
    _copy_merged(m, max(n - 2, 0), slots - TRIALS, stage.V < 0.0)
    _copy_element(m, top, n)
    for r in range(CARRIED):  # a node at a connection has no element above it
        m[CARRIED + r, n] = m[CARRIED + r, top]
    _set_next_section(m, law, rope, n)


@jit
def _set_next(m: Any, law: Any, rope: Any, n: int) -> None:
    sections, slots, top = rope.sections, rope.state.s.shape[0], n - 1
    above = section_above(sections, rope.state.s[top])
    if above + 1 < sections.shape[1] and sections[END, above] < rope.state.s[n]:
        above += 1
    if above == int(rope.work[SECTION, top]):
        return
    for slot in (n, slots - TRIALS + 1):
        if sections[RELAXATION, above] == 0.0:
            _relax(m, law, rope, above, slot)
            continue
        _begin(law, sections, above, slot, 1.0)
        m[HAT, slot] = m[MEAN, slot]


@jit
def _set_none(m: Any, law: Any, rope: Any, n: int) -> None:
    """Do nothing: lanes give such steps up (`_leave_at_border`)."""


# Initialise the section that has come over the sheave.
_set_next_section = by_width(_set_next, _set_none)


@jit
def _copy_element(m: Any, source: int, target: int) -> None:
    """Copy the stage's values of one element to those of another."""
    for r in range(CARRIED):
        m[r, target] = m[CARRIED + r, source]
    for r in range(START, BEND + 1):
        m[r, target] = m[r, source]


@jit
def _copy_merged(m: Any, source: int, target: int, hauled: Any) -> None:
    """Copy the stage's values of one element to those of another where rope is hauled in."""
    if not anywhere(hauled):
        return
    for r in range(CARRIED):
        m[r, target] = choose(hauled, m[CARRIED + r, source], m[r, target])
    for r in range(START, BEND + 1):
        m[r, target] = choose(hauled, m[r, source], m[r, target])


declare_internal_variables(Fibre, CARRIED)
