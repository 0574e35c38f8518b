"""Where a stage of TR-BDF2 starts from: x = x_hat + p·a and v = v_hat + q·a with c = q, p = c².

TR-BDF2 (Bank et al. 1985; Hosea and Shampine 1996) with γ = 2 - √2: a trapezoidal stage to
t + γ·h, then BDF2 to t + h, both with the same weight c = γ·h/2.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

from rope_twin.core.jit import jit
from rope_twin.core.rows import node_rows, rows
from rope_twin.core.state import ACCELERATION, POSITION, POSITION_HAT, VELOCITY, VELOCITY_HAT

GAMMA = 2.0 - sqrt(2.0)
K1 = 1.0 / (GAMMA * (2.0 - GAMMA))  # weight of the middle in the BDF2 stage
K2 = (1.0 - GAMMA) ** 2 / (GAMMA * (2.0 - GAMMA))  # and of the start


@jit
def predict_trapezoid(nodes: Any, work: Any, c: float, low: int, high: int) -> None:
    """v_hat = v + c·a, x_hat = x + c·v + c·v_hat, for the nodes low <= i < high."""
    x, y, z = node_rows(nodes, POSITION, low)
    vx, vy, vz = node_rows(nodes, VELOCITY, low)
    ax, ay, az = node_rows(nodes, ACCELERATION, low)
    x_hat, y_hat, z_hat = rows(work, POSITION_HAT, low)
    vx_hat, vy_hat, vz_hat = rows(work, VELOCITY_HAT, low)
    bx, by, bz = rows(work, ACCELERATION, low)
    for i in range(high - low):
        px, py, pz = vx[i] + c * ax[i], vy[i] + c * ay[i], vz[i] + c * az[i]
        x_hat[i] = x[i] + c * (vx[i] + px)
        y_hat[i] = y[i] + c * (vy[i] + py)
        z_hat[i] = z[i] + c * (vz[i] + pz)
        vx_hat[i] = px
        vy_hat[i] = py
        vz_hat[i] = pz
        bx[i] = ax[i]
        by[i] = ay[i]
        bz[i] = az[i]


@jit
def predict_bdf2(nodes: Any, work: Any, c: float, low: int, high: int) -> None:
    """v_hat = K1·v_middle - K2·v, x_hat = K1·x_middle - K2·x + c·v_hat."""
    x, y, z = node_rows(nodes, POSITION, low)
    vx, vy, vz = node_rows(nodes, VELOCITY, low)
    x_middle, y_middle, z_middle = rows(work, POSITION, low)
    vx_middle, vy_middle, vz_middle = rows(work, VELOCITY, low)
    x_hat, y_hat, z_hat = rows(work, POSITION_HAT, low)
    vx_hat, vy_hat, vz_hat = rows(work, VELOCITY_HAT, low)
    for i in range(high - low):
        px = K1 * vx_middle[i] - K2 * vx[i]
        py = K1 * vy_middle[i] - K2 * vy[i]
        pz = K1 * vz_middle[i] - K2 * vz[i]
        x_hat[i] = K1 * x_middle[i] - K2 * x[i] + c * px
        y_hat[i] = K1 * y_middle[i] - K2 * y[i] + c * py
        z_hat[i] = K1 * z_middle[i] - K2 * z[i] + c * pz
        vx_hat[i] = px
        vy_hat[i] = py
        vz_hat[i] = pz
