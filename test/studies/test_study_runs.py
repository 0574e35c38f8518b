"""Parameter studies: killed and gone on with, on two worker processes, and what comes out."""

from __future__ import annotations

import gc
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import dask
import distributed
import numpy as np
import pyarrow.parquet as parquet
import pytest
from study_text import GOOD, written

from rope_twin.cli import ensembles, main
from rope_twin.errors import InputError
from rope_twin.scene.load import load_scene
from rope_twin.studies.ensemble import Plan, variations
from rope_twin.studies.study_design import read_study
from rope_twin.studies.study_run import StudyFolder, on_cluster
from rope_twin.twin.ensemble.ensemble import Ensemble

PATIENCE_S = 300.0
# Stands still when the first rows are there, to be killed: the rest would not take long.
STANDS_STILL = """
import sys, threading
from rope_twin.cli import main
from rope_twin.studies.study_run import StudyFolder, on_cluster

add = StudyFolder.add

def add_and_stand(folder, rows):
    add(folder, rows)
    threading.Event().wait()

StudyFolder.add = add_and_stand
sys.exit(main(sys.argv[1:]))
"""
Row = dict[str, Any]


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the study run in one go."""
    folder = tmp_path_factory.mktemp("whole")
    assert (
        main(["study", str(written(folder)), "--out", str(folder / "rows"), "--batch-size", "3"])
        == 0
    )
    return folder / "rows"


def rows_of(folder: Path) -> list[Row]:
    rows: list[Row] = parquet.read_table(folder / "runs.parquet").to_pylist()
    return [{key: value for key, value in row.items() if key != "took_s"} for row in rows]


def test_a_curve_of_wire_for_chain_is_reported_before_anything_runs(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    path = written(tmp_path, "about: a\nscene: chain_on_bottom\nseconds: 1.0\nvary:\n"
                   "  - {path: effects.drag.normal, values: [1.2]}\n"
                   "fatigue: {curve: stranded_wire}\n")  # fmt: skip
    monkeypatch.setattr(ensembles, "run_parameter_study", lambda *given: sys.exit(7))
    with pytest.raises(SystemExit, match="7"):
        main(["study", str(path), "--out", str(tmp_path / "rows")])
    assert "rope 'mooring' section 1 is chain" in capsys.readouterr().err


def test_a_row_for_each_run(whole: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Sorted, with figures, the study's error and damage; a second start has nothing to do."""
    rows = rows_of(whole)
    assert [row["run"] for row in rows] == list(range(12))
    for row in rows:
        assert row["failure"] == ""
        assert 0.0 < row["tension_top_min_n"] < row["tension_top_mean_n"] < row["tension_top_max_n"]
        assert "the convergence study is of the scene before" in row["study_error_words"]
        assert len(row["damage"]) == len(row["damage_from_lower_end_m"]) > 2
        assert row["damage_worst"] == max(row["damage"]) > 0.0
    heavy, light = (
        np.mean([r["tension_top_mean_n"] for r in rows if r["payloads[0].mass_kg"] == mass])
        for mass in (22e3, 18e3)
    )
    paid_out = 0.3  # m/s², by the winch, all the two seconds
    assert heavy - light == pytest.approx(4e3 * (9.80665 - paid_out), rel=2e-3)
    assert (whole / "study.png").stat().st_size > 5_000
    stamp = (whole / "runs.parquet").stat().st_mtime_ns
    assert main(["study", str(whole.parent / "small.yaml"), "--out", str(whole)]) == 0
    assert (whole / "runs.parquet").stat().st_mtime_ns == stamp
    out = capsys.readouterr().out
    assert "12 runs of 2 s of shallow_lift" in out
    assert "payloads[0].mass_kg: median over the runs; rank correlation" in out
    assert "steel_wire_76mm" in out


def test_a_run_equals_the_scene_by_itself(whole: Path) -> None:
    """The 40 mm wire with the file's own load and drag is the scene as it is, to the bit."""
    same = {"payloads[0].mass_kg": 20e3, "cable": "steel_wire_40mm", "drag": "rough"}
    (row,) = [row for row in rows_of(whole) if same.items() <= row.items()]
    scene = load_scene("shallow_lift")
    ensemble = Ensemble(scene, variations(scene, Plan((), 1, ((),), 1), 2.0))
    for _ in range(4):
        ensemble.advance(0.5)
    (figures,) = ensemble.figures()
    assert row["tension_top_max_n"] == figures.tension_top_max_n
    assert row["tension_top_mean_n"] == pytest.approx(figures.tension_top_mean_n, rel=1e-14)


def test_killed_and_gone_on_with(whole: Path, tmp_path: Path) -> None:
    """SIGKILL after the first rows: they stay, the rest follows, none twice, all equal."""
    into = tmp_path / "rows"
    words = ["study", str(written(tmp_path)), "--out", str(into), "--batch-size", "2"]
    process = subprocess.Popen([sys.executable, "-c", STANDS_STILL, *words], env=os.environ)
    until = time.monotonic() + PATIENCE_S
    while not (parts := list(into.glob("part-*.parquet"))):
        assert process.poll() is None, "it ended before its first rows were seen"
        assert time.monotonic() < until
        time.sleep(0.01)
    process.send_signal(signal.SIGKILL)
    assert process.wait() == -signal.SIGKILL
    before = {row["run"] for part in parts for row in parquet.read_table(part).to_pylist()}
    assert before
    assert main(words) == 0
    assert rows_of(into) == rows_of(whole)
    assert not list(into.glob("part-*"))


