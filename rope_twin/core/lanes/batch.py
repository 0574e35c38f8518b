"""Steps of a SIMD batch: members in their lanes, and alone where the lanes give a step up.

A member is a single rope or a system of ropes. Its motion at the step boundaries and its results
are in tables of all lanes, whoever does a step: those that the kernel returns (core/lanes/step) are
done by the solver of a single member, which then returns to its lane. A member with many of them
does the rest alone. Where elements are added or removed the steps end for all, since members that
share the lanes have equally many: members with the same payout can then go on together.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from rope_twin.core.jit.decorators import compiled
from rope_twin.core.jit.wide import ALL, LANES
from rope_twin.core.joined.joints import System
from rope_twin.core.lanes.effects import (
    LaneData,
    aligned,
    is_by_lane,
    make_lane_data,
    put_lane_data,
    put_wide,
)
from rope_twin.core.lanes.step import (
    EAST,
    LOWEST_TENSION,
    MIN_TENSION,
    NORTH,
    PAYLOAD_DEPTH,
    PAYLOAD_DESCENT,
    SAMPLE_COLUMNS,
    SLACK_SAMPLES,
    TALLIES,
    Run,
    advance_lanes_steps,
)
from rope_twin.core.loads.balance import lone_middle
from rope_twin.core.loads.memory import carried_arrays, count_initialised, variable_count
from rope_twin.core.payout import TRIALS
from rope_twin.core.state import (
    ELEMENTS,
    END,
    LOWEST_OFFSET,
    MOTIONS,
    POSITION,
    PULL_COLUMNS,
    SECTION_ROWS,
    SOLVES,
    SOLVES_MAX,
    STEPS,
    SUBSTEPS,
    SUBSTEPS_MAX,
    TENSION,
    VELOCITY,
    WORK_ROWS,
    Boundary,
    Floats,
    Ints,
    Rope,
)
from rope_twin.core.step import advance, advance_joined

OWN_FIGURES = ("element_length", "split_above", "merge_below", "tolerance")  # of the Model
# Minimum number of steps done alone to leave the lanes, and their minimum fraction: one that is
# sampled costs about twice as much as if all were done alone, one of many in a row is cheaper.
MIN_ALONE_STEPS, ALONE_FRACTION, ALONE_FRACTION_SAMPLED = 10, 0.2, 0.5


def ropes_of(member: Rope | System) -> tuple[Rope, ...]:
    """Return the ropes of a member of a batch."""
    return (member,) if isinstance(member, Rope) else member.ropes


def sample_of(rope: Rope) -> Floats:
    """Return the sampled values of a rope, (SAMPLE_COLUMNS,).

    Minimum tension of all elements and tension of the lowest [N]; depth of the payload [m] and its
    speed downward [m/s], those of its middle if it is a rigid body; how far east and north of the
    upper end the lower one is [m].
    """
    state, sample = rope.state, np.empty(SAMPLE_COLUMNS)
    tension = rope.work[TENSION, : state.counts[ELEMENTS]]
    sample[MIN_TENSION], sample[LOWEST_TENSION] = tension.min(), tension[0]
    end = (float(state.nodes[row + 2, 0]) for row in (POSITION, VELOCITY))
    height, speed = lone_middle(rope.effects, *end)
    sample[PAYLOAD_DEPTH], sample[PAYLOAD_DESCENT] = -height, -speed
    x_y = state.nodes[POSITION : POSITION + 2]
    sample[[EAST, NORTH]] = x_y[:, 0] - x_y[:, state.counts[ELEMENTS]]
    return sample


def put_properties(arrays: Rope, lane: int, rope: Rope) -> None:
    """Copy a rope's properties into a lane, except for those of effects called lane by lane."""
    for name in OWN_FIGURES:
        getattr(arrays.model, name)[lane] = getattr(rope.model, name)
    arrays.sections[:, : rope.sections.shape[1], lane] = rope.sections
    for effect, source in zip(arrays.effects, rope.effects, strict=True):
        if not variable_count(type(source)):
            put_wide(effect, source, lane)
        elif not is_by_lane(type(source)):
            put_wide(effect[1:], source[1:], lane)
    if arrays.law is not None:
        put_wide(arrays.law, rope.law, lane)


