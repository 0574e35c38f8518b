"""Commands that analyse the lines of a scene: `modes`, `viv` and `lines`."""

from __future__ import annotations

import argparse
import json
import re
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from functools import partial
from math import inf
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rope_twin.cli import Command, ExitCode, print_json, print_table
from rope_twin.effects.coupled_vibration import ModalVibrationParams
from rope_twin.errors import InputError
from rope_twin.run.options import add_duration, add_json, add_out, add_scene
from rope_twin.scene.lift import lift_figures
from rope_twin.scene.load import load_scene
from rope_twin.scene.rigging import is_joined
from rope_twin.scene.schema import Scene
from rope_twin.scene.vortex import model_beside, shedding_model, vortex_words
from rope_twin.studies.modes import (
    AXIAL,
    DEFAULT_COUNT,
    WAVE_PERIODS_S,
    Mode,
    Modes,
    SystemMode,
    SystemModes,
    find_modes,
    find_system_modes,
)
from rope_twin.studies.picture import check_picture
from rope_twin.studies.two_lines import SEA_STATES, LineRun, draw_lines, record_of, run_lines
from rope_twin.studies.viv_frequency_domain import (
    Fatigue,
    FrequencyDomainRun,
    count_fatigue,
    most_moved,
    run_frequency_domain,
    spans_of,
)
from rope_twin.studies.viv_pictures import (
    check_folder,
    draw_modes,
    growth_figure,
    strain_words,
    time_domain_figures,
    time_domain_words,
    unsettled_words,
    write_all,
    write_time_domain,
)
from rope_twin.studies.viv_time_domain import run_time_domain, with_model
from rope_twin.twin.multi_line_snapshot import lines_of
from rope_twin.twin.snapshot import LineEvent
from rope_twin.twin.twin import Twin
from rope_twin.vortex.coupled import shedding_of
from rope_twin.vortex.fatigue import STRESS_CURVES, StressCurve, find_stress_curve
from rope_twin.vortex.shedding import Shedding

MODE_HEAD = ("mode", "Hz", "period s", "kind", "axial / in / out %", "max at m", "Strouhal Hz",
             "waves")  # fmt: skip
SYSTEM_HEAD = ("mode", "Hz", "period s", "kind", "stretch %", "vertical %", "max at m", "of rope",
               "Strouhal Hz", "waves")  # fmt: skip


MODES_EXAMPLES = (
    "modes deep_lift",
    "modes bridle_lift --count 5 --out modes.png",
)
MODES_MORE = """\
Undamped modes about static equilibrium in the scene's current, with added mass and with
both ends as in the scene: the lowest, then the first axial ones. A multi-line system is solved as
a whole: the lowest modes, then the first that stretch its lines. A rigid body swings and turns."""


def _add_modes(parser: argparse.ArgumentParser) -> None:
    add_scene(parser)
    help_text = f"number of lowest modes (default: {DEFAULT_COUNT}, or all of a coarse mesh)"
    parser.add_argument("--count", type=int, metavar="N", help=help_text)
    add_out(parser, "FILE.png", "draw the mode shapes")
    add_json(parser)


def _run_modes(args: argparse.Namespace) -> int:
    """Solve for the modes and print them. Raises RopeTwinError."""
    if args.out is not None:
        check_picture(args.out)
    scene = load_scene(args.scene)
    modes: Modes | SystemModes
    groups: dict[str, Sequence[Mode | SystemMode]]
    if is_joined(scene):
        modes = find_system_modes(scene, args.count)
        groups, more = {"lowest": modes.lowest, "stretching": modes.stretching}, {}
    else:
        modes = find_modes(scene, args.count)
        groups = {"lowest": modes.lowest, "axial": modes.axial}
        more = {"strouhal_max_hz": modes.strouhal_max_hz}
    if args.out is not None:
        draw_modes(scene.name, modes, args.out)
    if args.json:
        print_json({"scene": scene.name, **more, "rows": list(_mode_figures(groups))})
    else:
        _show_modes(modes, groups)
    return ExitCode.OK


