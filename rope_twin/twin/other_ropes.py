"""Ropes of a twin other than its first one: their winches, hang-offs and boundary conditions.

The twin owns the first rope with that rope's winch and hang-off; a single-line scene has no others.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.state import Boundary, Floats, Rope
from rope_twin.scene.schema import Scene
from rope_twin.twin.motion.hang_off import Moves
from rope_twin.twin.winch.commands import Payout, WinchCommand
from rope_twin.twin.winch.winch import Winch


class OtherRopes:
    """Base of the ropes that a twin steps: what it has beyond the first of them."""

    pull: Floats  # force on all upper ends now [N], (ropes, PULL_COLUMNS), of a multi-line system

    def __init__(self, scene: Scene, first: Rope) -> None:
        """Begin with the first rope alone."""
        self.first = first
        self._scene = scene
        self._ropes: tuple[Rope, ...] = ()
        self._winches: tuple[Winch, ...] = ()  # of all ropes of a multi-line system
        self._hung: tuple[int, ...] = ()  # ropes but the first whose upper end is a hang-off
        self._hang_offs = np.zeros((0, 3))
        self._boundary = Boundary(np.zeros((1, 1, rows.MOTIONS)), np.zeros((1, 1, rows.MOTIONS)))

    # Winches

    def _winch_called(self, name: str) -> Winch:
        return self._winches[[line.from_ for line in self._scene.ropes].index(name)]

    def offer(self, name: str, stamp_ns: int | None, command: WinchCommand, now_ns: int) -> str:
        """Submit a command to the winch of this name; return "" or the rejection."""
        return self._winch_called(name).take(stamp_ns, command, now_ns)

    def forbids(self, name: str, switch: str) -> str:
        """Return why the winch of this name would not execute a switch now; "": it would."""
        return self._winch_called(name).forbids(switch)

    def follow(self, name: str, stamp_ns: int, length_m: float, speed: float | None) -> None:
        """Let the winch of this name have a measured line out [m] and line speed [m/s]."""
        self._winch_called(name).follow(stamp_ns, length_m, speed)

    def invalidate(self) -> None:
        """Invalidate commands that were known in advance."""
        for winch in self._winches[1:]:
            winch.invalidate()

    def newest_ns(self) -> dict[str, int]:
        """Return the stamp of the newest accepted command of each winch but the first [ns]."""
        newest: dict[str, int] = {}
        for winch in self._winches[1:]:
            newest |= winch.newest_ns()
        return newest

    def needing_feedback(self, time_ns: int) -> dict[int, Winch]:
        """Return the winches that need tension feedback for the step from then on, by rope."""
        hung = {r: self._winches[r] for r in self._hung}
        return {r: winch for r, winch in hung.items() if winch.needs_feedback(time_ns)}

    def adapt_to_cut(self, r: int, lost_m: float, left_m: float) -> None:
        """Report to the winch of another rope the length cut off and the length left [m]."""
        self._winches[r].adapt_to_cut(lost_m, left_m)

    def scale(self, factors: Mapping[str, float]) -> None:
        """Set the figures of the other ropes as factors on the scene's; the first has them."""

    # Boundary conditions

    def prescribe(
        self, row: int, from_ns: int, step_s: float, heave: tuple[float, float], moves: Moves
    ) -> None:
        """Set hang-offs and payouts at step boundary `row`.

        heave: ship heave [m] and its rate [m/s]; moves: motion of the hang-offs moved by poses.
        """
        value, rate = self._boundary
        for r in self._hung:
            winch, still = self._winches[r], (0.0, 0.0)
            moved, moving = moves.get(r, ((*still, heave[0]), (*still, heave[1])))
            value[r, row, : rows.LINE] = self._hang_offs[r] + np.array(moved)
            rate[r, row, : rows.LINE] = moving
            feedback = None
            if winch.needs_feedback(from_ns):
                borders, pull_n = value[r, row - 1 : row + 1], float(self.pull[r, rows.PULL])
                rest_z_m = float(self._hang_offs[r, 2])
                own = self._rope(r), self._scene.ropes[r]
                feedback = winch.feedback(*own, pull_n, borders, rest_z_m)
            line = winch.step(from_ns, step_s, moving[2], feedback)
            value[r, row, rows.LINE], rate[r, row, rows.LINE] = line

    def forget(self, done: int, prescribed: int) -> None:
        """Make the boundary after `done` steps the first; `prescribed` ones follow it."""
        for table in self._boundary if self._hung else ():
            table[:, : prescribed + 1] = table[:, done : done + prescribed + 1]

    def discard_prescribed(self) -> None:
        """Let the winches of other ropes continue from the payout of the last step."""
        value, rate = self._boundary
        for r in self._hung:
            length, speed = float(value[r, 0, rows.LINE]), float(rate[r, 0, rows.LINE])
            self._winches[r].continue_from(Payout(length, speed))

    def border(self, first: Boundary) -> Boundary:
        """Return hang-offs and payouts now, (ropes, MOTIONS); first: those of the first rope."""
        own = Boundary(*(table[:, 0].copy() for table in self._boundary))
        for table, given in zip(own, first, strict=True):
            table[0] = given[0]
        return own

    # Ropes

    def all_with(self, first: Rope) -> tuple[Rope, ...]:
        """Return all ropes; first: the first one with the effects in use."""
        return first, *self._ropes

    def length_m(self, r: int) -> float:
        """Return the unstretched length of a rope other than the first [m]."""
        state = self._rope(r).state
        return float(state.s[state.counts[rows.ELEMENTS]])

    def _rope(self, r: int) -> Rope:
        return self.first if r == 0 else self._ropes[r - 1]
