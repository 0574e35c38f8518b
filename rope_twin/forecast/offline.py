"""Forecasts over a recording, at one origin or at many, and what they were worth."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rope_twin.errors import InputError
from rope_twin.forecast.heave_process import AHEAD_S, SAMPLE_S
from rope_twin.forecast.orders import CONTINUE, Order
from rope_twin.forecast.recorded_lift import (
    RecordedLift,
    line_to_contact_m,
    nominal_states,
    seabed_depth_m,
)
from rope_twin.forecast.risk import SPANS_S, ForecastVerification
from rope_twin.forecast.score import BrierScore, LeadScore, brier, coverage, score_lead
from rope_twin.forecast.tension_forecast import (
    TENSION,
    ForecastSettings,
    TensionForecast,
    TensionForecaster,
)
from rope_twin.twin.ensemble.fleet import FleetState

Floats = NDArray[np.float64]
Progress = Callable[[int, int, str], None]

SCORED_LEADS_S = (2.0, 5.0, 10.0, 20.0, 30.0, 60.0)
NEIGHBOUR_SAMPLES = 4  # samples up to a lead that are pooled with it
MIN_ORIGINS = 2


@dataclass(frozen=True)
class EventScore:
    """Score of P(top tension > limit) over a span, of the main winch's rope."""

    span_s: float
    score: BrierScore


@dataclass(frozen=True)
class RecordingScore:
    """Worth of the forecasts of a recording."""

    origins: int
    limit_n: float
    coverage: float  # of the 90 % band, all leads
    leads: tuple[LeadScore, ...]
    events: tuple[EventScore, ...]
    factor: tuple[float, ...]  # on the spread at SCORED_LEADS_S, after the last origin


class RecordingForecaster:
    """Forecasts a recorded lift at any of its instants."""

    def __init__(
        self,
        lift: RecordedLift,
        settings: ForecastSettings | None = None,
        planned: bool = False,
    ) -> None:
        """Build the fleet.

        planned: the winch follows the recorded line out after an origin; else it continues.

        Raises:
            RopeTwinError: the scene cannot be stepped.
        """
        self.lift, self.planned = lift, planned
        self.settings = settings or ForecastSettings()
        self.depth_m = seabed_depth_m(lift.scene)
        self._forecaster = TensionForecaster(lift.scene, self.settings)
        self.verification = ForecastVerification(self._forecaster.leads)
        self.pin_faults: list[str] = []  # why the load pin was left out, for each such origin

    def sample_of(self, time_s: float | None) -> int:
        """Return the sample of an origin; None: the newest one of the recording.

        Raises:
            InputError: before that no forecast is possible, or beyond the recording.
        """
        last = len(self.lift.heave_m) - 1
        if time_s is None:
            return last
        sample = round((time_s - self.lift.begin_s) / SAMPLE_S)
        first = self.lift.first_origin
        if not first <= sample <= last:
            low, high = first * SAMPLE_S, last * SAMPLE_S
            problem = f"{time_s:g} s is not possible"
            raise InputError("origin", problem, f"give {low:g} to {high:g} s")
        return sample

    def at(self, sample: int, orders: Sequence[Order]) -> list[TensionForecast]:
        """Return the forecasts of one origin, on the same heave paths."""
        (states,) = self._states([sample])
        return self._forecast(sample, states, orders)

    def score(self, every_s: float, limit_n: float, progress: Progress) -> RecordingScore:
        """Forecast at origins `every_s` apart and score them against the recording.

        The factor on the spread follows from earlier forecasts.

        Raises:
            InputError: fewer than two origins fit, or the tension does not vary.
        """
        lift, leads = self.lift, round(AHEAD_S / SAMPLE_S)
        step = max(round(every_s / SAMPLE_S), 1)
        samples = list(range(lift.first_origin, len(lift.heave_m) - leads, step))
        if len(samples) < MIN_ORIGINS:
            problem = f"{len(samples)} origins {every_s:g} s apart fit"
            raise InputError("score", problem, "give a longer recording or a shorter interval")
        forecasts = []
        for number, (sample, states) in enumerate(zip(samples, self._states(samples), strict=True)):
            progress(number, len(samples), f"forecast at {lift.begin_s + sample * SAMPLE_S:g} s")
            forecasts += self._forecast(sample, states, (Order(CONTINUE),))
            self.verification.add(forecasts[-1])
            until = samples[number + 1] if number + 1 < len(samples) else sample + leads
            for k in range(sample + 1, until + 1):
                self.verification.observe(lift.begin_s + k * SAMPLE_S, float(lift.tension_n[k]))
        progress(len(samples), len(samples), "scored")
        return self._scored(forecasts, samples, limit_n)

    def _states(self, samples: list[int]) -> list[FleetState]:
        """Return the rope's state a burn-in before each origin."""
        settings, lift = self.settings, self.lift
        burn_in = round(settings.burn_in_s / SAMPLE_S)
        burn_in_samples = [sample - burn_in for sample in samples]
        states = nominal_states(
            lift.scene, lift.heave_m, lift.line_out_m, burn_in_samples, settings, lift.lines_m
        )
        return [ropes[0] for ropes in states]

    def _forecast(
        self, sample: int, start: FleetState, orders: Sequence[Order]
    ) -> list[TensionForecast]:
        to_contact = line_to_contact_m(self.lift.scene, float(self.lift.line_out_m[sample]))
        observed = self.lift.known_at(sample, to_contact)
        plans = self.lift.plans_at(sample, self.settings, AHEAD_S) if self.planned else None
        factor = self.verification.factor()
        forecasts = self._forecaster.forecast(observed, start, orders, factor, plans)
        self.pin_faults += [fault] if (fault := self._forecaster.pin_fault) else []
        return forecasts

    def _scored(
        self, forecasts: list[TensionForecast], samples: list[int], limit_n: float
    ) -> RecordingScore:
        lift, samples_ahead = self.lift, round(AHEAD_S / SAMPLE_S)
        truth = np.array([lift.tension_n[k + 1 : k + 1 + samples_ahead] for k in samples])
        peak = np.array([lift.peak_n[k + 1 : k + 1 + samples_ahead] for k in samples])
        complete = np.isfinite(truth).all(axis=1)
        if int(complete.sum()) < MIN_ORIGINS:
            remedy = "give a recording of it without gaps"
            raise InputError("score", "the tension after the origins is missing", remedy)
        climate = lift.tension_n[np.isfinite(lift.tension_n)]
        members = np.array([forecast.values[TENSION].T for forecast in forecasts])[complete]
        bands = np.array([forecast.band() for forecast in forecasts])[complete]
        lead_scores = []
        for lead in SCORED_LEADS_S:
            end = round(lead / SAMPLE_S)
            window = slice(max(end - NEIGHBOUR_SAMPLES, 0), end)
            lead_scores.append(
                score_lead(lead, members[:, :, window], truth[complete][:, window], climate)
            )
        events = []
        for span in SPANS_S:
            count = round(span / SAMPLE_S)
            stated = np.array(
                [(forecast.peak_n[:count].max(axis=0) > limit_n).mean() for forecast in forecasts]
            )
            occurred = np.nanmax(peak[complete, :count], axis=1) > limit_n
            events.append(EventScore(span, brier(stated[complete], occurred)))
        factor, scored = (
            self.verification.factor(),
            [round(s / SAMPLE_S) - 1 for s in SCORED_LEADS_S],
        )
        return RecordingScore(
            int(complete.sum()), limit_n, coverage(bands[:, 0], bands[:, 2], truth[complete]),
            tuple(lead_scores), tuple(events), tuple(float(factor[k]) for k in scored),
        )  # fmt: skip
