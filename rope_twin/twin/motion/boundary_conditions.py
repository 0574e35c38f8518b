"""Boundary conditions of the rope: hang-off and payout at the boundaries of the next steps.

They follow from the inputs of a twin (heave or poses, winch commands) and, where the winch needs
tension feedback, from the rope after the last step.

For an ensemble's members they are computed a batch of steps at a time. Members with the same inputs
share them: the first member that needs a batch computes them. They are bit-identical to those of a
`Twin` with the same samples.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.interpolation import Times
from rope_twin.core.state import LINE, MOTIONS, Boundary, Floats, Rope, Z
from rope_twin.errors import InputError
from rope_twin.scene.schema import Scene, Ship
from rope_twin.scene.schema import Winch as WinchScene
from rope_twin.twin.inputs import TwinInputs
from rope_twin.twin.motion.hang_off import Moves
from rope_twin.twin.motion.heave_track import HeaveSeries, blending_cubic, ramp, rejoin_s
from rope_twin.twin.winch.commands import FEEDBACK_MODES, CommandSample, motion_of, schedule_samples
from rope_twin.twin.winch.winch import Winch

COMMAND_LEAD_NS = 8_000_000_000  # maximum lead of commands known in advance to the winch


class Blending:
    """Blending of each hang-off into the live motion after a return to an earlier state.

    The difference decays to zero as after a gap in the heave samples (`blending_cubic`).
    """

    def __init__(self, ropes: int) -> None:
        self.until_ns = -1  # twin time of the end of the blending
        self._error, self._rate = np.zeros((ropes, 3)), np.zeros((ropes, 3))

    def begin(self, now_ns: int, error_m: rows.Floats, rate_m_per_s: rows.Floats) -> None:
        """Start blending from these differences of the hang-offs, (ropes, 3) each."""
        self._error, self._rate = error_m.copy(), rate_m_per_s.copy()
        self.until_ns = now_ns + round(self._over_s * 1e9)

    @property
    def _over_s(self) -> float:
        return rejoin_s(float(np.linalg.norm(self._error, axis=1).max()))

    def at(self, time_ns: int) -> tuple[rows.Floats, rows.Floats]:
        """Return difference [m] and its rate [m/s] of each hang-off, (ropes, 3) each."""
        if time_ns >= self.until_ns:
            return np.zeros_like(self._error), np.zeros_like(self._rate)
        over_s = self._over_s
        u = 1.0 - (self.until_ns - time_ns) * 1e-9 / over_s
        return blending_cubic(self._error, self._rate, u, over_s)

    def add_to(self, moves: Moves, heave: tuple[float, float], time_ns: int) -> Moves:
        """Add the differences to the other hang-offs' motion; heave moves those without poses."""
        error, rate = self.at(time_ns)
        zero = (0.0, 0.0)
        blended = {}
        for r in range(1, len(error)):
            displacement, velocity = moves.get(r, ((*zero, heave[0]), (*zero, heave[1])))
            x, y, z = (np.asarray(displacement) + error[r]).tolist()
            u, v, w = (np.asarray(velocity) + rate[r]).tolist()
            blended[r] = ((x, y, z), (u, v, w))
        return blended


class LastStep(NamedTuple):
    """State of the rope at the end of the last step."""

    time_ns: int
    step_ns: int  # length of the next steps
    rope: Rope
    pull_n: float  # tension at the hang-off


class MotionState(NamedTuple):
    """State of the boundary conditions."""

    boundary: rows.Boundary
    steps: int
    blending: Blending


