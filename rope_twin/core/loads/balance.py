"""Balance of forces on the nodes of one stage: residual R and block A = -dR/da.

    R = T_i·t_i - T_{i-1}·t_{i-1} + Σ loads - m·a

with the tensions of the elements above and below. Inertia and the loads of all effects on a node
are summed in registers, in one loop over the nodes (`load_nodes`). Each loop over the effects
(core/loads/hooks.py) is unrolled at compile time.

Every pass works on a range of nodes low <= i < high, so that a stage can process the rope in chunks
that fit into the L1 cache.

The middle of the payload moves as the lower end, unless an effect defines it (`payload_middle`).
"""

from __future__ import annotations

import math
from math import sqrt
from typing import Any, NamedTuple

import numpy as np
from numba.extending import overload

from rope_twin.core.jit.decorators import (
    INLINED,
    LINKED,
    compiled,
    jit,
    jit_entry,
    jit_sum,
    jit_within,
)
from rope_twin.core.jit.functions import flush, renewed, restore, rounded
from rope_twin.core.jit.rows import row, rows, span
from rope_twin.core.jit.wide import WideType
from rope_twin.core.loads.hooks import (
    Load,
    RampedEffects,
    calls_of,
    can_report_unchanged,
    couples,
    generated,
    have_active_sets,
    kernels,
    kernels_by_index,
    ramped,
    with_kernel,
)
from rope_twin.core.state import (
    ACCELERATION,
    BLOCK,
    CORRECTION,
    DIRECTION,
    END,
    FLOW,
    FLOW_RATE,
    LENGTH,
    LINK,
    MASS,
    NODE_ROWS,
    PER_METRE,
    POSITION,
    PULL,
    PULL_X,
    PULL_Y,
    PULL_Z,
    RESIDUAL,
    SAME_PLACE,
    SURFACE,
    TANGENT,
    TANGENT2_MIN,
    TENSION,
    VELOCITY,
    ZERO,
    Floats,
    Rope,
    Stage,
    new_work,
)


class Node(NamedTuple):
    """Kinematics and lumped properties of a node, the input of a load."""

    x: float  # position [m]
    y: float
    z: float
    vx: float  # velocity [m/s]
    vy: float
    vz: float
    ax: float  # acceleration [m/s²]
    ay: float
    az: float
    tx: float  # unit tangent of the rope, upward
    ty: float
    tz: float
    ux: float  # water velocity [m/s]
    uy: float
    uz: float
    wx: float  # acceleration of the water [m/s²], set only by some effects
    wy: float
    wz: float
    mass: float  # of the rope [kg]
    volume: float  # of displaced water [m³]
    frontal: float  # reference area of normal drag [m²]
    skin: float  # reference area of tangential drag [m²]
    length: float  # unstretched [m]
    surface: float  # elevation of the water surface above it [m], set only by some effects
    bare: float  # projected area out of the water [m²], set only by some effects
    touching: float  # reference area of the seabed's contact, that of normal drag on all of it [m²]


@jit_within
def add_to_node(work: Floats, i: int, load: Any) -> None:
    """Add a load to the residual and the block of node i."""
    Rx, Ry, Rz = rows(work, RESIDUAL, i)
    Axx, Axy, Axz, Ayy, Ayz, Azz = span(work, BLOCK, 6, i)
    Rx[0] += load.x
    Ry[0] += load.y
    Rz[0] += load.z
    Axx[0] += load.xx
    Axy[0] += load.xy
    Axz[0] += load.xz
    Ayy[0] += load.yy
    Ayz[0] += load.yz
    Azz[0] += load.zz


@jit_within
def set_block(block: Any, i: int, load: Any) -> None:
    """Set the block of node i, of the six rows of blocks."""
    Axx, Axy, Axz, Ayy, Ayz, Azz = block
    Axx[i] = load.xx
    Axy[i] = load.xy
    Axz[i] = load.xz
    Ayy[i] = load.yy
    Ayz[i] = load.yz
    Azz[i] = load.zz


@jit_within
def end_relative(work: Floats) -> Any:
    """Return the lower end's velocity relative to the water."""
    vx, vy, vz = rows(work, VELOCITY, 0)
    ux, uy, uz = rows(work, FLOW, 0)
    return vx[0] - ux[0], vy[0] - uy[0], vz[0] - uz[0]


