"""Selection of a resolution: the cheapest within an error, or the most accurate within a budget.

A coarse resolution may have a small error by coincidental cancellation, which grows again on
refinement. Such errors are not used: a level counts with the largest error among itself and all
levels that are finer in both elements and time step.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Protocol, TypeVar

from rope_twin.scene.card import Rung


class Priced(Protocol):
    """Accuracy level with a speed."""

    @property
    def real_time_factor(self) -> float:
        """Return simulation time over computing time."""

    def place(self) -> tuple[int, float, float | None]:
        """Return elements, time step [s] and tolerance [N] (None: the scene's own)."""

    def bound(self, name: str) -> float:
        """Return the error bound of a quantity; NaN if it is unknown."""


NOTHING = 1e-6  # below, errors are round-off
P = TypeVar("P", bound=Priced)


def sure_bound(rung: Priced, rungs: Iterable[Priced], name: str) -> float:
    """Return the bound without coincidental cancellation; NaN if a finer level has none."""
    elements, step_s, tolerance = rung.place()
    finer = [
        other.bound(name)
        for other in rungs
        if (place := other.place())[2] == tolerance and place[0] >= elements and place[1] <= step_s
    ]
    return math.nan if any(map(math.isnan, finer)) else max(finer)


def cheapest_within(rungs: Sequence[P], name: str, target: float) -> P | None:
    """Return the fastest level with the scene's own tolerance whose bound is at most `target`."""
    own = [rung for rung in rungs if rung.place()[2] is None]
    good = [rung for rung in own if sure_bound(rung, own, name) <= target]
    return max(good, key=lambda rung: rung.real_time_factor, default=None)


def most_accurate(rungs: Sequence[P], name: str, costs: Sequence[float], budget: float) -> P | None:
    """Return the level with the smallest bound among those whose cost is within the budget.

    Of levels whose bounds differ by less than a tenth, the cheapest is returned.
    """
    fitting = [
        (sure_bound(rung, rungs, name), cost, rung)
        for rung, cost in zip(rungs, costs, strict=True)
        if cost <= budget
    ]
    known = [entry for entry in fitting if not math.isnan(entry[0])]
    if not known:
        return None
    least = min(entry[0] for entry in known)
    alike = [entry for entry in known if entry[0] <= max(1.1 * least, NOTHING)]
    return min(alike, key=lambda entry: entry[1])[2]


def next_better(rungs: Sequence[P], name: str, bound: float, costs: Sequence[float]) -> P | None:
    """Return the cheapest level with a bound smaller by at least a tenth; None if there is none."""
    better = [
        (cost, number)
        for number, (rung, cost) in enumerate(zip(rungs, costs, strict=True))
        if sure_bound(rung, rungs, name) < max(0.9 * bound, NOTHING)
    ]
    return rungs[min(better)[1]] if better and bound > NOTHING else None


def best_bound(rungs: Sequence[Rung], name: str) -> float:
    """Return the smallest error of all levels; NaN if none is known."""
    bounds = [sure_bound(rung, rungs, name) for rung in rungs]
    return min((one for one in bounds if not math.isnan(one)), default=math.nan)
