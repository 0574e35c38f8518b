"""Heave process: closed forms of known processes, calibration on drawn seas, waves up-sea."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import ndtr

from benchmarks.foresight.seas import DrawnSea, motion_error, recorded_spectrum
from benchmarks.foresight.tension import sea_process
from rope_twin.errors import InputError
from rope_twin.forecast.heave_process import (
    AHEAD_S,
    LINE_HZ,
    LOWEST_HZ,
    PAST_S,
    SAMPLE_S,
    HeaveProcess,
    HeaveSpectrum,
    MeasuredWaves,
    MotionError,
    condition,
    heave_spectrum,
)
from rope_twin.sea.ship_motion import BoxHull, heave_response

PERFECT = MotionError(white_m=0.005, coloured_m=0.0)
RECORD = 1200  # samples of 0.5 s
LEADS_S = (2.0, 5.0, 10.0, 20.0, 30.0, 60.0)


def sample_of(lead_s: float) -> int:
    """Return the place of a lead in a forecast of the usual past."""
    return round((PAST_S + lead_s) / SAMPLE_S) - 1


@given(
    memory_s=st.floats(1.0, 50.0),
    deviation_m=st.floats(0.01, 10.0),
    values=st.lists(st.floats(-20.0, 20.0), min_size=2, max_size=12),
)
def test_markov_process(memory_s: float, deviation_m: float, values: list[float]) -> None:
    """Ornstein-Uhlenbeck: mean e^(-τ/T)·z0, variance σ²·(1 - e^(-2τ/T)) (Uhlenbeck 1930)."""
    past, ahead = len(values), 5
    at = np.arange(past + ahead) * 1.0
    covariance = deviation_m**2 * np.exp(-np.abs(at[:, None] - at) / memory_s)
    mean, spread = condition(
        covariance[past:, past:], covariance[past:, :past], covariance[:past, :past],
        np.array(values),
    )  # fmt: skip
    lead = 1.0 + np.arange(ahead)
    assert mean == pytest.approx(np.exp(-lead / memory_s) * values[-1], rel=1e-7, abs=1e-7)
    exact = deviation_m**2 * (1.0 - np.exp(-2.0 * lead / memory_s))
    assert np.diag(spread) == pytest.approx(exact, rel=1e-7)


def test_welch_spectrum_is_that_of_scipy() -> None:
    """An independent implementation with the same windows."""
    from scipy.signal import welch

    heave = DrawnSea.draw(recorded_spectrum("sea_2p5m"), np.random.default_rng(1))
    record = heave.heave_m(RECORD, SAMPLE_S)
    frequency, density = welch(record, 2.0, window="hann", nperseg=400, detrend="constant")
    ours = heave_spectrum(record)
    theirs = np.interp(ours.frequency_hz, frequency, density)
    assert ours.density_m2_per_hz == pytest.approx(theirs, rel=1e-9)


def test_spectrum_of_a_sine() -> None:
    """Variance a²/2, autocovariance a²/2·cos ωτ at lags far below the window's length."""
    at = np.arange(RECORD) * SAMPLE_S
    found = heave_spectrum(3.0 * np.sin(2.0 * np.pi * at / 10.0))
    assert found.variance_m2 == pytest.approx(4.5, rel=2e-3)
    lag = np.array([0.0, 2.5, 5.0])
    assert found.autocovariance(lag) == pytest.approx(4.5 * np.cos(0.2 * np.pi * lag), abs=0.05)


def test_sensor_error_is_taken_off_the_spectrum() -> None:
    """True heave and error add up to what was measured, and no part is negative."""
    record = DrawnSea.draw(recorded_spectrum("sea_1p2m"), np.random.default_rng(2)).heave_m(
        RECORD, SAMPLE_S
    )
    process = HeaveProcess.of_record(record, MotionError(coloured_m=0.1))
    whole = process.spectrum.density_m2_per_hz + process.error.density_m2_per_hz
    assert whole == pytest.approx(heave_spectrum(record).density_m2_per_hz)
    assert (process.spectrum.density_m2_per_hz >= 0.5 * whole - 1e-15).all()
    assert process.error.variance_m2 <= 0.01 * (1 + 1e-9)


