"""The node that records every topic of the table, inputs too, byte for byte.

The bytes go from the subscription to a queue; writing happens on the recorder's own thread. The
log time is the publisher's own time of sending.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node

from rope_twin.errors import BagError
from rope_twin.messages import Level, Status, encode_diagnostics
from rope_twin.recording.recorder import BagRecorder
from rope_twin.ros.entry import run_node
from rope_twin.ros.params import RecorderParams, declare
from rope_twin.ros.qos import message_type, profile
from rope_twin.topics import BY_NAME, TOPICS, Qos, Topic

_DEPTH = 1000  # what may wait in the middleware while this process is held up
_TELL_S = 1.0


class RecorderNode(Node):
    """Subscribes to all topics as raw bytes and hands them to a BagRecorder."""

    def __init__(self, **node_options: Any) -> None:
        super().__init__("recorder", **node_options)
        self._params = declare(self, RecorderParams)
        self._recorder: BagRecorder | None = None
        self._lost_on_the_way = 0
        self._told = ""
        self.received = 0

    def begin(self) -> None:
        """Make the bag and subscribe. Raises BagError if the bag cannot be made."""
        directory = Path(self._params.directory or time.strftime("rope_twin_%Y%m%d_%H%M%S"))
        self._recorder = BagRecorder(directory, TOPICS)
        for topic in TOPICS:
            depth = 1 if topic.qos is Qos.LATCHED else _DEPTH
            self.create_subscription(
                message_type(topic),
                topic.name,
                self._taker(topic),
                profile(topic.qos, depth),
                raw=True,
                event_callbacks=SubscriptionEventCallbacks(message_lost=self._on_lost),
            )
        diagnostics = BY_NAME["diagnostics"]
        self._diagnostics = self.create_publisher(
            message_type(diagnostics), diagnostics.name, profile(diagnostics.qos)
        )
        self.create_timer(_TELL_S, self._tell, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self.get_logger().info(f"recording to {directory}")

    @property
    def finished(self) -> bool:
        """A recorder has no end of its own."""
        return False

    def close(self) -> None:
        """Write what is queued and end the bag; a disk that refuses is told in the log."""
        recorder, self._recorder = self._recorder, None
        if recorder is None:
            return
        try:
            recorder.close()
        except BagError as error:
            self.get_logger().error(str(error))

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
            "lost on the way": str(self._lost_on_the_way),
            "size [MB]": f"{health.size_bytes / 1e6:.2f}",
        }
        if health.trouble:
            return Status(name, Level.ERROR, health.trouble, values)
        if self._lost_on_the_way:
            message = f"{self._lost_on_the_way} messages were lost before they came here"
            return Status(name, Level.WARN, message, values)
        return Status(name, Level.OK, f"recording, {health.recorded} messages so far", values)

    def _taker(self, topic: Topic) -> Any:
        def take(data: bytes, info: dict[str, int]) -> None:
            if self._recorder is not None:
                self.received += 1
                sent_ns = info["source_timestamp"] or time.time_ns()
                self._recorder.write(topic.name, sent_ns, data)

        return take

    def _on_lost(self, event: Any) -> None:
        self._lost_on_the_way = self._lost_on_the_way + event.total_count_change

    def _tell(self) -> None:
        status = self.status()
        now_ns = self.get_clock().now().nanoseconds
        self._diagnostics.publish(encode_diagnostics(now_ns, [status]))
        if status.level != Level.OK and status.message != self._told:
            self._told = status.message
            self.get_logger().warning(status.message)


def main(args: list[str] | None = None) -> int:
    """Console entry."""
    return run_node(RecorderNode, args)


if __name__ == "__main__":
    sys.exit(main())
