"""Node equations of one stage, for the nodes low <= i < high.

Every pass works on a span of nodes, so that a stage can take the rope in chunks: what one pass
leaves is still in the processor's nearest cache when the next one reads it.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

from rope_twin.core import terms
from rope_twin.core.jit import jit
from rope_twin.core.rows import row, rows
from rope_twin.core.state import (
    ACCELERATION,
    CORRECTION,
    DIRECTION,
    FLOW,
    POSITION,
    POSITION_HAT,
    RESIDUAL,
    TANGENT,
    TENSION,
    VELOCITY,
    VELOCITY_HAT,
)


@jit
def move(work: Any, p: float, q: float, low: int, high: int) -> None:
    """x = x_hat + p·a and v = v_hat + q·a."""
    x, y, z = rows(work, POSITION, low)
    vx, vy, vz = rows(work, VELOCITY, low)
    ax, ay, az = rows(work, ACCELERATION, low)
    x_hat, y_hat, z_hat = rows(work, POSITION_HAT, low)
    vx_hat, vy_hat, vz_hat = rows(work, VELOCITY_HAT, low)
    for i in range(high - low):
        x[i] = x_hat[i] + p * ax[i]
        y[i] = y_hat[i] + p * ay[i]
        z[i] = z_hat[i] + p * az[i]
        vx[i] = vx_hat[i] + q * ax[i]
        vy[i] = vy_hat[i] + q * ay[i]
        vz[i] = vz_hat[i] + q * az[i]


@jit
def add_correction(work: Any, factor: float, low: int, high: int) -> None:
    """a += factor·delta."""
    ax, ay, az = rows(work, ACCELERATION, low)
    dx, dy, dz = rows(work, CORRECTION, low)
    for i in range(high - low):
        ax[i] += factor * dx[i]
        ay[i] += factor * dy[i]
        az[i] += factor * dz[i]


@jit
def slope(work: Any, low: int, high: int) -> float:
    """R·delta: minus the slope of the stage's energy along the correction."""
    Rx, Ry, Rz = rows(work, RESIDUAL, low)
    dx, dy, dz = rows(work, CORRECTION, low)
    total = 0.0
    for i in range(high - low):
        total += Rx[i] * dx[i] + Ry[i] * dy[i] + Rz[i] * dz[i]
    return total


@jit
def set_flow(effects: Any, work: Any, stage: Any, low: int, high: int) -> None:
    """Water velocity at the nodes, at the stage's predicted positions.

    They differ from the accepted ones by p·(a - a predicted), of third order in the step.
    """
    ux, uy, uz = rows(work, FLOW, low)
    for i in range(high - low):
        ux[i] = 0.0
        uy[i] = 0.0
        uz[i] = 0.0
    terms.add_flow(effects, work, stage, low, high)


@jit
def set_tangents(work: Any, low: int, high: int) -> None:
    """Mean direction of the neighbouring elements; 1e-12 keeps a folded rope off 0/0."""
    first = max(low, 1)
    ax, ay, az = rows(work, DIRECTION, first - 1)
    bx, by, bz = rows(work, DIRECTION, first)
    tx, ty, tz = rows(work, TANGENT, first)
    for i in range(high - first):
        x, y, z = ax[i] + bx[i], ay[i] + by[i], az[i] + bz[i]
        inverse = 1.0 / sqrt(x * x + y * y + z * z + 1e-12)
        tx[i] = x * inverse
        ty[i] = y * inverse
        tz[i] = z * inverse
    if low == 0:
        for k in range(3):
            work[TANGENT + k, 0] = work[DIRECTION + k, 0]


@jit
def set_pulls(work: Any, low: int, high: int) -> None:
    """R_i = T_i·t_i - T_{i-1}·t_{i-1}."""
    first = max(low, 1)
    Rx, Ry, Rz = rows(work, RESIDUAL, first)
    T, T_below = row(work, TENSION, first), row(work, TENSION, first - 1)
    tx, ty, tz = rows(work, DIRECTION, first)
    bx, by, bz = rows(work, DIRECTION, first - 1)
    for i in range(high - first):
        Rx[i] = T[i] * tx[i] - T_below[i] * bx[i]
        Ry[i] = T[i] * ty[i] - T_below[i] * by[i]
        Rz[i] = T[i] * tz[i] - T_below[i] * bz[i]
    if low == 0:
        for k in range(3):
            work[RESIDUAL + k, 0] = work[TENSION, 0] * work[DIRECTION + k, 0]
