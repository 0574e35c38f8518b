"""Trees of ropes: elimination from their free ends to connections, of one system and in SIMD lanes.

Trees are eliminated two nodes at a time, every node onto its neighbour nearer to the root, as
in `core/tridiagonal` for one rope. A connection's residual and block are the sums over the rope
ends there; the chain that leads on from it begins with what the others left.

A slot of the plan's `sums` is a connection, a rope that is eliminated onto one, or a root: what
eliminated chains leave there, and what corrections begin from.

In SIMD lanes (`..._wide`) a lane of the batch is a system; what a lone system has in the two lanes
of a SIMD register, two chains that are eliminated at the same time, are there two nodes one after
the other. Each has its factors in its own rows ELIMINATED, as in `core/tridiagonal`, and its
numbers are those of the lone system to the bit. work: scratch of all ropes, end to end.
"""

from __future__ import annotations

from typing import Any

from rope_twin.core.elimination import (
    RECORD,
    add,
    eliminate_pair,
    lanes,
    nothing_at,
    push_pair,
    pushed_on,
    set_column,
    six,
    six_lanes,
    solve_symmetric,
    spring,
    substitute_pair,
    two,
    two_of_six,
)
from rope_twin.core.jit.decorators import jit, jit_ordered
from rope_twin.core.jit.rows import column, lane, rows, table_rows
from rope_twin.core.jit.wide import choose
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
from rope_twin.core.state import BLOCK, CORRECTION, RESIDUAL, ZERO
from rope_twin.core.tridiagonal import eliminate_wide_node, push_wide_node, substitute_wide_node

_records = table_rows("scratch 0", 1)
_NONE = (0.0, 0.0, 0.0)


@jit
def begin_sums(plan: Any, work: Any, into: int, part: int, count: int) -> None:
    """Clear `count` rows of the sums; add those of scratch at ends that no chain begins at.

    into: first row of the sums; part: that of scratch.
    """
    sums = plan.sums
    for k in range(into, into + count):
        for slot in range(sums.shape[1]):
            sums[k, slot] = 0.0
    for m in range(plan.sizes[ENDS]):
        if plan.ends[m, SUMMED] == 1:
            j, i = plan.ends[m, JOINT], plan.ends[m, COLUMN]
            for k in range(count):
                sums[into + k, j] += work[part + k, i]


@jit_ordered
def begin_chain(work: Any, sums: Any, begin: int, i: int, way: int, state: Any, none: Any) -> Any:
    """Return Schur complement and force that a chain begins a span with, at node i.

    state: those of the chain's last span; none: a zero force.
    """
    Z, f = state
    if begin == HELD:
        Z, f = spring(work, i - 1 if way > 0 else i), none
    elif begin >= 0:
        Z, f = six(sums, LEFT, begin), column(sums, FORCE, begin)
    elif begin != CARRY:
        Z, f = none + none, none
    return Z, f


@jit_ordered
def begin_force(sums: Any, begin: int, f: Any, none: Any) -> Any:
    """Return the force that a chain begins a span with; f: that of its last span."""
    if begin >= 0:
        f = column(sums, FORCE, begin)
    elif begin != CARRY:
        f = none
    return f


@jit_ordered
def solve_roots(work: Any, plan: Any) -> None:
    """Set the corrections of the roots."""
    for m in range(plan.sizes[ROOTS]):
        root, slot = plan.roots[m, 0], plan.roots[m, 1]
        force = add(column(plan.sums, FORCE, slot), column(work, RESIDUAL, root))
        delta = solve_symmetric(six(plan.sums, KEPT, slot), force)
        set_column(work, CORRECTION, root, delta)


@jit
def add_force(sums: Any, slot: int, f: Any) -> None:
    """Leave the force of a chain at its end; NOWHERE: it goes on."""
    if slot != NOWHERE:
        sums[FORCE, slot] += f[0]
        sums[FORCE + 1, slot] += f[1]
        sums[FORCE + 2, slot] += f[2]


