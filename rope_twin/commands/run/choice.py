"""`--within` and `--budget`: elements and step of a run, bought from the scene's accuracy card."""

from __future__ import annotations

import argparse
import math
from dataclasses import replace
from functools import partial

from rope_twin.commands.run.calibration import measure_setting, measure_shares
from rope_twin.commands.run.spending import CEILING_PCT, Bought, spend
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
from rope_twin.twin.accuracy.card_validity import CUT_WORDS, beyond
from rope_twin.twin.pacing import SLOT_S

MOST_ELEMENTS = 20_000  # of a rope of a scene
_LIKE = {"%": "1%", "m": "0.05m"}


def choose(args: argparse.Namespace, options: RunOptions) -> RunOptions:
    """The options with elements and step as --within or --budget ask, and what is said of it.

    Raises:
        InputError: a value that cannot be, or nothing on the ladder serves; one sentence.
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
        rung, said = _buy(rungs, quantity, wanted, _of_its_run(card, options))
        return replace(options, elements=rung.elements, step_s=rung.step_s, chosen=said)
    bought = _spend(scene, rungs, quantity, wanted, options)
    known = _bound_of(bought.setting, card, rungs, quantity, options)
    return replace(
        options,
        elements=bought.setting.elements,
        step_s=bought.setting.step_s,
        chosen=_told_spending(bought, wanted, known),
        budget_pct=wanted,
        calibrated_pct=bought.cost.pct,
    )


def read_amount(option: str, words: str, name: str, unit: str) -> float:
    """A number above 0 with its unit, as `1%` or `0.05m`, of what has this name.

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
    why = "it has no accuracy card" if card is None else card.age(scene)
    if card is None or why:
        right = f"make it with `rope_twin accuracy {argument_for(scene)}`"
        raise InputError(phrase(f"{option}, scene {scene.name}", why, right))
    return card


def _ladder(card: Card, quantity: Quantity, paced: bool, option: str) -> list[Rung]:
    """The rungs that can be run and whose error is known; paced no step is longer than a slot."""
    known = [rung for rung in card.ladder if not math.isnan(rung.bound(quantity.name))]
    if not known:
        others = sorted(name for name in BY_NAME if not math.isnan(best_bound(card.ladder, name)))
        where = f"{option}, scene {card.scene}"
        what = f"its card knows no error of {quantity.name}"
        raise InputError(phrase(where, what, f"give --quantity with one of {', '.join(others)}"))
    return [rung for rung in known if not paced or rung.step_s <= SLOT_S]


def _refuse_other_run(scene: Scene, card: Card, options: RunOptions) -> None:
    """Nothing is promised of a run that the card's says nothing about. Raises InputError."""
    if options.other_sea:
        given = {"--bag": options.bag, "--poses": options.poses, "--topic": options.topic}
        option, value = next(
            ((name, words) for name, words in given.items() if words),
            ("--sea-offset", f"{options.sea_offset_s:g}"),
        )
        what = f"its card is of its own sea, not of {option} {value}"
        right = f"leave {option} out, or make the card of a scene that has that sea"
        raise InputError(phrase(f"--within, scene {scene.name}", what, right))
    needed_s = make_plan(scene).seconds
    if card.seconds < needed_s and _goes_on(card, options):
        what = (
            f"its card is of {card.seconds:g} s only, what happens in the scene takes "
            f"{needed_s:g} s"
        )
        right = (
            f"make it again with `rope_twin accuracy {argument_for(scene)}`, "
            f"or give --duration {card.seconds:g}"
        )
        raise InputError(phrase(f"--within, scene {scene.name}", what, right))


def _goes_on(card: Card, options: RunOptions) -> bool:
    """Whether the run is longer than the card's."""
    return options.end_s is None or options.end_s > card.seconds


def _of_its_run(card: Card, options: RunOptions) -> str:
    """Of which run its errors are."""
    words = f"in the card's run of {card.seconds:g} s"
    if options.cut:
        return f"{words} (of this one only until {CUT_WORDS})"
    if _goes_on(card, options):
        return f"{words} (of this one the error is unknown after that: {beyond(card.seconds)})"
    return words


