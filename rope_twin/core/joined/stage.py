"""Operations on a system of ropes and connections, used by the step (core/step, core/newton).

A system is a single `Rope`, or a `Joined`: a stack of ropes with connections. Its type selects the
code at compile time (`by_system_type`): for a single rope no code of loops over ropes and of
connections remains.

The correction of a stage is applied to the connections immediately; that of the ropes' nodes may be
pending until the next pass over the nodes.
"""

from __future__ import annotations

from functools import wraps
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
from rope_twin.core.jit.decorators import INLINED, jit
from rope_twin.core.jit.functions import by_type
from rope_twin.core.jit.rows import column, copy
from rope_twin.core.jit.wide import count_beyond, whole
from rope_twin.core.joined.joints import (
    ANCHORED,
    FIRST,
    LOOSE,
    PULL,
    SECOND,
    STEP,
    TOWARDS,
    add_ties,
    clear,
    count_joints,
    count_unexpected_ties,
    expect_pulls,
    gather_ends,
    joint_slope,
    place_ends,
    pull_ties,
)
from rope_twin.core.joined.line_contact import add_interactions
from rope_twin.core.joined.sheaves import add_sheaves, is_at_sheave, pass_end
from rope_twin.core.joined.stack import (
    any_rope_of,
    effects_between,
    gather_from_ropes,
    tolerance_at,
    work_of,
)
from rope_twin.core.lanes.effects import each_of
from rope_twin.core.loads.memory import has_internal_variables
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
    LaneStage,
    Rope,
    Stage,
)


def by_system_type(for_rope: Any) -> Any:
    """Decorator for a function of a `Joined`; a single rope gets `for_rope(system, ...)` instead.

    Both are plain functions with the same argument names; numba compiles the selected one.
    """

    return lambda for_system: wraps(for_system)(by_type(Rope, for_rope, for_system, INLINED))


@by_system_type(lambda system: 1)
def count_ropes(system: Any) -> Any:
    """Return the number of ropes of a system."""
    return system.stack.counts.shape[0]


@by_system_type(lambda system, r: system)
def rope_at(system: Any, r: Any) -> Any:
    """Return rope r."""
    return any_rope_of(system.stack, r)


# The stage of rope r, with the payout speed V.
_own_stage = by_type(
    LaneStage,
    lambda stage, V, r: LaneStage(
        stage.time, stage.p, stage.q, V, stage.lanes, each_of(stage.each, r)
    ),
    lambda stage, V, r: Stage(stage.time, stage.p, stage.q, V),
)


@by_system_type(lambda system, stage, r: stage)
def stage_of(system: Any, stage: Any, r: Any) -> Any:
    """Return the stage with the payout speed of rope r."""
    return _own_stage(stage, system.joints.speed[r], r)


@by_system_type(lambda system, boundary, r: boundary)
def boundary_of(system: Any, boundary: Any, r: Any) -> Any:
    """Return the prescribed motion of rope r."""
    return Boundary(boundary.value[r], boundary.rate[r])


@by_system_type(lambda system, r: True)
def is_suspended(system: Any, r: Any) -> Any:
    """Return whether the upper end of rope r is a hang-off, with prescribed motion and payout."""
    return system.joints.upper[r] == LOOSE


@by_system_type(lambda system, rope: None)
def gather_from_others(system: Any, rope: Any) -> Any:
    """Copy the data of other ropes that the effects of a rope depend on, once per step."""
    gather_from_ropes(rope.effects, rope, system.stack)


@by_system_type(lambda system, r: system.state.counts[ELEMENTS])
def count_loaded(system: Any, r: Any) -> Any:
    """Return the number of nodes of rope r that carry loads: all except a hang-off."""
    return system.stack.counts[r, ELEMENTS] + (system.joints.upper[r] != LOOSE)


@by_system_type(lambda system, boundary, row, r: boundary.value[row, LINE])
def length_at(system: Any, boundary: Any, row: Any, r: Any) -> Any:
    """Return the unstretched length of rope r at a step boundary [m]."""
    if system.joints.upper[r] == LOOSE:
        return boundary.value[r, row, LINE]
    return system.stack.s[r, system.stack.counts[r, ELEMENTS]]


@by_system_type(lambda system: system.model.step)
def step_of(system: Any) -> Any:
    """Return the time step [s], that of the first rope."""
    return system.stack.model[0, STEP]


@by_system_type(lambda system: system.model.tolerance)
def tolerance_of(system: Any) -> Any:
    """Return the tolerance of tensions [N], that of the first rope."""
    return tolerance_at(system.stack, ZERO)


