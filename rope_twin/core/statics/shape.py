"""The shape that element forces make of a rope, and how to better them.

For given loads f the balance S_i - S_{i-1} + f_i = 0 fixes the forces S_e that the elements pass
on; a fixed lower end leaves three numbers, which close the chain (a convex problem). The shape
follows by laying the elements along their forces, x_{e+1} - x_e = l(|S_e|)·S_e/|S_e|.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rope_twin.core.guards import SMALLEST
from rope_twin.core.state import Floats
from rope_twin.core.statics.forces import Elastic, Forces, StillRope

CLOSING, BLUNTER = 50, 10
CLOSED = 4.0 * float(np.finfo(float).eps)
STUCK = 1e-3  # share of a correction below which it leads nowhere
PERTURBATION = 1e-7  # of an element's length: a node's move that shows how the loads change
OFF = 1e-6  # of the largest tension: one this far from the tangent asks for a new one
SMALL_PULL_N = 1e-6
NO_SPAN_M = 1e-9  # both ends in one place


def largest(vectors: Floats) -> float:
    """Length of the longest of vectors, (3, any)."""
    return float(np.sqrt((vectors * vectors).sum(axis=0).max()))


class Shape(NamedTuple):
    """Element forces, the shape that they make, and what acts there."""

    S: Floats  # (3, n)
    place: Floats  # (3, n + 1)
    forces: Forces
    miss: Floats  # S_i - S_{i-1} + f_i [N], (3, n), 0 where held

    @property
    def size(self) -> float:
        """Of the miss, all nodes together [N]."""
        return float(np.sqrt((self.miss * self.miss).sum()))

    @property
    def residual(self) -> float:
        """Largest force left on a node [N]."""
        return largest(self.forces.total)


def first_forces(still: StillRope, hold: Floats | None, load: Floats) -> Floats:
    """Element forces that balance the loads; along the chord and by halves if both ends hold."""
    below = np.cumsum(load, axis=1)
    if hold is None:
        return -below
    below -= load[:, :1]
    chord = still.place[:, -1] - hold
    pull = float(np.linalg.norm(below[:, -1])) + SMALL_PULL_N
    span = max(float(np.linalg.norm(chord)), NO_SPAN_M)
    return (0.5 * below[:, -1] + pull * chord / span)[:, None] - below


def element_forces(place: Floats, forces: Forces) -> Floats:
    """What the elements of a shape pass on as they are: their tension along them."""
    span = np.diff(place, axis=1)
    length: Floats = np.sqrt((span * span).sum(axis=0)) + SMALLEST
    return forces.tension / length * span


def is_off(S: Floats, tension: Floats) -> bool:
    """Whether tensions are others than the law said: it is a tangent, the rope may have a table."""
    size = np.sqrt((S * S).sum(axis=0))
    return bool((np.abs(tension - size) > OFF * size.max()).any())


def refreshed(still: StillRope, law: Elastic, place: Floats) -> Elastic:
    """The elements' tangent at their lengths there; that of before where they are slack."""
    length = np.sqrt((np.diff(place, axis=1) ** 2).sum(axis=0))
    new = still.elastic(np.maximum(length, still.rest))
    taut = new.stiffness > 0.0
    return Elastic(
        np.where(taut, new.slack, law.slack), np.where(taut, new.stiffness, law.stiffness)
    )


def _laid(still: StillRope, law: Elastic, S: Floats) -> Floats:
    """Nodes where the elements lie along their forces."""
    size = np.sqrt((S * S).sum(axis=0)) + SMALLEST
    span = (law.slack / size + 1.0 / law.stiffness) * S
    top = still.place[:, -1:]
    return np.concatenate([(top - np.cumsum(span[:, ::-1], axis=1))[:, ::-1], top], axis=1)


def shape_of(still: StillRope, law: Elastic, hold: Floats | None, S: Floats) -> Shape:
    """The shape of these element forces; a fixed lower end adds the pull that closes the chain."""
    if hold is not None:
        S = _closed(still, law, hold, S)
    place = _laid(still, law, S)
    if hold is not None:
        place[:, 0] = hold
    forces = still.forces(place)
    miss = forces.load + S
    miss[:, 1:] -= S[:, :-1]
    miss[:, : still.first] = 0.0
    return Shape(S, place, forces, miss)


def _closed(still: StillRope, law: Elastic, hold: Floats, S: Floats) -> Floats:
    """S plus the one pull that brings the lowest node to `hold`.

    Where the rope turns back sharply a force nearly vanishes and its direction leaps; then larger
    forces that blunt the corner, and ever smaller ones, lead there.
    """
    chord = still.place[:, -1] - hold
    pull, closed = _pull(law, chord, S, np.zeros(3), 0.0)
    if closed:
        return S + pull[:, None]
    blunt, pull = largest(S - S.mean(axis=1)[:, None]), np.zeros(3)
    for _ in range(BLUNTER):
        pull, _ = _pull(law, chord, S, pull, blunt)
        blunt *= 0.1
    pull, _ = _pull(law, chord, S, pull, 0.0)
    return S + pull[:, None]


