"""Weight of the rope less its buoyancy in water.

Per unstretched metre w = (m - ρ·π·d²/4)·g, downward; d is the hydrodynamic (volume) diameter.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from typing import Any, NamedTuple

from rope_twin.core.state import LUMP, RESIDUAL
from rope_twin.core.terms import kernel


@dataclass(frozen=True, kw_only=True)
class WeightParams:
    """Nothing to choose: mass, diameter, density and gravity are the scene's."""


class Weight(NamedTuple):
    """What the kernel sees."""

    w: float  # weight in water per metre [N/m]


def build(params: WeightParams, rope: Any, payload: Any, environment: Any) -> Weight:
    """From the scene's rope and water."""
    area = 0.25 * pi * rope.hydrodynamic_diameter_m**2
    density = environment.water_density_kg_per_m3
    return Weight((rope.mass_kg_per_m - density * area) * environment.gravity_m_per_s2)


@kernel("add_load", Weight)
def add_load(weight: Any, model: Any, work: Any, stage: Any, low: int, high: int) -> None:
    """R_z -= w·lump."""
    R, lump = work[RESIDUAL + 2][low:high], work[LUMP][low:high]
    for i in range(high - low):
        R[i] -= weight.w * lump[i]
