"""Kernel view of a SIMD batch of single ropes or of systems of ropes.

The type of the batch's arrays, a `Rope` or a `Joined`, selects the code at compile time, as in
core/joined/stage. The arrays of a batch of systems have the ropes as their first axis.
"""

from __future__ import annotations

from typing import Any

from rope_twin.core.jit.decorators import LINKED, jit
from rope_twin.core.jit.functions import lanes_only
from rope_twin.core.jit.rows import node_rows, rows
from rope_twin.core.jit.wide import choose, table, tiles, wide
from rope_twin.core.joined.joints import LOOSE, Joined, Joints, count_joints
from rope_twin.core.joined.plan import Plan
from rope_twin.core.joined.stack import Sheaves
from rope_twin.core.joined.stage import by_system_type, rope_at
from rope_twin.core.lanes.effects import wide_data
from rope_twin.core.loads.hooks import couples, selected_by
from rope_twin.core.state import (
    ACCELERATION,
    COUPLED_ROWS,
    NODE_ROWS,
    POSITION,
    VELOCITY,
    WORK_ROWS,
    Boundary,
    Model,
    Rope,
    State,
)


@lanes_only(LINKED)
def wide_system(arrays: Any) -> Any:
    """Return a rope, or a system of ropes, with SIMD tables in place of arrays."""
    if arrays.instance_class is Rope:
        return lambda arrays: _wide_rope(arrays)
    return lambda arrays: _wide_joined(arrays)


_wide_work = selected_by(
    couples,
    lambda effects, work: tiles(work, COUPLED_ROWS),
    lambda effects, work: tiles(work, WORK_ROWS),
)


@jit
def _wide_rope(rope: Any) -> Any:
    model, state = rope.model, rope.state
    return Rope(
        Model(
            wide(model.element_length),
            wide(model.split_above),
            wide(model.merge_below),
            model.absorb,
            model.first_free,
            model.step,
            wide(model.tolerance),
        ),
        State(
            tiles(state.nodes, NODE_ROWS),
            table(state.s),
            table(state.offset),
            state.counts,
            state.health,
        ),
        _wide_work(rope.effects, rope.work),
        table(rope.sections),
        wide_data(rope.effects),
        wide_data(rope.law),
    )


@jit
def _wide_sheaves(sheaves: Any) -> Any:
    """Return sheaves with SIMD tables in place of arrays of floats, or None."""
    if sheaves is None:
        return None
    return Sheaves(
        table(sheaves.figures),
        sheaves.of,
        sheaves.side,
        table(sheaves.base),
        table(sheaves.way),
        Boundary(table(sheaves.borders.value), table(sheaves.borders.rate)),
    )


@jit
def _wide_joined(arrays: Any) -> Any:
    """Return a system whose stack returns wide ropes."""
    lane_joints, p = arrays.joints, arrays.joints.plan
    plan = Plan(
        p.spans, p.ends, p.roots, p.between, p.onto, p.dense, p.sizes, p.counts, table(p.sums),
        p.records,
    )  # fmt: skip
    joints = Joints(
        lane_joints.lower,
        lane_joints.upper,
        tiles(lane_joints.nodes, NODE_ROWS),
        table(lane_joints.ties),
        tiles(lane_joints.work, WORK_ROWS),
        table(lane_joints.matrix),
        table(lane_joints.factor),
        table(lane_joints.speed),
        plan,
    )
    return Joined(arrays.stack, joints, _wide_sheaves(arrays.sheaves))


@by_system_type(lambda system, array, r: (array,))
def part_of(system: Any, array: Any, r: Any) -> Any:
    """Return the part of an array that belongs to rope r, in a tuple."""
    return (array[r],)


@by_system_type(lambda system, boundary, r: Boundary(table(boundary.value), table(boundary.rate)))
def border_of(system: Any, boundary: Any, r: Any) -> Any:
    """Return the prescribed motion of rope r."""
    return Boundary(table(boundary.value[r]), table(boundary.rate[r]))


@by_system_type(lambda arrays, r: (arrays.state.offset, arrays.state.s))
def offsets_of(arrays: Any, r: Any) -> Any:
    """Return length corrections and material coordinates of rope r, as arrays."""
    return arrays.stack.offset[r], arrays.stack.s[r]


@jit
def copy_chosen(nodes: Any, work: Any, kept: Any, low: int, high: int) -> None:
    """Copy motion to the state of the nodes low <= i < high in the lanes `kept`."""
    x, y, z = node_rows(nodes, POSITION, low)
    vx, vy, vz = node_rows(nodes, VELOCITY, low)
    ax, ay, az = node_rows(nodes, ACCELERATION, low)
    x_new, y_new, z_new = rows(work, POSITION, low)
    vx_new, vy_new, vz_new = rows(work, VELOCITY, low)
    ax_new, ay_new, az_new = rows(work, ACCELERATION, low)
    for i in range(high - low):
        x[i] = choose(kept, x_new[i], x[i])
        y[i] = choose(kept, y_new[i], y[i])
        z[i] = choose(kept, z_new[i], z[i])
        vx[i] = choose(kept, vx_new[i], vx[i])
        vy[i] = choose(kept, vy_new[i], vy[i])
        vz[i] = choose(kept, vz_new[i], vz[i])
        ax[i] = choose(kept, ax_new[i], ax[i])
        ay[i] = choose(kept, ay_new[i], ay[i])
        az[i] = choose(kept, az_new[i], az[i])


@by_system_type(lambda system, kept: None)
def keep_connections(system: Any, kept: Any) -> Any:
    """Copy the stage's motion of the connections, and of lower ends there, to the state."""
    joints = system.joints
    copy_chosen(joints.nodes, joints.work, kept, 0, count_joints(joints))
    for r in range(system.stack.counts.shape[0]):
        if joints.lower[r] != LOOSE:
            rope = rope_at(system, r)
            copy_chosen(rope.state.nodes, rope.work, kept, 0, 1)
