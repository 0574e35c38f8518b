"""A winch that follows its measured line out instead of commands.

Between readings the line follows the cubic Hermite polynomial through line out and line speed, as
for heave (`HeaveTrack`). After the last reading its speed is kept for HOLD_S and then ramped to
zero at the winch's acceleration limit. When readings come back, or come late, the line is blended
into them by a cubic whose speed and acceleration stay within the winch's limits; likewise at the
start, if the scene's length differs from the measured one. Readings beyond the winch's limits are
followed too, and reported.

With a counter of resolution r the line out is within r/2 of its reading. The length predicted from
the last one and the line speed is used within that range, and limited to it: rounding causes no
steps of the line. If no line speed is measured, it is the slope of the readings; if two of them are
so close that it exceeds the winch's maximum speed, the last speed is kept, and that is reported.

Stamps by arrival are wrong for delayed readings, and a burst of them would move the line in an
instant. Of two readings that imply a speed beyond the winch's maximum the earlier one is dropped,
and that is reported, unless the line already moves towards it.
"""

from __future__ import annotations

import math
from collections import deque

from rope_twin.errors import phrase
from rope_twin.scene.schema import WINCH
from rope_twin.scene.winch import FOLLOWS_MEASURED
from rope_twin.scene.winch import Winch as WinchScene
from rope_twin.twin.health import UNJUDGED
from rope_twin.twin.motion.heave_track import NO_SEGMENT, STALE_NS, HeaveTrack
from rope_twin.twin.motion.plausibility import SampleTiming, end_slope
from rope_twin.twin.readings import fastest_m_per_s
from rope_twin.twin.snapshot import InputHealth, WinchSnapshot
from rope_twin.twin.winch.commands import (
    COMMANDER_EVENTS,
    UNKNOWN_ROPE,
    Payout,
    SpooledRope,
    TensionFeedback,
    WinchCommand,
)
from rope_twin.twin.winch.winch import END_FRACTION, Winch

HOLD_S = 1.0
MIN_BLEND_S = 0.5  # minimum time in which the line is blended into the readings
SLOPE_NS = 1_000_000_000  # readings of a counter with a resolution from which a speed is derived
SLOPE_READINGS = 3  # the same of a counter without a resolution
GAP_NS = 2_000_000_000  # after a longer gap nothing is predicted
REQUIRED_NS = 3_000_000_000  # time by which the first reading must have come
STALE_INTERVALS = 2.0
DIFFERENCE_WARN_M = 0.1  # a larger difference from the measured line out is a warning
CONTRADICTION_TOL_M = 0.02  # of readings, beyond the change by speed and resolution
NO_LIMIT = 1e6


