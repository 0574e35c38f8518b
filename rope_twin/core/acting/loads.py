"""Loads: forces of effects on a node, all of them in one pass over memory.

A Load is a force and its derivative. Those of all effects are summed in registers for a node, in
one loop over the nodes: the loop over the effects is unrolled while numba compiles
(core/acting/hooks.py).
"""

from __future__ import annotations

from math import sqrt
from typing import Any, NamedTuple

from numba.extending import overload

from rope_twin.core.acting.hooks import kernels, kernels_by_place, members, written_out
from rope_twin.core.guards import TANGENT2_MIN
from rope_twin.core.jit.decorators import LINKED, jit, jit_within
from rope_twin.core.jit.rows import rows, span
from rope_twin.core.state import (
    ACCELERATION,
    BLOCK,
    DIRECTION,
    FLOW,
    FLOW_RATE,
    MASS,
    POSITION,
    RESIDUAL,
    TANGENT,
    VELOCITY,
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


class Load(NamedTuple):
    """Load on a node: force less inertia, and minus its derivative to the acceleration.

    The derivative is q·d/dv + p·d/dx + d/da, as a symmetric block.
    """

    x: float  # [N]
    y: float
    z: float
    xx: float  # [kg]
    xy: float
    xz: float
    yy: float
    yz: float
    zz: float


def _sum_loads(effects: Any, node: Any, stage: Any) -> Any:
    """Return the sum of the rope's inertia and the loads of all effects on one node."""
    total = _inertia(node)
    for effect, call in members("load", effects):
        total = _sum(total, call(effect, node, stage))
    return total


@overload(_sum_loads, jit_options={**LINKED, "forceinline": True}, strict=False)
def _compose_load(effects: Any, node: Any, stage: Any) -> Any:
    calls = kernels_by_place("load", effects)
    lines = [f"total = add(total, kernel_{i}(effects[{i}], node, stage))" for i in calls]
    lines = ["total = inertia(node)", *lines, "return total"]
    return written_out("effects, node, stage", lines, calls, inertia=_inertia, add=_sum)


@jit_within
def _inertia(node: Any) -> Any:
    m = node.mass
    return Load(-m * node.ax, -m * node.ay, -m * node.az, m, 0.0, 0.0, m, 0.0, m)


@jit_within
def _sum(a: Any, b: Any) -> Any:
    return Load(
        a.x + b.x, a.y + b.y, a.z + b.z, a.xx + b.xx, a.xy + b.xy, a.xz + b.xz, a.yy + b.yy,
        a.yz + b.yz, a.zz + b.zz,
    )  # fmt: skip


@jit_within
def load_rows(work: Any, low: int) -> Any:
    """Return the rows that loads depend on, from node `low` on, except for the tangent."""
    x, y, z = rows(work, POSITION, low)
    vx, vy, vz = rows(work, VELOCITY, low)
    ax, ay, az = rows(work, ACCELERATION, low)
    ux, uy, uz = rows(work, FLOW, low)
    wx, wy, wz = rows(work, FLOW_RATE, low)
    mass, volume, frontal, skin = span(work, MASS, 4, low)
    return (
        x, y, z, vx, vy, vz, ax, ay, az, ux, uy, uz, wx, wy, wz, mass, volume, frontal, skin
    )  # fmt: skip


@jit_within
def load_of(effects: Any, stage: Any, nodes: Any, tangent: Any, i: int) -> Any:
    """Return inertia plus the loads of all effects on node i of `load_rows`."""
    x, y, z, vx, vy, vz, ax, ay, az, ux, uy, uz, wx, wy, wz, mass, volume, frontal, skin = nodes
    tx, ty, tz = tangent
    node = Node(
        x[i], y[i], z[i], vx[i], vy[i], vz[i], ax[i], ay[i], az[i], tx, ty, tz,
        ux[i], uy[i], uz[i], wx[i], wy[i], wz[i], mass[i], volume[i], frontal[i], skin[i],
    )  # fmt: skip
    return _sum_loads(effects, node, stage)


@jit
def _set_tangents(work: Any, low: int, high: int) -> None:
    """Set TANGENT of the nodes 1 <= low <= i < high to the mean direction of adjacent elements."""
    tx, ty, tz = rows(work, DIRECTION, low)
    bx, by, bz = rows(work, DIRECTION, low - 1)
    mx, my, mz = rows(work, TANGENT, low)
    for i in range(high - low):
        x, y, z = bx[i] + tx[i], by[i] + ty[i], bz[i] + tz[i]
        inverse = 1.0 / sqrt(x * x + y * y + z * z + TANGENT2_MIN)
        mx[i] = x * inverse
        my[i] = y * inverse
        mz[i] = z * inverse


def load_remembering(
    effects: Any, work: Any, stage: Any, low: Any, high: Any, tangents: Any
) -> Any:
    """Add the loads of effects with internal variables; `tangents`: compute the tangents first."""
    calls = members("load_nodes", effects)
    if tangents and calls:
        _set_tangents(work, low, high)
    for effect, call in calls:
        call(effect, work, stage, low, high)


@overload(load_remembering, jit_options=LINKED, strict=False)
def _compose_remembering(
    effects: Any, work: Any, stage: Any, low: Any, high: Any, tangents: Any
) -> Any:
    calls = kernels("load_nodes", effects, work)
    lines = [f"kernel_{i}(effects[{i}], work, stage, low, high)" for i in calls]
    lines = ["if tangents: set_tangents(work, low, high)", *lines] if calls else []
    head = "effects, work, stage, low, high, tangents"
    return written_out(head, [*lines, "return None"], calls, set_tangents=_set_tangents)


@jit
def add_load(effects: Any, work: Any, stage: Any, low: int, high: int) -> None:
    """Add loads and inertia to the residual and set the block, for the nodes low <= i < high.

    TANGENT of the nodes must be given; `assembly.load_nodes` computes it from the elements.
    """
    nodes = load_rows(work, low)
    tx, ty, tz = rows(work, TANGENT, low)
    Rx, Ry, Rz = rows(work, RESIDUAL, low)
    Axx, Axy, Axz, Ayy, Ayz, Azz = span(work, BLOCK, 6, low)
    for i in range(high - low):
        load = load_of(effects, stage, nodes, (tx[i], ty[i], tz[i]), i)
        Rx[i] += load.x
        Ry[i] += load.y
        Rz[i] += load.z
        Axx[i] = load.xx
        Axy[i] = load.xy
        Axz[i] = load.xz
        Ayy[i] = load.yy
        Ayz[i] = load.yz
        Azz[i] = load.zz
    load_remembering(effects, work, stage, low, high, False)
