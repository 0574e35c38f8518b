"""Sheaves: connections at which two ropes end, with rope passing from one to the other.

A rope that ends at a sheave has its last node there, and its length depends on the flow u: L = base
+ u on one side and base - u on the other. u is an unknown of the system with the same time
integration as the position of a connection, and is stored in a column of `joints` (row x), so that
restart, substepping and the linear solver need no special case.

The rope that passes has x = x_sheave, v = v_sheave - V·q and a = a_sheave - A·q - 2·V·dq/dt, with q
the last element's vector over its unstretched length and V, A the rates of L. These are the motion
of the rope's last node in its kernels, so that the element needs no term for inflowing rope. For a
variation du the node moves by B·du, B = -q on one side and +q on the other: the balance of the flow
is ΣB·R of the half elements there, that is F = F' of the tensions next to the sheave less friction
and inertia of the wheel, without a jump when an element splits or merges there, which preserves F
(core/payout.py). The force on the sheave is -F·t - F'·t' + m·V²·(q + q'), with the momentum flux of
the deflected rope as last term.

In SIMD lanes (core/lanes) the same functions take tables of wide numbers.

Omitted from the Jacobian, not from the balance: the derivatives of the momentum flux, of 2·V·dq/dt
and of the elements' mass to u, which are V·q/l and p·load/EA relative to the terms kept.
"""

from __future__ import annotations

from math import acos, nan, sqrt, tanh
from typing import Any

from rope_twin.core.elements import set_top_of
from rope_twin.core.elimination import apply, dot, six
from rope_twin.core.jit.decorators import jit, jit_within
from rope_twin.core.jit.rows import column
from rope_twin.core.jit.wide import choose, whole
from rope_twin.core.joined.stack import (
    FLOW_COLUMN,
    FRICTION,
    FROM,
    INTO,
    NOWHERE,
    POINT,
    SHEAVE_FRICTION_SPEED,
    SHEAVE_MASS,
    SHEAVE_WEIGHT,
    WHEEL,
    work_of,
)
from rope_twin.core.state import (
    ACCELERATION,
    BLOCK,
    CORRECTION,
    DIRECTION,
    ELEMENTS,
    LINE,
    MASS,
    POSITION,
    RESIDUAL,
    REST,
    VELOCITY,
    ZERO,
)


@jit_within
def line_at(sheaves: Any, motion: Any, r: int) -> Any:
    """Return the length of rope r, its rate and acceleration; `motion`: of the joints."""
    f, side = whole(sheaves.figures[FLOW_COLUMN, sheaves.of[r]]), sheaves.side[r]
    return (
        sheaves.base[r] + side * motion[POSITION, f],
        side * motion[VELOCITY, f],
        side * motion[ACCELERATION, f],
    )


@jit
def pass_end(sheaves: Any, joints: Any, rope: Any, r: int, p: float, q: float) -> None:
    """Set the length of rope r's last element, and the motion of the rope that passes the sheave.

    The motion of the connections is that of the stage. p and q are the weights of a pending
    correction of the rope's motion, or 0; the correction is then not read, since a failed step may
    have left NaN there. An element of negative length gets the length NaN, which fails the step.
    """
    if sheaves is None:
        return
    if sheaves.of[r] == NOWHERE:
        return
    work, state = rope.work, rope.state
    n, P = state.counts[ELEMENTS], whole(sheaves.figures[POINT, sheaves.of[r]])
    L, V, A = line_at(sheaves, joints.work, r)
    L = choose(state.s[n - 1] < L, L, nan)
    set_top_of(work, state.s, rope.sections, n, (L, 0.0), (ZERO, ZERO))
    rest = work[REST, n - 1]
    for k in range(3):
        delta = choose(abs(q) > 0.0, work[CORRECTION + k, n - 1], 0.0)
        x, v = work[POSITION + k, n - 1] + p * delta, work[VELOCITY + k, n - 1] + q * delta
        along = (joints.work[POSITION + k, P] - x) / rest
        turn = (joints.work[VELOCITY + k, P] - v - V * along) / rest
        work[POSITION + k, n] = joints.work[POSITION + k, P]
        work[VELOCITY + k, n] = joints.work[VELOCITY + k, P] - V * along
        work[ACCELERATION + k, n] = joints.work[ACCELERATION + k, P] - A * along - 2.0 * V * turn


@jit_within
def _stretch_of(work: Any, n: int) -> Any:
    """Return the length of the last element over its unstretched length."""
    x, y, z = column(work, POSITION, n)
    ox, oy, oz = column(work, POSITION, n - 1)
    x, y, z = x - ox, y - oy, z - oz
    return sqrt(x * x + y * y + z * z) / work[REST, n - 1]


@jit
def _add_end_to_flow(sheaves: Any, matrix: Any, r: int, S: Any) -> None:
    """Project a block S of rope r's last node on the flow: Bᵀ·S·B, and S·B with the sheave."""
    k, B = sheaves.of[r], column(sheaves.way, ZERO, r)
    P, f = whole(sheaves.figures[POINT, k]), whole(sheaves.figures[FLOW_COLUMN, k])
    SB = apply(S, B)
    matrix[3 * f, 3 * f] += dot(B, SB)
    for i in range(3):
        matrix[3 * f, 3 * P + i] += SB[i]


