"""Tests of residuals over minutes: their variance against the uncertainty given, and slow drift.

A residual over its standard uncertainty z = r/σ has E[z²] = 1 if σ is right. Its mean of
VARIANCE_S is tested as χ²/ν (Wilson and Hilferty 1931, (χ²/ν)^(1/3) is nearly normal with mean
1 - 2/(9ν) and variance 2/(9ν)), with one degree of freedom for each FREEDOM_S: residuals follow the
waves, so that nearer ones are not independent. The scatter of the residuals over the instrument's
own uncertainty shows a comparison that is too good to prove anything. The means of a minute go
through the self-starting CUSUM below, in units of σ.

A drift of the load or of the load pin of less than some 1 kN a minute is learned as weight or bias,
minute after minute, and no test of a few minutes sees it. So each block's mean offset of the
measured tension from what the figures at the last tare predict is watched over hours by a two-sided
CUSUM (Page 1954), with the mean and spread of the offsets themselves as reference, the
self-starting form of Hawkins (1987),

    Q_n = Φ⁻¹{F_{n-2}[√((n-1)/n)·(d_n - mean of the earlier)/sd of the earlier]},

which is N(0, 1) and independent from block to block without a drift, whatever the unknown mean and
spread are. The limit follows from the average run length, by Page's integral equation.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import astuple, dataclass
from functools import cache
from statistics import NormalDist
from typing import Any, NamedTuple

import numpy as np

from rope_twin.errors import InputError

VARIANCE_S = 300  # of the test of variance
BIN_S = 10
MIN_SPAN_S = 120  # minimum span of its readings
MIN_READINGS = 10  # of a bin of the variance, and of a minute of the drift
FREEDOM_S = 10.0
BLOCK_S = 60
MIN_SPREAD = 0.25  # minimum spread of the minutes' means [σ]: a smaller one is irrelevant
_NS = 1_000_000_000
REFERENCE = 0.5  # k of the CUSUM: best for a shift of one standard deviation
RUN_LENGTH = 4 * 7 * 24 * 60  # blocks of a minute between false alarms: four weeks
SETTLING_BLOCKS = 5  # blocks after a tare in which the figures are learned
MIN_BLOCKS = 5  # of the reference, before a block is tested
MAX_DEVIATE = 3.0  # of a tested block: a single outlier is no drift
QUADRATURE_NODES = 80
_NORMAL = NormalDist()


class ResidualTests(NamedTuple):
    """Results of both tests at present."""

    variance: float  # mean of z² over the last VARIANCE_S
    deviate: float  # of it, as a standard normal one if σ is right: + too large
    scatter: float  # standard deviation of the residuals over the instrument's uncertainty
    span_s: float  # time that the readings cover
    drift: float | None  # offset against the reference, in σ, while there is a drift
    drift_s: float  # for how long


class ResidualMonitor:
    """Monitor of the residuals of one quantity by both tests."""

    def __init__(self) -> None:
        """Begin without readings."""
        # bin, readings, Σz², Σr/u, Σ(r/u)²: u the instrument's uncertainty
        self._bins: deque[tuple[int, int, float, float, float]] = deque()
        self._drift = SlowDrift(MIN_SPREAD)
        self._block, self._readings, self._sum = -1, 0, 0.0
        # The numbers of a drift and of `result`: a saved state can have the fields of an object
        # only if a new run has them.
        self._found: list[float] = []
        self._result: list[Any] = []

    @property
    def result(self) -> ResidualTests | None:
        """Results at the end of the last bin; None: the readings cover too little."""
        return ResidualTests(*self._result) if self._result else None

    def take(self, stamp_ns: int, residual: float, sigma: float, instrument: float) -> None:
        """Add a residual, its standard uncertainty and that of the instrument alone (both > 0)."""
        number, z, r = stamp_ns // (BIN_S * _NS), residual / sigma, residual / instrument
        self._take_mean(stamp_ns // (BLOCK_S * _NS), z)
        n, sum_zz, sum_r, sum_rr = 0, 0.0, 0.0, 0.0
        if self._bins and self._bins[-1][0] == number:
            _, n, sum_zz, sum_r, sum_rr = self._bins.pop()
        else:
            while self._bins and self._bins[0][0] < number - VARIANCE_S // BIN_S:
                self._bins.popleft()
            self._result = self._evaluate()
        self._bins.append((number, n + 1, sum_zz + z * z, sum_r + r, sum_rr + r * r))

    def _take_mean(self, block: int, z: float) -> None:
        if block != self._block:
            if self._readings >= MIN_READINGS:
                drift = self._drift.take(self._sum / self._readings)
                self._found = [] if drift is None else list(astuple(drift))
            self._block, self._readings, self._sum = block, 0, 0.0
        self._readings += 1
        self._sum += z

    def _evaluate(self) -> list[Any]:
        """Return the results of all bins, or none if the readings cover too little."""
        full = [row for row in self._bins if row[1] >= MIN_READINGS]
        span_s = float(BIN_S * len(full))
        if span_s < MIN_SPAN_S:
            return []
        n, sum_zz, sum_r, sum_rr = (sum(row[k] for row in full) for k in range(1, 5))
        variance, mean = sum_zz / n, sum_r / n
        variance_term = 2.0 / (9.0 * span_s / FREEDOM_S)
        begun, drift = self._found or (-1.0, None)
        tests = ResidualTests(
            variance=variance,
            deviate=(variance ** (1.0 / 3.0) - 1.0 + variance_term) / math.sqrt(variance_term),
            scatter=math.sqrt(max(sum_rr / n - mean * mean, 0.0)),
            span_s=span_s,
            drift=drift,
            drift_s=float(BLOCK_S * (begun + 1)),
        )
        return list(tests)


def run_length(limit: float, shift: float = 0.0, reference: float = REFERENCE) -> float:
    """Return the average run length of a two-sided CUSUM of N(shift, 1) values.

    Page's integral equation (1954, eq. 4) of one side,
    L(u) = 1 + L(0)·Φ(k - u - δ) + ∫₀ʰ L(x)·φ(x + k - u - δ) dx, by Gauss-Legendre quadrature; both
    sides by 1/L = 1/L⁺ + 1/L⁻ (Kemp 1961).

    Raises:
        InputError: the limit is not positive.
    """
    if not (math.isfinite(limit) and limit > 0.0):
        raise InputError("limit", f"{limit:g} is not possible", "give a positive number")
    return 1.0 / sum(1.0 / _one_sided(limit, side * shift, reference) for side in (1.0, -1.0))


def _one_sided(limit: float, shift: float, reference: float) -> float:
    x, w = np.polynomial.legendre.leggauss(QUADRATURE_NODES)
    x, w = 0.5 * limit * (x + 1.0), 0.5 * limit * w
    u = np.append(x, 0.0)  # L at the nodes and at 0
    z = x[None, :] + reference - u[:, None] - shift
    kernel = np.exp(-0.5 * z * z) / math.sqrt(2.0 * math.pi) * w
    at_zero = [_NORMAL.cdf(reference - start - shift) for start in u]
    system = np.eye(len(u)) - np.column_stack([kernel, at_zero])
    return float(np.linalg.solve(system, np.ones(len(u)))[-1])


@cache
def limit_for(length: float) -> float:
    """Return the limit h with this average run length without a drift, within 1e-6.

    Raises:
        InputError: the length is not between 2 and 1e8 blocks.
    """
    if not 2.0 <= length <= 1e8:
        problem, remedy = f"{length:g} blocks are not possible", "give 2 to 1e8 blocks"
        raise InputError("average run length", problem, remedy)
    low, high = 1e-3, 25.0
    while high - low > 1e-6:
        middle = 0.5 * (low + high)
        if run_length(middle, 0.0) < length:
            low = middle
        else:
            high = middle
    return high


@dataclass(frozen=True)
class Drift:
    """Drift of the offsets."""

    begun: int  # blocks before the newest one
    offset_n: float  # mean offset since then, against the reference


class SlowDrift:
    """Self-starting CUSUM of the offset of each block, since the last tare."""

    def __init__(self, spread_n: float, run_length_blocks: float = RUN_LENGTH) -> None:
        """Begin after a tare.

        spread_n: minimum standard deviation of the offsets [N], so that a few similar blocks do not
            make all others improbable.
        """
        self._min_n = spread_n
        self._limit = limit_for(run_length_blocks)
        _normal_of_t(0.0, 1)  # imports SciPy now: a step must not wait for it
        self.restart()

    def restart(self) -> None:
        """Start again, after a tare or an intended change of the load."""
        self._skipped = self._count = 0
        self._mean = self._squares = 0.0
        self._sums = [0.0, 0.0]  # up, down
        self._since = [0, 0]  # blocks since each sum was 0
        self._offsets = [0.0, 0.0]  # sum of the offsets since then

    @property
    def level(self) -> float:
        """Return the larger sum over its limit: 1 is an alarm."""
        return max(self._sums) / self._limit

    def take(self, offset_n: float) -> Drift | None:
        """Take the offset of a block [N]; return a drift once it is found. NaN: missing."""
        if not math.isfinite(offset_n):
            return None
        if self._skipped < SETTLING_BLOCKS:
            self._skipped += 1
            return None
        n, drift = self._count, None
        if n >= MIN_BLOCKS:
            spread = max(math.sqrt(self._squares / (n - 1)), self._min_n)
            ratio = math.sqrt(n / (n + 1.0)) * (offset_n - self._mean) / spread
            deviate = max(-MAX_DEVIATE, min(MAX_DEVIATE, _normal_of_t(ratio, n - 1)))
            drift = self._accumulate(deviate, offset_n - self._mean)
        if drift is None:  # blocks without a drift update the reference
            self._count = n + 1
            step = offset_n - self._mean
            self._mean += step / self._count
            self._squares += step * (offset_n - self._mean)
        return drift

    def _accumulate(self, deviate: float, offset_n: float) -> Drift | None:
        drift = None
        for k, sign in enumerate((1.0, -1.0)):
            self._sums[k] = max(0.0, self._sums[k] + sign * deviate - REFERENCE)
            if self._sums[k] == 0.0:
                self._since[k], self._offsets[k] = 0, 0.0
                continue
            self._since[k] += 1
            self._offsets[k] += offset_n
            if self._sums[k] > self._limit:
                drift = Drift(self._since[k] - 1, self._offsets[k] / self._since[k])
        return drift


def _normal_of_t(t: float, freedom: int) -> float:
    """Return the normal deviate with the probability of Student's t."""
    from scipy.special import ndtri, stdtr

    below = float(stdtr(freedom, -abs(t)))
    return math.copysign(float(-ndtri(max(below, 1e-300))), t)
