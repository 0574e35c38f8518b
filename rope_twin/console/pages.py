"""Connected pages, each with a bounded queue, and the frames that they are sent.

The last minute is kept for a page that connects: the trend, and the range of the tension along each
rope. Nodes of a rope move through the winch, so the range is kept at fixed fractions of its length.

A frame carries the values that have changed. A page that cannot keep up loses its oldest frames
and then receives a whole one, so that nothing on it stays wrong; the others and the suite do not
notice.
"""

from __future__ import annotations

import asyncio
import json
import logging
import math
from collections import deque
from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from rope_twin.console.readings import NODES, SESSION, Readings, Values, number, stale_limits_s
from rope_twin.errors import InputError, phrase
from rope_twin.messages import CloudReader
from rope_twin.quantity import json_value

PROTOCOL = 2  # raised when a page of an earlier version would misread a frame
RATE_HZ = 20.0  # of rows
PROFILE_EVERY = 5  # rows
_ENCODER = json.JSONEncoder(ensure_ascii=False, allow_nan=False, separators=(",", ":"))
QUEUE = 40  # frames that wait for a page: 2 s
FAULT = "fault console"  # value: why the server could not make a row
WINDOW_S = 60.0  # of the range and of the trend
POINTS = 41  # of a rope on the page
OLD_S = 1.0  # age from which the reading of an instrument is no longer drawn as measured
_FRACTIONS = np.linspace(0.0, 1.0, POINTS)
TREND = ("time_s", "tension_n", "low_n", "high_n", "measured_n", "line_out_m",
         "line_speed_m_per_s", "depth_m", "heave_m")  # fmt: skip
Vector = NDArray[np.float64]
_log = logging.getLogger(__name__)


class Source(Protocol):
    """Origin of the messages: a running suite or a recording."""

    kind: str  # "live" or "recording"

    def poll(self, readings: Readings, now_s: float) -> None:
        """Hand the messages that have arrived to `readings`; never waits."""

    def state(self) -> Values:
        """Return the state of the source itself for the pages, as of a recording its position."""

    def close(self) -> None:
        """Release what the source holds."""


class Page:
    """One connected page."""

    def __init__(self, number: int, address: str) -> None:
        self.number, self.address = number, address
        self.queue: asyncio.Queue[str] = asyncio.Queue(QUEUE)
        self.lost = 0  # frames that it was too slow for
        self.behind = False  # whether it has lost frames since its last whole one
        self.authorised = False  # whether it has given the token of --control
        self.heard_s = -math.inf  # steady time of its last message

    @property
    def name(self) -> str:
        """Return its name for other pages."""
        return f"page {self.number} ({self.address})"

    def submit(self, frame: str) -> None:
        """Queue a frame; if the queue is full, all that waits is dropped for it."""
        if self.queue.full():
            while not self.queue.empty():
                self.queue.get_nowait()
                self.lost += 1
            self.behind = True
        self.queue.put_nowait(frame)

    async def frames(self) -> str:
        """Wait for frames and return all that are queued, as one JSON array."""
        found = [await self.queue.get()]
        while not self.queue.empty():
            found.append(self.queue.get_nowait())
        return f"[{','.join(found)}]"


