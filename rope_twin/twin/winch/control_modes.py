"""Control modes of a winch, and the motion profiles with which it follows them.

A mode sets a target speed within lengths. A profile moves the line to it within the limits of
acceleration and, if given, of jerk. Both profiles stop within the target's lengths: the first
brakes ahead of them at its acceleration limit, the second with the fastest jerk-limited stop.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from rope_twin.scene.winch import ConstantTension
from rope_twin.scene.winch import Winch as WinchScene
from rope_twin.twin.snapshot import DEPTH, LENGTH, SPEED, TENSION
from rope_twin.twin.winch.commands import LineTarget, Payout, TensionFeedback

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


def pulse(motion: Motion, speed: float, acceleration: float, jerk: float) -> Pieces:
    """Return the pieces of the fastest motion to a speed, without acceleration at the end.

    It is one pulse of acceleration: a rise at the jerk limit, a part at the acceleration limit if
    that is reached, and a fall at the jerk limit. With g the remaining change of speed and a the
    present acceleration, the peak p of the pulse follows from g = (2·p² - a²)/(2·j), as long as it
    stays below the limit.
    """
    speed_change = speed - motion.v
    sign = 1.0 if speed_change >= 0.5 * motion.a * abs(motion.a) / jerk else -1.0
    speed_change, a = sign * speed_change, sign * motion.a
    peak = math.sqrt(max(jerk * speed_change + 0.5 * a * a, 0.0))
    plateau = 0.0
    if peak > acceleration:
        peak = max(acceleration, a)
        plateau = (speed_change - (2.0 * peak * peak - a * a) / (2.0 * jerk)) / peak
    rise = max(peak - a, 0.0) / jerk
    return (sign * jerk, rise), (0.0, max(plateau, 0.0)), (-sign * jerk, peak / jerk)


def motion_after(motion: Motion, pieces: Pieces, time_s: float) -> Motion:
    """Return the motion after a time along the pieces; no acceleration after the last one."""
    remaining = time_s
    for jerk, length in pieces:
        motion = motion.later(jerk, min(length, remaining))
        remaining -= min(length, remaining)
        if remaining <= 0.0:
            return motion
    return Motion(motion.x + remaining * motion.v, motion.v, 0.0)


def position_range(motion: Motion, pieces: Pieces) -> tuple[float, float]:
    """Return the minimum and maximum position over the pieces [m]."""
    low = high = motion.x
    for jerk, length in pieces:
        if length <= 0.0:
            continue
        for t in (*_reversal_times(motion, jerk, length), length):
            x = motion.later(jerk, t).x
            low, high = min(low, x), max(high, x)
        motion = motion.later(jerk, length)
    return low, high


def _reversal_times(motion: Motion, jerk: float, length: float) -> list[float]:
    """Return the times within a piece at which the speed is zero: v + a·t + j·t²/2 = 0."""
    if jerk == 0.0:
        roots = [-motion.v / motion.a] if motion.a != 0.0 else []
    else:
        discriminant = motion.a * motion.a - 2.0 * jerk * motion.v
        root = math.sqrt(discriminant) if discriminant > 0.0 else 0.0
        roots = [(-motion.a - root) / jerk, (-motion.a + root) / jerk] if discriminant > 0.0 else []
    return [t for t in roots if 0.0 < t < length]


SPEED_TOL_M_PER_S = 1e-6  # a slower speed at a limit counts as standstill
POSITION_TOL_M = 1e-6  # tolerance of the stopping position
BISECTIONS = 10  # bisection steps between braking and continuing


class AccelerationLimited:
    """Profile with limited acceleration; the payout is the exact integral of the speed."""

    def __init__(self, acceleration: float) -> None:
        self._acceleration = acceleration

    def move(self, line: Payout, target: LineTarget, step_s: float) -> tuple[Payout, bool]:
        """Return the line one step later, and whether it must brake."""
        target_speed, brakes = target.speed_m_per_s, False
        if target_speed == line.speed_m_per_s == 0.0:  # shortcut of most steps
            return line, False
        outward = target_speed > 0.0
        distance = target.high_m - line.length_m if outward else line.length_m - target.low_m
        outward_speed = max(math.copysign(1.0, target_speed) * line.speed_m_per_s, 0.0)
        braking = braking_speed(distance - 0.5 * step_s * outward_speed, self._acceleration, step_s)
        if abs(target_speed) > braking:
            target_speed = (
                math.copysign(braking, target_speed) if braking > SPEED_TOL_M_PER_S else 0.0
            )
            brakes = True
        accelerates = abs(target_speed) > abs(line.speed_m_per_s)
        follow = _follow_evenly if brakes and accelerates else _follow
        return follow(line, target_speed, self._acceleration, step_s), brakes

    def follow_line(self, line: Payout) -> None:
        """Do nothing, as the profile has no state."""


class JerkLimited:
    """Fastest profile to the target speed with continuous acceleration."""

    def __init__(self, acceleration: float, jerk: float) -> None:
        self._most, self._jerk = acceleration, jerk
        self._acceleration = 0.0

    def move(self, line: Payout, target: LineTarget, step_s: float) -> tuple[Payout, bool]:
        """Return the line one step later, and whether it must brake."""
        start = Motion(line.length_m, line.speed_m_per_s, self._acceleration)
        distance = target.high_m - start.x if target.speed_m_per_s > 0.0 else start.x - target.low_m
        has_arrived = abs(distance) < POSITION_TOL_M and abs(start.v) < SPEED_TOL_M_PER_S
        wanted = 0.0 if has_arrived else target.speed_m_per_s
        continued = motion_after(start, pulse(start, wanted, self._most, self._jerk), step_s)
        brakes = not self._can_stop(continued, target)
        after = self._hardest_braking(start, continued, target, step_s) if brakes else continued
        self._acceleration = after.a
        return Payout(after.x, after.v), brakes

    def follow_line(self, line: Payout) -> None:
        """Reset the acceleration."""
        self._acceleration = 0.0

    def _hardest_braking(
        self, start: Motion, continued: Motion, target: LineTarget, step_s: float
    ) -> Motion:
        """Return the motion between continuing and braking that just stops within the lengths."""
        stop = motion_after(start, pulse(start, 0.0, self._most, self._jerk), step_s)
        low, high, best = 0.0, 1.0, stop
        for _ in range(BISECTIONS):
            fraction = 0.5 * (low + high)
            jerk = (stop.a + fraction * (continued.a - stop.a) - start.a) / step_s
            trial = motion_after(start, ((jerk, step_s),), step_s)
            if self._can_stop(trial, target):
                low, best = fraction, trial
            else:
                high = fraction
        return best

    def _can_stop(self, motion: Motion, target: LineTarget) -> bool:
        """Return whether the fastest stop from this motion stays within the target's lengths."""
        lowest, highest = position_range(motion, pulse(motion, 0.0, self._most, self._jerk))
        return lowest >= target.low_m and highest <= target.high_m


