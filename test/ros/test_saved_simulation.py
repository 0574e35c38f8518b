"""A simulation node that saves its state, is killed, and goes on where it was.

The kill itself, over processes and to the bit, is long:

    pytest -m long -s test/ros/test_saved_simulation.py
"""

from __future__ import annotations

import shutil
import signal
from pathlib import Path
from typing import Any

import pytest
from ros_bench import Bench, ros_ahead_ns
from ros_process import Processes

from rope_twin import Twin, load_scene
from rope_twin.errors import InputError
from rope_twin.messages import Level, decode, encode_order, encode_text
from rope_twin.recording.bag import BagReader
from rope_twin.run.options import RunOptions
from rope_twin.run.unpaced import run_unpaced
from rope_twin.twin.state import load_state
from rope_twin.twin.winch.commands import WinchCommand

pytestmark = pytest.mark.ros
SCENE = "shallow_lift"


def simulation(bench: Bench, **parameters: Any) -> Any:
    """A simulation node of the bench, not yet begun."""
    return bench.make("simulation", scene=SCENE, **parameters)


def nanoseconds(stamp: Any) -> int:
    return int(stamp.sec) * 10**9 + int(stamp.nanosec)


def motion(message: Any) -> tuple[float, ...]:
    """Place and velocity of the payload."""
    place, speed = message.transforms[0].translation, message.twist[0].linear
    return place.x, place.y, place.z, speed.x, speed.y, speed.z


def row(node: Any, name: str) -> Any:
    return next(row for row in node.paced.rows(ros_ahead_ns()) if row.name == f"simulation: {name}")


def test_a_second_node_goes_on_where_the_first_was_closed(bench: Bench, tmp_path: Path) -> None:
    """One command line for both: at rest the first time. Twin time and stamps only rise."""
    path = tmp_path / "run.state"
    kept = {"save_state": str(path), "from_state": str(path), "save_every_s": 0.2}
    odometry = bench.listen("payloads/state")
    first = simulation(bench, **kept)
    first.begin()
    assert "static equilibrium" in first.paced.begun
    bench.until(lambda: path.exists(), "a state of the running twin")
    bench.until(lambda: first.paced.last.step >= 60, "more of it")
    assert row(first, "saving").message.startswith("state saved at")
    first.close()
    reached = first.paced.twin.steps
    assert load_state(path).about.step == reached
    assert first.paced.summary().state == str(path)
    bench.until(lambda: len(odometry) * 2 == reached, "all that it published")
    heard = len(odometry)
    second = simulation(bench, **kept)
    second.begin()
    assert f"{path} at {reached * 0.01:.2f} s" in second.paced.begun
    bench.until(lambda: second.paced.last.step >= reached + 20, "it runs")
    bench.until(lambda: len(odometry) > heard + 5, "it publishes")
    stamps = [nanoseconds(message.header.stamp) for message in odometry]
    assert stamps == sorted(set(stamps))
    assert stamps[heard] - second.paced.border.epoch_ns == (reached + 2) * 10_000_000
    second.close()


def test_an_emergency_stop_is_saved_at_once(bench: Bench, tmp_path: Path) -> None:
    """A simulation that is killed right after it goes on stopped; repeats of it are not saved."""
    path, scene = tmp_path / "run.state", "emergency_stop"
    node = bench.make("simulation", scene=scene, save_state=str(path), save_every_s=3600.0)
    node.begin()
    topic, stop = encode_order(0, WinchCommand("emergency_stop"))
    panel = bench.publisher(topic)
    bench.until(lambda: node.paced.last.step and panel.get_subscription_count(), "it runs")
    assert not path.exists()
    panel.publish(stop)
    bench.until(path.exists, "the state with the stop", timeout_s=20.0)
    saved = load_state(path)
    resumed = Twin.restore(saved, load_scene(scene))
    assert resumed.snapshot().winches[0].mode == "emergency_stop"
    panel.publish(stop)
    bench.until(lambda: node.paced.last.step > saved.about.step + 50, "a second one")
    assert load_state(path).about.step == saved.about.step


def test_an_emergency_stop_in_a_pause_is_saved_at_once(bench: Bench, tmp_path: Path) -> None:
    """Before the first step as well; a simulation that was killed in the pause goes on stopped."""
    path, scene = tmp_path / "run.state", "emergency_stop"
    for runs_before in (False, True):
        path.unlink(missing_ok=True)
        node = bench.make("simulation", scene=scene, save_state=str(path), save_every_s=3600.0)
        node.trigger_configure()
        if runs_before:
            node.trigger_activate()
            bench.until(lambda one=node: one.paced.last.step, "it runs")
            node.trigger_deactivate()
        before = path.read_bytes() if runs_before else b""
        assert node.paced.border.switch("winch", "emergency_stop")[0]
        bench.until(lambda old=before: path.exists() and path.read_bytes() != old, "it is saved")
        resumed = Twin.restore(load_state(path), load_scene(scene))
        assert resumed.steps == node.paced.twin.steps
        resumed.invalidate_inputs()  # as after every pause
        resumed.advance(1)
        assert resumed.snapshot().winches[0].mode == "emergency_stop"
        node.close()
        bench.remove(node)


