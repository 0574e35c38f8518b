"""The live error band: the companion, the rules from its difference to a bound, and the bound held.

All shipped scenes, against references on four times the elements: `pytest -m long -k band`, ten
minutes.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.records import Channel
from scipy.interpolate import CubicHermiteSpline

from benchmarks import band
from benchmarks.band import BandCase
from rope_twin.core import state as rows
from rope_twin.messages import decode, read_cloud, statuses
from rope_twin.recording.mcap_scan import McapScan, StoredMessage
from rope_twin.run.options import RunOptions
from rope_twin.run.unpaced import UnpacedRun, run_unpaced
from rope_twin.scene.load import load_scene
from rope_twin.scene.model.rope import build
from rope_twin.studies.driven_twin import march, variant
from rope_twin.twin.accuracy import error_interval
from rope_twin.twin.accuracy.error_bound import (
    ErrorBound,
    Recent,
    acceleration_jumps,
    border_before,
)
from rope_twin.twin.accuracy.error_interval import ErrorIntervalTwin
from rope_twin.twin.kinds import twin_class
from rope_twin.twin.snapshot import Snapshot
from rope_twin.twin.twin import Twin
from validation.rigs import Rig, sine

RIG = Rig(length=500.0, elements=20, damping=2e5, ramp=4.0, drag=(1.2, 0.01), density=1025.0,
          current=((0.0, (0.4, 0.1)),))  # fmt: skip
HEAVE = sine(1.0, 7.0)


def tensions(twin: Twin, seconds: float = 8.0) -> list[float]:
    return [shot.tension_top_n for shot in march(twin, HEAVE, seconds, 2)]


def test_the_run_is_the_same_to_the_bit_with_a_band_and_with_a_balance_beside_it() -> None:
    alone = tensions(RIG.twin())
    assert tensions(ErrorIntervalTwin(RIG.scene())) == alone
    assert tensions(twin_class(energy=True, error_band=True)(RIG.scene())) == alone


def test_a_run_that_asks_for_no_band_has_none() -> None:
    assert twin_class(energy=False, error_band=False) is Twin
    assert RIG.twin().snapshot().band is None


@pytest.mark.parametrize("every", [2, 3])
def test_the_companion_is_the_rope_of_half_the_elements_and_twice_the_step(every: int) -> None:
    """Its tension is that of a twin of such a scene, which gets the same heave by itself."""
    twin = ErrorIntervalTwin(RIG.scene())
    followed: list[float] = []
    follow = twin._coarse.follow

    def keep(*given: object) -> list[float] | None:
        found = follow(*given)  # type: ignore[arg-type]
        followed.extend(found or [])
        return found

    twin._coarse.follow = keep  # type: ignore[method-assign]
    for _ in march(twin, HEAVE, 6.0, every):
        pass
    other = Twin(variant(RIG.scene(), 10, 0.02))
    alone = [shot.tension_top_n for shot in march(other, HEAVE, 6.0)]
    assert len(followed) == len(alone) == 300
    assert np.allclose(followed, alone, rtol=1e-9)


@given(st.lists(st.tuples(st.floats(0.001, 0.4), st.floats(0.0, 1e6)), min_size=1, max_size=60))
def test_the_largest_of_a_window_is_the_largest_of_its_samples(
    samples: list[tuple[float, float]],
) -> None:
    recent, told, now = Recent(0.5), [], 0.0
    for step, value in samples:
        now += step
        recent.take(now, value)
        told.append((now, value))
        assert recent.largest(now) == max(v for at, v in told if at > now - 0.5)


@given(st.lists(st.floats(-5.0, 5.0), min_size=32, max_size=32))
def test_accelerations_jump_by_what_the_prescribed_cubics_do(given: list[float]) -> None:
    """Of the hang-off in three directions and of the line out, value and rate at four borders."""
    h = 0.1
    value, rate = np.array(given).reshape(2, 4, rows.MOTIONS)
    before = value[0].tolist(), rate[0].tolist()
    found = acceleration_jumps(before, value[1:], rate[1:], h)
    pieces = [CubicHermiteSpline(h * np.arange(4), value[:, k], rate[:, k]) for k in range(4)]
    for border, jump in enumerate(found, start=1):
        ends = [
            abs(
                2.0 * piece.c[1, border]
                - 2.0 * piece.c[1, border - 1]
                - 6.0 * h * piece.c[0, border - 1]
            )
            for piece in pieces
        ]
        assert jump == pytest.approx(sum(ends), rel=1e-9, abs=1e-9)


def test_a_motion_that_starts_to_accelerate_jumps_at_its_first_border() -> None:
    """A steady rate before; the hang-off then follows ½·a·t²."""
    h, a = 0.01, 0.8
    t = h * np.arange(4)
    value, rate = np.zeros((4, rows.MOTIONS)), np.zeros((4, rows.MOTIONS))
    value[:, rows.Z], rate[:, rows.Z] = 0.3 * t + 0.5 * a * t**2, 0.3 + a * t
    before = border_before(value[0], rate[0], h)
    assert acceleration_jumps(before, value, rate, h) == pytest.approx([a, 0.0, 0.0], abs=1e-8)


STILL = 0.0  # the motion's acceleration does not jump


def test_a_smooth_difference_is_divided_by_nearly_three_and_a_rough_one_is_not() -> None:
    smooth, rough, loose, looser = (ErrorBound(100e3, 0.01) for _ in range(4))
    for one, tension in ((smooth, 90e3), (rough, 90e3), (loose, 1500.0), (looser, 5.0)):
        one.take(1.0, STILL, tension)
        one.compare(1.0, 300.0)
    rough.slacken(1.0)
    assert 100.0 < smooth.bound_n(1.0) < 150.0
    assert rough.bound_n(1.0) > 300.0
    assert loose.bound_n(1.0) == 1500.0  # a rope in loops: as wrong as it is tense
    assert looser.bound_n(1.0) == 1000.0  # ... and a hundredth of what it is at rest


def test_the_first_step_after_a_bend_in_the_motion_has_a_larger_bound() -> None:
    """And what the companion says over the bend does not count for the steps after that."""
    found = ErrorBound(100e3, 0.01)
    for k in range(1, 41):
        bend = 1.0 if k % 5 == 0 else 0.0
        found.take(0.01 * k, bend, 90e3)
        if k % 2 == 0:
            over = any((k - back) % 5 == 0 for back in range(2))
            found.compare(0.01 * k, 30.0 if over else 3.0)
        if k > 20:
            expected = 0.85 * 30.0 if bend else max(0.37 * 3.0, 0.13 * 30.0)
            assert found.bound_n(0.01 * k) == pytest.approx(expected)


def fed_with(found: ErrorBound, differences: Iterable[float], from_s: float = 0.0) -> float:
    """A companion's differences, one every 20 ms; the time of the last."""
    now = from_s
    for difference in differences:
        now += 0.02
        found.take(now - 0.01, STILL, 90e3)
        found.take(now, STILL, 90e3)
        found.compare(now, difference)
    return now


