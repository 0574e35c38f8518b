"""Risks of the next minute and quiet windows, as shares of a forecast's members.

Forecasts are kept until their time has come: how often their bands held gives the spread's factor.
A band that held less often than it promised is too narrow in this sea, with these sensors. Of the
last hundred kept forecasts the factor of a lead is the 90 % quantile of |y - median|/(half band),
taken over neighbouring leads and drawn towards 1 by a prior worth PRIOR forecasts, so that a few
misses of one wave group do not widen everything. Forecasts are kept KEEP_EVERY_S apart: nearer ones
are of the same waves and prove nothing besides.
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
from rope_twin.forecast.orders import hung_ropes
from rope_twin.forecast.score import coverage
from rope_twin.forecast.tension_forecast import DEPTH, MARGIN, SPEED, TensionForecast
from rope_twin.scene.schema import Scene

Floats = NDArray[np.float64]

KEPT = 100
KEEP_EVERY_S = 10.0
PRIOR = 40.0  # forecasts that the prior factor of 1 is worth
NEIGHBOURS_S = 2.0  # leads so near count for each other
NOMINAL = 0.9  # coverage of the band
LEAST_JUDGED = 5  # forecasts before a coverage is given


@dataclass
class _Kept:
    """One band as published, and the truth where it is known."""

    origin_s: float
    band: Floats  # (3, leads)
    factor: Floats  # (leads,) that is in it
    truth: Floats  # (leads,), NaN: not yet known


class KeptForecasts:
    """The last KEPT forecasts of one quantity, and what became of them."""

    def __init__(self, leads: Floats) -> None:
        """Begin without any; leads: of all forecasts to come [s], (leads,)."""
        self.leads, self._last_s = leads, float(leads[-1])
        self._kept: deque[_Kept] = deque(maxlen=KEPT)
        self._seen: deque[tuple[float, float]] = deque()  # time and value

    def __len__(self) -> int:
        """Return the number of kept forecasts, open ones included."""
        return len(self._kept)

    def keep(self, forecast: TensionForecast) -> None:
        """Keep a forecast of the top tension, unless the last one is too near."""
        if self._kept and forecast.origin_s - self._kept[-1].origin_s < KEEP_EVERY_S - 1e-6:
            return
        open_ = np.full(len(self.leads), np.nan)
        self._kept.append(_Kept(forecast.origin_s, forecast.band(), forecast.factor, open_))

    def see(self, time_s: float, value: float) -> None:
        """Take a measured value; values come in the order of their times.

        A lead is judged by the value interpolated at its time, if two values about it are at most
        2·SAMPLE_S apart.
        """
        before = self._seen[-1] if self._seen else None
        self._seen.append((time_s, value))
        if len(self._seen) > 2:
            self._seen.popleft()
        if before is None or not math.isfinite(value + before[1]):
            return
        if not 0.0 < time_s - before[0] <= 2.0 * SAMPLE_S:
            return
        for one in self._kept:
            if not one.origin_s <= time_s <= one.origin_s + self._last_s + 2.0 * SAMPLE_S:
                continue
            first = bisect_left(self.leads, before[0] - one.origin_s - 1e-9)
            last = bisect_left(self.leads, time_s - one.origin_s + 1e-9)
            for k in range(first, last):
                part = (one.origin_s + self.leads[k] - before[0]) / (time_s - before[0])
                one.truth[k] = before[1] + part * (value - before[1])

    @property
    def judged(self) -> int:
        """Number of kept forecasts of which something is known."""
        return len(self._judged())

    def _judged(self) -> list[_Kept]:
        return [one for one in self._kept if np.isfinite(one.truth).any()]

    def coverage(self) -> float:
        """Return the fraction of judged leads inside their bands; NaN: too few are judged."""
        closed = self._judged()
        if len(closed) < LEAST_JUDGED:
            return math.nan
        truth = np.array([one.truth for one in closed])
        bands = np.array([one.band for one in closed])
        known = np.isfinite(truth)
        return coverage(bands[:, 0][known], bands[:, 2][known], truth[known])

    def factor(self) -> Floats:
        """Return the factor on the members' spread at each lead, (leads,); 1 without any."""
        count = len(self.leads)
        if not self._kept:
            return np.ones(count)
        truth = np.array([one.truth for one in self._kept])
        bands = np.array([one.band for one in self._kept])
        own = np.array([one.factor for one in self._kept])
        off = truth - bands[:, 1]
        half = np.where(off >= 0.0, bands[:, 2] - bands[:, 1], bands[:, 1] - bands[:, 0])
        ratio = own * np.abs(off) / np.maximum(half, 1e-9)
        near = round(NEIGHBOURS_S / SAMPLE_S)
        found = np.ones(count)
        for k in range(count):
            some = ratio[:, max(k - near, 0) : k + near + 1]
            judged = int(np.isfinite(some).any(axis=1).sum())
            if judged:
                wanted = float(np.nanquantile(some, NOMINAL))
                weight = judged / (judged + PRIOR)
                found[k] = math.exp(weight * math.log(max(wanted, 1e-3)))
        return found


