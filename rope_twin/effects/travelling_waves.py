"""Travelling waves: a lift of given phase at every node, limited by the amplitude that it causes.

[LCD] Le Cunff and Durand (1999), eqs 10-20. Across rope and current, with y the motion there,

    m_t·y'' + c·y' - (T·y')' (+ EI·y'''') = ½·ρ·d·U²·C_l·cos(∫ω dt + φ),
    ω = 2π·St·U/d,    C_l = C0 - C1·|A|/d,    c = 2·ζ·m_t·ω,    m_t = m + Ca·ρ·π·d²/4

Tension, bending and added mass are the rope's own. φ begins as that of a wave that runs down from
the hang-off, ∫k ds with the dispersion k² = (√(T² + 4·EI·m_t·ω²) - T)/(2·EI), or m_t·ω²/T; the
lift fades in over the first `ramp_s`, so that a rope at rest stays so. As in the published case ω
is one for each half wave, counted from the hang-off: that of its upper end. With
`by_half_waves: false` it is each node's own; neighbours then drift apart in phase without end.

|A|/d is √(2·s)/(ω·d), with s the mean of y'² over the last periods, s' = (y'² - s)·ω/(2π·periods).
Like the phase it is solved in the stage (TR-BDF2): taken of the step before, the published limit
diverges on a light cable. It counts what moves across the current, whatever moves it. y is that of
the node's own tangent; dropped in the block: the tangent's change with position.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, pi, sqrt
from typing import Any, NamedTuple

import numpy as np

from rope_twin.core.assembly import set_flow
from rope_twin.core.elastic import stretch_all
from rope_twin.core.energy import account
from rope_twin.core.jit import jit, jit_within
from rope_twin.core.prediction import K1, K2
from rope_twin.core.remembering import new_memory, remembering
from rope_twin.core.rows import rows, span
from rope_twin.core.stage import BDF2, TRAPEZOID
from rope_twin.core.state import (
    BLOCK,
    DIRECTION,
    ELEMENTS,
    FLOW,
    MASS,
    RESIDUAL,
    REST,
    TANGENT,
    TENSION,
    VELOCITY,
    VOLUME,
    Floats,
    Stage,
)
from rope_twin.core.terms import kernel
from rope_twin.core.trial import TRIALS
from rope_twin.quantity import quantity, text

CARRIED = 4  # phase [rad], ω [rad/s], mean square of y' [m²/s²], its rate
PHASE, OMEGA, SQUARE, SQUARE_RATE = range(CARRIED)
# Rows of its own: cosine of the stage's phase, its phase and ω, what s starts from, its weight,
# damping c [kg/s], ½·ρ·d·l [kg/m], 1/d [1/m], and ω of the half wave that the node lies in.
(COSINE, PHASE_NOW, OMEGA_NOW, SQUARE_HAT, SHARE, DAMPING, STRENGTH, PER_DIAMETER, HELD) = range(
    3 * CARRIED + 1, 3 * CARRIED + 10
)
OWN_ROWS = HELD - 3 * CARRIED
LEAST = 1e-9  # what keeps a quotient finite where nothing flows


@dataclass(frozen=True, kw_only=True)
class TravellingWavesParams:
    """The published figures, and what the paper leaves open."""

    strouhal: float = quantity("Strouhal number St", "", 0.05, 0.5, default=0.17)
    lift: tuple[float, float] = quantity("C0 and C1 of C0 - C1·|A|/d", "", 0.0, 3.0, (0.7, 0.7))
    damping_fraction: float = quantity(
        "structural damping across the rope over critical, at ω", "", 0.0, 0.5, default=0.015
    )
    periods: float = quantity("over which the amplitude is averaged", "", 0.25, 50.0, default=1.0)
    by_half_waves: bool = text("one frequency for each half wave", True)
    ramp_s: float = quantity("the lift fades in over this time", "s", 1e-3, 600.0, default=2.0)

    @property
    def strouhal_number(self) -> float:
        """What sets the pace of the vortices."""
        return self.strouhal


class TravellingWaves(NamedTuple):
    """What the kernels see."""

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
    by_half_waves: bool


def build(params: TravellingWavesParams, payload: Any, around: Any) -> TravellingWaves:
    """From the figures, the water, and the rope's added mass and bending stiffness."""
    density = around.water_density_kg_per_m3
    return TravellingWaves(
        memory=new_memory(CARRIED, OWN_ROWS, around.room),
        turns=2.0 * pi * params.strouhal,
        half_density=0.5 * density,
        C0=float(params.lift[0]),
        C1=float(params.lift[1]),
        damping=2.0 * params.damping_fraction,
        added=around.added_mass * density,
        averaging=1.0 / (2.0 * pi * params.periods),
        ramp=float(params.ramp_s),
        EI=float(around.bending_n_m2),
        by_half_waves=bool(params.by_half_waves),
    )


