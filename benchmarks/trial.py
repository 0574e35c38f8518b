"""A scene run by the core alone under its own regular heave, and its error against a finer run.

Nothing but the step is timed: the hang-off's motion is computed beforehand, exactly, at every
border of a step, and no snapshot is taken.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rope_twin.core import state as rows
from rope_twin.core.statics import find_equilibrium
from rope_twin.core.step import advance
from rope_twin.errors import InputError, SolverError
from rope_twin.recording.motion_source import RegularSea
from rope_twin.scene.load import load_scene
from rope_twin.scene.rope_model import build
from rope_twin.scene.schema import Scene
from rope_twin.studies.driven_twin import variant
from rope_twin.twin.motion.heave_track import ramp

Vector = NDArray[np.float64]


@dataclass(frozen=True)
class Outcome:
    """One run: the top tension after each step, what it took, and how the solver fared."""

    tension_n: Vector
    took_s: Vector  # of each piece that was timed by itself
    busy_s: float  # processor time of all pieces; less than they took where others ran as well
    solves: int
    substeps: int
    substeps_max: int  # in one step
    unconverged: int


class Trial:
    """A scene at rest, ready to be run for `seconds` from there as often as wanted.

    Raises:
        InputError: the scene's sea is not a regular heave.
    """

    def __init__(self, scene: Scene, seconds: float) -> None:
        self.scene = scene
        self.steps = round(seconds / scene.time.step_s)
        self._rope = build(scene)
        find_equilibrium(self._rope, scene.ropes[0].length_m)
        self._start = self._rope.state.copy()
        self._boundary = _motion(scene, self.steps)
        self._pull = np.zeros((self.steps, rows.PULL_COLUMNS))

    def run(self, steps_at_once: int | None = None) -> Outcome:
        """Run in pieces of so many steps (None: all at once), each timed.

        Raises:
            SolverError: a step is not finite.
        """
        rope = self._rope._replace(state=self._start.copy())
        h, piece = self.scene.time.step_s, steps_at_once or self.steps
        took, busy_s = [], 0.0
        for first in range(0, self.steps, piece):
            count = min(piece, self.steps - first)
            part = rows.Boundary(*(table[first : first + count + 1] for table in self._boundary))
            pull = self._pull[first : first + count]
            busy, began = time.thread_time(), time.perf_counter()
            done = advance(rope, part, pull, first * h, count)
            took.append(time.perf_counter() - began)
            busy_s += time.thread_time() - busy
            if done < count:
                problem = f"step {first + done + 1} is not finite"
                raise SolverError(f"scene {self.scene.name}", problem, "shorten the step")
        health = rope.state.health
        return Outcome(
            self._pull[:, rows.PULL].copy(),
            np.array(took),
            busy_s,
            int(health[rows.SOLVES]),
            int(health[rows.SUBSTEPS]),
            int(health[rows.SUBSTEPS_MAX]),
            int(health[rows.SUBSTEPS_UNCONVERGED]),
        )


def _motion(scene: Scene, steps: int) -> rows.Boundary:
    """Return the hang-off motion at every step boundary; the line out is constant."""
    if scene.sea_state.heave is None:
        problem = "its sea is not a regular heave"
        raise InputError(f"scene {scene.name}", problem, "give `sea_state: {heave: ...}`")
    sea = RegularSea(scene.sea_state.heave, scene.sea_state.start_s)
    x, y, rest_z = scene.ship.hang_off_m
    value = np.tile([x, y, rest_z, scene.ropes[0].length_m], (steps + 1, 1))
    rate = np.zeros_like(value)
    for border in range(steps + 1):
        at_s = border * scene.time.step_s
        z, v = sea.at(at_s)
        share, share_rate = ramp(at_s, scene.ship.motion_ramp_s)
        value[border, rows.Z] += share * z
        rate[border, rows.Z] = share * v + share_rate * z
    return rows.Boundary(value, rate)


@dataclass(frozen=True)
class Errors:
    """Errors of a top tension against a reference, at its own times."""

    mean_pct: float  # mean magnitude, of the reference's standard deviation
    rms_pct: float  # of the reference's standard deviation
    peak_pct: float  # of the reference's maximum
    trough_pct: float  # of the reference's standard deviation, since a trough may be zero


@dataclass(frozen=True)
class Reference:
    """The top tension of a scene after each of its fine steps."""

    scene: str
    nodes: int
    step_s: float
    tension_n: Vector

    def errors(self, tension_n: Vector, step_s: float) -> Errors:
        """Return the errors of a tension after each step of `step_s`, a multiple of the
        reference's.
        """
        every = round(step_s / self.step_s)
        exact_n = self.tension_n[every - 1 :: every]
        scale = float(self.tension_n.std())
        error_n = tension_n - exact_n
        return Errors(
            100.0 * float(np.mean(np.abs(error_n))) / scale,
            100.0 * float(np.sqrt(np.mean(error_n**2))) / scale,
            100.0 * float(tension_n.max() / self.tension_n.max() - 1.0),
            100.0 * float(tension_n.min() - self.tension_n.min()) / scale,
        )


def find_reference(name: str, nodes: int, step_s: float, seconds: float) -> Reference:
    """Run a shipped scene with this number of elements (as many as moving nodes) and this step."""
    outcome = Trial(variant(load_scene(name), nodes, step_s), seconds).run()
    return Reference(name, nodes, step_s, outcome.tension_n)


def doubt(reference: Reference, seconds: float) -> Errors:
    """Return the difference of a run with half the elements and twice the step to the reference.

    The reference's own error is a third of this at second order, all of it at first.
    """
    coarse = find_reference(reference.scene, reference.nodes // 2, 2.0 * reference.step_s, seconds)
    return reference.errors(coarse.tension_n, coarse.step_s)
