"""Rate of the ship's motion samples: what the scene needs, and what its sender gives.

Between samples the cubic Hermite polynomial holds. A piece of length h is off by at most h⁴/384
times the fourth derivative, which is (2π·h/T)⁴/384 of the amplitude of a sine of period T: with T
the shortest period that matters and a share of 1e-4 the needed interval is 0.0705·T (there the
acceleration is off by (2π·h/T)²/12, 1.6 %). A step needs the sample after it too: the input delay
must be at least the interval, the transport delay and a slot of the pacing.
"""

from __future__ import annotations

import math
from collections import deque
from itertools import pairwise

import numpy as np

from rope_twin.effects.waves import WavesParams, components_of
from rope_twin.scene.schema import Scene

INTERPOLATION_SHARE = 1e-4  # of the motion's amplitude: what interpolation may be off by
TIMED_SAMPLES = 20  # intervals whose median counts
MISSING_SHARE = 0.01  # of the time: steps without the sample after them
SLOT_S = 0.02  # steps of a paced run begin this far apart
INTERVAL_TOL = 1.02  # jitter of the median interval
RECORDED_PERIOD_S = 5.0  # of recorded heave 99.9 % of the acceleration's variance is slower
WAVE_SHARE = 0.95  # of the waves' energy lies above the shortest period that matters


def is_moved(scene: Scene) -> bool:
    """Whether the scene's sea moves the ship, so that samples of its motion must come."""
    heave = scene.sea_state.heave
    return scene.sea_state.moves and (heave is None or heave.amplitude_m > 0.0)


def shortest_period_s(scene: Scene) -> float:
    """Return the shortest period of the ship's motion that matters [s].

    Of a sine its own; on the scene's waves that above which WAVE_SHARE of their energy lies; else,
    of a record or a live ship, RECORDED_PERIOD_S.
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
    """Return the longest interval between samples [s] that keeps the error to its share."""
    return math.sqrt(math.sqrt(384.0 * INTERPOLATION_SHARE)) * shortest_period_s / math.tau


class SampleTiming:
    """How often samples come, and whether the one after a step is there when the step begins."""

    def __init__(self, needed_s: float) -> None:
        """needed_s: longest interval between samples that does."""
        self._needed_s = needed_s
        self._taken: deque[tuple[int, int, int]] = deque(maxlen=TIMED_SAMPLES + 1)

    def take(self, stamp_ns: int, asked_ns: int, missing_ns: int) -> None:
        """Take a sample's stamp, the time up to which it was asked for, and how long none was."""
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
        """Return what is too slow about the samples, and what would do; or "".

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
