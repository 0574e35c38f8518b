"""Content of a bag that an exact replay needs: sessions, input log, and recorded inputs.

The bag is read from its beginning, so that a truncated bag is read up to its break.
"""

from __future__ import annotations

import struct
from bisect import bisect_right
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rope_twin.errors import BagError, InputError
from rope_twin.messages import inputs
from rope_twin.recording.bag import find_bag
from rope_twin.recording.mcap_scan import McapScan, mcap_files
from rope_twin.recording.session import (
    LoggedCalls,
    Session,
    SkippedSnapshots,
    decode_json,
    read_log,
)
from rope_twin.topics import (
    CUT_TOPIC,
    INPUT_LOG_TOPIC,
    INPUTS,
    LOWER_END,
    MEASURED_DEPTH,
    MEASURED_TOPICS,
    MOTOR_TENSION,
    ORDER_TOPICS,
    SESSION_TOPIC,
    SWITCH_TOPIC,
    WINCH_MEASURED,
)
from rope_twin.twin.input_queue import Call
from rope_twin.twin.motion.ship_motion import ShipPose
from rope_twin.twin.readings import MOTOR, PAYLOAD, Measurement
from rope_twin.twin.validity import pose_numbers
from rope_twin.twin.winch.commands import COMMANDER_EVENTS, WinchCommand

_STAMPED = "hang_off/wrench"  # due at every slot, with a stamp
_STAMP = struct.Struct("<iI")  # behind the encapsulation of 4 bytes
_JOINED_NS = 1_000_000_000  # messages that begin so long after their session: a late recorder
_TAIL_NS = 1_000_000_000  # of a bag that was cut off: log and messages may not reach equally far
_RECOVERED = "recovered"  # note that `rope_twin recover` leaves on a bag
Values = tuple[Any, ...]


class Recorded(NamedTuple):
    """One message of a bag."""

    topic: str
    sequence: int  # its number among the publisher's messages; 0: not known
    log_ns: int
    data: bytes


@dataclass
class RecordedSession:
    """A session with its part of the log."""

    session: Session
    log_ns: int
    entries: list[LoggedCalls] = field(default_factory=list)
    skipped: list[SkippedSnapshots] = field(default_factory=list)
    known_ns: int | None = None  # slots that begin before this have all their inputs; None: all
    gap: str = ""  # why not all

    def calls(self) -> dict[int, list[LoggedCalls]]:
        """Return the log by simulation time."""
        by_time: dict[int, list[LoggedCalls]] = defaultdict(list)
        for entry in self.entries:
            by_time[entry.time_ns].append(entry)
        return by_time

    def skips(self, stamp_ns: int) -> bool:
        """Return whether the snapshot of this simulation time was not published."""
        return any(gap.after_ns < stamp_ns < gap.before_ns for gap in self.skipped)

    def judge(self, logged: int | None, first_ns: int | None) -> None:
        """Sort the log, and end it where a message is missing.

        logged: number of its messages, if known; first_ns: simulation time of the session's first
        message in the bag.
        """
        numbers = sorted(
            [one.number for one in self.entries] + [one.number for one in self.skipped]
        )
        complete = next((k for k, n in enumerate(numbers, 1) if k != n), len(numbers) + 1) - 1
        self.entries = sorted((e for e in self.entries if e.number <= complete),
                              key=lambda entry: entry.number)  # fmt: skip
        begun_ns = self.session.time_ns
        # without a log, and joined late: there may have been inputs
        unsure = logged is None and not numbers and (first_ns or 0) > begun_ns + _JOINED_NS
        if complete < max(len(numbers), logged or 0) or unsure:
            newest_ns = max((entry.time_ns for entry in self.entries), default=begun_ns - 1)
            self.known_ns = max(newest_ns + 1, begun_ns)
            self.gap = (
                f"inputs that were applied after {newest_ns * 1e-9:.3f} s are not in its "
                f"{INPUT_LOG_TOPIC}"
            )


