"""Forecasts beside a live twin: what was heard is kept, and a thread forecasts it every second.

Callbacks only append to the series; the worker owns the fleet, the nominal rope (which follows the
measured motion a burn-in behind the present) and the kept forecasts. Nothing waits for the worker:
if a forecast takes longer than its interval the next one is later, and its age says so.
"""

from __future__ import annotations

import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from rope_twin.errors import InputError, RopeTwinError
from rope_twin.forecast.heave_process import (
    AHEAD_S,
    GRAVITY,
    PAST_S,
    RECORD_S,
    SAMPLE_S,
    SHORTEST_RECORD_S,
    MeasuredWaves,
    Response,
    heave_spectrum,
)
from rope_twin.forecast.orders import CONTINUE, Order, check_lift_order
from rope_twin.forecast.recorded_lift import (
    NominalRope,
    line_to_contact_m,
    scene_at_line,
    seabed_depth_m,
)
from rope_twin.forecast.risk import (
    BEGINS_S,
    KeptForecasts,
    Limits,
    QuietWindow,
    Risk,
    compare,
    quiet_windows,
    risks,
    tension_limits,
)
from rope_twin.forecast.tension_forecast import (
    ForecastSettings,
    Known,
    TensionForecast,
    TensionForecaster,
    unlearned_spread,
)
from rope_twin.messages.reports import (
    QUANTITIES,
    QUIET_TOPIC,
    RISK_TOPIC,
    ROPES_TOPIC,
    TENSION_TOPIC,
    band_columns,
)
from rope_twin.scene.environment import vessel_raos
from rope_twin.scene.schema import OnWaves, Scene
from rope_twin.sea.raos import moved_by
from rope_twin.sea.ship_motion import heave_response
from rope_twin.twin.motion.hang_off import arm_from_bow, lever_arm

Floats = NDArray[np.float64]
Row = Mapping[str, float | str]

INTERVAL_S = 1.0
LATE_S, LATE_INTERVALS = 3.0, 2.0  # without a forecast after the last one, for a warning
LARGEST_GAP_S = 2.0  # of a series that is bridged
WAVES_S = 240.0  # of elevations that a forecast uses
WAVES_EVERY_S = 1.0  # apart, for each place
MOST_WAVES = 480
LEAST_WAVES = 30
KEPT_S = RECORD_S + 20.0

_log = logging.getLogger(__name__)


class Series:
    """Times and values of one quantity, of the last KEPT_S; appended by one thread."""

    def __init__(self) -> None:
        self._rows: deque[tuple[float, float]] = deque()

    def add(self, time_s: float, value: float) -> None:
        """Append a value; one that is not later than the last, or not finite, is left out.

        A time far before the last is that of another run: the series begins again.
        """
        if not np.isfinite(value):
            return
        if self._rows and time_s <= self._rows[-1][0]:
            if time_s > self._rows[-1][0] - LARGEST_GAP_S:
                return
            self._rows.clear()
        self._rows.append((time_s, value))
        while self._rows[0][0] < time_s - KEPT_S:
            self._rows.popleft()

    def drop_after(self, time_s: float) -> None:
        """Remove the values that are later than a time."""
        while self._rows and self._rows[-1][0] > time_s:
            self._rows.pop()

    @property
    def newest_s(self) -> float:
        """Time of the newest value; -inf: there is none."""
        rows = self._rows.copy()
        return rows[-1][0] if rows else -np.inf

    def rows(self) -> Floats:
        """Return all times and values that are kept, (n, 2)."""
        return np.array(list(self._rows.copy()), np.float64).reshape(-1, 2)

    def table(self) -> Floats:
        """Return times and values after the last gap, (n, 2)."""
        rows = self.rows()
        gaps = np.flatnonzero(np.diff(rows[:, 0]) > LARGEST_GAP_S)
        return rows[gaps[-1] + 1 :] if len(gaps) else rows


