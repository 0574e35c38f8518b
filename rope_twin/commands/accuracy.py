"""`rope_twin accuracy SCENE`: what accuracy costs, as a table, a picture and the scene's card.

With `--within 1%` no card, but whether what `rope_twin run --within 1%` buys keeps its word.
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

from rope_twin.commands.console import CaseProgress, print_table
from rope_twin.commands.run.choice import find_quantity, read_amount
from rope_twin.errors import InputError, RopeTwinError, SceneError, phrase
from rope_twin.scene.card import card_path, known_error, read_card, told_bound
from rope_twin.scene.load import load_scene, scene_names
from rope_twin.scene.schema import Scene
from rope_twin.studies.accuracy import page as accuracy_page
from rope_twin.studies.accuracy import study as accuracy
from rope_twin.studies.accuracy import within as accuracy_within
from rope_twin.studies.accuracy.picture import draw_accuracy
from rope_twin.studies.accuracy.plan import make_plan
from rope_twin.studies.picture import check_picture


def add_parser(subparsers: argparse._SubParsersAction[Any]) -> None:
    """Declare the subcommand."""
    parser = subparsers.add_parser(
        "accuracy",
        help="error, speed and memory over elements and steps; makes a scene's accuracy card",
        description="Runs a scene over a ladder of elements and steps against a reference that "
        "states its own uncertainty (about a minute), and writes the card that lies beside the "
        "scene: NAME.json, NAME.md and NAME.png in its folder `cards`.",
    )
    which = parser.add_mutually_exclusive_group(required=True)
    which.add_argument("scene", nargs="?", metavar="SCENE", help="name of a scene or path of one")
    which.add_argument("--all", action="store_true", help="every scene that comes along")
    which.add_argument("--status", action="store_true", help="only tell which cards are old")
    add = parser.add_argument
    add("--for", dest="for_s", type=float, metavar="SECONDS",
        help="window of the run (default: a minute, or a round of the winch schedule; with "
        "--within: the card's)")  # fmt: skip
    add("--into", type=Path, metavar="DIR", help="write the card there instead")
    add("--no-card", action="store_true", help="write nothing")
    add("--within", metavar="AMOUNT",
        help="make no card: buy what `run --within` would (as 1%% or 0.05m) and measure it anew "
        "against a run finer than the card's reference; exit code 1 if it is not kept")  # fmt: skip
    add("--of", metavar="QUANTITY", help="with --within: the quantity (default: tension_rms)")
    add(
        "--json",
        action="store_true",
        help="one JSON object instead of tables; a line for each card",
    )
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Do what the options say; raises RopeTwinError."""
    if args.status:
        return _status(args.json)
    if args.for_s is not None and not 0.0 < args.for_s <= 3600.0:
        what = f"{args.for_s:g} s is not possible"
        raise InputError(phrase("--for", what, "give a time above 0 s, at most 3600 s"))
    if args.within is not None:
        return _check(args)
    if args.of is not None:
        raise InputError(phrase("--of", "a card has every quantity", "say --within 1% too"))
    if not args.all:
        return _make(args, load_scene(args.scene))
    refused = 0
    for name in scene_names():
        try:
            _make(args, load_scene(name))
        except RopeTwinError as error:  # the others still get theirs
            sys.stderr.write(f"{error}\n")
            refused += 1
    return 1 if refused else 0


def _check(args: argparse.Namespace) -> int:
    """What `run --within` buys of these scenes, measured anew; 1 if one is not within."""
    if args.into is not None:
        raise InputError(phrase("--into", "--within makes no card", "leave one of them out"))
    quantity = find_quantity(args.of)
    within = read_amount("--within", args.within, quantity.name, quantity.unit)
    names = scene_names() if args.all else [args.scene]
    scenes = [load_scene(name) for name in names]
    progress = CaseProgress()
    wanted = accuracy_within.Wanted(quantity, within, args.for_s)
    rows = list(accuracy_within.check_scenes(scenes, wanted, progress.show))
    if args.json:
        told = [{**asdict(row), "ok": row.ok} for row in rows]
        print(json.dumps({"rows": told}, ensure_ascii=False, allow_nan=False))
    else:
        print(f"{quantity.name} within {within:g} {quantity.unit}\n")
        print_table(accuracy_within.bought_table(rows, quantity.unit))
    return 0 if all(row.ok for row in rows) else 1


