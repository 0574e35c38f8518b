"""Quality index of the twin: how far each of its results may be relied on now, and why not.

After the assurance of digital twins by functional element (DNV-RP-A204): each element (top tension,
payload depth, slack, fatigue, forecast) supports a decision, and has an index of 0 to 1, the
smallest of six components: input, numerics, discretisation, validity, residual and history. It is
never a mean: one failed component is not compensated by five good ones. The index falls at once and
rises to its components over RISE_S. Without a measurement to compare with, or without a known
discretisation error, it is UNPROVEN at most. An element that does not exist in a run (fatigue that
is not counted, a forecast that does not run) has no index.

It is evaluated every EVALUATED_NS of twin time from a snapshot, and has no effect on the twin. The
thresholds are those of the project (docs/reference/quality_index.md). Real-time performance is left
out (`simulation: pacing` has it), as a replay must have the same index.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np

from rope_twin.twin.readings import MOTOR_TENSION, PAYLOAD_DEPTH, WINCH_MEASURED
from rope_twin.twin.residuals import COVERAGE
from rope_twin.twin.snapshot import (
    BORDER,
    CAUSES,
    DISCRETISATION,
    RESIDUAL,
    UNPROVEN,
    VALIDITY,
    ForecastScore,
    InputHealth,
    Quality,
    Residual,
    Snapshot,
    amended,
    disagrees,
)
from rope_twin.twin.validity import LINE_FOLLOWING, Finding, falling

TENSION, DEPTH, SLACK, FATIGUE, FORECAST = ELEMENTS = (
    "top_tension", "payload_depth", "slack", "fatigue", "forecast",
)  # fmt: skip

RISE_S = 60.0  # from 0 to 1
EVALUATED_NS = 200_000_000  # of twin time between two evaluations
WARNING_VALUE = 0.6  # maximum while an input or a measurement has a warning
MAX_REFUSED_FRACTION = 0.5  # fraction of rejected samples in 60 s at which an input's value is 0
RECENT_S = 60.0  # period of the counts of refused samples
FAILED_NS = 60_000_000_000  # duration of 0 for numerics after a failed step
BUILD_UP = "build-up"  # first word of the reason during the build-up
BUILD_UP_VALUE = 0.5  # while the ship's motion or the forces of the water build up
MAX_ERROR_RATIO = 3.0  # ratio of the discretisation error to its tolerance at which the value is 0
# tolerances of the discretisation error: RMS bound of the top tension [% of its standard deviation]
# by the convergence study, and half the error interval [% of the static tension]
TOLERANCES_PCT = {TENSION: (5.0, 2.0), DEPTH: (10.0, 4.0), SLACK: (5.0, 2.0), FATIGUE: (3.0, 1.0)}
RMS_GOOD, BIAS_GOOD, RESIDUAL_BAD = 1.5, 1.96, 5.0  # residual over its standard uncertainty
MIN_COMPARED, COMPARED_S = 10, 10.0  # readings compared, and the newest one's age at most
DISAGREEMENT_VALUE = 0.5  # maximum while a residual disagrees
VARIANCE_GOOD, VARIANCE_BAD = 4.0, 8.0  # normal deviate of the variance of 5 min: from 1 to that
MIN_SCATTER = 0.2  # over the instrument's own uncertainty: a smaller scatter proves nothing
HISTORY_HOURS, MIN_HISTORY_S = 24, 600.0  # period of comparisons, and their minimum duration
HISTORY_GOOD, HISTORY_BAD = 0.95, 0.8  # fraction of the time in agreement
FAULTS_S, SAME_FAULT_S = 3600.0, 10.0  # period of the count, minimum interval of two faults
FAULT_PENALTY, MIN_FAULTS_VALUE = 0.1, 0.5  # reduction for each fault but one, and minimum
FORECAST_LATE_S, INPUTS_LATE_S = (3.0, 10.0), (5.0, 15.0)  # age of a forecast, and of its inputs
COVERED, COVERED_BAD = 0.9, 0.5  # fraction of truths in the bands: nominal, and of value 0
FACTOR_GOOD, FACTOR_BAD = 1.5, 3.0  # on the members' spread, for the nominal coverage

# input groups of measurements: they judge the twin and do not drive it
_TENSIONS, _DEPTHS, _LENGTHS = "top_tension_n", "payload_depth_m", "line_out_m"
_WORDS = {_TENSIONS: "top tension", _DEPTHS: "payload depth", _LENGTHS: "line out"}
_SENSORS = WINCH_MEASURED, MOTOR_TENSION, PAYLOAD_DEPTH
_JUDGED_BY = dict.fromkeys(ELEMENTS, _TENSIONS) | {DEPTH: _DEPTHS}
_COMMANDS_ONLY = ("cut",)  # a rejected cut does not reduce the quality


class Component(NamedTuple):
    """Value of a component, 0 to 1, and the reason of its limit; None: unknown."""

    value: float | None
    reason: str = ""


_GOOD, _UNKNOWN = Component(1.0), Component(None)


class ElementIndex:
    """Index of one element over time."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.used = False  # whether it was evaluated yet
        self.index, self.cause, self.reason = 0.0, VALIDITY, ""
        self.components: tuple[float | None, ...] = (None,) * len(CAUSES)
        self._settled = False  # whether the start-up is over
        self._faults: deque[tuple[float, str]] = deque()  # of the last FAULTS_S: time and reason
        self._faulty_s = -math.inf  # when one was last seen
        self.lowest, self.lowest_at_s, self.lowest_reason = 1.0, -1.0, ""

    def take(
        self, parts: tuple[Component, ...], elapsed_s: float, now_s: float, building_up: bool
    ) -> None:
        """Update by the components, in the order of CAUSES.

        elapsed_s: since the last evaluation [s].
        """
        if not building_up:
            parts = (*parts[:-1], self._with_faults(parts, now_s))
        values = [_ceiling(cause, part) for cause, part in zip(CAUSES, parts, strict=True)]
        limiting = min(range(len(values)), key=values.__getitem__)
        target, reason = values[limiting], parts[limiting].reason
        if not self.used or target <= self.index:
            self.index, self.cause, self.reason = target, CAUSES[limiting], reason
        else:
            self.index = min(target, self.index + elapsed_s / RISE_S)
            if self.index == target:
                self.cause, self.reason = CAUSES[limiting], reason
        self.used, self.components = True, tuple(part.value for part in parts)
        self._settled = self._settled or (self.index == target and not building_up)
        if self._settled and (self.lowest_at_s < 0.0 or self.index < self.lowest):
            self.lowest, self.lowest_at_s, self.lowest_reason = self.index, now_s, self.reason

    def _with_faults(self, parts: tuple[Component, ...], now_s: float) -> Component:
        """Count the faults of the last hour, and return the component of history with them.

        A fault is a time in which a component other than discretisation and history is at most
        WARNING_VALUE; faults within SAME_FAULT_S of each other count as one.
        """
        *present, history = parts
        known = [part for cause, part in zip(CAUSES, present, strict=False)
                 if cause != DISCRETISATION and part.value is not None]  # fmt: skip
        worst = min(known, key=lambda part: part.value)  # type: ignore[arg-type, return-value]
        if worst.value is not None and worst.value <= WARNING_VALUE:
            if now_s - self._faulty_s > SAME_FAULT_S:
                self._faults.append((now_s, worst.reason))
            self._faulty_s = now_s
        while self._faults and self._faults[0][0] < now_s - FAULTS_S:
            self._faults.popleft()
        if len(self._faults) < 2:
            return history
        at_s, reason = self._faults[-1]
        count = len(self._faults)
        value = max(MIN_FAULTS_VALUE, 1.0 - FAULT_PENALTY * (count - 1))
        text = f"{count} faults in the last hour, the last one at {at_s:.0f} s: {reason}"
        return _worst((history, Component(value, text)))

    def deactivate(self) -> None:
        """Have no index until the next components are taken."""
        self.used = False

    @property
    def result(self) -> Quality:
        """Return the index for a snapshot; during the start-up the lowest is the present one."""
        known = self.lowest_at_s >= 0.0
        lowest = (self.lowest, self.lowest_at_s, self.lowest_reason)
        return Quality(
            self.name, self.index, self.cause, self.reason, self.components,
            *(lowest if known else (self.index, 0.0, self.reason)),
        )  # fmt: skip


