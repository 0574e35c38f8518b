"""One instrument: from bytes of a transport to samples, with counts of all that is refused.

Samples are in SI with the signs of REP 103 and ROS time: heave is positive up, roll with port up,
pitch with the bow down, payout and speed outward.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

from rope_twin.feeds.configuration import (
    ARRIVAL,
    EM3000,
    INSTRUMENT,
    MOTOR,
    SIGNS,
    UNITS,
    FeedSettings,
)
from rope_twin.feeds.readings import (
    DUPLICATE,
    INCOMPLETE,
    LATE,
    LENGTH,
    MAX_LINE_BYTES,
    NANOSECONDS,
    ORDER,
    RANGE,
    TIME,
    LineReading,
    MotionReading,
    Reading,
    Refusal,
    nearest_day_ns,
)
from rope_twin.feeds.telegrams import EM3000_BYTES, em3000_starts

# Beyond these a number is a fault of the line, whatever the ship.
MAX_TENSION_N, MAX_PAYOUT_M, MAX_SPEED_M_PER_S = 1e8, 20_000.0, 100.0
MAX_HEAVE_M, MAX_RATE_M_PER_S, MAX_TILT_DEG = 50.0, 50.0, 90.0
END_OF_TIME_NS = 2**31 * NANOSECONDS  # seconds of a ROS stamp are an int32


@dataclass(frozen=True)
class LineSample:
    """Measurement of a line monitor in SI; NaN: not measured."""

    stamp_ns: int
    tension_n: float
    speed_m_per_s: float  # positive: pay out
    payout_m: float
    motor_tension_n: float


@dataclass(frozen=True)
class MotionSample:
    """Measurement of a motion sensor in SI and REP 103; NaN: not measured."""

    stamp_ns: int
    heave_m: float
    heave_rate_m_per_s: float
    roll_rad: float
    pitch_rad: float
    heading_deg: float  # of the bow, clockwise from north


Sample = LineSample | MotionSample


class Converter:
    """Turns the readings of one instrument into samples."""

    def __init__(self, settings: FeedSettings) -> None:
        self._settings = settings
        units, positive = settings.units, settings.positive
        self._factor = {name: UNITS[name][unit] for name, unit in units.items()}
        self._sign = {name: SIGNS[name][word] for name, word in positive.items()}

    def convert(self, reading: Reading, arrival_ns: int) -> tuple[Sample, Refusal | None]:
        """Return the sample of a reading that arrived at this time, and why a part is missing.

        Raises:
            Refusal: nothing of it can be used.
        """
        stamp_ns = self._stamp(reading, arrival_ns)
        if stamp_ns is None:
            raise Refusal(TIME, "the line has no time")
        if not 0 <= stamp_ns < END_OF_TIME_NS:
            raise Refusal(TIME, "its time is not one of 1970 to 2037")
        if isinstance(reading, LineReading):
            return self._line(reading, stamp_ns)
        return self._motion(reading, stamp_ns)

    def _stamp(self, reading: Reading, arrival_ns: int) -> int | None:
        delay_s = self._settings.latency_s
        stamp_ns: int | None = arrival_ns
        if isinstance(reading, MotionReading):
            delay_s += reading.age_s
        if self._settings.stamp == INSTRUMENT:
            stamp_ns = reading.time_ns
            if stamp_ns is not None and isinstance(reading, MotionReading) and reading.in_day:
                stamp_ns = nearest_day_ns(stamp_ns, arrival_ns)
        return None if stamp_ns is None else stamp_ns - round(delay_s * 1e9)

    def _size(self, name: str) -> float:
        return self._factor.get(name, 1.0) * self._sign.get(name, 1.0)

    def _line(self, reading: LineReading, stamp_ns: int) -> tuple[LineSample, Refusal | None]:
        force = self._size("tension")
        tension_n, motor_n = reading.tension * force, reading.motor_tension * force
        if self._settings.tension_of == MOTOR and math.isnan(motor_n):
            tension_n, motor_n = math.nan, tension_n
        speed, payout_m = reading.speed * self._size("speed"), reading.payout * self._size("payout")
        missing, accepted = reading.missing, []
        for value, max_value, what in (
            (tension_n, MAX_TENSION_N, "N of tension"),
            (speed, MAX_SPEED_M_PER_S, "m/s of line speed"),
            (payout_m, MAX_PAYOUT_M, "m of line out"),
            (motor_n, MAX_TENSION_N, "N of motor tension"),
        ):
            beyond = abs(value) > max_value
            if beyond:
                missing = missing or Refusal(RANGE, f"{value:g} {what}")
            accepted.append(math.nan if beyond else value)
        if missing is not None and all(map(math.isnan, accepted)):
            raise missing
        return LineSample(stamp_ns, *accepted), missing

    def _motion(self, reading: MotionReading, stamp_ns: int) -> tuple[MotionSample, Refusal | None]:
        size = self._size("heave")
        heave, rate = reading.heave * size, reading.heave_rate * size
        for value, max_value, what in (
            (heave, MAX_HEAVE_M, "m of heave"),
            (rate, MAX_RATE_M_PER_S, "m/s of heave rate"),
            (reading.roll, MAX_TILT_DEG, "° of roll"),
            (reading.pitch, MAX_TILT_DEG, "° of pitch"),
        ):
            if abs(value) > max_value:
                raise Refusal(RANGE, f"{value:g} {what}")
        heading, missing = reading.heading, None
        if abs(heading) > 360.0:  # that of a gyrocompass, which is no fault of the motion
            heading, missing = math.nan, Refusal(RANGE, f"{heading:g} ° of heading")
        # Octans states port and bow by letters, and its parser gives port up, bow up.
        roll = reading.roll * self._sign.get("roll", 1.0)
        pitch = reading.pitch * self._sign.get("pitch", -1.0)
        turns = math.radians(roll), math.radians(pitch)
        return MotionSample(stamp_ns, heave, rate, *turns, heading), missing


TWIN_NS = 2_000_000  # equal lines without time and counter that come so close are one line twice
CLOCK_SET_BACK = 10  # stamps in a row before the last one: the clock was set back
_IEC_61162_450 = b"UdPbC\0"
_SUPERSEDED = Refusal(LATE, "arrived together with a newer line")


class LineFramer:
    """Cuts a stream of bytes into lines."""

    refusal = Refusal(LENGTH, "bytes without an end of line")
    waiting = b""  # a line is complete with its end: none waits for the next one

    def __init__(self) -> None:
        self._rest = b""
        self.dropped = 0  # lines longer than any telegram

    def cut(self, data: bytes, is_complete: bool = False) -> Iterator[bytes]:
        """Yield complete lines; `is_complete`: the data begin and end with a line."""
        data = (b"" if is_complete else self._rest) + data.removeprefix(_IEC_61162_450)
        *lines, self._rest = data.replace(b"\r", b"\n").split(b"\n")
        if is_complete:
            lines.append(self._rest)
            self._rest = b""
        elif len(self._rest) > MAX_LINE_BYTES:
            self._rest = b""
            self.dropped += 1
        yield from (line for line in lines if line.strip())


class RecordFramer:
    """Cuts a stream of bytes into records of EM3000, which have no checksum and no end.

    A record counts once the next one begins where it ends; in a datagram it ends with it.
    """

    refusal = Refusal(INCOMPLETE, "bytes that are no record")

    def __init__(self) -> None:
        self._rest = b""
        self.dropped = 0  # times that the beginning, or the end of a datagram, was lost

    @property
    def waiting(self) -> bytes:
        """Return the record that is complete but for the beginning of the next one, or b""."""
        record = self._rest[:EM3000_BYTES]
        return record if len(record) == EM3000_BYTES and em3000_starts(record) else b""

    def cut(self, data: bytes, is_complete: bool = False) -> Iterator[bytes]:
        """Yield the records that are complete; `is_complete`: data begin and end with one."""
        data = (b"" if is_complete else self._rest) + data
        at, has_dropped = 0, False
        while at + EM3000_BYTES <= len(data):
            end = at + EM3000_BYTES
            following = data[end : end + 2]
            if not is_complete and len(following) < 2:
                break
            if em3000_starts(data[at:end]) and (not following or em3000_starts(following)):
                yield data[at:end]
                at = end
            else:
                at, has_dropped = at + 1, True
        self.dropped += has_dropped or (is_complete and at < len(data))
        self._rest = b"" if is_complete else data[at:]


@dataclass
class FeedCounts:
    """Counts of an instrument since the start."""

    lines: int = 0
    accepted: int = 0
    others: int = 0  # lines of other sentences or instruments
    refused: Counter[str] = field(default_factory=Counter)  # by reason
    last_fault: str = ""  # of the last refused line
    holes: int = 0  # times without a sample for longer than silent_after_s
    longest_hole_s: float = 0.0
    last_stamp_ns: int | None = None

    @property
    def refused_total(self) -> int:
        """Return the number of refused lines."""
        return sum(self.refused.values())

    def figures(self) -> dict[str, Any]:
        """Return the counts for an output in JSON."""
        return {
            "lines": self.lines,
            "accepted": self.accepted,
            "other_sentences": self.others,
            "refused": dict(self.refused),
            "last_fault": self.last_fault,
            "holes": self.holes,
            "longest_hole_s": self.longest_hole_s,
        }


class Instrument:
    """Turns the bytes of one instrument into samples, in the order of their stamps.

    A stamp goes back only where the clock was set back. Only lines stamped by their arrival, and
    handed over separately, can have equal ones.
    """

    def __init__(self, settings: FeedSettings) -> None:
        self.settings = settings
        self.counts = FeedCounts()
        self._parse = settings.parser()
        self._convert = Converter(settings).convert
        binary = settings.format == EM3000
        self._framer: LineFramer | RecordFramer = RecordFramer() if binary else LineFramer()
        self._last_line, self._last_arrival_ns = b"", 0
        self._dropped = 0
        self._waiting_ns = 0  # arrival of the record that waits for the next one
        self._backward = 0  # refused stamps in a row

    def take(self, data: bytes, arrival_ns: int, is_complete: bool = False) -> list[Sample]:
        """Return the samples in bytes that arrived at a time; `is_complete`: they are a datagram.

        Of several readings that arrived at once, and are stamped by that, the last one counts; it
        may still wait for the next bytes, and keeps its time of arrival.
        """
        samples: list[Sample] = []
        waited, waited_ns = self._framer.waiting, self._waiting_ns
        lines = list(self._framer.cut(data, is_complete))
        waiting = self._framer.waiting
        if waiting and (lines or waiting != waited):
            self._waiting_ns = arrival_ns
        for k, line in enumerate(lines):
            earlier = k == 0 and line == waited
            if waiting and not earlier:
                self.counts.lines += 1
                self._refuse(_SUPERSEDED)
                continue
            sample = self.take_line(line, waited_ns if earlier else arrival_ns)
            if sample is None:
                continue
            if samples and samples[-1].stamp_ns == sample.stamp_ns:
                self.counts.accepted -= 1
                self._refuse(_SUPERSEDED)
                samples.pop()
            samples.append(sample)
        if self._framer.dropped > self._dropped:
            self._refuse(self._framer.refusal)
            self._dropped = self._framer.dropped
        return samples

    def take_line(self, line: bytes, arrival_ns: int) -> Sample | None:
        """Return the sample of a line or record, or None."""
        counts = self.counts
        counts.lines += 1
        try:
            reading = self._parse(line)
            if reading is None:
                counts.others += 1
                return None
            if self._is_repeated(reading, line, arrival_ns):
                raise Refusal(DUPLICATE, "the last line again")
            sample, missing = self._convert(reading, arrival_ns)
            self._check_order(sample.stamp_ns)
        except Refusal as refusal:
            self._refuse(refusal)
            return None
        counts.accepted += 1
        if missing is not None:
            self._refuse(missing)
        return sample

    def _is_repeated(self, reading: Reading, line: bytes, arrival_ns: int) -> bool:
        """Return whether a line is the last one once more."""
        same = line == self._last_line
        close = arrival_ns - self._last_arrival_ns < TWIN_NS
        self._last_line, self._last_arrival_ns = line, arrival_ns
        numbered = reading.time_ns is not None
        if isinstance(reading, MotionReading):
            numbered = numbered or reading.counter is not None
        return same and (numbered or close)

    def _check_order(self, stamp_ns: int) -> None:
        """Refuse a stamp before the last one, unless a clock was set back, and count holes."""
        counts, last_ns = self.counts, self.counts.last_stamp_ns
        if last_ns is not None:
            gap_s = (stamp_ns - last_ns) * 1e-9
            if gap_s == 0.0 and self.settings.stamp != ARRIVAL:
                raise Refusal(ORDER, "the stamp of the last one again")
            if gap_s < 0.0:
                self._backward += 1
                if self._backward < CLOCK_SET_BACK:
                    raise Refusal(ORDER, f"{-gap_s:.3f} s before the last one")
            if gap_s > self.settings.silent_after_s:
                counts.holes += 1
                counts.longest_hole_s = max(counts.longest_hole_s, gap_s)
        self._backward = 0
        counts.last_stamp_ns = stamp_ns

    def _refuse(self, refusal: Refusal) -> None:
        self.counts.refused[refusal.reason] += 1
        self.counts.last_fault = f"{refusal.reason}: {refusal.fault}"
