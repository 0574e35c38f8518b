"""Telegrams of line monitors: recorded lines in SI, checksums, and what is refused."""

from __future__ import annotations

import math

import pytest
from feed_samples import DATA, LINES, SAMPLES, settings
from hypothesis import given
from hypothesis import strategies as st

from rope_twin.feeds.instrument import Instrument, LineSample
from rope_twin.feeds.readings import CHECKSUM, INCOMPLETE, NUMBER, RANGE, iso_time_ns, nmea
from rope_twin.feeds.writers import writer

S = 1_000_000_000
LB_N = 4.4482216152605  # exact
T_N = 9806.65  # exact


def read(line: bytes, name: str, **more: object) -> tuple[LineSample | None, dict[str, int]]:
    """The sample of one line, and the counts of refused ones."""
    instrument = Instrument(settings(name, **more))
    found = instrument.take_line(line, S)
    assert found is None or isinstance(found, LineSample)
    return found, dict(instrument.counts.refused)


def with_sum(body: str) -> bytes:
    """A line with the decimal sum of its characters."""
    return f"\x01{body}{sum(map(ord, body))}\r\n".encode()


@pytest.mark.parametrize(
    ("name", "payout_m", "speed", "tension_n", "motor_n"),
    [
        ("lci90", 34.0, 0.0, 61 * LB_N, math.nan),
        ("wir", 100.5, 0.5, 1234 * LB_N, math.nan),
        ("rcwd", 102.96, -29.95 / 60, 0.294791 * T_N, 0.42 * T_N),
        ("columns", 120.5, 0.5, math.nan, 2.5 * T_N),
    ],
)
def test_the_printed_line_of_every_format(
    name: str, payout_m: float, speed: float, tension_n: float, motor_n: float
) -> None:
    found, refused = read(SAMPLES[name], name)
    assert not refused
    assert found is not None
    values = found.payout_m, found.speed_m_per_s, found.tension_n, found.motor_tension_n
    assert values == pytest.approx((payout_m, speed, tension_n, motor_n), rel=1e-12, nan_ok=True)


