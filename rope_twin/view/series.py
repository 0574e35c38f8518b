"""Time histories and texts of the view on simulation time and ROS time, and the viewer's layout.

Samples are passed to rerun in batches, so that every one is kept. Which quantities of winch
components, of the crossing of two lines and of the line's shape exist depends on the scene: their
plots are created as values arrive, in tabs next to the plots that every run has.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rope_twin.view import overview
from rope_twin.view.charts import (
    BENDS,
    FATIGUE,
    GAP,
    HEIGHT,
    PROFILE_WIDTH,
    RANGE_S,
    VIBRATION,
    WIDTH,
)

TWIN_TIME = "twin_time"  # a duration: 0 at the start of the simulation
ROS_TIME = "ros_time"  # a date


class Timelines:
    """Sets rerun's two timelines to a ROS time."""

    def __init__(self, stream: Any, epoch_ns: int) -> None:
        self._stream = stream
        self.epoch_ns = epoch_ns

    def set(self, time_ns: int) -> None:
        """Set the ROS time of whatever this thread logs next."""
        elapsed = np.timedelta64(time_ns - self.epoch_ns, "ns")
        self._stream.set_time(TWIN_TIME, duration=elapsed)
        self._stream.set_time(ROS_TIME, timestamp=np.datetime64(time_ns, "ns"))

    def columns(self, times_ns: NDArray[np.int64]) -> list[Any]:
        """Return the timelines of a batch of samples (n,)."""
        import rerun as rr

        elapsed = (times_ns - self.epoch_ns).astype("timedelta64[ns]")
        return [
            rr.TimeColumn(TWIN_TIME, duration=elapsed),
            rr.TimeColumn(ROS_TIME, timestamp=times_ns.astype("datetime64[ns]")),
        ]


LIVE_BATCH_NS = 200_000_000  # 5 calls per second and curve, whatever the rate of its topic
FILE_BATCH_NS = 5_000_000_000  # few large batches: small files that open quickly


class Series:
    """One curve of a plot."""

    def __init__(self, stream: Any, timelines: Timelines, path: str, batch_ns: int) -> None:
        import rerun as rr

        self._stream = stream
        self._timelines = timelines
        self._path = path
        self._batch_ns = batch_ns
        self.least, self.most = math.inf, -math.inf  # of all finite samples
        self._columns = rr.Scalars.columns
        self._times: list[int] = []
        self._values: list[float] = []

    def add(self, time_ns: int, value: float) -> None:
        """Add a sample at a ROS time."""
        self._times.append(time_ns)
        self._values.append(value)
        if math.isfinite(value):
            self.least, self.most = min(self.least, value), max(self.most, value)
        if abs(time_ns - self._times[0]) >= self._batch_ns:
            self.flush()

    def style(self, name: str, rgb: str) -> None:
        """Set name and colour (six hexadecimal digits) of the curve."""
        import rerun as rr

        line = rr.SeriesLines(names=name, colors=int(rgb + "ff", 16), widths=1.5)
        self._stream.log(self._path, line, static=True)

    def dots(self, name: str, rgb: str) -> None:
        """Draw the curve as dots with this name and colour: samples with gaps are not joined."""
        import rerun as rr

        dots = rr.SeriesPoints(names=name, colors=int(rgb + "ff", 16), marker_sizes=2.5)
        self._stream.log(self._path, dots, static=True)

    def flush(self) -> None:
        """Pass the pending samples to rerun."""
        if not self._times:
            return
        self._stream.send_columns(
            self._path,
            indexes=self._timelines.columns(np.array(self._times, dtype=np.int64)),
            columns=self._columns(scalars=self._values),
        )
        self._times.clear()
        self._values.clear()


@dataclass(frozen=True)
class Plot:
    """One plot in a tab."""

    tab: str
    entity: str  # all curves below this path are drawn
    title: str