class BoundaryConditions:
    """Hang-off and payout from now on; row 0 of the arrays is the present."""

    def __init__(self, scene: Scene, steps: int, length_m: float) -> None:
        """Allocate boundary conditions for `steps` steps; length_m: payout at the start [m]."""
        self._ship, self._line = scene.ship, scene.ropes[0]
        *self._rest, self._rest_z = scene.ship.hang_off_m
        shape = (steps + 1, rows.MOTIONS)
        self.boundary = rows.Boundary(np.zeros(shape), np.zeros(shape))
        self.boundary.value[:] = [*scene.ship.hang_off_m, length_m]
        self.steps = 0  # number of steps prescribed in advance
        self.blending = Blending(len(scene.ropes))  # after a return to an earlier state

    def state(self) -> MotionState:
        """Return the state; its arrays are those in use."""
        return MotionState(self.boundary, self.steps, self.blending)

    def restore(self, state: MotionState) -> None:
        """Continue from a state."""
        self.boundary, self.steps, self.blending = state

    def return_to(self, earlier: rows.Boundary, present: rows.Boundary, time_ns: int) -> None:
        """Return to an earlier boundary, and blend the hang-offs into their live motion.

        earlier, present: of all ropes, (ropes, MOTIONS).
        """
        self.boundary.value[0], self.boundary.rate[0] = (table[0] for table in earlier)
        error, rate = self.blending.at(time_ns)
        differences = [
            np.nan_to_num((old - new)[: len(error), : rows.LINE])
            for old, new in zip(earlier, present, strict=True)
        ]
        self.blending.begin(time_ns, error + differences[0], rate + differences[1])

    def until(self, done: int) -> rows.Boundary:
        """Return a copy of the rows up to the boundary after `done` steps."""
        return rows.Boundary(*(table[: done + 1].copy() for table in self.boundary))

    def forget(self, done: int) -> None:
        """Make the boundary after `done` steps the first row; later ones are kept."""
        self.steps -= done
        for table in self.boundary:
            table[: self.steps + 1] = table[done : done + self.steps + 1]

    def fill(self, steps: int, inputs: TwinInputs, present: LastStep) -> int:
        """Set hang-off and payout at the boundaries of the next steps; return how many can be done.

        Steps prescribed by an earlier call but not done keep their values. Where a winch needs
        tension feedback, the steps before it must be done first.
        """
        for row in range(self.steps + 1, steps + 1):
            begin_ns = present.time_ns + (row - 1) * present.step_ns
            feedback = inputs.winch.needs_feedback(begin_ns)
            if row > 1 and (feedback or inputs.ropes.needing_feedback(begin_ns)):
                return row - 1
            begin = LastStep(begin_ns, present.step_ns, present.rope, present.pull_n)
            self._fill_row(row, inputs, begin, feedback)
            self.steps = row
        return steps

    def _fill_row(
        self, row: int, inputs: TwinInputs, present: LastStep, needs_feedback: bool
    ) -> None:
        """Set the boundary at the end of the step that begins now.

        needs_feedback: whether the winch needs tension feedback.
        """
        begin_ns, end_ns = present.time_ns, present.time_ns + present.step_ns
        mean, mean_z = self._rest, self._rest_z
        value, rate = self.boundary
        z, v = inputs.heave.at(end_ns)
        factor, factor_rate = ramp(end_ns * 1e-9, self._ship.motion_ramp_s)
        heave = (factor * z, factor * v + factor_rate * z)
        if inputs.heave.posed:  # else x and y have their mean values in every row
            for k, (displacement, velocity) in enumerate(inputs.heave.lateral_at(end_ns)):
                value[row, k] = mean[k] + factor * displacement
                rate[row, k] = factor * velocity + factor_rate * displacement
        value[row, rows.Z], rate[row, rows.Z] = mean_z + heave[0], heave[1]
        blended = end_ns < self.blending.until_ns
        if blended:
            if not inputs.heave.posed:
                value[row, : rows.Z], rate[row, : rows.Z] = mean, 0.0
            error, error_rate = self.blending.at(end_ns)
            value[row, : rows.LINE] += error[0]
            rate[row, : rows.LINE] += error_rate[0]
        feedback = None
        if needs_feedback:
            hang_offs = value[row - 1 : row + 1]
            feedback = inputs.winch.feedback(
                present.rope, self._line, present.pull_n, hang_offs, mean_z
            )
        step_s = present.rope.model.step
        length, speed = inputs.winch.step(begin_ns, step_s, heave[1], feedback)
        value[row, rows.LINE], rate[row, rows.LINE] = length, speed
        moves = inputs.heave.further_at(end_ns, (factor, factor_rate))
        if blended:
            moves = self.blending.add_to(moves, heave, end_ns)
        inputs.ropes.prescribe(row, begin_ns, step_s, heave, moves)


