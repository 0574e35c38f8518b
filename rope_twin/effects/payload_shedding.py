"""Vortices shed by a payload: a transverse force on a bluff body at its Strouhal frequency.

With the velocity u of the water relative to the payload and the unit tangent t of the rope there,

    F = ½·ρ·C_L·A·|u|·sin φ·(u × t),  φ' = 2π·f,  f = St·|u|/D

(Blevins 1990, ch. 3, for a fixed body; its lift is normal to the flow, and here lies in the plane
across the rope, in which a hanging load is free to swing). The phase is integrated in time, so that
it follows a current and a swing that change; it is not locked in to the payload's motion. Without
flow across the rope there is no force.

St and C_L (amplitude, √2 times the rms) of the body, D its width and A its projected area across
the flow. Measured: long circular cylinders St = 0.2 and rms C_L 0.3 to 0.6 below the critical
Reynolds number (Blevins 1990; Norberg 2003); long square prisms St 0.13 (Okajima 1982) and rms C_L
about 1.3 in smooth flow, less in turbulent (Vickery 1966); spheres St 0.125 to 0.2 at Re 6e3 to 3e4
(Achenbach 1974). Vortices of a short body are correlated less: the values of long ones are upper
bounds.

With `rigid_body` the force acts on the body (core/body/components.py), whose projected area is that
of its box. Of a point, φ is solved with the rope in each stage (TR-BDF2); omitted in its block: the
skew part, and the change of the tangent with the motion.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, pi, sin, sqrt
from typing import Any, NamedTuple

import numpy as np

from rope_twin.core.integrator import K1, K2, TRAPEZOID
from rope_twin.core.jit.decorators import jit_within
from rope_twin.core.jit.functions import anywhere, renewed
from rope_twin.core.jit.rows import rows
from rope_twin.core.jit.wide import choose
from rope_twin.core.loads.accounts import account
from rope_twin.core.loads.balance import add_to_node
from rope_twin.core.loads.hooks import VORTICES, Load, kernel, scales_with_ramp
from rope_twin.core.loads.memory import declare_internal_variables, new_memory
from rope_twin.core.state import FLOW, SPEED2_MIN, TANGENT, VELOCITY, Floats
from rope_twin.quantity import quantity, text

CARRIED = 2  # φ and its rate, of the lower end
HAT, ACTS = 3 * CARRIED + 1, 3 * CARRIED + 2  # explicit part of φ; 1 from time 0 on, else 0
OWN_ROWS = 2
UNKNOWN = -1.0  # marks the rate of φ before the first stage


@dataclass(frozen=True, kw_only=True)
class PayloadSheddingParams:
    """Strouhal number and lift of a payload, and its size across the flow."""

    strouhal: float = quantity("Strouhal number St, on the diameter", "", 0.01, 1.0)
    lift_coefficient: float = quantity("amplitude of the lift coefficient C_L", "", 0.0, 5.0)
    diameter_m: float = quantity("width D of the payload across the flow", "m", 1e-3, 200.0)
    area_m2: float | None = quantity(
        "projected area A across the flow; of a `rigid_body` that of its box", "m²", 1e-6, 1e5,
        default=None,
    )  # fmt: skip
    payload: str = text("multi-line scenes: the only payload that sheds; default: each", "")


class PayloadShedding(NamedTuple):
    """Kernel data of the vortices of a payload."""

    memory: Floats  # see CARRIED and the rows after it, (rows, nodes)
    k: float  # ½·ρ·C_L·A [kg/m]
    turns: float  # 2π·St/D [1/m]


def build(params: PayloadSheddingParams, payload: Any, environment: Any) -> PayloadShedding:
    """Return the kernel data for the body and the water; without an area for 1 m² of it."""
    area = 1.0 if params.area_m2 is None else params.area_m2
    k = 0.5 * environment.water_density_kg_per_m3 * params.lift_coefficient * area
    turns = 2.0 * pi * params.strouhal / params.diameter_m
    return PayloadShedding(new_memory(CARRIED, OWN_ROWS, environment.room), float(k), float(turns))


declare_internal_variables(PayloadShedding, CARRIED)
scales_with_ramp(PayloadShedding, "k", factor=VORTICES)


@kernel("start", PayloadShedding)
def start(shed: Any, rope: Any, upto: int) -> None:
    """Initialise φ = 0; the water is not known yet."""
    shed.memory[0, 0], shed.memory[1, 0] = 0.0, UNKNOWN


@jit_within
def _relative(ux: Any, uy: Any, uz: Any, vx: Any, vy: Any, vz: Any) -> Any:
    """Return the water's velocity relative to the payload, and its magnitude."""
    x, y, z = ux - vx, uy - vy, uz - vz
    return x, y, z, sqrt(x * x + y * y + z * z + SPEED2_MIN)


