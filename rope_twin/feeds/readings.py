"""Readings of instruments, the reasons to refuse a line, and the parts that all telegrams share.

A parser returns a reading in the units and signs of the telegram, or None for a line that belongs
to something else: several sentences often share a port. It raises a `Refusal`, and nothing else.

A poll of a PLC becomes a line too, by a map that gives the place of each quantity. Modbus has no
standard map, so the settings of a feed say where each quantity is: address (counted from 0), table,
type, word order of types of several registers, and scale; its unit is in `units`. OPC UA has types,
and nodes with names that each PLC chooses.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from functools import reduce

from rope_twin.quantity import quantity, text

START, OPCUA_START = "$MODBUS", "$OPCUA"
# type and number of registers
TYPES = {"int16": 1, "uint16": 1, "int32": 2, "uint32": 2, "int64": 4, "uint64": 4,
         "float32": 2, "float64": 4}  # fmt: skip
TABLES = "holding", "input"
MAX_REGISTERS = 125  # in one request


@dataclass(frozen=True, kw_only=True)
class Register:
    """Place of one quantity in the registers of a PLC."""

    address: int = quantity("address of its first register, counted from 0", "", 0, 65535)
    table: str = text("holding or input registers")
    type: str = text(f"type of the value: {', '.join(TYPES)}")
    word_order: str = text(
        "of types of several registers: big (most significant word first) or little", ""
    )
    scale: float = quantity("factor from the number in the registers to the value in its unit", "",
                            -1e12, 1e12, default=1.0)  # fmt: skip

    def check(self) -> str | None:
        """Return problem and remedy, or None."""
        if self.table not in TABLES:
            return f"table is '{self.table}'; give {' or '.join(TABLES)}"
        if self.type not in TYPES:
            return f"type is '{self.type}'; give one of {', '.join(TYPES)}"
        if self.scale == 0.0:
            return "scale is 0; give the value of one count"
        if TYPES[self.type] == 1 and self.word_order:
            return f"word_order has no effect with {self.type}; remove it"
        if TYPES[self.type] > 1 and self.word_order not in ("big", "little"):
            return f"word_order of {self.type} is missing; there is no default, give big or little"
        if self.address + TYPES[self.type] > 65536:
            return f"address {self.address} is too high for {self.type}; the last one is 65535"
        return None

    @property
    def end(self) -> int:
        """Return the address after its last register."""
        return self.address + TYPES[self.type]


def requests(registers: Mapping[str, Register]) -> list[tuple[str, int, int]]:
    """Return table, first address and count of the requests for all registers, as few as can be."""
    blocks: list[tuple[str, int, int]] = []
    for register in sorted(registers.values(), key=lambda one: (one.table, one.address, one.end)):
        if blocks:
            table, first, count = blocks[-1]
            if register.table == table and register.end - first <= MAX_REGISTERS:
                blocks[-1] = table, first, max(count, register.end - first)
                continue
        blocks.append((register.table, register.address, register.end - register.address))
    return blocks


_NODE = re.compile(r"(?:(?:ns=\d{1,5}|nsu=[^;]+);)?(?:i=\d{1,10}|[sgb]=.+)")


@dataclass(frozen=True, kw_only=True)
class OpcNode:
    """Node of one quantity in the address space of an OPC UA server."""

    id: str = text("its identifier, such as ns=2;s=Hoist.Load or nsu=URI;i=5001")
    scale: float = quantity("factor from its value to the value in its unit", "",
                            -1e12, 1e12, default=1.0)  # fmt: skip

    def check(self) -> str | None:
        """Return problem and remedy, or None."""
        if not _NODE.fullmatch(self.id):
            return f"id is '{self.id}'; give one such as ns=2;s=Hoist.Load or nsu=URI;i=5001"
        return "scale is 0; give the value of one count" if self.scale == 0.0 else None


def line_of(values: Sequence[float | str], start: str = START) -> bytes:
    """Return the line of one poll; a value that is not finite is left as it is, to be refused.

    values: in the order of the map; text: why a value is missing, or is no number.
    """
    fields = [
        value if isinstance(value, str) else f"{value:.9f}" if math.isfinite(value) else str(value)
        for value in values
    ]
    return nmea(",".join([start[1:], *fields]))


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


class Refusal(Exception):
    """A line gives no reading: the reason (one of REASONS), and the fault in words."""

    def __init__(self, reason: str, fault: str) -> None:
        super().__init__(reason, fault)
        self.reason, self.fault = reason, fault


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
Parser = Callable[[bytes], Reading | None]


def xor_of(text: str) -> int:
    """Return the checksum of NMEA 0183: exclusive or of all characters."""
    return reduce(lambda sum_, character: sum_ ^ ord(character), text, 0)


def sum_of(text: str) -> int:
    """Return the checksum of the LCI-90: decimal sum of all characters."""
    return sum(map(ord, text))


def number(text: str) -> float | None:
    """Return the finite number in a field, blanks around it ignored, or None if there is none.

    Exponents, infinities, hexadecimal and grouped digits are refused.
    """
    stripped = text.strip()
    return float(stripped) if _NUMBER.fullmatch(stripped) else None


def numbers(fields: list[str]) -> list[float]:
    """Return the numbers in fields. Raises Refusal for the first that is none."""
    values = []
    for word in fields:
        value = number(word)
        if value is None:
            raise Refusal(NUMBER, f"'{word[:20]}' is not a number")
        values.append(value)
    return values


def iso_time_ns(text: str) -> int | None:
    """Return the nanoseconds since 1970 of a date and time in UTC, or None if there is none."""
    match = _ISO.fullmatch(text.strip())
    if not match:
        return None
    return _since_epoch(tuple(map(int, match.groups()[:6])), match[7])


def day_time_ns(text: str) -> int | None:
    """Return the nanoseconds since midnight of hhmmss.sss or hh:mm:ss.sss; None: it is none."""
    match = _CLOCK.fullmatch(text.strip())
    if not match:
        return None
    hour, minute, second = (int(digits) for digits in match.groups()[:3])
    if hour > 23 or minute > 59 or second > 60:
        return None
    seconds = (hour * 60 + minute) * 60 + second
    return seconds * NANOSECONDS + _fraction_ns(match[4])


def date_time_ns(date: str, time: str) -> int | None:
    """Return the nanoseconds since 1970 of two fields with date and time; None: they are none."""
    match, in_day = _DATE.fullmatch(date.strip()), day_time_ns(time)
    if not match or in_day is None:
        return None
    midnight = _since_epoch((*(int(digits) for digits in match.groups()), 0, 0, 0), None)
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


def clean(line: bytes) -> str:
    """Return the text of a line without control characters and without its TAG block.

    The LCI-90i puts SOH, at times RS, before its line. The TAG block of IEC 61162-450 before a
    sentence has a checksum of its own.

    Raises:
        Refusal: the line is too long, or the TAG block is damaged.
    """
    if len(line) > MAX_LINE_BYTES:
        raise Refusal(LENGTH, f"{len(line)} bytes")
    text = line.decode("latin-1").translate(_CONTROL).strip()
    while match := _TAG.match(text):
        body, star, checksum = match[1].rpartition("*")
        if not star or not agrees(body, checksum):
            raise Refusal(CHECKSUM, "of the TAG block")
        text = text[match.end() :]
    return text


def agrees(body: str, checksum: str) -> bool:
    """Return whether two hexadecimal digits are the NMEA checksum of a sentence's body."""
    return bool(re.fullmatch(r"[0-9A-Fa-f]{2}", checksum)) and int(checksum, 16) == xor_of(body)


