"""Morison drag of the rope, cross-flow principle (Morison et al. 1950; Hoerner 1965).

Per metre, with the velocity u of the rope relative to the water, split along the tangent τ into
s = u·τ and n = u - s·τ: force = -½·ρ·d·Cdn·|n|·n - ½·ρ·π·d·Cdt·|s|·s·τ. Cdn is on the projected
area d, Cdt on the skin π·d. Cdn may follow the Reynolds number |n|·d/ν by a table, linear in its
logarithm.

With `relative: false` u is the water's velocity alone, so that a rope that moves is not damped:
method 1 of Laird, Fraser and Marsh (2016), for verification only.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from math import log, sqrt
from typing import Any, NamedTuple

import numpy as np

from rope_twin.core.acting.hooks import kernel
from rope_twin.core.acting.loads import Load
from rope_twin.core.energy import account
from rope_twin.core.guards import NONE_AT_ALL, STILL2
from rope_twin.core.jit.decorators import jit_within
from rope_twin.core.state import Floats
from rope_twin.quantity import quantity, text


@dataclass(frozen=True, kw_only=True)
class DragParams:
    """Coefficients and the area each one is on."""

    normal: float = quantity("drag coefficient across the rope, on d", "", 0.0, 10.0)
    tangential: float = quantity("drag coefficient along the rope, on π·d", "", 0.0, 1.0)
    over_reynolds: tuple[tuple[float, float], ...] = quantity(
        "rows of Reynolds number and what multiplies `normal` there", "", 1e-3, 1e9, default=()
    )
    viscosity_m2_per_s: float = quantity("of the water, ν", "m²/s", 1e-7, 1e-4, default=1.3e-6)
    relative: bool = text("false: the rope's own velocity is left out, for verification", True)

    def check(self) -> str | None:
        """Rows in order; one departure at a time."""
        if any(b[0] <= a[0] for a, b in itertools.pairwise(self.over_reynolds)):
            return "Reynolds numbers of over_reynolds do not rise; order the rows"
        if self.over_reynolds and not self.relative:
            return "over_reynolds together with relative: false; leave one of them out"
        return None


class Drag(NamedTuple):
    """What the kernel sees; the areas are the rope's, per node."""

    kn: float  # ½·ρ·Cdn [kg/m³]
    kt: float  # ½·ρ·Cdt [kg/m³]


class ReynoldsDrag(NamedTuple):
    """Drag whose coefficient across the rope follows the Reynolds number."""

    drag: Drag
    log_re: Floats  # ln of the Reynolds numbers, rising, (rows,)
    factor: Floats  # on kn there
    scale: float  # 4/(π·ν): Reynolds number over |n|·volume/frontal area [s/m²]


class CurrentDrag(NamedTuple):
    """Drag by the water's velocity alone."""

    drag: Drag


def build(params: DragParams, payload: Any, around: Any) -> Drag | ReynoldsDrag | CurrentDrag:
    """From the coefficients and the water."""
    half_density = 0.5 * around.water_density_kg_per_m3
    drag = Drag(half_density * params.normal, half_density * params.tangential)
    if not params.relative:
        return CurrentDrag(drag)
    if params.over_reynolds:
        re, factor = np.array(params.over_reynolds, dtype=float).T
        scale = 4.0 / (math.pi * params.viscosity_m2_per_s)
        return ReynoldsDrag(drag, np.log(re), np.ascontiguousarray(factor), scale)
    return drag


@jit_within
def _load(kn: float, kt: float, node: Any, relative: Any, q: float) -> Any:
    """Drag of a node that moves through the water at `relative`, with k_n [kg/m³] across it."""
    x, y, z = node.tx, node.ty, node.tz
    rx, ry, rz = relative
    s = rx * x + ry * y + rz * z
    nx, ny, nz = rx - s * x, ry - s * y, rz - s * z
    speed = sqrt(nx * nx + ny * ny + nz * nz + STILL2)
    kn = kn * node.frontal
    cn = kn * speed
    ct = kt * node.skin * abs(s)
    along = ct * s
    diagonal = q * cn
    beta = q * (2.0 * ct - cn)
    g = q * kn / speed
    return Load(
        -cn * nx - along * x,
        -cn * ny - along * y,
        -cn * nz - along * z,
        diagonal + beta * x * x + g * nx * nx,
        beta * x * y + g * nx * ny,
        beta * x * z + g * nx * nz,
        diagonal + beta * y * y + g * ny * ny,
        beta * y * z + g * ny * nz,
        diagonal + beta * z * z + g * nz * nz,
    )


