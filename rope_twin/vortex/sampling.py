"""Sampling of a rope in a run: relative flow, tangents, curvature, and the sampling interval.

The interval resolves the fastest vortices, and is at most a real-time cycle.
"""

from __future__ import annotations

from math import pi, sqrt
from typing import Any

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.jit.decorators import jit, jit_entry
from rope_twin.core.state import ELEMENTS, FLOW, POSITION, VELOCITY, Boundary, Floats, Rope
from rope_twin.effects.bending import Bending

SAMPLES_PER_PERIOD = 24  # samples per period of the fastest vortices: resolves a crest to 0.9 %
AVERAGING_PERIODS = 10.0  # of the means, in periods of the fastest vortices
# ratios to the design frequency at which the interval changes
SHORTEN_ABOVE, LENGTHEN_BELOW = 1.25, 0.5
_FLOW = slice(rows.FLOW, rows.FLOW + 3)
_SPEED = slice(rows.VELOCITY, rows.VELOCITY + 3)


def along(rope: Rope) -> Floats:
    """Return the nodes' coordinates along the stretched rope, from the hang-off, negative [m]."""
    found = np.empty(int(rope.state.counts[ELEMENTS]) + 1)
    _along(rope.state.nodes, found)
    return found


def mix_flow(flow: Floats, rope: Rope, share: float) -> None:
    """Update the running mean `flow` of relative water velocity [m/s], (3, shares), by a fraction.

    flow: at equal fractions of the elements from the lower end up; the hang-off has the value of
    the node below.
    """
    _mix(flow, rope.state.nodes, rope.work, int(rope.state.counts[ELEMENTS]), share)


def mean_around(at: Floats, s: Floats, values: Floats, least: Floats) -> Floats:
    """Return weighted means of `values`, linear between `s`, around each of `at`.

    `at` and `s` are ascending. The weight falls linearly to 0 at the neighbours of `at`, so that a
    sum over coarse nodes contains everything that oscillates between them. `least`, (len(at),):
    minimum half width of the window, so that oscillations of about that period give the same mean
    on any mesh. Values are mirrored at both ends of `s`.
    """
    found, once, twice = np.empty(len(at)), np.empty(len(s)), np.empty(len(s))
    _mean(at, s, values, least, once, twice, found)
    return found


@jit_entry
def _along(nodes: Any, found: Any) -> None:
    n = found.shape[0] - 1
    found[n] = 0.0
    for i in range(n - 1, -1, -1):
        square = 0.0
        for k in range(POSITION, POSITION + 3):
            step = nodes[k, i + 1] - nodes[k, i]
            square += step * step
        found[i] = found[i + 1] - sqrt(square)


@jit_entry
def _mix(flow: Any, nodes: Any, work: Any, n: int, share: float) -> None:
    shares = flow.shape[1]
    for j in range(shares):
        place = j * n / (shares - 1.0)
        i = min(int(place), n - 1)
        part, above = place - i, min(i + 1, n - 1)
        for k in range(3):
            low = work[FLOW + k, i] - nodes[VELOCITY + k, i]
            high = work[FLOW + k, above] - nodes[VELOCITY + k, above]
            flow[k, j] += share * (low + part * (high - low) - flow[k, j])


