"""Bags whose recording was cut off or damaged, read as far as they are whole."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Protocol, TypeVar

from mcap.records import Channel, Schema

from rope_twin.recording.bag import BagReader, DamageError, TopicContent
from rope_twin.recording.mcap_scan import McapScan, StoredMessage, mcap_files

Result = TypeVar("Result")


class Messages(Protocol):
    """Topics and messages of a bag."""

    path: Path

    @property
    def topics(self) -> Mapping[str, TopicContent]:
        """Return the topics of the bag, by name."""

    def messages(self, topic_name: str) -> Iterator[tuple[int, bytes]]:
        """Return log time [ns] and CDR bytes of each message of a topic, by log time."""


def read_undamaged(
    path: Path, read: Callable[[Messages], Result]
) -> tuple[Result, tuple[str, ...]]:
    """Return the result of `read` on a bag, and the bag's damage, a sentence each; (): none.

    Of a damaged bag `read` is given what is whole, by a pass over the file for each topic.

    Raises:
        BagError: the bag does not exist, is none, or `read` raises it.
    """
    try:
        with BagReader(path) as whole:
            return read(whole), ()
    except DamageError as error:
        if not mcap_files(path):
            raise
        rest = _DamagedBag(path)
        return read(rest), tuple(rest.problems or [str(error)])


class _DamagedBag:
    """Reader of the whole messages of a damaged bag."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.problems: list[str] = []
        self.topics: dict[str, TopicContent] = {}
        for name, type_name, _ in self._stored(self.problems):
            before = self.topics.get(name, TopicContent(type_name, 0))
            self.topics[name] = TopicContent(before.type_name, before.messages + 1)

    def messages(self, topic_name: str) -> Iterator[tuple[int, bytes]]:
        """Return log time [ns] and CDR bytes of each message of a topic, by log time."""
        own = [(one.log_ns, one.data) for name, _, one in self._stored([]) if name == topic_name]
        yield from sorted(own, key=lambda one: one[0])

    def _stored(self, problems: list[str]) -> Iterator[tuple[str, str, StoredMessage]]:
        """Return topic, type and message in file order; problems: takes the damage."""
        for file in mcap_files(self.path):
            scan, types = McapScan(file), dict[int, str]()
            channels: dict[int, tuple[str, str]] = {}
            for record in scan.records():
                if isinstance(record, Schema):
                    types[record.id] = record.name
                elif isinstance(record, Channel) and record.schema_id in types:
                    channels[record.id] = record.topic, types[record.schema_id]
                elif isinstance(record, StoredMessage) and record.channel_id in channels:
                    yield *channels[record.channel_id], record
            problems += scan.problems
