"""Lines, points, labels and boxes below one path of a rerun recording; ticks at round numbers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rope_twin.messages.templates import PAYLOAD_RGB, tension_colours

_ABOVE = 0.25  # fraction of a step: a height above the water beyond it extends the scale
_OVER = 0.1  # fraction of a step by which a height may exceed the scale, as a crane that heaves
_MARGIN = 0.1  # at either end, as a fraction of the range or of a step
_MOST = 5.5
GRID_RGB, SCALE_RGB, WAVE_RGB = (66, 68, 76), (130, 132, 140), (120, 175, 230)
WORDS_RGB = (205, 205, 210)
HAIR, THIN = 0.5, 0.75  # widths of lines [points of the user interface]
Points = NDArray[np.float64]


def round_step(span: float, most: int = 7) -> float:
    """Return the smallest 1, 2 or 5 × 10ⁿ that divides `span` into at most `most` steps."""
    if not (math.isfinite(span) and span > 0.0):
        return 1.0
    smallest = span / most
    decade = 10.0 ** math.floor(math.log10(smallest))
    return next(
        step * decade for step in (1.0, 2.0, 5.0, 10.0) if step * decade >= smallest * 0.9999
    )


def ticks_over(span: float, most: int = 7) -> NDArray[np.float64]:
    """Return 0, step, 2 step, ... up to the first tick at or beyond `span`."""
    step = round_step(span, most)
    return np.asarray(np.arange(math.ceil(max(span, step) / step - 1e-9) + 1) * step)


def depths_over(highest_m: float, deepest_m: float) -> NDArray[np.float64]:
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
