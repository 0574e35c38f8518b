"""Input streamer: base of the nodes that publish inputs ahead of the simulation's time."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from typing import Any

from rope_twin.errors import phrase
from rope_twin.messages.templates import nanoseconds
from rope_twin.ros.entry import SuiteNode
from rope_twin.ros.qos import Senders, message_type, profile, publish
from rope_twin.topics import BY_NAME

_PERIOD_S, _MIN_PERIOD_S = 0.04, 0.005
EPOCH_TOPIC = "twin/epoch"
# Accepted distance of an epoch from now: a simulation starts within seconds, or resumes.
EPOCH_AHEAD_S, EPOCH_BACK_S = 60.0, 3.2e7
_MAX_EPOCHS = 16  # maximum number of pending epochs, and of warnings about epochs
_JOIN_LATE_S = 0.5  # a simulation younger than this gets all samples from the beginning
_LOOK_BACK_S = 0.1  # an older one gets samples from this long before now
PIECE_NS = 500_000_000  # longest interval: five commands, where a subscriber queues ten


class InputClock:
    """Follows one epoch after another; each instant of an epoch is due exactly once."""

    def __init__(self, lead_s: float, speed: float, first_ns: int = 0) -> None:
        self._lead_ns = round(lead_s * max(1.0, speed) * 1e9)
        self._speed = speed
        self._first_ns = first_ns
        self.epoch_ns: int | None = None  # of the simulation; None: not known yet
        self._steady_at_zero_ns = 0
        self._sent_ns = 0

    def follow(self, epoch_ns: int, ros_now_ns: int, steady_now_ns: int) -> None:
        """Follow the epoch of a simulation that has started, or resumed after a pause."""
        if epoch_ns == self.epoch_ns:
            return
        self.epoch_ns = epoch_ns
        # From here on only the steady clock is used: a step of the system clock has no effect.
        self._steady_at_zero_ns = steady_now_ns - (ros_now_ns - epoch_ns)
        now_ns = self._twin_time_ns(steady_now_ns)
        fresh = now_ns < _JOIN_LATE_S * max(1.0, self._speed) * 1e9
        self._sent_ns = self._first_ns if fresh else now_ns - round(_LOOK_BACK_S * 1e9)

    def due(self, steady_now_ns: int) -> tuple[int, int]:
        """Return the interval [from, to) of simulation time [ns] to publish now; empty if equal.

        A long interval is split, one piece per call, so that subscribers can read each in time.
        """
        if self.epoch_ns is None:
            return 0, 0
        wanted_ns = self._twin_time_ns(steady_now_ns) + self._lead_ns
        until_ns = min(max(self._sent_ns, wanted_ns), self._sent_ns + PIECE_NS)
        interval = self._sent_ns, until_ns
        self._sent_ns = until_ns
        return interval

    def _twin_time_ns(self, steady_now_ns: int) -> int:
        return round((steady_now_ns - self._steady_at_zero_ns) * self._speed)


class InputNode(SuiteNode, ABC):
    """Node whose `publish_interval` is called for each interval of simulation time, in order."""

    def __init__(self, name: str, **node_options: Any) -> None:
        super().__init__(name, **node_options)
        self._due_clock: InputClock | None = None
        self._own_publishers: dict[str, Any] = {}
        self.senders = Senders(self)
        self._simulation = ""  # name of the node whose epoch is followed
        self._epochs: dict[bytes, tuple[int, dict[str, Any]]] = {}  # pending, by publisher
        self._warned: set[str] = set()
        self._awaits_clock = False  # to begin with the first message on /clock

    def close(self) -> None:
        """Stop publishing."""
        self._due_clock = None

    @abstractmethod
    def publish_interval(self, epoch_ns: int, from_ns: int, to_ns: int) -> None:
        """Publish all samples with from_ns <= stamp < to_ns, stamped epoch_ns + stamp."""

    def start_publishing(
        self, topics: tuple[str, ...], lead_s: float, speed: float, first_ns: int = 0
    ) -> None:
        """Make the publishers and the timer that publishes due samples, beginning at `first_ns`.

        The node then calls `await_epoch` or, to begin immediately, `follow_now`.
        """
        for name in topics:
            self._own_publishers[name] = publish(self, BY_NAME[name])
        self._due_clock = InputClock(lead_s, speed, first_ns)
        self.every(max(_MIN_PERIOD_S, _PERIOD_S / max(1.0, speed)), self._publish_due)

    def await_epoch(self, simulation: str) -> None:
        """Follow the epoch that the node of this name publishes, also if it starts later."""
        self._simulation = simulation
        epoch = BY_NAME[EPOCH_TOPIC]
        self.create_subscription(message_type(epoch), epoch.name, self._follow, profile(epoch.qos))

    def follow_epoch(self, epoch_ns: int) -> None:
        """Publish for a simulation whose t = 0 is at this ROS time."""
        if self._due_clock is not None:
            now_ns = self.get_clock().now().nanoseconds
            self._due_clock.follow(epoch_ns, now_ns, time.monotonic_ns())

    def follow_now(self) -> None:
        """Publish for a simulation whose t = 0 is now; with use_sim_time, at the first /clock."""
        now_ns = self.get_clock().now().nanoseconds
        self._awaits_clock = now_ns == 0
        if not self._awaits_clock:
            self.follow_epoch(now_ns)

    def publishes(self, name: str) -> bool:
        """Return whether this node has a publisher of a topic."""
        return name in self._own_publishers

    def send(self, name: str, data: bytes) -> None:
        """Publish the bytes of a message."""
        self._own_publishers[name].publish(data)

    def _follow(self, message: Any, info: dict[str, Any]) -> None:
        """Follow an epoch as soon as its sender is known."""
        if len(self._epochs) < _MAX_EPOCHS:
            self._epochs[info["publisher_gid"]["data"]] = nanoseconds(message), info
        self._publish_due()

    def _check_epochs(self) -> None:
        """Follow the simulation's epoch; reject other senders and implausible times."""
        now_ns = self.get_clock().now().nanoseconds
        if now_ns == 0:
            return  # use_sim_time, and no /clock message yet
        for publisher, (epoch_ns, info) in list(self._epochs.items()):
            sender = self.senders.name(EPOCH_TOPIC, info)
            if not sender:
                continue
            del self._epochs[publisher]
            ahead_s = (epoch_ns - now_ns) * 1e-9
            if sender != self._simulation:
                problem = f"epoch from node {sender} ignored"
                self._warn_once(phrase(EPOCH_TOPIC, problem, f"only {self._simulation} sets it"))
            elif not -EPOCH_BACK_S <= ahead_s <= EPOCH_AHEAD_S:
                remedy = f"allowed are {EPOCH_BACK_S:g} s in the past to {EPOCH_AHEAD_S:g} s ahead"
                problem = f"epoch {ahead_s:+.0f} s from now ignored"
                self._warn_once(phrase(EPOCH_TOPIC, problem, remedy))
            else:
                self.follow_epoch(epoch_ns)

    def _warn_once(self, sentence: str) -> None:
        kind = sentence.partition(";")[0]
        if kind not in self._warned and len(self._warned) < _MAX_EPOCHS:
            self._warned.add(kind)
            self.get_logger().warning(sentence)

    def _publish_due(self) -> None:
        if self._epochs:
            self._check_epochs()
        if self._awaits_clock:
            self.follow_now()
        if self._due_clock is None or self._due_clock.epoch_ns is None:
            return
        from_ns, to_ns = self._due_clock.due(time.monotonic_ns())
        if to_ns > from_ns:
            self.publish_interval(self._due_clock.epoch_ns, from_ns, to_ns)
