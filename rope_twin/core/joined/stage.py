"""One implicit stage of ropes that meet: Newton over all of them at once, as in core/solve/stage.

The same passes, acceptance and line search; only the solve goes over the joints. A stage is
accepted when every tension in the system is what the linearisation expected of it and, where an
effect's loads come and go, every node and joint is in balance.
"""

from __future__ import annotations

from math import isfinite
from typing import Any

import numpy as np
from numba.extending import overload

from rope_twin.core.acting import hooks
from rope_twin.core.jit.decorators import LINKED, jit
from rope_twin.core.jit.rows import column
from rope_twin.core.joined.condensation import add_couplings
from rope_twin.core.joined.joints import (
    LOOSE,
    TOLERANCE,
    clear,
    first_free,
    gather_ends,
    joint_slope,
    place_ends,
    solve_system,
)
from rope_twin.core.joined.sheaves import add_sheaves, pass_end
from rope_twin.core.joined.stack import rope_of
from rope_twin.core.joined.ties import add_ties, count_unexpected_ties, expect_pulls, pull_ties
from rope_twin.core.rope.elastic import growth_of, stretch, stretch_corrected, stretch_top
from rope_twin.core.solve.assembly import load_lowest, load_nodes, set_flow, slope
from rope_twin.core.solve.prediction import correct, predict_bdf2, predict_trapezoid
from rope_twin.core.solve.search import SEARCH_FROM, search
from rope_twin.core.solve.stage import (
    BDF2,
    CHUNK,
    CONVERGED,
    NOT_FINITE,
    SEARCH,
    TRAPEZOID,
    UNCONVERGED,
)
from rope_twin.core.state import (
    AXIAL,
    DIRECTION,
    ELEMENTS,
    RESIDUAL,
    SOLVES,
    SOLVES_MAX,
    TENSION,
    ZERO,
    Stage,
)

RELOAD = np.int64(3)  # after TRAPEZOID, BDF2 and SEARCH: motion and tension are up to date


@jit
def _count_left(work: Any, low: int, high: int, most: float) -> int:
    """How many of the nodes low <= i < high are left with a force above `most` [N], or with NaN."""
    count = 0
    for i in range(low, high):
        x, y, z = column(work, RESIDUAL, i)
        count += not x * x + y * y + z * z <= most * most
    return count


@jit
def _is_balanced(system: Any, stage: Any) -> bool:
    """Whether no node or joint is left with a force above the tolerance, all loads taken anew."""
    _evaluate(system, stage, RELOAD, 0.0)
    stack, joints = system.stack, system.joints
    most = stack.model[0, TOLERANCE]
    left = _count_left(joints.work, ZERO, joints.nodes.shape[1], most)
    for r in range(stack.counts.shape[0]):
        n = stack.counts[r, ELEMENTS]
        left += _count_left(stack.work[r], first_free(stack, r), n, most)
    return bool(left == 0)


def _balances(effects: Any, system: Any, stage: Any) -> Any:
    """Whether the stage is solved as far as loads that come and go are concerned."""
    return not hooks.switches(map(type, effects)) or _is_balanced(system, stage)


@overload(_balances, jit_options=LINKED, strict=False)
def _choose_balance(effects: Any, system: Any, stage: Any) -> Any:
    if hooks.switches(effect.instance_class for effect in effects):
        return lambda effects, system, stage: _is_balanced(system, stage)
    return lambda effects, system, stage: True


@jit
def solve_joined(system: Any, stage: Any, kind: int, cap: int) -> int:
    """Find the accelerations; motion and tensions then belong to the stage's time.

    Arguments and result are those of `solve_stage`; `stage` has no payout speed, which the ropes
    have each. The counts of solves are kept by the first rope.
    """
    health = system.stack.health[0]
    _evaluate(system, stage, kind, 0.0)
    for correction in range(1, cap + 1):
        solve_system(system)
        health[SOLVES] += 1
        before, unexpected = _correct(system, stage)
        health[SOLVES_MAX] = max(health[SOLVES_MAX], correction)
        if not isfinite(before):
            return NOT_FINITE
        if unexpected == 0 and _balances(system.stack.effects, system, stage):
            return CONVERGED
        _evaluate(system, stage, RELOAD, 0.0)
        if correction >= SEARCH_FROM:
            search(system, stage, before, _correct_by, _slope)
    return UNCONVERGED


@jit
def end_rope(work: Any, n: int) -> None:
    """No element above node n: it lies along the one below, which alone pulls at it."""
    for k in range(DIRECTION, DIRECTION + 3):
        work[k, n] = work[k, n - 1]
    work[TENSION, n] = 0.0
    work[AXIAL, n] = 0.0


@jit
def _stage_of(system: Any, stage: Any, r: int) -> Any:
    """The stage as rope r sees it, with its own payout speed."""
    return Stage(stage.time, stage.p, stage.q, system.joints.speed[r])


