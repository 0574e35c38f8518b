"""Shape and forces of a rope at rest, and Newton's method for its element forces.

**Forces and masses** are evaluated by the dynamic step itself. A step of 1e-15 s from zero velocity
leaves the positions unchanged and yields the acceleration a = A⁻¹·F of every node, with A its mass
including added mass. So F = A·a is the out-of-balance force of the shape for any effects, from the
compiled entry that the simulation uses too. Damping and stiffness enter A with the step and its
square, and are negligible.

**Shape.** For given loads f the balance S_i - S_{i-1} + f_i = 0 determines the element forces S_e,
except for the constant reaction at a fixed lower end, which follows from a convex problem. The
shape is the integral of the elements along their forces, x_{e+1} - x_e = l(|S_e|)·S_e/|S_e|.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from rope_twin.core.jit.decorators import jit_entry
from rope_twin.core.loads.balance import add_couplings
from rope_twin.core.loads.hooks import couples, have_active_sets
from rope_twin.core.state import (
    ACCELERATION,
    BLOCK,
    DIRECTION,
    ELEMENTS,
    FLOW,
    FORCE_MIN,
    LINE,
    LINK,
    MOTIONS,
    NODE_ROWS,
    POSITION,
    PULL_COLUMNS,
    REST,
    TENSION,
    VELOCITY,
    Boundary,
    Floats,
    Rope,
    Stage,
)
from rope_twin.core.step import advance

INSTANT = 1e-15  # s
PROBED_STRAIN = 1e-3
SMALL_STRAIN = 1e-4
# Indices of xx, xy, xz, yy, yz, zz in a 3×3 matrix.
SYMMETRIC = np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])


class Forces(NamedTuple):
    """Forces on a motionless shape of n elements; node n is the hang-off."""

    total: Floats  # out-of-balance force on the nodes below the hang-off [N], 0 where fixed; (3, n)
    load: Floats  # external part of it, without element tension [N]; (3, n)
    tension: Floats  # [N]; (n,)
    mass: Floats  # [kg], xx, xy, xz, yy, yz, zz; (6, n)


class Elastic(NamedTuple):
    """Linearised length of each element as a function of its tension: l = slack + T/stiffness."""

    slack: Floats  # [m]
    stiffness: Floats  # [N/m]


class Equilibrium(NamedTuple):
    """Result of a static solution."""

    found: bool
    residual_n: float  # largest residual force on a node; not finite if the forces are not
    tension_n: float  # largest tension
    left_m: float  # estimated position error: the last move times its convergence ratio
    rounds: int


class Couplings(NamedTuple):
    """Stiffness that effects add between a node and its next two neighbours [N/m]."""

    own: Floats  # of a node, xx, xy, xz, yy, yz, zz; (6, n)
    near: Floats  # c of the blocks c·I between node i and i + 1, (n,)
    far: Floats  # c of the blocks between node i and i + 2


@jit_entry
def _couple(effects: Any, work: Any, stage: Any, n: int) -> None:
    add_couplings(effects, work, stage, n)


class StillRope:
    """A rope at rest, for the evaluation of forces at given node positions."""

    def __init__(self, rope: Rope, L: float) -> None:
        """Prepare a copy of a rope with a fixed hang-off at paid-out length L [m]."""
        # one solve per stage, and no element splits or merges
        model = rope.model._replace(
            step=INSTANT, tolerance=np.inf, split_above=np.inf, merge_below=0.0
        )
        self._rope = rope._replace(model=model)
        self._pull = np.zeros((1, PULL_COLUMNS))
        self.first = int(rope.model.first_free)
        # nodes on either side that a node's load depends on
        self.reach = 2 if couples(map(type, rope.effects)) else 1
        self.n = int(rope.state.counts[ELEMENTS])
        s = rope.state.s[: self.n + 1].copy()
        s[-1] = L
        self.rest: Floats = np.diff(s)  # unstretched lengths [m], (n,)
        self.boundary = Boundary(np.zeros((2, MOTIONS)), np.zeros((2, MOTIONS)))
        self.boundary.value[:, :LINE] = self.place[:, -1]
        self.boundary.value[:, LINE] = L

    @property
    def place(self) -> Floats:
        """Return a view of the present positions of the nodes [m], (3, n + 1)."""
        return self._rope.state.nodes[POSITION : POSITION + 3, : self.n + 1]

    @property
    def flows(self) -> bool:
        """Return whether the water moved at the last evaluation of forces."""
        return bool(self._rope.work[FLOW : FLOW + 3, : self.n].any())

    @property
    def switches(self) -> bool:
        """Return whether an effect has an active set: tensions alone do not show equilibrium."""
        return have_active_sets(map(type, self._rope.effects))

    def rest_at(self, place: Floats) -> None:
        """Place the nodes there [m], with zero velocity, and reset the solver's counters."""
        self.place[:] = place
        self._rope.state.nodes[VELOCITY:NODE_ROWS] = 0.0
        self._rope.state.health[:] = 0

    def forces(self, position: Floats) -> Forces:
        """Return the forces at `position` [m], (3, n + 1); all NaN if any is not finite."""
        self.rest_at(position)
        nodes, work = self._rope.state.nodes, self._rope.work
        finite = advance(self._rope, self.boundary, self._pull, 0.0, 1) == 1
        a = nodes[ACCELERATION : ACCELERATION + 3, : self.n]
        mass = work[BLOCK : BLOCK + 6, : self.n].copy()
        total: Floats = np.einsum("kcn,cn->kn", mass[SYMMETRIC], a)
        tension = work[TENSION, : self.n].copy()
        pull = tension * work[DIRECTION : DIRECTION + 3, : self.n]
        load = total - pull
        load[:, 1:] += pull[:, :-1]
        total[:, : self.first] = 0.0
        if not finite:
            for result in (total, load, tension):
                result[:] = np.nan
        return Forces(total, load, tension, mass)

    def couplings(self) -> Couplings:
        """Return the couplings of the present shape; only for a rope whose `reach` is two nodes."""
        work, n = self._rope.work.copy(), self.n
        work[POSITION : POSITION + 3, : n + 1] = self.place
        work[REST, :n] = self.rest
        work[BLOCK : BLOCK + 6] = 0.0
        _couple(self._rope.effects, work, Stage(0.0, 1.0, 0.0, 0.0), n)  # p = 1: stiffness itself
        return Couplings(work[BLOCK : BLOCK + 6, :n], work[LINK, :n], work[LINK + 1, :n])

    def elastic(self, length: Floats | None = None) -> Elastic:
        """Return the linearised law at these lengths [m]; default: slightly stretched.

        It is evaluated on a straight rope, so that tables and sections need no code here.
        """
        if length is None:
            length = self.rest * (1.0 + PROBED_STRAIN)
        position = self.place.copy()
        less, more = (self._straight(length + k * SMALL_STRAIN * self.rest) for k in (0.0, 1.0))
        self.rest_at(position)
        stiffness = (more - less) / (SMALL_STRAIN * self.rest)
        return Elastic(length - less / stiffness, stiffness)

    def _straight(self, length: Floats) -> Floats:
        """Return the tension of elements of these lengths [N]."""
        position = np.repeat(self.place[:, -1:], self.n + 1, axis=1)
        position[2, :-1] -= np.cumsum(length[::-1])[::-1]
        return self.forces(position).tension


