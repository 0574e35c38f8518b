"""Periodic saving of a running twin: the stepping thread copies the state, another writes it."""

from __future__ import annotations

import logging
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from rope_twin.errors import SolverError, StateError
from rope_twin.twin.recovery import Recovery
from rope_twin.twin.saving.saved_state import SavedState
from rope_twin.twin.saving.state_file import check_place
from rope_twin.twin.snapshot import Snapshot
from rope_twin.twin.twin import Twin

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class SavingStatus:
    """Status of saving."""

    path: Path
    saved_s: float | None = None  # twin time of the newest saved state; None: none in this run
    trouble: str = ""  # why the newest attempt failed; empty if it succeeded


class AutoSave:
    """A twin for the pacer that saves its state periodically while it is stepped.

    Saving costs the stepping thread a copy of the arrays; it never waits for the disk. A state from
    which a step failed does not replace the previous file.
    """

    def __init__(self, twin: Twin | Recovery, path: Path, every_s: float) -> None:
        """Save to `path` each time that `every_s` of twin time have passed.

        Raises:
            StateError: the file cannot be created.
        """
        check_place(path, f"saved state {path}")
        self._twin = twin
        self._every_ns = round(every_s * 1e9)
        self._due_ns = twin.time_ns + self._every_ns
        self._kept_step = twin.steps  # the newest step that is saved or needs no saving
        self._failed = False
        self._requested = False  # save at the end of the next cycle
        self._writer = ThreadPoolExecutor(max_workers=1, thread_name_prefix="twin-state")
        self._writer.submit(int)  # start its thread here, not within a cycle
        self._writing: Future[None] | None = None
        self._health = SavingStatus(path)

    @property
    def step_ns(self) -> int:
        """Length of a step [ns]."""
        return self._twin.step_ns

    def advance(self, steps: int) -> None:
        """Advance by this number of steps, and save the state if it is due.

        Raises:
            SolverError: a step failed.
        """
        try:
            self._twin.advance(steps)
        except SolverError:
            self._failed = True
            raise
        written = self._writing is None or self._writing.done()
        if written and (self._requested or self._twin.time_ns >= self._due_ns):
            self._requested = False
            self._due_ns = self._twin.time_ns + self._every_ns
            self._take()

    def snapshot(self) -> Snapshot:
        """Return a frozen copy of the present."""
        return self._twin.snapshot()

    def request(self) -> None:
        """Save the state at the end of the next cycle; may be called from any thread."""
        self._requested = True

    def health(self) -> SavingStatus:
        """Return the status of saving; may be called from any thread."""
        return self._health

    def finish(self) -> None:
        """Save the present and return when it is written; call it while no thread steps."""
        if not self._failed and self._twin.steps != self._kept_step:
            self._take()
        self.finish_writing()

    def finish_writing(self) -> None:
        """Wait until the last state is on the disk, or has failed to be written."""
        if self._writing is not None:
            self._writing.result()

    def _take(self) -> None:
        self._kept_step = self._twin.steps
        self._writing = self._writer.submit(self._write, self._twin.capture())

    def _write(self, state: SavedState) -> None:
        path = self._health.path
        try:
            state.write(path)
        except StateError as error:
            self._health = SavingStatus(path, self._health.saved_s, str(error))
        except Exception as error:
            # A defect must appear in the diagnostics, not be lost with the thread's result.
            _log.exception("the state was not saved")
            trouble = f"the state was not saved: {type(error).__name__}: {error}"
            self._health = SavingStatus(path, self._health.saved_s, trouble)
        else:
            self._health = SavingStatus(path, state.about.time_s)
