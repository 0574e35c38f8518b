"""`python -m benchmarks speed | order | ... | report`: speed and error.

A speed is never reported without its error. `report` writes docs/performance.md from speed, order,
ensemble and a stored comparison with peer codes.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from benchmarks import (
    compile_time,
    console_endurance,
    console_speed,
    effect_page,
    effect_speed,
    ensemble_speed,
    error_interval,
    fleet_speed,
    lane_gain,
    line_speed,
    orders,
    performance_page,
    speed,
    statics_speed,
    vortex_speed,
)
from benchmarks.foresight import heave as heave_ahead
from benchmarks.foresight import tension as tension_ahead
from benchmarks.peers import page as peers_page
from benchmarks.peers import race as peers
from benchmarks.peers import vortices as vortex_peer
from rope_twin.cli import CaseProgress, CommandLine, exit_code, print_table
from rope_twin.errors import InputError
from rope_twin.forecast.tension_forecast import ForecastSettings
from rope_twin.scene.load import scene_names
from rope_twin.studies.picture import check_picture


class Action(NamedTuple):
    """One thing that can be measured."""

    measure: Callable[[argparse.Namespace, CaseProgress], int]  # returns the exit code
    about: str
    description: str = ""
    options: tuple[Callable[[argparse.ArgumentParser], None], ...] = ()  # besides --quick


def main(argv: Sequence[str] | None = None) -> int:
    """Read the command line, measure what it asks for, return the exit code."""
    return exit_code(partial(_command, argv))


def _command(argv: Sequence[str] | None) -> int:
    about = "Benchmarks: how fast the solver is, and how right."
    parser = CommandLine(prog="python -m benchmarks", description=about)
    actions = parser.add_subparsers(dest="action", required=True, metavar=" | ".join(ACTIONS))
    for name, action in ACTIONS.items():
        description = f"{action.about[0].upper()}{action.about[1:]}. {action.description}"
        command_parser = actions.add_parser(name, help=action.about, description=description)
        for declare in action.options:
            declare(command_parser)
        command_parser.add_argument(
            "--quick", action="store_true", help="a few small cases, for a test"
        )
        command_parser.set_defaults(measure=action.measure)
    args = parser.parse_args(argv)
    return int(args.measure(args, CaseProgress()))


def _json_option(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--json", action="store_true", help="one JSON object instead of tables")


def _hours_option(parser: argparse.ArgumentParser) -> None:
    about = "instead: growth of page and server over so many hours of rows, faster than real time"
    parser.add_argument("--hours", type=float, metavar="H", help=about)


def _picture_option(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--picture", type=Path, metavar="PNG", help="draw it, too")


def _scenes_option(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("scenes", nargs="*", metavar="SCENE", help="only these (default: all)")


def _effects_option(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("effects", nargs="*", metavar="EFFECT", help="only these (default: all)")


def _rows_option(parser: argparse.ArgumentParser) -> None:
    text = "put each row into the page in DIR as it is found; others are kept"
    parser.add_argument("--into", type=Path, metavar="DIR", help=text)


def _variants_options(parser: argparse.ArgumentParser) -> None:
    count, seed = error_interval.VARIANTS, error_interval.SEED
    text = "number of variants (default: %(default)s)"
    parser.add_argument("--variants", type=int, default=count, metavar="N", help=text)
    text = "seed of the draws (default: %(default)s)"
    parser.add_argument("--seed", type=int, default=seed, metavar="S", help=text)
    text = "write the result into error_interval.md in DIR"
    parser.add_argument("--into", type=Path, metavar="DIR", help=text)


def _page_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--into", type=Path, default=Path("docs"), metavar="DIR", help="where to")
    parser.add_argument(
        "--peers",
        type=Path,
        metavar="JSON",
        help="output of the action peers with --json; peers.json beside the page, if it is there",
    )


def _tell(args: argparse.Namespace, rows: Sequence[Any], table: Sequence[Sequence[str]]) -> None:
    """Print rows as one JSON object or as a table."""
    if args.json:
        print(json.dumps({"rows": rows}, ensure_ascii=False, allow_nan=False))
    else:
        print_table(table)


def _report(args: argparse.Namespace, progress: CaseProgress) -> int:
    check_picture(args.into / performance_page.PICTURE)
    stored = args.into / peers_page.STORED if args.peers is None else args.peers
    raced = peers_page.read_race(stored) if args.peers or stored.exists() else None
    fast = speed.measure_speed(speed.QUICK if args.quick else speed.FULL, progress.show)
    curves = orders.measure_orders(orders.QUICK if args.quick else orders.FULL, progress.show)
    cases = ensemble_speed.QUICK if args.quick else ensemble_speed.FULL
    ensembles = ensemble_speed.ensemble_rows(cases, progress.show)
    args.into.mkdir(parents=True, exist_ok=True)
    orders.draw_orders(curves, args.into / performance_page.PICTURE)
    page = args.into / "performance.md"
    text = performance_page.as_markdown(fast, curves, ensembles)
    if raced is not None:
        peers_page.draw_race(raced, args.into / peers_page.PICTURE)
        text += "\n" + peers_page.as_section(raced)
    page.write_text(text, encoding="utf-8")
    print(page)
    return 0


def _speed(args: argparse.Namespace, progress: CaseProgress) -> int:
    result = speed.measure_speed(speed.QUICK if args.quick else speed.FULL, progress.show)
    if args.json:
        print(json.dumps(asdict(result), ensure_ascii=False, allow_nan=False))
        return 0
    print(result.machine.as_text())
    print(f"errors of the top tension over {result.seconds:g} s, against\n")
    print_table(performance_page.basis_table(result.references))
    for rows in (result.rows, result.snaps):
        print()
        print_table(performance_page.speed_table(rows))
    print(f"\n{performance_page.exponent_words(result)}")
    return 0


def _order(args: argparse.Namespace, progress: CaseProgress) -> int:
    if args.picture is not None:
        check_picture(args.picture)
    curves = orders.measure_orders(orders.QUICK if args.quick else orders.FULL, progress.show)
    if args.picture is not None:
        orders.draw_orders(curves, args.picture)
    _tell(args, [asdict(curve) for curve in curves], performance_page.order_table(curves))
    return 0


def _ensemble(args: argparse.Namespace, progress: CaseProgress) -> int:
    """Run the ensemble benchmark; exit code 1 if a member differs from its own twin."""
    cases = ensemble_speed.QUICK if args.quick else ensemble_speed.FULL
    rows = ensemble_speed.ensemble_rows(cases, progress.show)
    _tell(args, [asdict(row) for row in rows], ensemble_speed.ensemble_table(rows))
    return 1 if any(row.unequal for row in rows) else 0


def _fleet(args: argparse.Namespace, progress: CaseProgress) -> int:
    """Run the benchmark of fleets; exit code 1 if a member failed."""
    plan = fleet_speed.QUICK if args.quick else fleet_speed.FULL
    result = fleet_speed.measure_fleet(plan, progress.show)
    if args.json:
        print(json.dumps(asdict(result), ensure_ascii=False, allow_nan=False))
    else:
        print(result.machine.as_text() + "\n")
        print_table(fleet_speed.fleet_table(result.rows))
        print()
        print_table(fleet_speed.state_table(result.states))
    return 1 if any(row.failed for row in result.rows) else 0


def _lanes(args: argparse.Namespace, progress: CaseProgress) -> int:
    """Run the benchmark of SIMD lanes; exit code 1 if a member differs from stepping alone."""
    cases = lane_gain.QUICK if args.quick else lane_gain.FULL
    rows = lane_gain.gain_rows(cases, progress.show)
    _tell(args, [asdict(row) for row in rows], lane_gain.gain_table(rows))
    return 1 if any(row.unequal for row in rows) else 0


def _statics(args: argparse.Namespace, progress: CaseProgress) -> int:
    """Run the statics benchmark; exit code 1 if a rope has no static equilibrium."""
    nodes = 100 if args.quick else statics_speed.NODES
    rows = [*statics_speed.statics_rows(nodes=nodes)]
    rows += statics_speed.joined_statics_rows(nodes=nodes)
    _tell(args, rows, statics_speed.statics_table(rows))
    return 0 if all(row["found"] for row in rows) else 1


def _lines(args: argparse.Namespace, progress: CaseProgress) -> int:
    plan = line_speed.QUICK if args.quick else line_speed.FULL
    rows = list(line_speed.line_rows(plan, progress.show))
    _tell(args, [asdict(row) for row in rows], line_speed.line_table(rows))
    return 0


def _console(args: argparse.Namespace, progress: CaseProgress) -> int:
    """Run the benchmark of the operator console; exit code 1 if a limit is not met."""
    if args.hours is not None:
        rows = console_endurance.endure(args.hours, progress.show)
    else:
        rows = console_speed.measure(4.0 if args.quick else 20.0, progress.show)
    _tell(args, [asdict(row) for row in rows], console_speed.table(rows))
    return 0 if all(row.met for row in rows) else 1


def _compile(args: argparse.Namespace, progress: CaseProgress) -> int:
    """Run the JIT compile benchmark; exit code 1 if a start takes longer than its limit."""
    scenes = args.scenes or (compile_time.QUICK if args.quick else scene_names())
    rows = list(compile_time.compile_rows(scenes, progress.show))
    content = [{**asdict(row), "ok": row.ok} for row in rows]
    _tell(args, content, compile_time.compile_table(rows))
    return 0 if all(row.ok for row in rows) else 1


def _kept(rows: Iterator[Any], folder: Path | None, page: Any) -> Iterator[Any]:
    """Collect the rows as they are measured; each is written to the page of a folder, if given."""
    if folder is not None:
        page.MARKED.around(folder)
    for row in rows:
        if folder is not None:
            page.keep_rows([row], folder)
        yield row
    if folder is not None:
        print(folder / page.PAGE, file=sys.stderr)


def _effects(args: argparse.Namespace, progress: CaseProgress) -> int:
    """Run the effect benchmark; exit code 1 if the code contains an effect not in the scene."""
    nodes, names = (50, ["current"]) if args.quick else (1000, args.effects)
    names = effect_speed.choose_names(names)
    speeds = effect_speed.effect_speeds(nodes, names, progress.show)
    rows = list(_kept(speeds, args.into, effect_page))
    _tell(args, [effect_page.as_json(row) for row in rows], effect_page.effect_table(rows))
    return 1 if any(row.symbols_off for row in rows) else 0


def _vortices(args: argparse.Namespace, progress: CaseProgress) -> int:
    cases = vortex_speed.QUICK if args.quick else vortex_speed.FULL
    rows, raced = list(vortex_speed.vortex_rows(cases, progress.show)), None
    paced = vortex_speed.PACE_QUICK if args.quick else vortex_speed.PACE_FULL
    paces = list(vortex_speed.pace_rows(paced, progress.show))
    try:
        plan = vortex_peer.QUICK if args.quick else vortex_peer.FULL
        raced = list(vortex_peer.race_vortices(plan, progress.show))
    except InputError as missing:
        print(missing, file=sys.stderr)
    if args.json:
        print(json.dumps({"rows": rows, "pace": paces, "peer": raced}, allow_nan=False))
        return 0
    print_table(vortex_speed.vortex_table(rows))
    print()
    print_table(vortex_speed.pace_table(paces))
    if raced is not None:
        print()
        print_table(vortex_peer.race_table(raced))
    return 0


def _error_interval(args: argparse.Namespace, progress: CaseProgress) -> int:
    """Run the error-interval benchmark; exit code 1 if too few variants are covered."""
    count, seconds = args.variants, error_interval.SECONDS
    if args.quick:
        count, seconds = error_interval.QUICK_VARIANTS, error_interval.QUICK_SECONDS
    if args.into is not None:
        error_interval.PAGE.around(args.into)
    variants = error_interval.measure_variants(count, args.seed, seconds, progress.show)
    result = error_interval.IntervalResult(args.seed, seconds, tuple(variants))
    if args.into is not None:
        print(error_interval.write_page(result, args.into), file=sys.stderr)
    if args.json:
        print(json.dumps(error_interval.as_json(result), ensure_ascii=False, allow_nan=False))
    else:
        print_table(error_interval.interval_table(result.rows))
        print(f"\n{result.as_sentence()}")
    return 0 if result.ok else 1


def _foresight(args: argparse.Namespace, progress: CaseProgress) -> int:
    """Judge forecasts of heave and tension on drawn seas."""
    heave_origins, tension_origins = (12, 8) if args.quick else (args.heave, args.tension)
    heave = [
        heave_ahead.judge_heave(case, heave_origins, progress.show)
        for case in heave_ahead.CASES[: 1 if args.quick else None]
        if heave_origins
    ]
    settings = ForecastSettings(members=args.members, burn_in_s=args.burn_in)
    cases = [
        replace(case, motion_error_m=0.0) if args.perfect_sensor or args.limit else case
        for case in tension_ahead.CASES[: 1 if args.quick else None]
        if not args.scenes or case.scene in args.scenes
    ]
    tension = [
        tension_ahead.judge_tension(
            case, tension_origins, progress.show, settings, args.seed, args.limit
        )
        for case in cases
        if tension_origins
    ]
    if args.json:
        figures = {"heave": [asdict(row) for row in heave], "tension": [asdict(r) for r in tension]}
        print(json.dumps(figures, ensure_ascii=False))
        return 0
    if heave:
        print_table(heave_ahead.heave_table(heave))
    if tension:
        print()
        print_table(tension_ahead.lead_table(tension))
        print()
        print_table(tension_ahead.event_table(tension), words_last=True)
        for row in tension:
            print(f"{row.case.scene} in {row.case.sea}: {row.cpu_s:.2f} s of CPU a forecast")
    return 0


def _foresight_options(parser: argparse.ArgumentParser) -> None:
    for name, count, meaning in (
        ("--heave", 480, "origins of heave in each case, 0: none"),
        ("--tension", 200, "origins of tension in each case, 0: none"),
        ("--members", 96, "members of a forecast"),
        ("--seed", tension_ahead.SEED, "first seed of the seas of tension"),
    ):
        parser.add_argument(
            name, type=int, default=count, metavar="N", help=f"{meaning} (default: {count})"
        )
    parser.add_argument(
        "--burn-in", type=float, default=119.0, metavar="S",
        help="time that members run through the past (default: 119)",
    )  # fmt: skip
    parser.add_argument(
        "--perfect-sensor", action="store_true", help="a motion sensor without coloured error"
    )
    parser.add_argument(
        "--limit", action="store_true",
        help="what past heave can tell of tension at all: perfect sensor, known spectrum and rope",
    )  # fmt: skip


def _peers(args: argparse.Namespace, progress: CaseProgress) -> int:
    if args.picture is not None:
        check_picture(args.picture)
    raced = peers.race(peers.QUICK if args.quick else peers.FULL, progress.show)
    if args.picture is not None:
        peers_page.draw_race(raced, args.picture)
    if args.json:
        print(json.dumps(raced.as_json(), ensure_ascii=False, allow_nan=False))
    else:
        print(raced.machine.as_text() + "\n")
        print_table(peers_page.peer_table(raced.rows))
    return 0


ACTIONS = {
    "speed": Action(
        _speed,
        "cost of a step and error of the top tension, 20 to 7,000 nodes",
        "Runs the study's scenes on one core, a minute of twin time each, against converged "
        "references (some three minutes in all).",
        (_json_option,),
    ),
    "order": Action(
        _order,
        "orders of convergence in step and element length",
        options=(_picture_option, _json_option),
    ),
    "ensemble": Action(
        _ensemble,
        "a thousand ropes together, beside one alone; some run again alone for equality",
        options=(_json_option,),
    ),
    "fleet": Action(
        _fleet,
        "short horizons of many members from one state, with the error of their mesh and step",
        "Runs 100 members, and four orders of the winch in 48 seas, for a minute of twin time "
        "(some two minutes).",
        (_json_option,),
    ),
    "lanes": Action(
        _lanes,
        "gain of SIMD lanes by effect, steps given up and equality with members alone",
        options=(_json_option,),
    ),
    "lines": Action(
        _lines,
        "what an element costs where ropes meet, beside one rope",
        "Steps a rope, the same rope cut in three, and a loop in turns (some two minutes).",
        (_json_option,),
    ),
    "statics": Action(
        _statics, "time to come to rest, from good and bad guesses", options=(_json_option,)
    ),
    "console": Action(
        _console,
        "CPU of the operator console's server and browser, topic to pixel, first paint, size",
        "Serves a made-up rope to Chromium on this machine (some two minutes; an hour of --hours "
        "takes five minutes).",
        (_hours_option, _json_option),
    ),
    "compile": Action(
        _compile,
        "the first and the second start of each set of effects, against 20 s and 1 s",
        "Each in a fresh process with an empty cache (some seven minutes).",
        (_scenes_option, _json_option),
    ),
    "effects": Action(
        _effects,
        "what each effect costs a step, and that it costs nothing where it is not listed",
        "Steps 1,000 elements without the effect, without it again, and with it, in turns, and "
        "looks for it in the compiled code (some five minutes, most of them compiling).",
        (_effects_option, _rows_option, _json_option),
    ),
    "vortices": Action(
        _vortices,
        "cost of the vortex models at steps of 1 ms, how fast those beside the step and [LCD]'s "
        "run, and MoorDyn's model on the curved pipe",
        "MoorDyn is no part of rope_twin; where it is missing the command says how to get it, and "
        "the rest runs without.",
        (_json_option,),
    ),
    "error_interval": Action(
        _error_interval,
        "coverage and cost of the error interval in random variants of the scenes",
        "Draws variants of the shipped scenes by a seed and compares each with a reference of four "
        "times the elements and a quarter of the step (some fifteen minutes).",
        (_variants_options, _json_option),
    ),
    "foresight": Action(
        _foresight,
        "forecasts of heave, tension and risk against what then happened, on seas drawn by seed",
        "Hidden ropes with figures of their own, a motion sensor with a coloured error and a noisy "
        "load pin (some ten minutes).",
        (_scenes_option, _foresight_options, _json_option),
    ),
    "peers": Action(
        _peers,
        "MoorDyn and CableDyn on the same scenes, and rope_twin at the same error",
        "Searches each peer's best setting and races it (some eight minutes). The peers are no "
        "part of rope_twin; where they are missing the command says how to get them.",
        (_picture_option, _json_option),
    ),
    "report": Action(
        _report, "speed, order, ensemble and peers as performance.md", options=(_page_options,)
    ),
}


if __name__ == "__main__":
    sys.exit(main())
