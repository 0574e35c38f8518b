"""One time step of a single rope: TR-BDF2 with substepping where Newton's method does not converge.

TR-BDF2 (Bank et al. 1985; Hosea and Shampine 1996) with γ = 2 - √2: a trapezoidal stage to t + γ·h,
then BDF2 to t + h, both with the same weight c = γ·h/2. It is second order, needs no history (so
elements may be added and removed), and damps frequencies that the mesh cannot resolve.
"""

from __future__ import annotations

from math import exp, isfinite, sqrt
from typing import Any

from rope_twin.core.elements import set_lengths, set_top_length, stretch_all
from rope_twin.core.integrator import (
    BDF2,
    CONVERGED,
    GAMMA,
    HALVINGS,
    NOT_FINITE,
    OUT,
    PENDING,
    TRAPEZOID,
    UNCONVERGED,
    accept,
    advance_substeps,
)
from rope_twin.core.jit.decorators import compiled, jit, jit_entry, jit_sum
from rope_twin.core.jit.floats import flush, restore
from rope_twin.core.jit.rows import copy, hold
from rope_twin.core.loads.balance import add_pull
from rope_twin.core.loads.memory import (
    accept_memories,
    begin_step,
    keep_memories,
    return_memories,
    settle_memories,
)
from rope_twin.core.newton import MAX_CORRECTIONS, MAX_CORRECTIONS_LAST, solve_stage
from rope_twin.core.payout import (
    HIGH,
    change_elements,
    load_trials,
    place_hang_off,
    prescribed,
    split_length,
)
from rope_twin.core.state import (
    DIRECTION,
    ELEMENTS,
    KEPT_ROWS,
    LINE,
    LINE_COLUMN,
    LOWEST_OFFSET,
    NODE_ROWS,
    PULL,
    PULL_X,
    PULL_Y,
    PULL_Z,
    RESIDUAL,
    REST,
    SOLVES,
    TENSION,
    ZERO,
    Boundary,
    Floats,
    Model,
    Rope,
    Stage,
    State,
)

OFFSET_GONE = 1e-15  # a decaying length correction below this fraction of its element is set to 0


@jit
def stage_at(rope: Rope, boundary: Boundary, row: int, part: float, time: float, c: float) -> Any:
    """Set the boundary condition at the fraction `part` of the step and return the stage there."""
    n, h = rope.state.counts[ELEMENTS], rope.model.step
    L, V, _ = place_hang_off(rope.work, boundary, row, part, h, n)
    set_top_length(rope.work, rope.state.s, rope.sections, n, L, V)
    return Stage(time + part * h, c * c, c, V)


@jit_sum
def _is_finite(rope: Rope) -> bool:
    """Return whether the stage's motion is finite.

    A converged stage always is, because NaN fails the tension criterion.
    """
    total = 0.0
    for k in range(NODE_ROWS):
        row = rope.work[k]
        for i in range(rope.state.counts[ELEMENTS]):
            total += abs(row[i])
    return isfinite(total)


@jit
def _substep(rope: Rope, at: Any, level: int, done: int) -> Any:
    """Solve both stages over 1/2^level of the step, from done/2^HALVINGS, in work.

    Returns the worse outcome of the two stages, their weight q, and the fraction of CORRECTION that
    is still pending.
    """
    boundary, row, time = at
    start, share = done / (1 << HALVINGS), 1.0 / (1 << level)
    cap = MAX_CORRECTIONS if level < HALVINGS else MAX_CORRECTIONS_LAST
    c = 0.5 * GAMMA * share * rope.model.step
    worst, pending, solves = PENDING, 0.0, rope.state.health[SOLVES]
    again = level < 0  # False; a literal False has its own type and compiles everything twice
    for kind in (TRAPEZOID, BDF2):
        part = GAMMA if kind == TRAPEZOID else 1.0
        stage = stage_at(rope, boundary, row, start + part * share, time, c)
        outcome = solve_stage(rope, stage, kind, cap, pending, again)
        worst = min(worst, outcome)
        if outcome < CONVERGED and level < HALVINGS:
            break  # the substep will be halved
        pending = 1.0 if outcome == PENDING else 0.0
        pending = settle_memories(rope.effects, rope, stage, kind, pending)
        again = level == 0 and rope.state.health[SOLVES] == solves + 1
    if worst == UNCONVERGED and level == HALVINGS and not _is_finite(rope):
        worst = NOT_FINITE
    return int(worst), c, pending


@jit
def _accept(rope: Rope, found: Any) -> None:
    """Copy the converged substep's motion to the state; that of the hang-off as prescribed."""
    _, q, pending = found
    n, first = rope.state.counts[ELEMENTS], rope.model.first_free
    accept(rope.state.nodes, rope.work, q * q, q, pending, first, n)
    for k in range(NODE_ROWS):
        rope.state.nodes[k, n] = rope.work[k, n]
    accept_memories(rope.effects, rope.state)


@jit
def _copy_start(rope: Rope, way: int) -> None:
    """Save motion and internal variables of the step's start (way OUT), or restore them."""
    nodes, work, n = rope.state.nodes, rope.work, rope.state.counts[ELEMENTS]
    if way == OUT:
        copy(nodes, ZERO, work, KEPT_ROWS, n + 1)
        keep_memories(rope.effects, rope.state)
    else:
        copy(work, KEPT_ROWS, nodes, ZERO, n + 1)
        return_memories(rope.effects, rope.state)


