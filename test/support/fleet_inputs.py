"""Inputs of a fleet as a twin of its own has them, and what that twin comes to."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.state import Floats
from rope_twin.scene.schema import Scene
from rope_twin.twin.ensemble.fleet import FleetInputs
from rope_twin.twin.ensemble.live_state import LiveState, live_state
from rope_twin.twin.ensemble.member import fold_of
from rope_twin.twin.twin import Twin


@dataclass(frozen=True)
class Driven:
    """A twin's run, step by step."""

    twin: Twin
    inputs: FleetInputs  # at its step borders
    top_n: Floats  # (steps,)
    least_n: Floats
    depth_m: Floats
    sinking_m_per_s: Floats
    lowest_n: Floats
    live: LiveState | None  # after the step that was asked for


def heave(height_m: float, period_s: float, times: Floats) -> tuple[Floats, Floats]:
    """Height and rate of two waves at these times."""
    w = 2.0 * math.pi / period_s
    z = height_m * (np.sin(w * times) + 0.3 * np.sin(2.3 * w * times))
    return z, height_m * w * (np.cos(w * times) + 0.69 * np.cos(2.3 * w * times))


def driven(
    scene: Scene,
    steps: int,
    sea: tuple[float, float] = (0.8, 7.0),
    speed: float = 0.0,
    live_at: int = -1,
) -> Driven:
    """Run a twin of the scene in a sea (height, period) while its winch runs at a speed."""
    twin = Twin(scene)
    twin.prescribe_motion()
    times = np.arange(steps + round(1.0 / twin.step_s)) * twin.step_s
    for t, z, v in zip(times, *heave(*sea, times), strict=True):
        assert not twin.offer_heave(round(t * 1e9), float(z), float(v))
    if speed:
        assert not twin.offer_speed(0, speed)
    view = twin.inspect()
    values, rates = [view.boundary.value[0].copy()], [view.boundary.rate[0].copy()]
    outputs, live = [], None
    for step in range(steps):
        if step == live_at:
            live = live_state(twin)
        twin.advance(1)
        view = twin.inspect()
        values.append(view.boundary.value[0].copy())
        rates.append(view.boundary.rate[0].copy())
        n = int(view.rope.state.counts[rows.ELEMENTS])
        outputs.append((twin.top_pull_n, *fold_of(view.rope, view.rope.work[rows.TENSION, :n])))
    value, rate = np.array(values), np.array(rates)
    rest_z = scene.ship.hang_off_m[2]
    inputs = FleetInputs(
        value[:, rows.Z] - rest_z, rate[:, rows.Z], value[:, rows.LINE], rate[:, rows.LINE]
    )
    return Driven(twin, inputs, *np.array(outputs).T, live)


def cut(inputs: FleetInputs, first: int, every: int = 1) -> FleetInputs:
    """Inputs from a step border on, of every so many steps."""
    return FleetInputs(
        inputs.heave_m[first::every],
        inputs.heave_rate_m_per_s[first::every],
        inputs.line_out_m[first::every],
        inputs.line_speed_m_per_s[first::every],
    )
