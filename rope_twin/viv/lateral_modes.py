"""Cross-flow natural modes of a rope: M·ÿ + K·y = 0 with lumped masses.

K consists of tension, which varies along the rope, and of bending, EI·|y''|² on three neighbouring
nodes with hinged ends ([LCD] eqs 1 and 2: Le Cunff and Durand 1999; Irvine 1981, ch. 3). Unlike
`studies.modes` it treats the rope as a straight line, not in three dimensions, which is fast enough
for repeated use in a running twin. Without bending the matrix is tridiagonal
(core/modes/tridiagonal.py); with it, shift-and-invert on the sparse one.
"""

from __future__ import annotations

from itertools import pairwise
from math import ceil, pi
from typing import Any, NamedTuple

import numpy as np

from rope_twin.core.modes.tridiagonal import count_below, find_eigenpairs
from rope_twin.errors import InputError, phrase
from rope_twin.viv.span import Floats, Span

SPARE = 4  # modes requested beyond the number of a string without bending
MAX_MODES = 400  # maximum number of modes
SHIFTS_PER_MODE = 4  # shifts per mode of the string, so that few modes share an interval


class LateralModes(NamedTuple):
    """Natural modes, from the lowest up."""

    frequency: Floats  # [Hz], (k,)
    shape: Floats  # motion of the nodes, largest 1, (nodes, k)
    mass: Floats  # modal mass of that shape [kg], (k,)


def find_lateral_modes(span: Span, highest_hz: float) -> LateralModes:
    """Return all modes up to a frequency.

    Raises:
        InputError: the rope is slack somewhere, or has too many modes below that frequency.
    """
    return ModeSearch(span, highest_hz, MAX_MODES).found()


class ModeSearch:
    """Incremental modal analysis up to a frequency: a few modes per call, for a real-time run.

    Raises:
        InputError: the rope is slack somewhere, or has too many modes below that frequency.
    """

    def __init__(self, span: Span, highest_hz: float, part: int) -> None:
        """Set up the search; `part`: approximate number of modes per call."""
        if not (span.tension > 0.0).all():
            slack = int((span.tension <= 0.0).sum())
            what = f"{slack} of {len(span.tension)} elements are slack, so it has no modes"
            raise InputError(phrase("rope", what, "give it weight, tension or a payload"))
        expected = modes_below(span, highest_hz)
        if expected > MAX_MODES:
            what = f"about {expected:.0f} modes lie below {highest_hz:.3g} Hz"
            raise InputError(
                phrase("rope", what, f"at most {MAX_MODES} are taken; lower the current")
            )
        self.span, self.highest_hz = span, highest_hz
        self._first = 1 if span.end_mass is None else 0
        self._mass = span.node_mass[self._first : -1]
        parts = max(1, ceil(expected / part))
        # the frequencies of a string are equally spaced
        edges = 2.0 * pi * highest_hz * np.arange(parts + 1) / parts
        self._bands = [(-1.0 if low == 0.0 else low * low, high * high)
                       for low, high in pairwise(edges.tolist())]  # fmt: skip
        self._parts: list[tuple[Floats, Floats]] = []

    @property
    def left(self) -> int:
        """Return the number of calls that are left."""
        return len(self._bands) - len(self._parts)

    def go_on(self) -> None:
        """Compute the next group, if any is left."""
        if self.left:
            band = self._bands[len(self._parts)]
            solve = _three_diagonals if self.span.stiffness == 0.0 else _sparse
            self._parts.append(solve(self.span, self._mass, self._first, band))

    def found(self) -> LateralModes:
        """Complete the search and return all modes."""
        while self.left:
            self.go_on()
        squares = np.concatenate([part[0] for part in self._parts])
        vectors = np.concatenate([part[1] for part in self._parts], axis=1)
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


def _three_diagonals(
    span: Span, mass: Floats, first: int, band: tuple[float, float]
) -> tuple[Floats, Floats]:
    """Return squared frequencies in a band [rad²/s²] and vectors of the mass-normalised problem."""
    k = span.tension / np.diff(span.s)
    own = k[first:].copy()
    own[1 - first :] += k[: len(k) - 1]
    own /= mass
    between = -k[first:-1] / np.sqrt(mass[1:] * mass[:-1])
    low, high = np.sqrt(np.maximum(band, 0.0))
    expected = ceil(modes_below(span, float(high - low) / (2.0 * pi)))
    shifts = np.linspace(low, high, SHIFTS_PER_MODE * expected + 1) ** 2
    shifts[[0, -1]] = band
    counts = count_below(own, between, shifts)
    return find_eigenpairs(own, between, shifts, counts, np.arange(counts[0], counts[-1]))


def _sparse(
    span: Span, mass: Floats, first: int, band: tuple[float, float]
) -> tuple[Floats, Floats]:
    """Return the same with bending, which only reduces the number of modes in a band.

    The modes nearest to the middle of the band are computed, or from the lowest up, until some are
    beyond it.
    """
    from scipy.sparse import diags_array
    from scipy.sparse.linalg import eigsh

    root, (low, top) = diags_array(1.0 / np.sqrt(mass)), band
    K = (root @ stiffness(span)[first:-1, first:-1] @ root).tocsc()
    edges = np.sqrt([max(low, 0.0), top])
    middle = 0.0 if low < 0.0 else float(edges.mean()) ** 2
    wanted = ceil(modes_below(span, float(np.diff(edges)[0]) / (2.0 * pi)))
    wanted += SPARE if low < 0.0 else 2 * SPARE
    start = np.random.default_rng(1).standard_normal(len(mass))  # reproducible start vector
    while True:
        count = min(wanted, len(mass) - 2)
        squares, vectors = eigsh(K, k=count, sigma=middle, which="LM", v0=start)
        if count < wanted or (squares.max() > top and (low < 0.0 or squares.min() <= low)):
            break
        wanted *= 2
    order = np.argsort(squares)
    order = order[(squares[order] > low) & (squares[order] <= top)]
    return squares[order], vectors[:, order]


def stiffness(span: Span) -> Any:
    """Return the sparse stiffness of tension and bending between all nodes."""
    from scipy.sparse import csr_array, diags_array

    n = len(span.tension)
    rest = np.diff(span.s)
    slope = diags_array([-1.0 / rest, 1.0 / rest], offsets=[0, 1], shape=(n, n + 1))
    curve = diags_array([-np.ones(n - 1), np.ones(n - 1)], offsets=[0, 1], shape=(n - 1, n)) @ slope
    per_node = diags_array(2.0 * span.stiffness / (rest[1:] + rest[:-1]))
    taut = slope.T @ diags_array(span.tension * rest) @ slope
    return csr_array(taut + curve.T @ per_node @ curve)
