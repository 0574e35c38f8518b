"""Learning beside a real-time twin: what it sees and hears goes to a worker, results come back.

Snapshots are seen in the publishing thread and readings where messages arrive, so the stepping
thread is asked once, for the state to begin from. Results are taken over through the twin's queue
of inputs, which logs them: a replay has the same figures at the same times.

The watch for faults is a task of the same worker, after the learner: it shares the learner's
thread, lanes and measured series. An alarm freezes learning until it is acknowledged; each change
of it (found, named) is kept for the twin's threads.

The `Learner` is the estimator as a task of that worker, with its newest result for the twin's
threads.
"""

from __future__ import annotations

import dataclasses
import time
from collections import deque
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from rope_twin.errors import InputError, RopeTwinError, SolverError, counted
from rope_twin.estimation import report
from rope_twin.estimation.alarms import Alarm, FaultWatch
from rope_twin.estimation.estimator import BURN_IN_S, MIN_USED, SPECTRUM_S, Estimator
from rope_twin.estimation.figures import (
    ROPE_FIGURES,
    Gaussian,
    check_learnable,
    factors_of,
    scene_prior,
    suspended_ropes,
)
from rope_twin.estimation.lift_model import LiftModel
from rope_twin.estimation.measured_lift import MeasuredLift
from rope_twin.estimation.worker import Heave, Input, Motion, Reading, Restart, Worker, WorkerCall
from rope_twin.messages.reports import Level, Status, estimate_status
from rope_twin.quantity import or_nan
from rope_twin.scene.instruments import SHEAVE
from rope_twin.scene.rigging import winches_by_name
from rope_twin.scene.schema import Scene
from rope_twin.twin.ensemble.live_state import live_state
from rope_twin.twin.figures import RAMP_S
from rope_twin.twin.input_queue import InputQueue
from rope_twin.twin.readings import MOTOR, WINCH_SENSORS, Measurement, WinchReadings
from rope_twin.twin.snapshot import Snapshot
from rope_twin.twin.twin import Twin

KEPT_S = SPECTRUM_S + 2.0 * BURN_IN_S  # of measured series
ROW = "simulation: faults"
KEPT_CHANGES = 100
UNTESTED_S = 120.0  # without a tension to test, after which the row of the tests is WARN


@dataclass(frozen=True)
class Estimate:
    """Figures after a block; frozen, for any thread."""

    time_s: float  # twin time of the end of the data
    minutes: int
    tared: bool
    figures: tuple[report.FigureEstimate, ...]
    factors: dict[str, float]  # on the scene's figures, without the current
    at_limit: tuple[str, ...]  # figures at the limit of the prior
    left_out: tuple[str, ...]  # why how much of the block was left out, in words
    belief: Gaussian  # before the next block

    def rows(self) -> list[dict[str, Any]]:
        """Return the rows of estimate/figures."""
        return [dataclasses.asdict(figure) for figure in self.figures]

    def words(self) -> str:
        """Return the figures that are learned, in one sentence."""
        learned = [figure for figure in self.figures if figure.state == report.LEARNED]
        listed = ", ".join(f"{figure.name} {figure.value:.4g} {figure.unit}" for figure in learned)
        head = f"after {self.minutes} min"
        if self.left_out:
            head += f" ({'; '.join(self.left_out)})"
        sentence = f"{head}: {listed or 'no figure is known better than before'}"
        return "; ".join(filter(None, (sentence, report.limit_words(self.at_limit))))


