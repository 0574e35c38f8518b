"""Drag and added mass of the payload by its Keulegan-Carpenter number, from the user's own tables.

Both depend on how far the payload moves through the water in proportion to its size (Keulegan and
Carpenter 1958; DNV-RP-N103, ch. 3: mudmats, suction anchors, perforated plates). `payload` and
`waves` load it with the scene's constants. This effect adds, along each axis, (c_D - 1) times its
drag, -½·ρ·CdA·|u|·u_k, and (c_A - 1) times its added mass with the acceleration relative to the
water, with factors linear between the rows of a table over

    KC_k = (|⟨u⟩| + √2·σ)·T/L_k,

L_k the size that the table refers to; u is the velocity relative to the water, its vertical part
for z and its horizontal part for both x and y. σ, T and the means that fade are those of
vortex/drag_amplification: a regular motion has U·T/L exactly, 2π times amplitude over size. The
factors are constant over a step. At the start, and in static equilibrium, they are those of the
last row of drag and the first of added mass: a payload that has not moved yet.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from math import exp, sqrt
from typing import Any, NamedTuple

import numpy as np

from rope_twin.core.integrator import BDF2, GAMMA, TRAPEZOID
from rope_twin.core.jit.functions import interpolate
from rope_twin.core.jit.rows import rows
from rope_twin.core.jit.wide import choose
from rope_twin.core.loads.accounts import account
from rope_twin.core.loads.balance import add_to_node, end_relative
from rope_twin.core.loads.hooks import Load, kernel
from rope_twin.core.loads.memory import declare_internal_variables, new_memory
from rope_twin.core.state import ACCELERATION, FLOW, FLOW_RATE, SPEED2_MIN, VELOCITY, Floats
from rope_twin.quantity import quantity
from rope_twin.vortex.drag_amplification import keulegan_carpenter

# Rows that are carried, of column 0 and three each: ⟨u⟩, u of the last step, ⟨u²⟩, ⟨(du/dt)²⟩, the
# factors of drag and of added mass less 1; and whether there was a step yet.
MEAN, LAST, SQUARE, RATE2, DRAG, ADDED, BEGUN = 0, 3, 6, 9, 12, 15, 18
CARRIED = 19
ACTS = 3 * CARRIED + 1  # the six factors less 1 that act in a stage
OWN_ROWS = 6
Rows = tuple[tuple[float, float], ...]


@dataclass(frozen=True, kw_only=True)
class PayloadOscillationParams:
    """Tables of factors, and the size that their numbers refer to."""

    size_m: tuple[float, float, float] = quantity(
        "size L of the payload that KC = U·T/L refers to, for motion along x, y, z",
        "m",
        0.01,
        200.0,
    )
    drag: Rows = quantity(
        "rows of Keulegan-Carpenter number and factor on the drag area", "", 0.0, 1e6, default=()
    )
    added_mass: Rows = quantity(
        "rows of Keulegan-Carpenter number and factor on the added mass", "", 0.0, 1e6, default=()
    )
    window_s: float = quantity(
        "time constant of the means that the number is taken from", "s", 1.0, 3600.0, default=60.0
    )

    def check(self) -> str | None:
        """Return a fault of the tables, or None."""
        if not self.drag and not self.added_mass:
            return "neither drag nor added_mass; give rows [KC, factor] of one or both"
        for name, given in (("drag", self.drag), ("added_mass", self.added_mass)):
            if any(b[0] <= a[0] for a, b in itertools.pairwise(given)):
                return f"{name}: Keulegan-Carpenter numbers are not ascending; order the rows"
            if max((factor for _, factor in given), default=1.0) > 10.0:
                return f"{name}: a factor above 10; give factors on the payload's own figures"
        return None


class PayloadOscillation(NamedTuple):
    """Kernel data; the payload's figures are those of `payload`."""

    memory: Floats  # see MEAN and the rows after it; of column 0, (rows, nodes)
    drag_number: Floats  # Keulegan-Carpenter numbers, ascending, (rows,)
    drag_factor: Floats
    added_number: Floats
    added_factor: Floats
    window: float  # τ [s]
    Lx: float  # size [m]
    Ly: float
    Lz: float
    Ax: float  # added mass [kg]
    Ay: float
    Az: float
    kx: float  # ½·ρ·CdA [kg/m]
    ky: float
    kz: float


AT_END = ("Ax", "Ay", "Az", "kx", "ky", "kz")


def build(params: PayloadOscillationParams, payload: Any, environment: Any) -> PayloadOscillation:
    """Return the kernel data for the tables and the payload's added mass and drag."""
    unity = ((0.0, 1.0),)
    drag, added = (
        np.ascontiguousarray(np.array(rows or unity, dtype=float).T)
        for rows in (params.drag, params.added_mass)
    )
    A, k = [0.0] * 3, [0.0] * 3
    if payload is not None and environment.carries:
        A = [float(mass) for mass in payload.added_mass_kg]
        k = [
            0.5 * float(environment.water_density_kg_per_m3 * area) for area in payload.drag_area_m2
        ]
    size = [float(L) for L in params.size_m]
    memory = new_memory(CARRIED, OWN_ROWS, environment.room)
    return PayloadOscillation(
        memory, drag[0], drag[1], added[0], added[1], float(params.window_s), *size, *A, *k
    )


declare_internal_variables(PayloadOscillation, CARRIED)


@kernel("start", PayloadOscillation)
def start(oscillation: Any, rope: Any, upto: int) -> None:
    """Begin without a past."""
    memory = oscillation.memory
    steady, initial_added = (
        oscillation.drag_factor[oscillation.drag_factor.shape[0] - 1] - 1.0,
        oscillation.added_factor[0] - 1.0,
    )
    for k in range(CARRIED):
        memory[k, 0] = 0.0
    for k in range(3):
        memory[DRAG + k, 0] = memory[ACTS + k, 0] = steady
        memory[ADDED + k, 0] = memory[ACTS + 3 + k, 0] = initial_added


