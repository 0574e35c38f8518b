"""Reference solution of a convergence study, with its own uncertainty.

Three grids in the element length (n, n/2, n/4 elements) and three in the time step (h, 2h, 4h).
With the differences d₂ of the middle and d₁ of the coarse grid to the next finer one the order is p
= log₂(d₁/d₂), and the finest grid's own error is about d₂/(2^p - 1) (Richardson 1911); 1.25 times
that is the uncertainty (grid convergence index, Roache 1998, chapter 5). An order above 2, the
formal one, is coincidental and counts as 2. An order below LEAST_ORDER is not an order: if the
differences matter, the quantity does not converge, and the spread over the grids is reported
instead.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from rope_twin.studies.accuracy.figures import BY_NAME, Values, differences, values
from rope_twin.studies.accuracy.run import Course, Series, Setting, Trial

SAFETY, FORMAL_ORDER, LEAST_ORDER = 1.25, 2.0, 0.4
NO_ORDER = 3.0  # safety where there is no order: the factor for two grids
LITTLE = {"%": 5.0, "m": 0.1}  # three times differences that do not matter though they do not fall
NOTHING = {"%": 1e-6, "m": 1e-8}  # round-off


@dataclass(frozen=True)
class Doubt:
    """Uncertainty of one quantity of the reference, in the quantity's unit."""

    element_order: float | None  # None: there was none, or nothing to measure it by
    step_order: float | None
    uncertainty: float | None  # None: not converged
    spread: tuple[float, float] | None  # where not converged: least and largest over the grids


@dataclass(frozen=True)
class Reference:
    """The finest run, what it found, and how far to trust it."""

    setting: Setting
    series: Series
    values: Values
    doubts: dict[str, Doubt]


def find_reference(course: Course, setting: Setting, report: Callable[[str], None]) -> Reference:
    """Run the five grids around the finest setting, each tighter in tolerance than the scene.

    Raises:
        RopeTwinError: a run failed.
    """
    n, h, tolerance = setting.elements, setting.step_s, setting.tolerance_n
    grids = [(n, h), (n // 2, h), (n // 4, h), (n, 2.0 * h), (n, 4.0 * h)]
    runs = []
    for elements, step_s in grids:
        one = Setting(elements, step_s, tolerance)
        report(f"reference, {one}")
        runs.append(Trial(course, one).look())
    return judge(setting, runs)


def judge(setting: Setting, runs: list[Series]) -> Reference:
    """Return the reference from the runs: the finest, two coarser in elements, two in time step."""
    fine, n2, n4, h2, h4 = runs
    by_element = differences(n4, n2), differences(n2, fine)
    by_step = differences(h4, h2), differences(h2, fine)
    seen = [values(one) for one in runs]
    doubts = {}
    for name, quantity in BY_NAME.items():
        pairs = [(coarse[name], middle[name]) for coarse, middle in (by_element, by_step)]
        parts = [uncertainty(*pair, quantity.unit) for pair in pairs]
        known = [one for one, _ in parts]
        total = None if None in known else math.fsum(one for one in known if one is not None)
        spread = None if total is not None else _spread(name, seen, [*by_element, *by_step])
        doubts[name] = Doubt(parts[0][1], parts[1][1], total, spread)
    return Reference(setting, fine, seen[0], doubts)


def uncertainty(
    coarse: float | None, middle: float | None, unit: str
) -> tuple[float | None, float | None]:
    """Return uncertainty and order of the finest grid from two differences; None if not defined.

    Both differences None (nothing to compare, as the peaks of snaps without slack): zero.
    """
    if coarse is None and middle is None:
        return 0.0, None
    if coarse is None or middle is None:
        return None, None
    d1, d2 = abs(coarse), abs(middle)
    if max(d1, d2) <= NOTHING[unit]:
        return max(d1, d2), None
    order = math.log2(d1 / d2) if d1 > 0.0 and d2 > 0.0 else math.inf if d2 == 0.0 else -math.inf
    if order < LEAST_ORDER:
        most = NO_ORDER * max(d1, d2)
        return (most, None) if most <= LITTLE[unit] else (None, None)
    p = min(order, FORMAL_ORDER)
    # Where the order is chance, what the coarse grid's difference makes of it counts.
    d2 = max(d2, d1 / 2.0**FORMAL_ORDER)
    return SAFETY * d2 / (2.0**p - 1.0), order if math.isfinite(order) else None


_SPREAD_OF = {
    "tension_mean": "tension_mean_n",
    "tension_std": "tension_std_n",
    "tension_peak": "tension_max_n",
    "tension_trough": "tension_min_n",
    "snap_peak": "snap_peak_n",
    "slack_share": "slack_share",
}


def _spread(name: str, seen: list[Values], apart: list[Values]) -> tuple[float, float] | None:
    """Return minimum and maximum over the grids; for an RMS quantity, of the differences."""
    if name in _SPREAD_OF:
        found = [one[_SPREAD_OF[name]] for one in seen]
    else:
        found = [one[name] for one in apart]
    held = [one for one in found if one is not None]
    return (min(held), max(held)) if held else None
