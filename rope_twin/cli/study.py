"""`rope_twin study STUDY`: many runs of a scene over seas, ropes and coefficients.

Exit code NEGATIVE if some runs stopped early (they are listed), ERROR if all did. The same command
resumes a study that was interrupted.
"""

from __future__ import annotations

import argparse
import math
import re
import sys
import time
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from rope_twin.cli import ExitCode, print_json
from rope_twin.core.jit.wide import LANES
from rope_twin.effects.bending import BendingParams
from rope_twin.errors import InputError
from rope_twin.files import shipped_file
from rope_twin.run.options import add_json, add_out
from rope_twin.run.progress import FigureProgress
from rope_twin.studies.ensemble import QUANTILES
from rope_twin.studies.picture import check_picture, write_picture
from rope_twin.studies.study_design import Row, Study, Variable, read_study
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
    folder = args.out or Path(f"study_{study.name}")
    check_parquet()
    check_picture(folder / PICTURE)
    if study.fatigue is not None:
        for line in scene.ropes:
            bending = line.bending or scene.listed(BendingParams)
            EI = bending.stiffness_n_m2 if bending is not None else 0.0
            if warning := wire_curve_warning(line, study.fatigue.curve, EI):
                print(warning, file=sys.stderr)
    progress, began, before = FigureProgress(), time.monotonic(), [-1]

    def report(done: int, total: int) -> None:
        if before[0] < 0:
            before[0] = done
        if progress.due or done == total:
            bar, finished = "#" * round(BAR * done / total), done - before[0]
            to_go_s = (total - done) * (time.monotonic() - began) / finished if finished else 0.0
            remaining = f"{to_go_s:.0f} s to go" if finished else ""
            progress.show(f"[{bar:<{BAR}}] {done} of {total} runs  {remaining}")

    rows, rows_file = run_parameter_study(
        study, scene, folder, report, args.scheduler, args.batch_size
    )
    progress.finish()
    draw_study(study, rows, folder / PICTURE)
    if args.json:
        print_json({"study": study.name, "rows": rows})
    else:
        print("\n".join(study_lines(study, rows)))
        print(f"\nrows: {rows_file}\npicture: {folder / PICTURE}", file=sys.stderr)
    failed = sum(bool(row["failure"]) for row in rows)
    if failed == len(rows):
        return ExitCode.ERROR
    return ExitCode.NEGATIVE if failed else ExitCode.OK


FIGURES = (  # column of the rows, words, scale
    ("tension_top_max_n", "highest top tension [kN]", 1e-3),
    ("tension_top_mean_n", "mean top tension [kN]", 1e-3),
    ("tension_top_min_n", "lowest top tension [kN]", 1e-3),
    ("slack_share", "slack somewhere [% of time]", 100.0),
    ("highest_over_breaking_load", "highest over breaking load [%]", 100.0),
    ("damage_worst", "damage of the worst piece [1e-9]", 1e9),
)
PARTS = 4  # of a variable's range, where every run has a number of its own
MANY = 8  # different numbers; more are stated by parts of the range


def whole_runs(rows: Sequence[Row]) -> list[Row]:
    """Return the completed runs."""
    return [row for row in rows if not row["failure"]]


def study_lines(study: Study, rows: Sequence[Row]) -> Iterator[str]:
    """Return the lines of the table."""
    good = whole_runs(rows)
    yield f"{study.name}: {len(rows)} runs of {study.seconds:g} s of {study.scene}"
    failed = [row for row in rows if row["failure"]]
    for row in failed[:5]:
        yield f"run {row['run']} stopped early: {row['failure']}"
    if len(failed) > 5:
        yield f"and {len(failed) - 5} more"
    if not good:
        return
    yield ""
    heads = ["least", *(f"{100 * part:g} %" for part in QUANTILES[1:-1]), "largest"]
    known = [*_stored_figures(good), *_by_rope(good)]
    width = max(len(label) for _, label, _ in known)
    yield " " * width + "".join(f"{head:>10}" for head in heads)
    for column, label, scale in known:
        numbers = np.quantile([scale * row[column] for row in good], QUANTILES)
        yield f"{label:{width}}" + "".join(f"{number:10.4g}" for number in numbers)
    for variable in study.vary:
        yield ""
        yield from _effect_of(variable, good)


def _stored_figures(rows: Sequence[Row]) -> list[tuple[str, str, float]]:
    return [figure for figure in FIGURES if figure[0] in rows[0]]


def _by_rope(rows: Sequence[Row]) -> list[tuple[str, str, float]]:
    """Return the highest tension of each rope of a multi-line scene."""
    end = ".tension_max_n"
    names = (column.removesuffix(end) for column in rows[0] if column.endswith(end))
    return [(name + end, f"highest tension of {name} [kN]", 1e-3) for name in names]


