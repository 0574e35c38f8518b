"""Net at the rope's lower end, spread normal to the flow: one panel, or several in a row.

Force of a panel of area A and solidity Sn in the relative velocity w, at an angle α between w and
the panel's normal: ½·ρ·C_D·A·|w|² along w and ½·ρ·C_L·A·|w|² perpendicular to it, towards the
normal, with C_D = 0.04 + (-0.04 + d(Sn))·cos α and C_L = c(Sn)·sin 2α. Aarsnes, Rudi, Løland 1990
(as printed in a thesis of Shanghai Jiao Tong University): d = Sn - 1.24·Sn² + 13.7·Sn³, c = 0.57·Sn
- 3.54·Sn² + 10.1·Sn³; Løland 1991: d = 0.33·Sn + 6.54·Sn² - 4.88·Sn³, c = -0.05·Sn + 2.3·Sn² -
1.76·Sn³.

Measured for Sn up to about 0.3 and Reynolds numbers of the twine of 1400 to 1800. Behind a panel
the velocity is reduced to 1 - 0.46·C_D(α = 0) (Løland 1991). The panel keeps its heading, which is
fixed by its spreader. Its mass and weight are the payload's. In a multi-line scene every payload
may have a net of its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import cos, radians, sin, sqrt
from typing import Any, NamedTuple

import numpy as np

from rope_twin.core.energy import account
from rope_twin.core.guards import SPEED2_MIN
from rope_twin.core.jit.rows import rows, span
from rope_twin.core.joined.stack import stacks
from rope_twin.core.loads.growth import grows
from rope_twin.core.loads.hooks import kernel
from rope_twin.core.state import BLOCK, FLOW, RESIDUAL, VELOCITY, Floats
from rope_twin.quantity import quantity, text

# Coefficients of Sn, Sn², Sn³ in the cos α term of C_D and in the sin 2α term of C_L.
LAWS = {
    "aarsnes": ((1.0, -1.24, 13.7), (0.57, -3.54, 10.1)),
    "loeland": ((0.33, 6.54, -4.88), (-0.05, 2.3, -1.76)),
}
ALONG = 0.04  # C_D of a panel along the flow
SHIELDING = 0.46
SOLIDITY_MOST = 0.35  # slightly above the measured range


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
        if self.law not in LAWS:
            return f"unknown law '{self.law}'; give one of {', '.join(LAWS)}"
        twined = (self.twine_m is not None, self.bar_m is not None)
        if any(twined) != all(twined) or all(twined) == (self.solidity is not None):
            return "solidity must be given exactly once; give solidity, or twine_m and bar_m"
        if self.twine_m is not None and self.bar_m is not None and self.twine_m >= self.bar_m:
            what = (
                f"twine of {self.twine_m:g} m leaves no mesh between knots {self.bar_m:g} m apart"
            )
            return f"{what}; give thinner twine or wider mesh"
        if self.known_solidity() > SOLIDITY_MOST:
            what = f"solidity {self.known_solidity():.2f} is above {SOLIDITY_MOST:g}"
            return f"{what}, outside the measured range; give thinner twine or wider mesh"
        return None

    def known_solidity(self) -> float:
        """Return the solidity as given, or of knotless square meshes: 1 - (1 - d/l)²."""
        if self.twine_m is None or self.bar_m is None:
            return self.solidity or 0.0
        return 1.0 - (1.0 - self.twine_m / self.bar_m) ** 2


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
    Sn = params.known_solidity()
    powers = (Sn, Sn**2, Sn**3)
    drag, lift = LAWS[params.law]
    facing = sum(c * power for c, power in zip(drag, powers, strict=True)) - ALONG
    return ALONG, facing, sum(c * power for c, power in zip(lift, powers, strict=True))


def build(params: NetParams, payload: Any, around: Any) -> Net:
    """Return the kernel data for panels and water; each panel is in the wake of those before."""
    along, facing, lift = coefficients(params)
    slower = 1.0 - SHIELDING * (along + facing)
    seen = sum(slower ** (2 * number) for number in range(params.panels))
    area = params.width_m * params.height_m
    scale = 0.5 * around.water_density_kg_per_m3 * area * seen
    angle = radians(params.facing_deg)
    return Net(scale * along, scale * facing, 2.0 * scale * lift, cos(angle), sin(angle))


@kernel("load_end", Net)
def load_end(net: Any, work: Any, stage: Any) -> None:
    """Add (a·s + f·|p|)·w + l·(p·s·n - p²/s·w) to R_0, and q·dF/dw, symmetric, to A_0.

    s = |w|, p = w·n.
    """
    vx, vy, vz = rows(work, VELOCITY, 0)
    ux, uy, uz = rows(work, FLOW, 0)
    Rx, Ry, Rz = rows(work, RESIDUAL, 0)
    Axx, Axy, Axz, Ayy, Ayz, Azz = span(work, BLOCK, 6, 0)
    x, y, z = ux[0] - vx[0], uy[0] - vy[0], uz[0] - vz[0]
    s = sqrt(x * x + y * y + z * z + SPEED2_MIN)
    nx, ny = net.nx, net.ny
    p = x * nx + y * ny
    c = p / s  # cos α, signed by the side of the normal
    even = net.along * s + net.facing * abs(p) - net.lift * p * c
    Rx[0] += even * x + net.lift * p * s * nx
    Ry[0] += even * y + net.lift * p * s * ny
    Rz[0] += even * z
    # dF/dw = even·I + w·(g_w·w + g_n·n)ᵀ + n·(h_w·w + h_n·n)ᵀ
    q, side = stage.q, 1.0 if p > 0.0 else -1.0
    g_w = net.along / s + net.lift * c * c / s
    g_n = net.facing * side - 2.0 * net.lift * c
    h_w, h_n = net.lift * c, net.lift * s
    mixed = 0.5 * q * (g_n + h_w)
    ww, nn, own = q * g_w, q * h_n, q * even
    Axx[0] += own + ww * x * x + 2.0 * mixed * x * nx + nn * nx * nx
    Ayy[0] += own + ww * y * y + 2.0 * mixed * y * ny + nn * ny * ny
    Azz[0] += own + ww * z * z
    Axy[0] += ww * x * y + mixed * (x * ny + y * nx) + nn * nx * ny
    Axz[0] += ww * x * z + mixed * z * nx
    Ayz[0] += ww * y * z + mixed * z * ny


@account("power_end", Net)
def power(net: Any, place: Any) -> Any:
    """Return force times velocity [W]."""
    w = place.flow - place.velocity
    n = np.array([[net.nx], [net.ny], [0.0]])
    s = np.sqrt((w * w).sum(axis=0) + SPEED2_MIN)
    p = (w * n).sum(axis=0)
    even = net.along * s + net.facing * np.abs(p) - net.lift * p * p / s
    return ((even * w + net.lift * p * s * n) * place.velocity).sum(axis=0)
