"""Recovery from failed steps: the ropes return to a good state and continue with live inputs.

A step fails when the solver finds no finite next state, or raises any other error. The twin then
continues at the present time, so that its clock and inputs are unchanged and only the ropes are of
an earlier instant:

1. from the state before the failed step, without the motion that was prescribed in advance and
   without a current profile accepted since the newest checkpoint;
2. if it fails again within SETTLED_NS, from the newest checkpoint, then from older ones: the
   hang-off is blended from its earlier position into the live motion, as after a gap in the
   samples.

MAX_FAILURES within FAILURE_WINDOW_NS of twin time end the run. All of this depends only on the
twin's state and time, so a replay with the same inputs repeats it.
"""

from __future__ import annotations

import logging
import math
from collections import deque
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.step import HALVINGS
from rope_twin.errors import InputError, SolverError, phrase
from rope_twin.scene.error_bound import AccuracyLevel
from rope_twin.twin.snapshot import CutSnapshot, Snapshot, amended
from rope_twin.twin.snapshot_builder import Extremes
from rope_twin.twin.state import SavedState

if TYPE_CHECKING:
    from rope_twin.twin.twin import Twin

CHECKPOINT_NS = 1_000_000_000  # twin time between two checkpoints
CHECKPOINTS = 3  # number of checkpoints kept
SETTLED_NS = 2_000_000_000  # twin time without a failure after which a recovery is complete
MAX_FAILURES = 5
FAILURE_WINDOW_NS = 60_000_000_000
MAX_FAILURE_FILES = 10  # per run: repeated failures must not fill the disk


_log = logging.getLogger(__name__)


class Checkpoint(NamedTuple):
    """Copy in memory of all that the steps of a twin change."""

    time_ns: int
    level: AccuracyLevel
    cut: CutSnapshot | None
    boundary: rows.Boundary  # hang-offs and line out, (ropes, MOTIONS)
    arrays: dict[str, rows.Floats]
    effects: tuple[Any, ...]
    extremes: tuple[Extremes, Extremes]  # since the start and since the newest snapshot


