"""Plausibility of the ship's motion: limits, continuity after a gap, rates, and sampling rate.

Rates: over the last 0.5, 1 and 2 s the change of each position must equal the integral of its rate,
Δz = ∫ v dt. The tolerance is 4·√2·σ of white noise (σ is estimated from the second differences of z
- ∫ v dt, at most 5 cm), τ·|Δv| for a delay between position and rate (τ = 0.2 s), and 0.05 m/s and
5 % of the rate for its own errors. Three consecutive samples beyond that are a disagreement; so is
one rate beyond the ship's limits. The rates are then derived from the positions, by a parabola
through the last ones (three where there is no noise, up to RATE_SAMPLES where there is).

Continuity: a position must be where the last one, its rate and the acceleration limit allow, with
6·√2·σ for noise; a jump beyond speed limit times gap is rejected. After a jump, and after 2 s
without an accepted sample, samples are accepted again once they have agreed with each other for 0.5
s.

Sampling rate: between samples the cubic Hermite polynomial holds. Its error over a piece of length
h is at most h⁴/384 times the fourth derivative, which is (2π·h/T)⁴/384 of the amplitude of a sine
of period T: with T the shortest relevant period and a fraction of 1e-4 the needed interval is
0.0705·T (there the error of the acceleration is (2π·h/T)²/12, 1.6 %). A step needs the sample after
it too: the input delay must be at least the interval, the transport delay and a real-time cycle.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from rope_twin.effects.waves import WavesParams, components_of
from rope_twin.scene.schema import Scene, Ship

Numbers = tuple[float, ...]
Reason = tuple[()] | tuple[str, str]  # of a rejection: problem and remedy
# stamp [ns], values, their rates as sent, values less the integral of the rates
RateSample = tuple[int, Numbers, Numbers, Numbers]

NOISE_M, NOISE_RAD = 0.05, 0.002  # standard deviation of white noise of a good sensor
MIN_NOISE_FRACTION = 0.1  # minimum noise assumed, as a fraction of the maximum
# Standard deviations of a difference of two positions; the second where a single one decides.
DISAGREEMENT_SIGMAS, JUMP_SIGMAS = 4.0 * math.sqrt(2.0), 6.0 * math.sqrt(2.0)
RATE_DELAY_S = 0.2  # between position and rate of one sensor
RATE_BIAS, RATE_FRACTION = 1.0, 0.05  # error of a rate: NOISE_... per second, and its fraction
RATE_SPIKE = 10.0  # sudden change of a rate that is allowed, in NOISE_... per second
WINDOWS_NS = 500_000_000, 1_000_000_000, 2_000_000_000
SCATTER_WARN = 1.6  # times the noise of a good sensor: noise above it, or several senders
JITTER_WARN = 2.0  # noise of the rate between two samples, in NOISE_... per second ...
MAX_JITTER = 6.0  # ... of which one sample adds at most so much: a single one is no noise
DISAGREEING_SAMPLES = 3  # consecutive samples of a disagreement
AGREEMENT_NS = 5_000_000_000  # time of agreement after which the sender's rates are used again
PERSISTENT_NS = 10_000_000_000  # duration after which a disagreement is an error
RATE_SAMPLES = 40  # maximum number of positions from which a rate is derived ...
RATE_NOISE = 2.0  # ... and noise of that rate, in NOISE_... per second
SMOOTHING = 0.02  # weight of a sample in the estimate of noise

BREAK_NS = 1_000_000_000  # between two samples: nothing is integrated across it
JUMP_NOISE_M = 0.25  # contribution of noise to a jump
JUMP_RESOLUTION_M = 0.01  # resolution of a sensor
REACQUIRE_NS = 2_000_000_000  # gap after which the position must be confirmed again
CONFIRM_NS, CONFIRM_SAMPLES = 500_000_000, 3  # duration and number of agreeing samples
ACCELERATION_NS = 400_000_000  # minimum time over which the acceleration is checked


@dataclass(frozen=True)
class MotionLimits:
    """Limits of a hang-off's motion."""

    heave_m: float
    speed_m_per_s: float
    acceleration_m_per_s2: float

    @classmethod
    def of(cls, ship: Ship) -> MotionLimits:
        """Return the limits of a scene's ship."""
        return cls(
            ship.max_heave_m,
            ship.max_hang_off_speed_m_per_s,
            ship.max_hang_off_acceleration_m_per_s2,
        )


