"""Whether another twin is at work on our topics: each takes the other's sea and winch.

A run that works is heard. Of runs that begin at the same moment none is heard yet: on one machine
the one goes on that has taken the domain's seat.
"""

from __future__ import annotations

import errno
import os
import socket
import time
from collections.abc import Callable, Iterable
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
ASK_AGAIN_S = 0.1  # how often the graph is asked for the name of the same publisher
MAX_SENDERS = 1000  # publishers that are remembered
_UNKNOWN = "_NODE_NAME_UNKNOWN_"  # what the graph calls a node that it has not heard of yet


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


class Senders:
    """Names of the nodes behind messages, from the graph by the publisher's identity.

    A name is found once; a publisher that the graph does not know yet, or that belongs to no ROS
    node, has none.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._names: dict[bytes, str] = {}
        self._asked_s: dict[bytes, float] = {}  # when the graph was asked in vain

    def name(self, topic: str, info: dict[str, Any]) -> str:
        """Name of the node that has sent a message; with its namespace if that is not ours.

        Returns:
            "" while it is not known.
        """
        publisher = info["publisher_gid"]["data"]
        found = self._names.get(publisher, "")
        now_s = time.monotonic()
        if found or now_s < self._asked_s.get(publisher, 0.0) + ASK_AGAIN_S:
            return found
        if len(self._names) + len(self._asked_s) > MAX_SENDERS:
            self._names.clear()
            self._asked_s.clear()
        self._asked_s[publisher] = now_s
        for end in self._node.get_publishers_info_by_topic(topic):
            if end.node_name not in ("", _UNKNOWN):
                self._names[bytes(end.endpoint_gid)] = self._called(end)
        return self._names.get(publisher, "")

    def present(self, topics: Iterable[str]) -> set[str]:
        """Names of all nodes that publish on any of these topics now, and of each publisher."""
        ends = [end for one in topics for end in self._node.get_publishers_info_by_topic(one)]
        names = {self._called(end) for end in ends if end.node_name not in ("", _UNKNOWN)}
        return names | {publisher_name(bytes(end.endpoint_gid)) for end in ends}

    def _called(self, end: Any) -> str:
        name, own = str(end.node_name), self._node.get_namespace()
        return name if end.node_namespace == own else f"{end.node_namespace.rstrip('/')}/{name}"


def publisher_name(publisher: bytes) -> str:
    """Name of a publisher whose node is not known."""
    return f"publisher {publisher.hex()}"


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
