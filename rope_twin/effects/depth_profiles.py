"""Water whose density, and a rope whose drag, vary over depth.

The other effects load rope and payload as in water of the scene's density ρ0. Here the rope's
displaced volume and drag areas at each node, at elevation z, become

    volume·ρ(z)/ρ0,    area·f(z)·ρ(z)/ρ0,

so that buoyancy, added mass, the inertia of waves and drag are those of the local density ρ(z)
(Archimedes; Morison et al. 1950), and the drag coefficients of the rope f(z) times those of `drag`
(marine growth, or vibration that is known over depth). The payload gets ρ(z)/ρ0 - 1 times its
buoyancy, added mass, drag and wave inertia in addition. ρ and f are piecewise linear; above the
first and below the last row the end values hold. Density in situ, as of a CTD cast, includes the
compression of the water (Millero et al. 1980, Deep-Sea Res. 27A, 255); the rope's is left out.

Waves move through the profile without lifting it. Omitted in the block of the rope's nodes: the
change of ρ and f with height.

The stored energy of `weight` and `added_mass` is that of a rope in water of the density ρ0. It is
taken out here and the power of the forces that act is put in its place, unless `wetting` does so.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from math import sqrt
from typing import Any, NamedTuple

import numpy as np

from rope_twin.core.jit.decorators import jit_within
from rope_twin.core.jit.functions import by_width
from rope_twin.core.jit.rows import rows, span
from rope_twin.core.jit.wide import choose
from rope_twin.core.loads.accounts import account, account_submerged, wets
from rope_twin.core.loads.balance import Node, end_relative
from rope_twin.core.loads.hooks import differs_by_rope, kernel
from rope_twin.core.state import (
    ACCELERATION,
    BLOCK,
    DIVISOR_MIN,
    FLOW_RATE,
    POSITION,
    RESIDUAL,
    SPEED2_MIN,
    TURN2,
    Floats,
)
from rope_twin.quantity import quantity

Z, DENSITY, FACTOR = range(3)  # rows of the table
Rows = tuple[tuple[float, float], ...]


@dataclass(frozen=True, kw_only=True)
class DepthProfilesParams:
    """Rows from the surface down, of density, of a factor on the rope's drag, or of both."""

    density_kg_per_m3: Rows = quantity(
        "rows of elevation z [m] and water density [kg/m³]", "", default=()
    )
    drag_factor: Rows = quantity(
        "rows of elevation z [m] and factor on the rope's drag coefficients", "", default=()
    )

    def check(self) -> str | None:
        """Return the fault of the rows and its remedy, or None."""
        if not self.density_kg_per_m3 and not self.drag_factor:
            return "neither density_kg_per_m3 nor drag_factor; give one or both"
        for name, found, low, high, unit in (
            ("density_kg_per_m3", self.density_kg_per_m3, 900.0, 1500.0, " kg/m³"),
            ("drag_factor", self.drag_factor, 0.0, 10.0, ""),
        ):
            for (above, _), (below, _) in itertools.pairwise(found):
                if not below < above:
                    return (
                        f"{name}: z = {below:g} m follows z = {above:g} m; order rows from the "
                        "surface down"
                    )
            for z, value in found:
                if not -12e3 <= z <= 0.0:
                    return f"{name}: z = {z:g} m is outside the water; give 0 down to -12000 m"
                if not low <= value <= high:
                    return f"{name}: {value:g} at z = {z:g} m; give {low:g} to {high:g}{unit}"
        return None


class DepthProfiles(NamedTuple):
    """Kernel data; the last twelve numbers are the payload's in water of the scene's density."""

    table: Floats  # z [m] from the bottom up, density over the scene's, drag factor, (3, rows)
    lift: float  # ρ0·g in the accounts, 0 where `wetting` has it [N/m³]
    added: float  # Ca·ρ0, likewise [kg/m³]
    axial: float  # Ca along the rope·ρ0, likewise [kg/m³]
    buoyancy: float  # ρ0·V·g [N]
    Ax: float  # added mass [kg]
    Ay: float
    Az: float  # mean of ascent and descent
    kx: float  # ½·ρ0·CdA [kg/m]
    ky: float
    kz: float  # mean of ascent and descent
    dA: float  # half the difference of the added mass, ascent less descent [kg]
    dk: float  # half the difference of the drag, ascent less descent [kg/m]
    wx: float  # ρ0·V + added mass [kg]
    wy: float
    wz: float  # with the mean of ascent and descent