def _effect_of(variable: Variable, rows: Sequence[Row]) -> Iterator[str]:
    """Return a line for each value of a variable, or for each part of its range."""
    yield f"{variable.column}: median over the runs{_ranks(variable, rows)}"
    known = _stored_figures(rows)
    yield " " * 24 + "".join(f"{label.split(' [')[0]:>32}" for _, label, _ in known[:3])
    for label, some in _levels(variable, rows):
        cells = "".join(
            f"{np.median([scale * row[column] for row in some]):32.4g}"
            for column, _, scale in known[:3]
        )
        yield f"{label:>18} {len(some):5d}{cells}"


def _levels(variable: Variable, rows: Sequence[Row]) -> list[tuple[str, list[Row]]]:
    values: list[Any] = list(dict.fromkeys(row[variable.column] for row in rows))
    if variable.names or variable.cases:
        return [(str(v), [row for row in rows if row[variable.column] == v]) for v in values]
    if len(values) <= MANY:
        values.sort()
        return [(f"{v:.6g}", [row for row in rows if row[variable.column] == v]) for v in values]
    borders = np.quantile([row[variable.column] for row in rows], np.linspace(0.0, 1.0, PARTS + 1))
    groups = []
    for low, high in pairwise(borders):
        last = high == borders[-1]
        inside = [row for row in rows if low <= row[variable.column] <= high]
        some = [row for row in inside if last or row[variable.column] < high]
        groups.append((f"{low:.4g}..{high:.4g}", some))
    return [(label, some) for label, some in groups if some]


def _ranks(variable: Variable, rows: Sequence[Row]) -> str:
    """Return the rank correlation with the maximum tension; for numbers only."""
    values = [row[variable.column] for row in rows]
    if variable.names or variable.cases or len(set(values)) < 3:
        return ""
    highest = [row["tension_top_max_n"] for row in rows]
    if len(set(highest)) < 2:
        return ""
    from scipy.stats import spearmanr  # a second to load, and only studies want it

    rank = float(spearmanr(values, highest).statistic)
    return f"; rank correlation with the highest tension {rank:+.2f}"


ACROSS = 4  # panels beside each other
PANELS_MOST = 32
HIGH, LOW = "#d55e00", "#0072b2"
DAMAGE = re.compile(r"(.*\.)?damage")  # columns of damage along a rope


def draw_study(study: Study, rows: Sequence[Row], path: Path) -> None:
    """Draw a panel for each variable, and one for the damage along each rope if it was counted.

    Raises:
        InputError: it cannot be drawn or written.
    """
    check_picture(path)
    from matplotlib.figure import Figure

    good = whole_runs(rows)
    shown = study.vary[:PANELS_MOST]
    damaged = [column for column in (good[0] if good else ()) if DAMAGE.fullmatch(column)]
    panels = len(shown) + len(damaged)
    columns = min(ACROSS, panels)
    lines = math.ceil(panels / columns)
    figure = Figure(figsize=(4.0 * columns, 3.2 * lines + 0.5), layout="constrained")
    axes: list[Any] = figure.subplots(lines, columns, squeeze=False).ravel().tolist()
    for panel, variable in zip(axes, shown, strict=False):
        _draw(panel, variable, good)
    for panel, column in zip(axes[len(shown) :], damaged, strict=False):
        _draw_damage(panel, good, column)
    for panel in axes[panels:]:
        panel.set_axis_off()
    axes[0].set_ylabel("top tension [kN]")
    more = len(study.vary) - len(shown)
    left_out = f"; {more} variables more" if more else ""
    figure.suptitle(f"{study.name}: {len(good)} runs of {study.seconds:g} s{left_out}")
    write_picture(figure, path, 110)


def _draw(axes: Any, variable: Variable, rows: Sequence[Row]) -> None:
    values = [row[variable.column] for row in rows]
    if variable.names or variable.cases:
        labels = list(dict.fromkeys(values))
        values = [labels.index(value) for value in values]
        axes.set_xticks(range(len(labels)), labels, rotation=20)
    for column, colour, label in (("tension_top_max_n", HIGH, "highest"),
                                  ("tension_top_min_n", LOW, "lowest")):  # fmt: skip
        tension = [1e-3 * row[column] for row in rows]
        axes.plot(values, tension, ".", color=colour, alpha=0.6, label=label)
    axes.set_xlabel(variable.column)
    axes.legend(fontsize="small")
    axes.grid(True, linewidth=0.3)


def _draw_damage(axes: Any, rows: Sequence[Row], column: str) -> None:
    """Draw range and median of a rope's damage over the runs, from the lower end up."""
    length = min(len(row[column]) for row in rows)
    damage = np.array([row[column][:length] for row in rows])
    place = rows[0][f"{column}_from_lower_end_m"][:length]
    axes.fill_betweenx(place, damage.min(axis=0), damage.max(axis=0), color=HIGH, alpha=0.3)
    axes.plot(np.median(damage, axis=0), place, color=HIGH)
    name = column.rpartition(".")[0]
    axes.set_xlabel(f"damage of {name} in a run" if name else "damage of a run")
    axes.set_ylabel("from the lower end [m]")
    axes.grid(True, linewidth=0.3)
