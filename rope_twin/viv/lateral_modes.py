"""Natural modes of a rope across itself: M·ÿ + K·y = 0 with lumped masses.

K of the tension, which varies along the rope, and of bending, EI·|y''|² on three neighbouring nodes
with hinged ends ([LCD] eqs 1 and 2: Le Cunff and Durand 1999; Irvine 1981, ch. 3). Unlike
`studies.modes` it knows the rope as a line, not in three dimensions: fast enough to be asked again
while a twin runs. Without bending the matrix has three diagonals (LAPACK's MRRR, Dhillon and
Parlett 2004); with it, shift and invert at zero on the sparse one.
"""

from __future__ import annotations

from math import ceil, pi
from typing import Any, NamedTuple

import numpy as np

from rope_twin.errors import InputError, phrase
from rope_twin.viv.span import Floats, Span

SPARE = 4  # modes asked for beyond the number that a string without bending would have
MOST = 400  # modes of one rope


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
    if not (span.tension > 0.0).all():
        slack = int((span.tension <= 0.0).sum())
        what = f"{slack} of {len(span.tension)} elements are slack, so it has no modes"
        raise InputError(phrase("rope", what, "give it weight, tension or a payload"))
    expected = modes_below(span, highest_hz)
    if expected > MOST:
        what = f"about {expected:.0f} modes lie below {highest_hz:.3g} Hz"
        raise InputError(phrase("rope", what, f"at most {MOST} are taken; lower the current"))
    first = 1 if span.end_mass is None else 0
    mass = span.node_mass[first:-1]
    top = (2.0 * pi * highest_hz) ** 2
    solve = _three_diagonals if span.stiffness == 0.0 else _sparse
    squares, vectors = solve(span, mass, first, top)
    shape = np.zeros((len(span.s), len(squares)))
    shape[first:-1] = vectors / np.sqrt(mass)[:, None]
    largest = np.abs(shape).max(axis=0, initial=0.0)
    shape /= np.where(largest > 0.0, largest, 1.0) * np.where(shape[-2] < 0.0, -1.0, 1.0)
    return LateralModes(
        np.sqrt(np.maximum(squares, 0.0)) / (2.0 * pi), shape, span.node_mass @ shape**2
    )


def modes_below(span: Span, frequency_hz: float) -> float:
    """How many modes a string of this tension has below a frequency: 2·f·∫√(m/T) ds."""
    return float(2.0 * frequency_hz * (np.sqrt(span.mass / span.tension) * np.diff(span.s)).sum())


def _three_diagonals(span: Span, mass: Floats, first: int, top: float) -> tuple[Floats, Floats]:
    """Squares of the frequencies [rad²/s²] and vectors of the mass-normal problem."""
    from scipy.linalg import eigh_tridiagonal

    k = span.tension / np.diff(span.s)
    own = k[first:].copy()
    own[1 - first :] += k[: len(k) - 1]
    between = -k[first:-1] / np.sqrt(mass[1:] * mass[:-1])
    found: tuple[Floats, Floats] = eigh_tridiagonal(
        own / mass, between, select="v", select_range=(-1.0, top)
    )
    return found


def _sparse(span: Span, mass: Floats, first: int, top: float) -> tuple[Floats, Floats]:
    """The same with bending: as many as a string has, which bending only makes fewer."""
    from scipy.sparse import diags_array
    from scipy.sparse.linalg import eigsh

    root = diags_array(1.0 / np.sqrt(mass))
    K = (root @ stiffness(span)[first:-1, first:-1] @ root).tocsc()
    wanted = ceil(modes_below(span, np.sqrt(top) / (2.0 * pi))) + SPARE
    count = min(wanted, len(mass) - 2)
    start = np.random.default_rng(1).standard_normal(len(mass))  # the same digits each time
    squares, vectors = eigsh(K, k=count, sigma=0.0, which="LM", v0=start)
    order = np.argsort(squares)
    order = order[squares[order] <= top]
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