@jit
def add_left(sums: Any, slot: int, Z: Any, f: Any) -> None:
    """Leave Schur complement and force of a chain at its end."""
    if slot != NOWHERE:
        for k in range(6):
            sums[LEFT + k, slot] += Z[k]
    add_force(sums, slot, f)


@jit
def spread(work: Any, plan: Any, joints: Any, joint: int, i: int) -> None:
    """Copy the correction of node i to the connection it is at, and to all rope ends there."""
    for k in range(CORRECTION, CORRECTION + 3):
        joints[k, joint] = work[k, i]
        for m in range(plan.sizes[ENDS]):
            if plan.ends[m, JOINT] == joint:
                work[k, plan.ends[m, COLUMN]] = work[k, i]


@jit_ordered
def eliminate_trees(work: Any, plan: Any) -> None:
    """Eliminate all chains; work: the scratch of all ropes, end to end."""
    begin_sums(plan, work, LEFT, BLOCK, 6)
    begin_sums(plan, work, FORCE, RESIDUAL, 3)
    sums, spans, record = plan.sums, plan.spans, _records(plan.records)[0]
    one, other, at = (_NONE + _NONE, _NONE), (_NONE + _NONE, _NONE), 0
    for s in range(plan.sizes[SPANS]):
        i, way, j, back = spans[s, A], spans[s, A_WAY], spans[s, B], spans[s, B_WAY]
        one = begin_chain(work, sums, spans[s, A_BEGIN], i, way, one, _NONE)
        other = begin_chain(work, sums, spans[s, B_BEGIN], j, back, other, _NONE)
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
        add_left(sums, spans[s, A_INTO], one[0], one[1])
        add_left(sums, spans[s, B_INTO], other[0], other[1])
    for m in range(plan.sizes[ROOTS]):
        root, slot = plan.roots[m, 0], plan.roots[m, 1]
        for k in range(6):
            sums[KEPT + k, slot] = sums[LEFT + k, slot] + work[BLOCK + k, root]


@jit_ordered
def push_trees(work: Any, plan: Any) -> None:
    """Push the residuals through the factors of all chains; work: the scratch of all ropes."""
    begin_sums(plan, work, FORCE, RESIDUAL, 3)
    sums, spans, record = plan.sums, plan.spans, _records(plan.records)[0]
    one, other, at = _NONE, _NONE, 0
    for s in range(plan.sizes[SPANS]):
        i, way, j, back = spans[s, A], spans[s, A_WAY], spans[s, B], spans[s, B_WAY]
        one = begin_force(sums, spans[s, A_BEGIN], one, _NONE)
        other = begin_force(sums, spans[s, B_BEGIN], other, _NONE)
        if spans[s, A_BEGIN] == IDLE:
            one = other
        if spans[s, B_BEGIN] == IDLE:
            other = one
        f = two(one, other)
        for _ in range(spans[s, COUNT]):
            f = push_pair(record, at, pushed_on(work, i, j, f))
            i, j, at = i + way, j + back, at + RECORD
        one, other = lanes(f, 0), lanes(f, 1)
        add_force(sums, spans[s, A_INTO], one)
        add_force(sums, spans[s, B_INTO], other)


@jit_ordered
def substitute_trees(work: Any, plan: Any, joints: Any) -> None:
    """Set the corrections of roots, then of all chains from their ends on; joints: scratch of the
    connections, which get theirs, as do all rope ends there.

    The corrections of dense connections are already at the ends of their ropes.
    """
    dx, dy, dz = rows(work, CORRECTION, 0)
    spans, record = plan.spans, _records(plan.records)[0]
    at = 0
    solve_roots(work, plan)
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
            spread(work, plan, joints, spans[s, A_BEGIN], i)
        if spans[s, B_BEGIN] >= 0:
            spread(work, plan, joints, spans[s, B_BEGIN], j)


