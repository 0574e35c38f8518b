"""Commands that show a run: `view` in rerun, `console` in a browser or terminal."""

from __future__ import annotations

import argparse
import signal
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

from rope_twin.cli import Command, ExitCode, print_json
from rope_twin.errors import InputError
from rope_twin.files import written_whole
from rope_twin.run.options import CONSOLE, add_json, add_out, add_time
from rope_twin.run.progress import StopSignal

VIEW_EXAMPLES = (
    "view lift",
    "view lift --at 98s --out deep_lift.png",
    "view sea_1p2m --out sea.rrd",
)
VIEW_MORE = """Shows the line in 3-D coloured by tension, tension over depth, the sea surface, and
plots. Opens a window unless --out names a file."""


def _add_view(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "file",
        metavar="FILE",
        help="bag directory, .mcap file (also one that was cut off), name in bags/, or .rrd file",
    )
    add_out(parser, "FILE", "write a rerun recording (.rrd) or a picture (.png); may be repeated",
            action="append", default=[])  # fmt: skip
    add_time(parser, "--at", "show the bag up to this time after its start")
    add_json(parser)


def _run_view(args: argparse.Namespace) -> int:
    """Show or save the bag. Raises RopeTwinError with one sentence if it cannot be done."""
    save, picture = _outputs(args.out)
    _check_view(args, save, picture)
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
            _show(recording)
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


def _check_view(args: argparse.Namespace, save: Path | None, screenshot: Path | None) -> None:
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
    from rope_twin.view.sinks import FileSink, unwritten

    try:
        with written_whole(recording) as part:
            view = RopeView(FileSink(recording, footer=True, part=part))
            try:
                played = play(bag, view, until_s)
            finally:
                view.close()
    except OSError as error:
        raise unwritten(recording, error.strerror or str(error)) from error
    for problem in played.problems:
        print(problem, file=sys.stderr)
    return {
        "messages": played.shown,
        "duration_s": played.duration_s,
        "problems": list(played.problems),
    }


def _show(recording: Path) -> None:
    """Open a window and return when it is closed."""
    from rope_twin.view import sinks

    viewer = sinks.start_viewer(str(recording), "--port", str(sinks.free_port()))
    try:
        viewer.wait()
    finally:
        viewer.terminate()


CONSOLE_EXAMPLES = (
    "console",
    "console --control",
    "console lift",
    "console --terminal",
)
CONSOLE_MORE = """\
Opens a page for any browser: line out, speed, tension with its limits and trend, payload,
winch, quality and diagnostics. With BAG it plays a recorded run for debriefing. It is served to
this machine only, unless --address names another, and is read-only unless --control is given.
With --terminal it shows the first page's numbers, trend and alerts in the terminal, as over SSH."""