class Continuity:
    """Check of positions (z,) or (x, y, z) against those of preceding samples."""

    def __init__(self, limits: MotionLimits) -> None:
        self._limits = limits
        self._last: tuple[int, Numbers] | None = None
        self._has_jumped = False  # whether a jump was rejected since the last accepted sample
        self._trial: list[tuple[int, Numbers]] = []  # first and newest of samples to be confirmed
        self._trial_samples = 0
        self._rates: deque[tuple[int, Numbers]] = deque()  # (stamp, rates) of accepted samples
        self.confirmed = False  # whether positions after a gap or jump are confirmed, not yet used

    def forget(self) -> None:
        """Accept the next sample at any position."""
        self._last = None
        self._has_jumped = False
        self._end_trial()
        self._rates.clear()

    def fault(self, stamp_ns: int, position: Numbers, noise: float) -> tuple[str, Reason]:
        """Return the kind of rejection and its reason; both empty if the position is plausible.

        noise: standard deviation of the noise of positions [m].
        """
        if self._last is None:
            return "", ()
        gap_s = (stamp_ns - self._last[0]) * 1e-9
        jump_m = math.dist(position, self._last[1])
        speed = self._limits.speed_m_per_s
        if jump_m > speed * gap_s + JUMP_NOISE_M:
            self._has_jumped = True
            self._end_trial()
            problem = f"it jumps by {jump_m:.2f} m in {gap_s:.3f} s"
            remedy = f"a ship moves by at most {speed:g} m/s (ship.max_hang_off_speed_m_per_s)"
            return "impossible", (problem, remedy)
        after_gap = gap_s * 1e9 > REACQUIRE_NS
        if not (self._trial or after_gap) and self._is_expected(gap_s, position, noise):
            return "", ()
        self.confirmed = self._is_confirmed(stamp_ns, position)
        if self.confirmed:
            return "", ()
        problem = f"after {gap_s:.2f} s it is {jump_m:.2f} m from where it was"
        remedy = f"it is taken once it has moved plausibly for {CONFIRM_NS * 1e-9:g} s"
        return "unconfirmed", (problem, remedy)

    def acceleration_fault(self, stamp_ns: int, rates: Numbers, noise: float) -> Reason:
        """Return why these rates [m/s] do not follow the preceding ones; or nothing."""
        while len(self._rates) > 1 and stamp_ns - self._rates[1][0] >= ACCELERATION_NS:
            self._rates.popleft()
        if self.confirmed or not self._rates:
            return ()
        if not ACCELERATION_NS <= stamp_ns - self._rates[0][0] <= BREAK_NS:
            return ()
        interval_s = (stamp_ns - self._rates[0][0]) * 1e-9
        change = math.dist(rates, self._rates[0][1])
        limit = self._limits.acceleration_m_per_s2
        if change <= limit * interval_s + noise:
            return ()
        remedy = f"a ship's is at most {limit:g} m/s² (ship.max_hang_off_acceleration_m_per_s2)"
        return f"an acceleration of {change / interval_s:.1f} m/s²", remedy

    def forget_rates(self) -> None:
        """Skip the next comparison of rates, as they are obtained in another way."""
        self._rates.clear()

    def accept(self, stamp_ns: int, position: Numbers, rates: Numbers) -> None:
        """Record an accepted sample, with the rates that were used."""
        if self.confirmed:
            self._end_trial()
            self._rates.clear()
        self._last = stamp_ns, position
        self._has_jumped = False
        self._rates.append((stamp_ns, rates))

    def _is_expected(self, gap_s: float, position: Numbers, noise: float) -> bool:
        """Return whether a position is where the last one, its rate and the limits allow.

        A sample after an outlier must be closer: a position within the acceleration limit over so
        long a time does not show that the jump was a motion of the ship.
        """
        assert self._last is not None
        rates = self._rates[-1][1]
        expected = [z + v * gap_s for z, v in zip(self._last[1], rates, strict=True)]
        acceleration = self._limits.acceleration_m_per_s2 * (0.1 if self._has_jumped else 1.0)
        allowed = JUMP_SIGMAS * noise + JUMP_RESOLUTION_M + 0.5 * acceleration * gap_s * gap_s
        if math.dist(position, expected) <= allowed:
            return True
        self._has_jumped = True
        return False

    def _is_confirmed(self, stamp_ns: int, position: Numbers) -> bool:
        """Return whether samples since a gap have agreed with each other for long enough."""
        if self._trial:
            last_ns, last = self._trial[-1]
            gap_s = (stamp_ns - last_ns) * 1e-9
            reach_m = self._limits.speed_m_per_s * gap_s + JUMP_NOISE_M
            if gap_s * 1e9 > BREAK_NS or math.dist(position, last) > reach_m:
                self._end_trial()
        self._trial = [*self._trial[:1], (stamp_ns, position)]
        self._trial_samples += 1
        long_enough = stamp_ns - self._trial[0][0] >= CONFIRM_NS
        return long_enough and self._trial_samples >= CONFIRM_SAMPLES

    def _end_trial(self) -> None:
        self._trial, self._trial_samples, self.confirmed = [], 0, False


