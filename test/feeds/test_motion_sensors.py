"""Telegrams of motion sensors: printed lines in SI and REP 103, signs, validity flags."""

from __future__ import annotations

import math
from dataclasses import astuple

import pytest
from feed_samples import DATA, MOTIONS, SAMPLES, settings
from hypothesis import given
from hypothesis import strategies as st

from rope_twin.feeds.configuration import FeedSettings
from rope_twin.feeds.instrument import Instrument, MotionSample
from rope_twin.feeds.readings import CHECKSUM, INCOMPLETE, INVALID, LATE, NUMBER, nmea
from rope_twin.feeds.writers import writer

S = 1_000_000_000
NOW_NS = 1_700_000_000 * S
NAN = math.nan


def read(data: bytes, made: FeedSettings) -> tuple[MotionSample | None, dict[str, int]]:
    """The sample that bytes complete, and the counts of refused lines."""
    instrument = Instrument(made)
    found = instrument.take(data, NOW_NS, is_complete=True)
    assert len(found) <= 1
    assert all(isinstance(one, MotionSample) for one in found)
    return (found[0] if found else None), dict(instrument.counts.refused)  # type: ignore[return-value]


@pytest.mark.parametrize(
    ("name", "heave_m", "rate", "port_up_deg", "bow_up_deg", "heading_deg"),
    [
        ("psxn", -0.15, NAN, 1.24, -2.35, 218.66),
        ("pashr", 0.01, NAN, -0.30, 0.31, 158.09),
        ("tss1", -0.03, NAN, -3.25, 3.19, NAN),
        ("tss3", 0.14, NAN, 0.37, 9.83, NAN),
        ("em3000", 0.15, NAN, 1.24, -2.35, 218.66),
        ("octans", 0.542, NAN, 0.34, 1.72, NAN),
        ("phtrh", 0.16, NAN, -1.69, 1.81, NAN),
        ("smc", -0.38, NAN, 3.20, -5.75, 350.7),
        ("norsub", 0.15, -0.20, 1.24, -2.35, 218.66),
    ],
)
def test_the_printed_line_of_every_format(
    name: str,
    heave_m: float,
    rate: float,
    port_up_deg: float,
    bow_up_deg: float,
    heading_deg: float,
) -> None:
    found, refused = read(SAMPLES[name], settings(name))
    assert not refused
    assert found is not None
    values = (
        found.heave_m, found.heave_rate_m_per_s, math.degrees(found.roll_rad),
        -math.degrees(found.pitch_rad), found.heading_deg,
    )  # fmt: skip
    wanted = heave_m, rate, port_up_deg, bow_up_deg, heading_deg
    assert values == pytest.approx(wanted, abs=1e-12, nan_ok=True)


# Each maker's line for a ship 1 m up, rolled 2° with port up and pitched 3° with the bow up.
ONE_METRE_UP = {
    "psxn": nmea("PSXN,23,2.00,3.00,0.00,-1.00"),
    "pashr": nmea("PASHR,120000.000,0.00,T,+2.00,+3.00,+1.00,0.029,0.029,0.059,1,1"),
    "tss1": b":00FFCA  0100F 0200  0300\r\n",
    "tss3": b":R 0100 0000H 0200  0300\r\n",
    "em3000": bytes.fromhex("9090c8002c0164000000"),
    "octans": nmea("PHTRO,3.00,M,2.00,T") + nmea("PHLIN,0.000,0.000,1.000"),
    "phtrh": nmea("PHTRH,3.00,M,2.00,T,1.00,O"),
    "smc": nmea("PSMCE,+02.00,-03.00,+000.0,+01.00,+00.00,+00.00"),
    "norsub": nmea("PNORSUB2,1,0,2.00,3.00,0.00,-1.00,0.00,0"),
}