def _mode_figures(groups: Mapping[str, Sequence[Mode | SystemMode]]) -> Iterator[dict[str, Any]]:
    """Yield the modes without their shapes."""
    for group, modes in groups.items():
        for number, mode in enumerate(modes, 1):
            figures = {k: v for k, v in asdict(mode).items() if k not in ("shape", "shapes")}
            yield {"group": group, "number": number, **figures}


def _show_modes(
    result: Modes | SystemModes, groups: Mapping[str, Sequence[Mode | SystemMode]]
) -> None:
    rows = [
        _mode_row(str(number) if group == "lowest" else f"{group} {number}", mode)
        for group, modes in groups.items()
        for number, mode in enumerate(modes, 1)
    ]
    low, high = WAVE_PERIODS_S
    if len(result.lowest) == result.of_mesh:
        print(f"all {result.of_mesh} modes of the mesh; the highest are those of its elements\n")
    print_table([SYSTEM_HEAD if isinstance(result, SystemModes) else MODE_HEAD, *rows])
    print(f"\nwaves: period over the nearest wave period of {low:g} to {high:g} s; 1: it is one")
    if isinstance(result, SystemModes):
        print("stretch: fraction of the strain energy in elements that stretch; the rest is in the")
        print("rotation of tension. A free mode has no restoring force and no period")
    else:
        print(
            f"Strouhal: shedding frequency {result.strouhal:g}·U/D where the mode has its maximum; "
            f"along the line at most {result.strouhal_max_hz:.3g} Hz"
        )
        if any(mode.kind != AXIAL for mode in result.axial):
            print(
                "axial: this curved line stretches as it sways. A row of another kind is the most "
                "axial mode\nnear the frequency of a straight rope; no mode there moves mainly "
                "along the rope"
            )


def _mode_row(name: str, mode: Mode | SystemMode) -> tuple[str, ...]:
    period, waves = f"{mode.period_s:.4g}", f"{mode.wave_ratio:.3g}"
    largest_at = f"{mode.largest_at_m:.0f}"
    parts: tuple[str, ...]
    shares: tuple[float, ...]
    if isinstance(mode, SystemMode):
        period, waves = (period, waves) if mode.period_s < inf else ("-", "-")
        shares = (mode.stretching_share, mode.vertical_share)
        parts = (*(f"{100.0 * share:.0f}" for share in shares), largest_at, mode.rope)
    else:
        shares = (mode.axial_share, mode.in_plane_share, mode.out_of_plane_share)
        parts = (" / ".join(f"{100.0 * share:.0f}" for share in shares), largest_at)
    hz, shed = f"{mode.frequency_hz:.4g}", f"{mode.strouhal_hz:.3g}"
    return name, hz, period, mode.kind, *parts, shed, waves


MODES_SHOWN = 10  # modes in the table, those that move most
VIV_HEAD = ("mode", "Hz", "excited m", "rms A/D")


VIV_EXAMPLES = (
    "viv deep_lift --out viv",
    "viv cable_waves --time-domain --duration 10min --json",
    "viv viv_in_heave --time-domain --duration 200s",
)
VIV_MORE = """\
Frequency domain: response in natural modes across the current, about static equilibrium
(Le Cunff and Durand 1999); the fatigue damage is that of bending alone. Time domain: a run of the
scene with heave and winch, by the VIV model that it lists, else by the same modes, which follow
tension, length and current; the fatigue damage is that of tension and bending."""


