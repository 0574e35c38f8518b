"""Message objects with zero values: all fixed fields of the topics, and the colours of tension.

The fixed frame is `map` (REP 105; axes east, north, up, REP 103). Orientations are the identity
except for a 6-DOF payload, whose twist is in body axes; elsewhere the axes of `hang_off` and the
payloads are those of `map`, and twists need no rotation.

Tables are PointCloud2 messages with a named field for each column. Markers of ropes and payloads
are for display: lines coloured by tension, symbols, text.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Collection, Sequence
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rope_twin.errors import InputError
from rope_twin.messages.cdr import HEADER_BYTES, Template, Templates, decode, new
from rope_twin.twin.snapshot import BodySnapshot, Snapshot

Columns = tuple[tuple[str, str], ...]  # name and type of each column of a table
NANOSECONDS = 1_000_000_000
KNOWN_VARIANCE = 1e-6  # [m², rad², m²/s², rad²/s²] standard deviation of 0.001: computed
UNKNOWN_VARIANCE = 1e6  # of axes that a message does not state, as robot_localization expects
HEAVE = (2,)  # axes of a heave message
NAME_TYPE = "S32"  # of a column with names: UTF-8, zeros at the end
MARKER_LIFETIME_S = 1  # markers of a rope that is not published disappear
_STAMP_BYTES = 8  # the first field of every header
_UINT8 = 2  # sensor_msgs/PointField.UINT8
_FIELD_TYPES = {np.dtype("<f4"): 7, np.dtype("<f8"): 8}  # FLOAT32, FLOAT64
_CUBE, _SPHERE, _LINE_LIST, _TEXT = 1, 2, 5, 9  # visualization_msgs/Marker.type
_POINT = "geometry_msgs/msg/Point"
PAYLOAD_RGB = (0.95, 0.60, 0.20)
HANG_OFF_RGB = (0.90, 0.90, 0.90)
# Marker sizes: a 40 mm rope on 3,000 m cannot be seen, so symbols grow with the line out.
_LINE_WIDTH, _SYMBOL_SIZE, _TEXT_HEIGHT = 1 / 1000, 1 / 100, 1 / 100
_MIN_LINE_M = 100.0


def stamp(time_ns: int, path: str = "header.stamp") -> dict[str, int]:
    """Return the values of a template's stamp at a path."""
    sec, nanosec = divmod(time_ns, NANOSECONDS)
    return {f"{path}.sec": sec, f"{path}.nanosec": nanosec}


def time(time_ns: int) -> Any:
    sec, nanosec = divmod(time_ns, NANOSECONDS)
    return new("builtin_interfaces/msg/Time", sec=sec, nanosec=nanosec)


def nanoseconds(time: Any) -> int:
    """Return the nanoseconds in a builtin_interfaces/Time."""
    return int(time.sec) * NANOSECONDS + int(time.nanosec)


def xyz(vector: Any) -> tuple[float, float, float]:
    """Return the numbers of a Point or Vector3, or the vector part of a Quaternion."""
    return vector.x, vector.y, vector.z


def header(frame_id: str) -> Any:
    return new("std_msgs/msg/Header", frame_id=frame_id)