AT_END = DepthProfiles._fields[4:]  # what is the payload's


differs_by_rope(DepthProfiles)


def build(params: DepthProfilesParams, payload: Any, environment: Any) -> DepthProfiles:
    """Return the kernel data for the profiles, the payload's properties and the water."""
    rho, g = float(environment.water_density_kg_per_m3), float(environment.gravity_m_per_s2)
    # between two rows of their union both profiles are linear
    rows = params.density_kg_per_m3 + params.drag_factor
    table = np.ones((3, len({z for z, _ in rows})))
    table[Z] = sorted({z for z, _ in rows})
    for row, profile in ((DENSITY, params.density_kg_per_m3), (FACTOR, params.drag_factor)):
        if profile:
            table[row] = np.interp(table[Z], *np.array(profile[::-1], dtype=float).T)
    if params.density_kg_per_m3:
        table[DENSITY] /= rho
    end = dict.fromkeys(AT_END, 0.0)
    if payload is not None and environment.carries:
        added = [float(mass) for mass in payload.added_mass_kg]
        k = [0.5 * rho * float(area) for area in payload.drag_area_m2]
        displaced = rho * float(payload.volume_m3)
        dA = dk = 0.0
        if payload.differs_rising:
            dA = 0.5 * float(payload.rising_added_mass_kg - added[2])
            dk = 0.5 * (0.5 * rho * float(payload.rising_drag_area_m2) - k[2])
        end = {
            "buoyancy": displaced * g, "Ax": added[0], "Ay": added[1], "Az": added[2] + dA,
            "kx": k[0], "ky": k[1], "kz": k[2] + dk, "dA": dA, "dk": dk,
            "wx": displaced + added[0], "wy": displaced + added[1], "wz": displaced + added[2] + dA,
        }  # fmt: skip
    density = 0.0 if environment.wets or not params.density_kg_per_m3 else rho
    return DepthProfiles(
        table=table,
        lift=density * g,
        added=density * float(environment.added_mass),
        axial=density * float(environment.added_mass_along),
        **end,
    )


@jit_within
def _rows_of_one(table: Any, z: float) -> Any:
    low, high = 0, table.shape[1] - 1
    while high - low > 1:
        middle = (low + high) // 2
        if table[Z, middle] <= z:
            low = middle
        else:
            high = middle
    return (
        (table[Z, low], table[DENSITY, low], table[FACTOR, low]),
        (table[Z, high], table[DENSITY, high], table[FACTOR, high]),
    )


@jit_within
def _rows_of_lanes(table: Any, z: Any) -> Any:
    last = table.shape[1] - 1
    z0, density0, factor0 = table[Z, 0], table[DENSITY, 0], table[FACTOR, 0]
    k = min(1, last)
    z1, density1, factor1 = table[Z, k], table[DENSITY, k], table[FACTOR, k]
    for j in range(1, last):
        beyond, k = table[Z, j] <= z, j + 1
        z0, z1 = choose(beyond, table[Z, j], z0), choose(beyond, table[Z, k], z1)
        density0 = choose(beyond, table[DENSITY, j], density0)
        density1 = choose(beyond, table[DENSITY, k], density1)
        factor0 = choose(beyond, table[FACTOR, j], factor0)
        factor1 = choose(beyond, table[FACTOR, k], factor1)
    return (z0, density0, factor0), (z1, density1, factor1)


# The rows of a table below and above an elevation, (z, density, factor) each.
_rows_around = by_width(_rows_of_one, _rows_of_lanes)


@jit_within
def _at(table: Any, z: Any) -> Any:
    """Return density over the scene's and its slope [1/m], and the drag factor, at elevation z."""
    low, high = _rows_around(table, z)
    rise = high[Z] - low[Z] + DIVISOR_MIN
    fraction = min(max((z - low[Z]) / rise, 0.0), 1.0)
    more = high[DENSITY] - low[DENSITY]
    inside = choose(fraction > 0.0, choose(fraction < 1.0, 1.0, 0.0), 0.0)
    factor = low[FACTOR] + fraction * (high[FACTOR] - low[FACTOR])
    return low[DENSITY] + fraction * more, inside * more / rise, factor


