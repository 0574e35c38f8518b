"""The feed node over DDS: values and signs of instruments, refused lines, and the way back."""

from __future__ import annotations

import math
import os
import pty
import select
import time
import tty
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
import yaml
from feed_samples import DATA, SAMPLES, SETTINGS
from ros_bench import Bench, free_port, stamp_ns

from rope_twin.errors import InputError, SceneError
from rope_twin.feeds.configuration import FeedSettings
from rope_twin.feeds.instrument import LineSample, MotionSample
from rope_twin.feeds.line_faults import LineFaults
from rope_twin.feeds.readings import nmea
from rope_twin.feeds.transports import Address, UdpSink
from rope_twin.feeds.writers import writer
from rope_twin.messages import Level, encode_heave
from rope_twin.ros.feed_node import _Channel, _messages

pytestmark = pytest.mark.ros
S = 1_000_000_000
NAN = math.nan


def settings_file(folder: Path, **feeds: dict[str, Any]) -> str:
    path = folder / "feeds.yaml"
    path.write_text(yaml.safe_dump({"feeds": feeds}), "utf-8")
    return str(path)


def rows(diagnostics: list[Any], name: str) -> list[Any]:
    """Rows of the diagnostics of this name, oldest first."""
    return [row for message in diagnostics for row in message.status if row.name == name]


def values(row: Any) -> dict[str, str]:
    return {pair.key: pair.value for pair in row.values}


def test_a_winch_by_udp_and_a_motion_sensor_by_a_serial_line(bench: Bench, tmp_path: Path) -> None:
    ours, theirs = pty.openpty()
    tty.setraw(ours)
    tty.setraw(theirs)
    port = free_port()
    winch = {"format": "lci90", **SETTINGS["lci90"], "source": f"udp://127.0.0.1:{port}",
             "winch": "trawl"}  # fmt: skip
    ship = {"format": "smc", **SETTINGS["smc"], "source": f"serial:{os.ttyname(theirs)}@115200"}
    node = bench.make("feed", settings=settings_file(tmp_path, winch=winch, mru=ship))
    measured, heave = bench.listen("winch/measured"), bench.listen("ship/heave")
    diagnostics = bench.listen("diagnostics")
    node.begin()
    sink = UdpSink(Address("udp", "127.0.0.1", port))
    write_winch = writer(FeedSettings(**winch))
    write_ship = writer(FeedSettings(**ship))
    before_ns = time.time_ns()

    def both() -> bool:
        now_ns = time.time_ns()
        sink.send(write_winch(LineSample(now_ns, 50e3, 0.5, 1234.5, NAN)))
        os.write(ours, write_ship(MotionSample(now_ns, 1.0, -0.25, 0.02, 0.01, NAN)))
        return len(measured) > 3 and len(heave) > 3

    bench.until(both, "both are published")
    message = measured[-1]
    assert list(message.name) == ["trawl"]
    assert message.position[0] == pytest.approx(1234.5, abs=0.06)
    assert message.velocity[0] == pytest.approx(0.5, abs=1e-3)
    assert message.effort[0] == pytest.approx(50e3, abs=5.0)
    assert before_ns <= stamp_ns(measured[0]) <= time.time_ns()
    assert heave[-1].pose.pose.position.z == 1.0
    assert heave[-1].twist.twist.linear.z == -0.25
    sink.send(b"\x0101RD,2014-08-01T00:28:38.351,000\r\n")
    bench.until(
        lambda: (
            (found := rows(diagnostics, "feed: winch"))
            and values(found[-1]).get("refused: incomplete") == "1"
        ),
        "the cut line is counted",
    )
    bench.until(
        lambda: "silent for" in rows(diagnostics, "feed: winch")[-1].message, "silence is reported"
    )
    assert int(rows(diagnostics, "feed: winch")[-1].level) == 2
    sink.close()
    node.close()
    os.close(ours)
    os.close(theirs)


