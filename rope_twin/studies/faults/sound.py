"""Sound run: the quality index over hours of inputs without a fault, and how often it falls.

The twin hears the same traffic as in the fault campaign, and a load cell and a depth sensor that
scatter by their own uncertainty around what it computes. Every fall of an index is a false one.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from heapq import merge
from itertools import count

from rope_twin.errors import InputError, phrase
from rope_twin.recording.motion_source import FIRST_NS, open_sea
from rope_twin.scene.schema import Scene
from rope_twin.studies.faults.campaign import (
    DROP,
    LATENCY_NS,
    SEED,
    SPEED_FOR_S,
    SPEEDS_M_PER_S,
    LoneTwin,
    commands,
    profiles,
)
from rope_twin.studies.faults.injection import HEAVE, SECOND_NS, Message
from rope_twin.studies.faults.instruments import instrumented
from rope_twin.twin.monitors import ERROR_INTERVAL
from rope_twin.twin.readings import Measurement

PERIOD_NS = round(len(SPEEDS_M_PER_S) * SPEED_FOR_S * SECOND_NS)  # after which commands repeat
LOOK_NS = SECOND_NS // 5  # between two snapshots and readings
SETTLED_S = 120.0  # after the build-up the indices have risen


@dataclass(frozen=True)
class Drop:
    """A fall of the quality index of an element in a sound run."""

    element: str
    at_s: float  # twin time
    index: float  # after it
    reason: str


def sound_run(
    scene: Scene, seconds: float, progress: Callable[[float], None] = lambda _: None
) -> list[Drop]:
    """Run a scene for some twin time [s] without a fault; return each drop by more than DROP.

    progress: is given the twin time [s].

    Raises:
        InputError: the scene's ship lies still.
        SceneError: the scene cannot be built.
        SolverError: the run would end; the twin cannot go on.
    """
    twin = LoneTwin(instrumented(scene), ERROR_INTERVAL)
    rng, traffic, found = random.Random(SEED), _traffic(scene), []
    following, look_ns = next(traffic), LOOK_NS
    best: dict[str, float] = {}
    low: set[str] = set()
    while twin.time_ns < seconds * SECOND_NS:
        while following.received_ns <= twin.now_ns:
            twin.deliver(following)
            following = next(traffic)
        twin.step_slot()
        if twin.time_ns < look_ns:
            continue
        look_ns += LOOK_NS
        shot = twin.look()
        cell, depth = twin.scene.measured.tension, twin.scene.measured.payload_depth
        tension_n, depth_m = shot.tension_top_n, -float(shot.payload_position_m[2])
        tension_n += rng.gauss(0.0, cell.uncertainty(tension_n) or 0.0) + cell.bias
        depth_m += rng.gauss(0.0, depth.uncertainty(depth_m) or 0.0) + depth.bias
        twin.measure(Measurement.of_winch(shot.stamp_ns, tension_n=tension_n))
        twin.measure(Measurement.of_depth(shot.stamp_ns, depth_m))
        for one in shot.quality if shot.time_s > SETTLED_S else ():
            best[one.element] = max(best.get(one.element, 0.0), one.index)
            if one.index >= best[one.element] - DROP:
                low.discard(one.element)
            elif one.element not in low:
                low.add(one.element)
                why = f"{one.cause}: {one.reason}"
                found.append(Drop(one.element, shot.time_s, one.index, why))
        progress(shot.time_s)
    return found


def _traffic(scene: Scene) -> Iterator[Message]:
    """Yield the messages of heave, winch and current without end, in the order of arrival."""
    sea = open_sea(scene)
    if sea is None:
        what, right = "its ship lies still", "name a scene with a sea"
        raise InputError(phrase(f"scene {scene.name}", what, right))
    orders, currents = commands(scene, PERIOD_NS * 1e-9), profiles(scene, PERIOD_NS * 1e-9)
    for number in count():
        begin_ns = number * PERIOD_NS
        samples = sea.between(begin_ns if number else FIRST_NS, begin_ns + PERIOD_NS)
        moved = [
            Message(HEAVE, one.stamp_ns + LATENCY_NS, one.stamp_ns,
                    (one.position_m, one.velocity_m_per_s))
            for one in samples
        ]  # fmt: skip
        later = (
            [replace(one, received_ns=one.received_ns + begin_ns, stamp_ns=one.stamp_ns + begin_ns)
             for one in given]
            for given in (orders, currents)
        )  # fmt: skip
        yield from merge(moved, *later, key=lambda one: one.received_ns)
