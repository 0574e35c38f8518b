"""Tension of the next minute from an ensemble, each member with its own heave and properties.

At the origin the true heave of the last two minutes and of the next one is drawn jointly for each
member (`heave_process`), with properties (weight, mass, drag, stiffness, ...) from their spread.
The members are integrated over the past, which spreads them by the effect of the motion sensor's
error, and on into the future. The load-pin readings of the last 40 s shift the members (ensemble
smoother, Evensen 2003): with predicted past readings Y, readings y and noise σ,

    T ← T + e^(-(t/τ)²)·(T - mean)·W,  W = Uᵀ-space gain s/(1 + s²) of (Y - mean)/(√(n - 1)·σ),

faded over the lead t, because spurious correlations of a finite ensemble carry past noise into long
leads. The spread of the members is scaled by a factor per lead that follows from the coverage of
earlier bands (`risk`). Beyond about 20 s the band is the climatology of this sea for this rope.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from rope_twin.core import state as rows
from rope_twin.errors import InputError, SolverError
from rope_twin.forecast.admission import pin_fault
from rope_twin.forecast.heave_process import (
    AHEAD_S,
    PAST_S,
    SAMPLE_S,
    HeavePaths,
    HeaveProcess,
    MeasuredWaves,
    MotionError,
    Response,
)
from rope_twin.forecast.orders import (
    COMPENSATION,
    CONTINUE,
    WITH_SPEED,
    LinePath,
    Lines,
    LineState,
    Order,
    check_lift_order,
    compensation_path,
    line_path,
    other_winches,
    winch_directions,
)
from rope_twin.forecast.score import member_quantiles
from rope_twin.scene.instruments import Learning
from rope_twin.scene.schema import WINCH, Scene, Winch
from rope_twin.twin.ensemble.fleet import (
    FIGURES,
    Fleet,
    FleetInputs,
    FleetRecord,
    FleetState,
    LiveState,
)

Floats = NDArray[np.float64]

TENSION, BOTTOM, DEPTH, SPEED, MARGIN = (
    "top_tension_n", "payload_tension_n", "payload_depth_m", "payload_speed_m_per_s",
    "slack_margin_n",
)  # fmt: skip
QUANTITIES = (TENSION, BOTTOM, DEPTH, SPEED, MARGIN)
# standard deviations of the figures' logarithms, after some minutes of learning with a tared
# load pin; figures that are not learned have a wider one
LEARNED_SPREAD: Mapping[str, float] = {
    "submerged_weight": 0.005, "oscillating_mass": 0.02, "payload_drag": 0.06,
    "axial_stiffness": 0.018, "axial_damping": 0.2, "tangential_drag": 0.12,
}  # fmt: skip
MAX_SPREAD = 2.0  # as the section `learning` of a scene allows
# of the coloured error assumed, flat over its whole band, over that of a sensor from 8 to 30 s
ERROR_MARGIN = 1.6
PIN_S = 40.0  # of load pin readings that shift the members
PIN_FACTOR = 3.0  # on its noise, for the error of the rope model
FADING_S = 8.0  # of the shift over the lead
LINE_SPEED_S = 3.0  # of line out whose least-squares slope is its speed at the origin
JOIN_S = 5.0  # over which a member blends from the measured heave to its own
MIN_MEMBERS = 19  # for a 90 % band by ranks
CLIMATOLOGY_SKILL = 0.5  # of heave below which a lead is called climatology


@dataclass(frozen=True)
class ForecastSettings:
    """Size of a forecast, and the errors of the sensors."""

    members: int = 48
    elements: int = 20
    step_s: float = 0.05
    burn_in_s: float = 60.0  # of the members through the past; at most 2 min
    motion_error: MotionError = field(default_factory=MotionError)
    load_pin_deviation_n: float = 1200.0  # of a mean over SAMPLE_S
    spread: Mapping[str, float] = field(default_factory=lambda: dict(LEARNED_SPREAD))
    mean: Mapping[str, float] = field(default_factory=dict)  # of logarithms; absent: the scene's, 0
    fading_s: float = FADING_S
    seed: int = 1

    def __post_init__(self) -> None:
        """Check the numbers.

        Raises:
            InputError: too few members, a burn-in beyond the known past, or an invalid spread.
        """
        if self.members < MIN_MEMBERS:
            remedy = f"a 90 % band needs {MIN_MEMBERS}"
            raise InputError("forecast", f"{self.members} members", remedy)
        if not JOIN_S < self.burn_in_s < PAST_S:
            remedy = f"right is more than {JOIN_S:g} s and less than {PAST_S:g} s"
            raise InputError("forecast", f"a burn-in of {self.burn_in_s:g} s", remedy)
        if not (self.load_pin_deviation_n > 0.0 and self.fading_s > 0.0):
            problem = f"load pin {self.load_pin_deviation_n:g} N, fading {self.fading_s:g} s"
            raise InputError("forecast", problem, "give positive numbers")
        for name, value in self.spread.items():
            if name not in FIGURES or not 0.0 <= value <= MAX_SPREAD:
                remedy = f"give 0 to {MAX_SPREAD:g} for {', '.join(FIGURES)}"
                raise InputError("forecast", f"the spread of {name} is {value:g}", remedy)
        for name, value in self.mean.items():
            if name not in FIGURES or not math.isfinite(value):
                problem = f"the mean logarithm of {name} is {value:g}"
                raise InputError(
                    "forecast", problem, f"give a finite number for {', '.join(FIGURES)}"
                )

    def with_figures(self, mean: Mapping[str, float], spread: Mapping[str, float]) -> Self:
        """Return settings with these means and standard deviations of the figures' logarithms.

        Figures that are not named, and names that are no figure of a fleet, are left out.

        Raises:
            InputError: a number is not possible.
        """
        return replace(
            self, mean={name: mean[name] for name in FIGURES if name in mean},
            spread={name: spread[name] for name in FIGURES if name in spread},
        )  # fmt: skip


def unlearned_spread(learning: Learning) -> dict[str, float]:
    """Return the spread of the figures before anything is learned, by a scene's `learning`."""
    return {name: 0.01 * getattr(learning, f"{name}_pct") for name in LEARNED_SPREAD}


