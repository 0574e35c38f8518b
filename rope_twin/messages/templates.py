"""Message objects with zero values: all fixed fields of the topics.

The frame is `sea` (REP 103: east, north, up). Covariances are zero, which by ROS convention means
unknown, not exact. Orientations are the identity except for a 6-DOF payload, whose twist is in body
axes (those of the child frame); elsewhere the axes of `hang_off` and `payload` are those of `sea`,
and twists need no rotation.

Frame `sea` (REP 103: east, north, up). Covariances stay zero, which by the convention of ROS means
unknown, not exact. Orientations are the identity but for a payload that is a rigid body, whose
twist is in its own axes (the child frame's); elsewhere the axes of `hang_off` and `payload` are
those of `sea` and twists need no turning.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rope_twin.messages.cdr import new

NANOSECONDS = 1_000_000_000
FLOAT32_BYTES = 4
MARKER_LIFETIME_S = 1  # markers of a rope that is not published disappear
_FLOAT32 = 7  # sensor_msgs/PointField.FLOAT32
_CUBE, _SPHERE, _LINE_LIST, _TEXT = 1, 2, 5, 9  # visualization_msgs/Marker.type
PAYLOAD_RGB = (0.95, 0.60, 0.20)
HANG_OFF_RGB = (0.90, 0.90, 0.90)


def split(time_ns: int) -> tuple[int, int]:
    """Return seconds and nanoseconds of a ROS time."""
    return divmod(time_ns, NANOSECONDS)


def time(time_ns: int = 0) -> Any:
    sec, nanosec = split(time_ns)
    return new("builtin_interfaces/msg/Time", sec=sec, nanosec=nanosec)


def header(frame_id: str) -> Any:
    return new("std_msgs/msg/Header", stamp=time(), frame_id=frame_id)


def point() -> Any:
    return new("geometry_msgs/msg/Point", x=0.0, y=0.0, z=0.0)


def vector() -> Any:
    return new("geometry_msgs/msg/Vector3", x=0.0, y=0.0, z=0.0)


def colour(rgb: tuple[float, float, float] = (0.0, 0.0, 0.0), alpha: float = 1.0) -> Any:
    red, green, blue = rgb
    return new("std_msgs/msg/ColorRGBA", r=red, g=green, b=blue, a=alpha)


def pose() -> Any:
    """Return a pose at the origin with identity orientation (w = 1)."""
    turn = new("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.0, w=1.0)
    return new("geometry_msgs/msg/Pose", position=point(), orientation=turn)


def number() -> Any:
    return new("std_msgs/msg/Float64", data=0.0)


def point_stamped(frame_id: str) -> Any:
    return new("geometry_msgs/msg/PointStamped", header=header(frame_id), point=point())


def wrench(frame_id: str) -> Any:
    forces = new("geometry_msgs/msg/Wrench", force=vector(), torque=vector())
    return new("geometry_msgs/msg/WrenchStamped", header=header(frame_id), wrench=forces)


def odometry(frame_id: str, child_frame_id: str) -> Any:
    twist = new("geometry_msgs/msg/Twist", linear=vector(), angular=vector())
    return new(
        "nav_msgs/msg/Odometry",
        header=header(frame_id),
        child_frame_id=child_frame_id,
        pose=new("geometry_msgs/msg/PoseWithCovariance", pose=pose(), covariance=np.zeros(36)),
        twist=new("geometry_msgs/msg/TwistWithCovariance", twist=twist, covariance=np.zeros(36)),
    )


def joint_state(names: Sequence[str], fields: Collection[str]) -> Any:
    """Return joints of these names with a value each in these of position, velocity and effort."""
    sizes = {name: len(names) * (name in fields) for name in ("position", "velocity", "effort")}
    numbers = {name: np.zeros(size) for name, size in sizes.items()}
    return new("sensor_msgs/msg/JointState", header=header(""), name=list(names), **numbers)


def rigging_names(legs: int, decks: int) -> list[str]:
    """Return the joint names of the slings, the deck (if any), the outline and the sling ends."""
    names = [f"sling_{number}" for number in range(1, legs + 1)] + ["deck"] * decks
    names += [f"size/{axis}" for axis in "xyz"]
    return names + [f"sling_{number}/{axis}" for number in range(1, legs + 1) for axis in "xyz"]


def row_of_numbers(label: str, count: int) -> Any:
    dimension = new("std_msgs/msg/MultiArrayDimension", label=label, size=count, stride=count)
    layout = new("std_msgs/msg/MultiArrayLayout", dim=[dimension], data_offset=0)
    return new("std_msgs/msg/Float64MultiArray", layout=layout, data=np.zeros(count))


def table_of_numbers(label: str, count: int, columns: tuple[str, ...]) -> Any:
    """Return an array of rows; the column names are the label of its second dimension."""
    wide = len(columns)
    rows = new("std_msgs/msg/MultiArrayDimension", label=label, size=count, stride=count * wide)
    names = " ".join(columns)
    across = new("std_msgs/msg/MultiArrayDimension", label=names, size=wide, stride=wide)
    layout = new("std_msgs/msg/MultiArrayLayout", dim=[rows, across], data_offset=0)
    return new("std_msgs/msg/Float64MultiArray", layout=layout, data=np.zeros(count * wide))


def point_cloud(frame_id: str, count: int) -> Any:
    return cloud(frame_id, count, ("x", "y", "z", "tension"))


def ropes_cloud(frame_id: str, count: int) -> Any:
    return cloud(frame_id, count, ("x", "y", "z", "tension", "rope"))


def cloud(frame_id: str, count: int, names: tuple[str, ...]) -> Any:
    """Return a cloud of `count` points with these float32 fields."""
    fields = [
        new(
            "sensor_msgs/msg/PointField",
            name=name,
            offset=FLOAT32_BYTES * k,
            datatype=_FLOAT32,
            count=1,
        )
        for k, name in enumerate(names)
    ]
    size = FLOAT32_BYTES * len(names)
    return new(
        "sensor_msgs/msg/PointCloud2",
        header=header(frame_id),
        height=1,
        width=count,
        fields=fields,
        is_bigendian=False,
        point_step=size,
        row_step=size * count,
        data=np.zeros(size * count, dtype=np.uint8),
        is_dense=True,
    )


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
    rope.points = [point() for _ in range(2 * elements)]
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
    if bars:
        markers.append(_marker(frame_id, "bars", _LINE_LIST, colour(HANG_OFF_RGB)))
        markers[-1].points = [point() for _ in range(2 * bars)]
    if slings:
        markers.append(_marker(frame_id, "slings", _LINE_LIST, colour(HANG_OFF_RGB)))
        markers[-1].points = [point() for _ in range(2 * slings)]
    return new("visualization_msgs/msg/MarkerArray", markers=markers)


def _marker(frame_id: str, namespace: str, kind: int, rgba: Any) -> Any:
    lifetime = new("builtin_interfaces/msg/Duration", sec=MARKER_LIFETIME_S, nanosec=0)
    no_texture = new("sensor_msgs/msg/CompressedImage", header=header(""), format="",
                     data=np.zeros(0, dtype=np.uint8))  # fmt: skip
    no_mesh = new("visualization_msgs/msg/MeshFile", filename="", data=np.zeros(0, dtype=np.uint8))
    return new(
        "visualization_msgs/msg/Marker",
        header=header(frame_id),
        ns=namespace,
        id=0,
        type=kind,
        action=0,
        pose=pose(),
        scale=vector(),
        color=rgba,
        lifetime=lifetime,
        frame_locked=False,
        points=[],
        colors=[],
        texture_resource="",
        texture=no_texture,
        uv_coordinates=[],
        text="",
        mesh_resource="",
        mesh_file=no_mesh,
        mesh_use_embedded_materials=False,
    )


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
    wanted = max(1.1 * peak_n, 10.0 * SLACK_BELOW_N)
    if not math.isfinite(wanted):
        raise ValueError(f"no colour scale reaches {peak_n} N")
    decade = 10.0 ** math.floor(math.log10(wanted))
    return next(step * decade for step in (*_ROUND, 100.0) if step * decade >= wanted)
