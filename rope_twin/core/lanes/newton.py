"""Newton's method of a stage in SIMD lanes, over ropes or systems of ropes (core/lanes/system).

It is that of `core/newton`. A lane that has converged is frozen while others iterate, and keeps the
factors of its last elimination, with which its BDF2 stage begins; a lane that they do not solve is
corrected with new ones. As in a single rope the last correction of the nodes stays pending: the
next prediction, or the step's end, adds it. A lane that needs the line search is given up.
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
from rope_twin.core.joined.linear_solver import push_lanes, solve_lanes
from rope_twin.core.joined.stage import (
    begin_trial,
    by_kind,
    correct_connections,
    count_left_at_connections,
    count_loaded,
    count_ropes,
    count_unbalanced,
    gather_connections,
    look_ahead_in_rope,
    move_connections,
    pass_sheave,
    place_all_ends,
    rope_at,
    stage_of,
    tolerance_of,
)
from rope_twin.core.lanes.effects import calm_lanes, on_lanes, predict_lanes, prepare_lanes
from rope_twin.core.loads.balance import (
    load_lowest,
    load_of,
    load_remembering,
    load_rows,
    set_block,
    set_flow,
)
from rope_twin.core.loads.hooks import chosen_by, couples
from rope_twin.core.newton import CHUNK, RESIDUAL_SHARE, SEARCH_FROM, count_left
from rope_twin.core.pentadiagonal import eliminate_coupled_wide, push_coupled_wide, take_links_wide
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
from rope_twin.core.tridiagonal import eliminate_wide, push_wide, substitute_wide

SPAN = 4


@jit
def solve_stage(system: Any, stage: Any, kind: int, wanted: int, again: int, pending: Any) -> Any:
    """Solve for the acceleration; tension then belongs to the stage's time.

    wanted: active lanes, as bits; again: lanes that begin with the existing factors; pending:
    fraction of CORRECTION still to be added to the previous motion, of each lane. Returns the lanes
    that did not converge, of each lane the number of solutions with existing factors and that of
    corrections with new ones, and the fraction of CORRECTION that is still to be added to the
    stage's motion.
    """
    _evaluate(system, stage, kind, pending)
    again = wanted & _lanes_to_try(system, again)
    again &= _calm(system, stage, again, 0.0)
    none = 0.0 * tolerance_of(system)
    active, count, going = wanted & (ALL - again), none, none
    tried = choose(mask_of(again), 1.0, 0.0)
    if again != 0:
        left = again & _try_factors(system, stage, tried)
        left |= _restless(system, stage, again & (ALL - left))
        going = choose(mask_of(again & (ALL - left)), 1.0, 0.0)
        active |= left
        if active == 0:
            return 0, tried, count, going
        _return_connections(system, stage, left)
        _correct(system, stage, going)
        if left != 0:
            _reload(system, stage, left, active & (ALL - left))
        else:  # the trial changed the residuals of the connections
            gather_connections(system, stage)
    for correction in range(1, SEARCH_FROM + 1):
        going = choose(mask_of(active), 1.0, 0.0)
        count += going
        agreeing = active & _solve_ahead(system, stage, active, going)
        left = _restless(system, stage, agreeing)
        active &= ALL - (agreeing & (ALL - left))
        if active == 0 or (correction == SEARCH_FROM and left == 0):
            break
        _correct(system, stage, going)
        going = none
        _reload(system, stage, active, 0)
        if left != 0:
            active &= ALL - (left & _balanced(system))
            if active == 0:
                break
    if bits(going > 0.0) != wanted:  # some converged before the others
        _correct(system, stage, going)  # the look ahead moved all by a correction not theirs
        going = none
    return active, tried, count, going


_unless_bent = chosen_by(couples, lambda effects, again: 0, lambda effects, again: again)


@jit
def _unless_turned(sheaves: Any, again: int) -> int:
    if sheaves is None:
        return again
    return 0


@by_kind(lambda system, again: again)
def _lanes_to_try(system: Any, again: Any) -> Any:
    """Return those of these lanes that begin with existing factors.

    As alone, none with bending or sheaves.
    """
    return _unless_bent(system.stack.effects, _unless_turned(system.sheaves, again))


@jit
def _calm(system: Any, stage: Any, lanes: int, share: float) -> int:
    """Return those of these lanes in which no active set is changed by share·delta."""
    calm = lanes
    for r in range(count_ropes(system)):
        rope, own = rope_at(system, r), on_lanes(stage_of(system, stage, r), calm)
        calm &= calm_lanes(rope.effects, rope.work, own, count_loaded(system, r), share)
    return int(calm)


@jit
def _restless(system: Any, stage: Any, lanes: int) -> int:
    """Return those of these lanes that an active set keeps from being solved by the correction."""
    return int(lanes & (ALL - _calm(system, stage, lanes, 1.0)))


@jit
def _balanced(system: Any) -> int:
    """Return the lanes with all residuals below the tolerance, none NaN."""
    fine = ALL & (ALL - count_unbalanced(system))
    for r in range(count_ropes(system)):
        rope = rope_at(system, r)
        Rx, Ry, Rz = rows(rope.work, RESIDUAL, 0)
        most = rope.model.tolerance * rope.model.tolerance
        for i in range(rope.model.first_free, rope.state.counts[ELEMENTS]):
            fine &= bits(Rx[i] * Rx[i] + Ry[i] * Ry[i] + Rz[i] * Rz[i] <= most)
    return int(fine)


@jit
def _correct(system: Any, stage: Any, share: Any) -> None:
    """Apply a share of the correction to the ropes, of each lane its own; set their elements."""
    place_all_ends(system)
    for r in range(count_ropes(system)):
        rope, own = rope_at(system, r), stage_of(system, stage, r)
        n = rope.state.counts[ELEMENTS]
        correct(rope.work, stage.p, stage.q, share, rope.model.first_free, n)
        pass_sheave(system, rope, r, 0.0, 0.0)
        stretch_all(rope, own)


@by_kind(lambda system, stage, left: None)
def _return_connections(system: Any, stage: Any, left: Any) -> Any:
    """Take back the correction of the connections in these lanes, as a lone system does."""
    move_connections(system, stage, SEARCH, choose(mask_of(left), -1.0, 0.0))


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
    prepare_lanes(rope.effects, rope, stage, kind)
    for chunk in range(0, n, CHUNK):
        end = min(chunk + CHUNK, n)
        for start in range(chunk, end, SPAN):
            low, high = max(start, first), min(start + SPAN, end)
            if kind == TRAPEZOID:
                predict_trapezoid(state.nodes, work, p, q, low, high)
            else:
                predict_bdf2(state.nodes, work, p, q, pending, low, high)
            stretch(law_of(rope), work, state.offset, p, q, max(start - 1, 0), high - 1)
        done, last = max(chunk - 1, 0), end - 1
        if end == n:
            last = upto
            pass_sheave(system, rope, r, 0.0, 0.0)
            stretch(law_of(rope), work, state.offset, p, q, n - 1, n)
            if upto > n:
                end_rope(work, n)
        set_flow(rope.effects, work, stage, done, last)
        predict_lanes(rope.effects, rope, stage, kind, done, last)
        _load_nodes(rope.effects, work, stage, max(done, 1), last)
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

    Each tangent is computed one node ahead: its root and division are done while the loads of the
    node before it are summed.
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
    load_remembering(effects, work, stage, low, high, True)


@jit
def _reload(system: Any, stage: Any, lanes: int, others: int) -> None:
    """Evaluate residual and blocks of these lanes, whose motion and tension are up to date.

    others: lanes that keep theirs.
    """
    for r in range(count_ropes(system)):
        rope, own = rope_at(system, r), on_lanes(stage_of(system, stage, r), lanes)
        n, upto = rope.state.counts[ELEMENTS], count_loaded(system, r)
        if upto > n:
            end_rope(rope.work, n)
        if others != 0:
            _store_loads(rope.work, upto)
        _load_nodes(rope.effects, rope.work, own, 1, upto)
        load_lowest(rope.effects, rope.work, own)
        add_couplings(rope.effects, rope.work, own, n, upto)
        if others != 0:
            _restore_loads(rope.work, upto, mask_of(others))
    gather_connections(system, stage)


@jit
def _store_loads(work: Any, upto: int) -> None:
    """Copy residual and blocks to the rows KEPT, which lanes do not use otherwise."""
    for i in range(upto):
        for k in range(3):
            work[KEPT + k, i] = work[RESIDUAL + k, i]
        for k in range(6):
            work[KEPT + 3 + k, i] = work[BLOCK + k, i]


@jit
def _restore_loads(work: Any, upto: int, others: Any) -> None:
    """Copy them back in the lanes `others`."""
    for i in range(upto):
        for k in range(3):
            work[RESIDUAL + k, i] = choose(others, work[KEPT + k, i], work[RESIDUAL + k, i])
        for k in range(6):
            work[BLOCK + k, i] = choose(others, work[KEPT + 3 + k, i], work[BLOCK + k, i])


@jit
def _push_links(work: Any, first: int, n: int, tried: Any) -> None:
    """Solve with the existing factors; subtract the effect of couplings in the lanes `tried`."""
    push_coupled_wide(work, first, n)
    take_links_wide(work, n, tried)


@jit
def _push_chain(work: Any, first: int, n: int) -> None:
    """Solve with the existing factors."""
    push_wide(work, first, n)
    substitute_wide(work, first, n, 0, (n - first - 1) // 2)


_push = chosen_by(
    couples,
    lambda effects, work, first, n, tried: _push_links(work, first, n, tried),
    lambda effects, work, first, n, tried: _push_chain(work, first, n),
)


@jit
def _try_rope(rope: Any, stage: Any, share: Any) -> Any:
    """Solve with the existing factors; return the lanes that this leaves with a residual."""
    _push(rope.effects, rope.work, rope.model.first_free, rope.state.counts[ELEMENTS], share > 0.0)
    return count_left(rope, stage, CHUNK)


@by_kind(lambda system, stage, share: _try_rope(system, stage, share))
def _try_factors(system: Any, stage: Any, share: Any) -> Any:
    """Solve with the existing factors; return the lanes that this leaves with a residual.

    share: 1 in the lanes that are tried, whose connections are corrected, else 0.
    """
    return _try_joined(system.sheaves, system, stage, share)


@jit
def _try_joined(sheaves: Any, system: Any, stage: Any, share: Any) -> int:
    if sheaves is not None:
        return ALL
    push_lanes(system)
    begin_trial(system, stage, share)
    left = 0
    for r in range(count_ropes(system)):
        left |= count_left(rope_at(system, r), stage_of(system, stage, r), CHUNK)
    return int(left | count_left_at_connections(system, RESIDUAL_SHARE * tolerance_of(system)))


@jit
def _look_ahead(rope: Any, stage: Any, active: int) -> int:
    """Solve; return the lanes whose tensions agree with their linearisation, were motion corrected.

    Direction and tension are set as if it were. It proceeds from the middle outward, in the order
    of the back-substitution.
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
def _look_ahead_bent(rope: Any, stage: Any, active: int) -> int:
    """Do the same for a rope in which an effect couples nodes."""
    n = rope.state.counts[ELEMENTS]
    eliminate_coupled_wide(rope.work, rope.model.first_free, n, mask_of(active))
    return int(ALL - count_unexpected(rope, stage, ZERO, n))


_look = chosen_by(
    couples,
    lambda effects, rope, stage, active: _look_ahead_bent(rope, stage, active),
    lambda effects, rope, stage, active: _look_ahead(rope, stage, active),
)


@by_kind(lambda system, stage, active, share: _look(system.effects, system, stage, active))
def _solve_ahead(system: Any, stage: Any, active: Any, share: Any) -> Any:
    """Solve; return the lanes whose tensions agree with their linearisation, were motion corrected.

    Direction and tension are set as if it were, and connections are corrected: by `share`, which is
    1 in the active lanes and 0 in others.
    """
    solve_lanes(system, mask_of(active))
    unexpected = correct_connections(system, stage, share)
    for r in range(count_ropes(system)):
        rope, own = rope_at(system, r), stage_of(system, stage, r)
        unexpected |= look_ahead_in_rope(system, rope, own, r)
    return ALL - unexpected
