"""Error message for a rope that the solver cannot advance."""

from __future__ import annotations

from rope_twin.core.solve.halving import HALVINGS
from rope_twin.errors import phrase


def no_next_state(step: int, time_s: float) -> str:
    """Return the message for a failed step; step: its number, time_s: its start [s]."""
    return phrase(
        f"step {step} at {time_s:.2f} s",
        f"the rope's next state is not finite even at 1/{2**HALVINGS} of the step",
        "the last good state is kept; shorten the step or check the scene",
    )
