"""One implicit stage of a multi-line system: Newton's method for all ropes, as in core/newton.

Passes, acceptance and line search are the same; only the linear solve includes the connections. A
stage is accepted when every tension in the system agrees with its linearisation and, where an
effect has an active set, every node and connection is balanced.
"""

from __future__ import annotations

from math import isfinite
from typing import Any

import numpy as np
from numba.extending import overload

from rope_twin.core.elements import stretch, stretch_corrected
from rope_twin.core.integrator import (
    BDF2,
    CONVERGED,
    NOT_FINITE,
    TRAPEZOID,
    UNCONVERGED,
    correct,
    predict_bdf2,
    predict_trapezoid,
)
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
from rope_twin.core.loads import hooks
from rope_twin.core.loads.balance import load_lowest, load_nodes, set_flow, slope
from rope_twin.core.newton import CHUNK, SEARCH, SEARCH_FROM, search
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
    """Return how many of the nodes low <= i < high have a residual above `most` [N], or NaN."""
    count = 0
    for i in range(low, high):
        x, y, z = column(work, RESIDUAL, i)
        count += not x * x + y * y + z * z <= most * most
    return count


@jit
def _is_balanced(system: Any, stage: Any) -> bool:
    """Return whether all residuals are below the tolerance, with all loads evaluated again."""
    _evaluate(system, stage, RELOAD, 0.0)
    stack, joints = system.stack, system.joints
    most = stack.model[0, TOLERANCE]
    left = _count_left(joints.work, ZERO, joints.nodes.shape[1], most)
    for r in range(stack.counts.shape[0]):
        n = stack.counts[r, ELEMENTS]
        left += _count_left(stack.work[r], first_free(stack, r), n, most)
    return bool(left == 0)


def _balances(effects: Any, system: Any, stage: Any) -> Any:
    """Return whether the stage is converged with regard to effects with active sets."""
    return not hooks.switches(map(type, effects)) or _is_balanced(system, stage)


@overload(_balances, jit_options=LINKED, strict=False)
def _choose_balance(effects: Any, system: Any, stage: Any) -> Any:
    if hooks.switches(effect.instance_class for effect in effects):
        return lambda effects, system, stage: _is_balanced(system, stage)
    return lambda effects, system, stage: True


@jit
def solve_joined(system: Any, stage: Any, kind: int, cap: int) -> int:
    """Solve for the accelerations; motion and tensions then belong to the stage's time.

    Arguments and result are those of `solve_stage`; `stage` has no payout speed, as each rope has
    its own. Iterations are counted by the first rope.
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
    """Close a rope at node n, without an element above: only the element below it acts."""
    for k in range(DIRECTION, DIRECTION + 3):
        work[k, n] = work[k, n - 1]
    work[TENSION, n] = 0.0
    work[AXIAL, n] = 0.0


@jit
def _stage_of(system: Any, stage: Any, r: int) -> Any:
    """Return the stage of rope r, with its own payout speed."""
    return Stage(stage.time, stage.p, stage.q, system.joints.speed[r])


@jit
def _upto(system: Any, r: int) -> int:
    """Return the number of nodes of rope r that carry loads: all except a hang-off."""
    return int(system.stack.counts[r, ELEMENTS] + (system.joints.upper[r] != LOOSE))


@jit
def _move(motion: Any, stage: Any, kind: int, factor: float, low: int, high: int) -> None:
    """Set the motion of the nodes low <= i < high: predicted, or (SEARCH) after a += factor·delta.

    motion: the rows of the state and of the scratch.
    """
    nodes, work = motion
    if kind == TRAPEZOID:
        predict_trapezoid(nodes, work, stage.p, stage.q, low, high)
    elif kind == BDF2:
        predict_bdf2(nodes, work, stage.p, stage.q, 0.0, low, high)
    else:
        correct(work, stage.p, stage.q, factor, low, high)


@jit
def _move_joints(joints: Any, stage: Any, kind: int, factor: float) -> None:
    """Set the motion of the connections, like `_move`."""
    _move((joints.nodes, joints.work), stage, kind, factor, ZERO, joints.nodes.shape[1])


@jit
def _evaluate_rope(system: Any, stage: Any, kind: int, factor: float, r: int) -> None:
    """Evaluate rope r, whose end nodes are already in place."""
    rope, upto = rope_of(system.stack, r), _upto(system, r)
    work, n = rope.work, rope.state.counts[ELEMENTS]
    for start in range(0, n, CHUNK):
        low, high = max(start, rope.model.first_free), min(start + CHUNK, n)
        done, last, elements = max(start - 1, 0), high - 1, high - 1
        if high == n:
            last, elements = upto, n
        if kind != RELOAD:
            _move((rope.state.nodes, work), stage, kind, factor, low, high)
            if high == n:
                pass_end(system.sheaves, system.joints, rope, r)
            stretch(rope.law, work, rope.state.offset, stage.p, stage.q, done, elements)
        if high == n:
            end_rope(work, n)
        if kind < SEARCH:
            set_flow(rope.effects, work, stage, done, last)
        load_nodes(rope.effects, work, stage, max(done, 1), last)
    load_lowest(rope.effects, work, stage)
    add_couplings(rope.effects, work, stage, n, upto)


@jit
def _evaluate(system: Any, stage: Any, kind: int, factor: float) -> None:
    """Evaluate motion, tension, residual and blocks of the system; RELOAD: the latter two."""
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
    """Assemble residual and matrix of the connections, without the condensed chains."""
    clear(system.joints)
    gather_ends(system)
    add_ties(system.joints.ties, system.joints.work, system.joints.matrix)
    add_sheaves(system.sheaves, system, stage)


@jit
def _correct_rope(system: Any, stage: Any, r: int) -> Any:
    """Apply the correction to rope r, whose end nodes are already in place."""
    rope = rope_of(system.stack, r)
    work, n = rope.work, rope.state.counts[ELEMENTS]
    before, unexpected = 0.0, 0
    for start in range(0, n, CHUNK):
        low, high = max(start, rope.model.first_free), min(start + CHUNK, n)
        before += slope(work, low, high)
        correct(work, stage.p, stage.q, 1.0, low, high)
        unexpected += stretch_corrected(rope, stage, max(start - 1, 0), high - 1)
    pass_end(system.sheaves, system.joints, rope, r)
    return before, unexpected + stretch_corrected(rope, stage, n - 1, n)


@jit
def _correct(system: Any, stage: Any) -> Any:
    """Apply a += delta with motion and tension; return R·delta and the deviating tensions."""
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
    """Return R·delta summed over all ropes and connections."""
    stack, total = system.stack, joint_slope(system.joints)
    for r in range(stack.counts.shape[0]):
        total += slope(stack.work[r], first_free(stack, r), stack.counts[r, ELEMENTS])
    return total


@jit
def _correct_by(system: Any, stage: Any, factor: float) -> None:
    """Apply a += factor·delta and evaluate the system."""
    _evaluate(system, stage, SEARCH, factor)
