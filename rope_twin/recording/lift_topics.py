"""Heave, line out and tension in the messages of a bag, by one rule for all who read a lift.

Measured topics are read as a running twin reads them. A message that it would refuse is left out
and counted.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple, Protocol, TypeVar

from mcap.records import Channel, Schema

from rope_twin.errors import InputError
from rope_twin.messages.cdr import decode
from rope_twin.messages.inputs import read_heave, read_measurement
from rope_twin.messages.status import counted
from rope_twin.quantity import or_nan
from rope_twin.recording.bag import BagReader, DamageError, TopicContent
from rope_twin.recording.mcap_scan import McapScan, StoredMessage, mcap_files
from rope_twin.topics import WINCH_MEASURED, is_topic

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
        with BagReader(path) as bag:
            return read(bag), ()
    except DamageError as error:
        if not mcap_files(path):
            raise
        damaged = _DamagedBag(path)
        return read(damaged), tuple(damaged.problems or [str(error)])


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
        matching = [
            (message.log_ns, message.data)
            for name, _, message in self._stored([])
            if name == topic_name
        ]
        yield from sorted(matching, key=lambda message: message[0])

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


HEAVE, HANG_OFF = "ship/heave", "hang_off/odometry"
LENGTH, TENSION_TOP = "ropes/length", "ropes/tension_top"
Content = TypeVar("Content")


class RopeValues(NamedTuple):
    """Line out and tension of a winch or rope; NaN: not there."""

    name: str  # "": the only one
    line_out_m: float
    tension_n: float


def vertical_motion(topic: str, data: bytes) -> tuple[float, tuple[float, float]]:
    """Return stamp [s], height [m] and its rate [m/s] of a message of HEAVE or HANG_OFF.

    Raises:
        InputError: it is no such message.
    """
    if topic == HEAVE:
        stamp_ns, moved = read_heave(data)
        return stamp_ns * 1e-9, moved
    message: Any = decode(topic, data)
    return _stamp_s(message), (
        float(message.pose.pose.position.z),
        float(message.twist.twist.linear.z),
    )


def rope_values(topic: str, data: bytes) -> tuple[float, list[RopeValues]]:
    """Return stamp [s] and values of a message of WINCH_MEASURED, LENGTH or TENSION_TOP.

    Raises:
        InputError: it is no such message.
    """
    if topic == WINCH_MEASURED:
        _, stamp_ns, measured = read_measurement(topic, data)
        rows = [RopeValues(name, or_nan(m), or_nan(n)) for name, m, _, n in measured]
        return stamp_ns * 1e-9, rows
    message: Any = decode(topic, data)
    columns = [list(values) for values in (message.position, message.effort)]
    columns = [column or [math.nan] * len(message.name) for column in columns]
    return _stamp_s(message), [
        RopeValues(str(name), float(m), float(n))
        for name, m, n in zip(message.name, *columns, strict=False)
    ]


def contents(
    bag: Messages,
    names: Iterable[str],
    topic: str,
    read: Callable[[str, bytes], Content],
    refused: Counter[str],
) -> Iterator[Content]:
    """Yield what `read` finds in each message of a topic; refused: counts those that it refuses.

    names: of the topic in the bag; topic: without its namespace.
    """
    for name in names:
        for _, data in bag.messages(name):
            try:
                yield read(topic, data)
            except InputError:
                refused[topic] += 1


def names_of(bag: Messages, topic: str) -> list[str]:
    """Return the names that a topic has in a bag, one for each namespace."""
    return [name for name in bag.topics if is_topic(name, topic)]


def refusal_words(refused: Counter[str]) -> tuple[str, ...]:
    """Return a sentence for each topic of which messages were left out."""
    return tuple(
        f"{counted(count, 'message')} of {topic} could not be read and "
        f"{'was' if count == 1 else 'were'} left out"
        for topic, count in refused.items()
    )


def _stamp_s(message: Any) -> float:
    return float(message.header.stamp.sec) + 1e-9 * float(message.header.stamp.nanosec)
