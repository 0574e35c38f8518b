"""Messages of samples: topic and bytes of what a feed publishes."""

from __future__ import annotations

import math

from rope_twin.feeds.conversion import LineSample
from rope_twin.feeds.motion_track import HeaveOutput, MotionOutput
from rope_twin.messages import encode_heave, encode_measurement, encode_pose
from rope_twin.twin.readings import Measurement


def encode_line(sample: LineSample, winch: str) -> list[tuple[str, bytes]]:
    """Return topics and messages of a measurement on a winch.

    Tension of the motor has a topic of its own, since losses of sheaves and gear are in it.
    """
    at, measured = sample.stamp_ns, []
    payout, speed = _known(sample.payout_m), _known(sample.speed_m_per_s)
    tension = _known(sample.tension_n)
    if (payout, speed, tension) != (None, None, None):
        measured.append(Measurement.of_winch(at, payout, speed, tension, winch))
    if not math.isnan(sample.motor_tension_n):
        measured.append(Measurement.of_motor(at, sample.motor_tension_n, winch))
    return [encode_measurement(at, one) for one in measured]


def _known(value: float) -> float | None:
    return None if math.isnan(value) else value


def encode_output(output: MotionOutput) -> tuple[str, bytes]:
    """Return topic and message of a motion."""
    if isinstance(output, HeaveOutput):
        data = encode_heave(output.stamp_ns, output.heave_m, output.heave_rate_m_per_s)
        return "ship/heave", data
    return "ship/odometry", encode_pose(output.stamp_ns, output)