def test_a_state_that_is_asked_for_before_the_start_is_saved_or_refused(
    bench: Bench, tmp_path: Path
) -> None:
    """The answer is about the file; a stop that is latched is in it."""
    folder = tmp_path / "states"
    folder.mkdir()
    path, scene = folder / "run.state", "emergency_stop"
    node = bench.make("simulation", scene=scene, save_state=str(path))
    node.trigger_configure()
    assert node.paced.save() == (True, f"paused, the state is in {path}")
    assert load_state(path).about.step == 0
    shutil.rmtree(folder)
    assert node.paced.border.switch("winch", "emergency_stop")[0]
    done, words = node.paced.save()
    assert not done
    assert str(path) in words
    assert "No such file" in words
    folder.mkdir()
    assert node.paced.save()[0]
    resumed = Twin.restore(load_state(path), load_scene(scene))
    resumed.advance(1)
    assert resumed.snapshot().winches[0].mode == "emergency_stop"


def test_alerts_and_limits_of_the_crew_outlive_a_kill(bench: Bench, tmp_path: Path) -> None:
    """Commands of the crew are saved at once; no alert is raised again or missing."""
    path, killed = tmp_path / "run.state", tmp_path / "killed.state"
    first = simulation(bench, save_state=str(path), save_every_s=3600.0)
    heard, commands = bench.listen("alerts"), bench.publisher("alerts/command")
    first.begin()
    bench.until(commands.get_subscription_count, "it listens")

    def key(name: str) -> dict[str, str]:
        rows = ({pair.key: pair.value for pair in one.values} for one in heard[-1].status)
        return next((row for row in rows if row["identifier"] == name), {})

    def done(words: str, name: str, state: str) -> None:
        path.unlink(missing_ok=True)
        commands.publish(encode_text(words))
        bench.until(lambda: heard and key(name).get("state") == state, words, 30.0)
        bench.until(path.exists, "it is saved at once", 20.0)

    done("limit tension_n 120000", "10001", "unacknowledged")
    commands.publish(encode_text("limit payload_depth_m 100"))
    bench.until(lambda: key("10010"), "another alarm")
    done("acknowledge 10001.1", "10001", "acknowledged")
    done("shelve 10010.1 600", "10010", "unacknowledged")
    shutil.copy(path, killed)
    before = {name: key(name) for name in ("10001", "10010")}
    saved = load_state(killed)
    first.close()
    bench.remove(first)
    heard.clear()
    second = simulation(bench, from_state=str(killed))
    second.begin()
    assert second.paced.alerts.row().message == ("tension_n 120000 N, payload_depth_m 100 m")
    bench.until(lambda: second.paced.last.time_s > saved.about.time_s + 2.0, "it runs on")
    assert int(key("10001")["now [ns]"]) > int(before["10001"]["now [ns]"])
    for name, values in before.items():
        assert key(name) | {"now [ns]": ""} == values | {"now [ns]": ""}


def test_a_commander_that_does_not_come_back_after_a_restart_is_lost(
    bench: Bench, tmp_path: Path
) -> None:
    """The winch of the saved state runs; then it does what its scene says."""
    path = tmp_path / "run.state"
    twin = Twin(load_scene("emergency_stop"))
    twin.submit_speed(None, 0.3)
    twin.advance(200)
    twin.save(path)
    node = bench.make("simulation", scene="emergency_stop", from_state=str(path))
    diagnostics, modes = bench.listen("diagnostics"), bench.listen("winch/mode")
    node.begin()
    bench.until(lambda: modes, "it runs")
    assert modes[-1].data.startswith("winch: speed 0.3 m/s")
    bench.until(lambda: modes[-1].data.startswith("winch: speed 0 m/s"), "it stops", 60.0)

    def reported() -> bool:
        rows = {row.name: row for row in diagnostics[-1].status}
        return "has not come back at " in rows["simulation: seat winch"].message

    bench.until(reported, "the seat says why")


def test_the_end_counts_from_the_beginning_of_the_run(bench: Bench, tmp_path: Path) -> None:
    path = tmp_path / "some.state"
    twin = Twin(load_scene(SCENE))
    twin.advance(50)
    twin.save(path)
    node = simulation(bench, from_state=str(path), stop_after_s=0.6)
    node.begin()
    bench.until(lambda: node.finished, "the tenth of a second that was left")
    assert node.paced.twin.steps == 60
    late = simulation(bench, from_state=str(path), stop_after_s=0.5)
    with pytest.raises(InputError, match=r"stop_after_s 0.5: the saved state is at 0.5 s already"):
        late.begin()


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({"from_state": "none.state"}, "none.state: it cannot be read"),
        ({"from_state": __file__}, "it is no saved state"),
        ({"save_state": "/none/x.state"}, "saved state /none/x.state: it cannot be written"),
    ],
)
def test_what_does_not_serve_is_one_sentence(
    bench: Bench, parameters: dict[str, str], words: str
) -> None:
    node = simulation(bench, **parameters)
    with pytest.raises(InputError, match=words):
        node.begin()
    assert node.paced is None


