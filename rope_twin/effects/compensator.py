"""Heave compensator at the hook: a gas spring between the rope's end and the payload, or an active
cylinder over it.

The rope's lowest section is the unit: its length is that from eye to eye with the rod retracted,
its mass, diameter and breaking load are those of cylinder and rod, and it is one element of the
mesh, whose extension beyond that length is the stroke x. Half of its mass moves with the rope's end
and half with the payload. Such units are reviewed by Woodacre et al. (2015, Ocean Eng. 104, 140).
Its tension is

    T = max(0, G(s) + N(x) + c_1·v + c_2·|v|·v + F_f + p_w·A_rod + F_a),   s = x within 0 ... S.

Gas of pressure p and volume V behind a piston of area A, of an ideal gas in a polytropic process,
p·V^n = const, with n = 1 isothermal, for slow changes, and 1.4 adiabatic, for nitrogen:

    G = p_0·A·(V_0/V)^n,   V = V_0 - A·(s - S/2),   dG/ds = n·G·A/V,

with pressure p_0 and volume V_0 at mid stroke; p is above the pressure on the piston's other side.
The oil between piston and gas throttles with c_1 and c_2 of the stroke's rate v.

Where the piston meets the end of its cylinder the stop deforms and the gas does not: N =
k·d·max(1 + χ·v, 0) beyond the stroke's end, and the other way before its beginning, with the
penetration d and the unit's axial stiffness k = EA/length (contact with damping of Hunt and
Crossley 1975, ASME J. Appl. Mech. 42, 440). So a retracted unit is rigid up to its preload G(0).

The seals stick: elastic up to a displacement z_0, then Coulomb's, F_f = F_c·z/z_0 with z = z_before
+ (s - s_before), limited to ±z_0. z is solved in the stage, with the position. At rest F_f keeps
what it has; in static equilibrium at the start it is 0.

The rod of a unit that is not depth-compensated enters the cylinder against the water, whose
pressure p_w = ρ·g·depth on its area A_rod adds to the tension.

An active cylinder beside the gas (active over passive) drives the stroke at the speed that a sensor
on the unit's upper end commands, with a gain K and within its force:

    F_a = K·(v - v_c), at most F_max,   τ·dv_c/dt = η·(u - m) - v_c,   τ_w·dm/dt = u - m,

with the sensor's vertical speed u, of which m, what changes more slowly than τ_w, is lowering and
not heave. v_c is within the cylinder's speed, and within √(2·a·d) at the distance d from the stop
ahead, so that it can brake at a. The command in a stage is predicted from its start, as that of a
controller; u and m follow in TR-BDF2. On a stiff rope the payload follows the heave by

    (k + iω·(c_1 + K·(1 - η·H)))/(k - M·ω² + iω·(c_1 + K)),   H = iωτ_w/((1 + iωτ_w)·(1 + iωτ)).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import Any, NamedTuple

import numpy as np

from rope_twin.core.integrator import GAMMA, K1, K2, TRAPEZOID
from rope_twin.core.jit.decorators import jit_within
from rope_twin.core.jit.rows import column
from rope_twin.core.jit.wide import choose
from rope_twin.core.loads.accounts import lowest_account
from rope_twin.core.loads.hooks import kernel
from rope_twin.core.loads.memory import declare_internal_variables, new_memory
from rope_twin.core.state import DIVISOR_MIN, POSITION, VELOCITY, Floats
from rope_twin.quantity import SparingRepr, quantity, text

# Rows of memory, in the column of the lower end: z, m and v_c, carried, and the effect's own: z and
# s before the stage, s and u of the stage, whether the seals act (1; not before time 0), command.
CARRIED = 3
SEALS, MEAN, COMMANDED = range(CARRIED)
BEFORE, PISTON, REACHED, SENSED, ACTS, COMMAND = (3 * CARRIED + 1 + k for k in range(6))
OWN_ROWS = 6
TO_END = 2.0 * (1.0 - GAMMA) / GAMMA  # from the middle of a step to its end, over the weight q


@dataclass(frozen=True, kw_only=True)
class ActiveCylinder:
    """Active cylinder beside the gas: follows the heave of the unit's upper end."""

    efficiency: float = quantity("compensated fraction η of the heave velocity", "", 0.0, 1.2)
    lag_s: float = quantity("first-order lag of measurement and drive", "s", 0.0, 10.0)
    washout_s: float = quantity(
        "time constant that separates heave from lowering", "s", 1.0, 1e4, default=60.0
    )
    gain_newton_seconds_per_m: float = quantity(
        "force per error of the stroke's rate", "N·s/m", 0.0, 1e9
    )
    force_limit_n: float = quantity("maximum force in both directions", "N", 1.0, 1e8)
    speed_limit_m_per_s: float = quantity("maximum speed in both directions", "m/s", 0.01, 10.0)
    braking_m_per_s2: float = quantity(
        "deceleration ahead of the end stops", "m/s²", 0.01, 50.0, default=1.0
    )


