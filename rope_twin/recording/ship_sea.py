"""Ship motion from a prescribed table or from RAOs in waves, and heave of a box hull in waves."""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, sin

import numpy as np
from numpy.typing import NDArray

from rope_twin.effects.waves import WavesParams, components_of
from rope_twin.recording.heave import HeaveSample, stamps_between
from rope_twin.scene.schema import Scene
from rope_twin.sea.components import Waves
from rope_twin.sea.ship_motion import (
    BoxHull,
    Responses,
    Way,
    heave_response,
    read_responses,
    read_way,
)
from rope_twin.sea.spectrum import Vector
from rope_twin.twin.motion.hang_off import lever_arm
from rope_twin.twin.motion.ship_pose import Quaternion, ShipPose, Vector3, hang_off_motion, turned

Floats = NDArray[np.float64]


def sample_of(pose: ShipPose, arm_m: Vector3, elevation_m: float | None) -> HeaveSample:
    """Return the sample of a pose: the hang-off motion and the pose itself."""
    place, velocity = hang_off_motion(pose, arm_m)
    aside = (*place[:2], *velocity[:2])
    return HeaveSample(pose.stamp_ns, place[2], velocity[2], elevation_m, pose, aside)


class ShipOnWaves:
    """Poses of a ship that answers each component of the waves that the rope feels.

    A component a·cos(k·x - ω·t + φ) is the real part of a·exp(i(ω·t - k·x - φ)); each degree of
    freedom answers with its response times that, at the reference point at rest. Turns are yaw,
    then pitch, then roll about the ship's axes.
    """

    note = ""

    def __init__(self, waves: Waves, responses: Responses, scene: Scene) -> None:
        self._arm = lever_arm(scene)
        self._bow = float(np.radians(scene.sea_state.on_waves.heading_deg))  # type: ignore[union-attr]
        self._omega = waves.omega
        x, y, _ = scene.ship.hang_off_m
        self._surface = wave_at(waves, x, y)
        wave = wave_at(waves, x - self._arm[0], y - self._arm[1])
        frequency = waves.omega / (2.0 * np.pi)
        self._answer = wave * responses.at(frequency, waves.heading - self._bow)
        self.source = (
            f"waves of Hs {waves.significant_height_m:.3g} m; six degrees of freedom by "
            f"{responses.source}, bow at {np.degrees(self._bow):g}°"
        )

    def freedoms(self, time_s: float) -> tuple[Floats, Floats]:
        """Return surge, sway, heave [m], roll, pitch, yaw [rad] at a time, and the rates, (6,)."""
        moved = self._answer * np.exp(1j * self._omega * time_s)
        return moved.sum(axis=1).real, (1j * self._omega * moved).sum(axis=1).real

    def pose(self, stamp_ns: int) -> ShipPose:
        """Return the pose at a time, computed by itself: bit-identical in whatever interval."""
        moved, rate = (part.tolist() for part in self.freedoms(stamp_ns * 1e-9))
        x, y, z, w = _quaternion(*moved[3:])
        orientation = (*self._from_bow(x, y), z, w)
        velocity = turned((-orientation[0], -orientation[1], -z, w), self._in_sea(rate[:3]))
        spin = self._in_sea(_body_rates(moved[3], moved[4], rate[3:]))
        return ShipPose(stamp_ns, self._in_sea(moved[:3]), velocity, orientation, spin)

    def _from_bow(self, forward: float, port: float) -> tuple[float, float]:
        """Return east and north of a direction forward and to port on the ship at rest."""
        c, s = cos(self._bow), sin(self._bow)
        return c * forward - s * port, s * forward + c * port

    def _in_sea(self, vector: Sequence[float]) -> Vector3:
        return (*self._from_bow(vector[0], vector[1]), vector[2])

    def between(self, from_ns: int, to_ns: int) -> list[HeaveSample]:
        """Return samples with from_ns <= stamp_ns < to_ns, in order."""
        found = []
        for stamp in stamps_between(from_ns, to_ns).tolist():
            surface = (self._surface * np.exp(1j * self._omega * (stamp * 1e-9))).sum().real
            found.append(sample_of(self.pose(stamp), self._arm, float(surface)))
        return found

    def is_over(self, from_ns: int) -> bool:
        """Return False: the wave components have no end."""
        return False


def wave_at(waves: Waves, x: float, y: float) -> NDArray[np.complex128]:
    """Return a·exp(-i(k·x + φ)) of each component at a position [m], (components,)."""
    along = waves.wave_number * (x * np.cos(waves.heading) + y * np.sin(waves.heading))
    return np.asarray(waves.amplitude_m * np.exp(-1j * (along + waves.phase)))


