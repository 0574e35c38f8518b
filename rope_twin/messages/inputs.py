"""CDR bytes of what the twin listens to, and of the small topics that no snapshot is needed for."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np

from rope_twin.messages import forms
from rope_twin.messages.cdr import Template, new, serialise
from rope_twin.topics import CUT_TOPIC, ORDER_TOPICS, SWITCH_TOPIC
from rope_twin.twin.motion.ship_pose import ShipPose
from rope_twin.twin.winch.commands import DEPTH, LENGTH, SPEED, TENSION, WinchCommand

ORDER_FIELDS = {SPEED: "velocity", LENGTH: "position", DEPTH: "position", TENSION: "effort"}


def encode_heave(stamp_ns: int, position_m: float, velocity_m_per_s: float) -> bytes:
    """ship/heave: heave of the hang-off above its rest position and its rate, up positive."""
    return _heave().fill(
        {
            **_stamp(stamp_ns),
            "pose.pose.position": (0.0, 0.0, position_m),
            "twist.twist.linear": (0.0, 0.0, velocity_m_per_s),
        }
    )


def encode_pose(stamp_ns: int, pose: ShipPose) -> bytes:
    """ship/odometry: the pose of the ship's reference point against its rest."""
    return _pose().fill(
        {
            **_stamp(stamp_ns),
            "pose.pose.position": pose.position_m,
            "pose.pose.orientation": pose.orientation,
            "twist.twist.linear": pose.velocity_m_per_s,
            "twist.twist.angular": pose.rate_rad_per_s,
        }
    )


def encode_elevation(stamp_ns: int, elevation_m: float) -> bytes:
    """sea/elevation: the water surface at the ship above mean water level."""
    return _elevation().fill({**_stamp(stamp_ns), "point": (0.0, 0.0, elevation_m)})


def encode_order(stamp_ns: int, order: WinchCommand, winch: str = "winch") -> tuple[str, bytes]:
    """Topic and message of an order to a winch; a stamp of 0 means at once.

    Length and depth are positions, a speed a velocity, a tension an effort, a switch a second name.
    """
    topic = ORDER_TOPICS.get(order.kind, SWITCH_TOPIC)
    values: dict[str, Any] = dict(_stamp(stamp_ns))
    if topic == SWITCH_TOPIC:
        return topic, _joint(f"{winch}\n{order.kind}", "").fill(values)
    field = ORDER_FIELDS[order.kind]
    return topic, _joint(winch, field).fill({**values, field: (order.value,)})


def encode_cut(stamp_ns: int, below_m: float, rope: str = "") -> tuple[str, bytes]:
    """Topic and message of a cut so far below the upper end; a stamp of 0 means at once."""
    values = {**_stamp(stamp_ns), "position": (below_m,)}
    return CUT_TOPIC, _joint(rope or "rope", "position").fill(values)


def encode_current(rows: Sequence[Sequence[float]]) -> bytes:
    """current: rows of z [m], east, north [m/s], from the surface down."""
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
    """twin/epoch: ROS time of the twin's t = 0."""
    return serialise(forms.time(epoch_ns))


def encode_seat(words: str) -> bytes:
    """winch/seat: which node commands each winch."""
    return serialise(new("std_msgs/msg/String", data=words))


def _stamp(stamp_ns: int) -> dict[str, int]:
    sec, nanosec = forms.split(stamp_ns)
    return {"header.stamp.sec": sec, "header.stamp.nanosec": nanosec}


@cache
def _heave() -> Template:
    return Template(forms.odometry("sea", "hang_off"))


@cache
def _pose() -> Template:
    return Template(forms.odometry("ship_at_rest", "ship"))


@cache
def _elevation() -> Template:
    return Template(forms.point_stamped("sea"))


@cache
def _joint(names: str, field: str) -> Template:
    """Of joints with these names, a line each, and room for one value in the field, if any."""
    return Template(forms.joint_state(names.split("\n"), (field,)))
