"""Single-instance lock: only one simulation may publish in a namespace of a ROS domain.

Two simulations on the same topics would use each other's sea and winch commands. A simulation that
is already running is detected by its messages. Of simulations that start at the same moment on one
machine, the one that holds the lock of the domain goes on.
"""

from __future__ import annotations

import errno
import os
import socket
import time
from collections.abc import Callable

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from rope_twin.errors import InputError, phrase
from rope_twin.ros.qos import message_type, profile
from rope_twin.topics import BY_NAME

# topics by which a running simulation is detected; a paused one still sends diagnostics at 1 Hz
DETECTED_BY = ("tension_top", "diagnostics")
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
        found = socket.socket(socket.AF_UNIX)
        try:
            found.bind(self._name)
        except OSError as error:  # a system without abstract sockets has no locks either
            found.close()
            return error.errno != errno.EADDRINUSE
        self._socket = found
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
        what = "another simulation is running there, and both would use the same inputs"
        raise InputError(
            phrase(f"ROS domain {domain}", what, "end it, or set another ROS_DOMAIN_ID")
        )
    return lock


def _until(holds: Callable[[], bool], patience_s: float) -> bool:
    """Wait at most `patience_s` until a condition holds; return whether it does."""
    give_up = time.monotonic() + patience_s
    while not (found := holds()) and time.monotonic() < give_up:
        time.sleep(0.1)
    return found


def _is_silent(namespace: str) -> bool:
    """Return whether no simulation sends messages, while ours does not send any yet."""
    listener = rclpy.create_node("single_instance", namespace=namespace)
    heard: list[bytes] = []
    for name in DETECTED_BY:
        topic = BY_NAME[name]
        listener.create_subscription(
            message_type(topic), name, heard.append, profile(topic.qos), raw=True
        )
    executor = SingleThreadedExecutor()
    executor.add_node(listener)
    give_up = time.monotonic() + LISTEN_S
    while not heard and time.monotonic() < give_up:
        executor.spin_once(timeout_sec=0.1)
    executor.shutdown()
    listener.destroy_node()
    return not heard
