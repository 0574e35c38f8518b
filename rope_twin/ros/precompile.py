"""Precompilation: a separate process builds the twin while this one makes the other nodes.

The first start of a set of effects compiles it, which takes more than 10 s on one core. Making the
nodes, reading the sea and loading the viewer takes 2 s, as does a complete start with cached code.
The other process only leaves compiled code in the cache: when it is done, the twin is built here
from the cache, and errors of the scene are reported here as usual.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys

from rope_twin.core.jit.decorators import make_ready
from rope_twin.ros.entry import StopSignal
from rope_twin.run.ending import ending_signals
from rope_twin.run.options import RunOptions
from rope_twin.scene.change import at_setting
from rope_twin.scene.load import load_scene
from rope_twin.twin.kinds import twin_class

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
    twin_class(options.energy, options.error_band, options.watch)(scene)
