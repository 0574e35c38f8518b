"""Implicit integration of M·ÿ + C·ẏ + K·y = F with diagonal M and C.

By the method of Bathe and Baig (2005): half a step by the trapezoidal rule, which is that of
Newmark (1959) with α 0.25 and δ 0.5, the other half by a three-point backward formula. K has three
or five diagonals; (K + D)·x = r with a diagonal D is solved by an LDLᵀ factorisation without
pivoting: the matrix is positive definite.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from rope_twin.core.jit.decorators import jit, jit_entry
from rope_twin.core.state import Floats


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


def bathe(at: Motion, parts: Matrices, middle: Floats, end: Floats, h: float) -> Motion:
    """Advance ½ h by the trapezoidal rule, then by v' = (y - 4·y½ + 3·y')/h, likewise a'."""
    after, work = np.empty((3, len(end))), np.empty((5, len(end)))
    bathe_step(at, parts, middle, end, h, after, work)
    return Motion(after[0], after[1], after[2])


@jit
def newmark_step(
    at: Any, parts: Any, force: Any, h: float, alpha: float, delta: float, after: Any, work: Any
) -> None:
    """Write displacement, velocity and acceleration after h seconds to the rows of `after`, (3, n).

    y += h·v + h²·((½ - α)·a + α·a'), v += h·((1 - δ)·a + δ·a') with the force at the end; at: the
    three before; parts: mass, damping and stiffness (LAPACK's upper form); work: scratch, (5, n).
    """
    y, v, a = at.place, at.speed, at.acceleration
    weight = alpha * h * h
    for i in range(y.shape[0]):
        after[0, i] = y[i] + h * v[i] + (0.5 - alpha) * h * h * a[i]
        after[1, i] = v[i] + (1.0 - delta) * h * a[i]
        work[0, i] = (parts.mass[i] + delta * h * parts.damping[i]) / weight
    _multiply(parts.stiffness, after, work)
    for i in range(y.shape[0]):
        work[1, i] = force[i] - parts.damping[i] * after[1, i] - work[1, i]
    _solve(parts.stiffness, work)
    for i in range(y.shape[0]):
        after[2, i] = work[1, i] / weight
        after[0, i] += work[1, i]
        after[1, i] += delta * h * after[2, i]


@jit_entry
def bathe_step(at: Any, parts: Any, middle: Any, end: Any, h: float, after: Any, work: Any) -> None:
    """Write the state after h seconds by Bathe's method; middle, end: forces of its substeps."""
    newmark_step(at, parts, middle, 0.5 * h, 0.25, 0.5, after, work)
    y, v, mass, damping = at.place, at.speed, parts.mass, parts.damping
    for i in range(y.shape[0]):
        v_hat = (y[i] - 4.0 * after[0, i]) / h
        a_hat = (v[i] - 4.0 * after[1, i] + 3.0 * v_hat) / h
        work[0, i] = 9.0 / (h * h) * mass[i] + 3.0 / h * damping[i]
        work[1, i] = end[i] - mass[i] * a_hat - damping[i] * v_hat
        after[0, i] = v_hat
    _solve(parts.stiffness, work)
    for i in range(y.shape[0]):
        speed = after[0, i] + 3.0 / h * work[1, i]
        after[2, i] = (3.0 * speed - 4.0 * after[1, i] + v[i]) / h
        after[0, i], after[1, i] = work[1, i], speed


@jit
def _multiply(K: Any, after: Any, work: Any) -> None:
    """Multiply K by the displacements, into row 1 of the scratch."""
    n, last = after.shape[1], K.shape[0] - 1
    for i in range(n):
        work[1, i] = K[last, i] * after[0, i]
    for k in range(1, last + 1):
        for i in range(k, n):
            work[1, i - k] += K[last - k, i] * after[0, i]
            work[1, i] += K[last - k, i] * after[0, i - k]


@jit
def _solve(K: Any, work: Any) -> None:
    """Solve (K + D)·x = r: D in row 0 of the scratch, r and then x in row 1."""
    n, last = work.shape[1], K.shape[0] - 1
    d, r, first, second = work[2], work[1], work[3], work[4]  # subdiagonals of L
    for i in range(n):
        d[i], first[i], second[i] = K[last, i] + work[0, i], 0.0, 0.0
        far = 0.0
        if last == 2 and i > 1:
            far = K[0, i]
            second[i] = far / d[i - 2]
            d[i] -= second[i] * far
            r[i] -= second[i] * r[i - 2]
        if i > 0:
            near = K[last - 1, i] - first[i - 1] * far
            first[i] = near / d[i - 1]
            d[i] -= first[i] * near
            r[i] -= first[i] * r[i - 1]
    for i in range(n - 1, -1, -1):
        r[i] /= d[i]
        if i + 1 < n:
            r[i] -= first[i + 1] * r[i + 1]
        if i + 2 < n:
            r[i] -= second[i + 2] * r[i + 2]
