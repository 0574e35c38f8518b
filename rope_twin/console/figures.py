"""Figures of the first page as text, for screens that are not a browser, and their units.

They are made from the same values as the page's, which it shows by the same rules (`console/src`).
Everything but a screen is in SI units.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeGuard

from rope_twin.console.readings import Values, crew_limit, of_winch, of_winches

G_M_PER_S2 = 9.80665  # a tonne-force is the weight of a tonne at standard gravity
UNKNOWN, MINUS = "–", "−"
LOST_S = 3.0  # age from which a residual's reading is that of an instrument that is lost
RISK_SPANS_S = (10.0, 20.0, 30.0)
_PER_ROPE = ("ropes", "tension_n", "line_out_m", "line_speed_m_per_s", "error_interval",
             "utilisation")  # fmt: skip
_ELEMENTS = {"top_tension": "Top tension", "payload_depth": "Payload depth", "slack": "Slack",
             "fatigue": "Fatigue"}  # fmt: skip


@dataclass(frozen=True)
class Units:
    """Units of force and speed that a screen shows."""

    force: str
    per_newton: float
    force_digits: int
    speed: str
    per_m_per_s: float
    speed_digits: int

    @property
    def name(self) -> str:
        """Return both units."""
        return f"{self.force} · {self.speed}"

    def forces(self, newton: float | None, signed: bool = False) -> str:
        """Return a force [N] as text without its unit."""
        return fixed(scaled(newton, self.per_newton), self.force_digits, signed)

    def speeds(self, m_per_s: float | None, signed: bool = False) -> str:
        """Return a speed [m/s] as text without its unit."""
        return fixed(scaled(m_per_s, self.per_m_per_s), self.speed_digits, signed)


_FORCES = (("kN", 1e-3, 1), ("t", 1e-3 / G_M_PER_S2, 2))
_SPEEDS = (("m/min", 60.0, 1), ("m/s", 1.0, 2))
UNITS = tuple(Units(*force, *speed) for speed in _SPEEDS for force in _FORCES)  # as on the page


def scaled(value: float | None, factor: float) -> float | None:
    """Return a value in another unit; None stays None."""
    return None if value is None else value * factor


def fixed(value: float | None, digits: int, signed: bool = False) -> str:
    """Return a number with so many decimals, or UNKNOWN; `signed`: + before a positive one."""
    if value is None or not math.isfinite(value):
        return UNKNOWN
    text = f"{abs(value):.{digits}f}"
    if float(text) == 0.0:
        return text
    return (MINUS if value < 0.0 else "+" if signed else "") + text


def known(value: object) -> TypeGuard[float]:
    """Return whether a value is a finite number."""
    return isinstance(value, int | float) and math.isfinite(value)


class Figure(NamedTuple):
    """One figure of the screen."""

    label: str
    text: str
    unit: str
    topic: str  # whose age is that of the figure
    note: str = ""
    warns: bool = False  # its measurement lies outside the interval, or a limit is exceeded


class AlertRow(NamedTuple):
    """One alert of the list."""

    priority: str
    state: str
    title: str
    text: str
    since_s: float | None  # time of the twin
    sounds: bool


class View(NamedTuple):
    """Values, facts and profile with one rope, its winch and its payload in first place."""

    values: Values
    facts: Values
    profile: Sequence[Values]


def limit(values: Values, facts: Values, name: str) -> float | None:
    """Return the stricter of a limit of the scene and the crew's, or None if there is neither."""
    rows: Sequence[Values] = facts.get("crew_limits", ())
    of_scene = next((row for row in rows if row["name"] == name), {})
    both = (of_scene.get("scene", (facts.get("limits") or {}).get(name)), crew_limit(values, name))
    return (max if of_scene.get("at_least") else min)(filter(known, both), default=None)


