"""Connections of a multi-line system and links between them: topology, motion and balance.

A connection (joint) is a point with three unknowns. Its mass and loads are those of the half
elements of the ropes that end there, of a payload (the `load_end` of the one rope that owns it) and
of links. The motion of a connection is stored once and copied to the end nodes of its ropes, so
that they are bit-identical.

**Links** are spring-dampers from a connection to a fixed point (tether) or another one (strut). The
tension of a link along the line between its ends is FORCE + STIFFNESS·(l - LENGTH) + DAMPING·dl/dt,
at least LEAST: 0 for a rope, minus infinity for a bar that also takes compression. A tether with
FORCE alone is a constant-tension tugger.

Its block is AXIAL·d·dᵀ + GEOMETRIC·I like that of an element. A bar in compression has no geometric
part: it would be negative, p·T/l, which is negligible relative to the mass at its ends.


"""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt
from typing import Any, NamedTuple

import numpy as np

from rope_twin.core.elimination import RECORD, six
from rope_twin.core.jit.decorators import jit, jit_within
from rope_twin.core.jit.functions import rounded
from rope_twin.core.jit.rows import column
from rope_twin.core.jit.wide import choose, count_beyond, whole
from rope_twin.core.joined.plan import DENSE, Plan, Topology, new_plan, write_plan
from rope_twin.core.joined.stack import (
    FLOW_COLUMN,
    NOWHERE,
    POINT,
    SHEAVE_ROWS,
    LaneStack,
    Sheaves,
    Stack,
    load,
    new_stack,
    view_of,
    work_of,
)
from rope_twin.core.loads.hooks import couples
from rope_twin.core.state import (
    BLOCK,
    CORRECTION,
    ELEMENTS,
    LINK2_MIN,
    MOTIONS,
    NODE_ROWS,
    POSITION,
    RESIDUAL,
    VELOCITY,
    WORK_ROWS,
    ZERO,
    Boundary,
    Floats,
    Ints,
    Model,
    Rope,
)

ANCHORED = -1  # in the row SECOND: the link's other end is the fixed point AT
# Properties of a link, and results of the step; one column per link:
FIRST, SECOND = 0, 1  # joints at its ends
AT = 2  # the fixed point [m]
FORCE, LENGTH, STIFFNESS, DAMPING, LEAST = 5, 6, 7, 8, 9  # [N], [m], [N/m], [N·s/m], [N]
TOWARDS = 10  # unit vector from the first end to the second
PULL, EXPECTED, AXIAL, GEOMETRIC, TIE_ROWS = 13, 14, 15, 16, 17


@jit_within
def _difference(ties: Any, work: Any, first: int, k: int, fixed: Any) -> Any:
    """Return a vector at the second end relative to the first."""
    ax, ay, az = column(work, first, whole(ties[FIRST, k]))
    second = whole(ties[SECOND, k])
    if second != ANCHORED:
        fixed = column(work, first, second)
    return fixed[0] - ax, fixed[1] - ay, fixed[2] - az


@jit
def pull_ties(ties: Any, work: Any, p: float, q: float) -> None:
    """Set direction, tension and stiffness of all links from the motion of the connections."""
    zero = (0.0, 0.0, 0.0)
    for k in range(ties.shape[1]):
        x, y, z = _difference(ties, work, POSITION, k, column(ties, AT, k))
        vx, vy, vz = _difference(ties, work, VELOCITY, k, zero)
        length = sqrt(x * x + y * y + z * z + LINK2_MIN)
        x, y, z = x / length, y / length, z / length
        rate = x * vx + y * vy + z * vz
        pull = ties[FORCE, k] + ties[STIFFNESS, k] * (length - ties[LENGTH, k])
        pull += ties[DAMPING, k] * rate
        acts = pull > ties[LEAST, k]
        pull = choose(acts, pull, ties[LEAST, k])
        across = p * max(pull, 0.0) / length
        along = p * ties[STIFFNESS, k] + q * ties[DAMPING, k] - across
        ties[TOWARDS, k], ties[TOWARDS + 1, k], ties[TOWARDS + 2, k] = x, y, z
        ties[PULL, k] = pull
        ties[AXIAL, k] = choose(acts, max(along, 0.0), 0.0)
        ties[GEOMETRIC, k] = across


