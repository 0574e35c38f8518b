"""`rope_twin scene ACTION`: list, show, check and measure scenes; their keys and JSON Schema.

Warnings alone leave the exit code at 0. `check` returns ERROR for a scene that exceeds one of its
limits in static equilibrium.
"""

from __future__ import annotations

import argparse
import json
import re
import shutil
import sys
import textwrap
from collections.abc import Iterator
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

from rope_twin.cli import CaseProgress, Command, ExitCode, print_json, scene_exchange
from rope_twin.effects.current import CurrentParams
from rope_twin.errors import SceneError, did_you_mean, phrase
from rope_twin.messages.diagnostics import breach_words, compressed_words
from rope_twin.quantity import kilonewtons, rounded
from rope_twin.run.options import add_command, add_duration, add_json, add_scene
from rope_twin.scene.convergence import known_error
from rope_twin.scene.error_bound import format_bound
from rope_twin.scene.lift import (
    LiftFigures,
    lift_figures,
    listed_effects,
    stretch_m,
    suspended_weights,
)
from rope_twin.scene.load import load_scene, scene_names
from rope_twin.scene.reference import scene_keys, scene_schema
from rope_twin.scene.rigging import is_joined
from rope_twin.scene.rope_warnings import accepted_warnings, sense_checks
from rope_twin.scene.schema import RopeLine, Scene, ScheduleRow, SeaState, Winch
from rope_twin.studies.effect_cost import effect_table, measure_effects
from rope_twin.twin.ensemble.ensemble import whole_steps
from rope_twin.twin.snapshot import CONTROL_MODES
from rope_twin.twin.twin import Twin
from rope_twin.twin.winch.commands import WinchCommand, motion_of

NARROWEST = 40  # what a line of keys needs
WIDEST = 100  # columns of the list, on a terminal that has more


EXAMPLES = (
    "scene list",
    "scene list --json",
    "scene show deep_lift",
    "scene check my_lift.yaml",
    "scene keys winch.drum",
)
MORE = """A scene is a YAML file with lines, payload, winch, vessel motion, environment and effects
of one lift (OrcaFlex: model). Wherever a command takes a SCENE, a name and a path both work."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add `scene` with its actions."""
    actions = parser.add_subparsers(dest="action", required=True, metavar="ACTION")
    shipped = add_command(actions, "list", "list the shipped scenes", EXAMPLES[:2])
    add_json(shipped)
    keys = add_command(actions, "keys", "list the keys of a scene file with units and ranges",
                       ("scene keys", "scene keys winch.drum"))  # fmt: skip
    help_text = "only keys with this in their path, such as winch.drum (default: all)"
    keys.add_argument("part", metavar="PART", nargs="?", default="", help=help_text)
    add_json(keys)
    show = add_command(actions, "show", "show the contents of a scene and derived values",
                       ("scene show deep_lift", "scene show my_lift.yaml"))  # fmt: skip
    add_scene(show)
    add_json(show)
    check = add_command(
        actions, "check", "check a scene file for errors and implausible values",
        ("scene check my_lift.yaml", "scene check deep_lift --json"),
        "Reports file, line, key, problem and remedy of every error, and warns about valid but "
        "implausible values. Exit code 1: invalid, or a limit is exceeded in static equilibrium.",
    )  # fmt: skip
    add_scene(check)
    add_json(check)
    measure = add_command(
        actions, "measure", "measure the CPU cost of each effect and its influence on top tension",
        ("scene measure deep_lift", "scene measure deep_lift --duration 2min --json"),
        "Runs the scene as it is, without each effect that it lists and with each that it does not "
        "list; the first time each set of effects is compiled, about 10 s each.",
    )  # fmt: skip
    add_scene(measure)
    add_duration(measure, "simulated time of each run", 60.0)
    add_json(measure)
    schema = add_command(
        actions, "schema", "print the JSON Schema of a scene file",
        ("scene schema > scene.schema.json", "scene schema --json"),
        "JSON Schema 2020-12 with units, ranges and meanings, for completion and checks in an "
        "editor. It is always one JSON object; --json puts it on one line.",
    )  # fmt: skip
    add_json(schema)
    scene_exchange.add_raos(actions)
    scene_exchange.add_coefficients(actions)
    scene_exchange.add_import(actions)
    scene_exchange.add_export(actions)


