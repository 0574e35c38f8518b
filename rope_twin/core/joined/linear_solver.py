"""Linear solver of a Newton iteration: elimination of trees, dense system of connections.

A plan (core/joined/plan) determines which ropes are eliminated as trees and which connections
remain in a dense system, solved by LDLᵀ. The cost is O(nodes). Where an effect couples second
neighbours (bending), every connection belongs to the dense system and ropes are condensed onto them
in one direction. `reduce_system` solves for another residual with the factors of the last
elimination, for plans without bending and sheaves.
"""

from __future__ import annotations

from typing import Any

from rope_twin.core.elimination import six
from rope_twin.core.jit.decorators import jit, jit_noinline, jit_ordered
from rope_twin.core.jit.functions import by_width
from rope_twin.core.jit.rows import column, end_to_end
from rope_twin.core.jit.wide import choose
from rope_twin.core.joined.chains import (
    eliminate_between,
    eliminate_between_wide,
    eliminate_coupled_between,
    eliminate_coupled_downward,
    eliminate_coupled_upward,
    reduce_between,
    reduce_between_wide,
    substitute_between,
    substitute_between_wide,
    substitute_coupled_between,
    substitute_coupled_downward,
    substitute_coupled_upward,
)
from rope_twin.core.joined.joints import LOOSE, add_block, count_joints, first_free
from rope_twin.core.joined.plan import BETWEEN, DENSE, FORCE, LEFT, ONTO
from rope_twin.core.joined.sheaves import condense_flow, couple_flow, substitute_flow
from rope_twin.core.joined.stack import effects_at, work_of
from rope_twin.core.joined.trees import (
    eliminate_trees,
    eliminate_trees_wide,
    reduce_trees,
    reduce_trees_wide,
    substitute_trees,
    substitute_trees_wide,
)
from rope_twin.core.loads.hooks import couples, selected_by
from rope_twin.core.state import CORRECTION, ELEMENTS, RESIDUAL, ZERO


@jit
def push_force(joints: Any, joint: int, f: Any) -> None:
    """Add a condensed force to the right-hand side of a connection, held in CORRECTION."""
    for k in range(3):
        joints.work[CORRECTION + k, joint] += f[k]


@jit
def couple_by(matrix: Any, upper: int, lower: int, P: Any) -> None:
    """Add -P between two connections (or of one to itself) to the lower triangle."""
    for k in range(3):
        for c in range(3):
            i, j = 3 * upper + k, 3 * lower + c
            if i >= j:
                matrix[i, j] -= P[c][k]
            if j >= i:
                matrix[j, i] -= P[c][k]


@jit
def begin_forces(joints: Any) -> None:
    """Initialise the right-hand side with the residuals of the connections."""
    for k in range(3):
        for j in range(count_joints(joints)):
            joints.work[CORRECTION + k, j] = joints.work[RESIDUAL + k, j]


@jit
def leave_out_trees(joints: Any, matrix: Any) -> None:
    """Replace the rows of connections that are eliminated in a tree by rows of the identity."""
    dense = joints.plan.dense
    for j in range(dense.shape[0]):
        if dense[j] == 0:
            for i in range(3 * j, 3 * j + 3):
                for k in range(i):
                    matrix[i, k] = 0.0
                for k in range(i, matrix.shape[0]):
                    matrix[k, i] = 0.0
                matrix[i, i] = 1.0


@jit_ordered
def factorise(M: Any) -> None:
    """Factorise a symmetric positive definite matrix (its lower triangle) in place: LDLᵀ."""
    for j in range(M.shape[0]):
        for i in range(j, M.shape[0]):
            total = M[i, j]
            for k in range(j):
                total -= M[i, k] * M[j, k] * M[k, k]
            M[i, j] = total if i == j else total / M[j, j]


