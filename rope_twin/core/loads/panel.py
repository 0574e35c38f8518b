"""Force of the water on a plane panel of netting, at any angle to the flow.

Force of a panel of area A and solidity Sn in the relative velocity w, at an angle α between w and
the panel's normal: ½·ρ·C_D·A·|w|² along w and ½·ρ·C_L·A·|w|² perpendicular to it, towards the
normal, with C_D = 0.04 + (-0.04 + d(Sn))·cos α and C_L = c(Sn)·sin 2α. Aarsnes, Rudi, Løland 1990
(as printed in a thesis of Shanghai Jiao Tong University): d = Sn - 1.24·Sn² + 13.7·Sn³, c = 0.57·Sn
- 3.54·Sn² + 10.1·Sn³; Løland 1991: d = 0.33·Sn + 6.54·Sn² - 4.88·Sn³, c = -0.05·Sn + 2.3·Sn² -
1.76·Sn³.

Measured for Sn up to about 0.3 and Reynolds numbers of the twine of 1400 to 1800. Behind a panel
the velocity is reduced to 1 - 0.46·C_D(α = 0) (Løland 1991).
"""

from __future__ import annotations

from math import sqrt
from typing import Any

import numpy as np

from rope_twin.core.jit.decorators import jit_within
from rope_twin.core.jit.wide import choose
from rope_twin.core.loads.hooks import Load
from rope_twin.core.state import SPEED2_MIN, Floats

# Coefficients of Sn, Sn², Sn³ in the cos α term of C_D and in the sin 2α term of C_L.
LAWS = {
    "aarsnes": ((1.0, -1.24, 13.7), (0.57, -3.54, 10.1)),
    "loeland": ((0.33, 6.54, -4.88), (-0.05, 2.3, -1.76)),
}
ALONG = 0.04  # C_D of a panel along the flow
SHIELDING = 0.46
MAX_SOLIDITY = 0.35  # slightly above the range of the measurements


def meshed_solidity(twine_m: float, bar_m: float) -> float:
    """Return the solidity of knotless square meshes: 1 - (1 - d/l)²."""
    return 1.0 - (1.0 - twine_m / bar_m) ** 2


def mesh_fault(law: str, solidity: float, twine_m: float | None, bar_m: float | None) -> str | None:
    """Return a fault of a net's force law, meshes or solidity, or None."""
    if law not in LAWS:
        return f"unknown law '{law}'; give one of {', '.join(LAWS)}"
    if twine_m is not None and bar_m is not None and twine_m >= bar_m:
        subject = f"twine of {twine_m:g} m leaves no mesh between knots {bar_m:g} m apart"
        return f"{subject}; give thinner twine or wider mesh"
    if solidity > MAX_SOLIDITY:
        subject = f"solidity {solidity:.2f} is above {MAX_SOLIDITY:g}"
        return f"{subject}, outside the measured range; give thinner twine or wider mesh"
    return None


def panel_coefficients(law: str, solidity: float) -> tuple[float, float, float]:
    """Return the constant and the cos α term of C_D, and the sin 2α term of C_L."""
    powers = (solidity, solidity**2, solidity**3)
    drag, lift = LAWS[law]
    facing = sum(c * power for c, power in zip(drag, powers, strict=True)) - ALONG
    return ALONG, facing, sum(c * power for c, power in zip(lift, powers, strict=True))


def seen_by(panels: int, law: str, solidity: float) -> float:
    """Return the sum of |w|² over panels in a row, each in the upstream wakes, relative to one."""
    along, facing, _ = panel_coefficients(law, solidity)
    slower = 1.0 - SHIELDING * (along + facing)
    return float(sum(slower ** (2 * number) for number in range(panels)))


@jit_within
def panel_load(net: Any, w: Any, n: Any, q: float) -> Any:
    """Return F = (a·s + f·|p|)·w + l·(p·s·n - p²/s·w), and q·dF/dw, symmetric.

    net: has `along` a and `facing` f, ½·ρ·A times the terms of C_D, and `lift` l, ρ·A times that of
    C_L [kg/m]; w: relative velocity [m/s]; n: the panel's normal, of unit length or 0; s = |w|,
    p = w·n.
    """
    x, y, z = w
    nx, ny, nz = n
    s = sqrt(x * x + y * y + z * z + SPEED2_MIN)
    p = x * nx + y * ny + z * nz
    c = p / s  # cos α, signed by the side of the normal
    isotropic = net.along * s + net.facing * abs(p) - net.lift * p * c
    # dF/dw = isotropic·I + w·(g_w·w + g_n·n)ᵀ + n·(h_w·w + h_n·n)ᵀ
    side = choose(p > 0.0, 1.0, -1.0)
    g_w = net.along / s + net.lift * c * c / s
    g_n = net.facing * side - 2.0 * net.lift * c
    h_w, h_n = net.lift * c, net.lift * s
    mixed = 0.5 * q * (g_n + h_w)
    ww, nn, scale = q * g_w, q * h_n, q * isotropic
    return Load(
        isotropic * x + net.lift * p * s * nx,
        isotropic * y + net.lift * p * s * ny,
        isotropic * z + net.lift * p * s * nz,
        scale + ww * x * x + 2.0 * mixed * x * nx + nn * nx * nx,
        ww * x * y + mixed * (x * ny + y * nx) + nn * nx * ny,
        ww * x * z + mixed * (x * nz + z * nx) + nn * nx * nz,
        scale + ww * y * y + 2.0 * mixed * y * ny + nn * ny * ny,
        ww * y * z + mixed * (y * nz + z * ny) + nn * ny * nz,
        scale + ww * z * z + 2.0 * mixed * z * nz + nn * nz * nz,
    )


def panel_forces(net: Any, w: Floats, n: Floats) -> Floats:
    """Return the force of `panel_load` on panels in relative velocities w with normals n, (3, any).

    n may be (3, 1), one for all.
    """
    s = np.sqrt((w * w).sum(axis=0) + SPEED2_MIN)
    p = (w * n).sum(axis=0)
    isotropic = net.along * s + net.facing * np.abs(p) - net.lift * p * p / s
    return np.asarray(isotropic * w + net.lift * p * s * n)
