"""Log of applied inputs, for the exact replay of a run, and measurements of a bag.

A message of twin/inputs is one JSON object. `run` and `session` identify its twin/session, `number`
counts the messages of a session from 1. Either `calls` were made at `time_ns`, or the snapshots
after `skipped_ns[0]` and before `skipped_ns[1]` were computed and not published.

The measurements of a bag (line out, line speed, tensions, payload depth) go to an unpaced run.
Stamps are placed in simulation time by the ROS time of t = 0: that of the replayed motion where it
comes from a bag with stamps of the same voyage, else that of the run that the bag recorded
(`twin/epoch`), else the first reading. The record is played once; nothing is made up after it.
"""

from __future__ import annotations

import json
from bisect import bisect_left
from collections import Counter, deque
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

from rope_twin.errors import BagError, InputError
from rope_twin.messages import decode
from rope_twin.messages.cdr import encode_text
from rope_twin.messages.inputs import read_measurement
from rope_twin.messages.reports import counted
from rope_twin.messages.templates import NANOSECONDS, nanoseconds
from rope_twin.recording.bag import BagReader, find_bag
from rope_twin.topics import INPUT_LOG_TOPIC, MEASURED_TOPICS, SESSION_TOPIC, is_topic, slot_of
from rope_twin.twin.input_queue import Call, LogEntry, calls_of, plain_calls
from rope_twin.twin.readings import (
    MOTOR,
    MOTOR_TENSION,
    PAYLOAD,
    PAYLOAD_DEPTH,
    WINCH_MEASURED,
    WINCH_SENSORS,
    Measurement,
)
from rope_twin.twin.snapshot import Snapshot

_EPOCH = "twin/epoch"
APART_NS = 86_400 * NANOSECONDS  # readings further from t = 0 are of another voyage
GROUPS = {WINCH_SENSORS: WINCH_MEASURED, MOTOR: MOTOR_TENSION, PAYLOAD: PAYLOAD_DEPTH}


def encode_json(content: Any) -> bytes:
    """Return a std_msgs/String with a JSON text; floats are restored bit by bit."""
    return encode_text(json.dumps(content))


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


def _damaged(topic: str, reason: str) -> BagError:
    remedy = "give a bag that rope_twin recorded"
    return BagError(f"topic {topic}", f"a message does not make sense ({reason})", remedy)


class MeasuredReplay:
    """Measurements by simulation time, in the order of their stamps."""

    def __init__(self, measurements: list[Measurement], source: str, note: str = "") -> None:
        """Keep measurements whose stamps are in simulation time [ns]."""
        self._measurements = sorted(measurements, key=lambda measurement: measurement.stamp_ns)
        self._stamps = [measurement.stamp_ns for measurement in self._measurements]
        self.source, self.note = source, note

    def between(self, from_ns: int, to_ns: int) -> list[Measurement]:
        """Return the measurements with from_ns <= stamp_ns < to_ns, in order."""
        first, end = bisect_left(self._stamps, from_ns), bisect_left(self._stamps, to_ns)
        return self._measurements[first:end]


def open_measured(bag: str, begins_ns: int = 0) -> MeasuredReplay:
    """Return the measurements of a bag; begins_ns: ROS time of t = 0, 0: by the bag itself.

    Raises:
        BagError: it is no bag, has no measurement, or none near the time of the motion.
    """
    path = find_bag(bag)
    with BagReader(path) as reader:
        messages = list(_measurements(reader))
        epoch_ns = _epoch_ns(reader)
    where = f"bag {path}"
    readings = [message for message in messages if isinstance(message, Measurement)]
    if not readings:
        remedy = f"name one with {', '.join(MEASURED_TOPICS)}, whose messages are stamped"
        faults = [message for message in messages if isinstance(message, str)]
        raise BagError(where, faults[0] if faults else "it has no measurements", remedy)
    first_ns, last_ns = (pick(reading.stamp_ns for reading in readings) for pick in (min, max))
    zero_ns = begins_ns or epoch_ns or first_ns
    if last_ns < zero_ns or first_ns > zero_ns + APART_NS:
        early_s = (zero_ns - first_ns) * 1e-9
        side = "before" if early_s > 0 else "after"
        problem = f"its readings begin {abs(early_s):.6g} s {side} t = 0"
        remedy = "heave and measurements must be of the same time, by one clock"
        raise BagError(where, problem, remedy)
    counts = Counter(reading.source for reading in readings)
    parts = [counted(counts[source], group.replace("_", " ") + " reading")
             for source, group in GROUPS.items() if counts[source]]  # fmt: skip
    span = f"from {(first_ns - zero_ns) * 1e-9:.2f} to {(last_ns - zero_ns) * 1e-9:.2f} s"
    source = f"bag {path.name}: {', '.join(parts)}, {span}"
    wrong = Counter(message for message in messages if isinstance(message, str))
    notes = [f"{where}: {counted(count, 'message')} left out: {reason}"
             for reason, count in wrong.most_common(3)]  # fmt: skip
    placed = [reading._replace(stamp_ns=reading.stamp_ns - zero_ns) for reading in readings]
    return MeasuredReplay(placed, source, " ".join(notes))


def _measurements(reader: BagReader) -> Iterator[Measurement | str]:
    """Yield each measurement, stamped in ROS time, or why a message is none.

    Raises:
        BagError: a topic is there twice, in several namespaces.
    """
    for topic in MEASURED_TOPICS:
        names = [name for name in reader.topics if is_topic(name, topic)]
        if len(names) > 1:
            problem = f"{topic} is there in {len(names)} namespaces"
            raise BagError(f"bag {reader.path}", problem, f"keep one of {', '.join(names)}")
        for name in names:
            for _, data in reader.messages(name):
                try:
                    measurement = read_measurement(topic, data)
                except InputError as error:
                    yield str(error)
                    continue
                yield measurement if measurement.stamp_ns > 0 else f"{topic}: its stamp is 0"


def _epoch_ns(reader: BagReader) -> int:
    """Return the ROS time of t = 0 of the run that the bag recorded; 0: none, or several."""
    epochs: set[int] = set()
    for name in (topic for topic in reader.topics if is_topic(topic, _EPOCH)):
        for _, data in reader.messages(name):
            epochs.add(nanoseconds(decode(_EPOCH, data)))
    return epochs.pop() if len(epochs) == 1 else 0
