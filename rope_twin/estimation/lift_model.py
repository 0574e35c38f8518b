"""Model of a lift: prediction of the measured tension, and its derivatives by perturbed lanes.

Member 0 of a fleet has the figures θ, each other one of them a step in one figure. All begin from
one state a minute before the data that are compared, so that the rope has forgotten where it began
and its derivatives are those of the motion. The delay of the heave is a lane with a shifted heave,
not a shift of the predicted tension: the line out is not late.

The load pin has gain, bias, and the friction of the rope that runs over its sheave. Friction
follows Dahl (1968): its state ξ, -1 to 1, changes with the travel s of the rope over the sheave as
dξ/ds = (sgn(ds) - ξ)/δ, so it reverses over a few δ and keeps its value while nothing moves. The
rope travels by what the winch pays out and by the stretch of the rope on deck.

Ropes that carry a load together are all in a member, and each has a load pin. Rows are those of the
main winch's pin, then of the others. How long the ropes are against each other decides their
shares, so zero and slip of the other winches' line counters are figures with lanes. A rope comes
from the length that it has in the state where a prediction begins to that of its figures smoothly.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.jit.wide import LANES
from rope_twin.core.state import Floats
from rope_twin.effects.rigid_body import RigidBodyParams
from rope_twin.errors import SolverError
from rope_twin.estimation.figures import (
    BIAS,
    CURRENT_SHAPE,
    FRICTION,
    GAIN,
    HEAVE_DELAY,
    HEAVE_ERRORS,
    HEAVE_GAIN,
    HEAVE_SHIFTS,
    INDEX,
    LANE_STEPS,
    LINE_STEPS,
    NAMES,
    check_learnable,
    factors_of,
    names_of,
    of_winch,
    suspended_ropes,
    suspending_winches,
)
from rope_twin.estimation.hanging import hanging_of, open_water
from rope_twin.estimation.measured_lift import FORGETTING_S, MEAN_S, LineTrack, MeasuredLift
from rope_twin.estimation.noise import Bar, ExpectedHeave, bars_of, first_axial_period_s
from rope_twin.scene.instruments import Learning
from rope_twin.scene.schema import Scene
from rope_twin.twin.ensemble.fleet import Fleet, FleetInputs, FleetState, LiveState
from rope_twin.twin.figures import figures_of


def dahl_states(travel_m: Floats, slip_m: float, state: float | Floats = 0.0) -> Floats:
    """Return ξ after each increment of travel, from the state before the first one.

    An increment leads ξ to σ + (ξ - σ)·exp(-|ds|/δ) with the sign σ of the travel, which is exact
    however the travel is divided. That map is linear in ξ, so those of 2, 4, 8 ... increments
    follow from each other, for all columns at once. travel_m: (k,) or (k, members); slip_m: δ;
    state: one, or (members,).
    """
    decay = np.exp(-np.abs(travel_m) / slip_m)
    gained = np.sign(travel_m) * (1.0 - decay)
    reach = 1
    while reach < len(travel_m):
        gained[reach:] += decay[reach:] * gained[:-reach]
        decay[reach:] *= decay[:-reach]
        reach *= 2
    return np.asarray(gained + decay * state)


class LoadPin:
    """Prediction of what the load pin measures of the rope's tension at the hang-off."""

    def __init__(
        self, learning: Learning, EA_n: float, winch: str = "", names: Sequence[str] = NAMES
    ) -> None:
        """Take the sheave's properties.

        EA_n: axial stiffness of the rope on deck [N]; winch: whose pin it is, "": the main one's;
        names: of θ.
        """
        # numbers in θ
        self.places = {name: names.index(of_winch(winch, name)) for name in PIN_STEPS}
        self._slip_m = learning.friction_slip_m
        self._stretch_m_per_n = learning.friction_rope_m / EA_n

    def position(self, tension_n: Floats, line_out_m: Floats) -> Floats:
        """Return where the rope lies over the sheave at each time [m], (steps, members)."""
        return np.asarray(line_out_m + tension_n * self._stretch_m_per_n)

    def friction_state(
        self, tension_n: Floats, line_out_m: Floats, before: Floats | None = None
    ) -> Floats:
        """Return ξ at each time, (steps, members), positive while paying out.

        tension_n: (steps, members) or (steps,), line_out_m: (steps,) at the same times. before: ξ
        and position [m] of the step before the first one, (2, members) or (2,); None: ξ is 0 at the
        first one.
        """
        line = line_out_m if tension_n.ndim == 1 else line_out_m[:, None]
        position = self.position(tension_n, line)
        state, last = (np.zeros(()), position[0]) if before is None else before
        return dahl_states(np.diff(position, axis=0, prepend=last[None]), self._slip_m, state)

    def measured(self, tension_n: Floats, friction_state: Floats, theta: Floats) -> Floats:
        """Return the reading y = (1 + g)·T·(1 - μ·ξ) + b [N]; theta: all figures."""
        gain, friction, bias = (theta[self.places[name]] for name in (GAIN, FRICTION, BIAS))
        return np.asarray((1.0 + gain) * tension_n * (1.0 - friction * friction_state) + bias)


