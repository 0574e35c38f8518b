"""`--within` and `--budget`: mesh and time step of a run, from the scene's convergence study."""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from decimal import Decimal, InvalidOperation
from functools import partial
from statistics import mean, median
from typing import NamedTuple

from rope_twin.errors import InputError, did_you_mean
from rope_twin.messages import Encoder
from rope_twin.run.options import RunOptions
from rope_twin.scene.convergence import OTHER_SEA, ConvergenceStudy
from rope_twin.scene.error_bound import Setting, StudyLevel, format_bound
from rope_twin.scene.load import argument_for, load_scene
from rope_twin.scene.schema import Scene
from rope_twin.studies.accuracy_run import BY_NAME, Quantity
from rope_twin.studies.accuracy_study import make_plan
from rope_twin.studies.accuracy_within import (
    best_bound,
    cheapest_within,
    current_study,
    most_accurate,
    next_better,
    sure_bound,
)
from rope_twin.studies.driven_twin import variant
from rope_twin.topics import due_topics, slot_of
from rope_twin.twin.pacing import SLOT_S, steps_in_slot
from rope_twin.twin.twin import Twin
from rope_twin.twin.validity import CUT_REASON, beyond

SLOTS, PAUSE_S = 20, 0.002  # of a setting: the pause cools the caches, as pacing does
FEW, MANY = 1, 4  # steps in a slot
SOLVES_AT_REST = 2.0  # per step
WARM_UP, PACED_SLOTS = 4, 40  # of a setting: a whole number of rounds of all topics


class Cost(NamedTuple):
    """Share of one core that a setting needs [%]."""

    steps_pct: float
    publishing_pct: float  # without the middleware

    @property
    def pct(self) -> float:
        """Return the sum."""
        return self.steps_pct + self.publishing_pct


def measure_shares(scene: Scene, levels: Sequence[StudyLevel], speed: float) -> list[float]:
    """Measure the share of one core [%] that the time steps of each setting need here.

    A rope at rest is stepped in slots with pauses between, as a paced run does: in each slot a few
    steps and then many, so that what a slot costs and what a step costs are separated. The solves
    that the study counted in each level scale the latter. Takes about a second.
    """
    costs: dict[int, tuple[float, float]] = {}
    shares = []
    for level in levels:
        if level.elements not in costs:
            costs[level.elements] = _slot_costs(Twin(variant(scene, level.elements)))
        slot_s, step_s = costs[level.elements]
        steps = steps_in_slot(level.step_s)
        busy_s = slot_s + steps * step_s * level.solves_per_step / SOLVES_AT_REST
        shares.append(100.0 * busy_s / (steps * level.step_s) * speed)
    return shares


def _slot_costs(twin: Twin) -> tuple[float, float]:
    """Return the cost of a cycle without its time steps, and of a time step [s]."""
    took = {FEW: [0.0] * SLOTS, MANY: [0.0] * SLOTS}
    twin.advance(MANY)
    for steps, times in took.items():
        for slot in range(SLOTS):
            time.sleep(PAUSE_S)
            began = time.thread_time()
            twin.advance(steps)
            twin.snapshot()
            times[slot] = time.thread_time() - began
    few_s, many_s = median(took[FEW]), median(took[MANY])
    step_s = max(many_s - few_s, 0.0) / (MANY - FEW)
    return max(few_s - FEW * step_s, 0.0), step_s


