"""Accuracy levels of a twin (larger steps first, then fewer elements), and overload protection.

A real-time twin changes its accuracy level to meet its deadlines. Load is the computing time of
cycles over the time available. It steps down, at once as far as needed, when the load over WINDOW_S
exceeds OVERLOAD_LOAD, or LATE_CYCLES consecutive cycles took longer than available and ended late.
A single stall, however long, is neither. It steps up, one level at a time, when the load, scaled by
the work of the level above, stayed below STEP_UP_LOAD for a waiting time and no cycle was late. The
waiting time doubles each time that a level taken in this way is left again within EARLY_S.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import takewhile
from math import isnan
from statistics import median
from typing import TYPE_CHECKING, NamedTuple

from rope_twin.core.state import ELEMENTS, Floats, Model, Rope
from rope_twin.errors import SolverError
from rope_twin.scene.convergence import known_error
from rope_twin.scene.error_bound import AccuracyLevel, KnownError, format_bound
from rope_twin.scene.schema import Scene
from rope_twin.twin.pacing import SlotTimes
from rope_twin.twin.regrid import (
    Grid,
    UpperEnd,
    coarse_capacity,
    coarse_model,
    coarser,
    finer,
    marks_of,
)

if TYPE_CHECKING:
    from rope_twin.twin.twin import Twin

WINDOW_S, MIN_CYCLES, LATE_CYCLES = 0.4, 8, 3
MAX_CYCLE_LOAD = 1.5  # maximum load of a single cycle: one long stall is no lack of speed
OVERLOAD_LOAD = 0.8  # a higher load is an overload
STEP_UP_LOAD, TARGET_LOAD = 0.4, 0.6  # maximum load to step up, target of a step down
WAIT_S, MAX_WAIT_S = 5.0, 80.0
EARLY_S = 30.0  # a level left again within this time was taken too early
MAX_MESSAGES = 20
TIMED_CYCLES = 5  # number of cycles timed before the start


STEPS_NS = (2_000_000, 5_000_000, 10_000_000, 20_000_000, 50_000_000)
MIN_ELEMENTS = 20  # of the finest rope: enough for an error within one per cent in smooth scenes
MIN_HALVED = 4  # a rope with fewer elements is not halved, as ropes of a system need at least two


@dataclass(frozen=True)
class SceneMesh:
    """Mesh of a rope in the scene, without its material coordinates."""

    model: Model
    capacity: int


def scene_level(scene: Scene) -> AccuracyLevel:
    """Return the scene's own mesh and time step."""
    return AccuracyLevel(round(scene.time.step_s * 1e9))


def elements_at(scene: Scene, halvings: int) -> tuple[int, ...]:
    """Return the elements of each rope of the scene after this many halvings."""
    counts = [line.elements for line in scene.ropes]
    for _ in range(halvings):
        counts = [count >> 1 if count >= MIN_HALVED else count for count in counts]
    return tuple(counts)


def levels_of(scene: Scene) -> tuple[AccuracyLevel, ...]:
    """Return the accuracy levels from the scene's own down, each with less work than the last."""
    top = scene_level(scene)
    levels = [top, *(AccuracyLevel(step_ns) for step_ns in STEPS_NS if step_ns > top.step_ns)]
    while max(elements_at(scene, levels[-1].halvings + 1)) >= MIN_ELEMENTS:
        levels.append(AccuracyLevel(levels[-1].step_ns, levels[-1].halvings + 1))
    return tuple(levels)


def error_at_level(scene: Scene, level: AccuracyLevel) -> KnownError:
    """Return the error of a level that is known from the scene's convergence study."""
    if level == scene_level(scene):
        return known_error(scene)
    counts = elements_at(scene, level.halvings)
    lines = [replace(line, elements=n) for line, n in zip(scene.ropes, counts, strict=True)]
    time = replace(scene.time, step_s=level.step_s)
    return known_error(replace(scene, ropes=tuple(lines), time=time))


Marks = list[Floats | None]  # of each rope: node coordinates of a finer mesh; None: not halved


class MeshState(NamedTuple):
    """Accuracy level in use, and the node coordinates of the finer meshes."""

    level: AccuracyLevel
    marks: list[Marks]


