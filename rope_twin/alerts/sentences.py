"""Alert sentences of bridge equipment: ALF and ALC out, ACN in, ARC in reply.

Fields as the handbooks of two makers of navigation displays quote them from IEC 61924-2 and
IEC 62923-1; the standards themselves were not at hand. A description follows the title as a second
sentence of the same group. No sentence is longer than the 82 characters of IEC 61162-1.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from rope_twin.alerts.alert_list import Alert, State
from rope_twin.errors import InputError
from rope_twin.feeds.readings import nmea, xor_of

TALKER = "II"  # integrated instrumentation
MAKER = "RPT"
MAX_TITLE, MAX_SENTENCE = 16, 82  # characters; the latter with $ and line end
ACKNOWLEDGE, REQUEST, TRANSFER, SILENCE = "A", "Q", "O", "S"
COMMANDS = {ACKNOWLEDGE: "acknowledge", TRANSFER: "transfer", SILENCE: "silence"}
_RESERVED = "^,*!$\\~\r\n"  # ^ first: it escapes the others
_ALC_ENTRIES = 3  # alerts of one sentence: 21 characters at most each


@dataclass(frozen=True)
class AlertCommand:
    """Command of an ACN sentence."""

    identifier: int
    instance: int
    letter: str  # A, Q, O or S

    @property
    def key(self) -> str:
        """Identifier and instance, such as 10001.1."""
        return f"{self.identifier}.{self.instance}"


def clock(time_ns: int) -> str:
    """Return a UTC time of day as hhmmss.ss."""
    hundredths = time_ns // 10_000_000 % 8_640_000
    minutes, remainder = divmod(hundredths, 6000)
    return f"{minutes // 60:02d}{minutes % 60:02d}{remainder // 100:02d}.{remainder % 100:02d}"


def alf(alert: Alert, utc_ns: int, sequence: int) -> list[bytes]:
    """Return the sentences of one alert: title, and description where it fits.

    utc_ns: time of its newest change; sequence: number of the group, 0 to 9.
    """
    number = f"{MAKER},{alert.identifier},{alert.instance},{alert.revision},{alert.escalation}"
    state = f"{alert.category},{alert.priority.letter},{alert.state.value}"
    title = f"{sequence},{clock(utc_ns)},{state},{number},{_escaped(alert.name, MAX_TITLE)}"
    second = f"{TALKER}ALF,2,2,{sequence},,,,,{number},"
    text = _escaped(alert.text, MAX_SENTENCE - len(nmea(second)))
    if not text:
        return [nmea(f"{TALKER}ALF,1,1,{title}")]
    return [nmea(f"{TALKER}ALF,2,1,{title}"), nmea(second + text)]


def alc(alerts: Sequence[Alert], sequence: int) -> Iterator[bytes]:
    """Return the cyclic list of all active alerts, to be sent every 30 s or so.

    sequence: number of the group, 0 to 99.
    """
    shown = [alert for alert in alerts if alert.state is not State.NORMAL]
    groups = [shown[k : k + _ALC_ENTRIES] for k in range(0, len(shown), _ALC_ENTRIES)] or [[]]
    for number, group in enumerate(groups, start=1):
        body = f"{TALKER}ALC,{len(groups):02d},{number:02d},{sequence:02d},{len(group)}"
        for one in group:
            body += f",{MAKER},{one.identifier},{one.instance},{one.revision}"
        yield nmea(body)


def arc(command: AlertCommand, utc_ns: int) -> bytes:
    """Return the sentence that refuses a command."""
    where = f"{MAKER},{command.identifier},{command.instance}"
    return nmea(f"{TALKER}ARC,{clock(utc_ns)},{where},{command.letter}")


def read_acn(line: bytes) -> AlertCommand | None:
    """Return the command of an ACN sentence; None: another sentence, or for another maker.

    Raises:
        InputError: it is an ACN sentence, but damaged.
    """
    text = line.decode("ascii", "replace").strip()
    if len(text) < 6 or text[0] != "$" or text[3:6] != "ACN":
        return None
    body, star, checksum = text[1:].rpartition("*")
    body = body.encode("ascii", "replace").decode("ascii")
    remedy = "send $--ACN,hhmmss.ss,RPT,identifier,instance,A|Q|O|S,C*hh"
    if not star or f"{xor_of(body):02X}" != checksum.upper():
        raise InputError("ACN sentence", "its checksum is wrong", remedy)
    fields = body.split(",")
    if len(fields) > 2 and fields[2] != MAKER:
        return None
    if len(fields) != 7 or fields[6] != "C" or fields[5] not in (*COMMANDS, REQUEST):
        raise InputError("ACN sentence", f"'{text[:MAX_SENTENCE]}'", remedy)
    if not (fields[3].isdecimal() and fields[4].isdecimal()):
        problem = f"identifier '{fields[3]}', instance '{fields[4]}'"
        raise InputError("ACN sentence", problem, remedy)
    return AlertCommand(int(fields[3]), int(fields[4]), fields[5])


def _escaped(text: str, max_length: int) -> str:
    """Return as much of a text as fits, with reserved characters as ^hh."""
    out = ""
    for letter in text:
        code = letter if letter.isascii() and letter.isprintable() else "?"
        if letter in _RESERVED:
            code = f"^{ord(letter):02X}"
        if len(out) + len(code) > max_length:
            break
        out += code
    return out
