"""Live forecasts: received inputs are stored, and a worker thread forecasts from them every second.

Callbacks only append to the series; the worker owns the fleet, the nominal rope (which follows the
measured motion one burn-in period behind the present) and the verification of past forecasts.
Nothing waits for the worker: if a forecast takes longer than its interval, the next one is late,
and its age shows it.
"""

from __future__ import annotations

import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field

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
    WINDOW_STARTS_S,
    ForecastVerification,
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
    Observations,
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
LATE_S, LATE_INTERVALS = 3.0, 2.0  # without a forecast after the last one, that give a warning
LARGEST_GAP_S = 2.0  # of a series that is bridged
WAVES_S = 240.0  # of elevations that a forecast uses
WAVES_EVERY_S = 1.0  # apart, for each place
MAX_WAVES = 480
MIN_WAVES = 30
KEPT_S = RECORD_S + 20.0

_log = logging.getLogger(__name__)


class Series:
    """Times and values of one quantity, of the last KEPT_S; appended by one thread."""

    def __init__(self) -> None:
        self._rows: deque[tuple[float, float]] = deque()

    def add(self, time_s: float, value: float, reach: float = np.inf) -> None:
        """Append a value; values that are not finite or not later than the last are ignored.

        A time far before the last one belongs to another run: the series is cleared. So it is by a
        change of more than `reach`: a counter that was reset, or another sender.
        """
        if not np.isfinite(value):
            return
        if self._rows and time_s <= self._rows[-1][0]:
            if time_s > self._rows[-1][0] - LARGEST_GAP_S:
                return
            self._rows.clear()
        if self._rows and abs(value - self._rows[-1][1]) > reach:
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
        """Time of the newest value; -inf if there is none."""
        rows = self._rows.copy()
        return rows[-1][0] if rows else -np.inf

    def rows(self) -> Floats:
        """Return all stored times and values, (n, 2)."""
        return np.array(list(self._rows.copy()), np.float64).reshape(-1, 2)

    def table(self) -> Floats:
        """Return times and values after the last gap, (n, 2)."""
        rows = self.rows()
        gaps = np.flatnonzero(np.diff(rows[:, 0]) > LARGEST_GAP_S)
        return rows[gaps[-1] + 1 :] if len(gaps) else rows


@dataclass
class LiveInputs:
    """Received inputs of a live lift; all times are of one clock [s]."""

    heave_m: Series = field(default_factory=Series)
    line_out_m: Series = field(default_factory=Series)  # of the main winch
    lines_m: dict[str, Series] = field(default_factory=dict)  # of other winches, if received
    tension_n: Series = field(default_factory=Series)
    waves: deque[tuple[float, float, float]] = field(
        default_factory=lambda: deque(maxlen=20_000)
    )  # time, distance up-sea, elevation
    compensation_on: bool | None = None  # None: not received, as when the run began
    pin_n: Series = field(default_factory=Series)  # measured tension; verifies forecasts
    # mean and standard deviation of the logarithms of learned figures; None: none learned
    figures: tuple[Mapping[str, float], Mapping[str, float]] | None = None
    asked: tuple[Order, ...] = ()  # orders for the next forecast to compare
    doubt: str = ""  # why the heave is not valid at present: no forecast is made from it

    def clear(self) -> None:
        """Discard all inputs, as after a pause."""
        self.heave_m, self.line_out_m, self.tension_n = Series(), Series(), Series()
        self.pin_n, self.lines_m = Series(), {}
        self.waves.clear()
        self.compensation_on = None

    def silent(self) -> str:
        """Return in words which of heave and line out has stopped; "": none has."""
        names = {"heave": self.heave_m, "line out": self.line_out_m}
        names |= {f"line out of {name}": series for name, series in self.lines_m.copy().items()}
        newest = {name: series.newest_s for name, series in names.items()}
        earliest = min(newest, key=lambda name: newest[name])
        behind_s = max(newest.values()) - newest[earliest]
        return f"no {earliest} for {behind_s:.0f} s" if behind_s > LARGEST_GAP_S else ""


