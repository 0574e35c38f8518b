"""Actions of `rope_twin scene` on data of other programs.

`coefficients SCENE`: added mass of a payload near the surface, by Capytaine. `raos FILE`:
displacement RAOs of a vessel, as they are understood. `import FILE`, `export SCENE`: models.
"""

from __future__ import annotations

import argparse
import math
import re
from dataclasses import asdict
from pathlib import Path
from typing import Any

from rope_twin.cli import ExitCode, print_json, print_table
from rope_twin.errors import InputError, counted, did_you_mean
from rope_twin.interchange import write_scene
from rope_twin.interchange.fmu import export_fmu, inputs_of, outputs_of
from rope_twin.interchange.moordyn import deck_of, scene_of
from rope_twin.interchange.moordyn_deck import CURRENT_FILE, current_text, deck_text, read_deck
from rope_twin.interchange.orcaflex import scene_of_model
from rope_twin.run.options import add_command, add_json, add_out, add_scene, measure
from rope_twin.scene.environment import vessel_raos
from rope_twin.scene.load import load_scene, scene_names
from rope_twin.scene.rope_warnings import sense_checks
from rope_twin.scene.schema import Payload, Scene
from rope_twin.scene.shapes import Box, Cylinder
from rope_twin.sea.rao_files import read_responses
from rope_twin.sea.raos import SYMMETRIES, Point, RaoConventions, Responses, long_wave_doubts
from rope_twin.studies.near_surface import near_surface
from rope_twin.studies.picture import (
    check_picture,
    draw_raos,
    figures,
    own_headings,
    periods_s,
    table_rows,
)

DEPTHS_M, PERIODS_S = (0.5, 1.0, 2.0), (6.0, 8.0, 10.0, 12.0)  # depths over the payload's height
EXAMPLES = (
    "scene coefficients splash_zone",
    "scene coefficients my_lift.yaml --depth 3 6 12 --period 7 9 11 --json",
)
MORE = """A payload whose shape is a box or a cylinder, at rest at some depths of its middle: added
mass and wave radiation damping along x and z at each period, by the boundary element method of
Capytaine (pip install 'rope_twin[hydrodynamics]'), beside the added mass that the scene has. Drag
and slamming are no part of it. What a scene shall take stands in `added_mass_kg` of its payload."""


def add_coefficients(actions: argparse._SubParsersAction[Any]) -> None:
    about = "added mass and radiation damping of a payload near the surface, by Capytaine"
    parser = add_command(actions, "coefficients", about, EXAMPLES, MORE)
    add_scene(parser)
    add = parser.add_argument
    help_text = "depths of its middle below the water (default: 0.5, 1 and 2 times its height)"
    add("--depth", nargs="+", type=measure("m"), metavar="DEPTH", help=help_text)
    help_text = (
        f"periods of the motion (default: {', '.join(f'{period_s:g}' for period_s in PERIODS_S)} s)"
    )
    add(
        "--period",
        nargs="+",
        type=measure("s"),
        metavar="PERIOD",
        default=PERIODS_S,
        help=help_text,
    )
    add("--payload", default="", metavar="NAME", help="of several (default: the first)")
    add_json(parser)


def run_coefficients(args: argparse.Namespace) -> int:
    """Print the coefficients and return the exit code. Raises RopeTwinError."""
    scene = load_scene(args.scene)
    payload, shape = _body(scene, args.payload)
    water = scene.environment
    rho, g = water.water_density_kg_per_m3, water.gravity_m_per_s2
    deep = [rho * volume_m3 for volume_m3 in shape.added_mass_m3()]
    stated_kg = list(payload.added_mass_kg or deep)
    coefficients = [
        {"depth_m": depth, **asdict(row)}
        for depth in args.depth or [part * shape.height_m for part in DEPTHS_M]
        for row in near_surface(shape, depth, args.period, rho, g)
    ]
    if args.json:
        print_json(
            {"payload": payload.name, "scene_added_mass_kg": stated_kg, "rows": coefficients}
        )
        return ExitCode.OK
    listed = ", ".join(f"{1e-3 * mass_kg:.2f}" for mass_kg in stated_kg)
    print(f"{payload.name}: added mass of the scene along x, y, z {listed} t")
    head = ["depth m", "period s", "A11 t", "A33 t", "A33 over the scene's", "B11 kN·s/m",
            "B33 kN·s/m", "panel error %"]  # fmt: skip
    rows = [head]
    for row in coefficients:
        (a, c), (b, d) = row["added_mass_kg"], row["damping_kg_per_s"]
        numbers = (row["depth_m"], row["period_s"], 1e-3 * a, 1e-3 * c, c / stated_kg[2], 1e-3 * b,
                   1e-3 * d, 100.0 * row["error"])  # fmt: skip
        rows.append([f"{number:.3g}" if math.isfinite(number) else "∞" for number in numbers])
    print_table(rows)
    return ExitCode.OK


