"""TR-BDF2: prediction and correction of the motion in its two stages.

TR-BDF2 (Bank et al. 1985; Hosea and Shampine 1996) with γ = 2 - √2: a trapezoidal stage to t + γ·h,
then BDF2 to t + h, both with the same weight c = γ·h/2, so that x = x_hat + p·a and v = v_hat + q·a
with q = c, p = c². It is second order, needs no history (so elements may be added and removed), and
damps frequencies that the mesh cannot resolve. The initial guess of a is its last value; x_hat and
v_hat are not stored, since a correction of a changes x by p and v by q times it.
"""

from __future__ import annotations

from math import floor, sqrt
from typing import Any

import numpy as np

from rope_twin.core.jit.decorators import jit, jit_within
from rope_twin.core.jit.rows import node_rows, rows
from rope_twin.core.state import ACCELERATION, CORRECTION, POSITION, VELOCITY, Floats

GAMMA = 2.0 - sqrt(2.0)
K1 = 1.0 / (GAMMA * (2.0 - GAMMA))  # weight of the middle in the BDF2 stage
K2 = (1.0 - GAMMA) ** 2 / (GAMMA * (2.0 - GAMMA))  # and of the start
# Kinds of evaluation: prediction of either stage, and a correction. They are numpy integers, since
# numba compiles a separate specialisation for each Python literal.
TRAPEZOID, BDF2, SEARCH = np.int64(0), np.int64(1), np.int64(2)
NOT_FINITE, UNCONVERGED, CONVERGED, PENDING = -1, 0, 1, 2  # outcomes, from worst to best


@jit_within
def step_start(time: float, row: int, step: float) -> float:
    """Return the time [s] at which step `row` from a call's time begins, to the nanosecond.

    The rounding makes the phase of a wave independent of how the steps are divided into calls.
    """
    return float(floor((time + row * step) * 1e9 + 0.5) * 1e-9)


@jit_within
def _trapezoid(x: Any, v: Any, a: Any, p: float, q: float) -> Any:
    """Return x_hat + p·a and v_hat + q·a with v_hat = v + q·a, x_hat = x + q·(v + v_hat)."""
    v_hat = v + q * a
    return x + q * (v + v_hat) + p * a, v_hat + q * a


@jit_within
def _bdf2(start: Any, middle: Any, p: float, q: float) -> Any:
    """Return x_hat + p·a and v_hat + q·a of a component; start: x and v; middle: x_m, v_m and a.

    v_hat = K1·v_m - K2·v, x_hat = K1·x_m - K2·x + q·v_hat.
    """
    (x, v), (x_m, v_m, a) = start, middle
    v_hat = K1 * v_m - K2 * v
    return K1 * x_m - K2 * x + q * v_hat + p * a, v_hat + q * a


@jit_within
def _corrected(x: Any, v: Any, a: Any, change: Any, p: float, q: float) -> Any:
    """Return position, velocity and acceleration after a += change."""
    return x + p * change, v + q * change, a + change


@jit
def predict_trapezoid(nodes: Floats, work: Floats, p: float, q: float, low: int, high: int) -> None:
    """Predict the trapezoidal stage, for the nodes low <= i < high."""
    x0, y0, z0 = node_rows(nodes, POSITION, low)
    vx0, vy0, vz0 = node_rows(nodes, VELOCITY, low)
    ax0, ay0, az0 = node_rows(nodes, ACCELERATION, low)
    x, y, z = rows(work, POSITION, low)
    vx, vy, vz = rows(work, VELOCITY, low)
    ax, ay, az = rows(work, ACCELERATION, low)
    for i in range(high - low):
        x[i], vx[i] = _trapezoid(x0[i], vx0[i], ax0[i], p, q)
        y[i], vy[i] = _trapezoid(y0[i], vy0[i], ay0[i], p, q)
        z[i], vz[i] = _trapezoid(z0[i], vz0[i], az0[i], p, q)
        ax[i] = ax0[i]
        ay[i] = ay0[i]
        az[i] = az0[i]


@jit
def predict_bdf2(
    nodes: Floats, work: Floats, p: float, q: float, pending: float, low: int, high: int
) -> None:
    """Predict the BDF2 stage for the nodes low <= i < high, from the middle plus pending·delta."""
    x0, y0, z0 = node_rows(nodes, POSITION, low)
    vx0, vy0, vz0 = node_rows(nodes, VELOCITY, low)
    x, y, z = rows(work, POSITION, low)
    vx, vy, vz = rows(work, VELOCITY, low)
    ax, ay, az = rows(work, ACCELERATION, low)
    dx, dy, dz = rows(work, CORRECTION, low)
    for i in range(high - low):
        at_x = _corrected(x[i], vx[i], ax[i], pending * dx[i], p, q)
        at_y = _corrected(y[i], vy[i], ay[i], pending * dy[i], p, q)
        at_z = _corrected(z[i], vz[i], az[i], pending * dz[i], p, q)
        x[i], vx[i] = _bdf2((x0[i], vx0[i]), at_x, p, q)
        y[i], vy[i] = _bdf2((y0[i], vy0[i]), at_y, p, q)
        z[i], vz[i] = _bdf2((z0[i], vz0[i]), at_z, p, q)
        ax[i] = at_x[2]
        ay[i] = at_y[2]
        az[i] = at_z[2]


@jit
def accept(
    nodes: Floats, work: Floats, p: float, q: float, pending: float, low: int, high: int
) -> None:
    """Copy the stage's motion, plus pending·delta, to the state of the nodes low <= i < high."""
    x0, y0, z0 = node_rows(nodes, POSITION, low)
    vx0, vy0, vz0 = node_rows(nodes, VELOCITY, low)
    ax0, ay0, az0 = node_rows(nodes, ACCELERATION, low)
    x, y, z = rows(work, POSITION, low)
    vx, vy, vz = rows(work, VELOCITY, low)
    ax, ay, az = rows(work, ACCELERATION, low)
    dx, dy, dz = rows(work, CORRECTION, low)
    for i in range(high - low):
        x0[i], vx0[i], ax0[i] = _corrected(x[i], vx[i], ax[i], pending * dx[i], p, q)
        y0[i], vy0[i], ay0[i] = _corrected(y[i], vy[i], ay[i], pending * dy[i], p, q)
        z0[i], vz0[i], az0[i] = _corrected(z[i], vz[i], az[i], pending * dz[i], p, q)


@jit
def correct(work: Floats, p: float, q: float, factor: float, low: int, high: int) -> None:
    """Apply a += factor·delta, and the same correction to x and v."""
    x, y, z = rows(work, POSITION, low)
    vx, vy, vz = rows(work, VELOCITY, low)
    ax, ay, az = rows(work, ACCELERATION, low)
    dx, dy, dz = rows(work, CORRECTION, low)
    for i in range(high - low):
        x[i], vx[i], ax[i] = _corrected(x[i], vx[i], ax[i], factor * dx[i], p, q)
        y[i], vy[i], ay[i] = _corrected(y[i], vy[i], ay[i], factor * dy[i], p, q)
        z[i], vz[i], az[i] = _corrected(z[i], vz[i], az[i], factor * dz[i], p, q)
