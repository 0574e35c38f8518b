"""Cost and delay of the operator console: CPU of server and browser, topic to pixel, size.

A source publishes the messages of a hanging rope at 50 Hz of its own clock, stamped when they are
made; the console reads, encodes and sends them as in a run. Topic to pixel is the time from the
stamp of the newest top tension to the frame of the browser that shows its row. The transport of ROS
is not part of it. Server CPU is that of its thread, with WebSocket clients that read everything.
"""

from __future__ import annotations

import io
import statistics
import threading
import time
import zipfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rope_twin import messages
from rope_twin.console import server as console_server
from rope_twin.console.control import RequestHandler
from rope_twin.console.pages import Pages
from rope_twin.console.readings import SHOWN, Readings, Values
from rope_twin.console.requests import Log
from rope_twin.console.server import FOLDER
from rope_twin.errors import InputError
from rope_twin.messages import Level, Status
from rope_twin.twin.snapshot import CAUSES, Quality, RopeStrength, Snapshot, WinchSnapshot

CHROMIUM = Path("/usr/bin/chromium")
PUBLISHED_HZ = 50.0
NODES, LENGTH_M = 101, 3000.0
LIMITS = {
    "server, 1 page [% of a core]": 3.0,
    "server, 10 pages [% of a core]": 8.0,
    "browser, 1 page [% of a core]": 60.0,
    "topic to pixel, median [ms]": 150.0,
    "first paint [s]": 1.0,
    "wheel grows by [MB]": 3.0,
}  # issue of the console

# In the page: for each row, the time at which the frame that follows it begins, less its stamp.
_WATCH = """
window.delays = [];
const Plain = window.WebSocket;
window.WebSocket = class extends Plain {
  constructor(...given) {
    super(...given);
    this.addEventListener("message", (event) => {
      for (const frame of JSON.parse(event.data)) {
        if (frame.type !== "row" || !frame.trend) continue;
        const made = frame.trend[0].time_s;
        requestAnimationFrame(() => requestAnimationFrame(() => {
          window.delays.push(Date.now() / 1000 - EPOCH - made);
        }));
      }
    });
  }
};
"""


@dataclass(frozen=True)
class Row:
    """One figure and its limit."""

    what: str
    value: float
    limit: float

    @property
    def met(self) -> bool:
        """Return whether the figure is within its limit."""
        return self.value <= self.limit


class HangingRope:
    """Source of the messages of a rope that swings a little, stamped on a grid of 50 Hz."""

    kind = "live"

    def __init__(self, epoch_ns: int, pace: float = 1.0) -> None:
        """Begin at `epoch_ns`; pace: the rope's time over real time."""
        self._encoder, self._epoch_ns, self._pace = messages.Encoder(epoch_ns), epoch_ns, pace
        self._topics = [name for name in SHOWN if name in self._encoder.topics]
        self._last = -1
        self.polls = 0  # rows that were made
        self.spent_s = 0.0  # CPU time of making messages, which the suite does in a run
        self._snapshot = _snapshot(0.0)
        given = (name for name in self._topics if _is_given(self._encoder, name, self._snapshot))
        self._given = set(given)

    def poll(self, readings: Readings, now_s: float) -> None:
        """Hand over the newest messages of each topic."""
        began_s = time.thread_time()
        self.polls += 1
        self._poll(readings, now_s)
        self.spent_s += time.thread_time() - began_s

    def _poll(self, readings: Readings, now_s: float) -> None:
        passed_s = self._pace * (time.time() - self._epoch_ns * 1e-9)
        number = int(passed_s * PUBLISHED_HZ)
        if self._last < 0:
            readings.take("twin/epoch", messages.encode_epoch(self._epoch_ns), now_s)
        if number == self._last:
            return
        second = int(number / PUBLISHED_HZ) != int(self._last / PUBLISHED_HZ)
        self._last, snapshot = number, _snapshot(number / PUBLISHED_HZ)
        for name in self._given:
            readings.take(name, self._encoder.encode(name, snapshot), now_s)
        if second:
            rows = [Status(f"simulation: part {k}", Level.OK, "a sentence of some length", {})
                    for k in range(20)]  # fmt: skip
            stamp_ns = self._epoch_ns + snapshot.stamp_ns
            readings.take("diagnostics", messages.encode_diagnostics(stamp_ns, rows), now_s)

    def state(self) -> Values:
        """Return nothing: the source has no state."""
        return {}

    def close(self) -> None:
        """Do nothing."""


def _is_given(encoder: messages.Encoder, name: str, snapshot: Snapshot) -> bool:
    try:
        encoder.encode(name, snapshot)
    except InputError:
        return False
    return True


def _snapshot(time_s: float) -> Snapshot:
    arc_m = np.linspace(0.0, LENGTH_M, NODES)
    place = np.column_stack([40.0 * (arc_m / LENGTH_M) ** 2, 0.0 * arc_m, -arc_m])
    pull = 170e3 + 50.0 * (LENGTH_M - arc_m) + 8e3 * np.sin(0.6 * time_s - arc_m / 4000.0)
    top = float(pull[0])
    parts = (1.0, 1.0, 1.0, 1.0, None, None)
    index = Quality("top_tension", 0.7, CAUSES[4], "no measured top tension", parts, 0.7, 0.0, "")
    figures = (("compensation_m", 0.1), ("compensation_m_per_s", 0.2), ("compensation_on", 1.0))
    return Snapshot(
        stamp_ns=round(time_s * 1e9),
        step=round(time_s * 100),
        node_position_m=place,
        node_velocity_m_per_s=0.0 * place,
        node_tension_n=pull,
        element_tension_n=0.5 * (pull[1:] + pull[:-1]),
        arc_length_m=arc_m,
        tension_top_n=top,
        tension_top_min_n=top,
        tension_top_max_n=top,
        hang_off_force_n=np.array([0.0, 0.0, -top]),
        tension_payload_n=float(pull[-1]),
        hang_off_position_m=place[0],
        hang_off_velocity_m_per_s=np.zeros(3),
        heave_m=0.0,
        payload_position_m=place[-1],
        payload_velocity_m_per_s=np.zeros(3),
        line_out_m=LENGTH_M,
        payout_speed_m_per_s=0.1 * float(np.sin(time_s)),
        motion_ramp=1.0,
        strength=(RopeStrength("rope", 1.1 * top, 1e6, 3.2e5, 1.07),),
        winches=(WinchSnapshot("winch", "speed", 0.0, "", figures),),
        quality=(index,),
    )


