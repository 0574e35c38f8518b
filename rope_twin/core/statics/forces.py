"""Forces and masses of a motionless rope in a given shape, evaluated by the dynamic step itself.

One step of a femtosecond from zero velocity moves nothing: it yields the acceleration a = A⁻¹·F of
every node, with A the mass that acts there, including added mass. So F = A·a is the out-of-balance
force of the shape, for any effects, through the one compiled entry that the twin needs anyway.
Damping and stiffness enter A with the step and its square: at 1e-15 s they vanish.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from rope_twin.core.jit.decorators import jit_entry
from rope_twin.core.loads.balance import add_couplings
from rope_twin.core.loads.hooks import couples, switches
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
# Indices of xx, xy, xz, yy, yz, zz in a 3×3 matrix.
SYMMETRIC = np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])


class Forces(NamedTuple):
    """Forces on a motionless shape of n elements; node n is the hang-off."""

    total: Floats  # out-of-balance force on the nodes below the hang-off [N], 0 where fixed; (3, n)
    load: Floats  # external part of it, without element tension [N]; (3, n)
    tension: Floats  # [N]; (n,)
    mass: Floats  # [kg], xx, xy, xz, yy, yz, zz; (6, n)


class Elastic(NamedTuple):
    """Linearised length of each element over its tension: l = slack + T/stiffness."""

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
    """A motionless rope whose nodes can be placed anywhere, to evaluate the forces there."""

    def __init__(self, rope: Rope, L: float) -> None:
        """Copy a rope; its hang-off stays where it is; L is the paid-out length [m]."""
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
        return switches(map(type, self._rope.effects))

    def rest_at(self, place: Floats) -> None:
        """Place the nodes there [m], with zero velocity, and reset the solver's counters."""
        self.place[:] = place
        self._rope.state.nodes[VELOCITY:NODE_ROWS] = 0.0
        self._rope.state.health[:] = 0

    def forces(self, place: Floats) -> Forces:
        """Return the forces at `place` [m], (3, n + 1); all NaN if one is not finite."""
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
        place = self.place.copy()
        less, more = (self._straight(length + k * SMALL_STRAIN * self.rest) for k in (0.0, 1.0))
        self.rest_at(place)
        stiffness = (more - less) / (SMALL_STRAIN * self.rest)
        return Elastic(length - less / stiffness, stiffness)

    def _straight(self, length: Floats) -> Floats:
        """Return the tension of elements of these lengths [N]."""
        place = np.repeat(self.place[:, -1:], self.n + 1, axis=1)
        place[2, :-1] -= np.cumsum(length[::-1])[::-1]
        return self.forces(place).tension
