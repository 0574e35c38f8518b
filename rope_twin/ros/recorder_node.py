"""Recorder node: records every topic of the table, inputs included, byte for byte.

The bytes go from the subscription to a queue; the recorder's own thread writes them. The log time
is the publisher's time of sending, but for latched messages of long before the recording. On an
overloaded machine messages queue in the middleware: each callback takes all queued messages of its
topic, and at the end all topics are drained.

A recorder on standby listens too, and begins its bag with the last seconds: what the recorder whose
place it takes had not written yet is in the next bag.
"""

from __future__ import annotations

import re
import sys
import time
from collections import deque
from collections.abc import Iterable
from functools import partial
from pathlib import Path
from typing import Any

from rope_twin.errors import BagError, counted
from rope_twin.messages import Level, Status, encode_diagnostics
from rope_twin.recording.bag import describe_topic, free_path
from rope_twin.recording.bag_writer import BagRecorder
from rope_twin.ros.entry import SuiteNode, run_node
from rope_twin.ros.params import RecorderParams, declare
from rope_twin.ros.qos import listen, message_type, publish
from rope_twin.topics import BY_NAME, CUT_TOPIC, SESSION_TOPIC, TOPICS, Qos, Topic

_DEPTH = 1000  # messages that may queue in the middleware while this process is blocked
_DIAGNOSTICS_S = 1.0
_REPORTED_S = 60.0  # how long lost messages are reported as a warning
_POLL_S = 0.05  # on standby: period of checking for the start file
_OLD_NS = 10_000_000_000  # age from which a latched message is of before the recording
_KEPT_S = 2.0  # on standby: a recorder that dies may have written nothing for almost a second


class MessageLoss:
    """Counts the sequence numbers that are missing between messages of a publisher.

    A queue that overflows while a process is blocked drops messages silently; the sequence numbers
    reveal it. Messages sent before the first received one are not counted.
    """

    def __init__(self) -> None:
        self._newest: dict[bytes, int] = {}
        self.received = 0
        self.lost = 0
        self._lost_s = -_REPORTED_S

    def count(self, info: dict[str, Any]) -> None:
        """Count a received message; `info`: its metadata from the middleware."""
        self.received += 1
        number, publisher = info["publication_sequence_number"], info["publisher_gid"]["data"]
        if number is None:
            return  # a middleware without sequence numbers
        before = self._newest.get(publisher)
        if before is not None:
            missing = max(0, number - before - 1)
            self.lost += missing
            self._lost_s = time.monotonic() if missing else self._lost_s
        self._newest[publisher] = max(number, before or 0)

    @property
    def recent(self) -> bool:
        """Whether messages were lost in the last _REPORTED_S."""
        return time.monotonic() - self._lost_s < _REPORTED_S


Stored = tuple[str, int, bytes, int]  # topic, stamp [ns], message and its number


class BagBeginning:
    """Holds latched messages until the bag has begun, and lets the old ones begin with it.

    A new subscription receives a latched message however old it is. With that stamp the bag of a
    recorder that joins would begin hours before its first result. A session is never held: it is
    published again for a recorder that joins.
    """

    def __init__(self) -> None:
        self._began_ns: int | None = None  # stamp of the first result, by the simulation's clock
        self._held: list[Stored] = []

    def take(self, message: Stored) -> list[Stored]:
        """Return the messages to write on arrival of this one."""
        topic = BY_NAME[message[0]]
        if topic.qos is Qos.LATCHED and topic.name != SESSION_TOPIC:
            self._held.append(message)
            return [] if self._began_ns is None else self.rest()
        if self._began_ns is not None or not topic.of_snapshot:
            return [message]
        self._began_ns = message[1]
        return [*self.rest(), message]

    def rest(self) -> list[Stored]:
        """Return the messages that are still buffered."""
        messages, self._held = self._held, []
        return [
            (name, self._stamp(stamp_ns), data, number) for name, stamp_ns, data, number in messages
        ]

    def _stamp(self, stamp_ns: int) -> int:
        began_ns = stamp_ns if self._began_ns is None else self._began_ns
        return stamp_ns if began_ns - stamp_ns < _OLD_NS else began_ns