def of_rope(view: View, rope: int) -> View:
    """Return the view of a rope, by its number; its limit is the stricter of scene and crew."""
    values, facts = dict(view.values), dict(view.facts)
    ropes = facts.get("ropes") or ()
    row_of_rope = dict(ropes[rope]) if rope < len(ropes) else {}
    share = crew_limit(values, "utilisation")
    shared_n = scaled(row_of_rope.get("breaking_load_n"), share) if share is not None else None
    allowed_n = (row_of_rope.get("allowed_n"), crew_limit(values, "tension_n"), shared_n)
    row_of_rope["allowed_n"] = min(filter(known, allowed_n), default=None)
    facts["ropes"] = [row_of_rope]
    names = {"winches": row_of_rope.get("winch"), "payloads": row_of_rope.get("payload")}
    if len(ropes) > 1:
        residuals = values.get("residuals", ())
        values["residuals"] = [row for row in residuals if row["name"] in names.values()]
    for name in _PER_ROPE:
        if values.get(name):
            values[name] = values[name][rope : rope + 1]
    for name, name_of_rope in names.items():
        if values.get(name) and name_of_rope:
            first = [row for row in values[name] if row["name"] == name_of_rope]
            values[name] = first + [row for row in values[name] if row["name"] != name_of_rope]
    if winch := names["winches"]:
        for name in ("winch_mode", "seat"):
            values[name] = of_winch(str(values.get(name, "")), winch)
        facts["winches"] = {winch: (facts.get("winches") or {}).get(winch, {})}
    return View(values, facts, view.profile[rope : rope + 1])


def big_figures(values: Values, facts: Values, units: Units) -> list[Figure]:
    """Return line out, line speed, tension and utilisation of the first rope."""
    winch = first_winch(facts)
    rope = _first(facts.get("ropes"))
    length, rate, tension = (_value(values.get(name)) for name in
                             ("line_out_m", "line_speed_m_per_s", "tension_n"))  # fmt: skip
    reach = ""
    if known(winch.get("max_line_out_m")):
        shortest_m, longest_m = winch.get("min_line_out_m"), winch["max_line_out_m"]
        reach = f"{fixed(shortest_m, 0)} to {fixed(longest_m, 0)} m"
    compared, out_warns = _compared(values, "line_out_m", lambda m, sign: fixed(m, 2, sign), reach)
    note, warns = _compared(values, "top_tension_n", units.forces, _computed(values, units))
    allowed = rope.get("allowed_n")
    above_limit = known(allowed) and known(tension) and tension > allowed
    fastest = winch.get("speed_limit_m_per_s")
    way = _direction(rate, units)
    if known(fastest):
        way += f", limit ±{units.speeds(fastest)}"
    return [
        Figure("Line out", fixed(length, 1), "m", "ropes/length", compared, out_warns),
        Figure("Line speed", units.speeds(rate, True), units.speed, "ropes/length", way),
        Figure("Tension", units.forces(tension), units.force, "ropes/tension_top", note,
               warns or above_limit),
        _utilisation(values, rope, tension, units),
    ]  # fmt: skip


def payload_figures(values: Values, profile: Sequence[Values], facts: Values,
                    units: Units) -> list[Figure]:  # fmt: skip
    """Return depth, speed, height above the bed and slack margin of 60 s of the first payload."""
    payload, topic = _first(values.get("payloads")), "payloads/state"
    place, speed = payload.get("place_m") or [None] * 3, payload.get("velocity_m_per_s")
    vertical = speed[2] if speed else None
    height, rows = height_above_bed_m(values, facts), []
    depth = None if place[2] is None else -place[2]
    deepest = limit(values, facts, "payload_depth_m")
    too_deep = known(depth) and known(deepest) and depth > deepest
    rows.append(
        Figure("Payload depth", fixed(depth, 1), f"m{_side('≤', deepest)}", topic, "", too_deep)
    )
    arrow = "" if not known(vertical) else "↓ " if vertical < 0.0 else "↑ "
    size = abs(vertical) if known(vertical) else None
    rows.append(Figure("Vertical speed", arrow + units.speeds(size), units.speed, topic))
    if height is not None:
        clear = limit(values, facts, "bed_clearance_m")
        low = known(clear) and height < clear
        rows.append(
            Figure("Above the bed", fixed(height, 1), f"m{_side('≥', clear)}", topic, "", low)
        )
    min_n = _first(profile).get("min_n")
    if known(min_n):
        margin = min_n - (limit(values, facts, "min_tension_n") or 0.0)
        text = units.forces(margin)
        rows.append(Figure("Slack margin", text, units.force, "ropes/nodes", "", margin < 0))
    return rows


