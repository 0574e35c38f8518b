"""`rope_twin view FILE`: show a recorded bag in rerun, or save it as a recording or picture."""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path
from typing import Any

from rope_twin.cli import ExitCode, print_json
from rope_twin.errors import InputError
from rope_twin.run.options import add_json, add_out, add_time

EXAMPLES = (
    "view lift",
    "view lift --at 98s --out deep_lift.png",
    "view sea_1p2m --out sea.rrd",
)
MORE = """Shows the line in 3-D coloured by tension, tension over depth, the sea surface, and
plots. Opens a window unless --out names a file."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "file",
        metavar="FILE",
        help="bag directory, .mcap file (also one that was cut off), name in bags/, or .rrd file",
    )
    add_out(parser, "FILE", "write a rerun recording (.rrd) or a picture (.png); may be repeated",
            action="append", default=[])  # fmt: skip
    add_time(parser, "--at", "show the bag up to this time after its start")
    add_json(parser)


def run(args: argparse.Namespace) -> int:
    """Show or save the bag. Raises RopeTwinError with one sentence if it cannot be done."""
    save, picture = _outputs(args.out)
    _check(args, save, picture)
    summary: dict[str, Any] = {"file": args.file, "recording": save, "picture": picture}
    with tempfile.TemporaryDirectory(prefix="rope_twin_view_") as folder:
        if Path(args.file).suffix == ".rrd":
            recording = Path(args.file)
        else:
            recording = save or Path(folder) / "view.rrd"
            summary |= _convert(args.file, recording, args.at)
            if not args.json:
                print(f"{args.file}: {summary['messages']} messages, {summary['duration_s']:.1f} s")
        if picture is not None:
            from rope_twin.view.sinks import take_picture

            take_picture(recording, picture)
        if save is None and picture is None:
            _look(recording)
    if args.json:
        print_json(summary)
        return ExitCode.OK
    for kind in ("recording", "picture"):
        if summary[kind] is not None:
            print(f"{kind}: {summary[kind]}")
    return ExitCode.OK


def _outputs(files: list[Path]) -> tuple[Path | None, Path | None]:
    """Return the recording and the picture to write. Raises InputError for another kind."""
    chosen: dict[str, Path] = {}
    for file in files:
        kind = file.suffix.lower()
        if kind not in (".rrd", ".png"):
            raise InputError(f"--out {file}", "unknown file type", "end it in .rrd or .png")
        if kind in chosen:
            raise InputError(f"--out {file}", f"a second {kind} file", "give one of a type")
        chosen[kind] = file
    return chosen.get(".rrd"), chosen.get(".png")


def _check(args: argparse.Namespace, save: Path | None, screenshot: Path | None) -> None:
    """Refuse what is wrong before anything is written."""
    from rope_twin.recording.bag import find_bag
    from rope_twin.view import sinks

    sinks.load_rerun()
    if args.at is not None and not args.at > 0.0:
        raise InputError("--at", f"{args.at:g} s is not a time in the bag", "give a time above 0 s")
    path = Path(args.file)
    if path.suffix != ".rrd":
        find_bag(args.file)
    elif not path.is_file():
        raise InputError(f"file {path}", "it does not exist", "name an .rrd file or a bag")
    elif save is not None or args.at is not None:
        problem = "--at and a recording as --out need the bag"
        raise InputError(f"file {path}", problem, "name the bag of that run")
    elif fault := sinks.recording_fault(path):
        raise InputError(f"file {path}", fault, "name an .rrd file of a run, or a bag")
    missing = ""
    if screenshot is not None:
        missing = sinks.what_a_picture_lacks()
    elif save is None:
        missing = sinks.what_a_window_lacks()
    if missing:
        raise InputError(missing)


def _convert(bag: str, recording: Path, until_s: float | None) -> dict[str, Any]:
    from rope_twin.view.rope_view import RopeView, play
    from rope_twin.view.sinks import FileSink

    view = RopeView(FileSink(recording, footer=True))
    try:
        played = play(bag, view, until_s)
    finally:
        view.close()
    for problem in played.problems:
        print(problem, file=sys.stderr)
    return {
        "messages": played.shown,
        "duration_s": played.duration_s,
        "problems": list(played.problems),
    }


def _look(recording: Path) -> None:
    """Open a window and return when it is closed."""
    from rope_twin.view import sinks

    viewer = sinks.start_viewer(str(recording), "--port", str(sinks.free_port()))
    try:
        viewer.wait()
    finally:
        viewer.terminate()