class Learner:
    """Learns from what the worker passes on; `newest` may be read from any thread."""

    def __init__(self, scene: Scene) -> None:
        """Build the estimator's fleet.

        Raises:
            InputError: the scene cannot be learned yet.
            SceneError: it has no static equilibrium.
        """
        check_learnable(scene)
        self._scene = scene
        self._prior = scene_prior(scene)
        self._lift = MeasuredLift(self._prior.pin_noise_n)
        self._model = LiftModel(scene, self._lift)
        self._base = report.base_values(scene)
        self._bias_n = scene.measured.tension.bias
        self.estimator: Estimator | None = None  # also for tasks of the same worker
        self._tared = False
        self._frozen = ""
        self._stands = ""
        self._belief: Gaussian | None = None  # of a run before, to continue from ...
        self._minutes = 0  # ... and the minutes that it was learned from
        self.newest: Estimate | None = None

    def memory(self) -> dict[str, Any]:
        """Return what was learned as JSON types; any thread may ask."""
        newest = self.newest
        belief = self._belief if newest is None else newest.belief
        memory: dict[str, Any] = {"tared": self._tared, "names": list(self._prior.names)}
        if belief is not None:
            memory["mean"], memory["covariance"] = belief.mean.tolist(), belief.covariance.tolist()
            memory["minutes"] = self._minutes if newest is None else newest.minutes
            memory["belief_tared"] = self._tared if newest is None else newest.tared
        return memory

    def restore(self, memory: Mapping[str, Any]) -> None:
        """Continue from what `memory` returned, if it has the same figures, before the start."""
        if memory["names"] != list(self._prior.names):
            return
        if memory["tared"]:
            self._tared, self._prior = True, self._prior.tared()
        if "mean" in memory:
            belief = Gaussian(np.array(memory["mean"]), np.array(memory["covariance"]))
            if memory["tared"] and not memory["belief_tared"]:
                belief = self._prior.with_tare(belief)
            self._belief, self._minutes = belief, int(memory["minutes"])

    @property
    def trouble(self) -> str:
        """Return why nothing is learned at present, or ""."""
        return self._stands or self._frozen

    @property
    def state(self) -> str:
        """Return what the learner does, in words."""
        if self.trouble:
            return self.trouble
        if self.estimator is None:
            return "waiting for the twin"
        if self.newest is None:
            end_s = self.estimator.block_end_s
            if self._minutes:
                known = counted(self._minutes, "learned minute")
                return f"continues from {known}; the next one is learned from at {end_s:.0f} s"
            return f"collecting; the first minute is learned from at {end_s:.0f} s"
        return self.newest.words()

    def freeze(self, reason: str) -> None:
        """Learn no more until `freeze("")`, for a reason in words; call it in the worker."""
        self._frozen = f"frozen: {reason}" if reason else ""

    def tare(self) -> None:
        """Take the load pins' zeros as set with an empty hook; call it in the worker.

        Tension with the zero of before is forgotten.
        """
        self._tared = True
        self._prior = self._prior.tared()
        for rope in self._lift.ropes:
            rope.tension.drop_before(np.nextafter(rope.tension.newest_s, np.inf))
        if self.estimator is not None:
            self.estimator.tare()

    def take(self, inputs: Input) -> None:
        """Take motion, a reading, or a live state to begin from."""
        if isinstance(inputs, Motion):
            self._lift.heave.add(inputs.time_s, inputs.heave_m, inputs.heave_rate_m_per_s)
            lines_m = inputs.line_out_m, *inputs.lines_m
            for rope, line_m in zip(self._lift.ropes, lines_m, strict=True):
                rope.line_out.add(inputs.time_s, line_m)
        elif isinstance(inputs, Reading):
            rope = self._lift.others[inputs.winch] if inputs.winch else self._lift
            rope.tension.add(inputs.time_s, inputs.tension_n - self._bias_n)
            rope.counter.add(inputs.time_s, inputs.line_out_m)
        elif isinstance(inputs, Heave):
            self._lift.sensor.add(*inputs)
        elif isinstance(inputs, Restart):
            self._begin(inputs)

    def _begin(self, begin: Restart) -> None:
        """Begin from a live state; figures that were learned before are the prior."""
        belief = self._belief if self.estimator is None else self.estimator.belief
        results = [] if self.estimator is None else self.estimator.results
        state = self._model.begin_live(begin.live)
        self._lift.drop_before(begin.live.time_ns * 1e-9 - 1.0)
        estimator = Estimator(self._model, self._prior, state, begin.live.time_ns * 1e-9)
        if belief is not None:
            estimator.belief, estimator.theta, estimator.results = (
                belief,
                belief.mean.copy(),
                results,
            )
        self.estimator, self._stands = estimator, ""

    def work(self) -> bool:
        """Step the estimator on; return whether it did something."""
        estimator = self.estimator
        if estimator is None:
            return False
        if self.trouble:  # it begins again from a live state, not from the series
            self._lift.drop_before(self._lift.heave.newest_s - KEPT_S)
            return False
        before = len(estimator.results)
        try:
            worked = estimator.step()
        except SolverError as error:
            self._stands = f"the rope with the learned figures cannot be stepped ({error})"
            return False
        if len(estimator.results) > before:
            self._publish(estimator)
            self._lift.drop_before(estimator.state_s - KEPT_S)
        return worked

    def _publish(self, estimator: Estimator) -> None:
        last = estimator.results[-1]
        advice: dict[str, str] = {}
        if not self._tared:
            action = report.tare_action(estimator.prior, last.posterior)
            advice = report.best_actions(last.posterior, [action], estimator.prior.names)
        factors = factors_of(last.posterior.mean)
        known = [name for name in ROPE_FIGURES if self._base[name] and name != "current"]
        self.newest = Estimate(
            time_s=last.end_s,
            minutes=self._minutes + sum(result.used >= MIN_USED for result in estimator.results),
            tared=self._tared,
            figures=report.estimates(
                self._base, estimator.prior, last.posterior, advice, last.at_limit
            ),
            factors={name: float(factors[name]) for name in known},
            at_limit=last.at_limit,
            left_out=(*report.left_out_words(last), *report.not_measured(self._lift)),
            belief=estimator.belief,
        )

    def factors_to_apply(self) -> dict[str, float]:
        """Return the factors on the scene's figures to take over.

        Raises:
            InputError: nothing was learned yet, or a figure is at the limit of its prior.
        """
        newest = self.newest
        if newest is None:
            right = "wait for two minutes of tension, heave and line out"
            raise InputError("learned figures", "nothing was learned yet", right)
        if newest.at_limit:
            problem = f"{', '.join(newest.at_limit)} is at the limit of its prior"
            raise InputError("learned figures", problem, "check scene, units and signs")
        return newest.factors


