"""Sensitivity of a plan's limits to its uncertain data: which of it is worth measuring.

Screening after Morris (1991), with the mean μ* of the absolute elementary effects (Campolongo,
Cariboni and Saltelli 2007), or variance shares after Sobol (Saltelli et al. 2010), both by SALib.
One cell of the plan is looked at. Every sample has the seeds of the sea, mesh and step of the plan
itself, so that what differs between two samples is the data alone.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from rope_twin.errors import InputError, RopeTwinError, require
from rope_twin.planning.cells import Cell, PhaseWork, RowStore
from rope_twin.planning.judgement import QUANTITIES, Quantity
from rope_twin.planning.phases import legs_of
from rope_twin.planning.plan_file import Plan, Seeds
from rope_twin.planning.plan_reader import faults, tip_of
from rope_twin.planning.run import plan_stamp, prepare
from rope_twin.planning.runs import Row
from rope_twin.planning.seas import Ship
from rope_twin.planning.uncertainties import with_values
from rope_twin.scene.error_bound import Setting
from rope_twin.scene.schema import Scene
from rope_twin.sea.tables import Vector
from rope_twin.studies.picture import Line, Panel
from rope_twin.studies.study_run import RowFolder, spread

Method = Literal["morris", "sobol"]
LEVELS = 4  # of the grid of Morris
RESAMPLES = 200  # of the bootstrap behind the intervals
CONFIDENCE = 0.9
LIMIT, USE = "limiting_hs_m", "use"
OUTPUTS: Mapping[str, Quantity] = {  # in units of tables and pictures; rows are in SI
    LIMIT: Quantity("limiting Hs", "m", 1.0),
    USE: Quantity("largest use of a limit", "%", 100.0),
    "hook_load": QUANTITIES["hook_load"],
    "uplift": Quantity("uplift over submerged weight", "%", 100.0),
}
Report = Callable[[int, int], None]  # samples done, samples in all


@dataclass(frozen=True)
class Index:
    """Weight of one uncertain number for one output.

    Morris: the mean absolute change of the output over the number's range, and the standard
    deviation of that change, which is large where it is not linear or other numbers matter to it.
    Sobol: the share of the output's variance that the number has by itself, and together with
    others.
    """

    name: str
    output: str
    first: float  # μ* in units of the output, or S1
    first_width: float  # half width of the interval of 90 %
    total: float  # σ in units of the output, or ST
    total_width: float  # nan with Morris


def check_sensitivity() -> None:
    """Check, before any computation, that SALib is there.

    Raises:
        InputError: it is not installed.
    """
    require("SALib", "sensitivity needs it and it is not there", "sensitivity")


def design(method: Method, names: Sequence[str], count: int, seed: int) -> Vector:
    """Return samples of the unit cube, (samples, names).

    count: trajectories of Morris, of which each takes len(names) + 1 samples; or base samples of
        Sobol, a power of 2, of which each takes len(names) + 2.

    Raises:
        InputError: SALib is not installed.
    """
    check_sensitivity()
    problem = _problem(names)
    if method == "morris":
        from SALib.sample import morris

        return np.asarray(morris.sample(problem, count, num_levels=LEVELS, seed=seed))
    from SALib.sample import sobol

    return np.asarray(sobol.sample(problem, count, calc_second_order=False, seed=seed))


def indices(
    method: Method, names: Sequence[str], samples: Vector, values: Mapping[str, Vector], seed: int
) -> list[Index]:
    """Return the weight of each number for each output, the largest first.

    samples: of `design`, (n, names); values: each output at the samples, (n,); seed: of the
    bootstrap.
    """
    result = []
    for output, value in values.items():
        rows = _indices(method, _problem(names), samples, np.asarray(value), seed)
        output_indices = [Index(name, output, *row) for name, row in zip(names, rows, strict=True)]
        result += sorted(
            output_indices, key=lambda index: -index.first if method == "morris" else -index.total
        )
    return result


def _indices(
    method: Method, problem: dict[str, Any], samples: Vector, values: Vector, seed: int
) -> list[tuple[float, float, float, float]]:
    """Return a row of numbers for each name; all 0 where the output is the same everywhere."""
    if np.ptp(values) == 0.0:
        return [(0.0, 0.0, 0.0, 0.0)] * problem["num_vars"]
    options = {"num_resamples": RESAMPLES, "conf_level": CONFIDENCE, "seed": seed}
    if method == "morris":
        from SALib.analyze import morris

        analysis = morris.analyze(problem, samples, values, num_levels=LEVELS, **options)
        columns = (
            analysis["mu_star"],
            analysis["mu_star_conf"],
            analysis["sigma"],
            [math.nan] * len(analysis["sigma"]),
        )
    else:
        from SALib.analyze import sobol

        analysis = sobol.analyze(problem, values, calc_second_order=False, **options)
        columns = analysis["S1"], analysis["S1_conf"], analysis["ST"], analysis["ST_conf"]
    return [tuple(float(value) for value in row) for row in zip(*columns, strict=True)]  # type: ignore[misc]


def _problem(names: Sequence[str]) -> dict[str, Any]:
    return {"num_vars": len(names), "names": list(names), "bounds": [[0.0, 1.0]] * len(names)}


@dataclass(frozen=True)
class Case:
    """A plan's cell, and what is kept from sample to sample."""

    plan: Plan  # with as many seeds in every sample
    scene: Scene
    cell: tuple[int, int, int]
    settings: tuple[tuple[Setting, float], ...]  # of the legs of the cell's phase
    height_m: float  # at which loads are compared
    nominal: Mapping[str, float]  # outputs of the plan itself

    @property
    def where(self) -> str:
        """Return the cell in words."""
        phase, period, heading = self.cell
        sea = self.plan.sea
        return (
            f"{self.plan.phases[phase].title}, Tp {sea.tp_s[period]:g} s, heading "
            f"{sea.headings_deg[heading]:g}°"
        )

    @property
    def names(self) -> list[str]:
        """Return the names of the uncertain numbers."""
        return [uncertainty.title for uncertainty in self.plan.uncertainties]


