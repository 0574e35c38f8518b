"""State of a twin: everything that changes while it runs, named part by part.

`Twin.save`, `Twin.restore` and checkpoints use it. What the scene or the caller gives (models,
limits, scratch arrays, locks) is no part of it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from rope_twin.twin.accuracy.level import MeshState
    from rope_twin.twin.inputs import InputState
    from rope_twin.twin.motion.boundary_conditions import MotionState
    from rope_twin.twin.run_record import RecordState

FORMAT = 9  # of a saved state; raise it with every change of what a state holds


class ClockState(NamedTuple):
    """Twin time, completed steps and computing time."""

    time_ns: int
    steps: int
    computing_s: float


class Clock:
    """Twin time in whole nanoseconds, so that paced and unpaced runs see the same numbers."""

    def __init__(self) -> None:
        self.time_ns = 0  # since the start
        self.steps = 0  # completed
        self.computing_s = 0.0  # spent on them

    def advance(self, steps: int, step_ns: int) -> None:
        """Count completed steps of this length [ns]."""
        self.steps += steps
        self.time_ns += steps * step_ns

    def state(self) -> ClockState:
        """Return a copy of its numbers."""
        return ClockState(self.time_ns, self.steps, self.computing_s)

    def restore(self, state: ClockState) -> None:
        """Continue from these numbers."""
        self.time_ns, self.steps, self.computing_s = state


@dataclass(frozen=True)
class TwinState:
    """State of a twin between two steps.

    It shares arrays and inputs with the twin; `saved_state.take` copies it.
    """

    clock: ClockState
    mesh: MeshState
    ropes: dict[str, Any]  # arrays of all ropes, connections and further winches by name
    motion: MotionState
    inputs: InputState
    record: RecordState
    monitors: dict[str, Any]  # states of the monitors by name; a run may lack some
