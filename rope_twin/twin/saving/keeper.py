"""Saves a running twin every so often: the worker takes the state, a thread writes it."""

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
class SavingHealth:
    """What is safe by now."""

    path: Path
    saved_s: float | None = None  # twin time of the newest saved state; None: none of this run yet
    trouble: str = ""  # why the newest attempt failed; empty while all is well


class Keeper:
    """A twin for the pacer: stepped as before, saved on the way.

    Taking a state costs the worker a copy of the arrays; it never waits for the disk. A state that
    the solver could not leave does not replace the one before.
    """

    def __init__(self, twin: Twin | Recovery, path: Path, every_s: float) -> None:
        """`every_s`: twin time between two states.

        Raises:
            StateError: no file can be made there.
        """
        check_place(path, f"saved state {path}")
        self._twin = twin
        self._every_ns = round(every_s * 1e9)
        self._due_ns = twin.time_ns + self._every_ns
        self._kept_step = twin.steps  # the newest step that a file has or needs
        self._failed = False
        self._writer = ThreadPoolExecutor(max_workers=1, thread_name_prefix="twin-state")
        self._writer.submit(int)  # its thread begins now, not within a slot
        self._writing: Future[None] | None = None
        self._health = SavingHealth(path)

    @property
    def step_ns(self) -> int:
        """Length of a step [ns]."""
        return self._twin.step_ns

    def advance(self, steps: int) -> None:
        """Step on, and take the state if it is time. Raises SolverError."""
        try:
            self._twin.advance(steps)
        except SolverError:
            self._failed = True
            raise
        written = self._writing is None or self._writing.done()
        if written and self._twin.time_ns >= self._due_ns:
            self._due_ns = self._twin.time_ns + self._every_ns
            self._take()

    def snapshot(self) -> Snapshot:
        """A frozen copy of the present."""
        return self._twin.snapshot()

    def health(self) -> SavingHealth:
        """What is safe by now; may be called from any thread."""
        return self._health

    def finish(self) -> None:
        """Save the present, and return when that is done; while nobody steps."""
        if not self._failed and self._twin.steps != self._kept_step:
            self._take()
        self.finish_writing()

    def finish_writing(self) -> None:
        """Return when what was taken is on the disk, or is known to have failed."""
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
            self._health = SavingHealth(path, self._health.saved_s, str(error))
        except Exception as error:
            # A defect must show in the diagnostics, not end in a thread that nobody asks.
            _log.exception("the state was not saved")
            trouble = f"the state was not saved: {type(error).__name__}: {error}"
            self._health = SavingHealth(path, self._health.saved_s, trouble)
        else:
            self._health = SavingHealth(path, state.about.time_s)