def run(args: argparse.Namespace) -> int:
    """Run the action and return the exit code."""
    actions = {
        "list": _list, "keys": _keys, "show": _show, "check": _check, "measure": _measure,
        "schema": _schema, "raos": scene_exchange.run_raos,
        "coefficients": scene_exchange.run_coefficients, "import": scene_exchange.run_import,
        "export": scene_exchange.run_export,
    }  # fmt: skip
    try:
        return actions[args.action](args)
    except SceneError as error:
        print(error, file=sys.stderr)
        return ExitCode.ERROR


def _measure(args: argparse.Namespace) -> int:
    scene = load_scene(args.scene)
    whole_steps("--duration", args.duration, scene.time.step_s)
    study = measure_effects(scene, args.duration, CaseProgress().show)
    if args.json:
        print_json(asdict(study))
    else:
        print("\n".join(effect_table(study)))
    return ExitCode.OK


def _list(args: argparse.Namespace) -> int:
    names = scene_names()
    if args.json:
        scenes = [load_scene(name) for name in names]
        rows = [{"name": scene.name, "about": scene.about, "path": scene.path} for scene in scenes]
        print_json({"scenes": rows})
        return ExitCode.OK
    width = max((len(name) for name in names), default=0)
    columns = _columns()
    for name in names:
        line = f"{name:{width}}  {load_scene(name).about}"
        indent = " " * (width + 2)
        print(textwrap.fill(line, max(columns, width + 20), subsequent_indent=indent))
    return ExitCode.OK


def _keys(args: argparse.Namespace) -> int:
    """List the keys. Raises SceneError: no key has this in its path."""
    part = re.sub(r"\[[^]]*\]", "", args.part)  # a path as in a message, or effects by name
    every = scene_keys()
    shown = [key for key in every if part in key.path.replace("[]", "")]
    if not shown:
        names = {name for key in every for name in key.path.replace("[]", "").split(".")}
        raise SceneError(f"'{part}'", "no key of a scene has this", did_you_mean(part, names))
    if args.json:
        print_json({"keys": [asdict(key) for key in shown]})
        return ExitCode.OK
    for key in shown:
        left_out = {None: "needed", "absent": ""}.get(key.default, f"{key.default} if left out")
        limits = ", ".join(filter(None, (key.wants, key.range, left_out)))
        line = f"{key.path}: {key.meaning} ({limits})"
        print(textwrap.fill(line, _columns(), subsequent_indent="    ", break_on_hyphens=False))
    return ExitCode.OK


def _schema(args: argparse.Namespace) -> int:
    schema = scene_schema()
    if args.json:
        print_json(schema)
    else:
        print(json.dumps(schema, indent=2, ensure_ascii=False))
    return ExitCode.OK


def _columns() -> int:
    return min(max(shutil.get_terminal_size((WIDEST, 24)).columns, NARROWEST), WIDEST)


def _check(args: argparse.Namespace) -> int:
    """Check a scene. Raises SceneError: it has one error, or there is no static equilibrium."""
    scene = None
    try:
        scene = load_scene(args.scene)
        resting = Twin(scene).snapshot()
    except SceneError as error:  # also that there is no static equilibrium
        sentences, warnings = error.every, _warnings(scene) if scene is not None else []
        if args.json:
            result = {"scene": args.scene, "valid": False, "errors": sentences}
            print_json(result | {"warnings": warnings})
            return ExitCode.ERROR
        for warning in warnings:
            print(f"warning: {warning}")
        if len(sentences) == 1:
            raise
        print("\n".join((*sentences, f"{len(sentences)} errors")), file=sys.stderr)
        return ExitCode.ERROR
    accepted, _ = accepted_warnings(scene)
    pressed = [
        phrase(
            "effects bending",
            f"in static equilibrium, {compressed_words(bend.compressed_m, name)}",
            "give it tension, or take it from a beam analysis",
        )
        for bend in resting.bends
        for name in [bend.now.name if len(resting.bends) > 1 else ""]
        if bend.compressed_m > 0.0
    ]
    warnings, broken = _warnings(scene) + pressed, resting.breaches
    if args.json:
        result = {"scene": scene.name, "path": scene.path, "valid": True, "errors": []}
        result |= {"warnings": warnings, "accepted": accepted}
        print_json(result | {"limits_exceeded": [breach_words(breach) for breach in broken]})
        return ExitCode.ERROR if broken else ExitCode.OK
    for warning in warnings:
        print(f"warning: {warning}")
    for sentence in accepted:
        print(f"accepted: {sentence}")
    for breach in broken:
        print(f"critical: in static equilibrium, {breach_words(breach)}")
    counts = [_counted(len(warnings), "warning")]
    counts += [_counted(len(broken), "critical warning")] if broken else []
    counts += [f"{len(accepted)} accepted"] if accepted else []
    print(f"{scene.path}: valid, {', '.join(counts)}")
    return ExitCode.ERROR if broken else ExitCode.OK


