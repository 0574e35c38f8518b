"""From snapshots to bytes on the publisher's thread: in order, and one bad topic harms no other."""

from __future__ import annotations

import dataclasses
import time
from collections import defaultdict

import pytest
from ros_bench import PATIENCE_S

from rope_twin.messages import Encoder
from rope_twin.ros.paced_twin import Publisher
from rope_twin.scene.load import load_scene
from rope_twin.topics import SNAPSHOT_TOPICS
from rope_twin.twin.pacing import SnapshotQueue
from rope_twin.twin.snapshot import Snapshot
from rope_twin.twin.twin import Twin

EPOCH_NS = 10**18
SLOT_NS = 20_000_000


@pytest.fixture(scope="module")
def snapshots() -> list[Snapshot]:
    first = Twin(load_scene("shallow_lift")).snapshot()
    return [
        dataclasses.replace(first, step=2 * slot, stamp_ns=SLOT_NS * slot) for slot in range(1, 9)
    ]


def test_what_was_computed_before_the_stop_is_published_in_order(
    snapshots: list[Snapshot],
) -> None:
    heard: dict[str, list[bytes]] = defaultdict(list)
    handover = SnapshotQueue(100)
    publisher = Publisher(handover, lambda name, data: heard[name].append(data), snapshots[0])
    for snapshot in snapshots:
        handover.put(snapshot)
    publisher.start(EPOCH_NS)
    publisher.stop()
    assert publisher.error == ""
    encoder = Encoder(EPOCH_NS)
    for topic in SNAPSHOT_TOPICS:
        due = snapshots if topic.rate_hz == 50.0 else snapshots[1::2]
        assert heard[topic.name] == [encoder.encode(topic.name, snapshot) for snapshot in due]
    publisher.stop()  # harmless


def test_a_topic_that_fails_is_reported_and_harms_no_other(snapshots: list[Snapshot]) -> None:
    heard: dict[str, int] = defaultdict(int)

    def publish(name: str, data: bytes) -> None:
        if name == "ropes/nodes":
            raise OSError("no buffer space")
        heard[name] += 1

    handover = SnapshotQueue(100)
    publisher = Publisher(handover, publish, snapshots[0])
    publisher.start(EPOCH_NS)
    for snapshot in snapshots:
        handover.put(snapshot)
    deadline = time.monotonic() + PATIENCE_S
    while heard["ropes/markers"] < 4:
        assert time.monotonic() < deadline
        time.sleep(0.005)
    publisher.stop()
    assert publisher.error == "topic ropes/nodes: OSError: no buffer space"
    assert heard["ropes/tension_top"] == 8
