"""Selection of mesh and time step for a CPU budget: both are refined until it is used.

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
ROUNDS, BALANCED = 8, 4  # of measuring; in the first ones the step is chosen again
GROWTH = 16.0  # per round at most: a low cost says little about a high one
IN_SLOT = (1, 2, 4, 5, 8, 10, 16, 20, 25, 32, 40, 50, 80, 100, 125, 160, 200)  # steps per cycle
CEILING_PCT = 55.0  # of a cycle: a run that needs more than 60 % is degraded

Measure = Callable[[Setting], Cost]


class Selection(NamedTuple):
    """A setting within a budget, and the next finer one."""

    setting: Setting
    cost: Cost
    better: Setting  # the next one
    better_pct: float  # what that would need, by what this one does


def refine(
    start: Setting, budget_pct: float, most_elements: int, measure: Measure
) -> Selection | Cost:
    """Return the setting in proportion to `start` that uses the budget; or the cost of `start`.

    The cost is returned if it exceeds the budget. most_elements: limit for a line.
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
    return Selection(*best, *_next(best[0], best[1].pct, most_elements))


def _work(setting: Setting) -> float:
    return setting.elements / setting.step_s


def _work_for(goal_pct: float, known: list[tuple[float, float]]) -> float:
    """Return the work for a share by a line through the two latest of (work, share)."""
    (work_0, pct_0), (work_1, pct_1) = known[-2:]
    slope = (pct_1 - pct_0) / (work_1 - work_0) if work_1 != work_0 else 0.0
    if slope <= 0.0:
        slope = pct_1 / work_1
    work = work_1 + (goal_pct - pct_1) / slope
    return min(max(work, 0.5 * min(work_0, work_1) or 0.5 * work_1), GROWTH * work_1)


def _nearest_step(step_s: float, times: float) -> float:
    """Return the time step, a fraction of a cycle, nearest to `step_s` over `times`."""
    steps = [step_s, *(SLOT_S / count for count in IN_SLOT if SLOT_S / count < step_s)]
    return min(steps, key=lambda one: abs(math.log(step_s / times / one)))


def _next(setting: Setting, pct: float, most: int) -> tuple[Setting, float]:
    """Return the next finer setting in proportion, and its cost by extrapolation."""
    count = round(SLOT_S / setting.step_s)
    step_s = SLOT_S / next((one for one in IN_SLOT if one > count), 2 * count)
    elements = min(round(setting.elements * setting.step_s / step_s), most)
    work = elements / step_s * setting.step_s / setting.elements
    return Setting(elements, step_s), pct * work
