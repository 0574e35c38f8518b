"""Estimator on a small rope: what it learns, with missing data, after a tare, and what fails."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from learned_lift import NOISE_N, SECONDS, lift, recorded, scene

from rope_twin.estimation.estimator import BLOCK_S, Estimator
from rope_twin.estimation.figures import (
    BIAS,
    CURRENT_SHAPE,
    HEAVE_DELAY,
    HEAVE_ERRORS,
    HEAVE_SHIFTS,
    INDEX,
    NAMES,
    ROPE_FIGURES,
    Prior,
    prior_of,
)
from rope_twin.estimation.lift_model import LONGEST_STEP_S, LiftModel, elements_of
from rope_twin.estimation.measured_lift import MeasuredLift
from rope_twin.estimation.noise import bar_of, top_impedance
from rope_twin.estimation.report import base_values, estimates, left_out_words, limit_words
from rope_twin.messages.reports import STATES
from rope_twin.twin.ensemble.fleet import Fleet, FleetInputs


def prior() -> Prior:
    """Return a prior with sensors that are nearly perfect, as those of `recorded` are."""
    whole = prior_of(scene().learning, 100e3)
    gaussian = whole.gaussian
    for name, sd in (("tension_gain", 1e-4), (BIAS, 20.0), ("heave_gain", 1e-3),
                     ("heave_delay", 1e-3), ("sheave_friction", 1e-5)):  # fmt: skip
        gaussian = gaussian.with_place(INDEX[name], 0.0, sd)
    return Prior(gaussian, NOISE_N, 20.0, whole.learning)


def estimator(series: MeasuredLift, own: Prior | None = None) -> Estimator:
    """Return an estimator that begins at rest at time 0."""
    model = LiftModel(scene(), series)
    return Estimator(model, own or prior(), model.begin_at_rest(0.0), 0.0)


@cache
def learned() -> Estimator:
    """Return an estimator that has learned from all data."""
    made = estimator(lift())
    made.run()
    return made


def test_figures_are_found_within_their_intervals() -> None:
    """Weight, mass, drag, stiffness lie within 2.5 sd, and are known far better than before."""
    theta, _, _ = recorded()
    posterior = learned().results[-1].posterior
    assert len(learned().results) == 2
    off = np.abs(posterior.mean - theta) / posterior.sd
    assert (off[:4] < 2.5).all(), dict(zip(NAMES, off, strict=True))
    assert abs(posterior.mean[0] - theta[0]) < 0.005
    assert abs(posterior.mean[1] - theta[1]) < 0.03
    assert (posterior.sd[:3] < 0.3 * prior().sd[:3]).all()


def test_weight_and_bias_share_what_the_mean_tension_says() -> None:
    """A sum that is known leaves 1/√(1/σ² + 1/s²) of weight σ and zero s, and ties them together.

    After a tare the zero is known to what a tare leaves.
    """
    k, b = INDEX["submerged_weight"], INDEX[BIAS]
    gaussian = prior().gaussian.with_place(INDEX[BIAS], 0.0, 3000.0)
    made = estimator(lift(), Prior(gaussian, NOISE_N, 20.0, prior().learning))
    made.run()
    weight_n = 9.80665 * (8000.0 - 1.5 * 1025.0)
    left = 1.0 / np.hypot(1.0 / 3000.0, 1.0 / (prior().sd[k] * weight_n))
    posterior = made.results[-1].posterior
    assert posterior.sd[k] * weight_n == pytest.approx(left, rel=0.05)
    assert posterior.correlation[k, b] < -0.95
    made.tare()
    assert made.belief.sd[b] == pytest.approx(20.0)


def test_a_hole_in_the_tension_is_no_data() -> None:
    """Without 20 s of the first minute the figures are found still, less surely."""
    theta, _, _ = recorded()
    made = estimator(lift(lost=(70.0, 90.0)))
    made.run()
    first = made.results[0]
    assert first.used == pytest.approx(1.0 - 20.0 / BLOCK_S, abs=0.02)
    assert first.posterior.sd[2] > learned().results[0].posterior.sd[2]
    off = np.abs(made.results[-1].posterior.mean - theta) / made.results[-1].posterior.sd
    assert (off[:4] < 2.5).all()


@pytest.mark.parametrize("end", ["high", "low"])
def test_a_load_pin_at_an_end_of_its_range_is_no_data_there(end: str) -> None:
    """A fifth of its samples; taken as they are, mass and stiffness came out 5 sd too small."""
    theta, _, _ = recorded()
    whole, clipped = lift(), MeasuredLift(NOISE_N)
    times, tension = whole.tension.table.T
    at = np.quantile(tension, 0.8 if end == "high" else 0.2)
    clipped.tension.extend(times, (np.minimum if end == "high" else np.maximum)(tension, at))
    clipped.heave.extend(*whole.heave.table.T)
    clipped.line_out.extend(*whole.line_out.table.T)
    made = estimator(clipped)
    made.run(120.0)
    (only,) = made.results
    assert only.stopped == pytest.approx(0.2, abs=0.05)
    assert only.used == pytest.approx(1.0 - only.stopped, abs=0.08)
    assert left_out_words(only)[0].endswith("left out: the load pin at an end of its range")
    off = np.abs(only.posterior.mean - theta) / only.posterior.sd
    assert (off[:4] < 2.5).all(), dict(zip(NAMES, off, strict=True))


def test_a_figure_at_the_limit_of_its_prior_is_not_called_learned() -> None:
    """A tension that stands still in waves makes mass and drag nothing, within 5 %."""
    frozen = MeasuredLift(NOISE_N)
    times, tension = lift().tension.table.T
    frozen.tension.extend(times, np.full_like(tension, tension[0]))
    frozen.heave.extend(*lift().heave.table.T)
    frozen.line_out.extend(*lift().line_out.table.T)
    made = estimator(frozen)
    made.run(120.0)
    (last,) = made.results
    found = estimates(base_values(scene()), made.prior, last.posterior, at_limit=last.at_limit)
    states = {one.name: one.state for one in found}
    assert "oscillating_mass" in last.at_limit
    assert states["oscillating_mass"] == "at limit"
    assert STATES.index(states["oscillating_mass"]) == 3
    assert "oscillating_mass" in limit_words(last.at_limit)
    assert limit_words(()) == ""


def test_a_minute_that_no_figures_explain_is_believed_as_noise_that_large() -> None:
    """A tension that rings by 5 kN at a period that the rope does not have; noise is 0.5 kN.

    Intervals as narrow as without the ringing would not hold.
    """
    theta, _, _ = recorded()
    ringing = MeasuredLift(NOISE_N)
    times, tension = lift().tension.table.T
    ringing.tension.extend(times, tension + 5e3 * np.sin(2.0 * np.pi * times / 0.9))
    ringing.heave.extend(*lift().heave.table.T)
    ringing.line_out.extend(*lift().line_out.table.T)
    made = estimator(ringing)
    made.run(120.0)
    (first,) = made.results
    assert first.used == 1.0
    assert first.nis > 100.0
    (words,) = left_out_words(first)
    assert f"is off by {np.sqrt(first.nis):.2g} times what sensors and heave explain" in words
    off = np.abs(first.posterior.mean - theta) / first.posterior.sd
    assert (off[:4] < 2.5).all(), dict(zip(NAMES, off, strict=True))
    assert (first.posterior.sd[:4] > 5.0 * learned().results[0].posterior.sd[:4]).any()
    assert (first.posterior.sd[:4] < 1.001 * prior().sd[:4]).all()


def sampled(every: int, spike_n: float = 0.0, count_n: float = 0.0) -> Estimator:
    """Return an estimator that has learned from one in so many samples, three of them spikes.

    count_n: to which the load cell rounds.
    """
    whole, slow = lift(), MeasuredLift(NOISE_N)
    times, tension = whole.tension.table[::every].T
    tension = tension.copy()
    tension[len(tension) // 2 + np.array([0, 7, 8])] += spike_n * np.array([1.0, -1.0, 1.0])
    slow.tension.extend(times, np.round(tension / count_n) * count_n if count_n else tension)
    slow.heave.extend(*whole.heave.table.T)
    slow.line_out.extend(*whole.line_out.table.T)
    made = estimator(slow)
    made.run()
    return made


@pytest.mark.parametrize("spike_n", [0.0, 60e3])
def test_a_load_cell_may_sample_once_a_second(spike_n: float) -> None:
    """Figures are found, however a wave lies between two samples; spikes do not count."""
    theta = recorded()[0]
    last = sampled(20, spike_n).results[-1]
    assert last.used > 0.23
    assert left_out_words(last) == []
    deviations = (last.posterior.mean - theta)[:4] / last.posterior.sd[:4]
    assert np.abs(deviations).max() < 2.0
    assert last.posterior.sd[INDEX["submerged_weight"]] < 0.015
    assert last.posterior.sd[INDEX["oscillating_mass"]] < 0.05


def test_a_load_cell_may_round_to_tens_of_its_noise() -> None:
    """Counts of 5 kN: no step between two is a spike, and what is rounded off is known as noise."""
    last = sampled(1, count_n=5e3).results[-1]
    assert last.used == 1.0
    assert last.nis < 1.0
    assert np.abs((last.posterior.mean - recorded()[0])[:4] / last.posterior.sd[:4]).max() < 2.0


def test_a_load_cell_that_is_too_slow_is_said_to_be() -> None:
    """One sample in two seconds leaves the prior, and the words say which rate is needed."""
    (words,) = left_out_words(sampled(40).results[-1])
    assert "compared, 20% are needed: a sensor is missing, tension comes below 0.8 Hz" in words


def test_without_tension_nothing_is_learned() -> None:
    """A block without data leaves the prior, and lets it drift apart by a fiftieth."""
    made = estimator(lift(lost=(60.0, 120.0)))
    made.run(120.0)
    (only,) = made.results
    assert only.used < 0.05
    assert np.array_equal(only.posterior.mean, prior().mean)
    assert np.allclose(made.belief.sd, prior().sd * np.sqrt(1.0 + 0.02**2))


def test_all_sensors_may_be_lost_for_minutes() -> None:
    """Minutes without heave, line out and tension leave what was learned before."""
    before, gone_s = lift(), 300.0
    series = MeasuredLift(NOISE_N)
    for name in ("heave", "line_out", "tension"):
        table = getattr(before, name).table[: round(125.0 / 0.05)]
        getattr(series, name).extend(*table.T)
        getattr(series, name).extend(table[:, 0] + table[-1, 0] + gone_s, *table[:, 1:].T)
    made = estimator(series)
    first, *holes = made.run(360.0)
    assert first.used > 0.9
    assert [block.used for block in holes] == pytest.approx([0.0] * 4, abs=0.1)
    assert np.array_equal(made.results[-1].posterior.mean, holes[0].posterior.mean)


def test_innovation_of_a_block() -> None:
    """The residual before learning, with the columns that explain it to first order."""
    made = estimator(lift())
    assert made.innovation is None
    made.run(120.0)
    whole = made.innovation
    assert whole is not None
    assert whole.time_s[0] == pytest.approx(60.125)
    assert list(whole.columns) == list(NAMES)
    assert np.isfinite(whole.residual_n).all()
    assert 0.3 < made.results[-1].nis < 2.0
    assert np.allclose(whole.columns[BIAS], 1.0)


def test_strength_and_shape_of_the_current_have_one_column() -> None:
    """Not distinguished: together they are known, each only as far as the other's prior."""
    whole = learned().innovation
    assert whole is not None
    assert np.array_equal(whole.columns["current"], whole.columns[CURRENT_SHAPE])


