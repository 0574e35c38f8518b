"""Travelling-wave VIV model: a lift of prescribed phase at every node, limited by its amplitude.

[LCD] Le Cunff and Durand (1999), eqs 10-20. Normal to rope and current, with y the motion there,

    m_t·y'' + c·y' - (T·y')' (+ EI·y'''') = ½·ρ·d·U²·C_l·cos(∫ω dt + φ),
    ω = 2π·St·U/d,    C_l = C0 - C1·|A|/d,    c = 2·ζ·m_t·ω,    m_t = m + Ca·ρ·π·d²/4

Tension, bending and added mass are the rope's own. φ starts as that of a standing wave (eqs 17 and
18), 0 and π in turn for each half wave below the hang-off, or (`initial_phase: travelling`) as that
of a wave that travels down, -∫k ds, both with the dispersion k² = (√(T² + 4·EI·m_t·ω²) - T)/(2·EI),
or m_t·ω²/T; the lift builds up over the first `ramp_s`, so that static equilibrium is not
disturbed. As in the published case ω is constant over each half wave, counted from the hang-off:
the largest on it (wake.py). With `by_half_waves: false` it is each node's own; the phase difference
of neighbours then grows without bound.

|A|/d is √(2·s)/(ω·d), with s the mean of y'² over the last periods, s' = (y'² - s)·ω/(2π·periods).
Like the phase it is solved in the stage (TR-BDF2): taken from the previous step, the published
limit diverges on a light cable. It includes all cross-flow motion, whatever its cause. y is normal
to the node's own tangent; omitted in the block: the tangent's change with position.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import floor, pi, sqrt
from typing import Any, NamedTuple

import numpy as np

from rope_twin.core.integrator import BDF2, K1, K2, TRAPEZOID
from rope_twin.core.jit.decorators import jit, jit_within
from rope_twin.core.jit.functions import anywhere, by_width, cosine, renewed
from rope_twin.core.jit.rows import row, rows
from rope_twin.core.jit.wide import bits, choose
from rope_twin.core.loads.accounts import account
from rope_twin.core.loads.balance import add_to_node
from rope_twin.core.loads.hooks import VORTICES, Load, kernel, scales_with_ramp
from rope_twin.core.loads.memory import count_initialised, declare_internal_variables, new_memory
from rope_twin.core.payout import set_trials
from rope_twin.core.state import (
    DIVISOR_MIN,
    FLOW,
    MASS,
    RATE_MIN,
    TANGENT,
    TENSION,
    VELOCITY,
    VOLUME,
    Floats,
)
from rope_twin.quantity import quantity, text
from rope_twin.vortex.wake import (
    across,
    evaluate_statics,
    hold_frequencies,
    set_node_lengths,
    set_paces,
    wave_number,
)

CARRIED = 4  # phase [rad], ω [rad/s], mean square of y' [m²/s²], its rate
PHASE, OMEGA, SQUARE, SQUARE_RATE = range(CARRIED)
# Further rows: cosine of the stage's phase, its phase and ω, explicit part of s, its weight,
# damping c [kg/s], ½·ρ·d·l [kg/m], 1/d [1/m], ω of the node's half wave (0: unknown), its length,
# scratch (two).
(COSINE, PHASE_NOW, OMEGA_NOW, SQUARE_HAT, SHARE, DAMPING, STRENGTH, PER_DIAMETER, HELD, LENGTH,
 SCRATCH, MARK) = range(3 * CARRIED + 1, 3 * CARRIED + 13)  # fmt: skip
OWN_ROWS = MARK - 3 * CARRIED
PHASES = ("standing", "travelling")


@dataclass(frozen=True, kw_only=True)
class TravellingWavesParams:
    """Published coefficients, and choices that the paper leaves open."""

    strouhal: float = quantity("Strouhal number St", "", 0.05, 0.5, default=0.17)
    lift: tuple[float, float] = quantity("C0 and C1 of C0 - C1·|A|/d", "", 0.0, 3.0, (0.7, 0.7))
    damping_fraction: float = quantity(
        "structural damping ratio at ω; 1.5 % of the paper is read as a loss factor", "", 0.0, 0.5,
        default=0.0075,
    )  # fmt: skip
    periods: float = quantity(
        "averaging time of the amplitude, in periods", "", 0.25, 50.0, default=1.0
    )
    by_half_waves: bool = text("one frequency per half wave", True)
    initial_phase: str = text("of the lift along the rope: standing or travelling", "standing")
    ramp_s: float = quantity("build-up time of the lift", "s", 1e-3, 600.0, default=2.0)

    def check(self) -> str | None:
        """Return a fault of initial_phase, or None."""
        if self.initial_phase not in PHASES:
            known = ", ".join(PHASES)
            return f"unknown initial_phase '{self.initial_phase}'; give one of {known}"
        return None

    @property
    def strouhal_number(self) -> float:
        """Return the Strouhal number of the vortex shedding."""
        return self.strouhal


class TravellingWaves(NamedTuple):
    """Kernel data of the travelling-wave model."""

    memory: Floats  # see CARRIED and the rows after it, (rows, nodes)
    turns: float  # 2π·St
    half_density: float  # ½·ρ [kg/m³]
    C0: float
    C1: float
    damping: float  # 2·ζ
    added: float  # Ca·ρ [kg/m³]
    averaging: float  # 1/(2π·periods)
    ramp: float  # [s]
    EI: float  # [N·m²]
    by_half_waves: float  # 1, or 0
    standing: float  # 1, or 0


def build(params: TravellingWavesParams, payload: Any, environment: Any) -> TravellingWaves:
    """Return the kernel data for the coefficients, the water, and the rope's properties."""
    density = environment.water_density_kg_per_m3
    return TravellingWaves(
        memory=new_memory(CARRIED, OWN_ROWS, environment.room),
        turns=2.0 * pi * params.strouhal,
        half_density=0.5 * density,
        C0=float(params.lift[0]),
        C1=float(params.lift[1]),
        damping=2.0 * params.damping_fraction,
        added=environment.added_mass * density,
        averaging=1.0 / (2.0 * pi * params.periods),
        ramp=float(params.ramp_s),
        EI=float(environment.bending_n_m2),
        by_half_waves=float(params.by_half_waves),
        standing=float(params.initial_phase == "standing"),
    )


