"""Rows of the diagnostics on a paced run itself: messages, publishing, saving, rung, clocks."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

from rope_twin.messages import Level, Status
from rope_twin.run.summary import RunSummary
from rope_twin.twin.accuracy.overload import TwinOverloadProtection
from rope_twin.twin.saving.autosave import SavingStatus
from rope_twin.twin.snapshot import Snapshot

RUN_ROW = "simulation: run"
MOTION_ROW = "simulation: input heave"
CLOCK_STEP_S = 0.05  # the system clock may differ from the steady one by this


def run_row(summary: RunSummary) -> Status:
    """The figures of the run; its values are those of a RunSummary."""
    return Status(RUN_ROW, Level.OK, "the run so far", summary.as_values())


def publishing_row(error: str, lost_snapshots: int) -> Status:
    """Whether what was computed was published; error: why it no longer is."""
    values = {"lost snapshots": str(lost_snapshots)}
    name = "simulation: publishing"
    if error:
        return Status(name, Level.ERROR, error, values)
    if lost_snapshots:
        message = f"{lost_snapshots} snapshots were computed but not published in time"
        return Status(name, Level.WARN, message, values)
    return Status(name, Level.OK, "every snapshot was published", values)


class Clocks(NamedTuple):
    """Both clocks, read one right after the other: what happens between counts as a step."""

    ros_ns: int
    steady_ns: int


def clock_row(moved_s: float) -> Status:
    """By how much ROS time has moved against the steady clock since the start."""
    values = {"ROS time against steady time [s]": f"{moved_s:.3f}"}
    name = "simulation: clocks"
    if abs(moved_s) > CLOCK_STEP_S:
        message = (
            f"ROS time has moved by {moved_s:+.3f} s against the steady clock since the start: "
            "stamps of live inputs no longer fit; deactivate and activate to set a new epoch"
        )
        return Status(name, Level.WARN, message, values)
    return Status(name, Level.OK, "ROS time and the steady clock agree", values)


def with_hint(rows: Sequence[Status], hint: Callable[[], str]) -> list[Status]:
    """Return the rows, that of a ship motion of which nothing came with a hint on its topic."""
    return [
        replace(row, message=f"{row.message}; {hint()}")
        if row.name == MOTION_ROW and row.level is Level.ERROR and row.values["accepted"] == "0"
        else row
        for row in rows
    ]


def saving_row(saving: SavingStatus) -> Status:
    """Of a run that saves its state: which it saved last."""
    saved = "never" if saving.saved_s is None else f"{saving.saved_s:.2f}"
    values = {"file": str(saving.path), "newest saved state, twin time [s]": saved}
    name = "simulation: saving"
    if saving.trouble:
        return Status(name, Level.ERROR, saving.trouble, values)
    if saving.saved_s is None:
        return Status(name, Level.OK, "no state of this run saved yet", values)
    return Status(name, Level.OK, f"saved at {saved} s", values)


def rung_row(ladder: TwinOverloadProtection, last: Snapshot) -> Status:
    """Of a run with a ladder: elements and step that it goes with, and why."""
    number, count = ladder.place
    values = {
        "rung": f"{number} of {count}",
        "elements": str(len(last.element_tension_n)),
        "step [s]": f"{ladder.level.step_s:g}",
        "changes": str(ladder.changes),
        "load": f"{ladder.load:.2f}",
    }
    name = "simulation: rung"
    if number == 1:
        return Status(name, Level.OK, f"on the scene's own rung: {ladder.words()}", values)
    message = f"on rung {number} of {count}, {ladder.words()}: {ladder.reason}"
    return Status(name, Level.WARN, message, values)
