"""Sampling interval of the rope: resolves its fastest vortices, at least once a cycle."""

from __future__ import annotations

from rope_twin.core import state as rows
from rope_twin.core.state import Boundary, Rope
from rope_twin.twin.pacing import steps_in_slot
from rope_twin.twin.vibration.measured import diameters, max_shedding_hz, tangents

SAMPLES_PER_PERIOD = 24  # samples per period of the fastest vortices: resolves a crest to 0.9 %
SHORTEN_ABOVE, LENGTHEN_BELOW = (
    1.25,
    0.5,
)  # ratios to the design frequency at which the interval changes


def shedding_hz(rope: Rope, boundary: Boundary, strouhal: float) -> float:
    """Frequency of the fastest vortices, by the flow relative to the hang-off's velocity [Hz]."""
    n = int(rope.state.counts[rows.ELEMENTS])
    flow = rope.work[rows.FLOW : rows.FLOW + 3, :n] - boundary.rate[0, :3, None]
    flow[2] = 0.0  # heave and waves' vertical motion run along the rope
    along = tangents(rope.state.nodes[rows.POSITION : rows.POSITION + 3, : n + 1])[:, :n]
    return max_shedding_hz(flow, along, diameters(rope)[:n], strouhal)


def sampling_steps(hz: float, step_s: float) -> int:
    """Number of steps between samples for this frequency of the fastest vortices.

    A cycle has a whole number of samples, so they come at the same instants for any step.
    """
    slot = steps_in_slot(step_s)
    if hz == 0.0:
        return slot
    most = max(1, min(slot, int(1.0 / (SAMPLES_PER_PERIOD * hz * step_s) + 1e-9)))
    return next(steps for steps in range(most, 0, -1) if slot % steps == 0)


def needs_new_interval(hz: float, made_for_hz: float, other_current: bool) -> bool:
    """Return whether the interval must change; only another current makes it longer."""
    slower = other_current and hz < LENGTHEN_BELOW * made_for_hz
    return hz > SHORTEN_ABOVE * made_for_hz or slower
