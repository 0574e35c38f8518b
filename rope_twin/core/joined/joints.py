"""Ropes that meet: which ends meet where, and the few equations of the joints themselves.

A joint is a point with three unknowns. Its mass and loads are those of the half elements of the
ropes that meet there, of a payload (the `load_end` of the one rope that owns it) and of ties. Each
rope is eliminated onto its joints (core/joined/chains.py); the joints are then one small dense
system, solved by LDLᵀ, and the ropes' nodes follow. All of it is O(nodes), and a single rope has no
part in it.

Where ends meet, the joint's motion is the one truth: it is copied to the nodes of the ends, so
that they coincide to the bit.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from rope_twin.core.jit.decorators import jit, jit_ordered, jit_within
from rope_twin.core.jit.rows import column
from rope_twin.core.joined.condensation import (
    eliminate_between,
    eliminate_downward,
    eliminate_upward,
    substitute_between,
    substitute_downward,
    substitute_upward,
)
from rope_twin.core.joined.sheaves import Sheaves, condense_flow, couple_flow, substitute_flow
from rope_twin.core.joined.stack import Stack, effects_at, load, new_stack, view_of
from rope_twin.core.joined.ties import TIE_ROWS
from rope_twin.core.state import (
    BLOCK,
    CORRECTION,
    ELEMENTS,
    NODE_ROWS,
    POSITION,
    RESIDUAL,
    WORK_ROWS,
    ZERO,
    Floats,
    Ints,
    Model,
    Rope,
)

# Columns of the stack's model:
FIRST_FREE, STEP, TOLERANCE = map(Model._fields.index, ("first_free", "step", "tolerance"))
LOOSE = -1  # an end at no joint: an upper one is a hang-off, a lower one is free or fixed


class Joints(NamedTuple):
    """Where ropes meet, and how the joints move."""

    lower: Ints  # joint at the lower end of each rope, or LOOSE
    upper: Ints  # joint at its upper end, or LOOSE: a hang-off with prescribed motion and line out
    nodes: Floats  # position, velocity, acceleration, (NODE_ROWS, joints); with the ropes' states
    # it is all that a restart needs
    ties: Floats  # tethers and struts, (TIE_ROWS, ties); see core/joined/ties.py
    work: Floats  # scratch, (WORK_ROWS, joints)
    matrix: Floats  # scratch, (3·joints, 3·joints)
    speed: Floats  # scratch: payout speed of each rope in this stage [m/s]


class System(NamedTuple):
    """Ropes that move together."""

    ropes: tuple[Rope, ...]  # with the same effects, each with at least two elements
    joints: Joints
    stack: Stack  # of which the ropes are views, unless they were given other arrays
    sheaves: Sheaves | None = None  # None: rope runs over none; its type picks the compiled code


class Joined(NamedTuple):
    """What the kernels see of a system."""

    stack: Stack
    joints: Joints
    sheaves: Sheaves | None


def new_system(
    ropes: tuple[Rope, ...], lower: list[int], upper: list[int], ties: Floats | None = None
) -> System:
    """Join ropes; the joints stand where the last rope that reaches them ends.

    lower, upper: the joint at each rope's ends, or LOOSE. The ropes move into one stack; a rope
    whose lower end is at a joint holds its node 0 there.
    """
    count = 1 + max([*lower, *upper, LOOSE])
    nodes = np.zeros((NODE_ROWS, count))
    stack = new_stack(ropes)
    joined = []
    for r, (rope, low, high) in enumerate(zip(ropes, lower, upper, strict=True)):
        n = int(rope.state.counts[ELEMENTS])
        if low != LOOSE:
            rope = rope._replace(model=rope.model._replace(first_free=1))
            nodes[:, low] = rope.state.nodes[:, 0]
        if high != LOOSE:
            nodes[:, high] = rope.state.nodes[:, n]
        load(stack, r, rope)
        joined.append(view_of(stack, r, rope))
    joints = Joints(
        lower=np.array(lower),
        upper=np.array(upper),
        nodes=nodes,
        ties=np.zeros((TIE_ROWS, 0)) if ties is None else ties,
        work=np.zeros((WORK_ROWS, count)),
        matrix=np.zeros((3 * count, 3 * count)),
        speed=np.zeros(len(ropes)),
    )
    return System(tuple(joined), joints, stack)


def with_flows(joints: Joints, more: int) -> Joints:
    """Joints with so many columns more, for the flows over sheaves."""
    count = joints.nodes.shape[1] + more
    nodes: Floats = np.zeros((NODE_ROWS, count))
    nodes[:, : count - more] = joints.nodes
    return joints._replace(
        nodes=nodes,
        work=np.zeros((WORK_ROWS, count)),
        matrix=np.zeros((3 * count, 3 * count)),
    )


@jit_within
def first_free(stack: Any, r: int) -> int:
    """Lowest node of rope r that is free."""
    return int(stack.model[r, FIRST_FREE])


@jit
def place_ends(system: Any) -> None:
    """Give the ropes' ends the motion of their joints."""
    stack, joints = system.stack, system.joints
    for r in range(stack.counts.shape[0]):
        work, low, high = stack.work[r], joints.lower[r], joints.upper[r]
        n = stack.counts[r, ELEMENTS]
        for k in range(joints.nodes.shape[0]):
            if low != LOOSE:
                work[POSITION + k, 0] = joints.work[POSITION + k, low]
            if high != LOOSE:
                work[POSITION + k, n] = joints.work[POSITION + k, high]


@jit
def _add_end(joints: Any, work: Any, i: int, joint: int) -> None:
    """Residual and block of a rope's end node join those of its joint."""
    S, R = work[BLOCK : BLOCK + 6], work[RESIDUAL : RESIDUAL + 3]
    for k in range(3):
        joints.work[RESIDUAL + k, joint] += R[k, i]
    add_block(joints.matrix, joint, (S[0, i], S[1, i], S[2, i], S[3, i], S[4, i], S[5, i]))


