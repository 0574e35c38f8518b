"""Sea states: wave spectra, and their discretisation as a sum of Airy waves.

Spectra are measured ones from a file, JONSWAP and Pierson-Moskowitz. Each component of a sum (Airy
1845) has the surface a·cos θ with θ = k·(x·cos β + y·sin β) - ω·t + φ, where ω² = g·k·tanh(k·h)
(DNV-RP-C205, 3.2.2). β is the direction of propagation, from east to north.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rope_twin.errors import InputError, did_you_mean, phrase
from rope_twin.sea.tables import Table, Vector, find_table, read_table

SPECTRA_FOLDER = "sea_states"
_FREQUENCY = "frequency_hz"
_PREFIX, _SUFFIX = "S_", "_m2_per_hz"
DEEP = math.inf  # m
TAIL = 1e-3  # of the variance: tail at each end of a spectrum, added to the outermost components
BAND_HZ = 0.01  # of a band of a measured spectrum
NEWTON = 30
MIN_TURN = 1e-12


@dataclass(frozen=True)
class WaveSpectrum:
    """One-sided variance density of the surface: linear between its frequencies, zero outside."""

    frequency_hz: Vector  # (n,) ascending
    density_m2_per_hz: Vector  # (n,)
    source: str  # description of its origin

    def density_at(self, frequency_hz: Vector) -> Vector:
        """Return the density [m²/Hz] at any frequencies [Hz], same shape."""
        return np.interp(
            frequency_hz, self.frequency_hz, self.density_m2_per_hz, left=0.0, right=0.0
        )

    def moment(self, order: int) -> float:
        """Return m_n = ∫ fⁿ·S(f) df [m²·Hzⁿ], by the trapezoidal rule on its own frequencies."""
        return float(
            np.trapezoid(self.frequency_hz**order * self.density_m2_per_hz, self.frequency_hz)
        )

    @property
    def significant_height_m(self) -> float:
        """Return Hs = 4·√m0."""
        return 4.0 * math.sqrt(self.moment(0))

    @property
    def peak_period_s(self) -> float:
        """Return the period of the frequency with the largest density."""
        return float(1.0 / self.frequency_hz[np.argmax(self.density_m2_per_hz)])


def jonswap(height_m: float, peak_period_s: float, gamma: float | None = None) -> WaveSpectrum:
    """Return the JONSWAP spectrum for significant wave height and peak period (DNV-RP-C205, 3.5.5).

    S(f) = A_γ·(5/16)·Hs²·fp⁴·f⁻⁵·exp(−1.25·(fp/f)⁴)·γ^exp(−((f − fp)/(σ·fp))²/2), σ 0.07 below and
    0.09 above the peak, A_γ = 1 − 0.287·ln γ. γ = 1 is Pierson-Moskowitz. Without `gamma` it
    follows from Tp/√Hs: 5 up to 3.6, exp(5.75 − 1.15·Tp/√Hs) up to 5, 1 beyond. The spectrum
    extends from 0.4 to 5 times the peak frequency, beyond which lie 0.2 % of the variance.

    Raises:
        InputError: height, period or γ out of range.
    """
    _require("height", height_m, 0.01, 30.0, "m")
    _require("peak period", peak_period_s, 1.0, 40.0, "s")
    if gamma is None:
        steepness = peak_period_s / math.sqrt(height_m)
        later = math.exp(5.75 - 1.15 * steepness) if steepness <= 5.0 else 1.0
        gamma = 5.0 if steepness <= 3.6 else later
    _require("gamma", gamma, 1.0, 10.0, "")
    peak_hz = 1.0 / peak_period_s
    ratio = np.linspace(0.4, 5.0, 921)  # f/fp; 14 points across the width σ of the peak
    width = np.where(ratio <= 1.0, 0.07, 0.09)
    moskowitz = (5.0 / 16.0) * height_m**2 / peak_hz * ratio**-5.0 * np.exp(-1.25 * ratio**-4.0)
    peaked = gamma ** np.exp(-0.5 * ((ratio - 1.0) / width) ** 2)
    density = (1.0 - 0.287 * math.log(gamma)) * moskowitz * peaked
    source = f"JONSWAP, Hs {height_m:g} m, Tp {peak_period_s:g} s, gamma {gamma:.3g}"
    return WaveSpectrum(ratio * peak_hz, density, source)


def band_spectrum(values: Vector, rate_hz: float) -> WaveSpectrum:
    """Return the spectrum of a record (n,) sampled at `rate_hz`: its periodogram in band averages.

    Bands are centred at multiples of BAND_HZ, as reported by buoys; frequencies below the first
    half band (mean, tide) are excluded.
    """
    count = len(values)
    line_hz = rate_hz / count
    frequency = np.fft.rfftfreq(count, 1.0 / rate_hz)
    lines = 2.0 * np.abs(np.fft.rfft(values)) ** 2 / (count**2 * line_hz)
    band = np.floor(frequency / BAND_HZ + 0.5).astype(np.int64)
    sums = np.bincount(band, weights=lines)
    counts = np.bincount(band)
    bands = np.flatnonzero(counts)
    bands = bands[bands > 0]
    return WaveSpectrum(
        bands.astype(np.float64) * BAND_HZ, sums[bands] / counts[bands], "periodogram"
    )


def _require(name: str, value: float, low: float, high: float, unit: str) -> None:
    if not (math.isfinite(value) and low <= value <= high):
        remedy = f"right is {low:g} to {high:g} {unit}".rstrip()
        raise InputError("spectrum", f"{name} is {value:g} {unit}".rstrip(), remedy)


def read_spectrum(name_or_path: str | Path, column: str) -> WaveSpectrum:
    """Read one column of a table in config/sea_states/ (format: its README.md) or at a path.

    `column` is the hour alone or the whole heading.

    Raises:
        InputError: with file, line and rule, if file or column is invalid.
    """
    path = find_table(str(name_or_path), SPECTRA_FOLDER)
    table = read_table(path)
    if _FREQUENCY not in table.columns:
        remedy = f"the header must begin with {_FREQUENCY}"
        raise InputError(str(path), f"there is no column {_FREQUENCY}", remedy)
    known = {
        name.removeprefix(_PREFIX).removesuffix(_SUFFIX): values
        for name, values in table.columns.items()
        if name != _FREQUENCY
    }
    column_name = column.removeprefix(_PREFIX).removesuffix(_SUFFIX)
    if column_name not in known:
        raise InputError(
            str(path), f"there is no column '{column}'", did_you_mean(column_name, known)
        )
    frequency, density = table.columns[_FREQUENCY], known[column_name]
    _check(path, table, density, column)
    return WaveSpectrum(frequency, density, f"{path.stem}, {column_name}")


def _check(path: Path, table: Table, density: Vector, column: str) -> None:
    """Check that a spectrum has energy, at frequencies that ascend from above 0."""
    frequency = table.columns[_FREQUENCY]
    for line, step, hz, value in zip(
        table.lines, np.diff(frequency, prepend=0.0), frequency, density, strict=True
    ):
        where = f"{path}, line {line}"
        if step <= 0.0:
            problem = f"the frequency {hz:g} Hz is not ascending"
            raise InputError(where, problem, "give positive, ascending frequencies")
        if value < 0.0:
            problem = f"the density of '{column}' is {value:g} m²/Hz"
            raise InputError(where, problem, "give 0 or more")
    if len(frequency) < 2:
        raise InputError(str(path), "it has one frequency", "give two or more")
    if not np.any(density > 0.0):
        raise InputError(str(path), f"'{column}' is zero everywhere", "give a spectrum with energy")


BREAKING = 0.142  # height over length of a breaking wave in deep water
STANDARD_GRAVITY = 9.80665
_PEAK_PERIODS_S, _STEEPEST = (8.0, 15.0), (1.0 / 15.0, 1.0 / 25.0)


def zero_crossing_period_s(spectrum: WaveSpectrum) -> float:
    """Return the mean zero-crossing period, Tz = √(m0/m2)."""
    return math.sqrt(spectrum.moment(0) / spectrum.moment(2))


def usual_height_m(peak_period_s: float, gravity: float = STANDARD_GRAVITY) -> float:
    """Return the largest Hs of a sea state with this peak period by DNV-RP-C205."""
    (first, last), (steep, gentle) = _PEAK_PERIODS_S, _STEEPEST
    part = min(max((peak_period_s - first) / (last - first), 0.0), 1.0)
    return _length_m(peak_period_s, gravity) * (steep + part * (gentle - steep))


def breaking_fault(
    spectrum: WaveSpectrum, gravity: float = STANDARD_GRAVITY
) -> tuple[str, str] | None:
    """Return why the sea state is impossible, and the remedy; None if it is possible."""
    period, height = zero_crossing_period_s(spectrum), spectrum.significant_height_m
    limit_m = BREAKING * _length_m(period, gravity)
    if gravity <= 0.0 or height <= limit_m:
        return None
    problem = (
        f"Hs {height:.3g} m at a mean period Tz of {period:.3g} s is a steepness of "
        f"{BREAKING * height / limit_m:.2g}, and waves break at {BREAKING:g}"
    )
    usual = min(limit_m, usual_height_m(spectrum.peak_period_s, gravity))
    return problem, f"give at most Hs {usual:.2g} m, or a longer period"


def steepness_warning(where: str, spectrum: WaveSpectrum, gravity: float = STANDARD_GRAVITY) -> str:
    """Return a warning for a sea state that is steeper than usual, or ""."""
    height, period = spectrum.significant_height_m, spectrum.peak_period_s
    usual_m = usual_height_m(period, gravity)
    if gravity <= 0.0 or height <= usual_m * (1.0 + 5e-3):  # tolerance for the truncated spectrum
        return ""
    problem = (
        f"Hs {height:.3g} m at Tp {period:.3g} s is steeper than sea states usually are "
        f"(at most {usual_m:.1f} m by DNV-RP-C205)"
    )
    return phrase(where, problem, f"give at most {usual_m:.1f} m, or a longer period")


def _length_m(period_s: float, gravity: float) -> float:
    """Return the length of a deep-water wave."""
    return gravity * period_s**2 / (2.0 * math.pi)


def random_shares(seed: int, count: int, skipped: int = 0) -> Vector:
    """Return uniform random numbers in [0, 1), (count,), beyond the first `skipped` of the seed.

    Made from the raw words of PCG64, whose stream numpy guarantees, so that a seed gives the same
    sea with every version of numpy.

    Raises:
        InputError: a negative seed.
    """
    if seed < 0:
        raise InputError("seed", f"it is {seed}", "right is a whole number from 0")
    raw = np.random.PCG64(seed).random_raw(skipped + count)[skipped:]
    return (raw >> np.uint64(11)).astype(np.float64) * 2.0**-53


def random_phases(seed: int, count: int) -> Vector:
    """Return uniform random phases [rad], (count,). Raises InputError: a negative seed."""
    return 2.0 * np.pi * random_shares(seed, count)


@dataclass(frozen=True)
class Waves:
    """Wave components from the longest to the shortest, (n,) each."""

    amplitude_m: Vector
    omega: Vector  # ω [rad/s]
    wave_number: Vector  # k [1/m]
    heading: Vector  # β [rad], direction of propagation
    phase: Vector  # φ [rad]
    depth_m: float  # DEEP in deep water

    @property
    def significant_height_m(self) -> float:
        """Return Hs = 4·√(Σ a²/2)."""
        return 4.0 * math.sqrt(0.5 * float(self.amplitude_m @ self.amplitude_m))

    def elevation_m(self, x: float, y: float, time: Vector) -> Vector:
        """Return the surface elevation above the mean water level at times [s], (any,)."""
        travel_phase = self.wave_number * (x * np.cos(self.heading) + y * np.sin(self.heading))
        angle = (travel_phase + self.phase)[:, None] - self.omega[:, None] * time
        return np.asarray((self.amplitude_m[:, None] * np.cos(angle)).sum(axis=0))


def wave_at(waves: Waves, x: float, y: float) -> NDArray[np.complex128]:
    """Return a·exp(-i(k·x + φ)) of each component at a position [m], (components,)."""
    travel_phase = waves.wave_number * (x * np.cos(waves.heading) + y * np.sin(waves.heading))
    return np.asarray(waves.amplitude_m * np.exp(-1j * (travel_phase + waves.phase)))


def wave_numbers(omega: Vector, depth_m: float, gravity: float) -> Vector:
    """Solve ω² = g·k·tanh(k·h) for k [1/m], (n,), by Newton's method from Guo's (2002) guess."""
    if math.isinf(depth_m):
        return omega**2 / gravity
    x = omega * math.sqrt(depth_m / gravity)
    kh = x * x * (1.0 - np.exp(-(x**2.4908))) ** (-1.0 / 2.4908)
    for _ in range(NEWTON):
        tanh = np.tanh(kh)
        change = (kh * tanh - x * x) / (tanh + kh * (1.0 - tanh * tanh))
        kh = kh - change
        if np.all(np.abs(change) <= MIN_TURN * kh):
            break
    return np.asarray(kh / depth_m)


def regular_wave(
    height_m: float,
    period_s: float,
    heading: float,
    depth_m: float,
    gravity: float,
    phase: float = 0.0,
) -> Waves:
    """Return one wave; with phase 0 [rad] its crest is at the origin at t = 0."""
    omega = np.array([2.0 * math.pi / period_s])
    k = wave_numbers(omega, depth_m, gravity)
    return Waves(
        np.array([0.5 * height_m]), omega, k, np.array([heading]), np.full(1, phase), depth_m
    )


SHARES = 3  # random numbers of a component: phase, frequency in its band, direction


def irregular_waves(
    spectrum: WaveSpectrum, count: int, seed: int, depth_m: float, gravity: float, skipped: int = 0
) -> Waves:
    """Return a spectrum as `count` components that all travel east; `spread` turns them.

    skipped: random numbers of the seed that other systems of the same sea have used.

    Bands of equal width, with a random frequency in each, so that the sea does not repeat; the
    amplitude is that of the band's variance, so Hs is the spectrum's own.
    """
    f, S = spectrum.frequency_hz, spectrum.density_m2_per_hz
    variance = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(f) * (S[1:] + S[:-1]))])
    total = float(variance[-1])
    low = f[max(int(np.searchsorted(variance, TAIL * total)) - 1, 0)]
    high = f[min(int(np.searchsorted(variance, (1.0 - TAIL) * total)), len(f) - 1)]
    edges = np.linspace(low, high, count + 1)
    below = np.interp(edges, f, variance)
    below[0], below[-1] = 0.0, total
    amplitude = np.sqrt(2.0 * np.diff(below))
    frequency = edges[:-1] + random_shares(seed, count, skipped + count) * np.diff(edges)
    omega = 2.0 * np.pi * frequency
    phase = 2.0 * np.pi * random_shares(seed, count, skipped)
    k = wave_numbers(omega, depth_m, gravity)
    return Waves(amplitude, omega, k, np.zeros(count), phase, depth_m)


def directions(exponent: float | None, shares: Vector) -> Vector:
    """Return a direction about the mean [rad] for each share in [0, 1) of `spread`'s distribution.

    All are 0 without an exponent.
    """
    if exponent is None:
        return np.zeros_like(shares)
    angle = np.linspace(-math.pi, math.pi, 2001)
    density = np.cos(0.5 * angle) ** (2.0 * exponent)
    below = np.concatenate([[0.0], np.cumsum(density[1:] + density[:-1])])
    return np.interp(shares, below / below[-1], angle)


def spread(
    waves: Waves, heading: float, exponent: float | None, seed: int, skipped: int = 0
) -> Waves:
    """Return the waves with directions spread about a mean heading [rad].

    exponent: s of the directional distribution cos^2s((β - β0)/2) (Longuet-Higgins, Cartwright and
    Smith 1963); None: long-crested. Each component has one direction, drawn from the distribution.
    skipped: as of `irregular_waves`.
    """
    count = len(waves.omega)
    turn = directions(exponent, random_shares(seed, count, skipped + 2 * count))
    return replace(waves, heading=heading + turn)


def together(systems: Sequence[Waves]) -> Waves:
    """Return the components of several systems in the same water, from the longest on."""
    names = ("amplitude_m", "omega", "wave_number", "heading", "phase")
    joined = {name: np.concatenate([getattr(system, name) for system in systems]) for name in names}
    order = np.argsort(joined["wave_number"], kind="stable")
    columns = {name: values[order] for name, values in joined.items()}
    return Waves(**columns, depth_m=systems[0].depth_m)