def measure_setting(
    scene: Scene, options: RunOptions, setting: Setting, solves_per_step: float
) -> Cost:
    """Measure the cost of a run with these options at a setting, over most of a second.

    solves_per_step: what the study counted where the rope moves; it scales the steps.
    """
    twin = Twin(variant(scene, setting.elements, setting.step_s), options.monitors)
    steps = steps_in_slot(setting.step_s)
    encoder = Encoder(0)
    period_s = steps * setting.step_s / options.speed
    stepping, publishing = [], []
    due_s = time.monotonic()
    for slot in range(WARM_UP + PACED_SLOTS):
        due_s = max(due_s + period_s, time.monotonic())
        time.sleep(max(0.0, due_s - time.monotonic()))
        began_s = time.thread_time()
        twin.advance(steps)
        snapshot = twin.snapshot()
        stepped_s = time.thread_time()
        for name in due_topics(*slot_of(snapshot), snapshot):
            encoder.encode(name, snapshot)
        if slot >= WARM_UP:
            stepping.append(stepped_s - began_s)
            publishing.append(time.thread_time() - stepped_s)
    solver = snapshot.solver
    busier = max(1.0, solves_per_step * solver.steps / solver.solves) if solver.solves else 1.0
    return Cost(100.0 * busier * median(stepping) / period_s, 100.0 * mean(publishing) / period_s)


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
    start: Setting, budget_pct: float, max_elements: int, measure: Measure
) -> Selection | Cost:
    """Return the setting in proportion to `start` that uses the budget; or the cost of `start`.

    The cost is returned if it exceeds the budget. max_elements: limit for a line.
    """
    goal = min(AIM * budget_pct, CEILING_PCT)
    low, high = LEAST / AIM * goal, MOST / AIM * goal
    setting, cost = start, measure(start)
    if cost.pct > high:
        return cost
    selected, step_s = (setting, cost), start.step_s
    known = [(0.0, 0.0), (_work(setting), cost.pct)]
    for number in range(ROUNDS):
        if selected[1].pct >= low or selected[0].elements == max_elements:
            break
        work = _work_for(goal, known)
        if number < BALANCED:
            finer = math.sqrt(max(1.0, work / _work(start)))
            step_s = _nearest_step(start.step_s, finer)
        setting = Setting(min(max(round(work * step_s), start.elements), max_elements), step_s)
        cost = measure(setting)
        known = [known[-1], (_work(setting), cost.pct)]
        if selected[1].pct < cost.pct <= high:
            selected = setting, cost
    return Selection(*selected, *_next(selected[0], selected[1].pct, max_elements))


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
    return min(steps, key=lambda step: abs(math.log(step_s / times / step)))


def _next(setting: Setting, pct: float, max_elements: int) -> tuple[Setting, float]:
    """Return the next finer setting in proportion, and its cost by extrapolation."""
    count = round(SLOT_S / setting.step_s)
    step_s = SLOT_S / next((steps for steps in IN_SLOT if steps > count), 2 * count)
    elements = min(round(setting.elements * setting.step_s / step_s), max_elements)
    work = elements / step_s * setting.step_s / setting.elements
    return Setting(elements, step_s), pct * work


MAX_ELEMENTS = 20_000  # of a rope of a scene
_LIKE = {"%": "1%", "m": "0.05m"}


def choose(args: argparse.Namespace, options: RunOptions) -> RunOptions:
    """Return the options with the elements and time step that --within or --budget select.

    Raises:
        InputError: a value is impossible, or no setting of the study meets the target.
        SceneError: the scene is wrong, or its study is damaged.
    """
    if args.within is None and args.budget is None:
        if args.quantity is not None:
            raise InputError("--quantity", "there is nothing to select", "give --within 1% too")
        return options
    option = "--budget" if args.within is None else "--within"
    quantity = find_quantity(args.quantity)
    of_core = ("a share of one core", "%")
    name, unit = of_core if option == "--budget" else (quantity.name, quantity.unit)
    target = read_amount(option, args.budget or args.within, name, unit)
    if option == "--budget" and (options.speed == 0.0 or target > 100.0):
        problem = f"{target:g} % of one core" if options.speed else "--speed 0 takes a whole core"
        raise InputError("--budget", problem, "give up to 100 % and a --speed above 0")
    if options.start_from is not None:
        problem = "a saved state has its elements and its step already"
        raise InputError(option, problem, "leave out --from-state, or this")
    scene = load_scene(options.scene)
    study = current_study(scene, f"{option}, scene {scene.name}", InputError)
    levels = _known_levels(study, quantity, options.speed > 0.0, option)
    if option == "--within":
        _refuse_other_run(scene, study, options)
        level, remark = _cheapest(levels, quantity, target, _of_its_run(study, options))
        return replace(options, elements=level.elements, step_s=level.step_s, chosen=remark)
    selection = _select(scene, levels, quantity, target, options)
    known = _bound_of(selection.setting, study, levels, quantity, options)
    return replace(
        options,
        elements=selection.setting.elements,
        step_s=selection.setting.step_s,
        chosen=_budget_words(selection, target, known),
        budget_pct=target,
        calibrated_pct=selection.cost.pct,
    )


