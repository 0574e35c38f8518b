"""Playing bags: whole, cut off, foreign, damaged."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

import pytest
from mcap.writer import Writer
from sample_snapshot import hanging_rope

from rope_twin import messages
from rope_twin.errors import BagError, InputError
from rope_twin.files import share_dir
from rope_twin.recording.bag_writer import BagWriter
from rope_twin.topics import BY_NAME, TOPICS
from rope_twin.view.rope_view import play

EPOCH_NS = 1_763_700_000_000_000_000
SECONDS = 20
ALL = 1 + 17 * 200  # the epoch, and each shown topic 10 times a second
OF_A_BODY = ("slings/state", "payloads/body")


class Watcher:
    """Stands where the view is."""

    def __init__(self) -> None:
        self.seen: list[tuple[str, int]] = []

    def show(self, topic_name: str, message: Any, time_ns: int) -> None:
        assert message.__msgtype__ == BY_NAME[topic_name].type_name
        self.seen.append((topic_name, time_ns))

    @property
    def counts(self) -> Counter[str]:
        return Counter(name for name, _ in self.seen)


@pytest.fixture
def bag(tmp_path: Path) -> Path:
    """20 s of a lift at 10 Hz."""
    encoder = messages.Encoder(EPOCH_NS)
    with BagWriter(tmp_path / "lift", TOPICS) as writer:
        writer.write("twin/epoch", EPOCH_NS, messages.encode_epoch(EPOCH_NS))
        for k in range(SECONDS * 10):
            snapshot = hanging_rope(101, time_s=k / 10)
            stamp_ns = EPOCH_NS + snapshot.stamp_ns
            for topic in (own for own in encoder.topics if own not in OF_A_BODY):
                writer.write(topic, stamp_ns, encoder.encode(topic, snapshot))
    return tmp_path / "lift"


def test_the_files_of_a_split_recording_are_played_by_number(tmp_path: Path) -> None:
    (tmp_path / "bag").mkdir()
    for number in (10, 2):
        part = tmp_path / f"part{number}"
        with BagWriter(part, TOPICS) as writer:
            writer.write("twin/epoch", EPOCH_NS + number, messages.encode_epoch(EPOCH_NS))
        (file,) = part.glob("*.mcap")
        file.rename(tmp_path / "bag" / f"bag_{number}.mcap")
    watcher = Watcher()
    play(tmp_path / "bag", watcher)
    assert [time_ns - EPOCH_NS for _, time_ns in watcher.seen] == [2, 10]


def test_a_bag_is_played_in_order(bag: Path) -> None:
    watcher = Watcher()
    played = play(bag, watcher)
    assert watcher.counts == {
        "twin/epoch": 1, "ropes/tension_top": 200, "ropes/tension_bottom": 200,
        "ropes/length": 200, "ropes/tension_top_error": 200, "ropes/nodes": 200,
        "ropes/element_tension": 200, "ropes/vibration": 200, "ropes/fatigue": 200,
        "ropes/bend_radius": 200, "payloads/state": 200, "struts/state": 200, "winch/state": 200,
        "seabed/touchdown": 200, "lines/crossings": 200, "lines/events": 200,
        "residuals": 200, "twin/quality": 200,
    }  # fmt: skip
    times = [time_ns for _, time_ns in watcher.seen]
    assert times == sorted(times)
    assert (played.shown, played.problems) == (ALL, [])
    assert played.duration_s == pytest.approx(19.9)


def test_the_mcap_file_alone_will_do(bag: Path) -> None:
    (file,) = bag.glob("*.mcap")
    assert play(file, Watcher()).shown == ALL


def test_it_ends_where_it_is_reported_to(bag: Path) -> None:
    watcher = Watcher()
    assert play(bag, watcher, until_s=5.0).duration_s == pytest.approx(5.0)
    assert watcher.counts["ropes/nodes"] == 51


def test_a_time_after_the_end_is_reported(bag: Path) -> None:
    with pytest.raises(InputError, match=r"60 s is after its end; it lasts 19\.9 s"):
        play(bag, Watcher(), until_s=60.0)


@pytest.mark.parametrize("part", [0.2, 0.5])
def test_a_bag_cut_off_is_played_up_to_the_break(bag: Path, part: float) -> None:
    (file,) = bag.glob("*.mcap")
    whole = file.read_bytes()
    file.write_bytes(whole[: int(part * len(whole))])
    (bag / "metadata.yaml").unlink()  # as after kill -9
    watcher = Watcher()
    played = play(bag, watcher)
    assert 0 < played.shown < ALL
    assert len(played.problems) == 1
    assert file.name in played.problems[0]


def test_a_recorded_sea_alone_is_shown_too() -> None:
    watcher = Watcher()
    played = play("sea_2p5m", watcher, until_s=30.0)
    assert played.start_ns is not None
    assert set(watcher.counts) <= {"ship/heave", "sea/elevation"}
    assert watcher.counts["ship/heave"] == pytest.approx(601, abs=1)
    assert (share_dir() / "bags" / "sea_2p5m").is_dir()


def write_mcap(path: Path, topic: str, datas: list[bytes]) -> Path:
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start("ros2")
        schema = writer.register_schema("any/msg/Any", "ros2msg", b"")
        channel = writer.register_channel(topic, "cdr", schema)
        for k, data in enumerate(datas):
            writer.add_message(channel, EPOCH_NS + k, data, EPOCH_NS + k)
        writer.finish()
    return path


def test_a_namespace_in_front_is_passed_over(tmp_path: Path) -> None:
    file = write_mcap(
        tmp_path / "a.mcap", "/vessel/crane/ship/heave", [messages.encode_heave(EPOCH_NS, 1.0, 0.0)]
    )
    watcher = Watcher()
    play(file, watcher)
    assert watcher.counts == {"ship/heave": 1}


def test_messages_that_do_not_decode_are_counted_and_reported(tmp_path: Path) -> None:
    good = messages.encode_heave(EPOCH_NS, 1.0, 0.0)
    file = write_mcap(tmp_path / "a.mcap", "/ship/heave", [good, b"\0\1\0\0x", good, b"\0\1\0\0x"])
    watcher = Watcher()
    played = play(file, watcher)
    assert watcher.counts == {"ship/heave": 2}
    (problem,) = played.problems
    assert problem.startswith("2 × topic ship/heave: 5 bytes that do not decode")


@pytest.mark.parametrize("datas", [[], [b"\0\1\0\0"]])
def test_a_bag_with_nothing_to_show_is_reported(tmp_path: Path, datas: list[bytes]) -> None:
    file = write_mcap(tmp_path / "a.mcap", "/camera/image", datas)
    with pytest.raises(BagError, match="no topic to show"):
        play(file, Watcher())


def test_what_is_no_bag_is_reported(tmp_path: Path) -> None:
    with pytest.raises(BagError, match="no such file or name in bags/"):
        play(tmp_path / "nowhere", Watcher())
    (tmp_path / "notes.txt").write_text("no bag")
    with pytest.raises(BagError, match=r"holds no \.mcap file"):
        play(tmp_path / "notes.txt", Watcher())
    (tmp_path / "text.mcap").write_text("no bag")
    with pytest.raises(BagError, match="does not begin like an MCAP file"):
        play(tmp_path / "text.mcap", Watcher())
