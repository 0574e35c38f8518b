"""Stretch of time over which all members of a fleet are stepped.

Members of one kind share the lanes, where their states stay for the whole stretch; the compiled
code is called for a millisecond or two at a time, without the interpreter's lock. A step that a
lane cannot do (core/lanes/step) is done by the member alone. When elements are added or removed the
member leaves its group and goes on in one of its new kind; members with the same line out do so at
the same step. A member that needs many steps alone steps alone to the end of the stretch.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.jit.wide import LANES
from rope_twin.core.lanes.step import FOLDS, LEAST, Run
from rope_twin.core.state import Boundary, Floats, Ints
from rope_twin.twin.ensemble.fleet_members import Scratch
from rope_twin.twin.recovery import step_failure

if TYPE_CHECKING:
    from rope_twin.twin.ensemble.fleet_ropes import RopeMembers
    from rope_twin.twin.ensemble.fleet_systems import SystemMembers

STRETCH_STEPS = 1200  # at most: a minute of 50 ms
CALL_NODES = 16_000  # nodes times steps of a call of the lanes, 1 to 2 ms
# Fraction and minimum number of steps done alone to leave a group: such a step costs about twice as
# much as one of a member that steps alone throughout, and all others of it are nearly free.
OFTEN, OFTEN_LEAST = 0.5, 10


class Record:
    """Results of a call: top tension of each step, and the folds of each look."""

    def __init__(self, lead: tuple[int, ...], steps: int, looks: int, members: int) -> None:
        """Allocate results; lead: axes before those of a rope."""
        self.top: Floats = np.full((*lead, steps, members), np.nan)
        self.folds: Floats = np.full((*lead, looks, FOLDS, members), np.nan)
        self.folds[..., LEAST, :] = np.inf
        self._failed: list[tuple[int, int, int]] = []

    def fail(self, step: int, look: int, member: int) -> None:
        """Note the step and the look that a member failed to do."""
        self._failed.append((step, look, member))

    def close(self) -> None:
        """Make the values of members NaN from the step on that they failed to do."""
        for step, look, member in self._failed:
            self.top[..., step:, member] = np.nan
            self.folds[..., look:, :, member] = np.nan
        least = self.folds[..., LEAST, :]
        least[np.isinf(least)] = np.nan


class Stretch:
    """Steps of all members that have not failed."""

    def __init__(
        self,
        members: RopeMembers | SystemMembers,
        course: Any,
        record: Record,
        look_steps: int,
        span: tuple[int, int, int],
    ) -> None:
        """Take the members' `course`, and of the steps the first, their number, the time [ns].

        look_steps: number of steps of a look.
        """
        self._members, self._course, self._record = members, course, record
        self._first, self._steps, time_ns = span
        self._look_steps = look_steps
        self._steps_before = time_ns // round(members.step_s * 1e9)
        self._time_s = time_ns * 1e-9
        self._first_look = self._first // look_steps

    def groups(self) -> list[Ints]:
        """Return the members that have not failed, in groups to be stepped one after another.

        Members with the same line out at the end are neighbours: they pay out and haul in alike, so
        that elements are added and removed in all lanes of a group at once.
        """
        members = np.array(self._members.going, dtype=np.int64)
        line = self._course.line_out_m[self._first + self._steps]
        if line.ndim:
            members = members[np.argsort(line[members], kind="stable")]
        return list(self._members.alike(members))

    def run(self, members: Ints, own: Scratch) -> None:
        """Do all steps of members of one kind."""
        waiting = [(members, 0)]
        while waiting:
            some, done = waiting.pop()
            kind = self._members.kind_of(int(some[0]))
            if kind is None:
                self._alone(int(some[0]), done, own)
                continue
            for left, at in self._in_lanes(some, kind, done, own):
                waiting += [(part, at) for part in self._members.alike(left)]

    def _in_lanes(
        self, members: Ints, kind: Any, done: int, own: Scratch
    ) -> list[tuple[Ints, int]]:
        """Step members in lanes after `done` steps.

        Returns members whose elements changed, and after how many steps.
        """
        all_, look, began = self._members, self._look_steps, done
        group = self._loaded(members, kind, done, own)
        going = dict(enumerate(members.tolist()))
        alone = dict.fromkeys(going, 0)
        changed: dict[int, list[int]] = {}
        often: list[tuple[int, int]] = []
        some = max(1, CALL_NODES // (all_.nodes_of(kind) * LANES))
        while going and done < self._steps:
            wanted = sum(1 << lane for lane in going)
            end = min(done + some, self._steps)
            late = group.late(self._steps_before + done)
            run = Run(self._time_s, done, end, wanted, self._first, look, late)
            done, left = group.advance(run)
            for lane in left:
                member = going[lane]
                single = all_.alone(member)
                group.take(lane, single)
                if self._step_lane(group, lane, member, done - 1, own):
                    alone[lane] += 1
                    if all_.has_changed(member, kind):
                        changed.setdefault(done, []).append(member)
                    elif alone[lane] > OFTEN_LEAST + OFTEN * (done - began):
                        often.append((member, done))
                    else:
                        group.put(lane, single)
                        continue
                group.account(lane, all_.health_of(member))
                del going[lane]
        self._harvest(group, members, began)
        if going:
            all_.take(group, members, list(going))
        for member, at in often:
            self._alone(member, at, own)
        return [(np.array(left, dtype=np.int64), at) for at, left in changed.items()]

    def _loaded(self, members: Ints, kind: Any, done: int, own: Scratch) -> Any:
        """Return the arrays of a group with its members, and their motion after `done` steps."""
        looks = (self._first + self._steps - 1) // self._look_steps - self._first_look + 1
        group = own.group(self._members, kind, self._steps, looks)
        self._members.load(group, members)
        ahead = Boundary(*(table[..., done : self._steps + 1, :, :] for table in group.boundary))
        self._course.fill(ahead, members, self._first + done)
        self._members.place(ahead, members, kind)
        return group

    def _step_lane(self, group: Any, lane: int, member: int, step: int, own: Scratch) -> bool:
        """Do a step for one lane alone; return whether it went."""
        look = (self._first + step) // self._look_steps - self._first_look
        now = self._step(member, step, own)
        if now is None:
            return False
        group.pulls[..., step, :, lane] = own.pull[..., 0, :]
        now[..., LEAST] = np.minimum(now[..., LEAST], group.folds[..., look, LEAST, lane])
        group.folds[..., look, :, lane] = now
        return True

    def _harvest(self, group: Any, members: Ints, began: int) -> None:
        """Record the results of the lanes, after `began` steps of the stretch.

        Those of lanes that left are overwritten later.
        """
        record, look, count = self._record, self._look_steps, len(members)
        first, end = self._first + began, self._first + self._steps
        low, high = first // look, (end - 1) // look + 1
        own = group.folds[..., low - self._first_look : high - self._first_look, :, :count]
        pulls = group.pulls[..., began : self._steps, rows.PULL, :count]
        record.top[..., first:end, members] = pulls
        least = np.minimum(record.folds[..., low:high, LEAST, members], own[..., LEAST, :])
        record.folds[..., low:high, :, members] = own
        record.folds[..., low:high, LEAST, members] = least

    def _alone(self, member: int, done: int, own: Scratch) -> None:
        """Step a member by itself to the end of the stretch."""
        record = self._record
        for step in range(done, self._steps):
            now, at = self._step(member, step, own), self._first + step
            if now is None:
                return
            look = at // self._look_steps
            record.top[..., at, member] = own.pull[..., 0, rows.PULL]
            now[..., LEAST] = np.minimum(now[..., LEAST], record.folds[..., look, LEAST, member])
            record.folds[..., look, :, member] = now

    def _step(self, member: int, step: int, own: Scratch) -> Floats | None:
        """Do a step of one member by itself; return what a look folds, or None: it failed."""
        at, all_ = self._first + step, self._members
        time_s = self._time_s + step * all_.step_s
        now = all_.step(member, self._course, at, time_s, own)
        if now is None:
            all_.failures[member] = step_failure(self._steps_before + step + 1, time_s)
            self._record.fail(at, at // self._look_steps, member)
        return now