@jit
def load_nodes(effects: Any, work: Floats, stage: Stage, low: int, high: int) -> None:
    """Set residual R and block A of the nodes 1 <= low <= i < high.

    R_i = T_i·t_i - T_{i-1}·t_{i-1} + Σ loads - MASS·a; A_i = MASS·I + the effects' blocks. The
    tangent is the mean direction of both adjacent elements.
    """
    nodes = load_rows(work, low)
    T, T_below = row(work, TENSION, low), row(work, TENSION, low - 1)
    tx, ty, tz = rows(work, DIRECTION, low)
    bx, by, bz = rows(work, DIRECTION, low - 1)
    Rx, Ry, Rz = rows(work, RESIDUAL, low)
    block = span(work, BLOCK, 6, low)
    for i in range(high - low):
        x, y, z = bx[i] + tx[i], by[i] + ty[i], bz[i] + tz[i]
        inverse = 1.0 / sqrt(x * x + y * y + z * z + TANGENT2_MIN)
        load = load_of(effects, stage, nodes, (x * inverse, y * inverse, z * inverse), i)
        # tension above - tension below + (loads of all effects - m·a)
        Rx[i] = T[i] * tx[i] - T_below[i] * bx[i] + load.x
        Ry[i] = T[i] * ty[i] - T_below[i] * by[i] + load.y
        Rz[i] = T[i] * tz[i] - T_below[i] * bz[i] + load.z
        set_block(block, i, load)
    load_with_variables(effects, work, stage, low, high, True)


@jit_within
def load_of(effects: Any, stage: Stage, nodes: Any, tangent: Any, i: int) -> Any:
    """Return inertia plus the loads of all effects on node i of `load_rows`."""
    (
        x, y, z, vx, vy, vz, ax, ay, az, ux, uy, uz, wx, wy, wz, mass, volume, frontal, skin,
        length, surface,
    ) = nodes  # fmt: skip
    tx, ty, tz = tangent
    node = Node(
        x[i], y[i], z[i], vx[i], vy[i], vz[i], ax[i], ay[i], az[i], tx, ty, tz,
        ux[i], uy[i], uz[i], wx[i], wy[i], wz[i], mass[i], volume[i], frontal[i], skin[i],
        length[i], surface[i], 0.0, frontal[i],
    )  # fmt: skip
    return _sum_loads(effects, node, stage)


def _sum_loads(effects: Any, node: Any, stage: Stage) -> Any:
    """Return the sum of the rope's inertia and the loads of all effects on one node."""
    total = _inertia(node)
    for effect, call in with_kernel("submerge", effects):
        node = call(effect, node)
    for effect, call in with_kernel("load", ramped(effects, stage.time)):
        total = _sum(total, call(effect, node, stage))
    return total


@overload(_sum_loads, jit_options=INLINED, strict=False)
def _compose_load(effects: Any, node: Any, stage: Stage) -> Any:
    calls, submerging = kernels_by_index("load", effects), kernels_by_index("submerge", effects)
    growth = RampedEffects(effects)
    lines = [f"node = submerge_{i}(effects[{i}], node)" for i in submerging]
    lines += [f"total = add(total, kernel_{i}({growth.of(i)}, node, stage))" for i in calls]
    lines = ["total = inertia(node)", *growth.lines, *lines, "return total"]
    names = {f"submerge_{i}": call for i, call in submerging.items()} | growth.names
    return generated("effects, node, stage", lines, calls, inertia=_inertia, add=_sum, **names)


@jit_within
def _inertia(node: Any) -> Any:
    """Return -m·a of the rope's own mass, and its block m·I."""
    m = node.mass
    return Load(-m * node.ax, -m * node.ay, -m * node.az, m, 0.0, 0.0, m, 0.0, m)


@jit_within
def _sum(a: Any, b: Any) -> Any:
    return Load(
        a.x + b.x, a.y + b.y, a.z + b.z, a.xx + b.xx, a.xy + b.xy, a.xz + b.xz, a.yy + b.yy,
        a.yz + b.yz, a.zz + b.zz,
    )  # fmt: skip


