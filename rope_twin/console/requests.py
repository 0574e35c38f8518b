"""Requests of pages beyond winch commands: the log, limits of the crew, and learning.

A cast is a time between two decisions of the crew; its highest and lowest values are those of the
rows that the console has seen, 20 a second. The log belongs to the server's process; the bag of a
run has every message. Requests for limits and learning need the seat; each is answered at once, and
again with what the twin did, or with why nothing was seen.
"""

from __future__ import annotations

import csv
import io
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any, Protocol

from rope_twin.alerts.limits import CREW_LIMITS, SCENE
from rope_twin.console.control import Desk, Outcome, Refusal, Sent, is_finite
from rope_twin.console.pages import Page, Pages
from rope_twin.console.readings import Values, crew_limit
from rope_twin.errors import did_you_mean, phrase
from rope_twin.topics import ACKNOWLEDGE_ALARM, APPLY_ESTIMATE, TARE_ESTIMATE

MOST_MARKERS, MOST_CASTS = 1000, 500
LONGEST_TEXT = 200
SHOWN_MARKERS = 50  # the newest ones, on the pages
LEARNING = {"tare": TARE_ESTIMATE, "apply": APPLY_ESTIMATE, "acknowledge": ACKNOWLEDGE_ALARM}


@dataclass
class Extremes:
    """Extremes of a rope and its payload."""

    deepest_m: float | None = None
    longest_m: float | None = None
    highest_n: float | None = None
    lowest_n: float | None = None

    def see(self, row: Mapping[str, float | None]) -> None:
        """Take a row of the trend."""
        self.deepest_m = _larger(self.deepest_m, row["depth_m"])
        self.longest_m = _larger(self.longest_m, row["line_out_m"])
        self.highest_n = _larger(self.highest_n, row["tension_n"])
        lowest = None if row["tension_n"] is None else -row["tension_n"]
        larger_n = _larger(None if self.lowest_n is None else -self.lowest_n, lowest)
        self.lowest_n = None if larger_n is None else -larger_n


@dataclass
class Cast:
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
    casts: list[Cast] = field(default_factory=list)
    markers: list[Marker] = field(default_factory=list)

    def connect(self, desk: Desk) -> None:
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
        self.casts.append(Cast(len(self.casts) + 1, now_s, now_s))

    def _new_cast(self, page: Page, content: Mapping[str, Any]) -> str:
        if len(self.casts) >= MOST_CASTS:
            return phrase("cast", f"there are {MOST_CASTS}", "start the console again")
        self._begin()
        return ""

    def _mark(self, page: Page, content: Mapping[str, Any]) -> str:
        text = content.get("text")
        if not isinstance(text, str) or not text.strip() or len(text) > LONGEST_TEXT:
            remedy = f"give 1 to {LONGEST_TEXT} characters"
            return phrase("marker", "no text, or too long", remedy)
        if len(self.markers) >= MOST_MARKERS:
            return phrase("marker", f"there are {MOST_MARKERS}", "start the console again")
        label = " ".join(text.split())
        self.markers.append(Marker(self.now_s(), self.pages.readings.time_s, label, page.name))
        return ""


def _larger(known: float | None, value: float | None) -> float | None:
    return value if known is None else known if value is None else max(known, value)


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


class Caller(Protocol):
    """Way to the alert list and to the services of the suite."""

    def command_alerts(self, words: str) -> None:
        """Send a command to the alert list."""

    def call(self, service: str) -> Callable[[], Outcome | None]:
        """Call a service; the result returns its answer, None while there is none."""


class Requests:
    """Takes limits and requests to learning."""

    def __init__(self, pages: Pages, desk: Desk, caller: Caller) -> None:
        """Add the requests to those of a desk that commands."""
        self._pages, self._caller = pages, caller
        desk.staged |= {"limit": self._limit, "learning": self._learning}

    def _limit(self, page: Page, content: Mapping[str, Any]) -> Sent:
        """Set a limit, or end it if the value is None."""
        name, value = content.get("name"), content.get("value")
        self._check_limit(name, value)
        value_text = SCENE if value is None else repr(float(value))
        self._caller.command_alerts(f"limit {name} {value_text}")

        def outcome() -> Outcome | None:
            in_force = crew_limit(self._pages.readings.values, str(name))
            return (True, "the twin has taken it") if in_force == value else None

        why_not = phrase(f"limit {name}", "the twin does not report it", "it must be stricter than "
                         "the scene's")  # fmt: skip
        return Sent(outcome, lambda: why_not)

    def _learning(self, page: Page, content: Mapping[str, Any]) -> Sent:
        action = content.get("what")
        service = LEARNING.get(action) if isinstance(action, str) else None
        if service is None:
            raise Refusal("learning", f"'{action}'", did_you_mean(str(action), LEARNING))
        why_not = phrase(f"service {service}", "no answer", "learning needs a run with --learn")
        return Sent(self._caller.call(service), lambda: why_not)

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