CLOSING, BLUNTER = 50, 10
CLOSURE_TOL = 4.0 * float(np.finfo(float).eps)
MIN_FRACTION = 1e-3  # fraction of a correction below which the line search fails
TENSION_TOL = 1e-7  # of the largest tension: tolerance of the residual force at a node
FORCE_TOL_N = 1e-6  # absolute tolerance, where tensions are tiny
ROUND_OFF = 4.0 * float(np.finfo(float).eps)  # of the positions, in an element's length
MAX_RATIO = 0.3  # fixed-point iteration continues while each round leaves less than this fraction
PERTURBATION = 1e-7  # of an element's length: displacement of a finite difference of the loads
TANGENT_TOL = 1e-6  # of the largest tension: deviation from the tangent at which it is refreshed
SMALL_PULL_N = 1e-6
NO_SPAN_M = 1e-9  # both ends coincide


def largest(vectors: Floats) -> float:
    """Return the largest magnitude of vectors (3, any)."""
    return float(np.sqrt((vectors * vectors).sum(axis=0).max()))


class Shape(NamedTuple):
    """Element forces, the resulting shape, and the forces there."""

    S: Floats  # (3, n)
    place: Floats  # (3, n + 1)
    forces: Forces
    miss: Floats  # residual S_i - S_{i-1} + f_i [N], (3, n), 0 where fixed

    @property
    def size(self) -> float:
        """Return the norm of the residual over all nodes [N]."""
        return float(np.sqrt((self.miss * self.miss).sum()))

    @property
    def residual(self) -> float:
        """Return the largest residual force on a node [N]."""
        return largest(self.forces.total)


