"""Bags of paced runs are run again and compared: every number that was published, bit by bit."""

from __future__ import annotations

import json
import signal
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ros_bench import Bench
from ros_messages import multi_array
from ros_process import Processes

from rope_twin import Twin, load_scene
from rope_twin.cli import main
from rope_twin.messages import encode_cut, encode_heave, encode_order
from rope_twin.recording import bag_writer as recorder_module
from rope_twin.recording.exact_replay import Outcome, Verification, verify
from rope_twin.recording.recorded_run import read_content
from rope_twin.topics import INPUT_LOG_TOPIC, SESSION_TOPIC, SNAPSHOT_TOPICS
from rope_twin.twin.input_queue import SET_LEVEL
from rope_twin.twin.snapshot import LENGTH, SPEED
from rope_twin.twin.winch.commands import WinchCommand

pytestmark = pytest.mark.ros
SCENE = "shallow_lift"
LISTENED = " ".join([*(topic.name for topic in SNAPSHOT_TOPICS), SESSION_TOPIC, INPUT_LOG_TOPIC])


def recorded(bench: Bench, bag: Path, **parameters: Any) -> tuple[Any, Any]:
    """A recorder that has begun, and a simulation node that has not; it awaits the recorder."""
    recorder = bench.make("recorder", out=str(bag), allow_cut=True)
    recorder.begin()
    given = {"scene": SCENE, "wait_for": LISTENED, "wait_for_s": 60.0, **parameters}
    return recorder, bench.make("simulation", **given, allow_cut=True)


def end(bench: Bench, recorder: Any, *nodes: Any) -> None:
    """Close the nodes, and the recorder when nothing has come to it for a while."""
    for node in nodes:
        node.close()
    heard = -1
    while recorder.received != heard:
        heard = recorder.received
        for _ in range(5):
            bench.executor.spin_once(timeout_sec=0.05)
    recorder.close()
    assert not recorder.failure


def assert_equal(bag: Path) -> Verification:
    found = verify(bag)
    assert found.difference is None, str(found.difference)
    assert not found.fault
    assert found.outcome is Outcome.EQUAL
    assert found.unverified == 0
    assert not found.unrecorded
    return found


class Sender:
    """Another node at the twin's inputs."""

    def __init__(self, bench: Bench, node: Any) -> None:
        self._bench, self._node = bench, node
        topics = ("ship/heave", "winch/speed_command", "winch/length_command",
                  "winch/switch_command", "current", "ropes/cut")  # fmt: skip
        self.publishers = {name: bench.publisher(name) for name in topics}
        bench.until(
            lambda: all(one.get_subscription_count() > 1 for one in self.publishers.values()),
            "both listeners of every input",
        )
        self._sent_ns = -100_000_000

    def send(self, topic: str, data: bytes) -> None:
        self.publishers[topic].publish(data)

    def command(self, order: WinchCommand, stamp_ns: int = 0) -> None:
        self.send(*encode_order(stamp_ns, order))

    def sail(self, until_ns: int) -> None:
        """Send heave as it is due until the twin has come to a time."""
        while self._node.paced.last.stamp_ns < until_ns:
            epoch_ns, now_ns = self._node.paced.border.epoch_ns, self._node.paced.last.stamp_ns
            while self._sent_ns < now_ns + 600_000_000:
                t = self._sent_ns * 1e-9
                data = encode_heave(epoch_ns + self._sent_ns, np.sin(t), np.cos(t))
                self.send("ship/heave", data)
                self._sent_ns += 50_000_000
            self._bench.executor.spin_once(timeout_sec=0.02)


