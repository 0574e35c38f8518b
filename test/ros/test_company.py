"""Twins beside each other on one ROS domain: one works, and what comes by turns is told."""

from __future__ import annotations

import json
import signal
from typing import Any

import pytest
from ros_process import Process, Processes

from rope_twin.ros.company import Turns


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
    second = processes.cli("run", "deep_lift", "--headless", "--no-record", "--for", "9")
    assert second.wait() == 1
    assert "another twin is at work there" in second.text
    assert "Traceback" not in second.text
    first.send(signal.SIGINT)
    assert first.wait() == 0
    summary = summary_of(first)
    assert summary["mixed"] == ""
    assert summary["heave_refused"] == summary["heave_late"]


@pytest.mark.ros
def test_a_run_can_begin_where_another_was_killed(processes: Processes) -> None:
    """The middleware knows the dead one for a while."""
    first = processes.cli("run", "shallow_lift", "--headless", "--no-record")
    first.until_says("late")
    first.kill()
    second = processes.cli("run", "shallow_lift", "--headless", "--no-record", "--for", "2")
    assert second.wait() == 0


def test_senders_by_turns_mix_and_one_after_another_do_not() -> None:
    one, other = ({"publisher_gid": {"data": name}} for name in (b"one", b"other"))
    turns = Turns()
    for info in (one, one, other, other):
        turns.count(info)
    assert not turns.mixed
    turns.count(one)
    assert turns.mixed