FEWEST_ELEMENTS, MAX_ELEMENTS = 6, 20
LONGEST_STEP_S, MAX_HALVINGS = 0.05, 2
MAX_PHASE_RAD = 0.1  # of the first axial mode in a step
FEWEST_ABOVE_BODY = 12  # its rocking moves the rope aside, in waves that are shorter
WAVE_SHARE = 0.2  # of the way of an axial wave in the longest step: an element has it at least
SLACK_BELOW_N = 1.0  # an element that carries less hangs loose
LEAD_S = 20.0  # of further ropes to their lengths, slowly: a load that is led aside swings
RAMP_S = 10.0  # over which the ship's motion builds up from rest
# differences of the load pin's own figures: exact for bias and gain
PIN_STEPS: Mapping[str, float] = {BIAS: 100.0, GAIN: 0.003, FRICTION: 0.004}


@dataclass(frozen=True)
class ExpectedMotion:
    """Expected motion of ship and line over a block, given all samples of it."""

    heave: ExpectedHeave
    line: LineTrack
    lines: Mapping[str, LineTrack] = field(default_factory=dict)  # of further winches


@dataclass(frozen=True)
class LengthAdjustment:
    """Way of the further winches' ropes from their lengths in a state to those of the figures."""

    begin_s: float
    longer_m: Mapping[str, Floats]  # of the rope in the state, (members,), by winch

    def at(self, winch: str, times_s: Floats) -> tuple[Floats, Floats]:
        """Return what is left of it at times, and its rate, (k, members): half a cosine."""
        angle = np.pi * np.clip((times_s - self.begin_s) / LEAD_S, 0.0, 1.0)
        left, rate = 0.5 * (1.0 + np.cos(angle)), -0.5 * np.pi / LEAD_S * np.sin(angle)
        longer_m = self.longer_m[winch]
        return np.outer(left, longer_m), np.outer(rate, longer_m)


@dataclass
class Prediction:
    """Tension of the members from a common state on, extended as data come."""

    theta: Floats  # (figures,)
    begin_s: float
    end_s: float
    states: list[FleetState]  # of the members at the end
    lead: LengthAdjustment
    tension_n: list[Floats] = field(default_factory=list)  # (pins, steps, members) each
    line_out_m: list[Floats] = field(default_factory=list)  # (pins, steps) each
    # of the ropes over their sheaves before `begin_s`: friction state and position; None: none
    sheave: Floats | None = None  # (pins, 2, members)
    motion: ExpectedMotion | None = None  # that drives them; None: the measured one
    # ends of means in which the rope of a member is slack
    slack_s: Floats = field(default_factory=lambda: np.empty(0))
    # ends of means in which the payload of a member is in splash zone or near the seabed
    near_s: Floats = field(default_factory=lambda: np.empty(0))


def elements_of(bar: Bar) -> int:
    """Return the number of elements that the members have.

    Elements that an axial wave passes many times in a step are no more accurate, since the step
    does not resolve them, but need more corrections than members in lanes do together. A shorter
    step needs no more of them: it is for the first mode, which even the fewest resolve.
    """
    way_m = LONGEST_STEP_S * float(np.sqrt(bar.EA_n / bar.mass_kg_per_m).max())
    return int(np.clip(bar.length_m.sum() / (WAVE_SHARE * way_m), FEWEST_ELEMENTS, MAX_ELEMENTS))