def ringing(amplitude: float, seconds: float) -> list[float]:
    """Magnitudes of a sine of 1 Hz, every 20 ms."""
    return [abs(amplitude * math.sin(2.0 * math.pi * 0.02 * k)) for k in range(int(50 * seconds))]


def test_what_rang_is_not_forgotten_sooner_than_a_rope_stops_ringing() -> None:
    """The companion happens to ring alike, and the difference is gone at once."""
    found = ErrorBound(100e3, 0.01)
    now = fed_with(found, ringing(10.0, 30.0))
    before = found.bound_n(now)
    assert before == pytest.approx(0.43 * 10.0, rel=0.05)
    now = fed_with(found, [0.0] * 550, now)
    assert found.bound_n(now) == pytest.approx(before / math.e, rel=0.1)


def test_a_hard_event_widens_the_band_but_by_no_more_than_half_of_what_rings() -> None:
    soft, hard = (ErrorBound(100e3, 0.01) for _ in range(2))
    now = max(fed_with(found, ringing(10.0, 30.0)) for found in (soft, hard))
    before = soft.bound_n(now)
    soft.kick(now, 0.1)
    hard.kick(now, 100.0)
    assert soft.bound_n(now) == pytest.approx(before + 0.6)
    assert hard.bound_n(now) == pytest.approx(before + 0.5 * 10.0, rel=0.1)


def test_a_rope_that_stays_taut_after_a_snap_rings_on() -> None:
    found = ErrorBound(100e3, 0.01)
    found.slacken(0.0)
    now = fed_with(found, ringing(10.0, 2.0))
    assert found.bound_n(now) <= 1.14 * 10.0
    now = fed_with(found, [0.0] * 25, now)
    assert found.bound_n(now) == 0.0  # may snap again at once: what is left tells nothing
    now = fed_with(found, [0.0] * 25, now)
    assert found.bound_n(now) > 1.0


def test_a_payload_on_the_bed_makes_the_error_rough() -> None:
    rope = build(load_scene("landing"))
    rope.state.nodes[rows.POSITION + 2, :] = -100.0
    bed = error_interval.bed_below(rope)
    assert bed is not None
    assert not error_interval.touches(bed, rope)
    rope.state.nodes[rows.POSITION + 2, 0] = -401.0  # the bed lies at 400 m
    assert error_interval.touches(bed, rope)
    found = ErrorBound(100e3, 0.01)
    found.touch(0.0)
    assert found.bound_n(fed_with(found, [100.0])) == pytest.approx(114.0)


def test_what_loops_on_the_bed_are_wrong_by_counts_for_some_seconds() -> None:
    """While the payload stands there; after that, and where nothing stood, for 0.4 s."""
    stood, slack = ErrorBound(100e3, 0.01), ErrorBound(100e3, 0.01)
    stood.touch(0.0)
    slack.slacken(0.0)
    for found in (stood, slack):
        fed_with(found, [100.0] + [1.0] * 100)
    assert stood.bound_n(2.02) == pytest.approx(114.0)
    assert slack.bound_n(2.02) < 2.0
    assert stood.bound_n(3.0) < 100.0


