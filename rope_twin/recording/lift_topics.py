"""Heave, line out and tension in the messages of a bag, by one rule for all who read a lift.

Measured topics are read as a running twin reads them. A message that it would refuse is left out
and counted.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from typing import Any, NamedTuple, TypeVar

from rope_twin.errors import InputError
from rope_twin.messages.cdr import decode
from rope_twin.messages.inputs import read_heave, read_measurement
from rope_twin.messages.status import counted
from rope_twin.quantity import or_nan
from rope_twin.recording.damaged_bag import Messages
from rope_twin.topics import WINCH_MEASURED, is_topic

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
    columns = [own or [math.nan] * len(message.name) for own in columns]
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
