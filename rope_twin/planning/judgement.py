"""Judgement of a sea state: characteristic values of its seeds against the criteria of the plan.

The largest value of each seed's record follows, for long records, the Gumbel distribution F(x) =
exp(-exp(-(x - μ)/β)) (Gumbel 1958); minima are the maxima of the negative values. Parameters are
those of maximum likelihood: β = mean(x) - Σ x·e^{-x/β}/Σ e^{-x/β}, μ = -β·ln(mean(e^{-x/β}))
(Johnson, Kotz and Balakrishnan 1995, Continuous Univariate Distributions 2, 22.9).

The interval is a parametric bootstrap of the pivot (x̂_p - x_p)/β̂. Its distribution depends on the
number of seeds alone, since the estimates follow shift and scale of the sample (Lawless 2003,
Statistical Models and Methods for Lifetime Data, 5.2 and app. E); so it is computed once from
samples of the standard Gumbel distribution, and the coverage is exact where maxima are Gumbel's.

A quantity such as the re-hit speed is zero in the seeds in which the event does not happen. Its
distribution is mixed, F(x) = 1 - q + q·G(x): G is the Gumbel distribution of the maxima above zero,
q their share, and x_p = G⁻¹(1 - (1 - p)/q), or 0 for p ≤ 1 - q. The interval is that of G at the
ends of the exact interval of q (Clopper and Pearson 1934), each with half of the error
(Bonferroni), so that it covers at least as often as is asked.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import betaincinv

from rope_twin.errors import InputError
from rope_twin.planning.slings import sling_shares

if TYPE_CHECKING:
    from rope_twin.planning.phases import Leg, RopeAtRest
    from rope_twin.planning.plan_file import Criteria, Plan
    from rope_twin.planning.runs import Row
    from rope_twin.planning.simplified import Simplified
    from rope_twin.scene.schema import Scene

Floats = NDArray[np.float64]

MIN_SEEDS = 3  # fewer determine no scale worth the name
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
    gumbel = fit_gumbel(-np.log(-np.log(uniform)))
    true = -math.log(-math.log(probability))
    return np.sort((gumbel.quantile(probability) - true) / gumbel.scale)


@dataclass(frozen=True)
class Extreme:
    """Characteristic extreme of a quantity, with the interval of its estimate."""

    value: float
    low: float
    high: float
    seeds: int
    zeros: float = 0.0  # share of the seeds in which it is zero

    @property
    def half_width(self) -> float:
        """Return half of the interval's width, relative to the magnitude of the value."""
        size = max(abs(self.value), math.ulp(1.0))
        return 0.5 * (self.high - self.low) / size

    def scaled(self, factor: float) -> Extreme:
        """Return the extreme of the quantity times a positive factor."""
        value, low, high = (factor * own for own in (self.value, self.low, self.high))
        return Extreme(value, low, high, self.seeds, self.zeros)


def characteristic_maximum(
    maxima: Sequence[float] | Floats, percentile: float, confidence: float = 0.9
) -> Extreme:
    """Return the percentile of the maximum of a record from the maxima of some records.

    Where some maxima are zero and the others are positive the distribution is mixed. Fewer than
    three positive ones determine no distribution: the value is then that of the sample, and the
    upper end of its interval is infinite, unless the percentile is certainly zero.

    Args:
        maxima: one of each seed, (n,).
        percentile: probability [%] that a record does not exceed it.
        confidence: coverage of the interval, 0 to 1.

    Raises:
        InputError: fewer than three maxima, one that is not finite, or a percentile or confidence
            out of range.
    """
    sample = np.asarray(maxima, dtype=float)
    if sample.ndim != 1 or len(sample) < MIN_SEEDS:
        problem = f"{sample.size} maxima"
        raise InputError("extremes", problem, f"give at least {MIN_SEEDS}, one of each seed")
    if not np.isfinite(sample).all():
        raise InputError("extremes", "a maximum is not finite", "leave its seed out")
    if not (0.0 < percentile < 100.0 and 0.0 < confidence < 1.0):
        problem = f"percentile {percentile:g} with confidence {confidence:g}"
        raise InputError("extremes", problem, "give 0 to 100 % and 0 to 1, between the ends")
    probability, count = 0.01 * percentile, len(sample)
    happened = sample[sample > 0.0]
    if (sample >= 0.0).all() and 0 < len(happened) < count:
        return _mixed_maximum(sample, happened, probability, confidence)
    value, low, high = _gumbel_maximum(sample, probability, confidence)
    return Extreme(value, low, high, count, float((sample == 0.0).mean()))


