"""One implicit stage of a multi-line system: Newton's method for all ropes, as in core/newton.

Passes, acceptance and line search are the same; only the linear solve includes the connections. A
stage is accepted when every tension in the system agrees with its linearisation and, where an
effect has an active set, every node and connection is balanced.

The correction of a stage is applied to the connections at once. That of the ropes' nodes may be
pending: the next pass over the nodes applies it.
"""

from __future__ import annotations

from math import isfinite
from typing import Any

from numba.extending import overload

from rope_twin.core.elements import count_unexpected, stretch
from rope_twin.core.integrator import (
    BDF2,
    CONVERGED,
    NOT_FINITE,
    PENDING,
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
)
from rope_twin.core.joined.linear_solver import solve_system
from rope_twin.core.joined.sheaves import add_sheaves, is_at_sheave, pass_end
from rope_twin.core.joined.stack import effects_at, rope_of
from rope_twin.core.joined.ties import add_ties, count_unexpected_ties, expect_pulls, pull_ties
from rope_twin.core.loads import balance, hooks
from rope_twin.core.loads.balance import load_lowest, load_nodes, set_flow, slope
from rope_twin.core.newton import CHUNK, SEARCH, SEARCH_FROM, search
from rope_twin.core.state import (
    AXIAL,
    CORRECTION,
    DIRECTION,
    ELEMENTS,
    GEOMETRIC,
    RESIDUAL,
    SOLVES,
    SOLVES_MAX,
    TENSION,
    ZERO,
    Stage,
)


@jit
def _count_left(work: Any, low: int, high: int, most: float) -> int:
    """Return how many of the nodes low <= i < high have a residual above `most` [N], or NaN."""
    count = 0
    for i in range(low, high):
        x, y, z = column(work, RESIDUAL, i)
        count += not x * x + y * y + z * z <= most * most
    return count


@jit
def _is_balanced(system: Any) -> bool:
    """Return whether the residuals of all nodes and connections are below the tolerance."""
    stack, joints = system.stack, system.joints
    most = stack.model[0, TOLERANCE]
    left = _count_left(joints.work, ZERO, joints.nodes.shape[1], most)
    for r in range(stack.counts.shape[0]):
        n = stack.counts[r, ELEMENTS]
        left += _count_left(stack.work[r], first_free(stack, r), n, most)
    return bool(left == 0)


def _switches(effects: Any) -> Any:
    """Return whether effects have active sets, so that tensions alone do not show convergence."""
    return hooks.switches(map(type, effects))


@overload(_switches, jit_options=LINKED, strict=False)
def _choose_switches(effects: Any) -> Any:
    if hooks.switches(effect.instance_class for effect in effects):
        return lambda effects: True
    return lambda effects: False


@jit
def _is_calm(system: Any, stage: Any, share: float) -> bool:
    """Return whether no active set differs between the present motion and that with share·delta."""
    calm = True
    for r in range(system.stack.counts.shape[0]):
        rope = rope_of(system.stack, r)
        calm = calm and balance.is_calm(rope.effects, rope.work, stage, _upto(system, r), share)
    return calm


@jit
def solve_joined(system: Any, stage: Any, kind: int, cap: int, pending: float) -> int:
    """Solve for the accelerations; motion and tensions then belong to the stage's time.

    Arguments and result are those of `solve_stage`; `stage` has no payout speed, as each rope has
    its own. Each stage is solved with its own factors. Iterations are counted by the first rope.
    """
    effects, health = effects_at(system.stack.effects, ZERO), system.stack.health[0]
    _evaluate(system, stage, kind, pending, 0.0)
    for correction in range(1, cap + 1):
        solve_system(system)
        health[SOLVES] += 1
        health[SOLVES_MAX] = max(health[SOLVES_MAX], correction)
        unexpected = _look_ahead(system, stage)
        if unexpected == 0 and _is_calm(system, stage, 1.0):
            return PENDING
        before = _slope(system)
        if not isfinite(before):
            return NOT_FINITE
        _evaluate(system, stage, SEARCH, 1.0, 0.0)
        if unexpected == 0 and _switches(effects) and _is_balanced(system):
            return CONVERGED
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
def _move_joints(joints: Any, stage: Any, kind: int, factor: float) -> None:
    """Set the motion of the connections: predicted, or (SEARCH) after a += factor·delta."""
    nodes, work, count = joints.nodes, joints.work, joints.nodes.shape[1]
    if kind == TRAPEZOID:
        predict_trapezoid(nodes, work, stage.p, stage.q, ZERO, count)
    elif kind == BDF2:
        predict_bdf2(nodes, work, stage.p, stage.q, 0.0, ZERO, count)
    else:
        correct(work, stage.p, stage.q, factor, ZERO, count)


