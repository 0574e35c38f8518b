"""Recovery: whatever is done to a bag, it ends in a valid one or in a clear word."""

import resource
import tempfile
from pathlib import Path

import pytest
import yaml
from bag_samples import START_NS, STEP_NS, swell
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer
from rosbags.highlevel import AnyReader

from rope_twin.cli import main
from rope_twin.errors import BagError
from rope_twin.messages import encode_epoch, encode_heave
from rope_twin.recording.bag import BagReader
from rope_twin.recording.bag_writer import BagWriter
from rope_twin.recording.recover import Outcome, recover
from rope_twin.topics import BY_NAME

NOTES = {"seed": "7"}


def write_bag(directory: Path) -> list[tuple[str, int, bytes]]:
    """A bag of many small chunks, with a gap of a topic that speaks once."""
    written = []
    topics = [BY_NAME["ship/heave"], BY_NAME["twin/epoch"]]
    with BagWriter(directory, topics, NOTES, chunk_bytes=8000) as bag:
        bag.write("twin/epoch", START_NS, encode_epoch(START_NS))
        written.append(("/twin/epoch", START_NS, encode_epoch(START_NS)))
        for k, (_, z, v) in enumerate(swell(300)):
            stamp_ns = START_NS + k * STEP_NS
            bag.write("ship/heave", stamp_ns, encode_heave(stamp_ns, z, v), sequence=k)
            written.append(("/ship/heave", stamp_ns, encode_heave(stamp_ns, z, v)))
    return written


def write_in_files(directory: Path) -> list[int]:
    """A bag of three files, its last cut off; the stamps of all messages."""
    stamps = [START_NS + k * STEP_NS for k in range(300)]
    bag = BagWriter(directory, [BY_NAME["ship/heave"]], NOTES, chunk_bytes=2000)
    bag.note_channels()
    for k, stamp_ns in enumerate(stamps):
        if k in (100, 200):
            assert bag.begin_file()
        bag.write("ship/heave", stamp_ns, encode_heave(stamp_ns, 0.1 * k, 0.0))
    bag.flush()  # and no close, as after a kill
    return stamps


@pytest.mark.parametrize("cut", [0, 1000])
def test_a_recording_in_files_is_recovered_as_one(tmp_path, cut):
    stamps = write_in_files(tmp_path / "bag")
    last = tmp_path / "bag" / "bag_2.mcap"
    last.write_bytes(last.read_bytes()[: last.stat().st_size - cut])
    result = recover(tmp_path / "bag")
    found = [stamp_ns for _, stamp_ns, _ in read_back(tmp_path / "bag_recovered")]
    assert found == stamps[: len(found)]
    assert len(found) == 300 if not cut else 200 < len(found) < 300
    assert result.outcome is Outcome.LOSS
    assert all("bag_2.mcap" in words for words in result.lost)
    with BagReader(tmp_path / "bag_recovered") as bag:
        assert bag.custom_data["seed"] == "7"


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Bytes of a whole bag's file and what is in it."""
    directory = tmp_path_factory.mktemp("bags") / "whole"
    written = write_bag(directory)
    return (directory / "whole_0.mcap").read_bytes(), written


def read_back(directory: Path) -> list[tuple[str, int, bytes]]:
    """By rosbags, each message decoded; and the whole by mcap's indexed reader with its checks."""
    with AnyReader([directory]) as reader:
        found = []
        for connection, stamp_ns, data in reader.messages():
            reader.deserialize(data, connection.msgtype)
            found.append((connection.topic, stamp_ns, bytes(data)))
    (file,) = directory.glob("*.mcap")
    with file.open("rb") as stream:
        by_index = list(make_reader(stream, validate_crcs=True).iter_messages())
    assert len(by_index) == len(found)
    return found


def run(*words: str) -> int:
    return main(["recover", *words])


@settings(max_examples=40, deadline=None)
@given(st.data())
def test_a_file_cut_anywhere_gives_its_beginning_or_nothing(whole, data):
    content, written = whole
    at = data.draw(st.integers(0, len(content) - 1))
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "cut.mcap"
        file.write_bytes(content[:at])
        result = recover(file)
        assert result.outcome is not Outcome.WHOLE
        assert result.lost
        if result.outcome is Outcome.NOTHING:
            assert result.directory is None
            assert [path.name for path in Path(folder).iterdir()] == ["cut.mcap"]
            return
        found = read_back(result.directory)
        assert found == written[: len(found)]
        assert sum(result.counts.values()) == len(found)
        # a chunk of 8000 bytes and the summary are all that can go beyond the cut
        assert len(found) >= (at / len(content) - 0.35) * len(written)


@settings(max_examples=40, deadline=None)
@given(st.data())
def test_damage_anywhere_is_reported_and_never_handed_on(whole, data):
    content, written = whole
    damaged = bytearray(content)
    for _ in range(data.draw(st.integers(1, 3))):
        at = data.draw(st.integers(0, len(content) - 1))
        damaged[at] ^= data.draw(st.integers(1, 255))
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "bad.mcap"
        file.write_bytes(damaged)
        result = recover(file)
        if result.directory is not None:
            found = read_back(result.directory)
            assert set(found) <= set(written)
            assert len(found) == len(written) or result.outcome is Outcome.LOSS


@settings(max_examples=50, deadline=None)
@given(st.binary(max_size=2000))
def test_any_bytes_at_all_are_answered(noise):
    with tempfile.TemporaryDirectory() as folder:
        for head in (b"", b"\x89MCAP0\r\n"):
            file = Path(folder) / "noise.mcap"
            file.write_bytes(head + noise)
            result = recover(file)
            assert result.outcome is Outcome.NOTHING
            assert result.lost