class PrescribedMotion(BoundaryConditions):
    """Boundary conditions of all ropes of a multi-line system, given for a batch of steps.

    Members of an ensemble share them; inputs of the twin do not change them.
    """

    def __init__(self, scene: Scene, set_motion: Callable[[Mapping[int, Boundary]], None]) -> None:
        """Prepare for a scene; set_motion: receives the motion of ropes other than the first."""
        super().__init__(scene, rows.STEPS_PER_CALL, scene.ropes[0].length_m)
        self._take, self._first = set_motion, 0
        self._given: Mapping[int, Boundary] = {}

    def give(self, first: int, motion: Mapping[int, Boundary]) -> None:
        """Prescribe the motion from the boundary before step `first` on, by rope; read-only."""
        self._first, self._given = first, motion

    def fill(self, steps: int, inputs: TwinInputs, present: LastStep) -> int:
        """Set hang-off and payout of all ropes for these steps, which must have been given."""
        row = present.time_ns // present.step_ns - self._first
        motion = {
            r: Boundary(*(table[row : row + steps + 1] for table in boundary))
            for r, boundary in self._given.items()
        }
        for table, values in zip(self.boundary, motion.pop(0), strict=True):
            table[: steps + 1] = values
        self._take(motion)
        inputs.heave.at(present.time_ns + steps * present.step_ns)  # its health follows the time
        self.steps = steps
        return steps


def is_known_in_advance(scene: WinchScene | None, commands: Sequence[CommandSample] | None) -> bool:
    """Return whether paid-out length follows from commands and heave, without tension feedback."""
    if scene is None:
        return True
    if commands is None:
        motions = [motion_of(row) for row in scene.schedule]
    else:
        motions = [sample.command for sample in commands]
    return (
        scene.drive is None
        and scene.passive_compensation is None
        and all(motion is None or motion.kind not in FEEDBACK_MODES for motion in motions)
    )


def check_commands(
    scene: WinchScene | None, length_m: float, commands: Sequence[CommandSample]
) -> None:
    """Check the commands of a winch that has paid out `length_m` at the start.

    Raises:
        InputError: the winch rejects a command.
    """
    winch = Winch(scene, length_m)
    for sample in commands:
        fault = winch.take(sample.stamp_ns, sample.command, max(sample.stamp_ns, 0))
        if fault:
            raise InputError(fault)


