"""Cross-flow natural modes of a rope: M·ÿ + K·y = 0 with lumped masses.

K consists of tension, which varies along the rope, and of bending, EI·|y''|² on three neighbouring
nodes with hinged ends ([LCD] eqs 1 and 2: Le Cunff and Durand 1999; Irvine 1981, ch. 3). Unlike
`studies.modes` it treats the rope as a straight line, not in three dimensions, which is fast enough
for repeated use in a running twin. Without bending the matrix is tridiagonal
(`find_eigenpairs`); with it, shift-and-invert on the sparse one.

Eigenvalues and vectors of a symmetric tridiagonal matrix are found many at a time. Twisted
factorisations, as in LAPACK's dlar1v (Dhillon and Parlett 2004): pivots of A - x from below, p_i =
a_i - x - b²_{i-1}/p_{i-1}, and from above, q_i = a_i - x - b²_i/q_{i+1}. The number of negative p_i
is the number of eigenvalues below x (Sylvester). With γ_i = p_i + q_i - (a_i - x) and r where it is
smallest, the vector that is 1 at r, z_i = -b_i·z_{i+1}/p_i below and -b_{i-1}·z_{i-1}/q_i above,
solves (A - x)·z = γ_r·e_r, and x + γ_r/|z|² is its Rayleigh quotient, whose error is quadratic in
that of x. |z|² comes with the pivots, from below by u_i = 1 + (b_{i-1}/p_{i-1})²·u_{i-1}.

The counts keep each eigenvalue in a bracket; a quotient outside of it, or computed while others
share it, is replaced by the bracket's middle.

The innermost loops run over the eigenvalues, whose divisions are independent of each other.
"""

from __future__ import annotations

from itertools import pairwise
from math import ceil, pi
from typing import Any, NamedTuple

import numpy as np

from rope_twin.core.jit.decorators import jit, jit_entry
from rope_twin.core.state import Floats
from rope_twin.errors import InputError
from rope_twin.vortex.line_model import Span

SPARE = 4  # modes requested beyond the number of a string without bending
MAX_MODES = 400  # maximum number of modes
SHIFTS_PER_MODE = 4  # shifts per mode of the string, so that few modes share an interval


class LateralModes(NamedTuple):
    """Natural modes, from the lowest up."""

    frequency: Floats  # [Hz], (k,)
    shape: Floats  # motion of the nodes, largest 1, (nodes, k)
    mass: Floats  # modal mass of that shape [kg], (k,)


class ModeSearch:
    """Incremental modal analysis up to a frequency: a few modes per call, for a real-time run.

    Raises:
        InputError: the rope is slack somewhere, or has too many modes below that frequency.
    """

    def __init__(self, span: Span, max_hz: float, part: int = MAX_MODES) -> None:
        """Set up the search; `part`: approximate number of modes per call."""
        if not (span.tension > 0.0).all():
            slack = int((span.tension <= 0.0).sum())
            problem = f"{slack} of {len(span.tension)} elements are slack, so it has no modes"
            raise InputError("rope", problem, "give it weight, tension or a payload")
        expected = modes_below(span, max_hz)
        if expected > MAX_MODES:
            problem = f"about {expected:.0f} modes lie below {max_hz:.3g} Hz"
            raise InputError("rope", problem, f"at most {MAX_MODES} are taken; lower the current")
        self.span, self.max_hz = span, max_hz
        self._first = 1 if span.end_mass is None else 0
        self._mass = span.node_mass[self._first : -1]
        parts = max(1, ceil(expected / part))
        # the frequencies of a string are equally spaced
        edges = 2.0 * pi * max_hz * np.arange(parts + 1) / parts
        self._bands = [(-1.0 if low == 0.0 else low * low, high * high)
                       for low, high in pairwise(edges.tolist())]  # fmt: skip
        self._parts: list[tuple[Floats, Floats]] = []

    @property
    def left(self) -> int:
        """Return the number of remaining calls."""
        return len(self._bands) - len(self._parts)

    def go_on(self) -> None:
        """Compute the next group, if any is left."""
        if self.left:
            band = self._bands[len(self._parts)]
            solve = _tridiagonal_modes if self.span.stiffness == 0.0 else _bending_modes
            self._parts.append(solve(self.span, self._mass, self._first, band))

    def found(self) -> LateralModes:
        """Complete the search and return all modes."""
        while self.left:
            self.go_on()
        squares = np.concatenate([group[0] for group in self._parts])
        vectors = np.concatenate([group[1] for group in self._parts], axis=1)
        span, first = self.span, self._first
        shape = np.zeros((len(span.s), len(squares)))
        shape[first:-1] = vectors / np.sqrt(self._mass)[:, None]
        largest = np.abs(shape).max(axis=0, initial=0.0)
        shape /= np.where(largest > 0.0, largest, 1.0) * np.where(shape[-2] < 0.0, -1.0, 1.0)
        return LateralModes(
            np.sqrt(np.maximum(squares, 0.0)) / (2.0 * pi),
            shape,
            np.einsum("n,nk->k", span.node_mass, shape**2),
        )


