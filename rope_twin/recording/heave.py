"""Heave of the ship: read from a bag, replayed, regular, and written as a sea-state bag."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rope_twin.errors import BagError, InputError, phrase
from rope_twin.messages import encode_elevation, encode_heave
from rope_twin.recording.bag import BagReader, find_bag
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
from rope_twin.topics import BY_NAME
from rope_twin.twin.motion.heave_track import HEAVE_LIMIT_M, VELOCITY_LIMIT_M_PER_S
from rope_twin.twin.motion.ship_motion import SeaRecord, ShipPose, Vector3, hang_off_motion

_HEAVE, _ELEVATION = BY_NAME["ship/heave"], BY_NAME["sea/elevation"]
_POSE = BY_NAME["ship/odometry"]
_HEAVE_FIELDS = ("pose.pose.position.z", "twist.twist.linear.z")
LARGEST_MEAN_M = 1.0  # of heave about the rest
LONGEST_PERIOD_S = 0.2  # the twin knows samples so long ahead, as it would live


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
        elevation_ns, elevation_m, told = read_elevation(bag)
        source = bag.custom_data.get("source", "")
    velocity, note = _check_velocity(rows.where, stamp_ns, values)
    notes = [*rows.notes, note, *_odd(rows.where, stamp_ns, values[:, 0]), *told]
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
    counts = {f"/{name.lstrip('/')}": own.messages for name, own in bag.topics.items()}
    heard = [name for name, count in counts.items() if count and name.endswith(f"/{_HEAVE.name}")]
    posed = [name for name, count in counts.items() if count and name.endswith(f"/{_POSE.name}")]
    if posed and not heard:
        what = f"it has the ship's pose ({posed[0]}) and no heave"
        right = "replay it by --poses, or by `sea_state: {poses: {bag: ...}}`"
        raise BagError(phrase(f"bag {bag.path}", what, right))


def read_elevation(bag: BagReader) -> tuple[Stamps, Vector, list[str]]:
    """Return stamps (m,) and surface (m,) of the bag's sea/elevation, empty if none, and notes.

    Raises:
        BagError: most of it cannot be used.
    """
    names = [
        name
        for name, content in bag.topics.items()
        if content.type_name == _ELEVATION.type_name
        and f"/{name}".endswith(f"/{_ELEVATION.name}")
        and content.messages > 1
    ]
    if len(names) != 1:
        return np.empty(0, np.int64), np.empty(0), []
    rows = StampedRows(bag, names[0], "heave", ("point.z",))
    stamp_ns, values = rows.usable()
    return stamp_ns, values[:, 0], rows.notes


def _impossible(values: Table) -> Faults:
    """Return which samples a running twin would reject, each by itself."""
    most = np.array([HEAVE_LIMIT_M, VELOCITY_LIMIT_M_PER_S])
    fault = (
        f"beyond the ±{most[0]:g} m about its rest and ±{most[1]:g} m/s that a ship stays within"
    )
    return {fault: np.asarray((np.abs(values) > most).any(axis=1))}


def _odd(where: str, stamp_ns: Stamps, position: Vector) -> Iterator[str]:
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
    if agreement < 0.0:
        raise BagError(
            phrase(
                where,
                f"twist.linear.z runs against pose.position.z (correlation {agreement:.2f})",
                "both count up as positive",
            )
        )
    if agreement < 0.5:
        return velocity, f"{where}: rate and position agree poorly (correlation {agreement:.2f})."
    return velocity, ""


@dataclass(frozen=True)
class HeaveSample:
    """Heave sample in simulation time."""

    stamp_ns: int  # since the twin's start
    position_m: float  # up, above the rest position
    velocity_m_per_s: float
    elevation_m: float | None  # water surface at the ship, where the record has it
    pose: ShipPose | None = None  # of the ship, where that is what moves the hang-off
    aside: tuple[float, float, float, float] | None = None  # then: x, y [m], their rates [m/s]


def sample_of(pose: ShipPose, arm_m: Vector3, elevation_m: float | None) -> HeaveSample:
    """Return the sample of a pose: the hang-off motion and the pose itself."""
    place, velocity = hang_off_motion(pose, arm_m)
    aside = (*place[:2], *velocity[:2])
    return HeaveSample(pose.stamp_ns, place[2], velocity[2], elevation_m, pose, aside)


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
        super().__init__(record, track, rows, _blended, start_s, loop)

    def between(self, from_ns: int, to_ns: int) -> list[HeaveSample]:
        """Return samples with from_ns <= stamp_ns < to_ns, in order; each stamp once."""
        return [
            HeaveSample(stamp_ns, z, v, None if np.isnan(eta) else eta)
            for stamp_ns, (z, v, eta) in self.rows(from_ns, to_ns)
        ]


def _blended(splice: Splice) -> Table:
    return np.concatenate([splice.value, splice.rate], axis=1)


def open_heave(
    bag: str | Path, topic: str | None = None, start_s: float = 0.0, loop: bool = True
) -> HeaveReplay:
    """Return the replay of a bag: a name in bags/, or the path of a directory or .mcap file.

    Args:
        topic: the Odometry topic; by default ship/heave or the only one.
        start_s: position of t = 0 in the bag.
        loop: continue from the beginning at the end; otherwise the samples end.

    Raises:
        BagError: the bag, the topic or the start is invalid; one sentence.
    """
    return HeaveReplay(read_heave(find_bag(bag), topic), start_s, loop)


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
        what = f"it is {elevation_rate_hz:g} Hz"
        right = f"right is {sea.rate_hz:g} Hz divided by a whole number"
        raise InputError(phrase("elevation rate", what, right))
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
            bag.write(
                "ship/heave",
                stamp_ns,
                encode_heave(stamp_ns, float(heave[k]), float(velocity[k]), recorded=True),
            )
            if k % every == 0:
                data = encode_elevation(stamp_ns, float(elevation[k]), recorded=True)
                bag.write("sea/elevation", stamp_ns, data)


def _round(values: Vector) -> Vector:
    return np.round(values / RESOLUTION) * RESOLUTION + 0.0  # no negative zeros
