"""Nodes as separate processes, supervised from here through the diagnostics."""

from __future__ import annotations

import importlib
import json
import os
import select
import signal
import subprocess
import sys
import tempfile
import time
from collections import deque
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from rope_twin.errors import InputError, RopeTwinError, phrase
from rope_twin.messages import decode
from rope_twin.recording.bag import free_path
from rope_twin.recording.bag_writer import check_unused
from rope_twin.ros.entry import BEGUN, PARENT, begun_note, initialise, leave
from rope_twin.ros.middleware import check_profile, keep_to_loopback
from rope_twin.ros.params import NODES, node_parameters
from rope_twin.ros.qos import Senders, listen
from rope_twin.run.options import RunOptions
from rope_twin.run.progress import FigureProgress, StopSignal, ending_signals
from rope_twin.run.summary import RUN_ROW, RunSummary
from rope_twin.scene.load import load_scene
from rope_twin.scene.rigging import winches_by_name
from rope_twin.topics import BY_NAME, CUT_TOPIC, INPUT_LOG_TOPIC, SESSION_TOPIC, SNAPSHOT_TOPICS
from rope_twin.twin.twin import Twin

STANDBY = "recorder_standby"  # takes over immediately if the recorder fails
_WAIT_S = 0.1
_RESTARTS, _RESTARTS_WITHIN_S = 3, 60.0  # maximum number of restarts of a process
_SAVE_EVERY_S = 2.0  # real time that a restarted simulation computes again at most
_SETTLED_S = 1.0  # time from the newest start until a spare is started
_FIND_S = 20.0  # time allowed for processes to start and to discover each other
_FIND_AGAIN_S = 3.0  # time allowed for a restarted process to discover the others
_MAX_WARNINGS = 10  # warnings about ignored messages, one per sender
_COMM = Path("/proc/self/comm")  # the name that `ps` and `top` show, on Linux
_END_S = 15.0  # time allowed for a process to end before it is killed


class NotRestarted(Exception):
    """A process is not restarted; the text says which and why."""


class Monitor(Node):
    """Reads the run summary from the diagnostics of the node `simulation`."""

    def __init__(self) -> None:
        super().__init__("monitor")
        self._senders = Senders(self)
        self._warned: set[str] = set()
        self.summary: RunSummary | None = None
        listen(self, BY_NAME["diagnostics"], self._take)

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
                problem = f"run statistics from node {sender} ignored"
                self._warn_once(
                    sender, phrase("diagnostics", problem, "only simulation sends them")
                )
            return
        summary = RunSummary.from_values(values[-1])
        if summary is None:
            problem = f"row '{RUN_ROW}' of node {sender} is not a run summary and is ignored"
            remedy = "use the same version for all nodes"
            self._warn_once("summary", phrase("diagnostics", problem, remedy))
        else:
            self.summary = summary

    def _warn_once(self, kind: str, sentence: str) -> None:
        if kind not in self._warned and len(self._warned) < _MAX_WARNINGS:
            self._warned.add(kind)
            self.get_logger().warning(sentence)


