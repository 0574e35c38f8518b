"""A twin whose rope is cut: snapshots, view, saved states, energy balance, refusals."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

import numpy as np
import pytest
from small_scene import SMALL_SCENE, digest, not_finite, small_scene

from rope_twin import Snapshot, load_scene
from rope_twin.effects.bending import BendingParams
from rope_twin.errors import InputError, StateError
from rope_twin.messages import Level, statuses
from rope_twin.recording.bag import BagReader
from rope_twin.run.options import RunOptions
from rope_twin.run.unpaced import run_unpaced
from rope_twin.scene.error_bound import AccuracyLevel
from rope_twin.scene.schema import Scene
from rope_twin.twin.cut_input import CutInput, PlannedCut, plan_for, read_plan
from rope_twin.twin.level import OverloadProtection
from rope_twin.twin.monitors import ENERGY, ERROR_INTERVAL
from rope_twin.twin.pacing import SlotTimes
from rope_twin.twin.snapshot import LENGTH
from rope_twin.twin.state import load_state
from rope_twin.twin.twin import Twin
from rope_twin.twin.winch.commands import WinchCommand

Kind = TypeVar("Kind", bound=Twin)
AT_S, BELOW_M = 2.505, 80.0  # between two borders of steps
CURRENT = np.array([[0.0, 0.2, -0.4], [-300.0, 0.1, 0.0]])
BED = "  - seabed: {depth_m: 260.0, friction: 0.4}\n  - payload: {}\n"


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    return small_scene(tmp_path_factory.mktemp("scene"))


def reported(twin: Kind) -> Kind:
    """Feed heave, a speed, a cut and a new current, all ahead of time."""
    for k in range(-1, 90):
        at_ns = 100_000_000 * k
        twin.submit_heave(at_ns, math.sin(at_ns * 1e-9), math.cos(at_ns * 1e-9))
    assert not twin.submit_speed(1_000_000_000, 0.7)
    assert not twin.submit_cut(round(AT_S * 1e9), BELOW_M)
    return twin


def ends(twin: Twin, chunk: int, last: int = 800) -> list[Snapshot]:
    """Return a snapshot every 100 steps, stepped in such chunks, with another current halfway."""
    snapshots = []
    while twin.steps < last:
        if twin.steps == 400:
            assert not twin.submit_current(CURRENT)
        twin.advance(min(chunk, 100 - twin.steps % 100, last - twin.steps))
        if twin.steps % 100 == 0:
            snapshots.append(twin.snapshot())
    return snapshots


def every_bit(snapshots: list[Snapshot]) -> str:
    """Return every figure of a snapshot of one rope, and of the lower part."""
    below = [rope for snapshot in snapshots for rope in snapshot.ropes]
    tables = (table for rope in below for table in (rope.node_position_m, rope.node_tension_n))
    return digest(snapshots) + b"".join(table.tobytes() for table in tables).hex()


@pytest.fixture(scope="module")
def run(scene: Scene) -> list[Snapshot]:
    return ends(reported(Twin(scene)), 1)


def test_both_parts_are_reported(scene: Scene, run: list[Snapshot]) -> None:
    """One rope before; then the upper part with less line out, and a rope with the payload."""
    before, after = run[1], run[-1]
    assert not before.ropes
    assert before.cut is None
    assert after.cut is not None
    assert after.cut.at_s == pytest.approx(2.51)
    assert after.cut.left_m == pytest.approx(BELOW_M, abs=0.1)
    upper, lower = after.ropes
    assert (upper.name, lower.name) == ("hoist", "hoist/lower")
    assert upper.line_out_m == after.line_out_m
    assert lower.line_out_m == after.cut.lost_m
    whole = Twin(scene)
    whole.submit_speed(1_000_000_000, 0.7)
    whole.advance(800)
    length = whole.snapshot().line_out_m - after.cut.lost_m
    assert after.line_out_m == pytest.approx(length, abs=1e-9)
    assert (lower.node_position_m[-1] == after.payload_position_m).all()
    assert (upper.node_position_m == after.node_position_m).all()
    assert after.payload_position_m[2] < lower.node_position_m[0, 2] < -BELOW_M
    assert after.payloads[0].name == "tool"
    assert lower.node_tension_n[0] == lower.tension_top_n == 0.0
    assert after.study_error.words == "unknown: the rope was cut"
    assert not not_finite(after)


def test_a_cut_run_is_independent_of_the_call_pattern(scene: Scene, run: list[Snapshot]) -> None:
    """Chunks of any number of steps give bit-identical results."""
    assert every_bit(ends(reported(Twin(scene)), 64)) == every_bit(run)


@pytest.mark.parametrize("moment", [200, 251, 300, 700])
def test_a_cut_run_resumes_bit_identically(
    scene: Scene, run: list[Snapshot], tmp_path: Path, moment: int
) -> None:
    """With the cut planned, right after it, before another current and after it."""
    twin = reported(Twin(scene))
    ends(twin, 50, moment)
    twin.save(tmp_path / "cut.state")
    other = Twin.restore(tmp_path / "cut.state", scene)
    rest = [snapshot for snapshot in run if snapshot.step > moment]
    assert every_bit(ends(twin.branch(), 100)) == every_bit(rest)
    assert every_bit(ends(other, 7)) == every_bit(rest)
    cut = twin.cut
    about = load_state(tmp_path / "cut.state").about
    assert about.cut_lost_m == (cut.lost_m if cut else 0.0)


def test_the_winch_hauls_in_the_remaining_rope(scene: Scene) -> None:
    """It hauls in to its minimum payout; a command by length was for the whole rope and ends."""
    twin = Twin(scene)
    assert not twin.submit_command(None, WinchCommand(LENGTH, 390.0))
    twin.advance(100)
    assert not twin.submit_cut(None, 60.0)
    twin.advance(500)
    assert twin.snapshot().payout_speed_m_per_s == 0.0
    assert "50 to 2" in twin.submit_command(None, WinchCommand(LENGTH, 390.0)), (
        "there is less rope now"
    )
    assert not twin.submit_speed(None, -1.5)
    twin.advance(3000)
    snapshot = twin.snapshot()
    assert snapshot.line_out_m == pytest.approx(50.0, abs=1e-3)
    assert snapshot.tension_top_n == pytest.approx(50.0 * 5.1 * 9.81, rel=0.2), "a bare rope"


def test_an_emergency_cut_at_the_ship(scene: Scene) -> None:
    """Two metres remain, less than the minimum payout; the winch stands and can pay out."""
    twin = Twin(scene)
    assert not twin.submit_speed(None, -1.0)
    twin.advance(300)
    assert not twin.submit_cut(None, 2.0)
    twin.advance(500)
    assert twin.cut is not None
    assert twin.cut.left_m == pytest.approx(2.0)
    assert twin.snapshot().line_out_m == pytest.approx(1.5), "it could not brake in time"
    assert not twin.submit_speed(None, 1.0)
    twin.advance(2000)
    assert twin.snapshot().line_out_m > 15.0
    assert twin.snapshot().solver.unconverged_substeps == 0


def test_rope_and_payload_come_to_rest_on_the_bed(tmp_path: Path) -> None:
    """The bed carries their weight in water, and the rope lies on it."""
    path = tmp_path / "bed.yaml"
    path.write_text(SMALL_SCENE.replace("  - payload: {}\n", BED))
    scene = load_scene(path)
    twin = Twin(scene)
    assert not twin.submit_cut(None, 150.0)
    twin.advance(12_000)
    bed = twin.snapshot().seabed
    assert bed is not None
    assert bed.payload_landed
    rope = scene.ropes[0].rope
    assert rope is not None
    weight = rope.mass_kg_per_m - 1025.0 * 0.25 * math.pi * rope.hydrodynamic_diameter_m**2
    assert bed.payload_reaction_n + bed.rope_reaction_n == pytest.approx(
        ((8000.0 - 1025.0 * 1.5) + weight * 50.0) * 9.80665, rel=2e-3
    )
    assert bed.rope_on_bed_m == pytest.approx(50.0, abs=6.0), "the last node may lean on others"


def test_energy_balance_of_both_parts_after_a_cut(scene: Scene) -> None:
    """Over the cut and the fall the residual is the steps' numerical dissipation."""
    twin = reported(Twin(scene, ENERGY))
    twin.advance(2000)
    balance = twin.snapshot().energy
    assert balance is not None
    assert twin.cut is not None
    assert balance.kinetic_j > 0.5 * 8000.0 * 2.0**2, "it sinks"
    assert abs(balance.residual_pct) < 0.5


