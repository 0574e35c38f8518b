"""Forces and masses of a rope that lies still in a given shape, from the dynamic step itself.

One step of a femtosecond from rest moves nothing: what it finds is the acceleration a = A⁻¹·F of
every node, with A the mass that acts there, added mass included. So F = A·a is the unbalanced
force of the shape, whatever the effects are, through the one compiled entry that the twin needs
anyway. Damping and stiffness enter A with the step and its square: at 1e-15 s they are gone.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from rope_twin.core.acting.hooks import couples, switches
from rope_twin.core.acting.terms import add_couplings
from rope_twin.core.jit.decorators import jit_entry
from rope_twin.core.state import (
    ACCELERATION,
    BLOCK,
    DIRECTION,
    ELEMENTS,
    FLOW,
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
# Places of xx, xy, xz, yy, yz, zz in a 3×3 matrix.
SYMMETRIC = np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])


class Forces(NamedTuple):
    """What acts on a still shape of n elements; node n is the hang-off."""

    total: Floats  # unbalanced force on the nodes below the hang-off [N], 0 where held; (3, n)
    load: Floats  # of it, what the elements' tension does not bring [N]; (3, n)
    tension: Floats  # [N]; (n,)
    mass: Floats  # [kg], xx, xy, xz, yy, yz, zz; (6, n)


class Elastic(NamedTuple):
    """Length of each element over its tension, a tangent: l = slack + T/stiffness."""

    slack: Floats  # [m]
    stiffness: Floats  # [N/m]


class Equilibrium(NamedTuple):
    """How the search for rest ended."""

    found: bool
    residual_n: float  # largest force left on a node; not finite: neither are the forces
    tension_n: float  # largest tension
    left_m: float  # how far a node may still be from rest: the last move times its gain
    rounds: int


class Couplings(NamedTuple):
    """Stiffness that effects bring between nodes beyond their neighbours [N/m]."""

    own: Floats  # of a node, xx, xy, xz, yy, yz, zz; (6, n)
    near: Floats  # c of the blocks c·I between node i and i + 1, (n,)
    far: Floats  # and between i and i + 2


@jit_entry
def _couple(effects: Any, work: Any, stage: Any, n: int) -> None:
    add_couplings(effects, work, stage, n)


class StillRope:
    """A rope whose nodes can be put anywhere, to ask what would act on them."""

    def __init__(self, rope: Rope, L: float) -> None:
        """The hang-off stays where it is; L is the line out [m]."""
        # every stage takes one solve, and no element splits or merges
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
        """View of where the nodes are now [m], (3, n + 1)."""
        return self._rope.state.nodes[POSITION : POSITION + 3, : self.n + 1]

    @property
    def flows(self) -> bool:
        """Whether the water moved where the nodes last were asked for forces."""
        return bool(self._rope.work[FLOW : FLOW + 3, : self.n].any())

    @property
    def switches(self) -> bool:
        """Whether loads come and go with the place: tensions alone do not tell rest."""
        return switches(map(type, self._rope.effects))

    def rest_at(self, place: Floats) -> None:
        """Put the nodes there [m], without motion, and forget the solver's counts."""
        self.place[:] = place
        self._rope.state.nodes[VELOCITY:NODE_ROWS] = 0.0
        self._rope.state.health[:] = 0

    def forces(self, place: Floats) -> Forces:
        """What acts on the nodes at `place` [m], (3, n + 1); all NaN if a force is not finite."""
        self.rest_at(place)
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
        """Of the shape that the nodes are in; only for a rope whose `reach` is two nodes."""
        work, n = self._rope.work.copy(), self.n
        work[POSITION : POSITION + 3, : n + 1] = self.place
        work[REST, :n] = self.rest
        work[BLOCK : BLOCK + 6] = 0.0
        _couple(self._rope.effects, work, Stage(0.0, 1.0, 0.0, 0.0), n)  # p = 1: stiffness itself
        return Couplings(work[BLOCK : BLOCK + 6, :n], work[LINK, :n], work[LINK + 1, :n])

    def elastic(self, length: Floats | None = None) -> Elastic:
        """The elements' law about these lengths [m]; by default somewhat above the rest length.

        Read from a straight rope, so that tables and sections need no code here.
        """
        if length is None:
            length = self.rest * (1.0 + PROBED_STRAIN)
        place = self.place.copy()
        less, more = (self._straight(length + k * SMALL_STRAIN * self.rest) for k in (0.0, 1.0))
        self.rest_at(place)
        stiffness = (more - less) / (SMALL_STRAIN * self.rest)
        return Elastic(length - less / stiffness, stiffness)

    def _straight(self, length: Floats) -> Floats:
        """Tension of elements of these lengths [N]."""
        place = np.repeat(self.place[:, -1:], self.n + 1, axis=1)
        place[2, :-1] -= np.cumsum(length[::-1])[::-1]
        return self.forces(place).tension
