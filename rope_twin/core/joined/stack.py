"""Arrays of all ropes of a system in one piece, so that one binary steps any number of ropes.

`rope_of(stack, r)` is rope r, made of views; to the kernels of a single rope it looks like one.
Shared properties (current, drag, ...) are stored once; an effect whose properties differ from rope
to rope (a payload) registers how it is stacked, and how one rope's values are picked from the
stack. Effects with internal variables (core/loads/memory.py) are stacked as `Memories`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numba import types
from numba.extending import overload

from rope_twin.core.jit.decorators import LINKED, jit, jit_within
from rope_twin.core.joined.chains import chain_rows
from rope_twin.core.loads.hooks import kernels_by_place, members, written_out
from rope_twin.core.loads.memory import numbers_carried
from rope_twin.core.state import (
    COUNTS,
    END,
    HEALTH,
    NODE_ROWS,
    SECTION_ROWS,
    Floats,
    Ints,
    Model,
    Rope,
    State,
    Table,
    columns_for,
    new_work,
)


class Memories(NamedTuple):
    """An effect with internal variables, of all ropes of a system."""

    first: Any  # that of one rope, with the fields that are not numbers: they are those of all
    memory: Floats  # (ropes, rows, nodes + 1)
    figures: Floats  # the fields of each that are numbers, (ropes, numbers)


_STACKERS: dict[type, Callable[[Sequence[Any]], Any]] = {}
_PICKERS: dict[type, Any] = {}


class Stack(NamedTuple):
    """Arrays of all ropes, stacked along the first axis; other axes are those of a Rope."""

    model: Floats  # the fields of Model, (ropes, 7)
    nodes: Floats
    s: Floats
    offset: Floats
    counts: Ints
    health: Ints
    work: Floats
    sections: Floats
    effects: tuple[Any, ...]
    law: Table | None


def stacks(kind: type, stacked: type, picker: Any) -> Callable[[Any], Any]:
    """Register how effects of this type are stacked, and the kernel that picks rope r's values.

    picker: f(stacked effect, r), a plain function of numbers and arrays.
    """

    def register(function: Any) -> Any:
        _STACKERS[kind] = function
        _PICKERS[stacked] = jit_within(picker)
        return function

    return register


def stacked_effects(ropes: Sequence[Rope], room: int) -> tuple[Any, ...]:
    """Return the stacked effects of all ropes; of the first rope where they cannot differ.

    room: number of nodes that the stack has space for.
    """
    made = []
    for own in zip(*(rope.effects for rope in ropes), strict=True):
        if numbers_carried(type(own[0])):
            made.append(_stacked_memories(own, room))
            continue
        stacker = _STACKERS.get(type(own[0]))
        made.append(own[0] if stacker is None else stacker(own))
    return tuple(made)


def _stacked_memories(effects: Sequence[Any], room: int) -> Memories:
    room = max(room, *(one.memory.shape[1] - 1 for one in effects))
    memory = np.zeros((len(effects), len(effects[0].memory), room + 1))
    for into, one in zip(memory, effects, strict=True):
        _copy_columns(one.memory, into)
    first = next((one for one in effects if getattr(one, "here", True)), effects[0])
    names = _numbers(first)
    figures = [[getattr(one, name) for name in names] for one in effects]
    return Memories(first, memory, np.array(figures, dtype=float))


def _numbers(effect: Any) -> list[str]:
    """Return the names of an effect's fields that are numbers."""
    return [name for name, value in effect._asdict().items() if isinstance(value, float | int)]


def _copy_columns(memory: Floats, into: Floats) -> None:
    """Copy internal variables of as many nodes as both have space for, and the last column."""
    count = min(memory.shape[1], into.shape[1]) - 1
    into[:, :count], into[:, -1] = memory[:, :count], memory[:, -1]


def store_memories(stacked: tuple[Any, ...], ropes: Sequence[Rope]) -> None:
    """Copy the internal variables from stacked effects to those of the ropes."""
    for place, effect in enumerate(stacked):
        if isinstance(effect, Memories):
            for rope, memory in zip(ropes, effect.memory, strict=True):
                _copy_columns(memory, rope.effects[place].memory)


def _with_columns(rope: Rope, room: int) -> Rope:
    """Return a rope whose effects have space for the internal variables of `room` nodes."""
    effects = []
    for one in rope.effects:
        if numbers_carried(type(one)):
            memory = np.zeros((len(one.memory), room + 1))
            _copy_columns(one.memory, memory)
            one = one._replace(memory=memory)
        effects.append(one)
    return rope._replace(effects=tuple(effects))


def new_stack(ropes: Sequence[Rope]) -> Stack:
    """Return a stack sized for these ropes, filled with their constants."""
    count, room = len(ropes), max(rope.state.s.shape[0] for rope in ropes)
    lines = chain_rows(ropes[0].effects)
    sections = np.zeros((count, SECTION_ROWS, max(rope.sections.shape[1] for rope in ropes)))
    sections[:, END] = np.inf
    for r, rope in enumerate(ropes):
        sections[r, :, : rope.sections.shape[1]] = rope.sections
    return Stack(
        model=np.zeros((count, len(Model._fields))),
        nodes=np.zeros((count, NODE_ROWS, room)),
        s=np.zeros((count, room)),
        offset=np.zeros((count, room)),
        counts=np.zeros((count, COUNTS), np.int64),
        health=np.zeros((count, HEALTH), np.int64),
        work=new_work(columns_for(room), count * lines).reshape(count, lines, -1),
        sections=sections,
        effects=stacked_effects(ropes, room),
        law=_stacked_law([rope.law for rope in ropes]),
    )


