"""Time integration of a SIMD batch: TR-BDF2 as in `core/step`, without its rare branches.

A lane is a single rope or a system of ropes (core/joined); the type of the batch's arrays selects
the code, as in `core/step`. Newton's method is in core/lanes/newton.

A rope that needs substepping or the line search, or whose top element splits or merges, takes that
step in the single-rope solver: `advance_lanes_steps` completes the step in the other lanes and
returns the remaining ones. Splits and merges are known before the step at a hang-off, after it at a
sheave.
"""

from __future__ import annotations

from math import exp
from typing import Any, NamedTuple

from rope_twin.core.elements import section_above, set_lengths
from rope_twin.core.integrator import BDF2, GAMMA, TRAPEZOID, accept, correct, step_start
from rope_twin.core.jit.decorators import jit, jit_entry
from rope_twin.core.jit.functions import flush, restore
from rope_twin.core.jit.rows import node_rows, row, system_by_reference
from rope_twin.core.jit.wide import ALL, LANES, bits, choose, mask_of, table, whole
from rope_twin.core.joined.sheaves import is_at_sheave, set_border
from rope_twin.core.joined.stack import POINT
from rope_twin.core.joined.stage import (
    by_system_type,
    count_loaded,
    count_ropes,
    gather_from_others,
    is_suspended,
    pass_sheave,
    place_all_ends,
    rope_at,
    step_of,
    tolerance_of,
)
from rope_twin.core.lanes.effects import accept_lanes, each_of, on_lanes
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
    load_trials,
    merge_length,
    minimum_length,
    prescribed,
    report_at_connection,
    report_tension,
)
from rope_twin.core.state import (
    ELEMENTS,
    END,
    LINE,
    LINE_COLUMN,
    NODE_ROWS,
    POSITION,
    REST,
    TENSION,
    VELOCITY,
    LaneStage,
)
from rope_twin.core.step import pay_out_to, settle

SOLVES_DONE, MAX_SOLVES, STEPS_DONE, SLACK_SAMPLES, TALLIES = range(5)  # rows of a lane's counters
# Columns of `samples`, one row per interval: minimum tension of an element over it [N]; at its end
# depth of the payload's middle [m], its speed downward [m/s], the lowest element's tension [N] and
# how far east and north of the upper end the lower one is [m]
MIN_TENSION, PAYLOAD_DEPTH, PAYLOAD_DESCENT, LOWEST_TENSION, EAST, NORTH, SAMPLE_COLUMNS = range(7)


class Run(NamedTuple):
    """Range of steps of a batch to advance."""

    time: float  # at the start of the batch [s]
    first: int  # the next step
    steps: int  # number of steps of the batch
    wanted: int  # active lanes, as bits
    before: int  # steps since the start of the run, at the start of the batch
    interval: int  # interval of slack detection, in steps
    late: int  # lanes that take the next step by themselves, as bits


@jit
def _may_remesh(rope: Any, rest: Any, V: Any) -> Any:
    """Return the lanes whose top element may split or merge after a step.

    rest: its unstretched length after the step [m]; V: its rate [m/s].
    """
    model, s, n = rope.model, rope.state.s, rope.state.counts[ELEMENTS]
    top = n - 1
    end = rope.sections[END, section_above(rope.sections, s[top])]
    splits = bits(s[top] + rest - end > 2.0 * minimum_length(rope, V))
    splits |= bits(rest > model.split_above)
    return splits if n <= 2 else splits | bits(rest < merge_length(rope, V))


@jit
def _accept_rope(rope: Any, mask: Any, pending: Any) -> None:
    """Copy the stage's motion with its pending correction to the state, in the lanes of `mask`."""
    nodes, work, n = rope.state.nodes, rope.work, rope.state.counts[ELEMENTS]
    first, q = rope.model.first_free, 0.5 * GAMMA * rope.model.step
    if bits(mask) == ALL:
        accept(nodes, work, q * q, q, pending, first, n)
        copy_chosen(nodes, work, mask, n, n + 1)
        return
    correct(work, q * q, q, pending, first, n)
    copy_chosen(nodes, work, mask, first, n + 1)


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
def _finish_rope(rope: Any, border: Any, pull: Any, step: int, context: Any) -> None:
    """Complete step `step`: report the tension on the hang-off.

    border: motion of the hang-off, and its row at the start of the step; context: time at the end
    of the step, lanes, and their data.
    """
    (boundary, row), (time, lanes, each) = border, context
    L, V, A = prescribed(boundary, row, LINE_COLUMN, 1.0, rope.model.step)
    n = rope.state.counts[ELEMENTS]
    rope.state.s[n] = choose(mask_of(lanes), L, rope.state.s[n])  # other lanes repeat the step
    load_trials(rope, LaneStage(time, 1.0, 0.0, V, lanes, each), A, 0.0)
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
def _sample_rope(rope: Any, samples: Any, interval: int, mask: Any) -> None:
    """Reduce a step's result into the row of its sample, in the lanes of `mask`."""
    tension, nodes = row(rope.work, TENSION, 0), rope.state.nodes
    minimum = tension[0]
    for e in range(1, rope.state.counts[ELEMENTS]):
        minimum = min(minimum, tension[e])
    x, y, z = node_rows(nodes, POSITION, 0)
    _, _, vz = node_rows(nodes, VELOCITY, 0)
    height, speed = payload_middle(rope.effects, z[0], vz[0])
    samples[interval, MIN_TENSION] = choose(
        mask, min(samples[interval, MIN_TENSION], minimum), samples[interval, MIN_TENSION]
    )
    samples[interval, PAYLOAD_DEPTH] = choose(mask, -height, samples[interval, PAYLOAD_DEPTH])
    samples[interval, PAYLOAD_DESCENT] = choose(mask, -speed, samples[interval, PAYLOAD_DESCENT])
    samples[interval, LOWEST_TENSION] = choose(mask, tension[0], samples[interval, LOWEST_TENSION])
    n = rope.state.counts[ELEMENTS]
    samples[interval, EAST] = choose(mask, x[0] - x[n], samples[interval, EAST])
    samples[interval, NORTH] = choose(mask, y[0] - y[n], samples[interval, NORTH])