def test_a_node_that_is_laid_down_counts_for_some_seconds() -> None:
    """Of a rope whose end is made fast on the bed; that end does not land."""
    twin = ErrorIntervalTwin(load_scene("chain_on_bottom"))
    band_, bed = twin._band, error_interval.bed_below(twin._rope)
    assert bed is not None
    lying = error_interval.nodes_on(bed, twin._rope)
    assert 10 < lying < 20  # 62 m on elements of 5 m
    twin._look_at_bed(bed, 1.0)
    now = fed_with(band_, [100.0])
    assert band_.bound_n(now) < 50.0
    twin._rope.state.nodes[rows.POSITION + 2, lying] = -301.0
    twin._look_at_bed(bed, now)
    assert band_.bound_n(now) == pytest.approx(114.0)
    assert band_.bound_n(now + 2.9) < 114.0  # nothing is left of the difference
    now = fed_with(band_, [100.0] * 2, now + 3.1)
    assert band_.bound_n(now) < 50.0


def test_a_restored_twin_knows_its_band_when_the_companion_has_settled() -> None:
    twin = ErrorIntervalTwin(RIG.scene())
    tensions(twin, 4.0)
    again = ErrorIntervalTwin.restore(twin.capture(), RIG.scene())
    known = [shot for shot in march(again, HEAVE, 25.0, 2) if shot.band is not None]
    first = known[0].time_s - 4.0
    assert first == pytest.approx(error_interval.SETTLING_S, abs=0.03)
    assert list(march(twin, HEAVE, 25.0, 2))[-1].tension_top_n == known[-1].tension_top_n


def test_a_companion_that_fails_is_replaced_and_the_band_unknown_until_it_has_settled() -> None:
    twin = ErrorIntervalTwin(RIG.scene())
    shots = list(march(twin, HEAVE, 1.0, 2))
    assert shots[-1].band is not None
    twin._coarse._rope.state.nodes[rows.POSITION, 3] = np.nan
    shots = list(march(twin, HEAVE, 22.0, 2))
    assert shots[0].band is None
    assert shots[-1].band is not None
    assert np.isfinite(shots[-1].band.bound_n)


def test_a_run_with_a_band_publishes_records_and_sums_it_up(tmp_path: Path) -> None:
    options = RunOptions(
        scene="shallow_lift", end_s=2.0, speed=0.0, record=tmp_path / "bag", error_band=True
    )
    shots: list[Snapshot] = []
    summary = run_unpaced(options, lambda run: shots.append(run.last))
    assert summary.error_band is not None
    assert "error interval (95 %): top tension now" in summary.as_text()
    assert shots[-1].band is not None
    assert summary.error_band["bound_n"] == shots[-1].band.bound_n
    edges = recorded_edges(tmp_path / "bag")
    assert len(edges) == len(shots) == 100
    for (low, high), shot in zip(edges, shots, strict=True):
        assert low < shot.tension_top_n < high
    assert [row for row in statuses(shots[-1], None) if row.name == "simulation: error band"]


def test_a_bag_without_a_band_holds_no_message_of_it(tmp_path: Path) -> None:
    run = UnpacedRun(
        RunOptions(scene="shallow_lift", end_s=0.1, speed=0.0, record=tmp_path / "bag")
    )
    run.advance_slot()
    run.close()
    assert recorded_edges(tmp_path / "bag") == []


def recorded_edges(bag: Path) -> list[tuple[float, float]]:
    """Low and high of every band in a bag."""
    edges, names = [], {}
    (file,) = bag.glob("*.mcap")
    for record in McapScan(file).records():
        if isinstance(record, Channel):
            names[record.id] = record.topic
        elif isinstance(record, StoredMessage) and names[record.channel_id].endswith(
            "ropes/tension_top_error"
        ):
            message = decode("ropes/tension_top_error", record.data)
            row = read_cloud(message)[0]
            edges.append((float(row["lower_n"]), float(row["upper_n"])))
    return [edge for edge in edges if np.isfinite(edge).all()]


@pytest.mark.long
@pytest.mark.parametrize("case", band.QUICK[1:], ids=str)
def test_the_error_lies_under_the_bound_in_more_scenes(case: BandCase) -> None:
    test_the_error_lies_under_the_bound_and_the_bound_is_near(case)


@pytest.mark.parametrize("case", band.QUICK[:1], ids=str)
def test_the_error_lies_under_the_bound_and_the_bound_is_near(case: BandCase) -> None:
    """A taut rope whose winch works, and one that goes slack and snaps."""
    (row,) = band.measure_bands([case], lambda *_: None)
    assert row.held_pct >= 95.0
    assert row.ratio <= 5.0
    assert row.doubt_n < row.error_n


@pytest.mark.long
@pytest.mark.parametrize("case", band.FULL, ids=str)
def test_in_every_scene_the_error_lies_under_the_bound(case: BandCase) -> None:
    """`pytest -m long -k band`: 95 % of the time (docs/error_interval.md)."""
    (row,) = band.measure_bands([case], lambda *_: None)
    assert row.held_pct >= 95.0
    assert row.ratio <= 5.0
