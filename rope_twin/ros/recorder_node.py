"""The node that records every topic of the table, inputs too, byte for byte.

The bytes go from the subscription to a queue; writing happens on the recorder's own thread. The
log time is the publisher's own time of sending. On a machine that is too busy messages wait in the
middleware: each call takes all that wait at its topic, and at the end all topics are emptied.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.node import Node

from rope_twin.errors import BagError
from rope_twin.messages import Level, Status, encode_diagnostics
from rope_twin.recording.bag_format import describe_topic
from rope_twin.recording.recorder import BagRecorder
from rope_twin.ros.arrivals import Arrivals
from rope_twin.ros.entry import run_node
from rope_twin.ros.params import RecorderParams, declare
from rope_twin.ros.qos import message_type, profile, quiet_listener, quiet_publisher
from rope_twin.topics import BY_NAME, CUT_TOPIC, TOPICS, Qos, Topic

_DEPTH = 1000  # what may wait in the middleware while this process is held up
_TELL_S = 1.0
_LOOK_S = 0.05  # on standby: how often to look whether it is time to begin


def free_path(path: Path, suffix: str = "") -> Path:
    """Return the path, or the first free one of PATH_2, PATH_3 and so on, before the suffix."""
    number, free = 1, path
    while free.exists():
        number += 1
        free = path.with_name(f"{path.name.removesuffix(suffix)}_{number}{suffix}")
    return free


class RecorderNode(Node):
    """Subscribes to all topics as raw bytes and hands them to a BagRecorder."""

    def __init__(self, **node_options: Any) -> None:
        super().__init__("recorder", **node_options)
        self._params = declare(self, RecorderParams)
        self._recorder: BagRecorder | None = None
        self._listening: dict[str, Any] = {}  # subscription by topic
        self._arrivals = Arrivals()
        self._unwritten = 0  # messages that came and could not be taken
        self._told = ""
        self.failure = ""  # why the bag is not whole, known when closed

    def begin(self) -> None:
        """Make the bag and subscribe; on standby, when it is called.

        Raises:
            BagError: the bag cannot be made.
        """
        if not self._params.standby:
            self._start()
            return
        for topic in TOPICS:  # what is loaded now takes no time then
            message_type(topic)
            describe_topic(topic)

        def look() -> None:
            if Path(self._params.standby).exists():
                timer.cancel()
                self._start()

        timer = self.create_timer(_LOOK_S, look, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self.get_logger().info("standing by to record")

    def _start(self) -> None:
        directory = Path(self._params.directory or time.strftime("rope_twin_%Y%m%d_%H%M%S"))
        if self._params.beside:
            directory = free_path(directory)
        topics = [t for t in TOPICS if t.name != CUT_TOPIC or self._params.allow_cut]
        self._recorder = BagRecorder(directory, topics)
        for topic in topics:
            depth = 1 if topic.qos is Qos.LATCHED else _DEPTH
            self._listening[topic.name] = self.create_subscription(
                message_type(topic),
                topic.name,
                self._taker(topic),
                profile(topic.qos, depth),
                raw=True,
                event_callbacks=quiet_listener(),
            )
        diagnostics = BY_NAME["diagnostics"]
        self._diagnostics = self.create_publisher(
            message_type(diagnostics),
            diagnostics.name,
            profile(diagnostics.qos),
            event_callbacks=quiet_publisher(),
        )
        self.create_timer(_TELL_S, self._tell, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self.get_logger().info(f"recording to {directory}")

    @property
    def finished(self) -> bool:
        """A recorder has no end of its own."""
        return False

    @property
    def received(self) -> int:
        """Messages that have come so far."""
        return self._arrivals.received

    @property
    def lost(self) -> int:
        """Messages that were published and will not be in the bag, so far."""
        if self._recorder is not None:
            self._unwritten = self._recorder.health().lost
        return self._arrivals.lost + self._unwritten

    def close(self) -> None:
        """Take what waits, write what is queued and end the bag; what went wrong is logged."""
        if self._recorder is None:
            return
        for topic in self._listening:
            self._take_waiting(topic)
        recorder = self._recorder
        try:
            recorder.close()
        except BagError as error:
            self.failure = str(error)
            self.get_logger().error(self.failure)
        if self.lost:
            self._say(self.status().message)
        self._recorder = None

    def status(self) -> Status:
        """How the recording goes, in words."""
        name = "recorder: bag"
        if self._recorder is None:
            return Status(name, Level.OK, "not recording")
        health = self._recorder.health()
        values = {
            "directory": str(self._recorder.directory),
            "received": str(self.received),
            "recorded": str(health.recorded),
            "waiting": str(health.queued),
            "lost by the recorder": str(health.lost),
            "lost on the way": str(self._arrivals.lost),
            "size [MB]": f"{health.size_bytes / 1e6:.2f}",
        }
        if health.trouble:
            return Status(name, Level.ERROR, health.trouble, values)
        if self._arrivals.lost:
            message = (
                f"{self._arrivals.lost} messages are missing in the bag: the machine was too busy "
                "to take them in time"
            )
            return Status(name, Level.WARN, message, values)
        return Status(name, Level.OK, f"recording, {health.recorded} messages so far", values)

    def _taker(self, topic: Topic) -> Any:
        def take(data: bytes, info: dict[str, Any]) -> None:
            self._keep(topic.name, data, info)
            self._take_waiting(topic.name)

        return take

    def _take_waiting(self, topic: str) -> None:
        """Keep what waits at a topic: the executor's round for each message costs far more."""
        subscription = self._listening[topic]
        for _ in range(_DEPTH):
            with subscription.handle:
                found = subscription.handle.take_message(subscription.msg_type, True)
            if found is None:
                return
            self._keep(topic, *found)

    def _keep(self, topic: str, data: bytes, info: dict[str, Any]) -> None:
        if self._recorder is not None:
            self._arrivals.count(info)
            stamp_ns = info["source_timestamp"] or time.time_ns()
            number = info["publication_sequence_number"] or 0
            self._recorder.write(topic, stamp_ns, data, number & 0xFFFFFFFF)

    def _tell(self) -> None:
        status = self.status()
        now_ns = self.get_clock().now().nanoseconds
        self._diagnostics.publish(encode_diagnostics(now_ns, [status]))
        if status.level != Level.OK:
            self._say(status.message)

    def _say(self, message: str) -> None:
        """Log it, once."""
        if message != self._told:
            self._told = message
            self.get_logger().warning(message)


def main(args: list[str] | None = None) -> int:
    """Console entry; the exit code is 1 if the bag is not whole."""
    made: list[RecorderNode] = []

    def make() -> RecorderNode:
        made.append(RecorderNode())
        return made[0]

    code = run_node(make, args)
    return 1 if any(node.failure for node in made) else code


if __name__ == "__main__":
    sys.exit(main())
