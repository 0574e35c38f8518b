"""Readings of instruments, the reasons to refuse a line, and the parts that all telegrams share.

A parser returns a reading in the units and signs of the telegram, a `Refusal`, or None for a line
that belongs to something else: several sentences often share a port.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from functools import reduce
from typing import NamedTuple

NANOSECONDS = 1_000_000_000
DAY_NS = 86_400 * NANOSECONDS
MAX_LINE_BYTES = 512

INCOMPLETE = "incomplete"
CHECKSUM = "checksum"
NUMBER = "not a number"
INVALID = "flagged invalid"
BAD = "bad status"
RANGE = "out of range"
DUPLICATE = "duplicate"
ORDER = "out of order"
LATE = "late"
TIME = "no time"
LENGTH = "too long"
REASONS = (
    INCOMPLETE, CHECKSUM, NUMBER, INVALID, BAD, RANGE, DUPLICATE, ORDER, LATE, TIME, LENGTH,
)  # fmt: skip

NAN = math.nan
_NUMBER = re.compile(r"[+-]?(?:\d{1,15}(?:\.\d{0,15})?|\.\d{1,15})")
_ISO = re.compile(r"(\d{4})-(\d\d)-(\d\d)[T ](\d\d):(\d\d):(\d\d)(?:\.(\d{1,9}))?Z?")
_CLOCK = re.compile(r"(\d\d):?(\d\d):?(\d\d)(?:\.(\d{1,9}))?")
_DATE = re.compile(r"(\d{4})[-/]?(\d\d)[-/]?(\d\d)")
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


class Refusal(NamedTuple):
    """Reason (one of REASONS) why a line gives no reading, and the fault in words."""

    reason: str
    fault: str


@dataclass(frozen=True)
class LineReading:
    """Reading of a line monitor; NaN: not measured."""

    tension: float = NAN  # at the sheave (load pin, load cell)
    speed: float = NAN
    payout: float = NAN
    motor_tension: float = NAN  # computed from the motor's pressure, torque or current
    channel: str = ""  # number of the winch or of the display in the telegram
    time_ns: int | None = None  # by the instrument's clock, since 1970
    missing: Refusal | None = None  # why a part of the line is not measured


@dataclass(frozen=True)
class MotionReading:
    """Reading of a motion sensor; NaN: not measured."""

    heave: float = NAN  # [m]
    heave_rate: float = NAN  # [m/s]
    roll: float = NAN  # [°]
    pitch: float = NAN  # [°]
    heading: float = NAN  # of the bow, clockwise from north [°]
    time_ns: int | None = None  # by the instrument's clock, since 1970 or, `in_day`, since midnight
    in_day: bool = False
    age_s: float = 0.0  # delay between measurement and telegram, stated by the sensor
    counter: int | None = None  # of the telegrams


Reading = LineReading | MotionReading
Parsed = Reading | Refusal | None
Parser = Callable[[bytes], Parsed]


def xor_of(text: str) -> int:
    """Return the checksum of NMEA 0183: exclusive or of all characters."""
    return reduce(lambda sum_, one: sum_ ^ ord(one), text, 0)


def sum_of(text: str) -> int:
    """Return the checksum of the LCI-90: decimal sum of all characters."""
    return sum(map(ord, text))


def number(text: str) -> float | None:
    """Return the finite number in a field, blanks around it ignored; None: it is none.

    Exponents, infinities, hexadecimal and grouped digits are refused.
    """
    stripped = text.strip()
    return float(stripped) if _NUMBER.fullmatch(stripped) else None


def numbers(fields: list[str]) -> list[float] | Refusal:
    """Return the numbers in fields, or the refusal of the first that is none."""
    found = []
    for one in fields:
        value = number(one)
        if value is None:
            return Refusal(NUMBER, f"'{one[:20]}' is not a number")
        found.append(value)
    return found


def iso_time_ns(text: str) -> int | None:
    """Return the nanoseconds since 1970 of a date and time in UTC; None: it is none."""
    found = _ISO.fullmatch(text.strip())
    if not found:
        return None
    return _since_epoch(tuple(map(int, found.groups()[:6])), found[7])


def day_time_ns(text: str) -> int | None:
    """Return the nanoseconds since midnight of hhmmss.sss or hh:mm:ss.sss; None: it is none."""
    found = _CLOCK.fullmatch(text.strip())
    if not found:
        return None
    hour, minute, second = (int(part) for part in found.groups()[:3])
    if hour > 23 or minute > 59 or second > 60:
        return None
    whole = (hour * 60 + minute) * 60 + second
    return whole * NANOSECONDS + _fraction_ns(found[4])


def date_time_ns(date: str, time: str) -> int | None:
    """Return the nanoseconds since 1970 of two fields with date and time; None: they are none."""
    found, in_day = _DATE.fullmatch(date.strip()), day_time_ns(time)
    if not found or in_day is None:
        return None
    midnight = _since_epoch((*(int(part) for part in found.groups()), 0, 0, 0), None)
    return None if midnight is None else midnight + in_day


def nearest_day_ns(in_day_ns: int, near_ns: int) -> int:
    """Return the instant with this time of day that is nearest to another instant."""
    days = round((near_ns - in_day_ns) / DAY_NS)
    return days * DAY_NS + in_day_ns


def clock_of(time_ns: int) -> datetime:
    """Return the date and time in UTC, to the microsecond."""
    return _EPOCH + timedelta(microseconds=time_ns // 1000)


def _since_epoch(parts: tuple[int, ...], fraction: str | None) -> int | None:
    try:
        year, month, day, hour, minute, second = parts
        moment = datetime(year, month, day, hour, minute, second, tzinfo=UTC)
    except ValueError:
        return None
    return int((moment - _EPOCH).total_seconds()) * NANOSECONDS + _fraction_ns(fraction)


def _fraction_ns(digits: str | None) -> int:
    return int((digits or "0").ljust(9, "0"))


_TAG = re.compile(r"\\([^\\]*)\\")
_CONTROL = dict.fromkeys([*range(0x20), 0x7F])


def clean(line: bytes) -> str | Refusal:
    """Return the text of a line without control characters and without its TAG block.

    The LCI-90i puts SOH, at times RS, before its line. The TAG block of IEC 61162-450 before a
    sentence has a checksum of its own.
    """
    if len(line) > MAX_LINE_BYTES:
        return Refusal(LENGTH, f"{len(line)} bytes")
    text = line.decode("latin-1").translate(_CONTROL).strip()
    while found := _TAG.match(text):
        body, star, given = found[1].rpartition("*")
        if not star or not _agrees(body, given):
            return Refusal(CHECKSUM, "of the TAG block")
        text = text[found.end() :]
    return text


def _agrees(body: str, given: str) -> bool:
    return re.fullmatch(r"[0-9A-Fa-f]{2}", given) is not None and int(given, 16) == xor_of(body)


def sentence(line: bytes, names: tuple[str, ...], start: str = "$") -> list[str] | Refusal | None:
    """Return the fields of an NMEA sentence of one of these names, the name first.

    The characters between `start` and `*` are covered by the checksum, two hexadecimal digits in
    either case. Of a line that was cut and continues with the next one the last sentence counts.

    Returns:
        None for a sentence of another name.
    """
    text = clean(line)
    if isinstance(text, Refusal):
        return text
    at = text.rfind(start)
    if at < 0:
        return None
    body, star, given = text[at + 1 :].partition("*")
    fields = body.split(",")
    if fields[0] not in names:
        return None
    if not star or len(given) < 2:
        return Refusal(INCOMPLETE, f"{fields[0]} without its checksum")
    if not _agrees(body, given):
        return Refusal(CHECKSUM, f"{fields[0]}: {given[:4]}, computed {xor_of(body):02X}")
    return fields


def nmea(body: str, start: str = "$") -> bytes:
    """Return a sentence with its checksum and end of line."""
    return f"{start}{body}*{xor_of(body):02X}\r\n".encode("ascii")
