"""Faces that a payload turns to the flow: panels of netting, a fairing.

**net**: Net at the rope's lower end, spread normal to the flow: one panel, or several in a row.

The force of a panel follows from its angle to the flow and its solidity (core/loads/panel: Aarsnes,
Rudi, Løland 1990; Løland 1991); behind a panel the velocity is reduced. The panel keeps its
heading, which is fixed by its spreader. Its mass and weight are the payload's. In a multi-line
scene every payload may have a net of its own.

**fairing**: Blunt-face drag of a payload's fairing, by its own velocity or a prescribed tow speed.

Laird, Fraser, Marsh 2016: a skip with a fairing on its face is towed up or down along a lifting
rope; its drag ½·ρ·C_D·A·|V|·V opposes its motion. V is the payload's velocity relative to the water
along the face's axis, or a tow speed, for studies in which the rope itself is not hauled. A tow
speed's drag may build up over a ramp. In a multi-line scene every payload may have a fairing of its
own.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, radians, sin, sqrt
from typing import Any, NamedTuple

import numpy as np

from rope_twin.core.jit.rows import rows
from rope_twin.core.lanes.effects import by_lane
from rope_twin.core.loads.accounts import account
from rope_twin.core.loads.balance import add_to_node, end_relative
from rope_twin.core.loads.hooks import FAIRINGS, Load, differs_by_rope, kernel, scales_with_ramp
from rope_twin.core.loads.panel import (
    MAX_SOLIDITY,
    mesh_fault,
    meshed_solidity,
    panel_coefficients,
    panel_forces,
    panel_load,
    seen_by,
)
from rope_twin.core.state import DIVISOR_MIN, FLOW, RESIDUAL, VELOCITY
from rope_twin.quantity import quantity, text


@dataclass(frozen=True, kw_only=True)
class NetPanels:
    """Size, mesh and heading of a panel; solidity, or twine diameter and mesh size."""

    width_m: float = quantity("width of a panel", "m", 0.1, 1000.0)
    height_m: float = quantity("height of a panel", "m", 0.1, 1000.0)
    solidity: float | None = quantity(
        "solidity ratio: twine area over panel area", "", 0.005, MAX_SOLIDITY, default=None
    )
    twine_m: float | None = quantity("diameter of the twine", "m", 1e-4, 0.05, default=None)
    bar_m: float | None = quantity("half-mesh (bar) length, knot to knot", "m", 1e-3, 2.0,
                                   default=None)  # fmt: skip
    facing_deg: float = quantity(
        "direction of its normal, 0 east, 90 north", "°", -360.0, 360.0, default=0.0
    )
    panels: int = quantity("number of panels in a row", "", 1, 20, default=1)
    law: str = text("force law: aarsnes or loeland", "loeland")

    def check(self) -> str | None:
        """Return a fault of solidity (given once, in range) or force law, or None."""
        twined = (self.twine_m is not None, self.bar_m is not None)
        if any(twined) != all(twined) or all(twined) == (self.solidity is not None):
            return "solidity must be given exactly once; give solidity, or twine_m and bar_m"
        return mesh_fault(self.law, self.known_solidity(), self.twine_m, self.bar_m)

    def known_solidity(self) -> float:
        """Return the solidity as given, or of knotless square meshes: 1 - (1 - d/l)²."""
        if self.twine_m is None or self.bar_m is None:
            return self.solidity or 0.0
        return meshed_solidity(self.twine_m, self.bar_m)


@dataclass(frozen=True, kw_only=True)
class NetParams(NetPanels):
    """Panels, and in a multi-line scene the payload that they are at."""

    payload: str = text("multi-line scenes: the only payload with this net; default: each", "")


class Net(NamedTuple):
    """Kernel data, all panels together."""

    along: float  # ½·ρ·A times the constant term of C_D [kg/m]
    facing: float  # ½·ρ·A times the cos α term of C_D [kg/m]
    lift: float  # ρ·A times the sin 2α term of C_L [kg/m]
    nx: float  # the panel's normal
    ny: float


scales_with_ramp(Net, "along", "facing", "lift")
differs_by_rope(Net)


def coefficients(params: NetPanels) -> tuple[float, float, float]:
    """Return the constant and the cos α term of C_D, and the sin 2α term of C_L."""
    return panel_coefficients(params.law, params.known_solidity())


def build_net(params: NetParams, payload: Any, environment: Any) -> Net:
    """Return the kernel data for panels and water; each panel is in the wake of those before."""
    along, facing, lift = coefficients(params)
    seen = seen_by(params.panels, params.law, params.known_solidity())
    area = params.width_m * params.height_m
    scale = 0.5 * environment.water_density_kg_per_m3 * area * seen
    angle = radians(params.facing_deg)
    return Net(scale * along, scale * facing, 2.0 * scale * lift, cos(angle), sin(angle))


@kernel("load_end", Net)
def net_load_end(net: Any, work: Any, stage: Any) -> None:
    """Add the panel's force to R_0 and its block to A_0."""
    vx, vy, vz = rows(work, VELOCITY, 0)
    ux, uy, uz = rows(work, FLOW, 0)
    w = ux[0] - vx[0], uy[0] - vy[0], uz[0] - vz[0]
    add_to_node(work, 0, panel_load(net, w, (net.nx, net.ny, 0.0), stage.q))


