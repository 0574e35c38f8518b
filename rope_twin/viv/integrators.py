"""Implicit steps of M·ÿ + C·ẏ + K·y = F with diagonal M and C: to compare integrators with.

`newmark` (Newmark 1959; α 0.30 and δ 0.55 by default, as in [SJTU]) and `bathe` (Bathe and Baig
2005: half a step by the trapezoidal rule, the other half by three points backward).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from rope_twin.viv.span import Floats


class Motion(NamedTuple):
    """Of the free nodes, (n,) each."""

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
    """The upper diagonals of a symmetric sparse matrix in LAPACK's form."""
    n = matrix.shape[0]
    bands = np.zeros((diagonals, n))
    for k in range(diagonals):
        bands[diagonals - 1 - k, k:] = matrix.diagonal(k)
    return bands


def times(bands: Floats, vector: Floats) -> Floats:
    """K·y of a matrix in that form."""
    last = len(bands) - 1
    product: Floats = np.asarray(bands[last] * vector)
    for k in range(1, last + 1):
        product[:-k] += bands[last - k, k:] * vector[k:]
        product[k:] += bands[last - k, k:] * vector[:-k]
    return product


def _solve(bands: Floats, diagonal: Floats, right: Floats) -> Floats:
    """(K + diagonal)·x = right."""
    from scipy.linalg import solveh_banded

    sum_ = bands.copy()
    sum_[-1] += diagonal
    return np.asarray(solveh_banded(sum_, right, check_finite=False))


def newmark(alpha: float = 0.30, delta: float = 0.55) -> Integrator:
    """y += h·v + h²·((½ - α)·a + α·a'), v += h·((1 - δ)·a + δ·a'); needs the force at the end."""

    def step(at: Motion, parts: Matrices, middle: Floats, end: Floats, h: float) -> Motion:
        y = at.place + h * at.speed + (0.5 - alpha) * h * h * at.acceleration
        v = at.speed + (1.0 - delta) * h * at.acceleration
        right = end - parts.damping * v - times(parts.stiffness, y)
        weight = alpha * h * h
        diagonal = (parts.mass + delta * h * parts.damping) / weight
        a = _solve(parts.stiffness, diagonal, right) / weight
        return Motion(y + weight * a, v + delta * h * a, a)

    return step


def bathe(at: Motion, parts: Matrices, middle: Floats, end: Floats, h: float) -> Motion:
    """Two halves with the forces at their ends."""
    first = newmark(0.25, 0.5)(at, parts, middle, middle, 0.5 * h)
    y0, y1, v0, v1 = at.place, first.place, at.speed, first.speed
    v_hat = (y0 - 4.0 * y1) / h
    a_hat = (v0 - 4.0 * v1 + 3.0 * v_hat) / h
    diagonal = 9.0 / (h * h) * parts.mass + 3.0 / h * parts.damping
    y = _solve(parts.stiffness, diagonal, end - parts.mass * a_hat - parts.damping * v_hat)
    v = v_hat + 3.0 / h * y
    return Motion(y, v, (v0 - 4.0 * v1 + 3.0 * v) / h)