def test_derivatives_are_those_of_small_changes() -> None:
    """Columns of mass and stiffness, alone and together, are central differences of 0.1 %.

    Both together leave the natural period, so theirs is a small difference of large columns.
    """
    made = estimator(lift())
    model, names = made.model, ("oscillating_mass", "axial_stiffness")
    theta, step = made.theta, 1e-3

    def predicted(*changed: str, by: float) -> np.ndarray:
        moved = theta.copy()
        moved[[INDEX[name] for name in changed]] += by
        return model.linearised(model.predict(moved, made.state, 0.0, 120.0), 60.0)[0]

    _, J = model.linearised(model.predict(theta, made.state, 0.0, 120.0), 60.0)
    for some in (names[:1], names[1:], names):
        column = J[:, [INDEX[name] for name in some]].sum(axis=1)
        central = (predicted(*some, by=step) - predicted(*some, by=-step)) / (2.0 * step)
        assert np.abs(column - central).max() < 0.06 * np.abs(central).max(), some


def test_shifts_are_those_of_other_delays() -> None:
    """Per second, by predictions with these delays; none where the expected heave drives."""
    made = estimator(lift())
    model, theta = made.model, made.theta
    whole = model.predict(theta, made.state, 0.0, 120.0)
    predicted, J, shifts = model.with_shifts(whole, 60.0)
    assert np.abs(J[:, [INDEX[name] for name in HEAVE_ERRORS]]).max() == 0.0
    for k, shift_s in enumerate(HEAVE_SHIFTS.values()):
        other = theta.copy()
        other[INDEX[HEAVE_DELAY]] += shift_s
        late, _ = model.linearised(model.predict(other, made.state, 0.0, 120.0), 60.0)
        change = (late - predicted) / shift_s
        np.testing.assert_allclose(shifts[:, k], change, atol=1e-6 * np.abs(change).max())
    expected = model.predict(theta, made.state, 0.0, 120.0, made._expected_motion())
    assert np.abs(model.with_shifts(expected, 60.0)[2]).max() == 0.0