class WinchMotion:
    """Paid-out length over the steps, from commands that are known in advance."""

    def __init__(
        self,
        scene: WinchScene | None,
        length_m: float,
        commands: Sequence[CommandSample] | None,
        step_s: float,
        winch: Winch | None = None,
    ) -> None:
        """Start from `length_m` with these commands; None: the schedule of the scene.

        winch: that of this scene and length; None: a new one without properties of its rope.

        Raises:
            InputError: the winch rejects a command, or a command needs tension feedback, which
                cannot be computed in advance.
        """
        if not is_known_in_advance(scene, commands):
            problem = (
                "its drive, brake, or an order by depth or tension depends on the rope's tension"
            )
            remedy = "`rope_twin run` steps such a scene; leave them out of it here"
            raise InputError("winch", problem, remedy)
        self._scene = scene
        self._commands = None if commands is None else deque(commands)
        check_commands(scene, length_m, commands or ())
        self.winch = winch or Winch(scene, length_m)
        self._step_s, self._step_ns = step_s, round(step_s * 1e9)
        self._lock = threading.Lock()
        self._first, self._lines = 0, np.array([[length_m, 0.0]])
        self._submitted_ns = 0  # commands before have been passed to the winch

    def through(self, first: int, steps: int, heave_rate: Floats | None = None) -> Floats:
        """Return paid-out length [m] and its rate [m/s] at the step boundaries, (steps + 1, 2).

        Batches are requested in order, each any number of times. heave_rate: of the hang-off at the
        end of each step [m/s]; None: no motion.
        """
        rates = np.zeros(steps) if heave_rate is None else heave_rate
        with self._lock:
            if (self._first, len(self._lines)) != (first, steps + 1):
                lines = [tuple(self._lines[-1])]
                for step, rate in enumerate(rates.tolist(), start=first):
                    self._submit(step * self._step_ns)
                    line = self.winch.step(step * self._step_ns, self._step_s, rate)
                    lines.append((line.length_m, line.speed_m_per_s))
                self._first, self._lines = first, np.array(lines)
            return self._lines

    def _submit(self, now_ns: int) -> None:
        """Pass the commands of the next seconds to the winch; they were checked before."""
        if now_ns < self._submitted_ns:
            return
        to_ns = self._submitted_ns = now_ns + COMMAND_LEAD_NS
        due = [] if self._commands is not None else schedule_samples(self._scene, now_ns, to_ns)
        while self._commands and self._commands[0].stamp_ns < to_ns:
            due.append(self._commands.popleft())
        for sample in due:
            self.winch.take(sample.stamp_ns, sample.command, now_ns)


class SharedBoundary:
    """Hang-off and paid-out length over the steps, for all members that share them."""

    def __init__(
        self, ship: Ship, winch: WinchMotion, heave: HeaveSeries | None, step_s: float
    ) -> None:
        """Combine the motion of ship and winch; heave None: the ship does not move."""
        self._ship, self._winch, self._heave = ship, winch, heave
        self._step_ns = round(step_s * 1e9)
        self._lock = threading.Lock()
        self._first = 0
        self.boundary = Boundary(np.zeros((1, MOTIONS)), np.zeros((1, MOTIONS)))
        self.boundary.value[0, :LINE] = ship.hang_off_m
        self.boundary.value[0, LINE] = winch.through(0, 0)[0, 0]

    @property
    def winch(self) -> Winch:
        """The winch after the steps that were requested last."""
        return self._winch.winch

    def through(self, first: int, steps: int) -> Boundary:
        """Return the motion at the step boundaries, (steps + 1, MOTIONS); read-only.

        Raises:
            InputError: the heave series or the commands are invalid for these steps.
        """
        with self._lock:
            if (self._first, len(self.boundary.value)) != (first, steps + 1):
                self.boundary = self._compute(first, steps)
                self._first = first
            return self.boundary

    def _compute(self, first: int, steps: int) -> Boundary:
        boundary = Boundary(np.zeros((steps + 1, MOTIONS)), np.zeros((steps + 1, MOTIONS)))
        for table, last in zip(boundary, self.boundary, strict=True):
            table[0] = last[-1]
        boundary.value[1:, :LINE] = self._ship.hang_off_m
        if self._heave is not None:
            end_ns = np.arange(first + 1, first + steps + 1, dtype=np.int64) * self._step_ns
            build_up = _ramps(first, steps, self._step_ns, self._ship.motion_ramp_s)
            self._heave.move(boundary, Times(end_ns, *build_up))
        lines = self._winch.through(first, steps, boundary.rate[1:, Z])
        boundary.value[1:, LINE] = lines[1:, 0]
        boundary.rate[1:, LINE] = lines[1:, 1]
        return boundary


@lru_cache(maxsize=16)
def _ramps(first: int, steps: int, step_ns: int, duration_s: float) -> tuple[Floats, Floats]:
    """Return the build-up factor of the ship's motion and its rate at boundaries after `first`."""
    boundaries = range(first + 1, first + steps + 1)
    pairs = np.array([ramp(boundary * step_ns * 1e-9, duration_s) for boundary in boundaries])
    return np.ascontiguousarray(pairs[:, 0]), np.ascontiguousarray(pairs[:, 1])
