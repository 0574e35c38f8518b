"""Tension of the next minute: members of a fleet, each with heave and figures of its own.

At an origin the true heave of the last two minutes and of the next one is drawn jointly for each
member (`heave_process`), with figures (weight, mass, drag, stiffness, ...) from their spread. The
members run through the past, which spreads them by what the motion sensor's error does to a rope,
and on into the future. What the load pin measured in the last 40 s shifts the members (ensemble
smoother, Evensen 2003): with predicted past readings Y, readings y and noise σ,

    T ← T + e^(-(t/τ)²)·(T - mean)·W,  W = Uᵀ-space gain s/(1 + s²) of (Y - mean)/(√(n - 1)·σ),

faded over the lead t, because chance correlations of a finite ensemble carry noise of the past into
a far future. A band is that of the members times a factor per lead that follows from how often
earlier bands held (`kept`). Beyond some 20 s the band is the climatology of this sea for this rope.
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
    LineNow,
    LinePath,
    Lines,
    Order,
    check_lift_order,
    compensation_path,
    line_path,
    other_winches,
    senses,
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
# standard deviations of the figures' logarithms, as some minutes of learning leave them with a
# tared load pin; what is not learned has a wider one
LEARNED_SPREAD: Mapping[str, float] = {
    "submerged_weight": 0.005, "oscillating_mass": 0.02, "payload_drag": 0.06,
    "axial_stiffness": 0.018, "axial_damping": 0.2, "tangential_drag": 0.12,
}  # fmt: skip
MOST_SPREAD = 2.0  # as the section `learning` of a scene allows
# of the coloured error assumed, flat over its whole band, over that of a sensor from 8 to 30 s
ERROR_MARGIN = 1.6
PIN_S = 40.0  # of load pin readings that shift the members
PIN_FACTOR = 3.0  # on its noise, for what the rope model lacks
FADING_S = 8.0  # of the shift over the lead
LINE_SPEED_S = 3.0  # of line out whose least-squares slope is its speed at the origin
JOIN_S = 5.0  # over which a member leaves the heave of the state that it begins from
LEAST_MEMBERS = 19  # for a 90 % band by ranks
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
            InputError: too few members, a burn-in beyond the known past, or a spread that is none.
        """
        if self.members < LEAST_MEMBERS:
            remedy = f"a 90 % band needs {LEAST_MEMBERS}"
            raise InputError("forecast", f"{self.members} members", remedy)
        if not JOIN_S < self.burn_in_s < PAST_S:
            remedy = f"right is more than {JOIN_S:g} s and less than {PAST_S:g} s"
            raise InputError("forecast", f"a burn-in of {self.burn_in_s:g} s", remedy)
        if not (self.load_pin_deviation_n > 0.0 and self.fading_s > 0.0):
            problem = f"load pin {self.load_pin_deviation_n:g} N, fading {self.fading_s:g} s"
            raise InputError("forecast", problem, "give positive numbers")
        for name, value in self.spread.items():
            if name not in FIGURES or not 0.0 <= value <= MOST_SPREAD:
                remedy = f"give 0 to {MOST_SPREAD:g} for {', '.join(FIGURES)}"
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
class Known:
    """All that was measured up to the origin, every SAMPLE_S, the newest last."""

    time_s: float  # of the newest sample, the origin
    heave_m: Floats  # (n,) of the hang-off by the motion sensor, at least 2 min
    line_out_m: Floats  # (n,) of the main winch
    tension_n: Floats | None = (
        None  # (n,) of its rope: means of the load pin over SAMPLE_S; NaN: missing
    )
    waves: MeasuredWaves | None = None
    response: Response | None = None  # heave per elevation, with `waves`
    compensated: bool = False  # active heave compensation is on
    command_m_per_s: float | None = None  # line speed commanded; None: by the line itself
    to_contact_m: float | None = None  # line until the payload lands
    lines_m: Lines = field(default_factory=dict)  # (n,) of other winches; one not named holds

    def __post_init__(self) -> None:
        """Check lengths and values.

        Raises:
            InputError: rows of different lengths, or not finite.
        """
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
class HungRope:
    """Top tension of a rope from a hang-off."""

    values: Floats  # at each lead, (leads, members)
    peak_n: Floats  # largest of the SAMPLE_S up to each lead, (leads, members)
    number: int = 0  # of the rope in the scene

    def band(self) -> Floats:
        """Return the 5, 50 and 95 % quantiles, (3, leads)."""
        return member_quantiles(self.values, axis=1)


