"""Scores of forecasts against what happened: coverage, skill, CRPS, Brier score and reliability.

Each is zero or one for a perfect forecast and, as a gain, zero for climatology, the forecast from
the sea state alone.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rope_twin.errors import InputError

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

BAND = (0.05, 0.5, 0.95)  # quantiles of a band
BINS = 5  # of forecast probability, in a table of reliability


def crps_members(members: Floats, truth: Floats) -> Floats:
    """Return the continuous ranked probability score of an ensemble, in the unit of `truth`.

    mean|X - y| - mean|X - X'|/2 (Gneiting and Raftery 2007, eq. 21). members: (n, ...); truth and
    result: (...). Members that are not finite make the score not finite.
    """
    count = len(members)
    ordered = np.sort(members, axis=0)
    weight = (2.0 * np.arange(1, count + 1) - count - 1.0) / count**2
    spread = np.tensordot(weight, ordered, axes=1)  # half the mean difference of two members
    return np.asarray(np.abs(members - truth).mean(axis=0) - spread)


def member_quantiles(members: Floats) -> Floats:
    """Return the quantiles BAND over the members, axis 1, (3, ...).

    By rank p·(n + 1) (Weibull 1939; type 6 of Hyndman and Fan 1996), with which the band of
    exchangeable members covers its nominal fraction for any n ≥ 19; interpolation between the
    extreme ranks as if they were the ends covers 0.9·(n - 1)/(n + 1).
    """
    return np.asarray(np.quantile(members, BAND, axis=1, method="weibull"))


def coverage(lower: Floats, upper: Floats, truth: Floats) -> float:
    """Return the fraction of truths inside their bands; NaN without any."""
    inside = (truth >= lower) & (truth <= upper)
    return float(inside.mean()) if inside.size else math.nan


def skill(forecast: Floats, truth: Floats, climate_variance: float) -> float:
    """Return 1 - mean square error over the variance of climatology (Murphy 1988, eq. 4)."""
    return 1.0 - float(np.mean((forecast - truth) ** 2)) / climate_variance


@dataclass(frozen=True)
class Reliability:
    """Forecast probabilities of one class, and the observed frequency of the event."""

    probability: float  # mean of the forecasts
    frequency: float  # of the event
    count: int


@dataclass(frozen=True)
class BrierScore:
    """Brier score (1950) of probability forecasts with its parts (Murphy 1973, eq. 12).

    score = reliability - resolution + uncertainty + within, where `within` is the variance of
    forecasts within a class (Stephenson, Coelho and Jolliffe 2008); climatology's score is
    the uncertainty b·(1 - b) of the base rate b.
    """

    score: float
    reliability: float
    resolution: float
    uncertainty: float
    within: float
    base_rate: float
    count: int
    classes: tuple[Reliability, ...]

    @property
    def gain(self) -> float:
        """Fraction by which the score is better than climatology; NaN for a certain event."""
        return 1.0 - self.score / self.uncertainty if self.uncertainty > 0.0 else math.nan


def brier(probability: Floats, happened: Bools) -> BrierScore:
    """Return the score of probabilities (n,) of an event that happened or not (n,).

    Raises:
        InputError: none, unequal lengths, or a probability outside 0 to 1.
    """
    p, o = np.asarray(probability, np.float64), np.asarray(happened, np.float64)
    if p.shape != o.shape or p.ndim != 1 or not len(p):
        problem = f"{p.size} probabilities of {o.size} events"
        raise InputError("Brier score", problem, "give as many of each, and at least one")
    if not ((p >= 0.0) & (p <= 1.0)).all():
        raise InputError("Brier score", "a value is no probability", "right is 0 to 1")
    base = float(o.mean())
    group = np.minimum((p * BINS).astype(np.int64), BINS - 1)
    classes, reliability, resolution, within = [], 0.0, 0.0, 0.0
    for k in range(BINS):
        in_class = group == k
        count = int(in_class.sum())
        if not count:
            continue
        stated, observed = float(p[in_class].mean()), float(o[in_class].mean())
        weight = count / len(p)
        reliability += weight * (stated - observed) ** 2
        resolution += weight * (observed - base) ** 2
        spread = p[in_class] - stated
        within += weight * float(np.mean(spread**2 - 2.0 * spread * (o[in_class] - observed)))
        classes.append(Reliability(stated, observed, count))
    return BrierScore(
        float(np.mean((p - o) ** 2)), reliability, resolution, base * (1.0 - base), within, base,
        len(p), tuple(classes),
    )  # fmt: skip


@dataclass(frozen=True)
class LeadScore:
    """Scores of a quantity at one lead, over all origins."""

    lead_s: float
    origins: int
    coverage: float  # of the 90 % band
    skill: float  # of the mean
    crps: float  # in the unit of the quantity
    crps_gain: float  # against climatology
    width: float  # of the 90 % band over that of climatology


def score_lead(lead_s: float, members: Floats, truth: Floats, climate: Floats) -> LeadScore:
    """Return the scores at a lead.

    members: (origins, members, samples) near the lead; truth: (origins, samples); climate: (n,)
    values of the quantity that climatology is made of, at least two different ones.

    Raises:
        InputError: no origin, or a climatology without spread.
    """
    if not len(members) or float(np.var(climate)) <= 0.0:
        problem = f"{len(members)} forecasts, {len(climate)} values of climatology"
        raise InputError("score", problem, "give at least one forecast and a quantity that varies")
    low, high = member_quantiles(members)[::2]
    forecast_crps = float(crps_members(np.moveaxis(members, 1, 0), truth).mean())
    quantiles = np.quantile(climate, (np.arange(200) + 0.5) / 200)
    climate_crps = float(crps_members(quantiles[:, None], truth.reshape(-1)).mean())
    band = float(np.subtract(*np.quantile(climate, (BAND[2], BAND[0]))))
    return LeadScore(
        lead_s, len(members), coverage(low, high, truth),
        skill(members.mean(axis=1), truth, float(np.var(climate))),
        forecast_crps, 1.0 - forecast_crps / climate_crps, float(np.mean(high - low)) / band,
    )  # fmt: skip
