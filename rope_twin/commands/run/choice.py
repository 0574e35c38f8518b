"""`--within` and `--budget`: mesh and time step of a run, from the scene's convergence study."""

from __future__ import annotations

import argparse
import math
from dataclasses import replace
from functools import partial

from rope_twin.commands.run.calibration import measure_setting, measure_shares
from rope_twin.commands.run.selection import CEILING_PCT, Selection, refine
from rope_twin.errors import InputError, did_you_mean, phrase
from rope_twin.run.options import RunOptions
from rope_twin.scene.card import OTHER_SEA, Card, Rung, Setting, read_card, told_bound
from rope_twin.scene.load import argument_for, load_scene
from rope_twin.scene.schema import Scene
from rope_twin.studies.accuracy.choice import (
    best_bound,
    cheapest_within,
    most_accurate,
    next_better,
    sure_bound,
)
from rope_twin.studies.accuracy.figures import BY_NAME, Quantity
from rope_twin.studies.accuracy.plan import make_plan
from rope_twin.twin.accuracy.validity import CUT_REASON, beyond
from rope_twin.twin.pacing import SLOT_S

MOST_ELEMENTS = 20_000  # of a rope of a scene
_LIKE = {"%": "1%", "m": "0.05m"}


def choose(args: argparse.Namespace, options: RunOptions) -> RunOptions:
    """Return the options with the elements and time step that --within or --budget select.

    Raises:
        InputError: a value is impossible, or no setting of the study meets the target.
        SceneError: the scene is wrong, or its card is damaged.
    """
    if args.within is None and args.budget is None:
        if args.quantity is not None:
            what = "there is nothing to select"
            raise InputError(phrase("--quantity", what, "give --within 1% too"))
        return options
    option = "--budget" if args.within is None else "--within"
    quantity = find_quantity(args.quantity)
    of_core = ("a share of one core", "%")
    name, unit = of_core if option == "--budget" else (quantity.name, quantity.unit)
    wanted = read_amount(option, args.budget or args.within, name, unit)
    if option == "--budget" and (options.speed == 0.0 or wanted > 100.0):
        what = f"{wanted:g} % of one core" if options.speed else "--speed 0 takes a whole core"
        raise InputError(phrase("--budget", what, "give up to 100 % and a --speed above 0"))
    if options.start_from is not None:
        what = "a saved state has its elements and its step already"
        raise InputError(phrase(option, what, "leave out --from-state, or this"))
    scene = load_scene(options.scene)
    card = _current_card(scene, option)
    rungs = _ladder(card, quantity, options.speed > 0.0, option)
    if option == "--within":
        _refuse_other_run(scene, card, options)
        rung, said = _cheapest(rungs, quantity, wanted, _of_its_run(card, options))
        return replace(options, elements=rung.elements, step_s=rung.step_s, chosen=said)
    selection = _select(scene, rungs, quantity, wanted, options)
    known = _bound_of(selection.setting, card, rungs, quantity, options)
    return replace(
        options,
        elements=selection.setting.elements,
        step_s=selection.setting.step_s,
        chosen=_budget_words(selection, wanted, known),
        budget_pct=wanted,
        calibrated_pct=selection.cost.pct,
    )


def read_amount(option: str, words: str, name: str, unit: str) -> float:
    """Return a number above 0 that was given with its unit, as `1%` or `0.05m`.

    Raises:
        InputError: it is none.
    """
    number = words.strip().removesuffix(unit).strip()
    try:
        amount = float(number)
    except ValueError:
        amount = math.nan
    if not (0.0 < amount < math.inf) or number == words.strip():
        right = f"write a number above 0 and its unit, like {_LIKE[unit]}"
        raise InputError(phrase(f"{option} {words}", f"{name} is in {unit}", right))
    return amount


def find_quantity(name: str | None) -> Quantity:
    """Return the quantity of --quantity; by default the rms of the top tension.

    Raises:
        InputError: there is no such quantity.
    """
    if name is not None and name not in BY_NAME:
        what = f"unknown quantity '{name}'"
        raise InputError(phrase("--quantity", what, did_you_mean(name, BY_NAME)))
    return BY_NAME[name or "tension_rms"]


def _current_card(scene: Scene, option: str) -> Card:
    card = read_card(scene)
    why = "it has no convergence study" if card is None else card.age(scene)
    if card is None or why:
        right = f"make it with `rope_twin accuracy {argument_for(scene)}`"
        raise InputError(phrase(f"{option}, scene {scene.name}", why, right))
    return card


def _ladder(card: Card, quantity: Quantity, paced: bool, option: str) -> list[Rung]:
    """Return the settings whose error is known; in real time no step exceeds a cycle."""
    known = [rung for rung in card.ladder if not math.isnan(rung.bound(quantity.name))]
    if not known:
        others = sorted(name for name in BY_NAME if not math.isnan(best_bound(card.ladder, name)))
        where = f"{option}, scene {card.scene}"
        what = f"its convergence study has no error of {quantity.name}"
        raise InputError(phrase(where, what, f"give --quantity with one of {', '.join(others)}"))
    return [rung for rung in known if not paced or rung.step_s <= SLOT_S]


