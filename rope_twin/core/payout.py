"""Payout and haul-in: prescribed motion, hang-off tension, splitting and merging of elements.

**Motion.** Hang-off and paid-out length are cubic Hermite polynomials over a step, from values and
rates at the step boundaries (a Boundary: rows are boundaries, columns x, y, z and paid-out length),
so that every stage and substep has the prescribed motion at its own time.

**Ghost nodes** at the end of the arrays are points of the rope where the force per metre is
evaluated after every step, in one pass. LOW is the node below the top element, HIGH the rope that
passes the hang-off, MIDDLE the node that a split would insert between them. AFTER is the rope at
the hang-off after the next event: of the section above a new node, or, without a split, with the
node below removed. HIGH gives the hang-off tension; with the others a split or merge balances its
forces without another evaluation of the effects.

**Split and merge** of the top element cause no transient. A new node gets the *material* velocity
and acceleration of the rope at its position and is placed in local dynamic equilibrium. Each half
gets a length correction, so that its tension satisfies the balance of its ends: neither the
hang-off tension nor any acceleration changes at the event, and the corrections then decay
(Model.absorb). Material coordinates are preserved: an event changes only the end of the arrays. A
boundary between sections becomes a node as soon as it has left the sheave.
"""

from __future__ import annotations

from math import exp, sqrt
from typing import Any

from rope_twin.core.axial_law import law_of
from rope_twin.core.elements import (
    end_rope,
    section_above,
    set_element,
    set_growth,
    set_lengths,
    stretch,
    stretch_all,
)
from rope_twin.core.elimination import add_six, solve_symmetric, spring
from rope_twin.core.jit.decorators import jit, jit_within
from rope_twin.core.jit.rows import column, copy
from rope_twin.core.jit.wide import choose
from rope_twin.core.loads.balance import add_load, add_pull, load_nodes, set_flow, set_pull
from rope_twin.core.state import (
    ACCELERATION,
    AFTER,
    DIRECTION,
    ELEMENTS,
    END,
    GROWTH,
    HIGH,
    LENGTH,
    LINE_COLUMN,
    LOW,
    LOWEST_OFFSET,
    MASS,
    MERGES,
    MIDDLE,
    NODE_ROWS,
    PER_METRE,
    POSITION,
    RESIDUAL,
    REST,
    SAME_PLACE,
    SPLITS,
    STIFFNESS,
    STRETCH2_MIN,
    TANGENT,
    TENSION,
    VELOCITY,
    ZERO,
    Boundary,
    Floats,
    Model,
    Rope,
    Stage,
    State,
)

TRIALS = 4
FORCED_SPLIT = 4.0  # times split_above: a longer element splits even when slack
SAG_LIMIT = 0.05  # of the chord: a new node farther off it is placed on the chord
MAX_ITERATIONS = 10
# Convergence of a new node's position: relative to the element that it splits, and [m]
POSITION_TOL, POSITION_TOL_M = 1e-13, 1e-12
SMALLEST_REST = 1e-3  # m
SMALLEST_STEPS = 2.0  # and at least this many steps of payout
OFFSET_GONE = 1e-15  # a decaying length correction below this fraction of its element is set to 0


@jit
def prescribed(boundary: Boundary, row: int, column: int, part: float, h: float) -> Any:
    """Return value, rate and second derivative of a column at the fraction `part` of a step."""
    y0, y1 = boundary.value[row, column], boundary.value[row + 1, column]
    d0, d1 = boundary.rate[row, column] * h, boundary.rate[row + 1, column] * h
    return hermite(y0, y1, d0, d1, part, h)


@jit
def hermite(y0: float, y1: float, d0: float, d1: float, u: float, h: float) -> Any:
    """Return value and two derivatives of a cubic Hermite polynomial at the fraction u of a span h.

    y0, y1: values at both ends; d0, d1: rates there times h.
    """
    c2 = 3.0 * (y1 - y0) - 2.0 * d0 - d1
    c3 = 2.0 * (y0 - y1) + d0 + d1
    value = y0 + u * (d0 + u * (c2 + u * c3))
    first = (d0 + u * (2.0 * c2 + u * 3.0 * c3)) / h
    second = (2.0 * c2 + 6.0 * c3 * u) / (h * h)
    return value, first, second


