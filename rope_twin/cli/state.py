"""`rope_twin state info FILE`: describe a saved state and check that it is intact."""

from __future__ import annotations

import argparse
import dataclasses
from pathlib import Path

from rope_twin.cli import ExitCode, print_json
from rope_twin.run.options import add_command, add_json
from rope_twin.twin.state import SavedState, load_state

EXAMPLES = (
    "state info lift.state",
    "state info lift.state --json",
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add `state` with its one action."""
    actions = parser.add_subparsers(dest="action", required=True, metavar="ACTION")
    info = add_command(actions, "info", "describe a file of `run --save-state`", EXAMPLES)
    info.add_argument("file", metavar="FILE", type=Path, help="the file")
    add_json(info)


def run(args: argparse.Namespace) -> int:
    """Print the description. Raises StateError if the file is damaged."""
    state = load_state(args.file)
    if args.json:
        print_json(dataclasses.asdict(state.about) | {"arrays": _arrays(state)})
    else:
        for name, text in _rows(state):
            print(f"{name:14} {text}")
    return ExitCode.OK


def _arrays(state: SavedState) -> dict[str, list[int]]:
    return {name: list(array.shape) for name, array in state.arrays.items()}


def _rows(state: SavedState) -> list[tuple[str, str]]:
    """Return the description, one row per property."""
    about = state.about
    x, y, z = about.payload_position_m
    rows = [
        ("scene", f"{about.scene} ({about.scene_path})"),
        ("scene text", f"SHA-256 {about.scene_digest}"),
        ("saved at", about.saved_at),
        ("written by", f"rope_twin {about.program}, solver {about.solver}"),
        ("simulated time", f"{about.time_s:.3f} s, {about.step} time steps of {about.step_s:g} s"),
        ("line out", f"{about.line_out_m:.3f} m, {about.elements} elements, "
                     f"{about.payout_speed_m_per_s:+.3f} m/s"),
        ("top tension", f"{about.tension_top_n / 1e3:.3f} kN"),
        ("payload", f"at {x:.2f}, {y:.2f}, {z:.2f} m (east, north, up)"),
    ]  # fmt: skip
    if about.failure:
        rows.append(("failure", about.failure))
    size = sum(array.nbytes for array in state.arrays.values())
    rows.append(("arrays", f"{len(state.arrays)}, {size / 1e3:.0f} kB, checksum correct"))
    return [
        *rows,
        *(("", f"{name} {shape}") for name, shape in _arrays(state).items()),
    ]
