"""Instruments of a campaign: what a load cell, a counter and a depth sensor would have measured.

They measure what the sound twin computed, with a scatter of their own standard uncertainty.
"""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

from rope_twin.scene.instruments import Measured, MeasuredLength, MeasuredTension
from rope_twin.scene.rigging import places
from rope_twin.scene.schema import Scene
from rope_twin.studies.faults.injection import DEPTH, SECOND_NS, SENSORS, Message
from rope_twin.twin.readings import Measurement
from rope_twin.twin.snapshot import Snapshot

READING_NS = SECOND_NS // 10
# instruments of a scene that has none
CELL = MeasuredTension(uncertainty_pct=0.5)
COUNTER = MeasuredLength(uncertainty_m=0.02)
SOUNDER = MeasuredLength(uncertainty_m=0.5)


class Truth(NamedTuple):
    """Values of the sound twin at one time."""

    stamp_ns: int
    line_out_m: float
    speed_m_per_s: float
    tension_n: float
    depth_m: float


def truth_of(shot: Snapshot) -> Truth:
    """Return what instruments would see of a snapshot, each without an error of its own."""
    depth_m = -float(shot.payload_position_m[2])
    return Truth(
        shot.stamp_ns, shot.line_out_m, shot.payout_speed_m_per_s, shot.tension_top_n, depth_m
    )


def instrumented(scene: Scene) -> Scene:
    """Return the scene with uncertainties of its instruments, its own where it gives them."""
    own = scene.measured
    tension = own.tension if own.tension.uncertainty(1.0) is not None else CELL
    line_out = own.line_out if own.line_out.uncertainty(1.0) is not None else COUNTER
    depth = own.payload_depth if own.payload_depth.uncertainty(1.0) is not None else SOUNDER
    measured = Measured(tension=tension, line_out=line_out, payload_depth=depth)
    return replace(scene, measured=measured)


def readings(scene: Scene, truths: Sequence[Truth], latency_ns: int, seed: int) -> list[Message]:
    """Return the readings of all instruments of an instrumented scene, in the order of arrival.

    Args:
        scene: from `instrumented`.
        truths: of the sound twin, at rising times; one in READING_NS is read.
        latency_ns: from a stamp to the arrival of its message.
        seed: of the scatter.
    """
    rng, found, due_ns = random.Random(seed), list[Message](), 0
    winch = next((one.from_ for one in scene.ropes if one.from_ in places(scene)), "")
    cell, counter = scene.measured.tension, scene.measured.line_out
    sounder = scene.measured.payload_depth
    for one in truths:
        if one.stamp_ns < due_ns:
            continue
        due_ns = one.stamp_ns + READING_NS
        tension_n = one.tension_n + rng.gauss(0.0, cell.uncertainty(one.tension_n) or 0.0)
        length_m = one.line_out_m + rng.gauss(0.0, counter.uncertainty(one.line_out_m) or 0.0)
        depth_m = one.depth_m + rng.gauss(0.0, sounder.uncertainty(one.depth_m) or 0.0)
        reported = Measurement.of_winch(
            one.stamp_ns, length_m + counter.bias, one.speed_m_per_s, tension_n + cell.bias, winch
        )
        sounded = Measurement.of_depth(one.stamp_ns, depth_m + sounder.bias)
        arrival_ns = one.stamp_ns + latency_ns
        found.append(Message(SENSORS, arrival_ns, one.stamp_ns, reported, "winch"))
        found.append(Message(DEPTH, arrival_ns, one.stamp_ns, sounded, "sounder"))
    return found
