"""Covariance of what is left of the tension: white noise of the load pin, error of the heave.

An error of the measured heave acts on the real rope as a motion that the model does not have. Its
autocovariance as a tension is r(τ) = ∫|Z(f)|²·S_e(f)·cos 2πfτ df with the top impedance Z and the
error's spectrum S_e. A motion sensor's error has a spectrum of its own, and so have other errors of
the model: each octave of S_e has a level, R = σ²·I + Σ α_j²·Toeplitz(r_j). The levels and σ follow
the last blocks by maximum posterior probability.
"""

from __future__ import annotations

from collections import deque

import numpy as np
from scipy.linalg import cholesky, solve_triangular, toeplitz
from scipy.signal import welch

from rope_twin.core.state import Floats
from rope_twin.estimation.impedance import STANDING, Bar, top_impedance

FREQUENCY_STEP_HZ = 0.0025
FREQUENCY_HZ = np.arange(0.005, 1.0, FREQUENCY_STEP_HZ)
ERROR_BAND_HZ = 0.025, 0.20  # in which the spectrum of the heave's error is flat
OCTAVES_HZ = 0.05, 0.10  # borders of the octaves of that band, each with its level
BANDS = len(OCTAVES_HZ) + 1
WELCH_S = 120.0  # segments of the heave's spectrum
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
    """Return the spectrum of the heave's error [m²/Hz] at FREQUENCY_HZ, flat in ERROR_BAND_HZ."""
    low, high = ERROR_BAND_HZ
    shape = 1.0 / (1.0 + (low / FREQUENCY_HZ) ** 8) / (1.0 + (FREQUENCY_HZ / high) ** 8)
    return np.asarray(shape * sd_m**2 / (shape.sum() * FREQUENCY_STEP_HZ))


def tension_error_autocovariance(
    bar: Bar,
    heave_psd: Floats,
    error_sd_m: float,
    count: int,
    interval_s: float,
    speeds: Floats = STANDING,
) -> Floats:
    """Return r_j of each octave at the lags k·interval_s, (BANDS, count) [N²].

    Their sum at lag 0 is the variance. speeds: of the line, for which drag is linearised too, (n,)
    [m/s].
    """
    impedance = top_impedance(bar, FREQUENCY_HZ, heave_psd, speeds)
    spectrum = np.abs(impedance) ** 2 * heave_error_spectrum(error_sd_m)
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
