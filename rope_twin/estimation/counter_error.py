"""Error that the rounding of a line counter leaves, as hidden figures that return with the counts.

Where the line runs steadily it is a straight line (`measured_lift.straightened`). Where it starts
and stops an error of a part of the resolution is left, which shakes a short rope of the model at
its own period. Each minute does not draw it again: it follows from the counts, so that a start with
the counts of one before has the same error, and tells nothing new of it.

So the error is a figure of its own at each knot of such a passage, and linear between knots. It is
learned together with θ, by the columns A of the tension:

    y = ŷ(θ) + A·x + n,   x_k ~ N(0, s_k²),   s_k² = c·Δ²/12,

with the resolution Δ, the variance Δ²/12 of a rounding error (Widrow 1956), and c the share of it
that smoothing leaves: 1 where the counts repeat. A passage with new counts has new figures. One
with the counts of a passage before has the figures of that, with what was learned of them and their
correlation with θ. Figures of counts that do not come again are noise with the covariance A·S·Aᵀ:
they are considered, and forgotten (Schmidt 1966).

A is the response of the hanging bar to a motion of its top, by the top impedance: a piecewise
linear error is a sum of ramps.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass

import numpy as np

from rope_twin.core.state import Floats, Ints
from rope_twin.estimation.figures import NAMES, Gaussian
from rope_twin.estimation.measured_lift import MEAN_S, UnsteadyStretch
from rope_twin.estimation.noise import FREQUENCY_HZ, FREQUENCY_STEP_HZ, Complexes

KNOT_S = 0.3  # between knots: the smoothing resolves no less
GRID_S = 0.05  # of the response
GRID = round(1.0 / (FREQUENCY_STEP_HZ * GRID_S))  # over its period
PER_MEAN = round(MEAN_S / GRID_S)
KEPT_BLOCKS = 3  # since its passage came last, before a figure is forgotten


@dataclass(frozen=True)
class CounterErrors:
    """Knots of the line's error over a block, and the figure of each."""

    knots_s: Floats  # (m,) rising
    keys: tuple[Hashable, ...]  # (m,) of the figures; equal: the same figure
    sd_m: Floats  # (m,) of the figures' priors

    @classmethod
    def of(cls, passages: Sequence[UnsteadyStretch]) -> CounterErrors:
        """Return the errors of passages, which are in the order of time."""
        knots: list[float] = []
        keys: list[Hashable] = []
        sd: list[float] = []
        for passage in passages:
            count = 1 + max(1, round((passage.end_s - passage.begin_s) / KNOT_S))
            knots_s = np.linspace(passage.begin_s, passage.end_s, count)
            knots += knots_s.tolist()
            keys += [(passage.counts, k) for k in range(count)]
            sd += passage.sd_at(knots_s).tolist()
        return cls(np.array(knots), tuple(keys), np.array(sd))

    def columns(self, impedance: Complexes, begin_s: float, count: int) -> Floats:
        """Return the change of means of the tension per error of each knot, (count, m) [N/m].

        The error is the sum of ramps from the knots on, that change its slope there. impedance:
        of the top at FREQUENCY_HZ [N/m]; begin_s: of the first mean.
        """
        since_s, ramp = _response_to_ramp(impedance)
        ends = begin_s + MEAN_S * np.arange(1, count + 1)
        ramps = np.interp(ends[:, None] - self.knots_s, since_s, ramp, left=0.0)
        slopes = np.diff(ramps, axis=1) / np.diff(self.knots_s)  # of the pieces between knots
        return np.asarray(np.diff(slopes, axis=1, prepend=0.0, append=0.0))


def _response_to_ramp(impedance: Complexes) -> tuple[Floats, Floats]:
    """Return times [s] and the means of the tension up to then when the line pays out at 1 m/s.

    The tension of a speed step is that of Z/(iω)², which is finite at 0 and real: a mass.
    """
    number = np.round(FREQUENCY_HZ / FREQUENCY_STEP_HZ).astype(np.int64)
    spectrum = np.zeros(GRID // 2 + 1, complex)
    spectrum[number] = impedance / (2.0 * np.pi * FREQUENCY_HZ) ** 2
    spectrum[: number[0]] = spectrum[number[0]].real
    tension = np.fft.irfft(spectrum, GRID) * GRID * FREQUENCY_STEP_HZ
    integral = np.concatenate([np.zeros(PER_MEAN + 1), np.cumsum(tension)]) * GRID_S
    means = (integral[PER_MEAN:] - integral[:-PER_MEAN]) / MEAN_S
    return np.asarray(GRID_S * (np.arange(len(means)) - 0.5), float), np.asarray(means)


class ErrorMemory:
    """Errors of passages as far as they are known, with their correlation with θ."""

    def __init__(self, figures: int = len(NAMES)) -> None:
        """Begin without errors; figures: number of θ."""
        self.keys: list[Hashable] = []
        self._age: list[int] = []  # blocks since the passage came
        self._mean: Floats = np.empty(0)
        self._covariance: Floats = np.empty((0, 0))
        self._cross: Floats = np.empty((0, figures))

    def __len__(self) -> int:
        return len(self.keys)

    def take(self, errors: CounterErrors) -> Ints:
        """Return the place of each knot's figure, (m,); forget those that no block had for long."""
        current = set(errors.keys)
        self._age = [0 if key in current else age + 1 for key, age in
                     zip(self.keys, self._age, strict=True)]  # fmt: skip
        remembered = np.flatnonzero(np.array(self._age, int) < KEPT_BLOCKS)
        self.keys = [self.keys[k] for k in remembered]
        self._age = [self._age[k] for k in remembered]
        self._mean, self._cross = self._mean[remembered], self._cross[remembered]
        self._covariance = self._covariance[np.ix_(remembered, remembered)]
        place = {key: k for k, key in enumerate(self.keys)}
        variances = []
        for key, sd in zip(errors.keys, errors.sd_m.tolist(), strict=True):
            if key not in place:
                place[key] = len(self.keys)
                self.keys.append(key)
                self._age.append(0)
                variances.append(sd**2)
        old, new = len(remembered), len(self.keys)
        self._mean = np.pad(self._mean, (0, new - old))
        self._cross = np.pad(self._cross, ((0, new - old), (0, 0)))
        self._covariance = np.pad(self._covariance, (0, new - old))
        self._covariance[range(old, new), range(old, new)] = variances
        return np.array([place[key] for key in errors.keys], dtype=np.int64)

    def with_errors(self, belief: Gaussian) -> Gaussian:
        """Return the joint Gaussian of θ, (figures,), and the errors, (n,)."""
        covariance = np.block([[belief.covariance, self._cross.T], [self._cross, self._covariance]])
        return Gaussian(np.concatenate([belief.mean, self._mean]), covariance)

    def learn(self, joint: Gaussian) -> None:
        """Take the posterior of θ and the errors, (figures + n,)."""
        count = self._cross.shape[1]
        self._mean = joint.mean[count:].copy()
        self._covariance = joint.covariance[count:, count:].copy()
        self._cross = joint.covariance[count:, :count].copy()