@jit
def add_sheaves(sheaves: Any, system: Any, stage: Any) -> None:
    """Add balance and blocks of sheaves and flows, given those of the ropes' ends."""
    if sheaves is None:
        return
    for k in range(sheaves.figures.shape[1]):
        a, b = whole(sheaves.figures[INTO, k]), whole(sheaves.figures[FROM, k])
        n, m = system.stack.counts[a, ELEMENTS], system.stack.counts[b, ELEMENTS]
        pair = work_of(system.stack, a)[0], n, work_of(system.stack, b)[0], m
        _add_sheave(sheaves, system.joints, k, pair, stage.q)


@jit
def _add_sheave(sheaves: Any, joints: Any, k: int, pair: Any, q: float) -> None:
    """Add balance and blocks of sheave k; pair: scratch and elements of both ropes."""
    figures = sheaves.figures
    P, f = whole(figures[POINT, k]), whole(figures[FLOW_COLUMN, k])
    a, b = whole(figures[INTO, k]), whole(figures[FROM, k])
    work, n, second, m = pair
    mean = 0.5 * (_stretch_of(work, n) + _stretch_of(second, m))
    t, u = column(work, DIRECTION, n - 1), column(second, DIRECTION, m - 1)
    V, mass = joints.work[VELOCITY, f], figures[SHEAVE_MASS, k]
    stream = 2.0 * work[MASS, n] / work[REST, n - 1] * V * V * mean
    for i in range(3):
        sheaves.way[i, a] = -mean * t[i]
        sheaves.way[i, b] = mean * u[i]
        force = stream * (t[i] + u[i]) - mass * joints.work[ACCELERATION + i, P]
        joints.work[RESIDUAL + i, P] += force
        joints.matrix[3 * P + i, 3 * P + i] += mass
        joints.matrix[3 * f + i, 3 * f + i] += choose(i > 0, 1.0, figures[WHEEL, k])
    joints.work[RESIDUAL + 2, P] -= figures[SHEAVE_WEIGHT, k]
    pull, pull_b = -dot(column(work, RESIDUAL, n), t), -dot(column(second, RESIDUAL, m), u)
    # F = F'·exp(x) is F - F' = tanh(x/2)·(F + F'), for either sense of the flow
    wrap = acos(max(-1.0, min(1.0, -dot(t, u))))
    grip = mean * tanh(0.5 * figures[FRICTION, k] * wrap) * max(pull + pull_b, 0.0)
    creep = tanh(V / SHEAVE_FRICTION_SPEED)
    joints.work[RESIDUAL, f] += mean * (pull - pull_b) - grip * creep
    joints.work[RESIDUAL, f] -= figures[WHEEL, k] * joints.work[ACCELERATION, f]
    joints.matrix[3 * f, 3 * f] += q * grip * (1.0 - creep * creep) / SHEAVE_FRICTION_SPEED
    _add_end_to_flow(sheaves, joints.matrix, a, six(work, BLOCK, n))
    _add_end_to_flow(sheaves, joints.matrix, b, six(second, BLOCK, m))


@jit
def condense_flow(sheaves: Any, joints: Any, matrix: Any, r: int, schur: Any) -> None:
    """Project the condensed block and force of rope r's last node on the flow."""
    if sheaves is None:
        return
    if sheaves.of[r] == NOWHERE:
        return
    f = whole(sheaves.figures[FLOW_COLUMN, sheaves.of[r]])
    joints.work[CORRECTION, f] += dot(column(sheaves.way, ZERO, r), schur[1])
    _add_end_to_flow(sheaves, matrix, r, schur[0])


@jit
def couple_flow(sheaves: Any, joints: Any, matrix: Any, r: int, P: Any) -> None:
    """Project -P between rope r's last node and its first one's connection on the flow."""
    if sheaves is None:
        return
    if sheaves.of[r] == NOWHERE:
        return
    f, low = whole(sheaves.figures[FLOW_COLUMN, sheaves.of[r]]), joints.lower[r]
    for k in range(3):
        matrix[3 * f, 3 * low + k] -= dot(column(sheaves.way, ZERO, r), P[k])


@jit
def substitute_flow(sheaves: Any, joints: Any, work: Any, r: int, n: int) -> None:
    """Add B times the flow's correction to that of rope r's last node."""
    if sheaves is None:
        return
    if sheaves.of[r] == NOWHERE:
        return
    f = whole(sheaves.figures[FLOW_COLUMN, sheaves.of[r]])
    for k in range(3):
        work[CORRECTION + k, n] += sheaves.way[k, r] * joints.work[CORRECTION, f]


@jit
def is_at_sheave(sheaves: Any, r: int) -> bool:
    """Return whether rope r's upper end is at a sheave."""
    if sheaves is None:
        return False
    return bool(sheaves.of[r] != NOWHERE)


@jit
def set_border(sheaves: Any, motion: Any, h: float, r: int) -> None:
    """Set the sheave as a hang-off of rope r, over a step of h [s] that ends with this motion.

    motion: of the joints. Rows 2·r and 2·r + 1 of `borders` are the step's start and end. Value and
    rate of the length at the start are chosen to reproduce its acceleration at the end.
    """
    value, rate = sheaves.borders.value, sheaves.borders.rate
    P, start = whole(sheaves.figures[POINT, sheaves.of[r]]), 2 * r
    L, V, A = line_at(sheaves, motion, r)
    for row in range(start, start + 2):
        for k in range(3):
            value[row, k] = motion[POSITION + k, P]
            rate[row, k] = motion[VELOCITY + k, P]
        value[row, LINE] = L
        rate[row, LINE] = V
    value[start, LINE] = L - h * (V - 0.5 * h * A)
    rate[start, LINE] = V - h * A
