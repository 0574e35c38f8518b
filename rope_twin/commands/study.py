"""`rope_twin study STUDY.yaml`: many runs of a scene over seas, ropes and coefficients.

Exit code 0; 3 if some runs could not go on to the end (they are named); 1 with one sentence if the
study cannot be run. A study that was stopped or killed goes on by the same command.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rope_twin.core.jit.wide import LANES
from rope_twin.effects.bending import BendingParams
from rope_twin.errors import InputError, did_you_mean, phrase
from rope_twin.run.progress import FigureProgress
from rope_twin.share import share_dir
from rope_twin.studies.parameter_study.file import read_study
from rope_twin.studies.parameter_study.folder import check_parquet
from rope_twin.studies.parameter_study.picture import draw_study
from rope_twin.studies.parameter_study.run import run_parameter_study
from rope_twin.studies.parameter_study.table import study_lines
from rope_twin.studies.picture import check_picture
from rope_twin.twin.fatigue.endurance import other_than_wire

PICTURE = "study.png"
BAR = 24


@dataclass(frozen=True)
class _Line:
    """How far the study is."""

    done: int
    total: int
    before: int  # runs that an earlier start had done
    real_s: float

    def as_progress(self) -> str:
        bar = "#" * round(BAR * self.done / self.total)
        here = self.done - self.before
        left = f"{(self.total - self.done) * self.real_s / here:.0f} s to go" if here else ""
        return f"[{bar:<{BAR}}] {self.done} of {self.total} runs  {left}"


def add_parser(subparsers: argparse._SubParsersAction[Any]) -> None:
    """Declare the subcommand."""
    about = "many runs of a scene over seas, ropes and coefficients, by a file that says which"
    parser = subparsers.add_parser(
        "study",
        help=about,
        description="Grid or Latin hypercube, on all cores or on a Dask cluster; one row of a "
        "Parquet file for each run. What was stopped or killed goes on by the same command. "
        "Examples lie in config/studies.",
    )
    add = parser.add_argument
    add("study", metavar="STUDY.yaml", help="the study's file, or a name in config/studies")
    add("--into", type=Path, metavar="DIR",
        help="folder of rows and picture (default: study_NAME here)")  # fmt: skip
    add("--scheduler", default="", metavar="ADDRESS",
        help="of a Dask scheduler whose workers do the runs")  # fmt: skip
    add("--at-once", type=int, default=LANES, metavar="N",
        help=f"runs that a core is given together (default: {LANES}, which share its vectors)")  # fmt: skip # noqa: E501
    add("--json", action="store_true", help="one JSON object with all rows instead of the table")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Run what is left of the study and tell what came out.

    Raises:
        RopeTwinError: one sentence on what cannot be.
    """
    if not 1 <= args.at_once <= 1000:
        raise InputError(phrase("--at-once", f"{args.at_once} runs", "give 1 to 1000"))
    study, scene = read_study(_file(args.study))
    into = args.into or Path(f"study_{study.name}")
    check_parquet()
    check_picture(into / PICTURE)
    if study.fatigue is not None:
        bending = scene.listed(BendingParams)
        EI = bending.stiffness_n_m2 if bending is not None else 0.0
        if words := other_than_wire(scene.ropes[0], study.fatigue.curve, EI):
            print(words, file=sys.stderr)
    progress, began, before = FigureProgress(), time.monotonic(), [-1]

    def report(done: int, total: int) -> None:
        if before[0] < 0:
            before[0] = done
        if progress.due or done == total:
            progress.show(_Line(done, total, before[0], time.monotonic() - began))

    rows, whole = run_parameter_study(study, scene, into, report, args.scheduler, args.at_once)
    progress.finish()
    draw_study(study, rows, into / PICTURE)
    if args.json:
        print(json.dumps({"study": study.name, "rows": rows}, ensure_ascii=False, allow_nan=False))
    else:
        print("\n".join(study_lines(study, rows)))
        print(f"\nrows: {whole}\npicture: {into / PICTURE}", file=sys.stderr)
    failed = sum(bool(row["failure"]) for row in rows)
    return 1 if failed == len(rows) else 3 if failed else 0


def _file(words: str) -> Path:
    """A path, or a name in config/studies."""
    path = Path(words)
    if len(path.parts) > 1 or path.suffix in (".yaml", ".yml"):
        return path
    folder = share_dir() / "config" / "studies"
    known = [file.stem for file in folder.glob("*.yaml")]
    if words not in known:
        if words and path.exists():
            return path
        right = f"{did_you_mean(words, known)} (or give the path of a YAML file)"
        raise InputError(phrase(f"study '{words}'", "there is no such study", right))
    return folder / f"{words}.yaml"