def _add_console(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("bag", nargs="?", metavar="BAG", help="recorded run to play (default: the running suite)")
    add(
        "--address",
        default=CONSOLE,
        metavar="HOST:PORT",
        help=f"where to serve the page (default: {CONSOLE})",
    )
    add(
        "--control",
        action="store_true",
        help="let pages command the winch after they have given the token that is printed",
    )
    add(
        "--terminal",
        action="store_true",
        help="show the first page in this terminal, read-only, and serve nothing",
    )
    add(
        "--network",
        action="store_true",
        help="find a suite on other machines too (default: this machine only)",
    )
    help_text = (
        "load_chart.json of `rope_twin plan`: pages show what it allows in the sea entered there"
    )
    add("--load-chart", default="", metavar="FILE", help=help_text)
    add_json(parser)


def _announce(args: argparse.Namespace) -> Callable[[str, str], None]:
    """Return what prints address and token, as text or as JSON."""
    if not args.json:
        from rope_twin.console.server import announce

        return announce

    def print_object(address: str, token: str) -> None:
        print_json({"address": address, "token": token or None})
        sys.stdout.flush()

    return print_object


def _run_console(args: argparse.Namespace) -> int:
    """Serve until Ctrl-C, and return the exit code. Raises RopeTwinError."""
    if args.terminal:
        return _terminal(args)
    if args.bag is None:
        return _live(args)
    if args.control:
        problem = "a recorded run has no winch to command"
        raise InputError("--control", problem, "leave it out, or leave BAG out")
    return _recorded(args)


def _live(args: argparse.Namespace) -> int:
    from rope_twin.ros.console_node import ConsoleNode
    from rope_twin.ros.entry import run_node
    from rope_twin.ros.middleware import keep_to_loopback
    from rope_twin.ros.params import overrides

    if not args.network:
        keep_to_loopback()
    parameters = overrides(
        {"address": args.address, "control": args.control, "load_chart": args.load_chart}
    )
    tell = _announce(args)
    return run_node(lambda: ConsoleNode(tell, parameter_overrides=parameters), ["rope_twin"])


def _terminal(args: argparse.Namespace) -> int:
    """Show the console in the terminal. Raises RopeTwinError."""
    named = {
        "--control": args.control, "--json": args.json, "--load-chart": args.load_chart,
        "--address": args.address != CONSOLE,
    }  # fmt: skip
    if option := next((name for name, present in named.items() if present), ""):
        problem = "the terminal console only shows, and serves no page"
        raise InputError(f"--terminal {option}", problem, f"leave {option} out")
    if not (sys.stdin.isatty() and sys.stdout.isatty()):
        problem = "standard input and output are no terminal"
        raise InputError("--terminal", problem, "run it in one, over SSH with `ssh -t`")
    try:
        from rope_twin.console.terminal import TerminalConsole
    except ImportError as error:
        remedy = "install it with `pip install 'rope_twin[console]'`"
        raise InputError("--terminal", f"{error.name} is not installed", remedy) from error
    from rope_twin.console.control import RequestHandler
    from rope_twin.console.pages import Pages
    from rope_twin.console.playback import Recording, connect_playback
    from rope_twin.console.requests import session_facts
    from rope_twin.ros.console_node import suite_source
    from rope_twin.ros.middleware import keep_to_loopback

    stop = StopSignal(signal.SIG_DFL)
    try:
        if args.bag is None and not args.network:
            keep_to_loopback()
        with suite_source() if args.bag is None else closing(Recording(args.bag)) as source:
            pages = Pages(source, time.monotonic, read_session=session_facts)
            if isinstance(source, Recording):
                connect_playback(source, pages, RequestHandler(pages, time.monotonic))
            TerminalConsole(pages, stopped=lambda: stop.requested).run()
    finally:
        stop.restore()
    return ExitCode.OK


def _recorded(args: argparse.Namespace) -> int:
    from rope_twin.console.control import RequestHandler
    from rope_twin.console.pages import Pages
    from rope_twin.console.playback import Recording, connect_playback
    from rope_twin.console.requests import Log, SeaLimits, session_facts
    from rope_twin.console.server import Server, read_address
    from rope_twin.scene.load_chart import read_load_chart

    host, port = read_address(args.address)
    stop = StopSignal(signal.SIG_DFL)
    source = Recording(args.bag)
    try:
        pages = Pages(source, time.monotonic, read_session=session_facts)
        desk = RequestHandler(pages, time.monotonic)
        connect_playback(source, pages, desk)
        if args.load_chart:
            chart = read_load_chart(args.load_chart)
            SeaLimits(pages, chart, time.monotonic).connect(desk)
        log = Log(pages)
        log.connect(desk)
        server = Server(pages, desk, log, host, port)
        server.start()
        _announce(args)(server.address, "")
        while not stop.requested:
            time.sleep(0.1)
        server.close()
    finally:
        source.close()
        stop.restore()
    return ExitCode.OK


COMMANDS = {
    "view": Command(_add_view, _run_view, VIEW_EXAMPLES, VIEW_MORE),
    "console": Command(_add_console, _run_console, CONSOLE_EXAMPLES, CONSOLE_MORE),
}
