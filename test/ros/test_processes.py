"""The nodes as processes of their own: listened to from here, ended, and killed."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ros_bench import PATIENCE_S, Bench
from ros_messages import BAD
from ros_process import Process, Processes, until_running

from rope_twin.recording.bag import BagReader
from rope_twin.ros import processes as ros_processes
from rope_twin.ros.entry import BEGUN, begun_note
from rope_twin.ros.processes import node_command
from rope_twin.run.options import RunOptions

pytestmark = pytest.mark.ros
SCENE = "shallow_lift"
# Discovery takes up to seconds; only the recorder listens to ropes/markers in these tests.
EVERYBODY = {"wait_for": "ropes/markers", "wait_for_s": 60.0}
ENTRIES = ("simulation", "sea_state", "winch_schedule", "recorder", "viewer")


def test_the_run_command_starts_watches_and_ends_them(
    bench: Bench, processes: Processes, tmp_path: Path
) -> None:
    heard = {name: bench.listen(name) for name in
             ("ropes/tension_top", "payloads/state", "ropes/markers", "ropes/length")}  # fmt: skip
    bag = tmp_path / "bag"
    process = processes.early(
        "run", SCENE, "--processes", "--duration", "4", "--headless", "--json", "--out", str(bag)
    )
    bench.until(lambda: process.ended, "its end")
    assert process.wait() == 0
    summary = json.loads(process.text.strip().splitlines()[-1])
    assert summary["steps"] == 400
    assert summary["heave_refused"] == summary["commands_refused"] == 0
    assert summary["heave_accepted"] >= 80
    assert summary["commands_accepted"] >= 40
    assert summary["bag"] == str(bag)
    top = np.array([message.effort[0] for message in heard["ropes/tension_top"]])
    assert len(top) > 50  # nobody waited for this listener
    assert (top > 1e5).all()
    assert top.std() > 0.0
    assert -210.0 < heard["payloads/state"][-1].transforms[0].translation.z < -190.0
    assert len(heard["ropes/markers"][-1].markers) >= 3
    with BagReader(bag) as reader:
        counts = {name: content.messages for name, content in reader.topics.items()}
    assert counts["/ropes/tension_top"] == 200  # it waited for the recorder: nothing is missing
    assert counts["/ropes/nodes"] == 100
    assert (tmp_path / "bag.rrd").stat().st_size > 10_000


@pytest.mark.long
def test_ctrl_c_ends_all_processes_and_the_bag_is_whole(
    processes: Processes, tmp_path: Path
) -> None:
    import psutil

    bag = tmp_path / "bag"
    process = processes.cli("run", SCENE, "--processes", "--headless", "--out", str(bag))
    process.until_says("late")
    children = psutil.Process(process.popen.pid).children(recursive=True)
    assert len(children) >= 5
    process.send(signal.SIGINT)
    assert process.wait() == 0
    assert "Traceback" not in process.text
    assert not any(child.is_running() for child in children)
    assert (bag / "metadata.yaml").is_file()


def test_a_process_that_is_asked_to_end_is_restarted_too(
    processes: Processes, tmp_path: Path
) -> None:
    """A SIGTERM ends a node with code 0, as does the last step of a run, which this one has not."""
    import psutil

    bag = tmp_path / "bag"
    process = processes.cli("run", SCENE, "--processes", "--headless", "--out", str(bag))
    process.until_says("late")
    for name, continues in (
        ("viewer", rf"the view continues in {tmp_path / 'bag_2.rrd'}"),
        ("simulation", "restarted"),
    ):
        (node,) = (
            child for child in psutil.Process(process.popen.pid).children(recursive=True)
            if f"rope_twin.ros.{name}_node" in child.cmdline()
        )  # fmt: skip
        node.send_signal(signal.SIGKILL if name == "viewer" else signal.SIGTERM)
        process.until_says(rf"the {name} process ended \([^)]*\); {continues}")
    process.until_says(r"restarted\n(.*\n)* +[1-9][\d.]* s  line out")
    process.send(signal.SIGINT)
    assert process.wait() == 0


@pytest.mark.parametrize("begun", [False, True])
def test_a_node_that_could_not_begin_is_not_restarted_however_long_it_took(
    monkeypatch: pytest.MonkeyPatch, begun: bool
) -> None:
    """Each start would end in the same way, also on a machine that takes a minute for it."""
    folders: list[str] = []

    class Ended:
        """Takes the place of a process that has ended with an error of its own."""

        pid = 77

        def __init__(self, command: list[str], env: dict[str, str], **options: Any) -> None:
            folders.append(env[BEGUN])

        def poll(self) -> int:
            return 1

        def kill(self) -> None:
            """Do nothing: no process runs."""

        wait = kill

    monkeypatch.setattr(subprocess, "Popen", Ended)
    made = ros_processes.Processes(RunOptions(scene=SCENE, console="127.0.0.1:8420"))
    now_s = time.monotonic()
    monkeypatch.setattr(time, "monotonic", lambda: now_s + 60.0)
    if begun:
        begun_note(folders[0], Ended.pid).touch()
    assert made.ended()["console"] == 1
    if begun:
        assert made.restart("console", 1, stepping=True).endswith("restarted")
    else:
        with pytest.raises(ros_processes.NotRestarted, match="it could not start"):
            made.restart("console", 1, stepping=True)
    made.close()


def test_a_bag_directory_in_use_is_refused_before_any_process_starts(
    processes: Processes, tmp_path: Path
) -> None:
    (tmp_path / "bag").mkdir()
    (tmp_path / "bag" / "bag_0.mcap").write_bytes(b"of another run")
    process = processes.cli("run", SCENE, "--processes", "--headless", "--out",
                            str(tmp_path / "bag"))  # fmt: skip
    assert process.wait() == 1
    (line,) = process.text.strip().splitlines()
    assert "bag: the directory holds something" in line


def test_nodes_do_not_outlive_a_killed_run_command(processes: Processes) -> None:
    import psutil

    process = processes.cli("run", SCENE, "--processes", "--headless", "--no-record")
    process.until_says("late")
    children = psutil.Process(process.popen.pid).children(recursive=True)
    assert len(children) >= 3
    process.send(signal.SIGKILL)
    process.wait()
    _, alive = psutil.wait_procs(children, timeout=PATIENCE_S)
    assert alive == []


def test_killed_recorder_loses_little_and_the_twin_does_not_notice(
    bench: Bench, processes: Processes, tmp_path: Path
) -> None:
    odometry = bench.listen("payloads/state")
    recorder = processes.node("recorder", out=str(tmp_path / "bag"))
    recorder.until_says("recording to")
    simulation = processes.node("simulation", scene=SCENE, **EVERYBODY)
    bench.until(lambda: len(odometry) >= 150, "three seconds of the run")
    recorder.send(signal.SIGKILL)
    recorder.wait()
    newest = stamp_ns(odometry[-1])
    until_running(bench, odometry, "the twin goes on")
    assert not simulation.ended
    done = subprocess.run(
        [sys.executable, "-m", "rope_twin", "recover", str(tmp_path / "bag")],
        capture_output=True, text=True, timeout=PATIENCE_S, check=False,
    )  # fmt: skip
    assert done.returncode in (0, 3), done.stderr
    bags = [path.parent for path in tmp_path.glob("*/metadata.yaml")]
    assert len(bags) == 1
    with BagReader(bags[0]) as reader:
        from rope_twin.messages import decode

        kept = [decode("payloads/state", data) for _, data in reader.messages("/payloads/state")]
    assert newest - stamp_ns(kept[-1]) < 1_000_000_000
    simulation.send(signal.SIGINT)
    assert simulation.wait() == 0


def test_killed_simulation_is_started_again_and_is_fed_again(
    bench: Bench, processes: Processes, tmp_path: Path
) -> None:
    odometry, epochs = bench.listen("payloads/state"), bench.listen("twin/epoch")
    recorder = processes.node("recorder", out=str(tmp_path / "bag"))
    sea = processes.node("sea_state", scene=SCENE)
    winch = processes.node("winch_schedule", scene=SCENE)
    viewer = processes.node("viewer", file=str(tmp_path / "run.rrd"))
    first = processes.node("simulation", scene=SCENE, **EVERYBODY)
    bench.until(lambda: len(odometry) >= 50, "a second of the run")
    first.send(signal.SIGKILL)
    assert first.wait() == -signal.SIGKILL
    heave = bench.listen("ship/heave")
    second = processes.node("simulation", scene=SCENE, **EVERYBODY)
    bench.until(lambda: len(epochs) >= 2, "a new epoch")
    epoch_ns = int(epochs[-1].sec) * 10**9 + int(epochs[-1].nanosec)
    until_running(bench, odometry, "the new twin runs")
    bench.until(
        lambda: any(
            stamp_ns(m) > epoch_ns and (stamp_ns(m) - epoch_ns) % 50_000_000 == 0 for m in heave
        ),
        "heave on the grid of the new epoch",
    )
    diagnostics = bench.listen("diagnostics")
    bench.until(
        lambda: figure(diagnostics, "simulation: run", "heave_accepted") > 20,
        "the new twin takes it",
    )
    all_of_them = (sea, winch, viewer, recorder, second)
    for process in all_of_them:
        assert not process.ended, process.text
        process.send(signal.SIGTERM)
    for process in all_of_them:
        assert process.wait() == 0, process.text
        assert "Traceback" not in process.text
    with BagReader(tmp_path / "bag") as reader:
        counts = {name: content.messages for name, content in reader.topics.items()}
    assert counts["/twin/epoch"] == 2


def test_bad_messages_from_another_process_do_not_end_it(
    bench: Bench, processes: Processes
) -> None:
    odometry, diagnostics = bench.listen("payloads/state"), bench.listen("diagnostics")
    simulation = processes.node("simulation", scene=SCENE)
    publishers = {topic: bench.publisher(topic) for topic in BAD}
    bench.until(lambda: len(odometry) >= 10, "the twin runs")
    sources = "simulation: sources"
    for topic in BAD:
        bench.until(
            lambda topic=topic: figure(diagnostics, sources, topic) == 1.0, f"{topic} is known"
        )
    sent = 0
    for topic, kinds in BAD.items():
        for make in kinds.values():
            publishers[topic].publish(make(stamp_ns(odometry[-1]) + 200_000_000))
            sent += 1
            until_running(bench, odometry, "it runs on")
    assert sent >= 30

    def refused() -> int:
        rows = [row for message in diagnostics[-2:] for row in message.status]
        values = {(row.name, pair.key): pair.value for row in rows for pair in row.values}
        counted = [int(v) for (name, key), v in values.items()
                   if (name.startswith("simulation: input") and key == "refused")
                   or (name == "simulation: messages" and key in BAD)]  # fmt: skip
        return sum(counted)

    bench.until(lambda: bool(diagnostics) and refused() == sent, f"all {sent} are reported")
    simulation.send(signal.SIGINT)
    assert simulation.wait() == 0
    assert "Traceback" not in simulation.text


def test_figures_of_the_run_are_taken_from_the_simulation_alone(bench: Bench) -> None:
    """Another node's, with an error that would end the run, and nonsense by the right one."""
    import rclpy

    from rope_twin import Twin, load_scene
    from rope_twin.messages import Level, Status, encode_diagnostics
    from rope_twin.ros.processes import Monitor
    from rope_twin.ros.qos import message_type, profile
    from rope_twin.run.summary import RUN_ROW, summarise
    from rope_twin.topics import BY_NAME

    twin = Twin(load_scene("still_water"))
    good = summarise(twin, twin.snapshot(), None)
    topic = BY_NAME["diagnostics"]
    monitor = bench.add(Monitor())

    def publisher(node: Any) -> Any:
        made = node.create_publisher(message_type(topic), topic.name, profile(topic.qos))
        bench.until(made.get_subscription_count, "the monitor listens")
        return made

    rogue = publisher(bench.own)
    values = good.row().values | {"error": json.dumps("stopped by a stranger")}
    rogue.publish(encode_diagnostics(0, [Status(RUN_ROW, Level.OK, "", values)]))
    bench.until(lambda: "bench" in monitor._warned, "it is noticed")
    assert monitor.summary is None
    own = publisher(bench.add(rclpy.create_node("simulation")))
    for wrong in ({}, {"scene": "no JSON"}, values | {"time_s": '"soon"'}, values | {"ropes": "3"}):
        own.publish(encode_diagnostics(0, [Status(RUN_ROW, Level.OK, "", wrong)]))
    bench.until(lambda: "summary" in monitor._warned, "nonsense is noticed")
    assert monitor.summary is None
    own.publish(encode_diagnostics(0, [good.row()]))
    bench.until(lambda: monitor.summary is not None, "the simulation is heard")
    rogue.publish(encode_diagnostics(0, [Status(RUN_ROW, Level.OK, "", values)]))
    own.publish(encode_diagnostics(0, [good.row()]))
    count = bench.listen("diagnostics")
    bench.until(lambda: own.get_subscription_count() > 1, "another listener")
    own.publish(encode_diagnostics(0, [good.row()]))
    bench.until(lambda: count, "all before it was taken")
    assert monitor.summary == good


