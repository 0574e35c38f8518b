"""Time integration of a system of ropes: TR-BDF2, with substepping where Newton's method fails.

A system is one rope, or several with connections (core/joined/stage). TR-BDF2 (Bank et al. 1985;
Hosea and Shampine 1996) with γ = 2 - √2: a trapezoidal stage to t + γ·h, then BDF2 to t + h, both
with the same weight c = γ·h/2. It is second order, needs no history (so elements may be added and
removed), and damps frequencies that the mesh cannot resolve. A step in which Newton's method does
not converge is halved, recursively.
"""

from __future__ import annotations

from math import isfinite
from typing import Any

from rope_twin.core.axial_law import sections_law
from rope_twin.core.elements import set_lengths, set_top_length, stretch_all
from rope_twin.core.fibre import freeze_mean_strain
from rope_twin.core.integrator import (
    BDF2,
    CONVERGED,
    GAMMA,
    NOT_FINITE,
    PENDING,
    TRAPEZOID,
    UNCONVERGED,
    accept,
    step_start,
)
from rope_twin.core.jit.decorators import compiled, jit, jit_entry, jit_sum
from rope_twin.core.jit.functions import flush, restore
from rope_twin.core.jit.rows import by_reference, copy
from rope_twin.core.joined.joints import LOOSE, Joined, System, renew_plan
from rope_twin.core.joined.sheaves import is_at_sheave, set_border
from rope_twin.core.joined.stack import POINT, load, rope_of, stacked_effects, store, store_memories
from rope_twin.core.joined.stage import (
    TO_STATE,
    TO_WORK,
    boundary_of,
    by_system_type,
    copy_connections,
    count_loaded,
    count_ropes,
    gather_from_others,
    health_of,
    join_ends,
    length_at,
    pass_sheave,
    place_all_ends,
    rope_at,
    settle_ends,
    size_of_connections,
    stage_of,
    step_of,
)
from rope_twin.core.loads.memory import (
    accept_internal_variables,
    begin_step,
    prepare_axial,
    restore_internal_variables,
    save_internal_variables,
    update_internal_variables,
)
from rope_twin.core.newton import MAX_CORRECTIONS, MAX_CORRECTIONS_LAST, solve_stage
from rope_twin.core.payout import finish, place_hang_off, report_at_connection
from rope_twin.core.state import (
    ELEMENTS,
    KEPT_ROWS,
    NODE_ROWS,
    REJECTED,
    SOLVES,
    STEPS,
    SUBSTEPS,
    SUBSTEPS_MAX,
    SUBSTEPS_UNCONVERGED,
    ZERO,
    Boundary,
    Floats,
    Rope,
    Stage,
)

HALVINGS = 5  # down to h/32


@jit
def pay_out_to(rope: Any, boundary: Boundary, row: int, part: float) -> Any:
    """Set hang-off and top element at the fraction `part` of a step; return the payout speed."""
    n = rope.state.counts[ELEMENTS]
    L, V, _ = place_hang_off(rope.work, boundary, row, part, rope.model.step, n)
    set_top_length(rope.work, rope.state.s, rope.sections, n, L, V)
    return V


@jit
def stage_at(rope: Rope, boundary: Boundary, row: int, part: float, time: float, c: float) -> Any:
    """Set the boundary condition at the fraction `part` of the step and return the stage there."""
    V = pay_out_to(rope, boundary, row, part)
    return Stage(time + part * rope.model.step, c * c, c, V)


@by_system_type(
    lambda system, boundary, row, part, time, c: stage_at(system, boundary, row, part, time, c)
)
def _stage_at(system: Any, boundary: Any, row: Any, part: Any, time: Any, c: Any) -> Any:
    """Set the boundary conditions of all hang-offs; return the stage, without a payout speed."""
    for r in range(count_ropes(system)):
        if system.joints.upper[r] == LOOSE:
            prescribed = boundary_of(system, boundary, r)
            system.joints.speed[r] = pay_out_to(rope_at(system, r), prescribed, row, part)
    return Stage(time + part * step_of(system), c * c, c, 0.0)