@jit
def _fade_offsets(model: Model, state: State, n: int) -> None:
    """Let length corrections of splits and merges decay with the time constant `absorb`."""
    keep = exp(-model.step / model.absorb)
    low = state.counts[LOWEST_OFFSET]
    for e in range(low, n):
        state.offset[e] *= keep
    while low < n and abs(state.offset[low]) < OFFSET_GONE * (state.s[low + 1] - state.s[low]):
        state.offset[low] = 0.0
        low += 1
    state.counts[LOWEST_OFFSET] = low


@jit
def _report(rope: Rope, pull: Any, row: int) -> None:
    """Write the rope's tension on the hang-off at the end of step `row`, from the ghost node there.

    It is the force balance of the half element at the hang-off, -T·t + (l/2)·(loads - m·a), with
    the material velocity and acceleration of the rope that passes it. The element's tension alone
    would be a saw-tooth of m·g·l/2 during payout.
    """
    state, work = rope.state, rope.work
    n, slot = state.counts[ELEMENTS], state.s.shape[0] + HIGH
    half, T = 0.5 * work[REST, n - 1], work[TENSION, n - 1]
    x = half * work[RESIDUAL, slot] - T * work[DIRECTION, n - 1]
    y = half * work[RESIDUAL + 1, slot] - T * work[DIRECTION + 1, n - 1]
    z = half * work[RESIDUAL + 2, slot] - T * work[DIRECTION + 2, n - 1]
    pull[row, PULL] = sqrt(x * x + y * y + z * z)
    pull[row, PULL_X] = x
    pull[row, PULL_Y] = y
    pull[row, PULL_Z] = z


@jit
def finish(rope: Rope, boundary: Boundary, pull: Any, row: int, time: float) -> None:
    """Complete step `row`, which ends at `time`: report tension, split or merge the top element."""
    state, h = rope.state, rope.model.step
    L, V, A = prescribed(boundary, row, LINE_COLUMN, 1.0, h)
    stage = Stage(time, 1.0, 0.0, V)
    state.s[state.counts[ELEMENTS]] = L
    _fade_offsets(rope.model, state, state.counts[ELEMENTS])
    lower = split_length(rope, V)
    load_trials(rope, stage, A, lower)
    _report(rope, pull, row)
    add_pull(rope.effects, rope.work, state.nodes, state.counts[ELEMENTS], pull, row)
    change_elements(rope, stage, L, lower)


@jit
def recall_tension(rope: Rope, boundary: Boundary, row: int, time: float) -> None:
    """Recompute element tensions at the start of step `row`, after a failed attempt at it."""
    state, work = rope.state, rope.work
    n = state.counts[ELEMENTS]
    copy(state.nodes, ZERO, work, ZERO, n + 1)
    L, V, _ = place_hang_off(work, boundary, row, 0.0, rope.model.step, n)
    set_top_length(work, state.s, rope.sections, n, L, V)
    stretch_all(rope, Stage(time, 1.0, 0.0, V))


@jit_entry
def advance_steps(rope: Rope, boundary: Boundary, pull: Any, time: float, steps: int) -> int:
    """Entry point of the compiled code behind `advance`."""
    was = flush()
    done = _advance(rope, boundary, pull, time, steps)
    restore(was)
    return int(done)


@jit
def _advance(rope: Rope, boundary: Boundary, pull: Any, time: float, steps: int) -> int:
    state, work = rope.state, rope.work
    n = state.counts[ELEMENTS]
    copy(state.nodes, ZERO, work, ZERO, n + 1)
    set_lengths(work, state.s, rope.sections, n, boundary.value[0, LINE])
    # The end of a step is inlined here, once; all other kernels take the rope by its address.
    held, held_boundary = hold(rope), hold(boundary)
    for row in range(steps):
        now = time + row * rope.model.step
        begin_step(rope.effects, rope, now)
        at = held_boundary, row, now
        if not advance_substeps(held, state.health, at, _substep, _copy_start, _accept):
            recall_tension(rope, boundary, row, now)
            return row
        finish(rope, boundary, pull, row, now + rope.model.step)
    return steps


_COMPILED: dict[tuple[type, ...], Any] = {}


def advance(rope: Rope, boundary: Boundary, pull: Floats, time: float, steps: int) -> int:
    """Advance by `steps` time steps from `time` and return how many were done.

    boundary: the prescribed motion at the step boundaries; pull: (steps, PULL_COLUMNS), the rope's
    force on the hang-off after each step [N], an output. A result below `steps` means that the next
    state would not be finite; the state is then the one before that step.

    The compiled code is looked up by the types of the rope's parts: numba's own dispatch inspects
    every array and takes as long as the step of a hundred elements.

    Raises:
        ValueError: a table is not contiguous in memory.
    """
    kinds = (*map(type, rope), *map(type, rope.effects))
    found = _COMPILED.get(kinds)
    if found is None:
        found = _COMPILED[kinds] = compiled(advance_steps, (rope, boundary, pull, time, steps))
    if not all(table.flags.c_contiguous for table in (*boundary, pull)):
        raise ValueError("advance: boundary and pull must be contiguous; pass copies")
    return int(found(rope, boundary, pull, time, steps))
