"""Remeshing at the sheave: split and merge of the top element without a transient.

A new node gets the *material* velocity and acceleration of the rope at its position, is placed in
local dynamic equilibrium, and each half gets a length correction that makes its tension what the
balance of its ends demands; so neither the tension at the hang-off nor any acceleration changes at
the event, and the corrections then decay (Model.absorb). Material coordinates are kept: an event
changes only the end of the arrays. A boundary between sections becomes a node as soon as it has
left the sheave.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

from rope_twin.core.banded.nodes import add_six, solve_symmetric, spring
from rope_twin.core.jit.decorators import jit
from rope_twin.core.jit.rows import copy
from rope_twin.core.payout.trial import AFTER, HIGH, LOW, MIDDLE, TRIALS, along
from rope_twin.core.rope.elastic import stretch, stretch_all
from rope_twin.core.rope.sections import (
    SAME_PLACE,
    section_above,
    set_element,
    set_growth,
    set_lengths,
)
from rope_twin.core.state import (
    DIRECTION,
    ELEMENTS,
    END,
    GROWTH,
    LOWEST_OFFSET,
    MERGES,
    NODE_ROWS,
    POSITION,
    RESIDUAL,
    REST,
    SPLITS,
    STIFFNESS,
    TENSION,
    VELOCITY,
    ZERO,
)

FORCED_SPLIT = 4.0  # times split_above: an element this long splits even when slack
SAG_LIMIT = 0.05  # of the chord: a new node farther off it is placed on the chord
MAX_ITERATIONS = 10
# Convergence of a new node's position: relative to the element that it splits, and [m]
POSITION_TOL, POSITION_TOL_M = 1e-13, 1e-12
SMALLEST_REST = 1e-3  # m
SMALLEST_STEPS = 2.0  # and at least this many steps of payout


@jit
def change_elements(rope: Any, stage: Any, L: float, lower: float) -> None:
    """Perform at most one split or merge after a step; tensions then belong to the new elements.

    stage: time and payout speed at the step's end; lower: of `split_length`. The ghost nodes must
    have been loaded for this state.
    """
    model, state, work = rope.model, rope.state, rope.work
    n = state.counts[ELEMENTS]
    rest = work[REST, n - 1]
    taut = work[TENSION, n - 1] > 0.0 and work[TENSION, n - 2] > 0.0
    room = n + 1 < state.s.shape[0] - TRIALS
    if lower > 0.0:
        if room and (taut or rest > FORCED_SPLIT * model.split_above):
            _split(rope, stage, lower)
    elif n > 2 and rest < _merge_length(rope, stage.V):
        _merge(rope, stage)
    if state.counts[ELEMENTS] != n:
        n = state.counts[ELEMENTS]
        copy(state.nodes, ZERO, work, ZERO, n + 1)
        set_lengths(work, state.s, rope.sections, n, L)
        set_growth(work, n - 1, stage.V)
        stretch_all(rope, stage)


@jit
def split_length(rope: Any, V: float) -> Any:
    """Return the unstretched length of the lower part of a top element to be split; 0 if it is not.

    A section's end that is paid out by twice the minimum length determines the new node's position.
    """
    n = rope.state.counts[ELEMENTS]
    s, rest = rope.state.s[n - 1], rope.work[REST, n - 1]
    end = rope.sections[END, section_above(rope.sections, s)]
    if s + rest - end > 2.0 * _least_length(rope, V):
        return end - s
    return rope.model.element_length if rest > rope.model.split_above else 0.0


@jit
def _merge_length(rope: Any, V: float) -> Any:
    """Return the unstretched length below which the top element merges.

    A section's end is kept as long as possible. Next to an element shorter than standard the limit
    is reduced in proportion.
    """
    top, least = rope.state.counts[ELEMENTS] - 1, _least_length(rope, V)
    s, below = rope.state.s[top], rope.work[REST, top - 1] / rope.model.element_length
    for k in range(rope.sections.shape[1]):
        if abs(rope.sections[END, k] - s) <= SAME_PLACE:
            return least
    return max(rope.model.merge_below * min(below, 1.0), least)


@jit
def _least_length(rope: Any, V: float) -> Any:
    return max(SMALLEST_STEPS * abs(V) * rope.model.step, SMALLEST_REST)


@jit
def _find_equilibrium(rope: Any, middle: int) -> bool:
    """Move ghost node `middle` to T_u·t_u - T_l·t_l + (l/2)·load = 0.

    The load is in its RESIDUAL, its neighbours are the adjacent ghost nodes. Returns False if an
    element goes slack or Newton's method does not converge; the caller then uses the point on the
    chord.
    """
    work, low = rope.work, middle - 1
    half = 0.5 * (work[REST, low] + work[REST, middle])
    for _ in range(MAX_ITERATIONS):
        stretch(rope.law, rope.work, rope.state.offset, 1.0, 0.0, low, middle + 1)
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
def _split(rope: Any, stage: Any, lower: float) -> None:
    """Insert a new node in the top element, `lower` above the element's lower end."""
    state, work = rope.state, rope.work
    e = state.counts[ELEMENTS] - 1
    rest = work[REST, e]
    xi = lower / rest
    shares = xi * state.offset[e], (1.0 - xi) * state.offset[e]
    if work[TENSION, e] > 0.0:
        shares = _balance_parts(rope, stage.V, lower, shares)
    _insert(rope, e, lower, shares)


