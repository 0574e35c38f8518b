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

The top impedance is the amplitude of the top tension per amplitude of heave. The rope is a chain of
uniform viscoelastic bars with a mass at the lower end. With E* = EA + iωC, μ* = μ - i·d/ω and k =
ω·√(μ*/E*), displacement u and tension T run up a bar of length l as

    u(l) = u(0)·cos kl + T(0)/(E*·k)·sin kl,   T(l) = T(0)·cos kl - E*·k·u(0)·sin kl,

from T(0) = -(ω²M - iωd_0)·u(0) at the mass. Quadratic drag β·|v|·v is linearised for a Gaussian sea
about the speed U of the line: d = 2β·E|v + U| = β·[√(8/π)·σ_v·exp(-U²/2σ_v²) + 2U·erf(U/√2σ_v)],
which for U = 0 is Borgman's √(8/π)·β·σ_v (1969), with σ_v of the response itself, found by
iteration.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.linalg import cho_factor, cho_solve, cholesky, solve_triangular, toeplitz
from scipy.signal import welch
from scipy.special import erf

from rope_twin.core import state as rows
from rope_twin.core.state import Floats
from rope_twin.estimation.hanging import hanging_of
from rope_twin.scene.schema import Scene

Complexes = NDArray[np.complex128]
PIECES = 8  # of the rope, each with its own linearised drag
BORGMAN = np.sqrt(8.0 / np.pi)
MIN_SIGMA = 1e-9  # m/s
STANDING: Floats = np.zeros(1)  # speeds of a line that does not move
TOLERANCE, MAX_ITERATIONS = 1e-4, 40


@dataclass(frozen=True)
class Bar:
    """Bars from the lower end up and the mass below them."""

    length_m: Floats  # (bars,)
    EA_n: Floats
    damping_newton_seconds: Floats  # C of T = EA·strain + C·strain rate
    mass_kg_per_m: Floats  # with added mass along the rope
    drag_kg_per_m2: Floats  # β of the force per metre β·|v|·v along the rope
    end_mass_kg: float  # with added mass
    end_drag_kg_per_m: float  # β of the force on the lower end
    slings_kg: float = 0.0  # at the lower end too, with added mass; no figure scales it

    @property
    def lower_mass_kg(self) -> float:
        """Return the whole mass at the lower end [kg]."""
        return self.end_mass_kg + self.slings_kg

    def with_factors(self, factors: dict[str, float]) -> Bar:
        """Return the bars with the rope's figures multiplied, by the names of ROPE_FIGURES."""
        return replace(
            self,
            EA_n=self.EA_n * factors["axial_stiffness"],
            damping_newton_seconds=self.damping_newton_seconds * factors["axial_damping"],
            drag_kg_per_m2=self.drag_kg_per_m2 * factors["tangential_drag"],
            end_mass_kg=self.end_mass_kg * factors["oscillating_mass"],
            end_drag_kg_per_m=self.end_drag_kg_per_m * factors["payload_drag"],
        )

    def at_length(self, line_out_m: float) -> Bar:
        """Return the bars with the uppermost ones lengthened or shortened to a line out [m]."""
        top = np.concatenate([[0.0], np.cumsum(self.length_m)])
        top[-1] = max(line_out_m, top[-1])
        lengths = np.maximum(np.minimum(top[1:], line_out_m) - top[:-1], 0.0)
        return replace(self, length_m=lengths)


def bar_of(scene: Scene) -> Bar:
    """Return the first of `bars_of`. Raises SceneError: the scene cannot be built."""
    return bars_of(scene)[0]


def bars_of(scene: Scene) -> tuple[Bar, ...]:
    """Return the bars of each rope from the ship, with its share of all that hangs on them.

    Ropes that carry a load together share it by their stiffness EA/L: equal ropes move as one, and
    each has the impedance of a bar with its share of the mass.

    Raises:
        SceneError: the scene cannot be built.
    """
    hanging, ropes = hanging_of(scene), []
    for rope, metre_kg, length_m in hanging.ropes:
        ends = [0.0, *rope.sections[rows.END][:-1], length_m]
        lengths = np.array([high - low for low, high in pairwise(ends)])
        ropes.append((rope, metre_kg, lengths, float((lengths / rope.sections[rows.EA]).sum())))
    stiffness = sum(1.0 / compliance for *_, compliance in ropes)
    bars = []
    for rope, metre_kg, lengths, compliance in ropes:
        share = 1.0 / compliance / stiffness if len(ropes) > 1 else 1.0
        _, _, _, skin, _ = rope.sections[rows.PER_METRE :]
        bars.append(
            Bar(
                lengths,
                rope.sections[rows.EA].copy(),
                rope.sections[rows.C].copy(),
                metre_kg,
                _tangential(rope.effects) * skin,
                share * hanging.mass_kg,
                share * hanging.drag_kg_per_m,
                share * hanging.slings_kg,
            )
        )
    return tuple(bars)


