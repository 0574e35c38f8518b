"""`rope_twin recover`: save what is left of a bag whose recording was cut off."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from rope_twin.errors import BagError
from rope_twin.recording.recover import Outcome, Recovery, recover


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the subcommand."""
    parser = subparsers.add_parser(
        "recover",
        help="save what is left of a bag that was cut off",
        description="Reads a bag up to its break and writes a whole one beside it. "
        "Exit code 0: nothing was lost, 3: something was, 1: there was nothing to save.",
    )
    parser.add_argument("bag", metavar="BAG", type=Path, help="bag directory or .mcap file")
    parser.add_argument(
        "--out", metavar="DIR", type=Path, help="the new bag (default: BAG_recovered)"
    )
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Recover, tell, and return the exit code."""
    try:
        result = recover(args.bag, args.out)
    except BagError as error:
        print(error, file=sys.stderr)
        return int(Outcome.NOTHING)
    _tell(args.bag, result)
    return int(result.outcome)


def _tell(bag: Path, result: Recovery) -> None:
    if result.directory is None:
        print(f"{bag}: nothing could be recovered")
    else:
        total = sum(result.counts.values())
        print(f"{bag}: {total} messages recovered into {result.directory}")
        for name, count in result.counts.items():
            print(f"  {name:<24} {count:>8}")
        span_s = (result.end_ns - result.start_ns) * 1e-9
        print(f"  over {span_s:.3f} s, until {result.end_ns * 1e-9:.3f} (ROS time)")
    for sentence in result.lost:
        print(f"  lost: {sentence}")
    for sentence in result.remarks:
        print(f"  note: {sentence}")
