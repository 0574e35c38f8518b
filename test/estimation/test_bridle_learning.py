"""Learning of a bridle: one rope from the ship, below it a hook, slings, a bar and two loads."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from rope_twin import Twin
from rope_twin.core.state import Floats
from rope_twin.errors import InputError
from rope_twin.estimation.alarms import FaultWatch
from rope_twin.estimation.causes import PAYLOAD
from rope_twin.estimation.estimator import Estimator
from rope_twin.estimation.figures import (
    BIAS,
    COUNT,
    GAIN,
    INDEX,
    ROPE_FIGURES,
    Prior,
    check_learnable,
    factors_of,
    scene_prior,
    static_tops_n,
)
from rope_twin.estimation.hanging import hanging_of
from rope_twin.estimation.lift_model import LiftModel
from rope_twin.estimation.live import Learner
from rope_twin.estimation.measured_lift import MeasuredLift
from rope_twin.estimation.noise import bar_of, top_impedance
from rope_twin.estimation.report import base_values, derived_mass_kg
from rope_twin.estimation.worker import Motion, Reading, Restart
from rope_twin.scene.instruments import Learning
from rope_twin.scene.lift import suspended_weights
from rope_twin.scene.load import load_scene
from rope_twin.scene.schema import Scene
from rope_twin.twin.ensemble.fleet import Fleet, FleetInputs
from rope_twin.twin.ensemble.live_state import live_state

TRUTHS, SECONDS, STEP_S, SENSOR_S = 4, 183.0, 0.02, 0.05
PIN_RANGE_N = 300e3
NOISE_N = 0.0075 * PIN_RANGE_N
HEIGHT_M = 0.5
NORMAL_90 = 1.6448536269514722
GRAVITY, WATER = 9.80665, 1025.0
STEEL = 7850.0


@cache
def bridle() -> Scene:
    """The bridle with a load pin without friction and a motion sensor without delay."""
    known = Learning(
        pin_range_n=PIN_RANGE_N, friction_pct=0.0, friction_uncertainty_pct=0.001,
        heave_delay_s=0.0, heave_delay_uncertainty_s=0.001,
    )  # fmt: skip
    return replace(load_scene("bridle_lift"), learning=known)


@cache
def prior() -> Prior:
    """The prior of a load pin that is tared and calibrated."""
    own = scene_prior(bridle(), tared=True)
    return replace(own, gaussian=own.gaussian.with_place(INDEX[GAIN], 0.0, 0.002))


def motion(t: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """Heave of three waves, its rate, line out paid out and hauled, and its rate.

    The bridle rings at 6 s: higher waves there would let its slings go slack.
    """
    z, v = np.zeros_like(t), np.zeros_like(t)
    for height, period, phase in ((0.35, 8.5, 0.3), (0.08, 6.0, 1.0), (0.4, 12.0, 2.0)):
        w = 2.0 * np.pi / period
        z += height * np.sin(w * t + phase)
        v += height * w * np.cos(w * t + phase)
    ramp = np.clip(t / 10.0, 0.0, 1.0)
    rate = np.where(ramp < 1.0, 0.1, 0.0)
    return z * ramp, v * ramp + z * rate, 1000.0 + 4.0 * np.sin(0.1 * t), 0.4 * np.cos(0.1 * t)


@cache
def truths() -> tuple[Floats, Floats, Floats]:
    """θ drawn by seed, (TRUTHS, COUNT), times and top tensions of a finer mesh and step."""
    rng = np.random.default_rng(5)
    thetas = np.zeros((TRUTHS, COUNT))
    own = slice(len(ROPE_FIGURES))
    drawn = rng.standard_normal((TRUTHS, len(ROPE_FIGURES))).clip(-2.0, 2.0)
    thetas[:, own] = prior().sd[own] * drawn
    for name in (BIAS, GAIN):
        thetas[:, INDEX[name]] = prior().sd[INDEX[name]] * rng.standard_normal(TRUTHS)
    t = STEP_S * np.arange(round(SECONDS / STEP_S) + 1)
    fleet = Fleet(bridle(), TRUTHS, elements=40, step_s=STEP_S)
    fleet.set_figures(factors_of(thetas))
    record = fleet.advance(FleetInputs(*motion(t)), interval_steps=100)
    assert not record.failures
    return thetas, t[1:], record.top_tension_n


def lift(number: int) -> MeasuredLift:
    """A lift as the sensors measured it, of one truth."""
    thetas, t, tension = truths()
    made, at = MeasuredLift(NOISE_N), np.arange(0.0, SECONDS, SENSOR_S)
    z, v, line, _ = motion(at)
    noise = NOISE_N * np.random.default_rng(100 + number).standard_normal(len(at))
    gain, bias = (thetas[number, INDEX[name]] for name in (GAIN, BIAS))
    made.tension.extend(at, (1.0 + gain) * np.interp(at, t, tension[:, number]) + bias + noise)
    made.heave.extend(at, z, v)
    made.line_out.extend(at, line)
    return made


@pytest.mark.long
def test_hidden_figures_lie_in_their_intervals() -> None:
    """Intervals of 90 % hold 80 % or more of four truths, with errors as large as stated."""
    thetas, _, _ = truths()
    errors, sds = [], []
    for number, theta in enumerate(thetas):
        model = LiftModel(bridle(), lift(number))
        made = Estimator(model, prior(), model.begin_at_rest(0.0), 0.0)
        last = made.run()[-1]
        assert len(made.results) == 2
        errors.append(last.posterior.mean - theta)
        sds.append(last.posterior.sd)
    rope = slice(len(ROPE_FIGURES))
    error, sd = np.array(errors)[:, rope], np.array(sds)[:, rope]
    inside = np.abs(error) < NORMAL_90 * sd
    assert inside.mean() >= 0.8
    assert np.sqrt(np.mean((error / sd) ** 2)) < 1.3
    rms = dict(zip(ROPE_FIGURES, np.sqrt((error**2).mean(axis=0)), strict=True))
    assert rms["submerged_weight"] < 0.005
    assert rms["oscillating_mass"] < 0.03
    assert rms["payload_drag"] < 0.10
    assert (sd[:, :4] < 0.5 * prior().sd[:4]).all()


def test_figures_are_those_of_all_that_hangs() -> None:
    """Hook, bar and both loads, by hand; the slings are in the static tension alone."""
    scene = bridle()
    steel = (800.0 + 2 * 50.0 + 1500.0) * (1.0 - WATER / STEEL)
    weight_n = GRAVITY * (steel + 2 * (8000.0 - 1.5 * WATER))
    base = base_values(scene)
    assert base["submerged_weight"] == pytest.approx(weight_n, rel=1e-3)
    derived = derived_mass_kg(base, prior().gaussian, scene)
    assert derived["mass_in_air_kg"] == pytest.approx(800.0 + 100.0 + 1500.0 + 16000.0)
    whole = suspended_weights(scene)
    assert whole is not None
    assert static_tops_n(scene)[0] == pytest.approx(whole.weight_n, rel=0.01)
    ((_, (metre_kg,), _),) = hanging_of(scene).ropes
    assert bar_of(scene).slings_kg == pytest.approx(28.0 * metre_kg)


def test_impedance_is_that_of_the_stepped_bridle() -> None:
    """In still water and a regular heave of 0.5 m: what the slings give way is neglected."""
    step, period_s = 0.02, 12.0
    w = 2.0 * np.pi / period_s
    t = step * np.arange(round(16 * period_s / step) + 1)
    ramp = np.clip(t / (4 * period_s), 0.0, 1.0)
    z = HEIGHT_M * ramp * np.sin(w * t)
    fleet = Fleet(bridle(), 1, elements=60, step_s=step)
    fleet.set_figures({"current": 1e-6})
    line = np.full_like(t, 1000.0)
    record = fleet.advance(FleetInputs(z, np.gradient(z, t), line, np.zeros_like(t)), 100)
    last = slice(-round(4 * period_s / step), None)
    tension = record.top_tension_n[last, 0]
    amplitude = 2j * ((tension - tension.mean()) * np.exp(-1j * w * t[1:][last])).mean()
    f = np.array([1.0 / period_s, 1.0 / period_s + 0.01])
    narrow = np.array([0.5 * HEIGHT_M**2 / 0.01, 0.0])
    closed = top_impedance(bar_of(bridle()), f, narrow)[0] * HEIGHT_M
    assert abs(amplitude) == pytest.approx(abs(closed), rel=0.03)


def test_a_lost_load_is_found() -> None:
    """The lanes of the causes have all ropes: half of the load that goes at once is named."""
    scene, onset_s, end_s = bridle(), 200.0, 222.0
    t = 0.05 * np.arange(round(end_s / 0.05) + 1)
    z, v, line, speed = motion(t)
    fleet, at = Fleet(scene, 1, elements=20, step_s=0.05), round(onset_s / 0.05)
    parts = []
    for some in (slice(0, at + 1), slice(at, None)):
        inputs = FleetInputs(z[some], v[some], line[some], speed[some])
        parts.append(fleet.advance(inputs, 100).top_tension_n[:, 0])
        half = dict.fromkeys(("submerged_weight", "oscillating_mass", "payload_drag"), 0.6)
        fleet.set_figures(half)
    y = np.concatenate([parts[0][:1], *parts])
    made = MeasuredLift(NOISE_N)
    made.tension.extend(t, y + NOISE_N * np.random.default_rng(3).standard_normal(len(t)))
    made.heave.extend(t, z, v)
    made.line_out.extend(t, line)
    model = LiftModel(scene, made)
    estimator = Estimator(model, prior(), model.begin_at_rest(0.0), 0.0)
    watch = FaultWatch(scene, estimator)
    for now in np.arange(1.0, end_s - 0.5):
        watch.advance(float(now))
        if not watch.frozen and estimator.block_end_s <= now:
            estimator.run(float(now))
            watch.learned(estimator)
        assert now > onset_s or watch.alarm is None
    assert watch.alarm is not None
    assert watch.alarm.causes == (PAYLOAD,)
    assert watch.alarm.found_s < onset_s + 5.0


def test_a_live_bridle_takes_over_what_was_learned() -> None:
    """From the state of a twin: its factors are accepted, and all loads have the learned weight."""
    scene = bridle()
    twin, series = Twin(scene), lift(0)
    learner = Learner(scene)
    learner.tare()
    learner.take(Restart(live_state(twin)))
    lines = dict(series.line_out.table)
    for (at, z, v), (_, force) in zip(series.heave.table, series.tension.table, strict=True):
        learner.take(Motion(float(at), float(z), float(v), float(lines[at])))
        learner.take(Reading(float(at), float(force)))
    while learner.work():
        pass
    assert learner.trouble == ""
    before_n = twin.top_tension_n
    assert not twin.submit_figures(ramp_s=20.0, **learner.factors_to_apply())
    after_n = []
    for _ in range(60):  # the last half is a mean over the ringing
        twin.advance(100)
        after_n.append(twin.top_tension_n)
    learned = learner.newest
    assert learned is not None
    weight = next(one for one in learned.figures if one.name == "submerged_weight")
    hidden_n = hanging_of(scene).weight_n * float(factors_of(truths()[0][0])[weight.name])
    assert abs(weight.value - hidden_n) < 2.5 * weight.sd * weight.value
    change_n = weight.value - weight.prior
    assert abs(change_n) > 2000.0
    assert np.mean(after_n[30:]) - before_n == pytest.approx(change_n, rel=0.05)


def test_a_rope_over_a_lower_sheave_is_refused() -> None:
    """One sentence says so; also for the model."""
    scene, why = load_scene("two_line_loop"), "over a sheave below the winch"
    with pytest.raises(InputError, match=why):
        check_learnable(scene)
    with pytest.raises(InputError, match=why):
        LiftModel(scene, MeasuredLift(1.0))


def test_a_load_that_is_held_below_is_refused() -> None:
    """A guide line to the seabed shares the load."""
    scene = bridle()
    guide = replace(
        scene.ropes[3], name="guide", from_="half_port", to="", fixed_at_m=(3.0, 0.0, -1030.0)
    )
    with pytest.raises(InputError, match="fixed point"):
        check_learnable(replace(scene, ropes=(*scene.ropes, guide)))