@jit_ordered
def substitute_dense(M: Any, b: Any) -> None:
    """Solve L·D·Lᵀ·x = b by the factors of `factorise`; b: rows CORRECTION, replaced by x."""
    size, first = M.shape[0], CORRECTION
    for i in range(size):
        for k in range(i):
            b[first + i % 3, i // 3] -= M[i, k] * b[first + k % 3, k // 3]
    for i in range(size - 1, -1, -1):
        b[first + i % 3, i // 3] /= M[i, i]
        for k in range(i + 1, size):
            b[first + i % 3, i // 3] -= M[k, i] * b[first + k % 3, k // 3]


# Kernels of trees and of a rope between two connections, for a single system and for lanes; moved:
# mask of the lanes that get new factors.
_eliminate_trees = by_width(
    jit(lambda work, plan, moved: eliminate_trees(end_to_end(work), plan)), eliminate_trees_wide
)
_reduce_trees = by_width(
    jit(lambda work, plan: reduce_trees(end_to_end(work), plan)), reduce_trees_wide
)
_eliminate_between = by_width(
    jit(lambda work, n, moved: eliminate_between(end_to_end(work), n)), eliminate_between_wide
)
_reduce_between = by_width(
    jit(lambda work, n: reduce_between(end_to_end(work), n)), reduce_between_wide
)
_substitute_between = by_width(
    jit(lambda work, n: substitute_between(end_to_end(work), n)), substitute_between_wide
)
_substitute_trees = by_width(
    jit(lambda work, plan, joints: substitute_trees(end_to_end(work), plan, joints)),
    substitute_trees_wide,
)


@jit
def _add_between(system: Any, r: int, schur: Any) -> None:
    """Add a rope's Schur complement to both connections: block and force above, below, P."""
    joints, sheaves, matrix = system.joints, system.sheaves, system.joints.matrix
    low, high = joints.lower[r], joints.upper[r]
    Z, f, D, g, P = schur
    add_block(matrix, high, Z)
    push_force(joints, high, f)
    add_block(matrix, low, D)
    push_force(joints, low, g)
    couple_by(matrix, high, low, P)
    condense_flow(sheaves, joints, matrix, r, (Z, f))
    couple_flow(sheaves, joints, matrix, r, P)


@jit
def _condense(system: Any, moved: Any) -> None:
    """Add the Schur complements of trees and of ropes between dense connections."""
    stack, joints, plan, sheaves = system.stack, system.joints, system.joints.plan, system.sheaves
    chains, matrix = plan.dense.shape[0], joints.matrix
    for m in range(plan.sizes[ONTO]):
        r, j = plan.onto[m, 0], plan.onto[m, 1]
        Z, f = six(plan.sums, LEFT, chains + r), column(plan.sums, FORCE, chains + r)
        add_block(matrix, j, Z)
        push_force(joints, j, f)
        condense_flow(sheaves, joints, matrix, r, (Z, f))
    for m in range(plan.sizes[BETWEEN]):
        r = plan.between[m]
        work, n = work_of(stack, r)[0], stack.counts[r, ELEMENTS]
        _add_between(system, r, _eliminate_between(work, n, moved))


@jit
def put_ends(system: Any) -> None:
    """Set the corrections of rope ends to those of their connections, or 0 where prescribed."""
    stack, joints = system.stack, system.joints
    for r in range(stack.counts.shape[0]):
        work, n = work_of(stack, r)[0], stack.counts[r, ELEMENTS]
        low, high = joints.lower[r], joints.upper[r]
        for k in range(CORRECTION, CORRECTION + 3):
            if low != LOOSE:
                work[k, 0] = joints.work[k, low]
            elif first_free(stack, r) == 1:
                work[k, 0] = 0.0
            work[k, n] = joints.work[k, high] if high != LOOSE else 0.0
        substitute_flow(system.sheaves, joints, work, r, n)


@jit
def _substitute(system: Any) -> None:
    """Back-substitute all corrections from those of the dense connections."""
    stack, plan = system.stack, system.joints.plan
    put_ends(system)
    for m in range(plan.sizes[BETWEEN]):
        r = plan.between[m]
        _substitute_between(work_of(stack, r)[0], stack.counts[r, ELEMENTS])
    _substitute_trees(work_of(stack, ZERO)[0], plan, system.joints.work)


@jit
def _solve_by_plan(system: Any, moved: Any) -> None:
    joints = system.joints
    _eliminate_trees(work_of(system.stack, ZERO)[0], joints.plan, moved)
    if joints.plan.sizes[DENSE] > 0:
        begin_forces(joints)
        _condense(system, moved)
        leave_out_trees(joints, joints.matrix)
        factorise(joints.matrix)
        _keep_factor(joints, moved)
        substitute_dense(joints.factor, joints.work)
    _substitute(system)


@jit
def _keep_factor(joints: Any, moved: Any) -> None:
    """Store the factors of the dense system, which have overwritten its matrix."""
    for i in range(joints.matrix.shape[0]):
        for j in range(i + 1):
            joints.factor[i, j] = choose(moved, joints.matrix[i, j], joints.factor[i, j])


@jit
def _reduce_condensed(system: Any) -> None:
    """Add the condensed forces of trees and of ropes between dense connections."""
    stack, joints, plan = system.stack, system.joints, system.joints.plan
    chains = plan.dense.shape[0]
    for m in range(plan.sizes[ONTO]):
        push_force(joints, plan.onto[m, 1], column(plan.sums, FORCE, chains + plan.onto[m, 0]))
    for m in range(plan.sizes[BETWEEN]):
        r = plan.between[m]
        f, g = _reduce_between(work_of(stack, r)[0], stack.counts[r, ELEMENTS])
        push_force(joints, joints.upper[r], f)
        push_force(joints, joints.lower[r], g)


@jit_noinline
def reduce_system(system: Any) -> None:
    """Solve for all corrections from the residuals, with the factors of the last elimination."""
    joints = system.joints
    _reduce_trees(work_of(system.stack, ZERO)[0], joints.plan)
    if joints.plan.sizes[DENSE] > 0:
        begin_forces(joints)
        _reduce_condensed(system)
        substitute_dense(joints.factor, joints.work)
    _substitute(system)


@jit
def _condense_coupled(system: Any, work: Any, n: int, r: int) -> None:
    """Condense a rope with bending to its connections."""
    joints, sheaves, matrix = system.joints, system.sheaves, system.joints.matrix
    low, high = joints.lower[r], joints.upper[r]
    if low == LOOSE:
        Z, f = eliminate_coupled_upward(work, first_free(system.stack, r), n)
        if high != LOOSE:
            add_block(matrix, high, Z)
            push_force(joints, high, f)
            condense_flow(sheaves, joints, matrix, r, (Z, f))
    elif high == LOOSE:
        Z, f = eliminate_coupled_downward(work, n)
        add_block(matrix, low, Z)
        push_force(joints, low, f)
    else:
        _add_between(system, r, eliminate_coupled_between(work, n))


@jit
def _solve_coupled(system: Any) -> None:
    stack, joints = system.stack, system.joints
    begin_forces(joints)
    for r in range(stack.counts.shape[0]):
        _condense_coupled(system, work_of(stack, r)[0], stack.counts[r, ELEMENTS], r)
    factorise(joints.matrix)
    substitute_dense(joints.matrix, joints.work)
    put_ends(system)
    for r in range(stack.counts.shape[0]):
        work, n = work_of(stack, r)[0], stack.counts[r, ELEMENTS]
        if joints.lower[r] == LOOSE:
            substitute_coupled_upward(work, first_free(stack, r), n)
        elif joints.upper[r] == LOOSE:
            substitute_coupled_downward(work, n)
        else:
            substitute_coupled_between(work, n)


_solve = selected_by(
    couples,
    lambda effects, system, moved: _solve_coupled(system),
    lambda effects, system, moved: _solve_by_plan(system, moved),
)
_push = selected_by(
    couples, lambda effects, system: None, lambda effects, system: reduce_system(system)
)


@jit_noinline
def solve_system(system: Any) -> None:
    """Solve for the corrections of all nodes from residuals and blocks of ropes and connections."""
    _solve(effects_at(system.stack.effects, ZERO), system, True)


@jit_noinline
def solve_lanes(system: Any, moved: Any) -> None:
    """Solve for the corrections in all lanes; those of `moved` get new factors."""
    _solve(system.stack.effects, system, moved)


@jit_noinline
def reduce_lanes(system: Any) -> None:
    """Solve for all corrections from the residuals, with each lane's existing factors.

    Does nothing with bending, where factors are not reused.
    """
    _push(system.stack.effects, system)
