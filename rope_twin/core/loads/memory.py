"""Internal (history) variables of effects at the nodes, carried from step to step.

The phase of vortex shedding at a node, or its wake, has its own equation of motion. It is coupled
implicitly: within the stage an effect solves it at each node for the node's acceleration, and adds
its derivative to the node's block.

Such an effect is a NamedTuple with a field `memory`, rows by columns, one column per node of the
rope (0: the lower end) and a spare one. It calls
`declare_internal_variables(Type, k)`: k numbers are carried over. Their rows are

    0 ... k-1       current values, at the end of the last accepted substep
    k ... 2k-1      at the end of the stage that `settle` was last called for
    2k ... 3k-1     at the start of a step that is divided into substeps, to restore it
    3k              material coordinate of the node [m]

and any further rows are the effect's own. Its kernels, registered like those of `hooks`:

- `start(effect, rope, upto)`: the values at time 0, in static equilibrium: rows 0 ... k-1 of the
  nodes below `upto`, which are those that carry loads.
- `predict(effect, rope, stage, kind, low, high)`: before a stage's first loads, of the nodes
  low <= i < high, when position, velocity and water are predicted. kind: TRAPEZOID or BDF2.
- `load_nodes(effect, work, stage, low, high)`: adds to residual and blocks of nodes whose TANGENT
  is given; also of the ghost nodes at the end of the arrays (p = 1, q = 0: nothing moves there).
- `settle(effect, rope, stage, kind, upto)`: after a converged stage; rows k ... 2k-1 = its values.

When elements split, merge or are regridded the values are interpolated over the material
coordinate.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numba.extending import overload

from rope_twin.core.integrator import correct
from rope_twin.core.jit.decorators import LINKED, jit
from rope_twin.core.jit.functions import anywhere
from rope_twin.core.loads.hooks import (
    RampedEffects,
    calls_of,
    generated,
    kernel_of,
    kernels_at,
    kernels_by_index,
    ramped,
    selected_by,
)
from rope_twin.core.state import ELEMENTS, ZERO, Rope, Stage, State

_VARIABLE_COUNTS: dict[type, int] = {}
_CARRIED_ARRAYS: dict[type, tuple[str, ...]] = {}


def declare_internal_variables(effect: type, count: int, *arrays: str) -> None:
    """Declare that an effect carries `count` internal variables per node.

    arrays: further fields whose numbers change from step to step.

    Raises:
        ValueError: it has no field `memory`, or was declared before.
    """
    if "memory" not in getattr(effect, "_fields", ()):
        raise ValueError(f"{effect.__name__} has no field 'memory' for its internal variables")
    if effect in _VARIABLE_COUNTS:
        raise ValueError(f"{effect.__name__} has declared its internal variables already")
    _VARIABLE_COUNTS[effect] = count
    _CARRIED_ARRAYS[effect] = arrays


def carried_arrays(kind: type) -> tuple[str, ...]:
    """Return the fields besides `memory` whose numbers change from step to step."""
    return _CARRIED_ARRAYS.get(kind, ())


def have_internal_variables(kinds: Iterable[type]) -> bool:
    """Return whether one of these types of effects has internal variables."""
    return any(kind in _VARIABLE_COUNTS for kind in kinds)


# Whether one of these effects has internal variables.
has_internal_variables = selected_by(
    have_internal_variables, lambda effects: True, lambda effects: False
)


def variable_count(kind: type) -> int:
    """Return the number of internal variables per node of an effect of this type; 0: none."""
    return _VARIABLE_COUNTS.get(kind, 0)


def new_memory(count: int, own_rows: int, room: int) -> Any:
    """Return memory for `count` internal variables, `own_rows` further rows and `room` nodes."""
    return np.zeros((3 * count + 1 + own_rows, room + 1))


def count_initialised(effect: Any) -> int:
    """Return the number of nodes with internal variables of an effect.

    These are all nodes except a hang-off.
    """
    return int(effect.memory[3 * _VARIABLE_COUNTS[type(effect)], -1])


def reset_internal_variables(effects: Any) -> None:
    """Set internal variables to zero for a static solution.

    They would grow without bound in its long steps.
    """
    for effect, _ in _with_variables(effects):
        effect.memory[...] = 0.0


@jit
def _carry_over(memory: Any, state: State, k: int, n: int) -> None:
    """Interpolate the values to the present nodes, if these have changed since the last call."""
    last_column = memory.shape[1] - 1
    previous_count = int(memory[3 * k, last_column])
    if n == previous_count:
        return
    if previous_count == 0:  # static solution, before time 0: zeros
        _record_coordinates(memory, state, k, n)
        return
    marks, j = memory[3 * k], 0
    for i in range(n):
        s = state.s[i]
        while j < previous_count - 2 and marks[j + 1] <= s:
            j += 1
        fraction = min(max((s - marks[j]) / (marks[j + 1] - marks[j]), 0.0), 1.0)
        for r in range(k):
            memory[k + r, i] = (1.0 - fraction) * memory[r, j] + fraction * memory[r, j + 1]
    _copy(memory, k, ZERO, k, n)
    _record_coordinates(memory, state, k, n)


@jit
def _record_coordinates(memory: Any, state: State, k: int, n: int) -> None:
    """Record the material coordinates of the n present nodes."""
    for i in range(n):
        memory[3 * k, i] = state.s[i]
    memory[3 * k, memory.shape[1] - 1] = n


@jit
def _copy(memory: Any, source: int, target: int, k: int, n: int) -> None:
    """Copy k rows from `source` on to the rows from `target` on, of the nodes 0 <= i < n."""
    for r in range(k):
        a, b = memory[source + r], memory[target + r]
        for i in range(n):
            b[i] = a[i]


def _with_variables(effects: Any) -> list[tuple[Any, int]]:
    """Return the effects with internal variables, each with their number (plain Python)."""
    return [
        (effect, _VARIABLE_COUNTS[type(effect)])
        for effect in effects
        if type(effect) in _VARIABLE_COUNTS
    ]


def counts_carried(effects: Any) -> dict[int, int]:
    """Return the number of internal variables of effects that have them, by index (numba types)."""
    kinds = [effect.instance_class for effect in effects]
    return {i: _VARIABLE_COUNTS[kind] for i, kind in enumerate(kinds) if kind in _VARIABLE_COUNTS}


def _for_each(head: str, effects: Any, line: str, hook: str = "", **names: Any) -> Any:
    """Return the function that runs `line` for each effect with internal variables."""
    counts = counts_carried(effects)
    calls = {i: call for i, call in kernels_by_index(hook, effects).items() if i in counts}
    names |= {f"k_{i}": np.int64(k) for i, k in counts.items()}
    lines = [line.replace("#", str(i)) for i in counts]
    return generated(head, [*lines, "return None"], calls, **names)


def begin_step(effects: Any, rope: Rope, time: Any, upto: Any) -> Any:
    """Initialise internal variables at time 0, else interpolate them to the present nodes.

    upto: number of nodes with internal variables, which are those that carry loads.
    """
    for effect, k in _with_variables(effects):
        if time == 0.0:
            kernel_of("start", type(effect))(effect, rope, upto)
            _record_coordinates(effect.memory, rope.state, k, upto)
        else:
            _carry_over(effect.memory, rope.state, k, upto)


@overload(begin_step, jit_options=LINKED, strict=False)
def _compose_begin(effects: Any, rope: Rope, time: Any, upto: Any) -> Any:
    line = (
        "if time == 0.0:\n        kernel_#(effects[#], rope, upto)\n"
        "        mark(effects[#].memory, rope.state, k_#, upto)\n"
        "    else:\n        carry(effects[#].memory, rope.state, k_#, upto)"
    )
    names = {"carry": _carry_over, "mark": _record_coordinates}
    return _for_each("effects, rope, time, upto", effects, line, "start", **names)


# Predict internal variables at the beginning of a stage, for the nodes low <= i < high. Position,
# velocity and water are predicted already.
predict_internal_variables = calls_of("predict", "rope, stage, kind, low, high", growth=True)
# Prepare the law of the lowest element for a stage, before its elements are evaluated.
prepare_axial = calls_of("prepare", "rope, stage, kind")


@jit
def _complete(rope: Any, stage: Any, pending: Any) -> Any:
    """Apply the pending correction to the stage's motion; return 0, the fraction still pending."""
    n, first = rope.state.counts[ELEMENTS], rope.model.first_free
    if anywhere(pending > 0.0):
        correct(rope.work, stage.p, stage.q, pending, first, n)
    return 0.0 * pending


