"""Vortex shedding along a rope, from the water velocity normal to its mean shape.

The shape is the running mean of the rope's tangent; it follows payout and current.
"""

from __future__ import annotations

from math import pi, sqrt
from typing import Any

from rope_twin.core.guards import DIVISOR_MIN, RATE_MIN
from rope_twin.core.jit.decorators import jit, jit_within
from rope_twin.core.jit.rows import row, rows
from rope_twin.core.rope.elastic import stretch_all
from rope_twin.core.solve.assembly import set_flow
from rope_twin.core.state import ELEMENTS, FLOW, POSITION, REST, TANGENT, VOLUME, Stage

INCLINED = sqrt(0.5)  # sine of 45°


@jit_within
def three_rows(memory: Any, first: int, low: int) -> Any:
    """Return three rows of a memory from node `low` on."""
    return memory[first, low:], memory[first + 1, low:], memory[first + 2, low:]


@jit
def set_node_lengths(work: Any, length: Any, low: int, high: int) -> None:
    """Set the unstretched length lumped at the free nodes low <= i < high [m].

    length: result, from node `low` on.
    """
    first = max(low, 1)
    rest, below = row(work, REST, first), row(work, REST, first - 1)
    if low == 0:
        length[0] = 0.5 * work[REST, 0]
    own = length[first - low :]
    for i in range(high - first):
        own[i] = 0.5 * (rest[i] + below[i])


@jit
def evaluate_statics(rope: Any) -> None:
    """Compute directions, tensions and water velocity in static equilibrium at time 0."""
    n, stage = rope.state.counts[ELEMENTS], Stage(0.0, 1.0, 0.0, 0.0)
    stretch_all(rope, stage)
    set_flow(rope.effects, rope.work, stage, n - n, n)


@jit
def set_shape(rope: Any, shape: Any) -> None:
    """Set `shape` (three rows) to the rope's present tangent at its free nodes."""
    nodes, (x, y, z) = rope.state.nodes, shape
    for i in range(rope.state.counts[ELEMENTS]):
        low = max(i - 1, 0)
        dx = nodes[POSITION, i + 1] - nodes[POSITION, low]
        dy = nodes[POSITION + 1, i + 1] - nodes[POSITION + 1, low]
        dz = nodes[POSITION + 2, i + 1] - nodes[POSITION + 2, low]
        inverse = 1.0 / sqrt(dx * dx + dy * dy + dz * dz + DIVISOR_MIN)
        x[i], y[i], z[i] = inverse * dx, inverse * dy, inverse * dz


@jit
def follow_shape(work: Any, share: float, mean: Any, shape: Any, n: int) -> None:
    """Set shape = mean + share·(tangent - mean) of the nodes below n; both are three rows."""
    tx, ty, tz = rows(work, TANGENT, 0)
    (mx, my, mz), (x, y, z) = mean, shape
    for i in range(n):
        x[i] = mx[i] + share * (tx[i] - mx[i])
        y[i] = my[i] + share * (ty[i] - my[i])
        z[i] = mz[i] + share * (tz[i] - mz[i])


@jit_within
def _shed(wake: Any, water: Any, tangent: Any) -> Any:
    """Return V × t_s, its magnitude |V_N|, A and ε at a node; t_s: tangent of the mean shape."""
    u, v, w = water
    x, y, z = tangent
    cx, cy, cz = v * z - w * y, w * x - u * z, u * y - v * x
    speed = sqrt(cx * cx + cy * cy + cz * cz)
    along = u * x + v * y + w * z
    upright = along * along < INCLINED * INCLINED * (u * u + v * v + w * w)
    A = wake.A if upright else wake.A_inclined
    epsilon = wake.epsilon if upright else wake.epsilon_inclined
    return (cx, cy, cz), speed, A, epsilon


@jit
def set_shedding(wake: Any, work: Any, own: Any, low: int, high: int) -> None:
    """Set ω_s [rad/s], ε, the lift factor [kg/m] and (A/D)·D_a of the nodes low <= i < high.

    own: rows from node `low` on: the shape (three); ω_s, ε and lift factor, which contains the
    node's length; and (A/D)·D_a (three).
    """
    (tx, ty, tz), (omega, epsilon, length), (bx, by, bz) = own
    ux, uy, uz = rows(work, FLOW, low)
    volume = row(work, VOLUME, low)
    for i in range(high - low):
        per_diameter = sqrt(0.25 * pi * length[i] / (volume[i] + DIVISOR_MIN))
        (x, y, z), speed, A, e = _shed(wake, (ux[i], uy[i], uz[i]), (tx[i], ty[i], tz[i]))
        omega[i] = 2.0 * pi * wake.strouhal * speed * per_diameter
        epsilon[i] = e
        length[i] *= wake.strength / per_diameter
        scale = A * per_diameter / (speed + RATE_MIN)
        bx[i], by[i], bz[i] = scale * x, scale * y, scale * z