@jit
def place_hang_off(
    work: Floats, boundary: Boundary, row: int, part: float, h: float, n: int
) -> Any:
    """Set the hang-off's motion at node n; return paid-out length L, its rate and acceleration."""
    for k in range(3):
        value, first, second = prescribed(boundary, row, k, part, h)
        work[POSITION + k, n] = value
        work[VELOCITY + k, n] = first
        work[ACCELERATION + k, n] = second
    return prescribed(boundary, row, LINE_COLUMN, part, h)


@jit
def finish(rope: Rope, boundary: Boundary, pull: Any, row: int, time: float) -> None:
    """Complete step `row`, which ends at `time`: report tension, split or merge the top element."""
    state, h = rope.state, rope.model.step
    L, V, A = prescribed(boundary, row, LINE_COLUMN, 1.0, h)
    stage = Stage(time, 1.0, 0.0, V)
    state.s[state.counts[ELEMENTS]] = L
    _fade_offsets(rope.model, state, state.counts[ELEMENTS])
    lower = split_length(rope, V)
    load_trials(rope, stage, A, lower)
    report_tension(rope, pull, row)
    add_pull(rope.effects, rope.work, state.nodes, state.counts[ELEMENTS], pull, row)
    change_elements(rope, stage, L, lower)


@jit
def _fade_offsets(model: Model, state: State, n: int) -> None:
    """Let length corrections of splits and merges decay with the time constant `absorb`."""
    keep = exp(-model.step / model.absorb)
    low = state.counts[LOWEST_OFFSET]
    for e in range(low, n):
        state.offset[e] *= keep
    while low < n and abs(state.offset[low]) < OFFSET_GONE * (state.s[low + 1] - state.s[low]):
        state.offset[low] = 0.0
        low += 1
    state.counts[LOWEST_OFFSET] = low


@jit
def report_tension(rope: Rope, pull: Any, row: int) -> None:
    """Write the rope's tension on the hang-off at the end of step `row`, from the ghost node there.

    The force balance of the half element at the hang-off is -T·t + (l/2)·(loads - m·a), with the
    material velocity and acceleration of the rope that passes it. The tension of the top element
    itself has a saw-tooth of m·g·l/2 during payout.
    """
    state, work = rope.state, rope.work
    n, slot = state.counts[ELEMENTS], state.s.shape[0] + HIGH
    half, T = 0.5 * work[REST, n - 1], work[TENSION, n - 1]
    x = half * work[RESIDUAL, slot] - T * work[DIRECTION, n - 1]
    y = half * work[RESIDUAL + 1, slot] - T * work[DIRECTION + 1, n - 1]
    z = half * work[RESIDUAL + 2, slot] - T * work[DIRECTION + 2, n - 1]
    set_pull(pull, row, x, y, z)


@jit
def report_at_connection(rope: Any, pull: Any, row: int, stage: Any) -> None:
    """Write the rope's tension on its upper connection, from the balance of its half element."""
    work, n = rope.work, rope.state.counts[ELEMENTS]
    end_rope(work, n)
    load_nodes(rope.effects, work, stage, n, n + 1)
    set_pull(pull, row, *column(work, RESIDUAL, n))
    add_pull(rope.effects, work, rope.state.nodes, n, pull, row)


@jit
def change_elements(rope: Rope, stage: Stage, L: float, lower: float) -> None:
    """Perform at most one split or merge after a step, and update element tensions.

    stage: time and payout speed at the step's end; lower: result of `split_length`. The ghost nodes
    must have been loaded for this state.
    """
    model, state, work = rope.model, rope.state, rope.work
    n = state.counts[ELEMENTS]
    rest = work[REST, n - 1]
    taut = work[TENSION, n - 1] > 0.0 and work[TENSION, n - 2] > 0.0
    has_space = n + 1 < state.s.shape[0] - TRIALS
    if lower > 0.0:
        if has_space and (taut or rest > FORCED_SPLIT * model.split_above):
            _split(rope, stage, lower)
    elif n > 2 and rest < merge_length(rope, stage.V):
        _merge(rope, stage)
    if state.counts[ELEMENTS] != n:
        n = state.counts[ELEMENTS]
        copy(state.nodes, ZERO, work, ZERO, n + 1)
        set_lengths(work, state.s, rope.sections, n, L)
        set_growth(work, n - 1, stage.V)
        stretch_all(rope, stage)


@jit
def split_length(rope: Rope, V: float) -> Any:
    """Return the unstretched length of the lower part of a top element to be split, 0 for no split.

    If a section's end is paid out by twice the minimum length, the new node is placed there.
    """
    n = rope.state.counts[ELEMENTS]
    s, rest = rope.state.s[n - 1], rope.work[REST, n - 1]
    end = rope.sections[END, section_above(rope.sections, s)]
    if s + rest - end > 2.0 * minimum_length(rope, V):
        return end - s
    return rope.model.element_length if rest > rope.model.split_above else 0.0


