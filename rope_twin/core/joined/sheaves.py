"""Sheaves: connections at which two ropes end, and over which rope passes from one to the other.

A rope that ends at a sheave has its last node there, and its length depends on the flow u: L = base
+ u on one side and base - u on the other. u is an unknown of the system like the position of a
connection, with the same time stepping; it has a column of `joints` (u in the row x), so that
restart, substepping and the connections' solver need no special case.

The rope that passes has x = x_sheave, v = v_sheave - V·q and a = a_sheave - A·q - 2·V·dq/dt, with q
the last element's vector over its unstretched length and V, A the rates of L. These are the motion
of the rope's last node in its kernels, so that an element needs no term for the rope that enters
it. For a variation du the node moves by B·du, B = -q on one side and +q on the other: the flow has
the balance ΣB·R of the half elements there, that is F = F' of the tensions next to the sheave less
friction and inertia of the wheel, and no jump when an element splits or merges there, which keeps F
(core/payout.py). On the sheave act -F·t - F'·t' + m·V²·(q + q'), the last term being the
momentum flux of the turning rope, by the momentum balance of what is at the sheave.

Omitted from the Jacobian, not from the balance: the derivatives of the momentum flux, of 2·V·dq/dt
and of the elements' mass to u, which are V·q/l and p·load/EA relative to the terms kept.
"""

from __future__ import annotations

from math import acos, nan, sqrt, tanh
from typing import Any

from rope_twin.core.elements import set_top_length
from rope_twin.core.jit.decorators import jit, jit_within
from rope_twin.core.jit.rows import column
from rope_twin.core.joined.stack import (
    CREEP,
    FLOW_COLUMN,
    FRICTION,
    FROM,
    INTO,
    NOWHERE,
    POINT,
    SHEAVE_MASS,
    SHEAVE_WEIGHT,
    WHEEL,
    rope_of,
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
    Boundary,
)


@jit_within
def line_at(sheaves: Any, motion: Any, r: int) -> Any:
    """Return the length of rope r, its rate and acceleration; `motion`: of the joints."""
    f, side = int(sheaves.figures[FLOW_COLUMN, sheaves.of[r]]), sheaves.side[r]
    return (
        sheaves.base[r] + side * motion[POSITION, f],
        side * motion[VELOCITY, f],
        side * motion[ACCELERATION, f],
    )


@jit
def pass_end(sheaves: Any, joints: Any, rope: Any, r: int, p: float, q: float) -> None:
    """Set the length of rope r's last element, and the motion of the rope that passes the sheave.

    The motion of the connections is that of the stage; p and q are the weights of a correction
    that the motion of the rope still lacks, 0 where it lacks none: the correction is then not read,
    which a failed step may have left not finite. An element that has run out gets the length NaN:
    the step then counts as not finite.
    """
    if sheaves is None:
        return
    if sheaves.of[r] == NOWHERE:
        return
    work, state = rope.work, rope.state
    n, P = state.counts[ELEMENTS], int(sheaves.figures[POINT, sheaves.of[r]])
    L, V, A = line_at(sheaves, joints.work, r)
    set_top_length(work, state.s, rope.sections, n, L if state.s[n - 1] < L else nan, 0.0)
    rest = work[REST, n - 1]
    for k in range(3):
        delta = work[CORRECTION + k, n - 1] if q != 0.0 else 0.0
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
    return sqrt((x - ox) ** 2 + (y - oy) ** 2 + (z - oz) ** 2) / work[REST, n - 1]


@jit_within
def _apply(S: Any, B: Any) -> Any:
    """Return S·B of a symmetric matrix (xx, xy, xz, yy, yz, zz)."""
    return (
        S[0] * B[0] + S[1] * B[1] + S[2] * B[2],
        S[1] * B[0] + S[3] * B[1] + S[4] * B[2],
        S[2] * B[0] + S[4] * B[1] + S[5] * B[2],
    )


@jit_within
def _dot(a: Any, b: Any) -> Any:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@jit_within
def _block(work: Any, i: int) -> Any:
    """Return the block of a node: xx, xy, xz, yy, yz, zz."""
    S = work[BLOCK : BLOCK + 6]
    return S[0, i], S[1, i], S[2, i], S[3, i], S[4, i], S[5, i]


@jit
def _add_end_to_flow(sheaves: Any, matrix: Any, r: int, S: Any) -> None:
    """Project a block S of rope r's last node on the flow: Bᵀ·S·B, and S·B with the sheave."""
    k, B = sheaves.of[r], column(sheaves.way, ZERO, r)
    P, f = int(sheaves.figures[POINT, k]), int(sheaves.figures[FLOW_COLUMN, k])
    SB = _apply(S, B)
    matrix[3 * f, 3 * f] += _dot(B, SB)
    for i in range(3):
        matrix[3 * f, 3 * P + i] += SB[i]


@jit
def add_sheaves(sheaves: Any, system: Any, stage: Any) -> None:
    """Add balance and blocks of sheaves and flows, given those of the ropes' ends."""
    if sheaves is None:
        return
    for k in range(sheaves.figures.shape[1]):
        into = rope_of(system.stack, int(sheaves.figures[INTO, k]))
        out = rope_of(system.stack, int(sheaves.figures[FROM, k]))
        n, m = into.state.counts[ELEMENTS], out.state.counts[ELEMENTS]
        _add_sheave(sheaves, system.joints, k, (into.work, n, out.work, m), stage.q)


