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
    parser.add_argument(
        "file",
        metavar="FILE",
        help="bag directory, .mcap file (also one that was cut off), name in bags/, or an .rrd "
        "file of a run",
    )
    parser.add_argument("--save", type=Path, metavar="OUT.rrd", help="write a rerun recording")
    parser.add_argument("--screenshot", type=Path, metavar="OUT.png", help="make a picture")
    parser.add_argument(
        "--at", type=float, metavar="SECONDS", help="show the bag up to this time after its start"
    )
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Raises RopeTwinError with one sentence if it cannot be done."""
    _check(args)
    with tempfile.TemporaryDirectory(prefix="rope_twin_view_") as folder:
        if Path(args.file).suffix == ".rrd":
            recording = Path(args.file)
        else:
            recording = args.save or Path(folder) / "view.rrd"
            _convert(args.file, recording, args.at)
            if args.save is not None:
                print(f"saved {args.save}")
        if args.screenshot is not None:
            from rope_twin.view.picture import take_picture

            take_picture(recording, args.screenshot)
            print(f"picture {args.screenshot}")
        if args.save is None and args.screenshot is None:
            _look(recording)
    return 0


def _check(args: argparse.Namespace) -> None:
    """Everything that can be wrong before anything is written."""
    from rope_twin.recording.bag_reader import find_bag
    from rope_twin.view import picture, sinks

    sinks.load_rerun()
    if args.at is not None and not args.at > 0.0:
        raise InputError(phrase("--at", f"{args.at:g} is no time in the bag", "seconds above 0"))
    if args.screenshot is not None and args.screenshot.suffix.lower() != ".png":
        raise InputError(
            phrase(f"--screenshot {args.screenshot}", "pictures are PNG", "end it in .png")
        )
    path = Path(args.file)
    if path.suffix != ".rrd":
        find_bag(args.file)
    elif not path.is_file():
        raise InputError(phrase(f"file {path}", "it does not exist", "name an .rrd file or a bag"))
    elif args.save is not None or args.at is not None:
        raise InputError(
            phrase(f"file {path}", "--save and --at need the bag", "name the bag of that run")
        )
    elif fault := sinks.recording_fault(path):
        raise InputError(phrase(f"file {path}", fault, "name an .rrd file of a run, or a bag"))
    missing = ""
    if args.screenshot is not None:
        missing = picture.what_a_picture_lacks()
    elif args.save is None:
        missing = sinks.what_a_window_lacks()
    if missing:
        raise InputError(missing)


def _convert(bag: str, recording: Path, until_s: float | None) -> None:
    from rope_twin.view import view_bag
    from rope_twin.view.rope_view import RopeView
    from rope_twin.view.sinks import FileSink

    view = RopeView(FileSink(recording, footer=True))
    try:
        played = view_bag.play(bag, view, until_s)
    finally:
        view.close()
    for problem in played.problems:
        print(problem, file=sys.stderr)
    print(f"{bag}: {played.shown} messages, {played.duration_s:.1f} s")


def _look(recording: Path) -> None:
    """Opens a window and returns when it is closed."""
    from rope_twin.view import sinks

    viewer = sinks.start_viewer(str(recording), "--port", str(sinks.free_port()))
    try:
        viewer.wait()
    finally:
        viewer.terminate()
