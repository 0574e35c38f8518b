"""How a budget is spent: elements and step refined alike until the share asked for is used.

Both errors are of second order, so that a setting is most accurate for what it costs where step and
length of elements shrink in the same measure.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

from rope_twin.commands.run.calibration import Cost
from rope_twin.scene.card import Setting
from rope_twin.twin.pacing import SLOT_S

# Of the budget, in steps and messages: the rest is for the middleware and the other threads of the
# process, which no calibration sees, and for what they push out of the caches.
AIM, LEAST, MOST = 0.63, 0.60, 0.66
ROUNDS, BALANCED = 8, 4  # of measuring; in the first ones the step is chosen anew
GROWTH = 16.0  # from round to round at most: what hardly costs tells little of what costs much
IN_SLOT = (1, 2, 4, 5, 8, 10, 16, 20, 25, 32, 40, 50, 80, 100, 125, 160, 200)  # steps: whole slots
CEILING_PCT = 55.0  # of the time that there is: a run that needs more than 60 % begins on a ladder

Measure = Callable[[Setting], Cost]


class Bought(NamedTuple):
    """What a budget buys."""

    setting: Setting
    cost: Cost
    better: Setting  # the next one
    better_pct: float  # what that would need, by what this one does


def spend(start: Setting, budget_pct: float, most_elements: int, measure: Measure) -> Bought | Cost:
    """The setting in proportion to `start` that uses the budget; if `start` needs more, its cost.

    most_elements: that the rope may have.
    """
    goal = min(AIM * budget_pct, CEILING_PCT)
    low, high = LEAST / AIM * goal, MOST / AIM * goal
    setting, cost = start, measure(start)
    if cost.pct > high:
        return cost
    best, step_s = (setting, cost), start.step_s
    known = [(0.0, 0.0), (_work(setting), cost.pct)]
    for number in range(ROUNDS):
        if best[1].pct >= low or best[0].elements == most_elements:
            break
        work = _work_for(goal, known)
        if number < BALANCED:
            finer = math.sqrt(max(1.0, work / _work(start)))
            step_s = _nearest_step(start.step_s, finer)
        setting = Setting(min(max(round(work * step_s), start.elements), most_elements), step_s)
        cost = measure(setting)
        known = [known[-1], (_work(setting), cost.pct)]
        if best[1].pct < cost.pct <= high:
            best = setting, cost
    return Bought(*best, *_next(best[0], best[1].pct, most_elements))


def _work(setting: Setting) -> float:
    return setting.elements / setting.step_s


def _work_for(goal_pct: float, known: list[tuple[float, float]]) -> float:
    """By a line through the two newest of (work, share)."""
    (work_0, pct_0), (work_1, pct_1) = known[-2:]
    slope = (pct_1 - pct_0) / (work_1 - work_0) if work_1 != work_0 else 0.0
    if slope <= 0.0:
        slope = pct_1 / work_1
    work = work_1 + (goal_pct - pct_1) / slope
    return min(max(work, 0.5 * min(work_0, work_1) or 0.5 * work_1), GROWTH * work_1)


def _nearest_step(step_s: float, times: float) -> float:
    """Of the steps that fill a slot the one nearest to so many times finer, in proportion."""
    steps = [step_s, *(SLOT_S / count for count in IN_SLOT if SLOT_S / count < step_s)]
    return min(steps, key=lambda one: abs(math.log(step_s / times / one)))


def _next(setting: Setting, pct: float, most: int) -> tuple[Setting, float]:
    """The next finer step with elements in proportion, and what it needs if that is in line."""
    count = round(SLOT_S / setting.step_s)
    step_s = SLOT_S / next((one for one in IN_SLOT if one > count), 2 * count)
    elements = min(round(setting.elements * setting.step_s / step_s), most)
    work = elements / step_s * setting.step_s / setting.elements
    return Setting(elements, step_s), pct * work
