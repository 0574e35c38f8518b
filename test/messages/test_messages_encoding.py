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
from rope_twin.messages.templates import CloudReader, read_cloud
from rope_twin.topics import TOPICS, Topic
from rope_twin.twin.snapshot import Snapshot, first_rope
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


def cloud(snapshot: Snapshot, *columns: tuple[str, str, object]) -> object:
    """A PointCloud2 of columns, each with name, numpy type and values."""
    n = len(columns[0][2])  # type: ignore[arg-type]
    rows = np.zeros(n, [(name, kind) for name, kind, _ in columns])
    fields, offset = [], 0
    for name, kind, values in columns:
        rows[name] = values
        size, count = np.dtype(kind).itemsize, 1 if kind[0] == "<" else int(kind[1:])
        datatype = {"<f4": 7, "<f8": 8}.get(kind, 2)
        fields.append(
            made("sensor_msgs/msg/PointField", name=name, offset=offset, datatype=datatype,
                 count=count)
        )  # fmt: skip
        offset += size
    return made(
        "sensor_msgs/msg/PointCloud2", header=header(snapshot, "map"), height=1, width=n,
        fields=fields, is_bigendian=False, point_step=offset, row_step=offset * n,
        data=np.frombuffer(rows.tobytes(), dtype=np.uint8), is_dense=True,
    )  # fmt: skip


def nodes(snapshot: Snapshot) -> object:
    axes = [(axis, "<f4", snapshot.node_position_m[:, k]) for k, axis in enumerate("xyz")]
    rope = np.zeros(len(snapshot.node_tension_n))
    return cloud(snapshot, *axes, ("tension_n", "<f4", snapshot.node_tension_n),
                 ("rope", "<f4", rope))  # fmt: skip


def element_tension(snapshot: Snapshot) -> object:
    tension_n = snapshot.element_tension_n
    return cloud(
        snapshot, ("tension_n", "<f8", tension_n), ("rope", "<f4", np.zeros(len(tension_n)))
    )


