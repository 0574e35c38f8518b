"""`rope_twin ahead BAG`: forecast a recorded lift, compare orders, or score the forecasts."""

from __future__ import annotations

import argparse
import math
import sys
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rope_twin.cli import CaseProgress, ExitCode, print_json, print_table
from rope_twin.errors import InputError
from rope_twin.quantity import kilonewtons
from rope_twin.run.options import add_json, add_time, measure

if TYPE_CHECKING:
    from rope_twin.forecast.offline import RecordingForecaster, RecordingScore
    from rope_twin.forecast.recorded_lift import RecordedLift
    from rope_twin.forecast.risk import Limits, QuietWindow, Risk
    from rope_twin.forecast.tension_forecast import TensionForecast

EXAMPLES = (
    "ahead lift --at 10min --limit 380kN",
    "ahead lift --what-if lower:0.5 haul:0.5 stop",
    "ahead lift --score --every 30s",
)
MORE = """Heave is forecast from its last ten minutes, and tension by ropes that each follow one
possible heave. Beyond the horizon that is printed the band is what this sea does to this rope at
any time. ORDER is hold, stop, lower:SPEED, haul:SPEED, land:SPEED, compensation:on or
compensation:off, for all winches or, as in stop@WINCH, for one of them; all are compared on the
same heave, and nothing is commanded."""
MEMBERS_MOST = 960  # that of the node's parameter `members`
SHOWN_S = (2.0, 5.0, 10.0, 20.0, 30.0, 60.0)
FORCE_HELP = "tension limit (default: that of the scene, by tension or utilisation)"


def add_arguments(parser: argparse.ArgumentParser) -> None:
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


def run(args: argparse.Namespace) -> int:
    """Forecast or score, and print. Raises RopeTwinError."""
    from rope_twin.forecast.heave_process import MotionError
    from rope_twin.forecast.offline import RecordingForecaster
    from rope_twin.forecast.orders import read_order
    from rope_twin.forecast.recorded_lift import read_lift, tension_unit_warning
    from rope_twin.forecast.risk import Limits, tension_limits
    from rope_twin.forecast.tension_forecast import ERROR_MARGIN, ForecastSettings
    from rope_twin.studies.picture import check_picture

    _check(args)
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
        _print_score(args, lift, scored)
        return ExitCode.OK
    sample = forecaster.sample_of(args.at)
    orders = [read_order("hold"), *what_if] if what_if else [read_order("continue")]
    forecasts = forecaster.at(sample, orders)
    if args.picture is not None:
        _draw(args.picture, lift, sample, forecasts)
    if args.json:
        print_json(_figures(args, lift, forecaster, forecasts, limits))
        return ExitCode.OK
    _print_forecasts(lift, forecaster, forecasts, limits)
    return ExitCode.OK


def _check(args: argparse.Namespace) -> None:
    """Refuse what would fail only after the forecast, or would be left out without a word."""
    from rope_twin.forecast.heave_process import AHEAD_S, SAMPLE_S
    from rope_twin.forecast.risk import WINDOW_STARTS_S

    if args.limit is not None and args.limit <= 0.0:
        raise InputError("--limit", f"it is {args.limit:g} N", "give more than 0")
    if args.members > MEMBERS_MOST:
        remedy = f"give at most {MEMBERS_MOST}"
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
        for rope in forecast.hung:
            difference = compare(forecast, forecasts[0], rope=rope)
            peaks = [f"{value * 1e-3:+.1f}" for value in difference.peak_n]
            in_rope = f" in {rope}" if forecast.others else ""
            rows.append([f"{forecast.order}{in_rope}", *peaks, f"{100.0 * difference.lower:.0f} %"])
    print_table(rows)


def _figures(
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


def _draw(path: Path, lift: RecordedLift, sample: int, forecasts: list[TensionForecast]) -> None:
    """Draw two minutes of the recording, the band ahead, and what the recording has after it."""
    import numpy as np
    from numpy.typing import NDArray

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
