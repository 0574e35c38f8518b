"""One implicit stage: x = x_hat + p·a, v = v_hat + q·a, solved for a by semismooth Newton.

The tension-only energy is convex in a, so there is one minimum. A stage is accepted when every
tension is what the linearisation expected of it; from the fourth correction on a secant line
search keeps Newton from overshooting between slack and taut (plain steps suffice before).
"""

from __future__ import annotations

from math import isfinite
from typing import Any

from rope_twin.core.assembly import add_correction, evaluate, set_flow, slope, update
from rope_twin.core.elastic import predict_tension, stretch_all, tension_agrees
from rope_twin.core.elimination import eliminate, root_stiffness
from rope_twin.core.jit import jit_inline
from rope_twin.core.state import ELEMENTS, SOLVES, SOLVES_MAX

CAP = 12  # corrections before the step is halved instead
SEARCH_FROM = 4  # the first correction that is searched along
SEARCH_EVALUATIONS = 8
NOT_FINITE, UNCONVERGED, CONVERGED = -1, 0, 1  # the worse, the smaller


@jit_inline
def solve_stage(rope: Any, stage: Any, tolerance: float) -> int:
    """Find the acceleration; motion and tension then belong to the stage's time.

    Returns CONVERGED, UNCONVERGED, or NOT_FINITE if a force is not.
    """
    state, work = rope.state, rope.work
    n, first = state.counts[ELEMENTS], rope.model.first_free
    low, slope_low, factor, searched = 0.0, 0.0, 1.0, 0  # the line search's lower bracket
    high, slope_high = 1.0, 0.0
    before, correction = 0.0, 0
    while True:
        update(work, stage.p, stage.q, first, n)
        stretch_all(rope, stage)
        if correction == 0:
            set_flow(rope, stage, 0, n)
        elif searched == 0 and tension_agrees(work, n, tolerance):
            state.health[SOLVES_MAX] = max(state.health[SOLVES_MAX], correction)
            return CONVERGED
        evaluate(rope, stage)
        if correction >= SEARCH_FROM and searched < SEARCH_EVALUATIONS:
            here = slope(work, first, n)
            overshot = here < -0.5 * before
            if overshot or (searched > 0 and here > 0.5 * before):
                low, slope_low, high, slope_high = _narrow(
                    factor, here, low, slope_low, high, slope_high, before, searched
                )
                target = _secant(low, slope_low, high, slope_high)
                add_correction(work, target - factor, first, n)
                factor, searched = target, searched + 1
                continue
        if correction == CAP:
            state.health[SOLVES_MAX] = CAP
            return UNCONVERGED
        root_stiffness(work, n)
        eliminate(work, first, n)
        state.health[SOLVES] += 1
        before = slope(work, first, n)
        if not isfinite(before):
            return NOT_FINITE
        predict_tension(work, n)
        add_correction(work, 1.0, first, n)
        factor, searched, correction = 1.0, 0, correction + 1


@jit_inline
def _narrow(factor: float, here: float, low: float, slope_low: float, high: float, slope_high: float, before: float, searched: int) -> Any:  # fmt: skip # noqa: E501
    """The bracket of R·delta = 0 after an evaluation at `factor`; it opens with (0, 1)."""
    if searched == 0:
        return 0.0, before, factor, here
    if here < 0.0:
        return low, slope_low, factor, here
    return factor, here, high, slope_high


@jit_inline
def _secant(low: float, slope_low: float, high: float, slope_high: float) -> float:
    """Where the straight line through the bracket's ends crosses 0, inside 5 to 95 % of it."""
    span = high - low
    cross = low + span * slope_low / (slope_low - slope_high)
    return min(max(cross, low + 0.05 * span), high - 0.05 * span)
