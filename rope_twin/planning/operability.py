"""Operability: how often, and after how long a wait, a hindcast stays within limiting sea states.

Limits are significant wave heights over peak period and, where it matters, heading of the waves
relative to the bow, for each phase of the operation; an operation needs all its phases. A forecast
is uncertain, so that the weather must be forecast below α times the limit: OP_WF = α·OP_LIM, over
the reference period T_R = T_POP + contingency (DNV-ST-N001, 2.6). α is the user's table.

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
HEADING_MOST_DEG = 360.0  # either way, as for headings in scenes and plans
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
            if angle is not None and not abs(angle) <= HEADING_MOST_DEG:
                remedy = f"give degrees within ±{HEADING_MOST_DEG:g}"
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
        """Return that of values (n,); nan if there are none.

        A percentile is the smallest value that at least so many per cent do not exceed.
        """
        if not len(values_s):
            return cls(math.nan, (math.nan,) * len(PERCENTILES))
        found = np.percentile(values_s, PERCENTILES, method="inverted_cdf")
        known = values_s[np.isfinite(values_s)]
        mean = float(known.mean()) if len(known) else math.inf
        return cls(mean, tuple(float(one) for one in found))


@dataclass(frozen=True)
class Period:
    """Operability of the whole hindcast, or of one month of every year."""

    name: str
    samples: int
    within_limit: float  # share of the time within the limit
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
    aside: float  # share of the rows at headings that they do not cover
    alpha: tuple[float, float]  # smallest and largest used
    whole: Period
    months: tuple[Period, ...]
    calm: Spread  # lengths of the spells within α times the limit
    storm: Spread  # and of those above it
    phases: Mapping[str, float]  # share of the time within the limit of each phase alone


def operability(
    hindcast: Hindcast, limits: LimitTable, operation: Operation, alpha: AlphaTable | None = None
) -> Operability:
    """Return the operability of an operation.

    alpha: None for α = 1, weather known beforehand.

    Raises:
        InputError: the limits depend on a heading that is not given, the hindcast is shorter than
            T_R, or α is not known for the period or a limit.
    """
    steps = math.ceil(operation.reference_s / hindcast.step_s * (1.0 - WHOLE))
    if steps >= len(hindcast.hs_m):
        hours = operation.reference_s / SECONDS_PER_HOUR
        problem = f"it is shorter than T_R = {hours:g} h"
        raise InputError(hindcast.source, problem, "give a longer one")
    known = np.isfinite(hindcast.hs_m)
    heading = _headings(hindcast, limits, operation)
    each = {name: limits.at(name, hindcast.tp_s, heading) for name in limits.phases}
    limit = np.min(np.stack(list(each.values())), axis=0)  # nan at periods that are not covered
    covered = known & np.isfinite(limit)
    aside = ~np.all([limits.covers(name, heading) for name in limits.phases], axis=0)
    factor = np.ones(len(limit))
    if alpha is not None:
        factor[covered] = alpha.at(limit[covered], operation.planned_s, operation.reference_s)
    with np.errstate(invalid="ignore"):
        inside = covered & (hindcast.hs_m <= limit)
        calm = covered & (hindcast.hs_m <= factor * limit)
        alone = {name: known & (hindcast.hs_m <= own) for name, own in each.items()}
    starts = _starts(calm, steps)
    wait = _waits(starts) * hindcast.step_s
    months = hindcast.month

    def period(name: str, chosen: Flags) -> Period:
        rows = chosen & known
        own = wait[chosen]
        return Period(
            name, int(rows.sum()), _share(inside, rows), _share(calm, rows),
            _share(starts, chosen), Spread.of(own), Spread.of(own + operation.reference_s),
        )  # fmt: skip

    used = factor[covered] if covered.any() else np.ones(1)
    return Operability(
        operation, hindcast.step_s, len(known) * hindcast.step_s / (365.25 * 86400.0),
        1.0 - float(known.mean()), _share(~np.isfinite(limit) & ~aside, known),
        _share(aside, known),
        (float(used.min()), float(used.max())), period("all", np.ones(len(known), bool)),
        tuple(period(MONTHS[k], months == k + 1) for k in range(12) if (months == k + 1).any()),
        Spread.of(_spells(calm, True) * hindcast.step_s),
        Spread.of(_spells(calm, False) * hindcast.step_s),
        {name: _share(own, known) for name, own in alone.items()},
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
    found = np.zeros(len(calm), bool)
    found[: len(calm) - steps] = count[steps + 1 :] - count[: len(calm) - steps] == steps + 1
    return found


def _waits(starts: Flags) -> Vector:
    """Return steps from each sample to the next possible start, (n,); inf if there is none."""
    after = np.where(starts, np.arange(len(starts), dtype=float), np.inf)
    nearest = np.minimum.accumulate(after[::-1])[::-1]
    return np.asarray(nearest - np.arange(len(starts)))


def _spells(calm: Flags, wanted: bool) -> Vector:
    """Return the lengths [steps] of spells that begin and end within the hindcast, (k,)."""
    edges = np.flatnonzero(np.diff(calm.astype(np.int8))) + 1
    lengths = np.diff(edges)
    return np.asarray(lengths[calm[edges[:-1]] == wanted], np.float64)


def _share(flags: Flags, of: Flags) -> float:
    count = int(of.sum())
    return int((flags & of).sum()) / count if count else math.nan


def table_rows(found: Operability) -> list[list[str]]:
    """Return the table: a row for the whole hindcast and each month."""
    rows = [["", "within limit", "within α·limit", "starts",
             *(f"wait P{p:.0f} [h]" for p in PERCENTILES),
             *(f"duration P{p:.0f} [h]" for p in PERCENTILES)]]  # fmt: skip
    for own in (*found.months, found.whole):
        shares = (own.within_limit, own.within_forecast, own.possible_starts)
        times = (*own.wait.percentiles_s, *own.duration.percentiles_s)
        rows.append([own.name, *(f"{100.0 * share:.1f} %" for share in shares),
                     *(hours_text(one) for one in times)])  # fmt: skip
    return rows


def hours_text(seconds: float) -> str:
    """Return hours in words; "-" beyond the end of the hindcast."""
    return f"{seconds / SECONDS_PER_HOUR:.0f}" if math.isfinite(seconds) else "-"


def figures(found: Operability) -> dict[str, Any]:
    """Return everything for `--json`, times in seconds."""
    return {
        "planned_s": found.operation.planned_s,
        "contingency_s": found.operation.contingency_s,
        "reference_s": found.operation.reference_s,
        "step_s": found.step_s,
        "years": found.years,
        "missing_share": found.missing,
        "not_covered_share": found.not_covered,
        "heading_not_covered_share": found.aside,
        "alpha": list(found.alpha),
        "phases_within_limit": dict(found.phases),
        "periods": [_period_figures(own) for own in (found.whole, *found.months)],
        "calm_spells": _spread_figures(found.calm),
        "storms": _spread_figures(found.storm),
    }


def _period_figures(own: Period) -> dict[str, Any]:
    return {
        "name": own.name, "samples": own.samples, "within_limit": own.within_limit,
        "within_forecast": own.within_forecast, "possible_starts": own.possible_starts,
        "wait": _spread_figures(own.wait), "duration": _spread_figures(own.duration),
    }  # fmt: skip


def _spread_figures(own: Spread) -> dict[str, float]:
    named = zip(PERCENTILES, own.percentiles_s, strict=True)
    return {"mean_s": own.mean_s} | {f"p{p:.0f}_s": value for p, value in named}


def panels(found: Operability) -> Sequence[Panel]:
    """Return the picture: shares and waiting by month."""
    month = [MONTHS.index(own.name) + 1 for own in found.months]
    shares = (
        Line(month, [100.0 * own.within_limit for own in found.months], "within limit", "o-"),
        Line(month, [100.0 * own.within_forecast for own in found.months], "within α·limit", "s-"),
        Line(month, [100.0 * own.possible_starts for own in found.months], "possible start", "^-"),
    )
    waits = tuple(
        Line(month, [own.wait.percentiles_s[k] / SECONDS_PER_HOUR for own in found.months],
             f"P{p:.0f}", "o-")
        for k, p in enumerate(PERCENTILES)
    )  # fmt: skip
    hours = found.operation.reference_s / SECONDS_PER_HOUR
    return (
        Panel("share of the time", "month", "%", shares),
        Panel(f"wait for a window of {hours:g} h", "month", "h", waits),
    )
