"""Replay of recorded or synthesised heave in simulation time, once or as a seamless loop."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rope_twin.recording.bag_reader import find_bag
from rope_twin.recording.heave_record import HeaveRecord, read_heave
from rope_twin.recording.looped_replay import (
    Passes,
    Splice,
    Track,
    hermite,
    plan_passes,
    splice_note,
)
from rope_twin.recording.stamped_rows import GAP_PERIODS, Stamps, Table, Vector
from rope_twin.twin.motion.irregular_sea import SeaRecord
from rope_twin.twin.motion.ship_pose import ShipPose

SAMPLE_PERIOD_NS = 50_000_000  # 20 Hz, the rate of ship/heave


@dataclass(frozen=True)
class HeaveSample:
    """Heave sample in simulation time."""

    stamp_ns: int  # since the twin's start
    position_m: float  # up, above the rest position
    velocity_m_per_s: float
    elevation_m: float | None  # water surface at the ship, where the record has it
    pose: ShipPose | None = None  # of the ship, where that is what moves the hang-off
    aside: tuple[float, float, float, float] | None = None  # then: x, y [m], their rates [m/s]


class HeaveReplay:
    """Samples of a record by simulation time; t = 0 is `start_s` into the record.

    In a loop the record repeats; `note` reports if its end does not join its beginning.
    """

    def __init__(self, record: HeaveRecord, start_s: float = 0.0, loop: bool = True) -> None:
        """Prepare the replay.

        Raises:
            BagError: `start_s` is not inside the record.
        """
        self.source = record.source
        self.skipped = record.skipped
        rates = record.position_m[:, None], record.velocity_m_per_s[:, None]
        track = Track(record.time_ns, *rates, record.period_ns)
        self.duration_s = float(track.end_ns) * 1e-9
        schedule, splice = plan_passes(track, start_s, loop)
        self.loop_ns = schedule.loop_ns  # of a pass; None: there is one
        repeats_ns = None if splice else self.loop_ns
        recorded = record.elevation_time_ns, record.elevation_m
        surface = elevation_at(recorded, track.time_ns, repeats_ns)
        rows = np.stack([record.position_m, record.velocity_m_per_s, surface], axis=1)
        faded = None
        if splice is not None:
            parts = [splice.value, splice.rate, faded_surface(splice, track.time_ns, surface)]
            faded = np.concatenate(parts, axis=1)
        self._passes = Passes(schedule, rows, faded)
        self.note = " ".join(filter(None, [record.note, splice_note(record.source, track, splice)]))

    def between(self, from_ns: int, to_ns: int) -> list[HeaveSample]:
        """Return samples with from_ns <= stamp_ns < to_ns, in order; each stamp once."""
        return [
            HeaveSample(stamp_ns, z, v, None if np.isnan(eta) else eta)
            for stamp_ns, (z, v, eta) in self._passes.between(from_ns, to_ns)
        ]

    def is_over(self, from_ns: int) -> bool:
        """Return whether there is no sample from a time on."""
        return self._passes.is_over(from_ns, self.duration_s)


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


def elevation_at(recorded: tuple[Stamps, Vector], at_ns: Stamps, loop_ns: int | None) -> Vector:
    """Return the surface (n,) at `at_ns` by cubic Hermite interpolation; NaN outside and in gaps.

    recorded: its times (m,) and values (m,); loop_ns: after which they repeat, if they do.
    """
    time_ns, values = recorded
    if len(time_ns) < 3:
        return np.full(len(at_ns), np.nan)
    if loop_ns is not None:  # what comes around the end is known too
        time_ns = np.concatenate([time_ns[-2:] - loop_ns, time_ns, time_ns[:2] + loop_ns])
        values = np.concatenate([values[-2:], values, values[:2]])
        rising = np.diff(time_ns, prepend=time_ns[0] - 1) > 0
        time_ns, values = time_ns[rising], values[rising]
    slope = np.gradient(values, time_ns * 1e-9)
    result = hermite(at_ns, time_ns, values[:, None], slope[:, None])[0][:, 0]
    left = np.clip(np.searchsorted(time_ns, at_ns, side="right") - 1, 0, len(time_ns) - 2)
    step = time_ns[left + 1] - time_ns[left]
    known = (at_ns >= time_ns[0]) & (at_ns <= time_ns[-1])
    known &= step <= GAP_PERIODS * np.median(np.diff(time_ns))
    return np.where(known, result, np.nan)


def faded_surface(splice: Splice, time_ns: Stamps, elevation_m: Vector) -> Table:
    """Return the surface (h, 1) where the end of a pass is blended into the next."""
    tail = np.interp(splice.tail_ns, time_ns, elevation_m)
    return np.asarray(tail + splice.weight * (elevation_m[: len(tail)] - tail))[:, None]


def stamps_between(from_ns: int, to_ns: int) -> NDArray[np.int64]:
    """Return the multiples of SAMPLE_PERIOD_NS with from_ns <= stamp < to_ns, in order."""
    first, end = -(-from_ns // SAMPLE_PERIOD_NS), -(-to_ns // SAMPLE_PERIOD_NS)
    return np.arange(first, end, dtype=np.int64) * SAMPLE_PERIOD_NS
