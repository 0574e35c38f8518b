"""The colours of tension: a perceptually ordered map, a scale in round numbers, one for slack.

The map is viridis (N. Smith and S. van der Walt 2015, public domain CC0), at eleven even steps
with straight lines between them: lightness rises evenly, so order is seen without the legend, in
grey print and with the common colour-vision deficiencies.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

SLACK_BELOW_N = 1.0  # an element that carries less hangs loose
SLACK_RGB = (1.0, 0.25, 0.25)  # red is nowhere in viridis
_VIRIDIS = (
    "440154", "482475", "414487", "355f8d", "2a788e", "21918c", "22a884", "44bf70", "7ad151",
    "bddf26", "fde725",
)  # fmt: skip
_TABLE = np.array([[int(row[k : k + 2], 16) / 255.0 for k in (0, 2, 4)] for row in _VIRIDIS])
_STEPS = np.linspace(0.0, 1.0, len(_TABLE))
_ROUND = (1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0)


def shade(fraction: NDArray[np.float64]) -> NDArray[np.float32]:
    """Return colours (n, 3) in 0 to 1 for fractions of the scale (n,), clipped to its ends."""
    return np.stack(
        [np.interp(fraction, _STEPS, _TABLE[:, channel]) for channel in range(3)], axis=-1
    ).astype(np.float32)


def tension_colours(tension_n: NDArray[np.float64], scale_n: float) -> NDArray[np.float32]:
    """Return colours (n, 4: r, g, b, alpha) in 0 to 1 of tensions (n,) on a scale from 0 to
    scale_n.
    """
    colours = np.ones((len(tension_n), 4), dtype=np.float32)
    colours[:, :3] = shade(tension_n / scale_n)
    colours[tension_n < SLACK_BELOW_N, :3] = SLACK_RGB
    return colours


def scale_above(peak_n: float) -> float:
    """Return the upper end of a colour scale: round, and at least 10 % above the peak tension."""
    wanted = max(1.1 * peak_n, 10.0 * SLACK_BELOW_N)
    if not math.isfinite(wanted):
        raise ValueError(f"no colour scale reaches {peak_n} N")
    decade = 10.0 ** math.floor(math.log10(wanted))
    return next(step * decade for step in (*_ROUND, 100.0) if step * decade >= wanted)
