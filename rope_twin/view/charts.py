"""Canvas below one path of a recording, and charts over depth: tension, VIV response and fatigue.

The colour bar of the tension is every rope's legend. rerun has no plot of one quantity over
another, so the axes are drawn here: coordinates of the tension chart run from 0 to PROFILE_WIDTH to
the right and from 0 to HEIGHT downward; a panel of a quantity along the rope is WIDTH wide and
HEIGHT high, with the hang-off at its top.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rope_twin.messages.templates import PAYLOAD_RGB, SLACK_RGB, shade, tension_colours

_ABOVE = 0.25  # fraction of a step: a height above the water beyond it extends the scale
_OVER = 0.1  # fraction of a step by which a height may exceed the scale, as a crane that heaves
_MARGIN = 0.1  # at either end, as a fraction of the range or of a step
_MOST = 5.5
GRID_RGB, SCALE_RGB, WAVE_RGB = (66, 68, 76), (130, 132, 140), (120, 175, 230)
WORDS_RGB = (205, 205, 210)
HAIR, THIN = 0.5, 0.75  # widths of lines [points of the user interface]
Values = NDArray[np.float64]
Points = NDArray[np.float64]  # (n, 2 or 3)


def round_step(span: float, most: int = 7) -> float:
    """Return the smallest 1, 2 or 5 × 10ⁿ that divides `span` into at most `most` steps."""
    if not (math.isfinite(span) and span > 0.0):
        return 1.0
    smallest = span / most
    decade = 10.0 ** math.floor(math.log10(smallest))
    return next(
        step * decade for step in (1.0, 2.0, 5.0, 10.0) if step * decade >= smallest * 0.9999
    )


def ticks_over(span: float, most: int = 7) -> Values:
    """Return 0, step, 2 step, ... up to the first tick at or beyond `span`."""
    step = round_step(span, most)
    return np.asarray(np.arange(math.ceil(max(span, step) / step - 1e-9) + 1) * step)


def depths_over(highest_m: float, deepest_m: float) -> Values:
    """Return depth ticks from a height above the water to a depth, from the top down.

    Negative depths are heights; a hang-off barely above the water has none.
    """
    deepest_m, highest_m = max(deepest_m, 0.0), max(highest_m, 0.0)
    step = round_step(max(deepest_m + highest_m, 1e-9))
    above = math.ceil(highest_m / step - _OVER) if highest_m > _ABOVE * step else 0
    below = math.ceil(max(deepest_m, 0.0 if above else step) / step - 1e-9)
    return np.asarray(np.arange(-above, below + 1) * step)


def depth_words(depth_m: float) -> str:
    """Return the label of a depth tick; heights above the water have a plus sign."""
    return f"{depth_m:g}" if depth_m >= 0.0 else f"+{-depth_m:g}"


def decade_range(low: float, high: float) -> tuple[float, float]:
    """Return an axis range around low to high that contains at least two multiples of 10ⁿ.

    rerun labels plots at multiples of a power of ten only, and only if they are far enough apart:
    about _MOST of them in a plot of the view.
    """
    span = max(high - low, 1e-3 * max(abs(low), abs(high)), 1e-6)
    margin = _MARGIN * span
    bottom, top = low - margin, high + margin
    step = 10.0 ** math.floor(math.log10(span))
    while True:
        labels = math.floor(top / step) - math.ceil(bottom / step) + 1
        if labels >= 2 and top - bottom <= _MOST * step:
            return bottom, top
        first, last = math.floor(low / step), math.ceil(high / step)
        if first == last:
            first, last = first - 1, last + 1
        wide = last - first + 2.0 * _MARGIN
        if wide <= _MOST:
            return (first - _MARGIN) * step, (last + _MARGIN) * step
        step *= 10.0


class Canvas:
    """Draws below `path` in the coordinates of a view; flat: in two dimensions.

    Widths and radii are in points of the user interface.
    """

    def __init__(self, stream: Any, path: str, *, flat: bool = False) -> None:
        self._stream, self._path, self._flat = stream, path, flat

    def log(self, name: str, drawn: Any, *, static: bool = False) -> None:
        """Log an archetype of rerun; static: for the whole recording."""
        self._stream.log(f"{self._path}/{name}", drawn, static=static)

    def lines(
        self, name: str, strips: Any, colours: Any, width: float = THIN, *, static: bool = False,
        **options: Any,
    ) -> None:  # fmt: skip
        """Draw strips of points."""
        import rerun as rr

        kind = rr.LineStrips2D if self._flat else rr.LineStrips3D
        drawn = kind(strips, colors=colours, radii=rr.Radius.ui_points(width), **options)
        self.log(name, drawn, static=static)

    def rope(
        self, name: str, nodes: Points, elements_n: Points, scale_n: float, width: float = 3.0,
        **options: Any,
    ) -> None:  # fmt: skip
        """Draw the elements between nodes, (n, 2 or 3), in the colours of their tension [N]."""
        elements = np.stack([nodes[:-1], nodes[1:]], axis=1)
        self.lines(name, elements, tension_colours(elements_n, scale_n), width, **options)

    def points(
        self, name: str, places: Any, colour: Any, radius: float, *,
        words: Sequence[str] | None = None, static: bool = False,
    ) -> None:  # fmt: skip
        """Draw points, with a label each if words are given."""
        import rerun as rr

        kind = rr.Points2D if self._flat else rr.Points3D
        labels: dict[str, Any] = {} if words is None else {"labels": words, "show_labels": True}
        drawn = kind(places, colors=colour, radii=rr.Radius.ui_points(radius), **labels)
        self.log(name, drawn, static=static)

    def labels(self, name: str, places: Any, words: Sequence[str], *, static: bool = False) -> None:
        """Write a label at each place."""
        self.points(name, places, WORDS_RGB, 0.0, words=words, static=static)

    def payloads(self, places: Any, half_m: float, names: Sequence[str], *, named: bool) -> None:
        """Draw payloads as cubes of this half side at their centres; named: with their names."""
        import rerun as rr

        self.log(
            "payload",
            rr.Boxes3D(
                centers=places, half_sizes=[[half_m] * 3] * len(names), colors=PAYLOAD_RGB,
                fill_mode="solid", labels=names, show_labels=named,
            ),
        )  # fmt: skip


HEIGHT = 1000.0
PROFILE_WIDTH = 1250.0
RANGE_S = 60.0  # time span of the minimum and maximum tension (thin lines)
_BAR = 24.0  # thickness of the colour bar
_UNDER = HEIGHT + 3.0 * _BAR  # numbers of the colour bar
_ASIDE = -75.0  # to the left of the chart
_ALONG = np.linspace(0.0, 1.0, 201)  # fixed positions along the depth, as nodes come and go
_STRIPS = 250
_LIFT = 30.0  # rerun places a label below its point; this offset places it beside
_RANGE_RGB = (150, 150, 158)
WIDTH, GAP = 560.0, 110.0
_HEAD, _NAMES_LIFT = -95.0, 30.0  # title above the panel; rerun places a label below its point


class Profile:
    """Draws the chart below `path`; the axes are redrawn when a scale changes."""

    def __init__(self, stream: Any, path: str) -> None:
        self._stream, self._path = stream, path
        self._canvas = Canvas(stream, path, flat=True)
        self._scale_n, self._top_m, self._deepest_m = 0.0, 0.0, 0.0
        self._history: deque[tuple[int, Values]] = deque()

    def show(
        self, time_ns: int, depth_m: Values, nodes_n: Values, elements_n: Values, scale_n: float
    ) -> None:
        """Draw depths and tensions (n,) of the nodes, in the colours of the element tensions."""
        if self._outgrown(scale_n, depth_m):
            depths_m = depths_over(-float(depth_m.min()), float(depth_m.max()))
            self._scale_n = scale_n
            self._top_m, self._deepest_m = float(depths_m[0]), float(depths_m[-1])
            self._draw_axes(depths_m)
        curve = self._place(nodes_n, depth_m)
        below_m = np.maximum.accumulate(depth_m - depth_m[0])
        fraction = below_m / max(float(below_m[-1]), 1.0)
        depths_m = np.interp(_ALONG, fraction, depth_m)
        sides = self._range(time_ns, np.interp(_ALONG, fraction, nodes_n))
        strips = [self._place(side, depths_m) for side in sides]
        self._canvas.lines("range", strips, _RANGE_RGB, draw_order=1.0)
        self._canvas.rope("now", curve, elements_n, scale_n, 2.5, draw_order=2.0)

    def _outgrown(self, scale_n: float, depth_m: Values) -> bool:
        """Return whether the axes have to change.

        A payload that heaves across a tick, or a hang-off at the water that heaves out of the
        chart, does not change them.
        """
        low, high = float(depth_m.max()), float(depth_m.min())
        tall = self._deepest_m - self._top_m
        small = low - min(high, 0.0) < 0.5 * tall and depths_over(-high, low)[-1] < self._deepest_m
        above = depths_over(-high, max(low, self._deepest_m))[0] < self._top_m
        return scale_n != self._scale_n or low > self._deepest_m or small or bool(above)

    def _place(self, tension_n: Values, depth_m: Values) -> Any:
        depth = (depth_m - self._top_m) / (self._deepest_m - self._top_m)
        return np.stack([tension_n / self._scale_n * PROFILE_WIDTH, depth * HEIGHT], axis=-1)

    def _range(self, time_ns: int, tension_n: Values) -> Any:
        """Return minimum and maximum tension along the rope over RANGE_S; restart after a jump."""
        history = self._history
        if history and time_ns < history[-1][0]:
            history.clear()
        history.append((time_ns, tension_n))
        while history[0][0] < time_ns - RANGE_S * 1e9:
            history.popleft()
        rows = np.stack([row for _, row in history])
        return rows.min(axis=0), rows.max(axis=0)

    def _draw_axes(self, depths_m: Values) -> None:
        import rerun as rr

        forces_n = ticks_over(self._scale_n, most=5)
        x_positions = forces_n / self._scale_n * PROFILE_WIDTH
        y_positions = (depths_m - depths_m[0]) / (depths_m[-1] - depths_m[0]) * HEIGHT
        canvas = Canvas(self._stream, f"{self._path}/axes", flat=True)
        grid = [[[x, 0.0], [x, HEIGHT]] for x in x_positions if x <= PROFILE_WIDTH]
        grid += [[[0.0, y], [PROFILE_WIDTH, y]] for y in y_positions]
        canvas.lines("grid", grid, GRID_RGB, HAIR, draw_order=0.0)
        shown = x_positions <= PROFILE_WIDTH
        canvas.labels("tension", [[x, _UNDER] for x in x_positions[shown]],
                      [f"{force / 1000.0:g}" for force in forces_n[shown]])  # fmt: skip
        canvas.labels("depth", [[_ASIDE, y - _LIFT] for y in y_positions],
                      [depth_words(depth) for depth in depths_m])  # fmt: skip
        # the colour bar: strips side by side (2-D boxes cannot be filled)
        places = (np.arange(_STRIPS) + 0.5) / _STRIPS
        top, bottom = HEIGHT + 1.8 * _BAR, HEIGHT + 2.8 * _BAR
        bar = [[[x, top], [x, bottom]] for x in places * PROFILE_WIDTH]
        middle = 0.5 * (top + bottom)
        bar.append([[_ASIDE - _BAR, middle], [_ASIDE + _BAR, middle]])
        canvas.log(
            "colours",
            rr.LineStrips2D(
                bar,
                colors=np.concatenate([shade(places), [SLACK_RGB]]),
                radii=[1.0 * PROFILE_WIDTH / _STRIPS] * _STRIPS + [0.5 * _BAR],
            ),
        )
        canvas.labels("slack", [[_ASIDE, _UNDER]], ["slack"])


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
        paid_out = depth_m >= 0.0
        known = [curve.values[paid_out & np.isfinite(curve.values)] for curve in curves]
        largest = max((float(values.max(initial=0.0)) for values in known), default=0.0)
        deepest = float(depth_m[paid_out].max(initial=0.0))
        wide, high = self._axes
        if largest > wide or deepest > high:
            wide = float(ticks_over(1.2 * largest, most=4)[-1]) if largest > wide else wide
            high = float(ticks_over(deepest)[-1]) if deepest > high else high
            self._axes = wide, high
            self._draw_axes(curves)
        if not (wide > 0.0 and high > 0.0):
            return
        for curve in curves:
            drawn = paid_out & np.isfinite(curve.values)
            points = self._place(curve.values[drawn] / wide, depth_m[drawn] / high)
            self._canvas.lines(curve.name.replace(" ", "_"), [points], curve.rgb, 2.0)

    def _place(self, across: Values, down: Values) -> Values:
        return np.stack([self._left + across * WIDTH, down * HEIGHT], axis=-1)

    def _draw_axes(self, curves: list[Curve]) -> None:
        wide, high = self._axes
        if not (wide > 0.0 and high > 0.0):
            return
        values, depths = ticks_over(wide, most=4), ticks_over(high)
        x, y = self._left + values / wide * WIDTH, depths / high * HEIGHT
        grid = [[[coordinate, 0.0], [coordinate, HEIGHT]] for coordinate in x]
        grid += [[[self._left, coordinate], [self._left + WIDTH, coordinate]] for coordinate in y]
        canvas = self._canvas
        canvas.lines("grid", grid, GRID_RGB, HAIR)
        canvas.labels(
            "values", [[coordinate, HEIGHT] for coordinate in x], [f"{value:g}" for value in values]
        )
        if self._left == 0.0:  # the other panels have the same depths, and no space for labels
            canvas.labels(
                "depths",
                [[-60.0, coordinate - _NAMES_LIFT] for coordinate in y],
                [f"{d:g}" for d in depths],
            )
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

    def show_vibration(self, columns: dict[str, Values]) -> bool:
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

    def show_fatigue(self, from_hang_off_m: Values, damage: Values) -> bool:
        """Draw the damage of each metre of rope; return whether it is the first."""
        self._used.show(from_hang_off_m, [Curve("per metre of rope", damage, USED_RGB)])
        return self._is_first(FATIGUE)

    def show_bends(self, columns: dict[str, Values]) -> bool:
        """Draw the bends of the first rope from the upper end of its material down.

        Nothing is drawn of a rope that runs over nothing. Return whether it is the first.
        """
        if not np.isfinite(columns["bends"]).any():
            return False
        material = columns["from_lower_end_m"]
        from_top_m = material.max() - material
        self._bends.show(from_top_m, [Curve("per metre of rope", columns["bends"], USED_RGB)])
        worn = [
            Curve("damage", columns["bend_damage"], USED_RGB),
            Curve("of discard value", columns["discard_fraction"], DRAG_RGB),
        ]
        self._bent.show(from_top_m, worn)
        return self._is_first(BENDS)

    def _is_first(self, name: str) -> bool:
        first = name not in self.shown
        if first:
            self.shown = (*self.shown, name)
        return first


def _moving(hz: Values) -> Values:
    """Return the frequencies, NaN where there is no vibration."""
    return np.where(hz > 0.0, hz, np.nan)
