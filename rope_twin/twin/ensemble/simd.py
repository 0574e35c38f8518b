"""Batches of ensemble members whose ropes are stepped in SIMD lanes.

Each member gets bit-identical results to stepping alone, so the grouping does not matter. Rare
events (a step that is halved or needs a line search, an element that splits or merges) are computed
for the member alone; one with many of them leaves the group until the end of the batch.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from rope_twin.core.jit.wide import LANES
from rope_twin.core.lanes.group import Group, Kind
from rope_twin.core.lanes.step import FOLDS, LEAST, Run
from rope_twin.core.state import ELEMENTS, PULL_COLUMNS, TENSION, Boundary, Floats
from rope_twin.twin.ensemble.member import Batch, Member, Scratch
from rope_twin.twin.ensemble.twin_member import SteppedMember

MIN_GROUP = LANES // 2  # minimum members of a group: all lanes cost about as much as these alone
OFTEN, OFTEN_LEAST = 0.2, 10  # fraction and minimum number of steps done alone to leave


def sort_into_groups(
    members: Iterable[SteppedMember], abreast: int = LANES
) -> list[list[SteppedMember]]:
    """Return groups of at most `abreast` members of one kind; members of small groups are alone."""
    kinds: dict[Kind | None, list[SteppedMember]] = {}
    for member in members:
        kinds.setdefault(member.kind(), []).append(member)
    groups = []
    for kind, alike in kinds.items():
        for first in range(0, len(alike), abreast):
            some = alike[first : first + abreast]
            whole = kind is not None and len(some) >= MIN_GROUP
            groups += [some] if whole else [[member] for member in some]
    return groups


def compile_lanes(groups: Iterable[Sequence[SteppedMember]]) -> None:
    """Compile the SIMD step for groups of several members, if it is not compiled yet."""
    kinds = (some[0].kind() for some in groups if len(some) > 1)
    by_types = {kind.types: kind for kind in kinds if kind is not None}
    for kind in by_types.values():
        Group(kind, 0).advance(Run(0.0, 0, 0, 0, 0, 1, 0))  # no step at all


def advance_group(
    members: Sequence[SteppedMember], steps: int, look_steps: int, scratch: Scratch
) -> None:
    """Advance the members of a group by a batch of steps.

    Those whose elements change at the same step, as of ropes that are paid out alike, go on as a
    group of their new number of elements.
    """
    if len(members) == 1:
        members[0].advance(steps, look_steps, scratch)
        return
    waiting = [
        _Begun(one, one.open_batch(steps, scratch), 0) for one in members if isinstance(one, Member)
    ]
    while waiting:
        alike = [one for one in waiting if one.goes_with(waiting[0])]
        waiting = [one for one in waiting if not one.goes_with(waiting[0])]
        if alike[0].member.kind() is not None and len(alike) >= MIN_GROUP:
            waiting += _Turn(alike, look_steps, scratch).run()
        else:
            for member, batch, done in alike:
                member.given_up += steps - done
                member.go_on(batch, done, look_steps, scratch)


class _Begun(NamedTuple):
    """A member, and how many steps of a batch it has done."""

    member: Member
    batch: Batch
    done: int

    def goes_with(self, other: _Begun) -> bool:
        """Whether both can go on in one group."""
        return self.done == other.done and self.member.kind() == other.member.kind()


class _Turn:
    """The rest of a batch for members of one kind that have done as many of its steps."""

    def __init__(self, begun: Sequence[_Begun], look_steps: int, scratch: Scratch) -> None:
        kind = begun[0].member.kind()
        assert kind is not None
        self._look_steps, self._scratch = look_steps, scratch
        self._first, self._steps = begun[0].done, len(begun[0].batch.pulls)
        self._before = begun[0].member.steps - self._first
        self._time = self._before * round(kind.step * 1e9) * 1e-9
        self._batches = [one.batch for one in begun]
        self._group = scratch.group(kind)
        self._group.begin(
            [one.member.rope for one in begun], [one.boundary for one in self._batches]
        )
        # By lane, those still in the group.
        self._members = {lane: one.member for lane, one in enumerate(begun)}
        self._alone: dict[int, list[int]] = {lane: [] for lane in self._members}  # steps alone
        self._tension: dict[int, Floats] = {}  # by lane, after the last step alone
        self._left: list[_Begun] = []

    def run(self) -> list[_Begun]:
        """Do the steps; return the members that left with other elements, and where they are."""
        done = self._first
        while self._members and done < self._steps:
            wanted = sum(1 << lane for lane in self._members)
            late = self._group.late(self._before + done)
            run = Run(self._time, done, self._steps, wanted, self._before, self._look_steps, late)
            done, left = self._group.advance(run)
            for lane in left:
                self._step_alone(lane, done)
        for lane in list(self._members):
            self._leave(lane, done)
        return self._left

    def _step_alone(self, lane: int, done: int) -> None:
        """Do the last of `done` steps for the rope of one lane."""
        member, group, batch = self._members[lane], self._group, self._batches[lane]
        state, work = member.rope.state, self._scratch.work(member.work_shape)
        group.take(lane, member.rope)
        member.steps = self._before + done - 1
        boundary = Boundary(*(table[done - 1 : done + 1] for table in batch.boundary))
        alone = self._alone[lane]
        folds = None if batch.folds is None else np.zeros((1, FOLDS))
        one = Batch(boundary, np.zeros((1, PULL_COLUMNS)), folds)
        member.step(one, 0, 1, self._look_steps, work)
        self._tension[lane] = work[TENSION, : state.counts[ELEMENTS]].copy()
        if member.failure:
            self._leave(lane, done - 1)
            return
        alone.append(done)
        group.pulls[done - 1, :, lane] = one.pulls[0]
        if folds is not None:
            group.folds[done - 1, :, lane] = folds[0]
        often = len(alone) > OFTEN_LEAST + OFTEN * (done - self._first)
        if often or state.counts[ELEMENTS] != group.kind.elements:
            self._leave(lane, done, often)
        else:
            group.put(lane, member.rope)

    def _leave(self, lane: int, done: int, often: bool = False) -> None:
        """Take a rope out of the group after `done` steps.

        often: it was alone too often, and completes the batch so.
        """
        member, group, alone = self._members.pop(lane), self._group, self._alone[lane]
        batch, first = self._batches[lane], self._first
        if not member.failure and not (alone and alone[-1] == done):
            group.take(lane, member.rope)
            self._tension[lane] = group.tension(lane)
        steps, slack = group.account(lane, member.rope.state.health)
        if batch.folds is not None:
            batch.folds[first:done] = group.folds[first:done, :, lane]
            own = [step - 1 - first for step in alone if step <= done]
            slack = int((np.delete(batch.folds[first:done, LEAST], own) <= 0.0).sum())
        member.lane_steps += steps
        member.given_up += done - first - steps
        looks = [self._before + step for step in alone]
        whole = (self._before + done) // self._look_steps
        whole -= (self._before + first) // self._look_steps
        member.count_looks(whole - sum(at % self._look_steps == 0 for at in looks), slack)
        member.steps = self._before + done
        batch.pulls[first:done] = group.pulls[first:done, :, lane]
        if member.failure or done == self._steps:
            member.close(batch, done, self._tension[lane])
        elif often:
            member.given_up += self._steps - done
            member.go_on(batch, done, self._look_steps, self._scratch)
        else:
            self._left.append(_Begun(member, batch, done))
