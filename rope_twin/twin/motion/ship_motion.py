"""Motion of the ship: pose in six degrees of freedom, a hang-off at an arm, irregular heave.

The pose is that of the ship's reference point relative to its mean position: displacement in the
axes of `map` (east, north, up) and the rotation R of the ship from its mean attitude; velocity and
rate of turn are in the ship's rotated axes, as in the twist of nav_msgs/Odometry (REP 103, REP
105). With the arm r from the reference point to the hang-off in the mean attitude, in the axes of
`map`, the hang-off is displaced by p + R·r - r and moves at R·(v + ω × r), without small-angle
approximation.

A periodic irregular sea gives elevation and heave in time from a spectrum, a hull and a seed. The
sum has one component at each multiple of 1/duration inside the spectrum, so the record is periodic
and can be looped without a discontinuity. Amplitudes are √(2·S·Δf), phases are random (the
deterministic-amplitude form: Hs of every record is that of its spectrum).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rope_twin.errors import InputError, phrase
from rope_twin.sea.ship_motion import BoxHull, heave_response
from rope_twin.sea.spectrum import WaveSpectrum, random_phases
from rope_twin.sea.tables import Vector

Vector3 = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]
UPRIGHT: Quaternion = (0.0, 0.0, 0.0, 1.0)
ZERO_VECTOR: Vector3 = (0.0, 0.0, 0.0)
UNIT_LENGTH_TOL = 1e-3  # tolerance of a unit quaternion's length
MAX_TILT_DEG = 60.0
MAX_RATE_RAD_PER_S = 2.0


@dataclass(frozen=True)
class ShipPose:
    """One pose sample; the stamp is in twin time."""

    stamp_ns: int
    position_m: Vector3  # of the reference point from its mean position: east, north, up
    velocity_m_per_s: Vector3  # of the reference point, in the ship's rotated axes
    orientation: Quaternion = UPRIGHT  # x, y, z, w: rotation from the mean attitude
    rate_rad_per_s: Vector3 = ZERO_VECTOR  # about the ship's rotated axes


def is_finite(pose: ShipPose) -> bool:
    """Return whether all numbers of a pose are finite."""
    parts = (pose.position_m, pose.velocity_m_per_s, pose.orientation, pose.rate_rad_per_s)
    return all(math.isfinite(number) for part in parts for number in part)


def orientation_fault(orientation: Quaternion) -> tuple[str, ...]:
    """Return why numbers are no rotation, and the remedy; or nothing."""
    size = math.hypot(*orientation)
    if abs(size - 1.0) <= UNIT_LENGTH_TOL:
        return ()
    problem = f"an orientation of length {size:.4g}"
    return problem, "give a unit quaternion x, y, z, w; upright is 0, 0, 0, 1"


def pose_fault(pose: ShipPose) -> str:
    """Return why a pose is impossible for a ship; or ""."""
    if not is_finite(pose):
        problem = f"position {pose.position_m}, orientation {pose.orientation}"
        return phrase("ship pose", problem, "all its numbers must be finite")
    if reason := orientation_fault(pose.orientation):
        return phrase("ship pose", *reason)
    x, y, _, _ = pose.orientation
    tilt = math.degrees(math.acos(max(-1.0, min(1.0, 1.0 - 2.0 * (x * x + y * y)))))
    if tilt > MAX_TILT_DEG:
        remedy = f"a ship heels by at most {MAX_TILT_DEG:g}°"
        return phrase("ship pose", f"it heels by {tilt:.0f}°", remedy)
    rate = math.sqrt(sum(w * w for w in pose.rate_rad_per_s))
    if rate > MAX_RATE_RAD_PER_S:
        remedy = f"a ship turns by at most {MAX_RATE_RAD_PER_S:g} rad/s"
        return phrase("ship pose", f"it turns at {rate:.2f} rad/s", remedy)
    return ""


def sea_velocity(pose: ShipPose) -> Vector3:
    """Velocity of the reference point in the axes of `map` [m/s]."""
    return turned(pose.orientation, pose.velocity_m_per_s)


def with_rates(pose: ShipPose, velocity_m_per_s: Vector3, rate_rad_per_s: Vector3) -> ShipPose:
    """Return the pose with other rates: velocity in the axes of `map`, turning in the ship's."""
    x, y, z, w = pose.orientation
    velocity_in_ship = turned((-x, -y, -z, w), velocity_m_per_s)
    return replace(pose, velocity_m_per_s=velocity_in_ship, rate_rad_per_s=rate_rad_per_s)


