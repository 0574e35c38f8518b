"""Bags that cannot be replayed: the sentence that each of them gets."""

import errno
import math
import os
import re
import shutil
from pathlib import Path

import pytest
from bag_samples import STEP_NS, swell, write_heave

from rope_twin.cli import main
from rope_twin.errors import BagError
from rope_twin.recording.bag_writer import BagWriter
from rope_twin.recording.heave import open_heave
from rope_twin.topics import BY_NAME


def _folder(path):
    path.mkdir()
    return path


def _text(path):
    path = path.with_suffix(".mcap")
    path.write_text("this is no bag, but it is long enough to look into")
    return path


def _picture(path):
    path = path.with_suffix(".png")
    path.write_bytes(b"\x89PNG\r\n")
    return path


def _empty_file(path):
    path = path.with_suffix(".mcap")
    path.touch()
    return path


def _cut_off(path):
    (file,) = write_heave(path, swell(2000)).glob("*.mcap")
    file.write_bytes(file.read_bytes()[:-1000])
    return path


def _killed(path):
    _cut_off(path)
    (path / "metadata.yaml").unlink()
    return path


def _flipped(path):
    (file,) = write_heave(path, swell(2000)).glob("*.mcap")
    data = bytearray(file.read_bytes())
    data[20_000] ^= 0xFF
    file.write_bytes(data)
    return path


def _without_its_file(path):
    (file,) = write_heave(path, swell(20)).glob("*.mcap")
    file.unlink()
    return path


def _broken_yaml(path):
    (write_heave(path, swell(20)) / "metadata.yaml").write_text("version: [")
    return path


def _other_yaml(path):
    (write_heave(path, swell(20)) / "metadata.yaml").write_text("- 1\n- 2\n")
    return path


def _future(path):
    file = write_heave(path, swell(20)) / "metadata.yaml"
    file.write_text(file.read_text().replace("version: 9", "version: 99"))
    return path


def _no_messages(path):
    return write_heave(path, [])


def _one_message(path):
    return write_heave(path, swell(1))


def _other_topics(path):
    BagWriter(path, [BY_NAME["ropes/tension_top"]]).close()
    return path


def _no_topics(path):
    BagWriter(path, []).close()
    return path


def _two_odometries(path):
    topics = [BY_NAME["hang_off/odometry"], BY_NAME["ship/heave"]]
    with BagWriter(path, [topics[0], BY_NAME["ship/heave"]]) as bag:
        bag.flush()
    moved = path / "metadata.yaml"
    moved.unlink()
    (file,) = path.glob("*.mcap")
    data = file.read_bytes().replace(b"/ship/heave", b"/ship/motio")
    file.write_bytes(data)
    shutil.move(file, path.with_suffix(".mcap"))
    return path.with_suffix(".mcap")


def _all_nan(path):
    return write_heave(path, [(k * STEP_NS, float("nan"), 0.0) for k in range(40)])


def _much_bad(path):
    rows = swell(100)
    for k in range(0, 100, 10):
        rows[k] = (rows[k][0], float("inf"), 0.0)
    return write_heave(path, rows)


def _frozen_clock(path):
    return write_heave(path, [(0, z, v) for _, z, v in swell(100)])


def _clock_set_back(path):
    rows = [(t if k < 50 else t - 3600 * 10**9, z, v) for k, (t, z, v) in enumerate(swell(100))]
    return write_heave(path, rows)


def _clock_set_right(path):
    rows = [(t if k < 50 else t + 3600 * 10**9, z, v) for k, (t, z, v) in enumerate(swell(100))]
    return write_heave(path, rows)


def _down_is_positive(path):
    return write_heave(path, [(t, z, -v) for t, z, v in swell(400)])


