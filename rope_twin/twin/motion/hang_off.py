"""The hang-off's motion from what tells of it: its heave, or the ship's pose and the arm to it.

Whichever comes first moves the hang-off from then on; the other is refused, as both cannot be true.
A pose moves it in three directions: heave by the track itself, east and north by two more like it,
so that gaps, late samples and restarts are what they are for heave. Where ropes leave the ship at
further places, each of those has an arm and three tracks of its own; heave moves all of them alike.
"""

from __future__ import annotations

from collections.abc import Mapping

from rope_twin.errors import phrase
from rope_twin.scene.rules.rigging import places
from rope_twin.scene.schema import Scene
from rope_twin.twin.motion.ship import VELOCITY_LIMIT_M_PER_S, HeaveTrack
from rope_twin.twin.motion.ship_pose import (
    ShipPose,
    Vector3,
    hang_off_motion,
    is_finite,
    pose_fault,
)

FARTHEST_M = 1e5  # east or north of rest: a tow of a day


# by number of a rope but the first: displacement [m] and velocity [m/s] of its hang-off
Moves = Mapping[int, tuple[Vector3, Vector3]]


def lever_arm(scene: Scene, place_m: Vector3 | None = None) -> Vector3:
    """From the ship's reference point to a place on it at rest, or to the hang-off [m]."""
    x, y, z = place_m or scene.ship.hang_off_m
    a, b, c = scene.ship.reference_m or scene.ship.hang_off_m
    return x - a, y - b, z - c


class FurtherHangOff:
    """Where a rope but the first leaves a ship that is moved by poses."""

    def __init__(self, rope: int, arm_m: Vector3) -> None:
        self.rope, self._arm = rope, arm_m
        self._tracks = (HeaveTrack(FARTHEST_M), HeaveTrack(FARTHEST_M), HeaveTrack())

    def doubt(self) -> None:
        """What is known of times to come may no longer hold."""
        for track in self._tracks:
            track.doubt()

    def rest_until(self, time_ns: int | None) -> None:
        """It was asked for up to then, and was at rest."""
        for track in self._tracks:
            track.rest_until(time_ns)

    def offer(self, pose: ShipPose) -> None:
        """Take a pose that the first hang-off has taken."""
        place, velocity = hang_off_motion(pose, self._arm)
        for track, at, speed in zip(self._tracks, place, velocity, strict=True):
            track.offer(pose.stamp_ns, at, speed)

    def at(self, time_ns: int, ramp: tuple[float, float]) -> tuple[Vector3, Vector3]:
        """Displacement [m] and velocity [m/s] at a time, faded in by a ramp and its rate."""
        share, rate = ramp
        (x, u), (y, v), (z, w) = (track.at(time_ns) for track in self._tracks)
        moving = share * u + rate * x, share * v + rate * y, share * w + rate * z
        return (share * x, share * y, share * z), moving


class HangOffTrack(HeaveTrack):
    """A heave track that takes poses as well."""

    def __init__(self, scene: Scene) -> None:
        super().__init__()
        self._arm = lever_arm(scene)
        at = places(scene)
        self._further = tuple(
            FurtherHangOff(number, lever_arm(scene, at[line.from_]))
            for number, line in enumerate(scene.ropes)
            if number and line.from_ in at
        )
        self._aside = (HeaveTrack(FARTHEST_M), HeaveTrack(FARTHEST_M))
        self.posed = False  # whether poses move it

    def doubt(self) -> None:
        """The sender was away: what it has told of times to come may no longer hold."""
        super().doubt()
        for track in self._aside:
            track.doubt()
        for further in self._further:
            further.doubt()

    def offer(self, stamp_ns: int, position_m: float, velocity_m_per_s: float) -> str:
        """Take a sample of heave; returns "" or the sentence with which it was refused."""
        if self.posed:
            right = "let only one of ship/heave and ship/odometry be published"
            what = "the ship's pose moves the hang-off already"
            return self.counter.refuse("impossible", phrase("heave", what, right))
        return super().offer(stamp_ns, position_m, velocity_m_per_s)

    def offer_pose(self, pose: ShipPose) -> str:
        """Take the ship's pose; returns "" or the sentence with which it was refused."""
        fault = self._pose_fault(pose)
        if fault:
            kind = "impossible" if is_finite(pose) else "non_finite"
            return self.counter.refuse(kind, fault)
        place, velocity = hang_off_motion(pose, self._arm)
        for track, at, speed in zip(self._aside, place, velocity, strict=False):
            fault = track.jump(pose.stamp_ns, at) or _too_far(at, speed)
            if fault:
                return self.counter.refuse("impossible", fault.replace("heave", "ship pose", 1))
        fault = super().offer(pose.stamp_ns, place[2], velocity[2])
        if fault:
            return fault
        if not self.posed:
            self._begin_aside()
        for track, at, speed in zip(self._aside, place, velocity, strict=False):
            track.offer(pose.stamp_ns, at, speed)
        for further in self._further:
            further.offer(pose)
        return ""

    def _begin_aside(self) -> None:
        """From now on poses move it; until now it was at rest east and north."""
        self.posed = True
        for track in self._aside:
            track.rest_until(self._asked_ns)
        for further in self._further:
            further.rest_until(self._asked_ns)

    def aside_at(self, time_ns: int) -> tuple[tuple[float, float], tuple[float, float]]:
        """Displacement [m] and velocity [m/s], east and north, at a time; after `at`."""
        east, north = self._aside
        return east.at(time_ns), north.at(time_ns)

    def further_at(self, time_ns: int, ramp: tuple[float, float]) -> Moves:
        """How poses move the hang-offs of ropes but the first at a time; nothing without poses.

        ramp: by which the motion is faded in, and its rate [1/s].
        """
        if not self.posed:
            return {}
        return {further.rope: further.at(time_ns, ramp) for further in self._further}

    def _pose_fault(self, pose: ShipPose) -> str:
        if not self.posed and self.counter.newest_ns is not None:
            what = "heave moves the hang-off already"
            right = "let only one of ship/heave and ship/odometry be published"
            return phrase("ship pose", what, right)
        return pose_fault(pose)


def _too_far(at: float, speed: float) -> str:
    if abs(at) <= FARTHEST_M and abs(speed) <= VELOCITY_LIMIT_M_PER_S:
        return ""
    right = f"right is within {FARTHEST_M:g} m and {VELOCITY_LIMIT_M_PER_S:g} m/s"
    return phrase("ship pose", f"the hang-off at {at:g} m, moving at {speed:g} m/s", right)
