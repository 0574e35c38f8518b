"""Elimination of trees of ropes by a plan (core/joined/plan), two nodes at a time.

Every node is eliminated onto its neighbour nearer to the root, as in `core/banded/tridiagonal` for
one rope. A connection's residual and block are the sums over the rope ends there; the chain that
leads on from it begins with what the others left. `push_trees` solves for other forces with the
factors of the last elimination.
"""

from __future__ import annotations

from typing import Any

from rope_twin.core.banded.nodes import lanes, six, six_lanes, solve_symmetric, spring
from rope_twin.core.banded.pairs import (
    RECORD,
    eliminate_pair,
    push_pair,
    pushed_on,
    substitute_pair,
    two,
    two_of_six,
)
from rope_twin.core.jit.decorators import jit, jit_ordered
from rope_twin.core.jit.rows import column, rows, table_rows
from rope_twin.core.jit.simd import lane
from rope_twin.core.joined.plan import (
    A_BEGIN,
    A_INTO,
    A_WAY,
    B_BEGIN,
    B_INTO,
    B_WAY,
    CARRY,
    COLUMN,
    COUNT,
    ENDS,
    FORCE,
    HELD,
    IDLE,
    JOINT,
    KEPT,
    LEFT,
    NOWHERE,
    ROOTS,
    SPANS,
    SUMMED,
    A,
    B,
)
from rope_twin.core.state import BLOCK, CORRECTION, RESIDUAL

_records = table_rows("scratch 0", 1)
_NIL = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
_NONE = (0.0, 0.0, 0.0)


@jit
def _begin_sums(plan: Any, work: Any) -> None:
    """Clear the sums; add what ends leave that no chain begins at."""
    sums = plan.sums
    for k in range(KEPT):
        for slot in range(sums.shape[1]):
            sums[k, slot] = 0.0
    for m in range(plan.sizes[ENDS]):
        if plan.ends[m, SUMMED] == 1:
            j, i = plan.ends[m, JOINT], plan.ends[m, COLUMN]
            for k in range(3):
                sums[FORCE + k, j] += work[RESIDUAL + k, i]
            for k in range(6):
                sums[LEFT + k, j] += work[BLOCK + k, i]


@jit
def _begin_forces(plan: Any, work: Any) -> None:
    """Clear the forces of the sums; add those of ends that no chain begins at."""
    sums = plan.sums
    for k in range(FORCE, FORCE + 3):
        for slot in range(sums.shape[1]):
            sums[k, slot] = 0.0
    for m in range(plan.sizes[ENDS]):
        if plan.ends[m, SUMMED] == 1:
            j, i = plan.ends[m, JOINT], plan.ends[m, COLUMN]
            for k in range(3):
                sums[FORCE + k, j] += work[RESIDUAL + k, i]


@jit
def _add(sums: Any, slot: int, Z: Any, f: Any) -> None:
    """Leave Schur complement and force of a chain at its end; NOWHERE: it goes on."""
    if slot != NOWHERE:
        sums[0, slot] += Z[0]
        sums[1, slot] += Z[1]
        sums[2, slot] += Z[2]
        sums[3, slot] += Z[3]
        sums[4, slot] += Z[4]
        sums[5, slot] += Z[5]
        sums[FORCE, slot] += f[0]
        sums[FORCE + 1, slot] += f[1]
        sums[FORCE + 2, slot] += f[2]


@jit_ordered
def _begin(work: Any, sums: Any, begin: int, i: int, way: int, state: Any) -> Any:
    """Return Schur complement and force that a lane begins a span with, at node i."""
    Z, f = state
    if begin == HELD:
        Z, f = spring(work, i - 1 if way > 0 else i), _NONE
    elif begin >= 0:
        Z, f = six(sums, LEFT, begin), column(sums, FORCE, begin)
    elif begin != CARRY:
        Z, f = _NIL, _NONE
    return Z, f


@jit_ordered
def eliminate_trees(work: Any, plan: Any) -> None:
    """Eliminate all chains; work: the scratch of all ropes, end to end."""
    _begin_sums(plan, work)
    sums, spans, record = plan.sums, plan.spans, _records(plan.records)[0]
    one, other, at = (_NIL, _NONE), (_NIL, _NONE), 0
    for s in range(plan.sizes[SPANS]):
        i, way, j, back = spans[s, A], spans[s, A_WAY], spans[s, B], spans[s, B_WAY]
        one = _begin(work, sums, spans[s, A_BEGIN], i, way, one)
        other = _begin(work, sums, spans[s, B_BEGIN], j, back, other)
        if spans[s, A_BEGIN] == IDLE:
            one = other
        if spans[s, B_BEGIN] == IDLE:
            other = one
        d, e = (0 if way > 0 else -1), (0 if back > 0 else -1)
        state = two_of_six(one[0], other[0]), two(one[1], other[1])
        for _ in range(spans[s, COUNT]):
            state = eliminate_pair(work, record, at, (i, j), (i + d, j + e), state)
            i, j, at = i + way, j + back, at + RECORD
        one = six_lanes(state[0], 0), lanes(state[1], 0)
        other = six_lanes(state[0], 1), lanes(state[1], 1)
        _add(sums, spans[s, A_INTO], one[0], one[1])
        _add(sums, spans[s, B_INTO], other[0], other[1])
    for m in range(plan.sizes[ROOTS]):
        root, slot = plan.roots[m, 0], plan.roots[m, 1]
        for k in range(6):
            sums[KEPT + k, slot] = sums[LEFT + k, slot] + work[BLOCK + k, root]


