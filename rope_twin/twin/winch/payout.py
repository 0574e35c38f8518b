"""Values exchanged between the components of a winch."""

from __future__ import annotations

import math
from typing import NamedTuple


class Payout(NamedTuple):
    """Payout and its rate at one instant."""

    length_m: float
    speed_m_per_s: float  # + pays out


class LineTarget(NamedTuple):
    """Target speed of the line, and the lengths within which it must be able to stop."""

    speed_m_per_s: float
    low_m: float
    high_m: float


class TensionFeedback(NamedTuple):
    """Tension feedback: the rope at the end of the last step and its expected response.

    Its tension at the next step's end is free - hold·(V' - parting) - brace·(V' - V), with V and V'
    the pay-out speeds before and after that step.
    """

    pull_n: float  # tension at the hang-off
    free_n: float  # the same at a constant pay-out speed
    depth_m: float  # of its lower end below mean water level, less the heave of the hang-off
    separation_m_per_s: float  # separation rate of hang-off and the node below it, over the step
    hold: float  # response of the elastic rope [N·s/m]
    brace: float  # response of its damping and of the half element at the hang-off [N·s/m]

    def at_speed(self, V: float) -> float:
        """Return the tension at a zero pay-out speed after this one [N]."""
        return self.free_n + self.hold * self.separation_m_per_s + self.brace * V


class SpooledRope(NamedTuple):
    """Properties of the rope on a winch that its commands and its drum depend on."""

    diameter_m: float  # on the drum
    stretch: float  # maximum stretched over unstretched length, at break
    hang_off_m: float  # mean height of the hang-off above the mean water level


UNKNOWN_ROPE = SpooledRope(0.0, math.inf, 0.0)


class WinchStep(NamedTuple):
    """One time step of a winch."""

    begin_ns: int
    step_s: float
    heave_m_per_s: float  # velocity of the hang-off, up, at the step's end
    feedback: TensionFeedback | None  # tension feedback, if a component or command needs it
