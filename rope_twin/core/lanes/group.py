"""Arrays of single ropes that are stepped as a SIMD batch, and copying in and out of them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from numba import config

from rope_twin.core.body import lanes as bodies
from rope_twin.core.jit.decorators import compiled
from rope_twin.core.jit.wide import ALL, LANES
from rope_twin.core.lanes.effects import (
    LaneData,
    aligned,
    any_by_lane,
    is_by_lane,
    layout_of,
    make_lane_data,
    make_wide,
    put_lane_data,
    put_wide,
)
from rope_twin.core.lanes.step import MIN_TENSION, SAMPLE_COLUMNS, TALLIES, Run, advance_lanes_steps
from rope_twin.core.loads import hooks
from rope_twin.core.loads.memory import carried_arrays, count_initialised, variable_count
from rope_twin.core.payout import TRIALS
from rope_twin.core.state import (
    COUNTS,
    COUPLED_ROWS,
    ELEMENTS,
    END,
    HEALTH,
    LOWEST_OFFSET,
    MOTIONS,
    NODE_ROWS,
    PULL_COLUMNS,
    SAME_PLACE,
    SECTION_ROWS,
    SOLVES,
    SOLVES_MAX,
    STEPS,
    SUBSTEPS,
    SUBSTEPS_MAX,
    TENSION,
    WORK_ROWS,
    Boundary,
    Floats,
    Ints,
    Model,
    Rope,
    State,
)

bodies.register()
OWN_FIGURES = ("element_length", "split_above", "merge_below", "tolerance")  # of the Model
# Fields of effects: whether this rope carries the body or the unit, and the ropes that a net is at
PLACES = ("here", "left", "right")


class Kind(NamedTuple):
    """Properties that ropes must share to be stepped in one SIMD batch."""

    elements: int
    place: tuple[int, ...]  # section of each element; empty if there is only one section
    sections: int
    first_free: int
    step: float
    absorb: float
    effects: tuple[Any, ...]  # layouts of their data
    law: Any  # the same of a table of stiffness, or None
    places: tuple[float, ...]  # of its effects in a system: see PLACES

    @property
    def plain(self) -> bool:
        """Whether ropes differ in arrays only, which a stack of them holds (`begin_stacked`)."""
        return self.law is None and not any(
            variable_count(layout[0])
            or is_by_lane(layout[0])
            or any(isinstance(part[0], type) for part in layout[1:])
            for layout in self.effects
        )

    @property
    def layout(self) -> Kind:
        """Kind that arrays of a batch are made for."""
        return self

    @property
    def types(self) -> tuple[type, ...]:
        """Types that select the compiled code."""
        return (*(layout[0] for layout in self.effects), type(self.law))


def why_alone(rope: Rope) -> str:
    """Return why a rope cannot be stepped in a SIMD batch; empty if it can.

    Effects are given by the names used in scenes.
    """
    if config.DISABLE_JIT:
        return "plain Python"
    if rope.state.counts[ELEMENTS] < 2:
        return "a single element"
    unit = hooks.axial_index(map(type, rope.effects))
    if unit is not None and not rope.effects[unit].here:
        return "a unit that was cut off"
    kinds = [type(effect) for effect in rope.effects if not hooks.all_wide([type(effect)])]
    return ", ".join(effect_of(kind) for kind in kinds)


def effect_of(kind: type) -> str:
    """Return the file in effects/ that defines an effect's kernels, else the folder of core."""
    kernels = [hooks.kernel_of(hook, kind).py_func for hook in hooks.hooks_of(kind)]
    files = [kernel.__module__.split(".") for kernel in kernels]
    return next((path[2] for path in files if path[1] == "effects"), kind.__module__.split(".")[2])


def kind_of(rope: Rope) -> Kind | None:
    """Return the properties shared by ropes of a batch; None if the rope cannot be batched."""
    if why_alone(rope):
        return None
    elements, sections = int(rope.state.counts[ELEMENTS]), rope.sections.shape[1]
    return Kind(
        elements=elements,
        place=places_of(rope) if sections > 1 else (),
        sections=sections,
        first_free=rope.model.first_free,
        step=rope.model.step,
        absorb=rope.model.absorb,
        effects=tuple(layout_of(effect) for effect in rope.effects),
        law=None if rope.law is None else layout_of(rope.law),
        places=effect_places(rope),
    )


