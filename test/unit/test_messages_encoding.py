"""The bytes of every topic, against messages built as objects and against their meaning."""

from __future__ import annotations

from dataclasses import replace
from operator import attrgetter

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from rosbags.typesys import Stores, get_typestore
from sample_snapshot import hanging_rope

from rope_twin import messages
from rope_twin.errors import InputError
from rope_twin.messages import templates
from rope_twin.messages.cdr import Template, deserialise, table
from rope_twin.topics import TOPICS, Topic
from rope_twin.twin.snapshot import Snapshot
from rope_twin.twin.winch.commands import WinchCommand

STORE = get_typestore(Stores.ROS2_KILTED)
T = STORE.types
EPOCH_NS = 1_763_700_000_123_456_789
FINITE = st.floats(-1e30, 1e30)  # float32 holds them all
# node counts on both sides of every alignment: odd, even, the least, one and many
SIZES = (2, 3, 4, 5, 8, 101, 257)


def made(type_name: str, **fields: object) -> object:
    return T[type_name](**fields)


def header(snapshot: Snapshot, frame: str) -> object:
    sec, nanosec = divmod(EPOCH_NS + snapshot.stamp_ns, 10**9)
    stamp = made("builtin_interfaces/msg/Time", sec=sec, nanosec=nanosec)
    return made("std_msgs/msg/Header", stamp=stamp, frame_id=frame)


def vector(kind: str, xyz: np.ndarray) -> object:
    return made(f"geometry_msgs/msg/{kind}", x=float(xyz[0]), y=float(xyz[1]), z=float(xyz[2]))


def multi_array(snapshot: Snapshot) -> object:
    data = snapshot.element_tension_n
    n = len(data)
    dim = made("std_msgs/msg/MultiArrayDimension", label="element", size=n, stride=n)
    layout = made("std_msgs/msg/MultiArrayLayout", dim=[dim], data_offset=0)
    return made("std_msgs/msg/Float64MultiArray", layout=layout, data=data)


def point_cloud(snapshot: Snapshot) -> object:
    n = len(snapshot.node_position_m)
    rows = np.column_stack([snapshot.node_position_m, snapshot.node_tension_n]).astype("<f4")
    fields = [
        made("sensor_msgs/msg/PointField", name=name, offset=offset, datatype=7, count=1)
        for name, offset in (("x", 0), ("y", 4), ("z", 8), ("tension", 12))
    ]
    return made(
        "sensor_msgs/msg/PointCloud2", header=header(snapshot, "sea"), height=1, width=n,
        fields=fields, is_bigendian=False, point_step=16, row_step=16 * n,
        data=np.frombuffer(rows.tobytes(), dtype=np.uint8), is_dense=True,
    )  # fmt: skip


