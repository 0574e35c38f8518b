"""Accuracy level of a twin: time step and mesh coarseness."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Rung:
    """Time step and mesh coarseness of a twin."""

    step_ns: int
    halvings: int = 0  # number of times the scene's element count was halved

    @property
    def step_s(self) -> float:
        """Time step [s]."""
        return self.step_ns / 1e9
