"""Recorded run as the source of a console: plays, pauses and jumps.

The messages that the pages show are read once, in a thread: of each topic as many as a page can
show, so that an hour of a run takes some tens of megabytes.
"""

from __future__ import annotations

import bisect
import os
import threading
import time
from collections.abc import Callable, Mapping
from typing import Any

from mcap.records import Channel

from rope_twin.console.control import RequestHandler, is_finite
from rope_twin.console.pages import WINDOW_S, Page, Pages
from rope_twin.console.readings import DIAGNOSTICS, NODES, SHOWN, Readings, Values
from rope_twin.errors import BagError, phrase
from rope_twin.messages.templates import NANOSECONDS
from rope_twin.recording.bag import find_bag
from rope_twin.recording.mcap_scan import McapScan, StoredMessage, mcap_files
from rope_twin.topics import BY_NAME, is_topic

_FAST_HZ = 25.0  # messages of a topic of a higher rate are kept _SPACING_NS apart
_SPACING_NS = round(NANOSECONDS / _FAST_HZ)
_NODES_NS = NANOSECONDS // 5  # likewise of ropes/nodes
_PIECE, _REST_S = 200, 0.001  # records between rests of the thread that reads
_LOOK_BACK_RATE_HZ = 5.0  # of the trend behind a jump
RATES = (0.25, 0.5, 1.0, 2.0, 5.0, 10.0)  # times real time


