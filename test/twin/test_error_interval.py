"""Error interval of the top tension: its rule, when it is unknown, and where it is published."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.records import Channel

from benchmarks import error_interval as benchmark
from rope_twin.core import state as rows
from rope_twin.core.joined.joints import System
from rope_twin.messages import Encoder, decode, read_cloud, statuses
from rope_twin.recording.mcap_scan import McapScan, StoredMessage
from rope_twin.run.options import RunOptions
from rope_twin.run.unpaced import UnpacedRun, run_unpaced
from rope_twin.scene.joined_model import build_joined
from rope_twin.scene.load import load_scene
from rope_twin.scene.rigging import is_joined
from rope_twin.scene.rope_model import build
from rope_twin.studies.driven_twin import fed, march
from rope_twin.twin.error_interval import (
    SETTLING_S,
    ErrorInterval,
    WindowMaximum,
    stands_on_bed,
)
from rope_twin.twin.monitors import ERROR_INTERVAL, Monitors
from rope_twin.twin.snapshot import Snapshot, TensionInterval
from rope_twin.twin.twin import Twin
from validation.rigs import Rig, sine

RIG = Rig(length=500.0, elements=20, damping=2e5, ramp=4.0, drag=(1.2, 0.01), density=1025.0,
          current=((0.0, (0.4, 0.1)),))  # fmt: skip
HEAVE = sine(1.0, 7.0)


def interval_of(twin: Twin) -> ErrorInterval:
    monitor = twin.monitor(ErrorInterval)
    assert monitor is not None
    return monitor


def tensions(twin: Twin, seconds: float = 8.0) -> list[float]:
    return [snapshot.tension_top_n for snapshot in march(twin, HEAVE, seconds, 2)]


def pulls(snapshots: list[Snapshot]) -> list[list[float]]:
    return [[one.tension_top_n for one in snapshot.ropes] for snapshot in snapshots]


def test_the_run_is_bit_identical_with_an_interval_and_with_an_energy_balance() -> None:
    alone = tensions(RIG.twin())
    assert tensions(Twin(RIG.scene(), ERROR_INTERVAL)) == alone
    assert tensions(Twin(RIG.scene(), Monitors(energy=True, error_interval=True))) == alone


def test_a_multi_line_run_is_bit_identical_and_so_is_the_interval_of_a_branch() -> None:
    scene = load_scene("bridle_lift")
    twin = Twin(scene, ERROR_INTERVAL)
    assert pulls(list(fed(twin, 4.0))) == pulls(list(fed(Twin(scene), 4.0)))
    other = twin.branch()
    for _ in range(40):
        twin.advance(3)
        other.advance(3)
        assert without_cost(other.snapshot()) == without_cost(twin.snapshot())


def without_cost(snapshot: Snapshot) -> TensionInterval:
    """The interval of a snapshot; its cost is measured, not simulated."""
    assert snapshot.error_interval is not None
    return replace(snapshot.error_interval, cost_pct=0.0)


def test_a_run_that_asks_for_no_interval_has_none() -> None:
    assert RIG.twin().snapshot().error_interval is None


@given(st.lists(st.tuples(st.floats(0.001, 0.4), st.floats(0.0, 1e6)), min_size=1, max_size=60))
def test_the_maximum_is_that_of_the_samples_in_the_window(
    samples: list[tuple[float, float]],
) -> None:
    largest, seen, now = WindowMaximum(0.5), [], 0.0
    for step, value in samples:
        now += step
        largest.take(now, value)
        seen.append((now, value))
        assert largest.at(now) == max(v for at, v in seen if at > now - 0.5)
    assert largest.at(now + 0.6) == 0.0


def test_a_restored_twin_knows_its_interval_when_the_coarse_solution_has_settled() -> None:
    twin = Twin(RIG.scene(), ERROR_INTERVAL)
    tensions(twin, 4.0)
    again = Twin.restore(twin.capture(), RIG.scene(), ERROR_INTERVAL)
    snapshots = list(march(again, HEAVE, 25.0, 2))
    for snapshot in snapshots:
        assert (snapshot.error_interval is None) == (snapshot.time_s < 4.0 + SETTLING_S)
        assert snapshot.no_error_interval.startswith("unknown until 24.0 s") == (
            snapshot.error_interval is None
        )
    (*_, last) = march(twin, HEAVE, 25.0, 2)
    assert last.tension_top_n == snapshots[-1].tension_top_n
    assert without_cost(snapshots[-1]).bound_n == pytest.approx(without_cost(last).bound_n, rel=0.5)


def test_a_coarse_solution_that_fails_is_replaced() -> None:
    twin = Twin(RIG.scene(), ERROR_INTERVAL)
    snapshots = list(march(twin, HEAVE, 1.0, 2))
    assert snapshots[-1].error_interval is not None
    coarse = interval_of(twin).coarse
    assert coarse is not None
    coarse.ropes[0].state.nodes[rows.POSITION, 3] = np.nan
    snapshots = list(march(twin, HEAVE, 22.0, 2))
    assert snapshots[0].error_interval is None
    assert np.isfinite(without_cost(snapshots[-1]).bound_n)


@pytest.mark.parametrize(("name", "lower"), [("landing", 0), ("two_line_landing", 1)])
def test_a_payload_that_stands_on_the_seabed_is_found(name: str, lower: int) -> None:
    scene = load_scene(name)
    joined = is_joined(scene)
    ropes = build_joined(scene).system if joined else build(scene)
    ends = ropes.ropes if isinstance(ropes, System) else (ropes,)
    for rope in ends:
        rope.state.nodes[rows.POSITION + 2] = -10.0
    assert not stands_on_bed(ropes)
    ends[lower].state.nodes[rows.POSITION + 2, 0] = -1000.0
    assert stands_on_bed(ropes)


def test_an_anchored_end_does_not_stand_on_the_seabed() -> None:
    rope = build(load_scene("chain_on_bottom"))
    rope.state.nodes[rows.POSITION + 2] = -1000.0
    assert not stands_on_bed(rope)


def test_it_is_unknown_while_the_payload_stands_on_the_seabed() -> None:
    twin = Twin(load_scene("landing"), ERROR_INTERVAL)
    twin.advance(2)
    assert twin.snapshot().error_interval is not None
    twin.rope.state.nodes[rows.POSITION + 2, 0] = -401.0  # 1 m below the bed
    twin.advance(2)
    snapshot = twin.snapshot()
    assert snapshot.error_interval is None
    assert snapshot.no_error_interval.startswith("unknown until 20.0 s: the payload stood on")


def test_it_is_unknown_with_a_wake_oscillator_and_costs_nothing() -> None:
    twin = Twin(load_scene("sonde_cast"), ERROR_INTERVAL)
    assert interval_of(twin).coarse is None
    twin.advance(10)
    snapshot = twin.snapshot()
    assert snapshot.error_interval is None
    assert snapshot.no_error_interval.startswith("unknown with `wake_oscillator`")


def test_every_rope_from_the_ship_has_an_interval_and_all_are_reported() -> None:
    twin = Twin(load_scene("two_line_lift"), ERROR_INTERVAL)
    twin.advance(10)
    snapshot, topic = twin.snapshot(), "ropes/tension_top_error"
    assert snapshot.error_interval == snapshot.ropes[0].error_interval
    found = [rope.error_interval for rope in snapshot.ropes]
    low_n, high_n = [], []
    for rope, interval in zip(snapshot.ropes, found, strict=True):
        assert interval is not None
        assert interval.low_n < rope.tension_top_n < interval.high_n
        assert interval.high_n - rope.tension_top_n == pytest.approx(interval.bound_n)
        low_n.append(interval.low_n)
        high_n.append(interval.high_n)
    table = read_cloud(decode(topic, Encoder(0).encode(topic, snapshot)))
    assert (table["lower_n"].tolist(), table["upper_n"].tolist()) == (low_n, high_n)
    assert table["name"].tolist() == [rope.name.encode() for rope in snapshot.ropes]
    (row,) = (one for one in statuses(snapshot, None) if one.name == "simulation: error interval")
    assert "error bound of 'aft' [N]" in row.values
    legs = Twin(load_scene("bridle_lift"), ERROR_INTERVAL).snapshot().ropes
    assert [rope.error_interval is not None for rope in legs] == [True, *(4 * [False])]


def test_a_run_publishes_records_and_summarises_its_interval(tmp_path: Path) -> None:
    options = RunOptions(
        scene="shallow_lift", end_s=2.0, speed=0.0, record=tmp_path / "bag", error_interval=True
    )
    snapshots: list[Snapshot] = []
    summary = run_unpaced(options, lambda run: snapshots.append(run.last))
    assert summary.error_interval is not None
    assert "error interval (95 %): top tension now" in summary.as_text()
    assert summary.error_interval["bound_n"] == without_cost(snapshots[-1]).bound_n
    edges = recorded_edges(tmp_path / "bag")
    assert len(edges) == len(snapshots) == 100
    for (low, high), snapshot in zip(edges, snapshots, strict=True):
        assert low <= snapshot.tension_top_n <= high


def test_a_bag_without_an_interval_holds_no_bounds(tmp_path: Path) -> None:
    run = UnpacedRun(
        RunOptions(scene="shallow_lift", end_s=0.1, speed=0.0, record=tmp_path / "bag")
    )
    run.advance_slot()
    run.close()
    assert recorded_edges(tmp_path / "bag") == []


def recorded_edges(bag: Path) -> list[tuple[float, float]]:
    """Low and high of every interval in a bag."""
    edges, names = [], {}
    (file,) = bag.glob("*.mcap")
    for record in McapScan(file).records():
        if isinstance(record, Channel):
            names[record.id] = record.topic
        elif isinstance(record, StoredMessage) and names[record.channel_id].endswith(
            "ropes/tension_top_error"
        ):
            row = read_cloud(decode("ropes/tension_top_error", record.data))[0]
            edges.append((float(row["lower_n"]), float(row["upper_n"])))
    return [edge for edge in edges if np.isfinite(edge).all()]


@pytest.mark.parametrize("name", ["shallow_lift", "two_line_lift"])
def test_it_covers_the_error_in_a_variant_of_the_scene(name: str) -> None:
    (row,) = benchmark.measure_variants(1, 5, 20.0, lambda *_: None, [name])
    assert row.known_pct == 100.0
    assert row.covered_pct >= 95.0
    assert 1.0 < row.bound_n / row.error_n < 50.0