def _warnings(scene: Scene) -> list[str]:
    """Return the warnings of a scene as it is in its file."""
    return sense_checks(scene) + accepted_warnings(scene)[1]


def _counted(count: int, noun: str) -> str:
    return f"{count or 'no'} {noun}{'' if count == 1 else 's'}"


def _show(args: argparse.Namespace) -> int:
    scene = load_scene(args.scene)
    if args.json:
        print_json(_figures(scene))
        return ExitCode.OK
    print(f"{scene.name}: {scene.about}")
    for name, text in (("look at", scene.look_at), ("source", scene.source)):
        if text:
            print(f"{name}: {text}")
    figures = lift_figures(scene)
    print()
    for name, value in (*_parts(scene, figures), *_derived(scene, figures)):
        print(f"{name:20} {value}")
    for warning in sense_checks(scene):
        print(f"warning: {warning}")
    return ExitCode.OK


def _figures(scene: Scene) -> dict[str, Any]:
    """Return the parts of a scene in words, and what follows from them in numbers."""
    figures, parts = lift_figures(scene), dict[str, Any]()
    name = ""
    for key, words in _parts(scene, figures):
        name = key or name
        parts.setdefault(name, []).append(words)
    left_out = ("line", "payload", "bars", "suspended", "dry_m", "lifts_n_per_m")
    numbers = {
        field.name: getattr(figures, field.name)
        for field in fields(figures)
        if field.name not in left_out
    }
    carries = figures.payload is not None and not is_joined(scene)
    top_n = figures.top_tension_n(scene.ropes[0].length_m) if carries else None
    stretch = stretch_m(figures) if carries and not figures.rises else None
    return {
        "scene": scene.name,
        "about": scene.about,
        "path": scene.path,
        "parts": parts,
        **numbers,
        "static_top_tension_n": top_n,
        "static_stretch_m": stretch,
        "warnings": sense_checks(scene),
    }


def _parts(scene: Scene, figures: LiftFigures) -> list[tuple[str, str]]:
    """Return the parts of the scene in words, one row each."""
    line = scene.ropes[0]
    rows = [
        ("file", str(scene.path)),
        ("rope", f"'{line.name}', {_made_of(line)}, {_end(line)}"),
        *(("", words) for words in _sections(line, figures)),
        ("line out", f"{line.length_m:g} m in {line.elements} elements"),
        *_rigging(scene),
        *(("payload", f"'{payload.name}', {payload.mass_kg:g} kg") for payload in scene.payloads),
        ("winch", _winch(scene.winch)),
        ("sea", _sea(scene.sea_state)),
    ]
    effects = [f"{name} {_words(params)}".strip() for name, params in listed_effects(scene).items()]
    rows += [("effects" if row == 0 else "", words) for row, words in enumerate(effects)]
    return [*rows, ("time step", f"{scene.time.step_s:g} s"), ("accuracy", _accuracy(scene))]


def _accuracy(scene: Scene) -> str:
    """Return the error of the scene's own mesh and time step by its convergence study."""
    known = known_error(scene)
    if known.words.startswith("unknown"):
        return known.words
    rms, peak = format_bound(known.rms_pct), format_bound(known.peak_pct)
    return f"top tension {rms} % rms, {peak} % at its maximum, {known.words}"


