"""Messages of samples: topic and bytes of what a feed publishes."""

from __future__ import annotations

import math
from functools import cache

from rope_twin.feeds.conversion import LineSample
from rope_twin.feeds.motion_track import HeaveOutput, MotionOutput
from rope_twin.messages import encode_heave, encode_pose, templates
from rope_twin.messages.cdr import Template

MEASURED_TOPIC, MOTOR_TENSION_TOPIC = "winch/measured", "winch/motor_tension"


@cache
def _measured(winch: str) -> Template:
    return Template(templates.joint_state([winch], ("position", "velocity", "effort")))


@cache
def _motor_tension(winch: str) -> Template:
    return Template(templates.joint_state([winch], ("effort",)))


def _stamp(stamp_ns: int) -> dict[str, int]:
    sec, nanosec = templates.split(stamp_ns)
    return {"header.stamp.sec": sec, "header.stamp.nanosec": nanosec}


def encode_line(sample: LineSample, winch: str) -> list[tuple[str, bytes]]:
    """Return topics and messages of a measurement on a winch.

    Tension of the motor has a topic of its own, since losses of sheaves and gear are in it.
    """
    messages = []
    values = sample.payout_m, sample.speed_m_per_s, sample.tension_n
    if not all(math.isnan(value) for value in values):
        payout, speed, tension = ([value] for value in values)
        own = {"position": payout, "velocity": speed, "effort": tension}
        messages.append((MEASURED_TOPIC, _measured(winch).fill({**_stamp(sample.stamp_ns), **own})))
    if not math.isnan(sample.motor_tension_n):
        own = {"effort": [sample.motor_tension_n]}
        data = _motor_tension(winch).fill({**_stamp(sample.stamp_ns), **own})
        messages.append((MOTOR_TENSION_TOPIC, data))
    return messages


def encode_output(output: MotionOutput) -> tuple[str, bytes]:
    """Return topic and message of a motion."""
    if isinstance(output, HeaveOutput):
        data = encode_heave(output.stamp_ns, output.heave_m, output.heave_rate_m_per_s)
        return "ship/heave", data
    return "ship/odometry", encode_pose(output.stamp_ns, output)
