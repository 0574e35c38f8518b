"""Boundary conditions of an ensemble's members, computed a batch of steps at a time.

Members with the same inputs share them: the member that needs a batch first computes it. They are
bit-identical to those of a `Twin` with the same samples.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from rope_twin.core.state import LINE, MOTIONS, Boundary, Floats, Z
from rope_twin.errors import InputError, phrase
from rope_twin.scene.schema import Ship
from rope_twin.scene.schema import Winch as WinchScene
from rope_twin.twin.motion.heave_series import HeaveSeries
from rope_twin.twin.motion.heave_track import ramp
from rope_twin.twin.winch.commands import FEEDBACK_MODES, CommandSample, motion_of, schedule_samples
from rope_twin.twin.winch.winch import Winch


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
    trial = Winch(scene, length_m)
    for sample in commands:
        fault = trial.take(sample.stamp_ns, sample.command, max(sample.stamp_ns, 0))
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
    ) -> None:
        """Start from `length_m` with these commands; None: the schedule of the scene.

        Raises:
            InputError: the winch rejects a command, or a command needs tension feedback, which
                cannot be computed in advance.
        """
        if not is_known_in_advance(scene, commands):
            what = "its drive, brake, or an order by depth or tension depends on the rope's tension"
            right = "`rope_twin run` steps such a scene; leave them out of it here"
            raise InputError(phrase("winch", what, right))
        self._scene = scene
        self._commands = None if commands is None else deque(commands)
        check_commands(scene, length_m, commands or ())
        self._winch = Winch(scene, length_m)
        self._step_s, self._step_ns = step_s, round(step_s * 1e9)
        self._lock = threading.Lock()
        self._first, self._lines = 0, np.array([[length_m, 0.0]])

    def through(self, first: int, steps: int, heave_rate: Floats | None = None) -> Floats:
        """Paid-out length [m] and its rate [m/s] at the step boundaries, (steps + 1, 2).

        Batches come in order, each maybe several times. heave_rate: of the hang-off at the end of
        each step [m/s]; None: no motion.
        """
        rates = np.zeros(steps) if heave_rate is None else heave_rate
        with self._lock:
            if (self._first, len(self._lines)) != (first, steps + 1):
                self._offer(first * self._step_ns, (first + steps) * self._step_ns)
                lines = [tuple(self._lines[-1])]
                for step, rate in enumerate(rates.tolist(), start=first):
                    line = self._winch.step(step * self._step_ns, self._step_s, rate)
                    lines.append((line.length_m, line.speed_m_per_s))
                self._first, self._lines = first, np.array(lines)
            return self._lines

    def _offer(self, from_ns: int, to_ns: int) -> None:
        """Pass the commands of a batch to the winch; the trial has shown that it accepts them."""
        due = [] if self._commands is not None else schedule_samples(self._scene, from_ns, to_ns)
        while self._commands and self._commands[0].stamp_ns < to_ns:
            due.append(self._commands.popleft())
        for sample in due:
            self._winch.take(sample.stamp_ns, sample.command, from_ns)


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

    def through(self, first: int, steps: int) -> Boundary:
        """Motion at the step boundaries, (steps + 1, MOTIONS); read-only.

        Raises:
            InputError: the heave series or the commands are invalid for these steps.
        """
        with self._lock:
            if (self._first, len(self.boundary.value)) != (first, steps + 1):
                self.boundary = self._computed(first, steps)
                self._first = first
            return self.boundary

    def _computed(self, first: int, steps: int) -> Boundary:
        made = Boundary(np.zeros((steps + 1, MOTIONS)), np.zeros((steps + 1, MOTIONS)))
        for table, before in zip(made, self.boundary, strict=True):
            table[0] = before[-1]
        x, y, rest_z = self._ship.hang_off_m
        border_ns = np.arange(first + 1, first + steps + 1, dtype=np.int64) * self._step_ns
        z, v = self._heave.at(border_ns) if self._heave else (np.zeros(steps), np.zeros(steps))
        share, share_rate = _ramps(first, steps, self._step_ns, self._ship.motion_ramp_s)
        made.value[1:, :Z] = x, y
        aside = self._heave.aside_at(border_ns) if self._heave else ()
        for k, (moved, speed) in enumerate(aside):
            made.value[1:, k] += share * moved
            made.rate[1:, k] = share * speed + share_rate * moved
        made.value[1:, Z] = rest_z + share * z
        made.rate[1:, Z] = share * v + share_rate * z
        lines = self._winch.through(first, steps, made.rate[1:, Z])
        made.value[1:, LINE] = lines[1:, 0]
        made.rate[1:, LINE] = lines[1:, 1]
        return made


@lru_cache(maxsize=16)
def _ramps(first: int, steps: int, step_ns: int, duration_s: float) -> tuple[Floats, Floats]:
    """Build-up factor of the ship's motion, and its rate, at the boundaries after `first`."""
    borders = range(first + 1, first + steps + 1)
    pairs = np.array([ramp(border * step_ns * 1e-9, duration_s) for border in borders])
    return np.ascontiguousarray(pairs[:, 0]), np.ascontiguousarray(pairs[:, 1])
