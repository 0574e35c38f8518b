"""Members of a fleet, and the stretch of time over which all of them are stepped.

The members' states are arrays with the members as the first axis. They are what the lanes are
filled from (`Group.begin_stacked`); a member that takes a step alone does it on views of them.

Members of one kind share the lanes, where their states stay for the whole stretch; the compiled
code is called for a millisecond or two at a time, without the interpreter's lock. A step that a
lane cannot do (core/lanes/step) is done by the member alone. When elements are added or removed the
member leaves its group and goes on in one of its new kind; members with the same line out do so at
the same step. A member that needs many steps alone steps alone to the end of the stretch.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.jit.wide import LANES
from rope_twin.core.lanes.group import Group, Kind, kind_of, why_alone
from rope_twin.core.lanes.step import FOLDS, LEAST, Run
from rope_twin.core.state import Boundary, Floats, Ints, Rope, State, columns_for, new_work
from rope_twin.core.step import advance
from rope_twin.twin.ensemble.member import fold_of
from rope_twin.twin.figures import FIGURES, scaled_rope, stacked_effects, stacked_sections
from rope_twin.twin.recovery import step_failure
from rope_twin.twin.regrid import has_state, own_copies

STRETCH_STEPS = 1200  # at most: a minute of 50 ms
CALL_NODES = 16_000  # nodes times steps of a call of the lanes, 1 to 2 ms
# Fraction and minimum number of steps done alone to leave a group: such a step costs about twice as
# much as one of a member that steps alone throughout, and all others of it are nearly free.
OFTEN, OFTEN_LEAST = 0.5, 10
KINDS_KEPT = 8  # element counts that a thread keeps arrays for


class FleetMembers:
    """Ropes of one scene and mesh."""

    def __init__(self, rope: Rope, count: int) -> None:
        """Begin with copies of a rope."""
        self.rope = rope  # with the scene's figures; its state is not in use
        self.count = count
        self.factors: dict[str, Floats] = {name: np.ones(count) for name in FIGURES}
        self.failures: dict[int, str] = {}  # members that failed, and why
        parts: Any = (np.repeat(part[None], count, 0) for part in rope.state)
        self.states = State(*parts)
        self.effects: list[tuple[Any, ...]] = []  # of each member; shared if they have no memory
        self.adopt(rope.effects)

    @property
    def remember(self) -> bool:
        """Whether effects have internal variables."""
        return any(has_state(effect) for effect in self.rope.effects)

    @property
    def going(self) -> list[int]:
        """Members that have not failed."""
        return [k for k in range(self.count) if k not in self.failures]

    @property
    def why_alone(self) -> str:
        """Reason why members do not step in lanes; "": they do."""
        return why_alone(self.rope)

    def adopt(self, effects: tuple[Any, ...]) -> None:
        """Take effects with other data for all members, and their internal variables."""
        self.rope = self.rope._replace(effects=effects)
        self.effects = [own_copies(effects) for _ in range(self.count)] if self.remember else []
        self.scale()

    def scale(self) -> None:
        """Apply the factors to the kernel data."""
        kind = kind_of(self.rope)
        sections = stacked_sections(self.rope.sections, self.factors)
        effects = stacked_effects(self.rope.effects, self.factors) if kind and kind.plain else ()
        self._kind, self._alone = kind, dict[int, Rope]()
        self.stack = self.rope._replace(state=self.states, sections=sections, effects=effects)

    def set_all(self, state: State) -> None:
        """Give all members one state."""
        for mine, part in zip(self.states, state, strict=True):
            mine[:] = part

    def state_of(self, member: int) -> State:
        """Return views of a member's state."""
        return State(*(part[member] for part in self.states))

    def effects_of(self, member: int) -> tuple[Any, ...]:
        """Return the effects that hold a member's internal variables."""
        return self.effects[member] if self.effects else self.rope.effects

    def alone(self, member: int) -> Rope:
        """Return a member's rope, which shares its state and internal variables with the fleet."""
        found = self._alone.get(member)
        if found is None:
            factors = {name: float(value[member]) for name, value in self.factors.items()}
            rope = scaled_rope(self.rope, factors, self.effects_of(member))
            found = self._alone[member] = rope._replace(state=self.state_of(member))
        return found

    def kind_of(self, member: int) -> Kind | None:
        """Return what members in lanes must share; None: the member steps alone."""
        if self._kind is None:
            return None
        elements = int(self.states.counts[member, rows.ELEMENTS])
        if not self._kind.place and elements > 1:
            return self._kind._replace(elements=elements)
        return kind_of(self.rope._replace(state=self.state_of(member)))

    def alike(self, members: Ints) -> Iterator[Ints]:
        """Yield groups of members of one kind, as many as there are lanes, or one alone."""
        kinds: dict[Kind | int, list[int]] = {}
        for k in members.tolist():
            kinds.setdefault(self.kind_of(k) or k, []).append(k)
        for some in kinds.values():
            for first in range(0, len(some), LANES):
                yield np.array(some[first : first + LANES], dtype=np.int64)


