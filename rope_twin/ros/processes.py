"""Each node as a process of its own, watched from here through the diagnostics."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections import deque
from dataclasses import replace
from pathlib import Path
from typing import Any

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from rope_twin.cadence import SNAPSHOT_TOPICS
from rope_twin.errors import InputError, phrase
from rope_twin.messages import decode
from rope_twin.ros.company import Senders
from rope_twin.ros.entry import PARENT, StopSignal, initialise, keep_to_loopback
from rope_twin.ros.qos import message_type, profile
from rope_twin.ros.recorder_node import free_path
from rope_twin.ros.run_status import RUN_ROW
from rope_twin.ros.spare import Spare
from rope_twin.ros.suite import END_ORDER, node_parameters, where
from rope_twin.run.options import RunOptions
from rope_twin.run.progress import FigureProgress
from rope_twin.run.summary import RunSummary
from rope_twin.scene.load import load_scene
from rope_twin.scene.rules.rigging import winches_by_name
from rope_twin.topics import BY_NAME, CUT_TOPIC, INPUT_LOG_TOPIC, SESSION_TOPIC

STANDBY = "recorder_standby"  # takes over at once where the recorder dies
_WAIT_S = 0.1
_RESTARTS, _RESTARTS_WITHIN_S = 3, 60.0  # a process is started again so often at most
_BEGUN_S = 5.0  # one that ends sooner with an exit code of its own could not begin
_SAVE_EVERY_S = 2.0  # real time: what a simulation that died computes again at most
_SETTLED_S = 2.0  # after the newest start a spare is made
_FIND_S = 20.0  # what processes may take to start and to find each other
_MAX_WARNINGS = 10  # of messages that are ignored, one for each sender
_FIND_AGAIN_S = 3.0  # the same for one that finds the others at work
_END_S = 15.0  # what a process may take to end before it is killed


class NotRestarted(Exception):
    """A process stays dead; the text says which and why."""


class Monitor(Node):
    """Reads the figures of the run out of the diagnostics of the node `simulation`."""

    def __init__(self) -> None:
        super().__init__("monitor")
        self._senders = Senders(self)
        self._warned: set[str] = set()
        topic = BY_NAME["diagnostics"]
        self.summary: RunSummary | None = None
        self.create_subscription(
            message_type(topic), topic.name, self._take, profile(topic.qos), raw=True
        )

    def _take(self, data: bytes, info: dict[str, Any]) -> None:
        try:
            rows = decode("diagnostics", data).status
        except InputError as error:
            self._warn_once("malformed", str(error))
            return
        values = [{v.key: v.value for v in row.values} for row in rows if row.name == RUN_ROW]
        if not values:
            return
        sender = self._senders.name("diagnostics", info)
        if sender != "simulation":
            if sender:
                what = f"figures of the run by node {sender} are ignored"
                self._warn_once(sender, phrase("diagnostics", what, "only simulation sends them"))
            return
        summary = RunSummary.from_values(values[-1])
        if summary is None:
            what = f"the row '{RUN_ROW}' of node {sender} does not hold the figures of a run"
            right = "it is ignored; let all nodes be of one version"
            self._warn_once("figures", phrase("diagnostics", what, right))
        else:
            self.summary = summary

    def _warn_once(self, kind: str, sentence: str) -> None:
        if kind not in self._warned and len(self._warned) < _MAX_WARNINGS:
            self._warned.add(kind)
            self.get_logger().warning(sentence)


class Processes:
    """The processes of a run, each started again when it dies."""

    def __init__(self, options: RunOptions) -> None:
        self._running: dict[str, subprocess.Popen[bytes]] = {}
        self._started_s: dict[str, float] = {}
        self._restarted_s: dict[str, deque[float]] = {}  # the newest times of each
        self._bags = [options.record] if options.record else []
        self._folder = tempfile.TemporaryDirectory(prefix="rope_twin_run_")
        self._parameters = node_parameters(options)
        simulation = self._parameters["simulation"]
        simulation |= {"wait_for": _awaited(options), "wait_for_s": _FIND_S}
        # From there it goes on if it dies.
        simulation |= {
            "save_to": simulation["save_to"] or str(Path(self._folder.name) / "simulation.state"),
            "save_every_s": _SAVE_EVERY_S,
        }
        self._scene = options.scene
        self._spare: Spare | None = None
        self._call = Path()  # the file that calls the present standby recorder
        self._state_before = _signature(Path(simulation["save_to"]))
        for name in self._parameters:
            self._start(name)
        if "recorder" in self._parameters:
            self._start(STANDBY)

    @property
    def names(self) -> list[str]:
        """What runs, in the order of starting."""
        return list(self._running)

    def keep_spare(self) -> None:
        """Have a process at hand that can become any node, once the others have begun."""
        if self._spare is not None and not self._spare.waits:
            self._spare.close()
            self._spare = None
        if self._spare is None and time.monotonic() - max(self._started_s.values()) > _SETTLED_S:
            self._spare = Spare(self._scene, _environment())

    def ended(self) -> dict[str, int]:
        """Exit codes (negative: killed by that signal) of processes that have ended since."""
        codes = {name: process.poll() for name, process in self._running.items()}
        over = {name: code for name, code in codes.items() if code is not None}
        for name in over:
            del self._running[name]
        return over

    def restart(self, name: str, code: int, stepping: bool) -> str:
        """Start a process again that has ended; in words what died and what was done.

        Args:
            name: the process.
            code: its exit code; negative: the signal that killed it.
            stepping: whether the simulation has said anything yet.

        Raises:
            NotRestarted: it died three times in the minute before, or could not begin: what it
                said itself is the reason then.
        """
        died = f"the {name} process ended ({_words(code)})"
        now_s = time.monotonic()
        times = self._restarted_s.setdefault(name, deque(maxlen=_RESTARTS))
        begun = now_s - self._started_s[name] > _BEGUN_S
        if code > 0 and not (stepping if name == "simulation" else begun):
            raise NotRestarted(f"{died} and is not started again: it could not begin.")
        if len(times) == _RESTARTS and now_s - times[0] < _RESTARTS_WITHIN_S:
            often = f"it was {_RESTARTS} times in {_RESTARTS_WITHIN_S:g} s"
            raise NotRestarted(f"{died} and is not started again: {often}.")
        times.append(now_s)
        done = "it was started again"
        if name == "recorder":  # before another one makes its bag
            done = f"another one goes on, in {self._next_bag()}"
        if name == "recorder" and STANDBY in self._running:
            self._call.touch()  # it is seen by one that has only just been started, too
            self._running[name] = self._running.pop(STANDBY)
            self._started_s[name] = self._started_s[STANDBY]
            self._start(STANDBY)
        else:
            self._start(name, again=True)
        return f"{died}; {done}"

    def _next_bag(self) -> str:
        """The bag that a recorder makes which takes over, and how to save the one before."""
        bag = Path(self._parameters["recorder"]["directory"])
        self._bags.append(free_path(bag))
        return f"{self._bags[-1]}, `rope_twin recover {self._bags[-2]}` saves what was recorded"

    def close(self) -> None:
        """Kill whatever still runs and remove what only restarts needed."""
        self.kill()
        if self._spare is not None:
            self._spare.close()
        self._folder.cleanup()

    def _start(self, name: str, again: bool = False) -> None:
        parameters = dict(self._parameters["recorder" if name == STANDBY else name])
        if name == STANDBY:
            self._call = Path(self._folder.name) / f"call_{time.monotonic_ns()}"
            parameters |= {"beside": True, "standby": str(self._call)}
        elif again and name == "recorder":
            parameters["beside"] = True
        elif again and name == "viewer" and parameters["file"]:
            parameters["file"] = str(free_path(Path(parameters["file"]), ".rrd"))
        elif again and name == "simulation":
            parameters["wait_for_s"] = _FIND_AGAIN_S
            saved = _signature(Path(parameters["save_to"]))
            if saved is not None and saved != self._state_before:  # by this run, not an earlier one
                parameters["start_from"] = parameters["save_to"]
        self._running[name] = self._begin(name, parameters)
        self._started_s[name] = time.monotonic()

    def _begin(self, name: str, parameters: dict[str, Any]) -> subprocess.Popen[bytes]:
        """Start the process of a node, or let the spare become it."""
        spare, self._spare = self._spare, None
        if spare is not None and spare.become(_node_of(name), node_arguments(name, parameters)):
            return spare.process
        # A session of its own: Ctrl-C comes to us alone, and we end them in order.
        return subprocess.Popen(
            node_command(name, parameters), env=_environment(), start_new_session=True
        )

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


def _signature(path: Path) -> tuple[int, int] | None:
    """Tell one file from another that was written in its place; None: there is none."""
    try:
        about = path.stat()
    except OSError:
        return None
    return about.st_ino, about.st_mtime_ns


def node_command(name: str, parameters: dict[str, Any]) -> list[str]:
    """The command line of a node with its parameters (as YAML, so JSON will do)."""
    module = f"rope_twin.ros.{_node_of(name)}_node"
    return [sys.executable, "-m", module, *node_arguments(name, parameters)]


def node_arguments(name: str, parameters: dict[str, Any]) -> list[str]:
    """The arguments of a node's process."""
    arguments = ["--ros-args"]
    if name == STANDBY:
        arguments += ["-r", f"__node:={name}"]
    for key, value in parameters.items():
        if value != "":
            arguments += ["-p", f"{key}:={json.dumps(value)}"]
    return arguments


