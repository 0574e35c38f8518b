"""What the parts of a winch hand to each other."""

from __future__ import annotations

import math
from typing import NamedTuple


class LineOut(NamedTuple):
    """Line out and its rate at one instant."""

    length_m: float
    speed_m_per_s: float  # + pays out


class Wish(NamedTuple):
    """How the line is to move, and between which lengths it must be able to stop."""

    speed_m_per_s: float
    low_m: float
    high_m: float


class Felt(NamedTuple):
    """What the rope was like at the end of the last step, and how it will answer the next one.

    Its pull at the next step's end is free - hold·(V' - parting) - brace·(V' - V), with V and V'
    the payout speeds before and after that step.
    """

    pull_n: float  # on the hang-off
    free_n: float  # the same if the payout speed had not been changing
    depth_m: float  # of its lower end below the mean water level, less the heave of the hang-off
    parting_m_per_s: float  # hang-off and the node below it part so, over the step
    hold: float  # of the elastic rope [N·s/m]
    brace: float  # of its damper, and of the half element at the hang-off [N·s/m]

    def at_speed(self, V: float) -> float:
        """The pull with which it would go on at a payout speed of 0 from this one [N]."""
        return self.free_n + self.hold * self.parting_m_per_s + self.brace * V


class Hung(NamedTuple):
    """The rope that a winch is given, as far as its orders and its drum are about it."""

    diameter_m: float  # on the drum
    stretch: float  # most of its length over the unstretched one: it breaks then
    hang_off_m: float  # height of the hang-off above the mean water level, at rest


UNKNOWN_ROPE = Hung(0.0, math.inf, 0.0)


class Moment(NamedTuple):
    """One step of the winch."""

    begin_ns: int
    step_s: float
    heave_m_per_s: float  # of the hang-off, up, at the step's end
    felt: Felt | None  # where a part or an order of the winch asks for it