def test_measured_instants_are_known_to_the_noise() -> None:
    """Without a coloured error the past is known better than one sample alone reports it."""
    record = DrawnSea.draw(recorded_spectrum("sea_2p5m"), np.random.default_rng(3)).heave_m(
        RECORD, SAMPLE_S
    )
    paths = HeaveProcess.of_record(record, PERFECT).paths(record)
    past = paths.lead_s <= 0.0
    assert paths.deviation_m()[past].max() < PERFECT.white_m
    assert paths.mean_m[past] == pytest.approx(record[-past.sum() :], abs=0.02)
    assert paths.skill()[sample_of(60.0)] == pytest.approx(0.0, abs=0.1)
    assert paths.lead_s[-1] == AHEAD_S


def test_drawn_paths_have_mean_and_covariance() -> None:
    """Sample moments within five standard errors, correlations by one linear combination each."""
    record = DrawnSea.draw(recorded_spectrum("sea_2p5m"), np.random.default_rng(4)).heave_m(
        RECORD, SAMPLE_S
    )
    paths = HeaveProcess.of_record(record, MotionError()).paths(record)
    members = 4000
    drawn = paths.draw(members, np.random.default_rng(5))
    off = (drawn.mean(axis=0) - paths.mean_m) / paths.deviation_m()
    assert np.abs(off).max() < 5.0 / np.sqrt(members)
    for weight in np.random.default_rng(6).standard_normal((8, len(paths.mean_m))):
        exact = weight @ paths.covariance_m2 @ weight
        assert np.var(drawn @ weight) == pytest.approx(exact, rel=5.0 * np.sqrt(2.0 / members))


@pytest.mark.parametrize(
    ("sea", "sensor_error_m", "error"),
    [
        pytest.param("sea_2p5m", 0.0, PERFECT, id="perfect sensor", marks=pytest.mark.long),
        pytest.param("sea_6p5m", 0.04, MotionError(coloured_m=0.064), id="coloured error"),
    ],
)
def test_bands_are_calibrated(sea: str, sensor_error_m: float, error: MotionError) -> None:
    """90 % bands over 60 drawn seas: mean square of the normalised error near 1, PIT flat."""
    seas, off, skills = 60, [], []
    for seed in range(seas):
        random = np.random.default_rng(40_000 + seed)
        truth = DrawnSea.draw(recorded_spectrum(sea), random).heave_m(RECORD + 120, SAMPLE_S)
        measured = truth + 0.005 * random.standard_normal(len(truth))
        if sensor_error_m:
            measured += motion_error(len(truth), SAMPLE_S, sensor_error_m, random)
        paths = HeaveProcess.of_record(measured[:RECORD], error).paths(measured[:RECORD])
        paths = paths.for_unknown_spectrum()
        ahead = slice(sample_of(0.0) + 1, None)
        off.append((truth[RECORD:] - paths.mean_m[ahead]) / paths.deviation_m()[ahead])
        skills.append(paths.skill()[ahead])
    z = np.array(off)
    inside = np.abs(z) < 1.6449
    assert 0.86 <= inside.mean() <= 0.94
    # one lead: 60 independent seas, standard error 3.9 points
    assert all(0.78 <= inside[:, round(s / SAMPLE_S) - 1].mean() <= 1.0 for s in LEADS_S)
    deciles = np.histogram(ndtr(z[:, ::8]).ravel(), 10, (0.0, 1.0))[0] / z[:, ::8].size
    assert deciles.min() > 0.06
    assert deciles.max() < 0.14
    assert np.mean(skills, axis=0)[9] > 0.9  # at 5 s
    assert np.mean(skills, axis=0)[-1] < 0.05


def test_waves_up_sea_carry_the_horizon() -> None:
    """Elevation 800 m ahead with 30 % noise: heave skill 0.9 at 45 s, where alone it is none."""
    alone, ahead = [], []
    for seed in range(12):
        random = np.random.default_rng(50_000 + seed)
        sea = DrawnSea.draw(recorded_spectrum("sea_6p5m"), random)
        truth = sea.heave_m(RECORD + 120, SAMPLE_S)
        measured = truth[:RECORD] + 0.005 * random.standard_normal(RECORD)
        process = HeaveProcess.of_record(measured, PERFECT)
        seen = sea.elevation_m(RECORD, SAMPLE_S, 800.0)[RECORD - 480 :: 4]
        noise = 0.3 * float(np.std(seen))
        waves = MeasuredWaves(
            (np.arange(480)[::4] - 479.0) * SAMPLE_S, np.full(len(seen), 800.0),
            seen + noise * random.standard_normal(len(seen)), noise,
        )  # fmt: skip
        response = heave_response(BoxHull(), process.spectrum.frequency_hz)
        at = sample_of(45.0)
        for kept, paths in (
            (alone, process.paths(measured)),
            (ahead, process.paths(measured, waves=waves, response=response)),
        ):
            window = slice(at - 20, at + 20)
            future = truth[RECORD:][window.start - sample_of(0.0) - 1 :][:40]
            kept.append(np.mean((paths.mean_m[window] - future) ** 2) / np.var(truth))
    assert 1.0 - np.mean(ahead) > 0.9
    assert 1.0 - np.mean(alone) < 0.3


