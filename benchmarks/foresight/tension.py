"""Judgement of tension forecasts and risks: hidden ropes in drawn seas, seen by faulty sensors.

A hidden rope has twice the elements and half the step of the members and figures drawn from the
spread that the forecast assumes. Eight of them share the lanes, each in a sea of its own; each is
forecast at four origins 75 s apart.
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from benchmarks.foresight.heave import WHITE_M, assumed_error
from benchmarks.foresight.seas import DrawnSea, motion_error, recorded_spectrum
from rope_twin.forecast.heave_process import (
    AHEAD_S,
    HIGHEST_HZ,
    LINE_HZ,
    LOWEST_HZ,
    RECORD_S,
    SAMPLE_S,
    HeaveProcess,
    HeaveSpectrum,
)
from rope_twin.forecast.recorded_lift import RAMP_S, nominal_states
from rope_twin.forecast.risk import ForecastVerification
from rope_twin.forecast.score import BAND, LeadScore, brier, score_lead
from rope_twin.forecast.tension_forecast import (
    MARGIN,
    TENSION,
    ForecastSettings,
    Observations,
    TensionForecast,
    TensionForecaster,
)
from rope_twin.scene.load import load_scene
from rope_twin.scene.schema import Scene
from rope_twin.sea.ship_motion import BoxHull, heave_response
from rope_twin.twin.ensemble.fleet import Fleet, FleetInputs

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Progress = Callable[[int, int, str], None]

LEADS_S = (2.0, 5.0, 10.0, 20.0, 30.0, 60.0)
SPANS_S = (10.0, 30.0, 60.0)
LIMITS = (0.5, 0.8)  # quantiles of a span's largest tension that a limit is put at
SEED = 720_000
SIDE_BY_SIDE = 8  # hidden ropes in lanes
ORIGINS_EACH, APART_S = 4, 75.0
PIN_FULL_SCALE_N, PIN_NOISE, PIN_HZ = 500e3, 0.0075, 20.0
TRUTH_FROM_S = 480.0  # before, only the heave is needed
NEAR = 4  # samples up to a lead that are judged with it


@dataclass(frozen=True)
class TensionCase:
    """One scene in one sea, with one motion sensor."""

    scene: str
    sea: str
    motion_error_m: float  # coloured, standard deviation; 0: a perfect sensor


CASES = (
    TensionCase("deep_lift", "sea_2p5m", 0.02),
    TensionCase("deep_lift", "sea_6p5m", 0.04),
    TensionCase("storm", "sea_6p5m", 0.04),
)


@dataclass(frozen=True)
class EventScore:
    """Brier score of one event over a span."""

    event: str
    span_s: float
    base_rate: float
    gain: float  # over climatology
    mean_probability: float
    classes: tuple[tuple[float, float, int], ...]  # probability, frequency, count


@dataclass(frozen=True)
class TensionResult:
    """Scores of one case."""

    case: TensionCase
    origins: int
    coverage_pct: float
    leads: tuple[LeadScore, ...]
    events: tuple[EventScore, ...]
    cpu_s: float  # of a forecast, mean
    factor: tuple[float, ...] = field(default=())  # of the spread at LEADS_S after the last origin


@dataclass(frozen=True)
class _Hidden:
    """Tension of hidden ropes, every SAMPLE_S from TRUTH_FROM_S on; (samples, ropes)."""

    top_n: Floats  # at the samples
    mean_n: Floats  # over the SAMPLE_S before, as a load pin's mean
    peak_n: Floats
    min_n: Floats


def sea_process(sea: str) -> HeaveProcess:
    """Return the process that drawn seas are samples of, seen by a sensor with white noise only."""
    lines_hz = LINE_HZ * np.arange(round((HIGHEST_HZ - LOWEST_HZ) / LINE_HZ), dtype=np.float64)
    frequency: Floats = np.asarray(LOWEST_HZ + lines_hz)
    gain = np.abs(heave_response(BoxHull(), frequency)) ** 2
    true = HeaveSpectrum(frequency, recorded_spectrum(sea).density_at(frequency) * gain)
    return HeaveProcess(true, HeaveSpectrum(frequency, 0.0 * frequency), WHITE_M)


class InformedForecaster(TensionForecaster):
    """Forecasts with the spectrum that the sea is drawn from, in place of that of a record."""

    def __init__(self, scene: Scene, settings: ForecastSettings, sea: str) -> None:
        super().__init__(scene, settings)
        self._process = sea_process(sea)

    def heave_process(self, heave_m: Floats) -> HeaveProcess:
        """Return the process of the sea, whatever the record."""
        return self._process


def judge_tension(
    case: TensionCase,
    origins: int,
    progress: Progress,
    settings: ForecastSettings | None = None,
    seed: int = SEED,
    limit: bool = False,
) -> TensionResult:
    """Forecast the tension at `origins` instants of drawn seas and score the forecasts.

    limit: of what past heave can tell at all: the forecast knows the spectrum of the sea and the
    figures of the rope, and a case should have a perfect sensor.

    The spread's factor follows the kept forecasts of the origins before.
    """
    own = settings or ForecastSettings(burn_in_s=119.0, members=96)
    deviation = PIN_NOISE * PIN_FULL_SCALE_N / np.sqrt(PIN_HZ * SAMPLE_S)
    own = dataclasses.replace(
        own, motion_error=assumed_error(case.motion_error_m), load_pin_deviation_n=float(deviation)
    )
    scene = load_scene(case.scene)
    if limit:
        own = dataclasses.replace(own, spread={})
    forecaster = (
        InformedForecaster(scene, own, case.sea) if limit else TensionForecaster(scene, own)
    )
    kept, shift_s, cpu_s = ForecastVerification(forecaster.leads), 0.0, 0.0
    scored: list[tuple[TensionForecast, Floats, Floats, Floats]] = []
    group = 0
    while len(scored) < origins:
        random = np.random.default_rng(seed + group)
        heave, measured = _seas(case, random)
        hidden = _hide(case, heave, own, random)
        at = [round((RECORD_S + APART_S * k) / SAMPLE_S) for k in range(ORIGINS_EACH)]
        line = np.full(len(heave), scene.ropes[0].length_m)
        before = round(own.burn_in_s / SAMPLE_S)
        starts = nominal_states(scene, measured, line, [one - before for one in at], own)
        for rope in range(SIDE_BY_SIDE):
            for number, sample in enumerate(at):
                if len(scored) == origins:
                    break
                progress(len(scored), origins, f"{case.scene} in {case.sea}")
                first = sample - round(RECORD_S / SAMPLE_S) + 1
                pin = np.full(sample + 1, np.nan)
                begins = round(TRUTH_FROM_S / SAMPLE_S)
                pin[begins + 1 :] = hidden.mean_n[: sample - begins, rope]
                pin += deviation * random.standard_normal(len(pin))
                known = Observations(
                    shift_s + sample * SAMPLE_S, measured[first : sample + 1, rope],
                    line[first : sample + 1], pin[first:],
                )  # fmt: skip
                began = time.thread_time()
                (made,) = forecaster.forecast(known, starts[number][rope], factor=kept.factor())
                cpu_s += time.thread_time() - began
                ahead = slice(sample - begins, sample - begins + round(AHEAD_S / SAMPLE_S))
                truth = hidden.top_n[ahead, rope]
                scored.append((made, truth, hidden.peak_n[ahead, rope], hidden.min_n[ahead, rope]))
                kept.add(made)
                for lead, value in zip(forecaster.leads, truth, strict=True):
                    kept.observe(made.origin_s + float(lead), float(value))
                shift_s += 2.0 * AHEAD_S  # so that origins of several seas follow each other
        group += 1
    progress(origins, origins, f"{case.scene} in {case.sea}")
    return _scored(case, scored, cpu_s / origins, kept.factor())


def _seas(case: TensionCase, random: np.random.Generator) -> tuple[Floats, Floats]:
    """Return true and measured heave of each rope, (samples, ropes)."""
    span_s = RECORD_S + APART_S * (ORIGINS_EACH - 1) + AHEAD_S + 1.0
    count = round(span_s / SAMPLE_S) + 1
    spectrum = recorded_spectrum(case.sea)
    rows, known = [], []
    for _ in range(SIDE_BY_SIDE):
        heave = DrawnSea.draw(spectrum, random).heave_m(count, SAMPLE_S)
        seen = heave + WHITE_M * random.standard_normal(count)
        if case.motion_error_m:
            seen += motion_error(count, SAMPLE_S, case.motion_error_m, random)
        rows.append(heave)
        known.append(seen)
    return np.array(rows).T, np.array(known).T


def _hide(
    case: TensionCase, heave: Floats, own: ForecastSettings, random: np.random.Generator
) -> _Hidden:
    """Run the hidden ropes in their seas."""
    from scipy.interpolate import CubicSpline

    step_s = 0.5 * own.step_s
    fleet = Fleet(case.scene, SIDE_BY_SIDE, elements=2 * own.elements, step_s=step_s)
    draws = {name: random.standard_normal(SIDE_BY_SIDE) for name in own.spread}
    fleet.set_figures(
        {name: np.exp(own.spread[name] * draw) for name, draw in draws.items()
         if name in fleet.figures}
    )  # fmt: skip
    spline = CubicSpline(SAMPLE_S * np.arange(len(heave)), heave)
    end_s = SAMPLE_S * (len(heave) - 1)
    at = TRUTH_FROM_S + step_s * np.arange(round((end_s - TRUTH_FROM_S) / step_s) + 1)
    begun = np.clip((at - TRUTH_FROM_S) / RAMP_S, 0.0, 1.0)[:, None]
    share = begun**3 * (10.0 - 15.0 * begun + 6.0 * begun**2)
    slope = 30.0 * begun**2 * (1.0 - begun) ** 2 / RAMP_S
    z, v = spline(at), spline(at, 1)
    line = np.full(len(at), fleet.scene.ropes[0].length_m)
    per = round(SAMPLE_S / step_s)
    record = fleet.advance(FleetInputs(share * z, share * v + slope * z, line, 0.0 * line), per)
    tops = record.top_tension_n[: len(record.top_tension_n) // per * per]
    tops = tops.reshape(-1, per, SIDE_BY_SIDE)
    return _Hidden(tops[:, -1], tops.mean(axis=1), tops.max(axis=1), record.min_tension_n)


def _scored(
    case: TensionCase,
    scored: list[tuple[TensionForecast, Floats, Floats, Floats]],
    cpu_s: float,
    factor: Floats,
) -> TensionResult:
    members = np.array([made.values[TENSION].T for made, *_ in scored])  # origins, members, leads
    truth = np.array([row[1] for row in scored])
    climate = truth.ravel()
    leads = []
    for lead in LEADS_S:
        end = round(lead / SAMPLE_S)
        own = slice(max(end - NEAR, 0), end)
        leads.append(score_lead(lead, members[:, :, own], truth[:, own], climate))
    bands = np.array([made.band() for made, *_ in scored])
    inside = (truth >= bands[:, 0]) & (truth <= bands[:, 2])
    at = [round(lead / SAMPLE_S) - 1 for lead in LEADS_S]
    return TensionResult(
        case, len(scored), 100.0 * float(inside.mean()), tuple(leads), _events(scored), cpu_s,
        tuple(float(factor[k]) for k in at),
    )  # fmt: skip


def _events(
    scored: list[tuple[TensionForecast, Floats, Floats, Floats]],
) -> tuple[EventScore, ...]:
    """Score exceedance of limits, and slack where it is neither certain nor impossible."""
    found = []
    for span in SPANS_S:
        count = round(span / SAMPLE_S)
        highest = np.array([row[2][:count].max() for row in scored])
        forecast = np.array([made.peak_n[:count].max(axis=0) for made, *_ in scored])
        for share in LIMITS:
            limit = float(np.quantile(highest, share))
            name = f"T > {limit / 1e3:.0f} kN"
            found.append(_event(name, span, (forecast > limit).mean(axis=1), highest > limit))
        loose = np.array([(row[3][:count] <= 0.0).any() for row in scored])
        if loose.any() and not loose.all():
            chance = [
                (made.values[MARGIN][:count] <= 0.0).any(axis=0).mean() for made, *_ in scored
            ]
            found.append(_event("slack", span, np.array(chance), loose))
    return tuple(found)


def _event(name: str, span: float, probability: Floats, happened: Bools) -> EventScore:
    own = brier(probability, happened)
    classes = tuple((one.probability, one.frequency, one.count) for one in own.classes)
    return EventScore(name, span, own.base_rate, own.gain, float(probability.mean()), classes)


def lead_table(results: list[TensionResult]) -> list[list[str]]:
    """Return a row for each case: coverage, skill and CRPS gain by lead."""
    leads = [f"{lead:g} s" for lead in LEADS_S]
    rows = [["scene", "sea", "sensor error m", "origins", "score", "all", *leads]]
    for one in results:
        head = [one.case.scene, one.case.sea, f"{one.case.motion_error_m:g}", str(one.origins)]
        cover = [f"{100.0 * lead.coverage:.0f}" for lead in one.leads]
        rows.append([*head, f"within {100 * (BAND[2] - BAND[0]):.0f} % band, %",
                     f"{one.coverage_pct:.1f}", *cover])  # fmt: skip
        blank = [""] * len(head)
        for name in ("skill", "crps_gain", "width"):
            values = [f"{getattr(lead, name):.2f}" for lead in one.leads]
            rows.append([*blank, name.replace("_", " "), "", *values])
        rows.append([*blank, "spread factor", "", *(f"{value:.2f}" for value in one.factor)])
    return rows


def event_table(results: list[TensionResult]) -> list[list[str]]:
    """Return a row for each event: base rate, gain of the Brier score, reliability."""
    rows = [["scene", "sea", "event", "within s", "base rate", "gain %", "mean p", "p: came (n)"]]
    for one in results:
        for event in one.events:
            classes = ", ".join(f"{p:.2f}: {o:.2f} ({n})" for p, o, n in event.classes)
            rows.append([
                one.case.scene, one.case.sea, event.event, f"{event.span_s:g}",
                f"{event.base_rate:.2f}", f"{100.0 * event.gain:.0f}",
                f"{event.mean_probability:.2f}", classes,
            ])  # fmt: skip
    return rows
