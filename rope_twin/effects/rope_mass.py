"""Weight and added mass of the rope.

**weight**: Weight of the rope less its buoyancy in water.

Per unstretched metre w = (m - ρ·π·d²/4)·g, downward; d is the hydrodynamic (volume) diameter.

**added_mass**: Added mass of the rope, treated implicitly.

Per metre Ca·ρ·π·d²/4 times the acceleration normal to the tangent. Treated explicitly it is
unstable once it exceeds the rope's mass (HMPE: 1.05 to 1.62 times), at any step.

Along the tangent a smooth slender body moves next to no water (Lamb 1932, ch. 5, the long
spheroid). For chain, or rope with floats or growth, `tangential`, on the same volume, adds its
part.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

from rope_twin.core.loads.accounts import account
from rope_twin.core.loads.hooks import Load, kernel
from rope_twin.quantity import SparingRepr, quantity


@dataclass(frozen=True, kw_only=True)
class WeightParams:
    """Without parameters: mass, diameter, density and gravity are the scene's."""


class Weight(NamedTuple):
    """Kernel data; mass and volume are the rope's, per node."""

    g: float  # [m/s²]
    density: float  # of the water [kg/m³]


def build_weight(params: WeightParams, payload: Any, environment: Any) -> Weight:
    """Return the kernel data for gravity and the water."""
    return Weight(environment.gravity_m_per_s2, environment.water_density_kg_per_m3)


@kernel("load", Weight, wide=True)
def weight_load(weight: Any, node: Any, stage: Any) -> Any:
    """Return F_z = -(m - ρ·volume)·g."""
    down = weight.g * (node.mass - weight.density * node.volume)
    return Load(0.0, 0.0, -down, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@account("potential", Weight)
def potential(weight: Any, place: Any) -> Any:
    """Return (m - ρ·volume)·g·z [J]."""
    return weight.g * (place.mass - weight.density * place.volume) * place.position[2]


@dataclass(frozen=True, kw_only=True, repr=False)
class AddedMassParams(SparingRepr):
    """Added mass coefficients, referred to the displaced volume."""

    _later = frozenset(("tangential",))

    normal: float = quantity(
        "added mass coefficient normal to the rope", "", 0.0, 10.0, default=1.0
    )
    tangential: float = quantity(
        "added mass coefficient along the rope: 0 for smooth rope", "", 0.0, 10.0, default=0.0
    )


class AddedMass(NamedTuple):
    """Kernel data; the volume is the rope's, per node."""

    density: float  # Ca·ρ [kg/m³]


class AxialAddedMass(NamedTuple):
    """Kernel data of a rope that moves water along itself too."""

    density: float  # Ca·ρ across the rope [kg/m³]
    axial: float  # Ca·ρ along the rope [kg/m³]


def build_added_mass(
    params: AddedMassParams, payload: Any, environment: Any
) -> AddedMass | AxialAddedMass:
    """Return the kernel data for the coefficients and the water density."""
    rho = environment.water_density_kg_per_m3
    if params.tangential > 0.0:
        return AxialAddedMass(params.normal * rho, params.tangential * rho)
    return AddedMass(params.normal * rho)


@kernel("load", AddedMass, wide=True)
def added_mass_load(added: Any, node: Any, stage: Any) -> Any:
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


@kernel("load", AxialAddedMass, wide=True)
def axial_load(added: Any, node: Any, stage: Any) -> Any:
    """Return F = -m·a - (m_t - m)·(a·τ)τ and A = m·I + (m_t - m)·ττᵀ, m_t along the rope."""
    x, y, z = node.tx, node.ty, node.tz
    m, more = added.density * node.volume, (added.axial - added.density) * node.volume
    along = more * (node.ax * x + node.ay * y + node.az * z)
    return Load(
        -m * node.ax - along * x,
        -m * node.ay - along * y,
        -m * node.az - along * z,
        m + more * x * x,
        more * x * y,
        more * x * z,
        m + more * y * y,
        more * y * z,
        m + more * z * z,
    )


@account("kinetic", AxialAddedMass)
def axial_kinetic(added: Any, place: Any) -> Any:
    """Return the kinetic energy ½·m·|v normal|² + ½·m_t·(v·τ)² [J]."""
    along = (place.velocity * place.tangent).sum(axis=0)
    return kinetic(added, place) + 0.5 * added.axial * place.volume * along * along


@account("power", AxialAddedMass)
def axial_power(added: Any, place: Any) -> Any:
    """Return the power of the force beyond the change of its energy, (m_t - m)·(v·τ)·(v·dτ/dt) [W].

    As the rope rotates, motion across it becomes motion along it, which has another mass.
    """
    along = (place.velocity * place.tangent).sum(axis=0)
    turned = (place.velocity * place.turning).sum(axis=0)
    return (added.axial - added.density) * place.volume * along * turned
