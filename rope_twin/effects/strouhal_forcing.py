"""Strouhal forcing: vortices as a lift and an oscillating drag of Strouhal's frequency.

[UWCFSI] Laird, Fraser and Marsh (2016), eqs 6-14. With the velocity v of the water relative to the
rope, across it (v_n; the paper does not say which, this is the cross-flow principle of its drag):

    Re = |v_n|·d/ν,  f = St(Re)·|v_n|/d,  φ' = 2π·f,  F_d = ½·ρ·d·C_d·|v_n|² per metre
    lift λ·F_d·sin φ along (v × t)/|v × t|,  in line C'_d·F_d·sin 2φ along v_n/|v_n|

The paper writes sin(2π·f·t); f changes in time and along the rope, so φ is the integral of 2π·f at
each node. St is 0.2 for 40 < Re <= 1e6 and linear in Re above; below 40 nothing is shed, and φ
waits. The paper gives no slope: `strouhal_rise` is what St gains from Re 1e6 to 1e7.

λ = C_L/C_d is fixed, or falls with the amplitude A of the node across the flow, λ·(1 - A/(a·d)) and
0 beyond: [LCD] eq 20, C_l = C0 - C1·|A|/d, has a = C0/C1 = 1 diameter. A = √(2·m)/(2π·f) with the
mean m of the square of the velocity along the lift, over one period of shedding.

φ and m are solved with the rope in each stage (TR-BDF2). Dropped in the block: what of it is not
symmetric, and how m and the tangent change with the motion.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, pi, sin, sqrt
from typing import Any, NamedTuple

import numpy as np

from rope_twin.core.acting.hooks import kernel
from rope_twin.core.energy import account
from rope_twin.core.guards import FOLDED2, NONE_AT_ALL, STILL2, UNSHED
from rope_twin.core.jit.decorators import jit, jit_within
from rope_twin.core.jit.rows import rows, span
from rope_twin.core.payout.trial import set_trials
from rope_twin.core.solve.prediction import K1, K2
from rope_twin.core.solve.remembering import new_memory, remembering
from rope_twin.core.solve.stage import TRAPEZOID
from rope_twin.core.state import (
    BLOCK,
    DIRECTION,
    ELEMENTS,
    FLOW,
    RESIDUAL,
    REST,
    TANGENT,
    VELOCITY,
    VOLUME,
    Floats,
)
from rope_twin.quantity import quantity

CARRIED = 4  # φ and its rate, m and its rate
# Rows of its own: prediction of φ and m, 1/d, and ½·ρ·d·l·C_d [kg/m].
PHASE_HAT, SQUARE_HAT, PER_DIAMETER, STRENGTH = range(3 * CARRIED + 1, 3 * CARRIED + 5)
OWN_ROWS = 4
UNKNOWN = -1.0  # a rate of φ before the first stage
SHEDS_FROM, STROUHAL_TO = 40.0, 1e6  # Reynolds numbers


@dataclass(frozen=True, kw_only=True)
class StrouhalForcingParams:
    """Coefficients over the rope's drag."""

    lift_over_drag: float = quantity("λ = C_L/C_d", "", 0.0, 1.0, default=0.6)
    in_line: float = quantity("C'_d, oscillating drag over mean drag", "", 0.0, 1.0, default=0.1)
    drag: float | None = quantity(
        "C_d that both are of; absent: `normal` of the effect `drag`", "", 0.0, 10.0, default=None
    )
    limit_diameters: float | None = quantity(
        "amplitude at which the lift ends; absent: λ is fixed", "", 0.01, 10.0, default=1.0
    )
    strouhal: float = quantity("St for 40 < Re <= 1e6", "", 0.05, 0.5, default=0.2)
    strouhal_rise: float = quantity("what St gains from Re 1e6 to 1e7", "", 0.0, 1.0, default=0.0)
    viscosity_m2_per_s: float = quantity("of the water, ν", "m²/s", 1e-7, 1e-4, default=1.3e-6)

    @property
    def strouhal_number(self) -> float:
        """What sets the pace of the vortices."""
        return self.strouhal


