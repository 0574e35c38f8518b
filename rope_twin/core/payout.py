"""Rope through the sheave: the top element grows and splits, shrinks and merges, without a bump.

A new node gets the *material* velocity and acceleration of the rope at its place, stands in local
dynamic equilibrium, and each half gets a length offset that makes its tension what the balance of
its ends demands; so neither the pull on the hang-off nor any acceleration changes at the event,
and the offsets then fade (Model.absorb). Material coordinates are kept: an event touches only the
end of the arrays. Trial elements are computed in the last three slots of the work arrays.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

from rope_twin.core.assembly import load_per_metre, set_lengths
from rope_twin.core.elastic import stretch, stretch_all
from rope_twin.core.jit import jit, jit_inline
from rope_twin.core.motion import prescribed
from rope_twin.core.state import (
    ACCELERATION,
    AXIAL,
    DIRECTION,
    ELEMENTS,
    GEOMETRIC,
    LINE,
    LOWEST_OFFSET,
    MERGES,
    POSITION,
    RESIDUAL,
    REST,
    SPLITS,
    TANGENT,
    TENSION,
    VELOCITY,
    Stage,
)

SPARE_SLOTS = 4  # at the end of the arrays: trial nodes below, between, above, and one free
FORCED_SPLIT = 4.0  # times split_above: an element this long splits even when slack
SAG_LIMIT = 0.05  # a new node farther off the chord than this part of it stays on the chord
NEWTON = 10
SMALLEST_REST = 1e-3  # m
SMALLEST_STEPS = 2.0  # and at least so many steps of payout


@jit_inline
def change_elements(rope: Any, boundary: Any, row: int, time: float) -> None:
    """At most one split or merge after step `row`; tensions then belong to the new elements."""
    model, state, work = rope.model, rope.state, rope.work
    n = state.counts[ELEMENTS]
    L, V, A = prescribed(boundary, row, LINE, 1.0, model.step)
    rest = work[REST, n - 1]
    stage = Stage(time + model.step, 1.0, 0.0, V)
    taut = work[TENSION, n - 1] > 0.0 and work[TENSION, n - 2] > 0.0
    changed = False
    if rest > model.split_above and n + 1 + SPARE_SLOTS < state.s.shape[0]:
        if taut or rest > FORCED_SPLIT * model.split_above:
            _split(rope, stage, A)
            changed = True
    elif n > 2 and rest < max(
        model.merge_below, SMALLEST_STEPS * abs(V) * model.step, SMALLEST_REST
    ):
        _merge(rope, stage, A)
        changed = True
    if changed:
        n = state.counts[ELEMENTS]
        for k in range(3):
            for i in range(n - 2, n + 1):
                work[POSITION + k, i] = state.nodes[POSITION + k, i]
                work[VELOCITY + k, i] = state.nodes[VELOCITY + k, i]
        set_lengths(work, state.s, n, L)
        stretch_all(rope, stage)


@jit
def balance(rope: Any, stage: Any, slot: int, element: int) -> float:
    """Force less inertia per metre at a trial node, along an element."""
    work = rope.work
    for k in range(3):
        work[TANGENT + k, slot] = work[DIRECTION + k, element]
    load_per_metre(rope, stage, slot)
    total = 0.0
    for k in range(3):
        total += work[RESIDUAL + k, slot] * work[DIRECTION + k, element]
    return total


@jit
def set_material(rope: Any, below: int, rest: float, V: float, A: float, slot: int) -> None:
    """Trial node `slot`: the rope at the hang-off, its velocity v - V·q and acceleration."""
    state, work = rope.state, rope.work
    n = state.counts[ELEMENTS]
    for k in range(3):
        q = (state.nodes[POSITION + k, n] - state.nodes[POSITION + k, below]) / rest
        q_rate = (state.nodes[VELOCITY + k, n] - state.nodes[VELOCITY + k, below] - V * q) / rest
        work[POSITION + k, slot] = state.nodes[POSITION + k, n]
        work[VELOCITY + k, slot] = state.nodes[VELOCITY + k, n] - V * q
        work[ACCELERATION + k, slot] = state.nodes[ACCELERATION + k, n] - A * q - 2.0 * V * q_rate


@jit_inline
def _find_equilibrium(rope: Any, V: float, middle: int) -> bool:
    """Move trial node `middle` to T_u·t_u - T_l·t_l + (l/2)·load = 0.

    The load is in its RESIDUAL, its neighbours are the trial nodes beside it. False if an element
    goes slack or Newton does not converge; the caller then takes the point on the chord.
    """
    work, low = rope.work, middle - 1
    still, growing = Stage(0.0, 1.0, 0.0, 0.0), Stage(0.0, 1.0, 0.0, V)
    half = 0.5 * (work[REST, low] + work[REST, middle])
    for _ in range(NEWTON):
        stretch(rope, still, low, middle)
        stretch(rope, growing, middle, middle + 1)
        if work[TENSION, low] <= 0.0 or work[TENSION, middle] <= 0.0:
            return False
        rx = work[TENSION, middle] * work[DIRECTION, middle] - work[TENSION, low] * work[DIRECTION, low] + half * work[RESIDUAL, middle]  # fmt: skip # noqa: E501
        ry = work[TENSION, middle] * work[DIRECTION + 1, middle] - work[TENSION, low] * work[DIRECTION + 1, low] + half * work[RESIDUAL + 1, middle]  # fmt: skip # noqa: E501
        rz = work[TENSION, middle] * work[DIRECTION + 2, middle] - work[TENSION, low] * work[DIRECTION + 2, low] + half * work[RESIDUAL + 2, middle]  # fmt: skip # noqa: E501
        b = work[GEOMETRIC, low] + work[GEOMETRIC, middle]
        xx, yy, zz, xy, xz, yz = b, b, b, 0.0, 0.0, 0.0
        for e in range(low, middle + 1):
            tx, ty, tz, ka = (
                work[DIRECTION, e],
                work[DIRECTION + 1, e],
                work[DIRECTION + 2, e],
                work[AXIAL, e],
            )
            xx += ka * tx * tx
            yy += ka * ty * ty
            zz += ka * tz * tz
            xy += ka * tx * ty
            xz += ka * tx * tz
            yz += ka * ty * tz
        cxx, cxy, cxz = yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy
        cyy, cyz, czz = xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy
        inverse = 1.0 / (xx * cxx + xy * cxy + xz * cxz)
        dx = inverse * (cxx * rx + cxy * ry + cxz * rz)
        dy = inverse * (cxy * rx + cyy * ry + cyz * rz)
        dz = inverse * (cxz * rx + cyz * ry + czz * rz)
        work[POSITION, middle] += dx
        work[POSITION + 1, middle] += dy
        work[POSITION + 2, middle] += dz
        if sqrt(dx * dx + dy * dy + dz * dz) < 1e-13 * 2.0 * half + 1e-12:
            return True
    return False


@jit
def _split(rope: Any, stage: Any, A: float) -> None:
    """A new node in the top element, so that a full element lies below it."""
    model, state, work = rope.model, rope.state, rope.work
    n, V = state.counts[ELEMENTS], stage.V
    e = n - 1
    rest, T = work[REST, e], work[TENSION, e]
    lower = model.element_length
    upper = rest - lower
    xi = lower / rest
    middle = state.s.shape[0] - 2
    low, high = middle - 1, middle + 1
    set_material(rope, e, rest, V, A, high)
    for k in range(3):
        work[POSITION + k, low] = state.nodes[POSITION + k, e]
        work[VELOCITY + k, low] = state.nodes[VELOCITY + k, e]
        work[ACCELERATION + k, low] = state.nodes[ACCELERATION + k, e]
        work[POSITION + k, middle] = (1.0 - xi) * state.nodes[POSITION + k, e] + xi * state.nodes[
            POSITION + k, n
        ]
        work[VELOCITY + k, middle] = (1.0 - xi) * state.nodes[VELOCITY + k, e] + xi * work[
            VELOCITY + k, high
        ]
        work[ACCELERATION + k, middle] = (1.0 - xi) * state.nodes[ACCELERATION + k, e] + xi * work[
            ACCELERATION + k, high
        ]
    offset_low, offset_up = state.offset[e] * xi, state.offset[e] * (1.0 - xi)
    if T > 0.0:
        # tensions that keep the acceleration below and the pull on the hang-off as they are
        T_low = T + 0.5 * upper * balance(rope, stage, low, e)
        T_up = T - 0.5 * lower * balance(rope, stage, high, e)
        balance(rope, stage, middle, e)
        work[REST, low], work[REST, middle] = lower, upper
        state.offset[low], state.offset[middle] = offset_low, offset_up
        for k in range(3):  # the element to the hang-off sees its geometric velocity
            work[VELOCITY + k, high] = state.nodes[VELOCITY + k, n]
        found = _find_equilibrium(rope, V, middle)
        off_chord = 0.0
        for k in range(3):
            chord = (1.0 - xi) * state.nodes[POSITION + k, e] + xi * state.nodes[POSITION + k, n]
            off_chord += (work[POSITION + k, middle] - chord) ** 2
        if not found or sqrt(off_chord) > SAG_LIMIT * rest:
            for k in range(3):
                work[POSITION + k, middle] = (1.0 - xi) * state.nodes[
                    POSITION + k, e
                ] + xi * state.nodes[POSITION + k, n]
        stretch(rope, Stage(stage.time, 1.0, 0.0, 0.0), low, middle)
        stretch(rope, stage, middle, high)
        if work[TENSION, low] > 0.0 and T_low > 0.0:
            offset_low += (T_low - work[TENSION, low]) * lower / model.EA
        if work[TENSION, middle] > 0.0 and T_up > 0.0:
            offset_up += (T_up - work[TENSION, middle]) * upper / model.EA
        state.offset[low], state.offset[middle] = 0.0, 0.0
    for k in range(3):
        state.nodes[POSITION + k, n + 1] = state.nodes[POSITION + k, n]
        state.nodes[VELOCITY + k, n + 1] = state.nodes[VELOCITY + k, n]
        state.nodes[ACCELERATION + k, n + 1] = state.nodes[ACCELERATION + k, n]
        state.nodes[POSITION + k, n] = work[POSITION + k, middle]
        state.nodes[VELOCITY + k, n] = work[VELOCITY + k, middle]
        state.nodes[ACCELERATION + k, n] = work[ACCELERATION + k, middle]
    state.s[n + 1] = state.s[n]
    state.s[n] = state.s[e] + lower
    state.offset[e], state.offset[n] = offset_low, offset_up
    state.counts[LOWEST_OFFSET] = min(state.counts[LOWEST_OFFSET], e)
    state.counts[ELEMENTS] = n + 1
    state.health[SPLITS] += 1


@jit
def _merge(rope: Any, stage: Any, A: float) -> None:
    """Drop the node below the hang-off; nothing else moves."""
    model, state, work = rope.model, rope.state, rope.work
    n, V = state.counts[ELEMENTS], stage.V
    middle = state.s.shape[0] - 2
    low, high = middle - 1, middle + 1
    upper, rest = work[REST, n - 1], work[REST, n - 2] + work[REST, n - 1]
    offset = state.offset[n - 2] + state.offset[n - 1]
    pull_before = work[TENSION, n - 1]
    set_material(rope, n - 1, upper, V, A, high)
    pull_before -= 0.5 * upper * balance(rope, stage, high, n - 1)
    taut = work[TENSION, n - 1] > 0.0
    # the merged element as a trial, from slot `low` to slot `middle`
    for k in range(3):
        work[POSITION + k, low], work[VELOCITY + k, low] = (
            state.nodes[POSITION + k, n - 2],
            state.nodes[VELOCITY + k, n - 2],
        )
        work[POSITION + k, middle], work[VELOCITY + k, middle] = (
            state.nodes[POSITION + k, n],
            state.nodes[VELOCITY + k, n],
        )
    work[REST, low], state.offset[low] = rest, offset
    stretch(rope, stage, low, middle)
    state.offset[low] = 0.0
    if taut and work[TENSION, low] > 0.0:
        set_material(rope, n - 2, rest, V, A, high)
        pull_after = work[TENSION, low] - 0.5 * rest * balance(rope, stage, high, low)
        offset += (pull_before - pull_after) * rest / model.EA
    for k in range(3):
        state.nodes[POSITION + k, n - 1] = state.nodes[POSITION + k, n]
        state.nodes[VELOCITY + k, n - 1] = state.nodes[VELOCITY + k, n]
        state.nodes[ACCELERATION + k, n - 1] = state.nodes[ACCELERATION + k, n]
    state.s[n - 1] = state.s[n]
    state.offset[n - 2] = offset
    state.offset[n - 1] = 0.0
    state.counts[LOWEST_OFFSET] = min(state.counts[LOWEST_OFFSET], n - 2)
    state.counts[ELEMENTS] = n - 1
    state.health[MERGES] += 1
