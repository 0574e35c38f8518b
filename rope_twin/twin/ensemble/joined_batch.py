"""Batch of steps of an ensemble's multi-line members, whose systems are stepped in SIMD lanes.

Their twins prescribe the motion of the steps, the lanes do them, and the twins record the result. A
step that lanes give up is done for the system of that member alone. A member with many such steps
does the rest of the batch by itself. A member whose number of elements changes leaves the batch and
continues with members that have as many.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rope_twin.core.joined.joints import System
from rope_twin.core.lanes.joined_group import JoinedKind
from rope_twin.core.lanes.step import Run
from rope_twin.core.state import PULL_COLUMNS, STEPS_PER_CALL, Boundary, Floats
from rope_twin.core.step import advance_joined
from rope_twin.twin.ensemble.member import Scratch, TwinMember
from rope_twin.twin.regrid import is_slack

# A member that was stepped alone more often leaves the lanes.
MAX_ALONE_FRACTION, MIN_ALONE_STEPS = 0.2, 10


class JoinedBatch:
    """Batch of steps of members of one kind that have done equally many steps."""

    def __init__(self, members: Sequence[TwinMember], kind: JoinedKind, scratch: Scratch) -> None:
        self._all, self._kind, self._scratch = members, kind, scratch

    def run(self, steps: int, interval_steps: int) -> None:
        """Do this number of steps; a member may do fewer, or fail."""
        members, self._interval_steps = self._all, interval_steps
        self._before, self._step_s = members[0].steps, self._kind.ropes[0].step
        self._time = self._before * round(self._step_s * 1e9) * 1e-9
        self._opened = [member.open_steps(steps) for member in members]
        self._systems = [opened.system for opened in self._opened]
        steps = min(opened.steps for opened in self._opened)
        self._group = self._scratch.joined(self._kind, self._systems[0], STEPS_PER_CALL)
        boundaries = [
            Boundary(*(table[:, : steps + 1] for table in opened.boundary))
            for opened in self._opened
        ]
        self._group.begin(self._systems, boundaries)
        self._pulls: dict[int, Floats] = {}  # of members that are done, (ropes, done, ...)
        self._alone = [0] * len(members)  # steps done by itself
        self._slack = [0] * len(members)  # samplings in those that found slack
        self._failed: set[int] = set()
        self._running = set(range(len(members)))
        done = 0
        while self._running and done < steps:
            wanted = sum(1 << lane for lane in self._running)
            late = self._group.late(self._before + done)
            run = Run(self._time, done, steps, wanted, self._before, interval_steps, late)
            done, undone_lanes = self._group.advance(run)
            for lane in undone_lanes:
                self._step_alone(lane, done, steps)
        for lane in list(self._running):
            self._group.take(lane, self._systems[lane])
            self._leave(lane, done)
        for lane, (member, opened) in enumerate(zip(members, self._opened, strict=True)):
            health = opened.system.ropes[0].state.health
            counted, slack = self._group.account(lane, health)
            pulls = self._pulls[lane]
            done = pulls.shape[1]
            member.lane_steps += counted
            member.given_up += done - counted
            intervals = (self._before + done) // interval_steps - self._before // interval_steps
            member.count_slack(intervals, slack + self._slack[lane])
            member.close_steps(opened, pulls, done + (lane in self._failed))

    def _step_alone(self, lane: int, done: int, steps: int) -> None:
        """Do the last of `done` steps for one member's system."""
        system, group = self._systems[lane], self._group
        group.take(lane, system)
        self._alone[lane] += 1
        done_alone = self._advance(lane, system, done - 1, 1)
        too_often = self._alone[lane] > MIN_ALONE_STEPS + MAX_ALONE_FRACTION * done
        changed = any(
            int(rope.state.counts[0]) != kind.elements
            for rope, kind in zip(system.ropes, self._kind.ropes, strict=True)
        )
        if not done_alone:
            self._failed.add(lane)
            self._leave(lane, done - 1)
        elif changed:
            self._leave(lane, done)
        elif too_often:
            done_alone = self._advance(lane, system, done, steps - done)
            if done_alone < steps - done:
                self._failed.add(lane)
            self._leave(lane, done + done_alone)
        else:
            group.put(lane, system)

    def _leave(self, lane: int, done: int) -> None:
        """Store the result of a member that takes no further step in lanes."""
        self._running.discard(lane)
        self._pulls[lane] = self._group.pulls[:, :done, :, lane].copy()

    def _advance(self, lane: int, system: System, first: int, steps: int) -> int:
        """Do steps of one system from step `first` on, with sampling; return how many were done."""
        at, end, interval_steps = first, first + steps, self._interval_steps
        while at < end:
            count = min(end - at, interval_steps - (self._before + at) % interval_steps)
            rows = slice(at, at + count + 1)
            boundary = Boundary(*(table[:, rows].copy() for table in self._opened[lane].boundary))
            pull: Floats = np.zeros((len(system.ropes), count, PULL_COLUMNS))
            done = advance_joined(system, boundary, pull, self._time + at * self._step_s, count)
            self._group.pulls[:, at : at + count, :, lane] = pull
            at += done
            if done < count:
                break
            if (self._before + at) % interval_steps == 0:
                self._slack[lane] += is_slack(system.ropes)
        return at - first