class AlarmTask:
    """Watches the lift that a learner learns; register it in the learner's worker."""

    def __init__(self, scene: Scene, learner: Learner) -> None:
        """Begin once the learner has an estimator."""
        self._scene, self._learner = scene, learner
        self._estimator: Estimator | None = None
        self._watch: FaultWatch | None = None
        self._blocks = 0
        self._stands = ""
        self._heard_s = -np.inf  # newest motion
        self.newest: Alarm | None = None  # the alarm that is on; any thread may read it
        self.changes: deque[str] = deque(maxlen=KEPT_CHANGES)  # in words, not yet published
        self._raised: list[Alarm] = []  # newest judgement of each alarm of the run

    def take(self, inputs: Input) -> None:
        """Begin again after the learner did; it keeps the measured series for both."""
        if isinstance(inputs, Motion):
            self._heard_s = inputs.time_s
        if isinstance(inputs, Restart):
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
            successor = FaultWatch(self._scene, estimator)
            if self._watch is not None:
                successor.keep_rules(self._watch, estimator.state_s)
            successor.alarm = self.newest
            self._estimator, self._watch = estimator, successor
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

    def memory(self) -> dict[str, Any] | None:
        """Return the alarm that is on as JSON types; any thread may ask."""
        alarm = self.newest
        return None if alarm is None else dataclasses.asdict(alarm)

    def restore(self, memory: Mapping[str, Any] | None) -> None:
        """Raise the alarm that was on when `memory` was saved."""
        if memory is not None:
            self._raise(Alarm(**{**memory, "causes": tuple(memory["causes"])}))

    @property
    def state(self) -> str:
        """Return what the watch does, in words."""
        if self._stands:
            return self._stands
        if self.newest is not None:
            return self.newest.words
        watch = self._watch
        if watch is None or not np.isfinite(watch.tested_s):
            return "waiting for two learned minutes"
        if self._is_behind:
            return f"no fault until {watch.tested_s:.0f} s, and nothing is compared since"
        return f"no fault, tested until {watch.tested_s:.0f} s"

    @property
    def _is_behind(self) -> bool:
        """Return whether the tests have begun, and nothing was tested for long."""
        watch = self._watch
        tested_s = -np.inf if watch is None else watch.tested_s
        return bool(np.isfinite(tested_s) and self._heard_s - tested_s > UNTESTED_S)

    def row(self) -> Status:
        """Return the row of the diagnostics."""
        bad = self.newest is not None or bool(self._stands) or self._is_behind
        alarm = self.newest
        level = Level.ERROR if alarm is not None else Level.WARN if bad else Level.OK
        values = {} if alarm is None else {k: str(value) for k, value in alarm.as_json().items()}
        return Status(ROW, level, self.state, values)

    def as_json(self) -> list[dict[str, Any]]:
        """Return all alarms of the run for `--json`, each with its newest judgement."""
        return [alarm.as_json() for alarm in self._raised]