class Mesh:
    """Mesh of all ropes: it changes with the accuracy level, and back again exactly."""

    def __init__(self, scene: Scene, ropes: Sequence[Rope]) -> None:
        """Start on the scene's own level, with its ropes."""
        self.level = scene_level(scene)
        self._base = [SceneMesh(rope.model, rope.state.s.shape[0]) for rope in ropes]
        self._marks: list[Marks] = []  # of each finer mesh, the scene's first

    def state(self) -> MeshState:
        """Return level and finer meshes."""
        return MeshState(self.level, self._marks)

    def restore(self, state: MeshState) -> None:
        """Continue from a state; the ropes are restored separately."""
        self.level, self._marks = state

    def changed(
        self, ropes: Sequence[Rope], level: AccuracyLevel, ends: Sequence[UpperEnd]
    ) -> list[Rope]:
        """Return the ropes on another level; ends: the upper end of each."""
        marks, on_mesh = list(self._marks), list(ropes)
        while len(marks) < level.halvings:
            halved = [int(rope.state.counts[ELEMENTS]) >= MIN_HALVED for rope in on_mesh]
            pairs = zip(on_mesh, halved, strict=True)
            marks.append([marks_of(rope) if halve else None for rope, halve in pairs])
            for r, node_marks in enumerate(marks[-1]):
                if node_marks is not None:
                    on_mesh[r] = coarser(on_mesh[r], ends[r])
        while len(marks) > level.halvings:
            for r, node_marks in enumerate(marks.pop()):
                if node_marks is not None:
                    grid = self._grid(r, on_mesh[r], marks, node_marks)
                    on_mesh[r] = finer(on_mesh[r], grid, ends[r])
        self.level, self._marks = level, marks
        # the scene's own step may be no whole number of nanoseconds
        scene_step = self._base[0].model.step
        step = scene_step if round(scene_step * 1e9) == level.step_ns else level.step_s
        return [rope._replace(model=rope.model._replace(step=step)) for rope in on_mesh]

    def _grid(self, r: int, rope: Rope, marks: Sequence[Marks], node_marks: Floats) -> Grid:
        """Return a finer mesh of rope r; marks: of the meshes that are finer still."""
        base, halvings = self._base[r], sum(rope_marks[r] is not None for rope_marks in marks)
        capacity, ratio = base.capacity, float(1 << halvings)
        for _ in range(halvings):
            capacity = coarse_capacity(capacity, rope.sections)
        return Grid(coarse_model(base.model, ratio), capacity, node_marks)


