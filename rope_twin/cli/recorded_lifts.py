"""Commands on a recorded lift: `learn` its figures, look `ahead` from any of its instants."""

from __future__ import annotations

import argparse
import math
import sys
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from rope_twin.cli import CaseProgress, Command, ExitCode, print_json, print_table
from rope_twin.errors import InputError, counted
from rope_twin.quantity import kilonewtons
from rope_twin.run.options import add_json, add_out, add_time, measure
from rope_twin.run.progress import FigureProgress

if TYPE_CHECKING:
    from rope_twin.forecast.offline import RecordingForecaster, RecordingScore
    from rope_twin.forecast.recorded_lift import RecordedLift
    from rope_twin.forecast.risk import Limits, QuietWindow, Risk
    from rope_twin.forecast.tension_forecast import TensionForecast

LEARN_EXAMPLES = (
    "learn lift",
    "learn sensors --scene deep_lift --tared --out learned.png",
    "learn lift --until 5min --json",
)
LEARN_MORE = """\
Reads winch/measured (tension, line out) and ship/heave of a bag and learns the figures of
rope and payload, load pin and motion sensor a minute at a time, from the uncertainties in the
scene's section `learning`. The rope hangs at rest when the measurement begins, and two minutes are
needed. Faults are looked for as in a run with --learn: nothing is learned behind one, and the exit
code is 3. Nothing is learned while the payload is in the splash zone or near the seabed. A load on
several ropes from the ship is learned from the load pins of their winches, which winch/measured
names by hang-off or rope. A load that begins on a deck cannot be learned yet, nor a rigid body on
several ropes."""
MIN_LEARN_S = 120.0


