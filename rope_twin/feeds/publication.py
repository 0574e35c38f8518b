"""Messages of samples: topic and bytes of what a feed publishes."""

from __future__ import annotations

import math

from rope_twin.feeds.conversion import LineSample
from rope_twin.feeds.motion_track import HeaveOutput, MotionOutput
from rope_twin.messages import encode_heave, encode_measurement, encode_pose
from rope_twin.twin.measured.readings import Measurement


def encode_line(sample: LineSample, winch: str) -> list[tuple[str, bytes]]:
    """Return topics and messages of a measurement on a winch.

    Tension of the motor has a topic of its own, since losses of sheaves and gear are in it.
    """
    measured = []
    values = [_known(x) for x in (sample.payout_m, sample.speed_m_per_s, sample.tension_n)]
    if any(value is not None for value in values):
        measured.append(Measurement.of_winch(sample.stamp_ns, *values, winch))
    if not math.isnan(sample.motor_tension_n):
        measured.append(Measurement.of_motor(sample.stamp_ns, sample.motor_tension_n, winch))
    return [encode_measurement(sample.stamp_ns, one) for one in measured]


def _known(value: float) -> float | None:
    return None if math.isnan(value) else value


def encode_output(output: MotionOutput) -> tuple[str, bytes]:
    """Return topic and message of a motion."""
    if isinstance(output, HeaveOutput):
        data = encode_heave(output.stamp_ns, output.heave_m, output.heave_rate_m_per_s)
        return "ship/heave", data
    return "ship/odometry", encode_pose(output.stamp_ns, output)
