"""Heave of the past two minutes and the next one, as a conditional Gaussian process.

Heave is a stationary Gaussian process with the spectrum of the last ten minutes (Welch 1967). The
motion sensor (MRU) measures that heave with a coloured and a white error, and a wave sensor up-sea
measures a linear function of the same process: an elevation e(d, t) at the distance d up-sea
and the heave z(t) have, per frequency of the wave spectrum S_e with the ship's response H,

    cov(z(t), e(d, t')) = ∫ Re{H·exp(iω(t - t') - ikd)}·S_e df,  k = ω²/g,  S_z = |H|²·S_e.

Given everything measured, true heave is jointly normal at all times, past and future, with mean
and covariance by Kriging (Journel and Huijbregts 1978; Rasmussen and Williams 2006, eq. 2.19), and
paths are drawn from it. Linear waves of one direction in deep water are assumed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rope_twin.errors import InputError

Floats = NDArray[np.float64]
Response = NDArray[np.complex128]

SAMPLE_S = 0.5  # of measured heave and of the paths
WINDOW_S = 200.0  # of Welch's spectrum
RECORD_S = 600.0  # of heave that the spectrum is taken from, at most
SHORTEST_RECORD_S = 120.0
PAST_S, AHEAD_S = 120.0, 60.0  # of the paths
LOWEST_HZ = 0.025  # lower frequencies are sensor filter, tide or ballast
HIGHEST_HZ = 0.45
LINE_HZ = 0.001  # between frequencies of the process, which repeats after 1,000 s
SMALLEST_RESPONSE = 0.1  # heave per elevation above which waves are inferred from heave
GRAVITY = 9.80665
LARGEST_ERROR_SHARE = 0.5  # upper limit of the sensor error in the measured spectrum
# factor on the variance over the lead [s], fitted on 100 seas drawn by seed (17000 on) with the
# spectra of sea_2p5m and sea_6p5m; judged on others by `python -m benchmarks foresight`
WIDENED = (0.0, 20.0, 40.0), (1.3, 1.3, 1.1)
# of the coloured error's standard deviation, taken as white too: heave filters fall off slowly, and
# short leads ask for the smallest parts of a spectrum; fitted on 60 such seas (27000 on)
TAIL_SHARE = 0.15
REACH_S = 400.0  # between two instants of one forecast, by travelling waves too


@dataclass(frozen=True)
class MotionError:
    """Error of a motion sensor: white, and coloured by its heave filter."""

    white_m: float = 0.005  # standard deviation of a sample
    coloured_m: float = 0.032  # standard deviation of the coloured part
    band_hz: tuple[float, float] = (0.025, 0.2)  # of the coloured part, flat inside

    def __post_init__(self) -> None:
        """Check the figures.

        Raises:
            InputError: a deviation is not above (white) or at least 0 m, or the band is empty.
        """
        low, high = self.band_hz
        if not (self.white_m > 0.0 and math.isfinite(self.white_m)):
            problem = f"the white part is {self.white_m:g} m"
            raise InputError("motion error", problem, "give a positive length")
        if not (self.coloured_m >= 0.0 and math.isfinite(self.coloured_m)):
            problem = f"the coloured part is {self.coloured_m:g} m"
            raise InputError("motion error", problem, "give 0 m or more")
        if not 0.0 < low < high < math.inf:
            problem = f"the band is {low:g} to {high:g} Hz"
            raise InputError("motion error", problem, "give two ascending frequencies")

    def density(self, frequency_hz: Floats) -> Floats:
        """Return the one-sided density [m²/Hz] of the coloured part at ascending frequencies (n,).

        Flat in the band with Butterworth edges of the fourth order; its integral over the
        frequencies given is `coloured_m`².
        """
        low, high = self.band_hz
        shape = 1.0 / (1.0 + (low / frequency_hz) ** 8) / (1.0 + (frequency_hz / high) ** 8)
        area = float(np.trapezoid(shape, frequency_hz))
        return np.asarray(shape * (self.coloured_m**2 / area))


@dataclass(frozen=True)
class HeaveSpectrum:
    """One-sided variance density of measured heave on an even grid of frequencies."""

    frequency_hz: Floats  # (n,) LINE_HZ apart
    density_m2_per_hz: Floats  # (n,)

    @property
    def variance_m2(self) -> float:
        """Variance of the heave [m²]."""
        return float(self.density_m2_per_hz.sum()) * self._line_hz

    def autocovariance(self, lag_s: Floats) -> Floats:
        """Return ∫ S(f)·cos(2πfτ) df [m²] at lags [s], (n,)."""
        phase = 2.0 * np.pi * lag_s[:, None] * self.frequency_hz
        return np.asarray(np.cos(phase) @ (self.density_m2_per_hz * self._line_hz))

    @property
    def _line_hz(self) -> float:
        return float(self.frequency_hz[1] - self.frequency_hz[0])


def heave_spectrum(heave_m: Floats) -> HeaveSpectrum:
    """Return the spectrum of a record (n,) by Welch's method (1967).

    Hann windows of WINDOW_S, or of the whole record if it is shorter, overlap by half; the mean
    of each is removed. Linear between the windows' frequencies, zero below LOWEST_HZ.

    Raises:
        InputError: the record is too short, not finite, or still.
    """
    record = _checked(heave_m, "heave")
    min_samples = round(SHORTEST_RECORD_S / SAMPLE_S)
    if len(record) < min_samples:
        problem = f"{len(record) * SAMPLE_S:g} s of it are known"
        raise InputError("heave", problem, f"a spectrum needs {SHORTEST_RECORD_S:g} s")
    count = min(len(record), round(WINDOW_S / SAMPLE_S))
    hop = max(count - count // 2, 1)
    windows = np.lib.stride_tricks.sliding_window_view(record, count)[::hop]
    taper = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(count) / count)
    lines = np.fft.rfft((windows - windows.mean(axis=1, keepdims=True)) * taper, axis=1)
    density = 2.0 * SAMPLE_S / float(taper @ taper) * (np.abs(lines) ** 2).mean(axis=0)
    lines_hz = LINE_HZ * np.arange(round((HIGHEST_HZ - LOWEST_HZ) / LINE_HZ), dtype=np.float64)
    frequency: Floats = np.asarray(LOWEST_HZ + lines_hz)
    resampled = np.interp(frequency, np.fft.rfftfreq(count, SAMPLE_S), density)
    if not resampled.any():
        raise InputError("heave", "the ship lies still", "a spectrum needs a moving ship")
    return HeaveSpectrum(frequency, resampled)


@dataclass(frozen=True)
class MeasuredWaves:
    """Surface elevations measured up-sea of the hang-off."""

    time_s: Floats  # (n,) in the time of the heave
    distance_m: Floats  # (n,) from the hang-off against the direction of propagation
    elevation_m: Floats  # (n,) above the mean water level
    noise_m: float  # standard deviation of each

    def __post_init__(self) -> None:
        """Check shapes and values.

        Raises:
            InputError: unequal lengths, a value that is not finite, or no positive noise.
        """
        rows = (self.time_s, self.distance_m, self.elevation_m)
        if len({len(row) for row in rows}) != 1:
            problem = f"{', '.join(str(len(row)) for row in rows)} times, distances and elevations"
            raise InputError("measured waves", problem, "give as many of each")
        for name, row in zip(("time", "distance", "elevation"), rows, strict=True):
            _checked(row, f"measured waves, {name}")
        if not (self.noise_m > 0.0 and math.isfinite(self.noise_m)):
            problem = f"their noise is {self.noise_m:g} m"
            raise InputError("measured waves", problem, "give a positive length")


@dataclass(frozen=True)
class HeavePaths:
    """Joint normal distribution of the true heave, from the past over the origin into the future.

    The origin is the time of the newest measured sample.
    """

    lead_s: Floats  # (n,) of each sample from the origin on; negative: past
    mean_m: Floats  # (n,)
    covariance_m2: Floats  # (n, n)
    prior_variance_m2: float  # of the sea's heave, which the far future returns to

    def deviation_m(self) -> Floats:
        """Return the standard deviation of each sample [m], (n,)."""
        return np.sqrt(np.maximum(np.diag(self.covariance_m2), 0.0))

    def skill(self) -> Floats:
        """Return 1 - variance/prior variance of each sample, (n,): the expected skill."""
        return np.asarray(1.0 - np.diag(self.covariance_m2) / self.prior_variance_m2)

    def for_unknown_spectrum(self) -> HeavePaths:
        """Return the distribution widened for the uncertainty of a spectrum of ten minutes."""
        return self.widened(np.interp(self.lead_s, *WIDENED))

    def widened(self, variance_factor: Floats) -> HeavePaths:
        """Return the distribution with the variance of each sample times a factor, (n,).

        Correlations are unchanged.
        """
        deviation_factor = np.sqrt(variance_factor)
        covariance = self.covariance_m2 * np.outer(deviation_factor, deviation_factor)
        return HeavePaths(self.lead_s, self.mean_m, covariance, self.prior_variance_m2)

    def draw(self, members: int, random: np.random.Generator) -> Floats:
        """Return paths [m], (members, n), by the eigenvalues of the covariance."""
        eigenvalues, eigenvectors = np.linalg.eigh(self.covariance_m2)
        draws = random.standard_normal((members, len(eigenvalues))) * np.sqrt(
            np.maximum(eigenvalues, 0.0)
        )
        return np.asarray(self.mean_m + draws @ eigenvectors.T)


def condition(
    prior: Floats, cross: Floats, observed: Floats, values: Floats
) -> tuple[Floats, Floats]:
    """Return mean (n,) and covariance (n, n) of normal variables given values of others.

    prior: (n, n) covariance of the variables; cross: (n, m) with the observations; observed:
    (m, m) covariance of the observations, errors included; values: (m,), all of zero mean
    (Rasmussen and Williams 2006, eq. A.6).

    Raises:
        numpy.linalg.LinAlgError: `observed` is not positive definite.
    """
    lower = np.linalg.cholesky(observed)
    explained = np.linalg.solve(lower, cross.T)  # L⁻¹·Gᵀ
    mean = explained.T @ np.linalg.solve(lower, values)
    covariance = prior - explained.T @ explained
    return np.asarray(mean), np.asarray(0.5 * (covariance + covariance.T))


@dataclass(frozen=True)
class HeaveProcess:
    """The process behind measured heave: spectra of the true heave and of the sensor's error."""

    spectrum: HeaveSpectrum  # of the true heave
    error: HeaveSpectrum  # coloured part of the sensor's error
    white_m: float  # standard deviation of its white part

    @classmethod
    def of_record(cls, heave_m: Floats, error: MotionError) -> HeaveProcess:
        """Return the process of a measured record (n,), the newest sample last.

        The error is subtracted from the measured spectrum, at each frequency at most
        LARGEST_ERROR_SHARE of it.

        Raises:
            InputError: the record is too short, not finite, or still.
        """
        measured = heave_spectrum(heave_m[-round(RECORD_S / SAMPLE_S) :])
        frequency, density = measured.frequency_hz, measured.density_m2_per_hz
        error_density = np.minimum(error.density(frequency), LARGEST_ERROR_SHARE * density)
        white_m = math.hypot(error.white_m, TAIL_SHARE * error.coloured_m)
        return cls(
            HeaveSpectrum(frequency, density - error_density),
            HeaveSpectrum(frequency, error_density),
            white_m,
        )

    def paths(
        self,
        heave_m: Floats,
        waves: MeasuredWaves | None = None,
        response: Response | None = None,
    ) -> HeavePaths:
        """Return the distribution of true heave given the newest measured samples.

        Args:
            heave_m: measured about its mean, (n,); the last PAST_S are used.
            waves: elevations up-sea, with times relative to the origin.
            response: heave per wave elevation at the process's frequencies, for exp(+iωt),
                needed with `waves`.

        Raises:
            InputError: too few samples, not finite, or waves without response or out of reach.
        """
        count, ahead = round(PAST_S / SAMPLE_S), round(AHEAD_S / SAMPLE_S)
        record = _checked(heave_m, "heave")
        if len(record) < count:
            problem = f"{len(record) * SAMPLE_S:g} s of it are known"
            raise InputError("heave", problem, f"a forecast needs {PAST_S:g} s")
        number = np.arange(count + ahead)
        lag = np.abs(number[:, None] - number)
        lag_s: Floats = np.asarray(number * SAMPLE_S, np.float64)
        true = self.spectrum.autocovariance(lag_s)
        measured = true[:count] + self.error.autocovariance(lag_s[:count])
        measured[0] += self.white_m**2
        prior, cross = true[lag], true[lag[:, :count]]
        observed, values = measured[lag[:count, :count]], record[-count:]
        lead_s: Floats = np.asarray(lag_s - lag_s[count - 1])
        if waves is not None:
            block = _WaveBlock.between(self.spectrum, waves, response)
            with_paths = block.with_heave(lead_s)
            cross = np.hstack([cross, with_paths])
            observed = np.block(
                [[observed, with_paths[:count]], [with_paths[:count].T, block.covariance()]]
            )
            values = np.concatenate([values, waves.elevation_m])
        mean, covariance = condition(prior, cross, observed, values)
        return HeavePaths(lead_s, mean, covariance, self.spectrum.variance_m2)


