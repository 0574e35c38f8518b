"""CDR bytes of what the twin listens to, and of the small topics that no snapshot is needed for."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np

from rope_twin.messages import templates
from rope_twin.messages.cdr import Template, new, serialise
from rope_twin.topics import CUT_TOPIC, ORDER_TOPICS, SWITCH_TOPIC
from rope_twin.twin.motion.ship_pose import ShipPose
from rope_twin.twin.winch.commands import DEPTH, LENGTH, SPEED, TENSION, WinchCommand

RECORD_FRAME = "sea"  # frame of the sea records in bags/, which readers ignore
ORDER_FIELDS = {SPEED: "velocity", LENGTH: "position", DEPTH: "position", TENSION: "effort"}


def encode_heave(
    stamp_ns: int, position_m: float, velocity_m_per_s: float, recorded: bool = False
) -> bytes:
    """Return a ship/heave message: heave of the hang-off above its rest position and rate, up
    positive.

    recorded: for a sea record, in RECORD_FRAME and with unknown (zero) covariance.
    """
    return _heave(recorded).fill(
        {
            **_stamp(stamp_ns),
            "pose.pose.position": (0.0, 0.0, position_m),
            "twist.twist.linear": (0.0, 0.0, velocity_m_per_s),
        }
    )


def encode_pose(stamp_ns: int, pose: ShipPose) -> bytes:
    """Return a ship/odometry message: pose of the reference point relative to its rest position."""
    return _pose().fill(
        {
            **_stamp(stamp_ns),
            "pose.pose.position": pose.position_m,
            "pose.pose.orientation": pose.orientation,
            "twist.twist.linear": pose.velocity_m_per_s,
            "twist.twist.angular": pose.rate_rad_per_s,
        }
    )


def encode_elevation(stamp_ns: int, elevation_m: float, recorded: bool = False) -> bytes:
    """Return a sea/elevation message: sea surface at the ship above mean water level.

    recorded: for a sea record, in RECORD_FRAME.
    """
    return _elevation(recorded).fill({**_stamp(stamp_ns), "point": (0.0, 0.0, elevation_m)})


def encode_order(stamp_ns: int, order: WinchCommand, winch: str = "winch") -> tuple[str, bytes]:
    """Return topic and message of a winch command; a stamp of 0 means apply immediately.

    Length and depth are positions, a speed a velocity, a tension an effort, a switch a second name.
    """
    topic = ORDER_TOPICS.get(order.kind, SWITCH_TOPIC)
    values: dict[str, Any] = dict(_stamp(stamp_ns))
    if topic == SWITCH_TOPIC:
        return topic, _joint(f"{winch}\n{order.kind}", "").fill(values)
    field = ORDER_FIELDS[order.kind]
    return topic, _joint(winch, field).fill({**values, field: (order.value,)})


def encode_cut(stamp_ns: int, below_m: float, rope: str = "") -> tuple[str, bytes]:
    """Return topic and message of a cut below the upper end; a stamp of 0 means immediately."""
    values = {**_stamp(stamp_ns), "position": (below_m,)}
    return CUT_TOPIC, _joint(rope or "rope", "position").fill(values)


def encode_current(rows: Sequence[Sequence[float]]) -> bytes:
    """Return a `current` message: rows of z [m], east, north [m/s], from the surface down."""
    numbers = [float(number) for row in rows for number in row]
    sizes = (("row", len(rows), len(numbers)), ("column", 3, 3))
    layout = new(
        "std_msgs/msg/MultiArrayLayout",
        dim=[
            new("std_msgs/msg/MultiArrayDimension", label=label, size=size, stride=stride)
            for label, size, stride in sizes
        ],
        data_offset=0,
    )
    data = np.array(numbers)
    return serialise(new("std_msgs/msg/Float64MultiArray", layout=layout, data=data))


def encode_epoch(epoch_ns: int) -> bytes:
    """Return a twin/epoch message: ROS time of t = 0."""
    return serialise(templates.time(epoch_ns))


def encode_seat(words: str) -> bytes:
    """Return a winch/seat message: the node in command of each winch."""
    return serialise(new("std_msgs/msg/String", data=words))


def _stamp(stamp_ns: int) -> dict[str, int]:
    sec, nanosec = templates.split(stamp_ns)
    return {"header.stamp.sec": sec, "header.stamp.nanosec": nanosec}


@cache
def _heave(recorded: bool) -> Template:
    if recorded:
        return Template(templates.odometry(RECORD_FRAME, "hang_off", None))
    return Template(templates.odometry("map", "hang_off", templates.HEAVE))


@cache
def _pose() -> Template:
    return Template(templates.odometry("ship_mean", "ship"))


@cache
def _elevation(recorded: bool) -> Template:
    return Template(templates.point_stamped(RECORD_FRAME if recorded else "map"))


@cache
def _joint(names: str, field: str) -> Template:
    """Return the template of a JointState with these names (lines) and one value in `field`."""
    return Template(templates.joint_state(names.split("\n"), (field,)))
