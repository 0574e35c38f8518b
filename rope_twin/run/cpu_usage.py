"""CPU usage of a real-time run, and the budget that was asked for."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass


@dataclass(frozen=True)
class CpuUsage:
    """CPU time over real time since the first real-time cycle [% of one core]."""

    steps_pct: float  # solver thread
    publishing_pct: float  # thread that encodes messages and hands them to the middleware
    process_pct: float  # whole process, with all nodes, recorder and viewer that run in it
    asked_pct: float | None = None  # budget set by --budget
    calibrated_pct: float | None = None  # measured for that budget before the run

    def figures(self) -> dict[str, float | None]:
        """Return the fields by name."""
        return dataclasses.asdict(self)

    def words(self) -> str:
        """Return a line of text."""
        budget = "" if self.asked_pct is None else f" (budget: {self.asked_pct:g} %)"
        return (
            f"CPU usage of one core: {self.steps_pct:.3g} % solver, {self.publishing_pct:.2g} % "
            f"publishing, {self.process_pct:.3g} % whole process{budget}"
        )
