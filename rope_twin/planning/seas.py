"""Motion of the crane tip in a sea state: transfer functions, moments and records of a seed.

The tip is moved rigidly with the ship at small angles: x_tip = x + θ × r for each frequency, with
the arm r from the reference point of the RAOs, as DNV-RP-N103 (4.3.3) does.

Records without waves on the rope are sums of components at multiples of 1/duration with random
phases and Rayleigh-distributed amplitudes (DNV-RP-C205, 3.3.2), so that they are samples of a
Gaussian sea whose own Hs differs from record to record. Where the scene has waves at rope and
payload, the ship answers each of their components: same waves, same phases.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len

from rope_twin.sea.raos import Responses, moved_by
from rope_twin.sea.ship_motion import BoxHull, heave_response
from rope_twin.sea.spectrum import (
    STANDARD_GRAVITY,
    Waves,
    WaveSpectrum,
    directions,
    jonswap,
    random_shares,
    wave_at,
)
from rope_twin.sea.tables import Vector
from rope_twin.twin.motion.heave_track import HeaveSeries

Complex = NDArray[np.complex128]

SAMPLE_NS = 50_000_000  # 20 Hz, the rate of ship/heave
LEAD_SAMPLES = 4  # before time 0, so that it lies between two samples
AFTER_SAMPLES = 40  # behind the end: the last step looks ahead
CHUNK = 4096  # samples at once of a sum of components


@dataclass(frozen=True)
class ResponsesTip:
    """Crane tip of a ship with RAOs in six degrees of freedom."""

    responses: Responses
    arm_m: tuple[float, float, float]  # from the reference point: forward, to port, up
    headings = True  # it depends on the heading of the waves

    @property
    def source(self) -> str:
        """Return a description."""
        x, y, z = self.arm_m
        table = Path(self.responses.source).name
        return f"RAOs {table}, crane tip {x:g} m ahead, {y:g} m to port, {z:g} m up"

    def at(self, frequency_hz: Vector, heading: Vector) -> Complex:
        """Return motion forward, to port and up per metre of wave amplitude, (3, n).

        Positive phases lead the wave at the reference point. heading: direction that each wave
        travels to, from the bow to port [rad]; 0 from astern, π head seas.
        """
        return moved_by(self.responses.at(frequency_hz, heading), self.arm_m)[:3]

    def freedoms(self, frequency_hz: Vector, heading: Vector) -> Complex:
        """Return surge, sway, heave, roll, pitch and yaw of the ship, (6, n); see `at`."""
        return self.responses.at(frequency_hz, heading)


@dataclass(frozen=True)
class HullTip:
    """Hang-off that heaves with a box-like hull in head seas."""

    hull: BoxHull
    headings = False

    @property
    def source(self) -> str:
        """Return a description."""
        return self.hull.describe()

    def at(self, frequency_hz: Vector, heading: Vector) -> Complex:
        """Return the heave; no lateral motion."""
        return self.freedoms(frequency_hz, heading)[:3]

    def freedoms(self, frequency_hz: Vector, heading: Vector) -> Complex:
        """Return the heave alone."""
        motions = np.zeros((6, len(frequency_hz)), np.complex128)
        motions[2] = heave_response(self.hull, frequency_hz)
        return motions


TipTransfer = ResponsesTip | HullTip


class Ship(NamedTuple):
    """Motion of the crane tip over the scene's water."""

    tip: TipTransfer
    bow: float  # heading of the bow, from east to north [rad]


@dataclass(frozen=True)
class SeaState:
    """A cell's sea."""

    height_m: float  # Hs
    period_s: float  # Tp
    heading_deg: float  # that the waves travel to, from the bow to port; 180: head seas
    gamma: float | None = None  # of JONSWAP; None: by DNV-RP-C205, 3.5.5.5
    spreading: float | None = None  # exponent s of cos²ˢ; None: long-crested

    def spectrum(self) -> WaveSpectrum:
        """Return the JONSWAP spectrum, scaled so that its Hs is exactly the height.

        A_γ = 1 - 0.287·ln γ is a fit, off by up to 0.1 % of Hs.
        """
        raw = jonswap(self.height_m, self.period_s, self.gamma)
        scale = (self.height_m / raw.significant_height_m) ** 2
        return WaveSpectrum(raw.frequency_hz, scale * raw.density_m2_per_hz, raw.source)


@dataclass(frozen=True)
class RelativeTip:
    """Crane tip of a ship relative to the deck of another one, or to another point of its own."""

    tip: TipTransfer
    deck: DeckTransfer

    def at(self, frequency_hz: Vector, heading: Vector) -> Complex:
        """Return the motion of the tip less that of the deck."""
        return self.tip.at(frequency_hz, heading) - self.deck.at(frequency_hz, heading)