@dataclass
class Heard:
    """All series of a live lift, in seconds of one clock."""

    heave_m: Series = field(default_factory=Series)
    line_out_m: Series = field(default_factory=Series)  # of the main winch
    lines_m: dict[str, Series] = field(default_factory=dict)  # of other winches that were heard
    tension_n: Series = field(default_factory=Series)
    waves: deque[tuple[float, float, float]] = field(
        default_factory=lambda: deque(maxlen=20_000)
    )  # time, distance up-sea, elevation
    compensation_on: bool | None = None  # None: not heard, as when the run began
    pin_n: Series = field(default_factory=Series)  # tension that was measured; judges forecasts
    # mean and standard deviation of the logarithms of learned figures; None: nothing is learned
    figures: tuple[Mapping[str, float], Mapping[str, float]] | None = None
    asked: tuple[Order, ...] = ()  # orders that the next forecast compares
    doubt: str = ""  # why the heave is not the ship's at present: nothing is forecast from it

    def clear(self) -> None:
        """Forget everything, as after a pause."""
        self.heave_m, self.line_out_m, self.tension_n = Series(), Series(), Series()
        self.pin_n, self.lines_m = Series(), {}
        self.waves.clear()
        self.compensation_on = None

    def silent(self) -> str:
        """Return which of heave and line out ended first, in words; "": they go on together."""
        names = {"heave": self.heave_m, "line out": self.line_out_m}
        names |= {f"line out of {name}": one for name, one in self.lines_m.copy().items()}
        ends = {name: one.newest_s for name, one in names.items()}
        first = min(ends, key=lambda name: ends[name])
        behind_s = max(ends.values()) - ends[first]
        return f"no {first} for {behind_s:.0f} s" if behind_s > LARGEST_GAP_S else ""


@dataclass(frozen=True)
class _Samples:
    """All series at the instants that heave and line out span, SAMPLE_S apart."""

    time_s: Floats
    heave_m: Floats
    line_out_m: Floats
    mean_n: Floats  # tension over the SAMPLE_S before; NaN: missing
    pin_n: Floats  # measured tension at the instant; NaN: missing
    pin_until_s: float  # newest of it; -inf: none
    lines_m: dict[str, Floats]  # of other winches


@dataclass(frozen=True)
class LiveForecast:
    """One forecast with its risks, as it is published."""

    forecast: TensionForecast
    risks: tuple[Risk, ...]
    quiet: tuple[QuietWindow, ...]
    coverage: float  # of the kept bands; NaN: not yet known
    judged: int  # number of kept forecasts that it is of
    age_s: float  # of the newest input when the forecast was ready
    orders: tuple[TensionForecast, ...] = ()  # that were asked for, on the same heave
    refused: tuple[str, ...] = ()  # orders that the scene cannot follow, a sentence each


def hang_off_response(scene: Scene, heading_rad: float, frequency_hz: Floats) -> Response:
    """Return the hang-off's heave per elevation of the waves there, for exp(+iωt), (n,).

    By the RAOs of the scene's ship, moved rigidly to the hang-off; without any by its box-like hull
    in head seas. heading_rad: direction that the waves travel to, counter-clockwise from east; they
    are those of deep water, k = ω²/g.

    Raises:
        InputError: the scene's RAO file is invalid.
    """
    riding, responses = scene.sea_state.on_waves or OnWaves(), vessel_raos(scene)
    if responses is None:
        return heave_response(riding.hull, frequency_hz)
    turned = np.full_like(frequency_hz, heading_rad - np.radians(riding.heading_deg))
    heave = moved_by(responses.at(frequency_hz, turned), arm_from_bow(scene))[2]
    x, y, _ = lever_arm(scene)  # RAOs lead the wave at the reference point, which is so far up-sea
    apart = x * np.cos(heading_rad) + y * np.sin(heading_rad)
    wave_number = (2.0 * np.pi * frequency_hz) ** 2 / GRAVITY
    return np.asarray(heave * np.exp(1j * wave_number * apart))


