"""Seabed contact of rope and payload: unilateral normal force and friction.

Hunt and Crossley (1975): at the penetration d [m], normal to the seabed, and the speed v_n away
from it, N = k·d·(1 - χ·v_n), at least 0: continuous at touchdown and at lift-off, dissipative in
between. k is the modulus of subgrade reaction [N/m³] times the rope's projected area d·l, or the
payload's own stiffness. Coulomb friction, μ·N opposing the sliding velocity v_t, is regularised:
μ·N·v_t/√(|v_t|² + v_0²) (Oden and Martins 1985), so it vanishes at rest; `bed_friction` is one
that sticks.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from math import sqrt
from typing import Any

import numpy as np

from rope_twin.core.bed import Grid, Plane, Soil
from rope_twin.core.bed_shape import beds_at, grid_bed, plane_bed
from rope_twin.core.jit.decorators import jit_within
from rope_twin.core.jit.functions import anywhere
from rope_twin.core.jit.rows import rows
from rope_twin.core.jit.wide import ALL, bits, choose
from rope_twin.core.loads.accounts import account
from rope_twin.core.loads.balance import add_to_node
from rope_twin.core.loads.hooks import Load, has_active_set, kernel, wide_kernel
from rope_twin.core.state import CORRECTION, POSITION, VELOCITY, Floats
from rope_twin.quantity import quantity, text

FRICTION_SPEED = 0.01  # v_0: friction is within 0.5 % of μ·N from ten times this on [m/s]


@dataclass(frozen=True, kw_only=True)
class Soundings:
    """Depths on a rectangular grid, linear in between and level beyond it."""

    x_m: tuple[float, ...] = quantity("x (east) of the columns, ascending", "m", -1e6, 1e6)
    y_m: tuple[float, ...] = quantity("y (north) of the rows, ascending", "m", -1e6, 1e6)
    depth_m: tuple[tuple[float, ...], ...] = quantity(
        "depths: one row per y, one value per x", "m", 1.0, 12e3
    )

    def check(self) -> str | None:
        """Return a fault of order or shape, or None."""
        for name, axis in (("x_m", self.x_m), ("y_m", self.y_m)):
            if len(axis) < 2:
                return f"{name} has {len(axis)} values; give at least 2"
            if any(b <= a for a, b in itertools.pairwise(axis)):
                return f"{name} is not ascending; order it"
        sizes = {len(row) for row in self.depth_m}
        if len(self.depth_m) != len(self.y_m) or sizes != {len(self.x_m)}:
            return (
                f"depth_m is {len(self.depth_m)} rows of {sorted(sizes)}; give {len(self.y_m)} rows"
                f" of {len(self.x_m)}"
            )
        return None


@dataclass(frozen=True, kw_only=True)
class SeabedParams:
    """Position of the seabed, exactly one of `depth_m` and `soundings`, and soil properties."""

    depth_m: float | None = quantity("water depth at the origin", "m", 1.0, 12e3, default=None)
    slope: tuple[float, float] = quantity(
        "slope of the seabed, rise per metre east, north", "", -1.0, 1.0, default=(0.0, 0.0)
    )
    soundings: Soundings | None = text("water depths on a grid", None)
    stiffness_n_per_m3: float = quantity(
        "modulus of subgrade reaction: pressure over penetration of the rope", "N/m³", 1e2, 1e9,
        default=1e5,
    )  # fmt: skip
    payload_penetration_m: float = quantity(
        "penetration under the payload's weight in water", "m", 1e-4, 5.0, default=0.05
    )
    damping_s_per_m: float = quantity(
        "damping χ of N = k·d·(1 - χ·v)", "s/m", 0.0, 10.0, default=1.0
    )
    friction: float = quantity("friction coefficient μ", "", 0.0, 2.0, default=0.5)

    def check(self) -> str | None:
        """Return a fault if the seabed is not given exactly once, or None."""
        if (self.depth_m is None) == (self.soundings is None):
            given = "no depth" if self.depth_m is None else "two seabeds"
            return f"{given}; give depth_m (with a slope, if any) or soundings"
        if self.soundings is not None and self.slope != (0.0, 0.0):
            return "soundings define the slope; remove slope"
        return None


def build(params: SeabedParams, payload: Any, environment: Any) -> Plane | Grid:
    """Return the seabed for its parameters and the payload's weight in water."""
    weight = 0.0
    if payload is not None:
        density, g = environment.water_density_kg_per_m3, environment.gravity_m_per_s2
        weight = max((payload.mass_kg - density * payload.volume_m3) * g, 0.1 * payload.mass_kg * g)
    soil = Soil(
        params.stiffness_n_per_m3,
        weight / params.payload_penetration_m,
        params.damping_s_per_m,
        0.0 if environment.sticks else params.friction,
    )
    if params.soundings is not None:
        bed = params.soundings
        height = -np.array(bed.depth_m, dtype=float)
        return Grid(float(height.max()), np.array(bed.x_m), np.array(bed.y_m), height, soil)
    assert params.depth_m is not None, "checked when the scene was read"
    return Plane(-params.depth_m, params.slope[0], params.slope[1], soil)


