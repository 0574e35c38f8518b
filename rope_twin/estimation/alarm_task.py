"""Alarms beside a real-time twin: the watch as a task of the worker, after the learner.

It shares the learner's thread, lanes and measured series. An alarm freezes learning until it is
acknowledged; each change of it (found, named) is kept for the twin's threads.
"""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, Any

import numpy as np

from rope_twin.errors import SolverError
from rope_twin.estimation.alarms import Alarm, FaultWatch
from rope_twin.estimation.worker import Begin, Input
from rope_twin.messages.status import Level, Status
from rope_twin.scene.schema import Scene

if TYPE_CHECKING:
    from rope_twin.estimation.estimator import Estimator
    from rope_twin.estimation.learner import Learner

ROW = "simulation: faults"
KEPT_CHANGES = 100


class AlarmTask:
    """Watches the lift that a learner learns; register it in the learner's worker."""

    def __init__(self, scene: Scene, learner: Learner) -> None:
        """Begin once the learner has an estimator."""
        self._scene, self._learner = scene, learner
        self._estimator: Estimator | None = None
        self._watch: FaultWatch | None = None
        self._blocks = 0
        self._stands = ""
        self.newest: Alarm | None = None  # the alarm that is on; any thread may read it
        self.changes: deque[str] = deque(maxlen=KEPT_CHANGES)  # in words, not yet published
        self._raised: list[Alarm] = []  # newest judgement of each alarm of the run

    def take(self, inputs: Input) -> None:
        """Begin again after the learner did; it keeps the measured series for both."""
        if isinstance(inputs, Begin):
            self._estimator, self._stands = None, ""

    def tare(self) -> None:
        """Forget what the tests know of the load pin's zero. Call it in the worker."""
        if self._watch is not None:
            self._watch.tare()

    def acknowledge(self) -> None:
        """End the alarm, if one is on: learning goes on. Call it in the worker."""
        if self._watch is not None and self.newest is not None:
            self._watch.acknowledge()
            self._learner.freeze("")
            self.newest = None
            self.changes.append("")

    def work(self) -> bool:
        """Test what has come since; there is never more to do at once."""
        estimator = self._learner.estimator
        if estimator is None or self._stands:
            return False
        if estimator is not self._estimator:
            made = FaultWatch(self._scene, estimator)
            if self._watch is not None:
                made.keep_rules(self._watch, estimator.state_s)
            self._estimator, self._watch = estimator, made
            self._blocks = len(estimator.results)
        watch = self._watch
        assert watch is not None
        try:
            if len(estimator.results) > self._blocks:
                self._blocks = len(estimator.results)
                watch.learned(estimator)
            alarm = watch.advance(estimator.model.lift.known_until_s(0.0))
        except SolverError as error:
            self._stands = f"the rope of the tests cannot be stepped ({error})"
            return False
        if alarm is not None and alarm != self.newest:
            self._raise(alarm)
        return False

    def _raise(self, alarm: Alarm) -> None:
        """Keep a new alarm, or a newer judgement of the one that is on, and freeze learning."""
        if self.newest is None:
            self._raised.append(alarm)
        else:
            self._raised[-1] = alarm
        self.newest = alarm
        self.changes.append(alarm.words)
        self._learner.freeze(alarm.words)

    @property
    def state(self) -> str:
        """Return what the watch does, in words."""
        if self._stands:
            return self._stands
        if self.newest is not None:
            return self.newest.words
        watch = self._watch
        if watch is None or not np.isfinite(watch.now_s):
            return "waiting for two learned minutes"
        return f"no fault, tested until {watch.now_s:.0f} s"

    def row(self) -> Status:
        """Return the row of the diagnostics."""
        bad = self.newest is not None or bool(self._stands)
        alarm = self.newest
        level = Level.ERROR if alarm is not None else Level.WARN if bad else Level.OK
        values = {} if alarm is None else {k: str(one) for k, one in _as_json(alarm).items()}
        return Status(ROW, level, self.state, values)

    def as_json(self) -> list[dict[str, Any]]:
        """Return all alarms of the run for `--json`, each with its newest judgement."""
        return [_as_json(one) for one in self._raised]


def _as_json(alarm: Alarm) -> dict[str, Any]:
    return {
        "causes": " or ".join(alarm.causes),
        "begun_s": round(alarm.begun_s, 2),
        "found_s": round(alarm.found_s, 2),
        "ratio": round(alarm.ratio, 1),
        "named_after_s": alarm.named_after_s,
    }