@jit_entry
def _mean(at: Any, s: Any, values: Any, least: Any, once: Any, twice: Any, found: Any) -> None:
    once[0] = twice[0] = 0.0  # integrals of the values from s[0], and double integrals
    for i in range(1, s.shape[0]):
        step = s[i] - s[i - 1]
        once[i] = once[i - 1] + 0.5 * (values[i] + values[i - 1]) * step
        twice[i] = twice[i - 1] + once[i - 1] * step
        twice[i] += (2.0 * values[i - 1] + values[i]) * step * step / 6.0
    last, length, low, high = at.shape[0] - 1, s[-1] - s[0], 0, 0
    for node in range(last + 1):
        middle = min(max(at[node], s[0]), s[-1])
        down = at[node] - at[node - 1] if node > 0 else at[1] - at[0]
        up = at[node + 1] - at[node] if node < last else at[last] - at[last - 1]
        down = min(max(down, least[node]), length)
        up = min(max(up, least[node]), length)
        low, high = _below(s, middle - down, low), _below(s, middle + up, high)
        here = _twice(s, values, once, twice, middle, _below(s, middle, low))
        above = _mirrored(s, values, once, twice, middle + up, high) - here
        below = here - _mirrored(s, values, once, twice, middle - down, low)
        found[node] = (above / up - below / down) / (0.5 * (up + down))


@jit
def _below(s: Any, at: float, guess: int) -> int:
    """Return the index of the last of `s` not above `at`, from a guess; 0 if all are above."""
    i, last = guess, s.shape[0] - 1
    while i < last and s[i + 1] <= at:
        i += 1
    while i > 0 and s[i] > at:
        i -= 1
    return i


@jit
def _twice(s: Any, values: Any, once: Any, twice: Any, at: float, i: int) -> float:
    """Return the double integral of the values from s[0] to `at`; i: the last of `s` below."""
    i = min(i, s.shape[0] - 2)
    step = at - s[i]
    slope = (values[i + 1] - values[i]) / (s[i + 1] - s[i])
    inner = 0.5 * values[i] + slope * step / 6.0
    return float(twice[i] + step * (once[i] + step * inner))


@jit
def _mirrored(s: Any, values: Any, once: Any, twice: Any, at: float, guess: int) -> float:
    """Return the double integral, extended beyond the ends of `s` by mirroring."""
    if at < s[0]:
        inside = 2.0 * s[0] - at
        return float(_twice(s, values, once, twice, inside, _below(s, inside, guess)))
    if at > s[-1]:
        inside = 2.0 * s[-1] - at
        found = _twice(s, values, once, twice, inside, _below(s, inside, guess))
        return float(found + 2.0 * once[-1] * (at - s[-1]))
    return float(_twice(s, values, once, twice, at, guess))


def shedding_hz(rope: Rope, boundary: Boundary, strouhal: float) -> float:
    """Frequency of the fastest vortices, by the flow relative to the hang-off's velocity [Hz]."""
    n = int(rope.state.counts[rows.ELEMENTS])
    flow = rope.work[rows.FLOW : rows.FLOW + 3, :n] - boundary.rate[0, :3, None]
    flow[2] = 0.0  # heave and waves' vertical motion run along the rope
    along = tangents(rope.state.nodes[rows.POSITION : rows.POSITION + 3, : n + 1])[:, :n]
    return max_shedding_hz(flow, along, diameters(rope)[:n], strouhal)


def sampling_steps(hz: float, step_s: float, cycle: int) -> int:
    """Number of steps between samples for this frequency of the fastest vortices.

    cycle: steps of a real-time cycle, which has a whole number of samples, so that they come at the
    same instants for any step.
    """
    if hz == 0.0:
        return cycle
    most = max(1, min(cycle, int(1.0 / (SAMPLES_PER_PERIOD * hz * step_s) + 1e-9)))
    return next(steps for steps in range(most, 0, -1) if cycle % steps == 0)


def needs_new_interval(hz: float, made_for_hz: float, other_current: bool) -> bool:
    """Return whether the interval must change; only another current makes it longer."""
    slower = other_current and hz < LENGTHEN_BELOW * made_for_hz
    return hz > SHORTEN_ABOVE * made_for_hz or slower


def relative_flow(rope: Rope) -> Floats:
    """Velocity of water relative to rope at the nodes [m/s], (3, nodes).

    The hang-off has the value of the node below it.
    """
    n = int(rope.state.counts[rows.ELEMENTS])
    relative = rope.work[_FLOW, : n + 1] - rope.state.nodes[_SPEED, : n + 1]
    relative[:, n] = relative[:, n - 1]
    return np.asarray(relative)