def test_short_ropes_have_few_elements() -> None:
    """An element is as long as a fifth of the way of an axial wave in 50 ms; 6 to 20 elements."""
    bar = LiftModel(scene(), lift()).bars[0]
    speed = float(np.sqrt(bar.EA_n[0] / bar.mass_kg_per_m[0]))
    assert elements_of(bar.at_length(speed * LONGEST_STEP_S * 0.2 * 10.5)) == 10
    assert elements_of(bar.at_length(10.0)) == 6
    assert elements_of(bar.at_length(1e5)) == 20


def test_work_in_parts_is_the_work_at_once() -> None:
    """Data that come in parts, and steps that are taken one by one, give the same to the bit."""
    series, whole = MeasuredLift(NOISE_N), lift()
    made = estimator(series)
    for begin in np.arange(0.0, SECONDS, 7.3):
        for name in ("tension", "heave", "line_out"):
            table = getattr(whole, name).table
            part = table[(table[:, 0] >= begin) & (table[:, 0] < begin + 7.3)]
            getattr(series, name).extend(*part.T)
        while made.step():
            pass
    assert len(made.results) == 2
    assert np.allclose(made.theta, learned().theta, atol=1e-6)


@pytest.mark.parametrize("period_s", [6.0, 10.0])
def test_impedance_of_the_stepped_rope(period_s: float) -> None:
    """The stepped rope in still water in a regular heave of 1 m has the closed form's amplitude.

    For a sine of amplitude V the linear drag with its power is 8/(3π)·β·V, for a Gaussian velocity
    of the same variance √(8/π)·β·V/√2: the share 0.752.
    """
    step, w = 0.01, 2.0 * np.pi / period_s
    t = step * np.arange(round(16 * period_s / step) + 1)
    ramp = np.clip(t / (4 * period_s), 0.0, 1.0)
    z = ramp * np.sin(w * t)
    v = np.gradient(z, t)
    fleet = Fleet(scene(), 1, elements=60, step_s=step)
    fleet.set_figures({"current": 1e-6, "axial_damping": 1e-3})
    line = np.full_like(t, 200.0)
    record = fleet.advance(FleetInputs(z, v, line, np.zeros_like(t)), interval_steps=100)
    last = slice(-round(4 * period_s / step), None)
    wave = np.exp(-1j * w * t[1:][last])
    tension = record.top_tension_n[last, 0]
    amplitude = 2.0 * ((tension - tension.mean()) * wave).mean() * 1j
    factors = dict.fromkeys(ROPE_FIGURES, 1.0) | {"axial_damping": 1e-3}
    f = np.array([1.0 / period_s, 1.0 / period_s + 0.01])
    narrow = np.array([0.5 / 0.01, 0.0])  # the variance of the sine in one line
    closed = top_impedance(bar_of(scene()).with_factors(factors), f, narrow)[0]
    share = 8.0 / (3.0 * np.pi) / np.sqrt(4.0 / np.pi)
    assert amplitude.real == pytest.approx(closed.real, rel=0.002)
    assert amplitude.imag == pytest.approx(share * closed.imag, rel=0.04)


