"""Processes that shorten a start: precompilation, and a spare for a node that has died.

The first start of a set of effects compiles it, which takes more than 10 s on one core. Making the
nodes, reading the sea and loading the viewer takes 2 s, as does a complete start with cached code.
The precompiling process only leaves compiled code in the cache: when it is done, the twin is built
here from the cache, and errors of the scene are reported here as usual.

A spare has imported everything, and has loaded the compiled code of the scene, before a node dies:
importing the libraries takes a process longer than all the rest of its start. It then reads the
node's name and arguments from its standard input and continues as that node.
"""

from __future__ import annotations

import importlib
import json
import multiprocessing
import os
import select
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

from rope_twin.core.jit.decorators import make_ready
from rope_twin.errors import RopeTwinError
from rope_twin.ros.params import NODES
from rope_twin.run.options import RunOptions
from rope_twin.run.progress import StopSignal, ending_signals
from rope_twin.scene.load import at_setting, load_scene
from rope_twin.twin.twin import Twin

_WAIT_S = 0.1  # delay until a signal is noticed


class Precompilation:
    """Compiling process. It is a fork, which has all modules: start it before any thread."""

    def __init__(self, options: RunOptions) -> None:
        fork = multiprocessing.get_context("fork")
        self._process = fork.Process(target=_build, args=(options,), daemon=True)
        self._process.start()

    @property
    def exit_code(self) -> int | None:
        """Return the exit code; 0: all code is compiled, None: still running."""
        return self._process.exitcode

    def wait(self, stop: StopSignal) -> None:
        """Wait until the process has ended, successfully or not.

        Raises:
            KeyboardInterrupt: a stop was requested.
        """
        make_ready()
        while self._process.is_alive():
            if stop.requested:
                raise KeyboardInterrupt
            self._process.join(_WAIT_S)

    def end(self) -> None:
        """Terminate the process if it still runs; may be called twice."""
        if self._process.is_alive():
            self._process.terminate()
        self._process.join()


def _build(options: RunOptions) -> None:
    """Build the run's twin and drop it, with all output suppressed: the real build repeats it."""
    for number in ending_signals():
        signal.signal(number, signal.SIG_DFL)
    sys.stdout = sys.stderr = os.fdopen(os.open(os.devnull, os.O_WRONLY), "w")
    scene = at_setting(load_scene(options.scene), options.elements, options.step_s)
    Twin(scene, options.monitors)


_COMM = Path("/proc/self/comm")  # the name that `ps` and `top` show, on Linux


class Spare:
    """Spare process of a run, as the process that starts the nodes sees it."""

    def __init__(self, scene: str, environment: dict[str, str]) -> None:
        # A session of its own, as every node has: Ctrl-C comes to the run's own process alone.
        self.process = subprocess.Popen(
            [sys.executable, "-m", "rope_twin.ros.startup", scene],
            stdin=subprocess.PIPE,
            env=environment,
            start_new_session=True,
        )

    @property
    def waits(self) -> bool:
        """Return whether the process is still waiting to become a node."""
        return self.process.poll() is None

    def become(self, node: str, arguments: list[str]) -> bool:
        """Make the process continue as a node; return False if it has ended."""
        assert self.process.stdin is not None
        try:
            with self.process.stdin as pipe:
                pipe.write(json.dumps([node, arguments]).encode() + b"\n")
        except OSError:
            return False
        return True

    def close(self) -> None:
        """Kill the process."""
        self.process.kill()
        self.process.wait()
        if self.process.stdin is not None:
            with suppress(OSError):
                self.process.stdin.close()


def main(scene: str) -> int:
    """Wait for a node's name and arguments, run it and return its exit code.

    The code is 0 if no node is wanted.
    """
    for number in ending_signals():  # until it is a node, only the run's own process ends it
        signal.signal(number, signal.SIG_IGN)
    modules = {}
    for node in NODES:
        with suppress(ImportError):  # the viewer needs an extra
            modules[node] = importlib.import_module(f"rope_twin.ros.{node}_node")
    if not select.select([sys.stdin], [], [], 0.0)[0]:  # else it is wanted already
        with suppress(RopeTwinError):  # the node itself reports what is wrong with the scene
            Twin(load_scene(scene)).advance(1)
    line = sys.stdin.readline()
    if not line:  # the run's own process is gone
        return 0
    node, arguments = json.loads(line)
    for number in ending_signals():
        signal.signal(number, signal.SIG_DFL)
    with suppress(OSError):
        _COMM.write_text(node)
    sys.argv = [f"rope_twin.ros.{node}_node", *arguments]
    return int(modules[node].main(sys.argv))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
