"""Entry point of a node as a process: arguments, signals, and a clean shutdown."""

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
_WAIT_S = 0.1  # longest wait in the executor, and so the delay until a signal is noticed


class SuiteNode(Protocol):
    """Interface of every node of the suite; `destroy_node` is rclpy's own."""

    @property
    def finished(self) -> bool:
        """Return whether the node has completed its task."""

    def begin(self) -> None:
        """Start working.

        Raises:
            RopeTwinError: the node cannot start; one sentence.
        """

    def close(self) -> None:
        """Shut down cleanly: join threads, close files; may be called twice."""

    def destroy_node(self) -> None:
        """Release the resources of the middleware."""


class StopSignal:
    """Stop request by a signal (Ctrl-C, SIGTERM, a closed terminal), as a flag.

    The main loop reads the flag; a second signal ends the process immediately. No exception is
    raised at the point where the signal arrives, since that would do harm during a compilation or a
    callback from C.
    """

    def __init__(self) -> None:
        self.requested = False
        self.note = ""  # printed when a signal arrives: why the shutdown may take a while
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
        """Restore the previous signal handlers."""
        for number, handler in self._before.items():
            signal.signal(number, handler)


def keep_to_loopback() -> None:
    """Restrict the nodes of this process and of its child processes to this machine.

    To be called before `initialise`. An environment that already has ROS_AUTOMATIC_DISCOVERY_RANGE
    is left unchanged. The variable limits discovery only; the Fast DDS profile restricts reception
    to the loopback interface, unless the environment names another profile.
    """
    if DISCOVERY_RANGE in os.environ:
        return
    os.environ[DISCOVERY_RANGE] = "LOCALHOST"
    profile = share_dir() / "config" / "ros" / "fastdds_loopback.xml"
    os.environ.setdefault("FASTDDS_DEFAULT_PROFILES_FILE", str(profile))


def initialise(args: list[str] | None) -> None:
    """Call rclpy.init without its signal handlers, which would shut the context down too early.

    `args` are the arguments of a process, its name first; None: sys.argv.

    Raises:
        InputError: the arguments are invalid; one sentence.
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
        raise InputError(phrase("arguments", f"unknown argument '{others[0]}'", _USAGE))


def run_node(make: Callable[[], SuiteNode], args: list[str] | None = None) -> int:
    """Run one node until it has finished or a stop is requested; return the exit code."""
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
        pass  # a stop request: the clean shutdown below is all that is needed
    finally:
        _end(node, executor)
        stop.restore()
    return 0


def _orphaned() -> bool:
    """Return whether the parent process of this node is gone, so that nothing would stop it."""
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
