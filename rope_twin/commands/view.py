"""rope_twin view: opens a recorded bag in rerun, or makes a file or a picture of it."""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path
from typing import Any

from rope_twin.errors import InputError, phrase


def add_parser(subparsers: Any) -> None:
    """Adds `view` to the command line."""
    parser = subparsers.add_parser(
        "view",
        help="open a recorded bag in rerun",
        description="Shows a recorded bag: the rope in 3-D coloured by tension, tension over "
        "depth, the sea surface, and plots. Opens a window unless a file is asked for.",
    )
    parser.add_argument("file", metavar="FILE", help="bag directory, .mcap file or name in bags/")
    parser.add_argument("--save", type=Path, metavar="OUT.rrd", help="write a rerun recording")
    parser.add_argument("--screenshot", type=Path, metavar="OUT.png", help="make a picture")
    parser.add_argument(
        "--at", type=float, metavar="SECONDS", help="show the bag up to this time after its start"
    )
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Raises RopeTwinError with one sentence if it cannot be done."""
    from rope_twin.recording.bag_reader import find_bag
    from rope_twin.view import picture, sinks, view_bag
    from rope_twin.view.rope_view import RopeView

    sinks.load_rerun()
    wants_window = args.save is None and args.screenshot is None
    missing = sinks.what_a_window_lacks() if wants_window else ""
    if args.screenshot is not None:
        missing = picture.what_a_picture_lacks()
    if missing:
        raise InputError(missing)
    if args.at is not None and not args.at > 0.0:
        raise InputError(phrase("--at", f"{args.at:g} is no time in the bag", "seconds above 0"))
    find_bag(args.file)  # before anything is written
    with tempfile.TemporaryDirectory(prefix="rope_twin_view_") as folder:
        recording = args.save or Path(folder) / "view.rrd"
        view = RopeView(sinks.FileSink(recording, footer=True))
        try:
            played = view_bag.play(args.file, view, args.at)
        finally:
            view.close()
        for problem in played.problems:
            print(problem, file=sys.stderr)
        print(f"{args.file}: {played.shown} messages, {played.duration_s:.1f} s")
        if args.save is not None:
            print(f"saved {args.save}")
        if args.screenshot is not None:
            picture.take_picture(recording, args.screenshot)
            print(f"picture {args.screenshot}")
        if wants_window:
            _look(recording)
    return 0


def _look(recording: Path) -> None:
    """Opens a window and returns when it is closed."""
    from rope_twin.view import sinks

    viewer = sinks.start_viewer(str(recording), "--port", str(sinks.free_port()))
    try:
        viewer.wait()
    finally:
        viewer.terminate()
