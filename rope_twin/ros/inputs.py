"""From input bytes to numbers: what is no proper message is refused here, with one sentence.

Whether the numbers make sense is the twin's own judgement (`Twin.offer_*`).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rope_twin.errors import InputError, phrase
from rope_twin.messages import decode
from rope_twin.messages.forms import NANOSECONDS
from rope_twin.messages.inputs import ORDER_FIELDS
from rope_twin.scene.rigging import WINCH
from rope_twin.scene.winch import SWITCHES
from rope_twin.topics import CUT_TOPIC, ORDER_TOPICS, SWITCH_TOPIC
from rope_twin.twin.hoisting.orders import DEPTH, LENGTH, SPEED, TENSION, Order
from rope_twin.twin.motion.ship_pose import ShipPose


def read_heave(data: bytes) -> tuple[int, float, float]:
    """ROS stamp [ns], heave [m] and its rate [m/s] of a ship/heave message.

    Raises:
        InputError: if the bytes are no such message, or its stamp is no time.
    """
    message = decode("ship/heave", data)
    stamp_ns = _stamp_ns("ship/heave", message.header.stamp)
    return stamp_ns, message.pose.pose.position.z, message.twist.twist.linear.z


def read_pose(data: bytes) -> tuple[int, ShipPose]:
    """ROS stamp [ns] of a ship/odometry message, and its pose, stamped with 0.

    Raises:
        InputError: if the bytes are no such message, or its stamp is no time.
    """
    message = decode("ship/odometry", data)
    stamp_ns = _stamp_ns("ship/odometry", message.header.stamp)
    place, turn = message.pose.pose.position, message.pose.pose.orientation
    speed, rate = message.twist.twist.linear, message.twist.twist.angular
    return stamp_ns, ShipPose(
        0,
        (place.x, place.y, place.z),
        (speed.x, speed.y, speed.z),
        (turn.x, turn.y, turn.z, turn.w),
        (rate.x, rate.y, rate.z),
    )


def read_order(topic: str, data: bytes) -> tuple[int | None, Order, str]:
    """ROS stamp [ns] (None: at once), order and name of the winch of a message on its topics.

    Raises:
        InputError: if the bytes are no such message, its stamp is no time, or it does not carry
            exactly the one value, or switch, that the topic is for.
    """
    message = decode(topic, data)
    stamp_ns = _stamp_ns(topic, message.header.stamp)
    names = [str(name) for name in message.name]
    winch = names[0] if names else WINCH
    if topic == SWITCH_TOPIC:
        if len(names) != 2:
            right = f"give two: the winch's, and one of {', '.join(SWITCHES)}"
            raise InputError(phrase(topic, f"{len(names)} names", right))
        return stamp_ns or None, Order(names[1]), winch
    kind = next(kind for kind, own in ORDER_TOPICS.items() if own == topic)
    values = getattr(message, ORDER_FIELDS[kind])
    if len(values) != 1:
        plural, right = _VALUES[kind]
        raise InputError(phrase(topic, f"{len(values)} {plural}", right))
    return stamp_ns or None, Order(kind, float(values[0])), winch


_VALUES = {  # what the one value is called in the plural, and what it is
    SPEED: ("velocities", "there must be exactly one, the winch's, + pays out"),
    LENGTH: ("positions", "there must be exactly one, the line out to stop at"),
    DEPTH: ("positions", "there must be exactly one, the payload's depth to stop at"),
    TENSION: ("efforts", "there must be exactly one, the tension to keep"),
}


def read_cut(data: bytes) -> tuple[int | None, float, str]:
    """ROS stamp [ns] (None: at once), place below the upper end [m] and rope of a rope/cut message.

    Raises:
        InputError: if the bytes are no such message, its stamp is no time, or it does not carry
            exactly one position.
    """
    message = decode(CUT_TOPIC, data)
    stamp_ns = _stamp_ns(CUT_TOPIC, message.header.stamp)
    if len(message.position) != 1:
        right = "there must be exactly one, the rope between hang-off and cut"
        raise InputError(phrase(CUT_TOPIC, f"{len(message.position)} positions", right))
    rope = str(message.name[0]) if len(message.name) else ""
    return stamp_ns or None, float(message.position[0]), rope


def read_current(data: bytes) -> NDArray[np.float64]:
    """Rows (k, 3) of z [m], east and north [m/s] of a `current` message.

    Raises:
        InputError: if the bytes are no such message or its layout is not k rows of 3.
    """
    message = decode("current", data)
    numbers = np.asarray(message.data, dtype=np.float64)
    sizes = [int(dimension.size) for dimension in message.layout.dim]
    offset = int(message.layout.data_offset)
    fits = len(numbers) > 0 and len(numbers) % 3 == 0 and offset == 0
    if sizes and fits:
        rows = len(numbers) // 3
        fits = sizes in ([rows, 3], [len(numbers)]) and math.prod(sizes) == len(numbers)
    if not fits:
        raise InputError(
            phrase(
                "current",
                f"{len(numbers)} numbers with a layout of {sizes or 'no'} dimensions "
                f"and offset {offset}",
                "it must be rows of z, east, north: sizes [k, 3] (or none), offset 0",
            )
        )
    return numbers.reshape(-1, 3)


def _stamp_ns(topic: str, stamp: Any) -> int:
    if not 0 <= stamp.nanosec < NANOSECONDS:
        raise InputError(
            phrase(topic, f"a stamp with {stamp.nanosec} ns", "they must be below 1000000000")
        )
    return int(stamp.sec) * NANOSECONDS + int(stamp.nanosec)