@dataclass(frozen=True)
class Observations:
    """Measurements up to the origin, every SAMPLE_S, the newest last."""

    time_s: float  # of the newest sample, the origin
    heave_m: Floats  # (n,) of the hang-off by the motion sensor, at least 2 min
    line_out_m: Floats  # (n,) of the main winch
    tension_n: Floats | None = (
        None  # (n,) of its rope: means of the load pin over SAMPLE_S; NaN: missing
    )
    waves: MeasuredWaves | None = None
    response: Response | None = None  # heave per elevation, with `waves`
    compensated: bool = False  # active heave compensation is on
    to_contact_m: float | None = None  # line until the payload lands
    lines_m: Lines = field(default_factory=dict)  # (n,) of other winches; one not named holds

    def __post_init__(self) -> None:
        """Check lengths and values. Raises InputError: rows of different lengths, or not finite."""
        for line_m in (self.line_out_m, *self.lines_m.values()):
            if len(line_m) != len(self.heave_m):
                problem = f"{len(self.heave_m)} samples of heave, {len(line_m)} of line out"
                raise InputError("forecast", problem, "give as many of each")
            if not np.isfinite(line_m).all():
                raise InputError("line out", "it has gaps", "fill them before")
        if self.tension_n is not None and len(self.tension_n) != len(self.heave_m):
            problem = f"{len(self.tension_n)} samples of tension, {len(self.heave_m)} of heave"
            raise InputError("forecast", problem, "give as many of each")


@dataclass(frozen=True)
class SuspendedRope:
    """Top tension of a rope from a hang-off."""

    values: Floats  # at each lead, (leads, members)
    peak_n: Floats  # largest of the SAMPLE_S up to each lead, (leads, members)
    number: int = 0  # of the rope in the scene

    def band(self) -> Floats:
        """Return the 5, 50 and 95 % quantiles, (3, leads)."""
        return member_quantiles(self.values)


