"""Linear solve of a Newton iteration: trees of ropes, the dense system of connections, and back.

A plan (core/joined/plan) says which ropes are eliminated as trees and which connections are left
for a dense system, solved by LDLᵀ. All of it is O(nodes). Where an effect couples a node beyond its
next neighbours (bending), every connection belongs to the dense system and ropes are condensed onto
them one way. `push_system` solves for other forces with the factors of the last elimination; it is
for plans without bending and sheaves.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numba import config
from numba.extending import overload

from rope_twin.core.banded.nodes import six
from rope_twin.core.jit.decorators import LINKED, jit, jit_apart, jit_ordered, jit_within
from rope_twin.core.jit.rows import column
from rope_twin.core.joined.between import eliminate_between, push_between, substitute_between
from rope_twin.core.joined.coupled_chains import (
    eliminate_coupled_between,
    eliminate_coupled_downward,
    eliminate_coupled_upward,
    substitute_coupled_between,
    substitute_coupled_downward,
    substitute_coupled_upward,
)
from rope_twin.core.joined.joints import LOOSE, add_block, first_free
from rope_twin.core.joined.plan import BETWEEN, DENSE, FORCE, LEFT, ONTO
from rope_twin.core.joined.sheaves import (
    condense_flow,
    couple_flow,
    substitute_flow,
)
from rope_twin.core.joined.stack import effects_at
from rope_twin.core.joined.trees import eliminate_trees, push_trees, substitute_trees
from rope_twin.core.loads.hooks import couples
from rope_twin.core.state import CORRECTION, ELEMENTS, RESIDUAL, ZERO

if config.DISABLE_JIT:

    def end_to_end(work: Any) -> Any:
        """Return a rope's scratch, rows of which go on in the ropes (or rows) that follow."""
        count = work.shape[0]
        return np.lib.stride_tricks.as_strided(work, (count, 2**40), work.strides)

else:

    @jit_within
    def end_to_end(work: Any) -> Any:
        """Return a rope's scratch as it is: its rows are not bounds-checked."""
        return work


_WITHIN = {**LINKED, "forceinline": True}  # inlined in the caller


@jit
def _push(joints: Any, joint: int, f: Any) -> None:
    """Add a condensed force to the right-hand side of a connection, held in CORRECTION."""
    for k in range(3):
        joints.work[CORRECTION + k, joint] += f[k]


@jit
def _couple(matrix: Any, upper: int, lower: int, P: Any) -> None:
    """Add -P between two connections (or of one to itself) to the lower triangle."""
    for k in range(3):
        for c in range(3):
            i, j = 3 * upper + k, 3 * lower + c
            if i >= j:
                matrix[i, j] -= P[c][k]
            if j >= i:
                matrix[j, i] -= P[c][k]


@jit
def _begin_matrix(joints: Any) -> None:
    """Begin the matrix to be factorised with the blocks of the connections."""
    for i in range(joints.matrix.shape[0]):
        for j in range(i + 1):
            joints.factor[i, j] = joints.matrix[i, j]


@jit
def _begin_forces(joints: Any) -> None:
    """Begin the right-hand side with the residuals of the connections."""
    for k in range(3):
        for j in range(joints.nodes.shape[1]):
            joints.work[CORRECTION + k, j] = joints.work[RESIDUAL + k, j]


@jit
def _leave_out_trees(joints: Any) -> None:
    """Replace the rows of connections that are eliminated in a tree by those of the identity."""
    matrix, dense = joints.factor, joints.plan.dense
    for j in range(dense.shape[0]):
        if dense[j] == 0:
            for i in range(3 * j, 3 * j + 3):
                matrix[i, :i] = 0.0
                matrix[i:, i] = 0.0
                matrix[i, i] = 1.0


@jit_ordered
def _factorise(M: Any) -> None:
    """Factorise a symmetric positive definite matrix (its lower triangle) in place: LDLᵀ."""
    for j in range(M.shape[0]):
        for i in range(j, M.shape[0]):
            total = M[i, j]
            for k in range(j):
                total -= M[i, k] * M[j, k] * M[k, k]
            M[i, j] = total if i == j else total / M[j, j]


