"""Drag amplification by vortex-induced vibration that is not resolved as motion of the nodes.

The additional force per metre is -½·ρ·d·Cdn·g·|n|·n with n the relative velocity normal to the rope
and g = a·(2·rms/d)^b (Vandiver 1983) the increase of the drag coefficient relative to it, 0 where
the rope does not vibrate. g is one number at each node, set between two steps by the VIV model,
constant over a step. It is carried with the rope's material (core/loads/memory.py) through the
winch, splits and merges.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import Any, NamedTuple

import numpy as np

from rope_twin.core.energy import account
from rope_twin.core.jit.decorators import jit
from rope_twin.core.jit.rows import row, rows, span
from rope_twin.core.loads.hooks import kernel
from rope_twin.core.loads.memory import new_memory, remembering
from rope_twin.core.payout import set_trials
from rope_twin.core.state import (
    BLOCK,
    FLOW,
    FRONTAL,
    RESIDUAL,
    SPEED2_MIN,
    TANGENT,
    VELOCITY,
    Floats,
    State,
)
from rope_twin.quantity import quantity

CARRIED = 1  # g
GROWTH, GROWTH_NEXT = 0, CARRIED
NODES = 3 * CARRIED  # row of material coordinates of the nodes that the numbers belong to


@dataclass(frozen=True, kw_only=True)
class DragGrowthParams:
    """Parameters shared by the decoupled VIV models; drag amplification as in Vandiver (1983)."""

    damping_fraction: float = quantity(
        "structural damping ratio of every mode", "", 0.0, 0.5, default=0.015
    )
    modes_every_s: float = quantity("interval of the modal analysis", "s", 0.1, 60.0, default=1.0)
    drag_growth: tuple[float, float] = quantity(
        "a and b of the drag amplification factor 1 + a·(2·rms/d)^b", "", 0.0, 5.0,
        default=(1.043, 0.65),
    )  # fmt: skip
    drag: float | None = quantity(
        "amplified C_d; default: `normal` of the effect `drag`", "", 0.0, 10.0, default=None
    )


class DragGrowth(NamedTuple):
    """Kernel data of the drag amplification."""

    memory: Floats  # g in row GROWTH, (rows, nodes)
    kn: float  # ½·ρ·Cdn of the amplified drag [kg/m³]


def build_growth(params: DragGrowthParams, payload: Any, around: Any) -> DragGrowth:
    """Return zero drag amplification, from the rope's drag coefficient and the water density."""
    drag = around.drag_normal if params.drag is None else params.drag
    kn = 0.5 * around.water_density_kg_per_m3 * drag
    return DragGrowth(new_memory(CARRIED, 0, around.room), float(kn))


def set_growth(growth: DragGrowth, state: State, values: Floats) -> None:
    """Set g of the nodes that carry loads, from the lower end up, between two steps.

    They are all nodes, or all but one at the hang-off.
    """
    n = len(values)
    growth.memory[GROWTH, :n] = values
    growth.memory[GROWTH, n:] = values[-1]  # of ghost nodes, and of a node where an element splits
    growth.memory[NODES, :n] = state.s[:n]
    growth.memory[NODES, -1] = n


remembering(DragGrowth, CARRIED)


@kernel("start", DragGrowth)
def start(growth: Any, rope: Any, upto: int) -> None:
    """Reset g to zero: a rope in static equilibrium does not vibrate."""
    for i in range(rope.state.s.shape[0]):
        growth.memory[GROWTH, i] = 0.0


@kernel("predict", DragGrowth)
def predict(growth: Any, rope: Any, stage: Any, kind: int, low: int, high: int) -> None:
    """Do nothing: g is constant over a step."""


@jit
def add_more_drag(kn: float, more: Any, work: Any, stage: Any, low: int, high: int) -> None:
    """Add the share `more` of the drag across the rope to the nodes low <= i < high.

    F = -c·n, c = kn·frontal area·more·|n|; A = q·c·(I - ττᵀ + nnᵀ/|n|²), as the effect `drag` has
    them. kn: ½·ρ·C_dn [kg/m³]; more: of the nodes from `low` on.
    """
    frontal = row(work, FRONTAL, low)
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
        speed = sqrt(nx * nx + ny * ny + nz * nz + SPEED2_MIN)
        k = kn * frontal[i] * more[i]
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


@kernel("load_nodes", DragGrowth)
def load_nodes(growth: Any, work: Any, stage: Any, low: int, high: int) -> None:
    """Add g times the drag across the rope, and its block."""
    add_more_drag(growth.kn, growth.memory[GROWTH, low:], work, stage, low, high)


@kernel("settle", DragGrowth)
def settle(growth: Any, rope: Any, stage: Any, kind: int, upto: int) -> None:
    """Copy g to the end of the stage; ghost nodes take that of the highest free node."""
    memory = growth.memory
    for i in range(upto):
        memory[GROWTH_NEXT, i] = memory[GROWTH, i]
    set_trials(memory, GROWTH, memory[GROWTH, upto - 1], rope)


@account("power", DragGrowth)
def power(growth: Any, place: Any) -> Any:
    """Return force times velocity [W]; g at the hang-off is that of the node below."""
    n = place.position.shape[1]
    grown = growth.memory[GROWTH, :n].copy()
    if n > growth.memory[NODES, -1] > 0:
        grown[-1] = grown[-2]
    u = place.velocity - place.flow
    across = u - (u * place.tangent).sum(axis=0) * place.tangent
    c = growth.kn * place.frontal * grown * np.sqrt((across * across).sum(axis=0))
    return -c * (across * place.velocity).sum(axis=0)


VANDIVER = (1.043, 0.65)  # Vandiver (1983)


def amplified_drag(rms: Floats, growth: tuple[float, float] = VANDIVER) -> Floats:
    """Return 1 + a·(2·rms/d)^b, with a and b in `growth`; rms over the diameter."""
    a, b = growth
    return np.asarray(1.0 + a * (2.0 * rms) ** b)
