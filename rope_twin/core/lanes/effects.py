"""Effects and laws of a SIMD batch: their data, kernels for each lane, internal variables.

An effect is a NamedTuple of numbers, arrays and further tuples. For a batch each of them gets an
axis of lanes: the last one for SIMD vectors and their tables, the first one for kernels that are
called for each lane in turn, which then see the arrays of a single rope.

**Kernels of a single rope** are called lane by lane where SIMD has no benefit: loads at the lower
end (a net, a fairing) branch and cost little compared with the nodes of the rope, and sums over
wave components are vectorised already. `by_lane` registers such an effect for batches with its
scalar kernels: the columns that they read are copied to the work array of one rope, and their
results are copied back. A rigid body costs more than its rope and is solved in all lanes together
(core/body/lanes).

An effect at the lower end reads node 0, the hang-off and one ghost node, and changes residual and
block of node 0; `flow` reads positions and changes water and surface of a span of nodes.

**Internal variables** (core/loads/memory). Effects whose kernels are wide have the memories of all
lanes in one table; those called lane by lane have one array per lane. A step that initialises
internal variables, or interpolates them to other nodes, is taken by the single-rope solver
(`Lanes.advance`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from math import prod
from typing import Any, NamedTuple

import numpy as np
from numba import types

from rope_twin.core.jit.decorators import INLINED, LINKED, jit, jit_within
from rope_twin.core.jit.functions import by_type, lanes_only
from rope_twin.core.jit.wide import ALIGNMENT, LANES, choose, mask_of, table, wide
from rope_twin.core.loads.hooks import (
    RampedEffects,
    can_report_unchanged,
    generated,
    kernel_of,
    kernels,
    kernels_by_index,
    register_wide,
    struct_text,
)
from rope_twin.core.loads.memory import counts_carried
from rope_twin.core.state import (
    BLOCK,
    ELEMENTS,
    FLOW,
    FLOW_RATE,
    KEPT,
    LENGTH,
    LOW,
    POSITION,
    RESIDUAL,
    SURFACE,
    VOLUME,
    WORK_ROWS,
    Floats,
    Ints,
    LaneStage,
    Model,
    Rope,
    Stage,
    State,
)


def aligned(*shape: int) -> Floats:
    """Return zeros of this shape, aligned so that each SIMD vector lies in one cache line."""
    size = prod(shape)
    raw = np.zeros(size + ALIGNMENT // 8)
    first = -raw.ctypes.data % ALIGNMENT // 8
    return raw[first : first + size].reshape(shape)


def layout_of(value: Any) -> Any:
    """Return types and shapes of a NamedTuple's parts, in tuples that can be compared."""
    if isinstance(value, tuple):
        return (type(value), *(layout_of(part) for part in value))
    layout = np.asarray(value)
    return layout.dtype.str, layout.shape


def make_wide(layout: Any, lead: tuple[int, ...]) -> Any:
    """Return zeros in the layout with the axes `lead` in front and the lanes on the last axis."""
    return make(layout, lambda kind, shape: aligned(*lead, *shape, LANES))


def make_lane_data(layout: Any, lead: tuple[int, ...]) -> Any:
    """Return zeros in the layout with the axes `lead` and the lanes in front."""
    return make(layout, lambda kind, shape: np.zeros((*lead, LANES, *shape), kind))


def make(layout: Any, zeros: Callable[[str, tuple[int, ...]], Any]) -> Any:
    kind, *parts = layout
    if isinstance(kind, str):
        return zeros(kind, parts[0])
    result = [make(part, zeros) for part in parts]
    return tuple(result) if kind is tuple else kind(*result)


def put_wide(target: Any, source: Any, lane: int) -> None:
    """Copy the parts of one rope's data to its lane on the last axis."""
    for field, value in zip(target, source, strict=True):
        if isinstance(field, tuple):
            put_wide(field, value, lane)
        else:
            field[..., lane] = value