def _pull(
    law: Elastic, chord: Floats, S: Floats, pull: Floats, blunt: float
) -> tuple[Floats, bool]:
    """The pull that makes the elements span the chord: Newton on a convex problem.

    Its gradient is the gap, its curvature the compliance; `blunt` [N] rounds the corners. Returns
    the pull and whether the gap is closed to round-off.
    """
    small = CLOSED * float(law.slack.sum() + np.abs(chord).max())
    gap, compliance = _gap(law, chord, S + pull[:, None], blunt)
    for _ in range(CLOSING):
        if np.sqrt(gap @ gap) <= small:
            return pull, True
        if not np.isfinite(compliance).all():
            return pull, False
        change = np.linalg.lstsq(compliance, gap, rcond=None)[0]  # singular where all lie in line
        slope, share = float(gap @ change), 1.0
        while True:
            trial = pull + share * change
            miss, softness = _gap(law, chord, S + trial[:, None], blunt)
            if float(miss @ change) >= -0.5 * slope:  # not far beyond the minimum along it
                break
            share *= 0.5
            if share < 1e-6:
                return pull, False
        pull, gap, compliance = trial, miss, softness
    return pull, bool(np.sqrt(gap @ gap) <= 1e3 * small)


def _gap(law: Elastic, chord: Floats, S: Floats, blunt: float) -> tuple[Floats, Floats]:
    """Chord less what elements under these forces span [m], and its compliance [m/N]."""
    size = np.sqrt((S * S).sum(axis=0) + blunt * blunt) + SMALLEST
    lateral = law.slack / size + 1.0 / law.stiffness
    along = S * (law.slack / size**3)
    return chord - S @ lateral, np.eye(3) * lateral.sum() - along @ S.T


def newton_change(still: StillRope, law: Elastic, shape: Shape) -> Floats:
    """Newton's change of S: (K - df/dx)·dx = miss for the nodes, then dS = K·(dx above - below).

    K_e = (|S|/l)·(I - t·tᵀ) + stiffness·t·tᵀ, the inverse of the element's compliance.
    """

    size = np.sqrt((shape.S * shape.S).sum(axis=0)) + SMALLEST
    t = shape.S / size
    lateral = size / np.maximum(law.slack + size / law.stiffness, SMALLEST)
    K = (law.stiffness - lateral) * t[:, None] * t[None, :]
    K[range(3), range(3)] += lateral
    move = solve_blocks(still, K, -load_change(still, shape), shape.miss)
    return np.asarray(np.einsum("kce,ce->ke", K, np.diff(move, axis=1)))


def solve_blocks(still: StillRope, K: Floats, blocks: Floats, miss: Floats) -> Floats:
    """The moves of all nodes that make up for the miss, (3, n + 1); the hang-off's are 0.

    K: stiffness of each element, (3, 3, n); blocks: that of the loads, as `load_change` has it, to
    which K is added. Not finite: the equations have no solution.
    """
    from scipy.linalg import LinAlgError, solve_banded  # takes longer to load than ropes to settle

    own = still.reach
    blocks[own] += K
    blocks[own, :, :, 1:] += K[:, :, :-1]
    blocks[own + 1] -= K
    blocks[own - 1, :, :, 1:] -= K[:, :, :-1]
    if still.first:  # node 0 stays, whatever its column says
        blocks[:, :, :, 0] = 0.0
        blocks[own, range(3), range(3), 0] = 1.0
    band = 3 * own + 2
    move = np.zeros((3, still.n + 1))
    try:
        solved = solve_banded(
            (band, band), banded(blocks), miss.T.ravel(), overwrite_ab=True, check_finite=False
        )
    except LinAlgError:
        solved = np.full(3 * still.n, np.nan)
    move[:, :-1] = solved.reshape(still.n, 3).T
    return move


def banded(blocks: Floats) -> Floats:
    """Diagonals of a matrix of 3×3 blocks, as LAPACK's banded solvers take them.

    blocks[d, k, c, i]: row 3·i + k, column 3·(i + d - reach) + c; (2·reach + 1, 3, 3, n). Blocks
    beyond either end are left out. Returns (2·band + 1, 3·n) with band = 3·reach + 2.
    """
    reach, n = len(blocks) // 2, blocks.shape[3]
    band = 3 * reach + 2
    diagonals = np.zeros((2 * band + 1, 3 * n))
    for d in range(len(blocks)):
        low, high = max(0, reach - d), n - max(0, d - reach)
        for k in range(3):
            for c in range(3):
                row = band + k - c - 3 * (d - reach)
                diagonals[row, c::3][low + d - reach : high + d - reach] = blocks[d, k, c, low:high]
    return diagonals


def load_change(still: StillRope, shape: Shape) -> Floats:
    """df_i/dx_j for j from i - reach to i + reach, (2·reach + 1, 3, 3, n).

    By moving every third node at once, or every fifth where effects reach two nodes far.
    """
    count = 2 * still.reach + 1
    change = np.zeros((count, 3, 3, still.n))
    i = np.arange(still.n)
    move = PERTURBATION * np.append(still.rest, still.rest[-1])
    for start in range(count):
        moved = slice(start, still.n, count)
        d = (start - i + still.reach) % count  # node i's neighbour that moves is i + d - reach
        at = np.clip(i + d - still.reach, 0, still.n)
        for c in range(3):
            place = shape.place.copy()
            place[c, moved] += move[moved]
            load = still.forces(place).load
            change[d, :, c, i] = ((load - shape.forces.load) / move[at]).T
    return change
