"""Heave of the hang-off: stamped samples, interpolated at any later time; series known before.

Between samples the motion is the cubic Hermite polynomial through position and velocity. While the
sample after the requested time is missing, the last one is extrapolated with a velocity that decays
(GAP_DECAY_S): position stays bounded and continuous, and the track counts as stale. When samples
come back, the extrapolated motion is blended into the measured one within REJOIN_S, or longer where
a jump is too large for that. Nothing else is smoothed, and the health reports when either happens.

After a pause or a restart (`invalidate`) the samples known in advance are valid only if their
sender repeats them, as a replay does. If it sends anything else, the ship has moved on meanwhile:
the known samples are dropped, and the new ones are joined as after a gap.

Heave known in advance, a `HeaveSeries`, is evaluated for many steps at once. The polynomial is that
of `HeaveTrack` between the same samples, in the same order of operations, so that both are
bit-identical. A series has no gaps, so nothing is extrapolated.

A `LowerEndTrack` is the motion of a rope's lower end, from samples of another simulator, which
holds the payload.
"""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from rope_twin.core.interpolation import Samples, Times, add_motion
from rope_twin.core.moved_end import PrescribedEnd, prescribed_of
from rope_twin.core.state import Boundary
from rope_twin.errors import InputError, phrase
from rope_twin.scene.schema import Scene
from rope_twin.sea.ship_motion import FASTEST_M_PER_S
from rope_twin.twin.health import AHEAD_NS, InputCounter, too_far_ahead, too_late
from rope_twin.twin.snapshot import InputHealth

HEAVE_LIMIT_M = 30.0
VELOCITY_LIMIT_M_PER_S = FASTEST_M_PER_S
JUMP_M = 0.01  # allowed sudden change of a position: the resolution of a sensor
JUMP_WINDOW_NS = 2_000_000_000  # after a longer gap any possible position is accepted
JUMP_NS = 2_000_000_000  # maximum of a stamp after the first, ahead of present and last stamp
KEEP_NS = 5_000_000_000
STALE_NS = 500_000_000
GAP_DECAY_S = 1.0
REJOIN_S = 2.0
REJOIN_M_PER_S2 = 0.5  # of the blending, as of a ship in a moderate sea: longer for larger jumps
NO_SEGMENT = (0, -1, 0.0, 0.0, 0.0, 0.0, 1.0)
LOWER_END, LOWER_END_LIMIT_M = "lower_end", 2e5
Vector3 = tuple[float, float, float]


def rejoin_s(jump_m: float) -> float:
    """Return the time in which a jump is blended [s]; the cubic's acceleration is 6·jump/T².

    A shorter time would jerk a suspended load at rest: a false snap load.
    """
    return max(REJOIN_S, math.sqrt(6.0 * abs(jump_m) / REJOIN_M_PER_S2))


Difference = TypeVar("Difference", float, NDArray[np.float64])


def blending_cubic(
    error: Difference, rate: Difference, u: float, duration_s: float
) -> tuple[Difference, Difference]:
    """Return a difference that is blended out, and its rate, at a fraction u of the duration.

    It is the cubic from the difference and its rate at u = 0 to zero for both at u = 1.
    """
    d = rate * duration_s
    value = error * (1.0 + u * u * (2.0 * u - 3.0)) + d * u * (1.0 - u) ** 2
    slope = error * 6.0 * u * (u - 1.0) + d * (1.0 - u) * (1.0 - 3.0 * u)
    return value, slope / duration_s


