"""The steady grid on which the twin is stepped: one worker thread, absolute slots, no leaps.

A slot is one publish period: `steps_per_slot` steps in one call, then one snapshot. Slot k may
begin at `origin + k·slot/speed` on the steady clock and is due one slot later. A step is late
when its slot ends after that.

The rule when behind: no step is ever skipped or stretched. Missed slots are made up back to back,
but not faster than CATCH_UP times the grid, so that inputs that were held up by the same stall
still come before they are needed. Every late step is counted, and `behind_s` says how far the
twin is behind its grid at this moment, also while a step is taking too long.
"""

from __future__ import annotations

import gc
import logging
import sys
import threading
import time
from collections.abc import Callable
from typing import NamedTuple, Protocol

from rope_twin.errors import SolverError
from rope_twin.twin.handover import Handover
from rope_twin.twin.precedence import step_ahead
from rope_twin.twin.snapshot import Snapshot

CATCH_UP = 4.0  # a twin that is behind runs at most this many times faster than its grid
SLOT_S = 0.02  # the longest publish period of a scalar: 50 Hz

_log = logging.getLogger(__name__)


class Steppable(Protocol):
    """What the pacer needs of a twin."""

    @property
    def step_ns(self) -> int:
        """Length of a step [ns]."""

    def advance(self, steps: int) -> None:
        """Step on; raises SolverError and keeps the last good state."""

    def snapshot(self) -> Snapshot:
        """A frozen copy of the present."""


class Clock(Protocol):
    """Steady time and how to wait for it."""

    def now_ns(self) -> int:
        """Now [ns]; never goes back."""

    def wait_until(self, time_ns: int, interrupt: threading.Event) -> None:
        """Return at `time_ns`, at once if it has passed, or when `interrupt` is set."""


class SteadyClock:
    """The machine's monotonic clock."""

    def now_ns(self) -> int:
        """Now [ns] on CLOCK_MONOTONIC."""
        return time.monotonic_ns()

    def wait_until(self, time_ns: int, interrupt: threading.Event) -> None:
        """Sleep to an absolute time; an early wake-up sleeps on."""
        while (left_ns := time_ns - time.monotonic_ns()) > 0:
            if interrupt.wait(left_ns * 1e-9):
                return


class PacingHealth(NamedTuple):
    """How well the twin keeps to its grid, since it was made (pauses do not count)."""

    running: bool = False
    finished: bool = False  # all steps that were asked for are done
    speed: float = 1.0  # twin time over steady time that the grid asks for
    steps: int = 0
    late_steps: int = 0
    worst_lateness_s: float = 0.0  # of the end of a slot
    late_ago_s: float | None = None  # since the last late slot ended; None: there was none
    behind_s: float = 0.0  # how long the slot at hand is overdue right now
    computing_s: float = 0.0  # time spent in `advance`
    granted_s: float = 0.0  # steady time of the slots that were done
    processor_s: float = 0.0  # that the worker used in them, waking and waiting included
    real_time_factor: float = 0.0  # simulated time over computing_s; 0 before the first slot
    lost_snapshots: int = 0  # computed but never taken, because the publisher was too slow
    priority: bool = False  # the system let the worker run ahead of ordinary threads
    error: str = ""  # the sentence with which the solver stopped; empty while all is well


class SlotTimes(NamedTuple):
    """What a slot took, on the steady clock."""

    end_ns: int
    period_ns: float  # what it had
    computed_ns: int
    late: bool


