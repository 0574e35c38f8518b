"""Morison drag of the rope by the cross-flow principle (Morison 1950; Hoerner 1965).

Per metre, with the velocity u of the rope relative to the water, split along the tangent τ into s =
u·τ and n = u - s·τ: force = -½·ρ·d·Cdn·|n|·n - ½·ρ·π·d·Cdt·|s|·s·τ. Cdn refers to the projected
area d, Cdt to the skin area π·d. Cdn may depend on the Reynolds number |n|·d/ν by a table, linear
in its logarithm, or on Keulegan-Carpenter number and roughness (vortex/drag_amplification).

With `relative: false` u is the water's velocity alone, so that the rope's motion is not damped:
method 1 of Laird, Fraser and Marsh (2016), for verification only.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from math import log, sqrt
from typing import Any, NamedTuple

import numpy as np

from rope_twin.core.jit.decorators import jit_within
from rope_twin.core.jit.functions import interpolate
from rope_twin.core.loads.accounts import account
from rope_twin.core.loads.hooks import Load, kernel, scales_with_ramp
from rope_twin.core.state import DIVISOR_MIN, SPEED2_MIN, Floats
from rope_twin.quantity import SparingRepr, quantity, text
from rope_twin.vortex.drag_amplification import OscillatingDrag, oscillating_drag


@dataclass(frozen=True, kw_only=True)
class RoughnessTable:
    """Factors on the normal drag coefficient for one roughness."""

    roughness: float = quantity("height of the roughness over the diameter, k/d", "", 1e-6, 0.2)
    rows: tuple[tuple[float, float], ...] = quantity(
        "rows of Keulegan-Carpenter number and factor on `normal`", "", 0.0, 1e6
    )

    def check(self) -> str | None:
        """Return a fault if rows are missing or unordered, or None."""
        if not self.rows:
            return "no rows; give at least one row [KC, factor]"
        if any(b[0] <= a[0] for a, b in itertools.pairwise(self.rows)):
            return "Keulegan-Carpenter numbers are not ascending; order the rows"
        if max(factor for _, factor in self.rows) > 10.0:
            return "a factor above 10; give factors on `normal`, not coefficients of something else"
        return None


@dataclass(frozen=True, kw_only=True)
class KeuleganCarpenter:
    """Tables by roughness, and that of the rope."""

    tables: tuple[RoughnessTable, ...] = text("tables in the order of their roughness")
    roughness: float | None = quantity(
        "k/d of the rope; may be left out with one table", "", 1e-6, 0.2, default=None
    )
    window_s: float = quantity(
        "time constant of the means that the number is taken from", "s", 1.0, 3600.0, default=60.0
    )

    def check(self) -> str | None:
        """Return a fault of the tables, or None."""
        known = [own.roughness for own in self.tables]
        if not known:
            return "no tables; give at least one, `{roughness: ..., rows: [[KC, factor], ...]}`"
        if any(b <= a for a, b in itertools.pairwise(known)):
            return "the roughness of the tables is not ascending; order them"
        if self.roughness is None:
            return None if len(known) == 1 else "no roughness of the rope; give one for the tables"
        if not known[0] <= self.roughness <= known[-1]:
            reach = f"{known[0]:g} to {known[-1]:g}"
            return f"roughness {self.roughness:g} is outside the tables; give {reach}"
        return None

    def table(self) -> tuple[Floats, Floats]:
        """Return numbers and factors at the rope's roughness, linear in its logarithm."""
        number = np.array(sorted({KC for own in self.tables for KC, _ in own.rows}), dtype=float)
        factors = [np.interp(number, *np.array(own.rows, float).T) for own in self.tables]
        if self.roughness is None:
            return number, factors[0]
        known = np.log([own.roughness for own in self.tables])
        at = math.log(self.roughness)
        return number, np.array([np.interp(at, known, row) for row in np.transpose(factors)])


