"""Phase drift of self-excited vortices between rope and coarse solution, as an error of tension.

A wake oscillator is self-excited: finer elements and steps vibrate the rope equally hard, but a
little slower or faster, and the phase difference accumulates without bound. The error of the
tension is then one of phase. The vibration is the top tension after a high-pass filter at half the
vortices' frequency, of the rope (v) and of the coarse solution (w). By means over some seconds of
these and of their values one step before (v', w') the coarse solution is ahead by

    φ = atan2(⟨v·w' - v'·w⟩/(2·sin ωh), ⟨v·w⟩),    cos ωh = ⟨v·v'⟩/⟨v²⟩,

counted over whole turns. Elements and step are of second order, and so is the frequency: the phase
error of the rope is a third of φ (Richardson 1911), and two vibrations of amplitude a with a phase
difference of ψ differ by at most 2·a·sin(ψ/2).

Where rope and coarse solution vibrate so differently that they have no phase (a small coherence),
or the coarse solution was started during the vibration, the phase error cannot be known: ψ is half
a turn from then on.
"""

from __future__ import annotations

from math import atan2, hypot, pi, sin, sqrt, tau

from rope_twin.core.state import Boundary, Rope
from rope_twin.twin.accuracy.error_bound import MEAN_S, THIRD, Recent
from rope_twin.vortex.sampling import needs_new_interval, shedding_hz

PHASE, AMPLITUDE = 1.4, 1.3  # safety factors on a third of the phase, and on the amplitude
MIN_COHERENCE = 0.3  # minimum coherence for a phase
CUT_OFF, POLES = 0.5, 3  # of the vortex frequency; the tension has once or twice that frequency
SAMPLES = 32  # per vortex period: resolves a crest of twice the frequency to 2 %
LOOK_S = 1.0  # interval at which the vortex frequency is updated
MIN_VIBRATION = 1e-6  # of the static tension: minimum amplitude of a vibration


class PhaseDrift:
    """Phase drift of one coarse solution; `take` gets both tensions after each of its steps."""

    def __init__(self, rest_n: float, strouhal: float, step_s: float, resting: bool) -> None:
        """Start without a phase.

        rest_n: static tension [N]; step_s: step of the coarse solution [s]; resting: the coarse
        solution was started in static equilibrium.
        """
        self._strouhal, self._hz, self._look_s = strouhal, 0.0, 0.0
        self._least = 0.5 * (MIN_VIBRATION * rest_n) ** 2
        self._step_s, self._weight = step_s, 0.0
        self._every, self._waits = 1, 0  # coarse steps per sample, steps since the last one
        self._lost = not resting
        self._keep = 0.0  # decay of each pole over one sample
        self._own, self._other = [0.0] * (2 * POLES), [0.0] * (2 * POLES)  # last inputs, outputs
        self._began = False
        self._v = self._w = 0.0
        self._vv = self._ww = self._vw = self._ahead = self._next = 0.0  # the means
        self._phase: float | None = None  # [rad], once both vibrate
        self._largest = Recent(0.0)

    @property
    def phase_rad(self) -> float | None:
        """Phase by which the coarse solution is ahead [rad]; None: unknown, or no vibration."""
        return None if self._lost else self._phase

    def look(self, time_s: float, rope: Rope, boundary: Boundary) -> None:
        """Update the frequency of the vortices, once a second."""
        if time_s < self._look_s:
            return
        self._look_s = time_s + LOOK_S
        hz = shedding_hz(rope, boundary, self._strouhal)
        if needs_new_interval(hz, self._hz, False):
            self.keep_pace(hz)

    def keep_pace(self, hz: float) -> None:
        """Set the frequency of the fastest vortices [Hz]."""
        self._hz = hz
        self._every = max(int(1.0 / (SAMPLES * hz * self._step_s)), 1)
        between_s = self._every * self._step_s
        self._weight = min(between_s / MEAN_S, 1.0)
        self._keep = 1.0 / (1.0 + tau * CUT_OFF * hz * between_s)
        self._largest = Recent(1.0 / hz)

    def take(self, time_s: float, own_n: float, other_n: float) -> None:
        """Take the top tensions of rope and coarse solution at a time [N]."""
        self._waits += 1
        if self._waits < self._every:
            return
        self._waits = 0
        if not self._began:
            self._began = True
            self._own[0], self._other[0] = own_n, other_n
        v, w = self._pass(self._own, own_n), self._pass(self._other, other_n)
        self._largest.take(time_s, abs(v))
        share, v0, w0 = self._weight, self._v, self._w
        self._vv += share * (v * v - self._vv)
        self._ww += share * (w * w - self._ww)
        self._vw += share * (v * w - self._vw)
        self._ahead += share * (v * w0 - v0 * w - self._ahead)
        self._next += share * (v * v0 - self._next)
        self._v, self._w = v, w
        if self._vv > self._least and self._ww > 0.0 and not self._lost:
            self._turn()

    def bound_n(self, time_s: float) -> float:
        """Return the bound on the error of tension by phase drift [N]."""
        if self._phase is None and not self._lost:
            return 0.0
        psi = pi if self._phase is None or self._lost else PHASE * THIRD * abs(self._phase)
        return 2.0 * AMPLITUDE * sin(0.5 * min(psi, pi)) * self._largest.largest(time_s)

    def _turn(self) -> None:
        """Update the phase, counted on from the last one."""
        turned = sqrt(max(1.0 - (self._next / self._vv) ** 2, 1e-12))  # sin ωh
        across = 0.5 * self._ahead / turned
        if hypot(across, self._vw) < MIN_COHERENCE * sqrt(self._vv * self._ww):
            self._lost = True
            return
        phase = atan2(across, self._vw)
        before = self._phase or 0.0
        self._phase = phase + tau * round((before - phase) / tau)

    def _pass(self, kept: list[float], value: float) -> float:
        """Apply the high-pass filter; kept: input and output of each pole one sample ago."""
        for k in range(0, 2 * POLES, 2):
            passed = self._keep * (kept[k + 1] + value - kept[k])
            kept[k], kept[k + 1] = value, passed
            value = passed
        return value
