"""Telegrams of motion sensors: Seapath, PASHR, TSS1, TSS3, EM3000, Octans and Phins, SMC, NORSUB.

Readings keep the signs of the telegram, but for Octans and Phins, where letters state them: there
roll is positive with port up, pitch with the bow up, and heave of `PHTRH` with the letter that the
settings call up.

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

The heading is mostly that of another sensor: a blank one is not measured, and the rest counts.
"""

from __future__ import annotations

import re
import struct

from rope_twin.feeds.readings import (
    INCOMPLETE,
    INVALID,
    NAN,
    NUMBER,
    MotionReading,
    Parser,
    Reading,
    Refusal,
    clean,
    day_time_ns,
    number,
    numbers,
    sentence,
)

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
    text = clean(line)
    at = text.rfind(start)
    if at < 0:
        return None
    match = telegram.fullmatch(text[at:])
    if not match:
        raise Refusal(INCOMPLETE, f"'{text[at : at + 30]}' is not {name}")
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


def octans(sentences: tuple[str, ...]) -> Parser:
    """Return the parser of Octans and Phins; the last of `sentences` completes a reading.

    Each of them must have come since the last reading, in this order. `$--HDT` and `$PHINF` are
    used where they come.
    """
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