@jit
def merge_length(rope: Any, V: Any) -> Any:
    """Return the unstretched length below which the top element merges.

    A node at a section's end is retained down to the minimum length. Next to an element shorter
    than standard the limit is reduced in proportion.
    """
    top, minimum = rope.state.counts[ELEMENTS] - 1, minimum_length(rope, V)
    s, below = rope.state.s[top], rope.work[REST, top - 1] / rope.model.element_length
    merge = max(rope.model.merge_below * min(below, 1.0), minimum)
    for k in range(rope.sections.shape[1]):
        merge = choose(abs(rope.sections[END, k] - s) <= SAME_PLACE, minimum, merge)
    return merge


@jit
def minimum_length(rope: Any, V: Any) -> Any:
    """Return the smallest unstretched length of a top element that pays out at V [m/s]."""
    return max(SMALLEST_STEPS * abs(V) * rope.model.step, SMALLEST_REST)


@jit
def _split(rope: Rope, stage: Stage, lower: float) -> None:
    """Insert a new node in the top element, `lower` above the element's lower end."""
    state, work = rope.state, rope.work
    e = state.counts[ELEMENTS] - 1
    rest = work[REST, e]
    xi = lower / rest
    offsets = xi * state.offset[e], (1.0 - xi) * state.offset[e]
    if work[TENSION, e] > 0.0:
        offsets = _balance_parts(rope, stage.V, lower, offsets)
    _insert(rope, e, lower, offsets)


@jit
def _merge(rope: Rope, stage: Stage) -> None:
    """Remove the node below the hang-off, with a length correction that preserves the tension."""
    state, work, sections = rope.state, rope.work, rope.sections
    n, slots = state.counts[ELEMENTS], state.s.shape[0]
    low, middle, high, after = slots + LOW, slots + MIDDLE, slots + HIGH, slots + AFTER
    upper, rest = work[REST, n - 1], work[REST, n - 2] + work[REST, n - 1]
    offset = state.offset[n - 2] + state.offset[n - 1]
    T = work[TENSION, n - 1]
    pull_before = T - 0.5 * upper * along(work, high, n - 1)
    # the merged element as a probe, from slot `low` to slot `middle`
    for k in range(VELOCITY + 3):
        work[k, low], work[k, middle] = state.nodes[k, n - 2], state.nodes[k, n]
    set_element(work, sections, section_above(sections, state.s[n - 2]), low, rest)
    state.offset[low] = offset
    work[GROWTH, low] = stage.V / rest
    stretch(law_of(rope), rope.work, rope.state.offset, 1.0, 0.0, low, middle)
    state.offset[low] = 0.0
    if T > 0.0 and work[TENSION, low] > 0.0:
        pull_after = work[TENSION, low] - 0.5 * rest * along(work, after, low)
        offset += (pull_before - pull_after) / work[STIFFNESS, low]
    for k in range(NODE_ROWS):
        state.nodes[k, n - 1] = state.nodes[k, n]
    state.s[n - 1] = state.s[n]
    state.offset[n - 2] = offset
    state.offset[n - 1] = 0.0
    state.counts[LOWEST_OFFSET] = min(state.counts[LOWEST_OFFSET], n - 2)
    state.counts[ELEMENTS] = n - 1
    state.health[MERGES] += 1


