"""One time step of ropes that meet: TR-BDF2, halved over the whole system, as in core/step.py."""

from __future__ import annotations

from math import isfinite
from typing import Any

from rope_twin.core.acting import terms
from rope_twin.core.jit.decorators import compiled, jit, jit_entry
from rope_twin.core.jit.held import hold
from rope_twin.core.jit.subnormals import flush, restore
from rope_twin.core.joined.joints import LOOSE, STEP, Joined, System, place_ends
from rope_twin.core.joined.sheaves import finish_at_sheave, is_at_sheave, pass_end
from rope_twin.core.joined.stack import load, rope_of, stacked_effects, store
from rope_twin.core.joined.stage import end_rope, solve_joined
from rope_twin.core.rope.elastic import stretch_all
from rope_twin.core.rope.sections import set_lengths
from rope_twin.core.solve.assembly import load_nodes
from rope_twin.core.solve.halving import BACK, HALVINGS, OUT, advance_halving
from rope_twin.core.solve.prediction import GAMMA
from rope_twin.core.solve.stage import (
    BDF2,
    CAP,
    CONVERGED,
    LAST_CAP,
    NOT_FINITE,
    TRAPEZOID,
    UNCONVERGED,
)
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
    """The prescribed motion of rope r."""
    return Boundary(boundary.value[r], boundary.rate[r])


@jit
def _size(nodes: Any, work: Any, n: int) -> float:
    """Sum of all numbers of the stage's motion of n nodes: not finite if one of them is not."""
    total = 0.0
    for k in range(nodes.shape[0]):
        for i in range(n):
            total += abs(work[k, i])
    return total


@jit
def _all_finite(system: Any) -> bool:
    """Whether the stage's motion is finite, of ropes and so of joints."""
    stack, joints = system.stack, system.joints
    total = _size(joints.nodes, joints.work, joints.nodes.shape[1])
    for r in range(stack.counts.shape[0]):
        total += _size(stack.nodes[r], stack.work[r], stack.counts[r, ELEMENTS])
    return isfinite(total)


@jit
def _substep(system: Any, at: Any, level: int, done: int) -> Any:
    """Both stages over 1/2^level of the step, from done/2^HALVINGS; the result is in work.

    Returns the worse of what the stages returned.
    """
    boundary, row, time = at
    h = system.stack.model[0, STEP]
    start, share = done / (1 << HALVINGS), 1.0 / (1 << level)
    cap = CAP if level < HALVINGS else LAST_CAP
    c = 0.5 * GAMMA * share * h
    outcome = CONVERGED
    for kind in (TRAPEZOID, BDF2):
        part = start + (GAMMA if kind == TRAPEZOID else 1.0) * share
        for r in range(system.stack.counts.shape[0]):
            if system.joints.upper[r] == LOOSE:
                own = stage_at(
                    rope_of(system.stack, r), _boundary_of(boundary, r), row, part, time, c
                )
                system.joints.speed[r] = own.V
        stage = Stage(time + part * h, c * c, c, 0.0)
        outcome = min(outcome, solve_joined(system, stage, kind, cap))
        if outcome < CONVERGED and level < HALVINGS:
            break  # it will be halved
    if outcome == UNCONVERGED and level == HALVINGS and not _all_finite(system):
        outcome = NOT_FINITE
    return (int(outcome),)


@jit
def _copy(nodes: Any, work: Any, row: int, n: int, way: int) -> None:
    """The motion of n nodes to (way: OUT) the rows of work from `row` on, or BACK.

    As many rows as nodes has, which is NODE_ROWS: a number that the compiler knew would give a
    loop for each of them.
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
    """The state to (OUT) work's rows from `row` on, or BACK, of ropes and joints."""
    stack, joints = system.stack, system.joints
    for r in range(stack.counts.shape[0]):
        _copy(stack.nodes[r], stack.work[r], row, stack.counts[r, ELEMENTS] + 1, way)
    _copy(joints.nodes, joints.work, row, joints.nodes.shape[1], way)


@jit
def _accept(system: Any, found: Any) -> None:
    """The substep's motion becomes the state's."""
    _copy_all(system, ZERO, BACK)


