"""Format of a rosbag2 directory with MCAP storage, and reader of rosbag2 bags.

It follows rosbag2's own reader (metadata version 9, ROS 2 Kilted): policies as words in the
channel's `offered_qos_profiles`, next to `topic_type_hash`, and a copy of the bag's metadata inside
the MCAP file (record `rosbag2`), so that the file can be opened without its directory. Bags of
others are read with rosbags: MCAP or SQLite, a directory or a bare .mcap file.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import yaml
from rosbags.rosbag2 import Reader

from rope_twin.errors import BagError, did_you_mean
from rope_twin.files import share_dir
from rope_twin.messages.cdr import typestore
from rope_twin.topics import QOS_ROWS, Qos, Topic, recorded_name

METADATA_VERSION = 9
ROS_DISTRO = "kilted"
OWN_RECORD = "rope_twin"  # name of the MCAP metadata record with the bag's own notes
CHANNELS_RECORD = "rope_twin_channels"  # and of the one with its channels: name and type by id
ROSBAG_RECORD = "rosbag2"  # name of the one that rosbag2 looks for

FileStates = tuple[tuple[str, int, int], ...]

_FOREVER = {"sec": 9223372036, "nsec": 854775807}  # rosbag2's infinite duration


@dataclass(frozen=True)
class RecordedTopic:
    """A topic as a bag describes it."""

    name: str  # with a leading slash
    type_name: str  # package/msg/Type
    definition: bytes  # text of the type and of those inside it
    definition_encoding: str = "ros2msg"
    type_hash: str = ""  # RIHS01_...
    qos_profiles: str = ""  # YAML list; "" where unknown
    extra: Mapping[str, str] = field(default_factory=dict)  # further notes on the channel

    def channel_metadata(self) -> dict[str, str]:
        """Return the metadata of the MCAP channel."""
        own = {"offered_qos_profiles": self.qos_profiles, "topic_type_hash": self.type_hash}
        return {**self.extra, **own}


def describe_topic(topic: Topic) -> RecordedTopic:
    """Return the description in a bag of a topic of the table.

    Raises:
        BagError: its message type is not a standard one.
    """
    store = typestore()
    if topic.type_name not in store.fielddefs:
        problem = f"unknown message type '{topic.type_name}'"
        remedy = did_you_mean(topic.type_name, store.fielddefs)
        raise BagError(f"topic {topic.name}", problem, remedy)
    definition, _ = store.generate_msgdef(topic.type_name, ros_version=2)
    return RecordedTopic(
        name=recorded_name(topic.name),
        type_name=topic.type_name,
        definition=definition.encode(),
        type_hash=store.hash_rihs01(topic.type_name),
        qos_profiles=_qos_text(topic.qos),
    )


def _qos_text(qos: Qos) -> str:
    row = QOS_ROWS[qos]
    profile = {
        "history": "keep_last",
        "depth": row.depth,
        "reliability": "reliable" if row.reliable else "best_effort",
        "durability": "transient_local" if row.for_late_joiners else "volatile",
        "deadline": _FOREVER,
        "lifespan": _FOREVER,
        "liveliness": "automatic",
        "liveliness_lease_duration": _FOREVER,
        "avoid_ros_namespace_conventions": False,
    }
    return _dump([profile]).strip()


@dataclass(frozen=True)
class FileSummary:
    """One file of a bag: its name, the count and the time span of its messages."""

    name: str
    counts: Mapping[str, int]  # by topic name
    start_ns: int
    end_ns: int  # of the last message; before the start: there is none

    @property
    def messages(self) -> int:
        """Return the number of its messages."""
        return sum(self.counts.values())


@dataclass(frozen=True)
class BagSummary:
    """Content of metadata.yaml."""

    files: Sequence[FileSummary]  # at least one
    topics: Sequence[RecordedTopic]
    custom_data: Mapping[str, str]

    def as_yaml(self) -> str:
        """Return the text of the `rosbag2_bagfile_information` mapping."""
        span = _span(self.files)
        return _dump(
            {
                "version": METADATA_VERSION,
                "storage_identifier": "mcap",
                "duration": span.pop("duration"),
                **span,
                "topics_with_message_count": [self._topic(topic) for topic in self.topics],
                "compression_format": "",
                "compression_mode": "",
                "relative_file_paths": [file.name for file in self.files],
                "files": [{"path": file.name, **_span([file])} for file in self.files],
                "custom_data": dict(self.custom_data) or None,
                "ros_distro": ROS_DISTRO,
            }
        )

    def as_file(self) -> str:
        """Return the text of metadata.yaml."""
        inner = self.as_yaml().splitlines()
        return "\n".join(["rosbag2_bagfile_information:", *(f"  {line}" for line in inner)]) + "\n"

    def _topic(self, topic: RecordedTopic) -> dict[str, Any]:
        return {
            "topic_metadata": {
                "name": topic.name,
                "type": topic.type_name,
                "serialization_format": "cdr",
                "offered_qos_profiles": _profiles(topic.qos_profiles),
                "type_description_hash": topic.type_hash,
            },
            "message_count": sum(file.counts.get(topic.name, 0) for file in self.files),
        }


def _span(files: Sequence[FileSummary]) -> dict[str, Any]:
    """Return start, duration and message count of files, as rosbag2 names them."""
    filled = [file for file in files if file.messages]
    start_ns = min((file.start_ns for file in filled), default=0)
    end_ns = max((file.end_ns for file in filled), default=0)
    return {
        "starting_time": {"nanoseconds_since_epoch": start_ns},
        "duration": {"nanoseconds": end_ns - start_ns},
        "message_count": sum(file.messages for file in files),
    }


@cache  # topics share a few
def _profiles(text: str) -> list[Any]:
    return yaml.safe_load(text or "[]") or []


class _PlainDumper(getattr(yaml, "CSafeDumper", yaml.SafeDumper)):  # type: ignore[misc]
    """No anchors: yaml-cpp reads them, but people should not have to."""

    def ignore_aliases(self, data: Any) -> bool:
        return True


def _dump(data: Any) -> str:
    return yaml.dump(
        data, Dumper=_PlainDumper, sort_keys=False, allow_unicode=True, width=2**31 - 1
    )


class ClosableBag(ABC):
    """Bag that is closed at the end of a `with` block, whatever ends it."""

    @abstractmethod
    def close(self) -> None:
        """Close the bag; may be called twice.

        Raises:
            BagError: the written data is not safe on disk.
        """

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Close in any case: the data written before an error is worth keeping."""
        try:
            self.close()
        except BagError as failure:
            if error is None:
                raise
            error.add_note(str(failure))