@pytest.mark.parametrize("name", MOTIONS)
def test_a_ship_one_metre_up_is_one_metre_up_for_every_maker(name: str) -> None:
    found, _ = read(ONE_METRE_UP[name], settings(name))
    assert found is not None
    assert found.heave_m == 1.0
    assert math.degrees(found.roll_rad) == pytest.approx(2.0), "REP 103: port up"
    assert math.degrees(found.pitch_rad) == pytest.approx(-3.0), "REP 103: bow down"


@pytest.mark.parametrize("name", [one for one in MOTIONS if one not in ("octans", "phtrh")])
def test_the_opposite_settings_give_the_opposite_signs(name: str) -> None:
    opposite = {"up": "down", "down": "up", "port_up": "starboard_up",
                "bow_up": "bow_down", "bow_down": "bow_up"}  # fmt: skip
    usual = settings(name)
    turned = {key: opposite[word] for key, word in usual.positive.items()}
    found, _ = read(ONE_METRE_UP[name], settings(name, positive=turned))
    assert found is not None
    assert found.heave_m == -1.0
    assert math.degrees(found.roll_rad) == pytest.approx(-2.0)
    assert math.degrees(found.pitch_rad) == pytest.approx(3.0)


def test_the_letter_of_a_heave_that_is_up_is_a_setting() -> None:
    found, _ = read(SAMPLES["phtrh"], settings("phtrh", positive={"letter": "U"}))
    assert found is not None
    assert found.heave_m == -0.16


def test_the_second_telegram_of_smc() -> None:
    line = b"$PSMCK,-00.001,-00.002,-00.001,+00.81,+03.84,03834*4D\r\n"
    assert line == nmea("PSMCK,-00.001,-00.002,-00.001,+00.81,+03.84,03834")
    found, _ = read(line, settings("smc"))
    assert found is not None
    assert (found.heave_m, found.heave_rate_m_per_s) == (-0.001, -0.002)
    printed = b"$PSMCK,-00.001,-00.000,-00.001,+00.81,+03.84,03834*4F"  # of the manual
    assert read(printed, settings("smc"))[0] is not None


def test_a_stated_delay_makes_the_stamp_earlier() -> None:
    found, _ = read(SAMPLES["norsub"], settings("norsub", latency_s=0.01))
    assert found is not None
    assert found.stamp_ns == NOW_NS - 12_500_000


