"""Time histories and texts of the view on its two timelines, simulation time and ROS time.

Samples are passed to rerun in batches, so that every one is kept. Which quantities of winch
components, of the crossing of two lines and of the line's shape exist depends on the scene: their
plots are created as values arrive, in tabs next to the plots that every run has.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

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
