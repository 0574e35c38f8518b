"""Entry point of a node as a process: arguments, signals, a clean shutdown, and the instance lock.

Only one simulation may publish in a namespace of a ROS domain: two simulations on the same topics
would use each other's sea and winch commands. A simulation that is already running is detected by
its messages. Of simulations that start at the same moment on one machine, the one that holds the
lock of the domain goes on.
"""

from __future__ import annotations

import atexit
import ctypes
import errno
import os
import signal
import socket
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import rclpy
from rclpy.clock import Clock, ClockType
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.timer import Timer
from rclpy.utilities import remove_ros_args

from rope_twin.errors import InputError, RopeTwinError
from rope_twin.ros.middleware import check_profile, make_executor
from rope_twin.ros.qos import listen
from rope_twin.run.progress import StopSignal
from rope_twin.topics import BY_NAME

_USAGE = "parameters are given as --ros-args -p NAME:=VALUE"
PARENT = "ROPE_TWIN_PARENT"  # environment: process id of the suite that started this node
BEGUN = "ROPE_TWIN_BEGUN"  # environment: folder in which this node leaves a note once it has begun
_WAIT_S = 0.1  # longest wait in the executor, and so the delay until a signal is noticed
END_S = 10.0  # for the middleware to release what a node held; less than a supervisor's
_READ_S = 0.2  # from the sentence to the end of the process
_NOT_RELEASED = (
    b"the middleware did not release the resources of this node in time: the process ends without "
    b"it, all files are complete."
)


class SuiteNode(Node):
    """Node of the suite: `run_node` begins it, spins it until it has finished, and closes it."""

    @property
    def finished(self) -> bool:
        """Return whether the node has completed its task; most run until they are stopped."""
        return False

    @property
    def exit_code(self) -> int:
        """Return the exit code of a node that was closed after it ended, or was asked to end."""
        return 0

    def begin(self) -> None:
        """Start working.

        Raises:
            RopeTwinError: the node cannot start; one sentence.
        """

    def close(self) -> None:
        """Shut down cleanly: join threads, close files; may be called twice."""

    def every(self, period_s: float, call: Callable[[], None]) -> Timer:
        """Call a function periodically by the steady clock, also with use_sim_time."""
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        return self.create_timer(period_s, call, clock=steady)


def initialise(args: list[str] | None) -> None:
    """Call rclpy.init without its signal handlers, which would shut the context down too early.

    `args` are the arguments of a process, its name first; None: sys.argv.

    Raises:
        InputError: the arguments are invalid, or a profile does not exist; one sentence.
    """
    home = Path(os.environ.get("HOME", "/nonexistent"))
    if "ROS_LOG_DIR" not in os.environ and not os.access(home, os.W_OK):
        os.environ["ROS_LOG_DIR"] = str(Path(tempfile.gettempdir()) / "rope_twin_log")
    check_profile()
    arguments = sys.argv if args is None else args
    try:
        rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
        unknown = remove_ros_args(arguments)[1:]
    except Exception as error:  # rcl raises RuntimeErrors of several kinds
        reason = str(error).splitlines()[0].partition(", at /")[0].rstrip(".")
        raise InputError("arguments", reason, _USAGE) from error
    if unknown:
        raise InputError("arguments", f"unknown argument '{unknown[0]}'", _USAGE)


def run_node(make: Callable[[], SuiteNode], args: list[str] | None = None) -> int:
    """Run one node until it has finished or a stop is requested; return the exit code.

    When the middleware does not release the node's resources within END_S, the process ends
    here, with that code.
    """
    stop = StopSignal(signal.SIG_DFL)
    node: SuiteNode | None = None
    executor: SingleThreadedExecutor | None = None
    code = 1
    try:
        initialise(args)
        node = make()
        executor = make_executor()
        executor.add_node(node)
        if not stop.requested:
            node.begin()
            if BEGUN in os.environ:
                with suppress(OSError):  # the suite has just ended
                    begun_note(os.environ[BEGUN], os.getpid()).touch()
        while not (stop.requested or node.finished or _orphaned()) and rclpy.ok():
            executor.spin_once(timeout_sec=_WAIT_S)
        code = 0
    except RopeTwinError as error:
        sys.stderr.write(f"{error}\n")
    except ExternalShutdownException:
        code = 0  # a stop request: the clean shutdown below is all that is needed
    finally:
        if node is not None:
            node.close()
            code = code or node.exit_code
        leave(node, executor)
        release(code)
        stop.restore()
    return code


_LEFT: list[tuple[Node | None, SingleThreadedExecutor | None]] = []  # until `release`


def leave(node: Node | None = None, executor: SingleThreadedExecutor | None = None) -> None:
    """Leave a node and an executor to `release`, so that a command prints its result first.

    At the exit of the interpreter they are released at the latest.
    """
    if not _LEFT:
        atexit.register(release, 1)
    _LEFT.append((node, executor))


def release(code: int) -> None:
    """Release what was left and shut rclpy down; end the process with `code` if that hangs."""
    atexit.unregister(release)
    if not _LEFT:
        return
    with _ended_in_time(code):
        for node, executor in _LEFT:
            if executor is not None:
                executor.shutdown()
            if node is not None:
                node.destroy_node()
        rclpy.try_shutdown()
        _LEFT.clear()


@contextmanager
def middleware(*ros_args: str) -> Iterator[None]:
    """Hold the middleware for a block that is no node of the suite, and release it in time.

    Nodes of the block are given to `leave`.

    Raises:
        InputError: an argument is invalid.
    """
    initialise(["rope_twin", "--ros-args", *ros_args])
    leave()
    try:
        yield
    finally:
        release(0)


