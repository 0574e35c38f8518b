"""`rope_twin learn BAG`: weight, mass, drag and stiffness of a recorded lift from its tension."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

import numpy as np

from rope_twin.cli import ExitCode, print_json, print_table
from rope_twin.errors import InputError
from rope_twin.run.options import add_json, add_out, add_time
from rope_twin.run.progress import FigureProgress

EXAMPLES = (
    "learn lift",
    "learn sensors --scene deep_lift --tared --out learned.png",
    "learn lift --until 5min --json",
)
MORE = """Reads winch/measured (tension, line out) and ship/heave of a bag and learns the figures of
rope and payload, load pin and motion sensor a minute at a time, from the uncertainties in the
scene's section `learning`. The rope hangs at rest when the measurement begins, and two minutes are
needed. Faults are looked for as in a run with --learn: nothing is learned behind one, and the exit
code is 3. Nothing is learned while the payload is in the splash zone or near the seabed. A load on
several ropes from the ship is learned from the load pins of their winches, which winch/measured
names by hang-off or rope. A load that begins on a deck cannot be learned yet, nor a rigid body on
several ropes."""
LEAST_S = 120.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("bag", metavar="BAG", help="bag directory, .mcap file, or name in bags/")
    add("--scene", metavar="SCENE", help="scene name or file (default: the bag's)")
    winch = "main winch in winch/measured (default: the first)"
    add("--winch", metavar="NAME", default="", help=winch)
    add("--tared", action="store_true", help="the load pin was tared with an empty hook")
    add_time(parser, "--until", "learn from data up to this time after the first tension")
    add_out(parser, "FILE.png", "draw the figures over time, and the residual that is left")
    add_json(parser)


def run(args: argparse.Namespace) -> int:
    """Learn and print the table. Raises RopeTwinError with one sentence if it cannot be done."""
    from rope_twin.estimation import report
    from rope_twin.estimation.alarms import FaultWatch
    from rope_twin.estimation.estimator import begin_at_rest
    from rope_twin.estimation.recorded_lift import read_lift
    from rope_twin.scene.load import load_scene

    if args.out is not None:
        from rope_twin.studies.picture import check_picture

        check_picture(args.out)
    stated_scene = load_scene(args.scene) if args.scene else None
    recorded = read_lift(args.bag, args.winch, stated_scene)
    scene = stated_scene or recorded.scene()
    estimator = begin_at_rest(scene, recorded.lift, tared=args.tared)
    until_s = np.inf if args.until is None else args.until
    progress = FigureProgress()
    known_s = recorded.lift.known_until_s(estimator.heave_ahead_s)
    watch, blocks = FaultWatch(scene, estimator), 0
    while estimator.block_end_s <= until_s + 1e-6:
        if watch.advance(min(estimator.block_end_s, known_s)) is not None or not estimator.step():
            break
        if len(estimator.results) > blocks:
            watch.learned(estimator)
        blocks = len(estimator.results)
        if progress.due:
            progress.show(f"{estimator.block_end_s:.0f} of {min(known_s, until_s):.0f} s")
    progress.finish()
    alarm = watch.alarm
    if not estimator.results and alarm is not None:
        fault = f"before anything is learned, {alarm.words}"
        raise InputError(
            f"bag {args.bag}", fault, "check the sensors, and give a bag behind the fault"
        )
    if not estimator.results:
        fault = f"{min(known_s, until_s) - recorded.lift.begin_s:.0f} s of data"
        remedy = f"give at least {LEAST_S:g} s with tension, heave and line out"
        raise InputError(f"bag {args.bag}", fault, remedy)
    if remark := report.disagreement(estimator):
        raise InputError(f"bag {args.bag}", remark, "check its unit (N), its sign and the scene")
    posterior = estimator.results[-1].posterior
    actions = report.expected_after(estimator, scene)
    if not args.tared:
        actions.append(report.tare_action(estimator.prior, posterior))
    base = report.base_values(scene)
    advice = report.best_actions(posterior, actions, estimator.prior.names)
    at_limit = estimator.results[-1].at_limit
    figures = report.estimates(base, estimator.prior, posterior, advice, at_limit)
    figures = report.score_applied(figures, base, recorded.applied)
    derived = report.derived_mass_kg(base, posterior, scene)
    if args.out is not None:
        _draw(args.bag, estimator.results, base, args.out)
    remarks = report.not_measured(recorded.lift)
    if estimator.noise is not None:
        noise_n = estimator.noise.nominal_white_n
        remarks += report.counter_words(estimator.model.bars, recorded.lift, noise_n)
    if args.json:
        learned = report.as_json(figures, estimator.results, derived, estimator.model.winches)
        learned["remarks"] = remarks
        learned["alarm"] = None if alarm is None else alarm.as_json()
        print_json({"bag": str(args.bag), "scene": scene.name, "tared": args.tared} | learned)
        return ExitCode.OK if alarm is None else ExitCode.NEGATIVE
    for problem in recorded.problems:
        print(f"warning: {problem}", file=sys.stderr)
    print_table(report.table(figures))
    if derived:
        print(
            f"with the scene's volume: mass in air {derived['mass_in_air_kg']:.4g} kg, "
            f"added mass {derived['added_mass_kg']:.4g} kg"
        )
    last = estimator.results[-1]
    minutes = len(estimator.results)
    print(f"after {minutes} min; {100.0 * last.used:.0f} % of the last minute's tension used")
    for remark in (*report.left_out_words(last), *remarks):
        print(remark)
    if at_limit:
        print(report.limit_words(at_limit), file=sys.stderr)
    if alarm is not None:
        print(f"fault: {alarm.words}; nothing behind it is learned from", file=sys.stderr)
    return ExitCode.OK if alarm is None else ExitCode.NEGATIVE


def _draw(bag: str, results: Any, base: dict[str, float], picture: Path) -> None:
    """Draw the rope's figures with their 90 % intervals over time."""
    from rope_twin.estimation import report
    from rope_twin.estimation.figures import ROPE_FIGURES
    from rope_twin.studies.picture import Line, Panel, draw_panels

    times, means, sds = report.history(results)
    panels = []
    for k, name in enumerate(ROPE_FIGURES):
        if not base[name]:
            continue
        half = report.NORMAL_90 * sds[:, k]
        panels.append(
            Panel(
                name.replace("_", " "),
                "time [min]",
                "factor on the scene's value [-]",
                (
                    Line(times / 60.0, np.exp(means[:, k]), "mean", "o-"),
                    Line(times / 60.0, np.exp(means[:, k] - half), "90 % interval", "--"),
                    Line(times / 60.0, np.exp(means[:, k] + half), "", "--"),
                ),
            )
        )
    draw_panels(f"Learned from {bag}", panels, picture)
