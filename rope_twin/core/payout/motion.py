"""Prescribed motion over a step: hang-off and paid-out length as cubic Hermite polynomials.

Values and rates are given at the step boundaries (a Boundary: rows are boundaries, columns x, y, z
and paid-out length), so that every stage and substep sees the prescribed motion at its own time.
"""

from __future__ import annotations

from typing import Any

from rope_twin.core.jit.decorators import jit
from rope_twin.core.state import ACCELERATION, LINE_COLUMN, POSITION, VELOCITY


@jit
def prescribed(boundary: Any, row: int, column: int, part: float, h: float) -> Any:
    """Return value, rate and second derivative of a column at the fraction `part` of a step."""
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
    """Set the hang-off's motion at node n; return paid-out length L, its rate and acceleration."""
    for k in range(3):
        value, first, second = prescribed(boundary, row, k, part, h)
        work[POSITION + k, n] = value
        work[VELOCITY + k, n] = first
        work[ACCELERATION + k, n] = second
    return prescribed(boundary, row, LINE_COLUMN, part, h)
