"""Publisher thread: encodes queued snapshots and publishes the topics that are due."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Mapping

from rope_twin.cadence import SNAPSHOT_TOPICS, due_topics, slot_of
from rope_twin.messages import Encoder
from rope_twin.recording.input_log import InputLog, encode_json
from rope_twin.recording.session import encode_session
from rope_twin.topics import INPUT_LOG_TOPIC, SESSION_TOPIC
from rope_twin.twin.snapshot import Snapshot
from rope_twin.twin.snapshot_queue import SnapshotQueue

_log = logging.getLogger(__name__)


class Publisher:
    """Publishes the due topics of the snapshots that the solver thread has queued."""

    def __init__(
        self,
        handover: SnapshotQueue,
        publish: Callable[[str, bytes], None],
        first: Snapshot,
        log: InputLog | None = None,
        published: Callable[[], Mapping[str, int]] = dict,
    ) -> None:
        """Load all message definitions by encoding `first`, which is not published.

        Loading them later would take from the time that other nodes have before t = 0.

        Args:
            handover: queue of snapshots.
            publish: publishes the bytes of a message on a topic.
            first: any snapshot of the run.
            log: input log whose entries are published too.
            published: returns the number of messages published on each topic up to now.
        """
        rehearsal = Encoder(0)
        for topic in SNAPSHOT_TOPICS:
            rehearsal.encode(topic.name, first)
        self._handover = handover
        self._publish = publish
        self._log = log
        self._published = published
        self._epoch_ns = 0
        self._stopping = threading.Event()
        self._thread: threading.Thread | None = None
        self.processor_s = 0.0  # CPU time of publishing
        self.error = ""  # last message that could not be published; "": none

    def start(self, epoch_ns: int) -> None:
        """Publish from now on, stamped `epoch_ns` + simulation time."""
        self._stopping.clear()
        self._epoch_ns = epoch_ns
        self._thread = threading.Thread(target=self._run, name="twin-publisher", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Publish the queued snapshots, then stop; without effect when not running."""
        self._stopping.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None

    def _run(self) -> None:
        encoder = Encoder(self._epoch_ns)
        before_s = self.processor_s - time.thread_time()
        while True:
            snapshot = self._handover.take(timeout_s=0.05)
            if self._publish_log(snapshot):
                encoder = Encoder(self._epoch_ns)  # as in a replay that begins here
            if snapshot is not None:
                self._publish_snapshot(encoder, snapshot)
                self.processor_s = before_s + time.thread_time()
            elif self._stopping.is_set():
                return

    def _publish_log(self, snapshot: Snapshot | None) -> bool:
        """Publish the inputs logged before a snapshot; return whether a session has begun."""
        begun = False
        try:
            for name, content in self._log.messages(snapshot) if self._log else ():
                if name == SESSION_TOPIC:
                    begun = True
                    self._publish(name, encode_session(content, self._published()))
                else:
                    self._publish(name, encode_json(content))
        except Exception as error:
            if not self.error:
                _log.exception("the inputs cannot be published")
            self.error = f"topic {INPUT_LOG_TOPIC}: {type(error).__name__}: {error}"
        return begun

    def _publish_snapshot(self, encoder: Encoder, snapshot: Snapshot) -> None:
        for name in due_topics(*slot_of(snapshot), snapshot):
            try:
                self._publish(name, encoder.encode(name, snapshot))
            except Exception as error:
                # One topic that fails must not stop the others; diagnostics report it.
                if not self.error:
                    _log.exception("topic %s cannot be published", name)
                self.error = f"topic {name}: {type(error).__name__}: {error}"
