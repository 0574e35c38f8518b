"""Diagnostics rows of a real-time run: publishing, clocks, saved state, accuracy level."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

from rope_twin.messages import Level, Status
from rope_twin.messages.status import counted
from rope_twin.run.summary import RunSummary
from rope_twin.twin.accuracy.overload import TwinOverloadProtection
from rope_twin.twin.saving.autosave import SavingStatus
from rope_twin.twin.snapshot import Snapshot

RUN_ROW = "simulation: run"
MOTION_ROW = "simulation: input heave"
CLOCK_STEP_S = 0.05  # tolerance of ROS time against the steady clock


def run_row(summary: RunSummary) -> Status:
    """Return the row with the run summary; its key values are the fields of a RunSummary."""
    return Status(RUN_ROW, Level.OK, "run statistics", summary.as_values())


def publishing_row(error: str, lost_snapshots: int) -> Status:
    """Return the row on publishing; `error`: why a topic is no longer published."""
    values = {"lost snapshots": str(lost_snapshots)}
    name = "simulation: publishing"
    if error:
        return Status(name, Level.ERROR, error, values)
    if lost_snapshots:
        message = f"{counted(lost_snapshots, 'snapshot')} computed but not published in time"
        return Status(name, Level.WARN, message, values)
    return Status(name, Level.OK, "all snapshots published", values)


class Clocks(NamedTuple):
    """ROS time and steady time, read one right after the other."""

    ros_ns: int
    steady_ns: int


def clock_row(moved_s: float) -> Status:
    """Return the row on the drift of ROS time against the steady clock since the start."""
    values = {"ROS time against steady time [s]": f"{moved_s:.3f}"}
    name = "simulation: clocks"
    if abs(moved_s) > CLOCK_STEP_S:
        message = (
            f"ROS time has shifted by {moved_s:+.3f} s against the steady clock since the start: "
            "stamps of live inputs are wrong by as much; deactivate and activate to set a new epoch"
        )
        return Status(name, Level.WARN, message, values)
    return Status(name, Level.OK, "ROS time and the steady clock agree", values)


def with_hint(rows: Sequence[Status], hint: Callable[[], str]) -> list[Status]:
    """Return the rows with a hint added to that of the ship motion if no sample was received."""
    return [
        replace(row, message=f"{row.message}; {hint()}")
        if row.name == MOTION_ROW and row.level is Level.ERROR and row.values["accepted"] == "0"
        else row
        for row in rows
    ]


def saving_row(saving: SavingStatus) -> Status:
    """Return the row on the last saved state of a run that saves its state."""
    saved = "never" if saving.saved_s is None else f"{saving.saved_s:.2f}"
    values = {"file": str(saving.path), "last saved state, simulation time [s]": saved}
    name = "simulation: saving"
    if saving.trouble:
        return Status(name, Level.ERROR, saving.trouble, values)
    if saving.saved_s is None:
        return Status(name, Level.OK, "no state saved yet", values)
    return Status(name, Level.OK, f"state saved at {saved} s", values)


def rung_row(ladder: TwinOverloadProtection, last: Snapshot) -> Status:
    """Return the row on the accuracy level: elements, time step, and why it was degraded."""
    number, count = ladder.place
    values = {
        "level": f"{number} of {count}",
        "elements": str(len(last.element_tension_n)),
        "step [s]": f"{ladder.level.step_s:g}",
        "changes": str(ladder.changes),
        "load": f"{ladder.load:.2f}",
    }
    name = "simulation: accuracy level"
    if number == 1:
        return Status(name, Level.OK, f"full accuracy level: {ladder.words()}", values)
    message = f"degraded to accuracy level {number} of {count}, {ladder.words()}: {ladder.reason}"
    return Status(name, Level.WARN, message, values)
