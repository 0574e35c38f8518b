"""Tests of residuals over minutes: their variance against the uncertainty given, and slow drift.

A residual over its standard uncertainty z = r/σ has E[z²] = 1 if σ is right. Its mean of
VARIANCE_S is tested as χ²/ν (Wilson and Hilferty 1931, (χ²/ν)^(1/3) is nearly normal with mean
1 - 2/(9ν) and variance 2/(9ν)), with one degree of freedom for each FREEDOM_S: residuals follow the
waves, so that nearer ones are not independent. The scatter of the residuals over the instrument's
own uncertainty shows a comparison that is too good to prove anything. The means of a minute go
through the self-starting CUSUM of `slow_drift`, in units of σ.
"""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

from rope_twin.twin.measured.slow_drift import Drift, SlowDrift

VARIANCE_S = 300  # of the test of variance
BIN_S = 10
LEAST_SPAN_S = 120  # before it tells
LEAST_READINGS = 10  # of a bin of the variance, and of a minute of the drift
FREEDOM_S = 10.0
BLOCK_S = 60
SPREAD = 0.25  # of the minutes' means at least [σ]: less is nothing that matters
_NS = 1_000_000_000


class ResidualTests(NamedTuple):
    """Results of both tests at present."""

    variance: float  # mean of z² over the last VARIANCE_S
    deviate: float  # of it, as a standard normal one if σ is right: + too large
    scatter: float  # standard deviation of the residuals over the instrument's uncertainty
    span_s: float  # time that the readings cover
    drift: float | None  # offset against the reference, in σ, while there is a drift
    drift_s: float  # for how long


class ResidualMonitor:
    """Runs both tests on the residuals of one quantity."""

    def __init__(self) -> None:
        """Begin without readings."""
        # bin, readings, Σz², Σr/u, Σ(r/u)²: u the instrument's uncertainty
        self._bins: deque[tuple[int, int, float, float, float]] = deque()
        self._drift = SlowDrift(SPREAD)
        self._block, self._readings, self._sum = -1, 0, 0.0
        self._found: Drift | None = None
        self.result: ResidualTests | None = None  # at the end of the last bin; None: too little

    def take(self, stamp_ns: int, residual: float, sigma: float, instrument: float) -> None:
        """Take a residual, its standard uncertainty and that of the instrument alone (both > 0)."""
        number, z, r = stamp_ns // (BIN_S * _NS), residual / sigma, residual / instrument
        self._take_mean(stamp_ns // (BLOCK_S * _NS), z)
        n, sum_zz, sum_r, sum_rr = 0, 0.0, 0.0, 0.0
        if self._bins and self._bins[-1][0] == number:
            _, n, sum_zz, sum_r, sum_rr = self._bins.pop()
        else:
            while self._bins and self._bins[0][0] < number - VARIANCE_S // BIN_S:
                self._bins.popleft()
            self.result = self._evaluated()
        self._bins.append((number, n + 1, sum_zz + z * z, sum_r + r, sum_rr + r * r))

    def _take_mean(self, block: int, z: float) -> None:
        if block != self._block:
            if self._readings >= LEAST_READINGS:
                self._found = self._drift.take(self._sum / self._readings)
            self._block, self._readings, self._sum = block, 0, 0.0
        self._readings += 1
        self._sum += z

    def _evaluated(self) -> ResidualTests | None:
        """Return the results of all bins; None: the readings cover too little."""
        full = [one for one in self._bins if one[1] >= LEAST_READINGS]
        span_s = float(BIN_S * len(full))
        if span_s < LEAST_SPAN_S:
            return None
        n, sum_zz, sum_r, sum_rr = (sum(one[k] for one in full) for k in range(1, 5))
        variance, mean = sum_zz / n, sum_r / n
        part = 2.0 / (9.0 * span_s / FREEDOM_S)
        found = self._found
        return ResidualTests(
            variance=variance,
            deviate=(variance ** (1.0 / 3.0) - 1.0 + part) / math.sqrt(part),
            scatter=math.sqrt(max(sum_rr / n - mean * mean, 0.0)),
            span_s=span_s,
            drift=None if found is None else found.offset_n,
            drift_s=0.0 if found is None else float(BLOCK_S * (found.begun + 1)),
        )
