"""Covariance of what is left of the tension: white noise of the load pin, error of the heave.

An error of the measured heave acts on the real rope as a motion that the model does not have. Its
autocovariance as a tension is r(τ) = ∫|Z(f)|²·S_e(f)·cos 2πfτ df with the top impedance Z and the
error's spectrum S_e; together R = σ²·I + α²·Toeplitz(r). α and σ follow the last blocks by maximum
posterior probability.
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
WELCH_S = 120.0  # segments of the heave's spectrum
KEPT_BLOCKS = 5  # whose residuals decide on α and σ
LEVELS = 0.3, 0.5, 0.75, 1.0, 1.4, 2.0, 3.0  # α that are tried
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
    """Return r at the lags k·interval_s, (count,) [N²]; r[0] is the variance.

    speeds: of the line, for which drag is linearised too, (n,) [m/s].
    """
    impedance = top_impedance(bar, FREQUENCY_HZ, heave_psd, speeds)
    spectrum = np.abs(impedance) ** 2 * heave_error_spectrum(error_sd_m)
    lags = interval_s * np.arange(count)
    waves = np.cos(2.0 * np.pi * np.outer(FREQUENCY_HZ, lags))
    return np.asarray(spectrum @ waves * FREQUENCY_STEP_HZ)


class ResidualNoise:
    """R of a block, with levels α and σ learned from the residuals that blocks left."""

    def __init__(self, white_n: float) -> None:
        """Begin with the nominal standard deviation of the white noise of a mean [N]."""
        self.nominal_white_n = white_n
        self.white_n, self.level = white_n, 1.0
        self._left: deque[tuple[Floats, Floats]] = deque(maxlen=KEPT_BLOCKS)

    def covariance(self, autocovariance: Floats) -> Floats:
        """Return R, (k, k) [N²], from the autocovariance of the heave's error, (k,)."""
        coloured = self.level**2 * toeplitz(autocovariance)
        return np.asarray(coloured + self.white_n**2 * np.eye(len(autocovariance)))

    def learn(self, residual: Floats, used: Floats, autocovariance: Floats) -> None:
        """Add the residual that a block left, (k,), and choose α and σ by the last blocks.

        used: (k,) bool; the others have no part in the likelihood.
        """
        self._left.append((residual.copy(), used.astype(bool)))
        whole = [one for one in self._left if len(one[0]) == len(residual)]
        if len(whole) < 2:
            return
        alike: dict[bytes, list[Floats]] = {}  # blocks that use the same rows share a factor
        for left, rows in whole:
            alike.setdefault(rows.tobytes(), []).append(left[rows])
        groups = [(np.frombuffer(key, bool), np.array(own).T) for key, own in alike.items()]
        coloured = toeplitz(autocovariance)
        best = -np.inf
        for level in LEVELS:
            for share in WHITES:
                white = share * self.nominal_white_n
                R = level**2 * coloured + white**2 * np.eye(len(residual))
                score = -0.5 * (np.log(level) / LEVEL_SD) ** 2
                score -= 0.5 * (np.log(share) / WHITE_SD) ** 2
                for rows, columns in groups:
                    factor = cholesky(R[np.ix_(rows, rows)], lower=True)
                    squares = solve_triangular(factor, columns, lower=True) ** 2
                    score -= 0.5 * np.minimum(squares, MOST_SQUARE).sum()
                    score -= columns.shape[1] * np.log(np.diag(factor)).sum()
                if score > best:
                    best, self.level, self.white_n = score, level, white
