"""`rope_twin operability LIMITS HINDCAST`: share of time within limits, windows and waiting."""

from __future__ import annotations

import argparse
from pathlib import Path

from rope_twin.cli import Command, ExitCode, print_json, print_table
from rope_twin.planning.operability import (
    PERCENTILES,
    Operability,
    Operation,
    Spread,
    figures,
    hours_text,
    operability,
    panels,
    table_rows,
)
from rope_twin.planning.weather_files import (
    AlphaTable,
    read_alpha,
    read_hindcast,
    read_limits,
    read_spectra,
)
from rope_twin.run.options import add_json, add_time, measure
from rope_twin.studies.picture import check_picture, draw_panels

EXAMPLES = (
    "operability limits.csv hindcast.csv --planned-period 8h",
    "operability limits.csv era5.csv --planned-period 8h --alpha alpha.csv --bow 45",
    "operability limits.json era5.csv --planned-period 12h --relative 180 --picture months.png",
)
MORE = """Compares a hindcast (time, hs_m, tp_s, direction_from_deg or direction_to_deg) with
limiting significant wave heights over Tp, heading and phase (phase, tp_s, heading_deg, limit_hs_m).
A start is possible if the hindcast stays within alpha times the limit for T_R, the planned period
and the contingency. Waiting is that for the next possible start, from every time of the
hindcast."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("limits", metavar="LIMITS", type=Path, help="limiting Hs over Tp, CSV or JSON")
    add("hindcast", metavar="HINDCAST", type=Path, help="time series of sea states, CSV")
    help_text = (
        "read HINDCAST as spectra with this reader of wavespectra, such as era5, ww3 or ndbc"
    )
    add("--reader", metavar="NAME", help=help_text)
    help_text = "planned operation period T_POP"
    add("--planned-period", type=measure("s"), required=True, metavar="TIME", help=help_text)
    add_time(parser, "--contingency", "contingency time (default: as long as the planned period)")
    help_text = "alpha factors with their source, CSV (default: 1, no uncertainty of the forecast)"
    add("--alpha", type=Path, metavar="CSV", help=help_text)
    help_text = "phases that must be within their limits (default: all)"
    add("--phase", nargs="+", default=(), metavar="NAME", help=help_text)
    heading = parser.add_mutually_exclusive_group()
    help_text = "compass heading of the bow, clockwise from north"
    heading.add_argument("--bow", type=float, metavar="DEG", help=help_text)
    help_text = "heading of the waves that the vessel keeps: 0 following seas, 180 head seas"
    heading.add_argument("--relative", type=float, metavar="DEG", help=help_text)
    add("--picture", type=Path, metavar="PNG", help="draw shares and waiting by month")
    add_json(parser)


def run(args: argparse.Namespace) -> int:
    """Print the operability and return the exit code. Raises RopeTwinError."""
    if args.picture is not None:
        check_picture(args.picture)
    contingency = args.planned_period if args.contingency is None else args.contingency
    operation = Operation(args.planned_period, contingency, args.bow, args.relative)
    limits = read_limits(args.limits)
    if args.phase:
        limits = limits.only(args.phase)
    alpha = None if args.alpha is None else read_alpha(args.alpha)
    if args.reader is None:
        hindcast = read_hindcast(args.hindcast)
    else:
        hindcast = read_spectra(args.hindcast, args.reader)
    result = operability(hindcast, limits, operation, alpha)
    if args.picture is not None:
        draw_panels(f"{args.hindcast.name}, limits of {args.limits.name}", panels(result),
                    args.picture)  # fmt: skip
    if args.json:
        source = None if alpha is None else alpha.source
        print_json(figures(result) | {"alpha_source": source, "phases": list(limits.phases)})
    else:
        _show(result, alpha)
    return ExitCode.OK


def _show(result: Operability, alpha: AlphaTable | None) -> None:
    operation = result.operation
    print(
        f"T_R               {hours_text(operation.reference_s)} h: "
        f"planned {hours_text(operation.planned_s)} h "
        f"and contingency {hours_text(operation.contingency_s)} h"
    )
    if alpha is None:
        print("alpha             1, no uncertainty of the forecast")
    else:
        low, high = result.alpha
        print(f"alpha             {low:.3g} to {high:.3g}, {alpha.source}")
    print(f"hindcast          {result.years:.3g} years, every {hours_text(result.step_s)} h")
    for share, remark in ((result.missing, "of the time has no row, and counts as above the limit"),
                         (result.heading_not_covered, "of the rows has a heading that the limits "
                          "do not cover, and counts as above them"),
                         (result.not_covered, "of the rows has a Tp that the limits do not cover, "
                          "and counts as above them"),
                         (result.without_alpha, "of the rows is within a limit below the alpha "
                          "factors, and counts as above alpha times the limit")):  # fmt: skip
        if share > 0.0:
            print(f"warning: {100.0 * share:.3g} % {remark}")
    for name, share in result.phases.items():
        print(f"within limit      {100.0 * share:.1f} % of the time, phase {name}")
    print(f"calm spells       {_words(result.calm)}")
    print(f"storms            {_words(result.storm)}\n")
    print_table(table_rows(result))


def _words(spread: Spread) -> str:
    parts = (
        f"P{p:.0f} {hours_text(percentile_s)} h"
        for p, percentile_s in zip(PERCENTILES, spread.percentiles_s, strict=True)
    )
    return f"mean {hours_text(spread.mean_s)} h, {', '.join(parts)}"


COMMANDS = {"operability": Command(add_arguments, run, EXAMPLES, MORE)}
