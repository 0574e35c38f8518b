"""Sampling rate of the ship's motion: needed by the scene, and given by the sender.

Between samples the cubic Hermite polynomial holds. Its error over a piece of length h is at most
h⁴/384 times the fourth derivative, which is (2π·h/T)⁴/384 of the amplitude of a sine of period T:
with T the shortest relevant period and a fraction of 1e-4 the needed interval is 0.0705·T (there
the error of the acceleration is (2π·h/T)²/12, 1.6 %). A step needs the sample after it too: the
input delay must be at least the interval, the transport delay and a real-time cycle.
"""

from __future__ import annotations

import math
from collections import deque
from itertools import pairwise

import numpy as np

from rope_twin.effects.waves import WavesParams, components_of
from rope_twin.scene.schema import Scene

INTERPOLATION_SHARE = 1e-4  # allowed interpolation error over the motion's amplitude
TIMED_SAMPLES = 20  # number of intervals of the median
MISSING_SHARE = 0.01  # allowed fraction of time without the sample after the step
SLOT_S = 0.02  # real-time cycle
INTERVAL_TOL = 1.02  # allowed jitter of the median interval
RECORDED_PERIOD_S = 5.0  # 99.9 % of the acceleration variance of recorded heave is slower
WAVE_SHARE = 0.95  # fraction of the waves' energy above the shortest relevant period


def is_moved(scene: Scene) -> bool:
    """Return whether the scene's sea moves the ship, so that motion samples must come."""
    heave = scene.sea_state.heave
    return scene.sea_state.moves and (heave is None or heave.amplitude_m > 0.0)


def shortest_period_s(scene: Scene) -> float:
    """Return the shortest relevant period of the ship's motion [s].

    For a sine its own; in the scene's waves that above which WAVE_SHARE of their energy lies;
    otherwise, for a record or a live ship, RECORDED_PERIOD_S.
    """
    if scene.sea_state.heave is not None:
        return scene.sea_state.heave.period_s
    params = scene.listed(WavesParams)
    if scene.sea_state.on_waves is None or params is None:
        return RECORDED_PERIOD_S
    waves = components_of(params, scene.environment.gravity_m_per_s2)
    order = np.argsort(waves.omega)
    energy = np.cumsum(waves.amplitude_m[order] ** 2)
    fastest = waves.omega[order][int(np.searchsorted(energy, WAVE_SHARE * energy[-1]))]
    return float(2.0 * np.pi / fastest)


def needed_interval_s(shortest_period_s: float) -> float:
    """Return the longest interval between samples [s] that keeps the error within its limit."""
    return math.sqrt(math.sqrt(384.0 * INTERPOLATION_SHARE)) * shortest_period_s / math.tau


class SampleTiming:
    """Monitor of the sampling interval, and of the availability of the sample after each step."""

    def __init__(self, needed_s: float) -> None:
        """Set the longest sufficient interval between samples [s]."""
        self._needed_s = needed_s
        self._taken: deque[tuple[int, int, int]] = deque(maxlen=TIMED_SAMPLES + 1)

    def take(self, stamp_ns: int, asked_ns: int, missing_ns: int) -> None:
        """Take a sample's stamp, the latest time requested, and the time without samples [ns]."""
        self._taken.append((stamp_ns, asked_ns, missing_ns))

    @property
    def interval_s(self) -> float:
        """Median interval between the newest stamps [s]; NaN: too few."""
        if len(self._taken) <= TIMED_SAMPLES // 4:
            return math.nan
        stamps = [stamp for stamp, _, _ in self._taken]
        between = sorted(b - a for a, b in pairwise(stamps))
        return between[len(between) // 2] * 1e-9

    def fault(self, lateness_s: float) -> str:
        """Return the message on samples that come too slowly, with the remedy; or "".

        lateness_s: arrival less stamp of the later samples [s].
        """
        interval_s = self.interval_s
        if math.isnan(interval_s):
            return ""
        delay_s = interval_s + lateness_s + SLOT_S
        if interval_s > INTERVAL_TOL * self._needed_s:
            right_s = self._needed_s + lateness_s + SLOT_S
            return (
                f"a sample every {interval_s:.3f} s is too slow: this scene needs one every "
                f"{self._needed_s:.3f} s ({1.0 / self._needed_s:.1f} Hz) and input_delay_s of "
                f"{right_s:.2f} s; at the present rate {delay_s:.2f} s"
            )
        first, last = self._taken[0], self._taken[-1]
        asked_ns, missing_ns = last[1] - first[1], last[2] - first[2]
        if missing_ns <= MISSING_SHARE * asked_ns or asked_ns <= 0:
            return ""
        return (
            f"for {100.0 * missing_ns / asked_ns:.0f} % of the time the sample after the step had "
            f"not come: with one every {interval_s:.3f} s set input_delay_s to {delay_s:.2f} s or "
            "more"
        )