class SpareProcess:
    """Spare process of a run, as the process that starts the nodes sees it.

    It has imported everything, and has loaded the compiled code of the scene, before a node dies:
    importing the libraries takes longer than all the rest of a start. It then reads the node's name
    and arguments from its standard input and continues as that node.
    """

    def __init__(self, scene: str, environment: dict[str, str]) -> None:
        # A session of its own, as every node has: Ctrl-C comes to the run's own process alone.
        self.process = subprocess.Popen(
            [sys.executable, "-m", "rope_twin.ros.processes", scene],
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


class Processes:
    """Processes of a run, each restarted when it fails."""

    def __init__(self, options: RunOptions) -> None:
        self._running: dict[str, subprocess.Popen[bytes]] = {}
        self._started_s: dict[str, float] = {}
        self._begun: set[str] = set()  # nodes that have ended and had begun before
        self._restarted_s: dict[str, deque[float]] = {}  # times of the last restarts
        self._bags = [options.record] if options.record else []
        self._folder = tempfile.TemporaryDirectory(prefix="rope_twin_run_")
        self._parameters = node_parameters(options)
        simulation = self._parameters["simulation"]
        simulation |= {"wait_for": _awaited(options), "wait_for_s": _FIND_S}
        own_state = str(Path(self._folder.name) / "simulation.state")
        simulation["save_state"] = simulation["save_state"] or own_state  # for a restarted one
        simulation["save_every_s"] = _SAVE_EVERY_S
        self._scene = options.scene
        self._spare: SpareProcess | None = None
        self._call = Path()  # file that activates the current standby recorder
        self._state_before = _signature(Path(simulation["save_state"]))
        for name in self._parameters:
            self._start(name)
        if "recorder" in self._parameters:
            self._start(STANDBY)

    @property
    def names(self) -> list[str]:
        """Return the names of the running processes, in the order of their start."""
        return list(self._running)

    def keep_spare(self) -> None:
        """Start a spare process that can become any node, once the others have begun."""
        if self._spare is not None and not self._spare.waits:
            self._spare.close()
            self._spare = None
        if self._spare is None and time.monotonic() - max(self._started_s.values()) > _SETTLED_S:
            self._spare = SpareProcess(self._scene, self._environment())

    def ended(self) -> dict[str, int]:
        """Return exit codes (negative: killed by that signal) of newly ended processes."""
        codes = {name: process.poll() for name, process in self._running.items()}
        over = {name: code for name, code in codes.items() if code is not None}
        for name in over:
            process = self._running.pop(name)
            self._begun.discard(name)
            if begun_note(self._folder.name, process.pid).exists():
                self._begun.add(name)
        return over

    def restart(self, name: str, code: int, stepping: bool) -> str:
        """Restart a process that has ended; return in words what ended and what was done.

        code: its exit code, or the negative number of the signal that killed it; stepping: whether
        the simulation has sent diagnostics yet.

        Raises:
            NotRestarted: it failed three times in the last minute, or could not start; its own
                messages give the reason then.
        """
        died = f"the {name} process ended ({_words(code)})"
        now_s = time.monotonic()
        times = self._restarted_s.setdefault(name, deque(maxlen=_RESTARTS))
        if code > 0 and not (stepping if name == "simulation" else name in self._begun):
            raise NotRestarted(f"{died} and is not restarted: it could not start.")
        if len(times) == _RESTARTS and now_s - times[0] < _RESTARTS_WITHIN_S:
            often = f"{_RESTARTS} restarts within {_RESTARTS_WITHIN_S:g} s"
            raise NotRestarted(f"{died} and is not restarted: {often}.")
        times.append(now_s)
        done = "restarted"
        if name == "recorder":  # before another one makes its bag
            self._bags.append(free_path(Path(self._parameters["recorder"]["out"])))
            remedy = f"recover the first part with `rope_twin recover {self._bags[-2]}`"
            done = f"recording continues in {self._bags[-1]}; {remedy}"
        if name == "viewer" and (file := self._parameters[name]["file"]):
            done = f"the view continues in {free_path(Path(file), '.rrd')}"
        if name == "recorder" and STANDBY in self._running:
            self._call.touch()  # also seen by a standby recorder that is still starting
            self._running[name] = self._running.pop(STANDBY)
            self._started_s[name] = self._started_s[STANDBY]
            self._start(STANDBY)
        else:
            self._start(name, restarted=True)
        return f"{died}; {done}"

    def close(self) -> None:
        """Kill all running processes and remove the temporary files."""
        self.kill()
        if self._spare is not None:
            self._spare.close()
        self._folder.cleanup()

    def _start(self, name: str, restarted: bool = False) -> None:
        parameters = dict(self._parameters["recorder" if name == STANDBY else name])
        if name == STANDBY:
            self._call = Path(self._folder.name) / f"call_{time.monotonic_ns()}"
            parameters |= {"beside": True, "standby": str(self._call)}
        elif restarted and name == "recorder":
            parameters["beside"] = True
        elif restarted and name == "viewer" and parameters["file"]:
            parameters["file"] = str(free_path(Path(parameters["file"]), ".rrd"))
        elif restarted and name == "simulation":
            parameters["wait_for_s"] = _FIND_AGAIN_S
            saved = _signature(Path(parameters["save_state"]))
            if saved is not None and saved != self._state_before:  # saved by this run
                parameters["from_state"] = parameters["save_state"]
        self._running[name] = self._begin(name, parameters)
        self._started_s[name] = time.monotonic()

    def _begin(self, name: str, parameters: dict[str, Any]) -> subprocess.Popen[bytes]:
        """Start the process of a node, or assign the spare process to it."""
        spare, self._spare = self._spare, None
        if spare is not None and spare.become(_node_of(name), node_arguments(name, parameters)):
            return spare.process
        # A process session of its own: Ctrl-C reaches only this process, which ends the others.
        return subprocess.Popen(
            node_command(name, parameters), env=self._environment(), start_new_session=True
        )

    def _environment(self) -> dict[str, str]:
        """Return the environment of a node's process, which names the process that starts it."""
        return {**os.environ, PARENT: str(os.getpid()), BEGUN: self._folder.name}

    def interrupt(self, name: str) -> None:
        """Ask a process to end, by SIGINT."""
        if name in self._running:
            self._running[name].send_signal(signal.SIGINT)

    def kill(self) -> list[str]:
        """Kill all running processes and return their names."""
        running = list(self._running)
        for process in self._running.values():
            process.kill()
            process.wait()
        self._running.clear()
        return running


def _signature(path: Path) -> tuple[int, int] | None:
    """Return an identifier of a file that changes when it is replaced; None: no such file."""
    try:
        about = path.stat()
    except OSError:
        return None
    return about.st_ino, about.st_mtime_ns


def node_command(name: str, parameters: dict[str, Any]) -> list[str]:
    """Return the command line of a node with its parameters (as YAML, so JSON will do)."""
    module = f"rope_twin.ros.{_node_of(name)}_node"
    return [sys.executable, "-m", module, *node_arguments(name, parameters)]


def node_arguments(name: str, parameters: dict[str, Any]) -> list[str]:
    """Return the arguments of a node's process."""
    arguments = ["--ros-args"]
    if name == STANDBY:
        arguments += ["-r", f"__node:={name}"]
    for key, value in parameters.items():
        if value != "":
            arguments += ["-p", f"{key}:={json.dumps(value)}"]
    return arguments


def _node_of(name: str) -> str:
    return "recorder" if name == STANDBY else name


def _awaited(options: RunOptions) -> str:
    """Return the topics to wait for: the inputs of the run, and all topics to be recorded."""
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
    """Start, supervise and end the processes; `entry.release` is left to the caller.

    Raises:
        RopeTwinError: the scene is invalid, or the simulation ended without sending diagnostics.
        KeyboardInterrupt: a stop was requested before there was a summary.
    """
    load_scene(options.scene)  # errors of the scene are reported once, here
    check_profile()
    if options.record is not None:
        check_unused(options.record)
    if not options.network:
        keep_to_loopback()
    stop = StopSignal(signal.SIG_DFL)
    processes: Processes | None = None
    try:
        processes = Processes(options)
        initialise(["rope_twin"])
        progress.say(options.announcement)
        supervisor = _Supervisor(processes, progress, options.end_s is not None)
        supervisor.run(stop)
        supervisor.end()
        if stop.requested and not supervisor.heard:
            raise KeyboardInterrupt
        return supervisor.result(options)
    finally:
        if processes is not None:
            if killed := processes.kill():
                progress.say(f"did not end and were killed: {', '.join(killed)}")
            processes.close()
        stop.restore()


class _Supervisor:
    """Spins the monitor while the processes run and end."""

    def __init__(
        self, processes: Processes, progress: FigureProgress, may_finish: bool = True
    ) -> None:
        """Supervise processes; may_finish: the run has an end, at which the simulation ends."""
        self._processes = processes
        # what ends by itself: all steps done, window closed
        self._ending = ("simulation", "viewer") if may_finish else ("viewer",)
        self._progress = progress
        self._codes: dict[str, int] = {}  # exit codes of processes that are not restarted
        self._restarts: list[str] = []
        self._dead: list[str] = []
        self._monitor = Monitor()
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._monitor)
        leave(self._monitor, self._executor)

    @property
    def heard(self) -> bool:
        """Return whether the simulation has sent diagnostics yet."""
        return self._monitor.summary is not None

    def run(self, stop: StopSignal) -> None:
        """Supervise until a stop is requested, or the simulation has ended or failed."""
        while not stop.requested and "simulation" not in self._codes and rclpy.ok():
            self._spin()
            summary = self._monitor.summary
            if summary is not None and summary.error:
                break
            if summary is not None:
                self._processes.keep_spare()
            if summary is not None and self._progress.due:
                self._progress.show(summary.as_progress())

    def end(self) -> None:
        """End the processes, simulation first and recorder last, so that everything is recorded."""
        for name in (*NODES, STANDBY):
            self._processes.interrupt(name)
            give_up = time.monotonic() + _END_S
            while name in self._processes.names and time.monotonic() < give_up:
                self._spin(expected=name)

    def result(self, options: RunOptions) -> RunSummary:
        """Return the last summary that was received. Raises InputError: none was received."""
        code = self._codes.get("simulation", 0)
        summary = self._monitor.summary
        if summary is None:
            problem = f"ended ({_words(code)}) before it started"
            raise InputError("simulation", problem, "see its own messages above")
        error = summary.error or (f"the simulation ended ({_words(code)})" if code else "")
        bag = str(options.record) if options.record else None
        not_kept = summary.not_kept if options.save else ""
        if recorder := self._codes.get("recorder", 0):
            ended = phrase(f"bag {bag}", f"its recorder ended ({_words(recorder)})",
                           f"recover the messages with `rope_twin recover {bag}`")  # fmt: skip
            not_kept = " ".join(filter(None, (ended, not_kept)))
        return replace(
            summary,
            error=error,
            bag=bag,
            view=None if self._codes.get("viewer", 0) else options.shown,
            state=summary.state if options.save else None,
            not_kept=not_kept,
            restarts=self._restarts,
            not_running=" ".join(self._dead),
        )

    def _spin(self, expected: str = "") -> None:
        """Spin the monitor; restart processes that have ended, except the `expected` one."""
        self._executor.spin_once(timeout_sec=_WAIT_S)
        for name, code in self._processes.ended().items():
            done = code == 0 and name in self._ending
            if expected or done:
                self._codes[name] = code
                if name != expected and not done:
                    self._progress.say(f"the {name} process ended ({_words(code)})")
                continue
            try:
                notice = self._processes.restart(name, code, self.heard)
            except NotRestarted as reason:
                self._codes[name], notice = code, str(reason)
                if name != "simulation":  # its end is the error of the run
                    self._dead.append(notice)
            else:
                self._restarts.append(notice)
            self._progress.say(notice)


def _words(code: int) -> str:
    return f"killed by {signal.Signals(-code).name}" if code < 0 else f"exit code {code}"


def main(scene: str) -> int:
    """Wait in a spare process for a node's name and arguments, run it and return its exit code.

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
