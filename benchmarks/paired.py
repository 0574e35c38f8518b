"""Times of ropes that step in turns, and their ratios, which a busy machine leaves as they are.

What else runs takes from neighbouring pieces alike: the ratio of two pieces of one round keeps its
value where each time does not. Every round goes the other way round, every set of rounds takes
fresh arrays (where these lie is worth a per cent or two), and times are the processor's own.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from rope_twin.core.state import Boundary
from validation.state_bench import Bench

CONFIDENCE, QUANTILE = 0.99, 2.5758  # of the interval of a median; of the normal distribution
Motion = Callable[[Bench, int], Boundary]  # of a rope from now on, so many steps


@dataclass(frozen=True)
class Plan:
    """Number and length of the rounds."""

    sets: int
    rounds: int  # of each set
    settle: int  # steps before the first round of a set
    steps: int  # of a piece


@dataclass(frozen=True)
class Ratio:
    """Median of ratios, and the interval that holds the true one with 99 %."""

    median: float
    low: float
    high: float

    @property
    def holds_one(self) -> bool:
        """Return whether the interval contains 1, so that both may be equal."""
        return self.low <= 1.0 <= self.high

    def __str__(self) -> str:
        """Return median and interval as text."""
        return f"{self.median:.3f} ({self.low:.3f} to {self.high:.3f})"


def ratio_of(times: Sequence[float], base: Sequence[float]) -> Ratio:
    """Return the ratio of times to those of the same rounds.

    The interval lies between two of the sorted ratios, n/2 ± 2.58·√n/2 (the sign test), at most the
    outermost.
    """
    ratios = np.sort(np.divide(times, base))
    n = len(ratios)
    half_width = 0.5 * QUANTILE * math.sqrt(n)
    low = max(math.floor(0.5 * n - half_width), 0)
    return Ratio(float(np.median(ratios)), float(ratios[low]), float(ratios[n - 1 - low]))


def time_rounds(
    make: Callable[[], Sequence[Bench]], motion: Motion, plan: Plan
) -> list[list[float]]:
    """Return the CPU seconds per step of each rope that `make` gives, in each round."""
    took: list[list[float]] = []
    for _ in range(plan.sets):
        benches = make()
        took = took or [[] for _ in benches]
        for bench in benches:
            bench.follow(motion(bench, plan.settle))
        for turn in range(plan.rounds):
            order = range(len(benches)) if turn % 2 == 0 else reversed(range(len(benches)))
            for i in order:
                boundary = motion(benches[i], plan.steps)
                began = time.process_time()
                benches[i].follow(boundary)
                took[i].append((time.process_time() - began) / plan.steps)
    return took
