"""Jerk-limited motion: the fastest change of speed, the motion along it, and its reach.

The fastest way to a speed that ends without acceleration is one pulse of acceleration: a rise at
the jerk limit, a part at the acceleration limit if that is reached, and a fall at the jerk limit.
"""

from __future__ import annotations

import math
from typing import NamedTuple

Pieces = tuple[tuple[float, float], ...]  # jerk [m/s³] and duration [s]


class Motion(NamedTuple):
    """Position, speed and acceleration at an instant."""

    x: float  # [m]
    v: float  # [m/s]
    a: float  # [m/s²]

    def later(self, jerk: float, t: float) -> Motion:
        """Return the motion after a time of constant jerk."""
        a = self.a + jerk * t
        v = self.v + t * (self.a + 0.5 * jerk * t)
        x = self.x + t * (self.v + t * (0.5 * self.a + jerk * t / 6.0))
        return Motion(x, v, a)


def pulse(now: Motion, speed: float, acceleration: float, jerk: float) -> Pieces:
    """Return the pieces of the fastest way to a speed, without acceleration at the end.

    With g the remaining change of speed and a the present acceleration, the peak p of the pulse
    follows from g = (2·p² - a²)/(2·j), as long as it stays below the limit.
    """
    gain = speed - now.v
    side = 1.0 if gain >= 0.5 * now.a * abs(now.a) / jerk else -1.0
    gain, a = side * gain, side * now.a
    peak = math.sqrt(max(jerk * gain + 0.5 * a * a, 0.0))
    hold = 0.0
    if peak > acceleration:
        peak = max(acceleration, a)
        hold = (gain - (2.0 * peak * peak - a * a) / (2.0 * jerk)) / peak
    rise = max(peak - a, 0.0) / jerk
    return (side * jerk, rise), (0.0, max(hold, 0.0)), (-side * jerk, peak / jerk)


def along(now: Motion, pieces: Pieces, time_s: float) -> Motion:
    """Return the motion after a time along the pieces; no acceleration after the last one."""
    left = time_s
    for jerk, length in pieces:
        now = now.later(jerk, min(length, left))
        left -= min(length, left)
        if left <= 0.0:
            return now
    return Motion(now.x + left * now.v, now.v, 0.0)


def reach(now: Motion, pieces: Pieces) -> tuple[float, float]:
    """Return the lowest and highest position on the way [m]."""
    low = high = now.x
    for jerk, length in pieces:
        if length <= 0.0:
            continue
        for t in (*_turns(now, jerk, length), length):
            x = now.later(jerk, t).x
            low, high = min(low, x), max(high, x)
        now = now.later(jerk, length)
    return low, high


def _turns(now: Motion, jerk: float, length: float) -> list[float]:
    """Return the times within a piece at which the speed is zero: v + a·t + j·t²/2 = 0."""
    if jerk == 0.0:
        roots = [-now.v / now.a] if now.a != 0.0 else []
    else:
        inner = now.a * now.a - 2.0 * jerk * now.v
        root = math.sqrt(inner) if inner > 0.0 else 0.0
        roots = [(-now.a - root) / jerk, (-now.a + root) / jerk] if inner > 0.0 else []
    return [t for t in roots if 0.0 < t < length]
