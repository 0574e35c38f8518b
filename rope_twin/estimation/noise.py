"""Error of the measured heave, and covariance of what it and the load pin leave of the tension.

The model is driven by the expected heave given all its samples, not by the measured one: figures
fitted to a motion that has an error come out biased, as if the rope answered less (errors in
variables; Carroll et al. 2006, chapter 4). With the spectra S_m of the measured heave and S_e of
its error, the share of the error is h = S_e/(S_m + S_e), and

    E[z|m] = K_z·K_m⁻¹·m,   S_left = S_m·h·(1 - h)

with the covariances K of true and measured heave. What is left acts on the real rope as a motion
that the model does not have: r(τ) = ∫|Z(f)|²·S_left(f)·cos 2πfτ df with the top impedance Z. Other
errors of the model have spectra of their own: each octave has a level, R = σ²·I + Σ
α_j²·Toeplitz(r_j). The levels and σ follow the last blocks by maximum posterior probability.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.linalg import cho_factor, cho_solve, cholesky, solve_triangular, toeplitz
from scipy.signal import welch

from rope_twin.core.state import Floats
from rope_twin.estimation.impedance import STANDING, Bar, top_impedance

FREQUENCY_STEP_HZ = 0.0025
FREQUENCY_HZ = np.arange(0.005, 1.0, FREQUENCY_STEP_HZ)
ERROR_BAND_HZ = 0.025, 0.20  # in which the spectrum of the heave's error is flat
LEVEL_BORDERS_HZ = 0.10, 0.20  # above which the error has a level of its own, learned
ESTIMATE_S = 0.5  # between the samples that the true heave is estimated from
ROUNDING_M = 5e-4  # white part of the heave there
OCTAVES_HZ = 0.05, 0.10  # borders of the octaves of that band, each with its level
BANDS = len(OCTAVES_HZ) + 1
WELCH_S = 60.0  # segments of the heave's spectrum: three in the first two minutes
KEPT_BLOCKS = 5  # whose residuals decide on α and σ
LEVELS = 0.3, 0.5, 0.75, 1.0, 1.4, 2.0, 3.0  # α_j that are tried
WHITES = 0.9, 1.0, 1.2, 1.6, 2.5  # σ that are tried, over the nominal one
LEVEL_SD, WHITE_SD = 0.5, 0.2  # of the log-normal priors
MOST_SQUARE = 16.0  # of a whitened residual in the likelihood: outliers do not decide


def heave_spectrum(heave_m: Floats, interval_s: float) -> Floats:
    """Return the one-sided spectrum of evenly spaced heave [m²/Hz] at FREQUENCY_HZ (Welch 1967)."""
    segment = min(len(heave_m), round(WELCH_S / interval_s))
    frequency, psd = welch(heave_m, fs=1.0 / interval_s, nperseg=segment)
    return np.asarray(np.interp(FREQUENCY_HZ, frequency, psd))


def heave_error_spectrum(sd_m: float) -> Floats:
    """Return the specified spectrum of the heave's error [m²/Hz] at FREQUENCY_HZ.

    It is flat in ERROR_BAND_HZ, with the standard deviation sd_m there. Above it falls as 1/f⁴,
    which a white error of the acceleration leaves after two integrations.
    """
    low, high = ERROR_BAND_HZ
    shape = 1.0 / (1.0 + (low / FREQUENCY_HZ) ** 8) / (1.0 + (FREQUENCY_HZ / high) ** 4)
    band = (low <= FREQUENCY_HZ) & (high >= FREQUENCY_HZ)
    return np.asarray(shape * sd_m**2 / (shape[band].sum() * FREQUENCY_STEP_HZ))


@dataclass(frozen=True)
class HeaveSpectra:
    """Spectra at FREQUENCY_HZ [m²/Hz]: of the measured heave, and of the error in it."""

    measured: Floats
    error: Floats  # less than `measured`

    @property
    def left(self) -> Floats:
        """Return the spectrum of the error that the expected heave leaves."""
        return self.error * (1.0 - self.error / self.measured)


def heave_spectra(measured: Floats, error_sd_m: float, levels: Floats) -> HeaveSpectra:
    """Return how a measured spectrum of the heave divides into heave and error.

    measured: at FREQUENCY_HZ [m²/Hz]; levels: logarithms of the error's amplitude over its
    specification above each of LEVEL_BORDERS_HZ, (2,). The measured spectrum stands for that of the
    true heave in Wiener's share S_e/(S_m + S_e): where the specification allows more error than
    was measured, some of it may be heave still.
    """
    octave = np.searchsorted(LEVEL_BORDERS_HZ, FREQUENCY_HZ, side="right")
    size = np.concatenate([[0.0], levels])[octave]
    error = np.exp(2.0 * size) * heave_error_spectrum(error_sd_m)
    return HeaveSpectra(measured, measured * error / (measured + error))


class ExpectedHeave:
    """Expected true heave over a stretch of time, given all its measured samples."""

    def __init__(
        self, times_s: Floats, heave_m: Floats, begin_s: float, end_s: float,
        measured_psd: Floats, error_sd_m: float,
    ) -> None:  # fmt: skip
        """Take measured samples, (k,), the stretch [s] and the measured spectrum [m²/Hz].

        Where samples are more than ESTIMATE_S apart the heave between them is predicted from the
        others.
        """
        self._grid = begin_s + ESTIMATE_S * np.arange(np.ceil((end_s - begin_s) / ESTIMATE_S) + 1.0)
        after = np.searchsorted(times_s, self._grid)
        inside = (after > 0) & (after < len(times_s))
        after = np.clip(after, 1, len(times_s) - 1)
        known = inside & (times_s[after] - times_s[after - 1] <= ESTIMATE_S)
        lags = ESTIMATE_S * np.arange(len(self._grid))
        self._waves = np.cos(2.0 * np.pi * np.outer(FREQUENCY_HZ, lags)) * FREQUENCY_STEP_HZ
        at = np.arange(len(self._grid))
        self._apart = np.abs(at[:, None] - at[known])
        whole = (measured_psd @ self._waves)[self._apart[known]]
        whole[np.diag_indices_from(whole)] += ROUNDING_M**2
        samples = np.interp(self._grid[known], times_s, heave_m)
        self._middle = float(samples.mean()) if len(samples) else 0.0
        self._weights = cho_solve(cho_factor(whole, lower=True), samples - self._middle)
        self._psd, self._sd = measured_psd, error_sd_m
        self._found: dict[tuple[float, ...], CubicSpline] = {}

    def at(self, levels: tuple[float, ...]) -> CubicSpline:
        """Return the heave over time [m] for levels of its error; see `heave_spectra`."""
        if levels not in self._found:
            spectra = heave_spectra(self._psd, self._sd, np.array(levels))
            of_heave = (spectra.measured - spectra.error) @ self._waves
            heave = self._middle + of_heave[self._apart] @ self._weights
            self._found[levels] = CubicSpline(self._grid, heave)
        return self._found[levels]


def tension_error_autocovariance(
    bar: Bar,
    heave_psd: Floats,
    error_psd: Floats,
    count: int,
    interval_s: float,
    speeds: Floats = STANDING,
) -> Floats:
    """Return r_j of each octave at the lags k·interval_s, (BANDS, count) [N²].

    Their sum at lag 0 is the variance. heave_psd, error_psd: spectra of the heave and of its error
    at FREQUENCY_HZ [m²/Hz]. speeds: of the line, for which drag is linearised too, (n,) [m/s].
    """
    impedance = top_impedance(bar, FREQUENCY_HZ, heave_psd, speeds)
    spectrum = np.abs(impedance) ** 2 * error_psd
    octave = np.searchsorted(OCTAVES_HZ, FREQUENCY_HZ, side="right")
    parts = np.where(octave == np.arange(BANDS)[:, None], spectrum, 0.0)
    lags = interval_s * np.arange(count)
    waves = np.cos(2.0 * np.pi * np.outer(FREQUENCY_HZ, lags))
    return np.asarray(parts @ waves * FREQUENCY_STEP_HZ)


class ResidualNoise:
    """R of a block, with levels α_j and σ learned from the residuals that blocks left."""

    def __init__(self, white_n: float, bands: int = BANDS) -> None:
        """Begin with the nominal standard deviation of the white noise of a mean [N]."""
        self.nominal_white_n = white_n
        self.white_n = white_n
        self.levels: Floats = np.ones(bands)
        self._left: deque[tuple[Floats, Floats]] = deque(maxlen=KEPT_BLOCKS)

    def coloured(self, autocovariances: Floats) -> Floats:
        """Return the autocovariance of the coloured error, (k,), from the octaves', (bands, k)."""
        return np.asarray(self.levels**2 @ autocovariances)

    def covariance(self, autocovariances: Floats) -> Floats:
        """Return R, (k, k) [N²], from the autocovariances of the octaves, (bands, k)."""
        white = self.white_n**2 * np.eye(autocovariances.shape[1])
        return np.asarray(toeplitz(self.coloured(autocovariances)) + white)

    def learn(self, residual: Floats, used: Floats, autocovariances: Floats) -> None:
        """Add the residual that a block left, (k,), and choose levels and σ by the last blocks.

        used: (k,) bool; the others have no part in the likelihood. One level after the other is
        chosen with the others kept, once a block.
        """
        self._left.append((residual.copy(), used.astype(bool)))
        whole = [one for one in self._left if len(one[0]) == len(residual)]
        if len(whole) < 2:
            return
        alike: dict[bytes, list[Floats]] = {}  # blocks that use the same rows share a factor
        for left, rows in whole:
            alike.setdefault(rows.tobytes(), []).append(left[rows])
        groups = [(np.frombuffer(key, bool), np.array(own).T) for key, own in alike.items()]
        bands = len(self.levels)
        now = np.append(self.levels, self.white_n / self.nominal_white_n)
        best = self._score(now, groups, autocovariances)
        for k in range(bands + 1):
            for value in LEVELS if k < bands else WHITES:
                tried = now.copy()
                tried[k] = value
                if value == now[k]:
                    continue
                if (score := self._score(tried, groups, autocovariances)) > best:
                    best, now = score, tried
        self.levels, self.white_n = now[:-1], float(now[-1]) * self.nominal_white_n

    def _score(
        self, shares: Floats, groups: list[tuple[Floats, Floats]], autocovariances: Floats
    ) -> float:
        """Return the logarithm of the posterior probability of levels and σ, but for a constant."""
        white = shares[-1] * self.nominal_white_n
        coloured = toeplitz(shares[:-1] ** 2 @ autocovariances)
        R = coloured + white**2 * np.eye(autocovariances.shape[1])
        score = -0.5 * float(((np.log(shares[:-1]) / LEVEL_SD) ** 2).sum())
        score -= 0.5 * float(np.log(shares[-1]) / WHITE_SD) ** 2
        for rows, columns in groups:
            factor = cholesky(R[np.ix_(rows, rows)], lower=True)
            squares = solve_triangular(factor, columns, lower=True) ** 2
            score -= 0.5 * np.minimum(squares, MOST_SQUARE).sum()
            score -= columns.shape[1] * np.log(np.diag(factor)).sum()
        return float(score)