def odometry(snapshot: Snapshot) -> object:
    turn = made("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.0, w=1.0)
    position = vector("Point", snapshot.hang_off_position_m)
    pose = made("geometry_msgs/msg/Pose", position=position, orientation=turn)
    twist = made(
        "geometry_msgs/msg/Twist", linear=vector("Vector3", snapshot.hang_off_velocity_m_per_s),
        angular=vector("Vector3", np.zeros(3)),
    )  # fmt: skip
    computed = 1e-6 * np.eye(6).ravel()
    return made(
        "nav_msgs/msg/Odometry", header=header(snapshot, "map"), child_frame_id="hang_off",
        pose=made("geometry_msgs/msg/PoseWithCovariance", pose=pose, covariance=computed),
        twist=made("geometry_msgs/msg/TwistWithCovariance", twist=twist, covariance=computed),
    )  # fmt: skip


def payload(snapshot: Snapshot) -> object:
    turn = made("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.0, w=1.0)
    place = vector("Vector3", snapshot.payload_position_m)
    return made(
        "sensor_msgs/msg/MultiDOFJointState", header=header(snapshot, "map"),
        joint_names=["payload"],
        transforms=[made("geometry_msgs/msg/Transform", translation=place, rotation=turn)],
        twist=[made("geometry_msgs/msg/Twist",
                    linear=vector("Vector3", snapshot.payload_velocity_m_per_s),
                    angular=vector("Vector3", np.zeros(3)))],
        wrench=[],
    )  # fmt: skip


def joint(snapshot: Snapshot, **values: float) -> object:
    fields = {name: np.zeros(0) for name in ("position", "velocity", "effort")}
    fields |= {name: np.array([value]) for name, value in values.items()}
    return made("sensor_msgs/msg/JointState", header=header(snapshot, ""), name=["rope"], **fields)


def length(snapshot: Snapshot) -> object:
    return joint(snapshot, position=snapshot.line_out_m, velocity=snapshot.payout_speed_m_per_s)


def wrench(snapshot: Snapshot) -> object:
    force = vector("Vector3", snapshot.hang_off_force_n)
    parts = made("geometry_msgs/msg/Wrench", force=force, torque=vector("Vector3", np.zeros(3)))
    return made("geometry_msgs/msg/WrenchStamped", header=header(snapshot, "map"), wrench=parts)


def lower_end(snapshot: Snapshot) -> object:
    return wrench(replace(snapshot, hang_off_force_n=np.array(snapshot.lower_end_force_n)))


def interval(snapshot: Snapshot) -> object:
    found = snapshot.error_interval
    assert found is not None
    return cloud(
        snapshot, ("name", "S32", [b"rope"]), ("rms_pct", "<f8", [0.5]),
        ("lower_n", "<f8", [found.low_n]), ("upper_n", "<f8", [found.high_n]),
    )  # fmt: skip


def contact(snapshot: Snapshot) -> object:
    bed = snapshot.seabed
    assert bed is not None
    return cloud(
        snapshot, ("payload_height_m", "<f8", [bed.payload_height_m]),
        ("payload_reaction_n", "<f8", [bed.payload_reaction_n]),
        ("rope_on_seabed_m", "<f8", [bed.rope_on_bed_m]),
        ("rope_reaction_n", "<f8", [bed.rope_reaction_n]),
    )  # fmt: skip


def pressed(snapshot: Snapshot) -> object:
    (one,) = snapshot.contacts
    x, y, z = one.position_m
    return cloud(
        snapshot, ("name", "S32", [one.name.encode()]), ("x", "<f8", [x]), ("y", "<f8", [y]),
        ("z", "<f8", [z]), ("normal_force_n", "<f8", [one.normal_n]),
    )  # fmt: skip


def compensator(snapshot: Snapshot) -> object:
    unit = snapshot.compensator
    assert unit is not None
    return cloud(
        snapshot, ("stroke_m", "<f8", [unit.stroke_m]),
        ("stroke_rate_m_per_s", "<f8", [unit.stroke_rate_m_per_s]),
        ("tension_n", "<f8", [unit.tension_n]), ("gas_pressure_pa", "<f8", [unit.gas_pressure_pa]),
        ("gas_force_n", "<f8", [unit.gas_force_n]), ("damper_n", "<f8", [unit.damper_n]),
        ("friction_n", "<f8", [unit.friction_n]), ("stop_n", "<f8", [unit.stop_n]),
        ("water_n", "<f8", [unit.water_n]), ("active_n", "<f8", [unit.active_n]),
    )  # fmt: skip


def fatigue(snapshot: Snapshot) -> object:
    wear = snapshot.fatigue
    assert wear is not None
    assert wear.bent is not None
    return cloud(
        snapshot, ("from_lower_end_m", "<f8", wear.from_lower_end_m),
        ("from_hang_off_m", "<f8", wear.from_hang_off_m), ("damage", "<f8", wear.used),
        ("rope", "<f8", np.zeros(len(wear.used))), ("bends", "<f8", wear.bent.bends),
        ("bend_damage", "<f8", wear.bent.damage), ("discard_fraction", "<f8", wear.bent.discard),
    )  # fmt: skip


BY_OBJECTS = {
    "ropes/fatigue": fatigue,
    "compensator/state": compensator,
    "seabed/contact": contact,
    "ropes/contact": pressed,
    "ropes/tension_top_error": interval,
    "ropes/tension_top": lambda s: joint(s, effort=s.tension_top_n),
    "ropes/tension_bottom": lambda s: joint(s, effort=float(s.node_tension_n[-1])),
    "hang_off/wrench": wrench,
    "lower_end/wrench": lower_end,
    "hang_off/odometry": odometry,
    "ropes/element_tension": element_tension,
    "payloads/state": payload,
    "ropes/length": length,
    "ropes/nodes": nodes,
}


@st.composite
def snapshots(draw: st.DrawFn) -> Snapshot:
    size = draw(st.integers(2, 40))
    tension = arrays(np.float64, size, elements=st.floats(0.0, 1e9))
    return replace(
        hanging_rope(size),
        stamp_ns=draw(st.integers(0, 10**15)),
        node_position_m=draw(arrays(np.float64, (size, 3), elements=FINITE)),
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
@pytest.mark.parametrize("size", SIZES)
def test_bytes_equal_those_of_a_message_built_by_objects(topic: str, size: int) -> None:
    snapshot = hanging_rope(size)
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
    data = messages.Encoder(EPOCH_NS).encode("ropes/vibration", snapshot)
    found = messages.decode("ropes/vibration", data)
    names = ["x", "y", "z", "cross_flow", "cross_flow_hz"]
    names += ["in_line", "in_line_hz"] if in_line else []
    names += ["drag_amplification", "rope"]
    assert [field.name for field in found.fields] == names
    assert found.width * found.point_step == len(found.data) == 7 * 4 * len(names)
    points = np.frombuffer(found.data.tobytes(), "<f4").reshape(7, len(names))
    assert points[:, :3] == pytest.approx(snapshot.node_position_m, rel=1e-6)
    assert (points[:, -1] == 0.0).all()
    for name in names[3:-1]:
        known = getattr(snapshot.vibration, name)
        assert points[:, names.index(name)] == pytest.approx(known, rel=1e-6)


def test_the_cloud_of_vibration_has_every_rope_that_has_some() -> None:
    """The first and the third of three: their numbers, places and amplitudes."""
    first, third = hanging_rope(7), hanging_rope(5)
    assert first.vibration is not None
    assert third.vibration is not None
    one, other = first_rope(first, "a"), first_rope(third, "c")
    ropes = one, replace(one, name="b"), replace(other, vibration=third.vibration)
    data = messages.Encoder(EPOCH_NS).encode("ropes/vibration", replace(first, ropes=ropes))
    cloud = read_cloud(messages.decode("ropes/vibration", data))
    assert cloud["rope"].tolist() == 7 * [0.0] + 5 * [2.0]
    amplitude = [*first.vibration.cross_flow, *third.vibration.cross_flow]
    assert cloud["cross_flow"] == pytest.approx(amplitude, rel=1e-6)
    assert cloud["z"] == pytest.approx(
        [*first.node_position_m[:, 2], *third.node_position_m[:, 2]], rel=1e-6
    )


def test_every_topic_made_from_a_snapshot_is_encoded() -> None:
    others = {
        "diagnostics", "alerts", "estimate/figures", "estimate/alarms", "twin/epoch", "winch/seat",
        "twin/session", "twin/inputs",
    }  # fmt: skip
    wanted = {t.name for t in TOPICS if t.publisher == "simulation"} - others
    assert set(messages.Encoder(0).topics) == wanted


def test_unknown_topic_names_the_nearest() -> None:
    with pytest.raises(InputError, match="did you mean 'ropes/tension_top'"):
        messages.Encoder(0).encode("ropes/tension_tops", hanging_rope())


@settings(max_examples=30, deadline=None)
@given(stamp=st.integers(0, 2**31 * 10**9 - 1), z=FINITE, rate=FINITE)
def test_inputs_come_back_as_they_went_in(stamp: int, z: float, rate: float) -> None:
    heave = messages.decode("ship/heave", messages.encode_heave(stamp, z, rate))
    assert (heave.pose.pose.position.z, heave.twist.twist.linear.z) == (z, rate)
    assert heave.pose.pose.orientation.w == 1.0
    assert np.diag(heave.pose.covariance.reshape(6, 6)).tolist() == [1e6, 1e6, 1e-6, 1e6, 1e6, 1e6]
    assert (heave.header.frame_id, heave.child_frame_id) == ("map", "hang_off")
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
    with pytest.raises(InputError, match="did you mean 'ropes/nodes'"):
        messages.decode("/ropes/node", b"")


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
    ours = templates.odometry("map", "hang_off")
    others = templates.odometry("sun", "hang_off"), templates.odometry("seabed", "hang_off")
    for other in others:
        data = [Template(one).data for one in (ours, other)]
        assert table("nav_msgs/msg/Odometry", data, ["pose.pose.position.z"]) is None


def test_a_reader_of_clouds_reads_what_decoding_finds() -> None:
    """Points of one message after the other, whose number changes; an end of padding."""
    encoder, reader = messages.Encoder(7), CloudReader("ropes/nodes")
    for step, nodes in enumerate((5, 5, 5, 9, 9, 5)):
        snapshot = hanging_rope(nodes=nodes, time_s=0.02 * step)
        data = encoder.encode("ropes/nodes", snapshot) + bytes(step % 4)
        stamp_ns, points = reader.read(data)
        assert stamp_ns == 7 + snapshot.stamp_ns
        assert points.tobytes() == read_cloud(messages.decode("ropes/nodes", data)).tobytes()
        assert len(points) == nodes


@pytest.mark.parametrize(
    ("datatype", "offset", "count", "step"),
    [(8, 2**31 - 1, 1, 8), (2, 8, 2**31 - 1, 8), (8, 1, 1, 8), (8, 2**32 - 8, 1, 8), (2, 0, 9, 8)],
)
def test_a_column_beyond_its_point_is_refused(
    datatype: int, offset: int, count: int, step: int
) -> None:
    """Offset and size overflow the int32 of numpy, which then reads memory of others."""
    field = templates.new("sensor_msgs/msg/PointField", name="x_m", datatype=datatype,
                          offset=offset, count=count)  # fmt: skip
    cloud = templates.new("sensor_msgs/msg/PointCloud2", height=1, width=4, fields=[field],
                          point_step=step, row_step=32, data=np.zeros(32, np.uint8))  # fmt: skip
    with pytest.raises(InputError, match="'x_m' ends beyond its point"):
        read_cloud(cloud)


def test_a_reader_of_clouds_sees_renamed_columns() -> None:
    encoder, reader = messages.Encoder(0), CloudReader("ropes/nodes")
    data = encoder.encode("ropes/nodes", hanging_rope(nodes=5))
    for _ in range(2):
        reader.read(data)
    _, points = reader.read(data.replace(b"tension_n", b"tonsion_n"))
    assert "tonsion_n" in (points.dtype.names or ())
    with pytest.raises(InputError):
        reader.read(data[:-30])