@jit_sum
def _sum_of_motion(rope: Rope) -> Any:
    """Return the sum of absolute values of a stage's motion; not finite if any entry is not."""
    total = 0.0
    for k in range(min(NODE_ROWS, rope.work.shape[0])):
        row = rope.work[k]
        for i in range(rope.state.counts[ELEMENTS]):
            total += abs(row[i])
    return total


@jit
def _is_finite(system: Any) -> bool:
    """Return whether the stage's motion is finite.

    Only needed for an unconverged stage: NaN fails the convergence criterion.
    """
    total = size_of_connections(system)
    for r in range(count_ropes(system)):
        total += _sum_of_motion(rope_at(system, r))
    return isfinite(total)


@jit
def settle(system: Any, stage: Any, kind: int, pending: Any) -> Any:
    """Update internal variables after a converged stage; return the correction still pending."""
    settle_ends(system, stage, pending)
    remaining = pending
    for r in range(count_ropes(system)):
        rope, rope_stage, upto = (
            rope_at(system, r),
            stage_of(system, stage, r),
            count_loaded(system, r),
        )
        remaining = update_internal_variables(rope.effects, rope, rope_stage, kind, pending, upto)
    return remaining


@jit
def _substep(system: Any, at: Any, level: int, done: int) -> Any:
    """Solve both stages of a substep: 1/2^level of the step, from done/2^HALVINGS on.

    Returns the worse outcome of the two stages, their weight q, and the fraction of the nodes'
    CORRECTION that is still pending.
    """
    boundary, row, time = at
    start, fraction = done / (1 << HALVINGS), 1.0 / (1 << level)
    max_corrections = MAX_CORRECTIONS if level < HALVINGS else MAX_CORRECTIONS_LAST
    c = 0.5 * GAMMA * fraction * step_of(system)
    worst_outcome, pending, solves = PENDING, 0.0, health_of(system)[0][SOLVES]
    reuse = level < 0  # False; a literal False has its own type and compiles everything twice
    for kind in (TRAPEZOID, BDF2):
        stage_fraction = GAMMA if kind == TRAPEZOID else 1.0
        stage = _stage_at(system, boundary, row, start + stage_fraction * fraction, time, c)
        outcome = solve_stage(system, stage, kind, max_corrections, pending, reuse)
        worst_outcome = min(worst_outcome, outcome)
        if outcome < CONVERGED and level < HALVINGS:
            break  # the substep will be halved
        pending = 1.0 if outcome == PENDING else 0.0
        pending = settle(system, stage, kind, pending)
        reuse = level == 0 and health_of(system)[0][SOLVES] == solves + 1
    if worst_outcome == UNCONVERGED and level == HALVINGS and not _is_finite(system):
        worst_outcome = NOT_FINITE
    return int(worst_outcome), c, pending


@jit
def _accept(system: Any, q: float, pending: float) -> None:
    """Copy the motion of a converged substep to the state, with the prescribed motion of ends."""
    place_all_ends(system)
    for r in range(count_ropes(system)):
        rope = rope_at(system, r)
        nodes, work, first = rope.state.nodes, rope.work, rope.model.first_free
        n = rope.state.counts[ELEMENTS]
        pass_sheave(system, rope, r, pending * q * q, pending * q)
        accept(nodes, work, q * q, q, pending, first, n)
        for k in range(NODE_ROWS):
            nodes[k, n] = work[k, n]
            if first == 1:
                nodes[k, 0] = work[k, 0]
        accept_internal_variables(rope.effects, count_loaded(system, r))
    copy_connections(system, ZERO, TO_STATE)


@jit
def _copy_start(system: Any, way: int) -> None:
    """Save motion and internal variables of the step's start (way OUT), or restore them."""
    for r in range(count_ropes(system)):
        rope, upto = rope_at(system, r), count_loaded(system, r)
        nodes, work, n = rope.state.nodes, rope.work, rope.state.counts[ELEMENTS]
        if way == TO_WORK:
            copy(nodes, ZERO, work, KEPT_ROWS, n + 1)
            save_internal_variables(rope.effects, upto)
        else:
            copy(work, KEPT_ROWS, nodes, ZERO, n + 1)
            restore_internal_variables(rope.effects, upto)
    copy_connections(system, KEPT_ROWS, way)


