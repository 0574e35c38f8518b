"""What a budget buys beyond a card's ladder: a setting finer than all of its own."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

from rope_twin.scene.card import Rung

AIM, ENOUGH = 0.97, 5.0 / 6.0  # of the budget: what is aimed at, and what is left as it is
ROUNDS = 3  # of measuring what elements cost
MOST_ELEMENTS = 20_000  # as a scene's

Measure = Callable[[Rung], float]  # share of one core [%]


def spend_beyond(
    finest: Rung, share: float, budget: float, measure: Measure
) -> tuple[Rung, float] | None:
    """A setting finer than the finest of a ladder, and the share of one core that it needs [%].

    share: what the finest needs [%]; budget: what may be needed. Elements and step are refined
    alike, since the errors of both are of second order; the step in halves, which keep the topics'
    periods. None: the finest setting uses the budget up, or nothing finer fits into it.
    """
    if share >= ENOUGH * budget:
        return None
    halvings = max(0, round(0.5 * math.log2(AIM * budget / share)))
    rung = replace(finest, step_s=finest.step_s / 2**halvings)
    fitting = None
    for _ in range(ROUNDS):
        share = measure(rung)
        if share <= budget:
            fitting = rung, share
        wanted = round(rung.elements * AIM * budget / share)
        elements = min(max(wanted, finest.elements), MOST_ELEMENTS)
        if elements == rung.elements or ENOUGH * budget <= share <= budget:
            break
        rung = replace(rung, elements=elements)
    return fitting
