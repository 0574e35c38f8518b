"""Added mass of the rope for motion normal to it, treated implicitly.

Per metre Ca·ρ·π·d²/4 times the acceleration normal to the tangent. Treated explicitly it is
unstable once it exceeds the rope's mass (HMPE: 1.05 to 1.62 times), at any step.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

from rope_twin.core.energy import account
from rope_twin.core.loads.balance import Load
from rope_twin.core.loads.hooks import kernel
from rope_twin.quantity import quantity


@dataclass(frozen=True, kw_only=True)
class AddedMassParams:
    """Added mass coefficient, referred to the displaced volume."""

    normal: float = quantity(
        "added mass coefficient normal to the rope", "", 0.0, 10.0, default=1.0
    )


class AddedMass(NamedTuple):
    """Kernel data; the volume is the rope's, per node."""

    density: float  # Ca·ρ [kg/m³]


def build(params: AddedMassParams, payload: Any, environment: Any) -> AddedMass:
    """Return the kernel data for a coefficient and the water density."""
    return AddedMass(params.normal * environment.water_density_kg_per_m3)


@kernel("load", AddedMass, wide=True)
def load(added: Any, node: Any, stage: Any) -> Any:
    """Return F = -m·(a - (a·τ)τ) and A = m·(I - ττᵀ), with m = Ca·ρ·volume."""
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
    """Return the kinetic energy ½·m·|v normal|² [J]."""
    v, along = place.velocity, (place.velocity * place.tangent).sum(axis=0)
    return 0.5 * added.density * place.volume * ((v * v).sum(axis=0) - along * along)


@account("power", AddedMass)
def power(added: Any, place: Any) -> Any:
    """Return the power of the force beyond the change of ½·m·|v normal|²: -m·(v·τ)·(v·dτ/dt) [W].

    The force is m·(normal acceleration) only; as the rope rotates, its energy changes by more.
    """
    along = (place.velocity * place.tangent).sum(axis=0)
    turned = (place.velocity * place.turning).sum(axis=0)
    return -added.density * place.volume * along * turned
