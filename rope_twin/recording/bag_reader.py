"""Reader of rosbag2 bags (MCAP or SQLite, a directory or a bare .mcap file), with error reports."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from rosbags.rosbag2 import Reader

from rope_twin.errors import BagError, did_you_mean, phrase
from rope_twin.recording.bag_format import ClosableBag
from rope_twin.share import share_dir

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
        BagError: there is neither.
    """
    known = list_bags()
    if str(bag) in known:
        return known[str(bag)]
    path = Path(bag)
    if not str(bag).strip() or not path.exists():
        right = did_you_mean(bag, known) if known else "give the path of a bag"
        raise BagError(phrase(f"bag {bag}", "there is no such file or name in bags/", right))
    return path


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
        except Exception as error:  # the parser meets damage in any form; all of it is told
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
        wanted = [c for c in self._reader.connections if c.topic == topic_name]
        if not wanted:
            right = did_you_mean(topic_name, self.topics) if self.topics else "the bag is empty"
            raise BagError(phrase(f"bag {self.path}", f"it has no topic {topic_name}", right))
        try:
            for _, stamp_ns, data in self._reader.messages(wanted):
                yield int(stamp_ns), bytes(data)
        except Exception as error:
            raise _unreadable(self.path, error) from error

    def close(self) -> None:
        """Close the files."""
        self._reader.close()


def _check_outside(path: Path) -> None:
    """Report faults that are visible without parsing, each with its own sentence."""
    where = f"bag {path}"
    if not path.exists():
        raise BagError(phrase(where, "it does not exist", "give the path of a bag"))
    if path.is_dir():
        files = sorted(path.glob("*.mcap"))
        if not (path / "metadata.yaml").is_file():
            if files:
                raise BagError(phrase(where, "it has no metadata.yaml", _recover(path)))
            raise BagError(phrase(where, "it is a folder without metadata.yaml", "a bag has one"))
    elif path.suffix in (".mcap", ".db3"):
        files = [path] if path.suffix == ".mcap" else []
    else:
        raise BagError(
            phrase(where, "it is not a bag", "right is a rosbag2 directory or an .mcap file")
        )
    for file in files:
        fault = _fault_at_ends(file)
        if fault:
            raise BagError(phrase(where, f"{file.name} {fault}", _recover(path)))


def _fault_at_ends(file: Path) -> str:
    try:
        with file.open("rb") as stream:
            size = stream.seek(0, 2)
            stream.seek(0)
            head = stream.read(len(MCAP_MAGIC))
            stream.seek(max(0, size - len(MCAP_MAGIC)))
            tail = stream.read()
    except OSError as error:
        return f"cannot be opened ({error.strerror})"
    if size == 0:
        return "is empty"
    if head != MCAP_MAGIC:
        return "is not an MCAP file"
    if size < 3 * len(MCAP_MAGIC) or tail != MCAP_MAGIC:
        return "stops before its end (was its recorder killed?)"
    return ""


def _recover(path: Path) -> str:
    return f"`rope_twin recover {path}` saves what is there"


def _unreadable(path: Path, error: Exception) -> BagError:
    reason = " ".join(str(error).split()).rstrip(".") or type(error).__name__
    reason = reason if len(reason) <= 160 else f"{reason[:157]}..."
    return BagError(phrase(f"bag {path}", f"it is damaged ({reason})", _recover(path)))
