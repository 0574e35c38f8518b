"""Stacked arrays of all ropes of a system, so that one binary steps any number of ropes.

`rope_of(stack, r)` returns rope r as views, for the kernels of a single rope. Shared properties
(current, drag, ...) are stored once. For an effect whose numbers differ from rope to rope
(`differs_by_rope`, a payload) they are in a row of `Numbers` per rope; arrays are those of the
first rope. Effects with internal variables (core/loads/memory.py) are stacked as `Memories`.

**SIMD lanes** (core/lanes). The stack of a batch of systems is a `LaneStack`. Functions over a
system (core/joined/stage) serve both, by `any_rope_of` and `work_of`, which return arrays or tables
of wide numbers.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from numba import types
from numba.extending import overload

from rope_twin.core.jit.decorators import INLINED, LINKED, jit
from rope_twin.core.jit.functions import by_type, lanes_only
from rope_twin.core.jit.rows import field_type, struct_type
from rope_twin.core.jit.wide import table, tiles, wide
from rope_twin.core.loads.hooks import (
    FIELDS_BY_ROPE,
    couples,
    generated,
    kernels,
    kernels_by_index,
    struct_text,
    with_kernel,
)
from rope_twin.core.loads.memory import variable_count
from rope_twin.core.state import (
    CHAIN_ROWS,
    COUNTS,
    COUPLED_CHAIN_ROWS,
    ELEMENTS,
    END,
    HEALTH,
    NODE_ROWS,
    SECTION_ROWS,
    Boundary,
    Floats,
    Ints,
    Model,
    Rope,
    State,
    Table,
    columns_for,
    new_work,
)

TOLERANCE = Model._fields.index("tolerance")


class Memories(NamedTuple):
    """An effect with internal variables, of all ropes of a system."""

    first: Any  # that of one rope, with the fields that are not numbers: they are those of all
    memory: Floats  # (ropes, rows, nodes + 1)
    figures: Floats  # the fields of each that are numbers, (ropes, numbers)


class Numbers(NamedTuple):
    """An effect whose numbers differ from rope to rope."""

    first: Any  # that of one rope
    figures: Floats  # the numbers of each, also those of its parts, (ropes, numbers)


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


def _real(effect: Any) -> Any:
    """Return an effect whose fields that are meant to be real numbers are."""
    parts = list(effect)
    for k in FIELDS_BY_ROPE[type(effect)]:
        parts[k] = float(parts[k])
    return type(effect)(*parts)


def _flat(value: Any) -> list[float]:
    """Return the numbers of a struct and of its parts; whole ones and arrays are those of all."""
    if isinstance(value, tuple):
        return [number for part in value for number in _flat(part)]
    return [value] if isinstance(value, float) else []


def _with_numbers(value: Any, numbers: Iterator[float]) -> Any:
    """Return a struct with other numbers (plain Python)."""
    if isinstance(value, tuple):
        parts = [_with_numbers(part, numbers) for part in value]
        return type(value)(*parts) if hasattr(value, "_fields") else tuple(parts)
    return next(numbers) if isinstance(value, float) else value


def stacked_effects(ropes: Sequence[Rope], room: int) -> tuple[Any, ...]:
    """Return the stacked effects of all ropes; those that cannot differ are from the first rope.

    room: node capacity of the stack.
    """
    stacked: list[Any] = []
    for rope_effects in zip(*(rope.effects for rope in ropes), strict=True):
        if variable_count(type(rope_effects[0])):
            stacked.append(_stacked_memories(rope_effects, room))
        elif type(rope_effects[0]) in FIELDS_BY_ROPE:
            real = [_real(effect) for effect in rope_effects]
            stacked.append(Numbers(real[0], np.array([_flat(effect) for effect in real])))
        else:
            stacked.append(rope_effects[0])
    return tuple(stacked)


def _stacked_memories(effects: Sequence[Any], room: int) -> Memories:
    room = max(room, *(effect.memory.shape[1] - 1 for effect in effects))
    memory = np.zeros((len(effects), len(effects[0].memory), room + 1))
    for stacked, effect in zip(memory, effects, strict=True):
        _copy_columns(effect.memory, stacked)
    first = next((effect for effect in effects if getattr(effect, "here", True)), effects[0])
    names = _numbers(first)
    figures = [[getattr(effect, name) for name in names] for effect in effects]
    return Memories(first, memory, np.array(figures, dtype=float))


def _numbers(effect: Any) -> list[str]:
    """Return the names of an effect's fields that are numbers."""
    return [name for name, value in effect._asdict().items() if isinstance(value, float | int)]