def modes_below(span: Span, frequency_hz: float) -> float:
    """Return the number of modes of a string of this tension below f: 2·f·∫√(m/T) ds."""
    return float(2.0 * frequency_hz * (np.sqrt(span.mass / span.tension) * np.diff(span.s)).sum())


def _tridiagonal_modes(
    span: Span, mass: Floats, first: int, band: tuple[float, float]
) -> tuple[Floats, Floats]:
    """Return squared frequencies in a band [rad²/s²] and vectors of the mass-normalised problem."""
    k = span.tension / np.diff(span.s)
    diagonal = k[first:].copy()
    diagonal[1 - first :] += k[: len(k) - 1]
    diagonal /= mass
    off_diagonal = -k[first:-1] / np.sqrt(mass[1:] * mass[:-1])
    low, high = np.sqrt(np.maximum(band, 0.0))
    expected = ceil(modes_below(span, float(high - low) / (2.0 * pi)))
    shifts = np.linspace(low, high, SHIFTS_PER_MODE * expected + 1) ** 2
    shifts[[0, -1]] = band
    counts = count_below(diagonal, off_diagonal, shifts)
    return find_eigenpairs(diagonal, off_diagonal, shifts, counts, np.arange(counts[0], counts[-1]))


def _bending_modes(
    span: Span, mass: Floats, first: int, band: tuple[float, float]
) -> tuple[Floats, Floats]:
    """Return the same with bending stiffness, which can only reduce the number of modes in a band.

    The modes nearest to the middle of the band are computed, or from the lowest up, until some are
    beyond it.
    """
    from scipy.sparse import diags_array
    from scipy.sparse.linalg import eigsh

    root, (low, top) = diags_array(1.0 / np.sqrt(mass)), band
    K = (root @ stiffness(span)[first:-1, first:-1] @ root).tocsc()
    edges = np.sqrt([max(low, 0.0), top])
    middle = 0.0 if low < 0.0 else float(edges.mean()) ** 2
    requested = ceil(modes_below(span, float(np.diff(edges)[0]) / (2.0 * pi)))
    requested += SPARE if low < 0.0 else 2 * SPARE
    start = np.random.default_rng(1).standard_normal(len(mass))  # reproducible start vector
    while True:
        count = min(requested, len(mass) - 2)
        squares, vectors = eigsh(K, k=count, sigma=middle, which="LM", v0=start)
        if count < requested or (squares.max() > top and (low < 0.0 or squares.min() <= low)):
            break
        requested *= 2
    order = np.argsort(squares)
    order = order[(squares[order] > low) & (squares[order] <= top)]
    return squares[order], vectors[:, order]


