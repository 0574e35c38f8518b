"""A bag writer on a thread of its own, behind a queue: recording never holds up the twin."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from rope_twin.errors import BagError, phrase
from rope_twin.recording.bag import ClosableBag
from rope_twin.recording.bag_writer import BagWriter
from rope_twin.topics import Topic

FLUSH_PERIOD_S = 0.4  # a killed process loses this much and the moment of writing, at most 1 s
FILE_PERIOD_S = 600.0  # the index of a file takes memory until its end, some 4 kB a second
_TAKE_PERIOD_S = 0.05  # small helpings: the interpreter is never held for long
QUEUE_LIMIT_BYTES = 64 * 2**20


@dataclass(frozen=True)
class RecorderHealth:
    """State of a recording."""

    recorded: int  # messages handed to the bag
    lost: int  # messages that could not be taken
    queued: int
    size_bytes: int  # of the bag
    trouble: str  # one sentence, '' if all is well


class BagRecorder(ClosableBag):
    """Records from any thread; `write` never waits.

    The thread is a daemon: close the recorder, or the last moment and metadata.yaml are missing
    (as after a kill, `rope_twin recover` mends that).
    """

    def __init__(
        self, directory: Path, topics: Iterable[Topic], metadata: Mapping[str, str] | None = None
    ) -> None:
        """Create the bag.

        Raises:
            BagError: the bag cannot be created.
        """
        self._bag = BagWriter(directory, topics, metadata)
        self._bag.note_channels()
        self._condition = threading.Condition()
        self._queue: deque[tuple[str, int, bytes, int]] = deque()
        self._queued_bytes = 0
        self._recorded = 0
        self._lost = 0
        self._reason = ""  # of the newest loss
        self._closing = False
        self._failure: BaseException | None = None
        self._thread = threading.Thread(target=self._run, name="bag_recorder", daemon=True)
        self._thread.start()

    @property
    def directory(self) -> Path:
        """Return the directory of the bag."""
        return self._bag.directory

    def write(self, topic_name: str, stamp_ns: int, data: bytes, sequence: int = 0) -> bool:
        """Queue one message; return False (and count it) if the queue is full.

        sequence: the publisher's number of it; 0: unknown.
        """
        with self._condition:
            if self._closing or self._failure is not None:
                self._lose(f"the recorder has ended{_because(self._failure)}")
                return False
            if self._queued_bytes > QUEUE_LIMIT_BYTES:
                self._lose("the disk is slower than the topics")
                return False
            self._queue.append((topic_name, stamp_ns, data, sequence))
            self._queued_bytes += len(data)
            return True

    def health(self) -> RecorderHealth:
        """Return the current state of the recording."""
        with self._condition:
            trouble = self._bag.trouble
            if self._lost and not trouble:
                trouble = phrase(
                    f"bag {self._bag.directory}",
                    f"{self._lost} messages were not recorded ({self._reason})",
                    "record fewer topics or on a faster disk",
                )
            return RecorderHealth(
                self._recorded, self._lost, len(self._queue), self._bag.size_bytes, trouble
            )

    def close(self) -> None:
        """Write what is queued, end the bag. A second call does nothing.

        Raises:
            BagError: the disk did not take everything.
        """
        with self._condition:
            self._closing = True
            self._condition.notify()
        self._thread.join()
        self._bag.close()
        if self._failure is not None:
            raise self._failure

    def _run(self) -> None:
        try:
            flushed_s = begun_s = time.monotonic()
            ending = False
            while not ending:
                batch, ending = self._take()
                for message in batch:
                    self._record(*message)
                if ending or time.monotonic() - flushed_s >= FLUSH_PERIOD_S:
                    self._bag.flush()
                    self._bag.check_place()
                    flushed_s = time.monotonic()
                    if flushed_s - begun_s >= FILE_PERIOD_S and self._bag.begin_file():
                        begun_s = flushed_s
        except BaseException as error:  # kept for close(), which raises it in the caller's thread
            self._failure = error

    def _take(self) -> tuple[list[tuple[str, int, bytes, int]], bool]:
        """Return the queued messages, and whether no more will follow."""
        with self._condition:
            self._condition.wait_for(lambda: self._closing, timeout=_TAKE_PERIOD_S)
            batch = list(self._queue)
            self._queue.clear()
            self._queued_bytes = 0
            return batch, self._closing

    def _record(self, topic_name: str, stamp_ns: int, data: bytes, sequence: int) -> None:
        try:
            self._bag.write(topic_name, stamp_ns, data, sequence=sequence)
        except BagError as error:
            with self._condition:
                self._lose(str(error).rstrip("."))
            return
        with self._condition:
            self._recorded += 1

    def _lose(self, reason: str) -> None:
        self._lost += 1
        self._reason = reason


def _because(failure: BaseException | None) -> str:
    return f": {failure}" if failure is not None else ""
