"""`rope_twin lines SCENE`: a loop of two lines, calm and in a sea state."""

from __future__ import annotations

import argparse
import json
import sys
from typing import Any

from rope_twin.cli import ExitCode, print_json, print_table
from rope_twin.errors import InputError
from rope_twin.run.options import add_duration, add_json, add_out, add_scene
from rope_twin.scene.load import load_scene
from rope_twin.studies.picture import check_picture
from rope_twin.studies.two_lines import SEA_STATES, LineRun, draw_lines, record_of, run_lines
from rope_twin.twin.multi_line_snapshot import lines_of
from rope_twin.twin.snapshot import LineEvent
from rope_twin.twin.twin import Twin

HEAD = ("line", "sea", "mean kN", "min kN", "max kN", "max over calm mean", "jump %")
SECONDS, LEAST_S, MOST_S = 120.0, 10, 7200
SEED = 1


EXAMPLES = (
    "lines two_line_loop --duration 5min",
    "lines two_line_loop --sea-state 5 --out two_lines --json",
)
MORE = """Runs the winch schedules twice, calm and on the heave of a vessel in a sea state: tension
of both lines and its smoothness from time step to time step, their clearance, and where they
cross."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    heights = ", ".join(f"{state} (Hs {hs:g} m)" for state, (hs, _) in SEA_STATES.items())
    add_scene(parser)
    add_duration(parser, "simulated time of each run, in whole seconds", SECONDS)
    parser.add_argument(
        "--sea-state", type=int, choices=tuple(SEA_STATES), default=3, metavar="N",
        help=f"of the second run: {heights} (default: %(default)s)",
    )  # fmt: skip
    add_out(parser, "DIR", "write two_lines.json and two_lines.png there")
    add_json(parser)


def run(args: argparse.Namespace) -> int:
    """Run both and print the results. Raises RopeTwinError."""
    if not LEAST_S <= args.duration <= MOST_S or args.duration % 1.0:
        remedy = f"give a whole number of seconds from {LEAST_S} to {MOST_S}"
        raise InputError("--duration", f"{args.duration:g} s is not possible", remedy)
    seconds = int(args.duration)
    if args.out is not None:
        check_picture(args.out / "two_lines.png")
    scene = load_scene(args.scene)
    lines_of(scene)
    twin = Twin(scene)
    state = f"sea state {args.sea_state}"
    calm = run_lines(twin.branch(), seconds, None, _reporter("calm"))
    record = record_of(args.sea_state, SEED)
    rough = run_lines(twin, seconds, record, _reporter(state))
    summary = {"scene": scene.name, "duration_s": args.duration, "calm": calm.figures()}
    summary |= {"sea_state": args.sea_state, "in_sea_state": rough.figures()}
    if args.json:
        print_json(summary)
    else:
        _show(calm, rough, state)
    if args.out is not None:
        name = f"{scene.name}, calm and in {state}"
        draw_lines(name, calm, rough, state, args.out / "two_lines.png")
        (args.out / "two_lines.json").write_text(json.dumps(summary, indent=1) + "\n")
    return ExitCode.OK


def _reporter(sea: str) -> Any:
    """Return the function that reports a crossing during the run."""

    def report(event: LineEvent) -> None:
        sys.stderr.write(f"{sea}, {event.time_s:.1f} s: {event.words()}\n")

    return report


def _show(calm: LineRun, rough: LineRun, state: str) -> None:
    rows: list[tuple[str, ...]] = [HEAD]
    for k, line in enumerate(("main", "haulback")):
        mean = calm.tension_n[k].mean()
        for sea, motion in (("calm", calm), (state, rough)):
            row = motion.tension_n[k]
            jump = f"{motion.noise[k].jump_pct:.2g}" if motion.noise is not None else ""
            figures = [f"{1e-3 * value:.1f}" for value in (row.mean(), row.min(), row.max())]
            rows.append((line, sea, *figures, f"{row.max() / mean:.3f}", jump))
    print_table(rows)
    for sea, motion in (("calm", calm), (state, rough)):
        closest = min(motion.nearest, key=lambda approach: approach.distance_m)
        depths = ", ".join(f"{depth:.0f} m" for depth in motion.crossing_m[-1]) or "none"
        print(
            f"{sea}: clearance {closest.distance_m:.2f} m at {closest.depth_m:.0f} m depth and "
            f"{closest.time_s:.1f} s; crossings at the end: {depths}; "
            f"real-time factor {motion.real_time_factor:.1f}"
        )
    print("jump: largest second difference of tension between time steps, calm, over the mean")
