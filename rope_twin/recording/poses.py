"""Reader of ship poses from a bag, with selection of valid samples and a check of their rates.

nav_msgs/Odometry has pose and twist (in body axes, REP 103 and 105), geometry_msgs/PoseStamped only
the pose. No fault is corrected silently: skipped and derived values are counted and reported in
`note`.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rope_twin.errors import BagError, phrase
from rope_twin.recording.bag import BagReader, find_bag
from rope_twin.recording.heave import (
    HeaveSample,
    read_elevation,
    sample_of,
)
from rope_twin.recording.track import (
    Faults,
    MotionRecord,
    RecordReplay,
    Splice,
    StampedRows,
    Stamps,
    Table,
    Track,
    choose_topic,
)
from rope_twin.scene.schema import RecordedPoses, Scene
from rope_twin.topics import BY_NAME
from rope_twin.twin.motion.hang_off import lever_arm
from rope_twin.twin.motion.heave_track import HEAVE_LIMIT_M
from rope_twin.twin.motion.ship_motion import MOST_TILT_DEG, UNIT_WITHIN, ShipPose, Vector3

_ODOMETRY, _POSE_STAMPED = BY_NAME["ship/odometry"].type_name, "geometry_msgs/msg/PoseStamped"
_POSE_FIELDS = (
    *(f"pose.position.{k}" for k in "xyz"),
    *(f"pose.orientation.{k}" for k in "xyzw"),
)
_ODOMETRY_FIELDS = (
    *(f"pose.{field}" for field in _POSE_FIELDS),
    *(f"twist.twist.{part}.{k}" for part in ("linear", "angular") for k in "xyz"),
)
_PLACE, _TURN, _VELOCITY, _RATE = slice(0, 3), slice(3, 7), slice(7, 10), slice(10, 13)
_NEAR_M, _NEAR_DEG = 20.0, 20.0  # farther from rest at the start is told


@dataclass(frozen=True, kw_only=True)
class PoseRecord(MotionRecord):
    """Poses as a `ShipPose` has them."""

    position_m: Table  # (n, 3) from rest
    orientation: Table  # (n, 4) x, y, z, w from rest; signs without a jump
    velocity_m_per_s: Table  # (n, 3) in the turned axes
    rate_rad_per_s: Table  # (n, 3) in the turned axes


def read_poses(path: Path, recorded: RecordedPoses) -> PoseRecord:
    """Return the poses in a bag: of `recorded.topic`, or ship/odometry, or its only topic of poses.

    Raises:
        BagError: not a bag, no such topic, a wrong type, or too little that can be used.
    """
    with BagReader(path) as bag:
        types = (_ODOMETRY, _POSE_STAMPED)
        name = choose_topic(bag, recorded.topic or None, "ship/odometry", types)
        if not recorded.topic and f"/{name}".endswith("/ship/heave"):
            what = f"it has heave of the hang-off ({name}) and no pose of the ship"
            right = "replay it by --bag, or by `sea_state: {bag: ...}`"
            raise BagError(phrase(f"bag {path}", what, right))
        twisted = bag.topics[name].type_name == _ODOMETRY
        rows = StampedRows(bag, name, "odometry", _ODOMETRY_FIELDS if twisted else _POSE_FIELDS)
        stamp_ns, values = rows.usable(_judge)
        elevation_ns, elevation_m, told = read_elevation(bag)
        source = bag.custom_data.get("source", "")
    values[:, _TURN] = _without_jumps(values[:, _TURN])
    time_ns = stamp_ns - stamp_ns[0]
    notes = [*rows.notes, *told]
    values, derived = _with_rates(rows.where, time_ns, values)
    notes += derived
    place, turn, velocity, rate = _from_rest(values, recorded)
    notes.append(_far_from_rest(rows.where, place, turn))
    return PoseRecord(
        time_ns=time_ns,
        began_ns=int(stamp_ns[0]),
        position_m=place,
        orientation=turn,
        velocity_m_per_s=velocity,
        rate_rad_per_s=rate,
        elevation_time_ns=elevation_ns - stamp_ns[0],
        elevation_m=elevation_m,
        source=source or f"bag {path.name}, topic {name}",
        note=" ".join(filter(None, notes)),
    )


def turn_rates(orientation: Table, change: Table) -> Table:
    """Return the angular velocities (n, 3) in body axes of unit quaternions (n, 4) and their rates
    [1/s].

    ω = 2·Im(q*·dq/dt), e.g. Fossen (2011), eq. 2.69 solved for ω.
    """
    axis, w = orientation[:, :3], orientation[:, 3:]
    return np.asarray(
        2.0 * (w * change[:, :3] - change[:, 3:] * axis - np.cross(axis, change[:, :3]))
    )


def turn_changes(orientation: Table, rate: Table) -> Table:
    """Return the rates of quaternions (n, 4) [1/s] at angular velocities (n, 3): dq/dt = ½·q·ω."""
    axis, w = orientation[:, :3], orientation[:, 3:]
    along = w * rate + np.cross(axis, rate)
    return 0.5 * np.concatenate([along, -(axis * rate).sum(axis=1, keepdims=True)], axis=1)


def turned_by(orientation: Table, vectors: Table, back: bool = False) -> Table:
    """Return vectors (n, 3) rotated from body axes to those of the sea, or back."""
    from scipy.spatial.transform import Rotation  # slow to load, and few scenes need it

    return np.asarray(Rotation.from_quat(orientation).apply(vectors, inverse=back))


def _judge(values: Table) -> Faults:
    """Return the faults of samples that the twin would reject (twin/motion/ship_motion.py)."""
    with np.errstate(invalid="ignore", over="ignore"):
        size = np.sqrt((values[:, _TURN] ** 2).sum(axis=1))
        upward = 1.0 - 2.0 * (values[:, _TURN][:, :2] ** 2).sum(axis=1)
        return {
            "with an orientation that is no unit quaternion": np.abs(size - 1.0) > UNIT_WITHIN,
            f"that heel by more than {MOST_TILT_DEG:g}°": upward
            < np.cos(np.radians(MOST_TILT_DEG)),
        }


def _without_jumps(orientation: Table) -> Table:
    """Return quaternions with continuous signs: q and -q are the same rotation."""
    away = (orientation[1:] * orientation[:-1]).sum(axis=1) < 0.0
    sign = np.append(1.0, np.where(np.cumsum(away) % 2 == 1, -1.0, 1.0))
    return np.asarray(orientation * sign[:, None])


def _with_rates(where: str, time_ns: Stamps, values: Table) -> tuple[Table, list[str]]:
    """Return values (n, 13) with linear and angular velocity, recorded or derived (with a note).

    Raises:
        BagError: they contradict the pose.
    """
    time_s, turn = time_ns * 1e-9, values[:, _TURN]
    if len(time_s) < 3:
        slope = np.diff(values[:, :7], axis=0) / np.diff(time_s)[:, None]
        change = np.concatenate([slope, slope])
    else:
        change = np.gradient(values[:, :7], time_s, axis=0)
    seen = turned_by(turn, change[:, _PLACE], back=True), turn_rates(turn, change[:, _TURN])
    if values.shape[1] == 7:
        note = f"{where}: it has no twist, velocity and rate of turn are derived."
        return np.concatenate([values, *seen], axis=1), [note]
    notes = []
    for part, found, name in ((_VELOCITY, seen[0], "linear"), (_RATE, seen[1], "angular")):
        told = values[:, part]
        if not told.any() and found.any():
            values[:, part] = found
            notes.append(f"{where}: twist.{name} is zero throughout, it is derived.")
        elif np.abs(found).max() > 1e-9:
            notes.append(_agreement(where, name, told, found))
    return values, notes


def _agreement(where: str, name: str, told: Table, found: Table) -> str:
    """Return a note on the agreement of a recorded twist with the derivative of the pose, or "".

    Raises:
        BagError: the twist contradicts the pose.
    """
    close = float((told * found).sum() / np.sqrt((told**2).sum() * (found**2).sum()))
    if close < 0.0:
        what = f"twist.{name} runs against the pose (correlation {close:.2f})"
        right = "it must be the pose's rate of change in the ship's axes, x to the bow, z up"
        raise BagError(phrase(where, what, right))
    if close < 0.5:
        words = f"twist.{name} and pose agree poorly (correlation {close:.2f})"
        return f"{where}: {words}; a twist is in the ship's turned axes."
    return ""


def _from_rest(values: Table, recorded: RecordedPoses) -> tuple[Table, Table, Table, Table]:
    """Return position, orientation and velocities relative to the rest pose that the scene gives.

    With the attitude at rest Q, the turn from there is R·Q⁻¹ and the axes turned by it see the
    twist as Q·v and Q·ω.
    """
    place, turn = values[:, _PLACE] - np.array(recorded.rest_m), values[:, _TURN]
    velocity, rate = values[:, _VELOCITY], values[:, _RATE]
    if recorded.heading_deg == 0.0:
        return place, turn, velocity, rate
    half = 0.5 * np.radians(recorded.heading_deg)
    s, c = np.sin(half), np.cos(half)
    x, y, z, w = turn.T
    from_rest = np.stack([x * c - y * s, y * c + x * s, z * c - w * s, w * c + z * s], axis=1)
    rest = np.tile([0.0, 0.0, s, c], (len(turn), 1))
    return place, from_rest, turned_by(rest, velocity), turned_by(rest, rate)


def _far_from_rest(where: str, place: Table, turn: Table) -> str:
    """Return a note if the record begins far from rest, perhaps because none was given; or "".

    Raises:
        BagError: it is higher above or below the water than a ship can be.
    """
    height = float(place[:, 2].mean())
    right = "give where it rests in the record: `rest_m`, `heading_deg` of `poses`"
    if abs(height) > HEAVE_LIMIT_M:
        raise BagError(phrase(where, f"the ship lies {height:.1f} m above its rest", right))
    x, y, z, w = turn[0]
    off_deg = abs(np.degrees(np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))))
    off_m = float(np.hypot(*place[0, :2]))
    if off_m <= _NEAR_M and off_deg <= _NEAR_DEG:
        return ""
    return phrase(where, f"it begins {off_m:.0f} m and {off_deg:.0f}° from rest", right)


class PoseReplay(RecordReplay):
    """Samples of recorded poses by simulation time, bit-identical to the record.

    Where an end is blended into a beginning, positions are blended, and orientations as
    quaternions.
    """

    topic = "ship/odometry"

    def __init__(
        self, record: PoseRecord, arm_m: Vector3, start_s: float = 0.0, loop: bool = True
    ) -> None:
        """Prepare the replay; arm_m: from the reference point to the hang-off.

        Raises:
            BagError: the start is not inside the record.
        """
        parts = (
            record.position_m, record.velocity_m_per_s, record.orientation, record.rate_rad_per_s,
        )  # fmt: skip
        rows = np.concatenate(parts, axis=1)
        super().__init__(record, _track_of(record), rows, _poses_at, start_s, loop)
        self.source, self._arm = f"ship's poses of {record.source}", arm_m

    def between(self, from_ns: int, to_ns: int) -> list[HeaveSample]:
        """Return samples with from_ns <= stamp_ns < to_ns, in order; each stamp once."""
        found = []
        for stamp_ns, row in self.rows(from_ns, to_ns):
            place, velocity, turn, rate = row[:3], row[3:6], row[6:10], row[10:13]
            pose = ShipPose(stamp_ns, *map(tuple, (place, velocity, turn, rate)))
            found.append(sample_of(pose, self._arm, None if np.isnan(row[13]) else row[13]))
        return found


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
