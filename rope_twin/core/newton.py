"""Semismooth Newton method for one implicit stage, x = x_hat + p·a and v = v_hat + q·a.

The unknowns a are the accelerations of all nodes and connections of a system or a single rope
(core/joined/stage). The tension-only strain energy is convex in a, so the minimum is unique. A
stage has converged when every tension agrees with its linearisation and, where an effect has an
active set, every node and connection is in balance. From the fourth correction on, a secant line
search prevents oscillation between slack and taut.

**Factor reuse** (simplified Newton). Both stages of a step have the same weights p and q, and the
rope changes little between them. If the first stage needed one correction, the second tries the
factors of the first, at a third of the cost of an elimination. The second stage evaluates its own
loads and blocks, and the residual after the correction is computed from them: the change of the
element forces exactly, that of the loads by the node block.
"""

from __future__ import annotations

from math import isfinite
from typing import Any

from numba import types
from numba.extending import overload

from rope_twin.core.axial_law import law_of, sections_law
from rope_twin.core.elements import end_rope, find_change, stretch
from rope_twin.core.fibre import predict_law
from rope_twin.core.integrator import (
    BDF2,
    CONVERGED,
    NOT_FINITE,
    PENDING,
    SEARCH,
    TRAPEZOID,
    UNCONVERGED,
    correct,
    predict_bdf2,
    predict_trapezoid,
)
from rope_twin.core.jit.decorators import LINKED, jit
from rope_twin.core.jit.rows import end_to_end, rows, span
from rope_twin.core.jit.wide import count_beyond
from rope_twin.core.joined.chains import add_couplings
from rope_twin.core.joined.linear_solver import reduce_system, solve_system
from rope_twin.core.joined.stack import effects_at
from rope_twin.core.joined.stage import (
    begin_trial,
    by_system_type,
    correct_connections,
    count_left_at_connections,
    count_loaded,
    count_ropes,
    count_unbalanced,
    gather_connections,
    health_of,
    look_ahead_in_rope,
    move_connections,
    pass_sheave,
    rope_at,
    slope_of_connections,
    stage_of,
    tolerance_of,
)
from rope_twin.core.loads import hooks
from rope_twin.core.loads.balance import (
    is_active_set_unchanged,
    load_lowest,
    load_nodes,
    set_flow,
    slope,
)
from rope_twin.core.loads.memory import predict_internal_variables, prepare_axial
from rope_twin.core.pentadiagonal import eliminate_coupled, reduce_coupled, take_links
from rope_twin.core.state import (
    BLOCK,
    CHANGE,
    CORRECTION,
    ELEMENTS,
    RESIDUAL,
    REST,
    SOLVES,
    SOLVES_MAX,
    ZERO,
    Floats,
    Rope,
    Stage,
)
from rope_twin.core.tridiagonal import eliminate, reduce

SEARCH_FROM = 4  # the first correction with a line search
SEARCH_EVALUATIONS = 8
# Residual tolerance at a node over the tension tolerance: residuals of many nodes may add up.
RESIDUAL_SHARE = 1e-3
MAX_CORRECTIONS = 12  # corrections before the step is divided into substeps
# Slack elements in a row become taut one per correction, so the shortest substep allows more
# corrections; they converge, since the energy is convex.
MAX_CORRECTIONS_LAST = 200
CHUNK = 64  # nodes per chunk of all passes: their rows fit into the L1 cache


@jit
def _reduce_links(work: Floats, first: int, n: int) -> None:
    """Solve with the existing factors; subtract the effect of the couplings from the residual."""
    reduce_coupled(end_to_end(work), first, n)
    take_links(work, n)


# Solve the block-tridiagonal equations of a rope, or block-pentadiagonal ones where an effect
# couples second neighbours; `_push` does so with the existing factors.
_eliminate = hooks.selected_by(
    hooks.couples,
    lambda effects, work, first, n: eliminate_coupled(end_to_end(work), first, n),
    lambda effects, work, first, n: eliminate(end_to_end(work), first, n),
)
_push = hooks.selected_by(
    hooks.couples,
    lambda effects, work, first, n: _reduce_links(work, first, n),
    lambda effects, work, first, n: reduce(end_to_end(work), first, n),
)