@dataclass(frozen=True)
class _Samples:
    """All series resampled every SAMPLE_S over the common span of heave and line out."""

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
    coverage: float  # of past bands; NaN: not yet known
    judged: int  # number of forecasts that it is from
    age_s: float  # of the newest input when the forecast was ready
    orders: tuple[TensionForecast, ...] = ()  # compared on request, with the same heave
    refused: tuple[str, ...] = ()  # orders that the scene cannot follow, a sentence each
    pin_fault: str = ""  # why it leaves the load pin out


def hang_off_response(scene: Scene, heading_rad: float, frequency_hz: Floats) -> Response:
    """Return the hang-off's heave per elevation of the waves there, for exp(+iωt), (n,).

    By the RAOs of the scene's ship, moved rigidly to the hang-off; without any by its box-like hull
    in head seas. heading_rad: direction that the waves travel to, counter-clockwise from east; they
    are those of deep water, k = ω²/g.

    Raises:
        InputError: the scene's RAO file is invalid.
    """
    on_waves, responses = scene.sea_state.on_waves or OnWaves(), vessel_raos(scene)
    if responses is None:
        return heave_response(on_waves.hull, frequency_hz)
    relative_rad = np.full_like(frequency_hz, heading_rad - np.radians(on_waves.heading_deg))
    heave = moved_by(responses.at(frequency_hz, relative_rad), arm_from_bow(scene))[2]
    x, y, _ = lever_arm(scene)  # RAOs lead the wave at the reference point, which is so far up-sea
    up_sea_m = x * np.cos(heading_rad) + y * np.sin(heading_rad)
    wave_number = (2.0 * np.pi * frequency_hz) ** 2 / GRAVITY
    return np.asarray(heave * np.exp(1j * wave_number * up_sea_m))


