"""Replays a recorded (or made) heave in twin time, once or in a loop without a seam."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rope_twin.errors import BagError, phrase
from rope_twin.recording.bag_reader import find_bag
from rope_twin.recording.heave_record import GAP_PERIODS, HeaveRecord, Stamps, Vector, read_heave
from rope_twin.twin.irregular_sea import SeaRecord
from rope_twin.twin.ship_pose import ShipPose

FADE_S = 10.0


@dataclass(frozen=True)
class HeaveSample:
    """One sample in twin time."""

    stamp_ns: int  # since the twin's start
    position_m: float  # up, above the rest position
    velocity_m_per_s: float
    elevation_m: float | None  # water surface at the ship, where the record has it
    pose: ShipPose | None = None  # of the ship, where that is what moves the hang-off
    aside: tuple[float, float, float, float] | None = None  # then: x, y [m], their rates [m/s]


@dataclass(frozen=True)
class _Pass:
    """One way through the record: times within the pass, and values."""

    time_ns: Stamps
    position_m: Vector
    velocity_m_per_s: Vector
    elevation_m: Vector  # nan where unknown


class HeaveReplay:
    """Samples of a record by twin time; t = 0 of the twin is `start_s` into the record.

    In a loop the record repeats. If its end does not join its beginning (a real recording), the
    last 10 s of each pass fade into the first 10 s of the next, so a pass is 10 s shorter; `note`
    says so.
    """

    def __init__(self, record: HeaveRecord, start_s: float = 0.0, loop: bool = True) -> None:
        """Raises BagError if `start_s` is not inside the record."""
        self.source = record.source
        self.skipped = record.skipped
        self.sample_period_ns = record.period_ns
        self.duration_s = float(record.time_ns[-1] + record.period_ns) * 1e-9
        if not (np.isfinite(start_s) and 0.0 <= start_s < self.duration_s):
            what = f"the start at {start_s:g} s is outside of it"
            right = f"right is 0 to less than {self.duration_s:g} s"
            raise BagError(phrase(record.source, what, right))
        self._start_ns = round(start_s * 1e9)
        self.loop_ns: int | None = None  # length of a pass; None without looping
        self.note = record.note
        self._seamless = not loop or _joins(record)
        if loop and self._seamless:
            self.loop_ns = int(record.time_ns[-1]) + record.period_ns
        self._first = self._later = _make_pass(record, self.loop_ns)
        if loop and not self._seamless:
            self._first, self._later, self.loop_ns = _fade(record, self._first)
            faded_s = self.duration_s - self.loop_ns * 1e-9
            self.note = (
                f"{record.note} {record.source}: its end does not join its beginning, the last "
                f"{faded_s:.3g} s of each pass fade into the next."
            ).strip()

    def between(self, from_ns: int, to_ns: int) -> list[HeaveSample]:
        """Samples with from_ns <= stamp_ns < to_ns in twin time, in order; each stamp once."""
        low, high = from_ns + self._start_ns, to_ns + self._start_ns
        if self.loop_ns is None:
            return self._cut(self._first, low, high, 0)
        samples: list[HeaveSample] = []
        earliest = low // self.loop_ns if self._seamless else max(0, low // self.loop_ns)
        for lap in range(earliest, (high - 1) // self.loop_ns + 1):
            content = self._later if lap else self._first
            samples += self._cut(content, low, high, lap * self.loop_ns)
        return samples

    def is_over(self, from_ns: int) -> bool:
        """Whether there is no sample from a twin time on."""
        rest_ns = round(self.duration_s * 1e9)
        return self.loop_ns is None and not self.between(from_ns, from_ns + rest_ns)

    def _cut(self, content: _Pass, low: int, high: int, shift_ns: int) -> list[HeaveSample]:
        first, last = np.searchsorted(content.time_ns, [low - shift_ns, high - shift_ns])
        shift_ns -= self._start_ns
        return [
            HeaveSample(
                int(content.time_ns[i]) + shift_ns,
                float(content.position_m[i]),
                float(content.velocity_m_per_s[i]),
                None if np.isnan(content.elevation_m[i]) else float(content.elevation_m[i]),
            )
            for i in range(first, last)
        ]


def open_heave(
    bag: str | Path, topic: str | None = None, start_s: float = 0.0, loop: bool = True
) -> HeaveReplay:
    """Replay of a bag: a name in bags/, or the path of a rosbag2 directory or .mcap file.

    Args:
        topic: the Odometry topic; by default ship/heave or the only one.
        start_s: where in the bag the twin's t = 0 lies.
        loop: go on from the beginning at the end; otherwise the samples end.

    Raises:
        BagError: one sentence on what is wrong with the bag, the topic or the start.
    """
    return HeaveReplay(read_heave(find_bag(bag), topic), start_s, loop)


def replay_sea(sea: SeaRecord, start_s: float = 0.0, loop: bool = True) -> HeaveReplay:
    """Replay of a synthesised sea, which is periodic and so loops without a seam."""
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


def _joins(record: HeaveRecord) -> bool:
    """Whether the step from the last sample to the first is like the steps inside the record.

    Compared are the change of velocity and what the change of position leaves unexplained by the
    velocities (trapezoidal rule), each with three times the 99th percentile inside.
    """
    usual_s = record.period_ns * 1e-9
    position = np.append(record.position_m, record.position_m[0])
    velocity = np.append(record.velocity_m_per_s, record.velocity_m_per_s[0])
    steps_s = np.append(np.diff(record.time_ns) * 1e-9, usual_s)
    regular = steps_s[:-1] < 1.5 * usual_s
    turn = np.abs(np.diff(velocity))
    leap = np.abs(np.diff(position) - 0.5 * (velocity[1:] + velocity[:-1]) * steps_s)

    def fits(size: Vector, floor: float) -> bool:
        return bool(size[-1] <= max(floor, 3.0 * np.percentile(size[:-1][regular], 99.0)))

    return fits(turn, 1e-3) and fits(leap, 1e-3)


def _make_pass(record: HeaveRecord, loop_ns: int | None) -> _Pass:
    return _Pass(
        record.time_ns,
        record.position_m,
        record.velocity_m_per_s,
        _elevation_at(record, loop_ns),
    )


def _elevation_at(record: HeaveRecord, loop_ns: int | None) -> Vector:
    """Elevation (n,) at the heave samples, by cubic Hermite pieces; nan outside and in gaps."""
    time_ns, values = record.elevation_time_ns, record.elevation_m
    if len(time_ns) < 3:
        return np.full(len(record.time_ns), np.nan)
    if loop_ns is not None:  # what comes around the end is known too
        time_ns = np.concatenate([time_ns[-2:] - loop_ns, time_ns, time_ns[:2] + loop_ns])
        values = np.concatenate([values[-2:], values, values[:2]])
        rising = np.diff(time_ns, prepend=time_ns[0] - 1) > 0
        time_ns, values = time_ns[rising], values[rising]
    slope = np.gradient(values, time_ns * 1e-9)
    at_ns = record.time_ns
    result, _ = _hermite(at_ns, time_ns, values, slope)
    left = np.clip(np.searchsorted(time_ns, at_ns, side="right") - 1, 0, len(time_ns) - 2)
    step = time_ns[left + 1] - time_ns[left]
    known = (at_ns >= time_ns[0]) & (at_ns <= time_ns[-1])
    known &= step <= GAP_PERIODS * np.median(np.diff(time_ns))
    return np.where(known, result, np.nan)


def _hermite(at_ns: Stamps, time_ns: Stamps, value: Vector, slope: Vector) -> tuple[Vector, Vector]:
    """Cubic Hermite value and derivative at `at_ns`, from values and slopes [1/s] at `time_ns`."""
    left = np.clip(np.searchsorted(time_ns, at_ns, side="right") - 1, 0, len(time_ns) - 2)
    step = (time_ns[left + 1] - time_ns[left]) * 1e-9
    s = (at_ns - time_ns[left]) * 1e-9 / step
    a, b, m, n = value[left], value[left + 1], slope[left] * step, slope[left + 1] * step
    result = a + s * (m + s * (3.0 * (b - a) - 2.0 * m - n + s * (2.0 * (a - b) + m + n)))
    rate = (
        m + s * (2.0 * (3.0 * (b - a) - 2.0 * m - n) + 3.0 * s * (2.0 * (a - b) + m + n))
    ) / step
    return result, rate


def _fade(record: HeaveRecord, whole: _Pass) -> tuple[_Pass, _Pass, int]:
    """The first pass (as recorded), the later ones (beginning blended from the end), their length.

    With the tail x(t + P) and the head x(t), the later passes begin with x(t + P) + w·(x(t) −
    x(t + P)), w rising smoothly (3s² − 2s³) from 0 to 1; the velocity is its derivative.
    """
    time_ns = record.time_ns
    fade_ns = min(round(FADE_S * 1e9), int(time_ns[-1]) // 3)
    at = int(np.searchsorted(time_ns, time_ns[-1] + record.period_ns - fade_ns))
    loop_ns = int(time_ns[min(at, len(time_ns) - 1)])
    length_ns = int(time_ns[-1]) - loop_ns
    pass_length = int(np.searchsorted(time_ns, loop_ns))
    first = _Pass(
        time_ns[:pass_length],
        whole.position_m[:pass_length],
        whole.velocity_m_per_s[:pass_length],
        whole.elevation_m[:pass_length],
    )
    if length_ns == 0:
        return first, first, loop_ns
    head = int(np.searchsorted(time_ns, length_ns))
    head_ns = time_ns[:head]
    tail, tail_rate = _hermite(
        head_ns + loop_ns, time_ns, record.position_m, record.velocity_m_per_s
    )
    s = head_ns / length_ns
    w, w_rate = s * s * (3.0 - 2.0 * s), 6.0 * s * (1.0 - s) / (length_ns * 1e-9)
    position, velocity = first.position_m.copy(), first.velocity_m_per_s.copy()
    apart = position[:head] - tail
    velocity[:head] = tail_rate + w * (velocity[:head] - tail_rate) + w_rate * apart
    position[:head] = tail + w * apart
    elevation = first.elevation_m.copy()
    tail_elevation = np.interp(head_ns + loop_ns, time_ns, whole.elevation_m)
    elevation[:head] = tail_elevation + w * (elevation[:head] - tail_elevation)
    return first, _Pass(first.time_ns, position, velocity, elevation), loop_ns
