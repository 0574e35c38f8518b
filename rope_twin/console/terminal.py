"""Terminal console: the first page's numbers, trend and alerts in a terminal, as over SSH.

It reads the same values as the web page and commands nothing. Textual draws it.

The trend of the top tension is made of braille patterns, two by four dots each. The newest value
stands at `now`; a forecast, where there is one, ahead of it.
"""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Callable, Mapping, Sequence
from typing import ClassVar, NamedTuple

from rich.text import Text
from textual.app import App, ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Grid, Horizontal, Vertical
from textual.theme import Theme
from textual.widgets import Digits, Footer, Static

from rope_twin.console import figures
from rope_twin.console.pages import Pages
from rope_twin.console.playback import Recording
from rope_twin.console.readings import AHEAD_S, TENSION, Values, stale_limits_s

WINDOW_S = 60.0
LABEL = 9  # characters left of the chart
_BASE = 0x2800  # braille pattern without a dot
_DOTS = ((0x01, 0x02, 0x04, 0x40), (0x08, 0x10, 0x20, 0x80))  # of a character, by column and row
_MARGIN = 0.15  # of the range, above and below
_OLD_FORECAST_S = 3.0

READ_HZ = 10.0  # two rows for each column of dots in a wide terminal
DRAW_HZ = 2.0  # what a reader follows; each drawing costs some 10 ms
SEEK_S = 10.0  # a step in a recording
_SOUND_S = {"alarm": 2.0, "warning": 4.0}  # between two bells of the terminal
_THEMES = (
    Theme("day", primary="#0a5a9c", foreground="#1a1a1a", background="#f0f0f0", surface="#ffffff",
          panel="#e2e2e2", warning="#a05a00", error="#b00020", dark=False),
    Theme("dusk", primary="#6ab0e8", foreground="#dddddd", background="#14181c", surface="#1c2126",
          panel="#262c33", warning="#ffa000", error="#ff5a40", dark=True),
    Theme("night", primary="#b06000", foreground="#a85a00", background="#000000", surface="#0a0500",
          panel="#140a00", warning="#c07800", error="#d03000", dark=True),
)  # fmt: skip
_STATES = {"unacknowledged": "!!", "silenced": "!", "acknowledged": " ", "transferred": " ",
           "rectified": "~"}  # fmt: skip

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
           units: figures.Units, styles: Styles) -> list[Curve]:  # fmt: skip
    """Return the curves of a trend and a forecast in the units of the screen, lowest first."""
    times = [value for value in trend["time_s"] if value is not None]
    if not times:
        return []
    now = times[-1]

    def past(name: str) -> Points:
        pairs = zip(times, trend[name], strict=True)
        return [
            (instant - now, figures.scaled(value, units.per_newton)) for instant, value in pairs
        ]

    shown = [Curve(past(name), styles.band, joined=False) for name in ("low_n", "high_n")]
    shown += _forecast_curves(forecast, now, units, styles)
    shown.append(Curve(past("tension_n"), styles.computed))
    shown.append(Curve(past("measured_n"), styles.measured, joined=False))
    return shown


def draw(shown: Sequence[Curve], limits: Sequence[float], width: int, height: int,
         styles: Styles, to_limit: bool = False, digits: int = 1) -> Text:  # fmt: skip
    """Return the chart in so many characters; `limits` are drawn where they are in its range.

    to_limit: the range is from 0 to the first limit or above it, else that of the curves.
    """
    columns, rows = 2 * max(1, width - LABEL), 4 * max(1, height - 1)
    ahead = any(x > 0.0 for curve in shown for x, _ in curve.points)
    end_s = AHEAD_S if ahead else 0.0
    values = [value for curve in shown for _, value in curve.points if figures.known(value)]
    low, high = _range(values, limits if to_limit else ())
    canvas = _Canvas(columns, rows)

    def row_of(value: float) -> int:
        return round((high - value) / (high - low) * (rows - 1))

    for mark in limits:
        if low <= mark <= high:
            canvas.line([(x, row_of(mark)) for x in range(0, columns, 2)], styles.limit, False)
    for curve in shown:
        dots: list[tuple[int, int]] = []
        for x, value in curve.points:
            column = round((x + WINDOW_S) / (WINDOW_S + end_s) * (columns - 1))
            if figures.known(value) and 0 <= column < columns and low <= value <= high:
                dots.append((column, row_of(value)))
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