@jit
def _evaluate_rope(system: Any, stage: Any, kind: int, factor: float, r: int) -> None:
    """Evaluate rope r, whose end nodes are already in place."""
    rope, upto = rope_of(system.stack, r), _upto(system, r)
    state, work, p, q = rope.state, rope.work, stage.p, stage.q
    n = state.counts[ELEMENTS]
    for start in range(0, n, CHUNK):
        low, high = max(start, rope.model.first_free), min(start + CHUNK, n)
        done, last, elements = max(start - 1, 0), high - 1, high - 1
        if kind == TRAPEZOID:
            predict_trapezoid(state.nodes, work, p, q, low, high)
        elif kind == BDF2:
            predict_bdf2(state.nodes, work, p, q, factor, low, high)
        else:
            correct(work, p, q, factor, low, high)
        if high == n:
            last, elements = upto, n
            pass_end(system.sheaves, system.joints, rope, r, 0.0, 0.0)
        stretch(rope.law, work, state.offset, p, q, done, elements)
        if high == n:
            end_rope(work, n)
        if kind != SEARCH:
            set_flow(rope.effects, work, stage, done, last)
        load_nodes(rope.effects, work, stage, max(done, 1), last)
    load_lowest(rope.effects, work, stage)
    add_couplings(rope.effects, work, stage, n, upto)


@jit
def _evaluate(system: Any, stage: Any, kind: int, factor: float, at_joints: float) -> None:
    """Evaluate motion, tension, residual and blocks of the system.

    Motion is predicted after a += factor·delta, or (SEARCH) only that is applied; at_joints: the
    factor of the connections, which are corrected ahead of the nodes.
    """
    joints = system.joints
    _move_joints(joints, stage, kind, at_joints)
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
def _pass_ahead(system: Any, rope: Any, stage: Any, r: int) -> None:
    """Place the last node of a rope at a sheave as if all motion were corrected."""
    if is_at_sheave(system.sheaves, r):
        pass_end(system.sheaves, system.joints, rope, r, stage.p, stage.q)
        for k in range(CORRECTION, CORRECTION + 3):
            rope.work[k, rope.state.counts[ELEMENTS]] = 0.0


@jit
def _look_ahead_in_rope(system: Any, stage: Any, r: int) -> int:
    """Set direction and tension of rope r as if corrected; return the deviating tensions."""
    rope = rope_of(system.stack, r)
    work, top = rope.work, rope.state.counts[ELEMENTS] - 1
    if not is_at_sheave(system.sheaves, r):
        return int(count_unexpected(rope, stage, ZERO, top + 1))
    wrong = count_unexpected(rope, stage, ZERO, top)
    x, y, z = column(work, CORRECTION, top)
    ax, ay, az = column(work, CORRECTION, top + 1)
    tx, ty, tz = column(work, DIRECTION, top)
    more = tx * (ax - x) + ty * (ay - y) + tz * (az - z)
    expected = work[TENSION, top] + (work[AXIAL, top] + work[GEOMETRIC, top]) * more
    _pass_ahead(system, rope, stage, r)
    count_unexpected(rope, stage, top, top + 1)
    return int(wrong + (not abs(work[TENSION, top] - expected) <= rope.model.tolerance))


@jit
def _look_ahead(system: Any, stage: Any) -> int:
    """Correct the connections; set direction and tension as if the ropes were corrected too.

    Returns the number of deviating tensions.
    """
    joints = system.joints
    expect_pulls(joints.ties, joints.work)
    _move_joints(joints, stage, SEARCH, 1.0)
    pull_ties(joints.ties, joints.work, stage.p, stage.q)
    unexpected = count_unexpected_ties(joints.ties, system.stack.model[0, TOLERANCE])
    for r in range(system.stack.counts.shape[0]):
        unexpected += _look_ahead_in_rope(system, _stage_of(system, stage, r), r)
    return int(unexpected)


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
    _evaluate(system, stage, SEARCH, factor, factor)
