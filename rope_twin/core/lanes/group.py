"""Arrays of single ropes that are stepped as a SIMD batch, and copying in and out of them."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
from numba import config

from rope_twin.core.body import lanes as bodies
from rope_twin.core.jit.wide import LANES
from rope_twin.core.lanes.batch import OWN_FIGURES, Lanes, new_each
from rope_twin.core.lanes.effects import (
    LaneData,
    aligned,
    any_by_lane,
    is_by_lane,
    layout_of,
    make_wide,
)
from rope_twin.core.loads import hooks
from rope_twin.core.loads.memory import variable_count
from rope_twin.core.payout import TRIALS
from rope_twin.core.state import (
    COUNTS,
    COUPLED_ROWS,
    ELEMENTS,
    END,
    HEALTH,
    LOWEST_OFFSET,
    NODE_ROWS,
    SAME_PLACE,
    SECTION_ROWS,
    WORK_ROWS,
    Ints,
    Model,
    Rope,
    State,
)

bodies.register()
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
    return None if why_alone(rope) else new_kind(rope, rope.effects, rope.law)


def new_kind(rope: Rope, effects: tuple[Any, ...], law: Any) -> Kind:
    """Return the kind of a rope; effects, law: of the layouts that its batch has."""
    return Kind(
        elements=int(rope.state.counts[ELEMENTS]),
        place=places_of(rope),
        sections=rope.sections.shape[1],
        first_free=rope.model.first_free,
        step=rope.model.step,
        absorb=rope.model.absorb,
        effects=tuple(layout_of(effect) for effect in effects),
        law=None if law is None else layout_of(law),
        places=effect_places(rope),
    )


def places_of(rope: Rope) -> tuple[int, ...]:
    """Return the section of each element; () if there is only one."""
    if rope.sections.shape[1] == 1:
        return ()
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


class Group(Lanes):
    """Batch of up to LANES ropes of one kind."""

    def __init__(self, kind: Kind, steps: int, intervals: int = 0) -> None:
        """Allocate arrays for ropes of this kind and for this many steps.

        intervals: rows of `samples`, the result of a fleet in place of slack samples; 0 for none.
        """
        super().__init__((), steps, intervals)
        self.kind, self._types = kind, kind.types
        self._elements = self._loaded = (kind.elements,)
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
        effects = tuple(make_wide(on_columns(layout, columns), ()) for layout in kind.effects)
        sections = aligned(SECTION_ROWS, kind.sections, LANES)
        sections[END] = np.inf
        coupled = hooks.couples(layout[0] for layout in kind.effects)
        work = aligned(columns, COUPLED_ROWS if coupled else WORK_ROWS, LANES)
        law = None if kind.law is None else make_wide(kind.law, ())
        self._arrays = Rope(model, state, work, sections, effects, law)
        self._ropes = (self._arrays,)
        if any_by_lane(layout[0] for layout in kind.effects):
            self._each = new_each(LaneData, self._arrays, (), kind.effects)
            self._each_rope = (self._each,)

    def _own(self, member: Rope) -> Iterable[Rope]:
        return (member,)

    def begin_stacked(self, ropes: Rope, of: Ints) -> None:
        """Copy in the ropes `of` of a stack, all of the group's plain kind, and clear the samples.

        ropes: arrays of state and sections, and the fields of its effects that differ from rope to
        rope, have all ropes of the stack as their first axis. Unused lanes get a copy of the first.
        """
        wide_rope, states, n, count = self._arrays, ropes.state, self.kind.elements, len(of)
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
        state, n = self._arrays.state, self.kind.elements
        states.nodes[of, :, : n + 1] = state.nodes[: n + 1, :, lanes].transpose(2, 1, 0)
        states.s[of, : n + 1] = state.s[: n + 1, lanes].T
        states.offset[of, :n] = state.offset[:n, lanes].T
        states.counts[of, LOWEST_OFFSET] = self._lowest[lanes]
        for member, lane in zip(of.tolist(), lanes.tolist(), strict=True):
            self._count(states.health[member], lane)


def _fill(lanes: Any, ropes: Any, count: int) -> None:
    """Copy an array with the ropes as its first axis to lanes, the last axis."""
    lanes[..., :count] = ropes.transpose((*range(1, ropes.ndim), 0))
    if count < LANES:
        lanes[..., count:] = lanes[..., :1]
