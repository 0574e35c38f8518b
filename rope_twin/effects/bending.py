"""Bending stiffness: a rope, pipe or cable that resists curvature.

Energy ½·EI·∫|r''|² ds with r' = dr/ds on the unstretched length s, the slender rod without twist of
Nordgren (1974) and Garrett (1982, eqs 1 to 9): force per metre -(EI·r'')'' in addition to (λ·r')',
where λ = T - EI·κ². At node j the curvature vector is r'' = (q_j - q_{j-1})/l, q_e = Δx_e/l_e, with
l the mean of the unstretched lengths l_e of the adjacent elements, so E_j = ½·(EI/l)·|q_j -
q_{j-1}|². For small angles it is the discrete rod of Bergou et al. (2008, section 4.2).

The energy is quadratic in the positions: its forces are linear, the couplings are multiples of the
unit matrix, the Jacobian is exact and the problem stays convex, and there is no division by the
length of an element. The price: the element's law holds for λ. It differs from the tension by
EI·κ², which matters only where that exceeds the tension: there, in loops tighter than √(EI/T), an
element shortens instead of carrying compression.

Ends are hinged, and so is a connection of several ropes: each has a moment at its inner nodes only.
The hang-off may instead fix the rope's direction (half an element of curvature: 2·EI/l_top times
the normal deviation of the top element's q).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import Any, NamedTuple

import numpy as np

from rope_twin.core.jit.decorators import jit_exact, jit_exact_within
from rope_twin.core.jit.functions import fused
from rope_twin.core.jit.rows import row, rows, span
from rope_twin.core.loads.accounts import account
from rope_twin.core.loads.hooks import differs_by_rope, kernel
from rope_twin.core.state import BLOCK, LINK, POSITION, RESIDUAL, REST
from rope_twin.quantity import quantity

Triple = tuple[float, float, float]
SECOND = LINK + 1  # coupling with the second next node


@dataclass(frozen=True, kw_only=True)
class BendingParams:
    """Bending stiffness of the whole rope, and the boundary condition at the hang-off."""

    stiffness_n_m2: float = quantity("bending stiffness EI", "N·m²", 0.0, 1e10)
    clamped_along: Triple | None = quantity(
        "x, y, z: fixed direction of the rope at the hang-off; default: hinged", "",
        -1e3, 1e3, default=None,
    )  # fmt: skip

    def check(self) -> str | None:
        """Return the fault and its remedy, or None."""
        if self.clamped_along is not None and not any(self.clamped_along):
            return "clamped_along is a zero vector; give for example [0, 0, -1] for straight down"
        return None


class Bending(NamedTuple):
    """Kernel data of the bending stiffness."""

    EI: float  # [N·m²]
    clamp: float  # 2·EI where the hang-off fixes the direction, else 0 [N·m²]
    x: float  # that direction, a unit vector, upward along the rope
    y: float
    z: float


differs_by_rope(Bending)


def build(params: BendingParams, payload: Any, environment: Any) -> Bending:
    """Return the kernel data for a stiffness and a direction at the hang-off."""
    EI = float(params.stiffness_n_m2)
    if params.clamped_along is None:
        return Bending(EI, 0.0, 0.0, 0.0, 0.0)
    x, y, z = params.clamped_along
    size = sqrt(x * x + y * y + z * z)
    return Bending(EI, 2.0 * EI, -x / size, -y / size, -z / size)


@jit_exact_within
def _clamping_force(bending: Any, work: Any, n: int) -> Any:
    """Return 2·EI/l² times the normal deviation of the top element from the fixed direction [N]."""
    inverse = 1.0 / work[REST, n - 1]
    x, y, z = bending.x, bending.y, bending.z
    gx = fused(-inverse, work[POSITION, n] - work[POSITION, n - 1], x)
    gy = fused(-inverse, work[POSITION + 1, n] - work[POSITION + 1, n - 1], y)
    gz = fused(-inverse, work[POSITION + 2, n] - work[POSITION + 2, n - 1], z)
    along = fused(gz, z, fused(gy, y, gx * x))
    k = bending.clamp * inverse * inverse
    return k * fused(-along, x, gx), k * fused(-along, y, gy), k * fused(-along, z, gz)


@jit_exact
def _add_clamp(bending: Any, work: Any, p: float, n: int) -> None:
    """Add the force that turns the top element towards the fixed direction."""
    x, y, z = bending.x, bending.y, bending.z
    fx, fy, fz = _clamping_force(bending, work, n)
    rest = work[REST, n - 1]
    k = p * bending.clamp / (rest * rest * rest)
    for i in range(n - 1, n + 1):
        sign = 1.0 if i == n else -1.0
        work[RESIDUAL, i] += sign * fx
        work[RESIDUAL + 1, i] += sign * fy
        work[RESIDUAL + 2, i] += sign * fz
        work[BLOCK, i] = fused(k, fused(-x, x, 1.0), work[BLOCK, i])
        work[BLOCK + 1, i] = fused(-k * x, y, work[BLOCK + 1, i])
        work[BLOCK + 2, i] = fused(-k * x, z, work[BLOCK + 2, i])
        work[BLOCK + 3, i] = fused(k, fused(-y, y, 1.0), work[BLOCK + 3, i])
        work[BLOCK + 4, i] = fused(-k * y, z, work[BLOCK + 4, i])
        work[BLOCK + 5, i] = fused(k, fused(-z, z, 1.0), work[BLOCK + 5, i])


@kernel("pull", Bending, wide=True, exact=True)
def pull(bending: Any, work: Any, n: int) -> Any:
    """Return the force on the hang-off from the moment one node below and from the clamp.

    Its component along the rope is the EI·κ² by which the tension there exceeds λ.
    """
    low, top = work[REST, n - 2], work[REST, n - 1]
    fx, fy, fz = _clamping_force(bending, work, n)
    EI = 2.0 * bending.EI / (low + top)
    mx = EI * (_slope(work, POSITION, n - 1) - _slope(work, POSITION, n - 2))
    my = EI * (_slope(work, POSITION + 1, n - 1) - _slope(work, POSITION + 1, n - 2))
    mz = EI * (_slope(work, POSITION + 2, n - 1) - _slope(work, POSITION + 2, n - 2))
    return fx - mx / top, fy - my / top, fz - mz / top


@jit_exact_within
def _slope(work: Any, row: int, e: int) -> Any:
    """Return one component of q of element e."""
    return (work[row, e + 1] - work[row, e]) / work[REST, e]


@jit_exact_within
def _weight(work: Any, i: int, j: int) -> Any:
    """Return the weight of node i in the difference q_j - q_{j-1} at node j [1/m]."""
    low, up = 1.0 / work[REST, j - 1], 1.0 / work[REST, j]
    if i < j:
        return low
    return up if i > j else -(low + up)


@jit_exact
def _add_at(bending: Any, work: Any, p: float, i: int, n: int) -> None:
    """Add force and block of node i from the moments at it and its neighbours."""
    for j in range(max(i - 1, 1), min(i + 1, n - 1) + 1):
        EI, weight = 2.0 * bending.EI / (work[REST, j - 1] + work[REST, j]), _weight(work, i, j)
        for k in range(3):
            bend = _slope(work, POSITION + k, j) - _slope(work, POSITION + k, j - 1)
            work[RESIDUAL + k, i] = fused(-weight, EI * bend, work[RESIDUAL + k, i])
        for k in (0, 3, 5):
            work[BLOCK + k, i] = fused(p * EI * weight, weight, work[BLOCK + k, i])


@jit_exact_within
def _inner_force(positions: Any, inverse_lengths: Any, moments: Any) -> Any:
    """Return one component of the force on the third of five nodes from the moments about it.

    inverse_lengths: of the four elements between them [1/m]; moments: each weight times EI/l.
    """
    (p, q, r, s, t), (a, b, c, d), (low, middle, up) = positions, inverse_lengths, moments
    below, above = b * (r - q), c * (s - r)
    inner = fused(-low, fused(-a, q - p, below), middle * (above - below))
    return fused(-up, fused(d, t - s, -above), inner)


@jit_exact
def _add_inside(bending: Any, work: Any, stiffness: float, n: int) -> None:
    """Add force and block of the nodes 2 <= i < n - 1, whose three moments are at inner nodes."""
    px, py, pz = rows(work, POSITION, 0)
    qx, qy, qz = rows(work, POSITION, 1)
    rx, ry, rz = rows(work, POSITION, 2)
    sx, sy, sz = rows(work, POSITION, 3)
    tx, ty, tz = rows(work, POSITION, 4)
    rest = row(work, REST, 0)
    Rx, Ry, Rz = rows(work, RESIDUAL, 2)
    Axx, _, _, Ayy, _, Azz = span(work, BLOCK, 6, 2)
    EI = 2.0 * bending.EI
    for i in range(n - 3):
        k, l, m, o = rest[i], rest[i + 1], rest[i + 2], rest[i + 3]
        a, b, c, d = 1.0 / k, 1.0 / l, 1.0 / m, 1.0 / o
        low, here, up = b * (EI / (k + l)), (b + c) * (EI / (l + m)), c * (EI / (m + o))
        over, moments = (a, b, c, d), (low, here, up)
        Rx[i] += _inner_force((px[i], qx[i], rx[i], sx[i], tx[i]), over, moments)
        Ry[i] += _inner_force((py[i], qy[i], ry[i], sy[i], ty[i]), over, moments)
        Rz[i] += _inner_force((pz[i], qz[i], rz[i], sz[i], tz[i]), over, moments)
        own = stiffness * fused(up, c, fused(here, b + c, low * b))
        Axx[i] += own
        Ayy[i] += own
        Azz[i] += own


@jit_exact
def _add_links(bending: Any, work: Any, stiffness: float, n: int) -> None:
    """Add p times the moments' stiffness between a node and the next, and the second next."""
    rest, near, far = row(work, REST, 0), row(work, LINK, 0), row(work, SECOND, 0)
    EI = 2.0 * stiffness * bending.EI
    for i in range(1, n - 1):
        k, l, m = rest[i - 1], rest[i], rest[i + 1]
        a, b, c = 1.0 / k, 1.0 / l, 1.0 / m
        near[i] = fused(-b, fused(a + b, EI / (k + l), (b + c) * (EI / (l + m))), near[i])
    for i in range(n - 1):
        l, m = rest[i], rest[i + 1]
        far[i] += EI / (l * m * (l + m))
    # the links of both ends come from one moment
    near[0] -= EI / (rest[0] * rest[0] * rest[1])
    near[n - 1] -= EI / (rest[n - 1] * rest[n - 1] * rest[n - 2])


@kernel("couple", Bending, wide=True, exact=True)
def couple(bending: Any, work: Any, stage: Any, n: int) -> None:
    """Add the forces of each inner node's moment EI·r'' on it and its neighbours, and blocks."""
    if n > 1:
        _add_inside(bending, work, stage.p, n)
        _add_links(bending, work, stage.p, n)
        for i in range(2):
            _add_at(bending, work, stage.p, i, n)
        for i in range(max(n - 1, 2), n + 1):
            _add_at(bending, work, stage.p, i, n)
    _add_clamp(bending, work, stage.p, n)


@account("potential", Bending)
def potential(bending: Any, place: Any) -> Any:
    """Return ½·EI·∫κ² about each node, and that of the clamp at the hang-off [J]."""
    energy, rest = np.zeros(place.arc.shape), np.diff(place.arc)
    if len(rest) > 1:
        q = np.diff(place.position) / rest
        energy[1:-1] = bending.EI * (np.diff(q) ** 2).sum(axis=0) / (rest[1:] + rest[:-1])
        held = np.array([bending.x, bending.y, bending.z])
        lack = held - q[:, -1]
        across = lack - held * (held @ lack)
        energy[-1] = 0.5 * bending.clamp * float(across @ across) / rest[-1]
    return energy