def _add_viv(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add_scene(parser)
    add_duration(parser, "simulated time, of which the second half counts", 300.0)
    add("--strouhal", type=float, metavar="ST",
        help="Strouhal number (default: that of the scene's modal_vibration, else "
        f"{Shedding.strouhal:g})")  # fmt: skip
    add("--damping", type=float, metavar="RATIO",
        help="structural damping ratio of every mode (default: that of the scene's "
        f"modal_vibration, else {Shedding.structural:g}, an assumption)")  # fmt: skip
    add(
        "--fatigue",
        default="stranded_wire",
        metavar="CURVE",
        help=f"S-N curve of stress: {', '.join(sorted(STRESS_CURVES))} (default: %(default)s)",
    )
    add("--time-domain", action="store_true",
        help="run the scene with its VIV model, or the modal one if it lists none (default: "
        "frequency domain)")  # fmt: skip
    add_out(parser, "DIR", "write pictures and Parquet tables there")
    add_json(parser)


def _run_viv(args: argparse.Namespace) -> int:
    """Run the assessment and print it. Raises RopeTwinError."""
    curve = _checked(args)
    scene = load_scene(args.scene)
    assess = _time_domain if args.time_domain else _frequency_domain
    lines = list(assess(args, scene, curve))
    files = [path for line in lines for path in line.files]
    if args.json:
        rows = [{"line": line.name, **line.figures} for line in lines]
        figures = {"lines": rows} if is_joined(scene) else lines[0].figures
        print_json({"scene": scene.name, **figures, "files": [str(path) for path in files]})
        return ExitCode.OK
    for line in lines:
        if is_joined(scene):
            print(f"{line.name}, places below its upper end:")
        line.show()
    if not args.time_domain and (model := shedding_model(scene)):
        print(f"(frequency-domain modes; for the scene's own {model}: --time-domain)")
    for path in files:
        print(path)
    return ExitCode.OK


class LineAssessment(NamedTuple):
    """Assessment of one line of a scene."""

    name: str
    figures: dict[str, Any]
    show: Callable[[], None]  # prints it
    files: list[Path]  # pictures and tables that were written


def _frequency_domain(
    args: argparse.Namespace, scene: Scene, curve: StressCurve
) -> Iterator[LineAssessment]:
    shedding = _shedding(args, scene)
    for lying in spans_of(scene):
        response = run_frequency_domain(lying, shedding, args.duration)
        fatigue = count_fatigue(response, scene, curve)
        name = " + ".join(scene.ropes[number].name for number in reversed(lying.ropes))
        files: list[Path] = []
        if args.out is not None:
            title = f"{scene.name}, {name}" if is_joined(scene) else scene.name
            files = write_all(title, response, fatigue, _folder_of(args.out, scene, name))
        sums = _viv_summary(response, fatigue)
        yield LineAssessment(name, sums, partial(_show_viv, sums), files)


def _time_domain(
    args: argparse.Namespace, scene: Scene, curve: StressCurve
) -> Iterator[LineAssessment]:
    scene = with_model(scene, args.strouhal, args.damping)
    if not is_joined(scene) and (warning := vortex_words(scene, lift_figures(scene))):
        print(warning, file=sys.stderr)  # required resolution, and its cost
    for response in run_time_domain(scene, args.duration, args.fatigue):
        files: list[Path] = []
        if args.out is not None:
            files = write_time_domain(response, _folder_of(args.out, scene, response.line))
        warning = time_domain_words(response)
        yield LineAssessment(
            response.line, time_domain_figures(response), partial(print, warning), files
        )


def _folder_of(folder: Path, scene: Scene, name: str) -> Path:
    """Return the folder for the files of a line: one of its own in a multi-line scene."""
    if not is_joined(scene):
        return folder
    line_folder = folder / re.sub(r"[^\w.+-]+", "_", name)
    check_folder(line_folder)
    return line_folder


def _checked(args: argparse.Namespace) -> StressCurve:
    """Return the named S-N curve. Raises InputError for an impossible option."""
    for name, value, low, high in (
        ("--duration", args.duration, 1.0, 36000.0),
        ("--strouhal", args.strouhal, 0.05, 0.5),
        ("--damping", args.damping, 0.0, 0.5),
    ):
        if value is not None and not low <= value <= high:
            raise InputError(name, f"{value:g} is not possible", f"give {low:g} to {high:g}")
    curve = find_stress_curve("--fatigue", args.fatigue)
    if args.out is not None:
        check_folder(args.out)
    return curve


def _shedding(args: argparse.Namespace, scene: Scene) -> Shedding:
    """Return the parameters of the scene's modal_vibration, with those of the options."""
    params, density = model_beside(scene), scene.environment.water_density_kg_per_m3
    shedding = Shedding(density=density)
    if isinstance(params, ModalVibrationParams):
        shedding = shedding_of(params, density)
    options = {"strouhal": args.strouhal, "structural": args.damping}
    return replace(
        shedding, **{name: value for name, value in options.items() if value is not None}
    )


def _viv_summary(run: FrequencyDomainRun, fatigue: Fatigue) -> dict[str, Any]:
    rms, span = run.rms(), run.response.span
    largest = int(rms.argmax())
    damage = fatigue.damage_per_year
    steel = bool(np.isfinite(damage).any())
    fastest = run.response.shedding.strouhal * (span.speed / span.diameter).max()
    return {
        "strouhal_max_hz": float(fastest),
        "modes_known": len(run.response.frequency),
        "modes": _responding_modes(run),
        "rms_max_diameters": float(rms[largest]),
        "rms_max_at_m": float(run.from_top_m[largest]),
        "frequency_there_hz": float(run.frequency_hz()[largest]),
        **growth_figure(run.growth),
        "drag_amplification_max": float(run.drag_amplification().max()),
        "strain_rms_max": float(fatigue.strain_rms.max()),
        "stress_rms_max_pa": float(np.nanmax(fatigue.stress_rms_pa)) if steel else None,
        "damage_per_year_max": float(np.nanmax(damage)) if steel else None,
    }  # fmt: skip


def _responding_modes(run: FrequencyDomainRun) -> list[dict[str, Any]]:
    """Return the responding modes, MODES_SHOWN at most, from the lowest up."""
    modes = most_moved(run, MODES_SHOWN)
    driven = run.response.zones.T @ run.response.span.node_length
    return [
        {
            "mode": int(mode) + 1,
            "frequency_hz": float(run.response.frequency[mode]),
            "driven_m": float(driven[mode]),
            "rms_diameters": float(run.modal_rms[mode]),
        }
        for mode in modes
    ]


def _show_viv(sums: dict[str, Any]) -> None:
    cells = [
        (str(row["mode"]), f"{row['frequency_hz']:.4g}", f"{row['driven_m']:.4g}",
         f"{row['rms_diameters']:.3g}")
        for row in sums["modes"]
    ]  # fmt: skip
    if cells:
        print_table([VIV_HEAD, *cells])
    else:
        print("no mode is excited")
    print(
        f"\n{sums['modes_known']} modes in the lock-in or damping range; shedding frequency up to "
        f"{sums['strouhal_max_hz']:.3g} Hz\n"
        f"maximum rms A/D {sums['rms_max_diameters']:.3g} at {sums['rms_max_at_m']:.4g} m below "
        f"the upper end, {sums['frequency_there_hz']:.3g} Hz\n"
        f"(published VIV codes differ from each other by a factor of 1.7)\n"
        f"{unsettled_words(sums['rms_second_over_first_half'])}"
        f"drag amplification at most {sums['drag_amplification_max']:.3g}\n"
        f"{strain_words(sums['strain_rms_max'])}"
    )
    if sums["damage_per_year_max"] is None:
        print("no bending stress: that needs steel rope or a pipe, with `bending` in the scene")
    else:
        print(
            f"bending stress at most {1e-6 * sums['stress_rms_max_pa']:.3g} MPa rms, Miner damage "
            f"{sums['damage_per_year_max']:.3g} per year; a stranded rope counts as solid: an "
            "upper bound"
        )


LINES_HEAD = ("line", "sea", "mean kN", "min kN", "max kN", "max over calm mean", "jump %")
SECONDS, MIN_S, MAX_S = 120.0, 10, 7200
SEA_SEED = 1


LINES_EXAMPLES = (
    "lines two_line_loop --duration 5min",
    "lines two_line_loop --sea-state 5 --out two_lines --json",
)
LINES_MORE = """\
Runs the winch schedules twice, calm and on the heave of a vessel in a sea state: tension
of both lines and its smoothness from time step to time step, their clearance, and where they
cross."""


def _add_lines(parser: argparse.ArgumentParser) -> None:
    heights = ", ".join(f"{state} (Hs {hs:g} m)" for state, (hs, _) in SEA_STATES.items())
    add_scene(parser)
    add_duration(parser, "simulated time of each run, in whole seconds", SECONDS)
    parser.add_argument(
        "--sea-state", type=int, choices=tuple(SEA_STATES), default=3, metavar="N",
        help=f"of the second run: {heights} (default: %(default)s)",
    )  # fmt: skip
    add_out(parser, "DIR", "write two_lines.json and two_lines.png there")
    add_json(parser)


def _run_lines(args: argparse.Namespace) -> int:
    """Run both and print the results. Raises RopeTwinError."""
    if not MIN_S <= args.duration <= MAX_S or args.duration % 1.0:
        remedy = f"give a whole number of seconds from {MIN_S} to {MAX_S}"
        raise InputError("--duration", f"{args.duration:g} s is not possible", remedy)
    seconds = int(args.duration)
    if args.out is not None:
        check_picture(args.out / "two_lines.png")
    scene = load_scene(args.scene)
    lines_of(scene)
    twin = Twin(scene)
    state = f"sea state {args.sea_state}"
    calm = run_lines(twin.branch(), seconds, None, _reporter("calm"))
    record = record_of(args.sea_state, SEA_SEED)
    rough = run_lines(twin, seconds, record, _reporter(state))
    summary = {"scene": scene.name, "duration_s": args.duration, "calm": calm.figures()}
    summary |= {"sea_state": args.sea_state, "in_sea_state": rough.figures()}
    if args.json:
        print_json(summary)
    else:
        _show_lines(calm, rough, state)
    if args.out is not None:
        name = f"{scene.name}, calm and in {state}"
        draw_lines(name, calm, rough, state, args.out / "two_lines.png")
        (args.out / "two_lines.json").write_text(json.dumps(summary, indent=1) + "\n")
    return ExitCode.OK


def _reporter(sea: str) -> Any:
    """Return the function that reports a crossing during the run."""

    def report(event: LineEvent) -> None:
        sys.stderr.write(f"{sea}, {event.time_s:.1f} s: {event.words()}\n")

    return report


def _show_lines(calm: LineRun, rough: LineRun, state: str) -> None:
    rows: list[tuple[str, ...]] = [LINES_HEAD]
    for k, line in enumerate(("main", "haulback")):
        mean = calm.tension_n[k].mean()
        for sea, motion in (("calm", calm), (state, rough)):
            row = motion.tension_n[k]
            jump = f"{motion.noise[k].jump_pct:.2g}" if motion.noise is not None else ""
            figures = [f"{1e-3 * value:.1f}" for value in (row.mean(), row.min(), row.max())]
            rows.append((line, sea, *figures, f"{row.max() / mean:.3f}", jump))
    print_table(rows)
    for sea, motion in (("calm", calm), (state, rough)):
        closest = min(motion.nearest, key=lambda approach: approach.distance_m)
        depths = ", ".join(f"{depth:.0f} m" for depth in motion.crossing_m[-1]) or "none"
        print(
            f"{sea}: clearance {closest.distance_m:.2f} m at {closest.depth_m:.0f} m depth and "
            f"{closest.time_s:.1f} s; crossings at the end: {depths}; "
            f"real-time factor {motion.real_time_factor:.1f}"
        )
    print("jump: largest second difference of tension between time steps, calm, over the mean")


COMMANDS = {
    "modes": Command(_add_modes, _run_modes, MODES_EXAMPLES, MODES_MORE),
    "viv": Command(_add_viv, _run_viv, VIV_EXAMPLES, VIV_MORE),
    "lines": Command(_add_lines, _run_lines, LINES_EXAMPLES, LINES_MORE),
}
