"""Sampling times of synthetic motion, at the rate of a motion sensor."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

SAMPLE_PERIOD_NS = 50_000_000  # 20 Hz, the rate of ship/heave


def stamps_between(from_ns: int, to_ns: int) -> NDArray[np.int64]:
    """Return the multiples of SAMPLE_PERIOD_NS with from_ns <= stamp < to_ns, in order."""
    first, end = -(-from_ns // SAMPLE_PERIOD_NS), -(-to_ns // SAMPLE_PERIOD_NS)
    return np.arange(first, end, dtype=np.int64) * SAMPLE_PERIOD_NS
