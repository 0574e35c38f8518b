"""Strouhal forcing: lift and oscillating drag at the Strouhal frequency.

[UWCFSI] Laird, Fraser and Marsh (2016), eqs 6-14. With the normal component v_n of the water
velocity relative to the rope (the paper does not specify it; this is the cross-flow principle of
its drag):

    Re = |v_n|·d/ν,  f = St(Re)·|v_n|/d,  φ' = 2π·f,  F_d = ½·ρ·d·C_d·|v_n|² per metre
    lift λ·F_d·sin φ along (v × t)/|v × t|,  in line C'_d·F_d·sin 2φ along v_n/|v_n|

The paper writes sin(2π·f·t); f changes in time and along the rope, so φ is the integral of 2π·f at
each node. St is 0.2 for 40 < Re <= 1e6 and linear in Re above; below 40 there is no shedding, and φ
is constant. The paper gives no slope: `strouhal_rise` is the increase of St from Re 1e6 to 1e7.

λ = C_L/C_d is fixed (`fixed_lift`), or decreases with the cross-flow amplitude A of the node, λ·(1
- A/(a·d)) and 0 beyond: [LCD] eq 20, C_l = C0 - C1·|A|/d, has a = C0/C1 = 1 diameter. A =
√(2·m)/(2π·f) with the running mean m of the squared velocity along the lift, over one shedding
period.

φ and m are solved with the rope in each stage (TR-BDF2). Omitted in the block: its skew part, and
the change of m and of the tangent with the motion.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, pi, sin, sqrt
from typing import Any, NamedTuple

import numpy as np

from rope_twin.core.integrator import K1, K2, TRAPEZOID
from rope_twin.core.jit.decorators import jit, jit_within
from rope_twin.core.jit.rows import rows
from rope_twin.core.jit.wide import choose
from rope_twin.core.loads.accounts import account
from rope_twin.core.loads.balance import add_to_node
from rope_twin.core.loads.hooks import VORTICES, Load, kernel, scales_with_ramp, wide_kernel
from rope_twin.core.loads.memory import count_initialised, declare_internal_variables, new_memory
from rope_twin.core.payout import set_trials
from rope_twin.core.state import (
    DIRECTION,
    DIVISOR_MIN,
    ELEMENTS,
    FLOW,
    REST,
    SHEDDING_MIN,
    SPEED2_MIN,
    TANGENT,
    TANGENT2_MIN,
    VELOCITY,
    VOLUME,
    Floats,
)
from rope_twin.quantity import quantity, text

CARRIED = 4  # φ and its rate, m and its rate
# Further rows: prediction of φ and m, 1/d, and ½·ρ·d·l·C_d [kg/m].
PHASE_HAT, SQUARE_HAT, PER_DIAMETER, STRENGTH = range(3 * CARRIED + 1, 3 * CARRIED + 5)
OWN_ROWS = 4
UNKNOWN = -1.0  # marks the rate of φ before the first stage
SHEDS_FROM, STROUHAL_TO = 40.0, 1e6  # Reynolds numbers


@dataclass(frozen=True, kw_only=True)
class StrouhalForcingParams:
    """Lift and oscillating drag coefficients, and the Strouhal number."""

    lift_over_drag: float = quantity("lift over drag λ = C_L/C_d", "", 0.0, 1.0, default=0.6)
    in_line: float = quantity("C'_d: oscillating over mean drag", "", 0.0, 1.0, default=0.1)
    drag: float | None = quantity(
        "C_d of both; default: `normal` of the effect `drag`", "", 0.0, 10.0, default=None
    )
    limit_diameters: float = quantity("A/d at which the lift vanishes", "", 0.01, 10.0, default=1.0)
    fixed_lift: bool = text("λ that does not fall with the amplitude, as in eq 11", False)
    strouhal: float = quantity("St for 40 < Re <= 1e6", "", 0.05, 0.5, default=0.2)
    strouhal_rise: float = quantity("increase of St from Re 1e6 to 1e7", "", 0.0, 1.0, default=0.0)
    viscosity_m2_per_s: float = quantity(
        "kinematic viscosity ν of water", "m²/s", 1e-7, 1e-4, default=1.3e-6
    )

    @property
    def strouhal_number(self) -> float:
        """Return the Strouhal number of the vortex shedding."""
        return self.strouhal


class StrouhalForcing(NamedTuple):
    """Kernel data of the Strouhal forcing."""

    memory: Floats  # see CARRIED and the rows after it, (rows, nodes)
    lift: float  # λ
    in_line: float  # C'_d
    strength: float  # ½·ρ·C_d [kg/m³]
    per_limit: float  # 1/a, 0: λ is fixed
    strouhal: float
    rise: float  # dSt/dRe above Re 1e6
    per_viscosity: float  # [s/m²]


def build(params: StrouhalForcingParams, payload: Any, environment: Any) -> StrouhalForcing:
    """Return the kernel data for the coefficients and the rope's drag."""
    drag = environment.drag_normal if params.drag is None else params.drag
    return StrouhalForcing(
        memory=new_memory(CARRIED, OWN_ROWS, environment.room),
        lift=float(params.lift_over_drag),
        in_line=float(params.in_line),
        strength=float(0.5 * environment.water_density_kg_per_m3 * drag),
        per_limit=0.0 if params.fixed_lift else 1.0 / params.limit_diameters,
        strouhal=float(params.strouhal),
        rise=float(params.strouhal_rise / 9e6),
        per_viscosity=1.0 / params.viscosity_m2_per_s,
    )


