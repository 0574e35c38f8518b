"""Requests of pages beyond winch commands: log, crew's limits, learning, sea; facts of the scene.

A cast is a time between two decisions of the crew; its highest and lowest values are those of the
rows that the console has seen, 20 a second. The log belongs to the server's process; the bag of a
run has every message. Requests for limits and learning need the seat; each is answered at once, and
again with what the twin did, or with why nothing was seen.

A plan's load chart has limits by phase, peak period and heading; the phase that lifts the payload
past its present depth is marked. Nothing measures the sea here: whoever enters it on a page is
asked to keep it true.
"""

from __future__ import annotations

import csv
import io
import math
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from typing import Any

from rope_twin.alerts.limits import CREW_LIMITS, SCENE, impossible_limits, scene_limits
from rope_twin.console.control import (
    Commander,
    Outcome,
    PendingRequest,
    Refusal,
    RequestHandler,
    is_finite,
)
from rope_twin.console.pages import Page, Pages
from rope_twin.console.readings import Values, crew_limit
from rope_twin.effects.seabed import SeabedParams
from rope_twin.effects.waves import WavesParams
from rope_twin.errors import RopeTwinError, SceneError, did_you_mean, phrase
from rope_twin.recording.session import Session, decode_json
from rope_twin.scene.load_chart import LoadChart, PhaseChart
from rope_twin.scene.rigging import winch_of, winches_by_name
from rope_twin.scene.schema import Scene, Winch
from rope_twin.scene.shapes import payload_figures
from rope_twin.scene.winch import LAYER_RISE, SWITCHES
from rope_twin.topics import ACKNOWLEDGE_ALARM, APPLY_ESTIMATE, SESSION_TOPIC, TARE_ESTIMATE
from rope_twin.twin.run_record import LoadRules

MAX_MARKERS, MAX_CASTS = 1000, 500
LONGEST_TEXT = 200
SHOWN_MARKERS = 50  # the newest ones, on the pages
LEARNING = {"tare": TARE_ESTIMATE, "apply": APPLY_ESTIMATE, "acknowledge": ACKNOWLEDGE_ALARM}


@dataclass
class Extremes:
    """Extremes of a rope and its payload."""

    deepest_m: float | None = None
    longest_m: float | None = None
    max_n: float | None = None
    min_n: float | None = None

    def see(self, row: Mapping[str, float | None]) -> None:
        """Take a row of the trend."""
        for name, column, pick in (
            ("deepest_m", "depth_m", max), ("longest_m", "line_out_m", max),
            ("max_n", "tension_n", max), ("min_n", "tension_n", min),
        ):  # fmt: skip
            known = [number for number in (getattr(self, name), row[column]) if number is not None]
            setattr(self, name, pick(known, default=None))


@dataclass
class RopeExtremes:
    """Extremes of each rope between two times."""

    number: int
    from_s: float  # Unix time [s]
    to_s: float
    open: bool = True
    ropes: list[Extremes] = field(default_factory=list)

    def see(self, rows: Sequence[Mapping[str, float | None]], now_s: float) -> None:
        """Take a row of the trend of each rope."""
        self.to_s = now_s
        while len(self.ropes) < len(rows):
            self.ropes.append(Extremes())
        for rope, row in zip(self.ropes, rows, strict=False):
            rope.see(row)


@dataclass(frozen=True)
class Marker:
    """Words of a page at a time."""

    at_s: float  # Unix time [s]
    time_s: float | None  # the twin's time [s]
    text: str
    page: str


