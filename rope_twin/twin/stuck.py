"""The sentence for a rope that the solver cannot step on."""

from __future__ import annotations

from rope_twin.core.solve.halving import HALVINGS
from rope_twin.errors import phrase


def no_next_state(step: int, time_s: float) -> str:
    """Why the step of this number does not come about; time_s: where it begins [s]."""
    return phrase(
        f"step {step} at {time_s:.2f} s",
        f"the rope's next state is not finite even at 1/{2**HALVINGS} of the step",
        "the last good state is kept; shorten the step or check the scene",
    )
