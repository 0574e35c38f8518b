"""Kills of random processes of a run: the suite comes back by itself, and little is not recorded.

    ROPE_TWIN_KILLS=100 pytest -n 0 -m long -s test/ros/test_kill_campaign.py

prints a line for each kill: what was killed, after how long it was back, and how much of what was
published then is in no bag. Bags of recorders that were killed are recovered first.
"""

from __future__ import annotations

import json
import os
import random
import signal
import subprocess
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import psutil
import pytest
from ros_bench import Bench
from ros_process import Process, Processes

from rope_twin.files import share_dir, write_whole
from rope_twin.messages import decode
from rope_twin.recording.bag import BagReader
from rope_twin.recording.recover import recover
from rope_twin.ros import processes as ros_processes
from rope_twin.ros.params import NODES
from rope_twin.run.options import RunOptions

pytestmark = pytest.mark.ros
SCENE = "shallow_lift"
NAMES = ("simulation", "sea_state", "winch_schedule", "recorder", "recorder_standby")
# The topic on which each is heard; the recorder is known by its bag.
HEARD_ON = {
    "simulation": "payloads/state",
    "sea_state": "ship/heave",
    "winch_schedule": "winch/speed_command",
}
PERIOD_NS = 20_000_000  # of payloads/state
KILLS_A_MINUTE = 3
STANDING_BY = "recorder on standby"


@pytest.fixture(autouse=True)
def announced_often(monkeypatch: pytest.MonkeyPatch) -> None:
    """Run and listener take the profile of every run, so that both are found again in a second."""
    profile = share_dir() / "config" / "ros" / "fastdds_loopback.xml"
    monkeypatch.setenv("FASTDDS_DEFAULT_PROFILES_FILE", str(profile))


def stamp_ns(message: Any) -> int:
    return int(message.header.stamp.sec) * 10**9 + int(message.header.stamp.nanosec)


@dataclass
class Kill:
    """One kill and what came of it."""

    name: str
    at_ns: int  # ROS time
    back_s: float = 0.0
    missing: list[int] = field(default_factory=list)  # stamps in no bag

    @property
    def loss_s(self) -> float:
        return len(self.missing) * PERIOD_NS * 1e-9


class Campaign:
    """A run with its processes, listened to from here."""

    def __init__(self, bench: Bench, processes: Processes, folder: Path) -> None:
        self._bench = bench
        self._bag = folder / "bag"
        self._heard = {topic: bench.listen(topic, 5000) for topic in HEARD_ON.values()}
        self._arrived: dict[str, float] = {}
        self.kills: list[Kill] = []
        command = ["run", SCENE, "--processes", "--headless", "--json", "--out", str(self._bag)]
        self.run: Process = processes.start(["-m", "rope_twin", *command])
        bench.until(lambda: all(self._heard.values()), "the run")
        bench.until(lambda: set(NAMES) <= set(self.pids()), "all processes", 60.0)
        bench.until(lambda: STANDING_BY in self.run.text, "the standby recorder", 60.0)

    def pids(self) -> dict[str, int]:
        """The processes of the run by name."""
        found: dict[str, int] = {}
        for child in psutil.Process(self.run.popen.pid).children():
            try:
                words = child.cmdline()
            except psutil.Error:
                continue
            name = next((w.split(".")[-1] for w in words if w.startswith("rope_twin.ros.")), "")
            standby = any("standby:=" in word for word in words)
            if name == "processes":  # a spare; it may be a node by now, and is called so
                called = Path(f"/proc/{child.pid}/comm").read_text().strip()
                name = f"{called}_node" if called in NODES else ""
                standby = called == "recorder"
            if name == "recorder_node" and standby and self._has_begun(child):
                standby = False
            if name and child.status() != psutil.STATUS_ZOMBIE:
                known = name.removesuffix("_node") + ("_standby" if standby else "")
                found[known] = child.pid
        return found

    def _has_begun(self, recorder: psutil.Process) -> bool:
        return any(Path(file.path).suffix == ".mcap" for file in recorder.open_files())

    def spin(self, seconds: float) -> None:
        until = time.monotonic() + seconds
        self._bench.until(lambda: time.monotonic() > until, "time to pass")

    def kill(self, name: str, wholly: bool = True) -> Kill:
        """Kill one and wait until another one does its work; wholly: until one stands by again."""
        standing_by = self.run.text.count(STANDING_BY)
        before, began = self.pids(), time.monotonic()
        made = Kill(name, time.time_ns())
        self.kills.append(made)
        os.kill(before[name], signal.SIGKILL)

        def replaced() -> bool:
            now = self.pids()
            return now.get(name, before[name]) != before[name]

        self._bench.until(replaced, f"another {name}", 60.0)
        if name in HEARD_ON:
            heard = self._heard[HEARD_ON[name]]
            count = len(heard)
            self._bench.until(lambda: len(heard) > count + 1, f"a message of {name}", 60.0)
        made.back_s = time.monotonic() - began
        if wholly and name.startswith("recorder"):  # the next one can take over at once, too
            self._bench.until(
                lambda: self.run.text.count(STANDING_BY) > standing_by, "another standby", 60.0
            )
            if name != "recorder":
                made.back_s = time.monotonic() - began
        return made

    def end(self) -> str:
        """End the run, find what is in no bag; what the run said."""
        self.run.send(signal.SIGINT)
        self._bench.until(lambda: self.run.ended, "its end")
        recorded = set()
        for bag in sorted(self._bag.parent.glob("bag*")):
            if bag.is_dir():
                recorded |= self._stamps(bag)
        first = min(recorded)
        missing = [
            at
            for at in map(stamp_ns, self._heard["payloads/state"][:-1])
            if at > first and at not in recorded
        ]
        for at in missing:
            earlier = [kill for kill in self.kills if kill.at_ns < at + 10**9]
            assert earlier, "a message was lost before any kill"
            earlier[-1].missing.append(at)
        return self.run.text

    def _stamps(self, bag: Path) -> set[int]:
        if not (bag / "metadata.yaml").exists():
            recovered = recover(bag, bag.with_name(f"of_{bag.name}")).directory
            if recovered is None:
                return set()
            bag = recovered
        with BagReader(bag) as reader:
            if "/payloads/state" not in reader.topics:
                return set()
            return {
                stamp_ns(decode("payloads/state", data))
                for _, data in reader.messages("/payloads/state")
            }