class LineTrack(HeaveTrack):
    """Measured line out over twin time; the line is at rest before the first reading."""

    def __init__(self, length_m: float, scene: WinchScene, resolution_m: float, name: str) -> None:
        super().__init__(NO_LIMIT, NO_LIMIT)
        self.counter.name = name
        self._speed = max(scene.speed_limit_m_per_s, 1e-3)
        self._acceleration = scene.acceleration_limit_m_per_s2
        self._resolution = resolution_m
        self._recent: deque[tuple[int, float]] = deque()
        self._given = (length_m, 0.0)
        self._anchor = (0, length_m, 0.0)  # start of an extrapolation without readings
        self._is_fresh = False  # whether a reading came while the line was extrapolated
        self.remark = ""  # on a difference of the line from the measured one
        self.off_m = 0.0  # that difference while it is blended
        self._timing = SampleTiming(math.inf)
        self._fastest = fastest_m_per_s(scene)
        self._doubt = ""  # about a speed derived from the readings
        self._late_s = 0.0  # delay of the newest reading

    @property
    def newest_ns(self) -> int | None:
        """Stamp of the newest reading [ns], or None if there is none."""
        return self._stamps[-1] if self._stamps else None

    def take(self, stamp_ns: int, length_m: float, speed_m_per_s: float | None) -> None:
        """Take a reading that was checked."""
        now_ns = self._asked_ns or 0
        if self._stamps and stamp_ns <= self._stamps[-1]:
            return
        self._late_s = max(0.0, (now_ns - stamp_ns) * 1e-9)
        recent = self._recent
        if recent and stamp_ns - recent[-1][0] > GAP_NS:
            recent.clear()
        recent.append((stamp_ns, length_m))
        while len(recent) > SLOPE_READINGS and (
            self._resolution == 0.0 or stamp_ns - recent[1][0] > SLOPE_NS
        ):
            recent.popleft()
        self._timing.take(stamp_ns, now_ns, self.missing_ns)
        self._drop_contradicted(stamp_ns, length_m, now_ns)
        if not self._stamps or self._stamps[-1] < now_ns:
            self._is_fresh = True
        speed = self._derived_speed() if speed_m_per_s is None else speed_m_per_s
        self._append(stamp_ns, self._within_resolution(stamp_ns, length_m, speed), speed)

    def warning(self) -> str:
        """Return the warnings on a line that differs from the measured one and on its readings."""
        remark = self.remark if abs(self.off_m) > DIFFERENCE_WARN_M else ""
        notes = remark, self._doubt, self._timing.fault(self._late_s)
        return "; ".join(text for text in notes if text)

    def stale(self, time_ns: int) -> bool:
        """Return whether readings have been missing for longer than is usual for the counter."""
        interval_s = self._timing.interval_s  # NaN: not known yet
        usual_ns = 0 if math.isnan(interval_s) else round(STALE_INTERVALS * interval_s * 1e9)
        return bool(self._stamps) and time_ns - self._stamps[-1] > max(STALE_NS, usual_ns)

    def _drop_contradicted(self, stamp_ns: int, length_m: float, now_ns: int) -> None:
        """Drop readings, not used yet, from which no winch could have reached this one in time."""
        used_ns, slack, first_dropped = (
            max(now_ns, self._segment[1]),
            self._resolution + CONTRADICTION_TOL_M,
            None,
        )
        k = len(self._stamps) - 1
        while k >= 0 and self._stamps[k] > used_ns:
            seconds = (stamp_ns - self._stamps[k]) * 1e-9
            if abs(length_m - self._samples[k][0]) > self._fastest * seconds + slack:
                first_dropped = k
            k -= 1
        if first_dropped is None:
            return
        dropped_m, seconds = (
            self._samples[first_dropped][0],
            (stamp_ns - self._stamps[first_dropped]) * 1e-9,
        )
        text = f"{dropped_m:.2f} m and {length_m:.2f} m {seconds:.3f} s later: the winch is not so "
        self.counter.warn(text + "fast; the earlier one was held up and is left out", now_ns)
        del self._stamps[first_dropped:], self._samples[first_dropped:]

    def _derived_speed(self) -> float:
        """Return the speed by the readings, or the last one where they lie too close for it."""
        speed, self._doubt = self._slope(), ""
        if abs(speed) <= self._fastest:
            return speed
        self._doubt = f"{speed:+.3g} m/s by the readings is not possible, the last speed is kept"
        return self._samples[-1][1] if self._samples else 0.0

    def _slope(self) -> float:
        """Return the speed at the newest of the recent readings."""
        if len(self._recent) < SLOPE_READINGS:
            (t, a), (u, b) = self._recent[0], self._recent[-1]
            return (b - a) / ((u - t) * 1e-9) if u > t else 0.0
        newest_ns = self._recent[-1][0]
        times = [(stamp_ns - newest_ns) * 1e-9 for stamp_ns, _ in self._recent]
        return end_slope(times, [length for _, length in self._recent])

    def _within_resolution(self, stamp_ns: int, length_m: float, speed: float) -> float:
        """Return the predicted length, limited to the resolution around the reading."""
        if not self._stamps or stamp_ns - self._stamps[-1] > GAP_NS:
            return length_m
        last_m, rate = self._samples[-1]
        predicted = last_m + 0.5e-9 * (stamp_ns - self._stamps[-1]) * (rate + speed)
        half = 0.5 * self._resolution
        return min(max(predicted, length_m - half), length_m + half)

    def drop(self) -> None:
        """Drop all readings: the line continues with its present motion."""
        self._stamps.clear()
        self._samples.clear()
        self._recent.clear()
        self._segment, self._on_track, self._is_fresh = NO_SEGMENT, False, False
        self._anchor = (self._asked_ns or 0, *self._given)
        self._error_ns = -(10**18)

    def continue_from(self, line: Payout) -> None:
        """Continue from this line, and blend it into the readings."""
        self._given, self._on_track = (line.length_m, line.speed_m_per_s), False
        self._open_rejoin(self._asked_ns or 0)

    def at(self, time_ns: int) -> tuple[float, float]:
        """Return line out [m] and speed [m/s] at a time not before the previous call's."""
        if time_ns == self._asked_ns:
            return self._given
        asked_ns = self._asked_ns or 0
        if not (self._on_track and self._segment[0] < time_ns <= self._segment[1]):
            known = bool(self._stamps) and time_ns <= self._stamps[-1]
            if self._is_fresh:  # a reading has changed what was extrapolated
                self._open_rejoin(asked_ns)
                self._is_fresh = False
            if self._stamps and not known:
                self.missing_ns += time_ns - asked_ns
            z, v = self._measured(time_ns)
            dz, dv = self._rejoin(time_ns)
            self._given = z + dz, v + dv
            self._report_gap(time_ns, known)
            self._on_track = known and not self._rejoining(time_ns)
            self._drop_old(time_ns)
        else:
            self._given = self._interpolated(time_ns)
        self._asked_ns = time_ns
        return self._given

    def _measured(self, time_ns: int) -> tuple[float, float]:
        """Return the line by the readings: interpolated, or in a gap extrapolated from the last."""
        if self._stamps and time_ns <= self._stamps[-1]:
            return super()._measured(time_ns)
        since_ns, z, v = self._anchor
        if self._stamps:
            since_ns, (z, v) = self._stamps[-1], self._samples[-1]
        gap_s = (time_ns - since_ns) * 1e-9
        if gap_s <= HOLD_S:
            return z + v * gap_s, v
        ramp_s = min(gap_s - HOLD_S, abs(v) / self._acceleration)
        lost_speed = math.copysign(self._acceleration, v) * ramp_s
        return z + v * (HOLD_S + ramp_s) - 0.5 * lost_speed * ramp_s, v - lost_speed

    def _rejoin_duration(self) -> float:
        """Return the time of the cubic from the given line to the measured one [s].

        With the differences e and d of length and speed its maximum speed relative to the measured
        line is at most 1.5·e/T + d, its maximum acceleration 6·e/T² + 4·d/T.
        """
        e, d = abs(self._error[0]), abs(self._error[1])
        a = self._acceleration
        by_acceleration = (2.0 * d + math.sqrt(4.0 * d * d + 6.0 * e * a)) / a
        return max(MIN_BLEND_S, 1.5 * e / self._speed, by_acceleration)

    def _report_gap(self, time_ns: int, known: bool) -> None:
        """Report how the line differs from the measured one."""
        self.off_m = 0.0
        if known and self._rejoining(time_ns):
            left_s = self._rejoin_s - (time_ns - self._error_ns) * 1e-9
            self.off_m = self._rejoin(time_ns)[0]
            difference = f"{self.off_m:+.2f} m from the measured line out"
            self.remark = f"{difference}, led over to it in {left_s:.0f} s"
        elif known:
            self.remark = ""
        elif not self._stamps:
            self.remark = "no line out was measured yet; the line stands"
        else:
            missing_s = (time_ns - self._stamps[-1]) * 1e-9
            self.remark = f"no measured line out for {missing_s:.2f} s; the last speed runs out"


