"""`rope_twin recover BAG`: recover the messages of a bag whose recording was cut off."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from rope_twin.cli import print_json
from rope_twin.recording.recover import Recovery, recover
from rope_twin.run.options import add_json, add_out

EXAMPLES = (
    "recover lift",
    "recover lift/lift_0.mcap --out lift_whole",
)
MORE = "Reads a bag up to the damage and writes a valid one beside it."


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("bag", metavar="BAG", type=Path, help="bag directory or .mcap file")
    add_out(parser, "DIR", "bag directory to create (default: BAG_recovered)")
    add_json(parser)


def run(args: argparse.Namespace) -> int:
    """Recover the bag and report; return the exit code. Raises BagError."""
    result = recover(args.bag, args.out)
    if args.json:
        print_json(_figures(args.bag, result))
    else:
        _report(args.bag, result)
    return result.outcome


def _figures(bag: Path, result: Recovery) -> dict[str, Any]:
    return {
        "bag": bag,
        "outcome": result.outcome.name.lower(),
        "directory": result.directory,
        "messages": result.counts,
        "start_ns": result.start_ns,
        "end_ns": result.end_ns,
        "lost": result.lost,
        "notes": result.remarks,
    }


def _report(bag: Path, result: Recovery) -> None:
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