@dataclass(frozen=True)
class DeckTransfer:
    """Motion of a point of a deck, per metre of wave amplitude at the crane vessel's reference."""

    responses: Responses
    arm_m: tuple[float, float, float]  # from its reference point: forward, to port, up
    turn: float  # of its bow from the crane vessel's, to port [rad]
    apart_m: tuple[float, float]  # of its reference point from the crane vessel's: ahead, to port

    def at(self, frequency_hz: Vector, heading: Vector) -> Complex:
        """Return the motion along the axes of the crane vessel in deep water, (3, n)."""
        x, y = self.apart_m
        number = (2.0 * np.pi * frequency_hz) ** 2 / STANDARD_GRAVITY
        phase = np.exp(-1j * number * (x * np.cos(heading) + y * np.sin(heading)))
        motions = self.responses.at(frequency_hz, heading - self.turn)
        forward, port, up = phase * moved_by(motions, self.arm_m)[:3]
        c, s = math.cos(self.turn), math.sin(self.turn)
        return np.stack([c * forward - s * port, s * forward + c * port, up])


PointTransfer = TipTransfer | RelativeTip | DeckTransfer


@dataclass(frozen=True)
class TipMoments:
    """Motion of the crane tip in a sea state, along one direction."""

    rms_m: float
    rms_m_per_s: float
    rms_m_per_s2: float

    @property
    def crossing_period_s(self) -> float:
        """Return the mean zero-crossing period of the motion, 2π·σ/σ_v."""
        return 2.0 * math.pi * self.rms_m / self.rms_m_per_s if self.rms_m_per_s > 0.0 else math.inf


def tip_spectrum(tip: PointTransfer, sea: SeaState) -> tuple[Vector, Vector]:
    """Return frequencies [Hz] and one-sided density of the tip's height [m²/Hz], (n,) each."""
    spectrum = sea.spectrum()
    f, density = spectrum.frequency_hz, spectrum.density_m2_per_hz
    squared_response = np.zeros_like(f)
    for turn, share in _directions(sea.spreading):
        heading = np.full_like(f, math.radians(sea.heading_deg) + turn)
        squared_response += share * np.abs(tip.at(f, heading)[2]) ** 2
    return f, squared_response * density


def tip_moments(tip: PointTransfer, sea: SeaState) -> TipMoments:
    """Return the standard deviations of the tip's height, velocity and acceleration."""
    return _moments(*tip_spectrum(tip, sea))


def _moments(f: Vector, density: Vector) -> TipMoments:
    omega = 2.0 * np.pi * f
    rms = [math.sqrt(float(np.trapezoid(omega ** (2 * k) * density, f))) for k in range(3)]
    return TipMoments(*rms)


def lateral_moments(tip: PointTransfer, sea: SeaState) -> TipMoments:
    """Return the standard deviations of the horizontal motion in the direction of its largest."""
    spectrum = sea.spectrum()
    f, density = spectrum.frequency_hz, spectrum.density_m2_per_hz
    products = np.zeros((len(f), 2, 2))
    for turn, share in _directions(sea.spreading):
        forward, port, _ = tip.at(f, np.full_like(f, math.radians(sea.heading_deg) + turn))
        pair = np.stack([forward, port], axis=1)
        products += share * (pair[:, :, None] * pair[:, None, :].conj()).real
    products *= density[:, None, None]
    direction = np.linalg.eigh(np.trapezoid(products, f, axis=0))[1][:, -1]
    directional_density = np.einsum("i,nij,j->n", direction, products, direction)
    return _moments(f, directional_density)


def _directions(exponent: float | None) -> list[tuple[float, float]]:
    """Return directions about the mean [rad] and their shares of the energy."""
    if exponent is None:
        return [(0.0, 1.0)]
    turns = np.linspace(-math.pi, math.pi, 73)[:-1]
    share = np.cos(0.5 * turns) ** (2.0 * exponent)
    return list(zip(turns.tolist(), (share / share.sum()).tolist(), strict=True))