@dataclass(frozen=True)
class TensionForecast:
    """Members of one forecast under one order; leads are SAMPLE_S apart."""

    origin_s: float
    order: str
    lead_s: Floats  # (leads,)
    values: Mapping[str, Floats]  # of QUANTITIES, (leads, members), at each lead; top tension is
    # that of the main winch's rope, slack margin of all ropes
    peak_n: Floats  # largest top tension of the SAMPLE_S up to each lead, (leads, members)
    heave_skill: Floats  # expected skill of the heave, (leads,)
    factor: Floats  # on the spread of the members, (leads,)
    note: str = ""
    # of ropes from a hang-off other than the main winch's, by name
    others: Mapping[str, HungRope] = field(default_factory=dict)
    rope: str = ""  # name of the main winch's rope

    @property
    def members(self) -> int:
        """Number of members."""
        return int(self.peak_n.shape[1])

    def band(self, quantity: str = TENSION) -> Floats:
        """Return the 5, 50 and 95 % quantiles of a quantity, (3, leads)."""
        return member_quantiles(self.values[quantity], axis=1)

    @property
    def hung(self) -> dict[str, HungRope]:
        """Each rope from a hang-off by name, that of the main winch first."""
        return {self.rope: HungRope(self.values[TENSION], self.peak_n), **self.others}

    @property
    def horizon_s(self) -> float:
        """Lead up to which heave is known better than its climatology; beyond it is that.

        The largest lead at which the expected skill of the heave is CLIMATOLOGY_SKILL.
        """
        known = np.flatnonzero(self.heave_skill >= CLIMATOLOGY_SKILL)
        return float(self.lead_s[known[-1]]) if len(known) else 0.0


def smoother_gain(predicted: Floats, readings: Floats, deviation: float, noise: Floats) -> Floats:
    """Return the weights W by which members follow readings, (members, members).

    A quantity x of the members, (..., members), becomes x + (x - mean)·W.

    predicted: what each member would have read, (readings, members); readings: (readings,);
    deviation: standard deviation of a reading; noise: normal draws of it, (readings, members), by
    which members keep their spread (Burgers, van Leeuwen and Evensen 1998).
    """
    members = predicted.shape[1]
    apart = (predicted - predicted.mean(axis=1, keepdims=True)).T / math.sqrt(members - 1.0)
    left, size, right = np.linalg.svd(apart / deviation, full_matrices=False)
    missed = ((readings[:, None] + noise - predicted) / deviation).T
    weights = (missed @ right.T * (size / (1.0 + size**2))) @ left.T / math.sqrt(members - 1.0)
    return np.asarray(weights.T)


