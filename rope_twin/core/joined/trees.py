"""Elimination of trees of ropes, from their free ends to the root, for a system and for SIMD lanes.

Two nodes are eliminated at a time, each onto its neighbour nearer to the root, as in
`core/tridiagonal` for a single rope. Residual and block of a connection are sums over the rope ends
there; the outgoing chain starts with the sum of the incoming Schur complements.

A slot of the plan's `sums` accumulates the Schur complements of chains on a connection, on a rope
that is eliminated onto a connection, or on a root.

In SIMD lanes (`..._wide`) a lane of the batch is a system; the two chains that a single system
eliminates in the two lanes of a register are there eliminated in turn. Each node has its factors in
its own column of ELIMINATED, as in `core/tridiagonal`; results are bit-identical to those of a
single system. work: contiguous work arrays of all ropes.
"""

from __future__ import annotations

from typing import Any

from rope_twin.core.elimination import (
    RECORD,
    add,
    eliminate_pair,
    lanes,
    nothing_at,
    pushed_on,
    reduce_pair,
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
from rope_twin.core.tridiagonal import eliminate_wide_node, reduce_wide_node, substitute_wide_node

_records = table_rows("scratch 0", 1)
_ZERO = (0.0, 0.0, 0.0)


@jit
def begin_sums(plan: Any, work: Any, first: int, source: int, count: int) -> None:
    """Clear `count` rows of the sums; add those of rope ends at which no chain begins.

    first: first row of the sums; source: first row of the work array.
    """
    sums = plan.sums
    for k in range(first, first + count):
        for slot in range(sums.shape[1]):
            sums[k, slot] = 0.0
    for m in range(plan.sizes[ENDS]):
        if plan.ends[m, SUMMED] == 1:
            j, i = plan.ends[m, JOINT], plan.ends[m, COLUMN]
            for k in range(count):
                sums[first + k, j] += work[source + k, i]


@jit_ordered
def begin_chain(
    work: Any, sums: Any, begin: int, i: int, direction: int, state: Any, zero: Any
) -> Any:
    """Return initial Schur complement and force of a chain's span at node i.

    state: those at the end of the chain's previous span; zero: a zero force.
    """
    Z, f = state
    if begin == HELD:
        Z, f = spring(work, i - 1 if direction > 0 else i), zero
    elif begin >= 0:
        Z, f = six(sums, LEFT, begin), column(sums, FORCE, begin)
    elif begin != CARRY:
        Z, f = zero + zero, zero
    return Z, f


@jit_ordered
def begin_force(sums: Any, begin: int, f: Any, zero: Any) -> Any:
    """Return the initial force of a chain's span; f: that at the end of its previous span."""
    if begin >= 0:
        f = column(sums, FORCE, begin)
    elif begin != CARRY:
        f = zero
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
    """Add the force at the end of a chain to a slot, unless it is NOWHERE."""
    if slot != NOWHERE:
        sums[FORCE, slot] += f[0]
        sums[FORCE + 1, slot] += f[1]
        sums[FORCE + 2, slot] += f[2]


@jit
def add_left(sums: Any, slot: int, Z: Any, f: Any) -> None:
    """Add Schur complement and force at the end of a chain to a slot, unless it is NOWHERE."""
    if slot != NOWHERE:
        for k in range(6):
            sums[LEFT + k, slot] += Z[k]
    add_force(sums, slot, f)


@jit
def spread(work: Any, plan: Any, joints: Any, joint: int, i: int) -> None:
    """Copy the correction of node i to its connection and to all rope ends there."""
    for k in range(CORRECTION, CORRECTION + 3):
        joints[k, joint] = work[k, i]
        for m in range(plan.sizes[ENDS]):
            if plan.ends[m, JOINT] == joint:
                work[k, plan.ends[m, COLUMN]] = work[k, i]


@jit_ordered
def eliminate_trees(work: Any, plan: Any) -> None:
    """Eliminate all chains."""
    begin_sums(plan, work, LEFT, BLOCK, 6)
    begin_sums(plan, work, FORCE, RESIDUAL, 3)
    sums, spans, record = plan.sums, plan.spans, _records(plan.records)[0]
    state_a, state_b, at = (_ZERO + _ZERO, _ZERO), (_ZERO + _ZERO, _ZERO), 0
    for s in range(plan.sizes[SPANS]):
        i, direction_a, j, direction_b = spans[s, A], spans[s, A_WAY], spans[s, B], spans[s, B_WAY]
        state_a = begin_chain(work, sums, spans[s, A_BEGIN], i, direction_a, state_a, _ZERO)
        state_b = begin_chain(work, sums, spans[s, B_BEGIN], j, direction_b, state_b, _ZERO)
        if spans[s, A_BEGIN] == IDLE:
            state_a = state_b
        if spans[s, B_BEGIN] == IDLE:
            state_b = state_a
        d, e = (0 if direction_a > 0 else -1), (0 if direction_b > 0 else -1)
        state = two_of_six(state_a[0], state_b[0]), two(state_a[1], state_b[1])
        for _ in range(spans[s, COUNT]):
            state = eliminate_pair(work, record, at, (i, j), (i + d, j + e), state)
            i, j, at = i + direction_a, j + direction_b, at + RECORD
        state_a = six_lanes(state[0], 0), lanes(state[1], 0)
        state_b = six_lanes(state[0], 1), lanes(state[1], 1)
        add_left(sums, spans[s, A_INTO], state_a[0], state_a[1])
        add_left(sums, spans[s, B_INTO], state_b[0], state_b[1])
    for m in range(plan.sizes[ROOTS]):
        root, slot = plan.roots[m, 0], plan.roots[m, 1]
        for k in range(6):
            sums[KEPT + k, slot] = sums[LEFT + k, slot] + work[BLOCK + k, root]


@jit_ordered
def reduce_trees(work: Any, plan: Any) -> None:
    """Condense the residuals of all chains with their existing factors."""
    begin_sums(plan, work, FORCE, RESIDUAL, 3)
    sums, spans, record = plan.sums, plan.spans, _records(plan.records)[0]
    force_a, force_b, at = _ZERO, _ZERO, 0
    for s in range(plan.sizes[SPANS]):
        i, direction_a, j, direction_b = spans[s, A], spans[s, A_WAY], spans[s, B], spans[s, B_WAY]
        force_a = begin_force(sums, spans[s, A_BEGIN], force_a, _ZERO)
        force_b = begin_force(sums, spans[s, B_BEGIN], force_b, _ZERO)
        if spans[s, A_BEGIN] == IDLE:
            force_a = force_b
        if spans[s, B_BEGIN] == IDLE:
            force_b = force_a
        f = two(force_a, force_b)
        for _ in range(spans[s, COUNT]):
            f = reduce_pair(record, at, pushed_on(work, i, j, f))
            i, j, at = i + direction_a, j + direction_b, at + RECORD
        force_a, force_b = lanes(f, 0), lanes(f, 1)
        add_force(sums, spans[s, A_INTO], force_a)
        add_force(sums, spans[s, B_INTO], force_b)


@jit_ordered
def substitute_trees(work: Any, plan: Any, joints: Any) -> None:
    """Back-substitute from the roots and dense connections; set the corrections of connections.

    joints: work array of the connections. The corrections of dense connections must be set at the
    ends of their ropes.
    """
    dx, dy, dz = rows(work, CORRECTION, 0)
    spans, record = plan.spans, _records(plan.records)[0]
    at = 0
    solve_roots(work, plan)
    for s in range(plan.sizes[SPANS]):
        at += RECORD * spans[s, COUNT]
    for s in range(plan.sizes[SPANS] - 1, -1, -1):
        direction_a, direction_b, count = spans[s, A_WAY], spans[s, B_WAY], spans[s, COUNT]
        i, j = spans[s, A] + count * direction_a, spans[s, B] + count * direction_b
        p = two((dx[i], dy[i], dz[i]), (dx[j], dy[j], dz[j]))
        for _ in range(count):
            i, j, at = i - direction_a, j - direction_b, at - RECORD
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
    """Eliminate all chains; only lanes in the mask `moved` update their factors."""
    begin_sums(plan, work, LEFT, BLOCK, 6)
    begin_sums(plan, work, FORCE, RESIDUAL, 3)
    sums, spans = plan.sums, plan.spans
    zero = nothing_at(work, ZERO)
    state_a = state_b = (zero + zero, zero)
    for s in range(plan.sizes[SPANS]):
        i, direction_a, j, direction_b = spans[s, A], spans[s, A_WAY], spans[s, B], spans[s, B_WAY]
        d, e = (0 if direction_a > 0 else -1), (0 if direction_b > 0 else -1)
        active_a, active_b = spans[s, A_BEGIN] != IDLE, spans[s, B_BEGIN] != IDLE
        if active_a:
            state_a = begin_chain(work, sums, spans[s, A_BEGIN], i, direction_a, state_a, zero)
        if active_b:
            state_b = begin_chain(work, sums, spans[s, B_BEGIN], j, direction_b, state_b, zero)
        for _ in range(spans[s, COUNT]):
            if active_a:
                state_a = eliminate_wide_node(work, i, i + d, state_a[0], state_a[1], moved)
            if active_b:
                state_b = eliminate_wide_node(work, j, j + e, state_b[0], state_b[1], moved)
            i, j = i + direction_a, j + direction_b
        add_left(sums, spans[s, A_INTO], state_a[0], state_a[1])
        add_left(sums, spans[s, B_INTO], state_b[0], state_b[1])
    for m in range(plan.sizes[ROOTS]):
        root, slot = plan.roots[m, 0], plan.roots[m, 1]
        for k in range(6):
            pivot = sums[LEFT + k, slot] + work[BLOCK + k, root]
            sums[KEPT + k, slot] = choose(moved, pivot, sums[KEPT + k, slot])


@jit_ordered
def reduce_trees_wide(work: Any, plan: Any) -> None:
    """Condense the residuals of all chains with their existing factors, in all lanes."""
    begin_sums(plan, work, FORCE, RESIDUAL, 3)
    sums, spans = plan.sums, plan.spans
    force_a = force_b = zero = nothing_at(work, ZERO)
    for s in range(plan.sizes[SPANS]):
        i, direction_a, j, direction_b = spans[s, A], spans[s, A_WAY], spans[s, B], spans[s, B_WAY]
        active_a, active_b = spans[s, A_BEGIN] != IDLE, spans[s, B_BEGIN] != IDLE
        if active_a:
            force_a = begin_force(sums, spans[s, A_BEGIN], force_a, zero)
        if active_b:
            force_b = begin_force(sums, spans[s, B_BEGIN], force_b, zero)
        for _ in range(spans[s, COUNT]):
            if active_a:
                force_a = reduce_wide_node(work, i, force_a)
            if active_b:
                force_b = reduce_wide_node(work, j, force_b)
            i, j = i + direction_a, j + direction_b
        add_force(sums, spans[s, A_INTO], force_a)
        add_force(sums, spans[s, B_INTO], force_b)


@jit_ordered
def substitute_trees_wide(work: Any, plan: Any, joints: Any) -> None:
    """Back-substitute from the roots and dense connections; set the corrections of connections.

    The corrections of dense connections must be set at the ends of their ropes.
    """
    spans = plan.spans
    solve_roots(work, plan)
    for s in range(plan.sizes[SPANS] - 1, -1, -1):
        direction_a, direction_b, count = spans[s, A_WAY], spans[s, B_WAY], spans[s, COUNT]
        active_a, active_b = spans[s, A_BEGIN] != IDLE, spans[s, B_BEGIN] != IDLE
        i, j = spans[s, A] + count * direction_a, spans[s, B] + count * direction_b
        p, q = column(work, CORRECTION, i), column(work, CORRECTION, j)
        for _ in range(count):
            i, j = i - direction_a, j - direction_b
            if active_a:
                p = substitute_wide_node(work, i, p)
            if active_b:
                q = substitute_wide_node(work, j, q)
        if spans[s, A_BEGIN] >= 0:
            spread(work, plan, joints, spans[s, A_BEGIN], i)
        if spans[s, B_BEGIN] >= 0:
            spread(work, plan, joints, spans[s, B_BEGIN], j)