MotionProfile = AccelerationLimited | JerkLimited


def braking_speed(room_m: float, acceleration: float, step_s: float) -> float:
    """Return the largest speed v at the end of a step from which the line still stops in time.

    v²/(2·a) + v·h/2 = room_m, the distance left: braking from v, and v's part of the step itself
    (the caller subtracts the other half, of the speed at the step's start, from room_m).
    """
    offset = 0.5 * acceleration * step_s
    return math.sqrt(2.0 * acceleration * max(room_m, 0.0) + offset * offset) - offset


def _follow_evenly(line: Payout, target_speed: float, acceleration: float, step_s: float) -> Payout:
    """Return the line after constant acceleration, within the distance of `braking_speed`."""
    max_change = acceleration * step_s
    speed = line.speed_m_per_s + min(
        max(target_speed - line.speed_m_per_s, -max_change), max_change
    )
    return Payout(line.length_m + step_s * 0.5 * (line.speed_m_per_s + speed), speed)


def _follow(line: Payout, target_speed: float, acceleration: float, step_s: float) -> Payout:
    change = target_speed - line.speed_m_per_s
    reached = abs(change) / acceleration
    if reached >= step_s:
        rate = math.copysign(acceleration, change)
        speed = line.speed_m_per_s + rate * step_s
        return Payout(line.length_m + step_s * 0.5 * (line.speed_m_per_s + speed), speed)
    mean = 0.5 * (line.speed_m_per_s + target_speed)
    return Payout(line.length_m + reached * mean + (step_s - reached) * target_speed, target_speed)


DEPTH_SMOOTHING_S = 20.0  # longer than wave and axial periods, shorter than a lift


class SpeedControl:
    """Speed control, + pays out, within the payout limits."""

    kind = SPEED

    def __init__(self, scene: WinchScene) -> None:
        self._scene, self._speed = scene, 0.0
        self._wish = _limited(0.0, scene)

    def begin(self, value: float) -> None:
        """Start at a set-point of speed [m/s]."""
        self._speed, self._wish = value, _limited(value, self._scene)

    def target(self, line: Payout, feedback: TensionFeedback | None, step_s: float) -> LineTarget:
        """Return the commanded speed."""
        return self._wish

    def words(self) -> str:
        """Return the speed limit, if the command exceeds it."""
        limit = self._scene.speed_limit_m_per_s
        if abs(self._speed) <= limit:
            return ""
        return f"{self._speed:+.2f} m/s commanded; the winch does {limit:g} m/s at most"


