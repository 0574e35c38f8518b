"""One time step: TR-BDF2, halved where it does not converge.

TR-BDF2 (Bank et al. 1985; Hosea and Shampine 1996) with γ = 2 - √2: a trapezoidal stage to
t + γ·h, then BDF2 to t + h, both with the same weight c = γ·h/2. It is second order, needs no
history (so elements may come and go), and dissipates what the mesh cannot carry.
"""

from __future__ import annotations

from math import exp, isfinite, sqrt
from typing import Any

from rope_twin.core.assembly import set_lengths, set_top_length
from rope_twin.core.elastic import stretch_all
from rope_twin.core.jit import jit_entry, jit_inline
from rope_twin.core.motion import place_hang_off, prescribed
from rope_twin.core.payout import balance, change_elements, set_material
from rope_twin.core.rows import copy
from rope_twin.core.stage import CONVERGED, NOT_FINITE, UNCONVERGED, solve_stage
from rope_twin.core.state import (
    ACCELERATION,
    DIRECTION,
    ELEMENTS,
    KEPT,
    LINE,
    LOWEST_OFFSET,
    NODE_ROWS,
    POSITION,
    POSITION_HAT,
    PULL,
    PULL_X,
    PULL_Y,
    PULL_Z,
    REJECTED,
    RESIDUAL,
    REST,
    STEPS,
    SUBSTEPS,
    SUBSTEPS_MAX,
    SUBSTEPS_UNCONVERGED,
    TENSION,
    VELOCITY,
    VELOCITY_HAT,
    Stage,
)

GAMMA = 2.0 - sqrt(2.0)
K1 = 1.0 / (GAMMA * (2.0 - GAMMA))  # weight of the middle in the BDF2 stage
K2 = (1.0 - GAMMA) ** 2 / (GAMMA * (2.0 - GAMMA))  # and of the start
HALVINGS = 5  # down to h/32
OFFSET_GONE = 1e-15  # a fading length offset below this part of its element is 0


@jit_inline
def _predict_trapezoid(state: Any, work: Any, c: float, first: int, n: int) -> None:
    """v_hat = v + c·a, x_hat = x + c·v + c·v_hat."""
    for k in range(3):
        x, v, a = (
            state.nodes[POSITION + k],
            state.nodes[VELOCITY + k],
            state.nodes[ACCELERATION + k],
        )
        for i in range(first, n):
            v_hat = v[i] + c * a[i]
            work[VELOCITY_HAT + k, i] = v_hat
            work[POSITION_HAT + k, i] = x[i] + c * (v[i] + v_hat)
            work[ACCELERATION + k, i] = a[i]


@jit_inline
def _predict_bdf2(state: Any, work: Any, c: float, first: int, n: int) -> None:
    """v_hat = K1·v_middle - K2·v, x_hat = K1·x_middle - K2·x + c·v_hat."""
    for k in range(3):
        x, v = state.nodes[POSITION + k], state.nodes[VELOCITY + k]
        for i in range(first, n):
            v_hat = K1 * work[VELOCITY + k, i] - K2 * v[i]
            work[VELOCITY_HAT + k, i] = v_hat
            work[POSITION_HAT + k, i] = K1 * work[POSITION + k, i] - K2 * x[i] + c * v_hat


@jit_inline
def _stage_at(rope: Any, boundary: Any, row: int, part: float, time: float, c: float) -> Any:
    """Set the boundary at `part` of the step and return the stage there."""
    n, h = rope.state.counts[ELEMENTS], rope.model.step
    L, V, _ = place_hang_off(rope.work, boundary, row, part, h, n)
    set_top_length(rope.work, rope.state.s, n, L)
    return Stage(time + part * h, c * c, c, V)


@jit_inline
def _substep(rope: Any, boundary: Any, row: int, time: float, start: float, share: float) -> int:
    """Both stages over `share` of the step from `start`; the result is in work.

    Returns the worse of what the stages returned.
    """
    model, state, work = rope.model, rope.state, rope.work
    n, first = state.counts[ELEMENTS], model.first_free
    c = 0.5 * GAMMA * share * model.step
    outcome = CONVERGED
    for part in (GAMMA, 1.0):
        if part == GAMMA:
            _predict_trapezoid(state, work, c, first, n)
        else:
            _predict_bdf2(state, work, c, first, n)
        stage = _stage_at(rope, boundary, row, start + part * share, time, c)
        outcome = min(outcome, solve_stage(rope, stage, model.tolerance))
    return int(outcome)


@jit_inline
def _is_finite(work: Any, n: int) -> bool:
    """Whether the stage's motion is finite. A converged one is: NaN disagrees with any tension."""
    total = 0.0
    for k in range(NODE_ROWS):
        row = work[k]
        for i in range(n):
            total += abs(row[i])
    return isfinite(total)