@jit
def _balance_parts(rope: Rope, V: float, lower: float, offsets: Any) -> Any:
    """Place the new node in equilibrium; return the length corrections of both parts.

    They preserve the acceleration below and the tension at the hang-off, also where a new section
    begins at the node. offsets: the existing correction, divided between both parts.
    """
    state, work, sections = rope.state, rope.work, rope.sections
    e, slots = state.counts[ELEMENTS] - 1, state.s.shape[0]
    low, middle, high, after = slots + LOW, slots + MIDDLE, slots + HIGH, slots + AFTER
    (offset_low, offset_up), rest, T = offsets, work[REST, e], work[TENSION, e]
    upper = rest - lower
    T_low = T + 0.5 * upper * along(work, low, e)
    T_up = T - 0.5 * (rest * along(work, high, e) - upper * along(work, after, e))
    below = section_above(sections, state.s[e])
    above = section_above(sections, state.s[e] + lower)
    set_element(work, sections, below, low, lower)
    set_element(work, sections, above, middle, upper)
    state.offset[low], state.offset[middle] = offset_low, offset_up
    for k in range(3):  # the top element uses the geometric velocity of the hang-off
        work[VELOCITY + k, high] = state.nodes[VELOCITY + k, e + 1]
    work[GROWTH, middle] = V / upper
    _place_middle(rope, rest, middle)
    if above != below:
        _keep_strain_rate(rope, V, rest, upper)
    stretch(law_of(rope), work, state.offset, 1.0, 0.0, low, high)
    if work[TENSION, low] > 0.0 and T_low > 0.0:
        offset_low += (T_low - work[TENSION, low]) / work[STIFFNESS, low]
    if work[TENSION, middle] > 0.0 and T_up > 0.0:
        offset_up += (T_up - work[TENSION, middle]) / work[STIFFNESS, middle]
    state.offset[low], state.offset[middle] = 0.0, 0.0
    return offset_low, offset_up


@jit
def _place_middle(rope: Rope, rest: float, middle: int) -> None:
    """Move the new node from the chord into equilibrium, if that is found near the chord."""
    work = rope.work
    cx, cy, cz = work[POSITION, middle], work[POSITION + 1, middle], work[POSITION + 2, middle]
    converged = _find_equilibrium(rope, middle)
    x, y, z = work[POSITION, middle], work[POSITION + 1, middle], work[POSITION + 2, middle]
    ox, oy, oz = x - cx, y - cy, z - cz
    if not converged or sqrt(ox * ox + oy * oy + oz * oz) > SAG_LIMIT * rest:
        work[POSITION, middle], work[POSITION + 1, middle] = cx, cy
        work[POSITION + 2, middle] = cz


@jit
def _find_equilibrium(rope: Rope, middle: int) -> bool:
    """Move ghost node `middle` to T_u·t_u - T_l·t_l + (l/2)·load = 0.

    The load is in its RESIDUAL, its neighbours are the adjacent ghost nodes. Returns False if an
    element goes slack or Newton's method does not converge; the caller then uses the point on the
    chord.
    """
    work, low = rope.work, middle - 1
    half = 0.5 * (work[REST, low] + work[REST, middle])
    for _ in range(MAX_ITERATIONS):
        stretch(law_of(rope), rope.work, rope.state.offset, 1.0, 0.0, low, middle + 1)
        T_low, T_up = work[TENSION, low], work[TENSION, middle]
        if T_low <= 0.0 or T_up <= 0.0:
            return False
        rx = T_up * work[DIRECTION, middle] - T_low * work[DIRECTION, low]
        ry = T_up * work[DIRECTION + 1, middle] - T_low * work[DIRECTION + 1, low]
        rz = T_up * work[DIRECTION + 2, middle] - T_low * work[DIRECTION + 2, low]
        rx += half * work[RESIDUAL, middle]
        ry += half * work[RESIDUAL + 1, middle]
        rz += half * work[RESIDUAL + 2, middle]
        K = add_six(spring(work, low), spring(work, middle))
        dx, dy, dz = solve_symmetric(K, (rx, ry, rz))
        work[POSITION, middle] += dx
        work[POSITION + 1, middle] += dy
        work[POSITION + 2, middle] += dz
        if sqrt(dx * dx + dy * dy + dz * dz) < POSITION_TOL * 2.0 * half + POSITION_TOL_M:
            return True
    return False


@jit
def _keep_strain_rate(rope: Rope, V: float, rest: float, upper: float) -> None:
    """Set the ghost node's velocity to preserve the strain rate of the rope above it.

    A section with another stiffness leaves the sheave at another speed V·(1 + strain); its damper
    must not interpret that as a strain rate.
    """
    nodes, work, n = rope.state.nodes, rope.work, rope.state.counts[ELEMENTS]
    middle = rope.state.s.shape[0] + MIDDLE
    for k in range(3):
        q = (nodes[POSITION + k, n] - nodes[POSITION + k, n - 1]) / rest
        q_above = (nodes[POSITION + k, n] - work[POSITION + k, middle]) / upper
        work[VELOCITY + k, middle] += V * (q - q_above)


