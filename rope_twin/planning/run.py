"""A plan, run to its end on the cores of this machine: limits of all cells, rows of all runs.

A row is kept when its run is done. The search for a limit depends on the rows alone, so a plan that
was interrupted takes the same way again and runs only what is not there.
"""

from __future__ import annotations

import hashlib
import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from rope_twin.errors import InputError
from rope_twin.planning.cells import Cell, CellLimit, PhaseWork, RowStore, runs_of_cell
from rope_twin.planning.dataset import plan_dataset
from rope_twin.planning.phases import legs_of
from rope_twin.planning.plan_file import Plan
from rope_twin.planning.plan_reader import read_plan, spreading_of, tip_of, with_error
from rope_twin.planning.runs import STATISTICS
from rope_twin.planning.seas import Ship
from rope_twin.planning.settings import choose_setting, find_within
from rope_twin.planning.twin_runs import Row
from rope_twin.scene.convergence import known_error, solver_version
from rope_twin.scene.error_bound import KnownError
from rope_twin.scene.schema import Scene
from rope_twin.studies.study_run import RowFolder, on_cluster, on_cores
from rope_twin.twin.ensemble.ensemble import cores

if TYPE_CHECKING:
    from xarray import Dataset

VERSION = 3  # of what the rows mean
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
        place = self.plan.grid[self.cells.index(limit)]
        search = Cell(self.plan, self.works[place[0]], place, RowStore())
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
    own, scene = read_plan(name_or_path)
    if within is not None:
        own = with_error(own, within)
    if out is None:
        return run_plan(own, scene, RowStore(), threads=threads)
    with PlanFolder(Path(out), own, plan_stamp(own, scene)) as folder:
        found = run_plan(own, scene, folder.store, threads=threads)
        folder.close_rows()
        return found


def run_plan(
    plan: Plan,
    scene: Scene,
    store: RowStore,
    report: Report = lambda done, total, runs: None,
    threads: int | None = None,
    scheduler: str = "",
) -> PlanResult:
    """Find the limits of all cells.

    Args:
        plan: as read.
        scene: of the plan.
        store: rows that are done, and those to come.
        report: called after each cell.
        threads: number of cells at a time; None: as many as there are cores.
        scheduler: address of a Dask scheduler, whose workers take a cell at a time; empty: this
            machine's cores.

    Raises:
        RopeTwinError: a phase cannot be run, or there is no such scheduler; one sentence.
    """
    began = time.perf_counter()
    counted = _Counted(store)
    works = prepare(plan, scene, counted)
    report(0, len(plan.grid), counted.made)
    found: dict[int, CellLimit] = {}
    results = (
        _on_cluster(plan, works, counted, scheduler)
        if scheduler
        else _on_cores(plan, works, counted, cores() if threads is None else threads)
    )
    for number, limit in results:
        found[number] = limit
        report(len(found), len(plan.grid), counted.made)
    ordered = tuple(found[k] for k in range(len(plan.grid)))
    used = (counted.used[run] for run in sorted(counted.used))
    rows = tuple(row for row in used if row["purpose"] == STATISTICS)
    return PlanResult(
        plan=plan,
        scene=scene,
        works=works,
        cells=ordered,
        study=known_error(scene),
        runs=len(rows),
        simulated_s=math.fsum(row["seconds"] for row in rows),
        made=counted.made,
        made_s=counted.made_s,
        elapsed_s=time.perf_counter() - began,
        rows=rows,
    )


def _on_cores(
    plan: Plan, works: tuple[PhaseWork, ...], counted: _Counted, threads: int
) -> Iterator[tuple[int, CellLimit]]:
    """Yield number and limit of each cell, as they come."""

    def find(number: int) -> tuple[int, CellLimit]:
        place = plan.grid[number]
        return number, find_within(Cell(plan, works[place[0]], place, counted))[1]

    return on_cores(find, range(len(plan.grid)), threads, counted.stop)


@dataclass(frozen=True)
class CellTask:
    """Search of one cell, with the rows that are done; all that a worker needs to know."""

    plan: Plan
    work: PhaseWork  # of the cell's phase
    number: int  # of the cell in the plan's grid
    rows: Mapping[int, Row]


def find_cell(task: CellTask) -> tuple[int, CellLimit, list[Row]]:
    """Return number and limit of a cell, and the rows that were used.

    Raises:
        RopeTwinError: a run cannot start.
    """
    counted = _Counted(RowStore(dict(task.rows)))
    cell = Cell(task.plan, task.work, task.plan.grid[task.number], counted)
    return task.number, find_within(cell)[1], list(counted.used.values())


def _on_cluster(
    plan: Plan, works: tuple[PhaseWork, ...], counted: _Counted, address: str
) -> Iterator[tuple[int, CellLimit]]:
    """Yield number and limit of each cell, found by a Dask cluster."""
    parts: dict[int, dict[int, Row]] = {number: {} for number in range(len(plan.grid))}
    for run, row in counted.rows.items():
        if run < 0:  # a trial of a setting
            continue
        parts[run // runs_of_cell(plan) % len(parts)][run] = row
    tasks = [
        CellTask(plan, works[plan.grid[number][0]], number, rows) for number, rows in parts.items()
    ]
    for number, limit, rows in on_cluster(find_cell, tasks, address):
        known = parts[number]
        counted.used |= {int(row["run"]): row for row in rows}
        made = [row for row in rows if int(row["run"]) not in known]
        if made:
            counted.add(made)
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
        """Return the row of a run.

        Raises:
            _Stopped: the plan was interrupted.
        """
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


def cell_named(plan: Plan, words: str) -> tuple[int, int, int]:
    """Return the cell of `PHASE,TP,HEADING`, such as `at_depth,9,165`.

    Raises:
        InputError: there is no such cell.
    """
    parts = [part.strip() for part in words.split(",")]
    where = f"--cell {words}"
    if len(parts) != 3:
        raise InputError(where, "it is no cell", "write PHASE,TP,HEADING")
    titles = [phase.title for phase in plan.phases]
    if parts[0] not in titles:
        raise InputError(where, f"there is no phase '{parts[0]}'", f"known: {', '.join(titles)}")
    found = [titles.index(parts[0])]
    axes: Mapping[str, tuple[float, ...]] = {
        "Tp": plan.sea.tp_s, "heading": plan.sea.headings_deg
    }  # fmt: skip
    for (name, values), word in zip(axes.items(), parts[1:], strict=True):
        try:
            found.append(values.index(float(word)))
        except ValueError:
            right = f"known: {', '.join(f'{value:g}' for value in values)}"
            raise InputError(where, f"there is no {name} '{word}'", right) from None
    return found[0], found[1], found[2]
