"""Connections of a system in the stages of the step: their motion, forces and corrections.

The functions of this module take a system (core/joined/ropes); of a rope by itself they leave no
code. The correction of a stage is applied to the connections at once. That of the ropes' nodes may
be pending: the next pass over the nodes applies it.
"""

from __future__ import annotations

from typing import Any

from rope_twin.core.elements import count_unexpected
from rope_twin.core.integrator import (
    BDF2,
    SEARCH,
    TRAPEZOID,
    correct,
    predict_bdf2,
    predict_trapezoid,
)
from rope_twin.core.jit.decorators import jit
from rope_twin.core.jit.rows import column, copy
from rope_twin.core.joined.contact import add_among
from rope_twin.core.joined.joints import (
    LOOSE,
    TOLERANCE,
    clear,
    gather_ends,
    joint_slope,
    place_ends,
)
from rope_twin.core.joined.ropes import by_kind, rope_at
from rope_twin.core.joined.sheaves import add_sheaves, is_at_sheave, pass_end
from rope_twin.core.joined.stack import effects_at
from rope_twin.core.joined.ties import (
    ANCHORED,
    FIRST,
    PULL,
    SECOND,
    TOWARDS,
    add_ties,
    count_unexpected_ties,
    expect_pulls,
    pull_ties,
)
from rope_twin.core.loads.memory import has_memories
from rope_twin.core.state import (
    AXIAL,
    BLOCK,
    CORRECTION,
    DIRECTION,
    ELEMENTS,
    GEOMETRIC,
    RESIDUAL,
    TENSION,
    ZERO,
)

OUT, BACK = ZERO, ZERO + 1  # directions of a copy: from the state to scratch, and back


@jit
def _move(joints: Any, stage: Any, kind: int, factor: float) -> None:
    """Set the motion of the connections: predicted, or (SEARCH) after a += factor·delta."""
    nodes, work, count = joints.nodes, joints.work, joints.nodes.shape[1]
    if kind == TRAPEZOID:
        predict_trapezoid(nodes, work, stage.p, stage.q, ZERO, count)
    elif kind == BDF2:
        predict_bdf2(nodes, work, stage.p, stage.q, 0.0, ZERO, count)
    else:
        correct(work, stage.p, stage.q, factor, ZERO, count)


def _move_all(system: Any, stage: Any, kind: Any, factor: Any) -> Any:
    _move(system.joints, stage, kind, factor)
    place_ends(system)
    pull_ties(system.joints.ties, system.joints.work, stage.p, stage.q)


# Move the connections (see `_move`) and the ropes' ends there, and set the forces of links.
move_connections = by_kind(lambda system, stage, kind, factor: None, _move_all)


def _gather(system: Any, stage: Any) -> Any:
    add_among(system.stack.effects, system, stage)
    clear(system.joints)
    gather_ends(system)
    add_ties(system.joints.ties, system.joints.work, system.joints.matrix)
    add_sheaves(system.sheaves, system, stage)


# Add forces between ropes; assemble residual and matrix of the connections, without the chains.
gather_connections = by_kind(lambda system, stage: None, _gather)


def _pass(system: Any, rope: Any, r: Any, p: Any, q: Any) -> Any:
    pass_end(system.sheaves, system.joints, rope, r, p, q)


# Move the last node of rope r with the rope that passes the sheave there; see `pass_end`.
pass_sheave = by_kind(lambda system, rope, r, p, q: None, _pass)


def _correct_all(system: Any, stage: Any) -> Any:
    joints = system.joints
    expect_pulls(joints.ties, joints.work)
    _move(joints, stage, SEARCH, 1.0)
    pull_ties(joints.ties, joints.work, stage.p, stage.q)
    return count_unexpected_ties(joints.ties, system.stack.model[0, TOLERANCE])


# Apply the correction of the connections; return the number of links with a deviating tension.
correct_connections = by_kind(lambda system, stage: 0, _correct_all)