def _body(scene: Scene, name: str) -> tuple[Payload, Box | Cylinder]:
    """Return a payload and its shape. Raises InputError."""
    known = {candidate.name: candidate for candidate in scene.payloads}
    if not known:
        raise InputError("scene", f"'{scene.name}' has no payload", "give a scene with one")
    if name and name not in known:
        raise InputError(f"--payload {name}", "there is no such payload", did_you_mean(name, known))
    payload = known[name] if name else scene.payloads[0]
    if not isinstance(payload.shape, Box | Cylinder):
        problem = f"the payload '{payload.name}' is neither a box nor a cylinder"
        raise InputError("shape", problem, "give it `shape: {box: {...}}` or `{cylinder: ...}`")
    return payload, payload.shape


RAO_EXAMPLES = (
    "scene raos vessel_120m --heading 90",
    "scene raos vessel.yml --crane-tip 10 -18 24 --picture raos.png",
    "scene raos vessel.4 --scale-length 1m --origin 0 0 0 --phase-origin 0 0 0 --symmetry xz_plane",
    "scene raos ship_6dof --json",
)
RAO_MORE = """\
Reads a CSV, OrcaFlex YAML, WAMIT .4 or Capytaine netCDF file, or the file that a scene
names, and prints modulus and phase in the conventions of rope_twin: x to the bow, y to port, z up,
pitch positive bow down, heading 0 for following seas, positive phases ahead of the crest. What the
file does not state is given by options; nothing is assumed."""


def add_raos(actions: argparse._SubParsersAction[Any]) -> None:
    about = "show the displacement RAOs of a vessel, from a file or of a scene"
    parser = add_command(actions, "raos", about, RAO_EXAMPLES, RAO_MORE)
    help_text = "file, name of a table in config/responses/, or scene that names one"
    parser.add_argument("file", metavar="FILE", help=help_text)
    help_text = "show the motion of this point of the vessel [m], in the axes of the file"
    _add_point(parser, "--crane-tip", help_text)
    help_text = "directions of the waves relative to the bow (default: those of the file)"
    parser.add_argument(
        "--heading", nargs="+", type=float, default=(), metavar="DEG", help=help_text
    )
    stated = parser.add_argument_group("conventions that the file does not state")
    _add_point(stated, "--origin", "point whose motion the RAOs give [m]")
    _add_point(stated, "--phase-origin", "point at which the wave has phase zero [m]")
    help_text = "length that rotations are made dimensionless with (ULEN)"
    stated.add_argument("--scale-length", type=measure("m"), metavar="LENGTH", help=help_text)
    help_text = "planes of symmetry of the vessel"
    stated.add_argument("--symmetry", choices=SYMMETRIES, default="", help=help_text)
    stated.add_argument("--vessel", default="", metavar="NAME", help="vessel type, of several")
    stated.add_argument("--draught", default="", metavar="NAME", help="draught, of several")
    help_text = "draw modulus and phase over period, a curve for each heading"
    parser.add_argument("--picture", type=Path, metavar="PNG", help=help_text)
    add_json(parser)


def _add_point(parser: argparse._ActionsContainer, option: str, about: str) -> None:
    parser.add_argument(option, nargs=3, type=float, metavar=("X", "Y", "Z"), help=about)


