"""Trend of the top tension as characters: braille patterns of two by four dots each.

The newest value stands at `now`; a forecast, where there is one, ahead of it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from rich.text import Text

from rope_twin.console.figures import Units, known
from rope_twin.console.readings import AHEAD_S, Values

WINDOW_S = 60.0
LABEL = 9  # characters left of the chart
_BASE = 0x2800  # braille pattern without a dot
_DOTS = ((0x01, 0x02, 0x04, 0x40), (0x08, 0x10, 0x20, 0x80))  # of a character, by column and row
_MARGIN = 0.15  # of the range, above and below
_OLD_FORECAST_S = 3.0

Points = Sequence[tuple[float, float | None]]  # time after now [s] and value


class Curve(NamedTuple):
    """One curve of the chart."""

    points: Points
    style: str
    joined: bool = True  # False: dots, as of a band


class Styles(NamedTuple):
    """Styles of the curves."""

    computed: str
    measured: str
    band: str
    limit: str
    axis: str


def curves(trend: Mapping[str, Sequence[float | None]], forecast: Values | None,
           units: Units, styles: Styles) -> list[Curve]:  # fmt: skip
    """Return the curves of a trend and a forecast in the units of the screen, lowest first."""
    times = [one for one in trend["time_s"] if one is not None]
    if not times:
        return []
    now = times[-1]

    def past(name: str) -> Points:
        return [(at - now, _scaled(one, units)) for at, one in zip(times, trend[name], strict=True)]

    found = [Curve(past(name), styles.band, joined=False) for name in ("low_n", "high_n")]
    found += _ahead(forecast, now, units, styles)
    found.append(Curve(past("tension_n"), styles.computed))
    found.append(Curve(past("measured_n"), styles.measured, joined=False))
    return found


def draw(shown: Sequence[Curve], limits: Sequence[float], width: int, height: int,
         styles: Styles, to_limit: bool = False, digits: int = 1) -> Text:  # fmt: skip
    """Return the chart in so many characters; `limits` are drawn where they are in its range.

    to_limit: the range is from 0 to the first limit or above it, else that of the curves.
    """
    columns, rows = 2 * max(1, width - LABEL), 4 * max(1, height - 1)
    ahead = any(at > 0.0 for curve in shown for at, _ in curve.points)
    end_s = AHEAD_S if ahead else 0.0
    values = [one for curve in shown for _, one in curve.points if known(one)]
    low, high = _range(values, limits if to_limit else ())
    canvas = _Canvas(columns, rows)

    def row_of(value: float) -> int:
        return round((high - value) / (high - low) * (rows - 1))

    for limit in limits:
        if low <= limit <= high:
            canvas.line([(at, row_of(limit)) for at in range(0, columns, 2)], styles.limit, False)
    for curve in shown:
        dots: list[tuple[int, int]] = []
        for at, one in curve.points:
            column = round((at + WINDOW_S) / (WINDOW_S + end_s) * (columns - 1))
            if known(one) and 0 <= column < columns and low <= one <= high:
                dots.append((column, row_of(one)))
            else:
                canvas.line(dots, curve.style, curve.joined)
                dots = []
        canvas.line(dots, curve.style, curve.joined)
    labels = {0: high, (rows // 4 - 1) // 2: (high + low) / 2.0, rows // 4 - 1: low}
    text = Text(no_wrap=True)
    for number, cells in enumerate(canvas.characters()):
        label = f"{labels[number]:.{digits}f}" if values and number in labels else ""
        text.append(f"{label:>{LABEL - 1}} ", styles.axis)
        for character, style in cells:
            text.append(character, style)
        text.append("\n")
    text.append(_axis(width, WINDOW_S / (WINDOW_S + end_s), end_s), styles.axis)
    return text


class _Canvas:
    """Dots with a style for each character."""

    def __init__(self, columns: int, rows: int) -> None:
        self._wide, self._high = columns // 2, rows // 4
        self._bits = [[0] * self._wide for _ in range(self._high)]
        self._styles = [[""] * self._wide for _ in range(self._high)]

    def line(self, dots: Sequence[tuple[int, int]], style: str, joined: bool) -> None:
        """Set dots (column, row); `joined`: and those between two that follow each other."""
        last: tuple[int, int] | None = None
        for column, row in dots:
            if joined and last is not None:
                steps = max(abs(column - last[0]), abs(row - last[1]))
                for k in range(1, steps):
                    share = k / steps
                    self._dot(round(last[0] + share * (column - last[0])),
                              round(last[1] + share * (row - last[1])), style)  # fmt: skip
            self._dot(column, row, style)
            last = (column, row)

    def characters(self) -> list[list[tuple[str, str]]]:
        """Return the characters and their styles, row by row."""
        return [
            [(chr(_BASE + bits), style) for bits, style in zip(*pair, strict=True)]
            for pair in zip(self._bits, self._styles, strict=True)
        ]

    def _dot(self, column: int, row: int, style: str) -> None:
        x, y = column // 2, row // 4
        if 0 <= x < self._wide and 0 <= y < self._high:
            self._bits[y][x] |= _DOTS[column % 2][row % 4]
            self._styles[y][x] = style


def _ahead(forecast: Values | None, now: float, units: Units, styles: Styles) -> list[Curve]:
    """Return the band and the median after now; their leads count from the forecast's origin."""
    origin = (forecast or {}).get("at_s")
    if forecast is None or not known(origin) or now - origin > _OLD_FORECAST_S:
        return []
    places = [origin + lead - now for lead in forecast["lead_s"]]

    def after(name: str) -> Points:
        pairs = zip(places, forecast[name], strict=True)
        return [(at, _scaled(one, units)) for at, one in pairs if 0.0 < at <= AHEAD_S]

    band = [Curve(after(name), styles.band, joined=False) for name in ("low_n", "high_n")]
    return [*band, Curve(after("median_n"), styles.computed, joined=False)]


def _scaled(newton: float | None, units: Units) -> float | None:
    return None if newton is None else newton * units.per_newton


def _range(values: Sequence[float], limits: Sequence[float]) -> tuple[float, float]:
    if not values:
        return 0.0, 1.0
    low, high = min(values), max(values)
    if limits:
        return 0.0, 1.05 * max(high, limits[0])
    margin = max(_MARGIN * (high - low), 0.01 * abs(high), 1e-3)
    return low - margin, high + margin


def _axis(width: int, now: float, end_s: float) -> str:
    """Return the row below the chart; `now`: where now is, as a share of the width."""
    across = max(1, width - LABEL)
    row = [" "] * across
    words = [(0.0, f"{-WINDOW_S:.0f} s"), (now / 2.0, f"{-WINDOW_S / 2.0:.0f} s"), (now, "now")]
    if end_s:
        words.append((1.0, f"+{end_s:.0f} s"))
    for share, text in words:
        at = min(max(0, math.floor(share * across - (len(text) / 2.0))), across - len(text))
        row[max(0, at) : max(0, at) + len(text)] = text
    return " " * LABEL + "".join(row)[:across]
