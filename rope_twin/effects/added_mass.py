"""Added mass of the water across the rope, always on the left-hand side.

Per metre Ca·ρ·π·d²/4 on the acceleration's part across the tangent. Treated explicitly it blows up
once it exceeds the rope's mass (HMPE: 1.05 to 1.62 times), at any step.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from typing import Any, NamedTuple

from rope_twin.core.rows import blocks, rows
from rope_twin.core.state import ACCELERATION, LUMP, RESIDUAL, TANGENT
from rope_twin.core.terms import kernel
from rope_twin.quantity import quantity


@dataclass(frozen=True, kw_only=True)
class AddedMassParams:
    """The coefficient, on the displaced volume."""

    normal: float = quantity("added mass coefficient across the rope", "", 0.0, 10.0, default=1.0)


class AddedMass(NamedTuple):
    """What the kernel sees."""

    m: float  # added mass per metre [kg/m]


def build(params: AddedMassParams, rope: Any, payload: Any, environment: Any) -> AddedMass:
    """From the coefficient, the rope's volume and the water."""
    area = 0.25 * pi * rope.hydrodynamic_diameter_m**2
    return AddedMass(params.normal * environment.water_density_kg_per_m3 * area)


@kernel("add_load", AddedMass)
def add_load(added: Any, model: Any, work: Any, stage: Any, low: int, high: int) -> None:
    """R -= m·lump·(a - (a·τ)τ); A += m·lump·(I - ττᵀ)."""
    ax, ay, az = rows(work, ACCELERATION, low, high)
    tx, ty, tz = rows(work, TANGENT, low, high)
    Rx, Ry, Rz = rows(work, RESIDUAL, low, high)
    Axx, Axy, Axz, Ayy, Ayz, Azz = blocks(work, low, high)
    lump = work[LUMP][low:high]
    for i in range(high - low):
        x, y, z = tx[i], ty[i], tz[i]
        m = added.m * lump[i]
        along = ax[i] * x + ay[i] * y + az[i] * z
        Rx[i] -= m * (ax[i] - along * x)
        Ry[i] -= m * (ay[i] - along * y)
        Rz[i] -= m * (az[i] - along * z)
        Axx[i] += m * (1.0 - x * x)
        Axy[i] -= m * x * y
        Axz[i] -= m * x * z
        Ayy[i] += m * (1.0 - y * y)
        Ayz[i] -= m * y * z
        Azz[i] += m * (1.0 - z * z)
