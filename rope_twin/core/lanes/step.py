"""Time steps of a SIMD batch: TR-BDF2 as in `core/step`, without its rare branches.

A lane is a rope by itself or a system of ropes (core/joined); the type of the batch's arrays
selects the code, as in `core/step`. Newton's method is in core/lanes/newton.

A rope that needs substepping or the line search, or whose top element splits or merges,
takes that step in the single-rope solver: `advance_lanes_steps` does the step for the other lanes
and returns which ones are left. At a hang-off that is known before the step, at a sheave once it is
solved.
"""

from __future__ import annotations

from math import exp
from typing import Any, NamedTuple

from rope_twin.core.elements import set_element, set_top_of
from rope_twin.core.integrator import BDF2, GAMMA, TRAPEZOID, accept, correct, step_start
from rope_twin.core.jit.decorators import jit, jit_entry
from rope_twin.core.jit.functions import flush, restore
from rope_twin.core.jit.rows import hold_system, node_rows, row
from rope_twin.core.jit.wide import ALL, LANES, bits, choose, mask_of, table, whole
from rope_twin.core.joined.sheaves import is_at_sheave, set_border
from rope_twin.core.joined.stack import POINT
from rope_twin.core.joined.stage import (
    by_kind,
    count_loaded,
    count_ropes,
    face_others,
    is_hung,
    pass_sheave,
    place_all_ends,
    rope_at,
    settle_ends,
    stage_of,
    step_of,
    tolerance_of,
)
from rope_twin.core.lanes.effects import accept_lanes, each_of, on_lanes, settle_lanes
from rope_twin.core.lanes.newton import solve_stage
from rope_twin.core.lanes.system import (
    border_of,
    copy_chosen,
    keep_connections,
    offsets_of,
    part_of,
    wide_system,
)
from rope_twin.core.loads.balance import add_pull, payload_middle
from rope_twin.core.payout import (
    OFFSET_GONE,
    SMALLEST_REST,
    SMALLEST_STEPS,
    load_trials_of,
    place_hang_off,
    prescribed,
    report_at_connection,
    report_tension,
)
from rope_twin.core.state import (
    ELEMENTS,
    END,
    LENGTH,
    LINE,
    LINE_COLUMN,
    MASS,
    NODE_ROWS,
    PER_METRE,
    POSITION,
    REST,
    SAME_PLACE,
    TENSION,
    VELOCITY,
    LaneStage,
)

SOLVES_DONE, SOLVES_MOST, STEPS_DONE, SLACK_LOOKS, TALLIES = range(5)  # rows of a lane's counters
# Columns of `folds`, one row per look: least element tension over the look [N]; at its end the
# depth of the payload's middle [m], its speed downward [m/s] and the lowest element's tension [N]
LEAST, DEPTH, SINKING, LOWEST, FOLDS = range(5)


class Run(NamedTuple):
    """Range of steps of a batch to advance."""

    time: float  # at the start of the batch [s]
    first: int  # the next step
    steps: int  # number of steps of the batch
    wanted: int  # active lanes, as bits
    before: int  # steps since the start of the run, at the start of the batch
    look: int  # interval of slack detection, in steps
    late: int  # lanes that take the next step by themselves, as bits


@jit
def _set_lengths(rope: Any, place: Any, L: Any) -> None:
    """Set all elements and nodes for paid-out length L; place: section of each element."""
    work, s, sections = rope.work, rope.state.s, rope.sections
    n = rope.state.counts[ELEMENTS]
    for k in range(MASS, LENGTH + 1):
        work[k, 0] = 0.0
    for e in range(n):
        above = L if e == n - 1 else s[e + 1]
        rest = above - s[e]
        set_element(work, sections, place[e], e, rest)
        for k in range(MASS, LENGTH + 1):
            half = 0.5 * rest * sections[k - MASS + PER_METRE, place[e]]
            work[k, e] += half
            work[k, e + 1] = half


@jit
def _eventful(rope: Any, place: Any, rest: Any, V: Any) -> Any:
    """Return the lanes whose top element may split or merge after a step.

    rest: its unstretched length then [m]; V: its rate.
    """
    model, s, ends = rope.model, rope.state.s, rope.sections
    n = rope.state.counts[ELEMENTS]
    top = n - 1
    least = max(SMALLEST_STEPS * abs(V) * model.step, SMALLEST_REST)
    beyond = s[top] + rest - ends[END, place[top]]
    splits = bits(beyond > 2.0 * least) | bits(rest > model.split_above)
    if n <= 2:
        return splits
    below = rope.work[REST, top - 1] / model.element_length
    merge = max(model.merge_below * min(below, 1.0), least)
    for k in range(ends.shape[1]):
        merge = choose(abs(ends[END, k] - s[top]) <= SAME_PLACE, least, merge)
    return splits | bits(rest < merge)