@jit
def _look_ahead_at_sheave(system: Any, rope: Any, stage: Any, r: int) -> int:
    """Set direction and tension of rope r, up to a sheave, as if all motion were corrected.

    Returns the number of deviating tensions.
    """
    work, n = rope.work, rope.state.counts[ELEMENTS]
    top = n - 1
    wrong = count_unexpected(rope, stage, ZERO, top)
    x, y, z = column(work, CORRECTION, top)
    ax, ay, az = column(work, CORRECTION, n)
    tx, ty, tz = column(work, DIRECTION, top)
    more = tx * (ax - x) + ty * (ay - y) + tz * (az - z)
    expected = work[TENSION, top] + (work[AXIAL, top] + work[GEOMETRIC, top]) * more
    pass_end(system.sheaves, system.joints, rope, r, stage.p, stage.q)
    for k in range(CORRECTION, CORRECTION + 3):
        work[k, n] = 0.0
    count_unexpected(rope, stage, top, n)
    return int(wrong + (not abs(work[TENSION, top] - expected) <= rope.model.tolerance))


def _look_ahead(system: Any, rope: Any, stage: Any, r: Any) -> Any:
    return count_unexpected(rope, stage, ZERO, rope.state.counts[ELEMENTS])


def _look_ahead_joined(system: Any, rope: Any, stage: Any, r: Any) -> Any:
    if is_at_sheave(system.sheaves, r):
        return _look_ahead_at_sheave(system, rope, stage, r)
    return count_unexpected(rope, stage, ZERO, rope.state.counts[ELEMENTS])


# Set direction and tension of rope r as if it were corrected; return the deviating tensions.
look_ahead_in_rope = by_kind(_look_ahead, _look_ahead_joined)

# R·delta summed over the connections [N·m/s²].
slope_of_connections = by_kind(lambda system: 0.0, lambda system: joint_slope(system.joints))


@jit
def _count_left(joints: Any, most: float) -> int:
    """Return how many connections have a residual above `most` [N], or NaN."""
    count = 0
    for j in range(joints.nodes.shape[1]):
        x, y, z = column(joints.work, RESIDUAL, j)
        count += not x * x + y * y + z * z <= most * most
    return count


# Number of connections whose residual exceeds the tolerance, or is NaN.
count_unbalanced = by_kind(
    lambda system: 0,
    lambda system: _count_left(system.joints, system.stack.model[0, TOLERANCE]),
)


@jit
def _add_end_forces(system: Any, share: float) -> None:
    """Add `share` times the forces of links and of ropes' last elements to the residuals."""
    stack, joints = system.stack, system.joints
    R, ties = joints.work[RESIDUAL : RESIDUAL + 3], joints.ties
    for k in range(ties.shape[1]):
        first, second = int(ties[FIRST, k]), int(ties[SECOND, k])
        for a in range(3):
            force = share * ties[PULL, k] * ties[TOWARDS + a, k]
            R[a, first] += force
            if second != ANCHORED:
                R[a, second] -= force
    for r in range(stack.counts.shape[0]):
        work, low, high = stack.work[r], joints.lower[r], joints.upper[r]
        top = stack.counts[r, ELEMENTS] - 1
        for a in range(3):
            if low != LOOSE:
                R[a, low] += share * work[TENSION, 0] * work[DIRECTION + a, 0]
            if high != LOOSE:
                R[a, high] -= share * work[TENSION, top] * work[DIRECTION + a, top]


def _begin_trial(system: Any, stage: Any) -> Any:
    joints = system.joints
    _add_end_forces(system, -1.0)
    _move(joints, stage, SEARCH, 1.0)
    pull_ties(joints.ties, joints.work, stage.p, stage.q)


