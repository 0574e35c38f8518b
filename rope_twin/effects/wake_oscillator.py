"""Wake oscillator: vortices as a van der Pol oscillator at every node, driven by its acceleration.

[QM] Qu and Metrikine, Time domain simulation of VIV of a curved beam, eqs 15-17 and 24-29. With the
water's velocity V across the rope at rest (V_N) and U across the rope as it moves (U_N):

    q'' + ε·ω_s·(q² - 1)·q' + ω_s²·q = (A/D)·x''·D_a,    ω_s = 2π·St·|V_N|/D
    lift per metre = ½·ρ·D·(C_L0/2)·q·|U_N|²·D_L
    D_L = U_N × t/|U_N × t|,  D_a = V_N × t_s/|V_N × t_s|

t is the rope's tangent and t_s that of its shape without the vibration: the mean of t over
`shape_over_s`, which starts as the static shape and follows payout and current. (A, ε) are those of
an upright rope where it is inclined by less than 45° to the normal of the flow, others above. Drag
as printed, ½·ρ·D·C_D·|U_N|·U_N with C_D 1.2, is what the effect `drag` brings.

q is solved at each node inside the stage (TR-BDF2 like the rope): for the node's acceleration the
scalar equation is a cubic, solved by Newton, and its derivative goes to the node's block. Dropped
there: what is not symmetric, and the tangent's change with position.

Named sets: `qu_metrikine` [QM]; `facchinetti` (Facchinetti, de Langre and Biolley 2004, J. Fluids
Struct. 19, 123: A 12, ε 0.3, acceleration coupling; their stall term γ = C_D/(4π·St) = 0.8 is that
of `drag: {normal: 2.0}`); `ogink_metrikine` (2010, J. Sound Vib. 329, 5452, upper branch).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import exp, pi, sin, sqrt
from typing import Any, NamedTuple

import numpy as np

from rope_twin.core.energy import account
from rope_twin.core.jit import jit, jit_within
from rope_twin.core.prediction import GAMMA, K1, K2
from rope_twin.core.remembering import new_memory, remembering
from rope_twin.core.rows import rows, span
from rope_twin.core.stage import BDF2, TRAPEZOID
from rope_twin.core.state import (
    ACCELERATION,
    BLOCK,
    ELEMENTS,
    FLOW,
    POSITION,
    RESIDUAL,
    REST,
    TANGENT,
    VELOCITY,
    VOLUME,
    Floats,
)
from rope_twin.core.terms import kernel
from rope_twin.core.trial import TRIALS
from rope_twin.quantity import quantity, text

CARRIED = 6  # q, q', q'' and the mean tangent
# Rows of its own: prediction of q and q', guess of q'', ω_s, ε·ω_s, (A/D)·D_a (three), and the
# strength of the lift, ½·ρ·D·l·C_L0/2 [kg/m].
HAT, RATE_HAT, GUESS, OMEGA, DAMPING, COUPLING = range(3 * CARRIED + 1, 3 * CARRIED + 7)
STRENGTH = COUPLING + 3
OWN_ROWS = STRENGTH - 3 * CARRIED
NEWTON = 4  # of the cubic, from the last q'': leaves round-off where ω_s·h is below 1
WAVES = 24  # half waves along the rope that the first rate of q is made of
GOLDEN = 2.399963  # rad, between their phases
INCLINED = sqrt(0.5)  # sine of 45°


class _Set(NamedTuple):
    """Published figures of one model."""

    strouhal: float
    lift: float  # C_L0
    upright: tuple[float, float]  # A, ε
    inclined: tuple[float, float]


SETS = {
    "qu_metrikine": _Set(0.17, 0.3842, (4.0, 0.05), (1.0, 0.1)),
    "facchinetti": _Set(0.2, 0.3, (12.0, 0.3), (12.0, 0.3)),
    "ogink_metrikine": _Set(0.1932, 0.3842, (4.0, 0.05), (4.0, 0.05)),
}


@dataclass(frozen=True, kw_only=True)
class WakeOscillatorParams:
    """A published set by its name; what is given besides takes the place of its figure."""

    set: str = text("qu_metrikine, facchinetti or ogink_metrikine", "qu_metrikine")
    strouhal: float | None = quantity("Strouhal number St", "", 0.05, 0.5, default=None)
    lift: float | None = quantity("lift coefficient C_L0 at rest", "", 0.0, 2.0, default=None)
    upright: tuple[float, float] | None = quantity(
        "A and ε where the rope is inclined by less than 45°", "", 0.0, 100.0, default=None
    )
    inclined: tuple[float, float] | None = quantity(
        "A and ε where it is inclined by more", "", 0.0, 100.0, default=None
    )
    start_per_s: float = quantity("first rate of q, smooth noise", "1/s", 0.0, 100.0, default=1.0)
    shape_over_s: float = quantity(
        "time over which the shape without the vibration is the mean", "s", 0.1, 1e4, default=10.0
    )

    def check(self) -> str | None:
        """A known set; damping that leaves the oscillator one."""
        if self.set not in SETS:
            return f"there is no set '{self.set}'; known: {', '.join(SETS)}"
        for pair in (self.upright, self.inclined):
            if pair is not None and not 0.0 < pair[1] < 1.5:
                return f"ε of {pair[1]:g}; give more than 0 and less than 1.5"
        return None

    @property
    def strouhal_number(self) -> float:
        """What sets the pace of the vortices."""
        return self.figures.strouhal

    @property
    def figures(self) -> _Set:
        """The set with what is given in its place."""
        given = {name: getattr(self, name) for name in _Set._fields}
        kept = {name: value for name, value in given.items() if value is not None}
        return SETS[self.set]._replace(**kept)


class WakeOscillator(NamedTuple):
    """What the kernels see."""

    memory: Floats  # see CARRIED and the rows after it, (rows, nodes)
    strouhal: float
    strength: float  # ½·ρ·C_L0/2 [kg/m³]
    A: float
    epsilon: float
    A_inclined: float
    epsilon_inclined: float
    start: float  # [1/s]
    shape_over: float  # [s]


def build(params: WakeOscillatorParams, payload: Any, around: Any) -> WakeOscillator:
    """From the set and the water."""
    figures = params.figures
    (A, epsilon), (A_inclined, epsilon_inclined) = figures.upright, figures.inclined
    return WakeOscillator(
        memory=new_memory(CARRIED, OWN_ROWS, around.room),
        strouhal=float(figures.strouhal),
        strength=float(0.25 * around.water_density_kg_per_m3 * figures.lift),
        A=float(A),
        epsilon=float(epsilon),
        A_inclined=float(A_inclined),
        epsilon_inclined=float(epsilon_inclined),
        start=float(params.start_per_s),
        shape_over=float(params.shape_over_s),
    )


remembering(WakeOscillator, CARRIED)


@kernel("start", WakeOscillator)
def start(wake: Any, rope: Any) -> None:
    """q = 0, so that no lift acts on the rope at rest; q' of smooth noise; t_s the rope's tangent.

    The noise is of half waves along the rope, so that finer elements start from the same.
    """
    n, s, nodes, memory = rope.state.counts[ELEMENTS], rope.state.s, rope.state.nodes, wake.memory
    for i in range(n):
        rate = 0.0
        for j in range(1, WAVES + 1):
            rate += sin(pi * j * s[i] / s[n] + GOLDEN * j * j)
        low = max(i - 1, 0)
        x = nodes[POSITION, i + 1] - nodes[POSITION, low]
        y = nodes[POSITION + 1, i + 1] - nodes[POSITION + 1, low]
        z = nodes[POSITION + 2, i + 1] - nodes[POSITION + 2, low]
        inverse = 1.0 / sqrt(x * x + y * y + z * z + 1e-300)
        memory[0, i], memory[2, i] = 0.0, 0.0
        memory[1, i] = wake.start * sqrt(2.0 / WAVES) * rate
        memory[3, i], memory[4, i], memory[5, i] = inverse * x, inverse * y, inverse * z


@jit_within
def _shed(wake: Any, water: Any, tangent: Any) -> Any:
    """Vector V × t_s, its size |V_N|, A and ε at a node whose shape without vibration is t_s."""
    u, v, w = water
    x, y, z = tangent
    cx, cy, cz = v * z - w * y, w * x - u * z, u * y - v * x
    speed = sqrt(cx * cx + cy * cy + cz * cz)
    along = u * x + v * y + w * z
    upright = along * along < INCLINED * INCLINED * (u * u + v * v + w * w)
    A = wake.A if upright else wake.A_inclined
    epsilon = wake.epsilon if upright else wake.epsilon_inclined
    return (cx, cy, cz), speed, A, epsilon


@kernel("predict", WakeOscillator)
def predict(wake: Any, rope: Any, stage: Any, kind: int, low: int, high: int) -> None:
    """What a stage starts from, as of the rope; and what stays while it is solved."""
    memory, work, c = wake.memory, rope.work, stage.q
    for i in range(low, high):
        length = 0.5 * (work[REST, i] + work[REST, i - 1]) if i > 0 else 0.5 * work[REST, i]
        per_diameter = sqrt(0.25 * pi * length / (work[VOLUME, i] + 1e-300))
        water = (work[FLOW, i], work[FLOW + 1, i], work[FLOW + 2, i])
        across, speed, A, epsilon = _shed(wake, water, (memory[3, i], memory[4, i], memory[5, i]))
        omega = 2.0 * pi * wake.strouhal * speed * per_diameter
        q0, d0, guess = memory[0, i], memory[1, i], memory[2, i]
        if q0 == 0.0 and guess == 0.0:  # the start, where the water was not known yet
            guess = epsilon * omega * d0
        if kind == TRAPEZOID:
            rate_hat = d0 + c * guess
            memory[HAT, i] = q0 + c * (d0 + rate_hat)
        else:
            rate_hat = K1 * memory[CARRIED + 1, i] - K2 * d0
            memory[HAT, i] = K1 * memory[CARRIED, i] - K2 * q0 + c * rate_hat
            guess = memory[CARRIED + 2, i]
        memory[RATE_HAT, i], memory[GUESS, i] = rate_hat, guess
        memory[OMEGA, i], memory[DAMPING, i] = omega, epsilon * omega
        scale = A * per_diameter / (speed + 1e-9)
        memory[COUPLING, i] = scale * across[0]
        memory[COUPLING + 1, i] = scale * across[1]
        memory[COUPLING + 2, i] = scale * across[2]
        memory[STRENGTH, i] = wake.strength * length / per_diameter


@jit_within
def _solve(wake: Any, stage: Any, i: int, acceleration: Any) -> Any:
    """q and q'' at a node that accelerates so, and the slope of its equation over q''."""
    memory, p, c = wake.memory, stage.p, stage.q
    hat, rate_hat, w = memory[HAT, i], memory[RATE_HAT, i], memory[GUESS, i]
    damping, square = memory[DAMPING, i], memory[OMEGA, i] * memory[OMEGA, i]
    ax, ay, az = acceleration
    drive = memory[COUPLING, i] * ax + memory[COUPLING + 1, i] * ay + memory[COUPLING + 2, i] * az
    slope = 1.0
    for _ in range(NEWTON):
        q, rate = hat + p * w, rate_hat + c * w
        miss = w + damping * (q * q - 1.0) * rate + square * q - drive
        slope = 1.0 + damping * ((q * q - 1.0) * c + 2.0 * q * rate * p) + square * p
        w -= miss / slope
    return hat + p * w, w, slope


@kernel("load_nodes", WakeOscillator)
def load_nodes(wake: Any, work: Any, stage: Any, low: int, high: int) -> None:
    """F = k·q·|U × t|·(U × t), k = ½·ρ·D·l·C_L0/2; A = -k·|U × t|·(dq/da)·(U × t) ⊗ D_a and
    q_w·k·q·(U × t) ⊗ U_N/|U_N|, their symmetric parts (q_w: the stage's weight of v).
    """
    memory = wake.memory
    vx, vy, vz = rows(work, VELOCITY, low)
    ax, ay, az = rows(work, ACCELERATION, low)
    ux, uy, uz = rows(work, FLOW, low)
    tx, ty, tz = rows(work, TANGENT, low)
    Rx, Ry, Rz = rows(work, RESIDUAL, low)
    Axx, Axy, Axz, Ayy, Ayz, Azz = span(work, BLOCK, 6, low)
    for i in range(high - low):
        q, _, slope = _solve(wake, stage, low + i, (ax[i], ay[i], az[i]))
        bx, by, bz = (
            memory[COUPLING, low + i],
            memory[COUPLING + 1, low + i],
            memory[COUPLING + 2, low + i],
        )
        x, y, z = tx[i], ty[i], tz[i]
        u, v, w = ux[i] - vx[i], uy[i] - vy[i], uz[i] - vz[i]
        along = u * x + v * y + w * z
        u, v, w = u - along * x, v - along * y, w - along * z
        lx, ly, lz = v * z - w * y, w * x - u * z, u * y - v * x
        speed = sqrt(u * u + v * v + w * w + 1e-20)
        k = memory[STRENGTH, low + i]
        size = k * q * speed
        Rx[i] += size * lx
        Ry[i] += size * ly
        Rz[i] += size * lz
        g, h = -0.5 * k * speed * stage.p / slope, 0.5 * stage.q * k * q / speed
        cx, cy, cz = g * bx + h * u, g * by + h * v, g * bz + h * w
        Axx[i] += 2.0 * lx * cx
        Axy[i] += lx * cy + ly * cx
        Axz[i] += lx * cz + lz * cx
        Ayy[i] += 2.0 * ly * cy
        Ayz[i] += ly * cz + lz * cy
        Azz[i] += 2.0 * lz * cz


@kernel("settle", WakeOscillator)
def settle(wake: Any, rope: Any, stage: Any, kind: int) -> None:
    """q, q' and q'' of the solved stage; the mean tangent follows once a step."""
    memory, work, n = wake.memory, rope.work, rope.state.counts[ELEMENTS]
    share = 1.0 - exp(-2.0 * stage.q / (GAMMA * wake.shape_over)) if kind == BDF2 else 0.0
    for i in range(n):
        a = (work[ACCELERATION, i], work[ACCELERATION + 1, i], work[ACCELERATION + 2, i])
        q, w, _ = _solve(wake, stage, i, a)
        memory[CARRIED, i], memory[CARRIED + 2, i] = q, w
        memory[CARRIED + 1, i] = memory[RATE_HAT, i] + stage.q * w
        for k in range(3):
            mean = memory[3 + k, i]
            memory[CARRIED + 3 + k, i] = mean + share * (work[TANGENT + k, i] - mean)
    _set_trials(wake, rope, stage)


@jit
def _set_trials(wake: Any, rope: Any, stage: Any) -> None:
    """The wake of the trial nodes is that of the highest free node, per metre, and stays."""
    memory, top = wake.memory, rope.state.counts[ELEMENTS] - 1
    slots = rope.state.s.shape[0]
    length = 0.5 * (rope.work[REST, top] + rope.work[REST, top - 1])
    for slot in range(slots - TRIALS, slots):
        for k in range(HAT, STRENGTH):
            memory[k, slot] = 0.0
        memory[HAT, slot] = memory[CARRIED, top]
        memory[STRENGTH, slot] = memory[STRENGTH, top] / length


@account("power", WakeOscillator)
def power(wake: Any, place: Any) -> Any:
    """Lift times velocity [W]; the hang-off's wake is that of the node below."""
    n = place.position.shape[1]
    q = wake.memory[0, :n].copy()
    if n > 1:
        q[-1] = q[-2]
    length = np.zeros(n)
    half = 0.5 * np.diff(place.arc)
    length[:-1] += half
    length[1:] += half
    k = wake.strength * np.sqrt(4.0 / pi * place.volume * length)
    u = place.flow - place.velocity
    across = np.cross(u, place.tangent, axis=0)
    size = k * q * np.sqrt((across * across).sum(axis=0))
    return size * (across * place.velocity).sum(axis=0)