@pytest.mark.parametrize(("name", "count"), [("twnc", 300), ("cwnc", 300)])
def test_every_recorded_line_of_two_winches_is_read(name: str, count: int) -> None:
    instrument = Instrument(settings("lci90"))
    lines = (DATA / f"{name}.txt").read_bytes().splitlines()
    for k, line in enumerate(lines):
        instrument.take_line(line.split(b" ", 1)[1], k * S // 20)
    assert (instrument.counts.accepted, instrument.counts.refused_total) == (count, 0)


def test_the_point_may_be_the_last_character() -> None:
    found, _ = read(
        b"\x0101RD,2014-08-01T20:28:46.352,TR METAL,-2331.,00000000,000000.0,3338", "lci90"
    )
    assert found is not None
    assert found.tension_n == pytest.approx(-2331 * LB_N)


@pytest.mark.parametrize(
    "line",
    [
        b"03RD,2022-05-14T16:17:36.502,-0000168,00000000,-00004.8,2839",  # without a name
        b"\x1e\x0103RD,2022-05-14T16:17:36.502,-0000168,00000000,-00004.8,2839\r\n",
        b"#junk" + with_sum("RD,-0000168,00000000,-00004.8,"),  # protocol 1
        b"17" + with_sum("RD,-0000168,00000000,-00004.8,")[1:],  # junk of digits
        b"03RD,2022-05-14T16:1" + with_sum("03RD,2022-05-14T16:17:36.502,-0000168,0,-4.8,"),
        with_sum("03RD,2022-05-14T16:17:36.502,FORWARD,-0000168,00000000,-00004.8,"),
    ],
)
def test_variants_of_the_lci_90(line: bytes) -> None:
    found, refused = read(line, "lci90")
    assert not refused
    assert found is not None
    assert found.tension_n == pytest.approx(-168 * LB_N)
    assert found.payout_m == pytest.approx(4.8)


def test_the_sum_covers_the_two_digits_and_no_control_character() -> None:
    line = SAMPLES["lci90"]
    assert read(line.replace(b"3596", b"3597"), "lci90")[1] == {CHECKSUM: 1}
    assert read(line.replace(b"02RD", b"03RD"), "lci90")[1] == {CHECKSUM: 1}
    assert read(line.replace(b"3596", b"3500"), "lci90")[1] == {CHECKSUM: 1}, "from RD on"


def test_another_winch_on_the_same_port_is_left_out() -> None:
    assert read(SAMPLES["lci90"], "lci90", channel="02")[0] is not None
    assert read(SAMPLES["lci90"], "lci90", channel="01") == (None, {})
    assert read(SAMPLES["rcwd"], "rcwd", channel="3") == (None, {})


def test_archives_of_wire_strings_have_the_sum_before_the_flags() -> None:
    body = "$WIR,20240501,120000,001234.0,-00030.0,-00100.5,"
    line = f"{body}{sum(map(ord, body))},00000001,00000000".encode()
    found, refused = read(line, "wir")
    assert not refused
    assert found is not None
    assert found.payout_m == 100.5
    assert read(line.replace(b"1234", b"1235"), "wir")[1] == {CHECKSUM: 1}


def test_the_instrument_s_own_time_is_used_where_it_is_asked_for() -> None:
    found, _ = read(SAMPLES["lci90"], "lci90", stamp="instrument", latency_s=0.25)
    assert found is not None
    assert found.stamp_ns == iso_time_ns("2014-08-01T00:28:38.101")
    at_arrival, _ = read(SAMPLES["lci90"], "lci90")
    assert at_arrival is not None
    assert at_arrival.stamp_ns == S


@pytest.mark.parametrize(
    ("name", "line", "reason"),
    [
        ("lci90", b"02RD,2014-08-01T00:28:38.351,STBD TR", INCOMPLETE),
        ("lci90", with_sum("02RD,2014-08-01T00:28:38.351,A,0x10,0,0,"), NUMBER),
        ("lci90", with_sum("02RD,2014-13-01T00:28:38.351,A,10,0,0,"), NUMBER),
        ("lci90", with_sum("02RD,2014-12-01T00:28:38.351,A,1e3,0,0,"), NUMBER),
        ("lci90", with_sum("RD,inf,0,0,"), NUMBER),
        ("lci90", with_sum("RD,, ,----,"), NUMBER),
        ("lci90", with_sum("RD,9e9,0,99999,"), NUMBER),
        ("lci90", with_sum("RD,999999999,99999,99999,"), RANGE),
        ("rcwd", b"@RCWD,2,3,103.64,0.42,-29.95,0,102.96,0.294791", INCOMPLETE),
        ("rcwd", SAMPLES["rcwd"].replace(b"*3d", b"*3e"), CHECKSUM),
        ("rcwd", SAMPLES["rcwd"].replace(b"*3d", b"*0x"), CHECKSUM),
        ("columns", SAMPLES["columns"].replace(b"*3F", b""), INCOMPLETE),
    ],
)
def test_lines_are_refused_for_one_reason(name: str, line: bytes, reason: str) -> None:
    assert read(line, name) == (None, {reason: 1})


@pytest.mark.parametrize(
    ("name", "line", "missing", "reason"),
    [
        ("lci90", with_sum("RD,,000030.0,-0120.5,"), "tension_n", NUMBER),
        ("lci90", with_sum("RD,------,000030.0,-0120.5,"), "tension_n", NUMBER),
        ("lci90", with_sum("RD,     NaN,000030.0,-0120.5,"), "tension_n", NUMBER),
        ("lci90", with_sum("RD,00000061,000030.0,99999,"), "payout_m", RANGE),
        ("lci90", with_sum("RD,00000061,99999999,-0120.5,"), "speed_m_per_s", RANGE),
        ("rcwd", nmea("RCWD,2,3,103.64,0.42,-29.95,0,----,0.294791", "@"), "payout_m", NUMBER),
        ("columns", nmea("R30C,1,120.5,30.0,---"), "motor_tension_n", NUMBER),
    ],
)
def test_a_value_that_the_instrument_does_not_have_leaves_the_others(
    name: str, line: bytes, missing: str, reason: str
) -> None:
    """It is counted as refused, beside the line that is accepted."""
    found, refused = read(line, name)
    assert refused == {reason: 1}
    assert found is not None
    values = {one: getattr(found, one) for one in ("tension_n", "speed_m_per_s", "payout_m")}
    values["motor_tension_n"] = found.motor_tension_n
    absent = {one for one, value in values.items() if math.isnan(value)}
    never = {"lci90": {"motor_tension_n"}, "rcwd": set(), "columns": {"tension_n"}}[name]
    assert absent == {missing} | never


NUMBERS = st.floats(-9000.0, 9000.0).map(lambda value: round(value, 1))


@pytest.mark.parametrize("name", LINES)
@given(payout_m=NUMBERS, speed=st.floats(-5.0, 5.0), tension_kn=st.floats(-50.0, 900.0))
def test_what_an_instrument_writes_is_read_back(
    name: str, payout_m: float, speed: float, tension_kn: float
) -> None:
    """Up to the digits of its telegram, in its units and signs."""
    made = settings(name)
    tension_n = 1e3 * tension_kn
    sample = LineSample(1_700_000_000 * S, tension_n, speed, payout_m, tension_n)
    found = Instrument(made).take(writer(made)(sample), 1_700_000_000 * S)
    (read_back,) = found
    assert isinstance(read_back, LineSample)
    assert read_back.payout_m == pytest.approx(payout_m, abs=0.06)
    assert read_back.speed_m_per_s == pytest.approx(speed, abs=0.01)
    own = read_back.motor_tension_n if name == "columns" else read_back.tension_n
    assert own == pytest.approx(tension_n, abs=5.1)