# group, title, factor and curve name of each quantity of a winch's components (twin/winch)
_WINCH = {
    "drum_speed_rad_per_s": ("drum_speed", "Drum speed [rad/s], positive = pay out", 1.0, "drum"),
    "motor_torque_n_m": ("torque", "Motor and brake torque [kN·m]", 1e-3, "motor"),
    "brake_torque_n_m": ("torque", "Motor and brake torque [kN·m]", 1e-3, "brake"),
    "compensation_m": ("stroke", "AHC stroke [m]", 1.0, "stroke"),
    "compensation_m_per_s": ("stroke_rate", "AHC rate [m/s]", 1.0, "rate"),
    "drum_radius_m": ("radius", "Effective drum radius [m]", 1.0, "radius"),
    "layer": ("layer", "Drum layer [-]", 1.0, "layer"),
    "brake_holds": ("switches", "Brake set, AHC on [-]", 1.0, "brake"),
    "compensation_on": ("switches", "Brake set, AHC on [-]", 1.0, "AHC"),
}
_ORDER = {f"plots/winch/{row[0]}": k for k, row in enumerate(_WINCH.values())}
_UNSHOWN = ("target",)  # its unit depends on the control mode; winch/mode states it
_COLOURS = ("fde725", "6fa8ff", "35b7a0", "f2a65a", "c792ea", "e06c75")
WINCH_TAB, LINES_TAB, SHAPE_TAB, MEASURED_TAB = "Winch", "Lines", "Shape", "Measured"
QUALITY_TAB = "Quality"
_DEPTHS = Plot(LINES_TAB, "plots/lines/crossings", "Elevation of the crossings [m]")
_ANGLES = Plot(LINES_TAB, "plots/lines/angles", "Crossing angle [deg]")
# factor and plot of each quantity of touchdown and bend radius that is drawn
_SHAPE = {
    "layback_m": (1.0, Plot(SHAPE_TAB, "plots/shape/layback", "TDP layback [m]")),
    "tension_n": (1e-3, Plot(SHAPE_TAB, "plots/shape/tension", "Tension at TDP [kN]")),
    "radius_m": (1.0, Plot(SHAPE_TAB, "plots/shape/bend", "Smallest bend radius [m]")),
}
# factor, and plots of measured beside computed values and of their residual, by quantity
_MEASURED = {
    quantity: (
        factor,
        Plot(MEASURED_TAB, f"plots/measured/{path}", f"{title}, measured and computed [{unit}]"),
        Plot(MEASURED_TAB, f"plots/residual/{path}", f"{title}, measured less computed [{unit}]"),
    )
    for quantity, factor, path, title, unit in (
        ("top_tension_n", 1e-3, "tension", "Top tension", "kN"),
        ("line_out_m", 1.0, "line_out", "Line out", "m"),
        ("payload_depth_m", 1.0, "depth", "Payload depth", "m"),
    )
}
_QUALITY = Plot(QUALITY_TAB, "plots/quality", "Quality index [-]")
_DISTANCE = Plot(LINES_TAB, "plots/lines/distance", "Minimum distance between the lines [m]")
Cells = Iterable[tuple[str, str, float]]  # row, column and value of a table


class Figures:
    """Adds curves as their values arrive; `plots` are those that exist by now."""

    def __init__(self, new_series: Callable[[str, str, str, bool], Series]) -> None:
        """new_series: makes a curve from entity, name, colour, and whether it is of dots."""
        self._new_series = new_series
        self._known: dict[str, Series] = {}
        self._read_ns: dict[tuple[str, str], int] = {}  # of the newest reading drawn
        self.plots: list[Plot] = []

    def winch(self, time_ns: int, cells: Cells) -> None:
        """Add values of winch components."""
        for winch, figure, value in cells:
            if figure in _UNSHOWN:
                continue
            usual = (figure, figure.replace("_", " "), 1.0, figure)
            group, title, factor, label = _WINCH.get(figure, usual)
            plot = Plot(WINCH_TAB, f"plots/winch/{group}", title)
            self._add(plot, f"{winch}/{label}", f"{label}, {winch}", time_ns, factor * value)
        self.plots.sort(key=lambda plot: _ORDER.get(plot.entity, len(_ORDER)))

    def lines(self, time_ns: int, cells: Cells) -> None:
        """Add values of crossings and of the nearest points."""
        for where, figure, value in cells:
            label = where.replace("_", " ")
            if (where, figure) == ("nearest", "distance_m"):
                self._add(_DISTANCE, "nearest", "nearest", time_ns, value)
            elif figure == "z" and where != "nearest":
                self._add(_DEPTHS, where, label, time_ns, value, dots=True)
            elif figure == "angle_deg":
                self._add(_ANGLES, where, label, time_ns, value, dots=True)

    def shape(self, time_ns: int, cells: Cells) -> None:
        """Add touchdown and bend radius of ropes."""
        for rope, figure, value in cells:
            if figure in _SHAPE and math.isfinite(value):  # a straight rope has no finite radius
                factor, plot = _SHAPE[figure]
                self._add(plot, rope, rope, time_ns, factor * value)

    def residuals(self, time_ns: int, rows: NDArray[Any]) -> None:
        """Add rows of `residuals` at the times of the readings.

        Measured values are dots beside the computed curve; the residual has its interval.
        """
        for row in rows:
            quantity, _, name = row["name"].decode().partition(" ")
            if quantity not in _MEASURED:
                continue
            factor, both, less = _MEASURED[quantity]
            at_ns = time_ns - round(float(row["age_s"]) * 1e9)
            if abs(self._read_ns.get((quantity, name), 0) - at_ns) < 1000:
                continue  # no new reading since the last message
            self._read_ns[quantity, name] = at_ns
            curves = [(both, "computed", False), (both, "measured", True), (less, "residual", True)]
            curves += [(less, "lower", False), (less, "upper", False)]
            for plot, column, dots in curves:
                if math.isfinite(value := float(row[column])):
                    curve, label = f"{name}/{column}", f"{column}, {name}"
                    self._add(plot, curve, label, at_ns, factor * value, dots=dots)

    def quality(self, time_ns: int, cells: Cells) -> None:
        """Add the quality index of each element."""
        for element, figure, value in cells:
            if figure == "index":
                self._add(_QUALITY, element, element.replace("_", " "), time_ns, value)

    def _add(
        self, plot: Plot, curve: str, name: str, time_ns: int, value: float, *, dots: bool = False
    ) -> None:
        path = f"{plot.entity}/{curve}"
        if path not in self._known:
            if plot not in self.plots:
                self.plots.append(plot)
            of_plot = [known for known in self._known if known.startswith(f"{plot.entity}/")]
            colour = _COLOURS[len(of_plot) % len(_COLOURS)]
            self._known[path] = self._new_series(path, name, colour, dots)
        self._known[path].add(time_ns, value)


