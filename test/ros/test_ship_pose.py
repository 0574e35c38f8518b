"""The ship's pose over DDS: from a sea that knows it, and from outside."""

from __future__ import annotations

import time

import pytest
from ros_bench import Bench, ros_ahead_ns

from rope_twin.messages import encode_heave, encode_pose
from rope_twin.twin.motion.ship_motion import ShipPose

pytestmark = pytest.mark.ros
SCENE = "deep_tow_turn"


def test_a_way_is_fed_over_the_topic(bench: Bench) -> None:
    """The sea's node publishes ship/odometry; the hang-off moves east, nothing is refused."""
    node = bench.make("simulation", scene=SCENE)
    sea = bench.make("sea_state", scene=SCENE, lead_s=3.0)
    heard = bench.listen("ship/odometry")
    sea.begin()
    node.begin()
    bench.until(lambda: node.paced.last.node_position_m[0, 0] > 0.01, "the hang-off goes east")
    health = node.paced.last.inputs["heave"]
    assert health.accepted > 20
    assert health.refused == 0
    assert {message.header.frame_id for message in heard} == {"ship_mean"}
    assert {message.child_frame_id for message in heard} == {"ship"}


def test_a_pose_from_outside_moves_it_and_a_bad_one_does_not(bench: Bench) -> None:
    """Poses 1 m north; one not finite, one torn off and a heave are refused and reported."""
    node, publisher = bench.make("simulation", scene=SCENE), bench.publisher("ship/odometry")
    heave = bench.publisher("ship/heave")
    node.begin()
    bench.until(publisher.get_subscription_count, "the twin listens")

    def send(north: float) -> bytes:
        pose = ShipPose(0, (0.0, north, 0.0), (0.0, 0.0, 0.0))
        data = encode_pose(time.time_ns() + 50_000_000, pose)
        publisher.publish(data)
        return data

    def moved() -> bool:
        send(1.0)
        return bool(node.paced.last.node_position_m[0, 1] > 0.01)

    bench.until(moved, "the hang-off goes north")
    before = node.paced.last.inputs["heave"].refused
    half = send(float("nan"))[:200]

    def torn() -> bool:
        publisher.publish(half)
        rows = {row.name: row for row in node.paced.rows(ros_ahead_ns())}
        return int(rows["simulation: messages"].values["ship/odometry"]) > 0

    bench.until(lambda: node.paced.last.inputs["heave"].refused > before, "NaN is refused")
    bench.until(torn, "half a message is refused")
    before = node.paced.last.inputs["heave"].refused
    heave.publish(encode_heave(time.time_ns() + 50_000_000, 0.0, 0.0))
    bench.until(lambda: node.paced.last.inputs["heave"].refused > before, "heave is refused")