class StrouhalForcing(NamedTuple):
    """What the kernels see."""

    memory: Floats  # see CARRIED and the rows after it, (rows, nodes)
    lift: float  # λ
    in_line: float  # C'_d
    strength: float  # ½·ρ·C_d [kg/m³]
    per_limit: float  # 1/a, 0: λ is fixed
    strouhal: float
    rise: float  # dSt/dRe above Re 1e6
    per_viscosity: float  # [s/m²]


def build(params: StrouhalForcingParams, payload: Any, around: Any) -> StrouhalForcing:
    """From the coefficients and the rope's drag."""
    drag = around.drag_normal if params.drag is None else params.drag
    limit = params.limit_diameters
    return StrouhalForcing(
        memory=new_memory(CARRIED, OWN_ROWS, around.room),
        lift=float(params.lift_over_drag),
        in_line=float(params.in_line),
        strength=float(0.5 * around.water_density_kg_per_m3 * drag),
        per_limit=0.0 if limit is None else 1.0 / limit,
        strouhal=float(params.strouhal),
        rise=float(params.strouhal_rise / 9e6),
        per_viscosity=1.0 / params.viscosity_m2_per_s,
    )


remembering(StrouhalForcing, CARRIED)


@kernel("start", StrouhalForcing)
def start(shed: Any, rope: Any) -> None:
    """φ = 0 and no vibration yet: no lift acts on the rope at rest. The water is not known yet."""
    for i in range(rope.state.counts[ELEMENTS]):
        for k in range(CARRIED):
            shed.memory[k, i] = 0.0
        shed.memory[1, i] = UNKNOWN


@jit_within
def frequency(shed: Any, speed: float, per_diameter: float) -> Any:
    """f [Hz] at a speed across the rope; 0 where nothing is shed."""
    re = speed * shed.per_viscosity / (per_diameter + NONE_AT_ALL)
    strouhal = shed.strouhal + shed.rise * max(re - STROUHAL_TO, 0.0)
    return strouhal * speed * per_diameter if re > SHEDS_FROM else 0.0


@jit_within
def _across(u: Any, v: Any, w: Any, x: Any, y: Any, z: Any) -> Any:
    """v_n and v × t of a relative velocity and a tangent, and |v_n|."""
    along = u * x + v * y + w * z
    u, v, w = u - along * x, v - along * y, w - along * z
    lift = (v * z - w * y, w * x - u * z, u * y - v * x)
    return (u, v, w), lift, sqrt(u * u + v * v + w * w + STILL2)


@jit
def _first_rate(shed: Any, rope: Any, i: int) -> Any:
    """2π·f of a node as it starts [rad/s]."""
    work, nodes, low = rope.work, rope.state.nodes, max(i - 1, 0)
    x = work[DIRECTION, i] + work[DIRECTION, low]
    y = work[DIRECTION + 1, i] + work[DIRECTION + 1, low]
    z = work[DIRECTION + 2, i] + work[DIRECTION + 2, low]
    inverse = 1.0 / sqrt(x * x + y * y + z * z + FOLDED2)
    _, _, speed = _across(
        work[FLOW, i] - nodes[VELOCITY, i], work[FLOW + 1, i] - nodes[VELOCITY + 1, i],
        work[FLOW + 2, i] - nodes[VELOCITY + 2, i], inverse * x, inverse * y, inverse * z,
    )  # fmt: skip
    return 2.0 * pi * frequency(shed, speed, shed.memory[PER_DIAMETER, i])