def first_forces(still: StillRope, lower_end: Floats | None, load: Floats) -> Floats:
    """Return element forces that balance the loads; with two fixed ends, half of them at each."""
    below = np.cumsum(load, axis=1)
    if lower_end is None:
        return -below
    below -= load[:, :1]
    chord = still.place[:, -1] - lower_end
    pull = float(np.linalg.norm(below[:, -1])) + SMALL_PULL_N
    span = max(float(np.linalg.norm(chord)), NO_SPAN_M)
    return (0.5 * below[:, -1] + pull * chord / span)[:, None] - below


def element_forces(position: Floats, forces: Forces) -> Floats:
    """Return the element forces of a given shape: tension along each element."""
    span = np.diff(position, axis=1)
    length: Floats = np.sqrt((span * span).sum(axis=0)) + FORCE_MIN
    return forces.tension / length * span


def is_off(S: Floats, tension: Floats) -> bool:
    """Return whether tensions deviate from the linearised law, as with a stiffness table."""
    size = np.sqrt((S * S).sum(axis=0))
    return bool((np.abs(tension - size) > TANGENT_TOL * size.max()).any())


def refreshed(still: StillRope, law: Elastic, position: Floats) -> Elastic:
    """Return the elements' tangent law at `position`; slack elements keep the previous one."""
    length = np.sqrt((np.diff(position, axis=1) ** 2).sum(axis=0))
    new = still.elastic(np.maximum(length, still.rest))
    taut = new.stiffness > 0.0
    return Elastic(
        np.where(taut, new.slack, law.slack), np.where(taut, new.stiffness, law.stiffness)
    )


def _laid(still: StillRope, law: Elastic, S: Floats) -> Floats:
    """Return the node positions by integration of the elements along their forces."""
    size = np.sqrt((S * S).sum(axis=0)) + FORCE_MIN
    span = (law.slack / size + 1.0 / law.stiffness) * S
    top = still.place[:, -1:]
    return np.concatenate([(top - np.cumsum(span[:, ::-1], axis=1))[:, ::-1], top], axis=1)


def shape_of(still: StillRope, law: Elastic, lower_end: Floats | None, S: Floats) -> Shape:
    """Return the shape of these element forces; a fixed lower end adds the closing force."""
    if lower_end is not None:
        S = _closed(still, law, lower_end, S)
    position = _laid(still, law, S)
    if lower_end is not None:
        position[:, 0] = lower_end
    forces = still.forces(position)
    miss = forces.load + S
    miss[:, 1:] -= S[:, :-1]
    miss[:, : still.first] = 0.0
    return Shape(S, position, forces, miss)


def _closed(still: StillRope, law: Elastic, lower_end: Floats, S: Floats) -> Floats:
    """Return S plus the constant force that brings the lowest node to `lower_end`.

    Where the rope turns back sharply a force nearly vanishes and its direction jumps; the problem
    is then regularised by a force `blunt`, which is reduced by continuation.
    """
    chord = still.place[:, -1] - lower_end
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
    """Return the force that makes the elements span the chord: Newton's method on a convex problem.

    The gradient is the gap, the Hessian the compliance; `blunt` [N] regularises. Returns the force
    and whether the gap is closed to round-off.
    """
    tolerance = CLOSURE_TOL * float(law.slack.sum() + np.abs(chord).max())
    gap, compliance = _gap(law, chord, S + pull[:, None], blunt)
    for _ in range(CLOSING):
        if np.sqrt(gap @ gap) <= tolerance:
            return pull, True
        if not np.isfinite(compliance).all():
            return pull, False
        change = np.linalg.lstsq(compliance, gap, rcond=None)[0]  # singular where all are collinear
        slope, fraction = float(gap @ change), 1.0
        while True:
            trial = pull + fraction * change
            miss, softness = _gap(law, chord, S + trial[:, None], blunt)
            if float(miss @ change) >= -0.5 * slope:  # close to the minimum along the change
                break
            fraction *= 0.5
            if fraction < 1e-6:
                return pull, False
        pull, gap, compliance = trial, miss, softness
    return pull, bool(np.sqrt(gap @ gap) <= 1e3 * tolerance)