def _end(line: RopeLine) -> str:
    return f"to '{line.to}'" if line.to else f"to the fixed point {line.fixed_at_m} m"


def _rigging(scene: Scene) -> Iterator[tuple[str, str]]:
    """Yield further lines and what they are connected to."""
    for line in scene.ropes[1:]:
        length = f"{line.length_m:g} m in {line.elements} elements"
        yield "rope", f"'{line.name}', {_made_of(line)}, {length}, from '{line.from_}' {_end(line)}"
    for joint in scene.joints:
        yield "joint", f"'{joint.name}', {joint.mass_kg:g} kg"
    for sheave in scene.sheaves:
        stretches = [line.name for line in scene.ropes if line.to == sheave.name]
        yield "sheave", f"'{sheave.name}', between the lines {' and '.join(stretches)}"
    for strut in scene.struts:
        first, second = strut.between
        size = f"{strut.length_m:g} m, {strut.mass_kg:g} kg"
        yield "strut", f"'{strut.name}', {size}, between '{first}' and '{second}'"
    for place in scene.hang_offs:
        yield "hang-off", f"'{place.name}' at {place.at_m} m, winch {_winch(place.winch)}"


def _made_of(line: RopeLine) -> str:
    """Return the rope of a line in words, or the number of its sections."""
    rope = line.rope
    if rope is None:
        return f"{len(line.sections)} sections from End B (lower end) up"
    return rope.about or f"{1e3 * rope.diameter_m:g} mm"


def _sections(line: RopeLine, figures: LiftFigures) -> Iterator[str]:
    """Yield the properties of each section."""
    for section, bar in zip(line.made_of, figures.bars, strict=True):
        rope, extent = bar.rope, ""
        if line.rope is None:
            extent = f"{section.length_m:g} m" if section.length_m else "all above"
            extent += f" {rope.about or f'{1e3 * rope.diameter_m:g} mm'}: "
        law = "dynamic" if rope.is_fibre else "by a table"
        table = f" at its mean load, {law}" if rope.axial_stiffness else ""
        bend_radius_m = rope.minimum_bend_radius_m
        bend = f", minimum bend radius {bend_radius_m:g} m" if bend_radius_m else ""
        yield (
            f"{extent}{rope.mass_kg_per_m:.3f} kg/m, EA {rounded(bar.stiffness_n / 1e6, 2)} MN"
            f"{table}, MBL {kilonewtons(rope.breaking_load_n)}{bend}"
        )


def _sea(sea: SeaState) -> str:
    if sea.heave is not None:
        return f"regular heave, ±{sea.heave.amplitude_m:g} m every {sea.heave.period_s:g} s"
    if sea.on_waves is not None:
        table = Path(sea.on_waves.responses).name or "of a box-like hull"
        return f"vessel driven by RAOs ({table}) in the waves of the scene"
    if sea.path:
        return f"prescribed motion of the hang-off, {sea.path}"
    if sea.poses is not None:
        return f"recorded poses of the vessel, bag {sea.poses.bag}"
    return f"bag {sea.bag}" if sea.bag else "still"


def _words(params: Any) -> str:
    """Return the given parameters of an effect in words."""
    stated = [(key, value) for key, value in asdict(params).items() if value not in (None, ())]
    return ", ".join(f"{key} {_word(value)}" for key, value in stated)


def _word(value: Any) -> str:
    """Return a value in words."""
    match value:
        case dict():
            inner = [f"{name} {_word(part)}" for name, part in value.items() if part is not None]
            return f"({', '.join(inner)})"
        case (float(), float()) | (float(), float(), float()):
            return f"({', '.join(f'{part:g}' for part in value)})"
        case tuple():
            return f"{len(value)} rows"
        case float():
            return f"{value:g}"
        case _:
            return str(value)