@jit_inline
def _advance_halving(rope: Any, boundary: Any, row: int, time: float) -> bool:
    """One step, in halves of halves where Newton does not converge.

    False: not finite; the state is as it was.
    """
    full = 1 << HALVINGS
    done, level, substeps = 0, 0, 0
    state, work, health = rope.state, rope.work, rope.state.health
    n = state.counts[ELEMENTS]
    while done < full:
        part = full >> level
        outcome = _substep(rope, boundary, row, time, done / full, part / full)
        if outcome < CONVERGED and level < HALVINGS:
            level += 1
            health[REJECTED] += 1
            continue
        if outcome == NOT_FINITE or (outcome == UNCONVERGED and not _is_finite(work, n)):
            if done > 0:
                copy(work, KEPT, state.nodes, POSITION, NODE_ROWS, n + 1)
            return False
        if outcome == UNCONVERGED:
            health[SUBSTEPS_UNCONVERGED] += 1
        if done == 0 and part < full:  # the step's start, should a later part fail
            copy(state.nodes, POSITION, work, KEPT, NODE_ROWS, n + 1)
        copy(work, POSITION, state.nodes, POSITION, NODE_ROWS, n + 1)
        done += part
        substeps += 1
        while level > 0 and done % (full >> (level - 1)) == 0:
            level -= 1
    health[STEPS] += 1
    health[SUBSTEPS] += substeps
    health[SUBSTEPS_MAX] = max(health[SUBSTEPS_MAX], substeps)
    return True


@jit_inline
def _fade_offsets(model: Any, state: Any, n: int) -> None:
    """Length offsets of events fade with the time constant `absorb`."""
    keep = exp(-model.step / model.absorb)
    low = state.counts[LOWEST_OFFSET]
    for e in range(low, n):
        state.offset[e] *= keep
    while low < n and abs(state.offset[low]) < OFFSET_GONE * (state.s[low + 1] - state.s[low]):
        state.offset[low] = 0.0
        low += 1
    state.counts[LOWEST_OFFSET] = low


@jit_inline
def _report(rope: Any, boundary: Any, pull: Any, row: int, time: float) -> None:
    """The rope's pull on the hang-off at the end of step `row`, where the last stage has left work.

    It is the balance of the half element at the hang-off, -T·t + (l/2)·(loads - m·a), with
    the material velocity and acceleration of the rope that passes it; the element's tension alone
    would be a saw-tooth of m·g·l/2 under payout.
    """
    state, work, h = rope.state, rope.work, rope.model.step
    n = state.counts[ELEMENTS]
    _, V, A = prescribed(boundary, row, LINE, 1.0, h)
    stage = Stage(time + h, 1.0, 0.0, V)
    slot = state.s.shape[0] - 1
    rest, T = work[REST, n - 1], work[TENSION, n - 1]
    set_material(rope, n - 1, rest, V, A, slot)
    balance(rope, stage, slot, n - 1)
    x = 0.5 * rest * work[RESIDUAL, slot] - T * work[DIRECTION, n - 1]
    y = 0.5 * rest * work[RESIDUAL + 1, slot] - T * work[DIRECTION + 1, n - 1]
    z = 0.5 * rest * work[RESIDUAL + 2, slot] - T * work[DIRECTION + 2, n - 1]
    pull[row, PULL] = sqrt(x * x + y * y + z * z)
    pull[row, PULL_X] = x
    pull[row, PULL_Y] = y
    pull[row, PULL_Z] = z


@jit_inline
def _recall_tension(rope: Any, boundary: Any, row: int, time: float) -> None:
    """Element tensions of the state at the start of step `row`, after a failed attempt at it."""
    state, work = rope.state, rope.work
    n = state.counts[ELEMENTS]
    copy(state.nodes, POSITION, work, POSITION, NODE_ROWS, n + 1)
    L, V, _ = place_hang_off(work, boundary, row, 0.0, rope.model.step, n)
    set_top_length(work, state.s, n, L)
    stretch_all(rope, Stage(time, 1.0, 0.0, V))


@jit_entry
def advance(rope: Any, boundary: Any, pull: Any, time: float, steps: int) -> int:
    """Advance by `steps` steps from `time`; returns how many were done.

    boundary: the prescribed motion at the steps' borders; pull: (steps, PULL_COLUMNS), the rope's
    pull on the hang-off after each step [N], a result. Fewer than `steps`: the next state would not
    be finite; the state is as it was before that step.
    """
    state, work = rope.state, rope.work
    n = state.counts[ELEMENTS]
    copy(state.nodes, POSITION, work, POSITION, NODE_ROWS, n + 1)
    set_lengths(work, state.s, n, boundary.value[0, LINE])
    for row in range(steps):
        n = state.counts[ELEMENTS]
        now = time + row * rope.model.step
        if not _advance_halving(rope, boundary, row, now):
            _recall_tension(rope, boundary, row, now)
            return row
        state.s[n] = boundary.value[row + 1, LINE]
        _fade_offsets(rope.model, state, n)
        _report(rope, boundary, pull, row, now)
        change_elements(rope, boundary, row, now)
    return steps