class Course(NamedTuple):
    """Boundary conditions at the step borders, (steps + 1,) or (steps + 1, members) each."""

    z_m: Floats  # height of the hang-off
    z_rate: Floats
    line_out_m: Floats
    line_speed: Floats
    look_steps: int  # number of steps of a look

    def fill(self, borders: Boundary, members: Ints, first: int) -> None:
        """Set heave and line out of lanes from border `first` on, (borders, MOTIONS, lanes)."""
        (value, rate), count = borders, len(members)
        part = slice(first, first + len(value))
        columns = (value, rows.Z), (rate, rows.Z), (value, rows.LINE), (rate, rows.LINE)
        for (table, column), given in zip(columns, self[:4], strict=True):
            own = given[part]
            table[:, column, :count] = own[:, members] if own.ndim > 1 else own[:, None]
            if count < table.shape[2]:
                table[:, column, count:] = table[:, column, :1]

    def set_border(self, borders: Boundary, member: int, first: int) -> None:
        """Set heave and line out of one member over the step from border `first`, (2, MOTIONS)."""
        (value, rate), part = borders, slice(first, first + 2)
        columns = (value, rows.Z), (rate, rows.Z), (value, rows.LINE), (rate, rows.LINE)
        for (table, column), given in zip(columns, self[:4], strict=True):
            table[:, column] = given[part, member] if given.ndim > 1 else given[part]


class Record:
    """Results of a call: top tension of each step, and the folds of each look."""

    def __init__(self, steps: int, looks: int, members: int) -> None:
        self.top: Floats = np.full((steps, members), np.nan)
        self.folds: Floats = np.full((looks, FOLDS, members), np.nan)
        self.folds[:, LEAST] = np.inf
        self._failed: list[tuple[int, int, int]] = []

    def fail(self, step: int, look: int, member: int) -> None:
        """Note the step and the look that a member failed to do."""
        self._failed.append((step, look, member))

    def close(self) -> None:
        """Make the values of members NaN from the step on that they failed to do."""
        for step, look, member in self._failed:
            self.top[step:, member] = np.nan
            self.folds[look:, :, member] = np.nan
        least = self.folds[:, LEAST]
        least[np.isinf(least)] = np.nan


class Scratch:
    """Scratch arrays of a thread."""

    def __init__(self, rope: Rope) -> None:
        self.work = new_work(columns_for(rope.state.s.shape[0]), rope.work.shape[0])
        self.borders = Boundary(np.zeros((2, rows.MOTIONS)), np.zeros((2, rows.MOTIONS)))
        self.pull: Floats = np.zeros((1, rows.PULL_COLUMNS))
        self._groups: dict[Kind, Group] = {}

    def group(self, kind: Kind, steps: int, looks: int) -> Group:
        """Return arrays for members of this kind in lanes."""
        found = self._groups.get(kind)
        if found is None or found.steps < steps or len(found.folds) < looks:
            if len(self._groups) >= KINDS_KEPT:
                self._groups.clear()
            found = self._groups[kind] = Group(kind, steps, looks)
        return found


