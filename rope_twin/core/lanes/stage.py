"""One implicit stage of a SIMD batch: Newton's method as in `core/newton`.

A lane that has converged is frozen while others iterate, and keeps the factors of its last
elimination, with which its BDF2 stage begins (core/newton). As in a single rope the last correction
stays pending: the next prediction, or the step's end, adds it. Rare cases are excluded: a lane that
needs the line search, or whose factors cannot be reused, is dropped, and its rope takes the step in
the single-rope solver.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

from rope_twin.core.axial_law import law_of
from rope_twin.core.elements import count_unexpected, stretch, stretch_all
from rope_twin.core.guards import TANGENT2_MIN
from rope_twin.core.integrator import TRAPEZOID, correct, predict_bdf2, predict_trapezoid
from rope_twin.core.jit.decorators import jit, jit_within
from rope_twin.core.jit.rows import row, rows, span
from rope_twin.core.jit.wide import ALL, bits, choose, mask_of
from rope_twin.core.lanes.by_lane import on_lanes
from rope_twin.core.lanes.elimination import eliminate_wide, push_wide, substitute_wide
from rope_twin.core.lanes.memory import calm_lanes, predict_lanes
from rope_twin.core.loads.balance import (
    load_lowest,
    load_of,
    load_remembering,
    load_rows,
    set_flow,
)
from rope_twin.core.newton import CHUNK, SEARCH_FROM, count_left
from rope_twin.core.state import BLOCK, DIRECTION, ELEMENTS, RESIDUAL, TENSION

SPAN = 4


@jit
def solve_stage(rope: Any, stage: Any, kind: int, wanted: int, again: int, pending: Any) -> Any:
    """Solve for the acceleration; tension then belongs to the stage's time.

    wanted: active lanes, as bits; again: lanes that begin with the existing factors; pending:
    fraction of CORRECTION still to be added to the previous motion, of each lane. Returns the lanes
    that did not converge, the number of corrections of each lane, and the fraction of CORRECTION
    that is still to be added to the stage's motion.
    """
    n, first = rope.state.counts[ELEMENTS], rope.model.first_free
    _evaluate(rope, stage, kind, pending)
    again &= wanted
    again &= calm_lanes(rope.effects, rope.work, on_lanes(stage, again), n, 0.0)
    none = 0.0 * rope.model.tolerance
    active, given_up, count, going = wanted & (ALL - again), 0, none, none
    if again != 0:
        push_wide(rope.work, first, n)
        substitute_wide(rope.work, first, n, 0, (n - first - 1) // 2)
        given_up = again & count_left(rope, stage, CHUNK)
        given_up |= _restless(rope, stage, again & (ALL - given_up))
        going = choose(mask_of(again & (ALL - given_up)), 1.0, 0.0)
        count += choose(mask_of(again), 1.0, 0.0)
        if active == 0:
            return given_up, count, going
        correct(rope.work, stage.p, stage.q, going, first, n)
        stretch_all(rope, stage)
    for correction in range(1, SEARCH_FROM + 1):
        eliminate_wide(rope.work, first, n, mask_of(active))
        going = choose(mask_of(active), 1.0, 0.0)
        count += going
        agreeing = active & _look_ahead(rope, stage)
        left = _restless(rope, stage, agreeing)
        active &= ALL - (agreeing & (ALL - left))
        if active == 0 or (correction == SEARCH_FROM and left == 0):
            break
        correct(rope.work, stage.p, stage.q, going, first, n)
        going = none
        stretch_all(rope, stage)
        _reload(rope, on_lanes(stage, active))
        if left != 0:
            active &= ALL - (left & _balanced(rope))
            if active == 0:
                break
    if bits(going > 0.0) != wanted & (ALL - given_up):  # some converged before the others
        correct(rope.work, stage.p, stage.q, going, first, n)
        stretch_all(rope, stage)  # the look ahead moved them by a correction that is not theirs
        going = none
    return active | given_up, count, going


@jit
def _restless(rope: Any, stage: Any, lanes: int) -> int:
    """Return those of these lanes that an active set keeps from being solved by the correction."""
    n = rope.state.counts[ELEMENTS]
    calm = calm_lanes(rope.effects, rope.work, on_lanes(stage, lanes), n, 1.0)
    return int(lanes & (ALL - calm))


@jit
def _balanced(rope: Any) -> int:
    """Return the lanes with all residuals below the tolerance, none NaN."""
    Rx, Ry, Rz = rows(rope.work, RESIDUAL, 0)
    most, fine = rope.model.tolerance * rope.model.tolerance, ALL
    for i in range(rope.model.first_free, rope.state.counts[ELEMENTS]):
        fine &= bits(Rx[i] * Rx[i] + Ry[i] * Ry[i] + Rz[i] * Rz[i] <= most)
    return int(fine)


@jit
def _evaluate(rope: Any, stage: Any, kind: int, pending: Any) -> None:
    """Evaluate motion, tension, residual and blocks of the prediction, in spans of nodes."""
    state, work, p, q = rope.state, rope.work, stage.p, stage.q
    n, first = state.counts[ELEMENTS], rope.model.first_free
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
            last = n
            stretch(law_of(rope), work, state.offset, p, q, n - 1, n)
        set_flow(rope.effects, work, stage, done, last)
        predict_lanes(rope.effects, rope, stage, kind, done, last)
        _load_nodes(rope.effects, work, stage, max(done, 1), last)
    load_lowest(rope.effects, work, stage)


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
    Axx, Axy, Axz, Ayy, Ayz, Azz = span(work, BLOCK, 6, low)
    tangent = _tangent(above, below, 0)
    for i in range(high - low):
        following = _tangent(above, below, i + 1)
        load = load_of(effects, stage, nodes, tangent, i)
        Rx[i] = T[i] * tx[i] - T_below[i] * bx[i] + load.x
        Ry[i] = T[i] * ty[i] - T_below[i] * by[i] + load.y
        Rz[i] = T[i] * tz[i] - T_below[i] * bz[i] + load.z
        Axx[i] = load.xx
        Axy[i] = load.xy
        Axz[i] = load.xz
        Ayy[i] = load.yy
        Ayz[i] = load.yz
        Azz[i] = load.zz
        tangent = following
    load_remembering(effects, work, stage, low, high, True)


@jit
def _reload(rope: Any, stage: Any) -> None:
    """Evaluate residual and blocks where motion and tension are up to date."""
    _load_nodes(rope.effects, rope.work, stage, 1, rope.state.counts[ELEMENTS])
    load_lowest(rope.effects, rope.work, stage)


@jit
def _look_ahead(rope: Any, stage: Any) -> int:
    """Return the lanes whose tensions agree with their linearisation, were motion corrected.

    Direction and tension are set as if it were. It proceeds from the middle outward, in the order
    of the back-substitution.
    """
    work, first, n = rope.work, rope.model.first_free, rope.state.counts[ELEMENTS]
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
