"""A plan, run to its end on the cores of this machine: limits of all cells, rows of all runs.

A row is kept when its run is done. The search for a limit depends on the rows alone, so a plan that
was interrupted takes the same way again and runs only what is not there.

Mesh and time step follow from the discretisation error that is measured in the plan's seas: the
difference from twice the elements and half the step, in the same sea, times 4/3: what remains if
it falls with the square of the step (Roache 1998).
"""

from __future__ import annotations

import hashlib
import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from rope_twin.errors import InputError, RopeTwinError, whole_number
from rope_twin.planning.cells import Cell, CellLimit, PhaseWork, RowStore, runs_of_cell
from rope_twin.planning.dataset import plan_dataset
from rope_twin.planning.phases import Leg, legs_of
from rope_twin.planning.plan_file import MAX_LEGS, Plan
from rope_twin.planning.plan_reader import read_plan, spreading_of, tip_of, with_error
from rope_twin.planning.runs import SETTING, STATISTICS, Row, run_row, run_seeds, sea_seed
from rope_twin.planning.seas import SeaState, Ship
from rope_twin.scene.convergence import known_error, solver_version
from rope_twin.scene.error_bound import KnownError, Setting
from rope_twin.scene.schema import Scene
from rope_twin.studies.study_run import RowFolder, on_cluster, on_cores
from rope_twin.twin.ensemble.ensemble import cores

if TYPE_CHECKING:
    from xarray import Dataset

    from rope_twin.planning.judgement import CriteriaAssessment

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
MAX_REFINEMENTS = 3  # of a cell
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
    if leg.by_twin:  # contact and multi-line systems need the scene's own mesh and step
        return Setting(leg.scene.ropes[0].elements, leg.scene.time.step_s), math.nan
    trials = Trials(plan, number, leg, ship, sea, store)
    choice = SETTINGS[-1], math.nan
    for setting in SETTINGS:
        if setting.elements > leg.scene.ropes[0].length_m / SHORTEST_M:
            break
        rows = trials.rows(setting)
        reference = trials.rows(finer(setting)) if rows is not None else None
        if rows is None or reference is None:
            continue
        # a run that fails at both settings fails by its sea
        pairs = [pair for pair in zip(rows, reference, strict=True) if not pair[1]["failure"]]
        if not pairs or any(row["failure"] for row, _ in pairs):
            continue
        coarse, fine = zip(*pairs, strict=True)
        error = relative_error(coarse, fine, leg.payload_n)
        choice = setting, error
        if error <= method.error_within:
            break
    return choice


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
        trial = (self._phase * MAX_LEGS + self._leg.number) * len(TRIED) + TRIED.index(setting)
        numbers = [-1 - trial * TRIAL_SEEDS - k for k in range(TRIAL_SEEDS)]
        rows = [row for row in map(self._store.get, numbers) if row is not None]
        if len(rows) < TRIAL_SEEDS and setting not in self._failed:
            rows = self._run(setting, numbers)
        return None if len(rows) < TRIAL_SEEDS else rows

    def _run(self, setting: Setting, numbers: Sequence[int]) -> list[Row]:
        phase, first = self._phase, self._plan.method.seed
        seeds = [sea_seed(first, phase, self._leg.number, k) for k in range(TRIAL_SEEDS)]
        try:
            leg = self._leg.at_setting(setting)
            results = run_seeds(leg, self._ship, self._sea, seeds)
        except RopeTwinError:
            self._failed.add(setting)
            return []
        title = self._plan.phases[phase].title
        rows = [
            run_row(number, title, leg, self._sea, k, row, SETTING)
            for k, (number, row) in enumerate(zip(numbers, results, strict=True))
        ]
        self._store.add(rows)
        return rows


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


