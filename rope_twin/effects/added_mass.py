"""Added mass of the water across the rope, always on the left-hand side.

Per metre Ca·ρ·π·d²/4 on the acceleration's part across the tangent. Treated explicitly it blows up
once it exceeds the rope's mass (HMPE: 1.05 to 1.62 times), at any step.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

from rope_twin.core.acting.hooks import kernel
from rope_twin.core.acting.loads import Load
from rope_twin.core.energy import account
from rope_twin.quantity import quantity


@dataclass(frozen=True, kw_only=True)
class AddedMassParams:
    """The coefficient, on the displaced volume."""

    normal: float = quantity("added mass coefficient across the rope", "", 0.0, 10.0, default=1.0)


class AddedMass(NamedTuple):
    """What the kernel sees; the volume is the rope's, per node."""

    density: float  # Ca·ρ [kg/m³]


def build(params: AddedMassParams, payload: Any, environment: Any) -> AddedMass:
    """From the coefficient and the water."""
    return AddedMass(params.normal * environment.water_density_kg_per_m3)


@kernel("load", AddedMass, wide=True)
def load(added: Any, node: Any, stage: Any) -> Any:
    """F = -m·(a - (a·τ)τ); A = m·(I - ττᵀ), with m = Ca·ρ·volume."""
    x, y, z = node.tx, node.ty, node.tz
    m = added.density * node.volume
    along = node.ax * x + node.ay * y + node.az * z
    return Load(
        -m * (node.ax - along * x),
        -m * (node.ay - along * y),
        -m * (node.az - along * z),
        m * (1.0 - x * x),
        -m * x * y,
        -m * x * z,
        m * (1.0 - y * y),
        -m * y * z,
        m * (1.0 - z * z),
    )


@account("kinetic", AddedMass)
def kinetic(added: Any, place: Any) -> Any:
    """½·m·|v across|² [J]."""
    v, along = place.velocity, (place.velocity * place.tangent).sum(axis=0)
    return 0.5 * added.density * place.volume * ((v * v).sum(axis=0) - along * along)


@account("power", AddedMass)
def power(added: Any, place: Any) -> Any:
    """What the force brings beyond the change of ½·m·|v across|²: -m·(v·τ)·(v·dτ/dt) [W].

    The force has m·(acceleration across) only; as the rope turns, its energy changes by more.
    """
    along = (place.velocity * place.tangent).sum(axis=0)
    turned = (place.velocity * place.turning).sum(axis=0)
    return -added.density * place.volume * along * turned
