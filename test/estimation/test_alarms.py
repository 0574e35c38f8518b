"""Watch on a small lift: alarms, their causes, frozen learning; the same model is the truth."""

from __future__ import annotations

from copy import copy, deepcopy
from functools import cache

import numpy as np
import pytest
from learned_lift import NOISE_N, motion, scene

from rope_twin.estimation import alarms
from rope_twin.estimation.alarms import Alarm, FaultWatch
from rope_twin.estimation.causes import (
    PAYLOAD,
    PIN_OFFSET,
    SENSOR_DELAY,
    SLIP,
    STUCK_ENCODER,
    STUCK_PIN,
    STUCK_SENSOR,
    likelihood_gain,
)
from rope_twin.estimation.estimator import Estimator
from rope_twin.estimation.figures import scene_prior
from rope_twin.estimation.lift_model import LiftModel
from rope_twin.estimation.measured_lift import MeasuredLift
from rope_twin.twin.ensemble.fleet import Fleet, FleetInputs

SECONDS, ONSET_S = 290.0, 220.0
STEP_S = 0.05


@cache
def tension(weight: float) -> np.ndarray:
    """Top tension of a rope whose payload's weight and mass change by a factor at ONSET_S."""
    t = STEP_S * np.arange(round(SECONDS / STEP_S) + 1)
    z, v, line, speed = motion(t)
    fleet = Fleet(scene(), 1, elements=20, step_s=STEP_S)
    at = round(ONSET_S / STEP_S)
    parts = []
    for some in (slice(0, at + 1), slice(at, None)):
        record = fleet.advance(FleetInputs(z[some], v[some], line[some], speed[some]), 100)
        parts.append(record.top_tension_n[:, 0])
        # were its mass to change as much, it would be a gain of the load pin on so short a rope
        mass = 0.02 if weight == 0.0 else 1.0 - 0.4 * (1.0 - weight)
        fleet.set_figures({"submerged_weight": max(weight, 0.02), "oscillating_mass": mass})
    return np.concatenate([parts[0][:1], *parts])


def lift_with(
    weight: float = 1.0, bias_n: float = 0.0, slip_m_per_s: float = 0.0, stuck: int | None = None,
    late_s: float = 0.0,
) -> MeasuredLift:  # fmt: skip
    """Return the series with a fault from ONSET_S on; stuck: number of a sensor."""
    t = STEP_S * np.arange(round(SECONDS / STEP_S) + 1)
    z, v, line, _ = motion(t)
    since = np.clip(t - ONSET_S, 0.0, None)
    noise = NOISE_N * np.random.default_rng(3).standard_normal(len(t))
    y = tension(weight) + noise + np.where(since > 0.0, bias_n, 0.0)
    z_late, v_late, *_ = motion(t - late_s)
    z, v = (np.where(since > 0.0, one, own) for one, own in ((z_late, z), (v_late, v)))
    line = line - slip_m_per_s * np.minimum(since, 3.0)
    for number, values in enumerate((y, z, line)):
        if number == stuck:
            values[since > 0.0] = values[np.argmax(since > 0.0)]
    lift = MeasuredLift(NOISE_N)
    lift.tension.extend(t, y)
    lift.heave.extend(t, z, v)
    lift.line_out.extend(t, line)
    return lift


def follow(watch: FaultWatch, estimator: Estimator, begin_s: float, end_s: float) -> None:
    """Watch and learn, second by second."""
    for now in np.arange(begin_s + 1.0, end_s + 0.5):
        watch.advance(float(now))
        if not watch.frozen and estimator.block_end_s <= now:
            estimator.run(float(now))
            watch.learned(estimator)


@cache
def before_the_fault() -> tuple[FaultWatch, Estimator]:
    """Return watch and estimator at ONSET_S, in order until then."""
    model = LiftModel(scene(), lift_with())
    estimator = Estimator(model, scene_prior(scene(), tared=True), model.begin_at_rest(0.0), 0.0)
    watch = FaultWatch(scene(), estimator)
    follow(watch, estimator, 0.0, ONSET_S)
    assert watch.alarm is None
    return watch, estimator


def watched(
    weight: float = 1.0, bias_n: float = 0.0, slip_m_per_s: float = 0.0, stuck: int | None = None,
    late_s: float = 0.0, tared: bool = False,
) -> tuple[FaultWatch, Estimator]:  # fmt: skip
    """Return watch and estimator after SECONDS, with a fault from ONSET_S on; tared: then."""
    watch, estimator = before_the_fault()
    estimator.model.lift = lift_with(weight, bias_n, slip_m_per_s, stuck, late_s)
    own = copy(estimator)
    own.noise, own.results = deepcopy(estimator.noise), list(estimator.results)
    branch = watch.branch(own)
    if tared:
        own.tare()
        branch.tare()
    follow(branch, own, ONSET_S, SECONDS - 1.0)
    return branch, own


def alarm_of(watch: FaultWatch) -> Alarm:
    """Return its alarm."""
    assert watch.alarm is not None
    return watch.alarm


def test_a_lift_in_order_raises_no_alarm() -> None:
    """The seconds that are tested have none, and all blocks are learned."""
    watch, estimator = watched()
    assert watch.alarm is None
    assert watch.now_s >= SECONDS - 4.0
    assert len(estimator.results) == 3


def test_a_tension_that_is_gone_for_good_does_not_end_the_tests() -> None:
    """All its samples are dropped by then; the tests go on where it comes back."""
    watch, estimator = watched()
    tested_s, kept = watch.now_s, estimator.model.lift
    gone = deepcopy(kept)
    gone.drop_before(1e6)
    assert watch.advance(gone.known_until_s(0.0)) is None
    assert watch.now_s == tested_s


