"""A recorder that is held up: what waits is taken all the same, what ran over is counted."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from ros_bench import Bench

from rope_twin.messages import encode_heave
from rope_twin.recording.bag import BagReader

pytestmark = pytest.mark.ros
ROOM = 1000  # messages of a topic that wait in the middleware


def held_up_recorder(bench: Bench, directory: Path, count: int) -> Any:
    """A recorder that is not asked to spin while this many samples of heave are sent."""
    from rope_twin.ros.params import overrides
    from rope_twin.ros.recorder_node import RecorderNode

    node = bench.add(RecorderNode(parameter_overrides=overrides({"out": str(directory)})))
    node.begin()
    heave = bench.publisher("ship/heave")
    bench.until(lambda: heave.get_subscription_count() > 0, "the recorder listens")
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


def test_what_ran_over_is_counted_and_told(bench: Bench, tmp_path: Path) -> None:
    sent = 1 + ROOM + 250
    node = held_up_recorder(bench, tmp_path / "bag", sent)
    bench.until(lambda: node.received > ROOM, "what is left of them")
    assert node.lost == 250
    assert "250 messages missing" in node.status().message
    node.close()
    assert node.lost == 250
    assert len(heave_in(tmp_path / "bag")) == sent - 250
