"""Prescribed motion over a step: hang-off position and line out as cubics through both ends.

Values and rates are given at the steps' borders (a Boundary: rows are borders, columns x, y, z and
line out); in between the cubic Hermite polynomial holds, so that every stage and every halved
step sees the boundary at its own time.
"""

from __future__ import annotations

from typing import Any

from rope_twin.core.jit.decorators import jit
from rope_twin.core.state import ACCELERATION, LINE_COLUMN, POSITION, VELOCITY


@jit
def prescribed(boundary: Any, row: int, column: int, part: float, h: float) -> Any:
    """Value, rate and second derivative of a column at `part` (0 to 1) of step `row`."""
    y0, y1 = boundary.value[row, column], boundary.value[row + 1, column]
    d0, d1 = boundary.rate[row, column] * h, boundary.rate[row + 1, column] * h
    c2 = 3.0 * (y1 - y0) - 2.0 * d0 - d1
    c3 = 2.0 * (y0 - y1) + d0 + d1
    u = part
    value = y0 + u * (d0 + u * (c2 + u * c3))
    first = (d0 + u * (2.0 * c2 + u * 3.0 * c3)) / h
    second = (2.0 * c2 + 6.0 * c3 * u) / (h * h)
    return value, first, second


@jit
def place_hang_off(work: Any, boundary: Any, row: int, part: float, h: float, n: int) -> Any:
    """Put node n where the hang-off is; return line out L, its rate V and acceleration."""
    for k in range(3):
        value, first, second = prescribed(boundary, row, k, part, h)
        work[POSITION + k, n] = value
        work[VELOCITY + k, n] = first
        work[ACCELERATION + k, n] = second
    return prescribed(boundary, row, LINE_COLUMN, part, h)
