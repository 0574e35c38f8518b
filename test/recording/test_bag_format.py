"""Format of the writer's bags, read by other readers: rosbags, mcap, and rosbag2's rules."""

import re

import pytest
import yaml
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader
from rosbags.interfaces import QosDurability, QosReliability
from rosbags.rosbag2 import Reader
from sample_snapshot import hanging_body, hanging_rope, rolled_ship

from rope_twin.errors import BagError
from rope_twin.messages import (
    Encoder,
    encode_cut,
    encode_diagnostics,
    encode_elevation,
    encode_epoch,
    encode_heave,
    encode_lower_end,
    encode_measurement,
    encode_order,
    encode_pose,
    statuses,
)
from rope_twin.messages.cdr import deserialise, encode_text, new, serialise
from rope_twin.messages.reports import (
    FIGURE_COLUMNS,
    FORECAST_TOPICS,
    STATES,
    encode_alerts,
    encode_estimate,
    encode_forecast,
)
from rope_twin.recording.bag import BagReader
from rope_twin.recording.bag_writer import BagWriter
from rope_twin.recording.session import encode_json
from rope_twin.topics import BY_NAME, TOPICS, Qos, Topic
from rope_twin.twin.readings import Measurement
from rope_twin.twin.winch.commands import WinchCommand

ONE_OF_EACH = [
    WinchCommand("speed", 0.3),
    WinchCommand("length", 350.0),
    WinchCommand("depth", 340.0),
    WinchCommand("tension", 1e5),
    WinchCommand("set_brake"),
]
MEASURED = [
    Measurement.of_winch(0, 1500.0, None, 1.2e5),
    Measurement.of_motor(0, 1.3e5),
    Measurement.of_depth(0, 1490.0),
]
LEARNED = dict.fromkeys(FIGURE_COLUMNS.split(), 0.5) | {"name": "payload_drag", "state": STATES[0]}
EPOCH_NS = 1_700_000_000_000_000_000
NOTES = {"seed": "7", "source": "a test: with 'quotes', #hash and\nlines", "number": "12"}


def all_messages(stamp_ns: int) -> dict[str, bytes]:
    snapshot = hanging_body()
    encoder = Encoder(EPOCH_NS)
    layout = new("std_msgs/msg/MultiArrayLayout", dim=[], data_offset=0)
    messages = {name: encoder.encode(name, snapshot) for name in encoder.topics}
    return messages | {
        "ship/heave": encode_heave(stamp_ns, 0.5, -0.25),
        "ship/odometry": encode_pose(stamp_ns, rolled_ship(stamp_ns)),
        "lower_end/odometry": encode_lower_end(stamp_ns, (1.0, 2.0, -3.0), (0.1, 0.0, -0.2)),
        "sea/elevation": encode_elevation(stamp_ns, 1.5),
        **dict(encode_order(stamp_ns, order) for order in ONE_OF_EACH),
        **dict([encode_cut(stamp_ns, 1500.0)]),
        **dict(encode_measurement(stamp_ns, one) for one in MEASURED),
        "twin/epoch": encode_epoch(EPOCH_NS),
        "winch/seat": encode_text("winch: console"),
        "twin/session": encode_json({"session": 1}),
        "twin/inputs": encode_json({"number": 1}),
        "sea/measured_elevation": encode_elevation(stamp_ns, 1.5),
        "estimate/figures": encode_estimate(stamp_ns, [LEARNED]),
        "estimate/alarms": encode_text("payload lost since 12.0 s"),
        "alerts": encode_alerts(stamp_ns, 0, []),
        "alerts/command": encode_text("acknowledge all"),
        "forecast/what_if": encode_text("lower:0.5 stop"),
        **{
            name: encode_forecast(name, stamp_ns, "map", [{"age_s": 0.2}])
            for name in FORECAST_TOPICS
        },
        "diagnostics": encode_diagnostics(stamp_ns, statuses(snapshot, None)),
        "current": serialise(
            new("std_msgs/msg/Float64MultiArray", layout=layout, data=hanging_rope().arc_length_m)
        ),
    }


@pytest.fixture(scope="module")
def bag(tmp_path_factory):
    """Three messages of every topic of the table, in small chunks."""
    directory = tmp_path_factory.mktemp("bags") / "full"
    written = []
    with BagWriter(directory, TOPICS, NOTES, chunk_bytes=4096) as writer:
        for k in range(3):
            stamp_ns = EPOCH_NS + k * 20_000_000
            for name, data in all_messages(stamp_ns).items():
                writer.write(name, stamp_ns, data)
                written.append((f"/{name}", stamp_ns, data))
    return directory, sorted(written)