def test_a_time_of_day_gets_the_date_of_its_arrival() -> None:
    """Also about midnight."""
    instrument = Instrument(settings("pashr", stamp="instrument"))
    day_ns = 86_400 * S
    line = nmea("PASHR,235959.900,0.00,T,+0.00,+0.00,+1.00,0.029,0.029,0.059,1,1")
    (found,) = instrument.take(line, 20_000 * day_ns + S // 10)
    assert found.stamp_ns == 20_000 * day_ns - S // 10


def test_the_remote_heave_of_tss3_is_that_of_the_crane_tip() -> None:
    line = b":R 0100 0014H 0037 0983\r\n"
    tip, _ = read(line, settings("tss3"))
    own, _ = read(line, settings("tss3", heave_of="reference", rest_heading_deg=0.0))
    assert tip is not None
    assert own is not None
    assert (tip.heave_m, own.heave_m) == (1.0, 0.14)


def test_rates_of_the_next_sentence_belong_to_the_reading() -> None:
    lines = nmea("PSXN,23,1.0,2.0,3.0,0.50") + nmea("PSXN,24,0.1,0.2,0.3,-0.40")
    found, _ = read(lines, settings("psxn", sentences="23 24"))
    assert found is not None
    assert (found.heave_m, found.heave_rate_m_per_s) == (-0.5, 0.4)
    block = SAMPLES["octans"] + nmea("PHSPD,0.1,0.2,0.3")
    found, _ = read(nmea("HEHDT,12.5,T") + block, settings("octans", sentences="PHTRO PHLIN PHSPD"))
    assert found is not None
    assert (found.heave_m, found.heave_rate_m_per_s, found.heading_deg) == (0.542, 0.3, 12.5)


def test_rates_that_are_not_asked_for_are_left_out() -> None:
    instrument = Instrument(settings("psxn"))
    for k, heave in enumerate((0.5, 0.6)):
        (found,) = instrument.take(nmea(f"PSXN,23,1.0,2.0,3.0,{heave}"), NOW_NS + k * S)
        assert isinstance(found, MotionSample)
        assert math.isnan(found.heave_rate_m_per_s), "of the sentence 24 before it"
        assert not instrument.take(nmea("PSXN,24,0.1,0.2,0.3,-0.40"), NOW_NS + k * S + 1)
    assert (instrument.counts.others, instrument.counts.refused_total) == (2, 0)


@pytest.mark.parametrize(
    ("name", "heading", "count"),
    [("psxn", b"", 0), ("pashr", b" ", 0), ("norsub", b"", 0), ("psxn", b"400.00", 1)],
)
def test_a_faulty_heading_leaves_the_motion(name: str, heading: bytes, count: int) -> None:
    """It is that of another sensor; a blank one is not measured, one beyond 360° is refused."""
    whole, _ = read(SAMPLES[name], settings(name))
    given = {"psxn": b"218.66", "pashr": b"158.09", "norsub": b"218.66"}[name]
    body = SAMPLES[name].replace(given, heading).partition(b"*")[0].decode()
    found, refused = read(nmea(body[1:]), settings(name))
    assert whole is not None
    assert found is not None
    assert math.isnan(found.heading_deg)
    assert astuple(found)[:-1] == pytest.approx(astuple(whole)[:-1], abs=0.0, nan_ok=True)
    assert sum(refused.values()) == count


def test_a_heading_that_is_invalid_is_not_measured() -> None:
    found, _ = read(nmea("PSXN,20,0,0,2,0") + SAMPLES["psxn"], settings("psxn"))
    assert found is not None
    assert math.isnan(found.heading_deg)
    assert found.heave_m == -0.15


@pytest.mark.parametrize("name", ["GPHDT", "GNHDT", "INHDT"])
def test_the_heading_of_another_sentence_is_used(name: str) -> None:
    found, _ = read(nmea(f"{name},12.5,T") + SAMPLES["octans"], settings("octans"))
    assert found is not None
    assert found.heading_deg == 12.5


@pytest.mark.parametrize(
    ("name", "data", "reason"),
    [
        ("psxn", nmea("PSXN,20,0,2,0,0") + SAMPLES["psxn"], INVALID),
        ("psxn", nmea("PSXN,20,0,0,0,2") + SAMPLES["psxn"], INVALID),
        ("psxn", SAMPLES["psxn"].replace(b"1.24", b"1.25"), CHECKSUM),
        ("psxn", nmea("PSXN,23,1.24,-2.35,218.66"), INCOMPLETE),
        ("pashr", nmea("PASHR,163029.000,158.09,T,-0.30,+0.31,,0.029,0.029,0.059,1"), INCOMPLETE),
        ("pashr", nmea("PASHR,253029.000,158.09,T,-0.30,+0.31,+0.01,0.0,0.0,0.0,1"), NUMBER),
        ("tss1", SAMPLES["tss1"].replace(b"F-0", b"f-0"), INVALID),
        ("tss1", SAMPLES["tss1"][:20], INCOMPLETE),
        ("em3000", b"\x9a" + SAMPLES["em3000"][1:], INVALID),
        ("em3000", b"\xa0" + SAMPLES["em3000"][1:], INVALID),
        ("em3000", SAMPLES["em3000"][:9], INCOMPLETE),
        ("octans", nmea("PHINF,00000002") + SAMPLES["octans"], INVALID),
        ("octans", SAMPLES["octans"].split(b"\n")[1], INCOMPLETE),
        ("octans", nmea("PHTRO,1.72,X,0.34,T"), NUMBER),
        ("phtrh", nmea("PHTRH,1.81,M,1.69,B,0.16,X"), NUMBER),
        ("norsub", nmea("PNORSUB2,1,-5,2.00,3.00,0.00,-1.00,0.00,0"), NUMBER),
    ],
)
def test_lines_are_refused_for_one_reason(name: str, data: bytes, reason: str) -> None:
    assert read(data, settings(name)) == (None, {reason: 1})


def test_the_recorded_seapath_is_read_and_its_other_sentences_are_left() -> None:
    instrument = Instrument(settings("psxn"))
    lines = [line.split(b" ", 1)[1] for line in (DATA / "seap.txt").read_bytes().splitlines()]
    found = [instrument.take_line(line, k * S) for k, line in enumerate(lines)]
    wanted = sum(line.startswith(b"$PSXN,23") for line in lines)
    assert wanted == sum(one is not None for one in found) == instrument.counts.accepted == 50
    assert instrument.counts.refused_total == 0
    assert instrument.counts.others == len(lines) - wanted


def test_records_of_em3000_are_found_in_a_stream() -> None:
    """From the middle of one on, in pieces, and with a byte that looks like a beginning."""
    made = settings("em3000")
    write = writer(made)
    heaves = [0.01 * k for k in range(-200, 200)]  # among them a low byte of 0x90
    stream = b"".join(write(MotionSample(0, one, NAN, 0.02, 0.01, 10.0)) for one in heaves)
    instrument, found = Instrument(made), []
    for at in range(4, len(stream), 7):
        found += instrument.take(stream[at : at + 7], NOW_NS + at * S)
    # The first is cut; the last waits for its successor.
    assert [one.heave_m for one in found] == pytest.approx(heaves[1:-1])  # type: ignore[union-attr]


def test_a_record_in_a_stream_has_the_time_of_its_own_arrival() -> None:
    """Not that of the next one, which shows that it is complete."""
    write = writer(settings("em3000"))
    records = [write(MotionSample(0, 0.1 * k, NAN, 0.0, 0.0, 10.0)) for k in range(6)]
    instrument, found = Instrument(settings("em3000")), []
    for k, data in enumerate((records[0][:4], records[0][4:], records[1] + records[2][:1],
                              records[2][1:], records[3] + records[4], records[5])):  # fmt: skip
        found += instrument.take(data, NOW_NS + k * S)
    stamps = {round(one.heave_m, 2): (one.stamp_ns - NOW_NS) // S for one in found}  # type: ignore[union-attr]
    assert stamps == {0.0: 1, 0.1: 2, 0.2: 3, 0.4: 4}, "3 arrived together with 4"
    assert instrument.counts.refused == {LATE: 1}
    assert (instrument.counts.lines, instrument.counts.accepted) == (5, 4)


ANGLE = st.floats(-30.0, 30.0)


@pytest.mark.parametrize("name", MOTIONS)
@given(heave_m=st.floats(-9.9, 9.9), rate=st.floats(-5.0, 5.0), roll=ANGLE, pitch=ANGLE,
       heading=st.floats(0.0, 359.9))  # fmt: skip
def test_what_a_sensor_writes_is_read_back(
    name: str, heave_m: float, rate: float, roll: float, pitch: float, heading: float
) -> None:
    made = settings(name)
    sample = MotionSample(NOW_NS, heave_m, rate, math.radians(roll), math.radians(pitch), heading)
    found, refused = read(writer(made)(sample), made)
    assert not refused
    assert found is not None
    assert found.heave_m == pytest.approx(heave_m, abs=0.0051)
    assert math.degrees(found.roll_rad) == pytest.approx(roll, abs=0.0051)
    assert math.degrees(found.pitch_rad) == pytest.approx(pitch, abs=0.0051)
    if not math.isnan(found.heave_rate_m_per_s):
        assert found.heave_rate_m_per_s == pytest.approx(rate, abs=0.0011)
    if not math.isnan(found.heading_deg):
        assert found.heading_deg == pytest.approx(heading, abs=0.0051)