def _gumbel_maximum(
    sample: Floats, probability: float, confidence: float
) -> tuple[float, float, float]:
    """Return the quantile of a sample's Gumbel distribution and its interval."""
    gumbel = fit_gumbel(sample)
    value, scale = float(gumbel.quantile(probability)), float(gumbel.scale)
    tail = 0.5 * (1.0 - confidence)
    low, high = np.quantile(_pivots(len(sample), probability), [tail, 1.0 - tail])
    return value, value - scale * float(high), value - scale * float(low)


def _mixed_maximum(
    sample: Floats, happened: Floats, probability: float, confidence: float
) -> Extreme:
    """Return the quantile of a sample (n,) that is zero but for the values `happened` (k,)."""
    n, k = len(sample), len(happened)
    confidence = 0.5 * (1.0 + confidence)  # of the share, and of the quantile
    tail = 0.5 * (1.0 - confidence)
    least, most = betaincinv(k, n - k + 1, tail), betaincinv(k + 1, n - k, 1.0 - tail)

    def at(share: float) -> tuple[float, float, float]:
        own = 1.0 - (1.0 - probability) / share
        if own <= 0.0:
            return 0.0, 0.0, 0.0
        if k < MIN_SEEDS:
            value = float(np.quantile(sample, probability, method="inverted_cdf"))
            return value, 0.0, math.inf
        return _gumbel_maximum(happened, own, confidence)

    value, low, high = (max(0.0, own) for own in (at(k / n)[0], at(least)[1], at(most)[2]))
    return Extreme(value, low, high, n, (n - k) / n)


def rayleigh_factor(cycles: float, percentile: float) -> float:
    """Return the percentile of the maximum of a narrow-banded Gaussian record over its σ.

    P(max < x) = exp(-N·e^{-x²/2σ²}) over N cycles (Cartwright and Longuet-Higgins 1956, narrow
    band); at 36.8 % it is the most probable maximum, √(2·ln N).
    """
    rate = max(cycles, 1.0) / -math.log(0.01 * percentile)
    return math.sqrt(2.0 * math.log(max(rate, 1.0)))


class Quantity(NamedTuple):
    """A judged quantity: larger is worse."""

    words: str
    unit: str
    scale: float  # from SI to the unit of tables


QUANTITIES = {
    "hook_load": Quantity("hook load", "kN", 1e-3),
    "uplift": Quantity("hydrodynamic uplift over submerged weight", "", 1.0),
    "rope_load": Quantity("tension", "kN", 1e-3),
    "rope_loss": Quantity("loss over static tension", "", 1.0),
    "lower_end_load": Quantity("load at the lower end of the rope", "kN", 1e-3),
    "loss": Quantity("loss of the minimum tension", "kN", 1e-3),
    "landing_speed": Quantity("landing speed", "m/s", 1.0),
    "re_hit": Quantity("re-hit speed of the deck", "m/s", 1.0),
    "offset": Quantity("lateral offset", "m", 1.0),
    "stroke": Quantity("stroke of the compensation", "m", 1.0),
    "stroke_speed": Quantity("speed of the compensation", "m/s", 1.0),
}


MIN_SPEED = 1e-3  # of a limit that is a speed of 0 [m/s]


@dataclass(frozen=True)
class Limit:
    """A criterion: a quantity and what it may be."""

    key: str  # of the criteria
    quantity: str  # of QUANTITIES
    most: float
    words: str


def limits_of(plan: Plan, scene: Scene, legs: Sequence[Leg]) -> list[Limit]:
    """Return the criteria that apply to a phase."""
    criteria, limits, weight = plan.criteria, [], legs[0].payload_n
    if criteria.swl_n is not None:
        limits.append(Limit("swl_n", "hook_load", criteria.swl_n, "SWL"))
    if criteria.safety_factor is not None:
        breaking = scene.ropes[0].breaking_load_n
        label = f"MBL/{criteria.safety_factor:g}"
        limits.append(Limit("safety_factor", "hook_load", breaking / criteria.safety_factor, label))
    if legs[0].ropes:
        limits = list(_rope_limits(criteria, legs[0].ropes))
    if plan.slings is not None:
        shares = sling_shares(plan.slings, weight)
        limit = plan.slings.strength_n / float(shares.largest.max())
        limits.append(Limit("slings", "lower_end_load", limit, "slings"))
    if criteria.uplift_share is not None and not legs[0].ropes:
        limits.append(Limit("uplift_share", "uplift", criteria.uplift_share, "slack"))
    if criteria.min_tension_n is not None:
        limit = weight - criteria.min_tension_n
        label = f"loss to the minimum of {1e-3 * criteria.min_tension_n:g} kN"
        limits.append(Limit("min_tension_n", "loss", limit, label))
    if criteria.landing_speed_m_per_s is not None and legs[0].bed_m is not None:
        limit = criteria.landing_speed_m_per_s
        limits.append(Limit("landing_speed_m_per_s", "landing_speed", limit, "landing speed"))
    if criteria.re_hit_m_per_s is not None and legs[0].deck_m is not None:
        limit = max(criteria.re_hit_m_per_s, MIN_SPEED)
        limits.append(Limit("re_hit_m_per_s", "re_hit", limit, "re-hit"))
    if criteria.offset_m is not None:
        limits.append(Limit("offset_m", "offset", criteria.offset_m, "offset"))
    if criteria.stroke_m is not None:
        limits.append(Limit("stroke_m", "stroke", criteria.stroke_m, "stroke"))
    if criteria.compensation_speed_m_per_s is not None:
        limit = criteria.compensation_speed_m_per_s
        limits.append(Limit("compensation_speed_m_per_s", "stroke_speed", limit, "AHC speed"))
    return limits


