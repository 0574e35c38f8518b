"""Identity of the nodes that send messages, from the ROS graph."""

from __future__ import annotations

import time
from collections.abc import Iterable
from typing import Any

from rclpy.node import Node

ASK_AGAIN_S = 0.1  # minimum time between graph queries for the same publisher
MAX_SENDERS = 1000  # publishers that are remembered
_UNKNOWN = "_NODE_NAME_UNKNOWN_"  # name in the graph of a node that is not discovered yet


class Senders:
    """Names of the nodes that send messages, from the graph by the publisher's identity.

    A name is looked up once; a publisher that the graph does not know yet, or that belongs to no
    ROS node, has none.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._names: dict[bytes, str] = {}
        self._asked_s: dict[bytes, float] = {}  # time of the last unsuccessful query

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
        """Return the names of all nodes and publishers that currently publish on these topics."""
        ends = [end for one in topics for end in self._node.get_publishers_info_by_topic(one)]
        names = {self._called(end) for end in ends if end.node_name not in ("", _UNKNOWN)}
        return names | {publisher_name(bytes(end.endpoint_gid)) for end in ends}

    def _called(self, end: Any) -> str:
        name, own = str(end.node_name), self._node.get_namespace()
        return name if end.node_namespace == own else f"{end.node_namespace.rstrip('/')}/{name}"


def publisher_name(publisher: bytes) -> str:
    """Return the name of a publisher whose node is not known."""
    return f"publisher {publisher.hex()}"