_LEVELS = ("INFO", "WARN", "ERROR")


class StatusLog:
    """Log at one path of a recording, at the current time of its stream."""

    def __init__(self, stream: Any, path: str) -> None:
        self._stream, self._path = stream, path
        self._logged: dict[str, tuple[int, str]] = {}

    def write(self, text: str, level: str = "INFO") -> None:
        """Write a line."""
        import rerun as rr

        self._stream.log(self._path, rr.TextLog(text, level=level))

    def take(self, status: Any) -> None:
        """Write a line for a decoded DiagnosticStatus if its level or its message has changed."""
        level = status.level[0] if isinstance(status.level, bytes) else int(status.level)
        if self._logged.get(status.name) != (level, status.message):
            self._logged[status.name] = (level, status.message)
            self.write(f"{status.name}: {status.message}", _LEVELS[min(level, 2)])


BACKGROUND = (18, 19, 24)
OVERVIEW, SURFACE, PROFILE, LOG = "overview", "surface", "profile", "diagnostics"
LOWER_END = "lower_end"
# entity, name and colour of each curve
CURVES = (
    ("plots/tension/top", "top", "fde725"),
    ("plots/tension/payload", "payload", "35b7a0"),
    ("plots/heave", "ship heave", "6fa8ff"),
    ("plots/line_out", "line out", "f2a65a"),
    ("plots/real_time_factor", "real-time factor", "c0c0c8"),
)
# error interval of the top tension, only if a run computes one
INTERVAL_CURVES = (
    ("plots/tension/top/low", "lower bound (95 %)", "8d8432"),
    ("plots/tension/top/high", "upper bound (95 %)", "8d8432"),
)
# band of the top tension that was forecast AHEAD_S before, only if a run forecasts
AHEAD_CURVES = (
    ("plots/tension/top/ahead_low", "forecast 10 s ahead, 5 %", "3f8f6b"),
    ("plots/tension/top/ahead_high", "forecast 10 s ahead, 95 %", "3f8f6b"),
)
AHEAD_S, AHEAD_EVERY_S = 10.0, 1.0  # lead that is drawn, and the interval of forecasts
# entity, title and share of the height of each plot
_PLOTS = (
    ("plots/tension/top", "Top tension [kN]", 4),
    ("plots/tension/payload", "Payload tension [kN]", 3),
    ("plots/heave", "Ship heave [m]", 3),
    ("plots/line_out", "Line out [m]", 3),
    ("plots/real_time_factor", "Real-time factor [-]", 3),
)


# entity, title and number of panels of the charts of VIV response and fatigue
_CHARTS = {
    VIBRATION: (VIBRATION, "VIV response vs length below the hang-off [m]", 3),
    FATIGUE: (FATIGUE, "Fatigue damage vs length below the hang-off [m]", 1),
    BENDS: (BENDS, "Bends vs length from the upper end of all rope [m]", 2),
}
LIVE_S = 120.0  # time span of the plots of a live window
Ranges = Mapping[str, tuple[float, float]]
Camera = tuple[list[float], list[float]]  # position and target


@dataclass(frozen=True)
class AvailableContent:
    """Content that is available for display."""

    frame: overview.Frame | None = None  # of the line profile
    close: Camera | None = None  # of the lower end
    upper: Camera | None = None  # of hang-off and sea surface
    plots: tuple[Plot, ...] = ()  # in addition to those that every run has
    ranges: Ranges = field(default_factory=dict)  # axis range by entity; others fit their data
    charts: tuple[str, ...] = ()  # which of VIBRATION, FATIGUE and BENDS have data


