"""A run resumed from a saved state or on a branch is bit-identical to the uninterrupted run."""

from __future__ import annotations

import math
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from saved_runs import run_until
from small_scene import digest, small_scene

from rope_twin import Snapshot, fed, load_scene
from rope_twin.errors import InputError
from rope_twin.run.options import RunOptions
from rope_twin.run.unpaced import measure_alone
from rope_twin.scene.schema import Scene
from rope_twin.twin.snapshot import ForecastScore
from rope_twin.twin.state import SavedState
from rope_twin.twin.twin import Twin

END = 2050
# At rest; before the commands; queue and splits; in the gap; being led back; hauling in, merges.
MOMENTS = (0, 45, 260, 700, 850, 1950)


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    return small_scene(tmp_path_factory.mktemp("scene"))


@pytest.fixture(scope="module")
def whole(scene: Scene) -> dict[int, list[Snapshot]]:
    """Return what follows each moment in a run without interruption."""
    twin, pieces = Twin(scene), []
    for last in (*MOMENTS[1:], END):
        pieces.append(run_until(twin, last))
    health = twin.snapshot()
    assert health.solver.splits > 0
    assert health.solver.merges > 0
    assert health.inputs["heave"].refused == health.inputs["winch_command"].refused == 1
    return {
        moment: [snapshot for piece in pieces[number:] for snapshot in piece]
        for number, moment in enumerate(MOMENTS)
    }


def same(one: SavedState, other: SavedState) -> bool:
    """Return whether every value and every bit of every array is equal."""
    return (
        one.memory == other.memory
        and one.arrays.keys() == other.arrays.keys()
        and all(a.tobytes() == other.arrays[name].tobytes() for name, a in one.arrays.items())
    )


@pytest.mark.parametrize("moment", MOMENTS)
def test_restored_and_branched_runs_are_bit_identical(
    scene: Scene, whole: dict[int, list[Snapshot]], tmp_path: Path, moment: int
) -> None:
    """Inputs and their health included, whatever was in progress when it was saved."""
    twin = Twin(scene)
    run_until(twin, moment)
    twin.save(tmp_path / "saved")
    branch = twin.branch()
    restored = Twin.restore(tmp_path / "saved", scene)
    assert same(restored.capture(), twin.capture())
    assert same(branch.capture(), twin.capture())
    for other in (restored, branch):
        snapshots = run_until(other, END)
        assert digest(snapshots) == digest(whole[moment])
        for snapshot, expected in zip(snapshots, whole[moment], strict=True):
            assert snapshot.inputs == expected.inputs
            assert snapshot.winch_at_limit == expected.winch_at_limit
    assert twin.steps == moment
    assert same(Twin.restore(tmp_path / "saved", scene).capture(), twin.capture())


@pytest.mark.parametrize("coverage", [math.nan, 0.9])
def test_the_score_of_a_forecast_is_part_of_a_state(
    scene: Scene, tmp_path: Path, coverage: float
) -> None:
    """Unknown coverage too: every run with a forecast and without a measured tension has it."""
    twin = Twin(scene)
    assert twin.submit_forecast_score(coverage, judged=40, factor=1.2, age_s=0.3) == ""
    twin.save(tmp_path / "saved")
    twins = twin, Twin.restore(tmp_path / "saved", scene), twin.branch()
    scores = [one.inputs.forecast.at(0.5) for one in twins]
    for one in scores:
        assert one == pytest.approx(ForecastScore(0.0, 0.3, coverage, 40, 1.2), nan_ok=True)
    assert all(one.inputs.forecast.at(1e3) is None for one in twins), "no forecast runs any more"


def test_another_process_resumes_bit_identically(
    scene: Scene, whole: dict[int, list[Snapshot]], tmp_path: Path
) -> None:
    twin = Twin(scene)
    run_until(twin, 260)
    twin.save(tmp_path / "saved")
    here = Path(__file__).parents[1] / "support"
    done = subprocess.run(
        [sys.executable, str(here / "saved_runs.py"), str(tmp_path / "saved"), str(tmp_path),
         str(END)],
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(here), *sys.path])},
        check=True, capture_output=True, text=True,
    )  # fmt: skip
    assert done.stdout == digest(whole[260])
    assert len(done.stdout) == 64


def test_a_branch_is_independent_of_its_origin(scene: Scene) -> None:
    """Inputs of one do not reach the other; both are checked to have moved."""
    twin = Twin(scene)
    run_until(twin, 300)
    before, branch = twin.capture(), twin.branch()
    assert not branch.submit_speed(None, -0.5)
    assert not branch.submit_current(np.array([[0.0, 1.0, 0.0]]))
    run_until(branch, 420)
    assert same(twin.capture(), before)
    assert not same(branch.capture(), before)
    run_until(twin, 420)
    assert twin.snapshot().line_out_m > branch.snapshot().line_out_m


def test_statistics_continue_after_a_restart(scene: Scene, tmp_path: Path) -> None:
    """Extremes and mean are those of the whole run, and so is the time spent computing."""
    twin = Twin(scene)
    run_until(twin, 260)
    twin.save(tmp_path / "saved")
    assert Twin.restore(tmp_path / "saved", scene).statistics() == twin.statistics()


def test_a_run_resumes_after_its_payload_has_landed(tmp_path: Path) -> None:
    """No state after the first landing could be resumed: an object of a fresh run lacked it."""
    scene = load_scene("landing")
    twin = Twin(scene)
    while twin.snapshot().landings is None:
        for _ in fed(twin, twin.time_ns * 1e-9 + 0.5):
            pass
    twin.save(tmp_path / "saved")
    resumed = Twin.restore(tmp_path / "saved", scene)
    assert same(resumed.capture(), twin.capture())
    later_s = twin.time_ns * 1e-9 + 5.0
    for one, other in zip(fed(twin, later_s), fed(resumed, later_s), strict=True):
        assert one.landings == other.landings
        assert one.node_position_m.tobytes() == other.node_position_m.tobytes()


def test_internal_variables_of_effects_are_saved(tmp_path: Path) -> None:
    """An effect that owns changing arrays; in plain Python, since only this test has it."""
    here = Path(__file__).parents[1] / "support"
    done = subprocess.run(
        [sys.executable, str(here / "remembering_effect_process.py"),
         str(tmp_path)],
        env={**os.environ, "NUMBA_DISABLE_JIT": "1",
             "PYTHONPATH": os.pathsep.join([str(here), *sys.path])},
        check=False, capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stdout == "restored and branch are the run; without the memory they are not\n"


def test_the_solver_speed_is_measured_after_a_restart(scene: Scene, tmp_path: Path) -> None:
    """It was 0 once the saved run had computed for 3 s: the state knows that time."""
    twin = Twin(scene)
    twin.advance(10)
    twin.inspect().clock.computing_s = 100.0
    twin.save(tmp_path / "long.state")
    options = RunOptions(scene=str(scene.path), start_from=tmp_path / "long.state")
    assert measure_alone(options, 0.5) > 0.0


def test_negative_steps_are_rejected_and_a_current_may_be_a_list(scene: Scene) -> None:
    """Steps below zero were passed over in silence, and a list had no shape."""
    twin = Twin(scene)
    with pytest.raises(InputError, match="-5 steps would lead back in time; restore"):
        twin.advance(-5)
    with pytest.raises(InputError, match=r"0\.5 is not a number of steps; give a whole number"):
        twin.advance(0.5)  # type: ignore[arg-type]
    assert twin.steps == 0
    assert twin.submit_current([[0.0, 0.5, 0.0], [-100.0, 0.1, 0.0]]) == ""
