"""A console without ROS: a source that plays snapshots, a manual clock, and its pages."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from sample_snapshot import RESIDUAL, hanging_rope

from rope_twin import Snapshot, messages
from rope_twin.alerts.alert_list import Alert, Priority, State
from rope_twin.alerts.limits import CREW_LIMITS, CrewLimits
from rope_twin.console.control import RequestHandler, Token
from rope_twin.console.pages import Page, Pages
from rope_twin.console.readings import SHOWN, Readings, Values
from rope_twin.console.requests import Log, Requests
from rope_twin.messages import Level, Status
from rope_twin.messages.reports import band_columns, encode_alerts, encode_forecast
from rope_twin.recording.bag_writer import BagWriter
from rope_twin.topics import BY_NAME
from rope_twin.twin.winch.commands import WinchCommand

EPOCH_NS = 1_763_700_000_000_000_000
TOKEN = "a3f9c1d27b60"
FACTS: Values = {
    "scene": "deep_lift",
    "about": "a test",
    "ropes": [{"name": "rope", "breaking_load_n": 1.0e6, "allowed_n": 5.0e5, "length_m": 3000.0,
               "minimum_bend_radius_m": None}],
    "limits": {"tension_n": 5.0e5, "min_tension_n": 1.0e4},
    "crew_limits": [
        {"name": name, "unit": one.unit, "at_least": one.at_least,
         "lacks": one.needs if "lines" in one.needs else "",
         "scene": {"tension_n": 5.0e5, "min_tension_n": 1.0e4}.get(name)}
        for name, one in CREW_LIMITS.items()
    ],
    "payloads": [{"name": "payload", "mass_kg": 2e4, "submerged_n": 1.6e5}],
    "winches": {"winch": {"speed_limit_m_per_s": 1.0, "acceleration_limit_m_per_s2": 0.3,
                          "min_line_out_m": 100.0, "max_line_out_m": 3200.0,
                          "follows": "commands", "when_commander_lost": "ramp_to_zero",
                          "switches": ["emergency_stop", "reset", "set_brake", "release_brake"],
                          "modes": ["speed", "length", "depth"]}},
    "hang_off_m": [0.0, 0.0, 0.0],
    "bed_m": -3100.0,
    "sea": {},
}  # fmt: skip


class Clock:
    """A steady clock that tests set."""

    def __init__(self) -> None:
        self.now_s = 1000.0

    def __call__(self) -> float:
        return self.now_s


class SnapshotSource:
    """Source that encodes its snapshot at every poll, until `lost` is set."""

    kind = "live"

    def __init__(self, topics: tuple[str, ...] = SHOWN) -> None:
        self._encoder = messages.Encoder(EPOCH_NS)
        self.topics = topics
        self.snapshot: Snapshot = hanging_rope()
        self.lost = False
        self.mode, self.seat = "winch: speed 0 m/s", "winch: winch_schedule"
        self.alerts: list[Alert] = []
        self.rows = [Status("simulation: pacing", Level.OK, "on time")]
        self.horizon_s: float | None = None  # of a forecast, or None if there is none
        self.orders: tuple[str, ...] = ()  # that the next row compares
        self._polls = 0
        self.broken = False

    def poll(self, readings: Readings, now_s: float) -> None:
        if self.lost:
            return
        if self.broken:
            raise RuntimeError("no such subscription")
        self._polls += 1
        if self._polls == 1:
            readings.take("twin/epoch", messages.encode_epoch(EPOCH_NS), now_s)
        for topic in self.topics:
            if topic in self._encoder.topics and topic not in _LEFT_OUT:
                readings.take(topic, self._encoder.encode(topic, self.snapshot), now_s)
        text = encode_text(self.mode)
        readings.take("winch/mode", text, now_s)
        readings.take("winch/seat", messages.encode_text(self.seat), now_s)
        stamp_ns = EPOCH_NS + self.snapshot.stamp_ns
        alerts = encode_alerts(stamp_ns, self.snapshot.stamp_ns, self.alerts)
        readings.take("alerts", alerts, now_s)
        readings.take("diagnostics", messages.encode_diagnostics(stamp_ns, self.rows), now_s)
        if self.horizon_s is not None:
            for topic, rows in forecast_tables(self.horizon_s).items():
                origin_ns = stamp_ns - 1_000_000_000
                readings.take(topic, encode_forecast(topic, origin_ns, "map", rows), now_s)
        if self.orders:
            rows = [order_row(name, 1e4 * k) for k, name in enumerate(self.orders)]
            data = encode_forecast("forecast/orders", stamp_ns - 1_000_000_000, "map", rows)
            readings.take("forecast/orders", data, now_s)
            self.orders = ()

    def compare(self, page: Page, content: Mapping[str, Any]) -> str:
        """Answer as the node of a suite with a forecast does."""
        self.orders = ("hold", *content["orders"].split())
        return ""

    def state(self) -> Values:
        return {}

    def close(self) -> None:
        pass


def encode_text(text: str) -> bytes:
    """Encode a std_msgs/String."""
    return messages.encode_text(text)


def order_row(name: str, change_n: float) -> dict[str, float | str]:
    """Return a row of forecast/orders, 30 s ahead."""
    changes = {f"peak_change_{k}_n": change_n + 100.0 * (k - 50) for k in (5, 50, 95)}
    return {"name": name, "span_s": 30.0, "tension": 0.25, "slack": 0.0, "rope": 0.0, "lower": 0.1,
            **changes}  # fmt: skip


def forecast_tables(horizon_s: float) -> dict[str, list[dict[str, float]]]:
    """Return rows of the forecast topics: a widening interval, rising risks, four quiet windows."""
    low, median, high = band_columns("top_tension_n")
    return {
        "forecast/tension": [
            {"lead_s": 0.5 * k, low: 3.2e5 - 200 * k, median: 3.2e5, high: 3.2e5 + 200 * k}
            for k in range(1, 121)
        ],
        "forecast/ropes": [
            {"rope": rope, "lead_s": 0.5 * k, low: top - 200 * k, median: top, high: top + 200 * k}
            for rope, top in ((0.0, 3.2e5), (1.0, 1e5))
            for k in range(1, 121)
        ],
        "forecast/risk": [
            {"span_s": span, "tension": 0.002 * span, "slack": 0.001 * span,
             "tension_limit_n": 5e5, "horizon_s": horizon_s, "coverage": 0.91, "judged": 40.0,
             "factor": 1.1, "age_s": 0.4}
            for span in (10.0, 20.0, 30.0, 60.0)
        ],
        "forecast/quiet": [
            {"begin_s": begin, "length_s": 10.0, "probability": 0.05 * begin,
             "speed_limit_m_per_s": 0.3, "age_s": 0.4}
            for begin in (0.0, 2.0, 5.0, 10.0)
        ],
    }  # fmt: skip


TENSION_ALARM = Alert(
    10001, 1, "top tension", Priority.ALARM, "B", State.UNACKNOWLEDGED,
    "rope: 510 kN, limit 500 kN", 0, 0,
)  # fmt: skip


# of a snapshot without bodies, bends, winches and lines
_LEFT_OUT = ("payloads/body", "ropes/bend_radius", "lines/crossings", "winch/state", "winch/mode",
             "seabed/touchdown", "ropes/utilisation")  # fmt: skip


@dataclass
class FakeCommander:
    """Commander that records what the console sends and applies it to the rig's twin."""

    source: SnapshotSource
    name: str = "console"
    sent: list[tuple[str, WinchCommand]] = field(default_factory=list)
    taken: list[str] = field(default_factory=list)
    released: int = 0
    alert_words: list[str] = field(default_factory=list)
    obeys: bool = True
    known: tuple[str, ...] = ()
    called: list[str] = field(default_factory=list)

    def prepare(self, winches: Sequence[str]) -> None:
        self.known = tuple(winches)

    def take(self, winch: str) -> None:
        self.taken.append(winch)

    def send(self, winch: str, command: WinchCommand) -> None:
        self.sent.append((winch, command))
        if self.obeys:
            self.source.seat = f"{winch}: {self.name}"
            value = f" {command.value:g} m/s" if command.kind == "speed" else ""
            self.source.mode = f"{winch}: {command.kind.replace('_', ' ')}{value}"

    def release(self) -> None:
        self.released += 1

    def command_alerts(self, words: str) -> None:
        self.alert_words.append(words)
        verb, *rest = words.split()
        if verb == "limit" and self.obeys:
            limits = CrewLimits({"tension_n": 5e5})
            limits.set(*rest)
            self.source.rows = [*self.source.rows, limits.row()]

    def call(self, service: str) -> Callable[[], tuple[bool, str] | None]:
        self.called.append(service)
        return lambda: (True, f"{service}: done") if self.obeys else None