def test_the_accuracy_level_is_frozen_after_a_cut(scene: Scene) -> None:
    """However late the cycles are; a level taken before the cut is kept, and saved."""
    twin = reported(Twin(scene))
    twin.set_level(AccuracyLevel(20_000_000))
    protection = OverloadProtection(twin)
    twin.advance(150)
    slots = (SlotTimes(k * 20_000_000, 2e7, 60_000_000, True) for k in range(100))
    assert not any(protection.judge(slot) for slot in slots)
    with pytest.raises(StateError, match=r"other elements: the rope was cut"):
        twin.set_level(AccuracyLevel(10_000_000))
    branch = Twin.restore(twin.capture(), scene)
    assert branch.level == twin.level
    for one in (twin, branch):
        one.advance(50)
    assert every_bit([twin.snapshot()]) == every_bit([branch.snapshot()])


REFUSED: list[tuple[Callable[[Twin], str], str]] = [
    (lambda twin: twin.submit_cut(None, math.nan), "its place is not a number"),
    (lambda twin: twin.submit_cut(None, 0.5), "at least 1 m of rope stay there"),
    (lambda twin: twin.submit_cut(None, -math.inf), "-inf m below the hang-off"),
    (lambda twin: twin.submit_cut(-1, 50.0), "0 ms after it was due"),
    (lambda twin: twin.submit_cut(11_000_000_000, 50.0), "more than 10 s ahead"),
]


