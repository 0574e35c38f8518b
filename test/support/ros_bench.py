"""Nodes under test and a test node on one executor, with waits for conditions."""

from __future__ import annotations

import importlib
import socket
import time
from collections.abc import Callable
from typing import Any

# Every wait of these tests ends as soon as it may; this is only for one that would never end.
PATIENCE_S = 300.0
POLL_S = 0.01  # between two looks at a condition


def free_port() -> int:
    """Return a UDP port of this machine that is free now."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def stamp_ns(message: Any) -> int:
    """Return the header stamp of a message [ns]."""
    return int(message.header.stamp.sec) * 1_000_000_000 + int(message.header.stamp.nanosec)


def ros_ahead_ns() -> int:
    """Return ROS time less steady time now [ns]."""
    return time.time_ns() - time.monotonic_ns()


class Bench:
    """Nodes under test and a test node on one executor."""

    def __init__(self, number: int) -> None:
        import rclpy
        from rclpy.executors import SingleThreadedExecutor
        from rclpy.signals import SignalHandlerOptions

        rclpy.init(args=[], domain_id=number, signal_handler_options=SignalHandlerOptions.NO)
        self.executor = SingleThreadedExecutor()
        self.nodes: list[Any] = []
        self.own = self.add(rclpy.create_node("bench"))

    def add(self, node: Any) -> Any:
        self.nodes.append(node)
        self.executor.add_node(node)
        return node

    def make(self, name: str, **parameters: Any) -> Any:
        """Create a node of the suite by its name, unconfigured."""
        from rope_twin.ros.params import overrides

        module = importlib.import_module(f"rope_twin.ros.{name}_node")
        kind = getattr(module, f"{name.title().replace('_', '')}Node")
        return self.add(kind(parameter_overrides=overrides(parameters)))

    def remove(self, node: Any) -> None:
        """Destroy a node with its services and publishers."""
        self.executor.remove_node(node)
        self.nodes.remove(node)
        node.destroy_node()

    def listen(self, name: str, depth: int = 1000) -> list[Any]:
        """Return a list that receives the decoded messages of one of the suite's topics."""
        from rope_twin.messages import decode
        from rope_twin.ros.qos import message_type, profile
        from rope_twin.topics import BY_NAME, Qos

        heard: list[Any] = []
        topic = BY_NAME[name]
        self.own.create_subscription(
            message_type(topic),
            name,
            lambda data: heard.append(decode(name, data)),
            profile(topic.qos, 1 if topic.qos is Qos.LATCHED else depth),
            raw=True,
        )
        return heard

    def publisher(self, name: str) -> Any:
        """Create a publisher of one of the suite's topics."""
        from rope_twin.ros.qos import message_type, profile
        from rope_twin.topics import BY_NAME

        topic = BY_NAME[name]
        return self.own.create_publisher(message_type(topic), name, profile(topic.qos))

    def until(self, condition: Callable[[], Any], what: str, timeout_s: float = PATIENCE_S) -> None:
        """Spin until the condition holds; fail with `what` at the deadline."""
        deadline = time.monotonic() + timeout_s
        while not condition():
            assert time.monotonic() < deadline, f"not within {timeout_s:g} s: {what}"
            self._spin(POLL_S)

    def _spin(self, seconds: float) -> None:
        """Let all callbacks run for a while.

        A condition that publishes must not do so as often as callbacks run: each pass of the
        executor takes one message of any topic, and what waits for the twin would grow old.
        """
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0.0:
            self.executor.spin_once(timeout_sec=left)

    def close(self) -> None:
        import rclpy

        for node in reversed(self.nodes):
            if hasattr(node, "close"):
                node.close()
        self.executor.shutdown()
        for node in self.nodes:
            node.destroy_node()
        rclpy.try_shutdown()