def test_every_topic_of_the_table_is_in_it(bag):
    assert {name for name, _, _ in bag[1]} == {f"/{topic.name}" for topic in TOPICS}


def test_rosbags_reads_back_every_byte_and_decodes_it_by_the_bags_own_definitions(bag):
    directory, written = bag
    with AnyReader([directory]) as reader:
        found = []
        for connection, stamp_ns, data in reader.messages():
            ours = deserialise(connection.msgtype, data)
            theirs = reader.deserialize(data, connection.msgtype)
            assert type(ours).__name__ == type(theirs).__name__
            assert repr(theirs) == repr(ours)
            found.append((connection.topic, stamp_ns, bytes(data)))
    assert sorted(found) == written


def test_rosbags_reader_sees_types_qualities_counts_and_notes(bag):
    with Reader(bag[0]) as reader:
        assert reader.message_count == 3 * len(TOPICS)
        assert reader.duration == 40_000_001  # rosbags counts to just after the last
        assert reader.start_time == EPOCH_NS
        assert reader.ros_distro == "kilted"
        assert reader.storage.metadata.custom == NOTES
        by_topic = {connection.topic: connection for connection in reader.connections}
        for topic in TOPICS:
            connection = by_topic[f"/{topic.name}"]
            (qos,) = connection.ext.offered_qos_profiles
            assert connection.msgtype == topic.type_name
            assert connection.digest.startswith("RIHS01_")
            reliable = topic.qos in (Qos.COMMAND, Qos.LATCHED, Qos.LOG)
            assert (qos.reliability is QosReliability.RELIABLE) == reliable
            assert (qos.durability is QosDurability.TRANSIENT_LOCAL) == (topic.qos is Qos.LATCHED)
            assert qos.deadline.sec == 9223372036


