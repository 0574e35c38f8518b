"""Commands on lift plans: `plan` and `sensitivity`."""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

from rope_twin.cli import Command, ExitCode, print_json, print_table
from rope_twin.cli.selection import read_share
from rope_twin.errors import InputError
from rope_twin.files import shipped_file
from rope_twin.planning.cells import Cell
from rope_twin.planning.dataset import check_netcdf, write_netcdf
from rope_twin.planning.pictures import limits_figure, show_cell
from rope_twin.planning.plan_file import Plan
from rope_twin.planning.plan_reader import read_plan, with_error
from rope_twin.planning.results import (
    notes,
    plan_notes,
    result_object,
    summary_lines,
    table_rows,
    write_results,
)
from rope_twin.planning.run import (
    PlanFolder,
    cell_named,
    find_within,
    plan_stamp,
    prepare,
    run_plan,
)
from rope_twin.planning.tables import further_tables
from rope_twin.run.options import add_json, add_out
from rope_twin.run.progress import FigureProgress
from rope_twin.scene.schema import Scene
from rope_twin.studies.picture import check_picture, draw_panels, write_picture
from rope_twin.studies.study_run import check_parquet

if TYPE_CHECKING:
    from rope_twin.planning.sensitivity import Sensitivity

PLAN_PICTURE, NETCDF = "limits.png", "plan.nc"
EXAMPLE_PLAN = "deep_installation"
PLAN_EXAMPLES = (
    "plan deep_installation",
    "plan my_plan.yaml --out results --report",
    "plan deep_installation --cell at_depth,9,135",
    "plan --example > my_plan.yaml",
)
PLAN_MORE = """For each phase of the operation, peak period and heading: the largest Hs at which the
characteristic hook load, uplift and landing speed keep their limits, by bisection over batches of
seeds, with intervals, discretisation errors and the simplified method of DNV-RP-N103 beside it. The
same command resumes a plan that was interrupted. Examples are in config/plans."""


