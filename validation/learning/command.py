"""`python -m validation --learning [SCENE...]`: what the estimator learns of hidden truths."""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from typing import Any

from rope_twin.cli import CaseProgress, print_table
from rope_twin.errors import InputError
from rope_twin.scene.load import load_scene
from validation.learning.campaign import (
    COVERAGE_RANGE,
    GOALS,
    VARIANTS,
    Run,
    as_json,
    core_pct,
    reached_minutes,
    run_campaign,
    summarise,
)

SCENE, SEA = "deep_lift", "sea_2p5m"
TRUTHS, MINUTES = 48, 10
SHOWN = "submerged_weight", "oscillating_mass", "payload_drag", "axial_stiffness", "axial_damping"
MAX_CORE_PCT = 1.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the campaign."""
    add = parser.add_argument
    add("--learning", action="store_true",
        help="in place of the cases: the estimator on hidden truths; IDs are scenes "
             f"(default: {SCENE})")  # fmt: skip
    add("--truths", type=int, default=TRUTHS, metavar="N",
        help="number of truths, half of them with a tared pin (default: %(default)s)")  # fmt: skip
    add("--minutes", type=int, default=MINUTES, metavar="N",
        help="minutes of measurement (default: %(default)s)")  # fmt: skip
    add("--sea", default=SEA, metavar="BAG", help="recorded sea (default: %(default)s)")
    add("--variants", action="store_true",
        help="the tared truths also with spikes, with missing data, and with both")  # fmt: skip
    add("--tared-only", action="store_true", help="no truths whose load pin is not tared")


def run(args: argparse.Namespace) -> int:
    """Run the campaign and print medians of errors and coverage; 1 if a goal is missed.

    Raises:
        RopeTwinError: a scene or sea that cannot be.
    """
    if args.truths < 2 or not 1 <= args.minutes <= 60:
        problem = f"{args.truths} truths, {args.minutes} minutes"
        raise InputError("--learning", problem, "give 2 truths or more, 1 to 60 minutes")
    results: dict[str, Any] = {}
    met = True
    for name in args.ids or [SCENE]:
        scene = load_scene(name)
        for tared in (True,) if args.tared_only else (True, False):
            progress = CaseProgress()
            count = args.truths if args.tared_only else args.truths // 2
            variants = tuple(VARIANTS) if args.variants and tared else ("clean",)
            runs = run_campaign(scene, args.sea, count, tared, args.minutes, variants,
                                progress.show)  # fmt: skip
            for variant, some in runs.items():
                title = f"{name}, {args.sea}, {'tared' if tared else 'not tared'}, {variant}"
                results[title] = as_json(some)
                if not args.json:
                    _print(title, some)
                goals = GOALS if name == SCENE and tared and variant == "clean" else ()
                met = _judge(some, goals, quiet=args.json) and met
    if args.json:
        print(json.dumps(results, indent=1, allow_nan=False))
    return 0 if met else 1


def _print(title: str, runs: list[Run]) -> None:
    print(f"{title}: {len(runs)} truths, {core_pct(runs):.2f} % of a core")
    rows: list[tuple[str, ...]] = [
        ("after", *(f"{name} %" for name in SHOWN), "coverage %", "NEES/7")
    ]
    for minutes in reached_minutes(runs):
        summary = summarise(runs, minutes)
        errors = (
            f"{summary.median_error_pct[name]:.2f} (sd {summary.sd_pct[name]:.2f})"
            for name in SHOWN
        )
        rows.append(
            (f"{minutes} min", *errors, f"{100.0 * summary.coverage:.0f}", f"{summary.nees:.2f}")
        )
    print_table(rows)
    print(flush=True)


def _judge(runs: list[Run], goals: Sequence[tuple[str, int, float]], quiet: bool) -> bool:
    """Return whether goals on errors, coverage and CPU are met, and print each.

    goals: figure, minutes and limit of its median error [%].
    """
    reached = reached_minutes(runs)
    verdicts = []
    for name, minutes, limit in goals:
        if minutes in reached:
            error = summarise(runs, minutes).median_error_pct[name]
            verdict = f"{name} after {minutes} min: {error:.2f} % (limit {limit:g} %)"
            verdicts.append((verdict, error <= limit))
    low, high = COVERAGE_RANGE
    for minutes in (1, 5, 10):
        if minutes in reached:
            share = summarise(runs, minutes).coverage
            verdict = f"coverage of 90 % intervals after {minutes} min: {100.0 * share:.0f} %"
            verdicts.append((f"{verdict} ({100 * low:.0f} to {100 * high:.0f} %)",
                             low <= share <= high))  # fmt: skip
    cost = core_pct(runs)
    verdicts.append((f"CPU: {cost:.2f} % of a core (limit {MAX_CORE_PCT:g} %)",
                     cost <= MAX_CORE_PCT))  # fmt: skip
    if not quiet:
        for verdict, met in verdicts:
            print(f"{'met   ' if met else 'MISSED'}  {verdict}")
    return all(met for _, met in verdicts)