def _rope_limits(criteria: Criteria, ropes: Sequence[RopeAtRest]) -> Iterator[Limit]:
    """Yield the criteria of each of several ropes; those from the ship are held by a crane."""
    for rope in ropes:
        load, loss = f"rope_load[{rope.name}]", f"rope_loss[{rope.name}]"
        if criteria.swl_n is not None and rope.from_ship:
            yield Limit(f"swl_n[{rope.name}]", load, criteria.swl_n, f"SWL {rope.name}")
        if criteria.safety_factor is not None:
            limit_n = rope.breaking_load_n / criteria.safety_factor
            label = f"MBL/{criteria.safety_factor:g} {rope.name}"
            yield Limit(f"safety_factor[{rope.name}]", load, limit_n, label)
        if criteria.uplift_share is not None and rope.lower_n > 0.0:
            label = f"slack {rope.name}"
            yield Limit(f"uplift_share[{rope.name}]", loss, criteria.uplift_share, label)


def plain_name(name: str) -> str:
    """Return a key or quantity without the rope that it is of."""
    return name.partition("[")[0]


def quantity_of(name: str) -> Quantity:
    """Return words, unit and scale of a quantity, such as `hook_load` or `rope_load[fore]`."""
    known, _, rope = name.partition("[")
    quantity = QUANTITIES[known]
    return quantity._replace(words=f"{quantity.words}, {rope[:-1]}") if rope else quantity


def samples_of(rows: Sequence[Row], weight_n: float) -> dict[str, list[float]]:
    """Return the maxima of each quantity, one of each seed; rows: of all legs of the seeds.

    A seed's maximum is that over the legs of its phase.
    """
    by_seed: dict[int, list[Row]] = {}
    for row in rows:
        by_seed.setdefault(int(row["seed"]), []).append(row)
    samples: dict[str, list[float]] = {name: [] for name in QUANTITIES if "rope_" not in name}
    for rows_of_seed in (by_seed[seed] for seed in sorted(by_seed)):
        samples["hook_load"].append(max(row["top_max_n"] for row in rows_of_seed))
        samples["uplift"].append(max(1.0 - row["payload_min_n"] / weight_n for row in rows_of_seed))
        samples["lower_end_load"].append(max(row["payload_max_n"] for row in rows_of_seed))
        samples["loss"].append(max(weight_n - row["min_n"] for row in rows_of_seed))
        samples["landing_speed"].append(max(row["landing_speed_m_per_s"] for row in rows_of_seed))
        samples["re_hit"].append(max(row["re_hit_m_per_s"] for row in rows_of_seed))
        samples["offset"].append(max(row["offset_m"] for row in rows_of_seed))
        samples["stroke"].append(max(row["stroke_m"] for row in rows_of_seed))
        samples["stroke_speed"].append(max(row["stroke_speed_m_per_s"] for row in rows_of_seed))
    for name in next(iter(by_seed.values()), [{}])[0]:
        if name.startswith(("rope_load[", "rope_loss[")):
            samples[name] = [max(row[name] for row in by_seed[seed]) for seed in sorted(by_seed)]
    return {name: values for name, values in samples.items() if np.isfinite(values).all()}