@dataclass(frozen=True, kw_only=True, repr=False)
class GasSpringParams(SparingRepr):
    """Gas spring with oil damping, seals and end stops, at the hook or at the winch."""

    stroke_m: float = quantity("stroke between the end stops", "m", 0.05, 30.0)
    piston_area_m2: float = quantity("area of the piston that the gas acts on", "m²", 1e-5, 10.0)
    gas_pressure_pa: float = quantity(
        "gas pressure at mid stroke, above that on the piston's other side", "Pa", 1e3, 1e8
    )
    gas_volume_m3: float = quantity("gas volume at mid stroke", "m³", 1e-5, 1e3)
    exponent: float = quantity(
        "polytropic exponent n of p·V^n: 1 isothermal, 1.4 adiabatic", "", 1.0, 1.7
    )
    damping_newton_seconds_per_m: float = quantity(
        "linear damping of the stroke", "N·s/m", 0.0, 1e9, default=0.0
    )
    throttling_kg_per_m: float = quantity(
        "quadratic damping of the stroke, F = c·|v|·v", "kg/m", 0.0, 1e9, default=0.0
    )
    friction_n: float = quantity("friction of the seals while they slide", "N", 0.0, 1e7,
                                 default=0.0)  # fmt: skip
    friction_slip_m: float = quantity(
        "displacement at which the seals slide", "m", 1e-4, 0.5, default=0.005
    )
    stop_damping_s_per_m: float = quantity(
        "damping χ of the end stops, N = k·d·(1 + χ·v)", "s/m", 0.0, 10.0, default=1.0
    )

    def check(self) -> str | None:
        """Return the fault and its remedy, or None."""
        swept = 0.5 * self.piston_area_m2 * self.stroke_m
        if self.gas_volume_m3 > swept:
            return None
        return (
            f"gas_volume_m3 is {self.gas_volume_m3:g} m³ at mid stroke and half the stroke "
            f"sweeps {swept:g} m³; give more gas, a smaller piston or a shorter stroke"
        )

    def tension_n(self, stroke_m: float) -> float:
        """Return the gas force [N] at a stroke."""
        return forces(of(self), stroke_m, 0.0, 1.0, 0.0).gas


@dataclass(frozen=True, kw_only=True, repr=False)
class CompensatorParams(GasSpringParams):
    """Heave compensator; the rope's lowest section gives its length, mass and stiffness."""

    _later = frozenset(("active",))

    rod_area_m2: float | None = quantity(
        "area of the rod that the water's pressure acts on; default: depth-compensated, none",
        "m²", 1e-6, 10.0, default=None,
    )  # fmt: skip
    active: ActiveCylinder | None = text(
        "active cylinder over the passive one; default: passive alone", None
    )


