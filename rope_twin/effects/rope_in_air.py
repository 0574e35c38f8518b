"""Rope above the water: its dry part, and the wind on it.

**wetting**: Rope out of the water: its dry part has its weight in air, without drag or added mass.

Buoyancy, drag, added mass and the inertia of waves act on the wetted fraction β of each node's
rope. It rises linearly from 0 to 1 while the surface, η above the node (0 without `waves`), passes
the height e that the rope of the node takes up,

    β = ½ + (η - z)/e within 0 to 1,    e = l·|t_z| + d·√(1 - t_z²),

l its length, d its diameter and t_z the vertical component of its tangent, so that an upright rope
is wetted exactly up to the surface. A node that is wholly dry is in still air for the VIV models
too; `wind` adds the drag of the wind. Omitted in the block: β's change with height, ρ·g·A per metre
and far below the stiffness of inertia in a step.

The stored energy of `weight` and `added_mass` is that of a wholly wetted rope. It is taken out here
and the power of the forces that act is put in its place.

**wind**: Wind drag on the rope above the water (beside `wetting`).

Per metre ½·ρ_air·d·C_d·|n|·n with n the normal component of the wind relative to the rope, on the
dry part of each node, and d the hydrodynamic diameter: a C_d on the nominal one is to be multiplied
by nominal over hydrodynamic diameter, about 1.25 for stranded wire. The wind grows with height by
the power law U(z) = U_10·(z/10 m)^α, with α 0.12 over open sea with waves (DNV-RP-C205, 2.3.2); a
wind along the rope is neglected.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import Any, NamedTuple

import numpy as np

from rope_twin.core.elements import PER_AREA, diameter, dry_height
from rope_twin.core.jit.decorators import jit_within
from rope_twin.core.jit.rows import row, rows
from rope_twin.core.jit.wide import choose
from rope_twin.core.loads.accounts import account, account_submerged, wets
from rope_twin.core.loads.balance import Node
from rope_twin.core.loads.hooks import Load, kernel, scales_with_ramp
from rope_twin.core.state import (
    DIVISOR_MIN,
    FLOW,
    FLOW_RATE,
    LENGTH,
    POSITION,
    SPEED2_MIN,
    SURFACE,
    VOLUME,
)
from rope_twin.quantity import quantity


@dataclass(frozen=True, kw_only=True)
class WettingParams:
    """Without parameters: surface, mass, diameter and water are the scene's."""


class Wetting(NamedTuple):
    """Kernel data of the wetted rope."""

    lift: float  # ρ·g [N/m³]
    added: float  # Ca·ρ [kg/m³]
    axial: float  # Ca along the rope·ρ [kg/m³]


def build_wetting(params: WettingParams, payload: Any, environment: Any) -> Wetting:
    """Return the kernel data for gravity, water and the rope's added mass."""
    density = environment.water_density_kg_per_m3
    return Wetting(
        float(density * environment.gravity_m_per_s2),
        float(environment.added_mass * density),
        float(environment.added_mass_along * density),
    )


@kernel("flow", Wetting, wide=True)
def flow(wetting: Any, work: Any, stage: Any, low: int, high: int) -> None:
    """Set the water to rest at nodes that no position of their rope would bring into it.

    At the lower end it is the payload's, which may reach into the water.
    """
    ux, uy, uz = rows(work, FLOW, low)
    wx, wy, wz = rows(work, FLOW_RATE, low)
    _, _, z = rows(work, POSITION, low)
    surface, length, volume = (
        row(work, SURFACE, low),
        row(work, LENGTH, low),
        row(work, VOLUME, low),
    )
    for i in range(max(low, 1) - low, high - low):
        dry = z[i] - surface[i] > dry_height(length[i], volume[i])
        ux[i] = choose(dry, 0.0, ux[i])
        uy[i] = choose(dry, 0.0, uy[i])
        uz[i] = choose(dry, 0.0, uz[i])
        wx[i] = choose(dry, 0.0, wx[i])
        wy[i] = choose(dry, 0.0, wy[i])
        wz[i] = choose(dry, 0.0, wz[i])