class RecorderNode(SuiteNode):
    """Subscribes to all topics as raw bytes and hands them to a BagRecorder."""

    def __init__(self, **node_options: Any) -> None:
        super().__init__("recorder", **node_options)
        self._params = declare(self, RecorderParams)
        self._recorder: BagRecorder | None = None
        self._listening: dict[str, Any] = {}  # subscription by topic
        self._kept: deque[tuple[float, str, bytes, dict[str, Any]]] = deque()  # on standby
        self._loss = MessageLoss()
        self._beginning = BagBeginning()
        self._unwritten = 0  # messages received that could not be written
        self._logged = ""
        self.failure = ""  # why the bag is incomplete, known when closed

    def begin(self) -> None:
        """Subscribe and create the bag; on standby, that as soon as the start file exists."""
        if not self._params.standby:
            self._start()
            return
        for topic in self._topics():  # loading the types now saves time at the start
            message_type(topic)
            describe_topic(topic)
        # A latched message comes to every new subscription, however old it is.
        self._listen(topic for topic in self._topics() if topic.qos is not Qos.LATCHED)

        def look() -> None:
            if Path(self._params.standby).exists():
                timer.cancel()
                self._start()

        timer = self.every(_POLL_S, look)
        self.get_logger().info("recorder on standby")

    def _start(self) -> None:
        directory = Path(self._params.out or time.strftime("rope_twin_%Y%m%d_%H%M%S"))
        if self._params.beside:
            directory = free_path(directory)
        self._recorder = BagRecorder(directory, self._topics())
        since_s = time.monotonic() - _KEPT_S
        for at_s, topic, data, info in self._kept:
            if at_s >= since_s:
                self._record(topic, data, info)
        self._kept.clear()
        self._listen(self._topics())
        self._diagnostics = publish(self, BY_NAME["diagnostics"])
        self.every(_DIAGNOSTICS_S, self._publish_diagnostics)
        self.get_logger().info(f"recording to {directory}")

    def _topics(self) -> list[Topic]:
        return [t for t in TOPICS if t.name != CUT_TOPIC or self._params.allow_cut]

    def _listen(self, topics: Iterable[Topic]) -> None:
        """Subscribe to those of the topics that are not listened to yet."""
        for topic in topics:
            if topic.name in self._listening:
                continue
            depth = 1 if topic.qos is Qos.LATCHED else _DEPTH
            self._listening[topic.name] = listen(self, topic, self._taker(topic), depth)

    @property
    def exit_code(self) -> int:
        """Return 1 if the bag is incomplete."""
        return int(bool(self.failure))

    @property
    def received(self) -> int:
        """Return the number of messages received."""
        return self._loss.received

    @property
    def kept(self) -> int:
        """Return the number of messages that the bag will begin with, on standby."""
        return len(self._kept)

    @property
    def lost(self) -> int:
        """Return the number of published messages that will be missing in the bag."""
        if self._recorder is not None:
            self._unwritten = self._recorder.health().lost
        return self._loss.lost + self._unwritten

    def close(self) -> None:
        """Drain the topics, write the queue and close the bag; failures are logged."""
        if self._recorder is None:
            return
        for topic in self._listening:
            self._take_waiting(topic)
        recorder = self._recorder
        for message in self._beginning.rest():
            recorder.write(*message)
        try:
            recorder.close()
        except BagError as error:
            self.failure = str(error)
            self.get_logger().error(self.failure)
        if self.lost:
            self._warn_once(self.status().message)
        self._recorder = None

    def status(self) -> Status:
        """Return the diagnostics row of the recorder."""
        name = "recorder: bag"  # RECORDER_ROW; the reference finds it here
        if self._recorder is None:
            return Status(name, Level.OK, "not recording")
        health = self._recorder.health()
        values = {
            "directory": str(self._recorder.directory),
            "received": str(self.received),
            "recorded": str(health.recorded),
            "waiting": str(health.queued),
            "lost by the recorder": str(health.lost),
            "lost in transit": str(self._loss.lost),
            "size [MB]": f"{health.size_bytes / 1e6:.2f}",
        }
        if health.trouble:
            return Status(name, Level.ERROR, health.trouble, values)
        words = f"recording; {counted(health.recorded, 'message')} written"
        if self._loss.lost:
            missing = f"{counted(self._loss.lost, 'message')} missing in the bag: CPU overload, or "
            missing += "the recorder was stopped"
            if self._loss.recent:
                return Status(name, Level.WARN, missing, values)
            words += f"; {missing}, none in the last {_REPORTED_S:g} s"
        return Status(name, Level.OK, words, values)

    def _taker(self, topic: Topic) -> Any:
        def take(data: bytes, info: dict[str, Any]) -> None:
            self._record(topic.name, data, info)
            self._take_waiting(topic.name)

        return take

    def _take_waiting(self, topic: str) -> None:
        """Record all queued messages of a topic: one executor cycle each would cost far more."""
        subscription = self._listening[topic]
        for _ in range(_DEPTH):
            with subscription.handle:
                received = subscription.handle.take_message(subscription.msg_type, True)
            if received is None:
                return
            self._record(topic, *received)

    def _record(self, topic: str, data: bytes, info: dict[str, Any]) -> None:
        if self._recorder is None:  # kept for the beginning of the bag, as long as is needed
            now_s = time.monotonic()
            self._kept.append((now_s, topic, data, info))
            while self._kept[0][0] < now_s - _KEPT_S:
                self._kept.popleft()
            return
        self._loss.count(info)
        stamp_ns = info["source_timestamp"] or time.time_ns()
        number = info["publication_sequence_number"] or 0
        for message in self._beginning.take((topic, stamp_ns, data, number & 0xFFFFFFFF)):
            self._recorder.write(*message)

    def _publish_diagnostics(self) -> None:
        status = self.status()
        now_ns = self.get_clock().now().nanoseconds
        self._diagnostics.publish(encode_diagnostics(now_ns, [status]))
        if status.level == Level.OK:
            self._logged = ""
        else:
            self._warn_once(status.message)

    def _warn_once(self, message: str) -> None:
        """Log a warning unless it repeats the last one with other numbers, as each second."""
        kind = re.sub(r"\d+", "", message)
        if kind != self._logged:
            self._logged = kind
            self.get_logger().warning(message)


main = partial(run_node, RecorderNode)  # console entry; the exit code is 1 if the bag is incomplete

if __name__ == "__main__":
    sys.exit(main())
