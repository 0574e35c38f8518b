"""`rope_twin export BAG --out FILE`: time series of a run for other programs."""

from __future__ import annotations

import argparse
import sys

from rope_twin.cli import ExitCode, print_json
from rope_twin.recording.series_export import SERIES, check_ending, read_series, write_series
from rope_twin.run.options import add_json, add_out

EXAMPLES = (
    "export lift --out lift.csv",
    "export lift --out lift.parquet --topics ropes/tension_top payloads/state",
    "export lift --out lift.nc --json",
)
MORE = """Writes a row for each stamp and a column for each number (topic/name/quantity_unit) as
CSV, Parquet or netCDF by the ending of --out: pandas.read_csv, pandas.read_parquet and
xarray.open_dataset read them. Numbers that a topic does not have at a stamp are empty."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("bag", metavar="BAG", help="a name in bags/ or a path")
    add_out(parser, "FILE", "table to write: .csv, .parquet or .nc", required=True)
    help_text = f"topics to export, of {', '.join(SERIES)} (default: all that are there)"
    parser.add_argument("--topics", nargs="+", default=(), metavar="TOPIC", help=help_text)
    add_json(parser)


def run(args: argparse.Namespace) -> int:
    """Write the table and return the exit code. Raises RopeTwinError."""
    check_ending(args.out)
    table = read_series(args.bag, args.topics)
    write_series(table, args.out)
    for problem in table.problems:
        sys.stderr.write(f"warning: {problem}\n")
    rows, end = len(table.time_s), float(table.time_s[-1])
    if args.json:
        summary = {"file": args.out, "rows": rows, "end_s": end, "columns": list(table.columns)}
        print_json(summary | {"problems": list(table.problems)})
    else:
        print(f"{args.out}: {rows} rows to {end:.3f} s, {len(table.columns)} columns")
    return ExitCode.OK