def _copy_columns(memory: Floats, into: Floats) -> None:
    """Copy the internal variables of the columns that both have, and the last column."""
    count = min(memory.shape[1], into.shape[1]) - 1
    into[:, :count], into[:, -1] = memory[:, :count], memory[:, -1]


def store_memories(stacked: tuple[Any, ...], ropes: Sequence[Rope]) -> None:
    """Copy the internal variables from stacked effects to those of the ropes."""
    for place, effect in enumerate(stacked):
        if isinstance(effect, Memories):
            for rope, memory in zip(ropes, effect.memory, strict=True):
                _copy_columns(memory, rope.effects[place].memory)


def chain_rows(kinds: Iterable[type]) -> int:
    """Return the rows of scratch of a chain between connections with these types of effects."""
    return COUPLED_CHAIN_ROWS if couples(kinds) else CHAIN_ROWS


def _with_columns(rope: Rope, room: int) -> Rope:
    """Return a rope whose effects have space for the internal variables of `room` nodes."""
    effects = []
    for effect in rope.effects:
        if variable_count(type(effect)):
            memory = np.zeros((len(effect.memory), room + 1))
            _copy_columns(effect.memory, memory)
            effect = effect._replace(memory=memory)
        effects.append(effect)
    return rope._replace(effects=tuple(effects))


def new_stack(ropes: Sequence[Rope]) -> Stack:
    """Return a stack sized for these ropes, filled with their constants."""
    count, room = len(ropes), max(rope.state.s.shape[0] for rope in ropes)
    lines = chain_rows(map(type, ropes[0].effects))
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
    """Return stacked tables, padded with knots at infinity, or None; all ropes have one or none."""
    tables = [law for law in laws if law is not None]
    if not tables:
        return None
    size = np.max([table.knot.shape for table in tables], axis=0)
    rows = []
    for field in Table._fields:
        row = np.full((len(tables), *size), np.inf if field == "knot" else 0.0)
        for padded, law in zip(row, tables, strict=True):
            values = getattr(law, field)
            padded[: values.shape[0], : values.shape[1]] = values
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
        for table, array in zip(_state_of(stack, r), rope.state, strict=True):
            table[..., : array.shape[-1]] = array


def store(stack: Stack, r: int, rope: Rope) -> None:
    """Copy state and scratch from the stack to a rope that is stored elsewhere."""
    if rope.state.nodes.base is not stack.nodes:
        for table, array in zip(_state_of(stack, r), rope.state, strict=True):
            array[...] = table[..., : array.shape[-1]]
        rope.work[...] = stack.work[r, : rope.work.shape[0], : rope.work.shape[1]]


def _state_of(stack: Stack, r: int) -> tuple[Any, ...]:
    return stack.nodes[r], stack.s[r], stack.offset[r], stack.counts[r], stack.health[r]


def effects_at(effects: Any, r: Any) -> Any:
    """Return the effects with the values of rope r."""
    result = []
    for effect in effects:
        if isinstance(effect, Memories):
            effect = _own_of(effect, r)
        elif isinstance(effect, Numbers):
            effect = _with_numbers(effect.first, iter(effect.figures[r]))
        result.append(effect)
    return tuple(result)


def _own_of(effect: Memories, r: int) -> Any:
    """Return rope r's effect with internal variables (plain Python)."""
    figures = dict(zip(_numbers(effect.first), effect.figures[r], strict=True))
    return effect.first._replace(memory=effect.memory[r], **figures)


def _memories_at(i: int, kind: Any) -> str:
    """Return the source of rope r's effect i, one with internal variables; kind: its numba type."""
    parts = {name: f"effects[{i}].first.{name}" for name in kind.fields}
    numbers = [
        f
        for f, type_ in zip(kind.fields, kind.types, strict=True)
        if isinstance(type_, types.Number)
    ]
    parts |= {name: f"effects[{i}].figures[r, {k}]" for k, name in enumerate(numbers)}
    parts["memory"] = f"effects[{i}].memory[r]"
    return f"Kind_{i}({', '.join(parts[name] for name in kind.fields)})"