@jit
def _upto(system: Any, r: int) -> int:
    """How many nodes of rope r carry loads: all but a hang-off's."""
    return int(system.stack.counts[r, ELEMENTS] + (system.joints.upper[r] != LOOSE))


@jit
def _move(motion: Any, stage: Any, kind: int, factor: float, low: int, high: int) -> None:
    """Motion of the nodes low <= i < high: of the prediction, or (SEARCH) of a += factor·delta.

    motion: the rows of the state and of the scratch.
    """
    nodes, work = motion
    if kind == TRAPEZOID:
        predict_trapezoid(nodes, work, stage.p, stage.q, low, high)
    elif kind == BDF2:
        predict_bdf2(nodes, work, stage.p, stage.q, low, high)
    else:
        correct(work, stage.p, stage.q, factor, low, high)


@jit
def _move_joints(joints: Any, stage: Any, kind: int, factor: float) -> None:
    """The same for the joints."""
    _move((joints.nodes, joints.work), stage, kind, factor, ZERO, joints.nodes.shape[1])


@jit
def _evaluate_rope(system: Any, stage: Any, kind: int, factor: float, r: int) -> None:
    """What `_evaluate` does for rope r, whose ends stand where they belong."""
    rope, upto = rope_of(system.stack, r), _upto(system, r)
    work, n = rope.work, rope.state.counts[ELEMENTS]
    for start in range(0, n, CHUNK):
        low, high = max(start, rope.model.first_free), min(start + CHUNK, n)
        done, last = max(start - 1, 0), high - 1
        if high == n:
            last = upto
        if kind != RELOAD:
            _move((rope.state.nodes, work), stage, kind, factor, low, high)
            if high == n:
                pass_end(system.sheaves, system.joints, rope, r)
                stretch_top(rope, stage)
            stretch(rope.law, work, rope.state.offset, stage.p, stage.q, 0.0, done, high - 1)
        if high == n:
            end_rope(work, n)
        if kind < SEARCH:
            set_flow(rope.effects, work, stage, done, last)
        load_nodes(rope.effects, work, stage, max(done, 1), last)
    load_lowest(rope.effects, work, stage)
    add_couplings(rope.effects, work, stage, n, upto)


@jit
def _evaluate(system: Any, stage: Any, kind: int, factor: float) -> None:
    """Motion, tension, residual and blocks of ropes and joints; RELOAD: the latter two."""
    joints = system.joints
    if kind != RELOAD:
        _move_joints(joints, stage, kind, factor)
        place_ends(system)
        pull_ties(joints.ties, joints.work, stage.p, stage.q)
    for r in range(system.stack.counts.shape[0]):
        _evaluate_rope(system, _stage_of(system, stage, r), kind, factor, r)
    _gather(system, stage)


@jit
def _gather(system: Any, stage: Any) -> None:
    """Residual and matrix of the joints, but for what the chains leave there."""
    clear(system.joints)
    gather_ends(system)
    add_ties(system.joints.ties, system.joints.work, system.joints.matrix)
    add_sheaves(system.sheaves, system, stage)


@jit
def _correct_rope(system: Any, stage: Any, r: int) -> Any:
    """What `_correct` does for rope r, whose ends stand where they belong."""
    rope = rope_of(system.stack, r)
    work, n = rope.work, rope.state.counts[ELEMENTS]
    before, unexpected = 0.0, 0
    for start in range(0, n, CHUNK):
        low, high = max(start, rope.model.first_free), min(start + CHUNK, n)
        before += slope(work, low, high)
        correct(work, stage.p, stage.q, 1.0, low, high)
        unexpected += stretch_corrected(rope, stage, 0.0, max(start - 1, 0), high - 1)
    pass_end(system.sheaves, system.joints, rope, r)
    return before, unexpected + stretch_corrected(rope, stage, growth_of(rope, stage), n - 1, n)


@jit
def _correct(system: Any, stage: Any) -> Any:
    """a += delta, with motion and tension; R·delta, and how many tensions were not expected so."""
    joints = system.joints
    before = joint_slope(joints)
    expect_pulls(joints.ties, joints.work)
    _move_joints(joints, stage, SEARCH, 1.0)
    place_ends(system)
    pull_ties(joints.ties, joints.work, stage.p, stage.q)
    unexpected = count_unexpected_ties(joints.ties, system.stack.model[0, TOLERANCE])
    for r in range(system.stack.counts.shape[0]):
        more, wrong = _correct_rope(system, _stage_of(system, stage, r), r)
        before += more
        unexpected += wrong
    return before, unexpected


@jit
def _slope(system: Any) -> Any:
    """R·delta of all ropes and joints."""
    stack, total = system.stack, joint_slope(system.joints)
    for r in range(stack.counts.shape[0]):
        total += slope(stack.work[r], first_free(stack, r), stack.counts[r, ELEMENTS])
    return total


@jit
def _correct_by(system: Any, stage: Any, factor: float) -> None:
    """a += factor·delta, with all that follows from it."""
    _evaluate(system, stage, SEARCH, factor)
