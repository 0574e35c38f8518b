"""Samples of a rope in a time-domain run with a VIV model, at equal intervals.

A model inside the time step moves the nodes of the rope. A loosely coupled model
(rope_twin.vortex.coupled) has its own motion, cross-flow only, and amplifies the drag; it is
sampled right after each of its updates.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.state import Floats, Rope
from rope_twin.errors import InputError
from rope_twin.scene.rigging import runs_over_sheave
from rope_twin.studies.driven_twin import Motion, Speeds, march
from rope_twin.twin.snapshot import Snapshot
from rope_twin.twin.twin import Twin
from rope_twin.vortex.coupled import VivDragAmplification
from rope_twin.vortex.line_model import (
    bending_stiffness,
    curvature,
    flow_directions,
    relative_flow,
    tangents,
)

PLACES = 200  # along the rope, over its length at the time
PER_PERIOD = 24  # samples per period of the fastest vortices
MIN_PER_PERIOD = 4.0  # of a model outside the time step, which advances once a step at most
AHEAD_S = 5.0  # by which `march` submits winch commands in advance
_PLACE = slice(rows.POSITION, rows.POSITION + 3)


class Sample(NamedTuple):
    """One instant at the places, from the rope's upper end down."""

    moved: Floats  # across the flow and with it, of its model [m]; NaN: it has none, (2, places)
    across: Floats  # water relative to rope, normal to it [m/s], (3, places)
    amplified: Floats  # drag amplification of the model, (places,)
    bent: Floats  # curvature [1/m], (2, places)


class SampledRope(NamedTuple):
    """One rope of a twin."""

    twin: Twin
    number: int

    @property
    def now(self) -> Rope:
        """Return its arrays."""
        first, joined = self.twin.rope, self.twin.joined
        return first if joined is None else joined.system(first).ropes[self.number]

    @property
    def marks(self) -> Floats:
        """Return the material coordinates of its nodes, from the core's first node on."""
        state = self.now.state
        return np.asarray(state.s[: int(state.counts[rows.ELEMENTS]) + 1])

    @property
    def places(self) -> Floats:
        """Return the material coordinates of the places, from its upper end down.

        The upper end is the core's last node, except where a rope ends at a sheave.
        """
        marks, scene = self.marks, self.twin.scene
        places = np.linspace(marks[-1], marks[0], PLACES)
        return places[::-1] if runs_over_sheave(scene, scene.ropes[self.number]) else places


def samplers_of(twin: Twin, vortices_hz: float) -> list[Sampler]:
    """Return the sampling of each rope that the scene's model needs.

    Raises:
        InputError: the time step is too long for vortices of that frequency.
    """
    ropes = [SampledRope(twin, r) for r in range(len(twin.scene.ropes))]
    if twin.viv_drag is None:
        return [_NodeSampler(rope, vortices_hz) for rope in ropes]
    per_period = 1.0 / (vortices_hz * twin.step_s)
    if per_period < MIN_PER_PERIOD:
        problem = (
            f"steps of {1e3 * twin.step_s:.3g} ms are {per_period:.2g} samples in a period of "
            f"{vortices_hz:.3g} Hz"
        )
        remedy = f"give {1e3 / (MIN_PER_PERIOD * vortices_hz):.2g} ms or less for --time-domain"
        raise InputError(f"{twin.scene.path}: time.step_s", problem, remedy)
    return [_ModelSampler(rope, twin.viv_drag) for rope in ropes]


def advance_by(
    twin: Twin, heave: Motion, duration_s: float, speeds: Speeds, steps: Callable[[], int]
) -> Iterator[Snapshot]:
    """Advance like `march`, with the currently required number of steps each time.

    Raises:
        SolverError: as `march` does.
    """
    submitted_s, total = -1.0, round(duration_s / twin.step_s)
    while twin.steps + (count := steps()) <= total:
        ahead_s = (twin.steps + count) * twin.step_s + AHEAD_S
        due = [speed for speed in speeds if submitted_s < speed[0] <= ahead_s]
        submitted_s = ahead_s
        yield from march(twin, heave, count * twin.step_s, count, due)