def _gap(law: Elastic, chord: Floats, S: Floats, blunt: float) -> tuple[Floats, Floats]:
    """Return chord less span of the elements under these forces [m], and compliance [m/N]."""
    size = np.sqrt((S * S).sum(axis=0) + blunt * blunt) + FORCE_MIN
    lateral = law.slack / size + 1.0 / law.stiffness
    along = S * (law.slack / size**3)
    return chord - S @ lateral, np.eye(3) * lateral.sum() - along @ S.T


def newton_change(still: StillRope, law: Elastic, shape: Shape) -> Floats:
    """Return Newton's change of S: (K - df/dx)·dx = residual, then dS = K·(dx above - dx below).

    K_e = (|S|/l)·(I - t·tᵀ) + stiffness·t·tᵀ, the inverse of the element's compliance.
    """

    size = np.sqrt((shape.S * shape.S).sum(axis=0)) + FORCE_MIN
    t = shape.S / size
    lateral = size / np.maximum(law.slack + size / law.stiffness, FORCE_MIN)
    K = (law.stiffness - lateral) * t[:, None] * t[None, :]
    K[range(3), range(3)] += lateral
    move = solve_blocks(still, K, -load_change(still, shape), shape.miss)
    return np.asarray(np.einsum("kce,ce->ke", K, np.diff(move, axis=1)))


def solve_blocks(still: StillRope, K: Floats, blocks: Floats, miss: Floats) -> Floats:
    """Solve for the displacements that remove the residual, (3, n + 1); 0 at the hang-off.

    K: stiffness of each element, (3, 3, n); blocks: derivatives of the loads, from `load_change`,
    to which K is added. The result is NaN if the matrix is singular.
    """
    from scipy.linalg import LinAlgError, solve_banded  # import is slower than a solution

    diagonal = still.reach
    blocks[diagonal] += K
    blocks[diagonal, :, :, 1:] += K[:, :, :-1]
    blocks[diagonal + 1] -= K
    blocks[diagonal - 1, :, :, 1:] -= K[:, :, :-1]
    if still.first:  # node 0 is fixed, whatever its column holds
        blocks[:, :, :, 0] = 0.0
        blocks[diagonal, range(3), range(3), 0] = 1.0
    band = 3 * diagonal + 2
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
    """Return a matrix of 3×3 blocks in LAPACK's banded storage.

    blocks[d, k, c, i]: row 3·i + k, column 3·(i + d - reach) + c; (2·reach + 1, 3, 3, n). Blocks
    beyond either end are ignored. Returns (2·band + 1, 3·n) with band = 3·reach + 2.
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
    """Return df_i/dx_j by finite differences, j from i - reach to i + reach.

    The shape is (2·reach + 1, 3, 3, n). Every third node is displaced at once, or every fifth where
    effects couple the next two nodes.
    """
    count = 2 * still.reach + 1
    change = np.zeros((count, 3, 3, still.n))
    i = np.arange(still.n)
    move = PERTURBATION * np.append(still.rest, still.rest[-1])
    for start in range(count):
        displaced = slice(start, still.n, count)
        d = (start - i + still.reach) % count  # the displaced neighbour of node i is i + d - reach
        neighbour = np.clip(i + d - still.reach, 0, still.n)
        for c in range(3):
            position = shape.place.copy()
            position[c, displaced] += move[displaced]
            load = still.forces(position).load
            change[d, :, c, i] = ((load - shape.forces.load) / move[neighbour]).T
    return change
