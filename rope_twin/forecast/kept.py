"""Forecasts kept until their time has come: how often their bands held, and the spread's factor.

A band that held less often than it promised is too narrow in this sea, with these sensors. Of the
last hundred kept forecasts the factor of a lead is the 90 % quantile of |y - median|/(half band),
taken over neighbouring leads and drawn towards 1 by a prior worth PRIOR forecasts, so that a few
misses of one wave group do not widen everything. Forecasts are kept KEEP_EVERY_S apart: nearer
ones are of the same waves and prove nothing besides.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rope_twin.forecast.heave_process import SAMPLE_S
from rope_twin.forecast.score import coverage
from rope_twin.forecast.tension_forecast import TensionForecast

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