def _node_of(name: str) -> str:
    return "recorder" if name == STANDBY else name


def _environment() -> dict[str, str]:
    """What the process of a node needs to know of the one that starts it."""
    return {**os.environ, PARENT: str(os.getpid())}


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
        topics += [topic.name for topic in SNAPSHOT_TOPICS] + [SESSION_TOPIC, INPUT_LOG_TOPIC]
    return " ".join(topics)


def run_processes(options: RunOptions, progress: FigureProgress) -> RunSummary:
    """Start, watch and end the processes.

    Raises:
        RopeTwinError: the scene is wrong, or the simulation ended without a word.
        KeyboardInterrupt: told to stop before there was anything to sum up.
    """
    load_scene(options.scene)  # what is wrong with it is said once, here
    if not options.network:
        keep_to_loopback()
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
        if processes is not None:
            if left := processes.kill():
                progress.say(f"killed, since they did not end: {', '.join(left)}")
            processes.close()
        rclpy.try_shutdown()
        stop.restore()


class _Watch:
    """Spins the monitor while processes live and end."""

    def __init__(self, processes: Processes, progress: FigureProgress) -> None:
        self._processes = processes
        self._progress = progress
        self._codes: dict[str, int] = {}  # of what ended for good
        self._restarts: list[str] = []
        self._dead: list[str] = []
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
            if summary is not None:
                self._processes.keep_spare()
            if summary is not None and self._progress.due:
                self._progress.show(summary)

    def end(self) -> None:
        """The simulation first, the recorder last, so that nothing said goes unrecorded."""
        for name in (*END_ORDER, STANDBY):
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
        not_kept = summary.not_kept if options.save else ""
        if recorder := self._codes.get("recorder", 0):
            ended = phrase(f"bag {bag}", f"its recorder ended ({_words(recorder)})",
                           f"`rope_twin recover {bag}` saves what is there")  # fmt: skip
            not_kept = " ".join(filter(None, (ended, not_kept)))
        return replace(
            summary,
            error=error,
            bag=bag,
            view=options.view,
            state=summary.state if options.save else None,
            not_kept=not_kept,
            restarts=self._restarts,
            not_running=" ".join(self._dead),
        )

    def _spin(self, expected: str = "") -> None:
        """Let the monitor listen; start again what has died, unless one is `expected` to end."""
        self._executor.spin_once(timeout_sec=_WAIT_S)
        for name, code in self._processes.ended().items():
            done = code == 0 and name in ("simulation", "viewer")  # all steps made; window closed
            if expected or done:
                self._codes[name] = code
                if name != expected and not done:
                    self._progress.say(f"the {name} process ended ({_words(code)})")
                continue
            try:
                said = self._processes.restart(name, code, self.heard)
            except NotRestarted as reason:
                self._codes[name], said = code, str(reason)
                if name != "simulation":  # whose end is the run's error
                    self._dead.append(said)
            else:
                self._restarts.append(said)
            self._progress.say(said)


def _words(code: int) -> str:
    return f"killed by {signal.Signals(-code).name}" if code < 0 else f"exit code {code}"