class OverloadProtection:
    """Overload protection of a scene's twin; for use by the stepping thread."""

    def __init__(self, twin: Twin, wait_s: float = WAIT_S) -> None:
        """Start at the twin's own level, the only one if it is none of the scene's."""
        levels = levels_of(twin.scene)
        self._twin = twin
        self._levels = levels if twin.level in levels else (twin.level,)
        self._at = self._levels.index(twin.level)
        self._slots: deque[SlotTimes] = deque()
        self._moved_s = float("-inf")
        self._next_check_s = float("-inf")  # time of the next check for spare capacity
        self._went_up = False
        self._wait_s = self._min_wait_s = wait_s
        self.changes = 0
        self.load = 0.0  # over the newest window
        self.reason = ""  # reason of the newest change
        self.said: deque[str] = deque(maxlen=MAX_MESSAGES)  # messages not yet reported

    @property
    def level(self) -> AccuracyLevel:
        """Present accuracy level."""
        return self._levels[self._at]

    @property
    def place(self) -> tuple[int, int]:
        """Number of the present level, 1 the best, and count of levels."""
        return self._at + 1, len(self._levels)

    def judge(self, slot: SlotTimes) -> bool:
        """Take the timing of a cycle; return True if the twin has changed its level.

        A cut rope stays on its level.
        """
        if self._twin.cut is not None:
            return False
        self._slots.append(slot)
        longest = WINDOW_S if self._at == 0 else max(self._wait_s, WINDOW_S)
        while self._slots[0].end_ns * 1e-9 < slot.end_ns * 1e-9 - longest:
            self._slots.popleft()
        self.load, recent = self._load_since(slot.end_ns * 1e-9 - WINDOW_S)
        if recent >= MIN_CYCLES and self.load > OVERLOAD_LOAD:
            return self._step_down(slot)
        if slot.late and len(self._slots) >= LATE_CYCLES:
            newest = [self._slots[-1 - k] for k in range(LATE_CYCLES)]
            if all(cycle.late and cycle.computed_ns > cycle.period_ns for cycle in newest):
                return self._step_down(slot)
        return self._at > 0 and self._step_up(slot)

    def start_at(self, load: float) -> bool:
        """Before the first cycle, step down to a level that fits, given the load of this one."""
        if load <= TARGET_LOAD:
            return False
        reason = f"it would take {load:.0%} of the time there is"
        return self._move(self._level_for(load), float("-inf"), reason)

    def _load_since(self, begin_s: float) -> tuple[float, int]:
        """Return load and number of the cycles since then, a cycle at most MAX_CYCLE_LOAD."""
        since = takewhile(lambda slot: slot.end_ns * 1e-9 > begin_s, reversed(self._slots))
        loads = [_load(slot) for slot in since]
        clipped = sum(min(load, MAX_CYCLE_LOAD) for load in loads)
        return (clipped / len(loads) if loads else 0.0), len(loads)

    def _step_down(self, slot: SlotTimes) -> bool:
        load = median(_load(cycle) for cycle in list(self._slots)[-MIN_CYCLES:])
        target, now_s = self._level_for(load), slot.end_ns * 1e-9
        if target == self._at:
            return False
        if self._went_up:
            left_early = now_s - self._moved_s < EARLY_S
            self._wait_s = min(2.0 * self._wait_s, MAX_WAIT_S) if left_early else self._min_wait_s
        available_ms = 1e-6 * slot.period_ns
        reason = f"slots of {available_ms:.0f} ms took {max(load, self.load) * available_ms:.0f} ms"
        return self._move(target, now_s, reason)

    def _step_up(self, slot: SlotTimes) -> bool:
        now_s = slot.end_ns * 1e-9
        if self._moved_s == float("-inf"):  # its first cycle on the initial level
            self._moved_s = now_s
        if now_s - self._moved_s < self._wait_s or now_s < self._next_check_s:
            return False
        self._next_check_s = now_s + WINDOW_S
        load, _ = self._load_since(now_s - self._wait_s)
        work_ratio = self._work(self._levels[self._at - 1]) / self._work(self.level)
        if load * work_ratio > STEP_UP_LOAD or any(cycle.late for cycle in self._slots):
            return False
        return self._move(self._at - 1, now_s, f"there is room, {load:.0%} is used")

    def _level_for(self, load: float) -> int:
        """Return the next level below that reduces this load to one that fits, or the last."""
        for at in range(self._at + 1, len(self._levels)):
            if load * self._work(self._levels[at]) / self._work(self.level) <= TARGET_LOAD:
                return at
        return len(self._levels) - 1

    def _work(self, level: AccuracyLevel) -> float:
        """Return the steps of an element in a second of twin time."""
        return sum(elements_at(self._twin.scene, level.halvings)) / level.step_s

    def _move(self, target: int, now_s: float, reason: str) -> bool:
        if target == self._at:
            return False
        self._twin.set_level(self._levels[target])
        self._went_up = target < self._at
        self._at = target
        self._moved_s = now_s
        self._slots.clear()
        self.changes += 1
        self.reason = reason
        number, count = self.place
        direction = "up" if self._went_up else "down"
        level = f"accuracy level {number} of {count}, {self.words()}"
        self.said.append(f"stepping {direction} to {level}: {reason}")
        return True

    def measure(self, steps_s: float, speed: float) -> float:
        """Return the load of the present level: the minimum over TIMED_CYCLES cycles of a branch.

        steps_s: twin time of a cycle [s]; speed: ratio of twin time to real time.
        """
        branch = self._twin.branch()
        steps = max(1, round(steps_s / branch.step_s))
        min_s = float("inf")
        try:
            for _ in range(TIMED_CYCLES):
                begin_s = time.perf_counter()
                branch.advance(steps)
                min_s = min(min_s, time.perf_counter() - begin_s)
        except SolverError:
            return 0.0  # the run itself reports the error
        return min_s * speed / (steps * branch.step_s)

    def words(self) -> str:
        """Return a description of the present level."""
        error = self._twin.study_error
        bound = f"at most {format_bound(error.rms_pct)} %"
        error_text = error.words if isnan(error.rms_pct) else bound
        of_scene, present = (
            sum(elements_at(self._twin.scene, n)) for n in (0, self.level.halvings)
        )
        elements = f"{present} elements"
        if present != of_scene:
            elements += f" in place of {of_scene}"
        step_ms = 1e3 * self.level.step_s
        return f"{elements} and steps of {step_ms:g} ms, error of the tension {error_text}"


def _load(slot: SlotTimes) -> float:
    return slot.computed_ns / slot.period_ns