@dataclass(frozen=True)
class _WaveBlock:
    """Elevations up-sea as observations of the process, line by line of its wave spectrum."""

    waves: MeasuredWaves
    omega: Floats  # (n,) [rad/s]
    variance_m2: Floats  # (n,) of the elevation
    shared_m2: Response  # (n,) covariance of heave and elevation at one place and instant

    @classmethod
    def between(
        cls, spectrum: HeaveSpectrum, waves: MeasuredWaves, response: Response | None
    ) -> _WaveBlock:
        """Return the block for a spectrum of heave, whose waves follow by the response.

        Where the ship responds, S_e = S_z/|H|²; between such frequencies it is interpolated, above
        them it falls as f⁻⁴ (Toba 1973) with the remaining variance of the elevations.
        """
        frequency = spectrum.frequency_hz
        if response is None or len(response) != len(frequency):
            remedy = "give the ship's heave response at the frequencies of the process"
            raise InputError("measured waves", "no response belongs to them", remedy)
        omega = 2.0 * np.pi * frequency
        fastest = GRAVITY / (2.0 * omega[0])  # group velocity of the longest waves
        span_s = float(np.max(np.abs(waves.time_s), initial=0.0))
        span_s += float(np.max(np.abs(waves.distance_m), initial=0.0)) / fastest
        if span_s > REACH_S:
            problem = f"they are {span_s:.0f} s from the origin, by time and distance"
            raise InputError("measured waves", problem, f"right is at most {REACH_S:g} s")
        gain = np.abs(response)
        follows = np.flatnonzero(gain > SMALLEST_RESPONSE)
        if not len(follows):
            remedy = "waves up-sea say nothing about it"
            raise InputError("measured waves", "the ship answers none of them", remedy)
        line_hz = float(frequency[1] - frequency[0])
        heave = spectrum.density_m2_per_hz * line_hz
        variance = np.interp(frequency, frequency[follows], (heave / gain**2)[follows], right=0.0)
        measured = float(np.var(waves.elevation_m)) - waves.noise_m**2
        tail = np.where(np.arange(len(frequency)) > follows[-1], frequency**-4.0, 0.0)
        if tail.any():
            variance = variance + tail * (max(measured - variance.sum(), 0.0) / tail.sum())
        coherent = np.minimum(variance, heave / np.maximum(gain, 1e-9) ** 2)  # coherence at most 1
        return cls(waves, omega, variance, response * coherent)

    def with_heave(self, time_s: Floats) -> Floats:
        """Return the covariance [m²] with the heave at times (m,), (m, n)."""
        covariance = np.exp(1j * self.omega * time_s[:, None]) * self.shared_m2
        return np.asarray((covariance @ self._phases().conj().T).real)

    def covariance(self) -> Floats:
        """Return the covariance [m²] of the elevations, noise included, (n, n)."""
        phases = self._phases()
        elevation = ((phases * self.variance_m2) @ phases.conj().T).real
        return np.asarray(elevation + self.waves.noise_m**2 * np.eye(len(phases)))

    def _phases(self) -> Response:
        """Return exp(i(ωt + kd)), (elevations, lines)."""
        wave_number = self.omega**2 / GRAVITY
        phase = self.omega * self.waves.time_s[:, None]
        phase += wave_number * self.waves.distance_m[:, None]
        return np.asarray(np.exp(1j * phase))


def _checked(values: Floats, quantity: str) -> Floats:
    """Return a finite vector. Raises InputError."""
    vector = np.asarray(values, np.float64)
    if vector.ndim != 1 or not np.isfinite(vector).all():
        remedy = "give one row of finite numbers"
        raise InputError(quantity, "it has gaps, or is not a row of numbers", remedy)
    return vector