def _ceiling(cause: str, part: Component) -> float:
    """Return the maximum of the index by one component."""
    if part.value is not None:
        return part.value
    return UNPROVEN if cause in (RESIDUAL, DISCRETISATION) else 1.0


class QualityIndex:
    """Quality index of all elements; its state belongs to a saved state."""

    def __init__(self) -> None:
        self._elements = tuple(ElementIndex(name) for name in ELEMENTS)
        self._at_ns = -1  # last evaluation
        self._failed_ns = -FAILED_NS
        self._unconverged = 0  # substeps at the last evaluation
        self._agreed = np.zeros((2, HISTORY_HOURS, 3))  # hour, seconds compared, seconds in accord

    def fail(self, now_ns: int) -> None:
        """Record a failed step after which the run continues."""
        self._failed_ns = now_ns
        self._at_ns -= EVALUATED_NS  # the next snapshot evaluates it

    def judge(self, snapshot: Snapshot, outside: Iterable[Finding] = ()) -> Snapshot:
        """Return the snapshot with the index of each element, evaluated if that is due.

        outside: findings outside the model's range now; read only if an evaluation is due.
        """
        if self._at_ns < 0 or snapshot.stamp_ns - self._at_ns >= EVALUATED_NS:
            elapsed_s = 0.0 if self._at_ns < 0 else (snapshot.stamp_ns - self._at_ns) * 1e-9
            self._at_ns = snapshot.stamp_ns
            self._evaluate(snapshot, elapsed_s, validity_of(snapshot, outside))
        return amended(
            snapshot, quality=tuple(element.result for element in self._elements if element.used)
        )

    def _evaluate(self, snapshot: Snapshot, elapsed_s: float, validity: Component) -> None:
        inputs, numerics = inputs_of(snapshot), self._numerics(snapshot)
        damages = snapshot.fatigue, *(rope.fatigue for rope in snapshot.ropes)
        has_fatigue = any(damage is not None for damage in damages)
        building_up = snapshot.motion_ramp < 1.0
        histories = {
            quantity: self._history(k, quantity, snapshot, elapsed_s)
            for k, quantity in enumerate((_TENSIONS, _DEPTHS))
        }
        for element in self._elements:
            name = element.name
            if name == FATIGUE and not has_fatigue:
                continue
            score = snapshot.forecast_score
            if name == FORECAST and score is None:
                element.deactivate()
                continue
            if name == FORECAST and score is not None:
                late, calibration = lateness_of(score, snapshot.time_s), calibration_of(score)
                # The calibration covers the errors of its own numerics and mesh.
                parts = (_worst((inputs, late)), _GOOD, _GOOD, validity, calibration, _UNKNOWN)
            else:
                parts = (
                    inputs, numerics, discretisation_of(name, snapshot), validity,
                    residual_of(name, snapshot), histories[_JUDGED_BY[name]],
                )  # fmt: skip
            element.take(parts, elapsed_s, snapshot.time_s, building_up)

    def _numerics(self, snapshot: Snapshot) -> Component:
        """Return the component of convergence and failed steps."""
        count = snapshot.solver.unconverged_substeps
        has_new, self._unconverged = count > self._unconverged, count
        if snapshot.stamp_ns - self._failed_ns < FAILED_NS:
            return Component(0.0, f"a step failed at {self._failed_ns * 1e-9:.2f} s")
        if has_new or snapshot.not_converged:
            return Component(0.0, "a step did not converge")
        return _GOOD

    def _history(
        self, number: int, quantity: str, snapshot: Snapshot, elapsed_s: float
    ) -> Component:
        """Count the time in agreement with measurements, and return its component."""
        of_quantity = [one for one in snapshot.residuals if one.quantity == quantity]
        compared = [residual for residual in of_quantity if _compares(residual, snapshot)]
        bins, hour = self._agreed[number], int(snapshot.time_s // 3600.0)
        if compared and elapsed_s > 0.0:
            row = bins[hour % HISTORY_HOURS]
            if row[0] != hour:
                row[:] = hour, 0.0, 0.0
            row[1] += elapsed_s
            row[2] += elapsed_s if not any(map(disagrees, compared)) else 0.0
        recent = bins[bins[:, 0] > hour - HISTORY_HOURS]
        compared_s = float(recent[:, 1].sum())
        if compared_s < MIN_HISTORY_S:
            return Component(None, "too little was compared with measurements")
        fraction = float(recent[:, 2].sum()) / compared_s
        value = 1.0 - falling(fraction, HISTORY_BAD, HISTORY_GOOD)
        text = f"{_WORDS[quantity]} agreed with its measurement for {fraction:.0%} of the last 24 h"
        return Component(value, text)


def inputs_of(snapshot: Snapshot) -> Component:
    """Return the component of the inputs that drive the twin: the worst of them."""
    is_followed = any(name.startswith(LINE_FOLLOWING) for name in snapshot.inputs)
    comparing = _SENSORS[1:] if is_followed else _SENSORS  # a line that is followed drives the twin
    parts = [
        input_of("inputs" if name == BORDER else name.replace("_", " "), health)
        for name, health in snapshot.inputs.items()
        if not name.startswith(comparing) and name not in _COMMANDS_ONLY
    ]
    if snapshot.winch_at_limit:
        parts.append(Component(WARNING_VALUE, f"winch: {snapshot.winch_at_limit}"))
    return _worst(parts)


def input_of(name: str, health: InputHealth) -> Component:
    """Return the component of one input, in accord with its row of the diagnostics.

    0: it has a fault or is stale (ERROR); WARNING_VALUE at most: it has a warning, or samples were
    rejected in the last 60 s (WARN), less the larger their fraction.
    """
    if health.fault or health.stale:
        return Component(0.0, f"{name}: {health.fault or health.note or 'no sample is fresh'}")
    if name == "current" and health.note and health.note != health.refusal:
        return Component(WARNING_VALUE, f"{name}: {health.note}")
    if not health.recently_refused:
        return Component(WARNING_VALUE, f"{name}: {health.warning}") if health.warning else _GOOD
    refused, accepted = health.recently_refused, float(health.accepted)
    if health.interval_s:
        accepted = min(accepted, RECENT_S / health.interval_s)
    fraction = refused / (refused + accepted)
    text = f"{name}: samples refused in the last 60 s; last: {health.refusal.removesuffix('.')}"
    return Component(WARNING_VALUE * falling(fraction, 0.0, MAX_REFUSED_FRACTION), text)


def discretisation_of(element: str, snapshot: Snapshot) -> Component:
    """Return the component of the discretisation error: its bound against the tolerance.

    The bound is that of the error interval where a run has one, else of the convergence study; both
    are of the top tension, and the dynamic motion of the payload is as far off as its tension.
    """
    by_study, by_interval = TOLERANCES_PCT[element]
    static_n = snapshot.strength[0].static_n if snapshot.strength else None
    static_n = static_n or snapshot.tension_top_n
    if snapshot.error_interval is not None and static_n > 0.0:
        error_pct, tolerance = 100.0 * snapshot.error_interval.bound_n / static_n, by_interval
        text = f"discretisation error ±{error_pct:.2g} % of the static tension"
    elif not math.isnan(snapshot.study_error.rms_pct):
        error_pct, tolerance = snapshot.study_error.rms_pct, by_study
        text = f"discretisation error {error_pct:.2g} % of the standard deviation"
    else:
        return Component(None, f"discretisation error {snapshot.study_error.words}")
    value = falling(error_pct, tolerance, MAX_ERROR_RATIO * tolerance)
    return Component(value, f"{text}, tolerance {tolerance:g} %")


def validity_of(snapshot: Snapshot, outside: Iterable[Finding] = ()) -> Component:
    """Return the component of the model's validity now; outside: findings outside its range."""
    parts = [
        Component(0.0, f"MBL of '{rope.name}' exceeded: a real rope would have parted")
        for rope in snapshot.strength
        if rope.utilisation >= 1.0
    ]
    if snapshot.motion_ramp < 1.0:
        text = f"{BUILD_UP}: {min(snapshot.motion_ramp, 0.99):.0%} of the ship motion applied"
        parts.append(Component(BUILD_UP_VALUE, text))
    if any(factor != 1.0 for factor in snapshot.fluid_factors):
        text = "the forces of the water are not applied in full"
        parts.append(Component(BUILD_UP_VALUE, text))
    return _worst((*parts, *(Component(*finding) for finding in outside)))


def residual_of(element: str, snapshot: Snapshot) -> Component:
    """Return the component of measured less computed values, or None without a measurement."""
    quantity = _JUDGED_BY[element]
    compared = [residual for residual in snapshot.residuals if residual.quantity == quantity]
    parts = [_residual(residual) for residual in compared if _compares(residual, snapshot)]
    sensors = tuple({residual.sensors for residual in compared})
    known = [part for part in parts if part.value is not None]
    if element == DEPTH:  # a wrong line out makes the depth wrong, a right one does not prove it
        lengths = [residual for residual in snapshot.residuals if residual.quantity == _LENGTHS]
        length = _worst(
            _residual(residual) for residual in lengths if _compares(residual, snapshot)
        )
        if length.value is not None and length.value < UNPROVEN:
            known.append(length)
    for name, health in snapshot.inputs.items():
        if not name.startswith(sensors) or not (known or parts):
            continue
        sensor = input_of(name.replace("_", " "), health)
        if sensor.value == 0.0:
            return Component(None, sensor.reason)  # no reliable measurement to compare with
        if sensor is not _GOOD:
            known.append(sensor)
    if known:
        return _worst(known)
    if parts:
        return parts[0]
    groups = (PAYLOAD_DEPTH,) if element == DEPTH else (WINCH_MEASURED, MOTOR_TENSION)
    refusals = [health.refusal for name, health in snapshot.inputs.items()
                if name.startswith(groups) and health.recently_refused]  # fmt: skip
    missing = f"no measured {_WORDS[quantity]} to compare with"
    return Component(None, refusals[0].rstrip(".") if refusals else missing)


def _compares(residual: Residual, snapshot: Snapshot) -> bool:
    """Return whether a comparison has enough readings, and a recent one."""
    wait_s = max(COMPARED_S, 3.0 * residual.span_s / residual.readings)
    return residual.readings >= MIN_COMPARED and snapshot.time_s - residual.at_s <= wait_s


def _residual(residual: Residual) -> Component:
    """Return the component of one comparison, by RMS and mean over their standard uncertainty."""
    label = f"{_WORDS[residual.quantity]} of '{residual.name}'"
    if residual.outside is None and disagrees(residual):
        text = f"{label}: mean residual beyond what the uncertainties of load and load pin explain"
        return Component(DISAGREEMENT_VALUE, text)
    if residual.half_width is None or residual.half_width <= 0.0:
        return Component(None, f"the uncertainty of the measured {label} is not known")
    sigma = residual.half_width / COVERAGE
    rms, bias = residual.rms / sigma, abs(residual.mean) / sigma
    value = min(falling(rms, RMS_GOOD, RESIDUAL_BAD), falling(bias, BIAS_GOOD, RESIDUAL_BAD))
    if disagrees(residual):
        value = min(value, DISAGREEMENT_VALUE)
    text = f"{label}: residual of 60 s {rms:.2g} times its standard uncertainty"
    present = Component(value, f"{text}, mean {bias:.2g} times")
    return _worst((present, *_tested(residual, label)))


def _tested(residual: Residual, label: str) -> Iterator[Component]:
    """Yield the components of the tests over minutes: variance, scatter and slow drift."""
    tests = residual.tests
    if tests is None:
        return
    value = falling(tests.deviate, VARIANCE_GOOD, VARIANCE_BAD)
    text = f"{label}: residual of {tests.span_s / 60.0:.0f} min {math.sqrt(tests.variance):.2g} "
    text += "times its standard uncertainty, more than chance explains"
    yield Component(1.0 - (1.0 - DISAGREEMENT_VALUE) * (1.0 - value), text)
    if tests.scatter < MIN_SCATTER:
        text = f"{label}: it scatters by {tests.scatter:.2g} times the instrument's uncertainty, "
        text += "so that the comparison proves little: state a smaller one, or check its source"
        yield Component(UNPROVEN, text)
    if tests.drift is not None:
        text = f"{label}: its residual has drifted by {tests.drift:+.2g} times its standard "
        yield Component(
            DISAGREEMENT_VALUE, f"{text}uncertainty in the last {tests.drift_s / 60.0:.0f} min"
        )


def lateness_of(score: ForecastScore, now_s: float) -> Component:
    """Return the component of a forecast's own age, and that of its inputs."""
    silent_s = now_s - score.at_s
    value = min(falling(silent_s, *FORECAST_LATE_S), falling(score.age_s, *INPUTS_LATE_S))
    text = f"the last forecast came {silent_s:.0f} s ago, from inputs {score.age_s:.0f} s old"
    return Component(value, text)


def calibration_of(score: ForecastScore) -> Component:
    """Return the component of the calibration of recent forecasts, or None without measurements.

    Two standard deviations of a fraction of n forecasts, each one independent draw, are allowed.
    """
    if math.isnan(score.coverage) or score.judged == 0:
        return Component(None, "no measured tension to judge forecasts by")
    min_coverage = COVERED - 2.0 * math.sqrt(COVERED * (1.0 - COVERED) / score.judged)
    min_coverage = max(min_coverage, COVERED_BAD + 0.01)
    coverage = falling(-score.coverage, -min_coverage, -COVERED_BAD)
    value = min(coverage, falling(score.factor, FACTOR_GOOD, FACTOR_BAD))
    text = f"{score.coverage:.0%} of the truth in the 90 % bands of the last {score.judged} "
    return Component(value, f"{text}forecasts, whose spread is widened by {score.factor:.2g}")


def _worst(parts: Iterable[Component]) -> Component:
    """Return the smallest of known components; 1 without any."""
    return min((part for part in parts if part.value is not None),
               key=lambda part: part.value, default=_GOOD)  # type: ignore[arg-type, return-value]  # fmt: skip