class LiveForecaster:
    """Forecasts what was heard; called by one thread."""

    def __init__(
        self,
        scene: Scene,
        limits: Limits,
        settings: ForecastSettings | None = None,
        wave_noise_m: float = 0.2,
        wave_heading_rad: float = 0.0,
    ) -> None:
        """Take a scene.

        wave_noise_m: standard deviation of measured elevations; wave_heading_rad: direction that
        their waves travel to, counter-clockwise from east.
        """
        self._scene, self._limits = scene, limits
        self.settings = settings or ForecastSettings(spread=unlearned_spread(scene.learning))
        self._wave_noise_m, self._wave_heading_rad = wave_noise_m, wave_heading_rad
        self._forecaster: TensionForecaster | None = None
        self._nominal: NominalRope | None = None
        self._begun_s = 0.0  # time of the nominal rope's beginning
        self._led: tuple[str, ...] = ()  # other winches whose line it follows
        self._depth_m = seabed_depth_m(scene)
        self.kept: KeptForecasts | None = None
        self._seen_s = self._last_s = -np.inf  # newest tension judged by, newest origin

    def waits_for(self, heard: Heard) -> str:
        """Return what is missing for a forecast, in words; "": nothing."""
        return self._missing(_sampled(heard))

    def _missing(self, own: _Samples | None) -> str:
        if own is None:
            return "heave, line out and tension"
        known = float(own.time_s[-1] - own.time_s[0])
        least = PAST_S + max(SHORTEST_RECORD_S - PAST_S, 0.0)
        return f"{least - known:.0f} s more of heave" if known < least + SAMPLE_S else ""

    def forecast(self, heard: Heard, now_s: Callable[[], float]) -> LiveForecast:
        """Return the forecast from the newest common instant of all series.

        now_s: the clock of the series, for the age of the inputs.

        Raises:
            InputError: too little was heard yet.
            RopeTwinError: the rope cannot be forecast.
        """
        own = _sampled(heard)  # once: the series grow, or begin again, meanwhile
        if words := self._missing(own):
            raise InputError("forecast", f"it waits for {words}", "wait")
        assert own is not None
        grid, heave, line, mean = own.time_s, own.heave_m, own.line_out_m, own.mean_n
        if grid[-1] < self._last_s:  # the clock went back: what is kept is of another run
            self._nominal = self.kept = None
            self._seen_s = -np.inf
            _forget_other_runs(heard.waves)
        self._last_s = float(grid[-1])
        if heard.figures is not None:
            self.settings = self.settings.with_figures(*heard.figures)
            if self._forecaster is not None:
                self._forecaster.settings = self.settings
        lost = self._nominal is None or grid[0] > self._begun_s + self._nominal.time_s
        if lost or tuple(own.lines_m) != self._led:
            self._begin(own)
        assert self._nominal is not None
        assert self._forecaster is not None
        assert self.kept is not None
        origin_s = float(grid[-1])
        self._nominal.follow(
            origin_s - self.settings.burn_in_s - self._begun_s,
            float(grid[0]) - self._begun_s, heave, line, own.lines_m,
        )  # fmt: skip
        for at, value in zip(grid, own.pin_n, strict=True):
            if self._seen_s < at <= own.pin_until_s:
                self.kept.see(float(at), float(value))
                self._seen_s = float(at)
        winch, is_on = self._scene.winch, heard.compensation_on
        waves = self._waves(heard, origin_s)
        response = None
        if waves is not None:
            frequency = heave_spectrum(heave).frequency_hz
            response = hang_off_response(self._scene, self._wave_heading_rad, frequency)
        known = Known(
            origin_s, heave, line, mean, waves, response,
            compensated=bool(winch and winch.heave_compensation) and is_on is not False,
            to_contact_m=line_to_contact_m(self._scene, float(line[-1])), lines_m=own.lines_m,
        )  # fmt: skip
        asked, heard.asked = heard.asked, ()
        possible, refused = self._possible(asked, known)
        made, *compared = self._forecaster.forecast(
            known, self._nominal.states()[0], (Order(CONTINUE), *possible), self.kept.factor()
        )
        self.kept.keep(made)
        return LiveForecast(
            made, tuple(risks(made, self._limits, self._depth_m)),
            tuple(quiet_windows(made, self._limits)), self.kept.coverage(), self.kept.judged,
            now_s() - origin_s, tuple(compared), refused,
        )  # fmt: skip

    def _possible(
        self, asked: Sequence[Order], known: Known
    ) -> tuple[list[Order], tuple[str, ...]]:
        """Return the orders that the scene can follow, and why it cannot follow the others."""
        assert self._forecaster is not None
        possible, refused = list[Order](), list[str]()
        now = self._forecaster.line_now(known)
        for order in asked:
            try:
                check_lift_order(order, self._scene, now)
                possible.append(order)
            except InputError as error:
                refused.append(str(error))
        return possible, tuple(refused)

    def _begin(self, own: _Samples) -> None:
        """Build the fleet for the present line out, and the nominal rope from rest."""
        led = {name: float(line_m[0]) for name, line_m in own.lines_m.items()}
        scene = scene_at_line(self._scene, float(own.line_out_m[0]), led)
        self._forecaster = TensionForecaster(scene, self.settings)
        self._nominal, self._led = NominalRope(scene, self.settings), tuple(led)
        self._begun_s, leads = float(own.time_s[0]), self._forecaster.leads
        if self.kept is None or not np.array_equal(self.kept.leads, leads):
            self.kept = KeptForecasts(leads)

    def _waves(self, heard: Heard, origin_s: float) -> MeasuredWaves | None:
        """Return the elevations of the last WAVES_S, thinned; None: too few."""
        rows = np.array(list(heard.waves.copy()), np.float64).reshape(-1, 3)
        rows = rows[(rows[:, 0] > origin_s - WAVES_S) & (rows[:, 0] <= origin_s + LARGEST_GAP_S)]
        kept, newest = [], dict[float, float]()
        for row in rows:
            if row[0] - newest.get(row[1], -np.inf) >= WAVES_EVERY_S - 1e-3:
                newest[row[1]] = row[0]
                kept.append(row)
        if len(kept) < LEAST_WAVES:
            return None
        table = np.array(kept[-MOST_WAVES:])
        height = table[:, 2] - table[:, 2].mean()
        return MeasuredWaves(table[:, 0] - origin_s, table[:, 1], height, self._wave_noise_m)


