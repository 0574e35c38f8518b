"""How a node of the suite lives as a process of its own: from arguments to a clean end."""

from __future__ import annotations

import os
import signal
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from types import FrameType
from typing import Protocol

import rclpy
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args

from rope_twin.errors import InputError, RopeTwinError, phrase
from rope_twin.ros.executor import make_executor
from rope_twin.run.ending import ending_signals
from rope_twin.share import share_dir

_USAGE = "parameters are given as --ros-args -p NAME:=VALUE"
DISCOVERY_RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"
PARENT = "ROPE_TWIN_PARENT"  # environment: process id of the suite that started this node
_WAIT_S = 0.1  # the longest wait in the executor: how soon a signal is noticed


class SuiteNode(Protocol):
    """What every node of the suite offers; `destroy_node` is rclpy's own."""

    @property
    def finished(self) -> bool:
        """Whether the node has done what it was started for."""

    def begin(self) -> None:
        """Start working; raises RopeTwinError with one sentence if that cannot be."""

    def close(self) -> None:
        """End cleanly: threads joined, files closed. Harmless when called twice."""

    def destroy_node(self) -> None:
        """Let go of the middleware."""


class StopSignal:
    """What asks a process to end (Ctrl-C, SIGTERM, a terminal that closed), as a flag.

    The main loop reads it; a second signal ends the process at once.

    Nothing is raised where the signal happens to arrive: in the middle of a compilation or of a
    callback from C that would do harm.
    """

    def __init__(self) -> None:
        self.requested = False
        self.note = ""  # said at once when a signal comes: why the end may take a while
        self._before = {
            number: signal.signal(number, self._on_signal) for number in ending_signals()
        }

    def _on_signal(self, number: int, frame: FrameType | None) -> None:
        self.requested = True
        if self.note:
            os.write(sys.stderr.fileno(), self.note.encode())
        for known in self._before:
            signal.signal(known, signal.SIG_DFL)

    def restore(self) -> None:
        """Give the signals back."""
        for number, handler in self._before.items():
            signal.signal(number, handler)


def keep_to_loopback() -> None:
    """Keep the nodes of this process and of those that it starts on this machine.

    To be called before `initialise`. An environment that has ROS_AUTOMATIC_DISCOVERY_RANGE already
    is left as it is. The variable limits discovery alone; the profile of Fast DDS has it receive on
    the loopback interface only, unless the environment names another profile.
    """
    if DISCOVERY_RANGE in os.environ:
        return
    os.environ[DISCOVERY_RANGE] = "LOCALHOST"
    profile = share_dir() / "config" / "ros" / "fastdds_loopback.xml"
    os.environ.setdefault("FASTDDS_DEFAULT_PROFILES_FILE", str(profile))


def initialise(args: list[str] | None) -> None:
    """rclpy.init without its own signal handlers: they would end the context under our feet.

    `args` are those of a process: its name first; None: sys.argv.

    Raises:
        InputError: one sentence on what cannot be understood.
    """
    home = Path(os.environ.get("HOME", "/nonexistent"))
    if "ROS_LOG_DIR" not in os.environ and not os.access(home, os.W_OK):
        os.environ["ROS_LOG_DIR"] = str(Path(tempfile.gettempdir()) / "rope_twin_log")
    given = sys.argv if args is None else args
    try:
        rclpy.init(args=given, signal_handler_options=SignalHandlerOptions.NO)
        others = remove_ros_args(given)[1:]
    except Exception as error:  # rcl raises RuntimeErrors of several kinds
        reason = str(error).splitlines()[0].partition(", at /")[0].rstrip(".")
        raise InputError(phrase("arguments", reason, _USAGE)) from error
    if others:
        raise InputError(phrase("arguments", f"'{others[0]}' is not understood", _USAGE))


def run_node(make: Callable[[], SuiteNode], args: list[str] | None = None) -> int:
    """Run one node until it has finished or is told to stop; the exit code."""
    stop = StopSignal()
    node: SuiteNode | None = None
    executor: SingleThreadedExecutor | None = None
    try:
        initialise(args)
        node = make()
        executor = make_executor()
        executor.add_node(node)
        if not stop.requested:
            node.begin()
        while not (stop.requested or node.finished or _orphaned()) and rclpy.ok():
            executor.spin_once(timeout_sec=_WAIT_S)
    except RopeTwinError as error:
        sys.stderr.write(f"{error}\n")
        return 1
    except ExternalShutdownException:
        pass  # told to stop: the clean end below is all there is to do
    finally:
        _end(node, executor)
        stop.restore()
    return 0


def _orphaned() -> bool:
    """Whether the process that started this node is gone: then nobody else would stop it."""
    parent = os.environ.get(PARENT)
    return parent is not None and parent != str(os.getppid())


def _end(node: SuiteNode | None, executor: SingleThreadedExecutor | None) -> None:
    if node is not None:
        node.close()
    if executor is not None:
        executor.shutdown()
    if node is not None:
        node.destroy_node()
    rclpy.try_shutdown()
