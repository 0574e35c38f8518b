"""Hidden truths: a rope of 137 elements at 10 ms with figures drawn by seed, and its sensors.

The estimator's model differs from a truth in all that it does not know: elements and step, a
current turned by 40° with another profile, cross-flow drag that is off by 20 % (1 sd, the same for
the truths that share their lanes). Load pin: 20 Hz, white noise, gain, bias, sheave friction.
Motion sensor: gain, delay, coloured error of 2 cm rms between 8 and 30 s. Line counter: slip of
0.1 % (1 sd), whole centimetres.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicHermiteSpline, CubicSpline
from scipy.signal import butter, sosfilt

from rope_twin.core.jit.wide import LANES
from rope_twin.core.state import Floats
from rope_twin.effects.current import CurrentParams
from rope_twin.effects.drag import DragParams
from rope_twin.estimation.figures import (
    FRICTION,
    HEAVE_DELAY,
    HEAVE_GAIN,
    INDEX,
    REPORTED,
    Prior,
    factors_of,
)
from rope_twin.estimation.lift_model import LoadPin
from rope_twin.estimation.measured_lift import MeasuredLift
from rope_twin.estimation.noise import bar_of
from rope_twin.recording.heave import open_heave
from rope_twin.scene.schema import Scene
from rope_twin.twin.ensemble.fleet import Fleet, FleetInputs
from rope_twin.twin.motion.boundary_conditions import WinchMotion

ELEMENTS, STEP_S = 137, 0.01
SENSOR_S = 0.05
WARM_UP_S = 60.0  # before the first block
RAMP_S = 10.0
MAX_SDS = 2.0  # of a draw from the prior
CROSS_FLOW_SD = 0.2
TURNED_RAD = 0.7
OTHER_PROFILE = 1.2, 1.1, 0.9, 0.8  # factors on the current's speed from the surface down
HEAVE_ERROR_M, HEAVE_ERROR_PERIODS_S = 0.02, (8.0, 30.0)
SLIP_SD, COUNTER_M = 0.001, 0.01
SEA_S = 1199.9  # of a recorded sea


@dataclass(frozen=True)
class Truth:
    """A hidden θ and what the sensors measured."""

    seed: int
    theta: Floats  # (COUNT,)
    time_s: Floats  # (samples,)
    tension_n: Floats
    heave_m: Floats
    line_out_m: Floats

    def lift(self, pin_noise_n: float) -> MeasuredLift:
        """Return the measured series for an estimator."""
        lift = MeasuredLift(pin_noise_n)
        lift.tension.extend(self.time_s, self.tension_n)
        rate = CubicSpline(self.time_s, self.heave_m)(self.time_s, 1)
        lift.heave.extend(self.time_s, self.heave_m, rate)
        lift.line_out.extend(self.time_s, self.line_out_m)
        return lift

    def with_spikes(self, share: float = 0.01, size_n: float = 50e3) -> Truth:
        """Return the truth with spikes of a size in a share of the load pin's samples."""
        rng = np.random.default_rng(self.seed)
        hit = rng.random(len(self.tension_n)) < share
        size = size_n * rng.choice([-1.0, 1.0], len(self.tension_n))
        return replace(self, tension_n=np.where(hit, self.tension_n + size, self.tension_n))

    def with_gaps(self, of_minute_s: tuple[float, float] = (20.0, 35.0)) -> Truth:
        """Return the truth without the load pin's samples in a part of each minute."""
        second = (self.time_s - WARM_UP_S) % 60.0
        lost = (second > of_minute_s[0]) & (second < of_minute_s[1])
        return replace(self, tension_n=np.where(lost, np.nan, self.tension_n))


