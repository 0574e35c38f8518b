"""What the physics tests are built from: rigs, and the core's arrays at rest."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rope_twin import Twin
from rope_twin.studies.rigs import NOTHING, STILL_WATER, Motion, Rig, Speeds, march, sine, still
from rope_twin.studies.state_bench import Bench, frequency, lift

__all__ = [
    "NOTHING", "STILL_WATER", "Bench", "Motion", "Rig", "Speeds", "frequency", "lift", "march",
    "sine", "still", "top_tension",
]  # fmt: skip

Vector = NDArray[np.float64]
Heave = Motion


def top_tension(twin: Twin, heave: Heave, seconds: float, every: int = 1) -> Vector:
    """The published top tension [N] after each `every` steps."""
    return np.array([shot.tension_top_n for shot in march(twin, heave, seconds, every)])