class Recovery:
    """A twin for the pacer, or for an offline run, that continues after a failed step."""

    def __init__(self, twin: Twin) -> None:
        self._twin = twin
        self._checkpoints: deque[Checkpoint] = deque([twin.checkpoint()], maxlen=CHECKPOINTS)
        self._due_ns = _next_due(twin.time_ns)
        self._failed_ns: deque[int] = deque()  # twin times of failures within the window
        self._level = 0  # checkpoints that the newest recovery went back; 0: to the last step
        self._first = ""  # reason of the first failure of the present series
        self._folder: Path | None = None  # failure folder while writing is suspended
        self._files = 0  # number of failure files
        self.count = 0  # failed steps recovered from
        self.newest_ns = 0  # twin time of the newest recovery
        self.reason = ""  # message of the newest recovery

    @property
    def step_ns(self) -> int:
        """Length of a step [ns]."""
        return self._twin.step_ns

    @property
    def time_ns(self) -> int:
        """Twin time [ns]."""
        return self._twin.time_ns

    @property
    def steps(self) -> int:
        """Number of completed steps."""
        return self._twin.steps

    def capture(self) -> SavedState:
        """Return in memory the state that `Twin.save` writes."""
        return self._twin.capture()

    def advance(self, steps: int) -> None:
        """Advance by this number of steps; recover from steps that fail.

        Raises:
            InputError: the number is negative.
            SolverError: MAX_FAILURES steps failed within FAILURE_WINDOW_NS.
        """
        twin = self._twin
        end = twin.steps + steps
        while True:
            try:
                twin.advance(end - twin.steps)
                if not math.isfinite(twin.top_tension_n):
                    raise SolverError(_not_finite(twin.time_ns))
            except InputError:
                raise
            except Exception as error:  # whatever a defect raises, the ropes are restored
                self._recover(error)
            else:
                break
        self._take_checkpoint()

    def snapshot(self) -> Snapshot:
        """Return a finite, frozen copy of the present with the count of recoveries.

        Raises:
            SolverError: as `advance`.
        """
        snapshot = self._twin.snapshot()
        while not _is_finite(snapshot):
            self._recover(SolverError(_not_finite(self._twin.time_ns)), level=1)
            snapshot = self._twin.snapshot()
        if not self.count:
            return snapshot
        ago_s = (snapshot.stamp_ns - self.newest_ns) * 1e-9
        solver = snapshot.solver._replace(
            recoveries=self.count, recovered_ago_s=ago_s, recovery=self.reason
        )
        return amended(snapshot, solver=solver)

    def _take_checkpoint(self) -> None:
        """Store a checkpoint if one is due, or if the stored ones do not fit the ropes."""
        twin, newest = self._twin, self._checkpoints[-1]
        if self._folder is not None and not self._is_unsettled():
            self._files += 1
            twin.failure_folder = self._folder if self._files < MAX_FAILURE_FILES else None
            self._folder = None
        changed = newest.level is not twin.level or newest.cut is not twin.cut
        if changed:
            self._checkpoints.clear()
        elif twin.time_ns < self._due_ns or self._is_unsettled():
            return
        self._due_ns = _next_due(twin.time_ns)
        self._checkpoints.append(twin.checkpoint())

    def _is_unsettled(self) -> bool:
        """Return whether the newest failure is so recent that the next step may fail too."""
        return bool(self._failed_ns) and self._twin.time_ns < self._failed_ns[-1] + SETTLED_NS

    def _recover(self, error: Exception, level: int = 0) -> None:
        """Restore the ropes after a failure, from an earlier checkpoint if a recovery failed."""
        twin = self._twin
        now_ns = twin.time_ns
        unsettled = self._is_unsettled()
        if unsettled:
            level = max(level, self._level + 1)
        if not twin.is_finite:
            level = max(level, 1)
        self._failed_ns.append(now_ns)
        while self._failed_ns[0] <= now_ns - FAILURE_WINDOW_NS:
            self._failed_ns.popleft()
        reason = _reason(error)
        if not unsettled:
            self._first = reason
        if len(self._failed_ns) >= MAX_FAILURES:
            within = f"within {FAILURE_WINDOW_NS * 1e-9:g} s of twin time"
            message = f"the twin gives up after {len(self._failed_ns)} failed steps {within}"
            raise SolverError(
                f"{message}; the first since it last went well: {self._first}."
            ) from error
        self._level, self.newest_ns, self.count = level, now_ns, self.count + 1
        self.reason = f"{reason}; {self._go_back(level)}"
        twin.invalidate_error(f"a step failed at {now_ns * 1e-9:.2f} s")
        if twin.failure_folder is not None:  # the first failure's file is the most useful one
            self._folder, twin.failure_folder = twin.failure_folder, None
        _log.warning("%s", self.reason)

    def _go_back(self, level: int) -> str:
        """Restore the ropes from `level` checkpoints back; return a description."""
        twin, newest = self._twin, self._checkpoints[-1]
        if level == 0:
            reverted = ""
            if twin.revert_current(newest):
                reverted = ", with the current profile of before"
            twin.discard_prescribed()
            return f"it went on from the state before that step{reverted}"
        checkpoint = self._checkpoints[max(0, len(self._checkpoints) - level)]
        if not twin.return_to(checkpoint):
            twin.discard_prescribed()
            return "it went on from the state before that step: no earlier one fits the rope"
        return f"it went on from the rope's state at {checkpoint.time_ns * 1e-9:.2f} s"


def _next_due(time_ns: int) -> int:
    """Return the next multiple of CHECKPOINT_NS, so that a resumed run has the same checkpoints."""
    return (time_ns // CHECKPOINT_NS + 1) * CHECKPOINT_NS


def _reason(error: Exception) -> str:
    """Return the message of a failure without a full stop."""
    if isinstance(error, SolverError):
        return str(error).removesuffix(".")
    return f"a step failed on {type(error).__name__}: {error}".removesuffix(".")


def _not_finite(time_ns: int) -> str:
    problem = f"the state at {time_ns * 1e-9:.2f} s is not finite"
    return phrase("the rope", problem, "its inputs may be impossible")


def _is_finite(snapshot: Snapshot) -> bool:
    """Return whether all published values of ropes and payloads are finite, by sums of them.

    Tensions along a rope follow from its nodes' positions.
    """
    values = [
        snapshot.tension_top_n
        + snapshot.tension_payload_n
        + snapshot.line_out_m
        + snapshot.heave_m,
        snapshot.payout_speed_m_per_s + sum(snapshot.payload_velocity_m_per_s.tolist()),
        float(np.add.reduce(snapshot.node_position_m.ravel())),
    ]
    if snapshot.ropes:
        values += [float(np.add.reduce(rope.node_position_m.ravel())) for rope in snapshot.ropes]
        values += [sum(payload.position_m.tolist()) for payload in snapshot.payloads]
    return all(map(math.isfinite, values))


def step_failure(step: int, time_s: float) -> str:
    """Return the message for a failed step; step: its number, time_s: its start [s]."""
    return phrase(
        f"step {step} at {time_s:.2f} s",
        f"the rope's next state is not finite even at 1/{2**HALVINGS} of the step",
        "the last good state is kept; shorten the step or check the scene",
    )