def _winch(winch: Winch | None) -> str:
    if winch is None:
        return "none, constant paid-out length"
    limits = f"{winch.min_line_out_m:g} to {winch.max_line_out_m:g} m, up to "
    limits += f"{winch.speed_limit_m_per_s:g} m/s, {winch.acceleration_limit_m_per_s2:g} m/s²"
    if not winch.schedule:
        return f"{limits}; no schedule"
    steps = ", ".join(f"{_order_words(row)} from {row.at_s:g} s" for row in winch.schedule)
    repeat = winch.schedule_repeats_every_s
    return f"{limits}; {steps}" + (f", repeated every {repeat:g} s" if repeat else "")


def _order_words(row: ScheduleRow) -> str:
    """Return the command of a row of the schedule in words."""
    match motion_of(row):
        case None:
            return str(row.switch).replace("_", " ")
        case WinchCommand("speed", value):
            return f"{value:+g} m/s"
        case WinchCommand(kind, value):
            return f"{kind} {value:g} {CONTROL_MODES[kind]}"


def _suspended_load(scene: Scene, figures: LiftFigures) -> list[tuple[str, str]]:
    """Return the suspended loads of a multi-line system."""
    rows = [("loads in water", kilonewtons(figures.payload_weight_n, 1))]
    load = suspended_weights(scene)
    if load is None:
        return rows
    factor = f"safety factor {load.breaking_load_n / load.weight_n:.2f}"
    if len(load.lines) == 1:
        return [*rows, ("static top tension", f"{kilonewtons(load.weight_n, 1)}, {factor}")]
    text = (
        f"{kilonewtons(load.weight_n, 1)}, {factor} if shared evenly; `rope_twin run` reports "
        "the tension of each"
    )
    return [*rows, (f"{len(load.lines)} lines carry", text)]


def _derived(scene: Scene, figures: LiftFigures) -> list[tuple[str, str]]:
    """Return the derived values, one row each."""
    line, density = scene.ropes[0], scene.environment.water_density_kg_per_m3
    rows = [("rope in water", f"{rounded(figures.rope_weight_n_per_m, 2)} N/m")]
    axial = f"{figures.first_axial_period_s:.2f} s"
    if is_joined(scene):
        rows += _suspended_load(scene, figures)
        axial += f" of '{line.name}' with all suspended loads; system modes: `rope_twin modes`"
    elif figures.rises:
        lift = -figures.top_tension_n(line.length_m)
        rows.append(("net lift", f"{kilonewtons(lift, 1)} fully submerged: it floats"))
    elif figures.payload is not None:
        top = figures.top_tension_n(line.length_m)
        rope, largest = figures.weakest(line.length_m)
        factor = f", safety factor {rope.breaking_load_n / largest:.2f}" if largest > 0.0 else ""
        dry = figures.suspended.dry_share(line.length_m)
        air = f", {100.0 * dry:.0f} % of the payload above water" if dry > 0.0 else ""
        axial += " with the payload submerged" if dry > 0.0 else ""
        condition = ", without current" if scene.listed(CurrentParams) is not None else ""
        added, drag = figures.payload.added_mass_kg, figures.payload.drag_area_m2
        rows += [
            ("payload in water", kilonewtons(figures.payload_weight_n, 1)),
            (
                "payload added mass",
                " / ".join(rounded(mass, 0) for mass in added) + " kg (x / y / z)",
            ),
            (
                "payload drag area",
                " / ".join(rounded(area, 2) for area in drag) + " m² (x / y / z)",
            ),
            ("terminal velocity", f"{figures.sinking_speed_m_per_s(density):.2f} m/s (slack line)"),
            ("static top tension", f"{kilonewtons(top, 1)}{factor}{air}{condition}"),
            ("static elongation", f"{rounded(stretch_m(figures), 2)} m"),
        ]
    return [
        *rows,
        ("axial wave speed", f"{figures.axial_wave_speed_m_per_s:.0f} m/s"),
        ("first axial period", axial),
        (
            "damping",
            " / ".join(f"{c:.4g}" for c in dict.fromkeys(figures.damping_newton_seconds))
            + f" N·s, {100 * figures.damping_fraction:.2g} % of "
            "critical on the first axial mode",
        ),
    ]


COMMANDS = {"scene": Command(add_arguments, run, EXAMPLES, MORE)}