@pytest.mark.parametrize(("submit", "words"), REFUSED)
def test_invalid_cuts_are_rejected(scene: Scene, submit: Callable[[Twin], str], words: str) -> None:
    twin = Twin(scene)
    message = submit(twin)
    assert message.startswith("cut: ")
    assert words in message
    assert twin.snapshot().inputs["cut"].refused == 1
    twin.advance(1)
    assert twin.cut is None


def test_a_cut_beyond_the_line_out_is_not_made(scene: Scene) -> None:
    twin = Twin(scene)
    assert not twin.submit_cut(None, 199.5)
    twin.advance(2)
    health = twin.snapshot().inputs["cut"]
    assert twin.cut is None
    assert "199.5 m below the hang-off is not on the 200.0 m of rope" in health.note
    assert not twin.submit_cut(None, math.inf), "it may be tried again"
    twin.advance(2)
    assert twin.cut is not None
    assert twin.cut.lost_m == pytest.approx(1.0)
    assert "cut already" in twin.submit_cut(None, 20.0)


def test_scenes_whose_rope_cannot_be_cut_are_rejected() -> None:
    for name, words in (
        ("two_line_loop", "runs over a sheave"),
        ("curved_pipe", "`wake_oscillator` together with `bending`"),
    ):
        assert words in CutInput(load_scene(name)).submit(None, 20.0, 0)
    chain = load_scene("chain_on_bottom")
    stiff = replace(chain, effects=(*chain.effects, BendingParams(stiffness_n_m2=100.0)))
    assert "`bed_friction` together with `bending`" in CutInput(stiff).submit(None, 20.0, 0)