def height_above_bed_m(values: Values, facts: Values) -> float | None:
    """Return the payload's height above the bed [m], or None if it has no bed or is not known."""
    height = _first(values.get("bed")).get("payload_height_m")
    if known(height):
        return float(height)
    place, bed = _first(values.get("payloads")).get("place_m"), facts.get("bed_m")
    if place is None or not known(place[2]) or not known(bed):
        return None
    return float(place[2]) - float(bed)


def sea_figures(values: Values, facts: Values) -> list[Figure]:
    """Return heave of the first hang-off and the sea."""
    place, speed = values.get("hang_off_m"), values.get("hang_off_m_per_s")
    topic, mean = "hang_off/odometry", facts.get("hang_off_m")
    heave = place[2] - (mean[2] if mean else 0.0) if place and known(place[2]) else None
    rows = [
        Figure("Heave", fixed(heave, 2, True), "m", topic),
        Figure("Heave rate", fixed(speed[2] if speed else None, 2, True), "m/s", topic),
    ]
    sea = facts.get("sea") or {}
    if known(sea.get("significant_height_m")):
        text = f"{fixed(sea['significant_height_m'], 1)}, {fixed(sea.get('peak_period_s'), 1)}"
        rows.append(Figure("Sea Hs, Tp", text, "m, s", ""))
    return rows


def winch_figures(values: Values, facts: Values) -> list[Figure]:
    """Return mode, brake, compensation, drum layer and seat of the first winch."""
    row, winch, topic = _first(values.get("winches")), first_winch(facts), "winch/state"
    mode, seat = (
        "".join(of_winches(str(values.get(name, "")))[:1]).partition(": ")[2]
        for name in ("winch_mode", "seat")
    )
    mode = mode or UNKNOWN
    rows = [Figure("Mode", mode, "", "winch/mode", "", "(" in mode)]
    if "brake_holds" in row:
        rows.append(Figure("Brake", "set" if row["brake_holds"] else "released", "", topic))
    if "compensation_on" in row:
        state = "on" if row["compensation_on"] else "off"
        stroke = row.get("compensation_m")
        rows.append(Figure("Compensation", f"{state}, {fixed(stroke, 2, True)}", "m", topic))
    radius, core, rise = (row.get("drum_radius_m"), winch.get("drum_radius_m"),
                          winch.get("layer_rise_m"))  # fmt: skip
    if known(radius) and known(core) and known(rise):
        layer = max(1, round((radius - core) / rise + 0.5))
        rows.append(Figure("Drum layer", str(layer), "", topic))
    rows.append(Figure("Seat", seat or UNKNOWN, "", "winch/seat"))
    return rows


def quality_lines(values: Values) -> list[str]:
    """Return each quality index, and the reason of the lowest."""
    rows = [f"{_ELEMENTS.get(row['name'], row['name'])} {fixed(row['index'], 2)}"
            for row in values.get("quality", ())]  # fmt: skip
    message = values.get("diagnostics simulation: quality", {}).get("message", "")
    return [" · ".join(rows), message] if rows else []


def risk_lines(values: Values, units: Units) -> list[str]:
    """Return the risk of the next 10, 20 and 30 s, as far as there is a forecast."""
    by_span = {row["span_s"]: row for row in (values.get("risk") or {}).get("rows", ())}
    rows = [by_span[span] for span in RISK_SPANS_S if span in by_span]
    if not rows:
        return []
    limit = f"{units.forces(rows[0]['tension_limit_n'])} {units.force}"
    spans = "/".join(f"{row['span_s']:.0f}" for row in rows)
    lines = [
        f"{name} in {spans} s: {'/'.join(_percent(row[key]) for row in rows)} %"
        for name, key in ((f"P(> {limit})", "tension"), ("P(slack)", "slack"))
    ]
    if any(row["climatology"] for row in rows):
        lines[-1] += ", the last by climatology"
    return lines


