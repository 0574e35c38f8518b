"""When a paced twin steps down its ladder because the machine cannot keep up, and when up again.

Load is the time that slots take to compute over the time they have. Down, at once as far as
needed: when the load over WINDOW_S is above FULL, or RUNNING slots in turn took longer than they
have and ended late. A single stall, however long, is neither. Up, one rung at a time: when the
load, times how much more work the rung above is, stayed below ROOM for a while and no slot was
late; the while doubles each time that a rung taken so has to be left again soon.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Sequence
from itertools import takewhile
from math import isnan
from statistics import median
from typing import Protocol

from rope_twin.errors import SolverError
from rope_twin.scene.card import KnownError, told_bound
from rope_twin.twin.accuracy.rung import Rung
from rope_twin.twin.accuracy.rungs import ladder_of
from rope_twin.twin.pacing import SlotTimes
from rope_twin.twin.twin import Twin

WINDOW_S, LEAST_SLOTS, RUNNING = 0.4, 8, 3
CLIP = 1.5  # load of a single slot, at most: one long stall is no lack of speed
FULL, ROOM, FIT = 0.8, 0.4, 0.6  # of the time there is: too much, enough room to go up, and down to
WAIT_S, LONGEST_WAIT_S = 5.0, 80.0
SOON_S = 30.0  # a rung left again within this was taken too early
SAYINGS = 20
TRIALS = 5  # slots that are tried before the start


class Climber(Protocol):
    """What is stepped on a ladder."""

    def take_rung(self, rung: Rung) -> None:
        """Go on from here with other elements or another step."""


class Ladder:
    """Watches the slots of one twin and moves it; to be used by the thread that steps."""

    def __init__(
        self, twin: Climber, rungs: Sequence[Rung], at: Rung, wait_s: float = WAIT_S
    ) -> None:
        """`rungs`: from the best down; `at`: the one that the twin is on."""
        self._twin = twin
        self._rungs = tuple(rungs)
        self._at = self._rungs.index(at)
        self._slots: deque[SlotTimes] = deque()
        self._moved_s = float("-inf")
        self._look_s = float("-inf")  # when to see again whether there is room
        self._went_up = False
        self._wait_s = self._least_wait_s = wait_s
        self.changes = 0
        self.load = 0.0  # over the newest window
        self.reason = ""  # of the newest move

    @property
    def rung(self) -> Rung:
        """The rung that the twin is on."""
        return self._rungs[self._at]

    @property
    def place(self) -> tuple[int, int]:
        """Which rung that is, 1 the best, of how many."""
        return self._at + 1, len(self._rungs)

    def judge(self, slot: SlotTimes) -> bool:
        """Take a slot in; True: the twin is on another rung from now on."""
        self._slots.append(slot)
        longest = WINDOW_S if self._at == 0 else max(self._wait_s, WINDOW_S)
        while self._slots[0].end_ns * 1e-9 < slot.end_ns * 1e-9 - longest:
            self._slots.popleft()
        self.load, recent = self._load_since(slot.end_ns * 1e-9 - WINDOW_S)
        if recent >= LEAST_SLOTS and self.load > FULL:
            return self._step_down(slot)
        if slot.late and len(self._slots) >= RUNNING:
            newest = [self._slots[-1 - k] for k in range(RUNNING)]
            if all(one.late and one.computed_ns > one.period_ns for one in newest):
                return self._step_down(slot)
        return self._at > 0 and self._step_up(slot)

    def start_at(self, load: float) -> bool:
        """Before the first slot: take a rung that fits, if the present one would take this load."""
        if load <= FIT:
            return False
        words = f"it would take {load:.0%} of the time there is"
        return self._move(self._fitting(load), float("-inf"), words)

    def _load_since(self, begin_s: float) -> tuple[float, int]:
        """Load of the slots since then, and how many they are; a stall counts as CLIP at most."""
        since = takewhile(lambda slot: slot.end_ns * 1e-9 > begin_s, reversed(self._slots))
        loads = [_load(slot) for slot in since]
        clipped = sum(min(load, CLIP) for load in loads)
        return (clipped / len(loads) if loads else 0.0), len(loads)

    def _step_down(self, slot: SlotTimes) -> bool:
        load = median(_load(one) for one in list(self._slots)[-LEAST_SLOTS:])
        target, now_s = self._fitting(load), slot.end_ns * 1e-9
        if target == self._at:
            return False
        if self._went_up:
            soon = now_s - self._moved_s < SOON_S
            self._wait_s = min(2.0 * self._wait_s, LONGEST_WAIT_S) if soon else self._least_wait_s
        had_ms = 1e-6 * slot.period_ns
        words = f"slots of {had_ms:.0f} ms took {max(load, self.load) * had_ms:.0f} ms"
        return self._move(target, now_s, words)

    def _step_up(self, slot: SlotTimes) -> bool:
        now_s = slot.end_ns * 1e-9
        if self._moved_s == float("-inf"):  # it began on this rung: its first slot
            self._moved_s = now_s
        if now_s - self._moved_s < self._wait_s or now_s < self._look_s:
            return False
        self._look_s = now_s + WINDOW_S
        load, _ = self._load_since(now_s - self._wait_s)
        more = _work(self._rungs[self._at - 1]) / _work(self.rung)
        if load * more > ROOM or any(one.late for one in self._slots):
            return False
        return self._move(self._at - 1, now_s, f"there is room, {load:.0%} is used")

    def _fitting(self, load: float) -> int:
        """The next rung below that makes of this load one that fits, or the last."""
        for at in range(self._at + 1, len(self._rungs)):
            if load * _work(self._rungs[at]) / _work(self.rung) <= FIT:
                return at
        return len(self._rungs) - 1

    def _move(self, target: int, now_s: float, why: str) -> bool:
        if target == self._at:
            return False
        self._twin.take_rung(self._rungs[target])
        self._went_up = target < self._at
        self._at = target
        self._moved_s = now_s
        self._slots.clear()
        self.changes += 1
        self.reason = why
        return True


class TwinLadder(Ladder):
    """The ladder of a scene's twin, which says in a sentence what it does."""

    def __init__(self, twin: Twin, wait_s: float = WAIT_S) -> None:
        scene = twin.scene
        rungs = ladder_of(scene)
        super().__init__(twin, rungs if twin.rung in rungs else (twin.rung,), twin.rung, wait_s)
        self._owner = twin
        self.said: deque[str] = deque(maxlen=SAYINGS)  # sentences that nobody has taken yet

    def measure(self, steps_s: float, speed: float) -> float:
        """Load on the present rung, tried on a branch: least of TRIALS slots of `steps_s`."""
        trial = self._owner.branch()
        steps = max(1, round(steps_s / trial.step_s))
        least = float("inf")
        try:
            for _ in range(TRIALS):
                began = time.perf_counter()
                trial.advance(steps)
                least = min(least, time.perf_counter() - began)
        except SolverError:
            return 0.0  # the run itself will tell
        return least * speed / (steps * trial.step_s)

    def judge(self, slot: SlotTimes) -> bool:
        """As of any ladder; a rope that was cut stays on the rung that it was cut on."""
        return self._owner.cut is None and super().judge(slot)

    def error(self) -> KnownError:
        """What the scene's card knows of the present rung."""
        return self._owner.card_error

    def _move(self, target: int, now_s: float, why: str) -> bool:
        moved = super()._move(target, now_s, why)
        if moved:
            number, count = self.place
            way = "up" if self._went_up else "down"
            words = f"stepping {way} to rung {number} of {count}, {self.words()}: {why}"
            self.said.append(words)
        return moved

    def words(self) -> str:
        """The present rung."""
        error = self.error()
        known = error.words if isnan(error.rms_pct) else f"at most {told_bound(error.rms_pct)} %"
        own = self._owner.scene.ropes[0].elements
        left = own >> self.rung.halvings
        elements = f"{own} elements" if left == own else f"{left} elements in place of {own}"
        step_ms = 1e3 * self.rung.step_s
        return f"{elements} and steps of {step_ms:g} ms, error of the tension {known}"


def _load(slot: SlotTimes) -> float:
    return slot.computed_ns / slot.period_ns


def _work(rung: Rung) -> float:
    """Work for a second of twin time, in elements of the scene and steps."""
    return 1.0 / (rung.step_s * (1 << rung.halvings))