def first_axial_period_s(bars: Sequence[Bar]) -> float:
    """Return the first axial period of ropes that carry a load together, by Rayleigh's quotient.

    It is that of the load and a third of the ropes on their springs, 2π·√((M + m/3)/Σ(EA/L)).
    """
    mass_kg = sum(bar.lower_mass_kg + float(bar.mass_kg_per_m @ bar.length_m) / 3.0 for bar in bars)
    stiffness = sum(1.0 / float((bar.length_m / bar.EA_n).sum()) for bar in bars)
    return 2.0 * np.pi * float(np.sqrt(mass_kg / stiffness))


def _tangential(effects: tuple[Any, ...]) -> float:
    """Return ½·ρ·C_dt [kg/m³] of the drag among a rope's effects; 0: it has none."""
    for effect in effects:
        drag = getattr(effect, "drag", effect)
        if hasattr(drag, "kt"):
            return float(drag.kt)
    return 0.0


def linear_drag(sigma: Floats, speeds: Floats) -> Floats:
    """Return d/β = 2·E|v + U| [m/s], (k,), as the mean over the line's speeds U, (n,) [m/s].

    sigma: standard deviation of v, (k,) [m/s].
    """
    sigma = np.maximum(sigma, MIN_SIGMA)[:, None]
    ratio = np.abs(speeds) / (np.sqrt(2.0) * sigma)
    mean = BORGMAN * sigma * np.exp(-(ratio**2)) + 2.0 * np.abs(speeds) * erf(ratio)
    return np.asarray(mean.mean(axis=1))


def top_impedance(
    bar: Bar, frequency_hz: Floats, heave_psd: Floats | None = None, speeds: Floats = STANDING
) -> Complexes:
    """Return top tension per heave [N/m], (frequencies,) complex, for exp(+iωt).

    frequency_hz: positive and evenly spaced. heave_psd: one-sided spectrum of the heave [m²/Hz] at
    these frequencies, for which drag is linearised; None: without drag. speeds: of the line, evenly
    in time, (n,) [m/s].
    """
    w = 2.0 * np.pi * frequency_hz
    cut = np.repeat(bar.length_m / PIECES, PIECES)
    EA, C, mu, beta = (
        np.repeat(values, PIECES)
        for values in (bar.EA_n, bar.damping_newton_seconds, bar.mass_kg_per_m, bar.drag_kg_per_m2)
    )
    d_end, d = 0.0, np.zeros(len(cut))
    if heave_psd is None:
        return _response(bar.lower_mass_kg, w, cut, EA, C, mu, d_end, d)[0]
    df = float(frequency_hz[1] - frequency_hz[0])
    for _ in range(MAX_ITERATIONS):
        impedance, motion = _response(bar.lower_mass_kg, w, cut, EA, C, mu, d_end, d)
        sigma = np.sqrt((np.abs(motion) ** 2 * w**2 * heave_psd).sum(axis=1) * df)
        per_beta = linear_drag(np.append(0.5 * (sigma[1:] + sigma[:-1]), sigma[0]), speeds)
        new_end, new = bar.end_drag_kg_per_m * per_beta[-1], beta * per_beta[:-1]
        done = abs(new_end - d_end) <= TOLERANCE * new_end and np.all(
            np.abs(new - d) <= TOLERANCE * new
        )
        d_end, d = new_end, new
        if done:
            break
    return impedance


def _response(
    end_mass: float, w: Floats, length: Floats, EA: Floats, C: Floats, mu: Floats, d_end: float,
    d: Floats,
) -> tuple[Complexes, Complexes]:  # fmt: skip
    """Return impedance (frequencies,), and motion of each border per heave (pieces + 1, ...)."""
    u: Complexes = np.ones(len(w), complex)
    T: Complexes = -(w**2 * end_mass - 1j * w * d_end) * u
    motion = [u]
    for k in range(len(length)):
        stiff = EA[k] + 1j * w * C[k]
        wave = w * np.sqrt((mu[k] - 1j * d[k] / w) / stiff)
        c, s = np.cos(wave * length[k]), np.sin(wave * length[k])
        u, T = u * c + T * s / (stiff * wave), T * c - stiff * wave * u * s
        motion.append(u)
    return np.asarray(T / u, complex), np.asarray(motion, complex) / u


