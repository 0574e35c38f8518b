"""Incremental rainflow counting of many series (ASTM E1049-85, 5.4.4).

For each series only the turning points of open ranges are stored. At each new turning point the
last two ranges are compared: a range covered by the next one is a cycle, or half a cycle if it
contains the first point. Ranges still open count as half cycles when the total is requested. All
series are processed together as arrays; the sum does not depend on how the samples were grouped.
"""

from __future__ import annotations

import copy
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from rope_twin.twin.fatigue.curves import Cycles, Vector

Numbers = NDArray[np.int64]
Damage = Callable[[Numbers, Cycles], Vector]  # damage of each cycle, given its series
INITIAL_CAPACITY = 16  # initial capacity for open turning points of a series


class RainflowCount:
    """Rainflow count of several series from their first value on; a NaN is skipped."""

    def __init__(self, series: int) -> None:
        self.used = np.zeros(series)  # damage by closed cycles
        self.cycles = np.zeros(series)  # number of closed cycles
        self._last = np.full(series, np.inf)  # newest value, inf: none yet
        self._way = np.zeros(series)  # direction: 1 up, -1 down, 0 not known yet
        self._open = np.zeros((series, INITIAL_CAPACITY))  # turning points
        self._count = np.zeros(series, np.int64)

    def take(self, values: Vector, cost: Damage) -> None:
        """Take the next value of each series, (series,)."""
        begun = np.isfinite(self._last)
        new = np.where(np.isnan(values), self._last, values)
        with np.errstate(invalid="ignore"):
            way = np.where(begun, np.sign(new - self._last), 0.0)
        turned = np.flatnonzero((way != 0.0) & (way != self._way))
        if len(turned):
            self._push(turned, self._last[turned], cost)
            self._way[turned] = way[turned]
        self._last = new

    def total(self, cost: Damage) -> Vector:
        """Return the damage of all cycles, with the open ones as half cycles, (series,)."""
        end = copy.deepcopy(self)
        begun = np.flatnonzero(end._count > 0)
        end._push(begun, end._last[begun], cost)
        deepest = int(end._count.max(initial=0))
        for k in range(deepest - 1):
            some = np.flatnonzero(end._count > k + 1)
            end._close(some, end._open[some, k], end._open[some, k + 1], 0.5, cost)
        return end.used

    def _push(self, which: Numbers, points: Vector, cost: Damage) -> None:
        """Add a turning point to these series, and close the cycles that it completes."""
        if int(self._count.max(initial=0)) + 1 >= self._open.shape[1]:
            self._open = np.hstack([self._open, np.zeros_like(self._open)])
        kept, count = self._open, self._count
        kept[which, count[which]] = points
        count[which] += 1
        which = which[count[which] >= 3]
        while len(which):
            at = count[which]
            low, middle, high = (kept[which, at - k] for k in (3, 2, 1))
            covered = np.abs(high - middle) >= np.abs(middle - low)
            which, at = which[covered], at[covered]
            low, middle, high = low[covered], middle[covered], high[covered]
            first = at == 3
            self._close(which, low, middle, np.where(first, 0.5, 1.0), cost)
            halves, wholes = which[first], which[~first]
            kept[halves, 0], kept[halves, 1] = middle[first], high[first]
            count[halves] -= 1
            kept[wholes, at[~first] - 3] = high[~first]
            count[wholes] -= 2
            which = which[count[which] >= 3]

    def _close(
        self, which: Numbers, one: Vector, other: Vector, count: Vector | float, cost: Damage
    ) -> None:
        if len(which):
            counts = np.broadcast_to(np.asarray(count, dtype=np.float64), one.shape)
            cycles = Cycles(np.abs(other - one), 0.5 * (one + other), counts)
            self.used[which] += cost(which, cycles)
            self.cycles[which] += counts