def test_a_whole_bag_stays_whole(tmp_path, capsys):
    written = write_bag(tmp_path / "bag")
    assert run(str(tmp_path / "bag")) == 0
    assert read_back(tmp_path / "bag_recovered") == written
    reported = capsys.readouterr().out
    assert "301 messages recovered" in reported
    assert "lost" not in reported
    with (tmp_path / "bag_recovered" / "bag_recovered_0.mcap").open("rb") as stream:
        sequences = [m.sequence for _, c, m in make_reader(stream).iter_messages(["/ship/heave"])]
    assert sequences == list(range(300))


def test_a_killed_bag_comes_back_with_types_qualities_and_notes(tmp_path, capsys):
    written = write_bag(tmp_path / "bag")
    before = yaml.safe_load((tmp_path / "bag" / "metadata.yaml").read_text())
    (tmp_path / "bag" / "metadata.yaml").unlink()
    file = tmp_path / "bag" / "bag_0.mcap"
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])
    assert run(str(tmp_path / "bag"), "--out", str(tmp_path / "new")) == 3
    found = read_back(tmp_path / "new")
    assert 50 < len(found) < 250
    assert found == written[: len(found)]
    after = yaml.safe_load((tmp_path / "new" / "metadata.yaml").read_text())
    old, new = (x["rosbag2_bagfile_information"] for x in (before, after))
    assert [t["topic_metadata"] for t in new["topics_with_message_count"]] == [
        t["topic_metadata"] for t in old["topics_with_message_count"]
    ]
    assert new["custom_data"]["seed"] == "7"
    assert "breaks off at byte" in new["custom_data"]["recovered"]
    reported = capsys.readouterr().out
    assert f"{len(found)} messages recovered into {tmp_path / 'new'}" in reported
    assert f"/ship/heave {len(found) - 1:>21}" in reported
    assert f"over {(len(found) - 2) * 0.05:.3f} s" in reported
    assert "lost: bag_0.mcap breaks off at byte" in reported
    assert "note: metadata.yaml was missing" in reported


def test_what_metadata_promised_and_is_missing_is_reported(tmp_path, capsys):
    write_bag(tmp_path / "bag")
    file = tmp_path / "bag" / "bag_0.mcap"
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])
    assert run(str(tmp_path / "bag")) == 3
    assert "of 301 messages are missing" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("prepare", "reported"),
    [
        (lambda path: path.mkdir(), "holds no .mcap file"),
        (lambda path: path.write_bytes(b""), "bag is empty"),
        (lambda path: path.write_text("a text"), "does not begin like an MCAP file"),
        (lambda path: None, "it does not exist"),
    ],
)
def test_where_nothing_is_to_be_had_the_code_is_1(tmp_path, capsys, prepare, reported):
    prepare(tmp_path / "bag")
    assert run(str(tmp_path / "bag")) == 1
    captured = capsys.readouterr()
    assert reported in captured.out + captured.err
    assert not (tmp_path / "bag_recovered").exists()


def test_the_files_of_a_split_recording_are_joined_in_order(tmp_path):
    (tmp_path / "bag").mkdir()
    for number in (2, 10, 1):
        part = tmp_path / f"part{number}"
        with BagWriter(part, [BY_NAME["twin/epoch"]]) as bag:
            bag.write("twin/epoch", START_NS + number, encode_epoch(number))
        (file,) = part.glob("*.mcap")
        file.rename(tmp_path / "bag" / f"bag_{number}.mcap")
    expected = [START_NS + number for number in (1, 2, 10)]
    result = recover(tmp_path / "bag")
    assert result.outcome is Outcome.WHOLE
    assert [stamp for _, stamp, _ in read_back(result.directory)] == expected
    assert (result.start_ns, result.end_ns) == (START_NS + 1, START_NS + 10)


@pytest.mark.parametrize("compression", list(CompressionType))
@pytest.mark.parametrize("chunked", [True, False])
def test_files_of_others_are_read_in_each_form(tmp_path, compression, chunked):
    file = tmp_path / "other.mcap"
    with file.open("wb") as stream:
        writer = Writer(stream, 500, compression, use_chunking=chunked)
        writer.start("ros2", "other")
        schema = writer.register_schema("builtin_interfaces/msg/Time", "ros2msg", b"int32 sec\n")
        channel = writer.register_channel("/twin/epoch", "cdr", schema)
        for k in range(100):
            writer.add_message(channel, START_NS + k, encode_epoch(k), START_NS + k - 5)
        writer.add_attachment(0, 0, "photo", "image/png", b"...")
        writer.add_metadata("weather", {"wind": "5"})
        writer.finish()
    result = recover(file)
    assert result.outcome is Outcome.WHOLE
    assert result.counts == {"/twin/epoch": 100}
    assert result.remarks == ("attachments are left out", "notes 'weather' are left out")
    (new,) = result.directory.glob("*.mcap")
    with new.open("rb") as stream:
        times = [(m.log_time, m.publish_time) for _, _, m in make_reader(stream).iter_messages()]
    assert times == [(START_NS + k, START_NS + k - 5) for k in range(100)]


def test_a_place_in_use_is_not_written_over(tmp_path):
    write_bag(tmp_path / "bag")
    recover(tmp_path / "bag")
    with pytest.raises(BagError, match="the directory holds something"):
        recover(tmp_path / "bag")


def test_a_full_disk_leaves_no_half_of_a_recovered_bag(tmp_path):
    """The advice is another folder, and a second attempt finds the first one's place free."""
    write_bag(tmp_path / "bag")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (4096, before[1]))
    try:
        with pytest.raises(BagError) as caught:
            recover(tmp_path / "bag")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert "name a folder on another disk with --out" in str(caught.value)
    assert not (tmp_path / "bag_recovered").exists()
    assert recover(tmp_path / "bag").outcome is Outcome.WHOLE