@jit_entry
def advance_lanes_steps(
    arrays: Any, each: Any, known: Any, boundary: Any, pull: Any, sample: Any, run: Any
) -> int:
    """Compiled implementation of `Lanes.advance`.

    known: each lane's lowest length correction, and counters.
    """
    mode = flush()
    done = _advance(arrays, each, known, boundary, pull, sample, run)
    restore(mode)
    return int(done)


@jit
def _begin(system: Any, boundary: Any, first: int) -> None:
    """Initialise the work arrays before step `first`."""
    for r in range(count_ropes(system)):
        rope = rope_at(system, r)
        state, work, n = rope.state, rope.work, rope.state.counts[ELEMENTS]
        L = state.s[n]
        if is_suspended(system, r):
            L = border_of(system, boundary, r).value[first, LINE]
        set_lengths(work, state.s, rope.sections, n, L)
        if rope.model.first_free == 1:  # no stage moves a fixed node
            for k in range(NODE_ROWS):
                work[k, 0] = state.nodes[k, 0]


@jit
def _lanes_to_remesh(system: Any, boundary: Any, step: int) -> int:
    """Return the lanes in which an element at a hang-off may split or merge, as bits."""
    lanes = 0
    for r in range(count_ropes(system)):
        if is_suspended(system, r):
            rope = rope_at(system, r)
            border = border_of(system, boundary, r)
            L, V, _ = prescribed(border, step, LINE_COLUMN, 1.0, rope.model.step)
            lanes |= _may_remesh(rope, L - rope.state.s[rope.state.counts[ELEMENTS] - 1], V)
    return int(lanes)


@by_system_type(lambda system: 0)
def _lanes_to_remesh_at_sheaves(system: Any) -> Any:
    """Return the lanes in which an element at a sheave may split or merge after a solved step.

    The borders of the sheave are set as those of a hang-off of its ropes over the step.
    """
    return _to_remesh_at_sheaves(system.sheaves, system)


@jit
def _to_remesh_at_sheaves(sheaves: Any, system: Any) -> int:
    lanes = 0
    if sheaves is None:
        return lanes
    for r in range(count_ropes(system)):
        if is_at_sheave(sheaves, r):
            rope = rope_at(system, r)
            set_border(sheaves, system.joints.work, rope.model.step, r)
            _, V, _ = prescribed(sheaves.borders, 2 * r, LINE_COLUMN, 1.0, rope.model.step)
            lanes |= _may_remesh(rope, rope.work[REST, rope.state.counts[ELEMENTS] - 1], V)
    return lanes


@by_system_type(
    lambda system, stage, boundary, step, part: LaneStage(
        stage.time, stage.p, stage.q,
        pay_out_to(system, border_of(system, boundary, 0), step, part), stage.lanes, stage.each,
    )
)  # fmt: skip
def _begin_stage(system: Any, stage: Any, boundary: Any, step: Any, part: Any) -> Any:
    """Set the boundary conditions of all hang-offs; return the stage with the payout speed."""
    for r in range(count_ropes(system)):
        if is_suspended(system, r):
            border = border_of(system, boundary, r)
            system.joints.speed[r] = pay_out_to(rope_at(system, r), border, step, part)
    return stage


@jit
def _accept(system: Any, each: Any, accepted: int, pending: Any) -> None:
    """Copy the step's motion and internal variables to the state, in the lanes `accepted`."""
    place_all_ends(system)
    for r in range(count_ropes(system)):
        rope, q = rope_at(system, r), 0.5 * GAMMA * step_of(system)
        pass_sheave(system, rope, r, pending * q * q, pending * q)
        _accept_rope(rope, mask_of(accepted), pending)
        accept_lanes(rope.effects, each_of(each, r), count_loaded(system, r), accepted)
    keep_connections(system, mask_of(accepted))


