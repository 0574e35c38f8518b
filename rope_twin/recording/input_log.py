"""Log of applied inputs as messages: written by a run and read back for its exact replay.

A message of twin/inputs is one JSON object. `run` and `session` identify its twin/session, `number`
counts the messages of a session from 1. Either `calls` were made at `time_ns`, or the snapshots
after `skipped_ns[0]` and before `skipped_ns[1]` were computed and not published.
"""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

from rope_twin.cadence import slot_of
from rope_twin.errors import BagError, InputError, phrase
from rope_twin.messages import decode
from rope_twin.messages.cdr import new, serialise
from rope_twin.topics import INPUT_LOG_TOPIC, SESSION_TOPIC
from rope_twin.twin.input_queue import Call, LogEntry, calls_of, plain_calls
from rope_twin.twin.snapshot import Snapshot


def encode_json(content: Any) -> bytes:
    """Return a std_msgs/String with a JSON text; floats are restored bit by bit."""
    return serialise(new("std_msgs/msg/String", data=json.dumps(content)))


def decode_json(topic: str, data: bytes) -> dict[str, Any]:
    """Return the JSON object in a std_msgs/String.

    Raises:
        BagError: there is none.
    """
    try:
        content = json.loads(decode(topic, data).data)
    except (InputError, ValueError, RecursionError) as error:
        raise _damaged(topic, str(error)) from error
    if not isinstance(content, dict):
        raise _damaged(topic, "no JSON object")
    return content


class Mark(NamedTuple):
    """A session that begins while the twin runs."""

    time_ns: int
    described: dict[str, Any]  # content of twin/session


class InputLog:
    """Entries on their way from the thread that steps to the one that publishes."""

    def __init__(self, run: str) -> None:
        """Make an empty log; `run`: a name that is unique in the bag."""
        self.run = run
        self.session = 0  # number of the newest one, from 1
        self.logged = 0  # messages of the newest session
        self._waiting: deque[LogEntry | Mark] = deque()
        self._published_ns = 0

    def begin(self, time_ns: int) -> dict[str, Any]:
        """Start a session at this time, between steps, and return its part of twin/session."""
        self._published_ns = time_ns
        return self._next_session()

    def take(self, entry: LogEntry | Mark) -> None:
        """Queue an entry; to be called by the solver thread."""
        self._waiting.append(entry)

    def messages(self, snapshot: Snapshot | None) -> Iterator[tuple[str, dict[str, Any]]]:
        """Return topic and content of the entries before a snapshot (None: all).

        With snapshots that were thrown out before this one. A session that begins is the content of
        twin/session without the number of messages that were published before.
        """
        while self._waiting and (snapshot is None or self._waiting[0].time_ns < snapshot.stamp_ns):
            entry = self._waiting.popleft()
            if isinstance(entry, Mark):
                yield SESSION_TOPIC, entry.described | self._next_session()
            else:
                content = {"time_ns": entry.time_ns, "calls": plain_calls(entry.calls)}
                yield INPUT_LOG_TOPIC, self._numbered(content)
        if snapshot is None:
            return
        if snapshot.stamp_ns - slot_of(snapshot)[1] > self._published_ns:
            skipped = {"skipped_ns": [self._published_ns, snapshot.stamp_ns]}
            yield INPUT_LOG_TOPIC, self._numbered(skipped)
        self._published_ns = snapshot.stamp_ns

    def _next_session(self) -> dict[str, Any]:
        self.session += 1
        before, self.logged = self.logged, 0
        return {"run": self.run, "session": self.session, "logged_before": before}

    def _numbered(self, content: dict[str, Any]) -> dict[str, Any]:
        self.logged += 1
        return {"run": self.run, "session": self.session, "number": self.logged, **content}


@dataclass(frozen=True)
class LoggedCalls:
    """One message of the log; its calls are read when they are needed."""

    number: int
    time_ns: int
    plain: Any

    def calls(self) -> tuple[Call, ...]:
        """Return the calls with their arguments.

        Raises:
            BagError: they are not valid calls.
        """
        try:
            return calls_of(self.plain)
        except (ValueError, TypeError) as error:
            raise _damaged(INPUT_LOG_TOPIC, str(error)) from error


@dataclass(frozen=True)
class Skipped:
    """Snapshots that were not published: those of twin times between the two."""

    number: int
    after_ns: int
    before_ns: int


def read_log(data: bytes) -> tuple[tuple[str, int], LoggedCalls | Skipped]:
    """Return run and number of the session, and the content of a message of twin/inputs.

    Raises:
        BagError: it is not such a message.
    """
    content = decode_json(INPUT_LOG_TOPIC, data)
    try:
        session = str(content["run"]), int(content["session"])
        number = int(content["number"])
        if "calls" in content:
            return session, LoggedCalls(number, int(content["time_ns"]), content["calls"])
        after_ns, before_ns = content["skipped_ns"]
        return session, Skipped(number, int(after_ns), int(before_ns))
    except (KeyError, TypeError, ValueError) as error:
        raise _damaged(INPUT_LOG_TOPIC, repr(error)) from error


def _damaged(topic: str, why: str) -> BagError:
    right = "give a bag that rope_twin recorded"
    return BagError(phrase(f"topic {topic}", f"a message does not make sense ({why})", right))
