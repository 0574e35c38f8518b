"""One implicit stage, x = x_hat + p·a and v = v_hat + q·a, solved for a by semismooth Newton.

The unknowns are the accelerations of all nodes and connections of a system, be it one rope
(core/joined/stage). The tension-only energy is convex in a, so there is one minimum. A stage is
accepted when every tension agrees with its linearisation and, where an effect has an active set,
every node and connection is balanced; from the fourth correction on a secant line search keeps
Newton's method from overshooting between slack and taut (full steps suffice before).

**Factor reuse** (simplified Newton). Both stages of a step have the same weights p and q, and the
rope changes little between them. Where the first needed one correction, the second tries the
first's factors: that costs a third of an elimination. Its loads and blocks are still its own, and
the residual after the correction is evaluated with them: the change of both element forces exactly,
that of the loads by the block.
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
from rope_twin.core.joined.linear_solver import push_system, solve_system
from rope_twin.core.joined.stack import effects_at
from rope_twin.core.joined.stage import (
    begin_trial,
    by_kind,
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
from rope_twin.core.loads.balance import is_calm, load_lowest, load_nodes, set_flow, slope
from rope_twin.core.loads.memory import predict_memories, prepare_axial
from rope_twin.core.pentadiagonal import eliminate_coupled, push_coupled, take_links
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
from rope_twin.core.tridiagonal import eliminate, push

SEARCH_FROM = 4  # the first correction with a line search
SEARCH_EVALUATIONS = 8
# Residual tolerance at a node over that of a tension: residuals of many nodes may add up.
RESIDUAL_SHARE = 1e-3
MAX_CORRECTIONS = 12  # corrections before the step is divided into substeps
# A row of slack elements becomes taut one by one, one correction each: at the shortest substep more
# corrections are allowed (the energy is convex, so they converge).
MAX_CORRECTIONS_LAST = 200
CHUNK = 64  # nodes per chunk of all passes: their rows fit into the nearest cache


@jit
def _push_links(work: Floats, first: int, n: int) -> None:
    """Solve with the previous factors; subtract the effect of the couplings from the residual."""
    push_coupled(end_to_end(work), first, n)
    take_links(work, n)


# Solve the chain of a rope, in which an effect may couple nodes; and with the existing factors.
_eliminate = hooks.chosen_by(
    hooks.couples,
    lambda effects, work, first, n: eliminate_coupled(end_to_end(work), first, n),
    lambda effects, work, first, n: eliminate(end_to_end(work), first, n),
)
_push = hooks.chosen_by(
    hooks.couples,
    lambda effects, work, first, n: _push_links(work, first, n),
    lambda effects, work, first, n: push(end_to_end(work), first, n),
)


@by_kind(
    lambda system: _eliminate(
        system.effects, system.work, system.model.first_free, system.state.counts[ELEMENTS]
    )
)
def _solve(system: Any) -> Any:
    """Solve for the corrections of all nodes and connections."""
    solve_system(system)


@by_kind(
    lambda system: _push(
        system.effects, system.work, system.model.first_free, system.state.counts[ELEMENTS]
    )
)
def _solve_again(system: Any) -> Any:
    """Solve with the existing factors."""
    push_system(system)


@jit
def solve_stage(system: Any, stage: Stage, kind: int, cap: int, pending: float, again: bool) -> int:
    """Solve for the accelerations; tensions and motion are then the stage's.

    kind: TRAPEZOID or BDF2; cap: maximum number of corrections; pending: fraction of CORRECTION
    still to be added to the previous motion; again: begin with the existing factors. Returns
    PENDING if the last correction is still to be added to the motion of the nodes, CONVERGED,
    UNCONVERGED, or NOT_FINITE if a force is not. Corrections are counted by the first rope.
    """
    health = health_of(system)[0]
    _evaluate(system, stage, kind, pending, 0.0)
    if again and _is_solved_again(system, stage):
        return PENDING
    for correction in range(1, cap + 1):
        _solve(system)
        health[SOLVES] += 1
        health[SOLVES_MAX] = max(health[SOLVES_MAX], correction)
        unexpected = _look_ahead(system, stage)
        if unexpected == 0 and _is_calm(system, stage, 1.0):
            return PENDING
        before = _slope(system)
        if not isfinite(before):
            return NOT_FINITE
        _evaluate(system, stage, SEARCH, 1.0, 0.0)
        if unexpected == 0 and _switches(rope_at(system, ZERO).effects) and _is_balanced(system):
            return CONVERGED
        if correction >= SEARCH_FROM:
            _search(system, stage, before)
    return UNCONVERGED


@jit
def _evaluate_rope(system: Any, rope: Any, stage: Stage, kind: int, share: float, r: int) -> None:
    """Evaluate rope r, in chunks of nodes; those at connections are in place."""
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
            predict_bdf2(state.nodes, work, p, q, share, low, high)
        else:
            correct(work, p, q, share, low, high)
        done, last = max(start - 1, 0), n if high == n else high - 1
        if high == n:
            pass_sheave(system, rope, r, 0.0, 0.0)
        if kind != SEARCH:
            predict_law(sections_law(rope), rope, stage, kind, done, last)
        stretch(law, work, state.offset, p, q, done, last)
        if high == n:
            last = upto
            if upto > n:
                end_rope(work, n)
        if kind != SEARCH:
            set_flow(rope.effects, work, stage, done, last)
            predict_memories(rope.effects, rope, stage, kind, done, last)
        load_nodes(rope.effects, work, stage, max(done, 1), last)
    load_lowest(rope.effects, work, stage)
    add_couplings(rope.effects, work, stage, n, upto)


@jit
def _evaluate(system: Any, stage: Stage, kind: int, share: float, at_joints: float) -> None:
    """Evaluate motion, tension, residual and blocks of the system.

    Motion is predicted after a += share·delta, or (SEARCH) only that is applied; at_joints: the
    share of the connections, which are corrected ahead of the nodes.
    """
    move_connections(system, stage, kind, at_joints)
    for r in range(count_ropes(system)):
        rope = rope_at(system, r)
        _evaluate_rope(system, rope, stage_of(system, stage, r), kind, share, r)
    gather_connections(system, stage)


@jit
def _look_ahead(system: Any, stage: Stage) -> int:
    """Correct the connections; set direction and tension as if the ropes were corrected too.

    Returns the number of deviating tensions.
    """
    unexpected = correct_connections(system, stage, 1.0)
    for r in range(count_ropes(system)):
        rope = rope_at(system, r)
        unexpected += look_ahead_in_rope(system, rope, stage_of(system, stage, r), r)
    return int(unexpected)


# Whether effects have active sets, so that tensions alone do not show convergence.
_switches = hooks.chosen_by(hooks.switches, lambda effects: True, lambda effects: False)


@jit
def _is_calm(system: Any, stage: Stage, share: float) -> bool:
    """Return whether no active set differs between the present motion and that with share·delta."""
    calm = True
    for r in range(count_ropes(system)):
        rope, n = rope_at(system, r), count_loaded(system, r)
        calm = calm and is_calm(rope.effects, rope.work, stage, n, share)
    return calm


@jit
def _is_balanced(system: Any) -> bool:
    """Return whether all residuals of nodes and connections are below the tolerance, none NaN."""
    left = count_unbalanced(system)
    for r in range(count_ropes(system)):
        rope = rope_at(system, r)
        Rx, Ry, Rz = rows(rope.work, RESIDUAL, 0)
        most = rope.model.tolerance * rope.model.tolerance
        for i in range(rope.model.first_free, rope.state.counts[ELEMENTS]):
            left += not Rx[i] * Rx[i] + Ry[i] * Ry[i] + Rz[i] * Rz[i] <= most
    return bool(left == 0)


@jit
def _is_solved_by_factors(system: Any, stage: Stage) -> bool:
    """Return whether one correction with the last elimination's factors solves the stage.

    If not, motion, tension and blocks are those of the prediction.
    """
    if not _is_calm(system, stage, 0.0):
        return False
    _solve_again(system)
    health_of(system)[0][SOLVES] += 1
    if _count_all_left(system, stage) == 0 and _is_calm(system, stage, 1.0):
        return True
    _evaluate(system, stage, SEARCH, 0.0, -1.0)
    return False


def _try_joined(sheaves: Any, effects: Any, system: Any, stage: Any) -> bool:
    """Return whether factors solve the stage; they are not tried with sheaves or bent ropes."""
    if sheaves is None and not hooks.couples(map(type, effects)):
        return bool(_is_solved_by_factors(system, stage))
    return False


@overload(_try_joined, jit_options=LINKED, strict=False)
def _choose_trial(sheaves: Any, effects: Any, system: Any, stage: Any) -> Any:
    kinds = [effect.instance_class for effect in effects]
    if isinstance(sheaves, types.NoneType) and not hooks.couples(kinds):
        return lambda sheaves, effects, system, stage: _is_solved_by_factors(system, stage)
    return lambda sheaves, effects, system, stage: False


@by_kind(lambda system, stage: _is_solved_by_factors(system, stage))
def _is_solved_again(system: Any, stage: Any) -> Any:
    """Return whether one correction with the last factors solves the stage, where it is tried."""
    return _try_joined(system.sheaves, effects_at(system.stack.effects, ZERO), system, stage)


@jit
def _count_all_left(system: Any, stage: Stage) -> int:
    """Return nonzero if a node or connection has a residual after the correction.

    Connections are then corrected; direction and tension are set as if nodes were too.
    """
    begin_trial(system, stage, 1.0)
    left = 0
    for r in range(count_ropes(system)):
        left |= count_left(rope_at(system, r), stage_of(system, stage, r), CHUNK)
    return int(left | count_left_at_connections(system, RESIDUAL_SHARE * tolerance_of(system)))


@jit
def count_left(rope: Rope, stage: Stage, chunk: int) -> int:
    """Return nonzero (for SIMD batches: lane bits) if a node has a residual after the correction.

    Direction and tension are set as if motion were corrected. Nodes follow one behind the elements.
    Column e - start + 2 of CHANGE belongs to element e; below the lowest there is none.
    """
    work, n, first = rope.work, rope.state.counts[ELEMENTS], rope.model.first_free
    none, left = 0.0 * work[REST, 0], 0
    for k in range(CHANGE, CHANGE + 3):
        work[k, 1] = none
    for start in range(0, n, chunk):
        end = min(start + chunk, n)
        done, last = max(start - 1, 0), n if end == n else end - 1
        find_change(rope, stage, done, last, done - start + 2)
        left |= _count(rope, max(start - 1, first), last, start)
        for k in range(CHANGE, CHANGE + 3):
            work[k, 0] = work[k, last - start + 1]
    return left


@jit
def _count(rope: Rope, low: int, high: int, start: int) -> int:
    """Return nonzero if one of the nodes low <= i < high has a residual."""
    work, least = rope.work, RESIDUAL_SHARE * rope.model.tolerance
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
        count = count_beyond(count, abs(x) + abs(y) + abs(z), 0.0, least)
    return count


@jit
def _search(system: Any, stage: Stage, before: float) -> None:
    """Move along the correction until |R·delta| is at most half of `before`, its start value.

    Secant steps in a bracket that starts as (0, 1).
    """
    low, slope_low, high, slope_high = 0.0, before, 1.0, 0.0
    factor, here = 1.0, _slope(system)
    for evaluation in range(SEARCH_EVALUATIONS):
        if here < -0.5 * before:
            high, slope_high = factor, here
        elif evaluation > 0 and here > 0.5 * before:
            low, slope_low = factor, here
        else:
            return
        target = _secant(low, slope_low, high, slope_high)
        _evaluate(system, stage, SEARCH, target - factor, target - factor)
        factor, here = target, _slope(system)


@jit
def _secant(low: float, slope_low: float, high: float, slope_high: float) -> float:
    """Return the zero of the secant through the bracket's ends, inside 5 to 95 % of it."""
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
