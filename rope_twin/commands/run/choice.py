"""`--within` and `--budget`: elements and step of a run, bought from the scene's accuracy card."""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Sequence
from dataclasses import replace
from statistics import median

from rope_twin.commands.run.options import RunOptions
from rope_twin.errors import InputError, did_you_mean, phrase
from rope_twin.scene.card import Card, Rung, read_card, told_bound
from rope_twin.scene.load import load_scene
from rope_twin.scene.schema import Scene
from rope_twin.studies.accuracy.choice import (
    best_bound,
    cheapest_within,
    most_accurate,
    next_better,
    sure_bound,
)
from rope_twin.studies.accuracy.figures import BY_NAME, Quantity
from rope_twin.studies.variants import variant
from rope_twin.twin.pacing import SLOT_S, steps_in_slot
from rope_twin.twin.twin import Twin

SLOTS, PAUSE_S = 20, 0.002  # of the calibration: the pause cools the caches, as pacing does
FEW, MANY = 1, 4  # steps in a slot
SOLVES_AT_REST = 2.0  # per step


def choose(args: argparse.Namespace, options: RunOptions) -> RunOptions:
    """The options with elements and step as --within or --budget ask, and what is said of it.

    Raises:
        InputError: a value that cannot be, or nothing on the ladder serves; one sentence.
        SceneError: the scene is wrong, or its card is damaged.
    """
    if args.within is None and args.budget is None:
        if args.of is not None:
            raise InputError(phrase("--of", "there is nothing to choose", "say --within 1% too"))
        return options
    option = "--budget" if args.within is None else "--within"
    quantity = find_quantity(args.of)
    unit = "%" if option == "--budget" else quantity.unit
    wanted = read_amount(option, args.budget or args.within, unit)
    if option == "--budget" and (options.speed == 0.0 or wanted > 100.0):
        what = f"{wanted:g} % of one core" if options.speed else "--speed 0 takes a whole core"
        raise InputError(phrase("--budget", what, "give up to 100 % and a --speed above 0"))
    if options.start_from is not None:
        what = "a saved state has its elements and its step already"
        raise InputError(phrase(option, what, "leave --from out, or this"))
    scene = load_scene(options.scene)
    card = _current_card(scene, option)
    rungs = _ladder(card, quantity, options.speed > 0.0, option)
    if option == "--within":
        rung, said = _buy(rungs, quantity, wanted, card)
    else:
        costs = measure_shares(scene, rungs, options.speed)
        rung, said = _spend(rungs, quantity, wanted, costs)
    return replace(options, elements=rung.elements, step_s=rung.step_s, chosen=said)


def read_amount(option: str, words: str, unit: str) -> float:
    """A number above 0 with its unit, as `1%` or `0.05m`.

    Raises:
        InputError: it is none.
    """
    number = words.strip().removesuffix(unit).strip()
    try:
        amount = float(number)
    except ValueError:
        amount = math.nan
    if not (0.0 < amount < math.inf) or number == words.strip():
        right = f"write a number above 0 and its unit, like 1{unit}"
        raise InputError(phrase(f"{option} {words}", "it is not possible", right))
    return amount


def measure_shares(scene: Scene, rungs: Sequence[Rung], speed: float) -> list[float]:
    """Share of one core [%] that the steps of each rung need on this machine, measured now.

    A rope at rest is stepped in slots with pauses between, as a paced run does: in each slot a few
    steps and then many, so that what a slot costs and what a step costs are told apart. The solves
    that the card counted in each rung scale the latter. Takes about a second.
    """
    costs: dict[int, tuple[float, float]] = {}
    shares = []
    for rung in rungs:
        if rung.elements not in costs:
            costs[rung.elements] = _slot_costs(Twin(variant(scene, rung.elements)))
        slot_s, step_s = costs[rung.elements]
        steps = steps_in_slot(rung.step_s)
        busy_s = slot_s + steps * step_s * rung.solves_per_step / SOLVES_AT_REST
        shares.append(100.0 * busy_s / (steps * rung.step_s) * speed)
    return shares


