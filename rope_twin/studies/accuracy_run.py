"""A scene as `rope_twin run SCENE --speed 0` sees it, over a window, at any elements and step.

Its own sea, winch schedule and ramp, from rest. The motion of hang-off and line is computed once
for each step and shared by all numbers of elements; the core is stepped without a twin around it,
so that the top tension after every step is at hand and nothing but steps is timed.
A model is a line or a multi-line system that can be reset to equilibrium.
"""

from __future__ import annotations

import copy
import math
import time
from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline

from rope_twin.core import state as rows
from rope_twin.core.joined.joints import LOOSE, loaded_ends
from rope_twin.core.joined.statics import solve_reeved_statics
from rope_twin.core.state import Boundary, Floats, Ints
from rope_twin.core.step import advance, advance_joined
from rope_twin.errors import SolverError
from rope_twin.recording.heave import sample_of
from rope_twin.recording.motion_source import FIRST_NS, open_sea, series_of
from rope_twin.scene.error_bound import PEAK, RMS, Setting
from rope_twin.scene.joined_model import build_joined
from rope_twin.scene.rigging import is_joined, places, winch_of
from rope_twin.scene.rope_model import build
from rope_twin.scene.schema import RopeLine, Scene, Triple
from rope_twin.scene.vortex import coupled_settings, model_beside
from rope_twin.studies.driven_twin import fed, variant
from rope_twin.twin.motion.boundary_conditions import (
    SharedBoundary,
    WinchMotion,
    is_known_in_advance,
)
from rope_twin.twin.motion.hang_off import lever_arm
from rope_twin.twin.motion.heave_track import HeaveSeries
from rope_twin.twin.pacing import steps_in_slot
from rope_twin.twin.regrid import is_slack
from rope_twin.twin.statics import check_equilibrium, solve_scene_statics
from rope_twin.twin.twin import Twin
from rope_twin.vortex.coupled import VivDragAmplification

Vector = NDArray[np.float64]
AFTER_NS = 1_000_000_000  # heave goes on so long after the end: the last step looks ahead
PIECE_NODE_STEPS = 40_000  # a timed piece takes some 4 ms at least
ENOUGH_S, FEWEST_RUNS, MAX_RUNS = 0.6, 2, 7  # of timing


@dataclass(frozen=True)
class Series:
    """Results of a run."""

    step_s: float
    tension_n: Vector  # top tension after each step
    sampling_s: float
    depth_m: Vector  # of the lower end, or the first payload, at each look
    slack: NDArray[np.bool_]  # whether an element was without tension, at each look
    solves_per_step: float
    unconverged: int
    memory_mb: float


class MotionWindow:
    """Motion of a scene's rope over a window, for runs at many settings.

    Raises:
        RopeTwinError: the scene's sea is not there or ends before the window does.
    """

    def __init__(self, scene: Scene, seconds: float, sampling_s: float) -> None:
        self.scene, self.seconds, self.sampling_s = scene, seconds, sampling_s
        sea = open_sea(scene)
        samples = sea.between(FIRST_NS, round(seconds * 1e9) + AFTER_NS) if sea else []
        self._samples, self._heave = samples, series_of(samples)
        self._motions: dict[float, rows.Boundary] = {}
        known = is_joined(scene) or is_known_in_advance(scene.winch, None)
        self._line = None if known else _recorded_line(scene, seconds)

    def motion(self, step_s: float) -> rows.Boundary:
        """Return hang-off motion and line out at every step boundary, (steps + 1, MOTIONS).

        For multi-line systems it is (ropes, steps + 1, MOTIONS), constant for a rope without
        hang-off.
        """
        if step_s not in self._motions:
            scene = self.scene
            if is_joined(scene):
                known = places(scene)
                parts = [self._of_rope(line, known.get(line.from_), step_s) for line in scene.ropes]
                tables = (np.stack(columns) for columns in zip(*parts, strict=True))
                self._motions[step_s] = rows.Boundary(*tables)
            else:
                motion = self._of_rope(scene.ropes[0], scene.ship.hang_off_m, step_s)
                self._motions[step_s] = motion
        return self._motions[step_s]

    def _heave_at(self, position: Triple) -> HeaveSeries | None:
        """Return the motion of a hang-off at this rest position: from poses with its arm, or the
        heave.
        """
        posed = [sample for sample in self._samples if sample.pose is not None]
        if not posed or position == self.scene.ship.hang_off_m:
            return self._heave
        arm = lever_arm(self.scene, position)
        return series_of([sample_of(entry.pose, arm, None) for entry in posed if entry.pose])

    def _of_rope(self, line: RopeLine, position: Triple | None, step_s: float) -> rows.Boundary:
        """Return the motion of a rope with a hang-off at `position` at rest; None: it has none."""
        steps = round(self.seconds / step_s)
        if position is None:
            constant = np.zeros((steps + 1, rows.MOTIONS))
            constant[:, rows.LINE] = line.length_m
            return rows.Boundary(constant, np.zeros_like(constant))
        winch = None if self._line is not None else winch_of(self.scene, line)
        track = WinchMotion(winch, line.length_m, None, step_s)
        ship = replace(self.scene.ship, hang_off_m=position)
        borders = SharedBoundary(ship, track, self._heave_at(position), step_s)
        value, rate = borders.through(0, steps)
        if self._line is not None:
            border_s = np.arange(steps + 1) * step_s
            value[:, rows.LINE] = self._line(border_s)
            rate[:, rows.LINE] = self._line(border_s, 1)
        return rows.Boundary(value, rate)