class ConsoleRig:
    """Pages, desk and log on a manual clock."""

    def __init__(self, control: bool = True, topics: tuple[str, ...] = SHOWN) -> None:
        self.clock = Clock()
        self.source = SnapshotSource(topics)
        self.pages = Pages(self.source, self.clock, FACTS)
        self.commander = FakeCommander(self.source)
        token = Token(TOKEN, self.clock) if control else None
        self.desk = RequestHandler(self.pages, self.clock, self.commander, token)
        self.silent: set[int] = set()  # pages that hang: they are connected and say nothing
        self.pages.before_tick.append(self.desk.update)
        if control:
            Requests(self.pages, self.desk, self.commander)
        self.log = Log(self.pages)
        self.log.connect(self.desk)

    def tick(self, count: int = 1, step_s: float = 0.05) -> None:
        """Advance clock and twin."""
        for _ in range(count):
            self.clock.now_s += step_s
            if not self.source.lost:
                time_s = self.source.snapshot.time_s + step_s
                fresh = replace(RESIDUAL, at_s=time_s - 0.1)
                snapshot = hanging_rope(time_s=time_s, heave_m=0.4)
                self.source.snapshot = replace(snapshot, residuals=(fresh,))
            for page in list(self.pages.pages.values()):
                if page.number not in self.silent:
                    self.desk.take(page, {"do": "alive"})
            self.pages.tick_or_report()

    def page(self, signed_in: bool = False) -> Page:
        """Connect a page; `signed_in`: it has sent the token."""
        page = self.pages.connect("127.0.0.1")
        if signed_in:
            self.desk.take(page, {"do": "sign_in", "token": TOKEN, "id": 0})
        return page


def recorded_lift(path: Path, lasts_s: float) -> Path:
    """Write a bag with a line out of 1000 m + 1 m/s, and return its path."""
    topics = "ropes/tension_top", "ropes/length", "ropes/nodes"
    writer = BagWriter(path, [BY_NAME[topic_name] for topic_name in (*topics, "twin/epoch")])
    encoder = messages.Encoder(EPOCH_NS)
    writer.write("twin/epoch", EPOCH_NS, messages.encode_epoch(EPOCH_NS))
    for number in range(round(lasts_s * 10)):
        time_s = 0.1 * number
        snapshot = hanging_rope(nodes=5, length_m=1000.0 + time_s, time_s=time_s)
        for topic in topics:
            writer.write(topic, EPOCH_NS + snapshot.stamp_ns, encoder.encode(topic, snapshot))
    writer.close()
    return path


def frames(page: Page) -> list[dict[str, Any]]:
    """Return the frames that wait for a page."""
    waiting = []
    while not page.queue.empty():
        waiting.append(json.loads(page.queue.get_nowait()))
    return waiting


def replies(page: Page) -> list[dict[str, Any]]:
    """Return the replies among a page's waiting frames."""
    return [frame for frame in frames(page) if frame["type"] == "reply"]