@by_system_type(
    lambda system: _eliminate(
        system.effects, system.work, system.model.first_free, system.state.counts[ELEMENTS]
    )
)
def _solve(system: Any) -> Any:
    """Solve for the corrections of all nodes and connections."""
    solve_system(system)


@by_system_type(
    lambda system: _push(
        system.effects, system.work, system.model.first_free, system.state.counts[ELEMENTS]
    )
)
def _solve_with_factors(system: Any) -> Any:
    """Solve with the existing factors."""
    reduce_system(system)


@jit
def solve_stage(
    system: Any, stage: Stage, kind: int, max_corrections: int, pending: float, reuse: bool
) -> int:
    """Solve a stage for the accelerations, leaving its motion and tensions in the work arrays.

    kind: TRAPEZOID or BDF2; pending: fraction of CORRECTION still to be added to the previous
    motion; reuse: try the existing factors first. Returns PENDING if the last correction is still
    to be added to the motion of the nodes, CONVERGED, UNCONVERGED, or NOT_FINITE if a force is not.
    Corrections are counted in the health of the first rope.
    """
    health = health_of(system)[0]
    _evaluate(system, stage, kind, pending, 0.0)
    if reuse and _is_solved_by_reuse(system, stage):
        return PENDING
    for correction in range(1, max_corrections + 1):
        _solve(system)
        health[SOLVES] += 1
        health[SOLVES_MAX] = max(health[SOLVES_MAX], correction)
        unexpected = _look_ahead(system, stage)
        if unexpected == 0 and _keeps_active_sets(system, stage, 1.0):
            return PENDING
        before = _slope(system)
        if not isfinite(before):
            return NOT_FINITE
        _evaluate(system, stage, SEARCH, 1.0, 0.0)
        if (
            unexpected == 0
            and _has_active_sets(rope_at(system, ZERO).effects)
            and count_residuals(system) == 0
        ):
            return CONVERGED
        if correction >= SEARCH_FROM:
            _line_search(system, stage, before)
    return UNCONVERGED


@jit
def _evaluate_rope(
    system: Any, rope: Any, stage: Stage, kind: int, fraction: float, r: int
) -> None:
    """Evaluate rope r in chunks of nodes; the motion of its end nodes is already set."""
    state, work, p, q = rope.state, rope.work, stage.p, stage.q
    n, upto = state.counts[ELEMENTS], count_loaded(system, r)
    law = law_of(rope)
    if kind != SEARCH:
        prepare_axial(rope.effects, rope, stage, kind)
    for start in range(0, n, CHUNK):
        low, high = max(start, rope.model.first_free), min(start + CHUNK, n)
        if kind == TRAPEZOID:
            predict_trapezoid(state.nodes, work, p, q, low, high)
        elif kind == BDF2:
            predict_bdf2(state.nodes, work, p, q, fraction, low, high)
        else:
            correct(work, p, q, fraction, low, high)
        lowest, last = max(start - 1, 0), n if high == n else high - 1
        if high == n:
            pass_sheave(system, rope, r, 0.0, 0.0)
        if kind != SEARCH:
            predict_law(sections_law(rope), rope, stage, kind, lowest, last)
        stretch(law, work, state.offset, p, q, lowest, last)
        if high == n:
            last = upto
            if upto > n:
                end_rope(work, n)
        if kind != SEARCH:
            set_flow(rope.effects, work, stage, lowest, last)
            predict_internal_variables(rope.effects, rope, stage, kind, lowest, last)
        load_nodes(rope.effects, work, stage, max(lowest, 1), last)
    load_lowest(rope.effects, work, stage)
    add_couplings(rope.effects, work, stage, n, upto)


