"""QoS profiles and message types of the topic table as rclpy objects."""

from __future__ import annotations

import importlib
from typing import Any

from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

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
    asked = [end.qos_profile for end in node.get_subscriptions_info_by_topic(topic.name)]
    return any(
        (one.reliability == ReliabilityPolicy.RELIABLE and not row.reliable)
        or (one.durability == DurabilityPolicy.TRANSIENT_LOCAL and not row.for_late_joiners)
        for one in asked
    )


def unheard_publishers(node: Any, topic: Topic) -> list[str]:
    """Return in words the incompatible publishers of one of our inputs, and why they are."""
    row = QOS_ROWS[topic.qos]
    found = []
    for end in node.get_publishers_info_by_topic(topic.name):
        offered = end.qos_profile
        why = ""
        if end.topic_type != topic.type_name:
            why = f"publishes {end.topic_type}, expected {topic.type_name}"
        elif row.reliable and offered.reliability == ReliabilityPolicy.BEST_EFFORT:
            why = "offers best effort, requested is reliable"
        elif row.for_late_joiners and offered.durability == DurabilityPolicy.VOLATILE:
            why = "offers volatile, requested is transient local"
        if why:
            found.append(f"node {end.node_name} {why}")
    return found


def asked_of(topic: Topic) -> str:
    """Return in words the QoS that an input requests."""
    row = QOS_ROWS[topic.qos]
    kept = "transient local" if row.for_late_joiners else "volatile"
    return f"{'reliable' if row.reliable else 'best effort'}, {kept}, depth {row.depth}"


def quiet_publisher() -> PublisherEventCallbacks:
    """Return publisher callbacks without QoS events; `unsuited` finds incompatible subscribers.

    rclpy's executor checks two events of every publisher each time it wakes, which would take two
    thirds of its time in this suite.
    """
    return PublisherEventCallbacks(use_default_callbacks=False)


def quiet_listener() -> SubscriptionEventCallbacks:
    """Return subscriber callbacks without QoS events; the simulation reports incompatibilities."""
    return SubscriptionEventCallbacks(use_default_callbacks=False)