scales_with_ramp(StrouhalForcing, "strength", factor=VORTICES)
declare_internal_variables(StrouhalForcing, CARRIED)


@kernel("start", StrouhalForcing)
def start(shed: Any, rope: Any, upto: int) -> None:
    """Initialise φ = 0 without vibration, hence no lift; the water is not known yet."""
    for i in range(upto):
        for k in range(CARRIED):
            shed.memory[k, i] = 0.0
        shed.memory[1, i] = UNKNOWN


@jit_within
def frequency(shed: Any, speed: float, per_diameter: float) -> Any:
    """Return f [Hz] at a normal speed; 0 where there is no shedding."""
    re = speed * shed.per_viscosity / (per_diameter + DIVISOR_MIN)
    strouhal = shed.strouhal + shed.rise * max(re - STROUHAL_TO, 0.0)
    return choose(re > SHEDS_FROM, strouhal * speed * per_diameter, 0.0)


@jit_within
def _across(u: Any, v: Any, w: Any, x: Any, y: Any, z: Any) -> Any:
    """Return v_n and v × t of a relative velocity and a tangent, and |v_n|."""
    along = u * x + v * y + w * z
    u, v, w = u - along * x, v - along * y, w - along * z
    lift = (v * z - w * y, w * x - u * z, u * y - v * x)
    return (u, v, w), lift, sqrt(u * u + v * v + w * w + SPEED2_MIN)


@jit
def _first_rate(shed: Any, rope: Any, i: int) -> Any:
    """Return the initial 2π·f of a node [rad/s]."""
    work, nodes, low = rope.work, rope.state.nodes, max(i - 1, 0)
    x = work[DIRECTION, i] + work[DIRECTION, low]
    y = work[DIRECTION + 1, i] + work[DIRECTION + 1, low]
    z = work[DIRECTION + 2, i] + work[DIRECTION + 2, low]
    inverse = 1.0 / sqrt(x * x + y * y + z * z + TANGENT2_MIN)
    _, _, speed = _across(
        work[FLOW, i] - nodes[VELOCITY, i], work[FLOW + 1, i] - nodes[VELOCITY + 1, i],
        work[FLOW + 2, i] - nodes[VELOCITY + 2, i], inverse * x, inverse * y, inverse * z,
    )  # fmt: skip
    return 2.0 * pi * frequency(shed, speed, shed.memory[PER_DIAMETER, i])


@kernel("predict", StrouhalForcing)
def predict(shed: Any, rope: Any, stage: Any, kind: int, low: int, high: int) -> None:
    """Set the explicit parts of φ and m, and the quantities that are constant in the stage."""
    for i in range(low, high):
        _set_size(shed, rope.work, stage, i)
        if shed.memory[1, i] == UNKNOWN:
            shed.memory[1, i] = _first_rate(shed, rope, i)
        _set_hats(shed, stage, kind, i)


@wide_kernel("predict", StrouhalForcing)
def predict_wide(shed: Any, rope: Any, stage: Any, kind: int, low: int, high: int) -> None:
    """Do the same in lanes, which do not take the step that begins with an unknown rate."""
    for i in range(low, high):
        _set_size(shed, rope.work, stage, i)
        _set_hats(shed, stage, kind, i)


@jit_within
def _set_size(shed: Any, work: Any, stage: Any, i: int) -> None:
    """Set 1/d and the strength of a node."""
    memory = shed.memory
    length = 0.5 * (work[REST, i] + work[REST, i - 1]) if i > 0 else 0.5 * work[REST, i]
    memory[PER_DIAMETER, i] = sqrt(0.25 * pi * length / (work[VOLUME, i] + DIVISOR_MIN))
    memory[STRENGTH, i] = shed.strength * length / memory[PER_DIAMETER, i]
    if stage.time <= 0.0:  # static equilibrium, sought in long steps
        memory[STRENGTH, i] = 0.0


@jit_within
def _set_hats(shed: Any, stage: Any, kind: int, i: int) -> None:
    """Set the explicit parts of φ and m of a node."""
    memory = shed.memory
    for k in range(2):
        value, rate = memory[2 * k, i], memory[2 * k + 1, i]
        if kind == TRAPEZOID:
            memory[PHASE_HAT + k, i] = value + stage.q * rate
        else:
            memory[PHASE_HAT + k, i] = K1 * memory[CARRIED + 2 * k, i] - K2 * value