def read_amount(option: str, text: str, name: str, unit: str) -> float:
    """Return a number above 0 that was given with its unit, as `1%` or `0.05m`.

    Raises:
        InputError: it is none.
    """
    return float(_amount(option, text, name, unit))


def read_share(option: str, text: str, name: str) -> float:
    """Return a share above 0 that was given in per cent: 1.1% is the number 0.011, to the bit.

    Raises:
        InputError: it is none.
    """
    return float(_amount(option, text, name, "%").scaleb(-2))


def _amount(option: str, text: str, name: str, unit: str) -> Decimal:
    number = text.strip().removesuffix(unit).strip()
    try:
        amount = Decimal(number)
    except InvalidOperation:
        amount = Decimal("nan")
    is_positive = amount.is_finite() and 0.0 < float(amount) < math.inf
    if not is_positive or number == text.strip():
        remedy = f"write a number above 0 and its unit, like {_LIKE[unit]}"
        raise InputError(f"{option} {text}", f"{name} is in {unit}", remedy)
    return amount


def find_quantity(name: str | None) -> Quantity:
    """Return the quantity of --quantity; by default the rms of the top tension.

    Raises:
        InputError: there is no such quantity.
    """
    if name is not None and name not in BY_NAME:
        raise InputError("--quantity", f"unknown quantity '{name}'", did_you_mean(name, BY_NAME))
    return BY_NAME[name or "tension_rms"]


def _known_levels(
    study: ConvergenceStudy, quantity: Quantity, paced: bool, option: str
) -> list[StudyLevel]:
    """Return the settings whose error is known; in real time no step exceeds a cycle."""
    known = [level for level in study.own_levels if not math.isnan(level.bound(quantity.name))]
    if not known:
        available = sorted(
            name for name in BY_NAME if not math.isnan(best_bound(study.own_levels, name))
        )
        where = f"{option}, scene {study.scene}"
        problem = f"its convergence study has no error of {quantity.name}"
        raise InputError(where, problem, f"give --quantity with one of {', '.join(available)}")
    return [level for level in known if not paced or level.step_s <= SLOT_S]


def _refuse_other_run(scene: Scene, study: ConvergenceStudy, options: RunOptions) -> None:
    """Refuse a run that differs from the one that the study was made for. Raises InputError."""
    if options.other_sea:
        options_given = {"--bag": options.bag, "--poses": options.poses, "--topic": options.topic}
        option, value = next(
            ((name, argument) for name, argument in options_given.items() if argument),
            ("--sea-offset", f"{options.sea_offset_s:g}"),
        )
        problem = f"its convergence study is for its own sea, not for {option} {value}"
        remedy = f"leave out {option}, or make the study of a scene that has that sea"
        raise InputError(f"--within, scene {scene.name}", problem, remedy)
    needed_s = make_plan(scene).seconds
    if study.seconds < needed_s and _goes_on(study, options):
        raise InputError(
            f"--within, scene {scene.name}",
            f"its convergence study is for {study.seconds:g} s, but the events of the scene take "
            f"{needed_s:g} s",
            f"make it again with `rope_twin accuracy {argument_for(scene)}`, "
            f"or give --duration {study.seconds:g}",
        )


def _goes_on(study: ConvergenceStudy, options: RunOptions) -> bool:
    """Return whether the run is longer than that of the study."""
    return options.end_s is None or options.end_s > study.seconds


