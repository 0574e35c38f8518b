"""Telegrams of line monitors: LCI-90 and LCI-90i, UNOLS wire string, Rapp, and by columns.

Readings keep units and signs of the telegram: no telegram states them. A field that is blank or has
only dashes, stars or the like is a value that the instrument does not have, and the others count.

- LCI-90 and LCI-90i (Measurement Technology NW): `RD,TENSION,SPEED,PAYOUT,CCCC`, and
  `nnRD,time[,NAME],TENSION,SPEED,PAYOUT,CCCC` after SOH. CCCC is the decimal sum of all characters
  before it, the last comma included, control characters left out, the two digits nn counted.
- UNOLS wire string: `$WIR,date,time,TENSION,SPEED,PAYOUT,WARNINGS,ALARMS,SUM`, warnings and alarms
  as eight digits 0 or 1; archives have the sum before them.
- Rapp: `@RCWD,winch,mode,length at the motor,tension of the motor,speed,alarm,length at the block,
  tension of the load cell*hh`.
- Others by columns: separated fields after a start such as `$R30C`, a column for each quantity.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from rope_twin.feeds.readings import (
    BAD,
    CHECKSUM,
    INCOMPLETE,
    NUMBER,
    LineReading,
    Parser,
    Reading,
    Refusal,
    clean,
    date_time_ns,
    iso_time_ns,
    numbers,
    sentence,
    sum_of,
    xor_of,
)

_RD = re.compile(r"(\d\d)?RD,")
_SUM = re.compile(r"\d{1,5}")
_FLAGS = re.compile(r"[01]{8}")
_BLANK = re.compile(r"[\s*#?=_.-]*")  # a value that the instrument does not have
_QUANTITIES = "tension", "speed", "payout"
_MOST_STARTS = 4  # in one line: of telegrams that were cut
SUM_KINDS = ("xor", "sum", "none")


def _measured(given: Mapping[str, str]) -> dict[str, Any]:
    """Return the values of a LineReading from the fields of its quantities.

    Raises:
        Refusal: a field is no number and not blank, so that the telegram may be another one, or no
            field has a value.
    """
    known = {name: text for name, text in given.items() if not _BLANK.fullmatch(text)}
    measured: dict[str, Any] = dict(zip(known, numbers(list(known.values())), strict=True))
    if len(known) < len(given):
        blank = ((name, text) for name, text in given.items() if name not in known)
        measured["missing"] = Refusal(NUMBER, ", ".join(f"{k} '{text[:20]}'" for k, text in blank))
    if not known:
        raise measured["missing"]
    return measured


def lci90(channel: str = "") -> Parser:
    """Return the parser of LCI-90 and LCI-90i; `channel`: the two digits nn, empty: all."""

    def parse(line: bytes) -> Reading | None:
        text = clean(line)
        starts = list(_RD.finditer(text))[-_MOST_STARTS:]
        refused: Refusal | None = None
        for start in reversed(starts):
            try:
                best = _rd(text[start.start() :], start[1] or "")
            except Refusal as refusal:
                refused = refused or refusal
            else:
                return best if not channel or best.channel == channel else None
        if refused is not None:
            raise refused
        return None

    return parse


def _rd(text: str, digits: str) -> LineReading:
    fields = text.split(",")
    if not 5 <= len(fields) <= 7:
        raise Refusal(INCOMPLETE, f"{len(fields)} fields in RD")
    checksum = fields[-1].strip()
    if not _SUM.fullmatch(checksum):
        raise Refusal(INCOMPLETE, "RD without its sum")
    covered = text[: text.rindex(",") + 1]
    sums = {sum_of(covered)}
    if len(fields) == 5:
        sums.add(sum_of(covered[len(digits) :]))  # junk before the RD of protocol 1
    if int(checksum) not in sums:
        raise Refusal(CHECKSUM, f"RD: {checksum}, computed {sum_of(covered)}")
    time_ns = None
    if len(fields) > 5:
        time_ns = iso_time_ns(fields[1])
        if time_ns is None:
            raise Refusal(NUMBER, f"'{fields[1][:30]}' is not a time")
    measured = _measured(dict(zip(_QUANTITIES, fields[-4:-1], strict=True)))
    return LineReading(**measured, channel=digits, time_ns=time_ns)


def wir(checksum: str) -> Parser:
    """Return the parser of UNOLS wire strings; `checksum`: `sum` or `none`.

    `sum` is the decimal sum of all characters before it, the last comma included.
    """

    def parse(line: bytes) -> Reading | None:
        text = clean(line)
        at = text.rfind("$WIR,")
        if at < 0:
            return None
        text = text[at:]
        fields = text.split(",")
        if len(fields) != 9:
            raise Refusal(INCOMPLETE, f"{len(fields)} fields in WIR")
        archived = not _FLAGS.fullmatch(fields[6]) and bool(_FLAGS.fullmatch(fields[8].strip()))
        column, flags = (6, fields[7:]) if archived else (8, fields[6:8])
        if not all(_FLAGS.fullmatch(flag.strip()) for flag in flags):
            raise Refusal(NUMBER, "warnings or alarms of WIR are not eight digits 0 or 1")
        given = fields[column].strip()
        if checksum == "sum":
            computed = sum_of(",".join(fields[:column]) + ",")
            if not _SUM.fullmatch(given) or int(given) != computed:
                raise Refusal(CHECKSUM, f"WIR: {given[:8]}, computed {computed}")
        measured = _measured(dict(zip(_QUANTITIES, fields[3:6], strict=True)))
        return LineReading(**measured, time_ns=date_time_ns(fields[1], fields[2]))

    return parse


def rcwd(length_at: str, channel: str = "") -> Parser:
    """Return the parser of Rapp; `length_at`: `block` or `motor`; `channel`: the winch's number."""

    def parse(line: bytes) -> Reading | None:
        fields = sentence(line, ("RCWD",), "@", counts=(9,))
        if fields is None:
            return None
        at_motor, motor, speed, alarm, at_block, cell = fields[3:]
        payout, unused = (at_block, at_motor) if length_at == "block" else (at_motor, at_block)
        numbers([text for text in (alarm, unused) if not _BLANK.fullmatch(text)])
        texts = {"tension": cell, "speed": speed, "payout": payout, "motor_tension": motor}
        measured = _measured(texts)
        if channel and fields[1].strip() != channel:
            return None
        return LineReading(**measured, channel=fields[1].strip())

    return parse


