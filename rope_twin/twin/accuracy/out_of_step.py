"""How far vortices that set their own pace are out of step, and what the tension is wrong by.

A wake oscillator is driven by nothing but itself: finer elements and steps shake the rope as hard,
but a little slower or faster, and what that adds up to is never made good. The tension's error is
then one of phase. The vibration is what a high pass at half the vortices' frequency leaves of the
top tension, of the rope (v) and of the companion (w). By means over some seconds of these and of
what they were one step before (v', w') the companion is ahead by

    φ = atan2(⟨v·w' - v'·w⟩/(2·sin ωh), ⟨v·w⟩),    cos ωh = ⟨v·v'⟩/⟨v²⟩,

counted on over whole turns. Elements and step are of second order, and so is the pace: the rope is
out of step with the converged one by a third of it (Richardson 1911), and two vibrations of
amplitude a that are out of step by ψ differ by 2·a·sin(ψ/2) at most.

Where rope and companion shake so differently that they have no phase (a small coherence), or a
companion began in the middle of the vibration, how far the rope is out of step cannot be known: ψ
is half a turn from then on.
"""

from __future__ import annotations

from math import atan2, hypot, pi, sin, sqrt, tau

from rope_twin.core.state import Boundary, Rope
from rope_twin.twin.accuracy.error_bound import MEAN_S, THIRD, Recent

PHASE, AMPLITUDE = 1.4, 1.3  # times a third of the phase, and times the amplitude that is left
COHERENT = 0.3  # of 1: less is no phase
CUT_OFF, POLES = 0.5, 3  # of the vortices' frequency; the tension goes at once or twice that
SAMPLES = 32  # of a period of the vortices: a crest of twice their frequency is met to 2 %
LOOK_S = 1.0  # between two looks at how fast the vortices are
LEAST = 1e-6  # of the tension at rest: a vibration


class _Pace:
    """How fast vortices are, by functions whose filters take a second to load: before a run."""

    def __init__(self) -> None:
        from rope_twin.twin.vibration.looks import is_another_pace, vortices_hz

        self.is_another_pace, self.vortices_hz = is_another_pace, vortices_hz


class OutOfStep:
    """Of one companion; `take` gets both tensions after each of its steps."""

    def __init__(self, rest_n: float, strouhal: float, step_s: float, resting: bool) -> None:
        """`rest_n`: the tension at rest; `step_s`: the companion's step.

        resting: the companion has been there since the rope rested.
        """
        self._pace = _Pace()
        self._strouhal, self._hz, self._look_s = strouhal, 0.0, 0.0
        self._least = 0.5 * (LEAST * rest_n) ** 2
        self._step_s, self._weight = step_s, 0.0
        self._every, self._waits = 1, 0  # of the companion's steps one is looked at
        self._lost = not resting
        self._keep = 0.0  # of each pole, for one step
        self._own, self._other = [0.0] * (2 * POLES), [0.0] * (2 * POLES)  # inputs, outputs before
        self._began = False
        self._v = self._w = 0.0
        self._vv = self._ww = self._vw = self._ahead = self._next = 0.0  # the means
        self._phase: float | None = None  # [rad], once both vibrate
        self._largest = Recent(0.0)

    @property
    def phase_rad(self) -> float | None:
        """By which the companion is ahead; None where that cannot be known, or nothing vibrates."""
        return None if self._lost else self._phase

    def look(self, time_s: float, rope: Rope, boundary: Boundary) -> None:
        """How fast the vortices are, once a second."""
        if time_s < self._look_s:
            return
        self._look_s = time_s + LOOK_S
        hz = self._pace.vortices_hz(rope, boundary, self._strouhal)
        if self._pace.is_another_pace(hz, self._hz, False):
            self.keep_pace(hz)

    def keep_pace(self, hz: float) -> None:
        """The fastest vortices have this frequency from now on."""
        self._hz = hz
        self._every = max(int(1.0 / (SAMPLES * hz * self._step_s)), 1)
        between_s = self._every * self._step_s
        self._weight = min(between_s / MEAN_S, 1.0)
        self._keep = 1.0 / (1.0 + tau * CUT_OFF * hz * between_s)
        self._largest = Recent(1.0 / hz)

    def take(self, time_s: float, own_n: float, other_n: float) -> None:
        """The top tensions of rope and companion at a time."""
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
        """By which the tension may be wrong for it."""
        if self._phase is None and not self._lost:
            return 0.0
        psi = pi if self._phase is None or self._lost else PHASE * THIRD * abs(self._phase)
        return 2.0 * AMPLITUDE * sin(0.5 * min(psi, pi)) * self._largest.largest(time_s)

    def _turn(self) -> None:
        """The phase now, counted on from the last one."""
        turned = sqrt(max(1.0 - (self._next / self._vv) ** 2, 1e-12))  # sin ωh
        across = 0.5 * self._ahead / turned
        if hypot(across, self._vw) < COHERENT * sqrt(self._vv * self._ww):
            self._lost = True
            return
        phase = atan2(across, self._vw)
        before = self._phase or 0.0
        self._phase = phase + tau * round((before - phase) / tau)

    def _pass(self, kept: list[float], value: float) -> float:
        """The high pass: each pole's input and output one step ago are `kept`."""
        for k in range(0, 2 * POLES, 2):
            passed = self._keep * (kept[k + 1] + value - kept[k])
            kept[k], kept[k + 1] = value, passed
            value = passed
        return value
