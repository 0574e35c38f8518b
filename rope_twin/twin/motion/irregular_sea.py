"""Periodic irregular sea: elevation and heave in time from a spectrum, a hull and a seed.

The sum has one component at each multiple of 1/duration inside the spectrum, so the record is
periodic and can be looped without a discontinuity. Amplitudes are √(2·S·Δf), phases are random (the
deterministic-amplitude form: Hs of every record is that of its spectrum).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rope_twin.errors import InputError, phrase
from rope_twin.sea.components import random_phases
from rope_twin.sea.ship_motion import BoxHull, heave_response
from rope_twin.sea.spectrum import WaveSpectrum
from rope_twin.sea.tables import Vector


@dataclass(frozen=True)
class SeaRecord:
    """One period of the sea and of the ship's heave in it; sample k is at k/rate_hz."""

    rate_hz: float
    elevation_m: Vector  # (n,) water surface at the ship
    heave_m: Vector  # (n,) hang-off above its mean position
    heave_velocity_m_per_s: Vector  # (n,)
    source: str  # description of spectrum, hull and seed

    @property
    def duration_s(self) -> float:
        """Length of the period [s]."""
        return len(self.heave_m) / self.rate_hz


def synthesise(
    spectrum: WaveSpectrum,
    hull: BoxHull,
    seed: int,
    duration_s: float = 1200.0,
    rate_hz: float = 20.0,
) -> SeaRecord:
    """Return elevation η = Σ a·cos(ωt + φ) at the ship, heave Re Σ a·H(ω)·exp(i(ωt + φ)), its rate.

    Raises:
        InputError: duration or rate do not fit each other or the spectrum.
    """
    samples = _count_samples(spectrum, duration_s, rate_hz)
    lowest = int(np.ceil(spectrum.frequency_hz[0] * duration_s - 1e-9))
    highest = int(np.floor(spectrum.frequency_hz[-1] * duration_s + 1e-9))
    order = np.arange(max(lowest, 1), highest + 1)
    frequency = order / duration_s
    amplitude = np.sqrt(2.0 * spectrum.density_at(frequency) / duration_s)
    wave = amplitude * np.exp(1j * random_phases(seed, len(order)))
    heave = wave * heave_response(hull, frequency)

    def in_time(component: NDArray[np.complex128]) -> Vector:
        half = np.zeros(samples // 2 + 1, dtype=np.complex128)
        half[order] = 0.5 * samples * component
        return np.fft.irfft(half, samples)

    return SeaRecord(
        rate_hz=rate_hz,
        elevation_m=in_time(wave),
        heave_m=in_time(heave),
        heave_velocity_m_per_s=in_time(heave * 2j * np.pi * frequency),
        source=f"{spectrum.source}; {hull.describe()}; seed {seed}",
    )


def _count_samples(spectrum: WaveSpectrum, duration_s: float, rate_hz: float) -> int:
    if not (np.isfinite(duration_s) and 60.0 <= duration_s <= 10800.0):
        raise InputError(phrase("duration", f"it is {duration_s:g} s", "right is 60 to 10800 s"))
    fastest_hz = float(spectrum.frequency_hz[-1])
    if not (np.isfinite(rate_hz) and 2.0 * fastest_hz < rate_hz <= 1000.0):
        right = f"right is above {2.0 * fastest_hz:g} (twice the spectrum's end) to 1000 Hz"
        raise InputError(phrase("rate", f"it is {rate_hz:g} Hz", right))
    samples = round(duration_s * rate_hz)
    if abs(samples - duration_s * rate_hz) > 1e-6:
        what = f"{duration_s:g} s hold no whole number of samples at {rate_hz:g} Hz"
        raise InputError(phrase("duration", what, "right is a multiple of the sample period"))
    return samples
