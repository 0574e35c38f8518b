"""Seas drawn by seed from a recorded spectrum, and the errors of the sensors that look at them.

A drawn sea has normal amplitudes and random phases at 4,800 frequencies a hertz (a sample of the
Gaussian process itself, not a sum of fixed amplitudes), so that it repeats after 80 minutes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rope_twin.sea.ship_motion import BoxHull, heave_response
from rope_twin.sea.spectrum import WaveSpectrum, read_spectrum

Floats = NDArray[np.float64]

PERIOD_S = 4800.0
GRAVITY = 9.80665
TABLE = "ndbc_46042_1996"
HOURS = {"sea_1p2m": "1996-07-30T13Z", "sea_2p5m": "1996-10-16T00Z", "sea_6p5m": "1996-03-13T10Z"}
ERROR_BAND_HZ = 1.0 / 30.0, 1.0 / 8.0  # of a heave filter's error


def recorded_spectrum(sea: str) -> WaveSpectrum:
    """Return the wave spectrum behind one of the recorded seas of the repository."""
    return read_spectrum(TABLE, HOURS[sea])


@dataclass(frozen=True)
class DrawnSea:
    """One realisation: complex amplitudes of the elevation at the hang-off, and the response."""

    frequency_hz: Floats  # (n,) multiples of 1/PERIOD_S
    wave: NDArray[np.complex128]  # (n,) amplitude [m] for exp(+iωt)
    response: NDArray[np.complex128]  # (n,) heave per elevation

    @classmethod
    def draw(cls, spectrum: WaveSpectrum, random: np.random.Generator) -> DrawnSea:
        """Return a sea of this spectrum that moves the default box hull."""
        order = np.arange(1, round(spectrum.frequency_hz[-1] * PERIOD_S) + 1)
        frequency = order / PERIOD_S
        size = np.sqrt(spectrum.density_at(frequency) / PERIOD_S)
        normal = random.standard_normal((2, len(order)))
        wave = size * (normal[0] + 1j * normal[1])
        return cls(frequency, wave, heave_response(BoxHull(), frequency))

    @property
    def heave_deviation_m(self) -> float:
        """Standard deviation of this realisation's heave over its period."""
        return float(np.sqrt(0.5 * np.sum(np.abs(self.wave * self.response) ** 2)))

    def heave_m(self, samples: int, sample_s: float) -> Floats:
        """Return heave at k·sample_s, (samples,)."""
        return self._series(self.wave * self.response, samples, sample_s)

    def elevation_m(self, samples: int, sample_s: float, distance_m: float = 0.0) -> Floats:
        """Return the surface at k·sample_s, (samples,), `distance_m` up-sea of the hang-off."""
        wave_number = (2.0 * np.pi * self.frequency_hz) ** 2 / GRAVITY
        return self._series(self.wave * np.exp(1j * wave_number * distance_m), samples, sample_s)

    def _series(self, amplitude: NDArray[np.complex128], samples: int, sample_s: float) -> Floats:
        whole = round(PERIOD_S / sample_s)
        lines = np.zeros(whole // 2 + 1, np.complex128)
        lines[1 : len(amplitude) + 1] = 0.5 * whole * amplitude
        return np.asarray(np.fft.irfft(lines, whole)[:samples])


def motion_error(
    samples: int, sample_s: float, deviation_m: float, random: np.random.Generator
) -> Floats:
    """Return the coloured error of a motion sensor, (samples,): noise from 8 to 30 s."""
    from scipy.signal import butter, sosfilt

    sections = butter(2, ERROR_BAND_HZ, "bandpass", fs=1.0 / sample_s, output="sos")
    lead = round(600.0 / sample_s)
    long = sosfilt(sections, random.standard_normal(samples + lead))[lead:]
    return np.asarray(deviation_m * long / np.std(long))