def test_means_without_a_tension_are_not_tested() -> None:
    """A load pin that falls silent leaves the time until which there was no fault."""
    before, learned = before_the_fault()
    estimator = copy(learned)
    estimator.noise, estimator.results = deepcopy(learned.noise), list(learned.results)
    lift = lift_with()
    table = lift.tension.table
    silent = MeasuredLift(NOISE_N)
    silent.tension.extend(*table[table[:, 0] <= ONSET_S + 3.0].T)
    silent.heave, silent.line_out = lift.heave, lift.line_out
    estimator.model.lift = silent
    watch = before.branch(estimator)
    watch.advance(SECONDS - 1.0)
    assert watch.now_s > ONSET_S + 20.0
    assert watch.tested_s == pytest.approx(ONSET_S + 3.0, abs=1.0)


def test_a_lost_payload_is_found_by_the_plain_rule() -> None:
    """Within 3 s, with its beginning; learning waits until the alarm is acknowledged."""
    watch, estimator = watched(weight=0.0)
    alarm = alarm_of(watch)
    assert alarm.causes == (PAYLOAD,)
    assert alarm.found_s - ONSET_S <= 3.0
    assert alarm.begun_s == pytest.approx(ONSET_S, abs=2.5)
    assert watch.frozen
    assert estimator.block_end_s == 240.0  # the block with the fault was not learned
    assert "payload" in alarm.words
    watch.acknowledge()
    assert not watch.frozen


def test_a_part_of_the_payload_lost_is_named() -> None:
    """A fifth: the rope rings, so it is no load pin."""
    alarm = alarm_of(watched(weight=0.8)[0])
    assert alarm.found_s - ONSET_S <= 3.0
    assert alarm.named_after_s == 60.0
    assert alarm.causes == (PAYLOAD,)


def test_an_offset_of_the_load_pin_is_named() -> None:
    """3 kN at once, without ringing."""
    alarm = alarm_of(watched(bias_n=3000.0)[0])
    assert alarm.found_s - ONSET_S <= 6.0
    assert PIN_OFFSET in alarm.causes
    assert alarm.begun_s == pytest.approx(ONSET_S, abs=2.0)


def test_another_zero_after_a_tare_is_no_fault() -> None:
    """With the offset from above: the tests begin again after two blocks. An alarm stays on."""
    watch, estimator = watched(bias_n=3000.0, tared=True)
    assert watch.alarm is None
    assert watch.tests is None
    assert len(estimator.results) == 3
    stuck, _ = watched(stuck=0)
    stuck.tare()
    assert alarm_of(stuck).causes == (STUCK_PIN,)
    assert stuck.frozen


def test_a_slip_of_the_line_is_named() -> None:
    """3 m in 3 s that the counter does not count."""
    alarm = alarm_of(watched(slip_m_per_s=1.0)[0])
    assert alarm.found_s - ONSET_S <= 4.0
    assert alarm.causes == (SLIP,)


@pytest.mark.parametrize("late_s", [0.4, -0.4])
def test_a_large_delay_is_one_of_its_shifts(late_s: float) -> None:
    """Named; most likely is the motion sensor that is as late: size 1, by the tangent it is ±4.

    The jump of the measured heave at the onset rings the rope, which no signature has.
    """
    watch, _ = watched(late_s=late_s)
    assert alarm_of(watch).causes == (SENSOR_DELAY,)
    assert watch.tests is not None
    first = watch.tests.suspicions()[0]
    assert first.cause == SENSOR_DELAY
    assert first.size == pytest.approx(1.0, abs=0.2)


def test_a_suspicion_keeps_the_reference(monkeypatch: pytest.MonkeyPatch) -> None:
    """Newer figures may have learned the fault; it does so for two blocks more."""
    moved, estimator = watched()
    moved.learned(estimator)  # as if another block had passed
    assert moved.tests is not None
    assert moved.tests.begin_s == 240.0
    monkeypatch.setattr(alarms, "SUSPECTED", 0.0)
    kept, estimator = watched()
    kept.learned(estimator)
    assert kept.tests is not None
    assert kept.tests.begin_s == 180.0
    assert kept._suspects(180.0 + 180.0)
    assert not kept._suspects(180.0 + 240.0)


@pytest.mark.parametrize(
    ("number", "cause"), [(0, STUCK_PIN), (1, STUCK_SENSOR), (2, STUCK_ENCODER)]
)
def test_stuck_sensors_are_named(number: int, cause: str) -> None:
    """A second after the last new sample, before any statistics speak."""
    alarm = alarm_of(watched(stuck=number)[0])
    assert alarm.causes == (cause,)
    assert alarm.found_s - ONSET_S <= 1.2
    assert alarm.begun_s == pytest.approx(ONSET_S, abs=0.1)


def test_likelihood_gain_of_a_response_at_its_best_size() -> None:
    """dᵀS⁻¹e²/dᵀS⁻¹d inside the range, less at its ends, 0 without power; by ln p of normals."""
    gain = likelihood_gain(
        np.array([6.0, 6.0, -6.0, 0.0]),
        np.array([4.0, 4.0, 4.0, 0.0]),
        np.array([0.5, 0.0, 0.5, 0.5]),
        np.array([2.0, 1.0, 2.0, 2.0]),
    )
    np.testing.assert_allclose(gain, [9.0, 8.0, -7.0, 0.0])
