"""Net at the rope's lower end, spread normal to the flow: one panel, or several in a row.

The force of a panel follows from its angle to the flow and its solidity (core/loads/panel: Aarsnes,
Rudi, Løland 1990; Løland 1991); behind a panel the velocity is reduced. The panel keeps its
heading, which is fixed by its spreader. Its mass and weight are the payload's. In a multi-line
scene every payload may have a net of its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import cos, radians, sin
from typing import Any, NamedTuple

import numpy as np

from rope_twin.core.energy import account
from rope_twin.core.jit.rows import rows, span
from rope_twin.core.joined.stack import stacks
from rope_twin.core.lanes.effects import by_lane
from rope_twin.core.loads.hooks import grows, kernel
from rope_twin.core.loads.panel import (
    SOLIDITY_MOST,
    mesh_fault,
    meshed_solidity,
    panel_coefficients,
    panel_forces,
    panel_load,
    seen_by,
)
from rope_twin.core.state import BLOCK, FLOW, RESIDUAL, VELOCITY, Floats
from rope_twin.quantity import quantity, text


@dataclass(frozen=True, kw_only=True)
class NetPanels:
    """Size, mesh and heading of a panel; solidity, or twine diameter and mesh size."""

    width_m: float = quantity("width of a panel", "m", 0.1, 1000.0)
    height_m: float = quantity("height of a panel", "m", 0.1, 1000.0)
    solidity: float | None = quantity(
        "solidity ratio: twine area over panel area", "", 0.005, SOLIDITY_MOST, default=None
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


grows(Net, "along", "facing", "lift")


class ManyNets(NamedTuple):
    """Kernel data of the nets of a multi-line system."""

    figures: Floats  # the fields of Net, (ropes, 5); zero where there is none


def _pick(many: Any, r: int) -> Any:
    f = many.figures[r]
    return Net(f[0], f[1], f[2], f[3], f[4])


@stacks(Net, ManyNets, _pick)
def stack_nets(nets: Sequence[Net]) -> ManyNets:
    """Stack the kernel data of several nets."""
    return ManyNets(np.array(nets, dtype=float))


def coefficients(params: NetPanels) -> tuple[float, float, float]:
    """Return the constant and the cos α term of C_D, and the sin 2α term of C_L."""
    return panel_coefficients(params.law, params.known_solidity())


def build(params: NetParams, payload: Any, around: Any) -> Net:
    """Return the kernel data for panels and water; each panel is in the wake of those before."""
    along, facing, lift = coefficients(params)
    seen = seen_by(params.panels, params.law, params.known_solidity())
    area = params.width_m * params.height_m
    scale = 0.5 * around.water_density_kg_per_m3 * area * seen
    angle = radians(params.facing_deg)
    return Net(scale * along, scale * facing, 2.0 * scale * lift, cos(angle), sin(angle))


@kernel("load_end", Net)
def load_end(net: Any, work: Any, stage: Any) -> None:
    """Add the panel's force to R_0 and its block to A_0."""
    vx, vy, vz = rows(work, VELOCITY, 0)
    ux, uy, uz = rows(work, FLOW, 0)
    Rx, Ry, Rz = rows(work, RESIDUAL, 0)
    Axx, Axy, Axz, Ayy, Ayz, Azz = span(work, BLOCK, 6, 0)
    w = ux[0] - vx[0], uy[0] - vy[0], uz[0] - vz[0]
    load = panel_load(net, w, (net.nx, net.ny, 0.0), stage.q)
    Rx[0] += load.x
    Ry[0] += load.y
    Rz[0] += load.z
    Axx[0] += load.xx
    Axy[0] += load.xy
    Axz[0] += load.xz
    Ayy[0] += load.yy
    Ayz[0] += load.yz
    Azz[0] += load.zz


by_lane(Net, "load_end")


@account("power_end", Net)
def power(net: Any, place: Any) -> Any:
    """Return force times velocity [W]."""
    n = np.array([[net.nx], [net.ny], [0.0]])
    force = panel_forces(net, place.flow - place.velocity, n)
    return (force * place.velocity).sum(axis=0)
