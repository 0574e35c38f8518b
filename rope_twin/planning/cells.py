"""Limiting sea state of a cell (phase, peak period, heading) by bisection on the grid of heights.

A height is judged by as many seeds as the decision takes: they grow until the interval of each
judged value is narrow, or lies on one side of its limit. All heights of a cell have the same seeds
of the sea, so that the use of a limit grows with the height as smoothly as the physics has it. The
search begins at the limit of the simplified method and evaluates heights near the limit only.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from rope_twin.errors import RopeTwinError
from rope_twin.planning.judgement import (
    CriteriaAssessment,
    Limit,
    judge,
    limits_of,
    simplified_uses,
)
from rope_twin.planning.phases import Leg
from rope_twin.planning.plan_file import MAX_LEGS, MAX_SEEDS, Plan
from rope_twin.planning.plan_reader import spreading_of
from rope_twin.planning.runs import ERROR, STATISTICS, Row, run_row, run_seeds, sea_seed
from rope_twin.planning.seas import SeaState, Ship
from rope_twin.planning.simplified import Simplified, simplified
from rope_twin.scene.error_bound import Setting
from rope_twin.scene.schema import Scene

ERROR_RUNS = 100  # refinements from here on are those of the runs that give an error


def runs_of_cell(plan: Plan) -> int:
    """Return the number of run numbers of a cell."""
    return len(plan.sea.hs_m.values) * MAX_LEGS * MAX_SEEDS


class RowStore:
    """Rows of finished runs, by their number, which threads share."""

    def __init__(
        self,
        rows: dict[int, Row] | None = None,
        keep: Callable[[Sequence[Row]], None] = lambda rows: None,
    ) -> None:
        """Take rows that are done; keep: called with new ones, as to write them to disk."""
        self.rows = {} if rows is None else rows
        self._keep, self._guard = keep, threading.Lock()

    def get(self, run: int) -> Row | None:
        """Return the row of a run; None if it is not done."""
        return self.rows.get(run)

    def add(self, rows: Sequence[Row]) -> None:
        """Keep the rows of finished runs."""
        with self._guard:
            self._keep(rows)
            self.rows |= {int(row["run"]): row for row in rows}


@dataclass(frozen=True)
class PhaseWork:
    """A phase, ready to run: legs at their settings, criteria, ship."""

    number: int
    title: str
    legs: tuple[Leg, ...]  # at their settings
    limits: tuple[Limit, ...]
    ship: Ship

    @classmethod
    def of(cls, plan: Plan, scene: Scene, number: int, legs: Sequence[Leg], ship: Ship) -> Self:
        """Return the phase of a number, by its legs at their settings."""
        limits = limits_of(plan, scene, legs)
        return cls(number, plan.phases[number].title, tuple(legs), tuple(limits), ship)

    @property
    def settings(self) -> tuple[Setting, ...]:
        """Return the settings of the legs."""
        return tuple(leg.setting for leg in self.legs)

    @property
    def weight_n(self) -> float:
        """Return the submerged weight of the payload [N]."""
        return self.legs[0].payload_n

    @property
    def static_use(self) -> float:
        """Return the largest use of a limit by the static hook load, in flat water."""
        hook = [limit.most for limit in self.limits if limit.quantity == "hook_load"]
        return max((self.static_hook_n / limit_n for limit_n in hook), default=0.0)

    @property
    def static_hook_n(self) -> float:
        """Return the largest static hook load of the phase [N]."""
        return max(leg.static_hook_n for leg in self.legs)


@dataclass(frozen=True)
class CellLimit:
    """Limiting sea state of a cell, with the numbers there."""

    phase: str
    kind: str
    period_s: float
    heading_deg: float
    height_m: float | None  # largest Hs of the grid that meets all criteria; None: none does
    crossing_m: float  # Hs at which the use is 1, between heights of the grid
    low_m: float  # interval of the crossing
    high_m: float
    capped: str  # why no higher sea was judged: the end of the grid, or breaking waves; "": judged
    governing: str  # criterion that the next height breaks, or why it could not be judged; at the
    # cap that of the largest use
    judged: CriteriaAssessment | None  # at the limiting height
    beyond: CriteriaAssessment | None  # at the next height
    simplified_height_m: float | None  # by the simplified method alone
    simplified_capped: str  # as `capped`, of that height
    simplified: tuple[Simplified, ...]  # at the limiting height, of each leg
    error: float  # discretisation error of the governing run, over its hook load; NaN: unknown
    heights: int  # that were judged
    runs: int
    settings: tuple[Setting, ...]  # of the legs of its phase
    refinements: int  # times that a leg's setting was made finer, as the error was too large

    @property
    def shown(self) -> CriteriaAssessment | None:
        """Return the judgement at the limit, or of the lowest height where none is allowed."""
        return self.judged or self.beyond

    @property
    def setting(self) -> Setting:
        """Return mesh and step of the governing run."""
        return self.settings[0 if self.shown is None else self.shown.governing_leg]

    @property
    def row_head(self) -> list[str]:
        """Return phase, peak period and heading, as cells of a table."""
        return [self.phase, f"{self.period_s:g}", f"{self.heading_deg:g}"]

    @property
    def sea(self) -> str:
        """Return peak period and heading in words."""
        return f"Tp {self.period_s:g} s, heading {self.heading_deg:g}°"


class Cell:
    """Search for the limiting sea state of one cell."""

    def __init__(
        self,
        plan: Plan,
        work: PhaseWork,
        cell: tuple[int, int, int],
        store: RowStore,
        refinements: int = 0,
    ) -> None:
        self.plan, self.work, self.store = plan, work, store
        self.refinements = refinements
        _, self._period, self._heading = self._cell = cell
        self._spreading = spreading_of(plan, work.legs[0].scene)
        self.heights_m = plan.heights_m(self._period, self._heading)
        self.judged: dict[int, CriteriaAssessment] = {}

    def at_settings(self, settings: Sequence[Setting], refinements: int) -> Cell:
        """Return the search of the same cell with its legs at these settings.

        Raises:
            SceneError: a leg does not take its setting.
        """
        legs = tuple(
            leg if leg.setting == setting else leg.at_setting(setting)
            for leg, setting in zip(self.work.legs, settings, strict=True)
        )
        work = replace(self.work, legs=legs)
        return Cell(self.plan, work, self._cell, self.store, refinements)

    def sea(self, height_m: float) -> SeaState:
        """Return the sea state of a height."""
        sea = self.plan.sea_state(height_m, self._period, self._heading)
        return replace(sea, spreading=self._spreading)

    def run_number(self, height: int, leg: int, seed: int, purpose: str = STATISTICS) -> int:
        """Return the number of a run, which tells its place in the plan."""
        plan = self.plan
        periods, headings = len(plan.sea.tp_s), len(plan.sea.headings_deg)
        phase, period, heading = self._cell
        cell = (phase * periods + period) * headings + heading
        times = self.refinements + (ERROR_RUNS if purpose == ERROR else 0)
        cell += times * len(plan.grid)
        return cell * runs_of_cell(plan) + (height * MAX_LEGS + leg) * MAX_SEEDS + seed

    def rows(self, height: int, seeds: int) -> list[Row]:
        """Return the rows of the first seeds at a height; run those that are missing.

        Raises:
            RopeTwinError: a run cannot start.
        """
        rows, work = [], self.work
        for leg in work.legs:
            numbers = [self.run_number(height, leg.number, k) for k in range(seeds)]
            row_of_run = {number: self.store.get(number) for number in numbers}
            missing_seeds = [k for k, number in enumerate(numbers) if row_of_run[number] is None]
            if missing_seeds:
                new_rows = self._run(height, leg, missing_seeds)
                row_of_run |= {int(row["run"]): row for row in new_rows}
            rows += [row for row in row_of_run.values() if row is not None]
        return rows

    def row_at(self, setting: Setting, height: int, leg: int, seed: int) -> Row:
        """Return the row of a run at another setting, which gives the error of that seed's own.

        Raises:
            RopeTwinError: the run cannot start.
        """
        stored = self.store.get(self.run_number(height, leg, seed, ERROR))
        if stored is not None:
            return stored
        other = self.work.legs[leg].at_setting(setting)
        return self._run(height, other, [seed], ERROR)[0]

    def _run(
        self, height: int, leg: Leg, seeds: Sequence[int], purpose: str = STATISTICS
    ) -> list[Row]:
        """Run seeds of a leg, which is at a setting, and keep their rows."""
        sea, plan, work = self.sea(self.heights_m[height]), self.plan, self.work
        sea_seeds = [sea_seed(plan.method.seed, work.number, leg.number, k) for k in seeds]
        rows = [
            run_row(
                self.run_number(height, leg.number, k, purpose), work.title, leg, sea, k, row,
                purpose,
            )
            for k, row in zip(seeds, run_seeds(leg, work.ship, sea, sea_seeds), strict=True)
        ]  # fmt: skip
        self.store.add(rows)
        return rows

    def judge(self, height: int, narrow: bool = False, more: bool = False) -> CriteriaAssessment:
        """Return the judgement of a height, with as many seeds as the decision requires.

        narrow: until the intervals are narrow, even if the decision is clear; more: with more seeds
        than before.
        """
        method = self.plan.method
        before = self.judged.get(height)
        seeds = before.seeds if before is not None and before.seeds else method.seeds.start
        if more:
            seeds = min(seeds + method.seeds.start, method.seeds.most)
        while True:
            try:
                rows = self.rows(height, seeds)
            except RopeTwinError as error:
                judgement = CriteriaAssessment(
                    self.heights_m[height], 0, {}, {}, 0.0, 0, str(error)
                )
                break
            limits, legs = self.work.limits, self.work.legs
            judgement = judge(self.plan, limits, rows, self.heights_m[height], legs)
            if (
                judgement.narrow(method.within)
                or (judgement.clear and not narrow)
                or judgement.failures
            ):
                break
            if seeds >= method.seeds.most:
                break
            seeds = min(seeds + method.seeds.start, method.seeds.most)
        self.judged[height] = judgement
        return judgement

    def simplified(self, height_m: float) -> list[Simplified]:
        """Return the simplified method's values of each leg; it has none in multi-line systems."""
        if self.work.legs[0].ropes:
            return []
        tip, sea = self.work.ship.tip, self.sea(height_m)
        percentile = self.plan.method.percentile
        return [simplified(leg, tip, sea, percentile) for leg in self.work.legs]

    def simplified_limit(self) -> int:
        """Return the index of the largest height within the limits by the simplified method; -1."""
        return bisect(len(self.heights_m), lambda k: self.simplified_use(k) <= 1.0)

    def simplified_use(self, height: int) -> float:
        """Return the largest use of a limit at a height by the simplified method."""
        loads = self.simplified(self.heights_m[height])
        if not loads:  # it has no formulas for these ropes
            return math.inf
        uses = simplified_uses(self.work.limits, loads, self.work.weight_n)
        return max(uses.values(), default=0.0)

    def find(
        self, refine: Callable[[Cell, int, CriteriaAssessment], float] | None = None
    ) -> CellLimit:
        """Return the limiting sea state.

        refine: returns the discretisation error of the governing run of a height.
        """
        simple = self.simplified_limit()
        last = bisect(len(self.heights_m), lambda k: self.judge(k).passed, max(simple, 0))
        judgement = self.judge(last, narrow=True) if last >= 0 else None
        # more seeds may turn a decision that was not clear
        if judgement is not None and not judgement.passed:
            last = bisect(last, lambda k: self.judge(k, narrow=True).passed, last - 1)
            judgement = self.judged[last] if last >= 0 else None
        top = len(self.heights_m) - 1
        tolerance_m, max_seeds = self.plan.method.height_within_m, self.plan.method.seeds.most
        while True:
            beyond = self.judge(last + 1) if last < top else None
            crossing, low, high = self._crossing()
            if tolerance_m is None or 0.5 * (high - low) <= tolerance_m or beyond is None:
                break
            pair = [k for k in (last, last + 1) if k >= 0 and self.judged[k].seeds < max_seeds]
            if not pair or beyond.fault or beyond.failures:
                break
            for k in pair:
                self.judge(k, more=True)
            last = bisect(len(self.heights_m), lambda k: self.judge(k).passed, last)
            judgement = self.judge(last, narrow=True) if last >= 0 else None
        decisive = beyond or judgement
        assert decisive is not None
        error = (
            refine(self, last, judgement)
            if refine is not None and judgement is not None
            else math.nan
        )
        plan, work = self.plan, self.work
        grid_end = top == len(plan.sea.hs_m.values) - 1
        cap = "end of the grid" if grid_end else "higher waves break"
        by_hand = self.simplified(self.heights_m[max(last, 0)])
        return CellLimit(
            phase=work.title,
            kind=plan.phases[work.number].kind,
            period_s=plan.sea.tp_s[self._period],
            heading_deg=plan.sea.headings_deg[self._heading],
            height_m=self.heights_m[last] if last >= 0 else None,
            crossing_m=crossing,
            low_m=low,
            high_m=high,
            capped="" if last < top else cap,
            governing=decisive.fault or decisive.failure or decisive.governing,
            judged=judgement,
            beyond=beyond,
            simplified_height_m=self.heights_m[simple] if simple >= 0 else None,
            simplified_capped=cap if by_hand and simple == top else "",
            simplified=tuple(by_hand),
            error=error,
            heights=len(self.judged),
            runs=sum(judged.seeds for judged in self.judged.values()) * len(work.legs),
            settings=work.settings,
            refinements=self.refinements,
        )

    def _crossing(self) -> tuple[float, float, float]:
        """Return the height at which the largest use is 1, with its interval [m].

        Linear between judged heights, and from the static load in flat water; at most the last
        judged height that could be run, 0 if the static load is too large.
        """
        judged = [self.judged[k] for k in sorted(self.judged)]
        judged = [item for item in judged if item.uses and math.isfinite(item.use)]
        heights = [0.0, *(judgement.height_m for judgement in judged)]

        def crossing(side: str) -> float:
            uses = [
                max(getattr(use, side) for use in judgement.uses.values()) for judgement in judged
            ]
            levels = np.maximum.accumulate([self.work.static_use, *uses])
            above = np.flatnonzero(levels > 1.0)
            if not above.size:
                return heights[-1]
            k = int(above[0])
            if k == 0:
                return 0.0
            share = (1.0 - levels[k - 1]) / (levels[k] - levels[k - 1])
            return heights[k - 1] + float(share) * (heights[k] - heights[k - 1])

        return crossing("value"), crossing("high"), crossing("low")


def bisect(count: int, passes: Callable[[int], bool], guess: int | None = None) -> int:
    """Return the last index that passes, of indices that pass up to some one; -1 if none does.

    guess: where to look first; from there in doubled steps until the border is enclosed.
    """
    low, high, step = -1, count, 1
    trial = guess
    while high - low > 1:
        middle = (low + high) // 2 if trial is None else min(max(trial, low + 1), high - 1)
        if passes(middle):
            low = middle
            trial = None if trial is None or high < count else low + step
        else:
            high = middle
            trial = None if trial is None or low >= 0 else high - step
        step *= 2
    return low
