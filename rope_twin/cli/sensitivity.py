"""`rope_twin sensitivity PLAN.yaml`: which uncertain data of a plan is worth measuring."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from rope_twin.cli import ExitCode, print_json, print_table
from rope_twin.errors import InputError
from rope_twin.planning.plan_reader import read_plan
from rope_twin.planning.run import cell_named
from rope_twin.run.options import add_json, add_out
from rope_twin.run.progress import FigureProgress
from rope_twin.studies.picture import check_picture, draw_panels

if TYPE_CHECKING:
    from rope_twin.planning.sensitivity import Sensitivity

PICTURE = "sensitivity.png"
COUNTS = {"morris": 10, "sobol": 64}
EXAMPLES = (
    "sensitivity deep_installation",
    "sensitivity my_plan.yaml --method sobol --count 128 --cell at_depth,9,180",
)
MORE = """Runs one cell of a plan with the numbers that its `uncertainties` list (key, distribution,
source) drawn from their distributions, and shows which of them the limiting Hs and the loads depend
on. Morris screens many numbers with few samples, Sobol shares out the variance. All samples have
the same seas. The same command resumes a study that was interrupted."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
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


def run(args: argparse.Namespace) -> int:
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
    check_picture(folder / PICTURE)
    cell = cell_named(plan, args.cell) if args.cell else lowest_cell(plan, scene)
    case = case_of(plan, scene, cell)
    progress = FigureProgress()

    def report(done: int, total: int) -> None:
        if progress.due or done == total:
            progress.show(f"{done} of {total} samples")

    result = run_sensitivity(case, args.method, count, folder, report, args.threads, args.scheduler)
    progress.finish()
    draw_panels(f"{plan.name}: {case.where}", panels(result), folder / PICTURE)
    if args.json:
        print_json(result_object(result))
    else:
        _show(result)
        print(f"wrote {folder / PICTURE}", file=sys.stderr)
    return ExitCode.OK


def _show(result: Sensitivity) -> None:
    from rope_twin.planning.sensitivity import OUTPUTS, table_rows

    print(f"{result.case.where}; loads at Hs {result.case.height_m:g} m; {result.samples} samples")
    if result.capped:
        print(
            f"warning: in {result.capped} of them the limit is at the end of the grid, which hides "
            "what lies beyond; raise sea.hs_m.to or compare the loads"
        )
    for output, (low, middle, high) in result.spread.items():
        quantity = OUTPUTS[output]
        values = (result.case.nominal[output], low, middle, high)
        plan, *shares = (
            f"{quantity.scale * value:.4g} {quantity.unit}".strip() for value in values
        )
        print("\n{}: {} by the plan; P10 {}, P50 {}, P90 {}".format(quantity.words, plan, *shares))
        print_table(table_rows(result, output))
