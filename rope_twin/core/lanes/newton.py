"""Newton's method of a stage in SIMD lanes, for ropes or systems of ropes (core/lanes/system).

The algorithm is that of `core/newton`. A converged lane is masked while others iterate, and keeps
the factors of its last elimination, which its BDF2 stage tries first; if they do not solve the
stage, the lane is corrected with new factors. As in a single rope the last correction of the nodes
stays pending until the next prediction or the end of the step. A lane that needs the line search is
returned as unconverged.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

from rope_twin.core.axial_law import law_of, sections_law
from rope_twin.core.elements import count_unexpected, end_rope, stretch, stretch_all
from rope_twin.core.fibre import predict_law
from rope_twin.core.integrator import SEARCH, TRAPEZOID, correct, predict_bdf2, predict_trapezoid
from rope_twin.core.jit.decorators import jit, jit_within
from rope_twin.core.jit.rows import row, rows, span
from rope_twin.core.jit.wide import ALL, bits, choose, mask_of
from rope_twin.core.joined.chains import add_couplings
from rope_twin.core.joined.linear_solver import reduce_lanes, solve_lanes
from rope_twin.core.joined.stage import (
    begin_trial,
    by_system_type,
    correct_connections,
    count_left_at_connections,
    count_loaded,
    count_ropes,
    gather_connections,
    look_ahead_in_rope,
    move_connections,
    pass_sheave,
    place_all_ends,
    rope_at,
    stage_of,
    tolerance_of,
)
from rope_twin.core.lanes.effects import on_lanes, unchanged_lanes
from rope_twin.core.loads.balance import (
    load_lowest,
    load_of,
    load_rows,
    load_with_variables,
    set_block,
    set_flow,
)
from rope_twin.core.loads.hooks import couples, selected_by
from rope_twin.core.loads.memory import predict_internal_variables, prepare_axial
from rope_twin.core.newton import (
    CHUNK,
    RESIDUAL_SHARE,
    SEARCH_FROM,
    count_left,
    count_residuals,
)
from rope_twin.core.pentadiagonal import (
    eliminate_coupled_wide,
    reduce_coupled_wide,
    take_links_wide,
)
from rope_twin.core.state import (
    BLOCK,
    DIRECTION,
    ELEMENTS,
    KEPT,
    RESIDUAL,
    TANGENT2_MIN,
    TENSION,
    ZERO,
)
from rope_twin.core.tridiagonal import eliminate_wide, reduce_wide, substitute_wide

SPAN = 4


@jit
def solve_stage(system: Any, stage: Any, kind: int, wanted: int, reuse: int, pending: Any) -> Any:
    """Solve a stage for the accelerations, leaving its motion and tensions in the work arrays.

    wanted: active lanes, as bits; reuse: lanes that try the existing factors first; pending:
    fraction of CORRECTION still to be added to the previous motion, per lane. Returns the lanes
    that did not converge, the number of solutions with existing factors and with new ones per lane,
    and the fraction of CORRECTION that is still to be added to the stage's motion.
    """
    _evaluate(system, stage, kind, pending)
    reuse = wanted & _lanes_to_try(system, reuse)
    reuse &= _unchanged_active_sets(system, stage, reuse, 0.0)
    zero = 0.0 * tolerance_of(system)
    active, count, correcting = wanted & (ALL - reuse), zero, zero
    tried = choose(mask_of(reuse), 1.0, 0.0)
    if reuse != 0:
        unsettled = reuse & _try_factors(system, stage, tried)
        unsettled |= _changing_active_sets(system, stage, reuse & (ALL - unsettled))
        correcting = choose(mask_of(reuse & (ALL - unsettled)), 1.0, 0.0)
        active |= unsettled
        if active == 0:
            return 0, tried, count, correcting
        _return_connections(system, stage, unsettled)
        _correct(system, stage, correcting)
        if unsettled != 0:
            _reload(system, stage, unsettled, active & (ALL - unsettled))
        else:  # the trial overwrote the residuals of the connections
            gather_connections(system, stage)
    for correction in range(1, SEARCH_FROM + 1):
        correcting = choose(mask_of(active), 1.0, 0.0)
        count += correcting
        agreeing = active & _solve_ahead(system, stage, active, correcting)
        unsettled = _changing_active_sets(system, stage, agreeing)
        active &= ALL - (agreeing & (ALL - unsettled))
        if active == 0 or (correction == SEARCH_FROM and unsettled == 0):
            break
        _correct(system, stage, correcting)
        correcting = zero
        _reload(system, stage, active, 0)
        if unsettled != 0:
            active &= (ALL - unsettled) | count_residuals(system)
            if active == 0:
                break
    if bits(correcting > 0.0) != wanted:  # some lanes converged earlier
        _correct(system, stage, correcting)  # restores their directions and tensions
        correcting = zero
    return active, tried, count, correcting


_unless_bent = selected_by(couples, lambda effects, again: 0, lambda effects, again: again)


@jit
def _unless_sheaves(sheaves: Any, again: int) -> int:
    if sheaves is None:
        return again
    return 0


@by_system_type(lambda system, again: again)
def _lanes_to_try(system: Any, again: Any) -> Any:
    """Return those of these lanes that try the existing factors; none with bending or sheaves."""
    return _unless_bent(system.stack.effects, _unless_sheaves(system.sheaves, again))


@jit
def _unchanged_active_sets(system: Any, stage: Any, lanes: int, fraction: float) -> int:
    """Return those of these lanes in which fraction·delta leaves all active sets unchanged."""
    unchanged = lanes
    for r in range(count_ropes(system)):
        rope, rope_stage = rope_at(system, r), on_lanes(stage_of(system, stage, r), unchanged)
        unchanged &= unchanged_lanes(
            rope.effects, rope.work, rope_stage, count_loaded(system, r), fraction
        )
    return int(unchanged)


@jit
def _changing_active_sets(system: Any, stage: Any, lanes: int) -> int:
    """Return those of these lanes in which the correction changes an active set."""
    return int(lanes & (ALL - _unchanged_active_sets(system, stage, lanes, 1.0)))


@jit
def _correct(system: Any, stage: Any, fraction: Any) -> None:
    """Apply a fraction of the correction, per lane, to the ropes; update their elements."""
    place_all_ends(system)
    for r in range(count_ropes(system)):
        rope, rope_stage = rope_at(system, r), stage_of(system, stage, r)
        n = rope.state.counts[ELEMENTS]
        correct(rope.work, stage.p, stage.q, fraction, rope.model.first_free, n)
        pass_sheave(system, rope, r, 0.0, 0.0)
        stretch_all(rope, rope_stage)


@by_system_type(lambda system, stage, lanes: None)
def _return_connections(system: Any, stage: Any, lanes: Any) -> Any:
    """Revert the correction of the connections in these lanes, as in a single system."""
    move_connections(system, stage, SEARCH, choose(mask_of(lanes), -1.0, 0.0))


@jit
def _evaluate(system: Any, stage: Any, kind: int, pending: Any) -> None:
    """Evaluate motion, tension, residual and blocks of the prediction."""
    move_connections(system, stage, kind, 0.0)
    for r in range(count_ropes(system)):
        _evaluate_rope(system, rope_at(system, r), stage_of(system, stage, r), kind, pending, r)
    gather_connections(system, stage)


@jit
def _evaluate_rope(system: Any, rope: Any, stage: Any, kind: int, pending: Any, r: int) -> None:
    """Evaluate the prediction of rope r, in spans of nodes."""
    state, work, p, q = rope.state, rope.work, stage.p, stage.q
    n, first, upto = state.counts[ELEMENTS], rope.model.first_free, count_loaded(system, r)
    predict_law(sections_law(rope), rope, stage, kind, n - n, n)
    prepare_axial(rope.effects, rope, stage, kind)
    for chunk in range(0, n, CHUNK):
        end = min(chunk + CHUNK, n)
        for start in range(chunk, end, SPAN):
            low, high = max(start, first), min(start + SPAN, end)
            if kind == TRAPEZOID:
                predict_trapezoid(state.nodes, work, p, q, low, high)
            else:
                predict_bdf2(state.nodes, work, p, q, pending, low, high)
            stretch(law_of(rope), work, state.offset, p, q, max(start - 1, 0), high - 1)
        lowest, last = max(chunk - 1, 0), end - 1
        if end == n:
            last = upto
            pass_sheave(system, rope, r, 0.0, 0.0)
            stretch(law_of(rope), work, state.offset, p, q, n - 1, n)
            if upto > n:
                end_rope(work, n)
        set_flow(rope.effects, work, stage, lowest, last)
        predict_internal_variables(rope.effects, rope, stage, kind, lowest, last)
        _load_nodes(rope.effects, work, stage, max(lowest, 1), last)
    load_lowest(rope.effects, work, stage)
    add_couplings(rope.effects, work, stage, n, upto)


@jit_within
def _tangent(above: Any, below: Any, i: int) -> Any:
    """Return the unit tangent of a node, from the directions of both adjacent elements."""
    x, y, z = below[0][i] + above[0][i], below[1][i] + above[1][i], below[2][i] + above[2][i]
    inverse = 1.0 / sqrt(x * x + y * y + z * z + TANGENT2_MIN)
    return x * inverse, y * inverse, z * inverse


@jit
def _load_nodes(effects: Any, work: Any, stage: Any, low: int, high: int) -> None:
    """Set residual and block of the nodes 1 <= low <= i < high, as `balance.load_nodes` does.

    Each tangent is computed one node ahead, so that its root and division overlap with the loads of
    the previous node.
    """
    nodes = load_rows(work, low)
    T, T_below = row(work, TENSION, low), row(work, TENSION, low - 1)
    above, below = rows(work, DIRECTION, low), rows(work, DIRECTION, low - 1)
    tx, ty, tz = above
    bx, by, bz = below
    Rx, Ry, Rz = rows(work, RESIDUAL, low)
    block = span(work, BLOCK, 6, low)
    tangent = _tangent(above, below, 0)
    for i in range(high - low):
        following = _tangent(above, below, i + 1)
        load = load_of(effects, stage, nodes, tangent, i)
        Rx[i] = T[i] * tx[i] - T_below[i] * bx[i] + load.x
        Ry[i] = T[i] * ty[i] - T_below[i] * by[i] + load.y
        Rz[i] = T[i] * tz[i] - T_below[i] * bz[i] + load.z
        set_block(block, i, load)
        tangent = following
    load_with_variables(effects, work, stage, low, high, True)


@jit
def _reload(system: Any, stage: Any, lanes: int, others: int) -> None:
    """Evaluate residual and blocks of these lanes, whose motion and tension are up to date.

    others: mask of the lanes whose residual and blocks are preserved.
    """
    for r in range(count_ropes(system)):
        rope, rope_stage = rope_at(system, r), on_lanes(stage_of(system, stage, r), lanes)
        n, upto = rope.state.counts[ELEMENTS], count_loaded(system, r)
        if upto > n:
            end_rope(rope.work, n)
        if others != 0:
            _store_loads(rope.work, upto)
        _load_nodes(rope.effects, rope.work, rope_stage, 1, upto)
        load_lowest(rope.effects, rope.work, rope_stage)
        add_couplings(rope.effects, rope.work, rope_stage, n, upto)
        if others != 0:
            _restore_loads(rope.work, upto, mask_of(others))
    gather_connections(system, on_lanes(stage, lanes))


@jit
def _store_loads(work: Any, upto: int) -> None:
    """Save residual and blocks in the rows KEPT, which are unused in lanes."""
    for i in range(upto):
        for k in range(3):
            work[KEPT + k, i] = work[RESIDUAL + k, i]
        for k in range(6):
            work[KEPT + 3 + k, i] = work[BLOCK + k, i]


@jit
def _restore_loads(work: Any, upto: int, others: Any) -> None:
    """Restore residual and blocks in the lanes `others`."""
    for i in range(upto):
        for k in range(3):
            work[RESIDUAL + k, i] = choose(others, work[KEPT + k, i], work[RESIDUAL + k, i])
        for k in range(6):
            work[BLOCK + k, i] = choose(others, work[KEPT + 3 + k, i], work[BLOCK + k, i])


@jit
def _reduce_links(work: Any, first: int, n: int, tried: Any) -> None:
    """Solve with the existing factors; subtract the effect of couplings in the lanes `tried`."""
    reduce_coupled_wide(work, first, n)
    take_links_wide(work, n, tried)


@jit
def _reduce_chain(work: Any, first: int, n: int) -> None:
    """Solve with the existing factors."""
    reduce_wide(work, first, n)
    substitute_wide(work, first, n, 0, (n - first - 1) // 2)


_push = selected_by(
    couples,
    lambda effects, work, first, n, tried: _reduce_links(work, first, n, tried),
    lambda effects, work, first, n, tried: _reduce_chain(work, first, n),
)


@jit
def _try_rope(rope: Any, stage: Any, fraction: Any) -> Any:
    """Solve with the existing factors; return the lanes with a remaining residual."""
    _push(
        rope.effects, rope.work, rope.model.first_free, rope.state.counts[ELEMENTS], fraction > 0.0
    )
    return count_left(rope, stage, CHUNK)


@by_system_type(lambda system, stage, fraction: _try_rope(system, stage, fraction))
def _try_factors(system: Any, stage: Any, fraction: Any) -> Any:
    """Solve with the existing factors; return the lanes with a remaining residual.

    fraction: 1 in the lanes that are tried, whose connections are corrected, else 0.
    """
    return _try_joined(system.sheaves, system, stage, fraction)


@jit
def _try_joined(sheaves: Any, system: Any, stage: Any, fraction: Any) -> int:
    if sheaves is not None:
        return ALL
    reduce_lanes(system)
    begin_trial(system, stage, fraction)
    remaining = 0
    for r in range(count_ropes(system)):
        remaining |= count_left(rope_at(system, r), stage_of(system, stage, r), CHUNK)
    return int(remaining | count_left_at_connections(system, RESIDUAL_SHARE * tolerance_of(system)))


@jit
def _look_ahead(rope: Any, stage: Any, active: int) -> int:
    """Solve; return the lanes whose corrected tensions agree with their linearisation.

    Directions and tensions are set to those of the corrected motion, from the middle outward, in
    the order of the back-substitution.
    """
    work, first, n = rope.work, rope.model.first_free, rope.state.counts[ELEMENTS]
    eliminate_wide(work, first, n, mask_of(active))
    pairs = (n - first - 1) // 2
    unexpected = count_unexpected(rope, stage, first + pairs, n - pairs - 1)
    for high in range(pairs, 0, -SPAN):
        low = max(high - SPAN, 0)
        substitute_wide(work, first, n, low, high)
        unexpected |= count_unexpected(rope, stage, first + low, first + high)
        unexpected |= count_unexpected(rope, stage, n - high - 1, n - low - 1)
    unexpected |= count_unexpected(rope, stage, 0, first)
    unexpected |= count_unexpected(rope, stage, n - 1, n)
    return int(ALL - unexpected)


@jit
def _look_ahead_coupled(rope: Any, stage: Any, active: int) -> int:
    """Solve as `_look_ahead`, for a rope in which an effect couples nodes."""
    n = rope.state.counts[ELEMENTS]
    eliminate_coupled_wide(rope.work, rope.model.first_free, n, mask_of(active))
    return int(ALL - count_unexpected(rope, stage, ZERO, n))


_look = selected_by(
    couples,
    lambda effects, rope, stage, active: _look_ahead_coupled(rope, stage, active),
    lambda effects, rope, stage, active: _look_ahead(rope, stage, active),
)


@by_system_type(
    lambda system, stage, active, fraction: _look(system.effects, system, stage, active)
)
def _solve_ahead(system: Any, stage: Any, active: Any, fraction: Any) -> Any:
    """Solve; return the lanes whose corrected tensions agree with their linearisation.

    Directions and tensions are set to those of the corrected motion, and connections are corrected
    by `fraction`, which is 1 in the active lanes and 0 in others.
    """
    solve_lanes(system, mask_of(active))
    unexpected = correct_connections(system, stage, fraction)
    for r in range(count_ropes(system)):
        rope, rope_stage = rope_at(system, r), stage_of(system, stage, r)
        unexpected |= look_ahead_in_rope(system, rope, rope_stage, r)
    return ALL - unexpected