class LengthControl:
    """Length control: stops at a payout, reached as fast as the limits allow."""

    kind = LENGTH

    def __init__(self, scene: WinchScene) -> None:
        self._scene, self._length = scene, scene.min_line_out_m

    def begin(self, value: float) -> None:
        """Start at a set-point of payout [m]."""
        self._length = value

    def target(self, line: Payout, feedback: TensionFeedback | None, step_s: float) -> LineTarget:
        """Return the target towards the set-point."""
        return _towards(self._length, line, self._scene)

    def words(self) -> str:
        """Return "": a command out of range was rejected."""
        return ""


class DepthControl:
    """Depth control: stops at a depth of the payload.

    Stretch and curvature of the rope make the depth differ from the payout. That difference, less
    the heave of the hang-off, is smoothed over DEPTH_SMOOTHING_S, so that the winch does not follow
    the payload's motion in waves, and gives the payout for the depth.
    """

    kind = DEPTH

    def __init__(self, scene: WinchScene) -> None:
        self._scene, self._depth = scene, 0.0
        self._beyond: float | None = None  # depth less payout, smoothed [m]
        self._at_end = ""

    def begin(self, value: float) -> None:
        """Start at a set-point of depth [m below the mean water level]."""
        self._depth = value

    def target(self, line: Payout, feedback: TensionFeedback | None, step_s: float) -> LineTarget:
        """Return the target towards the payout for the depth."""
        assert feedback is not None, "tension feedback is missing"
        beyond = feedback.depth_m - line.length_m
        if self._beyond is not None:
            weight = -math.expm1(-step_s / DEPTH_SMOOTHING_S)
            beyond = self._beyond + weight * (beyond - self._beyond)
        self._beyond = beyond
        wanted_m = self._depth - beyond
        min_m, max_m = self._scene.min_line_out_m, self._scene.max_line_out_m
        length_m = min(max(wanted_m, min_m), max_m)
        self._at_end = (
            f"a depth of {self._depth:g} m needs {wanted_m:.1f} m of line; the winch has {min_m:g} "
            f"to {max_m:g} m" if length_m != wanted_m else ""
        )  # fmt: skip
        return _towards(length_m, line, self._scene)

    def words(self) -> str:
        """Return the payout limit, if the depth is out of reach."""
        return self._at_end


class TensionControl:
    """Constant tension (CT) control: a PI controller of the speed.

    With the tension F' expected at the step's end, V' = g·(F' - F_set) + integral, solved for V': a
    high gain then causes no oscillation with a stiff rope from step to step.
    """

    kind = TENSION

    def __init__(self, scene: WinchScene, gains: ConstantTension) -> None:
        self._scene, self._gains = scene, gains
        self._tension, self._integral = 0.0, 0.0  # [N], [m/s]
        self._asked = 0.0

    def begin(self, value: float) -> None:
        """Start at a set-point of tension [N]."""
        if value != self._tension:
            self._tension, self._integral = value, 0.0

    def target(self, line: Payout, feedback: TensionFeedback | None, step_s: float) -> LineTarget:
        """Return the target: pay out if the tension is too high, haul in if it is too low."""
        assert feedback is not None, "tension feedback is missing"
        limit, gain = self._scene.speed_limit_m_per_s, 1e-3 * self._gains.gain_m_per_s_per_kn
        response, V = feedback.hold + feedback.brace, line.speed_m_per_s
        if self._gains.integral_time_s is not None:
            error = gain * (feedback.pull_n - self._tension)
            integral = self._integral + step_s / self._gains.integral_time_s * error
            self._integral = min(max(integral, -limit), limit)  # anti-windup at the speed limit
        excess = feedback.at_speed(V) - self._tension
        self._asked = (gain * excess + self._integral) / (1.0 + gain * response)
        return _limited(self._asked, self._scene)

    def words(self) -> str:
        """Return the speed limit, if the controller exceeds it."""
        limit = self._scene.speed_limit_m_per_s
        if abs(self._asked) <= limit:
            return ""
        return (
            f"{self._tension * 1e-3:g} kN would take {self._asked:+.2f} m/s; the winch does "
            f"{limit:g} m/s at most"
        )


ControlMode = SpeedControl | LengthControl | DepthControl | TensionControl


def control_modes(scene: WinchScene) -> tuple[ControlMode, ...]:
    """Return the control modes of a winch; the first is active at the start."""
    modes = SpeedControl(scene), LengthControl(scene), DepthControl(scene)
    gains = scene.constant_tension
    return modes if gains is None else (*modes, TensionControl(scene, gains))


def _limited(speed: float, scene: WinchScene) -> LineTarget:
    limit = scene.speed_limit_m_per_s
    return LineTarget(min(max(speed, -limit), limit), scene.min_line_out_m, scene.max_line_out_m)


def _towards(length: float, line: Payout, scene: WinchScene) -> LineTarget:
    limit, low, high = scene.speed_limit_m_per_s, scene.min_line_out_m, scene.max_line_out_m
    if length > line.length_m:
        return LineTarget(limit, low, length)
    return LineTarget(-limit if length < line.length_m else 0.0, length, high)