def _of_its_run(study: ConvergenceStudy, options: RunOptions) -> str:
    """Return in words for which run the error holds."""
    run = f"in the study's run of {study.seconds:g} s"
    if options.cut:
        return f"{run} (here only until {CUT_REASON})"
    if _goes_on(study, options):
        return f"{run} (the error is unknown after that: {beyond(study.seconds)})"
    return run


def _cheapest(
    levels: list[StudyLevel], quantity: Quantity, target: float, run: str
) -> tuple[StudyLevel, str]:
    level = cheapest_within(levels, quantity.name, target)
    if level is None:
        most_accurate = best_bound(levels, quantity.name)
        best_words = _bound_words(most_accurate, quantity)
        problem = f"no setting of the study is that accurate, the best is {best_words}"
        raise InputError(f"--within {target:g}{quantity.unit}", problem, "give that or more")
    bound = sure_bound(level, levels, quantity.name)
    remark = (
        f"--within {target:g} {quantity.unit}: {level.setting}, the cheapest with "
        f"an error of {quantity.name} within {_bound_words(bound, quantity)} {run}; "
    )
    better = next_better(levels, quantity.name, bound, [1.0 / r.real_time_factor for r in levels])
    if better is None:
        return level, remark + "the study has none better"
    times = level.real_time_factor / better.real_time_factor
    cost = f"{times:.2g} times as much" if times >= 1.05 else "little more"
    bound_words = _bound_words(sure_bound(better, levels, quantity.name), quantity)
    return level, f"{remark}next better, {better.setting} (within {bound_words}), costs {cost}"


def _select(
    scene: Scene, levels: list[StudyLevel], quantity: Quantity, budget: float, options: RunOptions
) -> Selection:
    """Select the most accurate setting that fits, refined until the budget is used."""
    costs = measure_shares(scene, levels, options.speed)
    scene_counts = [line.elements for line in scene.ropes]
    max_elements = MAX_ELEMENTS * scene_counts[0] // max(scene_counts)
    min_pct = min(costs)
    while (level := most_accurate(levels, quantity.name, costs, budget)) is not None:
        start = level.setting
        measure = partial(measure_setting, scene, options, solves_per_step=level.solves_per_step)
        selection = refine(start, budget, max_elements, measure)
        if isinstance(selection, Selection):
            return selection
        costs[levels.index(level)] = math.inf  # with its messages it does not fit
        min_pct = selection.pct
    problem = f"the cheapest setting of the study needs {min_pct:.2g} % here"
    raise InputError(f"--budget {budget:g}%", problem, "give more")


def _bound_of(
    setting: Setting,
    study: ConvergenceStudy,
    levels: list[StudyLevel],
    quantity: Quantity,
    options: RunOptions,
) -> str:
    """Return in words the error of a setting between those of the study or beyond them."""
    if options.other_sea:
        return f"its error is unknown: {OTHER_SEA}"
    bounds = (
        sure_bound(level, levels, quantity.name)
        for level in study.at(setting.elements, setting.step_s)
        if level in levels
    )
    finest = study.finest
    bound = (
        f"error of {quantity.name} {_bound_words(max(bounds, default=math.nan), quantity)} at most"
    )
    if setting.elements > finest.elements or setting.step_s < finest.step_s:
        bound += ", the bound of the study's finest setting,"
    return f"{bound} {_of_its_run(study, options)}"


def _budget_words(selection: Selection, budget: float, known: str) -> str:
    """Return in words what was selected, why, and what the next better setting would cost."""
    setting, cost = selection.setting, selection.cost
    reason = "the most accurate that fits"
    if cost.pct >= 0.95 * CEILING_PCT:
        reason += f" in {CEILING_PCT:g} %: the rest of each cycle stays free"
    return (
        f"--budget {budget:g} %: {setting}, {reason}: time steps need {cost.steps_pct:.3g} % of "
        f"one core and messages {cost.publishing_pct:.2g} % (measured now, without sending), "
        f"{known}; next better, {selection.better}, needs about {selection.better_pct:.2g} %"
    )


def _bound_words(bound: float, quantity: Quantity) -> str:
    return f"{format_bound(bound)} {quantity.unit}"
