"""CDR bytes of the inputs, written and read, and of small topics that need no snapshot.

A message that is malformed, or has an invalid stamp, is refused in one sentence.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rope_twin.errors import InputError, did_you_mean
from rope_twin.messages import templates
from rope_twin.messages.cdr import Template, decode, new, serialise
from rope_twin.messages.templates import NANOSECONDS, xyz
from rope_twin.quantity import or_nan, or_none
from rope_twin.scene.schema import WINCH
from rope_twin.scene.winch import SWITCHES
from rope_twin.topics import (
    CUT_TOPIC,
    LOWER_END,
    MEASURED_DEPTH,
    MOTOR_TENSION,
    ORDER_TOPICS,
    SWITCH_TOPIC,
    WINCH_MEASURED,
)
from rope_twin.twin.motion.ship_motion import ShipPose, Vector3, orientation_fault
from rope_twin.twin.readings import MOTOR, PAYLOAD, WINCH_SENSORS, Measurement
from rope_twin.twin.snapshot import DEPTH, LENGTH, SPEED, TENSION
from rope_twin.twin.winch.commands import COMMANDER_EVENTS, EMERGENCY_STOP, WinchCommand

RECORD_FRAME = "sea"  # frame of the sea records in bags/, which readers ignore
_COLUMNS = "position", "velocity", "effort"  # of a JointState: line out, line speed, tension
ORDER_FIELDS = {SPEED: "velocity", LENGTH: "position", DEPTH: "position", TENSION: "effort"}


def encode_heave(
    stamp_ns: int, position_m: float, velocity_m_per_s: float, recorded: bool = False
) -> bytes:
    """Return a ship/heave message: heave of the hang-off above its rest position and rate, up
    positive.

    recorded: for a sea record, in RECORD_FRAME and with unknown (zero) covariance.
    """
    template = _odometry("map", "hang_off", templates.HEAVE)
    if recorded:
        template = _odometry(RECORD_FRAME, "hang_off", None)
    heave, rate = (0.0, 0.0, position_m), (0.0, 0.0, velocity_m_per_s)
    motion = {"pose.pose.position": heave, "twist.twist.linear": rate}
    return template.fill({**templates.stamp(stamp_ns), **motion})


def encode_lower_end(
    stamp_ns: int, position_m: Sequence[float], velocity_m_per_s: Sequence[float]
) -> bytes:
    """Return a lower_end/odometry message: motion of the rope's lower end, in map."""
    motion = {"pose.pose.position": position_m, "twist.twist.linear": velocity_m_per_s}
    return _odometry("map", "lower_end").fill({**templates.stamp(stamp_ns), **motion})