def test_wave_where_the_ship_is() -> None:
    """A ship that follows the surface, measured where it is: heave is known to the wave's noise."""
    frequency = LOWEST_HZ + LINE_HZ * np.arange(200)
    density = np.exp(-(((frequency - 0.1) / 0.02) ** 2))
    process = HeaveProcess(
        HeaveSpectrum(frequency, density), HeaveSpectrum(frequency, 0.0 * density), 10.0
    )  # the motion sensor knows nothing
    lead = np.arange(-60.0, 61.0)
    truth = 0.1 * np.cos(0.2 * np.pi * lead)
    waves = MeasuredWaves(lead, np.zeros(121), truth, 1e-3)
    paths = process.paths(np.zeros(240), waves=waves, response=np.ones(200, complex))
    near = np.isin(paths.lead_s, lead)
    assert paths.mean_m[near] == pytest.approx(truth, abs=5e-3)
    assert paths.deviation_m()[near].max() < 1.1e-3


def test_widened_variances() -> None:
    """Each variance by its factor, correlations kept."""
    record = DrawnSea.draw(recorded_spectrum("sea_1p2m"), np.random.default_rng(7)).heave_m(
        RECORD, SAMPLE_S
    )
    paths = HeaveProcess.of_record(record, MotionError()).paths(record)
    factor = np.linspace(1.0, 2.0, len(paths.lead_s))
    wide = paths.widened(factor)
    assert wide.deviation_m() == pytest.approx(paths.deviation_m() * np.sqrt(factor))
    assert wide.covariance_m2[5, 300] == pytest.approx(
        paths.covariance_m2[5, 300] * np.sqrt(factor[5] * factor[300])
    )


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: heave_spectrum(np.ones(1200)), "lies still"),
        (lambda: heave_spectrum(np.zeros(100)), "50 s of it are known"),
        (lambda: heave_spectrum(np.full(1200, np.nan)), "it has gaps"),
        (lambda: MotionError(white_m=0.0), "white part"),
        (lambda: MotionError(coloured_m=np.inf), "coloured part"),
        (lambda: MotionError(band_hz=(0.2, 0.1)), "band"),
        (lambda: MeasuredWaves(np.zeros(2), np.zeros(2), np.zeros(3), 0.1), "as many of each"),
        (lambda: MeasuredWaves(np.zeros(2), np.zeros(2), np.zeros(2), 0.0), "noise"),
        (lambda: MeasuredWaves(np.zeros(1), np.zeros(1), np.array([np.nan]), 0.1), "elevation"),
    ],
)
def test_refusals(call: object, words: str) -> None:
    """One sentence that names the fault."""
    with pytest.raises(InputError, match=words):
        call()  # type: ignore[operator]


def test_refusals_of_paths() -> None:
    """Too short a past, waves without a response, waves from beyond the period of the process."""
    record = np.sin(np.arange(1200) * 0.3)
    process = HeaveProcess.of_record(record, MotionError())
    waves = MeasuredWaves(np.zeros(1), np.array([800.0]), np.zeros(1), 0.1)
    with pytest.raises(InputError, match="needs 120 s"):
        process.paths(record[:100])
    with pytest.raises(InputError, match="no response"):
        process.paths(record, waves=waves)
    far = MeasuredWaves(np.zeros(1), np.array([1e5]), np.zeros(1), 0.1)
    response = np.ones(len(process.spectrum.frequency_hz), complex)
    with pytest.raises(InputError, match="from the origin"):
        process.paths(record, waves=far, response=response)


@pytest.mark.parametrize("sea", ["sea_2p5m", "sea_6p5m"])
def test_drawn_seas_have_the_spectrum_that_the_limit_of_a_forecast_knows(sea: str) -> None:
    """Their mean variance is the process's: 200 seas of some 30 independent lines each."""
    random = np.random.default_rng(7)
    drawn = [DrawnSea.draw(recorded_spectrum(sea), random).heave_deviation_m for _ in range(200)]
    assert np.mean(np.square(drawn)) == pytest.approx(
        sea_process(sea).spectrum.variance_m2, rel=0.02
    )
