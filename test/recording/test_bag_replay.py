"""Replay of heave: exact stamps, offsets, loops with and without a seam, what a bag must tell."""

import itertools
import shutil

import numpy as np
import pytest
from bag_samples import START_NS, STEP_NS, swell, write_heave
from hypothesis import given, settings
from hypothesis import strategies as st
from rosbags.rosbag2 import StoragePlugin, Writer

from rope_twin.errors import BagError
from rope_twin.files import share_dir
from rope_twin.messages import encode_heave
from rope_twin.messages.cdr import typestore
from rope_twin.recording.bag import list_bags
from rope_twin.recording.heave import HeaveRecord, HeaveReplay, open_heave, read_heave, replay_sea
from rope_twin.sea.ship_motion import BoxHull
from rope_twin.sea.spectrum import jonswap, read_spectrum
from rope_twin.twin.motion.ship_motion import synthesise

SECOND = 1_000_000_000


@pytest.fixture(scope="module")
def record() -> HeaveRecord:
    return read_heave(list_bags()["sea_2p5m"])


@pytest.fixture(scope="module")
def sea() -> HeaveReplay:
    return open_heave("sea_2p5m")


@pytest.fixture(scope="module")
def faded(tmp_path_factory) -> HeaveReplay:
    """61.3 s of a swell of 8 s: its end does not join its beginning."""
    return open_heave(write_heave(tmp_path_factory.mktemp("bags") / "cut", swell(1226)))


def test_replay_gives_the_bag_as_it_is(sea):
    assert sea.note == ""
    assert "skipped" not in sea.note
    assert sea.loop_ns == 1200 * SECOND
    first = sea.between(0, 1)
    assert [sample.stamp_ns for sample in first] == [0]
    day = sea.between(0, 1200 * SECOND)
    assert [sample.stamp_ns for sample in day] == list(range(0, 1200 * SECOND, STEP_NS))


