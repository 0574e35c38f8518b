"""Messages that a recorder might miss: while it is held up, and before it takes over."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import pytest
from ros_bench import Bench

from rope_twin.messages import Level, encode_heave
from rope_twin.recording.bag import BagReader

pytestmark = pytest.mark.ros
ROOM = 1000  # messages of a topic that wait in the middleware


def connect(bench: Bench, publisher: Any, recorder: Any) -> None:
    """Wait until either knows the other; a sample that is sent before may be lost."""
    subscription = next(one for one in recorder.subscriptions if one.topic_name == "/ship/heave")
    bench.until(lambda: publisher.get_subscription_count() > 0, "the recorder is known")
    bench.until(lambda: subscription.get_publisher_count() > 0, "it knows the publisher")


def held_up_recorder(bench: Bench, directory: Path, count: int) -> Any:
    """A recorder that is not asked to spin while this many samples of heave are sent."""
    node = bench.make("recorder", out=str(directory))
    node.begin()
    heave = bench.publisher("ship/heave")
    connect(bench, heave, node)
    heave.publish(encode_heave(10**18, 0.0, 0.0))
    bench.until(lambda: node.received == 1, "the first sample")
    for k in range(1, count):
        heave.publish(encode_heave(10**18 + k * 50_000_000, 0.01 * (k % 7), 0.2))
    return node


def heave_in(directory: Path) -> list[bytes]:
    with BagReader(directory) as bag:
        return [data for _, data in bag.messages("/ship/heave")]


def test_what_waits_at_the_end_is_recorded(bench: Bench, tmp_path: Path) -> None:
    node = held_up_recorder(bench, tmp_path / "bag", 600)
    node.close()
    assert len(heave_in(tmp_path / "bag")) == 600
    assert node.lost == 0


def test_what_ran_over_is_counted_and_reported(
    bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    sent = 1 + ROOM + 250
    node = held_up_recorder(bench, tmp_path / "bag", sent)
    bench.until(lambda: node.received > ROOM, "what is left of them")
    assert node.lost == 250
    words = "250 messages missing in the bag: CPU overload, or the recorder was stopped"
    assert node.status().message == words
    assert node.status().level == Level.WARN
    minute_later = time.monotonic() + 60.0
    monkeypatch.setattr(time, "monotonic", lambda: minute_later)
    assert node.status().level == Level.OK, "a loss of long ago is no trouble of now"
    assert "250 messages missing" in node.status().message
    monkeypatch.undo()
    node.close()
    assert node.lost == 250
    assert len(heave_in(tmp_path / "bag")) == sent - 250


def test_a_recorder_that_takes_over_begins_with_what_it_heard_on_standby(
    bench: Bench, tmp_path: Path
) -> None:
    """A recorder that is killed has not written its last moment."""
    from rope_twin.ros.params import overrides
    from rope_twin.ros.recorder_node import RecorderNode

    bag, call = tmp_path / "bag", tmp_path / "call"
    given = overrides({"out": str(bag), "standby": str(call)})
    node = bench.add(RecorderNode(parameter_overrides=given))
    node.begin()
    heave = bench.publisher("ship/heave")
    connect(bench, heave, node)
    samples = [encode_heave(10**18 + k * 50_000_000, 0.01 * k, 0.2) for k in range(5)]
    for sample in samples[:3]:
        heave.publish(sample)
    bench.until(lambda: node.kept == 3, "it keeps them")
    assert not bag.exists()
    call.touch()
    bench.until(bag.exists, "it takes over")
    for sample in samples[3:]:
        heave.publish(sample)
    bench.until(lambda: node.received == 5, "and goes on")
    node.close()
    assert heave_in(bag) == samples