def put_lane_data(target: Any, source: Any, lane: int) -> None:
    """Copy the parts of one rope's data to its lane on the first axis."""
    for field, value in zip(target, source, strict=True):
        if isinstance(field, tuple):
            put_lane_data(field, value, lane)
        else:
            field[lane] = value


def _widened(kind: Any, path: str) -> str:
    if kind.ndim > 3:
        return path  # no kernel of lanes reads it
    return f"{'wide' if kind.ndim == 1 else 'table'}({path})"


@lanes_only(LINKED)
def wide_data(data: Any) -> Any:
    """Return a struct of arrays (last axis LANES), or several, as SIMD vectors and tables."""
    if isinstance(data, types.NoneType):
        return lambda data: None
    scope: dict[str, Any] = {"wide": wide, "table": table}
    text = struct_text(data, "data", scope, _widened)
    return generated("data", [f"return {text}"], {}, **scope)


@lanes_only(INLINED)
def lane_data(data: Any, lane: Any) -> Any:
    """Return the data of one lane of a struct of arrays (first axis LANES), or of several."""
    scope: dict[str, Any] = {}
    text = struct_text(data, "data", scope, lambda kind, path: f"{path}[lane]")
    return generated("data, lane", [f"return {text}"], {}, **scope)


def place_of(kind: type, effects: Iterable[Any]) -> int:
    """Return the index of an effect's type among numba types of effects."""
    return [effect.instance_class for effect in effects].index(kind)


LOWER_END = ("load_end", "unchanged", "predict", "settle")  # hooks of an effect at the lower end
_BY_LANE: set[type] = set()


class LaneData(NamedTuple):
    """Data of the lanes for kernels of a single rope."""

    work: Floats  # scratch of the batch, (columns, WORK_ROWS, LANES)
    own: Floats  # scratch of one rope, (WORK_ROWS, columns)
    s: Floats  # not read by these kernels, (columns,)
    counts: Ints
    health: Ints
    tolerance: Floats  # (LANES,)
    sections: Floats  # (LANES, SECTION_ROWS, sections)
    effects: tuple[Any, ...]  # their arrays with the lanes on the first axis


class SystemLaneData(NamedTuple):
    """Data of the lanes of a system for kernels of a single rope; arrays have the ropes in front.

    Scratch of one rope is shared by all.
    """

    work: Floats  # (ropes, columns, rows, LANES)
    own: Floats  # (WORK_ROWS, columns)
    s: Floats  # (columns,)
    counts: Ints
    health: Ints
    tolerance: Floats  # (ropes, LANES)
    sections: Floats  # (ropes, LANES, SECTION_ROWS, sections)
    effects: tuple[Any, ...]  # their arrays with ropes and lanes in front


@jit_within
def _of_rope(each: Any, r: int) -> Any:
    return LaneData(
        each.work[r],
        each.own,
        each.s,
        each.counts[r],
        each.health[r],
        each.tolerance[r],
        each.sections[r],
        lane_data(each.effects, r),
    )


# The lane data of rope r of a system; for a single rope the argument itself.
each_of = by_type(
    SystemLaneData,
    lambda each, r: _of_rope(each, r),
    lambda each, r: each,
)


def is_by_lane(kind: type) -> bool:
    """Return whether an effect's kernels are called for each lane in turn."""
    return kind in _BY_LANE


def any_by_lane(kinds: Iterable[type]) -> bool:
    """Return whether one of these effects has a kernel that is called for each lane in turn."""
    return any(kind in _BY_LANE for kind in kinds)


@jit_within
def on_lanes(stage: Any, lanes: int) -> Any:
    """Return the stage of these lanes only."""
    return LaneStage(stage.time, stage.p, stage.q, stage.V, lanes, stage.each)


@jit_within
def _lone_stage(stage: Any) -> Any:
    return Stage(stage.time, stage.p, stage.q, 0.0)


@jit_within
def _lone_rope(stage: Any, lane: int) -> Any:
    """Return the rope of a lane, for kernels at its lower end."""
    each = stage.each
    state = State(each.own, each.s, each.s, each.counts, each.health)
    model = Model(0.0, 0.0, 0.0, 0.0, 0, 0.0, each.tolerance[lane])
    effects = lane_data(each.effects, lane)
    return Rope(model, state, each.own, each.sections[lane], effects, None)


