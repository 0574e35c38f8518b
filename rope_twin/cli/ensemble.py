"""`rope_twin ensemble SCENE`: many lifts at once, each with other parameters or in another sea.

Exit code NEGATIVE if some members stopped early (they are listed), ERROR if all did.
"""

from __future__ import annotations

import argparse
import csv
import os
import re
import sys
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import Any

from rope_twin.cli import ExitCode, print_json
from rope_twin.core.jit.wide import LANES
from rope_twin.errors import InputError
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
from rope_twin.studies.study_design import SEA_OFFSET_S
from rope_twin.twin.ensemble.ensemble import SAMPLING_S, Lanes, cores

NAMES = {
    "tension_top_max_n": "maximum top tension [kN]",
    "tension_top_mean_n": "mean top tension [kN]",
    "tension_top_min_n": "minimum top tension [kN]",
    "slack_share": "slack line [% of time]",
}
SCALES = {name: 100.0 if name == "slack_share" else 1e-3 for name in FIGURES}
FAILURES_SHOWN = 5
EXAMPLES = (
    "ensemble deep_lift --vary 'payloads[0].mass_kg=18000..22000' --members 200",
    "ensemble deep_lift --sea-offset 0..10min --duration 5min --out members.csv",
    "ensemble deep_lift --vary 'effects.drag.normal=1.0,1.2,1.6' --json",
)
MORE = """A KEY is that of the scene's file, effects by name (effects.drag.normal), [*] for every
entry of a list. NUMBERS are LOW..HIGH (drawn at random), or LOW..HIGH:COUNT or A,B,C (a grid, with
`--members` members at each of its points)."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
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


def run(args: argparse.Namespace) -> int:
    """Run the members and report the results.

    Raises:
        RopeTwinError: one sentence on what cannot be.
    """
    scene = load_scene(args.scene)
    if args.time_step is not None:
        if not 1e-5 <= args.time_step <= 0.2:
            problem = f"{args.time_step:g} s is not possible"
            raise InputError("--time-step", problem, "give 1e-05 to 0.2 s")
        scene = variant(scene, step_s=args.time_step)
    _check(args)
    axes = [read_axis("--vary", option) for option in args.vary]
    if args.sea_offset is not None:
        axes.append(read_range("--sea-offset", SEA_OFFSET_S, _seconds(args.sea_offset)))
    plan = make_plan(axes, args.members, args.seed)
    progress = FigureProgress()

    def report(time_s: float, real_s: float) -> None:
        if progress.due:
            progress.show(_progress(len(plan.rows), time_s, args.duration, real_s))

    result = run_study(scene, plan, args.duration, args.slack_interval, report, args.jobs)
    progress.finish()
    if args.out is not None:
        _write_csv(args.out, result)
    if args.json:
        print_json(_figures(scene, result))
    else:
        print(_as_text(scene, result))
    for sentence in _failures(result):
        print(sentence, file=sys.stderr)
    if result.failed == len(result.figures):
        return ExitCode.ERROR
    return ExitCode.NEGATIVE if result.failed else ExitCode.OK


def _progress(members: int, time_s: float, duration_s: float, real_s: float) -> str:
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


def _check(args: argparse.Namespace) -> None:
    """Refuse what would fail only after a long run."""
    if not 0.0 < args.duration <= 1e6:
        problem = f"{args.duration:g} s is not possible"
        raise InputError("--duration", problem, "give a time above 0 s, at most 1e6 s")
    if args.seed < 0:
        raise InputError("--seed", f"{args.seed} is negative", "give 0 or more")
    if args.out is None:
        return
    folder = args.out.resolve().parent
    if not folder.is_dir():
        raise InputError("--out", f"there is no folder {folder}", "create it first")
    if args.out.is_dir() or not os.access(folder, os.W_OK):
        raise InputError("--out", f"{args.out} cannot be written", "choose another file")


def _rows(result: StudyResult) -> list[dict[str, Any]]:
    """Return a row for each member: its number, its own parameters and its results."""
    rows = []
    for number, (values, figures) in enumerate(zip(result.plan.rows, result.figures, strict=True)):
        member_values = {
            axis.column: value for axis, value in zip(result.plan.axes, values, strict=True)
        }
        rows.append({"member": number, **member_values, **json_value(asdict(figures))})
    return rows


def _write_csv(path: Path, result: StudyResult) -> None:
    rows = _rows(result)
    try:
        with path.open("w", encoding="utf-8", newline="") as file:
            table = csv.DictWriter(file, list(rows[0]))
            table.writeheader()
            table.writerows(rows)
    except OSError as error:
        problem = f"{path} cannot be written ({error.strerror})"
        raise InputError("--out", problem, "choose another file") from error


def _figures(scene: Scene, result: StudyResult) -> dict[str, Any]:
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
        "alone_because": result.lanes.alone,
        "starting_s": result.starting_s,
        "computing_s": result.computing_s,
        "real_time_factor": result.real_time_factor,
        "quantiles": list(QUANTILES),
        **result.quantiles(),
        "rows": _rows(result),
    }


def _as_text(scene: Scene, result: StudyResult) -> str:
    """Return the results in words and tables."""
    members = len(result.figures)
    lines = [
        f"{scene.name}: {members} members, {result.time_s:g} s each in steps of {result.step_s:g} s"
        f" on {scene.ropes[0].elements} elements; seed {result.plan.seed}",
        "varied: " + ", ".join(str(axis) for axis in result.plan.axes),
        "",
        *_table(result),
        *_grid(result),
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
    for reason, count in lanes.alone.items():
        line += f"; {count} one by one ({reason or 'too few of a kind'})"
    return line


def _table(result: StudyResult) -> list[str]:
    """Return quantiles over all members, a line for each result."""
    heads = ["min", *(f"{100 * part:g} %" for part in QUANTILES[1:-1]), "max"]
    lines = [" " * 28 + "".join(f"{head:>10}" for head in heads)]
    for name, values in result.quantiles().items():
        numbers = "".join(f"{SCALES[name] * value:10.1f}" for value in values)
        lines.append(f"{NAMES[name]:28}{numbers}")
    return lines


def _grid(result: StudyResult) -> list[str]:
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


def _failures(result: StudyResult) -> list[str]:
    """Return the first few members that stopped early, and how many more."""
    sentences = [
        f"member {k}: {figure.failure}" for k, figure in enumerate(result.figures) if figure.failure
    ]
    more = len(sentences) - FAILURES_SHOWN
    return sentences[:FAILURES_SHOWN] + (
        [f"and {more} more members, see --out"] if more > 0 else []
    )
