"""Effects that remember: numbers of their own at the nodes, carried from step to step.

The phase of the vortices at a node, or the wake behind it, has an equation of motion of its own. It
is not lagged by a step: an effect solves it at each node for the node's acceleration, inside the
stage, and hands its part of the derivative to the node's block.

Such an effect is a NamedTuple with a field `memory`, rows by columns, a column a node of the rope
(0: the lower end) and a spare one. It says `remembering(Type, k)`: k numbers are carried on. Their
rows are

    0 ... k-1       now, at the end of the last accepted substep
    k ... 2k-1      at the end of the stage that `settle` was last called for
    2k ... 3k-1     at the start of a step that is halved, should it fail
    3k              material coordinate of the node [m]

and any further rows are the effect's own. Its kernels, registered as those of `hooks`:

- `start(effect, rope)`: the numbers at time 0, where the rope rests: rows 0 ... k-1.
- `predict(effect, rope, stage, kind, low, high)`: before a stage's first loads, of the nodes
  low <= i < high, when position, velocity and water are predicted. kind: TRAPEZOID or BDF2.
- `load_nodes(effect, work, stage, low, high)`: adds to residual and blocks of nodes whose TANGENT
  is given; also of the trial nodes at the end of the arrays (p = 1, q = 0: nothing moves there).
- `settle(effect, rope, stage, kind)`: the stage is solved; rows k ... 2k-1 = its numbers.

When elements split, merge or are regridded the numbers are interpolated over the rope's material.
A rope without such an effect has no trace of all this in its code.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numba.extending import overload

from rope_twin.core.acting.hooks import kernel_of, kernels_by_place, written_out
from rope_twin.core.jit.decorators import LINKED, jit
from rope_twin.core.solve.prediction import correct
from rope_twin.core.state import ELEMENTS, ZERO

_REMEMBERED: dict[type, int] = {}


def remembering(effect: type, count: int) -> None:
    """Say that an effect carries `count` numbers per node on.

    Raises:
        ValueError: it has no memory, or has said so already.
    """
    if "memory" not in getattr(effect, "_fields", ()):
        raise ValueError(f"{effect.__name__} has no field 'memory' to remember in")
    if effect in _REMEMBERED:
        raise ValueError(f"{effect.__name__} remembers already")
    _REMEMBERED[effect] = count


def remembers(kinds: Iterable[type]) -> bool:
    """Whether one of these types of effects remembers."""
    return any(kind in _REMEMBERED for kind in kinds)


def numbers_carried(kind: type) -> int:
    """How many numbers an effect of this type carries on at each node; 0: it does not remember."""
    return _REMEMBERED.get(kind, 0)


def new_memory(count: int, own: int, room: int) -> Any:
    """Memory for `count` numbers carried on and `own` rows of the effect, for `room` nodes."""
    return np.zeros((3 * count + 1 + own, room + 1))


@jit
def _carry_over(memory: Any, state: Any, k: int) -> None:
    """Numbers of the nodes that the rope has now, if it has others than when last asked."""
    n, last = state.counts[ELEMENTS], memory.shape[1] - 1
    old = int(memory[3 * k, last])
    if n == old:
        return
    marks, j = memory[3 * k], 0
    for i in range(n):
        s = state.s[i]
        while j < old - 2 and marks[j + 1] <= s:
            j += 1
        share = min(max((s - marks[j]) / (marks[j + 1] - marks[j]), 0.0), 1.0)
        for r in range(k):
            memory[k + r, i] = (1.0 - share) * memory[r, j] + share * memory[r, j + 1]
    _copy(memory, k, ZERO, k, n)
    _mark(memory, state, k)


@jit
def _mark(memory: Any, state: Any, k: int) -> None:
    """These are the nodes."""
    n = state.counts[ELEMENTS]
    for i in range(n):
        memory[3 * k, i] = state.s[i]
    memory[3 * k, memory.shape[1] - 1] = n


@jit
def _copy(memory: Any, source: int, target: int, k: int, n: int) -> None:
    """Rows source ... of the nodes 0 <= i < n to rows target ..."""
    for r in range(k):
        a, b = memory[source + r], memory[target + r]
        for i in range(n):
            b[i] = a[i]


@jit
def _keep(memory: Any, state: Any, k: int) -> None:
    """Now is the start of a step."""
    _copy(memory, ZERO, 2 * k, k, state.counts[ELEMENTS])


@jit
def _take(memory: Any, state: Any, k: int) -> None:
    """What the stage left is now."""
    _copy(memory, k, ZERO, k, state.counts[ELEMENTS])


@jit
def _return(memory: Any, state: Any, k: int) -> None:
    """Back to the start of the step."""
    _copy(memory, 2 * k, ZERO, k, state.counts[ELEMENTS])


def _said(effects: Any) -> list[tuple[Any, int]]:
    """The effects that remember, with how much (plain Python)."""
    return [(own, _REMEMBERED[type(own)]) for own in effects if type(own) in _REMEMBERED]


def _counts(effects: Any) -> dict[int, int]:
    """How much each effect that remembers carries on, by its place (of numba's types)."""
    kinds = [effect.instance_class for effect in effects]
    return {i: _REMEMBERED[kind] for i, kind in enumerate(kinds) if kind in _REMEMBERED}


def _for_each(
    head: str, effects: Any, line: str, hook: str = "", result: str = "None", **names: Any
) -> Any:
    """The function of this line for every effect that remembers; # stands for its place."""
    counts = _counts(effects)
    calls = {i: call for i, call in kernels_by_place(hook, effects).items() if i in counts}
    names |= {f"k_{i}": np.int64(k) for i, k in counts.items()}
    lines = [line.replace("#", str(i)) for i in counts]
    return written_out(head, [*lines, f"return {result}"], calls, **names)


def begin_step(effects: Any, rope: Any, time: Any) -> Any:
    """A step begins: at time 0 every memory starts anew, else it is that of the nodes there are."""
    for effect, k in _said(effects):
        if time == 0.0:
            kernel_of("start", type(effect))(effect, rope)
            _mark(effect.memory, rope.state, k)
        else:
            _carry_over(effect.memory, rope.state, k)


@overload(begin_step, jit_options=LINKED, strict=False)
def _compose_begin(effects: Any, rope: Any, time: Any) -> Any:
    line = (
        "if time == 0.0:\n        kernel_#(effects[#], rope)\n"
        "        mark(effects[#].memory, rope.state, k_#)\n"
        "    else:\n        carry(effects[#].memory, rope.state, k_#)"
    )
    names = {"carry": _carry_over, "mark": _mark}
    return _for_each("effects, rope, time", effects, line, "start", **names)


def keep_memories(effects: Any, state: Any) -> Any:
    """The first part of a step that was halved is accepted: keep the step's start."""
    for effect, k in _said(effects):
        _keep(effect.memory, state, k)


@overload(keep_memories, jit_options=LINKED, strict=False)
def _compose_keep(effects: Any, state: Any) -> Any:
    line = "keep(effects[#].memory, state, k_#)"
    return _for_each("effects, state", effects, line, keep=_keep)


def predict_memories(effects: Any, rope: Any, stage: Any, kind: Any, low: Any, high: Any) -> Any:
    """A stage begins for the nodes low <= i < high: position, velocity and water are predicted."""
    for effect, _ in _said(effects):
        kernel_of("predict", type(effect))(effect, rope, stage, kind, low, high)


@overload(predict_memories, jit_options=LINKED, strict=False)
def _compose_predict(effects: Any, rope: Any, stage: Any, kind: Any, low: Any, high: Any) -> Any:
    line = "kernel_#(effects[#], rope, stage, kind, low, high)"
    return _for_each("effects, rope, stage, kind, low, high", effects, line, "predict")


@jit
def _complete(rope: Any, stage: Any, pending: float) -> float:
    """The stage's motion, whole; nothing is pending then."""
    n, first = rope.state.counts[ELEMENTS], rope.model.first_free
    if pending != 0.0:
        correct(rope.work, stage.p, stage.q, pending, first, n)
    return 0.0


def settle_memories(effects: Any, rope: Any, stage: Any, kind: Any, pending: Any) -> Any:
    """A stage is solved; who remembers wants its motion whole. Returns what is pending after."""
    for effect, _ in _said(effects):
        pending = _complete(rope, stage, pending)
        kernel_of("settle", type(effect))(effect, rope, stage, kind)
    return pending


@overload(settle_memories, jit_options=LINKED, strict=False)
def _compose_settle(effects: Any, rope: Any, stage: Any, kind: Any, pending: Any) -> Any:
    line = "pending = complete(rope, stage, pending)\n    kernel_#(effects[#], rope, stage, kind)"
    head = "effects, rope, stage, kind, pending"
    return _for_each(head, effects, line, "settle", "pending", complete=_complete)


def accept_memories(effects: Any, state: Any) -> Any:
    """A substep is accepted."""
    for effect, k in _said(effects):
        _take(effect.memory, state, k)


@overload(accept_memories, jit_options=LINKED, strict=False)
def _compose_accept(effects: Any, state: Any) -> Any:
    line = "take(effects[#].memory, state, k_#)"
    return _for_each("effects, state", effects, line, take=_take)


def return_memories(effects: Any, state: Any) -> Any:
    """A step failed: back to its start."""
    for effect, k in _said(effects):
        _return(effect.memory, state, k)


@overload(return_memories, jit_options=LINKED, strict=False)
def _compose_return(effects: Any, state: Any) -> Any:
    line = "back(effects[#].memory, state, k_#)"
    return _for_each("effects, state", effects, line, back=_return)
