"""Real-time pacing: one stepping thread on a fixed time grid, without skipped steps.

A cycle is one publish period: `steps_per_slot` steps in one call, then one snapshot. Cycle k may
begin at `origin + k·slot/speed` on the monotonic clock, and its deadline is one cycle later. All
steps of a cycle that ends after its deadline count as late.

When behind, no step is ever skipped or lengthened. Missed cycles are made up back to back, but at
most CATCH_UP times as fast as the grid, so that inputs delayed by the same stall still arrive
before they are needed. Every late step is counted. `behind_s` reports the present delay, also while
a step is taking too long.

The stepping thread needs the interpreter's lock before and after its steps and waits for the thread
that holds it. If that thread is preempted by another program, the steps are delayed as long. All
Python threads of a real-time run therefore get real-time priority, where the system allows it
(root, or rtprio), one below that of the stepping thread. Processes and library threads that they
start stay ordinary.

A queue passes snapshots from the stepping thread to the publishing thread.
"""

from __future__ import annotations

import gc
import logging
import os
import sys
import threading
import time
from collections import deque
from collections.abc import Callable
from typing import NamedTuple, Protocol

from rope_twin.errors import SolverError
from rope_twin.twin.snapshot import Snapshot

# Real-time priorities, 1 to 99: above ordinary threads, below those of the system.
STEPPING_PRIORITY, OTHER_PRIORITY = 10, 9


def raise_stepping_thread() -> bool:
    """Raise the priority of this thread, which steps; return whether the system allows it."""
    return _set_priority(0, STEPPING_PRIORITY)


def raise_other_threads() -> None:
    """Raise the priority of all threads of this interpreter to just below the stepping one."""
    for thread in threading.enumerate():
        _set_priority(thread.native_id, OTHER_PRIORITY)


def reset_threads() -> None:
    """Return all threads of this interpreter to ordinary priority."""
    for thread in threading.enumerate():
        _set_priority(thread.native_id, 0)


def _set_priority(thread: int | None, priority: int) -> bool:
    """Set a thread's priority (0: ordinary); return whether the system allowed it.

    thread: its native number; 0: this thread; None: it has ended.
    """
    if thread is None:
        return False
    try:
        policy = os.SCHED_RR if priority else os.SCHED_OTHER
        parameter = os.sched_param(priority)
        os.sched_setscheduler(thread, policy | os.SCHED_RESET_ON_FORK, parameter)
    except (AttributeError, OSError):
        return False
    return True


MAX_DELAY_S = 0.5  # snapshots of this much real time may wait for the publisher


class SnapshotQueue:
    """Bounded queue of snapshots: the newest are kept, and the stepping thread never waits."""

    def __init__(self, depth: int) -> None:
        self._waiting: deque[Snapshot] = deque()
        self._depth = depth
        self._arrived = threading.Condition()
        self.lost = 0  # snapshots dropped because the queue was full

    def put(self, snapshot: Snapshot) -> None:
        """Append a snapshot; the oldest is dropped if the publisher is `depth` behind."""
        with self._arrived:
            if len(self._waiting) >= self._depth:
                self._waiting.popleft()
                self.lost += 1
            self._waiting.append(snapshot)
            self._arrived.notify()

    def take(self, timeout_s: float) -> Snapshot | None:
        """Return the oldest waiting snapshot, or None if none came within the time."""
        with self._arrived:
            if not self._waiting:
                self._arrived.wait(timeout_s)
            return self._waiting.popleft() if self._waiting else None


def queue_depth(slot_s: float, speed: float) -> int:
    """Return the depth of the queue: the snapshots of MAX_DELAY_S, at least one."""
    return max(1, round(MAX_DELAY_S * speed / slot_s))


CATCH_UP = 4.0  # a twin that is behind runs at most this many times faster than its grid
GRANTED_POLL_S = 0.002  # polling interval of the inputs of a co-simulation
SLOT_S = 0.02  # longest publish period of a scalar: 50 Hz

_log = logging.getLogger(__name__)


class Steppable(Protocol):
    """Interface of a twin that the pacer steps."""

    @property
    def step_ns(self) -> int:
        """Length of a step [ns]."""

    def advance(self, steps: int) -> None:
        """Advance by this number of steps.

        Raises:
            SolverError: a step failed; the last good state is kept.
        """

    def snapshot(self) -> Snapshot:
        """Return a frozen copy of the present."""


class Clock(Protocol):
    """Interface of a monotonic clock."""

    def now_ns(self) -> int:
        """Return the time [ns]; it never goes back."""

    def wait_until(self, time_ns: int, interrupt: threading.Event) -> None:
        """Wait until `time_ns` or until `interrupt` is set; return at once if it has passed."""


