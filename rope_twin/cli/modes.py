"""`rope_twin modes SCENE`: natural frequencies and mode shapes about static equilibrium."""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from math import inf
from typing import Any

from rope_twin.cli.console import ExitCode, print_json, print_table
from rope_twin.run.arguments import add_json, add_out, add_scene
from rope_twin.scene.load import load_scene
from rope_twin.scene.rigging import is_joined
from rope_twin.studies.modes import (
    WAVE_PERIODS_S,
    Mode,
    Modes,
    SystemMode,
    SystemModes,
    find_modes,
    find_system_modes,
)
from rope_twin.studies.picture import check_picture
from rope_twin.studies.viv_pictures import draw_modes, draw_system_modes

COUNT = 10
HEAD = ("mode", "Hz", "period s", "kind", "axial / in / out %", "max at m", "Strouhal Hz", "waves")
SYSTEM_HEAD = ("mode", "Hz", "period s", "kind", "stretch %", "vertical %", "max at m", "of rope",
               "Strouhal Hz", "waves")  # fmt: skip


EXAMPLES = (
    "modes deep_lift",
    "modes bridle_lift --count 5 --out modes.png",
)
MORE = """Undamped modes about static equilibrium in the scene's current, with added mass and with
both ends as in the scene: the lowest, then the first axial ones. A multi-line system is solved as
a whole: the lowest modes, then the first that stretch its lines. A rigid body swings and turns."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_scene(parser)
    parser.add_argument("--count", type=int, default=COUNT, metavar="N",
                        help="number of lowest modes (default: %(default)s)")  # fmt: skip
    add_out(parser, "FILE.png", "draw the mode shapes")
    add_json(parser)


def run(args: argparse.Namespace) -> int:
    """Solve for the modes and print them. Raises RopeTwinError."""
    if args.out is not None:
        check_picture(args.out)
    scene = load_scene(args.scene)
    if is_joined(scene):
        system = find_system_modes(scene, args.count)
        if args.out is not None:
            draw_system_modes(scene.name, system, args.out)
        if args.json:
            groups = (("lowest", system.lowest), ("stretching", system.stretching))
            print_json({"scene": scene.name, "rows": _rows(groups)})
        else:
            _show_system(system)
        return ExitCode.OK
    found = find_modes(scene, args.count)
    if args.out is not None:
        draw_modes(scene.name, found, args.out)
    if args.json:
        rows = _rows((("lowest", found.lowest), ("axial", found.axial)))
        print_json({"scene": scene.name, "strouhal_max_hz": found.strouhal_max_hz, "rows": rows})
    else:
        _show(found)
    return ExitCode.OK


def _rows(groups: Iterable[tuple[str, Sequence[Mode | SystemMode]]]) -> list[dict[str, Any]]:
    """Return the modes without their shapes."""
    rows = []
    for group, modes in groups:
        for number, mode in enumerate(modes, 1):
            kept = {k: v for k, v in asdict(mode).items() if k not in ("shape", "shapes")}
            rows.append({"group": group, "number": number, **kept})
    return rows


def _show(found: Modes) -> None:
    named = [(str(k), mode) for k, mode in enumerate(found.lowest, 1)]
    named += [(f"axial {k}", mode) for k, mode in enumerate(found.axial, 1)]
    print_table([HEAD, *(_row(name, mode) for name, mode in named)])
    _explain_waves()
    print(
        f"Strouhal: shedding frequency 0.2·U/D where the mode has its maximum; "
        f"along the line at most {found.strouhal_max_hz:.3g} Hz"
    )


def _row(name: str, mode: Mode) -> tuple[str, ...]:
    shares = (mode.axial_share, mode.in_plane_share, mode.out_of_plane_share)
    return (
        name,
        f"{mode.frequency_hz:.4g}",
        f"{mode.period_s:.4g}",
        mode.kind,
        " / ".join(f"{100.0 * share:.0f}" for share in shares),
        f"{mode.largest_at_m:.0f}",
        f"{mode.strouhal_hz:.3g}",
        f"{mode.wave_ratio:.3g}",
    )


def _show_system(found: SystemModes) -> None:
    named = [(str(k), mode) for k, mode in enumerate(found.lowest, 1)]
    named += [(f"stretching {k}", mode) for k, mode in enumerate(found.stretching, 1)]
    print_table([SYSTEM_HEAD, *(_system_row(name, mode) for name, mode in named)])
    _explain_waves()
    print("stretch: fraction of the strain energy in elements that stretch; the rest is in the")
    print("rotation of tension. A free mode has no restoring force and no period")


def _explain_waves() -> None:
    low, high = WAVE_PERIODS_S
    print(f"\nwaves: period over the nearest wave period of {low:g} to {high:g} s; 1: it is one")


def _system_row(name: str, mode: SystemMode) -> tuple[str, ...]:
    held = mode.period_s < inf
    return (
        name,
        f"{mode.frequency_hz:.4g}",
        f"{mode.period_s:.4g}" if held else "-",
        mode.kind,
        f"{100.0 * mode.stretching_share:.0f}",
        f"{100.0 * mode.vertical_share:.0f}",
        f"{mode.largest_at_m:.0f}",
        mode.rope,
        f"{mode.strouhal_hz:.3g}",
        f"{mode.wave_ratio:.3g}" if held else "-",
    )
