"""Which rung to take: the cheapest within an error, the most accurate within a budget.

A coarse setting may hit a peak by luck, an error that grows again when it is refined. Luck is not
bought: a rung counts with the largest error among itself and all rungs that are finer than it in
both elements and step.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Protocol, TypeVar

from rope_twin.scene.card import Rung


class Priced(Protocol):
    """A rung with a speed."""

    @property
    def real_time_factor(self) -> float:
        """Simulated time over time taken."""

    def place(self) -> tuple[int, float, float | None]:
        """Elements, step [s] and tolerance [N] (None: the scene's own)."""

    def bound(self, name: str) -> float:
        """What the error of a quantity is at most; NaN where it is unknown."""


NOTHING = 1e-6  # below, errors are round-off
P = TypeVar("P", bound=Priced)


def sure_bound(rung: Priced, rungs: Iterable[Priced], name: str) -> float:
    """The bound without luck; NaN where one of the finer rungs has none."""
    elements, step_s, tolerance = rung.place()
    finer = [
        other.bound(name)
        for other in rungs
        if (place := other.place())[2] == tolerance and place[0] >= elements and place[1] <= step_s
    ]
    return math.nan if any(map(math.isnan, finer)) else max(finer)


def cheapest_within(rungs: Sequence[P], name: str, target: float) -> P | None:
    """The fastest rung with the scene's own tolerance whose bound is `target` at most."""
    own = [rung for rung in rungs if rung.place()[2] is None]
    good = [rung for rung in own if sure_bound(rung, own, name) <= target]
    return max(good, key=lambda rung: rung.real_time_factor, default=None)


def most_accurate(rungs: Sequence[P], name: str, costs: Sequence[float], budget: float) -> P | None:
    """The rung with the least bound among those whose cost is within the budget.

    Of rungs that cannot be told apart, since a finer one's bound is less by under a tenth, the
    cheapest is taken.
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
    """The cheapest rung whose bound is less by a tenth at least; None if there is none."""
    better = [
        (cost, number)
        for number, (rung, cost) in enumerate(zip(rungs, costs, strict=True))
        if sure_bound(rung, rungs, name) < max(0.9 * bound, NOTHING)
    ]
    return rungs[min(better)[1]] if better and bound > NOTHING else None


def best_bound(rungs: Sequence[Rung], name: str) -> float:
    """The least error that the ladder offers; NaN if none is known."""
    bounds = [sure_bound(rung, rungs, name) for rung in rungs]
    return min((one for one in bounds if not math.isnan(one)), default=math.nan)