@jit
def _evaluate(
    system: Any, stage: Stage, kind: int, fraction: float, fraction_at_joints: float
) -> None:
    """Evaluate motion, tension, residual and blocks of the system.

    The stage is predicted after a += fraction·delta; for SEARCH only that correction is applied.
    fraction_at_joints: that of the connections, which are corrected before the nodes.
    """
    move_connections(system, stage, kind, fraction_at_joints)
    for r in range(count_ropes(system)):
        rope = rope_at(system, r)
        _evaluate_rope(system, rope, stage_of(system, stage, r), kind, fraction, r)
    gather_connections(system, stage)


@jit
def _look_ahead(system: Any, stage: Stage) -> int:
    """Correct the connections; set directions and tensions of the corrected ropes.

    Returns the number of tensions that deviate from their linearisation.
    """
    unexpected = correct_connections(system, stage, 1.0)
    for r in range(count_ropes(system)):
        rope = rope_at(system, r)
        unexpected += look_ahead_in_rope(system, rope, stage_of(system, stage, r), r)
    return int(unexpected)


# Whether an effect has an active set, so that the tension criterion is not sufficient.
_has_active_sets = hooks.selected_by(
    hooks.have_active_sets, lambda effects: True, lambda effects: False
)


@jit
def _keeps_active_sets(system: Any, stage: Stage, fraction: float) -> bool:
    """Return whether fraction·delta leaves all active sets unchanged."""
    unchanged = True
    for r in range(count_ropes(system)):
        rope, n = rope_at(system, r), count_loaded(system, r)
        unchanged = unchanged and is_active_set_unchanged(
            rope.effects, rope.work, stage, n, fraction
        )
    return unchanged


@jit
def count_residuals(system: Any) -> int:
    """Return nonzero (in lanes: bits) if a residual is above the tolerance, or NaN."""
    count = count_unbalanced(system)
    for r in range(count_ropes(system)):
        rope = rope_at(system, r)
        Rx, Ry, Rz = rows(rope.work, RESIDUAL, 0)
        limit2 = rope.model.tolerance * rope.model.tolerance
        for i in range(rope.model.first_free, rope.state.counts[ELEMENTS]):
            count = count_beyond(count, Rx[i] * Rx[i] + Ry[i] * Ry[i] + Rz[i] * Rz[i], 0.0, limit2)
    return int(count)


@jit
def _is_solved_by_factors(system: Any, stage: Stage) -> bool:
    """Return whether one correction with the existing factors solves the stage.

    If not, motion, tensions and blocks are those of the prediction.
    """
    if not _keeps_active_sets(system, stage, 0.0):
        return False
    _solve_with_factors(system)
    health_of(system)[0][SOLVES] += 1
    if _count_left(system, stage) == 0 and _keeps_active_sets(system, stage, 1.0):
        return True
    _evaluate(system, stage, SEARCH, 0.0, -1.0)
    return False


def _reuse_joined(sheaves: Any, effects: Any, system: Any, stage: Any) -> bool:
    """Return whether reused factors solve the stage; not tried with sheaves or coupled nodes."""
    if sheaves is None and not hooks.couples(map(type, effects)):
        return bool(_is_solved_by_factors(system, stage))
    return False


@overload(_reuse_joined, jit_options=LINKED, strict=False)
def _choose_reuse(sheaves: Any, effects: Any, system: Any, stage: Any) -> Any:
    kinds = [effect.instance_class for effect in effects]
    if isinstance(sheaves, types.NoneType) and not hooks.couples(kinds):
        return lambda sheaves, effects, system, stage: _is_solved_by_factors(system, stage)
    return lambda sheaves, effects, system, stage: False


@by_system_type(lambda system, stage: _is_solved_by_factors(system, stage))
def _is_solved_by_reuse(system: Any, stage: Any) -> Any:
    """Return whether one correction with the existing factors solves the stage, if applicable."""
    return _reuse_joined(system.sheaves, effects_at(system.stack.effects, ZERO), system, stage)