def run_raos(args: argparse.Namespace) -> int:
    """Show the RAOs of a file or scene and return the exit code. Raises RopeTwinError."""
    if args.picture is not None:
        check_picture(args.picture)
    conventions = RaoConventions(
        origin_m=_point(args.origin), phase_origin_m=_point(args.phase_origin),
        scale_length_m=args.scale_length, symmetry=args.symmetry, vessel=args.vessel,
        draught=args.draught,
    )  # fmt: skip
    raos, tip = _read(args.file, conventions)
    tip = _point(args.crane_tip) or tip
    shown = raos if tip is None else raos.moved(tip)
    headings = own_headings(raos, args.heading)
    doubts = list(long_wave_doubts(raos))
    if args.picture is not None:
        draw_raos(shown, headings, tip, args.picture)
    if args.json:
        print_json(figures(shown, headings) | {"point_m": tip or raos.origin_m, "warnings": doubts})
        return ExitCode.OK
    periods = periods_s(raos)
    print(f"file            {raos.source}")
    if raos.origin_m is not None:
        print(f"phases          relative to the crest at {_words(raos.origin_m)}")
    point = tip or raos.origin_m
    print(f"motion of       {'the reference point' if point is None else _words(point)}")
    print(f"periods         {len(periods)}, {periods[0]:.3g} to {periods[-1]:.3g} s")
    for heading in headings.tolist():
        print(f"\nheading {heading:g}° (0: following seas, 180: head seas, 90: to port)")
        print_table(table_rows(shown, heading))
    for doubt in doubts:
        print(f"warning: {doubt}")
    return ExitCode.OK


def _read(name: str, conventions: RaoConventions) -> tuple[Responses, Point | None]:
    """Return RAOs, and the crane tip of a scene. Raises RopeTwinError."""
    if not _is_scene(name):
        return read_responses(name, conventions), None
    if conventions != RaoConventions():
        problem = "a scene states the conventions of its own file"
        raise InputError(name, problem, "leave the options out")
    scene = load_scene(name)
    raos, riding = vessel_raos(scene), scene.sea_state.on_waves
    if raos is None or riding is None:
        problem = "its ship is not moved by a table of RAOs"
        raise InputError(name, problem, "name `responses` under sea_state.on_waves")
    return raos, riding.crane_tip_m


def _is_scene(name: str) -> bool:
    path = Path(name)
    if path.suffix not in (".yaml", ".yml"):
        return name in scene_names()
    try:
        return re.search(r"^ropes\s*:", path.read_text("utf-8"), re.MULTILINE) is not None
    except (OSError, UnicodeDecodeError):
        return False  # the reader says what is wrong


def _point(coordinates: list[float] | None) -> Point | None:
    return None if coordinates is None else (coordinates[0], coordinates[1], coordinates[2])


def _words(point: Point) -> str:
    return f"[{point[0]:g}, {point[1]:g}, {point[2]:g}] m"


IMPORTS = (
    "scene import mooring.txt --breaking-load 5MN --out mooring.yaml",
    "scene import lift.txt --breaking-load wire=2.3MN --breaking-load sling=1.1MN --out lift.yaml",
    "scene import lowering.yml --breaking-load 1.2MN --out lowering.yaml --json",
)
EXPORTS = (
    "scene export smooth_2km --moordyn --out lines.txt",
    "scene export my_lift.yaml --moordyn --out deck/lines.txt --json",
    "scene export deep_lift --fmu --out deep_lift.fmu",
)


def add_import(actions: argparse._SubParsersAction[Any]) -> None:
    about = "make a scene of a MoorDyn deck or an OrcaFlex text data file"
    more = (
        "Reads lines, their ends, points or buoys, water, seabed, current and, from OrcaFlex "
        "(.yml, .yaml), waves and the vessel with its RAOs. What has no equal is listed, here and "
        "at the top of the scene's file. Neither format states a breaking load."
    )
    parser = add_command(actions, "import", about, IMPORTS, more)
    parser.add_argument("file", metavar="FILE", help="deck of MoorDyn 2, or .yml of OrcaFlex")
    help_text = "minimum breaking load (MBL) of the lines, or of one line type; may be repeated"
    parser.add_argument(
        "--breaking-load", type=_load, required=True, action="append", metavar="[TYPE=]FORCE",
        help=help_text,
    )  # fmt: skip
    add_out(parser, "YAML", "scene file to write", required=True)
    add_json(parser)


def _load(option: str) -> tuple[str, float]:
    """Return the line type, "" for all others, and its breaking load [N]."""
    kind, equals, force = option.rpartition("=")
    if equals and not kind:
        raise argparse.ArgumentTypeError(f"'{option}' names no line type before its =")
    return kind, measure("N")(force)