def test_a_run_with_every_input_a_pause_and_fewer_elements_is_replayed(
    bench: Bench, tmp_path: Path
) -> None:
    bag = tmp_path / "bag"
    recorder, node = recorded(bench, bag)
    sender = Sender(bench, node)
    sender.send("current", multi_array([0.0, 0.3, 0.1, -500.0, 0.1, 0.0], [2, 3]))  # before t = 0
    node.begin()
    bench.until(lambda: node.paced.border.epoch_ns is not None, "its epoch")
    sender.sail(600_000_000)
    sender.command(WinchCommand(SPEED, 0.4))
    sender.send("ship/heave", b"no message")
    sender.sail(1_200_000_000)
    node.paced.pacer.watch(lambda slot: node.paced.protection.start_at(3.0))  # as if overloaded
    sender.sail(1_800_000_000)
    assert node.paced.twin.level.step_ns > 10_000_000
    sender.command(WinchCommand(LENGTH, 201.5), node.paced.border.epoch_ns + 2_000_000_000)
    sender.send("current", multi_array([0.0, 0.5, -0.2, -500.0, 0.1, 0.0], [2, 3]))
    sender.sail(2_400_000_000)
    node.trigger_deactivate()
    node.trigger_activate()
    bench.until(lambda: node.paced.border.epoch_ns is not None, "its new epoch")
    at_ns = node.paced.last.stamp_ns
    sender.command(WinchCommand("emergency_stop"))
    sender.sail(at_ns + 600_000_000)
    sender.send(*encode_cut(0, 100.0))
    sender.sail(at_ns + 1_200_000_000)
    assert node.paced.twin.cut is not None
    end(bench, recorder, node)
    found = assert_equal(bag)
    assert [one.number for one in found.sessions] == [1, 2]
    assert found.applied["ship/heave"] > 60
    assert found.applied["current"] == 2
    assert found.applied["winch/speed_command"] == found.applied["ropes/cut"] == 1
    assert found.applied["winch/switch_command"] == found.applied["winch/length_command"] == 1
    assert found.compared["ropes/tension_top"] > 100
    assert found.compared["ropes/nodes"] > 5  # after the cut
    levels = [call for one in read_content(bag).sessions for entry in one.entries
              for call in entry.calls() if call.method == SET_LEVEL]  # fmt: skip
    assert levels


def test_switches_by_service_are_replayed(bench: Bench, tmp_path: Path) -> None:
    from std_srvs.srv import SetBool, Trigger

    bag = tmp_path / "bag"
    recorder, node = recorded(bench, bag, scene="emergency_stop")
    sender = Sender(bench, node)
    node.begin()
    bench.until(lambda: node.paced.border.epoch_ns is not None, "its epoch")
    sender.sail(400_000_000)
    calls = (
        ("emergency_stop", Trigger, Trigger.Request()),
        ("reset", Trigger, Trigger.Request()),
        ("set_brake", SetBool, SetBool.Request(data=False)),
    )
    for name, kind, request in calls:
        client = bench.own.create_client(kind, f"winch/{name}")
        bench.until(client.service_is_ready, "the service is there")
        answer = client.call_async(request)
        bench.until(answer.done, "its answer")
        assert answer.result().success
        sender.sail(node.paced.last.stamp_ns + 200_000_000)
    end(bench, recorder, node)
    found = verify(bag)
    assert found.difference is None, str(found.difference)
    assert found.outcome is Outcome.EQUAL, found.fault
    assert found.applied["winch/switch_command"] == found.unrecorded["winch/switch_command"] == 3