REMINDED_S = 30.0  # a remark lowers the quality index for a minute


class LiveLearning:
    """Worker with a learner, and the doors between them and a real-time twin."""

    def __init__(self, scene: Scene, inputs: InputQueue) -> None:
        """Build the learner of a scene; inputs: of the twin that takes figures over.

        Raises:
            InputError: the scene cannot be learned yet.
            SceneError: it has no static equilibrium.
        """
        self.learner = Learner(scene)
        self.alarms = AlarmTask(scene, self.learner)
        self.worker = Worker(self.learner, self.alarms)
        self._inputs = inputs
        self._source = WINCH_SENSORS if scene.measured.tension.at == SHEAVE else MOTOR
        further = {scene.ropes[r].from_: scene.ropes[r].name for r in suspended_ropes(scene)[1:]}
        self._further = tuple(further.values())  # ropes of further winches
        # winch of a reading by its name
        self._winches = dict.fromkeys(("", *winches_by_name(scene), scene.ropes[0].name), "")
        self._winches |= {name: winch for winch, rope in further.items() for name in (winch, rope)}
        lines = [scene.ropes[r] for r in suspended_ropes(scene)]
        self._checks = {  # by source and winch
            (source, winch): WinchReadings(scene, line, source)
            for source in {WINCH_SENSORS, self._source}
            for winch, line in zip(("", *further), lines, strict=True)
        }
        self._taken: Estimate | None = None
        self._reminded_s = 0.0
        self._seen_ns: int | None = None  # twin time of the newest snapshot
        self._twin: Twin | None = None

    def memory(self) -> dict[str, Any]:
        """Return what was learned, and the alarm that is on, as JSON types."""
        return {"learner": self.learner.memory(), "alarm": self.alarms.memory()}

    def restore(self, memory: Mapping[str, Any]) -> None:
        """Continue from what `memory` returned; call it before the start."""
        self.learner.restore(memory["learner"])
        self.alarms.restore(memory["alarm"])

    def start(self, twin: Twin) -> None:
        """Begin at the twin's next cycle, and work."""
        self._twin = twin
        for readings in self._checks.values():
            readings.invalidate()
        self._inputs.at_next_slot(lambda: self._begin(twin))
        self.worker.start()

    def _begin(self, twin: Twin, *before: WorkerCall) -> None:
        """Begin from the twin's present state, after calls in the worker; the twin steps on."""
        for call in before:
            self.worker.take(call)
        try:
            begin = Restart(live_state(twin))
        except RopeTwinError as error:
            reason = str(error)
            self.worker.take(WorkerCall(lambda: self.learner.freeze(reason)))
            return
        self.worker.take(begin)

    def stop(self) -> None:
        """Stop the thread; what was learned is kept."""
        self.worker.stop()

    def see(self, snapshot: Snapshot) -> None:
        """Pass the motion of the hang-off and the line on."""
        self._seen_ns = snapshot.stamp_ns
        rate = float(snapshot.hang_off_velocity_m_per_s[2])
        lines = {state.name: state.line_out_m for state in snapshot.ropes} if self._further else {}
        lines_m = tuple(lines[name] for name in self._further)
        self.worker.take(
            Motion(snapshot.stamp_ns * 1e-9, snapshot.heave_m, rate, snapshot.line_out_m, lines_m)
        )

    def hear(self, measurement: Measurement) -> None:
        """Pass measured tension and line out of the winches that carry the load on.

        Values and stamps that the twin refuses are left out; all that comes after a stamp far ahead
        would be forgotten with it at a tare.
        """
        source, stamp_ns, rows = measurement
        now_ns = stamp_ns if self._seen_ns is None else self._seen_ns
        for row in rows:
            if (source, self._winches.get(row[0])) not in self._checks:
                continue
            winch = self._winches[row[0]]
            _, line_out, _, tension = self._checks[source, winch].take(stamp_ns, row, now_ns)[0]
            tension_n = tension if source == self._source else None
            if not (tension_n is None and line_out is None):
                self.worker.take(
                    Reading(stamp_ns * 1e-9, or_nan(tension_n), or_nan(line_out), winch)
                )

    def hear_motion(self, stamp_ns: int, heave_m: float) -> None:
        """Pass a sample of the motion sensor on, as it came; the rule on stuck sensors has it."""
        self.worker.take(Heave(stamp_ns * 1e-9, heave_m))

    def take_new(self) -> Estimate | None:
        """Return what was learned since the last call, or None if there is nothing."""
        newest = self.learner.newest
        if newest is self._taken:
            return None
        self._taken = newest
        return newest

    def apply(self) -> tuple[bool, str]:
        """Take the learned figures over by a ramp; return success and text."""
        try:
            factors = self.learner.factors_to_apply()
        except InputError as error:
            return False, str(error)
        refusal = self._inputs.submit_figures(ramp_s=RAMP_S, **factors)
        if refusal:
            return False, refusal
        listed = ", ".join(f"{name} × {value:.4g}" for name, value in factors.items())
        return True, f"taken over in {RAMP_S:g} s: {listed}"

    def tare(self) -> tuple[bool, str]:
        """Report that the load pin was set to zero with an empty hook; return success and text."""
        self.worker.take(WorkerCall(self.learner.tare))
        self.worker.take(WorkerCall(self.alarms.tare))
        return True, "the load pin's bias is learned from its zero of now"

    def acknowledge(self) -> tuple[bool, str]:
        """End the alarm that is on; return success and text.

        Learning goes on from the twin's state of then: nothing measured under the fault is learned.
        """
        alarm = self.alarms.newest
        if alarm is None:
            return False, "there is no alarm to acknowledge"
        twin, ask = self._twin, WorkerCall(self.alarms.acknowledge)
        if twin is None:
            self.worker.take(ask)
        else:
            self._inputs.at_next_slot(lambda: self._begin(twin, ask))
        return True, f"acknowledged: {alarm.words}; learning goes on"

    def new_alarms(self) -> Iterator[str]:
        """Yield each change of the alarm since the last call, in words; "": acknowledged.

        While an alarm is on the quality index has it as a remark on the inputs, logged for replay.
        """
        while self.alarms.changes:
            change = self.alarms.changes.popleft()
            if change:
                self._inputs.take_remark(f"fault alarm: {change}")
            yield change
        alarm, at_s = self.alarms.newest, time.monotonic()
        if alarm is not None and at_s - self._reminded_s >= REMINDED_S:
            self._reminded_s = at_s
            self._inputs.take_remark(f"fault alarm: {alarm.words}")

    def fault_row(self) -> Status:
        """Return the row of the diagnostics on faults; without its task nothing is tested."""
        failure = self.worker.trouble(self.alarms) or self.worker.trouble(self.learner)
        if failure and self.alarms.newest is None:
            return Status(ROW, Level.WARN, f"nothing is tested any more: {failure}")
        return self.alarms.row()

    def row(self, granted_s: float) -> Status:
        """Return the row of the diagnostics; granted_s: real time of the run [s]."""
        newest = self.learner.newest
        trouble = self.worker.trouble(self.learner) or self.learner.trouble
        share = 100.0 * self.worker.processor_s / granted_s if granted_s > 0.0 else 0.0
        rows = [] if newest is None else newest.rows()
        minutes = 0 if newest is None else newest.minutes
        return estimate_status(self.learner.state, trouble, rows, minutes, share)