@dataclass
class Log:
    """Casts and markers of a console; the first cast begins with the first row."""

    pages: Pages
    now_s: Callable[[], float] = time.time  # Unix time
    casts: list[RopeExtremes] = field(default_factory=list)
    markers: list[Marker] = field(default_factory=list)

    def connect(self, desk: RequestHandler) -> None:
        """Let pages set markers and begin casts, and show both on all pages."""
        self.pages.rows.append(self.see)
        self.pages.extra["log"] = self.state
        desk.further |= {"mark": self._mark, "new_cast": self._new_cast}

    def see(self, rows: Sequence[Mapping[str, float | None]]) -> None:
        """Take a row of the trend of each rope."""
        if not self.casts:
            self._begin()
        self.casts[-1].see(rows, self.now_s())

    def state(self) -> Values:
        """Return casts and newest markers for the pages; times of the open cast by the second."""
        casts = [asdict(cast) for cast in self.casts]
        for cast in casts:
            cast["from_s"], cast["to_s"] = round(cast["from_s"]), round(cast["to_s"])
        return {
            "casts": casts,
            "markers": [asdict(marker) for marker in self.markers[-SHOWN_MARKERS:]],
        }

    def casts_csv(self) -> str:
        """Return all casts as CSV, rope by rope."""
        extremes = list(Extremes.__dataclass_fields__)
        rows = [
            [cast.number, cast.from_s, cast.to_s, self._rope(number)]
            + [getattr(rope, name) for name in extremes]
            for cast in self.casts
            for number, rope in enumerate(cast.ropes)
        ]
        return _csv(["number", "from_s", "to_s", "rope", *extremes], rows)

    def markers_csv(self) -> str:
        """Return all markers as CSV."""
        names = list(Marker.__dataclass_fields__)
        return _csv(names, [[getattr(marker, name) for name in names] for marker in self.markers])

    def trend_csv(self) -> str:
        """Return the rows of the last minute as CSV, rope by rope."""
        trend = self.pages.trend
        rows: list[list[Any]] = []
        for rope in range(trend.ropes):
            name = self._rope(rope)
            columns = trend.columns(rope)
            rows += [[name, *row] for row in zip(*columns.values(), strict=True)]
        return _csv(["rope", *trend.columns()], rows)

    def _rope(self, number: int) -> str:
        named = self.pages.readings.values.get("ropes") or ()
        return named[number] if number < len(named) else ""

    def _begin(self) -> None:
        now_s = self.now_s()
        if self.casts:
            self.casts[-1].open = False
        self.casts.append(RopeExtremes(len(self.casts) + 1, now_s, now_s))

    def _new_cast(self, page: Page, content: Mapping[str, Any]) -> str:
        if len(self.casts) >= MAX_CASTS:
            return phrase("cast", f"there are {MAX_CASTS}", "start the console again")
        self._begin()
        return ""

    def _mark(self, page: Page, content: Mapping[str, Any]) -> str:
        text = content.get("text")
        if not isinstance(text, str) or not text.strip() or len(text) > LONGEST_TEXT:
            remedy = f"give 1 to {LONGEST_TEXT} characters"
            return phrase("marker", "no text, or too long", remedy)
        if len(self.markers) >= MAX_MARKERS:
            return phrase("marker", f"there are {MAX_MARKERS}", "start the console again")
        label = " ".join(text.split())
        self.markers.append(Marker(self.now_s(), self.pages.readings.time_s, label, page.name))
        return ""


def _csv(names: list[str], rows: list[list[Any]]) -> str:
    """Return CSV (RFC 4180); a text that a spreadsheet would run as a formula is quoted by '."""
    stream = io.StringIO()
    writer = csv.writer(stream)
    writer.writerow(names)
    for row in rows:
        writer.writerow(
            f"'{cell}" if isinstance(cell, str) and cell[:1] in "=+-@\t\r" else cell for cell in row
        )
    return stream.getvalue()