def test_mcap_reads_it_by_its_index_with_every_check(bag):
    directory, written = bag
    with (directory / "full_0.mcap").open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        assert reader.get_header().profile == "ros2"
        summary = reader.get_summary()
        assert summary.statistics.message_count == len(written)
        assert len(summary.chunk_indexes) > 1
        assert {index.compression for index in summary.chunk_indexes} == {"zstd"}
        found = sorted(
            (channel.topic, message.log_time, message.data)
            for _, channel, message in reader.iter_messages()
        )
        assert found == written
        for schema in summary.schemas.values():
            assert schema.encoding == "ros2msg"
        for channel in summary.channels.values():
            assert channel.message_encoding == "cdr"
            assert channel.metadata["topic_type_hash"].startswith("RIHS01_")
            (profile,) = yaml.safe_load(channel.metadata["offered_qos_profiles"])
            assert profile["history"] == "keep_last"
        notes = {record.name: record.metadata for record in reader.iter_metadata()}
    assert notes["rope_twin"] == NOTES
    inner = yaml.safe_load(notes["rosbag2"]["serialized_metadata"])
    assert (
        inner
        == yaml.safe_load((directory / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    )


def test_metadata_keeps_the_rules_that_rosbag2_reads_by(bag):
    # rosbag2_storage/yaml.hpp: every key is required from its version on, with these types
    information = yaml.safe_load((bag[0] / "metadata.yaml").read_text())[
        "rosbag2_bagfile_information"
    ]
    assert information["version"] == 9
    assert information["storage_identifier"] == "mcap"
    assert information["duration"] == {"nanoseconds": 40_000_000}
    assert information["starting_time"] == {"nanoseconds_since_epoch": EPOCH_NS}
    assert information["message_count"] == 3 * len(TOPICS)
    assert information["relative_file_paths"] == ["full_0.mcap"]
    assert information["compression_format"] == information["compression_mode"] == ""
    assert information["custom_data"] == NOTES
    assert information["ros_distro"] == "kilted"
    (file,) = information["files"]
    assert file == {
        "path": "full_0.mcap",
        "starting_time": information["starting_time"],
        "duration": information["duration"],
        "message_count": information["message_count"],
    }
    for entry in information["topics_with_message_count"]:
        topic = entry["topic_metadata"]
        assert entry["message_count"] == 3
        assert topic["serialization_format"] == "cdr"
        assert re.fullmatch(r"RIHS01_[0-9a-f]{64}", topic["type_description_hash"])
        (profile,) = topic["offered_qos_profiles"]
        assert set(profile) == {
            "history", "depth", "reliability", "durability", "deadline", "lifespan",
            "liveliness", "liveliness_lease_duration", "avoid_ros_namespace_conventions",
        }  # fmt: skip


def test_equal_calls_make_equal_bytes(tmp_path):
    contents = []
    for parent in ("a", "b"):
        with BagWriter(tmp_path / parent / "bag", TOPICS, NOTES) as writer:
            for name, data in all_messages(EPOCH_NS).items():
                writer.write(name, EPOCH_NS, data)
        contents.append(
            [path.read_bytes() for path in sorted((tmp_path / parent / "bag").iterdir())]
        )
    assert contents[0] == contents[1]


def test_a_bag_without_messages_is_a_bag(tmp_path):
    BagWriter(tmp_path / "none", TOPICS).close()
    with Reader(tmp_path / "none") as reader:
        assert reader.message_count == 0
        assert len(reader.connections) == len(TOPICS)


def _break_while_writing(directory):
    with BagWriter(directory, TOPICS) as writer:
        writer.write("ship/heave", EPOCH_NS, encode_heave(EPOCH_NS, 1.0, 0.0))
        raise ZeroDivisionError


def test_what_came_before_an_error_is_kept(tmp_path):
    with pytest.raises(ZeroDivisionError):
        _break_while_writing(tmp_path / "cut")
    with Reader(tmp_path / "cut") as reader:
        assert reader.message_count == 1


def _misuse_unknown_topic(writer):
    writer.write("ship/heaves", 0, b"")


def _misuse_stamp(writer):
    writer.write("ship/heave", -1, b"")


def _misuse_after_end(writer):
    writer.close()
    writer.write("ship/heave", 0, b"")


@pytest.mark.parametrize(
    ("misuse", "reported"),
    [
        (_misuse_unknown_topic, "no topic /ship/heaves; did you mean '/ship/heave'"),
        (_misuse_stamp, "the stamp -1 ns"),
        (_misuse_after_end, "came after its end"),
    ],
)
def test_misuse_is_reported(tmp_path, misuse, reported):
    writer = BagWriter(tmp_path / "bag", [BY_NAME["ship/heave"]])
    with pytest.raises(BagError, match=re.escape(reported)):
        misuse(writer)
    writer.close()


def test_a_place_that_cannot_be_used_is_reported(tmp_path):
    (tmp_path / "file").write_text("x")
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "data").write_text("x")
    odd = Topic("odd", "std_msgs/msg/Flaot64", Qos.STREAM, 1.0, "", "")
    with pytest.raises(BagError, match="cannot be made"):
        BagWriter(tmp_path / "file" / "bag", TOPICS)
    with pytest.raises(BagError, match="the directory holds something"):
        BagWriter(tmp_path / "full", TOPICS)
    with pytest.raises(BagError, match="did you mean 'std_msgs/msg/Float64'"):
        BagWriter(tmp_path / "odd", [odd])
    assert not (tmp_path / "odd").exists()


def test_a_bag_of_several_files_lists_each_with_its_own_times(tmp_path):
    bag = tmp_path / "long"
    with BagWriter(bag, [BY_NAME["ship/heave"]], NOTES) as writer:
        for k in range(5):
            if k == 2:
                assert writer.begin_file()
            writer.write("ship/heave", EPOCH_NS + k, encode_heave(EPOCH_NS + k, 0.0, 0.0))
        assert writer.begin_file()  # and nothing comes any more
    text = (bag / "metadata.yaml").read_text()
    information = yaml.safe_load(text)["rosbag2_bagfile_information"]
    assert information["relative_file_paths"] == [f"long_{k}.mcap" for k in range(3)]
    assert information["starting_time"] == {"nanoseconds_since_epoch": EPOCH_NS}
    assert information["duration"] == {"nanoseconds": 4}
    assert information["message_count"] == 5
    assert information["files"] == [
        {
            "path": f"long_{number}.mcap",
            "starting_time": {"nanoseconds_since_epoch": start_ns},
            "duration": {"nanoseconds": duration_ns},
            "message_count": count,
        }
        for number, (start_ns, duration_ns, count) in enumerate(
            [(EPOCH_NS, 1, 2), (EPOCH_NS + 2, 2, 3), (0, 0, 0)]
        )
    ]
    with AnyReader([bag]) as reader:
        assert [stamp_ns - EPOCH_NS for _, stamp_ns, _ in reader.messages()] == [0, 1, 2, 3, 4]
    for number, count in enumerate([2, 3, 0]):  # each file is a bag of its own
        with BagReader(bag / f"long_{number}.mcap") as alone:
            assert alone.topics["/ship/heave"].messages == count
        with (bag / f"long_{number}.mcap").open("rb") as stream:
            notes = {record.name: record.metadata for record in make_reader(stream).iter_metadata()}
        assert notes["rope_twin"] == NOTES