@jit
def add_block(matrix: Any, joint: int, S: Any) -> None:
    """A symmetric block (xx, xy, xz, yy, yz, zz) joins a joint's own."""
    i = 3 * joint
    matrix[i, i] += S[0]
    matrix[i + 1, i] += S[1]
    matrix[i + 2, i] += S[2]
    matrix[i + 1, i + 1] += S[3]
    matrix[i + 2, i + 1] += S[4]
    matrix[i + 2, i + 2] += S[5]


@jit
def clear(joints: Any) -> None:
    """No forces and no matrix yet."""
    joints.work[RESIDUAL : RESIDUAL + 3, :] = 0.0
    joints.matrix[:, :] = 0.0


@jit
def gather_ends(system: Any) -> None:
    """Residuals and blocks of all ends join those of their joints."""
    stack, joints = system.stack, system.joints
    for r in range(stack.counts.shape[0]):
        if joints.lower[r] != LOOSE:
            _add_end(joints, stack.work[r], ZERO, joints.lower[r])
        if joints.upper[r] != LOOSE:
            _add_end(joints, stack.work[r], stack.counts[r, ELEMENTS], joints.upper[r])


@jit
def _push(joints: Any, joint: int, f: Any) -> None:
    """What a chain leaves on a joint joins the right-hand side, which CORRECTION holds."""
    for k in range(3):
        joints.work[CORRECTION + k, joint] += f[k]


@jit
def _couple(matrix: Any, upper: int, lower: int, P: Any) -> None:
    """-P between two joints, in the lower triangle; on the diagonal if they are the same."""
    for k in range(3):
        for c in range(3):
            i, j = 3 * upper + k, 3 * lower + c
            if i >= j:
                matrix[i, j] -= P[c][k]
            if j >= i:
                matrix[j, i] -= P[c][k]


@jit
def _condense(system: Any, work: Any, first: int, n: int, r: int) -> None:
    """Eliminate rope r onto its joints."""
    joints, sheaves = system.joints, system.sheaves
    effects = effects_at(system.stack.effects, r)
    low, high = joints.lower[r], joints.upper[r]
    if low == LOOSE:
        Z, f = eliminate_upward(effects, work, first, n)
        if high != LOOSE:
            add_block(joints.matrix, high, Z)
            _push(joints, high, f)
            condense_flow(sheaves, joints, r, (Z, f))
    elif high == LOOSE:
        Z, f = eliminate_downward(effects, work, n)
        add_block(joints.matrix, low, Z)
        _push(joints, low, f)
    else:
        Z, f, D, g, P = eliminate_between(effects, work, n)
        add_block(joints.matrix, high, Z)
        _push(joints, high, f)
        add_block(joints.matrix, low, D)
        _push(joints, low, g)
        _couple(joints.matrix, high, low, P)
        condense_flow(sheaves, joints, r, (Z, f))
        couple_flow(sheaves, joints, r, P)


@jit
def _substitute(system: Any, work: Any, first: int, n: int, r: int) -> None:
    """Corrections of rope r from those of its joints."""
    joints, effects = system.joints, effects_at(system.stack.effects, r)
    low, high = joints.lower[r], joints.upper[r]
    for k in range(CORRECTION, CORRECTION + 3):
        if low != LOOSE:
            work[k, 0] = joints.work[k, low]
        work[k, n] = joints.work[k, high] if high != LOOSE else 0.0
    substitute_flow(system.sheaves, joints, work, r, n)
    if low == LOOSE:
        substitute_upward(effects, work, first, n)
    elif high == LOOSE:
        substitute_downward(effects, work, n)
    else:
        substitute_between(effects, work, n)


@jit_ordered
def _solve_joints(M: Any, b: Any) -> None:
    """M·x = b for a symmetric positive definite M (its lower triangle), by LDLᵀ in place.

    b: (3, joints), of which x takes the place.
    """
    size = M.shape[0]
    for j in range(size):
        for i in range(j, size):
            total = M[i, j]
            for k in range(j):
                total -= M[i, k] * M[j, k] * M[k, k]
            M[i, j] = total if i == j else total / M[j, j]
    for i in range(size):
        for k in range(i):
            b[i % 3, i // 3] -= M[i, k] * b[k % 3, k // 3]
    for i in range(size - 1, -1, -1):
        b[i % 3, i // 3] /= M[i, i]
        for k in range(i + 1, size):
            b[i % 3, i // 3] -= M[k, i] * b[k % 3, k // 3]


@jit
def solve_system(system: Any) -> None:
    """Corrections of all nodes, where residuals and blocks of ropes and joints are known."""
    stack, joints = system.stack, system.joints
    for k in range(3):
        for j in range(joints.nodes.shape[1]):
            joints.work[CORRECTION + k, j] = joints.work[RESIDUAL + k, j]
    for r in range(stack.counts.shape[0]):
        _condense(system, stack.work[r], first_free(stack, r), stack.counts[r, ELEMENTS], r)
    _solve_joints(joints.matrix, joints.work[CORRECTION : CORRECTION + 3])
    for r in range(stack.counts.shape[0]):
        _substitute(system, stack.work[r], first_free(stack, r), stack.counts[r, ELEMENTS], r)


@jit
def joint_slope(joints: Any) -> float:
    """R·delta of the joints."""
    total = 0.0
    for j in range(joints.nodes.shape[1]):
        R, d = column(joints.work, RESIDUAL, j), column(joints.work, CORRECTION, j)
        total += R[0] * d[0] + R[1] * d[1] + R[2] * d[2]
    return total