@dataclass(frozen=True, kw_only=True, repr=False)
class DragParams(SparingRepr):
    """Drag coefficients, and their dependence on Reynolds or Keulegan-Carpenter number."""

    _later = frozenset(("over_keulegan_carpenter",))

    normal: float = quantity(
        "normal drag coefficient, on the hydrodynamic diameter d", "", 0.0, 10.0
    )
    tangential: float = quantity("tangential drag coefficient, on π·d", "", 0.0, 1.0)
    over_reynolds: tuple[tuple[float, float], ...] = quantity(
        "rows of Reynolds number and factor on `normal`", "", 1e-3, 1e9, default=()
    )
    viscosity_m2_per_s: float = quantity(
        "kinematic viscosity ν of water", "m²/s", 1e-7, 1e-4, default=1.3e-6
    )
    over_keulegan_carpenter: KeuleganCarpenter | None = text(
        "factor on `normal` by Keulegan-Carpenter number and roughness", None
    )
    relative: bool = text("false: neglect the rope's own velocity (verification only)", True)

    def check(self) -> str | None:
        """Return a fault if rows are unordered or options conflict, or None."""
        if any(b[0] <= a[0] for a, b in itertools.pairwise(self.over_reynolds)):
            return "Reynolds numbers of over_reynolds are not ascending; order the rows"
        if self.over_reynolds and not self.relative:
            return "over_reynolds and relative: false exclude each other; remove one"
        if self.over_keulegan_carpenter and (self.over_reynolds or not self.relative):
            other = "over_reynolds" if self.over_reynolds else "relative: false"
            return f"over_keulegan_carpenter and {other} exclude each other; remove one"
        return None


class Drag(NamedTuple):
    """Kernel data; the areas are the rope's, per node."""

    kn: float  # ½·ρ·Cdn [kg/m³]
    kt: float  # ½·ρ·Cdt [kg/m³]


class ReynoldsDrag(NamedTuple):
    """Kernel data of drag with a normal coefficient that depends on the Reynolds number."""

    drag: Drag
    log_re: Floats  # ln of the Reynolds numbers, ascending, (rows,)
    factor: Floats  # factor on kn
    per_viscosity: float  # 1/ν [s/m²]


class CurrentDrag(NamedTuple):
    """Kernel data of drag by the water's velocity alone."""

    drag: Drag


scales_with_ramp(Drag, "kn", "kt")
scales_with_ramp(ReynoldsDrag, "drag")
scales_with_ramp(CurrentDrag, "drag")
scales_with_ramp(OscillatingDrag, "kn", "kt")


def build(
    params: DragParams, payload: Any, environment: Any
) -> Drag | ReynoldsDrag | CurrentDrag | OscillatingDrag:
    """Return the kernel data for the coefficients and the water."""
    half_density = 0.5 * environment.water_density_kg_per_m3
    drag = Drag(half_density * params.normal, half_density * params.tangential)
    if not params.relative:
        return CurrentDrag(drag)
    if params.over_keulegan_carpenter:
        own = params.over_keulegan_carpenter
        return oscillating_drag(*drag, *own.table(), own.window_s, environment.room)
    if params.over_reynolds:
        re, factor = np.array(params.over_reynolds, dtype=float).T
        per_viscosity = 1.0 / params.viscosity_m2_per_s
        return ReynoldsDrag(drag, np.log(re), np.ascontiguousarray(factor), per_viscosity)
    return drag


@jit_within
def _load(kn: float, kt: float, node: Any, relative: Any, q: float) -> Any:
    """Return the drag of a node with velocity `relative` to the water; kn: normal [kg/m³]."""
    x, y, z = node.tx, node.ty, node.tz
    rx, ry, rz = relative
    s = rx * x + ry * y + rz * z
    nx, ny, nz = rx - s * x, ry - s * y, rz - s * z
    speed = sqrt(nx * nx + ny * ny + nz * nz + SPEED2_MIN)
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
    """Return F = -c_n·n - c_t·s·τ and A = q·(c_n·(I - ττᵀ) + 2·c_t·ττᵀ + k_n·nnᵀ/|n|).

    k_n = kn·frontal area, c_n = k_n·|n|, c_t = kt·skin area·|s|. Omitted in A: the changes of
    tangent and current with position.
    """
    relative = (node.vx - node.ux, node.vy - node.uy, node.vz - node.uz)
    return _load(drag.kn, drag.kt, node, relative, stage.q)


