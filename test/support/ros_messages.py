"""Valid and invalid messages for the twin, as CDR bytes."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from rope_twin.messages import encode_heave, encode_order
from rope_twin.messages.cdr import new, serialise
from rope_twin.twin.snapshot import SPEED
from rope_twin.twin.winch.commands import WinchCommand

NAN, INF = math.nan, math.inf
S = 1_000_000_000


def joint(velocity: list[float], sec: int = 3, nanosec: int = 5) -> bytes:
    """Encode a winch/speed_command with any number of velocities and any stamp."""
    stamp = new("builtin_interfaces/msg/Time", sec=sec, nanosec=nanosec)
    empty = np.zeros(0)
    return serialise(
        new(
            "sensor_msgs/msg/JointState",
            header=new("std_msgs/msg/Header", stamp=stamp, frame_id=""),
            name=["winch"] * len(velocity),
            position=empty,
            velocity=np.array(velocity),
            effort=empty,
        )
    )


def encode_speed(stamp_ns: int, speed_m_per_s: float) -> bytes:
    """Encode a winch/speed_command; a stamp of 0 means at once."""
    return encode_order(stamp_ns, WinchCommand(SPEED, speed_m_per_s))[1]


def multi_array(numbers: list[float], sizes: list[int] | None = None, offset: int = 0) -> bytes:
    """Encode a Float64MultiArray with any layout."""
    dims = [
        new("std_msgs/msg/MultiArrayDimension", label="", size=size, stride=0)
        for size in sizes or []
    ]
    layout = new("std_msgs/msg/MultiArrayLayout", dim=dims, data_offset=offset)
    return serialise(
        new("std_msgs/msg/Float64MultiArray", layout=layout, data=np.array(numbers, dtype=float))
    )


def with_bad_nanoseconds(data: bytes) -> bytes:
    """Return the message with 4e9 ns in its stamp (bytes 8 to 11, after encapsulation and sec)."""
    return data[:8] + (4_000_000_000).to_bytes(4, "little") + data[12:]


# Each takes the ROS time a moment ahead of now [ns] and gives the bytes to send.
Bad = Callable[[int], bytes]

BAD_HEAVE: dict[str, Bad] = {
    "position not a number": lambda t: encode_heave(t, NAN, 0.0),
    "position infinite": lambda t: encode_heave(t, INF, 0.0),
    "velocity not a number": lambda t: encode_heave(t, 0.0, NAN),
    "velocity minus infinite": lambda t: encode_heave(t, 0.0, -INF),
    "a kilometre up": lambda t: encode_heave(t, 1000.0, 0.0),
    "faster than any ship": lambda t: encode_heave(t, 0.0, 100.0),
    "a day old": lambda t: encode_heave(t - 86400 * S, 0.0, 0.0),
    "a day ahead": lambda t: encode_heave(t + 86400 * S, 0.0, 0.0),
    "without a stamp": lambda t: encode_heave(0, 0.0, 0.0),
    "before 1970": lambda t: encode_heave(-5 * S, 0.0, 0.0),
    "nanoseconds that are no fraction": lambda t: with_bad_nanoseconds(encode_heave(t, 0.0, 0.0)),
    "cut off": lambda t: encode_heave(t, 0.0, 0.0)[:40],
    "one byte": lambda t: b"\x00",
    "noise": lambda t: bytes(range(256)),
    "another type's bytes": lambda t: multi_array([1.0, 2.0, 3.0]),
}
BAD_SPEED: dict[str, Bad] = {
    "no velocity": lambda t: joint([]),
    "two velocities": lambda t: joint([0.1, 0.2]),
    "not a number": lambda t: encode_speed(t, NAN),
    "infinite": lambda t: encode_speed(t, INF),
    "a thousand metres a second": lambda t: encode_speed(t, 1000.0),
    "a day old": lambda t: encode_speed(t - 86400 * S, 0.1),
    "a day ahead": lambda t: encode_speed(t + 86400 * S, 0.1),
    "nanoseconds that are no fraction": lambda t: with_bad_nanoseconds(encode_speed(t, 0.1)),
    "cut off": lambda t: encode_speed(t, 0.1)[:30],
}
BAD_CURRENT: dict[str, Bad] = {
    "empty": lambda t: multi_array([]),
    "four numbers": lambda t: multi_array([0.0, 0.1, 0.0, -10.0]),
    "a layout that does not fit": lambda t: multi_array([0.0] * 6, [3, 2]),
    "an offset": lambda t: multi_array([0.0, 0.1, 0.0], [1, 3], offset=1),
    "not a number": lambda t: multi_array([0.0, NAN, 0.0]),
    "infinite depth": lambda t: multi_array([0.0, 0.1, 0.0, -INF, 0.1, 0.0]),
    "from the bottom up": lambda t: multi_array([-100.0, 0.1, 0.0, 0.0, 0.1, 0.0]),
    "above the water": lambda t: multi_array([50.0, 0.1, 0.0]),
    "a hundred metres a second": lambda t: multi_array([0.0, 100.0, 0.0]),
    "rows a subnormal apart": lambda t: multi_array([0.0, 0.1, 0.0, -1e-308, 9.0, 0.0]),
    "a step of the profile": lambda t: multi_array([0.0, 0.1, 0.0, -0.02, 9.0, 0.0]),
    "more rows than any meter": lambda t: multi_array(
        [x for k in range(2000) for x in (-0.1 * k, 0.1, 0.0)]
    ),
    "cut off": lambda t: multi_array([0.0, 0.1, 0.0])[:20],
}
BAD = {
    "ship/heave": BAD_HEAVE,
    "winch/speed_command": BAD_SPEED,
    "current": BAD_CURRENT,
}
