"""Display of decoded messages in rerun, the same for live topics and for bags.

A truncated bag is played up to the break.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rope_twin import messages
from rope_twin.errors import BagError, InputError
from rope_twin.messages.templates import NANOSECONDS, nanoseconds, read_cloud, scale_above, xyz
from rope_twin.recording.bag import find_bag
from rope_twin.recording.mcap_scan import mcap_files, topic_messages
from rope_twin.topics import TOPICS
from rope_twin.view.charts import Profile, Values, WatchedCharts, decade_range
from rope_twin.view.overview import LowerEnd, Overview, Surface
from rope_twin.view.series import (
    AHEAD_CURVES,
    AHEAD_EVERY_S,
    AHEAD_S,
    CURVES,
    FILE_BATCH_NS,
    INTERVAL_CURVES,
    LIVE_BATCH_NS,
    LOG,
    LOWER_END,
    OVERVIEW,
    PROFILE,
    SURFACE,
    AvailableContent,
    Cells,
    Figures,
    Ranges,
    Series,
    StatusLog,
    Timelines,
    layout,
)
from rope_twin.view.sinks import Sink

SHOWN_TOPICS = tuple(topic.name for topic in TOPICS if topic.in_view)
PICTURE_NS = NANOSECONDS // 10  # ropes and sea are drawn at most 10 times a second
_EPOCH_WITHIN_NS = 2 * NANOSECONDS  # how long the first messages are held until twin/epoch comes


class RopeView:
    """Shows the suite's messages; to be used from one thread only.

    Every scalar is kept; ropes are drawn at most 10 times per second.
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
        self._elements: NDArray[Any] = np.zeros(0, [("tension_n", "f8"), ("rope", "f4")])
        self._scale_n = 0.0
        self._show: dict[str, Callable[[Any, int], None]] = {
            "ropes/tension_top": self._curve("plots/tension/top", lambda m: m.effort[0] / 1000.0),
            "ropes/tension_bottom": self._curve(
                "plots/tension/payload", lambda m: m.effort[0] / 1000.0
            ),
            "ropes/length": self._curve("plots/line_out", lambda m: m.position[0]),
            "ropes/tension_top_error": self._tension_top_error,
            "ropes/element_tension": self._element_tension,
            "ropes/nodes": self._nodes,
            "ropes/vibration": self._vibration,
            "ropes/fatigue": self._fatigue,
            "ropes/bend_radius": partial(self._numbers, self._figures.shape),
            "payloads/state": self._payloads,
            "payloads/body": self._body,
            "slings/state": self._slings,
            "struts/state": self._struts,
            "winch/state": partial(self._numbers, self._figures.winch),
            "residuals": self._residuals,
            "forecast/tension": self._forecast,
            "twin/quality": partial(self._numbers, self._figures.quality),
            "lines/crossings": self._crossings,
            "lines/events": self._line_events,
            "seabed/touchdown": self._touchdown,
            "ship/heave": self._curve("plots/heave", lambda m: m.pose.pose.position.z),
            "ship/odometry": self._curve("plots/heave", lambda m: m.pose.pose.position.z),
            "sea/elevation": self._elevation,
            "diagnostics": self._diagnostics,
        }
        sink.stream.send_blueprint(layout(AvailableContent(), sink.live))

    def show(self, topic_name: str, message: Any, time_ns: int) -> None:
        """Show a decoded message received (or recorded) at a ROS time; ignore other topics."""
        name = topic_name.removeprefix("/")
        if name == "twin/epoch":
            if self._timelines is None:
                self._begin(nanoseconds(message))
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
            spans = {path: (one.least, one.most) for path, one in self._series.items()}
            known = {path: span for path, span in spans.items() if span[0] <= span[1]}
            self._arrange({path: decade_range(*span) for path, span in known.items()})
        self._sink.close()

    def _arrange(self, ranges: Ranges | None = None) -> None:
        """Update the layout of the window to its current content."""
        sight = self._lower_end.sight
        close = None if sight is None else sight.eye()
        plots = tuple(self._figures.plots)
        charts = self._watched.shown
        upper = self._surface.sight.eye()
        shown = AvailableContent(self._overview.frame, close, upper, plots, ranges or {}, charts)
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

    def _is_time(self, topic: str, time_ns: int) -> bool:
        """Return whether to draw again; also after a jump back, when a bag restarts."""
        last_ns = self._drawn_ns.get(topic)
        due = last_ns is None or not 0 <= time_ns - last_ns < PICTURE_NS
        if due:
            self._drawn_ns[topic] = time_ns
            assert self._timelines is not None
            self._timelines.set(time_ns)
        return due

    def _curve(self, path: str, value: Callable[[Any], Any]) -> Callable[[Any, int], None]:
        """Return what adds a value of each message to a curve."""
        return lambda message, time_ns: self._series[path].add(time_ns, float(value(message)))

    def _tension_top_error(self, message: Any, time_ns: int) -> None:
        """Add the interval of the first rope, if the run computes it."""
        first = read_cloud(message)[0]
        edges = float(first["lower_n"]), float(first["upper_n"])
        if not all(math.isfinite(edge) for edge in edges):
            return
        self._add_band(INTERVAL_CURVES, time_ns, edges)

    def _forecast(self, message: Any, time_ns: int) -> None:
        """Add the band AHEAD_S before its time, ahead of the curve of the tension."""
        for row in read_cloud(message):
            lead = row["lead_s"]
            if not AHEAD_S - AHEAD_EVERY_S < lead <= AHEAD_S:
                continue
            edges = float(row["top_tension_5_n"]), float(row["top_tension_95_n"])
            self._add_band(AHEAD_CURVES, time_ns + round(float(lead) * NANOSECONDS), edges)

    def _add_band(
        self, curves: Sequence[tuple[str, str, str]], time_ns: int, edges_n: tuple[float, float]
    ) -> None:
        """Add both edges of a band of the top tension [N] to their curves, made as they come."""
        for (path, name, rgb), edge_n in zip(curves, edges_n, strict=True):
            if path not in self._series:
                self._add_curve(path, name, rgb)
            self._series[path].add(time_ns, edge_n / 1000.0)

    def _element_tension(self, message: Any, time_ns: int) -> None:
        self._elements = read_cloud(message)

    def _nodes(self, message: Any, time_ns: int) -> None:
        """Draw all ropes; the first has the profile too."""
        nodes = read_cloud(message)
        if len(nodes) < 2 or not self._is_time("ropes", time_ns):
            return
        moved = False
        for number in range(int(nodes["rope"].max()) + 1):
            rope_nodes = nodes[nodes["rope"] == number]
            position = np.stack([rope_nodes[axis] for axis in "xyz"], axis=1).astype(np.float64)
            nodes_n = rope_nodes["tension_n"].astype(np.float64)
            elements_n = self._elements["tension_n"][self._elements["rope"] == number]
            if len(elements_n) != len(rope_nodes) - 1:
                elements_n = 0.5 * (nodes_n[1:] + nodes_n[:-1])
            if number == 0:
                moved |= self._draw_first(time_ns, position, nodes_n, elements_n)
                continue
            self._overview.show_further(number, position, elements_n, self._scale_n)
            self._surface.show_further(number, position, elements_n, self._scale_n)
            moved |= self._lower_end.show_further(number, position, elements_n, self._scale_n)
        if moved:
            self._arrange()

    def _draw_first(
        self, time_ns: int, position: Values, nodes_n: Values, elements_n: Values
    ) -> bool:
        """Draw the first rope; return whether a camera has to move."""
        peak_n = float(max(elements_n.max(), nodes_n.max()))
        if peak_n > self._scale_n:
            self._scale_n = scale_above(peak_n)
        moved = (
            self._overview.show(position, elements_n, self._scale_n),
            self._lower_end.show_rope(position, elements_n, self._scale_n),
            self._surface.show_rope(position, elements_n, self._scale_n),
        )
        self._profile.show(time_ns, -position[:, 2], nodes_n, elements_n, self._scale_n)
        return any(moved)

    def _vibration(self, message: Any, time_ns: int) -> None:
        nodes = read_cloud(message)
        if len(nodes) < 2 or not self._is_time("vibration", time_ns):
            return
        columns = {name: nodes[name].astype(np.float64) for name in nodes.dtype.names or ()}
        if self._watched.show_vibration(columns):
            self._arrange()

    def _fatigue(self, message: Any, time_ns: int) -> None:
        table = read_cloud(message)
        table = table[table["rope"] == 0.0]  # the first rope
        if not self._is_time("fatigue", time_ns):
            return
        new = self._watched.show_fatigue(table["from_hang_off_m"], table["damage"])
        if "bends" in (table.dtype.names or ()):  # bags of earlier versions have none
            new |= self._watched.show_bends({name: table[name] for name in table.dtype.names})
        if new:
            self._arrange()

    def _payloads(self, message: Any, time_ns: int) -> None:
        poses = {}
        for name, pose in zip(message.joint_names, message.transforms, strict=True):
            turn = pose.rotation
            poses[name] = np.array(xyz(pose.translation)), [*xyz(turn), turn.w]
        self._lower_end.take_poses(poses)
        self._overview.payloads = self._lower_end.payloads

    def _body(self, message: Any, time_ns: int) -> None:
        row = read_cloud(message)[0]
        size_m = np.array([row[f"size_{axis}_m"] for axis in "xyz"])
        self._lower_end.take_body(row["name"].decode(), size_m)

    def _slings(self, message: Any, time_ns: int) -> None:
        rows = read_cloud(message)
        ends = np.stack([rows[axis] for axis in "xyz"], axis=1)
        self._lower_end.take_slings(ends, rows["tension_n"])

    def _struts(self, message: Any, time_ns: int) -> None:
        if self._is_time("struts", time_ns):
            rows = read_cloud(message)
            ends = [[rows[f"{end}_{axis}"] for axis in "xyz"] for end in ("from", "to")]
            self._lower_end.show_bars(np.moveaxis(np.array(ends), 2, 0))

    def _plot(self, add: Callable[[int, Any], None], time_ns: int, values: Any) -> None:
        """Add values to curves; there is room to be made for a new plot."""
        known = len(self._figures.plots)
        add(time_ns, values)
        if len(self._figures.plots) > known:
            self._arrange()

    def _numbers(self, add: Callable[[int, Cells], None], message: Any, time_ns: int) -> None:
        """Add curves of all numbers of a table."""
        self._plot(add, time_ns, _cells(message))

    def _crossings(self, message: Any, time_ns: int) -> None:
        """Add curves, and mark the crossings of the lines in the line profile."""
        self._numbers(self._figures.lines, message, time_ns)
        if self._is_time("crossings", time_ns):
            rows = read_cloud(message)[1:]  # the first is where they are nearest
            spots = np.stack([rows[axis] for axis in "xyz"], axis=1)
            self._overview.show_spots("crossings", spots, [f"{-z:.0f} m" for z in rows["z"]])

    def _touchdown(self, message: Any, time_ns: int) -> None:
        """Add curves, and mark the touchdown points in the line profile."""
        self._numbers(self._figures.shape, message, time_ns)
        if self._is_time("touchdown", time_ns):
            rows = read_cloud(message)
            spots = np.stack([rows[axis] for axis in "xyz"], axis=1)
            self._overview.show_spots("touchdown", spots, ["touchdown"] * len(rows))

    def _residuals(self, message: Any, time_ns: int) -> None:
        self._plot(self._figures.residuals, time_ns, read_cloud(message))

    def _line_events(self, message: Any, time_ns: int) -> None:
        assert self._timelines is not None
        self._timelines.set(time_ns)
        self._log.write(f"lines: {message.data}")

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


