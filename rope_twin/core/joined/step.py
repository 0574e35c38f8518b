"""One time step of a multi-line system: TR-BDF2 with substepping, as in core/step.py."""

from __future__ import annotations

from math import isfinite
from typing import Any

from rope_twin.core.elements import set_lengths, stretch_all
from rope_twin.core.integrator import (
    BACK,
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
from rope_twin.core.jit.decorators import compiled, jit, jit_entry
from rope_twin.core.jit.floats import flush, restore
from rope_twin.core.jit.rows import hold
from rope_twin.core.joined.joints import (
    LOOSE,
    STEP,
    Joined,
    System,
    first_free,
    place_ends,
    renew_plan,
)
from rope_twin.core.joined.sheaves import finish_at_sheave, is_at_sheave, pass_end
from rope_twin.core.joined.stack import load, rope_of, stacked_effects, store
from rope_twin.core.joined.stage import end_rope, solve_joined
from rope_twin.core.loads.balance import add_pull, load_nodes
from rope_twin.core.newton import MAX_CORRECTIONS, MAX_CORRECTIONS_LAST
from rope_twin.core.state import (
    ELEMENTS,
    KEPT_ROWS,
    LINE,
    PULL,
    PULL_X,
    RESIDUAL,
    ZERO,
    Boundary,
    Floats,
    Stage,
)
from rope_twin.core.step import finish, stage_at


@jit
def _boundary_of(boundary: Any, r: int) -> Any:
    """Return the prescribed motion of rope r."""
    return Boundary(boundary.value[r], boundary.rate[r])


@jit
def _size(nodes: Any, work: Any, n: int) -> float:
    """Return the sum of absolute values of a stage's motion; not finite if one is not."""
    total = 0.0
    for k in range(nodes.shape[0]):
        for i in range(n):
            total += abs(work[k, i])
    return total


@jit
def _all_finite(system: Any) -> bool:
    """Return whether the stage's motion of all ropes and connections is finite."""
    stack, joints = system.stack, system.joints
    total = _size(joints.nodes, joints.work, joints.nodes.shape[1])
    for r in range(stack.counts.shape[0]):
        total += _size(stack.nodes[r], stack.work[r], stack.counts[r, ELEMENTS])
    return isfinite(total)


@jit
def _substep(system: Any, at: Any, level: int, done: int) -> Any:
    """Solve both stages over 1/2^level of the step, from done/2^HALVINGS, in work.

    Returns the worse outcome of the two stages, their weight q, and the fraction of the nodes'
    CORRECTION that is still pending.
    """
    boundary, row, time = at
    h = system.stack.model[0, STEP]
    start, share = done / (1 << HALVINGS), 1.0 / (1 << level)
    cap = MAX_CORRECTIONS if level < HALVINGS else MAX_CORRECTIONS_LAST
    c = 0.5 * GAMMA * share * h
    worst, pending = PENDING, 0.0
    for kind in (TRAPEZOID, BDF2):
        part = start + (GAMMA if kind == TRAPEZOID else 1.0) * share
        for r in range(system.stack.counts.shape[0]):
            if system.joints.upper[r] == LOOSE:
                own = stage_at(
                    rope_of(system.stack, r), _boundary_of(boundary, r), row, part, time, c
                )
                system.joints.speed[r] = own.V
        stage = Stage(time + part * h, c * c, c, 0.0)
        outcome = solve_joined(system, stage, kind, cap, pending)
        worst = min(worst, outcome)
        if outcome < CONVERGED and level < HALVINGS:
            break  # the substep will be halved
        pending = 1.0 if outcome == PENDING else 0.0
    if worst == UNCONVERGED and level == HALVINGS and not _all_finite(system):
        worst = NOT_FINITE
    return int(worst), c, pending


@jit
def _copy(nodes: Any, work: Any, row: int, n: int, way: int) -> None:
    """Copy the motion of n nodes to (way: OUT) the rows of work from `row` on, or BACK.

    It copies as many rows as nodes has, which is NODE_ROWS: a compile-time constant would be
    unrolled.
    """
    for k in range(nodes.shape[0]):
        a, b = nodes[k], work[row + k]
        for i in range(n):
            if way == BACK:
                a[i] = b[i]
            else:
                b[i] = a[i]


@jit
def _copy_all(system: Any, row: int, way: int) -> None:
    """Copy the state of ropes and connections to (OUT) work's rows from `row` on, or BACK."""
    stack, joints = system.stack, system.joints
    for r in range(stack.counts.shape[0]):
        _copy(stack.nodes[r], stack.work[r], row, stack.counts[r, ELEMENTS] + 1, way)
    _copy(joints.nodes, joints.work, row, joints.nodes.shape[1], way)


@jit
def _accept(system: Any, found: Any) -> None:
    """Copy the converged substep's motion, with the pending correction, to the state."""
    _, q, pending = found
    stack, joints = system.stack, system.joints
    place_ends(system)
    for r in range(stack.counts.shape[0]):
        nodes, work, n = stack.nodes[r], stack.work[r], stack.counts[r, ELEMENTS]
        pass_end(system.sheaves, joints, rope_of(stack, r), r, pending * q * q, pending * q)
        accept(nodes, work, q * q, q, pending, first_free(stack, r), n)
        for k in range(nodes.shape[0]):
            nodes[k, n] = work[k, n]
            if joints.lower[r] != LOOSE:
                nodes[k, 0] = work[k, 0]
    _copy(joints.nodes, joints.work, ZERO, joints.nodes.shape[1], BACK)


@jit
def _copy_start(system: Any, way: int) -> None:
    """Save the motion at the start of the step to scratch, or restore it."""
    _copy_all(system, KEPT_ROWS, way)


@jit
def _report_joined(rope: Any, pull: Any, row: int, time: float) -> None:
    """Write the rope's tension on its upper connection: the balance of the half element there."""
    work, n = rope.work, rope.state.counts[ELEMENTS]
    end_rope(work, n)
    load_nodes(rope.effects, work, Stage(time, 1.0, 0.0, 0.0), n, n + 1)
    square = 0.0
    for k in range(3):
        pull[row, PULL_X + k] = work[RESIDUAL + k, n]
        square += work[RESIDUAL + k, n] ** 2
    pull[row, PULL] = square**0.5
    add_pull(rope.effects, work, rope.state.nodes, n, pull, row)


@jit
def _start(system: Any, boundary: Any, row: int) -> None:
    """Load scratch from the states before step `row`; ends take the motion of connections."""
    stack, joints = system.stack, system.joints
    _copy_all(system, ZERO, OUT)
    for r in range(stack.counts.shape[0]):
        n = stack.counts[r, ELEMENTS]
        joined = joints.upper[r] != LOOSE
        L = stack.s[r, n] if joined else boundary.value[r, row, LINE]
        set_lengths(stack.work[r], stack.s[r], stack.sections[r], n, L)
        joints.speed[r] = 0.0
    place_ends(system)
    _copy_all(system, ZERO, BACK)


@jit
def _recall(system: Any, boundary: Any, row: int, time: float) -> None:
    """Recompute tensions at the start of step `row`, after a failed attempt at it."""
    _start(system, boundary, row)
    for r in range(system.stack.counts.shape[0]):
        rope, stage = rope_of(system.stack, r), Stage(time, 1.0, 1.0, 0.0)
        if system.joints.upper[r] == LOOSE:
            stage = stage_at(rope, _boundary_of(boundary, r), row, 0.0, time, 1.0)
        pass_end(system.sheaves, system.joints, rope, r, 0.0, 0.0)
        stretch_all(rope, stage)


@jit_entry
def advance_joined_steps(
    system: Any, boundary: Any, pull: Any, time: float, first: int, steps: int
) -> int:
    """Entry point of the compiled code behind `advance_joined`."""
    was = flush()
    done = _advance(hold(system), hold(boundary), pull, time, first, steps)
    restore(was)
    return int(done)


@jit
def _has_other_elements(system: Any) -> bool:
    """Return whether elements were added or removed since the plan was made."""
    counts, known = system.stack.counts, system.joints.plan.counts
    other = 0
    for r in range(counts.shape[0]):
        other += counts[r, ELEMENTS] != known[r]
    return bool(other > 0)


@jit
def _advance(system: Any, boundary: Any, pull: Any, time: float, first: int, steps: int) -> int:
    """Advance from step `first` to `steps`; return where it ended, so that the plan is renewed."""
    _start(system, boundary, first)
    h, health = system.stack.model[0, STEP], system.stack.health[0]  # counted by the first rope
    for row in range(first, steps):
        now = time + row * h
        at = boundary, row, now
        if not advance_substeps(system, health, at, _substep, _copy_start, _accept):
            _recall(system, boundary, row, now)
            return row
        for r in range(system.stack.counts.shape[0]):
            rope = rope_of(system.stack, r)
            if system.joints.upper[r] == LOOSE:
                finish(rope, _boundary_of(boundary, r), pull[r], row, now + h)
            elif is_at_sheave(system.sheaves, r):
                own = pull[r, row : row + 1]
                finish_at_sheave(system.sheaves, system, r, own, now + h)
            else:
                _report_joined(rope, pull[r], row, now + h)
        if _has_other_elements(system):
            return row + 1
    return steps


_COMPILED: dict[tuple[type, ...], Any] = {}


def advance_joined(
    system: System, boundary: Boundary, pull: Floats, time: float, steps: int
) -> int:
    """Advance a multi-line system by `steps` time steps from `time` and return how many were done.

    boundary: (ropes, steps + 1, MOTIONS), the motion of hang-offs and their paid-out length at the
    step boundaries; rows of ropes whose upper end is connected are not read. pull: (ropes, steps,
    PULL_COLUMNS), each rope's force on its hang-off or upper connection after each step [N], a
    result. A result below `steps` means that the next state would not be finite; the state is then
    the one before that step.

    Raises:
        ValueError: a table is not contiguous in memory.
    """
    if not all(table.flags.c_contiguous for table in (*boundary, pull)):
        raise ValueError("advance_joined: boundary and pull must be contiguous; pass copies")
    effects = stacked_effects(system.ropes)
    for r, rope in enumerate(system.ropes):
        load(system.stack, r, rope)
    joined = Joined(system.stack._replace(effects=effects), system.joints, system.sheaves)
    kinds = (type(system.sheaves), type(system.stack.law), *map(type, effects))
    renew_plan(system)
    arguments = (joined, boundary, pull, time, 0, steps)
    found = _COMPILED.get(kinds)
    if found is None:
        found = _COMPILED[kinds] = compiled(advance_joined_steps, arguments)
    done = int(found(*arguments))
    while done < steps and renew_plan(system):
        done = int(found(joined, boundary, pull, time, done, steps))
    for r, rope in enumerate(system.ropes):
        store(system.stack, r, rope)
    return done
