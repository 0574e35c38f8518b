"""Linear solve of a Newton iteration: trees of ropes, the dense system of connections, and back.

A plan (core/joined/plan) says which ropes are eliminated as trees and which connections are left
for a dense system, solved by LDLᵀ. All of it is O(nodes). Where an effect couples a node beyond its
next neighbours (bending), every connection belongs to the dense system and ropes are condensed onto
them one way. `push_system` solves for other forces with the factors of the last elimination; it is
for plans without bending and sheaves.

**Trees** are eliminated two nodes at a time, every node onto its neighbour nearer to the root, as
in `core/tridiagonal` for one rope. A connection's residual and block are the sums over the rope
ends there; the chain that leads on from it begins with what the others left.
"""

from __future__ import annotations

from typing import Any

from rope_twin.core.elimination import (
    RECORD,
    eliminate_pair,
    lanes,
    push_pair,
    pushed_on,
    six,
    six_lanes,
    solve_symmetric,
    spring,
    substitute_pair,
    two,
    two_of_six,
)
from rope_twin.core.jit.decorators import jit, jit_apart, jit_ordered
from rope_twin.core.jit.rows import column, end_to_end, lane, rows, table_rows
from rope_twin.core.joined.chains import (
    eliminate_between,
    eliminate_coupled_between,
    eliminate_coupled_downward,
    eliminate_coupled_upward,
    push_between,
    substitute_between,
    substitute_coupled_between,
    substitute_coupled_downward,
    substitute_coupled_upward,
)
from rope_twin.core.joined.joints import LOOSE, add_block, first_free
from rope_twin.core.joined.plan import (
    A_BEGIN,
    A_INTO,
    A_WAY,
    B_BEGIN,
    B_INTO,
    B_WAY,
    BETWEEN,
    CARRY,
    COLUMN,
    COUNT,
    DENSE,
    ENDS,
    FORCE,
    HELD,
    IDLE,
    JOINT,
    KEPT,
    LEFT,
    NOWHERE,
    ONTO,
    ROOTS,
    SPANS,
    SUMMED,
    A,
    B,
)
from rope_twin.core.joined.sheaves import condense_flow, couple_flow, substitute_flow
from rope_twin.core.joined.stack import effects_at
from rope_twin.core.loads.hooks import chosen_by, couples
from rope_twin.core.state import BLOCK, CORRECTION, ELEMENTS, RESIDUAL, ZERO

_records = table_rows("scratch 0", 1)
_NIL = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
_NONE = (0.0, 0.0, 0.0)


@jit
def _begin_sums(plan: Any, work: Any) -> None:
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
    _begin_tree_forces(plan, work)


@jit
def _begin_tree_forces(plan: Any, work: Any) -> None:
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
def _add_force(sums: Any, slot: int, f: Any) -> None:
    """Leave the force of a chain at its end; NOWHERE: it goes on."""
    if slot != NOWHERE:
        sums[FORCE, slot] += f[0]
        sums[FORCE + 1, slot] += f[1]
        sums[FORCE + 2, slot] += f[2]


@jit
def _add(sums: Any, slot: int, Z: Any, f: Any) -> None:
    """Leave Schur complement and force of a chain at its end."""
    if slot != NOWHERE:
        for k in range(6):
            sums[LEFT + k, slot] += Z[k]
    _add_force(sums, slot, f)


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
    _begin_tree_forces(plan, work)
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


_solve = chosen_by(
    couples,
    lambda effects, system: _solve_coupled(system),
    lambda effects, system: _solve_by_plan(system),
)


@jit_apart
def solve_system(system: Any) -> None:
    """Solve for the corrections of all nodes from residuals and blocks of ropes and connections."""
    _solve(effects_at(system.stack.effects, ZERO), system)