class Compensator(NamedTuple):
    """Kernel data of a heave compensator."""

    memory: Floats  # see CARRIED and the rows after it
    stroke: float  # S [m]
    area: float  # A [m²]
    force: float  # p_0·A [N]
    volume: float  # V_0 [m³]
    n: float
    c1: float  # [N·s/m]
    c2: float  # [kg/m]
    seal: float  # F_c/z_0 [N/m]
    slip: float  # z_0 [m]
    chi: float  # χ of the stops [s/m]
    water: float  # ρ·g·A_rod [N/m]
    gain: float  # K [N·s/m]; 0: there is no active cylinder
    force_limit: float  # F_max [N]
    speed_limit: float  # [m/s]
    braking: float  # a [m/s²]
    efficiency: float  # η
    lag: float  # τ [s]
    washout: float  # τ_w [s]
    here: float = 1.0  # whether the lowest element is the unit; 0 above a cut


class CompensatorForces(NamedTuple):
    """Parts of the tension, positive in extension [N], and the gas pressure."""

    stroke: float  # of the piston [m]
    gas: float
    stop: float
    damper: float
    seal: float
    water: float
    active: float
    pressure_pa: float

    @property
    def pull(self) -> float:
        """Return their sum, negative where the unit is slack [N]."""
        return self.gas + self.stop + self.damper + self.seal + self.water + self.active


def of(params: GasSpringParams, weight_n_per_m3: float = 0.0, room: int = 1) -> Compensator:
    """Return the kernel data of a unit in water of this weight per volume."""
    slip = float(params.friction_slip_m)
    rod_area_m2, active = 0.0, None
    if isinstance(params, CompensatorParams):
        rod_area_m2, active = params.rod_area_m2 or 0.0, params.active
    return Compensator(
        new_memory(CARRIED, OWN_ROWS, room),
        float(params.stroke_m),
        float(params.piston_area_m2),
        float(params.gas_pressure_pa * params.piston_area_m2),
        float(params.gas_volume_m3),
        float(params.exponent),
        float(params.damping_newton_seconds_per_m),
        float(params.throttling_kg_per_m),
        float(params.friction_n / slip),
        slip,
        float(params.stop_damping_s_per_m),
        float(weight_n_per_m3 * rod_area_m2),
        *(
            (0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 1.0)
            if active is None
            else (
                float(active.gain_newton_seconds_per_m),
                float(active.force_limit_n),
                float(active.speed_limit_m_per_s),
                float(active.braking_m_per_s2),
                float(active.efficiency),
                float(active.lag_s),
                float(active.washout_s),
            )
        ),
    )


def build(params: CompensatorParams, payload: Any, environment: Any) -> Compensator:
    """Return the kernel data of the unit in the scene's water."""
    weight = environment.water_density_kg_per_m3 * environment.gravity_m_per_s2
    return of(params, weight, environment.room)


@jit_within
def _gas(unit: Any, s: Any) -> Any:
    """Return G [N] and dG/ds [N/m] at a position of the piston."""
    volume = unit.volume - unit.area * (s - 0.5 * unit.stroke)
    force = unit.force * (unit.volume / volume) ** unit.n
    return force, unit.n * force * unit.area / volume


@jit_within
def _piston(unit: Any, extension: Any) -> Any:
    """Return s, the position of the piston between its stops [m]."""
    return min(max(extension, 0.0), unit.stroke)


@jit_within
def _seals(unit: Any, s: Any) -> Any:
    """Return z [m] and whether the seals stick."""
    z = unit.memory[BEFORE, 0] + unit.memory[ACTS, 0] * (s - unit.memory[PISTON, 0])
    return min(max(z, -unit.slip), unit.slip), abs(z) < unit.slip