class Requests:
    """Takes limits and requests to learning."""

    def __init__(self, pages: Pages, desk: RequestHandler, commander: Commander) -> None:
        """Add the requests to those of a desk that commands."""
        self._pages, self._commander = pages, commander
        desk.staged |= {"limit": self._limit, "learning": self._learning}

    def _limit(self, page: Page, content: Mapping[str, Any]) -> PendingRequest:
        """Set a limit, or end it if the value is None."""
        name, value = content.get("name"), content.get("value")
        self._check_limit(name, value)
        value_text = SCENE if value is None else repr(float(value))
        self._commander.command_alerts(f"limit {name} {value_text}")

        def outcome() -> Outcome | None:
            in_force = crew_limit(self._pages.readings.values, str(name))
            return (True, "the twin has taken it") if in_force == value else None

        why_not = phrase(f"limit {name}", "the twin does not report it", "it must be stricter than "
                         "the scene's")  # fmt: skip
        return PendingRequest(outcome, lambda: why_not)

    def _learning(self, page: Page, content: Mapping[str, Any]) -> PendingRequest:
        action = content.get("what")
        service = LEARNING.get(action) if isinstance(action, str) else None
        if service is None:
            raise Refusal("learning", f"'{action}'", did_you_mean(str(action), LEARNING))
        why_not = phrase(f"service {service}", "no answer", "learning needs a run with --learn")
        return PendingRequest(self._commander.call(service), lambda: why_not)

    def _check_limit(self, name: object, value: object) -> None:
        if not isinstance(name, str) or name not in CREW_LIMITS:
            raise Refusal("limit", f"'{name}'", did_you_mean(str(name), CREW_LIMITS))
        known = self._pages.facts.get("crew_limits", ())
        lacks = next((row["lacks"] for row in known if row["name"] == name), "")
        if lacks:
            raise Refusal(f"limit {name}", f"the scene has not {lacks}", "set another limit")
        if value is not None and not (is_finite(value) and value > 0.0):
            unit = CREW_LIMITS[name].unit
            remedy = f"give a positive number{unit and f' in {unit}'}"
            raise Refusal(f"limit {name}", f"{value!r}", remedy)


_WINCH_FIGURES = (
    "speed_limit_m_per_s", "acceleration_limit_m_per_s2", "min_line_out_m", "max_line_out_m",
    "follows", "when_commander_lost",
)  # fmt: skip


def scene_facts(scene: Scene) -> dict[str, Any]:
    """Return the facts of a scene as JSON types, SI with the unit in the name; None: unknown."""
    rules = LoadRules(scene)
    bed = scene.listed(SeabedParams)
    waves = scene.listed(WavesParams)
    sea = None if waves is None else waves.jonswap
    return {
        "scene": scene.name,
        "about": scene.about,
        "ropes": [
            {
                "name": line.name,
                "breaking_load_n": line.breaking_load_n,
                "allowed_n": rules.allowed_n[number],
                "length_m": line.length_m,
                "minimum_bend_radius_m": rules.radius_m(line.name) or None,
                "winch": line.from_ if winch_of(scene, line) else "",
                "payload": line.to,
            }
            for number, line in enumerate(scene.ropes)
        ],
        "limits": asdict(scene.limits),
        "crew_limits": _crew_limits(scene),
        "payloads": [_payload(scene, number) for number in range(len(scene.payloads))],
        "winches": {name: _winch(scene, winch) for name, winch in winches_by_name(scene).items()},
        "hang_off_m": list(scene.ship.hang_off_m),
        "bed_m": None if bed is None or bed.depth_m is None else -bed.depth_m,
        "sea": {
            "recorded": scene.sea_state.bag or None,
            "significant_height_m": None if sea is None else sea.significant_height_m,
            "peak_period_s": None if sea is None else sea.peak_period_s,
        },
    }


def session_facts(data: bytes) -> dict[str, Any]:
    """Return the facts of the scene in a twin/session message; if it cannot be read, the reason.

    The scene is built from the text in the message, whatever machine recorded it.
    """
    try:
        return scene_facts(Session.read(decode_json(SESSION_TOPIC, data)).scene())
    except RopeTwinError as error:
        return {"reason": str(error)}


def _crew_limits(scene: Scene) -> list[dict[str, Any]]:
    """Return the limits that a crew may set, each with the scene's own or what the scene lacks."""
    of_scene, lacks = scene_limits(scene), impossible_limits(scene)
    return [
        {"name": name, "unit": limit.unit, "at_least": limit.at_least, "scene": of_scene[name],
         "lacks": lacks.get(name, "")}
        for name, limit in CREW_LIMITS.items()
    ]  # fmt: skip


def _payload(scene: Scene, number: int) -> dict[str, Any]:
    payload, water = scene.payloads[number], scene.environment
    submerged_n = None
    with suppress(SceneError):  # its volume is not known
        known = payload_figures(payload, water.water_density_kg_per_m3)
        mass_kg = known.mass_kg - water.water_density_kg_per_m3 * known.volume_m3
        submerged_n = mass_kg * water.gravity_m_per_s2
    return {"name": payload.name, "mass_kg": payload.mass_kg, "submerged_n": submerged_n}


