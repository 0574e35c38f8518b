"""Alert sentences: fields, checksum, length, and what comes back."""

from __future__ import annotations

from functools import reduce

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rope_twin.alerts.alert_list import Alert, Priority, State
from rope_twin.alerts.sentences import MAX_SENTENCE, AlertCommand, alc, alf, arc, clock, read_acn
from rope_twin.errors import InputError

NOON_NS = (12 * 3600 + 34 * 60 + 56) * 1_000_000_000 + 780_000_000
ALERT = Alert(
    10001, 2, "top tension", Priority.ALARM, "A", State.UNACKNOWLEDGED,
    "tension of 'hoist' 412.0 kN, limit 405.0 kN", 0, 0, revision=3, escalation=1,
)  # fmt: skip


def checksum(line: bytes) -> str:
    """XOR of all characters between $ and *."""
    return f"{reduce(lambda a, b: a ^ b, line[1:].split(b'*')[0]):02X}"


def test_an_alert_is_two_sentences_of_one_group() -> None:
    first, second = alf(ALERT, NOON_NS, 7)
    assert first.startswith(b"$IIALF,2,1,7,123456.78,A,A,V,RPT,10001,2,3,1,top tension*")
    assert second.startswith(b"$IIALF,2,2,7,,,,,RPT,10001,2,3,1,tension of 'hoist' 412.0 kN^2C")
    for line in (first, second):
        assert line.endswith(b"\r\n")
        assert len(line) <= MAX_SENTENCE
        assert line[-4:-2].decode() == checksum(line)


def test_the_list_has_every_alert_that_is_not_normal() -> None:
    four = [ALERT] * 4
    lines = list(alc(four, 12))
    assert [line[:18] for line in lines] == [b"$IIALC,02,01,12,3,", b"$IIALC,02,02,12,1,"]
    assert b"RPT,10001,2,3" in lines[0]
    assert list(alc([], 0)) == [
        b"$IIALC,01,01,00,0*" + checksum(b"$IIALC,01,01,00,0*").encode() + b"\r\n"
    ]
    assert all(len(line) <= MAX_SENTENCE for line in alc([ALERT] * 40, 99))


def acn(fields: str) -> bytes:
    """Return a sentence as a bridge sends it."""
    line = f"$BNACN,{fields}*".encode()
    return line + checksum(line).encode() + b"\r\n"


def test_a_bridge_acknowledges() -> None:
    assert read_acn(acn("123456.78,RPT,10001,2,A,C")) == AlertCommand(10001, 2, "A")
    assert read_acn(acn("123456.78,XYZ,10001,2,A,C")) is None, "for another maker"
    assert read_acn(b"$GPGGA,123456.78*00\r\n") is None
    for wrong in (
        acn("123456.78,RPT,10001,2,B,C"), acn("123456.78,RPT,10001,2,A"),
        acn("123456.78,RPT,ten,2,A,C"), acn("123456.78,RPT,10001,2,A,C")[:-4] + b"00\r\n",
        b"$BNACN,123456.78,RPT,10001,2,A,C\r\n",
    ):  # fmt: skip
        with pytest.raises(InputError, match="send \\$--ACN"):
            read_acn(wrong)
    refusal = arc(AlertCommand(10001, 2, "A"), NOON_NS)
    assert refusal.startswith(b"$IIARC,123456.78,RPT,10001,2,A*")


@given(st.binary(max_size=120))
def test_any_bytes_are_a_command_or_none_or_refused(data: bytes) -> None:
    try:
        found = read_acn(b"$BNACN" + data)
    except InputError:
        return
    assert found is None or found.letter in "AQOS"


@given(st.text(max_size=60), st.integers(0, 10**19))
def test_any_text_fits_and_is_framed(text: str, utc_ns: int) -> None:
    from dataclasses import replace

    for line in alf(replace(ALERT, text=text, name=text), utc_ns, 0):
        assert len(line) <= MAX_SENTENCE
        assert line.isascii()
        assert (line.count(b"*"), line.count(b"$")) == (1, 1)
        assert line[1:].split(b"*")[0].count(b",") == 13
    assert len(clock(utc_ns)) == 9