@jit_ordered
def _substitute_dense(M: Any, b: Any) -> None:
    """Solve L·D·Lᵀ·x = b by the factors of `_factorise`; b: (3, joints), replaced by x."""
    size = M.shape[0]
    for i in range(size):
        for k in range(i):
            b[i % 3, i // 3] -= M[i, k] * b[k % 3, k // 3]
    for i in range(size - 1, -1, -1):
        b[i % 3, i // 3] /= M[i, i]
        for k in range(i + 1, size):
            b[i % 3, i // 3] -= M[k, i] * b[k % 3, k // 3]


@jit
def _condense(system: Any) -> None:
    """Add what trees and ropes between dense connections leave to the dense system."""
    stack, joints, plan, sheaves = system.stack, system.joints, system.joints.plan, system.sheaves
    matrix, chains = joints.factor, plan.dense.shape[0]
    for m in range(plan.sizes[ONTO]):
        r, j = plan.onto[m, 0], plan.onto[m, 1]
        Z, f = six(plan.sums, LEFT, chains + r), column(plan.sums, FORCE, chains + r)
        add_block(matrix, j, Z)
        _push(joints, j, f)
        condense_flow(sheaves, joints, r, (Z, f))
    for m in range(plan.sizes[BETWEEN]):
        r = plan.between[m]
        low, high = joints.lower[r], joints.upper[r]
        work, n = end_to_end(stack.work[r]), stack.counts[r, ELEMENTS]
        Z, f, D, g, P = eliminate_between(work, n)
        add_block(matrix, high, Z)
        _push(joints, high, f)
        add_block(matrix, low, D)
        _push(joints, low, g)
        _couple(matrix, high, low, P)
        condense_flow(sheaves, joints, r, (Z, f))
        couple_flow(sheaves, joints, r, P)


@jit
def _put_ends(system: Any) -> None:
    """Set the corrections of rope ends: of their connections, 0 where motion is prescribed."""
    stack, joints = system.stack, system.joints
    for r in range(stack.counts.shape[0]):
        work, n = stack.work[r], stack.counts[r, ELEMENTS]
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
    """Set all corrections from those of the dense connections and what was eliminated."""
    stack, plan = system.stack, system.joints.plan
    _put_ends(system)
    for m in range(plan.sizes[BETWEEN]):
        r = plan.between[m]
        substitute_between(end_to_end(stack.work[r]), stack.counts[r, ELEMENTS])
    substitute_trees(end_to_end(stack.work[0]), plan, system.joints.work)


@jit
def _solve_by_plan(system: Any) -> None:
    joints = system.joints
    eliminate_trees(end_to_end(system.stack.work[0]), joints.plan)
    if joints.plan.sizes[DENSE] > 0:
        _begin_matrix(joints)
        _begin_forces(joints)
        _condense(system)
        _leave_out_trees(joints)
        _factorise(joints.factor)
        _substitute_dense(joints.factor, joints.work[CORRECTION : CORRECTION + 3])
    _substitute(system)


@jit
def _push_condensed(system: Any) -> None:
    """Add the forces that trees and ropes between dense connections leave to the dense system."""
    stack, joints, plan = system.stack, system.joints, system.joints.plan
    chains = plan.dense.shape[0]
    for m in range(plan.sizes[ONTO]):
        _push(joints, plan.onto[m, 1], column(plan.sums, FORCE, chains + plan.onto[m, 0]))
    for m in range(plan.sizes[BETWEEN]):
        r = plan.between[m]
        f, g = push_between(end_to_end(stack.work[r]), stack.counts[r, ELEMENTS])
        _push(joints, joints.upper[r], f)
        _push(joints, joints.lower[r], g)


@jit_apart
def push_system(system: Any) -> None:
    """Solve for all corrections from the residuals, with the factors of the last elimination."""
    joints = system.joints
    push_trees(end_to_end(system.stack.work[0]), joints.plan)
    if joints.plan.sizes[DENSE] > 0:
        _begin_forces(joints)
        _push_condensed(system)
        _substitute_dense(joints.factor, joints.work[CORRECTION : CORRECTION + 3])
    _substitute(system)


@jit
def _condense_coupled(system: Any, work: Any, n: int, r: int) -> None:
    """Condense a rope with bending to its connections."""
    joints, sheaves = system.joints, system.sheaves
    low, high = joints.lower[r], joints.upper[r]
    if low == LOOSE:
        Z, f = eliminate_coupled_upward(work, first_free(system.stack, r), n)
        if high != LOOSE:
            add_block(joints.factor, high, Z)
            _push(joints, high, f)
            condense_flow(sheaves, joints, r, (Z, f))
    elif high == LOOSE:
        Z, f = eliminate_coupled_downward(work, n)
        add_block(joints.factor, low, Z)
        _push(joints, low, f)
    else:
        Z, f, D, g, P = eliminate_coupled_between(work, n)
        add_block(joints.factor, high, Z)
        _push(joints, high, f)
        add_block(joints.factor, low, D)
        _push(joints, low, g)
        _couple(joints.factor, high, low, P)
        condense_flow(sheaves, joints, r, (Z, f))
        couple_flow(sheaves, joints, r, P)


@jit
def _solve_coupled(system: Any) -> None:
    stack, joints = system.stack, system.joints
    _begin_matrix(joints)
    _begin_forces(joints)
    for r in range(stack.counts.shape[0]):
        _condense_coupled(system, stack.work[r], stack.counts[r, ELEMENTS], r)
    _factorise(joints.factor)
    _substitute_dense(joints.factor, joints.work[CORRECTION : CORRECTION + 3])
    _put_ends(system)
    for r in range(stack.counts.shape[0]):
        work, n = stack.work[r], stack.counts[r, ELEMENTS]
        if joints.lower[r] == LOOSE:
            substitute_coupled_upward(work, first_free(stack, r), n)
        elif joints.upper[r] == LOOSE:
            substitute_coupled_downward(work, n)
        else:
            substitute_coupled_between(work, n)


def _chosen(coupled: Any, plain: Any) -> Callable[[Any, Any], Any]:
    """Return f(effects, system) that calls `coupled` if an effect couples nodes, else `plain`."""

    def call(effects: Any, system: Any) -> Any:
        return (coupled if couples(map(type, effects)) else plain)(system)

    @overload(call, jit_options=_WITHIN, strict=False)
    def _choose(effects: Any, system: Any) -> Any:
        solve = coupled if couples(effect.instance_class for effect in effects) else plain
        return lambda effects, system: solve(system)

    return call


_solve = _chosen(_solve_coupled, _solve_by_plan)


@jit_apart
def solve_system(system: Any) -> None:
    """Solve for the corrections of all nodes from residuals and blocks of ropes and connections."""
    _solve(effects_at(system.stack.effects, ZERO), system)