@jit
def _count_left(system: Any, stage: Stage) -> int:
    """Return nonzero if a node or connection has a residual after the correction.

    Connections are corrected; directions and tensions are those of corrected nodes.
    """
    begin_trial(system, stage, 1.0)
    count = 0
    for r in range(count_ropes(system)):
        count |= count_left(rope_at(system, r), stage_of(system, stage, r), CHUNK)
    return int(count | count_left_at_connections(system, RESIDUAL_SHARE * tolerance_of(system)))


@jit
def count_left(rope: Rope, stage: Stage, chunk: int) -> int:
    """Return nonzero (for SIMD batches: lane bits) if a node has a residual after the correction.

    Directions and tensions are set to those of the corrected motion. The nodes lag the elements by
    one. Column e - start + 2 of CHANGE belongs to element e; it is zero below the lowest element.
    """
    work, n, first = rope.work, rope.state.counts[ELEMENTS], rope.model.first_free
    zero, count = 0.0 * work[REST, 0], 0
    for k in range(CHANGE, CHANGE + 3):
        work[k, 1] = zero
    for start in range(0, n, chunk):
        end = min(start + chunk, n)
        lowest, last = max(start - 1, 0), n if end == n else end - 1
        find_change(rope, stage, lowest, last, lowest - start + 2)
        count |= _count(rope, max(start - 1, first), last, start)
        for k in range(CHANGE, CHANGE + 3):
            work[k, 0] = work[k, last - start + 1]
    return count


@jit
def _count(rope: Rope, low: int, high: int, start: int) -> int:
    """Return nonzero if one of the nodes low <= i < high has a residual."""
    work, tolerance = rope.work, RESIDUAL_SHARE * rope.model.tolerance
    fx, fy, fz = rows(work, CHANGE, low - start + 2)
    gx, gy, gz = rows(work, CHANGE, low - start + 1)
    Rx, Ry, Rz = rows(work, RESIDUAL, low)
    dx, dy, dz = rows(work, CORRECTION, low)
    Axx, Axy, Axz, Ayy, Ayz, Azz = span(work, BLOCK, 6, low)
    count = 0
    for i in range(high - low):
        x = Rx[i] + (fx[i] - gx[i]) - (Axx[i] * dx[i] + Axy[i] * dy[i] + Axz[i] * dz[i])
        y = Ry[i] + (fy[i] - gy[i]) - (Axy[i] * dx[i] + Ayy[i] * dy[i] + Ayz[i] * dz[i])
        z = Rz[i] + (fz[i] - gz[i]) - (Axz[i] * dx[i] + Ayz[i] * dy[i] + Azz[i] * dz[i])
        count = count_beyond(count, abs(x) + abs(y) + abs(z), 0.0, tolerance)
    return count


@jit
def _line_search(system: Any, stage: Stage, before: float) -> None:
    """Line search along the correction until |R·delta| is at most half its start value `before`.

    Secant steps with a bracket that starts as (0, 1).
    """
    low, slope_low, high, slope_high = 0.0, before, 1.0, 0.0
    factor, slope_here = 1.0, _slope(system)
    for evaluation in range(SEARCH_EVALUATIONS):
        if slope_here < -0.5 * before:
            high, slope_high = factor, slope_here
        elif evaluation > 0 and slope_here > 0.5 * before:
            low, slope_low = factor, slope_here
        else:
            return
        target = _secant(low, slope_low, high, slope_high)
        _evaluate(system, stage, SEARCH, target - factor, target - factor)
        factor, slope_here = target, _slope(system)


@jit
def _secant(low: float, slope_low: float, high: float, slope_high: float) -> float:
    """Return the zero of the secant through the bracket's ends, clamped to 5 to 95 % of it."""
    span = high - low
    cross = low + span * slope_low / (slope_low - slope_high)
    return min(max(cross, low + 0.05 * span), high - 0.05 * span)


@jit
def _slope(system: Any) -> Any:
    """Return R·delta summed over all ropes and connections."""
    total = slope_of_connections(system)
    for r in range(count_ropes(system)):
        rope = rope_at(system, r)
        total += slope(rope.work, rope.model.first_free, rope.state.counts[ELEMENTS])
    return total
