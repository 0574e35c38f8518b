"""Replay of recorded ship poses in simulation time, once or as a seamless loop."""

from __future__ import annotations

import numpy as np

from rope_twin.recording.bag_reader import find_bag
from rope_twin.recording.heave_replay import HeaveSample, elevation_at, faded_surface
from rope_twin.recording.looped_replay import Passes, Splice, Track, plan_passes, splice_note
from rope_twin.recording.pose_record import (
    PoseRecord,
    read_poses,
    turn_changes,
    turn_rates,
    turned_by,
)
from rope_twin.recording.ship_sea import sample_of
from rope_twin.recording.stamped_rows import Table
from rope_twin.scene.schema import RecordedPoses, Scene
from rope_twin.twin.motion.hang_off import lever_arm
from rope_twin.twin.motion.ship_pose import ShipPose, Vector3


class PoseReplay:
    """Poses of a record by simulation time; t = 0 is `start_s` into the record.

    They are bit-identical to the record. In a loop they repeat; `note` reports if the end does not
    join the beginning; positions are then blended, and orientations as quaternions.
    """

    def __init__(
        self, record: PoseRecord, arm_m: Vector3, start_s: float = 0.0, loop: bool = True
    ) -> None:
        """Prepare the replay; arm_m: from the reference point to the hang-off.

        Raises:
            BagError: the start is not inside the record.
        """
        self.source, self._arm = f"ship's poses of {record.source}", arm_m
        track = _track_of(record)
        self.duration_s = track.end_ns * 1e-9
        schedule, splice = plan_passes(track, start_s, loop)
        self.loop_ns = schedule.loop_ns  # of a pass; None: there is one
        surface = elevation_at(record.elevation, track.time_ns, None if splice else self.loop_ns)
        rows = np.concatenate(
            [record.position_m, record.velocity_m_per_s, record.orientation,
             record.rate_rad_per_s, surface[:, None]], axis=1,
        )  # fmt: skip
        faded = None
        if splice is not None:
            parts = [_poses_at(splice), faded_surface(splice, track.time_ns, surface)]
            faded = np.concatenate(parts, axis=1)
        self._passes = Passes(schedule, rows, faded)
        self.note = " ".join(filter(None, [record.note, splice_note(record.source, track, splice)]))

    def between(self, from_ns: int, to_ns: int) -> list[HeaveSample]:
        """Return samples with from_ns <= stamp_ns < to_ns, in order; each stamp once."""
        found = []
        for stamp_ns, row in self._passes.between(from_ns, to_ns):
            place, velocity, turn, rate = row[:3], row[3:6], row[6:10], row[10:13]
            pose = ShipPose(stamp_ns, *map(tuple, (place, velocity, turn, rate)))
            found.append(sample_of(pose, self._arm, None if np.isnan(row[13]) else row[13]))
        return found

    def is_over(self, from_ns: int) -> bool:
        """Return whether there is no sample from a time on."""
        return self._passes.is_over(from_ns, self.duration_s)


def open_poses(
    scene: Scene, recorded: RecordedPoses, start_s: float = 0.0, loop: bool = True
) -> PoseReplay:
    """Replay of a bag's poses for the hang-off of a scene.

    Raises:
        BagError: one sentence on what is wrong with the bag, the topic or the start.
    """
    record = read_poses(find_bag(recorded.bag), recorded)
    return PoseReplay(record, lever_arm(scene), start_s, loop)


def _track_of(record: PoseRecord) -> Track:
    """Return positions and quaternions with their rates; signs as if the end met the beginning."""
    velocity = turned_by(record.orientation, record.velocity_m_per_s)
    turning = turn_changes(record.orientation, record.rate_rad_per_s)
    value = np.concatenate([record.position_m, record.orientation], axis=1)
    rate = np.concatenate([velocity, turning], axis=1)
    if record.orientation[0] @ record.orientation[-1] < 0.0:  # it has turned a circle
        late = record.time_ns > 0.6 * record.time_ns[-1]  # all that a splice is made of
        value[late, 3:] *= -1.0
        rate[late, 3:] *= -1.0
    return Track(record.time_ns, value, rate, record.period_ns)


def _poses_at(splice: Splice) -> Table:
    """Return position, velocity, orientation and angular velocity (h, 13) of the blended passes."""
    size = np.sqrt((splice.value[:, 3:] ** 2).sum(axis=1, keepdims=True))
    turn = splice.value[:, 3:] / size
    along = (turn * splice.rate[:, 3:]).sum(axis=1, keepdims=True)
    change = (splice.rate[:, 3:] - turn * along) / size
    velocity = turned_by(turn, splice.rate[:, :3], back=True)
    return np.concatenate([splice.value[:, :3], velocity, turn, turn_rates(turn, change)], axis=1)