@jit
def _take_load(joints: Any, work: Any, i: int, joint: int) -> None:
    """Subtract block times correction of a rope's end node i from its connection's residual."""
    xx, xy, xz = column(work, BLOCK, i)
    yy, yz, zz = column(work, BLOCK + 3, i)
    x, y, z = column(joints.work, CORRECTION, joint)
    joints.work[RESIDUAL, joint] -= xx * x + xy * y + xz * z
    joints.work[RESIDUAL + 1, joint] -= xy * x + yy * y + yz * z
    joints.work[RESIDUAL + 2, joint] -= xz * x + yz * y + zz * z


@jit
def _end_trial(system: Any, least: float) -> int:
    """Return the number of connections with a residual above `least` [N], or NaN."""
    stack, joints, left = system.stack, system.joints, 0
    _add_end_forces(system, 1.0)
    for r in range(stack.counts.shape[0]):
        if joints.lower[r] != LOOSE:
            _take_load(joints, stack.work[r], ZERO, joints.lower[r])
        if joints.upper[r] != LOOSE:
            _take_load(joints, stack.work[r], stack.counts[r, ELEMENTS], joints.upper[r])
    for j in range(joints.nodes.shape[1]):
        x, y, z = column(joints.work, RESIDUAL, j)
        left += not abs(x) + abs(y) + abs(z) <= least
    return left


# Correct the connections, before directions and tensions are set as if the ropes were corrected;
# and the number of connections that then have a residual above `least` [N].
begin_trial = by_kind(lambda system, stage: None, _begin_trial)
count_left_at_connections = by_kind(
    lambda system, least: 0, lambda system, least: _end_trial(system, least)
)


@jit
def _size(joints: Any) -> float:
    """Return the sum of absolute values of the connections' motion; not finite if one is not."""
    total = 0.0
    for k in range(joints.nodes.shape[0]):
        for j in range(joints.nodes.shape[1]):
            total += abs(joints.work[k, j])
    return total


# Sum of absolute values of the connections' motion.
size_of_connections = by_kind(lambda system: 0.0, lambda system: _size(system.joints))


@jit
def _complete(system: Any, stage: Any, pending: float) -> None:
    """Set the ropes' ends to the motion of the connections, which are corrected already."""
    place_ends(system)
    p, q = pending * stage.p, pending * stage.q
    for r in range(system.stack.counts.shape[0]):
        pass_end(system.sheaves, system.joints, rope_at(system, r), r, p, q)


def _settle_ends(system: Any, stage: Any, pending: Any) -> Any:
    if has_memories(effects_at(system.stack.effects, ZERO)):
        _complete(system, stage, pending)


# Set the ropes' ends to the accepted motion, if effects have internal variables.
settle_ends = by_kind(lambda system, stage, pending: None, _settle_ends)

# Set the ropes' ends to the motion of the connections.
place_all_ends = by_kind(lambda system: None, lambda system: place_ends(system))


@jit
def _copy(joints: Any, row: int, way: int) -> None:
    """Copy the motion of the connections to the rows of scratch from `row` on (OUT), or BACK."""
    count = joints.nodes.shape[1]
    if way == OUT:
        copy(joints.nodes, ZERO, joints.work, row, count)
    else:
        copy(joints.work, row, joints.nodes, ZERO, count)


# Copy the motion of the connections; see `_copy`.
copy_connections = by_kind(
    lambda system, row, way: None, lambda system, row, way: _copy(system.joints, row, way)
)


@jit
def _join(system: Any) -> None:
    """Set the ropes' ends to the motion of the connections, in scratch and in the state."""
    stack, joints = system.stack, system.joints
    place_ends(system)
    for r in range(stack.counts.shape[0]):
        joints.speed[r] = 0.0
        nodes, work, n = stack.nodes[r], stack.work[r], stack.counts[r, ELEMENTS]
        for k in range(nodes.shape[0]):
            if joints.lower[r] != LOOSE:
                nodes[k, 0] = work[k, 0]
            if joints.upper[r] != LOOSE:
                nodes[k, n] = work[k, n]


# Set the ropes' ends to the motion of the connections before the first step of a call.
join_ends = by_kind(lambda system: None, lambda system: _join(system))
