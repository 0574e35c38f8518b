"""Operability: how often, and after how long a wait, a hindcast stays within limiting sea states.

Limits are significant wave heights over peak period and, where it matters, heading of the waves
relative to the bow, for each phase of the operation; an operation needs all its phases. A forecast
is uncertain, so that the weather must be forecast below α times the limit: OP_WF = α·OP_LIM, over
the reference period T_R = T_POP + contingency (DNV-ST-N001, 2.6). α is the user's table. Below its
lowest Hs (1 m in that standard) α is not defined: no start is planned in such a limit.

A start at t is possible if every sample from t to t + T_R is within α times the limit. From each
sample of the hindcast the operation waits for the next possible start: percentiles of that wait,
by month of readiness, keep the persistence of the weather as it was.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rope_twin.errors import InputError
from rope_twin.planning.weather_files import AlphaTable, Hindcast, LimitTable
from rope_twin.sea.tables import Vector
from rope_twin.studies.picture import Line, Panel

PERCENTILES = (50.0, 90.0)
MONTHS = ("Jan", "Feb", "Mar", "Apr", "May", "Jun", "Jul", "Aug", "Sep", "Oct", "Nov", "Dec")
SECONDS_PER_HOUR = 3600.0
MAX_HEADING_DEG = 360.0  # either way, as for headings in scenes and plans
SHORTEST_S = 60.0  # of a planned period: less is hours without their unit
WHOLE = 1e-9  # relative: a period that is so near to whole steps is that many

Flags = NDArray[np.bool_]


@dataclass(frozen=True)
class Operation:
    """Periods of an operation, and how the vessel heads."""

    planned_s: float  # T_POP
    contingency_s: float
    bow_deg: float | None = None  # compass heading, clockwise from north
    relative_deg: float | None = None  # heading of the waves relative to the bow, kept by turning

    def __post_init__(self) -> None:
        """Check the periods and that at most one heading is given. Raises InputError."""
        if not (math.isfinite(self.planned_s) and self.planned_s > 0.0):
            problem = f"it is {self.planned_s / SECONDS_PER_HOUR:g} h"
            raise InputError("planned period", problem, "give a time above 0")
        if self.planned_s < SHORTEST_S:
            problem = f"it is {self.planned_s:g} s"
            raise InputError("planned period", problem, "give it with its unit, like 6h")
        if not (math.isfinite(self.contingency_s) and self.contingency_s >= 0.0):
            problem = f"it is {self.contingency_s / SECONDS_PER_HOUR:g} h"
            raise InputError("contingency", problem, "give 0 or more")
        if self.bow_deg is not None and self.relative_deg is not None:
            problem = "the heading is given over ground and relative to the waves"
            raise InputError("heading", problem, "keep one of them")
        for angle in (self.bow_deg, self.relative_deg):
            if angle is not None and not abs(angle) <= MAX_HEADING_DEG:
                remedy = f"give degrees within ±{MAX_HEADING_DEG:g}"
                raise InputError("heading", f"it is {angle:g}°", remedy)

    @property
    def reference_s(self) -> float:
        """Return T_R = T_POP + contingency."""
        return self.planned_s + self.contingency_s


@dataclass(frozen=True)
class Spread:
    """Mean and percentiles (PERCENTILES) of a duration [s].

    Waits that the end of the hindcast cuts off are infinite: they count in the percentiles, which
    may then be infinite, and are left out of the mean.
    """

    mean_s: float
    percentiles_s: tuple[float, ...]

    @classmethod
    def of(cls, values_s: Vector) -> Spread:
        """Return mean and percentiles of values (n,); nan if there are none.

        A percentile is the smallest value that at least so many per cent do not exceed.
        """
        if not len(values_s):
            return cls(math.nan, (math.nan,) * len(PERCENTILES))
        percentiles_s = np.percentile(values_s, PERCENTILES, method="inverted_cdf")
        known = values_s[np.isfinite(values_s)]
        mean = float(known.mean()) if len(known) else math.inf
        return cls(mean, tuple(float(seconds) for seconds in percentiles_s))


@dataclass(frozen=True)
class Period:
    """Operability of the whole hindcast, or of one month of every year."""

    name: str
    samples: int  # rows of the hindcast
    within_limit: float  # share of the time within the limit; time without a row is above it
    within_forecast: float  # share of the time within α times the limit
    possible_starts: float  # share of samples at which T_R within α times the limit begins
    wait: Spread  # from readiness to the next possible start
    duration: Spread  # wait and T_R


@dataclass(frozen=True)
class Operability:
    """Share of time, windows and waiting that a hindcast and limits give."""

    operation: Operation
    step_s: float
    years: float
    missing: float  # share of the time without a row in the hindcast
    not_covered: float  # share of the rows at periods that the limits do not cover
    heading_not_covered: float  # share of the rows at headings that they do not cover
    without_alpha: float  # share of the rows within a limit that has no alpha factor
    alpha: tuple[float, float]  # smallest and largest used, where Hs is within the limit
    whole: Period
    months: tuple[Period, ...]
    calm: Spread  # lengths of the spells within α times the limit
    storm: Spread  # and of those above it
    phases: Mapping[str, float]  # as `within_limit`, of each phase alone


def operability(
    hindcast: Hindcast, limits: LimitTable, operation: Operation, alpha: AlphaTable | None = None
) -> Operability:
    """Return the operability of an operation.

    alpha: None for α = 1, weather known beforehand.

    Raises:
        InputError: the limits depend on a heading that is not given, the hindcast is shorter than
            T_R, or α is not known for the period or for any limit that the weather is within.
    """
    steps = math.ceil(operation.reference_s / hindcast.step_s * (1.0 - WHOLE))
    if steps >= len(hindcast.hs_m):
        hours = operation.reference_s / SECONDS_PER_HOUR
        problem = f"it is shorter than T_R = {hours:g} h"
        raise InputError(hindcast.source, problem, "give a longer one")
    known = np.isfinite(hindcast.hs_m)
    heading = _headings(hindcast, limits, operation)
    phase_limits = {name: limits.at(name, hindcast.tp_s, heading) for name in limits.phases}
    # nan at periods that are not covered
    limit = np.min(np.stack(list(phase_limits.values())), axis=0)
    covered = known & np.isfinite(limit)
    heading_not_covered = ~np.all([limits.covers(name, heading) for name in limits.phases], axis=0)
    factor = np.ones(len(limit))
    with np.errstate(invalid="ignore"):
        inside = covered & (hindcast.hs_m <= limit)
        if alpha is not None:  # above the limit no α, at most 1, makes a difference
            factor[inside] = alpha.at(limit[inside], operation.planned_s, operation.reference_s)
        calm = covered & (hindcast.hs_m <= factor * limit)
        phase_is_calm = {
            name: known & (hindcast.hs_m <= limit_hs) for name, limit_hs in phase_limits.items()
        }
    starts = _starts(calm, steps)
    wait = _waits(starts) * hindcast.step_s
    months = hindcast.month

    def period(name: str, in_period: Flags) -> Period:
        wait_s = wait[in_period]
        return Period(
            name, int((in_period & known).sum()), _share(inside, in_period),
            _share(calm, in_period),
            _share(starts, in_period), Spread.of(wait_s), Spread.of(wait_s + operation.reference_s),
        )  # fmt: skip

    has_alpha = np.isfinite(factor)
    alphas = factor[inside & has_alpha] if inside.any() else np.ones(1)
    return Operability(
        operation, hindcast.step_s, len(known) * hindcast.step_s / (365.25 * 86400.0),
        1.0 - float(known.mean()), _share(~np.isfinite(limit) & ~heading_not_covered, known),
        _share(heading_not_covered, known), _share(~has_alpha, known),
        (float(alphas.min()), float(alphas.max())), period("all", np.ones(len(known), bool)),
        tuple(period(MONTHS[k], months == k + 1) for k in range(12) if (months == k + 1).any()),
        Spread.of(_spells(calm, True) * hindcast.step_s),
        Spread.of(_spells(calm, False) * hindcast.step_s),
        {name: float(is_calm.mean()) for name, is_calm in phase_is_calm.items()},
    )  # fmt: skip


def _headings(hindcast: Hindcast, limits: LimitTable, operation: Operation) -> Vector:
    """Return the heading of the waves relative to the bow of each sample [deg], (n,).

    0 for following seas, 180 for head seas, 90 for waves that travel to port: bow - direction of
    propagation, both clockwise from north.
    """
    count = len(hindcast.hs_m)
    if not limits.has_headings:
        return np.zeros(count)
    if operation.relative_deg is not None:
        return np.full(count, operation.relative_deg)
    if operation.bow_deg is None:
        problem = "the limits depend on the heading of the waves"
        remedy = "give the compass heading of the bow (--bow), or that relative to the waves"
        raise InputError(limits.source, problem, f"{remedy} (--relative)")
    if hindcast.towards_deg is None:
        remedy = "add direction_from_deg or direction_to_deg, or give --relative"
        raise InputError(hindcast.source, "it has no direction of the waves", remedy)
    return np.asarray(operation.bow_deg - hindcast.towards_deg)


def _starts(calm: Flags, steps: int) -> Flags:
    """Return whether a sample and the `steps` after it are calm, (n,); False near the end."""
    count = np.concatenate([[0], np.cumsum(calm)])
    is_start = np.zeros(len(calm), bool)
    is_start[: len(calm) - steps] = count[steps + 1 :] - count[: len(calm) - steps] == steps + 1
    return is_start


def _waits(starts: Flags) -> Vector:
    """Return steps from each sample to the next possible start, (n,); inf if there is none."""
    after = np.where(starts, np.arange(len(starts), dtype=float), np.inf)
    nearest = np.minimum.accumulate(after[::-1])[::-1]
    return np.asarray(nearest - np.arange(len(starts)))


def _spells(calm: Flags, is_calm: bool) -> Vector:
    """Return the lengths [steps] of spells that begin and end within the hindcast, (k,)."""
    edges = np.flatnonzero(np.diff(calm.astype(np.int8))) + 1
    lengths = np.diff(edges)
    return np.asarray(lengths[calm[edges[:-1]] == is_calm], np.float64)


def _share(flags: Flags, among: Flags) -> float:
    count = int(among.sum())
    return int((flags & among).sum()) / count if count else math.nan


def table_rows(result: Operability) -> list[list[str]]:
    """Return the table: a row for the whole hindcast and each month."""
    rows = [["", "within limit", "within α·limit", "starts",
             *(f"wait P{p:.0f} [h]" for p in PERCENTILES),
             *(f"duration P{p:.0f} [h]" for p in PERCENTILES)]]  # fmt: skip
    for period in (*result.months, result.whole):
        shares = (period.within_limit, period.within_forecast, period.possible_starts)
        times = (*period.wait.percentiles_s, *period.duration.percentiles_s)
        rows.append([period.name, *(f"{100.0 * share:.1f} %" for share in shares),
                     *(hours_text(seconds) for seconds in times)])  # fmt: skip
    return rows


def hours_text(seconds: float) -> str:
    """Return hours in words, to a hundredth; "-" beyond the end of the hindcast."""
    return f"{round(seconds / SECONDS_PER_HOUR, 2):g}" if math.isfinite(seconds) else "-"


def figures(result: Operability) -> dict[str, Any]:
    """Return everything for `--json`, times in seconds."""
    return {
        "planned_s": result.operation.planned_s,
        "contingency_s": result.operation.contingency_s,
        "reference_s": result.operation.reference_s,
        "step_s": result.step_s,
        "years": result.years,
        "missing_share": result.missing,
        "not_covered_share": result.not_covered,
        "heading_not_covered_share": result.heading_not_covered,
        "without_alpha_share": result.without_alpha,
        "alpha": list(result.alpha),
        "phases_within_limit": dict(result.phases),
        "periods": [_period_figures(period) for period in (result.whole, *result.months)],
        "calm_spells": _spread_figures(result.calm),
        "storms": _spread_figures(result.storm),
    }


def _period_figures(period: Period) -> dict[str, Any]:
    return {
        "name": period.name, "samples": period.samples, "within_limit": period.within_limit,
        "within_forecast": period.within_forecast, "possible_starts": period.possible_starts,
        "wait": _spread_figures(period.wait), "duration": _spread_figures(period.duration),
    }  # fmt: skip


def _spread_figures(spread: Spread) -> dict[str, float]:
    percentiles = zip(PERCENTILES, spread.percentiles_s, strict=True)
    return {"mean_s": spread.mean_s} | {f"p{p:.0f}_s": value for p, value in percentiles}


def panels(result: Operability) -> Sequence[Panel]:
    """Return the picture: shares and waiting by month."""
    month = [MONTHS.index(item.name) + 1 for item in result.months]
    shares = (
        Line(month, [100.0 * item.within_limit for item in result.months], "within limit", "o-"),
        Line(
            month, [100.0 * item.within_forecast for item in result.months], "within α·limit", "s-"
        ),
        Line(
            month, [100.0 * item.possible_starts for item in result.months], "possible start", "^-"
        ),
    )
    waits = tuple(
        Line(month, [item.wait.percentiles_s[k] / SECONDS_PER_HOUR for item in result.months],
             f"P{p:.0f}", "o-")
        for k, p in enumerate(PERCENTILES)
    )  # fmt: skip
    hours = result.operation.reference_s / SECONDS_PER_HOUR
    return (
        Panel("share of the time", "month", "%", shares),
        Panel(f"wait for a window of {hours:g} h", "month", "h", waits),
    )