class RateCheck:
    """Check of the rates of some values against the values themselves."""

    def __init__(self, noise: float, limit: float, acceleration: float) -> None:
        """Set NOISE_M or NOISE_RAD, and the limits of a rate and of its change."""
        self._noise, self._limit, self._acceleration = noise, limit, acceleration
        self._samples: list[RateSample] = []
        self._stamps: list[int] = []  # of the samples
        self._used: Numbers = ()  # rates used for the newest sample
        self._roughness = 6.0 * noise * noise  # mean square of second differences of z - ∫ v dt
        self._jitter = 0.0  # mean square of the noise of the rate between two samples
        self._votes = 0
        self._since_ns: int | None = None  # beginning of the present disagreement
        self._is_derived = False  # whether the newest rates were derived
        self.switched = False  # whether that has changed with the newest sample
        self._newest_bad_ns = 0

    @property
    def disagrees(self) -> bool:
        """Whether the rates are derived at present."""
        return self._since_ns is not None

    def disagrees_for_s(self) -> float:
        """Return the duration of the present disagreement of positions and rates [s]."""
        return 0.0 if self._since_ns is None else (self._newest_bad_ns - self._since_ns) * 1e-9

    @property
    def noise(self) -> float:
        """Estimated standard deviation of the values' noise, within its limits."""
        return min(max(self.scatter, MIN_NOISE_FRACTION * self._noise), self._noise)

    @property
    def scatter(self) -> float:
        """Estimated standard deviation of the values' noise."""
        return math.sqrt(self._roughness / 6.0)

    @property
    def scatters(self) -> bool:
        """Whether the values are noisier than those of a good sensor."""
        return self.scatter > SCATTER_WARN * self._noise

    @property
    def jitter(self) -> float:
        """Estimated noise of the rate at which the values move from sample to sample.

        White noise σ of the values at an interval h is √2·σ/h of that rate, which the rope feels: a
        wave of tension √(EA·m) times the speed runs down from each sample.
        """
        return math.sqrt(self._jitter)

    @property
    def is_jittery(self) -> bool:
        """Whether that noise is more than a rate's own inaccuracy explains."""
        return self.jitter > JITTER_WARN * self._noise

    @property
    def derived_noise(self) -> float:
        """Maximum change of a rate by noise, sent or derived."""
        return RATE_SPIKE * self._noise

    def forget(self) -> None:
        """Restart as after a gap; a disagreement continues until it heals."""
        self._samples.clear()
        self._stamps.clear()
        self._used, self._votes = (), 0

    def rates(self, stamp_ns: int, value: Numbers, rate: Numbers) -> Numbers | None:
        """Take a sample; return the rates to use.

        They are the given ones while these agree with the values. None: they are impossible, and
        there are too few values to derive others.
        """
        while self._samples and self._samples[-1][0] >= stamp_ns:
            del self._samples[-1], self._stamps[-1]  # it was rejected for another reason
        if self._samples and stamp_ns - self._samples[-1][0] > BREAK_NS:
            self.forget()
        sudden = self._is_impossible(stamp_ns, rate)
        self._store(stamp_ns, value, rate)
        self._votes = self._votes + 1 if self._disagree() else 0
        if sudden or self._votes >= DISAGREEING_SAMPLES:
            self._newest_bad_ns = stamp_ns
            if self._since_ns is None:
                self._since_ns = stamp_ns
        elif self._since_ns is not None and stamp_ns - self._newest_bad_ns > AGREEMENT_NS:
            self._since_ns = None
        derived = self._derived_rates() if self.disagrees else None
        if derived is None and sudden:
            return None
        self.switched = (derived is not None) != self._is_derived
        self._is_derived = derived is not None
        self._used = rate if derived is None else derived
        return self._used

    def _is_impossible(self, stamp_ns: int, rate: Numbers) -> bool:
        """Return whether a rate is beyond its limits, by itself or after the preceding one."""
        if max(rate) > self._limit or min(rate) < -self._limit:
            return True
        if not self._used or not self._samples:
            return False
        interval_s = (stamp_ns - self._samples[-1][0]) * 1e-9
        max_change = self._acceleration * interval_s + RATE_SPIKE * self._noise
        return max([abs(a - b) for a, b in zip(rate, self._used, strict=True)]) > max_change

    def _store(self, stamp_ns: int, value: Numbers, rate: Numbers) -> None:
        limit = self._limit
        if max(rate) > limit or min(rate) < -limit:
            rate = tuple([min(max(component, -limit), limit) for component in rate])
        remainder = value
        if self._samples:
            last_ns, values, rates, remainders = self._samples[-1]
            half_interval = 0.5e-9 * (stamp_ns - last_ns)
            columns = zip(value, rate, values, rates, remainders, strict=True)
            remainder = tuple(
                [r + z - z0 - half_interval * (v + v0) for z, v, z0, v0, r in columns]
            )
        self._samples.append((stamp_ns, value, rate, remainder))
        self._stamps.append(stamp_ns)
        if len(self._samples) > 2:
            pairs = zip(self._samples[-3][3], self._samples[-2][3], remainder, strict=True)
            roughness = max([abs(x - 2.0 * y + z) for x, y, z in pairs])
            roughness = min(roughness, 10.0 * self._noise) ** 2
            self._roughness += SMOOTHING * (roughness - self._roughness)
            (t0, *_, r0), (t1, *_, r1), (t2, *_) = self._samples[-3:]
            early, late = (t1 - t0) * 1e-9, (t2 - t1) * 1e-9
            triples = zip(r0, r1, remainder, strict=True)
            jitter = max([abs((z - y) / late - (y - x) / early) for x, y, z in triples])
            jitter = min(jitter / math.sqrt(3.0), MAX_JITTER * self._noise) ** 2
            self._jitter += SMOOTHING * (jitter - self._jitter)
        is_full = len(self._samples) > 2 * RATE_SAMPLES
        if is_full and self._samples[RATE_SAMPLES][0] < stamp_ns - WINDOWS_NS[-1] - BREAK_NS:
            del self._samples[:RATE_SAMPLES], self._stamps[:RATE_SAMPLES]

    def _disagree(self) -> bool:
        """Return whether values and integrated rates differ more than those of a good sensor."""
        samples, tolerance = self._samples, DISAGREEMENT_SIGMAS * self.noise
        newest, k = samples[-1], len(samples)
        for window_ns in WINDOWS_NS:
            k = bisect_right(self._stamps, newest[0] - window_ns, hi=k)
            if k == 0:
                return False
            earlier = samples[k - 1]
            window_s = (newest[0] - earlier[0]) * 1e-9
            allowed = tolerance + RATE_BIAS * self._noise * window_s
            for a, b, v, w in zip(earlier[3], newest[3], earlier[2], newest[2], strict=True):
                if abs(b - a) > allowed and abs(b - a) > allowed + self._sensor_error(
                    window_s, v, w
                ):
                    return True
        return False

    def _sensor_error(self, seconds: float, v: float, w: float) -> float:
        """Return the allowed error of a rate's integral from v to w, by delay and inaccuracy."""
        delay = RATE_DELAY_S * min(abs(w - v), self._acceleration * seconds)
        return delay + RATE_FRACTION * seconds * max(abs(v), abs(w))

    def _derived_rates(self) -> Numbers | None:
        """Return end slopes of parabolas through the last values; None: too few values."""
        samples = self._samples
        if len(samples) < 3:
            return None
        step_s = max((samples[-1][0] - samples[-3][0]) * 0.5e-9, 1e-3)
        # noise σ of values becomes σ·√(192/n³)/h of the slope at the end of n of them
        ratio = self.noise / (RATE_NOISE * self._noise * step_s)
        wanted = math.ceil((192.0 * ratio * ratio) ** (1.0 / 3.0))
        if self.noise <= MIN_NOISE_FRACTION * self._noise:
            wanted = 3
        last = samples[-min(max(wanted, 3), RATE_SAMPLES, len(samples)) :]
        times = [(stamp_ns - last[-1][0]) * 1e-9 for stamp_ns, *_ in last]
        columns = zip(*(value for _, value, _, _ in last), strict=True)
        slopes = (end_slope(times, column) for column in columns)
        return tuple(min(max(slope, -self._limit), self._limit) for slope in slopes)


