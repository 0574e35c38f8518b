"""`rope_twin faults SCENE`: every input with every fault, and how soon each is flagged.

Exit code NEGATIVE if a fault was not flagged in time, or ended the simulation.
"""

from __future__ import annotations

import argparse
from dataclasses import asdict
from typing import Any

from rope_twin.cli import Command, ExitCode, print_json
from rope_twin.errors import InputError, did_you_mean
from rope_twin.run.options import add_json, add_scene
from rope_twin.run.progress import FigureProgress
from rope_twin.scene.load import load_scene
from rope_twin.scene.schema import Scene
from rope_twin.studies.fault_campaign import (
    DROP,
    DROP_WITHIN_S,
    OFF_PCT,
    PATIENCE_S,
    Finding,
    plan,
    run_campaign,
    sound_run,
)
from rope_twin.studies.fault_injection import INPUTS
from rope_twin.twin.ensemble.ensemble import cores

EXAMPLES = (
    "faults deep_lift --input ship/heave",
    "faults ahc_lift --single --json",
    "faults deep_lift --sound 10",
)
MAX_HOURS = 1000.0
MORE = """Runs a scene once with sound inputs and once with each fault of each input, and compares
the top tension."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add_scene(parser)
    add("--input", action="append", default=[], metavar="TOPIC",
        help=f"one of {', '.join(INPUTS)}; may be repeated (default: all)")  # fmt: skip
    add("--fault", action="append", default=[], metavar="NAME",
        help="only faults of this name; may be repeated")  # fmt: skip
    add("--single", action="store_true", help="no pairs of faults")
    add("--jobs", type=int, default=cores(), metavar="N",
        help="runs in parallel (default: %(default)s)")  # fmt: skip
    add("--sound", type=float, default=None, metavar="HOURS",
        help="no faults: so many hours of twin time; lists drops of the quality index")  # fmt: skip
    add_json(parser)


def run(args: argparse.Namespace) -> int:
    """Run the campaign and print the results. Raises RopeTwinError."""
    scene = load_scene(args.scene)
    for name in args.input:
        if name not in INPUTS:
            where = f"--input {name}"
            raise InputError(where, "there is no such input", did_you_mean(name, INPUTS))
    if args.jobs < 1:
        raise InputError("--jobs", f"{args.jobs} runs in parallel", "give 1 or more")
    if args.sound is not None and (args.fault or args.input or args.single):
        remedy = "leave out --input, --fault and --single"
        raise InputError("--sound", "a run without a fault has no other option", remedy)
    if args.sound is not None:
        return _run_sound(scene, args.sound, args.json)
    runs = plan(scene, args.input or INPUTS, pairs=not args.single)
    if args.fault:
        known = sorted({fault.name for _, fault in runs})
        for name in args.fault:
            if name not in known:
                problem = "there is no such fault"
                raise InputError(f"--fault {name}", problem, did_you_mean(name, known))
        runs = [(topic, fault) for topic, fault in runs if fault.name in args.fault]
    progress = FigureProgress()
    findings_so_far: list[Finding] = []

    def report(finding: Finding) -> None:
        findings_so_far.append(finding)
        if progress.due:
            missed = sum(not finding.met for finding in findings_so_far)
            progress.show(
                f"{len(findings_so_far)} of {len(runs)} runs, {missed} not flagged in time"
            )

    findings = run_campaign(scene, runs, report, args.jobs)
    progress.finish()
    if args.json:
        print_json(_figures(scene.name, findings))
    else:
        print(_as_text(findings))
    return ExitCode.OK if all(finding.met for finding in findings) else ExitCode.NEGATIVE


def _run_sound(scene: Scene, hours: float, as_json: bool) -> int:
    """Run without a fault, and print each drop of the quality index."""
    if not 0.0 < hours <= MAX_HOURS:
        problem = f"{hours:g} h is no duration of a run"
        raise InputError("--sound", problem, f"give more than 0 and at most {MAX_HOURS:g}")
    progress = FigureProgress()

    def report(now_s: float) -> None:
        if progress.due:
            progress.show(f"{now_s / 3600.0:.2f} of {hours:g} h")

    drops = sound_run(scene, 3600.0 * hours, report)
    progress.finish()
    if as_json:
        rows = [asdict(drop) for drop in drops]
        print_json({"scene": scene.name, "hours": hours, "drops": len(rows), "findings": rows})
    else:
        for drop in drops:
            print(f"{drop.at_s:10.1f} s  {drop.element} falls to {drop.index:.2f} by {drop.reason}")
        print(f"{len(drops)} false drops of the quality index in {hours:g} h")
    return ExitCode.OK if len(drops) <= max(1.0, hours / 10.0) else ExitCode.NEGATIVE


def _figures(scene: str, findings: list[Finding]) -> dict[str, Any]:
    rows = [
        {**asdict(finding), "met": finding.met, "dropped": finding.dropped} for finding in findings
    ]
    missed = sum(not finding.met for finding in findings)
    detectable, dropped = _drops(findings)
    counts = {
        "runs": len(rows),
        "missed": missed,
        "detectable": detectable,
        "quality_dropped": dropped,
    }
    return {"scene": scene, **counts, "findings": rows}


def _drops(findings: list[Finding]) -> tuple[int, int]:
    """Return how many faults can be detected, and for how many of them the index fell in time."""
    detectable = [finding for finding in findings if not finding.hidden]
    return len(detectable), sum(finding.dropped for finding in detectable)


def _as_text(findings: list[Finding]) -> str:
    head = (
        f"{'input':22} {'fault':44} {'flagged':>8} {'level':6} {'error %':>9} {'OK error %':>10} "
        f"{'off, OK':>8} {'quality':>8}"
    )
    lines = [head]
    for finding in sorted(findings, key=lambda finding: (finding.met, bool(finding.hidden))):
        flagged = "never" if finding.flagged_after_s is None else f"{finding.flagged_after_s:.2f} s"
        fell = "never" if finding.quality_after_s is None else f"{finding.quality_after_s:.2f} s"
        verdict = "" if finding.met else "  MISSED" if finding.survived else "  ABORTED"
        lines.append(
            f"{finding.input:22} {finding.fault:44} {flagged:>8} {finding.level:6} "
            f"{finding.worst_error_pct:9.1f} "
            f"{finding.worst_error_pct_while_ok:10.1f} {finding.off_while_ok_s:6.2f} s {fell:>8}"
            + (f"  undetectable: {finding.hidden}" if finding.hidden else "") + verdict
        )  # fmt: skip
    hidden = sum(bool(finding.hidden) for finding in findings)
    missed = sum(not finding.met for finding in findings)
    lines.append(
        f"{len(findings)} runs: {missed} with an error above {OFF_PCT:g} % of the standard "
        f"deviation for longer than {PATIENCE_S:g} s without a flag, or aborted; {hidden} "
        "undetectable faults listed with the error that they cause"
    )
    detectable, dropped = _drops(findings)
    lines.append(
        f"quality index: lower by {DROP:g} within {DROP_WITHIN_S:g} s in {dropped} of {detectable} "
        "detectable faults"
    )
    return "\n".join(lines)


COMMANDS = {"faults": Command(add_arguments, run, EXAMPLES, MORE)}