def since_start(line: bytes, start: str) -> str | None:
    """Return the clean text of a line from the last `start` in it on; None: there is none."""
    text = clean(line)
    return text[text.rindex(start) :] if start in text else None


def sentence(
    line: bytes, names: tuple[str, ...], start: str = "$", counts: tuple[int, ...] = ()
) -> list[str] | None:
    """Return the fields of an NMEA sentence of one of these names, the name first.

    The characters between `start` and `*` are covered by the checksum, two hexadecimal digits in
    either case. Of a line that was cut and continues with the next one the last sentence counts.

    counts: of fields that it may have, the name included; empty: any.

    Returns:
        None for a sentence of another name.

    Raises:
        Refusal: it is incomplete, or its checksum is wrong.
    """
    text = since_start(line, start)
    if text is None:
        return None
    body, star, checksum = text[1:].partition("*")
    fields = body.split(",")
    if fields[0] not in names:
        return None
    if not star or len(checksum) < 2:
        raise Refusal(INCOMPLETE, f"{fields[0]} without its checksum")
    if not agrees(body, checksum):
        raise Refusal(CHECKSUM, f"{fields[0]}: {checksum[:4]}, computed {xor_of(body):02X}")
    if counts and len(fields) not in counts:
        raise Refusal(INCOMPLETE, f"{len(fields)} fields in {fields[0]}")
    return fields


def nmea(body: str, start: str = "$") -> bytes:
    """Return a sentence with its checksum and end of line."""
    return f"{start}{body}*{xor_of(body):02X}\r\n".encode("ascii")