class Pages:
    """All pages, and the frames made from one source.

    Everything runs on the event loop of the server's thread.
    """

    def __init__(
        self,
        source: Source,
        clock: Callable[[], float],
        facts: Values | None = None,
        read_session: Callable[[bytes], Values] | None = None,
    ) -> None:
        """Make the pages of a source; clock: a steady one [s].

        facts: constant facts of the scene; None: those of twin/session, once it arrives, from which
        `read_session` makes them.
        """
        self.source, self._clock = source, clock
        self.readings, self.trend, self._profile = Readings(), Trend(RATE_HZ), RopeProfile()
        self.facts: Values = facts or {}
        self._read_session = None if facts else read_session
        self.state: Values = {}  # of control and source, sent when it changes
        self.pages: dict[int, Page] = {}
        self.extra: dict[str, Callable[[], Values]] = {}  # further parts of `state`, by name
        self.before_tick: list[Callable[[], None]] = []
        # each is called with a row of the trend of each rope
        self.rows: list[Callable[[list[Values]], None]] = []
        self.pace = 1.0  # rows over those of a run, for a test of hours in minutes
        self._number = 0
        self._rows = 0
        self.profile: list[Values] = []  # tension along each rope
        self._newest_profile = ""
        self._began_s = clock()

    def connect(self, address: str) -> Page:
        """Add a page; it first receives all that there is, with the trend of the last minute."""
        self._number += 1
        page = Page(self._number, address)
        self.pages[page.number] = page
        page.submit(self._hello(page))
        page.submit(self._all_values())
        if self._newest_profile:
            page.submit(self._newest_profile)
        return page

    def disconnect(self, page: Page) -> None:
        """Remove a page."""
        self.pages.pop(page.number, None)

    def jump(self, fill: Callable[[], None]) -> None:
        """Begin again at another time of a recording; `fill` calls `look_back` for what precedes.

        All pages are sent everything again, with the trend of the minute before.
        """
        self.readings.forget()
        self.trend.forget()
        self._profile.forget()
        fill()
        self.resend()

    def look_back(self) -> None:
        """Add the newest messages to the trend without sending anything."""
        self.readings.take_changed()
        self.trend.add(self.readings, self.facts)
        self._read_profile()

    def resend(self) -> None:
        """Send everything to every page again."""
        for page in self.pages.values():
            page.submit(self._hello(page))
            page.submit(self._all_values())

    def send(self, page: Page, content: Values) -> None:
        """Send one page a message of its own."""
        page.submit(_json(content))

    def tick(self) -> None:
        """Read the source and send a row, 20 times a second."""
        now_s = self._clock()
        for act in self.before_tick:
            act()
        readings = self.readings
        self.source.poll(readings, now_s)
        changed = readings.take_changed()
        if self._read_session and (session := readings.take_session()):
            self.facts = self._read_session(session)
            readings.put(f"fault {SESSION}", self.facts.get("reason", ""))
            self.resend()
        self._rows += 1
        rows = self.trend.add(readings, self.facts)
        if rows is not None:
            for take in self.rows:
                take(rows)
        self._send_row(changed, rows, now_s)
        if self._rows % PROFILE_EVERY == 0:
            if self._read_profile():
                for page in self.pages.values():
                    page.submit(self._newest_profile)
            self._send_state()

    def tick_or_report(self) -> None:
        """Do `tick`; a fault in it is logged and shown on the pages, which go on receiving rows."""
        try:
            self.tick()
        except Exception as error:  # whatever it is, pages must not freeze in silence
            message = phrase("console", f"{type(error).__name__}: {error}", "see the console's log")
            if self.readings.values.get(FAULT) != message:
                _log.exception("a row for the pages could not be made")
            self.readings.put(FAULT, message)
            for page in self.pages.values():
                page.behind = True  # what the failed tick has taken is sent in a whole frame
            try:
                self._send_row({}, None, self._clock())
            except Exception:
                _log.exception("the fault could not be shown on the pages")
        else:
            if self.readings.values.get(FAULT):
                self.readings.put(FAULT, "")

    async def run(self) -> None:
        """Send rows until cancelled; a row that is late is not made up for."""
        period_s, due_s = 1.0 / (RATE_HZ * self.pace), self._clock()
        while True:
            self.tick_or_report()
            due_s = max(due_s + period_s, self._clock())
            await asyncio.sleep(due_s - self._clock())

    def _send_row(self, changed: Values, trend: list[Values] | None, now_s: float) -> None:
        if not self.pages:
            return
        head = self._head(trend, now_s)
        frame, complete = _json({**head, "values": changed}), ""
        for page in self.pages.values():
            if page.behind:
                complete = complete or _json(
                    {**head, "values": self.readings.values, "whole": True}
                )
                page.behind = False
                page.submit(self._hello(page))  # what was dropped may have been state
                page.submit(complete)
                if self._newest_profile:
                    page.submit(self._newest_profile)
            else:
                page.submit(frame)

    def _read_profile(self) -> bool:
        """Read the newest nodes; return whether there were any."""
        nodes, time_s = self.readings.take_nodes(), self.readings.time_s
        if nodes is None or time_s is None:
            return False
        try:
            self.profile = self._profile.update(nodes, time_s)
        except InputError as error:
            self.readings.values["fault ropes/nodes"] = str(error)
            return False
        self._newest_profile = _json({"type": "profile", "ropes": self.profile})
        return True

    def _send_state(self) -> None:
        state = self._state()
        if state != self.state:
            self.state = state
            frame = _json({"type": "state", **state})
            for page in self.pages.values():
                page.submit(frame)

    def _state(self) -> Values:
        return {"source": self.source.state(),
                **{name: make() for name, make in self.extra.items()}}  # fmt: skip

    def _hello(self, page: Page) -> str:
        return _json(
            {
                "type": "hello",
                "protocol": PROTOCOL,
                "page": page.number,
                "kind": self.source.kind,
                "facts": self.facts,
                "stale_s": stale_limits_s(),
                "trend": [self.trend.columns(rope) for rope in range(self.trend.ropes)],
                **self._state(),
            }
        )

    def _all_values(self) -> str:
        return _json(
            {**self._head(None, self._clock()), "values": self.readings.values, "whole": True}
        )

    def _head(self, trend: list[Values] | None, now_s: float) -> Values:
        return {"type": "row", "seq": self._rows, "ages": self.readings.ages(now_s),
                "time_s": self.readings.time_s, "trend": trend}  # fmt: skip