def add_export(actions: argparse._SubParsersAction[Any]) -> None:
    about = "write a scene as the input of another program"
    more = (
        "Points are where the static equilibrium has them. What a deck cannot have is listed; "
        f"a current goes to {CURRENT_FILE} beside the deck, where MoorDyn looks for it. An FMU 3.0 "
        "for co-simulation has the motion of the hang-off as inputs; it needs rope_twin in the "
        "Python of the program that loads it."
    )
    parser = add_command(actions, "export", about, EXPORTS, more)
    add_scene(parser)
    parser.add_argument("--moordyn", action="store_true", help="as a deck of MoorDyn 2")
    parser.add_argument("--fmu", action="store_true", help="as an FMU 3.0 for co-simulation")
    add_out(parser, "FILE", "file to write", required=True)
    add_json(parser)


def run_import(args: argparse.Namespace) -> int:
    """Write a scene and return the exit code. Raises RopeTwinError."""
    low, high = 1e2, 1e9
    loads = dict[str, float]()
    for kind, load_n in args.breaking_load:
        if kind in loads:
            problem = f"line type '{kind}' has two" if kind else "two have no line type"
            raise InputError("--breaking-load", problem, "give one")
        loads[kind] = load_n
        if not low <= load_n <= high:
            remedy = f"right is {low:g} to {high:g} N"
            raise InputError("--breaking-load", f"it is {load_n:g} N", remedy)
    if args.out.suffix not in (".yaml", ".yml"):
        raise InputError("--out", f"'{args.out}' is no scene", "end it in .yaml")
    if Path(args.file).resolve() == args.out.resolve():
        raise InputError("--out", "it is the file to import", "give another name")
    file = Path(args.file)
    if file.suffix.lower() in (".yml", ".yaml"):
        imported = scene_of_model(file, loads, args.out.parent)
    else:
        imported = scene_of(read_deck(file), file, loads)
    scene = write_scene(imported, args.out)
    warnings = sense_checks(scene)
    if args.json:
        print_json({"scene": args.out, "left_out": list(imported.left_out), "warnings": warnings})
        return ExitCode.OK
    parts = counted(len(scene.ropes), "rope"), counted(len(scene.payloads), "payload")
    print(f"{args.out}: {', '.join(parts)}")
    for item in imported.left_out:
        print(f"not imported: {item}")
    for warning in warnings:
        print(f"warning: {warning}")
    return ExitCode.OK


def _run_fmu(args: argparse.Namespace) -> int:
    scene = export_fmu(args.scene, args.out)
    inputs, outputs = list(inputs_of(scene)), list(outputs_of(scene))
    if args.json:
        print_json({"files": [args.out], "inputs": inputs, "outputs": outputs})
        return ExitCode.OK
    names = f"{len(inputs)} inputs, {len(outputs)} outputs"
    print(f"{args.out}: {names}, communication steps of multiples of {scene.time.step_s:g} s")
    return ExitCode.OK


def run_export(args: argparse.Namespace) -> int:
    """Write a deck or an FMU and return the exit code. Raises RopeTwinError."""
    if args.moordyn == args.fmu:
        problem = "two formats are named" if args.fmu else "no format is named"
        raise InputError("scene export", problem, "give --moordyn or --fmu")
    if args.fmu:
        return _run_fmu(args)
    deck, left_out = deck_of(load_scene(args.scene))
    files = [args.out]
    try:
        args.out.parent.mkdir(parents=True, exist_ok=True)
        args.out.write_text(deck_text(deck), encoding="utf-8")
        if deck.current:
            files.append(args.out.parent / CURRENT_FILE)
            files[1].write_text(current_text(deck), encoding="utf-8")
    except OSError as error:
        remedy = "give a place that can be written"
        raise InputError(
            str(args.out), f"it cannot be written ({error.strerror})", remedy
        ) from None
    if args.json:
        print_json({"files": files, "left_out": list(left_out)})
        return ExitCode.OK
    counts = f"{counted(len(deck.lines), 'line')}, {counted(len(deck.points), 'point')}"
    print(f"{' and '.join(map(str, files))}: {counts}")
    for item in left_out:
        print(f"not exported: {item}")
    return ExitCode.OK
