"""A ROS network of each test's own on the loopback, and waiting for conditions with a deadline."""

from __future__ import annotations

import os
import socket
import tempfile
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from ros_bench import Bench
from ros_process import Processes

# Set before rclpy is first imported. UDP only: killed processes leave shared-memory files.
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
os.environ["FASTDDS_BUILTIN_TRANSPORTS"] = "UDPv4"
os.environ.setdefault("ROS_LOG_DIR", tempfile.mkdtemp(prefix="rope_twin_ros_log_"))
for name in ("DISPLAY", "WAYLAND_DISPLAY"):  # no test opens a window
    os.environ.pop(name, None)

_FIRST, _LAST = 1, 100  # ROS domains whose ports stay below those of the system
_LOCK_PORT = 28000


@contextmanager
def free_domain() -> Iterator[int]:
    """A ROS domain that no other test has, in this or any other run on this machine.

    A bound port of the loopback is the lock: it is gone with its process, however that ends.
    """
    start = os.getpid()
    for offset in range(_LAST - _FIRST + 1):
        number = _FIRST + (start + offset) % (_LAST - _FIRST + 1)
        with socket.socket() as lock:
            try:
                lock.bind(("127.0.0.1", _LOCK_PORT + number))
            except OSError:
                continue
            # What a killed process leaves in the network lives on for seconds: not the same again.
            if number in _recent:
                continue
            _recent.append(number)
            yield number
            return
    raise RuntimeError("no ROS domain is free")


_recent: deque[int] = deque(maxlen=50)


@pytest.fixture
def domain(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """A ROS domain of the test's own; child processes inherit it."""
    with free_domain() as number:
        monkeypatch.setenv("ROS_DOMAIN_ID", str(number))
        yield number


@pytest.fixture
def bench(domain: int) -> Iterator[Bench]:
    made = Bench(domain)
    yield made
    made.close()


@pytest.fixture(scope="module")
def module_bench() -> Iterator[Bench]:
    """One bench for all tests of a module."""
    with free_domain() as number:
        made = Bench(number)
        yield made
        made.close()


@pytest.fixture
def processes(domain: int, tmp_path: Path) -> Iterator[Processes]:
    made = Processes(tmp_path)
    yield made
    made.close()