def other_water(scene: Scene, cross_flow: float) -> Scene:
    """Return the scene with a current that no estimator knows, and a factor on cross-flow drag."""
    effects = []
    for params in scene.effects:
        if isinstance(params, DragParams):
            params = replace(params, normal=params.normal * cross_flow)
        elif isinstance(params, CurrentParams) and params.profile:
            c, s = np.cos(TURNED_RAD), np.sin(TURNED_RAD)
            rows = []
            for k, (z, (east, north, *vertical)) in enumerate(params.profile):
                share = OTHER_PROFILE[min(k, len(OTHER_PROFILE) - 1)]
                turned = share * (c * east - s * north), share * (s * east + c * north)
                rows.append((z, (*turned, *vertical)))
            params = replace(params, profile=tuple(rows))
        effects.append(params)
    return replace(scene, effects=tuple(effects))


def make_truths(
    scene: Scene, prior: Prior, seeds: Sequence[int], sea: str, seconds: float
) -> list[Truth]:
    """Return truths of a scene in a sea, with `seconds` of measurement after the warm-up.

    Truths that are made together share their lanes and their cross-flow drag, drawn by the first.
    """
    truths: list[Truth] = []
    for first in range(0, len(seeds), LANES):
        truths += _make_group(scene, prior, list(seeds[first : first + LANES]), sea, seconds)
    return truths


def make_changed_truths(
    scene: Scene, prior: Prior, seeds: Sequence[int], sea: str, seconds: float,
    change_s: float, changes: Mapping[str, Mapping[str, float]],
) -> dict[str, list[Truth]]:  # fmt: skip
    """Return truths of which figures change by factors at a time of the record, by name of change.

    The truths of one seed have the same noise, and are the same up to the change.
    """
    truths: dict[str, list[Truth]] = {name: [] for name in changes}
    for first in range(0, len(seeds), LANES):
        group = _Group(scene, prior, list(seeds[first : first + LANES]), sea, seconds)
        change_step = round(change_s / STEP_S)
        before = group.tension(0, change_step)
        states = [group.fleet.state(k) for k in range(len(group.seeds))]
        for name, factors in changes.items():
            group.fleet.restore(states)
            group.set_figures(factors)
            after = group.tension(change_step, group.steps)
            truths[name] += group.measured(np.concatenate([before, after]))
    return truths


def _make_group(
    scene: Scene, prior: Prior, seeds: list[int], sea: str, seconds: float
) -> list[Truth]:
    group = _Group(scene, prior, seeds, sea, seconds)
    return group.measured(group.tension(0, group.steps))


class _Group:
    """Truths that share their lanes: what moves them, what is hidden, and their sensors."""

    def __init__(
        self, scene: Scene, prior: Prior, seeds: list[int], sea: str, seconds: float
    ) -> None:
        self.seeds, self.steps = seeds, round((WARM_UP_S + seconds) / STEP_S)
        t = STEP_S * np.arange(self.steps + 1)
        samples = open_heave(sea).between(-50_000_000, 1_200_000_000_000)
        table = np.array([(s.stamp_ns * 1e-9, s.position_m, s.velocity_m_per_s) for s in samples])
        sea_heave = CubicHermiteSpline(*table.T)
        self._line = scheduled_line(scene, self.steps)
        ramp = np.clip(t / RAMP_S, 0.0, 1.0)
        ramp_rate = np.where(ramp < 1.0, 1.0 / RAMP_S, 0.0)
        self._rngs = [np.random.default_rng(1000 + seed) for seed in seeds]
        self._thetas = np.array([_draw(prior, rng) for rng in self._rngs])
        cross_flow = float(np.exp(CROSS_FLOW_SD * self._rngs[0].standard_normal()))
        sea_time_s = np.array([(t + rng.uniform(0.0, 1200.0)) % SEA_S for rng in self._rngs]).T
        self._heave = sea_heave(sea_time_s) * ramp[:, None]
        self._rate = (
            sea_heave(sea_time_s, 1) * ramp[:, None] + sea_heave(sea_time_s) * ramp_rate[:, None]
        )
        water = other_water(scene, cross_flow)
        self.fleet = Fleet(water, len(seeds), elements=ELEMENTS, step_s=STEP_S)
        self.set_figures({})
        self._pin = LoadPin(scene.learning, float(bar_of(scene).EA_n[-1]))
        self._noise_n = prior.pin_noise_n

    def set_figures(self, more: Mapping[str, float]) -> None:
        """Set the hidden figures, times further factors."""
        factors = factors_of(self._thetas)
        own_factors = {name: factors[name] * more.get(name, 1.0) for name in self.fleet.figures}
        self.fleet.set_figures(own_factors)

    def tension(self, begin: int, end: int) -> Floats:
        """Return the top tension of all after each step from one to another, (steps, truths)."""
        some = slice(begin, end + 1)
        line = self._line[some]
        inputs = FleetInputs(self._heave[some], self._rate[some], line[:, 0], line[:, 1])
        record = self.fleet.advance(inputs, interval_steps=end - begin)
        assert not record.failures, record.failures
        return record.top_tension_n

    def measured(self, tension: Floats) -> list[Truth]:
        """Return what the sensors measure of a tension, (steps, truths)."""
        return [
            _measured(seed, self._thetas[k], tension[:, k], self._heave[:, k], self._line[:, 0],
                      copy.deepcopy(self._rngs[k]), self._pin, self._noise_n)
            for k, seed in enumerate(self.seeds)
        ]  # fmt: skip


