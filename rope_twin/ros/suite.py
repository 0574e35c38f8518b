"""All nodes in one process on one executor; recorder, viewer and twin on threads of their own."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import rclpy
from rclpy.executors import SingleThreadedExecutor

from rope_twin.errors import InputError
from rope_twin.ros.ahead import CompilingAhead
from rope_twin.ros.company import Seat, refuse_company
from rope_twin.ros.entry import StopSignal, initialise, keep_to_loopback
from rope_twin.ros.executor import make_executor
from rope_twin.ros.params import overrides
from rope_twin.ros.recorder_node import RecorderNode
from rope_twin.ros.sea_state_node import SeaStateNode
from rope_twin.ros.simulation_node import SimulationNode
from rope_twin.ros.winch_schedule_node import WinchScheduleNode
from rope_twin.run.options import RunOptions
from rope_twin.run.progress import FigureProgress
from rope_twin.run.summary import RunSummary
from rope_twin.scene.load import load_scene

_WAIT_S = 0.1
_QUIET_S, _DRAIN_S = 0.2, 3.0
# Who speaks ends first, who listens last.
END_ORDER = ("simulation", "sea_state", "winch_schedule", "viewer", "recorder")


def node_parameters(options: RunOptions) -> dict[str, dict[str, Any]]:
    """The parameters of each node that these options ask for; the keys are the nodes to start."""
    speed = {"speed": options.speed}
    cut = {"allow_cut": options.allow_cut or bool(options.cut)}
    nodes: dict[str, dict[str, Any]] = {}
    nodes["sea_state"] = {
        "scene": options.scene,
        "bag": options.bag,
        "poses": options.poses,
        "topic": options.topic,
        "start_s": options.sea_offset_s,
        **speed,
    }
    nodes["winch_schedule"] = {"scene": options.scene, "cut": options.cut, **speed}
    # After those that read what the user named: nothing is made on disk for a mistyped name.
    if options.record is not None:
        nodes["recorder"] = {"directory": str(options.record), **cut}
    if options.view is not None:
        nodes["viewer"] = {"file": str(options.view_file or "")}
    nodes["simulation"] = {
        "scene": options.scene,
        "stop_after_s": options.end_s or 0.0,
        "save_to": str(options.save or ""),
        "start_from": str(options.start_from or ""),
        "failure_directory": str(options.failure_folder),
        "energy": options.energy,
        "elements": options.elements or 0,
        "step_s": options.step_s or 0.0,
        "error_band": options.error_band,
        "other_sea": options.other_sea,
        **cut,
        "vibration": options.watch.vibration if options.watch else "",
        "fatigue": options.watch.fatigue if options.watch else "",
        **speed,
    }
    return nodes


class Suite:
    """The nodes of a run, from their start to their end."""

    def __init__(self, options: RunOptions) -> None:
        self._options = options
        self._nodes: dict[str, Any] = {}
        self._executor: SingleThreadedExecutor | None = None
        self._ahead: CompilingAhead | None = None
        self._seat: Seat | None = None
        self.not_recorded = 0  # messages, known when closed
        self.not_kept = ""  # why the bag is not whole, likewise

    def start(self, ready: Callable[[], None], stop: StopSignal) -> None:
        """Make all nodes; the simulation comes last, when everybody listens.

        `ready` is called when everything that the user named was found, before the twin is built.

        Raises:
            RopeTwinError: one sentence; `close` is still to be called.
            KeyboardInterrupt: told to stop before the twin was built; as above.
        """
        load_scene(self._options.scene)  # what is wrong with it is said before anything else
        self._ahead = CompilingAhead(self._options)
        initialise(["rope_twin"])
        self._executor = make_executor()
        for name, parameters in node_parameters(self._options).items():
            node = _make(name, parameters)
            self._nodes[name] = node
            self._executor.add_node(node)
            if name == "simulation":
                ready()
                self._ahead.wait(stop)
                self._seat = refuse_company(node)
                stop.note = "\nending as soon as the twin is built; again: at once\n"
            if stop.requested:
                raise KeyboardInterrupt
            node.begin()
        stop.note = ""

    @property
    def simulation(self) -> SimulationNode:
        """The node that steps the rope."""
        node: SimulationNode = self._nodes["simulation"]
        return node

    @property
    def ended(self) -> bool:
        """Whether the run is over by itself: all steps done, or the solver cannot go on."""
        paced = self.simulation.paced
        return self.simulation.finished or (paced is not None and bool(paced.pacer.health().error))

    def spin(self, wait_s: float = _WAIT_S) -> None:
        """Let the executor do what is due."""
        assert self._executor is not None
        self._executor.spin_once(timeout_sec=wait_s)

    def summary(self) -> RunSummary:
        """The figures so far. Raises InputError while there is no twin yet."""
        if self.simulation.paced is None:
            raise InputError("the simulation has not started.")
        options = self._options
        return replace(
            self.simulation.paced.summary(),
            bag=str(options.record) if options.record else None,
            view=options.view if "viewer" in self._nodes else None,
        )

    def close(self) -> None:
        """End who speaks, let the recorder take what is under way, then end who listens."""
        if self._ahead is not None:
            self._ahead.end()
        for name in END_ORDER:
            if name not in self._nodes:
                continue
            if name == "recorder":
                self._drain()
                self._nodes[name].close()
                self.not_recorded = self._nodes[name].lost
                self.not_kept = self._nodes[name].failure
            else:
                self._nodes[name].close()
        if self._executor is not None:
            self._executor.shutdown()
        self._executor = None
        for node in self._nodes.values():
            node.destroy_node()
        self._nodes.clear()
        rclpy.try_shutdown()
        if self._seat is not None:
            self._seat.leave()

    def _drain(self) -> None:
        """Spin until nothing has come to the recorder for a while."""
        recorder: RecorderNode = self._nodes["recorder"]
        give_up = time.monotonic() + _DRAIN_S
        received, quiet_since = recorder.received, time.monotonic()
        while time.monotonic() < give_up and time.monotonic() - quiet_since < _QUIET_S:
            self.spin(_QUIET_S / 4)
            if recorder.received != received:
                received, quiet_since = recorder.received, time.monotonic()


def run_suite(options: RunOptions, progress: FigureProgress) -> RunSummary:
    """Run until the end of `end_s`, Ctrl-C or a solver that cannot go on; then end cleanly.

    Raises:
        RopeTwinError: the suite could not start; one sentence.
        KeyboardInterrupt: told to stop before the twin was built.
    """
    if not options.network:
        keep_to_loopback()
    stop = StopSignal()
    suite = Suite(options)
    try:
        suite.start(lambda: progress.say(where(options)), stop)
        while not (stop.requested or suite.ended) and rclpy.ok():
            suite.spin()
            if progress.due:
                progress.show(suite.summary())
        suite.simulation.close()
        summary = suite.summary()
        suite.close()
        not_kept = " ".join(filter(None, (suite.not_kept, summary.not_kept)))
        return replace(summary, not_recorded=suite.not_recorded, not_kept=not_kept)
    finally:
        suite.close()
        stop.restore()


def where(options: RunOptions) -> str:
    """What is recorded and shown where."""
    parts = [f"recording to {options.record}" if options.record else "recording nothing"]
    if options.screen:
        parts.append("showing in a rerun window")
    elif options.view_file:
        parts.append(f"no window, the view goes to {options.view_file}")
    words = "; ".join(parts) + "; Ctrl-C ends it"
    return f"{words}\nbuilding the twin (the first time it is compiled, which takes a while)"


def _make(name: str, parameters: dict[str, Any]) -> Any:
    made: dict[str, type[Any]] = {
        "recorder": RecorderNode,
        "sea_state": SeaStateNode,
        "winch_schedule": WinchScheduleNode,
        "simulation": SimulationNode,
    }
    if name == "viewer":  # imported only where it is wanted: rerun is an extra
        from rope_twin.ros.viewer_node import ViewerNode

        made[name] = ViewerNode
    return made[name](parameter_overrides=overrides(parameters))