@jit
def _insert(rope: Rope, e: int, lower: float, offsets: Any) -> None:
    """Turn ghost node MIDDLE into a node, and element e into two."""
    state, work, n = rope.state, rope.work, e + 1
    middle = state.s.shape[0] + MIDDLE
    for k in range(NODE_ROWS):
        state.nodes[k, n + 1] = state.nodes[k, n]
        state.nodes[k, n] = work[k, middle]
    state.s[n + 1] = state.s[n]
    state.s[n] = state.s[e] + lower
    state.offset[e], state.offset[n] = offsets
    state.counts[LOWEST_OFFSET] = min(state.counts[LOWEST_OFFSET], e)
    state.counts[ELEMENTS] = n + 1
    state.health[SPLITS] += 1


@jit
def _set_material(rope: Rope, below: int, rest: float, V: float, A: float, slot: int) -> None:
    """Set a ghost node to the rope at the hang-off, whose element extends down to node `below`.

    Its velocity is v - V·q and its acceleration a - A·q - 2·V·dq/dt, with q the element's vector
    over its unstretched length.
    """
    nodes, work = rope.state.nodes, rope.work
    n = rope.state.counts[ELEMENTS]
    dx = nodes[POSITION, n] - nodes[POSITION, below]
    dy = nodes[POSITION + 1, n] - nodes[POSITION + 1, below]
    dz = nodes[POSITION + 2, n] - nodes[POSITION + 2, below]
    work[TANGENT, slot], work[TANGENT + 1, slot], work[TANGENT + 2, slot] = dx, dy, dz
    length = sqrt(dx * dx + dy * dy + dz * dz + STRETCH2_MIN * rest * rest)
    for k in range(3):
        q = work[TANGENT + k, slot] / rest
        q_rate = (nodes[VELOCITY + k, n] - nodes[VELOCITY + k, below] - V * q) / rest
        work[POSITION + k, slot] = nodes[POSITION + k, n]
        work[VELOCITY + k, slot] = nodes[VELOCITY + k, n] - V * q
        work[ACCELERATION + k, slot] = nodes[ACCELERATION + k, n] - A * q - 2.0 * V * q_rate
        work[TANGENT + k, slot] /= length


@jit
def load_trials(rope: Any, stage: Any, A: Any, lower: float) -> None:
    """Store the force less inertia per metre at the ghost nodes in their RESIDUAL.

    For the state after a step: `work` holds its elements, stage its time and payout speed V; A is
    dV/dt, `lower` the unstretched length below MIDDLE.
    """
    state, work, sections = rope.state, rope.work, rope.sections
    n, slots = state.counts[ELEMENTS], state.s.shape[0]
    low, middle, high, after = slots + LOW, slots + MIDDLE, slots + HIGH, slots + AFTER
    s, rest = state.s, work[REST, n - 1]
    section = section_above(sections, s[n - 1])
    section_after = section_above(sections, s[n - 1] + lower if lower > 0.0 else s[n - 2])
    xi = min(lower / rest, 1.0)
    _set_material(rope, n - 1, rest, stage.V, A, high)
    below, length = n - 1, rest
    if not lower > 0.0:
        below, length = n - 2, rest + work[REST, n - 2]
    _set_material(rope, below, length, stage.V, A, after)
    for k in range(NODE_ROWS):
        work[k, low] = state.nodes[k, n - 1]
        work[k, middle] = (1.0 - xi) * work[k, low] + xi * work[k, high]
    for k in range(TANGENT, TANGENT + 3):
        work[k, low] = work[k, middle] = work[k, high]
    for row in range(MASS, LENGTH + 1):
        per_metre, per_metre_after = (
            sections[row - MASS + PER_METRE, section],
            sections[row - MASS + PER_METRE, section_after],
        )
        work[row, low], work[row, high], work[row, after] = per_metre, per_metre, per_metre_after
        work[row, middle] = xi * per_metre + (1.0 - xi) * per_metre_after
    for slot in range(low, slots):
        for k in range(3):
            work[RESIDUAL + k, slot] = 0.0
    set_flow(rope.effects, work, stage, low, slots)
    add_load(rope.effects, work, stage, low, slots)


@jit_within
def set_trials(memory: Any, row: int, value: float, rope: Rope) -> None:
    """Set one value at every ghost node, in a row of an effect's internal variables."""
    slots = rope.state.s.shape[0]
    for slot in range(slots - TRIALS, slots):
        memory[row, slot] = value


@jit
def along(work: Floats, slot: int, element: int) -> float:
    """Return the component of a ghost node's load along an element [N/m]."""
    total = 0.0
    for k in range(3):
        total += work[RESIDUAL + k, slot] * work[DIRECTION + k, element]
    return total
