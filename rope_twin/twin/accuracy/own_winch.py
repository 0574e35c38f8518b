"""Winch of the coarse solution, where winches respond to the tension of their rope.

A drive that renders, a brake that slips, a command by depth or tension pay out by the rope's
response, so part of the rope's error is in the paid-out length. The coarse solution's winch is a
copy of the twin's at the moment of its first tension feedback; it gets the same commands and the
coarse tension.
"""

from __future__ import annotations

import copy

from rope_twin.core import state as rows
from rope_twin.core.state import Boundary, Rope
from rope_twin.scene.rules.rigging import places
from rope_twin.scene.schema import Scene
from rope_twin.twin.hoisting.feel import Course, feel
from rope_twin.twin.hoisting.orders import Order
from rope_twin.twin.hoisting.winch import Winch


class OwnWinch:
    """Winch of one rope of the coarse solution."""

    def __init__(self, winch: Winch, scene: Scene, r: int) -> None:
        """Copy the twin's winch of rope r at the time that the coarse solution has reached."""
        self._winch = copy.deepcopy(winch)
        self._line = scene.ropes[r]
        self._rest_z = places(scene)[self._line.from_][2]

    def take(self, stamp_ns: int | None, order: Order, now_ns: int) -> None:
        """Take a command that the twin's winch has accepted; rejections were counted there."""
        self._winch.take(stamp_ns, order, now_ns)

    def doubt(self) -> None:
        """Invalidate commands that were known in advance."""
        self._winch.doubt()

    def prescribe(self, rope: Rope, begin_ns: int, borders: Boundary, pull_n: float) -> None:
        """Set the paid-out length at the end of the step that begins now.

        borders: at the step's beginning and end, (2, rows.MOTIONS) each; the hang-off's motion is
        already there. pull_n: tension at the hang-off now [N].
        """
        value, rate = borders
        felt = None
        if self._winch.feels(begin_ns):
            heave = float(value[0, rows.Z]) - self._rest_z
            course = Course(heave, self._winch.payout_m_per_s2)
            felt = feel(rope, self._line, pull_n, value, course)
        heaving = float(rate[1, rows.Z])
        value[1, rows.LINE], rate[1, rows.LINE] = self._winch.step(
            begin_ns, rope.model.step, heaving, felt
        )
