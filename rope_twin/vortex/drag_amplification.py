"""Amplification of the rope's drag: by vibration, and by its Keulegan-Carpenter number.

**Vortex-induced vibration** that is not resolved as motion of the nodes. The additional force per
metre is -½·ρ·d·Cdn·g·|n|·n with n the relative velocity normal to the rope and g = a·(2·rms/d)^b
(Vandiver 1983) the increase of the drag coefficient relative to it, 0 where the rope does not
vibrate. g is one number at each node, set between two steps by the VIV model, constant over a step.
It is carried with the rope's material (core/loads/memory.py) through the winch, splits and merges.

**Keulegan-Carpenter number** and roughness, from the user's own tables. In an oscillating flow the
drag coefficient is not that of a steady one: it depends on KC = U_m·T/d and on the roughness k/d of
the surface (Keulegan and Carpenter 1958, J. Res. NBS 60, 423; Sarpkaya 1976, OTC 2533). The rope
has one roughness; between tables of two the factor is linear in its logarithm.

KC is that of each node's own motion through the water, across the rope, over the time that has
passed: n is the relative velocity across the rope, and a mean ⟨·⟩ fades with the time constant τ.
With σ² = ⟨|n|²⟩ - |⟨n⟩|² and the rate of n from step to step,

    KC = (|⟨n⟩| + √2·σ)·T/d,    T = 2π·√((σ² + ε)/(⟨|dn/dt|²⟩ + ε/τ²)).

√2·σ is the amplitude of the sine that has this variance, T Rice's (1944) mean period of zero
crossings of a Gaussian motion, so that a regular motion has exactly U_m·T/d, whatever moves: water,
vessel or rope. The mean flow adds to the amplitude, and what hardly moves (ε = (1 mm/s)²) has the
period 2π·τ: a steady flow thus has the last row of the table. These two are choices of ours. The
factor is constant over a step; in static equilibrium it is that of the last row.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import exp, pi, sqrt
from typing import Any, NamedTuple

import numpy as np

from rope_twin.core.integrator import BDF2, GAMMA, TRAPEZOID
from rope_twin.core.jit.decorators import jit, jit_within
from rope_twin.core.jit.functions import interpolate, renewed
from rope_twin.core.jit.rows import row, rows
from rope_twin.core.jit.wide import choose
from rope_twin.core.loads.accounts import account
from rope_twin.core.loads.balance import add_to_node
from rope_twin.core.loads.hooks import Load, kernel
from rope_twin.core.loads.memory import count_initialised, declare_internal_variables, new_memory
from rope_twin.core.payout import set_trials
from rope_twin.core.state import (
    DIVISOR_MIN,
    FLOW,
    FRONTAL,
    LENGTH,
    SPEED2_MIN,
    TANGENT,
    VELOCITY,
    VOLUME,
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


declare_internal_variables(DragGrowth, CARRIED)


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
    for i in range(high - low):
        x, y, z = tx[i], ty[i], tz[i]
        nx, ny, nz = vx[i] - ux[i], vy[i] - uy[i], vz[i] - uz[i]
        along = nx * x + ny * y + nz * z
        nx, ny, nz = nx - along * x, ny - along * y, nz - along * z
        speed = sqrt(nx * nx + ny * ny + nz * nz + SPEED2_MIN)
        k = kn * frontal[i] * more[i]
        c = k * speed
        d, g = stage.q * c, stage.q * k / speed
        add_to_node(work, low + i, Load(
            -c * nx, -c * ny, -c * nz,
            d * (1.0 - x * x) + g * nx * nx, g * nx * ny - d * x * y, g * nx * nz - d * x * z,
            d * (1.0 - y * y) + g * ny * ny, g * ny * nz - d * y * z,
            d * (1.0 - z * z) + g * nz * nz,
        ))  # fmt: skip


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


# Rows that are carried: ⟨n⟩, n of the last step (x, y, z each), ⟨|n|²⟩, ⟨|dn/dt|²⟩, the factor
# less 1, and whether there was a step yet.
MEAN, LAST, SQUARE, RATE2, MORE, BEGUN = 0, 3, 6, 7, 8, 9
OSCILLATION_CARRIED = 10
ACTS = 3 * OSCILLATION_CARRIED + 1  # the factor less 1 that acts in a stage
OWN_ROWS = 1
HARDLY2 = 1e-6  # (m/s)²: ε


class OscillatingDrag(NamedTuple):
    """Kernel data of drag by Keulegan-Carpenter number."""

    memory: Floats  # see MEAN and the rows after it, (rows, nodes)
    kn: float  # ½·ρ·Cdn [kg/m³]
    kt: float  # ½·ρ·Cdt [kg/m³]
    number: Floats  # Keulegan-Carpenter numbers, ascending, (rows,)
    factor: Floats  # factor on kn at these
    window: float  # τ [s]


def oscillating_drag(
    kn: float, kt: float, number: Floats, factor: Floats, window_s: float, room: int
) -> OscillatingDrag:
    """Return the kernel data of a rope that has not moved yet."""
    memory = new_memory(OSCILLATION_CARRIED, OWN_ROWS, room)
    return OscillatingDrag(memory, float(kn), float(kt), number, factor, float(window_s))


declare_internal_variables(OscillatingDrag, OSCILLATION_CARRIED)


@jit_within
def keulegan_carpenter(mean2: Any, square: Any, rate2: Any, d: Any, window: Any) -> Any:
    """Return KC from |⟨n⟩|², ⟨|n|²⟩ [m²/s²], ⟨|dn/dt|²⟩ [m²/s⁴], diameter [m] and τ [s]."""
    var = max(square - mean2, 0.0)
    period = 2.0 * pi * sqrt((var + HARDLY2) / (rate2 + HARDLY2 / (window * window)))
    return (sqrt(mean2) + sqrt(2.0 * var)) * period / d


@kernel("start", OscillatingDrag)
def start_oscillation(drag: Any, rope: Any, upto: int) -> None:
    """Begin without a past, by the factor of a steady flow."""
    memory, steady = drag.memory, drag.factor[drag.factor.shape[0] - 1] - 1.0
    for i in range(memory.shape[1] - 1):
        for k in range(OSCILLATION_CARRIED):
            memory[k, i] = 0.0
        memory[MORE, i] = memory[ACTS, i] = steady


@kernel("predict", OscillatingDrag, wide=True)
def predict_oscillation(drag: Any, rope: Any, stage: Any, kind: int, low: int, high: int) -> None:
    """Set the factor that acts; before time 0 that of a steady flow."""
    memory, steady = drag.memory, drag.factor[drag.factor.shape[0] - 1] - 1.0
    acts, more = memory[ACTS, low:], memory[MORE, low:]
    moves = stage.time > 0.0
    for i in range(high - low):
        acts[i] = more[i] if moves else steady


@kernel("load_nodes", OscillatingDrag, wide=True)
def load_oscillation(drag: Any, work: Any, stage: Any, low: int, high: int) -> None:
    """Add (factor - 1) times the drag across the rope, and its block."""
    add_more_drag(drag.kn, drag.memory[ACTS, low:], work, stage, low, high)


@kernel("settle", OscillatingDrag, wide=True)
def settle_oscillation(drag: Any, rope: Any, stage: Any, kind: int, upto: int) -> None:
    """Let the means fade and take in the motion at the end of a step; set the next factor."""
    memory, work = drag.memory, rope.work
    if kind == TRAPEZOID:
        for k in range(OSCILLATION_CARRIED):
            for i in range(upto):
                memory[OSCILLATION_CARRIED + k, i] = memory[k, i]
    if kind != BDF2:
        return
    h = 2.0 * stage.q / GAMMA
    kept = exp(-h / drag.window)
    vx, vy, vz = rows(work, VELOCITY, 0)
    ux, uy, uz = rows(work, FLOW, 0)
    tx, ty, tz = rows(work, TANGENT, 0)
    volume, length = row(work, VOLUME, 0), row(work, LENGTH, 0)
    for i in range(upto):
        x, y, z = tx[i], ty[i], tz[i]
        nx, ny, nz = vx[i] - ux[i], vy[i] - uy[i], vz[i] - uz[i]
        along = nx * x + ny * y + nz * z
        nx, ny, nz = nx - along * x, ny - along * y, nz - along * z
        # the first step has no past: its motion is the mean so far
        first = memory[BEGUN, i] < 0.5
        old = choose(first, 0.0, kept)
        rx, ry, rz = nx - memory[LAST, i], ny - memory[LAST + 1, i], nz - memory[LAST + 2, i]
        rate2 = choose(first, 0.0, (rx * rx + ry * ry + rz * rz) / (h * h))
        mx = old * memory[MEAN, i] + (1.0 - old) * nx
        my = old * memory[MEAN + 1, i] + (1.0 - old) * ny
        mz = old * memory[MEAN + 2, i] + (1.0 - old) * nz
        square = old * memory[SQUARE, i] + (1.0 - old) * (nx * nx + ny * ny + nz * nz)
        rate2 = old * memory[RATE2, i] + (1.0 - old) * rate2
        d = sqrt(4.0 / pi * volume[i] / (length[i] + DIVISOR_MIN)) + DIVISOR_MIN
        number = keulegan_carpenter(mx * mx + my * my + mz * mz, square, rate2, d, drag.window)
        memory[OSCILLATION_CARRIED + MEAN, i] = mx
        memory[OSCILLATION_CARRIED + MEAN + 1, i] = my
        memory[OSCILLATION_CARRIED + MEAN + 2, i] = mz
        memory[OSCILLATION_CARRIED + LAST, i] = nx
        memory[OSCILLATION_CARRIED + LAST + 1, i] = ny
        memory[OSCILLATION_CARRIED + LAST + 2, i] = nz
        memory[OSCILLATION_CARRIED + SQUARE, i] = square
        memory[OSCILLATION_CARRIED + RATE2, i] = rate2
        memory[OSCILLATION_CARRIED + MORE, i] = interpolate(drag.number, drag.factor, number) - 1.0
        memory[OSCILLATION_CARRIED + BEGUN, i] = 1.0
    more = memory[OSCILLATION_CARRIED + MORE, upto - 1]
    set_trials(memory, ACTS, renewed(stage, more, memory[ACTS, rope.state.s.shape[0] - 1]), rope)


@account("power", OscillatingDrag)
def oscillation_power(drag: Any, place: Any) -> Any:
    """Return force times velocity of all of the drag [W]; the hang-off's factor is its neighbour's.

    The factor is the mean of those of the steps before and after this border.
    """
    n = place.position.shape[1]
    factor = 1.0 + 0.5 * (drag.memory[ACTS, :n] + drag.memory[MORE, :n])
    if n > count_initialised(drag) > 0:
        factor[-1] = factor[-2]
    u = place.velocity - place.flow
    s = (u * place.tangent).sum(axis=0)
    along = s * place.tangent
    across = u - along
    cn = factor * drag.kn * place.frontal * np.sqrt((across * across).sum(axis=0))
    ct = drag.kt * place.skin * np.abs(s)
    return -((cn * across + ct * along) * place.velocity).sum(axis=0)
