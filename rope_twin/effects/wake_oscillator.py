"""Wake oscillator: a van der Pol oscillator at every node, driven by its acceleration.

[QM] Qu and Metrikine, Time domain simulation of VIV of a curved beam, eqs 15-17 and 24-29. With the
water's velocity V normal to the vibration-free rope (V_N) and U relative to the moving rope (U_N):

    q'' + ε·ω_s·(q² - 1)·q' + ω_s²·q = (A/D)·x''·D_a,    ω_s = 2π·St·|V_N|/D
    lift per metre = ½·ρ·D·(C_L0/2)·q·|U_N|²·D_L
    D_L = U_N × t/|U_N × t|,  D_a = V_N × t_s/|V_N × t_s|

t is the rope's tangent and t_s that of its shape without the vibration: the running mean of t over
`shape_over_s`, which starts as the static shape and follows payout and current. (A, ε) are those of
an upright rope where it is inclined by less than 45° (`critical_angle_deg`) to the normal of the
flow, others above. The drag of the paper, ½·ρ·D·C_D·|U_N|·U_N with C_D 1.2, is the effect `drag`.

The equation is for steady flow. In unsteady flow it is solved in the wake's own time, ω_s·dt
(rope_twin.vortex.wake): shedding follows the water velocity and stops where the water is still.
The lift is normal to U, so that in still water it does no work for any q.

q is solved at each node inside the stage (TR-BDF2 like the rope): for the node's velocity the
scalar equation is a cubic, solved by Newton's method, and its derivative is added to the node's
block. Omitted there: the skew part, and the tangent's change with position.

Named sets: `qu_metrikine` [QM]; `facchinetti` (Facchinetti, de Langre and Biolley 2004, J. Fluids
Struct. 19, 123: A 12, ε 0.3, acceleration coupling; their stall term γ = C_D/(4π·St) = 0.8
corresponds to `drag: {normal: 2.0}`); `ogink_metrikine` (2010, J. Sound Vib. 329, 5452, upper
branch).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, exp, pi, radians, sqrt
from typing import Any, NamedTuple

import numpy as np

from rope_twin.core.integrator import BDF2, GAMMA, K1, K2, TRAPEZOID
from rope_twin.core.jit.decorators import jit
from rope_twin.core.jit.functions import renewed
from rope_twin.core.jit.rows import rows
from rope_twin.core.loads.accounts import account
from rope_twin.core.loads.balance import add_to_node
from rope_twin.core.loads.hooks import VORTICES, Load, kernel, scales_with_ramp
from rope_twin.core.loads.memory import count_initialised, declare_internal_variables, new_memory
from rope_twin.core.payout import set_trials
from rope_twin.core.state import ELEMENTS, FLOW, REST, SPEED2_MIN, TANGENT, VELOCITY, ZERO, Floats
from rope_twin.quantity import SparingRepr, quantity, text
from rope_twin.vortex import wake as shedding
from rope_twin.vortex.wake import faded, smooth_noise, solve_wake, wake_of

CARRIED = 7
Q, RATE, WAKE, WAKE_RATE, SHAPE = range(5)  # q, q', p, p', and the mean tangent (three)
# Further rows: prediction of q and p, initial guess of q, ω_s, ε, (A/D)·D_a (three), and the lift
# factor ½·ρ·D·l·C_L0/2 [kg/m].
HAT, WAKE_HAT, GUESS, OMEGA, EPSILON, COUPLING = range(3 * CARRIED + 1, 3 * CARRIED + 7)
STRENGTH = COUPLING + 3
OWN_ROWS = STRENGTH - 3 * CARRIED
# Newton steps on the cubic: two from the initial guess leave an error of 1e-8 of q for ω_s·h = 0.3,
# and 5e-3 for 1; one more, after the converged stage, leaves 2e-5 there.
FIRST, LAST = 2, 1
GROWTH = (1.0 - GAMMA) / GAMMA  # growth of a rate after the middle of a step over that before
SLOWEST = 1.0  # rad/s: minimum ω_s for the initial p


class _Set(NamedTuple):
    """Published coefficients of one model."""

    strouhal: float
    lift: float  # C_L0
    upright: tuple[float, float]  # A, ε
    inclined: tuple[float, float]


SETS = {
    "qu_metrikine": _Set(0.17, 0.3842, (4.0, 0.05), (1.0, 0.1)),
    "facchinetti": _Set(0.2, 0.3, (12.0, 0.3), (12.0, 0.3)),
    "ogink_metrikine": _Set(0.1932, 0.3842, (4.0, 0.05), (4.0, 0.05)),
}


@dataclass(frozen=True, kw_only=True, repr=False)
class WakeOscillatorParams(SparingRepr):
    """A published set by its name; coefficients given explicitly replace those of the set."""

    _later = frozenset(("critical_angle_deg",))

    set: str = text("set: qu_metrikine, facchinetti or ogink_metrikine", "qu_metrikine")
    strouhal: float | None = quantity("Strouhal number St", "", 0.05, 0.5, default=None)
    lift: float | None = quantity(
        "lift coefficient C_L0 of a fixed cylinder", "", 0.0, 2.0, default=None
    )
    upright: tuple[float, float] | None = quantity(
        "A and ε for an inclination below critical_angle_deg", "", 0.0, 100.0, default=None
    )
    inclined: tuple[float, float] | None = quantity(
        "A and ε for an inclination above critical_angle_deg", "", 0.0, 100.0, default=None
    )
    start_per_s: float = quantity(
        "initial rate of q (smooth noise)", "1/s", 0.0, 100.0, default=1.0
    )
    shape_over_s: float = quantity(
        "averaging time of the vibration-free shape", "s", 0.1, 1e4, default=10.0
    )
    critical_angle_deg: float = quantity(
        "inclination to the normal of the flow between upright and inclined", "°", 0.0, 90.0,
        default=45.0,
    )  # fmt: skip

    def check(self) -> str | None:
        """Return a fault if the set is unknown or ε out of range, or None."""
        if self.set not in SETS:
            return f"unknown set '{self.set}'; known: {', '.join(SETS)}"
        for pair in (self.upright, self.inclined):
            if pair is not None and not 0.0 < pair[1] < 1.5:
                return f"ε is {pair[1]:g}; give more than 0 and less than 1.5"
        return None

    @property
    def strouhal_number(self) -> float:
        """Return the Strouhal number of the vortex shedding."""
        return self.figures.strouhal

    @property
    def figures(self) -> _Set:
        """Return the coefficients of the set, with explicit ones replaced."""
        given = {name: getattr(self, name) for name in _Set._fields}
        kept = {name: value for name, value in given.items() if value is not None}
        return SETS[self.set]._replace(**kept)


class WakeOscillator(NamedTuple):
    """Kernel data of the wake oscillator."""

    memory: Floats  # see CARRIED and the rows after it, (rows, nodes)
    strouhal: float
    strength: float  # ½·ρ·C_L0/2 [kg/m³]
    A: float
    epsilon: float
    A_inclined: float
    epsilon_inclined: float
    start: float  # [1/s]
    shape_over: float  # [s]
    critical: float  # sine of the angle between upright and inclined


def build(params: WakeOscillatorParams, payload: Any, environment: Any) -> WakeOscillator:
    """Return the kernel data for the set and the water."""
    figures = params.figures
    return WakeOscillator(
        memory=new_memory(CARRIED, OWN_ROWS, environment.room),
        strouhal=float(figures.strouhal),
        strength=float(0.25 * environment.water_density_kg_per_m3 * figures.lift),
        A=float(figures.upright[0]),
        epsilon=float(figures.upright[1]),
        A_inclined=float(figures.inclined[0]),
        epsilon_inclined=float(figures.inclined[1]),
        start=float(params.start_per_s),
        shape_over=float(params.shape_over_s),
        # sin a as cos(90° - a), which is √½ to the last bit at 45°
        critical=cos(radians(90.0 - params.critical_angle_deg)),
    )


scales_with_ramp(WakeOscillator, "strength", factor=VORTICES)
declare_internal_variables(WakeOscillator, CARRIED)


@jit
def _set_figures(wake: Any, work: Any, low: int, high: int) -> None:
    """Set the flow-dependent coefficients at the nodes low <= i < high."""
    memory = wake.memory
    figures = memory[OMEGA, low:], memory[EPSILON, low:], memory[STRENGTH, low:]
    shedding.set_node_lengths(work, figures[2], low, high)
    own = (
        shedding.three_rows(memory, SHAPE, low),
        figures,
        shedding.three_rows(memory, COUPLING, low),
    )
    shedding.set_shedding(wake, work, own, low, high)


@kernel("start", WakeOscillator)
def start(wake: Any, rope: Any, upto: int) -> None:
    """Initialise q = 0 (no lift), q' with smooth noise, and t_s with the rope's tangent."""
    n, s, memory = rope.state.counts[ELEMENTS], rope.state.s, wake.memory
    shedding.evaluate_statics(rope, upto)
    shedding.set_shape(rope, shedding.three_rows(memory, SHAPE, n - n), upto)
    _set_figures(wake, rope.work, n - n, upto)
    for i in range(upto):
        omega = memory[OMEGA, i]
        p = wake.start * smooth_noise(s[i] / s[n]) / max(omega, SLOWEST)
        memory[Q, i], memory[RATE, i], memory[WAKE, i] = 0.0, omega * p, p
        memory[WAKE_RATE, i] = memory[EPSILON, i] * omega * p


@kernel("predict", WakeOscillator, wide=True)
def predict(wake: Any, rope: Any, stage: Any, kind: int, low: int, high: int) -> None:
    """Set the explicit parts of q and p, and the quantities that are constant in the stage."""
    memory, c = wake.memory, stage.q
    _set_figures(wake, rope.work, low, high)
    if stage.time <= 0.0:  # static equilibrium, sought in long steps
        strength = memory[STRENGTH, low:]
        for i in range(high - low):
            strength[i] = 0.0
    q0, rate0 = memory[Q, low:], memory[RATE, low:]
    wake0, wake_rate0 = memory[WAKE, low:], memory[WAKE_RATE, low:]
    hat, wake_hat, guess = memory[HAT, low:], memory[WAKE_HAT, low:], memory[GUESS, low:]
    if kind == TRAPEZOID:
        omega = memory[OMEGA, low:]
        for i in range(high - low):
            hat[i] = q0[i] + c * rate0[i]
            wake_hat[i] = wake0[i] + c * wake_rate0[i]
            guess[i] = hat[i] + c * (rate0[i] + 2.0 * c * omega[i] * wake_rate0[i])
        return
    q1, rate1 = memory[CARRIED + Q, low:], memory[CARRIED + RATE, low:]
    wake1 = memory[CARRIED + WAKE, low:]
    for i in range(high - low):
        hat[i] = K1 * q1[i] - K2 * q0[i]
        wake_hat[i] = K1 * wake1[i] - K2 * wake0[i]
        guess[i] = hat[i] + c * (rate1[i] + GROWTH * (rate1[i] - rate0[i]))


@kernel("load_nodes", WakeOscillator, wide=True)
def load_nodes(wake: Any, work: Any, stage: Any, low: int, high: int) -> None:
    """Add F = k·q·|U × t|·(U × t), k = ½·ρ·D·l·C_L0/2, and its block.

    A is the symmetric part of -k·|U × t|·(dq/da)·(U × t) ⊗ D_a and q_w·k·q·(U × t) ⊗ U_N/|U_N|
    (q_w: the stage's weight of v).
    """
    memory = wake.memory
    hat, wake_hat, guess = memory[HAT, low:], memory[WAKE_HAT, low:], memory[GUESS, low:]
    omega, epsilon, strength = memory[OMEGA, low:], memory[EPSILON, low:], memory[STRENGTH, low:]
    bx, by, bz = shedding.three_rows(memory, COUPLING, low)
    vx, vy, vz = rows(work, VELOCITY, low)
    ux, uy, uz = rows(work, FLOW, low)
    tx, ty, tz = rows(work, TANGENT, low)
    for i in range(high - low):
        drive, felt = faded(bx[i] * vx[i] + by[i] * vy[i] + bz[i] * vz[i], omega[i])
        begun = (hat[i], wake_hat[i], guess[i])
        q, slope = solve_wake(stage.q, FIRST, begun, (omega[i], epsilon[i]), drive)
        guess[i] = renewed(stage, q, guess[i])
        x, y, z = tx[i], ty[i], tz[i]
        u, v, w = ux[i] - vx[i], uy[i] - vy[i], uz[i] - vz[i]
        along = u * x + v * y + w * z
        u, v, w = u - along * x, v - along * y, w - along * z
        lx, ly, lz = v * z - w * y, w * x - u * z, u * y - v * x
        speed = sqrt(u * u + v * v + w * w + SPEED2_MIN)
        k = strength[i]
        size = k * q * speed
        g, h = -0.5 * k * speed * felt * stage.p / slope, 0.5 * stage.q * k * q / speed
        cx, cy, cz = g * bx[i] + h * u, g * by[i] + h * v, g * bz[i] + h * w
        add_to_node(work, low + i, Load(
            size * lx, size * ly, size * lz,
            2.0 * lx * cx, lx * cy + ly * cx, lx * cz + lz * cx,
            2.0 * ly * cy, ly * cz + lz * cy, 2.0 * lz * cz,
        ))  # fmt: skip


@kernel("settle", WakeOscillator, wide=True)
def settle(wake: Any, rope: Any, stage: Any, kind: int, upto: int) -> None:
    """Store q, p and their rates of the converged stage; update the mean tangent once a step."""
    memory, work = wake.memory, rope.work
    hat, wake_hat, guess = memory[HAT], memory[WAKE_HAT], memory[GUESS]
    omega, epsilon = memory[OMEGA], memory[EPSILON]
    bx, by, bz = shedding.three_rows(memory, COUPLING, ZERO)
    q1, rate1 = memory[CARRIED + Q], memory[CARRIED + RATE]
    wake1, wake_rate1 = memory[CARRIED + WAKE], memory[CARRIED + WAKE_RATE]
    vx, vy, vz = rows(work, VELOCITY, 0)
    inverse = 1.0 / stage.q
    for i in range(upto):
        drive, _ = faded(bx[i] * vx[i] + by[i] * vy[i] + bz[i] * vz[i], omega[i])
        begun, figures = (hat[i], wake_hat[i], guess[i]), (omega[i], epsilon[i])
        q, _ = solve_wake(stage.q, LAST, begun, figures, drive)
        p = wake_of(stage.q, q, begun, figures)
        q1[i], rate1[i] = q, inverse * (q - hat[i])
        wake1[i], wake_rate1[i] = p, inverse * (p - wake_hat[i])
    if kind == BDF2:
        share = 1.0 - exp(-2.0 * stage.q / (GAMMA * wake.shape_over))
        kept = shedding.three_rows(memory, CARRIED + SHAPE, ZERO)
        shedding.follow_shape(work, share, shedding.three_rows(memory, SHAPE, ZERO), kept, upto)
    _set_trials(wake, rope, stage)


@jit
def _set_trials(wake: Any, rope: Any, stage: Any) -> None:
    """Copy the wake of the highest free node to the ghost nodes, per metre, constant."""
    memory, top = wake.memory, rope.state.counts[ELEMENTS] - 1
    per_metre = 1.0 / (0.5 * (rope.work[REST, top] + rope.work[REST, top - 1]))
    for k in range(HAT, STRENGTH):
        set_trials(memory, k, 0.0, rope)
    for k in (HAT, GUESS):
        set_trials(memory, k, memory[CARRIED + Q, top], rope)
    set_trials(memory, STRENGTH, per_metre * memory[STRENGTH, top], rope)


@account("power", WakeOscillator)
def power(wake: Any, place: Any) -> Any:
    """Return the power of the lift [W]; the hang-off's wake is that of the node below."""
    n = place.position.shape[1]
    q = wake.memory[Q, :n].copy()
    if count_initialised(wake) != n:
        q[-1] = q[-2]
    k = wake.strength * np.sqrt(4.0 / pi * place.volume * place.length)
    u = place.flow - place.velocity
    across = np.cross(u, place.tangent, axis=0)
    size = k * q * np.sqrt((across * across).sum(axis=0))
    return size * (across * place.velocity).sum(axis=0)