by_lane(Net, "load_end")


@account("power_end", Net)
def net_power(net: Any, place: Any) -> Any:
    """Return force times velocity [W]."""
    n = np.array([[net.nx], [net.ny], [0.0]])
    force = panel_forces(net, place.flow - place.velocity, n)
    return (force * place.velocity).sum(axis=0)


Triple = tuple[float, float, float]


@dataclass(frozen=True, kw_only=True)
class FairingFace:
    """Face and tow speed; the payload's own drag is added to it."""

    face_m2: float = quantity("area of the face", "m²", 0.0, 1e4)
    drag: float = quantity("drag coefficient of the face", "", 0.0, 5.0, default=1.0)
    axis: Triple = quantity("direction normal to the face", "", -1e3, 1e3, default=(0.0, 0.0, 1.0))
    tow_speed_m_per_s: float | None = quantity(
        "prescribed tow speed along the axis; default: the payload's own velocity", "m/s",
        -10.0, 10.0, default=None,
    )  # fmt: skip
    ramp_s: float = quantity("build-up time of a tow speed's drag", "s", 0.0, 1e5, default=0.0)

    def check(self) -> str | None:
        """Return a fault if the axis is zero or a ramp has no tow speed, or None."""
        if not any(self.axis):
            return "the axis is a zero vector; give for example [0, 0, 1]"
        if self.ramp_s > 0.0 and self.tow_speed_m_per_s is None:
            return "ramp_s without a tow speed; remove ramp_s or give tow_speed_m_per_s"
        return None


@dataclass(frozen=True, kw_only=True)
class FairingParams(FairingFace):
    """Face and tow speed, and in a multi-line scene the payload that has them."""

    payload: str = text("multi-line scenes: the only payload with this fairing; default: each", "")


class Fairing(NamedTuple):
    """Kernel data of drag by the payload's own velocity."""

    k: float  # ½·ρ·C_D·A [kg/m]
    x: float  # unit vector of the axis
    y: float
    z: float


class TowedFairing(NamedTuple):
    """Kernel data of drag by a tow speed."""

    force: float  # along the axis, opposing the tow, after the ramp [N]
    x: float
    y: float
    z: float
    ramp: float  # [s]


scales_with_ramp(Fairing, "k", factor=FAIRINGS)
scales_with_ramp(TowedFairing, "force", factor=FAIRINGS)
differs_by_rope(Fairing, TowedFairing)


def build_fairing(params: FairingParams, payload: Any, environment: Any) -> Fairing | TowedFairing:
    """Return the kernel data for the face and the water."""
    k = 0.5 * environment.water_density_kg_per_m3 * params.drag * params.face_m2
    length = sqrt(sum(tow * tow for tow in params.axis))
    x, y, z = (tow / length for tow in params.axis)
    V = params.tow_speed_m_per_s
    if V is None:
        return Fairing(k, x, y, z)
    return TowedFairing(-k * abs(V) * V, x, y, z, params.ramp_s)


@kernel("load_end", Fairing)
def fairing_load_end(fairing: Any, work: Any, stage: Any) -> None:
    """Subtract k·|V|·V·e from R_0, V = (v - u)·e; add 2·q·k·|V|·e·eᵀ to A_0."""
    ux, uy, uz = end_relative(work)
    x, y, z = fairing.x, fairing.y, fairing.z
    V = ux * x + uy * y + uz * z
    force = fairing.k * abs(V) * V
    slope = 2.0 * stage.q * fairing.k * abs(V)
    add_to_node(work, 0, Load(
        -force * x, -force * y, -force * z,
        slope * x * x, slope * x * y, slope * x * z, slope * y * y, slope * y * z, slope * z * z,
    ))  # fmt: skip


@kernel("load_end", TowedFairing)
def towed_end(fairing: Any, work: Any, stage: Any) -> None:
    """Add share(t)·F·e to R_0."""
    Rx, Ry, Rz = rows(work, RESIDUAL, 0)
    share = (
        1.0 if stage.time >= fairing.ramp else max(stage.time, 0.0) / (fairing.ramp + DIVISOR_MIN)
    )
    Rx[0] += share * fairing.force * fairing.x
    Ry[0] += share * fairing.force * fairing.y
    Rz[0] += share * fairing.force * fairing.z


by_lane(Fairing, "load_end")
by_lane(TowedFairing, "load_end")


@account("power_end", Fairing)
def fairing_power(fairing: Any, place: Any) -> Any:
    """Return force times velocity [W]."""
    axis = np.array([[fairing.x], [fairing.y], [fairing.z]])
    V = ((place.velocity - place.flow) * axis).sum(axis=0)
    return -fairing.k * np.abs(V) * V * (axis * place.velocity).sum(axis=0)