@jit
def _add_sheave(sheaves: Any, joints: Any, k: int, pair: Any, q: float) -> None:
    """Add balance and blocks of sheave k; pair: scratch and elements of both ropes."""
    figures = sheaves.figures
    P, f = int(figures[POINT, k]), int(figures[FLOW_COLUMN, k])
    a, b = int(figures[INTO, k]), int(figures[FROM, k])
    work, n, other, m = pair
    mean = 0.5 * (_stretch_of(work, n) + _stretch_of(other, m))
    t, u = column(work, DIRECTION, n - 1), column(other, DIRECTION, m - 1)
    V, mass = joints.work[VELOCITY, f], figures[SHEAVE_MASS, k]
    stream = 2.0 * work[MASS, n] / work[REST, n - 1] * V * V * mean
    for i in range(3):
        sheaves.way[i, a], sheaves.way[i, b] = -mean * t[i], mean * u[i]
        force = stream * (t[i] + u[i]) - mass * joints.work[ACCELERATION + i, P]
        joints.work[RESIDUAL + i, P] += force
        joints.matrix[3 * P + i, 3 * P + i] += mass
        joints.matrix[3 * f + i, 3 * f + i] += 1.0 if i > 0 else figures[WHEEL, k]
    joints.work[RESIDUAL + 2, P] -= figures[SHEAVE_WEIGHT, k]
    pull, pull_b = -_dot(column(work, RESIDUAL, n), t), -_dot(column(other, RESIDUAL, m), u)
    # F = F'·exp(x) is F - F' = tanh(x/2)·(F + F'), for either sense of the flow
    wrap = acos(max(-1.0, min(1.0, -_dot(t, u))))
    grip = mean * tanh(0.5 * figures[FRICTION, k] * wrap) * max(pull + pull_b, 0.0)
    creep = tanh(V / CREEP)
    joints.work[RESIDUAL, f] += mean * (pull - pull_b) - grip * creep
    joints.work[RESIDUAL, f] -= figures[WHEEL, k] * joints.work[ACCELERATION, f]
    joints.matrix[3 * f, 3 * f] += q * grip * (1.0 - creep * creep) / CREEP
    _add_end_to_flow(sheaves, joints.matrix, a, _block(work, n))
    _add_end_to_flow(sheaves, joints.matrix, b, _block(other, m))


@jit
def condense_flow(sheaves: Any, joints: Any, r: int, left: Any) -> None:
    """Project the condensed block and force of rope r's last node on the flow."""
    if sheaves is None:
        return
    if sheaves.of[r] == NOWHERE:
        return
    f = int(sheaves.figures[FLOW_COLUMN, sheaves.of[r]])
    joints.work[CORRECTION, f] += _dot(column(sheaves.way, ZERO, r), left[1])
    _add_end_to_flow(sheaves, joints.factor, r, left[0])


@jit
def couple_flow(sheaves: Any, joints: Any, r: int, P: Any) -> None:
    """Project -P between rope r's last node and its first one's connection on the flow."""
    if sheaves is None:
        return
    if sheaves.of[r] == NOWHERE:
        return
    f, low = int(sheaves.figures[FLOW_COLUMN, sheaves.of[r]]), joints.lower[r]
    for k in range(3):
        joints.factor[3 * f, 3 * low + k] -= _dot(column(sheaves.way, ZERO, r), P[k])


@jit
def substitute_flow(sheaves: Any, joints: Any, work: Any, r: int, n: int) -> None:
    """Add B times the flow's correction to that of rope r's last node."""
    if sheaves is None:
        return
    if sheaves.of[r] == NOWHERE:
        return
    f = int(sheaves.figures[FLOW_COLUMN, sheaves.of[r]])
    for k in range(3):
        work[CORRECTION + k, n] += sheaves.way[k, r] * joints.work[CORRECTION, f]


@jit
def is_at_sheave(sheaves: Any, r: int) -> bool:
    """Return whether rope r's upper end is at a sheave."""
    if sheaves is None:
        return False
    return bool(sheaves.of[r] != NOWHERE)


@jit
def border_of(sheaves: Any, joints: Any, rope: Any, r: int) -> Any:
    """Return the sheave as a hang-off of rope r, over a step that ends with the present state.

    Value and rate of the length at the step's start are those that give its acceleration at the
    end.
    """
    value, rate = sheaves.borders.value[r], sheaves.borders.rate[r]
    P, h = int(sheaves.figures[POINT, sheaves.of[r]]), rope.model.step
    L, V, A = line_at(sheaves, joints.nodes, r)
    for row in range(2):
        for k in range(3):
            value[row, k] = joints.nodes[POSITION + k, P]
            rate[row, k] = joints.nodes[VELOCITY + k, P]
        value[row, LINE], rate[row, LINE] = L, V
    value[0, LINE], rate[0, LINE] = L - h * (V - 0.5 * h * A), V - h * A
    return Boundary(value, rate)
