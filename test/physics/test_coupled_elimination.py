"""Block-pentadiagonal solve, nodes coupled with two neighbours: against dense and tridiagonal."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from test_elimination import Vector, chain, solve

from rope_twin.core import state as rows
from rope_twin.core.jit.decorators import jit_entry
from rope_twin.core.pentadiagonal import eliminate_coupled, reduce_coupled, take_links


@jit_entry
def solve_coupled(work: Any, first: int, n: int) -> None:
    """Solve (A + K + couplings)·delta = R."""
    eliminate_coupled(work, first, n)


@jit_entry
def solve_again(work: Any, first: int, n: int) -> None:
    """Solve for another R by the existing factors."""
    reduce_coupled(work, first, n)


@jit_entry
def less_links(work: Any, n: int) -> None:
    """Subtract from R what corrections of other nodes contribute through couplings."""
    take_links(work, n)


def bent_chain(n: int, stiffness: float, seed: int) -> Vector:
    """Return a chain with random bending springs k·(Δ²x)², as stiff as its elements."""
    random = np.random.default_rng(seed)
    work = rows.new_work(n + 1, rows.COUPLED_ROWS)
    work[: rows.WORK_ROWS] = chain(n, stiffness, seed)
    diagonals = [rows.BLOCK, rows.BLOCK + 3, rows.BLOCK + 5]
    for j in range(1, n):
        low, up = random.uniform(0.3, 3.0, 2)
        k = stiffness * random.uniform(0.5, 2.0)
        for i, weight in ((j - 1, low), (j, -low - up), (j + 1, up)):
            work[diagonals, i] += k * weight**2
        work[rows.LINK, j - 1] -= k * low * (low + up)
        work[rows.LINK, j] -= k * up * (low + up)
        work[rows.LINK + 1, j - 1] += k * low * up
    return work


def matrix(work: Vector, n: int) -> Vector:
    """Return the assembled matrix of the nodes 0 <= i < n."""
    full = np.zeros((3 * (n + 2), 3 * (n + 2)))
    for i in range(n):
        block = np.zeros((3, 3))
        block[np.triu_indices(3)] = work[rows.BLOCK : rows.BLOCK + 6, i]
        full[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] += block + np.triu(block, 1).T
        t = work[rows.DIRECTION : rows.DIRECTION + 3, i]
        K = work[rows.AXIAL, i] * np.outer(t, t) + work[rows.GEOMETRIC, i] * np.eye(3)
        both = slice(3 * i, 3 * i + 6)
        full[both, both] += np.block([[K, -K], [-K, K]])
        for reach in (1, 2):
            here, there = slice(3 * i, 3 * i + 3), slice(3 * (i + reach), 3 * (i + reach) + 3)
            link = work[rows.LINK + reach - 1, i] * np.eye(3)
            full[here, there] += link
            full[there, here] += link
    return full[: 3 * n, : 3 * n]


@pytest.mark.parametrize("first", [0, 1])
@pytest.mark.parametrize("n", [3, 4, 7, 60])
@pytest.mark.parametrize("stiffness", [1e-2, 1.0, 1e3, 1e6])
def test_the_coupled_solve_equals_the_dense_solve(first: int, n: int, stiffness: float) -> None:
    """Free and fixed lower end; stiffness over mass up to 1e6, some elements slack."""
    for seed in range(5):
        work = bent_chain(n, stiffness, seed)
        free = slice(3 * first, 3 * n)
        right = work[rows.RESIDUAL : rows.RESIDUAL + 3, first:n].T.ravel()
        expected = np.linalg.solve(matrix(work, n)[free, free], right).reshape(-1, 3).T
        solve_coupled(work, first, n)
        actual = work[rows.CORRECTION : rows.CORRECTION + 3, first:n]
        assert np.abs(actual - expected).max() < 1e-9 * np.abs(expected).max()
        held = work[rows.CORRECTION : rows.CORRECTION + 3, [n, *range(first)]]
        assert (held == 0.0).all(), "hang-off and fixed end do not move"


@pytest.mark.parametrize("first", [0, 1])
def test_the_coupled_solve_without_couplings_equals_the_tridiagonal_one(first: int) -> None:
    """A chain with zero couplings gives the corrections of `eliminate`."""
    work = rows.new_work(61, rows.COUPLED_ROWS)
    work[: rows.WORK_ROWS] = chain(60, 1e3, 3)
    plain = work[: rows.WORK_ROWS].copy()
    solve(plain, first, 60)
    solve_coupled(work, first, 60)
    position = slice(rows.CORRECTION, rows.CORRECTION + 3)
    assert np.abs(work[position] - plain[position]).max() < 1e-11 * np.abs(plain[position]).max()


@pytest.mark.parametrize("first", [0, 1])
@pytest.mark.parametrize("n", [2, 3, 4, 5, 60])
def test_reused_factors_solve_another_right_hand_side(first: int, n: int) -> None:
    """Corrections equal those of a fresh solve; for twice the force they double."""
    work = bent_chain(n, 1e3, n)
    solve_coupled(work, first, n)
    position = slice(rows.CORRECTION, rows.CORRECTION + 3)
    once = work[position].copy()
    work[rows.RESIDUAL : rows.RESIDUAL + 3] *= 2.0
    solve_again(work, first, n)
    assert np.abs(work[position] - 2.0 * once).max() < 1e-12 * np.abs(once).max()
    force = np.random.default_rng(7).normal(size=(3, work.shape[1]))
    again = work.copy()
    for one in (work, again):
        one[rows.RESIDUAL : rows.RESIDUAL + 3] = force
    solve_again(work, first, n)
    solve_coupled(again, first, n)
    assert np.abs(work[position] - again[position]).max() < 1e-9 * np.abs(again[position]).max()


def test_couplings_are_subtracted_from_the_residual() -> None:
    """R - (couplings)·delta, by the whole matrix with and without them."""
    n = 9
    work = bent_chain(n, 10.0, 4)
    solve_coupled(work, 0, n)
    before = work[rows.RESIDUAL : rows.RESIDUAL + 3, :n].T.ravel()
    delta = work[rows.CORRECTION : rows.CORRECTION + 3, :n].T.ravel()
    bare = work.copy()
    bare[rows.LINK : rows.LINK + 2] = 0.0
    expected = before - (matrix(work, n) - matrix(bare, n)) @ delta
    less_links(work, n)
    after = work[rows.RESIDUAL : rows.RESIDUAL + 3, :n].T.ravel()
    assert np.abs(after - expected).max() < 1e-12 * np.abs(before).max()