def resampled(times: Floats, *values: Floats) -> list[Floats]:
    """Resample at equal intervals, the shortest that occur; the interval may change in a run."""
    every = float(np.diff(times).min())
    if np.diff(times).max() < (1.0 + 1e-6) * every:
        return [times, *values]
    grid = times[0] + every * np.arange(int((times[-1] - times[0]) / every + 1e-9) + 1)
    low = np.clip(np.searchsorted(times, grid, side="right") - 1, 0, len(times) - 2)
    share = (grid - times[low]) / (times[low + 1] - times[low])
    even = [grid]
    for value in values:
        part = share.reshape(-1, *[1] * (value.ndim - 1))
        even.append(value[low] * (1.0 - part) + value[low + 1] * part)
    return even


class _NodeSampler:
    """Sampler of a model inside the time step, which moves the nodes."""

    has_slow_parts = True  # its motion includes that of ship, waves and winch

    def __init__(self, rope: SampledRope, vortices_hz: float) -> None:
        self.rope = rope
        self._every = max(1, int(1.0 / (PER_PERIOD * vortices_hz * rope.twin.step_s)))
        self._split: Floats | None = None  # unit vectors of the first sample

    def steps(self) -> int:
        """Return the number of steps to the next sample."""
        return self._every

    def sample(self) -> Sample:
        """Take a sample."""
        rope, s, places = self.rope.now, self.rope.marks, self.rope.places
        position = _at(places, s, rope.state.nodes[_PLACE, : len(s)])
        if self._split is None:
            self._split = _sides(self.rope)
        motion = np.einsum("skp,kp->sp", self._split, position)
        bending = _at(places, s, curvature(rope)[1])
        return Sample(motion, _at(places, s, _across(rope, s)), np.ones(PLACES), bending)

    def bent(self, middles: Floats) -> Floats:
        """Return the curvature at material coordinates [1/m], (2, places)."""
        s, curvatures = curvature(self.rope.now)
        return _at(middles, s, curvatures)


class _ModelSampler:
    """Sampler of a loosely coupled model, which has a motion of its own."""

    has_slow_parts = False

    def __init__(self, rope: SampledRope, viv_drag: VivDragAmplification) -> None:
        self.rope, self._viv_drag = rope, viv_drag

    def steps(self) -> int:
        return self._viv_drag.steps_to_sampling(self.rope.twin.steps)

    def sample(self) -> Sample:
        rope, s, places = self.rope.now, self.rope.marks, self.rope.places
        tracker = self._viv_drag.trackers[self.rope.number]
        motion = np.stack([tracker.moved(rope, places), np.full(PLACES, np.nan)])
        amplified = self._viv_drag.drag_amplification(rope, self.rope.number)
        across = _at(places, s, _across(rope, s))
        return Sample(motion, across, np.interp(places, s, amplified), self.bent(places))

    def bent(self, middles: Floats) -> Floats:
        """Return the curvature of the model, and of the rope if the scene lists its bending."""
        rope = self.rope.now
        total = self._viv_drag.trackers[self.rope.number].bent(rope, middles)
        if bending_stiffness(rope.effects) > 0.0:
            s, curvatures = curvature(rope)
            total = total + _at(middles, s, curvatures)
        return total


Sampler = _NodeSampler | _ModelSampler


def _across(rope: Rope, marks: Floats) -> Floats:
    """Return the water's velocity relative to the rope, normal to it, at its nodes, (3, nodes)."""
    tangent, flow = tangents(rope.state.nodes[_PLACE, : len(marks)]), relative_flow(rope)
    return np.asarray(flow - (flow * tangent).sum(axis=0) * tangent)


def _at(places: Floats, s: Floats, values: Floats) -> Floats:
    """Return rows of values at coordinates s, interpolated at places."""
    return np.stack([np.interp(places, s, part) for part in values])


def _sides(rope: SampledRope) -> Floats:
    """Return unit vectors normal to the rope, across and along the flow, (2, 3, places)."""
    s, stepped = rope.marks, rope.now
    water = stepped.work[rows.FLOW : rows.FLOW + 3, : len(s)].copy()
    water[:, -1] = water[:, -2]
    directions = flow_directions(stepped.state.nodes[_PLACE, : len(s)], water)
    return np.stack([_at(rope.places, s, direction) for direction in directions])