def governing_error(cell: Cell, height: int, judged: CriteriaAssessment) -> float:
    """Return the discretisation error of the run that governs a height, as `relative_error`.

    NaN if it does not run at the finer setting.
    """
    if judged.governing_seed < 0:
        return math.nan
    leg, seed = judged.governing_leg, judged.governing_seed
    row = cell.store.get(cell.run_number(height, leg, seed))
    try:
        reference = cell.row_at(finer(cell.work.settings[leg]), height, leg, seed)
    except RopeTwinError:
        return math.nan
    if row is None or reference["failure"]:
        return math.nan
    return relative_error([row], [reference], cell.work.legs[leg].payload_n)


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
        refined = better.find(governing_error)
        refined = replace(refined, runs=refined.runs + limit.runs)
        if not refined.error < limit.error:
            return search, replace(limit, runs=refined.runs)
        converges = refined.error <= CONVERGES * limit.error
        search, limit = better, refined
        if not converges:
            break
    return search, limit


def _refined(search: Cell, limit: CellLimit) -> Cell | None:
    """Return the search with the governing leg as fine as its error asks for; None: leave it."""
    method, judged = search.plan.method, limit.judged
    fixed = method.elements is not None or judged is None or math.isnan(limit.error)
    if fixed or limit.error <= method.error_within or limit.refinements >= MAX_REFINEMENTS:
        return None
    assert judged is not None
    leg = judged.governing_leg
    current = limit.settings[leg]
    max_elements = search.work.legs[leg].scene.ropes[0].length_m / SHORTEST_M
    rest = [
        item for item in SETTINGS
        if item.elements >= current.elements and item.step_s <= current.step_s and item != current
        and item.elements <= max_elements
    ]  # fmt: skip
    if not rest:
        return None

    def expected(setting: Setting) -> float:
        ratio = max(current.elements / setting.elements, setting.step_s / current.step_s)
        return limit.error * ratio**2

    selected = next((item for item in rest if expected(item) <= method.error_within), rest[-1])
    settings = [selected if k == leg else setting for k, setting in enumerate(limit.settings)]
    try:
        return search.at_settings(settings, limit.refinements + 1)
    except RopeTwinError:
        return None


VERSION = 5  # of what the rows mean
Report = Callable[[int, int, int], None]  # cells done, cells in all, runs done


@dataclass(frozen=True)
class PlanResult:
    """Limits of all cells of a plan, in the order of its grid."""

    plan: Plan
    scene: Scene
    works: tuple[PhaseWork, ...]
    cells: tuple[CellLimit, ...]
    study: KnownError  # discretisation error of the scene at its own setting
    runs: int  # of all cells
    simulated_s: float  # time of all runs
    made: int  # runs of this call, with those for errors and settings; the others were there
    made_s: float  # time of them
    elapsed_s: float  # real time of this call
    rows: tuple[Row, ...]  # of the cells' runs, by number

    @property
    def dataset(self) -> Dataset:
        """Return limits and runs with named axes, as an xarray Dataset.

        Raises:
            InputError: xarray is not installed.
        """
        return plan_dataset(self)

    def of_phase(self, title: str) -> list[CellLimit]:
        """Return the cells of a phase."""
        return [cell for cell in self.cells if cell.phase == title]

    def by_sea(self, title: str) -> dict[tuple[float, float], CellLimit]:
        """Return the cells of a phase by peak period [s] and heading [°]."""
        return {(cell.period_s, cell.heading_deg): cell for cell in self.of_phase(title)}

    def work_of(self, cell: CellLimit) -> PhaseWork:
        """Return the phase of a cell."""
        return next(work for work in self.works if work.title == cell.phase)

    def search_of(self, limit: CellLimit) -> Cell:
        """Return the search of a cell at its settings, without rows."""
        indices = self.plan.grid[self.cells.index(limit)]
        search = Cell(self.plan, self.works[indices[0]], indices, RowStore())
        return search.at_settings(limit.settings, limit.refinements)


class PlanFolder(RowFolder):
    """Folder of a plan's rows, with the store of them."""

    title = "plan"
    whole = "run", "leg", "seed", "sea_seed", "elements"
    words = "phase", "purpose", "failure"

    def __init__(self, folder: Path, plan: Plan, stamp: str) -> None:
        """Open the folder.

        Raises:
            InputError: another process is at it, it holds another plan, or it cannot be written.
        """
        super().__init__(folder, plan.name, plan.scene, stamp)
        self.store = RowStore({int(row["run"]): row for row in self.rows()}, self.add)