def _numbers_at(figures: str) -> Callable[[Any, str], str]:
    """Return what `struct_text` takes for the numbers of rope r, in their order, and all else."""
    column = itertools.count()

    def leaf(kind: Any, path: str) -> str:
        return f"{figures}[r, {next(column)}]" if isinstance(kind, types.Float) else path

    return leaf


@overload(effects_at, jit_options=LINKED, strict=False)
def _compose_effects(effects: Any, r: Any) -> Any:
    scope: dict[str, Any] = {}
    parts = []
    for i, effect in enumerate(effects):
        if effect.instance_class is Memories:
            kind = field_type(effect, "first")
            scope[f"Kind_{i}"] = kind.instance_class
            parts.append(_memories_at(i, kind))
            continue
        text = f"effects[{i}]"
        if effect.instance_class is Numbers:
            kind = field_type(effect, "first")
            text = struct_text(kind, f"{text}.first", scope, _numbers_at(f"{text}.figures"))
        parts.append(text)
    text = " ".join(part + "," for part in parts)
    return generated("effects, r", [f"return ({text})"], {}, **scope)


def gather_from_ropes(effects: Any, rope: Any, stack: Any) -> Any:
    """Copy the data of other ropes that the effects of a rope depend on.

    stack: of a system or of lanes.
    """
    for i, effect in enumerate(effects):
        for member, call in with_kernel("gather", (effect,)):
            call(member, rope, stack, stack.effects[i].memory)


@overload(gather_from_ropes, jit_options=LINKED, strict=False)
def _compose_gathering(effects: Any, rope: Any, stack: Any) -> Any:
    lanes = _in_lanes(stack)
    calls = kernels("gather", effects, None) if lanes else kernels_by_index("gather", effects)
    lines = [f"kernel_{i}(effects[{i}], rope, stack, stack.effects[{i}].memory)" for i in calls]
    return generated("effects, rope, stack", [*lines, "return None"], calls)


@jit
def _law_at(law: Any, r: int) -> Any:
    """Return the law of rope r."""
    if law is None:
        return None
    return Table(law.knot[r], law.tension[r], law.slope[r], law.curve[r], law.bend[r])


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


class LaneStack(NamedTuple):
    """Arrays of all ropes; LANES is the last axis of all that differs from lane to lane."""

    model: Floats  # the fields of Model that the lanes have in common, (ropes, 7)
    figures: Floats  # those of each lane: OWN_FIGURES, (ropes, 4, LANES)
    nodes: Floats  # (ropes, columns, NODE_ROWS, LANES)
    s: Floats  # (ropes, columns, LANES)
    offset: Floats
    counts: Ints  # (ropes, COUNTS)
    health: Ints
    work: Floats  # (ropes, columns, chain_rows, LANES)
    sections: Floats  # (ropes, SECTION_ROWS, sections, LANES)
    effects: tuple[Any, ...]  # each array with the ropes in front and the lanes behind
    law: Any


def _widened(kind: Any, path: str) -> str:
    return f"{'wide' if kind.ndim == 2 else 'table'}({path}[r])"


@lanes_only(LINKED)
def _at(data: Any, r: Any) -> Any:
    """Return the data of rope r as wide numbers and tables."""
    if isinstance(data, types.NoneType):
        return lambda data, r: None
    scope: dict[str, Any] = {"wide": wide, "table": table}
    text = struct_text(struct_type(data), "data", scope, _widened)
    return generated("data, r", [f"return {text}"], {}, **scope)


@jit
def wide_rope_of(stack: Any, r: int) -> Any:
    """Return rope r of all lanes."""
    m, f = stack.model[r], stack.figures[r]
    return Rope(
        Model(wide(f[0]), wide(f[1]), wide(f[2]), m[3], int(m[4]), m[5], wide(f[3])),
        State(
            tiles(stack.nodes[r], NODE_ROWS),
            table(stack.s[r]),
            table(stack.offset[r]),
            stack.counts[r],
            stack.health[r],
        ),
        work_of(stack, r)[0],
        table(stack.sections[r]),
        _at(stack.effects, r),
        _at(stack.law, r),
    )