def _winch(scene: Scene, winch: Winch) -> dict[str, Any]:
    figures = {name: getattr(winch, name) for name in _WINCH_FIGURES}
    figures["switches"] = [
        kind for kind, needed in SWITCHES.items() if getattr(winch, needed) is not None
    ]
    ahc = winch.heave_compensation
    if ahc is not None:
        figures["compensation_stroke_m"] = ahc.stroke_m
        figures["compensation_speed_m_per_s"] = ahc.speed_limit_m_per_s
    if winch.drum is not None:
        line_of_winch = next(line for line in scene.ropes if winch_of(scene, line) is winch)
        diameter_m = line_of_winch.made_of[-1].rope.diameter_m  # the upper end is on the drum
        figures["drum_radius_m"] = winch.drum.core_radius_m
        figures["layer_rise_m"] = LAYER_RISE * diameter_m
    figures["modes"] = ["speed", "length", "depth"]
    if winch.constant_tension is not None:
        figures["modes"].append("tension")
    return figures


AROUND_M = 1.0  # of a phase's depths: the payload is in it
RANGES = {"hs_m": (0.0, 30.0, "m"), "tp_s": (1.0, 40.0, "s"), "heading_deg": (-360.0, 360.0, "°")}


@dataclass(frozen=True)
class EnteredSea:
    """Sea state that a page has entered."""

    hs_m: float
    tp_s: float
    heading_deg: float  # that the waves travel to, from the bow to port; 180: head seas
    at_s: float  # steady time


class SeaLimits:
    """The load chart against the sea that was entered last, and the payload's depth."""

    def __init__(self, pages: Pages, chart: LoadChart, clock: Callable[[], float]) -> None:
        self._pages, self._chart, self._clock = pages, chart, clock
        self.sea: EnteredSea | None = None
        self._depth_m = math.nan

    def connect(self, desk: RequestHandler) -> None:
        """Show the chart on all pages, and let them enter the sea."""
        self._pages.rows.append(self.see)
        self._pages.extra["sea_limits"] = self.state
        desk.further["sea"] = self.enter

    def see(self, rows: Sequence[Mapping[str, float | None]]) -> None:
        """Take a row of the trend of each rope: the first one's payload counts."""
        depth = rows[0].get("depth_m") if rows else None
        self._depth_m = math.nan if depth is None else float(depth)

    def enter(self, page: Page, content: Mapping[str, Any]) -> str:
        """Take the sea of a page; return why not, in one sentence, or ""."""
        numbers = {}
        for name, (low, high, unit) in RANGES.items():
            value = content.get(name)
            number = float(value) if is_finite(value) else math.nan
            if not low <= number <= high:
                remedy = f"give {low:g} to {high:g} {unit}"
                return phrase("sea", f"{name} is {value!r}", remedy)
            numbers[name] = number
        self.sea = EnteredSea(**numbers, at_s=self._clock())
        return ""

    def state(self) -> Values:
        """Return chart, sea and verdicts for the pages; the age of the sea by the minute."""
        chart, sea, scene = self._chart, self.sea, self._pages.facts.get("scene")
        age_s = None if sea is None else 60.0 * math.floor((self._clock() - sea.at_s) / 60.0)
        return {
            "plan": chart.plan,
            "scene": chart.scene,
            "other_scene": scene is not None and scene != chart.scene,
            "percentile": chart.percentile,
            "sea": None if sea is None else {**asdict(sea), "at_s": None, "age_s": age_s},
            "rows": [self._row(name, phase) for name, phase in chart.phases.items()],
        }

    def _row(self, name: str, chart: PhaseChart) -> Values:
        low, high = sorted(chart.depth_m)
        allowed = None
        if self.sea is not None:
            allowed = self._chart.allowed_height_m(name, self.sea.tp_s, self.sea.heading_deg)
        return {
            "phase": name,
            "from_m": chart.depth_m[0],
            "to_m": chart.depth_m[1],
            "here": low - AROUND_M <= self._depth_m <= high + AROUND_M,
            "allowed_hs_m": allowed,
            "may": None if allowed is None or self.sea is None else self.sea.hs_m <= allowed,
        }