@dataclass(frozen=True)
class Sensitivity:
    """Weights of uncertain numbers."""

    case: Case
    method: Method
    samples: int
    capped: int  # samples whose limit is at the end of the grid
    indices: tuple[Index, ...]
    spread: Mapping[str, tuple[float, float, float]]  # P10, P50, P90 of each output


def lowest_cell(plan: Plan, scene: Scene) -> tuple[int, int, int]:
    """Return the cell with the lowest limit by the simplified method.

    Raises:
        RopeTwinError: a phase cannot be run.
    """
    works, store = prepare(plan, scene), RowStore()

    def use(cell: tuple[int, int, int]) -> tuple[int, float]:
        search = Cell(plan, works[cell[0]], cell, store)
        return search.simplified_limit(), search.simplified_use(0)

    return min(plan.grid, key=lambda cell: (use(cell)[0], -use(cell)[1]))


def case_of(plan: Plan, scene: Scene, cell: tuple[int, int, int]) -> Case:
    """Return a cell made ready: its settings, and the outputs of the plan itself.

    Raises:
        RopeTwinError: the plan has fewer than two uncertain numbers, or cannot be run.
    """
    if len(plan.uncertainties) < 2:
        remedy = "list two or more under `uncertainties`, with key, distribution and source"
        raise InputError(str(plan.path), f"{len(plan.uncertainties)} uncertain numbers", remedy)
    seeds = plan.method.seeds.start
    method = replace(plan.method, seeds=Seeds(start=seeds, most=seeds), height_within_m=None)
    single_plan = replace(plan, method=method)
    work = prepare(single_plan, scene)[cell[0]]
    settings = tuple((leg.setting, leg.setting_error) for leg in work.legs)
    search = Cell(single_plan, work, cell, RowStore())
    limit = search.find()
    assert limit.shown is not None
    height_m = limit.shown.height_m
    outputs = _outputs(search, search.heights_m.index(height_m))
    return Case(single_plan, scene, cell, settings, height_m, outputs)


