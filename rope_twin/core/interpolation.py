"""Sampled motion of a hang-off at the boundaries of many steps, in one compiled call.

Compiled without contraction of products and sums, so that a member of an ensemble is bit-identical
to a single twin, which evaluates the same polynomial in Python.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rope_twin.core.jit.decorators import compiled, jit_entry_exact
from rope_twin.core.state import LINE, Boundary, Floats


class Samples(NamedTuple):
    """Motion at rising times, of the vertical axis or of all three."""

    stamp: NDArray[np.int64]  # [ns], (samples,)
    value: Floats  # displacement [m], (motions, samples)
    rate: Floats  # [m/s], (motions, samples)


class Times(NamedTuple):
    """Times of boundaries, and the build-up of the motion there."""

    stamp: NDArray[np.int64]  # [ns], (steps,)
    factor: Floats  # (steps,)
    factor_rate: Floats  # [1/s], (steps,)


@jit_entry_exact
def _add_motion(samples: Samples, at: Times, value: Floats, rate: Floats) -> int:
    """Compiled implementation of `add_motion`."""
    stamps, z, v = samples.stamp, samples.value, samples.rate
    axis = LINE - z.shape[0]
    k = 1
    for j in range(at.stamp.shape[0]):
        while stamps[k] < at.stamp[j]:
            k += 1
        span = stamps[k] - stamps[k - 1]
        h, u = span * 1e-9, (at.stamp[j] - stamps[k - 1]) / span
        fraction, share_rate = at.factor[j], at.factor_rate[j]
        for i in range(z.shape[0]):
            z0, z1 = z[i, k - 1], z[i, k]
            d0, d1 = v[i, k - 1] * h, v[i, k] * h
            c2, c3 = 3.0 * (z1 - z0) - 2.0 * d0 - d1, 2.0 * (z0 - z1) + d0 + d1
            # + 0.0: a track adds the remainder of a gap, which turns -0 into 0
            moved = z0 + u * (d0 + u * (c2 + u * c3)) + 0.0
            speed = (d0 + u * (2.0 * c2 + u * 3.0 * c3)) / h + 0.0
            value[j + 1, axis + i] += fraction * moved
            rate[j + 1, axis + i] = fraction * speed + share_rate * moved
    return 0


_COMPILED: list[Any] = []


def add_motion(samples: Samples, at: Times, boundary: Boundary) -> None:
    """Add cubic Hermite polynomials through the samples to the boundaries after each step.

    at: ascending times after the first sample and up to the last; boundary: (steps + 1, MOTIONS)
    each, whose row 0 is unchanged. All arrays are contiguous.
    """
    first, last = np.searchsorted(samples.stamp, at.stamp[[0, -1]], side="left")
    used = slice(max(int(first) - 1, 0), int(last) + 1)
    z, v = (np.ascontiguousarray(table[:, used]) for table in (samples.value, samples.rate))
    arguments = (Samples(samples.stamp[used], z, v), at, boundary.value, boundary.rate)
    if not _COMPILED:
        _COMPILED.append(compiled(_add_motion, arguments))
    _COMPILED[0](*arguments)
