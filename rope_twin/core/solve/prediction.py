"""Prediction of a TR-BDF2 stage: x = x_hat + p·a and v = v_hat + q·a with c = q, p = c².

TR-BDF2 (Bank et al. 1985; Hosea and Shampine 1996) with γ = 2 - √2: a trapezoidal stage to t + γ·h,
then BDF2 to t + h, both with the same weight c = γ·h/2. The initial guess of a is the last one
known; x_hat and v_hat are not stored, since a correction of a changes x by p and v by q times it.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

from rope_twin.core.jit.decorators import jit
from rope_twin.core.jit.rows import node_rows, rows
from rope_twin.core.state import ACCELERATION, CORRECTION, POSITION, VELOCITY

GAMMA = 2.0 - sqrt(2.0)
K1 = 1.0 / (GAMMA * (2.0 - GAMMA))  # weight of the middle in the BDF2 stage
K2 = (1.0 - GAMMA) ** 2 / (GAMMA * (2.0 - GAMMA))  # and of the start


@jit
def predict_trapezoid(nodes: Any, work: Any, p: float, q: float, low: int, high: int) -> None:
    """Set v_hat = v + q·a, x_hat = x + q·(v + v_hat), for the nodes low <= i < high."""
    x0, y0, z0 = node_rows(nodes, POSITION, low)
    vx0, vy0, vz0 = node_rows(nodes, VELOCITY, low)
    ax0, ay0, az0 = node_rows(nodes, ACCELERATION, low)
    x, y, z = rows(work, POSITION, low)
    vx, vy, vz = rows(work, VELOCITY, low)
    ax, ay, az = rows(work, ACCELERATION, low)
    for i in range(high - low):
        ux, uy, uz = vx0[i] + q * ax0[i], vy0[i] + q * ay0[i], vz0[i] + q * az0[i]
        x[i] = x0[i] + q * (vx0[i] + ux) + p * ax0[i]
        y[i] = y0[i] + q * (vy0[i] + uy) + p * ay0[i]
        z[i] = z0[i] + q * (vz0[i] + uz) + p * az0[i]
        vx[i] = ux + q * ax0[i]
        vy[i] = uy + q * ay0[i]
        vz[i] = uz + q * az0[i]
        ax[i] = ax0[i]
        ay[i] = ay0[i]
        az[i] = az0[i]


@jit
def predict_bdf2(nodes: Any, work: Any, p: float, q: float, low: int, high: int) -> None:
    """Set v_hat = K1·v_m - K2·v, x_hat = K1·x_m - K2·x + q·v_hat; the middle m is in work."""
    x0, y0, z0 = node_rows(nodes, POSITION, low)
    vx0, vy0, vz0 = node_rows(nodes, VELOCITY, low)
    x, y, z = rows(work, POSITION, low)
    vx, vy, vz = rows(work, VELOCITY, low)
    ax, ay, az = rows(work, ACCELERATION, low)
    for i in range(high - low):
        ux = K1 * vx[i] - K2 * vx0[i]
        uy = K1 * vy[i] - K2 * vy0[i]
        uz = K1 * vz[i] - K2 * vz0[i]
        x[i] = K1 * x[i] - K2 * x0[i] + q * ux + p * ax[i]
        y[i] = K1 * y[i] - K2 * y0[i] + q * uy + p * ay[i]
        z[i] = K1 * z[i] - K2 * z0[i] + q * uz + p * az[i]
        vx[i] = ux + q * ax[i]
        vy[i] = uy + q * ay[i]
        vz[i] = uz + q * az[i]


@jit
def predict_on(
    nodes: Any, work: Any, p: float, q: float, pending: float, low: int, high: int
) -> None:
    """Apply `predict_bdf2` after adding pending·delta to the middle."""
    x0, y0, z0 = node_rows(nodes, POSITION, low)
    vx0, vy0, vz0 = node_rows(nodes, VELOCITY, low)
    x, y, z = rows(work, POSITION, low)
    vx, vy, vz = rows(work, VELOCITY, low)
    ax, ay, az = rows(work, ACCELERATION, low)
    dx, dy, dz = rows(work, CORRECTION, low)
    for i in range(high - low):
        bx, by, bz = pending * dx[i], pending * dy[i], pending * dz[i]
        ux = K1 * (vx[i] + q * bx) - K2 * vx0[i]
        uy = K1 * (vy[i] + q * by) - K2 * vy0[i]
        uz = K1 * (vz[i] + q * bz) - K2 * vz0[i]
        cx, cy, cz = ax[i] + bx, ay[i] + by, az[i] + bz
        x[i] = K1 * (x[i] + p * bx) - K2 * x0[i] + q * ux + p * cx
        y[i] = K1 * (y[i] + p * by) - K2 * y0[i] + q * uy + p * cy
        z[i] = K1 * (z[i] + p * bz) - K2 * z0[i] + q * uz + p * cz
        vx[i] = ux + q * cx
        vy[i] = uy + q * cy
        vz[i] = uz + q * cz
        ax[i] = cx
        ay[i] = cy
        az[i] = cz


@jit
def accept(nodes: Any, work: Any, p: float, q: float, pending: float, low: int, high: int) -> None:
    """Copy the stage's motion, plus pending·delta, to the state of the nodes low <= i < high."""
    x0, y0, z0 = node_rows(nodes, POSITION, low)
    vx0, vy0, vz0 = node_rows(nodes, VELOCITY, low)
    ax0, ay0, az0 = node_rows(nodes, ACCELERATION, low)
    x, y, z = rows(work, POSITION, low)
    vx, vy, vz = rows(work, VELOCITY, low)
    ax, ay, az = rows(work, ACCELERATION, low)
    dx, dy, dz = rows(work, CORRECTION, low)
    for i in range(high - low):
        bx, by, bz = pending * dx[i], pending * dy[i], pending * dz[i]
        x0[i] = x[i] + p * bx
        y0[i] = y[i] + p * by
        z0[i] = z[i] + p * bz
        vx0[i] = vx[i] + q * bx
        vy0[i] = vy[i] + q * by
        vz0[i] = vz[i] + q * bz
        ax0[i] = ax[i] + bx
        ay0[i] = ay[i] + by
        az0[i] = az[i] + bz


@jit
def correct(work: Any, p: float, q: float, factor: float, low: int, high: int) -> None:
    """Apply a += factor·delta, and the same correction to x and v."""
    x, y, z = rows(work, POSITION, low)
    vx, vy, vz = rows(work, VELOCITY, low)
    ax, ay, az = rows(work, ACCELERATION, low)
    dx, dy, dz = rows(work, CORRECTION, low)
    for i in range(high - low):
        bx, by, bz = factor * dx[i], factor * dy[i], factor * dz[i]
        x[i] += p * bx
        y[i] += p * by
        z[i] += p * bz
        vx[i] += q * bx
        vy[i] += q * by
        vz[i] += q * bz
        ax[i] += bx
        ay[i] += by
        az[i] += bz
