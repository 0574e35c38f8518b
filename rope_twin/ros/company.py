"""Whether another twin is at work on our topics: each takes the other's sea and winch.

A run that works is heard. Of runs that begin at the same moment none is heard yet: on one machine
the one goes on that has taken the domain's seat.
"""

from __future__ import annotations

import errno
import os
import socket
import time
from collections.abc import Callable
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


class Seat:
    """The place of one run in a namespace of a ROS domain, on this machine.

    A name that the kernel gives to one socket at a time, and takes back when its process ends,
    however that ends.
    """

    def __init__(self, domain: str, namespace: str) -> None:
        self._name = f"\0rope_twin/{domain}{namespace}"
        self._socket: socket.socket | None = None

    def take(self, patience_s: float = 0.0) -> bool:
        """Take it, waiting so long for who is about to leave; whether it is ours, or nobody's."""
        return _until(self._try, patience_s)

    def leave(self) -> None:
        """Let others have it. Harmless when called twice."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def _try(self) -> bool:
        found = socket.socket(socket.AF_UNIX)
        try:
            found.bind(self._name)
        except OSError as error:  # a system without such names has no seats either
            found.close()
            return error.errno != errno.EADDRINUSE
        self._socket = found
        return True


def refuse_company(node: Node) -> Seat:
    """For a run that has not begun; the node is one of its own, with all publishers made.

    A twin that was killed is known to the middleware for a while: only one that speaks counts, or
    one that has the seat. Who has the seat and is not in sight hears nothing of us either.

    Returns:
        The seat, to be left when the run has ended.

    Raises:
        InputError: another twin publishes what we would.
    """
    domain, namespace = os.environ.get("ROS_DOMAIN_ID", "0"), node.get_namespace()
    seat = Seat(domain, namespace)
    alone = seat.take(LISTEN_S)
    in_sight = _until(lambda: node.count_publishers(TOLD_BY[0]) > 1, 0.0 if alone else LISTEN_S)
    if in_sight and not (alone and _is_silent(namespace)):
        seat.leave()
        what = "another twin is at work there, and each would take the other's sea and winch"
        raise InputError(
            phrase(f"ROS domain {domain}", what, "end it, or set another ROS_DOMAIN_ID")
        )
    return seat


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


def _until(holds: Callable[[], bool], patience_s: float) -> bool:
    """Wait until it holds, so long at most; whether it does."""
    give_up = time.monotonic() + patience_s
    while not (found := holds()) and time.monotonic() < give_up:
        time.sleep(0.1)
    return found


def _is_silent(namespace: str) -> bool:
    """Whether nothing comes on the topics of a twin, while ours is still silent."""
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
    return not heard
