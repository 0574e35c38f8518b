"""Risks of the next minute and quiet windows, as fractions of a forecast's members.

Past forecasts are verified: the coverage of their bands gives the factor on the spread. A band with
less than its nominal coverage is too narrow in this sea, with these sensors. Over the last hundred
forecasts the factor of a lead is the 90 % quantile of |y - median|/(half band),
taken over neighbouring leads and shrunk towards 1 by a prior worth PRIOR forecasts, so that a few
misses in one wave group do not widen all bands. Verified forecasts are KEEP_EVERY_S apart: closer
ones are of the same waves and not independent.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from rope_twin.errors import InputError
from rope_twin.forecast.heave_process import SAMPLE_S
from rope_twin.forecast.orders import suspended_ropes
from rope_twin.forecast.score import coverage
from rope_twin.forecast.tension_forecast import DEPTH, MARGIN, SPEED, TensionForecast
from rope_twin.scene.schema import Scene

Floats = NDArray[np.float64]

MAX_FORECASTS = 100
KEEP_EVERY_S = 10.0
PRIOR = 40.0  # forecasts that the prior factor of 1 is worth
NEIGHBOURS_S = 2.0  # leads this close are pooled
NOMINAL = 0.9  # coverage of the band
MIN_VERIFIED = 5  # forecasts before a coverage is given


@dataclass
class _PublishedBand:
    """One published band, and the measured values where they are known."""

    origin_s: float
    band: Floats  # (3, leads)
    factor: Floats  # (leads,) applied to it
    truth: Floats  # (leads,), NaN: not yet known


class ForecastVerification:
    """The last MAX_FORECASTS forecasts of one quantity, and their measured outcome."""

    def __init__(self, leads: Floats) -> None:
        """Begin without forecasts; leads: of all forecasts [s], (leads,)."""
        self.leads, self._last_s = leads, float(leads[-1])
        self._kept: deque[_PublishedBand] = deque(maxlen=MAX_FORECASTS)
        self._seen: deque[tuple[float, float]] = deque()  # time and value

    def __len__(self) -> int:
        """Return the number of stored forecasts, unverified ones included."""
        return len(self._kept)

    def add(self, forecast: TensionForecast) -> None:
        """Store a forecast of the top tension, unless it is too close to the last one."""
        if self._kept and forecast.origin_s - self._kept[-1].origin_s < KEEP_EVERY_S - 1e-6:
            return
        open_ = np.full(len(self.leads), np.nan)
        self._kept.append(
            _PublishedBand(forecast.origin_s, forecast.band(), forecast.factor, open_)
        )

    def observe(self, time_s: float, value: float) -> None:
        """Add a measured value; their times must ascend.

        A lead is verified by the value interpolated at its time if the two values around it are at
        most 2·SAMPLE_S apart.
        """
        before = self._seen[-1] if self._seen else None
        self._seen.append((time_s, value))
        if len(self._seen) > 2:
            self._seen.popleft()
        if before is None or not math.isfinite(value + before[1]):
            return
        if not 0.0 < time_s - before[0] <= 2.0 * SAMPLE_S:
            return
        for published in self._kept:
            if (
                not published.origin_s
                <= time_s
                <= published.origin_s + self._last_s + 2.0 * SAMPLE_S
            ):
                continue
            first = bisect_left(self.leads, before[0] - published.origin_s - 1e-9)
            last = bisect_left(self.leads, time_s - published.origin_s + 1e-9)
            for k in range(first, last):
                fraction = (published.origin_s + self.leads[k] - before[0]) / (time_s - before[0])
                published.truth[k] = before[1] + fraction * (value - before[1])

    @property
    def judged(self) -> int:
        """Number of forecasts with at least one verified lead."""
        return len(self._judged())

    def _judged(self) -> list[_PublishedBand]:
        return [published for published in self._kept if np.isfinite(published.truth).any()]

    def coverage(self) -> float:
        """Return the fraction of verified leads inside their bands; NaN if they are too few."""
        judged = self._judged()
        if len(judged) < MIN_VERIFIED:
            return math.nan
        truth = np.array([published.truth for published in judged])
        bands = np.array([published.band for published in judged])
        is_known = np.isfinite(truth)
        return coverage(bands[:, 0][is_known], bands[:, 2][is_known], truth[is_known])

    def factor(self) -> Floats:
        """Return the factor on the members' spread at each lead, (leads,); 1 without any."""
        count = len(self.leads)
        if not self._kept:
            return np.ones(count)
        truth = np.array([published.truth for published in self._kept])
        bands = np.array([published.band for published in self._kept])
        in_band = np.array([published.factor for published in self._kept])
        error = truth - bands[:, 1]
        half_width = np.where(error >= 0.0, bands[:, 2] - bands[:, 1], bands[:, 1] - bands[:, 0])
        ratio = in_band * np.abs(error) / np.maximum(half_width, 1e-9)
        neighbours = round(NEIGHBOURS_S / SAMPLE_S)
        factors = np.ones(count)
        for k in range(count):
            nearby = ratio[:, max(k - neighbours, 0) : k + neighbours + 1]
            judged = int(np.isfinite(nearby).any(axis=1).sum())
            if judged:
                needed = float(np.nanquantile(nearby, NOMINAL))
                weight = judged / (judged + PRIOR)
                factors[k] = math.exp(weight * math.log(max(needed, 1e-3)))
        return factors


