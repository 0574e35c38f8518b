"""Assembly of the node equations of one stage, for the nodes low <= i < high.

Every pass works on a span of nodes, so that a stage can process the rope in chunks: the results of
one pass are still in the processor's nearest cache when the next one reads them.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

from rope_twin.core.acting import loads, terms
from rope_twin.core.guards import TANGENT2_MIN
from rope_twin.core.jit.decorators import jit, jit_sum
from rope_twin.core.jit.rows import row, rows, span
from rope_twin.core.state import (
    BLOCK,
    CORRECTION,
    DIRECTION,
    FLOW,
    RESIDUAL,
    TANGENT,
    TENSION,
    ZERO,
)


@jit_sum
def slope(work: Any, low: int, high: int) -> float:
    """Return R·delta: minus the slope of the stage's energy along the correction."""
    Rx, Ry, Rz = rows(work, RESIDUAL, low)
    dx, dy, dz = rows(work, CORRECTION, low)
    total = 0.0
    for i in range(high - low):
        total += Rx[i] * dx[i] + Ry[i] * dy[i] + Rz[i] * dz[i]
    return total


@jit
def set_flow(effects: Any, work: Any, stage: Any, low: int, high: int) -> None:
    """Set the water velocity at the nodes, at the stage's predicted positions.

    They differ from the accepted ones by p·(a - a predicted), of third order in the step.
    """
    ux, uy, uz = rows(work, FLOW, low)
    for i in range(high - low):
        ux[i] = 0.0
        uy[i] = 0.0
        uz[i] = 0.0
    terms.add_flow(effects, work, stage, low, high)


@jit
def load_nodes(effects: Any, work: Any, stage: Any, low: int, high: int) -> None:
    """Set residual R and block A of the nodes 1 <= low <= i < high.

    R_i = T_i·t_i - T_{i-1}·t_{i-1} - MASS·a + loads; A_i = MASS·I + the effects' blocks. The
    tangent is the mean direction of both adjacent elements.
    """
    nodes = loads.load_rows(work, low)
    T, T_below = row(work, TENSION, low), row(work, TENSION, low - 1)
    tx, ty, tz = rows(work, DIRECTION, low)
    bx, by, bz = rows(work, DIRECTION, low - 1)
    Rx, Ry, Rz = rows(work, RESIDUAL, low)
    Axx, Axy, Axz, Ayy, Ayz, Azz = span(work, BLOCK, 6, low)
    for i in range(high - low):
        x, y, z = bx[i] + tx[i], by[i] + ty[i], bz[i] + tz[i]
        inverse = 1.0 / sqrt(x * x + y * y + z * z + TANGENT2_MIN)
        load = loads.load_of(effects, stage, nodes, (x * inverse, y * inverse, z * inverse), i)
        Rx[i] = T[i] * tx[i] - T_below[i] * bx[i] + load.x
        Ry[i] = T[i] * ty[i] - T_below[i] * by[i] + load.y
        Rz[i] = T[i] * tz[i] - T_below[i] * bz[i] + load.z
        Axx[i] = load.xx
        Axy[i] = load.xy
        Axz[i] = load.xz
        Ayy[i] = load.yy
        Ayz[i] = load.yz
        Azz[i] = load.zz
    loads.load_remembering(effects, work, stage, low, high, True)


@jit
def load_lowest(effects: Any, work: Any, stage: Any) -> None:
    """Set residual and block of node 0, which has no element below it."""
    for k in range(3):
        work[TANGENT + k, 0] = work[DIRECTION + k, 0]
        work[RESIDUAL + k, 0] = work[TENSION, 0] * work[DIRECTION + k, 0]
    loads.add_load(effects, work, stage, ZERO, ZERO + 1)
    terms.add_end(effects, work, stage)
