"""`rope_twin viv SCENE`: vortex-induced vibration of the scene's rope in its current."""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from rope_twin.commands.console import print_table
from rope_twin.effects.modal_vibration import ModalVibrationParams
from rope_twin.errors import InputError, phrase
from rope_twin.scene.figures import lift_figures
from rope_twin.scene.load import load_scene
from rope_twin.scene.rules.rigging import is_joined
from rope_twin.scene.rules.shedding import model_beside, shedding_model, vortex_words
from rope_twin.scene.schema import Scene
from rope_twin.studies.viv.beside import beside_json, beside_table, draw_beside, run_shaken
from rope_twin.studies.viv.moving import MovingRun, draw_moving, run_moving
from rope_twin.studies.viv.own import run_own
from rope_twin.studies.viv.own_picture import own_figures, own_words, write_own
from rope_twin.studies.viv.picture import check_folder, write_all
from rope_twin.studies.viv.study import Fatigue, VivRun, count_fatigue, most_moved, run_viv
from rope_twin.twin.fatigue.curves import STRESS_CURVES, StressCurve, find_stress_curve
from rope_twin.twin.vibration.drag_amplification import shedding_of
from rope_twin.viv.shedding import Shedding

SHOWN = 10  # modes in the table, those that move most
HEAD = ("mode", "Hz", "driven m", "rms/d")


def add_parser(subparsers: argparse._SubParsersAction[Any]) -> None:
    """Add `viv`."""
    parser = subparsers.add_parser(
        "viv",
        help="vortex-induced vibration of a scene's rope in its current",
        description="What the current can lock, what the rope then does and what that costs it: "
        "response in natural modes across the current, about the rope at rest (Le "
        "Cunff and Durand 1999). Damage is that of bending alone; with --own, of tension and "
        "bending together.",
    )
    parser.add_argument("scene", metavar="SCENE", help="a scene's name, or the path of a YAML file")
    parser.add_argument("--for", dest="duration", type=float, default=300.0, metavar="S",
                        help="simulated time; its second half counts (default: 300 s)")  # fmt: skip
    parser.add_argument("--into", type=Path, metavar="DIR", help="pictures and Parquet tables")
    parser.add_argument("--strouhal", type=float, metavar="ST",
                        help="Strouhal number (default: that of the scene's modal_vibration, else "
                        f"{Shedding.strouhal:g})")  # fmt: skip
    parser.add_argument("--structural", type=float, metavar="ZETA",
                        help="structural damping of every mode over critical (default: that of the "
                        f"scene's modal_vibration, else {Shedding.structural:g}, an assumption)",
                        )  # fmt: skip
    parser.add_argument("--curve", default="stranded_wire",
                        help=f"S-N curve of stress: {', '.join(sorted(STRESS_CURVES))} (default: "
                        "stranded_wire)")  # fmt: skip
    parser.add_argument("--moving", type=float, metavar="S",
                        help="beside a running twin, too: its regular heave and winch, modes found "
                        "again every S seconds")  # fmt: skip
    parser.add_argument("--beside", metavar="SCENE",
                        help="in place of modes: both scenes by the vortex model that each lists, "
                        "side by side")  # fmt: skip
    parser.add_argument("--own", action="store_true",
                        help="in place of modes: by the vortex model that the scene lists, in "
                        "the run of its twin")  # fmt: skip
    parser.add_argument("--json", action="store_true", help="one JSON object instead of words")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Run it and show it; raises RopeTwinError."""
    curve = _checked(args)
    scene = load_scene(args.scene)
    if args.beside is not None:
        return _beside(args, scene)
    if args.own:
        return _own(args, scene)
    shedding = _shedding(args, scene)
    found = run_viv(scene, shedding, args.duration)
    fatigue = count_fatigue(found, scene, curve)
    files = write_all(scene.name, found, fatigue, args.into) if args.into is not None else []
    moving = None
    if args.moving is not None:
        moving = run_moving(scene, shedding, args.duration, args.moving)
        if args.into is not None:
            files.append(args.into / "moving.png")
            draw_moving(scene.name, moving, files[-1])
    if args.json:
        told = {"scene": scene.name, **_summary(found, fatigue), "files": [str(f) for f in files]}
        if moving is not None:
            told["moving"] = _moving(moving)
        print(json.dumps(told, ensure_ascii=False, allow_nan=False))
        return 0
    _show(found, fatigue)
    _show_moving(moving)
    if words := _of_its_own(scene):
        print(words)
    for path in files:
        print(path)
    return 0


def _checked(args: argparse.Namespace) -> StressCurve:
    """The curve that is named; raises InputError for an option that cannot be."""
    for name, value, low, high in (
        ("--for", args.duration, 1.0, 36000.0),
        ("--strouhal", args.strouhal, 0.05, 0.5),
        ("--structural", args.structural, 0.0, 0.5),
    ):
        if value is not None and not low <= value <= high:
            raise InputError(phrase(name, f"{value:g}", f"give {low:g} to {high:g}"))
    curve = find_stress_curve("--curve", args.curve)
    if args.into is not None:
        check_folder(args.into)
    return curve


def _shedding(args: argparse.Namespace, scene: Scene) -> Shedding:
    """The scene's own figures if it lists these modes, with what the options say instead."""
    params, density = model_beside(scene), scene.environment.water_density_kg_per_m3
    own = Shedding(density=density)
    if isinstance(params, ModalVibrationParams):
        own = shedding_of(params, density)
    given = {"strouhal": args.strouhal, "structural": args.structural}
    return replace(own, **{name: value for name, value in given.items() if value is not None})


