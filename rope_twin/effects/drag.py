"""Morison drag of the rope, cross-flow principle (Morison et al. 1950; Hoerner 1965).

Per metre, with the velocity u of the rope relative to the water, split along the tangent τ into
s = u·τ and n = u - s·τ: force = -½·ρ·d·Cdn·|n|·n - ½·ρ·π·d·Cdt·|s|·s·τ. Cdn is on the projected
area d, Cdt on the skin π·d.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import Any, NamedTuple

import numpy as np

from rope_twin.core.energy import account
from rope_twin.core.terms import Load, kernel
from rope_twin.quantity import quantity


@dataclass(frozen=True, kw_only=True)
class DragParams:
    """Coefficients and the area each one is on."""

    normal: float = quantity("drag coefficient across the rope, on d", "", 0.0, 10.0)
    tangential: float = quantity("drag coefficient along the rope, on π·d", "", 0.0, 1.0)


class Drag(NamedTuple):
    """What the kernel sees; the areas are the rope's, per node."""

    kn: float  # ½·ρ·Cdn [kg/m³]
    kt: float  # ½·ρ·Cdt [kg/m³]


def build(params: DragParams, payload: Any, environment: Any) -> Drag:
    """From the coefficients and the water."""
    half_density = 0.5 * environment.water_density_kg_per_m3
    return Drag(half_density * params.normal, half_density * params.tangential)


@kernel("load", Drag, wide=True)
def load(drag: Any, node: Any, stage: Any) -> Any:
    """F = -c_n·n - c_t·s·τ; A = q·(c_n·(I - ττᵀ) + 2·c_t·ττᵀ + k_n·nnᵀ/|n|).

    k_n = kn·frontal area, c_n = k_n·|n|, c_t = kt·skin area·|s|. Dropped in A: the tangent's and
    the current's change with position.
    """
    x, y, z, q = node.tx, node.ty, node.tz, stage.q
    rx, ry, rz = node.vx - node.ux, node.vy - node.uy, node.vz - node.uz
    s = rx * x + ry * y + rz * z
    nx, ny, nz = rx - s * x, ry - s * y, rz - s * z
    speed = sqrt(nx * nx + ny * ny + nz * nz + 1e-20)
    kn = drag.kn * node.frontal
    cn = kn * speed
    ct = drag.kt * node.skin * abs(s)
    along = ct * s
    diagonal = q * cn
    beta = q * (2.0 * ct - cn)
    g = q * kn / speed
    return Load(
        -cn * nx - along * x,
        -cn * ny - along * y,
        -cn * nz - along * z,
        diagonal + beta * x * x + g * nx * nx,
        beta * x * y + g * nx * ny,
        beta * x * z + g * nx * nz,
        diagonal + beta * y * y + g * ny * ny,
        beta * y * z + g * ny * nz,
        diagonal + beta * z * z + g * nz * nz,
    )


@account("power", Drag)
def power(drag: Any, place: Any) -> Any:
    """Force times velocity [W]; against the current's push it may be positive."""
    u = place.velocity - place.flow
    s = (u * place.tangent).sum(axis=0)
    along = s * place.tangent
    across = u - along
    cn = drag.kn * place.frontal * np.sqrt((across * across).sum(axis=0))
    ct = drag.kt * place.skin * np.abs(s)
    return -((cn * across + ct * along) * place.velocity).sum(axis=0)
