"""`rope_twin modes SCENE`: natural frequencies and mode shapes about static equilibrium."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from math import inf
from typing import Any

from rope_twin.cli import ExitCode, print_json, print_table
from rope_twin.run.options import add_json, add_out, add_scene
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
from rope_twin.studies.viv_pictures import draw_modes

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
        print_json({"scene": scene.name, **more, "rows": list(_figures(groups))})
    else:
        _show(modes, groups)
    return ExitCode.OK


def _figures(groups: Mapping[str, Sequence[Mode | SystemMode]]) -> Iterator[dict[str, Any]]:
    """Yield the modes without their shapes."""
    for group, modes in groups.items():
        for number, mode in enumerate(modes, 1):
            figures = {k: v for k, v in asdict(mode).items() if k not in ("shape", "shapes")}
            yield {"group": group, "number": number, **figures}


def _show(result: Modes | SystemModes, groups: Mapping[str, Sequence[Mode | SystemMode]]) -> None:
    rows = [
        _row(str(number) if group == "lowest" else f"{group} {number}", mode)
        for group, modes in groups.items()
        for number, mode in enumerate(modes, 1)
    ]
    low, high = WAVE_PERIODS_S
    print_table([SYSTEM_HEAD if isinstance(result, SystemModes) else HEAD, *rows])
    print(f"\nwaves: period over the nearest wave period of {low:g} to {high:g} s; 1: it is one")
    if isinstance(result, SystemModes):
        print("stretch: fraction of the strain energy in elements that stretch; the rest is in the")
        print("rotation of tension. A free mode has no restoring force and no period")
    else:
        print(
            f"Strouhal: shedding frequency {result.strouhal:g}·U/D where the mode has its maximum; "
            f"along the line at most {result.strouhal_max_hz:.3g} Hz"
        )


def _row(name: str, mode: Mode | SystemMode) -> tuple[str, ...]:
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
