"""The suite's entry points as processes, which are always ended."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

from ros_bench import PATIENCE_S, Bench

# The command line, but sea and winch speak three seconds ahead: what a test expects of inputs that
# come in time holds on a machine that holds a process up for a while, too.
_EARLY = """
import sys
from rope_twin.cli import main
from rope_twin.ros import processes, suite

given = suite.node_parameters

def early(options):
    nodes = given(options)
    for name in ("sea_state", "winch_schedule"):
        nodes[name]["lead_s"] = 3.0
    return nodes

suite.node_parameters = processes.node_parameters = early
sys.exit(main(sys.argv[1:]))
"""


def _heed_hang_up() -> None:
    """Restore SIGHUP, which nohup ignores in the tests and in every process they start."""
    signal.signal(signal.SIGHUP, signal.SIG_DFL)


class Process:
    """One process; its output goes to a file that can be read while it runs."""

    def __init__(self, arguments: list[str], output: Path, **environment: str) -> None:
        self.output = output
        with output.open("wb") as stream:
            self.popen = subprocess.Popen(
                [sys.executable, *arguments],
                stdout=stream,
                stderr=subprocess.STDOUT,
                env={**os.environ, **environment},
                start_new_session=True,
                preexec_fn=_heed_hang_up,
            )

    @property
    def text(self) -> str:
        return self.output.read_text(encoding="utf-8", errors="replace")

    @property
    def ended(self) -> bool:
        return self.popen.poll() is not None

    def send(self, number: int) -> None:
        self.popen.send_signal(number)

    def wait(self, timeout_s: float = PATIENCE_S) -> int:
        """Return the exit code; fail with the output at the deadline."""
        try:
            return self.popen.wait(timeout_s)
        except subprocess.TimeoutExpired:
            self.kill()
            raise AssertionError(f"still running after {timeout_s:g} s:\n{self.text}") from None

    def until_says(self, pattern: str, timeout_s: float = PATIENCE_S) -> None:
        """Wait for a regular expression in the output."""
        deadline = time.monotonic() + timeout_s
        while not re.search(pattern, self.text):
            assert not self.ended, f"ended without saying {pattern!r}:\n{self.text}"
            assert time.monotonic() < deadline, f"did not say {pattern!r}:\n{self.text}"
            time.sleep(0.02)

    def kill(self) -> None:
        """Kill the process and everything it started in its session."""
        if not self.ended:
            os.killpg(self.popen.pid, signal.SIGKILL)
            self.popen.wait()


class Processes:
    """Start processes and end them all."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._all: list[Process] = []

    def start(self, arguments: list[str], **environment: str) -> Process:
        process = Process(arguments, self._folder / f"output_{len(self._all)}", **environment)
        self._all.append(process)
        return process

    def node(self, name: str, **parameters: Any) -> Process:
        """Start a node's entry point by the node's name."""
        from rope_twin.ros.processes import node_command

        return self.start(node_command(name, parameters)[1:])

    def cli(self, *arguments: str) -> Process:
        return self.start(["-m", "rope_twin", *arguments])

    def early(self, *arguments: str) -> Process:
        """Start `cli` with inputs that come three seconds ahead."""
        return self.start(["-c", _EARLY, *arguments])

    def close(self) -> None:
        for process in self._all:
            process.kill()


def until_running(bench: Bench, heard: list[Any], what: str) -> None:
    """Spin until new messages come."""
    count = len(heard)
    bench.until(lambda: len(heard) > count + 5, what)