def stiffness(span: Span) -> Any:
    """Return the sparse stiffness of tension and bending between all nodes."""
    from scipy.sparse import csr_array, diags_array

    n = len(span.tension)
    length = np.diff(span.s)
    slope = diags_array([-1.0 / length, 1.0 / length], offsets=[0, 1], shape=(n, n + 1))
    curve = diags_array([-np.ones(n - 1), np.ones(n - 1)], offsets=[0, 1], shape=(n - 1, n)) @ slope
    per_node = diags_array(2.0 * span.stiffness / (length[1:] + length[:-1]))
    tension = slope.T @ diags_array(span.tension * length) @ slope
    return csr_array(tension + curve.T @ per_node @ curve)


SHIFT_TOL = 1e-13  # of a bracket's width: a shift this close to the eigenvalue is converged
ROUND_OFF = 2e-16  # of n times the largest diagonal entry: a smaller γ is round-off
MAX_ITERATIONS = 200  # bisection alone takes 60


class _Iteration(NamedTuple):
    """Iteration state of each eigenvalue, (k,)."""

    number: Floats  # from the lowest, 0
    shift: Floats  # x
    low: Floats  # the bracket, and the number of eigenvalues below its ends
    high: Floats
    low_count: Floats
    high_count: Floats
    counted: Floats  # number of eigenvalues below x
    twist: Floats  # γ_r
    at: Floats  # r
    width: Floats  # of the initial bracket
    done: Floats  # 0 or 1
    value: Floats


class _Pivots(NamedTuple):
    """Pivots and sums of squares at all shifts, (n, k)."""

    below: Floats
    above: Floats
    sum_below: Floats
    sum_above: Floats


def count_below(diagonal: Floats, off_diagonal: Floats, shifts: Floats) -> Floats:
    """Return the number of eigenvalues below each shift."""
    counts = np.zeros(len(shifts))
    _count(diagonal, off_diagonal, shifts, counts, np.zeros(len(shifts)))
    return counts


def find_eigenpairs(
    diagonal: Floats, off_diagonal: Floats, grid: Floats, counts: Floats, numbers: Floats
) -> tuple[Floats, Floats]:
    """Return the eigenvalues of these indices (lowest: 0), (k,), and their vectors, (n, k).

    grid, counts: ascending shifts and the number of eigenvalues below each; the eigenvalues lie
    between them. The largest component of a vector is about 1.
    """
    n, k = len(diagonal), len(numbers)
    vectors = np.zeros((n, k))
    upper = np.searchsorted(counts, numbers, side="right")
    low, high = grid[upper - 1], grid[upper]
    zeros = np.zeros((5, k))
    search = _Iteration(
        np.asarray(numbers, dtype=float), 0.5 * (low + high), low.copy(), high.copy(),
        counts[upper - 1], counts[upper], zeros[0], zeros[1], zeros[2], high - low, zeros[3],
        zeros[4],
    )  # fmt: skip
    round_off = ROUND_OFF * n * float(diagonal.max())
    _find(diagonal, off_diagonal, round_off, search, _Pivots(*np.empty((4, n, k))), vectors)
    return search.value, vectors


@jit_entry
def _count(diagonal: Any, off_diagonal: Any, shifts: Any, counts: Any, pivots: Any) -> None:
    for k in range(shifts.shape[0]):
        pivots[k] = diagonal[0] - shifts[k]
        counts[k] = 1.0 if pivots[k] < 0.0 else 0.0
    for i in range(1, diagonal.shape[0]):
        a, square = diagonal[i], off_diagonal[i - 1] * off_diagonal[i - 1]
        for k in range(shifts.shape[0]):
            pivots[k] = a - shifts[k] - square / pivots[k]
            counts[k] += 1.0 if pivots[k] < 0.0 else 0.0