@dataclass(frozen=True)
class TensionForecast:
    """Members of one forecast under one order; leads are SAMPLE_S apart."""

    origin_s: float
    order: str
    lead_s: Floats  # (leads,)
    values: Mapping[str, Floats]  # of QUANTITIES, (leads, members), at each lead; top tension is
    # that of the main winch's rope, slack margin of all ropes
    at_origin: Mapping[str, Floats]  # depth and vertical speed of the payload, (members,)
    peak_n: Floats  # largest top tension of the SAMPLE_S up to each lead, (leads, members)
    heave_skill: Floats  # expected skill of the heave, (leads,)
    factor: Floats  # on the spread of the members, (leads,)
    note: str = ""
    # of ropes from a hang-off other than the main winch's, by name
    others: Mapping[str, SuspendedRope] = field(default_factory=dict)
    rope: str = ""  # name of the main winch's rope

    @property
    def members(self) -> int:
        """Number of members."""
        return int(self.peak_n.shape[1])

    def band(self, quantity: str = TENSION) -> Floats:
        """Return the 5, 50 and 95 % quantiles of a quantity, (3, leads)."""
        return member_quantiles(self.values[quantity])

    @property
    def suspended(self) -> dict[str, SuspendedRope]:
        """Each rope from a hang-off by name, that of the main winch first."""
        return {self.rope: SuspendedRope(self.values[TENSION], self.peak_n), **self.others}

    @property
    def horizon_s(self) -> float:
        """Lead up to which heave is known better than its climatology.

        The largest lead at which the expected skill of the heave is CLIMATOLOGY_SKILL.
        """
        predictable = np.flatnonzero(self.heave_skill >= CLIMATOLOGY_SKILL)
        return float(self.lead_s[predictable[-1]]) if len(predictable) else 0.0


def smoother_gain(predicted: Floats, readings: Floats, deviation: float, noise: Floats) -> Floats:
    """Return the weights W by which members follow readings, (members, members).

    A quantity x of the members, (..., members), becomes x + (x - mean)·W.

    predicted: what each member would have read, (readings, members); readings: (readings,);
    deviation: standard deviation of a reading; noise: normal draws of it, (readings, members), by
    which members keep their spread (Burgers, van Leeuwen and Evensen 1998).
    """
    members = predicted.shape[1]
    anomalies = (predicted - predicted.mean(axis=1, keepdims=True)).T / math.sqrt(members - 1.0)
    u, singular, vt = np.linalg.svd(anomalies / deviation, full_matrices=False)
    innovation = ((readings[:, None] + noise - predicted) / deviation).T
    weights = (
        (innovation @ vt.T * (singular / (1.0 + singular**2))) @ u.T / math.sqrt(members - 1.0)
    )
    return np.asarray(weights.T)