def encode_pose(stamp_ns: int, pose: ShipPose) -> bytes:
    """Return a ship/odometry message: pose of the reference point relative to its rest position."""
    return _odometry("ship_mean", "ship").fill(
        {
            **templates.stamp(stamp_ns),
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
    return _elevation(recorded).fill(
        {**templates.stamp(stamp_ns), "point": (0.0, 0.0, elevation_m)}
    )


def encode_order(stamp_ns: int, order: WinchCommand, winch: str = "winch") -> tuple[str, bytes]:
    """Return topic and message of a winch command; a stamp of 0 means apply immediately.

    Length and depth are positions, a speed a velocity, a tension an effort, a switch a second name.
    """
    topic = ORDER_TOPICS.get(order.kind, SWITCH_TOPIC)
    values: dict[str, Any] = dict(templates.stamp(stamp_ns))
    if topic == SWITCH_TOPIC:
        return topic, _joints((winch, order.kind), ()).fill(values)
    field = ORDER_FIELDS[order.kind]
    return topic, _joints((winch,), (field,)).fill({**values, field: (order.value,)})


def encode_cut(stamp_ns: int, below_m: float, rope: str = "") -> tuple[str, bytes]:
    """Return topic and message of a cut below the upper end; a stamp of 0 means immediately."""
    values = {**templates.stamp(stamp_ns), "position": (below_m,)}
    return CUT_TOPIC, _joints((rope or "rope",), ("position",)).fill(values)


def encode_measurement(stamp_ns: int, measurement: Measurement) -> tuple[str, bytes]:
    """Return topic and message of a measurement, with NaN for what was not measured.

    stamp_ns: ROS time; that of the measurement itself is not used.
    """
    rows, stamp = measurement.rows, templates.stamp(stamp_ns)
    if measurement.source == PAYLOAD:
        depth_m = or_nan(rows[0][1])
        return MEASURED_DEPTH, _elevation(False).fill({**stamp, "point": (0.0, 0.0, -depth_m)})
    names = tuple(row[0] or WINCH for row in rows)
    columns = {name: [or_nan(row[1:][k]) for row in rows] for k, name in enumerate(_COLUMNS)}
    if measurement.source == MOTOR:
        effort = {"effort": columns["effort"]}
        return MOTOR_TENSION, _joints(names, ("effort",)).fill({**stamp, **effort})
    return WINCH_MEASURED, _joints(names, _COLUMNS).fill({**stamp, **columns})


def encode_current(rows: Sequence[Sequence[float]]) -> bytes:
    """Return a `current` message: rows of z [m], east, north (, up) [m/s], from the surface
    down.
    """
    numbers = [float(number) for row in rows for number in row]
    columns = len(rows[0])
    sizes = (("row", len(rows), len(numbers)), ("column", columns, columns))
    layout = new(
        "std_msgs/msg/MultiArrayLayout",
        dim=[
            new("std_msgs/msg/MultiArrayDimension", label=label, size=size, stride=stride)
            for label, size, stride in sizes
        ],
    )
    data = np.array(numbers)
    return serialise(new("std_msgs/msg/Float64MultiArray", layout=layout, data=data))


def encode_epoch(epoch_ns: int) -> bytes:
    """Return a twin/epoch message: ROS time of t = 0."""
    return serialise(templates.time(epoch_ns))


@cache
def _odometry(
    frame: str, child_frame: str, known_axes: Sequence[int] | None = range(6)
) -> Template:
    return Template(templates.odometry(frame, child_frame, known_axes))


@cache
def _elevation(recorded: bool) -> Template:
    header = templates.header(RECORD_FRAME if recorded else "map")
    return Template(new("geometry_msgs/msg/PointStamped", header=header))


@cache
def _joints(names: tuple[str, ...], fields: tuple[str, ...]) -> Template:
    """Return the template of a JointState with a value for each name in these fields."""
    return Template(templates.joint_state(names, fields))


def read_measurement(topic: str, data: bytes) -> Measurement:
    """Return the measurement in a message of one of MEASURED_TOPICS, with its ROS stamp [ns].

    Raises:
        InputError: if the bytes are not such a message, its stamp is invalid, or it does not carry
            a value for each name.
    """
    message, stamp_ns = _stamped(topic, data)
    if topic == MEASURED_DEPTH:
        return Measurement(PAYLOAD, stamp_ns, (("", or_none(-message.point.z), None, None),))
    names = _names(topic, message) or [""]
    fields = ("effort",) if topic == MOTOR_TENSION else _COLUMNS
    columns: list[list[float | None]] = []
    for field in _COLUMNS:
        values = getattr(message, field) if field in fields else ()
        if len(values) not in (0, len(names)):
            problem = f"{len(values)} values of {field} for {len(names)} winches"
            remedy = "give one for each name, NaN where nothing is measured, or none"
            raise InputError(topic, problem, remedy)
        columns.append([or_none(float(value)) for value in values] or [None] * len(names))
    if len(names) > MAX_WINCHES or len(set(names)) < len(names):
        problem = f"{len(names)} names"
        raise InputError(topic, problem, f"give each winch once, {MAX_WINCHES} at most")
    source = MOTOR if topic == MOTOR_TENSION else WINCH_SENSORS
    return Measurement(source, stamp_ns, tuple(zip(names, *columns, strict=True)))


MAX_WINCHES, LONGEST_NAME = 100, 256  # in one message


def _names(topic: str, message: Any) -> list[str]:
    """Return the names in a message.

    Raises:
        InputError: one is too long: sentences about it are published and recorded again and again.
    """
    names = [str(name) for name in message.name]
    if (longest := max(map(len, names), default=0)) > LONGEST_NAME:
        raise InputError(topic, f"a name of {longest} characters", f"give {LONGEST_NAME} at most")
    return names


def read_heave(data: bytes) -> tuple[int, tuple[float, float]]:
    """Return ROS stamp [ns], heave [m] and heave rate [m/s] of a ship/heave message.

    Its orientation moves nothing, but a sender that leaves it at zero has filled in no message.

    Raises:
        InputError: if the bytes are not such a message, or its stamp or orientation is invalid.
    """
    message, stamp_ns = _stamped("ship/heave", data)
    turn = message.pose.pose.orientation
    if reason := orientation_fault((*xyz(turn), turn.w)):
        raise InputError("ship/heave", *reason)
    return stamp_ns, (message.pose.pose.position.z, message.twist.twist.linear.z)


def read_pose(data: bytes) -> tuple[int, ShipPose]:
    """Return the ROS stamp [ns] of a ship/odometry message, and its pose, stamped with 0.

    Raises:
        InputError: if the bytes are not such a message, or its stamp is invalid.
    """
    message, stamp_ns = _stamped("ship/odometry", data)
    pose, twist = message.pose.pose, message.twist.twist
    turn = (*xyz(pose.orientation), pose.orientation.w)
    velocity, rate = xyz(twist.linear), xyz(twist.angular)
    return stamp_ns, ShipPose(0, xyz(pose.position), velocity, turn, rate)


def read_lower_end(data: bytes) -> tuple[int, Vector3, Vector3]:
    """Return ROS stamp [ns], position [m] and velocity [m/s] of a lower_end/odometry message.

    Raises:
        InputError: if the bytes are not such a message, or its stamp is invalid.
    """
    message, stamp_ns = _stamped(LOWER_END, data)
    return stamp_ns, xyz(message.pose.pose.position), xyz(message.twist.twist.linear)


def read_order(topic: str, data: bytes) -> tuple[int | None, WinchCommand, str]:
    """Return ROS stamp [ns] (None: apply immediately), command and winch of a winch message.

    Raises:
        InputError: if the bytes are not such a message, its stamp is invalid, or it does not carry
            exactly one value (or switch) of the topic's kind.
    """
    message = decode(topic, data)
    names = _names(topic, message)
    if topic == SWITCH_TOPIC and names[1:] == [EMERGENCY_STOP]:
        # never rejected for its stamp: an invalid one is replaced by a past time, and is flagged
        stamp = message.header.stamp
        stamp_ns = _stamp_ns(topic, stamp) if 0 <= stamp.nanosec < NANOSECONDS else 1
    else:
        stamp_ns = _stamp_ns(topic, message.header.stamp)
    winch = names[0] if names else WINCH
    if topic == SWITCH_TOPIC:
        if len(names) != 2:
            remedy = f"give two: the winch's, and one of {', '.join(SWITCHES)}"
            raise InputError(topic, f"{len(names)} names", remedy)
        if names[1] in COMMANDER_EVENTS:  # internal commands, not allowed in a message
            remedy = did_you_mean(names[1], SWITCHES)
            raise InputError(topic, f"'{names[1]}' is not a switch", remedy)
        return stamp_ns or None, WinchCommand(names[1]), winch
    kind = next(kind for kind, topic_name in ORDER_TOPICS.items() if topic_name == topic)
    values = getattr(message, ORDER_FIELDS[kind])
    if len(values) != 1:
        plural, remedy = _VALUES[kind]
        raise InputError(topic, f"{len(values)} {plural}", remedy)
    return stamp_ns or None, WinchCommand(kind, float(values[0])), winch


_VALUES = {  # name of the value in the plural, and its meaning
    SPEED: ("velocities", "there must be exactly one, the pay-out rate"),
    LENGTH: ("positions", "there must be exactly one, the line out to stop at"),
    DEPTH: ("positions", "there must be exactly one, the payload's depth to stop at"),
    TENSION: ("efforts", "there must be exactly one, the tension set-point"),
}


def read_cut(data: bytes) -> tuple[int | None, float, str]:
    """Return ROS stamp [ns] (None: at once), length above the cut [m] and rope of a ropes/cut.

    Raises:
        InputError: if the bytes are not such a message, its stamp is invalid, or it does not carry
            exactly one position.
    """
    message, stamp_ns = _stamped(CUT_TOPIC, data)
    names = _names(CUT_TOPIC, message)
    if len(message.position) != 1:
        remedy = "there must be exactly one, the length of rope between hang-off and cut"
        raise InputError(CUT_TOPIC, f"{len(message.position)} positions", remedy)
    rope = next(iter(names), "")
    return stamp_ns or None, float(message.position[0]), rope


def read_current(data: bytes) -> NDArray[np.float64]:
    """Return the rows of z [m], east, north and, if it has one, up [m/s] of a `current` message.

    They are (k, 3), or (k, 4) where the layout says so; numbers without a layout are rows of 3.

    Raises:
        InputError: if the bytes are not such a message or its layout is not k rows of 3 or 4.
    """
    message = decode("current", data)
    numbers = np.asarray(message.data, dtype=np.float64)
    sizes = [int(dimension.size) for dimension in message.layout.dim]
    offset = int(message.layout.data_offset)
    columns = 4 if len(sizes) == 2 and sizes[1] == 4 else 3
    is_valid = len(numbers) > 0 and len(numbers) % columns == 0 and offset == 0
    if sizes and is_valid:
        rows = len(numbers) // columns
        is_valid = sizes in ([rows, columns], [len(numbers)]) and math.prod(sizes) == len(numbers)
    if not is_valid:
        raise InputError(
            "current",
            f"{len(numbers)} numbers with a layout of {sizes or 'no'} dimensions "
            f"and offset {offset}",
            "it must be rows of z, east, north: sizes [k, 3] (or none), or with a vertical "
            "component [k, 4]; offset 0",
        )
    return numbers.reshape(-1, columns)


def _stamped(topic: str, data: bytes) -> tuple[Any, int]:
    """Return a message and its ROS stamp [ns]. Raises InputError."""
    message = decode(topic, data)
    return message, _stamp_ns(topic, message.header.stamp)


def _stamp_ns(topic: str, stamp: Any) -> int:
    if not 0 <= stamp.nanosec < NANOSECONDS:
        raise InputError(topic, f"a stamp with {stamp.nanosec} ns", "they must be below 1000000000")
    return templates.nanoseconds(stamp)