FREQUENCY_STEP_HZ = 0.0025
FREQUENCY_HZ = np.arange(0.005, 1.0, FREQUENCY_STEP_HZ)
ERROR_BAND_HZ = 0.025, 0.20  # in which the spectrum of the heave's error is flat
LEVEL_BORDERS_HZ = 0.10, 0.20  # above which the error has a level of its own, learned
ESTIMATE_S = 0.5  # between the samples that the true heave is estimated from
ROUNDING_M = 5e-4  # white part of the heave there
OCTAVES_HZ = 0.05, 0.10  # borders of the octaves of that band, each with its level
BANDS = len(OCTAVES_HZ) + 1
SHARE_ERROR_M, SHARE_ERROR_S, SHARE_OF_HEAVE, SHARE_BANDS = 0.01, 60.0, 0.05, 2
WELCH_S = 60.0  # segments of the heave's spectrum: three in the first two minutes
KEPT_BLOCKS = 5  # whose residuals decide on α and σ
LEVELS = 0.3, 0.5, 0.75, 1.0, 1.4, 2.0, 3.0  # α_j that are tried
WHITES = 0.9, 1.0, 1.2, 1.6, 2.5  # σ that are tried, over the nominal one
LEVEL_SD, WHITE_SD = 0.5, 0.2  # of the log-normal priors
MAX_SQUARE = 16.0  # of a whitened residual in the likelihood: outliers do not decide


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
        index = np.arange(len(self._grid))
        self._apart = np.abs(index[:, None] - index[known])
        covariance = (measured_psd @ self._waves)[self._apart[known]]
        covariance[np.diag_indices_from(covariance)] += ROUNDING_M**2
        samples = np.interp(self._grid[known], times_s, heave_m)
        self._middle = float(samples.mean()) if len(samples) else 0.0
        self._weights = cho_solve(cho_factor(covariance, lower=True), samples - self._middle)
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
    impedance: Complexes, error_psd: Floats, count: int, interval_s: float
) -> Floats:
    """Return r_j of each octave at the lags k·interval_s, (BANDS, count) [N²].

    Their sum at lag 0 is the variance. impedance, error_psd: top impedance [N/m] and spectrum of
    the heave's error [m²/Hz] at FREQUENCY_HZ.
    """
    spectrum = np.abs(impedance) ** 2 * error_psd
    octave = np.searchsorted(OCTAVES_HZ, FREQUENCY_HZ, side="right")
    parts = np.where(octave == np.arange(BANDS)[:, None], spectrum, 0.0)
    lags = interval_s * np.arange(count)
    waves = np.cos(2.0 * np.pi * np.outer(FREQUENCY_HZ, lags))
    return np.asarray(parts @ waves * FREQUENCY_STEP_HZ)


def pin_autocovariances(
    impedances: Complexes, error_psd: Floats, count: int, interval_s: float
) -> Floats:
    """Return `tension_error_autocovariance` of each pair of load pins, (BANDS, pins, pins, count).

    All ropes are moved by one error of the heave, so that their tensions err together: the density
    of a pair is |Z_p|·|Z_q|, which neglects what they differ in phase. impedances: (pins, f).
    """
    size = np.sqrt(np.abs(impedances))
    pairs = [
        [
            tension_error_autocovariance(row * column, error_psd, count, interval_s)
            for column in size
        ]
        for row in size
    ]
    return np.moveaxis(np.array(pairs), 2, 0)


def share_autocovariances(
    stiffness_n_per_m: Floats, heave_psd: Floats, count: int, interval_s: float
) -> Floats:
    """Return those of what moves a load between its ropes, (SHARE_BANDS, pins, pins, count) [N²].

    An error e of the ropes' lengths changes their tensions by (diag(K) - K·Kᵀ/ΣK)·e with the
    stiffness K of each; their sum stays. There are two: a slow one of SHARE_ERROR_M (the load comes
    to rest in another current, swings, counters slip), and SHARE_OF_HEAVE of the heave, as roll
    lets hang-offs heave unlike. How large they are is learned, as that of each octave.

    stiffness_n_per_m: (pins,); heave_psd: at FREQUENCY_HZ [m²/Hz].
    """
    K = stiffness_n_per_m
    if len(K) == 1:
        return np.empty((0, 1, 1, count))
    M = np.diag(K) - np.outer(K, K) / K.sum()
    lags = interval_s * np.arange(count)
    slow = SHARE_ERROR_M**2 * np.exp(-lags / SHARE_ERROR_S)
    waves = heave_psd @ np.cos(2.0 * np.pi * np.outer(FREQUENCY_HZ, lags)) * FREQUENCY_STEP_HZ
    return np.array([np.multiply.outer(M @ M.T, r) for r in (slow, SHARE_OF_HEAVE**2 * waves)])