def plan_stamp(plan: Plan, scene: Scene) -> str:
    """Return a digest of plan, scene and solver, on which all rows depend."""
    inputs = repr((VERSION, plan.digest, scene.digest, solver_version(scene)))
    return hashlib.sha256(inputs.encode()).hexdigest()[:16]


def plan(
    name_or_path: str | Path,
    out: str | Path | None = None,
    threads: int | None = None,
    within: float | None = None,
) -> PlanResult:
    """Run a plan and return the limits of its cells.

    Args:
        name_or_path: a name in config/plans, or the path of a plan file.
        out: folder of the rows, so that an interrupted plan continues; None: rows stay in memory.
        threads: number of parallel threads; None: as many as there are cores.
        within: discretisation error of each cell, over its loads; None: that of the plan.

    Raises:
        RopeTwinError: the plan is invalid, or the folder holds another one; one sentence.
    """
    if threads is not None:
        threads = whole_number("plan", "threads", threads)
    file_plan, scene = read_plan(name_or_path)
    if within is not None:
        file_plan = with_error(file_plan, within)
    if out is None:
        return run_plan(file_plan, scene, RowStore(), threads=threads)
    with PlanFolder(Path(out), file_plan, plan_stamp(file_plan, scene)) as folder:
        result = run_plan(file_plan, scene, folder.store, threads=threads)
        folder.close_rows()
        return result


def run_plan(
    plan: Plan,
    scene: Scene,
    store: RowStore,
    report: Report = lambda done, total, runs: None,
    threads: int | None = None,
    scheduler: str = "",
) -> PlanResult:
    """Find the limits of all cells.

    store: rows that are done, and those to come. report: called after each cell. threads: cells at
    a time; None: as many as there are cores. scheduler: address of a Dask scheduler, whose workers
    take a cell at a time; empty: this machine's cores.

    Raises:
        RopeTwinError: a phase cannot be run, or there is no such scheduler; one sentence.
    """
    start_s = time.perf_counter()
    counted_store = _Counted(store)
    works = prepare(plan, scene, counted_store)
    report(0, len(plan.grid), counted_store.made)
    limits: dict[int, CellLimit] = {}
    results = (
        _on_cluster(plan, works, counted_store, scheduler)
        if scheduler
        else _on_cores(plan, works, counted_store, cores() if threads is None else threads)
    )
    for number, limit in results:
        limits[number] = limit
        report(len(limits), len(plan.grid), counted_store.made)
    ordered = tuple(limits[k] for k in range(len(plan.grid)))
    used_rows = (counted_store.used[run] for run in sorted(counted_store.used))
    rows = tuple(row for row in used_rows if row["purpose"] == STATISTICS)
    return PlanResult(
        plan=plan,
        scene=scene,
        works=works,
        cells=ordered,
        study=known_error(scene),
        runs=len(rows),
        simulated_s=math.fsum(row["seconds"] for row in rows),
        made=counted_store.made,
        made_s=counted_store.made_s,
        elapsed_s=time.perf_counter() - start_s,
        rows=rows,
    )


def _on_cores(
    plan: Plan, works: tuple[PhaseWork, ...], counted_store: _Counted, threads: int
) -> Iterator[tuple[int, CellLimit]]:
    """Yield number and limit of each cell, as they come."""

    def find(number: int) -> tuple[int, CellLimit]:
        indices = plan.grid[number]
        return number, find_within(Cell(plan, works[indices[0]], indices, counted_store))[1]

    return on_cores(find, range(len(plan.grid)), threads, counted_store.stop)


@dataclass(frozen=True)
class CellTask:
    """Search of one cell, with the rows that are done; the complete input of a worker."""

    plan: Plan
    work: PhaseWork  # of the cell's phase
    number: int  # of the cell in the plan's grid
    rows: Mapping[int, Row]


def find_cell(task: CellTask) -> tuple[int, CellLimit, list[Row]]:
    """Return number and limit of a cell, and the rows that were used.

    Raises:
        RopeTwinError: a run cannot start.
    """
    counted_store = _Counted(RowStore(dict(task.rows)))
    cell = Cell(task.plan, task.work, task.plan.grid[task.number], counted_store)
    return task.number, find_within(cell)[1], list(counted_store.used.values())


