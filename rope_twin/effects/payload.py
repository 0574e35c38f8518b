"""Payload at the rope's lower end, a point, deep in the water and at its surface.

**payload**: Payload at the rope's lower end, a point: mass, added mass, weight in water, drag per
axis.

Axes are the world's (x, y lateral, z vertical). Drag along axis k: -½·ρ·CdA_k·|u|·u_k with the
velocity u relative to the water (Morison et al. 1950).

A grab or a skip has different faces above and below (Hoerner 1965, 3-17; DNV-RP-N103, table B-2).
Its coefficients along z blend with w, the vertical velocity relative to the water, from those of
descent to those of ascent: c(w) = c_mean + c_half·w/√(w² + δ²) with δ = 0.05 m/s, so that the force
has a slope where the body reverses. Its added mass acts with the acceleration relative to the water
(Morison et al. 1950): `waves` has the water's acceleration times that of descent, and the excess
c(w) - c_descent is added here. Its kinetic energy contains the mean added mass; the power of the
rest is charged to the water's account.

**splash_zone**: Payload in the splash zone: buoyancy, added mass and drag follow the submergence
ratio.

The submergence ratio is β = (η - z_bottom)/H, from 0 in air to 1 below the surface η (0 without
`waves`), for a body of constant cross-section over its height H (DNV-RP-N103, 4.2 to 4.4).
`payload` and `waves` load the whole body; this effect subtracts (1 - β) of their loads. While the
body enters with the speed v_s relative to the surface, slamming acts upward with ½·ρ·C_s·A·v_s²
over its slamming area A (DNV-RP-N103, 4.3.8; C_s at least 5 except for smooth cylinders).
C_s is constant over the height: at a constant speed the impulse of entry is ½·ρ·C_s·A·H·v_s. It is
that of the added mass, A33·v_s, for C_s = 2·A33/(ρ·A·H).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import Any, NamedTuple

import numpy as np

from rope_twin.core.jit.decorators import jit_exact_within, jit_within
from rope_twin.core.jit.rows import row, rows, span
from rope_twin.core.jit.wide import bits, choose
from rope_twin.core.loads.accounts import account
from rope_twin.core.loads.balance import end_relative
from rope_twin.core.loads.hooks import (
    differs_by_rope,
    has_active_set,
    kernel,
    scales_with_ramp,
    wide_kernel,
)
from rope_twin.core.state import (
    ACCELERATION,
    BLOCK,
    CORRECTION,
    FLOW_RATE,
    POSITION,
    RESIDUAL,
    SPEED2_MIN,
    SURFACE,
    TURN2,
)
from rope_twin.quantity import quantity


@dataclass(frozen=True, kw_only=True)
class PayloadParams:
    """Without parameters: the properties are those of the scene's payload."""


class Payload(NamedTuple):
    """Kernel data; mass includes the added mass."""

    W: float  # weight in water [N]
    Mx: float  # [kg]
    My: float
    Mz: float
    kx: float  # ½·ρ·CdA [kg/m]
    ky: float
    kz: float


class TwoWayPayload(NamedTuple):
    """Kernel data of a payload with different ascent and descent; masses include the added mass."""

    W: float  # weight in water [N]
    Mx: float  # [kg]
    My: float
    Mz: float  # mean of ascent and descent
    kx: float  # ½·ρ·CdA [kg/m]
    ky: float
    kz: float  # mean of ascent and descent
    dM: float  # half the difference of the mass, ascent less descent [kg]
    dk: float  # half the difference of the drag, ascent less descent [kg/m]
    dw: float  # dM of the water's acceleration [kg]


scales_with_ramp(Payload, "kx", "ky", "kz")
scales_with_ramp(TwoWayPayload, "kx", "ky", "kz", "dk", "dw")
differs_by_rope(Payload, TwoWayPayload)