def _recorded_line(scene: Scene, seconds: float) -> CubicHermiteSpline:
    """Return the recorded line out of a winch with tension feedback, at the scene's own setting.

    All runs of a course get the same: what differs between them is then the solver's doing.
    """
    snapshots = [(0.0, scene.ropes[0].length_m, 0.0)]
    snapshots += [
        (snapshot.time_s, snapshot.line_out_m, snapshot.payout_speed_m_per_s)
        for snapshot in fed(Twin(scene), seconds + 1e-9 * AFTER_NS)
    ]
    return CubicHermiteSpline(*np.array(snapshots).T)


class Trial:
    """Rope or ropes of a course at one setting, at rest; can be run repeatedly.

    Raises:
        SceneError: the scene cannot be built so, or there is no equilibrium.
    """

    def __init__(self, course: MotionWindow, setting: Setting) -> None:
        self.setting = setting
        self._course = course
        self._body = body_of(
            variant(course.scene, setting.elements, setting.step_s, setting.tolerance_n)
        )
        self._motion = course.motion(setting.step_s)
        self._steps = self._motion.value.shape[-2] - 1
        self._tension = np.zeros(self._steps)

    def run(self) -> Series:
        """Run the course; sample depth and slack every `sampling_s`.

        Raises:
            SolverError: a step that is not finite.
        """
        every = round(self._course.sampling_s / self.setting.step_s)
        samples = self._steps // every
        depth, slack = np.zeros(samples), np.zeros(samples, bool)
        self._body.begin()
        for number in range(samples):
            first = number * every
            self._advance(self._part(first, every), first, every)
            depth[number] = self._body.depth_m()
            slack[number] = is_slack(self._body.ropes)
        steps = samples * every
        return Series(
            self.setting.step_s,
            self._tension[:steps].copy(),
            self._course.sampling_s,
            depth,
            slack,
            float(self._body.health[rows.SOLVES]) / steps,
            int(self._body.health[rows.SUBSTEPS_UNCONVERGED]),
            self._body.memory_mb,
        )

    def real_time_factor(self) -> float:
        """Return simulation time over the computing time of the steps.

        The run is cut into pieces and repeated; the fastest time of each piece counts, since other
        programs use the machine too.
        """
        element_steps = self._steps * self.setting.elements
        piece = math.ceil(self._steps / max(1, min(100, element_steps // PIECE_NODE_STEPS)))
        runs: list[Vector] = []
        while len(runs) < MAX_RUNS:
            runs.append(self._timed(piece))
            spent_s = float(sum(run.sum() for run in runs))
            if len(runs) >= FEWEST_RUNS and spent_s > ENOUGH_S:
                break
        min_s = float(np.min(runs, axis=0).sum())
        return float(self._steps * self.setting.step_s / min_s)

    def _timed(self, piece: int) -> Vector:
        times_s = []
        self._body.begin()
        for first in range(0, self._steps, piece):
            count = min(piece, self._steps - first)
            part = self._part(first, count)
            start_s = time.perf_counter()
            self._advance(part, first, count)
            times_s.append(time.perf_counter() - start_s)
        return np.array(times_s)

    def _part(self, first: int, count: int) -> rows.Boundary:
        tables = (table[..., first : first + count + 1, :] for table in self._motion)
        return rows.Boundary(*map(np.ascontiguousarray, tables))

    def _advance(self, part: rows.Boundary, first: int, count: int) -> None:
        completed, tension = self._body.advance(part, first * self.setting.step_s, count)
        self._tension[first : first + count] = tension
        if completed < count:
            where = f"scene {self._course.scene.name}, {self.setting}"
            raise SolverError(
                where, f"step {first + completed + 1} is not finite", "shorten the step"
            )


STILL = 1e-4  # of the mean: a tension that varies by less is still, and the mean is the scale
TAUT_S = 0.5  # a rope that is taut for so long after it was slack has snapped


@dataclass(frozen=True)
class Quantity:
    """One quantity of a run."""

    name: str
    unit: str  # of the error
    words: str
    of: str = ""  # what the error is stated in parts of
    value: str = ""  # of `values` whose error it is; empty: an rms of differences


QUANTITIES = (
    Quantity(RMS, "%", "top tension, rms"),
    Quantity("tension_mean", "%", "its mean", "mean", "tension_mean_n"),
    Quantity("tension_std", "%", "its standard deviation", "std", "tension_std_n"),
    Quantity(PEAK, "%", "its highest", "itself", "tension_max_n"),
    Quantity("tension_trough", "%", "its lowest", "std", "tension_min_n"),
    Quantity("snap_peak", "%", "mean of the snaps' peaks", "itself", "snap_peak_n"),
    Quantity("payload_depth", "m", "payload's depth, rms"),
    Quantity("slack_share", "%", "share of time slack", "the time", "slack_share"),
)
BY_NAME = {quantity.name: quantity for quantity in QUANTITIES}
Values = dict[str, float | None]


def values(series: Series) -> Values:
    """Return the quantities of a run, SI; RMS differences have no value of their own."""
    tension = series.tension_n
    return {
        "tension_mean_n": float(tension.mean()),
        "tension_std_n": float(tension.std()),
        "tension_max_n": float(tension.max()),
        "tension_min_n": float(tension.min()),
        "snap_peak_n": snap_peak_n(series),
        "payload_depth_mean_m": float(series.depth_m.mean()),
        "slack_share": float(series.slack.mean()),
    }


def differences(series: Series, truth: Series) -> Values:
    """Return the differences to a run with the same or a shorter step, signed where applicable.

    In the units of QUANTITIES; None where there is nothing to compare.
    """
    figures, true_figures = values(series), values(truth)
    every = round(series.step_s / truth.step_s)
    true_n = truth.tension_n[every - 1 :: every][: len(series.tension_n)]
    deviation = series.tension_n[: len(true_n)] - true_n
    scale = tension_scale(truth)
    parts = {"mean": float(truth.tension_n.mean()), "std": scale, "the time": 1.0}
    changes: Values = dict.fromkeys(BY_NAME)
    changes[RMS] = 100.0 * _rms(deviation) / scale
    changes["payload_depth"] = _rms(series.depth_m - truth.depth_m)
    for quantity in filter(lambda quantity: quantity.value, QUANTITIES):
        value, true_value = figures[quantity.value], true_figures[quantity.value]
        part = parts.get(quantity.of, true_value)
        if value is not None and true_value is not None and part:
            changes[quantity.name] = 100.0 * (value - true_value) / part
    return changes


def tension_scale(series: Series) -> float:
    """Return the standard deviation of the top tension, or its mean if it is constant."""
    mean, spread = float(series.tension_n.mean()), float(series.tension_n.std())
    return spread if spread > STILL * abs(mean) else mean


def snap_peak_n(series: Series) -> float | None:
    """Return the mean of the peak top tensions after slack (snap loads); None: no snap."""
    edges = np.flatnonzero(np.diff(np.concatenate([[True], series.slack, [True]])))
    every = round(series.sampling_s / series.step_s)
    peaks = [
        series.tension_n[begin * every : end * every].max()
        for begin, end in zip(edges[::2], edges[1::2], strict=True)
        if begin > 0 and (end - begin) * series.sampling_s >= TAUT_S
    ]
    return float(np.mean(peaks)) if peaks else None


def _rms(deviation: Vector) -> float:
    return float(np.sqrt(np.mean(deviation**2)))


class Body(ABC):
    """Ropes at rest that can be stepped."""

    ropes: tuple[rows.Rope, ...]  # the first one stores the solver's counts
    memory_mb: float  # of all arrays that the steps work on
    lowest = 0  # number of the rope with the first payload

    @abstractmethod
    def begin(self) -> None:
        """Reset to static equilibrium, without vibration."""

    @abstractmethod
    def advance(self, motion: Boundary, time: float, steps: int) -> tuple[int, Floats]:
        """Return the number of steps done, and the top tension after each [N], (steps,)."""

    def depth_m(self) -> float:
        """Return the depth of the lower end, or of the first payload [m]."""
        return -float(self.ropes[self.lowest].state.nodes[rows.POSITION + 2, 0])

    @property
    def health(self) -> Ints:
        """Return the solver's counts since the start."""
        return self.ropes[0].state.health


def body_of(scene: Scene) -> Body:
    """Return the model of a scene. Raises SceneError: it cannot be built, or has no equilibrium."""
    body = JoinedBody(scene) if is_joined(scene) else RopeBody(scene)
    return body if model_beside(scene) is None else VibratingSystem(scene, body)


class RopeBody(Body):
    """One rope; its motion is (steps + 1, MOTIONS)."""

    loaded = (False,)  # whether the upper end of a rope carries loads

    def __init__(self, scene: Scene) -> None:
        rope = build(scene)
        solve_scene_statics(scene, rope)
        self.ropes = (rope,)
        self._start = copy.deepcopy(rope)  # wakes and a rigid body are kept in the effects
        self.memory_mb = _memory_mb((rope.state, rope.work, rope.sections, rope.effects, rope.law))

    def begin(self) -> None:
        self.ropes = (copy.deepcopy(self._start),)

    def advance(self, motion: Boundary, time: float, steps: int) -> tuple[int, Floats]:
        tension = np.zeros((steps, rows.PULL_COLUMNS))
        return advance(self.ropes[0], motion, tension, time, steps), tension[:, rows.PULL]


class JoinedBody(Body):
    """Multi-line system; motion (ropes, steps + 1, MOTIONS), top tension of the first rope."""

    def __init__(self, scene: Scene) -> None:
        model = build_joined(scene)
        self._system = system = model.system
        self.ropes = system.ropes
        boundary = np.zeros((len(system.ropes), rows.MOTIONS))
        boundary[:, : rows.LINE] = np.nan_to_num(model.hang_off_m)
        boundary[:, rows.LINE] = [line.length_m for line in scene.ropes]
        end = solve_reeved_statics(system, boundary)
        check_equilibrium(scene, end, max(self._highest(r) for r in range(len(system.ropes))))
        self.lowest = model.owners[scene.payloads[0].name] if scene.payloads else 0
        stack = system.stack
        state = (stack.nodes, stack.s, stack.offset, stack.counts, stack.health)
        self._tables = _arrays((state, system.joints.nodes, system.joints.ties, system.sheaves))
        self._start = [table.copy() for table in self._tables]
        self.memory_mb = _memory_mb((stack, system.joints, system.sheaves))

    def begin(self) -> None:
        for table, start in zip(self._tables, self._start, strict=True):
            table[...] = start

    def advance(self, motion: Boundary, time: float, steps: int) -> tuple[int, Floats]:
        tension = np.zeros((len(self._system.ropes), steps, rows.PULL_COLUMNS))
        return advance_joined(self._system, motion, tension, time, steps), tension[0, :, rows.PULL]

    @property
    def loaded(self) -> tuple[bool, ...]:
        """Return whether the upper end of each rope carries loads."""
        return loaded_ends(self._system)

    def _highest(self, r: int) -> float:
        """Return the height of the highest node of rope r below its hang-off [m]."""
        rope, joints = self._system.ropes[r], self._system.joints
        count = int(rope.state.counts[rows.ELEMENTS]) + int(joints.upper[r] != LOOSE)
        return float(rope.state.nodes[rows.POSITION + 2, :count].max())


class VibratingSystem(Body):
    """Line or multi-line system with a VIV model outside the time step, updated as in a twin."""

    def __init__(self, scene: Scene, body: RopeBody | JoinedBody) -> None:
        self._scene, self._body = scene, body
        self.memory_mb, self.lowest = body.memory_mb, body.lowest
        self._steps = 0  # done since the beginning
        self._shake()

    def begin(self) -> None:
        self._body.begin()
        self._shake()

    def advance(self, motion: Boundary, time: float, steps: int) -> tuple[int, Floats]:
        tension, done = np.zeros(steps), 0
        while done < steps:
            count = min(steps - done, self._viv_drag.steps_to_sampling(self._steps))
            part = Boundary(
                *(np.ascontiguousarray(table[..., done : done + count + 1, :]) for table in motion)
            )
            at_s = time + done * self.ropes[0].model.step
            completed, tension[done : done + count] = self._body.advance(part, at_s, count)
            done, self._steps = done + completed, self._steps + completed
            if completed < count:
                break
            if self._viv_drag.steps_to_sampling(self._steps) == 0:
                first = (table if table.ndim == 2 else table[0] for table in motion)
                boundary = Boundary(*(table[done:] for table in first))
                self._viv_drag.observe(self.ropes, boundary, self._steps, 0)
        return done, tension

    def _shake(self) -> None:
        cycle, body = steps_in_slot(self._scene.time.step_s), self._body
        self.ropes = body.ropes
        settings = coupled_settings(self._scene)
        self._viv_drag = VivDragAmplification(settings, body.ropes, body.loaded, cycle)
        self._steps = 0


def _arrays(value: Any) -> list[Any]:
    """Return all arrays in a nested tuple."""
    if isinstance(value, np.ndarray):
        return [value]
    return [array for part in value for array in _arrays(part)] if isinstance(value, tuple) else []


def _memory_mb(value: Any) -> float:
    return 1e-6 * float(sum(table.nbytes for table in _arrays(value)))