@jit_entry
def _find(
    diagonal: Any, off_diagonal: Any, round_off: float, search: Any, pivots: Any, vectors: Any
) -> None:
    for _ in range(MAX_ITERATIONS):
        _factorise(diagonal, off_diagonal, search, pivots)
        active = 0
        for k in range(vectors.shape[1]):
            if search.done[k] == 0.0:
                active += _improve(round_off, search, pivots, k)
        if active == 0:
            break
    for k in range(vectors.shape[1]):
        _write(off_diagonal, search, pivots, vectors, k)


@jit
def _factorise(diagonal: Any, off_diagonal: Any, search: Any, pivots: Any) -> None:
    """Compute pivots from below and above, sums of squares, and where γ is smallest."""
    n, lanes = pivots.below.shape
    p, q, u, w = pivots.below, pivots.above, pivots.sum_below, pivots.sum_above
    x, count, twist, at = search.shift, search.counted, search.twist, search.at
    for k in range(lanes):
        p[0, k] = diagonal[0] - x[k]
        q[n - 1, k] = diagonal[n - 1] - x[k]
        u[0, k] = w[n - 1, k] = 1.0
        count[k] = 1.0 if p[0, k] < 0.0 else 0.0
        twist[k] = np.inf
    for i in range(1, n):
        a, b = diagonal[i], off_diagonal[i - 1]
        for k in range(lanes):
            ratio = b / p[i - 1, k]
            p[i, k] = a - x[k] - b * ratio
            u[i, k] = 1.0 + ratio * ratio * u[i - 1, k]
            count[k] += 1.0 if p[i, k] < 0.0 else 0.0
    for i in range(n - 2, -1, -1):
        a, b = diagonal[i], off_diagonal[i]
        for k in range(lanes):
            ratio = b / q[i + 1, k]
            q[i, k] = a - x[k] - b * ratio
            w[i, k] = 1.0 + ratio * ratio * w[i + 1, k]
    for i in range(n):
        a = diagonal[i]
        for k in range(lanes):
            gamma = p[i, k] + q[i, k] - (a - x[k])
            is_smaller = abs(gamma) < abs(twist[k])
            twist[k] = gamma if is_smaller else twist[k]
            at[k] = float(i) if is_smaller else at[k]


@jit
def _improve(round_off: float, search: Any, pivots: Any, k: int) -> int:
    """Set the next shift of one eigenvalue; return 0 if it has converged."""
    x, r = search.shift[k], int(search.at[k])
    square = pivots.sum_below[r, k] + pivots.sum_above[r, k] - 1.0
    better = x + search.twist[k] / square
    isolated = search.high_count[k] - search.low_count[k] == 1.0
    inside = search.low[k] < better < search.high[k]
    exact = abs(better - x) < SHIFT_TOL * search.width[k] or abs(search.twist[k]) < round_off
    if isolated and inside and exact:
        search.value[k], search.done[k] = better, 1.0
        return 0
    if search.counted[k] <= search.number[k]:
        search.low[k], search.low_count[k] = x, search.counted[k]
    else:
        search.high[k], search.high_count[k] = x, search.counted[k]
    inside = search.low[k] < better < search.high[k]
    isolated = search.high_count[k] - search.low_count[k] == 1.0
    search.shift[k] = better if isolated and inside else 0.5 * (search.low[k] + search.high[k])
    search.value[k] = search.shift[k]
    return 1


@jit
def _write(off_diagonal: Any, search: Any, pivots: Any, vectors: Any, k: int) -> None:
    """Write the eigenvector that is 1 at its twist index."""
    r = int(search.at[k])
    vectors[r, k] = 1.0
    for i in range(r - 1, -1, -1):
        vectors[i, k] = -off_diagonal[i] / pivots.below[i, k] * vectors[i + 1, k]
    for i in range(r + 1, vectors.shape[0]):
        vectors[i, k] = -off_diagonal[i - 1] / pivots.above[i, k] * vectors[i - 1, k]