def _add_plan(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("plan", metavar="PLAN", nargs="?", default="",
        help="path of the plan file, or a name in config/plans")  # fmt: skip
    add("--example", action="store_true", help="print a plan to begin from")
    add_out(parser, "DIR", "folder of rows, load chart and pictures (default: plan_NAME)")
    add(
        "--report",
        action="store_true",
        help="write report.html and report.pdf: inputs, limits, governing runs, errors",
    )
    add("--netcdf", action="store_true",
        help="write plan.nc: limits with named axes and a row for each run")  # fmt: skip
    help_text = (
        "discretisation error of each cell, over its loads, such as 1%% (default: the plan's)"
    )
    add("--within", metavar="ERROR", help=help_text)
    add("--threads", type=int, metavar="N", help="cells at a time (default: one a core)")
    add("--scheduler", default="", metavar="ADDRESS", help="Dask scheduler whose workers run it")
    add("--cell", default="", metavar="PHASE,TP,HEADING",
        help="run the governing run of one cell again, and draw it")  # fmt: skip
    add_json(parser)


def _run_plan(args: argparse.Namespace) -> int:
    """Run what is left of the plan and report the limits. Raises RopeTwinError."""
    if args.example:
        print(shipped_file(EXAMPLE_PLAN, "plans", "plan").read_text(encoding="utf-8"), end="")
        return ExitCode.OK
    if not args.plan:
        raise InputError("plan", "no plan is named", "give a file, or begin with --example")
    if args.threads is not None and not 1 <= args.threads <= 256:
        raise InputError("--threads", f"{args.threads}", "give 1 to 256")
    plan, scene = read_plan(args.plan)
    if args.within is not None:
        plan = with_error(plan, read_share("--within", args.within, "the error"))
    folder_path = args.out or Path(f"plan_{plan.name}")
    check_parquet()
    check_picture(folder_path / PLAN_PICTURE)
    if args.netcdf:
        check_netcdf()
    if args.report:
        from rope_twin.planning.report import check_report  # runs and draws more
        from rope_twin.planning.report_content import write_report

        check_report()
    if args.cell:
        return _show_cell(args, plan, scene, folder_path)
    for note in plan_notes(plan):
        print(f"warning: {note}", file=sys.stderr)
    reports: list[Path] = []
    progress, began = FigureProgress(), time.monotonic()

    def report(done: int, total: int, runs: int) -> None:
        if progress.due or done == total:
            took = time.monotonic() - began
            remaining = f", {took * (total - done) / done:.0f} s to go" if done else ""
            progress.show(f"{done} of {total} cells, {runs} runs{remaining}")

    with PlanFolder(folder_path, plan, plan_stamp(plan, scene)) as folder:
        result = run_plan(plan, scene, folder.store, report, args.threads, args.scheduler)
        rows = folder.close_rows()
        if args.report:
            reports = write_report(result, folder_path)
    progress.finish()
    write_results(result, folder_path)
    write_picture(limits_figure(result), folder_path / PLAN_PICTURE, 110)
    if args.netcdf:
        write_netcdf(result, folder_path / NETCDF)
    if args.json:
        print_json(result_object(result))
    else:
        print_table(table_rows(result))
        for table in further_tables(result):
            print(f"\n{table.title}")
            print_table(table.rows)
            print(table.about)
        print("\n" + "\n".join([*summary_lines(result), *notes(result)]))
        files = [rows, folder_path / "load_chart.json", folder_path / PLAN_PICTURE, *reports]
        files += [folder_path / NETCDF] if args.netcdf else []
        print("\n".join(f"wrote {path}" for path in files), file=sys.stderr)
    none = any(cell.height_m is None for cell in result.cells)
    return ExitCode.NEGATIVE if none else ExitCode.OK


def _show_cell(args: argparse.Namespace, plan: Plan, scene: Scene, folder_path: Path) -> int:
    """Run the governing run of a cell again, and draw it."""
    cell = cell_named(plan, args.cell)
    with PlanFolder(folder_path, plan, plan_stamp(plan, scene)) as folder:
        work = prepare(plan, scene, folder.store)[cell[0]]
        cell_figures = show_cell(*find_within(Cell(plan, work, cell, folder.store)), folder_path)
    if args.json:
        print_json(cell_figures)
    else:
        for name, value in cell_figures.items():
            print(f"{name}: {value}")
    return ExitCode.OK


SENSITIVITY_PICTURE = "sensitivity.png"
COUNTS = {"morris": 10, "sobol": 64}
SENSITIVITY_EXAMPLES = (
    "sensitivity deep_installation",
    "sensitivity my_plan.yaml --method sobol --count 128 --cell at_depth,9,180",
)
SENSITIVITY_MORE = """\
Runs one cell of a plan with the numbers that its `uncertainties` list (key, distribution,
source) drawn from their distributions, and shows which of them the limiting Hs and the loads depend
on. Morris screens many numbers with few samples, Sobol shares out the variance. All samples have
the same seas. The same command resumes a study that was interrupted."""


def _add_sensitivity(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("plan", metavar="PLAN", help="path of the plan file, or a name in config/plans")
    add("--method", choices=tuple(COUNTS), default="morris", help="default: morris")
    help_text = "trajectories of Morris (default: 10), or base samples of Sobol (default: 64)"
    add("--count", type=int, metavar="N", help=help_text)
    help_text = "the cell (default: that with the lowest limit by the simplified method)"
    add("--cell", default="", metavar="PHASE,TP,HEADING", help=help_text)
    add_out(parser, "DIR", "folder of rows and picture (default: sensitivity_NAME)")
    add("--threads", type=int, metavar="N", help="samples at a time (default: one a core)")
    add("--scheduler", default="", metavar="ADDRESS", help="Dask scheduler whose workers run it")
    add_json(parser)


def _run_sensitivity(args: argparse.Namespace) -> int:
    """Run what is left of the samples and print the weights. Raises RopeTwinError."""
    from rope_twin.planning.sensitivity import (  # on the way to help nothing of it is needed
        case_of,
        check_sensitivity,
        lowest_cell,
        panels,
        result_object,
        run_sensitivity,
    )

    check_sensitivity()
    if args.threads is not None and not 1 <= args.threads <= 256:
        raise InputError("--threads", f"{args.threads}", "give 1 to 256")
    count = COUNTS[args.method] if args.count is None else args.count
    if not 2 <= count <= 100_000:
        raise InputError("--count", f"{count}", "give 2 to 100,000")
    if args.method == "sobol" and count & (count - 1):
        raise InputError("--count", f"{count}", "give a power of 2 for Sobol's sequence")
    plan, scene = read_plan(args.plan)
    folder = args.out or Path(f"sensitivity_{plan.name}")
    check_picture(folder / SENSITIVITY_PICTURE)
    cell = cell_named(plan, args.cell) if args.cell else lowest_cell(plan, scene)
    case = case_of(plan, scene, cell)
    progress = FigureProgress()

    def report(done: int, total: int) -> None:
        if progress.due or done == total:
            progress.show(f"{done} of {total} samples")

    result = run_sensitivity(case, args.method, count, folder, report, args.threads, args.scheduler)
    progress.finish()
    draw_panels(f"{plan.name}: {case.where}", panels(result), folder / SENSITIVITY_PICTURE)
    if args.json:
        print_json(result_object(result))
    else:
        _show_sensitivity(result)
        print(f"wrote {folder / SENSITIVITY_PICTURE}", file=sys.stderr)
    return ExitCode.OK


def _show_sensitivity(result: Sensitivity) -> None:
    from rope_twin.planning.sensitivity import OUTPUTS, table_rows

    print(f"{result.case.where}; loads at Hs {result.case.height_m:g} m; {result.samples} samples")
    if result.capped:
        print(
            f"warning: in {result.capped} of them the limit is at the end of the grid, which hides "
            "what lies beyond; raise sea.hs_m.to or compare the loads"
        )
    if result.method == "morris":
        print(
            "percentiles are those of the samples, of which Morris takes the ends of a "
            "distribution as often as its middle; for those of the data use --method sobol"
        )
    for output, (low, middle, high) in result.spread.items():
        quantity = OUTPUTS[output]
        values = (result.case.nominal[output], low, middle, high)
        plan, *shares = (
            f"{quantity.scale * value:.4g} {quantity.unit}".strip() for value in values
        )
        words = "{}: {} by the plan; of the samples P10 {}, P50 {}, P90 {}"
        print("\n" + words.format(quantity.words, plan, *shares))
        print_table(table_rows(result, output))


COMMANDS = {
    "plan": Command(_add_plan, _run_plan, PLAN_EXAMPLES, PLAN_MORE),
    "sensitivity": Command(
        _add_sensitivity, _run_sensitivity, SENSITIVITY_EXAMPLES, SENSITIVITY_MORE
    ),
}
