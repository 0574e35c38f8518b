"""Load pin over a sheave: friction of the rope that runs over it, gain and bias.

Friction follows Dahl (1968): its state ξ, -1 to 1, changes with the travel s of the rope over the
sheave as dξ/ds = (sgn(ds) - ξ)/δ, so it reverses over a few δ and keeps its value while nothing
moves. The rope travels by what the winch pays out and by the stretch of the rope on deck.
"""

from __future__ import annotations

import numpy as np

from rope_twin.core.state import Floats
from rope_twin.estimation.figures import BIAS, FRICTION, GAIN, INDEX
from rope_twin.scene.instruments import Learning


def dahl_states(travel_m: Floats, slip_m: float, state: float | Floats = 0.0) -> Floats:
    """Return ξ after each increment of travel, from the state before the first one.

    An increment leads ξ to σ + (ξ - σ)·exp(-|ds|/δ) with the sign σ of the travel, which is exact
    however the travel is divided. That map is linear in ξ, so those of 2, 4, 8 ... increments
    follow from each other, for all columns at once. travel_m: (k,) or (k, members); slip_m: δ;
    state: one, or (members,).
    """
    kept = np.exp(-np.abs(travel_m) / slip_m)
    gained = np.sign(travel_m) * (1.0 - kept)
    reach = 1
    while reach < len(travel_m):
        gained[reach:] += kept[reach:] * gained[:-reach]
        kept[reach:] *= kept[:-reach]
        reach *= 2
    return np.asarray(gained + kept * state)


class LoadPin:
    """Prediction of what the load pin measures of the rope's tension at the hang-off."""

    def __init__(self, learning: Learning, EA_n: float) -> None:
        """Take the sheave's properties; EA_n: axial stiffness of the rope on deck [N]."""
        self._slip_m = learning.friction_slip_m
        self._stretch_m_per_n = learning.friction_rope_m / EA_n

    def position(self, tension_n: Floats, line_out_m: Floats) -> Floats:
        """Return where the rope lies over the sheave at each time [m], (steps, members)."""
        return np.asarray(line_out_m + tension_n * self._stretch_m_per_n)

    def friction_state(
        self, tension_n: Floats, line_out_m: Floats, before: Floats | None = None
    ) -> Floats:
        """Return ξ at each time, (steps, members), positive while paying out.

        tension_n: (steps, members) or (steps,), line_out_m: (steps,) at the same times. before: ξ
        and position [m] of the step before the first one, (2, members) or (2,); None: ξ is 0 at the
        first one.
        """
        line = line_out_m if tension_n.ndim == 1 else line_out_m[:, None]
        position = self.position(tension_n, line)
        state, last = (np.zeros(()), position[0]) if before is None else before
        return dahl_states(np.diff(position, axis=0, prepend=last[None]), self._slip_m, state)

    def measured(self, tension_n: Floats, friction_state: Floats, theta: Floats) -> Floats:
        """Return the reading y = (1 + g)·T·(1 - μ·ξ) + b [N]; theta: in the order of NAMES."""
        gain, friction, bias = (theta[INDEX[name]] for name in (GAIN, FRICTION, BIAS))
        return np.asarray((1.0 + gain) * tension_n * (1.0 - friction * friction_state) + bias)