@jit_within
def _stop(unit: Any, k: Any, penetration: Any, rate: Any) -> Any:
    """Return N [N] of the stop beyond which the unit is, and its derivatives to x and v."""
    outward = choose(penetration > 0.0, 1.0, -1.0)
    factor = max(1.0 + unit.chi * outward * rate, 0.0)
    along_v = choose(factor > 0.0, k * abs(penetration) * unit.chi, 0.0)
    return k * penetration * factor, choose(abs(penetration) > 0.0, k * factor, 0.0), along_v


@jit_within
def _driven(unit: Any, rate: Any) -> Any:
    """Return F_a [N] and its derivative to the stroke's rate."""
    demand = unit.gain * (rate - unit.memory[COMMAND, 0])
    force = min(max(demand, -unit.force_limit), unit.force_limit)
    return force, choose(demand == force, unit.gain, 0.0)


@jit_within
def _within_limits(unit: Any, command: Any, s: Any) -> Any:
    """Return a commanded rate within the cylinder's speed, from which it brakes at a stop."""
    distance = choose(command > 0.0, unit.stroke - s, s)
    limit = min(unit.speed_limit, sqrt(2.0 * unit.braking * max(distance, 0.0)))
    return min(max(command, -limit), limit)


@kernel("axial", Compensator, wide=True)
def axial(unit: Any, x: Any, v: Any, weights: Any, k: Any, depth: Any) -> Any:
    """Return the force of the unit before it is bounded to a pull [N], and dT/dx + (q/p)·dT/dv.

    weights: p and q of the stage, in which the extension x changes by p and its rate v by q times
    the acceleration; k: of the stops [N/m].
    """
    p, q = weights
    s = _piston(unit, x)
    gas, k_gas = _gas(unit, s)
    stop, k_stop, c_stop = _stop(unit, k, x - s, v)
    z, sticks = _seals(unit, s)
    active, c_active = _driven(unit, v)
    inside = choose(x == s, 1.0, 0.0)
    k_seal = choose(sticks, unit.seal, 0.0)
    pull = gas + stop + (unit.c1 + unit.c2 * abs(v)) * v + unit.seal * z
    pull += unit.water * max(depth, 0.0) + active
    tangent = inside * (k_gas + unit.memory[ACTS, 0] * k_seal) + k_stop
    return pull, tangent + q / p * (unit.c1 + 2.0 * unit.c2 * abs(v) + c_stop + c_active)


@jit_within
def _extension(place: Any, rest: Any) -> Any:
    """Return the length of the lowest element beyond its unstretched length [m]."""
    x, y, z = column(place, POSITION, 1)
    u, v, w = column(place, POSITION, 0)
    x, y, z = x - u, y - v, z - w
    return sqrt(x * x + y * y + z * z) - rest


@kernel("start", Compensator)
def start(unit: Any, rope: Any, upto: int) -> None:
    """Begin with seals that hold nothing, as in static equilibrium, and without a command."""
    for k in range(CARRIED):
        unit.memory[k, 0] = 0.0
    unit.memory[ACTS, 0] = 0.0
    unit.memory[COMMAND, 0] = 0.0


@kernel("prepare", Compensator, wide=True)
def prepare(unit: Any, rope: Any, stage: Any, kind: int) -> None:
    """Set z and s before the stage, and the command; before time 0 neither acts."""
    memory, begins = unit.memory, kind == TRAPEZOID
    s = _piston(unit, _extension(rope.state.nodes, rope.state.s[1] - rope.state.s[0]))
    k = SEALS if begins else CARRIED
    memory[BEFORE, 0] = memory[k + SEALS, 0]
    memory[PISTON, 0] = s if begins else memory[REACHED, 0]
    acts = 1.0 if stage.time > 0.0 else 0.0
    memory[ACTS, 0] = acts
    seen = rope.state.nodes[VELOCITY + 2, 1] if begins else memory[SENSED, 0]
    step = stage.q * (2.0 if begins else TO_END)
    heave = unit.efficiency * (seen - memory[k + MEAN, 0])
    command = (unit.lag * memory[k + COMMANDED, 0] + step * heave) / (unit.lag + step)
    memory[COMMAND, 0] = acts * _within_limits(unit, command, memory[PISTON, 0])