class SteadyClock:
    """Monotonic clock of the machine."""

    def now_ns(self) -> int:
        """Return the time on CLOCK_MONOTONIC [ns]."""
        return time.monotonic_ns()

    def wait_until(self, time_ns: int, interrupt: threading.Event) -> None:
        """Sleep until an absolute time; an early wake-up continues to sleep."""
        while (left_ns := time_ns - time.monotonic_ns()) > 0:
            if interrupt.wait(left_ns * 1e-9):
                return


class GrantedClock:
    """Clock of a co-simulation: it advances only as far as the master has granted."""

    def __init__(self, reach_ns: Callable[[], int | None] = lambda: None) -> None:
        """Begin at time 0.

        reach_ns: returns the time to which the inputs are known, or None if they are not awaited.
        """
        self.newest_ns = self.granted_ns = 0  # newest time of the master, and the latest one
        self._reach_ns = reach_ns
        self._changed = threading.Condition()
        self._waits_since_s: float | None = None  # steady time

    def begin(self, time_ns: int) -> None:
        """Grant the time up to this one alone; call it while nobody waits."""
        self.newest_ns = self.granted_ns = time_ns

    def grant(self, time_ns: int) -> None:
        """Grant the time up to this one; an earlier time than the granted one has no effect."""
        with self._changed:
            self.newest_ns, self.granted_ns = time_ns, max(self.granted_ns, time_ns)
            self._changed.notify_all()

    @property
    def waited_s(self) -> float:
        """Return for how long a cycle has waited for its time or for inputs [s]."""
        since_s = self._waits_since_s
        return 0.0 if since_s is None else time.monotonic() - since_s

    def now_ns(self) -> int:
        """Return the granted time, as far as the inputs are known [ns]."""
        reach_ns = self._reach_ns()
        return self.granted_ns if reach_ns is None else min(self.granted_ns, reach_ns)

    def wait_until(self, time_ns: int, interrupt: threading.Event) -> None:
        """Wait until the time is granted and the inputs reach it."""
        with self._changed:
            self._waits_since_s = time.monotonic()
            while self.now_ns() < time_ns and not interrupt.is_set():
                self._changed.wait(GRANTED_POLL_S)
            self._waits_since_s = None


class PacingHealth(NamedTuple):
    """Real-time performance since the pacer was made; pauses do not count."""

    running: bool = False
    finished: bool = False  # all requested steps are done
    speed: float = 1.0  # requested ratio of twin time to real time
    steps: int = 0
    late_steps: int = 0
    worst_lateness_s: float = 0.0  # largest delay of the end of a cycle
    late_ago_s: float | None = None  # since the last late cycle ended, or None if there was none
    behind_s: float = 0.0  # present delay of the current cycle beyond its deadline
    computing_s: float = 0.0  # time spent in `advance`
    granted_s: float = 0.0  # real time of the completed cycles
    processor_s: float = 0.0  # CPU time of the stepping thread in them, including wake-ups
    real_time_factor: float = 0.0  # simulated time over computing_s; 0 before the first cycle
    lost_snapshots: int = 0  # dropped because the publisher was too slow
    priority: bool = False  # the stepping thread has real-time priority
    error: str = ""  # message of the error that ended the run; empty if none


class SlotTimes(NamedTuple):
    """Duration of one cycle on the monotonic clock."""

    end_ns: int
    period_ns: float  # time available
    computed_ns: int
    late: bool


