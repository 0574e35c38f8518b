"""Weight of the rope less its buoyancy in water.

Per unstretched metre w = (m - ρ·π·d²/4)·g, downward; d is the hydrodynamic (volume) diameter.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

from rope_twin.core.energy import account
from rope_twin.core.loads.balance import Load
from rope_twin.core.loads.hooks import kernel


@dataclass(frozen=True, kw_only=True)
class WeightParams:
    """Without parameters: mass, diameter, density and gravity are the scene's."""


class Weight(NamedTuple):
    """Kernel data; mass and volume are the rope's, per node."""

    g: float  # [m/s²]
    density: float  # of the water [kg/m³]


def build(params: WeightParams, payload: Any, environment: Any) -> Weight:
    """Return the kernel data for gravity and the water."""
    return Weight(environment.gravity_m_per_s2, environment.water_density_kg_per_m3)


@kernel("load", Weight, wide=True)
def load(weight: Any, node: Any, stage: Any) -> Any:
    """Return F_z = -(m - ρ·volume)·g."""
    down = weight.g * (node.mass - weight.density * node.volume)
    return Load(0.0, 0.0, -down, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@account("potential", Weight)
def potential(weight: Any, place: Any) -> Any:
    """Return (m - ρ·volume)·g·z [J]."""
    return weight.g * (place.mass - weight.density * place.volume) * place.position[2]
