"""Prescribed motion over a step: hang-off position and line out as cubics through both ends.

Values and rates are given at the step's borders (rows of `motion` and `rate`, columns x, y, z and
line out); in between the cubic Hermite polynomial holds, so that every stage and every halved
step sees the boundary at its own time.
"""

from __future__ import annotations

from typing import Any

from rope_twin.core.jit import jit
from rope_twin.core.state import ACCELERATION, LINE, POSITION, VELOCITY


@jit
def boundary(motion: Any, rate: Any, row: int, column: int, part: float, h: float) -> Any:
    """Value, rate and second derivative of a column at `part` (0 to 1) of step `row`."""
    y0, y1 = motion[row, column], motion[row + 1, column]
    d0, d1 = rate[row, column] * h, rate[row + 1, column] * h
    c2 = 3.0 * (y1 - y0) - 2.0 * d0 - d1
    c3 = 2.0 * (y0 - y1) + d0 + d1
    u = part
    value = y0 + u * (d0 + u * (c2 + u * c3))
    first = (d0 + u * (2.0 * c2 + u * 3.0 * c3)) / h
    second = (2.0 * c2 + 6.0 * c3 * u) / (h * h)
    return value, first, second


@jit
def place_hang_off(work: Any, motion: Any, rate: Any, row: int, part: float, h: float, n: int) -> Any:  # fmt: skip # noqa: E501
    """Put node n where the hang-off is; return line out L, its rate V and acceleration."""
    for k in range(3):
        value, first, second = boundary(motion, rate, row, k, part, h)
        work[POSITION + k, n] = value
        work[VELOCITY + k, n] = first
        work[ACCELERATION + k, n] = second
    return boundary(motion, rate, row, LINE, part, h)