class FollowingWinch(Winch):
    """Winch of a scene with `follows: measured`; its commands are rejected."""

    def __init__(
        self,
        scene: WinchScene,
        length_m: float,
        name: str = WINCH,
        rope: SpooledRope = UNKNOWN_ROPE,
        resolution_m: float = 0.0,
    ) -> None:
        """Make the winch of the hang-off `name`; resolution_m: of its line-out counter."""
        super().__init__(scene, length_m, name, rope)
        self._adding = self._limiting = ()
        following = "line_following" if name == WINCH else f"line_following {name}"
        self._track = LineTrack(length_m, scene, resolution_m, following)
        self._offset = 0.0  # line out less counter, after a cut

    def take(self, stamp_ns: int | None, command: WinchCommand, now_ns: int) -> str:
        """Reject a command, as the winch follows its measured line out."""
        if command.kind in COMMANDER_EVENTS:
            return ""
        return self.refuse(command, self.forbids(command.kind))

    def may_execute(self, stamp_ns: int | None, command: WinchCommand, now_ns: int) -> bool:
        """Return False: it follows no command."""
        return False

    def forbids(self, switch: str) -> str:
        """Return why no command is executed."""
        remedy = "set winch.follows to commands in the scene"
        problem = f"'{switch}' to a winch that follows its measured line out"
        return phrase("winch command", problem, remedy)

    def follow(self, stamp_ns: int, length_m: float, speed_m_per_s: float | None) -> None:
        """Take a measured line out that was checked."""
        self._track.take(stamp_ns, length_m, speed_m_per_s)

    def invalidate(self) -> None:
        """Join the next readings as after a gap: the ship's winch ran on meanwhile."""
        self._track.drop()

    def needs_feedback(self, time_ns: int) -> bool:
        """Return False: the line is prescribed."""
        return False

    def stale(self, now_ns: int) -> bool:
        """Return False: there is no command."""
        return False

    def step(
        self,
        time_ns: int,
        step_s: float,
        heave_m_per_s: float = 0.0,
        feedback: TensionFeedback | None = None,
    ) -> Payout:
        """Advance from `time_ns` by one step; return payout and speed at its end."""
        scene = self._scene
        assert scene is not None
        self._last, self._begun_ns = (self._line, step_s), time_ns
        length, speed = self._track.at(time_ns + round(step_s * 1e9))
        length += self._offset
        min_m = max(END_FRACTION * scene.min_line_out_m, self._end_m)
        limited = min(max(length, min_m), scene.max_line_out_m)
        messages = []
        if limited != length:
            messages.append(f"line out {length:.2f} m cannot be followed; held at {limited:g} m")
            speed = 0.0
        if abs(speed) > scene.speed_limit_m_per_s:
            limit = scene.speed_limit_m_per_s
            messages.append(f"follows {speed:+.2f} m/s, beyond the speed limit of {limit:g} m/s")
        self.at_limit = "; ".join(messages)
        self._line = self._nominal = Payout(limited, speed)
        return self._line

    def continue_from(self, line: Payout) -> None:
        """Continue from this payout and speed, as the rope returned to them after a failed step."""
        super().continue_from(line)
        self._track.continue_from(Payout(line.length_m - self._offset, line.speed_m_per_s))

    def adapt_to_cut(self, lost_m: float, left_m: float) -> None:
        """Adapt to a cut: the counter still counts the whole rope."""
        self._offset += left_m - self._line.length_m
        super().adapt_to_cut(lost_m, left_m)

    def health(self, now_ns: int) -> dict[str, InputHealth]:
        """Return the health of the inputs by name: commands, and the line that is followed."""
        track = self._track
        track.counter.set_note(track.remark)
        judged = UNJUDGED
        if track.newest_ns is None:
            if now_ns > REQUIRED_NS:
                judged = judged._replace(fault=track.remark)
        else:
            judged = judged._replace(warning=track.warning())
        track_health = track.counter.health(now_ns, track.stale(now_ns), judged)
        return super().health(now_ns) | {track.counter.name: track_health}

    def snapshot(self) -> WinchSnapshot | None:
        """Return its state for operators; it is off the schedule from its first reading on."""
        snapshot = super().snapshot()
        assert snapshot is not None
        since_s = 0.0 if self._track.counter.accepted else None
        return WinchSnapshot(
            snapshot.name,
            FOLLOWS_MEASURED,
            self._line.length_m,
            snapshot.at_limit,
            snapshot.figures,
            since_s,
        )
