"""Wind drag on the rope above the water (beside `wetting`).

Per metre ½·ρ_air·d·C_d·|n|·n with n the normal component of the wind relative to the rope, on the
dry part of each node. The wind grows with height by the power law U(z) = U_10·(z/10 m)^α, with α
0.12 over open sea with waves (DNV-RP-C205, 2.3.2); a wind along the rope is neglected.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import Any, NamedTuple

import numpy as np

from rope_twin.core.energy import account
from rope_twin.core.jit.decorators import jit_within
from rope_twin.core.loads.balance import Load
from rope_twin.core.loads.hooks import grows, kernel
from rope_twin.core.state import SPEED2_MIN
from rope_twin.quantity import quantity

REFERENCE_M, LOWEST_M = 10.0, 0.1  # heights of U_10, and below which the wind no longer falls


@dataclass(frozen=True, kw_only=True)
class WindParams:
    """Wind velocity, its profile, and the drag coefficient of the rope in air."""

    velocity_m_per_s: tuple[float, float] = quantity(
        "velocity of the wind 10 m above the sea, to the east and to the north", "m/s",
        -80.0, 80.0,
    )  # fmt: skip
    exponent: float = quantity("α of the profile (z/10 m)^α", "", 0.0, 1.0, default=0.12)
    normal: float = quantity("normal drag coefficient, on the diameter", "", 0.0, 10.0, default=1.2)
    density_kg_per_m3: float = quantity("density of the air", "kg/m³", 0.1, 10.0, default=1.226)


class Wind(NamedTuple):
    """Kernel data of the wind."""

    x: float  # U_10 [m/s]
    y: float
    exponent: float
    k: float  # ½·ρ·C_d [kg/m³]


grows(Wind, "k")


def build(params: WindParams, payload: Any, around: Any) -> Wind:
    """Return the kernel data of the wind."""
    east, north = params.velocity_m_per_s
    k = 0.5 * params.density_kg_per_m3 * params.normal
    return Wind(float(east), float(north), float(params.exponent), float(k))


@jit_within
def _height(z: float, surface: float) -> float:
    return max(z - surface, LOWEST_M) / REFERENCE_M


@kernel("load", Wind, wide=True)
def load(wind: Any, node: Any, stage: Any) -> Any:
    """Return F = -k·|n|·n on the dry area and A = q·k·(|n|·(I - ττᵀ) + nnᵀ/|n|)."""
    x, y, z = node.tx, node.ty, node.tz
    grown = _height(node.z, node.surface) ** wind.exponent
    rx, ry, rz = node.vx - grown * wind.x, node.vy - grown * wind.y, node.vz
    s = rx * x + ry * y + rz * z
    nx, ny, nz = rx - s * x, ry - s * y, rz - s * z
    speed = sqrt(nx * nx + ny * ny + nz * nz + SPEED2_MIN)
    k = wind.k * node.bare
    c, g = k * speed, stage.q * k / speed
    own = stage.q * c
    return Load(
        -c * nx, -c * ny, -c * nz,
        own * (1.0 - x * x) + g * nx * nx, g * nx * ny - own * x * y, g * nx * nz - own * x * z,
        own * (1.0 - y * y) + g * ny * ny, g * ny * nz - own * y * z,
        own * (1.0 - z * z) + g * nz * nz,
    )  # fmt: skip


@account("power", Wind)
def power(wind: Any, place: Any) -> Any:
    """Return force times velocity [W]."""
    height = np.maximum(place.position[2] - place.surface, LOWEST_M) / REFERENCE_M
    u = place.velocity.copy()
    u[0] -= height**wind.exponent * wind.x
    u[1] -= height**wind.exponent * wind.y
    across = u - (u * place.tangent).sum(axis=0) * place.tangent
    size = wind.k * place.bare * np.sqrt((across * across).sum(axis=0))
    return -(size * across * place.velocity).sum(axis=0)
