"""Watch on a lift: tests of its innovations second by second, alarms, and their causes.

The tests compare the measurement with what figures of at least a minute ago predict, so that a
fault is not learned before it is found: the reference moves on by a block once the estimator has
learned the next one. Plain rules come first. An alarm freezes learning until it is acknowledged; it
names the cause 5, 20 and 60 s after it was raised, or the two that remain.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from rope_twin.core.state import Floats
from rope_twin.errors import InputError, SolverError
from rope_twin.estimation.causes import (
    BEFORE_ALARM_S,
    PAYLOAD,
    PIN,
    SHIFTS,
    SLOW_DRIFT,
    STUCK_ENCODER,
    STUCK_PIN,
    STUCK_SENSOR,
    UNKNOWN,
    FaultLanes,
    cause_of,
    name_causes,
    signatures_of,
)
from rope_twin.estimation.estimator import BLOCK_S, BURN_IN_S, MIN_USED, SPARE_HEAVE_S, Estimator
from rope_twin.estimation.fault_tests import (
    FaultTests,
    LostPayload,
    RepeatedSample,
    StuckEncoder,
    SuspectedFault,
)
from rope_twin.estimation.figures import (
    HEAVE_DELAY,
    HEAVE_SHIFTS,
    INDEX,
    factors_of,
    static_tops_n,
)
from rope_twin.estimation.hanging import hanging_of
from rope_twin.estimation.lift_model import Prediction
from rope_twin.estimation.measured_lift import MEAN_S
from rope_twin.scene.rigging import winches_by_name
from rope_twin.scene.schema import Scene, Winch
from rope_twin.twin.ensemble.fleet import FleetState
from rope_twin.twin.residual_tests import SlowDrift

THRESHOLD = 42.0  # of ℓ: one false alarm a week, by `python -m validation --faults --clean-hours`
NIS_THRESHOLD = 9.0  # standard deviations: for what no signature describes
RULES_S = 3.0  # after an alarm a lost payload is still found by its plain rule
ONSET_S = 5.0  # by so much a plain rule may be later than the onset of the best ratio
LEAD = 6.0  # likelihood gain by which a cause must lead to be named alone
NAMED_S = 5.0, 20.0, 60.0  # after the alarm
SETTLED_BLOCKS = 2  # learned before the watch begins
SUSPECTED = 19.0  # a ratio that keeps the reference
CAPACITY_S = 5 * BLOCK_S + 10.0  # a reference of two blocks ago that is kept for two, and naming
HEAVE_AHEAD_S = 1.0  # of heave beyond the tested means, at least
# what figures and heave leave out: friction, water; its correlation time
MODEL_ERROR, MODEL_ERROR_S = 0.18, 3.0  # over the white noise of a mean
LOADS = "submerged_weight", "tension_bias"  # figures that a slow drift is learned as
DRIFT_SPREAD = 0.001  # of the tension: least spread of a block's offset


@dataclass(frozen=True)
class Alarm:
    """A fault that was found."""

    found_s: float
    begun_s: float
    ratio: float  # largest ℓ, or standard deviations of the NIS; 0: found by a plain rule
    causes: tuple[str, ...]  # the named one, or the two that remain
    named_after_s: float = 0.0  # seconds of the newest judgement

    @property
    def words(self) -> str:
        """Return the alarm in one sentence."""
        return f"{' or '.join(self.causes)}, since {self.begun_s:.0f} s"

    def as_json(self) -> dict[str, Any]:
        """Return the alarm in the types of JSON."""
        return {
            "causes": " or ".join(self.causes),
            "begun_s": round(self.begun_s, 2),
            "found_s": round(self.found_s, 2),
            "ratio": round(self.ratio, 1),
            "named_after_s": self.named_after_s,
        }


@dataclass
class _Reference:
    """Figures that the tests compare with, frozen at a time."""

    theta: Floats
    covariance: Floats
    state: FleetState  # BURN_IN_S before
    at_s: float
    colour: Floats  # autocovariance of the coloured error [N²], (pins, pins, means of CAPACITY_S)
    white_n: Floats  # (pins,)
    heave_ahead_s: float  # heave that its delay asks for


def largest_deceleration(winch: Winch | None) -> float:
    """Return the largest deceleration of the line [m/s²], by an emergency stop if it has one."""
    if winch is None:
        return 0.0
    stop, limit = winch.emergency_stop, winch.acceleration_limit_m_per_s2
    return limit if stop is None else max(limit, stop.deceleration_m_per_s2)


class FaultWatch:
    """Tests of one lift, beside its estimator."""

    def __init__(self, scene: Scene, estimator: Estimator, threshold: float = THRESHOLD) -> None:
        """Begin before anything is learned.

        scene: of the estimator's model; threshold: of the ratio for an alarm; inf: none.

        Raises:
            SceneError: the scene has no static equilibrium.
        """
        self._threshold = threshold
        self._scene, self._model, self._lift = scene, estimator.model, estimator.model.lift
        static_n, hanging = sum(static_tops_n(scene)), hanging_of(scene)
        self._payload_n = hanging.weight_n
        suspended_m = sum(length_m for *_, length_m in hanging.ropes)
        self._rope_n_per_m = (static_n - self._payload_n) / suspended_m
        self.alarm: Alarm | None = None
        self.now_s = -np.inf  # end of the newest means, missing ones included
        self.tested_s = -np.inf  # end of the newest ones that were tested
        self.tests: FaultTests | None = None
        self._reference: _Reference | None = None
        self._next: _Reference | None = None
        self._prediction: Prediction | None = None
        self._lanes: FaultLanes | None = None
        self._lost = LostPayload()
        winches, resolution_m = winches_by_name(scene), scene.measured.line_out.resolution_m
        # of load pin and line counter of each winch, the motion sensor after the first load pin
        self._rules: list[RepeatedSample | StuckEncoder] = []
        self._stuck: list[str] = []
        for name in ("", *self._model.winches):
            limit = largest_deceleration(winches.get(name) if name else scene.winch)
            self._rules += [RepeatedSample(), StuckEncoder(limit, resolution_m)]
            self._stuck += [cause_of(name, STUCK_PIN), cause_of(name, STUCK_ENCODER)]
        self._rules.insert(1, RepeatedSample())
        self._stuck.insert(1, STUCK_SENSOR)
        self._newest_s = [-np.inf for _ in self._rules]
        self._drift = SlowDrift(DRIFT_SPREAD * static_n)
        self._before: Floats | None = None  # figures before the last block
        self._blocks = 0

    def branch(self, estimator: Estimator) -> FaultWatch:
        """Return an independent watch with all that this one knows, on a copy of the estimator."""
        watch = copy.copy(self)
        watch._model, watch._lift = estimator.model, estimator.model.lift
        for name in ("tests", "_lost", "_rules", "_drift", "_newest_s"):
            setattr(watch, name, copy.deepcopy(getattr(self, name)))
        if (prediction := self._prediction) is not None:
            watch._prediction = replace(
                prediction,
                tension_n=list(prediction.tension_n),
                line_out_m=list(prediction.line_out_m),
            )
        return watch

    def keep_rules(self, before: FaultWatch, begin_s: float) -> None:
        """Go on with the plain rules of the watch before, so that a sensor stuck then is found.

        begin_s: time at which this watch begins [s]; rules with later samples are left.
        """
        if max(before._newest_s) <= begin_s + 1.0:
            self._rules, self._newest_s = before._rules, before._newest_s

    @property
    def frozen(self) -> bool:
        """Return whether learning waits for an alarm to be acknowledged."""
        return self.alarm is not None

    def acknowledge(self) -> None:
        """End an alarm: learning goes on, and the watch begins again after two blocks."""
        self.alarm = None
        self._begin_again()

    def tare(self) -> None:
        """Begin again after two blocks, since the load pin has another zero; an alarm stays on."""
        self._begin_again()

    def _begin_again(self) -> None:
        self._reference = self._next = self.tests = self._before = None
        self._blocks, self.tested_s = 0, -np.inf
        self._drift.restart()

    def learned(self, estimator: Estimator) -> None:
        """Take the figures after a block as the next reference."""
        self._blocks += 1
        if self.alarm is not None:
            return
        assert estimator.noise is not None
        noise, count = estimator.noise, round(CAPACITY_S / MEAN_S)
        end_s = estimator.block_begin_s
        colour = noise.coloured(estimator.autocovariances(count, end_s, estimated=False))
        lag_s = MEAN_S * np.arange(count)
        model_n = MODEL_ERROR * noise.nominal_white_n
        variance_n2 = np.diag(model_n**2)[..., None]
        colour = colour + variance_n2 * np.exp(-lag_s / MODEL_ERROR_S)
        late_s = float(estimator.theta[INDEX[HEAVE_DELAY]]) + max(HEAVE_SHIFTS.values())
        ahead_s = max(HEAVE_AHEAD_S, estimator.heave_ahead_s, late_s + SPARE_HEAVE_S)
        new = _Reference(
            estimator.theta.copy(), estimator.belief.covariance.copy(), estimator.state, end_s,
            colour, noise.white_n, ahead_s,
        )  # fmt: skip
        if self._blocks >= SETTLED_BLOCKS:
            if not self._suspects(end_s):
                self._reference = self._next or new
                self._restart(self._reference)
            self._next = new
        self._judge_drift(estimator, end_s)

    def _suspects(self, end_s: float) -> bool:
        """Return whether a suspicion keeps the reference, as newer figures may have its fault.

        Only while another block and the last naming fit into the tests. end_s: of the last block.
        """
        if self.tests is None or self._reference is None:
            return False
        if end_s + 2.0 * BLOCK_S > self._reference.at_s + CAPACITY_S:
            return False
        return bool(self.tests.ratios().max() > SUSPECTED)

    def _restart(self, reference: _Reference) -> None:
        """Begin the tests at a reference."""
        names = self._model.names
        self.tests = FaultTests(
            signatures_of(self._model.winches), reference.colour, reference.white_n,
            np.pad(reference.covariance, (0, len(SHIFTS))),  # nothing is open about a shift
            (*names, *SHIFTS), begin_s=reference.at_s, interval_s=MEAN_S,
        )  # fmt: skip
        begin_s = reference.at_s - BURN_IN_S
        self._prediction = self._model.begin(reference.theta, reference.state, begin_s)

    def _judge_drift(self, estimator: Estimator, end_s: float) -> None:
        """Give the block's mean offset from weight and zero of the scene to the CUSUM."""
        innovation, theta_before = estimator.innovation, self._before
        self._before = estimator.theta.copy()
        if innovation is None or theta_before is None:
            return
        unlearned_n = innovation.residual_n.copy()
        for k, name in enumerate(estimator.prior.names):
            if name.rpartition("/")[2] in LOADS:  # had they not been learned
                unlearned_n += innovation.columns[name] * (
                    theta_before[k] - estimator.prior.mean[k]
                )
        offset = unlearned_n.reshape(len(self._model.pins), -1).sum(axis=0)
        offset = offset[np.isfinite(offset)]
        if len(offset) < MIN_USED * len(innovation.time_s):
            return
        drift = self._drift.take(float(offset.mean()))
        if drift is not None and self.alarm is None:
            begun_s = end_s - (drift.begun + 1) * BLOCK_S
            self.alarm = Alarm(end_s, begun_s, 0.0, (SLOW_DRIFT,))

    def advance(self, until_s: float) -> Alarm | None:
        """Test all data up to a time, a second at a time; return the alarm that is on.

        Raises:
            SolverError: the rope with the present figures cannot be stepped.
        """
        self._plain_rules(until_s)
        tests, reference = self.tests, self._reference
        if tests is None or reference is None or self._prediction is None:
            return self.alarm
        known_s = self._lift.known_until_s(reference.heave_ahead_s)
        end_s = min(until_s, known_s, reference.at_s + CAPACITY_S)
        means = round(1.0 / MEAN_S)
        first_s = tests.now_s
        if end_s < first_s + 1.0 - 1e-6:  # -inf: no tension is left
            return self.alarm
        count = means * int(end_s - first_s + 1e-6)
        end_s = first_s + MEAN_S * count
        self._model.extend(self._prediction, end_s)
        residual, columns, predicted = self._innovations(reference, first_s, end_s)
        for k in range(0, count, means):
            second = slice(k, k + means)
            tests.extend(residual[second], columns[second])
            now_s = tests.now_s
            if now_s <= self.now_s:
                continue  # the older part of the window of a new reference
            self.now_s = now_s
            if np.isfinite(residual[second]).any():
                self.tested_s = now_s
            expected_n = predicted[second].sum(axis=1)
            self._lost_payload(now_s, residual[second].sum(axis=1) + expected_n, expected_n)
            self._judge(now_s)
        return self.alarm

    def _innovations(
        self, reference: _Reference, first_s: float, end_s: float
    ) -> tuple[Floats, Floats, Floats]:
        """Return residual, columns and predicted tension of the means of an interval.

        They are (m, pins), (m, pins, figures) and (m, pins).
        """
        assert self._prediction is not None
        from_s = max(reference.at_s, first_s - MEAN_S)
        self._prediction = self._model.trimmed(self._prediction, from_s)
        predicted, J, shifts = self._model.with_shifts(self._prediction, from_s)
        measured, _ = self._lift.means_of_pins(first_s, end_s)
        measured = self._model.in_open_water(self._prediction, first_s, measured)
        measured = self._model.without_slack(self._prediction, first_s, measured)
        pins = len(self._model.pins)
        of_pins, columns = predicted.reshape(pins, -1).T, np.hstack([J, shifts])
        columns = columns.reshape(pins, -1, columns.shape[1]).swapaxes(0, 1)
        new = slice(len(of_pins) - len(measured) // pins, None)
        return measured.reshape(pins, -1).T - of_pins[new], columns[new], of_pins[new]

    def _judge(self, now_s: float) -> None:
        """Raise an alarm by the ratios or the NIS, and name its cause when that is due."""
        assert self.tests is not None
        if self.alarm is None:
            if float(self.tests.ratios().max()) > self._threshold:
                suspicions = self.tests.suspicions()
                first_two = tuple(name for name, _ in _pairs(suspicions)[:2])  # too early for one
                self.alarm = Alarm(now_s, suspicions[0].onset_s, suspicions[0].ratio, first_two)
            elif (nis := self.tests.nis()) > NIS_THRESHOLD and self._threshold < np.inf:
                self.alarm = Alarm(now_s, now_s - 1.0, nis, (UNKNOWN,))
            return
        if self.alarm.ratio == 0.0:
            return  # a plain rule has named it
        due = [delay_s for delay_s in NAMED_S if now_s - self.alarm.found_s >= delay_s]
        if due and due[-1] > self.alarm.named_after_s:
            self._name(due[-1])

    def _name(self, after_s: float) -> None:
        """Name the cause of the alarm by all that was measured since."""
        tests, reference, alarm = self.tests, self._reference, self.alarm
        assert tests is not None
        assert reference is not None
        assert alarm is not None
        if self._lanes is None:
            self._lanes = FaultLanes(self._scene, self._model)
        suspicions = tests.suspicions()
        onset_s = suspicions[0].onset_s if suspicions else alarm.begun_s
        onsets = [onset_s, *(alarm.found_s - before_s for before_s in BEFORE_ALARM_S)]
        responses: tuple[list[str], Floats, Floats, Floats] = [], *(np.zeros(0),) * 3
        try:
            state = self._model.state_at(
                reference.theta, reference.state, reference.at_s - BURN_IN_S, reference.at_s
            )
            responses = self._lanes.responses(
                reference.theta, state, reference.at_s, onsets, tests.now_s
            )
        except SolverError:
            responses = [], *(np.zeros(0),) * 3  # the causes of first order remain
        causes = _named(name_causes(tests, responses))
        begun_s = onset_s if onset_s <= alarm.found_s else alarm.begun_s
        self.alarm = replace(alarm, begun_s=begun_s, causes=causes, named_after_s=after_s)

    def _lost_payload(self, now_s: float, measured: Floats, predicted: Floats) -> None:
        reference = self._reference
        assert reference is not None
        factor = float(factors_of(reference.theta)["submerged_weight"])
        payload_n = factor * self._payload_n
        if payload_n <= 0.0:
            return
        assert self._prediction is not None
        rope_n = self._rope_n_per_m * float(self._prediction.line_out_m[-1][:, -1].sum())
        for k, (measured_n, predicted_n) in enumerate(zip(measured, predicted, strict=True)):
            at_s = now_s - MEAN_S * (len(measured) - k - 0.5)
            begun_s = self._lost.take(
                at_s, float(measured_n), float(predicted_n), rope_n, payload_n
            )
            fresh = self.alarm is None or (
                self.alarm.ratio > 0.0 and now_s - self.alarm.found_s < RULES_S
            )
            if begun_s is not None and fresh:  # a snag may unload the rope as deeply, later
                found_s = now_s if self.alarm is None else self.alarm.found_s
                suspicions = [] if self.tests is None else self.tests.suspicions()
                onset_s = suspicions[0].onset_s if suspicions else begun_s
                begun_s = min(begun_s, onset_s) if begun_s - onset_s < ONSET_S else begun_s
                self.alarm = Alarm(found_s, begun_s, 0.0, (PAYLOAD,))

    def _plain_rules(self, until_s: float) -> None:
        """Give new samples to the rules on stuck sensors."""
        lift = self._lift
        sensors = []
        for rope in lift.ropes:
            counter = rope.counter if np.isfinite(rope.counter.newest_s) else rope.line_out
            sensors += [rope.tension, counter]
        sensors.insert(1, lift.sensor if np.isfinite(lift.sensor.newest_s) else lift.heave)
        for k, series in enumerate(sensors):
            table = series.table
            first = np.searchsorted(table[:, 0], self._newest_s[k], side="right")
            last = np.searchsorted(table[:, 0], until_s, side="right")
            for row in table[first:last]:
                time_s, value = float(row[0]), float(row[1])
                rule = self._rules[k]
                rule.take(time_s, value)
                self._newest_s[k] = time_s
                if rule.stuck and (self.alarm is None or self.alarm.ratio > 0.0):
                    found_s = time_s if self.alarm is None else self.alarm.found_s
                    self.alarm = Alarm(found_s, rule.since_s, 0.0, (self._stuck[k],))


def _pairs(suspicions: list[SuspectedFault]) -> list[tuple[str, float]]:
    """Return the causes of suspicions and their ratios, each once."""
    gains: dict[str, float] = {}
    for suspicion in suspicions:
        gains.setdefault(suspicion.cause, suspicion.ratio)
    return list(gains.items())


def _named(gains: list[tuple[str, float]]) -> tuple[str, ...]:
    """Return the cause that leads by LEAD, or the two that remain.

    Raises:
        InputError: nothing is suspected.
    """
    if not gains:
        raise InputError("fault", "nothing is suspected", "name causes after an alarm")
    if len(gains) == 1 or gains[0][1] - gains[1][1] > LEAD:
        return (gains[0][0],)
    first, second = gains[0][0], gains[1][0]
    (kind, _, winch), (other_kind, _, other_winch) = first.partition(" ("), second.partition(" (")
    if {kind, other_kind} <= PIN and winch == other_winch:
        return (first,) if len(gains) < 3 or gains[0][1] - gains[2][1] > LEAD else (first, second)
    return first, second