class Recording:
    """A recorded bag as a source; times are those since its first message [s]."""

    kind = "recording"

    def __init__(self, bag: str | os.PathLike[str]) -> None:
        """Open a bag and begin to read it.

        Raises:
            BagError: there is no such bag, or it holds no topic of a twin.
        """
        self._path = find_bag(os.fspath(bag))
        files = mcap_files(self._path)
        if not files or any(file.suffix != ".mcap" for file in files):
            problem, remedy = "it holds no .mcap file", "record with MCAP storage"
            raise BagError(f"bag {self._path}", problem, remedy)
        self._scans = [McapScan(file) for file in files]
        self._times: dict[str, list[int]] = {name: [] for name in SHOWN}
        self._data: dict[str, list[bytes]] = {name: [] for name in SHOWN}
        self._first_ns, self._last_ns = 0, 0
        self._loaded = threading.Event()
        self._enough = threading.Event()  # there is something to show, or nothing at all
        self._closing = False
        self._given: dict[str, int] = {}  # how many messages of a topic were handed on
        self._position_ns = 0
        self._polled_s: float | None = None
        self.rate, self.paused = 1.0, False
        self._jumped = False
        self._thread = threading.Thread(target=self._load, name="recording", daemon=True)
        self._thread.start()
        self._enough.wait()
        if not self._last_ns:
            problem = "no topic of a twin to show"
            raise BagError(f"bag {self._path}", problem, f"name a bag with {SHOWN[3]}")

    @property
    def duration_s(self) -> float:
        """Return the time from the first to the last message read up to now [s]."""
        return (self._last_ns - self._first_ns) / NANOSECONDS

    @property
    def position_s(self) -> float:
        """Return the time that is shown [s]."""
        return self._position_ns / NANOSECONDS

    def seek(self, to_s: float) -> None:
        """Show another time [s]; a time outside the recording is its nearest end."""
        within_s = min(max(0.0, to_s), self.duration_s)
        self._position_ns = round(within_s * NANOSECONDS)
        self._given.clear()
        self._jumped = True

    def poll(self, readings: Readings, now_s: float) -> None:
        """Hand on the newest message of each topic up to the position, which advances.

        Of the diagnostics each one counts: every node publishes only its own rows.
        """
        if self._polled_s is not None and not self.paused:
            passed_ns = max(0, round((now_s - self._polled_s) * self.rate * NANOSECONDS))
            self._position_ns = min(self._position_ns + passed_ns, self._last_ns - self._first_ns)
        self._polled_s = max(now_s, self._polled_s or now_s)
        self._hand_on(readings, self._first_ns + self._position_ns, now_s)
        if self.paused or self._at_end:  # what stands still is not stale
            readings.touch(now_s)

    def state(self) -> Values:
        """Return position, rate and length for the pages."""
        return {
            "name": self._path.name,
            "position_s": round(self.position_s, 2),
            "duration_s": round(self.duration_s, 2),
            "rate": self.rate,
            "paused": self.paused,
            "loaded": self._loaded.is_set(),
        }

    def close(self) -> None:
        """Stop reading."""
        self._closing = True
        self._thread.join()

    def take_jump(self) -> bool:
        """Return whether `seek` was called since the last call."""
        jumped, self._jumped = self._jumped, False
        return jumped

    def look_back(self, pages: Pages, now_s: float) -> None:
        """Fill the trend of the pages with the minute before the position."""
        end_ns = self._first_ns + self._position_ns
        step_ns = round(NANOSECONDS / _LOOK_BACK_RATE_HZ)
        at_ns = max(self._first_ns, end_ns - round(WINDOW_S * NANOSECONDS))
        while at_ns < end_ns:
            self._hand_on(pages.readings, at_ns, now_s)
            pages.look_back()
            at_ns += step_ns

    def play_from(self, now_s: float) -> None:
        """Let the position advance only from now on, as after a look back, which takes time."""
        self._polled_s = now_s

    @property
    def _at_end(self) -> bool:
        return self._position_ns >= self._last_ns - self._first_ns and self._loaded.is_set()

    def _hand_on(self, readings: Readings, until_ns: int, now_s: float) -> None:
        for name, times in self._times.items():
            upto, given = bisect.bisect_right(times, until_ns), self._given.get(name, 0)
            first = given if name == DIAGNOSTICS and given else upto - 1
            if upto > given:
                self._given[name] = upto
                for data in self._data[name][first:upto]:
                    readings.take(name, data, now_s)

    def _load(self) -> None:
        try:
            for scan in self._scans:
                names: dict[int, str] = {}
                for number, record in enumerate(scan.records()):
                    if self._closing:
                        return
                    if number % _PIECE == 0:  # let the server's thread run
                        time.sleep(_REST_S)
                    if isinstance(record, Channel):
                        for name in SHOWN:
                            if is_topic(record.topic, name):
                                names[record.id] = name
                    elif isinstance(record, StoredMessage) and record.channel_id in names:
                        self._keep(names[record.channel_id], record)
        finally:
            self._loaded.set()
            self._enough.set()

    def _keep(self, name: str, record: StoredMessage) -> None:
        times = self._times[name]
        fast = BY_NAME[name].rate_hz > _FAST_HZ  # of others, as those on change, each one counts
        spacing_ns = _NODES_NS if name == NODES else _SPACING_NS if fast else 0
        if times and record.log_ns - times[-1] < spacing_ns:
            return
        self._first_ns = self._first_ns or record.log_ns
        self._last_ns = max(self._last_ns, record.log_ns)
        self._data[name].append(record.data)
        times.append(record.log_ns)
        if self._last_ns - self._first_ns > NANOSECONDS:
            self._enough.set()


def connect_playback(
    source: Recording,
    pages: Pages,
    desk: RequestHandler,
    clock: Callable[[], float] = time.monotonic,
) -> None:
    """Let pages play, pause, jump and change the rate of a recording; clock: that of the pages."""

    def look() -> None:
        if source.take_jump():
            now_s = clock()
            pages.jump(lambda: source.look_back(pages, now_s))
            source.play_from(clock())

    def play(page: Page, content: Mapping[str, Any]) -> str:
        source.paused = False
        return ""

    def pause(page: Page, content: Mapping[str, Any]) -> str:
        source.paused = True
        return ""

    def seek(page: Page, content: Mapping[str, Any]) -> str:
        to_s = content.get("time_s")
        if not is_finite(to_s):
            return phrase("seek", f"{to_s!r}", "give a time in s")
        source.seek(float(to_s))
        return ""

    def rate(page: Page, content: Mapping[str, Any]) -> str:
        requested = content.get("rate")
        if isinstance(requested, bool) or requested not in RATES:
            known = ", ".join(f"{allowed:g}" for allowed in RATES)
            return phrase("rate", f"{requested!r}", f"give one of {known}")
        source.rate = float(requested)
        return ""

    pages.before_tick.append(look)
    desk.further |= {"play": play, "pause": pause, "seek": seek, "rate": rate}
