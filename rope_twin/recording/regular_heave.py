"""A heave that was never recorded: a sine, sampled as a bag's record would have been."""

from __future__ import annotations

from math import cos, pi, sin

from rope_twin.recording.heave_replay import HeaveSample, stamps_between
from rope_twin.scene.schema import RegularHeave


class RegularSea:
    """Exact samples of z = a·sin(2π·t/T) by simulation time; t = 0 is `start_s` into it.

    The twin's cubic Hermite interpolation between them differs by at most (2π/T·dt)⁴/384 of the
    amplitude: 6e-9 at T = 8 s, 2e-6 at the shortest period of a scene, 2 s.
    """

    note = ""

    def __init__(self, heave: RegularHeave, start_s: float = 0.0) -> None:
        self._heave = heave
        self._start_s = start_s
        self.source = f"regular heave of ±{heave.amplitude_m:g} m every {heave.period_s:g} s"

    def at(self, time_s: float) -> tuple[float, float]:
        """Return position [m] and velocity [m/s] at a time, exactly."""
        amplitude, omega = self._heave.amplitude_m, 2.0 * pi / self._heave.period_s
        angle = omega * (time_s + self._start_s)
        return amplitude * sin(angle), amplitude * omega * cos(angle)

    def between(self, from_ns: int, to_ns: int) -> list[HeaveSample]:
        """Return samples with from_ns <= stamp_ns < to_ns, in order."""
        stamps = stamps_between(from_ns, to_ns).tolist()
        return [HeaveSample(stamp, *self.at(stamp * 1e-9), None) for stamp in stamps]

    def is_over(self, from_ns: int) -> bool:
        """Return False: a sine has no end."""
        return False