class BagContent:
    """The small topics of a bag in memory; the others are read again when they are compared."""

    def __init__(self, files: list[Path]) -> None:
        """Read sessions, log and inputs.

        Raises:
            BagError: a message of them does not make sense.
        """
        self._files = files
        self.sessions: list[RecordedSession] = []
        self.inputs = RecordedInputs()
        self.notes: list[str] = []
        self._stamps: list[tuple[int, int]] = []  # log time and stamp of _STAMPED
        own_notes: dict[str, str] = {}
        logged: dict[tuple[str, int], list[LoggedCalls | SkippedSnapshots]] = defaultdict(list)
        known: dict[tuple[str, int], RecordedSession] = {}
        for file in self._files:
            scan = McapScan(file)
            for message in _recorded(scan):
                self._take(message, known, logged)
            own_notes |= scan.notes
            self.notes += scan.problems
        self.sessions = sorted(known.values(), key=lambda one: (one.log_ns, one.session.number))
        for key, session in known.items():
            session.entries += [one for one in logged[key] if isinstance(one, LoggedCalls)]
            session.skipped += [one for one in logged[key] if isinstance(one, SkippedSnapshots)]
        for index, session in enumerate(self.sessions):
            session.judge(self._logged(index), self._first_ns(index))
        if self.sessions and (self.notes or _RECOVERED in own_notes):
            self._judge_tail()

    @cached_property
    def runs(self) -> list[str]:
        """Return the names of the runs, by time."""
        return list(dict.fromkeys(session.session.run for session in self.sessions))

    @cached_property
    def _begins(self) -> list[int]:
        return [self.of(run)[0].log_ns for run in self.runs]

    def of(self, run: str) -> list[RecordedSession]:
        """Return the sessions of a run, by number."""
        return [session for session in self.sessions if session.session.run == run]

    def run_at(self, log_ns: int) -> str | None:
        """Return the run that published at a time; None: before the first."""
        index = bisect_right(self._begins, log_ns)
        return self.runs[index - 1] if index else None

    def last_ns(self, run: str) -> int:
        """Return the ROS time of the last stamp of a run, or of its beginning if it has none."""
        newest = self.of(run)[-1].session
        begun_ns = newest.epoch_ns + newest.time_ns
        return max(
            (ns for log_ns, ns in self._stamps if self.run_at(log_ns) == run), default=begun_ns
        )

    def messages(self, topics: tuple[str, ...]) -> Iterator[Recorded]:
        """Return the messages of these topics, in file order."""
        names = frozenset(topics)
        for file in self._files:
            yield from (message for message in _recorded(McapScan(file)) if message.topic in names)

    def _take(
        self,
        message: Recorded,
        sessions: dict[tuple[str, int], RecordedSession],
        logged: dict[tuple[str, int], list[LoggedCalls | SkippedSnapshots]],
    ) -> None:
        if message.topic == SESSION_TOPIC:
            session = Session.read(decode_json(message.topic, message.data))
            sessions.setdefault(
                (session.run, session.number), RecordedSession(session, message.log_ns)
            )
        elif message.topic == INPUT_LOG_TOPIC:
            key, entry = read_log(message.data)
            logged[key].append(entry)
        elif message.topic in INPUTS:
            self.inputs.add(message)
        elif message.topic == _STAMPED and len(message.data) >= 12:
            sec, nanosec = _STAMP.unpack_from(message.data, 4)
            self._stamps.append((message.log_ns, sec * 1_000_000_000 + nanosec))

    def _logged(self, index: int) -> int | None:
        """Return the number of messages in a session's log, if the next session reports it."""
        if index + 1 == len(self.sessions):
            return None
        present, following = (self.sessions[k].session for k in (index, index + 1))
        goes_on = (following.run, following.number) == (present.run, present.number + 1)
        return following.logged_before if goes_on else None

    def _first_ns(self, index: int) -> int | None:
        """Return the simulation time of the first stamp in a session, or of the bag if it is the
        first.
        """
        session, epoch_ns = self.sessions[index], self.sessions[index].session.epoch_ns
        begun_ns = -1 if index == 0 else session.log_ns
        return min(
            (ns - epoch_ns for log_ns, ns in self._stamps if log_ns > begun_ns), default=None
        )

    def _judge_tail(self) -> None:
        """Check the end of a truncated bag: messages may be present whose inputs are lost."""
        last = self.sessions[-1]
        if last.known_ns is not None:
            return
        newest_ns = max((entry.time_ns for entry in last.entries), default=0)
        stamp_ns = self.last_ns(last.session.run) - last.session.epoch_ns
        last.known_ns = max(newest_ns + 1, stamp_ns - _TAIL_NS)
        self.notes.append(f"cut off: compared up to {last.known_ns * 1e-9:.3f} s")


@dataclass(frozen=True)
class MatchedInput:
    """One applied input and its recording in the topic that it came on."""

    topic: str
    stamp_ns: int | None  # twin time
    is_there: bool  # with equal numbers
    where: str = ""
    other: str = ""  # the number that is there in its stead
    applied: str = ""


class RecordedInputs:
    """Recorded inputs, by topic and content."""

    def __init__(self) -> None:
        self._by_stamp: dict[tuple[str, int], list[Values]] = defaultdict(list)
        self._by_values: dict[str, set[str]] = defaultdict(set)

    def add(self, message: Recorded) -> None:
        """Take a message; one that is malformed was not applied either."""
        try:
            stamp_ns, values = _numbers_in(message.topic, message.data)
        except InputError:
            return
        if stamp_ns:
            self._by_stamp[message.topic, stamp_ns].append(values)
        self._by_values[message.topic].add(repr(values))

    def find(self, call: Call, epoch_ns: int) -> MatchedInput | None:
        """Return the recorded input of a logged call, or None if it is not an external input."""
        key = _key_of(call)
        if key is None:
            return None
        topic, stamp_ns, values = key
        if repr(values) in self._by_values[topic]:
            return MatchedInput(topic, stamp_ns, True)
        if stamp_ns is None:
            return MatchedInput(topic, None, False)
        recorded = self._by_stamp.get((topic, stamp_ns + epoch_ns))
        if not recorded:
            return MatchedInput(topic, stamp_ns, False)
        pairs = zip(recorded[0], values, strict=False)
        index, (recorded_value, value) = next(
            ((k, pair) for k, pair in enumerate(pairs) if repr(pair[0]) != repr(pair[1])),
            (len(values), (len(recorded[0]), len(values))),
        )
        names = _NAMES.get(topic, ())
        where = names[index] if index < len(names) else f"number {index + 1}"
        return MatchedInput(topic, stamp_ns, False, where, repr(recorded_value), repr(value))