@jit_within
def _contact(soil: Any, k: float, bed: Any, v: Any, stage: Any) -> Any:
    """Return the contact force of the seabed on a node as a Load.

    bed: (height above the seabed, slope east, slope north). The block is p·k·(1 - χ·v_n) +
    q·χ·k·d along the normal and q·μ·N/√(|v_t|² + v_0²) tangentially; omitted: the change of
    friction with N and of the root.
    """
    above, east, north = bed
    vx, vy, vz = v
    nz = 1.0 / sqrt(1.0 + east * east + north * north)
    nx, ny = -east * nz, -north * nz
    d = max(-above * nz, 0.0)
    speed = vx * nx + vy * ny + vz * nz
    gain = max(1.0 - soil.chi * speed, 0.0)
    push = k * d * gain
    tx, ty, tz = vx - speed * nx, vy - speed * ny, vz - speed * nz
    rub = soil.mu * push / sqrt(tx * tx + ty * ty + tz * tz + FRICTION_SPEED * FRICTION_SPEED)
    touches = choose(push > 0.0, 1.0, 0.0)
    across = stage.q * rub
    along = touches * (stage.p * k * gain + stage.q * soil.chi * k * d) - across
    return Load(
        push * nx - rub * tx, push * ny - rub * ty, push * nz - rub * tz,
        across + along * nx * nx, along * nx * ny, along * nx * nz,
        across + along * ny * ny, along * ny * nz, across + along * nz * nz,
    )  # fmt: skip


@jit_within
def _at_node(soil: Any, bed: Any, node: Any, stage: Any) -> Any:
    k = soil.k * node.touching
    return _contact(soil, k, bed, (node.vx, node.vy, node.vz), stage)


@kernel("load", Plane, wide=True)
def plane_load(bed: Any, node: Any, stage: Any) -> Any:
    """Return the contact force of a plane seabed on a node of the rope."""
    z, east, north = plane_bed(bed, node.x, node.y)
    return _at_node(bed.soil, (node.z - z, east, north), node, stage)


@kernel("load", Grid, wide=True)
def grid_load(bed: Any, node: Any, stage: Any) -> Any:
    """Return the contact force of a gridded seabed on a node of the rope."""
    if not anywhere(node.z <= bed.top):
        none = 0.0 * node.length
        return Load(none, none, none, none, none, none, none, none, none)
    z, east, north = grid_bed(bed, node.x, node.y)
    return _at_node(bed.soil, (node.z - z, east, north), node, stage)


@jit_within
def _at_end(soil: Any, bed: Any, work: Any, stage: Any) -> None:
    """Add the contact force on the payload."""
    _, _, z = rows(work, POSITION, 0)
    vx, vy, vz = rows(work, VELOCITY, 0)
    height, east, north = bed
    bed_here, velocity = (z[0] - height, east, north), (vx[0], vy[0], vz[0])
    add_to_node(work, 0, _contact(soil, soil.k_payload, bed_here, velocity, stage))


@kernel("load_end", Plane, wide=True)
def plane_load_end(bed: Any, work: Any, stage: Any) -> None:
    """Add the contact force of a plane seabed on the payload."""
    x, y, _ = rows(work, POSITION, 0)
    _at_end(bed.soil, plane_bed(bed, x[0], y[0]), work, stage)


@kernel("load_end", Grid, wide=True)
def grid_load_end(bed: Any, work: Any, stage: Any) -> None:
    """Add the contact force of a gridded seabed on the payload."""
    x, y, _ = rows(work, POSITION, 0)
    _at_end(bed.soil, grid_bed(bed, x[0], y[0]), work, stage)


