"""Internal variables and active sets of effects in a SIMD batch (core/loads/memory, balance).

Effects whose kernels are wide have the memories of all lanes in one table; those called for each
lane in turn (core/lanes/by_lane) have each lane's own. A step that initialises internal variables,
or interpolates them to other nodes, is left to the single-rope solver (`Group.late`).
"""

from __future__ import annotations

from typing import Any

from numba.extending import overload

from rope_twin.core.integrator import correct
from rope_twin.core.jit.decorators import LINKED, jit
from rope_twin.core.jit.wide import LANES, choose, mask_of
from rope_twin.core.lanes.by_lane import is_by_lane, on_lanes
from rope_twin.core.loads.hooks import kernels, may_be_calm, written_out
from rope_twin.core.loads.memory import numbers_carried
from rope_twin.core.state import ELEMENTS


def _counts(effects: Any) -> dict[int, int]:
    """Return the number of internal variables of effects that have them, by index (numba types)."""
    found = {i: numbers_carried(one.instance_class) for i, one in enumerate(effects)}
    return {i: k for i, k in found.items() if k > 0}


def calm_lanes(effects: Any, work: Any, stage: Any, n: Any, share: Any) -> Any:
    """Return the stage's lanes, as bits, in which no active set is changed by share·delta.

    As in a single rope, an effect is only asked where those before it are calm.
    """
    raise TypeError("lanes exist in compiled code only")


@overload(calm_lanes, jit_options=LINKED, strict=False)
def _compose_calm(effects: Any, work: Any, stage: Any, n: Any, share: Any) -> Any:
    calls = kernels("calm", effects, None)
    lines = ["calm = stage.lanes"]
    if not may_be_calm([effect.instance_class for effect in effects]):
        return lambda effects, work, stage, n, share: 0
    for i in calls:
        own = f"kernel_{i}(effects[{i}], work, on_lanes(stage, calm), n, share)"
        lines.append(f"calm &= {own}")
    head = "effects, work, stage, n, share"
    return written_out(head, [*lines, "return calm"], calls, on_lanes=on_lanes)


def predict_lanes(effects: Any, rope: Any, stage: Any, kind: Any, low: Any, high: Any) -> Any:
    """Predict internal variables at the beginning of a stage, for the nodes low <= i < high."""
    raise TypeError("lanes exist in compiled code only")


@overload(predict_lanes, jit_options=LINKED, strict=False)
def _compose_predict(effects: Any, rope: Any, stage: Any, kind: Any, low: Any, high: Any) -> Any:
    calls = kernels("predict", effects, None)
    lines = [f"kernel_{i}(effects[{i}], rope, stage, kind, low, high)" for i in _counts(effects)]
    head = "effects, rope, stage, kind, low, high"
    return written_out(head, [*lines, "return None"], calls)


@jit
def _complete(rope: Any, stage: Any, pending: Any) -> Any:
    """Apply the pending correction to the stage's motion; return 0, the fraction still pending."""
    n = rope.state.counts[ELEMENTS]
    correct(rope.work, stage.p, stage.q, pending, rope.model.first_free, n)
    return 0.0 * pending


def settle_lanes(effects: Any, rope: Any, stage: Any, kind: Any, pending: Any) -> Any:
    """Update internal variables after a stage; return the pending correction."""
    raise TypeError("lanes exist in compiled code only")


@overload(settle_lanes, jit_options=LINKED, strict=False)
def _compose_settle(effects: Any, rope: Any, stage: Any, kind: Any, pending: Any) -> Any:
    calls, counts = kernels("settle", effects, None), _counts(effects)
    lines = ["pending = complete(rope, stage, pending)"] if counts else []
    lines.append("n = rope.state.counts[0]")
    lines += [f"kernel_{i}(effects[{i}], rope, stage, kind, n)" for i in counts]
    head = "effects, rope, stage, kind, pending"
    return written_out(head, [*lines, "return pending"], calls, complete=_complete)


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


def accept_lanes(effects: Any, each: Any, n: Any, kept: Any) -> Any:
    """Accept the internal variables of a step, in the lanes `kept`."""
    raise TypeError("lanes exist in compiled code only")


@overload(accept_lanes, jit_options=LINKED, strict=False)
def _compose_accept(effects: Any, each: Any, n: Any, kept: Any) -> Any:
    lines = []
    for i, k in _counts(effects).items():
        if is_by_lane(effects[i].instance_class):
            lines.append(f"take_each(each.effects[{i}].memory, {k}, n, kept)")
        else:
            lines.append(f"take_wide(effects[{i}].memory, {k}, n, kept)")
    names = {"take_wide": _take_wide, "take_each": _take_each}
    return written_out("effects, each, n, kept", [*lines, "return None"], {}, **names)
