"""Reads the heave of a ship out of a bag and sorts out the samples that cannot be used.

Nothing is mended in silence: what was skipped or derived is counted and told in `note`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rosbags.serde import SerdeError

from rope_twin.errors import BagError, did_you_mean, phrase
from rope_twin.messages.cdr import deserialise
from rope_twin.recording.bag_reader import BagReader, TopicContent
from rope_twin.topics import BY_NAME

Vector = NDArray[np.float64]
Stamps = NDArray[np.int64]

_HEAVE, _ELEVATION = BY_NAME["ship/heave"], BY_NAME["sea/elevation"]
_TOLERATED_SHARE = 0.05  # of samples that cannot be used
GAP_PERIODS = 3.0  # an interval this many times the usual one is a gap
_LONGEST_GAP_S = 60.0  # beyond it, it is the clock that jumped, or two recordings


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
        """The usual interval between samples (the median)."""
        return int(np.median(np.diff(self.time_ns)))


def read_heave(path: Path, topic: str | None = None) -> HeaveRecord:
    """The heave in a bag: `topic`, or ship/heave, or its only Odometry topic.

    Stamps are those of the headers, where they are set, else the times of recording.

    Raises:
        BagError: not a bag, no such topic, a wrong type, or too little that can be used.
    """
    with BagReader(path) as bag:
        name = _choose_topic(bag, topic)
        rows = _read_rows(bag, name)
        elevation = _read_elevation(bag)
        source = bag.custom_data.get("source", "")
    stamp_ns, values = rows.usable()
    notes = [*rows.notes]
    velocity, note = _check_velocity(rows.where, stamp_ns, values)
    notes.append(note)
    elevation_ns, elevation_m = elevation.usable() if elevation else (stamp_ns[:0], values[:0])
    if elevation:
        notes += elevation.notes
    return HeaveRecord(
        time_ns=stamp_ns - stamp_ns[0],
        position_m=values[:, 0],
        velocity_m_per_s=velocity,
        elevation_time_ns=elevation_ns - stamp_ns[0],
        elevation_m=elevation_m[:, 0],
        source=source or f"bag {path.name}, topic {name}",
        note=" ".join(filter(None, notes)),
        skipped=rows.skipped,
    )


def _choose_topic(bag: BagReader, topic: str | None) -> str:
    where = f"bag {bag.path}"
    topics: Mapping[str, TopicContent] = bag.topics
    heaves = [name for name, content in topics.items() if content.type_name == _HEAVE.type_name]
    if topic is not None:
        name = topic if topic in topics else f"/{topic}"
        if name not in topics:
            right = did_you_mean(topic, topics) if topics else "the bag is empty"
            raise BagError(phrase(where, f"it has no topic '{topic}'", right))
        if name not in heaves:
            what = f"topic {name} is a {topics[name].type_name}"
            raise BagError(phrase(where, what, f"heave must be a {_HEAVE.type_name}"))
        return name
    usual = [name for name in heaves if f"/{name}".endswith(f"/{_HEAVE.name}")]
    if len(usual) == 1:
        return usual[0]
    if len(heaves) == 1:
        return heaves[0]
    if heaves:
        what = f"several topics could be the heave: {', '.join(sorted(heaves))}"
        raise BagError(phrase(where, what, "name one of them"))
    held = ", ".join(f"{name} ({content.type_name})" for name, content in sorted(topics.items()))
    what = f"no topic is a {_HEAVE.type_name}"
    raise BagError(phrase(where, what, f"it holds {held or 'nothing'}"))


def _read_elevation(bag: BagReader) -> _Rows | None:
    names = [
        name
        for name, content in bag.topics.items()
        if content.type_name == _ELEVATION.type_name
        and f"/{name}".endswith(f"/{_ELEVATION.name}")
        and content.messages > 1
    ]
    return _read_rows(bag, names[0]) if len(names) == 1 else None


def _read_rows(bag: BagReader, name: str) -> _Rows:
    content = bag.topics[name]
    rows = _Rows(f"bag {bag.path}, topic {name}", content)
    for log_ns, data in bag.messages(name):
        rows.add(log_ns, data)
    return rows


class _Rows:
    """Samples of one topic as they come, and the judgement on them."""

    def __init__(self, where: str, content: TopicContent) -> None:
        self.where = where
        self.notes: list[str] = []
        self.skipped = 0
        self._content = content
        self._has_rate = content.type_name == _HEAVE.type_name
        self._undecodable = 0
        self._stamps: list[tuple[int, int]] = []  # of the header, of the log
        self._values: list[tuple[float, ...]] = []

    def add(self, log_ns: int, data: bytes) -> None:
        try:
            message: Any = deserialise(self._content.type_name, data)
        except SerdeError:
            self._undecodable += 1
            return
        stamp = message.header.stamp
        self._stamps.append((stamp.sec * 1_000_000_000 + stamp.nanosec, log_ns))
        if self._has_rate:
            self._values.append((message.pose.pose.position.z, message.twist.twist.linear.z))
        else:
            self._values.append((message.point.z,))

    def usable(self) -> tuple[Stamps, NDArray[np.float64]]:
        """Stamps (n,), rising, and values (n, 1 or 2), finite. Raises BagError if few are left."""
        total = len(self._stamps) + self._undecodable
        if total == 0:
            raise BagError(phrase(self.where, "it holds no message", "heave needs at least 2"))
        pairs = np.array(self._stamps, dtype=np.int64).reshape(-1, 2)
        stamp_ns = pairs[:, 0]
        if 2 * np.count_nonzero(stamp_ns) < len(pairs):
            stamp_ns = pairs[:, 1]
            self.notes.append(f"{self.where}: headers without a stamp, times are those of the log.")
        width = 2 if self._has_rate else 1
        values = np.array(self._values, dtype=np.float64).reshape(len(pairs), width)
        keep, faults = _judge(stamp_ns, values)
        if self._undecodable:
            faults["that do not decode"] = self._undecodable
        self.skipped = sum(faults.values())
        told = ", ".join(f"{count} {fault}" for fault, count in faults.items() if count)
        if keep.sum() < 2 or self.skipped > _TOLERATED_SHARE * total:
            what = f"{self.skipped} of {total} samples cannot be used ({told or 'too few'})"
            right = f"right are 2 or more, at most {_TOLERATED_SHARE:.0%} bad"
            raise BagError(phrase(self.where, what, right))
        if self.skipped:
            self.notes.append(f"{self.where}: skipped {self.skipped} of {total} samples ({told}).")
        promised = self._content.messages
        if total < promised:
            self.notes.append(f"{self.where}: of {promised} messages promised {total} are there.")
        self.notes.append(self._tell_gaps(stamp_ns[keep]))
        return stamp_ns[keep], values[keep]

    def _tell_gaps(self, stamp_ns: Stamps) -> str:
        steps = np.diff(stamp_ns)
        gaps = steps > GAP_PERIODS * np.median(steps)
        if not np.any(gaps):
            return ""
        longest = int(np.argmax(steps))
        at_s = float(stamp_ns[longest] - stamp_ns[0]) * 1e-9
        told = f"the longest {steps[longest] * 1e-9:.4g} s at {at_s:.3f} s"
        if steps[longest] > _LONGEST_GAP_S * 1e9:
            right = f"right is one recording without a gap above {_LONGEST_GAP_S:g} s"
            raise BagError(phrase(self.where, f"gaps in time, {told}", right))
        return f"{self.where}: gaps in time: {int(gaps.sum())}, {told}."


def _judge(
    stamp_ns: Stamps, values: NDArray[np.float64]
) -> tuple[NDArray[np.bool_], dict[str, int]]:
    """Which samples are finite and later than all before; the faults of the others, counted."""
    finite = np.all(np.isfinite(values), axis=1)
    stamped = stamp_ns != 0
    keep = finite & stamped
    latest = np.iinfo(np.int64).min
    repeated = backward = 0
    for index in np.flatnonzero(keep):
        stamp = int(stamp_ns[index])
        if stamp > latest:
            latest = stamp
            continue
        keep[index] = False
        repeated += stamp == latest
        backward += stamp < latest
    faults = {
        "not finite": int((~finite).sum()),
        "without a stamp": int((finite & ~stamped).sum()),
        "with a repeated stamp": repeated,
        "with a stamp that goes back": backward,
    }
    return keep, faults


def _check_velocity(
    where: str, stamp_ns: Stamps, values: NDArray[np.float64]
) -> tuple[Vector, str]:
    """The heave rate (n,): as recorded, or derived where the bag has none; and the note on it.

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
