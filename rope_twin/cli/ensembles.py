"""Commands that run a scene many times: `ensemble` and `study`."""

from __future__ import annotations

import argparse
import csv
import math
import os
import re
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import asdict
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from rope_twin.cli import Command, ExitCode, print_json
from rope_twin.core.jit.wide import LANES
from rope_twin.effects.bending import BendingParams
from rope_twin.errors import InputError
from rope_twin.files import shipped_file
from rope_twin.quantity import json_value, read_quantity
from rope_twin.run.options import add_duration, add_json, add_out, add_scene, add_time
from rope_twin.run.progress import FigureProgress
from rope_twin.scene.load import load_scene
from rope_twin.scene.schema import Scene
from rope_twin.studies.driven_twin import variant
from rope_twin.studies.ensemble import (
    FIGURES,
    QUANTILES,
    StudyResult,
    make_plan,
    read_axis,
    read_range,
    run_study,
)
from rope_twin.studies.picture import check_picture, new_figure, write_picture
from rope_twin.studies.study_design import SEA_OFFSET_S, Row, Study, Variable, read_study
from rope_twin.studies.study_run import check_parquet, run_parameter_study
from rope_twin.twin.ensemble.ensemble import SAMPLING_S, Lanes, cores
from rope_twin.vortex.fatigue import wire_curve_warning

NAMES = {
    "tension_top_max_n": "maximum top tension [kN]",
    "tension_top_mean_n": "mean top tension [kN]",
    "tension_top_min_n": "minimum top tension [kN]",
    "slack_share": "slack line [% of time]",
}
SCALES = {name: 100.0 if name == "slack_share" else 1e-3 for name in FIGURES}
FAILURES_SHOWN = 5
ENSEMBLE_EXAMPLES = (
    "ensemble deep_lift --vary 'payloads[0].mass_kg=18000..22000' --members 200",
    "ensemble deep_lift --sea-offset 0..10min --duration 5min --out members.csv",
    "ensemble deep_lift --vary 'effects.drag.normal=1.0,1.2,1.6' --json",
)
ENSEMBLE_MORE = """\
A KEY is that of the scene's file, effects by name (effects.drag.normal), [*] for every
entry of a list. NUMBERS are LOW..HIGH (drawn at random), or LOW..HIGH:COUNT or A,B,C (a grid, with
`--members` members at each of its points)."""


