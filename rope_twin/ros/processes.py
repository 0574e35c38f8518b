"""Each node as a process of its own, watched from here through the diagnostics."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from typing import Any

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from rope_twin.cadence import SNAPSHOT_TOPICS
from rope_twin.commands.console import FigureProgress
from rope_twin.commands.run.options import RunOptions
from rope_twin.commands.run.summary import RunSummary
from rope_twin.errors import InputError, phrase
from rope_twin.messages import decode
from rope_twin.ros.entry import PARENT, StopSignal, initialise
from rope_twin.ros.qos import message_type, profile
from rope_twin.ros.run_status import RUN_ROW
from rope_twin.ros.suite import END_ORDER, node_parameters, where
from rope_twin.scene.load import load_scene
from rope_twin.scene.rules.rigging import winches_by_name
from rope_twin.topics import BY_NAME, CUT_TOPIC

_WAIT_S = 0.1
_FIND_S = 20.0  # what processes may take to start and to find each other
_END_S = 15.0  # what a process may take to end before it is killed


class Monitor(Node):
    """Reads the figures of the run out of the diagnostics."""

    def __init__(self) -> None:
        super().__init__("monitor")
        topic = BY_NAME["diagnostics"]
        self.summary: RunSummary | None = None
        self.create_subscription(
            message_type(topic), topic.name, self._take, profile(topic.qos), raw=True
        )

    def _take(self, data: bytes) -> None:
        for status in decode("diagnostics", data).status:
            if status.name == RUN_ROW:
                self.summary = RunSummary.from_values({v.key: v.value for v in status.values})


class Processes:
    """The processes of a run."""

    def __init__(self, options: RunOptions) -> None:
        self._running: dict[str, subprocess.Popen[bytes]] = {}
        environment = {**os.environ, PARENT: str(os.getpid())}
        for name, parameters in node_parameters(options).items():
            if name == "simulation":
                parameters |= {"wait_for": _awaited(options), "wait_for_s": _FIND_S}
            # A session of its own: Ctrl-C comes to us alone, and we end them in order.
            self._running[name] = subprocess.Popen(
                node_command(name, parameters), env=environment, start_new_session=True
            )

    @property
    def names(self) -> list[str]:
        """What runs, in the order of starting."""
        return list(self._running)

    def ended(self) -> dict[str, int]:
        """Exit codes (negative: killed by that signal) of processes that have ended since."""
        codes = {name: process.poll() for name, process in self._running.items()}
        over = {name: code for name, code in codes.items() if code is not None}
        for name in over:
            del self._running[name]
        return over

    def tell(self, name: str) -> None:
        """Ask one to end."""
        if name in self._running:
            self._running[name].send_signal(signal.SIGINT)

    def kill(self) -> list[str]:
        """Kill whatever still runs; its names."""
        left = list(self._running)
        for process in self._running.values():
            process.kill()
            process.wait()
        self._running.clear()
        return left


def node_command(name: str, parameters: dict[str, Any]) -> list[str]:
    """The command line of a node with its parameters (as YAML, so JSON will do)."""
    command = [sys.executable, "-m", f"rope_twin.ros.{name}_node", "--ros-args"]
    for key, value in parameters.items():
        if value != "":
            command += ["-p", f"{key}:={json.dumps(value)}"]
    return command


def _awaited(options: RunOptions) -> str:
    """What the twin is to await: the inputs that will come, and the recorder on every topic."""
    scene = load_scene(options.scene)
    posed = bool(options.poses) or (scene.sea_state.posed and not options.bag)
    motion = "ship/odometry" if posed else "ship/heave"
    topics = [motion] if options.bag or options.poses or scene.sea_state.moves else []
    scheduled = any(winch.schedule for winch in winches_by_name(scene).values())
    topics += ["winch/speed_command"] if scheduled else []
    topics += [CUT_TOPIC] if options.cut else []
    if options.record is not None:
        topics += [topic.name for topic in SNAPSHOT_TOPICS]
    return " ".join(topics)


def run_processes(options: RunOptions, progress: FigureProgress) -> RunSummary:
    """Start, watch and end the processes.

    Raises:
        RopeTwinError: the scene is wrong, or the simulation ended without a word.
        KeyboardInterrupt: told to stop before there was anything to sum up.
    """
    load_scene(options.scene)  # what is wrong with it is said once, here
    stop = StopSignal()
    processes: Processes | None = None
    try:
        processes = Processes(options)
        initialise(["rope_twin"])
        progress.say(where(options))
        watch = _Watch(processes, progress)
        watch.run(stop)
        watch.end()
        if stop.requested and not watch.heard:
            raise KeyboardInterrupt
        return watch.result(options)
    finally:
        if processes is not None and (left := processes.kill()):
            progress.say(f"killed, since they did not end: {', '.join(left)}")
        rclpy.try_shutdown()
        stop.restore()


class _Watch:
    """Spins the monitor while processes live and end."""

    def __init__(self, processes: Processes, progress: FigureProgress) -> None:
        self._processes = processes
        self._progress = progress
        self._codes: dict[str, int] = {}
        self._monitor = Monitor()
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._monitor)

    @property
    def heard(self) -> bool:
        """Whether the simulation has said anything yet."""
        return self._monitor.summary is not None

    def run(self, stop: StopSignal) -> None:
        """Until told to stop, or the simulation has ended or cannot go on."""
        while not stop.requested and "simulation" not in self._codes and rclpy.ok():
            self._spin()
            summary = self._monitor.summary
            if summary is not None and summary.error:
                break
            if summary is not None and self._progress.due:
                self._progress.show(summary)

    def end(self) -> None:
        """The simulation first, the recorder last, so that nothing said goes unrecorded."""
        for name in END_ORDER:
            self._processes.tell(name)
            give_up = time.monotonic() + _END_S
            while name in self._processes.names and time.monotonic() < give_up:
                self._spin(expected=name)
        self._executor.shutdown()
        self._monitor.destroy_node()

    def result(self, options: RunOptions) -> RunSummary:
        """The last figures that were heard. Raises InputError if there were none."""
        code = self._codes.get("simulation", 0)
        summary = self._monitor.summary
        if summary is None:
            raise InputError(phrase("simulation", f"it ended ({_words(code)}) without a word",
                                    "its own messages above say why"))  # fmt: skip
        error = summary.error or (f"the simulation ended ({_words(code)})" if code else "")
        bag = str(options.record) if options.record else None
        not_kept = summary.not_kept
        if recorder := self._codes.get("recorder", 0):
            ended = phrase(f"bag {bag}", f"its recorder ended ({_words(recorder)})",
                           f"`rope_twin recover {bag}` saves what is there")  # fmt: skip
            not_kept = " ".join(filter(None, (ended, not_kept)))
        return replace(summary, error=error, bag=bag, view=options.view, not_kept=not_kept)

    def _spin(self, expected: str = "") -> None:
        self._executor.spin_once(timeout_sec=_WAIT_S)
        for name, code in self._processes.ended().items():
            self._codes[name] = code
            if name != expected and not (name == "simulation" and code == 0):
                self._progress.say(f"the {name} process ended ({_words(code)})")


def _words(code: int) -> str:
    return f"killed by {signal.Signals(-code).name}" if code < 0 else f"exit code {code}"
