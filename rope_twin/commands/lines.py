"""`rope_twin lines SCENE`: a loop of two lines, calm and in a sea state."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

from rope_twin.commands.console import print_table
from rope_twin.errors import InputError, phrase
from rope_twin.scene.load import load_scene
from rope_twin.studies.picture import check_picture
from rope_twin.studies.two_lines.picture import draw_lines
from rope_twin.studies.two_lines.runs import SEA_STATES, LineRun, record_of, run_lines
from rope_twin.twin.multi_line.clearance import lines_of
from rope_twin.twin.multi_line.clearance_results import LineEvent
from rope_twin.twin.twin import Twin

HEAD = ("line", "sea", "mean kN", "min kN", "max kN", "max over calm mean", "jump %")
SECONDS, LEAST_S, MOST_S = 120, 10, 7200
SEED = 1


def add_parser(subparsers: argparse._SubParsersAction[Any]) -> None:
    """Add `lines`."""
    parser = subparsers.add_parser(
        "lines",
        help="two lines around one sheave, calm and in a sea state",
        description="Runs the winches' schedules twice, calm and on the heave of a vessel in a sea "
        "state: tension of both lines, how smooth it is from step to step, how near the lines come "
        "and where they cross.",
    )
    heights = ", ".join(f"{state} (Hs {hs:g} m)" for state, (hs, _) in SEA_STATES.items())
    parser.add_argument("scene", metavar="SCENE", help="a scene's name, or the path of a YAML file")
    parser.add_argument(
        "--seconds",
        type=int,
        default=SECONDS,
        metavar="S",
        help="to run each (default: %(default)s)",
    )
    parser.add_argument(
        "--sea-state", type=int, choices=tuple(SEA_STATES), default=3, metavar="N",
        help=f"of the second run: {heights} (default: %(default)s)",
    )  # fmt: skip
    parser.add_argument("--json", action="store_true", help="one JSON object instead of a table")
    parser.add_argument(
        "--into", type=Path, metavar="DIR", help="write two_lines.json and two_lines.png there"
    )
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Run both and show them; raises RopeTwinError."""
    if not LEAST_S <= args.seconds <= MOST_S:
        right = f"give {LEAST_S} to {MOST_S} s"
        raise InputError(phrase("--seconds", f"{args.seconds} s cannot be run", right))
    if args.into is not None:
        check_picture(args.into / "two_lines.png")
    scene = load_scene(args.scene)
    lines_of(scene)
    twin = Twin(scene)
    state = f"sea state {args.sea_state}"
    calm = run_lines(twin.branch(), args.seconds, None, _teller("calm"))
    record = record_of(args.sea_state, SEED)
    rough = run_lines(twin, args.seconds, record, _teller(state))
    found = {"scene": scene.name, "seconds": args.seconds, "calm": calm.figures()}
    found |= {"sea_state": args.sea_state, "in_sea_state": rough.figures()}
    text = json.dumps(found, ensure_ascii=False, allow_nan=False)
    if args.json:
        print(text)
    else:
        _show(calm, rough, state)
    if args.into is not None:
        name = f"{scene.name}, calm and in {state}"
        draw_lines(name, calm, rough, state, args.into / "two_lines.png")
        (args.into / "two_lines.json").write_text(json.dumps(found, indent=1) + "\n")
    return 0


def _teller(sea: str) -> Any:
    """What tells of a crossing while the run goes on."""

    def tell(event: LineEvent) -> None:
        sys.stderr.write(f"{sea}, {event.time_s:.1f} s: {event.words()}\n")

    return tell


def _show(calm: LineRun, rough: LineRun, state: str) -> None:
    rows: list[tuple[str, ...]] = [HEAD]
    for k, line in enumerate(("main", "haulback")):
        mean = calm.tension_n[k].mean()
        for sea, own in (("calm", calm), (state, rough)):
            row = own.tension_n[k]
            jump = f"{own.noise[k].jump_pct:.2g}" if own.noise is not None else ""
            figures = [f"{1e-3 * value:.1f}" for value in (row.mean(), row.min(), row.max())]
            rows.append((line, sea, *figures, f"{row.max() / mean:.3f}", jump))
    print_table(rows)
    for sea, own in (("calm", calm), (state, rough)):
        near = min(own.nearest, key=lambda one: one.distance_m)
        depths = ", ".join(f"{depth:.0f} m" for depth in own.crossing_m[-1]) or "none"
        print(
            f"{sea}: nearest {near.distance_m:.2f} m at {near.depth_m:.0f} m and {near.time_s:.1f} "
            f"s; crossings at the end: {depths}; {own.real_time_factor:.1f} times real time"
        )
    print("jump: largest second difference of the pull from step to step, calm, over its mean")