class TensionForecaster:
    """Forecasts what hangs in a scene again and again, on a fleet of its own."""

    def __init__(self, scene: Scene, settings: ForecastSettings | None = None) -> None:
        """Build the fleet.

        Raises:
            InputError: a scene that fleets do not step, or settings that are not possible.
            SceneError: the scene cannot be built, or has no static equilibrium.
        """
        own = self.settings = settings or ForecastSettings()
        self.scene = scene
        self.fleet = Fleet(scene, own.members, elements=own.elements, step_s=own.step_s)
        self._winches, self._senses = other_winches(scene), senses(scene)
        self._steps = round(SAMPLE_S / own.step_s)
        if self._steps < 1 or abs(self._steps * own.step_s - SAMPLE_S) > 1e-9:
            problem = f"a step of {own.step_s:g} s"
            raise InputError("forecast", problem, f"give a whole part of {SAMPLE_S:g} s")
        self._random = np.random.default_rng(own.seed)
        self.leads: Floats = np.asarray(
            SAMPLE_S * np.arange(1, round(AHEAD_S / SAMPLE_S) + 1, dtype=np.float64)
        )

    def forecast(
        self,
        known: Known,
        start: FleetState | LiveState,
        orders: Sequence[Order] = (Order(CONTINUE),),
        factor: Floats | None = None,
        plans: Mapping[str, LinePath] | None = None,
    ) -> list[TensionForecast]:
        """Return a forecast for each order, all on the same heave paths, member by member.

        Args:
            known: measured up to the origin.
            start: state of the rope `burn_in_s` before the origin, on measured heave.
            orders: what the winches do from the origin on; see `forecast.orders`.
            factor: on the spread of top tension at each lead; None: 1.
            plans: line out of winches from the origin on at every step, by name, in place of
                `continue`.

        Raises:
            InputError: too little is known, or an order that the scene cannot follow.
            SolverError: fewer than LEAST_MEMBERS members came through.
        """
        now = self._lines_now(known, start)
        for order in orders:
            check_lift_order(order, self.scene, now[WINCH])
        lines = [self._lines(order, now, plans or {}) for order in orders]
        heave = known.heave_m - known.heave_m.mean()
        process = HeaveProcess.of_record(heave, self.settings.motion_error)
        paths = process.paths(heave, known.waves, known.response).for_unknown_spectrum()
        motion = self._motion(known, paths)
        self._draw_figures()
        states, weights = self._through_the_past(known, motion, start)
        records: list[FleetRecord] = []
        for order, line in zip(orders, lines, strict=True):
            if records:
                self.fleet.restore(states)
            records.append(self._ahead(motion, order, line, now))
        good = self._came_through(records)
        return [
            self._forecast(
                known, paths, order, line[order.winch or WINCH].note, record, good, weights, factor
            )
            for order, line, record in zip(orders, lines, records, strict=True)
        ]

    def _came_through(self, records: Sequence[FleetRecord]) -> NDArray[np.bool_]:
        """Return which members came through under every order. Raises SolverError: too few."""
        good = np.all([np.isfinite(one.top_tension_n).all(axis=0) for one in records], axis=0)
        if int(good.sum()) < LEAST_MEMBERS:
            why = next((w for one in records for w in one.failures.values()), "no reason is known")
            problem = f"{int((~good).sum())} of {len(good)} members failed ({why.rstrip('.')})"
            raise SolverError(
                "forecast", problem, "check the scene at this line out and in this sea"
            )
        return np.asarray(good)

    def _motion(self, known: Known, paths: HeavePaths) -> tuple[Floats, Floats]:
        """Return heave [m] and rate [m/s] at the borders from the burn-in on, (borders, members).

        A member begins with the measured heave, on which the state is, and goes over to its own.
        """
        from scipy.interpolate import CubicSpline  # slow to import

        own = self.settings
        drawn = paths.draw(own.members, self._random) + known.heave_m.mean()
        spline = CubicSpline(paths.lead_s, drawn, axis=1)
        count = round((own.burn_in_s + AHEAD_S) / own.step_s) + 1
        at = own.step_s * np.arange(count) - own.burn_in_s
        z, v = spline(at).T, spline(at, 1).T
        past = min(len(known.heave_m), round(PAST_S / SAMPLE_S))
        known_m = CubicSpline(SAMPLE_S * np.arange(1 - past, 1), known.heave_m[-past:])
        early = at < JOIN_S - own.burn_in_s
        begun = (at[early] + own.burn_in_s) / JOIN_S
        share = (0.5 - 0.5 * np.cos(np.pi * begun))[:, None]
        slope = (0.5 * np.pi / JOIN_S * np.sin(np.pi * begun))[:, None]
        base, base_rate = known_m(at[early])[:, None], known_m(at[early], 1)[:, None]
        v[early] = base_rate + share * (v[early] - base_rate) + slope * (z[early] - base)
        z[early] = base + share * (z[early] - base)
        return np.ascontiguousarray(z), np.ascontiguousarray(v)

    def _draw_figures(self) -> None:
        """Set figures of all members, log-normal about what is known of them."""
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

        own = self.settings
        count = round(PAST_S / SAMPLE_S)
        spline = CubicSpline(SAMPLE_S * np.arange(1 - count, 1), line_m[-count:])
        at = own.step_s * np.arange(round(own.burn_in_s / own.step_s) + 1) - own.burn_in_s
        return spline(at), spline(at, 1)

    def line_now(self, known: Known) -> LineNow:
        """Return the main winch's line at the origin; its speed without the compensation's."""
        return line_now(known, known.line_out_m, self.scene.winch, known.command_m_per_s)

    def _lines_now(self, known: Known, start: FleetState | LiveState) -> dict[str, LineNow]:
        """Return the line of each winch at the origin, by name."""
        found = {WINCH: self.line_now(known)}
        for name, (r, winch) in self._winches.items():
            if name in known.lines_m:
                found[name] = line_now(known, known.lines_m[name], winch)
            else:
                held = start.others[r - 1]
                state = held.rope.state if isinstance(held, LiveState) else held
                found[name] = LineNow(float(state.s[state.counts[rows.ELEMENTS]]), 0.0)
        return found

    def _lines(
        self, order: Order, now: Mapping[str, LineNow], planned: Mapping[str, LinePath]
    ) -> dict[str, LinePath]:
        """Return the line out of each winch under an order, by name."""
        steps, step_s = len(self.leads) * self._steps, self.settings.step_s
        given = planned if order.kind == CONTINUE else {}
        main = given.get(WINCH) or line_path(
            order.of(WINCH), now[WINCH], self.scene.winch, steps, step_s
        )
        found = {WINCH: main}
        for name, (_, winch) in self._winches.items():
            lead = None
            if order.kind in WITH_SPEED and not order.winch:
                lead = self._senses[name] * main.speed_m_per_s
            found[name] = given.get(name) or line_path(
                order.of(name), now[name], winch, steps, step_s, lead
            )
        return found

    def _through_the_past(
        self, known: Known, motion: tuple[Floats, Floats], start: FleetState | LiveState
    ) -> tuple[list[FleetState], Floats | None]:
        """Run through the past; return the states at the origin and the load pin's weights."""
        own, fleet = self.settings, self.fleet
        if isinstance(start, LiveState):
            fleet.begin_from(start)
        else:
            fleet.restore(start)
        borders = round(own.burn_in_s / own.step_s) + 1
        line, rate = self._line_of(known.line_out_m)
        others = {name: self._line_of(line_m) for name, line_m in known.lines_m.items()}
        z, v = motion
        past = fleet.advance(FleetInputs(z[:borders], v[:borders], line, rate, others), self._steps)
        weights = self._pin_weights(known, past)
        states = [fleet.state(k) for k in range(len(fleet))]
        return states, weights

    def _pin_weights(self, known: Known, past: FleetRecord) -> Floats | None:
        """Return weights of the members by the load pin's readings, or None if there are none."""
        if known.tension_n is None:
            return None
        own = self.settings
        count = min(round(PIN_S / SAMPLE_S), round(own.burn_in_s / SAMPLE_S))
        predicted = past.top_tension_n[-count * self._steps :]
        predicted = predicted.reshape(count, self._steps, -1).mean(axis=1)
        readings = known.tension_n[-count:]
        good = np.isfinite(readings)
        if not good.any() or not np.isfinite(predicted).all():
            return None
        deviation = PIN_FACTOR * own.load_pin_deviation_n
        noise = deviation * self._random.standard_normal((int(good.sum()), predicted.shape[1]))
        return smoother_gain(predicted[good], readings[good], deviation, noise)

    def _ahead(
        self,
        motion: tuple[Floats, Floats],
        order: Order,
        lines: Mapping[str, LinePath],
        now: Mapping[str, LineNow],
    ) -> FleetRecord:
        border = round(self.settings.burn_in_s / self.settings.step_s)
        z, v = motion
        winches = {name: winch for name, (_, winch) in self._winches.items()}
        own = {
            name: self._with_compensation(v, order.of(name), line, now[name].compensated, winch)
            for name, line in lines.items()
            for winch in [winches.get(name, self.scene.winch)]
        }
        main = own.pop(WINCH)
        return self.fleet.advance(FleetInputs(z[border:], v[border:], *main, own), self._steps)

    def _with_compensation(
        self, heave_rate: Floats, order: Order, line: LinePath, begins: bool, winch: Winch | None
    ) -> tuple[Floats, Floats]:
        """Return line out [m] and rate [m/s] from the origin on, with active heave compensation.

        heave_rate: from the burn-in on, (borders, members); begins: whether it is on at the origin.
        """
        own = self.settings
        border = round(own.burn_in_s / own.step_s)
        out, speed = line.out_m, line.speed_m_per_s
        params = winch.heave_compensation if winch else None
        stays = begins
        if order.kind == COMPENSATION:
            stays = bool(order.compensation)
        if params is None or not (begins or stays) or line.is_whole:
            return out, speed
        first = max(border - round(20.0 / own.step_s), 0)
        at = border - first
        until = len(heave_rate) if stays else at + 1
        added, rate = compensation_path(params, heave_rate[first:], at, until, own.step_s)
        if stays and not begins:  # it begins from rest
            gone = np.minimum(np.arange(len(rate)) * own.step_s / JOIN_S, 1.0)[:, None]
            rate = rate * gone
            steps = 0.5 * own.step_s * (rate[1:] + rate[:-1])
            added = np.vstack([np.zeros_like(rate[:1]), np.cumsum(steps, axis=0)])
        return out[:, None] + added, speed[:, None] + rate

    def _forecast(
        self,
        known: Known,
        paths: HeavePaths,
        order: Order,
        note: str,
        record: FleetRecord,
        good: NDArray[np.bool_],
        weights: Floats | None,
        factor: Floats | None,
    ) -> TensionForecast:
        leads, steps = len(self.leads), self._steps
        step_lead: Floats = np.asarray(self.settings.step_s * np.arange(1.0, leads * steps + 1))

        def shifted(values: Floats, lead_s: Floats) -> Floats:
            if weights is None or not good.all():
                return values[:, good]
            near = np.exp(-((lead_s / self.settings.fading_s) ** 2))[:, None]
            return np.asarray(
                values + near * ((values - values.mean(axis=1, keepdims=True)) @ weights)
            )

        own = np.ones(leads) if factor is None else np.asarray(factor, np.float64)

        numbers = {line.name: number for number, line in enumerate(self.scene.ropes)}

        def spread(name: str, tension_n: Floats) -> HungRope:
            top = shifted(tension_n, step_lead)
            middle = np.median(top, axis=1, keepdims=True)
            top = middle + np.repeat(own, steps)[:, None] * (top - middle)
            by_lead = top.reshape(leads, steps, -1)
            return HungRope(by_lead[:, -1], by_lead.max(axis=1), numbers[name])

        hung = {name: spread(name, top_n) for name, top_n in record.hung_tension_n.items()}
        first = next(iter(hung))
        main = hung.pop(first)
        values = {
            TENSION: main.values,
            BOTTOM: shifted(record.payload_tension_n, self.leads),
            DEPTH: shifted(record.payload_depth_m, self.leads),
            SPEED: shifted(record.payload_speed_m_per_s, self.leads),
            MARGIN: record.least_tension_n[:, good],
        }
        notes = [note] if note else []
        if not good.all():
            lost = int((~good).sum())
            out = "they and the load pin are" if weights is not None else "they are"
            notes.append(f"{lost} of {len(good)} members failed; {out} left out")
        return TensionForecast(
            known.time_s, order.name, self.leads, values, main.peak_n,
            paths.skill()[-leads:], own, "; ".join(notes), hung, first,
        )  # fmt: skip


def line_now(
    known: Known, line_m: Floats, winch: Winch | None, command_m_per_s: float | None = None
) -> LineNow:
    """Return a winch's line at the origin; its speed without what the compensation adds.

    line_m: measured, as `known`; command_m_per_s: commanded speed, None: by the line itself.
    """
    over = round(LINE_SPEED_S / SAMPLE_S)  # by all its samples: one is a counter's step off
    since = SAMPLE_S * (np.arange(over + 1) - 0.5 * over)
    speed = float(since @ line_m[-1 - over :] / (since @ since))
    params = winch.heave_compensation if winch else None
    if command_m_per_s is not None:
        speed = command_m_per_s
    elif known.compensated and params is not None:
        over = round(20.0 / SAMPLE_S)  # the compensation's mean over some waves is none
        speed = float(line_m[-1] - line_m[-1 - over]) / 20.0
    return LineNow(
        float(line_m[-1]), speed, known.compensated and params is not None, 0.0,
        known.to_contact_m,
    )  # fmt: skip
