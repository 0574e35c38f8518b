"""The topic table's rows of quality of service, and its types, in rclpy's terms."""

from __future__ import annotations

import importlib
from typing import Any

from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from rope_twin.topics import QOS_ROWS, Qos, Topic


def profile(qos: Qos, depth: int | None = None) -> QoSProfile:
    """The profile of a row; a listener that must not lose anything asks for more `depth`."""
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
    """The rclpy class of a topic's messages, such as std_msgs.msg.Float64."""
    package, _, name = topic.type_name.split("/")
    return getattr(importlib.import_module(f"{package}.msg"), name)


def unsuited(node: Any, topic: Topic) -> bool:
    """Whether somebody listens to one of our topics and asks for more than it offers."""
    row = QOS_ROWS[topic.qos]
    asked = [end.qos_profile for end in node.get_subscriptions_info_by_topic(topic.name)]
    return any(
        (one.reliability == ReliabilityPolicy.RELIABLE and not row.reliable)
        or (one.durability == DurabilityPolicy.TRANSIENT_LOCAL and not row.for_late_joiners)
        for one in asked
    )


def unheard_publishers(node: Any, topic: Topic) -> list[str]:
    """Return who publishes to one of our inputs what it cannot take, and why, in words."""
    row = QOS_ROWS[topic.qos]
    found = []
    for end in node.get_publishers_info_by_topic(topic.name):
        offered = end.qos_profile
        why = ""
        if end.topic_type != topic.type_name:
            why = f"publishes {end.topic_type} where {topic.type_name} is wanted"
        elif row.reliable and offered.reliability == ReliabilityPolicy.BEST_EFFORT:
            why = "offers best effort where reliable is asked for"
        elif row.for_late_joiners and offered.durability == DurabilityPolicy.VOLATILE:
            why = "offers volatile where transient local is asked for"
        if why:
            found.append(f"node {end.node_name} {why}")
    return found


def asked_of(topic: Topic) -> str:
    """Return the QoS that an input asks for, in words."""
    row = QOS_ROWS[topic.qos]
    kept = "transient local" if row.for_late_joiners else "volatile"
    return f"{'reliable' if row.reliable else 'best effort'}, {kept}, depth {row.depth}"


def quiet_publisher() -> PublisherEventCallbacks:
    """For publishers: `unsuited` looks for listeners that their quality of service does not suit.

    rclpy's executor asks after two events of every publisher each time that it wakes, which in this
    suite would take two thirds of its time.
    """
    return PublisherEventCallbacks(use_default_callbacks=False)


def quiet_listener() -> SubscriptionEventCallbacks:
    """For listeners beside the simulation, which tells who publishes to it what it cannot take."""
    return SubscriptionEventCallbacks(use_default_callbacks=False)