def _buy(rungs: list[Rung], quantity: Quantity, target: float, run: str) -> tuple[Rung, str]:
    rung = cheapest_within(rungs, quantity.name, target)
    if rung is None:
        best = best_bound(rungs, quantity.name)
        what = f"no setting of the card is so accurate, the best is {_told(best, quantity)}"
        raise InputError(
            phrase(f"--within {target:g}{quantity.unit}", what, "ask for that or more")
        )
    bound = sure_bound(rung, rungs, quantity.name)
    said = (
        f"--within {target:g} {quantity.unit}: {_setting(rung)}, the cheapest that keeps "
        f"{quantity.name} within {_told(bound, quantity)} {run}; "
    )
    better = next_better(rungs, quantity.name, bound, [1.0 / r.real_time_factor for r in rungs])
    if better is None:
        return rung, said + "the card has nothing better"
    times = rung.real_time_factor / better.real_time_factor
    much = f"{times:.2g} times as much" if times >= 1.05 else "hardly more"
    return rung, said + f"{_better(better, rungs, quantity)} costs {much}"


def _spend(
    scene: Scene, rungs: list[Rung], quantity: Quantity, budget: float, options: RunOptions
) -> Bought:
    """The ladder's most accurate rung that fits, refined until the budget is used."""
    costs = measure_shares(scene, rungs, options.speed)
    own = [line.elements for line in scene.ropes]
    most = MOST_ELEMENTS * own[0] // max(own)
    least = min(costs)
    while (rung := most_accurate(rungs, quantity.name, costs, budget)) is not None:
        start = Setting(rung.elements, rung.step_s)
        measure = partial(measure_setting, scene, options, solves_per_step=rung.solves_per_step)
        bought = spend(start, budget, most, measure)
        if isinstance(bought, Bought):
            return bought
        costs[rungs.index(rung)] = math.inf  # with its messages it does not fit
        least = bought.pct
    what = f"the cheapest setting of the card needs {least:.2g} % here"
    raise InputError(phrase(f"--budget {budget:g}%", what, "give more"))


def _bound_of(
    setting: Setting, card: Card, rungs: list[Rung], quantity: Quantity, options: RunOptions
) -> str:
    """What is known of the error of a setting that lies between rungs or beyond them."""
    if options.other_sea:
        return f"of its error nothing is known: {OTHER_SEA}"
    bounds = (sure_bound(rung, rungs, quantity.name) for rung in card.at(*setting) if rung in rungs)
    finest = card.finest
    within = f"{quantity.name} within {_told(max(bounds, default=math.nan), quantity)}"
    if setting.elements > finest.elements or setting.step_s < finest.step_s:
        within += ", the card's bound where it ends (finer was not measured),"
    return f"{within} {_of_its_run(card, options)}"


def _told_spending(bought: Bought, budget: float, known: str) -> str:
    """What was chosen, why, and what the next better setting would cost."""
    setting, cost = bought.setting, bought.cost
    why = "the most accurate that fits"
    if cost.pct >= 0.95 * CEILING_PCT:
        why += f" in {CEILING_PCT:g} %, since the rest of each slot stays free"
    return (
        f"--budget {budget:g} %: {setting}, {why}: steps need {cost.steps_pct:.3g} % of one core "
        f"here and messages {cost.publishing_pct:.2g} % (measured just now; sending comes on top), "
        f"{known}; next better, {bought.better}, needs about {bought.better_pct:.2g} %"
    )


def _better(rung: Rung, rungs: list[Rung], quantity: Quantity) -> str:
    bound = _told(sure_bound(rung, rungs, quantity.name), quantity)
    return f"next better, {_setting(rung)} (within {bound}),"


def _setting(rung: Rung) -> str:
    return str(Setting(rung.elements, rung.step_s))


def _told(bound: float, quantity: Quantity) -> str:
    return f"{told_bound(bound)} {quantity.unit}"