def test_two_worker_processes_bring_the_same_rows(whole: Path, tmp_path: Path) -> None:
    """A Dask scheduler and two workers on this machine, to the bit."""
    into = tmp_path / "rows"
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
    ) as cluster:
        words = ["study", str(written(tmp_path)), "--out", str(into), "--batch-size", "2"]
        assert main([*words, "--scheduler", cluster.scheduler_address]) == 0
    assert rows_of(into) == rows_of(whole)


def test_a_scheduler_that_is_lost(capfd: pytest.CaptureFixture[str]) -> None:
    """One sentence that names it, and no traceback of the client's own."""
    with (
        dask.config.set({"distributed.comm.timeouts.connect": "2s"}),
        distributed.LocalCluster(
            n_workers=1, threads_per_worker=1, protocol="tcp", dashboard_address=None
        ) as cluster,
    ):
        results = on_cluster(time.sleep, [0.0, 5.0], cluster.scheduler_address)
        next(results)
        cluster.sync(cluster.scheduler.close)
        with pytest.raises(InputError, match="connection to the Dask scheduler is lost"):
            list(results)
    assert "Traceback" not in capfd.readouterr().err


@pytest.mark.parametrize(
    ("address", "what"),
    [
        ("tcp:/nowhere", "it is no address"),
        ("foo", "it is no address"),
        ("tcp://127.0.0.1:9", "no Dask scheduler answers"),
    ],
)
def test_no_scheduler_there(
    address: str, what: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """One sentence, and no client is left behind to complain of itself."""
    words = ["study", str(written(tmp_path)), "--out", str(tmp_path / "rows")]
    assert main([*words, "--scheduler", address]) == 1
    gc.collect()
    reported = capsys.readouterr().err.splitlines()
    assert reported[-1].startswith(f"--scheduler {address}: {what}")


def test_a_folder_is_of_one_study_and_one_process(whole: Path, tmp_path: Path) -> None:
    study, _ = read_study(written(tmp_path, GOOD.replace("seconds: 2.0", "seconds: 3.0")))
    with pytest.raises(InputError, match="its rows are of another study, scene or solver"):
        StudyFolder(whole, study, "other")
    stamp = json.loads((whole / "study.json").read_text())["stamp"]
    with (
        StudyFolder(whole, study, stamp),
        pytest.raises(InputError, match="another process is at this study"),
    ):
        StudyFolder(whole, study, stamp)


@pytest.mark.parametrize("mark", [None, b"", b"{", b"[]", b"{}", b"\xff", b"null"])
def test_rows_whose_study_is_unknown_are_not_taken(
    whole: Path, tmp_path: Path, mark: bytes | None
) -> None:
    """A folder whose study.json was removed or edited between two runs."""
    study, _ = read_study(written(tmp_path))
    folder = Path(shutil.copytree(whole, tmp_path / "rows"))
    stamp = json.loads((whole / "study.json").read_text())["stamp"]
    if mark is None:
        (folder / "study.json").unlink()
    else:
        (folder / "study.json").write_bytes(mark)
    with pytest.raises(InputError, match=r"study\.json is missing or damaged"):
        StudyFolder(folder, study, stamp)


def test_rows_that_were_damaged_get_one_sentence(whole: Path, tmp_path: Path) -> None:
    study, _ = read_study(written(tmp_path))
    folder = Path(shutil.copytree(whole, tmp_path / "rows"))
    rows, stamp = folder / "runs.parquet", json.loads((whole / "study.json").read_text())["stamp"]
    good = rows.read_bytes()
    table = parquet.read_table(rows).drop_columns(["run"])
    parquet.write_table(table, tmp_path / "no_run")
    for bad in (b"", good[: len(good) // 2], b"run,top\n1,2", (tmp_path / "no_run").read_bytes()):
        rows.write_bytes(bad)
        with (
            StudyFolder(folder, study, stamp) as opened,
            pytest.raises(InputError, match=r"runs\.parquet: it holds no rows of a study"),
        ):
            opened.done()


def test_a_part_that_is_also_in_the_whole_counts_once(whole: Path, tmp_path: Path) -> None:
    """Killed after the whole was written and before its parts were removed."""
    study, _ = read_study(written(tmp_path))
    with StudyFolder(tmp_path / "rows", study, "s") as folder:
        rows = parquet.read_table(whole / "runs.parquet").to_pylist()
        folder.add(rows[:5])
        folder.close_rows()
        folder.add(rows[3:5])
        folder.add(rows[5:])
        assert folder.done() == set(range(12))
        folder.close_rows()
        assert folder.rows() == rows