def end_slope(times: Sequence[float], values: Sequence[float]) -> float:
    """Return the slope at time 0 of the best-fit parabola through three or more values."""
    s1 = s2 = s3 = s4 = y0 = y1 = y2 = 0.0
    for t, value in zip(times, values, strict=True):
        z, t2 = value - values[-1], t * t
        s1, s2, s3, s4 = s1 + t, s2 + t2, s3 + t2 * t, s4 + t2 * t2
        y0, y1, y2 = y0 + z, y1 + t * z, y2 + t2 * z
    n = float(len(times))
    determinant = n * (s2 * s4 - s3 * s3) - s1 * (s1 * s4 - s2 * s3) + s2 * (s1 * s3 - s2 * s2)
    # the second unknown by Cramer's rule
    upper = n * (y1 * s4 - y2 * s3) - y0 * (s1 * s4 - s2 * s3) + s2 * (s1 * y2 - s2 * y1)
    return upper / determinant


INTERPOLATION_TOL = 1e-4  # allowed interpolation error over the motion's amplitude
TIMED_SAMPLES = 20  # number of intervals of the median
MISSING_FRACTION = 0.01  # allowed fraction of time without the sample after the step
SLOT_S = 0.02  # real-time cycle
INTERVAL_TOL = 1.02  # allowed jitter of the median interval
RECORDED_PERIOD_S = 5.0  # 99.9 % of the acceleration variance of recorded heave is slower
WAVE_ENERGY_FRACTION = 0.95  # fraction of the waves' energy above the shortest relevant period