def _forget_other_runs(waves: deque[tuple[float, float, float]]) -> None:
    """Remove the waves from before their time went back; all if it has not."""
    times = np.array([row[0] for row in waves.copy()])
    back = np.flatnonzero(np.diff(times) < -LARGEST_GAP_S)
    for _ in range(int(back[-1]) + 1 if len(back) else len(times)):
        waves.popleft()


def _sampled(heard: Heard) -> _Samples | None:
    """Return all series at the instants that heave and line out span, or None if there are none.

    Tension may have gaps, in which it is NaN; it must have been heard at all.
    """
    heave, line = heard.heave_m.table(), heard.line_out_m.table()
    others = {name: one.table() for name, one in sorted(heard.lines_m.copy().items())}
    tension, spans = heard.tension_n.rows(), (heave, line, *others.values())
    if any(len(one) < 2 for one in spans) or not len(tension):
        return None
    first = np.ceil(max(one[0, 0] for one in spans) / SAMPLE_S)
    last = np.floor(min(one[-1, 0] for one in spans) / SAMPLE_S)
    if last <= first:
        return None
    grid: Floats = np.asarray(SAMPLE_S * np.arange(first, last + 1.0))
    summed = np.concatenate([[0.0], np.cumsum(tension[:, 1])])
    since, until = _before(tension, grid)
    with np.errstate(invalid="ignore"):
        mean = np.where(until > since, (summed[until] - summed[since]) / (until - since), np.nan)
    pin, pin_n = heard.pin_n.rows(), np.full(len(grid), np.nan)
    if len(pin):
        since, until = _before(pin, grid)
        pin_n = np.where(until > since, np.interp(grid, pin[:, 0], pin[:, 1]), np.nan)
    return _Samples(
        grid, np.interp(grid, heave[:, 0], heave[:, 1]), np.interp(grid, line[:, 0], line[:, 1]),
        mean, pin_n, float(pin[-1, 0]) if len(pin) else -np.inf,
        {name: np.interp(grid, one[:, 0], one[:, 1]) for name, one in others.items()},
    )  # fmt: skip


