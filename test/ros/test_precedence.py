"""All Python threads beside a paced twin run ahead of other programs, a place behind its steps.

Skipped where the system lets nobody run ahead.
"""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import time
from collections.abc import Iterator

import pytest

from rope_twin.ros.paced_twin import PacedTwin
from rope_twin.ros.params import SimulationParams
from rope_twin.scene.load import load_scene
from rope_twin.twin.pacing import (
    OTHER_PRIORITY,
    STEPPING_PRIORITY,
    raise_other_threads,
    raise_stepping_thread,
    reset_threads,
)

ORDINARY = (os.SCHED_OTHER, 0)
_POLICY = "import os; print(os.sched_getscheduler(0), os.sched_getparam(0).sched_priority)"


def place_of(thread: threading.Thread) -> tuple[int, int]:
    """Policy and priority of a thread."""
    assert thread.native_id is not None
    policy = os.sched_getscheduler(thread.native_id) & ~os.SCHED_RESET_ON_FORK
    return policy, os.sched_getparam(thread.native_id).sched_priority


def allowed() -> bool:
    """Return whether a thread may have priority here; asked by one that ends at once."""
    found: list[bool] = []
    asking = threading.Thread(target=lambda: found.append(raise_stepping_thread()))
    asking.start()
    asking.join()
    return found == [True]


pytestmark = pytest.mark.skipif(not allowed(), reason="no real-time priority for this user")


@pytest.fixture
def waiting() -> Iterator[threading.Thread]:
    """A thread that waits until the test has ended; all are ordinary again then."""
    ended = threading.Event()
    thread = threading.Thread(target=ended.wait)
    thread.start()
    yield thread
    ended.set()
    thread.join()
    reset_threads()


def test_every_thread_goes_ahead_and_falls_back(waiting: threading.Thread) -> None:
    raise_other_threads()
    for thread in (threading.current_thread(), waiting):
        assert place_of(thread) == (os.SCHED_RR, OTHER_PRIORITY)
    reset_threads()
    for thread in (threading.current_thread(), waiting):
        assert place_of(thread) == ORDINARY


def test_a_program_that_is_started_beside_the_steps_is_ordinary(waiting: threading.Thread) -> None:
    raise_other_threads()
    reported = subprocess.run([sys.executable, "-c", _POLICY], capture_output=True, check=True)
    assert tuple(map(int, reported.stdout.split())) == ORDINARY


def test_a_paced_twin_steps_ahead_of_all_that_is_beside_it(waiting: threading.Thread) -> None:
    params = SimulationParams(scene="shallow_lift")
    twin = PacedTwin(load_scene("shallow_lift"), params, lambda name, data: None)
    twin.begin(0)
    give_up = time.monotonic() + 30.0
    while twin.pacer.health().steps == 0 and time.monotonic() < give_up:
        time.sleep(0.01)
    places = {thread.name: place_of(thread) for thread in threading.enumerate()}
    twin.halt()
    assert places.pop("twin-steps") == (os.SCHED_RR, STEPPING_PRIORITY)
    assert places["twin-publisher"] == (os.SCHED_RR, OTHER_PRIORITY)
    assert set(places.values()) == {(os.SCHED_RR, OTHER_PRIORITY)}
    assert place_of(waiting) == place_of(threading.current_thread()) == ORDINARY