def turn_between(old: Quaternion, new: Quaternion) -> Vector3:
    """Return the rotation vector from one orientation to another in the ship's axes [rad]."""
    a, b, c, d = -old[0], -old[1], -old[2], old[3]
    e, f, g, h = new
    x, y = d * e + a * h + b * g - c * f, d * f - a * g + b * h + c * e
    z, w = d * g + a * f - b * e + c * h, d * h - a * e - b * f - c * g
    size = math.sqrt(x * x + y * y + z * z)
    if w < 0.0:  # a quaternion and its negative are the same orientation
        x, y, z, w = -x, -y, -z, -w
    scale = 2.0 if size < 1e-12 else 2.0 * math.atan2(size, w) / size
    return scale * x, scale * y, scale * z


def hang_off_motion(pose: ShipPose, arm_m: Vector3) -> tuple[Vector3, Vector3]:
    """Return displacement of the hang-off [m] and its velocity [m/s], in the axes of `map`."""
    px, py, pz = pose.position_m
    vx, vy, vz = pose.velocity_m_per_s
    if pose.orientation == UPRIGHT and pose.rate_rad_per_s == ZERO_VECTOR:
        return (px, py, pz), (vx, vy, vz)
    rx, ry, rz = arm_m
    wx, wy, wz = pose.rate_rad_per_s
    tx, ty, tz = turned(pose.orientation, arm_m)
    velocity = (vx + wy * rz - wz * ry, vy + wz * rx - wx * rz, vz + wx * ry - wy * rx)
    return (px + tx - rx, py + ty - ry, pz + tz - rz), turned(pose.orientation, velocity)


def attitude(roll: float, pitch: float, yaw: float) -> Quaternion:
    """Return the quaternion x, y, z, w of yaw, then pitch, then roll about the rotated axes."""
    a, d = math.cos(0.5 * roll), math.sin(0.5 * roll)
    b, e = math.cos(0.5 * pitch), math.sin(0.5 * pitch)
    c, f = math.cos(0.5 * yaw), math.sin(0.5 * yaw)
    return (
        d * b * c - a * e * f, a * e * c + d * b * f, a * b * f - d * e * c, a * b * c + d * e * f,
    )  # fmt: skip


def body_rates(roll: float, pitch: float, rates: Sequence[float]) -> Vector3:
    """Return the angular velocity in body axes from the rates of roll, pitch and yaw.

    Fossen (2011), Handbook of Marine Craft Hydrodynamics, eq. 2.26.
    """
    p, q, r = rates
    return (
        p - math.sin(pitch) * r,
        math.cos(roll) * q + math.cos(pitch) * math.sin(roll) * r,
        math.cos(pitch) * math.cos(roll) * r - math.sin(roll) * q,
    )


def turned(orientation: Quaternion, vector: Vector3) -> Vector3:
    """Return R·vector: v + 2·q × (q × v + w·v), over the square of the quaternion's length."""
    x, y, z, w = orientation
    a, b, c = vector
    scale = 2.0 / (x * x + y * y + z * z + w * w)
    d, e, f = y * c - z * b + w * a, z * a - x * c + w * b, x * b - y * a + w * c
    return (
        a + scale * (y * f - z * e),
        b + scale * (z * d - x * f),
        c + scale * (x * e - y * d),
    )


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
        raise InputError("duration", f"it is {duration_s:g} s", "right is 60 to 10800 s")
    fastest_hz = float(spectrum.frequency_hz[-1])
    if not (np.isfinite(rate_hz) and 2.0 * fastest_hz < rate_hz <= 1000.0):
        remedy = f"right is above {2.0 * fastest_hz:g} (twice the spectrum's end) to 1000 Hz"
        raise InputError("rate", f"it is {rate_hz:g} Hz", remedy)
    samples = round(duration_s * rate_hz)
    if abs(samples - duration_s * rate_hz) > 1e-6:
        problem = f"{duration_s:g} s hold no whole number of samples at {rate_hz:g} Hz"
        raise InputError("duration", problem, "right is a multiple of the sample period")
    return samples