@jit
def _add_force(sums: Any, slot: int, f: Any) -> None:
    """Leave the force of a chain at its end; NOWHERE: it goes on."""
    if slot != NOWHERE:
        sums[FORCE, slot] += f[0]
        sums[FORCE + 1, slot] += f[1]
        sums[FORCE + 2, slot] += f[2]


@jit_ordered
def _begin_force(sums: Any, begin: int, f: Any) -> Any:
    """Return the force that a lane begins a span with."""
    if begin >= 0:
        f = column(sums, FORCE, begin)
    elif begin != CARRY:
        f = _NONE
    return f


@jit_ordered
def push_trees(work: Any, plan: Any) -> None:
    """Push the residuals through the factors of all chains; work: the scratch of all ropes."""
    _begin_forces(plan, work)
    sums, spans, record = plan.sums, plan.spans, _records(plan.records)[0]
    one, other, at = _NONE, _NONE, 0
    for s in range(plan.sizes[SPANS]):
        i, way, j, back = spans[s, A], spans[s, A_WAY], spans[s, B], spans[s, B_WAY]
        one = _begin_force(sums, spans[s, A_BEGIN], one)
        other = _begin_force(sums, spans[s, B_BEGIN], other)
        if spans[s, A_BEGIN] == IDLE:
            one = other
        if spans[s, B_BEGIN] == IDLE:
            other = one
        f = two(one, other)
        for _ in range(spans[s, COUNT]):
            f = push_pair(record, at, pushed_on(work, i, j, f))
            i, j, at = i + way, j + back, at + RECORD
        one, other = lanes(f, 0), lanes(f, 1)
        _add_force(sums, spans[s, A_INTO], one)
        _add_force(sums, spans[s, B_INTO], other)


@jit_ordered
def substitute_trees(work: Any, plan: Any, joints: Any) -> None:
    """Set the corrections of roots, then of all chains from their ends on; joints: scratch of the
    connections, which get theirs, as do all rope ends there.

    The corrections of dense connections are already at the ends of their ropes.
    """
    dx, dy, dz = rows(work, CORRECTION, 0)
    sums, spans, record = plan.sums, plan.spans, _records(plan.records)[0]
    at = 0
    for m in range(plan.sizes[ROOTS]):
        root, slot = plan.roots[m, 0], plan.roots[m, 1]
        f = column(sums, FORCE, slot)
        R = column(work, RESIDUAL, root)
        force = f[0] + R[0], f[1] + R[1], f[2] + R[2]
        dx[root], dy[root], dz[root] = solve_symmetric(six(sums, KEPT, slot), force)
    for s in range(plan.sizes[SPANS]):
        at += RECORD * spans[s, COUNT]
    for s in range(plan.sizes[SPANS] - 1, -1, -1):
        way, back, count = spans[s, A_WAY], spans[s, B_WAY], spans[s, COUNT]
        i, j = spans[s, A] + count * way, spans[s, B] + count * back
        p = two((dx[i], dy[i], dz[i]), (dx[j], dy[j], dz[j]))
        for _ in range(count):
            i, j, at = i - way, j - back, at - RECORD
            p = substitute_pair(record, at, p)
            px, py, pz = p
            dx[i], dx[j] = lane(px, 0), lane(px, 1)
            dy[i], dy[j] = lane(py, 0), lane(py, 1)
            dz[i], dz[j] = lane(pz, 0), lane(pz, 1)
        if spans[s, A_BEGIN] >= 0:
            _spread(work, plan, joints, spans[s, A_BEGIN], i)
        if spans[s, B_BEGIN] >= 0:
            _spread(work, plan, joints, spans[s, B_BEGIN], j)


@jit
def _spread(work: Any, plan: Any, joints: Any, joint: int, i: int) -> None:
    """Copy the correction of node i to the connection it is at, and to all rope ends there."""
    for k in range(CORRECTION, CORRECTION + 3):
        joints[k, joint] = work[k, i]
        for m in range(plan.sizes[ENDS]):
            if plan.ends[m, JOINT] == joint:
                work[k, plan.ends[m, COLUMN]] = work[k, i]