remembering(TravellingWaves, CARRIED)


@jit_within
def _across(water: Any, tangent: Any) -> Any:
    """U × t and its size, that of the water across the rope."""
    u, v, w = water
    x, y, z = tangent
    cx, cy, cz = v * z - w * y, w * x - u * z, u * y - v * x
    return cx, cy, cz, sqrt(cx * cx + cy * cy + cz * cz)


@jit_within
def _length(work: Any, i: int) -> float:
    """Of rope that belongs to a free node [m]."""
    return float(0.5 * (work[REST, i] + work[REST, i - 1]) if i > 0 else 0.5 * work[REST, i])


@jit_within
def _speed_at(work: Any, i: int) -> float:
    """Of the water across the elements beside a node [m/s]."""
    j = max(i - 1, 0)
    x = work[DIRECTION, i] + work[DIRECTION, j]
    y = work[DIRECTION + 1, i] + work[DIRECTION + 1, j]
    z = work[DIRECTION + 2, i] + work[DIRECTION + 2, j]
    inverse = 1.0 / sqrt(x * x + y * y + z * z + 1e-12)
    water = (work[FLOW, i], work[FLOW + 1, i], work[FLOW + 2, i])
    _, _, _, speed = _across(water, (x * inverse, y * inverse, z * inverse))
    return float(speed)


@jit_within
def _wave_number(waves: Any, work: Any, i: int, omega: float) -> float:
    """k of a wave of this frequency at a node [1/m]; 0 where the rope is slack."""
    T, length = work[TENSION, i], _length(work, i)
    m = (work[MASS, i] + waves.added * work[VOLUME, i]) / length
    inertia = m * omega * omega
    square = 2.0 * inertia / (T + sqrt(T * T + 4.0 * waves.EI * inertia) + LEAST)
    return float(sqrt(square) if T > 0.0 else 0.0)


@jit
def _hold_frequencies(waves: Any, rope: Any) -> None:
    """One ω from the hang-off down until half a wave is full: that of its upper end."""
    memory, work, n = waves.memory, rope.work, rope.state.counts[ELEMENTS]
    turned, held = pi, 0.0
    for i in range(n - 1, -1, -1):
        own = _frequency(waves, work, i)
        if turned >= pi:
            turned, held = turned - pi, own
        memory[HELD, i] = held
        turned += _wave_number(waves, work, i, held) * _length(work, i)


@jit_within
def _frequency(waves: Any, work: Any, i: int) -> float:
    """2π·St·U/d at a node [rad/s]."""
    per_diameter = sqrt(0.25 * pi * _length(work, i) / (work[VOLUME, i] + 1e-300))
    return float(waves.turns * _speed_at(work, i) * per_diameter)


