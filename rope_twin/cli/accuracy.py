"""`rope_twin accuracy SCENE`: convergence study of a scene over mesh and time step.

With `--within 1%` it verifies the setting that `rope_twin run --within 1%` would select.
"""

from __future__ import annotations

import argparse
import errno
import json
import os
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Any

from rope_twin.cli import CaseProgress, Command, ExitCode, print_json, print_table
from rope_twin.cli.selection import find_quantity, read_amount
from rope_twin.errors import InputError, RopeTwinError, SceneError
from rope_twin.run.options import add_duration, add_json, add_out, add_scene
from rope_twin.scene.convergence import known_error, read_study, study_path
from rope_twin.scene.error_bound import format_bound
from rope_twin.scene.load import load_scene, scene_names
from rope_twin.scene.schema import Scene
from rope_twin.studies import accuracy_page, accuracy_within
from rope_twin.studies import accuracy_study as accuracy
from rope_twin.studies.accuracy_page import draw_accuracy
from rope_twin.studies.accuracy_study import make_plan
from rope_twin.studies.picture import check_picture

EXAMPLES = (
    "accuracy my_lift.yaml",
    "accuracy deep_lift --within 1%",
    "accuracy --status --json",
)
MORE = """Runs the scene with several meshes and time steps against a reference whose own
uncertainty is reported (about a minute), and writes the study beside the scene: NAME.json, NAME.md
and NAME.png in the folder `convergence`. `rope_twin run --within` and `--budget` select from it."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    selection = parser.add_mutually_exclusive_group(required=True)
    add_scene(selection, nargs="?")
    selection.add_argument("--all", action="store_true", help="every shipped scene")
    selection.add_argument(
        "--status", action="store_true", help="report which convergence studies are out of date"
    )
    add = parser.add_argument
    add_duration(parser, "simulated time (default: 60s, or one cycle of the winch schedule)")
    add_out(parser, "DIR", "write the study there (default: folder `convergence` beside the scene)")
    add("--no-write", action="store_true", help="write no files")
    add("--within", metavar="ERROR",
        help="verify the setting that `run --within ERROR` would select (as 1%% or 0.05m) against "
        "a finer reference; writes no files")  # fmt: skip
    add("--quantity", metavar="NAME", help="with --within: the quantity (default: tension_rms)")
    add_json(parser)


def run(args: argparse.Namespace) -> int:
    """Run the study, or verify or list studies. Raises RopeTwinError."""
    if args.status:
        return _status(args.json)
    if args.duration is not None and not 0.0 < args.duration <= 3600.0:
        problem = f"{args.duration:g} s is not possible"
        raise InputError("--duration", problem, "give a time above 0 s, at most 3600 s")
    if args.within is not None:
        return _check(args)
    if args.quantity is not None:
        raise InputError("--quantity", "a study has every quantity", "give --within 1% too")
    if not args.all:
        content = _make(args, load_scene(args.scene))
        if args.json:
            print_json(content)
        return ExitCode.OK
    studies, refused = [], []
    for name in scene_names():
        try:
            studies.append(_make(args, load_scene(name)))
        except RopeTwinError as error:  # the others still get theirs
            sys.stderr.write(f"{error}\n")
            refused.append(str(error))
    if args.json:
        print_json({"studies": studies, "errors": refused})
    return ExitCode.ERROR if refused else ExitCode.OK


def _check(args: argparse.Namespace) -> int:
    """Verify what `run --within` selects for these scenes; NEGATIVE if a target is missed."""
    if args.out is not None:
        raise InputError("--out", "--within writes no files", "leave one of them out")
    quantity = find_quantity(args.quantity)
    limit = read_amount("--within", args.within, quantity.name, quantity.unit)
    names = scene_names() if args.all else [args.scene]
    scenes = [load_scene(name) for name in names]
    report = CaseProgress().show
    rows = list(accuracy_within.check_scenes(scenes, quantity, limit, args.duration, report))
    if args.json:
        print_json({"rows": [{**asdict(row), "ok": row.ok} for row in rows]})
    else:
        print(f"{quantity.name} within {limit:g} {quantity.unit}\n")
        print_table(accuracy_within.selected_table(rows, quantity.unit))
    return ExitCode.OK if all(row.ok for row in rows) else ExitCode.NEGATIVE


def _make(args: argparse.Namespace, scene: Scene) -> dict[str, Any]:
    """Make the study of one scene and write it as the options say."""
    shipped_path = study_path(scene)
    path = shipped_path if args.out is None else Path(args.out) / shipped_path.name
    if not args.no_write:
        _check_place(path)
    plan = make_plan(scene, args.duration)
    study = accuracy.measure_accuracy(scene, plan, CaseProgress().show)
    content = accuracy.as_content(study)
    if not args.json:
        _print_study(study)
    if not args.no_write:
        write_study(study, content, path)
        if not args.json:
            print(f"study: {path.with_suffix('.md')}\n")
    return content


def write_study(study: accuracy.Study, content: dict[str, Any], path: Path) -> None:
    """Write the three files of a study, the JSON at `path`; numbers to six digits.

    Raises:
        InputError: they cannot be written there.
    """
    picture = path.with_suffix(".png")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        draw_accuracy(study, picture)
        path.write_text(_as_text(_short(content)), encoding="utf-8")
        page = accuracy_page.as_markdown(study, content, picture.name)
        path.with_suffix(".md").write_text(page, encoding="utf-8")
    except OSError as error:
        raise _unwritable(path, error) from error


def _check_place(path: Path) -> None:
    """Check before the computation that a study can be drawn and written there."""
    check_picture(path.with_suffix(".png"))
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise _unwritable(path, error) from error
    if not os.access(path.parent, os.W_OK):
        raise _unwritable(path, PermissionError(errno.EACCES, os.strerror(errno.EACCES)))


def _unwritable(path: Path, error: OSError) -> InputError:
    problem = f"the study cannot be written ({error.strerror})"
    return InputError(str(path), problem, "choose a folder with --out, or give --no-write")


def _as_text(content: dict[str, Any]) -> str:
    """Return JSON with a line for each entry, and for each setting."""
    lines = []
    for key, value in content.items():
        text = json.dumps(value, ensure_ascii=False, allow_nan=False)
        if key == "rows":
            rows = [json.dumps(row, ensure_ascii=False, allow_nan=False) for row in value]
            text = "[\n  " + ",\n  ".join(rows) + "\n ]"
        lines.append(f" {json.dumps(key)}: {text}")
    return "{\n" + ",\n".join(lines) + "\n}\n"


def _print_study(study: accuracy.Study) -> None:
    print(f"{study.scene.name}: errors over {study.plan.seconds:g} s against a run of "
          f"{study.reference.setting}")  # fmt: skip
    print(f"{study.machine.as_text()}\n")
    print_table(accuracy_page.row_table(study))
    print("\n* setting of the scene; ≤: below the uncertainty of the reference\n")
    print_table(accuracy_page.doubt_table(study))
    print()
    for line in (*accuracy_page.notes(study), *accuracy_page.summary(study)):
        print(f"- {line}")


def _status(as_json: bool) -> int:
    """Report on each shipped scene; NEGATIVE if a study is missing or out of date."""
    rows, fine = [], True
    for name in scene_names():
        scene = load_scene(name)
        try:
            study = read_study(scene)
            state = "none" if study is None else study.age(scene) or "current"
        except SceneError as error:
            state = str(error)
        fine = fine and state == "current"
        error_pct = known_error(scene).rms_pct
        known = error_pct == error_pct
        rows.append({"scene": name, "study": state, "error_rms_pct": error_pct if known else None})
    if as_json:
        print_json({"rows": rows})
    else:
        cells = [["scene", "rms error % at most", "study"]]
        cells += [
            [str(row["scene"]), _percent(row["error_rms_pct"]), str(row["study"])] for row in rows
        ]
        print_table(cells, words_last=True)
    return ExitCode.OK if fine else ExitCode.NEGATIVE


def _percent(value: object) -> str:
    return format_bound(value) if isinstance(value, float) else "unknown"


def _short(value: Any) -> Any:
    """Return the value with floats to six significant digits."""
    if isinstance(value, float):
        return float(f"{value:.6g}")
    if isinstance(value, dict):
        return {key: _short(item) for key, item in value.items()}
    return [_short(item) for item in value] if isinstance(value, list | tuple) else value


COMMANDS = {"accuracy": Command(add_arguments, run, EXAMPLES, MORE)}
