"""Chart of tension vs depth, whose colour bar is the legend of every rope in the view.

rerun has no plot of one quantity over another, so the axes are drawn here: chart coordinates run
from 0 to WIDTH to the right and from 0 to HEIGHT downward.
"""

from __future__ import annotations

from collections import deque
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rope_twin.messages.templates import SLACK_RGB, shade
from rope_twin.view.canvas import GRID_RGB, HAIR, Canvas
from rope_twin.view.ticks import depth_words, depths_over, ticks_over

WIDTH, HEIGHT = 1250.0, 1000.0
RANGE_S = 60.0  # time span of the minimum and maximum tension (thin lines)
_BAR = 24.0  # thickness of the colour bar
_UNDER = HEIGHT + 3.0 * _BAR  # numbers of the colour bar
_ASIDE = -75.0  # to the left of the chart
_ALONG = np.linspace(0.0, 1.0, 201)  # fixed positions along the depth, as nodes come and go
_STRIPS = 250
_LIFT = 30.0  # rerun places a label below its point; this offset places it beside
_RANGE_RGB = (150, 150, 158)


class Profile:
    """Draws the chart below `path`; the axes are redrawn when a scale changes."""

    def __init__(self, stream: Any, path: str) -> None:
        self._stream, self._path = stream, path
        self._canvas = Canvas(stream, path, flat=True)
        self._scale_n, self._top_m, self._deepest_m = 0.0, 0.0, 0.0
        self._history: deque[tuple[int, NDArray[np.float64]]] = deque()

    def show(self, time_ns: int, depth_m: NDArray[np.float64], nodes_n: NDArray[np.float64],
             elements_n: NDArray[np.float64], scale_n: float) -> None:  # fmt: skip
        """Draw depths and tensions (n,) of the nodes, in the colours of the element tensions."""
        if self._outgrown(scale_n, depth_m):
            depths_m = depths_over(-float(depth_m.min()), float(depth_m.max()))
            self._scale_n = scale_n
            self._top_m, self._deepest_m = float(depths_m[0]), float(depths_m[-1])
            self._draw_axes(depths_m)
        curve = self._place(nodes_n, depth_m)
        below_m = np.maximum.accumulate(depth_m - depth_m[0])
        along = below_m / max(float(below_m[-1]), 1.0)
        depths_m = np.interp(_ALONG, along, depth_m)
        sides = self._range(time_ns, np.interp(_ALONG, along, nodes_n))
        strips = [self._place(side, depths_m) for side in sides]
        self._canvas.lines("range", strips, _RANGE_RGB, draw_order=1.0)
        self._canvas.rope("now", curve, elements_n, scale_n, 2.5, draw_order=2.0)

    def _outgrown(self, scale_n: float, depth_m: NDArray[np.float64]) -> bool:
        """Return whether the axes have to change.

        A payload that heaves across a tick, or a hang-off at the water that heaves out of the
        chart, does not change them.
        """
        low, high = float(depth_m.max()), float(depth_m.min())
        tall = self._deepest_m - self._top_m
        small = low - min(high, 0.0) < 0.5 * tall and depths_over(-high, low)[-1] < self._deepest_m
        above = depths_over(-high, max(low, self._deepest_m))[0] < self._top_m
        return scale_n != self._scale_n or low > self._deepest_m or small or bool(above)

    def _place(self, tension_n: NDArray[np.float64], depth_m: NDArray[np.float64]) -> Any:
        down = (depth_m - self._top_m) / (self._deepest_m - self._top_m)
        return np.stack([tension_n / self._scale_n * WIDTH, down * HEIGHT], axis=-1)

    def _range(self, time_ns: int, tension_n: NDArray[np.float64]) -> Any:
        """Return minimum and maximum tension along the rope over RANGE_S; restart after a jump."""
        history = self._history
        if history and time_ns < history[-1][0]:
            history.clear()
        history.append((time_ns, tension_n))
        while history[0][0] < time_ns - RANGE_S * 1e9:
            history.popleft()
        rows = np.stack([row for _, row in history])
        return rows.min(axis=0), rows.max(axis=0)

    def _draw_axes(self, depths_m: NDArray[np.float64]) -> None:
        import rerun as rr

        forces_n = ticks_over(self._scale_n, most=5)
        across = forces_n / self._scale_n * WIDTH
        down = (depths_m - depths_m[0]) / (depths_m[-1] - depths_m[0]) * HEIGHT
        canvas = Canvas(self._stream, f"{self._path}/axes", flat=True)
        grid = [[[x, 0.0], [x, HEIGHT]] for x in across if x <= WIDTH]
        grid += [[[0.0, y], [WIDTH, y]] for y in down]
        canvas.lines("grid", grid, GRID_RGB, HAIR, draw_order=0.0)
        shown = across <= WIDTH
        canvas.labels("tension", [[x, _UNDER] for x in across[shown]],
                      [f"{force / 1000.0:g}" for force in forces_n[shown]])  # fmt: skip
        canvas.labels("depth", [[_ASIDE, y - _LIFT] for y in down],
                      [depth_words(depth) for depth in depths_m])  # fmt: skip
        # the colour bar: strips side by side (2-D boxes cannot be filled)
        places = (np.arange(_STRIPS) + 0.5) / _STRIPS
        top, bottom = HEIGHT + 1.8 * _BAR, HEIGHT + 2.8 * _BAR
        bar = [[[x, top], [x, bottom]] for x in places * WIDTH]
        middle = 0.5 * (top + bottom)
        bar.append([[_ASIDE - _BAR, middle], [_ASIDE + _BAR, middle]])
        canvas.log(
            "colours",
            rr.LineStrips2D(
                bar,
                colors=np.concatenate([shade(places), [SLACK_RGB]]),
                radii=[1.0 * WIDTH / _STRIPS] * _STRIPS + [0.5 * _BAR],
            ),
        )
        canvas.labels("slack", [[_ASIDE, _UNDER]], ["slack"])