@jit
def add_ties(ties: Any, work: Any, matrix: Any) -> None:
    """Add forces and blocks of the links to the connections (the matrix's lower triangle)."""
    for k in range(ties.shape[1]):
        i, j = whole(ties[FIRST, k]), whole(ties[SECOND, k])
        for a in range(3):
            # prevents contraction, which would depend on loop splitting by LLVM
            force = rounded(ties[PULL, k], ties[TOWARDS + a, k])
            work[RESIDUAL + a, i] += force
            if j != ANCHORED:
                work[RESIDUAL + a, j] -= force
            for b in range(3):
                block = ties[AXIAL, k] * ties[TOWARDS + a, k] * ties[TOWARDS + b, k]
                if a == b:
                    block += ties[GEOMETRIC, k]
                if a >= b:
                    matrix[3 * i + a, 3 * i + b] += block
                if j != ANCHORED:
                    if a >= b:
                        matrix[3 * j + a, 3 * j + b] += block
                    matrix[3 * max(i, j) + a, 3 * min(i, j) + b] -= block


@jit
def expect_pulls(ties: Any, work: Any) -> None:
    """Store the tension that the linearisation predicts after the correction."""
    for k in range(ties.shape[1]):
        dx, dy, dz = _difference(ties, work, CORRECTION, k, (0.0, 0.0, 0.0))
        x, y, z = column(ties, TOWARDS, k)
        along = x * dx + y * dy + z * dz
        ties[EXPECTED, k] = ties[PULL, k] + (ties[AXIAL, k] + ties[GEOMETRIC, k]) * along


@jit
def count_unexpected_ties(ties: Any, tolerance: Any) -> int:
    """Return the number of links whose tension deviates from the linearisation, or is NaN.

    In lanes: a bit mask of the lanes with such a link.
    """
    count = 0
    for k in range(ties.shape[1]):
        count = count_beyond(count, ties[PULL, k], ties[EXPECTED, k], tolerance)
    return count


# Columns of the stack's model:
FIRST_FREE, STEP = map(Model._fields.index, ("first_free", "step"))
LOOSE = -1  # unconnected end: an upper one is a hang-off, a lower one is free or fixed


class Joints(NamedTuple):
    """Topology and motion of the connections of a system."""

    lower: Ints  # joint at the lower end of each rope, or LOOSE
    upper: Ints  # joint at its upper end, or LOOSE: a hang-off with prescribed motion and payout
    nodes: Floats  # position, velocity, acceleration, (NODE_ROWS, joints); restart data, together
    # with the ropes' states
    ties: Floats  # tethers and struts, (TIE_ROWS, ties); see core/joined/joints.py
    work: Floats  # scratch, (WORK_ROWS, joints)
    matrix: Floats  # scratch: blocks of the connections, (3·joints, 3·joints)
    factor: Floats  # scratch: with what is condensed onto them, factorised
    speed: Floats  # scratch: payout speed of each rope in this stage [m/s]
    plan: Plan  # order of elimination; see `renew_plan`


class System(NamedTuple):
    """A multi-line system: ropes that are solved together."""

    ropes: tuple[Rope, ...]  # with the same effects, each with at least two elements
    joints: Joints
    stack: Stack  # the ropes are views of it, unless their arrays were replaced
    sheaves: Sheaves | None = None  # None without sheaves; its type selects the compiled code


class Joined(NamedTuple):
    """Kernel data of a system."""

    stack: Stack | LaneStack
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
        factor=np.zeros((3 * count, 3 * count)),
        speed=np.zeros(len(ropes)),
        plan=new_plan(len(ropes), count, stack.s.size),
    )
    return System(tuple(joined), joints, stack)


