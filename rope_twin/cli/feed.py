"""`rope_twin feed`: read line monitors and motion sensors, publish them, or play them."""

from __future__ import annotations

import argparse
import math
import queue
import sys
import time
from typing import Any

from rope_twin.cli import Command, ExitCode, print_json
from rope_twin.errors import InputError, counted, phrase
from rope_twin.feeds.configuration import FeedSettings, read_settings, with_source
from rope_twin.feeds.instrument import Instrument, LineSample, Sample
from rope_twin.feeds.line_faults import LineFaults, read_faults, replay_with_faults
from rope_twin.feeds.readings import clock_of
from rope_twin.feeds.transports import Source, hand_over, open_source
from rope_twin.run.options import add_duration, add_json
from rope_twin.run.progress import StopSignal

_POLL_S = 0.1
EXAMPLES = (
    "feed udp://0.0.0.0:6224 --settings lci90i_pounds --publish",
    "feed serial:/dev/ttyUSB0@9600 --settings tss1 --duration 1min --json",
    "feed udp://127.0.0.1:6224 --settings lci90i_pounds --simulate",
    "feed winch.log --settings lci90i_pounds --speed 0 --faults lost:0.01,cut:0.01,delayed:0.2s",
)
MORE = """Reads the lines of instruments and prints what they mean in SI units, or publishes it
for the simulation with --publish. A settings file (a name in config/feeds/ or a path) states
format, units and signs of each instrument; none of them has a default. Lines that are cut, wrong or
impossible are refused and counted by reason.

SOURCE is a FILE, udp://HOST:PORT (a multicast group is joined), tcp://HOST:PORT or
serial:DEVICE@BAUD; without it that of the settings. A file is replayed at the pace of the times in
it.

With --simulate winch and ship of a running simulation are sent to SOURCE as such lines. --faults
lays faults over the lines of a file, or over those sent: the share of lines that are lost, doubled,
cut, garbled (a byte is another) or delayed (delayed:0.01:0.2s is one in a hundred by 0.2 s)."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("source", metavar="SOURCE", nargs="?", default="", help="source of lines")
    parser.add_argument(
        "--settings", metavar="NAME", required=True, help="a name in config/feeds/ or a YAML file"
    )
    parser.add_argument(
        "--feed", metavar="NAME", default="", help="feed of the settings, if several"
    )
    ways = parser.add_mutually_exclusive_group()
    ways.add_argument("--publish", action="store_true", help="publish on ROS topics")
    ways.add_argument(
        "--simulate", action="store_true", help="send a running simulation as such lines"
    )
    parser.add_argument(
        "--speed", type=float, default=1.0, metavar="X",
        help="of a file over its own pace; 0: as fast as possible (default: 1)",
    )  # fmt: skip
    parser.add_argument(
        "--faults", default="", metavar="LIST",
        help="as lost:0.01,doubled:0.01,cut:0.01,garbled:0.01,delayed:0.01:0.2s,seed:1",
    )  # fmt: skip
    add_duration(parser, "stop after this real time")
    add_json(parser)


def run(args: argparse.Namespace) -> int:
    """Read, publish or simulate; return the exit code. Raises RopeTwinError."""
    if not (math.isfinite(args.speed) and 0.0 <= args.speed <= 1000.0):
        raise InputError("--speed", f"{args.speed:g}", "it must be 0 to 1000")
    if args.duration is not None and not 0.0 < args.duration <= 1e7:
        raise InputError("--duration", f"{args.duration:g} s", "it must be above 0")
    faults = read_faults(args.faults)
    if args.publish or args.simulate:
        return _run_node(args)
    feeds = read_settings(args.settings)
    if args.feed or args.source:
        feeds = with_source(feeds, args.source, args.feed)
    return _print(feeds, args, faults)


def _run_node(args: argparse.Namespace) -> int:
    from rope_twin.ros.entry import run_node
    from rope_twin.ros.feed_node import FeedNode, FeedSimulator
    from rope_twin.ros.middleware import keep_to_loopback
    from rope_twin.ros.params import overrides

    keep_to_loopback()
    parameters = {
        "settings": args.settings,
        "feed": args.feed,
        "source": args.source,
        "speed": args.speed,
        "faults": args.faults,
        "stop_after_s": args.duration or 0.0,
    }
    nodes: list[Any] = []

    def make() -> Any:
        kind = FeedSimulator if args.simulate else FeedNode
        nodes.append(kind(parameter_overrides=overrides(parameters)))
        return nodes[0]

    code = run_node(make, ["feed"])
    figures = nodes[0].figures() if nodes else {}
    if args.json and nodes:
        print_json(figures)
    accepted = all(feed["accepted"] for feed in figures.get("feeds", {}).values())
    return code if accepted else ExitCode.ERROR


def _print(feeds: dict[str, FeedSettings], args: argparse.Namespace, faults: LineFaults) -> int:
    """Print the samples of all feeds as they come, then the counts."""
    pieces: queue.Queue[tuple[str, bytes, int, bool]] = queue.Queue(10_000)
    instruments: dict[str, Instrument] = {}
    sources: dict[str, Source] = {}
    for number, (name, settings) in enumerate(feeds.items()):
        if not settings.source:
            raise InputError(f"feed '{name}'", "it has no source", "name one")
        instruments[name] = Instrument(settings)

        def take(data: bytes, arrival_ns: int, complete: bool, name: str = name) -> None:
            hand_over(pieces, (name, data, arrival_ns, complete), sources[name])

        replayed = replay_with_faults(take, faults, settings, number)
        sources[name] = open_source(settings, replayed, args.speed)
    last: dict[str, Sample] = {}
    stop = StopSignal()
    end_s = math.inf if args.duration is None else time.monotonic() + args.duration
    for source in sources.values():
        source.start()
    try:
        while not stop.requested and time.monotonic() < end_s:
            ended = all(source.ended for source in sources.values())
            try:
                name, data, arrival_ns, complete = pieces.get(not ended, _POLL_S)
            except queue.Empty:
                if ended:
                    break
                continue
            for sample in instruments[name].take(data, arrival_ns, complete):
                last[name] = sample
                if not args.json:
                    print(f"{clock_of(sample.stamp_ns):%H:%M:%S.%f}  {name}  {_words(sample)}")
    finally:
        for source in sources.values():
            source.close()
        stop.restore()
    figures = {
        name: _figures(instrument, last.get(name)) for name, instrument in instruments.items()
    }
    if args.json:
        print_json({"feeds": figures})
    for name, instrument in instruments.items():
        if not args.json:
            print(f"{name}: {_counts_words(instrument)}", file=sys.stderr)
        if fault := sources[name].fault:
            print(phrase(feeds[name].source, fault, "check the connection"), file=sys.stderr)
    return (
        ExitCode.OK
        if all(instrument.counts.accepted for instrument in instruments.values())
        else ExitCode.ERROR
    )


def _words(sample: Sample) -> str:
    parts: tuple[tuple[str, float, str, str], ...]
    if isinstance(sample, LineSample):
        parts = (
            ("line out", sample.payout_m, "m", ".2f"),
            ("speed", sample.speed_m_per_s, "m/s", "+.3f"),
            ("tension", sample.tension_n, "N", ".0f"),
            ("motor tension", sample.motor_tension_n, "N", ".0f"),
        )
    else:
        parts = (
            ("heave", sample.heave_m, "m", "+.3f"),
            ("rate", sample.heave_rate_m_per_s, "m/s", "+.3f"),
            ("roll", math.degrees(sample.roll_rad), "°", "+.2f"),
            ("pitch", math.degrees(sample.pitch_rad), "°", "+.2f"),
            ("heading", sample.heading_deg, "°", ".2f"),
        )
    return "  ".join(
        f"{quantity} {value + 0.0:{form}} {unit}"
        for quantity, value, unit, form in parts
        if not math.isnan(value)
    )


def _figures(instrument: Instrument, last: Sample | None) -> dict[str, Any]:
    counts = instrument.counts
    return {
        "source": instrument.settings.source,
        "format": instrument.settings.format,
        **counts.figures(),
        "last": None if last is None else vars(last),
    }


def _counts_words(instrument: Instrument) -> str:
    counts = instrument.counts
    words = f"{counts.lines} lines, {counts.accepted} accepted, {counts.refused_total} refused"
    reasons = ", ".join(f"{number} {reason}" for reason, number in counts.refused.most_common())
    words += f" ({reasons})" if reasons else ""
    if counts.others:
        words += f", {counts.others} of other sentences"
    if counts.holes:
        words += f"; {counted(counts.holes, 'hole')}, the longest of {counts.longest_hole_s:.1f} s"
    return words


COMMANDS = {"feed": Command(add_arguments, run, EXAMPLES, MORE)}