MCAP_MAGIC = b"\x89MCAP0\r\n"


@dataclass(frozen=True)
class TopicContent:
    """One topic of a bag."""

    type_name: str
    messages: int  # as the bag's own index says


def list_bags() -> dict[str, Path]:
    """Return the names and paths of the bags that come with the package."""
    return {file.parent.name: file.parent for file in share_dir().glob("bags/*/metadata.yaml")}


def find_bag(bag: str | Path) -> Path:
    """Return the path of a bag, from a name in bags/ or a path (a directory or an .mcap file).

    Raises:
        BagError: there is neither, or it may not be read.
    """
    known = list_bags()
    if str(bag) in known:
        return known[str(bag)]
    path = Path(bag)
    if not str(bag).strip() or not is_readable(path):
        remedy = did_you_mean(bag, known) if known else "give the path of a bag"
        raise BagError(f"bag {bag}", "there is no such file or name in bags/", remedy)
    return path


def is_readable(bag: Path) -> bool:
    """Return whether there is such a bag.

    Raises:
        BagError: its folder or one of its files may not be read.
    """
    try:
        exists = bag.exists()
        for file in bag.iterdir() if bag.is_dir() else [bag]:
            if file.is_file() and file.suffix in (".mcap", ".db3", ".yaml"):
                file.open("rb").close()
    except OSError as error:
        name = Path(error.filename or bag).name
        problem = f"{name} cannot be read ({error.strerror})"
        raise BagError(f"bag {bag}", problem, "check path and permissions") from error
    return exists


def files_of(bag: Path) -> FileStates:
    """Return path, size [B] and time of change [ns] of each file of a bag; (): none is found."""
    try:
        files = sorted(bag.resolve().iterdir()) if bag.is_dir() else [bag.resolve()]
        states = [(file, file.stat()) for file in files]
    except OSError:
        return ()
    return tuple((str(file), state.st_size, state.st_mtime_ns) for file, state in states)


