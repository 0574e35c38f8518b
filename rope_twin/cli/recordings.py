"""Commands on recordings and saved states: `replay`, `recover`, `export`, `alerts`, `state`."""

from __future__ import annotations

import argparse
import sys
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rope_twin.alerts.monitor import CHATTER, FLOOD, STEADY, AlertRates, rates
from rope_twin.cli import Command, ExitCode, print_json
from rope_twin.errors import BagError, InputError
from rope_twin.messages.reports import PublishedAlerts, decode_alerts
from rope_twin.recording.bag import BagReader
from rope_twin.recording.recover import recover
from rope_twin.recording.series_export import SERIES, check_ending, read_series, write_series
from rope_twin.run.options import add_command, add_json, add_out
from rope_twin.topics import ALERTS, recorded_name
from rope_twin.twin.state import load_state

if TYPE_CHECKING:
    from rope_twin.recording.exact_replay import Verification
    from rope_twin.recording.session import Session

REPLAY_EXAMPLES = (
    "replay lift",
    "replay lift --verify --json",
)
REPLAY_MORE = """\
With --verify the scene is run again with all recorded inputs, and every message that the
simulation published is compared bit by bit."""


def _add_replay(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("bag", metavar="BAG", type=Path, help="bag directory or .mcap file")
    parser.add_argument("--verify", action="store_true", help="run it again and compare")
    add_json(parser)


def _run_replay(args: argparse.Namespace) -> int:
    """Print the sessions, or verify, and return the exit code. Raises RopeTwinError."""
    if not args.verify:
        return _list_sessions(args)
    from rope_twin.recording.exact_replay import verify

    verification = verify(args.bag)
    if args.json:
        print_json(_verification_figures(args.bag, verification))
    else:
        print("\n".join(_verdict_lines(args.bag, verification)))
    return verification.outcome


def _list_sessions(args: argparse.Namespace) -> int:
    """Print scene, program, machine and inputs of each session in the bag."""
    from rope_twin.recording.recorded_run import read_content

    content = read_content(args.bag)
    if args.json:
        sessions = [
            _session_figures(session.session) | {"slots_with_inputs": len(session.entries)}
            for session in content.sessions
        ]
        print_json({"bag": args.bag, "sessions": sessions, "notes": content.notes})
        return ExitCode.OK
    print(f"{args.bag}: {len(content.sessions)} sessions; --verify runs them again")
    for session in content.sessions:
        for name, text in _session_rows(session.session):
            print(f"  {name:12} {text}")
        print(f"  {'inputs':12} in {len(session.entries)} cycles")
    for note in content.notes:
        print(f"  note: {note}")
    return ExitCode.OK


def _session_rows(session: Session) -> list[tuple[str, str]]:
    content = session.content
    setup = asdict(session.setup)
    parameters = ", ".join(f"{name} {value}" for name, value in setup.items() if value)
    start = "a saved state" if content.get("state") else "static equilibrium"
    return [
        ("session", f"{session.number} of run {session.run}"),
        ("scene", f"{content['scene']['name']} ({', '.join(content['scene']['files'])})"),
        ("from", f"{session.time_ns * 1e-9:.9g} s simulated time, from {start}"),
        ("parameters", parameters or "as the scene says"),
        ("seeds", ", ".join(f"{k} {v}" for k, v in content["seeds"].items()) or "none"),
        ("program", ", ".join(f"{k} {v}" for k, v in content["program"].items() if v)),
        ("machine", ", ".join(f"{k} {v}" for k, v in content["machine"].items())),
    ]


def _session_figures(session: Session) -> dict[str, Any]:
    """Return the description of a session without its long parts."""
    content = {name: value for name, value in session.content.items() if name != "state"}
    content["scene"] = {**content["scene"], "files": list(content["scene"]["files"])}
    return content | {"from_state": session.content.get("state") is not None}


def _verdict_lines(bag: Path, verification: Verification) -> list[str]:
    """Return the verdict, then its basis."""
    from rope_twin.recording.exact_replay import LEFT_OUT

    if verification.difference is not None:
        verdict = f"different: {verification.difference}"
    elif verification.fault:
        verdict = f"not fully verified: {verification.fault}"
    else:
        verdict = "bit-identical"
    rows = [
        f"{bag}: {verdict}",
        f"  compared: {verification.total} messages of {len(verification.compared)} topics in "
        f"{len(verification.sessions)} sessions, up to {verification.until_s:.9g} s",
    ]
    if verification.missing:
        rows.append(f"  missing in the bag: {_counts_words(verification.missing)}")
    if verification.unverified:
        rows.append(f"  not compared, since their inputs are not known: {verification.unverified}")
    rows.append(f"  inputs applied: {_counts_words(verification.applied) or 'none'}")
    if verification.unrecorded:
        counts = _counts_words(verification.unrecorded)
        rows.append(f"  of these lost on their topic, or given by a service: {counts}")
    rows += [f"  left out: {topic}, since {reason}" for topic, reason in LEFT_OUT.items()]
    machine = verification.sessions[0].content["machine"]
    rows.append(f"  recorded on {machine['processor']}, numba {machine['numba']}")
    return rows + [f"  note: {note}" for note in verification.notes]


def _verification_figures(bag: Path, verification: Verification) -> dict[str, Any]:
    different = None if verification.difference is None else asdict(verification.difference)
    return {
        "bag": str(bag),
        "outcome": verification.outcome.name.lower(),
        "difference": different,
        "fault": verification.fault,
        "compared": dict(verification.compared),
        "missing": dict(verification.missing),
        "unverified": verification.unverified,
        "until_s": verification.until_s,
        "applied": dict(verification.applied),
        "unrecorded": dict(verification.unrecorded),
        "notes": verification.notes,
        "sessions": [_session_figures(session) for session in verification.sessions],
    }


def _counts_words(counts: Any) -> str:
    return ", ".join(f"{count} {topic}" for topic, count in sorted(counts.items()))


RECOVER_EXAMPLES = (
    "recover lift",
    "recover lift/lift_0.mcap --out lift_whole",
)
RECOVER_MORE = "Reads a bag up to the damage and writes a valid one beside it."


def _add_recover(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("bag", metavar="BAG", type=Path, help="bag directory or .mcap file")
    add_out(parser, "DIR", "bag directory to create (default: BAG_recovered)")
    add_json(parser)


def _run_recover(args: argparse.Namespace) -> int:
    """Recover the bag and report; return the exit code. Raises BagError."""
    result = recover(args.bag, args.out)
    if args.json:
        print_json({
            "bag": args.bag, "outcome": result.outcome.name.lower(),
            "directory": result.directory, "messages": result.counts,
            "start_ns": result.start_ns, "end_ns": result.end_ns, "lost": result.lost,
            "notes": result.remarks,
        })  # fmt: skip
        return result.outcome
    if result.directory is None:
        print(f"{args.bag}: nothing could be recovered")
    else:
        total = sum(result.counts.values())
        print(f"{args.bag}: {total} messages recovered into {result.directory}")
        for name, count in result.counts.items():
            print(f"  {name:<24} {count:>8}")
        span_s = (result.end_ns - result.start_ns) * 1e-9
        print(f"  over {span_s:.3f} s, until {result.end_ns * 1e-9:.3f} (ROS time)")
    for sentence in result.lost:
        print(f"  lost: {sentence}")
    for sentence in result.remarks:
        print(f"  note: {sentence}")
    return result.outcome


EXPORT_EXAMPLES = (
    "export lift --out lift.csv",
    "export lift --out lift.parquet --topics ropes/tension_top payloads/state",
    "export lift --out lift.nc --json",
)
EXPORT_MORE = """\
Writes a row for each stamp and a column for each number (topic/name/quantity_unit) as
CSV, Parquet or netCDF by the ending of --out: pandas.read_csv, pandas.read_parquet and
xarray.open_dataset read them. Numbers that a topic does not have at a stamp are empty."""


def _add_export(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("bag", metavar="BAG", help="a name in bags/ or a path")
    add_out(parser, "FILE", "table to write: .csv, .parquet or .nc", required=True)
    help_text = f"topics to export, of {', '.join(SERIES)} (default: all that are there)"
    parser.add_argument("--topics", nargs="+", default=(), metavar="TOPIC", help=help_text)
    add_json(parser)


def _run_export(args: argparse.Namespace) -> int:
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


ALERTS_EXAMPLES = (
    "alerts lift",
    "alerts lift --json",
    "alerts --udp 127.0.0.1:60001 --replies 60002",
)
ALERTS_MORE = """\
Counts alarms and warnings against what EEMUA 191 asks for: about one in 10 min, no flood
above 10 in 10 min, none that stands for a day. Exit code 3 if a recording exceeds that."""
PORTS = range(1, 65536)


def _add_alerts(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("bag", metavar="BAG", type=Path, nargs="?", help="bag directory or .mcap file")
    add("--udp", metavar="HOST:PORT", default="",
        help="send ALF and ALC sentences of a running suite there, until Ctrl-C")  # fmt: skip
    add("--replies", metavar="PORT", type=int, default=0,
        help="with --udp: UDP port of the loopback interface for ACN sentences")  # fmt: skip
    add_json(parser)


def _run_alerts(args: argparse.Namespace) -> int:
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
        from rope_twin.ros.middleware import keep_to_loopback

        keep_to_loopback()
        return run_output(host, port, args.replies)
    measured = read_rates(args.bag)
    if args.json:
        print_json(_rate_figures(args.bag, measured))
    else:
        _report_rates(args.bag, measured)
    sound = measured.per_window <= STEADY and not measured.flood and not measured.standing
    return ExitCode.OK if sound else ExitCode.NEGATIVE


def address_of(address: str) -> tuple[str, int]:
    """Return host and port of HOST:PORT. Raises InputError: it is no address."""
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


def _rate_figures(bag: Path, measured: AlertRates) -> dict[str, Any]:
    rows = [
        asdict(coming) | {"priority": coming.priority.name.lower()} for coming in measured.comings
    ]
    return {
        "bag": bag,
        "duration_s": measured.duration_s,
        "alarms_and_warnings": len(measured.comings),
        "cautions": measured.cautions,
        "per_10_min": measured.per_window,
        "max_in_10_min": measured.max_in_window,
        "flood": measured.flood,
        "standing": measured.standing,
        "chattering": measured.chattering,
        "by_name": measured.by_name,
        "alerts": rows,
    }


def _report_rates(bag: Path, measured: AlertRates) -> None:
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
        f"(EEMUA 191: {STEADY:g}); most within 10 min: {measured.max_in_window} "
        f"(a flood is above {FLOOD}); {measured.cautions} cautions"
    )
    if measured.standing:
        print(f"standing for a day: {', '.join(measured.standing)}")
    if measured.chattering:
        print(f"chattering, {CHATTER} times within a minute: {', '.join(measured.chattering)}")


STATE_EXAMPLES = (
    "state info lift.state",
    "state info lift.state --json",
)


def _add_state(parser: argparse.ArgumentParser) -> None:
    """Add `state` with its one action."""
    actions = parser.add_subparsers(dest="action", required=True, metavar="ACTION")
    info = add_command(actions, "info", "describe a file of `run --save-state`", STATE_EXAMPLES)
    info.add_argument("file", metavar="FILE", type=Path, help="the file")
    add_json(info)


def _run_state(args: argparse.Namespace) -> int:
    """Print the description. Raises StateError if the file is damaged."""
    state = load_state(args.file)
    about, shapes = state.about, {name: list(one.shape) for name, one in state.arrays.items()}
    if args.json:
        print_json(asdict(about) | {"arrays": shapes})
        return ExitCode.OK
    x, y, z = about.payload_position_m
    rows = [
        ("scene", f"{about.scene} ({about.scene_path})"),
        ("scene text", f"SHA-256 {about.scene_digest}"),
        ("saved at", about.saved_at),
        ("written by", f"rope_twin {about.program}, solver {about.solver}"),
        ("simulated time", f"{about.time_s:.3f} s, {about.step} time steps of {about.step_s:g} s"),
        ("line out", f"{about.line_out_m:.3f} m, {about.elements} elements, "
                     f"{about.payout_speed_m_per_s:+.3f} m/s"),
        ("top tension", f"{about.tension_top_n / 1e3:.3f} kN"),
        ("payload", f"at {x:.2f}, {y:.2f}, {z:.2f} m (east, north, up)"),
    ]  # fmt: skip
    if about.failure:
        rows.append(("failure", about.failure))
    size = sum(array.nbytes for array in state.arrays.values())
    rows.append(("arrays", f"{len(state.arrays)}, {size / 1e3:.0f} kB, checksum correct"))
    rows += [("", f"{name} {shape}") for name, shape in shapes.items()]
    for name, text in rows:
        print(f"{name:14} {text}")
    return ExitCode.OK


COMMANDS = {
    "replay": Command(_add_replay, _run_replay, REPLAY_EXAMPLES, REPLAY_MORE),
    "recover": Command(_add_recover, _run_recover, RECOVER_EXAMPLES, RECOVER_MORE),
    "export": Command(_add_export, _run_export, EXPORT_EXAMPLES, EXPORT_MORE),
    "alerts": Command(_add_alerts, _run_alerts, ALERTS_EXAMPLES, ALERTS_MORE),
    "state": Command(_add_state, _run_state, STATE_EXAMPLES),
}
