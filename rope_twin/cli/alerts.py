"""`rope_twin alerts BAG`: the alerts of a recording, and whether a crew could have dealt with them.

With --udp it connects a running suite to bridge equipment instead: alerts go out as sentences, and
acknowledgements come back.
"""

from __future__ import annotations

import argparse
from dataclasses import asdict
from pathlib import Path
from typing import Any

from rope_twin.alerts.monitor import CHATTER, FLOOD, STEADY, AlertRates, rates
from rope_twin.cli import ExitCode, print_json
from rope_twin.errors import BagError, InputError
from rope_twin.messages.reports import PublishedAlerts, decode_alerts
from rope_twin.recording.bag import BagReader
from rope_twin.run.options import add_json
from rope_twin.topics import ALERTS, recorded_name

EXAMPLES = (
    "alerts bags/lift",
    "alerts bags/lift --json",
    "alerts --udp 127.0.0.1:60001 --replies 60002",
)
MORE = """Counts alarms and warnings against what EEMUA 191 asks for: about one in 10 min, no flood
above 10 in 10 min, none that stands for a day. Exit code 3 if a recording exceeds that."""
PORTS = range(1, 65536)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("bag", metavar="BAG", type=Path, nargs="?", help="bag directory or .mcap file")
    add("--udp", metavar="HOST:PORT", default="",
        help="send ALF and ALC sentences of a running suite there, until Ctrl-C")  # fmt: skip
    add("--replies", metavar="PORT", type=int, default=0,
        help="with --udp: UDP port of the loopback interface for ACN sentences")  # fmt: skip
    add_json(parser)


def run(args: argparse.Namespace) -> int:
    """Print the alerts of a bag, or connect a running suite; return the exit code.

    Raises:
        BagError: the bag cannot be read, or has no alerts.
        InputError: the arguments do not go together, or an address is not possible.
    """
    if bool(args.udp) == (args.bag is not None):
        problem = "both BAG and --udp" if args.udp else "neither BAG nor --udp"
        raise InputError("alerts", problem, "give one of them")
    if args.udp:
        host, port = address_of(args.udp)
        if args.replies and args.replies not in PORTS:
            raise InputError("--replies", str(args.replies), "give a port, 1 to 65535")
        # rclpy takes a second to import and is needed here only
        from rope_twin.ros.alert_output_node import run_output
        from rope_twin.ros.entry import keep_to_loopback

        keep_to_loopback()
        return run_output(host, port, args.replies)
    measured = read_rates(args.bag)
    if args.json:
        print_json(_figures(args.bag, measured))
    else:
        _report(args.bag, measured)
    sound = measured.per_window <= STEADY and not measured.flood and not measured.standing
    return ExitCode.OK if sound else ExitCode.NEGATIVE


def address_of(address: str) -> tuple[str, int]:
    """Return host and port of HOST:PORT.

    Raises:
        InputError: it is no address.
    """
    host, colon, port = address.rpartition(":")
    if not (colon and host and port.isdecimal() and int(port) in PORTS):
        raise InputError("--udp", f"'{address}'", "give HOST:PORT, such as 127.0.0.1:60001")
    return host, int(port)


def read_rates(bag: Path) -> AlertRates:
    """Return the alert rates of a recording.

    Raises:
        BagError: the bag cannot be read, or has no alerts.
    """
    lists: list[PublishedAlerts] = []
    with BagReader(bag) as reader:
        name = recorded_name(ALERTS)
        if name not in reader.topics:
            problem = f"it has no topic {ALERTS}"
            raise BagError(str(bag), problem, "record it with this or a later version of rope_twin")
        try:
            lists += [decode_alerts(data) for _, data in reader.messages(name)]
        except InputError as error:
            raise BagError(str(bag), str(error), "record it again") from error
        span_ns = reader.duration_ns
    end_ns = max([span_ns, *(alert_list.now_ns for alert_list in lists)])
    return rates([(alert_list.now_ns, alert_list.alerts) for alert_list in lists], end_ns)


def _figures(bag: Path, measured: AlertRates) -> dict[str, Any]:
    rows = [
        asdict(coming) | {"priority": coming.priority.name.lower()} for coming in measured.comings
    ]
    return {
        "bag": bag,
        "duration_s": measured.duration_s,
        "alarms_and_warnings": len(measured.comings),
        "cautions": measured.cautions,
        "per_10_min": measured.per_window,
        "most_in_10_min": measured.most_in_window,
        "flood": measured.flood,
        "standing": measured.standing,
        "chattering": measured.chattering,
        "by_name": measured.by_name,
        "alerts": rows,
    }


def _report(bag: Path, measured: AlertRates) -> None:
    print(f"{bag}: {measured.duration_s:.0f} s")
    for coming in measured.comings:
        waited = coming.acknowledged_after_s
        after = "" if waited is None else f"; acknowledged after {waited:.0f} s"
        print(
            f"  {coming.at_ns * 1e-9:9.1f} s  {coming.priority.name.lower():<9} {coming.key:<9} "
            f"{coming.text}{after}"
        )
    print(
        f"{len(measured.comings)} alarms and warnings, {measured.per_window:.1f} in 10 min "
        f"(EEMUA 191: {STEADY:g}); most within 10 min: {measured.most_in_window} "
        f"(a flood is above {FLOOD}); {measured.cautions} cautions"
    )
    if measured.standing:
        print(f"standing for a day: {', '.join(measured.standing)}")
    if measured.chattering:
        print(f"chattering, {CHATTER} times within a minute: {', '.join(measured.chattering)}")