def _before(rows: Floats, grid: Floats) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return first and end of the rows in the SAMPLE_S up to each instant."""
    since = np.searchsorted(rows[:, 0], grid - SAMPLE_S, side="right")
    return since, np.searchsorted(rows[:, 0], grid, side="right")


def orders_of(made: LiveForecast, limits: Limits, seabed_m: float | None) -> list[Row]:
    """Return the rows of the orders that were asked for: risks, and change against the first."""
    rows = list[Row]()
    for forecast in made.orders:
        for one in risks(forecast, limits, seabed_m):
            for name, rope in forecast.hung.items():
                change = compare(forecast, made.orders[0], one.span_s, name)
                peaks = zip(band_columns("peak_change_n"), change.peak_n, strict=True)
                rows.append(
                    {"name": forecast.order, "span_s": one.span_s, "tension": one.tension,
                     "slack": one.slack, "contact": one.contact, "landing": one.landing,
                     "rope": rope.number, **dict(peaks), "lower": change.lower}
                )  # fmt: skip
    return rows


def _ropes_of(made: LiveForecast, limits: Limits) -> list[Row]:
    """Return the band of each rope from a hang-off at each lead, and its risk until then."""
    own, rows = made.forecast, list[Row]()
    for name, rope in own.hung.items():
        limit = limits.of(name)
        above = np.logical_or.accumulate(rope.peak_n > limit).mean(axis=1)
        bands = dict(zip(band_columns("top_tension_n"), rope.band(), strict=True))
        rows += [
            {"rope": rope.number, "lead_s": float(lead), "above": float(above[k]),
             "tension_limit_n": limit, "age_s": made.age_s,
             **{column: float(values[k]) for column, values in bands.items()}}
            for k, lead in enumerate(own.lead_s)
        ]  # fmt: skip
    return rows


def tables_of(made: LiveForecast, limits: Limits) -> dict[str, list[Row]]:
    """Return the rows of each topic of `messages.forecast` but those of orders."""
    own = made.forecast
    bands = {
        column: row
        for quantity in QUANTITIES
        for column, row in zip(band_columns(quantity), own.band(quantity), strict=True)
    }
    tension: list[Row] = [
        {"lead_s": float(lead), "heave_skill": float(own.heave_skill[k]), "age_s": made.age_s,
         "factor": float(own.factor[k]), **{name: float(row[k]) for name, row in bands.items()}}
        for k, lead in enumerate(own.lead_s)
    ]  # fmt: skip
    risk: list[Row] = [
        {"span_s": one.span_s, "tension": one.tension, "slack": one.slack, "contact": one.contact,
         "landing": one.landing, "tension_limit_n": limits.tension_n,
         "contact_limit_m_per_s": limits.contact_m_per_s, "horizon_s": own.horizon_s,
         "coverage": made.coverage, "judged": made.judged, "factor": float(own.factor.mean()),
         "age_s": made.age_s}
        for one in made.risks
    ]  # fmt: skip
    quiet: list[Row] = [
        {"begin_s": one.begin_s, "length_s": one.length_s, "probability": one.probability,
         "speed_limit_m_per_s": limits.quiet_m_per_s, "age_s": made.age_s}
        for one in made.quiet
    ]  # fmt: skip
    tables = {TENSION_TOPIC: tension, RISK_TOPIC: risk, QUIET_TOPIC: quiet}
    return tables | ({ROPES_TOPIC: _ropes_of(made, limits)} if own.others else {})


class ForecastWorker:
    """Thread that forecasts at most once in each interval."""

    def __init__(
        self,
        forecaster: LiveForecaster,
        heard: Heard,
        publish: Callable[[LiveForecast], None],
        now_s: Callable[[], float],
        interval_s: float = INTERVAL_S,
    ) -> None:
        """Prepare the thread; publish: called by it with each forecast."""
        self._forecaster, self._heard = forecaster, heard
        self._publish, self._now_s, self._interval_s = publish, now_s, interval_s
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="forecast", daemon=True)
        self.made = 0
        self._made_s = 0.0  # steady time of the newest forecast
        self.processor_s = 0.0  # CPU time of the thread
        self.waits = ""  # what is missing for a forecast, in words
        self.trouble = ""  # why there is no forecast though nothing is missing

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def state(self, steady_s: float) -> tuple[bool, str]:
        """Return whether forecasts come as they should, and what the thread does in words.

        Before the first one it may wait; later a forecast that is due and missing is a fault.
        steady_s: now, by time.monotonic.
        """
        late_s = steady_s - self._made_s
        due_s = max(LATE_S, LATE_INTERVALS * self._interval_s)
        late = self.made > 0 and late_s > due_s
        why = self.trouble or self._heard.doubt
        if not why and self.waits:
            why = f"waits for {self.waits}"
        if late:
            why = why or self._heard.silent() or "nothing new was heard"
            return False, f"no forecast for {late_s:.0f} s: {why}"
        return not (self.trouble or self._heard.doubt), why or "a forecast every second"

    def close(self) -> None:
        """End the thread after its present forecast."""
        self._closing.set()
        if self._thread.is_alive():
            self._thread.join()

    def _run(self) -> None:
        newest = -np.inf
        while not self._closing.is_set():
            began = time.monotonic()
            try:
                self.waits = self._forecaster.waits_for(self._heard)
                if not (self.waits or self._heard.doubt):
                    made = self._forecaster.forecast(self._heard, self._now_s)
                    if made.forecast.origin_s != newest:  # earlier ones too: the clock went back
                        newest = made.forecast.origin_s
                        self._publish(made)
                        self.made, self._made_s = self.made + 1, time.monotonic()
                    self.trouble = ""
            except RopeTwinError as error:
                self.trouble = str(error)
            except Exception as error:  # the run goes on, says why, and the next one is tried
                words = f"{type(error).__name__}: {error}"
                if words != self.trouble:
                    _log.exception("no forecast")
                self.trouble = words
            self.processor_s = time.thread_time()
            self._closing.wait(max(self._interval_s - (time.monotonic() - began), 0.05))


def usual_limits(scene: Scene, given: Sequence[float]) -> Limits:
    """Return the limits of risks.

    given: tension [N], contact speed and quiet speed [m/s], length of a quiet window [s]. A
    tension limit of 0 is that of the scene: its own, or its utilisation times the MBL of each rope.

    Raises:
        InputError: a limit that is not positive, or a window longer than the forecast allows.
    """
    tension_n, contact, quiet, length_s = given
    longest_s = AHEAD_S - max(BEGINS_S)
    if length_s > longest_s:
        remedy = f"give at most {longest_s:g} s, so that the latest window ends with the forecast"
        raise InputError("limit quiet_s", f"it is {length_s:g} s", remedy)
    own_n, others_n = tension_limits(scene, tension_n or None)
    return Limits(own_n, contact, quiet, length_s, others_n)