def _on_cluster(
    plan: Plan, works: tuple[PhaseWork, ...], counted_store: _Counted, address: str
) -> Iterator[tuple[int, CellLimit]]:
    """Yield number and limit of each cell, found by a Dask cluster."""
    parts: dict[int, dict[int, Row]] = {number: {} for number in range(len(plan.grid))}
    for run, row in counted_store.rows.items():
        if run < 0:  # a trial of a setting
            continue
        parts[run // runs_of_cell(plan) % len(parts)][run] = row
    tasks = [
        CellTask(plan, works[plan.grid[number][0]], number, rows) for number, rows in parts.items()
    ]
    for number, limit, rows in on_cluster(find_cell, tasks, address):
        known = parts[number]
        counted_store.used |= {int(row["run"]): row for row in rows}
        new_rows = [row for row in rows if int(row["run"]) not in known]
        if new_rows:
            counted_store.add(new_rows)
        yield number, limit


class _Stopped(Exception):
    """The plan was interrupted elsewhere."""


class _Counted(RowStore):
    """A store that counts what passes through it on the way to another one."""

    def __init__(self, store: RowStore) -> None:
        super().__init__(store.rows, store.add)
        self.made, self.made_s = 0, 0.0
        self.stopped = False
        self.used: dict[int, Row] = {}

    def stop(self) -> None:
        """Let searches in progress end at their next batch."""
        self.stopped = True

    def get(self, run: int) -> Row | None:
        """Return the row of a run. Raises _Stopped: the plan was interrupted."""
        if self.stopped:
            raise _Stopped
        row = super().get(run)
        if row is not None:
            self.used[run] = row
        return row

    def add(self, rows: Sequence[Row]) -> None:
        """Keep rows."""
        super().add(rows)
        self.made += len(rows)
        self.made_s += math.fsum(row["seconds"] for row in rows)
        self.used |= {int(row["run"]): row for row in rows}


def prepare(plan: Plan, scene: Scene, store: RowStore | None = None) -> tuple[PhaseWork, ...]:
    """Return all phases, ready to run; their settings by the errors in a sea of the middle.

    That sea has the middle of the heights and the shortest period of the plan, which asks most of
    mesh and step.

    store: of the rows of trials; None: in memory.

    Raises:
        RopeTwinError: a phase cannot be run; one sentence.
    """
    ship, rows = Ship(tip_of(plan, scene), plan.bow_of(scene)), store or RowStore()
    heights = plan.heights_m(0, 0)
    middle = plan.sea_state(heights[len(heights) // 2], 0, 0)
    sea = replace(middle, spreading=spreading_of(plan, scene))
    works = []
    for number, phase in enumerate(plan.phases):
        legs = [
            leg.at_setting(*choose_setting(plan, number, leg, ship, sea, rows))
            for leg in legs_of(plan, scene, phase)
        ]
        works.append(PhaseWork.of(plan, scene, number, legs, ship))
    return tuple(works)


def cell_named(plan: Plan, text: str) -> tuple[int, int, int]:
    """Return the cell of `PHASE,TP,HEADING`, such as `at_depth,9,135`.

    Raises:
        InputError: there is no such cell.
    """
    parts = [part.strip() for part in text.split(",")]
    where = f"--cell {text}"
    if len(parts) != 3:
        raise InputError(where, "it is no cell", "write PHASE,TP,HEADING")
    titles = [phase.title for phase in plan.phases]
    if parts[0] not in titles:
        raise InputError(where, f"there is no phase '{parts[0]}'", f"known: {', '.join(titles)}")
    indices = [titles.index(parts[0])]
    axes: Mapping[str, tuple[float, ...]] = {
        "Tp": plan.sea.tp_s, "heading": plan.sea.headings_deg
    }  # fmt: skip
    for (name, values), word in zip(axes.items(), parts[1:], strict=True):
        try:
            indices.append(values.index(float(word)))
        except ValueError:
            remedy = f"known: {', '.join(f'{value:g}' for value in values)}"
            raise InputError(where, f"there is no {name} '{word}'", remedy) from None
    return indices[0], indices[1], indices[2]