def _quaternion(roll: float, pitch: float, yaw: float) -> Quaternion:
    """Return the quaternion x, y, z, w of yaw, then pitch, then roll about the rotated axes."""
    a, d = cos(0.5 * roll), sin(0.5 * roll)
    b, e = cos(0.5 * pitch), sin(0.5 * pitch)
    c, f = cos(0.5 * yaw), sin(0.5 * yaw)
    return (
        d * b * c - a * e * f, a * e * c + d * b * f, a * b * f - d * e * c, a * b * c + d * e * f,
    )  # fmt: skip


def _body_rates(roll: float, pitch: float, rates: Sequence[float]) -> Vector3:
    """Return the angular velocity in body axes from the rates of roll, pitch and yaw.

    Fossen (2011), Handbook of Marine Craft Hydrodynamics, eq. 2.26.
    """
    p, q, r = rates
    return (
        p - sin(pitch) * r,
        cos(roll) * q + cos(pitch) * sin(roll) * r,
        cos(pitch) * cos(roll) * r - sin(roll) * q,
    )


class WayOfHangOff:
    """Samples of a way given in a table; the ship does not turn."""

    note = ""

    def __init__(self, way: Way, start_s: float = 0.0) -> None:
        self._way, self._start_s = way, start_s
        self.source = f"hang-off on the way of {way.source}, {way.end_s:g} s long"

    def between(self, from_ns: int, to_ns: int) -> list[HeaveSample]:
        """Return samples with from_ns <= stamp_ns < to_ns, in order."""
        stamps = stamps_between(from_ns, to_ns)
        times = np.asarray(stamps * 1e-9 + self._start_s, np.float64)
        known = times <= self._way.end_s
        place, velocity = self._way.at(times[known])
        rows = zip(stamps[known].tolist(), place.tolist(), velocity.tolist(), strict=True)
        poses = (ShipPose(stamp, tuple(p), tuple(v)) for stamp, p, v in rows)
        return [sample_of(pose, (0.0, 0.0, 0.0), None) for pose in poses]

    def is_over(self, from_ns: int) -> bool:
        """Return whether the motion has ended before a time."""
        return from_ns * 1e-9 + self._start_s > self._way.end_s


def open_way(scene: Scene, start_s: float = 0.0) -> WayOfHangOff:
    """Return the prescribed motion of the scene's `sea_state.path`, started `start_s` later.

    Raises:
        InputError: one sentence on what is wrong with the table.
    """
    return WayOfHangOff(read_way(scene.sea_state.path), scene.sea_state.start_s + start_s)


class WaveSea:
    """Samples of heave and of the surface at the hang-off by simulation time.

    A component a·cos(k·x - ω·t + φ) is the real part of a·exp(i(ω·t - k·x - φ)); the ship motion is
    its RAO times that. The sea itself builds up from flat with the ship's ramp.
    """

    note = ""

    def __init__(self, waves: Waves, hull: BoxHull, x: float, y: float) -> None:
        self.source = f"waves of Hs {waves.significant_height_m:.3g} m; {hull.describe()}"
        self._wave = wave_at(waves, x, y)
        self._heave = self._wave * heave_response(hull, waves.omega / (2.0 * np.pi))
        self._omega = waves.omega

    def at(self, time_s: Vector) -> tuple[Vector, Vector, Vector]:
        """Return position [m], velocity [m/s] and surface [m] at times (n,), exactly."""
        turn = np.exp(1j * np.outer(time_s, self._omega))
        moved = turn @ np.stack([self._heave, 1j * self._omega * self._heave, self._wave], axis=1)
        position, velocity, surface = moved.real.T
        return position, velocity, surface

    def between(self, from_ns: int, to_ns: int) -> list[HeaveSample]:
        """Return samples with from_ns <= stamp_ns < to_ns, in order.

        Each is computed by itself, so that it is bit-identical in whatever interval: the order of
        summation in a matrix product depends on the number of rows.
        """
        stamps = stamps_between(from_ns, to_ns).tolist()
        samples = []
        for stamp in stamps:
            (position,), (velocity,), (surface,) = self.at(np.array([stamp * 1e-9]))
            samples.append(HeaveSample(stamp, float(position), float(velocity), float(surface)))
        return samples

    def is_over(self, from_ns: int) -> bool:
        """Return False: the wave components have no end."""
        return False


def sea_of_waves(scene: Scene) -> WaveSea | ShipOnWaves | None:
    """Return the ship's motion on the scene's waves, or None if the scene has no such motion.

    Raises:
        InputError: its table of responses is wrong.
    """
    riding = scene.sea_state.on_waves
    if riding is None:
        return None
    params = scene.listed(WavesParams)
    assert params is not None, "checked when the scene was read"
    waves = components_of(params, scene.environment.gravity_m_per_s2)
    if riding.responses:
        return ShipOnWaves(waves, read_responses(riding.responses), scene)
    x, y, _ = scene.ship.hang_off_m
    return WaveSea(waves, riding.hull, x, y)