@kernel("predict", Compensator, wide=True)
def predict(unit: Any, rope: Any, stage: Any, kind: int, low: int, high: int) -> None:
    """Predict nothing: the law of the element needs z before that."""


@kernel("settle", Compensator, wide=True)
def settle(unit: Any, rope: Any, stage: Any, kind: int, upto: int) -> None:
    """Store z, s, u, m and v_c of the stage."""
    memory, q = unit.memory, stage.q
    s = _piston(unit, _extension(rope.work, rope.state.s[1] - rope.state.s[0]))
    seen, before = rope.work[VELOCITY + 2, 1], rope.state.nodes[VELOCITY + 2, 1]
    m, v = memory[MEAN, 0], memory[COMMANDED, 0]
    if kind == TRAPEZOID:
        m_hat = unit.washout * m + q * (before - m)
        v_hat = unit.lag * v + q * (unit.efficiency * (before - m) - v)
    else:
        m_hat = unit.washout * (K1 * memory[CARRIED + MEAN, 0] - K2 * m)
        v_hat = unit.lag * (K1 * memory[CARRIED + COMMANDED, 0] - K2 * v)
    mean = (m_hat + q * seen) / (unit.washout + q)
    memory[CARRIED + MEAN, 0] = mean
    memory[CARRIED + COMMANDED, 0] = (v_hat + q * unit.efficiency * (seen - mean)) / (unit.lag + q)
    memory[CARRIED + SEALS, 0] = _seals(unit, s)[0]
    memory[REACHED, 0] = s
    memory[SENSED, 0] = seen


declare_internal_variables(Compensator, CARRIED)


def forces(unit: Compensator, x: float, v: float, k: float, depth: float) -> CompensatorForces:
    """Return the parts of the tension at extension x [m] and its rate v [m/s], for the seals' z.

    k: of the stops [N/m]; depth: of the unit [m].
    """
    s = min(max(x, 0.0), unit.stroke)
    volume = unit.volume - unit.area * (s - 0.5 * unit.stroke)
    gas = unit.force * (unit.volume / volume) ** unit.n
    outward = 1.0 if x > s else -1.0
    return CompensatorForces(
        stroke=s,
        gas=gas,
        stop=k * (x - s) * max(1.0 + unit.chi * outward * v, 0.0),
        damper=(unit.c1 + unit.c2 * abs(v)) * v,
        seal=unit.seal * float(unit.memory[SEALS, 0]),
        water=unit.water * max(depth, 0.0),
        active=min(
            max(unit.gain * (v - float(unit.memory[COMMAND, 0])), -unit.force_limit),
            unit.force_limit,
        ),
        pressure_pa=gas / unit.area,
    )


@lowest_account(Compensator)
def held(unit: Compensator, x: float, v: float, k: float, depth: float) -> Any:
    """Return tension, its conservative part, that of the water [N] and the stored energy [J].

    Stored is ∫G ds from mid stroke, and ½·k·d² of a stop up to the penetration at which a retracted
    unit goes slack.
    """
    parts = forces(unit, x, v, k, depth)
    tension = max(parts.pull, 0.0)
    penetration = max(x - parts.stroke, -parts.gas / k)
    ratio = (parts.gas / unit.force) ** (1.0 / unit.n)  # V_0/V
    logarithm = float(np.log(ratio))
    power = unit.n - 1.0
    # ((V_0/V)^(n-1) - 1)/(n - 1), its limit at n = 1 included
    grown = logarithm if power < DIVISOR_MIN else float(np.expm1(power * logarithm)) / power
    work = unit.force / unit.area * unit.volume * grown
    water = parts.water if tension > 0.0 else 0.0
    return tension, parts.gas + k * penetration, water, work + 0.5 * k * penetration * penetration
