"""Telegrams of line monitors and motion sensors: a parser for each.

Readings keep units and signs of the telegram, but for Octans and Phins, where letters state them:
there roll is positive with port up, pitch with the bow up, and heave of `PHTRH` with the letter
that the settings call up.

**Line monitors.** A field that is blank, has only dashes, stars or the like, or `nan` is a value
that the instrument does not have, and the others count.

- LCI-90 and LCI-90i (Measurement Technology NW): `RD,TENSION,SPEED,PAYOUT,CCCC`, and
  `nnRD,time[,NAME],TENSION,SPEED,PAYOUT,CCCC` after SOH. CCCC is the decimal sum of all characters
  before it, the last comma included, control characters left out, the two digits nn counted.
- UNOLS wire string: `$WIR,date,time,TENSION,SPEED,PAYOUT,WARNINGS,ALARMS,SUM`, warnings and alarms
  as eight digits 0 or 1; archives have the sum before them.
- Rapp: `@RCWD,winch,mode,length at the motor,tension of the motor,speed,alarm,length at the block,
  tension of the load cell*hh`.
- Others by columns: separated fields after a start such as `$R30C`, a column for each quantity.

**Motion sensors.** The heading is mostly that of another sensor: a blank one is not measured, and
the rest counts.

- `$PSXN,23,roll,pitch,heading,heave`; 20 before it: quality of position, height, heading and
  attitude (0 normal, 1 reduced, 2 invalid); 24 after it: rates of roll, pitch and yaw [°/s] and
  vertical speed [m/s].
- `$PASHR,time,heading,T,roll,pitch,heave,accuracy of roll, pitch, heading,GNSS flag[,INS flag]`;
  its flags are not judged.
- TSS1 `:XXAAAASMHHHHQMRRRRSMPPPP`: heave in cm, roll and pitch in 0.01°; small letter Q: settling.
- TSS3 `:R`, remote heave, heave, status, roll, pitch; the remote heave is that of the crane tip.
- EM3000, 10 bytes: status, 0x90, roll, pitch [0.01°], heave [cm], heading [0.01°], little-endian,
  without a checksum.
- `$PHTRO,pitch,M or P,roll,T or B`, `$PHLIN,surge,sway,heave`, `$PHSPD`, their rates, `$HEHDT`,
  `$PHINF`, status; `$PHTRH,pitch,M or P,roll,T or B,heave,O or U`.
- `$PSMCE,roll,pitch,yaw,heave,surge,sway`, `$PSMCK,heave,velocity,acceleration,roll,pitch,counter`.
- `$PNORSUB2,time,delay [µs],roll,pitch,heading,heave,velocity,status`.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Mapping
from typing import Any

from rope_twin.feeds.readings import (
    BAD,
    CHECKSUM,
    INCOMPLETE,
    INVALID,
    NAN,
    NUMBER,
    LineReading,
    MotionReading,
    Parser,
    Reading,
    Refusal,
    agrees,
    clean,
    date_time_ns,
    day_time_ns,
    iso_time_ns,
    number,
    numbers,
    sentence,
    since_start,
    sum_of,
    xor_of,
)

_RD = re.compile(r"(\d\d)?RD,")
_SUM = re.compile(r"\d{1,5}")
_FLAGS = re.compile(r"[01]{8}")
# a value that the instrument, or a register of a PLC, does not have
_BLANK = re.compile(r"[\s*#?=_.-]*|\s*nan\s*", re.IGNORECASE)
_QUANTITIES = "tension", "speed", "payout"
_MAX_STARTS = 4  # in one line: of telegrams that were cut
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
        starts = list(_RD.finditer(text))[-_MAX_STARTS:]
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
        text = since_start(line, "$WIR,")
        if text is None:
            return None
        fields = text.split(",")
        if len(fields) != 9:
            raise Refusal(INCOMPLETE, f"{len(fields)} fields in WIR")
        archived = not _FLAGS.fullmatch(fields[6]) and bool(_FLAGS.fullmatch(fields[8].strip()))
        column, flags = (6, fields[7:]) if archived else (8, fields[6:8])
        if not all(_FLAGS.fullmatch(flag.strip()) for flag in flags):
            raise Refusal(NUMBER, "warnings or alarms of WIR are not eight digits 0 or 1")
        given = fields[column].strip()
        if checksum == "sum":
            _check_sum("WIR", fields[:column], given)
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


def _check_sum(name: str, fields: list[str], given: str) -> None:
    """Refuse fields and the commas after them with another decimal sum of their characters."""
    computed = sum_of(",".join(fields) + ",")
    if not _SUM.fullmatch(given) or int(given) != computed:
        raise Refusal(CHECKSUM, f"{name}: {given[:8]}, computed {computed}")


def columns(start: str, places: Mapping[str, int], checksum: str, channel: str = "") -> Parser:
    """Return the parser of fields separated by commas after a start.

    places: number of the field (the start is 0) of `tension`, `speed`, `payout`, `motor_tension`
    and `channel`. checksum: `xor` as in NMEA 0183 (after `*`, without the first character), `sum`
    of all characters before it in the last field, or `none`.
    """
    quantities = [name for name in places if name != "channel"]

    def parse(line: bytes) -> Reading | None:
        text = since_start(line, start)
        if text is None:
            return None
        if checksum == "xor":
            text, star, given = text.partition("*")
            if not star:
                raise Refusal(INCOMPLETE, f"{start} without its checksum")
            if not agrees(text[1:], given):
                raise Refusal(CHECKSUM, f"{start}: {given[:4]}, computed {xor_of(text[1:]):02X}")
        fields = text.split(",")
        if checksum == "sum":
            given = fields.pop().strip()
            _check_sum(start, fields, given)
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


EM3000_BYTES = 10
EM3000_RECORD = struct.Struct("<BBhhhH")
_SECOND = 0x90
_SIGNED, _QUALITY = r"([ +-]\d{4})", r"(?P<status>[UGHFughf])"
_TSS1 = re.compile(rf":[0-9A-Fa-f]{{6}} ?{_SIGNED}{_QUALITY} ?{_SIGNED} ?{_SIGNED}")
_TSS3 = re.compile(rf":R ?{_SIGNED} ?{_SIGNED}{_QUALITY} ?{_SIGNED} ?{_SIGNED}")
_STATUS = re.compile(r"[0-9A-Fa-f]{1,8}")
_HEADING_INVALID, _ROLL_INVALID, _PITCH_INVALID = 1, 2, 4  # bits of PHINF
_HEADINGS = ("HEHDT", "HCHDT", "GPHDT", "GNHDT", "INHDT")  # gyro, compass, GNSS, integrated
_OCTANS = ("PHTRO", "PHLIN", "PHSPD", "PHINF", *_HEADINGS)
_BOW_UP, _PORT_UP = {"M": 1.0, "P": -1.0}, {"T": 1.0, "B": -1.0}


def _heading(text: str) -> float:
    """Return a heading [°], NaN for a blank field. Raises Refusal."""
    return numbers([text])[0] if text.strip() else NAN


def psxn(with_rates: bool = False) -> Parser:
    """Return the parser of Seapath; `with_rates`: a reading is complete with its sentence 24.

    Without it sentence 24 is left out. A heading that sentence 20 calls invalid is not measured.
    """
    state: dict[str, list[float]] = {}

    def parse(line: bytes) -> Reading | None:
        fields = sentence(line, ("PSXN",))
        if fields is None:
            return None
        kind, counts = fields[1] if len(fields) > 1 else "", {"20": 4, "23": 4, "24": 4}
        if kind not in counts or (kind == "24" and not with_rates):
            return None
        if len(fields) != 2 + counts[kind]:
            raise Refusal(INCOMPLETE, f"{len(fields)} fields in PSXN,{kind}")
        if kind == "23":
            roll, pitch, heave = numbers([*fields[2:4], fields[5]])
            values = [roll, pitch, _heading(fields[4]), heave]
        else:
            values = numbers(fields[2:])
        state[kind] = values
        if kind == "20":
            state.pop("23", None)  # of a telegram whose sentence 24 was lost
        if kind == "20" or (kind == "23" and with_rates):
            return None
        if "23" not in state:
            raise Refusal(INCOMPLETE, "PSXN,24 without PSXN,23")
        roll, pitch, heading, heave = state.pop("23")
        quality = state.get("20", [0.0] * 4)
        if quality[1] >= 2 or quality[3] >= 2:
            raise Refusal(INVALID, "height or attitude by PSXN,20")
        if quality[2] >= 2:
            heading = NAN
        rate = state.pop("24")[3] if with_rates else NAN
        return MotionReading(heave, rate, roll, pitch, heading)

    return parse


def pashr(line: bytes) -> MotionReading | None:
    """Parse `$PASHR`; its flags are not judged."""
    fields = sentence(line, ("PASHR",), counts=(11, 12))
    if fields is None:
        return None
    time_ns = day_time_ns(fields[1])
    if time_ns is None:
        raise Refusal(NUMBER, f"'{fields[1][:20]}' is not a time")
    if not fields[6].strip():
        raise Refusal(INCOMPLETE, "PASHR without heave")
    roll, pitch, heave = numbers(fields[4:7])
    heading = _heading(fields[2])
    return MotionReading(
        heave, roll=roll, pitch=pitch, heading=heading, time_ns=time_ns, in_day=True
    )


def _tss(line: bytes, start: str, name: str, telegram: re.Pattern[str]) -> list[float] | None:
    """Return the heaves [m], roll and pitch [°] of a telegram of TSS, or None if it is another."""
    text = since_start(line, start)
    if text is None:
        return None
    match = telegram.fullmatch(text)
    if not match:
        raise Refusal(INCOMPLETE, f"'{text[:30]}' is not {name}")
    if match["status"].islower():
        raise Refusal(INVALID, f"{name} is settling ({match['status']})")
    return [float(group) / 100.0 for group in match.groups() if not group.isalpha()]


def tss1(line: bytes) -> MotionReading | None:
    """Parse TSS1."""
    values = _tss(line, ":", "TSS1", _TSS1)
    return MotionReading(values[0], roll=values[1], pitch=values[2]) if values else None


def tss3(remote: bool) -> Parser:
    """Return the parser of TSS3; `remote`: its remote heave, else the heave at the sensor."""

    def parse(line: bytes) -> MotionReading | None:
        values = _tss(line, ":R", "TSS3", _TSS3)
        if values is None:
            return None
        return MotionReading(values[0 if remote else 1], roll=values[2], pitch=values[3])

    return parse


def em3000_starts(data: bytes) -> bool:
    """Return whether bytes can begin a record of EM3000."""
    return len(data) > 1 and data[1] == _SECOND and (data[0] == 0 or 0x90 <= data[0] <= 0xAF)


def em3000(data: bytes) -> MotionReading:
    """Parse an EM3000 record of 10 bytes."""
    if len(data) != EM3000_BYTES or not em3000_starts(data):
        raise Refusal(INCOMPLETE, f"{len(data)} bytes that are no record of EM3000")
    status, _, roll, pitch, heave, heading = EM3000_RECORD.unpack(data)
    if status >= 0x9A:
        raise Refusal(INVALID, f"EM3000 has status 0x{status:02X}")
    return MotionReading(
        heave / 100.0, roll=roll / 100.0, pitch=pitch / 100.0, heading=heading / 100.0
    )


def octans(names: str) -> Parser:
    """Return the parser of Octans and Phins; the last of the sentences named completes a reading.

    Each of them must have come since the last reading, in this order. `$--HDT` and `$PHINF` are
    used where they come.
    """
    sentences = names.split()
    state: dict[str, list[float]] = {}
    status = {"bits": 0}

    def take(fields: list[str]) -> None:
        name = fields[0]
        if name.endswith("HDT"):
            heading = number(fields[1]) if len(fields) == 3 else None
            if heading is None:
                raise Refusal(NUMBER, f"{name} without a heading")
            state["HDT"] = [heading]
        elif name == "PHINF":
            if len(fields) != 2 or not _STATUS.fullmatch(fields[1]):
                raise Refusal(NUMBER, "PHINF without its status")
            status["bits"] = int(fields[1], 16)
        elif name == "PHTRO":
            state[name] = _pitch_and_roll(fields, 5)
        elif len(fields) != 4:
            raise Refusal(INCOMPLETE, f"{len(fields)} fields in {name}")
        else:
            state[name] = numbers(fields[1:])
        if name in sentences:  # those after it are of a telegram whose end was lost
            for later in sentences[sentences.index(name) + 1 :]:
                state.pop(later, None)

    def parse(line: bytes) -> Reading | None:
        fields = sentence(line, _OCTANS)
        if fields is None:
            return None
        take(fields)
        if fields[0] != sentences[-1]:
            return None
        missing = [name for name in sentences if name not in state]
        latest = dict(state)
        state.clear()
        if missing:
            raise Refusal(INCOMPLETE, f"{sentences[-1]} without {', '.join(missing)}")
        if status["bits"] & (_ROLL_INVALID | _PITCH_INVALID):
            raise Refusal(INVALID, f"roll or pitch by PHINF {status['bits']:08X}")
        unknown = [NAN] * 3
        pitch, roll = latest.get("PHTRO", unknown[:2])
        heave, rate = latest.get("PHLIN", unknown)[2], latest.get("PHSPD", unknown)[2]
        valid = not status["bits"] & _HEADING_INVALID
        heading = latest.get("HDT", unknown)[0] if valid else NAN
        return MotionReading(heave, rate, roll, pitch, heading)

    return parse


def _pitch_and_roll(fields: list[str], count: int) -> list[float]:
    """Return pitch, bow up, and roll, port up, of a number and a letter each [°]."""
    if len(fields) != count:
        raise Refusal(INCOMPLETE, f"{len(fields)} fields in {fields[0]}")
    values = numbers([fields[1], fields[3]])
    signs = _BOW_UP.get(fields[2]), _PORT_UP.get(fields[4])
    if signs[0] is None or signs[1] is None or min(values) < 0.0:
        raise Refusal(NUMBER, f"{fields[0]} with {','.join(fields[1:5])[:30]}")
    return [signs[0] * values[0], signs[1] * values[1]]


def phtrh(up: str) -> Parser:
    """Return the parser of `$PHTRH`; `up`: the letter, O or U, of a heave that is up."""

    def parse(line: bytes) -> Reading | None:
        fields = sentence(line, ("PHTRH",))
        if fields is None:
            return None
        pitch, roll = _pitch_and_roll(fields, 7)
        heave = number(fields[5])
        if heave is None or heave < 0.0 or fields[6] not in ("O", "U"):
            raise Refusal(NUMBER, f"PHTRH with heave {','.join(fields[5:])[:20]}")
        return MotionReading(heave if fields[6] == up else -heave, roll=roll, pitch=pitch)

    return parse


def smc(line: bytes) -> MotionReading | None:
    """Parse `$PSMCE` and `$PSMCK`, one of which a sensor is set to send."""
    fields = sentence(line, ("PSMCE", "PSMCK"), counts=(7,))
    if fields is None:
        return None
    values = numbers(fields[1:])
    if fields[0] == "PSMCE":
        roll, pitch, yaw, heave, _, _ = values
        return MotionReading(heave, roll=roll, pitch=pitch, heading=yaw)
    heave, rate, _, roll, pitch, counter = values
    return MotionReading(heave, rate, roll, pitch, counter=int(counter))


def norsub(line: bytes) -> MotionReading | None:
    """Parse `$PNORSUB2`; its status is not judged."""
    fields = sentence(line, ("PNORSUB2",), counts=(9,))
    if fields is None:
        return None
    time_us, delay_us, roll, pitch, heave, rate = numbers([*fields[1:5], *fields[6:8]])
    heading = _heading(fields[5])
    if not 0.0 <= delay_us <= 10e6:
        raise Refusal(NUMBER, f"PNORSUB2 with a delay of {delay_us:g} µs")
    return MotionReading(
        heave, rate, roll, pitch, heading, age_s=delay_us * 1e-6, counter=int(time_us)
    )
