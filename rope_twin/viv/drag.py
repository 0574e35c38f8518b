"""Drag amplification of a rope with cross-flow vibration."""

from __future__ import annotations

import numpy as np

from rope_twin.viv.span import Floats

VANDIVER = (1.043, 0.65)  # Vandiver (1983)


def amplified_drag(rms: Floats, growth: tuple[float, float] = VANDIVER) -> Floats:
    """Return 1 + a·(2·rms/d)^b, with a and b in `growth`; rms over the diameter."""
    a, b = growth
    return np.asarray(1.0 + a * (2.0 * rms) ** b)