def free_path(path: Path, suffix: str = "") -> Path:
    """Return the path, or the first free one of PATH_2, PATH_3 and so on, before the suffix."""
    number, free = 1, path
    while free.exists():
        number += 1
        free = path.with_name(f"{path.name.removesuffix(suffix)}_{number}{suffix}")
    return free


class DamageError(BagError):
    """A bag that is damaged or was cut off."""


class BagReader(ClosableBag):
    """A bag that is open for reading; also a context manager."""

    def __init__(self, path: Path) -> None:
        """Open the bag.

        Raises:
            BagError: it is not a readable bag; one sentence with the reason.
        """
        self.path = Path(path)
        _check_outside(self.path)
        try:
            self._reader = Reader(self.path)
            self._reader.open()
        except Exception as error:  # the parser meets damage in any form; all of it is reported
            raise _unreadable(self.path, error) from error

    @property
    def topics(self) -> Mapping[str, TopicContent]:
        """Return the topics of the bag, by name."""
        content: dict[str, TopicContent] = {}
        for connection in self._reader.connections:
            before = content.get(connection.topic, TopicContent(connection.msgtype, 0))
            count = before.messages + connection.msgcount
            content[connection.topic] = TopicContent(connection.msgtype, count)
        return content

    @property
    def custom_data(self) -> dict[str, str]:
        """Return the notes on the bag in its metadata.yaml."""
        return dict(self._reader.storage.metadata.custom or {})

    @property
    def start_ns(self) -> int:
        """Return the log time of the first message [ns]."""
        return int(self._reader.start_time)

    @property
    def duration_ns(self) -> int:
        """Return the time from the first to the last message [s]."""
        return max(0, int(self._reader.duration) - 1)  # rosbags counts to just after the last

    def messages(self, topic_name: str) -> Iterator[tuple[int, bytes]]:
        """Return log time [ns] and CDR bytes of each message of a topic, by log time.

        Raises:
            BagError: the bag turns out to be damaged.
        """
        connections = [c for c in self._reader.connections if c.topic == topic_name]
        if not connections:
            remedy = did_you_mean(topic_name, self.topics) if self.topics else "the bag is empty"
            raise BagError(f"bag {self.path}", f"it has no topic {topic_name}", remedy)
        try:
            for _, stamp_ns, data in self._reader.messages(connections):
                yield int(stamp_ns), bytes(data)
        except Exception as error:
            raise _unreadable(self.path, error) from error

    def close(self) -> None:
        """Close the files."""
        self._reader.close()


def _check_outside(path: Path) -> None:
    """Report faults that are visible without parsing, each with its own sentence."""
    where = f"bag {path}"
    if not is_readable(path):
        raise BagError(where, "it does not exist", "give the path of a bag")
    if path.is_dir():
        files = sorted(path.glob("*.mcap"))
        if not (path / "metadata.yaml").is_file():
            if files:
                raise DamageError(where, "it has no metadata.yaml", _recover(path))
            raise BagError(where, "it is a folder without metadata.yaml", "a bag has one")
    elif path.suffix in (".mcap", ".db3"):
        files = [path] if path.suffix == ".mcap" else []
    else:
        raise BagError(where, "it is not a bag", "right is a rosbag2 directory or an .mcap file")
    for file in files:
        fault = _fault_at_ends(file)
        if fault:
            raise DamageError(where, f"{file.name} {fault}", _recover(path))


def _fault_at_ends(file: Path) -> str:
    try:
        with file.open("rb") as stream:
            size = stream.seek(0, 2)
            stream.seek(0)
            head = stream.read(len(MCAP_MAGIC))
            stream.seek(max(0, size - len(MCAP_MAGIC)))
            tail = stream.read()
    except OSError as error:
        return f"cannot be read ({error.strerror})"
    if size == 0:
        return "is empty"
    if head != MCAP_MAGIC:
        return "is not an MCAP file"
    if size < 3 * len(MCAP_MAGIC) or tail != MCAP_MAGIC:
        return "stops before its end (was its recorder killed?)"
    return ""


def _recover(path: Path) -> str:
    return f"`rope_twin recover {path}` saves what is there"


def _unreadable(path: Path, error: Exception) -> DamageError:
    reason = " ".join(str(error).split()).rstrip(".") or type(error).__name__
    reason = reason if len(reason) <= 160 else f"{reason[:157]}..."
    return DamageError(f"bag {path}", f"it is damaged ({reason})", _recover(path))