@jit
def _copy_start(system: Any, way: int) -> None:
    """Motion of the step's start to scratch, or back."""
    _copy_all(system, KEPT_ROWS, way)


@jit
def _report_joined(rope: Any, pull: Any, row: int, time: float) -> None:
    """The rope's pull on the joint at its upper end: the balance of the half element there."""
    work, n = rope.work, rope.state.counts[ELEMENTS]
    end_rope(work, n)
    load_nodes(rope.effects, work, Stage(time, 1.0, 0.0, 0.0), n, n + 1)
    square = 0.0
    for k in range(3):
        pull[row, PULL_X + k] = work[RESIDUAL + k, n]
        square += work[RESIDUAL + k, n] ** 2
    pull[row, PULL] = square**0.5
    terms.add_pull(rope.effects, work, n, pull, row)


@jit
def _start(system: Any, boundary: Any) -> None:
    """Scratch from the states; ends take the motion of their joints."""
    stack, joints = system.stack, system.joints
    _copy_all(system, ZERO, OUT)
    for r in range(stack.counts.shape[0]):
        n = stack.counts[r, ELEMENTS]
        joined = joints.upper[r] != LOOSE
        L = stack.s[r, n] if joined else boundary.value[r, 0, LINE]
        set_lengths(stack.work[r], stack.s[r], stack.sections[r], n, L)
        joints.speed[r] = 0.0
    place_ends(system)
    _copy_all(system, ZERO, BACK)


@jit
def _recall(system: Any, boundary: Any, row: int, time: float) -> None:
    """Tensions of the state at the start of step `row`, after a failed attempt at it."""
    _start(system, boundary)
    for r in range(system.stack.counts.shape[0]):
        rope, stage = rope_of(system.stack, r), Stage(time, 1.0, 1.0, 0.0)
        if system.joints.upper[r] == LOOSE:
            stage = stage_at(rope, _boundary_of(boundary, r), row, 0.0, time, 1.0)
        pass_end(system.sheaves, system.joints, rope, r)
        stretch_all(rope, stage)


@jit_entry
def advance_joined_steps(system: Any, boundary: Any, pull: Any, time: float, steps: int) -> int:
    """What `advance_joined` compiles."""
    was = flush()
    done = _advance(hold(system), hold(boundary), pull, time, steps)
    restore(was)
    return int(done)


@jit
def _advance(system: Any, boundary: Any, pull: Any, time: float, steps: int) -> int:
    _start(system, boundary)
    h, health = system.stack.model[0, STEP], system.stack.health[0]  # counts: by the first rope
    for row in range(steps):
        now = time + row * h
        at = boundary, row, now
        if not advance_halving(system, health, at, _substep, _copy_start, _accept):
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
    return steps


_COMPILED: dict[tuple[type, ...], Any] = {}


def advance_joined(
    system: System, boundary: Boundary, pull: Floats, time: float, steps: int
) -> int:
    """Advance ropes that meet by `steps` steps from `time`; returns how many were done.

    boundary: (ropes, steps + 1, MOTIONS), the motion of hang-offs and their line out at the steps'
    borders; rows of ropes whose upper end is a joint are not read. pull: (ropes, steps,
    PULL_COLUMNS), each rope's pull on its hang-off or upper joint after each step [N], a result.
    Fewer than `steps`: the next state would not be finite; it is as it was before that step.

    Raises:
        ValueError: a table is not contiguous in memory.
    """
    if not all(table.flags.c_contiguous for table in (*boundary, pull)):
        raise ValueError("advance_joined: boundary and pull must be contiguous; give copies")
    effects = stacked_effects(system.ropes)
    for r, rope in enumerate(system.ropes):
        load(system.stack, r, rope)
    joined = Joined(system.stack._replace(effects=effects), system.joints, system.sheaves)
    kinds = (type(system.sheaves), type(system.stack.law), *map(type, effects))
    arguments = (joined, boundary, pull, time, steps)
    found = _COMPILED.get(kinds)
    if found is None:
        found = _COMPILED[kinds] = compiled(advance_joined_steps, arguments)
    done = int(found(*arguments))
    for r, rope in enumerate(system.ropes):
        store(system.stack, r, rope)
    return done
