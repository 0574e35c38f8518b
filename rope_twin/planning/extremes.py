"""Short-term extremes: Gumbel distribution of the maxima of seeds, and intervals of a quantile.

The largest value of each seed's record follows, for long records, the Gumbel distribution F(x) =
exp(-exp(-(x - μ)/β)) (Gumbel 1958); minima are the maxima of the negative values. Parameters are
those of maximum likelihood: β = mean(x) - Σ x·e^{-x/β}/Σ e^{-x/β}, μ = -β·ln(mean(e^{-x/β}))
(Johnson, Kotz and Balakrishnan 1995, Continuous Univariate Distributions 2, 22.9).

The interval is a parametric bootstrap of the pivot (x̂_p - x_p)/β̂. Its distribution depends on the
number of seeds alone, since the estimates follow shift and scale of the sample (Lawless 2003,
Statistical Models and Methods for Lifetime Data, 5.2 and app. E); so it is computed once from
samples of the standard Gumbel distribution, and the coverage is exact where maxima are Gumbel's.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from rope_twin.errors import InputError

Floats = NDArray[np.float64]

LEAST_SEEDS = 3  # fewer determine no scale worth the name
REPETITIONS = 4000  # bootstrap samples
NEWTON, CONVERGED = 60, 1e-12
SAME = 1e-12  # relative spread of values that count as equal


@dataclass(frozen=True)
class Gumbel:
    """Distribution of maxima; of several samples if its fields are arrays."""

    location: Floats  # μ
    scale: Floats  # β

    def quantile(self, probability: float) -> Floats:
        """Return the value that is not exceeded with this probability."""
        return np.asarray(self.location - self.scale * math.log(-math.log(probability)))


def fit_gumbel(maxima: Floats) -> Gumbel:
    """Return the distribution of maximum likelihood of each sample, (..., n) -> (...,).

    Newton's method on β from the estimate of moments, √6·s/π; all samples at once.
    """
    x = np.asarray(maxima, dtype=float)
    mean = x.mean(axis=-1, keepdims=True)
    spread = x.std(axis=-1, ddof=1, keepdims=True)
    flat = spread <= SAME * np.maximum(np.abs(mean), 1.0)
    # mean 0, so that no exponential overflows; what rounding leaves of equal values is 0
    y = np.where(flat, 0.0, x - mean) / np.where(flat, 1.0, spread)
    b = np.full_like(spread, math.sqrt(6.0) / math.pi)
    for _ in range(NEWTON):
        w = np.exp(-y / b)
        s0 = w.sum(axis=-1, keepdims=True)
        s1 = (y * w).sum(axis=-1, keepdims=True)
        s2 = (y * y * w).sum(axis=-1, keepdims=True)
        error = b + s1 / s0
        slope = 1.0 + (s2 / s0 - (s1 / s0) ** 2) / (b * b)
        change = error / slope
        b = np.maximum(b - change, 0.1 * b)
        if np.all(np.abs(change) <= CONVERGED * b):
            break
    location = -b * np.log(np.exp(-y / b).mean(axis=-1, keepdims=True))
    scale = np.where(flat, 0.0, b * spread)
    return Gumbel(
        np.asarray((mean + np.where(flat, 0.0, location * spread))[..., 0]), scale[..., 0]
    )


@lru_cache(maxsize=256)
def _pivots(count: int, probability: float) -> Floats:
    """Return sorted values of (x̂_p - x_p)/β̂ over samples of the standard distribution."""
    uniform = np.random.default_rng([20_260_101, count]).random((REPETITIONS, count))
    fitted = fit_gumbel(-np.log(-np.log(uniform)))
    true = -math.log(-math.log(probability))
    return np.sort((fitted.quantile(probability) - true) / fitted.scale)


@dataclass(frozen=True)
class Extreme:
    """Characteristic extreme of a quantity, with the interval of its estimate."""

    value: float
    low: float
    high: float
    seeds: int

    @property
    def half_width(self) -> float:
        """Return half of the interval's width, relative to the magnitude of the value."""
        size = max(abs(self.value), math.ulp(1.0))
        return 0.5 * (self.high - self.low) / size

    def scaled(self, factor: float) -> Extreme:
        """Return the extreme of the quantity times a positive factor."""
        return Extreme(factor * self.value, factor * self.low, factor * self.high, self.seeds)


def characteristic_maximum(
    maxima: Sequence[float] | Floats, percentile: float, confidence: float = 0.9
) -> Extreme:
    """Return the percentile of the maximum of a record from the maxima of some records.

    Args:
        maxima: one of each seed, (n,).
        percentile: probability [%] that a record does not exceed it.
        confidence: coverage of the interval, 0 to 1.

    Raises:
        InputError: fewer than three maxima, one that is not finite, or a percentile or confidence
            out of range.
    """
    sample = np.asarray(maxima, dtype=float)
    if sample.ndim != 1 or len(sample) < LEAST_SEEDS:
        what = f"{sample.size} maxima"
        raise InputError("extremes", what, f"give at least {LEAST_SEEDS}, one of each seed")
    if not np.isfinite(sample).all():
        raise InputError("extremes", "a maximum is not finite", "leave its seed out")
    if not (0.0 < percentile < 100.0 and 0.0 < confidence < 1.0):
        what = f"percentile {percentile:g} with confidence {confidence:g}"
        raise InputError("extremes", what, "give 0 to 100 % and 0 to 1, between the ends")
    probability = 0.01 * percentile
    fitted = fit_gumbel(sample)
    value, scale = float(fitted.quantile(probability)), float(fitted.scale)
    tail = 0.5 * (1.0 - confidence)
    least, most = np.quantile(_pivots(len(sample), probability), [tail, 1.0 - tail])
    return Extreme(value, value - scale * float(most), value - scale * float(least), len(sample))


def rayleigh_factor(cycles: float, percentile: float) -> float:
    """Return the percentile of the maximum of a narrow-banded Gaussian record over its σ.

    P(max < x) = exp(-N·e^{-x²/2σ²}) over N cycles (Cartwright and Longuet-Higgins 1956, narrow
    band); at 36.8 % it is the most probable maximum, √(2·ln N).
    """
    rate = max(cycles, 1.0) / -math.log(0.01 * percentile)
    return math.sqrt(2.0 * math.log(max(rate, 1.0)))