@jit
def _keep(rope: Any, kept: Any, pending: Any) -> None:
    """Copy the stage's motion, with its pending correction, to the state in the lanes `kept`."""
    nodes, work, n = rope.state.nodes, rope.work, rope.state.counts[ELEMENTS]
    first, q = rope.model.first_free, 0.5 * GAMMA * rope.model.step
    if bits(kept) == ALL:
        accept(nodes, work, q * q, q, pending, first, n)
        copy_chosen(nodes, work, kept, n, n + 1)
        return
    correct(work, q * q, q, pending, first, n)
    copy_chosen(nodes, work, kept, first, n + 1)


@jit
def _fade_offsets(rope: Any, arrays: Any, lowest: Any, kept: int) -> None:
    """Let length corrections decay as in `core/step`.

    arrays: length corrections and material coordinates; lowest: each lane's lowest correction.
    """
    (offset, s), n, low = arrays, rope.state.counts[ELEMENTS], lowest[0]
    for lane in range(1, LANES):
        low = min(low, lowest[lane])
    if low == n:
        return
    keep = choose(mask_of(kept), exp(-rope.model.step / rope.model.absorb), 1.0)
    for e in range(low, n):
        rope.state.offset[e] = rope.state.offset[e] * keep
    for lane in range(LANES):
        low = lowest[lane] if kept >> lane & 1 else n
        while low < n:
            if not abs(offset[low, lane]) < OFFSET_GONE * (s[low + 1, lane] - s[low, lane]):
                break
            offset[low, lane] = 0.0
            low += 1
        if kept >> lane & 1:
            lowest[lane] = low


@jit
def _stage_at(rope: Any, place: Any, boundary: Any, step: int, kind: int, of: Any) -> Any:
    """Set the boundary condition at the stage's fraction of the step and return the stage.

    of: time, wanted lanes, and their data.
    """
    time, lanes, each = of
    n, h = rope.state.counts[ELEMENTS], rope.model.step
    part = GAMMA if kind == TRAPEZOID else 1.0
    c = 0.5 * GAMMA * h
    L, V, _ = place_hang_off(rope.work, boundary, step, part, h, n)
    places = place[n - 1], place[n - 2]
    set_top_of(rope.work, rope.state.s, rope.sections, n, (L, V), places)
    return LaneStage(time + part * h, c * c, c, V, lanes, each)


@jit
def _finish_rope(rope: Any, place: Any, border: Any, pull: Any, step: int, of: Any) -> None:
    """Complete step `step`: report the tension on the hang-off.

    border: motion of the hang-off, and the row at which the step begins there; of: time at the
    step's end, lanes, and their data.
    """
    (boundary, row), (time, lanes, each) = border, of
    L, V, A = prescribed(boundary, row, LINE_COLUMN, 1.0, rope.model.step)
    n = rope.state.counts[ELEMENTS]
    rope.state.s[n] = choose(mask_of(lanes), L, rope.state.s[n])  # others begin the step again
    stage = LaneStage(time, 1.0, 0.0, V, lanes, each)
    load_trials_of(rope, stage, A, 0.0, place[n - 1], place[n - 2])
    report_tension(rope, pull, step)
    add_pull(rope.effects, rope.work, rope.state.nodes, n, pull, step)


@jit
def _slack(system: Any) -> Any:
    """Return the lanes with a slack element."""
    slack = 0
    for r in range(count_ropes(system)):
        rope = rope_at(system, r)
        tension = row(rope.work, TENSION, 0)
        for e in range(rope.state.counts[ELEMENTS]):
            slack |= bits(tension[e] <= 0.0)
    return slack


@jit
def _fold_rope(rope: Any, folds: Any, look: int, kept: Any) -> None:
    """Fold a step's result into the row of its look, in the lanes `kept`."""
    tension, nodes = row(rope.work, TENSION, 0), rope.state.nodes
    least = tension[0]
    for e in range(1, rope.state.counts[ELEMENTS]):
        least = min(least, tension[e])
    _, _, z = node_rows(nodes, POSITION, 0)
    _, _, vz = node_rows(nodes, VELOCITY, 0)
    height, speed = payload_middle(rope.effects, z[0], vz[0])
    folds[look, LEAST] = choose(kept, min(folds[look, LEAST], least), folds[look, LEAST])
    folds[look, DEPTH] = choose(kept, -height, folds[look, DEPTH])
    folds[look, SINKING] = choose(kept, -speed, folds[look, SINKING])
    folds[look, LOWEST] = choose(kept, tension[0], folds[look, LOWEST])