class HeaveTrack:
    """Heave over twin time [ns]; `submit` takes samples, `at` is called with rising times."""

    def __init__(
        self,
        limit_m: float = HEAVE_LIMIT_M,
        speed_limit_m_per_s: float = VELOCITY_LIMIT_M_PER_S,
        name: str = "heave",
        moved_object: str = "ship",
    ) -> None:
        """Set the maximum position [m] and the maximum speed of accepted samples.

        name: of the input; moved_object: the object that it moves, for messages.
        """
        self.counter, self._moves = InputCounter(name), moved_object
        self.missing_ns = 0  # total time without a sample after the requested time
        self._limit_m, self._speed_limit = limit_m, speed_limit_m_per_s
        self._rejoin_s = REJOIN_S  # duration of the newest blending
        self._stamps: list[int] = []
        self._samples: list[tuple[float, float]] = []
        self._asked_ns: int | None = None
        self._given = (0.0, 0.0)
        self._assumed_from: tuple[int, float, float] | None = None  # start of an extrapolation
        self._error = (0.0, 0.0)  # extrapolated less measured position, velocity at _error_ns
        self._error_ns = -(10**18)
        # samples around the last requested time: begin, end, z, velocity·h, c2, c3, h
        self._segment: tuple[float, ...] = NO_SEGMENT
        self._on_track = False  # interpolated, without extrapolation or blending
        self._in_doubt = False  # whether known samples are from before a pause
        self._confirmed = False  # whether one of them has been repeated since

    def rest_until(self, time_ns: int | None) -> None:
        """Record that the motion was zero up to then."""
        self._asked_ns = time_ns

    def invalidate(self) -> None:
        """Invalidate samples that were known in advance, as the sender was interrupted."""
        self._in_doubt, self._confirmed = bool(self._stamps), False

    def submit(self, stamp_ns: int, position_m: float, velocity_m_per_s: float) -> str:
        """Submit a sample; return "" or the reason for its rejection."""
        if self._in_doubt and self._is_repeated(stamp_ns, (position_m, velocity_m_per_s)):
            return ""
        fault = (
            self._number_fault(position_m, velocity_m_per_s)
            or self._stamp_fault(stamp_ns)
            or self._jump_fault(stamp_ns, position_m)
        )
        if not fault:
            self._append(stamp_ns, position_m, velocity_m_per_s)
        return fault

    def drop(self) -> None:
        """Drop all samples: the next ones are joined as after a gap."""
        self._stamps.clear()
        self._samples.clear()
        self._segment, self._on_track = NO_SEGMENT, False
        if self._asked_ns is not None:
            self._assumed_from = (self._asked_ns, *self._given)

    def _append(self, stamp_ns: int, position_m: float, velocity_m_per_s: float) -> None:
        """Store a validated sample."""
        self.counter.accept(stamp_ns)
        self._stamps.append(stamp_ns)
        self._samples.append((float(position_m), float(velocity_m_per_s)))

    def _is_repeated(self, stamp_ns: int, sample: tuple[float, float]) -> bool:
        """After `invalidate`, return whether the sample is a known one; others end this check."""
        index = bisect_right(self._stamps, stamp_ns) - 1
        if index >= 0 and self._stamps[index] == stamp_ns and self._samples[index] == sample:
            self._confirmed = True
            return True
        asked_ns = self._asked_ns
        if asked_ns is None or stamp_ns < asked_ns or not self._is_possible(*sample):
            return False  # rejected in the usual way; the check continues
        if not (self._confirmed and index == len(self._stamps) - 1):
            self.drop()
        self._in_doubt = self._confirmed = False
        return False

    def _number_fault(self, z: float, v: float) -> str:
        """Return why the numbers of a sample are rejected, counted; or ""."""
        refuse = self.counter.refuse
        if not (math.isfinite(z) and math.isfinite(v)):
            problem = f"position {z} m, velocity {v} m/s"
            remedy = "both must be finite numbers"
            return refuse("non_finite", phrase(self.counter.name, problem, remedy))
        if not self._is_possible(z, v):
            return refuse("impossible", phrase(
                self.counter.name, f"position {z:g} m, velocity {v:g} m/s",
                f"a {self._moves} stays within ±{self._limit_m:g} m and ±{self._speed_limit:g} m/s"))  # fmt: skip # noqa: E501
        return ""

    def _stamp_fault(self, stamp_ns: int) -> str:
        """Return why the stamp of a sample is rejected, counted; or ""."""
        refuse, name, stamp = (
            self.counter.refuse,
            self.counter.name,
            f"stamp {stamp_ns * 1e-9:.3f} s",
        )
        if self._stamps and stamp_ns == self._stamps[-1]:
            remedy = "each sample needs a stamp of its own"
            return refuse("repeated", phrase(name, f"{stamp} came twice", remedy))
        asked_ns = self._asked_ns
        if self._stamps and stamp_ns < self._stamps[-1]:
            if (
                asked_ns is not None and asked_ns - stamp_ns > AHEAD_NS
            ):  # another clock, in any order
                return refuse("late", phrase(name, *too_late(stamp_ns, asked_ns)))
            problem = f"{stamp} follows {self._stamps[-1] * 1e-9:.3f} s"
            remedy = "samples must come in the order of their stamps"
            return refuse("late", phrase(name, problem, remedy))
        if asked_ns is not None and stamp_ns < asked_ns:
            return refuse("late", phrase(name, *too_late(stamp_ns, asked_ns, "needed")))
        ahead_ns = stamp_ns - (asked_ns or 0)
        jump_ns = min(ahead_ns, stamp_ns - self._stamps[-1]) if self._stamps else ahead_ns
        if jump_ns > (JUMP_NS if self._stamps else AHEAD_NS):
            return refuse("impossible", phrase(name, *too_far_ahead(stamp_ns, asked_ns or 0)))
        return ""

    def _jump_fault(self, stamp_ns: int, z: float) -> str:
        """Return why a position after the last sample is impossible, counted; or ""."""
        if self._stamps and 0 < stamp_ns - self._stamps[-1] <= JUMP_WINDOW_NS:
            gap_s = (stamp_ns - self._stamps[-1]) * 1e-9
            jump_m = z - self._samples[-1][0]
            if abs(jump_m) > self._speed_limit * gap_s + JUMP_M:
                return self.counter.refuse("impossible", phrase(
                    self.counter.name, f"it jumps by {jump_m:.2f} m in {gap_s:.3f} s",
                    f"a {self._moves} moves by at most {self._speed_limit:g} m/s"))  # fmt: skip
        return ""

    def _is_possible(self, z: float, v: float) -> bool:
        """Return whether the values are within the ship's limits; NaN is not."""
        return abs(z) <= self._limit_m and abs(v) <= self._speed_limit

    def at(self, time_ns: int) -> tuple[float, float]:
        """Return position [m] and velocity [m/s] at a time not before the previous call's."""
        if time_ns == self._asked_ns:
            return self._given
        if self._on_track and self._segment[0] < time_ns <= self._segment[1]:
            self._asked_ns = time_ns
            self._given = self._interpolated(time_ns)
            return self._given
        next_index = bisect_right(self._stamps, time_ns)
        known = next_index > 0 and (next_index < len(self._stamps) or self._stamps[-1] == time_ns)
        if known:
            if self._assumed_from is not None and self._asked_ns is not None:
                self._open_rejoin(self._asked_ns)
            self._assumed_from = None
            z, v = self._measured(time_ns)
            dz, dv = self._rejoin(time_ns)
            self._given = (z + dz, v + dv)
        else:
            if self._stamps and self._asked_ns is not None:
                self.missing_ns += time_ns - self._asked_ns
            if self._assumed_from is None:
                self._assumed_from = self._last_known()
            since_ns, z, v = self._assumed_from
            decay = math.exp((since_ns - time_ns) * 1e-9 / GAP_DECAY_S)
            self._given = (z + v * GAP_DECAY_S * (1.0 - decay), v * decay)
        self._report_gap(time_ns, known)
        self._on_track = known and not self._rejoining(time_ns)
        self._asked_ns = time_ns
        self._drop_old(time_ns)
        return self._given

    def _last_known(self) -> tuple[int, float, float]:
        """Return stamp, position and velocity at the start of a gap; zero before any sample."""
        if not self._stamps or self._asked_ns is None:
            return 0, 0.0, 0.0
        (z, v), (dz, dv) = self._samples[-1], self._rejoin(self._stamps[-1])
        return self._stamps[-1], z + dz, v + dv

    def _measured(self, time_ns: int) -> tuple[float, float]:
        """Cubic Hermite between the samples around the time; linear before the first.

        At a sample the piece that ends there is evaluated, whether the next one is known or not.
        """
        k = bisect_left(self._stamps, time_ns)
        if k == 0:
            z, v = self._samples[0]
            return z + v * (time_ns - self._stamps[0]) * 1e-9, v
        begin, end = self._stamps[k - 1], self._stamps[k]
        if begin != self._segment[0] or end != self._segment[1]:
            (z0, v0), (z1, v1) = self._samples[k - 1], self._samples[k]
            h = (end - begin) * 1e-9
            d0, d1 = v0 * h, v1 * h
            c2, c3 = 3.0 * (z1 - z0) - 2.0 * d0 - d1, 2.0 * (z0 - z1) + d0 + d1
            self._segment = (begin, end, z0, d0, c2, c3, h)
        return self._interpolated(time_ns)

    def _interpolated(self, time_ns: int) -> tuple[float, float]:
        begin, end, z0, d0, c2, c3, h = self._segment
        u = (time_ns - begin) / (end - begin)
        return z0 + u * (d0 + u * (c2 + u * c3)), (d0 + u * (2.0 * c2 + u * 3.0 * c3)) / h

    def _open_rejoin(self, time_ns: int) -> None:
        """Store the difference between the extrapolated and the measured motion."""
        z, v = self._measured(time_ns)
        self._error = (self._given[0] - z, self._given[1] - v)
        self._error_ns = time_ns
        self._rejoin_s = self._rejoin_duration()

    def _rejoin_duration(self) -> float:
        return rejoin_s(self._error[0])

    def _rejoining(self, time_ns: int) -> bool:
        return time_ns - self._error_ns < self._rejoin_s * 1e9

    def _rejoin(self, time_ns: int) -> tuple[float, float]:
        """Return the remaining difference and its rate."""
        if not self._rejoining(time_ns):
            return 0.0, 0.0
        u = (time_ns - self._error_ns) * 1e-9 / self._rejoin_s
        return blending_cubic(*self._error, u, self._rejoin_s)

    def _report_gap(self, time_ns: int, known: bool) -> None:
        """Report the handling of a gap."""
        if known and self._rejoining(time_ns):
            over_s = self._rejoin_s
            self.counter.set_note(
                f"samples are back; the motion is led over to them in {over_s:.3g} s"
            )
        elif known:
            self.counter.set_note("")
        elif not self._stamps:
            self.counter.set_note(f"no sample yet; the {self._moves} lies still")
        else:
            missing = (time_ns - self._stamps[-1]) * 1e-9
            self.counter.set_note(f"no sample for {missing:.2f} s; the last motion dies away")

    def stale(self, time_ns: int) -> bool:
        """Return whether samples have been missing for longer than STALE_NS."""
        return bool(self._stamps) and time_ns - self._stamps[-1] > STALE_NS

    def _drop_old(self, time_ns: int) -> None:
        """Drop samples that no later time needs."""
        if len(self._stamps) > 64 and self._stamps[32] < time_ns - KEEP_NS:
            del self._stamps[:32], self._samples[:32]