class _TensionSample(NamedTuple):
    """Tension along a rope at one instant."""

    at_s: float
    tension_n: Vector  # (POINTS,)


class RopeProfile:
    """Tension and shape of each rope at POINTS fractions of its length, and its range."""

    def __init__(self) -> None:
        self._reader = CloudReader(NODES)
        self._samples: dict[int, deque[_TensionSample]] = {}

    def update(self, data: bytes, at_s: float) -> list[dict[str, Any]]:
        """Return the profile of each rope in a ropes/nodes message.

        at_s: the twin's time [s], by which the range is kept.

        Raises:
            InputError: the bytes are not such a message.
        """
        _, points = self._reader.read(data)
        return [
            self._rope(number_of, points[points["rope"] == number_of], at_s)
            for number_of in range(int(points["rope"].max()) + 1 if len(points) else 0)
        ]

    def forget(self) -> None:
        """Forget the range."""
        self._samples.clear()

    def _rope(self, number_of: int, nodes: NDArray[Any], at_s: float) -> dict[str, Any]:
        place = np.column_stack([nodes["x"], nodes["y"], nodes["z"]]).astype(np.float64)
        arc_m = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(place, axis=0), axis=1))])
        sampled_m = _FRACTIONS * arc_m[-1]
        tension_n = np.interp(sampled_m, arc_m, nodes["tension_n"].astype(np.float64))
        samples = self._samples.setdefault(number_of, deque())
        if samples and samples[-1].at_s > at_s:
            samples.clear()
        samples.append(_TensionSample(at_s, tension_n))
        while samples[0].at_s < at_s - WINDOW_S:
            samples.popleft()
        table = np.stack([look.tension_n for look in samples])
        low_n, high_n = table.min(axis=0), table.max(axis=0)
        x, y, z = (np.interp(sampled_m, arc_m, place[:, axis]) for axis in range(3))
        return {
            "along_m": _rounded(sampled_m, 1),
            "x_m": _rounded(x, 3),
            "y_m": _rounded(y, 3),
            "z_m": _rounded(z, 2),
            "tension_n": _rounded(tension_n, 0),
            "low_n": _rounded(low_n, 0),
            "high_n": _rounded(high_n, 0),
            "span_s": round(at_s - samples[0].at_s, 1),
            "min_now_n": number(float(nodes["tension_n"].min())),
            "min_n": number(float(low_n.min())),
            "min_at_m": number(float(sampled_m[int(low_n.argmin())])),
        }