def columns(
    start: str, places: Mapping[str, int], checksum: str, separator: str = ",", channel: str = ""
) -> Parser:
    """Return the parser of separated fields after a start.

    places: number of the field (the start is 0) of `tension`, `speed`, `payout`, `motor_tension`
    and `channel`. checksum: `xor` as in NMEA 0183 (after `*`, without the first character), `sum`
    of all characters before it in the last field, or `none`.
    """
    quantities = [name for name in places if name != "channel"]

    def parse(line: bytes) -> Reading | None:
        text = clean(line)
        at = text.rfind(start)
        if at < 0:
            return None
        text = text[at:]
        if checksum == "xor":
            text, star, given = text.partition("*")
            if not star:
                raise Refusal(INCOMPLETE, f"{start} without its checksum")
            if not re.fullmatch(r"[0-9A-Fa-f]{2}", given) or int(given, 16) != xor_of(text[1:]):
                raise Refusal(CHECKSUM, f"{start}: {given[:4]}, computed {xor_of(text[1:]):02X}")
        fields = text.split(separator)
        if checksum == "sum":
            given = fields.pop().strip()
            computed = sum_of(separator.join(fields) + separator)
            if not _SUM.fullmatch(given) or int(given) != computed:
                raise Refusal(CHECKSUM, f"{start}: {given[:8]}, computed {computed}")
        if fields[0] != start:
            return None
        if len(fields) <= max(places.values()):
            raise Refusal(INCOMPLETE, f"{len(fields)} fields after {start}")
        measured = _measured({name: fields[places[name]] for name in quantities})
        line_channel = fields[places["channel"]].strip() if "channel" in places else ""
        if channel and line_channel != channel:
            return None
        return LineReading(**measured, channel=line_channel)

    return parse


def polled(start: str, names: tuple[str, ...]) -> Parser:
    """Return the parser of the lines of a poll whose values can be missing one by one.

    names: of the quantities in their order. A field of letters is the status that tells why its
    value is missing; a line without any value is refused.
    """

    def parse(line: bytes) -> Reading | None:
        fields = sentence(line, (start[1:],), start[0])
        if fields is None:
            return None
        if len(fields) != len(names) + 1:
            raise Refusal(INCOMPLETE, f"{len(fields) - 1} values after {start}")
        texts = dict(zip(names, fields[1:], strict=True))
        bad = {name: words for name, words in texts.items() if words[:1].isalpha()}
        missing = None
        if bad:
            missing = Refusal(BAD, ", ".join(f"{name} {words}" for name, words in bad.items()))
        if missing is not None and len(bad) == len(texts):
            raise missing
        readable = [name for name in texts if name not in bad]
        values = numbers([texts[name] for name in readable])
        measured: dict[str, Any] = dict(zip(readable, values, strict=True))
        return LineReading(**measured, missing=missing)

    return parse