def test_a_node_that_goes_on_from_a_saved_state_is_replayed(
    bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two simulations, one after the other, in one bag of several files."""
    monkeypatch.setattr(recorder_module, "FILE_PERIOD_S", 0.5)
    bag, state = tmp_path / "bag", str(tmp_path / "run.state")
    kept = {"save_state": state, "from_state": state}
    recorder, first = recorded(bench, bag, **kept)
    sender = Sender(bench, first)
    first.begin()
    bench.until(lambda: first.paced.border.epoch_ns is not None, "its epoch")
    sender.command(WinchCommand(SPEED, 0.3))
    sender.sail(800_000_000)
    first.close()
    first.destroy_node()
    bench.nodes.remove(first)
    given = {"scene": SCENE, "wait_for": LISTENED, "wait_for_s": 60.0, **kept}
    second = bench.make("simulation", **given, allow_cut=True)
    second.begin()
    assert second.paced.twin.time_ns >= 800_000_000
    bench.until(lambda: second.paced.border.epoch_ns is not None, "its epoch")
    sender = Sender(bench, second)
    sender.sail(second.paced.twin.time_ns + 600_000_000)
    end(bench, recorder, second)
    found = assert_equal(bag)
    assert len(list(bag.glob("*.mcap"))) > 2
    assert len({one.run for one in found.sessions}) == len(found.sessions) == 2
    assert found.sessions[1].content["state"] is not None
    assert found.sessions[1].time_ns >= 800_000_000


def test_a_run_from_a_stop_that_came_before_the_first_step_is_replayed(
    bench: Bench, tmp_path: Path
) -> None:
    bag, state = tmp_path / "bag", tmp_path / "stopped.state"
    twin = Twin(load_scene("emergency_stop"))
    twin.submit_command(None, WinchCommand("emergency_stop"))
    twin.save(state)
    recorder, node = recorded(bench, bag, scene="emergency_stop", from_state=str(state))
    sender = Sender(bench, node)
    node.begin()
    bench.until(lambda: node.paced.border.epoch_ns is not None, "its epoch")
    sender.sail(400_000_000)
    assert node.paced.last.winches[0].mode == "emergency_stop"
    end(bench, recorder, node)
    assert_equal(bag)


def test_a_recorder_that_joins_late_is_given_what_it_needs(bench: Bench, tmp_path: Path) -> None:
    """The bag can be replayed from a session that begins on the way."""
    first, node = recorded(bench, tmp_path / "first")
    sender = Sender(bench, node)
    node.begin()
    bench.until(lambda: node.paced.border.epoch_ns is not None, "its epoch")
    sender.command(WinchCommand(SPEED, 0.3))
    sender.sail(1_500_000_000)
    second = bench.make("recorder", out=str(tmp_path / "second"), allow_cut=True)
    second.begin()
    joined_ns = node.paced.last.stamp_ns
    sender.sail(joined_ns + 2_500_000_000)
    end(bench, first, node)
    end(bench, second)
    whole = assert_equal(tmp_path / "first")
    assert [one.number for one in whole.sessions] == [1, 2]
    found = verify(tmp_path / "second")
    assert found.difference is None, str(found.difference)
    assert found.outcome is Outcome.EQUAL, found.fault
    assert found.sessions[-1].number == 2
    assert found.sessions[-1].time_ns >= joined_ns
    assert found.compared["ropes/tension_top"] > 60


@pytest.mark.parametrize(
    "how",
    [(), pytest.param(("--processes",), marks=pytest.mark.long)],
    ids=["in one process", "as processes"],
)
def test_the_bag_of_the_run_command_is_replayed(
    processes: Processes, tmp_path: Path, how: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    bag = tmp_path / "bag"
    process = processes.cli(
        "run", SCENE, "--duration", "3", "--headless", "--out", str(bag), *how
    )  # fmt: skip
    assert process.wait() == 0
    assert main(["replay", str(bag), "--verify", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["outcome"] == "equal"
    assert (
        found["compared"]["ropes/tension_top"] + found["missing"].get("ropes/tension_top", 0) == 150
    )
    assert found["applied"]["ship/heave"] >= 60
    assert found["unrecorded"] == {}


PACED_SCENES = (
    "shallow_lift", "deep_lift", "bridle_lift", "ship_6dof", "manifold_lift", "two_line_lift",
    "ahc_lift", "storm", "splash_zone", "wave_zone", "landing", "hybrid_lift", "hmpe_lift",
    "rov_tether", "deep_tow_turn", "grab_lift", "emergency_stop", "chain_on_bottom",
    "vortices_modal", "tow_with_net",
)  # fmt: skip


@pytest.mark.long
@pytest.mark.parametrize("how", [(), ("--processes",)], ids=["in one process", "as processes"])
@pytest.mark.parametrize("scene", PACED_SCENES)
def test_twenty_scenes_are_replayed(
    processes: Processes, tmp_path: Path, scene: str, how: tuple[str, ...]
) -> None:
    bag = tmp_path / "bag"
    process = processes.cli(
        "run", scene, "--duration", "8", "--headless", "--out", str(bag), *how
    )  # fmt: skip
    assert process.wait() == 0
    found = assert_equal(bag)
    assert found.compared["ropes/tension_top"] > 100


@pytest.mark.long
def test_a_killed_simulation_that_goes_on_is_replayed(
    bench: Bench, processes: Processes, tmp_path: Path
) -> None:
    """kill -9 of the node's process; what it published after its last state comes twice."""
    bag, state = tmp_path / "bag", tmp_path / "run.state"
    recorder = processes.node("recorder", out=str(bag))
    for name in ("sea_state", "winch_schedule"):
        processes.node(name, scene=SCENE)
    top = bench.listen("ropes/tension_top")
    parameters = {
        "scene": SCENE, "save_state": str(state), "from_state": str(state), "save_every_s": 1.0,
        "wait_for": f"ship/heave winch/speed_command {LISTENED}", "wait_for_s": 20.0,
    }  # fmt: skip
    for wanted in (250, 200):
        heard = len(top)
        node = processes.node("simulation", **parameters)
        bench.until(lambda count=heard + wanted: len(top) > count, "some seconds")
        node.send(signal.SIGKILL)
        node.wait()
    recorder.send(signal.SIGINT)
    assert recorder.wait() == 0
    found = verify(bag)
    assert found.difference is None, str(found.difference)
    assert len(found.sessions) == 2