def _state_arrays(arrays: Rope, lane: int, n: int, rope: Rope) -> Iterator[tuple[Any, Any]]:
    """Yield views of state, internal variables and tension of a lane, and those of its rope.

    n: number of elements.
    """
    for effect, source in zip(arrays.effects, rope.effects, strict=True):
        if variable_count(type(source)) and not is_by_lane(type(source)):
            for columns in (slice(n + 1), slice(-1 - TRIALS, None)):
                yield effect.memory[:, columns, lane], source.memory[:, columns]
            for name in carried_arrays(type(source)):
                yield getattr(effect, name)[..., lane], getattr(source, name)
    lanes, state = arrays.state, rope.state
    yield lanes.nodes[: n + 1, :, lane], state.nodes[:, : n + 1].T
    yield lanes.s[: n + 1, lane], state.s[: n + 1]
    yield lanes.offset[:n, lane], state.offset[:n]
    yield arrays.work[:n, TENSION, lane], rope.work[TENSION, :n]


class Progress(NamedTuple):
    """Steps done by the members of a batch, by lane."""

    done: int  # steps done in lanes
    running: list[int]  # lanes that did them; they have the states of their members
    left: dict[int, int]  # steps done by members that left their lanes, and have their states
    failed: set[int]  # lanes of those whose next state would not be finite
    alone: Counter[int]  # how many of the steps were done alone