class TensionForecaster:
    """Forecasts the suspended lines of a scene repeatedly, on a fleet of its own."""

    def __init__(self, scene: Scene, settings: ForecastSettings | None = None) -> None:
        """Build the fleet.

        Raises:
            InputError: a scene that fleets do not step, or settings that are not possible.
            SceneError: the scene cannot be built, or has no static equilibrium.
        """
        chosen = self.settings = settings or ForecastSettings()
        self.scene = scene
        self.fleet = Fleet(scene, chosen.members, elements=chosen.elements, step_s=chosen.step_s)
        self._winches, self._directions = other_winches(scene), winch_directions(scene)
        self._steps = round(SAMPLE_S / chosen.step_s)
        if self._steps < 1 or abs(self._steps * chosen.step_s - SAMPLE_S) > 1e-9:
            problem = f"a step of {chosen.step_s:g} s"
            raise InputError("forecast", problem, f"give a whole part of {SAMPLE_S:g} s")
        self._random = np.random.default_rng(chosen.seed)
        self.pin_fault = ""  # why the newest forecast leaves the load pin out
        self.leads: Floats = np.asarray(
            SAMPLE_S * np.arange(1, round(AHEAD_S / SAMPLE_S) + 1, dtype=np.float64)
        )

    def forecast(
        self,
        observed: Observations,
        start: FleetState | LiveState,
        orders: Sequence[Order] = (Order(CONTINUE),),
        factor: Floats | None = None,
        plans: Mapping[str, LinePath] | None = None,
    ) -> list[TensionForecast]:
        """Return a forecast for each order, all on the same heave paths, member by member.

        Args:
            observed: measurements up to the origin.
            start: state of the rope `burn_in_s` before the origin, on measured heave.
            orders: winch orders from the origin on; see `forecast.orders`.
            factor: on the spread of top tension at each lead; None: 1.
            plans: line out of winches from the origin on at every step, by name, in place of
                `continue`.

        Raises:
            InputError: too little is known, or an order that the scene cannot follow.
            SolverError: fewer than MIN_MEMBERS members stayed finite.
        """
        line_states = self._line_states(observed, start)
        for order in orders:
            check_lift_order(order, self.scene, line_states[WINCH])
        lines = [self._lines(order, line_states, plans or {}) for order in orders]
        heave = observed.heave_m - observed.heave_m.mean()
        process = HeaveProcess.of_record(heave, self.settings.motion_error)
        paths = process.paths(heave, observed.waves, observed.response).for_unknown_spectrum()
        motion = self._motion(observed, paths)
        self._draw_figures()
        past, states = self._run_past(observed, motion, start)
        weights = self._pin_weights(observed, past)
        records: list[FleetRecord] = []
        for order, line in zip(orders, lines, strict=True):
            if records:
                self.fleet.restore(states)
            records.append(self._run_future(motion, order, line, line_states))
        is_finite = self._finite_members(records)
        return [
            self._forecast(
                observed,
                paths,
                order,
                line[order.winch or WINCH].note,
                past,
                record,
                is_finite,
                weights,
                factor,
            )
            for order, line, record in zip(orders, lines, records, strict=True)
        ]

    def _finite_members(self, records: Sequence[FleetRecord]) -> NDArray[np.bool_]:
        """Return which members stayed finite under every order. Raises SolverError: too few."""
        is_finite = np.all(
            [np.isfinite(record.top_tension_n).all(axis=0) for record in records], axis=0
        )
        if int(is_finite.sum()) < MIN_MEMBERS:
            reason = next(
                (failure for record in records for failure in record.failures.values()),
                "no reason is known",
            )
            count = int((~is_finite).sum())
            problem = f"{count} of {len(is_finite)} members failed ({reason.rstrip('.')})"
            raise SolverError(
                "forecast", problem, "check the scene at this line out and in this sea"
            )
        return np.asarray(is_finite)

    def _motion(self, observed: Observations, paths: HeavePaths) -> tuple[Floats, Floats]:
        """Return heave [m] and rate [m/s] at the borders from the burn-in on, (borders, members).

        A member starts with the measured heave of its initial state and blends to its own.
        """
        from scipy.interpolate import CubicSpline  # slow to import

        settings = self.settings
        drawn = paths.draw(settings.members, self._random) + observed.heave_m.mean()
        spline = CubicSpline(paths.lead_s, drawn, axis=1)
        count = round((settings.burn_in_s + AHEAD_S) / settings.step_s) + 1
        times = settings.step_s * np.arange(count) - settings.burn_in_s
        z, v = spline(times).T, spline(times, 1).T
        past = min(len(observed.heave_m), round(PAST_S / SAMPLE_S))
        measured_m = CubicSpline(SAMPLE_S * np.arange(1 - past, 1), observed.heave_m[-past:])
        blended = times < JOIN_S - settings.burn_in_s
        progress = (times[blended] + settings.burn_in_s) / JOIN_S
        weight = (0.5 - 0.5 * np.cos(np.pi * progress))[:, None]
        slope = (0.5 * np.pi / JOIN_S * np.sin(np.pi * progress))[:, None]
        base, base_rate = (
            measured_m(times[blended])[:, None],
            measured_m(times[blended], 1)[:, None],
        )
        v[blended] = base_rate + weight * (v[blended] - base_rate) + slope * (z[blended] - base)
        z[blended] = base + weight * (z[blended] - base)
        return np.ascontiguousarray(z), np.ascontiguousarray(v)

    def _draw_figures(self) -> None:
        """Set the figures of all members, drawn log-normally about their means."""
        factors: dict[str, float | Floats] = {}
        for name, spread in self.settings.spread.items():
            draws = self._random.standard_normal(self.settings.members)
            if name in self.fleet.figures:
                middle = self.settings.mean.get(name, 0.0) - 0.5 * spread**2
                factors[name] = np.asarray(np.exp(middle + spread * draws))
        if factors:
            self.fleet.set_figures(factors)

    def _line_of(self, line_m: Floats) -> tuple[Floats, Floats]:
        """Return measured line out [m] and rate [m/s] at the borders of the burn-in."""
        from scipy.interpolate import CubicSpline

        settings = self.settings
        count = round(PAST_S / SAMPLE_S)
        spline = CubicSpline(SAMPLE_S * np.arange(1 - count, 1), line_m[-count:])
        times = (
            settings.step_s * np.arange(round(settings.burn_in_s / settings.step_s) + 1)
            - settings.burn_in_s
        )
        return spline(times), spline(times, 1)

    def line_state(self, observed: Observations) -> LineState:
        """Return the main winch's line at the origin; its speed without the compensation's."""
        return line_state(observed, observed.line_out_m, self.scene.winch)

    def _line_states(
        self, observed: Observations, start: FleetState | LiveState
    ) -> dict[str, LineState]:
        """Return the line of each winch at the origin, by name."""
        states = {WINCH: self.line_state(observed)}
        for name, (r, winch) in self._winches.items():
            if name in observed.lines_m:
                states[name] = line_state(observed, observed.lines_m[name], winch)
            else:
                other = start.others[r - 1]
                state = other.rope.state if isinstance(other, LiveState) else other
                states[name] = LineState(float(state.s[state.counts[rows.ELEMENTS]]), 0.0)
        return states

    def _lines(
        self, order: Order, line_states: Mapping[str, LineState], planned: Mapping[str, LinePath]
    ) -> dict[str, LinePath]:
        """Return the line out of each winch under an order, by name."""
        steps, step_s = len(self.leads) * self._steps, self.settings.step_s
        plans = planned if order.kind == CONTINUE else {}
        main = plans.get(WINCH) or line_path(
            order.of(WINCH), line_states[WINCH], self.scene.winch, steps, step_s
        )
        paths = {WINCH: main}
        for name, (_, winch) in self._winches.items():
            lead = None
            if order.kind in WITH_SPEED and not order.winch:
                lead = self._directions[name] * main.speed_m_per_s
            paths[name] = plans.get(name) or line_path(
                order.of(name), line_states[name], winch, steps, step_s, lead
            )
        return paths

    def _run_past(
        self, observed: Observations, motion: tuple[Floats, Floats], start: FleetState | LiveState
    ) -> tuple[FleetRecord, list[FleetState]]:
        """Integrate over the past; return it, and the states at the origin."""
        settings, fleet = self.settings, self.fleet
        if isinstance(start, LiveState):
            fleet.begin_from(start)
        else:
            fleet.restore(start)
        borders = round(settings.burn_in_s / settings.step_s) + 1
        line, rate = self._line_of(observed.line_out_m)
        others = {name: self._line_of(line_m) for name, line_m in observed.lines_m.items()}
        z, v = motion
        past = fleet.advance(FleetInputs(z[:borders], v[:borders], line, rate, others), self._steps)
        return past, [fleet.state(k) for k in range(len(fleet))]

    def _pin_weights(self, observed: Observations, past: FleetRecord) -> Floats | None:
        """Return weights of the members by the load pin's readings, or None if it has none."""
        self.pin_fault = ""
        if observed.tension_n is None:
            return None
        settings = self.settings
        count = min(round(PIN_S / SAMPLE_S), round(settings.burn_in_s / SAMPLE_S))
        predicted = past.top_tension_n[-count * self._steps :]
        predicted = predicted.reshape(count, self._steps, -1).mean(axis=1)
        readings = observed.tension_n[-count:]
        is_known = np.isfinite(readings)
        if not is_known.any() or not np.isfinite(predicted).all():
            return None
        deviation = PIN_FACTOR * settings.load_pin_deviation_n
        self.pin_fault = pin_fault(predicted[is_known], readings[is_known], deviation)
        if self.pin_fault:
            return None
        noise = deviation * self._random.standard_normal((int(is_known.sum()), predicted.shape[1]))
        return smoother_gain(predicted[is_known], readings[is_known], deviation, noise)

    def _run_future(
        self,
        motion: tuple[Floats, Floats],
        order: Order,
        lines: Mapping[str, LinePath],
        line_states: Mapping[str, LineState],
    ) -> FleetRecord:
        border = round(self.settings.burn_in_s / self.settings.step_s)
        z, v = motion
        winches = {name: winch for name, (_, winch) in self._winches.items()}
        inputs = {
            name: self._with_compensation(
                v, order.of(name), line, line_states[name].compensated, winch
            )
            for name, line in lines.items()
            for winch in [winches.get(name, self.scene.winch)]
        }
        main = inputs.pop(WINCH)
        return self.fleet.advance(FleetInputs(z[border:], v[border:], *main, inputs), self._steps)

    def _with_compensation(
        self, heave_rate: Floats, order: Order, line: LinePath, begins_on: bool, winch: Winch | None
    ) -> tuple[Floats, Floats]:
        """Return line out [m] and rate [m/s] from the origin on, with active heave compensation.

        heave_rate: from the burn-in on, (borders, members); begins: whether it is on at the origin.
        """
        settings = self.settings
        border = round(settings.burn_in_s / settings.step_s)
        out, speed = line.out_m, line.speed_m_per_s
        params = winch.heave_compensation if winch else None
        ends_on = begins_on
        if order.kind == COMPENSATION:
            ends_on = bool(order.compensation)
        if params is None or not (begins_on or ends_on) or line.is_whole:
            return out, speed
        begin = max(border - round(20.0 / settings.step_s), 0)
        origin = border - begin
        off_at = len(heave_rate) if ends_on else origin + 1
        added, rate = compensation_path(params, heave_rate[begin:], origin, off_at, settings.step_s)
        if ends_on and not begins_on:  # it begins from rest
            fade = np.minimum(np.arange(len(rate)) * settings.step_s / JOIN_S, 1.0)[:, None]
            rate = rate * fade
            steps = 0.5 * settings.step_s * (rate[1:] + rate[:-1])
            added = np.vstack([np.zeros_like(rate[:1]), np.cumsum(steps, axis=0)])
        return out[:, None] + added, speed[:, None] + rate

    def _forecast(
        self,
        observed: Observations,
        paths: HeavePaths,
        order: Order,
        note: str,
        past: FleetRecord,
        record: FleetRecord,
        is_finite: NDArray[np.bool_],
        weights: Floats | None,
        factor: Floats | None,
    ) -> TensionForecast:
        leads, steps = len(self.leads), self._steps
        step_lead: Floats = np.asarray(self.settings.step_s * np.arange(1.0, leads * steps + 1))

        def shifted(values: Floats, lead_s: Floats) -> Floats:
            if weights is None or not is_finite.all():
                return values[:, is_finite]
            fading = np.exp(-((lead_s / self.settings.fading_s) ** 2))[:, None]
            return np.asarray(
                values + fading * ((values - values.mean(axis=1, keepdims=True)) @ weights)
            )

        factors = np.ones(leads) if factor is None else np.asarray(factor, np.float64)

        numbers = {line.name: number for number, line in enumerate(self.scene.ropes)}

        def spread(name: str, tension_n: Floats) -> SuspendedRope:
            top = shifted(tension_n, step_lead)
            middle = np.median(top, axis=1, keepdims=True)
            top = middle + np.repeat(factors, steps)[:, None] * (top - middle)
            by_lead = top.reshape(leads, steps, -1)
            return SuspendedRope(by_lead[:, -1], by_lead.max(axis=1), numbers[name])

        ropes = {name: spread(name, top_n) for name, top_n in record.suspended_tension_n.items()}
        main_name = next(iter(ropes))
        main = ropes.pop(main_name)
        at_origin = {
            DEPTH: shifted(past.payload_depth_m[-1:], np.zeros(1))[0],
            SPEED: shifted(past.payload_speed_m_per_s[-1:], np.zeros(1))[0],
        }
        values = {
            TENSION: main.values,
            BOTTOM: shifted(record.payload_tension_n, self.leads),
            DEPTH: shifted(record.payload_depth_m, self.leads),
            SPEED: shifted(record.payload_speed_m_per_s, self.leads),
            MARGIN: record.min_tension_n[:, is_finite],
        }
        notes = [text for text in (note, self.pin_fault) if text]
        if not is_finite.all():
            failed = int((~is_finite).sum())
            subject = "they and the load pin are" if weights is not None else "they are"
            notes.append(f"{failed} of {len(is_finite)} members failed; {subject} left out")
        return TensionForecast(
            observed.time_s, order.name, self.leads, values, at_origin, main.peak_n,
            paths.skill()[-leads:], factors, "; ".join(notes), ropes, main_name,
        )  # fmt: skip


def line_state(observed: Observations, line_m: Floats, winch: Winch | None) -> LineState:
    """Return a winch's line at the origin; its speed without the compensation.

    line_m: measured, as in `observed`.
    """
    intervals = round(LINE_SPEED_S / SAMPLE_S)
    # least squares over all samples, which averages counter steps
    times = SAMPLE_S * (np.arange(intervals + 1) - 0.5 * intervals)
    speed = float(times @ line_m[-1 - intervals :] / (times @ times))
    compensated = bool(observed.compensated and winch and winch.heave_compensation)
    if compensated:
        intervals = round(20.0 / SAMPLE_S)  # the mean compensation over several waves is zero
        speed = float(line_m[-1] - line_m[-1 - intervals]) / 20.0
    return LineState(float(line_m[-1]), speed, compensated, observed.to_contact_m)
