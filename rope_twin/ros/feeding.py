"""What the two feeding nodes share: they follow the twin's epoch and publish what is due."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.node import Node

from rope_twin.errors import phrase
from rope_twin.ros.company import Senders
from rope_twin.ros.feed import Feed
from rope_twin.ros.qos import message_type, profile, quiet_publisher
from rope_twin.topics import BY_NAME

_PERIOD_S, _LEAST_PERIOD_S = 0.04, 0.005
EPOCH_TOPIC = "twin/epoch"
# How far from now an epoch may lie: a twin begins within seconds, or goes on from a saved state.
EPOCH_AHEAD_S, EPOCH_BACK_S = 60.0, 3.2e7
_MAX_EPOCHS = 16  # senders whose epochs wait to be judged, and warnings of them


class FeedingNode(Node, ABC):
    """A node whose `publish_stretch` is called for each stretch of twin time, once and in order."""

    def __init__(self, name: str, **node_options: Any) -> None:
        super().__init__(name, **node_options)
        self._feed: Feed | None = None
        self._own_publishers: dict[str, Any] = {}
        self._senders = Senders(self)
        self._simulation = ""  # name of the node whose epoch is followed
        self._epochs: dict[bytes, tuple[int, dict[str, Any]]] = {}  # not judged yet, by publisher
        self._warned: set[str] = set()

    @property
    def finished(self) -> bool:
        """A feeding node has no end of its own."""
        return False

    def close(self) -> None:
        """Stop feeding."""
        self._feed = None

    @abstractmethod
    def publish_stretch(self, epoch_ns: int, from_ns: int, to_ns: int) -> None:
        """Publish all samples with from_ns <= stamp < to_ns (twin time), stamped epoch + stamp."""

    def start_feeding(
        self, topics: tuple[str, ...], lead_s: float, speed: float, first_ns: int = 0
    ) -> None:
        """Make the publishers and look often what is due, beginning at `first_ns`.

        Who feeds a twin then calls `await_epoch` or, to begin at once, `follow_epoch`.
        """
        for name in topics:
            topic = BY_NAME[name]
            self._own_publishers[name] = self.create_publisher(
                message_type(topic), name, profile(topic.qos), event_callbacks=quiet_publisher()
            )
        self._feed = Feed(lead_s, speed, first_ns)
        period_s = max(_LEAST_PERIOD_S, _PERIOD_S / max(1.0, speed))
        self.create_timer(period_s, self._look, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def await_epoch(self, simulation: str) -> None:
        """Follow the node of this name when it says when its t = 0 is, also one started later."""
        self._simulation = simulation
        epoch = BY_NAME[EPOCH_TOPIC]
        self.create_subscription(message_type(epoch), epoch.name, self._follow, profile(epoch.qos))

    def follow_epoch(self, epoch_ns: int) -> None:
        """Feed a twin whose t = 0 is at this ROS time."""
        if self._feed is not None:
            now_ns = self.get_clock().now().nanoseconds
            self._feed.follow(epoch_ns, now_ns, time.monotonic_ns())

    def publishes(self, name: str) -> bool:
        """Whether it has a publisher of a topic."""
        return name in self._own_publishers

    def send(self, name: str, data: bytes) -> None:
        """Publish the bytes of a message."""
        self._own_publishers[name].publish(data)

    def _follow(self, message: Any, info: dict[str, Any]) -> None:
        """Follow an epoch, at once or as soon as it is known who has sent it."""
        epoch_ns = message.sec * 1_000_000_000 + message.nanosec
        if len(self._epochs) < _MAX_EPOCHS:
            self._epochs[info["publisher_gid"]["data"]] = epoch_ns, info
        self._look()

    def _judge_epochs(self) -> None:
        """Follow what the simulation has said; refuse other senders and impossible times."""
        now_ns = self.get_clock().now().nanoseconds
        if now_ns == 0:
            return  # simulated time that has not begun
        for publisher, (epoch_ns, info) in list(self._epochs.items()):
            sender = self._senders.name(EPOCH_TOPIC, info)
            if not sender:
                continue
            del self._epochs[publisher]
            ahead_s = (epoch_ns - now_ns) * 1e-9
            if sender != self._simulation:
                what = f"an epoch of node {sender} is ignored"
                self._warn_once(phrase(EPOCH_TOPIC, what, f"only {self._simulation} sets it"))
            elif not -EPOCH_BACK_S <= ahead_s <= EPOCH_AHEAD_S:
                right = f"it must lie {EPOCH_BACK_S:g} s back to {EPOCH_AHEAD_S:g} s ahead"
                what = f"an epoch {ahead_s:+.0f} s from now is ignored"
                self._warn_once(phrase(EPOCH_TOPIC, what, right))
            else:
                self.follow_epoch(epoch_ns)

    def _warn_once(self, sentence: str) -> None:
        kind = sentence.partition(";")[0]
        if kind not in self._warned and len(self._warned) < _MAX_EPOCHS:
            self._warned.add(kind)
            self.get_logger().warning(sentence)

    def _look(self) -> None:
        if self._epochs:
            self._judge_epochs()
        if self._feed is None or self._feed.epoch_ns is None:
            return
        from_ns, to_ns = self._feed.due(time.monotonic_ns())
        if to_ns > from_ns:
            self.publish_stretch(self._feed.epoch_ns, from_ns, to_ns)