scales_with_ramp(TravellingWaves, "half_density", factor=VORTICES)
declare_internal_variables(TravellingWaves, CARRIED)


@jit
def _set_figures(waves: Any, work: Any, low: int, high: int) -> None:
    """Set length, 1/d and ½·ρ·d·l of the nodes low <= i < high."""
    length, per = waves.memory[LENGTH, low:], waves.memory[PER_DIAMETER, low:]
    strength, volume = waves.memory[STRENGTH, low:], row(work, VOLUME, low)
    set_node_lengths(work, length, low, high)
    for i in range(high - low):
        per[i] = sqrt(0.25 * pi * length[i] / (volume[i] + DIVISOR_MIN))
        strength[i] = waves.half_density * length[i] / per[i]


@kernel("start", TravellingWaves)
def start(waves: Any, rope: Any, upto: int) -> None:
    """Initialise without motion; phases are those of waves travelling down from the upper end."""
    n, memory, work = upto, waves.memory, rope.work
    evaluate_statics(rope, n)
    _set_figures(waves, work, n - n, n)
    length, omega = memory[LENGTH], memory[OMEGA]
    set_paces(waves.turns, work, memory[PER_DIAMETER], omega, n - n, n)
    halves = waves.by_half_waves > 0.0
    if halves:
        hold_frequencies(waves, work, length, omega, memory[MARK], n)
    phase = 0.0
    for i in range(n - 1, -1, -1):
        per_metre = (work[MASS, i] + waves.added * work[VOLUME, i]) / length[i]
        phase += wave_number(waves.EI, work[TENSION, i], per_metre, omega[i]) * length[i]
        memory[HELD, i] = omega[i] if halves else 0.0
        memory[PHASE, i] = -pi * floor(phase / pi) if waves.standing > 0.0 else -phase
        memory[SQUARE, i] = memory[SQUARE_RATE, i] = 0.0


@jit_within
def _count_unknown(half_waves: Any, low: int, high: int) -> int:
    """Return the number of nodes low <= i < high without a half wave."""
    unknown = 0
    for i in range(low, high):
        unknown += 1 if half_waves[HELD, i] == 0.0 else 0
    return unknown


