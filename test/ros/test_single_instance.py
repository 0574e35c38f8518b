"""Two simulations on one ROS domain: the second one is refused."""

from __future__ import annotations

import json
import os
import signal
import time
from typing import Any

import pytest
from ros_bench import PATIENCE_S
from ros_process import Process, Processes

from rope_twin.ros.entry import InstanceLock


def summary_of(process: Process) -> dict[str, Any]:
    """The last line of a run with --json."""
    summary = json.loads(process.text.strip().splitlines()[-1])
    assert isinstance(summary, dict)
    return summary


@pytest.mark.ros
def test_a_second_run_beside_another_is_refused_and_the_first_goes_on(
    processes: Processes,
) -> None:
    """Each would take the other's sea and winch: 20 t hung at 3 to 684 kN."""
    first = processes.cli("run", "shallow_lift", "--headless", "--no-record", "--json")
    first.until_says("late")
    second = processes.cli("run", "deep_lift", "--headless", "--no-record", "--duration", "9")
    assert second.wait() == 1
    assert "another simulation" in second.text
    assert "Traceback" not in second.text
    first.send(signal.SIGINT)
    assert first.wait() == 0
    summary = summary_of(first)
    assert summary["mixed"] == ""
    assert summary["heave_refused"] == summary["heave_late"]


@pytest.mark.ros
@pytest.mark.long
def test_of_two_runs_that_begin_at_the_same_moment_one_goes_on(processes: Processes) -> None:
    """Neither is heard by the other when it looks."""
    words = ["run", "shallow_lift", "--headless", "--no-record", "--json"]
    two = [processes.cli(*words) for _ in range(2)]
    give_up = time.monotonic() + PATIENCE_S
    while not any(one.ended for one in two):
        assert time.monotonic() < give_up, "neither gives way"
        time.sleep(0.02)
    (gone,) = (one for one in two if one.ended)
    (left,) = (one for one in two if one is not gone)
    assert gone.wait() == 1
    assert "another simulation" in gone.text
    left.until_says("late")
    left.send(signal.SIGINT)
    assert left.wait() == 0
    assert summary_of(left)["mixed"] == ""


def test_a_lock_is_free_again_when_it_is_released() -> None:
    own = f"a test's own {os.getpid()}"
    one, other, elsewhere = (
        InstanceLock(own, "/"),
        InstanceLock(own, "/"),
        InstanceLock(own, "/aft"),
    )
    assert one.acquire()
    assert not other.acquire()
    assert elsewhere.acquire()
    one.release()
    assert other.acquire()
    for lock in (one, other, elsewhere):
        lock.release()


@pytest.mark.ros
def test_a_run_can_begin_where_another_was_killed(processes: Processes) -> None:
    """The middleware knows the dead one for a while."""
    first = processes.cli("run", "shallow_lift", "--headless", "--no-record")
    first.until_says("late")
    first.kill()
    second = processes.cli("run", "shallow_lift", "--headless", "--no-record", "--duration", "2")
    assert second.wait() == 0