@jit_within
def load_rows(work: Floats, low: int) -> Any:
    """Return the rows that loads depend on, from node `low` on, except for the tangent."""
    x, y, z = rows(work, POSITION, low)
    vx, vy, vz = rows(work, VELOCITY, low)
    ax, ay, az = rows(work, ACCELERATION, low)
    ux, uy, uz = rows(work, FLOW, low)
    wx, wy, wz = rows(work, FLOW_RATE, low)
    mass, volume, frontal, skin, length = span(work, MASS, 5, low)
    return (
        x, y, z, vx, vy, vz, ax, ay, az, ux, uy, uz, wx, wy, wz, mass, volume, frontal, skin,
        length, row(work, SURFACE, low),
    )  # fmt: skip


@jit
def load_lowest(effects: Any, work: Floats, stage: Stage) -> None:
    """Set residual and block of node 0, which has no element below it."""
    for k in range(3):
        work[TANGENT + k, 0] = renewed(stage, work[DIRECTION + k, 0], work[TANGENT + k, 0])
        # prevents contraction with the load, which would depend on the inlining of `add_load`
        work[RESIDUAL + k, 0] = rounded(work[TENSION, 0], work[DIRECTION + k, 0])
    add_load(effects, work, stage, ZERO, ZERO + 1)
    add_end(effects, work, stage)


@jit
def add_load(effects: Any, work: Floats, stage: Stage, low: int, high: int) -> None:
    """Add loads and inertia to the residual and set the block, for the nodes low <= i < high.

    TANGENT of the nodes must be given; `assembly.load_nodes` computes it from the elements.
    """
    nodes = load_rows(work, low)
    tx, ty, tz = rows(work, TANGENT, low)
    Rx, Ry, Rz = rows(work, RESIDUAL, low)
    block = span(work, BLOCK, 6, low)
    for i in range(high - low):
        load = load_of(effects, stage, nodes, (tx[i], ty[i], tz[i]), i)
        Rx[i] += load.x
        Ry[i] += load.y
        Rz[i] += load.z
        set_block(block, i, load)
    load_with_variables(effects, work, stage, low, high, False)


def load_with_variables(
    effects: Any, work: Floats, stage: Stage, low: Any, high: Any, tangents: Any
) -> Any:
    """Add the loads of effects with internal variables; `tangents`: compute the tangents first."""
    calls = with_kernel("load_nodes", ramped(effects, stage.time))
    if tangents and calls:
        _set_tangents(work, stage, low, high)
    for effect, call in calls:
        call(effect, work, stage, low, high)


@overload(load_with_variables, jit_options=LINKED, strict=False)
def _compose_with_variables(
    effects: Any, work: Floats, stage: Stage, low: Any, high: Any, tangents: Any
) -> Any:
    calls, growth = kernels("load_nodes", effects, work), RampedEffects(effects)
    lines = [f"kernel_{i}({growth.of(i)}, work, stage, low, high)" for i in calls]
    lines = (
        ["if tangents: set_tangents(work, stage, low, high)", *growth.lines, *lines]
        if calls
        else []
    )
    head, names = "effects, work, stage, low, high, tangents", {"set_tangents": _set_tangents}
    return generated(head, [*lines, "return None"], calls, **names, **growth.names)


@jit
def _set_tangents(work: Floats, stage: Any, low: int, high: int) -> None:
    """Set TANGENT of the nodes 1 <= low <= i < high to the mean direction of adjacent elements."""
    tx, ty, tz = rows(work, DIRECTION, low)
    bx, by, bz = rows(work, DIRECTION, low - 1)
    mx, my, mz = rows(work, TANGENT, low)
    for i in range(high - low):
        x, y, z = bx[i] + tx[i], by[i] + ty[i], bz[i] + tz[i]
        inverse = 1.0 / sqrt(x * x + y * y + z * z + TANGENT2_MIN)
        mx[i] = renewed(stage, x * inverse, mx[i])
        my[i] = renewed(stage, y * inverse, my[i])
        mz[i] = renewed(stage, z * inverse, mz[i])


@jit
def set_flow(effects: Any, work: Floats, stage: Stage, low: int, high: int) -> None:
    """Set the water velocity at the nodes, at the stage's predicted positions.

    Those differ from the accepted positions by p·(a - a predicted), of third order in the step.
    """
    ux, uy, uz = rows(work, FLOW, low)
    for i in range(high - low):
        ux[i] = 0.0
        uy[i] = 0.0
        uz[i] = 0.0
    add_flow(effects, work, stage, low, high)