def ramp(time_s: float, duration_s: float) -> tuple[float, float]:
    """Return the build-up factor 0 to 1 over `duration_s` and its rate [1/s].

    u³·(10 - 15u + 6u²) with u = time/duration, smooth at both ends.
    """
    if duration_s <= 0.0 or time_s >= duration_s:
        return 1.0, 0.0
    if time_s <= 0.0:
        return 0.0, 0.0
    u = time_s / duration_s
    return u**3 * (10.0 - 15.0 * u + 6.0 * u * u), 30.0 * u * u * (1.0 - u) ** 2 / duration_s


@dataclass(frozen=True, eq=False)
class HeaveSeries:
    """Samples in the order of their stamps; twin time 0 is at `start_ns` of the stamps.

    Raises:
        InputError: the samples are out of order, have a gap, or are beyond a ship's limits.
    """

    stamp_ns: NDArray[np.int64]
    position_m: NDArray[np.float64]  # of the hang-off above its mean position, + up
    velocity_m_per_s: NDArray[np.float64]
    start_ns: int = 0
    lateral: NDArray[np.float64] | None = (
        None  # east, north [m] and their rates [m/s], (4, samples)
    )

    def __post_init__(self) -> None:
        """Check the samples."""
        if self.lateral is not None and self.lateral.shape != (4, len(self.stamp_ns)):
            remedy = f"give (4, {len(self.stamp_ns)}), as many as samples"
            raise InputError("hang-off", f"east and north of shape {self.lateral.shape}", remedy)
        shapes = {self.stamp_ns.shape, self.position_m.shape, self.velocity_m_per_s.shape}
        if len(shapes) != 1 or self.stamp_ns.ndim != 1 or len(self.stamp_ns) < 2:
            raise InputError(
                "heave", f"arrays of shapes {shapes}", "give three of one length, 2 or more"
            )
        for fault in (self._order_fault(), self._motion_fault()):
            if fault:
                raise InputError(fault)

    @classmethod
    def of(
        cls,
        samples: Iterable[tuple[int, float, float]],
        lateral: Sequence[tuple[float, float, float, float]] = (),
    ) -> HeaveSeries:
        """Return a series from stamp [ns], position [m] and velocity [m/s] of each sample.

        lateral: x, y [m] and their rates [m/s] of each sample, if the hang-off moves laterally.
        """
        stamps, positions, velocities = zip(*samples, strict=True)
        lateral_motion = np.array(lateral).T if lateral else None
        heave = np.array(positions), np.array(velocities)
        return cls(np.array(stamps, np.int64), *heave, lateral=lateral_motion)

    def starting_at(self, start_ns: int) -> HeaveSeries:
        """Return the same samples with twin time 0 at this stamp; arrays are shared."""
        return replace(self, start_ns=start_ns)

    @property
    def end_ns(self) -> int:
        """Twin time of the last sample [ns]."""
        return int(self.stamp_ns[-1]) - self.start_ns

    def check_reach(self, first_ns: int, last_ns: int) -> None:
        """Check that the series covers the first to the last twin time.

        Raises:
            InputError: it does not.
        """
        known = self.stamp_ns[0] - self.start_ns, self.stamp_ns[-1] - self.start_ns
        if first_ns <= known[0] or last_ns > known[1]:
            raise InputError(
                "heave",
                f"samples from {int(known[0]) * 1e-9:g} s to {self.end_ns * 1e-9:g} s, wanted "
                f"from {first_ns * 1e-9:g} s to {last_ns * 1e-9:g} s",
                "give a longer series",
            )

    def move(self, boundary: Boundary, at: Times) -> None:
        """Add the motion at rising twin times to the boundaries after each step (`add_motion`).

        Raises:
            InputError: the series does not cover the times.
        """
        self.check_reach(int(at.stamp[0]), int(at.stamp[-1]))
        add_motion(self._samples, at._replace(stamp=at.stamp + self.start_ns), boundary)

    @cached_property
    def _samples(self) -> Samples:
        """Samples of heave, or with lateral ones of east, north and heave."""
        z, v = self.position_m[None], self.velocity_m_per_s[None]
        if self.lateral is not None:
            z, v = np.concatenate([self.lateral[:2], z]), np.concatenate([self.lateral[2:], v])
        stamps = np.ascontiguousarray(self.stamp_ns)
        return Samples(stamps, np.ascontiguousarray(z), np.ascontiguousarray(v))

    def _order_fault(self) -> str:
        steps_ns = np.diff(self.stamp_ns)
        late = np.flatnonzero(steps_ns <= 0)
        if late.size:
            at_s = self.stamp_ns[late[0] + 1] * 1e-9
            return phrase("heave", f"the stamp {at_s:.3f} s is not after the one before it",
                          "give samples in the order of their stamps")  # fmt: skip
        gap = int(np.argmax(steps_ns))
        if steps_ns[gap] > STALE_NS:
            return phrase(
                "heave",
                f"{steps_ns[gap] * 1e-9:.2f} s without a sample after "
                f"{self.stamp_ns[gap] * 1e-9:.2f} s",
                f"an ensemble takes heave with gaps of at most {STALE_NS * 1e-9:g} s",
            )
        return ""

    def _motion_fault(self) -> str:
        z, v = self.position_m, self.velocity_m_per_s
        possible = (np.abs(z) <= HEAVE_LIMIT_M) & (np.abs(v) <= VELOCITY_LIMIT_M_PER_S)  # NaN: not
        if not possible.all():
            k = int(np.argmin(possible))
            return phrase(
                "heave", f"position {z[k]:g} m, velocity {v[k]:g} m/s at sample {k}",
                f"a ship stays within ±{HEAVE_LIMIT_M:g} m and ±{VELOCITY_LIMIT_M_PER_S:g} m/s")  # fmt: skip # noqa: E501
        max_jump = VELOCITY_LIMIT_M_PER_S * np.diff(self.stamp_ns) * 1e-9 + JUMP_M
        jumps = np.flatnonzero(np.abs(np.diff(z)) > max_jump)
        if jumps.size:
            at_s = self.stamp_ns[jumps[0]] * 1e-9
            return phrase("heave", f"it jumps by {np.diff(z)[jumps[0]]:.2f} m at {at_s:.2f} s",
                          f"a ship moves by at most {VELOCITY_LIMIT_M_PER_S:g} m/s")  # fmt: skip
        return ""


