"""What a twin's ropes do that makes their error rough: slack, an event, a landing.

Of one rope, or of all ropes that meet: what one does is felt in all.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.bed import Grid, Plane, clearance
from rope_twin.core.body import state as at
from rope_twin.core.body.energy import pose_of, pulls_of
from rope_twin.core.body.parts import part_of
from rope_twin.core.body.state import LENGTH, Deck, RigidBody
from rope_twin.core.state import Rope

Bed = Plane | Grid

SOFTEST = 1e-9  # N/m, in place of a slack element's stiffness of 0
_PLACE = slice(rows.POSITION, rows.POSITION + 3)


def bed_below(rope: Rope) -> Bed | None:
    """The scene's seabed."""
    return next((effect for effect in rope.effects if isinstance(effect, Plane | Grid)), None)


def body_below(rope: Rope) -> RigidBody | None:
    """The scene's rigid body."""
    return next((effect for effect in rope.effects if isinstance(effect, RigidBody)), None)


def nodes_on(bed: Bed, rope: Rope) -> int:
    """How many of the nodes below the hang-off lie on the bed."""
    n = int(rope.state.counts[rows.ELEMENTS])
    return int(np.count_nonzero(clearance(bed, rope.state.nodes[_PLACE, :n]) <= 0.0))


def touches(bed: Bed, rope: Rope) -> bool:
    """The lower end stands on the bed."""
    return bool(clearance(bed, rope.state.nodes[_PLACE, :1])[0] <= 0.0)


def body_stands(body: RigidBody, bed: Bed | None) -> bool:
    """A corner of the body is on the bed or on its deck."""
    corners = pose_of(body).place(body.corners)
    if part_of(body, Deck) is not None and corners[:, 2].min() <= body.stage[at.DECK_Z]:
        return True
    return bed is not None and bool((clearance(bed, corners.T) <= 0.0).any())


def is_slack(ropes: Sequence[Rope]) -> bool:
    """An element of one of the ropes, or a leg of the body below the first, pulls nothing."""
    for rope in ropes:
        n = rope.state.counts[rows.ELEMENTS]
        if not rope.work[rows.TENSION, :n].min() > 0.0:
            return True
    body = body_below(ropes[0])
    if body is None:
        return False
    nodes = ropes[0].state.nodes
    speed = nodes[rows.VELOCITY : rows.VELOCITY + 3, 0]
    force, _, _ = pulls_of(body, nodes[_PLACE, 0], speed)
    legs = body.legs[:, LENGTH] > 0.0  # the others are pins, which push as well
    return bool((np.abs(force[legs]).max(axis=1, initial=0.0) <= 0.0).any())


def offset_pull_n(rope: Rope) -> float:
    """What the length offsets of events pull [N]: their sum times the whole rope's stiffness."""
    n = int(rope.state.counts[rows.ELEMENTS])
    yielding = 1.0 / np.maximum(rope.work[rows.STIFFNESS, :n], SOFTEST)
    return float(np.abs(rope.state.offset[:n]).sum() / yielding.sum())


class Sight:
    """Looks along the ropes from time to time, and remembers what it saw."""

    def __init__(self, ropes: Sequence[Rope], made_fast: Sequence[bool]) -> None:
        """made_fast: whether the lower end of each is held in place."""
        self.bed, self._body = bed_below(ropes[0]), body_below(ropes[0])
        self._made_fast = list(made_fast)
        self._elements = [_elements(rope) for rope in ropes]
        self._lying = 0 if self.bed is None else self._count_lying(self.bed, ropes)

    @property
    def has_ground(self) -> bool:
        """Whether there is anything to stand on."""
        return self.bed is not None or (
            self._body is not None and part_of(self._body, Deck) is not None
        )

    def event_pull_n(self, ropes: Sequence[Rope]) -> float | None:
        """What the events since the last look pull [N]; None where nothing split or merged."""
        pulls = []
        for r, rope in enumerate(ropes):
            count = _elements(rope)
            if count != self._elements[r]:
                self._elements[r] = count
                pulls.append(offset_pull_n(rope))
        return max(pulls, default=None)

    def stands(self, ropes: Sequence[Rope], bed: Bed | None) -> bool:
        """Whether what hangs on one of the ropes stands on something."""
        if self._body is not None:
            return body_stands(self._body, bed)
        if bed is None:
            return False
        ends = zip(ropes, self._made_fast, strict=True)
        return any(touches(bed, rope) for rope, fast in ends if not fast)

    def lays(self, ropes: Sequence[Rope], bed: Bed | None) -> bool:
        """Whether ropes that are made fast have laid a node down since the last look."""
        if bed is None or True not in self._made_fast:
            return False
        before, self._lying = self._lying, self._count_lying(bed, ropes)
        return self._lying > before

    def _count_lying(self, bed: Bed, ropes: Sequence[Rope]) -> int:
        """Nodes on the bed of the ropes that are made fast."""
        ends = zip(ropes, self._made_fast, strict=True)
        return sum(nodes_on(bed, rope) for rope, fast in ends if fast)


def _elements(rope: Rope) -> int:
    return int(rope.state.counts[rows.ELEMENTS])