def odometry(snapshot: Snapshot) -> object:
    turn = made("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.0, w=1.0)
    position = vector("Point", snapshot.payload_position_m)
    pose = made("geometry_msgs/msg/Pose", position=position, orientation=turn)
    twist = made(
        "geometry_msgs/msg/Twist", linear=vector("Vector3", snapshot.payload_velocity_m_per_s),
        angular=vector("Vector3", np.zeros(3)),
    )  # fmt: skip
    unknown = np.zeros(36)
    return made(
        "nav_msgs/msg/Odometry", header=header(snapshot, "sea"), child_frame_id="payload",
        pose=made("geometry_msgs/msg/PoseWithCovariance", pose=pose, covariance=unknown),
        twist=made("geometry_msgs/msg/TwistWithCovariance", twist=twist, covariance=unknown),
    )  # fmt: skip


def joint_state(snapshot: Snapshot) -> object:
    return made(
        "sensor_msgs/msg/JointState", header=header(snapshot, ""), name=["winch"],
        position=np.array([snapshot.line_out_m]),
        velocity=np.array([snapshot.payout_speed_m_per_s]),
        effort=np.array([snapshot.tension_top_n]),
    )  # fmt: skip


def wrench(snapshot: Snapshot) -> object:
    force = vector("Vector3", snapshot.hang_off_force_n)
    parts = made("geometry_msgs/msg/Wrench", force=force, torque=vector("Vector3", np.zeros(3)))
    return made("geometry_msgs/msg/WrenchStamped", header=header(snapshot, "sea"), wrench=parts)


def band(snapshot: Snapshot) -> object:
    assert snapshot.band is not None
    return made(
        "sensor_msgs/msg/JointState", header=header(snapshot, ""),
        name=["tension_top_low", "tension_top_high"], position=np.zeros(0), velocity=np.zeros(0),
        effort=np.array([snapshot.band.low_n, snapshot.band.high_n]),
    )  # fmt: skip


def contact(snapshot: Snapshot) -> object:
    bed = snapshot.seabed
    assert bed is not None
    return made(
        "sensor_msgs/msg/JointState", header=header(snapshot, ""), name=["payload", "rope"],
        position=np.array([bed.payload_height_m, bed.rope_on_bed_m]), velocity=np.zeros(0),
        effort=np.array([bed.payload_push_n, bed.rope_push_n]),
    )  # fmt: skip


def fatigue(snapshot: Snapshot) -> object:
    wear = snapshot.fatigue
    assert wear is not None
    count = len(wear.used)
    dimension = "std_msgs/msg/MultiArrayDimension"
    dims = [
        made(dimension, label="metre", size=count, stride=3 * count),
        made(dimension, label="from_lower_end_m from_hang_off_m used", size=3, stride=3),
    ]
    layout = made("std_msgs/msg/MultiArrayLayout", dim=dims, data_offset=0)
    rows = zip(wear.from_lower_end_m, wear.from_hang_off_m, wear.used, strict=True)
    data = np.array([value for row in rows for value in row])
    return made("std_msgs/msg/Float64MultiArray", layout=layout, data=data)


BY_OBJECTS = {
    "rope/fatigue": fatigue,
    "seabed/contact": contact,
    "tension_top/band": band,
    "tension_top": lambda s: made("std_msgs/msg/Float64", data=s.tension_top_n),
    "tension_payload": lambda s: made("std_msgs/msg/Float64", data=s.tension_payload_n),
    "hang_off/wrench": wrench,
    "tension": multi_array,
    "payload/odometry": odometry,
    "winch/state": joint_state,
    "rope/nodes": point_cloud,
}


@st.composite
def snapshots(draw: st.DrawFn) -> Snapshot:
    nodes = draw(st.integers(2, 40))
    tension = arrays(np.float64, nodes, elements=st.floats(0.0, 1e9))
    return replace(
        hanging_rope(nodes),
        stamp_ns=draw(st.integers(0, 10**15)),
        node_position_m=draw(arrays(np.float64, (nodes, 3), elements=FINITE)),
        node_tension_n=draw(tension),
        element_tension_n=draw(tension)[1:],
        tension_top_n=draw(FINITE),
        tension_payload_n=draw(FINITE),
        hang_off_force_n=draw(arrays(np.float64, 3, elements=FINITE)),
        payload_position_m=draw(arrays(np.float64, 3, elements=FINITE)),
        payload_velocity_m_per_s=draw(arrays(np.float64, 3, elements=FINITE)),
        line_out_m=draw(FINITE),
        payout_speed_m_per_s=draw(FINITE),
    )


@pytest.mark.parametrize("topic", BY_OBJECTS)
@pytest.mark.parametrize("nodes", SIZES)
def test_bytes_equal_those_of_a_message_built_by_objects(topic: str, nodes: int) -> None:
    snapshot = hanging_rope(nodes)
    message = BY_OBJECTS[topic](snapshot)
    expected = bytes(STORE.serialize_cdr(message, message.__msgtype__, little_endian=True))
    assert messages.Encoder(EPOCH_NS).encode(topic, snapshot) == expected


@settings(max_examples=40, deadline=None)
@given(rows=st.lists(snapshots(), min_size=1, max_size=4))
def test_templates_carry_nothing_over_from_one_snapshot_to_the_next(rows: list[Snapshot]) -> None:
    encoder = messages.Encoder(EPOCH_NS)
    for snapshot in rows:
        for topic, build in BY_OBJECTS.items():
            message = build(snapshot)
            expected = bytes(STORE.serialize_cdr(message, message.__msgtype__, little_endian=True))
            assert encoder.encode(topic, snapshot) == expected, topic


@pytest.mark.parametrize("in_line", [True, False])
def test_the_cloud_of_vibration_names_what_its_model_knows(in_line: bool) -> None:
    snapshot = hanging_rope(7)
    assert snapshot.vibration is not None
    if not in_line:
        shaking = replace(snapshot.vibration, in_line=None, in_line_hz=None)
        snapshot = replace(snapshot, vibration=shaking)
    data = messages.Encoder(EPOCH_NS).encode("rope/vibration", snapshot)
    cloud = messages.decode("rope/vibration", data)
    names = ["x", "y", "z", "cross_flow", "cross_flow_hz"]
    names += ["in_line", "in_line_hz"] if in_line else []
    names += ["drag_amplification"]
    assert [field.name for field in cloud.fields] == names
    assert cloud.width * cloud.point_step == len(cloud.data) == 7 * 4 * len(names)
    points = np.frombuffer(cloud.data.tobytes(), "<f4").reshape(7, len(names))
    assert points[:, :3] == pytest.approx(snapshot.node_position_m, rel=1e-6)
    for name in names[3:]:
        known = getattr(snapshot.vibration, name)
        assert points[:, names.index(name)] == pytest.approx(known, rel=1e-6)


def test_every_topic_made_from_a_snapshot_is_encoded() -> None:
    others = {"diagnostics", "twin/epoch", "winch/seat", "twin/session", "twin/inputs"}
    wanted = {t.name for t in TOPICS if t.publisher == "simulation"} - others
    assert set(messages.Encoder(0).topics) == wanted


def test_unknown_topic_names_the_nearest() -> None:
    with pytest.raises(InputError, match="did you mean 'tension_top'"):
        messages.Encoder(0).encode("tension_tops", hanging_rope())


def test_frame_is_the_one_asked_for() -> None:
    data = messages.Encoder(0, frame_id="field/sea").encode("rope/nodes", hanging_rope())
    assert messages.decode("rope/nodes", data).header.frame_id == "field/sea"


@settings(max_examples=30, deadline=None)
@given(stamp=st.integers(0, 2**31 * 10**9 - 1), z=FINITE, rate=FINITE)
def test_inputs_come_back_as_they_went_in(stamp: int, z: float, rate: float) -> None:
    heave = messages.decode("ship/heave", messages.encode_heave(stamp, z, rate))
    assert (heave.pose.pose.position.z, heave.twist.twist.linear.z) == (z, rate)
    assert heave.pose.pose.orientation.w == 1.0
    assert (heave.header.frame_id, heave.child_frame_id) == ("sea", "hang_off")
    sea = messages.decode("sea/elevation", messages.encode_elevation(stamp, z))
    assert (sea.point.x, sea.point.y, sea.point.z) == (0.0, 0.0, z)
    speed = messages.decode(*messages.encode_order(stamp, WinchCommand("speed", rate)))
    assert (speed.name, list(speed.velocity), len(speed.position)) == (["winch"], [rate], 0)
    epoch = messages.decode("/twin/epoch", messages.encode_epoch(stamp))
    for when in (heave.header.stamp, sea.header.stamp, speed.header.stamp, epoch):
        assert when.sec * 10**9 + when.nanosec == stamp


def refusal(topic_name: str, data: bytes) -> str:
    try:
        messages.decode(topic_name, data)
    except InputError as error:
        return str(error)
    return ""


@settings(max_examples=100, deadline=None)
@given(topic=st.sampled_from(TOPICS), data=st.binary(max_size=400))
def test_bytes_that_are_no_message_get_one_sentence(topic: Topic, data: bytes) -> None:
    words = refusal(topic.name, b"\x00\x01\x00\x00" + data)
    assert not words or (topic.name in words and topic.type_name in words)


@pytest.mark.parametrize("topic", [t.name for t in TOPICS if t.publisher == "simulation"][:8])
def test_a_message_cut_short_is_refused(topic: str) -> None:
    data = messages.Encoder(EPOCH_NS).encode(topic, hanging_rope())
    for end in (0, 3, 4, len(data) // 2, len(data) - 8):
        with pytest.raises(InputError, match=topic):
            messages.decode(topic, data[:end])


def test_unknown_topic_is_not_decoded() -> None:
    with pytest.raises(InputError, match="did you mean 'rope/nodes'"):
        messages.decode("/rope/node", b"")


@pytest.mark.parametrize(("elements", "bars", "slings"), [(1, 0, 0), (2, 1, 3), (57, 0, 4)])
def test_a_stretched_form_is_that_of_the_longer_rope(elements: int, bars: int, slings: int) -> None:
    """To the byte, and with every number in the same place."""
    ends = {"markers.0.points": 2 * elements, "markers.0.colors": 2 * elements}
    one = Template(templates.rope_markers("sea", 1, "words", ("tool",), bars, slings))
    long = Template(templates.rope_markers("sea", elements, "words", ("tool",), bars, slings))
    found = one.stretched(ends)
    assert found.data == long.data
    assert found.slots == long.slots
    assert found.stretched(dict.fromkeys(ends, 2)).data == one.data


@pytest.mark.parametrize("path", ["markers.0.scale", "markers.0.pose.position"])
def test_what_is_no_list_is_not_stretched(path: str) -> None:
    form = Template(templates.rope_markers("sea", 1, "words"))
    with pytest.raises(ValueError, match="cannot have 4 entries"):
        form.stretched({path: 4})
    with pytest.raises(ValueError, match="cannot have 0 entries"):
        form.stretched({"markers.0.points": 0})


@settings(max_examples=25, deadline=None)
@given(
    st.lists(st.tuples(st.integers(0, 2**31 * 10**9 - 1), FINITE, FINITE), min_size=1, max_size=20)
)
def test_a_table_of_messages_equals_their_decoding(samples: list[tuple[int, float, float]]) -> None:
    """Numbers of their own and numbers inside a vector are read from the right bytes."""
    paths = ("header.stamp.sec", "header.stamp.nanosec", "pose.pose.position.z",
             "pose.pose.orientation.w", "twist.twist.linear.z")  # fmt: skip
    data = [messages.encode_heave(ns, z, rate) for ns, z, rate in samples]
    found = table("nav_msgs/msg/Odometry", data, paths)
    assert found is not None
    objects = [deserialise("nav_msgs/msg/Odometry", one) for one in data]
    assert found.tolist() == [[attrgetter(path)(one) for path in paths] for one in objects]


def test_messages_of_other_texts_or_lengths_make_no_table() -> None:
    """Their numbers may lie elsewhere; the reader then decodes them one by one."""
    ours = templates.odometry("sea", "hang_off")
    others = templates.odometry("sun", "hang_off"), templates.odometry("seabed", "hang_off")
    for other in others:
        data = [Template(one).data for one in (ours, other)]
        assert table("nav_msgs/msg/Odometry", data, ["pose.pose.position.z"]) is None