@jit
def _balance_parts(rope: Any, V: float, lower: float, shares: Any) -> Any:
    """Place the new node in equilibrium; return the length corrections of both parts.

    They preserve the acceleration below and the tension at the hang-off; a section that begins at
    the new node has its own weight for the rope above it. shares: fractions of the existing
    correction.
    """
    state, work, sections = rope.state, rope.work, rope.sections
    e, slots = state.counts[ELEMENTS] - 1, state.s.shape[0]
    low, middle, high, after = slots + LOW, slots + MIDDLE, slots + HIGH, slots + AFTER
    (share_low, share_up), rest, T = shares, work[REST, e], work[TENSION, e]
    upper = rest - lower
    T_low = T + 0.5 * upper * along(work, low, e)
    T_up = T - 0.5 * (rest * along(work, high, e) - upper * along(work, after, e))
    below = section_above(sections, state.s[e])
    above = section_above(sections, state.s[e] + lower)
    set_element(work, sections, below, low, lower)
    set_element(work, sections, above, middle, upper)
    state.offset[low], state.offset[middle] = share_low, share_up
    for k in range(3):  # the top element uses the geometric velocity of the hang-off
        work[VELOCITY + k, high] = state.nodes[VELOCITY + k, e + 1]
    work[GROWTH, middle] = V / upper
    _place_middle(rope, rest, middle)
    if above != below:
        _keep_strain_rate(rope, V, rest, upper)
    stretch(rope.law, work, state.offset, 1.0, 0.0, low, high)
    if work[TENSION, low] > 0.0 and T_low > 0.0:
        share_low += (T_low - work[TENSION, low]) / work[STIFFNESS, low]
    if work[TENSION, middle] > 0.0 and T_up > 0.0:
        share_up += (T_up - work[TENSION, middle]) / work[STIFFNESS, middle]
    state.offset[low], state.offset[middle] = 0.0, 0.0
    return share_low, share_up


@jit
def _place_middle(rope: Any, rest: float, middle: int) -> None:
    """Move the new node from the chord into equilibrium, if that is found near the chord."""
    work = rope.work
    cx, cy, cz = work[POSITION, middle], work[POSITION + 1, middle], work[POSITION + 2, middle]
    found = _find_equilibrium(rope, middle)
    x, y, z = work[POSITION, middle], work[POSITION + 1, middle], work[POSITION + 2, middle]
    ox, oy, oz = x - cx, y - cy, z - cz
    if not found or sqrt(ox * ox + oy * oy + oz * oz) > SAG_LIMIT * rest:
        work[POSITION, middle], work[POSITION + 1, middle] = cx, cy
        work[POSITION + 2, middle] = cz


@jit
def _insert(rope: Any, e: int, lower: float, offsets: Any) -> None:
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
def _keep_strain_rate(rope: Any, V: float, rest: float, upper: float) -> None:
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
def _merge(rope: Any, stage: Any) -> None:
    """Remove the node below the hang-off; nothing else moves."""
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
    stretch(rope.law, rope.work, rope.state.offset, 1.0, 0.0, low, middle)
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