def places_of(rope: Rope) -> tuple[int, ...]:
    """Return the section of each element."""
    lower_ends = rope.state.s[: rope.state.counts[ELEMENTS]] + SAME_PLACE
    return tuple(np.searchsorted(rope.sections[END], lower_ends, side="right").tolist())


def effect_places(rope: Rope) -> tuple[float, ...]:
    """Return the fields by which effects know their place in a system, common to all lanes."""
    return tuple(
        float(getattr(effect, name))
        for effect in rope.effects
        for name in PLACES
        if hasattr(effect, name)
    )


def on_columns(layout: Any, columns: int) -> Any:
    """Return an effect's layout, with the memory of internal variables on a batch's columns."""
    kind, *parts = layout
    if not variable_count(kind) or is_by_lane(kind):
        return layout
    place = kind._fields.index("memory")
    code, (height, _) = parts[place]
    parts[place] = code, (height, columns + 1)
    return (kind, *parts)


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


def _in_lanes(arrays: Rope, rope: Rope) -> Iterator[tuple[Any, Any]]:
    """Yield the effects with internal variables that the lanes have in common, and the rope's."""
    for effect, source in zip(arrays.effects, rope.effects, strict=True):
        if variable_count(type(source)) and not is_by_lane(type(source)):
            yield effect, source


def put_state(arrays: Rope, lane: int, n: int, rope: Rope) -> None:
    """Copy the state and internal variables of a rope of n elements into a lane."""
    for effect, source in _in_lanes(arrays, rope):
        for columns in (slice(n + 1), slice(-1 - TRIALS, None)):
            effect.memory[:, columns, lane] = source.memory[:, columns]
        for name in carried_arrays(type(source)):
            getattr(effect, name)[..., lane] = getattr(source, name)
    state = rope.state
    arrays.state.nodes[: n + 1, :, lane] = state.nodes[:, : n + 1].T
    arrays.state.s[: n + 1, lane] = state.s[: n + 1]
    arrays.state.offset[:n, lane] = state.offset[:n]


def take_state(arrays: Rope, lane: int, n: int, rope: Rope) -> None:
    """Copy the state and internal variables of a lane back to its rope of n elements."""
    for effect, source in _in_lanes(arrays, rope):
        for columns in (slice(n + 1), slice(-1 - TRIALS, None)):
            source.memory[:, columns] = effect.memory[:, columns, lane]
        for name in carried_arrays(type(source)):
            getattr(source, name)[...] = getattr(effect, name)[..., lane]
    state = rope.state
    state.nodes[:, : n + 1] = arrays.state.nodes[: n + 1, :, lane].T
    state.s[: n + 1] = arrays.state.s[: n + 1, lane]
    state.offset[:n] = arrays.state.offset[:n, lane]


class Lanes(ABC):
    """Base of a batch of up to LANES members, single ropes or systems of ropes."""

    kind: Any

    def __init__(self, effects: tuple[Any, ...], lead: tuple[int, ...], sizes: Any) -> None:
        """Allocate tables of motion and results.

        effects: layouts; lead: axes before those of a rope; sizes: steps, and rows of `samples`.
        """
        self.steps, intervals = sizes
        border = (*lead, self.steps + 1, MOTIONS, LANES)
        self.boundary = Boundary(aligned(*border), aligned(*border))
        self.pulls = aligned(*lead, self.steps, PULL_COLUMNS, LANES)
        self.samples = aligned(*lead, intervals, SAMPLE_COLUMNS, LANES)
        self._tally = aligned(TALLIES, LANES)
        self._lowest: Ints = np.zeros((*lead, LANES), np.int64)
        self._late = 0  # lanes whose internal variables must be interpolated, as bits
        self._remembers = any(variable_count(layout[0]) for layout in effects)

    def fit(self, kind: Any) -> None:
        """Take members of this kind, of the same layout."""
        self.kind = kind

    @abstractmethod
    def _put(self, lane: int, member: Any) -> None:
        """Copy in a member with all of its properties."""

    def begin(self, members: Sequence[Any], boundaries: Sequence[Boundary]) -> None:
        """Copy in members of the group's kind, and their motion at the step boundaries.

        Unused lanes get a copy of the first member.
        """
        self.load(members)
        for lane in range(LANES):
            member = lane if lane < len(members) else 0
            for table, values in zip(self.boundary, boundaries[member], strict=True):
                table[..., : values.shape[-2], :, lane] = values

    def load(self, members: Sequence[Any]) -> None:
        """Copy in members of the group's kind, and clear counters and samples."""
        self._clear()
        for lane in range(LANES):
            self._put(lane, members[lane if lane < len(members) else 0])

    def _clear(self) -> None:
        self._tally[:] = 0.0
        self.samples[:] = 0.0
        self.samples[..., MIN_TENSION, :] = np.inf

    def late(self, steps: int) -> int:
        """Return the lanes that take the step after `steps` in the single-rope solver, as bits.

        They initialise internal variables, or interpolate them to other nodes.
        """
        return ALL if self._remembers and steps == 0 else self._late

    def account(self, lane: int, health: Ints) -> tuple[int, int]:
        """Add a lane's counters to its (first) rope's; return its steps and slack samples."""
        solves, solves_max, steps, slack = (int(value) for value in self._tally[:, lane])
        health[STEPS] += steps
        health[SUBSTEPS] += steps
        health[SUBSTEPS_MAX] = max(health[SUBSTEPS_MAX], min(steps, 1))
        health[SOLVES] += solves
        health[SOLVES_MAX] = max(health[SOLVES_MAX], solves_max)
        return steps, slack