def tip_record(ship: Ship, sea: SeaState, seed: int, seconds: float) -> HeaveSeries:
    """Return the motion of the crane tip in a record of a Gaussian sea over this time [s]."""
    samples = _samples(seconds)
    record = sea_record(sea, seed, seconds)
    order, count = record.order, record.count
    motion = record.wave * ship.tip.at(record.frequency_hz, record.heading)

    def in_time(component: Complex) -> Vector:
        half = np.zeros(count // 2 + 1, np.complex128)
        half[order] = 0.5 * count * component
        return np.asarray(irfft(half, count)[:samples])

    tracks = [in_time(part) for part in _in_sea(motion, record.omega, ship)]
    return _series(tracks)


@dataclass(frozen=True)
class SeaRecord:
    """Wave components of a record at the reference point of the ship, (n,) each."""

    order: Any  # multiples of 1/duration
    frequency_hz: Vector
    wave: Complex  # amplitude and phase, LEAD_SAMPLES before time 0
    heading: Vector  # from the bow to port [rad]
    count: int  # samples of its period

    @property
    def omega(self) -> Vector:
        """Return the angular frequencies [rad/s]."""
        return np.asarray(2.0 * np.pi * self.frequency_hz)

    def from_start(self, response: Complex) -> Complex:
        """Return the complex amplitudes of a response at time 0, (..., n); response: its RAO."""
        phase = np.exp(1j * self.omega * (LEAD_SAMPLES * SAMPLE_NS * 1e-9))
        return np.asarray(self.wave * phase * response)

    def harmonics(self, deck: DeckTransfer) -> Vector:
        """Return amplitude [m], ω [rad/s] and phase [rad] of the sines of a deck's height from
        time 0 on, (n, 3).
        """
        height = self.from_start(deck.at(self.frequency_hz, self.heading)[2])
        return np.column_stack([np.abs(height), self.omega, np.angle(height) + 0.5 * np.pi])


def _samples(seconds: float) -> int:
    return math.ceil(seconds * 1e9 / SAMPLE_NS) + LEAD_SAMPLES + AFTER_SAMPLES


def sea_record(sea: SeaState, seed: int, seconds: float) -> SeaRecord:
    """Return the components of a record of a Gaussian sea; see `tip_record`."""
    count = next_fast_len(_samples(seconds), real=True)
    duration = count * SAMPLE_NS * 1e-9
    spectrum = sea.spectrum()
    first = max(math.ceil(spectrum.frequency_hz[0] * duration), 1)
    last = min(math.floor(spectrum.frequency_hz[-1] * duration), count // 2 - 1)
    order = np.arange(first, last + 1)
    f = order / duration
    shares = random_shares(seed, 3 * len(order)).reshape(3, -1)
    energy = -np.log1p(-shares[1])  # of a Rayleigh amplitude over its mean
    amplitude = np.sqrt(2.0 * spectrum.density_at(f) / duration * energy)
    wave = amplitude * np.exp(2j * np.pi * shares[0])
    heading = math.radians(sea.heading_deg) + directions(sea.spreading, shares[2])
    return SeaRecord(order, f, wave, heading, count)


def tip_on_waves(
    ship: Ship, waves: Waves, reference: tuple[float, float], seconds: float
) -> HeaveSeries:
    """Return the motion of the crane tip of a ship that answers given waves over this time [s].

    reference: x and y of the ship's reference point [m].
    """
    samples = _samples(seconds)
    response = ship.tip.at(waves.omega / (2.0 * np.pi), waves.heading - ship.bow)
    motion = wave_at(waves, *reference) * response
    parts = np.stack(_in_sea(motion, waves.omega, ship), axis=1)
    time_s = (np.arange(samples) - LEAD_SAMPLES) * (SAMPLE_NS * 1e-9)
    chunks = [
        (np.exp(1j * np.outer(time_s[k : k + CHUNK], waves.omega)) @ parts).real
        for k in range(0, samples, CHUNK)
    ]
    return _series(list(np.concatenate(chunks).T))


def _in_sea(motion: Complex, omega: Vector, ship: Ship) -> list[Complex]:
    """Return height and its rate; of RAOs, then east, north and their rates."""
    forward, port, up = motion
    components = [up, 1j * omega * up]
    if ship.tip.headings:
        c, s = math.cos(ship.bow), math.sin(ship.bow)
        east, north = c * forward - s * port, s * forward + c * port
        components += [east, north, 1j * omega * east, 1j * omega * north]
    return components


def _series(tracks: list[Vector]) -> HeaveSeries:
    """Return the samples as a series whose time 0 is LEAD_SAMPLES behind the first.

    Raises:
        InputError: the motion is beyond what a ship can do.
    """
    z, v, *lateral = tracks
    stamps = (np.arange(len(z), dtype=np.int64) - LEAD_SAMPLES) * SAMPLE_NS
    lateral_motion = np.ascontiguousarray(np.stack(lateral)) if lateral else None
    return HeaveSeries(
        stamps, np.ascontiguousarray(z), np.ascontiguousarray(v), lateral=lateral_motion
    )