def test_an_impossible_cut_plan_is_rejected_before_the_run(scene: Scene) -> None:
    for name, words in (("two_line_loop", "a sheave"), ("curved_pipe", "`wake_oscillator`")):
        with pytest.raises(InputError, match=words):
            plan_for(load_scene(name), "20@3")
    with pytest.raises(InputError, match=r"never longer than 400 m; give up to 399 m, or end"):
        plan_for(scene, "500@3")
    assert plan_for(scene, "end@3") == PlannedCut(3_000_000_000, math.inf)
    assert plan_for(scene, "") is None


def test_the_error_interval_is_unknown_after_a_cut(scene: Scene) -> None:
    """The run itself is bit-identical to one without an interval, from a saved state as well."""
    twin, alone = reported(Twin(scene, ERROR_INTERVAL)), reported(Twin(scene))
    twin.advance(200)
    assert twin.snapshot().error_interval is not None
    assert ends(twin, 100, 600)[-1].tension_top_n == ends(alone, 100, 600)[-1].tension_top_n
    other = Twin.restore(twin.capture(), scene, ERROR_INTERVAL)
    for one in (twin, twin.branch(), other):
        one.advance(50)
        snapshot = one.snapshot()
        assert snapshot.error_interval is None
        assert snapshot.no_error_interval.startswith("unknown since the cut at 2.51 s: ")
        (row,) = (
            row for row in statuses(snapshot, None) if row.name == "simulation: error interval"
        )
        assert (row.level, row.message) == (Level.WARN, snapshot.no_error_interval)


def test_a_run_with_an_interval_is_cut_and_reported_at_the_end(scene: Scene) -> None:
    options = RunOptions(
        scene=str(scene.path), end_s=2.0, speed=0.0, error_interval=True, cut="80@1.5"
    )
    summary = run_unpaced(options, lambda run: None)
    assert "error interval: unknown since the cut at 1.50 s" in summary.as_text()
    assert summary.error_interval is None


def test_a_run_records_the_cut_command_and_both_ropes(scene: Scene, tmp_path: Path) -> None:
    """Without ROS, the topics that a paced run has; reported at the end and in the diagnostics."""
    options = RunOptions(
        scene=str(scene.path), end_s=3.0, speed=0.0, record=tmp_path / "bag", cut=f"{BELOW_M}@1.5"
    )
    summary = run_unpaced(options, lambda run: None)
    assert "cut at 1.50 s, 80.0 m below the hang-off" in summary.as_text()
    with BagReader(tmp_path / "bag") as reader:
        counts = {name.strip("/"): content.messages for name, content in reader.topics.items()}
    assert counts["ropes/cut"] == 1
    assert counts["ropes/length"] == counts["payloads/state"] == 150
    assert counts["ropes/nodes"] == pytest.approx(75, abs=1)
    rows = statuses(run_to_its_end(scene), None)
    reported = next(row for row in rows if row.name == "simulation: rope")
    assert reported.level == Level.WARN
    assert reported.values["rope below the cut [m]"] == "120.00"


def run_to_its_end(scene: Scene) -> Snapshot:
    """Return the run half a second after a cut."""
    twin = Twin(scene)
    assert not twin.submit_cut(None, BELOW_M)
    twin.advance(50)
    return twin.snapshot()


def test_malformed_cut_options_are_rejected() -> None:
    assert read_plan("") is None
    assert read_plan("1500@30") == PlannedCut(30_000_000_000, 1500.0)
    assert read_plan("end@0.5") == PlannedCut(500_000_000, math.inf)
    assert read_plan("leg_port:4@3") == PlannedCut(3_000_000_000, 4.0, "leg_port")
    for words in ("1500", "@3", "a@3", "1500@", "nan@3", "0.1@3", "20@-1", "20@inf"):
        with pytest.raises(InputError, match="cut"):
            read_plan(words)
