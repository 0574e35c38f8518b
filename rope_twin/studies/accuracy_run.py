"""A scene as `rope_twin run SCENE --speed 0` sees it, over a window, at any elements and step.

Its own sea, winch schedule and ramp, from rest. The motion of hang-off and line is computed once
for each step and shared by all numbers of elements; the core is stepped without a twin around it,
so that the top tension after every step is at hand and nothing but steps is timed.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rope_twin.commands.run.inputs import FIRST_NS, open_sea
from rope_twin.core import state as rows
from rope_twin.core.step import advance
from rope_twin.errors import SolverError, phrase
from rope_twin.scene.build import build
from rope_twin.scene.schema import Scene
from rope_twin.studies.variants import variant
from rope_twin.twin.borders import Borders, WinchTrack
from rope_twin.twin.heave_series import HeaveSeries
from rope_twin.twin.start import find_start

Vector = NDArray[np.float64]
AFTER_NS = 1_000_000_000  # heave goes on so long after the end: the last step looks ahead
BATCH_S = 8.0  # less than the 10 s that winch commands may be known ahead
PIECE_NODE_STEPS = 40_000  # a timed piece takes some 4 ms at least
ENOUGH_S, FEWEST_RUNS, MOST_RUNS = 0.6, 2, 7  # of timing


@dataclass(frozen=True)
class Setting:
    """What a run may vary of a scene."""

    elements: int
    step_s: float
    tolerance_n: float | None = None  # None: the scene's own

    def __str__(self) -> str:
        tolerance = "" if self.tolerance_n is None else f", tolerance {self.tolerance_n:g} N"
        return f"{self.elements} elements at {1e3 * self.step_s:g} ms{tolerance}"


@dataclass(frozen=True)
class Series:
    """What a run was seen to do."""

    step_s: float
    tension_n: Vector  # top tension after each step
    look_s: float
    depth_m: Vector  # of the lower end at each look
    slack: NDArray[np.bool_]  # whether an element was without tension, at each look
    solves_per_step: float
    unconverged: int
    memory_mb: float


class Course:
    """What moves the rope of a scene over a window, for runs of it at many settings.

    Raises:
        RopeTwinError: the scene's sea is not there or ends before the window does.
    """

    def __init__(self, scene: Scene, seconds: float, look_s: float) -> None:
        self.scene, self.seconds, self.look_s = scene, seconds, look_s
        sea = open_sea(scene)
        samples = sea.between(FIRST_NS, round(seconds * 1e9) + AFTER_NS) if sea else []
        self._heave = HeaveSeries.of(
            (one.stamp_ns, one.position_m, one.velocity_m_per_s) for one in samples
        ) if samples else None  # fmt: skip
        self._motions: dict[float, rows.Boundary] = {}

    def motion(self, step_s: float) -> rows.Boundary:
        """Hang-off and line out at every border of the steps."""
        if step_s not in self._motions:
            line = WinchTrack(self.scene.winch, self.scene.ropes[0].length_m, None, step_s)
            borders = Borders(self.scene.ship, line, self._heave, step_s)
            steps, batch = round(self.seconds / step_s), max(1, round(BATCH_S / step_s))
            parts = [rows.Boundary(*(table.copy() for table in borders.boundary))]
            for first in range(0, steps, batch):
                part = borders.through(first, min(batch, steps - first))
                parts.append(rows.Boundary(*(table[1:].copy() for table in part)))
            whole = (np.concatenate(tables) for tables in zip(*parts, strict=True))
            self._motions[step_s] = rows.Boundary(*whole)
        return self._motions[step_s]


class Trial:
    """The rope of a course at one setting, at rest, ready to be run again and again.

    Raises:
        SceneError: the scene cannot be built so, or its rope has no equilibrium.
    """

    def __init__(self, course: Course, setting: Setting) -> None:
        self.setting = setting
        self._course = course
        scene = variant(course.scene, setting.elements, setting.step_s, setting.tolerance_n)
        self._rope = build(scene).rope
        find_start(scene, self._rope)
        self._start = self._rope.state.copy()
        self._motion = course.motion(setting.step_s)
        self._steps = len(self._motion.value) - 1
        self._pull = np.zeros((self._steps, rows.PULL_COLUMNS))

    def look(self) -> Series:
        """Run it, with a look along the rope now and then.

        Raises:
            SolverError: a step that is not finite.
        """
        every = round(self._course.look_s / self.setting.step_s)
        looks = self._steps // every
        depth, slack = np.zeros(looks), np.zeros(looks, bool)
        rope = self._begin()
        for number in range(looks):
            self._advance(rope, number * every, every)
            count = rope.state.counts[rows.ELEMENTS]
            depth[number] = -rope.state.nodes[rows.POSITION + 2, 0]
            slack[number] = rope.work[rows.TENSION, :count].min() <= 0.0
        done = looks * every
        return Series(
            self.setting.step_s,
            self._pull[:done, rows.PULL].copy(),
            self._course.look_s,
            depth,
            slack,
            float(rope.state.health[rows.SOLVES]) / done,
            int(rope.state.health[rows.SUBSTEPS_UNCONVERGED]),
            _memory_mb(self._rope),
        )

    def real_time_factor(self) -> float:
        """Simulated time over time taken by the steps alone.

        The run is cut into pieces and repeated; the fastest time of each piece counts, since other
        programs use the machine too.
        """
        work = self._steps * self.setting.elements
        piece = math.ceil(self._steps / max(1, min(100, work // PIECE_NODE_STEPS)))
        runs: list[Vector] = []
        while len(runs) < MOST_RUNS:
            runs.append(self._timed(piece))
            spent = float(sum(run.sum() for run in runs))
            if len(runs) >= FEWEST_RUNS and spent > ENOUGH_S:
                break
        return self._steps * self.setting.step_s / float(np.min(runs, axis=0).sum())

    def _timed(self, piece: int) -> Vector:
        rope, took = self._begin(), []
        for first in range(0, self._steps, piece):
            began = time.perf_counter()
            self._advance(rope, first, min(piece, self._steps - first))
            took.append(time.perf_counter() - began)
        return np.array(took)

    def _begin(self) -> rows.Rope:
        return self._rope._replace(state=self._start.copy())

    def _advance(self, rope: rows.Rope, first: int, count: int) -> None:
        part = rows.Boundary(*(table[first : first + count + 1] for table in self._motion))
        pull = self._pull[first : first + count]
        done = advance(rope, part, pull, first * self.setting.step_s, count)
        if done < count:
            where = f"scene {self._course.scene.name}, {self.setting}"
            what = f"step {first + done + 1} is not finite"
            raise SolverError(phrase(where, what, "shorten the step"))


def _memory_mb(rope: rows.Rope) -> float:
    """Of all arrays that the steps work on."""
    effects = [value for effect in rope.effects for value in effect]
    values = [*rope.state, rope.work, rope.sections, *effects, *(rope.law or ())]
    return sum(value.nbytes for value in values if isinstance(value, np.ndarray)) * 1e-6