@jit_sum
def slope(work: Floats, low: int, high: int) -> float:
    """Return R·delta: minus the slope of the stage's energy along the correction."""
    Rx, Ry, Rz = rows(work, RESIDUAL, low)
    dx, dy, dz = rows(work, CORRECTION, low)
    total = 0.0
    for i in range(high - low):
        total += Rx[i] * dx[i] + Ry[i] * dy[i] + Rz[i] * dz[i]
    return total


# Add every effect's water velocity for the nodes low <= i < high; its load at the lower end.
add_flow = calls_of("flow", "work, stage, low, high")
add_end = calls_of("load_end", "work, stage", growth=True)


@jit
def _clear_links(work: Floats, n: int) -> None:
    """Clear the couplings, and residual and block of the hang-off node, which have no loads."""
    for i in range(n + 1):
        work[LINK, i] = work[LINK + 1, i] = 0.0
    for k in range(3):
        work[RESIDUAL + k, n] = 0.0
    for k in range(6):
        work[BLOCK + k, n] = 0.0


def lower_end_tension(rope: Rope, effects: Any, time_s: float) -> float:
    """Return the tension that the payload, anchor or connection at the lower end feels [N].

    effects: present effects; for a multi-line system those of the first rope, since only loads
    along the rope are evaluated.

    It is the tension of the lowest element plus the loads on its lower half less its inertia, as
    for the force on the hang-off, without internal variables of effects (VIV, static friction). It
    is 0 if the element is slack or carries less than the weight of its half.
    """
    force, along = _at_lower_end(rope, effects, time_s)
    held = float(rope.work[TENSION, 0]) > 0.0 and force @ along > 0.0
    return math.sqrt(float(force @ force)) if held else 0.0


def lower_end_force(rope: Rope, effects: Any, time_s: float) -> Floats:
    """Return the force of the rope on the support of its lower end [N], (3,).

    See `lower_end_tension`; for a slack rope it is that of the lowest half element.
    """
    return _at_lower_end(rope, effects, time_s)[0]


def _at_lower_end(rope: Rope, effects: Any, time_s: float) -> tuple[Floats, Floats]:
    """Return the force on the lower end [N] and the direction of the element there, (3,) each."""
    work = new_work(2)
    work[:NODE_ROWS, :2] = rope.state.nodes[:, :2]
    step = work[:3, 1] - work[:3, 0]
    along = step / math.sqrt(float(step @ step) + TANGENT2_MIN)
    s = rope.state.s
    direction = int(np.searchsorted(rope.sections[END], s[0] + SAME_PLACE, side="right"))
    work[MASS : LENGTH + 1, 0] = 0.5 * (s[1] - s[0]) * rope.sections[PER_METRE:, direction]
    work[TANGENT : TANGENT + 3, 0] = along
    _load_lower_end(effects, work, Stage(time_s, 1.0, 0.0, 0.0))
    pull = float(rope.work[TENSION, 0])
    return np.asarray(pull * along + work[RESIDUAL : RESIDUAL + 3, 0]), along


@jit_entry
def _load_lower_end(effects: Any, work: Floats, stage: Stage) -> None:
    set_flow(effects, work, stage, ZERO, ZERO + 1)
    tangent = (work[TANGENT, 0], work[TANGENT + 1, 0], work[TANGENT + 2, 0])
    load = load_of(effects, stage, load_rows(work, ZERO), tangent, ZERO)
    work[RESIDUAL, 0], work[RESIDUAL + 1, 0], work[RESIDUAL + 2, 0] = load.x, load.y, load.z


def add_couplings(effects: Any, work: Floats, stage: Stage, n: Any) -> Any:
    """Add every effect's forces between nodes that are not next neighbours."""
    if couples(map(type, effects)):
        _clear_links(work, n)
    for effect, call in with_kernel("couple", effects):
        call(effect, work, stage, n)


@overload(add_couplings, jit_options=LINKED, strict=False)
def _compose_couplings(effects: Any, work: Floats, stage: Stage, n: Any) -> Any:
    calls = kernels("couple", effects, work)
    lines = [f"kernel_{i}(effects[{i}], work, stage, n)" for i in calls]
    lines = ["clear(work, n)", *lines] if calls else []
    return generated("effects, work, stage, n", [*lines, "return None"], calls, clear=_clear_links)


@jit
def set_pull(pull: Any, row: int, x: Any, y: Any, z: Any) -> None:
    """Set the rope's force on the hang-off after step `row`, and its size."""
    pull[row, PULL_X] = x
    pull[row, PULL_Y] = y
    pull[row, PULL_Z] = z
    pull[row, PULL] = sqrt(x * x + y * y + z * z)


