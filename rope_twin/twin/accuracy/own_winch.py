"""A winch of the companion's own, where winches answer to what they feel of the rope.

A drive that renders, a brake that slips, an order by depth or tension pay out by what the rope
does, so part of the rope's error is in the line out. The companion's winch is the twin's at the
moment at which that first feels its rope, gets the same orders and feels the companion.
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
    """It pays out to one of the companion's ropes from now on."""

    def __init__(self, winch: Winch, scene: Scene, r: int) -> None:
        """`winch`: the twin's of rope r at the time that the companion has reached."""
        self._winch = copy.deepcopy(winch)
        self._line = scene.ropes[r]
        self._rest_z = places(scene)[self._line.from_][2]

    def take(self, stamp_ns: int | None, order: Order, now_ns: int) -> None:
        """An order that the twin's winch has taken; what it refuses was counted there."""
        self._winch.take(stamp_ns, order, now_ns)

    def doubt(self) -> None:
        """As for the twin's."""
        self._winch.doubt()

    def prescribe(self, rope: Rope, begin_ns: int, borders: Boundary, pull_n: float) -> None:
        """Line out at the end of the step that begins now.

        borders: at the step's begin and end, (2, rows.MOTIONS) each; what the hang-off does is
        there already. pull_n: of the rope on the hang-off now [N].
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
