"""What a paced run uses of a core, and what of it was asked for."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass


@dataclass(frozen=True)
class CoreShare:
    """Processor time over real time since the first slot [% of one core]."""

    steps_pct: float  # of the thread that steps the rope
    publishing_pct: float  # of the thread that makes the messages and hands them to the middleware
    process_pct: float  # of the whole process: with its nodes, recorder and viewer in it, these too
    asked_pct: float | None = None  # by --budget
    calibrated_pct: float | None = None  # what was measured for it before the run began

    def figures(self) -> dict[str, float | None]:
        """By name."""
        return dataclasses.asdict(self)

    def words(self) -> str:
        """A line for people."""
        asked = "" if self.asked_pct is None else f" (asked: {self.asked_pct:g} %)"
        return (
            f"of one core {self.steps_pct:.3g} % to step, {self.publishing_pct:.2g} % to publish, "
            f"{self.process_pct:.3g} % with all else in the process{asked}"
        )