def _forecast_curves(
    forecast: Values | None, now: float, units: figures.Units, styles: Styles
) -> list[Curve]:
    """Return the band and the median after now; their leads count from the forecast's origin."""
    origin = (forecast or {}).get("at_s")
    if forecast is None or not figures.known(origin) or now - origin > _OLD_FORECAST_S:
        return []
    places = [origin + lead - now for lead in forecast["lead_s"]]

    def after(name: str) -> Points:
        pairs = zip(places, forecast[name], strict=True)
        shown = (pair for pair in pairs if 0.0 < pair[0] <= AHEAD_S)
        return [(lead_s, figures.scaled(value, units.per_newton)) for lead_s, value in shown]

    band = [Curve(after(name), styles.band, joined=False) for name in ("low_n", "high_n")]
    return [*band, Curve(after("median_n"), styles.computed, joined=False)]


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
    columns = max(1, width - LABEL)
    row = [" "] * columns
    labels = [(0.0, f"{-WINDOW_S:.0f} s"), (now / 2.0, f"{-WINDOW_S / 2.0:.0f} s"), (now, "now")]
    if end_s:
        labels.append((1.0, f"+{end_s:.0f} s"))
    for share, text in labels:
        column = min(max(0, math.floor(share * columns - (len(text) / 2.0))), columns - len(text))
        row[max(0, column) : max(0, column) + len(text)] = text
    return " " * LABEL + "".join(row)[:columns]


class _Big(Vertical):
    """One big figure with what stands below it."""

    _shown: tuple[figures.Figure, str, bool, int] | None = None

    def compose(self) -> ComposeResult:
        """Make head, digits and note."""
        yield Static(classes="head")
        yield Digits("", classes="digits")
        yield Static(classes="note")

    def show(self, figure: figures.Figure, age: str, old: bool) -> None:
        """Show a figure; `age`: of its topic, in words; `old`: it is stale."""
        if (figure, age, old, self.content_size.width) == self._shown:
            return
        self._shown = figure, age, old, self.content_size.width
        name, unit = figure.label, f" {figure.unit}"
        fits = len(name) + len(unit) + len(age) + 2 <= self.content_size.width
        if old and not fits:
            unit = ""  # the age matters more
        head = Text.assemble((name, "bold"), unit, no_wrap=True)
        if fits or old:
            head.append(f"  {age}", "reverse" if old else "dim")
        self.query_one(".head", Static).update(head, layout=False)
        text = figure.text.replace("−", "-").replace("–", "-")  # those that Digits can draw
        self.query_one(Digits).update(text)
        self.query_one(".note", Static).update(figure.note, layout=False)
        self.set_class(old, "old")
        self.set_class(figure.warns and not old, "warns")


