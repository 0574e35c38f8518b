"""`rope_twin run` as people start it: options, summary, Ctrl-C, exit codes."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from ros_bench import PATIENCE_S
from ros_process import Processes

from rope_twin.cli import main
from rope_twin.recording.bag import BagReader
from rope_twin.scene.load import load_scene
from rope_twin.topics import TOPICS

KEYS = {
    "scene", "effects", "elements", "step_s", "steps", "late_steps", "real_time_factor",
    "tension_top_max_n", "tension_top_mean_n", "tension_top_min_n", "line_out_m",
    "payload_depth_m", "bag",
}  # fmt: skip
SIGNALS = [
    signal.SIGINT, signal.SIGTERM, pytest.param(signal.SIGHUP, marks=pytest.mark.long),
]  # fmt: skip
RATES = {topic.name: topic.rate_hz for topic in TOPICS if topic.publisher == "simulation"}


def last_line(text: str) -> dict[str, object]:
    summary = json.loads(text.strip().splitlines()[-1])
    assert isinstance(summary, dict)
    return summary


def counts(bag: Path) -> dict[str, int]:
    with BagReader(bag) as reader:
        return {name: content.messages for name, content in reader.topics.items()}


def run(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "rope_twin", *arguments],
        capture_output=True, text=True, timeout=PATIENCE_S, check=False,
    )  # fmt: skip


@pytest.mark.ros
def test_a_paced_run_ends_by_itself_with_summary_bag_and_view(
    processes: Processes, tmp_path: Path
) -> None:
    bag = tmp_path / "bag"
    process = processes.early(
        "run", "shallow_lift", "--duration", "3", "--headless", "--json", "--out", str(bag)
    )
    assert process.wait() == 0
    summary = last_line(process.text)
    assert set(summary) >= KEYS
    assert summary["scene"] == "shallow_lift"
    assert summary["effects"] == ["current", "weight", "drag", "added_mass", "payload"]
    assert summary["steps"] == 300
    assert summary["step_s"] == 0.01
    assert summary["bag"] == str(bag)
    assert summary["heave_refused"] == summary["commands_refused"] == 0
    low, mean, high = (summary[f"tension_top_{word}_n"] for word in ("min", "mean", "max"))
    assert 1e5 < low < mean < high < 3e5  # type: ignore[operator]
    assert 190.0 < summary["payload_depth_m"] < 210.0  # type: ignore[operator]
    recorded = counts(bag)
    for name in ("ropes/tension_top", "payloads/state", "ropes/length", "hang_off/wrench"):
        assert recorded[f"/{name}"] == 150
    for name in ("ropes/element_tension", "ropes/nodes", "ropes/markers"):
        assert recorded[f"/{name}"] == 75
    assert recorded["/ship/heave"] >= 60
    assert recorded["/winch/speed_command"] >= 30
    assert recorded["/twin/epoch"] == 1
    assert recorded["/diagnostics"] >= 3
    assert "view written to" in process.text
    assert (tmp_path / "bag.rrd").stat().st_size > 10_000


@pytest.mark.ros
@pytest.mark.parametrize("number", SIGNALS)
def test_ctrl_c_ends_it_with_a_whole_bag_and_a_summary(
    number: int, processes: Processes, tmp_path: Path
) -> None:
    """And so does being reported to end, and a terminal that closes."""
    bag = tmp_path / "bag"
    process = processes.cli("run", "shallow_lift", "--headless", "--out", str(bag))
    process.until_says("late")  # the progress line
    process.send(number)
    assert process.wait() == 0
    assert "Traceback" not in process.text
    assert "scene shallow_lift" in process.text
    assert f"bag {bag}" in process.text
    assert (bag / "metadata.yaml").is_file()
    recorded = counts(bag)
    assert recorded["/twin/epoch"] == 1
    assert recorded["/ropes/nodes"] in (
        recorded["/ropes/tension_top"] // 2,
        (recorded["/ropes/tension_top"] + 1) // 2,
    )


@pytest.mark.ros
def test_ctrl_c_while_it_is_still_building_ends_it_too(processes: Processes) -> None:
    process = processes.cli("run", "shallow_lift", "--headless", "--no-record")
    process.until_says("building the twin")
    process.send(signal.SIGINT)
    assert process.wait() in (0, 130)
    assert "Traceback" not in process.text


@pytest.mark.ros
def test_a_second_ctrl_c_ends_it_at_once(processes: Processes) -> None:
    process = processes.cli("run", "shallow_lift", "--headless", "--no-record")
    process.until_says("building the twin")
    process.send(signal.SIGINT)
    process.send(signal.SIGINT)
    assert process.wait() in (0, 130, -signal.SIGINT)
    assert "Traceback" not in process.text


@pytest.mark.ros
def test_recording_can_be_left_out_and_another_sea_be_played(processes: Processes) -> None:
    process = processes.cli(
        "run", "shallow_lift", "--duration", "1", "--headless", "--json", "--no-record",
        "--bag", "sea_6p5m", "--sea-offset", "60", "--topic", "ship/heave",
    )  # fmt: skip
    assert process.wait() == 0
    summary = last_line(process.text)
    assert summary["bag"] is None
    assert summary["view"] is None
    assert summary["heave_accepted"] > 0  # type: ignore[operator]


@pytest.mark.ros
def test_twice_real_time_takes_the_same_steps(processes: Processes) -> None:
    process = processes.early(
        "run",
        "shallow_lift",
        "--duration",
        "4",
        "--headless",
        "--json",
        "--no-record",
        "--speed",
        "2",
    )
    assert process.wait() == 0
    summary = last_line(process.text)
    assert summary["steps"] == 400
    assert summary["heave_refused"] == 0
    assert summary["heave_accepted"] >= 80  # type: ignore[operator]


@pytest.mark.ros
def test_a_budget_is_spent_and_its_use_reported(processes: Processes) -> None:
    """How fine a setting it selects, and whether it can be kept, depends on the machine."""
    process = processes.cli(
        "run", "shallow_lift", "--duration", "2", "--headless", "--json", "--no-record",
        "--budget", "20%",
    )  # fmt: skip
    assert process.wait() == 0
    summary = last_line(process.text)
    step_s = summary["step_s"]
    assert isinstance(step_s, float)
    assert round(0.02 / step_s) * step_s == pytest.approx(0.02)
    share = summary["core_share"]
    assert isinstance(share, dict)
    assert share["asked_pct"] == 20.0
    assert share["calibrated_pct"] > 0.0
    assert 0.0 < share["steps_pct"] < share["process_pct"]
    assert 0.0 < share["publishing_pct"] < share["process_pct"]
    assert re.match(r"--budget 20 %: \d+ elements at [\d.]+ ms, ", str(summary["chosen"]))
    if not summary["level_changes"]:
        assert summary["tension_top_error_pct"] is not None, summary["tension_top_error_reason"]


@pytest.mark.parametrize("number", SIGNALS)
def test_what_ends_a_run_as_fast_as_possible_leaves_a_whole_bag(
    number: int, processes: Processes, tmp_path: Path
) -> None:
    bag = tmp_path / "bag"
    process = processes.cli(
        "run", "still_water", "--speed", "0", "--duration", "1e6", "--out", str(bag)
    )
    process.until_says("late")
    process.send(number)
    assert process.wait() == 0
    assert "scene still_water" in process.text
    assert counts(bag)["/twin/epoch"] == 1


@pytest.mark.ros
@pytest.mark.parametrize("processes_too", [False, pytest.param(True, marks=pytest.mark.long)])
def test_a_bag_and_a_state_that_find_no_room_are_reported_at_the_end(
    processes_too: bool, processes: Processes, tmp_path: Path
) -> None:
    bag, state = tmp_path / "bag", tmp_path / "state"
    words = ["run", "still_water", "--duration", "3", "--headless", "--json", "--out", str(bag)]
    words += ["--save-state", str(state), *(["--processes"] if processes_too else [])]
    script = (  # files of more than 20 kB are refused, as by a full disk
        "import os, resource, sys\n"
        "os.environ['PYTHONDONTWRITEBYTECODE'] = '1'\n"  # it would be cut at 20 kB too
        "sys.dont_write_bytecode = True\n"
        "from rope_twin.cli import main\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, resource.RLIM_INFINITY))\n"
        "sys.exit(main(sys.argv[1:]))\n"
    )
    process = processes.start(["-c", script, *words])
    assert process.wait() == 1
    assert "Traceback" not in process.text
    summary = last_line(re.findall(r"^\{.*\}$", process.text, re.MULTILINE)[0])
    assert summary["steps"] == 300
    assert process.text.count("wait in memory; make room") == 1, "not each second again"
    assert f"bag {bag}: " in str(summary["not_kept"])
    assert f"`rope_twin recover {bag}`" in str(summary["not_kept"])
    assert str(state) in str(summary["not_kept"])
    assert summary["state"] is None
    assert summary["view"] is None


@pytest.mark.ros
@pytest.mark.parametrize("processes_too", [False, pytest.param(True, marks=pytest.mark.long)])
def test_a_bag_that_is_deleted_is_noticed_and_the_run_ends_with_exit_code_1(
    processes_too: bool, processes: Processes, tmp_path: Path
) -> None:
    bag = tmp_path / "bag"
    words = ["run", "still_water", "--headless", "--json", "--out", str(bag)]
    process = processes.cli(*words, *(["--processes"] if processes_too else []))
    process.until_says("late")
    shutil.rmtree(bag)
    process.until_says("was deleted or moved while it was being recorded", 10.0)
    process.send(signal.SIGINT)
    assert process.wait() == 1
    assert "Traceback" not in process.text
    summary = last_line(re.findall(r"^\{.*\}$", process.text, re.MULTILINE)[0])
    assert f"bag {bag}: " in str(summary["not_kept"])
    assert summary["bag"] is None


def test_as_fast_as_possible_needs_no_ros(tmp_path: Path) -> None:
    script = (
        "import sys\n"
        "from rope_twin.cli import main\n"
        f"code = main(['run', 'shallow_lift', '--speed', '0', '--duration', '1', '--json',"
        f" '--out', {str(tmp_path / 'bag')!r}])\n"
        "assert 'rclpy' not in sys.modules\n"
        "assert not any(name.startswith('rope_twin.ros') for name in sys.modules)\n"
        "sys.exit(code)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", script],
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    summary = last_line(done.stdout)
    assert set(summary) >= KEYS
    assert summary["steps"] == 100
    assert counts(tmp_path / "bag")["/ropes/tension_top"] == 50


@pytest.mark.parametrize(
    "speed", ["0", pytest.param("1", marks=pytest.mark.ros)], ids=["unpaced", "paced"]
)
def test_a_solver_that_gives_up_ends_the_run_with_its_sentence_and_the_bag(
    domain: int, tmp_path: Path, speed: str
) -> None:
    script = (
        "import sys\n"
        "from rope_twin.cli import main\n"
        "from rope_twin.errors import SolverError\n"
        "from rope_twin.twin.twin import Twin\n"
        "advance = Twin.advance\n"
        "def give_up(self, steps):\n"
        "    if self.steps >= 50:\n"
        "        raise SolverError('step 51: the next state is not finite; shorten the step.')\n"
        "    advance(self, steps)\n"
        "Twin.advance = give_up\n"
        "sys.exit(main(sys.argv[1:]))\n"
    )
    bag = tmp_path / "bag"
    done = subprocess.run(
        [sys.executable, "-c", script, "run", "shallow_lift", "--duration", "5", "--json",
         "--headless", "--speed", speed, "--out", str(bag)],
        capture_output=True, text=True, timeout=PATIENCE_S, check=False,
    )  # fmt: skip
    assert done.returncode == 1, done.stderr
    assert "step 51: the next state is not finite" in done.stderr
    assert "Traceback" not in done.stderr
    summary = last_line(done.stdout)
    assert summary["steps"] == 50
    assert "not finite" in str(summary["error"])
    assert counts(bag)["/ropes/tension_top"] == 25


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["run", "deep_lfit", "--speed", "0", "--duration", "1"], "did you mean 'deep_lift'"),
        (["run", "--speed", "0"], "--duration"),
        (["run", "--speed", "-1"], "it must be 0 (as fast as possible) or 0.01 to 5"),
        (["run", "--speed", "nan"], "it must be 0 (as fast as possible) or 0.01 to 5"),
        (["run", "--duration", "0"], "above 0 s"),
        (["run", "--sea-offset", "-3"], "at least 0 s"),
        (["run", "--speed", "0", "--duration", "1", "--processes"], "without ROS"),
        (["run", "--speed", "0", "--duration", "1", "--bag", "no_such_sea"], "no_such_sea"),
    ],
)
def test_what_cannot_be_run_gets_one_sentence_and_exit_code_1(
    arguments: list[str],
    words: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(arguments) == 1
    out, err = capfd.readouterr()
    assert words in err
    assert len(err.strip().splitlines()) == 1
    assert out == ""
    assert list(tmp_path.iterdir()) == []  # nothing was made on disk for nothing


def test_a_process_that_cannot_run_says_no_more_than_its_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([os.getcwd(), *sys.path[:0]]))
    monkeypatch.chdir(tmp_path)
    done = run("run", "no_such_scene", "--headless")
    assert done.returncode == 1
    assert "there is no such scene" in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    assert done.stdout == ""
    assert list(tmp_path.iterdir()) == []  # nothing was made on disk for nothing


def test_a_bag_directory_in_use_is_refused(tmp_path: Path) -> None:
    (tmp_path / "precious").write_text("data", encoding="utf-8")
    done = run("run", "shallow_lift", "--speed", "0", "--duration", "1", "--out", str(tmp_path))
    assert done.returncode == 1
    assert "holds something" in done.stderr


@pytest.mark.parametrize("words", [["--version"], ["run", "--help"]])
def test_version_and_help_come_without_numba(words: list[str]) -> None:
    """Help comes without ROS too; the version names its middleware, which has to be loaded."""
    script = (
        "import sys\n"
        "from rope_twin.cli import main\n"
        "try:\n"
        "    main(sys.argv[1:])\n"
        "except SystemExit as end:\n"
        "    assert end.code == 0\n"
        "assert 'numba' not in sys.modules\n"
        "assert 'rclpy' not in sys.modules or sys.argv[1:] == ['--version']\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", script, *words],
        capture_output=True, text=True, timeout=PATIENCE_S, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "rope_twin" in done.stdout


def test_every_command_is_in_the_help_and_an_unknown_one_is_refused() -> None:
    done = run("--help")
    assert done.returncode == 0
    for name in ("run", "scene", "view", "recover", "sea-state"):
        assert f"\n    {name}" in done.stdout
    assert run("rnu").returncode == 2
    assert run().returncode == 2


@pytest.mark.parametrize("how", [(), pytest.param(("--processes",), marks=pytest.mark.long)])
def test_a_broken_limit_ends_a_paced_run_with_code_4(
    how: tuple[str, ...], processes: Processes, tmp_path: Path
) -> None:
    """And not early: it says so on the way, and again in its last line."""
    text = load_scene("still_water").path.read_text(encoding="utf-8")
    path = tmp_path / "limited.yaml"
    path.write_text(f"{text}\nlimits: {{tension_n: 200000.0}}\n", encoding="utf-8")
    process = processes.cli("run", str(path), "--duration", "2", "--headless", "--json",
                            "--no-record", *how)  # fmt: skip
    assert process.wait() == 4
    assert "limit violated: tension of 'hoist' 210.4 kN" in process.text
    summary = last_line(process.text)
    assert summary["steps"] == 200
    (broken,) = summary["limits_broken"]  # type: ignore[misc]
    assert (broken["limit"], broken["first_s"]) == ("tension_n", 0.0)