@kernel("start", TravellingWaves)
def start(waves: Any, rope: Any) -> None:
    """Nothing moves; the phases are those of waves that run down from the hang-off."""
    n, memory, work = rope.state.counts[ELEMENTS], waves.memory, rope.work
    stage = Stage(0.0, 1.0, 0.0, 0.0)
    stretch_all(rope, stage)
    set_flow(rope.effects, work, stage, n - n, n)
    if waves.by_half_waves:
        _hold_frequencies(waves, rope)
    phase = 0.0
    for i in range(n - 1, -1, -1):
        omega = memory[HELD, i]
        if omega == 0.0:
            omega = _frequency(waves, work, i)
        phase += _wave_number(waves, work, i, omega) * _length(work, i)
        memory[PHASE, i], memory[OMEGA, i] = -phase, omega
        memory[SQUARE, i] = memory[SQUARE_RATE, i] = 0.0


@kernel("predict", TravellingWaves)
def predict(waves: Any, rope: Any, stage: Any, kind: int, low: int, high: int) -> None:
    """Phase and frequency of the stage, what the mean square starts from, and what stays."""
    memory, work, c = waves.memory, rope.work, stage.q
    grown = min(stage.time / waves.ramp, 1.0)
    for i in range(low, high):
        omega = memory[HELD, i]
        if omega == 0.0:  # by its own frequency, or a node that is new
            omega = _frequency(waves, work, i)
        if kind == TRAPEZOID:
            phase = memory[PHASE, i] + c * (memory[OMEGA, i] + omega)
            square = memory[SQUARE, i] + c * memory[SQUARE_RATE, i]
        else:
            phase = K1 * memory[CARRIED + PHASE, i] - K2 * memory[PHASE, i] + c * omega
            square = K1 * memory[CARRIED + SQUARE, i] - K2 * memory[SQUARE, i]
        weight = c * omega * waves.averaging
        memory[PHASE_NOW, i], memory[OMEGA_NOW, i] = phase, omega
        memory[COSINE, i] = grown * cos(phase)
        memory[SQUARE_HAT, i], memory[SHARE, i] = square / (1.0 + weight), weight / (1.0 + weight)
        length, volume = _length(work, i), work[VOLUME, i]
        per_diameter = sqrt(0.25 * pi * length / (volume + 1e-300))
        memory[DAMPING, i] = waves.damping * omega * (work[MASS, i] + waves.added * volume)
        memory[STRENGTH, i] = waves.half_density * length / per_diameter
        memory[PER_DIAMETER, i] = per_diameter


@jit_within
def _mean_square(waves: Any, i: int, across: float) -> float:
    """Of y', with the stage's own [m²/s²]."""
    memory = waves.memory
    return float(max(memory[SQUARE_HAT, i] + memory[SHARE, i] * across * across, 0.0))


@kernel("load_nodes", TravellingWaves)
def load_nodes(waves: Any, work: Any, stage: Any, low: int, high: int) -> None:
    """F = (L·(C0 - C1·A) - c·y')·e, e = U × t/|U × t|, L = ½·ρ·d·l·|U × t|²·cos φ, A = |A|/d.

    Block q·(L·C1·dA/dy' + c)·e ⊗ e.
    """
    memory = waves.memory
    vx, vy, vz = rows(work, VELOCITY, low)
    ux, uy, uz = rows(work, FLOW, low)
    tx, ty, tz = rows(work, TANGENT, low)
    Rx, Ry, Rz = rows(work, RESIDUAL, low)
    Axx, Axy, Axz, Ayy, Ayz, Azz = span(work, BLOCK, 6, low)
    for i in range(high - low):
        j = low + i
        x, y, z, speed = _across((ux[i], uy[i], uz[i]), (tx[i], ty[i], tz[i]))
        inverse = 1.0 / (speed + LEAST)
        x, y, z = x * inverse, y * inverse, z * inverse
        rate = vx[i] * x + vy[i] * y + vz[i] * z
        root = sqrt(2.0 * _mean_square(waves, j, rate))
        per = memory[PER_DIAMETER, j] / (memory[OMEGA_NOW, j] + LEAST)
        L, damping = memory[STRENGTH, j] * speed * speed * memory[COSINE, j], memory[DAMPING, j]
        force = L * (waves.C0 - waves.C1 * root * per) - damping * rate
        Rx[i] += force * x
        Ry[i] += force * y
        Rz[i] += force * z
        growth = 2.0 * memory[SHARE, j] * rate * per / (root + LEAST)
        k = stage.q * (L * waves.C1 * growth + damping)
        Axx[i] += k * x * x
        Axy[i] += k * x * y
        Axz[i] += k * x * z
        Ayy[i] += k * y * y
        Ayz[i] += k * y * z
        Azz[i] += k * z * z


