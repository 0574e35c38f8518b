"""Facts that the pages need beside the topics: those of a scene, and a plan's limits in a sea.

Of a scene they are constant: limits, winch, payload, bed. A plan's load chart has limits by phase,
peak period and heading; the phase that lifts the payload past its present depth is marked. Nothing
measures the sea here: whoever enters it on a page is asked to keep it true.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from typing import Any

from rope_twin.alerts.limits import CREW_LIMITS, impossible_limits, scene_limits
from rope_twin.console.control import Desk, is_finite
from rope_twin.console.pages import Page, Pages
from rope_twin.console.readings import Values
from rope_twin.effects.seabed import SeabedParams
from rope_twin.effects.waves import WavesParams
from rope_twin.errors import RopeTwinError, SceneError, phrase
from rope_twin.recording.input_log import decode_json
from rope_twin.recording.session import Session
from rope_twin.scene.load_chart import LoadChart, PhaseChart
from rope_twin.scene.rigging import winch_of, winches_by_name
from rope_twin.scene.schema import Scene, Winch
from rope_twin.scene.shapes import payload_figures
from rope_twin.scene.winch import LAYER_RISE, SWITCHES
from rope_twin.topics import SESSION_TOPIC
from rope_twin.twin.run_record import LoadRules

_WINCH_FIGURES = (
    "speed_limit_m_per_s", "acceleration_limit_m_per_s2", "least_line_out_m", "most_line_out_m",
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
        diameter_m = line_of_winch.made_of[0].rope.diameter_m
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

    def connect(self, desk: Desk) -> None:
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
