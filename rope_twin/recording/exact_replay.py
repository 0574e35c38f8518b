"""Exact replay: a bag's run computed again from its logged inputs and compared bit by bit.

What decides a run is in the bag: how it began (twin/session) and which calls were made when
(twin/inputs). A message of the run and one of the replay belong together by the number that its
publisher gave it. Left out is what depends on the machine's load: `diagnostics`.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from enum import IntEnum
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rope_twin.errors import BagError, InputError, SolverError, phrase
from rope_twin.messages import Encoder, decode
from rope_twin.recording.recorded_run import BagContent, Recorded, RecordedSession, read_content
from rope_twin.recording.session import Session
from rope_twin.topics import EXTRA_TOPICS, SNAPSHOT_TOPICS, due_topics, slot_of
from rope_twin.twin.input_queue import apply
from rope_twin.twin.pacing import Steppable, steps_in_slot
from rope_twin.twin.recovery import Recovery
from rope_twin.twin.twin import Twin

COMPARED = tuple(topic.name for topic in (*SNAPSHOT_TOPICS, *EXTRA_TOPICS))
LEFT_OUT = {
    "diagnostics": "it reports load and lateness of the machine",
    "sea/elevation": "it is not made by the simulation, and the twin does not use it",
}
_KEPT_NS = 20_000_000_000  # for so long a message of the replay waits for its like in the bag
_BEYOND_NS = 1_000_000_000  # likewise: how far past the newest stamp the replay may go
_MORE_NS = 1_000_000_000  # read on for so long after a difference: an earlier one may follow


class Outcome(IntEnum):
    """Verdict of a verification; the value is the exit code of the command."""

    EQUAL = 0
    IMPOSSIBLE = 1
    DIFFERENT = 3


@dataclass(frozen=True)
class Difference:
    """One number that the replay makes another."""

    topic: str
    time_s: float  # twin time
    session: int
    where: str  # field of the message; "" if it is all of it
    recorded: str
    replayed: str

    def __str__(self) -> str:
        """Return the difference in one sentence."""
        location = f"{self.topic}{self.where and ', '}{self.where} at {self.time_s:.9g} s"
        return f"{location}: {self.recorded} in the bag, {self.replayed} in the replay"


@dataclass
class Verification:
    """Result of the verification of a bag."""

    sessions: tuple[Session, ...]
    compared: Counter[str] = field(default_factory=Counter)  # equal or not, by topic
    missing: Counter[str] = field(default_factory=Counter)  # replayed, and not in the bag
    unverified: int = 0  # messages whose inputs are not known
    until_s: float = 0.0  # twin time of the newest one compared
    applied: Counter[str] = field(default_factory=Counter)  # logged inputs by topic
    unrecorded: Counter[str] = field(default_factory=Counter)  # of these: not in their own topic
    difference: Difference | None = None  # the first one in twin time
    notes: list[str] = field(default_factory=list)
    fault: str = ""  # why it could not be replayed, or not as a whole

    @property
    def outcome(self) -> Outcome:
        """Return the result: equal, different, or not available."""
        if self.difference is not None:
            return Outcome.DIFFERENT
        return Outcome.IMPOSSIBLE if self.fault else Outcome.EQUAL

    @property
    def total(self) -> int:
        """Return the number of compared messages."""
        return sum(self.compared.values())


def verify(bag: Path) -> Verification:
    """Replay a bag (directory or .mcap file, complete or truncated) and compare its messages.

    Raises:
        BagError: no such bag, or one that cannot be replayed; one sentence.
        RopeTwinError: its twin cannot be built here.
    """
    content = read_content(bag)
    verification = Verification(tuple(session.session for session in content.sessions))
    verification.notes += content.notes
    for session in content.sessions:
        verification.notes += (
            sentence
            for sentence in session.session.differences()
            if sentence not in verification.notes
        )
    _compare_inputs(content, verification)
    replays = {run: RunReplay(content.of(run), content.last_ns(run)) for run in content.runs}
    for message in content.messages(COMPARED):
        run = content.run_at(message.log_ns)
        if run is None:
            verification.unverified += 1
            continue
        if not _compare(message, replays[run], verification):
            break
    for replay in replays.values():
        verification.missing += replay.missing()
        verification.notes += [replay.ended] if replay.ended else []
        if replay.gap and not verification.fault:
            verification.fault = phrase(f"bag {bag}", replay.gap, "what came before is verified")
    if verification.unverified and not verification.fault:
        verification.notes.append("its beginning or its end has no inputs in the bag: not compared")
    if verification.difference is not None and not any(one.entries for one in content.sessions):
        verification.notes.append("no twin/inputs in the bag: the run is repeated without inputs")
    if not verification.total and not verification.fault and verification.difference is None:
        verification.fault = phrase(
            f"bag {bag}", "no message of it can be compared", "record a run"
        )
    return verification


class ReplayedMessage(NamedTuple):
    """A message of the replay."""

    session: int
    time_ns: int
    data: bytes


class RunReplay:
    """The messages of one run, computed as far as they are asked for."""

    def __init__(self, sessions: list[RecordedSession], last_ns: int) -> None:
        """Prepare a replay; last_ns: ROS time of the last stamp that the bag has of this run."""
        self._sessions = sessions
        self._last_ns = last_ns - sessions[-1].session.epoch_ns
        self._newest = Counter[str]()  # number of the newest message of each topic
        self._waiting: dict[tuple[str, int], ReplayedMessage] = {}
        self._missing = Counter[str]()
        self._unknown: list[tuple[Counter[str], Counter[str] | None]] = []
        self._making = self._make()
        self.time_ns = sessions[0].session.time_ns
        self.gap = ""  # why a part of it cannot be replayed
        self.ended = ""  # why the replay ended before the bag

    def find(self, topic: str, number: int) -> ReplayedMessage | None:
        """Return a message of the replay, once, or None if it makes no such message."""
        key = topic, number
        while key not in self._waiting and self._newest[topic] < number:
            if not self._advance():
                break
        return self._waiting.pop(key, None)

    def is_unknown(self, topic: str, number: int) -> bool:
        """Return whether a message is of a time for which the bag has no inputs."""
        return number <= self._sessions[0].session.published.get(topic, 0) or any(
            low[topic] < number and (high is None or number <= high[topic])
            for low, high in self._unknown
        )

    def missing(self) -> Counter[str]:
        """Return the replayed messages that the bag lacks, up to its last message."""
        late = (key for key, message in self._waiting.items() if message.time_ns <= self._last_ns)
        return self._missing + Counter(topic for topic, _ in late)

    def _advance(self) -> bool:
        """Make one more message; False: there is none."""
        message = next(self._making, None)
        if message is None:
            return False
        topic, number, produced = message
        self._newest[topic] = number
        self._waiting[topic, number] = produced
        self.time_ns = produced.time_ns
        while (oldest := next(iter(self._waiting))) and (
            self._waiting[oldest].time_ns < produced.time_ns - _KEPT_NS
        ):
            del self._waiting[oldest]
            self._missing[oldest[0]] += 1
        return True

    def _make(self) -> Iterator[tuple[str, int, ReplayedMessage]]:
        """Return topic, number and bytes of each due message, in the order of publishing."""
        twin: Twin | None = None
        stepper: Recovery | None = None
        for k, recorded in enumerate(self._sessions):
            session = recorded.session
            following = self._sessions[k + 1].session if k + 1 < len(self._sessions) else None
            end_ns = self._last_ns + _BEYOND_NS if following is None else following.time_ns
            if twin is None or stepper is None or twin.time_ns != session.time_ns:
                twin = session.make_twin()
                stepper = Recovery(twin)
            elif twin.level != session.level:
                twin.set_level(session.level)
            counts = Counter(session.published)
            until_ns = end_ns if recorded.known_ns is None else min(end_ns, recorded.known_ns)
            try:
                for name, produced in _session_messages(twin, stepper, recorded, until_ns):
                    counts[name] += 1
                    yield name, counts[name], produced
            except SolverError as error:
                self.ended = f"the replay ends at {twin.time_ns * 1e-9:.9g} s: {error}"
                return
            if until_ns < end_ns:
                high = None if following is None else Counter(following.published)
                self._unknown.append((counts, high))
                if k > 0 or until_ns > session.time_ns or following is None:  # not a late recorder
                    self.gap = self.gap or recorded.gap
                twin = None


def _session_messages(
    twin: Twin, stepper: Steppable, recorded: RecordedSession, until_ns: int
) -> Iterator[tuple[str, ReplayedMessage]]:
    """Return topic and bytes of the messages due in the cycles of a session before a time."""
    encoder, waiting = Encoder(recorded.session.epoch_ns), recorded.calls()
    while twin.time_ns < until_ns:
        if waiting and min(waiting) < twin.time_ns:
            problem = f"inputs were applied at {min(waiting) * 1e-9:.9g} s, where no slot begins"
            raise BagError("twin/inputs", problem, "give the bag as it was recorded")
        if (logged := waiting.pop(twin.time_ns, None)) is not None:
            for entry in logged:
                apply(twin, entry.calls())
        stepper.advance(steps_in_slot(twin.step_ns * 1e-9))
        snapshot = stepper.snapshot()
        if recorded.skips(snapshot.stamp_ns):
            continue
        for name in due_topics(*slot_of(snapshot), snapshot):
            try:
                data = encoder.encode(name, snapshot)
            except Exception:
                continue  # nor did the run publish it
            yield name, ReplayedMessage(recorded.session.number, snapshot.stamp_ns, data)


def _compare(message: Recorded, replay: RunReplay, verification: Verification) -> bool:
    """Compare one message of the bag; return False if no more need be compared."""
    topic, number = message.topic, message.sequence
    produced = replay.find(topic, number)
    if produced is None:
        if replay.ended and verification.difference is None:
            verification.difference = _no_such(message, replay)
        elif replay.is_unknown(topic, number):
            verification.unverified += 1
        else:
            _note(verification, _no_such(message, replay))
    else:
        verification.compared[topic] += 1
        verification.until_s = max(verification.until_s, produced.time_ns * 1e-9)
        if not same_payload(message.data, produced.data):
            _note(verification, _difference(topic, message.data, produced))
    first = verification.difference
    return first is None or replay.time_ns * 1e-9 < first.time_s + _MORE_NS * 1e-9


def same_payload(recorded: bytes, produced: bytes) -> bool:
    """Return whether two CDR messages are equal, but for what the middleware adds on its way.

    It fills the end up to a multiple of 4 bytes, and may count these bytes in the head's options.
    """
    if recorded == produced:
        return True
    size = len(produced)
    padded = size < len(recorded) < size + 4 and len(recorded) % 4 == 0
    return padded and recorded[:2] == produced[:2] and recorded[4:size] == produced[4:]


def _note(verification: Verification, difference: Difference) -> None:
    """Keep the first difference by simulation time."""
    if verification.difference is None or difference.time_s < verification.difference.time_s:
        verification.difference = difference


def _no_such(message: Recorded, replay: RunReplay) -> Difference:
    none = replay.ended or "no such message"
    number = f"message {message.sequence}"
    return Difference(message.topic, replay.time_ns * 1e-9, 0, "", number, none)


def _difference(topic: str, recorded: bytes, produced: ReplayedMessage) -> Difference:
    """Return in words the first difference of two messages."""
    sizes = f"{len(recorded)} bytes", f"{len(produced.data)} bytes"
    try:
        mismatch = first_difference(decode(topic, recorded), decode(topic, produced.data))
    except InputError as error:
        mismatch = "", str(error), sizes[1]
    numbers = mismatch or ("", *sizes)
    return Difference(topic, produced.time_ns * 1e-9, produced.session, *numbers)


def first_difference(first: Any, second: Any, location: str = "") -> tuple[str, str, str] | None:
    """Return path and both values of the first field in which two messages differ; None: none."""
    if hasattr(first, "__dataclass_fields__"):
        for name in first.__dataclass_fields__:
            if name != "__msgtype__":
                path = f"{location}.{name}" if location else name
                mismatch = first_difference(getattr(first, name), getattr(second, name), path)
                if mismatch is not None:
                    return mismatch
        return None
    if isinstance(first, list | tuple | np.ndarray):
        if len(first) != len(second):
            return location, f"{len(first)} entries", f"{len(second)} entries"
        if isinstance(first, np.ndarray) and first.tobytes() == second.tobytes():
            return None
        pairs = enumerate(zip(first, second, strict=True))
        all_found = (first_difference(a, b, f"{location}[{k}]") for k, (a, b) in pairs)
        return next((mismatch for mismatch in all_found if mismatch is not None), None)
    if np.array(first).tobytes() == np.array(second).tobytes():
        return None
    values = (value.item() if isinstance(value, np.generic) else value for value in (first, second))
    return location, *(repr(value) for value in values)  # type: ignore[return-value]


def _compare_inputs(content: BagContent, verification: Verification) -> None:
    """Compare each applied input with its topic in the bag."""
    for recorded in content.sessions:
        session = recorded.session
        last_ns = content.last_ns(session.run) - session.epoch_ns
        for entry in recorded.entries:
            for call in entry.calls():
                match = content.inputs.find(call, session.epoch_ns)
                if match is None:
                    continue
                verification.applied[match.topic] += 1
                at_ns = entry.time_ns if match.stamp_ns is None else match.stamp_ns
                if match.other:
                    numbers = match.where, match.other, match.applied
                    at_s = at_ns * 1e-9
                    _note(verification, Difference(match.topic, at_s, session.number, *numbers))
                elif not match.is_there and at_ns < last_ns:
                    verification.unrecorded[match.topic] += 1