def _add_learn(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("bag", metavar="BAG", help="bag directory, .mcap file, or name in bags/")
    add("--scene", metavar="SCENE", help="scene name or file (default: the bag's)")
    winch = "main winch in winch/measured (default: the first)"
    add("--winch", metavar="NAME", default="", help=winch)
    add("--tared", action="store_true", help="the load pin was tared with an empty hook")
    add_time(parser, "--until", "learn from data up to this time after the first tension")
    add_out(parser, "FILE.png", "draw the figures over time, and the residual that is left")
    add_json(parser)


def _run_learn(args: argparse.Namespace) -> int:
    """Learn and print the table. Raises RopeTwinError with one sentence if it cannot be done."""
    from rope_twin.estimation import report
    from rope_twin.estimation.alarms import FaultWatch
    from rope_twin.estimation.estimator import MIN_USED, begin_at_rest
    from rope_twin.estimation.recorded_lift import read_lift
    from rope_twin.scene.load import load_scene

    if args.out is not None:
        from rope_twin.studies.picture import check_picture

        check_picture(args.out)
    stated_scene = load_scene(args.scene) if args.scene else None
    recorded = read_lift(args.bag, args.winch, stated_scene)
    scene = stated_scene or recorded.scene()
    estimator = begin_at_rest(scene, recorded.lift, tared=args.tared)
    until_s = np.inf if args.until is None else args.until
    progress = FigureProgress()
    known_s = recorded.lift.known_until_s(estimator.heave_ahead_s)
    watch, blocks = FaultWatch(scene, estimator), 0
    while estimator.block_end_s <= until_s + 1e-6:
        if watch.advance(min(estimator.block_end_s, known_s)) is not None or not estimator.step():
            break
        if len(estimator.results) > blocks:
            watch.learned(estimator)
        blocks = len(estimator.results)
        if progress.due:
            progress.show(f"{estimator.block_end_s:.0f} of {min(known_s, until_s):.0f} s")
    progress.finish()
    alarm = watch.alarm
    if not estimator.results and alarm is not None:
        fault = f"before anything is learned, {alarm.words}"
        raise InputError(
            f"bag {args.bag}", fault, "check the sensors, and give a bag behind the fault"
        )
    if not estimator.results:
        fault = f"{max(min(known_s, until_s) - recorded.lift.begin_s, 0.0):.0f} s of data"
        remedy = f"give at least {MIN_LEARN_S:g} s with tension, heave and line out"
        raise InputError(f"bag {args.bag}", fault, remedy)
    if remark := report.disagreement(estimator):
        raise InputError(f"bag {args.bag}", remark, "check its unit (N), its sign and the scene")
    posterior = estimator.results[-1].posterior
    actions = report.expected_after(estimator, scene)
    if not args.tared:
        actions.append(report.tare_action(estimator.prior, posterior))
    base = report.base_values(scene)
    advice = report.best_actions(posterior, actions, estimator.prior.names)
    at_limit = estimator.results[-1].at_limit
    figures = report.estimates(base, estimator.prior, posterior, advice, at_limit)
    figures = report.score_applied(figures, base, recorded.applied)
    derived = report.derived_mass_kg(base, posterior, scene)
    if args.out is not None:
        _draw_learned(args.bag, estimator.results, base, args.out)
    remarks = report.not_measured(recorded.lift)
    if estimator.noise is not None:
        noise_n = estimator.noise.nominal_white_n
        remarks += report.counter_words(estimator.model.bars, recorded.lift, noise_n)
    if args.json:
        learned = report.as_json(figures, estimator.results, derived, estimator.model.winches)
        learned["remarks"] = remarks
        learned["warnings"] = list(recorded.problems)
        learned["alarm"] = None if alarm is None else alarm.as_json()
        print_json({"bag": str(args.bag), "scene": scene.name, "tared": args.tared} | learned)
        return ExitCode.OK if alarm is None else ExitCode.NEGATIVE
    for problem in recorded.problems:
        print(f"warning: {problem}", file=sys.stderr)
    print_table(report.table(figures))
    if derived:
        print(
            f"with the scene's volume: mass in air {derived['mass_in_air_kg']:.4g} kg, "
            f"added mass {derived['added_mass_kg']:.4g} kg"
        )
    last = estimator.results[-1]
    minutes = sum(result.used >= MIN_USED for result in estimator.results)
    print(f"after {minutes} min; {100.0 * last.used:.0f} % of the last minute's tension used")
    for remark in (*report.left_out_words(last), *remarks):
        print(remark)
    if at_limit:
        print(report.limit_words(at_limit), file=sys.stderr)
    if alarm is not None:
        print(f"fault: {alarm.words}; nothing behind it is learned from", file=sys.stderr)
    return ExitCode.OK if alarm is None else ExitCode.NEGATIVE


def _draw_learned(bag: str, results: Any, base: dict[str, float], picture: Path) -> None:
    """Draw the rope's figures with their 90 % intervals over time."""
    from rope_twin.estimation import report
    from rope_twin.estimation.figures import ROPE_FIGURES
    from rope_twin.studies.picture import Line, Panel, draw_panels

    times = np.array([result.end_s for result in results])
    means, sds = (
        np.array([getattr(result.posterior, name) for result in results]) for name in ("mean", "sd")
    )
    panels = []
    for k, name in enumerate(ROPE_FIGURES):
        if not base[name]:
            continue
        half = report.NORMAL_90 * sds[:, k]
        panels.append(
            Panel(
                name.replace("_", " "),
                "time [min]",
                "factor on the scene's value [-]",
                (
                    Line(times / 60.0, np.exp(means[:, k]), "mean", "o-"),
                    Line(times / 60.0, np.exp(means[:, k] - half), "90 % interval", "--"),
                    Line(times / 60.0, np.exp(means[:, k] + half), "", "--"),
                ),
            )
        )
    draw_panels(f"Learned from {bag}", panels, picture)


AHEAD_EXAMPLES = (
    "ahead lift --at 10min --limit 380kN",
    "ahead lift --what-if lower:0.5 haul:0.5 stop",
    "ahead lift --score --every 30s",
)
AHEAD_MORE = """\
Heave is forecast from its last ten minutes, and tension by ropes that each follow one
possible heave. Beyond the horizon that is printed the band is what this sea does to this rope at
any time. ORDER is hold, stop, lower:SPEED, haul:SPEED, land:SPEED, compensation:on or
compensation:off, for all winches or, as in stop@WINCH, for one of them; all are compared on the
same heave, and nothing is commanded."""
MAX_MEMBERS = 960  # that of the node's parameter `members`
SHOWN_S = (2.0, 5.0, 10.0, 20.0, 30.0, 60.0)
FORCE_HELP = "tension limit (default: that of the scene, by tension or utilisation)"


def _add_ahead(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("bag", metavar="BAG", help="a name in bags/, bag directory or .mcap file")
    add("--scene", metavar="SCENE", help="scene of the lift (default: that of the bag)")
    add_time(parser, "--at", "origin, from the recording's beginning (default: its end)")
    add("--what-if", nargs="+", default=[], metavar="ORDER", help="orders to compare with hold")
    add("--limit", type=measure("N"), metavar="FORCE", help=FORCE_HELP)
    add("--contact-speed", type=measure("m/s"), default=0.5, metavar="SPEED",
        help="limit of the payload's speed at contact (default: 0.5m/s)")  # fmt: skip
    add("--quiet-speed", type=measure("m/s"), default=0.3, metavar="SPEED",
        help="payload speed below which it is quiet (default: 0.3m/s)")  # fmt: skip
    add_time(parser, "--quiet-time", "length of a quiet window", 10.0)
    add("--planned", action="store_true",
        help="the winch does what the recording has after the origin (default: it goes on as it "
        "is)")  # fmt: skip
    add("--motion-error", type=measure("m"), default=0.02, metavar="LENGTH",
        help="coloured error of the motion sensor (1 sd, default: 0.02m)")  # fmt: skip
    add("--members", type=int, default=48, metavar="N", help="ropes (default: 48)")
    add("--score", action="store_true", help="forecast again and again, and score the forecasts")
    add_time(parser, "--every", "interval of the origins of --score", 30.0)
    add("--picture", type=Path, metavar="PNG", help="draw the band ahead of the curve")
    add_json(parser)


def _run_ahead(args: argparse.Namespace) -> int:
    """Forecast or score, and print. Raises RopeTwinError."""
    from rope_twin.forecast.heave_process import MotionError
    from rope_twin.forecast.offline import RecordingForecaster
    from rope_twin.forecast.orders import read_order
    from rope_twin.forecast.recorded_lift import read_lift, tension_unit_warning
    from rope_twin.forecast.risk import Limits, tension_limits
    from rope_twin.forecast.tension_forecast import ERROR_MARGIN, ForecastSettings
    from rope_twin.studies.picture import check_picture

    _check_ahead(args)
    if args.picture is not None:
        check_picture(args.picture)
    what_if = [read_order(word) for word in args.what_if]
    error = MotionError(coloured_m=ERROR_MARGIN * args.motion_error)
    settings = ForecastSettings(members=args.members, motion_error=error)
    lift = read_lift(args.bag, args.scene)
    for text in lift.problems:
        print(f"warning: {text}", file=sys.stderr)
    if doubt := tension_unit_warning(lift):
        print(doubt, file=sys.stderr)
    limit_n, others_n = tension_limits(lift.scene, args.limit)
    limits = Limits(limit_n, args.contact_speed, args.quiet_speed, args.quiet_time, others_n)
    forecaster = RecordingForecaster(lift, settings, args.planned)
    if args.score:
        scored = forecaster.score(args.every, limit_n, CaseProgress().show)
        if faults := forecaster.pin_faults:
            print(f"warning: at {counted(len(faults), 'origin')} {faults[-1]}", file=sys.stderr)
        _print_score(args, lift, scored)
        return ExitCode.OK
    sample = forecaster.sample_of(args.at)
    orders = [read_order("hold"), *what_if] if what_if else [read_order("continue")]
    forecasts = forecaster.at(sample, orders)
    if args.picture is not None:
        _draw_forecasts(args.picture, lift, sample, forecasts)
    if args.json:
        print_json(_forecast_figures(args, lift, forecaster, forecasts, limits))
        return ExitCode.OK
    _print_forecasts(lift, forecaster, forecasts, limits)
    return ExitCode.OK


def _check_ahead(args: argparse.Namespace) -> None:
    """Refuse what would fail only after the forecast, or would be left out without a word."""
    from rope_twin.forecast.heave_process import AHEAD_S, SAMPLE_S
    from rope_twin.forecast.risk import WINDOW_STARTS_S

    if args.limit is not None and args.limit <= 0.0:
        raise InputError("--limit", f"it is {args.limit:g} N", "give more than 0")
    if args.members > MAX_MEMBERS:
        remedy = f"give at most {MAX_MEMBERS}"
        raise InputError("--members", f"{args.members} ropes are too many", remedy)
    longest_s = AHEAD_S - max(WINDOW_STARTS_S)
    if not 0.0 < args.quiet_time <= longest_s:
        remedy = f"give more than 0 and at most {longest_s:g} s"
        raise InputError("--quiet-time", f"it is {args.quiet_time:g} s", remedy)
    if args.every < SAMPLE_S:
        remedy = f"give {SAMPLE_S:g} s or more"
        raise InputError("--every", f"the origins are {args.every:g} s apart", remedy)
    of_one = {"--at": args.at, "--what-if": args.what_if or None, "--picture": args.picture}
    option_given = next((option for option, value in of_one.items() if value is not None), "")
    if args.score and option_given:
        remedy = "leave one of the two out"
        raise InputError(option_given, "it is for one origin, and --score has many", remedy)


def _risks(
    forecaster: RecordingForecaster, forecast: TensionForecast, limits: Limits
) -> tuple[list[Risk], list[QuietWindow]]:
    from rope_twin.forecast.risk import quiet_windows, risks

    return risks(forecast, limits, forecaster.depth_m), quiet_windows(forecast, limits)


def _print_forecasts(
    lift: RecordedLift,
    forecaster: RecordingForecaster,
    forecasts: list[TensionForecast],
    limits: Limits,
) -> None:
    """Print band, risks and quiet windows, and the orders beside `hold`."""
    first = forecasts[0]
    heave, line, tension = lift.sources
    print(
        f"origin {first.origin_s:g} s; heave of {heave}, line out of {line}, tension of {tension}"
    )
    print(f"{first.members} ropes; heave is known to {first.horizon_s:g} s ahead, beyond that the "
          "band is the climatology of this sea for this rope\n")  # fmt: skip
    columns = [round(s / (first.lead_s[1] - first.lead_s[0])) - 1 for s in SHOWN_S]
    bands = {lift.scene.ropes[0].name: first.band()}
    bands |= {name: further.band() for name, further in first.others.items()}
    for rope, band in bands.items():
        of_rope = f" of {rope}" if first.others else ""
        rows = [[f"top tension{of_rope} [kN] in", *(f"{s:g} s" for s in SHOWN_S)]]
        for name, values in zip(("5 %", "50 %", "95 %"), band * 1e-3, strict=True):
            rows.append([name, *(f"{values[k]:.1f}" for k in columns)])
        print_table(rows)
    for forecast in forecasts:
        risk, quiet = _risks(forecaster, forecast, limits)
        print(f"\n{forecast.order}{': ' + forecast.note if forecast.note else ''}")
        rows = [["within", *(f"{window.span_s:g} s" for window in risk)]]
        name = f"P(T > {kilonewtons(limits.tension_n)})"
        if forecast.others:
            name = "P(any rope's T > its limit)"
        rows.append([name, *(f"{r.tension:.2f}" for r in risk)])
        rows.append(["P(slack)", *(f"{r.slack:.2f}" for r in risk)])
        if not math.isnan(risk[0].landing):
            rows.append(["P(lands)", *(f"{r.landing:.2f}" for r in risk)])
            name = f"P(lands faster than {limits.contact_m_per_s:g} m/s)"
            rows.append([name, *(f"{r.contact:.2f}" for r in risk)])
        print_table(rows)
        text = ", ".join(f"in {window.begin_s:g} s: {window.probability:.2f}" for window in quiet)
        print(f"P({limits.quiet_s:g} s below {limits.quiet_m_per_s:g} m/s) {text}")
    if len(forecasts) > 1:
        _print_differences(forecasts)


def _print_differences(forecasts: list[TensionForecast]) -> None:
    """Print each order against the first, member by member."""
    from rope_twin.forecast.risk import compare

    print()
    rows = [["peak of 30 s against hold [kN]", "5 %", "50 %", "95 %", "lower in"]]
    for forecast in forecasts[1:]:
        for rope in forecast.suspended:
            difference = compare(forecast, forecasts[0], rope=rope)
            peaks = [f"{value * 1e-3:+.1f}" for value in difference.peak_n]
            in_rope = f" in {rope}" if forecast.others else ""
            rows.append([f"{forecast.order}{in_rope}", *peaks, f"{100.0 * difference.lower:.0f} %"])
    print_table(rows)


def _forecast_figures(
    args: argparse.Namespace,
    lift: RecordedLift,
    forecaster: RecordingForecaster,
    forecasts: list[TensionForecast],
    limits: Limits,
) -> dict[str, Any]:
    """Return the forecasts as one JSON object."""
    from rope_twin.forecast.risk import compare
    from rope_twin.forecast.tension_forecast import QUANTITIES

    rows = []
    for forecast in forecasts:
        risk, quiet = _risks(forecaster, forecast, limits)
        rows.append({
            "order": forecast.order,
            "note": forecast.note,
            "horizon_s": forecast.horizon_s,
            "lead_s": forecast.lead_s.tolist(),
            "bands": {name: forecast.band(name).tolist() for name in QUANTITIES},
            "others": {
                name: {
                    "band": further.band().tolist(),
                    "against_first": asdict(compare(forecast, forecasts[0], rope=name)),
                }
                for name, further in forecast.others.items()
            },
            "risks": [asdict(window) for window in risk],
            "quiet": [asdict(window) for window in quiet],
            "against_first": asdict(compare(forecast, forecasts[0])),
        })  # fmt: skip
    return {
        "bag": args.bag, "origin_s": forecasts[0].origin_s, "sources": lift.sources,
        "limits": asdict(limits), "members": forecasts[0].members, "forecasts": rows,
        "problems": list(lift.problems),
    }  # fmt: skip


def _print_score(args: argparse.Namespace, lift: RecordedLift, scored: RecordingScore) -> None:
    if args.json:
        events = [{"span_s": event.span_s, **asdict(event.score)} for event in scored.events]
        print_json({
            "bag": args.bag, "sources": lift.sources, "origins": scored.origins,
            "limit_n": scored.limit_n, "coverage": scored.coverage,
            "leads": [asdict(lead) for lead in scored.leads], "events": events,
            "factor": scored.factor, "problems": list(lift.problems),
        })  # fmt: skip
        return
    print(f"{scored.origins} origins; tension of {lift.sources[2]}; the 90 % band held "
          f"{100.0 * scored.coverage:.1f} % of the time\n")  # fmt: skip
    rows = [["lead", "band held %", "skill", "CRPS kN", "CRPS gain", "width", "spread factor"]]
    for lead, factor in zip(scored.leads, scored.factor, strict=True):
        rows.append([
            f"{lead.lead_s:g} s", f"{100.0 * lead.coverage:.0f}", f"{lead.skill:.2f}",
            f"{lead.crps * 1e-3:.2f}", f"{lead.crps_gain:.2f}", f"{lead.width:.2f}",
            f"{factor:.2f}",
        ])  # fmt: skip
    print_table(rows)
    print()
    rows = [[f"P(T > {kilonewtons(scored.limit_n)}) within", "base rate", "Brier score",
             "gain %", "probability: came (n)"]]  # fmt: skip
    for event in scored.events:
        scores = event.score
        classes = ", ".join(
            f"{c.probability:.2f}: {c.frequency:.2f} ({c.count})" for c in scores.classes
        )
        gain = "certain" if math.isnan(scores.gain) else f"{100.0 * scores.gain:.0f}"
        rows.append([f"{event.span_s:g} s", f"{scores.base_rate:.2f}", f"{scores.score:.3f}", gain,
                     classes])  # fmt: skip
    print_table(rows, words_last=True)


def _draw_forecasts(
    path: Path, lift: RecordedLift, sample: int, forecasts: list[TensionForecast]
) -> None:
    """Draw two minutes of the recording, the band ahead, and what the recording has after it."""
    from rope_twin.forecast.heave_process import SAMPLE_S
    from rope_twin.studies.picture import Line, Panel, draw_panels

    panels = []
    for forecast in forecasts:
        first, last = max(sample - 240, 0), min(sample + 120, len(lift.tension_n) - 1)
        number = np.arange(first, last + 1)
        time: NDArray[np.float64] = np.asarray(lift.begin_s + number * SAMPLE_S - forecast.origin_s)
        low, middle, high = forecast.band() * 1e-3
        panels.append(
            Panel(
                f"{forecast.order}; known to {forecast.horizon_s:g} s", "time from the origin [s]",
                "top tension [kN]",
                (
                    Line(time, lift.tension_n[number] * 1e-3, "recorded", "k-"),
                    Line(forecast.lead_s, low, "5 and 95 %", "C0-"),
                    Line(forecast.lead_s, high, "", "C0-"),
                    Line(forecast.lead_s, middle, "50 %", "C0--"),
                ),
            )
        )  # fmt: skip
    draw_panels(f"Forecast at {forecasts[0].origin_s:g} s", panels, path)


COMMANDS = {
    "learn": Command(_add_learn, _run_learn, LEARN_EXAMPLES, LEARN_MORE),
    "ahead": Command(_add_ahead, _run_ahead, AHEAD_EXAMPLES, AHEAD_MORE),
}