@by_system_type(lambda system: (system.state.health,))
def health_of(system: Any) -> Any:
    """Return the counters of the first rope.

    They are in a tuple, since a kernel without NRT cannot return an array.
    """
    return (system.stack.health[0],)


TO_WORK, TO_STATE = (
    ZERO,
    ZERO + 1,
)  # direction of a copy: from the state to the work array, and back


@jit
def _move(joints: Any, stage: Any, kind: int, factor: Any) -> None:
    """Set the motion of the connections: predicted, or (SEARCH) after a += factor·delta."""
    nodes, work, count = joints.nodes, joints.work, count_joints(joints)
    if kind == TRAPEZOID:
        predict_trapezoid(nodes, work, stage.p, stage.q, ZERO, count)
    elif kind == BDF2:
        predict_bdf2(nodes, work, stage.p, stage.q, 0.0, ZERO, count)
    else:
        correct(work, stage.p, stage.q, factor, ZERO, count)


@by_system_type(lambda system, stage, kind, factor: None)
def move_connections(system: Any, stage: Any, kind: Any, factor: Any) -> Any:
    """Move the connections (see `_move`) and the ropes' ends there, and set the forces of links."""
    _move(system.joints, stage, kind, factor)
    place_ends(system)
    pull_ties(system.joints.ties, system.joints.work, stage.p, stage.q)


@by_system_type(lambda system, stage: None)
def gather_connections(system: Any, stage: Any) -> Any:
    """Add forces between ropes; assemble residual and matrix of the connections without chains."""
    clear(system.joints)
    add_interactions(effects_between(system.stack), system, stage)
    gather_ends(system)
    add_ties(system.joints.ties, system.joints.work, system.joints.matrix)
    add_sheaves(system.sheaves, system, stage)


@by_system_type(lambda system, rope, r, p, q: None)
def pass_sheave(system: Any, rope: Any, r: Any, p: Any, q: Any) -> Any:
    """Set the last node of rope r to the motion of the rope passing its sheave (`pass_end`)."""
    pass_end(system.sheaves, system.joints, rope, r, p, q)


@by_system_type(lambda system, stage, fraction: 0)
def correct_connections(system: Any, stage: Any, fraction: Any) -> Any:
    """Apply a fraction of the correction to the connections; return the number of deviating links.

    In lanes: fraction per lane, and a bit mask of the lanes with such a link.
    """
    joints = system.joints
    expect_pulls(joints.ties, joints.work)
    _move(joints, stage, SEARCH, fraction)
    pull_ties(joints.ties, joints.work, stage.p, stage.q)
    return count_unexpected_ties(joints.ties, tolerance_of(system))


@jit
def _look_ahead_at_sheave(system: Any, rope: Any, stage: Any, r: int) -> int:
    """Set directions and corrected tensions of rope r, which ends at a sheave.

    Returns the number of deviating tensions; in lanes: a bit mask of the lanes with one.
    """
    work, n = rope.work, rope.state.counts[ELEMENTS]
    top = n - 1
    count = count_unexpected(rope, stage, ZERO, top)
    x, y, z = column(work, CORRECTION, top)
    ax, ay, az = column(work, CORRECTION, n)
    tx, ty, tz = column(work, DIRECTION, top)
    more = tx * (ax - x) + ty * (ay - y) + tz * (az - z)
    expected = work[TENSION, top] + (work[AXIAL, top] + work[GEOMETRIC, top]) * more
    pass_end(system.sheaves, system.joints, rope, r, stage.p, stage.q)
    for k in range(CORRECTION, CORRECTION + 3):
        work[k, n] = 0.0
    count_unexpected(rope, stage, top, n)
    return int(count_beyond(count, work[TENSION, top], expected, rope.model.tolerance))


@by_system_type(
    lambda system, rope, stage, r: count_unexpected(rope, stage, ZERO, rope.state.counts[ELEMENTS])
)
def look_ahead_in_rope(system: Any, rope: Any, stage: Any, r: Any) -> Any:
    """Set directions and corrected tensions of rope r; return the number of deviating tensions.

    In lanes: a bit mask of the lanes with one.
    """
    if is_at_sheave(system.sheaves, r):
        return _look_ahead_at_sheave(system, rope, stage, r)
    return count_unexpected(rope, stage, ZERO, rope.state.counts[ELEMENTS])


@by_system_type(lambda system: 0.0)
def slope_of_connections(system: Any) -> Any:
    """Return R·delta summed over the connections [N·m/s²]."""
    return joint_slope(system.joints)


