"""Rope out of the water: its dry part has its weight in air, without drag or added mass.

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
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import Any, NamedTuple

import numpy as np

from rope_twin.core.energy import account_soaked, wets
from rope_twin.core.jit.decorators import jit_within
from rope_twin.core.jit.rows import row, rows
from rope_twin.core.jit.wide import choose
from rope_twin.core.loads.balance import Node
from rope_twin.core.loads.hooks import kernel, wide_kernel
from rope_twin.core.state import DIVISOR_MIN, FLOW, FLOW_RATE, LENGTH, POSITION, SURFACE, VOLUME

PER_AREA = 1.1283791670955126  # diameter over the root of the section's area, √(4/π)


@dataclass(frozen=True, kw_only=True)
class WettingParams:
    """Without parameters: surface, mass, diameter and water are the scene's."""


class Wetting(NamedTuple):
    """Kernel data of the wetted rope."""

    lift: float  # ρ·g [N/m³]
    added: float  # Ca·ρ [kg/m³]
    axial: float  # Ca along the rope·ρ [kg/m³]


def build(params: WettingParams, payload: Any, around: Any) -> Wetting:
    """Return the kernel data for gravity, water and the rope's added mass."""
    density = around.water_density_kg_per_m3
    return Wetting(
        float(density * around.gravity_m_per_s2),
        float(around.added_mass * density),
        float(around.added_mass_along * density),
    )


@jit_within
def _diameter(volume: float, length: float) -> float:
    return PER_AREA * sqrt(volume / (length + DIVISOR_MIN))


@kernel("flow", Wetting)
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
    for i in range(high - low):
        reach = 0.5 * length[i] + _diameter(volume[i], length[i])
        if low + i > 0 and z[i] - surface[i] > reach:
            ux[i] = uy[i] = uz[i] = 0.0
            wx[i] = wy[i] = wz[i] = 0.0


@wide_kernel("flow", Wetting)
def flow_wide(wetting: Any, work: Any, stage: Any, low: int, high: int) -> None:
    """Set the water to rest at dry nodes of a SIMD batch."""
    ux, uy, uz = rows(work, FLOW, low)
    wx, wy, wz = rows(work, FLOW_RATE, low)
    _, _, z = rows(work, POSITION, low)
    surface, length, volume = (
        row(work, SURFACE, low),
        row(work, LENGTH, low),
        row(work, VOLUME, low),
    )
    for i in range(max(low, 1) - low, high - low):
        dry = z[i] - surface[i] > 0.5 * length[i] + _diameter(volume[i], length[i])
        ux[i] = choose(dry, 0.0, ux[i])
        uy[i] = choose(dry, 0.0, uy[i])
        uz[i] = choose(dry, 0.0, uz[i])
        wx[i] = choose(dry, 0.0, wx[i])
        wy[i] = choose(dry, 0.0, wy[i])
        wz[i] = choose(dry, 0.0, wz[i])


@kernel("soak", Wetting, wide=True)
def soak(wetting: Any, node: Any) -> Any:
    """Return the node with the volume and the areas of its wetted part."""
    d = _diameter(node.volume, node.length)
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


account_soaked(Wetting)
