"""Shape of the seabed: a plane, or a grid of soundings, bilinear inside, level outside."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from rope_twin.core.jit.decorators import jit_entry, jit_within
from rope_twin.core.loads.hooks import differs
from rope_twin.core.state import Floats


class Soil(NamedTuple):
    """Contact properties of the seabed."""

    k: float  # stiffness per area [N/m³]
    k_payload: float  # stiffness below the payload [N/m]
    chi: float  # Hunt-Crossley damping χ [s/m]
    mu: float  # friction coefficient μ


class Plane(NamedTuple):
    """A plane seabed z = height + east·x + north·y."""

    height: float  # at the origin [m]
    east: float
    north: float
    soil: Soil


class Grid(NamedTuple):
    """A seabed given by soundings on a rectangular grid."""

    top: float  # maximum z [m]
    x: Floats  # (columns,)
    y: Floats  # (rows,)
    height: Floats  # z of the bed [m], (rows, columns)
    soil: Soil


differs(Plane, Grid)


@jit_within
def plane_bed(bed: Any, x: float, y: float) -> Any:
    """Return the height of a plane seabed and its slopes to the east and the north."""
    return bed.height + bed.east * x + bed.north * y, bed.east, bed.north


@jit_within
def _cell(axis: Any, at: float) -> Any:
    """Return the index of the cell that contains `at` and the fraction along it, in [0, 1]."""
    last = axis.shape[0] - 2
    i = 0
    while i < last and axis[i + 1] <= at:
        i += 1
    return i, min(max((at - axis[i]) / (axis[i + 1] - axis[i]), 0.0), 1.0)


@jit_within
def grid_bed(bed: Any, x: float, y: float) -> Any:
    """Return the height of a gridded seabed and its slopes to the east and the north."""
    i, a = _cell(bed.x, x)
    j, b = _cell(bed.y, y)
    z00, z10 = bed.height[j, i], bed.height[j, i + 1]
    z01, z11 = bed.height[j + 1, i], bed.height[j + 1, i + 1]
    low, high = z00 + a * (z10 - z00), z01 + a * (z11 - z01)
    inside_x = 1.0 if bed.x[0] < x < bed.x[-1] else 0.0
    inside_y = 1.0 if bed.y[0] < y < bed.y[-1] else 0.0
    east = ((1.0 - b) * (z10 - z00) + b * (z11 - z01)) / (bed.x[i + 1] - bed.x[i])
    north = (high - low) / (bed.y[j + 1] - bed.y[j])
    return low + b * (high - low), inside_x * east, inside_y * north


def beds_at(bed: Plane | Grid, x: Floats, y: Floats) -> Floats:
    """Return height [m] and slopes of the seabed at x, y (n,), as (3, n); for Python callers."""
    found = np.zeros((3, len(x)))
    if isinstance(bed, Plane):
        found[0] = bed.height + bed.east * x + bed.north * y
        found[1:] = [[bed.east], [bed.north]]
    else:
        _find_grid_bed(bed, x, y, found)
    return found


@jit_entry
def _find_grid_bed(bed: Any, x: Any, y: Any, found: Any) -> None:
    for i in range(x.shape[0]):
        found[0, i], found[1, i], found[2, i] = grid_bed(bed, x[i], y[i])


def clearance(bed: Plane | Grid, position: Floats) -> Floats:
    """Return the height above the seabed [m], (n,), of positions (3, n); negative below it."""
    return np.asarray(position[2] - beds_at(bed, position[0].copy(), position[1].copy())[0])
