"""Ropes and connections of a system: the functions that the step (core/step, core/newton) is over.

A system is a `Rope` by itself, or a `Joined`: a stack of ropes with connections. Its type selects
the code while numba compiles (`by_kind`): for a rope by itself the loops over ropes and all code of
connections vanish.

The correction of a stage is applied to the connections at once. That of the ropes' nodes may be
pending: the next pass over the nodes applies it.
"""

from __future__ import annotations

from typing import Any

from numba.extending import overload

from rope_twin.core.elements import count_unexpected
from rope_twin.core.integrator import (
    BDF2,
    SEARCH,
    TRAPEZOID,
    correct,
    predict_bdf2,
    predict_trapezoid,
)
from rope_twin.core.jit.decorators import LINKED, jit
from rope_twin.core.jit.rows import HeldType, column, copy
from rope_twin.core.joined.contact import add_among
from rope_twin.core.joined.joints import (
    ANCHORED,
    FIRST,
    LOOSE,
    PULL,
    SECOND,
    STEP,
    TOLERANCE,
    TOWARDS,
    add_ties,
    clear,
    count_unexpected_ties,
    expect_pulls,
    gather_ends,
    joint_slope,
    place_ends,
    pull_ties,
)
from rope_twin.core.joined.sheaves import add_sheaves, is_at_sheave, pass_end
from rope_twin.core.joined.stack import effects_at, face_ropes, rope_of
from rope_twin.core.loads.memory import has_memories
from rope_twin.core.state import (
    AXIAL,
    BLOCK,
    CORRECTION,
    DIRECTION,
    ELEMENTS,
    GEOMETRIC,
    LINE,
    RESIDUAL,
    TENSION,
    ZERO,
    Boundary,
    Rope,
    Stage,
)

_WITHIN = {**LINKED, "forceinline": True}  # inlined in the caller


def by_kind(one: Any, many: Any) -> Any:
    """Return the function that is `one(system, ...)` of a Rope and `many(system, ...)` of a Joined.

    Both are plain functions with the same names of arguments; numba compiles the one that is
    called.
    """

    def call(system: Any, *rest: Any) -> Any:
        return (one if isinstance(system, Rope) else many)(system, *rest)

    @overload(call, jit_options=_WITHIN, strict=False)
    def choose(system: Any, *rest: Any) -> Any:
        kind = system.inner if isinstance(system, HeldType) else system
        return one if kind.instance_class is Rope else many

    return call


def _same_rope(system: Any, r: Any) -> Any:
    return system


def _rope_at(system: Any, r: Any) -> Any:
    return rope_of(system.stack, r)


def _same_stage(system: Any, stage: Any, r: Any) -> Any:
    return stage


def _stage_of(system: Any, stage: Any, r: Any) -> Any:
    return Stage(stage.time, stage.p, stage.q, system.joints.speed[r])


def _same_boundary(system: Any, boundary: Any, r: Any) -> Any:
    return boundary


def _boundary_of(system: Any, boundary: Any, r: Any) -> Any:
    return Boundary(boundary.value[r], boundary.rate[r])


def _face_others(system: Any, rope: Any) -> Any:
    face_ropes(rope.effects, rope, system.stack)


def _free_nodes(system: Any, r: Any) -> Any:
    return system.state.counts[ELEMENTS]


def _loaded_nodes(system: Any, r: Any) -> Any:
    return system.stack.counts[r, ELEMENTS] + (system.joints.upper[r] != LOOSE)


def _line_of(system: Any, boundary: Any, row: Any, r: Any) -> Any:
    return boundary.value[row, LINE]


def _line_at(system: Any, boundary: Any, row: Any, r: Any) -> Any:
    if system.joints.upper[r] == LOOSE:
        return boundary.value[r, row, LINE]
    return system.stack.s[r, system.stack.counts[r, ELEMENTS]]


# Number of ropes of a system.
count_ropes = by_kind(lambda system: 1, lambda system: system.stack.counts.shape[0])
# Rope r, and the stage with its payout speed, and its prescribed motion.
rope_at = by_kind(_same_rope, _rope_at)
stage_of = by_kind(_same_stage, _stage_of)
boundary_of = by_kind(_same_boundary, _boundary_of)
# What the effects of rope r depend on of other ropes, once a step.
face_others = by_kind(lambda system, rope: None, _face_others)
# Number of its nodes that carry loads: all except a hang-off.
count_loaded = by_kind(_free_nodes, _loaded_nodes)
# Its unstretched length at a step boundary [m].
length_at = by_kind(_line_of, _line_at)
# Time step [s] and tolerance [N] of a system, and its counters: those of the first rope. Counters
# come in a tuple because a kernel without memory management returns no array.
step_of = by_kind(lambda system: system.model.step, lambda system: system.stack.model[0, STEP])
tolerance_of = by_kind(
    lambda system: system.model.tolerance, lambda system: system.stack.model[0, TOLERANCE]
)
health_of = by_kind(lambda system: (system.state.health,), lambda system: (system.stack.health[0],))


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
