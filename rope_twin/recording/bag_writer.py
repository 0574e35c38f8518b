"""Writes rosbag2 directories with MCAP storage that ros2 bag, rosbags, Foxglove and rerun open.

The recorder is a bag writer on a thread of its own, behind a queue: it never holds up the twin.
"""

from __future__ import annotations

import os
import threading
import time
from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from mcap.writer import CompressionType, Writer

from rope_twin.errors import BagError, did_you_mean, phrase
from rope_twin.files import write_whole
from rope_twin.recording import bag
from rope_twin.topics import Topic, recorded_name

WAITING_LIMIT_BYTES = 64 * 2**20
FLUSH_PERIOD_S = 0.4  # a killed process loses this much and the moment of writing, at most 1 s
FILE_PERIOD_S = 600.0  # the index of a file takes memory until its end, some 4 kB a second
_TAKE_PERIOD_S = 0.05  # small helpings: the interpreter is never held for long
QUEUE_LIMIT_BYTES = 64 * 2**20


class FileSink:
    """Stream for an MCAP writer: `write`, `tell`, `flush`.

    Unbuffered below: once `flush` has returned and nothing waits, the bytes are with the operating
    system and survive the death of this process.
    """

    def __init__(self, path: Path) -> None:
        """Create the file.

        Raises:
            OSError: the file exists or cannot be created.
        """
        self._path = path
        self._descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o644)
        self._waiting = bytearray()
        self.written_bytes = 0
        self.trouble = ""  # why bytes are pending, in the words of the operating system

    @property
    def waiting_bytes(self) -> int:
        """Return the number of bytes not yet written to the file."""
        return len(self._waiting)

    @property
    def displaced(self) -> bool:
        """Return whether the file or one of its folders was deleted or moved."""
        if self._descriptor < 0:
            return False
        opened = os.fstat(self._descriptor)
        try:
            at_path = os.stat(self._path)
        except OSError:
            return True
        return (at_path.st_dev, at_path.st_ino) != (opened.st_dev, opened.st_ino)

    def write(self, data: bytes) -> int:
        """Append bytes in memory until the next flush."""
        self._waiting += data
        return len(data)

    def tell(self) -> int:
        """Return the position in the file of the next byte."""
        return self.written_bytes + len(self._waiting)

    def flush(self) -> None:
        """Write the pending bytes; an error is kept in `trouble`, and no byte is dropped."""
        done = 0
        try:
            while done < len(self._waiting):
                done += os.write(self._descriptor, memoryview(self._waiting)[done:])
            self.trouble = ""
        except OSError as error:
            self.trouble = error.strerror or str(error)
        self.written_bytes += done
        del self._waiting[:done]

    def settle(self) -> bool:
        """Flush; close the file and return True if nothing waits any more."""
        self.flush()
        if self._waiting:
            return False
        self.close()
        return True

    def close(self) -> None:
        """Flush once more and close the file."""
        if self._descriptor >= 0:
            self.flush()
            os.close(self._descriptor)
            self._descriptor = -1


CHUNK_BYTES = 256 * 1024  # 2 ms for the longest call; larger chunks stall the caller
_LARGEST_STAMP_NS = 2**63 - 1  # rosbag2 keeps stamps in a signed integer


class _McapFile:
    """One MCAP file of a bag."""

    def __init__(self, path: Path, chunk_bytes: int) -> None:
        """Create the file. Raises OSError: the file exists or cannot be created."""
        self.name = path.name
        self.sink = FileSink(path)
        self._writer = Writer(self.sink, chunk_bytes, CompressionType.ZSTD)
        # A fixed name, not the library's version: equal input, equal bytes.
        self._writer.start(profile="ros2", library="rope_twin")
        self.sink.flush()
        self._schemas: dict[tuple[str, bytes], int] = {}
        self._channels: dict[str, int] = {}
        self._counts: dict[str, int] = {}
        self._first_ns, self._last_ns = _LARGEST_STAMP_NS, -1

    @property
    def summary(self) -> bag.FileSummary:
        return bag.FileSummary(self.name, self._counts, self._first_ns, self._last_ns)

    def add_topic(self, topic: bag.RecordedTopic) -> None:
        key = (topic.type_name, topic.definition)
        if key not in self._schemas:
            self._schemas[key] = self._writer.register_schema(
                topic.type_name, topic.definition_encoding, topic.definition
            )
        self._channels[topic.name] = self._writer.register_channel(
            topic.name, "cdr", self._schemas[key], topic.channel_metadata()
        )
        self._counts[topic.name] = 0

    def add_metadata(self, name: str, notes: Mapping[str, str]) -> None:
        self._writer.add_metadata(name, dict(notes))
        self.sink.flush()

    def note_channels(self, topics: Mapping[str, bag.RecordedTopic]) -> None:
        noted = {
            str(channel): f"{name} {topics[name].type_name}"
            for name, channel in self._channels.items()
        }
        self.add_metadata(bag.CHANNELS_RECORD, noted)

    def write(self, name: str, stamp_ns: int, data: bytes, publish_ns: int, sequence: int) -> None:
        self._writer.add_message(self._channels[name], stamp_ns, data, publish_ns, sequence)
        self._counts[name] += 1
        self._first_ns = min(self._first_ns, stamp_ns)
        self._last_ns = max(self._last_ns, stamp_ns)
        if self.sink.waiting_bytes:
            self.sink.flush()

    def flush(self) -> None:
        self._writer.flush()

    def finish(self, summary: bag.BagSummary) -> None:
        """Write the file's end; it is complete once nothing waits in the sink."""
        self._writer.flush()
        self._writer.add_metadata(bag.ROSBAG_RECORD, {"serialized_metadata": summary.as_yaml()})
        self._writer.finish()
        self.sink.flush()


