"""Height and slopes of a seabed: a plane, or soundings, bilinear inside and constant outside."""

from __future__ import annotations

from typing import Any

import numpy as np

from rope_twin.core.bed import Grid, Plane
from rope_twin.core.jit.decorators import jit_entry, jit_exact_within, jit_within
from rope_twin.core.jit.functions import by_width
from rope_twin.core.jit.wide import choose, pick, widened
from rope_twin.core.state import Floats


@jit_within
def plane_bed(bed: Any, x: float, y: float) -> Any:
    """Return the height of a plane seabed and its slopes to the east and the north."""
    return bed.height + bed.east * x + bed.north * y, bed.east, bed.north


@jit_within
def _cell_of_one(axis: Any, at: float) -> Any:
    last = axis.shape[0] - 2
    i = 0
    while i < last and axis[i + 1] <= at:
        i += 1
    return i, axis[i], axis[i + 1]


@jit_within
def _cell_of_lanes(axis: Any, at: Any) -> Any:
    i = widened(0.0)
    for k in range(1, axis.shape[0] - 1):
        i = i + choose(axis[k] <= at, 1.0, 0.0)
    return i, pick(axis, (i,)), pick(axis, (i + 1.0,))


# The index of the cell of an axis that contains a coordinate, and both ends of the cell.
_cell = by_width(_cell_of_one, _cell_of_lanes)


@jit_within
def _corners_of_one(height: Any, j: int, i: int) -> Any:
    return height[j, i], height[j, i + 1], height[j + 1, i], height[j + 1, i + 1]


@jit_within
def _corners_of_lanes(height: Any, j: Any, i: Any) -> Any:
    right, far = i + 1.0, j + 1.0
    return (
        pick(height, (j, i)), pick(height, (j, right)),
        pick(height, (far, i)), pick(height, (far, right)),
    )  # fmt: skip


# The heights at the corners of a cell: on its lower row, then on the upper one.
_corners = by_width(_corners_of_one, _corners_of_lanes)


@jit_exact_within
def _share(low: Any, high: Any, at: Any) -> Any:
    """Return the fraction of a cell along an axis, in [0, 1]."""
    return min(max((at - low) / (high - low), 0.0), 1.0)


@jit_within
def _is_inside(axis: Any, at: Any) -> Any:
    """Return 1 between the ends of an axis, else 0."""
    return choose(axis[0] < at, choose(at < axis[axis.shape[0] - 1], 1.0, 0.0), 0.0)


@jit_exact_within
def grid_bed(bed: Any, x: Any, y: Any) -> Any:
    """Return the height of a gridded seabed and its slopes to the east and the north."""
    i, x0, x1 = _cell(bed.x, x)
    j, y0, y1 = _cell(bed.y, y)
    a, b = _share(x0, x1, x), _share(y0, y1, y)
    z00, z10, z01, z11 = _corners(bed.height, j, i)
    low, high = z00 + a * (z10 - z00), z01 + a * (z11 - z01)
    east = ((1.0 - b) * (z10 - z00) + b * (z11 - z01)) / (x1 - x0)
    north = (high - low) / (y1 - y0)
    return low + b * (high - low), _is_inside(bed.x, x) * east, _is_inside(bed.y, y) * north


def beds_at(bed: Plane | Grid, x: Floats, y: Floats) -> Floats:
    """Return height [m] and slopes of the seabed at x, y (n,), as (3, n); for Python callers."""
    surface = np.zeros((3, len(x)))
    if isinstance(bed, Plane):
        surface[0] = bed.height + bed.east * x + bed.north * y
        surface[1:] = [[bed.east], [bed.north]]
    else:
        _find_grid_bed(bed, x, y, surface)
    return surface


@jit_entry
def _find_grid_bed(bed: Any, x: Any, y: Any, surface: Any) -> None:
    for i in range(x.shape[0]):
        surface[0, i], surface[1, i], surface[2, i] = grid_bed(bed, x[i], y[i])


def clearance(bed: Plane | Grid, position: Floats) -> Floats:
    """Return the height above the seabed [m], (n,), of positions (3, n); negative below it."""
    return np.asarray(position[2] - beds_at(bed, position[0].copy(), position[1].copy())[0])
