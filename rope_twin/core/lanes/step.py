"""Time steps of a SIMD batch: TR-BDF2 as in `core/step`, without its rare branches.

**Stage**: Newton's method as in `core/newton`. A lane that has converged is frozen while others
iterate, and keeps the factors of its last elimination, with which its BDF2 stage begins
(core/newton); a lane that they do not solve is corrected with new ones. As in a single rope the
last correction stays pending: the next prediction, or the step's end, adds it. Rare cases are
excluded: a lane that needs the line search is dropped, and its rope takes the step in the
single-rope solver.

**Step.** A rope that needs substepping or the line search, or whose top element splits or merges,
takes that step in the single-rope solver: `advance_lanes_steps` does the step for the other lanes
and returns which ones are left.
"""

from __future__ import annotations

from math import exp, sqrt
from typing import Any, NamedTuple

from rope_twin.core.axial_law import law_of
from rope_twin.core.elements import count_unexpected, set_element, set_top_of, stretch, stretch_all
from rope_twin.core.integrator import (
    BDF2,
    GAMMA,
    TRAPEZOID,
    accept,
    correct,
    predict_bdf2,
    predict_trapezoid,
    step_start,
)
from rope_twin.core.jit.decorators import jit, jit_entry, jit_within
from rope_twin.core.jit.functions import flush, restore
from rope_twin.core.jit.rows import node_rows, row, rows, span
from rope_twin.core.jit.wide import ALL, LANES, bits, choose, mask_of, table, tiles, wide
from rope_twin.core.lanes.effects import (
    accept_lanes,
    calm_lanes,
    on_lanes,
    predict_lanes,
    settle_lanes,
    wide_data,
)
from rope_twin.core.loads.balance import (
    load_lowest,
    load_of,
    load_remembering,
    load_rows,
    set_block,
    set_flow,
)
from rope_twin.core.newton import CHUNK, SEARCH_FROM, count_left
from rope_twin.core.payout import (
    OFFSET_GONE,
    SMALLEST_REST,
    SMALLEST_STEPS,
    load_trials_of,
    place_hang_off,
    prescribed,
    report_tension,
)
from rope_twin.core.state import (
    ACCELERATION,
    BLOCK,
    DIRECTION,
    ELEMENTS,
    END,
    LENGTH,
    LINE,
    LINE_COLUMN,
    MASS,
    NODE_ROWS,
    PER_METRE,
    POSITION,
    RESIDUAL,
    REST,
    SAME_PLACE,
    TANGENT2_MIN,
    TENSION,
    VELOCITY,
    WORK_ROWS,
    Boundary,
    LaneStage,
    Model,
    Rope,
    State,
)
from rope_twin.core.tridiagonal import eliminate_wide, push_wide, substitute_wide

SPAN = 4


