"""Campaign of faults: hidden truths that a fault befalls after five minutes, and clean hours."""

from __future__ import annotations

import copy
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from rope_twin.core.state import Floats
from rope_twin.estimation.alarms import NAMED_S, THRESHOLD, FaultWatch
from rope_twin.estimation.causes import (
    HELD,
    PAYLOAD,
    PIN,
    PIN_OFFSET,
    SENSOR_DELAY,
    SENSOR_GAIN,
    SIGNATURES,
    SLIP,
    SNAGGED,
    STUCK_ENCODER,
    STUCK_PIN,
    STUCK_SENSOR,
)
from rope_twin.estimation.estimator import BURN_IN_S, Estimator
from rope_twin.estimation.figures import HEAVE_DELAY, UNITS, Prior
from rope_twin.estimation.lift_model import LiftModel
from rope_twin.scene.schema import Scene
from validation.learning.truths import WARM_UP_S, Truth, make_changed_truths, make_truths

LEARNED_S, WATCHED_S = 300.0, 180.0
ONSET_S = WARM_UP_S + LEARNED_S
FIRST_SEED = 24  # of truths whose load pin is tared
SETTLING_S = 180.0  # of clean minutes: the tests begin after two blocks
W, M, K = "submerged_weight", "oscillating_mass", "payload_drag"


Bools = NDArray[np.bool_]
Change = Callable[[Truth, Bools, Floats], Truth]  # truth, samples after the onset, seconds since


@dataclass(frozen=True)
class Fault:
    """A fault of the campaign: of the payload, or of the sensors after the onset."""

    name: str
    right: frozenset[str]  # causes that name it
    factors: Mapping[str, float] = field(default_factory=dict)
    sensors: Change | None = None
    large: bool = False
    extra: bool = False  # beyond the thirteen


def _tension(change: Callable[[Floats, Floats], Floats]) -> Change:
    def of(truth: Truth, after: Bools, elapsed_s: Floats) -> Truth:
        changed = change(truth.tension_n, elapsed_s)
        return replace(truth, tension_n=np.where(after, changed, truth.tension_n))

    return of


def _heave(change: Callable[[Truth, Floats], Floats]) -> Change:
    def of(truth: Truth, after: Bools, elapsed_s: Floats) -> Truth:
        return replace(truth, heave_m=np.where(after, change(truth, elapsed_s), truth.heave_m))

    return of


def _slip(rate: float, seconds: float) -> Change:
    def of(truth: Truth, after: Bools, elapsed_s: Floats) -> Truth:
        slipped = rate * np.clip(elapsed_s, 0.0, seconds)  # the rope does, the counter does not
        return replace(truth, line_out_m=truth.line_out_m - slipped)

    return of


def _held(truth: Truth, values: Floats) -> Floats:
    return np.full_like(values, values[np.searchsorted(truth.time_s, ONSET_S, side="right")])


def _stuck(name: str) -> Change:
    def of(truth: Truth, after: Bools, elapsed_s: Floats) -> Truth:
        values = getattr(truth, name)
        fields = copy.copy(vars(truth))
        fields[name] = np.where(after, _held(truth, values), values)
        return Truth(**fields)

    return of


def _late(truth: Truth, elapsed_s: Floats) -> Floats:
    return np.interp(truth.time_s - 0.4, truth.time_s, truth.heave_m)


FAULTS = (
    Fault("20 % of the payload lost", frozenset({PAYLOAD}), {W: 0.8, M: 0.92}),
    Fault("flooded: 5 % weight, 2 % mass", frozenset({PAYLOAD}), {W: 1.05, M: 1.02}),
    Fault("all of it lost", frozenset({PAYLOAD}), {W: 0.02, M: 0.02, K: 0.02}, large=True),
    Fault("snagged: mass × 10, drag × 30", frozenset({SNAGGED}), {M: 10.0, K: 30.0}, large=True),
    Fault("pin: bias 5 kN at once", frozenset({PIN_OFFSET}), sensors=_tension(
        lambda y, _: y + 5e3)),
    Fault("pin: bias 2 kN", frozenset({PIN_OFFSET}), sensors=_tension(lambda y, _: y + 2e3)),
    Fault("pin: bias 1 kN", frozenset({PIN_OFFSET}), sensors=_tension(lambda y, _: y + 1e3)),
    Fault("pin: drift 5 kN a minute", PIN, sensors=_tension(lambda y, s: y + 5e3 * s / 60.0)),
    Fault("pin: gain 5 %", frozenset({PIN_OFFSET}), sensors=_tension(lambda y, _: 1.05 * y)),
    Fault("MRU late by 0.4 s more", frozenset({SENSOR_DELAY}), sensors=_heave(_late)),
    Fault("MRU gain 20 %", frozenset({SENSOR_GAIN}), sensors=_heave(
        lambda truth, _: 1.2 * truth.heave_m)),
    Fault("line slips 3 m in 3 s", frozenset({SLIP}), sensors=_slip(1.0, 3.0), large=True),
    Fault("line slips 30 m in 60 s", frozenset({SLIP}), sensors=_slip(0.5, 60.0), large=True),
    Fault("lower end held", frozenset({HELD}), {M: 1e3, K: 1e4}, large=True, extra=True),
    Fault("load pin stuck", frozenset({STUCK_PIN}), sensors=_stuck("tension_n"), extra=True),
    Fault("MRU stuck", frozenset({STUCK_SENSOR}), sensors=_stuck("heave_m"), extra=True),
    Fault("line counter stuck", frozenset({STUCK_ENCODER}), sensors=_stuck("line_out_m"),
          extra=True),
)  # fmt: skip