@dataclass(frozen=True)
class CriteriaAssessment:
    """Characteristic values in one sea state, and their use of the limits."""

    height_m: float
    seeds: int
    values: Mapping[str, Extreme]  # by quantity
    uses: Mapping[str, Extreme]  # value over limit, by criterion
    slack_share: float  # of the time, over all seeds
    failures: int  # runs that did not reach their end
    fault: str = ""  # why the sea could not be run
    failure: str = ""  # of the first such run
    governing_seed: int = -1  # of the largest use
    governing_leg: int = 0

    @property
    def governing(self) -> str:
        """Return the criterion with the largest use; "" if nothing was judged."""
        return max(self.uses, key=lambda key: self.uses[key].value, default="")

    @property
    def use(self) -> float:
        """Return the largest use; infinite if the sea could not be run."""
        if self.fault or self.failures:
            return math.inf
        return max((use.value for use in self.uses.values()), default=0.0)

    @property
    def passed(self) -> bool:
        """Return whether all criteria are met."""
        return self.use <= 1.0

    @property
    def clear(self) -> bool:
        """Return whether the intervals leave no doubt about it."""
        if not math.isfinite(self.use):
            return True
        above = any(use.low > 1.0 for use in self.uses.values())
        return above or all(use.high <= 1.0 for use in self.uses.values())

    def narrow(self, within: float) -> bool:
        """Return whether the values that count are known to ± this share of them.

        They are the hook load, the governing one, and each whose interval contains its limit.
        """
        count = [use for use in self.uses.values() if use.low <= 1.0 < use.high]
        count += [self.uses[self.governing]] if self.uses else []
        count += [self.values["hook_load"]] if "hook_load" in self.values else []
        return all(value.half_width <= within for value in count)


def judge(
    plan: Plan,
    limits: Sequence[Limit],
    rows: Sequence[Row],
    height_m: float,
    legs: Sequence[Leg],
) -> CriteriaAssessment:
    """Return the judgement of rows of a sea state; legs: of the phase, by their numbers."""
    weight_n = legs[0].payload_n
    failures = [row["failure"] for row in rows if row["failure"]]
    samples = samples_of([row for row in rows if not row["failure"]], weight_n)
    method, values = plan.method, {}
    for name, sample in samples.items():
        if len(sample) >= MIN_SEEDS:
            values[name] = characteristic_maximum(sample, method.percentile, method.confidence)
    uses = {
        limit.key: values[limit.quantity].scaled(1.0 / limit.most)
        for limit in limits
        if limit.quantity in values and limit.most > 0.0
    }
    beyond = next((limit for limit in limits if limit.most <= 0.0), None)
    fault = f"{beyond.key} is out of reach at rest" if beyond is not None else ""
    seed, leg = _governing_run(limits, uses, rows, weight_n)
    return CriteriaAssessment(
        height_m=height_m,
        seeds=len({row["seed"] for row in rows}),
        values=values,
        uses=uses,
        slack_share=_slack_share(rows, legs),
        failures=len(failures),
        fault=fault,
        failure=next(iter(failures), ""),
        governing_seed=seed,
        governing_leg=leg,
    )


def _slack_share(rows: Sequence[Row], legs: Sequence[Leg]) -> float:
    """Return the share of the time of all runs, each of which has one over its own exposure."""
    windows_s = [legs[int(row["leg"])].window_s for row in rows]
    shares = [row["slack_share"] for row in rows]
    return float(np.average(shares, weights=windows_s)) if rows else 0.0


def _governing_run(
    limits: Sequence[Limit], uses: Mapping[str, Extreme], rows: Sequence[Row], weight_n: float
) -> tuple[int, int]:
    """Return seed and leg of the run with the largest value of the governing quantity."""
    complete = [row for row in rows if not row["failure"]]
    if not uses or not complete:
        return -1, 0
    key = max(uses, key=lambda name: uses[name].value)
    quantity = next(limit.quantity for limit in limits if limit.key == key)
    governing = max(complete, key=lambda row: samples_of([row], weight_n)[quantity][0])
    return int(governing["seed"]), int(governing["leg"])


def simplified_uses(limits: Sequence[Limit], loads: Sequence[Simplified], weight_n: float
                    ) -> dict[str, float]:  # fmt: skip
    """Return the use of each criterion by the simplified method, infinite where it is out of reach
    at rest; loads: one of each leg.
    """
    values = {
        "hook_load": max(load.hook_n for load in loads),
        "uplift": max(load.uplift_share for load in loads),
        "lower_end_load": max(load.payload_max_n for load in loads),
        "loss": weight_n - min(load.payload_min_n for load in loads),
        "landing_speed": max(load.payload_m_per_s for load in loads),
        "re_hit": max(load.re_hit_m_per_s for load in loads),
        "offset": max(load.offset_m for load in loads),
        "stroke": max(load.tip_m for load in loads),
        "stroke_speed": max(load.tip_m_per_s for load in loads),
    }
    return {
        limit.key: values[limit.quantity] / limit.most if limit.most > 0.0 else math.inf
        for limit in limits
    }
