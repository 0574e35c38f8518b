"""`run --save-state`, `--from-state` and `state info`: two halves equal the whole; faults."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from rope_twin import Twin, load_scene
from rope_twin.cli import main
from rope_twin.recording.bag import BagReader
from rope_twin.run.options import RunOptions
from rope_twin.run.summary import RunSummary
from rope_twin.run.unpaced import run_unpaced
from rope_twin.topics import MEASURED_ELEVATION, MEASURED_TOPICS, TOPICS, WINCH_TOPICS
from rope_twin.twin.state import load_state

SCENE = "shallow_lift"
EPOCH_NS = 10**18
# Not compared: computing times; epoch and session, which every bag begins with; the log of inputs,
# which is numbered by session.
OF_ONE_BAG = ("diagnostics", "alerts", "twin/epoch", "winch/seat", "twin/session", "twin/inputs")
# by a scene of heave and speeds only, with no bed, no topic of current and no error interval
NOT_REPORTED = {
    "current", "ship/odometry", "lower_end/odometry", "seabed/contact", "ropes/vibration",
    "ropes/fatigue", "ropes/cut", *WINCH_TOPICS, *MEASURED_TOPICS, MEASURED_ELEVATION,
    "estimate/figures", "estimate/alarms", "alerts/command",
    "forecast/tension", "forecast/ropes", "forecast/risk", "forecast/quiet", "forecast/what_if",
    "forecast/orders",
} - {"winch/speed_command"}  # fmt: skip
COMPARED = [topic.name for topic in TOPICS if topic.name not in OF_ONE_BAG and not topic.only_with]


def command(*words: str) -> list[str]:
    return [sys.executable, "-m", "rope_twin", "run", "--speed", "0", *words]


def messages(bag: Path, topics: Sequence[str]) -> dict[str, list[tuple[int, bytes]]]:
    with BagReader(bag) as reader:  # once: it takes 0.2 s
        return {topic: list(reader.messages(f"/{topic}")) for topic in topics}


@dataclass(frozen=True)
class Runs:
    """A run of 4 s, and its first 1.5 s with the state that they were saved to."""

    folder: Path
    saved: Path
    whole: RunSummary


def run(record: Path, end_s: float, save: Path | None, start_from: Path | None) -> RunSummary:
    """Here, with one epoch for all."""
    options = RunOptions(
        scene=SCENE, end_s=end_s, speed=0.0, record=record, save=save, start_from=start_from
    )
    summary = run_unpaced(options, lambda run: None, EPOCH_NS)
    assert not summary.error
    return summary


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Runs:
    folder = tmp_path_factory.mktemp("runs")
    saved = folder / "first.state"
    whole = run(folder / "whole", 4.0, None, None)
    assert run(folder / "first", 1.5, saved, None).state == str(saved)
    return Runs(folder, saved, whole)


def test_two_bags_are_the_one_of_a_run_without_interruption(runs: Runs) -> None:
    """Every message of every topic, inputs included, none twice and none missing."""
    run(runs.folder / "second", 4.0, None, runs.saved)
    whole, first, second = (
        messages(runs.folder / name, COMPARED) for name in ("whole", "first", "second")
    )
    for topic in COMPARED:
        assert first[topic] + second[topic] == whole[topic]
        assert (first[topic] and second[topic]) or topic in NOT_REPORTED


def test_another_process_goes_on(runs: Runs) -> None:
    """The figures of the last line, means and counts of inputs included; the scene is found."""
    done = subprocess.run(
        command("--json", "--no-record", "--from-state", str(runs.saved), "--duration", "2.5s"),
        check=True, capture_output=True, text=True,
    )  # fmt: skip
    found = json.loads(done.stdout.splitlines()[-1])
    expected = json.loads(runs.whole.as_json())
    for key in expected.keys() - {"real_time_factor", "bag"}:
        assert found[key] == expected[key], key
    assert found["steps"] == 400


def test_ctrl_c_saves_a_whole_state(tmp_path: Path) -> None:
    """In the middle of a long run; what is saved goes on."""
    saved = tmp_path / "interrupted.state"
    process = subprocess.Popen(
        command(SCENE, "--duration", "1e6", "--no-record", "--save-state", str(saved)),
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert process.stderr is not None
    assert "line out" in process.stderr.readline()  # the progress line: it runs
    time.sleep(0.3)
    process.send_signal(signal.SIGINT)
    out, error = process.communicate(timeout=60)
    assert process.returncode == 0, error
    assert f"state {saved}" in out
    twin = Twin.restore(saved, load_scene(SCENE))
    assert twin.steps > 0
    assert twin.steps % 2 == 0, "a slot is two steps, and none was left half done"
    twin.advance(100)


def test_info_tells(runs: Runs, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["state", "info", str(runs.saved)]) == 0
    reported = capsys.readouterr().out
    for words in ("shallow_lift", "1.500 s, 150 time steps of 0.01 s", "checksum correct", "nodes"):
        assert words in reported
    assert main(["state", "info", str(runs.saved), "--json"]) == 0
    about = json.loads(capsys.readouterr().out)
    assert about["time_s"] == 1.5
    assert about["arrays"]["rope/state/nodes"][0] >= 9


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["--from-state", "FILE", "--duration", "1ms"], "--duration 0.001: the run would be sh"),
        (["--from-state", "FILE", "--duration", "1", "--cut", "9@1"], "the run goes from 1.5 s to"),
        (
            ["--from-state", "none.state", "--duration", "9"],
            "saved state none.state: it cannot be read",
        ),
        (
            ["storm", "--from-state", "FILE", "--duration", "9", "--no-record"],
            "it is of another scene",
        ),
        (
            ["--save-state", "none/x.state", "--duration", "9"],
            "--save-state none/x.state: it cannot be written",
        ),
        (["--save-state", ".", "--duration", "9"], "--save-state .: it cannot be written"),
    ],
)
def test_faults_are_reported_in_one_sentence(
    runs: Runs, words: list[str], sentence: str, capsys: pytest.CaptureFixture[str]
) -> None:
    given = [str(runs.saved) if word == "FILE" else word for word in words]
    assert main(["run", "--speed", "0", *given]) == 1
    reported = capsys.readouterr()
    assert sentence in reported.err
    assert reported.err.count("\n") == 1
    assert not reported.out


def test_info_of_no_state_is_one_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "x").write_text("x")
    assert main(["state", "info", str(tmp_path / "x")]) == 1
    assert "it is no saved state" in capsys.readouterr().err


def test_a_solver_that_gives_up_names_the_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Beside the bag; the state to go on from is not touched by one that goes nowhere."""
    from math import nan

    import rope_twin.twin.ropes as twin_module

    real = twin_module.advance

    def spoilt(rope: Any, boundary: Any, pull: Any, time_s: float, steps: int) -> int:
        if time_s >= 0.5:
            effects = tuple(e._replace(g=nan) if hasattr(e, "g") else e for e in rope.effects)
            rope = rope._replace(effects=effects)
        return int(real(rope, boundary, pull, time_s, steps))

    monkeypatch.setattr(twin_module, "advance", spoilt)
    options = RunOptions(
        scene=SCENE, end_s=1.0, speed=0.0, record=tmp_path / "bag", save=tmp_path / "good.state"
    )
    summary = run_unpaced(options, lambda run: None)
    kept = tmp_path / f"{SCENE}_failed_step_51.state"
    assert summary.error.endswith(f"state and inputs of that step are in {kept}.")
    assert summary.state is None
    assert load_state(kept).about.failure.startswith("step 51 at 0.50 s: ")
    assert not (tmp_path / "good.state").exists()


def test_a_state_whose_scene_was_moved_says_where_it_was(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Its name alone was looked for, among the scenes of the package."""
    here, there = tmp_path / "mine.yaml", tmp_path / "moved.yaml"
    here.write_bytes(load_scene("still_water").path.read_bytes())
    saved = ["--save-state", str(tmp_path / "state")]
    assert main(["run", str(here), "--speed", "0", "--duration", "1", "--no-record", *saved]) == 0
    here.rename(there)
    go_on = [
        "--from-state",
        str(tmp_path / "state"),
        "--speed",
        "0",
        "--duration",
        "1",
        "--no-record",
    ]
    assert main(["run", *go_on]) == 1
    reported = f"--from-state: its scene {here} does not exist; give the path of the scene too."
    assert reported in capsys.readouterr().err
    assert main(["run", str(there), *go_on]) == 0
