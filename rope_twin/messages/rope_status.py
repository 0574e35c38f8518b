"""Diagnostics rows on ropes: utilisation, violated limits, touchdown (TDP) and bend radius."""

from __future__ import annotations

import math
from collections.abc import Sequence

from rope_twin.messages.status import Level, Status
from rope_twin.twin.snapshot import (
    Bend,
    LimitBreach,
    RopeBend,
    RopeStrength,
    Snapshot,
    Touchdown,
)

WARN_UTILISATION = 0.5  # codes for lifting wire allow less than this share of the MBL
VIOLATED_FOR_S = 60.0  # after its last violation a limit is an ERROR for so long, then a WARN


def strength_status(ropes: Sequence[RopeStrength]) -> Status:
    """Return the row on the rope with the highest utilisation, with key values of every rope."""
    values = {}
    for one in ropes:
        values[f"{one.name}: utilisation [% of MBL]"] = f"{100.0 * one.utilisation:.1f}"
        if one.dynamic_amplification is not None:
            words = f"{one.dynamic_amplification:.3f}"
            values[f"{one.name}: dynamic amplification"] = words
    worst = max(ropes, key=lambda one: one.utilisation)
    level = Level.OK if worst.utilisation < WARN_UTILISATION else Level.WARN
    if worst.utilisation >= 1.0:
        level = Level.ERROR
    return Status("simulation: strength", level, strength_words(worst, len(ropes) > 1), values)


def strength_words(one: RopeStrength, named: bool) -> str:
    """Return the utilisation of a rope in words; `named`: say of which rope."""
    which = f" of '{one.name}'" if named else ""
    tension = f"maximum tension{which} {one.highest_n / 1e3:.1f} kN"
    words = f"{tension}, utilisation {one.utilisation:.2f} (MBL {one.breaking_load_n / 1e3:.0f} kN)"
    if one.utilisation >= 1.0:
        words = (
            f"MBL{which} exceeded (utilisation {one.utilisation:.2f}): rope failure expected; "
            f"{tension}, MBL {one.breaking_load_n / 1e3:.0f} kN"
        )
    if one.dynamic_amplification is not None:
        words += f"; DAF {one.dynamic_amplification:.2f}"
    return words


def limits_status(snapshot: Snapshot) -> Status:
    """Return the row on violated limits: ERROR for a while, WARN for the rest of the run."""
    name, violated = "simulation: limits", snapshot.breaches
    if not violated:
        return Status(name, Level.OK, "within all limits of the scene", {})
    values = {}
    for one in violated:
        what = f"{one.where}: {one.limit}"
        values[f"{what}, worst (limit {one.allowed:g})"] = f"{one.worst:.6g}"
        values[f"{what}, first, worst and last violation [s]"] = (
            f"{one.first_s:.2f}, {one.worst_s:.2f}, {one.last_s:.2f}"
        )
    newest = max(one.last_s for one in violated)
    level = Level.ERROR if snapshot.time_s - newest < VIOLATED_FOR_S else Level.WARN
    return Status(name, level, "; ".join(breach_words(one) for one in violated), values)


_LIMITS_IN_WORDS = {  # name of the limited quantity, scale, unit and number format
    "tension_n": ("tension of", 1e-3, " kN", ".1f"),
    "utilisation": ("utilisation of", 1.0, "", ".3g"),
    "strain": ("strain of", 100.0, " %", ".3g"),
    "min_tension_n": ("minimum tension of", 1e-3, " kN", ".1f"),
    "bend_radius": ("bend radius of", 1.0, " m", ".3g"),
    "payload_speed_m_per_s": ("speed of", 1.0, " m/s", ".3g"),
    "payload_depth_m": ("depth of", 1.0, " m", ".1f"),
    "landing_speed_m_per_s": ("landing speed of", 1.0, " m/s", ".3g"),
}


class BreachWords:
    """Reports each violated limit once, when it is first violated."""

    def __init__(self) -> None:
        self._said: set[tuple[str, str]] = set()

    def of(self, snapshot: Snapshot) -> list[str]:
        """Return a sentence for each limit that was not yet violated at an earlier call."""
        if len(snapshot.breaches) == len(self._said):
            return []
        fresh = [one for one in snapshot.breaches if (one.limit, one.where) not in self._said]
        self._said |= {(one.limit, one.where) for one in fresh}
        return [f"limit violated: {breach_words(one)}" for one in fresh]


def breach_words(one: LimitBreach) -> str:
    """Return a violated limit in words."""
    what, scale, unit, form = _LIMITS_IN_WORDS[one.limit]
    worst, allowed = (f"{scale * value:{form}}{unit}" for value in (one.worst, one.allowed))
    side = "below" if one.worst < one.allowed else "above"
    when = f"first at {one.first_s:.2f} s"
    if one.worst_s > one.first_s:
        when += f", worst at {one.worst_s:.2f} s"
    return f"{what} '{one.where}' {worst}, {side} the limit of {allowed} ({when})"


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