class Pacer:
    """Owner of the stepping thread; only this thread touches the twin's state while it runs."""

    def __init__(
        self,
        twin: Steppable,
        queue: SnapshotQueue,
        steps_per_slot: int,
        speed: float = 1.0,
        clock: Clock | None = None,
        last_step: int = 0,
        catch_up: float = CATCH_UP,
    ) -> None:
        """Prepare the thread, which ends after the cycle that reaches `last_step`; 0: never.

        catch_up: how many times faster than its grid a twin that is behind runs at most.
        """
        self._catch_up = catch_up
        self._twin = twin
        self._queue = queue
        self._steps = steps_per_slot
        self.slot_ns = steps_per_slot * twin.step_ns  # twin time of a cycle
        self._last_ns = last_step * twin.step_ns
        self._simulated_ns = 0
        self._watch: Callable[[SlotTimes], bool] | None = None
        self._clock = clock or SteadyClock()
        self._halt = threading.Event()
        self._thread: threading.Thread | None = None
        self._due_ns = 0
        self._cycle_duration_ns = 0
        self._late_ns: int | None = None
        self._health = PacingHealth(speed=speed)
        self.last: Snapshot | None = None

    @property
    def period_ns(self) -> float:
        """Real time of a cycle [ns]."""
        return self.slot_ns / self._health.speed

    def watch(self, watch: Callable[[SlotTimes], bool]) -> None:
        """Call `watch` after each cycle; it returns True if it changed the time step."""
        self._watch = watch

    def start(self, origin_ns: int) -> None:
        """Start (or resume after `stop`) with a grid whose first cycle begins at `origin_ns`.

        Raises:
            RuntimeError: the pacer is running already.
        """
        if self._thread is not None:
            raise RuntimeError("the pacer is running already")
        self._halt.clear()
        self._due_ns = origin_ns + round(self.period_ns)
        self._health = self._health._replace(running=True, error="")
        self._thread = threading.Thread(
            target=self._run, args=(origin_ns,), name="twin-steps", daemon=True
        )
        self._thread.start()

    def stop(self) -> None:
        """Stop after the current cycle; `start` resumes from there. No effect when not running."""
        self._halt.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None

    def health(self) -> PacingHealth:
        """Return the present performance figures; may be called from any thread."""
        health, late_ns, now_ns = self._health, self._late_ns, self._clock.now_ns()
        overdue_ns = now_ns - self._due_ns if health.running else 0
        return health._replace(
            behind_s=max(0, overdue_ns) * 1e-9,
            late_ago_s=None if late_ns is None else (now_ns - late_ns) * 1e-9,
            lost_snapshots=self._queue.lost,
        )

    def _run(self, origin_ns: int) -> None:
        self._health = self._health._replace(priority=raise_stepping_thread())
        slot = 0
        earliest_ns = origin_ns
        processor_s = time.thread_time()
        while not self._halt.is_set():
            begin_ns = max(origin_ns + round(slot * self.period_ns), earliest_ns)
            self._clock.wait_until(begin_ns, self._halt)
            if self._halt.is_set():
                break
            start_ns = self._clock.now_ns()
            if not self._advance():
                break
            slot += 1
            due_ns = origin_ns + round(slot * self.period_ns)
            earliest_ns = start_ns + round(self.period_ns / self._catch_up)
            late = self._count_miss(due_ns)
            used_s, processor_s = time.thread_time() - processor_s, time.thread_time()
            self._health = self._health._replace(processor_s=self._health.processor_s + used_s)
            if self._has_changed(late):
                origin_ns, slot = due_ns, 0
            self._due_ns = origin_ns + round((slot + 1) * self.period_ns)
            if 0 < self._last_ns <= self._simulated_ns:
                self._health = self._health._replace(finished=True)
                break
        self._health = self._health._replace(running=False)

    def _advance(self) -> bool:
        """Run one cycle; return False, with the message kept, if the twin cannot continue."""
        start_ns = self._clock.now_ns()
        try:
            self._twin.advance(self._steps)
            computed_ns = self._clock.now_ns() - start_ns
            self.last = self._twin.snapshot()
            self._cycle_duration_ns = self._clock.now_ns() - start_ns
        except SolverError as error:
            self._health = self._health._replace(error=str(error))
            return False
        except Exception as error:
            # A defect must appear in the diagnostics, not end the thread silently.
            _log.exception("the twin stopped")
            self._health = self._health._replace(
                error=f"the twin stopped on {type(error).__name__}: {error}"
            )
            return False
        steps = self._health.steps + self._steps
        self._simulated_ns += self.slot_ns
        computing_s = self._health.computing_s + computed_ns * 1e-9
        factor = self._simulated_ns * 1e-9 / computing_s if computing_s > 0.0 else 0.0
        self._health = self._health._replace(
            steps=steps,
            computing_s=computing_s,
            granted_s=self._health.granted_s + self.period_ns * 1e-9,
            real_time_factor=factor,
        )
        self._queue.put(self.last)
        return True

    def _has_changed(self, late: bool) -> bool:
        """Report the cycle to the watcher; return whether the length of the cycles changes."""
        if self._watch is None:
            return False
        now_ns = self._clock.now_ns()
        try:
            changed = self._watch(SlotTimes(now_ns, self.period_ns, self._cycle_duration_ns, late))
        except Exception:
            # The twin is unchanged: it continues on its level without further changes.
            _log.exception("overload protection failed; the twin stays on its level")
            self._watch = None
            return False
        if not changed:
            return False
        self._steps = steps_in_slot(self._twin.step_ns * 1e-9)
        self.slot_ns = self._steps * self._twin.step_ns
        return True

    def _count_miss(self, due_ns: int) -> bool:
        """Count the cycle's steps as late if it missed its deadline; return whether it did."""
        now_ns = self._clock.now_ns()
        late_s = (now_ns - due_ns) * 1e-9
        if late_s > 0.0:
            self._late_ns = now_ns
            self._health = self._health._replace(
                late_steps=self._health.late_steps + self._steps,
                worst_lateness_s=max(self._health.worst_lateness_s, late_s),
            )
        return late_s > 0.0


def steps_in_slot(step_s: float) -> int:
    """Return the number of whole steps that fit into a publish period, at least 1."""
    return max(1, int(SLOT_S / step_s + 1e-9))


def keep_pauses_short() -> None:
    """Shorten interruptions by this interpreter: fast switching of the GIL, short collections.

    Call it once everything long-lived is built: objects that exist by then are never scanned again.
    """
    sys.setswitchinterval(5e-4)
    gc.collect()
    gc.freeze()
    gc.set_threshold(700, 10, 10)  # Python's own; a start collects less often
