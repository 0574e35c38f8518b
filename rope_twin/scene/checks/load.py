"""Plausibility checks of the static load against the MBL of the rope, or of several ropes."""

from __future__ import annotations

from collections.abc import Iterator

from rope_twin.errors import phrase
from rope_twin.scene.figures import LiftFigures
from rope_twin.scene.hung_together import hung_together
from rope_twin.scene.schema import Rope, Scene

SAFETY_FACTOR = 3.0  # MBL over static load, common for lifting wire


def check_load(scene: Scene, figures: LiftFigures) -> Iterator[str]:
    """Check the static load at the start and at maximum payout."""
    line = scene.ropes[0]
    lengths = {"ropes[0]": (line.length_m, "")}
    if scene.winch:
        least, most = scene.winch.least_line_out_m, scene.winch.most_line_out_m
        if figures.hung.dry_share(least) > 0.0:
            lengths["winch.least_line_out_m"] = (least, f" with {least:g} m out, above the water,")
        lengths["winch.most_line_out_m"] = (most, f" with {most:g} m out")
    for path, (length, when) in lengths.items():
        rope, tension = figures.weakest(length)
        breaking = rope.breaking_load_n
        if line.fixed_at_m or tension <= breaking / SAFETY_FACTOR:
            continue
        top = "top tension" if len(figures.bars) == 1 else f"tension of {_called(rope)}"
        what = (
            f"static {top} {tension / 1e3:.0f} kN{when} against a breaking load of "
            f"{breaking / 1e3:.0f} kN"
        )
        if tension >= breaking:
            yield phrase(path, f"{what}: the rope breaks", "take a stronger rope or a lighter load")
            return
        what = f"{what}, a safety factor of {breaking / tension:.2f}"
        yield phrase(path, what, f"below {SAFETY_FACTOR:g} take a stronger rope or a lighter load")
        return


def load_together(scene: Scene) -> Iterator[str]:
    """Check what the ropes from the ship carry together; the actual distribution is less even."""
    held = hung_together(scene)
    if held is None:
        return
    only, when, path = len(held.lines) == 1, "", "ropes[0]"
    tension, breaking = held.weight_n, held.breaking_load_n
    if only and scene.winch and tension <= breaking / SAFETY_FACTOR:
        most = scene.winch.most_line_out_m
        tension, when = held.weight_at(most), f" with {most:g} m out"
        path = "winch.most_line_out_m"
    if tension <= breaking / SAFETY_FACTOR:
        return
    pull = "static top tension" if only else f"{len(held.lines)} ropes from the ship carry"
    what = f"{pull} {tension / 1e3:.0f} kN{when} against a breaking load of {breaking / 1e3:.0f} kN"
    if not only:
        path, what = "ropes", f"{what} together"
    if tension >= breaking:
        yield phrase(path, f"{what}: rope breaks", "take stronger rope or a lighter load")
        return
    what = f"{what}, a safety factor of {breaking / tension:.2f}"
    yield phrase(path, what, f"below {SAFETY_FACTOR:g} take stronger rope or a lighter load")


def _called(rope: Rope) -> str:
    return rope.about or f"the {1e3 * rope.diameter_m:g} mm rope"