@jit_within
def _solve(shed: Any, c: float, i: int, water: Any, across: Any) -> Any:
    """Return phase, its rate, m, its rate, λ, and whether a node sheds vortices (1 or 0).

    water: |v_n|; across: the node's velocity along the lift [m/s].
    """
    memory = shed.memory
    f = frequency(shed, water, memory[PER_DIAMETER, i])
    phase = memory[PHASE_HAT, i] + c * 2.0 * pi * f
    square = (memory[SQUARE_HAT, i] + c * f * across * across) / (1.0 + c * f)
    amplitude = sqrt(2.0 * max(square, 0.0)) / (2.0 * pi * f + SHEDDING_MIN)
    share = max(1.0 - shed.per_limit * amplitude * memory[PER_DIAMETER, i], 0.0)
    sheds = choose(f > 0.0, 1.0, 0.0)
    growth = f * (across * across - square)
    return phase, 2.0 * pi * f, square, growth, sheds * share * shed.lift, sheds


@kernel("load_nodes", StrouhalForcing, wide=True)
def load_nodes(shed: Any, work: Any, stage: Any, low: int, high: int) -> None:
    """Add F = k·|v_n|·(λ·sin φ·(v × t) + C'_d·sin 2φ·v_n), k = ½·ρ·d·l·C_d, and its block.

    A = q_w·k times the symmetric part of λ·sin φ·(v × t) ⊗ n + C'_d·sin 2φ·|v_n|·(I - t tᵀ + n ⊗
    n), n = v_n/|v_n|, where sin φ and sin 2φ before ⊗ n also include the derivative of φ to the
    speed, q_w·φ'.
    """
    vx, vy, vz = rows(work, VELOCITY, low)
    ux, uy, uz = rows(work, FLOW, low)
    tx, ty, tz = rows(work, TANGENT, low)
    for i in range(high - low):
        x, y, z = tx[i], ty[i], tz[i]
        n, l, speed = _across(ux[i] - vx[i], uy[i] - vy[i], uz[i] - vz[i], x, y, z)
        across = (vx[i] * l[0] + vy[i] * l[1] + vz[i] * l[2]) / speed
        phase, rate, _, _, share, sheds = _solve(shed, stage.q, low + i, speed, across)
        k, s, co = shed.memory[STRENGTH, low + i], sin(phase), cos(phase)
        lift, line = k * share * s, k * sheds * shed.in_line * 2.0 * s * co
        fx = speed * (lift * l[0] + line * n[0])
        fy = speed * (lift * l[1] + line * n[1])
        fz = speed * (lift * l[2] + line * n[2])
        turn = stage.q * rate  # derivative of the phase to the logarithm of the speed
        lift += turn * k * share * co
        line += turn * k * sheds * shed.in_line * 2.0 * (co * co - s * s)
        dx, dy, dz = lift * l[0] + line * n[0], lift * l[1] + line * n[1], lift * l[2] + line * n[2]
        g, h = 0.5 * stage.q / speed, stage.q * k * sheds * shed.in_line * 2.0 * s * co * speed
        add_to_node(work, low + i, Load(
            fx, fy, fz,
            2.0 * g * dx * n[0] + h * (1.0 - x * x),
            g * (dx * n[1] + dy * n[0]) - h * x * y, g * (dx * n[2] + dz * n[0]) - h * x * z,
            2.0 * g * dy * n[1] + h * (1.0 - y * y),
            g * (dy * n[2] + dz * n[1]) - h * y * z,
            2.0 * g * dz * n[2] + h * (1.0 - z * z),
        ))  # fmt: skip


@kernel("settle", StrouhalForcing, wide=True)
def settle(shed: Any, rope: Any, stage: Any, kind: int, upto: int) -> None:
    """Store φ and m of the converged stage."""
    memory, work = shed.memory, rope.work
    for i in range(upto):
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
    """Copy the shedding state of the highest free node to the ghost nodes, per metre."""
    memory, top = shed.memory, rope.state.counts[ELEMENTS] - 1
    per_metre = 1.0 / (0.5 * (rope.work[REST, top] + rope.work[REST, top - 1]))
    set_trials(memory, PHASE_HAT, memory[CARRIED, top], rope)
    set_trials(memory, SQUARE_HAT, memory[CARRIED + 2, top], rope)
    set_trials(memory, PER_DIAMETER, memory[PER_DIAMETER, top], rope)
    set_trials(memory, STRENGTH, per_metre * memory[STRENGTH, top], rope)


@account("power", StrouhalForcing)
def power(shed: Any, place: Any) -> Any:
    """Return the power of lift and oscillating drag [W]; the hang-off sheds like the node below."""
    n = place.position.shape[1]
    phase, square = shed.memory[0, :n].copy(), shed.memory[2, :n].copy()
    if count_initialised(shed) != n:
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
    amplitude = np.sqrt(2.0 * square) / (2.0 * pi * f + SHEDDING_MIN)
    share = shed.lift * np.maximum(1.0 - shed.per_limit * amplitude / d, 0.0)
    force = share * np.sin(phase) * lift + shed.in_line * np.sin(2.0 * phase) * normal
    force *= f > 0.0
    return (shed.strength * d * length * speed * force * place.velocity).sum(axis=0)