class LiveForecaster:
    """Forecasts from received inputs; called by one thread."""

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
        self._begin_s = 0.0  # start time of the nominal rope
        self._followed_winches: tuple[
            str, ...
        ] = ()  # other winches whose line the nominal rope follows
        self._depth_m = seabed_depth_m(scene)
        self.verification: ForecastVerification | None = None
        self._seen_s = self._last_s = -np.inf  # newest tension judged by, newest origin

    def missing_inputs(self, inputs: LiveInputs) -> str:
        """Return in words which inputs are missing for a forecast; "": none."""
        return self._missing(_resampled(inputs))

    def _missing(self, samples: _Samples | None) -> str:
        if samples is None:
            return "heave, line out and tension"
        record_s = float(samples.time_s[-1] - samples.time_s[0])
        min_s = PAST_S + max(SHORTEST_RECORD_S - PAST_S, 0.0)
        return f"{min_s - record_s:.0f} s more of heave" if record_s < min_s + SAMPLE_S else ""

    def forecast(self, inputs: LiveInputs, now_s: Callable[[], float]) -> LiveForecast:
        """Return the forecast from the newest common instant of all series.

        now_s: the clock of the series, for the age of the inputs.

        Raises:
            InputError: too few inputs were received.
            RopeTwinError: the rope cannot be forecast.
        """
        samples = _resampled(inputs)  # once: the series may grow or be cleared meanwhile
        if missing := self._missing(samples):
            raise InputError("forecast", f"it waits for {missing}", "wait")
        assert samples is not None
        grid, heave, line, mean = (
            samples.time_s,
            samples.heave_m,
            samples.line_out_m,
            samples.mean_n,
        )
        if grid[-1] < self._last_s:  # the clock went back: the past forecasts are of another run
            self._nominal = self.verification = None
            self._seen_s = -np.inf
            _forget_other_runs(inputs.waves)
        self._last_s = float(grid[-1])
        if inputs.figures is not None:
            self.settings = self.settings.with_figures(*inputs.figures)
            if self._forecaster is not None:
                self._forecaster.settings = self.settings
        restart = self._nominal is None or grid[0] > self._begin_s + self._nominal.time_s
        if restart or tuple(samples.lines_m) != self._followed_winches:
            self._begin(samples)
        assert self._nominal is not None
        assert self._forecaster is not None
        assert self.verification is not None
        origin_s = float(grid[-1])
        self._nominal.follow(
            origin_s - self.settings.burn_in_s - self._begin_s,
            float(grid[0]) - self._begin_s, heave, line, samples.lines_m,
        )  # fmt: skip
        for at, value in zip(grid, samples.pin_n, strict=True):
            if self._seen_s < at <= samples.pin_until_s:
                self.verification.observe(float(at), float(value))
                self._seen_s = float(at)
        winch, compensation_on = self._scene.winch, inputs.compensation_on
        waves = self._waves(inputs, origin_s)
        response = None
        if waves is not None:
            frequency = heave_spectrum(heave).frequency_hz
            response = hang_off_response(self._scene, self._wave_heading_rad, frequency)
        observed = Observations(
            origin_s, heave, line, mean, waves, response,
            compensated=bool(winch and winch.heave_compensation) and compensation_on is not False,
            to_contact_m=line_to_contact_m(self._scene, float(line[-1])), lines_m=samples.lines_m,
        )  # fmt: skip
        asked, inputs.asked = inputs.asked, ()
        possible, refused = self._possible(asked, observed)
        current, *compared = self._forecaster.forecast(
            observed,
            self._nominal.states()[0],
            (Order(CONTINUE), *possible),
            self.verification.factor(),
        )
        self.verification.add(current)
        return LiveForecast(
            current, tuple(risks(current, self._limits, self._depth_m)),
            tuple(quiet_windows(current, self._limits)), self.verification.coverage(),
            self.verification.judged, now_s() - origin_s, tuple(compared), refused,
            self._forecaster.pin_fault,
        )  # fmt: skip

    def _possible(
        self, asked: Sequence[Order], observed: Observations
    ) -> tuple[list[Order], tuple[str, ...]]:
        """Return the orders that the scene can follow, and why it cannot follow the others."""
        assert self._forecaster is not None
        possible, refused = list[Order](), list[str]()
        line = self._forecaster.line_state(observed)
        for order in asked:
            try:
                check_lift_order(order, self._scene, line)
                possible.append(order)
            except InputError as error:
                refused.append(str(error))
        return possible, tuple(refused)

    def _begin(self, samples: _Samples) -> None:
        """Build the fleet for the present line out, and the nominal rope in static equilibrium."""
        other_lines = {name: float(line_m[0]) for name, line_m in samples.lines_m.items()}
        scene = scene_at_line(self._scene, float(samples.line_out_m[0]), other_lines)
        self._forecaster = TensionForecaster(scene, self.settings)
        self._nominal, self._followed_winches = (
            NominalRope(scene, self.settings),
            tuple(other_lines),
        )
        self._begin_s, leads = float(samples.time_s[0]), self._forecaster.leads
        if self.verification is None or not np.array_equal(self.verification.leads, leads):
            self.verification = ForecastVerification(leads)

    def _waves(self, inputs: LiveInputs, origin_s: float) -> MeasuredWaves | None:
        """Return the elevations of the last WAVES_S, thinned out; None if they are too few."""
        rows = np.array(list(inputs.waves.copy()), np.float64).reshape(-1, 3)
        rows = rows[(rows[:, 0] > origin_s - WAVES_S) & (rows[:, 0] <= origin_s + LARGEST_GAP_S)]
        thinned, newest = [], dict[float, float]()
        for row in rows:
            if row[0] - newest.get(row[1], -np.inf) >= WAVES_EVERY_S - 1e-3:
                newest[row[1]] = row[0]
                thinned.append(row)
        if len(thinned) < MIN_WAVES:
            return None
        table = np.array(thinned[-MAX_WAVES:])
        height = table[:, 2] - table[:, 2].mean()
        return MeasuredWaves(table[:, 0] - origin_s, table[:, 1], height, self._wave_noise_m)


def _forget_other_runs(waves: deque[tuple[float, float, float]]) -> None:
    """Remove the waves from before the last backward jump in time; all if there is none."""
    times = np.array([row[0] for row in waves.copy()])
    restarts = np.flatnonzero(np.diff(times) < -LARGEST_GAP_S)
    for _ in range(int(restarts[-1]) + 1 if len(restarts) else len(times)):
        waves.popleft()


