"""Line search of a stage: where a correction overshoots, return along it to R·delta ≈ 0."""

from __future__ import annotations

from typing import Any

from rope_twin.core.jit.decorators import jit

SEARCH_FROM = 4  # the first correction with a line search
SEARCH_EVALUATIONS = 8


@jit
def search(rope: Any, stage: Any, before: float, correct: Any, slope_of: Any) -> None:
    """Move along the correction until |R·delta| is at most half of `before`, its start value.

    rope: a rope or a multi-line system; `correct(rope, stage, factor)` applies a += factor·delta,
    and `slope_of(rope)` is R·delta there. Secant steps in a bracket that starts as (0, 1).
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
    """Return the zero of the secant through the bracket's ends, inside 5 to 95 % of it."""
    span = high - low
    cross = low + span * slope_low / (slope_low - slope_high)
    return min(max(cross, low + 0.05 * span), high - 0.05 * span)
