"""Casts and markers: the log of a console, and its export as CSV.

A cast is a time between two decisions of the crew; its highest and lowest values are those of the
rows that the console has seen, 20 a second. The log belongs to the server's process; the bag of a
run has every message.
"""

from __future__ import annotations

import csv
import io
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from rope_twin.console.control import Desk
from rope_twin.console.pages import Page, Pages
from rope_twin.console.readings import Values
from rope_twin.errors import phrase

MOST_MARKERS, MOST_CASTS = 1000, 500
LONGEST_TEXT = 200
SHOWN_MARKERS = 50  # the newest ones, on the pages


@dataclass
class Cast:
    """Extremes of the first rope and payload between two times."""

    number: int
    from_s: float  # Unix time [s]
    to_s: float
    open: bool = True
    deepest_m: float | None = None
    longest_m: float | None = None
    highest_n: float | None = None
    lowest_n: float | None = None

    def see(self, row: Mapping[str, float | None], now_s: float) -> None:
        """Take a row of the trend."""
        self.to_s = now_s
        self.deepest_m = _larger(self.deepest_m, row["depth_m"])
        self.longest_m = _larger(self.longest_m, row["line_out_m"])
        self.highest_n = _larger(self.highest_n, row["tension_n"])
        lowest = None if row["tension_n"] is None else -row["tension_n"]
        found = _larger(None if self.lowest_n is None else -self.lowest_n, lowest)
        self.lowest_n = None if found is None else -found


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
    casts: list[Cast] = field(default_factory=list)
    markers: list[Marker] = field(default_factory=list)

    def connect(self, desk: Desk) -> None:
        """Let pages set markers and begin casts, and show both on all pages."""
        self.pages.rows.append(self.see)
        self.pages.extra["log"] = self.state
        desk.further |= {"mark": self._mark, "new_cast": self._new_cast}

    def see(self, row: Mapping[str, float | None]) -> None:
        """Take a row of the trend."""
        if not self.casts:
            self._begin()
        self.casts[-1].see(row, self.now_s())

    def state(self) -> Values:
        """Return casts and newest markers for the pages; times of the open cast by the second."""
        casts = [asdict(one) for one in self.casts]
        for one in casts:
            one["from_s"], one["to_s"] = round(one["from_s"]), round(one["to_s"])
        return {"casts": casts, "markers": [asdict(one) for one in self.markers[-SHOWN_MARKERS:]]}

    def casts_csv(self) -> str:
        """Return all casts as CSV."""
        names = [name for name in Cast.__dataclass_fields__ if name != "open"]
        return _csv(names, [[getattr(one, name) for name in names] for one in self.casts])

    def markers_csv(self) -> str:
        """Return all markers as CSV."""
        names = list(Marker.__dataclass_fields__)
        return _csv(names, [[getattr(one, name) for name in names] for one in self.markers])

    def trend_csv(self) -> str:
        """Return the rows of the last minute as CSV, rope by rope."""
        trend, named = self.pages.trend, self.pages.readings.values.get("ropes") or ()
        rows: list[list[Any]] = []
        for rope in range(trend.ropes):
            name = named[rope] if rope < len(named) else ""
            columns = trend.columns(rope)
            rows += [[name, *row] for row in zip(*columns.values(), strict=True)]
        return _csv(["rope", *trend.columns()], rows)

    def _begin(self) -> None:
        now_s = self.now_s()
        if self.casts:
            self.casts[-1].open = False
        self.casts.append(Cast(len(self.casts) + 1, now_s, now_s))

    def _new_cast(self, page: Page, content: Mapping[str, Any]) -> str:
        if len(self.casts) >= MOST_CASTS:
            return phrase("cast", f"there are {MOST_CASTS}", "start the console again")
        self._begin()
        return ""

    def _mark(self, page: Page, content: Mapping[str, Any]) -> str:
        text = content.get("text")
        if not isinstance(text, str) or not text.strip() or len(text) > LONGEST_TEXT:
            right = f"give 1 to {LONGEST_TEXT} characters"
            return phrase("marker", "no text, or too long", right)
        if len(self.markers) >= MOST_MARKERS:
            return phrase("marker", f"there are {MOST_MARKERS}", "start the console again")
        words = " ".join(text.split())
        self.markers.append(Marker(self.now_s(), self.pages.readings.time_s, words, page.name))
        return ""


def _larger(known: float | None, other: float | None) -> float | None:
    return other if known is None else known if other is None else max(known, other)


def _csv(names: list[str], rows: list[list[Any]]) -> str:
    """Return CSV (RFC 4180); a text that a spreadsheet would run as a formula is quoted by '."""
    made = io.StringIO()
    writer = csv.writer(made)
    writer.writerow(names)
    for row in rows:
        writer.writerow(
            f"'{one}" if isinstance(one, str) and one[:1] in "=+-@\t\r" else one for one in row
        )
    return made.getvalue()
