"""Payload at the rope's lower end, a point: mass, added mass, weight in water, drag per axis.

Axes are the world's (x, y lateral, z vertical). Drag along axis k: -½·ρ·CdA_k·|u|·u_k with the
velocity u relative to the water (Morison et al. 1950).

A grab or a skip has different faces above and below (Hoerner 1965, 3-17; DNV-RP-N103, table B-2).
Its coefficients along z blend with w, the vertical velocity relative to the water, from those of
descent to those of ascent: c(w) = c_mean + c_half·w/√(w² + δ²) with δ = 0.05 m/s, so that the force
has a slope where the body reverses. Its kinetic energy contains the mean added mass; the power of
the rest is charged to the water's account.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import Any, NamedTuple

import numpy as np

from rope_twin.core.energy import account
from rope_twin.core.jit.rows import rows, span
from rope_twin.core.joined.stack import stacks
from rope_twin.core.loads.hooks import grows, kernel
from rope_twin.core.state import (
    ACCELERATION,
    BLOCK,
    FLOW,
    RESIDUAL,
    SPEED2_MIN,
    TURN2,
    VELOCITY,
    Floats,
)


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


grows(Payload, "kx", "ky", "kz")
grows(TwoWayPayload, "kx", "ky", "kz", "dk")


class Payloads(NamedTuple):
    """Kernel data of the payloads of a multi-line system."""

    figures: Floats  # the fields of Payload, (ropes, 7)


class TwoWayPayloads(NamedTuple):
    """Kernel data of a multi-line system's payloads, one of which differs in ascent."""

    figures: Floats  # the fields of TwoWayPayload, (ropes, 9)


def _pick(payloads: Any, r: int) -> Any:
    f = payloads.figures[r]
    return Payload(f[0], f[1], f[2], f[3], f[4], f[5], f[6])


def _pick_two_way(payloads: Any, r: int) -> Any:
    f = payloads.figures[r]
    return TwoWayPayload(f[0], f[1], f[2], f[3], f[4], f[5], f[6], f[7], f[8])


@stacks(Payload, Payloads, _pick)
def stack(payloads: Any) -> Payloads:
    """Stack the kernel data of several payloads."""
    return Payloads(np.array(payloads, dtype=float))


@stacks(TwoWayPayload, TwoWayPayloads, _pick_two_way)
def stack_two_way(payloads: Any) -> TwoWayPayloads:
    """Stack the kernel data of several payloads, one of which differs in ascent and descent."""
    return TwoWayPayloads(np.array(payloads, dtype=float))


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
    return TwoWayPayload(*mean, dM=dM, dk=dk)


@kernel("load_end", Payload, wide=True)
def load_end(load: Any, work: Any, stage: Any) -> None:
    """Subtract M·a + k·|u|·u + W·ẑ from R_0; add M + q·k·(|u|·I + u·uᵀ/|u|) to A_0.

    With different k per axis the exact derivative is not symmetric; its off-diagonal entries are
    replaced by their means.
    """
    vx, vy, vz = rows(work, VELOCITY, 0)
    ux, uy, uz = rows(work, FLOW, 0)
    ax, ay, az = rows(work, ACCELERATION, 0)
    Rx, Ry, Rz = rows(work, RESIDUAL, 0)
    Axx, Axy, Axz, Ayy, Ayz, Azz = span(work, BLOCK, 6, 0)
    x, y, z = vx[0] - ux[0], vy[0] - uy[0], vz[0] - uz[0]
    speed = sqrt(x * x + y * y + z * z + SPEED2_MIN)
    kx, ky, kz = load.kx * speed, load.ky * speed, load.kz * speed
    Rx[0] -= load.Mx * ax[0] + kx * x
    Ry[0] -= load.My * ay[0] + ky * y
    Rz[0] -= load.Mz * az[0] + kz * z + load.W
    q, g = stage.q, stage.q / speed
    Axx[0] += load.Mx + q * kx + g * load.kx * x * x
    Ayy[0] += load.My + q * ky + g * load.ky * y * y
    Azz[0] += load.Mz + q * kz + g * load.kz * z * z
    Axy[0] += 0.5 * g * (load.kx + load.ky) * x * y
    Axz[0] += 0.5 * g * (load.kx + load.kz) * x * z
    Ayz[0] += 0.5 * g * (load.ky + load.kz) * y * z


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
    """Subtract M(w)·a + k(w)·|u|·u + W·ẑ from R_0; add its symmetrised derivative to A_0."""
    vx, vy, vz = rows(work, VELOCITY, 0)
    ux, uy, uz = rows(work, FLOW, 0)
    ax, ay, az = rows(work, ACCELERATION, 0)
    Rx, Ry, Rz = rows(work, RESIDUAL, 0)
    Axx, Axy, Axz, Ayy, Ayz, Azz = span(work, BLOCK, 6, 0)
    x, y, z = vx[0] - ux[0], vy[0] - uy[0], vz[0] - uz[0]
    speed = sqrt(x * x + y * y + z * z + SPEED2_MIN)
    near = z * z + TURN2
    root = sqrt(near)
    Mz, k = load.Mz + load.dM * z / root, load.kz + load.dk * z / root
    slope = TURN2 / (near * root)
    kx, ky, kz = load.kx * speed, load.ky * speed, k * speed
    Rx[0] -= load.Mx * ax[0] + kx * x
    Ry[0] -= load.My * ay[0] + ky * y
    Rz[0] -= Mz * az[0] + kz * z + load.W
    q, g = stage.q, stage.q / speed
    Axx[0] += load.Mx + q * kx + g * load.kx * x * x
    Ayy[0] += load.My + q * ky + g * load.ky * y * y
    Azz[0] += Mz + q * kz + g * k * z * z
    Azz[0] += q * slope * (load.dM * az[0] + load.dk * speed * z)
    Axy[0] += 0.5 * g * (load.kx + load.ky) * x * y
    Axz[0] += 0.5 * g * (load.kx + k) * x * z
    Ayz[0] += 0.5 * g * (load.ky + k) * y * z


def _share(w: Any) -> Any:
    """Return -1 in descent, 1 in ascent, smooth in between."""
    return w / np.sqrt(w * w + TURN2)


@account("power_end", TwoWayPayload)
def power_two_way(load: Any, place: Any) -> Any:
    """Return the power of drag and of the added mass in excess of its mean [W]."""
    u = place.velocity - place.flow
    share = _share(u[2])
    k = np.stack([load.kx + 0.0 * share, load.ky + 0.0 * share, load.kz + load.dk * share])
    force = k * np.sqrt((u * u).sum(axis=0)) * u
    force[2] += load.dM * share * place.acceleration[2]
    return -(force * place.velocity).sum(axis=0)