class Lanes(ABC):
    """Base of a batch of up to LANES members, single ropes or systems of ropes."""

    kind: Any = None  # properties that the members have in common
    _arrays: Any  # `Rope` or `Joined` of all lanes
    _ropes: Sequence[Rope]  # views of it, rope by rope
    _each: Any = None  # data of each lane for kernels of a single rope
    _each_rope: Sequence[LaneData] = ()  # views of it, rope by rope
    _elements: Sequence[int]  # of each rope
    _loaded: Sequence[int]  # nodes that carry loads
    _types: tuple[type, ...]  # select the compiled code

    def __init__(self, lead: tuple[int, ...], steps: int, intervals: int) -> None:
        """Allocate tables of motion and results.

        lead: axes before those of a rope; steps: at most; intervals: rows of `samples`, the result
        in place of slack samples; 0 for none.
        """
        self.steps = steps
        border = (*lead, steps + 1, MOTIONS, LANES)
        self.boundary = Boundary(aligned(*border), aligned(*border))
        self.pulls = aligned(*lead, steps, PULL_COLUMNS, LANES)
        self.samples = aligned(*lead, intervals, SAMPLE_COLUMNS, LANES)
        self._lead = lead
        self._tally = aligned(TALLIES, LANES)
        self._lowest: Ints = np.zeros((*lead, LANES), np.int64)
        self._late = 0  # lanes whose internal variables must be interpolated, as bits
        self._held: list[Any] = [None] * LANES  # members whose properties the lanes have

    # Members

    def fit(self, kind: Any) -> None:
        """Take members of this kind, of the same layout; lanes keep their properties."""
        self.kind = kind

    @abstractmethod
    def _own(self, member: Any) -> Iterable[Rope]:
        """Return the ropes of a member with the effects and the law that lanes take."""

    def begin(self, members: Sequence[Any], boundaries: Sequence[Boundary]) -> None:
        """Copy in members of the group's kind, and their motion at the step boundaries.

        Unused lanes get a copy of the first member.
        """
        self.load(members)
        for lane in range(LANES):
            member = lane if lane < len(members) else 0
            for table, values in zip(self.boundary, boundaries[member], strict=True):
                table[..., : values.shape[-2], :, lane] = values

    def load(self, members: Sequence[Any], used: Collection[int] = range(LANES)) -> None:
        """Copy in members of the group's kind, and clear counters and samples.

        For a member that its lane already holds, and in unused lanes, only the state is copied.
        """
        self._clear()
        for lane in range(LANES):
            member, held = members[lane if lane < len(members) else 0], self._held[lane]
            if held is not member and (held is None or lane in used):
                self._put_properties(lane, member)
            self.put(lane, member)

    def _clear(self) -> None:
        self._tally[:] = 0.0
        self.samples[:] = 0.0
        self.samples[..., MIN_TENSION, :] = np.inf

    def _put_properties(self, lane: int, member: Any) -> None:
        """Copy a member's properties into a lane."""
        self._held[lane] = member
        for r, rope in enumerate(self._own(member)):
            put_properties(self._ropes[r], lane, rope)
            if self._each is not None:
                each = self._each_rope[r]
                put_lane_data(each.effects, rope.effects, lane)
                each.sections[lane, :, : rope.sections.shape[1]] = rope.sections
                each.tolerance[lane] = rope.model.tolerance

    def put(self, lane: int, member: Any) -> None:
        """Copy a member's state, internal variables and tensions into a lane."""
        late, lowest = 0, self._lowest.reshape(-1, LANES)
        for r, rope in enumerate(ropes_of(member)):
            for target, source in _state_arrays(self._ropes[r], lane, self._elements[r], rope):
                target[...] = source
            # also in unused lanes: all agree on the section of an element
            self._ropes[r].sections[END, : rope.sections.shape[1], lane] = rope.sections[END]
            lowest[r, lane] = rope.state.counts[LOWEST_OFFSET]
            for i, effect in enumerate(rope.effects):
                if variable_count(type(effect)):
                    late |= int(count_initialised(effect) != self._loaded[r])
                    if is_by_lane(type(effect)):
                        put_lane_data(self._each_rope[r].effects[i], effect, lane)
        self._late = self._late & ~(1 << lane) | late << lane

    def take(self, lane: int, member: Any) -> None:
        """Copy a lane's state, internal variables and tensions back to its member.

        The solver counts of its steps are added to those of the (first) rope.
        """
        ropes, lowest = ropes_of(member), self._lowest.reshape(-1, LANES)
        for r, rope in enumerate(ropes):
            for source, target in _state_arrays(self._ropes[r], lane, self._elements[r], rope):
                target[...] = source
            rope.state.counts[LOWEST_OFFSET] = lowest[r, lane]
            for i, effect in enumerate(rope.effects):
                if variable_count(type(effect)) and is_by_lane(type(effect)):
                    for part, value in zip(self._each_rope[r].effects[i], effect, strict=True):
                        if isinstance(value, np.ndarray):
                            value[...] = part[lane]
        self._count(ropes[0].state.health, lane)

    def _count(self, health: Ints, lane: int) -> None:
        """Add the solver counts of a lane to those of a rope, and clear them."""
        solves, most, steps = map(int, self._tally[:SLACK_SAMPLES, lane].tolist())
        if steps:
            health[STEPS] += steps
            health[SUBSTEPS] += steps
            health[SUBSTEPS_MAX] = max(health[SUBSTEPS_MAX], 1)
            health[SOLVES] += solves
            health[SOLVES_MAX] = max(health[SOLVES_MAX], most)
            self._tally[:SLACK_SAMPLES, lane] = 0.0

    def slack(self, lane: int) -> int:
        """Return the number of slack samples of a lane's member."""
        return int(self._tally[SLACK_SAMPLES, lane])

    # Steps

    def step(
        self, lanes: Iterable[int], member_of: Callable[[int], Rope | System], run: Run
    ) -> Progress:
        """Do the steps of a run in these lanes, or up to one that changes elements of a member.

        member_of: returns the member of a lane.
        """
        running, left, alone, failed = list(lanes), dict[int, int](), Counter[int](), set[int]()
        fraction = ALONE_FRACTION_SAMPLED if self.samples.size else ALONE_FRACTION
        done, changed, too_often = run.first, False, list[int]()
        while running and done < run.steps and not changed:
            wanted = sum(1 << lane for lane in running)
            done, undone = self.advance(run._replace(first=done, wanted=wanted))
            for lane in undone:
                member = member_of(lane)
                self.take(lane, member)
                reached = self.step_alone(lane, member, run._replace(first=done - 1, steps=done))
                alone[lane] += 1
                if reached < done:
                    failed.add(lane)
                elif not self._fits(member):
                    changed = True
                elif alone[lane] > MIN_ALONE_STEPS + fraction * (done - run.first):
                    too_often.append(lane)
                else:
                    self.put(lane, member)
                    continue
                running.remove(lane)
                left[lane] = reached
        for lane in too_often:  # not before, since the kernel writes to the tables of all lanes
            reached = self.step_alone(lane, member_of(lane), run._replace(first=left[lane]))
            if reached < run.steps:
                failed.add(lane)
            alone[lane] += reached - left[lane]
            left[lane] = reached
        return Progress(done, running, left, failed, alone)

    def _fits(self, member: Any) -> bool:
        """Return whether a member has as many elements as the batch."""
        counts = [int(rope.state.counts[ELEMENTS]) for rope in ropes_of(member)]
        return counts == list(self._elements)

    def step_alone(self, lane: int, member: Rope | System, run: Run) -> int:
        """Do the steps of a run, for a lane's member alone; its results are those of the lane.

        Returns the number of steps done: fewer if the next state would not be finite.
        """
        ropes, done = ropes_of(member), run.first
        while done < run.steps:
            to_sample = run.interval - (run.before + done) % run.interval
            count = 1 if self.samples.size else min(run.steps - done, to_sample)
            span, time = slice(done, done + count + 1), run.time + done * ropes[0].model.step
            boundary = Boundary(*(table[..., span, :, lane].copy() for table in self.boundary))
            pull: Floats = np.zeros((*self._lead, count, PULL_COLUMNS))
            if isinstance(member, Rope):
                stepped = advance(member, boundary, pull, time, count)
            else:
                stepped = advance_joined(member, boundary, pull, time, count)
            self.pulls[..., done : done + count, :, lane] = pull
            done += stepped
            if stepped < count:
                break
            self._sample(lane, ropes, run, done)
        return done

    def _sample(self, lane: int, ropes: Sequence[Rope], run: Run, done: int) -> None:
        """Sample the ropes of a lane's member after a step done alone."""
        samples = np.array([sample_of(rope) for rope in ropes])
        if self.samples.size:
            interval = (run.before + done - 1) // run.interval - run.before // run.interval
            kept = self.samples[..., interval, :, lane]
            samples = samples.reshape(kept.shape)
            lowest = np.minimum(kept[..., MIN_TENSION], samples[..., MIN_TENSION])
            kept[...], kept[..., MIN_TENSION] = samples, lowest
        elif (run.before + done) % run.interval == 0:
            self._tally[SLACK_SAMPLES, lane] += samples[:, MIN_TENSION].min() <= 0.0

    def advance(self, run: Run) -> tuple[int, list[int]]:
        """Advance the lanes; return the step reached, and the lanes that did not complete it.

        It stops before the last step if there are such lanes. At time 0, and on nodes that they
        were not computed for, internal variables are initialised by the single-rope solver.
        """
        begins = run.first == 0 and run.time == 0.0 and any(map(variable_count, self._types))
        late = ALL if begins else self._late
        known = self._lowest, self._tally
        tables = self.boundary, self.pulls, self.samples, run._replace(late=late)
        arguments = self._arrays, self._each, known, *tables
        code = _COMPILED.get(self._types)
        if code is None:
            code = _COMPILED[self._types] = compiled(advance_lanes_steps, arguments)
        done, left = divmod(int(code(*arguments)), ALL + 1)
        return done, [lane for lane in range(LANES) if left >> lane & 1]


