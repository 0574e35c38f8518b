"""Detection of events that make a rope's error of first order: slack, split or merge, landing.

It covers a single rope, or all ropes of a multi-line system: an event in one affects all.
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
    """Return the scene's seabed; None if it lists none."""
    return next((effect for effect in rope.effects if isinstance(effect, Plane | Grid)), None)


def body_below(rope: Rope) -> RigidBody | None:
    """Return the scene's rigid body; None if it lists none."""
    return next((effect for effect in rope.effects if isinstance(effect, RigidBody)), None)


def nodes_on(bed: Bed, rope: Rope) -> int:
    """Return the number of nodes below the hang-off that lie on the bed."""
    n = int(rope.state.counts[rows.ELEMENTS])
    return int(np.count_nonzero(clearance(bed, rope.state.nodes[_PLACE, :n]) <= 0.0))


def touches(bed: Bed, rope: Rope) -> bool:
    """Return whether the lower end stands on the bed."""
    return bool(clearance(bed, rope.state.nodes[_PLACE, :1])[0] <= 0.0)


def is_slack(ropes: Sequence[Rope]) -> bool:
    """Return whether an element of one of the ropes is slack."""
    return any(
        not rope.work[rows.TENSION, : rope.state.counts[rows.ELEMENTS]].min() > 0.0
        for rope in ropes
    )


def offset_pull_n(rope: Rope) -> float:
    """Force of the length offsets of events [N]: their sum times the whole rope's stiffness."""
    n = int(rope.state.counts[rows.ELEMENTS])
    yielding = 1.0 / np.maximum(rope.work[rows.STIFFNESS, :n], SOFTEST)
    return float(np.abs(rope.state.offset[:n]).sum() / yielding.sum())


class EventDetector:
    """Event detector that samples the ropes and compares with the previous sample."""

    def __init__(self, ropes: Sequence[Rope], made_fast: Sequence[bool]) -> None:
        """Take the first sample; made_fast: whether the lower end of each rope is fixed."""
        self.bed, self._body = bed_below(ropes[0]), body_below(ropes[0])
        self._nodes = ropes[0].state.nodes
        self._made_fast = list(made_fast)
        self._elements = [_elements(rope) for rope in ropes]
        self._lying = 0 if self.bed is None else self._count_lying(self.bed, ropes)

    def slack_legs(self) -> list[bool]:
        """Return for each sling of the body below the first rope whether it is slack."""
        if self._body is None:
            return []
        speed = self._nodes[rows.VELOCITY : rows.VELOCITY + 3, 0]
        force, _, _ = pulls_of(self._body, self._nodes[_PLACE, 0], speed)
        legs = self._body.legs[:, LENGTH] > 0.0  # the others are pins, which also take compression
        slack: list[bool] = (np.abs(force[legs]).max(axis=1, initial=0.0) <= 0.0).tolist()
        return slack

    def unloaded(self) -> bool:
        """Return whether there are slings and all are slack: a slack rope then has no load."""
        legs = self.slack_legs()
        return bool(legs) and all(legs)

    def on_deck(self) -> bool:
        """Return whether a corner of the body is on its deck."""
        body = self._body
        if body is None or part_of(body, Deck) is None:
            return False
        lowest = pose_of(body).place(body.corners)[:, 2].min()
        return bool(lowest <= body.stage[at.DECK_Z])

    def event_pull_n(self, ropes: Sequence[Rope]) -> float | None:
        """Return the force of events since the last sample [N]; None if nothing split or merged."""
        pulls = []
        for r, rope in enumerate(ropes):
            count = _elements(rope)
            if count != self._elements[r]:
                self._elements[r] = count
                pulls.append(offset_pull_n(rope))
        return max(pulls, default=None)

    def stands(self, ropes: Sequence[Rope], bed: Bed | None) -> bool:
        """Return whether a load of one of the ropes stands on the bed."""
        if bed is None:
            return False
        if self._body is not None:
            corners = pose_of(self._body).place(self._body.corners)
            return bool((clearance(bed, corners.T) <= 0.0).any())
        ends = zip(ropes, self._made_fast, strict=True)
        return any(touches(bed, rope) for rope, fast in ends if not fast)

    def lays(self, ropes: Sequence[Rope], bed: Bed | None) -> bool:
        """Return whether fixed ropes have laid a node down since the last sample."""
        if bed is None or True not in self._made_fast:
            return False
        before, self._lying = self._lying, self._count_lying(bed, ropes)
        return self._lying > before

    def _count_lying(self, bed: Bed, ropes: Sequence[Rope]) -> int:
        """Return the number of nodes of the fixed ropes on the bed."""
        ends = zip(ropes, self._made_fast, strict=True)
        return sum(nodes_on(bed, rope) for rope, fast in ends if fast)


def _elements(rope: Rope) -> int:
    return int(rope.state.counts[rows.ELEMENTS])