_NAMES = {
    "ship/heave": ("pose.pose.position.z", "twist.twist.linear.z"),
    "ship/odometry": tuple(
        [f"pose.pose.position.{a}" for a in "xyz"] + [f"twist.twist.linear.{a}" for a in "xyz"]
        + [f"pose.pose.orientation.{a}" for a in "xyzw"]
        + [f"twist.twist.angular.{a}" for a in "xyz"]
    ),
}  # fmt: skip


def read_content(bag: Path) -> BagContent:
    """Return the runs in a bag, by a name in bags/ or a path (directory or .mcap file).

    Raises:
        BagError: no such bag, or it has no run that can be replayed.
    """
    files = mcap_files(find_bag(bag))
    if not files:
        remedy = "give a bag that rope_twin recorded"
        raise BagError(f"bag {bag}", "it holds no .mcap file", remedy)
    content = BagContent(files)
    if not content.sessions:
        problem = f"it has no {SESSION_TOPIC}, which says what was run"
        raise BagError(f"bag {bag}", problem, "give a bag that this version of rope_twin recorded")
    return content


def _recorded(scan: McapScan) -> Iterator[Recorded]:
    """Yield the messages of a file, topics without their leading slash."""
    for topic, _, stored in scan.messages():
        yield Recorded(topic.removeprefix("/"), stored.sequence, stored.log_ns, stored.data)


def _numbers_in(topic: str, data: bytes) -> tuple[int | None, Values]:
    """Return ROS stamp [ns] (None: none) and values of a message of one of INPUTS.

    Raises:
        InputError: it is malformed.
    """
    if topic == "ship/heave":
        return inputs.read_heave(data)
    if topic == "ship/odometry":
        stamp_ns, pose = inputs.read_pose(data)
        return stamp_ns, pose_numbers(pose)
    if topic == LOWER_END:
        stamp_ns, place, velocity = inputs.read_lower_end(data)
        return stamp_ns, (*place, *velocity)
    if topic == CUT_TOPIC:
        at_ns, below_m, _ = inputs.read_cut(data)
        return at_ns, (below_m,)
    if topic in MEASURED_TOPICS:
        measurement = inputs.read_measurement(topic, data)
        return measurement.stamp_ns, _measured_values(measurement)
    if topic == "current":
        return None, tuple(inputs.read_current(data).ravel().tolist())
    at_ns, order, _ = inputs.read_order(topic, data)
    return at_ns, _order_values(order)


def _key_of(call: Call) -> tuple[str, int | None, Values] | None:
    """Return topic, stamp in simulation time and values of a call, or None if it has no topic."""
    if call.method == "submit_heave":
        stamp_ns, position_m, velocity_m_per_s = call.arguments[:3]
        return "ship/heave", stamp_ns, (position_m, velocity_m_per_s)
    if call.method == "submit_pose":
        pose = call.arguments[0]
        assert isinstance(pose, ShipPose)
        return "ship/odometry", pose.stamp_ns, pose_numbers(pose)
    if call.method == "submit_lower_end":
        stamp_ns, place, velocity = call.arguments
        return LOWER_END, stamp_ns, (*place, *velocity)
    if call.method == "submit_command":
        stamp_ns, order = call.arguments[:2]
        assert isinstance(order, WinchCommand)
        if order.kind in COMMANDER_EVENTS:
            return None
        return ORDER_TOPICS.get(order.kind, SWITCH_TOPIC), stamp_ns, _order_values(order)
    if call.method == "submit_cut":
        return CUT_TOPIC, call.arguments[0], (call.arguments[1],)
    if call.method == "submit_measurement":
        measurement = call.arguments[0]
        assert isinstance(measurement, Measurement)
        topic = {MOTOR: MOTOR_TENSION, PAYLOAD: MEASURED_DEPTH}.get(
            measurement.source, WINCH_MEASURED
        )
        return topic, measurement.stamp_ns, _measured_values(measurement)
    if call.method == "submit_current":
        return "current", None, tuple(np.asarray(call.arguments[0]).ravel().tolist())
    return None


def _measured_values(measurement: Measurement) -> Values:
    """Return names and values of all rows."""
    return tuple(value for row in measurement.rows for value in row)


def _order_values(order: WinchCommand) -> Values:
    """Return the set-point of a command, or the name of a switch."""
    return (order.value if order.kind in ORDER_TOPICS else order.kind,)
