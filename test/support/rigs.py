"""Rigs of the physics tests, and the core's arrays at rest."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rope_twin import Snapshot, Twin
from rope_twin.studies.driven_twin import Motion, Speeds, march, still
from validation.rigs import CALM, NOTHING, STILL_WATER, Rig, sine, with_nothing_below
from validation.state_bench import Bench, frequency, lift

__all__ = [
    "CALM", "NOTHING", "STILL_WATER", "Bench", "Motion", "Rig", "Speeds", "frequency", "lift",
    "march", "march_to_end", "sine", "still", "top_tension", "with_nothing_below",
]  # fmt: skip

Vector = NDArray[np.float64]
Heave = Motion


def top_tension(twin: Twin, heave: Heave, seconds: float, every: int = 1) -> Vector:
    """Return the published top tension [N] after each `every` steps."""
    return np.array([snapshot.tension_top_n for snapshot in march(twin, heave, seconds, every)])


def march_to_end(twin: Twin, heave: Heave, seconds: float, speeds: Speeds = ()) -> Snapshot:
    """March, and return the last snapshot; the few before it cost little."""
    steps = round(seconds / twin.step_s)
    every = next(count for count in range(100, 0, -1) if steps % count == 0)
    *_, snapshot = march(twin, heave, seconds, every, speeds)
    return snapshot