SPANS_S = (10.0, 20.0, 30.0, 60.0)
LATEST_START_S = 10.0  # no quiet window is given that begins later
WINDOW_STARTS_S = (0.0, 2.0, 5.0, 10.0)


@dataclass(frozen=True)
class Limits:
    """Limits that a risk is the probability of exceeding."""

    tension_n: float  # of the top tension of the main winch's rope
    contact_m_per_s: float = 0.5  # of the payload's downward speed at contact with the seabed
    quiet_m_per_s: float = 0.3  # of the payload's vertical speed
    quiet_s: float = 10.0  # length of a quiet window
    # of the top tension of other ropes from a hang-off, by name; else it is tension_n
    ropes_n: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check the limits. Raises InputError: a limit that is not positive."""
        names = ("tension_n", "contact_m_per_s", "quiet_m_per_s", "quiet_s")
        limits = [(name, getattr(self, name)) for name in names]
        limits += [(f"tension of {name}", value) for name, value in self.ropes_n.items()]
        for name, value in limits:
            if not (value > 0.0 and math.isfinite(value)):
                raise InputError(f"limit {name}", f"it is {value:g}", "give more than 0")

    def of(self, rope: str) -> float:
        """Return the tension limit of a rope [N]."""
        return self.ropes_n.get(rope, self.tension_n)


def tension_limits(scene: Scene, given_n: float | None = None) -> tuple[float, dict[str, float]]:
    """Return the limit of the main winch's rope [N], and those of other ropes from a hang-off.

    given_n: limit of each rope; None: the limit of the scene, or its utilisation times the MBL
    of the rope.
    """
    scene_limits, suspended_names = scene.limits, suspended_ropes(scene)
    limit = given_n or scene_limits.tension_n
    limits_n = {
        line.name: limit or scene_limits.utilisation * line.breaking_load_n
        for line in scene.ropes
        if line.name in suspended_names
    }
    first, *others = limits_n.items()
    return first[1], dict(others)


@dataclass(frozen=True)
class Risk:
    """Probabilities over a span from the origin on."""

    span_s: float
    tension: float  # P(top tension > limit) of any rope from a hang-off, each by its own limit
    slack: float  # P(an element is slack)
    contact: float  # P(the payload lands faster than the limit); NaN: no seabed
    landing: float  # P(the payload lands); NaN: no seabed


@dataclass(frozen=True)
class QuietWindow:
    """Probability that the payload's speed stays below its limit over a window."""

    begin_s: float  # from the origin on
    length_s: float
    probability: float