def build(params: PayloadParams, payload: Any, environment: Any) -> Payload | TwoWayPayload:
    """Return the kernel data for mass, volume, added mass and drag area, and the water."""
    density = environment.water_density_kg_per_m3
    mass = [payload.mass_kg + added for added in payload.added_mass_kg]
    k = [0.5 * density * area for area in payload.drag_area_m2]
    weight = (payload.mass_kg - density * payload.volume_m3) * environment.gravity_m_per_s2
    plain = Payload(float(weight), *(float(value) for value in (*mass, *k)))
    if not (payload.differs_rising or environment.two_way):
        return plain
    dM = 0.5 * float(payload.rising_added_mass_kg - payload.added_mass_kg[2])
    dk = 0.25 * float(density * (payload.rising_drag_area_m2 - payload.drag_area_m2[2]))
    mean = plain._replace(Mz=plain.Mz + dM, kz=plain.kz + dk)
    return TwoWayPayload(*mean, dM=dM, dk=dk, dw=dM)


@jit_within
def _resist(load: Any, work: Any, q: float, relative: Any, along: Any) -> None:
    """Add inertia, drag and weight; along: mass with added mass, and drag, along z."""
    ax, ay, az = rows(work, ACCELERATION, 0)
    Rx, Ry, Rz = rows(work, RESIDUAL, 0)
    Axx, Axy, Axz, Ayy, Ayz, Azz = span(work, BLOCK, 6, 0)
    (x, y, z, speed), (Mz, k) = relative, along
    kx, ky, kz = load.kx * speed, load.ky * speed, k * speed
    Rx[0] -= load.Mx * ax[0] + kx * x
    Ry[0] -= load.My * ay[0] + ky * y
    Rz[0] -= Mz * az[0] + kz * z + load.W
    g = q / speed
    Axx[0] += load.Mx + q * kx + g * load.kx * x * x
    Ayy[0] += load.My + q * ky + g * load.ky * y * y
    Azz[0] += Mz + q * kz + g * k * z * z
    Axy[0] += 0.5 * g * (load.kx + load.ky) * x * y
    Axz[0] += 0.5 * g * (load.kx + k) * x * z
    Ayz[0] += 0.5 * g * (load.ky + k) * y * z


@kernel("load_end", Payload, wide=True)
def load_end(load: Any, work: Any, stage: Any) -> None:
    """Subtract M·a + k·|u|·u + W·ẑ from R_0; add M + q·k·(|u|·I + u·uᵀ/|u|) to A_0.

    With different k per axis the exact derivative is not symmetric; its off-diagonal entries are
    replaced by their means.
    """
    x, y, z = end_relative(work)
    speed = sqrt(x * x + y * y + z * z + SPEED2_MIN)
    _resist(load, work, stage.q, (x, y, z, speed), (load.Mz, load.kz))


@account("kinetic_end", Payload)
@account("kinetic_end", TwoWayPayload)
def kinetic(load: Any, place: Any) -> Any:
    """Return ½·v·M·v including the added mass (mean of ascent and descent) [J]."""
    mass = np.array([[load.Mx], [load.My], [load.Mz]])
    return 0.5 * (mass * place.velocity**2).sum(axis=0)


@account("potential_end", Payload)
@account("potential_end", TwoWayPayload)
def potential(load: Any, place: Any) -> Any:
    """Return weight in water times height [J]."""
    return load.W * place.position[2]


@account("power_end", Payload)
def power(load: Any, place: Any) -> Any:
    """Return drag times velocity [W]."""
    u = place.velocity - place.flow
    k = np.array([[load.kx], [load.ky], [load.kz]])
    return -(k * np.sqrt((u * u).sum(axis=0)) * u * place.velocity).sum(axis=0)