def test_a_record_is_published_with_its_spacing_and_its_end(bench: Bench, tmp_path: Path) -> None:
    path = tmp_path / "winch.txt"
    path.write_bytes(b"".join((DATA / "twnc.txt").read_bytes().splitlines(keepends=True)[:40]))
    winch = {"format": "lci90", **SETTINGS["lci90"], "tension_of": "motor"}
    node = bench.make("feed", settings=settings_file(tmp_path, winch=winch), source=str(path),
                      speed=4.0)  # fmt: skip
    measured, motor = bench.listen("winch/measured"), bench.listen("winch/motor_tension")
    node.begin()
    bench.until(lambda: node.finished and len(measured) == len(motor) == 40, "all of it")
    assert measured[0].position[0] == 34.0
    assert math.isnan(measured[0].effort[0])
    assert motor[0].effort[0] == pytest.approx(61 * 4.4482216152605)
    steps = [(stamp_ns(b) - stamp_ns(a)) * 1e-9 for a, b in pairwise(measured)]
    assert steps == pytest.approx([0.05] * 39, abs=0.004)


def test_a_file_as_fast_as_possible_loses_nothing(bench: Bench, tmp_path: Path) -> None:
    """More lines than the node lets wait."""
    winch = {"format": "lci90", **SETTINGS["lci90"], "stamp": "instrument"}
    write = writer(FeedSettings(**winch))
    count = 12_000
    lines = (write(LineSample(k * S // 20, 1e4, 0.5, 0.1 * k, NAN)) for k in range(1, count + 1))
    path = tmp_path / "winch.txt"
    path.write_bytes(b"".join(lines))
    node = bench.make("feed", settings=settings_file(tmp_path, winch=winch), source=str(path),
                      speed=0.0)  # fmt: skip
    node.begin()
    bench.until(lambda: node.finished, "its end")
    assert node.figures()["feeds"]["winch"]["accepted"] == count
    assert node.statuses()[0].values["lost by this node"] == "0"
    node.close()


def test_one_turn_takes_what_had_arrived_when_it_began(monkeypatch: pytest.MonkeyPatch) -> None:
    """A file as fast as possible refills the queue meanwhile."""
    winch = FeedSettings(**{"format": "lci90", **SETTINGS["lci90"], "source": "udp://:6224"})
    channel, taken = _Channel("winch", winch, 1.0, 0, LineFaults(), 0), []

    def take(*piece: Any) -> list[Any]:
        taken.append(piece)
        if len(taken) < 9:
            channel._put(*piece)
        return []

    monkeypatch.setattr(channel.instrument, "take", take)
    channel._put(SAMPLES["lci90"], S, True)
    assert channel.samples() == []
    assert len(taken) == 1
    channel.close()


def test_a_heading_that_is_lost_is_named() -> None:
    """A gyrocompass that fails while the ship turns: the yaw stands, and the row says so."""
    mru = {**SETTINGS["psxn"], "heave_of": "reference", "rest_heading_deg": 30.0,
           "source": "udp://:6224"}  # fmt: skip
    channel = _Channel("mru", FeedSettings(format="psxn", **mru), 1.0, 0, LineFaults(), 0)
    words = []
    for k, heading in enumerate([""] * 20 + ["40.00"] * 5 + [""] * 20):
        channel._put(nmea(f"PSXN,23,0.{k:02d},0.00,{heading},0.00"), k * S // 10, True)
        for sample in channel.samples():
            _messages(channel, sample)
        channel.heard_s = time.monotonic()  # the first fit imports for a while
        row = channel.status()
        words.append(row.message.partition("; ")[2])
        assert row.level is (Level.WARN if words[-1] else Level.OK)
    channel.close()
    assert words[19] == "no heading for 2 s, rest_heading_deg, 30°, is kept"
    assert words[24] == ""
    assert words[44] == "no heading for 2 s, the last one is kept"


def test_a_simulator_sends_what_a_feed_reads(bench: Bench, tmp_path: Path) -> None:
    """Winch and ship of a simulation, out as lines by UDP and a serial line, and back over DDS."""

    from rope_twin.messages import templates
    from rope_twin.messages.cdr import Template
    from rope_twin.ros.feed_node import FeedSimulator
    from rope_twin.ros.params import overrides

    ends = [pty.openpty() for _ in range(2)]  # two lines, joined by this test like by a cable
    for end in (one for pair in ends for one in pair):
        tty.setraw(end)
    (out, out_line), (back, back_line) = ends
    feeds = {
        "winch": {"format": "rcwd", **SETTINGS["rcwd"], "source": f"udp://127.0.0.1:{free_port()}"},
        "mru": {"format": "psxn", **SETTINGS["psxn"], "sentences": "23 24",
                "source": f"serial:{os.ttyname(back_line)}@38400"},
    }  # fmt: skip
    given = {"settings": settings_file(tmp_path, **feeds)}
    (tmp_path / "ship").mkdir()
    feeds["mru"]["source"] = f"serial:{os.ttyname(out_line)}@38400"
    sent = {"settings": settings_file(tmp_path / "ship", **feeds)}
    measured, heave = bench.listen("winch/measured"), bench.listen("ship/heave")
    node = bench.make("feed", **given)
    node.begin()
    simulator = bench.add(FeedSimulator(parameter_overrides=overrides(sent)))
    simulator.begin()
    length, tension = bench.publisher("ropes/length"), bench.publisher("ropes/tension_top")
    ship = bench.publisher("ship/heave")
    forms = {
        "tension": Template(templates.joint_state(["rope"], ("effort",))),
        "length": Template(templates.joint_state(["rope"], ("position", "velocity"))),
    }

    def returned() -> bool:
        now_ns = time.time_ns()
        stamp = dict(
            zip(("header.stamp.sec", "header.stamp.nanosec"), divmod(now_ns, S), strict=True)
        )
        tension.publish(forms["tension"].fill({**stamp, "effort": [120e3]}))
        length.publish(forms["length"].fill({**stamp, "position": [850.25], "velocity": [-0.5]}))
        if select.select([out], [], [], 0.0)[0]:
            os.write(back, os.read(out, 4096))
        own = len([one for one in heave if one.pose.pose.position.z == 0.75])
        if own < 2:
            ship.publish(encode_heave(now_ns, 0.75, 0.125))
        return bool(measured) and len(measured) > 2 and own >= 2

    bench.until(returned, "lines come back")
    message = measured[-1]
    assert (message.position[0], message.velocity[0]) == pytest.approx((850.25, -0.5), abs=1e-3)
    assert message.effort[0] == pytest.approx(120e3, abs=1.0)
    (sample,) = {(one.pose.pose.position.z, one.twist.twist.linear.z) for one in heave}
    assert sample == (0.75, 0.125)
    simulator.close()
    node.close()
    for end in (out, out_line, back, back_line):
        os.close(end)


def test_a_simulator_sends_motion_at_its_time(bench: Bench, tmp_path: Path) -> None:
    """A replay publishes it in advance; a sensor does not know the future."""
    from rope_twin.ros.feed_node import FeedSimulator
    from rope_twin.ros.params import overrides

    mru = {"format": "psxn", **SETTINGS["psxn"], "source": str(tmp_path / "lines.txt")}
    given = {"settings": settings_file(tmp_path, mru=mru)}
    node = bench.add(FeedSimulator(parameter_overrides=overrides(given)))
    node.begin()
    ship = bench.publisher("ship/heave")
    bench.until(ship.get_subscription_count, "somebody listens")
    at_ns = time.time_ns() + S
    ship.publish(encode_heave(at_ns, 0.75, 0.125))
    bench.until(lambda: node.sent, "it is sent")
    assert time.time_ns() >= at_ns
    node.close()
    assert b"$PSXN,23,0.00,0.00,0.00,-0.750*" in (tmp_path / "lines.txt").read_bytes()


@pytest.mark.parametrize(
    ("change", "error", "words"),
    [
        ({"settings": ""}, InputError, "name a file or one of config/feeds/"),
        ({"source": "/no/such/file"}, InputError, "no such file"),
        ({"feed": "crane"}, InputError, "feed 'crane'"),
        ({"settings": "/no/such.yaml"}, InputError, "no such file or name"),
    ],
)
def test_what_cannot_be_read_is_refused(
    bench: Bench, tmp_path: Path, change: dict[str, str], error: type[Exception], words: str
) -> None:
    winch = {"format": "lci90", **SETTINGS["lci90"], "source": "udp://127.0.0.1:6224"}
    given = {"settings": settings_file(tmp_path, winch=winch), **change}
    with pytest.raises(error, match=words):
        bench.make("feed", **given).begin()


def test_settings_without_a_unit_are_refused(bench: Bench, tmp_path: Path) -> None:
    winch = {"format": "lci90", **SETTINGS["lci90"], "units": {"payout": "m", "speed": "m/min"}}
    with pytest.raises(SceneError, match="units has no tension; there is no default"):
        bench.make("feed", settings=settings_file(tmp_path, winch=winch)).begin()