@kernel("load", Drag, wide=True)
def load(drag: Any, node: Any, stage: Any) -> Any:
    """F = -c_n·n - c_t·s·τ; A = q·(c_n·(I - ττᵀ) + 2·c_t·ττᵀ + k_n·nnᵀ/|n|).

    k_n = kn·frontal area, c_n = k_n·|n|, c_t = kt·skin area·|s|. Dropped in A: the tangent's and
    the current's change with position.
    """
    relative = (node.vx - node.ux, node.vy - node.uy, node.vz - node.uz)
    return _load(drag.kn, drag.kt, node, relative, stage.q)


@jit_within
def _factor(drag: Any, speed: float, node: Any) -> Any:
    """What multiplies kn at a speed across the rope; the last row's beyond the table."""
    re = drag.scale * speed * node.volume / (node.frontal + NONE_AT_ALL)
    at = log(max(re, NONE_AT_ALL))
    last = drag.log_re.shape[0] - 1
    i = 0
    while i < last - 1 and drag.log_re[i + 1] < at:
        i += 1
    if last == 0:
        return drag.factor[0]
    share = (at - drag.log_re[i]) / (drag.log_re[i + 1] - drag.log_re[i])
    return drag.factor[i] + min(max(share, 0.0), 1.0) * (drag.factor[i + 1] - drag.factor[i])


@kernel("load", ReynoldsDrag)
def reynolds_load(drag: Any, node: Any, stage: Any) -> Any:
    """The same, with kn by the table; dropped in A as well: the factor's change with speed."""
    x, y, z = node.tx, node.ty, node.tz
    rx, ry, rz = node.vx - node.ux, node.vy - node.uy, node.vz - node.uz
    s = rx * x + ry * y + rz * z
    speed = sqrt(max(rx * rx + ry * ry + rz * rz - s * s, 0.0))
    kn = drag.drag.kn * _factor(drag, speed, node)
    return _load(kn, drag.drag.kt, node, (rx, ry, rz), stage.q)


@kernel("load", CurrentDrag)
def current_load(drag: Any, node: Any, stage: Any) -> Any:
    """The same of a rope that stands still."""
    relative = (-node.ux, -node.uy, -node.uz)
    return _load(drag.drag.kn, drag.drag.kt, node, relative, 0.0)


@account("power", Drag)
def power(drag: Any, place: Any) -> Any:
    """Force times velocity [W]; against the current's push it may be positive."""
    return _power(drag, place, place.velocity - place.flow, 1.0)


@account("power", ReynoldsDrag)
def reynolds_power(drag: Any, place: Any) -> Any:
    """The same by the table [W]."""
    u = place.velocity - place.flow
    across = u - (u * place.tangent).sum(axis=0) * place.tangent
    speed = np.sqrt((across * across).sum(axis=0))
    re = drag.scale * speed * place.volume / (place.frontal + NONE_AT_ALL)
    factor = np.interp(np.log(np.maximum(re, NONE_AT_ALL)), drag.log_re, drag.factor)
    return _power(drag.drag, place, u, factor)


@account("power", CurrentDrag)
def current_power(drag: Any, place: Any) -> Any:
    """The same of a rope that stands still [W]."""
    return _power(drag.drag, place, -place.flow, 1.0)


def _power(drag: Drag, place: Any, u: Any, factor: Any) -> Any:
    s = (u * place.tangent).sum(axis=0)
    along = s * place.tangent
    across = u - along
    cn = factor * drag.kn * place.frontal * np.sqrt((across * across).sum(axis=0))
    ct = drag.kt * place.skin * np.abs(s)
    return -((cn * across + ct * along) * place.velocity).sum(axis=0)
