"""Limits by the load chart of a plan in a sea: entered by a page, shown on all of them.

The chart has limits by phase, peak period and heading; the phase that lifts the payload past its
present depth is marked. Nothing measures the sea here: whoever enters it is asked to keep it true.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from rope_twin.console.control import Desk
from rope_twin.console.pages import Page, Pages
from rope_twin.console.readings import Values
from rope_twin.errors import phrase
from rope_twin.scene.load_chart import LoadChart, PhaseChart

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
            number = float(value) if isinstance(value, int | float) else math.nan
            if isinstance(value, bool) or not low <= number <= high:
                right = f"give {low:g} to {high:g} {unit}"
                return phrase("sea", f"{name} is {value!r}", right)
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
            "rows": [self._row(name, own) for name, own in chart.phases.items()],
        }

    def _row(self, name: str, own: PhaseChart) -> Values:
        low, high = sorted(own.depth_m)
        allowed = None
        if self.sea is not None:
            allowed = self._chart.allowed_height_m(name, self.sea.tp_s, self.sea.heading_deg)
        return {
            "phase": name,
            "from_m": own.depth_m[0],
            "to_m": own.depth_m[1],
            "here": low - AROUND_M <= self._depth_m <= high + AROUND_M,
            "allowed_hs_m": allowed,
            "may": None if allowed is None or self.sea is None else self.sea.hs_m <= allowed,
        }
