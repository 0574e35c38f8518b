"""Mesh and time step of a plan's runs, by the discretisation error that is measured in its seas.

The error of a setting is the difference from twice its elements and half its step, in the same
sea, times 4/3: what remains if it falls with the square of the step (Roache 1998).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from rope_twin.errors import RopeTwinError
from rope_twin.planning.phases import Leg
from rope_twin.planning.plan_file import LEGS_MOST
from rope_twin.planning.runs import SETTING, run_row, run_seeds, sea_seed
from rope_twin.planning.seas import Ship
from rope_twin.planning.twin_runs import Row
from rope_twin.scene.error_bound import Setting

if TYPE_CHECKING:
    from rope_twin.planning.cells import Cell, CellLimit, RowStore
    from rope_twin.planning.judgement import Judgement
    from rope_twin.planning.plan_file import Plan
    from rope_twin.planning.seas import SeaState

# From coarse to fine; each is compared with twice its elements and half its step.
SETTINGS = tuple(
    Setting(elements, step_s)
    for elements, step_s in (
        (10, 0.1), (15, 0.1), (15, 0.05), (20, 0.05), (30, 0.05), (30, 0.025), (40, 0.025),
        (40, 0.0125), (60, 0.0125), (60, 0.00625), (80, 0.00625), (120, 0.003125),
    )
)  # fmt: skip
TRIAL_S = 120.0  # of the window
TRIAL_SEEDS = 4  # as many as step together
SECOND_ORDER = 4.0 / 3.0
REFINEMENTS_MOST = 3  # of a cell
CONVERGES = 0.7  # of the error before: what remains above that falls with nothing


def finer(setting: Setting) -> Setting:
    """Return twice the elements and half the step."""
    return Setting(2 * setting.elements, 0.5 * setting.step_s)


TRIED = tuple(dict.fromkeys([*SETTINGS, *map(finer, SETTINGS)]))  # their places number the trials


def choose_setting(
    plan: Plan, number: int, leg: Leg, ship: Ship, sea: SeaState, store: RowStore
) -> tuple[Setting, float]:
    """Return the coarsest setting within the plan's error, and its error over the hook load.

    The finest is returned if none is; the error is NaN if it could not be measured, or if the plan
    gives the setting.

    number: of the phase; sea: in which the error is measured; store: of the rows of the trials.
    """
    method = plan.method
    if method.elements is not None and method.step_s is not None:
        return Setting(method.elements, method.step_s), math.nan
    if leg.by_twin:  # contact and ropes that meet ask for the scene's own mesh and step
        return Setting(leg.scene.ropes[0].elements, leg.scene.time.step_s), math.nan
    trials = Trials(plan, number, leg, ship, sea, store)
    best = SETTINGS[-1], math.nan
    for setting in SETTINGS:
        if setting.elements > leg.scene.ropes[0].length_m / SHORTEST_M:
            break
        rows = trials.rows(setting)
        reference = trials.rows(finer(setting)) if rows is not None else None
        if rows is None or reference is None:
            continue
        error = relative_error(rows, reference, leg.payload_n)
        best = setting, error
        if error <= method.error_within:
            break
    return best


SHORTEST_M = 0.3  # element: a mesh that is finer than the payload is large resolves nothing


class Trials:
    """Short runs of a leg at several settings; their numbers are negative."""

    def __init__(
        self, plan: Plan, phase: int, leg: Leg, ship: Ship, sea: SeaState, store: RowStore
    ) -> None:
        """Take the beginning of a leg; a landing is run as a whole."""
        seconds = leg.seconds if leg.bed_m is not None else leg.first_s + TRIAL_S
        self._leg = replace(leg, seconds=min(leg.seconds, seconds))
        self._plan, self._phase, self._ship, self._sea = plan, phase, ship, sea
        self._store = store
        self._failed: set[Setting] = set()

    def rows(self, setting: Setting) -> list[Row] | None:
        """Return the rows of all seeds; None if the scene does not run at the setting."""
        place = (self._phase * LEGS_MOST + self._leg.number) * len(TRIED) + TRIED.index(setting)
        numbers = [-1 - place * TRIAL_SEEDS - k for k in range(TRIAL_SEEDS)]
        kept = [row for row in map(self._store.get, numbers) if row is not None]
        if len(kept) < TRIAL_SEEDS and setting not in self._failed:
            kept = self._run(setting, numbers)
        failed = len(kept) < TRIAL_SEEDS or any(row["failure"] for row in kept)
        return None if failed else kept

    def _run(self, setting: Setting, numbers: Sequence[int]) -> list[Row]:
        phase, first = self._phase, self._plan.method.seed
        seeds = [sea_seed(first, phase, self._leg.number, k) for k in range(TRIAL_SEEDS)]
        try:
            leg = self._leg.at_setting(setting)
            found = run_seeds(leg, self._ship, self._sea, seeds)
        except RopeTwinError:
            self._failed.add(setting)
            return []
        title = self._plan.phases[phase].title
        made = [
            run_row(number, title, leg, self._sea, k, row, SETTING)
            for k, (number, row) in enumerate(zip(numbers, found, strict=True))
        ]
        self._store.add(made)
        return made


def relative_error(rows: Sequence[Row], reference: Sequence[Row], weight_n: float) -> float:
    """Return the largest error of the hook load over itself, and of the payload's least load over
    its weight.
    """
    errors = [
        max(
            abs(row["top_max_n"] - other["top_max_n"]) / other["top_max_n"],
            abs(row["payload_min_n"] - other["payload_min_n"]) / weight_n,
        )
        for row, other in zip(rows, reference, strict=True)
    ]
    return float(SECOND_ORDER * max(errors))


def governing_error(cell: Cell, height: int, judged: Judgement) -> float:
    """Return the discretisation error of the run that governs a height, as `relative_error`.

    NaN if it does not run at the finer setting.
    """
    if judged.governing_seed < 0:
        return math.nan
    leg, seed = judged.governing_leg, judged.governing_seed
    own = cell.store.get(cell.run_number(height, leg, seed))
    try:
        reference = cell.row_at(finer(cell.work.settings[leg]), height, leg, seed)
    except RopeTwinError:
        return math.nan
    if own is None or reference["failure"]:
        return math.nan
    return relative_error([own], [reference], cell.work.legs[leg].payload_n)


def find_within(search: Cell) -> tuple[Cell, CellLimit]:
    """Return the limit of a cell with a discretisation error within the plan's, and its search.

    Where the error of the governing run is above `error_within`, its leg is made finer and the
    cell searched again; not further if that does not make the error smaller, as after slack, when
    runs of two meshes drift apart, nor beyond the finest setting or where the plan gives one.

    Raises:
        RopeTwinError: a run cannot start.
    """
    limit = search.find(governing_error)
    while (better := _refined(search, limit)) is not None:
        again = better.find(governing_error)
        again = replace(again, runs=again.runs + limit.runs)
        if not again.error < limit.error:
            return search, replace(limit, runs=again.runs)
        converges = again.error <= CONVERGES * limit.error
        search, limit = better, again
        if not converges:
            break
    return search, limit


def _refined(search: Cell, limit: CellLimit) -> Cell | None:
    """Return the search with the governing leg as fine as its error asks for; None: leave it."""
    method, judged = search.plan.method, limit.judged
    fixed = method.elements is not None or judged is None or math.isnan(limit.error)
    if fixed or limit.error <= method.error_within or limit.refinements >= REFINEMENTS_MOST:
        return None
    assert judged is not None
    leg = judged.governing_leg
    own, most = limit.settings[leg], search.work.legs[leg].scene.ropes[0].length_m / SHORTEST_M
    rest = [
        one for one in SETTINGS
        if one.elements >= own.elements and one.step_s <= own.step_s and one != own
        and one.elements <= most
    ]  # fmt: skip
    if not rest:
        return None

    def expected(one: Setting) -> float:
        return limit.error * max(own.elements / one.elements, one.step_s / own.step_s) ** 2

    chosen = next((one for one in rest if expected(one) <= method.error_within), rest[-1])
    settings = [chosen if k == leg else one for k, one in enumerate(limit.settings)]
    try:
        return search.at_settings(settings, limit.refinements + 1)
    except RopeTwinError:
        return None