def by_pins(colour: Floats) -> Floats:
    """Return the covariance of all pins' samples, one pin after the other, (pins·k, pins·k).

    colour: autocovariance of each pair of pins, (pins, pins, k), or of a single pin, (k,).
    """
    pairs = colour if colour.ndim == 3 else colour[None, None]
    return np.block([[toeplitz(autocovariance) for autocovariance in row] for row in pairs])


class ResidualNoise:
    """R of a block, with levels α_j and σ learned from the residuals that blocks left."""

    def __init__(self, white_n: float | Floats, bands: int = BANDS) -> None:
        """Begin with the nominal standard deviation of the white noise of a mean [N].

        white_n: one, or (pins,).
        """
        self.nominal_white_n: Floats = np.atleast_1d(np.asarray(white_n, float))
        self.white_n = self.nominal_white_n
        self.levels: Floats = np.ones(bands)
        self._left: deque[tuple[Floats, Floats]] = deque(maxlen=KEPT_BLOCKS)

    def coloured(self, autocovariances: Floats) -> Floats:
        """Return the autocovariance of the coloured error, (..., k), from the octaves' ones.

        autocovariances: (bands, k), or (bands, pins, pins, k).
        """
        return np.tensordot(self.levels**2, autocovariances, 1)

    def covariance(self, autocovariances: Floats) -> Floats:
        """Return R, (pins·k, pins·k) [N²], from the autocovariances of `coloured`."""
        white = np.repeat(self.white_n**2, autocovariances.shape[-1])
        return np.asarray(by_pins(self.coloured(autocovariances)) + np.diag(white))

    def learn(self, residual: Floats, used: Floats, autocovariances: Floats) -> None:
        """Add the residual that a block left, (k,), and choose levels and σ by the last blocks.

        used: (k,) bool; the others have no part in the likelihood. One level after the other is
        chosen with the others kept, once a block.
        """
        self._left.append((residual.copy(), used.astype(bool)))
        residuals = [entry for entry in self._left if len(entry[0]) == len(residual)]
        if len(residuals) < 2:
            return
        by_places: dict[bytes, list[Floats]] = {}  # blocks that use the same places share a factor
        for remaining, places in residuals:
            by_places.setdefault(places.tobytes(), []).append(remaining[places])
        groups = [
            (np.frombuffer(key, bool), np.array(columns).T) for key, columns in by_places.items()
        ]
        bands = len(self.levels)
        now = np.append(self.levels, self.white_n / self.nominal_white_n)
        pins = len(self.white_n)
        best_score = self._score(now, groups, autocovariances)
        for k in range(bands + pins):
            for value in LEVELS if k < bands else WHITES:
                tried = now.copy()
                tried[k] = value
                if value == now[k]:
                    continue
                if (score := self._score(tried, groups, autocovariances)) > best_score:
                    best_score, now = score, tried
        self.levels, self.white_n = now[:bands], now[bands:] * self.nominal_white_n

    def _score(
        self, shares: Floats, groups: list[tuple[Floats, Floats]], autocovariances: Floats
    ) -> float:
        """Return the logarithm of the posterior probability of levels and σ, but for a constant."""
        bands = len(self.levels)
        levels, whites = shares[:bands], shares[bands:]
        white = np.repeat((whites * self.nominal_white_n) ** 2, autocovariances.shape[-1])
        R = by_pins(np.tensordot(levels**2, autocovariances, 1)) + np.diag(white)
        score = -0.5 * float(((np.log(levels) / LEVEL_SD) ** 2).sum())
        score -= 0.5 * float(((np.log(whites) / WHITE_SD) ** 2).sum())
        for places, columns in groups:
            factor = cholesky(R[np.ix_(places, places)], lower=True)
            squares = solve_triangular(factor, columns, lower=True) ** 2
            score -= 0.5 * np.minimum(squares, MAX_SQUARE).sum()
            score -= columns.shape[1] * np.log(np.diag(factor)).sum()
        return float(score)
