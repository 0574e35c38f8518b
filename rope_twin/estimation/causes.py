"""Causes of faults, and how each changes the measured tension.

Small ones act to first order: their signature is a direction of the figures, from the onset on. A
large one does not: each has lanes that have it, in a fleet whose members follow the measured heave
and line out with the present figures up to an onset and with the fault from then on. A change of
the real load rings the rope at its own period, one of the sensor does not: that is how they part.

The response d of a lane, times a size a within the lane's range, is judged by the likelihood of the
whole residual, 2·ln(p_a/p_0) = 2·a·dᵀS⁻¹e - a²·dᵀS⁻¹d, at its best size and onset.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from rope_twin.core.state import Floats
from rope_twin.estimation.fault_tests import FaultTests, Signature
from rope_twin.estimation.figures import (
    BIAS,
    GAIN,
    HEAVE_DELAY,
    HEAVE_GAIN,
    INDEX,
    LINE_OFFSET,
    factors_of,
    of_winch,
)
from rope_twin.estimation.lift_model import LiftModel
from rope_twin.estimation.measured_lift import MEAN_S
from rope_twin.scene.schema import Scene
from rope_twin.twin.ensemble.fleet import Fleet, FleetInputs, FleetState

PAYLOAD, SNAGGED, HELD, SLIP = "payload", "snagged", "lower end held", "line slip"
PIN_OFFSET, PIN_DRIFT = "load pin offset", "load pin drift"
SENSOR_GAIN, SENSOR_DELAY = "motion sensor gain", "motion sensor delay"
STUCK_PIN, STUCK_SENSOR, STUCK_ENCODER = (
    "load pin stuck", "motion sensor stuck", "line counter stuck",
)  # fmt: skip
SLOW_DRIFT, UNKNOWN = "slow drift of load or load pin", "unknown"

# beside the figures: a sensor that is much later or earlier, per second
LATER, EARLIER = "later heave", "earlier heave"
SHIFTS = LATER, EARLIER
# zero and gain of a load pin are one as long as the load does not change
SIGNATURES = (
    Signature(PIN_OFFSET, {BIAS: 1000.0}),
    Signature(PIN_OFFSET, {GAIN: 0.01}),
    Signature(PIN_DRIFT, ramp_n_per_s=50.0),
    Signature(PAYLOAD, {"submerged_weight": 0.10, "oscillating_mass": 0.04}),
    Signature(SNAGGED, {"oscillating_mass": 0.10, "payload_drag": 0.30}),
    Signature(SENSOR_GAIN, {HEAVE_GAIN: 0.05}),
    Signature(SENSOR_DELAY, {HEAVE_DELAY: 0.10}),
    Signature(SENSOR_DELAY, {LATER: 0.4}),
    Signature(SENSOR_DELAY, {EARLIER: -0.4}),
)


def cause_of(winch: str, cause: str) -> str:
    """Return the name of a cause at a further winch; "": at the main one."""
    return f"{cause} ({winch})" if winch else cause


def signatures_of(winches: Sequence[str]) -> tuple[Signature, ...]:
    """Return the signatures of a lift, with those of the load pins of further winches."""
    signatures = list(SIGNATURES)
    for pin, winch in enumerate(winches, start=1):
        offset, slip = cause_of(winch, PIN_OFFSET), cause_of(winch, SLIP)
        signatures += [
            Signature(offset, {of_winch(winch, BIAS): 1000.0}),
            Signature(offset, {of_winch(winch, GAIN): 0.01}),
            Signature(cause_of(winch, PIN_DRIFT), ramp_n_per_s=50.0, pin=pin),
            Signature(slip, {of_winch(winch, LINE_OFFSET): 0.1}),
        ]
    return tuple(signatures)


PIN = frozenset({PIN_OFFSET, PIN_DRIFT})  # "load pin", where its two cannot be distinguished

W, M, K = "submerged_weight", "oscillating_mass", "payload_drag"
ONSETS = 5  # that are tried, one of them from the tests
BEFORE_ALARM_S = 1.0, 2.0, 3.0, 5.0  # the others: a large fault is found within seconds
SLIP_RAMP_S = 0.4  # in which a slip reaches its speed
SLIP_ENDS_S = 2.0, 3.0, 5.0, 10.0, 20.0  # after which it may have ended


@dataclass(frozen=True)
class Lane:
    """A large fault that a member of the fleet has."""

    cause: str
    factors: Mapping[str, float] = field(default_factory=dict)  # on the learned figures
    slip_m_per_s: float = 0.0
    least: float = -math.inf  # size of the response
    most: float = math.inf
    winch: str = ""  # whose line slips


LANES = (
    Lane(PAYLOAD, {W: 0.9, M: 0.96}, least=-2.5, most=3.0),  # the first may be flooded too
    Lane(PAYLOAD, {W: 0.5, M: 0.6, K: 0.6}, least=0.6, most=1.4),
    Lane(PAYLOAD, {W: 0.02, M: 0.02, K: 0.02}, least=0.9, most=1.1),
    Lane(SNAGGED, {M: 3.0, K: 6.0}, least=0.3, most=1.5),
    Lane(SNAGGED, {M: 10.0, K: 30.0}, least=0.8, most=1.2),
    Lane(HELD, {M: 1e3, K: 1e4}, least=0.8, most=1.2),
    Lane(HELD, {W: 0.05, M: 1e3, K: 1e4}, least=0.8, most=1.2),  # it rests on the bed
    Lane(SLIP, slip_m_per_s=0.5, least=0.2, most=2.0),
    Lane(SLIP, slip_m_per_s=1.5, least=0.6, most=2.0),
)


def likelihood_gain(product: Floats, power: Floats, smallest: Floats, largest: Floats) -> Floats:
    """Return 2·ln(p_a/p_0) of responses at their best size within a range, (h,).

    product, power: dᵀS⁻¹e and dᵀS⁻¹d, (h,); smallest, largest: of the size a, (h,).
    """
    some = power > 0.0
    unlimited = np.divide(product, power, out=np.zeros_like(product), where=some)
    size = np.clip(unlimited, smallest, largest)
    return np.where(some, 2.0 * size * product - size**2 * power, 0.0)


class FaultLanes:
    """Fleet whose members have one large fault each, from one of several onsets on."""

    def __init__(self, scene: Scene, model: LiftModel) -> None:
        """Build the members for the scene of a model of the lift that is watched.

        Raises:
            InputError: the scene cannot be stepped by a fleet.
        """
        self._model = model
        slips = [
            replace(lane, cause=cause_of(winch, SLIP), winch=winch)
            for winch in model.winches for lane in LANES if lane.cause == SLIP
        ]  # fmt: skip
        self.pairs = [(onset, lane) for onset in range(ONSETS) for lane in (*LANES, *slips)]
        members = 1 + len(self.pairs)
        self._fleet = Fleet(scene, members, elements=model.elements, step_s=model.step_s)
        if model.live is not None:  # its current, not the scene's
            self._fleet.begin_from(model.live)
        known = set(self._fleet.figures)
        self.pairs = [(onset, lane) for onset, lane in self.pairs if set(lane.factors) <= known]

    def responses(
        self,
        theta: Floats,
        state: FleetState,
        begin_s: float,
        onsets_s: Sequence[float],
        end_s: float,
    ) -> tuple[list[str], Floats, Floats, Floats]:
        """Return cause, change of the measured tension, and range of its size, of each response.

        A slip yields further responses, which end after SLIP_ENDS_S.

        Args:
            theta: figures at the reference.
            state: of a rope with these figures at begin_s.
            begin_s: start of the stretch [s].
            onsets_s: likely onsets, (ONSETS,) [s].
            end_s: end of the stretch, a whole number of means after begin_s.

        Returns:
            causes (h,), changes (means from begin_s to end_s, pins, h) [N], least and most size
            (h,). Lanes that cannot be stepped are left out.

        Raises:
            SolverError: the rope without a fault cannot be stepped up to the onset.
        """
        total = round((end_s - begin_s) / MEAN_S)
        starts = [round((onset - begin_s) / MEAN_S) for onset in onsets_s]
        starts = [min(max(start, 0), total - 1) for start in starts]
        first = min(starts)
        first_s = begin_s + MEAN_S * first
        if first > 0:
            state = self._model.state_at(theta, state, begin_s, first_s)
        self._fleet.restore(replace(state, time_ns=round(first_s * 1e9)))
        starts_in = [start - first for start in starts]
        tensions, lines = self._step(theta, state, starts_in, first_s, total - first)
        changes = np.zeros((total, len(tensions), len(self.pairs)))
        for p, (pin, tension) in enumerate(zip(self._model.pins, tensions, strict=True)):
            reading = pin.measured(tension, pin.friction_state(tension, lines[p]), theta)
            means = reading.reshape(-1, self._model.steps_per_mean, reading.shape[1]).mean(axis=1)
            changes[first:, p] = (means[:, 1:] - means[:, :1])[:, : len(self.pairs)]
        return self._with_ends(changes)

    def _step(
        self, theta: Floats, state: FleetState, starts: Sequence[int], first_s: float, means: int
    ) -> tuple[Floats, Floats]:
        """Return tensions of all members and lines out of the first.

        They are (pins, steps, members) and (pins, steps).
        """
        members, per_mean = len(self._fleet), self._model.steps_per_mean
        count = means * per_mean
        times = np.asarray(first_s + self._model.step_s * np.arange(count + 1), dtype=np.float64)
        lift = self._model.lift
        z, v = lift.heave_motion(
            times, float(theta[INDEX[HEAVE_DELAY]]), float(theta[INDEX[HEAVE_GAIN]])
        )
        length, speed = lift.line_motion(times)
        thetas = np.tile(theta, (members, 1))
        lead = self._model.lead(first_s, state, thetas, None)
        lines = {"": tuple(np.repeat(values[:, None], members, 1) for values in (length, speed))}
        lines |= self._model.lines(times, thetas, None, lead)
        for k, (onset, lane) in enumerate(self.pairs, start=1):
            line, rate = lines[lane.winch]
            elapsed_s = times - first_s - MEAN_S * starts[onset]
            ran = np.clip(elapsed_s, 0.0, SLIP_RAMP_S)
            line[:, k] += lane.slip_m_per_s * (
                0.5 * ran**2 / SLIP_RAMP_S + np.clip(elapsed_s - SLIP_RAMP_S, 0.0, None)
            )
            rate[:, k] += lane.slip_m_per_s * ran / SLIP_RAMP_S
        tension = np.full((len(self._model.pins), count, members), np.nan)
        borders = sorted({0, *starts, means})
        for a, b in pairwise(borders):
            self._fleet.set_figures(self._factors(theta, starts, a))
            steps = slice(a * per_mean, b * per_mean + 1)
            cut = {
                winch: (length_m[steps], speed_m_per_s[steps])
                for winch, (length_m, speed_m_per_s) in lines.items()
            }
            line, rate = cut.pop("")
            inputs = FleetInputs(z[steps], v[steps], line, rate, cut)
            record = self._fleet.advance(inputs, interval_steps=steps.stop - steps.start - 1)
            tension[:, steps.start : steps.stop - 1] = list(record.suspended_tension_n.values())
        return tension, np.array([length_m[1:, 0] for length_m, _ in lines.values()])

    def _factors(self, theta: Floats, starts: Sequence[int], mean: int) -> dict[str, Floats]:
        """Return the figures' factors of all members from a mean on."""
        learned = factors_of(np.tile(theta, (len(self._fleet), 1)))
        factors = {name: learned[name] for name in self._fleet.figures}
        for k, (onset, lane) in enumerate(self.pairs, start=1):
            for name, factor in lane.factors.items():
                if mean >= starts[onset]:
                    factors[name][k] *= factor
        return factors

    def _with_ends(self, changes: Floats) -> tuple[list[str], Floats, Floats, Floats]:
        """Add slips that ended, and leave out lanes that failed."""
        lanes = [lane for _, lane in self.pairs]
        columns = [changes]
        for k, lane in enumerate(list(lanes)):
            for after_s in SLIP_ENDS_S if lane.slip_m_per_s else ():
                shift = round(after_s / MEAN_S)
                ended = changes[..., k].copy()
                ended[shift:] -= changes[:-shift, :, k]
                columns.append(ended[..., None])
                lanes.append(lane)
        responses = np.concatenate(columns, axis=-1)
        good = np.flatnonzero(np.isfinite(responses).all(axis=(0, 1)))
        causes = [lanes[k].cause for k in good]
        smallest = np.array([lane.least for lane in lanes])[good]
        largest = np.array([lane.most for lane in lanes])[good]
        return causes, responses[..., good], smallest, largest


def name_causes(
    tests: FaultTests, responses: tuple[list[str], Floats, Floats, Floats]
) -> list[tuple[str, float]]:
    """Return causes and their likelihood gain, the most likely first.

    Causes of first order compete with the lanes of others; a cause that has lanes is judged by
    them alone, as only they ring.
    """
    causes, changes, smallest, largest = responses
    gains: dict[str, float] = {}
    for suspicion in tests.suspicions():
        if suspicion.cause not in causes:
            gains[suspicion.cause] = max(suspicion.ratio, gains.get(suspicion.cause, 0.0))
    if causes:
        fitted_gains = likelihood_gain(*tests.fit(changes), smallest, largest)
        for cause, gain in zip(causes, fitted_gains, strict=True):
            gains[cause] = max(float(gain), gains.get(cause, 0.0))
    return sorted(gains.items(), key=lambda item: -item[1])
