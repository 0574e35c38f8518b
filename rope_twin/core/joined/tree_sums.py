"""Sums at the connections of trees: what eliminated chains leave there, and corrections to hand on.

A slot of the plan's `sums` is a connection, a rope that is eliminated onto one, or a root. These
functions serve one system and its lanes (core/joined/wide_trees) alike.
"""

from __future__ import annotations

from typing import Any

from rope_twin.core.elimination import add, set_column, six, solve_symmetric, spring
from rope_twin.core.jit.decorators import jit, jit_ordered
from rope_twin.core.jit.rows import column
from rope_twin.core.joined.plan import (
    CARRY,
    COLUMN,
    ENDS,
    FORCE,
    HELD,
    JOINT,
    KEPT,
    LEFT,
    NOWHERE,
    ROOTS,
    SUMMED,
)
from rope_twin.core.state import BLOCK, CORRECTION, RESIDUAL


@jit
def begin_sums(plan: Any, work: Any) -> None:
    """Clear the sums; add what ends leave that no chain begins at."""
    sums = plan.sums
    for k in range(LEFT, LEFT + 6):
        for slot in range(sums.shape[1]):
            sums[k, slot] = 0.0
    for m in range(plan.sizes[ENDS]):
        if plan.ends[m, SUMMED] == 1:
            j, i = plan.ends[m, JOINT], plan.ends[m, COLUMN]
            for k in range(6):
                sums[LEFT + k, j] += work[BLOCK + k, i]
    begin_tree_forces(plan, work)


@jit
def begin_tree_forces(plan: Any, work: Any) -> None:
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
