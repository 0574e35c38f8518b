"""`rope_twin replay BAG`: run a recorded bag again and compare bit by bit."""

from __future__ import annotations

import argparse
import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rope_twin.cli import ExitCode, print_json
from rope_twin.run.options import add_json

if TYPE_CHECKING:
    from rope_twin.recording.exact_replay import Verification
    from rope_twin.recording.session import Session


EXAMPLES = (
    "replay lift",
    "replay lift --verify --json",
)
MORE = """With --verify the scene is run again with all recorded inputs, and every message that the
simulation published is compared bit by bit."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("bag", metavar="BAG", type=Path, help="bag directory or .mcap file")
    parser.add_argument("--verify", action="store_true", help="run it again and compare")
    add_json(parser)


def run(args: argparse.Namespace) -> int:
    """Print the sessions, or verify, and return the exit code. Raises RopeTwinError."""
    if not args.verify:
        return _describe(args)
    from rope_twin.recording.exact_replay import verify

    verification = verify(args.bag)
    if args.json:
        print_json(_figures(args.bag, verification))
    else:
        print("\n".join(_sentences(args.bag, verification)))
    return verification.outcome


def _describe(args: argparse.Namespace) -> int:
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
        print(f"  {'inputs':12} in {len(session.entries)} slots")
    for note in content.notes:
        print(f"  note: {note}")
    return ExitCode.OK


def _session_rows(session: Session) -> list[tuple[str, str]]:
    content = session.content
    setup = dataclasses.asdict(session.setup)
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


def _sentences(bag: Path, verification: Verification) -> list[str]:
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


def _figures(bag: Path, verification: Verification) -> dict[str, Any]:
    different = (
        None if verification.difference is None else dataclasses.asdict(verification.difference)
    )
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