def colour(rgb: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Any:
    red, green, blue = rgb
    return new("std_msgs/msg/ColorRGBA", r=red, g=green, b=blue, a=1.0)


def odometry(
    frame_id: str, child_frame_id: str, known_axes: Sequence[int] | None = range(6)
) -> Any:
    """Return an Odometry; `known_axes`: those of x, y, z, roll, pitch, yaw that the message states.

    Variances are those of a computed value, and UNKNOWN_VARIANCE in the axes that are not stated.
    None: the covariance is unknown, which is zero by the convention of ROS.
    """
    variances = np.zeros(6)
    if known_axes is not None:
        variances[:] = UNKNOWN_VARIANCE
        variances[list(known_axes)] = KNOWN_VARIANCE
    covariances = [np.diag(variances).ravel() for _ in range(2)]
    return new(
        "nav_msgs/msg/Odometry",
        header=header(frame_id),
        child_frame_id=child_frame_id,
        pose=new("geometry_msgs/msg/PoseWithCovariance", covariance=covariances[0]),
        twist=new("geometry_msgs/msg/TwistWithCovariance", covariance=covariances[1]),
    )


def joint_state(names: Sequence[str], fields: Collection[str]) -> Any:
    """Return joints of these names with a value each in these of position, velocity and effort."""
    sizes = {name: len(names) * (name in fields) for name in ("position", "velocity", "effort")}
    numbers = {name: np.zeros(size) for name, size in sizes.items()}
    return new("sensor_msgs/msg/JointState", name=list(names), **numbers)


def free_bodies(frame_id: str, names: Sequence[str]) -> Any:
    """Return a MultiDOFJointState: pose and twist of bodies of these names, without wrenches."""
    return new(
        "sensor_msgs/msg/MultiDOFJointState",
        header=header(frame_id),
        joint_names=list(names),
        transforms=[new("geometry_msgs/msg/Transform") for _ in names],
        twist=[new("geometry_msgs/msg/Twist") for _ in names],
    )


@cache
def columns(names: str, kind: str = "<f8") -> Columns:
    """Return columns of one type of number; a column `name` is text."""
    return tuple((name, NAME_TYPE if name == "name" else kind) for name in names.split())


@cache
def point_type(described: Columns) -> np.dtype[Any]:
    """Return the type of a row with these columns."""
    return np.dtype(list(described))


def cloud(frame_id: str, count: int, point: np.dtype[Any]) -> Any:
    """Return a cloud of `count` points of a structured type: a table, if it has no x, y, z.

    Text is a field of 32 values of UINT8.
    """
    fields, size = [], point.itemsize
    for name, (kind, offset, *_) in (point.fields or {}).items():
        is_text = kind.char == "S"
        datatype, values = (_UINT8, kind.itemsize) if is_text else (_FIELD_TYPES[kind], 1)
        described = {"name": name, "offset": offset, "datatype": datatype, "count": values}
        fields.append(new("sensor_msgs/msg/PointField", **described))
    return new(
        "sensor_msgs/msg/PointCloud2",
        header=header(frame_id),
        height=1,
        width=count,
        fields=fields,
        point_step=size,
        row_step=size * count,
        data=np.zeros(size * count, dtype=np.uint8),
        is_dense=True,
    )


def read_cloud(message: Any) -> NDArray[Any]:
    """Return the points of a PointCloud2 of the suite, as a structured array.

    Raises:
        InputError: its fields do not fit its data.
    """
    fields = message.fields
    numbers = {code: kind for kind, code in _FIELD_TYPES.items()}
    try:
        formats: list[Any] = [
            f"S{field.count}" if field.datatype == _UINT8 else numbers[field.datatype]
            for field in fields
        ]
        for field, kind in zip(fields, formats, strict=True):
            # numpy adds offset and size as int32, and reads anywhere once the sum has overflowed
            if field.offset + np.dtype(kind).itemsize > message.point_step:
                raise ValueError(f"'{field.name[:32]}' ends beyond its point")
        point = np.dtype(
            {
                "names": [field.name for field in fields],
                "formats": formats,
                "offsets": [field.offset for field in fields],
                "itemsize": message.point_step,
            }
        )
        return np.frombuffer(np.asarray(message.data, dtype=np.uint8).tobytes(), point)
    except (KeyError, ValueError, TypeError) as error:
        remedy = "it must be one that rope_twin publishes"
        raise InputError("point cloud", f"fields not known ({error})", remedy) from error


class CloudReader:
    """Reads the points of a topic's messages, of which it decodes the description only once.

    A description changes when rows or columns do; until then the points have the same offset.
    """

    def __init__(self, topic: str) -> None:
        """Make a reader of one of the suite's topics of type PointCloud2."""
        self._topic = topic
        self._size = 0  # of the messages [bytes]; 0: none was read
        self._description = b""
        self._points: tuple[np.dtype[Any], int, int] = (np.dtype(np.uint8), 0, 0)

    def read(self, data: bytes) -> tuple[int, NDArray[Any]]:
        """Return the stamp [ns] and the points of a message as a structured array.

        Raises:
            InputError: the bytes are no such message, or its fields do not fit its data.
        """
        kind, count, begin = self._points
        if 0 < len(data) == self._size and self._described(data, begin) == self._description:
            order = "<" if data[1] & 1 else ">"  # of the encapsulation
            sec, nanosec = struct.unpack_from(f"{order}iI", data, HEADER_BYTES)
            return sec * NANOSECONDS + nanosec, np.frombuffer(data, kind, count, begin)
        message = decode(self._topic, data)
        points = read_cloud(message)
        begin = self._begin(data, points.tobytes())
        self._points = points.dtype, len(points), begin
        self._size = len(data) if begin else 0
        self._description = self._described(data, begin)
        return nanoseconds(message.header.stamp), points

    def _described(self, data: bytes, begin: int) -> bytes:
        """Return all that precedes the points but the stamp."""
        return data[:HEADER_BYTES] + data[HEADER_BYTES + _STAMP_BYTES : begin]

    def _begin(self, data: bytes, points: bytes) -> int:
        """Return where the points begin; 0: not found, or there are none."""
        latest = len(data) - len(points) - 1  # is_dense follows, and up to 3 bytes of padding
        starts = range(latest, latest - 4, -1) if points else ()
        return next((start for start in starts if data[start : start + len(points)] == points), 0)


def rope_markers(
    frame_id: str,
    elements: int,
    scale_text: str,
    further: tuple[str, ...] = (),
    bars: int = 0,
    slings: int = 0,
) -> Any:
    """Return the markers of rope (one segment per element), payload, hang-off and scale.

    further: names of the payloads of a multi-line system; bars: number of its struts; slings:
    number of slings of a 6-DOF payload.
    """
    rope = _marker(frame_id, "rope", _LINE_LIST, colour())
    rope.points = [new(_POINT) for _ in range(2 * elements)]
    rope.colors = [colour() for _ in range(2 * elements)]
    text = _marker(frame_id, "tension_scale", _TEXT, colour(HANG_OFF_RGB))
    text.text = scale_text
    markers = [
        rope,
        _marker(frame_id, "payload", _CUBE, colour(PAYLOAD_RGB)),
        _marker(frame_id, "hang_off", _SPHERE, colour(HANG_OFF_RGB)),
        text,
    ]
    markers += [
        _marker(frame_id, f"payload {name}", _CUBE, colour(PAYLOAD_RGB)) for name in further
    ]
    for namespace, count in (("bars", bars), ("slings", slings)):
        if count:
            markers.append(_marker(frame_id, namespace, _LINE_LIST, colour(HANG_OFF_RGB)))
            markers[-1].points = [new(_POINT) for _ in range(2 * count)]
    return new("visualization_msgs/msg/MarkerArray", markers=markers)


def _marker(frame_id: str, namespace: str, kind: int, rgba: Any) -> Any:
    lifetime = new("builtin_interfaces/msg/Duration", sec=MARKER_LIFETIME_S)
    parts = {"header": header(frame_id), "color": rgba, "lifetime": lifetime}
    return new("visualization_msgs/msg/Marker", ns=namespace, type=kind, **parts)


SLACK_BELOW_N = 1.0  # an element that carries less hangs loose
SLACK_RGB = (1.0, 0.25, 0.25)  # red is nowhere in viridis
_VIRIDIS = (
    "440154", "482475", "414487", "355f8d", "2a788e", "21918c", "22a884", "44bf70", "7ad151",
    "bddf26", "fde725",
)  # fmt: skip
_TABLE = np.array([[int(row[k : k + 2], 16) / 255.0 for k in (0, 2, 4)] for row in _VIRIDIS])
_STEPS = np.linspace(0.0, 1.0, len(_TABLE))
_ROUND = (1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0)


def shade(fraction: NDArray[np.float64]) -> NDArray[np.float32]:
    """Return colours (n, 3) in 0 to 1 for fractions of the scale (n,), clipped to its ends."""
    return np.stack(
        [np.interp(fraction, _STEPS, _TABLE[:, channel]) for channel in range(3)], axis=-1
    ).astype(np.float32)


def tension_colours(tension_n: NDArray[np.float64], scale_n: float) -> NDArray[np.float32]:
    """Return colours (n, 4: r, g, b, alpha) in 0 to 1 of tensions (n,) on a scale from 0 to
    scale_n.
    """
    colours = np.ones((len(tension_n), 4), dtype=np.float32)
    colours[:, :3] = shade(tension_n / scale_n)
    colours[tension_n < SLACK_BELOW_N, :3] = SLACK_RGB
    return colours


def scale_above(peak_n: float) -> float:
    """Return the upper end of a colour scale: round, and at least 10 % above the peak tension."""
    min_n = max(1.1 * peak_n, 10.0 * SLACK_BELOW_N)
    if not math.isfinite(min_n):
        raise ValueError(f"no colour scale reaches {peak_n} N")
    decade = 10.0 ** math.floor(math.log10(min_n))
    return next(step * decade for step in (*_ROUND, 100.0) if step * decade >= min_n)


class RopeMarkers:
    """Encodes `ropes/markers`; keeps the colour scale and the template of the last number of
    elements.
    """

    def __init__(self, frame: str, stamp: Callable[[Snapshot, str], dict[str, int]]) -> None:
        """Encode in a frame; stamp: fields of a snapshot's stamp at a path of the message."""
        self._frame, self._stamp = frame, stamp
        self._sized = Templates()
        self._rope_template: tuple[int, Template, Template] | None = None
        self._scale_n = 0.0

    def encode(self, snapshot: Snapshot, ends: Any, tension: Any) -> bytes:
        """Return the message; ends: of each element, (2·elements, 3); tension: of each [N]."""
        peak_n = float(tension.max())
        if peak_n > self._scale_n:
            self._scale_n = scale_above(peak_n)
        line_m = max(snapshot.line_out_m, _MIN_LINE_M)
        values = {
            "markers.0.points": ends,
            "markers.0.colors": np.repeat(tension_colours(tension, self._scale_n), 2, axis=0),
            "markers.0.scale": (_LINE_WIDTH * line_m, 0.0, 0.0),
            **_symbols(snapshot, line_m),
        }
        last = 4 + len(snapshot.payloads)
        if snapshot.struts:
            values[f"markers.{last}.points"] = np.concatenate([s.ends_m for s in snapshot.struts])
            values[f"markers.{last}.scale"] = (2.0 * _LINE_WIDTH * line_m, 0.0, 0.0)
            last += 1
        if snapshot.body is not None:
            values |= _body_markers(snapshot.body, last, line_m)
            last += len(snapshot.body.leg_end_m) > 0
        for index in range(last):
            values |= self._stamp(snapshot, f"markers.{index}.header.stamp")
        return self._template(snapshot, len(tension)).fill(values)

    def _template(self, snapshot: Snapshot, count: int) -> Template:
        """Return the template for this number of elements, which the winch changes, stretched from
        one element.
        """
        scale_n = self._scale_n
        words = f"violet 0 kN, yellow {scale_n / 1000.0:g} kN, red slack"  # meaning of the colours
        further, bars = tuple(payload.name for payload in snapshot.payloads), len(snapshot.struts)
        slings = 0 if snapshot.body is None else len(snapshot.body.leg_end_m)
        form = self._sized.get(
            "ropes/markers of one element",
            (scale_n, further, bars, slings),
            lambda: rope_markers(self._frame, 1, words, further, bars, slings),
        )
        if self._rope_template is None or self._rope_template[:2] != (count, form):
            # the winch changes the count every second or so; a point as an object takes 30 µs
            ends_of = {"markers.0.points": 2 * count, "markers.0.colors": 2 * count}
            self._rope_template = count, form, form.stretched(ends_of)
        return self._rope_template[2]


def _symbols(snapshot: Snapshot, line_m: float) -> dict[str, Any]:
    """Return the values of payload, hang-off and text markers, scaled with the line out."""
    size = (_SYMBOL_SIZE * line_m,) * 3
    values: dict[str, Any] = {
        "markers.1.pose.position": snapshot.payload_position_m,
        "markers.1.scale": size,
        "markers.2.pose.position": snapshot.hang_off_position_m,
        "markers.2.scale": size,
        "markers.3.pose.position": snapshot.hang_off_position_m
        + np.array([0.0, 0.0, 2.0 * _SYMBOL_SIZE * line_m]),
        "markers.3.scale": (0.0, 0.0, _TEXT_HEIGHT * line_m),
    }
    for index, payload in enumerate(snapshot.payloads, start=4):
        values[f"markers.{index}.pose.position"] = payload.position_m
        values[f"markers.{index}.scale"] = size
    return values


def _body_markers(body: BodySnapshot, slings: int, line_m: float) -> dict[str, Any]:
    """Return the values of a 6-DOF payload's box, not below the symbol's size, and slings."""
    hook = np.broadcast_to(body.hook_m, body.leg_end_m.shape)
    larger = max(1.0, _SYMBOL_SIZE * line_m / float(body.size_m.max()))
    return {
        "markers.1.pose.orientation": body.quaternion,
        "markers.1.scale": larger * body.size_m,
        f"markers.{slings}.points": np.stack([hook, body.leg_end_m], axis=1).reshape(-1, 3),
        f"markers.{slings}.scale": (0.5 * _LINE_WIDTH * line_m, 0.0, 0.0),
    }