def test_what_a_slack_rope_leaves_is_not_learned() -> None:
    """Heave six times as high lifts the tool: means in a slack and 30 s after it are missing.

    Mass, drag, stiffness and damping stay as they were.
    """
    calm = lift()
    rough = MeasuredLift(NOISE_N)
    rough.tension, rough.line_out = calm.tension, calm.line_out
    time_s, z, v = calm.heave.table.T
    rough.heave.extend(time_s, 6.0 * z, 6.0 * v)
    means = np.ones(240)
    for series, goes_slack in ((calm, False), (rough, True)):
        model = LiftModel(scene(), series)
        theta = prior().mean
        whole = model.predict(theta, model.begin_at_rest(0.0), 0.0, 120.0)
        assert bool(len(whole.slack_s)) == goes_slack
        assert np.isnan(model.without_slack(whole, 60.0, means)).any() == goes_slack
    whole.slack_s = np.array([70.0])
    ends = 60.0 + 0.25 * np.arange(1, 241)
    missing = np.isnan(model.without_slack(whole, 60.0, means))
    assert np.array_equal(missing, (ends >= 70.0) & (ends < 100.0))
    (first, *_) = estimator(rough).run()
    assert first.used < 0.25
    unlearned = slice(1, 5)
    assert np.abs(first.posterior.mean[unlearned]).max() < 1e-9
    assert np.allclose(first.posterior.sd[unlearned], prior().sd[unlearned])
