"""`rope_twin viv SCENE`: vortex-induced vibration of a line in its current profile."""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rope_twin.cli import ExitCode, print_json, print_table
from rope_twin.effects.coupled_vibration import ModalVibrationParams
from rope_twin.errors import InputError
from rope_twin.run.options import add_duration, add_json, add_out, add_scene
from rope_twin.scene.lift import lift_figures
from rope_twin.scene.load import load_scene
from rope_twin.scene.rigging import is_joined
from rope_twin.scene.schema import Scene
from rope_twin.scene.vortex import model_beside, shedding_model, vortex_words
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
    strain_words,
    time_domain_figures,
    time_domain_words,
    write_all,
    write_time_domain,
)
from rope_twin.studies.viv_time_domain import run_time_domain, with_model
from rope_twin.vortex.coupled import shedding_of
from rope_twin.vortex.fatigue import STRESS_CURVES, StressCurve, find_stress_curve
from rope_twin.vortex.shedding import Shedding

SHOWN = 10  # modes in the table, those that move most
HEAD = ("mode", "Hz", "excited m", "rms A/D")


EXAMPLES = (
    "viv deep_lift --out viv",
    "viv cable_waves --time-domain --duration 10min --json",
    "viv viv_in_heave --time-domain --duration 200s",
)
MORE = """Frequency domain: response in natural modes across the current, about static equilibrium
(Le Cunff and Durand 1999); the fatigue damage is that of bending alone. Time domain: a run of the
scene with heave and winch, by the VIV model that it lists, else by the same modes, which follow
tension, length and current; the fatigue damage is that of tension and bending."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
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


def run(args: argparse.Namespace) -> int:
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


class Assessed(NamedTuple):
    """Assessment of one line of a scene."""

    name: str
    figures: dict[str, Any]
    show: Callable[[], None]  # prints it
    files: list[Path]  # pictures and tables that were written


def _frequency_domain(
    args: argparse.Namespace, scene: Scene, curve: StressCurve
) -> Iterator[Assessed]:
    shedding = _shedding(args, scene)
    for lying in spans_of(scene):
        response = run_frequency_domain(lying, shedding, args.duration)
        fatigue = count_fatigue(response, scene, curve)
        name = " + ".join(scene.ropes[number].name for number in reversed(lying.ropes))
        files: list[Path] = []
        if args.out is not None:
            title = f"{scene.name}, {name}" if is_joined(scene) else scene.name
            files = write_all(title, response, fatigue, _folder_of(args.out, scene, name))
        sums = _summary(response, fatigue)
        yield Assessed(name, sums, partial(_show, sums), files)


def _time_domain(args: argparse.Namespace, scene: Scene, curve: StressCurve) -> Iterator[Assessed]:
    scene = with_model(scene, args.strouhal, args.damping)
    if not is_joined(scene) and (warning := vortex_words(scene, lift_figures(scene))):
        print(warning, file=sys.stderr)  # required resolution, and its cost
    for response in run_time_domain(scene, args.duration, args.fatigue):
        files: list[Path] = []
        if args.out is not None:
            files = write_time_domain(response, _folder_of(args.out, scene, response.line))
        warning = time_domain_words(response)
        yield Assessed(response.line, time_domain_figures(response), partial(print, warning), files)


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


def _summary(run: FrequencyDomainRun, fatigue: Fatigue) -> dict[str, Any]:
    rms, span = run.rms(), run.response.span
    largest = int(rms.argmax())
    damage = fatigue.damage_per_year
    steel = bool(np.isfinite(damage).any())
    fastest = run.response.shedding.strouhal * (span.speed / span.diameter).max()
    return {
        "strouhal_max_hz": float(fastest),
        "modes_known": len(run.response.frequency),
        "modes": _rows(run),
        "rms_max_diameters": float(rms[largest]),
        "rms_max_at_m": float(run.from_top_m[largest]),
        "frequency_there_hz": float(run.frequency_hz()[largest]),
        "drag_amplification_max": float(run.drag_amplification().max()),
        "strain_rms_max": float(fatigue.strain_rms.max()),
        "stress_rms_max_pa": float(np.nanmax(fatigue.stress_rms_pa)) if steel else None,
        "damage_per_year_max": float(np.nanmax(damage)) if steel else None,
    }  # fmt: skip


def _rows(run: FrequencyDomainRun) -> list[dict[str, Any]]:
    """Return the responding modes, SHOWN at most, from the lowest up."""
    modes = most_moved(run, SHOWN)
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


def _show(sums: dict[str, Any]) -> None:
    cells = [
        (str(row["mode"]), f"{row['frequency_hz']:.4g}", f"{row['driven_m']:.4g}",
         f"{row['rms_diameters']:.3g}")
        for row in sums["modes"]
    ]  # fmt: skip
    if cells:
        print_table([HEAD, *cells])
    else:
        print("no mode is excited")
    print(
        f"\n{sums['modes_known']} modes in the lock-in or damping range; shedding frequency up to "
        f"{sums['strouhal_max_hz']:.3g} Hz\n"
        f"maximum rms A/D {sums['rms_max_diameters']:.3g} at {sums['rms_max_at_m']:.4g} m below "
        f"the upper end, {sums['frequency_there_hz']:.3g} Hz\n"
        f"(published VIV codes differ from each other by a factor of 1.7)\n"
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
