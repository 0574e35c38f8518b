"""Kernels of a single rope, called for each lane of a batch in turn.

What happens at the lower end alone (a rigid body, a payload that sheds vortices) branches, and
costs little beside the nodes of the rope; waves are summed over their components in SIMD already.
`by_lane` lets such an effect take part in a batch with its own kernels: the columns that they read
are copied to the scratch of one rope, and what they change is copied back.

An effect at the lower end reads node 0, the hang-off and one ghost node, and changes residual and
block of node 0; `flow` reads positions and changes water and surface of a span of nodes.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple

from numba.extending import overload

from rope_twin.core.jit.decorators import LINKED, jit, jit_within
from rope_twin.core.jit.wide import LANES
from rope_twin.core.lanes.layout import lane_data, place_of
from rope_twin.core.loads.hooks import kernel_of, register_wide
from rope_twin.core.payout import LOW
from rope_twin.core.state import (
    BLOCK,
    ELEMENTS,
    FLOW,
    FLOW_RATE,
    KEPT,
    POSITION,
    RESIDUAL,
    SURFACE,
    WORK_ROWS,
    Floats,
    Ints,
    LaneStage,
    Model,
    Rope,
    Stage,
    State,
)

LOWER_END = ("load_end", "calm", "predict", "settle")  # hooks of an effect at the lower end
_BY_LANE: set[type] = set()


class Each(NamedTuple):
    """Data of the lanes for kernels of a single rope."""

    work: Floats  # scratch of the batch, (columns, WORK_ROWS, LANES)
    own: Floats  # scratch of one rope, (WORK_ROWS, columns)
    s: Floats  # not read by these kernels, (columns,)
    counts: Ints
    health: Ints
    tolerance: Floats  # (LANES,)
    sections: Floats  # (LANES, SECTION_ROWS, sections)
    effects: tuple[Any, ...]  # their arrays with the lanes on the first axis


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
    """Copy all rows but those of the factors to the scratch of one rope."""
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


@jit
def _return_water(each: Any, lane: int, low: int, high: int) -> None:
    for i in range(low, high):
        for k in range(3):
            each.work[i, FLOW + k, lane] = each.own[FLOW + k, i]
            each.work[i, FLOW_RATE + k, lane] = each.own[FLOW_RATE + k, i]
        each.work[i, SURFACE, lane] = each.own[SURFACE, i]


def _picker(kind: type) -> Any:
    """Return the kernel that gives the data of an effect of this type in one lane."""

    def pick(effects: Any, lane: Any) -> Any:
        raise TypeError("lanes exist in compiled code only")

    @overload(pick, jit_options={**LINKED, "forceinline": True}, strict=False)
    def choose_place(effects: Any, lane: Any) -> Any:
        i = place_of(kind, effects)
        return lambda effects, lane: lane_data(effects[i], lane)

    return pick


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
    pick = _picker(kind)

    def load_end(effect: Any, work: Any, stage: Any) -> None:
        each = stage.each
        for lane in range(LANES):
            if stage.lanes >> lane & 1:
                _copy_ends(each, lane)
                lone(pick(each.effects, lane), each.own, _lone_stage(stage))
                _return_loads(each, lane)

    return load_end


def _calm(kind: type, lone: Any) -> Any:
    pick = _picker(kind)

    def calm(effect: Any, work: Any, stage: Any, n: int, share: float) -> int:
        each, found = stage.each, 0
        for lane in range(LANES):
            if stage.lanes >> lane & 1:
                _copy_ends(each, lane)
                if lone(pick(each.effects, lane), each.own, _lone_stage(stage), n, share):
                    found |= 1 << lane
        return found

    return calm


def _predict(kind: type, lone: Any) -> Any:
    pick = _picker(kind)

    def predict(effect: Any, rope: Any, stage: Any, kind: int, low: int, high: int) -> None:
        each = stage.each
        if low > 0:
            return
        for lane in range(LANES):
            if stage.lanes >> lane & 1:
                _copy_ends(each, lane)
                own = _lone_rope(stage, lane)
                lone(pick(each.effects, lane), own, _lone_stage(stage), kind, low, high)

    return predict


def _settle(kind: type, lone: Any) -> Any:
    pick = _picker(kind)

    def settle(effect: Any, rope: Any, stage: Any, kind: int, upto: int) -> None:
        each = stage.each
        for lane in range(LANES):
            if stage.lanes >> lane & 1:
                _copy_ends(each, lane)
                own = _lone_rope(stage, lane)
                lone(pick(each.effects, lane), own, _lone_stage(stage), kind, upto)

    return settle


_CALLS = {
    "flow": _flow, "load_end": _load_end, "calm": _calm, "predict": _predict, "settle": _settle,
}  # fmt: skip


def by_lane(kind: type, *names: str) -> None:
    """Let the kernels of an effect's type for these hooks be called for each lane in turn.

    Raises:
        KeyError: it has no such kernel, or lanes cannot call kernels of this hook one by one.
    """
    _BY_LANE.add(kind)
    for hook in names:
        register_wide(hook, kind, jit(_CALLS[hook](kind, kernel_of(hook, kind))))