def is_moved(scene: Scene) -> bool:
    """Return whether the scene's sea moves the ship, so that motion samples must come."""
    heave = scene.sea_state.heave
    return scene.sea_state.moves and (heave is None or heave.amplitude_m > 0.0)


def shortest_period_s(scene: Scene) -> float:
    """Return the shortest relevant period of the ship's motion [s].

    For a sine its period; in the scene's waves the period above which WAVE_ENERGY_FRACTION of their
    energy lies; otherwise, for a record or a live ship, RECORDED_PERIOD_S.
    """
    if scene.sea_state.heave is not None:
        return scene.sea_state.heave.period_s
    params = scene.listed(WavesParams)
    if scene.sea_state.on_waves is None or params is None:
        return RECORDED_PERIOD_S
    waves = components_of(params, scene.environment.gravity_m_per_s2)
    order = np.argsort(waves.omega)
    energy = np.cumsum(waves.amplitude_m[order] ** 2)
    fastest = waves.omega[order][int(np.searchsorted(energy, WAVE_ENERGY_FRACTION * energy[-1]))]
    return float(2.0 * np.pi / fastest)


def needed_interval_s(shortest_period_s: float) -> float:
    """Return the longest interval between samples [s] that keeps the error within its limit."""
    return math.sqrt(math.sqrt(384.0 * INTERPOLATION_TOL)) * shortest_period_s / math.tau


class SampleTiming:
    """Monitor of the sampling interval, and of the availability of the sample after each step."""

    def __init__(self, needed_s: float) -> None:
        """Set the longest sufficient interval between samples [s]."""
        self._needed_s = needed_s
        self._taken: deque[tuple[int, int, int]] = deque(maxlen=TIMED_SAMPLES + 1)

    def take(self, stamp_ns: int, asked_ns: int, missing_ns: int) -> None:
        """Take a sample's stamp, the latest time requested, and the time without samples [ns]."""
        self._taken.append((stamp_ns, asked_ns, missing_ns))

    @property
    def interval_s(self) -> float:
        """Median interval between the newest stamps [s]; NaN: too few."""
        if len(self._taken) <= TIMED_SAMPLES // 4:
            return math.nan
        stamps = [stamp for stamp, _, _ in self._taken]
        intervals = sorted(b - a for a, b in pairwise(stamps))
        return intervals[len(intervals) // 2] * 1e-9

    def fault(self, lateness_s: float) -> str:
        """Return the message on samples that come too slowly, with the remedy; or "".

        lateness_s: arrival less stamp of the later samples [s].
        """
        interval_s = self.interval_s
        if math.isnan(interval_s):
            return ""
        delay_s = interval_s + lateness_s + SLOT_S
        if interval_s > INTERVAL_TOL * self._needed_s:
            sufficient_s = self._needed_s + lateness_s + SLOT_S
            return (
                f"a sample every {interval_s:.3f} s is too slow: this scene needs one every "
                f"{self._needed_s:.3f} s ({1.0 / self._needed_s:.1f} Hz) and input_delay_s of "
                f"{sufficient_s:.2f} s; at the present rate {delay_s:.2f} s"
            )
        first, last = self._taken[0], self._taken[-1]
        asked_ns, missing_ns = last[1] - first[1], last[2] - first[2]
        if missing_ns <= MISSING_FRACTION * asked_ns or asked_ns <= 0:
            return ""
        return (
            f"for {100.0 * missing_ns / asked_ns:.0f} % of the time the sample after the step had "
            f"not come: with one every {interval_s:.3f} s set input_delay_s to {delay_s:.2f} s or "
            "more"
        )