@jit_ordered
def eliminate_trees_wide(work: Any, plan: Any, moved: Any) -> None:
    """Eliminate all chains; lanes that are not in `moved` keep their factors."""
    begin_sums(plan, work, LEFT, BLOCK, 6)
    begin_sums(plan, work, FORCE, RESIDUAL, 3)
    sums, spans = plan.sums, plan.spans
    none = nothing_at(work, ZERO)
    one = other = (none + none, none)
    for s in range(plan.sizes[SPANS]):
        i, way, j, back = spans[s, A], spans[s, A_WAY], spans[s, B], spans[s, B_WAY]
        d, e = (0 if way > 0 else -1), (0 if back > 0 else -1)
        runs, goes = spans[s, A_BEGIN] != IDLE, spans[s, B_BEGIN] != IDLE
        if runs:
            one = begin_chain(work, sums, spans[s, A_BEGIN], i, way, one, none)
        if goes:
            other = begin_chain(work, sums, spans[s, B_BEGIN], j, back, other, none)
        for _ in range(spans[s, COUNT]):
            if runs:
                one = eliminate_wide_node(work, i, i + d, one[0], one[1], moved)
            if goes:
                other = eliminate_wide_node(work, j, j + e, other[0], other[1], moved)
            i, j = i + way, j + back
        add_left(sums, spans[s, A_INTO], one[0], one[1])
        add_left(sums, spans[s, B_INTO], other[0], other[1])
    for m in range(plan.sizes[ROOTS]):
        root, slot = plan.roots[m, 0], plan.roots[m, 1]
        for k in range(6):
            whole = sums[LEFT + k, slot] + work[BLOCK + k, root]
            sums[KEPT + k, slot] = choose(moved, whole, sums[KEPT + k, slot])


@jit_ordered
def push_trees_wide(work: Any, plan: Any) -> None:
    """Push the residuals through the factors of all chains."""
    begin_sums(plan, work, FORCE, RESIDUAL, 3)
    sums, spans = plan.sums, plan.spans
    one = other = none = nothing_at(work, ZERO)
    for s in range(plan.sizes[SPANS]):
        i, way, j, back = spans[s, A], spans[s, A_WAY], spans[s, B], spans[s, B_WAY]
        runs, goes = spans[s, A_BEGIN] != IDLE, spans[s, B_BEGIN] != IDLE
        if runs:
            one = begin_force(sums, spans[s, A_BEGIN], one, none)
        if goes:
            other = begin_force(sums, spans[s, B_BEGIN], other, none)
        for _ in range(spans[s, COUNT]):
            if runs:
                one = push_wide_node(work, i, one)
            if goes:
                other = push_wide_node(work, j, other)
            i, j = i + way, j + back
        add_force(sums, spans[s, A_INTO], one)
        add_force(sums, spans[s, B_INTO], other)


@jit_ordered
def substitute_trees_wide(work: Any, plan: Any, joints: Any) -> None:
    """Set the corrections of roots, then of all chains from their ends on, and of connections.

    The corrections of dense connections are already at the ends of their ropes.
    """
    spans = plan.spans
    solve_roots(work, plan)
    for s in range(plan.sizes[SPANS] - 1, -1, -1):
        way, back, count = spans[s, A_WAY], spans[s, B_WAY], spans[s, COUNT]
        runs, goes = spans[s, A_BEGIN] != IDLE, spans[s, B_BEGIN] != IDLE
        i, j = spans[s, A] + count * way, spans[s, B] + count * back
        p, q = column(work, CORRECTION, i), column(work, CORRECTION, j)
        for _ in range(count):
            i, j = i - way, j - back
            if runs:
                p = substitute_wide_node(work, i, p)
            if goes:
                q = substitute_wide_node(work, j, q)
        if spans[s, A_BEGIN] >= 0:
            spread(work, plan, joints, spans[s, A_BEGIN], i)
        if spans[s, B_BEGIN] >= 0:
            spread(work, plan, joints, spans[s, B_BEGIN], j)
