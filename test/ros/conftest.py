"""A ROS network of each test's own on the loopback, and waiting for conditions with a deadline."""

from __future__ import annotations

import itertools
import os
import tempfile
from collections.abc import Iterator
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

_domains = itertools.count(os.getpid())


@pytest.fixture
def domain(monkeypatch: pytest.MonkeyPatch) -> int:
    """A ROS domain that no other test uses; child processes inherit it."""
    number = 1 + next(_domains) % 100
    monkeypatch.setenv("ROS_DOMAIN_ID", str(number))
    return number


@pytest.fixture
def bench(domain: int) -> Iterator[Bench]:
    made = Bench(domain)
    yield made
    made.close()


@pytest.fixture(scope="module")
def module_bench() -> Iterator[Bench]:
    """One bench for all tests of a module."""
    made = Bench(1 + next(_domains) % 100)
    yield made
    made.close()


@pytest.fixture
def processes(domain: int, tmp_path: Path) -> Iterator[Processes]:
    made = Processes(tmp_path)
    yield made
    made.close()
