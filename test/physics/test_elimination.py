"""Block-tridiagonal O(N) solve of a chain against numpy's dense solve."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from rope_twin.core import state as rows
from rope_twin.core.jit.decorators import jit_entry
from rope_twin.core.tridiagonal import eliminate, reduce

Vector = NDArray[np.float64]


@jit_entry
def solve(work: Any, first: int, n: int) -> None:
    """Solve (A + K)·delta = R with K from AXIAL, GEOMETRIC and DIRECTION."""
    eliminate(work, first, n)


@jit_entry
def solve_again(work: Any, first: int, n: int) -> None:
    """Solve for another residual by the factors of `solve`."""
    reduce(work, first, n)


def chain(n: int, stiffness: float, seed: int) -> Vector:
    """Return scratch with random blocks of mass about 1 and matching stiffness; some slack."""
    random = np.random.default_rng(seed)
    work = rows.new_work(n + 1)
    along = random.normal(0.0, 1.0, (3, n + 1))
    along[2] += 3.0
    work[rows.DIRECTION : rows.DIRECTION + 3] = along / np.linalg.norm(along, axis=0)
    work[rows.AXIAL] = stiffness * random.uniform(0.5, 2.0, n + 1)
    work[rows.GEOMETRIC] = 1e-3 * stiffness * random.uniform(0.5, 2.0, n + 1)
    slack = random.random(n + 1) < 0.15
    work[rows.AXIAL, slack] = work[rows.GEOMETRIC, slack] = 0.0
    for i in range(n):
        half = random.normal(0.0, 0.5, (3, 3))
        block = np.eye(3) + half @ half.T
        work[rows.BLOCK : rows.BLOCK + 6, i] = block[np.triu_indices(3)]
    work[rows.RESIDUAL : rows.RESIDUAL + 3] = random.normal(0.0, 1.0, (3, n + 1))
    return work


def dense(work: Vector, first: int, n: int) -> Vector:
    """Return the dense solution of the nodes first <= i < n."""
    matrix = np.zeros((3 * (n + 1), 3 * (n + 1)))
    for i in range(n):
        block = np.zeros((3, 3))
        block[np.triu_indices(3)] = work[rows.BLOCK : rows.BLOCK + 6, i]
        block += np.triu(block, 1).T
        matrix[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] += block
    for e in range(n):
        t = work[rows.DIRECTION : rows.DIRECTION + 3, e]
        K = work[rows.AXIAL, e] * np.outer(t, t) + work[rows.GEOMETRIC, e] * np.eye(3)
        both = slice(3 * e, 3 * e + 6)
        matrix[both, both] += np.block([[K, -K], [-K, K]])
    free = slice(3 * first, 3 * n)
    right = work[rows.RESIDUAL : rows.RESIDUAL + 3, first:n].T.ravel()
    return np.asarray(np.linalg.solve(matrix[free, free], right).reshape(-1, 3).T)


@pytest.mark.parametrize("first", [0, 1])
@pytest.mark.parametrize("n", [2, 3, 4, 7, 60])
@pytest.mark.parametrize("stiffness", [1e-2, 1.0, 1e3, 1e6])
def test_the_chain_solve_equals_the_dense_solve(first: int, n: int, stiffness: float) -> None:
    """Free and fixed lower end; stiffness over mass up to 1e6, some elements slack."""
    for seed in range(5):
        work = chain(n, stiffness, seed)
        expected = dense(work, first, n)
        solve(work, first, n)
        actual = work[rows.CORRECTION : rows.CORRECTION + 3, first:n]
        assert np.abs(actual - expected).max() < 1e-9 * np.abs(expected).max()
        held = work[rows.CORRECTION : rows.CORRECTION + 3, [n, *range(first)]]
        assert (held == 0.0).all(), "hang-off and fixed end do not move"


@pytest.mark.parametrize("first", [0, 1])
@pytest.mark.parametrize("n", [2, 3, 8, 61])
@pytest.mark.parametrize("stiffness", [1.0, 1e6])
def test_reused_factors_solve_another_residual(first: int, n: int, stiffness: float) -> None:
    """The factors are those of the old matrix, whatever the matrix is by then."""
    work = chain(n, stiffness, seed=7)
    residual = np.random.default_rng(8).normal(0.0, 1.0, (3, n + 1))
    other = work.copy()
    other[rows.RESIDUAL : rows.RESIDUAL + 3] = residual
    expected = dense(other, first, n)
    solve(work, first, n)
    work[rows.RESIDUAL : rows.RESIDUAL + 3] = residual
    work[rows.BLOCK : rows.BLOCK + 6] = work[rows.AXIAL : rows.GEOMETRIC + 1] = np.nan
    solve_again(work, first, n)
    actual = work[rows.CORRECTION : rows.CORRECTION + 3, first:n]
    assert np.abs(actual - expected).max() < 1e-9 * np.abs(expected).max()