class BagWriter(bag.ClosableBag):
    """One bag, from making its directory to its metadata.yaml. Not for several threads at once.

    Nothing of it depends on the time of writing: equal calls make equal bytes.
    """

    def __init__(
        self,
        directory: Path,
        topics: Iterable[Topic],
        metadata: Mapping[str, str] | None = None,
        *,
        chunk_bytes: int = CHUNK_BYTES,
    ) -> None:
        """Make the directory with `<name>_0.mcap` in it; `begin_file` adds `<name>_1.mcap`.

        Args:
            topics: rows of the topic table; recorded with a leading slash.
            metadata: notes on the bag, kept in the MCAP file and in metadata.yaml (custom_data).
            chunk_bytes: size, before compression, at which a chunk is closed.

        Raises:
            BagError: the directory is in use, cannot be made, or a message type is unknown.
        """
        self.directory = Path(directory)
        self._chunk_bytes = chunk_bytes
        described = [bag.describe_topic(topic) for topic in topics]
        self._make_directory()
        try:
            self._file = self._make_file(0)
        except OSError as error:
            raise self._error(f"its file cannot be made ({error.strerror})") from error
        self._ended: list[bag.FileSummary] = []
        self._ended_bytes = 0
        self._unsettled: list[FileSink] = []  # of ended files that the disk has not taken whole
        self._topics: dict[str, bag.RecordedTopic] = {}
        self._channels_noted = False
        self._custom_data: dict[str, str] = {}
        self._closed = False
        self._displaced = False
        if metadata:
            self.add_metadata(metadata)
        for topic in described:
            self.add_topic(topic)

    @property
    def counts(self) -> Mapping[str, int]:
        """Return the number of messages by recorded topic name."""
        files = [file.counts for file in self._summary().files]
        return {name: sum(counts.get(name, 0) for counts in files) for name in self._topics}

    @property
    def size_bytes(self) -> int:
        """Return the size of the bag's files [bytes]."""
        return self._ended_bytes + self._file.sink.written_bytes

    @property
    def trouble(self) -> str:
        """Return why the bag cannot be written at present (moved, or a disk error), or ""."""
        if self._displaced:
            return str(self._displacement())
        reason = self._disk_trouble
        if not reason:
            return ""
        problem = (
            f"the disk refuses to take it ({reason}), {self._waiting_bytes} bytes wait in memory"
        )
        return phrase(f"bag {self.directory}", problem, "make room and it goes on")

    def add_metadata(self, metadata: Mapping[str, str]) -> None:
        """Add notes on the bag."""
        self._custom_data.update(metadata)
        self._file.add_metadata(bag.OWN_RECORD, metadata)

    def add_topic(self, topic: bag.RecordedTopic) -> None:
        """Add a topic; the same one twice does nothing.

        Raises:
            BagError: another topic of that name is there already.
        """
        known = self._topics.get(topic.name)
        if known == topic:
            return
        if known is not None:
            problem = f"topic {topic.name} is {known.type_name} and {topic.type_name} in one bag"
            raise self._error(problem, "give each name one type and one quality of service")
        self._file.add_topic(topic)
        self._topics[topic.name] = topic

    def note_channels(self) -> None:
        """Write the topic of each channel outside the chunks.

        The first chunk alone defines the channels until the file's end repeats them: without this
        note its loss in a bag that was cut off would cost all messages.
        """
        self._file.note_channels(self._topics)
        self._channels_noted = True

    def begin_file(self) -> bool:
        """End the present file and go on in the next; return False if that must wait.

        The index of a file grows in memory until its end: recordings of hours take several. Each
        file is a bag of its own, with all topics and notes.
        """
        self.check_place()
        if self._closed or self._displaced or self.trouble:
            return False
        try:
            following = self._make_file(len(self._ended) + 1)
        except OSError:
            return False
        if self._custom_data:
            following.add_metadata(bag.OWN_RECORD, self._custom_data)
        for topic in self._topics.values():
            following.add_topic(topic)
        if self._channels_noted:
            following.note_channels(self._topics)
        ended, self._file = self._file, following
        ended.finish(self._summary([ended.summary]))
        self._ended.append(ended.summary)
        self._ended_bytes += ended.sink.tell()
        self._unsettled.append(ended.sink)
        self._settle()
        return True

    def write(
        self,
        topic_name: str,
        stamp_ns: int,
        data: bytes,
        *,
        publish_ns: int | None = None,
        sequence: int = 0,
    ) -> None:
        """Add one message (CDR bytes) at an absolute time [ns].

        A disk error is reported in `trouble`, not raised: the bytes are kept in memory.

        Raises:
            BagError: closed bag, unknown topic, impossible stamp, or too many bytes in memory.
        """
        name = recorded_name(topic_name)
        if self._closed:
            raise self._error(f"a message on {name} came after its end", "write before closing")
        if name not in self._topics:
            raise self._error(f"it has no topic {name}", did_you_mean(name, self._topics))
        if not 0 <= stamp_ns <= _LARGEST_STAMP_NS:
            problem = f"a message on {name} has the stamp {stamp_ns} ns"
            raise self._error(problem, "right are nanoseconds since 1970")
        if self._waiting_bytes > WAITING_LIMIT_BYTES:
            raise BagError(self.trouble)
        self._file.write(
            name, stamp_ns, data, stamp_ns if publish_ns is None else publish_ns, sequence
        )

    def check_place(self) -> None:
        """Check whether the bag still exists at its path; if not, `trouble` reports it."""
        self._displaced = self._file.sink.displaced

    def flush(self) -> None:
        """Close the chunk in progress and hand everything to the operating system."""
        self._settle()
        self._file.flush()

    def close(self) -> None:
        """Close the file and write metadata.yaml; may be called twice.

        Raises:
            BagError: the disk did not take the rest; what it took can be recovered.
        """
        if self._closed:
            return
        self._closed = True
        self._file.finish(self._summary([self._file.summary]))
        self.check_place()
        for sink in self._sinks:
            sink.close()
        if self._displaced:
            raise self._displacement()
        if self._waiting_bytes:
            problem = f"the disk did not take its last {self._waiting_bytes} bytes "
            remedy = f"`rope_twin recover {self.directory}` saves what is there"
            raise self._error(f"{problem}({self._disk_trouble})", remedy)
        try:
            write_whole(self.directory / "metadata.yaml", self._summary().as_file().encode())
        except OSError as error:
            problem = f"metadata.yaml cannot be written ({error.strerror})"
            remedy = f"`rope_twin recover {self.directory}` makes one"
            raise self._error(problem, remedy) from error

    @property
    def _sinks(self) -> list[FileSink]:
        return [*self._unsettled, self._file.sink]

    @property
    def _waiting_bytes(self) -> int:
        return sum(sink.waiting_bytes for sink in self._sinks)

    @property
    def _disk_trouble(self) -> str:
        return next((sink.trouble for sink in self._sinks if sink.trouble), "")

    def _settle(self) -> None:
        self._unsettled = [sink for sink in self._unsettled if not sink.settle()]

    def _make_file(self, number: int) -> _McapFile:
        name = f"{self.directory.resolve().name}_{number}.mcap"
        return _McapFile(self.directory / name, self._chunk_bytes)

    def _summary(self, files: Sequence[bag.FileSummary] | None = None) -> bag.BagSummary:
        """Return the content of metadata.yaml for those of the bag's files, by default all."""
        files = [*self._ended, self._file.summary] if files is None else files
        return bag.BagSummary(files, list(self._topics.values()), self._custom_data)

    def _make_directory(self) -> None:
        try:
            self.directory.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise _error(self.directory, f"it cannot be made ({error.strerror})") from error
        check_unused(self.directory)

    def _displacement(self) -> BagError:
        return self._error(
            "its folder or file was deleted or moved while it was being recorded",
            "what it held is lost or is where it was moved to: start another recording",
        )

    def _error(self, problem: str, remedy: str = "") -> BagError:
        return _error(self.directory, problem, remedy)


