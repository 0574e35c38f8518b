"""Risks of the next minute and quiet windows, as shares of a forecast's members."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rope_twin.errors import InputError, phrase
from rope_twin.forecast.heave_process import SAMPLE_S
from rope_twin.forecast.tension_forecast import DEPTH, MARGIN, SPEED, TensionForecast

Floats = NDArray[np.float64]

SPANS_S = (10.0, 20.0, 30.0, 60.0)
LATEST_BEGIN_S = 10.0  # no quiet window is promised that begins later
BEGINS_S = (0.0, 2.0, 5.0, 10.0)
FEW = 0.1  # share of members below which a conditional figure is not given


@dataclass(frozen=True)
class Limits:
    """Limits that a risk is the probability of exceeding."""

    tension_n: float  # of the top tension
    contact_m_per_s: float = 0.5  # of the payload's downward speed at contact with the seabed
    quiet_m_per_s: float = 0.3  # of the payload's vertical speed
    quiet_s: float = 10.0  # length of a quiet window

    def __post_init__(self) -> None:
        """Check the limits.

        Raises:
            InputError: a limit that is not positive.
        """
        for name in ("tension_n", "contact_m_per_s", "quiet_m_per_s", "quiet_s"):
            value = getattr(self, name)
            if not (value > 0.0 and math.isfinite(value)):
                raise InputError(phrase(f"limit {name}", f"it is {value:g}", "give more than 0"))


@dataclass(frozen=True)
class Risk:
    """Probabilities over a span from the origin on."""

    span_s: float
    tension: float  # P(top tension > limit)
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
    forecast: TensionForecast,
    limits: Limits,
    seabed_depth_m: float | None = None,
    spans_s: Sequence[float] = SPANS_S,
) -> list[Risk]:
    """Return the risk of each span.

    seabed_depth_m: depth of the payload at contact [m]; None: no seabed.
    """
    found = []
    touching, speed = None, None
    if seabed_depth_m is not None:
        speed, touching = first_contact(forecast, seabed_depth_m)
    for span in spans_s:
        count = round(span / SAMPLE_S)
        high = (forecast.peak_n[:count] > limits.tension_n).any(axis=0)
        loose = (forecast.values[MARGIN][:count] <= 0.0).any(axis=0)
        contact = landing = math.nan
        if touching is not None and speed is not None:
            lands = touching < count
            landing = float(lands.mean())
            contact = float((lands & (speed > limits.contact_m_per_s)).mean())
        found.append(Risk(span, float(high.mean()), float(loose.mean()), contact, landing))
    return found


def first_contact(
    forecast: TensionForecast, seabed_depth_m: float
) -> tuple[Floats, NDArray[np.int64]]:
    """Return speed [m/s] of each member just before it first touches the seabed, and the lead.

    Speed is NaN, and the lead's number that of all leads, where a member does not land, or is on
    the seabed from the beginning. Members are looked at every SAMPLE_S; the speed is the largest
    downward one of the last two looks above the seabed, which bounds that at contact.
    """
    depth, speed = forecast.values[DEPTH], forecast.values[SPEED]
    leads, members = depth.shape
    below = depth >= seabed_depth_m
    lands = below.any(axis=0) & ~below[0]
    first = np.where(lands, below.argmax(axis=0), leads)
    before = np.maximum(first - 1, 0)
    earlier = np.maximum(first - 2, 0)
    own = np.arange(members)
    fastest = np.maximum(speed[before, own], speed[earlier, own])
    return np.where(lands, fastest, np.nan), first


def quiet_windows(
    forecast: TensionForecast, limits: Limits, begins_s: Sequence[float] = BEGINS_S
) -> list[QuietWindow]:
    """Return the probability that each window is quiet.

    Raises:
        InputError: a window that begins later than LATEST_BEGIN_S or within the horizon of the
            heave, whichever is later, or ends beyond the forecast.
    """
    latest = max(LATEST_BEGIN_S, forecast.horizon_s)
    found = []
    slow = np.abs(forecast.values[SPEED]) < limits.quiet_m_per_s
    for begin in begins_s:
        first, last = round(begin / SAMPLE_S), round((begin + limits.quiet_s) / SAMPLE_S)
        if begin > latest or last > len(slow):
            what = f"a window from {begin:g} to {begin + limits.quiet_s:g} s"
            right = f"begin it within {latest:g} s and end it within {forecast.lead_s[-1]:g} s"
            raise InputError(phrase("quiet window", what, right))
        share = float(slow[first:last].all(axis=0).mean())
        found.append(QuietWindow(begin, limits.quiet_s, share))
    return found


@dataclass(frozen=True)
class Difference:
    """An order against another one, member by member on the same heave."""

    order: str
    peak_n: tuple[float, float, float]  # 5, 50, 95 % of the change in the span's largest tension
    lower: float  # share of members whose largest tension is lower under this order


def compare(
    forecast: TensionForecast, against: TensionForecast, span_s: float = 30.0
) -> Difference:
    """Return by how much the largest tension of a span differs between two orders.

    Raises:
        InputError: the forecasts are not of the same members.
    """
    if forecast.members != against.members or forecast.origin_s != against.origin_s:
        what = f"{forecast.members} and {against.members} members"
        raise InputError(phrase("orders", what, "compare forecasts of one call"))
    count = round(span_s / SAMPLE_S)
    change = forecast.peak_n[:count].max(axis=0) - against.peak_n[:count].max(axis=0)
    low, middle, high = np.quantile(change, (0.05, 0.5, 0.95), method="weibull")
    return Difference(
        forecast.order, (float(low), float(middle), float(high)), float((change < 0.0).mean())
    )
