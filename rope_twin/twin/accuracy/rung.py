"""One rung of a twin's ladder: a step, and how coarse the rope is."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Rung:
    """What a twin steps with."""

    step_ns: int
    halvings: int = 0  # how often the scene's elements were halved

    @property
    def step_s(self) -> float:
        """The step [s]."""
        return self.step_ns / 1e9