def check_unused(directory: Path) -> None:
    """Check that a bag can be made in a directory, as far as it exists.

    Raises:
        BagError: it holds something, or is none.
    """
    try:
        in_use = directory.exists() and any(directory.iterdir())
    except OSError as error:
        raise _error(directory, f"it cannot be made ({error.strerror})") from error
    if in_use:
        remedy = "name one that does not exist yet"
        raise _error(directory, "the directory holds something", remedy)


def _error(directory: Path, problem: str, remedy: str = "") -> BagError:
    return BagError(f"bag {directory}", problem, remedy or "name a place that can be written")


@dataclass(frozen=True)
class RecorderHealth:
    """State of a recording."""

    recorded: int  # messages handed to the bag
    lost: int  # messages that could not be taken
    queued: int
    size_bytes: int  # of the bag
    trouble: str  # one sentence, '' if all is well


class BagRecorder(bag.ClosableBag):
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
        self.directory = self._bag.directory
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

    def write(self, topic_name: str, stamp_ns: int, data: bytes, sequence: int = 0) -> bool:
        """Queue one message; return False (and count it) if the queue is full.

        sequence: the publisher's number of it; 0: unknown.
        """
        with self._condition:
            if self._closing or self._failure is not None:
                reason = "" if self._failure is None else f": {self._failure}"
                self._lose(f"the recorder has ended{reason}")
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
                problem = f"{self._lost} messages were not recorded ({self._reason})"
                remedy = "record fewer topics or on a faster disk"
                trouble = phrase(f"bag {self._bag.directory}", problem, remedy)
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