def _of_its_own(scene: Scene) -> str:
    """Where to see what the scene's own model does; "" if it lists none."""
    model = shedding_model(scene)
    return f"(in modes; what the scene's own {model} does to the rope: --own)" if model else ""


def _own(args: argparse.Namespace, scene: Scene) -> int:
    if args.moving is not None:
        right = "leave one of them out"
        raise InputError(phrase("--own", "--moving is a rope in modes", right))
    _say_what_it_wants(scene)
    found = run_own(scene, args.duration, args.curve)
    files = write_own(found, args.into) if args.into is not None else []
    if args.json:
        told = {"scene": scene.name, **own_figures(found), "files": [str(path) for path in files]}
        print(json.dumps(told, ensure_ascii=False, allow_nan=False))
        return 0
    print(own_words(found))
    for path in files:
        print(path)
    return 0


def _say_what_it_wants(scene: Scene) -> None:
    """What the scene's model wants of elements and steps, and what right ones would cost."""
    if not is_joined(scene) and (words := vortex_words(scene, lift_figures(scene))):
        print(words, file=sys.stderr)


def _beside(args: argparse.Namespace, scene: Scene) -> int:
    other = load_scene(args.beside)
    for own in (scene, other):
        _say_what_it_wants(own)
    runs = tuple(run_shaken(own, args.duration) for own in (scene, other))
    files = []
    if args.into is not None:
        files.append(args.into / "beside.png")
        draw_beside(runs, files[-1])
    if args.json:
        told = {"runs": beside_json(runs), "files": [str(path) for path in files]}
        print(json.dumps(told, ensure_ascii=False, allow_nan=False))
        return 0
    print_table(beside_table(runs))
    print("(published VIV codes differ among each other by a factor of 1.7)")
    for path in files:
        print(path)
    return 0


def _moving(run: MovingRun) -> dict[str, float]:
    return {
        "rms_max_diameters": float(run.rms.max()),
        "rms_constant_max_diameters": float(run.rms_constant.max()),
        "tension_top_min_n": float(run.tension_top_n.min()),
        "tension_top_max_n": float(run.tension_top_n.max()),
        "solves": run.solves,
        "cost_of_real_time": run.cost,
        "slack_share": run.slack_share,
    }


def _show_moving(run: MovingRun | None) -> None:
    if run is None:
        return
    own = _moving(run)
    print(
        f"beside the twin: rms A/d at most {own['rms_max_diameters']:.3g}, at constant "
        f"tension {own['rms_constant_max_diameters']:.3g}; modes found {own['solves']} "
        f"times, {own['cost_of_real_time']:.2%} of real time in all"
    )


def _summary(found: VivRun, fatigue: Fatigue) -> dict[str, Any]:
    rms, span = found.rms(), found.response.span
    at = int(rms.argmax())
    worst = fatigue.damage_per_year
    steel = bool(np.isfinite(worst).any())
    fastest = found.response.shedding.strouhal * (span.speed / span.diameter).max()
    return {
        "strouhal_max_hz": float(fastest),
        "modes_known": len(found.response.frequency),
        "modes": _rows(found),
        "rms_max_diameters": float(rms[at]),
        "rms_max_at_m": float(found.from_top_m[at]),
        "frequency_there_hz": float(found.frequency_hz()[at]),
        "drag_amplification_max": float(found.drag_amplification().max()),
        "stress_rms_max_pa": float(np.nanmax(fatigue.stress_rms_pa)) if steel else None,
        "damage_per_year_max": float(np.nanmax(worst)) if steel else None,
    }  # fmt: skip


def _rows(found: VivRun) -> list[dict[str, Any]]:
    """The modes that move, SHOWN at most, from the lowest up."""
    most = most_moved(found, SHOWN)
    driven = found.response.zones.T @ found.response.span.node_length
    return [
        {
            "mode": int(mode) + 1,
            "frequency_hz": float(found.response.frequency[mode]),
            "driven_m": float(driven[mode]),
            "rms_diameters": float(found.modal_rms[mode]),
        }
        for mode in most
    ]


def _show(found: VivRun, fatigue: Fatigue) -> None:
    told = _summary(found, fatigue)
    cells = [
        (str(row["mode"]), f"{row['frequency_hz']:.4g}", f"{row['driven_m']:.4g}",
         f"{row['rms_diameters']:.3g}")
        for row in told["modes"]
    ]  # fmt: skip
    if cells:
        print_table([HEAD, *cells])
    else:
        print("no mode is driven")
    print(
        f"\n{told['modes_known']} modes can lock or damp; vortices up to "
        f"{told['strouhal_max_hz']:.3g} Hz\n"
        f"largest rms A/d {told['rms_max_diameters']:.3g} at {told['rms_max_at_m']:.4g} m below "
        f"the hang-off, {told['frequency_there_hz']:.3g} Hz\n"
        f"(published VIV codes differ among each other by a factor of 1.7)\n"
        f"drag at most {told['drag_amplification_max']:.3g} times that of a rope at rest"
    )
    if told["damage_per_year_max"] is None:
        print("no stress: neither a rope all of steel nor a pipe, with its bending listed")
    else:
        print(
            f"bending stress at most {1e-6 * told['stress_rms_max_pa']:.3g} MPa rms, damage "
            f"{told['damage_per_year_max']:.3g} per year; of a stranded rope as if it were solid: "
            "an upper bound"
        )