def scheduled_line(scene: Scene, steps: int) -> Floats:
    """Return paid-out length [m] and its rate by the scene's winch schedule, (steps + 1, 2)."""
    return WinchMotion(scene.winch, scene.ropes[0].length_m, None, STEP_S).through(0, steps)


def _draw(prior: Prior, rng: np.random.Generator) -> Floats:
    """Return a θ from the prior, within MAX_SDS of its mean; friction and delay not negative."""
    theta = prior.mean.copy()  # no truth has the nuisances of the estimator
    reported = slice(len(REPORTED))
    drawn = rng.standard_normal(len(REPORTED)).clip(-MAX_SDS, MAX_SDS)
    theta[reported] += prior.sd[reported] * drawn
    for name in (FRICTION, HEAVE_DELAY):
        theta[INDEX[name]] = max(theta[INDEX[name]], 0.0)
    return theta


def _measured(
    seed: int, theta: Floats, tension: Floats, heave: Floats, line: Floats,
    rng: np.random.Generator, pin: LoadPin, noise_n: float,
) -> Truth:  # fmt: skip
    """Return what the sensors measured; tension: (steps,), heave and line: (steps + 1,)."""
    t = np.asarray(STEP_S * np.arange(len(line)), dtype=np.float64)
    T = np.concatenate([tension[:1], tension])
    reading = pin.measured(T, pin.friction_state(T, line), theta)
    every = round(SENSOR_S / STEP_S)
    ts = t[::every]
    y = reading[::every] + noise_n * rng.standard_normal(len(ts))
    error = _coloured(rng, len(ts))
    late = np.interp(ts - theta[INDEX[HEAVE_DELAY]], t, heave)
    z = np.exp(theta[INDEX[HEAVE_GAIN]]) * late + error
    slip = 1.0 + SLIP_SD * rng.standard_normal()
    counted = line[0] + np.round((line[::every] - line[0]) * slip / COUNTER_M) * COUNTER_M
    return Truth(seed, theta, ts, y, z, counted)


def _coloured(rng: np.random.Generator, count: int) -> Floats:
    """Return the motion sensor's error [m], (count,): band-passed noise of HEAVE_ERROR_M rms."""
    band = [1.0 / period for period in reversed(HEAVE_ERROR_PERIODS_S)]
    sos = butter(2, band, "bandpass", fs=1.0 / SENSOR_S, output="sos")
    error = sosfilt(sos, rng.standard_normal(count + 4000))[4000:]
    return np.asarray(HEAVE_ERROR_M * error / error.std())