def _cells(message: Any) -> list[tuple[str, str, float]]:
    """Return row, column and value, such as main, layback_m, 120.0, of all numbers of a table."""
    rows = read_cloud(message)
    cells = [
        (row["name"].decode(), column, float(row[column]))
        for row in rows
        for column in (rows.dtype.names or ())[1:]
    ]
    return [cell for cell in cells if not math.isnan(cell[2])]


def _stamp_ns(message: Any, time_ns: int) -> int:
    """Return the stamp of a message, or its time of arrival if it has none."""
    header = getattr(message, "header", None)
    return (0 if header is None else nanoseconds(header.stamp)) or time_ns


@dataclass
class PlaybackResult:
    """Result of a playback."""

    shown: int = 0
    start_ns: int | None = None  # epoch, or time of the first message if the bag has no epoch
    end_ns: int = 0
    problems: list[str] = field(default_factory=list)  # one sentence each

    @property
    def duration_s(self) -> float:
        """Return the time from the start to the last message shown [s]."""
        return 0.0 if self.start_ns is None else (self.end_ns - self.start_ns) / NANOSECONDS


def play(
    bag: str | os.PathLike[str], view: RopeView, until_s: float | None = None
) -> PlaybackResult:
    """Show a bag's messages up to `until_s` after the start of the simulation.

    Raises:
        BagError: no such bag, not MCAP, or it has no topic that the view shows.
        InputError: the bag ends before `until_s`.
    """
    path = find_bag(os.fspath(bag))
    played = PlaybackResult()
    undecoded: dict[str, int] = {}
    ended = False
    files = mcap_files(path)
    if not files or any(file.suffix != ".mcap" for file in files):
        raise BagError(f"bag {path}", "it holds no .mcap file", "record with MCAP storage")
    for name, stored in topic_messages(files, SHOWN_TOPICS, played.problems):
        try:
            message = messages.decode(name, stored.data)
            if name == "twin/epoch" and not played.shown:
                played.start_ns = nanoseconds(message)
            elif played.start_ns is None:
                played.start_ns = stored.log_ns
            assert played.start_ns is not None
            if until_s is not None and stored.log_ns > played.start_ns + until_s * NANOSECONDS:
                ended = True
                break
            view.show(name, message, stored.log_ns)
        except InputError as error:
            undecoded[str(error)] = undecoded.get(str(error), 0) + 1
            continue
        played.shown += 1
        played.end_ns = max(played.end_ns, stored.log_ns)
    played.problems += [f"{count} × {reason}" for reason, count in undecoded.items()]
    if not played.shown:
        problem = "no topic to show" + "".join(f"; {reason}" for reason in played.problems)
        raise BagError(f"bag {path}", problem, f"name a bag with {', '.join(SHOWN_TOPICS)}")
    if until_s is not None and not ended and played.duration_s < until_s - 0.5:
        problem = f"{until_s:g} s is after its end"
        raise InputError(f"bag {path}", problem, f"it lasts {played.duration_s:.1f} s")
    return played
