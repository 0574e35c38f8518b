"""A rigid body in SIMD lanes: its solution for all lanes together, and its kernels in the step.

Loads, momenta and Jacobian are those of a single body (core/body/loads), on wide numbers, with
masks for branches. A converged lane keeps its solution and the motion of its hook while Newton's
method continues in others, so that its evaluation is bit-identical.

Static equilibrium is not solved in lanes: a step that begins with it is taken by the single-rope
solver (core/lanes/batch).
"""

from __future__ import annotations

from math import inf, nan
from typing import Any

from rope_twin.core.body import state as at
from rope_twin.core.body.solution import hook_residual, is_solved, solve
from rope_twin.core.body.state import select, store, vector
from rope_twin.core.body.step import (
    KINDS,
    corrected_hook,
    is_as_linearised,
    load_hook,
    middle_in,
    predict_stage,
    store_middle,
    write_record,
)
from rope_twin.core.integrator import TRAPEZOID
from rope_twin.core.jit.decorators import jit_exact
from rope_twin.core.jit.functions import anywhere
from rope_twin.core.jit.rows import column
from rope_twin.core.jit.wide import ALL, bits, choose, mask_of, widened
from rope_twin.core.loads.hooks import wide_kernel
from rope_twin.core.state import POSITION, VELOCITY


@jit_exact
def _record_of(body: Any) -> Any:
    """Return the valid record of each lane, in scratch that the next evaluation overwrites.

    It takes the rows of `changes` from the first on, which follow each other in memory.
    """
    valid, record = body.memory[0, 0], body.changes[0]
    for k in range(body.records.shape[1]):
        value = body.records[0, k]
        for slot in range(1, at.RECORDS):
            value = choose(valid == float(slot), body.records[slot, k], value)
        record[k] = value
    return record


@jit_exact
def _is_here(body: Any) -> bool:
    """Return whether this rope carries the body, which it does in all lanes or in none."""
    return bool(anywhere(body.here > 0.0))


def predict(body: Any, rope: Any, stage: Any, kind: int, low: int, high: int) -> None:
    """Set the explicit part of the stage, and water and deck at its time, in all lanes."""
    if low > 0 or not _is_here(body):
        return
    body.tangent[at.ALLOWED] = rope.model.tolerance
    store(body.tangent, at.SOLVED_PLACE, (nan, nan, nan))
    predict_stage(body, rope, stage, kind, _record_of(body))


def load_end(body: Any, work: Any, stage: Any) -> None:
    """Add the slings' force on the hook, its weight and inertia to R_0, their derivative to A_0."""
    if not _is_here(body):
        return
    hook = column(work, POSITION, 0), column(work, VELOCITY, 0)
    q = widened(stage.q)
    wanted = mask_of(stage.lanes)
    # must be finite in inactive lanes, which are eliminated too and corrected by zero times it
    fine = solve(body, q, hook, wanted) | (wanted ^ mask_of(ALL))
    f = select(fine, vector(body.stage, at.HOOK_FORCE), (inf, inf, inf))
    load_hook(body, work, f, hook_residual(body, q))


def unchanged(body: Any, work: Any, stage: Any, n: int, share: float) -> int:
    """Return the lanes in which the force on the hook agrees with its linearisation, as bits."""
    if share == 0.0 or stage.lanes == 0 or not _is_here(body):
        return int(stage.lanes)
    hook = corrected_hook(work, stage, share)
    solved = is_solved(body, widened(stage.q), hook, mask_of(stage.lanes))
    return int(bits(solved & is_as_linearised(body, work, share)))


def settle(body: Any, rope: Any, stage: Any, kind: int, upto: int) -> None:
    """Store the body for the converged motion of the hook; the second stage writes a record."""
    if not _is_here(body):
        return
    hook = column(rope.work, POSITION, 0), column(rope.work, VELOCITY, 0)
    solved = is_solved(body, widened(stage.q), hook, mask_of(stage.lanes))
    if kind == TRAPEZOID:
        store_middle(body.stage)
        return
    record, speed = body.changes[0], vector(body.stage, at.SPEED)
    write_record(body, record, select(solved, speed, (nan, nan, nan)))
    _write(body, record)


@jit_exact
def _write(body: Any, record: Any) -> None:
    """Write a record to each lane's first free slot, and mark it as that of the stage's end."""
    valid, start = body.memory[0, 0], body.memory[2, 0]
    free, rest = 0.0 * valid, ALL
    for slot in range(at.RECORDS):
        occupied = bits(valid == float(slot)) | bits(start == float(slot))
        lanes = rest & (ALL - occupied)
        rest &= ALL - lanes
        mask = mask_of(lanes)
        free = choose(mask, float(slot), free)
        for k in range(body.records.shape[1]):
            body.records[slot, k] = choose(mask, record[k], body.records[slot, k])
    body.memory[1, 0] = free


def middle(body: Any, height: Any, speed: Any) -> Any:
    """Return height and vertical velocity of the body's middle in each lane."""
    if not _is_here(body):
        return height, speed
    return middle_in(body, _record_of(body))


def register() -> None:
    """Register these kernels for all types of bodies."""
    for kind in KINDS.values():
        for function in (predict, load_end, unchanged, settle, middle):
            wide_kernel(function.__name__, kind, exact=True)(function)