def _rounded(values: Vector, digits: int) -> list[float]:
    return [float(value) for value in np.round(values, digits)]


class Trend:
    """Rows of the trend of each rope, for a page that connects or reconnects."""

    def __init__(self, rate_hz: float) -> None:
        self._most = round(WINDOW_S * rate_hz) + 1
        self._rows: list[deque[tuple[float | None, ...]]] = [deque(maxlen=self._most)]

    def add(
        self, readings: Readings, facts: Values | None = None
    ) -> list[dict[str, float | None]] | None:
        """Add and return the newest values, a row for each rope; None if the time has not advanced.

        facts: of the scene; heave counts from its mean hang-off, or from z = 0 where none is known.
        A time before that of the last row belongs to another run: the rows before are dropped.
        """
        time_s = readings.time_s
        if time_s is None:
            return None
        last = self._rows[0][-1][0] if self._rows[0] else None
        if last is not None and time_s <= last:
            if time_s == last:
                return None
            self.forget()
        rows = [
            _trend_row(readings, time_s, facts or {}, rope)
            for rope in range(max(1, len(readings.values.get("tension_n", ()))))
        ]
        while len(self._rows) < len(rows):
            self._rows.append(deque(maxlen=self._most))
        for history, row in zip(self._rows, rows, strict=False):
            history.append(tuple(row[name] for name in TREND))
        return rows

    def columns(self, rope: int = 0) -> dict[str, list[float | None]]:
        """Return all rows of a rope as columns."""
        rows = list(self._rows[rope])
        return {name: [row[place] for row in rows] for place, name in enumerate(TREND)}

    @property
    def ropes(self) -> int:
        """Return the number of ropes that have rows, at least one."""
        return len(self._rows)

    def forget(self) -> None:
        """Drop all rows."""
        self._rows = [deque(maxlen=self._most)]


def _trend_row(
    readings: Readings, time_s: float, facts: Values, rope: int
) -> dict[str, float | None]:
    values = readings.values
    named = facts.get("ropes") or ()
    rope_row = named[rope] if rope < len(named) else {}
    payloads, interval = values.get("payloads"), values.get("error_interval")
    named_here = (row for row in payloads or () if row["name"] == rope_row.get("payload"))
    payload = next(named_here, payloads[0] if payloads else None)
    depth = payload["place_m"][2] if payload else None
    hang_off, mean = values.get("hang_off_m"), facts.get("hang_off_m")
    height_m = hang_off[2] if hang_off else None
    # a residual keeps its last reading for ever: only its age shows that the instrument is lost
    measured = next((row["measured"] for row in values.get("residuals", ())
                     if row["quantity"] == "top_tension_n" and (row["age_s"] or 0.0) < OLD_S
                     and (len(named) < 2 or row["name"] == rope_row.get("winch"))),
                    None)  # fmt: skip
    return {
        "time_s": round(time_s, 3),
        "tension_n": _of_rope(values.get("tension_n"), rope),
        "low_n": interval[rope]["lower_n"] if interval and rope < len(interval) else None,
        "high_n": interval[rope]["upper_n"] if interval and rope < len(interval) else None,
        "measured_n": measured,
        "line_out_m": _of_rope(values.get("line_out_m"), rope),
        "line_speed_m_per_s": _of_rope(values.get("line_speed_m_per_s"), rope),
        "depth_m": None if depth is None else -depth,
        "heave_m": None if height_m is None else height_m - (mean[2] if mean else 0.0),
    }


def _of_rope(values: list[float | None] | None, rope: int) -> float | None:
    return values[rope] if values and rope < len(values) else None


def _json(content: Any) -> str:
    """Return JSON text; a number that JSON does not have is null."""
    try:
        return _ENCODER.encode(content)
    except ValueError:
        return _ENCODER.encode(json_value(content))
