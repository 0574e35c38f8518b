"""`rope_twin run`: simulate a scene, in real time over ROS 2 or as fast as possible without it."""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from rope_twin.cli import Command, ExitCode
from rope_twin.run.options import RunOptions, check_against_scene, read_options
from rope_twin.run.options import add_arguments as add_arguments
from rope_twin.run.progress import FigureProgress

EXAMPLES = (
    "run deep_lift --duration 90s --out lift",
    "run my_lift.yaml --speed 0 --duration 10min --json",
    "run deep_lift --cut 1.5km@30s --headless",
)
MORE = """Ctrl-C ends the run with a summary. The bag is recorded in `recordings/` unless --out
names another folder."""
ALONE_S = 60.0  # so much of a paced run is repeated without waiting, to measure the model alone

if TYPE_CHECKING:
    from rope_twin.run.summary import RunSummary
    from rope_twin.run.unpaced import UnpacedRun
    from rope_twin.scene.schema import Scene


def run(args: argparse.Namespace) -> int:
    """Run, print the summary, and return the exit code.

    OK; ERROR if the solver could not go on, if samples of two seas alternated, if bag or state
    are incomplete on the disk, or if a process died and could not be restarted; LIMIT if a limit
    of the scene was exceeded.

    Raises:
        RopeTwinError: the run could not start; one sentence.
    """
    options = read_options(args)
    progress = FigureProgress()
    if any(given is not None for given in (args.within, args.budget, args.quantity)):
        from rope_twin.cli.selection import choose

        options = choose(args, options)
        progress.say(options.chosen)
    from rope_twin.scene.load import at_setting, load_scene

    scene = at_setting(load_scene(options.scene), options.elements, options.step_s)
    for remark in (check_against_scene(options, scene), _vortex_words(scene)):
        if remark:
            progress.say(remark)
    if options.speed == 0.0:
        summary = _unpaced(options, scene, progress)
    else:
        summary = _with_speed_alone(_paced(options, progress), options)
    bag = summary.bag if summary.bag and Path(summary.bag).exists() else None
    summary = replace(summary, chosen=options.chosen, bag=bag)
    if summary.core_share is not None:
        budget = {"asked_pct": options.budget_pct, "calibrated_pct": options.calibrated_pct}
        summary = replace(summary, core_share=summary.core_share | budget)
    progress.finish()
    mixed = summary.mixed and f"{summary.mixed}; give each twin its own ROS_DOMAIN_ID."
    troubles = [
        remark for remark in (summary.error, mixed, summary.not_kept, summary.not_running) if remark
    ]
    for trouble in troubles:
        progress.say(trouble)
    sys.stdout.write((summary.as_json() if options.json else summary.as_text()) + "\n")
    sys.stdout.flush()
    exceeded = summary.limits_broken and not options.allow_overload
    code = ExitCode.ERROR if troubles else ExitCode.LIMIT if exceeded else ExitCode.OK
    if options.speed != 0.0:
        from rope_twin.ros.entry import release

        release(code)
    return code


def _paced(options: RunOptions, progress: FigureProgress) -> RunSummary:
    """Run over ROS, which is imported only for this."""
    if options.processes:
        from rope_twin.ros.processes import run_processes

        return run_processes(options, progress)
    from rope_twin.ros.suite import run_suite

    return run_suite(options, progress)


def _with_speed_alone(summary: RunSummary, options: RunOptions) -> RunSummary:
    """Return the summary of a real-time run with the real-time factor of the solver alone."""
    if summary.error or summary.steps == 0:
        return summary
    from rope_twin.run.unpaced import measure_alone

    time_s = min(summary.time_s - options.begins_s, ALONE_S)
    return replace(summary, real_time_factor=measure_alone(options, time_s))


def _unpaced(options: RunOptions, scene: Scene, progress: FigureProgress) -> RunSummary:
    from rope_twin.messages.diagnostics import BreachWords
    from rope_twin.run.unpaced import run_unpaced
    from rope_twin.scene.rope_warnings import sense_checks

    for warning in sense_checks(scene):
        progress.say(warning)
    broken = BreachWords()

    def report(run: UnpacedRun) -> None:
        for sentence in broken.of(run.last):
            progress.say(sentence)
        if progress.due:
            progress.show(run.summary().as_progress())

    return run_unpaced(options, report, say=progress.say)


def _vortex_words(scene: Scene) -> str:
    """Return the mesh and time step that the scene's VIV model needs, and what it gets, or "".

    A warning reports too little of them by itself (rope_twin.scene.rope_warnings).
    """
    from rope_twin.scene.lift import lift_figures
    from rope_twin.scene.rigging import is_joined
    from rope_twin.scene.vortex import check_vortex_resolution, shedding_model, vortex_words

    if not shedding_model(scene) or is_joined(scene):
        return ""
    figures = lift_figures(scene)
    return "" if any(check_vortex_resolution(scene, figures)) else vortex_words(scene, figures)


COMMANDS = {"run": Command(add_arguments, run, EXAMPLES, MORE)}