@jit
def solve_stage(rope: Any, stage: Any, kind: int, wanted: int, again: int, pending: Any) -> Any:
    """Solve for the acceleration; tension then belongs to the stage's time.

    wanted: active lanes, as bits; again: lanes that begin with the existing factors; pending:
    fraction of CORRECTION still to be added to the previous motion, of each lane. Returns the lanes
    that did not converge, of each lane the number of solutions with existing factors and that of
    corrections with new ones, and the fraction of CORRECTION that is still to be added to the
    stage's motion.
    """
    n, first = rope.state.counts[ELEMENTS], rope.model.first_free
    _evaluate(rope, stage, kind, pending)
    again &= wanted
    again &= calm_lanes(rope.effects, rope.work, on_lanes(stage, again), n, 0.0)
    none = 0.0 * rope.model.tolerance
    active, count, going = wanted & (ALL - again), none, none
    tried = choose(mask_of(again), 1.0, 0.0)
    if again != 0:
        push_wide(rope.work, first, n)
        substitute_wide(rope.work, first, n, 0, (n - first - 1) // 2)
        left = again & count_left(rope, stage, CHUNK)
        left |= _restless(rope, stage, again & (ALL - left))
        going = choose(mask_of(again & (ALL - left)), 1.0, 0.0)
        active |= left
        if active == 0:
            return 0, tried, count, going
        correct(rope.work, stage.p, stage.q, going, first, n)
        stretch_all(rope, stage)
        if left != 0:
            _reload(rope, on_lanes(stage, left))
    for correction in range(1, SEARCH_FROM + 1):
        eliminate_wide(rope.work, first, n, mask_of(active))
        going = choose(mask_of(active), 1.0, 0.0)
        count += going
        agreeing = active & _look_ahead(rope, stage)
        left = _restless(rope, stage, agreeing)
        active &= ALL - (agreeing & (ALL - left))
        if active == 0 or (correction == SEARCH_FROM and left == 0):
            break
        correct(rope.work, stage.p, stage.q, going, first, n)
        going = none
        stretch_all(rope, stage)
        _reload(rope, on_lanes(stage, active))
        if left != 0:
            active &= ALL - (left & _balanced(rope))
            if active == 0:
                break
    if bits(going > 0.0) != wanted:  # some converged before the others
        correct(rope.work, stage.p, stage.q, going, first, n)
        stretch_all(rope, stage)  # the look ahead moved them by a correction that is not theirs
        going = none
    return active, tried, count, going


@jit
def _restless(rope: Any, stage: Any, lanes: int) -> int:
    """Return those of these lanes that an active set keeps from being solved by the correction."""
    n = rope.state.counts[ELEMENTS]
    calm = calm_lanes(rope.effects, rope.work, on_lanes(stage, lanes), n, 1.0)
    return int(lanes & (ALL - calm))


@jit
def _balanced(rope: Any) -> int:
    """Return the lanes with all residuals below the tolerance, none NaN."""
    Rx, Ry, Rz = rows(rope.work, RESIDUAL, 0)
    most, fine = rope.model.tolerance * rope.model.tolerance, ALL
    for i in range(rope.model.first_free, rope.state.counts[ELEMENTS]):
        fine &= bits(Rx[i] * Rx[i] + Ry[i] * Ry[i] + Rz[i] * Rz[i] <= most)
    return int(fine)


@jit
def _evaluate(rope: Any, stage: Any, kind: int, pending: Any) -> None:
    """Evaluate motion, tension, residual and blocks of the prediction, in spans of nodes."""
    state, work, p, q = rope.state, rope.work, stage.p, stage.q
    n, first = state.counts[ELEMENTS], rope.model.first_free
    for chunk in range(0, n, CHUNK):
        end = min(chunk + CHUNK, n)
        for start in range(chunk, end, SPAN):
            low, high = max(start, first), min(start + SPAN, end)
            if kind == TRAPEZOID:
                predict_trapezoid(state.nodes, work, p, q, low, high)
            else:
                predict_bdf2(state.nodes, work, p, q, pending, low, high)
            stretch(law_of(rope), work, state.offset, p, q, max(start - 1, 0), high - 1)
        done, last = max(chunk - 1, 0), end - 1
        if end == n:
            last = n
            stretch(law_of(rope), work, state.offset, p, q, n - 1, n)
        set_flow(rope.effects, work, stage, done, last)
        predict_lanes(rope.effects, rope, stage, kind, done, last)
        _load_nodes(rope.effects, work, stage, max(done, 1), last)
    load_lowest(rope.effects, work, stage)


@jit_within
def _tangent(above: Any, below: Any, i: int) -> Any:
    """Return the unit tangent of a node, from the directions of both adjacent elements."""
    x, y, z = below[0][i] + above[0][i], below[1][i] + above[1][i], below[2][i] + above[2][i]
    inverse = 1.0 / sqrt(x * x + y * y + z * z + TANGENT2_MIN)
    return x * inverse, y * inverse, z * inverse


@jit
def _load_nodes(effects: Any, work: Any, stage: Any, low: int, high: int) -> None:
    """Set residual and block of the nodes 1 <= low <= i < high, as `balance.load_nodes` does.

    Each tangent is computed one node ahead: its root and division are done while the loads of the
    node before it are summed.
    """
    nodes = load_rows(work, low)
    T, T_below = row(work, TENSION, low), row(work, TENSION, low - 1)
    above, below = rows(work, DIRECTION, low), rows(work, DIRECTION, low - 1)
    tx, ty, tz = above
    bx, by, bz = below
    Rx, Ry, Rz = rows(work, RESIDUAL, low)
    block = span(work, BLOCK, 6, low)
    tangent = _tangent(above, below, 0)
    for i in range(high - low):
        following = _tangent(above, below, i + 1)
        load = load_of(effects, stage, nodes, tangent, i)
        Rx[i] = T[i] * tx[i] - T_below[i] * bx[i] + load.x
        Ry[i] = T[i] * ty[i] - T_below[i] * by[i] + load.y
        Rz[i] = T[i] * tz[i] - T_below[i] * bz[i] + load.z
        set_block(block, i, load)
        tangent = following
    load_remembering(effects, work, stage, low, high, True)


@jit
def _reload(rope: Any, stage: Any) -> None:
    """Evaluate residual and blocks where motion and tension are up to date."""
    _load_nodes(rope.effects, rope.work, stage, 1, rope.state.counts[ELEMENTS])
    load_lowest(rope.effects, rope.work, stage)


@jit
def _look_ahead(rope: Any, stage: Any) -> int:
    """Return the lanes whose tensions agree with their linearisation, were motion corrected.

    Direction and tension are set as if it were. It proceeds from the middle outward, in the order
    of the back-substitution.
    """
    work, first, n = rope.work, rope.model.first_free, rope.state.counts[ELEMENTS]
    pairs = (n - first - 1) // 2
    unexpected = count_unexpected(rope, stage, first + pairs, n - pairs - 1)
    for high in range(pairs, 0, -SPAN):
        low = max(high - SPAN, 0)
        substitute_wide(work, first, n, low, high)
        unexpected |= count_unexpected(rope, stage, first + low, first + high)
        unexpected |= count_unexpected(rope, stage, n - high - 1, n - low - 1)
    unexpected |= count_unexpected(rope, stage, 0, first)
    unexpected |= count_unexpected(rope, stage, n - 1, n)
    return int(ALL - unexpected)


SOLVES_DONE, SOLVES_MOST, STEPS_DONE, SLACK_LOOKS, TALLIES = range(5)  # rows of a lane's counters
# Columns of `folds`, one row per look: least element tension over the look [N]; at its end the
# lower end's depth [m], its speed downward [m/s] and the tension of the lowest element [N]
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
def _wide_rope(rope: Any) -> Any:
    """Return the rope with SIMD tables in place of arrays."""
    model, state = rope.model, rope.state
    return Rope(
        Model(
            wide(model.element_length),
            wide(model.split_above),
            wide(model.merge_below),
            model.absorb,
            model.first_free,
            model.step,
            wide(model.tolerance),
        ),
        State(
            tiles(state.nodes, NODE_ROWS),
            table(state.s),
            table(state.offset),
            state.counts,
            state.health,
        ),
        tiles(rope.work, WORK_ROWS),
        table(rope.sections),
        wide_data(rope.effects),
        wide_data(rope.law),
    )


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
def _eventful(rope: Any, place: Any, sections: int, L: Any, V: Any) -> Any:
    """Return the lanes whose top element may split or merge after a step to length L."""
    model, s, ends = rope.model, rope.state.s, rope.sections
    n = rope.state.counts[ELEMENTS]
    top = n - 1
    rest = L - s[top]
    least = max(SMALLEST_STEPS * abs(V) * model.step, SMALLEST_REST)
    beyond = s[top] + rest - ends[END, place[top]]
    splits = bits(beyond > 2.0 * least) | bits(rest > model.split_above)
    if n <= 2:
        return splits
    below = rope.work[REST, top - 1] / model.element_length
    merge = max(model.merge_below * min(below, 1.0), least)
    for k in range(sections):
        merge = choose(abs(ends[END, k] - s[top]) <= SAME_PLACE, least, merge)
    return splits | bits(rest < merge)


@jit
def _keep(rope: Any, kept: Any, pending: Any) -> None:
    """Copy the stage's motion, with its pending correction, to the state in the lanes `kept`."""
    nodes, work, n = rope.state.nodes, rope.work, rope.state.counts[ELEMENTS]
    first, q = rope.model.first_free, 0.5 * GAMMA * rope.model.step
    if bits(kept) == ALL:
        accept(nodes, work, q * q, q, pending, first, n)
        _copy_chosen(nodes, work, kept, n, n + 1)
        return
    correct(work, q * q, q, pending, first, n)
    _copy_chosen(nodes, work, kept, first, n + 1)


@jit
def _copy_chosen(nodes: Any, work: Any, kept: Any, low: int, high: int) -> None:
    """Copy motion to the state of the nodes low <= i < high in the lanes `kept`."""
    x, y, z = node_rows(nodes, POSITION, low)
    vx, vy, vz = node_rows(nodes, VELOCITY, low)
    ax, ay, az = node_rows(nodes, ACCELERATION, low)
    x_new, y_new, z_new = rows(work, POSITION, low)
    vx_new, vy_new, vz_new = rows(work, VELOCITY, low)
    ax_new, ay_new, az_new = rows(work, ACCELERATION, low)
    for i in range(high - low):
        x[i] = choose(kept, x_new[i], x[i])
        y[i] = choose(kept, y_new[i], y[i])
        z[i] = choose(kept, z_new[i], z[i])
        vx[i] = choose(kept, vx_new[i], vx[i])
        vy[i] = choose(kept, vy_new[i], vy[i])
        vz[i] = choose(kept, vz_new[i], vz[i])
        ax[i] = choose(kept, ax_new[i], ax[i])
        ay[i] = choose(kept, ay_new[i], ay[i])
        az[i] = choose(kept, az_new[i], az[i])


@jit
def _fade_offsets(rope: Any, state: Any, lowest: Any, kept: int) -> None:
    """Let length corrections decay as in `core/step`; lowest: each lane's lowest one."""
    n, low = rope.state.counts[ELEMENTS], lowest[0]
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
            if not abs(state.offset[low, lane]) < OFFSET_GONE * (
                state.s[low + 1, lane] - state.s[low, lane]
            ):
                break
            state.offset[low, lane] = 0.0
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
def _finish(rope: Any, place: Any, boundary: Any, pull: Any, step: int, of: Any) -> None:
    """Complete step `step`: report the tension on the hang-off.

    of: time at the step's end, lanes, and their data.
    """
    time, lanes, each = of
    L, V, A = prescribed(boundary, step, LINE_COLUMN, 1.0, rope.model.step)
    n = rope.state.counts[ELEMENTS]
    rope.state.s[n] = L
    stage = LaneStage(time, 1.0, 0.0, V, lanes, each)
    load_trials_of(rope, stage, A, 0.0, place[n - 1], place[n - 2])
    report_tension(rope, pull, step)


@jit
def _slack(rope: Any) -> Any:
    """Return the lanes with a slack element."""
    tension, slack = row(rope.work, TENSION, 0), 0
    for e in range(rope.state.counts[ELEMENTS]):
        slack |= bits(tension[e] <= 0.0)
    return slack


@jit
def _fold(rope: Any, folds: Any, look: int, kept: Any) -> None:
    """Fold a step's result into the row of its look, in the lanes `kept`."""
    tension, nodes = row(rope.work, TENSION, 0), rope.state.nodes
    least = tension[0]
    for e in range(1, rope.state.counts[ELEMENTS]):
        least = min(least, tension[e])
    _, _, z = node_rows(nodes, POSITION, 0)
    _, _, vz = node_rows(nodes, VELOCITY, 0)
    folds[look, LEAST] = choose(kept, min(folds[look, LEAST], least), folds[look, LEAST])
    folds[look, DEPTH] = choose(kept, -z[0], folds[look, DEPTH])
    folds[look, SINKING] = choose(kept, -vz[0], folds[look, SINKING])
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
def _advance(
    arrays: Any, each: Any, known: Any, boundary: Any, pull: Any, fold: Any, run: Any
) -> int:
    rope = _wide_rope(arrays)
    place, lowest, tally = known
    borders = Boundary(table(boundary.value), table(boundary.rate))
    pulls, tallies, folds = table(pull), table(tally), table(fold)
    first, steps, wanted, time, h = run.first, run.steps, run.wanted, run.time, rope.model.step
    sections = arrays.sections.shape[1]
    _set_lengths(rope, place, borders.value[first, LINE])
    if rope.model.first_free == 1:  # no stage moves the fixed node
        for k in range(NODE_ROWS):
            rope.work[k, 0] = rope.state.nodes[k, 0]
    for step in range(first, steps):
        now = step_start(time, step, h)
        L, V, _ = prescribed(borders, step, LINE_COLUMN, 1.0, h)
        kept = wanted & (ALL - _eventful(rope, place, sections, L, V))
        if step == first:
            kept &= ALL - run.late
        solves, most, pending, again = 0.0 * L, 0.0 * L, 0.0 * L, 0
        for kind in (TRAPEZOID, BDF2):
            stage = _stage_at(rope, place, borders, step, kind, (now, kept, each))
            left, tried, count, pending = solve_stage(rope, stage, kind, kept, again, pending)
            again = bits(count <= 1.0)
            kept &= ALL - left
            pending = settle_lanes(rope.effects, rope, on_lanes(stage, kept), kind, pending)
            solves += tried + count
            most = max(most, count)
        mask = mask_of(kept)
        _keep(rope, mask, pending)
        accept_lanes(rope.effects, each, rope.state.counts[ELEMENTS], kept)
        _finish(rope, place, borders, pulls, step, (now + h, kept, each))
        _fade_offsets(rope, arrays.state, lowest, kept)
        tallies[SOLVES_DONE] = tallies[SOLVES_DONE] + choose(mask, solves, 0.0)
        tallies[SOLVES_MOST] = max(tallies[SOLVES_MOST], choose(mask, most, 0.0))
        tallies[STEPS_DONE] = tallies[STEPS_DONE] + choose(mask, 1.0, 0.0)
        if fold.shape[0] > 0:  # a fleet looks at every step, an ensemble now and then
            _fold(rope, folds, (run.before + step) // run.look - run.before // run.look, mask)
        elif (run.before + step + 1) % run.look == 0:
            slack = mask_of(_slack(rope) & kept)
            tallies[SLACK_LOOKS] = tallies[SLACK_LOOKS] + choose(slack, 1.0, 0.0)
        if kept != wanted:
            return int((step + 1) * (ALL + 1) + (wanted - kept))
    return int(steps * (ALL + 1))