@kernel("submerge", DepthProfiles, wide=True)
def submerge(profiles: Any, node: Any) -> Any:
    """Return the node with the volume and the areas that weigh as much in water of density ρ0."""
    ratio, _, factor = _at(profiles.table, node.z)
    area = ratio * factor
    return Node(
        node.x, node.y, node.z, node.vx, node.vy, node.vz, node.ax, node.ay, node.az,
        node.tx, node.ty, node.tz, node.ux, node.uy, node.uz, node.wx, node.wy, node.wz,
        node.mass, ratio * node.volume, area * node.frontal, area * node.skin, node.length,
        node.surface, node.bare, node.touching,
    )  # fmt: skip


@wets(DepthProfiles)
def submerged_place(profiles: Any, place: Any) -> Any:
    """Return the place with the volume and the areas that the kernels see."""
    z = place.position[2]
    ratio = np.interp(z, profiles.table[Z], profiles.table[DENSITY])
    area = ratio * np.interp(z, profiles.table[Z], profiles.table[FACTOR])
    return place._replace(
        volume=ratio * place.volume, frontal=area * place.frontal, skin=area * place.skin
    )


account_submerged(DepthProfiles)


@kernel("load_end", DepthProfiles, wide=True)
def load_end(end: Any, work: Any, stage: Any) -> None:
    """Add (ρ/ρ0 - 1)·(ρ0·V·g·ẑ + (ρ0·V + A)·a_water - A·a - k·|u|·u) to R_0.

    A and k along z are those of ascent or descent, as `payload` has them. The block is symmetric:
    its entries off the diagonal are means.
    """
    _, _, z = rows(work, POSITION, 0)
    ax, ay, az = rows(work, ACCELERATION, 0)
    wx, wy, wz = rows(work, FLOW_RATE, 0)
    Rx, Ry, Rz = rows(work, RESIDUAL, 0)
    Axx, Axy, Axz, Ayy, Ayz, Azz = span(work, BLOCK, 6, 0)
    ratio, slope, _ = _at(end.table, z[0])
    more = ratio - 1.0
    x, y, w = end_relative(work)
    speed = sqrt(x * x + y * y + w * w + SPEED2_MIN)
    near = w * w + TURN2
    root = sqrt(near)
    Az, kz = end.Az + end.dA * w / root, end.kz + end.dk * w / root
    coupling = TURN2 / (near * root)
    fx = end.wx * wx[0] - end.Ax * ax[0] - end.kx * speed * x
    fy = end.wy * wy[0] - end.Ay * ay[0] - end.ky * speed * y
    water = end.wz + end.dA * w / root
    fz = end.buoyancy + water * wz[0] - Az * az[0] - kz * speed * w
    Rx[0] += more * fx
    Ry[0] += more * fy
    Rz[0] += more * fz
    q, g, rise = more * stage.q, more * stage.q / speed, stage.p * slope
    Axx[0] += more * end.Ax + q * end.kx * speed + g * end.kx * x * x
    Ayy[0] += more * end.Ay + q * end.ky * speed + g * end.ky * y * y
    Azz[0] += more * Az + q * kz * speed + g * kz * w * w - rise * fz
    Azz[0] += q * coupling * (end.dA * (az[0] - wz[0]) + end.dk * speed * w)
    Axy[0] += 0.5 * g * (end.kx + end.ky) * x * y
    Axz[0] += 0.5 * g * (end.kx + kz) * x * w - 0.5 * rise * fx
    Ayz[0] += 0.5 * g * (end.ky + kz) * y * w - 0.5 * rise * fy


@account("power_end", DepthProfiles)
def power_end(end: Any, place: Any) -> Any:
    """Return the power of the loads on the payload beyond those in water of density ρ0 [W]."""
    more = np.interp(place.position[2], end.table[Z], end.table[DENSITY]) - 1.0
    u = place.velocity - place.flow
    turn = u[2] / np.sqrt(u[2] ** 2 + TURN2)
    added = np.stack([end.Ax + 0.0 * turn, end.Ay + 0.0 * turn, end.Az + end.dA * turn])
    k = np.stack([end.kx + 0.0 * turn, end.ky + 0.0 * turn, end.kz + end.dk * turn])
    wet = np.stack([end.wx + 0.0 * turn, end.wy + 0.0 * turn, end.wz + end.dA * turn])
    force = wet * place.flow_rate - added * place.acceleration
    force = force - k * np.sqrt((u * u).sum(axis=0)) * u
    force[2] += end.buoyancy
    return more * (force * place.velocity).sum(axis=0)
