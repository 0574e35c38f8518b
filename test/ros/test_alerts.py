"""Alerts over DDS: raised by the suite, acknowledged by word and by sentence, recorded, counted."""

from __future__ import annotations

import json
import socket
from pathlib import Path
from typing import Any

import pytest
from ros_bench import Bench
from small_scene import SMALL_SCENE

from rope_twin.cli import ExitCode, main
from rope_twin.feeds.readings import nmea
from rope_twin.messages import Level, Status, encode_diagnostics
from rope_twin.messages.cdr import encode_text
from rope_twin.ros.alert_output_node import AlertOutputNode

pytestmark = pytest.mark.ros


def states(message: Any) -> dict[str, str]:
    """Return the state of each alert of a message, by identifier."""
    rows = ({pair.key: pair.value for pair in one.values} for one in message.status)
    return {row["identifier"]: row["state"] for row in rows}


def supervision(heard: list[Any]) -> str:
    """Return the text of the alert of supervision in the newest list; "": there is none."""
    found = [one.message for one in heard[-1].status if one.name.startswith("10015.")]
    return str(found[0]) if heard and found else ""


def test_the_crew_sees_a_recorder_in_trouble_or_silent(bench: Bench, tmp_path: Path) -> None:
    scene = tmp_path / "small.yaml"
    scene.write_text(SMALL_SCENE)
    heard, recorder = bench.listen("alerts"), bench.publisher("diagnostics")
    bench.make("simulation", scene=str(scene), speed=5.0, wait_for="alerts").begin()
    full = Status("recorder: bag", Level.ERROR, "the disk is full")

    def reported() -> bool:
        recorder.publish(encode_diagnostics(0, [full]))
        return bool(heard) and supervision(heard) == "the disk is full"

    bench.until(reported, "its trouble")
    bench.until(lambda: "silent for" in supervision(heard), "its silence")


def test_an_alert_over_topics_and_sentences(
    bench: Bench, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scene = tmp_path / "limited.yaml"
    scene.write_text(SMALL_SCENE + "limits: {tension_n: 50000.0}\n")  # the rope bears 74 kN
    bridge = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    bridge.bind(("127.0.0.1", 0))
    bridge.setblocking(False)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        replies = free.getsockname()[1]
    output = bench.add(AlertOutputNode("127.0.0.1", bridge.getsockname()[1], replies))
    output.begin()
    recorder = bench.make("recorder", out=str(tmp_path / "bag"))
    recorder.begin()
    heard = bench.listen("alerts")
    commands = bench.publisher("alerts/command")
    node = bench.make("simulation", scene=str(scene), wait_for="alerts ropes/nodes")
    node.begin()
    bench.until(
        lambda: heard and states(heard[-1]).get("10001") == "unacknowledged", "an alarm of tension"
    )
    sentences: list[bytes] = []

    def arrived(what: bytes) -> bool:
        try:
            while True:
                sentences.append(bridge.recv(4096))
        except BlockingIOError:
            return any(what in one for one in sentences)

    bench.until(lambda: arrived(b",A,A,V,RPT,10001,1,1,0,top tension"), "its sentence")
    commands.publish(encode_text("silence 10001.1"))
    bench.until(lambda: states(heard[-1])["10001"] == "silenced", "silence")
    bench.until(lambda: arrived(b",A,A,S,RPT,10001,1,2,"), "its sentence")
    for sentence in (nmea("BNACN,120000.00,RPT,10001,1,A,C"), nmea("BNACN,,RPT,10999,1,A,C")):
        bridge.sendto(sentence, ("127.0.0.1", replies))
    bench.until(lambda: states(heard[-1])["10001"] == "acknowledged", "acknowledgement")
    bench.until(lambda: arrived(b"IIARC,"), "a refusal of what there is not")
    assert (output.taken, output.refused) == (1, 1)
    commands.publish(encode_text("nonsense"))
    bench.until(lambda: node.paced.last.stamp_ns > 1_500_000_000, "it runs on")
    for one in (node, recorder, output):
        one.close()
    bridge.close()
    assert main(["alerts", str(tmp_path / "bag"), "--json"]) == ExitCode.OK
    found = json.loads(capsys.readouterr().out)
    (alarm,) = (one for one in found["alerts"] if one["key"] == "10001.1")
    assert alarm["priority"] == "alarm"
    assert alarm["acknowledged_after_s"] > 0.0
