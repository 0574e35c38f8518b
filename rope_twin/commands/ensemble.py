"""`rope_twin ensemble SCENE`: many lifts at once, each with other numbers or in another sea.

Exit code 0; 3 if some members could not go on to the end (they are named); 1 with one sentence if
nothing could be run or no member came to its end.
"""

from __future__ import annotations

import argparse
import csv
import json
import math
import os
import sys
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from rope_twin.core.jit.wide import LANES
from rope_twin.errors import InputError, phrase
from rope_twin.run.progress import FigureProgress
from rope_twin.scene.load import load_scene
from rope_twin.scene.schema import Scene
from rope_twin.studies.ensemble.plan import make_plan, read_axis, read_range
from rope_twin.studies.ensemble.study import (
    FIGURES,
    QUANTILES,
    SEA_OFFSET,
    StudyResult,
    run_study,
)
from rope_twin.studies.variants import variant
from rope_twin.twin.ensemble.ensemble import LOOK_S, Lanes, cores

NAMES = {
    "tension_top_max_n": "highest top tension [kN]",
    "tension_top_mean_n": "mean top tension [kN]",
    "tension_top_min_n": "lowest top tension [kN]",
    "slack_share": "slack somewhere [% of time]",
}
SCALES = {name: 100.0 if name == "slack_share" else 1e-3 for name in FIGURES}
FAILURES_SHOWN = 5


@dataclass(frozen=True)
class _Line:
    """How far the members are."""

    members: int
    time_s: float
    for_s: float
    real_s: float

    def as_progress(self) -> str:
        if self.real_s == 0.0:
            return f"{self.members} ropes are at rest where they start"
        factor = self.time_s / self.real_s
        return (
            f"{self.time_s:8.1f} of {self.for_s:g} s  {self.members} members  "
            f"{factor:.2f} × real time  {(self.for_s - self.time_s) / factor:.0f} s to go"
        )