class Group(Lanes):
    """Batch of up to LANES ropes of one kind."""

    def __init__(self, kind: Kind, steps: int, intervals: int = 0) -> None:
        """Allocate arrays for ropes of this kind and for this many steps.

        intervals: rows of `samples`, the result of a fleet in place of slack samples; 0 for none.
        """
        super().__init__(kind.effects, (), (steps, intervals))
        self.kind = kind
        columns = kind.elements + 1 + TRIALS
        figures: Any = {name: aligned(LANES) for name in OWN_FIGURES}
        model = Model(absorb=kind.absorb, first_free=kind.first_free, step=kind.step, **figures)
        state = State(
            aligned(columns, NODE_ROWS, LANES),
            aligned(columns, LANES),
            aligned(columns, LANES),
            np.zeros(COUNTS, np.int64),
            np.zeros(HEALTH, np.int64),
        )
        state.counts[ELEMENTS] = kind.elements
        effects = tuple(make_wide(on_columns(layout, columns)) for layout in kind.effects)
        sections = aligned(SECTION_ROWS, kind.sections, LANES)
        coupled = hooks.couples(layout[0] for layout in kind.effects)
        work = aligned(columns, COUPLED_ROWS if coupled else WORK_ROWS, LANES)
        law = None if kind.law is None else make_wide(kind.law)
        self._rope = Rope(model, state, work, sections, effects, law)
        own_each = any_by_lane(layout[0] for layout in kind.effects)
        self._each: Any = self._new_each() if own_each else None
        self._place = np.zeros(kind.elements, np.int64)
        if kind.place:
            self._place[:] = kind.place

    def begin_stacked(self, ropes: Rope, of: Ints) -> None:
        """Copy in the ropes `of` of a stack, all of the group's plain kind, and clear the samples.

        ropes: arrays of state and sections, and the fields of its effects that differ from rope to
        rope, have all ropes of the stack as their first axis. Unused lanes get a copy of the first.
        """
        wide_rope, states, n, count = self._rope, ropes.state, self.kind.elements, len(of)
        self._clear()
        for name in OWN_FIGURES:
            getattr(wide_rope.model, name)[:] = getattr(ropes.model, name)
        _fill(wide_rope.sections, ropes.sections[of], count)
        for effect, fields in zip(wide_rope.effects, ropes.effects, strict=True):
            for field, value in zip(effect, fields, strict=True):
                if np.ndim(value) == field.ndim:
                    _fill(field, value[of], count)
                else:
                    field[...] = np.asarray(value)[..., None]
        nodes = states.nodes[of, :, : n + 1].transpose(0, 2, 1)
        _fill(wide_rope.state.nodes[: n + 1], nodes, count)
        _fill(wide_rope.state.s[: n + 1], states.s[of, : n + 1], count)
        _fill(wide_rope.state.offset[:n], states.offset[of, :n], count)
        _fill(self._lowest, states.counts[of, LOWEST_OFFSET], count)

    def take_stacked(self, states: State, of: Ints, lanes: Ints) -> None:
        """Copy the states of these lanes back to the ropes `of` of a stack, with solver counts."""
        state, n = self._rope.state, self.kind.elements
        states.nodes[of, :, : n + 1] = state.nodes[: n + 1, :, lanes].transpose(2, 1, 0)
        states.s[of, : n + 1] = state.s[: n + 1, lanes].T
        states.offset[of, :n] = state.offset[:n, lanes].T
        states.counts[of, LOWEST_OFFSET] = self._lowest[lanes]
        solves, max_solves, steps, _ = self._tally[:, lanes].astype(np.int64)
        states.health[of, STEPS] += steps
        states.health[of, SUBSTEPS] += steps
        states.health[of, SOLVES] += solves
        for column, value in ((SUBSTEPS_MAX, np.minimum(steps, 1)), (SOLVES_MAX, max_solves)):
            states.health[of, column] = np.maximum(states.health[of, column], value)

    def _put(self, lane: int, rope: Rope) -> None:
        put_properties(self._rope, lane, rope)
        if self._each is not None:
            put_lane_data(self._each.effects, rope.effects, lane)
            self._each.sections[lane] = rope.sections
            self._each.tolerance[lane] = rope.model.tolerance
        self.put(lane, rope)

    def put(self, lane: int, rope: Rope) -> None:
        """Copy a rope's state and internal variables into a lane."""
        n = self.kind.elements
        self._late &= ~(1 << lane)
        for i, effect in enumerate(rope.effects):
            if variable_count(type(effect)):
                self._late |= (count_initialised(effect) != n) << lane
                if is_by_lane(type(effect)):
                    put_lane_data(self._each.effects[i], effect, lane)
        put_state(self._rope, lane, n, rope)
        self._lowest[lane] = rope.state.counts[LOWEST_OFFSET]

    def take(self, lane: int, rope: Rope) -> None:
        """Copy a lane's state and internal variables back to its rope."""
        for i, effect in enumerate(rope.effects):
            if variable_count(type(effect)) and is_by_lane(type(effect)):
                for part, value in zip(self._each.effects[i], effect, strict=True):
                    if isinstance(value, np.ndarray):
                        value[...] = part[lane]
        take_state(self._rope, lane, self.kind.elements, rope)
        rope.state.counts[LOWEST_OFFSET] = self._lowest[lane]

    def _new_each(self) -> LaneData:
        """Return zeros for the data of each lane alone."""
        kind, columns = self.kind, len(self._rope.work)
        return LaneData(
            work=self._rope.work,
            own=np.zeros((WORK_ROWS, columns)),
            s=np.zeros(columns),
            counts=self._rope.state.counts,
            health=self._rope.state.health,
            tolerance=np.zeros(LANES),
            sections=np.zeros((LANES, SECTION_ROWS, kind.sections)),
            effects=tuple(make_lane_data(layout) for layout in kind.effects),
        )

    def advance(self, run: Run) -> tuple[int, list[int]]:
        """Advance the batch; return the step reached, and the lanes that did not complete it.

        It stops before the last step if there are such lanes.
        """
        known = self._place, self._lowest, self._tally
        rope = self._rope
        tables = self.boundary, self.pulls, self.samples, run
        return advance_batch(rope.effects, rope.law, rope, self._each, known, *tables)

    def tension(self, lane: int) -> Floats:
        """Return the tension of a lane's elements after the last step [N]."""
        return self._rope.work[: self.kind.elements, TENSION, lane].copy()


def _fill(lanes: Any, ropes: Any, count: int) -> None:
    """Copy an array with the ropes as its first axis to lanes, the last axis."""
    lanes[..., :count] = ropes.transpose((*range(1, ropes.ndim), 0))
    if count < LANES:
        lanes[..., count:] = lanes[..., :1]


_COMPILED: dict[tuple[type, ...], Any] = {}


def advance_batch(effects: Any, law: Any, *arguments: Any) -> tuple[int, list[int]]:
    """Call `advance_lanes_steps`, compiled for these types of effects and law and the arrays'.

    Returns the step reached and the lanes that did not complete it.
    """
    outer_types = type(arguments[0]), type(getattr(arguments[0], "sheaves", None))
    kinds = (*outer_types, *map(type, effects), type(law))
    code = _COMPILED.get(kinds)
    if code is None:
        code = _COMPILED[kinds] = compiled(advance_lanes_steps, arguments)
    done, left = divmod(int(code(*arguments)), ALL + 1)
    return done, [lane for lane in range(LANES) if left >> lane & 1]
