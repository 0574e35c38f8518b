"""Ship motion over DDS: nothing comes, of another type, by another clock, or in simulated time."""

from __future__ import annotations

import math
import time
from typing import Any

import pytest
from ros_bench import Bench, ros_ahead_ns

from rope_twin.messages import Level, Status, encode_heave

pytestmark = pytest.mark.ros
OMEGA = 2.0 * math.pi / 9.0


def simulation(bench: Bench, **parameters: Any) -> Any:
    """A simulation node of a scene whose sea moves the ship."""
    return bench.make("simulation", scene="shallow_lift", **parameters)


def heave_row(node: Any) -> Status:
    (row,) = [
        row for row in node.paced.rows(ros_ahead_ns()) if row.name == "simulation: input heave"
    ]
    return row


def reported(heard: list[Any], name: str) -> Any:
    """The newest row of that name in the diagnostics."""
    rows = [row for message in heard for row in message.status if row.name == name]
    return rows[-1] if rows else None


def test_motion_that_never_comes_is_an_error_with_topic_domain_and_qos(bench: Bench) -> None:
    """After 3 s; who publishes another type on the topic is named."""
    import rclpy
    from geometry_msgs.msg import PoseStamped
    from rclpy.context import Context

    domain = bench.own.context.get_domain_id()
    apart = Context()  # one participant has one type for a topic
    rclpy.init(args=[], context=apart, domain_id=domain)
    stranger = rclpy.create_node("stranger", context=apart)
    stranger.create_publisher(PoseStamped, "ship/odometry", 1)
    node = simulation(bench)
    heard = bench.listen("diagnostics")
    node.begin()

    def message() -> str:
        row = reported(heard, "simulation: input heave")
        return row.message if row is not None and Level(row.level) is Level.ERROR else ""

    bench.until(lambda: "stranger" in message(), "an error", timeout_s=20.0)
    assert message().startswith("nothing has come for ")
    assert f"/ship/heave or /ship/odometry in ROS domain {domain}" in message()
    assert "QoS best effort, volatile, depth 50" in message()
    assert "node stranger publishes geometry_msgs/msg/PoseStamped" in message()
    stranger.destroy_node()
    apart.shutdown()


def test_a_best_effort_commander_is_named(bench: Bench) -> None:
    """Reliable is asked for: it would never be heard."""
    from rclpy.qos import QoSProfile, ReliabilityPolicy
    from sensor_msgs.msg import JointState

    node = simulation(bench)
    qos = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
    deaf = bench.own.create_publisher(JointState, "winch/speed_command", qos)
    heard = bench.listen("diagnostics")
    node.begin()

    def named() -> bool:
        row = reported(heard, "simulation: sources")
        words = "winch/speed_command: node"
        return row is not None and words in row.message and "best effort" in row.message

    bench.until(named, "it is named")
    bench.own.destroy_publisher(deaf)


@pytest.mark.parametrize("clock_s", [0.0, 1.5])
def test_the_senders_clock_is_measured_by_arrival(bench: Bench, clock_s: float) -> None:
    """A live sensor: its stamps lie as far ahead of their arrival as its clock does."""
    node, publisher = simulation(bench), bench.publisher("ship/heave")
    node.begin()
    bench.until(publisher.get_subscription_count, "the twin listens")
    values: dict[str, str] = {}
    level = Level.OK

    def sent() -> bool:
        nonlocal level
        now_ns = time.time_ns()
        t = now_ns * 1e-9 % 900.0
        z, v = 0.3 * math.sin(OMEGA * t), 0.3 * OMEGA * math.cos(OMEGA * t)
        publisher.publish(encode_heave(now_ns + round(clock_s * 1e9), z, v))
        row = heave_row(node)
        values.update(row.values)
        level = row.level
        return "arrival less stamp [s]" in values

    bench.until(sent, "enough samples")
    assert float(values["arrival less stamp [s]"]) == pytest.approx(-clock_s, abs=0.15)
    assert (level is Level.ERROR) == (clock_s > 1.0)


def test_the_epoch_waits_for_the_first_clock(bench: Bench) -> None:
    """With use_sim_time nothing begins at time 0; the state says what is awaited."""
    from rosgraph_msgs.msg import Clock

    node = simulation(bench, use_sim_time=True)
    heard, epochs = bench.listen("diagnostics"), bench.listen("twin/epoch")
    node.begin()
    assert node.get_parameter("use_sim_time").value is True

    def waits() -> bool:
        row = reported(heard, "simulation: state")
        return row is not None and "first message on /clock" in row.message

    bench.until(waits, "it says what it waits for")
    assert not epochs
    assert node.paced.border.epoch_ns is None
    clock = bench.own.create_publisher(Clock, "/clock", 10)
    message = Clock()
    message.clock.sec = 500

    def begun() -> bool:
        clock.publish(message)
        return bool(epochs)

    bench.until(begun, "the epoch comes")
    assert 500 <= epochs[0].sec <= 502
    bench.own.destroy_publisher(clock)