@by_system_type(lambda system: 0)
def count_unbalanced(system: Any) -> Any:
    """Return the number of connections with a residual above the tolerance, or NaN.

    In lanes: a bit mask of the lanes with one.
    """
    count, limit2 = 0, tolerance_of(system)
    for j in range(count_joints(system.joints)):
        x, y, z = column(system.joints.work, RESIDUAL, j)
        count = count_beyond(count, x * x + y * y + z * z, 0.0, limit2 * limit2)
    return count


@jit
def _add_end_forces(system: Any, fraction: float) -> None:
    """Add `fraction` times the forces of links and of ropes' last elements to the residuals."""
    stack, joints = system.stack, system.joints
    R, ties = joints.work, joints.ties
    for k in range(ties.shape[1]):
        first, second = whole(ties[FIRST, k]), whole(ties[SECOND, k])
        for a in range(3):
            force = fraction * ties[PULL, k] * ties[TOWARDS + a, k]
            R[RESIDUAL + a, first] += force
            if second != ANCHORED:
                R[RESIDUAL + a, second] -= force
    for r in range(stack.counts.shape[0]):
        work, low, high = work_of(stack, r)[0], joints.lower[r], joints.upper[r]
        top = stack.counts[r, ELEMENTS] - 1
        for a in range(3):
            if low != LOOSE:
                R[RESIDUAL + a, low] += fraction * work[TENSION, 0] * work[DIRECTION + a, 0]
            if high != LOOSE:
                R[RESIDUAL + a, high] -= fraction * work[TENSION, top] * work[DIRECTION + a, top]


@by_system_type(lambda system, stage, fraction: None)
def begin_trial(system: Any, stage: Any, fraction: Any) -> Any:
    """Apply a fraction of the correction to the connections, before a trial of existing factors.

    fraction: per lane in lanes.
    """
    joints = system.joints
    _add_end_forces(system, -1.0)
    _move(joints, stage, SEARCH, fraction)
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


@by_system_type(lambda system, tolerance: 0)
def count_left_at_connections(system: Any, tolerance: Any) -> Any:
    """Return the number of connections with a residual above `tolerance` [N]; in lanes: bits."""
    stack, joints, count = system.stack, system.joints, 0
    _add_end_forces(system, 1.0)
    for r in range(stack.counts.shape[0]):
        work = work_of(stack, r)[0]
        if joints.lower[r] != LOOSE:
            _take_load(joints, work, ZERO, joints.lower[r])
        if joints.upper[r] != LOOSE:
            _take_load(joints, work, stack.counts[r, ELEMENTS], joints.upper[r])
    for j in range(count_joints(joints)):
        x, y, z = column(joints.work, RESIDUAL, j)
        count = count_beyond(count, abs(x) + abs(y) + abs(z), 0.0, tolerance)
    return count


@by_system_type(lambda system: 0.0)
def size_of_connections(system: Any) -> Any:
    """Return the sum of absolute values of the connections' motion; not finite if any is not."""
    joints, total = system.joints, 0.0
    for k in range(joints.nodes.shape[0]):
        for j in range(joints.nodes.shape[1]):
            total += abs(joints.work[k, j])
    return total


@by_system_type(lambda system, stage, pending: None)
def settle_ends(system: Any, stage: Any, pending: Any) -> Any:
    """Set the ropes' ends to the connections' motion, if effects have internal variables."""
    if has_internal_variables(rope_at(system, ZERO).effects):
        place_ends(system)
        p, q = pending * stage.p, pending * stage.q
        for r in range(system.stack.counts.shape[0]):
            pass_end(system.sheaves, system.joints, rope_at(system, r), r, p, q)


@by_system_type(lambda system: None)
def place_all_ends(system: Any) -> Any:
    """Set the ropes' ends to the motion of the connections."""
    place_ends(system)


@by_system_type(lambda system, row, way: None)
def copy_connections(system: Any, row: Any, way: Any) -> Any:
    """Copy the motion of the connections to the work rows from `row` on (OUT), or BACK."""
    joints, count = system.joints, system.joints.nodes.shape[1]
    if way == TO_WORK:
        copy(joints.nodes, ZERO, joints.work, row, count)
    else:
        copy(joints.work, row, joints.nodes, ZERO, count)


@by_system_type(lambda system: None)
def join_ends(system: Any) -> Any:
    """Set the ropes' ends to the connections' motion in work array and state, before a call."""
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
