"""Compiling ahead: a process of its own builds the twin while this one makes everybody else.

The first start of a set of effects compiles it, on one core for more than ten seconds; making the
nodes, reading the sea and loading the viewer takes two, and so does all of a start with a set that
is compiled already. The other process leaves compiled code in the cache, nothing else: when it is
done the twin is built here, from there. What is wrong with a scene is then told here as ever.
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
from rope_twin.twin.kinds import twin_kind

_WAIT_S = 0.1  # how soon a signal is noticed


class CompilingAhead:
    """The other process. It is a fork, which has all modules: begin before there are threads."""

    def __init__(self, options: RunOptions) -> None:
        fork = multiprocessing.get_context("fork")
        self._process = fork.Process(target=_build, args=(options,), daemon=True)
        self._process.start()

    @property
    def exit_code(self) -> int | None:
        """0: all is compiled; None: it still runs."""
        return self._process.exitcode

    def wait(self, stop: StopSignal) -> None:
        """Return when it has ended, however.

        Raises:
            KeyboardInterrupt: told to stop.
        """
        make_ready()
        while self._process.is_alive():
            if stop.requested:
                raise KeyboardInterrupt
            self._process.join(_WAIT_S)

    def end(self) -> None:
        """End it if it still runs; harmless when called twice."""
        if self._process.is_alive():
            self._process.terminate()
        self._process.join()


def _build(options: RunOptions) -> None:
    """Build the run's twin and forget it, without a word: the twin itself has the same to say."""
    for number in ending_signals():
        signal.signal(number, signal.SIG_DFL)
    sys.stdout = sys.stderr = os.fdopen(os.open(os.devnull, os.O_WRONLY), "w")
    scene = at_setting(load_scene(options.scene), options.elements, options.step_s)
    twin_kind(options.energy, options.error_band, options.watch)(scene)