@dataclass(frozen=True)
class Finding:
    """Outcome of one truth with one fault."""

    early: bool  # an alarm before the fault
    after_s: float | None  # None: not found
    begun_s: float | None  # onset that the alarm names, after the fault
    causes: Mapping[float, tuple[str, ...]]  # by seconds after the alarm: 0, 5, 20, 60


@dataclass
class Cost:
    """CPU time of the watch, and time watched."""

    cpu_s: float = 0.0
    seconds: float = 0.0


def follow(
    estimator: Estimator,
    watch: FaultWatch,
    from_s: float,
    to_s: float,
    cost: Cost,
    look: Callable[[float], bool] = lambda now: True,
) -> None:
    """Watch and learn second by second; look: after each, False: stop."""
    for now in np.arange(from_s + 1.0, to_s + 0.5, 1.0):
        began = time.thread_time()
        watch.advance(float(now))
        cost.cpu_s += time.thread_time() - began
        if not watch.frozen and estimator.block_end_s <= now + 1e-6:
            estimator.run(float(now))
            began = time.thread_time()
            watch.learned(estimator)
            cost.cpu_s += time.thread_time() - began
        cost.seconds += 1.0
        if not look(float(now)):
            return


def _begin(scene: Scene, prior: Prior, truth: Truth) -> Estimator:
    model = LiftModel(scene, truth.lift(prior.pin_noise_n))
    return Estimator(model, prior, model.begin_at_rest(WARM_UP_S - BURN_IN_S), 0.0)


def faulty_truths(
    scene: Scene, prior: Prior, seeds: Sequence[int], sea: str, faults: Sequence[Fault]
) -> dict[str, list[Truth]]:
    """Return the truths of each fault by name, and without one by ""."""
    changes = {
        "": {},
        **{candidate.name: candidate.factors for candidate in faults if candidate.factors},
    }
    truths = make_changed_truths(scene, prior, seeds, sea, LEARNED_S + WATCHED_S + 2.0, ONSET_S,
                               changes)  # fmt: skip
    for fault in faults:
        if fault.sensors is not None:
            truths[fault.name] = []
            for truth in truths[""]:
                elapsed_s = truth.time_s - ONSET_S
                truths[fault.name].append(fault.sensors(truth, elapsed_s > 0.0, elapsed_s))
    return truths


def find(
    scene: Scene, prior: Prior, truths: Mapping[str, list[Truth]], cost: Cost,
    report: Callable[[int, int, str], None] = lambda done, total, what: None,
) -> dict[str, list[Finding]]:  # fmt: skip
    """Return the findings of each fault, in the order of the truths; cost: before the faults."""
    results: dict[str, list[Finding]] = {name: [] for name in truths if name}
    for number, clean in enumerate(truths[""]):
        estimator = _begin(scene, prior, clean)
        watch = FaultWatch(scene, estimator)
        follow(estimator, watch, 0.0, ONSET_S, cost)
        lift = estimator.model.lift
        for name, findings in results.items():
            copied = copy.copy(estimator)
            copied.noise, copied.results = copy.deepcopy(estimator.noise), list(estimator.results)
            estimator.model.lift = truths[name][number].lift(prior.pin_noise_n)
            findings.append(_watch(copied, watch.branch(copied), Cost()))
        estimator.model.lift = lift
        report(number + 1, len(truths[""]), "truths with faults")
    return results


