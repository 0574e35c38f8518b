"""`rope_twin scene coefficients SCENE`: added mass of a payload near the surface, by Capytaine."""

from __future__ import annotations

import argparse
import math
from dataclasses import asdict
from typing import Any

from rope_twin.cli.console import ExitCode, print_json, print_table
from rope_twin.errors import InputError, did_you_mean, phrase
from rope_twin.run.arguments import add_command, add_json, add_scene, measure
from rope_twin.scene.load import load_scene
from rope_twin.scene.schema import Payload, Scene
from rope_twin.scene.shapes import Box, Cylinder
from rope_twin.studies.near_surface import near_surface

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
    """Add `coefficients`."""
    about = "added mass and radiation damping of a payload near the surface, by Capytaine"
    parser = add_command(actions, "coefficients", about, EXAMPLES, MORE)
    add_scene(parser)
    add = parser.add_argument
    words = "depths of its middle below the water (default: 0.5, 1 and 2 times its height)"
    add("--depth", nargs="+", type=measure("m"), metavar="DEPTH", help=words)
    words = f"periods of the motion (default: {', '.join(f'{one:g}' for one in PERIODS_S)} s)"
    add("--period", nargs="+", type=measure("s"), metavar="PERIOD", default=PERIODS_S, help=words)
    add("--payload", default="", metavar="NAME", help="of several (default: the first)")
    add_json(parser)


def run_coefficients(args: argparse.Namespace) -> int:
    """Print the coefficients and return the exit code. Raises RopeTwinError."""
    scene = load_scene(args.scene)
    payload, shape = _body(scene, args.payload)
    water = scene.environment
    rho, g = water.water_density_kg_per_m3, water.gravity_m_per_s2
    deep = [rho * one for one in shape.added_mass_m3()]
    given = list(payload.added_mass_kg or deep)
    found = [
        {"depth_m": depth, **asdict(one)}
        for depth in args.depth or [part * shape.height_m for part in DEPTHS_M]
        for one in near_surface(shape, depth, args.period, rho, g)
    ]
    if args.json:
        print_json({"payload": payload.name, "scene_added_mass_kg": given, "rows": found})
        return ExitCode.OK
    words = ", ".join(f"{1e-3 * one:.2f}" for one in given)
    print(f"{payload.name}: added mass of the scene along x, y, z {words} t")
    head = ["depth m", "period s", "A11 t", "A33 t", "A33 over the scene's", "B11 kN·s/m",
            "B33 kN·s/m", "panel error %"]  # fmt: skip
    rows = [head]
    for one in found:
        (a, c), (b, d) = one["added_mass_kg"], one["damping_kg_per_s"]
        numbers = (one["depth_m"], one["period_s"], 1e-3 * a, 1e-3 * c, c / given[2], 1e-3 * b,
                   1e-3 * d, 100.0 * one["error"])  # fmt: skip
        rows.append([f"{number:.3g}" if math.isfinite(number) else "∞" for number in numbers])
    print_table(rows)
    return ExitCode.OK


def _body(scene: Scene, name: str) -> tuple[Payload, Box | Cylinder]:
    """Return a payload and its shape. Raises InputError."""
    known = {one.name: one for one in scene.payloads}
    if not known:
        what = f"'{scene.name}' has no payload"
        raise InputError(phrase("scene", what, "give a scene with one"))
    if name and name not in known:
        what = "there is no such payload"
        raise InputError(phrase(f"--payload {name}", what, did_you_mean(name, known)))
    payload = known[name] if name else scene.payloads[0]
    if not isinstance(payload.shape, Box | Cylinder):
        what = f"the payload '{payload.name}' is neither a box nor a cylinder"
        raise InputError(
            phrase("shape", what, "give it `shape: {box: {...}}` or `{cylinder: ...}`")
        )
    return payload, payload.shape