class Stretch:
    """Steps of all members that have not failed."""

    def __init__(
        self,
        members: FleetMembers,
        course: Course,
        record: Record,
        first: int,
        steps: int,
        time_ns: int,
    ) -> None:
        """Take the first of the steps, their number, and the time before them [ns]."""
        self._members, self._course, self._record = members, course, record
        self._first, self._steps = first, steps
        self._step_ns = round(members.rope.model.step * 1e9)
        self._steps_before = time_ns // self._step_ns
        self._time_s = time_ns * 1e-9
        self._first_look = first // course.look_steps

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
        self, members: Ints, kind: Kind, done: int, own: Scratch
    ) -> list[tuple[Ints, int]]:
        """Step members in lanes after `done` steps.

        Returns members whose elements changed, and after how many steps.
        """
        all_, look, began = self._members, self._course.look_steps, done
        group = self._loaded(members, kind, done, own)
        going = dict(enumerate(members.tolist()))
        alone = dict.fromkeys(going, 0)
        changed: dict[int, list[int]] = {}
        often: list[tuple[int, int]] = []
        some = max(1, CALL_NODES // (kind.elements * len(group.folds.T)))
        while going and done < self._steps:
            wanted = sum(1 << lane for lane in going)
            end = min(done + some, self._steps)
            late = group.late(self._steps_before + done)
            run = Run(self._time_s, done, end, wanted, self._first, look, late)
            done, left = group.advance(run)
            for lane in left:
                member = going[lane]
                rope = all_.alone(member)
                state = rope.state
                group.take(lane, rope)
                if self._step_lane(group, lane, member, done - 1, own):
                    alone[lane] += 1
                    if state.counts[rows.ELEMENTS] != kind.elements:
                        changed.setdefault(done, []).append(member)
                    elif alone[lane] > OFTEN_LEAST + OFTEN * (done - began):
                        often.append((member, done))
                    else:
                        group.put(lane, rope)
                        continue
                group.account(lane, state.health)
                del going[lane]
        self._harvest(group, members, began)
        if going:
            self._take(group, members, list(going))
        for member, at in often:
            self._alone(member, at, own)
        return [(np.array(left, dtype=np.int64), at) for at, left in changed.items()]

    def _loaded(self, members: Ints, kind: Kind, done: int, own: Scratch) -> Group:
        """Return the arrays of a group with its members, and their motion after `done` steps."""
        looks = (self._first + self._steps - 1) // self._course.look_steps - self._first_look + 1
        group = own.group(kind, self._steps, looks)
        if kind.plain:
            group.begin_stacked(self._members.stack, members)
        else:
            group.load([self._members.alone(k) for k in members.tolist()])
        ahead = Boundary(*(table[done : self._steps + 1] for table in group.boundary))
        self._course.fill(ahead, members, self._first + done)
        nodes = self._members.states.nodes[members, : rows.Z, kind.elements].T  # stays aside there
        ahead.value[:, : rows.Z, : len(members)] = nodes
        ahead.value[:, : rows.Z, len(members) :] = nodes[:, :1]
        return group

    def _take(self, group: Group, members: Ints, lanes: list[int]) -> None:
        """Copy the states of these lanes back to their members, with solver counts."""
        if group.kind.plain:
            chosen = np.array(lanes, dtype=np.int64)
            group.take_stacked(self._members.states, members[chosen], chosen)
            return
        for lane in lanes:
            rope = self._members.alone(int(members[lane]))
            group.take(lane, rope)
            group.account(lane, rope.state.health)

    def _step_lane(self, group: Group, lane: int, member: int, step: int, own: Scratch) -> bool:
        """Do a step for one lane alone; return whether it went."""
        look = (self._first + step) // self._course.look_steps - self._first_look
        now = self._step(member, step, own)
        if now is None:
            return False
        group.pulls[step, :, lane] = own.pull[0]
        now[LEAST] = min(now[LEAST], group.folds[look, LEAST, lane])
        group.folds[look, :, lane] = now
        return True

    def _harvest(self, group: Group, members: Ints, began: int) -> None:
        """Record the results of the lanes, after `began` steps of the stretch.

        Those of lanes that left are overwritten later.
        """
        record, look, count = self._record, self._course.look_steps, len(members)
        first, end = self._first + began, self._first + self._steps
        low, high = first // look, (end - 1) // look + 1
        own = group.folds[low - self._first_look : high - self._first_look, :, :count]
        record.top[first:end, members] = group.pulls[began : self._steps, rows.PULL, :count]
        least = np.minimum(record.folds[low:high, LEAST, members], own[:, LEAST])
        record.folds[low:high, :, members] = own
        record.folds[low:high, LEAST, members] = least

    def _alone(self, member: int, done: int, own: Scratch) -> None:
        """Step a member by itself to the end of the stretch."""
        record = self._record
        for step in range(done, self._steps):
            now, at = self._step(member, step, own), self._first + step
            if now is None:
                return
            look = at // self._course.look_steps
            record.top[at, member] = own.pull[0, rows.PULL]
            now[LEAST] = min(now[LEAST], record.folds[look, LEAST, member])
            record.folds[look, :, member] = now

    def _step(self, member: int, step: int, own: Scratch) -> Floats | None:
        """Do a step of one member by itself; return what a look folds, (FOLDS,), None: it failed.

        The force on the hang-off is in `own.pull`.
        """
        rope, borders = self._members.alone(member)._replace(work=own.work), own.borders
        state, at = rope.state, self._first + step
        n = int(state.counts[rows.ELEMENTS])
        self._course.set_border(borders, member, at)
        borders.value[:, : rows.Z] = state.nodes[: rows.Z, n]
        time_s = self._time_s + step * rope.model.step
        if advance(rope, borders, own.pull, time_s, 1) < 1:
            self._members.failures[member] = step_failure(self._steps_before + step + 1, time_s)
            self._record.fail(at, at // self._course.look_steps, member)
            return None
        return fold_of(rope, own.work[rows.TENSION, : int(state.counts[rows.ELEMENTS])])
