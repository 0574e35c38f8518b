"""Connections of a multi-line system: topology, and the dense system of the connections.

A connection (joint) is a point with three unknowns. Its mass and loads are those of the half
elements of the ropes that end there, of a payload (the `load_end` of the one rope that owns it) and
of links. Each rope is condensed to its connections (core/joined/chains.py); the connections then
form one small dense system, solved by LDLᵀ, followed by back-substitution in the ropes. All of it
is O(nodes); the code of a single rope does not contain it.

The motion of a connection is stored once and copied to the end nodes of its ropes, so that they
coincide bit for bit.
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
LOOSE = -1  # unconnected end: an upper one is a hang-off, a lower one is free or fixed


class Joints(NamedTuple):
    """Topology and motion of the connections of a system."""

    lower: Ints  # joint at the lower end of each rope, or LOOSE
    upper: Ints  # joint at its upper end, or LOOSE: a hang-off with prescribed motion and payout
    nodes: Floats  # position, velocity, acceleration, (NODE_ROWS, joints); restart data, together
    # with the ropes' states
    ties: Floats  # tethers and struts, (TIE_ROWS, ties); see core/joined/ties.py
    work: Floats  # scratch, (WORK_ROWS, joints)
    matrix: Floats  # scratch, (3·joints, 3·joints)
    speed: Floats  # scratch: payout speed of each rope in this stage [m/s]


class System(NamedTuple):
    """A multi-line system: ropes that are solved together."""

    ropes: tuple[Rope, ...]  # with the same effects, each with at least two elements
    joints: Joints
    stack: Stack  # the ropes are views of it, unless their arrays were replaced
    sheaves: Sheaves | None = None  # None without sheaves; its type selects the compiled code


class Joined(NamedTuple):
    """Kernel data of a system."""

    stack: Stack
    joints: Joints
    sheaves: Sheaves | None


def new_system(
    ropes: tuple[Rope, ...], lower: list[int], upper: list[int], ties: Floats | None = None
) -> System:
    """Connect ropes; each connection is placed at the end of the last rope that reaches it.

    lower, upper: the connection at each rope's ends, or LOOSE. The ropes move into one stack; node
    0 of a rope whose lower end is connected coincides with the connection.
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
    """Return connections with additional columns for the flows over sheaves."""
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
    """Return the lowest free node of rope r."""
    return int(stack.model[r, FIRST_FREE])


@jit
def place_ends(system: Any) -> None:
    """Copy the motion of the connections to the ropes' end nodes."""
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
    """Add residual and block of a rope's end node to those of its connection."""
    S, R = work[BLOCK : BLOCK + 6], work[RESIDUAL : RESIDUAL + 3]
    for k in range(3):
        joints.work[RESIDUAL + k, joint] += R[k, i]
    add_block(joints.matrix, joint, (S[0, i], S[1, i], S[2, i], S[3, i], S[4, i], S[5, i]))


@jit
def add_block(matrix: Any, joint: int, S: Any) -> None:
    """Add a symmetric block (xx, xy, xz, yy, yz, zz) to a connection's own."""
    i = 3 * joint
    matrix[i, i] += S[0]
    matrix[i + 1, i] += S[1]
    matrix[i + 2, i] += S[2]
    matrix[i + 1, i + 1] += S[3]
    matrix[i + 2, i + 1] += S[4]
    matrix[i + 2, i + 2] += S[5]


@jit
def clear(joints: Any) -> None:
    """Clear forces and matrix of the connections."""
    joints.work[RESIDUAL : RESIDUAL + 3, :] = 0.0
    joints.matrix[:, :] = 0.0


@jit
def gather_ends(system: Any) -> None:
    """Add residuals and blocks of all rope ends to those of their connections."""
    stack, joints = system.stack, system.joints
    for r in range(stack.counts.shape[0]):
        if joints.lower[r] != LOOSE:
            _add_end(joints, stack.work[r], ZERO, joints.lower[r])
        if joints.upper[r] != LOOSE:
            _add_end(joints, stack.work[r], stack.counts[r, ELEMENTS], joints.upper[r])


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
def _condense(system: Any, work: Any, first: int, n: int, r: int) -> None:
    """Condense rope r to its connections."""
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
    """Back-substitute rope r from the corrections of its connections."""
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
    """Solve M·x = b for a symmetric positive definite M (its lower triangle), by LDLᵀ in place.

    b: (3, joints), replaced by x.
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
    """Solve for the corrections of all nodes from residuals and blocks of ropes and connections."""
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
    """Return R·delta summed over the connections."""
    total = 0.0
    for j in range(joints.nodes.shape[1]):
        R, d = column(joints.work, RESIDUAL, j), column(joints.work, CORRECTION, j)
        total += R[0] * d[0] + R[1] * d[1] + R[2] * d[2]
    return total