def max_shedding_hz(flow: Floats, along: Floats, diameter: Floats, strouhal: float) -> float:
    """Frequency of the fastest vortices, St·|U across the rope|/d at the nodes [Hz]."""
    across = flow - (flow * along).sum(axis=0) * along
    return float((strouhal * np.sqrt((across * across).sum(axis=0)) / diameter).max())


def tangents(place: Floats) -> Floats:
    """Unit vectors along the rope at its nodes, upward, (3, nodes)."""
    step = np.diff(place, axis=1)
    along = np.concatenate([step[:, :1], step[:, 1:] + step[:, :-1], step[:, -1:]], axis=1)
    return np.asarray(along / np.sqrt((along * along).sum(axis=0)))


def diameters(rope: Rope) -> Floats:
    """Hydrodynamic diameter at the nodes [m], (nodes,)."""
    n, sections = int(rope.state.counts[rows.ELEMENTS]), rope.sections
    s = rope.state.s[: n + 1]
    which = np.searchsorted(sections[rows.END], 0.5 * (s[1:] + s[:-1]), side="right")
    diameter = np.sqrt(4.0 * sections[rows.PER_METRE + 1, which] / pi)
    return np.append(diameter, diameter[-1])


def flow_directions(place: Floats, flow: Floats) -> Floats:
    """Unit vectors across rope and flow, and across the rope with the flow, (2, 3, nodes)."""
    along = tangents(place)
    across: Any = np.cross(flow, along, axis=0)
    size = np.sqrt((across * across).sum(axis=0))
    east = np.zeros_like(along)
    east[0] = 1.0
    across = np.where(size > 1e-9, across, np.cross(east, along, axis=0))
    across = across / np.maximum(np.sqrt((across * across).sum(axis=0)), 1e-12)
    return np.stack([across, np.cross(along, across, axis=0)])


def curvature(rope: Rope) -> tuple[Floats, Floats]:
    """Curvature of the rope at its nodes by its bending effect, in components of `turned`.

    Returns material coordinates of the nodes [m], (nodes,), and curvature [1/m], (2, nodes).
    """
    n = int(rope.state.counts[rows.ELEMENTS])
    s = rope.state.s[: n + 1]
    rest = np.diff(s)
    q = np.diff(rope.state.nodes[rows.POSITION : rows.POSITION + 3, : n + 1], axis=1) / rest
    bent = np.zeros((3, n + 1))
    bent[:, 1:-1] = np.diff(q, axis=1) / (0.5 * (rest[1:] + rest[:-1]))
    for own in rope.effects:
        if isinstance(own, Bending) and own.clamp > 0.0:
            held = np.array([own.x, own.y, own.z])
            lacking = held - q[:, -1]
            bent[:, -1] = 2.0 / rest[-1] * (lacking - (lacking @ held) * held)
    along = np.concatenate([q[:, :1], q[:, 1:] + q[:, :-1], q[:, -1:]], axis=1)
    return s, turned(bent, along / np.sqrt((along * along).sum(axis=0)))


def turned(vectors: Floats, along: Floats) -> Floats:
    """Components (2, points) of vectors (3, points) across a rope along unit vectors.

    East and north as carried along by a rope that is tilted from upright without twist: a·b - (a·(e
    + t))·t_b/(1 + t_z), with e upward and t along the rope.
    """
    lean = vectors[2] + (vectors * along).sum(axis=0)
    share = lean / np.maximum(1.0 + along[2], 1e-9)
    return np.asarray(vectors[:2] - share * along[:2])


def bending_stiffness(effects: tuple[Any, ...]) -> float:
    """Bending stiffness EI of the rope [N·m²]; 0: none."""
    return float(sum(own.EI for own in effects if isinstance(own, Bending)))
