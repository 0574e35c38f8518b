"""Node equations of one stage: tangents, tension, inertia of the rope, then the effects' loads."""

from __future__ import annotations

from math import sqrt
from typing import Any

from rope_twin.core import terms
from rope_twin.core.jit import jit, jit_inline
from rope_twin.core.rows import blocks, fill
from rope_twin.core.state import (
    ACCELERATION,
    BLOCK,
    CORRECTION,
    DIRECTION,
    ELEMENTS,
    FLOW,
    LUMP,
    POSITION,
    POSITION_HAT,
    RESIDUAL,
    REST,
    TANGENT,
    TENSION,
    VELOCITY,
    VELOCITY_HAT,
)


@jit
def update(work: Any, p: float, q: float, first: int, n: int) -> None:
    """x = x_hat + p·a and v = v_hat + q·a of the free nodes."""
    for k in range(3):
        x, v, a = (
            work[POSITION + k][first:n],
            work[VELOCITY + k][first:n],
            work[ACCELERATION + k][first:n],
        )
        x_hat, v_hat = work[POSITION_HAT + k][first:n], work[VELOCITY_HAT + k][first:n]
        for i in range(n - first):
            x[i] = x_hat[i] + p * a[i]
            v[i] = v_hat[i] + q * a[i]


@jit
def add_correction(work: Any, factor: float, first: int, n: int) -> None:
    """a += factor·delta of the free nodes."""
    for k in range(3):
        a, delta = work[ACCELERATION + k][first:n], work[CORRECTION + k][first:n]
        for i in range(n - first):
            a[i] += factor * delta[i]


@jit
def slope(work: Any, first: int, n: int) -> float:
    """R·delta: minus the slope of the stage's energy along the correction."""
    total = 0.0
    for k in range(3):
        R, delta = work[RESIDUAL + k][first:n], work[CORRECTION + k][first:n]
        for i in range(n - first):
            total += R[i] * delta[i]
    return total


@jit
def set_lengths(work: Any, s: Any, n: int, L: float) -> None:
    """Rest lengths of the elements and the rope length that each node carries, line out L."""
    rest, lump = work[REST], work[LUMP]
    for e in range(n - 1):
        rest[e] = s[e + 1] - s[e]
    rest[n - 1] = L - s[n - 1]
    lump[0] = 0.5 * rest[0]
    for i in range(1, n):
        lump[i] = 0.5 * (rest[i - 1] + rest[i])
    lump[n] = 0.5 * rest[n - 1]


@jit
def set_top_length(work: Any, s: Any, n: int, L: float) -> None:
    """The same for the only parts that change with the line out: the top element."""
    work[REST, n - 1] = L - s[n - 1]
    work[LUMP, n - 1] = 0.5 * (work[REST, n - 2] + work[REST, n - 1])
    work[LUMP, n] = 0.5 * work[REST, n - 1]


@jit_inline
def _set_tangents(work: Any, n: int) -> None:
    """Mean direction of the neighbouring elements; 1e-12 keeps a folded rope off 0/0."""
    ax, ay, az = work[DIRECTION], work[DIRECTION + 1], work[DIRECTION + 2]
    tx, ty, tz = work[TANGENT], work[TANGENT + 1], work[TANGENT + 2]
    for i in range(1, n):
        x, y, z = ax[i - 1] + ax[i], ay[i - 1] + ay[i], az[i - 1] + az[i]
        inverse = 1.0 / sqrt(x * x + y * y + z * z + 1e-12)
        tx[i], ty[i], tz[i] = x * inverse, y * inverse, z * inverse
    for k in range(3):
        work[TANGENT + k, 0] = work[DIRECTION + k, 0]


@jit_inline
def _set_pulls(work: Any, m: float, n: int) -> None:
    """R_i = T_i·t_i - T_{i-1}·t_{i-1} - m·lump·a; A_i = m·lump·I."""
    T, lump = work[TENSION], work[LUMP]
    for k in range(3):
        R, a, t = work[RESIDUAL + k], work[ACCELERATION + k], work[DIRECTION + k]
        R[0] = T[0] * t[0] - m * lump[0] * a[0]
        for i in range(1, n):
            R[i] = T[i] * t[i] - T[i - 1] * t[i - 1] - m * lump[i] * a[i]
    Axx, Axy, Axz, Ayy, Ayz, Azz = blocks(work, 0, n)
    for i in range(n):
        mass = m * lump[i]
        Axx[i] = mass
        Ayy[i] = mass
        Azz[i] = mass
        Axy[i] = 0.0
        Axz[i] = 0.0
        Ayz[i] = 0.0


@jit_inline
def evaluate(rope: Any, stage: Any) -> None:
    """Residual R and blocks A of the free nodes, from the nodes' motion and the elements' tension.

    R_i = T_i·t_i - T_{i-1}·t_{i-1} - m·lump·a + loads; A_i = m·lump·I + what the effects add.
    """
    n = rope.state.counts[ELEMENTS]
    _set_tangents(rope.work, n)
    _set_pulls(rope.work, rope.model.m, n)
    terms.add_load(rope.effects, rope.model, rope.work, stage, 0, n)


@jit
def set_flow(rope: Any, stage: Any, low: int, high: int) -> None:
    """Water velocity at the nodes, at the stage's predicted positions.

    They differ from the accepted ones by p·(a - a predicted), of third order in the step.
    """
    fill(rope.work, FLOW, 0.0, low, high)
    terms.add_flow(rope.effects, rope.model, rope.work, stage, low, high)


@jit_inline
def load_per_metre(rope: Any, stage: Any, node: int) -> None:
    """Force less inertia per metre of rope, into the residual of the spare slot `node`.

    The caller has set motion and tangent of that slot; its lump becomes 1 m.
    """
    work = rope.work
    work[LUMP, node] = 1.0
    set_flow(rope, stage, node, node + 1)
    for k in range(3):
        work[RESIDUAL + k, node] = -rope.model.m * work[ACCELERATION + k, node]
    for k in range(6):
        work[BLOCK + k, node] = 0.0
    terms.add_load(rope.effects, rope.model, work, stage, node, node + 1)