@jit
def _add_to_pull(force: Any, pull: Any, row: int) -> None:
    """Add a force on the hang-off to the tension of step `row`."""
    x, y, z = pull[row, PULL_X], pull[row, PULL_Y], pull[row, PULL_Z]
    set_pull(pull, row, x + force[0], y + force[1], z + force[2])


@jit_within
def _load_top_motion(work: Floats, nodes: Floats, n: int) -> None:
    """Copy the accepted motion of the two nodes below the hang-off to the scratch array.

    After a stage with a pending correction they are uncorrected in the work array.
    """
    for i in range(max(n - 2, 0), n):
        for k in range(NODE_ROWS):
            work[k, i] = nodes[k, i]


def add_pull(effects: Any, work: Floats, nodes: Floats, n: Any, pull: Any, row: Any) -> Any:
    """Add the contribution of coupling effects to the rope's force on the hang-off."""
    for effect, call in with_kernel("pull", effects):
        _load_top_motion(work, nodes, n)
        _add_to_pull(call(effect, work, n), pull, row)


@overload(add_pull, jit_options=LINKED, strict=False)
def _compose_pull(effects: Any, work: Floats, nodes: Floats, n: Any, pull: Any, row: Any) -> Any:
    calls = kernels("pull", effects, work)
    lines = ["recall(work, nodes, n)"] if calls else []
    lines += [f"add(kernel_{i}(effects[{i}], work, n), pull, row)" for i in calls]
    lines.append("return None")
    arguments = "effects, work, nodes, n, pull, row"
    return generated(arguments, lines, calls, add=_add_to_pull, recall=_load_top_motion)


def is_active_set_unchanged(effects: Any, work: Floats, stage: Stage, n: Any, share: Any) -> Any:
    """Return whether share·delta leaves all active sets unchanged."""
    if not can_report_unchanged(map(type, effects)):
        return False
    return all(
        call(effect, work, stage, n, share) for effect, call in with_kernel("unchanged", effects)
    )


@overload(is_active_set_unchanged, jit_options=LINKED, strict=False)
def _compose_unchanged(effects: Any, work: Floats, stage: Stage, n: Any, share: Any) -> Any:
    kinds = [effect.instance_class for effect in effects]
    if not have_active_sets(kinds):
        return lambda effects, work, stage, n, share: True
    if not can_report_unchanged(kinds):
        return lambda effects, work, stage, n, share: False
    calls = kernels("unchanged", effects, work)
    lines = [f"if not kernel_{i}(effects[{i}], work, stage, n, share): return False" for i in calls]
    return generated("effects, work, stage, n, share", [*lines, "return True"], calls)


def payload_middle(effects: Any, height: Any, speed: Any) -> Any:
    """Return height [m] and vertical velocity [m/s] of the payload's middle, also in lanes.

    height, speed: of the lower end.
    """
    for effect, call in with_kernel("middle", effects):
        height, speed = call(effect, height, speed)
    return height, speed


@overload(payload_middle, jit_options=LINKED, strict=False)
def _compose_middle(effects: Any, height: Any, speed: Any) -> Any:
    if isinstance(height, WideType):
        calls = kernels("middle", effects, None)
    else:
        calls = kernels_by_index("middle", effects)
    lines = [f"height, speed = kernel_{i}(effects[{i}], height, speed)" for i in calls]
    return generated("effects, height, speed", [*lines, "return height, speed"], calls)


@jit_entry
def _middle_of_one(effects: Any, height: float, speed: float) -> Any:
    was = flush()
    middle = payload_middle(effects, height, speed)
    restore(was)
    return middle


_COMPILED: dict[tuple[type, ...], Any] = {}


def lone_middle(effects: tuple[Any, ...], height: float, speed: float) -> tuple[float, float]:
    """Return `payload_middle` of a single rope from compiled code, bit-identical to lanes."""
    listed = tuple(effect for effect, _ in with_kernel("middle", effects))
    if not listed:
        return height, speed
    kinds = tuple(map(type, listed))
    code = _COMPILED.get(kinds)
    if code is None:
        code = _COMPILED[kinds] = compiled(_middle_of_one, (listed, height, speed))
    middle, rate = code(listed, height, speed)
    return float(middle), float(rate)