def begun_note(folder: str, process: int) -> Path:
    """Return the file that says that the node of a process has begun."""
    return Path(folder) / f"begun_{process}"


def _orphaned() -> bool:
    """Return whether the parent process of this node is gone, so that nothing would stop it."""
    parent = os.environ.get(PARENT)
    return parent is not None and parent != str(os.getppid())


class _Event(ctypes.Structure):
    """`struct sigevent` of Linux: a timer that calls `function(value)` in a thread of its own."""

    _fields_ = (
        ("value", ctypes.c_void_p),
        ("signal_number", ctypes.c_int),
        ("kind", ctypes.c_int),
        ("function", ctypes.c_void_p),
        ("attributes", ctypes.c_void_p),
        ("rest", ctypes.c_char * 32),
    )


class _Times(ctypes.Structure):
    """`struct itimerspec`: period (0: once) and delay, in seconds and nanoseconds."""

    _fields_ = tuple((name, ctypes.c_long) for name in ("every_s", "every_ns", "in_s", "in_ns"))


_THREAD = 2  # SIGEV_THREAD


@contextmanager
def _ended_in_time(code: int) -> Iterator[None]:
    """End the process with `code` if the block takes longer than END_S, and say why.

    rclpy holds the interpreter's lock while it destroys a participant, and FastDDS was seen to
    spin there for 15 minutes: neither a signal handler nor a thread of Python would ever run. So
    timers of the C library call its own functions, `warnx(sentence)` and then `_exit(code)`, which
    runs no further destructor.
    """
    sys.stdout.flush()
    sys.stderr.flush()
    libc, timers = ctypes.CDLL(None), []
    said = ctypes.cast(ctypes.c_char_p(_NOT_RELEASED), ctypes.c_void_p).value
    for delay_s, function, value in (
        (END_S, libc.warnx, said),
        (END_S + _READ_S, libc._exit, code),
    ):
        address = ctypes.cast(function, ctypes.c_void_p)
        event, timer = _Event(value, 0, _THREAD, address, None, b""), ctypes.c_void_p()
        times = _Times(0, 0, int(delay_s), int(delay_s % 1.0 * 1e9))
        if libc.timer_create(time.CLOCK_MONOTONIC, ctypes.byref(event), ctypes.byref(timer)) == 0:
            libc.timer_settime(timer, 0, ctypes.byref(times), None)
            timers.append(timer)
    try:
        yield
    finally:
        for timer in timers:
            libc.timer_delete(timer)


# topics by which a running simulation is detected; a paused one still sends diagnostics at 1 Hz
DETECTED_BY = ("ropes/tension_top", "diagnostics")
LISTEN_S = 2.0


class InstanceLock:
    """Lock of one simulation on a namespace of a ROS domain, on this machine.

    It is an abstract socket name, which the kernel grants to one socket at a time and releases when
    the process ends for any reason.
    """

    def __init__(self, domain: str, namespace: str) -> None:
        self._name = f"\0rope_twin/{domain}{namespace}"
        self._socket: socket.socket | None = None

    def acquire(self, patience_s: float = 0.0) -> bool:
        """Acquire the lock, waiting at most `patience_s`; return False if another process has it.

        Without abstract sockets on this system there is no lock, and the result is True.
        """
        return _until(self._try, patience_s)

    def release(self) -> None:
        """Release the lock; may be called twice."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def _try(self) -> bool:
        lock_socket = socket.socket(socket.AF_UNIX)
        try:
            lock_socket.bind(self._name)
        except OSError as error:  # a system without abstract sockets has no locks either
            lock_socket.close()
            return error.errno != errno.EADDRINUSE
        self._socket = lock_socket
        return True


def lock_instance(node: Node) -> InstanceLock:
    """Lock the namespace of a simulation that has not started; its publishers must exist already.

    The middleware still lists the publishers of a simulation that was killed some time ago:
    another one counts only if it sends messages or holds the lock. One that holds the lock but is
    not discovered receives none of our messages either.

    Returns:
        The lock, to be released when the run has ended.

    Raises:
        InputError: another simulation publishes on the same topics.
    """
    domain, namespace = os.environ.get("ROS_DOMAIN_ID", "0"), node.get_namespace()
    lock = InstanceLock(domain, namespace)
    locked = lock.acquire(LISTEN_S)
    wait_s = 0.0 if locked else LISTEN_S
    discovered = _until(lambda: node.count_publishers(DETECTED_BY[0]) > 1, wait_s)
    if discovered and not (locked and _is_silent(namespace)):
        lock.release()
        problem = "another simulation is running there, and both would use the same inputs"
        raise InputError(f"ROS domain {domain}", problem, "end it, or set another ROS_DOMAIN_ID")
    return lock


def _until(condition: Callable[[], bool], patience_s: float) -> bool:
    """Wait at most `patience_s` until a condition holds; return whether it does."""
    give_up = time.monotonic() + patience_s
    while not (result := condition()) and time.monotonic() < give_up:
        time.sleep(0.1)
    return result


def _is_silent(namespace: str) -> bool:
    """Return whether no simulation sends messages, while ours does not send any yet."""
    listener = rclpy.create_node("single_instance", namespace=namespace)
    received: list[bytes] = []
    for name in DETECTED_BY:
        listen(listener, BY_NAME[name], received.append)
    executor = SingleThreadedExecutor()
    executor.add_node(listener)
    give_up = time.monotonic() + LISTEN_S
    while not received and time.monotonic() < give_up:
        executor.spin_once(timeout_sec=0.1)
    executor.shutdown()
    listener.destroy_node()
    return not received