@jit
def _advance_substeps(system: Any, at: Any) -> bool:
    """Advance one step, with substeps if necessary.

    at: boundary, row and time of the step. Returns False if the result is not finite; the state is
    then unchanged.
    """
    health, full = health_of(system)[0], 1 << HALVINGS
    done, level, substeps = ZERO, ZERO, 0
    while done < full:
        size = full >> level
        outcome, q, pending = _substep(system, at, level, done)
        if outcome < CONVERGED and level < HALVINGS:
            level += 1
            health[REJECTED] += 1
            continue
        if outcome == NOT_FINITE:
            if done > 0:
                _copy_start(system, TO_STATE)
            return False
        if outcome == UNCONVERGED:
            health[SUBSTEPS_UNCONVERGED] += 1
        if done == 0 and size < full:  # the step's start, in case a later part fails
            _copy_start(system, TO_WORK)
        _accept(system, q, pending)
        done += size
        substeps += 1
        while level > 0 and done % (full >> (level - 1)) == 0:
            level -= 1
    health[STEPS] += 1
    health[SUBSTEPS] += substeps
    health[SUBSTEPS_MAX] = max(health[SUBSTEPS_MAX], substeps)
    return True


@jit
def _load_start(system: Any, boundary: Boundary, row: int) -> None:
    """Load the work arrays from the state before step `row`."""
    copy_connections(system, ZERO, TO_WORK)
    for r in range(count_ropes(system)):
        rope, L = rope_at(system, r), length_at(system, boundary, row, r)
        state, work, n = rope.state, rope.work, rope.state.counts[ELEMENTS]
        copy(state.nodes, ZERO, work, ZERO, n + 1)
        set_lengths(work, state.s, rope.sections, n, L)
    join_ends(system)


@jit
def _recompute_tension(system: Any, boundary: Boundary, row: int, time: float) -> None:
    """Recompute element tensions at the start of step `row`, after a failed attempt at it."""
    _load_start(system, boundary, row)
    stage = _stage_at(system, boundary, row, 0.0, time, 1.0)
    for r in range(count_ropes(system)):
        rope = rope_at(system, r)
        pass_sheave(system, rope, r, 0.0, 0.0)
        rope_stage = stage_of(system, stage, r)
        freeze_mean_strain(sections_law(rope), rope)
        prepare_axial(rope.effects, rope, rope_stage, TRAPEZOID)
        stretch_all(rope, rope_stage)


# A single rope is passed by value, since this is inlined; `reference` is the system by reference.
@jit
def finish_at_sheave(sheaves: Any, system: Any, r: int, pull: Any, time: float) -> None:
    """Complete a step at a sheave, like `finish` at a hang-off; pull: (1, PULL_COLUMNS)."""
    if sheaves is None:
        return
    rope, joints = rope_of(system.stack, r), system.joints
    nodes, n = rope.state.nodes, rope.state.counts[ELEMENTS]
    for k in range(NODE_ROWS):
        nodes[k, n] = joints.nodes[k, int(sheaves.figures[POINT, sheaves.of[r]])]
    set_border(sheaves, joints.nodes, rope.model.step, r)
    span = slice(2 * r, 2 * r + 2)
    border = Boundary(sheaves.borders.value[span], sheaves.borders.rate[span])
    finish(rope, border, pull, ZERO, time)


@by_system_type(
    lambda system, held, boundary, pull, row, time: finish(system, boundary, pull, row, time)
)
def _finish(system: Any, reference: Any, boundary: Any, pull: Any, row: Any, time: Any) -> Any:
    """Complete a step, which ends at `time`: report tensions, split or merge elements."""
    for r in range(count_ropes(reference)):
        rope = rope_at(reference, r)
        if reference.joints.upper[r] == LOOSE:
            finish(rope, boundary_of(reference, boundary, r), pull[r], row, time)
        elif is_at_sheave(reference.sheaves, r):
            finish_at_sheave(reference.sheaves, reference, r, pull[r, row : row + 1], time)
        else:
            report_at_connection(rope, pull[r], row, Stage(time, 1.0, 0.0, 0.0))


@by_system_type(lambda system: False)
def _needs_plan(system: Any) -> Any:
    """Return whether elements were added or removed since the elimination plan was made."""
    counts, planned = system.stack.counts, system.joints.plan.counts
    changed = 0
    for r in range(counts.shape[0]):
        changed += counts[r, ELEMENTS] != planned[r]
    return changed > 0