@jit_entry
def advance_lanes_steps(
    arrays: Any, each: Any, known: Any, boundary: Any, pull: Any, fold: Any, run: Any
) -> int:
    """Entry point of the compiled code behind `Group.advance`.

    known: section of each element; each lane's lowest length correction, and counters.
    """
    was = flush()
    done = _advance(arrays, each, known, boundary, pull, fold, run)
    restore(was)
    return int(done)


@jit
def _begin(system: Any, place: Any, boundary: Any, first: int) -> None:
    """Set up scratch before step `first`."""
    for r in range(count_ropes(system)):
        rope = rope_at(system, r)
        L = rope.state.s[rope.state.counts[ELEMENTS]]
        if is_hung(system, r):
            L = border_of(system, boundary, r).value[first, LINE]
        _set_lengths(rope, part_of(system, place, r)[0], L)
        if rope.model.first_free == 1:  # no stage moves a fixed node
            for k in range(NODE_ROWS):
                rope.work[k, 0] = rope.state.nodes[k, 0]


@jit
def _lanes_left(system: Any, place: Any, boundary: Any, step: int) -> int:
    """Return the lanes in which the elements of a rope may change after a step, as bits."""
    left = 0
    for r in range(count_ropes(system)):
        if is_hung(system, r):
            rope = rope_at(system, r)
            own = border_of(system, boundary, r)
            L, V, _ = prescribed(own, step, LINE_COLUMN, 1.0, rope.model.step)
            rest = L - rope.state.s[rope.state.counts[ELEMENTS] - 1]
            left |= _eventful(rope, part_of(system, place, r)[0], rest, V)
    return int(left)


@by_kind(lambda system, place: 0)
def _lanes_left_at_sheaves(system: Any, place: Any) -> Any:
    """Return the lanes in which elements at a sheave may change after a step that is solved.

    The sheave is then set as a hang-off of its ropes over the step.
    """
    return _left_at_sheaves(system.sheaves, system, place)


@jit
def _left_at_sheaves(sheaves: Any, system: Any, place: Any) -> int:
    left = 0
    if sheaves is None:
        return left
    for r in range(count_ropes(system)):
        if is_at_sheave(sheaves, r):
            rope = rope_at(system, r)
            set_border(sheaves, system.joints.work, rope.model.step, r)
            _, V, _ = prescribed(sheaves.borders, 2 * r, LINE_COLUMN, 1.0, rope.model.step)
            rest = rope.work[REST, rope.state.counts[ELEMENTS] - 1]
            left |= _eventful(rope, place[r], rest, V)
    return left


@by_kind(
    lambda system, place, boundary, step, kind, of: _stage_at(
        system, place, border_of(system, boundary, 0), step, kind, of
    )
)
def _begin_stage(system: Any, place: Any, boundary: Any, step: Any, kind: Any, of: Any) -> Any:
    """Set the boundary conditions of all hang-offs; return the stage, without a payout speed."""
    stage = _still_stage(system, kind, of)
    for r in range(count_ropes(system)):
        if is_hung(system, r):
            own = border_of(system, boundary, r)
            rope = rope_at(system, r)
            system.joints.speed[r] = _stage_at(rope, place[r], own, step, kind, of).V
    return stage


@jit
def _still_stage(system: Any, kind: int, of: Any) -> Any:
    """Return a stage of all lanes without a payout speed."""
    time, lanes, each = of
    h, part = step_of(system), GAMMA if kind == TRAPEZOID else 1.0
    c = 0.5 * GAMMA * h
    return LaneStage(time + part * h, c * c, c, 0.0 * tolerance_of(system), lanes, each)


@jit
def _settle(system: Any, stage: Any, kind: int, pending: Any) -> Any:
    """Update internal variables after a stage; return the correction still pending."""
    settle_ends(system, stage, pending)
    left = pending
    for r in range(count_ropes(system)):
        rope, own = rope_at(system, r), stage_of(system, stage, r)
        left = settle_lanes(rope.effects, rope, own, kind, pending, count_loaded(system, r))
    return left


@jit
def _accept(system: Any, each: Any, kept: int, pending: Any) -> None:
    """Copy the step's motion and internal variables to the state, in the lanes `kept`."""
    place_all_ends(system)
    for r in range(count_ropes(system)):
        rope, q = rope_at(system, r), 0.5 * GAMMA * step_of(system)
        pass_sheave(system, rope, r, pending * q * q, pending * q)
        _keep(rope, mask_of(kept), pending)
        accept_lanes(rope.effects, each_of(each, r), count_loaded(system, r), kept)
    keep_connections(system, mask_of(kept))


