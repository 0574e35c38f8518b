"""Natural modes of a rope across itself: M·ÿ + K·y = 0 with lumped masses.

K of the tension, which varies along the rope, and of bending, EI·|y''|² on three neighbouring nodes
with hinged ends ([LCD] eqs 1 and 2: Le Cunff and Durand 1999; Irvine 1981, ch. 3). Unlike
`studies.modes` it knows the rope as a line, not in three dimensions: fast enough to be asked again
while a twin runs. Without bending the matrix has three diagonals (core/modes/tridiagonal.py); with
it, shift and invert on the sparse one.
"""

from __future__ import annotations

from itertools import pairwise
from math import ceil, pi
from typing import Any, NamedTuple

import numpy as np

from rope_twin.core.modes.tridiagonal import count_below, find_eigenpairs
from rope_twin.errors import InputError, phrase
from rope_twin.viv.span import Floats, Span

SPARE = 4  # modes asked for beyond the number that a string without bending would have
MOST = 400  # modes of one rope
APART = 4  # shifts for each mode that a string would have: few modes share a gap between two


class LateralModes(NamedTuple):
    """Of k modes, from the lowest up."""

    frequency: Floats  # [Hz], (k,)
    shape: Floats  # motion of the nodes, largest 1, (nodes, k)
    mass: Floats  # modal, of that shape [kg], (k,)


def find_lateral_modes(span: Span, highest_hz: float) -> LateralModes:
    """All modes up to a frequency.

    Raises:
        InputError: the rope is slack somewhere, or has too many modes below that frequency.
    """
    return ModeSearch(span, highest_hz, MOST).found()


class ModeSearch:
    """The modes of a rope up to a frequency, some at a time: for who has no time for all at once.

    Raises:
        InputError: as for all of them.
    """

    def __init__(self, span: Span, highest_hz: float, part: int) -> None:
        """`part`: about so many modes at a time."""
        if not (span.tension > 0.0).all():
            slack = int((span.tension <= 0.0).sum())
            what = f"{slack} of {len(span.tension)} elements are slack, so it has no modes"
            raise InputError(phrase("rope", what, "give it weight, tension or a payload"))
        expected = modes_below(span, highest_hz)
        if expected > MOST:
            what = f"about {expected:.0f} modes lie below {highest_hz:.3g} Hz"
            raise InputError(phrase("rope", what, f"at most {MOST} are taken; lower the current"))
        self.span, self.highest_hz = span, highest_hz
        self._first = 1 if span.end_mass is None else 0
        self._mass = span.node_mass[self._first : -1]
        parts = max(1, ceil(expected / part))
        # a string's frequencies lie equally far apart
        edges = 2.0 * pi * highest_hz * np.arange(parts + 1) / parts
        self._bands = [(-1.0 if low == 0.0 else low * low, high * high)
                       for low, high in pairwise(edges.tolist())]  # fmt: skip
        self._parts: list[tuple[Floats, Floats]] = []

    @property
    def left(self) -> int:
        """How often it can go on."""
        return len(self._bands) - len(self._parts)

    def go_on(self) -> None:
        """The next ones, if any are left."""
        if self.left:
            band = self._bands[len(self._parts)]
            solve = _three_diagonals if self.span.stiffness == 0.0 else _sparse
            self._parts.append(solve(self.span, self._mass, self._first, band))

    def found(self) -> LateralModes:
        """All of them, with what is left of the search."""
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
    """How many modes a string of this tension has below a frequency: 2·f·∫√(m/T) ds."""
    return float(2.0 * frequency_hz * (np.sqrt(span.mass / span.tension) * np.diff(span.s)).sum())


def _three_diagonals(
    span: Span, mass: Floats, first: int, band: tuple[float, float]
) -> tuple[Floats, Floats]:
    """Squares of the frequencies in a band [rad²/s²] and vectors of the mass-normal problem."""
    k = span.tension / np.diff(span.s)
    own = k[first:].copy()
    own[1 - first :] += k[: len(k) - 1]
    own /= mass
    between = -k[first:-1] / np.sqrt(mass[1:] * mass[:-1])
    low, high = np.sqrt(np.maximum(band, 0.0))
    expected = ceil(modes_below(span, float(high - low) / (2.0 * pi)))
    shifts = np.linspace(low, high, APART * expected + 1) ** 2
    shifts[[0, -1]] = band
    counts = count_below(own, between, shifts)
    return find_eigenpairs(own, between, shifts, counts, np.arange(counts[0], counts[-1]))


def _sparse(
    span: Span, mass: Floats, first: int, band: tuple[float, float]
) -> tuple[Floats, Floats]:
    """The same with bending: as many as a string has there, which bending only makes fewer.

    Those nearest to the middle of the band, or from the lowest up, until some are beyond it.
    """
    from scipy.sparse import diags_array
    from scipy.sparse.linalg import eigsh

    root, (low, top) = diags_array(1.0 / np.sqrt(mass)), band
    K = (root @ stiffness(span)[first:-1, first:-1] @ root).tocsc()
    edges = np.sqrt([max(low, 0.0), top])
    middle = 0.0 if low < 0.0 else float(edges.mean()) ** 2
    wanted = ceil(modes_below(span, float(np.diff(edges)[0]) / (2.0 * pi)))
    wanted += SPARE if low < 0.0 else 2 * SPARE
    start = np.random.default_rng(1).standard_normal(len(mass))  # the same digits each time
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
    """Of tension and bending between all nodes, sparse."""
    from scipy.sparse import csr_array, diags_array

    n = len(span.tension)
    rest = np.diff(span.s)
    slope = diags_array([-1.0 / rest, 1.0 / rest], offsets=[0, 1], shape=(n, n + 1))
    curve = diags_array([-np.ones(n - 1), np.ones(n - 1)], offsets=[0, 1], shape=(n - 1, n)) @ slope
    per_node = diags_array(2.0 * span.stiffness / (rest[1:] + rest[:-1]))
    taut = slope.T @ diags_array(span.tension * rest) @ slope
    return csr_array(taut + curve.T @ per_node @ curve)