@jit_entry
def advance_steps(
    system: Any, boundary: Boundary, pull: Any, time: float, first: int, steps: int
) -> int:
    """Entry point of the compiled code behind `advance` and `advance_joined`."""
    mode = flush()
    done = _advance(system, boundary, pull, time, first, steps)
    restore(mode)
    return int(done)


@jit
def _advance(
    system: Any, boundary: Boundary, pull: Any, time: float, first: int, steps: int
) -> int:
    """Advance from step `first` to `steps`, or until the elimination plan becomes invalid."""
    reference, boundary_reference = by_reference(system), by_reference(boundary)
    _load_start(reference, boundary_reference, first)
    h = step_of(reference)
    for row in range(first, steps):
        start = step_start(time, row, h)
        for r in range(count_ropes(reference)):
            rope = rope_at(reference, r)
            begin_step(rope.effects, rope, start, count_loaded(reference, r))
        for r in range(count_ropes(reference)):
            gather_from_others(reference, rope_at(reference, r))
        if not _advance_substeps(reference, (boundary_reference, row, start)):
            _recompute_tension(reference, boundary_reference, row, start)
            return row
        _finish(system, reference, boundary, pull, row, start + h)
        if _needs_plan(reference):
            return row + 1
    return steps


_COMPILED: dict[tuple[type, ...], Any] = {}


def advance(rope: Rope, boundary: Boundary, pull: Floats, time: float, steps: int) -> int:
    """Advance by `steps` time steps from `time` [s] and return the number of completed steps.

    boundary: prescribed motion at the step boundaries, (steps + 1, MOTIONS); pull: output, the
    rope's force on the hang-off after each step [N], (steps, PULL_COLUMNS). A result below `steps`
    means that the next state would not be finite; the state is the one before that step.

    The compiled code is looked up by the types of the rope's fields: numba's own dispatch inspects
    every array and takes as long as a step of a hundred elements.

    Raises:
        ValueError: a table is not contiguous in memory.
    """
    types = (*map(type, rope), *map(type, rope.effects))
    code = _COMPILED.get(types)
    if code is None:
        code = _COMPILED[types] = compiled(advance_steps, (rope, boundary, pull, time, 0, steps))
    if not all(table.flags.c_contiguous for table in (*boundary, pull)):
        raise ValueError("advance: boundary and pull must be contiguous; pass copies")
    return int(code(rope, boundary, pull, time, 0, steps))


def advance_joined(
    system: System, boundary: Boundary, pull: Floats, time: float, steps: int
) -> int:
    """Advance a multi-line system by `steps` steps from `time` [s]; return the completed steps.

    boundary: motion and paid-out length of the hang-offs at the step boundaries, (ropes, steps + 1,
    MOTIONS); rows of ropes whose upper end is connected are not read. pull: output, each rope's
    force on its hang-off or upper connection after each step [N], (ropes, steps, PULL_COLUMNS). A
    result below `steps` means that the next state would not be finite; the state is the one before
    that step.

    Raises:
        ValueError: a table is not contiguous in memory.
    """
    if not all(table.flags.c_contiguous for table in (*boundary, pull)):
        raise ValueError("advance_joined: boundary and pull must be contiguous; pass copies")
    effects = stacked_effects(system.ropes, system.stack.s.shape[1])
    for r, rope in enumerate(system.ropes):
        load(system.stack, r, rope)
    joined = Joined(system.stack._replace(effects=effects), system.joints, system.sheaves)
    rope_kinds = map(type, system.ropes[0].effects)
    kinds = (type(system.sheaves), type(system.stack.law), *map(type, effects), *rope_kinds)
    renew_plan(system)
    code = _COMPILED.get(kinds)
    if code is None:
        arguments = (joined, boundary, pull, time, 0, steps)
        code = _COMPILED[kinds] = compiled(advance_steps, arguments)
    done = int(code(joined, boundary, pull, time, 0, steps))
    while done < steps and renew_plan(system):
        done = int(code(joined, boundary, pull, time, done, steps))
    for r, rope in enumerate(system.ropes):
        store(system.stack, r, rope)
    store_memories(effects, system.ropes)
    return done
