"""Cubic Hermite interpolation of sampled motion at many times in one compiled call.

Compiled without contraction of products and sums: a twin evaluates the same polynomial in Python a
time at a time, and a member of an ensemble equals its twin to the bit.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from rope_twin.core.jit.decorators import compiled, jit_entry_exact
from rope_twin.core.state import Floats

Times = NDArray[np.int64]


@jit_entry_exact
def _interpolate(
    stamps: Times, z: Floats, v: Floats, at: Times, value: Floats, rate: Floats
) -> int:
    """Entry point of the compiled code behind `interpolate`."""
    k = 1
    for j in range(at.shape[0]):
        while stamps[k] < at[j]:
            k += 1
        span = stamps[k] - stamps[k - 1]
        h, u = span * 1e-9, (at[j] - stamps[k - 1]) / span
        for i in range(z.shape[0]):
            z0, z1 = z[i, k - 1], z[i, k]
            d0, d1 = v[i, k - 1] * h, v[i, k] * h
            c2, c3 = 3.0 * (z1 - z0) - 2.0 * d0 - d1, 2.0 * (z0 - z1) + d0 + d1
            # + 0.0: a track adds the remainder of a gap, which turns -0 into 0
            value[i, j] = z0 + u * (d0 + u * (c2 + u * c3)) + 0.0
            rate[i, j] = (d0 + u * (2.0 * c2 + u * 3.0 * c3)) / h + 0.0
    return 0


_COMPILED: list[Any] = []


def interpolate(stamps: Times, z: Floats, v: Floats, at: Times) -> tuple[Floats, Floats]:
    """Return value and rate of several motions at rising times, (motions, times) each.

    stamps: rising times of the samples [ns], (samples,); z, v: values and their rates [1/s] there,
    (motions, samples); at: times after the first stamp and up to the last [ns], (times,). All
    arrays are contiguous.
    """
    first = max(int(np.searchsorted(stamps, at[0], side="left")) - 1, 0)
    last = int(np.searchsorted(stamps, at[-1], side="left")) + 1
    some = slice(first, last)
    shape = len(z), len(at)
    value, rate = np.empty(shape), np.empty(shape)
    given = (
        stamps[some],
        np.ascontiguousarray(z[:, some]),
        np.ascontiguousarray(v[:, some]),
        at,
        value,
        rate,
    )
    if not _COMPILED:
        _COMPILED.append(compiled(_interpolate, given))
    _COMPILED[0](*given)
    return value, rate
