"""`rope_twin study STUDY`: many runs of a scene over seas, ropes and coefficients.

Exit code NEGATIVE if some runs stopped early (they are listed), ERROR if all did. The same command
resumes a study that was interrupted.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

from rope_twin.cli import ExitCode, print_json
from rope_twin.core.jit.wide import LANES
from rope_twin.effects.bending import BendingParams
from rope_twin.errors import InputError
from rope_twin.files import shipped_file
from rope_twin.run.arguments import add_json, add_out
from rope_twin.run.progress import FigureProgress
from rope_twin.studies.picture import check_picture
from rope_twin.studies.study_design import read_study
from rope_twin.studies.study_results import draw_study, study_lines
from rope_twin.studies.study_run import check_parquet, run_parameter_study
from rope_twin.vortex.fatigue import wire_curve_warning

PICTURE = "study.png"
BAR = 24
EXAMPLES = (
    "study sea_and_load",
    "study my_study.yaml --out results --json",
)
MORE = """Grid or Latin hypercube, on all cores or on a Dask cluster; one row of a Parquet file for
each run. The same command resumes a study that was interrupted. Examples are in config/studies."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("study", metavar="STUDY", help="path of the study file, or a name in config/studies")
    add_out(parser, "DIR", "folder of results and picture (default: study_NAME)")
    add("--scheduler", default="", metavar="ADDRESS", help="Dask scheduler whose workers run it")
    add("--batch-size", type=int, default=LANES, metavar="N",
        help=f"runs that a core steps together (default: {LANES}, one SIMD batch)")  # fmt: skip
    add_json(parser)


def run(args: argparse.Namespace) -> int:
    """Run the remaining runs of the study and report the results.

    Raises:
        RopeTwinError: one sentence on what cannot be.
    """
    if not 1 <= args.batch_size <= 1000:
        raise InputError("--batch-size", f"{args.batch_size} runs", "give 1 to 1000")
    study, scene = read_study(shipped_file(args.study, "studies", "study"))
    out = args.out or Path(f"study_{study.name}")
    check_parquet()
    check_picture(out / PICTURE)
    if study.fatigue is not None:
        for line in scene.ropes:
            bending = line.bending or scene.listed(BendingParams)
            EI = bending.stiffness_n_m2 if bending is not None else 0.0
            if words := wire_curve_warning(line, study.fatigue.curve, EI):
                print(words, file=sys.stderr)
    progress, began, before = FigureProgress(), time.monotonic(), [-1]

    def report(done: int, total: int) -> None:
        if before[0] < 0:
            before[0] = done
        if progress.due or done == total:
            bar, here = "#" * round(BAR * done / total), done - before[0]
            to_go_s = (total - done) * (time.monotonic() - began) / here if here else 0.0
            left = f"{to_go_s:.0f} s to go" if here else ""
            progress.show(f"[{bar:<{BAR}}] {done} of {total} runs  {left}")

    rows, whole = run_parameter_study(study, scene, out, report, args.scheduler, args.batch_size)
    progress.finish()
    draw_study(study, rows, out / PICTURE)
    if args.json:
        print_json({"study": study.name, "rows": rows})
    else:
        print("\n".join(study_lines(study, rows)))
        print(f"\nrows: {whole}\npicture: {out / PICTURE}", file=sys.stderr)
    failed = sum(bool(row["failure"]) for row in rows)
    if failed == len(rows):
        return ExitCode.ERROR
    return ExitCode.NEGATIVE if failed else ExitCode.OK
