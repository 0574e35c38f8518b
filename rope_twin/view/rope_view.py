"""Display of decoded messages in rerun, the same for live topics and for bags."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rope_twin.errors import InputError, phrase
from rope_twin.messages.templates import FLOAT32_BYTES, NANOSECONDS, scale_above
from rope_twin.view.blueprint import (
    BAND_CURVES,
    CURVES,
    LOG,
    LOWER_END,
    OVERVIEW,
    PROFILE,
    SURFACE,
    Ranges,
    Shown,
    layout,
)
from rope_twin.view.figures import Figures
from rope_twin.view.lower_end import LowerEnd
from rope_twin.view.overview import Overview
from rope_twin.view.profile import Profile
from rope_twin.view.series import FILE_BATCH_NS, LIVE_BATCH_NS, Series
from rope_twin.view.sinks import Sink
from rope_twin.view.status_log import StatusLog
from rope_twin.view.surface import Surface
from rope_twin.view.ticks import decade_range
from rope_twin.view.timelines import Timelines
from rope_twin.view.watched import WatchedCharts

SHOWN_TOPICS = (
    "twin/epoch", "winch/state", "winch/parts", "tension_top/band", "tension", "payloads/state",
    "payload/rigging", "payload/odometry", "bars/state", "rope/nodes", "ropes/nodes",
    "rope/vibration", "rope/fatigue", "ship/heave",
    "ship/odometry", "sea/elevation", "lines/crossings", "lines/events",
    "seabed/touchdown", "rope/bend", "diagnostics",
)  # fmt: skip
PICTURE_NS = NANOSECONDS // 10  # ropes and sea are drawn at most 10 times a second
_EPOCH_WITHIN_NS = 2 * NANOSECONDS  # how long the first messages are held until twin/epoch comes


class RopeView:
    """Shows the suite's messages; to be used from one thread only.

    Every scalar is kept; ropes are drawn at most 10 times per second. Only stamped topics are
    drawn: the Float64 topics carry the same values without a stamp, and would be plotted at their
    time of arrival.
    """

    def __init__(self, sink: Sink) -> None:
        self._sink = sink
        self._timelines: Timelines | None = None
        self._waiting: list[tuple[str, Any, int]] = []
        self._series: dict[str, Series] = {}
        self._overview = Overview(sink.stream, OVERVIEW)
        self._surface = Surface(sink.stream, SURFACE)
        self._profile = Profile(sink.stream, PROFILE)
        self._watched = WatchedCharts(sink.stream)
        self._lower_end = LowerEnd(sink.stream, LOWER_END)
        self._log = StatusLog(sink.stream, LOG)
        self._figures = Figures(self._add_curve)
        self._drawn_ns: dict[str, int] = {}
        self._elements_n: NDArray[np.float64] = np.zeros(0)
        self._scale_n = 0.0
        self._show: dict[str, Callable[[Any, int], None]] = {
            "winch/state": self._winch_state,
            "tension_top/band": self._band,
            "tension": self._tension,
            "payload/rigging": self._rigging,
            "payload/odometry": self._odometry,
            "rope/nodes": self._rope_nodes,
            "ropes/nodes": self._further_ropes,
            "rope/vibration": self._vibration,
            "rope/fatigue": self._fatigue,
            "payloads/state": self._payloads,
            "bars/state": self._bars,
            "winch/parts": self._winch_parts,
            "lines/crossings": self._crossings,
            "lines/events": self._line_events,
            "seabed/touchdown": self._touchdown,
            "rope/bend": self._bend,
            "ship/heave": self._heave,
            "ship/odometry": self._heave,
            "sea/elevation": self._elevation,
            "diagnostics": self._diagnostics,
        }
        sink.stream.send_blueprint(layout(Shown(), sink.live))

    def show(self, topic_name: str, message: Any, time_ns: int) -> None:
        """Show a decoded message received (or recorded) at a ROS time; ignore other topics."""
        name = topic_name.removeprefix("/")
        if name == "twin/epoch":
            if self._timelines is None:
                self._begin(message.sec * NANOSECONDS + message.nanosec)
        elif name in self._show:
            self._take(name, message, _stamp_ns(message, time_ns))

    def flush(self) -> None:
        """Pass all pending data to the sink."""
        if self._timelines is None and self._waiting:
            self._begin(min(time_ns for _, _, time_ns in self._waiting))
        for series in self._series.values():
            series.flush()

    def close(self) -> None:
        """Flush and close the sink."""
        self.flush()
        if not self._sink.live:  # in a window it would reset the user's arrangement
            ranges = {
                path: decade_range(series.least, series.most)
                for path, series in self._series.items()
                if series.least <= series.most
            }
            self._arrange(ranges)
        self._sink.close()

    def _arrange(self, ranges: Ranges | None = None) -> None:
        """Update the layout of the window to its current content."""
        sight = self._lower_end.sight
        close = None if sight is None else sight.eye()
        plots = tuple(self._figures.plots)
        charts = self._watched.shown
        upper = self._surface.sight.eye()
        shown = Shown(self._overview.frame, close, upper, plots, ranges or {}, charts)
        self._sink.stream.send_blueprint(layout(shown, self._sink.live))

    def _take(self, name: str, message: Any, time_ns: int) -> None:
        if self._timelines is not None:
            self._show[name](message, time_ns)
            return
        self._waiting.append((name, message, time_ns))
        first_ns = self._waiting[0][2]
        if abs(time_ns - first_ns) > _EPOCH_WITHIN_NS:  # no epoch: begin at the first message
            self._begin(first_ns)

    def _begin(self, epoch_ns: int) -> None:
        self._timelines = Timelines(self._sink.stream, epoch_ns)
        for path, name, rgb in CURVES:
            self._add_curve(path, name, rgb)
        waiting, self._waiting = self._waiting, []
        for name, message, time_ns in waiting:
            self._show[name](message, time_ns)

    def _add_curve(self, path: str, name: str, rgb: str, dots: bool = False) -> Series:
        assert self._timelines is not None
        batch_ns = LIVE_BATCH_NS if self._sink.live else FILE_BATCH_NS
        self._series[path] = series = Series(self._sink.stream, self._timelines, path, batch_ns)
        (series.dots if dots else series.style)(name, rgb)
        return series

    def _is_time(self, what: str, time_ns: int) -> bool:
        """Return whether to draw again; also after a jump back, when a bag restarts."""
        last_ns = self._drawn_ns.get(what)
        due = last_ns is None or not 0 <= time_ns - last_ns < PICTURE_NS
        if due:
            self._drawn_ns[what] = time_ns
            assert self._timelines is not None
            self._timelines.set(time_ns)
        return due

    def _winch_state(self, message: Any, time_ns: int) -> None:
        if len(message.position):
            self._series["plots/line_out"].add(time_ns, float(message.position[0]))
        if len(message.effort):
            self._series["plots/tension/top"].add(time_ns, float(message.effort[0]) / 1000.0)

    def _band(self, message: Any, time_ns: int) -> None:
        for (path, name, rgb), force in zip(BAND_CURVES, message.effort[:2], strict=True):
            if path not in self._series:
                self._add_curve(path, name, rgb)
            self._series[path].add(time_ns, float(force) / 1000.0)

    def _tension(self, message: Any, time_ns: int) -> None:
        self._elements_n = np.asarray(message.data, dtype=np.float64)

    def _rigging(self, message: Any, time_ns: int) -> None:
        position = np.asarray(message.position, dtype=np.float64)
        pulls = np.asarray(message.effort, dtype=np.float64)
        self._lower_end.take_rigging(list(message.name), position, pulls)

    def _odometry(self, message: Any, time_ns: int) -> None:
        place, turn = message.pose.pose.position, message.pose.pose.orientation
        at = np.array([place.x, place.y, place.z])
        self._lower_end.take_pose(at, [turn.x, turn.y, turn.z, turn.w])

    def _rope_nodes(self, message: Any, time_ns: int) -> None:
        rows = _points(message, "rope/nodes", ("x", "y", "z", "tension"))
        if len(rows) < 2:
            return
        self._series["plots/tension/payload"].add(time_ns, float(rows[-1, 3]) / 1000.0)
        if not self._is_time("rope", time_ns):
            return
        position, nodes_n, elements_n = rows[:, :3], rows[:, 3], self._elements_n
        if len(elements_n) != len(rows) - 1:
            elements_n = 0.5 * (nodes_n[1:] + nodes_n[:-1])
        peak_n = float(max(elements_n.max(), nodes_n.max()))
        if peak_n > self._scale_n:
            self._scale_n = scale_above(peak_n)
        moved = (
            self._overview.show(position, elements_n, self._scale_n),
            self._lower_end.show_rope(position, elements_n, self._scale_n),
            self._surface.show_rope(position, elements_n, self._scale_n),
        )
        if any(moved):
            self._arrange()
        self._profile.show(time_ns, -position[:, 2], nodes_n, elements_n, self._scale_n)

    def _further_ropes(self, message: Any, time_ns: int) -> None:
        """Draw all ropes but the first, which is in `rope/nodes`."""
        rows = _points(message, "ropes/nodes", ("x", "y", "z", "tension", "rope"))
        if self._overview.frame is None or not self._is_time("ropes", time_ns):
            return
        for number in range(1, int(rows[:, 4].max(initial=0.0)) + 1):
            own = rows[rows[:, 4] == number]
            elements_n = 0.5 * (own[1:, 3] + own[:-1, 3])
            self._overview.show_further(number, own[:, :3], elements_n, self._scale_n)
            self._surface.show_further(number, own[:, :3], elements_n, self._scale_n)
            if self._lower_end.show_further(number, own[:, :3], elements_n, self._scale_n):
                self._arrange()

    def _vibration(self, message: Any, time_ns: int) -> None:
        fields = tuple(field.name for field in message.fields)
        rows = _points(message, "rope/vibration", fields)
        if len(rows) < 2 or not self._is_time("vibration", time_ns):
            return
        if self._watched.show_vibration(dict(zip(fields, rows.T, strict=True))):
            self._arrange()

    def _fatigue(self, message: Any, time_ns: int) -> None:
        table = np.asarray(message.data, dtype=np.float64).reshape(-1, 3)
        if self._is_time("fatigue", time_ns) and self._watched.show_fatigue(table):
            self._arrange()

    def _payloads(self, message: Any, time_ns: int) -> None:
        self._lower_end.place_payloads(list(message.name), message.position)
        self._overview.payloads = self._lower_end.payloads

    def _bars(self, message: Any, time_ns: int) -> None:
        if self._is_time("bars", time_ns):
            self._lower_end.show_bars(np.asarray(message.position).reshape(-1, 2, 3))

    def _winch_parts(self, message: Any, time_ns: int) -> None:
        if self._figures.winch(time_ns, list(message.name), list(message.position)):
            self._arrange()

    def _crossings(self, message: Any, time_ns: int) -> None:
        """Add curves, and mark the crossings of the lines in the line profile."""
        names, values = list(message.name), list(message.position)
        if self._figures.lines(time_ns, names, values):
            self._arrange()
        if self._is_time("crossings", time_ns):
            found = dict(zip(names, values, strict=True))
            every = [name.removesuffix("/gap_m") for name in names if name.endswith("/gap_m")]
            spots = [[found[f"{k}/x_m"], found[f"{k}/y_m"], -found[f"{k}/depth_m"]] for k in every]
            labels = [f"{-z:.0f} m" for *_, z in spots]
            self._overview.show_spots("crossings", np.array(spots).reshape(-1, 3), labels)

    def _touchdown(self, message: Any, time_ns: int) -> None:
        """Add curves, and mark the touchdown points in the line profile."""
        names, values = list(message.name), list(message.position)
        if self._figures.shape(time_ns, names, values):
            self._arrange()
        if self._is_time("touchdown", time_ns):
            found = dict(zip(names, values, strict=True))
            every = [name.removesuffix("/x_m") for name in names if name.endswith("/x_m")]
            spots = [[found[f"{rope}/{axis}_m"] for axis in "xyz"] for rope in every]
            labels = ["touchdown"] * len(spots)
            self._overview.show_spots("touchdown", np.array(spots).reshape(-1, 3), labels)

    def _bend(self, message: Any, time_ns: int) -> None:
        if self._figures.shape(time_ns, list(message.name), list(message.position)):
            self._arrange()

    def _line_events(self, message: Any, time_ns: int) -> None:
        assert self._timelines is not None
        self._timelines.set(time_ns)
        self._log.write(f"lines: {message.data}")

    def _heave(self, message: Any, time_ns: int) -> None:
        self._series["plots/heave"].add(time_ns, float(message.pose.pose.position.z))

    def _elevation(self, message: Any, time_ns: int) -> None:
        if self._is_time("sea", time_ns):
            self._surface.show_sea(float(message.point.z))

    def _diagnostics(self, message: Any, time_ns: int) -> None:
        """Add a log line for each status that has changed, and the real-time factor."""
        assert self._timelines is not None
        self._timelines.set(time_ns)
        for status in message.status:
            for pair in status.values:
                if pair.key == "real-time factor" and float(pair.value) > 0.0:  # 0: no step yet
                    self._series["plots/real_time_factor"].add(time_ns, float(pair.value))
            self._log.take(status)


def _points(message: Any, topic: str, fields: tuple[str, ...]) -> NDArray[np.float64]:
    """Return the points of a cloud of float32 values, (points, fields)."""
    size = len(fields) * FLOAT32_BYTES
    if message.point_step != size:
        what = f"points of {message.point_step} bytes"
        right = f"expected are {size} bytes: {', '.join(fields)} as float32"
        raise InputError(phrase(f"topic {topic}", what, right))
    rows = np.frombuffer(np.asarray(message.data, dtype=np.uint8).tobytes(), dtype="<f4")
    return rows.reshape(-1, len(fields)).astype(np.float64)


def _stamp_ns(message: Any, time_ns: int) -> int:
    """Return the stamp of a message, or its time of arrival if it has none."""
    header = getattr(message, "header", None)
    if header is None:
        return time_ns
    return header.stamp.sec * NANOSECONDS + header.stamp.nanosec or time_ns
