"""The line search of a stage: where a correction overshot, back along it to R·delta = 0, about."""

from __future__ import annotations

from typing import Any

from rope_twin.core.jit.decorators import jit

SEARCH_FROM = 4  # the first correction that is searched along
SEARCH_EVALUATIONS = 8


@jit
def search(rope: Any, stage: Any, before: float, correct: Any, slope_of: Any) -> None:
    """Go to where R·delta is within a half of `before`, its value at the correction's start.

    rope: a rope or ropes that meet; `correct(rope, stage, factor)` lets a += factor·delta, and
    `slope_of(rope)` is R·delta there. Secants in a bracket that opens with (0, 1).
    """
    low, slope_low, high, slope_high = 0.0, before, 1.0, 0.0
    factor, here = 1.0, slope_of(rope)
    for evaluation in range(SEARCH_EVALUATIONS):
        if here < -0.5 * before:
            high, slope_high = factor, here
        elif evaluation > 0 and here > 0.5 * before:
            low, slope_low = factor, here
        else:
            return
        target = _secant(low, slope_low, high, slope_high)
        correct(rope, stage, target - factor)
        factor, here = target, slope_of(rope)


@jit
def _secant(low: float, slope_low: float, high: float, slope_high: float) -> float:
    """Where the straight line through the bracket's ends crosses 0, inside 5 to 95 % of it."""
    span = high - low
    cross = low + span * slope_low / (slope_low - slope_high)
    return min(max(cross, low + 0.05 * span), high - 0.05 * span)