@by_kind(lambda system, place, result, of, r: False)
def _finish_at_sheave(system: Any, place: Any, result: Any, of: Any, r: Any) -> Any:
    """Complete a step of rope r if its upper end is at a sheave; return whether it is.

    result: table of pulls, and its row.
    """
    return _finish_on_wheel(system.sheaves, system, place, result, of, r)


@jit
def _finish_on_wheel(sheaves: Any, system: Any, place: Any, result: Any, of: Any, r: int) -> bool:
    if sheaves is None:
        return False
    if not is_at_sheave(sheaves, r):
        return False
    rope, (pull, step) = rope_at(system, r), result
    nodes, P = system.joints.nodes, whole(sheaves.figures[POINT, sheaves.of[r]])
    for k in range(NODE_ROWS):
        rope.state.nodes[k, rope.state.counts[ELEMENTS]] = nodes[k, P]
    _finish_rope(rope, place[r], (sheaves.borders, 2 * r), pull, step, of)
    return True


@jit
def _finish(system: Any, arrays: Any, known: Any, tables: Any, step: int, of: Any) -> None:
    """Complete step `step`: report tensions, let length corrections decay.

    known: sections of the elements, and lowest length corrections; tables: motion and result; of:
    as for `_stage_at`.
    """
    (place, lowest), (boundary, pull), (time, lanes, each) = known, tables, of
    for r in range(count_ropes(system)):
        rope, pulls = rope_at(system, r), table(part_of(system, pull, r)[0])
        own_each = each_of(each, r)
        own_of = time, lanes, own_each
        if is_hung(system, r):
            own = border_of(system, boundary, r), step
            _finish_rope(rope, part_of(system, place, r)[0], own, pulls, step, own_of)
            _fade_offsets(rope, offsets_of(arrays, r), part_of(system, lowest, r)[0], lanes)
        elif _finish_at_sheave(system, place, (pulls, step), own_of, r):
            _fade_offsets(rope, offsets_of(arrays, r), part_of(system, lowest, r)[0], lanes)
        else:
            still = 0.0 * rope.model.tolerance
            stage = LaneStage(time, 1.0, 0.0, still, lanes, own_each)
            report_at_connection(rope, pulls, step, stage)


@jit
def _fold(system: Any, folds: Any, look: int, kept: Any) -> None:
    """Fold a step's result into the row of its look, that of each rope."""
    for r in range(count_ropes(system)):
        _fold_rope(rope_at(system, r), table(part_of(system, folds, r)[0]), look, kept)


@jit
def _advance(
    arrays: Any, each: Any, known: Any, boundary: Any, pull: Any, fold: Any, run: Any
) -> int:
    system = hold_system(wide_system(arrays))
    place, lowest, tally = known
    tallies = table(tally)
    first, steps, wanted, time, h = run.first, run.steps, run.wanted, run.time, step_of(system)
    none = 0.0 * tolerance_of(system)
    _begin(system, place, boundary, first)
    for step in range(first, steps):
        now = step_start(time, step, h)
        kept = wanted & (ALL - _lanes_left(system, place, boundary, step))
        if step == first:
            kept &= ALL - run.late
        for r in range(count_ropes(system)):
            face_others(system, rope_at(system, r))
        solves, most, pending, again = none, none, none, 0
        for kind in (TRAPEZOID, BDF2):
            stage = _begin_stage(system, place, boundary, step, kind, (now, kept, each))
            left, tried, count, pending = solve_stage(system, stage, kind, kept, again, pending)
            again = bits(count <= 1.0)
            kept &= ALL - left
            pending = _settle(system, on_lanes(stage, kept), kind, pending)
            solves += tried + count
            most = max(most, count)
        kept &= ALL - _lanes_left_at_sheaves(system, place)
        mask = mask_of(kept)
        _accept(system, each, kept, pending)
        _finish(system, arrays, (place, lowest), (boundary, pull), step, (now + h, kept, each))
        tallies[SOLVES_DONE] = tallies[SOLVES_DONE] + choose(mask, solves, 0.0)
        tallies[SOLVES_MOST] = max(tallies[SOLVES_MOST], choose(mask, most, 0.0))
        tallies[STEPS_DONE] = tallies[STEPS_DONE] + choose(mask, 1.0, 0.0)
        if fold.size > 0:  # a fleet looks at every step, an ensemble now and then
            _fold(system, fold, (run.before + step) // run.look - run.before // run.look, mask)
        elif (run.before + step + 1) % run.look == 0:
            slack = mask_of(_slack(system) & kept)
            tallies[SLACK_LOOKS] = tallies[SLACK_LOOKS] + choose(slack, 1.0, 0.0)
        if kept != wanted:
            return int((step + 1) * (ALL + 1) + (wanted - kept))
    return int(steps * (ALL + 1))