@jit
def _copy_column(each: Any, lane: int, i: int) -> None:
    """Copy all rows except the factors to the work array of one rope."""
    for k in range(BLOCK + 6):
        each.own[k, i] = each.work[i, k, lane]
    for k in range(BLOCK + 24, KEPT):
        each.own[k, i] = each.work[i, k, lane]
    for k in range(FLOW_RATE, WORK_ROWS):
        each.own[k, i] = each.work[i, k, lane]


@jit
def _copy_ends(each: Any, lane: int) -> None:
    _copy_column(each, lane, 0)
    _copy_column(each, lane, each.counts[ELEMENTS])
    _copy_column(each, lane, each.s.shape[0] + LOW)


@jit
def _return_loads(each: Any, lane: int) -> None:
    for k in range(3):
        each.work[0, RESIDUAL + k, lane] = each.own[RESIDUAL + k, 0]
    for k in range(6):
        each.work[0, BLOCK + k, lane] = each.own[BLOCK + k, 0]


@jit
def _copy_positions(each: Any, lane: int, low: int, high: int) -> None:
    for i in range(low, high):
        for k in range(3):
            each.own[POSITION + k, i] = each.work[i, POSITION + k, lane]
            each.own[FLOW + k, i] = each.work[i, FLOW + k, lane]
        each.own[LENGTH, i] = each.work[i, LENGTH, lane]
        each.own[VOLUME, i] = each.work[i, VOLUME, lane]


@jit
def _return_water(each: Any, lane: int, low: int, high: int) -> None:
    for i in range(low, high):
        for k in range(3):
            each.work[i, FLOW + k, lane] = each.own[FLOW + k, i]
            each.work[i, FLOW_RATE + k, lane] = each.own[FLOW_RATE + k, i]
        each.work[i, SURFACE, lane] = each.own[SURFACE, i]


def _picker(kind: type) -> Any:
    """Return the kernel that extracts the data of an effect of this type in one lane."""

    @lanes_only(INLINED)
    def pick(effects: Any, lane: Any) -> Any:
        i = place_of(kind, effects)
        return lambda effects, lane: lane_data(effects[i], lane)

    return pick


def _grown_picker(kind: type) -> Any:
    """Return the kernel that extracts an effect's data in one lane, grown to the stage's time."""
    pick = _picker(kind)

    @lanes_only(INLINED)
    def grow(effects: Any, stage: Any) -> Any:
        growth = RampedEffects(effects)
        lines = [*growth.lines, f"return {growth.of(place_of(kind, effects))}"]
        return generated("effects, stage", lines, {}, **growth.names)

    @lanes_only(INLINED)
    def pick_grown(effects: Any, lane: Any, stage: Any) -> Any:
        if kernels_by_index("share", effects):
            return lambda effects, lane, stage: grow(lane_data(effects, lane), stage)
        return lambda effects, lane, stage: pick(effects, lane)

    return pick_grown


def _flow(kind: type, lone: Any) -> Any:
    pick = _picker(kind)

    def flow(effect: Any, work: Any, stage: Any, low: int, high: int) -> None:
        each = stage.each
        for lane in range(LANES):
            if stage.lanes >> lane & 1:
                _copy_positions(each, lane, low, high)
                lone(pick(each.effects, lane), each.own, _lone_stage(stage), low, high)
                _return_water(each, lane, low, high)

    return flow


def _load_end(kind: type, lone: Any) -> Any:
    pick = _grown_picker(kind)

    def load_end(effect: Any, work: Any, stage: Any) -> None:
        each = stage.each
        for lane in range(LANES):
            if stage.lanes >> lane & 1:
                _copy_ends(each, lane)
                lone(pick(each.effects, lane, stage), each.own, _lone_stage(stage))
                _return_loads(each, lane)

    return load_end