@kernel("predict", PayloadOscillation, wide=True)
def predict(oscillation: Any, rope: Any, stage: Any, kind: int, low: int, high: int) -> None:
    """Set the factors that act; before time 0 those of a payload that has not moved."""
    memory = oscillation.memory
    steady, initial_added = (
        oscillation.drag_factor[oscillation.drag_factor.shape[0] - 1] - 1.0,
        oscillation.added_factor[0] - 1.0,
    )
    moves = stage.time > 0.0
    for k in range(3):
        memory[ACTS + k, 0] = memory[DRAG + k, 0] if moves else steady
        memory[ACTS + 3 + k, 0] = memory[ADDED + k, 0] if moves else initial_added


@kernel("load_end", PayloadOscillation, wide=True)
def load_end(oscillation: Any, work: Any, stage: Any) -> None:
    """Add (c_A - 1)·A·(a_water - a) - (c_D - 1)·k·|u|·u to R_0, and the block, symmetric."""
    ax, ay, az = rows(work, ACCELERATION, 0)
    wx, wy, wz = rows(work, FLOW_RATE, 0)
    m = oscillation.memory
    kx, ky, kz = (
        m[ACTS, 0] * oscillation.kx,
        m[ACTS + 1, 0] * oscillation.ky,
        m[ACTS + 2, 0] * oscillation.kz,
    )
    mx, my, mz = (
        m[ACTS + 3, 0] * oscillation.Ax,
        m[ACTS + 4, 0] * oscillation.Ay,
        m[ACTS + 5, 0] * oscillation.Az,
    )
    x, y, z = end_relative(work)
    speed = sqrt(x * x + y * y + z * z + SPEED2_MIN)
    q, g = stage.q * speed, stage.q / speed
    add_to_node(work, 0, Load(
        mx * (wx[0] - ax[0]) - kx * speed * x, my * (wy[0] - ay[0]) - ky * speed * y,
        mz * (wz[0] - az[0]) - kz * speed * z,
        mx + q * kx + g * kx * x * x, 0.5 * g * (kx + ky) * x * y, 0.5 * g * (kx + kz) * x * z,
        my + q * ky + g * ky * y * y, 0.5 * g * (ky + kz) * y * z,
        mz + q * kz + g * kz * z * z,
    ))  # fmt: skip


@kernel("settle", PayloadOscillation, wide=True)
def settle(oscillation: Any, rope: Any, stage: Any, kind: int, upto: int) -> None:
    """Let the means fade and take in the motion at the end of a step; set the next factors."""
    memory, work = oscillation.memory, rope.work
    if kind == TRAPEZOID:
        for k in range(CARRIED):
            memory[CARRIED + k, 0] = memory[k, 0]
    if kind != BDF2:
        return
    h = 2.0 * stage.q / GAMMA
    first = memory[BEGUN, 0] < 0.5
    old = choose(first, 0.0, exp(-h / oscillation.window))
    for k in range(3):
        u = work[VELOCITY + k, 0] - work[FLOW + k, 0]
        rate = choose(first, 0.0, (u - memory[LAST + k, 0]) / h)
        memory[CARRIED + MEAN + k, 0] = old * memory[MEAN + k, 0] + (1.0 - old) * u
        memory[CARRIED + LAST + k, 0] = u
        memory[CARRIED + SQUARE + k, 0] = old * memory[SQUARE + k, 0] + (1.0 - old) * u * u
        memory[CARRIED + RATE2 + k, 0] = old * memory[RATE2 + k, 0] + (1.0 - old) * rate * rate
    mean, square, rate2 = CARRIED + MEAN, CARRIED + SQUARE, CARRIED + RATE2
    for k in range(3):
        size = oscillation.Lx if k == 0 else (oscillation.Ly if k == 1 else oscillation.Lz)
        mean2, all2 = memory[mean + 2, 0] * memory[mean + 2, 0], memory[square + 2, 0]
        fast2 = memory[rate2 + 2, 0]
        if k < 2:
            mean2 = memory[mean, 0] * memory[mean, 0] + memory[mean + 1, 0] * memory[mean + 1, 0]
            all2 = memory[square, 0] + memory[square + 1, 0]
            fast2 = memory[rate2, 0] + memory[rate2 + 1, 0]
        number = keulegan_carpenter(mean2, all2, fast2, size, oscillation.window)
        drag = interpolate(oscillation.drag_number, oscillation.drag_factor, number)
        added = interpolate(oscillation.added_number, oscillation.added_factor, number)
        memory[CARRIED + DRAG + k, 0], memory[CARRIED + ADDED + k, 0] = drag - 1.0, added - 1.0
    memory[CARRIED + BEGUN, 0] = 1.0


@account("power_end", PayloadOscillation)
def power(oscillation: Any, place: Any) -> Any:
    """Return the power of the loads beyond those of the constant figures [W].

    The factors are the means of those of the steps before and after this border.
    """
    more = 0.5 * (oscillation.memory[ACTS : ACTS + 6, :1] + oscillation.memory[DRAG : DRAG + 6, :1])
    k = more[:3] * np.array([[oscillation.kx], [oscillation.ky], [oscillation.kz]])
    m = more[3:] * np.array([[oscillation.Ax], [oscillation.Ay], [oscillation.Az]])
    u = place.velocity - place.flow
    force = m * (place.flow_rate - place.acceleration) - k * np.sqrt((u * u).sum(axis=0)) * u
    return (force * place.velocity).sum(axis=0)
