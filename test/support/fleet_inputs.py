"""Inputs of a fleet as a single twin has them, and the run of that twin."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.lanes.batch import sample_of
from rope_twin.core.lanes.step import EAST, MIN_TENSION, PAYLOAD_DEPTH
from rope_twin.core.state import Floats
from rope_twin.scene.rigging import payload_rope, places
from rope_twin.scene.schema import Scene
from rope_twin.twin.ensemble.fleet import FleetInputs
from rope_twin.twin.ensemble.live_state import LiveState, live_state
from rope_twin.twin.motion.heave_track import ramp
from rope_twin.twin.twin import Twin


@dataclass(frozen=True)
class Driven:
    """Run of a single twin, step by step."""

    twin: Twin
    inputs: FleetInputs  # at its step borders
    top_n: Floats  # (steps,) of the main winch's rope
    min_n: Floats
    depth_m: Floats
    sinking_m_per_s: Floats
    payload_n: Floats
    live: LiveState | None  # after the step that was asked for
    hung_n: dict[str, Floats]  # as top_n, of each rope from a hang-off


def heave(height_m: float, period_s: float, times: Floats) -> tuple[Floats, Floats]:
    """Return height and rate of a heave of two sine waves at these times."""
    w = 2.0 * math.pi / period_s
    z = height_m * (np.sin(w * times) + 0.3 * np.sin(2.3 * w * times))
    return z, height_m * w * (np.cos(w * times) + 0.69 * np.cos(2.3 * w * times))


def driven(
    scene: Scene,
    steps: int,
    sea: tuple[float, float] = (0.8, 7.0),
    speed: float = 0.0,
    live_at: int = -1,
    others: Mapping[str, float] | None = None,
    figures: Mapping[str, float] | None = None,
) -> Driven:
    """Run a twin of the scene in a sea (height, period) while its winch runs at a speed.

    others: speeds of other winches by name; figures: factors that it takes over at once.
    """
    twin = Twin(scene)
    twin.prescribe_motion()
    times = np.arange(steps + round(1.0 / twin.step_s)) * twin.step_s
    for t, z, v in zip(times, *heave(*sea, times), strict=True):
        assert not twin.submit_heave(round(t * 1e9), float(z), float(v))
    if speed:
        assert not twin.submit_speed(0, speed)
    for name, own_speed in (others or {}).items():
        assert not twin.submit_speed(0, own_speed, name)
    if figures:
        assert not twin.submit_figures(ramp_s=0.0, **figures)
    borders, heaves, outputs, tops, live = [border(twin)], [0.0], [], [], None
    for step in range(steps):
        if step == live_at:
            live = live_state(twin)
        twin.advance(1)
        borders.append(border(twin))
        share, _ = ramp(twin.time_ns * 1e-9, scene.ship.motion_ramp_s)
        heaves.append(share * twin.inputs.heave.at(twin.time_ns)[0])
        samples = np.array([sample_of(rope) for rope in ropes(twin)])
        outputs.append(
            (
                twin.top_tension_n,
                samples[:, MIN_TENSION].min(),
                *samples[payload_rope(scene), PAYLOAD_DEPTH:EAST],
            )
        )
        tops.append([twin.top_tension_n] if twin.joined is None else twin.joined.pull[:, rows.PULL])
    value, rate = np.array(borders).transpose(1, 2, 0, 3)
    rest_z = scene.ship.hang_off_m[2]
    assert np.array_equal(value[0, :, rows.Z], rest_z + np.array(heaves))
    names = [line.from_ for line in scene.ropes]
    lines = {
        name: (value[r, :, rows.LINE], rate[r, :, rows.LINE])
        for name in others or {}
        for r in [names.index(name)]
    }
    inputs = FleetInputs(
        np.array(heaves), rate[0, :, rows.Z], value[0, :, rows.LINE],
        rate[0, :, rows.LINE], lines,
    )  # fmt: skip
    hung = {
        line.name: np.array(tops)[:, r]
        for r, line in enumerate(scene.ropes)
        if line.from_ in places(scene)
    }
    return Driven(twin, inputs, *np.array(outputs).T, live, hung)


def border(twin: Twin) -> Floats:
    """Return hang-offs and payouts of all ropes now, values and rates, (2, ropes, MOTIONS)."""
    first = twin.inspect().boundary
    tables = (
        [table[:1] for table in first]
        if twin.joined is None
        else twin.joined.present_boundary(first)
    )
    return np.array(list(tables))


def ropes(twin: Twin) -> tuple[rows.Rope, ...]:
    """Return all ropes of a twin."""
    first = twin.inspect().rope
    return (first,) if twin.joined is None else twin.joined.system(first).ropes


def elements(rope: rows.Rope) -> int:
    """Return the number of elements in use."""
    return int(rope.state.counts[rows.ELEMENTS])


def mapped(inputs: FleetInputs, change: Callable[[Floats], Floats]) -> FleetInputs:
    """Return inputs with the same change of every array."""
    lines = {name: (change(one), change(two)) for name, (one, two) in inputs.lines.items()}
    arrays = (getattr(inputs, one.name) for one in fields(inputs) if one.name != "lines")
    return FleetInputs(*map(change, arrays), lines)


def cut(inputs: FleetInputs, first: int, every: int = 1) -> FleetInputs:
    """Return inputs from a step border on, of every `every`-th step."""
    return mapped(inputs, lambda series: series[first::every])