@kernel("settle", TravellingWaves)
def settle(waves: Any, rope: Any, stage: Any, kind: int) -> None:
    """Phase, frequency and mean square of the solved stage; half waves are counted once a step."""
    memory, work, n = waves.memory, rope.work, rope.state.counts[ELEMENTS]
    for i in range(n):
        water = (work[FLOW, i], work[FLOW + 1, i], work[FLOW + 2, i])
        tangent = (work[TANGENT, i], work[TANGENT + 1, i], work[TANGENT + 2, i])
        x, y, z, speed = _across(water, tangent)
        rate = work[VELOCITY, i] * x + work[VELOCITY + 1, i] * y + work[VELOCITY + 2, i] * z
        rate /= speed + LEAST
        square, omega = _mean_square(waves, i, rate), memory[OMEGA_NOW, i]
        memory[CARRIED + PHASE, i], memory[CARRIED + OMEGA, i] = memory[PHASE_NOW, i], omega
        memory[CARRIED + SQUARE, i] = square
        memory[CARRIED + SQUARE_RATE, i] = omega * waves.averaging * (rate * rate - square)
    if waves.by_half_waves and kind == BDF2:
        _hold_frequencies(waves, rope)
    _set_trials(waves, rope)


@jit
def _set_trials(waves: Any, rope: Any) -> None:
    """At the trial nodes the lift is that of the highest free node, per metre, and stays."""
    memory, top = waves.memory, rope.state.counts[ELEMENTS] - 1
    slots = rope.state.s.shape[0]
    length = _length(rope.work, top)
    for slot in range(slots - TRIALS, slots):
        for k in (COSINE, OMEGA_NOW, PER_DIAMETER):
            memory[k, slot] = memory[k, top]
        memory[SQUARE_HAT, slot], memory[SHARE, slot] = memory[CARRIED + SQUARE, top], 0.0
        memory[DAMPING, slot] = memory[DAMPING, top] / length
        memory[STRENGTH, slot] = memory[STRENGTH, top] / length


@account("power", TravellingWaves)
def power(waves: Any, place: Any) -> Any:
    """Lift and damping times velocity [W]; the hang-off's are as at the node below."""
    n = place.position.shape[1]
    own = waves.memory[:, :n].copy()
    length = np.zeros(n)
    half = 0.5 * np.diff(place.arc)
    length[:-1] += half
    length[1:] += half
    if n > 1:
        own[:, -1] = own[:, -2]
    per_diameter = np.sqrt(0.25 * pi * length / (place.volume + 1e-300))
    across = np.cross(place.flow, place.tangent, axis=0)
    speed = np.sqrt((across * across).sum(axis=0))
    rate = (across * place.velocity).sum(axis=0) / (speed + LEAST)
    amplitude = np.sqrt(2.0 * own[SQUARE]) * per_diameter / (own[OMEGA] + LEAST)
    lift = waves.half_density * length / (per_diameter + 1e-300) * speed**2 * own[COSINE]
    damping = waves.damping * own[OMEGA] * (place.mass + waves.added * place.volume)
    return rate * (lift * (waves.C0 - waves.C1 * amplitude) - damping * rate)