def test_nothing_is_saved_unless_asked(
    bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    node = simulation(bench)
    node.begin()
    bench.until(lambda: node.paced.last.step >= 10, "it runs")
    assert not [row for row in node.paced.rows(ros_ahead_ns()) if row.name == "simulation: saving"]
    node.close()
    assert not [path for path in tmp_path.iterdir() if path.suffix == ".state"]


@pytest.mark.parametrize("times", [1, 10**9], ids=["once", "for ever"])
def test_a_failed_step_ends_pacing_only_if_it_fails_on(
    bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, times: int
) -> None:
    """Reported as an error, counted, and gone on from; five in a row end the run."""
    import rope_twin.twin.ropes as ropes_module

    step, left = ropes_module.advance, [times]

    def fail(rope: object, boundary: object, pull: object, time_s: float, steps: int) -> int:
        if time_s >= 1.0 and left[0]:
            left[0] -= 1
            return 0
        return int(step(rope, boundary, pull, time_s, steps))

    monkeypatch.setattr(ropes_module, "advance", fail)
    node = simulation(bench, failure_directory=str(tmp_path), save_state=str(tmp_path / "x.state"))
    node.begin()
    pacer = node.paced.pacer
    if times > 1:
        bench.until(lambda: pacer.health().error, "it gives up")
        assert "gives up after 5 failed steps within 60 s" in pacer.health().error
        assert node.paced.summary().error
        node.close()
        assert not (tmp_path / "x.state").exists(), "what fails is not saved"
        return
    bench.until(lambda: node.paced.last.time_s > 1.5, "it goes on")
    assert row(node, "solver").level == Level.ERROR
    assert "1 failed step" in row(node, "solver").message
    assert node.paced.summary().recoveries == 1
    assert not pacer.health().error
    node.close()
    assert not load_state(tmp_path / "x.state").about.failure


@pytest.mark.long
def test_a_kill_costs_nothing_but_time(bench: Bench, processes: Processes, tmp_path: Path) -> None:
    """kill -9, then the same command: bit by bit the run without ROS and without interruption.

    Sea and schedule are processes that live on and follow the new epoch. What was published after
    the last saved state is computed once more, from the same inputs, to the same bits.
    """
    path = tmp_path / "run.state"
    odometry, epochs = bench.listen("payloads/state"), bench.listen("twin/epoch")
    diagnostics = bench.listen("diagnostics")
    for name in ("sea_state", "winch_schedule"):
        processes.node(name, scene=SCENE)
    parameters = {
        "scene": SCENE, "save_state": str(path), "from_state": str(path), "save_every_s": 1.0,
        "wait_for": "ship/heave winch/speed_command", "wait_for_s": 20.0,
        "input_delay_s": 3.0,  # inputs come in time on a machine that is busy, too
    }  # fmt: skip
    lives: list[dict[int, Any]] = []
    for wanted in (330, 210, 150):
        epoch_count = len(epochs)
        node = processes.node("simulation", **parameters)
        bench.until(lambda count=epoch_count: len(epochs) > count, "its epoch")
        epoch_ns, heard = nanoseconds(epochs[-1]), len(odometry)
        bench.until(lambda count=heard + wanted: len(odometry) >= count, "some seconds")
        node.send(signal.SIGKILL)
        assert node.wait() == -signal.SIGKILL
        lives.append({nanoseconds(m.header.stamp) - epoch_ns: m for m in odometry[heard:]})
        # What still came with the stamps of the life before is refused as out of order.
        late = [r.message for r in diagnostics[-1].status if "after it was" in r.message]
        assert not late, f"life {len(lives)}: equality is promised for inputs that come in time"
    begins = [min(life) for life in lives]
    ends = [max(life) for life in lives]
    print(f"\nlives from {[t * 1e-9 for t in begins]} to {[t * 1e-9 for t in ends]} s")
    for end, begin in zip(ends, begins[1:], strict=False):
        assert begin <= end + 20_000_000, "no twin time is left out"
        assert end - begin < 1_500_000_000, "at most the time between two saved states is repeated"
    options = RunOptions(
        scene=SCENE, end_s=ends[-1] * 1e-9 + 0.1, speed=0.0, record=tmp_path / "whole"
    )
    whole_ns = 10**18
    assert not run_unpaced(options, lambda run: None, whole_ns).error
    with BagReader(tmp_path / "whole") as reader:
        whole = {nanoseconds(m.header.stamp) - whole_ns: m for m in
                 (decode("payloads/state", data)
                  for _, data in reader.messages("/payloads/state"))}  # fmt: skip
    for life in lives:
        for at_ns, message in life.items():
            assert motion(message) == motion(whole[at_ns]), f"at {at_ns * 1e-9:.2f} s"