@kernel("load_end", TwoWayPayload, wide=True)
def load_end_two_way(load: Any, work: Any, stage: Any) -> None:
    """Subtract M(w)·a + k(w)·|u|·u + W·ẑ from R_0, and add (M(w) - M_descent)·a_water.

    Their symmetrised derivative is added to A_0.
    """
    _, _, az = rows(work, ACCELERATION, 0)
    _, _, wz = rows(work, FLOW_RATE, 0)
    _, _, Rz = rows(work, RESIDUAL, 0)
    _, _, _, _, _, Azz = span(work, BLOCK, 6, 0)
    x, y, z = end_relative(work)
    speed = sqrt(x * x + y * y + z * z + SPEED2_MIN)
    near = z * z + TURN2
    root = sqrt(near)
    along = load.Mz + load.dM * z / root, load.kz + load.dk * z / root
    slope = TURN2 / (near * root)
    _resist(load, work, stage.q, (x, y, z, speed), along)
    Rz[0] += load.dw * (1.0 + z / root) * wz[0]
    Azz[0] += stage.q * slope * (load.dM * az[0] + load.dk * speed * z - load.dw * wz[0])


def _share(w: Any) -> Any:
    """Return -1 in descent, 1 in ascent, smooth in between."""
    return w / np.sqrt(w * w + TURN2)


@account("power_end", TwoWayPayload)
def power_two_way(load: Any, place: Any) -> Any:
    """Return the power of drag and of the added mass beyond what others account for [W].

    The kinetic energy has the mean of the added mass, `waves` that of descent.
    """
    u = place.velocity - place.flow
    share = _share(u[2])
    k = np.stack([load.kx + 0.0 * share, load.ky + 0.0 * share, load.kz + load.dk * share])
    force = k * np.sqrt((u * u).sum(axis=0)) * u
    force[2] += load.dM * share * place.acceleration[2]
    force[2] -= load.dw * (1.0 + share) * place.flow_rate[2]
    return -(force * place.velocity).sum(axis=0)


@dataclass(frozen=True, kw_only=True)
class SplashZoneParams:
    """Size of the payload (each one's in a multi-line system); its node is at mid-height."""

    height_m: float = quantity("height of the payload", "m", 0.01, 100.0)
    bottom_area_m2: float = quantity("slamming area A", "m²", 0.0, 1e4, default=0.0)
    slamming: float = quantity("slamming coefficient C_s", "", 0.0, 20.0, default=5.0)


class SplashZone(NamedTuple):
    """Kernel data of the splash zone."""

    height: float  # [m]
    lift: float  # ρ·V·g of the whole body [N]
    slam: float  # ½·ρ·C_s·A [kg/m]
    wet: tuple[float, float, float]  # ρ·V + added mass, inertia in waves [kg]
    added: tuple[float, float, float]  # added mass [kg]
    k: tuple[float, float, float]  # ½·ρ·CdA [kg/m]


scales_with_ramp(SplashZone, "slam", "wet", "k")
differs_by_rope(SplashZone)


def build_splash_zone(params: SplashZoneParams, payload: Any, environment: Any) -> SplashZone:
    """Return the kernel data for the payload's properties and the water."""
    density = environment.water_density_kg_per_m3
    volume = payload.volume_m3 if payload is not None else 0.0
    added = payload.added_mass_kg if payload is not None else (0.0, 0.0, 0.0)
    area = payload.drag_area_m2 if payload is not None else (0.0, 0.0, 0.0)
    x, y, z = (float(mass) for mass in added)
    kx, ky, kz = (0.5 * density * float(CdA) for CdA in area)
    own = density * volume
    return SplashZone(
        height=params.height_m,
        lift=float(own * environment.gravity_m_per_s2),
        slam=0.5 * density * params.slamming * params.bottom_area_m2,
        wet=(own + x, own + y, own + z),
        added=(x, y, z),
        k=(kx, ky, kz),
    )