def risks(
    forecast: TensionForecast, limits: Limits, seabed_depth_m: float | None = None
) -> list[Risk]:
    """Return the risk of each of SPANS_S.

    seabed_depth_m: depth of the payload at contact [m]; None: no seabed.
    """
    result = []
    touching, speed = None, None
    if seabed_depth_m is not None:
        speed, touching = first_contact(forecast, seabed_depth_m)
    for span in SPANS_S:
        count = round(span / SAMPLE_S)
        exceeds = np.any(
            [(rope.peak_n[:count] > limits.of(name)).any(axis=0)
             for name, rope in forecast.suspended.items()], axis=0,
        )  # fmt: skip
        slack = (forecast.values[MARGIN][:count] <= 0.0).any(axis=0)
        contact = landing = math.nan
        if touching is not None and speed is not None:
            lands = touching < count
            landing = float(lands.mean())
            contact = float((lands & (speed > limits.contact_m_per_s)).mean())
        result.append(Risk(span, float(exceeds.mean()), float(slack.mean()), contact, landing))
    return result


def first_contact(
    forecast: TensionForecast, seabed_depth_m: float
) -> tuple[Floats, NDArray[np.int64]]:
    """Return speed [m/s] of each member just before it first touches the seabed, and the lead.

    Where a member does not land, or is on the seabed from the start, the speed is NaN and the lead
    the number of leads. Members are sampled every SAMPLE_S; the speed is the largest downward
    one of the last two samples above the seabed, which bounds the contact speed.
    """
    depth, speed = (
        np.vstack([forecast.at_origin[name], forecast.values[name]]) for name in (DEPTH, SPEED)
    )
    on_seabed = depth >= seabed_depth_m
    lands = on_seabed.any(axis=0) & ~on_seabed[0]
    last_above = np.where(lands, on_seabed.argmax(axis=0) - 1, len(depth) - 1)
    second_last = np.maximum(last_above - 1, 0)
    member = np.arange(depth.shape[1])
    fastest = np.maximum(speed[last_above, member], speed[second_last, member])
    return np.where(lands, fastest, np.nan), last_above


def quiet_windows(
    forecast: TensionForecast, limits: Limits, begins_s: Sequence[float] = WINDOW_STARTS_S
) -> list[QuietWindow]:
    """Return the probability that each window is quiet.

    Raises:
        InputError: a window that begins later than LATEST_START_S or within the horizon of the
            heave, whichever is later, or ends beyond the forecast.
    """
    latest = max(LATEST_START_S, forecast.horizon_s)
    windows = []
    is_quiet = np.abs(forecast.values[SPEED]) < limits.quiet_m_per_s
    for begin in begins_s:
        first, last = round(begin / SAMPLE_S), round((begin + limits.quiet_s) / SAMPLE_S)
        if begin > latest or last > len(is_quiet):
            problem = f"a window from {begin:g} to {begin + limits.quiet_s:g} s"
            remedy = f"begin it within {latest:g} s and end it within {forecast.lead_s[-1]:g} s"
            raise InputError("quiet window", problem, remedy)
        probability = float(is_quiet[first:last].all(axis=0).mean())
        windows.append(QuietWindow(begin, limits.quiet_s, probability))
    return windows


@dataclass(frozen=True)
class Difference:
    """Difference between two orders in one rope's tension, member by member on the same heave."""

    order: str
    peak_n: tuple[float, float, float]  # 5, 50, 95 % of the change in the span's largest tension
    lower: float  # share of members whose largest tension is lower under this order


def compare(
    forecast: TensionForecast, against: TensionForecast, span_s: float = 30.0, rope: str = ""
) -> Difference:
    """Return by how much the largest top tension of a span differs between two orders.

    rope: name of the rope; "": that of the main winch.

    Raises:
        InputError: the forecasts are not of the same members.
    """
    if forecast.members != against.members or forecast.origin_s != against.origin_s:
        problem = f"{forecast.members} and {against.members} members"
        raise InputError("orders", problem, "compare forecasts of one call")
    count = round(span_s / SAMPLE_S)
    under_order, reference = (each.suspended[rope or each.rope] for each in (forecast, against))
    change = under_order.peak_n[:count].max(axis=0) - reference.peak_n[:count].max(axis=0)
    lower_n, median_n, upper_n = np.quantile(change, (0.05, 0.5, 0.95), method="weibull")
    return Difference(
        forecast.order,
        (float(lower_n), float(median_n), float(upper_n)),
        float((change < 0.0).mean()),
    )
