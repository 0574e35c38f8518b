"""Diagnostics rows on the shape of ropes: touchdown point (TDP) and smallest bend radius."""

from __future__ import annotations

import math
from collections.abc import Sequence

from rope_twin.messages.status import Level, Status
from rope_twin.twin.snapshot import Bend, RopeBend, Touchdown


def touchdown_status(ropes: Sequence[Touchdown]) -> Status:
    """Return the row on the touchdown points; its level is always OK."""
    values: dict[str, str] = {}
    for one in ropes:
        x, y, z = one.position_m
        values |= {
            f"{one.name}: x, y, z [m]": f"{x:.2f}, {y:.2f}, {z:.2f}",
            f"{one.name}: line out to TDP [m]": f"{one.line_out_m:.2f}",
            f"{one.name}: layback [m]": f"{one.layback_m:.2f}",
            f"{one.name}: tension at TDP [N]": f"{one.tension_n:.6g}",
            f"{one.name}: angle to the seabed [degrees]": f"{one.angle_deg:.2f}",
        }
    message = "; ".join(touchdown_words(one, len(ropes) > 1) for one in ropes)
    return Status("simulation: touchdown", Level.OK, message, values)


def touchdown_words(one: Touchdown, named: bool) -> str:
    """Return the touchdown point of a rope in words; `named`: say of which rope."""
    which = f" of '{one.name}'" if named else ""
    return (
        f"touchdown point{which} at {one.line_out_m:.1f} m line out, layback "
        f"{one.layback_m:.1f} m, tension {one.tension_n / 1e3:.1f} kN"
    )


def bend_status(ropes: Sequence[RopeBend]) -> Status:
    """Return the row on the rope closest to its minimum bend radius, and on all below theirs."""
    values: dict[str, str] = {}
    for one in ropes:
        values |= {
            f"{one.now.name}: smallest bend radius now [m]": _radius(one.now.radius_m),
            f"{one.now.name}: below its upper end [m]": f"{one.now.line_out_m:.2f}",
            f"{one.now.name}: smallest since the start [m]": _radius(one.tightest.radius_m),
        }
        if one.now.minimum_m:
            values[f"{one.now.name}: minimum bend radius [m]"] = f"{one.now.minimum_m:g}"
    level = Level.WARN if any(one.tightest.too_tight for one in ropes) else Level.OK
    message = "; ".join(bends_in_words([one.tightest for one in ropes]))
    return Status("simulation: bend", level, message, values)


def bends_in_words(bends: Sequence[Bend]) -> list[str]:
    """Return in words the bend closest to its minimum radius, and all below theirs."""
    limited = [one for one in bends if one.minimum_m] or bends
    ordered = sorted(limited, key=lambda one: -one.tightness)
    reported = [one for n, one in enumerate(ordered) if n == 0 or one.too_tight]
    return [_bend_words(one, len(bends) > 1) for one in reported]


def _bend_words(one: Bend, named: bool) -> str:
    which = f" of '{one.name}'" if named else ""
    if math.isinf(one.radius_m):
        return f"no bending{which}: straight"
    words = (
        f"smallest bend radius{which} {_radius(one.radius_m)} m, {one.line_out_m:.1f} m below the "
        f"upper end at {one.at_s:.1f} s"
    )
    if one.radius_m < one.element_m:
        words += f" (not resolved by elements of {one.element_m:.3g} m)"
    if one.too_tight:
        return f"{words}: below the MBR of {one.minimum_m:g} m"
    return f"{words}; MBR {one.minimum_m:g} m" if one.minimum_m else words


def _radius(radius_m: float) -> str:
    return f"{radius_m:.3g}" if radius_m < 1000.0 else f"{radius_m:.0f}"