@jit_within
def _is_clear(bed: Any, work: Any, p: float, n: int) -> bool:
    """Return whether all n nodes are above a plane, now and after moving by p·delta."""
    height, east, north = bed
    x, y, z = rows(work, POSITION, 0)
    dx, dy, dz = rows(work, CORRECTION, 0)
    low = 0
    for i in range(n):
        above = z[i] - (height + east * x[i] + north * y[i])
        change = p * (dz[i] - east * dx[i] - north * dy[i])
        low += not min(above, above + change) > 0.0
    return low == 0


@kernel("unchanged", Plane)
def plane_unchanged(bed: Any, work: Any, stage: Any, n: int, share: float) -> bool:
    """Return whether nothing touches the seabed."""
    plane = (bed.height, bed.east, bed.north)
    return bool(_is_clear(plane, work, share * stage.p, n))


@jit_within
def _clear_lanes(bed: Any, work: Any, p: float, n: int) -> int:
    """Return the lanes of which all n nodes are above a plane, now and after moving by p·delta."""
    height, east, north = bed
    x, y, z = rows(work, POSITION, 0)
    dx, dy, dz = rows(work, CORRECTION, 0)
    clear = ALL
    for i in range(n):
        above = z[i] - (height + east * x[i] + north * y[i])
        change = p * (dz[i] - east * dx[i] - north * dy[i])
        clear &= bits(min(above, above + change) > 0.0)
    return int(clear)


@wide_kernel("unchanged", Plane)
def plane_unchanged_wide(bed: Any, work: Any, stage: Any, n: int, share: float) -> int:
    """Return the lanes of a SIMD batch of which nothing touches the seabed, as bits."""
    plane = (bed.height, bed.east, bed.north)
    return int(_clear_lanes(plane, work, share * stage.p, n))


@kernel("unchanged", Grid)
def grid_unchanged(bed: Any, work: Any, stage: Any, n: int, share: float) -> bool:
    """Return whether all nodes are above the highest point of the seabed."""
    return bool(_is_clear((bed.top, 0.0, 0.0), work, share * stage.p, n))


@wide_kernel("unchanged", Grid)
def grid_unchanged_wide(bed: Any, work: Any, stage: Any, n: int, share: float) -> int:
    """Return the lanes of which all nodes are above the highest point of the seabed, as bits."""
    return int(_clear_lanes((bed.top, 0.0, 0.0), work, share * stage.p, n))


def _pushed(bed: Any, k: Any, place: Any) -> Any:
    """Return contact force and friction on nodes, (3, nodes), for stiffnesses k (nodes,) [N/m]."""
    v = place.velocity
    _, east, north = beds_at(bed, place.position[0].copy(), place.position[1].copy())
    nz = 1.0 / np.sqrt(1.0 + east * east + north * north)
    normal = np.stack([-east * nz, -north * nz, nz])
    push = normal_push(bed, k, place.position, v)
    sliding = v - (v * normal).sum(axis=0) * normal
    speed = np.sqrt((sliding * sliding).sum(axis=0) + FRICTION_SPEED * FRICTION_SPEED)
    return push * normal - bed.soil.mu * push / speed * sliding


def normal_push(bed: Plane | Grid, k: Any, position: Floats, velocity: Floats) -> Floats:
    """Return the normal force of the seabed, k·d·(1 - χ·v_n) [N], for stiffness k [N/m], (n,)."""
    height, east, north = beds_at(bed, position[0].copy(), position[1].copy())
    nz = 1.0 / np.sqrt(1.0 + east * east + north * north)
    speed = (velocity[2] - east * velocity[0] - north * velocity[1]) * nz
    sunk = np.maximum((height - position[2]) * nz, 0.0)
    return np.asarray(k * sunk * np.maximum(1.0 - bed.soil.chi * speed, 0.0))


def power(bed: Any, place: Any) -> Any:
    """Return the power of contact and friction [W]; energy stored in the soil is given back."""
    return (_pushed(bed, bed.soil.k * place.touching, place) * place.velocity).sum(axis=0)


def power_end(bed: Any, place: Any) -> Any:
    """Return the power of contact and friction on the payload [W]."""
    return (_pushed(bed, bed.soil.k_payload, place) * place.velocity).sum(axis=0)


for _kind in (Plane, Grid):
    has_active_set(_kind)
    account("power", _kind)(power)
    account("power_end", _kind)(power_end)