@kernel("load", OscillatingDrag, wide=True)
def oscillating_load(drag: Any, node: Any, stage: Any) -> Any:
    """Return the drag with the factor 1; the rest comes with the nodes' own factors."""
    relative = (node.vx - node.ux, node.vy - node.uy, node.vz - node.uz)
    return _load(drag.kn, drag.kt, node, relative, stage.q)


@jit_within
def _factor(drag: Any, speed: float, node: Any) -> Any:
    """Return the factor on kn at a normal speed; constant beyond the table's last row.

    d follows from the volume of all the node's rope, as the frontal area has a rope's own
    coefficient in it.
    """
    whole = node.volume * node.touching / (node.frontal + DIVISOR_MIN)
    diameter = sqrt(4.0 / math.pi * whole / (node.length + DIVISOR_MIN))
    re = drag.per_viscosity * speed * diameter
    return interpolate(drag.log_re, drag.factor, log(max(re, DIVISOR_MIN)))


@kernel("load", ReynoldsDrag, wide=True)
def reynolds_load(drag: Any, node: Any, stage: Any) -> Any:
    """Return the drag with kn from the table; also omitted in A: the factor's change with speed."""
    x, y, z = node.tx, node.ty, node.tz
    rx, ry, rz = node.vx - node.ux, node.vy - node.uy, node.vz - node.uz
    s = rx * x + ry * y + rz * z
    speed = sqrt(max(rx * rx + ry * ry + rz * rz - s * s, 0.0))
    kn = drag.drag.kn * _factor(drag, speed, node)
    return _load(kn, drag.drag.kt, node, (rx, ry, rz), stage.q)


@kernel("load", CurrentDrag, wide=True)
def current_load(drag: Any, node: Any, stage: Any) -> Any:
    """Return the drag of a rope at zero velocity."""
    relative = (-node.ux, -node.uy, -node.uz)
    return _load(drag.drag.kn, drag.drag.kt, node, relative, 0.0)


@account("power", Drag)
def power(drag: Any, place: Any) -> Any:
    """Return force times velocity [W]; it may be positive where the current does work."""
    return _power(drag, place, place.velocity - place.flow, 1.0)


@account("power", ReynoldsDrag)
def reynolds_power(drag: Any, place: Any) -> Any:
    """Return force times velocity with kn from the table [W]."""
    u = place.velocity - place.flow
    across = u - (u * place.tangent).sum(axis=0) * place.tangent
    speed = np.sqrt((across * across).sum(axis=0))
    whole = place.volume * place.touching / (place.frontal + DIVISOR_MIN)
    diameter = np.sqrt(4.0 / math.pi * whole / (place.length + DIVISOR_MIN))
    re = drag.per_viscosity * speed * diameter
    factor = np.interp(np.log(np.maximum(re, DIVISOR_MIN)), drag.log_re, drag.factor)
    return _power(drag.drag, place, u, factor)


@account("power", CurrentDrag)
def current_power(drag: Any, place: Any) -> Any:
    """Return the power of the drag that neglects the rope's velocity [W]."""
    return _power(drag.drag, place, -place.flow, 1.0)


def _power(drag: Drag, place: Any, u: Any, factor: Any) -> Any:
    s = (u * place.tangent).sum(axis=0)
    along = s * place.tangent
    across = u - along
    cn = factor * drag.kn * place.frontal * np.sqrt((across * across).sum(axis=0))
    ct = drag.kt * place.skin * np.abs(s)
    return -((cn * across + ct * along) * place.velocity).sum(axis=0)
