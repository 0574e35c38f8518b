"""Load pin over a sheave: friction of the rope that runs over it, gain and bias.

Friction follows Dahl (1968): its state ξ, -1 to 1, changes with the travel s of the rope over the
sheave as dξ/ds = (sgn(ds) - ξ)/δ, so it reverses over a few δ and keeps its value while nothing
moves. The rope travels by what the winch pays out and by the stretch of the rope on deck.
"""

from __future__ import annotations

import numpy as np

from rope_twin.core.state import Floats
from rope_twin.estimation.figures import BIAS, FRICTION, GAIN, INDEX
from rope_twin.scene.learning import Learning


def dahl_states(travel_m: Floats, slip_m: float, state: float = 0.0) -> Floats:
    """Return ξ after each increment of travel, (k,), from the state before the first one.

    Between two reversals ξ = σ + (ξ_0 - σ)·exp(-|s - s_0|/δ) with the sign σ of the travel, which
    is exact however the travel is divided. slip_m: δ.
    """
    states = np.empty(len(travel_m))
    moving = travel_m != 0.0
    # a pause belongs to the run before it
    last = np.maximum.accumulate(np.where(moving, np.arange(len(travel_m)), 0))
    sign = np.sign(travel_m[last])
    ran = np.cumsum(np.abs(travel_m))
    begins = np.flatnonzero(np.diff(sign, prepend=2.0))
    for begin, end in zip(begins, [*begins[1:], len(travel_m)], strict=True):
        before = ran[begin - 1] if begin else 0.0
        toward = sign[begin]
        kept = np.exp(-(ran[begin:end] - before) / slip_m)
        states[begin:end] = toward + (state - toward) * kept
        state = float(states[end - 1])
    return states


class LoadPin:
    """Prediction of what the load pin measures of the rope's tension at the hang-off."""

    def __init__(self, learning: Learning, EA_n: float) -> None:
        """Take the sheave's properties; EA_n: axial stiffness of the rope on deck [N]."""
        self._slip_m = learning.friction_slip_m
        self._stretch_m_per_n = learning.friction_rope_m / EA_n

    def position(self, tension_n: Floats, line_out_m: Floats) -> Floats:
        """Return where the rope lies over the sheave at each time [m], (steps,)."""
        return np.asarray(line_out_m + tension_n * self._stretch_m_per_n)

    def friction_state(
        self, tension_n: Floats, line_out_m: Floats, before: tuple[float, float] | None = None
    ) -> Floats:
        """Return ξ at each time, (steps,), positive while paying out.

        tension_n, line_out_m: (steps,) at the same times. before: ξ and position [m] of the step
        before the first one; None: ξ is 0 at the first one.
        """
        position = self.position(tension_n, line_out_m)
        state, last_m = (0.0, float(position[0])) if before is None else before
        return dahl_states(np.diff(position, prepend=last_m), self._slip_m, state)

    def measured(self, tension_n: Floats, friction_state: Floats, theta: Floats) -> Floats:
        """Return the reading y = (1 + g)·T·(1 - μ·ξ) + b [N]; theta: in the order of NAMES."""
        gain, friction, bias = (theta[INDEX[name]] for name in (GAIN, FRICTION, BIAS))
        return np.asarray((1.0 + gain) * tension_n * (1.0 - friction * friction_state) + bias)