_COMPILED: dict[tuple[type, ...], Any] = {}


class Unbatched(Lanes):
    """Tables of members that cannot be batched: every step is done alone."""

    def __init__(self, member: Rope | System, steps: int, intervals: int) -> None:
        """Allocate tables for members like this one."""
        super().__init__(() if isinstance(member, Rope) else (len(member.ropes),), steps, intervals)

    def _own(self, member: Any) -> Iterable[Rope]:
        return ()

    def _fits(self, member: Any) -> bool:
        return True

    def put(self, lane: int, member: Any) -> None:
        """Do nothing: the member has its state."""

    def take(self, lane: int, member: Any) -> None:
        """Do nothing: the member has its state."""

    def advance(self, run: Run) -> tuple[int, list[int]]:
        """Return the next step, and all lanes."""
        return run.first + 1, [lane for lane in range(LANES) if run.wanted >> lane & 1]


def new_each(data: type, arrays: Any, lead: tuple[int, ...], effects: Iterable[Any]) -> Any:
    """Return zeros for the data of each lane alone.

    data: `LaneData` or `SystemLaneData`; arrays: `Rope` or stack of all lanes; effects: layouts.
    """
    state = arrays.state if isinstance(arrays, Rope) else arrays
    columns, sections = state.s.shape[-2], arrays.sections.shape[-2]
    ends: Floats = np.zeros((*lead, LANES, SECTION_ROWS, sections))
    ends[..., END, :] = np.inf
    return data(
        work=arrays.work,
        own=np.zeros((WORK_ROWS, columns)),
        s=np.zeros(columns),
        counts=state.counts,
        health=state.health,
        tolerance=np.zeros((*lead, LANES)),
        sections=ends,
        effects=tuple(make_lane_data(layout, lead) for layout in effects),
    )
