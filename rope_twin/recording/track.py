"""Records of a lift in a bag: samples of a topic, and the replay of motion, once or in a loop.

If the end of a record does not join its beginning (a real recording), the last 10 s of each pass
are blended into the first 10 s of the next, so that a pass is 10 s shorter.

Heave, line out and tension are read by one rule for all who read a lift: measured topics as a
running twin reads them. A message that it would refuse is left out and counted.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from operator import attrgetter
from pathlib import Path
from typing import Any, NamedTuple, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray
from rosbags.serde import SerdeError

from rope_twin.errors import BagError, InputError, counted, did_you_mean
from rope_twin.messages.cdr import decode, deserialise, table
from rope_twin.messages.inputs import read_heave, read_measurement
from rope_twin.quantity import or_nan
from rope_twin.recording.bag import BagReader, DamageError, TopicContent
from rope_twin.recording.mcap_scan import McapScan, StoredMessage, mcap_files
from rope_twin.scene.rigging import winch_of
from rope_twin.scene.schema import RopeLine, Scene
from rope_twin.topics import WINCH_MEASURED, is_topic
from rope_twin.twin.readings import WinchReadings

Vector = NDArray[np.float64]
Stamps = NDArray[np.int64]
Table = NDArray[np.float64]
Faults = dict[str, NDArray[np.bool_]]  # by what is wrong: which rows

_STAMP = ("header.stamp.sec", "header.stamp.nanosec")
GAP_PERIODS = 3.0  # an interval this many times the usual one is a gap
_TOLERATED_SHARE = 0.05  # of samples that cannot be used
_MIN_INTERVAL_NS = 500_000  # 2 kHz: no sensor of a lift is faster
_LONGEST_GAP_S = 60.0  # beyond it, it is the clock that jumped, or two recordings


def choose_topic(bag: BagReader, topic: str | None, usual: str, types: Sequence[str]) -> str:
    """Return the suitable topic: `topic`, or the one of the usual name, or the only one.

    usual: its name in this suite, like ship/heave, whose last words name what is wanted.

    Raises:
        BagError: there is none, or it is of another type, or there are several.
    """
    where, quantity = f"bag {bag.path}", usual.rpartition("/")[2]
    topics: Mapping[str, TopicContent] = bag.topics
    fitting = [name for name, content in topics.items() if content.type_name in types]
    right = " or ".join(types)
    if topic is not None:
        name = topic if topic in topics else f"/{topic}"
        if name not in topics:
            suggestion = did_you_mean(topic, topics) if topics else "the bag is empty"
            raise BagError(where, f"it has no topic '{topic}'", suggestion)
        if name not in fitting:
            problem = f"topic {name} is a {topics[name].type_name}"
            raise BagError(where, problem, f"{quantity} must be a {right}")
        return name
    usual_named = [name for name in fitting if is_topic(name, usual)]
    for candidates in (usual_named, fitting):
        if len(candidates) == 1:
            return candidates[0]
    if fitting:
        problem = f"several topics could be the {quantity}: {', '.join(sorted(fitting))}"
        raise BagError(where, problem, "name one of them")
    content_text = ", ".join(
        f"{name} ({content.type_name})" for name, content in sorted(topics.items())
    )
    raise BagError(where, f"no topic is a {right}", f"it holds {content_text or 'nothing'}")


class StampedRows:
    """The samples of a topic as they come, and the judgement on them."""

    def __init__(self, bag: BagReader, topic: str, quantity: str, fields: Sequence[str]) -> None:
        """Read all messages; fields: the numbers wanted of each, like `pose.pose.position.z`.

        Raises:
            BagError: the bag turns out to be damaged.
        """
        self.where = f"bag {bag.path}, topic {topic}"
        self.notes: list[str] = []
        self._wanted = quantity
        self._content = bag.topics[topic]
        messages = list(bag.messages(topic))
        readable, rows = self._read([data for _, data in messages], [*_STAMP, *fields])
        log_ns = np.array([messages[k][0] for k in readable], dtype=np.int64)
        header_ns = rows[:, 0].astype(np.int64) * 1_000_000_000 + rows[:, 1].astype(np.int64)
        self._stamps, self._values = (header_ns, log_ns), rows[:, len(_STAMP) :]
        self._undecodable = len(messages) - len(readable)

    def _read(self, messages: list[bytes], paths: list[str]) -> tuple[Sequence[int], Table]:
        """Return the numbers of those messages that can be decoded, and their indices."""
        if not messages:
            return (), np.empty((0, len(paths)))
        try:
            columns = table(self._content.type_name, messages, paths)
        except SerdeError:
            columns = None  # the first message is damaged
        if columns is not None:
            return range(len(messages)), columns
        readable, rows, read = [], [], attrgetter(*paths)
        for number, data in enumerate(messages):
            try:
                rows.append(read(deserialise(self._content.type_name, data)))
            except SerdeError:
                continue
            readable.append(number)
        return readable, np.array(rows, dtype=np.float64).reshape(len(readable), len(paths))

    def usable(self, judge: Callable[[Table], Faults] | None = None) -> tuple[Stamps, Table]:
        """Return stamps (n,), rising, and values (n, k), finite and without the faults found by
        `judge`.

        Raises:
            BagError: few are left, or time has a hole or another unit.
        """
        total = len(self._values) + self._undecodable
        if total == 0:
            raise BagError(self.where, "it holds no message", f"{self._wanted} needs at least 2")
        stamp_ns, log_ns = self._stamps
        if 2 * np.count_nonzero(stamp_ns) < len(stamp_ns):
            stamp_ns = log_ns
            self.notes.append(f"{self.where}: headers without a stamp, times are those of the log.")
        values = self._values
        keep, faults = _judge(stamp_ns, values, judge(values) if judge else {})
        if self._undecodable:
            faults["that do not decode"] = self._undecodable
        self._tell_skipped(faults, total, int(keep.sum()))
        self.notes.append(self._tell_gaps(stamp_ns[keep]))
        return stamp_ns[keep], values[keep]

    def _tell_skipped(self, faults: dict[str, int], total: int, readable: int) -> None:
        skipped = sum(faults.values())
        reasons = ", ".join(f"{count} {fault}" for fault, count in faults.items() if count)
        if readable < 2 or skipped > _TOLERATED_SHARE * total:
            problem = f"{skipped} of {total} samples cannot be used ({reasons or 'too few'})"
            remedy = f"right are 2 or more, at most {_TOLERATED_SHARE:.0%} bad"
            raise BagError(self.where, problem, remedy)
        if skipped:
            self.notes.append(f"{self.where}: skipped {skipped} of {total} samples ({reasons}).")
        promised = self._content.messages
        if total < promised:
            self.notes.append(f"{self.where}: of {promised} messages promised {total} are there.")

    def _tell_gaps(self, stamp_ns: Stamps) -> str:
        steps = np.diff(stamp_ns)
        usual_ns = float(np.median(steps))
        if usual_ns < _MIN_INTERVAL_NS:
            problem = f"a sample every {usual_ns:g} ns, as of stamps in milliseconds"
            right = f"right are seconds and nanoseconds, {_MIN_INTERVAL_NS} ns apart at least"
            raise BagError(self.where, problem, right)
        gaps = steps > GAP_PERIODS * usual_ns
        if not np.any(gaps):
            return ""
        longest = int(np.argmax(steps))
        at_s = float(stamp_ns[longest] - stamp_ns[0]) * 1e-9
        gap = f"the longest {steps[longest] * 1e-9:.4g} s at {at_s:.3f} s"
        if steps[longest] > _LONGEST_GAP_S * 1e9:
            remedy = f"right is one recording without a gap above {_LONGEST_GAP_S:g} s"
            raise BagError(self.where, f"gaps in time, {gap}", remedy)
        return f"{self.where}: gaps in time: {int(gaps.sum())}, {gap}."


def _judge(
    stamp_ns: Stamps, values: Table, further: Faults
) -> tuple[NDArray[np.bool_], dict[str, int]]:
    """Return which samples are valid and later than all before, and the counted faults."""
    finite = np.all(np.isfinite(values), axis=1)
    stamped = stamp_ns != 0
    keep = finite & stamped
    faults = {
        "not finite": int((~finite).sum()),
        "without a stamp": int((finite & ~stamped).sum()),
    }
    for fault, rows in further.items():
        faults[fault] = int((keep & rows).sum())
        keep &= ~rows
    latest = np.iinfo(np.int64).min
    repeated = backward = 0
    for index in np.flatnonzero(keep):
        stamp = int(stamp_ns[index])
        if stamp > latest:
            latest = stamp
            continue
        keep[index] = False
        repeated += stamp == latest
        backward += stamp < latest
    faults["with a repeated stamp"] = repeated
    faults["with a stamp that goes back"] = backward
    return keep, faults


FADE_S = 10.0


class Track(NamedTuple):
    """Motion record: values and their rates of change [1/s] at times that begin with 0."""

    time_ns: Stamps  # (n,) rising
    value: Table  # (n, k)
    rate: Table  # (n, k)
    period_ns: int  # the usual interval

    @property
    def end_ns(self) -> int:
        """Return the end: one interval after the last sample."""
        return int(self.time_ns[-1]) + self.period_ns


class Splice(NamedTuple):
    """Splice between passes: when they restart, and the blended beginning of the later ones."""

    loop_ns: int  # length of a pass
    samples: int  # in it
    value: Table  # (h, k) of the first h samples of the later passes
    rate: Table  # (h, k)
    tail_ns: Stamps  # (h,) times in the record of what fades out there
    weight: Vector  # (h,) share of the record's beginning


@dataclass(frozen=True, kw_only=True)
class MotionRecord:
    """Motion as it was measured or made; times count from its first sample."""

    time_ns: Stamps  # (n,) rising, the first is 0
    elevation_time_ns: Stamps = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    elevation_m: Vector = field(default_factory=lambda: np.empty(0))  # water surface at the ship
    began_ns: int = 0  # ROS time of the first sample; 0: not recorded
    source: str = ""
    note: str = ""  # sentences on what was skipped or derived; '' if nothing

    @property
    def period_ns(self) -> int:
        """Return the usual interval between samples (the median) [ns]."""
        return int(np.median(np.diff(self.time_ns)))


def check_start(start_s: float, duration_s: float) -> None:
    """Check that a record of this duration has an instant to start at, looped or not.

    Raises:
        BagError: it has none.
    """
    if not (np.isfinite(start_s) and 0.0 <= start_s < duration_s):
        where, right = f"start of the record at {start_s:g} s", f"0 to less than {duration_s:g} s"
        raise BagError(where, f"it lasts {duration_s:g} s", f"right is {right}")


class RecordReplay:
    """Rows of a record by simulation time, once or in a loop; t = 0 is `start_s` into the record.

    In a loop the record repeats; `note` reports if its end does not join its beginning.
    """

    def __init__(
        self,
        record: MotionRecord,
        track: Track,
        rows: Table,
        blended: Callable[[Splice], Table],
        start_s: float,
        loop: bool,
    ) -> None:
        """Prepare the replay of values of each sample, rows (n, k), each with the record's surface.

        track: motion that decides whether the end joins the beginning; blended: returns the rows
        (h, k) where the end of a pass is blended into the next.

        Raises:
            BagError: `start_s` is not inside the record.
        """
        self.source, self.duration_s = record.source, track.end_ns * 1e-9
        check_start(start_s, self.duration_s)
        self._start_ns, self._time_ns = round(start_s * 1e9), track.time_ns
        # ROS time of t = 0, by which other records of the same time are placed; 0: unknown
        self.begins_ns = record.began_ns + self._start_ns if record.began_ns else 0
        self.loop_ns = track.end_ns if loop else None  # length of a pass, or None if there is one
        self._reaches_back = loop and joins(track)  # whether passes go on before the first
        splice = find_splice(track) if loop and not self._reaches_back else None
        surface = elevation_at(record, None if splice else self.loop_ns)
        self._first = self._later = np.column_stack([rows, surface])
        self.note = record.note
        if splice is not None:
            self._time_ns, self.loop_ns = track.time_ns[: splice.samples], splice.loop_ns
            tail = np.interp(splice.tail_ns, track.time_ns, surface)
            surface = tail + splice.weight * (surface[: len(tail)] - tail)
            faded = np.column_stack([blended(splice), surface])
            self._later = np.concatenate([faded, self._first[len(faded) :]])
            faded_s = (track.end_ns - splice.loop_ns) * 1e-9
            remark = (
                f"{record.source}: it lasts {self.duration_s:.4g} s and is repeated; its end does "
                f"not join its beginning, the last {faded_s:.3g} s of each pass fade into the next."
            )
            self.note = " ".join(filter(None, [record.note, remark]))

    def rows(self, from_ns: int, to_ns: int) -> Iterator[tuple[int, Any]]:
        """Yield stamp and values of each sample with from_ns <= stamp < to_ns, in order.

        Each sample is yielded once; its last value is the surface, NaN where unknown.
        """
        low, high = from_ns + self._start_ns, to_ns + self._start_ns
        first = last = 0
        if self.loop_ns is not None:
            first, last = low // self.loop_ns, (high - 1) // self.loop_ns
            first = first if self._reaches_back else max(0, first)
        for lap in range(first, last + 1):
            shift_ns = lap * (self.loop_ns or 0)
            table = self._later if lap else self._first
            begin, end = np.searchsorted(self._time_ns, [low - shift_ns, high - shift_ns])
            for index in range(begin, end):
                stamp_ns = int(self._time_ns[index]) + shift_ns - self._start_ns
                yield stamp_ns, table[index].tolist()

    def is_over(self, from_ns: int) -> bool:
        """Return whether there is no sample from a time on."""
        return self.loop_ns is None and self._time_ns[-1] < from_ns + self._start_ns


def joins(track: Track) -> bool:
    """Return whether the step from the last sample to the first is like those inside the record.

    Compared are, of each value, the change of its rate and what its change leaves unexplained by
    the rates (trapezoidal rule), each with three times the 99th percentile inside.
    """
    usual_s = track.period_ns * 1e-9
    value = np.concatenate([track.value, track.value[:1]])
    rate = np.concatenate([track.rate, track.rate[:1]])
    steps_s = np.append(np.diff(track.time_ns) * 1e-9, usual_s)
    regular = steps_s[:-1] < 1.5 * usual_s
    turn = np.abs(np.diff(rate, axis=0))
    mean = 0.5 * (rate[1:] + rate[:-1]) * steps_s[:, None]
    jump = np.abs(np.diff(value, axis=0) - mean)
    sizes = np.concatenate([turn, jump], axis=1)
    usual = np.percentile(sizes[:-1][regular], 99.0, axis=0)
    return bool((sizes[-1] <= np.maximum(1e-3, 3.0 * usual)).all())


def find_splice(track: Track) -> Splice:
    """Return the splice: the first pass is as recorded, later ones begin blended from the end.

    With the tail x(t + P) and the head x(t), the later passes begin with x(t + P) + w·(x(t) - x(t +
    P)), w rising smoothly (3s² - 2s³) from 0 to 1; the rate is its derivative.
    """
    time_ns = track.time_ns
    fade_ns = min(round(FADE_S * 1e9), int(time_ns[-1]) // 3)
    index = int(np.searchsorted(time_ns, track.end_ns - fade_ns))
    loop_ns = int(time_ns[min(index, len(time_ns) - 1)])
    length_ns = int(time_ns[-1]) - loop_ns
    count = int(np.searchsorted(time_ns, loop_ns))
    head = int(np.searchsorted(time_ns, length_ns))
    head_ns = time_ns[:head]
    tail, tail_rate = hermite(head_ns + loop_ns, time_ns, track.value, track.rate)
    s = head_ns / max(length_ns, 1)
    w, w_rate = s * s * (3.0 - 2.0 * s), 6.0 * s * (1.0 - s) / (max(length_ns, 1) * 1e-9)
    difference = track.value[:head] - tail
    rate = tail_rate + w[:, None] * (track.rate[:head] - tail_rate) + w_rate[:, None] * difference
    return Splice(loop_ns, count, tail + w[:, None] * difference, rate, head_ns + loop_ns, w)


def hermite(at_ns: Stamps, time_ns: Stamps, value: Table, slope: Table) -> tuple[Table, Table]:
    """Return cubic Hermite values and rates at `at_ns` from those at `time_ns`; (n, k) each."""
    interval = np.clip(np.searchsorted(time_ns, at_ns, side="right") - 1, 0, len(time_ns) - 2)
    step = ((time_ns[interval + 1] - time_ns[interval]) * 1e-9)[:, None]
    s = ((at_ns - time_ns[interval]) * 1e-9)[:, None] / step
    a, b = value[interval], value[interval + 1]
    m, n = slope[interval] * step, slope[interval + 1] * step
    result = a + s * (m + s * (3.0 * (b - a) - 2.0 * m - n + s * (2.0 * (a - b) + m + n)))
    rate = (
        m + s * (2.0 * (3.0 * (b - a) - 2.0 * m - n) + 3.0 * s * (2.0 * (a - b) + m + n))
    ) / step
    return result, rate


def elevation_at(record: MotionRecord, loop_ns: int | None) -> Vector:
    """Return the surface (n,) at each sample by cubic Hermite interpolation; NaN where unknown.

    loop_ns: after which the record repeats, if it does.
    """
    at_ns, time_ns, values = record.time_ns, record.elevation_time_ns, record.elevation_m
    if len(time_ns) < 3:
        return np.full(len(at_ns), np.nan)
    if loop_ns is not None:  # what comes around the end is known too
        time_ns = np.concatenate([time_ns[-2:] - loop_ns, time_ns, time_ns[:2] + loop_ns])
        values = np.concatenate([values[-2:], values, values[:2]])
        rising = np.diff(time_ns, prepend=time_ns[0] - 1) > 0
        time_ns, values = time_ns[rising], values[rising]
    slope = np.gradient(values, time_ns * 1e-9)
    result = hermite(at_ns, time_ns, values[:, None], slope[:, None])[0][:, 0]
    interval = np.clip(np.searchsorted(time_ns, at_ns, side="right") - 1, 0, len(time_ns) - 2)
    step = time_ns[interval + 1] - time_ns[interval]
    known = (at_ns >= time_ns[0]) & (at_ns <= time_ns[-1])
    known &= step <= GAP_PERIODS * np.median(np.diff(time_ns))
    return np.where(known, result, np.nan)


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
        matching = [stored for name, _, stored in self._stored([]) if name == topic_name]
        for message in sorted(matching, key=lambda message: message.log_ns):
            yield message.log_ns, message.data

    def _stored(self, problems: list[str]) -> Iterator[tuple[str, str, StoredMessage]]:
        """Return topic, type and message in file order; problems: takes the damage."""
        for file in mcap_files(self.path):
            scan = McapScan(file)
            yield from (stored for stored in scan.messages() if stored[1])
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
    place, speed = message.pose.pose.position, message.twist.twist.linear
    return _stamp_s(message), (float(place.z), float(speed.z))


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
        f"{counted(n, 'message')} of {topic} could not be read and {'was' if n == 1 else 'were'} "
        "left out"
        for topic, n in refused.items()
    )


def possible_values(
    scene: Scene, line: RopeLine, field: str, time_s: Vector, values: Vector
) -> tuple[NDArray[np.bool_], str]:
    """Return which measured values a running twin would accept, (n,), and its last refusal or "".

    line: rope of their winch; without one nothing is checked. field: of RopeValues.
    """
    keep, refusal = np.ones(len(values), np.bool_), ""
    if winch_of(scene, line) is None:
        return keep, refusal
    readings = WinchReadings(scene, line, "")
    for k, (at_s, value) in enumerate(zip(time_s.tolist(), values.tolist(), strict=True)):
        stamp_ns = round(at_s * 1e9)
        row = ("", value, None, None) if field == "line_out_m" else ("", None, None, value)
        fault = readings.take(stamp_ns, row, stamp_ns)[1]
        keep[k], refusal = not fault, fault or refusal
    return keep, refusal


def impossible_words(impossible: Counter[str]) -> tuple[str, ...]:
    """Return a sentence for each quantity of which such values were left out."""
    return tuple(
        f"{counted(n, 'value')} of {what}, impossible for the scene's winch, left out"
        for what, n in impossible.items()
        if n
    )


def _stamp_s(message: Any) -> float:
    return float(message.header.stamp.sec) + 1e-9 * float(message.header.stamp.nanosec)
