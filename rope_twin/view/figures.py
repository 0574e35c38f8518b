"""Curves of quantities that come by name: winch components, crossings of two lines, line shape.

Which of them exist depends on the scene, so that plots are created as values arrive, in tabs next
to the plots that every run has.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from rope_twin.view.series import Series


@dataclass(frozen=True)
class Plot:
    """One plot in a tab."""

    tab: str
    entity: str  # all curves below this path are drawn
    title: str


# group, title, factor and curve name of each quantity of a winch's components (twin/hoisting)
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
WINCH_TAB, LINES_TAB, SHAPE_TAB = "Winch", "Lines", "Shape"
_DEPTHS = Plot(LINES_TAB, "plots/lines/crossings", "Elevation of the crossings [m]")
_ANGLES = Plot(LINES_TAB, "plots/lines/angles", "Crossing angle [deg]")
# factor and plot of each quantity of touchdown and bend radius that is drawn
_SHAPE = {
    "layback_m": (1.0, Plot(SHAPE_TAB, "plots/shape/layback", "TDP layback [m]")),
    "tension_n": (1e-3, Plot(SHAPE_TAB, "plots/shape/tension", "Tension at TDP [kN]")),
    "radius_m": (1.0, Plot(SHAPE_TAB, "plots/shape/bend", "Smallest bend radius [m]")),
}
_DISTANCE = Plot(LINES_TAB, "plots/lines/distance", "Minimum distance between the lines [m]")


class Figures:
    """Adds curves as their values arrive; `plots` are those that exist by now."""

    def __init__(self, new_series: Callable[[str, str, str, bool], Series]) -> None:
        """new_series: makes a curve from entity, name, colour, and whether it is of dots."""
        self._new_series = new_series
        self._known: dict[str, Series] = {}
        self.plots: list[Plot] = []

    def winch(self, time_ns: int, names: list[str], values: list[float]) -> bool:
        """Add values with names like winch/drum_radius_m; return whether there is a new plot."""
        before = len(self.plots)
        for name, value in zip(names, values, strict=True):
            winch, _, figure = name.rpartition("/")
            if figure in _UNSHOWN:
                continue
            plain = (figure, figure.replace("_", " "), 1.0, figure)
            group, title, factor, words = _WINCH.get(figure, plain)
            plot = Plot(WINCH_TAB, f"plots/winch/{group}", title)
            self._add(plot, f"{winch}/{words}", f"{words}, {winch}", time_ns, factor * value)
        self.plots.sort(key=lambda plot: _ORDER.get(plot.entity, len(_ORDER)))
        return len(self.plots) > before

    def lines(self, time_ns: int, names: list[str], values: list[float]) -> bool:
        """Add values with names like crossing_1/z; return whether there is a new plot."""
        before = len(self.plots)
        for name, value in zip(names, values, strict=True):
            where, _, figure = name.rpartition("/")
            words = where.replace("_", " ")
            if name == "nearest/distance_m":
                self._add(_DISTANCE, "nearest", "nearest", time_ns, value)
            elif figure == "z" and where != "nearest":
                self._add(_DEPTHS, where, words, time_ns, value, dots=True)
            elif figure == "angle_deg":
                self._add(_ANGLES, where, words, time_ns, value, dots=True)
        return len(self.plots) > before

    def shape(self, time_ns: int, names: list[str], values: list[float]) -> bool:
        """Add values with names like cable/layback_m; return whether there is a new plot."""
        before = len(self.plots)
        for name, value in zip(names, values, strict=True):
            rope, _, figure = name.rpartition("/")
            if figure in _SHAPE and math.isfinite(value):  # a straight rope has no finite radius
                factor, plot = _SHAPE[figure]
                self._add(plot, rope, rope, time_ns, factor * value)
        return len(self.plots) > before

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