def _make(args: argparse.Namespace, scene: Scene) -> int:
    """One card, told and written as the options say."""
    path = _place(args, scene)
    if not args.no_card:
        _check_place(path)
    plan = make_plan(scene, args.for_s)
    study = accuracy.measure_accuracy(scene, plan, CaseProgress().show)
    card = accuracy.as_card(study)
    if args.json:
        print(json.dumps(card, ensure_ascii=False, allow_nan=False))
    else:
        _tell(study)
    if not args.no_card:
        write_card(study, card, path)
        if not args.json:
            print(f"card: {path.with_suffix('.md')}\n")
    return 0


def write_card(study: accuracy.Study, card: dict[str, Any], path: Path) -> None:
    """Write the three files of a card, the JSON at `path`; numbers to six digits.

    Raises:
        InputError: they cannot be written there.
    """
    picture = path.with_suffix(".png")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        draw_accuracy(study, picture)
        path.write_text(_as_text(_short(card)), encoding="utf-8")
        page = accuracy_page.as_markdown(study, card, picture.name)
        path.with_suffix(".md").write_text(page, encoding="utf-8")
    except OSError as error:
        raise _unwritable(path, error) from error


def _place(args: argparse.Namespace, scene: Scene) -> Path:
    own = card_path(scene)
    return own if args.into is None else Path(args.into) / own.name


def _check_place(path: Path) -> None:
    """See before anything is computed that a card can be drawn and written there."""
    check_picture(path.with_suffix(".png"))
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise _unwritable(path, error) from error
    if not os.access(path.parent, os.W_OK):
        raise _unwritable(path, PermissionError(errno.EACCES, os.strerror(errno.EACCES)))


def _unwritable(path: Path, error: OSError) -> InputError:
    what = f"the card cannot be written ({error.strerror})"
    return InputError(phrase(str(path), what, "choose a folder with --into, or say --no-card"))


def _as_text(card: dict[str, Any]) -> str:
    """JSON with a line for each entry, and for each row of the ladder."""
    lines = []
    for key, value in card.items():
        told = json.dumps(value, ensure_ascii=False, allow_nan=False)
        if key == "rows":
            rows = [json.dumps(row, ensure_ascii=False, allow_nan=False) for row in value]
            told = "[\n  " + ",\n  ".join(rows) + "\n ]"
        lines.append(f" {json.dumps(key)}: {told}")
    return "{\n" + ",\n".join(lines) + "\n}\n"


def _tell(study: accuracy.Study) -> None:
    print(f"{study.scene.name}: errors over {study.plan.seconds:g} s against a run of "
          f"{study.reference.setting}")  # fmt: skip
    print(f"{study.machine.as_text()}\n")
    print_table(accuracy_page.row_table(study))
    print("\n* the scene as it is; ≤: below the reference's uncertainty\n")
    print_table(accuracy_page.doubt_table(study))
    print()
    for line in (*accuracy_page.notes(study), *accuracy_page.summary(study)):
        print(f"- {line}")


def _status(as_json: bool) -> int:
    """A line per shipped scene; exit code 1 if a card is missing or old."""
    rows, fine = [], True
    for name in scene_names():
        scene = load_scene(name)
        try:
            card = read_card(scene)
            said = "no card" if card is None else card.age(scene) or "current"
        except SceneError as error:
            said = str(error)
        fine = fine and said == "current"
        error_pct = known_error(scene).rms_pct
        known = error_pct == error_pct
        rows.append({"scene": name, "card": said, "error_rms_pct": error_pct if known else None})
    if as_json:
        print(json.dumps({"rows": rows}, ensure_ascii=False, allow_nan=False))
    else:
        cells = [["scene", "rms % at most", "card"]]
        cells += [
            [str(row["scene"]), _percent(row["error_rms_pct"]), str(row["card"])] for row in rows
        ]
        print_table(cells, words_last=True)
    return 0 if fine else 1


def _percent(value: object) -> str:
    return told_bound(value) if isinstance(value, float) else "unknown"


def _short(value: Any) -> Any:
    """With floats to six significant digits."""
    if isinstance(value, float):
        return float(f"{value:.6g}")
    if isinstance(value, dict):
        return {key: _short(one) for key, one in value.items()}
    return [_short(one) for one in value] if isinstance(value, list | tuple) else value