def _refuse_other_run(scene: Scene, card: Card, options: RunOptions) -> None:
    """Refuse a run that differs from the one that the study was made for. Raises InputError."""
    if options.other_sea:
        given = {"--bag": options.bag, "--poses": options.poses, "--topic": options.topic}
        option, value = next(
            ((name, words) for name, words in given.items() if words),
            ("--sea-offset", f"{options.sea_offset_s:g}"),
        )
        what = f"its convergence study is for its own sea, not for {option} {value}"
        right = f"leave out {option}, or make the study of a scene that has that sea"
        raise InputError(phrase(f"--within, scene {scene.name}", what, right))
    needed_s = make_plan(scene).seconds
    if card.seconds < needed_s and _goes_on(card, options):
        what = (
            f"its convergence study is for {card.seconds:g} s, but the events of the scene take "
            f"{needed_s:g} s"
        )
        right = (
            f"make it again with `rope_twin accuracy {argument_for(scene)}`, "
            f"or give --duration {card.seconds:g}"
        )
        raise InputError(phrase(f"--within, scene {scene.name}", what, right))


def _goes_on(card: Card, options: RunOptions) -> bool:
    """Return whether the run is longer than that of the study."""
    return options.end_s is None or options.end_s > card.seconds


def _of_its_run(card: Card, options: RunOptions) -> str:
    """Return in words for which run the error holds."""
    words = f"in the study's run of {card.seconds:g} s"
    if options.cut:
        return f"{words} (here only until {CUT_REASON})"
    if _goes_on(card, options):
        return f"{words} (the error is unknown after that: {beyond(card.seconds)})"
    return words


def _cheapest(rungs: list[Rung], quantity: Quantity, target: float, run: str) -> tuple[Rung, str]:
    rung = cheapest_within(rungs, quantity.name, target)
    if rung is None:
        best = best_bound(rungs, quantity.name)
        what = f"no setting of the study is that accurate, the best is {_told(best, quantity)}"
        raise InputError(phrase(f"--within {target:g}{quantity.unit}", what, "give that or more"))
    bound = sure_bound(rung, rungs, quantity.name)
    said = (
        f"--within {target:g} {quantity.unit}: {_setting(rung)}, the cheapest with "
        f"an error of {quantity.name} within {_told(bound, quantity)} {run}; "
    )
    better = next_better(rungs, quantity.name, bound, [1.0 / r.real_time_factor for r in rungs])
    if better is None:
        return rung, said + "the study has none better"
    times = rung.real_time_factor / better.real_time_factor
    much = f"{times:.2g} times as much" if times >= 1.05 else "little more"
    return rung, said + f"{_better(better, rungs, quantity)} costs {much}"


def _select(
    scene: Scene, rungs: list[Rung], quantity: Quantity, budget: float, options: RunOptions
) -> Selection:
    """Select the most accurate setting that fits, refined until the budget is used."""
    costs = measure_shares(scene, rungs, options.speed)
    own = [line.elements for line in scene.ropes]
    most = MOST_ELEMENTS * own[0] // max(own)
    least = min(costs)
    while (rung := most_accurate(rungs, quantity.name, costs, budget)) is not None:
        start = Setting(rung.elements, rung.step_s)
        measure = partial(measure_setting, scene, options, solves_per_step=rung.solves_per_step)
        selection = refine(start, budget, most, measure)
        if isinstance(selection, Selection):
            return selection
        costs[rungs.index(rung)] = math.inf  # with its messages it does not fit
        least = selection.pct
    what = f"the cheapest setting of the study needs {least:.2g} % here"
    raise InputError(phrase(f"--budget {budget:g}%", what, "give more"))


def _bound_of(
    setting: Setting, card: Card, rungs: list[Rung], quantity: Quantity, options: RunOptions
) -> str:
    """Return in words the error of a setting between those of the study or beyond them."""
    if options.other_sea:
        return f"its error is unknown: {OTHER_SEA}"
    bounds = (sure_bound(rung, rungs, quantity.name) for rung in card.at(*setting) if rung in rungs)
    finest = card.finest
    within = f"error of {quantity.name} {_told(max(bounds, default=math.nan), quantity)} at most"
    if setting.elements > finest.elements or setting.step_s < finest.step_s:
        within += ", the bound of the study's finest setting,"
    return f"{within} {_of_its_run(card, options)}"


def _budget_words(selection: Selection, budget: float, known: str) -> str:
    """Return in words what was selected, why, and what the next better setting would cost."""
    setting, cost = selection.setting, selection.cost
    why = "the most accurate that fits"
    if cost.pct >= 0.95 * CEILING_PCT:
        why += f" in {CEILING_PCT:g} %: the rest of each cycle stays free"
    return (
        f"--budget {budget:g} %: {setting}, {why}: time steps need {cost.steps_pct:.3g} % of one "
        f"core and messages {cost.publishing_pct:.2g} % (measured now, without sending), "
        f"{known}; next better, {selection.better}, needs about {selection.better_pct:.2g} %"
    )


def _better(rung: Rung, rungs: list[Rung], quantity: Quantity) -> str:
    bound = _told(sure_bound(rung, rungs, quantity.name), quantity)
    return f"next better, {_setting(rung)} (within {bound}),"


def _setting(rung: Rung) -> str:
    return str(Setting(rung.elements, rung.step_s))


def _told(bound: float, quantity: Quantity) -> str:
    return f"{told_bound(bound)} {quantity.unit}"
