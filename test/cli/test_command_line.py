"""Wrong command lines: one sentence and exit code 2, or 1 if the line was read."""

from __future__ import annotations

import ctypes
import json
import os
import resource
import subprocess
import sys
from dataclasses import replace
from math import nan
from pathlib import Path

import pytest
from bag_samples import swell, write_heave

from rope_twin import cli
from rope_twin.cli import main
from rope_twin.errors import InputError
from rope_twin.run.options import RunOptions, check_against_scene
from rope_twin.scene.load import load_scene


@pytest.mark.parametrize(
    ("words", "reported"),
    [
        ("", "rope_twin: the following arguments are required: COMMAND"),
        ("rnu", "rope_twin: there is no 'rnu'; did you mean 'run'"),
        ("scene lst", "rope_twin scene: there is no 'lst'; did you mean 'list'"),
        ("run --hedless", "rope_twin run: unknown argument --hedless; did you mean '--headless'"),
        ("run one two", "rope_twin run: unknown argument two"),
        ("run --speed 1x", "rope_twin run: --speed: '1x' is not a number"),
        ("faults a --jobs 0.5", "rope_twin faults: --jobs: '0.5' is not a whole number"),
        (
            "run --duration 1km",
            "rope_twin run: --duration: '1km' is not a time; give a number in s",
        ),
        (
            "run --duration inf",
            "rope_twin run: --duration: 'inf' is not a time; give a number in s",
        ),
        (
            "run --duration nan",
            "rope_twin run: --duration: 'nan' is not a time; give a number in s",
        ),
        ("lines a --sea-state 9", "rope_twin lines: --sea-state: there is no '9'; known: 3, 4, 5"),
        ("run --cut -5@1", "rope_twin run: --cut: expected one argument (write a value"),
        ("run --budget 1% --within 1%", "rope_twin run: --within: not allowed with argument"),
    ],
)
def test_a_wrong_command_line_is_reported_in_one_line(
    words: str, reported: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        main(words.split())
    said = capsys.readouterr()
    assert ended.value.code == 2
    assert said.err.startswith(reported)
    assert said.err.count("\n") == 1
    assert not said.out
    assert "?" not in said.err
    assert said.err.endswith("--help`.\n")


def test_a_value_that_begins_with_minus_stands_behind_an_equals_sign(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["run", "still_water", "--within=-1%"]) == 1
    assert capsys.readouterr().err.startswith("--within -1%: tension_rms is in %; write a")


@pytest.mark.parametrize(
    ("words", "reported"),
    [
        ("view sea_1p2m --out {folder}", "--out {folder}: unknown file type; end it in .rrd or"),
        ("view sea_1p2m --out a.jpg", "--out a.jpg: unknown file type; end it in .rrd or .png"),
        ("scene measure still_water --duration 1e9", "--duration: 1e+09 s is too long; give at"),
        ("study sea_and_lod", "study 'sea_and_lod': there is no such study; did you mean 'sea_an"),
        ("viv bridle_lift --time-domain --duration 10", "its sea is not a regular heave"),
        ("viv load_transfer", "lines that end at a body which swings by itself are not assessed"),
        (
            "run still_water --duration 1ms",
            "--duration 0.001: the run would be shorter than one time",
        ),
        (
            "run --speed 0 --duration 1e-9",
            "--duration 1e-09: the run would be shorter than one tim",
        ),
        (
            "run still_water --sea-offset 5",
            "--sea-offset 5: there is no bag to start in: scene still",
        ),
        (
            "run smooth_2km --sea-offset 5",
            "--sea-offset 5: there is no bag to start in: scene smoot",
        ),
        (
            "ensemble deep_lift --members 2 --slack-interval 0 --vary time.step_s=1..2",
            "--slack-int",
        ),
    ],
)
def test_what_cannot_be_is_reported_before_anything_runs(
    words: str, reported: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([word.format(folder=tmp_path) for word in words.split()]) == 1
    said = capsys.readouterr()
    assert reported.format(folder=tmp_path) in said.err
    assert said.err.count("\n") == 1
    assert not said.out
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("duration", "end_s", "words"),
    [
        ("0.207", 0.22, "it is not a whole number of time steps of 0.01 s"),
        ("0.203", 0.2, "it is not a whole number of time steps of 0.01 s"),
        ("0.21", 0.22, "time steps of 0.01 s are taken 2 at a time"),
        ("0.2", 0.2, ""),
    ],
)
def test_a_run_that_cannot_end_when_asked_says_when_it_does(
    duration: str, end_s: float, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """The run was of another length than asked for, without a word."""
    options = [
        "run",
        "still_water",
        "--speed",
        "0",
        "--no-record",
        "--json",
        "--duration",
        duration,
    ]
    assert main(options) == 0
    said = capsys.readouterr()
    sentence = f"--duration {duration}: {words}; the run ends at {end_s:g} s.\n"
    assert (sentence in said.err) if words else ("--duration" not in said.err)
    assert json.loads(said.out.splitlines()[-1])["time_s"] == pytest.approx(end_s)


def test_a_start_in_a_bag_is_taken_where_there_is_one() -> None:
    """A bag or poses that are named, or those of the scene."""
    still, deep = load_scene("still_water"), load_scene("deep_lift")
    asked = RunOptions(sea_offset_s=5.0)
    for options, scene in (
        (asked, deep),
        (replace(asked, bag="sea_1p2m"), still),
        (replace(asked, poses="my_poses"), still),
    ):
        assert check_against_scene(options, scene) == ""
    with pytest.raises(InputError, match="--sea-offset 5"):
        check_against_scene(asked, still)


def test_a_folder_in_place_of_a_recording_is_not_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("rerun")
    folder = tmp_path / "lift.rrd"
    folder.mkdir()
    assert main(["view", "sea_1p2m", "--out", str(folder)]) == 1
    assert f"file {folder}: it cannot be written (Is a directory)" in capsys.readouterr().err
    assert not list(folder.iterdir())


def test_ctrl_c_while_a_command_is_loaded_ends_quietly(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted(name: str) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(cli, "_command", interrupted)
    assert main(["run"]) == 130
    assert capsys.readouterr() == ("", "")


def test_ctrl_c_in_a_callback_of_the_compiler_ends_quietly(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """ctypes swallows the interrupt there, and numba fails for want of what the callback does."""

    @ctypes.CFUNCTYPE(None)
    def callback() -> None:
        raise KeyboardInterrupt

    def compiled(name: str) -> None:
        callback()
        raise RuntimeError("no compiled object yet")

    monkeypatch.setattr(cli, "_command", compiled)
    assert main(["run"]) == 130
    assert capsys.readouterr() == ("", "")


def test_a_folder_in_place_of_a_file_is_called_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "mine").mkdir()
    monkeypatch.chdir(tmp_path)
    for command in (["scene", "check"], ["run"], ["study"]):
        assert main([*command, "mine"]) == 1
        assert capsys.readouterr().err == "mine: it is a folder; give the path of a YAML file.\n"


def refused(tmp_path: Path, *words: str, output: str) -> str:
    """Return the output of a command where files of over 20 kB are refused, as by a full disk."""

    def small_files() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, resource.RLIM_INFINITY))

    with Path(output).open("w") as stream:
        done = subprocess.run(
            [sys.executable, "-m", "rope_twin", *words], stdout=stream,
            stderr=subprocess.PIPE, preexec_fn=small_files, cwd=tmp_path, timeout=120, check=False,
            env={**os.environ, "PYTHONDONTWRITEBYTECODE": "1"},  # it would be cut at 20 kB too
        )  # fmt: skip
    assert done.returncode == 1
    said = done.stderr.decode()
    assert "Traceback" not in said
    own = [line for line in said.splitlines() if not line.startswith("\x1b")]  # rerun's: coloured
    return own[-1]


@pytest.mark.parametrize("words", ["scene keys", "scene list"])
def test_an_output_that_takes_nothing_is_reported_in_one_sentence(
    words: str, tmp_path: Path
) -> None:
    reported = refused(tmp_path, *words.split(), output="/dev/full")
    assert reported == "output: No space left on device; free space there, or name another place."


def test_a_picture_of_a_bag_that_finds_no_room_is_reported_in_one_sentence(tmp_path: Path) -> None:
    pytest.importorskip("rerun")
    reported = refused(tmp_path, "view", "sea_1p2m", "--out", "view.rrd", output="/dev/null")
    assert "file view.rrd: it cannot be written (" in reported


@pytest.mark.parametrize("kept", ["out", "save-state"])
def test_a_run_whose_bag_or_state_finds_no_room_does_not_end_as_if_it_had(
    kept: str, tmp_path: Path
) -> None:
    words = ["run", "still_water", "--speed", "0", "--duration", "20", f"--{kept}", "kept"]
    words += ["--no-record"] if kept == "save-state" else []
    reported = refused(tmp_path, *words, output="/dev/null")
    assert "kept" in reported
    assert "(File too large)" in reported


def test_what_was_wrong_with_a_sea_is_reported_where_no_node_tells_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = [(at, nan if number == 9 else z, v) for number, (at, z, v) in enumerate(swell())]
    bag = write_heave(tmp_path / "bag", rows)
    words = f"run still_water --speed 0 --duration 1 --no-record --bag {bag}"
    assert main(words.split()) == 0
    assert "skipped 1 of 400 samples (1 not finite)" in capsys.readouterr().err


@pytest.mark.parametrize("entry", ["rope_twin.cli", "rope_twin.ros.simulation_node"])
def test_matrices_take_one_thread_unless_the_user_asks_for_more(entry: str) -> None:
    """A node or command is one thread of numpy's after a product; OpenBLAS would start others."""
    script = (
        "import os\n"
        f"import {entry}\n"
        "import numpy as np\n"
        "before = len(os.listdir('/proc/self/task'))\n"
        "square = np.ones((600, 600)) @ np.ones((600, 600))\n"
        "print(os.environ['OPENBLAS_NUM_THREADS'], len(os.listdir('/proc/self/task')) - before)\n"
    )
    for chosen, expected in ((None, "1"), ("2", "2")):
        environment = {k: v for k, v in os.environ.items() if k != "OPENBLAS_NUM_THREADS"}
        if chosen:
            environment["OPENBLAS_NUM_THREADS"] = chosen
        done = subprocess.run(
            [sys.executable, "-c", script],
            env=environment,
            capture_output=True,
            text=True,
            check=True,
        )
        threads, more = done.stdout.split()
        assert threads == expected
        assert chosen or int(more) == 0
