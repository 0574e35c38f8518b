"""Round numbers for axes."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

_MARGIN = 0.07  # at either end, in parts of the range
_OVER = 0.05  # so far data may reach into the margin, in parts of a step


def round_step(span: float, most: int = 7) -> float:
    """The smallest of 1, 2, 5 times a power of ten that divides `span` into at most `most`."""
    if not (math.isfinite(span) and span > 0.0):
        return 1.0
    least = span / most
    decade = 10.0 ** math.floor(math.log10(least))
    return next(step * decade for step in (1.0, 2.0, 5.0, 10.0) if step * decade >= least * 0.9999)


def ticks_over(span: float, most: int = 7) -> NDArray[np.float64]:
    """0, step, 2 step, ... up to the first tick at or beyond `span`."""
    step = round_step(span, most)
    return np.asarray(np.arange(math.ceil(max(span, step) / step - 1e-9) + 1) * step)


def decade_range(low: float, high: float, most: int = 5) -> tuple[float, float]:
    """A range around low to high with two to `most` + 1 multiples of a power of ten in it.

    rerun labels plots at multiples of a power of ten only, only where they are far enough apart,
    and not at the very edge: hence the margin.
    """
    span = max(high - low, 1e-3 * max(abs(low), abs(high)), 1e-6)
    step = 10.0 ** math.floor(math.log10(span))
    while True:
        first, last = math.floor(low / step + _OVER), math.ceil(high / step - _OVER)
        if last - first <= most:
            break
        step *= 10.0
    if first == last:
        first, last = first - 1, last + 1
    margin = _MARGIN * (last - first)
    return (first - margin) * step, (last + margin) * step
