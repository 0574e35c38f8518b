"""Reader of ship heave from a bag, with a check of its rate.

No fault is corrected silently: skipped and derived values are counted and reported in `note`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from rope_twin.errors import BagError, phrase
from rope_twin.recording.bag_reader import BagReader
from rope_twin.recording.stamped_rows import (
    Faults,
    StampedRows,
    Stamps,
    Table,
    Vector,
    choose_topic,
)
from rope_twin.topics import BY_NAME
from rope_twin.twin.motion.heave_track import HEAVE_LIMIT_M, VELOCITY_LIMIT_M_PER_S

_HEAVE, _ELEVATION = BY_NAME["ship/heave"], BY_NAME["sea/elevation"]
_POSE = BY_NAME["ship/odometry"]
_HEAVE_FIELDS = ("pose.pose.position.z", "twist.twist.linear.z")
LARGEST_MEAN_M = 1.0  # of heave about the rest
LONGEST_PERIOD_S = 0.2  # the twin knows samples so long ahead, as it would live


@dataclass(frozen=True)
class HeaveRecord:
    """Heave over time as it was measured or made; times count from its first sample."""

    time_ns: Stamps  # (n,) rising, the first is 0
    position_m: Vector  # (n,) up
    velocity_m_per_s: Vector  # (n,)
    elevation_time_ns: Stamps = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    elevation_m: Vector = field(default_factory=lambda: np.empty(0))
    source: str = ""
    note: str = ""  # sentences on what was skipped or derived; '' if nothing
    skipped: int = 0

    @property
    def period_ns(self) -> int:
        """Return the usual interval between samples (the median) [ns]."""
        return int(np.median(np.diff(self.time_ns)))


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
        position_m=values[:, 0],
        velocity_m_per_s=velocity,
        elevation_time_ns=elevation_ns - stamp_ns[0],
        elevation_m=elevation_m,
        source=source or f"bag {path.name}, topic {name}",
        note=" ".join(filter(None, notes)),
        skipped=rows.skipped,
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
