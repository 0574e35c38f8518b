"""A node whose middleware does not release its resources ends all the same, with its own exit code.

A FastDDS participant was seen to spin for 15 minutes after the bag was closed. rclpy holds the
interpreter's lock there, so that neither a signal handler nor a thread of Python would run: one of
the teardowns below holds it too.
"""

from __future__ import annotations

import json
import subprocess
import sys
import time
from pathlib import Path

import pytest

pytestmark = pytest.mark.ros

PATIENCE_S = 60.0  # a loaded machine takes seconds to import rclpy
HANGS = {
    "in Python": "time.sleep(600)",
    "in C, with the interpreter's lock": "ctypes.PyDLL(None).sleep(600)",
    "in C, without it": "ctypes.CDLL(None).sleep(600)",
}
NODE = """
import ctypes, sys, time
from pathlib import Path
from rclpy.node import Node
from rope_twin.errors import InputError
from rope_twin.ros import entry

class Held(Node):
    finished = True
    exit_code = {verdict}
    def __init__(self): super().__init__("held")
    def begin(self): {begin}
    def close(self): Path({written!r}).write_text("complete")
    def destroy_node(self): {teardown}

entry.END_S = {end_s}
code = entry.run_node(Held, ["held"])
{after}
sys.exit(code)
"""


def ended(
    folder: Path,
    teardown: str,
    begin: str = "pass",
    verdict: int = 0,
    end_s: float = 0.3,
    after: str = "pass",
) -> tuple[int, str, str]:
    """Exit code, standard error and the file that the node wrote when it was closed."""
    written = folder / "bag"
    text = NODE.format(
        begin=begin, written=str(written), teardown=teardown, end_s=end_s, verdict=verdict,
        after=after,
    )  # fmt: skip
    command = [sys.executable, "-c", text]
    done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S)
    return done.returncode, done.stderr, written.read_text()


@pytest.mark.parametrize("hang", HANGS.values(), ids=list(HANGS))
@pytest.mark.usefixtures("domain")
def test_a_teardown_that_hangs_is_ended_once_all_is_written(hang: str, tmp_path: Path) -> None:
    code, said, written = ended(tmp_path, hang)
    assert (code, written) == (0, "complete")
    (sentence,) = said.strip().splitlines()
    assert "middleware did not release the resources of this node" in sentence


@pytest.mark.usefixtures("domain")
def test_the_exit_code_is_the_runs_own(tmp_path: Path) -> None:
    """A recorder whose bag is incomplete, and a node that could not begin."""
    hang = HANGS["in C, with the interpreter's lock"]
    assert ended(tmp_path, hang, verdict=1)[0] == 1
    code, said, _ = ended(tmp_path, hang, begin="raise InputError('no such scene.')")
    assert code == 1
    assert said.startswith("no such scene.\n")


@pytest.mark.usefixtures("domain")
def test_a_node_that_ends_in_time_is_left_alone(tmp_path: Path) -> None:
    """Its process may go on for longer than the teardown was allowed to take."""
    began_s = time.monotonic()
    code, said, _ = ended(tmp_path, "Node.destroy_node(self)", end_s=2.0, after="time.sleep(3.0)")
    assert time.monotonic() - began_s > 3.0
    assert (code, said) == (0, "")


RUN = """
import sys, time
from rope_twin.cli import main
from rope_twin.ros import entry, processes

def hang(self): time.sleep(600)

entry.SuiteNode.destroy_node = processes.Monitor.destroy_node = hang
entry.END_S = 0.3
sys.exit(main(["run", "shallow_lift", "--duration", "1s", "--headless", "--json", *sys.argv[1:]]))
"""


@pytest.mark.parametrize("how", [[], ["--processes"]], ids=["one process", "processes"])
@pytest.mark.usefixtures("domain")
def test_a_run_prints_its_summary_before_a_teardown_that_hangs(
    how: list[str], tmp_path: Path
) -> None:
    """FastDDS deadlocks when a participant leaves while its own timer announces it (#6502)."""
    command = [sys.executable, "-c", RUN, "--out", str(tmp_path / "bag"), *how]
    done = subprocess.run(command, capture_output=True, text=True, timeout=2 * PATIENCE_S)
    assert done.returncode == 0
    assert json.loads(done.stdout)["steps"] == 100
    assert "middleware did not release" in done.stderr