@kernel("predict", StrouhalForcing)
def predict(shed: Any, rope: Any, stage: Any, kind: int, low: int, high: int) -> None:
    """What a stage starts from, as of the rope; and what stays while it is solved."""
    memory, work, c = shed.memory, rope.work, stage.q
    for i in range(low, high):
        length = 0.5 * (work[REST, i] + work[REST, i - 1]) if i > 0 else 0.5 * work[REST, i]
        memory[PER_DIAMETER, i] = sqrt(0.25 * pi * length / (work[VOLUME, i] + NONE_AT_ALL))
        memory[STRENGTH, i] = shed.strength * length / memory[PER_DIAMETER, i]
        if memory[1, i] == UNKNOWN:
            memory[1, i] = _first_rate(shed, rope, i)
        for k in range(2):
            value, rate = memory[2 * k, i], memory[2 * k + 1, i]
            if kind == TRAPEZOID:
                memory[PHASE_HAT + k, i] = value + c * rate
            else:
                memory[PHASE_HAT + k, i] = K1 * memory[CARRIED + 2 * k, i] - K2 * value


@jit_within
def _solve(shed: Any, c: float, i: int, water: Any, across: Any) -> Any:
    """Phase and its rate, m and its rate, λ, and whether vortices are shed (1 or 0), at a node.

    water: |v_n|; across: the node's velocity along the lift [m/s].
    """
    memory = shed.memory
    f = frequency(shed, water, memory[PER_DIAMETER, i])
    phase = memory[PHASE_HAT, i] + c * 2.0 * pi * f
    square = (memory[SQUARE_HAT, i] + c * f * across * across) / (1.0 + c * f)
    amplitude = sqrt(2.0 * max(square, 0.0)) / (2.0 * pi * f + UNSHED)
    share = max(1.0 - shed.per_limit * amplitude * memory[PER_DIAMETER, i], 0.0)
    sheds = 1.0 if f > 0.0 else 0.0
    growth = f * (across * across - square)
    return phase, 2.0 * pi * f, square, growth, sheds * share * shed.lift, sheds


@kernel("load_nodes", StrouhalForcing)
def load_nodes(shed: Any, work: Any, stage: Any, low: int, high: int) -> None:
    """F = k·|v_n|·(λ·sin φ·(v × t) + C'_d·sin 2φ·v_n), k = ½·ρ·d·l·C_d; A = q_w·k times the
    symmetric part of λ·sin φ·(v × t) ⊗ n + C'_d·sin 2φ·|v_n|·(I - t tᵀ + n ⊗ n), n = v_n/|v_n|,
    where sin φ and sin 2φ in front of ⊗ n have what φ turns with the speed, q_w·φ', besides.
    """
    vx, vy, vz = rows(work, VELOCITY, low)
    ux, uy, uz = rows(work, FLOW, low)
    tx, ty, tz = rows(work, TANGENT, low)
    Rx, Ry, Rz = rows(work, RESIDUAL, low)
    Axx, Axy, Axz, Ayy, Ayz, Azz = span(work, BLOCK, 6, low)
    for i in range(high - low):
        x, y, z = tx[i], ty[i], tz[i]
        n, l, speed = _across(ux[i] - vx[i], uy[i] - vy[i], uz[i] - vz[i], x, y, z)
        across = (vx[i] * l[0] + vy[i] * l[1] + vz[i] * l[2]) / speed
        phase, rate, _, _, share, sheds = _solve(shed, stage.q, low + i, speed, across)
        k, s, co = shed.memory[STRENGTH, low + i], sin(phase), cos(phase)
        lift, line = k * share * s, k * sheds * shed.in_line * 2.0 * s * co
        Rx[i] += speed * (lift * l[0] + line * n[0])
        Ry[i] += speed * (lift * l[1] + line * n[1])
        Rz[i] += speed * (lift * l[2] + line * n[2])
        turn = stage.q * rate  # of the phase, for a change of the speed by itself
        lift += turn * k * share * co
        line += turn * k * sheds * shed.in_line * 2.0 * (co * co - s * s)
        fx, fy, fz = lift * l[0] + line * n[0], lift * l[1] + line * n[1], lift * l[2] + line * n[2]
        g, h = 0.5 * stage.q / speed, stage.q * k * sheds * shed.in_line * 2.0 * s * co * speed
        Axx[i] += 2.0 * g * fx * n[0] + h * (1.0 - x * x)
        Axy[i] += g * (fx * n[1] + fy * n[0]) - h * x * y
        Axz[i] += g * (fx * n[2] + fz * n[0]) - h * x * z
        Ayy[i] += 2.0 * g * fy * n[1] + h * (1.0 - y * y)
        Ayz[i] += g * (fy * n[2] + fz * n[1]) - h * y * z
        Azz[i] += 2.0 * g * fz * n[2] + h * (1.0 - z * z)


