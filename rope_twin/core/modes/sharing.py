"""Power-in zones with mode competition: of several locked-in modes the largest is excited.

A place that mode k is locked in over the fraction l_k is assigned to it by l_k·Π(1 - l_j·b_jk) over
the other modes j, with b_jk = 1 where j is larger, 0 where it is smaller; the result is scaled so
that all together receive the locked-in fraction 1 - Π(1 - l_j), which is already the sum where each
b is 0 or 1. Two modes whose amplitudes agree within a factor of 1 + `tie` share: b varies smoothly
from 0 to 1 with the logarithm of their ratio, so that assignments do not jump where one outgrows
the other.
"""

from __future__ import annotations

from math import log
from typing import Any

import numpy as np

from rope_twin.core.jit.decorators import jit, jit_entry
from rope_twin.core.state import Floats


def share_out(size: Floats, locked: Floats, tie: float) -> Floats:
    """Return the fraction of each place assigned to each mode, 0 to 1, (places, modes).

    size: amplitude of the modes (0: assigned nothing); locked: fraction of each place that a mode
    is locked in over.
    """
    given, larger = np.zeros_like(locked), np.zeros((len(size), len(size)))
    _share_out(np.ascontiguousarray(size), locked, log(1.0 + tie), larger, given)
    return given


@jit_entry
def _share_out(size: Any, locked: Any, width: float, larger: Any, given: Any) -> None:
    modes = size.shape[0]
    for j in range(modes):
        for k in range(modes):
            larger[j, k] = 0.0 if j == k else _larger(size[j], size[k], width)
    for p in range(locked.shape[0]):
        first, last = modes, -1
        for k in range(modes):
            if locked[p, k] > 0.0 and size[k] > 0.0:
                first, last = min(first, k), k
        free, whole = 1.0, 0.0
        for k in range(first, last + 1):
            if size[k] > 0.0:
                part = locked[p, k]
                free *= 1.0 - part
                for j in range(first, last + 1):
                    part *= 1.0 - locked[p, j] * larger[j, k]
                given[p, k] = part
                whole += part
        for k in range(first, last + 1):
            given[p, k] *= (1.0 - free) / whole


@jit
def _larger(one: float, other: float, width: float) -> float:
    """Return 1 where one is larger than the other, 0 where it is smaller, smooth within a tie."""
    if one <= 0.0 or other <= 0.0:
        return 0.0
    x = log(one / other) / width
    if x <= -1.0:
        return 0.0
    if x >= 1.0:
        return 1.0
    return 0.5 + x * (0.75 - 0.25 * x * x)


def parts_below(values: Floats, limits: Floats) -> Floats:
    """Return the fraction of each place where `values`, linear between places, are below a limit.

    A place extends halfway to its neighbours. Result: (places, limits).
    """
    ends = np.concatenate([values[:1], 0.5 * (values[1:] + values[:-1]), values[-1:]])
    low, high = np.minimum(ends[1:], ends[:-1]), np.maximum(ends[1:], ends[:-1])
    found = np.empty((len(values), len(limits)))
    _parts_below(low, high, np.ascontiguousarray(limits), found)
    return found


@jit_entry
def _parts_below(low: Any, high: Any, limits: Any, found: Any) -> None:
    for p in range(low.shape[0]):
        width = high[p] - low[p]
        for k in range(limits.shape[0]):
            above = limits[k] - low[p]
            if above <= 0.0:
                found[p, k] = 0.0
            else:
                found[p, k] = 1.0 if above >= width else above / width
