"""Trees of ropes in SIMD lanes: elimination in the order of core/joined/linear_solver.

A lane of the batch is a system; what a lone system has in the two lanes of a SIMD register, two
chains that are eliminated at the same time, are here two nodes one after the other. Each has its
factors in its own rows ELIMINATED, as in `core/tridiagonal`, and its numbers are those of the lone
system to the bit. work: scratch of all ropes, end to end.
"""

from __future__ import annotations

from typing import Any

from rope_twin.core.elimination import nothing_at
from rope_twin.core.jit.decorators import jit_ordered
from rope_twin.core.jit.rows import column
from rope_twin.core.jit.wide import choose
from rope_twin.core.joined.plan import (
    A_BEGIN,
    A_INTO,
    A_WAY,
    B_BEGIN,
    B_INTO,
    B_WAY,
    COUNT,
    IDLE,
    KEPT,
    LEFT,
    ROOTS,
    SPANS,
    A,
    B,
)
from rope_twin.core.joined.tree_sums import (
    add_force,
    add_left,
    begin_chain,
    begin_force,
    begin_sums,
    begin_tree_forces,
    solve_roots,
    spread,
)
from rope_twin.core.state import BLOCK, CORRECTION, ZERO
from rope_twin.core.tridiagonal import eliminate_wide_node, push_wide_node, substitute_wide_node


@jit_ordered
def eliminate_trees_wide(work: Any, plan: Any, moved: Any) -> None:
    """Eliminate all chains; lanes that are not in `moved` keep their factors."""
    begin_sums(plan, work)
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
    begin_tree_forces(plan, work)
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