def layout(shown: AvailableContent, live: bool) -> Any:
    """Return the blueprint; live: plots span LIVE_S instead of the whole run."""
    import rerun.blueprint as rrb

    camera = None if shown.frame is None else overview.eye(shown.frame)
    left_column = rrb.Vertical(
        _space(OVERVIEW, _profile_title(shown.frame), camera),
        _space(LOWER_END, "Lower end (to scale)", shown.close),
        row_shares=[5, 3],
    )
    upper = shown.upper or overview.SurfaceView().eye()
    below: Any = _space(SURFACE, "Hang-off and sea surface (to scale)", upper)
    if shown.charts:
        charts = (_CHARTS[name] for name in shown.charts)
        below = rrb.Tabs(*(_chart(*chart) for chart in charts), below, active_tab=0)
    title = f"Tension [kN] vs depth [m]; thin lines: min/max of last {RANGE_S:g} s"
    sides, heights = (-0.12 * PROFILE_WIDTH, 1.04 * PROFILE_WIDTH), (-0.05 * HEIGHT, 1.15 * HEIGHT)
    middle = rrb.Vertical(_plane(PROFILE, title, sides, heights), below, row_shares=[5, 4])
    return rrb.Blueprint(
        rrb.Horizontal(left_column, middle, _right(shown, live), column_shares=[23, 34, 43]),
        rrb.TopPanel(state="hidden"),
        rrb.BlueprintPanel(state="hidden"),
        rrb.SelectionPanel(state="hidden"),
        rrb.TimePanel(state="collapsed", timeline=TWIN_TIME, play_state="following"),
        auto_views=False,
        auto_layout=False,
    )


def _chart(entity: str, title: str, panels: int) -> Any:
    """Return the panels of a depth chart, side by side."""
    wide = panels * (WIDTH + GAP)
    heights = (-180.0, 1.12 * HEIGHT)
    return _plane(entity, title, (-GAP, wide), heights)


def _plane(entity: str, title: str, x: tuple[float, float], y: tuple[float, float]) -> Any:
    """Return a view in two dimensions of these ranges."""
    import rerun.blueprint as rrb

    bounds = rrb.VisualBounds2D(x_range=x, y_range=y)
    return rrb.Spatial2DView(origin=entity, name=title, background=BACKGROUND, visual_bounds=bounds)


def _space(entity: str, title: str, camera: Camera | None) -> Any:
    """Return a view in three dimensions, from a camera if there is one."""
    import rerun.blueprint as rrb

    eye = None
    if camera is not None:
        eye = rrb.EyeControls3D(position=camera[0], look_target=camera[1], eye_up=(0.0, 0.0, 1.0))
    return rrb.Spatial3DView(
        origin=entity, name=title, background=BACKGROUND, line_grid=False, eye_controls=eye
    )


def _profile_title(frame: overview.Frame | None) -> str:
    if frame is None:
        return "Line profile"
    scale = f"horizontal scale ×{frame.factor}" if frame.factor > 1 else "to scale"
    return f"Line profile ({scale})"


def _right(shown: AvailableContent, live: bool) -> Any:
    """Return the plots that every run has, and in tabs those of quantities that came by name."""
    import rerun.blueprint as rrb

    ranges = shown.ranges
    *plots, speed = [_plot(entity, title, live, ranges.get(entity)) for entity, title, _ in _PLOTS]
    last = rrb.Tabs(speed, rrb.TextLogView(origin=LOG, name="Diagnostics"), active_tab=0)
    shares = [share for _, _, share in _PLOTS]
    usual = rrb.Vertical(*plots, last, row_shares=shares, name="Lift")
    tabs = list(dict.fromkeys(plot.tab for plot in shown.plots))
    if not tabs:
        return usual
    further = []
    for tab in tabs:
        of_tab = [plot for plot in shown.plots if plot.tab == tab]
        views = (_plot(plot.entity, plot.title, live, None, legend=True) for plot in of_tab)
        further.append(rrb.Vertical(*views, name=tab))
    return rrb.Tabs(usual, *further, active_tab=0)


def _plot(
    entity: str, title: str, live: bool, span: tuple[float, float] | None, *, legend: bool = False
) -> Any:
    import rerun as rr
    import rerun.blueprint as rrb

    ago = rrb.TimeRangeBoundary.cursor_relative
    start = ago(seconds=-LIVE_S) if live else rrb.TimeRangeBoundary.infinite()
    shown = rrb.VisibleTimeRange(TWIN_TIME, start=start, end=ago())
    return rrb.TimeSeriesView(
        origin=entity,
        name=title,
        plot_legend=rrb.PlotLegend(visible=legend),
        time_ranges=shown,
        axis_y=rrb.ScalarAxis(range=span) if span else None,
        axis_x=rrb.TimeAxis(view_range=rr.TimeRange(start=start, end=ago())),
    )
