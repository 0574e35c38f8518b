"""What operators read of a rope's shape: its touchdown, and its tightest bend."""

from __future__ import annotations

import math
from collections.abc import Sequence

from rope_twin.messages.status import Level, Status
from rope_twin.twin.snapshot import Bend, RopeBend, Touchdown


def touchdown_status(ropes: Sequence[Touchdown]) -> Status:
    """Where the ropes touch down; nothing is wrong with it."""
    values: dict[str, str] = {}
    for one in ropes:
        x, y, z = one.position_m
        values |= {
            f"{one.name}: x, y, z [m]": f"{x:.2f}, {y:.2f}, {z:.2f}",
            f"{one.name}: line out to it [m]": f"{one.line_out_m:.2f}",
            f"{one.name}: layback [m]": f"{one.layback_m:.2f}",
            f"{one.name}: tension there [N]": f"{one.tension_n:.6g}",
            f"{one.name}: angle to the bed [degrees]": f"{one.angle_deg:.2f}",
        }
    message = "; ".join(touchdown_words(one, len(ropes) > 1) for one in ropes)
    return Status("simulation: touchdown", Level.OK, message, values)


def touchdown_words(one: Touchdown, named: bool) -> str:
    """Where a rope touches down, for people."""
    which = f" of '{one.name}'" if named else ""
    return (
        f"touchdown{which} at {one.line_out_m:.1f} m of line out, layback {one.layback_m:.1f} m, "
        f"{one.tension_n / 1e3:.1f} kN there"
    )


def bend_status(ropes: Sequence[RopeBend]) -> Status:
    """Of the rope that is bent tightest beside what it may be, and all that are too tight."""
    values: dict[str, str] = {}
    for one in ropes:
        values |= {
            f"{one.now.name}: tightest radius now [m]": _radius(one.now.radius_m),
            f"{one.now.name}: below its upper end [m]": f"{one.now.line_out_m:.2f}",
            f"{one.now.name}: tightest radius since the start [m]": _radius(one.tightest.radius_m),
        }
        if one.now.minimum_m:
            values[f"{one.now.name}: minimum bend radius [m]"] = f"{one.now.minimum_m:g}"
    level = Level.WARN if any(one.tightest.too_tight for one in ropes) else Level.OK
    message = "; ".join(bends_in_words([one.tightest for one in ropes]))
    return Status("simulation: bend", level, message, values)


def bends_in_words(bends: Sequence[Bend]) -> list[str]:
    """The tightest beside what it may be, and all that are too tight, for people."""
    limited = [one for one in bends if one.minimum_m] or bends
    ordered = sorted(limited, key=lambda one: -one.tightness)
    told = [one for n, one in enumerate(ordered) if n == 0 or one.too_tight]
    return [_bend_words(one, len(bends) > 1) for one in told]


def _bend_words(one: Bend, named: bool) -> str:
    which = f" of '{one.name}'" if named else ""
    if math.isinf(one.radius_m):
        return f"no bend{which}: it is straight"
    words = (
        f"tightest bend{which} of {_radius(one.radius_m)} m radius, {one.line_out_m:.1f} m below "
        f"its upper end at {one.at_s:.1f} s"
    )
    if one.radius_m < one.element_m:
        words += f" (no more than elements of {one.element_m:.3g} m can tell)"
    if one.too_tight:
        return f"{words}: tighter than its minimum bend radius of {one.minimum_m:g} m"
    return f"{words}; its minimum bend radius is {one.minimum_m:g} m" if one.minimum_m else words


def _radius(radius_m: float) -> str:
    return f"{radius_m:.3g}" if radius_m < 1000.0 else f"{radius_m:.0f}"