def _outputs(search: Cell, height: int) -> dict[str, float]:
    """Return the outputs of a cell, loads at a height of the grid."""
    limit, judged = search.find(), search.judge(height)
    outputs = {LIMIT: limit.crossing_m, USE: judged.use if judged.uses else math.nan}
    outputs |= {name: judged.values[name].value for name in ("hook_load", "uplift")
                if name in judged.values}  # fmt: skip
    return outputs | {"capped": float(bool(limit.capped))}


def outputs_at(case: Case, values: Sequence[float]) -> dict[str, float]:
    """Return the outputs with these numbers in place of the plan's.

    Raises:
        RopeTwinError: plan or scene do not take them together.
    """
    plan, scene = with_values(case.plan, case.scene, case.plan.uncertainties, values)
    for keys, problem, remedy in faults(plan, scene):
        raise InputError(f"{plan.path}: {'.'.join(map(str, keys))}", problem, remedy)
    number = case.cell[0]
    legs = [
        leg.at_setting(*case.settings[min(k, len(case.settings) - 1)])
        for k, leg in enumerate(legs_of(plan, scene, plan.phases[number]))
    ]
    ship = Ship(tip_of(plan, scene), plan.bow_of(scene))
    search = Cell(plan, PhaseWork.of(plan, scene, number, legs, ship), case.cell, RowStore())
    return _outputs(search, search.heights_m.index(case.height_m))


class SampleFolder(RowFolder):
    """Folder of the samples of a sensitivity study."""

    title = "sensitivity study"


@dataclass(frozen=True)
class SampleTask:
    """One sample; the complete input of a worker."""

    case: Case
    number: int
    values: tuple[float, ...]


def run_sample(task: SampleTask) -> Row:
    """Return the row of a sample; `failure` says why it cannot be run."""
    try:
        result, failure = outputs_at(task.case, task.values), ""
    except RopeTwinError as error:
        result, failure = dict.fromkeys([*OUTPUTS, "capped"], math.nan), str(error)
    inputs = dict(zip(task.case.names, task.values, strict=True))
    outputs = {name: result.get(name, math.nan) for name in [*OUTPUTS, "capped"]}
    return {"run": task.number, **inputs, **outputs, "failure": failure}


def run_sensitivity(
    case: Case,
    method: Method,
    count: int,
    out: Path,
    report: Report = lambda done, total: None,
    threads: int | None = None,
    scheduler: str = "",
) -> Sensitivity:
    """Run the samples that have no row in the folder, and return the weights.

    count: trajectories or base samples. report: called after each sample. threads: samples at a
    time; None: as many as there are cores. scheduler: address of a Dask scheduler; empty: this
    machine's cores.

    Raises:
        RopeTwinError: a sample cannot be run, or there is no such scheduler; one sentence.
    """
    plan, seed = case.plan, case.plan.method.seed
    unit = design(method, case.names, count, seed)
    values = np.column_stack(
        [
            uncertainty.distribution.quantile(unit[:, k])
            for k, uncertainty in enumerate(plan.uncertainties)
        ]
    )
    tasks = [SampleTask(case, k, tuple(row)) for k, row in enumerate(values.tolist())]
    inputs = repr((plan_stamp(plan, case.scene), case.cell, method, count, plan.uncertainties))
    stamp = hashlib.sha256(inputs.encode()).hexdigest()[:16]
    with SampleFolder(out, plan.name, plan.scene, stamp) as folder:
        done = folder.done()
        left = [task for task in tasks if task.number not in done]
        report(len(done), len(tasks))
        for number, row in enumerate(spread(run_sample, left, scheduler, threads), 1):
            folder.add([row])
            report(len(done) + number, len(tasks))
        folder.close_rows()
        rows = folder.rows()
    return _result(case, method, unit, rows)


