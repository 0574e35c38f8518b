"""Axis ticks at round numbers."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

_ABOVE = 0.25  # fraction of a step: a height above the water beyond it extends the scale
_OVER = 0.1  # fraction of a step by which a height may exceed the scale, as a crane that heaves
_MARGIN = 0.1  # at either end, as a fraction of the range or of a step
_MOST = 5.5


def round_step(span: float, most: int = 7) -> float:
    """Return the smallest 1, 2 or 5 × 10ⁿ that divides `span` into at most `most` steps."""
    if not (math.isfinite(span) and span > 0.0):
        return 1.0
    least = span / most
    decade = 10.0 ** math.floor(math.log10(least))
    return next(step * decade for step in (1.0, 2.0, 5.0, 10.0) if step * decade >= least * 0.9999)


def ticks_over(span: float, most: int = 7) -> NDArray[np.float64]:
    """Return 0, step, 2 step, ... up to the first tick at or beyond `span`."""
    step = round_step(span, most)
    return np.asarray(np.arange(math.ceil(max(span, step) / step - 1e-9) + 1) * step)


def depths_over(highest_m: float, deepest_m: float, most: int = 7) -> NDArray[np.float64]:
    """Return depth ticks from a height above the water to a depth, from the top down.

    Negative depths are heights; a hang-off barely above the water has none.
    """
    deepest_m, highest_m = max(deepest_m, 0.0), max(highest_m, 0.0)
    step = round_step(max(deepest_m + highest_m, 1e-9), most)
    above = math.ceil(highest_m / step - _OVER) if highest_m > _ABOVE * step else 0
    below = math.ceil(max(deepest_m, 0.0 if above else step) / step - 1e-9)
    return np.asarray(np.arange(-above, below + 1) * step)


def depth_words(depth_m: float) -> str:
    """Return the label of a depth tick; heights above the water have a plus sign."""
    return f"{depth_m:g}" if depth_m >= 0.0 else f"+{-depth_m:g}"


def decade_range(low: float, high: float) -> tuple[float, float]:
    """Return an axis range around low to high that contains at least two multiples of 10ⁿ.

    rerun labels plots at multiples of a power of ten only, and only if they are far enough apart:
    about _MOST of them in a plot of the view.
    """
    span = max(high - low, 1e-3 * max(abs(low), abs(high)), 1e-6)
    margin = _MARGIN * span
    bottom, top = low - margin, high + margin
    step = 10.0 ** math.floor(math.log10(span))
    while True:
        labels = math.floor(top / step) - math.ceil(bottom / step) + 1
        if labels >= 2 and top - bottom <= _MOST * step:
            return bottom, top
        first, last = math.floor(low / step), math.ceil(high / step)
        if first == last:
            first, last = first - 1, last + 1
        wide = last - first + 2.0 * _MARGIN
        if wide <= _MOST:
            return (first - _MARGIN) * step, (last + _MARGIN) * step
        step *= 10.0
