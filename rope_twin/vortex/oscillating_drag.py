"""Drag of the rope by its Keulegan-Carpenter number and roughness, from the user's own tables.

In an oscillating flow the drag coefficient is not that of a steady one: it depends on KC = U_m·T/d
and on the roughness k/d of the surface (Keulegan and Carpenter 1958, J. Res. NBS 60, 423; Sarpkaya
1976, OTC 2533). The rope has one roughness; between tables of two the factor is linear in its
logarithm.

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

from math import exp, pi, sqrt
from typing import Any, NamedTuple

import numpy as np

from rope_twin.core.energy import account
from rope_twin.core.integrator import BDF2, GAMMA, TRAPEZOID
from rope_twin.core.jit.decorators import jit_within
from rope_twin.core.jit.rows import row, rows
from rope_twin.core.loads.hooks import kernel
from rope_twin.core.loads.memory import count_known, new_memory, remembering
from rope_twin.core.payout import set_trials
from rope_twin.core.state import (
    DIVISOR_MIN,
    FLOW,
    LENGTH,
    TANGENT,
    VELOCITY,
    VOLUME,
    Floats,
)
from rope_twin.vortex.drag_amplification import add_more_drag

# Rows that are carried: ⟨n⟩, n of the last step (x, y, z each), ⟨|n|²⟩, ⟨|dn/dt|²⟩, the factor
# less 1, and whether there was a step yet.
MEAN, LAST, SQUARE, RATE2, MORE, BEGUN = 0, 3, 6, 7, 8, 9
CARRIED = 10
ACTS = 3 * CARRIED + 1  # the factor less 1 that acts in a stage
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
    memory = new_memory(CARRIED, OWN_ROWS, room)
    return OscillatingDrag(memory, float(kn), float(kt), number, factor, float(window_s))


remembering(OscillatingDrag, CARRIED)


@jit_within
def keulegan_carpenter(mean2: float, square: float, rate2: float, d: float, window: float) -> float:
    """Return KC from |⟨n⟩|², ⟨|n|²⟩ [m²/s²], ⟨|dn/dt|²⟩ [m²/s⁴], diameter [m] and τ [s]."""
    var = max(square - mean2, 0.0)
    period = 2.0 * pi * sqrt((var + HARDLY2) / (rate2 + HARDLY2 / (window * window)))
    return (sqrt(mean2) + sqrt(2.0 * var)) * period / d


@jit_within
def factor_at(known: Any, factor: Any, number: float) -> Any:
    """Return the factor at a Keulegan-Carpenter number; constant beyond the table."""
    last = known.shape[0] - 1
    i = 0
    while i < last - 1 and known[i + 1] < number:
        i += 1
    if last == 0:
        return factor[0]
    share = (number - known[i]) / (known[i + 1] - known[i])
    return factor[i] + min(max(share, 0.0), 1.0) * (factor[i + 1] - factor[i])


@kernel("start", OscillatingDrag)
def start(drag: Any, rope: Any, upto: int) -> None:
    """Begin without a past, by the factor of a steady flow."""
    memory, steady = drag.memory, drag.factor[drag.factor.shape[0] - 1] - 1.0
    for i in range(memory.shape[1] - 1):
        for k in range(CARRIED):
            memory[k, i] = 0.0
        memory[MORE, i] = memory[ACTS, i] = steady


@kernel("predict", OscillatingDrag)
def predict(drag: Any, rope: Any, stage: Any, kind: int, low: int, high: int) -> None:
    """Set the factor that acts; before time 0 that of a steady flow."""
    memory, steady = drag.memory, drag.factor[drag.factor.shape[0] - 1] - 1.0
    acts, more = memory[ACTS, low:], memory[MORE, low:]
    moves = stage.time > 0.0
    for i in range(high - low):
        acts[i] = more[i] if moves else steady


@kernel("load_nodes", OscillatingDrag)
def load_nodes(drag: Any, work: Any, stage: Any, low: int, high: int) -> None:
    """Add (factor - 1) times the drag across the rope, and its block."""
    add_more_drag(drag.kn, drag.memory[ACTS, low:], work, stage, low, high)


@kernel("settle", OscillatingDrag)
def settle(drag: Any, rope: Any, stage: Any, kind: int, upto: int) -> None:
    """Let the means fade and take in the motion at the end of a step; set the next factor."""
    memory, work = drag.memory, rope.work
    if kind == TRAPEZOID:
        for k in range(CARRIED):
            for i in range(upto):
                memory[CARRIED + k, i] = memory[k, i]
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
        old = 0.0 if first else kept
        rx, ry, rz = nx - memory[LAST, i], ny - memory[LAST + 1, i], nz - memory[LAST + 2, i]
        rate2 = 0.0 if first else (rx * rx + ry * ry + rz * rz) / (h * h)
        mx = old * memory[MEAN, i] + (1.0 - old) * nx
        my = old * memory[MEAN + 1, i] + (1.0 - old) * ny
        mz = old * memory[MEAN + 2, i] + (1.0 - old) * nz
        square = old * memory[SQUARE, i] + (1.0 - old) * (nx * nx + ny * ny + nz * nz)
        rate2 = old * memory[RATE2, i] + (1.0 - old) * rate2
        d = sqrt(4.0 / pi * volume[i] / (length[i] + DIVISOR_MIN)) + DIVISOR_MIN
        number = keulegan_carpenter(mx * mx + my * my + mz * mz, square, rate2, d, drag.window)
        memory[CARRIED + MEAN, i] = mx
        memory[CARRIED + MEAN + 1, i] = my
        memory[CARRIED + MEAN + 2, i] = mz
        memory[CARRIED + LAST, i] = nx
        memory[CARRIED + LAST + 1, i] = ny
        memory[CARRIED + LAST + 2, i] = nz
        memory[CARRIED + SQUARE, i] = square
        memory[CARRIED + RATE2, i] = rate2
        memory[CARRIED + MORE, i] = factor_at(drag.number, drag.factor, number) - 1.0
        memory[CARRIED + BEGUN, i] = 1.0
    set_trials(memory, ACTS, memory[CARRIED + MORE, upto - 1], rope)


@account("power", OscillatingDrag)
def power(drag: Any, place: Any) -> Any:
    """Return force times velocity of all of the drag [W]; the hang-off's factor is its neighbour's.

    The factor is the mean of those of the steps before and after this border.
    """
    n = place.position.shape[1]
    factor = 1.0 + 0.5 * (drag.memory[ACTS, :n] + drag.memory[MORE, :n])
    if n > count_known(drag) > 0:
        factor[-1] = factor[-2]
    u = place.velocity - place.flow
    s = (u * place.tangent).sum(axis=0)
    along = s * place.tangent
    across = u - along
    cn = factor * drag.kn * place.frontal * np.sqrt((across * across).sum(axis=0))
    ct = drag.kt * place.skin * np.abs(s)
    return -((cn * across + ct * along) * place.velocity).sum(axis=0)
