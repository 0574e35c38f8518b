"""A process of its own compiles while the nodes are made: what becomes of it, and what it leaves.

That a run with nothing compiled takes the code from there, in its figures on the way:

    pytest -n 0 -m long -s test/ros/test_precompile.py
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from rope_twin.ros import suite
from rope_twin.ros.params import NODES, node_parameters
from rope_twin.ros.suite import Precompilation
from rope_twin.run.options import RunOptions
from rope_twin.run.progress import StopSignal

FROM_THE_CACHE = """
from rope_twin.run.options import RunOptions
from rope_twin.core.step import advance_steps
from rope_twin.ros.suite import Precompilation
from rope_twin.run.progress import StopSignal
from rope_twin.scene.load import load_scene
from rope_twin.twin.twin import Twin

precompile = Precompilation(RunOptions(scene="still_water"))
precompile.wait(StopSignal())
Twin(load_scene("still_water"))
stats = advance_steps.stats
print(sum(stats.cache_hits.values()), sum(stats.cache_misses.values()))
"""


def test_a_spare_can_become_each_node_of_a_run() -> None:
    everything = RunOptions(
        scene="still_water", record=Path("bag"), console="127.0.0.1:0", ahead=True
    )
    assert sorted(node_parameters(everything)) == sorted(NODES)


@pytest.fixture
def stop() -> StopSignal:
    signal = StopSignal()
    signal.restore()
    return signal


def test_it_is_waited_for_until_it_ends(stop: StopSignal) -> None:
    compiling = Precompilation(RunOptions(scene="still_water"))
    compiling.wait(stop)
    assert compiling.exit_code == 0
    compiling.end()


def test_who_is_reported_to_stop_does_not_wait(
    stop: StopSignal, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(suite, "_build", lambda options: time.sleep(600.0))
    compiling = Precompilation(RunOptions())
    stop.requested = True
    with pytest.raises(KeyboardInterrupt):
        compiling.wait(stop)
    compiling.end()
    assert compiling.exit_code is not None
    compiling.end()


def test_what_is_wrong_is_left_for_the_twin_itself_to_tell(
    stop: StopSignal, capfd: pytest.CaptureFixture[str]
) -> None:
    """A scene that there is no more: the other process says nothing, and nobody waits."""
    compiling = Precompilation(RunOptions(scene="no_such_scene"))
    compiling.wait(stop)
    assert compiling.exit_code == 1
    assert capfd.readouterr() == ("", "")


@pytest.mark.long
def test_nothing_is_compiled_where_the_twin_is_built(tmp_path: Path) -> None:
    """With an empty cache, in a fresh process."""
    there = {**os.environ, "ROPE_TWIN_CACHE": str(tmp_path)}
    reported = subprocess.run(
        [sys.executable, "-c", FROM_THE_CACHE], env=there, capture_output=True, text=True
    )
    assert reported.stdout.split() == ["1", "0"], reported.stderr