@kernel("submerge", Wetting, wide=True)
def submerge(wetting: Any, node: Any) -> Any:
    """Return the node with the volume and the areas of its wetted part."""
    d = diameter(node.volume, node.length)
    height = node.length * abs(node.tz) + d * sqrt(max(1.0 - node.tz * node.tz, 0.0))
    share = 0.5 + (node.surface - node.z) / (height + DIVISOR_MIN)
    wet = min(max(share, 0.0), 1.0)
    return Node(
        node.x, node.y, node.z, node.vx, node.vy, node.vz, node.ax, node.ay, node.az,
        node.tx, node.ty, node.tz, node.ux, node.uy, node.uz, node.wx, node.wy, node.wz,
        node.mass, wet * node.volume, wet * node.frontal, wet * node.skin, node.length,
        node.surface, (1.0 - wet) * d * node.length, node.touching,
    )  # fmt: skip


@wets(Wetting)
def wet_place(wetting: Any, place: Any) -> Any:
    """Return the place with the volume and the areas of its wetted part."""
    d = PER_AREA * np.sqrt(place.volume / (place.length + DIVISOR_MIN))
    upright = np.abs(place.tangent[2])
    height = place.length * upright + d * np.sqrt(np.maximum(1.0 - upright**2, 0.0))
    share = 0.5 + (place.surface - place.position[2]) / (height + DIVISOR_MIN)
    wet = np.clip(share, 0.0, 1.0)
    return place._replace(
        volume=wet * place.volume, frontal=wet * place.frontal, skin=wet * place.skin,
        bare=(1.0 - wet) * d * place.length,
    )  # fmt: skip


account_submerged(Wetting)


REFERENCE_M, LOWEST_M = 10.0, 0.1  # heights of U_10, and below which the wind no longer falls


@dataclass(frozen=True, kw_only=True)
class WindParams:
    """Wind velocity, its profile, and the drag coefficient of the rope in air."""

    velocity_m_per_s: tuple[float, float] = quantity(
        "velocity of the wind 10 m above the sea, to the east and to the north", "m/s",
        -80.0, 80.0,
    )  # fmt: skip
    exponent: float = quantity("α of the profile (z/10 m)^α", "", 0.0, 1.0, default=0.12)
    normal: float = quantity(
        "normal drag coefficient, on the hydrodynamic diameter", "", 0.0, 10.0, default=1.2
    )
    density_kg_per_m3: float = quantity("density of the air", "kg/m³", 0.1, 10.0, default=1.226)


class Wind(NamedTuple):
    """Kernel data of the wind."""

    x: float  # U_10 [m/s]
    y: float
    exponent: float
    k: float  # ½·ρ·C_d [kg/m³]


scales_with_ramp(Wind, "k")


def build_wind(params: WindParams, payload: Any, environment: Any) -> Wind:
    """Return the kernel data of the wind."""
    east, north = params.velocity_m_per_s
    k = 0.5 * params.density_kg_per_m3 * params.normal
    return Wind(float(east), float(north), float(params.exponent), float(k))


@jit_within
def _height(z: float, surface: float) -> float:
    return max(z - surface, LOWEST_M) / REFERENCE_M


@kernel("load", Wind, wide=True)
def wind_load(wind: Any, node: Any, stage: Any) -> Any:
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
def wind_power(wind: Any, place: Any) -> Any:
    """Return force times velocity [W]."""
    height = np.maximum(place.position[2] - place.surface, LOWEST_M) / REFERENCE_M
    u = place.velocity.copy()
    u[0] -= height**wind.exponent * wind.x
    u[1] -= height**wind.exponent * wind.y
    across = u - (u * place.tangent).sum(axis=0) * place.tangent
    size = wind.k * place.bare * np.sqrt((across * across).sum(axis=0))
    return -(size * across * place.velocity).sum(axis=0)