def update_internal_variables(
    effects: Any, rope: Rope, stage: Stage, kind: Any, pending: Any, upto: Any
) -> Any:
    """Update internal variables after a converged stage; return the pending correction.

    Effects with internal variables require the complete motion of the stage.
    """
    for effect, _ in _with_variables(ramped(effects, stage.time)):
        pending = _complete(rope, stage, pending)
        kernel_of("settle", type(effect))(effect, rope, stage, kind, upto)
    return pending


@overload(update_internal_variables, jit_options=LINKED, strict=False)
def _compose_settle(
    effects: Any, rope: Rope, stage: Stage, kind: Any, pending: Any, upto: Any
) -> Any:
    counts = counts_carried(effects)
    calls, growth = kernels_at("settle", effects, stage), RampedEffects(effects)
    lines = ["pending = complete(rope, stage, pending)", *growth.lines] if counts else []
    lines += [f"kernel_{i}({growth.of(i)}, rope, stage, kind, upto)" for i in counts]
    head = "effects, rope, stage, kind, pending, upto"
    return generated(head, [*lines, "return pending"], calls, complete=_complete, **growth.names)


def _copies(source: int, target: int) -> Any:
    """Return the function that copies the values of all effects from one set of rows to another."""

    def copy_all(effects: Any, upto: Any) -> Any:
        for effect, k in _with_variables(effects):
            _copy(effect.memory, source * k, target * k, k, upto)

    @overload(copy_all, jit_options=LINKED, strict=False)
    def compose(effects: Any, upto: Any) -> Any:
        line = f"copy(effects[#].memory, {source} * k_#, {target} * k_#, k_#, upto)"
        return _for_each("effects, upto", effects, line, copy=_copy)

    return copy_all


# Save the values at the start of a step, when its first substep is accepted; accept those of a
# substep; restore those at the start, after a failed step.
save_internal_variables = _copies(0, 2)
accept_internal_variables = _copies(1, 0)
restore_internal_variables = _copies(2, 0)
