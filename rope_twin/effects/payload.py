"""The payload at the rope's lower end, a point: mass, added mass, weight in water, drag per axis.

Axes are the world's (x, y lateral, z vertical). Drag along axis k: -½·ρ·CdA_k·|u|·u_k with the
velocity u relative to the water (Morison et al. 1950).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import Any, NamedTuple

from rope_twin.core.state import ACCELERATION, BLOCK, FLOW, RESIDUAL, VELOCITY
from rope_twin.core.terms import kernel


@dataclass(frozen=True, kw_only=True)
class PayloadParams:
    """Nothing to choose here: the figures are those of the scene's payload."""


class Payload(NamedTuple):
    """What the kernel sees; mass includes the added mass."""

    W: float  # weight in water [N]
    Mx: float  # [kg]
    My: float
    Mz: float
    kx: float  # ½·ρ·CdA [kg/m]
    ky: float
    kz: float


def build(params: PayloadParams, payload: Any, environment: Any) -> Payload:
    """From the payload's mass, volume, added mass and drag area, and the water."""
    density = environment.water_density_kg_per_m3
    mass = [payload.mass_kg + added for added in payload.added_mass_kg]
    k = [0.5 * density * area for area in payload.drag_area_m2]
    weight = (payload.mass_kg - density * payload.volume_m3) * environment.gravity_m_per_s2
    return Payload(float(weight), *(float(value) for value in (*mass, *k)))


@kernel("load_end", Payload)
def load_end(load: Any, work: Any, stage: Any) -> None:
    """R_0 -= M·a + k·|u|·u + W·ẑ; A_0 += M + q·k·(|u|·I + u·uᵀ/|u|).

    With different k per axis the exact derivative is not symmetric; its off-diagonal parts are
    replaced by their means.
    """
    u0 = work[VELOCITY, 0] - work[FLOW, 0]
    u1 = work[VELOCITY + 1, 0] - work[FLOW + 1, 0]
    u2 = work[VELOCITY + 2, 0] - work[FLOW + 2, 0]
    speed = sqrt(u0 * u0 + u1 * u1 + u2 * u2 + 1e-20)
    work[RESIDUAL, 0] -= load.Mx * work[ACCELERATION, 0] + load.kx * speed * u0
    work[RESIDUAL + 1, 0] -= load.My * work[ACCELERATION + 1, 0] + load.ky * speed * u1
    work[RESIDUAL + 2, 0] -= load.Mz * work[ACCELERATION + 2, 0] + load.kz * speed * u2 + load.W
    q = stage.q
    work[BLOCK, 0] += load.Mx + q * load.kx * (speed + u0 * u0 / speed)
    work[BLOCK + 1, 0] += q * 0.5 * (load.kx + load.ky) * u0 * u1 / speed
    work[BLOCK + 2, 0] += q * 0.5 * (load.kx + load.kz) * u0 * u2 / speed
    work[BLOCK + 3, 0] += load.My + q * load.ky * (speed + u1 * u1 / speed)
    work[BLOCK + 4, 0] += q * 0.5 * (load.ky + load.kz) * u1 * u2 / speed
    work[BLOCK + 5, 0] += load.Mz + q * load.kz * (speed + u2 * u2 / speed)
