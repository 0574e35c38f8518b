"""All nodes in one process on one executor; recorder, viewer and solver have their own threads."""

from __future__ import annotations

import importlib
import multiprocessing
import os
import signal
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import rclpy
from rclpy.executors import SingleThreadedExecutor

from rope_twin.core.jit.decorators import make_ready
from rope_twin.errors import InputError
from rope_twin.ros.entry import InstanceLock, SuiteNode, initialise, leave, lock_instance
from rope_twin.ros.middleware import keep_to_loopback, make_executor
from rope_twin.ros.params import NODES, node_parameters, overrides
from rope_twin.ros.recorder_node import RecorderNode
from rope_twin.ros.simulation_node import SimulationNode
from rope_twin.run.options import RunOptions
from rope_twin.run.progress import FigureProgress, StopSignal, ending_signals
from rope_twin.run.summary import RunSummary
from rope_twin.scene.load import at_setting, load_scene
from rope_twin.twin.twin import Twin

_WAIT_S = 0.1
_QUIET_S, _DRAIN_S = 0.2, 3.0


class Precompilation:
    """Process that compiles while the nodes are made; a fork, to be started before any thread.

    The first start of a set of effects compiles it, which takes more than 10 s on one core. This
    process only leaves compiled code in the cache: when it is done, the twin is built here from the
    cache, and errors of the scene are reported here as usual.
    """

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


class Suite:
    """Nodes of a run, from start to shutdown."""

    def __init__(self, options: RunOptions) -> None:
        self._options = options
        self._nodes: dict[str, Any] = {}
        self._executor: SingleThreadedExecutor | None = None
        self._precompilation: Precompilation | None = None
        self._lock: InstanceLock | None = None
        self.not_recorded = 0  # messages missing in the bag, known when closed
        self.not_shown = ""  # why the view is incomplete, known when closed
        self.not_kept = ""  # why the bag is incomplete, known when closed

    def start(self, ready: Callable[[], None], stop: StopSignal) -> None:
        """Make all nodes, the simulation last, when all others subscribe.

        `ready` is called when all files that the user named are found, before the twin is built.

        Raises:
            RopeTwinError: a node cannot start; one sentence. `close` must still be called.
            KeyboardInterrupt: a stop was requested before the twin was built; likewise.
        """
        load_scene(self._options.scene)  # errors of the scene are reported first
        self._precompilation = Precompilation(self._options)
        initialise(["rope_twin"])
        self._executor = make_executor()
        leave(executor=self._executor)  # shut down before the nodes are destroyed
        for name, parameters in node_parameters(self._options).items():
            node = _make(name, parameters)
            self._nodes[name] = node
            self._executor.add_node(node)
            if name == "simulation":
                ready()
                self._precompilation.wait(stop)
                self._lock = lock_instance(node)
                stop.note = "\nstopping as soon as the twin is built; again: immediately\n"
            if stop.requested:
                raise KeyboardInterrupt
            node.begin()
        stop.note = ""

    @property
    def simulation(self) -> SimulationNode:
        """Return the simulation node."""
        node: SimulationNode = self._nodes["simulation"]
        return node

    @property
    def ended(self) -> bool:
        """Return whether the run has ended: all steps done, or the solver failed."""
        paced = self.simulation.paced
        return self.simulation.finished or (paced is not None and bool(paced.pacer.health().error))

    def spin(self, wait_s: float = _WAIT_S) -> None:
        """Run the callbacks that are due."""
        assert self._executor is not None
        self._executor.spin_once(timeout_sec=wait_s)

    def summary(self) -> RunSummary:
        """Return the run summary up to now.

        Raises:
            InputError: the simulation has not started.
        """
        if self.simulation.paced is None:
            raise InputError("the simulation has not started.")
        options = self._options
        return replace(
            self.simulation.paced.summary(),
            bag=str(options.record) if options.record else None,
            view=options.shown if "viewer" in self._nodes else None,
        )

    def close(self) -> None:
        """Shut down the publishing nodes, let the recorder drain, then shut down the others."""
        if self._precompilation is not None:
            self._precompilation.end()
        for name in NODES:
            if name not in self._nodes:
                continue
            if name == "recorder":
                self._drain()
                self._nodes[name].close()
                self.not_recorded = self._nodes[name].lost
                self.not_kept = self._nodes[name].failure
            else:
                self._nodes[name].close()
            if name == "viewer":
                self.not_shown = self._nodes[name].failure
        for node in self._nodes.values():
            leave(node)
        self._nodes.clear()
        if self._lock is not None:
            self._lock.release()

    def _drain(self) -> None:
        """Spin until the recorder has received no message for a while."""
        recorder: RecorderNode = self._nodes["recorder"]
        give_up = time.monotonic() + _DRAIN_S
        received, quiet_since = recorder.received, time.monotonic()
        while time.monotonic() < give_up and time.monotonic() - quiet_since < _QUIET_S:
            self.spin(_QUIET_S / 4)
            if recorder.received != received:
                received, quiet_since = recorder.received, time.monotonic()


def run_suite(options: RunOptions, progress: FigureProgress) -> RunSummary:
    """Run until the end of `end_s`, a signal or a solver failure; then shut down cleanly.

    `entry.release` is left to the caller.

    Raises:
        RopeTwinError: the suite could not start; one sentence.
        KeyboardInterrupt: a stop was requested before the twin was built.
    """
    if not options.network:
        keep_to_loopback()
    stop = StopSignal(signal.SIG_DFL)
    suite = Suite(options)
    try:
        suite.start(lambda: progress.say(options.announcement), stop)
        while not (stop.requested or suite.ended) and rclpy.ok():
            suite.spin()
            if progress.due:
                progress.show(suite.summary().as_progress())
        suite.simulation.close()
        summary = suite.summary()
        suite.close()
        not_kept = " ".join(filter(None, (suite.not_kept, summary.not_kept)))
        view = None if suite.not_shown else summary.view
        return replace(summary, view=view, not_recorded=suite.not_recorded, not_kept=not_kept)
    finally:
        suite.close()
        stop.restore()


def _make(name: str, parameters: dict[str, Any]) -> SuiteNode:
    """Make a node; its module is imported only now, since those of some need optional libraries."""
    kind = name.title().replace("_", "") + "Node"
    module = importlib.import_module(f"rope_twin.ros.{name}_node")
    node: SuiteNode = getattr(module, kind)(parameter_overrides=overrides(parameters))
    return node
