"""Motion profiles of a winch: limits of acceleration and, if given, of jerk.

Both stop within the target's lengths: the first brakes ahead of them at its acceleration limit, the
second with the fastest jerk-limited stop.
"""

from __future__ import annotations

import math
from typing import Protocol

from rope_twin.twin.hoisting.line import LineOut, Wish
from rope_twin.twin.hoisting.stop import Motion, along, pulse, reach

CREEP_M_PER_S = 1e-6  # a slower speed at a limit counts as standstill
CLOSE_M = 1e-6  # tolerance of the stopping position
HALVINGS = 10  # bisection steps between braking and continuing


class Pace(Protocol):
    """Interface of a motion profile."""

    def move(self, line: LineOut, wish: Wish, step_s: float) -> tuple[LineOut, bool]:
        """Return the line one step later, and whether it must brake for the target's lengths."""

    def yield_to(self, line: LineOut) -> None:
        """Accept that a limit has moved the line here."""


class AccelerationLimited:
    """Profile with limited acceleration; the payout is the exact integral of the speed."""

    def __init__(self, acceleration: float) -> None:
        self._acceleration = acceleration

    def move(self, line: LineOut, wish: Wish, step_s: float) -> tuple[LineOut, bool]:
        """Return the line one step later, and whether it must brake."""
        target, held = wish.speed_m_per_s, False
        if target == line.speed_m_per_s == 0.0:  # shortcut of most steps
            return line, False
        outward = target > 0.0
        room = wish.high_m - line.length_m if outward else line.length_m - wish.low_m
        outgoing = max(math.copysign(1.0, target) * line.speed_m_per_s, 0.0)
        braking = braking_speed(room - 0.5 * step_s * outgoing, self._acceleration, step_s)
        if abs(target) > braking:
            target = math.copysign(braking, target) if braking > CREEP_M_PER_S else 0.0
            held = True
        gaining = abs(target) > abs(line.speed_m_per_s)
        follow = _follow_evenly if held and gaining else _follow
        return follow(line, target, self._acceleration, step_s), held

    def yield_to(self, line: LineOut) -> None:
        """Do nothing, as the profile has no state."""


class JerkLimited:
    """Fastest profile to the target speed with continuous acceleration."""

    def __init__(self, acceleration: float, jerk: float) -> None:
        self._most, self._jerk = acceleration, jerk
        self._acceleration = 0.0

    def move(self, line: LineOut, wish: Wish, step_s: float) -> tuple[LineOut, bool]:
        """Return the line one step later, and whether it must brake."""
        now = Motion(line.length_m, line.speed_m_per_s, self._acceleration)
        ahead = wish.high_m - now.x if wish.speed_m_per_s > 0.0 else now.x - wish.low_m
        there = abs(ahead) < CLOSE_M and abs(now.v) < CREEP_M_PER_S
        wanted = 0.0 if there else wish.speed_m_per_s
        going = along(now, pulse(now, wanted, self._most, self._jerk), step_s)
        held = not self._stops(going, wish)
        after = self._hardest(now, going, wish, step_s) if held else going
        self._acceleration = after.a
        return LineOut(after.x, after.v), held

    def yield_to(self, line: LineOut) -> None:
        """Reset the acceleration."""
        self._acceleration = 0.0

    def _hardest(self, now: Motion, going: Motion, wish: Wish, step_s: float) -> Motion:
        """Return the motion between continuing and braking that just stops within the lengths."""
        stop = along(now, pulse(now, 0.0, self._most, self._jerk), step_s)
        low, high, best = 0.0, 1.0, stop
        for _ in range(HALVINGS):
            share = 0.5 * (low + high)
            jerk = (stop.a + share * (going.a - stop.a) - now.a) / step_s
            trial = along(now, ((jerk, step_s),), step_s)
            if self._stops(trial, wish):
                low, best = share, trial
            else:
                high = share
        return best

    def _stops(self, motion: Motion, wish: Wish) -> bool:
        """Return whether the fastest stop from this motion stays within the target's lengths."""
        lowest, highest = reach(motion, pulse(motion, 0.0, self._most, self._jerk))
        return lowest >= wish.low_m and highest <= wish.high_m


def braking_speed(room_m: float, acceleration: float, step_s: float) -> float:
    """Return the largest speed v at the end of a step from which the line still stops in time.

    v²/(2·a) + v·h/2 = room: braking from v, and v's part of the step itself (the other half, of the
    speed at the step's start, is subtracted from the room by the caller).
    """
    lag = 0.5 * acceleration * step_s
    return math.sqrt(2.0 * acceleration * max(room_m, 0.0) + lag * lag) - lag


def _follow_evenly(line: LineOut, target: float, acceleration: float, step_s: float) -> LineOut:
    """Return the line after constant acceleration, within the distance of `braking_speed`."""
    most = acceleration * step_s
    speed = line.speed_m_per_s + min(max(target - line.speed_m_per_s, -most), most)
    return LineOut(line.length_m + step_s * 0.5 * (line.speed_m_per_s + speed), speed)


def _follow(line: LineOut, target: float, acceleration: float, step_s: float) -> LineOut:
    change = target - line.speed_m_per_s
    reached = abs(change) / acceleration
    if reached >= step_s:
        rate = math.copysign(acceleration, change)
        speed = line.speed_m_per_s + rate * step_s
        return LineOut(line.length_m + step_s * 0.5 * (line.speed_m_per_s + speed), speed)
    mean = 0.5 * (line.speed_m_per_s + target)
    return LineOut(line.length_m + reached * mean + (step_s - reached) * target, target)
