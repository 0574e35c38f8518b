"""Worker: a thread beside a real-time twin that owns all that is computed from its inputs.

The twin's threads only append to its queue. Tasks take what has come and work in parts of some
0.1 s, so that several of them share the thread; the lanes of their fleets release the interpreter's
lock. A task that fails stands, says why, and leaves the others alone.
"""

from __future__ import annotations

import logging
import math
import threading
import time
from collections import deque
from collections.abc import Callable
from typing import NamedTuple, Protocol

from rope_twin.twin.ensemble.live_state import LiveState

POLL_S = 0.2  # between two looks at the queue
MAX_WAITING = 100_000  # inputs; older ones are dropped if the worker stands

_log = logging.getLogger(__name__)


class Motion(NamedTuple):
    """Motion and winch that drove the rope at one instant, in twin time."""

    time_s: float
    heave_m: float  # of the hang-off, relative to its rest
    heave_rate_m_per_s: float
    line_out_m: float
    lines_m: tuple[float, ...] = ()  # of further winches


class Reading(NamedTuple):
    """Readings of a winch's sensors, in twin time; NaN: not measured."""

    time_s: float
    tension_n: float
    line_out_m: float = math.nan
    winch: str = ""  # "": the main one, else by the name of its hang-off


class Heave(NamedTuple):
    """Sample of the motion sensor as it came, which the twin may have refused, in twin time."""

    time_s: float
    heave_m: float


class Restart(NamedTuple):
    """State of the live twin, from which tasks begin (again)."""

    live: LiveState


class WorkerCall(NamedTuple):
    """A call to be made in the worker's thread, such as a tare."""

    act: Callable[[], None]


Input = Motion | Reading | Heave | Restart | WorkerCall


class Task(Protocol):
    """Something that the worker computes."""

    def take(self, inputs: Input) -> None:
        """Take an input; it costs microseconds."""

    def work(self) -> bool:
        """Do a part of the work, some 0.1 s at most; return whether there is more to do now."""


class Worker:
    """One thread with a queue of inputs and a list of tasks."""

    def __init__(self, *tasks: Task) -> None:
        """Take the tasks; the thread does not run yet."""
        self._tasks = tasks
        self._waiting: deque[Input] = deque(maxlen=MAX_WAITING)
        self._stopping = threading.Event()
        self._thread: threading.Thread | None = None
        self._failed: dict[int, str] = {}
        self.processor_s = 0.0  # CPU time of the thread

    def take(self, inputs: Input) -> None:
        """Queue an input, from any thread; it never waits."""
        self._waiting.append(inputs)

    def trouble(self, task: Task) -> str:
        """Return why a task has failed, or ""."""
        return self._failed.get(id(task), "")

    def start(self) -> None:
        """Begin to work."""
        self._stopping.clear()
        self._thread = threading.Thread(target=self._run, name="twin-worker", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Stop after the present part; without effect when not running."""
        self._stopping.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None

    def work(self) -> None:
        """Pass on all that waits, and do all work that can be done now (also without a thread)."""
        more = True
        while more and not self._stopping.is_set():
            self._pass_on()
            more = False
            for task in self._tasks:
                if id(task) not in self._failed:
                    more = self._work_once(task) or more

    def _pass_on(self) -> None:
        while self._waiting:
            inputs = self._waiting.popleft()
            if isinstance(inputs, WorkerCall):
                inputs.act()
                continue
            for task in self._tasks:
                task.take(inputs)

    def _work_once(self, task: Task) -> bool:
        try:
            return task.work()
        except Exception as error:  # one task must not end the others; diagnostics say why
            _log.exception("task %s stands", type(task).__name__)
            self._failed[id(task)] = str(error) or type(error).__name__
            return False

    def _run(self) -> None:
        before_s = self.processor_s - time.thread_time()
        while not self._stopping.wait(POLL_S):
            self.work()
            self.processor_s = before_s + time.thread_time()
