"""Wave spectra: measured ones from a file, JONSWAP and Pierson-Moskowitz, and their moments."""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rope_twin.errors import InputError, did_you_mean, phrase
from rope_twin.share import share_dir

Vector = NDArray[np.float64]

_FREQUENCY = "frequency_hz"
_PREFIX, _SUFFIX = "S_", "_m2_per_hz"


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
        gamma = _usual_gamma(height_m, peak_period_s)
    _require("gamma", gamma, 1.0, 10.0, "")
    peak_hz = 1.0 / peak_period_s
    ratio = np.linspace(0.4, 5.0, 921)  # f/fp; 14 points across the width σ of the peak
    width = np.where(ratio <= 1.0, 0.07, 0.09)
    moskowitz = (5.0 / 16.0) * height_m**2 / peak_hz * ratio**-5.0 * np.exp(-1.25 * ratio**-4.0)
    peaked = gamma ** np.exp(-0.5 * ((ratio - 1.0) / width) ** 2)
    density = (1.0 - 0.287 * math.log(gamma)) * moskowitz * peaked
    source = f"JONSWAP, Hs {height_m:g} m, Tp {peak_period_s:g} s, gamma {gamma:.3g}"
    return WaveSpectrum(ratio * peak_hz, density, source)


def band_spectrum(values: Vector, rate_hz: float, band_hz: float = 0.01) -> WaveSpectrum:
    """Return the spectrum of a record (n,) sampled at `rate_hz`: its periodogram in band averages.

    Bands are centred at multiples of `band_hz`, as reported by buoys; frequencies below the first
    half band (mean, tide) are excluded.
    """
    count = len(values)
    line_hz = rate_hz / count
    frequency = np.fft.rfftfreq(count, 1.0 / rate_hz)
    lines = 2.0 * np.abs(np.fft.rfft(values)) ** 2 / (count**2 * line_hz)
    band = np.floor(frequency / band_hz + 0.5).astype(np.int64)
    sums = np.bincount(band, weights=lines)
    counts = np.bincount(band)
    held = np.flatnonzero(counts)
    held = held[held > 0]
    return WaveSpectrum(held.astype(np.float64) * band_hz, sums[held] / counts[held], "periodogram")


def _usual_gamma(height_m: float, peak_period_s: float) -> float:
    steepness = peak_period_s / math.sqrt(height_m)
    if steepness <= 3.6:
        return 5.0
    return math.exp(5.75 - 1.15 * steepness) if steepness <= 5.0 else 1.0


def _require(name: str, value: float, low: float, high: float, unit: str) -> None:
    if not (math.isfinite(value) and low <= value <= high):
        right = f"right is {low:g} to {high:g} {unit}".rstrip()
        raise InputError(phrase("spectrum", f"{name} is {value:g} {unit}".rstrip(), right))


def find_spectra(name: str | Path) -> Path:
    """Return the file of a name in config/sea_states/ (without its suffix), or of a path.

    Raises:
        InputError: there is neither.
    """
    folder = share_dir() / "config" / "sea_states"
    known = {path.stem: path for path in folder.glob("*.csv")}
    path = known.get(str(name), Path(name))
    if not path.is_file():
        what = "neither a file nor a name in config/sea_states/"
        raise InputError(phrase(str(name), what, did_you_mean(name, known)))
    return path


