"""Morison drag of the rope, cross-flow principle (Morison et al. 1950; Hoerner 1965).

Per metre, with the velocity u of the rope relative to the water, split along the tangent τ into
s = u·τ and n = u - s·τ: force = -½·ρ·d·Cdn·|n|·n - ½·ρ·π·d·Cdt·|s|·s·τ. Cdn is on the projected
area d, Cdt on the skin π·d.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, sqrt
from typing import Any, NamedTuple

from rope_twin.core.rows import blocks, rows
from rope_twin.core.state import FLOW, LUMP, RESIDUAL, TANGENT, VELOCITY
from rope_twin.core.terms import kernel
from rope_twin.quantity import quantity


@dataclass(frozen=True, kw_only=True)
class DragParams:
    """Coefficients and the area each one is on."""

    normal: float = quantity("drag coefficient across the rope, on d", "", 0.0, 10.0)
    tangential: float = quantity("drag coefficient along the rope, on π·d", "", 0.0, 1.0)


class Drag(NamedTuple):
    """What the kernel sees."""

    kn: float  # ½·ρ·d·Cdn [kg/m²]
    kt: float  # ½·ρ·π·d·Cdt [kg/m²]


def build(params: DragParams, rope: Any, payload: Any, environment: Any) -> Drag:
    """From the coefficients, the rope's hydrodynamic diameter and the water."""
    pressure = 0.5 * environment.water_density_kg_per_m3 * rope.hydrodynamic_diameter_m
    return Drag(pressure * params.normal, pressure * pi * params.tangential)


@kernel("add_load", Drag)
def add_load(drag: Any, model: Any, work: Any, stage: Any, low: int, high: int) -> None:
    """R -= c_n·n + c_t·s·τ; A += q·(c_n·(I - ττᵀ) + 2·c_t·ττᵀ + k_n·lump·nnᵀ/|n|).

    c_n = k_n·lump·|n|, c_t = k_t·lump·|s|. Dropped in A: the tangent's and the current's change
    with position.
    """
    vx, vy, vz = rows(work, VELOCITY, low, high)
    ux, uy, uz = rows(work, FLOW, low, high)
    tx, ty, tz = rows(work, TANGENT, low, high)
    Rx, Ry, Rz = rows(work, RESIDUAL, low, high)
    Axx, Axy, Axz, Ayy, Ayz, Azz = blocks(work, low, high)
    lump, q = work[LUMP][low:high], stage.q
    for i in range(high - low):
        x, y, z = tx[i], ty[i], tz[i]
        rx, ry, rz = vx[i] - ux[i], vy[i] - uy[i], vz[i] - uz[i]
        s = rx * x + ry * y + rz * z
        nx, ny, nz = rx - s * x, ry - s * y, rz - s * z
        speed = sqrt(nx * nx + ny * ny + nz * nz + 1e-20)
        kn = drag.kn * lump[i]
        cn = kn * speed
        ct = drag.kt * lump[i] * abs(s)
        along = ct * s
        Rx[i] -= cn * nx + along * x
        Ry[i] -= cn * ny + along * y
        Rz[i] -= cn * nz + along * z
        diagonal = q * cn
        beta = q * (2.0 * ct - cn)
        g = q * kn / speed
        Axx[i] += diagonal + beta * x * x + g * nx * nx
        Axy[i] += beta * x * y + g * nx * ny
        Axz[i] += beta * x * z + g * nx * nz
        Ayy[i] += diagonal + beta * y * y + g * ny * ny
        Ayz[i] += beta * y * z + g * ny * nz
        Azz[i] += diagonal + beta * z * z + g * nz * nz
