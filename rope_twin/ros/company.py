"""Whether another twin is at work on our topics: each takes the other's sea and winch."""

from __future__ import annotations

import os
import time
from typing import Any

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from rope_twin.errors import InputError, phrase
from rope_twin.ros.qos import message_type, profile
from rope_twin.topics import BY_NAME

TOLD_BY = (
    "tension_top",
    "diagnostics",
)  # a twin that is paused still sends the second, once a second
LISTEN_S = 2.0


def refuse_company(node: Node) -> None:
    """For a run that has not begun; the node is one of its own, with all publishers made.

    A twin that was killed is known to the middleware for a while: only one that speaks counts.

    Raises:
        InputError: another twin publishes what we would.
    """
    if node.count_publishers(TOLD_BY[0]) > 1 and _speaks(node.get_namespace()):
        domain = os.environ.get("ROS_DOMAIN_ID", "0")
        what = "another twin is at work there, and each would take the other's sea and winch"
        raise InputError(
            phrase(f"ROS domain {domain}", what, "end it, or set another ROS_DOMAIN_ID")
        )


class Turns:
    """Whether the messages of one input come from several senders by turns: their samples mix.

    A sender that follows another for good, as after a restart, is none of them.
    """

    def __init__(self) -> None:
        self._heard: set[bytes] = set()
        self._newest = b""
        self.mixed = False

    def count(self, info: dict[str, Any]) -> None:
        """A message has come, with what the middleware tells of it."""
        sender = info["publisher_gid"]["data"]
        self.mixed = self.mixed or (sender != self._newest and sender in self._heard)
        self._heard.add(sender)
        self._newest = sender


def _speaks(namespace: str) -> bool:
    """Whether anything comes on the topics of a twin, while ours is still silent."""
    listener = rclpy.create_node("company", namespace=namespace)
    heard: list[bytes] = []
    for name in TOLD_BY:
        topic = BY_NAME[name]
        listener.create_subscription(
            message_type(topic), name, heard.append, profile(topic.qos), raw=True
        )
    executor = SingleThreadedExecutor()
    executor.add_node(listener)
    give_up = time.monotonic() + LISTEN_S
    while not heard and time.monotonic() < give_up:
        executor.spin_once(timeout_sec=0.1)
    executor.shutdown()
    listener.destroy_node()
    return bool(heard)
