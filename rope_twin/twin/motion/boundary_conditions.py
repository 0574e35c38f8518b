"""Boundary conditions of the rope: hang-off and payout at the boundaries of the next steps.

They follow from the inputs of a twin (heave or poses, winch commands) and, where the winch needs
tension feedback, from the rope after the last step.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.state import Rope
from rope_twin.scene.schema import Scene
from rope_twin.twin.inputs import TwinInputs
from rope_twin.twin.motion.hang_off import Moves
from rope_twin.twin.motion.heave_track import REJOIN_S, ramp
from rope_twin.twin.winch.payout import HangOffMotion, tension_feedback

STEPS_PER_CALL = 256  # number of steps for which a twin prescribes motion at most


class Blending:
    """Blending of each hang-off into the live motion after a return to an earlier state.

    The difference decays to zero within REJOIN_S as the cubic that has the difference and its rate
    at its beginning and zero at its end, as after a gap in the heave samples.
    """

    def __init__(self, ropes: int) -> None:
        self.until_ns = -1  # twin time of the end of the blending
        self._error, self._rate = np.zeros((ropes, 3)), np.zeros((ropes, 3))

    def begin(self, now_ns: int, error_m: rows.Floats, rate_m_per_s: rows.Floats) -> None:
        """Start blending from these differences of the hang-offs, (ropes, 3) each."""
        self.until_ns = now_ns + round(REJOIN_S * 1e9)
        self._error, self._rate = error_m.copy(), rate_m_per_s.copy()

    def at(self, time_ns: int) -> tuple[rows.Floats, rows.Floats]:
        """Return difference [m] and its rate [m/s] of each hang-off, (ropes, 3) each."""
        if time_ns >= self.until_ns:
            return np.zeros_like(self._error), np.zeros_like(self._rate)
        u = 1.0 - (self.until_ns - time_ns) * 1e-9 / REJOIN_S
        e, d = self._error, self._rate * REJOIN_S
        value = e * (1.0 + u * u * (2.0 * u - 3.0)) + d * u * (1.0 - u) ** 2
        slope = e * 6.0 * u * (u - 1.0) + d * (1.0 - u) * (1.0 - 3.0 * u)
        return value, slope / REJOIN_S

    def added(self, moves: Moves, heave: tuple[float, float], time_ns: int) -> Moves:
        """Add the differences to the other hang-offs' motion; heave moves those without poses."""
        error, rate = self.at(time_ns)
        still = (0.0, 0.0)
        led = {}
        for r in range(1, len(error)):
            moved, moving = moves.get(r, ((*still, heave[0]), (*still, heave[1])))
            x, y, z = (np.asarray(moved) + error[r]).tolist()
            u, v, w = (np.asarray(moving) + rate[r]).tolist()
            led[r] = ((x, y, z), (u, v, w))
        return led


class Present(NamedTuple):
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
        borders = (steps + 1, rows.MOTIONS)
        self.boundary = rows.Boundary(np.zeros(borders), np.zeros(borders))
        self.boundary.value[:] = [*scene.ship.hang_off_m, length_m]
        self.steps = 0  # number of steps prescribed in advance
        self.blending = Blending(len(scene.ropes))  # after a return to an earlier state

    def state(self) -> MotionState:
        """Return the state; its arrays are those in use."""
        return MotionState(self.boundary, self.steps, self.blending)

    def restore(self, state: MotionState) -> None:
        """Continue from a state."""
        self.boundary, self.steps, self.blending = state

    def return_to(self, then: rows.Boundary, present: rows.Boundary, time_ns: int) -> None:
        """Return to an earlier boundary, and blend the hang-offs into their live motion.

        then, present: of all ropes, (ropes, MOTIONS).
        """
        self.boundary.value[0], self.boundary.rate[0] = (table[0] for table in then)
        error, rate = self.blending.at(time_ns)
        moved = [
            np.nan_to_num((old - new)[: len(error), : rows.LINE])
            for old, new in zip(then, present, strict=True)
        ]
        self.blending.begin(time_ns, error + moved[0], rate + moved[1])

    def until(self, done: int) -> rows.Boundary:
        """Return a copy of the rows up to the boundary after `done` steps."""
        return rows.Boundary(*(table[: done + 1].copy() for table in self.boundary))

    def forget(self, done: int) -> None:
        """Make the boundary after `done` steps the first row; later ones are kept."""
        self.steps -= done
        for table in self.boundary:
            table[: self.steps + 1] = table[done : done + self.steps + 1]

    def fill(self, steps: int, inputs: TwinInputs, now: Present) -> int:
        """Set hang-off and payout at the boundaries of the next steps; return how many can be done.

        Steps prescribed by an earlier call but not done keep their values. Where a winch needs
        tension feedback, the steps before it must be done first.
        """
        for row in range(self.steps + 1, steps + 1):
            begin_ns = now.time_ns + (row - 1) * now.step_ns
            feedback = inputs.winch.needs_feedback(begin_ns)
            if row > 1 and (feedback or inputs.ropes.needs_feedback(begin_ns)):
                return row - 1
            then = Present(begin_ns, now.step_ns, now.rope, now.pull_n)
            self._fill_border(row, inputs, then, feedback)
            self.steps = row
        return steps

    def _fill_border(self, row: int, inputs: TwinInputs, now: Present, feedback: bool) -> None:
        """Set the boundary at the end of the step that begins now; felt: needs tension feedback."""
        begin_ns, border_ns = now.time_ns, now.time_ns + now.step_ns
        rest, rest_z = self._rest, self._rest_z
        value, rate = self.boundary
        z, v = inputs.heave.at(border_ns)
        share, share_rate = ramp(border_ns * 1e-9, self._ship.motion_ramp_s)
        heave = (share * z, share * v + share_rate * z)
        if inputs.heave.posed:  # else x and y have their mean values in every row
            for k, (aside, moving) in enumerate(inputs.heave.aside_at(border_ns)):
                value[row, k] = rest[k] + share * aside
                rate[row, k] = share * moving + share_rate * aside
        value[row, rows.Z], rate[row, rows.Z] = rest_z + heave[0], heave[1]
        led = border_ns < self.blending.until_ns
        if led:
            if not inputs.heave.posed:
                value[row, : rows.Z], rate[row, : rows.Z] = rest, 0.0
            error, error_rate = self.blending.at(border_ns)
            value[row, : rows.LINE] += error[0]
            rate[row, : rows.LINE] += error_rate[0]
        rope = None
        if feedback:
            borders = value[row - 1 : row + 1]
            course = HangOffMotion(float(borders[0, rows.Z]) - rest_z, inputs.winch.payout_m_per_s2)
            rope = tension_feedback(now.rope, self._line, now.pull_n, borders, course)
        step_s = now.rope.model.step
        length, speed = inputs.winch.step(begin_ns, step_s, heave[1], rope)
        value[row, rows.LINE], rate[row, rows.LINE] = length, speed
        moves = inputs.heave.further_at(border_ns, (share, share_rate))
        if led:
            moves = self.blending.added(moves, heave, border_ns)
        inputs.ropes.prescribe(row, begin_ns, step_s, heave, moves)
