"""Bags written by hand, for tests of the readers."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from rope_twin.messages import encode_elevation, encode_heave
from rope_twin.recording.bag_writer import BagWriter
from rope_twin.topics import BY_NAME, Qos, Topic

START_NS = 1_700_000_000_000_000_000
STEP_NS = 50_000_000


def write_heave(
    directory: Path,
    heave: Sequence[tuple[int, float, float]],
    name: str = "ship/heave",
    elevation: Sequence[tuple[int, float]] = (),
) -> Path:
    """Write a bag of rows (time from the start [ns], position, velocity), one period apart."""
    topic = Topic(name, "nav_msgs/msg/Odometry", Qos.SENSOR, 20.0, "", "")
    with BagWriter(directory, [topic, BY_NAME["sea/elevation"]]) as bag:
        for k, (stamp_ns, position, velocity) in enumerate(heave):
            data = encode_heave(START_NS + stamp_ns, position, velocity)
            bag.write(name, START_NS + k * STEP_NS, data)
        for stamp_ns, eta in elevation:
            bag.write(
                "sea/elevation", START_NS + stamp_ns, encode_elevation(START_NS + stamp_ns, eta)
            )
    return directory


def swell(
    count: int = 400, period_s: float = 8.0, step_ns: int = STEP_NS
) -> list[tuple[int, float, float]]:
    """Return a regular swell of 1 m amplitude as rows for `write_heave`."""
    omega = 2.0 * np.pi / period_s
    times = [k * step_ns for k in range(count)]
    return [
        (t, float(np.sin(omega * t * 1e-9)), float(omega * np.cos(omega * t * 1e-9))) for t in times
    ]
