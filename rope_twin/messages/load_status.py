"""Rows of the diagnostics on what ropes carry, and the limits of the scene that were broken."""

from __future__ import annotations

from collections.abc import Sequence

from rope_twin.messages.status import Level, Status
from rope_twin.twin.snapshot import LimitBreach, RopeStrength, Snapshot

HALF = 0.5  # of the breaking load: rules for lifting wire leave less of it to the highest tension
BROKEN_FOR_S = 60.0  # a limit that is kept again is an ERROR for so long, a WARN from then on


def strength_status(ropes: Sequence[RopeStrength]) -> Status:
    """Utilisation of the rope that is nearest to its breaking load, and what it means."""
    values = {}
    for one in ropes:
        share = f"{100.0 * one.utilisation:.1f}"
        values[f"{one.name}: highest [% of its breaking load]"] = share
        if one.dynamic_amplification is not None:
            words = f"{one.dynamic_amplification:.3f}"
            values[f"{one.name}: dynamic amplification"] = words
    worst = max(ropes, key=lambda one: one.utilisation)
    level = Level.OK if worst.utilisation < HALF else Level.WARN
    if worst.utilisation >= 1.0:
        level = Level.ERROR
    return Status("simulation: strength", level, strength_words(worst, len(ropes) > 1), values)


def strength_words(one: RopeStrength, named: bool) -> str:
    """How near a rope has come to its breaking load, for people."""
    which = f" of '{one.name}'" if named else ""
    words = (
        f"highest tension{which} {one.highest_n / 1e3:.1f} kN, {100.0 * one.utilisation:.0f} % of "
        f"its breaking load of {one.breaking_load_n / 1e3:.0f} kN"
    )
    if one.utilisation >= 1.0:
        words += ": a real rope would have parted"
    if one.dynamic_amplification is not None:
        words += f"; dynamic amplification {one.dynamic_amplification:.2f}"
    return words


def limits_status(snapshot: Snapshot) -> Status:
    """Limits of the scene that were broken: ERROR for a while, WARN for the rest of the run."""
    name, broken = "simulation: limits", snapshot.breaches
    if not broken:
        return Status(name, Level.OK, "every limit of the scene is kept", {})
    values = {}
    for one in broken:
        what = f"{one.where}: {one.limit}"
        values[f"{what}, worst (limit {one.allowed:g})"] = f"{one.worst:.6g}"
        values[f"{what}, first, worst and last broken [s]"] = (
            f"{one.first_s:.2f}, {one.worst_s:.2f}, {one.last_s:.2f}"
        )
    newest = max(one.last_s for one in broken)
    level = Level.ERROR if snapshot.time_s - newest < BROKEN_FOR_S else Level.WARN
    return Status(name, level, "; ".join(breach_words(one) for one in broken), values)


_LIMITS_IN_WORDS = {  # what a limit is of, its scale and unit, and how a number is written
    "tension_n": ("tension of", 1e-3, " kN", ".1f"),
    "utilisation": ("utilisation of", 1.0, "", ".3g"),
    "strain": ("strain of", 100.0, " %", ".3g"),
    "min_tension_n": ("least tension of", 1e-3, " kN", ".1f"),
    "bend_radius": ("bend radius of", 1.0, " m", ".3g"),
    "payload_speed_m_per_s": ("speed of", 1.0, " m/s", ".3g"),
    "payload_depth_m": ("depth of", 1.0, " m", ".1f"),
    "landing_speed_m_per_s": ("landing speed of", 1.0, " m/s", ".3g"),
}


class BreachWords:
    """Says of each limit that is broken so once, when it happens."""

    def __init__(self) -> None:
        self._said: set[tuple[str, str]] = set()

    def of(self, snapshot: Snapshot) -> list[str]:
        """A sentence for each limit that was not broken at an earlier call."""
        if len(snapshot.breaches) == len(self._said):
            return []
        fresh = [one for one in snapshot.breaches if (one.limit, one.where) not in self._said]
        self._said |= {(one.limit, one.where) for one in fresh}
        return [f"limit broken: {breach_words(one)}" for one in fresh]


def breach_words(one: LimitBreach) -> str:
    """A limit that was broken, for people."""
    what, scale, unit, form = _LIMITS_IN_WORDS[one.limit]
    worst, allowed = (f"{scale * value:{form}}{unit}" for value in (one.worst, one.allowed))
    side = "below" if one.worst < one.allowed else "above"
    when = f"first at {one.first_s:.2f} s"
    if one.worst_s > one.first_s:
        when += f", worst at {one.worst_s:.2f} s"
    return f"{what} '{one.where}' {worst}, {side} its limit of {allowed} ({when})"