def measure(duration_s: float, show: Callable[[int, int, str], None]) -> list[Row]:
    """Return all figures; each phase lasts `duration_s`.

    Raises:
        InputError: Chromium or Playwright is missing.
    """
    show(0, 3, "server, 1 page")
    figures = {"server, 1 page [% of a core]": _server_pct(1, duration_s)}
    show(1, 3, "server, 10 pages")
    figures["server, 10 pages [% of a core]"] = _server_pct(10, duration_s)
    show(2, 3, "browser")
    figures |= _browser(duration_s)
    figures["wheel grows by [MB]"] = _wheel_mb()
    show(3, 3, "")
    return [Row(quantity, figures[quantity], limit) for quantity, limit in LIMITS.items()]


def table(rows: Sequence[Row]) -> list[list[str]]:
    """Return the figures as a table."""
    head = ["figure", "measured", "limit", "met"]
    return [head] + [
        [row.what, f"{row.value:.3g}", f"{row.limit:g}", "yes" if row.met else "NO"] for row in rows
    ]


def serve(epoch_ns: int, pace: float = 1.0) -> console_server.Server:
    """Return a served console of a rope, with `pace` times as many rows as in a run."""
    pages = Pages(HangingRope(epoch_ns, pace), time.monotonic)
    pages.pace = pace
    desk = RequestHandler(pages, time.monotonic)
    log = Log(pages)
    log.connect(desk)
    server = console_server.Server(pages, desk, log, port=0)
    server.start()
    return server


def _server_pct(pages: int, duration_s: float) -> float:
    """Return the CPU of the server's thread with so many pages that read all [% of a core]."""
    from websockets.sync.client import connect

    served = serve(time.time_ns())
    origin = served.address.rstrip("/")
    stopping = threading.Event()

    def read() -> None:
        with connect(f"ws{origin[4:]}/live", origin=origin) as socket:
            while not stopping.is_set():
                socket.recv()

    readers = [threading.Thread(target=read, daemon=True) for _ in range(pages)]
    began_s = time.monotonic()
    for reader in readers:
        reader.start()
    time.sleep(duration_s)
    stopping.set()
    for reader in readers:
        reader.join(5.0)
    passed_s = time.monotonic() - began_s
    served.close()
    source = served.source
    assert isinstance(source, HangingRope)
    return 100.0 * (served.processor_s - source.spent_s) / passed_s


def browsing_tools() -> tuple[Any, Any]:
    """Return psutil and Playwright's entry.

    Raises:
        InputError: one of them or Chromium is missing.
    """
    try:
        import psutil
        from playwright.sync_api import sync_playwright
    except ImportError as error:
        right = "install it with `pip install '.[test]'`"
        raise InputError("browser", f"{error.name} is not installed", right) from error
    if not CHROMIUM.exists():
        raise InputError("browser", f"{CHROMIUM} does not exist", "install the package chromium")
    return psutil, sync_playwright


def _browser(duration_s: float) -> dict[str, float]:
    psutil, sync_playwright = browsing_tools()
    epoch_ns = time.time_ns()
    served = serve(epoch_ns)
    with sync_playwright() as play:
        browser = play.chromium.launch(executable_path=str(CHROMIUM), args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": 1280, "height": 800})
        page.add_init_script(_WATCH.replace("EPOCH", repr(epoch_ns * 1e-9)))
        page.goto(served.address)
        while page.inner_text("#tension") == "–":
            time.sleep(0.05)
        paint_ms = page.evaluate(
            "performance.getEntriesByName('first-contentful-paint')[0].startTime"
        )
        time.sleep(2.0)
        page.evaluate("window.delays.length = 0")
        cost_s = _cost_s(psutil)
        began_s = time.monotonic()
        time.sleep(duration_s)
        passed_s = time.monotonic() - began_s
        cost_s = _cost_s(psutil) - cost_s
        delays: list[float] = page.evaluate("window.delays")
        browser.close()
    served.close()
    return {
        "browser, 1 page [% of a core]": 100.0 * cost_s / passed_s,
        "topic to pixel, median [ms]": 1e3 * statistics.median(delays),
        "first paint [s]": 1e-3 * paint_ms,
    }


def _cost_s(psutil: Any) -> float:
    """Return the CPU time of the Chromium processes below this one [s]."""
    children = psutil.Process().children(recursive=True)
    times = [process.cpu_times() for process in children if "chrom" in process.name()]
    return sum(float(process.user + process.system) for process in times)


def _wheel_mb() -> float:
    """Return the size of the console's files, compressed as in a wheel [MB]."""
    buffer = io.BytesIO()
    folder = FOLDER.parent
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for path in sorted(folder.rglob("*")):
            if path.is_file() and "__pycache__" not in path.parts:
                archive.write(path, path.relative_to(folder))
    return len(buffer.getvalue()) / 1e6
