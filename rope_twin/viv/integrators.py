"""Implicit integrators of M·ÿ + C·ẏ + K·y = F with diagonal M and C.

`newmark` (Newmark 1959; α 0.30 and δ 0.55 by default, as in [SJTU]) and `bathe` (Bathe and Baig
2005: half a step by the trapezoidal rule, the other half by a three-point backward formula).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from rope_twin.core.modes.implicit import bathe_step, newmark_step
from rope_twin.viv.span import Floats


class Motion(NamedTuple):
    """Motion of the free nodes, (n,) each."""

    place: Floats
    speed: Floats
    acceleration: Floats


class Matrices(NamedTuple):
    """M and C diagonal (n,), K in LAPACK's upper banded form, (diagonals, n)."""

    mass: Floats
    damping: Floats
    stiffness: Floats


Integrator = Callable[[Motion, Matrices, Floats, Floats, float], Motion]


def upper_bands(matrix: Any, diagonals: int) -> Floats:
    """Return the upper diagonals of a symmetric sparse matrix in LAPACK's form."""
    n = matrix.shape[0]
    bands = np.zeros((diagonals, n))
    for k in range(diagonals):
        bands[diagonals - 1 - k, k:] = matrix.diagonal(k)
    return bands


def times(bands: Floats, vector: Floats) -> Floats:
    """Return K·y for a matrix in LAPACK's upper banded form."""
    last = len(bands) - 1
    product: Floats = np.asarray(bands[last] * vector)
    for k in range(1, last + 1):
        product[:-k] += bands[last - k, k:] * vector[k:]
        product[k:] += bands[last - k, k:] * vector[:-k]
    return product


def newmark(alpha: float = 0.30, delta: float = 0.55) -> Integrator:
    """Return an integrator y += h·v + h²·((½ - α)·a + α·a'), v += h·((1 - δ)·a + δ·a').

    It uses the force at the end of the step.
    """

    def step(at: Motion, parts: Matrices, middle: Floats, end: Floats, h: float) -> Motion:
        after, work = np.empty((3, len(end))), np.empty((5, len(end)))
        newmark_step(at, parts, end, h, alpha, delta, after, work)
        return Motion(after[0], after[1], after[2])

    return step


def bathe(at: Motion, parts: Matrices, middle: Floats, end: Floats, h: float) -> Motion:
    """Advance ½ h by the trapezoidal rule, then by v' = (y - 4·y½ + 3·y')/h, likewise a'."""
    after, work = np.empty((3, len(end))), np.empty((5, len(end)))
    bathe_step(at, parts, middle, end, h, after, work)
    return Motion(after[0], after[1], after[2])
