"""Eigenvalues and eigenvectors of a tridiagonal matrix against a closed form and LAPACK."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import eigh_tridiagonal

from rope_twin.vortex.modes import count_below, find_eigenpairs

Floats = np.ndarray


def found(own: Floats, between: Floats, grid: Floats) -> tuple[Floats, Floats]:
    """All eigenvalues between the ends of a grid, and vectors of length 1."""
    counts = count_below(own, between, grid)
    values, vectors = find_eigenpairs(own, between, grid, counts, np.arange(counts[0], counts[-1]))
    return values, vectors / np.sqrt((vectors * vectors).sum(axis=0))


def rough_string(n: int) -> tuple[Floats, Floats]:
    """Springs and masses that differ by up to ten times from one to the next."""
    rng = np.random.default_rng(3)
    k, m = rng.uniform(0.2, 2.0, n + 1), rng.uniform(0.2, 2.0, n)
    return (k[1:] + k[:-1]) / m, -k[1:-1] / np.sqrt(m[1:] * m[:-1])


def test_eigenpairs_of_equal_masses_on_a_string() -> None:
    """λ_j = 4·sin²(jπ/2(n + 1)), vectors are sines."""
    n = 300
    angle = np.pi * np.arange(1, 41) / (n + 1)
    exact = 4.0 * np.sin(0.5 * angle) ** 2
    top = 0.5 * (exact[-1] + 4.0 * np.sin(0.5 * 41 * np.pi / (n + 1)) ** 2)
    values, vectors = found(np.full(n, 2.0), np.full(n - 1, -1.0), np.linspace(0.0, top, 100))
    np.testing.assert_allclose(values, exact, rtol=1e-10)
    sines = np.sqrt(2.0 / (n + 1)) * np.sin(np.arange(1, n + 1)[:, None] * angle)
    np.testing.assert_allclose(np.abs((sines * vectors).sum(axis=0)), 1.0, rtol=0, atol=1e-14)
    np.testing.assert_allclose(vectors.T @ vectors, np.eye(40), atol=1e-10)


@pytest.mark.parametrize("shifts", [2, 7, 400])
def test_eigenpairs_equal_lapacks(shifts: int) -> None:
    """A band in the middle, from grids that part the eigenvalues and from ones that do not."""
    own, between = rough_string(200)
    low, high = 0.3, 1.1
    values, vectors = found(own, between, np.linspace(low, high, shifts))
    theirs = eigh_tridiagonal(own, between, select="v", select_range=(low, high))
    assert len(values) == len(theirs[0]) > 20
    np.testing.assert_allclose(values, theirs[0], rtol=1e-12)
    np.testing.assert_allclose(np.abs((vectors * theirs[1]).sum(axis=0)), 1.0, rtol=0, atol=1e-12)


def test_nearly_degenerate_eigenvalues() -> None:
    """Two equal strings that a weak spring joins: pairs 1e-9 apart, and each vector solves."""
    half_own, half_between = rough_string(60)
    own = np.concatenate([half_own, half_own[::-1]])
    between = np.concatenate([half_between, [-1e-9], half_between[::-1]])
    values, vectors = found(own, between, np.linspace(0.0, 0.5, 50))
    theirs = eigh_tridiagonal(own, between, eigvals_only=True)
    np.testing.assert_allclose(values, theirs[: len(values)], rtol=0, atol=1e-13)
    assert len(values) > 10
    assert np.diff(values)[::2].min() < 1e-8
    left = own[:, None] * vectors - values * vectors
    left[1:] += between[:, None] * vectors[:-1]
    left[:-1] += between[:, None] * vectors[1:]
    assert np.abs(left).max() < 1e-13


def test_no_eigenvalue_in_an_empty_range() -> None:
    own, between = rough_string(20)
    values, vectors = found(own, between, np.array([-2.0, -1.0]))
    assert (values.shape, vectors.shape) == ((0,), (20, 0))