class TerminalConsole(App[None]):
    """The console in a terminal, of a running suite or of a recording."""

    CSS = """
    Screen { layout: vertical; }
    #top { height: 1; background: $panel; }
    #bigs { grid-size: 4 1; grid-gutter: 0 1; height: 6; }
    _Big { background: $surface; padding: 0 1; height: 6; }
    _Big .digits { width: 1fr; color: $foreground; text-style: bold; }
    _Big .head { height: 1; }
    _Big .note { height: 2; }
    _Big.warns .digits { color: $error; }
    _Big.old .digits, _Big.old .note { color: $foreground 40%; }
    #middle { height: 1fr; min-height: 6; }
    #trend { width: 2fr; height: 100%; background: $surface; padding: 0 1; }
    #right { width: 1fr; min-width: 30; margin-left: 1; }
    #alerts { height: 1fr; background: $surface; padding: 0 1; }
    #lines { height: auto; max-height: 7; background: $surface; padding: 0 1; margin-top: 1; }
    #rows { grid-size: 3 1; grid-gutter: 0 1; height: 5; margin-top: 1; }
    #rows Static { background: $surface; padding: 0 1; height: 100%; }
    """
    TITLE = "rope_twin console"
    ENABLE_COMMAND_PALETTE = False
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("u", "units", "Units"),
        Binding("p", "palette", "Palette"),
        Binding("r", "range", "Range"),
        Binding("b", "sound", "Bell"),
        Binding("l", "rope", "Line"),
        Binding("space", "pause", "Pause", show=False),
        Binding("left", "seek(-1)", "Back", show=False),
        Binding("right", "seek(1)", "On", show=False),
        Binding("q,ctrl+c", "quit", "Quit"),
    ]

    def __init__(
        self,
        pages: Pages,
        clock: Callable[[], float] = time.monotonic,
        stopped: Callable[[], bool] = lambda: False,
    ) -> None:
        """Make the console of the pages' source; no page need be connected.

        clock: that of the pages [s]; stopped: asked before each row whether the console is to end.
        """
        super().__init__()
        self.pages, self._clock, self._stopped = pages, clock, stopped
        self._units, self._rope, self._to_limit, self._bell = 0, 0, False, True
        self._stale_s = stale_limits_s()
        self._sounded_s = 0.0
        self._drawn: dict[str, Text] = {}  # by the name of its place
        logging.getLogger("rope_twin").addHandler(logging.NullHandler())  # a fault is an alert here

    @property
    def units(self) -> figures.Units:
        """Return the units that are shown."""
        return figures.UNITS[self._units]

    def compose(self) -> ComposeResult:
        """Make the parts of the screen."""
        yield Static(id="top")
        with Grid(id="bigs"):
            for number in range(4):
                yield _Big(id=f"big-{number}")
        with Horizontal(id="middle"):
            yield Static(id="trend")
            with Vertical(id="right"):
                yield Static(id="alerts")
                yield Static(id="lines")
        with Grid(id="rows"):
            for name in ("payload", "sea", "winch"):
                yield Static(id=name)
        yield Footer()

    def on_mount(self) -> None:
        """Begin to read and to draw."""
        for theme in _THEMES:
            self.register_theme(theme)
        self.theme = "dusk"
        self.set_interval(1.0 / READ_HZ, self._read)
        self.set_interval(1.0 / DRAW_HZ, self.draw)

    def draw(self) -> None:
        """Draw what has arrived."""
        if not self.is_running or not self.query("#top"):
            return  # it is about to end
        pages, units = self.pages, self.units
        all_ropes = figures.View(pages.readings.values, pages.facts, pages.profile)
        view = figures.of_rope(all_ropes, self._rope)
        values, facts = view.values, view.facts
        ages = self.pages.readings.ages(self._clock())
        self._set_content("top", self._head(ages))
        for number, figure in enumerate(figures.big_figures(values, facts, units)):
            age, old = self._age(figure.topic, ages)
            self.query_one(f"#big-{number}", _Big).show(figure, age, old)
        self._draw_trend(view, ages)
        self._set_content("alerts", self._alerts())
        risks = figures.risk_lines(values, units) or [figures.no_forecast(all_ropes.values)]
        lines = [*risks, *figures.quality_lines(values)]
        self._set_content("lines", Text("\n".join(lines)), layout=True)
        payload = figures.payload_figures(values, view.profile, facts, units)
        for name, rows in (("payload", payload), ("sea", figures.sea_figures(values, facts)),
                           ("winch", figures.winch_figures(values, facts))):  # fmt: skip
            self._set_content(name, self._table(rows, ages))

    def _set_content(self, place: str, content: Text, layout: bool = False) -> None:
        """Show a content if it differs from what is shown; layout: its height may differ too."""
        if self._drawn.get(place) != content:
            self._drawn[place] = content
            self.query_one(f"#{place}", Static).update(content, layout=layout)

    def action_units(self) -> None:
        """Show other units."""
        self._units = (self._units + 1) % len(figures.UNITS)
        self.draw()

    def action_rope(self) -> None:
        """Show the next of several ropes."""
        self._rope = (self._rope + 1) % max(1, len(self.pages.readings.values.get("ropes") or ()))
        self.draw()

    def action_palette(self) -> None:
        """Show another palette."""
        names = [theme.name for theme in _THEMES]
        self.theme = names[(names.index(self.theme) + 1) % len(names)]
        self.draw()

    def action_range(self) -> None:
        """Show the trend up to the limit, or its own range."""
        self._to_limit = not self._to_limit
        self.draw()

    def action_sound(self) -> None:
        """Turn the terminal's bell off or on."""
        self._bell = not self._bell
        self.draw()

    def action_pause(self) -> None:
        """Pause a recording, or play on."""
        if isinstance(source := self.pages.source, Recording):
            source.paused = not source.paused

    def action_seek(self, steps: int) -> None:
        """Show an earlier or later time of a recording."""
        if isinstance(source := self.pages.source, Recording):
            source.seek(source.position_s + steps * SEEK_S)

    def _read(self) -> None:
        if self._stopped():
            self.exit()
            return
        self.pages.tick_or_report()

    def _age(self, topic: str, ages: dict[str, float]) -> tuple[str, bool]:
        """Return the age of a topic in words, and whether it is stale."""
        age, limit = ages.get(topic), self._stale_s.get(topic)
        if age is None:
            return "", False
        old = limit is not None and age > limit
        return f"{age:.{1 if old else 0}f} s", old  # whole seconds do not change with every drawing

    def _head(self, ages: dict[str, float]) -> Text:
        source, readings = self.pages.source, self.pages.readings
        time_s = readings.time_s
        if isinstance(source, Recording):
            status, lost = "PAUSED" if source.paused else "RECORDING", False
            where = f"{source.position_s:.0f} of {source.duration_s:.0f} s"
        else:
            lost = time_s is None or self._age(TENSION, ages)[1]
            status = "NO TWIN" if time_s is None else "TWIN LOST" if lost else "LIVE"
            where = f"{time.strftime('%H:%M:%S', time.gmtime())} UTC"
        name = self.pages.facts.get("scene") or "rope_twin"
        ropes = readings.values.get("ropes") or ()
        if len(ropes) > 1 and self._rope < len(ropes):
            name += f" · {ropes[self._rope]}"
        twin = "" if time_s is None else f"twin {time_s:.1f} s"
        style = f"bold {self._styles.limit}" if lost else "bold"
        details = f"  {where}  {twin}  {self.units.name}" + ("" if self._bell else "  bell off")
        return Text.assemble(f" {name} ", (status, style), details, no_wrap=True)

    def _draw_trend(self, view: figures.View, ages: dict[str, float]) -> None:
        place = self.query_one("#trend", Static)
        width, height = place.content_size
        if width < 20 or height < 4:
            return
        units, styles, trend = self.units, self._styles, self.pages.trend
        min_n = figures.limit(view.values, view.facts, "min_tension_n")
        known_n = (view.facts["ropes"][0].get("allowed_n"), min_n)
        marks = [force_n * units.per_newton for force_n in known_n if figures.known(force_n)]
        forecast = None if self._rope else view.values.get("forecast")  # it is of the first rope
        shown = curves(trend.columns(min(self._rope, trend.ropes - 1)), forecast, units, styles)
        head = Text.assemble(
            (f"Tension [{units.force}]  ", "bold"), ("computed", styles.computed), "  ",
            ("measured", styles.measured), "  ", ("limit", styles.limit),
            "  range to the limit" if self._to_limit else "", "\n", no_wrap=True,
        )  # fmt: skip
        chart = draw(shown, marks, width, height - 1, styles, self._to_limit, units.force_digits)
        if self._age(TENSION, ages)[1]:
            chart.stylize("dim")
        self._set_content("trend", head + chart)

    def _alerts(self) -> Text:
        rows = figures.alert_rows(self.pages.readings.values)
        self._sound([row.priority for row in rows if row.sounds])
        text = Text.assemble((f"Alerts ({len(rows)})", "bold"))
        alarm, warning = self._styles.limit, self._styles.measured
        colours = {"emergency": alarm, "alarm": alarm, "warning": warning}
        for row in rows:
            colour = colours.get(row.priority, self._styles.axis)
            style = f"{colour} reverse" if row.state == "unacknowledged" else colour
            mark = f"{_STATES.get(row.state, ' ')}{row.priority.upper()}"
            text.append("\n")
            text.append(mark, style)
            text.append(f" {row.title}: {row.text}")
        if not rows:
            text.append("\nNo alert", "dim")
        return text

    def _sound(self, priorities: Sequence[str]) -> None:
        """Ring the terminal's bell for what sounds on the page."""
        if not priorities or not self._bell:
            return
        kind = "warning" if set(priorities) <= {"warning"} else "alarm"
        now_s = self._clock()
        if now_s - self._sounded_s >= _SOUND_S[kind]:
            self._sounded_s = now_s
            self.bell()

    def _table(self, rows: Sequence[figures.Figure], ages: dict[str, float]) -> Text:
        text, width = Text(no_wrap=True), max((len(row.label) for row in rows), default=0)
        for row in rows:
            age, old = self._age(row.topic, ages)
            style = "dim" if old else self._styles.limit if row.warns else "bold"
            value = f"{row.text} {row.unit}".rstrip() + (f" ({age} old)" if old else "")
            text.append(f"{row.label:<{width}} ").append(value, style).append("\n")
        text.rstrip()
        return text

    @property
    def _styles(self) -> Styles:
        theme = self.current_theme
        return Styles(theme.primary, theme.warning or "", "dim", theme.error or "", "dim")