@jit_within
def _find_unknown(half_waves: Any, low: int, high: int) -> int:
    """Return the lanes that have such a node, as bits."""
    unknown = 0
    for i in range(low, high):
        unknown |= bits(half_waves[HELD, i] == 0.0)
    return unknown


_unknown = by_width(_count_unknown, _find_unknown)


@jit
def _set_omega(waves: Any, work: Any, low: int, high: int) -> None:
    """Set OMEGA_NOW to that of the half wave, or the node's own (without, or at a new node)."""
    memory = waves.memory
    half_waves, now = memory[HELD, low:], memory[OMEGA_NOW, low:]
    for i in range(high - low):
        now[i] = half_waves[i]
    if _unknown(memory, low, high) > 0:
        own = memory[SCRATCH, low:]
        set_paces(waves.turns, work, memory[PER_DIAMETER, low:], own, low, high)
        for i in range(high - low):
            now[i] = choose(half_waves[i] == 0.0, own[i], half_waves[i])


@kernel("predict", TravellingWaves, wide=True)
def predict(waves: Any, rope: Any, stage: Any, kind: int, low: int, high: int) -> None:
    """Set phase and frequency of the stage, the explicit part of s, and stage constants."""
    memory, work, c = waves.memory, rope.work, stage.q
    _set_figures(waves, work, low, high)
    _set_omega(waves, work, low, high)
    mass, volume = row(work, MASS, low), row(work, VOLUME, low)
    phase0, omega0 = memory[PHASE, low:], memory[OMEGA, low:]
    square0, rate0 = memory[SQUARE, low:], memory[SQUARE_RATE, low:]
    phase, omega = memory[PHASE_NOW, low:], memory[OMEGA_NOW, low:]
    square, share = memory[SQUARE_HAT, low:], memory[SHARE, low:]
    lift, damping = memory[COSINE, low:], memory[DAMPING, low:]
    if kind == TRAPEZOID:
        for i in range(high - low):
            phase[i] = phase0[i] + c * (omega0[i] + omega[i])
            square[i] = square0[i] + c * rate0[i]
    else:
        phase1, square1 = memory[CARRIED + PHASE, low:], memory[CARRIED + SQUARE, low:]
        for i in range(high - low):
            phase[i] = K1 * phase1[i] - K2 * phase0[i] + c * omega[i]
            square[i] = K1 * square1[i] - K2 * square0[i]
    grown = min(max(stage.time, 0.0) / waves.ramp, 1.0)
    for i in range(high - low):
        weight = c * omega[i] * waves.averaging
        inverse = 1.0 / (1.0 + weight)
        square[i] *= inverse
        share[i] = weight * inverse
        damping[i] = waves.damping * omega[i] * (mass[i] + waves.added * volume[i])
        lift[i] = grown * cosine(phase[i])


@kernel("load_nodes", TravellingWaves, wide=True)
def load_nodes(waves: Any, work: Any, stage: Any, low: int, high: int) -> None:
    """Add F = (L·(C0 - C1·A) - c·y')·e and the block q·(L·C1·dA/dy' + c)·e ⊗ e.

    e = U × t/|U × t|, L = ½·ρ·d·l·|U × t|²·cos φ, A = |A|/d.
    """
    memory = waves.memory
    square, share = memory[SQUARE_HAT, low:], memory[SHARE, low:]
    lift, strength, damping = memory[COSINE, low:], memory[STRENGTH, low:], memory[DAMPING, low:]
    per_diameter, omega = memory[PER_DIAMETER, low:], memory[OMEGA_NOW, low:]
    vx, vy, vz = rows(work, VELOCITY, low)
    ux, uy, uz = rows(work, FLOW, low)
    tx, ty, tz = rows(work, TANGENT, low)
    for i in range(high - low):
        x, y, z, speed = across((ux[i], uy[i], uz[i]), (tx[i], ty[i], tz[i]))
        inverse = 1.0 / (speed + RATE_MIN)
        x, y, z = x * inverse, y * inverse, z * inverse
        rate = vx[i] * x + vy[i] * y + vz[i] * z
        root = sqrt(2.0 * max(square[i] + share[i] * rate * rate, 0.0))
        per = per_diameter[i] / (omega[i] + RATE_MIN)
        L = strength[i] * speed * speed * lift[i]
        force = L * (waves.C0 - waves.C1 * root * per) - damping[i] * rate
        growth = 2.0 * share[i] * rate * per / (root + RATE_MIN)
        k = stage.q * (L * waves.C1 * growth + damping[i])
        add_to_node(work, low + i, Load(
            force * x, force * y, force * z,
            k * x * x, k * x * y, k * x * z, k * y * y, k * y * z, k * z * z,
        ))  # fmt: skip


