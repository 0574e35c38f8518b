"""`rope_twin console`: the operator console to a running suite, or to a recorded bag."""

from __future__ import annotations

import argparse
import signal
import sys
import time
from collections.abc import Callable
from contextlib import closing

from rope_twin.cli import ExitCode, print_json
from rope_twin.console.server import announce
from rope_twin.errors import InputError
from rope_twin.run.options import CONSOLE, add_json
from rope_twin.run.progress import StopSignal

EXAMPLES = (
    "console",
    "console --control",
    "console lift",
    "console --terminal",
)
MORE = """Opens a page for any browser: line out, speed, tension with its limits and trend, payload,
winch, quality and diagnostics. With BAG it plays a recorded run for debriefing. It is served to
this machine only, unless --address names another, and is read-only unless --control is given.
With --terminal it shows the first page's numbers, trend and alerts in the terminal, as over SSH."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
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
        return announce

    def print_object(address: str, token: str) -> None:
        print_json({"address": address, "token": token or None})
        sys.stdout.flush()

    return print_object


def run(args: argparse.Namespace) -> int:
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
    from rope_twin.ros.entry import keep_to_loopback, run_node
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
    from rope_twin.console.control import Desk
    from rope_twin.console.pages import Pages
    from rope_twin.console.playback import Recording, connect_playback
    from rope_twin.console.requests import session_facts
    from rope_twin.ros.console_node import suite_source
    from rope_twin.ros.entry import keep_to_loopback

    stop = StopSignal(signal.SIG_DFL)
    try:
        if args.bag is None and not args.network:
            keep_to_loopback()
        with suite_source() if args.bag is None else closing(Recording(args.bag)) as source:
            pages = Pages(source, time.monotonic, read_session=session_facts)
            if isinstance(source, Recording):
                connect_playback(source, pages, Desk(pages, time.monotonic))
            TerminalConsole(pages, stopped=lambda: stop.requested).run()
    finally:
        stop.restore()
    return ExitCode.OK


def _recorded(args: argparse.Namespace) -> int:
    from rope_twin.console.control import Desk
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
        desk = Desk(pages, time.monotonic)
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