def _in_milliseconds(path):
    return write_heave(path, [(t // 10**6, z, v) for t, z, v in swell(100)])


def _every_five_seconds(path):
    omega = 2.0 * math.pi / 8.0
    rows = [(5 * k, math.sin(5 * omega * k), math.cos(5 * omega * k)) for k in range(100)]
    return write_heave(path, [(t * 10**9, z, omega * v) for t, z, v in rows])


def _garbled(path):
    with BagWriter(path, [BY_NAME["ship/heave"]]) as bag:
        for k in range(20):
            bag.write("ship/heave", k * STEP_NS, b"\x00\x01\x00\x00 too short")
    return path


BAD = {
    "a folder": (_folder, "it is a folder without metadata.yaml; a bag has one"),
    "a text": (_text, "bad.mcap is not an MCAP file"),
    "a picture": (_picture, "it is not a bag; right is a rosbag2 directory or an .mcap file"),
    "an empty file": (_empty_file, "bad.mcap is empty"),
    "cut off": (_cut_off, "bad_0.mcap stops before its end (was its recorder killed?)"),
    "killed": (_killed, "it has no metadata.yaml; `rope_twin recover"),
    "a flipped byte": (_flipped, "it is damaged ("),
    "without its file": (_without_its_file, "it is damaged (Some database files are missing"),
    "broken metadata": (_broken_yaml, "it is damaged (Could not load YAML"),
    "other metadata": (_other_yaml, "it is damaged ("),
    "from the future": (_future, "Rosbag2 version 99 not supported"),
    "no messages": (_no_messages, "topic /ship/heave: it holds no message; heave needs at least 2"),
    "one message": (_one_message, "topic /ship/heave: 0 of 1 samples cannot be used (too few)"),
    "other topics": (
        _other_topics,
        "no topic is a nav_msgs/msg/Odometry; it holds /ropes/tension_top",
    ),
    "no topics": (_no_topics, "no topic is a nav_msgs/msg/Odometry; it holds nothing"),
    "all not finite": (_all_nan, "40 of 40 samples cannot be used (40 not finite)"),
    "much not finite": (_much_bad, "10 of 100 samples cannot be used (10 not finite)"),
    "a clock that stands": (_frozen_clock, "99 of 100 samples cannot be used (99 with a repeated"),
    "a clock set back": (_clock_set_back, "(50 with a stamp that goes back)"),
    "a clock set right": (_clock_set_right, "gaps in time, the longest 3600 s at 2.450 s"),
    "down is positive": (_down_is_positive, "twist.linear.z runs against pose.position.z"),
    "milliseconds as nanoseconds": (
        _in_milliseconds,
        "a sample every 50 ns, as of stamps in milliseconds",
    ),
    "too slow": (_every_five_seconds, "a sample every 5 s, too few to compare its rate with"),
    "garbled": (_garbled, "20 of 20 samples cannot be used (20 that do not decode)"),
    "two odometries": (
        _two_odometries,
        "several topics could be the heave: /hang_off/odometry, /ship/motio; name one of them",
    ),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_bag_gets_one_sentence(tmp_path, name):
    make, reported = BAD[name]
    path = make(tmp_path / "bad")
    with pytest.raises(BagError) as caught:
        open_heave(path)
    text = str(caught.value)
    assert reported in text
    assert text.startswith(f"bag {path}")
    assert text.endswith(".")
    assert "\n" not in text


@pytest.mark.parametrize(
    ("name", "reported"),
    [
        ("sea_2p5", "did you mean 'sea_2p5m'"),
        ("/no/such/bag", "there is no such file or name in bags/"),
        ("", "there is no such file or name in bags/"),
    ],
)
def test_a_name_that_is_none_is_answered(name, reported):
    with pytest.raises(BagError, match=re.escape(reported)):
        open_heave(name)


@pytest.mark.parametrize(
    "command",
    ["replay", "recover", "export --out t.csv", "alerts", "learn", "console", "view --out v.rrd"],
)
def test_a_bag_that_may_not_be_read_is_called_so(tmp_path, monkeypatch, capsys, command):
    """Not damaged, empty or unwritable; and so with a path that the system refuses."""
    bag = write_heave(tmp_path / "bag", swell(20))
    opened = Path.open

    def refused(path, *args, **kwargs):
        if path.suffix == ".mcap":
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))
        return opened(path, *args, **kwargs)

    monkeypatch.setattr(Path, "open", refused)
    monkeypatch.chdir(tmp_path)
    action, *options = command.split()
    for name, reported in (
        (str(bag), "bag_0.mcap cannot be read (Permission denied)"),
        (long := "x" * 300, f"{long} cannot be read (File name too long)"),
    ):
        assert main([action, name, *options]) == 1
        words = capsys.readouterr().err
        assert words == f"bag {name}: {reported}; check path and permissions.\n"


def test_a_wrong_topic_is_answered(tmp_path):
    bag = write_heave(tmp_path / "bag", swell(20))
    with pytest.raises(BagError, match="no topic 'ship/heav'; did you mean '/ship/heave'"):
        open_heave(bag, topic="ship/heav")
    with pytest.raises(
        BagError,
        match="/sea/elevation is a geometry_msgs/msg/PointStamped; "
        "heave must be a nav_msgs/msg/Odometry",
    ):
        open_heave(bag, topic="sea/elevation")
