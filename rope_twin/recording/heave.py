"""Heave and poses of the ship: read from a bag, replayed; heave regular or as a sea-state bag.

Of ship poses valid samples are selected and their rates checked: nav_msgs/Odometry has pose and
twist (in body axes, REP 103 and 105), geometry_msgs/PoseStamped only the pose. No fault is
corrected silently: skipped and derived values are counted and reported in `note`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from rope_twin.errors import BagError, InputError, phrase
from rope_twin.messages import encode_elevation, encode_heave
from rope_twin.recording.bag import BagReader, FileStates, files_of, find_bag
from rope_twin.recording.bag_writer import BagWriter
from rope_twin.recording.track import (
    Faults,
    MotionRecord,
    RecordReplay,
    Splice,
    StampedRows,
    Stamps,
    Table,
    Track,
    Vector,
    choose_topic,
)
from rope_twin.scene.schema import RecordedPoses, Scene
from rope_twin.topics import BY_NAME, is_topic
from rope_twin.twin.motion.hang_off import lever_arm
from rope_twin.twin.motion.heave_track import HEAVE_LIMIT_M, VELOCITY_LIMIT_M_PER_S
from rope_twin.twin.motion.ship_motion import (
    MAX_TILT_DEG,
    UNIT_LENGTH_TOL,
    SeaRecord,
    ShipPose,
    Vector3,
    hang_off_motion,
)
from rope_twin.twin.validity import HeaveSample

_HEAVE, _ELEVATION = BY_NAME["ship/heave"], BY_NAME["sea/elevation"]
_POSE = BY_NAME["ship/odometry"]
_HEAVE_FIELDS = ("pose.pose.position.z", "twist.twist.linear.z")
LARGEST_MEAN_M = 1.0  # of heave about the rest
LONGEST_PERIOD_S = 0.2  # the twin knows samples so long ahead, as it would live
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
_NEAR_M, _NEAR_DEG = 20.0, 20.0  # farther from rest at the start is reported


@dataclass(frozen=True, kw_only=True)
class HeaveRecord(MotionRecord):
    """Heave over time."""

    position_m: Vector  # (n,) up
    velocity_m_per_s: Vector  # (n,)


def read_heave(path: Path, topic: str | None = None) -> HeaveRecord:
    """Return the heave in a bag: of `topic`, or ship/heave, or its only Odometry topic.

    Stamps are those of the headers, where they are set, else the times of recording.

    Raises:
        BagError: not a bag, no such topic, a wrong type, or too little that can be used.
    """
    with BagReader(path) as bag:
        if topic is None:
            _refuse_poses(bag)
        name = choose_topic(bag, topic, _HEAVE.name, (_HEAVE.type_name,))
        rows = StampedRows(bag, name, "heave", _HEAVE_FIELDS)
        stamp_ns, values = rows.usable(_impossible)
        elevation_ns, elevation_m, more = read_elevation(bag)
        source = bag.custom_data.get("source", "")
    velocity, note = _check_velocity(rows.where, stamp_ns, values)
    notes = [*rows.notes, note, *_implausible(rows.where, stamp_ns, values[:, 0]), *more]
    return HeaveRecord(
        time_ns=stamp_ns - stamp_ns[0],
        began_ns=int(stamp_ns[0]),
        position_m=values[:, 0],
        velocity_m_per_s=velocity,
        elevation_time_ns=elevation_ns - stamp_ns[0],
        elevation_m=elevation_m,
        source=source or f"bag {path.name}, topic {name}",
        note=" ".join(filter(None, notes)),
    )


def _refuse_poses(bag: BagReader) -> None:
    """Reject a pose record as heave: its reference point is not the hang-off.

    Raises:
        BagError: the bag has poses, and no heave of the usual name.
    """
    counts = {f"/{name.lstrip('/')}": topic.messages for name, topic in bag.topics.items()}
    heave_topics = [name for name, count in counts.items() if count and is_topic(name, _HEAVE.name)]
    posed = [name for name, count in counts.items() if count and is_topic(name, _POSE.name)]
    if posed and not heave_topics:
        problem = f"it has the ship's pose ({posed[0]}) and no heave"
        remedy = "replay it by --poses, or by `sea_state: {poses: {bag: ...}}`"
        raise BagError(f"bag {bag.path}", problem, remedy)


def read_elevation(bag: BagReader) -> tuple[Stamps, Vector, list[str]]:
    """Return stamps (m,) and surface (m,) of the bag's sea/elevation, empty if none, and notes.

    Raises:
        BagError: most of it cannot be used.
    """
    names = [name for name, topic in bag.topics.items() if is_topic(name, _ELEVATION.name)
             and topic.type_name == _ELEVATION.type_name and topic.messages > 1]  # fmt: skip
    if len(names) != 1:
        return np.empty(0, np.int64), np.empty(0), []
    rows = StampedRows(bag, names[0], "heave", ("point.z",))
    stamp_ns, values = rows.usable()
    return stamp_ns, values[:, 0], rows.notes


def _impossible(values: Table) -> Faults:
    """Return which samples a running twin would reject, each by itself."""
    limits = np.array([HEAVE_LIMIT_M, VELOCITY_LIMIT_M_PER_S])
    fault = (
        f"beyond the ±{limits[0]:g} m about its rest and ±{limits[1]:g} m/s "
        "that a ship stays within"
    )
    return {fault: np.asarray((np.abs(values) > limits).any(axis=1))}


def _implausible(where: str, stamp_ns: Stamps, position: Vector) -> Iterator[str]:
    """Return notes on values that can be replayed but are implausible."""
    mean, spread = float(position.mean()), float(position.std())
    if abs(mean) > max(LARGEST_MEAN_M, spread):
        yield (
            f"{where}: its mean is {mean:.2f} m; heave counts from the rest, and the hang-off lies "
            "that much off it."
        )
    usual_s = float(np.median(np.diff(stamp_ns))) * 1e-9
    if usual_s > LONGEST_PERIOD_S:
        yield (
            f"{where}: a sample every {usual_s:.3g} s, and the motion between them is assumed; "
            f"give one every {LONGEST_PERIOD_S:g} s or more often."
        )


def _check_velocity(where: str, stamp_ns: Stamps, values: Table) -> tuple[Vector, str]:
    """Return the heave rate (n,), recorded or derived if the bag has none, and a note on it.

    Raises:
        BagError: it runs against the position.
    """
    position, velocity = values[:, 0], values[:, 1]
    time_s = (stamp_ns - stamp_ns[0]) * 1e-9
    if len(position) < 3 or np.ptp(position) == 0.0:
        return velocity, ""
    slope = np.gradient(position, time_s)
    if not np.any(velocity):
        return slope, f"{where}: twist.linear.z is zero throughout, the rate is derived."
    agreement = float(slope @ velocity / np.sqrt((slope @ slope) * (velocity @ velocity)))
    usual_s = float(np.median(np.diff(time_s)))
    if agreement < 0.0 and usual_s > LONGEST_PERIOD_S:
        problem = f"a sample every {usual_s:.3g} s, too few to compare its rate with its position"
        raise BagError(where, problem, f"give one every {LONGEST_PERIOD_S:g} s or more often")
    if agreement < 0.0:
        problem = f"twist.linear.z runs against pose.position.z (correlation {agreement:.2f})"
        raise BagError(where, problem, "both count up as positive")
    if agreement < 0.5:
        return velocity, f"{where}: rate and position agree poorly (correlation {agreement:.2f})."
    return velocity, ""


def sample_of(pose: ShipPose, arm_m: Vector3, elevation_m: float | None) -> HeaveSample:
    """Return the sample of a pose: the hang-off motion and the pose itself."""
    position, velocity = hang_off_motion(pose, arm_m)
    horizontal = (*position[:2], *velocity[:2])
    return HeaveSample(pose.stamp_ns, position[2], velocity[2], elevation_m, pose, horizontal)


class HeaveReplay(RecordReplay):
    """Samples of recorded heave by simulation time."""

    topic = "ship/heave"

    def __init__(self, record: HeaveRecord, start_s: float = 0.0, loop: bool = True) -> None:
        """Prepare the replay.

        Raises:
            BagError: `start_s` is not inside the record.
        """
        heave, rate = record.position_m[:, None], record.velocity_m_per_s[:, None]
        track = Track(record.time_ns, heave, rate, record.period_ns)
        rows = np.concatenate([heave, rate], axis=1)

        def blended(splice: Splice) -> Table:
            return np.concatenate([splice.value, splice.rate], axis=1)

        super().__init__(record, track, rows, blended, start_s, loop)

    def between(self, from_ns: int, to_ns: int) -> list[HeaveSample]:
        """Return samples with from_ns <= stamp_ns < to_ns, in order; each stamp once."""
        return [
            HeaveSample(stamp_ns, z, v, None if np.isnan(eta) else eta)
            for stamp_ns, (z, v, eta) in self.rows(from_ns, to_ns)
        ]


def open_heave(
    bag: str | Path, topic: str | None = None, start_s: float = 0.0, loop: bool = True
) -> HeaveReplay:
    """Return the replay of a bag: a name in bags/, or the path of a directory or .mcap file.

    topic: by default ship/heave or the only one of Odometry; start_s: position of t = 0 in the bag.

    Raises:
        BagError: the bag, the topic or the start is invalid; one sentence.
    """
    path = find_bag(bag)
    return HeaveReplay(_heave_of(path, topic, files_of(path)), start_s, loop)


@lru_cache(maxsize=4)
def _heave_of(path: Path, topic: str | None, files: FileStates) -> HeaveRecord:
    """Return `read_heave`, once for unchanged files: a run opens its sea up to three times."""
    return read_heave(path, topic)


def replay_sea(sea: SeaRecord, start_s: float = 0.0, loop: bool = True) -> HeaveReplay:
    """Replay of a synthesised sea, which is periodic and so loops without a splice."""
    time_ns = np.round(np.arange(len(sea.heave_m)) * 1e9 / sea.rate_hz).astype(np.int64)
    record = HeaveRecord(
        time_ns=time_ns,
        position_m=sea.heave_m,
        velocity_m_per_s=sea.heave_velocity_m_per_s,
        elevation_time_ns=time_ns,
        elevation_m=sea.elevation_m,
        source=sea.source,
    )
    return HeaveReplay(record, start_s, loop)


START_NS = 946_684_800 * 10**9  # 2000-01-01, a date that nobody takes for the measurement's
RESOLUTION = 2.0**-13  # 0.12 mm and 0.12 mm/s: finer than any motion sensor, and it compresses


def write_sea_bag(
    directory: Path,
    sea: SeaRecord,
    elevation_rate_hz: float,
    notes: Mapping[str, str] | None = None,
) -> None:
    """Write heave at the record's rate and elevation at a lower one; stamps are log times.

    Values are rounded to RESOLUTION, as a sensor would.

    Raises:
        InputError: the elevation's rate does not divide the heave's.
        BagError: the bag cannot be written.
    """
    ratio = sea.rate_hz / elevation_rate_hz if elevation_rate_hz > 0.0 else 0.0
    if ratio < 1.0 or abs(ratio - round(ratio)) > 1e-9:
        remedy = f"right is {sea.rate_hz:g} Hz divided by a whole number"
        raise InputError("elevation rate", f"it is {elevation_rate_hz:g} Hz", remedy)
    every = round(ratio)
    heave, velocity = _round(sea.heave_m), _round(sea.heave_velocity_m_per_s)
    elevation = _round(sea.elevation_m)
    metadata = {
        "source": sea.source,
        "resolution": f"values rounded to {RESOLUTION:g} m and m/s",
        **(notes or {}),
    }
    topics = (BY_NAME["ship/heave"], BY_NAME["sea/elevation"])
    with BagWriter(directory, topics, metadata) as bag:
        for k in range(len(heave)):
            stamp_ns = START_NS + round(k * 1e9 / sea.rate_hz)
            data = encode_heave(stamp_ns, float(heave[k]), float(velocity[k]), recorded=True)
            bag.write("ship/heave", stamp_ns, data)
            if k % every == 0:
                data = encode_elevation(stamp_ns, float(elevation[k]), recorded=True)
                bag.write("sea/elevation", stamp_ns, data)


def _round(values: Vector) -> Vector:
    return np.round(values / RESOLUTION) * RESOLUTION + 0.0  # no negative zeros


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
        if not recorded.topic and is_topic(name, _HEAVE.name):
            problem = f"it has heave of the hang-off ({name}) and no pose of the ship"
            remedy = "replay it by --bag, or by `sea_state: {bag: ...}`"
            raise BagError(f"bag {path}", problem, remedy)
        twisted = bag.topics[name].type_name == _ODOMETRY
        rows = StampedRows(bag, name, "odometry", _ODOMETRY_FIELDS if twisted else _POSE_FIELDS)
        stamp_ns, values = rows.usable(_judge)
        elevation_ns, elevation_m, more = read_elevation(bag)
        source = bag.custom_data.get("source", "")
    values[:, _TURN] = _without_jumps(values[:, _TURN])
    time_ns = stamp_ns - stamp_ns[0]
    notes = [*rows.notes, *more]
    values, derived = _with_rates(rows.where, time_ns, values)
    notes += derived
    position, orientation, velocity, rate = _from_rest(values, recorded)
    notes.append(_far_from_rest(rows.where, position, orientation))
    return PoseRecord(
        time_ns=time_ns,
        began_ns=int(stamp_ns[0]),
        position_m=position,
        orientation=orientation,
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
    vector_part = w * rate + np.cross(axis, rate)
    return 0.5 * np.concatenate([vector_part, -(axis * rate).sum(axis=1, keepdims=True)], axis=1)


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
            "with an orientation that is no unit quaternion": np.abs(size - 1.0) > UNIT_LENGTH_TOL,
            f"that heel by more than {MAX_TILT_DEG:g}°": upward < np.cos(np.radians(MAX_TILT_DEG)),
        }


def _without_jumps(orientation: Table) -> Table:
    """Return quaternions with continuous signs: q and -q are the same rotation."""
    opposite = (orientation[1:] * orientation[:-1]).sum(axis=1) < 0.0
    sign = np.append(1.0, np.where(np.cumsum(opposite) % 2 == 1, -1.0, 1.0))
    return np.asarray(orientation * sign[:, None])


def _with_rates(where: str, time_ns: Stamps, values: Table) -> tuple[Table, list[str]]:
    """Return values (n, 13) with linear and angular velocity, recorded or derived (with a note).

    Raises:
        BagError: they contradict the pose.
    """
    time_s, orientation = time_ns * 1e-9, values[:, _TURN]
    if len(time_s) < 3:
        slope = np.diff(values[:, :7], axis=0) / np.diff(time_s)[:, None]
        change = np.concatenate([slope, slope])
    else:
        change = np.gradient(values[:, :7], time_s, axis=0)
    derivatives = (
        turned_by(orientation, change[:, _PLACE], back=True),
        turn_rates(orientation, change[:, _TURN]),
    )
    if values.shape[1] == 7:
        note = f"{where}: it has no twist, velocity and rate of turn are derived."
        return np.concatenate([values, *derivatives], axis=1), [note]
    notes = []
    for part, derived, name in zip((_VELOCITY, _RATE), derivatives, ("linear", "angular"),
                                   strict=True):  # fmt: skip
        recorded = values[:, part]
        if not recorded.any() and derived.any():
            values[:, part] = derived
            notes.append(f"{where}: twist.{name} is zero throughout, it is derived.")
        elif np.abs(derived).max() > 1e-9:
            notes.append(_agreement(where, name, recorded, derived))
    return values, notes


def _agreement(where: str, name: str, recorded: Table, derived: Table) -> str:
    """Return a note on the agreement of a recorded twist with the derivative of the pose, or "".

    Raises:
        BagError: the twist contradicts the pose.
    """
    close = float((recorded * derived).sum() / np.sqrt((recorded**2).sum() * (derived**2).sum()))
    if close < 0.0:
        problem = f"twist.{name} runs against the pose (correlation {close:.2f})"
        remedy = "it must be the pose's rate of change in the ship's axes, x to the bow, z up"
        raise BagError(where, problem, remedy)
    if close < 0.5:
        remark = f"twist.{name} and pose agree poorly (correlation {close:.2f})"
        return f"{where}: {remark}; a twist is in the ship's turned axes."
    return ""


def _from_rest(values: Table, recorded: RecordedPoses) -> tuple[Table, Table, Table, Table]:
    """Return position, orientation and velocities relative to the rest pose that the scene gives.

    With the attitude at rest Q, the turn from there is R·Q⁻¹ and the axes turned by it see the
    twist as Q·v and Q·ω.
    """
    position, orientation = values[:, _PLACE] - np.array(recorded.rest_m), values[:, _TURN]
    velocity, rate = values[:, _VELOCITY], values[:, _RATE]
    if recorded.heading_deg == 0.0:
        return position, orientation, velocity, rate
    half = 0.5 * np.radians(recorded.heading_deg)
    s, c = np.sin(half), np.cos(half)
    x, y, z, w = orientation.T
    from_rest = np.stack([x * c - y * s, y * c + x * s, z * c - w * s, w * c + z * s], axis=1)
    at_rest = np.tile([0.0, 0.0, s, c], (len(orientation), 1))
    return position, from_rest, turned_by(at_rest, velocity), turned_by(at_rest, rate)


def _far_from_rest(where: str, position: Table, orientation: Table) -> str:
    """Return a note if the record begins far from rest, perhaps because none was given; or "".

    Raises:
        BagError: it is higher above or below the water than a ship can be.
    """
    height = float(position[:, 2].mean())
    remedy = "give where it rests in the record: `rest_m`, `heading_deg` of `poses`"
    if abs(height) > HEAVE_LIMIT_M:
        raise BagError(where, f"the ship lies {height:.1f} m above its rest", remedy)
    x, y, z, w = orientation[0]
    off_deg = abs(np.degrees(np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))))
    off_m = float(np.hypot(*position[0, :2]))
    if off_m <= _NEAR_M and off_deg <= _NEAR_DEG:
        return ""
    return phrase(where, f"it begins {off_m:.0f} m and {off_deg:.0f}° from rest", remedy)


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
        samples = []
        for stamp_ns, row in self.rows(from_ns, to_ns):
            position, velocity, orientation, rate = row[:3], row[3:6], row[6:10], row[10:13]
            pose = ShipPose(stamp_ns, *map(tuple, (position, velocity, orientation, rate)))
            samples.append(sample_of(pose, self._arm, None if np.isnan(row[13]) else row[13]))
        return samples


def open_poses(
    scene: Scene, recorded: RecordedPoses, start_s: float = 0.0, loop: bool = True
) -> PoseReplay:
    """Replay of a bag's poses for the hang-off of a scene.

    Raises:
        BagError: one sentence on what is wrong with the bag, the topic or the start.
    """
    path = find_bag(recorded.bag)
    return PoseReplay(_poses_of(path, recorded, files_of(path)), lever_arm(scene), start_s, loop)


@lru_cache(maxsize=4)
def _poses_of(path: Path, recorded: RecordedPoses, files: FileStates) -> PoseRecord:
    """Return `read_poses`, once for unchanged files."""
    return read_poses(path, recorded)


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
    parallel = (turn * splice.rate[:, 3:]).sum(axis=1, keepdims=True)
    change = (splice.rate[:, 3:] - turn * parallel) / size
    velocity = turned_by(turn, splice.rate[:, :3], back=True)
    return np.concatenate([splice.value[:, :3], velocity, turn, turn_rates(turn, change)], axis=1)
