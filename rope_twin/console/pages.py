"""Connected pages, each with a bounded queue, and the frames that they are sent.

A frame carries the values that have changed. A page that cannot keep up loses its oldest frames
and then receives a whole one, so that nothing on it stays wrong; the others and the suite do not
notice.
"""

from __future__ import annotations

import asyncio
import json
import logging
import math
from collections.abc import Callable
from typing import Any, Protocol

from rope_twin.console.profile import RopeProfile, Trend
from rope_twin.console.readings import Readings, Values, stale_limits_s
from rope_twin.errors import InputError, phrase

PROTOCOL = 2  # raised when a page of an earlier version would misread a frame
RATE_HZ = 20.0  # of rows
PROFILE_EVERY = 5  # rows
_ENCODER = json.JSONEncoder(ensure_ascii=False, allow_nan=False, separators=(",", ":"))
QUEUE = 40  # frames that wait for a page: 2 s
FAULT = "fault console"  # value: why the server could not make a row
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

    def offer(self, frame: str) -> None:
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
        """Make the pages of a source.

        Args:
            source: where messages come from.
            clock: steady clock [s].
            facts: constant facts of the scene; None: those of twin/session, once it arrives.
            read_session: makes the facts from a message of twin/session.
        """
        self.source, self._clock = source, clock
        self.readings, self.trend, self._profile = Readings(), Trend(RATE_HZ), RopeProfile()
        self.facts: Values = facts or {}
        self._read_session = None if facts else read_session
        self.state: Values = {}  # of control and source, sent when it changes
        self.pages: dict[int, Page] = {}
        self.extra: dict[str, Callable[[], Values]] = {}  # further parts of `state`, by name
        self.before_tick: list[Callable[[], None]] = []
        # each is called with a row of the trend of the first rope
        self.rows: list[Callable[[Values], None]] = []
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
        page.offer(self._hello(page))
        page.offer(self._whole())
        if self._newest_profile:
            page.offer(self._newest_profile)
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
            page.offer(self._hello(page))
            page.offer(self._whole())

    def send(self, page: Page, content: Values) -> None:
        """Send one page a message of its own."""
        page.offer(_json(content))

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
            self.resend()
        self._rows += 1
        rows = self.trend.add(readings, self.facts)
        if rows is not None:
            for take in self.rows:
                take(rows[0])
        self._send_row(changed, rows, now_s)
        if self._rows % PROFILE_EVERY == 0:
            self._send_profile()
            self._send_state()

    def tick_or_report(self) -> None:
        """Do `tick`; a fault in it is logged and shown on the pages, which go on receiving rows."""
        try:
            self.tick()
        except Exception as error:  # whatever it is, pages must not freeze in silence
            words = phrase("console", f"{type(error).__name__}: {error}", "see the console's log")
            if self.readings.values.get(FAULT) != words:
                _log.exception("a row for the pages could not be made")
            self.readings.put(FAULT, words)
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
        head = {"type": "row", "seq": self._rows, "ages": self.readings.ages(now_s),
                "time_s": self.readings.time_s, "trend": trend}  # fmt: skip
        frame, whole = _json({**head, "values": changed}), ""
        for page in self.pages.values():
            if page.behind:
                whole = whole or _json({**head, "values": self.readings.values, "whole": True})
                page.behind = False
                page.offer(self._hello(page))  # what was dropped may have been state
                page.offer(whole)
                if self._newest_profile:
                    page.offer(self._newest_profile)
            else:
                page.offer(frame)

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

    def _send_profile(self) -> None:
        if self._read_profile():
            for page in self.pages.values():
                page.offer(self._newest_profile)

    def _send_state(self) -> None:
        state = self._state()
        if state != self.state:
            self.state = state
            frame = _json({"type": "state", **state})
            for page in self.pages.values():
                page.offer(frame)

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

    def _whole(self) -> str:
        now_s = self._clock()
        return _json(
            {
                "type": "row",
                "seq": self._rows,
                "ages": self.readings.ages(now_s),
                "time_s": self.readings.time_s,
                "trend": None,
                "values": self.readings.values,
                "whole": True,
            }
        )


def _json(content: Any) -> str:
    """Return JSON text; a number that JSON does not have is null."""
    try:
        return _ENCODER.encode(content)
    except ValueError:
        return _ENCODER.encode(_finite(content))


def _finite(value: Any) -> Any:
    match value:
        case dict():
            return {key: _finite(one) for key, one in value.items()}
        case list() | tuple():
            return [_finite(one) for one in value]
        case float():
            return value if math.isfinite(value) else None
        case _:
            return value
