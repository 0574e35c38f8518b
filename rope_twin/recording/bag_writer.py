"""Writes rosbag2 directories with MCAP storage that ros2 bag, rosbags, Foxglove and rerun open."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from pathlib import Path

from mcap.writer import CompressionType, Writer

from rope_twin.errors import BagError, did_you_mean, phrase
from rope_twin.recording.bag import (
    CHANNELS_RECORD,
    OWN_RECORD,
    ROSBAG_RECORD,
    BagSummary,
    ClosableBag,
    RecordedTopic,
    describe_topic,
    recorded_name,
)
from rope_twin.topics import Topic
from rope_twin.whole_file import write_whole

WAITING_LIMIT_BYTES = 64 * 2**20


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
        self._written = 0
        self._trouble = ""

    @property
    def trouble(self) -> str:
        """Return why bytes are pending, in the words of the operating system, or ""."""
        return self._trouble

    @property
    def waiting_bytes(self) -> int:
        """Return the number of bytes not yet written to the file."""
        return len(self._waiting)

    @property
    def written_bytes(self) -> int:
        """Return the number of bytes written to the file."""
        return self._written

    @property
    def displaced(self) -> bool:
        """Return whether the file or one of its folders was deleted or moved."""
        if self._descriptor < 0:
            return False
        own = os.fstat(self._descriptor)
        try:
            there = os.stat(self._path)
        except OSError:
            return True
        return (there.st_dev, there.st_ino) != (own.st_dev, own.st_ino)

    def write(self, data: bytes) -> int:
        """Append bytes in memory until the next flush."""
        self._waiting += data
        return len(data)

    def tell(self) -> int:
        """Return the position in the file of the next byte."""
        return self._written + len(self._waiting)

    def flush(self) -> None:
        """Write the pending bytes; an error is kept in `trouble`, and no byte is dropped."""
        done = 0
        try:
            while done < len(self._waiting):
                done += os.write(self._descriptor, memoryview(self._waiting)[done:])
            self._trouble = ""
        except OSError as error:
            self._trouble = error.strerror or str(error)
        self._written += done
        del self._waiting[:done]

    def close(self) -> None:
        """Flush once more and close the file."""
        if self._descriptor >= 0:
            self.flush()
            os.close(self._descriptor)
            self._descriptor = -1


CHUNK_BYTES = 256 * 1024  # 2 ms for the longest call; larger chunks stall the caller
_LARGEST_STAMP_NS = 2**63 - 1  # rosbag2 keeps stamps in a signed integer


class BagWriter(ClosableBag):
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
        """Make the directory with `<name>_0.mcap` in it.

        Args:
            topics: rows of the topic table; recorded with a leading slash.
            metadata: notes on the bag, kept in the MCAP file and in metadata.yaml (custom_data).
            chunk_bytes: size, before compression, at which a chunk is closed.

        Raises:
            BagError: the directory is in use, cannot be made, or a message type is unknown.
        """
        self._directory = Path(directory)
        described = [describe_topic(topic) for topic in topics]
        self._make_directory()
        self._file_name = f"{self._directory.resolve().name}_0.mcap"
        try:
            self._sink = FileSink(self._directory / self._file_name)
        except OSError as error:
            raise self._error(f"its file cannot be made ({error.strerror})") from error
        self._writer = Writer(self._sink, chunk_bytes, CompressionType.ZSTD)
        # A fixed name, not the library's version: equal input, equal bytes.
        self._writer.start(profile="ros2", library="rope_twin")
        self._sink.flush()
        self._topics: dict[str, RecordedTopic] = {}
        self._channels: dict[str, int] = {}
        self._schemas: dict[tuple[str, bytes], int] = {}
        self._counts: dict[str, int] = {}
        self._custom_data: dict[str, str] = {}
        self._first_ns, self._last_ns = _LARGEST_STAMP_NS, 0
        self._closed = False
        self._displaced = False
        if metadata:
            self.add_metadata(metadata)
        for topic in described:
            self.add_topic(topic)

    @property
    def directory(self) -> Path:
        """Return the directory of the bag."""
        return self._directory

    @property
    def counts(self) -> Mapping[str, int]:
        """Return the number of messages by recorded topic name."""
        return self._counts

    @property
    def size_bytes(self) -> int:
        """Return the size of the file [bytes]."""
        return self._sink.written_bytes

    @property
    def trouble(self) -> str:
        """Return why the bag cannot be written at present (moved, or a disk error), or ""."""
        if self._displaced:
            return str(self._displacement())
        if not self._sink.trouble:
            return ""
        return phrase(
            f"bag {self._directory}",
            f"the disk refuses to take it ({self._sink.trouble}), "
            f"{self._sink.waiting_bytes} bytes wait in memory",
            "make room and it goes on",
        )

    def add_metadata(self, metadata: Mapping[str, str]) -> None:
        """Add notes on the bag."""
        self._custom_data.update(metadata)
        self._writer.add_metadata(OWN_RECORD, dict(metadata))
        self._sink.flush()

    def add_topic(self, topic: RecordedTopic) -> None:
        """Add a topic; the same one twice does nothing.

        Raises:
            BagError: another topic of that name is there already.
        """
        known = self._topics.get(topic.name)
        if known == topic:
            return
        if known is not None:
            what = f"topic {topic.name} is {known.type_name} and {topic.type_name} in one bag"
            raise self._error(what, "give each name one type and one quality of service")
        key = (topic.type_name, topic.definition)
        if key not in self._schemas:
            self._schemas[key] = self._writer.register_schema(
                topic.type_name, topic.definition_encoding, topic.definition
            )
        self._channels[topic.name] = self._writer.register_channel(
            topic.name, "cdr", self._schemas[key], topic.channel_metadata()
        )
        self._topics[topic.name] = topic
        self._counts[topic.name] = 0

    def note_channels(self) -> None:
        """Write the topic of each channel outside the chunks.

        The first chunk alone defines the channels until the file's end repeats them: without this
        note its loss in a bag that was cut off would cost all messages.
        """
        noted = {
            str(channel): f"{name} {self._topics[name].type_name}"
            for name, channel in self._channels.items()
        }
        self._writer.add_metadata(CHANNELS_RECORD, noted)
        self._sink.flush()

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
        if name not in self._channels:
            raise self._error(f"it has no topic {name}", did_you_mean(name, self._channels))
        if not 0 <= stamp_ns <= _LARGEST_STAMP_NS:
            what = f"a message on {name} has the stamp {stamp_ns} ns"
            raise self._error(what, "right are nanoseconds since 1970")
        if self._sink.waiting_bytes > WAITING_LIMIT_BYTES:
            raise BagError(self.trouble)
        self._writer.add_message(
            self._channels[name],
            log_time=stamp_ns,
            data=data,
            publish_time=stamp_ns if publish_ns is None else publish_ns,
            sequence=sequence,
        )
        self._counts[name] += 1
        self._first_ns = min(self._first_ns, stamp_ns)
        self._last_ns = max(self._last_ns, stamp_ns)
        if self._sink.waiting_bytes:
            self._sink.flush()

    def check_place(self) -> None:
        """Check whether the bag still exists at its path; if not, `trouble` reports it."""
        self._displaced = self._sink.displaced

    def flush(self) -> None:
        """Close the chunk in progress and hand everything to the operating system."""
        self._writer.flush()

    def close(self) -> None:
        """Close the file and write metadata.yaml; may be called twice.

        Raises:
            BagError: the disk did not take the rest; what it took can be recovered.
        """
        if self._closed:
            return
        self._closed = True
        self._writer.flush()
        summary = self._summary()
        self._writer.add_metadata(ROSBAG_RECORD, {"serialized_metadata": summary.as_yaml()})
        self._writer.finish()
        self.check_place()
        self._sink.close()
        if self._displaced:
            raise self._displacement()
        if self._sink.waiting_bytes:
            raise self._error(
                f"the disk did not take its last {self._sink.waiting_bytes} bytes "
                f"({self._sink.trouble})",
                f"`rope_twin recover {self._directory}` saves what is there",
            )
        self._write_metadata_file(summary.as_file())

    def _summary(self) -> BagSummary:
        empty = self._first_ns > self._last_ns
        return BagSummary(
            file_name=self._file_name,
            topics=list(self._topics.values()),
            counts=self._counts,
            start_ns=0 if empty else self._first_ns,
            duration_ns=0 if empty else self._last_ns - self._first_ns,
            custom_data=self._custom_data,
        )

    def _write_metadata_file(self, text: str) -> None:
        try:
            write_whole(self._directory / "metadata.yaml", text.encode())
        except OSError as error:
            raise self._error(
                f"metadata.yaml cannot be written ({error.strerror})",
                f"`rope_twin recover {self._directory}` makes one",
            ) from error

    def _make_directory(self) -> None:
        try:
            self._directory.mkdir(parents=True, exist_ok=True)
            in_use = any(self._directory.iterdir())
        except OSError as error:
            raise self._error(f"it cannot be made ({error.strerror})") from error
        if in_use:
            raise self._error("the directory holds something", "name one that does not exist yet")

    def _displacement(self) -> BagError:
        return self._error(
            "its folder or file was deleted or moved while it was being recorded",
            "what it held is lost or is where it was moved to: start another recording",
        )

    def _error(self, what: str, right: str = "name a place that can be written") -> BagError:
        return BagError(phrase(f"bag {self._directory}", what, right))