@pytest.mark.parametrize("name", ENTRIES)
def test_each_entry_ends_cleanly_on_ctrl_c(
    bench: Bench, processes: Processes, tmp_path: Path, name: str
) -> None:
    """Alone, with nobody to hear or to tell.

    It has a name of its own: a node that an interrupted test left behind may have the usual one.
    """
    own = f"{name}_of_this_test"
    process = entry(processes, name, tmp_path, own)
    bench.until(lambda: own in bench.own.get_node_names(), f"{name} is there")
    process.send(signal.SIGINT)
    assert process.wait() == 0, process.text
    assert "Traceback" not in process.text


def entry(processes: Processes, name: str, folder: Path, node_name: str = "") -> Process:
    """One of ENTRIES, started; node_name: in place of its usual one."""
    parameters = {
        "recorder": {"out": str(folder / "bag")},
        "viewer": {"file": str(folder / "run.rrd")},
    }.get(name, {"scene": SCENE})
    command = node_command(name, parameters)[1:]
    return processes.start([*command, "-r", f"__node:={node_name or name}"])


@pytest.mark.parametrize(
    ("name", "parameters", "words"),
    [
        ("simulation", {"scene": "deep_lit"}, "did you mean 'deep_lift'"),
        ("simulation", {"speed": 1000.0}, "0.01 to 5"),
        ("sea_state", {"bag": "no_such"}, "no_such"),
        ("winch_schedule", {"lead_s": "soon"}, "it must be a number"),
        ("viewer", {"file": ""}, "no display"),
        ("recorder", {"out": "/proc/no"}, "cannot be made"),
    ],
)
def test_a_bad_parameter_is_one_sentence_and_exit_code_1(
    processes: Processes, name: str, parameters: dict[str, object], words: str
) -> None:
    process = processes.node(name, **parameters)
    assert process.wait() == 1
    assert words in process.text
    assert "Traceback" not in process.text


def test_an_argument_that_is_no_parameter_is_refused(processes: Processes) -> None:
    process = processes.start(["-m", "rope_twin.ros.simulation_node", "storm"])
    assert process.wait() == 1
    assert "'storm'" in process.text


def figure(diagnostics: list[Any], name: str, key: str) -> float:
    """The newest value of a figure of a row, 0 before there is one."""
    for message in reversed(diagnostics):
        for row in message.status:
            if row.name == name:
                return float(next(pair.value for pair in row.values if pair.key == key))
    return 0.0


def stamp_ns(message: object) -> int:
    stamp = message.header.stamp  # type: ignore[attr-defined]
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)
