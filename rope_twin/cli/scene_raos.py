"""`rope_twin scene raos FILE`: displacement RAOs of a vessel, as they are understood."""

from __future__ import annotations

import argparse
import re
from pathlib import Path
from typing import Any

from rope_twin.cli.console import ExitCode, print_json, print_table
from rope_twin.errors import InputError, phrase
from rope_twin.run.arguments import add_command, add_json, measure
from rope_twin.scene.environment import vessel_raos
from rope_twin.scene.load import load_scene, scene_names
from rope_twin.sea.rao_files import read_responses
from rope_twin.sea.raos import SYMMETRIES, Point, RaoConventions, Responses, long_wave_doubts
from rope_twin.studies.picture import check_picture
from rope_twin.studies.raos import draw_raos, figures, own_headings, periods_s, table_rows

EXAMPLES = (
    "scene raos vessel_120m --heading 90",
    "scene raos vessel.yml --crane-tip 10 -18 24 --picture raos.png",
    "scene raos vessel.4 --scale-length 1m --origin 0 0 0 --phase-origin 0 0 0 --symmetry xz_plane",
    "scene raos ship_6dof --json",
)
MORE = """Reads a CSV, OrcaFlex YAML, WAMIT .4 or Capytaine netCDF file, or the file that a scene
names, and prints modulus and phase in the conventions of rope_twin: x to the bow, y to port, z up,
pitch positive bow down, heading 0 for following seas, positive phases ahead of the crest. What the
file does not state is given by options; nothing is assumed."""


def add_raos(actions: argparse._SubParsersAction[Any]) -> None:
    """Add `raos`."""
    about = "show the displacement RAOs of a vessel, from a file or of a scene"
    parser = add_command(actions, "raos", about, EXAMPLES, MORE)
    words = "file, name of a table in config/responses/, or scene that names one"
    parser.add_argument("file", metavar="FILE", help=words)
    words = "show the motion of this point of the vessel [m], in the axes of the file"
    _add_point(parser, "--crane-tip", words)
    words = "directions of the waves relative to the bow (default: those of the file)"
    parser.add_argument("--heading", nargs="+", type=float, default=(), metavar="DEG", help=words)
    stated = parser.add_argument_group("conventions that the file does not state")
    _add_point(stated, "--origin", "point whose motion the RAOs give [m]")
    _add_point(stated, "--phase-origin", "point at which the wave has phase zero [m]")
    words = "length that rotations are made dimensionless with (ULEN)"
    stated.add_argument("--scale-length", type=measure("m"), metavar="LENGTH", help=words)
    words = "planes of symmetry of the vessel"
    stated.add_argument("--symmetry", choices=SYMMETRIES, default="", help=words)
    stated.add_argument("--vessel", default="", metavar="NAME", help="vessel type, of several")
    stated.add_argument("--draught", default="", metavar="NAME", help="draught, of several")
    words = "draw modulus and phase over period, a curve for each heading"
    parser.add_argument("--picture", type=Path, metavar="PNG", help=words)
    add_json(parser)


def _add_point(parser: argparse._ActionsContainer, option: str, about: str) -> None:
    parser.add_argument(option, nargs=3, type=float, metavar=("X", "Y", "Z"), help=about)


def run_raos(args: argparse.Namespace) -> int:
    """Show the RAOs of a file or scene and return the exit code. Raises RopeTwinError."""
    if args.picture is not None:
        check_picture(args.picture)
    given = RaoConventions(
        origin_m=_point(args.origin), phase_origin_m=_point(args.phase_origin),
        scale_length_m=args.scale_length, symmetry=args.symmetry, vessel=args.vessel,
        draught=args.draught,
    )  # fmt: skip
    own, tip = _read(args.file, given)
    tip = _point(args.crane_tip) or tip
    shown = own if tip is None else own.moved(tip)
    headings = own_headings(own, args.heading)
    doubts = list(long_wave_doubts(own))
    if args.picture is not None:
        draw_raos(shown, headings, tip, args.picture)
    if args.json:
        print_json(figures(shown, headings) | {"point_m": tip or own.origin_m, "warnings": doubts})
        return ExitCode.OK
    periods = periods_s(own)
    print(f"file            {own.source}")
    if own.origin_m is not None:
        print(f"phases          relative to the crest at {_words(own.origin_m)}")
    point = tip or own.origin_m
    print(f"motion of       {'the reference point' if point is None else _words(point)}")
    print(f"periods         {len(periods)}, {periods[0]:.3g} to {periods[-1]:.3g} s")
    for heading in headings.tolist():
        print(f"\nheading {heading:g}° (0: following seas, 180: head seas, 90: to port)")
        print_table(table_rows(shown, heading))
    for doubt in doubts:
        print(f"warning: {doubt}")
    return ExitCode.OK


def _read(name: str, given: RaoConventions) -> tuple[Responses, Point | None]:
    """Return RAOs, and the crane tip of a scene. Raises RopeTwinError."""
    if not _is_scene(name):
        return read_responses(name, given), None
    if given != RaoConventions():
        what = "a scene states the conventions of its own file"
        raise InputError(phrase(name, what, "leave the options out"))
    scene = load_scene(name)
    raos, riding = vessel_raos(scene), scene.sea_state.on_waves
    if raos is None or riding is None:
        what = "its ship is not moved by a table of RAOs"
        raise InputError(phrase(name, what, "name `responses` under sea_state.on_waves"))
    return raos, riding.crane_tip_m


def _is_scene(name: str) -> bool:
    path = Path(name)
    if path.suffix not in (".yaml", ".yml"):
        return name in scene_names()
    try:
        return re.search(r"^ropes\s*:", path.read_text("utf-8"), re.MULTILINE) is not None
    except (OSError, UnicodeDecodeError):
        return False  # the reader says what is wrong


def _point(given: list[float] | None) -> Point | None:
    return None if given is None else (given[0], given[1], given[2])


def _words(point: Point) -> str:
    return f"[{point[0]:g}, {point[1]:g}, {point[2]:g}] m"
