"""Active heave compensation (AHC): the winch pays out as the hang-off rises.

Its speed follows efficiency·e^(-iω·delay)/(1 + iω·lag) of the hang-off's velocity, so that a steady
heave of amplitude A leaves the payload's end of a stiff line |1 - that factor|·A. Active limits of
stroke, speed and acceleration are reported.
"""

from __future__ import annotations

import math
from collections import deque

from rope_twin.scene.winch import HeaveCompensation
from rope_twin.twin.winch.commands import COMPENSATE, EMERGENCY_STOP, STOP_COMPENSATING
from rope_twin.twin.winch.motion_profile import braking_speed
from rope_twin.twin.winch.payout import Payout, WinchStep


class Compensation:
    """Heave compensation of a winch; `add` is called once a step."""

    def __init__(self, params: HeaveCompensation) -> None:
        self._params = params
        self._on = True
        self._stroke = self._rate = 0.0  # payout added to the command [m], and its rate [m/s]
        self._seen: deque[tuple[int, float]] = deque()  # time [ns], velocity of the hang-off [m/s]
        self._delayed = self._lagged = 0.0  # the velocity after the dead time, and after the lag
        self._at_limit = ""

    def add(self, wanted: Payout, moment: WinchStep) -> Payout:
        """Return the line at the end of the step, including the stroke."""
        params, h = self._params, moment.step_s
        self._measure(moment)
        target = params.efficiency * self._lagged if self._on else 0.0
        limit = params.speed_limit_m_per_s
        speed = min(max(target, -limit), limit)
        most = params.acceleration_limit_m_per_s2 * h
        rate = self._rate + min(max(speed - self._rate, -most), most)
        rate = self._within_stroke(rate, h)
        self._at_limit = self._limit_words(target, rate)
        stroke = self._stroke + 0.5 * h * (self._rate + rate)
        if abs(stroke) > params.stroke_m:  # in the last step of braking, by less than a·h²/8
            stroke, rate = math.copysign(params.stroke_m, stroke), 0.0
        self._stroke, self._rate = stroke, rate
        return Payout(wanted.length_m + self._stroke, wanted.speed_m_per_s + rate)

    def _measure(self, moment: WinchStep) -> None:
        """Apply dead time and lag to the hang-off's velocity at the end of the step."""
        end_ns, h, lag = (
            moment.begin_ns + round(moment.step_s * 1e9),
            moment.step_s,
            self._params.lag_s,
        )
        self._seen.append((end_ns, moment.heave_m_per_s))
        at_ns = end_ns - round(self._params.delay_s * 1e9)
        while len(self._seen) > 2 and self._seen[1][0] <= at_ns:
            self._seen.popleft()
        before, self._delayed = self._delayed, _read(self._seen, at_ns)
        if lag > 0.0:  # exact for a velocity that is linear over the step
            slope, keep = (self._delayed - before) / h, math.exp(-h / lag)
            self._lagged = (
                self._delayed - lag * slope + (self._lagged - before + lag * slope) * keep
            )
        else:
            self._lagged = self._delayed

    def _within_stroke(self, rate: float, step_s: float) -> float:
        """Return a rate from which it can still stop within its stroke."""
        side = math.copysign(1.0, rate)
        room = self._params.stroke_m - side * self._stroke
        going = max(side * self._rate, 0.0)
        acceleration = self._params.acceleration_limit_m_per_s2
        return side * min(
            abs(rate), braking_speed(room - 0.5 * step_s * going, acceleration, step_s)
        )

    def _limit_words(self, target: float, rate: float) -> str:
        params = self._params
        if abs(target) > params.speed_limit_m_per_s:
            return f"heave compensation at its speed limit, {params.speed_limit_m_per_s:g} m/s"
        if params.stroke_m - abs(self._stroke) < 1e-2 * params.stroke_m and abs(rate) < abs(target):
            return f"heave compensation at the end of its stroke, {params.stroke_m:g} m"
        return ""

    def switch(self, switch: str, time_ns: int) -> None:
        """Switch on or off; an emergency stop stops it too."""
        if switch in (COMPENSATE, STOP_COMPENSATING, EMERGENCY_STOP):
            self._on = switch == COMPENSATE
        if switch == COMPENSATE:
            self._stroke = 0.0  # mid-stroke is the present line

    def set_total_length(self, whole_m: float) -> None:
        """Do nothing, as compensation does not depend on the total length."""

    def words(self) -> str:
        """Return the active limit; "" if none."""
        return self._at_limit

    def figures(self, line: Payout) -> dict[str, float]:
        """Return stroke and its rate, + paid out, and whether it is on."""
        return {
            "compensation_m": self._stroke,
            "compensation_m_per_s": self._rate,
            "compensation_on": float(self._on),
        }


def _read(seen: deque[tuple[int, float]], at_ns: int) -> float:
    """Return the velocity at a time, linear between samples; 0 before the first."""
    (t0, v0), (t1, v1) = seen[0], seen[min(1, len(seen) - 1)]
    if at_ns < t0:
        return 0.0
    return v0 + (v1 - v0) * min((at_ns - t0) / (t1 - t0), 1.0) if t1 > t0 else v0