def report(kills: list[Kill]) -> None:
    for number, kill in enumerate(kills, 1):
        print(f"{number:4} {kill.name:16} back after {kill.back_s:5.2f} s, "
              f"{kill.loss_s:5.2f} s not recorded")  # fmt: skip
    print(f"{len(kills)} kills: back after {max(k.back_s for k in kills):.2f} s, "
          f"{max(k.loss_s for k in kills):.2f} s not recorded, at most")  # fmt: skip


@pytest.mark.long
def test_a_recorder_a_simulation_and_a_sea_that_are_killed_come_back(
    bench: Bench, processes: Processes, tmp_path: Path
) -> None:
    campaign = Campaign(bench, processes, tmp_path)
    for name in ("recorder", "simulation", "sea_state"):
        campaign.spin(3.0)
        campaign.kill(name)
    campaign.spin(2.0)
    text = campaign.end()
    print()
    report(campaign.kills)
    assert campaign.run.wait() == 0, text
    assert "the recorder process ended (killed by SIGKILL); recording continues in " in text
    assert "the simulation process ended (killed by SIGKILL); restarted" in text
    assert "the sea_state process ended (killed by SIGKILL); restarted" in text
    assert '"not_running": ""' in text
    assert max(kill.loss_s for kill in campaign.kills) <= 1.0


@pytest.mark.long
def test_a_recorder_on_standby_that_has_only_just_started_takes_over_as_well(
    bench: Bench, processes: Processes, tmp_path: Path
) -> None:
    campaign = Campaign(bench, processes, tmp_path)
    campaign.kill("recorder_standby", wholly=False)
    campaign.kill("recorder")
    campaign.spin(2.0)
    text = campaign.end()
    assert campaign.run.wait() == 0, text
    assert len(json.loads(text.strip().splitlines()[-1])["restarts"]) == 2


@pytest.mark.long
def test_random_kills(bench: Bench, processes: Processes, tmp_path: Path) -> None:
    count = int(os.environ.get("ROPE_TWIN_KILLS", "100"))
    source = random.Random(1917)
    campaign = Campaign(bench, processes, tmp_path)
    killed_s: dict[str, list[float]] = {name: [] for name in NAMES}
    print()
    while len(campaign.kills) < count:
        campaign.spin(source.uniform(1.5, 4.0))
        now_s = time.monotonic()
        # two of them share the recorder's allowance: a standby that takes over is a recorder then
        allowed = [n for n in NAMES if sum(now_s - t < 65.0 for t in killed_s[n]) < KILLS_A_MINUTE]
        if not allowed:
            continue
        name = source.choice(allowed)
        killed_s[name].append(now_s)
        made = campaign.kill(name)
        print(f"{len(campaign.kills):4} {name:16} back after {made.back_s:5.2f} s", flush=True)
    campaign.spin(3.0)
    text = campaign.end()
    report(campaign.kills)
    assert campaign.run.wait() == 0, text
    assert max(kill.loss_s for kill in campaign.kills) <= 1.0
    assert max(kill.back_s for kill in campaign.kills) <= 5.0


def test_a_simulation_that_dies_goes_on_from_a_state_of_its_own_run_only(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The file of --save-state may hold an earlier run's state until the first one is saved."""
    started: list[list[str]] = []

    class Started:
        """Takes the place of a process: what counts here is its command line."""

        def __init__(self, command: list[str], **options: Any) -> None:
            started.append(command)

        def kill(self) -> None:
            """Do nothing: no process runs."""

        wait = kill

    monkeypatch.setattr(subprocess, "Popen", Started)
    state = tmp_path / "run.state"
    state.write_bytes(b"of an earlier run")
    made = ros_processes.Processes(RunOptions(scene=SCENE, save=state))
    made.restart("simulation", -9, stepping=True)
    assert not any("from_state" in word for word in started[-1])
    write_whole(state, b"of this run")
    made.restart("simulation", -9, stepping=True)
    assert f'from_state:="{state}"' in started[-1]
    made.close()


@pytest.mark.long
def test_what_dies_again_and_again_stays_dead_and_the_run_says_so(
    bench: Bench, processes: Processes, tmp_path: Path
) -> None:
    campaign = Campaign(bench, processes, tmp_path)
    for _ in range(3):
        campaign.kill("sea_state")
    os.kill(campaign.pids()["sea_state"], signal.SIGKILL)
    bench.until(lambda: "is not restarted: 3 restarts within" in campaign.run.text, "word")
    campaign.spin(1.0)
    assert "sea_state" not in campaign.pids()
    assert "simulation" in campaign.pids()  # the twin goes on without it
    text = campaign.end()
    assert campaign.run.wait() == 1
    assert '"not_running": "the sea_state process ended (killed by SIGKILL)' in text
