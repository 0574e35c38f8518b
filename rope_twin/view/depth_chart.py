"""Charts of a quantity along the rope, such as VIV response and fatigue damage.

rerun has no plot of one quantity over another, so the axes are drawn here, as in
`rope_twin.view.profile`: a panel is WIDTH wide and HEIGHT high, with the hang-off at its top.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rope_twin.view.canvas import GRID_RGB, HAIR, Canvas
from rope_twin.view.ticks import ticks_over

WIDTH, HEIGHT, GAP = 560.0, 1000.0, 110.0
_HEAD, _LIFT = -95.0, 30.0  # title above the panel; rerun places a label below its point

Values = NDArray[np.float64]


@dataclass(frozen=True)
class Curve:
    """Quantity along the rope; NaN where it is not defined."""

    name: str
    values: Values
    rgb: tuple[int, int, int]


class DepthChart:
    """One panel below `path`; its scales grow with the data and never shrink."""

    def __init__(self, stream: Any, path: str, title: str, place: int) -> None:
        """`place`: number of the panel, from the left."""
        self._canvas, self._title = Canvas(stream, path, flat=True), title
        self._left = place * (WIDTH + GAP)
        self._axes = (0.0, 0.0)

    def show(self, depth_m: Values, curves: list[Curve]) -> None:
        """Draw curves over the length below the hang-off [m]; rope aboard is not drawn."""
        out = depth_m >= 0.0
        known = [curve.values[out & np.isfinite(curve.values)] for curve in curves]
        largest = max((float(values.max(initial=0.0)) for values in known), default=0.0)
        deepest = float(depth_m[out].max(initial=0.0))
        wide, high = self._axes
        if largest > wide or deepest > high:
            wide = float(ticks_over(1.2 * largest, most=4)[-1]) if largest > wide else wide
            high = float(ticks_over(deepest)[-1]) if deepest > high else high
            self._axes = wide, high
            self._draw_axes(curves)
        if not (wide > 0.0 and high > 0.0):
            return
        for curve in curves:
            drawn = out & np.isfinite(curve.values)
            points = self._place(curve.values[drawn] / wide, depth_m[drawn] / high)
            self._canvas.lines(curve.name.replace(" ", "_"), [points], curve.rgb, 2.0)

    def _place(self, across: Values, down: Values) -> Values:
        return np.stack([self._left + across * WIDTH, down * HEIGHT], axis=-1)

    def _draw_axes(self, curves: list[Curve]) -> None:
        wide, high = self._axes
        if not (wide > 0.0 and high > 0.0):
            return
        across, down = ticks_over(wide, most=4), ticks_over(high)
        x, y = self._left + across / wide * WIDTH, down / high * HEIGHT
        grid = [[[at, 0.0], [at, HEIGHT]] for at in x]
        grid += [[[self._left, at], [self._left + WIDTH, at]] for at in y]
        canvas = self._canvas
        canvas.lines("grid", grid, GRID_RGB, HAIR)
        canvas.labels("values", [[at, HEIGHT] for at in x], [f"{value:g}" for value in across])
        if self._left == 0.0:  # the other panels have the same depths, and no space for labels
            canvas.labels("depths", [[-60.0, at - _LIFT] for at in y], [f"{d:g}" for d in down])
        names = ", ".join(curve.name for curve in curves)
        middle = self._left + 0.5 * WIDTH
        canvas.labels("title", [[middle, _HEAD]], [f"{self._title}: {names}"])


VIBRATION, FATIGUE, BENDS = "vibration", "fatigue", "bends"
CROSS_FLOW_RGB, IN_LINE_RGB = (253, 231, 37), (53, 183, 160)
DRAG_RGB, USED_RGB = (111, 168, 255), (242, 106, 90)


class WatchedCharts:
    """Draws the charts; `shown` are those that have data."""

    def __init__(self, stream: Any) -> None:
        self.shown: tuple[str, ...] = ()
        self._amplitude = DepthChart(stream, f"{VIBRATION}/amplitude", "A/D [-]", 0)
        self._frequency = DepthChart(stream, f"{VIBRATION}/frequency", "frequency [Hz]", 1)
        self._drag = DepthChart(stream, f"{VIBRATION}/drag", "drag [-]", 2)
        self._used = DepthChart(stream, FATIGUE, "damage [-]", 0)
        self._bends = DepthChart(stream, f"{BENDS}/count", "bends [-]", 0)
        self._bent = DepthChart(stream, f"{BENDS}/damage", "bending [-]", 1)

    def show_vibration(self, columns: dict[str, NDArray[np.float64]]) -> bool:
        """Draw the columns of `ropes/vibration` of the first rope; return whether it is new."""
        first = columns["rope"] == columns["rope"][0]
        columns = {name: column[first] for name, column in columns.items()}
        place = np.stack([columns[axis] for axis in "xyz"])
        steps = np.sqrt((np.diff(place, axis=1) ** 2).sum(axis=0))
        depth = np.concatenate([[0.0], np.cumsum(steps)])
        amplitude = [Curve("cross-flow", columns["cross_flow"], CROSS_FLOW_RGB)]
        frequency = [Curve("cross-flow", _moving(columns["cross_flow_hz"]), CROSS_FLOW_RGB)]
        if "in_line" in columns:
            amplitude.append(Curve("in-line", columns["in_line"], IN_LINE_RGB))
            frequency.append(Curve("in-line", _moving(columns["in_line_hz"]), IN_LINE_RGB))
        self._amplitude.show(depth, amplitude)
        self._frequency.show(depth, frequency)
        self._drag.show(depth, [Curve("amplification", columns["drag_amplification"], DRAG_RGB)])
        return self._is_first(VIBRATION)

    def show_fatigue(
        self, from_hang_off_m: NDArray[np.float64], damage: NDArray[np.float64]
    ) -> bool:
        """Draw the damage of each metre of rope; return whether it is the first."""
        self._used.show(from_hang_off_m, [Curve("per metre of rope", damage, USED_RGB)])
        return self._is_first(FATIGUE)

    def show_bends(self, columns: dict[str, NDArray[np.float64]]) -> bool:
        """Draw the bends of the first rope from the upper end of its material down.

        Nothing is drawn of a rope that runs over nothing. Return whether it is the first.
        """
        if not np.isfinite(columns["bends"]).any():
            return False
        material = columns["from_lower_end_m"]
        down = material.max() - material
        self._bends.show(down, [Curve("per metre of rope", columns["bends"], USED_RGB)])
        worn = [
            Curve("damage", columns["bend_damage"], USED_RGB),
            Curve("of discard value", columns["discard_fraction"], DRAG_RGB),
        ]
        self._bent.show(down, worn)
        return self._is_first(BENDS)

    def _is_first(self, name: str) -> bool:
        first = name not in self.shown
        if first:
            self.shown = (*self.shown, name)
        return first


def _moving(hz: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the frequencies, NaN where there is no vibration."""
    return np.where(hz > 0.0, hz, np.nan)
