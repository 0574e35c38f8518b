"""Saving of a running twin at intervals."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from small_scene import small_scene

import rope_twin.twin.ropes as twin_module
from rope_twin import Twin
from rope_twin.errors import SolverError, StateError
from rope_twin.twin.state import SavedState, load_state
from rope_twin.twin.state_file import AutoSave


@pytest.fixture
def twin(tmp_path: Path) -> Twin:
    return Twin(small_scene(tmp_path))


def test_states_are_saved_at_intervals_and_at_the_end(twin: Twin, tmp_path: Path) -> None:
    """Each file is the state of its step; none is written early."""
    path = tmp_path / "run.state"
    keeper = AutoSave(twin, path, 0.5)
    keeper.advance(49)
    keeper.finish_writing()
    assert not path.exists()
    seen = set()
    for _ in range(20):
        keeper.advance(10)
        keeper.finish_writing()
        seen.add(load_state(path).about.step)
    assert seen == {59, 109, 159, 209}
    assert keeper.health().saved_s == pytest.approx(2.09)
    keeper.finish()
    assert load_state(path).about.step == 249
    before = path.stat().st_mtime_ns
    keeper.finish()
    assert path.stat().st_mtime_ns == before, "nothing new, nothing to write"


def test_a_run_without_steps_leaves_the_file_alone(twin: Twin, tmp_path: Path) -> None:
    twin.save(tmp_path / "run.state")
    before = (tmp_path / "run.state").stat().st_mtime_ns
    AutoSave(twin, tmp_path / "run.state", 1.0).finish()
    assert (tmp_path / "run.state").stat().st_mtime_ns == before


def test_a_full_disk_is_reported_once_and_the_twin_continues(
    twin: Twin, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    folder = tmp_path / "states"
    folder.mkdir()
    keeper = AutoSave(twin, folder / "run.state", 0.1)
    folder.rmdir()
    for _ in range(2):
        keeper.advance(10)
        keeper.finish_writing()
    assert "cannot be written (No such file" in keeper.health().trouble
    assert keeper.health().saved_s is None
    folder.mkdir()
    keeper.advance(20)
    keeper.finish_writing()
    assert keeper.health().trouble == ""
    assert keeper.health().saved_s == 0.4
    failed, again = [record.getMessage() for record in caplog.records]
    assert "cannot be written (No such file" in failed
    assert again == "the state at 0.4 s is saved again"

    def defect(state: SavedState, path: Path) -> None:
        raise MemoryError("none left")

    monkeypatch.setattr(SavedState, "write", defect)
    keeper.advance(20)
    keeper.finish()
    assert "MemoryError: none left" in keeper.health().trouble
    assert twin.steps == 60


def test_a_state_that_cannot_be_saved_is_reported_and_the_twin_continues(
    twin: Twin, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The previous file is kept."""
    keeper = AutoSave(twin, tmp_path / "run.state", 0.1)
    keeper.advance(20)
    keeper.finish_writing()

    def defect() -> SavedState:
        raise StateError("inputs/gust is not a number")

    with monkeypatch.context() as patch:
        patch.setattr(twin, "capture", defect)
        keeper.advance(20)
        keeper.finish()
    assert keeper.health().trouble == f"{tmp_path / 'run.state'}: inputs/gust is not a number"
    assert load_state(tmp_path / "run.state").about.step == 20
    keeper.advance(20)
    keeper.finish()
    assert (keeper.health().trouble, twin.steps) == ("", 60)
    assert load_state(tmp_path / "run.state").about.step == 60


def test_an_impossible_path_is_reported_at_the_start(twin: Twin, tmp_path: Path) -> None:
    with pytest.raises(StateError, match="cannot be written; name a file"):
        AutoSave(twin, tmp_path / "none" / "run.state", 1.0)


def test_a_failing_state_does_not_replace_the_last_good_one(
    twin: Twin, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    keeper = AutoSave(twin, tmp_path / "run.state", 0.5)
    keeper.advance(50)
    keeper.finish_writing()
    monkeypatch.setattr(twin_module, "advance", lambda *given: 0)
    twin.failure_folder = tmp_path
    with pytest.raises(SolverError):
        keeper.advance(50)
    keeper.finish()
    assert load_state(tmp_path / "run.state").about.failure == ""
    assert load_state(tmp_path / "small_failed_step_51.state").about.failure
    assert math.isclose(load_state(tmp_path / "run.state").about.time_s, 0.5)
