"""QoS profiles and message types of the topic table as rclpy objects, and the senders of messages.

Senders are identified by the ROS graph.
"""

from __future__ import annotations

import importlib
import time
from collections.abc import Callable, Iterable, Iterator
from typing import Any

from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from rope_twin.ros.middleware import rmw_name
from rope_twin.topics import QOS_ROWS, Qos, Topic


def profile(qos: Qos, depth: int | None = None) -> QoSProfile:
    """Return the rclpy profile; a subscriber that must not lose a message needs more `depth`."""
    row = QOS_ROWS[qos]
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=row.depth if depth is None else depth,
        reliability=ReliabilityPolicy.RELIABLE if row.reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL
        if row.for_late_joiners
        else DurabilityPolicy.VOLATILE,
    )


def message_type(topic: Topic) -> Any:
    """Return the rclpy class of a topic's messages, such as std_msgs.msg.Float64."""
    package, _, name = topic.type_name.split("/")
    return getattr(importlib.import_module(f"{package}.msg"), name)


def unsuited(node: Any, topic: Topic) -> bool:
    """Return whether a subscriber of one of our topics requests more than its QoS offers."""
    row = QOS_ROWS[topic.qos]
    profiles = [end.qos_profile for end in node.get_subscriptions_info_by_topic(topic.name)]
    return any(
        (profile.reliability == ReliabilityPolicy.RELIABLE and not row.reliable)
        or (profile.durability == DurabilityPolicy.TRANSIENT_LOCAL and not row.for_late_joiners)
        for profile in profiles
    )


def unheard_publishers(node: Any, topic: Topic) -> list[str]:
    """Return in words the incompatible publishers of one of our inputs, and why they are."""
    row = QOS_ROWS[topic.qos]
    mismatches = []
    for end in node.get_publishers_info_by_topic(topic.name):
        offered = end.qos_profile
        reason = ""
        if end.topic_type != topic.type_name:
            reason = f"publishes {end.topic_type}, expected {topic.type_name}"
        elif row.reliable and offered.reliability == ReliabilityPolicy.BEST_EFFORT:
            reason = "offers best effort, requested is reliable"
        elif row.for_late_joiners and offered.durability == DurabilityPolicy.VOLATILE:
            reason = "offers volatile, requested is transient local"
        if reason:
            mismatches.append(f"node {end.node_name} {reason}")
    return mismatches


def asked_of(topic: Topic) -> str:
    """Return in words the QoS that an input requests."""
    row = QOS_ROWS[topic.qos]
    durability = "transient local" if row.for_late_joiners else "volatile"
    return f"{'reliable' if row.reliable else 'best effort'}, {durability}, depth {row.depth}"


def publish(node: Any, topic: Topic) -> Any:
    """Return a new publisher of a topic, which takes messages or their bytes.

    It has no QoS events; `unsuited` finds incompatible subscribers. rclpy's executor checks two
    events of every publisher each time it wakes, which would take two thirds of its time here.
    """
    quiet = PublisherEventCallbacks(use_default_callbacks=False)
    return node.create_publisher(
        message_type(topic), topic.name, profile(topic.qos), event_callbacks=quiet
    )


def listen(node: Any, topic: Topic, take: Callable[..., None], depth: int | None = None) -> Any:
    """Return a new subscription that hands the bytes of each message to `take`.

    It has no QoS events either: the simulation reports incompatibilities. `depth`: as in `profile`.
    """
    return node.create_subscription(
        message_type(topic),
        topic.name,
        take,
        profile(topic.qos, depth),
        raw=True,
        event_callbacks=SubscriptionEventCallbacks(use_default_callbacks=False),
    )


ASK_AGAIN_S = 0.1  # minimum time between graph queries for the same publisher
MAX_SENDERS = 1000  # publishers that are remembered
NAMELESS_S = 3.0  # a publisher without a node for so long belongs to none
_PUBLISHER = "publisher "  # begins the name of one whose node is not known
_DDS, _PARTICIPANT = ("rmw_fastrtps_cpp", "rmw_cyclonedds_cpp"), 12
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
        self._nameless_s: dict[bytes, float] = {}  # time since when a publisher has no name

    def name(self, topic: str, info: dict[str, Any]) -> str:
        """Name of the node that has sent a message; with its namespace if that is not ours.

        Returns:
            "" while it is not known.
        """
        publisher = info["publisher_gid"]["data"]
        known = self._names.get(publisher, "")
        now_s = time.monotonic()
        if known or now_s < self._asked_s.get(publisher, 0.0) + ASK_AGAIN_S:
            return known
        if len(self._names) + len(self._asked_s) > MAX_SENDERS:
            self._names.clear()
            self._asked_s.clear()
        self._asked_s[publisher] = now_s
        self._look_up((topic,))
        return self._names.get(publisher, "")

    def node_of(self, publisher: str, topics: Iterable[str]) -> str:
        """Return the name of the node of a publisher on these topics.

        publisher: by `publisher_name`; "" for any other, and while the node is not known.
        """
        _, nameless, gid = publisher.partition(_PUBLISHER)
        if nameless and bytes.fromhex(gid) not in self._names:
            self._look_up(topics)
        return self._names.get(bytes.fromhex(gid), "")

    def _look_up(self, topics: Iterable[str]) -> None:
        """Take the names of the nodes that publish on these topics from the graph."""
        self._names.update((gid, name) for gid, name in self._publishers(topics) if name)

    def present(self, topics: Iterable[str]) -> set[str]:
        """Return the names of all nodes and publishers that currently publish on these topics."""
        publishers = list(self._publishers(topics))
        return {name for _, name in publishers if name} | {
            publisher_name(gid) for gid, _ in publishers
        }

    def others(self, topics: Iterable[str]) -> list[str]:
        """Return the names of other nodes and publishers that currently publish on these topics.

        The graph knows a publisher before the node that it belongs to, as of a node that has just
        started again: it counts once it has had no name for NAMELESS_S.
        """
        now_s, names, nameless = time.monotonic(), set(), dict[bytes, float]()
        for gid, name in self._publishers(topics):
            if name:
                names.add(name)
                continue
            nameless[gid] = self._nameless_s.get(gid, now_s)
            if now_s - nameless[gid] >= NAMELESS_S:
                names.add(publisher_name(gid))
        self._nameless_s = nameless
        return sorted(names - {self._node.get_name()})

    def _publishers(self, topics: Iterable[str]) -> Iterator[tuple[bytes, str]]:
        """Yield identity and node of each publisher on these topics; "": its node is not known.

        A process that was stopped for longer than the lease of DDS finds all others again, but
        their nodes stay nameless in its graph: a publisher keeps the name that it had.
        """
        namespace = self._node.get_namespace()
        for end in (
            end for topic in topics for end in self._node.get_publishers_info_by_topic(topic)
        ):
            publisher = bytes(end.endpoint_gid)
            if end.node_name == _UNKNOWN:
                yield publisher, self._names.get(publisher, "")
                continue
            name = str(end.node_name)
            if name and end.node_namespace != namespace:
                name = f"{end.node_namespace.rstrip('/')}/{name}"
            yield publisher, name


def process_of(publisher: bytes) -> bytes | None:
    """Return what the publishers of one process have in common; None: the middleware hides it.

    With DDS their identities begin with that of the participant; a process has one.
    """
    return publisher[:_PARTICIPANT] if rmw_name() in _DDS else None


def publisher_name(publisher: bytes) -> str:
    """Return the name of a publisher whose node is not known."""
    return f"{_PUBLISHER}{publisher.hex()}"
