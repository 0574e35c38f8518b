"""Control modes of a winch: speed, length, depth and constant tension.

A mode gives the target speed of the next step and the lengths within which the line must be able to
stop.
"""

from __future__ import annotations

import math
from typing import Protocol

from rope_twin.scene.winch import ConstantTension
from rope_twin.scene.winch import Winch as WinchScene
from rope_twin.twin.winch.commands import DEPTH, LENGTH, SPEED, TENSION
from rope_twin.twin.winch.payout import LineTarget, Payout, TensionFeedback

DEPTH_SMOOTHING_S = 20.0  # longer than wave and axial periods, shorter than a lift


class ControlMode(Protocol):
    """Interface of a control mode."""

    kind: str

    def begin(self, value: float) -> None:
        """Start control at this set-point, in the mode's unit."""

    def target(self, line: Payout, feedback: TensionFeedback | None, step_s: float) -> LineTarget:
        """Return the target of the next step."""

    def words(self) -> str:
        """Return the active limit of the mode; "" if none."""


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
        self._scene, self._length = scene, scene.least_line_out_m

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
            share = -math.expm1(-step_s / DEPTH_SMOOTHING_S)
            beyond = self._beyond + share * (beyond - self._beyond)
        self._beyond = beyond
        wanted = self._depth - beyond
        least, most = self._scene.least_line_out_m, self._scene.most_line_out_m
        length = min(max(wanted, least), most)
        self._at_end = (
            f"a depth of {self._depth:g} m needs {wanted:.1f} m of line; the winch has {least:g} "
            f"to {most:g} m" if length != wanted else ""
        )  # fmt: skip
        return _towards(length, line, self._scene)

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
        answer, V = feedback.hold + feedback.brace, line.speed_m_per_s
        if self._gains.integral_time_s is not None:
            error = gain * (feedback.pull_n - self._tension)
            grown = self._integral + step_s / self._gains.integral_time_s * error
            self._integral = min(max(grown, -limit), limit)  # anti-windup at the speed limit
        above = feedback.at_speed(V) - self._tension
        self._asked = (gain * above + self._integral) / (1.0 + gain * answer)
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


def control_modes(scene: WinchScene) -> tuple[ControlMode, ...]:
    """Return the control modes of a winch; the first is active at the start."""
    modes: tuple[ControlMode, ...] = (
        SpeedControl(scene),
        LengthControl(scene),
        DepthControl(scene),
    )
    if scene.constant_tension is not None:
        modes += (TensionControl(scene, scene.constant_tension),)
    return modes


def _limited(speed: float, scene: WinchScene) -> LineTarget:
    limit = scene.speed_limit_m_per_s
    return LineTarget(min(max(speed, -limit), limit), scene.least_line_out_m, scene.most_line_out_m)


def _towards(length: float, line: Payout, scene: WinchScene) -> LineTarget:
    limit, low, high = scene.speed_limit_m_per_s, scene.least_line_out_m, scene.most_line_out_m
    if length > line.length_m:
        return LineTarget(limit, low, length)
    return LineTarget(-limit if length < line.length_m else 0.0, length, high)
