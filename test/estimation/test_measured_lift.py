"""Conditioning of measured tension, heave and line out."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rope_twin.estimation.measured_lift import (
    FORGETTING_S,
    MEAN_S,
    SMOOTHING_LEAVES,
    MeasuredLift,
    Series,
    at_stops,
    interval_means,
    straightened,
    without_spikes,
    without_stairs,
)


def lift(seconds: float = 60.0, seed: int = 0) -> MeasuredLift:
    """Return a lift at 20 Hz: 300 kN with a noise of 3 kN, heave of 1 m in 8 s, 1 m/s of line."""
    t = 0.05 * np.arange(round(seconds / 0.05) + 1)
    made = MeasuredLift(3000.0)
    made.tension.extend(t, 300e3 + 3000.0 * np.random.default_rng(seed).standard_normal(len(t)))
    w = 2.0 * np.pi / 8.0
    made.heave.extend(t, np.sin(w * t), w * np.cos(w * t))
    made.line_out.extend(t, 500.0 + t)
    return made


def test_means_are_of_the_samples_since_the_previous_border() -> None:
    """A mean holds the samples in (begin, end]: five at 20 Hz, those at the border included."""
    t = 0.05 * np.arange(41)
    means, number = interval_means(t, t, 0.0, 8)
    assert np.allclose(means, 0.25 * np.arange(8) + 0.15)
    assert np.array_equal(number, np.full(8, 5.0))


@given(st.floats(1.0, 120.0), st.floats(0.0, 1.0))
@settings(max_examples=40, deadline=None)
def test_a_model_is_averaged_at_the_instants_of_the_samples(rate_hz: float, phase: float) -> None:
    """Whatever rate and phase a load cell has, a model that is right has its means."""
    step_s, begin_s, from_s, w = 0.05, 10.0, 12.5, 2.0 * np.pi / 5.0
    made = MeasuredLift(3000.0)
    t = begin_s + (np.arange(np.floor(20.0 * rate_hz)) + phase) / rate_hz
    made.tension.extend(t, 1e3 * np.sin(w * t))
    steps = begin_s + step_s * np.arange(1, 401)
    model = 1e3 * np.sin(w * steps)[:, None] * [1.0, 2.0]
    means, _ = made.means_of_pins(from_s, 30.0)
    found = made.sampled_means(model, begin_s, step_s, from_s)
    assert found.shape == (70, 2)
    known = np.isfinite(means)
    assert np.allclose(found[known, 0], means[known], atol=1e3 * (w * step_s) ** 2 / 8.0)
    assert np.allclose(found[:, 1], 2.0 * found[:, 0])
    even = model[:, 0].reshape(-1, 5).mean(axis=1)[10:]
    empty = ~np.isin(np.arange(70), np.ceil((t - from_s) / MEAN_S - 1e-6) - 1)
    assert np.allclose(found[empty, 0], even[empty])


def test_a_mean_of_too_few_samples_is_missing() -> None:
    """At least three of five."""
    t = 0.05 * np.arange(21)
    values = np.ones(21)
    values[[1, 2, 3]] = np.nan  # two of five are left
    values[[6, 7]] = np.nan  # three are left
    means, _ = interval_means(t, values, 0.0, 4)
    assert np.array_equal(np.isnan(means), [True, False, False, False])
    assert np.isnan(interval_means(t, values, 10.0, 4)[0]).all()


@given(st.integers(0, 10**6), st.integers(1, 3))
@settings(max_examples=40, deadline=None)
def test_spikes_go_and_a_ramp_stays(seed: int, length: int) -> None:
    """Up to three spikes in a row of 50 kN are dropped; nothing else of a 4 kN/s ramp is."""
    rng = np.random.default_rng(seed)
    values = 300e3 + 200.0 * np.arange(100) + 1000.0 * rng.standard_normal(100).clip(-2, 2)
    at = int(rng.integers(5, 90))
    values[at : at + length] += 50e3 * rng.choice([-1.0, 1.0])
    gone = np.isnan(without_spikes(0.05 * np.arange(len(values)), values, 15e3))
    assert np.array_equal(np.flatnonzero(gone), np.arange(at, at + length))


@pytest.mark.parametrize("count_n", [0.0, 10.0, 1000.0, 3000.0])
@pytest.mark.parametrize("noise_n", [0.0, 500.0])
def test_an_end_of_the_range_is_no_crest_of_a_coarse_sensor(count_n: float, noise_n: float) -> None:
    """A sine in counts repeats its crests too; at an end it stands for a fifth of the time."""
    times = 0.05 * np.arange(1200)
    force = 78e3 + 8500.0 * np.sin(2.0 * np.pi * times / 7.3)
    force += noise_n * np.random.default_rng(3).standard_normal(len(times))

    def counted(values: np.ndarray) -> np.ndarray:
        return count_n * np.round(values / count_n) if count_n else values

    assert not at_stops(counted(force)).any()
    limit = float(np.quantile(force, 0.8))
    cut = counted(np.minimum(force, limit))
    stopped = at_stops(cut)
    if count_n < 1000.0:
        assert np.array_equal(stopped, force >= limit) or count_n > 0.0
        assert stopped.mean() == pytest.approx(0.2, abs=0.02)
        assert np.array_equal(at_stops(-cut), stopped)
    assert not at_stops(np.full(100, 5.0)).any(), "a calm: no end of a range"
    assert not at_stops(np.full(100, np.nan)).any()


def test_samples_late_doubled_or_not_finite() -> None:
    """A series is sorted, keeps one sample of each time, and leaves out what is not finite."""
    series = Series(1)
    for t, x in ((3.0, 30.0), (1.0, 10.0), (1.0, 11.0), (2.0, np.nan), (np.inf, 1.0)):
        series.add(t, x)
    assert np.array_equal(series.table[:, 0], [1.0, 3.0])
    series.add(2.0, 20.0)
    assert np.array_equal(series.table[:, 1], [10.0, 20.0, 30.0])
    series.drop_before(2.0)
    assert np.array_equal(series.table[:, 0], [2.0, 3.0])
    assert series.newest_s == 3.0
    assert Series(2).newest_s == -np.inf


def test_heave_of_a_late_sensor_with_a_gain() -> None:
    """The true heave at t is exp(-h) times what was measured at t + δ, with its rate."""
    t = np.arange(10.0, 20.0, 0.05)
    w = 2.0 * np.pi / 8.0
    z, v = lift().heave_motion(t, delay_s=0.2, heave_gain=0.1)
    assert np.allclose(z, np.exp(-0.1) * np.sin(w * (t + 0.2)), atol=1e-6)
    assert np.allclose(v, np.exp(-0.1) * w * np.cos(w * (t + 0.2)), atol=1e-5)


def test_line_out_of_a_counter_in_centimetres() -> None:
    """A quintic over 15 samples takes the steps of a counter; its rate is that of the line."""
    made = lift()
    t = 0.05 * np.arange(1201)
    fine = 500.0 + 2.0 * t + 0.01 * t**2
    made.line_out = Series(1)
    made.line_out.extend(t, np.round(fine, 2))
    at = np.arange(5.0, 55.0, 0.05)
    line, speed = made.line_motion(at)
    assert np.abs(line - (500.0 + 2.0 * at + 0.01 * at**2)).max() < 0.005
    assert np.abs(speed - (2.0 + 0.02 * at)).max() < 0.06
    assert np.abs(speed - (2.0 + 0.02 * at)).std() < 0.02


@pytest.mark.parametrize("period_s", [1.3, 1.9])
def test_smoothing_leaves_the_line_at_short_axial_periods(period_s: float) -> None:
    """A line that swings keeps 99.8 % of its amplitude; its rate is the derivative between samples.

    A start of the winch rings a short rope by what its line has at the rope's own period.
    """
    w = 2.0 * np.pi / period_s
    t = 0.05 * np.arange(1201)
    made = MeasuredLift(100.0)
    made.line_out.extend(t, 100.0 + 0.1 * np.sin(w * t + 0.3))
    at = np.arange(10.0, 50.0, 0.0125)
    line, rate = made.line_motion(at)
    assert line == pytest.approx(100.0 + 0.1 * np.sin(w * at + 0.3), abs=2e-4)
    assert rate == pytest.approx(0.1 * w * np.cos(w * at + 0.3), abs=2e-3 * 0.1 * w)
    mean_rate = np.diff(line) / np.diff(at)
    assert 0.5 * (rate[1:] + rate[:-1]) == pytest.approx(mean_rate, abs=1e-3 * 0.1 * w)


def test_a_counter_in_centimetres_does_not_run_back() -> None:
    """A winch that slows down and stops goes on until it stands: stairs of a counter are no travel.

    A reversal of 1 mm would turn the friction of a sheave, which needs some 5 mm for all of it.
    """
    t = np.arange(0.0, 20.0, 0.05)
    slowing = np.clip(t - 5.0, 0.0, 10.0 / 3.0)
    for phase in np.linspace(0.0, 0.01, 11):
        x = phase + np.minimum(t, 5.0) + slowing - 0.15 * slowing**2
        made = MeasuredLift(100.0)
        made.line_out.extend(t, np.round(x / 0.01) * 0.01)
        line, _ = made.line_motion(t)
        assert np.minimum(np.diff(line), 0.0).sum() > -0.0008
        assert abs(line - x).max() < 0.01


def test_stairs_become_the_line_through_their_edges() -> None:
    """A line of 0.02 m/s by a counter of 0.1 m at 10 Hz: known to the way in half a sample."""
    t = np.arange(0.0, 60.0, 0.1)
    times, positions = without_stairs(t, np.round(0.02 * t / 0.1) * 0.1)
    edges = np.isin(times, t, invert=True)
    assert abs(positions - 0.02 * times)[edges].max() < 0.02 * 0.05 + 1e-9
    alike = np.full(600, 3000.0)
    assert np.array_equal(without_stairs(t, alike)[1], alike)
    fine = 3000.0 + np.sin(t)
    assert np.array_equal(without_stairs(t, fine)[1], fine)


def test_means_in_a_hole_of_heave_and_after_it_are_missing() -> None:
    """Tension that an unknown heave has moved is not compared, until the rope has forgotten it."""
    made = lift(120.0)
    table = made.heave.table
    made.heave = Series(2)
    kept = table[(table[:, 0] < 20.0) | (table[:, 0] > 25.0)]
    made.heave.extend(*kept.T)
    means, number = made.means_of_pins(0.0, 120.0)
    assert number == 5.0
    missing = np.flatnonzero(np.isnan(means)) * MEAN_S
    assert missing[0] == pytest.approx(19.75, abs=MEAN_S)
    assert missing[-1] == pytest.approx(25.0 + FORGETTING_S, abs=2 * MEAN_S)
    assert len(missing) * MEAN_S == pytest.approx(35.25, abs=3 * MEAN_S)


def test_what_is_known_and_forgotten() -> None:
    """The three series are known from the latest beginning to the earliest end."""
    made = lift()
    assert made.begin_s == 0.0
    assert made.known_until_s(0.5) == pytest.approx(59.5)
    made.drop_before(30.0)
    assert made.begin_s == 30.0
    assert MeasuredLift(1.0).begin_s == np.inf
    assert MeasuredLift(1.0).known_until_s(0.0) == -np.inf


def test_a_tension_that_has_stopped_is_not_waited_for() -> None:
    """It is missing from 5 s behind heave and line out on; before the first sample nothing is."""
    made = lift()
    made.tension = Series(1)
    assert made.known_until_s(0.0) == -np.inf
    made.tension.extend(np.array([0.0, 0.05, 20.0]), np.full(3, 3e5))
    assert made.known_until_s(0.0) == pytest.approx(55.0)
    made.tension.add(58.0, 3e5)
    assert made.known_until_s(0.0) == pytest.approx(58.0)


def test_rounding_of_a_line_counter_is_an_error_while_it_counts() -> None:
    """Counts of a centimetre have the spectrum of Δ²/12 up to half the rate, standing ones none."""
    series = MeasuredLift(100.0)
    t = np.arange(0.0, 100.0, 0.05)
    series.line_out.extend(t, np.round((100.0 + 0.2 * np.minimum(t, 50.0)) / 0.01) * 0.01)
    assert series.line_error_psd(10.0, 40.0) * 10.0 == pytest.approx(1e-4 / 12.0, rel=0.05)
    assert series.line_error_psd(60.0, 90.0) == 0.0


def test_a_steady_line_is_straight_and_its_start_is_kept() -> None:
    """Counts of a line at 0.5 m/s lie on it within a sixth of the resolution, ramps are as counted.

    Rounding at 2.5015 counts a sample is a saw tooth of 5 mm and some 80 s, which is no noise.
    """
    t = np.arange(0.0, 60.0, 0.05)
    ran = np.clip(t - 20.0, 0.0, None)
    true = np.where(ran < 2.0, 0.125 * ran**2, 0.5 * (ran - 1.0)) * 1.0006
    counts = np.round(true / 0.01) * 0.01
    made, straight = straightened(counts, 0.01)
    assert straight[(t > 2.0) & (t < 18.0)].all()
    assert straight[(t > 24.0) & (t < 58.0)].all()
    assert not straight[(t > 20.6) & (t < 21.8)].any()
    steady = (t > 24.0) & (t < 58.0)
    assert np.abs(counts - true)[steady].max() > 0.004
    assert np.abs(made - true)[steady].max() < 0.01 / 6.0
    start = (t > 20.6) & (t < 21.8)
    assert np.array_equal(made[start], counts[start])
    assert np.array_equal(made[t < 18.0], counts[t < 18.0])


def test_a_line_that_swings_is_not_straightened() -> None:
    """The swing of a compensator, ten counts of its counter, stays as it was counted."""
    t = np.arange(0.0, 60.0, 0.05)
    swing = np.round(0.1 * np.sin(2.0 * np.pi * t / 12.0) / 0.01) * 0.01
    made, straight = straightened(swing, 0.01)
    assert np.array_equal(made, swing)
    assert not straight.any()


def test_passages_that_return_have_the_counts_of_before() -> None:
    """Starts and stops are found, and known again; not where the counter is 3 mm further on."""
    t = np.arange(0.0, 120.0, 0.05)
    second = t % 60.0

    def there(since: np.ndarray) -> np.ndarray:
        ran = np.clip(since, 0.0, 18.0)
        end = np.clip(since - 16.0, 0.0, 2.0)
        return (
            0.125 * np.minimum(ran, 2.0) ** 2
            + 0.5 * np.clip(ran - 2.0, 0.0, None)
            - (0.125 * end**2)
        )

    line = 300.0 + there(second - 8.0) - there(second - 33.0)
    line[t >= 60.0] += np.where(t[t >= 60.0] >= 93.0, 0.003, 0.0)  # the second way back
    made = MeasuredLift(1000.0)
    made.line_out.extend(t, np.round(line / 0.01) * 0.01)
    first, second_minute = made.passages(2.0, 58.0), made.passages(62.0, 118.0)
    assert len(first) == len(second_minute) == 4
    for one, at in zip(first, (8.0, 24.0, 33.0, 49.0), strict=True):
        assert at - 1.5 < one.begin_s < at
        assert at + 2.0 < one.end_s < at + 3.5
        assert one.resolution_m == pytest.approx(0.01)
    same = [a.counts == b.counts for a, b in zip(first, second_minute, strict=True)]
    assert same == [True, True, False, False]
    assert len({one.counts for one in first}) == 4


def test_error_of_a_count_that_repeats_is_a_whole_one() -> None:
    """Smoothing leaves 11063/46189 of the variance of rounding; all where the line stands."""
    t = np.arange(0.0, 30.0, 0.05)
    ran = np.clip(t - 10.0, 0.0, None)
    line = np.where(ran < 2.0, 0.125 * ran**2, 0.5 * (ran - 1.0))
    made = MeasuredLift(1000.0)
    made.line_out.extend(t, np.round(line / 0.01) * 0.01)
    (start,) = [one for one in made.passages(2.0, 28.0) if one.begin_s < 10.0 < one.end_s]
    stands, moves = start.sd_at(np.array([start.begin_s, 11.8]))
    assert stands == pytest.approx(0.01 / np.sqrt(12.0))
    assert moves == pytest.approx(stands * np.sqrt(SMOOTHING_LEAVES))
    assert pytest.approx(11063.0 / 46189.0) == SMOOTHING_LEAVES