@kernel("settle", TravellingWaves, wide=True)
def settle(waves: Any, rope: Any, stage: Any, kind: int, upto: int) -> None:
    """Store phase, frequency and mean square of the stage; update half waves once a step."""
    memory, work, n = waves.memory, rope.work, upto
    vx, vy, vz = rows(work, VELOCITY, 0)
    ux, uy, uz = rows(work, FLOW, 0)
    tx, ty, tz = rows(work, TANGENT, 0)
    hat, share = memory[SQUARE_HAT], memory[SHARE]
    phase, omega = memory[PHASE_NOW], memory[OMEGA_NOW]
    phase1, omega1 = memory[CARRIED + PHASE], memory[CARRIED + OMEGA]
    square1, rate1 = memory[CARRIED + SQUARE], memory[CARRIED + SQUARE_RATE]
    for i in range(n):
        x, y, z, speed = across((ux[i], uy[i], uz[i]), (tx[i], ty[i], tz[i]))
        rate = (vx[i] * x + vy[i] * y + vz[i] * z) / (speed + RATE_MIN)
        square = max(hat[i] + share[i] * rate * rate, 0.0)
        phase1[i], omega1[i], square1[i] = phase[i], omega[i], square
        rate1[i] = omega[i] * waves.averaging * (rate * rate - square)
    halves = waves.by_half_waves > 0.0
    if kind == BDF2 and anywhere(halves):
        held, new = memory[HELD], memory[SCRATCH]
        set_paces(waves.turns, work, memory[PER_DIAMETER], new, n - n, n)
        hold_frequencies(waves, work, memory[LENGTH], new, memory[MARK], n)
        for i in range(n):
            held[i] = renewed(stage, choose(halves, new[i], 0.0), held[i])
    _set_trials(waves, rope, n - 1)


@jit
def _set_trials(waves: Any, rope: Any, top: int) -> None:
    """Copy the lift of the highest node that carries loads to the ghost nodes, per metre."""
    memory = waves.memory
    per_metre = 1.0 / memory[LENGTH, top]
    for k in (COSINE, OMEGA_NOW, PER_DIAMETER):
        set_trials(memory, k, memory[k, top], rope)
    set_trials(memory, SQUARE_HAT, memory[CARRIED + SQUARE, top], rope)
    set_trials(memory, SHARE, 0.0, rope)
    for k in (DAMPING, STRENGTH):
        set_trials(memory, k, per_metre * memory[k, top], rope)


@account("power", TravellingWaves)
def power(waves: Any, place: Any) -> Any:
    """Return the power of lift and damping [W]; at a hang-off as at the node below."""
    n = place.position.shape[1]
    own = waves.memory[:, :n].copy()
    if count_initialised(waves) != n:
        own[:, -1] = own[:, -2]
    length = place.length
    per_diameter = np.sqrt(0.25 * pi * length / (place.volume + DIVISOR_MIN))
    across = np.cross(place.flow, place.tangent, axis=0)
    speed = np.sqrt((across * across).sum(axis=0))
    rate = (across * place.velocity).sum(axis=0) / (speed + RATE_MIN)
    amplitude = np.sqrt(2.0 * own[SQUARE]) * per_diameter / (own[OMEGA] + RATE_MIN)
    lift = waves.half_density * length / (per_diameter + DIVISOR_MIN) * speed**2 * own[COSINE]
    damping = waves.damping * own[OMEGA] * (place.mass + waves.added * place.volume)
    return rate * (lift * (waves.C0 - waves.C1 * amplitude) - damping * rate)
