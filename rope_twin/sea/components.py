"""A sea state as a sum of Airy waves (Airy 1845): one regular wave, or a discretised spectrum.

Each component has the surface a·cos θ with θ = k·(x·cos β + y·sin β) - ω·t + φ, where ω² =
g·k·tanh(k·h) (DNV-RP-C205, 3.2.2). β is the direction of propagation, from east to north.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rope_twin.errors import InputError
from rope_twin.sea.spectrum import WaveSpectrum
from rope_twin.sea.tables import Vector


def random_shares(seed: int, count: int) -> Vector:
    """Return uniform random numbers in [0, 1), (count,).

    Made from the raw words of PCG64, whose stream numpy guarantees, so that a seed gives the same
    sea with every version of numpy.

    Raises:
        InputError: a negative seed.
    """
    if seed < 0:
        raise InputError("seed", f"it is {seed}", "right is a whole number from 0")
    words = np.random.PCG64(seed).random_raw(count)
    return (words >> np.uint64(11)).astype(np.float64) * 2.0**-53


def random_phases(seed: int, count: int) -> Vector:
    """Return uniform random phases [rad], (count,).

    Raises:
        InputError: a negative seed.
    """
    return 2.0 * np.pi * random_shares(seed, count)


DEEP = math.inf  # m
TAIL = 1e-3  # of the variance: tail at each end of a spectrum, added to the outermost components
NEWTON = 30
LEAST_TURN = 1e-12


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
        along = self.wave_number * (x * np.cos(self.heading) + y * np.sin(self.heading))
        angle = (along + self.phase)[:, None] - self.omega[:, None] * time
        return np.asarray((self.amplitude_m[:, None] * np.cos(angle)).sum(axis=0))


def wave_at(waves: Waves, x: float, y: float) -> NDArray[np.complex128]:
    """Return a·exp(-i(k·x + φ)) of each component at a position [m], (components,)."""
    along = waves.wave_number * (x * np.cos(waves.heading) + y * np.sin(waves.heading))
    return np.asarray(waves.amplitude_m * np.exp(-1j * (along + waves.phase)))


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
        if np.all(np.abs(change) <= LEAST_TURN * kh):
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


def irregular_waves(
    spectrum: WaveSpectrum, count: int, seed: int, depth_m: float, gravity: float
) -> Waves:
    """Return a spectrum as `count` components that all travel east; `spread` turns them.

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
    frequency = edges[:-1] + random_shares(seed, 2 * count)[count:] * np.diff(edges)
    omega = 2.0 * np.pi * frequency
    phase = 2.0 * np.pi * random_shares(seed, count)
    k = wave_numbers(omega, depth_m, gravity)
    return Waves(amplitude, omega, k, np.zeros(count), phase, depth_m)


def spread(waves: Waves, heading: float, exponent: float | None, seed: int) -> Waves:
    """Return the waves with directions spread about a mean heading [rad].

    exponent: s of the directional distribution cos^2s((β - β0)/2) (Longuet-Higgins, Cartwright and
    Smith 1963); None: long-crested. Each component has one direction, drawn from the distribution.
    """
    count = len(waves.omega)
    turn = np.zeros(count)
    if exponent is not None:
        angle = np.linspace(-math.pi, math.pi, 2001)
        density = np.cos(0.5 * angle) ** (2.0 * exponent)
        below = np.concatenate([[0.0], np.cumsum(density[1:] + density[:-1])])
        turn = np.interp(random_shares(seed, 3 * count)[2 * count :], below / below[-1], angle)
    return Waves(
        waves.amplitude_m, waves.omega, waves.wave_number, heading + turn, waves.phase,
        waves.depth_m,
    )  # fmt: skip


def together(systems: Sequence[Waves]) -> Waves:
    """Return the components of several systems in the same water, from the longest on."""
    order = np.argsort(np.concatenate([own.wave_number for own in systems]), kind="stable")
    return Waves(
        np.concatenate([own.amplitude_m for own in systems])[order],
        np.concatenate([own.omega for own in systems])[order],
        np.concatenate([own.wave_number for own in systems])[order],
        np.concatenate([own.heading for own in systems])[order],
        np.concatenate([own.phase for own in systems])[order],
        systems[0].depth_m,
    )