@kernel("predict", PayloadShedding, wide=True)
def predict(shed: Any, rope: Any, stage: Any, kind: int, low: int, high: int) -> None:
    """Set the explicit part of φ at the lower end."""
    if low > 0:
        return
    memory, work, nodes = shed.memory, rope.work, rope.state.nodes
    rate = memory[1, 0]
    if anywhere(rate == UNKNOWN):
        _, _, _, speed = _relative(
            work[FLOW, 0], work[FLOW + 1, 0], work[FLOW + 2, 0],
            nodes[VELOCITY, 0], nodes[VELOCITY + 1, 0], nodes[VELOCITY + 2, 0],
        )  # fmt: skip
        memory[1, 0] = renewed(stage, choose(rate == UNKNOWN, shed.turns * speed, rate), rate)
    memory[ACTS, 0] = 1.0 if stage.time > 0.0 else 0.0  # static equilibrium is without vortices
    if kind == TRAPEZOID:
        memory[HAT, 0] = memory[0, 0] + stage.q * memory[1, 0]
    else:
        memory[HAT, 0] = K1 * memory[CARRIED, 0] - K2 * memory[0, 0]


@kernel("load_end", PayloadShedding, wide=True)
def load_end(shed: Any, work: Any, stage: Any) -> None:
    """Add k·|u|·sin φ·(u × t) to R_0, and its block.

    A = q·k·(sin φ + |u|·q·φ'_|u|·cos φ) times the symmetric part of (u × t) ⊗ u/|u|.
    """
    vx, vy, vz = rows(work, VELOCITY, 0)
    ux, uy, uz = rows(work, FLOW, 0)
    tx, ty, tz = rows(work, TANGENT, 0)
    x, y, z, speed = _relative(ux[0], uy[0], uz[0], vx[0], vy[0], vz[0])
    lx, ly, lz = y * tz[0] - z * ty[0], z * tx[0] - x * tz[0], x * ty[0] - y * tx[0]
    turned = stage.q * shed.turns * speed
    phase = shed.memory[HAT, 0] + turned
    k = shed.k * shed.memory[ACTS, 0]
    force = k * speed * sin(phase)
    g = 0.5 * stage.q * k * (sin(phase) + turned * cos(phase)) / speed
    add_to_node(work, 0, Load(
        force * lx, force * ly, force * lz,
        2.0 * g * lx * x, g * (lx * y + ly * x), g * (lx * z + lz * x),
        2.0 * g * ly * y, g * (ly * z + lz * y), 2.0 * g * lz * z,
    ))  # fmt: skip


@kernel("settle", PayloadShedding, wide=True)
def settle(shed: Any, rope: Any, stage: Any, kind: int, upto: int) -> None:
    """Store φ of the converged stage."""
    memory, work = shed.memory, rope.work
    _, _, _, speed = _relative(
        work[FLOW, 0], work[FLOW + 1, 0], work[FLOW + 2, 0],
        work[VELOCITY, 0], work[VELOCITY + 1, 0], work[VELOCITY + 2, 0],
    )  # fmt: skip
    memory[CARRIED + 1, 0] = shed.turns * speed
    memory[CARRIED, 0] = memory[HAT, 0] + stage.q * memory[CARRIED + 1, 0]


@account("power_end", PayloadShedding)
def power(shed: Any, place: Any) -> Any:
    """Return the power of the force [W]."""
    u = place.flow - place.velocity
    speed = np.sqrt((u * u).sum(axis=0))
    force = shed.k * speed * np.sin(shed.memory[0, 0]) * np.cross(u, place.tangent, axis=0)
    return (force * place.velocity).sum(axis=0)