def step_of(bars: Sequence[Bar]) -> float:
    """Return the time step of the members [s], LONGEST_STEP_S halved as often as they need.

    TR-BDF2 with γ = 2 - √2 has the truncation error 0.0404·(ω·Δt)³ in a step (Hosea and Shampine
    1996), by which an axial mode lags: a rope that rings is taken for one whose stiffness over mass
    is 0.081·(ω·Δt)² larger. At MAX_PHASE_RAD that is 0.08 %, where ten minutes leave a standard
    deviation of 0.18 % of this ratio (`shallow_lift`), and 0.6 % of mass and stiffness. A step that
    is shorter still would serve periods that the smoothing of the line out takes away.
    """
    phase = 2.0 * np.pi * LONGEST_STEP_S / first_axial_period_s(bars)
    halvings = np.clip(np.ceil(np.log2(phase / MAX_PHASE_RAD)), 0, MAX_HALVINGS)
    return LONGEST_STEP_S / float(2**halvings)


class LiftModel:
    """A fleet of ropes, and of all that hangs on them, that follows a measured lift."""

    def __init__(self, scene: Scene, lift: MeasuredLift) -> None:
        """Build the lanes of a scene, in its static equilibrium.

        Raises:
            InputError: the scene cannot be learned yet.
            SceneError: the scene cannot be built.
        """
        check_learnable(scene)
        self.lift = lift
        self.winches = suspending_winches(scene)  # further ones
        self.names = names_of(self.winches)
        self._numbers = dict(zip(self.winches, suspended_ropes(scene)[1:], strict=True))
        self._lengths_m = {winch: scene.ropes[r].length_m for winch, r in self._numbers.items()}
        lift.others = {
            winch: lift.others.get(winch, MeasuredLift(np.nan)) for winch in self.winches
        }
        self._water = open_water(scene, lift.pin_noise_n)
        self.bars = bars_of(scene)  # of each rope from the ship
        self.elements = elements_of(self.bars[0])
        if scene.listed(RigidBodyParams) is not None:
            self.elements = max(self.elements, FEWEST_ABOVE_BODY)
        self.step_s = step_of(self.bars)
        self.steps_per_mean = round(MEAN_S / self.step_s)
        self._lone = Fleet(scene, 1, elements=self.elements, step_s=self.step_s)
        # of the rope itself: slings may have a figure that it has not, the stiffness of steel
        self._known = figures_of(hanging_of(scene).rope)
        present = {*self._known, HEAVE_GAIN, HEAVE_DELAY, *HEAVE_ERRORS}
        self._steps = {name: lane_step for name, lane_step in LANE_STEPS.items() if name in present}
        for winch in self.winches:
            named = {of_winch(winch, name): step for name, step in LINE_STEPS.items()}
            self._steps |= {name: {name: step} for name, step in named.items()}
        self.lanes = tuple(self._steps)
        members = 1 + len(self.lanes)
        if LANES > 1:  # a group that is not half full is stepped member by member
            members = -(-members // (LANES // 2)) * (LANES // 2)
        self._fleet = Fleet(scene, members, elements=self.elements, step_s=self.step_s)
        self.pins = tuple(
            LoadPin(scene.learning, float(bar.EA_n[-1]), winch, self.names)
            for winch, bar in zip(("", *self.winches), self.bars, strict=True)
        )
        self.rest = self._lone.state(0)
        self.ramp_begin_s = -np.inf
        self.live: LiveState | None = None  # from which it began, with the current in force

    def hanging_kg(self, theta: Floats) -> float:
        """Return the mass of ropes and all that hangs on them with θ, with added mass [kg]."""
        factor = float(factors_of(theta)["oscillating_mass"])
        return sum(
            factor * bar.end_mass_kg + bar.slings_kg + float(bar.mass_kg_per_m @ bar.length_m)
            for bar in self.bars
        )

    def begin_at_rest(self, time_s: float) -> FleetState:
        """Return the static equilibrium as the state at a time; the ship's motion builds up."""
        self.ramp_begin_s = time_s
        return replace(self.rest, time_ns=round(time_s * 1e9))

    def begin_live(self, live: LiveState) -> FleetState:
        """Return the state of a live twin on the members' mesh; its current applies to them.

        Raises:
            InputError: it is a state of another scene.
        """
        self.ramp_begin_s = -np.inf
        self._fleet.begin_from(live)
        self._lone.begin_from(live)
        self.live = live
        return self._lone.state(0)

    def begin(
        self, theta: Floats, state: FleetState, begin_s: float, motion: ExpectedMotion | None = None
    ) -> Prediction:
        """Return a prediction that has not begun, from a state at a time [s].

        motion: without the errors of sensor and counter; None: as it was measured.
        """
        states = [state] * len(self._fleet)
        lead = self.lead(begin_s, state, self._members(theta, motion is None), motion)
        return Prediction(theta, begin_s, begin_s, states, lead, motion=motion)

    def extend(self, prediction: Prediction, end_s: float) -> None:
        """Step the members on to a time [s], a whole number of means later.

        Raises:
            SolverError: the rope with the figures θ cannot be stepped.
        """
        steps = self.steps_per_mean * round((end_s - prediction.end_s) / MEAN_S)
        if steps < 1:
            return
        thetas = self._members(prediction.theta, prediction.motion is None)
        self._set(self._fleet, thetas)
        self._fleet.restore(prediction.states)
        times = self._borders(prediction.end_s, steps)
        inputs = self._inputs(times, thetas, prediction.motion, prediction.lead)
        record = self._fleet.advance(inputs, interval_steps=self.steps_per_mean)
        if 0 in record.failures:
            raise SolverError(record.failures[0])
        ends = times[self.steps_per_mean :: self.steps_per_mean]
        loose = (record.min_tension_n < SLACK_BELOW_N).any(axis=1)
        prediction.slack_s = np.append(prediction.slack_s, ends[loose])
        outside = self._water.without(record.payload_depth_m).any(axis=1)
        prediction.near_s = np.append(prediction.near_s, ends[outside])
        prediction.tension_n.append(np.array(list(record.suspended_tension_n.values())))
        lines = [
            np.asarray(inputs.line_out_m),
            *(line_out_m[:, 0] for line_out_m, _ in inputs.lines.values()),
        ]
        prediction.line_out_m.append(np.array(lines)[:, 1:])
        prediction.end_s = float(times[-1])
        prediction.states = [self._fleet.state(k) for k in range(len(self._fleet))]

    def trimmed(self, prediction: Prediction, time_s: float) -> Prediction:
        """Return a prediction without the pieces that end before a time [s].

        The friction of the sheave goes on from where they left it.
        """
        begin_s, count = prediction.begin_s, 0
        for piece in prediction.tension_n:
            end_s = begin_s + self.step_s * piece.shape[1]
            if end_s > time_s:
                break
            begin_s, count = end_s, count + 1
        if count == 0:
            return prediction
        tension = np.concatenate(prediction.tension_n[:count], axis=1)
        line = np.concatenate(prediction.line_out_m[:count], axis=1)
        states = self._frictions(tension, line, prediction.sheave)
        sheave = np.array([
            [states[p][-1], pin.position(tension[p, -1], line[p, -1])]
            for p, pin in enumerate(self.pins)
        ])  # fmt: skip
        return replace(
            prediction, begin_s=begin_s, tension_n=prediction.tension_n[count:],
            line_out_m=prediction.line_out_m[count:], sheave=sheave,
        )  # fmt: skip

    def _frictions(self, tension: Floats, line: Floats, sheave: Floats | None) -> list[Floats]:
        """Return ξ of each pin, (steps, members); see `LoadPin.friction_state`."""
        return [
            pin.friction_state(tension[p], line[p], None if sheave is None else sheave[p])
            for p, pin in enumerate(self.pins)
        ]

    def predict(
        self, theta: Floats, state: FleetState, begin_s: float, end_s: float,
        motion: ExpectedMotion | None = None,
    ) -> Prediction:  # fmt: skip
        """Return the prediction from a state at begin to end [s]. Raises SolverError."""
        prediction = self.begin(theta, state, begin_s, motion)
        self.extend(prediction, end_s)
        return prediction

    def without_slack(self, prediction: Prediction, begin_s: float, means: Floats) -> Floats:
        """Return means from begin on with NaN while a predicted rope is slack and after.

        means: (k,), or of all pins, one after the other, (pins·k,).

        When it is taut again follows from elements and steps as much as from the figures, and what
        the jerk leaves in the rope lasts FORGETTING_S. That holds for each member: the difference
        from one that is slack is no derivative.
        """
        return self._masked(prediction.slack_s, begin_s, means)

    def in_open_water(self, prediction: Prediction, begin_s: float, means: Floats) -> Floats:
        """Return means from begin on with NaN while the payload is not in open water.

        The rope forgets in FORGETTING_S how it came out of the splash zone or off the bed.
        """
        return self._masked(prediction.near_s, begin_s, means)

    def _masked(self, at_s: Floats, begin_s: float, means: Floats) -> Floats:
        """Return means of all pins with NaN in those that end at times or soon after."""
        ends = begin_s + MEAN_S * np.arange(1, len(means) // len(self.pins) + 1)
        elapsed_s = ends[:, None] - at_s
        affected = ((elapsed_s > -0.5 * MEAN_S) & (elapsed_s < FORGETTING_S)).any(axis=1)
        return np.where(np.tile(affected, len(self.pins)), np.nan, means)

    def linearised(self, prediction: Prediction, from_s: float) -> tuple[Floats, Floats]:
        """Return the predicted means of all pins from a time on, and their Jacobian.

        They are (pins·k,) [N], one pin after the other, and (pins·k, figures).

        A figure without a lane (the scene does not have it), or whose lane failed, has a column of
        zeros: it is not observable.
        """
        predicted, jacobian, _ = self.with_shifts(prediction, from_s)
        return predicted, jacobian

    def with_shifts(self, prediction: Prediction, from_s: float) -> tuple[Floats, Floats, Floats]:
        """Return what `linearised` does, and the changes by a shifted motion sensor.

        Changes of the means [N] per second that the sensor is later, by each of HEAVE_SHIFTS,
        (pins·k, 2). They are zero where the expected motion drives the members.
        """
        tension = np.concatenate(prediction.tension_n, axis=1)
        line, theta = np.concatenate(prediction.line_out_m, axis=1), prediction.theta
        frictions = self._frictions(tension, line, prediction.sheave)

        def means(p: int, reading: Floats) -> Floats:
            rope = self.lift.ropes[p]
            return rope.sampled_means(reading, prediction.begin_s, self.step_s, from_s)

        of_members = np.concatenate([
            means(p, pin.measured(tension[p], frictions[p], theta))
            for p, pin in enumerate(self.pins)
        ])  # fmt: skip
        predicted = of_members[:, 0]
        jacobian = np.zeros((len(predicted), len(theta)))
        shifts = np.zeros((len(predicted), len(HEAVE_SHIFTS)))
        for member, name in enumerate(self.lanes, start=1):
            column = of_members[:, member] - predicted
            if not np.isfinite(column).all():
                continue
            if prediction.motion is None and name in HEAVE_SHIFTS:
                shifts[:, HEAVE_ERRORS.index(name)] = column / HEAVE_SHIFTS[name]
            else:
                steps = dict(self._steps[name])
                shift_step = steps.pop(name)
                for figure, step in steps.items():  # has its column already
                    column = column - step * jacobian[:, INDEX[figure]]
                jacobian[:, self.names.index(name)] = column / shift_step
        jacobian[:, INDEX[CURRENT_SHAPE]] = jacobian[:, INDEX["current"]]
        count = len(predicted) // len(self.pins)
        for p, pin in enumerate(self.pins):
            rows_of = slice(p * count, (p + 1) * count)
            for name, step in PIN_STEPS.items():
                more, k = theta.copy(), pin.places[name]
                more[k] += step
                reading = pin.measured(tension[p, :, 0], frictions[p][:, 0], more)
                jacobian[rows_of, k] = (means(p, reading) - predicted[rows_of]) / step
        return predicted, jacobian, shifts

    def state_at(
        self, theta: Floats, state: FleetState, begin_s: float, end_s: float,
        motion: ExpectedMotion | None = None,
    ) -> FleetState:  # fmt: skip
        """Return the state of a rope with figures θ that began with a state. Raises SolverError."""
        steps = round((end_s - begin_s) / self.step_s)
        self._set(self._lone, theta[None])
        self._lone.restore(state)
        times = self._borders(begin_s, steps)
        lead = self.lead(begin_s, state, theta[None], motion)
        inputs = self._inputs(times, theta[None], motion, lead)
        record = self._lone.advance(inputs, interval_steps=steps)
        if record.failures:
            raise SolverError(record.failures[0])
        return self._lone.state(0)

    def _members(self, theta: Floats, measured: bool) -> Floats:
        """Return θ of each member, (members, figures); spare members repeat the first.

        measured: the measured heave drives them.
        """
        thetas = np.tile(theta, (len(self._fleet), 1))
        for member, name in enumerate(self.lanes, start=1):
            if measured and name in HEAVE_SHIFTS:
                thetas[member, INDEX[HEAVE_DELAY]] += HEAVE_SHIFTS[name]
                continue
            for figure, step in self._steps[name].items():
                thetas[member, self.names.index(figure)] += step
        return thetas

    def _set(self, fleet: Fleet, thetas: Floats) -> None:
        factors = factors_of(thetas)
        fleet.set_figures({name: factors[name] for name in self._known})

    def lead(
        self, begin_s: float, state: FleetState, thetas: Floats, motion: ExpectedMotion | None
    ) -> LengthAdjustment:
        """Return how further ropes come from a state to the lengths of figures, (members, ...)."""
        longer_m = {}
        for winch, (line_out_m, _) in self._lines(np.array([begin_s]), thetas, motion).items():
            rope = state.others[self._numbers[winch] - 1]
            longer_m[winch] = float(rope.s[rope.counts[rows.ELEMENTS]]) - line_out_m[0]
        return LengthAdjustment(begin_s, longer_m)

    def _lines(
        self, times_s: Floats, thetas: Floats, motion: ExpectedMotion | None
    ) -> dict[str, tuple[Floats, Floats]]:
        """Return line out and its rate of further winches by θ, (k, members) each."""
        lines = {}
        for winch in self.winches:
            track = (
                self.lift.others[winch].line_motion if motion is None else motion.lines[winch].at
            )
            line, speed = (values[:, None] for values in track(times_s))
            offset, slip = (
                thetas[:, self.names.index(of_winch(winch, name))] for name in LINE_STEPS
            )
            ran = line - self._lengths_m[winch]
            lines[winch] = line + offset + slip * ran, speed * (1.0 + slip)
        return lines

    def lines(
        self, times_s: Floats, thetas: Floats, motion: ExpectedMotion | None, lead: LengthAdjustment
    ) -> dict[str, tuple[Floats, Floats]]:
        """Return line out and line speed of further winches, (k, members) each."""
        lines = {}
        for winch, (line_out_m, rate) in self._lines(times_s, thetas, motion).items():
            longer_m, slower = lead.at(winch, times_s)
            lines[winch] = line_out_m + longer_m, rate + slower
        return lines

    def _borders(self, begin_s: float, steps: int) -> Floats:
        """Return the times of the borders of steps, (steps + 1,)."""
        return np.asarray(begin_s + self.step_s * np.arange(steps + 1), dtype=np.float64)

    def _inputs(
        self, times_s: Floats, thetas: Floats, motion: ExpectedMotion | None, lead: LengthAdjustment
    ) -> FleetInputs:
        """Return what moves the members, whose sensors differ in gain and delay of the heave."""
        gains, delays = thetas[:, INDEX[HEAVE_GAIN]], thetas[:, INDEX[HEAVE_DELAY]]
        if motion is None:
            line, speed = self.lift.line_motion(times_s)
            different, sensor = np.unique(delays, return_inverse=True)
            z, v = self.lift.heave_motion(times_s[:, None], different)
            position, rate = z[:, sensor], v[:, sensor]
        else:
            line, speed = motion.line.at(times_s)
            position, rate = _expected(motion.heave, times_s, delays, thetas)
        share = np.exp(-gains)
        position, rate = share * position, share * rate
        elapsed_s = times_s - self.ramp_begin_s
        if elapsed_s[0] < RAMP_S:
            share = np.clip(elapsed_s / RAMP_S, 0.0, 1.0)[:, None]
            share_rate = np.where((elapsed_s[:, None] >= 0.0) & (share < 1.0), 1.0 / RAMP_S, 0.0)
            rate = share * rate + share_rate * position
            position = share * position
        return FleetInputs(position, rate, line, speed, self.lines(times_s, thetas, motion, lead))


def _expected(
    heave: ExpectedHeave, times_s: Floats, delays: Floats, thetas: Floats
) -> tuple[Floats, Floats]:
    """Return the expected heave and its rate for each member's sensor, (k, members)."""
    position = np.empty((len(times_s), len(thetas)))
    rate = np.empty_like(position)
    levels = thetas[:, [INDEX[name] for name in HEAVE_ERRORS]]
    sensors = np.column_stack([delays, levels])
    for delay, *sensor_levels in np.unique(sensors, axis=0).tolist():
        members = (sensors == [delay, *sensor_levels]).all(axis=1)
        motion, sampled_s = heave.at(tuple(sensor_levels)), times_s + delay
        position[:, members], rate[:, members] = (
            motion(sampled_s)[:, None],
            motion(sampled_s, 1)[:, None],
        )
    return position, rate