def _watch(estimator: Estimator, watch: FaultWatch, cost: Cost) -> Finding:
    """Return what is found after the onset."""
    if watch.frozen:
        return Finding(True, None, None, {})
    causes: dict[float, tuple[str, ...]] = {}

    def look(now: float) -> bool:
        alarm = watch.alarm
        if alarm is None:
            return True
        for after in (0.0, *NAMED_S):
            if now - alarm.found_s >= after:
                causes.setdefault(after, alarm.causes)
        return len(causes) < 1 + len(NAMED_S) and alarm.ratio > 0.0

    follow(estimator, watch, ONSET_S, ONSET_S + WATCHED_S, cost, look)
    alarm = watch.alarm
    if alarm is None:
        return Finding(False, None, None, {})
    if alarm.ratio == 0.0:
        causes |= dict.fromkeys((0.0, *NAMED_S), alarm.causes)
    return Finding(False, alarm.found_s - ONSET_S, alarm.begun_s - ONSET_S, causes)


def detectable_sizes(
    scene: Scene, prior: Prior, seeds: Sequence[int], sea: str, after_s: Sequence[float],
    share: float,
) -> list[tuple[str, str, Floats]]:  # fmt: skip
    """Return each first-order cause, its unit, and the sizes found so long after the onset.

    Medians over clean truths that were learned for about LEARNED_S. A cause of several figures is
    listed by its first.
    """
    sizes = []
    for truth in make_truths(scene, prior, seeds, sea, LEARNED_S + 2.0):
        estimator = _begin(scene, prior, truth)
        watch = FaultWatch(scene, estimator, np.inf)
        follow(estimator, watch, 0.0, ONSET_S - 1.0, Cost())  # before another reference
        tests = watch.tests
        assert tests is not None
        sizes.append(
            [tests.detectable(tests.now_s - passed_s, THRESHOLD, share) for passed_s in after_s]
        )
    medians = np.median(sizes, axis=0).T
    rows: list[tuple[str, str, Floats]] = []
    for signature, size in zip(SIGNATURES, medians, strict=True):
        if signature.direction:
            name, value = next(iter(signature.direction.items()))
            unit = UNITS.get(name, UNITS[HEAVE_DELAY])  # a shift is one of the delay
            scale = (100.0 * value, "%") if unit == "-" else (value, unit)
            rows.append((f"{signature.cause}: {name}", scale[1], size * scale[0]))
        else:
            rows.append((signature.cause, "N/min", size * 60.0 * signature.ramp_n_per_s))
    return rows


def clean_maxima(
    scene: Scene, prior: Prior, seeds: Sequence[int], sea: str, minutes: int, cost: Cost,
    report: Callable[[int, int, str], None] = lambda done, total, what: None,
) -> tuple[Floats, Floats, int]:  # fmt: skip
    """Return the largest ratio and NIS of each clean minute, and the number of other alarms."""
    ratios: list[float] = []
    nis: list[float] = []
    other_alarms = 0
    for number, truth in enumerate(make_truths(scene, prior, seeds, sea, 60.0 * minutes + 2.0)):
        estimator = _begin(scene, prior, truth)
        watch = FaultWatch(scene, estimator, np.inf)
        maxima: list[tuple[float, float, float]] = []

        def look(now: float, watch_now: FaultWatch = watch, rows: list = maxima) -> bool:  # type: ignore[type-arg]
            if watch_now.tests is not None and watch_now.now_s == now:
                rows.append((now, watch_now.tests.ratios().max(), watch_now.tests.nis()))
            return True

        follow(estimator, watch, 0.0, WARM_UP_S + 60.0 * minutes, cost, look)
        other_alarms += watch.alarm is not None
        table = np.array(maxima)
        minutes_of = np.ceil(table[:, 0] / 60.0)  # a look at the end of a minute is in it
        for minute in np.unique(minutes_of):
            some = table[minutes_of == minute]
            ratios.append(float(some[:, 1].max()))
            nis.append(float(some[:, 2].max()))
        report(number + 1, len(seeds), "truths without a fault")
    return np.array(ratios), np.array(nis), other_alarms


def tail_threshold(maxima: Floats, a_day: float) -> float:
    """Return the threshold with so many exceedances a day, by an exponential tail.

    maxima: of each minute; the tail is that of the largest tenth, eight values at least, by the
    mean of its excesses (the maximum-likelihood fit).
    """
    ordered = np.sort(maxima)[::-1]
    count = min(max(8, len(ordered) // 10), len(ordered) - 1)
    edge = ordered[count]
    scale = float(np.mean(ordered[:count] - edge))
    return float(edge + scale * np.log(count / len(ordered) * 1440.0 / a_day))