def _unchanged(kind: type, lone: Any) -> Any:
    pick = _picker(kind)

    def unchanged(effect: Any, work: Any, stage: Any, n: int, share: float) -> int:
        each, lanes = stage.each, 0
        for lane in range(LANES):
            if stage.lanes >> lane & 1:
                _copy_ends(each, lane)
                if lone(pick(each.effects, lane), each.own, _lone_stage(stage), n, share):
                    lanes |= 1 << lane
        return lanes

    return unchanged


def _predict(kind: type, lone: Any) -> Any:
    pick = _picker(kind)

    def predict(effect: Any, rope: Any, stage: Any, kind: int, low: int, high: int) -> None:
        each = stage.each
        if low > 0:
            return
        for lane in range(LANES):
            if stage.lanes >> lane & 1:
                _copy_ends(each, lane)
                lone_rope = _lone_rope(stage, lane)
                lone(pick(each.effects, lane), lone_rope, _lone_stage(stage), kind, low, high)

    return predict


def _settle(kind: type, lone: Any) -> Any:
    pick = _picker(kind)

    def settle(effect: Any, rope: Any, stage: Any, kind: int, upto: int) -> None:
        each = stage.each
        for lane in range(LANES):
            if stage.lanes >> lane & 1:
                _copy_ends(each, lane)
                lone_rope = _lone_rope(stage, lane)
                lone(pick(each.effects, lane), lone_rope, _lone_stage(stage), kind, upto)

    return settle


_CALLS = {
    "flow": _flow, "load_end": _load_end, "unchanged": _unchanged,
    "predict": _predict, "settle": _settle,
}  # fmt: skip


def by_lane(kind: type, *names: str) -> None:
    """Register the scalar kernels of an effect's type for these hooks, to be called lane by lane.

    Raises:
        KeyError: it has no such kernel, or lanes cannot call kernels of this hook one by one.
    """
    _BY_LANE.add(kind)
    for hook in names:
        register_wide(hook, kind, jit(_CALLS[hook](kind, kernel_of(hook, kind))))


@lanes_only(LINKED)
def unchanged_lanes(effects: Any, work: Any, stage: Any, n: Any, fraction: Any) -> Any:
    """Return the stage's lanes, as bits, in which no active set is changed by share·delta.

    As in a single rope, an effect is evaluated only where the active sets before it are unchanged.
    """
    calls = kernels("unchanged", effects, None)
    lines = ["unchanged = stage.lanes"]
    if not can_report_unchanged([effect.instance_class for effect in effects]):
        return lambda effects, work, stage, n, fraction: 0
    for i in calls:
        lanes_stage = f"kernel_{i}(effects[{i}], work, on_lanes(stage, unchanged), n, share)"
        lines.append(f"unchanged &= {lanes_stage}")
    head = "effects, work, stage, n, share"
    return generated(head, [*lines, "return unchanged"], calls, on_lanes=on_lanes)


@jit
def _take_wide(memory: Any, k: int, n: int, kept: int) -> None:
    """Make the values of the last stage the current ones, in the lanes `kept`."""
    mask = mask_of(kept)
    for r in range(k):
        a, b = memory[k + r], memory[r]
        for i in range(n):
            b[i] = choose(mask, a[i], b[i])


@jit
def _take_each(memory: Any, k: int, n: int, kept: int) -> None:
    for lane in range(LANES):
        if kept >> lane & 1:
            for r in range(k):
                for i in range(n):
                    memory[lane, r, i] = memory[lane, k + r, i]


@lanes_only(LINKED)
def accept_lanes(effects: Any, each: Any, n: Any, kept: Any) -> Any:
    """Accept the internal variables of a step, in the lanes `kept`."""
    lines = []
    for i, k in counts_carried(effects).items():
        if is_by_lane(effects[i].instance_class):
            lines.append(f"take_each(each.effects[{i}].memory, {k}, n, kept)")
        else:
            lines.append(f"take_wide(effects[{i}].memory, {k}, n, kept)")
    names = {"take_wide": _take_wide, "take_each": _take_each}
    return generated("effects, each, n, kept", [*lines, "return None"], {}, **names)