class Pacer:
    """Owns the worker thread; only this thread touches the twin's state while it runs."""

    def __init__(
        self,
        twin: Steppable,
        handover: Handover,
        steps_per_slot: int,
        speed: float = 1.0,
        clock: Clock | None = None,
        last_step: int = 0,
    ) -> None:
        """`last_step`: stop for good after the slot that reaches it, at this step; 0: never."""
        self._twin = twin
        self._handover = handover
        self._steps = steps_per_slot
        self._slot_ns = steps_per_slot * twin.step_ns
        self._last_ns = last_step * twin.step_ns
        self._simulated_ns = 0
        self._watch: Callable[[SlotTimes], bool] | None = None
        self._clock = clock or SteadyClock()
        self._halt = threading.Event()
        self._thread: threading.Thread | None = None
        self._due_ns = 0
        self._took_ns = 0
        self._late_ns: int | None = None
        self._health = PacingHealth(speed=speed)
        self.last: Snapshot | None = None

    @property
    def slot_ns(self) -> int:
        """Twin time of a slot [ns]."""
        return self._slot_ns

    @property
    def period_ns(self) -> float:
        """Steady time of a slot [ns]."""
        return self._slot_ns / self._health.speed

    def watch(self, watch: Callable[[SlotTimes], bool]) -> None:
        """Let `watch` see each slot; True: it has changed the step, and slots are cut anew."""
        self._watch = watch

    def start(self, origin_ns: int) -> None:
        """Begin (or go on after `stop`) with a grid whose first slot begins at `origin_ns`.

        Raises:
            RuntimeError: if it is running already.
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
        """End after the slot at hand; `start` goes on from there. Harmless when not running."""
        self._halt.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None

    def health(self) -> PacingHealth:
        """The present figures; may be called from any thread."""
        health, late_ns, now_ns = self._health, self._late_ns, self._clock.now_ns()
        overdue_ns = now_ns - self._due_ns if health.running else 0
        return health._replace(
            behind_s=max(0, overdue_ns) * 1e-9,
            late_ago_s=None if late_ns is None else (now_ns - late_ns) * 1e-9,
            lost_snapshots=self._handover.lost,
        )

    def _run(self, origin_ns: int) -> None:
        self._health = self._health._replace(priority=step_ahead())
        slot = 0
        earliest_ns = origin_ns
        processor_s = time.thread_time()
        while not self._halt.is_set():
            begin_ns = max(origin_ns + round(slot * self.period_ns), earliest_ns)
            self._clock.wait_until(begin_ns, self._halt)
            if self._halt.is_set():
                break
            began_ns = self._clock.now_ns()
            if not self._advance():
                break
            slot += 1
            due_ns = origin_ns + round(slot * self.period_ns)
            earliest_ns = began_ns + round(self.period_ns / CATCH_UP)
            late = self._judge(due_ns)
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
        """One slot; False (with the sentence kept) if the twin cannot go on."""
        began_ns = self._clock.now_ns()
        try:
            self._twin.advance(self._steps)
            computed_ns = self._clock.now_ns() - began_ns
            self.last = self._twin.snapshot()
            self._took_ns = self._clock.now_ns() - began_ns
        except SolverError as error:
            self._health = self._health._replace(error=str(error))
            return False
        except Exception as error:
            # A defect of the twin must show in the diagnostics, not end in a silent dead thread.
            _log.exception("the twin stopped")
            self._health = self._health._replace(
                error=f"the twin stopped on {type(error).__name__}: {error}"
            )
            return False
        steps = self._health.steps + self._steps
        self._simulated_ns += self._slot_ns
        computing_s = self._health.computing_s + computed_ns * 1e-9
        factor = self._simulated_ns * 1e-9 / computing_s if computing_s > 0.0 else 0.0
        self._health = self._health._replace(
            steps=steps,
            computing_s=computing_s,
            granted_s=self._health.granted_s + self.period_ns * 1e-9,
            real_time_factor=factor,
        )
        self._handover.put(self.last)
        return True

    def _has_changed(self, late: bool) -> bool:
        """Tell who watches about the slot; whether the next ones are of another length."""
        if self._watch is None:
            return False
        now_ns = self._clock.now_ns()
        try:
            changed = self._watch(SlotTimes(now_ns, self.period_ns, self._took_ns, late))
        except Exception:
            # The twin is as it was before: it goes on, and nobody moves it any more.
            _log.exception("the ladder failed; the twin stays on its rung")
            self._watch = None
            return False
        if not changed:
            return False
        self._steps = steps_in_slot(self._twin.step_ns * 1e-9)
        self._slot_ns = self._steps * self._twin.step_ns
        return True

    def _judge(self, due_ns: int) -> bool:
        """Count the slot's steps as late if it ended after it was due; whether it did."""
        now_ns = self._clock.now_ns()
        late_s = (now_ns - due_ns) * 1e-9
        if late_s > 0.0:
            self._late_ns = now_ns
            self._health = self._health._replace(
                late_steps=self._health.late_steps + self._steps,
                worst_lateness_s=max(self._health.worst_lateness_s, late_s),
            )
        return late_s > 0.0


def steps_in_slot(step_s: float, slot_s: float = SLOT_S) -> int:
    """The most whole steps that fit into a publish period; 1 if a step is longer than that."""
    return max(1, int(slot_s / step_s + 1e-9))


def keep_pauses_short() -> None:
    """Make this interpreter fit for slots: quick hand-over of the GIL, short garbage collections.

    To be called once everything long-lived is built: what exists by then is never scanned again.
    """
    sys.setswitchinterval(5e-4)
    gc.collect()
    gc.freeze()