def _stacked_law(laws: Sequence[Table | None]) -> Table | None:
    """Return stacked tables, padded with knots at infinity; all ropes have one or none has."""
    tables = [law for law in laws if law is not None]
    if not tables:
        return None
    size = np.max([table.knot.shape for table in tables], axis=0)
    rows = []
    for field in Table._fields:
        row = np.full((len(tables), *size), np.inf if field == "knot" else 0.0)
        for own, table in zip(row, tables, strict=True):
            values = getattr(table, field)
            own[: values.shape[0], : values.shape[1]] = values
        rows.append(row)
    return Table(*rows)


def view_of(stack: Stack, r: int, rope: Rope) -> Rope:
    """Return rope r as a view of the stack, for Python; law and effects are those of `rope`.

    Internal variables of effects are a copy with the columns that the stack has.
    """
    rope = _with_columns(rope, stack.s.shape[1])
    state = State(stack.nodes[r], stack.s[r], stack.offset[r], stack.counts[r], stack.health[r])
    return rope._replace(state=state, work=stack.work[r], sections=stack.sections[r])


def load(stack: Stack, r: int, rope: Rope) -> None:
    """Copy a rope into the stack: its model, and its state if that is stored elsewhere."""
    stack.model[r] = rope.model
    if rope.state.nodes.base is not stack.nodes:
        for table, own in zip(_state_of(stack, r), rope.state, strict=True):
            table[..., : own.shape[-1]] = own


def store(stack: Stack, r: int, rope: Rope) -> None:
    """Copy state and scratch from the stack to a rope that is stored elsewhere."""
    if rope.state.nodes.base is not stack.nodes:
        for table, own in zip(_state_of(stack, r), rope.state, strict=True):
            own[...] = table[..., : own.shape[-1]]
        rope.work[...] = stack.work[r, : rope.work.shape[0], : rope.work.shape[1]]


def _state_of(stack: Stack, r: int) -> tuple[Any, ...]:
    return stack.nodes[r], stack.s[r], stack.offset[r], stack.counts[r], stack.health[r]


def effects_at(effects: Any, r: Any) -> Any:
    """Return the effects with the values of rope r."""
    made = []
    for effect in effects:
        if isinstance(effect, Memories):
            made.append(_own_of(effect, r))
        else:
            picker = _PICKERS.get(type(effect))
            made.append(effect if picker is None else picker(effect, r))
    return tuple(made)


def _own_of(effect: Memories, r: int) -> Any:
    """Return rope r's effect with internal variables (plain Python)."""
    figures = dict(zip(_numbers(effect.first), effect.figures[r], strict=True))
    return effect.first._replace(memory=effect.memory[r], **figures)


def _memories_at(i: int, kind: Any) -> str:
    """Return the source of rope r's effect i, one with internal variables; kind: its numba type."""
    parts = {name: f"effects[{i}].first.{name}" for name in kind.fields}
    numbers = [
        f for f, own in zip(kind.fields, kind.types, strict=True) if isinstance(own, types.Number)
    ]
    parts |= {name: f"effects[{i}].figures[r, {k}]" for k, name in enumerate(numbers)}
    parts["memory"] = f"effects[{i}].memory[r]"
    return f"Kind_{i}({', '.join(parts[name] for name in kind.fields)})"


@overload(effects_at, jit_options=LINKED, strict=False)
def _compose_effects(effects: Any, r: Any) -> Any:
    scope: dict[str, Any] = {}
    parts = []
    for i, effect in enumerate(effects):
        if effect.instance_class is Memories:
            kind = effect.types[effect.fields.index("first")]
            scope[f"Kind_{i}"] = kind.instance_class
            parts.append(_memories_at(i, kind))
            continue
        picker = _PICKERS.get(effect.instance_class)
        parts.append(f"effects[{i}]" if picker is None else f"pick_{i}(effects[{i}], r)")
        scope[f"pick_{i}"] = picker
    exec(f"def at(effects, r):\n    return ({' '.join(part + ',' for part in parts)})", scope)
    return scope["at"]


def face_ropes(effects: Any, rope: Any, stack: Any) -> Any:
    """Let the effects of a rope of the stack read of other ropes what they depend on there."""
    for i, effect in enumerate(effects):
        for own, call in members("face", (effect,)):
            call(own, rope, stack, stack.effects[i].memory)


@overload(face_ropes, jit_options=LINKED, strict=False)
def _compose_faces(effects: Any, rope: Any, stack: Any) -> Any:
    calls = kernels_by_place("face", effects)
    lines = [f"kernel_{i}(effects[{i}], rope, stack, stack.effects[{i}].memory)" for i in calls]
    return written_out("effects, rope, stack", [*lines, "return None"], calls)


def _law_at(law: Any, r: Any) -> Any:
    """Return the law of rope r."""
    return None if law is None else Table(*(row[r] for row in law))


@overload(_law_at, jit_options=LINKED, strict=False)
def _choose_law(law: Any, r: Any) -> Any:
    def table(law: Any, r: Any) -> Any:
        return Table(law.knot[r], law.tension[r], law.slope[r], law.curve[r], law.bend[r])

    def none(law: Any, r: Any) -> Any:
        return None

    return none if isinstance(law, types.NoneType) else table


@jit
def rope_of(stack: Any, r: int) -> Any:
    """Return rope r of the stack."""
    m = stack.model[r]
    return Rope(
        Model(m[0], m[1], m[2], m[3], int(m[4]), m[5], m[6]),
        State(stack.nodes[r], stack.s[r], stack.offset[r], stack.counts[r], stack.health[r]),
        stack.work[r],
        stack.sections[r],
        effects_at(stack.effects, r),
        _law_at(stack.law, r),
    )
