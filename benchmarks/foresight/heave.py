"""Judgement of heave forecasts: coverage, skill and calibration on seas drawn by seed."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from benchmarks.foresight.seas import DrawnSea, motion_error, recorded_spectrum
from rope_twin.forecast.heave_process import (
    PAST_S,
    RECORD_S,
    SAMPLE_S,
    HeaveProcess,
    MeasuredWaves,
    MotionError,
)
from rope_twin.forecast.tension_forecast import ERROR_MARGIN
from rope_twin.sea.ship_motion import BoxHull, heave_response

Floats = NDArray[np.float64]
Progress = Callable[[int, int, str], None]

LEADS_S = (2.0, 5.0, 10.0, 20.0, 30.0, 45.0, 60.0)
SEED = 610_000
WHITE_M = 0.005
WAVES_S, WAVES_EVERY_S = 240.0, 2.0
NEAR = 4  # samples up to a lead that are judged with it


def crps_normal(mean: Floats, deviation: Floats, truth: Floats) -> Floats:
    """Return the continuous ranked probability score of normal forecasts, in the unit of `truth`.

    σ·(x·(2Φ(x) - 1) + 2φ(x) - 1/√π) with x = (y - μ)/σ (Gneiting and Raftery 2007, eq. 5 of
    section 4.2); arrays that broadcast against each other.
    """
    x = (truth - mean) / deviation
    density = np.exp(-0.5 * x * x) / math.sqrt(2.0 * math.pi)
    spread = x * (2.0 * ndtr(x) - 1.0) + 2.0 * density - 1.0 / math.sqrt(math.pi)
    return np.asarray(deviation * spread)


@dataclass(frozen=True)
class HeaveCase:
    """One way of measuring, in one sea."""

    sea: str
    motion_error_m: float = 0.0  # coloured, standard deviation
    waves_at_m: tuple[float, ...] = ()  # distances up-sea
    waves_noise: float = 0.3  # of the elevation's standard deviation


CASES = (
    HeaveCase("sea_2p5m"),
    HeaveCase("sea_2p5m", 0.02),
    HeaveCase("sea_6p5m"),
    HeaveCase("sea_6p5m", 0.04),
    HeaveCase("sea_2p5m", 0.02, (800.0,)),
    HeaveCase("sea_6p5m", 0.04, (800.0,)),
)


@dataclass(frozen=True)
class HeaveResult:
    """Figures of one case, by lead where they are rows."""

    case: HeaveCase
    origins: int
    coverage_pct: float  # of the 90 % band, all leads
    coverages_pct: tuple[float, ...]
    skills: tuple[float, ...]
    crps_gains: tuple[float, ...]
    pit_deciles_pct: tuple[float, ...]


def assumed_error(deviation_m: float) -> MotionError:
    """Return the sensor error that a forecast assumes for one of this size from 8 to 30 s.

    Its density in that band matches with a margin; a forecast does not know the true band.
    """
    return MotionError(white_m=WHITE_M, coloured_m=ERROR_MARGIN * deviation_m)


def judge_heave(case: HeaveCase, origins: int, progress: Progress, seed: int = SEED) -> HeaveResult:
    """Forecast the heave once in each of `origins` drawn seas and score all of them."""
    past, ahead = round(RECORD_S / SAMPLE_S), round(60.0 / SAMPLE_S)
    spectrum = recorded_spectrum(case.sea)
    off, miss, gains, climate = [], [], [], []
    for number in range(origins):
        if number % 24 == 0:
            progress(number, origins, f"heave of {case.sea}")
        random = np.random.default_rng(seed + number)
        sea = DrawnSea.draw(spectrum, random)
        truth = sea.heave_m(past + ahead, SAMPLE_S)
        measured = truth[:past] + WHITE_M * random.standard_normal(past)
        if case.motion_error_m:
            measured += motion_error(past, SAMPLE_S, case.motion_error_m, random)
        process = HeaveProcess.of_record(measured, assumed_error(case.motion_error_m))
        waves = _seen(sea, case, past, random) if case.waves_at_m else None
        response = heave_response(BoxHull(), process.spectrum.frequency_hz)
        paths = process.paths(measured, waves=waves, response=response).for_unknown_spectrum()
        future = slice(round(PAST_S / SAMPLE_S), None)
        mean, deviation = paths.mean_m[future], paths.deviation_m()[future]
        y = truth[past:]
        off.append((y - mean) / deviation)
        miss.append((y - mean) ** 2)
        gains.append(crps_normal(mean, deviation, y))
        spread = np.full(ahead, sea.heave_deviation_m)
        climate.append(crps_normal(np.zeros(ahead), spread, y))
    progress(origins, origins, f"heave of {case.sea}")
    return _scored(case, *(np.array(rows) for rows in (off, miss, gains, climate)))


def _seen(sea: DrawnSea, case: HeaveCase, past: int, random: np.random.Generator) -> MeasuredWaves:
    """Return elevations up-sea over the last WAVES_S, with noise."""
    count, every = round(WAVES_S / SAMPLE_S), round(WAVES_EVERY_S / SAMPLE_S)
    times, distances, values = [], [], []
    for distance in case.waves_at_m:
        own = sea.elevation_m(past, SAMPLE_S, distance)[past - count :: every]
        times.append((np.arange(count)[::every] - (count - 1.0)) * SAMPLE_S)
        distances.append(np.full(len(own), distance))
        values.append(own)
    seen = np.concatenate(values)
    noise = case.waves_noise * float(np.std(seen))
    reported = seen + noise * random.standard_normal(len(seen))
    return MeasuredWaves(np.concatenate(times), np.concatenate(distances), reported, noise)


def _scored(
    case: HeaveCase, off: Floats, miss: Floats, crps: Floats, climate: Floats
) -> HeaveResult:
    # the variance of climatology is that of the recorded spectrum
    frequency: Floats = np.linspace(2.5e-4, 0.5, 2000)
    response = heave_response(BoxHull(), frequency)
    density = recorded_spectrum(case.sea).density_at(frequency) * np.abs(response) ** 2
    variance = float(np.trapezoid(density, frequency))
    inside = np.abs(off) < 1.6448536
    ends = [round(lead / SAMPLE_S) for lead in LEADS_S]
    spans = [slice(max(end - NEAR, 0), end) for end in ends]
    deciles = np.histogram(ndtr(off[:, ::8]), 10, (0.0, 1.0))[0] / off[:, ::8].size
    return HeaveResult(
        case, len(off), 100.0 * float(inside.mean()),
        tuple(100.0 * float(inside[:, one].mean()) for one in spans),
        tuple(1.0 - float(miss[:, one].mean()) / variance for one in spans),
        tuple(1.0 - float(crps[:, one].mean() / climate[:, one].mean()) for one in spans),
        tuple(100.0 * float(share) for share in deciles),
    )  # fmt: skip


def heave_table(results: list[HeaveResult]) -> list[list[str]]:
    """Return a row for each case: coverage and skill by lead."""
    leads = [f"{lead:g} s" for lead in LEADS_S]
    rows = [["sea", "sensor error m", "waves at m", "coverage %", *leads, "skill", *leads]]
    for one in results:
        waves = "+".join(f"{d:g}" for d in one.case.waves_at_m) or "-"
        rows.append([
            one.case.sea, f"{one.case.motion_error_m:g}", waves, f"{one.coverage_pct:.1f}",
            *(f"{value:.0f}" for value in one.coverages_pct), "",
            *(f"{value:.2f}" for value in one.skills),
        ])  # fmt: skip
    return rows