def _slot_costs(twin: Twin) -> tuple[float, float]:
    """What a slot costs besides its steps, and what a step costs [s]."""
    took = {FEW: [0.0] * SLOTS, MANY: [0.0] * SLOTS}
    twin.advance(MANY)
    for steps, times in took.items():
        for slot in range(SLOTS):
            time.sleep(PAUSE_S)
            began = time.perf_counter()
            twin.advance(steps)
            twin.snapshot()
            times[slot] = time.perf_counter() - began
    few, many = median(took[FEW]), median(took[MANY])
    step_s = max(many - few, 0.0) / (MANY - FEW)
    return max(few - FEW * step_s, 0.0), step_s


def find_quantity(name: str | None) -> Quantity:
    """The quantity of --of; the rms of the top tension if there is none.

    Raises:
        InputError: there is no such quantity.
    """
    if name is not None and name not in BY_NAME:
        raise InputError(phrase("--of", f"unknown quantity '{name}'", did_you_mean(name, BY_NAME)))
    return BY_NAME[name or "tension_rms"]


def _current_card(scene: Scene, option: str) -> Card:
    card = read_card(scene)
    why = "it has no accuracy card" if card is None else card.age(scene)
    if card is None or why:
        right = f"make it with `rope_twin accuracy {scene.name}`"
        raise InputError(phrase(f"{option}, scene {scene.name}", why, right))
    return card


def _ladder(card: Card, quantity: Quantity, paced: bool, option: str) -> list[Rung]:
    """The rungs that can be run and whose error is known; paced no step is longer than a slot."""
    known = [rung for rung in card.ladder if not math.isnan(rung.bound(quantity.name))]
    if not known:
        others = sorted(name for name in BY_NAME if not math.isnan(best_bound(card.ladder, name)))
        where = f"{option}, scene {card.scene}"
        what = f"its card knows no error of {quantity.name}"
        raise InputError(phrase(where, what, f"say --of with one of {', '.join(others)}"))
    return [rung for rung in known if not paced or rung.step_s <= SLOT_S]


def _buy(rungs: list[Rung], quantity: Quantity, target: float, card: Card) -> tuple[Rung, str]:
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
        f"{quantity.name} within {_told(bound, quantity)} in the card's run of {card.seconds:g} s; "
    )
    better = next_better(rungs, quantity.name, bound, [1.0 / r.real_time_factor for r in rungs])
    if better is None:
        return rung, said + "the card has nothing better"
    times = rung.real_time_factor / better.real_time_factor
    return rung, said + f"{_better(better, rungs, quantity)} costs {times:.2g} times as much"


def _spend(
    rungs: list[Rung], quantity: Quantity, budget: float, costs: list[float]
) -> tuple[Rung, str]:
    rung = most_accurate(rungs, quantity.name, costs, budget)
    if rung is None:
        what = f"the cheapest setting of the card needs {min(costs):.2g} % here"
        raise InputError(phrase(f"--budget {budget:g}%", what, "give more"))
    bound = sure_bound(rung, rungs, quantity.name)
    said = (
        f"--budget {budget:g} %: {_setting(rung)}, the most accurate that fits: needs "
        f"{costs[rungs.index(rung)]:.2g} % of one core here (measured just now), {quantity.name} "
        f"within {_told(bound, quantity)}; "
    )
    better = next_better(rungs, quantity.name, bound, costs)
    if better is None:
        return rung, said + "the card has nothing better"
    share = costs[rungs.index(better)]
    return rung, said + f"{_better(better, rungs, quantity)} needs {share:.2g} %"


def _better(rung: Rung, rungs: list[Rung], quantity: Quantity) -> str:
    bound = _told(sure_bound(rung, rungs, quantity.name), quantity)
    return f"next better, {_setting(rung)} (within {bound}),"


def _setting(rung: Rung) -> str:
    return f"{rung.elements} elements at {1e3 * rung.step_s:g} ms"


def _told(bound: float, quantity: Quantity) -> str:
    return f"{told_bound(bound)} {quantity.unit}"