@kernel("load_end", SplashZone, wide=True, exact=True)
def splash_load_end(zone: Any, work: Any, stage: Any) -> None:
    """Add (1 - β)·(A·a + k·|u|·u - ρVg·ẑ - (ρV + A)·a_water) + slamming to R_0.

    The block is reduced by the same fraction of added mass and drag; while the body is partly
    submerged it contains β's change with height, whose off-diagonal entries are not symmetric
    (their means are taken), and the slope of slamming.
    """
    _, _, z = rows(work, POSITION, 0)
    ax, ay, az = rows(work, ACCELERATION, 0)
    wx, wy, wz = rows(work, FLOW_RATE, 0)
    Rx, Ry, Rz = rows(work, RESIDUAL, 0)
    Axx, Axy, Axz, Ayy, Ayz, Azz = span(work, BLOCK, 6, 0)
    share = (row(work, SURFACE, 0)[0] - z[0]) / zone.height + 0.5
    dry = 1.0 - min(max(share, 0.0), 1.0)
    x, y, w = end_relative(work)
    speed = sqrt(x * x + y * y + w * w + SPEED2_MIN)
    kx, ky, kz = dry * zone.k[0], dry * zone.k[1], dry * zone.k[2]
    mx, my, mz = dry * zone.added[0], dry * zone.added[1], dry * zone.added[2]
    partly = choose(share > 0.0, choose(share < 1.0, 1.0, 0.0), 0.0)
    entering = partly * max(-w, 0.0)
    slam = zone.slam * entering
    fx = zone.added[0] * ax[0] + zone.k[0] * speed * x - zone.wet[0] * wx[0]
    fy = zone.added[1] * ay[0] + zone.k[1] * speed * y - zone.wet[1] * wy[0]
    fz = zone.added[2] * az[0] + zone.k[2] * speed * w - zone.wet[2] * wz[0] - zone.lift
    Rx[0] += dry * fx
    Ry[0] += dry * fy
    Rz[0] += dry * fz + slam * entering
    q, g, rise = stage.q, stage.q / speed, partly * stage.p / zone.height
    Axx[0] -= mx + q * kx * speed + g * kx * x * x
    Ayy[0] -= my + q * ky * speed + g * ky * y * y
    Azz[0] -= mz + q * kz * speed + g * kz * w * w
    Azz[0] += 2.0 * q * slam - rise * fz
    Axy[0] -= 0.5 * g * (kx + ky) * x * y
    Axz[0] -= 0.5 * g * (kx + kz) * x * w + 0.5 * rise * fx
    Ayz[0] -= 0.5 * g * (ky + kz) * y * w + 0.5 * rise * fy


@jit_exact_within
def _wet_shares(zone: Any, work: Any, stage: Any, share: Any) -> Any:
    """Return the least and the most of the wetted share, unlimited, now and after share·delta."""
    _, _, z = rows(work, POSITION, 0)
    _, _, dz = rows(work, CORRECTION, 0)
    wet = (row(work, SURFACE, 0)[0] - z[0]) / zone.height + 0.5
    then = wet - share * stage.p * dz[0] / zone.height
    return min(wet, then), max(wet, then)


@kernel("unchanged", SplashZone)
def unchanged(zone: Any, work: Any, stage: Any, n: int, share: float) -> bool:
    """Return whether the body is and stays fully submerged or fully dry."""
    least, most = _wet_shares(zone, work, stage, share)
    return bool(least >= 1.0 or most <= 0.0)


@wide_kernel("unchanged", SplashZone)
def unchanged_wide(zone: Any, work: Any, stage: Any, n: int, share: float) -> int:
    """Return the lanes in which the body is and stays fully submerged or fully dry, as bits."""
    least, most = _wet_shares(zone, work, stage, share)
    return int(bits(least >= 1.0) | bits(most <= 0.0))


has_active_set(SplashZone)


@account("power_end", SplashZone)
def splash_power(zone: Any, place: Any) -> Any:
    """Return the power of all loads subtracted [W]; energy stored at the surface is given back."""
    share = (place.surface - place.position[2]) / zone.height + 0.5
    dry = 1.0 - np.clip(share, 0.0, 1.0)
    u = place.velocity - place.flow
    k, added, wet = (np.array(part)[:, None] for part in (zone.k, zone.added, zone.wet))
    force = dry * (
        added * place.acceleration + k * np.sqrt((u * u).sum(axis=0)) * u - wet * place.flow_rate
    )
    entering = np.where((share > 0.0) & (share < 1.0), np.maximum(-u[2], 0.0), 0.0)
    force[2] += zone.slam * entering**2 - dry * zone.lift
    return (force * place.velocity).sum(axis=0)