@by_system_type(lambda system, result, context, r: False)
def _finish_at_sheave(system: Any, result: Any, context: Any, r: Any) -> Any:
    """Complete a step of rope r if its upper end is at a sheave; return whether it is.

    result: table of pulls, and its row.
    """
    return _finish_on_wheel(system.sheaves, system, result, context, r)


@jit
def _finish_on_wheel(sheaves: Any, system: Any, result: Any, context: Any, r: int) -> bool:
    if sheaves is None:
        return False
    if not is_at_sheave(sheaves, r):
        return False
    rope, (pull, step) = rope_at(system, r), result
    nodes, P = system.joints.nodes, whole(sheaves.figures[POINT, sheaves.of[r]])
    for k in range(NODE_ROWS):
        rope.state.nodes[k, rope.state.counts[ELEMENTS]] = nodes[k, P]
    _finish_rope(rope, (sheaves.borders, 2 * r), pull, step, context)
    return True


@jit
def _finish(system: Any, arrays: Any, lowest: Any, tables: Any, step: int, context: Any) -> None:
    """Complete step `step`: report tensions, let length corrections decay.

    lowest: length corrections; tables: motion and result; context: time at the end of the step,
    lanes, and their data.
    """
    (boundary, pull), (time, lanes, each) = tables, context
    for r in range(count_ropes(system)):
        rope, pulls = rope_at(system, r), table(part_of(system, pull, r)[0])
        rope_each = each_of(each, r)
        rope_context = time, lanes, rope_each
        if is_suspended(system, r):
            _finish_rope(rope, (border_of(system, boundary, r), step), pulls, step, rope_context)
        elif not _finish_at_sheave(system, (pulls, step), rope_context, r):
            zero = 0.0 * rope.model.tolerance
            stage = LaneStage(time, 1.0, 0.0, zero, lanes, rope_each)
            report_at_connection(rope, pulls, step, stage)
            continue
        _fade_offsets(rope, offsets_of(arrays, r), part_of(system, lowest, r)[0], lanes)


@jit
def _sample(system: Any, samples: Any, interval: int, kept: Any) -> None:
    """Reduce a step's result into the row of its sample, for each rope."""
    for r in range(count_ropes(system)):
        _sample_rope(rope_at(system, r), table(part_of(system, samples, r)[0]), interval, kept)


@jit
def _advance(
    arrays: Any, each: Any, known: Any, boundary: Any, pull: Any, sample: Any, run: Any
) -> int:
    system = system_by_reference(wide_system(arrays))
    lowest, tally = known
    tallies = table(tally)
    first, steps, wanted, time, h = run.first, run.steps, run.wanted, run.time, step_of(system)
    zero, c = 0.0 * tolerance_of(system), 0.5 * GAMMA * step_of(system)
    _begin(system, boundary, first)
    for step in range(first, steps):
        start = step_start(time, step, h)
        accepted = wanted & (ALL - _lanes_to_remesh(system, boundary, step))
        if step == first:
            accepted &= ALL - run.late
        for r in range(count_ropes(system)):
            gather_from_others(system, rope_at(system, r))
        solves, solves_max, pending, reuse = zero, zero, zero, 0
        for kind in (TRAPEZOID, BDF2):
            part = GAMMA if kind == TRAPEZOID else 1.0
            stage = LaneStage(start + part * h, c * c, c, zero, accepted, each)
            stage = _begin_stage(system, stage, boundary, step, part)
            unconverged, tried, count, pending = solve_stage(
                system, stage, kind, accepted, reuse, pending
            )
            reuse = bits(count <= 1.0)
            accepted &= ALL - unconverged
            pending = settle(system, on_lanes(stage, accepted), kind, pending)
            solves += tried + count
            solves_max = max(solves_max, count)
        accepted &= ALL - _lanes_to_remesh_at_sheaves(system)
        mask = mask_of(accepted)
        _accept(system, each, accepted, pending)
        _finish(system, arrays, lowest, (boundary, pull), step, (start + h, accepted, each))
        tallies[SOLVES_DONE] = tallies[SOLVES_DONE] + choose(mask, solves, 0.0)
        tallies[MAX_SOLVES] = max(tallies[MAX_SOLVES], choose(mask, solves_max, 0.0))
        tallies[STEPS_DONE] = tallies[STEPS_DONE] + choose(mask, 1.0, 0.0)
        if sample.size > 0:  # a fleet samples every step, an ensemble at intervals
            _sample(
                system,
                sample,
                (run.before + step) // run.interval - run.before // run.interval,
                mask,
            )
        elif (run.before + step + 1) % run.interval == 0:
            slack = mask_of(_slack(system) & accepted)
            tallies[SLACK_SAMPLES] = tallies[SLACK_SAMPLES] + choose(slack, 1.0, 0.0)
        if accepted != wanted:
            return int((step + 1) * (ALL + 1) + (wanted - accepted))
    return int(steps * (ALL + 1))