def read_spectrum(path: Path, column: str) -> WaveSpectrum:
    """Read one column of a file of measured spectra (format: config/sea_states/README.md).

    `column` is the hour alone or the whole heading.

    Raises:
        InputError: with file, line and rule, if file or column is invalid.
    """
    where = path.name
    rows = _read_rows(path)
    heading = [cell.strip() for cell in rows[0]]
    if heading[0] != _FREQUENCY:
        raise InputError(
            phrase(f"{where}, line 1", f"it begins with '{heading[0]}'", f"right is '{_FREQUENCY}'")
        )
    names = [cell.removeprefix(_PREFIX).removesuffix(_SUFFIX) for cell in heading]
    wanted = column.removeprefix(_PREFIX).removesuffix(_SUFFIX)
    if wanted not in names[1:]:
        hint = did_you_mean(wanted, names[1:])
        raise InputError(phrase(where, f"there is no column '{column}'", hint))
    at = names.index(wanted)
    table = np.array([_numbers(f"{where}, line {n}", row, len(heading)) for n, row in
                      enumerate(rows[1:], start=2)])  # fmt: skip
    frequency, density = table[:, 0], table[:, at]
    _check(where, frequency, density, column)
    return WaveSpectrum(frequency, density, f"{path.stem}, {wanted}")


def _read_rows(path: Path) -> list[list[str]]:
    try:
        with path.open(encoding="utf-8", newline="") as file:
            rows = [row for row in csv.reader(file) if row]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(
            phrase(path.name, f"it cannot be read ({error})", "right is a text file (CSV)")
        ) from error
    if len(rows) < 3:
        what = f"it has {len(rows)} of the 3 lines that it needs at least"
        raise InputError(phrase(path.name, what, "right is a heading and 2 or more frequencies"))
    return rows


def _numbers(where: str, row: list[str], width: int) -> list[float]:
    if len(row) != width:
        raise InputError(
            phrase(
                where, f"it has {len(row)} cells", f"the heading has {width}, so right is {width}"
            )
        )
    values = []
    for cell in row:
        try:
            value = float(cell)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise InputError(phrase(where, f"'{cell}'", "right is a finite number"))
        values.append(value)
    return values


def _check(where: str, frequency: Vector, density: Vector, column: str) -> None:
    if frequency[0] <= 0.0 or np.any(np.diff(frequency) <= 0.0):
        line = 2 if frequency[0] <= 0.0 else int(np.argmax(np.diff(frequency) <= 0.0)) + 3
        what = f"the frequency {frequency[line - 2]:g} Hz is not ascending"
        raise InputError(
            phrase(f"{where}, line {line}", what, "right are positive, ascending frequencies")
        )
    if np.any(density < 0.0):
        line = int(np.argmax(density < 0.0)) + 2
        what = f"the density of '{column}' is {density[line - 2]:g} m²/Hz"
        raise InputError(phrase(f"{where}, line {line}", what, "right is 0 or more"))
    if not np.any(density > 0.0):
        raise InputError(
            phrase(where, f"'{column}' is zero everywhere", "right is a spectrum with energy")
        )


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
    most = BREAKING * _length_m(period, gravity)
    if gravity <= 0.0 or height <= most:
        return None
    what = (
        f"Hs {height:.3g} m at a mean period Tz of {period:.3g} s is a steepness of "
        f"{BREAKING * height / most:.2g}, and waves break at {BREAKING:g}"
    )
    usual = min(most, usual_height_m(spectrum.peak_period_s, gravity))
    return what, f"give at most Hs {usual:.2g} m, or a longer period"


def steepness_warning(where: str, spectrum: WaveSpectrum, gravity: float = STANDARD_GRAVITY) -> str:
    """Return a warning for a sea state that is steeper than usual, or ""."""
    height, period = spectrum.significant_height_m, spectrum.peak_period_s
    most = usual_height_m(period, gravity)
    if gravity <= 0.0 or height <= most * (1.0 + 5e-3):  # tolerance for the truncated spectrum
        return ""
    what = (
        f"Hs {height:.3g} m at Tp {period:.3g} s is steeper than sea states usually are "
        f"(at most {most:.1f} m by DNV-RP-C205)"
    )
    return phrase(where, what, f"give at most {most:.1f} m, or a longer period")


def _length_m(period_s: float, gravity: float) -> float:
    """Return the length of a deep-water wave."""
    return gravity * period_s**2 / (2.0 * math.pi)
