"""Drag that a rope has more because it shakes, where its vibration is no motion of the nodes.

Per metre -½·ρ·d·Cdn·g·|n|·n with n the rope's velocity through the water across itself and g what
the drag coefficient has grown by, 0 where the rope keeps still. g is one number at each node, set
between two steps by who knows the vibration; over a step it stays. It is carried with the rope's
material (core/remembering.py) through the winch, splits and merges.
"""

from __future__ import annotations

from math import sqrt
from typing import Any, NamedTuple

import numpy as np

from rope_twin.core.energy import account
from rope_twin.core.guards import STILL2
from rope_twin.core.hooks import kernel
from rope_twin.core.jit import jit
from rope_twin.core.remembering import new_memory, remembering
from rope_twin.core.rows import row, rows, span
from rope_twin.core.state import (
    BLOCK,
    ELEMENTS,
    FLOW,
    FRONTAL,
    RESIDUAL,
    TANGENT,
    VELOCITY,
    Floats,
    State,
)
from rope_twin.core.trial import TRIALS

CARRIED = 1  # g
GROWTH, GROWTH_NEXT = 0, CARRIED
NODES = 3 * CARRIED  # where remembering notes the nodes that the numbers are of


class DragGrowth(NamedTuple):
    """What the kernels see."""

    memory: Floats  # g in row GROWTH, (rows, nodes)
    kn: float  # ½·ρ·Cdn, of the drag that grows [kg/m³]


def new_growth(kn: float, room: int) -> DragGrowth:
    """None yet, for a rope of so many nodes."""
    return DragGrowth(new_memory(CARRIED, 0, room), float(kn))


def set_growth(growth: DragGrowth, state: State, values: Floats) -> None:
    """Set g of the nodes from the lower end up, between two steps; the hang-off's is not used."""
    n = int(state.counts[ELEMENTS])
    growth.memory[GROWTH, :n] = values[:n]
    growth.memory[NODES, :n] = state.s[:n]
    growth.memory[NODES, -1] = n
    slots = state.s.shape[0]
    growth.memory[GROWTH, slots - TRIALS : slots] = growth.memory[GROWTH, n - 1]


remembering(DragGrowth, CARRIED)


@jit
def _set_trials(memory: Any, n: int, slots: int) -> None:
    """At the trial nodes it is that of the highest free node."""
    for slot in range(slots - TRIALS, slots):
        memory[GROWTH, slot] = memory[GROWTH, n - 1]


@kernel("start", DragGrowth)
def start(growth: Any, rope: Any) -> None:
    """A rope at rest does not shake."""
    for i in range(rope.state.s.shape[0]):
        growth.memory[GROWTH, i] = 0.0


@kernel("predict", DragGrowth)
def predict(growth: Any, rope: Any, stage: Any, kind: int, low: int, high: int) -> None:
    """It stays as it is over a step: nothing of it is predicted."""


@kernel("load_nodes", DragGrowth)
def load_nodes(growth: Any, work: Any, stage: Any, low: int, high: int) -> None:
    """F = -c·n, c = kn·frontal area·g·|n|; A = q·c·(I - ττᵀ + nnᵀ/|n|²), as of the drag itself."""
    grown, frontal = growth.memory[GROWTH, low:], row(work, FRONTAL, low)
    vx, vy, vz = rows(work, VELOCITY, low)
    ux, uy, uz = rows(work, FLOW, low)
    tx, ty, tz = rows(work, TANGENT, low)
    Rx, Ry, Rz = rows(work, RESIDUAL, low)
    Axx, Axy, Axz, Ayy, Ayz, Azz = span(work, BLOCK, 6, low)
    for i in range(high - low):
        x, y, z = tx[i], ty[i], tz[i]
        nx, ny, nz = vx[i] - ux[i], vy[i] - uy[i], vz[i] - uz[i]
        along = nx * x + ny * y + nz * z
        nx, ny, nz = nx - along * x, ny - along * y, nz - along * z
        speed = sqrt(nx * nx + ny * ny + nz * nz + STILL2)
        k = growth.kn * frontal[i] * grown[i]
        c = k * speed
        Rx[i] -= c * nx
        Ry[i] -= c * ny
        Rz[i] -= c * nz
        c, g = stage.q * c, stage.q * k / speed
        Axx[i] += c * (1.0 - x * x) + g * nx * nx
        Axy[i] += g * nx * ny - c * x * y
        Axz[i] += g * nx * nz - c * x * z
        Ayy[i] += c * (1.0 - y * y) + g * ny * ny
        Ayz[i] += g * ny * nz - c * y * z
        Azz[i] += c * (1.0 - z * z) + g * nz * nz


@kernel("settle", DragGrowth)
def settle(growth: Any, rope: Any, stage: Any, kind: int) -> None:
    """What it was before the stage it is after."""
    memory, n = growth.memory, rope.state.counts[ELEMENTS]
    for i in range(n):
        memory[GROWTH_NEXT, i] = memory[GROWTH, i]
    _set_trials(memory, n, rope.state.s.shape[0])


@account("power", DragGrowth)
def power(growth: Any, place: Any) -> Any:
    """Force times velocity [W]; the hang-off's is as at the node below."""
    n = place.position.shape[1]
    grown = growth.memory[GROWTH, :n].copy()
    if n > 1:
        grown[-1] = grown[-2]
    u = place.velocity - place.flow
    across = u - (u * place.tangent).sum(axis=0) * place.tangent
    c = growth.kn * place.frontal * grown * np.sqrt((across * across).sum(axis=0))
    return -c * (across * place.velocity).sum(axis=0)