class LowerEndTrack(HeaveTrack):
    """Track of the height of the end, with two more for east and north.

    Positions are those of the samples, in the axes of map. The end begins at rest where the scene
    fixes it, so that the first sample must be within reach of that position.
    """

    def __init__(self, scene: Scene) -> None:
        super().__init__(LOWER_END_LIMIT_M, VELOCITY_LIMIT_M_PER_S, LOWER_END, LOWER_END)
        position = scene.ropes[0].fixed_at_m
        assert position is not None, "a rule of scenes"
        self._place: Vector3 = position
        self._aside = (self._unchecked_track(), self._unchecked_track())
        self._newest: tuple[int, Vector3] = (0, position)
        self._borders: list[tuple[int, Vector3, Vector3]] = []  # of the steps that were prescribed

    @staticmethod
    def _unchecked_track() -> HeaveTrack:
        return HeaveTrack(LOWER_END_LIMIT_M, VELOCITY_LIMIT_M_PER_S, LOWER_END, LOWER_END)

    def invalidate(self) -> None:
        """Invalidate samples that were known in advance, as the sender was interrupted."""
        super().invalidate()
        for track in self._aside:
            track.invalidate()

    def submit_position(self, stamp_ns: int, position_m: Vector3, velocity_m_per_s: Vector3) -> str:
        """Submit position and velocity at a time; return "" or the reason for the rejection."""
        refuse = self.counter.refuse
        if not all(math.isfinite(value) for value in (*position_m, *velocity_m_per_s)):
            problem = f"position {position_m} m, velocity {velocity_m_per_s} m/s"
            return refuse("non_finite", phrase(LOWER_END, problem, "all must be finite numbers"))
        speed = math.hypot(*velocity_m_per_s)
        if speed > VELOCITY_LIMIT_M_PER_S:
            remedy = f"give at most {VELOCITY_LIMIT_M_PER_S:g} m/s"
            return refuse("impossible", phrase(LOWER_END, f"a speed of {speed:.1f} m/s", remedy))
        last_ns, last_m = self._newest
        gap_s = (stamp_ns - last_ns) * 1e-9
        if not self._in_doubt and gap_s * 1e9 <= JUMP_WINDOW_NS:
            jump_m = math.dist(position_m, last_m)
            if jump_m > VELOCITY_LIMIT_M_PER_S * max(gap_s, 0.0) + JUMP_M:
                problem = f"it jumps by {jump_m:.2f} m to {position_m} m within {gap_s:.3f} s"
                remedy = f"it begins at {self._place} m and moves by {VELOCITY_LIMIT_M_PER_S:g} m/s"
                return refuse("impossible", phrase(LOWER_END, problem, remedy))
        displacement = [a - b for a, b in zip(position_m, self._place, strict=True)]
        fault = self.submit(stamp_ns, displacement[2], velocity_m_per_s[2])
        if not fault:
            for track, value, rate in zip(
                self._aside, displacement, velocity_m_per_s, strict=False
            ):
                track.submit(stamp_ns, value, rate)
            self._newest = stamp_ns, position_m
        return fault

    def position_at(self, time_ns: int) -> tuple[Vector3, Vector3]:
        """Return position [m] and velocity [m/s] at a time, called with rising times."""
        (x, u), (y, v), (z, w) = (track.at(time_ns) for track in (*self._aside, self))
        a, b, c = self._place
        return (a + x, b + y, c + z), (u, v, w)

    def prescribe(self, effects: Sequence[Any], time_ns: int, step_ns: int, steps: int) -> None:
        """Write the motion over the next steps to the effect that moves the rope's end."""
        end = prescribed_of(effects)
        assert isinstance(end, PrescribedEnd), "a scene that lets its end be led has one"
        known = {at_ns: (position, rate) for at_ns, position, rate in self._borders}
        self._borders = []
        for row in range(steps + 1):
            at_ns = time_ns + row * step_ns
            position, rate = known[at_ns] if at_ns in known else self.position_at(at_ns)
            self._borders.append((at_ns, position, rate))
            end.value[row], end.rate[row] = position, rate
        end.clock[:] = time_ns * 1e-9, step_ns * 1e-9

    def health(self, now_ns: int) -> InputHealth:
        """Return the health of the input."""
        return self.counter.health(now_ns, self.stale(now_ns))