@kernel("settle", StrouhalForcing)
def settle(shed: Any, rope: Any, stage: Any, kind: int) -> None:
    """φ and m of the solved stage."""
    memory, work, n = shed.memory, rope.work, rope.state.counts[ELEMENTS]
    for i in range(n):
        v = (work[VELOCITY, i], work[VELOCITY + 1, i], work[VELOCITY + 2, i])
        _, l, speed = _across(
            work[FLOW, i] - v[0], work[FLOW + 1, i] - v[1], work[FLOW + 2, i] - v[2],
            work[TANGENT, i], work[TANGENT + 1, i], work[TANGENT + 2, i],
        )  # fmt: skip
        across = (v[0] * l[0] + v[1] * l[1] + v[2] * l[2]) / speed
        phase, rate, square, growth, _, _ = _solve(shed, stage.q, i, speed, across)
        memory[CARRIED, i], memory[CARRIED + 1, i] = phase, rate
        memory[CARRIED + 2, i], memory[CARRIED + 3, i] = square, growth
    _set_trials(shed, rope)


@jit
def _set_trials(shed: Any, rope: Any) -> None:
    """The vortices at the trial nodes are those of the highest free node, per metre."""
    memory, top = shed.memory, rope.state.counts[ELEMENTS] - 1
    per_metre = 1.0 / (0.5 * (rope.work[REST, top] + rope.work[REST, top - 1]))
    set_trials(memory, PHASE_HAT, memory[CARRIED, top], rope)
    set_trials(memory, SQUARE_HAT, memory[CARRIED + 2, top], rope)
    set_trials(memory, PER_DIAMETER, memory[PER_DIAMETER, top], rope)
    set_trials(memory, STRENGTH, per_metre * memory[STRENGTH, top], rope)


@account("power", StrouhalForcing)
def power(shed: Any, place: Any) -> Any:
    """Lift and oscillating drag times velocity [W]; the hang-off sheds as the node below."""
    n = place.position.shape[1]
    phase, square = shed.memory[0, :n].copy(), shed.memory[2, :n].copy()
    if n > 1:
        phase[-1], square[-1] = phase[-2], square[-2]
    length = place.length
    d = np.sqrt(4.0 / pi * place.volume / length)
    u = place.flow - place.velocity
    normal = u - (u * place.tangent).sum(axis=0) * place.tangent
    lift = np.cross(u, place.tangent, axis=0)
    speed = np.sqrt((normal * normal).sum(axis=0))
    re = speed * d * shed.per_viscosity
    strouhal = shed.strouhal + shed.rise * np.maximum(re - STROUHAL_TO, 0.0)
    f = np.where(re > SHEDS_FROM, strouhal * speed / d, 0.0)
    amplitude = np.sqrt(2.0 * square) / (2.0 * pi * f + UNSHED)
    share = shed.lift * np.maximum(1.0 - shed.per_limit * amplitude / d, 0.0)
    force = share * np.sin(phase) * lift + shed.in_line * np.sin(2.0 * phase) * normal
    force *= f > 0.0
    return (shed.strength * d * length * speed * force * place.velocity).sum(axis=0)