def no_forecast(values: Values) -> str:
    """Return why there is none, in the words of the node that makes forecasts."""
    message = values.get("diagnostics forecast: worker", {}).get("message", "")
    return f"No forecast: {message}" if message else "No forecast"


def alert_rows(values: Values) -> list[AlertRow]:
    """Return the alerts in their order, faults of the console first.

    Without the topic `alerts`, as in an old recording, rows of the diagnostics stand in for them.
    """
    rows = [AlertRow("alarm", "acknowledged", name, str(text), None, False)
            for name, text in values.items() if name.startswith("fault ") and text]  # fmt: skip
    if "alerts" not in values:
        diagnostics = [(row["level"], name.removeprefix("diagnostics "), row["message"])
                 for name, row in values.items()
                 if name.startswith("diagnostics ") and row["level"]]  # fmt: skip
        return rows + [
            AlertRow("alarm" if level >= 2 else "warning", "acknowledged", name, text, None, False)
            for level, name, text in sorted(diagnostics, key=lambda row: (-row[0], row[1]))
        ]
    return rows + [
        AlertRow(alert["priority"], alert["state"],
                 alert["title"] + (" (first)" if alert["first_out"] else ""), alert["text"],
                 alert["since_s"], alert["sounds"])
        for alert in values["alerts"] if not alert["shelved"]
    ]  # fmt: skip


def first_winch(facts: Values) -> Values:
    """Return the facts of the first winch; empty: not known."""
    return next(iter((facts.get("winches") or {}).values()), {})


def _utilisation(values: Values, rope: Values, tension: float | None, units: Units) -> Figure:
    used, breaking = _first(values.get("utilisation")), rope.get("breaking_load_n")
    highest, utilisation = used.get("max_tension_n"), used.get("utilisation")
    load, note = breaking, ""
    if known(highest) and known(utilisation) and utilisation:
        load = highest / utilisation
    if known(load):
        note = f"of MBL {units.forces(load)} {units.force}"
        if known(highest):
            amplification = fixed(used.get("dynamic_amplification"), 2)
            note += f", maximum {units.forces(highest)}, DAF {amplification}"
    share = 100.0 * tension / load if known(tension) and known(load) else None
    return Figure("Utilisation", fixed(share, 1), "%", "ropes/utilisation", note)


def _computed(values: Values, units: Units) -> str:
    interval = _first(values.get("error_interval"))
    upper, lower = interval.get("upper_n"), interval.get("lower_n")
    if known(upper) and known(lower):
        half = units.forces((upper - lower) / 2.0)
        return f"computed ± {half} {units.force} (95 %)"
    if known(interval.get("rms_pct")):
        return f"computed, error ≤ {fixed(interval['rms_pct'], 2)} % RMS"
    return "computed"


def _compared(values: Values, quantity: str, text: Any, other: str) -> tuple[str, bool]:
    """Return measured and residual in words, or `other`; and whether it is outside its interval."""
    rows = (row for row in values.get("residuals", ()) if row["quantity"] == quantity)
    row = next(rows, None)
    if row is None or not known(row["measured"]) or (row["age_s"] or 0.0) > LOST_S:
        return other, False
    upper, lower, residual = row.get("upper"), row.get("lower"), row["residual"]
    outside = known(upper) and known(lower) and known(residual) and not lower <= residual <= upper
    return f"measured {text(row['measured'], False)}, Δ {text(residual, True)}", outside


def _direction(rate: float | None, units: Units) -> str:
    if not known(rate) or not re.search(r"[1-9]", units.speeds(rate)):
        return "stopped"
    return "↓ paying out" if rate > 0.0 else "↑ hauling in"


def _percent(share: float | None) -> str:
    return fixed(None if share is None else 100.0 * share, 0)


def _side(sign: str, value: float | None) -> str:
    return f" {sign} {fixed(value, 0)}" if known(value) else ""


def _first(rows: Sequence[Values] | None) -> Values:
    """Return the first of some rows; of none, an empty one."""
    return rows[0] if rows else {}


def _value(numbers: Sequence[float | None] | None) -> float | None:
    return numbers[0] if numbers else None