def _resampled(inputs: LiveInputs) -> _Samples | None:
    """Return all series resampled over the common span of heave and line out; None without one.

    Tension is NaN in gaps; at least one value must have been received.
    """
    heave, line = inputs.heave_m.table(), inputs.line_out_m.table()
    others = {name: series.table() for name, series in sorted(inputs.lines_m.copy().items())}
    tension, spans = inputs.tension_n.rows(), (heave, line, *others.values())
    if any(len(series) < 2 for series in spans) or not len(tension):
        return None
    first = np.ceil(max(series[0, 0] for series in spans) / SAMPLE_S)
    last = np.floor(min(series[-1, 0] for series in spans) / SAMPLE_S)
    if last <= first:
        return None
    grid: Floats = np.asarray(SAMPLE_S * np.arange(first, last + 1.0))
    summed = np.concatenate([[0.0], np.cumsum(tension[:, 1])])
    begin, end = _before(tension, grid)
    with np.errstate(invalid="ignore"):
        mean = np.where(end > begin, (summed[end] - summed[begin]) / (end - begin), np.nan)
    pin, pin_n = inputs.pin_n.rows(), np.full(len(grid), np.nan)
    if len(pin):
        begin, end = _before(pin, grid)
        pin_n = np.where(end > begin, np.interp(grid, pin[:, 0], pin[:, 1]), np.nan)
    return _Samples(
        grid, np.interp(grid, heave[:, 0], heave[:, 1]), np.interp(grid, line[:, 0], line[:, 1]),
        mean, pin_n, float(pin[-1, 0]) if len(pin) else -np.inf,
        {name: np.interp(grid, series[:, 0], series[:, 1]) for name, series in others.items()},
    )  # fmt: skip