def loaded_ends(system: System) -> tuple[bool, ...]:
    """Return whether the upper end of each rope carries loads; a connection does, no hang-off."""
    return tuple(bool(upper != LOOSE) for upper in system.joints.upper)


def with_flows(joints: Joints, more: int) -> Joints:
    """Return connections with additional columns for the flows over sheaves."""
    count = joints.nodes.shape[1] + more
    nodes: Floats = np.zeros((NODE_ROWS, count))
    nodes[:, : count - more] = joints.nodes
    return joints._replace(
        nodes=nodes,
        work=np.zeros((WORK_ROWS, count)),
        matrix=np.zeros((3 * count, 3 * count)),
        factor=np.zeros((3 * count, 3 * count)),
        plan=new_plan(len(joints.lower), count, joints.plan.records.size // RECORD - 1),
    )


def renew_plan(system: System) -> bool:
    """Update the plan for the present numbers of elements; return whether it changed."""
    joints, stack = system.joints, system.stack
    counts = stack.counts[:, ELEMENTS]
    if (joints.plan.counts == counts).all():
        return False
    write_plan(joints.plan, topology_of(system, stack.work.shape[1] * stack.work.shape[2]), counts)
    return True


def topology_of(system: System, columns: int) -> Topology:
    """Return the topology for the plan; columns: offset between nodes of successive ropes."""
    joints, sheaves, stack = system.joints, system.sheaves, system.stack
    coupled = {*joints.ties[FIRST].astype(int), *joints.ties[SECOND].astype(int)} - {LOOSE}
    if couples(map(type, system.ropes[0].effects)):  # all connections are dense, without a plan
        coupled |= set(range(joints.nodes.shape[1]))
    for effect in stack.effects:
        coupled |= set(getattr(effect, "joints", ()))
    if sheaves is not None:
        coupled |= set(sheaves.figures[[POINT, FLOW_COLUMN]].astype(int).ravel())
    return Topology(
        lower=tuple(joints.lower.tolist()),
        upper=tuple(joints.upper.tolist()),
        first=tuple(stack.model[:, FIRST_FREE].astype(int).tolist()),
        coupled=frozenset(int(j) for j in coupled),
        columns=columns,
        joints=joints.nodes.shape[1],
    )


@jit_within
def first_free(stack: Any, r: int) -> int:
    """Return the lowest free node of rope r."""
    return int(stack.model[r, FIRST_FREE])


@jit_within
def count_joints(joints: Any) -> int:
    """Return the number of connections, and of flows over sheaves."""
    return int(joints.plan.dense.shape[0])


@jit
def place_ends(system: Any) -> None:
    """Copy the motion of the connections to the ropes' end nodes."""
    stack, joints = system.stack, system.joints
    for r in range(stack.counts.shape[0]):
        work, low, high = work_of(stack, r)[0], joints.lower[r], joints.upper[r]
        n = stack.counts[r, ELEMENTS]
        for k in range(NODE_ROWS):
            if low != LOOSE:
                work[POSITION + k, 0] = joints.work[POSITION + k, low]
            if high != LOOSE:
                work[POSITION + k, n] = joints.work[POSITION + k, high]


@jit
def _add_end(joints: Any, work: Any, i: int, joint: int) -> None:
    """Add residual and block of a rope's end node to those of its connection."""
    for k in range(RESIDUAL, RESIDUAL + 3):
        joints.work[k, joint] += work[k, i]
    if joints.plan.sizes[DENSE] > 0:
        add_block(joints.matrix, joint, six(work, BLOCK, i))


@jit
def add_block(matrix: Any, joint: int, S: Any) -> None:
    """Add a symmetric block (xx, xy, xz, yy, yz, zz) to the diagonal block of a connection."""
    i = 3 * joint
    matrix[i, i] += S[0]
    matrix[i + 1, i] += S[1]
    matrix[i + 2, i] += S[2]
    matrix[i + 1, i + 1] += S[3]
    matrix[i + 2, i + 1] += S[4]
    matrix[i + 2, i + 2] += S[5]


@jit
def couple_blocks(matrix: Any, upper: int, lower: int, S: Any) -> None:
    """Subtract a symmetric block (xx, xy, xz, yy, yz, zz) between two connections."""
    i, j = 3 * upper, 3 * lower
    xx, xy, xz, yy, yz, zz = S
    for r, row in enumerate(((xx, xy, xz), (xy, yy, yz), (xz, yz, zz))):
        for c in range(3):
            matrix[i + r, j + c] -= row[c]


@jit
def clear(joints: Any) -> None:
    """Clear forces and matrix of the connections."""
    work, matrix = joints.work, joints.matrix
    for k in range(RESIDUAL, RESIDUAL + 3):
        for j in range(count_joints(joints)):
            work[k, j] = 0.0
    for i in range(matrix.shape[0]):
        for j in range(matrix.shape[1]):
            matrix[i, j] = 0.0


@jit
def gather_ends(system: Any) -> None:
    """Add residuals and blocks of all rope ends to those of their connections."""
    stack, joints = system.stack, system.joints
    for r in range(stack.counts.shape[0]):
        work = work_of(stack, r)[0]
        if joints.lower[r] != LOOSE:
            _add_end(joints, work, ZERO, joints.lower[r])
        if joints.upper[r] != LOOSE:
            _add_end(joints, work, stack.counts[r, ELEMENTS], joints.upper[r])


@jit
def joint_slope(joints: Any) -> float:
    """Return R·delta summed over the connections."""
    total = 0.0
    for j in range(joints.nodes.shape[1]):
        R, d = column(joints.work, RESIDUAL, j), column(joints.work, CORRECTION, j)
        total += R[0] * d[0] + R[1] * d[1] + R[2] * d[2]
    return total


class Wheel(NamedTuple):
    """A sheave with the two ropes that form one line over it; both have it at their upper end."""

    point: int  # joint at its axis
    into: int  # the rope that a positive flow lengthens
    out: int  # the rope that it shortens
    mass: float = 0.0  # [kg]
    weight: float = 0.0  # in water [N]
    inertia: float = 0.0  # moment of inertia over radius squared [kg]
    friction: float = 0.0  # F/F' = exp(friction·angle of wrap)


def reeve(system: System, wheels: Sequence[Wheel]) -> System:
    """Return the system with its ropes running over these sheaves, the flow over each being 0.

    The ropes of one sheave have the same properties at their upper ends and one section each.

    Raises:
        ValueError: a wheel's ropes do not end there, or differ in their properties.
    """
    joints, first = system.joints, system.joints.nodes.shape[1]
    if not wheels:
        return system
    figures = np.zeros((SHEAVE_ROWS, len(wheels)))
    sheave_of = np.full(len(system.ropes), NOWHERE)
    side, base = np.zeros(len(sheave_of)), np.zeros(len(sheave_of))
    for k, wheel in enumerate(wheels):
        figures[:, k] = (
            wheel.point, first + k, wheel.into, wheel.out, wheel.mass, wheel.weight,
            wheel.inertia, wheel.friction,
        )  # fmt: skip
        into, out = (system.ropes[r].sections for r in (wheel.into, wheel.out))
        if into.shape != out.shape or into.shape[1] != 1 or (into != out).any():
            raise ValueError(f"reeve: ropes {wheel.into} and {wheel.out} are of different material")
        for r, sign in ((wheel.into, 1.0), (wheel.out, -1.0)):
            if joints.upper[r] != wheel.point or sheave_of[r] != NOWHERE:
                raise ValueError(f"reeve: rope {r} does not end at joint {wheel.point} alone")
            state = system.ropes[r].state
            sheave_of[r], side[r], base[r] = k, sign, state.s[state.counts[ELEMENTS]]
    size = (2 * len(sheave_of), MOTIONS)
    sheaves = Sheaves(
        figures,
        sheave_of,
        side,
        base,
        np.zeros((3, len(sheave_of))),
        Boundary(np.zeros(size), np.zeros(size)),
    )
    return system._replace(joints=with_flows(joints, len(wheels)), sheaves=sheaves)