def _in_lanes(stack: Any) -> bool:
    """Return whether a numba type of stack is that of lanes."""
    return struct_type(stack).instance_class is LaneStack


# Rope r of a stack, or of all lanes.
any_rope_of = by_type(
    LaneStack,
    lambda stack, r: wide_rope_of(stack, r),
    lambda stack, r: rope_of(stack, r),
    INLINED,
)


def effects_between(stack: Any) -> Any:
    """Return the effects of a stack for those among them that act between ropes."""
    return stack.effects


@overload(effects_between, jit_options=INLINED, strict=False)
def _choose_effects(stack: Any) -> Any:
    if not _in_lanes(stack):
        return lambda stack: stack.effects
    if not kernels_by_index("interact", field_type(stack, "effects")):
        return lambda stack: ()
    return lambda stack: _at(stack.effects, 0)


def work_of(stack: Any, r: Any) -> Any:
    """Return the scratch of rope r of a stack, or of all lanes; in a tuple, as `health_of`."""
    return (stack.work[r],)


@overload(work_of, jit_options=INLINED, strict=False)
def _choose_work(stack: Any, r: Any) -> Any:
    if not _in_lanes(stack):
        return lambda stack, r: (stack.work[r],)
    if couples(effect.instance_class for effect in field_type(stack, "effects")):
        return lambda stack, r: (tiles(stack.work[r], COUPLED_CHAIN_ROWS),)
    return lambda stack, r: (tiles(stack.work[r], CHAIN_ROWS),)


# State of the nodes of rope r of a stack, or of all lanes; in a tuple, as `work_of`.
nodes_of = by_type(
    LaneStack,
    lambda stack, r: (tiles(stack.nodes[r], NODE_ROWS),),
    lambda stack, r: (stack.nodes[r],),
    INLINED,
)


# Nodes, coordinates and number of elements of rope r, and its part of `memories`.
facing_of = by_type(
    LaneStack,
    lambda stack, memories, r: (
        tiles(stack.nodes[r], NODE_ROWS),
        table(stack.s[r]),
        stack.counts[r, ELEMENTS],
        table(memories[r]),
    ),
    lambda stack, memories, r: (
        stack.nodes[r],
        stack.s[r],
        stack.counts[r, ELEMENTS],
        memories[r],
    ),
    INLINED,
)


# Tolerance of tensions of rope r of a stack, or of all lanes [N].
tolerance_at = by_type(
    LaneStack,
    lambda stack, r: wide(stack.figures[r, 3]),
    lambda stack, r: stack.model[r, TOLERANCE],
    INLINED,
)


NOWHERE = -1  # sheave of a rope without one at its upper end
# Rows of `figures`, one column per sheave:
POINT, FLOW_COLUMN = 0, 1  # columns of `joints`: of the sheave and of its flow
INTO, FROM = 2, 3  # the rope that a positive flow lengthens, and the other
SHEAVE_MASS, SHEAVE_WEIGHT = 4, 5  # [kg], in water [N]
WHEEL = 6  # inertia of the turning wheel over its radius squared [kg]
FRICTION = 7  # of the rope on the wheel: F/F' = exp(FRICTION·angle of wrap)
SHEAVE_ROWS = 8
SHEAVE_FRICTION_SPEED = 0.01  # m/s: speed at which friction is 76 % of its limit


class Sheaves(NamedTuple):
    """Sheaves of a multi-line system; in lanes LANES is the last axis, except of `of`, `side`."""

    figures: Floats  # (SHEAVE_ROWS, sheaves)
    of: Ints  # sheave at each rope's upper end, or NOWHERE
    side: Floats  # of each rope: 1 if a positive flow lengthens it, -1 if it shortens it
    base: Floats  # length of each rope at zero flow [m]
    way: Floats  # scratch: B of each rope's last node, (3, ropes)
    borders: Boundary  # scratch: the last node's motion as of a hang-off, (2·ropes, MOTIONS)