def _before(rows: Floats, grid: Floats) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return begin and end index of the rows in the SAMPLE_S before each instant."""
    begin = np.searchsorted(rows[:, 0], grid - SAMPLE_S, side="right")
    return begin, np.searchsorted(rows[:, 0], grid, side="right")


def order_rows(forecasts: LiveForecast, limits: Limits, seabed_m: float | None) -> list[Row]:
    """Return the rows of the compared orders: risks, and change against the first order."""
    rows = list[Row]()
    for forecast in forecasts.orders:
        for risk in risks(forecast, limits, seabed_m):
            for name, rope in forecast.suspended.items():
                change = compare(forecast, forecasts.orders[0], risk.span_s, name)
                peaks = zip(band_columns("peak_change_n"), change.peak_n, strict=True)
                rows.append(
                    {"name": forecast.order, **asdict(risk), "rope": rope.number, **dict(peaks),
                     "lower": change.lower}
                )  # fmt: skip
    return rows


def _ropes_of(forecasts: LiveForecast, limits: Limits) -> list[Row]:
    """Return the band of each rope from a hang-off at each lead, and its risk until then."""
    forecast, rows = forecasts.forecast, list[Row]()
    for name, rope in forecast.suspended.items():
        limit = limits.of(name)
        above = np.logical_or.accumulate(rope.peak_n > limit).mean(axis=1)
        bands = dict(zip(band_columns("top_tension_n"), rope.band(), strict=True))
        rows += [
            {"rope": rope.number, "lead_s": float(lead), "above": float(above[k]),
             "tension_limit_n": limit, "age_s": forecasts.age_s,
             **{column: float(values[k]) for column, values in bands.items()}}
            for k, lead in enumerate(forecast.lead_s)
        ]  # fmt: skip
    return rows


def forecast_rows(forecasts: LiveForecast, limits: Limits) -> dict[str, list[Row]]:
    """Return the rows of each forecast topic, without those of orders."""
    forecast = forecasts.forecast
    bands = {
        column: row
        for quantity in QUANTITIES
        for column, row in zip(band_columns(quantity), forecast.band(quantity), strict=True)
    }
    tension: list[Row] = [
        {"lead_s": float(lead), "heave_skill": float(forecast.heave_skill[k]),
         "age_s": forecasts.age_s, "factor": float(forecast.factor[k]),
         **{name: float(row[k]) for name, row in bands.items()}}
        for k, lead in enumerate(forecast.lead_s)
    ]  # fmt: skip
    risk_rows: list[Row] = [
        {**asdict(risk), "tension_limit_n": limits.tension_n,
         "contact_limit_m_per_s": limits.contact_m_per_s, "horizon_s": forecast.horizon_s,
         "coverage": forecasts.coverage, "judged": forecasts.judged,
         "factor": float(forecast.factor.mean()), "age_s": forecasts.age_s}
        for risk in forecasts.risks
    ]  # fmt: skip
    quiet: list[Row] = [
        {**asdict(window), "speed_limit_m_per_s": limits.quiet_m_per_s, "age_s": forecasts.age_s}
        for window in forecasts.quiet
    ]  # fmt: skip
    tables = {TENSION_TOPIC: tension, RISK_TOPIC: risk_rows, QUIET_TOPIC: quiet}
    return tables | ({ROPES_TOPIC: _ropes_of(forecasts, limits)} if forecast.others else {})


class ForecastWorker:
    """Thread that forecasts at most once in each interval."""

    def __init__(
        self,
        forecaster: LiveForecaster,
        inputs: LiveInputs,
        publish: Callable[[LiveForecast], None],
        now_s: Callable[[], float],
        interval_s: float = INTERVAL_S,
    ) -> None:
        """Prepare the thread; publish: called by it with each forecast."""
        self._forecaster, self._inputs = forecaster, inputs
        self._publish, self._now_s, self._interval_s = publish, now_s, interval_s
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="forecast", daemon=True)
        self.made = 0
        self._made_s = 0.0  # steady time of the newest forecast
        self.processor_s = 0.0  # CPU time of the thread
        self.waits = ""  # inputs missing for a forecast, in words
        self.trouble = ""  # why no forecast is made though all inputs are there
        self.pin_fault = ""  # why the newest forecast leaves the load pin out

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def state(self, steady_s: float) -> tuple[bool, str]:
        """Return whether forecasts are made on time, and the state of the thread in words.

        Before the first forecast it may wait; later a forecast that is overdue is a fault.
        steady_s: now, by time.monotonic.
        """
        late_s = steady_s - self._made_s
        due_s = max(LATE_S, LATE_INTERVALS * self._interval_s)
        is_late = self.made > 0 and late_s > due_s
        reason = self.trouble or self._inputs.doubt
        if not reason and self.waits:
            reason = f"waits for {self.waits}"
        if is_late:
            reason = reason or self._inputs.silent() or "nothing new was heard"
            return False, f"no forecast for {late_s:.0f} s: {reason}"
        reason = reason or self.pin_fault
        is_good = not (self.trouble or self._inputs.doubt or self.pin_fault)
        return is_good, reason or "a forecast every second"

    def close(self) -> None:
        """Stop the thread after its present forecast."""
        self._closing.set()
        if self._thread.is_alive():
            self._thread.join()

    def _run(self) -> None:
        newest = -np.inf
        while not self._closing.is_set():
            started = time.monotonic()
            try:
                self.waits = self._forecaster.missing_inputs(self._inputs)
                if not (self.waits or self._inputs.doubt):
                    forecasts = self._forecaster.forecast(self._inputs, self._now_s)
                    if (
                        forecasts.forecast.origin_s != newest
                    ):  # earlier ones too: the clock went back
                        newest, self.pin_fault = forecasts.forecast.origin_s, forecasts.pin_fault
                        self._publish(forecasts)
                        self.made, self._made_s = self.made + 1, time.monotonic()
                    self.trouble = ""
            except RopeTwinError as error:
                self.trouble = str(error)
            except Exception as error:  # the run goes on, says why, and the next one is tried
                reason = f"{type(error).__name__}: {error}"
                if reason != self.trouble:
                    _log.exception("no forecast")
                self.trouble = reason
            self.processor_s = time.thread_time()
            self._closing.wait(max(self._interval_s - (time.monotonic() - started), 0.05))


def read_limits(scene: Scene, values: Sequence[float]) -> Limits:
    """Return the limits of risks.

    given: tension [N], contact speed and quiet speed [m/s], length of a quiet window [s]. A
    tension limit of 0 means the limit of the scene: its tension, or its utilisation times the MBL.

    Raises:
        InputError: a limit that is not positive, or a window longer than the forecast allows.
    """
    tension_n, contact, quiet_speed, length_s = values
    longest_s = AHEAD_S - max(WINDOW_STARTS_S)
    if length_s > longest_s:
        remedy = f"give at most {longest_s:g} s, so that the latest window ends with the forecast"
        raise InputError("limit quiet_s", f"it is {length_s:g} s", remedy)
    own_n, others_n = tension_limits(scene, tension_n or None)
    return Limits(own_n, contact, quiet_speed, length_s, others_n)
