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
from rope_twin.core.hooks import kernel
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
from rope_twin.core.trial import TRIALS
from rope_twin.quantity import quantity, text

CARRIED = 6  # q, q', q'' and the mean tangent
# Rows of its own: prediction of q and q', guess of q'', ω_s, ε·ω_s, (A/D)·D_a (three), and the
# strength of the lift, ½·ρ·D·l·C_L0/2 [kg/m].
HAT, RATE_HAT, GUESS, OMEGA, DAMPING, COUPLING = range(3 * CARRIED + 1, 3 * CARRIED + 7)
STRENGTH = COUPLING + 3
OWN_ROWS = STRENGTH - 3 * CARRIED
# Newton on the cubic: from the last q'' two steps leave 1e-5 of it where ω_s·h is 1, and ever less;
# from there one more serves for the solved stage.
FIRST, LAST = 2, 1
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
    length, rest = memory[STRENGTH], work[REST]
    for i in range(max(low, 1), high):
        length[i] = 0.5 * (rest[i] + rest[i - 1])
    if low == 0:
        length[0] = 0.5 * rest[0]
    q0, rate0, pull0 = memory[0], memory[1], memory[2]
    mx, my, mz = memory[3], memory[4], memory[5]
    hat, rate_hat, guess, omega = memory[HAT], memory[RATE_HAT], memory[GUESS], memory[OMEGA]
    damping = memory[DAMPING]
    bx, by, bz = memory[COUPLING], memory[COUPLING + 1], memory[COUPLING + 2]
    volume = work[VOLUME]
    u, v, w = work[FLOW], work[FLOW + 1], work[FLOW + 2]
    for i in range(low, high):
        per_diameter = sqrt(0.25 * pi * length[i] / (volume[i] + 1e-300))
        water, tangent = (u[i], v[i], w[i]), (mx[i], my[i], mz[i])
        across, speed, A, epsilon = _shed(wake, water, tangent)
        omega[i] = 2.0 * pi * wake.strouhal * speed * per_diameter
        damping[i] = epsilon * omega[i]
        length[i] *= wake.strength / per_diameter
        scale = A * per_diameter / (speed + 1e-9)
        bx[i], by[i], bz[i] = scale * across[0], scale * across[1], scale * across[2]
    if kind == TRAPEZOID:
        for i in range(low, high):
            # the start, where the water was not known yet
            new = q0[i] == 0.0 and pull0[i] == 0.0
            guess[i] = damping[i] * rate0[i] if new else pull0[i]
            rate_hat[i] = rate0[i] + c * guess[i]
            hat[i] = q0[i] + c * (rate0[i] + rate_hat[i])
        return
    q1, rate1, pull1 = memory[CARRIED], memory[CARRIED + 1], memory[CARRIED + 2]
    for i in range(low, high):
        rate_hat[i] = K1 * rate1[i] - K2 * rate0[i]
        hat[i] = K1 * q1[i] - K2 * q0[i] + c * rate_hat[i]
        guess[i] = pull1[i]


@jit_within
def _solve(stage: Any, count: int, start: Any, figures: Any, drive: Any) -> Any:
    """q, q'' and the slope of the equation over q''.

    start: prediction of q and q', and a guess of q''; figures: ω_s and ε·ω_s.
    """
    p, c = stage.p, stage.q
    hat, rate_hat, w = start
    omega, damping = figures
    slope = 1.0
    for _ in range(count):
        q, rate = hat + p * w, rate_hat + c * w
        miss = w + damping * (q * q - 1.0) * rate + omega * omega * q - drive
        slope = 1.0 + damping * ((q * q - 1.0) * c + 2.0 * q * rate * p) + omega * omega * p
        w -= miss / slope
    return hat + p * w, w, slope


@kernel("load_nodes", WakeOscillator)
def load_nodes(wake: Any, work: Any, stage: Any, low: int, high: int) -> None:
    """F = k·q·|U × t|·(U × t), k = ½·ρ·D·l·C_L0/2; A = -k·|U × t|·(dq/da)·(U × t) ⊗ D_a and
    q_w·k·q·(U × t) ⊗ U_N/|U_N|, their symmetric parts (q_w: the stage's weight of v).
    """
    memory = wake.memory
    hat, rate_hat, guess = memory[HAT, low:], memory[RATE_HAT, low:], memory[GUESS, low:]
    omega, damping, strength = memory[OMEGA, low:], memory[DAMPING, low:], memory[STRENGTH, low:]
    bx, by = memory[COUPLING, low:], memory[COUPLING + 1, low:]
    bz = memory[COUPLING + 2, low:]
    vx, vy, vz = rows(work, VELOCITY, low)
    ax, ay, az = rows(work, ACCELERATION, low)
    ux, uy, uz = rows(work, FLOW, low)
    tx, ty, tz = rows(work, TANGENT, low)
    Rx, Ry, Rz = rows(work, RESIDUAL, low)
    Axx, Axy, Axz, Ayy, Ayz, Azz = span(work, BLOCK, 6, low)
    for i in range(high - low):
        drive = bx[i] * ax[i] + by[i] * ay[i] + bz[i] * az[i]
        q, pull, slope = _solve(
            stage, FIRST, (hat[i], rate_hat[i], guess[i]), (omega[i], damping[i]), drive
        )
        guess[i] = pull
        x, y, z = tx[i], ty[i], tz[i]
        u, v, w = ux[i] - vx[i], uy[i] - vy[i], uz[i] - vz[i]
        along = u * x + v * y + w * z
        u, v, w = u - along * x, v - along * y, w - along * z
        lx, ly, lz = v * z - w * y, w * x - u * z, u * y - v * x
        speed = sqrt(u * u + v * v + w * w + 1e-20)
        k = strength[i]
        size = k * q * speed
        Rx[i] += size * lx
        Ry[i] += size * ly
        Rz[i] += size * lz
        g, h = -0.5 * k * speed * stage.p / slope, 0.5 * stage.q * k * q / speed
        cx, cy, cz = g * bx[i] + h * u, g * by[i] + h * v, g * bz[i] + h * w
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
    hat, rate_hat, guess = memory[HAT], memory[RATE_HAT], memory[GUESS]
    omega, damping = memory[OMEGA], memory[DAMPING]
    bx, by, bz = memory[COUPLING], memory[COUPLING + 1], memory[COUPLING + 2]
    q1, rate1, pull1 = memory[CARRIED], memory[CARRIED + 1], memory[CARRIED + 2]
    ax, ay, az = work[ACCELERATION], work[ACCELERATION + 1], work[ACCELERATION + 2]
    for i in range(n):
        drive = bx[i] * ax[i] + by[i] * ay[i] + bz[i] * az[i]
        q, w, _ = _solve(
            stage, LAST, (hat[i], rate_hat[i], guess[i]), (omega[i], damping[i]), drive
        )
        q1[i], rate1[i], pull1[i] = q, rate_hat[i] + stage.q * w, w
    if kind == BDF2:
        share = 1.0 - exp(-2.0 * stage.q / (GAMMA * wake.shape_over))
        for k in range(3, CARRIED):
            mean, kept, tangent = memory[k], memory[CARRIED + k], work[TANGENT + k - 3]
            for i in range(n):
                kept[i] = mean[i] + share * (tangent[i] - mean[i])
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