def add_parser(subparsers: argparse._SubParsersAction[Any]) -> None:
    """Declare the subcommand."""
    about = "many lifts of one scene at once: other loads, ropes, seas; quantiles of the tension"
    parser = subparsers.add_parser(
        "ensemble",
        help=about,
        description="For example: rope_twin ensemble deep_lift --vary "
        "'payloads[0].mass_kg=18000..22000' --sea-offset 0..600 --members 200 --for 60. "
        "Paths are those of the scene's file, effects by name (effects.drag.normal), [*] for every "
        "entry of a list; NUMBERS are LOW..HIGH (drawn at random), LOW..HIGH:COUNT or A,B,C (a "
        "grid, at each point of which there are so many members).",
    )
    add = parser.add_argument
    add("scene", metavar="SCENE", help="name of a scene, or path of one")
    add("--vary", action="append", default=[], metavar="PATH=NUMBERS",
        help="a number of the scene that varies; PATH*=NUMBERS multiplies it")  # fmt: skip
    add("--sea-offset", metavar="NUMBERS",
        help="start each member so many seconds into the scene's sea")  # fmt: skip
    add("--members", type=int, metavar="N",
        help="members, at each point of the grid if there is one (default: 100; 1 on a grid alone)")  # fmt: skip # noqa: E501
    add("--seed", type=int, default=1, help="of the random numbers (default: 1)")
    add("--for", dest="for_s", type=float, default=60.0, metavar="SECONDS",
        help="twin time of each member (default: 60)")  # fmt: skip
    add("--step", type=float, metavar="SECONDS", help="time step (default: the scene's)")
    add("--look", type=float, default=LOOK_S, metavar="SECONDS",
        help="how often each rope is looked along for slack (default: %(default)s)")  # fmt: skip
    add("--threads", type=int, default=cores(), help="that step at once (default: %(default)s)")
    add("--csv", type=Path, metavar="FILE", help="write a row for each member")
    add("--json", action="store_true", help="last line of the output: one JSON object, with rows")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Run the members and tell what came out.

    Raises:
        RopeTwinError: one sentence on what cannot be.
    """
    scene = load_scene(args.scene)
    if args.step is not None:
        scene = variant(scene, step_s=_step(args.step))
    _check(args)
    axes = [read_axis("--vary", words) for words in args.vary]
    if args.sea_offset is not None:
        axes.append(read_range("--sea-offset", SEA_OFFSET, args.sea_offset))
    plan = make_plan(axes, args.members, args.seed)
    progress = FigureProgress()

    def report(time_s: float, real_s: float) -> None:
        if progress.due:
            progress.show(_Line(len(plan.rows), time_s, args.for_s, real_s))

    result = run_study(scene, plan, args.for_s, args.look, report, args.threads)
    progress.finish()
    if args.csv is not None:
        _write_csv(args.csv, result)
    print(_as_json(scene, result) if args.json else _as_text(scene, result))
    for sentence in _failures(result):
        print(sentence, file=sys.stderr)
    if result.failed == len(result.figures):
        return 1
    return 3 if result.failed else 0


def _step(step_s: float) -> float:
    if not 1e-5 <= step_s <= 0.2:
        raise InputError(phrase("--step", f"{step_s} s is not possible", "give 1e-05 to 0.2 s"))
    return step_s


def _check(args: argparse.Namespace) -> None:
    """Refuse what would only show after a long run."""
    if not (math.isfinite(args.for_s) and 0.0 < args.for_s <= 1e6):
        raise InputError(phrase("--for", f"{args.for_s} s is not possible", "give up to 1e6 s"))
    if args.seed < 0:
        raise InputError(phrase("--seed", f"{args.seed} is negative", "give 0 or more"))
    if args.csv is None:
        return
    folder = args.csv.resolve().parent
    if not folder.is_dir():
        raise InputError(phrase("--csv", f"there is no directory {folder}", "make it first"))
    if args.csv.is_dir() or not os.access(folder, os.W_OK):
        raise InputError(phrase("--csv", f"{args.csv} cannot be written", "choose another file"))


def _rows(result: StudyResult) -> list[dict[str, Any]]:
    """A row for each member: its number, what it has of its own, its figures."""
    rows = []
    for number, (values, figures) in enumerate(zip(result.plan.rows, result.figures, strict=True)):
        own = {_column(str(axis.path), axis.multiply): value
               for axis, value in zip(result.plan.axes, values, strict=True)}  # fmt: skip
        told = {key: None if isinstance(value, float) and not math.isfinite(value) else value
                for key, value in asdict(figures).items()}  # fmt: skip
        rows.append({"member": number, **own, **told})
    return rows


def _column(path: str, multiply: bool) -> str:
    """Name of an axis in tables."""
    return "sea_offset_s" if path == SEA_OFFSET else f"{path}*" if multiply else path


def _write_csv(path: Path, result: StudyResult) -> None:
    rows = _rows(result)
    try:
        with path.open("w", encoding="utf-8", newline="") as file:
            table = csv.DictWriter(file, list(rows[0]))
            table.writeheader()
            table.writerows(rows)
    except OSError as error:
        what = f"{path} cannot be written ({error.strerror})"
        raise InputError(phrase("--csv", what, "choose another file")) from error


def _as_json(scene: Scene, result: StudyResult) -> str:
    told = {
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
    return json.dumps(told, ensure_ascii=False, allow_nan=False)


def _as_text(scene: Scene, result: StudyResult) -> str:
    """A few lines and a table or two for people."""
    members = len(result.figures)
    lines = [
        f"{scene.name}: {members} members, {result.time_s:g} s each in steps of {result.step_s:g} s"
        f" on {scene.ropes[0].elements} elements; seed {result.plan.seed}",
        "varied: " + ", ".join(str(axis) for axis in result.plan.axes),
        "",
        *_table(result),
        *_grid(result),
        "",
        f"{result.slack} went slack somewhere, {result.overloaded} above the rope's breaking load, "
        f"{result.failed} stopped early",
        f"{result.real_time_factor:.2f} times real time, all members together, on "
        f"{result.threads} threads ({result.starting_s:.1f} s before the first step)",
        _lane_words(result.lanes, members),
    ]
    return "\n".join(lines)


def _lane_words(lanes: Lanes, members: int) -> str:
    """How the members were stepped."""
    line = f"{lanes.members} of {members} stepped in SIMD lanes, {LANES} at a time"
    for reason, count in lanes.alone.items():
        line += f"; {count} by themselves ({reason or 'too few of their kind'})"
    return line


def _table(result: StudyResult) -> list[str]:
    """Quantiles over all members, a line for each figure."""
    heads = ["least", *(f"{100 * part:g} %" for part in QUANTILES[1:-1]), "largest"]
    lines = [" " * 28 + "".join(f"{head:>10}" for head in heads)]
    for name, values in result.quantiles().items():
        numbers = "".join(f"{SCALES[name] * value:10.1f}" for value in values)
        lines.append(f"{NAMES[name]:28}{numbers}")
    return lines


def _grid(result: StudyResult) -> list[str]:
    """A line for each point of the grid, if there is one."""
    grid = [k for k, axis in enumerate(result.plan.axes) if axis.values]
    if not grid:
        return []
    paths = [_column(result.plan.axes[k].path, result.plan.axes[k].multiply) for k in grid]
    widths = [max(len(path), 10) for path in paths]
    low, middle, high = QUANTILES.index(0.05), QUANTILES.index(0.5), QUANTILES.index(0.95)
    heads = [f"{path:>{width}}" for path, width in zip(paths, widths, strict=True)]
    heads += ["highest [kN]", "95 % [kN]", "lowest [kN]", "5 % [kN]", "slack [%]"]
    lines = ["", "  ".join(heads) + "   (median and quantile over the members of a point)"]
    each = result.plan.per_point
    for first in range(0, len(result.figures), each):
        values = [result.plan.rows[first][k] for k in grid]
        cells = [f"{value:{width}g}" for value, width in zip(values, widths, strict=True)]
        found = result.quantiles(first, each)
        if found:
            most, least = found["tension_top_max_n"], found["tension_top_min_n"]
            numbers = [1e-3 * value for value in (most[middle], most[high], least[middle], least[low])]  # fmt: skip # noqa: E501
            numbers.append(100.0 * found["slack_share"][middle])
            widest = [len(head) for head in heads[len(grid) :]]
            cells += [f"{n:{width}.1f}" for n, width in zip(numbers, widest, strict=True)]
        lines.append("  ".join(cells))
    return lines


def _failures(result: StudyResult) -> list[str]:
    """The first few members that stopped early, and how many more."""
    said = [f"member {k}: {one.failure}" for k, one in enumerate(result.figures) if one.failure]
    more = len(said) - FAILURES_SHOWN
    return said[:FAILURES_SHOWN] + ([f"and {more} members more, see --csv"] if more > 0 else [])
