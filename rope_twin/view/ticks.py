"""Round numbers for axes."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray


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