@settings(max_examples=50, deadline=None)
@given(st.data())
def test_pieces_of_time_join_without_gap_or_repeat_across_loops(sea, data):
    low = data.draw(st.integers(-1300 * SECOND, 3600 * SECOND))
    cuts = data.draw(st.lists(st.integers(low, low + 3 * SECOND), max_size=8))
    border = data.draw(st.integers(-1, 3)) * 1200 * SECOND + data.draw(st.integers(-3, 3))
    for start, inner in ((low, cuts), (border - SECOND, [border - 1, border, border + 1])):
        edges = sorted([start, *inner, start + 3 * SECOND])
        pieces = [sea.between(a, b) for a, b in itertools.pairwise(edges)]
        joined = [sample for piece in pieces for sample in piece]
        assert joined == sea.between(edges[0], edges[-1])
        stamps = [sample.stamp_ns for sample in joined]
        assert stamps == list(range(-(-start // STEP_NS) * STEP_NS, edges[-1], STEP_NS))


def test_a_lap_later_the_sea_is_the_same_one(sea):
    here, there = sea.between(0, 5 * SECOND), sea.between(2400 * SECOND, 2405 * SECOND)
    assert [s.position_m for s in here] == [s.position_m for s in there]
    assert [s.elevation_m for s in here] == [s.elevation_m for s in there]


@given(steps=st.integers(0, 23_999))
@settings(max_examples=30, deadline=None)
def test_an_offset_shifts_the_record_and_nothing_else(record, sea, steps):
    late = HeaveReplay(record, start_s=steps * 0.05)
    shift = steps * STEP_NS
    for one, other in zip(
        late.between(-SECOND, SECOND), sea.between(shift - SECOND, shift + SECOND), strict=True
    ):
        assert one.stamp_ns == other.stamp_ns - shift
        assert one.position_m == other.position_m


def test_velocity_and_position_agree_over_the_border(sea):
    samples = sea.between(1195 * SECOND, 1205 * SECOND)
    z, v = (np.array([getattr(s, n) for s in samples]) for n in ("position_m", "velocity_m_per_s"))
    jump = np.diff(z) - 0.025 * (v[1:] + v[:-1])
    assert np.max(np.abs(jump)) < 3e-4  # rounding of the bag and the trapezoid


def test_elevation_comes_with_each_sample_though_recorded_at_4_hz(sea):
    made = synthesise_like_the_bag()
    found = np.array([sample.elevation_m for sample in sea.between(0, 1200 * SECOND)])
    assert np.max(np.abs(found - made)) < 0.02  # of a sea of Hs 2.5 m


def synthesise_like_the_bag():
    spectrum = read_spectrum("ndbc_46042_1996", "1996-10-16T00Z")
    return synthesise(spectrum, BoxHull(), 25).elevation_m


def test_without_loop_the_samples_end():
    once = open_heave("sea_1p2m", loop=False, start_s=1190.0)
    assert once.loop_ns is None
    assert len(once.between(0, 60 * SECOND)) == 200
    assert once.between(10 * SECOND, 60 * SECOND) == []
    assert once.between(-2000 * SECOND, -1190 * SECOND) == []
    assert len(once.between(-1190 * SECOND, 0)) == 23_800


def test_a_seam_is_faded_and_reported(faded):
    assert faded.loop_ns == pytest.approx(51.3 * SECOND)
    assert "it lasts 61.3 s and is repeated; its end does not join its beginning" in faded.note
    assert "the last 10 s of each pass fade" in faded.note
    samples = faded.between(0, 300 * SECOND)
    stamps = np.array([s.stamp_ns for s in samples])
    assert set(np.diff(stamps)) == {STEP_NS}
    z, v = (np.array([getattr(s, n) for s in samples]) for n in ("position_m", "velocity_m_per_s"))
    jump = np.diff(z) - 0.025 * (v[1:] + v[:-1])
    assert np.max(np.abs(jump)) < 1e-4
    assert np.max(np.abs(np.diff(v))) < 0.08
    # the first pass is the record, and so is each later one after its first 10 s
    omega = 2 * np.pi / 8.0
    assert z[:1026] == pytest.approx(np.sin(omega * stamps[:1026] * 1e-9), abs=1e-9)
    later = slice(1026 + 200, 2 * 1026)
    again = np.sin(omega * (stamps[later] * 1e-9 - 51.3))
    assert z[later] == pytest.approx(again, abs=1e-9)


@settings(max_examples=30, deadline=None)
@given(cuts=st.lists(st.integers(0, 200 * SECOND), min_size=2, max_size=10))
def test_faded_loops_have_no_gap_or_repeat_either(faded, cuts):
    cuts = sorted([0, *cuts])
    joined = [s for a, b in itertools.pairwise(cuts) for s in faded.between(a, b)]
    assert [s.stamp_ns for s in joined] == list(range(0, cuts[-1], STEP_NS))


def test_a_whole_number_of_waves_needs_no_fade(tmp_path):
    replay = open_heave(write_heave(tmp_path / "whole", swell(1280)))  # 8 waves of 8 s
    assert replay.note == ""
    assert replay.loop_ns == 64 * SECOND


@pytest.mark.parametrize("count", [2, 3, 5, 60])
def test_short_records_loop_without_gap_too(tmp_path, count):
    replay = open_heave(write_heave(tmp_path / "short", swell(count)))
    stamps = [s.stamp_ns for s in replay.between(0, 20 * SECOND)]
    assert stamps == list(range(0, 20 * SECOND, STEP_NS))


def test_synthesised_sea_replays_as_it_is():
    made = synthesise(jonswap(2.0, 9.0), BoxHull(), seed=1, duration_s=120.0, rate_hz=30.0)
    replay = replay_sea(made)
    samples = replay.between(0, 240 * SECOND)
    assert replay.note == ""
    assert len(samples) == 7200
    assert [s.position_m for s in samples[3600:]] == list(made.heave_m)
    assert [s.elevation_m for s in samples[:3600]] == pytest.approx(list(made.elevation_m))
    assert samples[1].stamp_ns == 33_333_333


@pytest.mark.parametrize("start_s", [-0.1, 1200.0, float("nan"), float("inf")])
def test_a_start_outside_of_the_bag_is_refused(start_s):
    with pytest.raises(BagError, match="right is 0 to less than 1200 s"):
        open_heave("sea_1p2m", start_s=start_s)


def test_a_bare_file_and_a_named_topic_and_a_namespace_open(tmp_path):
    assert open_heave(share_dir() / "bags" / "sea_1p2m" / "sea_1p2m_0.mcap").loop_ns
    for name in ("rig/ship/heave", "mru"):
        bag = write_heave(tmp_path / name.replace("/", "_"), swell(1280), name=name)
        for topic in (None, name, f"/{name}"):
            assert "skipped" not in open_heave(bag, topic=topic).note


def test_bags_of_others_open_sqlite_too(tmp_path):
    with Writer(tmp_path / "lite", version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        connection = writer.add_connection(
            "/mru/odometry", "nav_msgs/msg/Odometry", typestore=typestore()
        )
        for stamp_ns, z, v in swell(1280):
            stamp_ns += START_NS
            writer.write(connection, stamp_ns, encode_heave(stamp_ns, z, v))
    assert open_heave(tmp_path / "lite").loop_ns == 64 * SECOND


def test_a_bag_that_was_written_again_is_read_again(tmp_path):
    first = open_heave(write_heave(tmp_path / "again", swell(1226)))
    assert open_heave(tmp_path / "again").loop_ns == first.loop_ns
    shutil.rmtree(tmp_path / "again")
    later = open_heave(write_heave(tmp_path / "again", swell(1400)))
    assert later.loop_ns > first.loop_ns


def test_headers_without_stamps_take_the_times_of_the_log(tmp_path):
    rows = [(-START_NS, z, v) for _, z, v in swell(1280)]
    replay = open_heave(write_heave(tmp_path / "bare", rows))
    assert "times are those of the log" in replay.note
    assert [s.stamp_ns for s in replay.between(0, SECOND)] == list(range(0, SECOND, STEP_NS))


def test_a_missing_rate_is_derived_and_reported(tmp_path):
    rows = [(t, z, 0.0) for t, z, _ in swell(1280)]
    replay = open_heave(write_heave(tmp_path / "bare", rows))
    assert "twist.linear.z is zero throughout, the rate is derived" in replay.note
    found = [s.velocity_m_per_s for s in replay.between(SECOND, 9 * SECOND)]
    assert found == pytest.approx([v for _, _, v in swell(180)[20:]], abs=1e-3)


def test_a_still_ship_is_no_fault(tmp_path):
    replay = open_heave(
        write_heave(tmp_path / "still", [(k * STEP_NS, 0.0, 0.0) for k in range(9)])
    )
    assert replay.note == ""
    assert all(s.position_m == 0.0 for s in replay.between(0, 10 * SECOND))


@pytest.mark.parametrize(("scale", "off"), [(100.0, 0.0), (1.0, 35.0)])
def test_heave_in_centimetres_or_above_a_datum_is_refused(tmp_path, scale, off):
    """A twin refused each sample, and the ship lay still without a word."""
    rows = [(t, scale * z + off, scale * v) for t, z, v in swell()]
    with pytest.raises(BagError, match=r"beyond the ±30 m about its rest and ±15 m/s"):
        open_heave(write_heave(tmp_path / "far", rows))


def test_heave_off_its_rest_and_scarce_samples_are_reported(tmp_path):
    rows = [(t, z + 12.0, v) for t, z, v in swell(480)]  # three whole waves
    note = open_heave(write_heave(tmp_path / "off", rows)).note
    assert "its mean is 12.00 m; heave counts from the rest" in note
    scarce = open_heave(write_heave(tmp_path / "scarce", swell(step_ns=2 * SECOND))).note
    assert "a sample every 2 s, and the motion between them is assumed" in scarce
    usual = open_heave(write_heave(tmp_path / "usual", swell())).note
    assert "mean" not in usual
    assert "assumed" not in usual


def test_few_bad_samples_are_skipped_counted_and_reported(tmp_path):
    rows = swell(1280)
    rows[100] = (rows[100][0], float("nan"), 0.0)
    rows[101] = (rows[101][0], 0.0, float("inf"))
    rows[200] = (rows[199][0], 5.0, 0.0)
    rows[300] = (rows[290][0], 5.0, 0.0)
    rows[50] = (-START_NS, 5.0, 0.0)
    replay = open_heave(write_heave(tmp_path / "few", rows))
    reported = (
        "2 not finite, 1 without a stamp, 1 with a repeated stamp, 1 with a stamp that goes back"
    )
    assert f"skipped 5 of 1280 samples ({reported})" in replay.note
    samples = replay.between(0, 64 * SECOND)
    assert len(samples) == 1275
    assert max(abs(s.position_m) for s in samples) <= 1.0


def test_gaps_are_reported(tmp_path):
    rows = swell(1280)
    del rows[400:460]
    replay = open_heave(write_heave(tmp_path / "gap", rows))
    assert "gaps in time: 1, the longest 3.05 s at 19.950 s" in replay.note
