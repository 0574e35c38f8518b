"""From bytes to samples: repeated, late and cut lines, holes, and the rates of a motion."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from feed_samples import DATA, SAMPLES, settings

from rope_twin.feeds.instrument import Instrument, LineSample, MotionSample
from rope_twin.feeds.motion_track import HeaveOutput, MotionTrack, motion_of_pose
from rope_twin.feeds.readings import DUPLICATE, LATE, LENGTH, ORDER, TIME, nmea, xor_of
from rope_twin.feeds.writers import writer
from rope_twin.twin.motion.ship_motion import (
    ShipPose,
    pose_fault,
    sea_velocity,
    turn_between,
    turned,
)

S = 1_000_000_000
NAN = math.nan


def lines_of(count: int, period_ns: int = S // 20, **more: object) -> list[tuple[bytes, int]]:
    """Lines of an LCI-90i at 20 Hz, and the times of their arrival."""
    write = writer(settings("lci90", **more))
    return [
        (write(LineSample(k * period_ns, 1e4, 0.5, 0.025 * k, NAN)), k * period_ns)
        for k in range(1, count + 1)
    ]


def test_a_repeated_line_counts_once() -> None:
    instrument = Instrument(settings("lci90"))
    for line, at_ns in lines_of(10):
        assert len(instrument.take(line, at_ns, is_complete=True)) == 1
        assert not instrument.take(line, at_ns + 30_000_000, is_complete=True)
    assert instrument.counts.refused == {DUPLICATE: 10}


def test_a_sensor_at_rest_is_no_duplicate() -> None:
    """Equal lines without a time count, but not within two milliseconds, as by two routes."""
    instrument = Instrument(settings("tss1"))
    for k in range(10):
        assert instrument.take(SAMPLES["tss1"], k * S // 10, is_complete=True)
        assert not instrument.take(SAMPLES["tss1"], k * S // 10 + 1_000_000, is_complete=True)
    assert instrument.counts.refused == {DUPLICATE: 10}


def test_a_late_line_is_refused_by_the_instrument_s_time() -> None:
    instrument = Instrument(settings("lci90", stamp="instrument"))
    lines = lines_of(20)
    lines[5], lines[6] = lines[6], lines[5]
    found = [one for line, at_ns in lines for one in instrument.take(line, at_ns)]
    assert instrument.counts.refused == {ORDER: 1}
    assert np.all(np.diff([one.stamp_ns for one in found]) > 0)


def test_a_clock_that_was_set_back_is_followed_after_ten_lines() -> None:
    instrument = Instrument(settings("lci90"))
    lines = lines_of(100)
    for k, (line, at_ns) in enumerate(lines):
        instrument.take(line, at_ns + 7200 * S if k < 50 else at_ns + 3600 * S)
    assert instrument.counts.refused == {ORDER: 9}
    assert instrument.counts.accepted == 91


def test_a_clock_that_stands_still_gives_one_reading() -> None:
    instrument = Instrument(settings("lci90", stamp="instrument"))
    write = writer(instrument.settings)
    for k in range(30):
        instrument.take(write(LineSample(S, 1e4, 0.5, float(k), NAN)), k * S // 20)
    assert instrument.counts.accepted == 1
    assert instrument.counts.refused == {ORDER: 29}


@pytest.mark.parametrize("year", [1969, 2038])
def test_a_time_that_no_ros_stamp_can_have_is_refused(year: int) -> None:
    instrument = Instrument(settings("wir", stamp="instrument", checksum="none"))
    line = SAMPLES["wir"].replace(b"2024-05-01", f"{year}-05-01".encode())
    assert not instrument.take(line, S)
    assert instrument.counts.refused == {TIME: 1}
    assert instrument.take(SAMPLES["wir"], S)


def test_of_lines_that_arrive_at_once_the_last_counts() -> None:
    instrument = Instrument(settings("lci90"))
    lines = lines_of(3)
    (found,) = instrument.take(b"".join(line for line, _ in lines), S)
    assert isinstance(found, LineSample)
    assert found.payout_m == pytest.approx(0.075, abs=1e-3)
    assert instrument.counts.refused == {LATE: 2}
    assert instrument.counts.accepted == 1
    own = Instrument(settings("lci90", stamp="instrument"))
    assert len(own.take(b"".join(line for line, _ in lines), S)) == 3


@pytest.mark.parametrize("size", [1, 7, 64])
def test_a_stream_is_cut_at_any_byte(size: int) -> None:
    instrument = Instrument(settings("lci90", stamp="instrument"))
    stream = b"".join(line for line, _ in lines_of(50))
    found = []
    for at in range(0, len(stream), size):
        found += instrument.take(stream[at : at + size], S)
    assert len(found) == 50


def test_noise_without_an_end_of_line_is_dropped() -> None:
    instrument = Instrument(settings("lci90"))
    instrument.take(b"\x80" * 100_000, S)
    (line, at_ns), *_ = lines_of(1)
    assert not instrument.counts.accepted
    assert instrument.counts.refused == {LENGTH: 1}
    assert instrument.take(b"\n" + line, at_ns)


def test_a_tag_block_is_checked_and_left_out() -> None:
    body = "s:YY0001,n:12"
    instrument = Instrument(settings("psxn"))
    tagged = f"UdPbC\0\\{body}*{xor_of(body):02X}\\".encode() + SAMPLES["psxn"]
    assert instrument.take(tagged, S, is_complete=True)
    assert not instrument.take(tagged.replace(b"n:12", b"n:13"), 2 * S, is_complete=True)
    assert instrument.counts.refused == {"checksum": 1}


def test_a_hole_in_a_record_is_missing_data() -> None:
    """19 s of a real record: nothing is made up inside, and it is counted."""
    made = settings("lci90")
    instrument = Instrument(made)
    stamps = []
    for line in (DATA / "cwnc.txt").read_bytes().splitlines():
        stamp, _, telegram = line.partition(b" ")
        at_ns = int(np.datetime64(stamp.rstrip(b"Z").decode(), "ns").astype(np.int64))
        stamps += [one.stamp_ns for one in instrument.take(telegram, at_ns, is_complete=True)]
    assert len(stamps) == 300
    assert instrument.counts.holes == 1
    assert instrument.counts.longest_hole_s == pytest.approx(18.973, abs=1e-3)


OMEGA, HEAVE_M = 2.0 * math.pi / 8.0, 1.5


def motion(time_s: float, rate: bool = False) -> MotionSample:
    """A regular motion of a ship that turns about all axes, bow at 30° at rest."""
    phase = OMEGA * time_s
    heave, own = HEAVE_M * math.sin(phase), HEAVE_M * OMEGA * math.cos(phase)
    return MotionSample(
        round(time_s * 1e9), heave, own if rate else NAN, 0.1 * math.sin(phase + 1.0),
        0.05 * math.cos(phase), (30.0 + 4.0 * math.sin(phase)) % 360.0,
    )  # fmt: skip


def test_a_rate_that_the_sensor_gives_is_passed_on_at_once() -> None:
    track = MotionTrack(settings("smc"))
    given = motion(1.0, rate=True)
    assert track.take(given) == [HeaveOutput(S, given.heave_m, given.heave_rate_m_per_s)]


def test_a_derived_rate_is_of_second_order() -> None:
    """Its error is that of the parabola, ω³·h²/6 of the amplitude, and falls by four with h/2."""
    errors = []
    for period_s in (0.1, 0.05):
        track, worst = MotionTrack(settings("tss1")), 0.0
        for k in range(round(8.0 / period_s)):
            for found in track.take(motion(k * period_s)):
                assert isinstance(found, HeaveOutput)
                wanted = motion(found.stamp_ns * 1e-9, rate=True)
                assert found.heave_m == pytest.approx(wanted.heave_m, abs=1e-12)
                worst = max(worst, abs(found.heave_rate_m_per_s - wanted.heave_rate_m_per_s))
        assert worst == pytest.approx(HEAVE_M * OMEGA**3 * period_s**2 / 6.0, rel=0.01)
        errors.append(worst)
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.01)


@pytest.mark.parametrize("rate", [False, True])
def test_a_fit_keeps_the_wave_and_takes_the_rounding(rate: bool) -> None:
    """A cubic over 0.5 s of heave to 1 cm at 50 Hz, in a wave of 2π/ω = 8 s.

    The wave keeps 1 - x⁴/280 of its height and 1 - x⁴/504 of its rate, x = ω·T/2; rounding leaves
    at most 1.5/√25 of its standard deviation where it is white, and a tenth from sample to sample.
    """
    track, outputs = MotionTrack(settings("tss1", fit_samples=25)), []
    for k in range(3000):
        exact = motion(0.02 * k, rate=rate)
        outputs += track.take(replace(exact, heave_m=round(exact.heave_m, 2)))
    assert len(outputs) == 3000 - 24, "half of the fit is missing at both ends"
    found = np.array([(one.heave_m, one.heave_rate_m_per_s) for one in outputs])
    exact = [motion(one.stamp_ns * 1e-9, rate=True) for one in outputs]
    wanted = np.array([(one.heave_m, one.heave_rate_m_per_s) for one in exact])
    off = found - wanted
    white_m = 0.01 / math.sqrt(12.0)
    assert off[:, 0].std() < 0.5 * white_m
    assert np.diff(off[:, 0]).std() < 0.1 * math.sqrt(2.0) * white_m
    assert off[:, 1].std() < (1e-12 if rate else 0.02)
    lost = 1.0 - (found[:, 0] @ wanted[:, 0]) / (wanted[:, 0] @ wanted[:, 0])
    assert abs(lost - (OMEGA * 0.25) ** 4 / 280.0) < 1e-3


def test_a_fit_of_line_monitors_or_of_an_even_number_is_refused() -> None:
    even = replace(settings("tss1"), fit_samples=24)
    assert even.check() == "fit_samples is 24; give an odd number"
    line = replace(settings("lci90"), fit_samples=25)
    assert line.check() == "fit_samples is of motion sensors; remove it"


def test_no_rate_is_derived_across_a_hole() -> None:
    track = MotionTrack(settings("tss1"))
    times = [*np.arange(0.0, 2.0, 0.1), *np.arange(21.0, 23.0, 0.1)]
    found = [one for t in times for one in track.take(motion(float(t)))]
    stamps = np.array([one.stamp_ns for one in found]) * 1e-9
    assert len(found) == 2 * (20 - 2), "the samples on both sides of the hole have no neighbours"
    assert not np.any((stamps > 1.85) & (stamps < 21.05))
    for one in found:
        assert isinstance(one, HeaveOutput)
        wanted = motion(one.stamp_ns * 1e-9, rate=True).heave_rate_m_per_s
        assert one.heave_rate_m_per_s == pytest.approx(wanted, abs=0.002)


def test_a_sample_that_was_held_up_on_its_way_makes_no_rate() -> None:
    """Every seventh arrives together with the next: by arrival the heave would jump in 1 ms."""
    track, found = MotionTrack(settings("tss1")), []
    for k in range(400):
        sample = motion(k * 0.05)
        if k % 7 == 6:
            sample = replace(sample, stamp_ns=sample.stamp_ns + 49_000_000)
        found += track.take(sample)
    outputs = [one for one in found if isinstance(one, HeaveOutput)]
    assert track.replaced == 400 // 7
    assert len(outputs) == 400 - 2 - track.replaced
    for one in outputs:
        wanted = motion(one.stamp_ns * 1e-9, rate=True).heave_rate_m_per_s
        assert one.heave_rate_m_per_s == pytest.approx(wanted, abs=0.005)


def poses() -> list[ShipPose]:
    track = MotionTrack(settings("tss1", heave_of="reference", rest_heading_deg=30.0))
    found = [one for k in range(200) for one in track.take(motion(k * 0.02))]
    return [one for one in found if isinstance(one, ShipPose)]


def test_poses_have_twists_that_agree_with_them() -> None:
    """The change of attitude is the integral of ω, within the input check of the simulation."""
    found = poses()
    assert len(found) == 198
    for before, after in pairwise(found):
        assert pose_fault(after) == ""
        turn = np.array(turn_between(before.orientation, after.orientation))
        mean = 0.5 * (np.array(before.rate_rad_per_s) + np.array(after.rate_rad_per_s))
        assert turn == pytest.approx(0.02 * mean, abs=2e-6)
        step_m = after.position_m[2] - before.position_m[2]
        mean_v = 0.5 * (sea_velocity(before)[2] + sea_velocity(after)[2])
        assert step_m == pytest.approx(0.02 * mean_v, abs=2e-5)


def test_a_pose_is_turned_back_into_the_sensor_s_angles() -> None:
    for pose in poses()[::20]:
        back, wanted = motion_of_pose(pose, 30.0), motion(pose.stamp_ns * 1e-9, rate=True)
        assert back.heave_rate_m_per_s == pytest.approx(wanted.heave_rate_m_per_s, abs=1e-3)
        assert back.heave_m == pytest.approx(wanted.heave_m, abs=1e-12)
        assert (back.roll_rad, back.pitch_rad) == pytest.approx(
            (wanted.roll_rad, wanted.pitch_rad), abs=1e-12
        )
        assert back.heading_deg == pytest.approx(wanted.heading_deg, abs=1e-9)


def test_port_up_lifts_a_point_to_port() -> None:
    """Bow to the north: port is west. Bow down lowers a point ahead."""
    track = MotionTrack(settings("tss1", heave_of="reference", rest_heading_deg=0.0))
    rolled = [MotionSample(k * S // 10, 0.0, NAN, 0.1, 0.0, NAN) for k in range(3)]
    pitched = [MotionSample(S + k * S // 10, 0.0, NAN, 0.0, 0.1, NAN) for k in range(3)]
    (found,) = (one for sample in rolled for one in track.take(sample))
    assert isinstance(found, ShipPose)
    assert turned(found.orientation, (-1.0, 0.0, 0.0))[2] == pytest.approx(math.sin(0.1))
    track = MotionTrack(settings("tss1", heave_of="reference", rest_heading_deg=0.0))
    (found,) = (one for sample in pitched for one in track.take(sample))
    assert isinstance(found, ShipPose)
    assert turned(found.orientation, (0.0, 1.0, 0.0))[2] == pytest.approx(-math.sin(0.1))


def test_heading_passes_north_without_a_turn() -> None:
    track = MotionTrack(settings("tss1", heave_of="reference", rest_heading_deg=0.0))
    outputs = [
        one
        for k in range(40)
        for one in track.take(
            MotionSample(k * S // 10, 0.0, NAN, 0.0, 0.0, (358.0 + 0.1 * k) % 360)
        )
    ]
    rates = [one.rate_rad_per_s[2] for one in outputs if isinstance(one, ShipPose)]
    assert rates == pytest.approx([-math.radians(1.0)] * 38, abs=1e-9), "clockwise is negative"


def test_nmea_makes_the_checksum_of_a_printed_line() -> None:
    assert nmea("PSXN,23,1.24,-2.35,218.66,0.15") == SAMPLES["psxn"]