def _result(case: Case, method: Method, unit: Vector, rows: Sequence[Row]) -> Sensitivity:
    failed = [row for row in rows if row["failure"] or math.isnan(row[LIMIT])]
    if failed:
        why = failed[0]["failure"] or "it has no limit"
        problem = (
            f"{len(failed)} of {len(rows)} samples cannot be run, the first: {why.rstrip('.')}"
        )
        raise InputError(str(case.plan.path), problem, "narrow the distributions")
    columns = {name: np.array([row[name] for row in rows]) for name in OUTPUTS}
    complete = {name: column for name, column in columns.items() if np.isfinite(column).all()}
    ends = {
        name: tuple(float(value) for value in np.percentile(results, [10.0, 50.0, 90.0]))
        for name, results in complete.items()
    }
    return Sensitivity(
        case=case,
        method=method,
        samples=len(rows),
        capped=int(sum(row["capped"] for row in rows)),
        indices=tuple(indices(method, case.names, unit, complete, case.plan.method.seed)),
        spread=ends,  # type: ignore[arg-type]
    )


def table_rows(result: Sensitivity, output: str = LIMIT) -> list[list[str]]:
    """Return the weights for an output as rows of text below a head."""
    sources = {
        uncertainty.title: uncertainty.source for uncertainty in result.case.plan.uncertainties
    }
    head = ["uncertain", "μ*", "±", "σ", "source"]
    if result.method == "sobol":
        head = ["uncertain", "S1", "±", "ST", "±", "source"]
    rows, sobol = [], result.method == "sobol"
    scale = 1.0 if sobol else OUTPUTS[output].scale
    for index in result.indices:
        if index.output == output:
            numbers = [scale * index.first, scale * index.first_width, scale * index.total]
            numbers += [index.total_width] if sobol else []
            rows.append([index.name, *(f"{number:.3g}" for number in numbers), sources[index.name]])
    return [head, *rows]


def result_object(result: Sensitivity) -> dict[str, Any]:
    """Return everything as one object of plain values."""
    return {
        "plan": result.case.plan.name,
        "method": result.method,
        "cell": result.case.where,
        "hs_m": result.case.height_m,
        "samples": result.samples,
        "capped": result.capped,
        "nominal": {name: result.case.nominal.get(name) for name in OUTPUTS},
        "spread": {name: dict(zip(("p10", "p50", "p90"), percentiles, strict=True))
                   for name, percentiles in result.spread.items()},
        "indices": [_named(index, result.method) for index in result.indices],
    }  # fmt: skip


def _named(index: Index, method: str) -> dict[str, Any]:
    """Return a weight under the names of its method."""
    head: dict[str, Any] = {"name": index.name, "output": index.output}
    if method == "morris":
        effect = {"mean_effect": index.first, "mean_effect_width": index.first_width}
        return head | effect | {"effect_sd": index.total}
    first = {"first": index.first, "first_width": index.first_width}
    return head | first | {"total": index.total, "total_width": index.total_width}


def panels(result: Sensitivity) -> list[Panel]:
    """Return the picture: a panel for each output.

    Morris: σ over μ*, a point for each number. Sobol: S1 and ST of each number.
    """
    result_panels = []
    for output in result.spread:
        items = [index for index in result.indices if index.output == output]
        quantity = OUTPUTS[output]
        if result.method == "morris":
            items.sort(key=lambda item: result.case.names.index(item.name))  # one colour for each
            k = quantity.scale
            lines = [Line([k * item.first], [k * item.total], item.name, "o") for item in items]
            unit = f" [{quantity.unit}]" if quantity.unit else ""
            x_label = f"μ*: mean absolute effect{unit}"
            result_panels.append(Panel(quantity.words, x_label, f"σ{unit}", tuple(lines)))
        else:
            position = [float(k) for k in range(1, len(items) + 1)]
            names = "; ".join(f"{k} {item.name}" for k, item in enumerate(items, 1))
            pair = (Line(position, [item.first for item in items], "S1", "o"),
                    Line(position, [item.total for item in items], "ST", "s"))  # fmt: skip
            result_panels.append(Panel(quantity.words, names, "share of the variance", pair))
    return result_panels