def _add_ensemble(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add_scene(parser)
    add(
        "--vary",
        action="append",
        default=[],
        metavar="KEY=NUMBERS",
        help="a key of the scene that varies; KEY*=NUMBERS multiplies it; may be repeated",
    )
    add("--sea-offset", metavar="NUMBERS", help="start each member this far into the scene's sea")
    add(
        "--members",
        type=int,
        metavar="N",
        help="members, at each point of the grid if there is one (default: 100; grid only: 1)",
    )
    add("--seed", type=int, default=1, metavar="N", help="random seed (default: 1)")
    add_duration(parser, "simulated time of each member", 60.0)
    add_time(parser, "--time-step", "time step (default: the scene's)")
    add_time(parser, "--slack-interval", "sampling interval for slack detection", SAMPLING_S)
    add("--jobs", type=int, default=cores(), metavar="N",
        help="threads that step members in parallel (default: %(default)s)")  # fmt: skip
    add_out(parser, "FILE", "write a CSV file with a row for each member")
    add_json(parser)


def _run_ensemble(args: argparse.Namespace) -> int:
    """Run the members and report the results. Raises RopeTwinError."""
    scene = load_scene(args.scene)
    if args.time_step is not None:
        if not 1e-5 <= args.time_step <= 0.2:
            problem = f"{args.time_step:g} s is not possible"
            raise InputError("--time-step", problem, "give 1e-05 to 0.2 s")
        scene = variant(scene, step_s=args.time_step)
    _check_options(args)
    axes = [read_axis("--vary", option) for option in args.vary]
    if args.sea_offset is not None:
        axes.append(read_range("--sea-offset", SEA_OFFSET_S, _seconds(args.sea_offset)))
    plan = make_plan(axes, args.members, args.seed)
    progress = FigureProgress()

    def report(time_s: float, real_s: float) -> None:
        if progress.due:
            progress.show(_progress_words(len(plan.rows), time_s, args.duration, real_s))

    result = run_study(scene, plan, args.duration, args.slack_interval, report, args.jobs)
    progress.finish()
    if args.out is not None:
        _write_csv(args.out, result)
    if args.json:
        print_json(_ensemble_figures(scene, result))
    else:
        print(_ensemble_text(scene, result))
    for sentence in _failure_lines(result):
        print(sentence, file=sys.stderr)
    if result.failed == len(result.figures):
        return ExitCode.ERROR
    return ExitCode.NEGATIVE if result.failed else ExitCode.OK


def _progress_words(members: int, time_s: float, duration_s: float, real_s: float) -> str:
    if real_s == 0.0:
        return f"{members} members are in static equilibrium"
    factor = time_s / real_s
    return (
        f"{time_s:8.1f} of {duration_s:g} s  {members} members  {factor:.2f} × real time  "
        f"{(duration_s - time_s) / factor:.0f} s to go"
    )


def _seconds(numbers: str) -> str:
    """Return LOW..HIGH, LOW..HIGH:COUNT or A,B,C without units; `read_range` judges the rest."""
    values, colon, count = numbers.partition(":")
    parts = re.split(r"(\.\.|,)", values)
    for number, part in enumerate(parts):
        with suppress(ValueError):
            parts[number] = f"{read_quantity(part, 's'):.15g}"
    return "".join(parts) + colon + count


def _check_options(args: argparse.Namespace) -> None:
    """Refuse what would fail only after a long run."""
    if not 0.0 < args.duration <= 1e6:
        problem = f"{args.duration:g} s is not possible"
        raise InputError("--duration", problem, "give a time above 0 s, at most 1e6 s")
    if args.seed < 0:
        raise InputError("--seed", f"{args.seed} is negative", "give 0 or more")
    if args.jobs < 1:
        raise InputError("--jobs", f"{args.jobs} threads", "give 1 or more")
    if args.out is None:
        return
    folder = args.out.resolve().parent
    if not folder.is_dir():
        raise InputError("--out", f"there is no folder {folder}", "create it first")
    if args.out.is_dir() or not os.access(folder, os.W_OK):
        raise InputError("--out", f"{args.out} cannot be written", "choose another file")


def _member_rows(result: StudyResult) -> list[dict[str, Any]]:
    """Return a row for each member: its number, its own parameters and its results."""
    rows = []
    for number, (values, figures) in enumerate(zip(result.plan.rows, result.figures, strict=True)):
        member_values = {
            axis.column: value for axis, value in zip(result.plan.axes, values, strict=True)
        }
        rows.append({"member": number, **member_values, **json_value(asdict(figures))})
    return rows


def _write_csv(path: Path, result: StudyResult) -> None:
    rows = _member_rows(result)
    try:
        with path.open("w", encoding="utf-8", newline="") as file:
            table = csv.DictWriter(file, list(rows[0]))
            table.writeheader()
            table.writerows(rows)
    except OSError as error:
        problem = f"{path} cannot be written ({error.strerror})"
        raise InputError("--out", problem, "choose another file") from error


def _ensemble_figures(scene: Scene, result: StudyResult) -> dict[str, Any]:
    return {
        "scene": scene.name,
        "members": len(result.figures),
        "failed": result.failed,
        "overloaded": result.overloaded,
        "varied": [str(axis) for axis in result.plan.axes],
        "seed": result.plan.seed,
        "time_s": result.time_s,
        "step_s": result.step_s,
        "elements": scene.ropes[0].elements,
        "threads": result.threads,
        "in_lanes": result.lanes.members,
        "alone_because": dict(_why_alone(result.lanes)),
        "starting_s": result.starting_s,
        "computing_s": result.computing_s,
        "real_time_factor": result.real_time_factor,
        "quantiles": list(QUANTILES),
        **result.quantiles(),
        "rows": _member_rows(result),
    }


def _ensemble_text(scene: Scene, result: StudyResult) -> str:
    """Return the results in words and tables."""
    members = len(result.figures)
    lines = [
        f"{scene.name}: {members} members, {result.time_s:g} s each in steps of {result.step_s:g} s"
        f" on {scene.ropes[0].elements} elements; seed {result.plan.seed}",
        "varied: " + ", ".join(str(axis) for axis in result.plan.axes),
        "",
        *_quantile_lines(result),
        *_grid_lines(result),
        "",
        f"{result.slack} with a slack line, {result.overloaded} above the rope's MBL, "
        f"{result.failed} stopped early",
        f"real-time factor: {result.real_time_factor:.2f} (all members together, on "
        f"{result.threads} threads; {result.starting_s:.1f} s before the first time step)",
        _lane_words(result.lanes, members),
    ]
    return "\n".join(lines)


def _lane_words(lanes: Lanes, members: int) -> str:
    """Return how the members were stepped."""
    line = f"{lanes.members} of {members} members stepped in SIMD batches of {LANES}"
    for reason, count in _why_alone(lanes):
        line += f"; {count} one by one ({reason})"
    return line


def _why_alone(lanes: Lanes) -> Iterator[tuple[str, int]]:
    """Yield the reasons why members are stepped one by one, and how many."""
    for reason, count in lanes.alone.items():
        yield reason or "too few of a kind", count


def _quantile_lines(result: StudyResult) -> list[str]:
    """Return quantiles over all members, a line for each result."""
    heads = ["min", *(f"{100 * part:g} %" for part in QUANTILES[1:-1]), "max"]
    lines = [" " * 28 + "".join(f"{head:>10}" for head in heads)]
    for name, values in result.quantiles().items():
        numbers = "".join(f"{SCALES[name] * value:10.1f}" for value in values)
        lines.append(f"{NAMES[name]:28}{numbers}")
    return lines


def _grid_lines(result: StudyResult) -> list[str]:
    """Return a line for each point of the grid, if there is one."""
    grid = [k for k, axis in enumerate(result.plan.axes) if axis.values]
    if not grid:
        return []
    paths = [result.plan.axes[k].column for k in grid]
    widths = [max(len(path), 10) for path in paths]
    low, middle, high = QUANTILES.index(0.05), QUANTILES.index(0.5), QUANTILES.index(0.95)
    heads = [f"{path:>{width}}" for path, width in zip(paths, widths, strict=True)]
    heads += ["maximum [kN]", "95 % [kN]", "minimum [kN]", "5 % [kN]", "slack [%]"]
    lines = ["", "  ".join(heads) + "   (median and quantile over the members of a point)"]
    per_point = result.plan.per_point
    for first in range(0, len(result.figures), per_point):
        values = [result.plan.rows[first][k] for k in grid]
        cells = [f"{value:{width}g}" for value, width in zip(values, widths, strict=True)]
        quantiles = result.quantiles(first, per_point)
        if quantiles:
            largest, smallest = quantiles["tension_top_max_n"], quantiles["tension_top_min_n"]
            numbers = [
                1e-3 * value
                for value in (largest[middle], largest[high], smallest[middle], smallest[low])
            ]
            numbers.append(100.0 * quantiles["slack_share"][middle])
            widest = [len(head) for head in heads[len(grid) :]]
            cells += [f"{n:{width}.1f}" for n, width in zip(numbers, widest, strict=True)]
        lines.append("  ".join(cells))
    return lines


def _failure_lines(result: StudyResult) -> list[str]:
    """Return the first few members that stopped early, and how many more."""
    sentences = [
        f"member {k}: {figure.failure}" for k, figure in enumerate(result.figures) if figure.failure
    ]
    more = len(sentences) - FAILURES_SHOWN
    return sentences[:FAILURES_SHOWN] + (
        [f"and {more} more members, see --out"] if more > 0 else []
    )


PICTURE = "study.png"
BAR = 24
STUDY_EXAMPLES = (
    "study sea_and_load",
    "study my_study.yaml --out results --json",
)
STUDY_MORE = """\
Grid or Latin hypercube, on all cores or on a Dask cluster; one row of a Parquet file for
each run. The same command resumes a study that was interrupted. Examples are in config/studies."""


def _add_study(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("study", metavar="STUDY", help="path of the study file, or a name in config/studies")
    add_out(parser, "DIR", "folder of results and picture (default: study_NAME)")
    add("--scheduler", default="", metavar="ADDRESS", help="Dask scheduler whose workers run it")
    add("--batch-size", type=int, default=LANES, metavar="N",
        help=f"runs that a core steps together (default: {LANES}, one SIMD batch)")  # fmt: skip
    add_json(parser)


def _run_study(args: argparse.Namespace) -> int:
    """Run the remaining runs of the study and report the results. Raises RopeTwinError."""
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


STUDY_FIGURES = (  # column of the rows, words, scale
    ("tension_top_max_n", "maximum top tension [kN]", 1e-3),
    ("tension_top_mean_n", "mean top tension [kN]", 1e-3),
    ("tension_top_min_n", "minimum top tension [kN]", 1e-3),
    ("slack_share", "slack somewhere [% of time]", 100.0),
    ("max_utilisation", "maximum utilisation [%]", 100.0),
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
    return [figure for figure in STUDY_FIGURES if figure[0] in rows[0]]


def _by_rope(rows: Sequence[Row]) -> list[tuple[str, str, float]]:
    """Return the maximum tension of each rope of a multi-line scene."""
    end = ".tension_max_n"
    names = (column.removesuffix(end) for column in rows[0] if column.endswith(end))
    return [(name + end, f"maximum tension of {name} [kN]", 1e-3) for name in names]


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
    return f"; rank correlation with the maximum tension {rank:+.2f}"


ACROSS = 4  # panels beside each other
MAX_PANELS = 32
HIGH, LOW = "#d55e00", "#0072b2"
DAMAGE = re.compile(r"(.*\.)?damage")  # columns of damage along a rope


def draw_study(study: Study, rows: Sequence[Row], path: Path) -> None:
    """Draw a panel for each variable, and one for the damage along each rope if it was counted.

    Raises:
        InputError: it cannot be drawn or written.
    """
    check_picture(path)
    good = whole_runs(rows)
    shown = study.vary[:MAX_PANELS]
    damaged = [column for column in (good[0] if good else ()) if DAMAGE.fullmatch(column)]
    panels = len(shown) + len(damaged)
    columns = min(ACROSS, panels)
    lines = math.ceil(panels / columns)
    figure = new_figure(4.0 * columns, 3.2 * lines + 0.5)
    axes: list[Any] = figure.subplots(lines, columns, squeeze=False).ravel().tolist()
    for panel, variable in zip(axes, shown, strict=False):
        _draw_variable(panel, variable, good)
    for panel, column in zip(axes[len(shown) :], damaged, strict=False):
        _draw_damage(panel, good, column)
    for panel in axes[panels:]:
        panel.set_axis_off()
    axes[0].set_ylabel("top tension [kN]")
    more = len(study.vary) - len(shown)
    left_out = f"; {more} variables more" if more else ""
    figure.suptitle(f"{study.name}: {len(good)} runs of {study.seconds:g} s{left_out}")
    write_picture(figure, path, 110)


def _draw_variable(axes: Any, variable: Variable, rows: Sequence[Row]) -> None:
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


COMMANDS = {
    "ensemble": Command(_add_ensemble, _run_ensemble, ENSEMBLE_EXAMPLES, ENSEMBLE_MORE),
    "study": Command(_add_study, _run_study, STUDY_EXAMPLES, STUDY_MORE),
}