SPANS_S = (10.0, 20.0, 30.0, 60.0)
LATEST_BEGIN_S = 10.0  # no quiet window is promised that begins later
BEGINS_S = (0.0, 2.0, 5.0, 10.0)
FEW = 0.1  # share of members below which a conditional figure is not given


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
        """Check the limits.

        Raises:
            InputError: a limit that is not positive.
        """
        names = ("tension_n", "contact_m_per_s", "quiet_m_per_s", "quiet_s")
        given = [(name, getattr(self, name)) for name in names]
        given += [(f"tension of {name}", value) for name, value in self.ropes_n.items()]
        for name, value in given:
            if not (value > 0.0 and math.isfinite(value)):
                raise InputError(f"limit {name}", f"it is {value:g}", "give more than 0")

    def of(self, rope: str) -> float:
        """Return the tension limit of a rope [N]."""
        return self.ropes_n.get(rope, self.tension_n)


def tension_limits(scene: Scene, given_n: float | None = None) -> tuple[float, dict[str, float]]:
    """Return the limit of the main winch's rope [N], and those of other ropes from a hang-off.

    given_n: counts for each of them; None: the limit of the scene, or its utilisation times the MBL
    of the rope.
    """
    own, hung = scene.limits, hung_ropes(scene)
    limit = given_n or own.tension_n
    found = {
        line.name: limit or own.utilisation * line.breaking_load_n
        for line in scene.ropes
        if line.name in hung
    }
    first, *others = found.items()
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
    found = []
    touching, speed = None, None
    if seabed_depth_m is not None:
        speed, touching = first_contact(forecast, seabed_depth_m)
    for span in SPANS_S:
        count = round(span / SAMPLE_S)
        high = np.any(
            [(rope.peak_n[:count] > limits.of(name)).any(axis=0)
             for name, rope in forecast.hung.items()], axis=0,
        )  # fmt: skip
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
            problem = f"a window from {begin:g} to {begin + limits.quiet_s:g} s"
            remedy = f"begin it within {latest:g} s and end it within {forecast.lead_s[-1]:g} s"
            raise InputError("quiet window", problem, remedy)
        share = float(slow[first:last].all(axis=0).mean())
        found.append(QuietWindow(begin, limits.quiet_s, share))
    return found


@dataclass(frozen=True)
class Difference:
    """An order against another one, member by member on the same heave, in one rope's tension."""

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
    own, other = (one.hung[rope or one.rope] for one in (forecast, against))
    change = own.peak_n[:count].max(axis=0) - other.peak_n[:count].max(axis=0)
    low, middle, high = np.quantile(change, (0.05, 0.5, 0.95), method="weibull")
    return Difference(
        forecast.order, (float(low), float(middle), float(high)), float((change < 0.0).mean())
    )
