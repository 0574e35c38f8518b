"""A winch that follows its measured line out instead of commands.

Between readings the cubic Hermite polynomial through line out and line speed holds, as for heave
(`HeaveTrack`). After the last reading its speed is kept for HOLD_S and then ramped to rest at the
winch's acceleration limit. When readings come back, or come late, the line is led over to them by a
cubic whose speed and acceleration stay within the winch's limits; so it is at the start, where the
scene's length differs from the measured one. What is measured is followed beyond the winch's limits
too, and reported.

A counter of resolution r says that the line out is within r/2 of its reading. There the length
predicted from the last one and the line speed is kept, and at the edge otherwise: rounding makes no
steps of the line. Where no line speed is measured, it is the slope of the readings; if two of them
lie so close that it exceeds what the winch can do, the last speed is kept, and that is reported.

Stamps by arrival are wrong for what was held up on its way, and a burst of such readings would
move the line in a moment. Of two readings that imply a speed beyond what the winch can do the
earlier one is left out, and that is reported, as long as the line is not on its way to it yet.
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
from rope_twin.twin.snapshot import InputHealth, WinchShot
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
LEAD_S = 0.5  # least time in which the line is led over to the readings
SLOPE_NS = 1_000_000_000  # readings of a counter with a resolution from which a speed is derived
SLOPE_READINGS = 3  # of one without
HOLE_NS = 2_000_000_000  # after a longer gap nothing is predicted
REQUIRED_NS = 3_000_000_000  # time by which the first reading must have come
STALE_INTERVALS = 2.0
OFF_M = 0.1  # a larger difference from the measured line out is a warning
HELD_UP_M = 0.02  # beyond what speed and resolution explain: readings contradict each other
UNLIMITED = 1e6


class LineTrack(HeaveTrack):
    """Measured line out over twin time; the line is at rest before the first reading."""

    def __init__(self, length_m: float, scene: WinchScene, resolution_m: float, name: str) -> None:
        super().__init__(UNLIMITED, UNLIMITED)
        self.counter.name = name
        self._speed = max(scene.speed_limit_m_per_s, 1e-3)
        self._acceleration = scene.acceleration_limit_m_per_s2
        self._resolution = resolution_m
        self._recent: deque[tuple[int, float]] = deque()
        self._given = (length_m, 0.0)
        self._anchor = (0, length_m, 0.0)  # from which the line runs on without readings
        self._is_fresh = False  # whether a reading came while the line was extrapolated
        self.remark = ""  # on a difference of the line from the measured one
        self.off_m = 0.0  # that difference while it is led over
        self._timing = SampleTiming(math.inf)
        self._fastest = fastest_m_per_s(scene)
        self._doubt = ""  # about a speed derived from the readings
        self._late_s = 0.0  # by so much the newest reading came after it was needed

    @property
    def newest_ns(self) -> int | None:
        """Stamp of the newest reading [ns], or None if there is none."""
        return self._stamps[-1] if self._stamps else None

    def take(self, stamp_ns: int, length_m: float, speed_m_per_s: float | None) -> None:
        """Take a reading that was checked."""
        now = self._asked_ns or 0
        if self._stamps and stamp_ns <= self._stamps[-1]:
            return
        self._late_s = max(0.0, (now - stamp_ns) * 1e-9)
        recent = self._recent
        if recent and stamp_ns - recent[-1][0] > HOLE_NS:
            recent.clear()
        recent.append((stamp_ns, length_m))
        while len(recent) > SLOPE_READINGS and (
            self._resolution == 0.0 or stamp_ns - recent[1][0] > SLOPE_NS
        ):
            recent.popleft()
        self._timing.take(stamp_ns, now, self.missing_ns)
        self._leave_out(stamp_ns, length_m, now)
        if not self._stamps or self._stamps[-1] < now:
            self._is_fresh = True
        speed = self._derived() if speed_m_per_s is None else speed_m_per_s
        self._append(stamp_ns, self._within(stamp_ns, length_m, speed), speed)

    def warning(self) -> str:
        """Return the warnings on a line that differs from the measured one and on its readings."""
        off = self.remark if abs(self.off_m) > OFF_M else ""
        notes = off, self._doubt, self._timing.fault(self._late_s)
        return "; ".join(words for words in notes if words)

    def stale(self, time_ns: int) -> bool:
        """Return whether readings have been missing for longer than is usual for the counter."""
        interval_s = self._timing.interval_s  # NaN: not known yet
        usual_ns = 0 if math.isnan(interval_s) else round(STALE_INTERVALS * interval_s * 1e9)
        return bool(self._stamps) and time_ns - self._stamps[-1] > max(STALE_NS, usual_ns)

    def _leave_out(self, stamp_ns: int, length_m: float, now: int) -> None:
        """Drop readings, not used yet, that no winch could have left for this one in the time."""
        used_ns, slack, first = max(now, self._segment[1]), self._resolution + HELD_UP_M, None
        k = len(self._stamps) - 1
        while k >= 0 and self._stamps[k] > used_ns:
            seconds = (stamp_ns - self._stamps[k]) * 1e-9
            if abs(length_m - self._samples[k][0]) > self._fastest * seconds + slack:
                first = k
            k -= 1
        if first is None:
            return
        earlier, seconds = self._samples[first][0], (stamp_ns - self._stamps[first]) * 1e-9
        words = f"{earlier:.2f} m and {length_m:.2f} m {seconds:.3f} s later: the winch is not so "
        self.counter.warn(words + "fast; the earlier one was held up and is left out", now)
        del self._stamps[first:], self._samples[first:]

    def _derived(self) -> float:
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

    def _within(self, stamp_ns: int, length_m: float, speed: float) -> float:
        """Return the predicted length where the reading allows it, or the nearest that it does."""
        if not self._stamps or stamp_ns - self._stamps[-1] > HOLE_NS:
            return length_m
        before, rate = self._samples[-1]
        predicted = before + 0.5e-9 * (stamp_ns - self._stamps[-1]) * (rate + speed)
        half = 0.5 * self._resolution
        return min(max(predicted, length_m - half), length_m + half)

    def drop(self) -> None:
        """Drop all readings: the line goes on from its present motion."""
        self._stamps.clear()
        self._samples.clear()
        self._recent.clear()
        self._segment, self._on_track, self._is_fresh = NO_SEGMENT, False, False
        self._anchor = (self._asked_ns or 0, *self._given)
        self._error_ns = -(10**18)

    def continue_from(self, line: Payout) -> None:
        """Continue from this line, and lead it over to the readings."""
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
        after = (time_ns - since_ns) * 1e-9
        if after <= HOLD_S:
            return z + v * after, v
        ramp = min(after - HOLD_S, abs(v) / self._acceleration)
        less = math.copysign(self._acceleration, v) * ramp
        return z + v * (HOLD_S + ramp) - 0.5 * less * ramp, v - less

    def _rejoin_duration(self) -> float:
        """Return the time of the cubic from the given line to the measured one [s].

        With the differences e and d of length and speed its highest speed beside the measured one
        is at most 1.5·e/T + d, its highest acceleration 6·e/T² + 4·d/T.
        """
        e, d = abs(self._error[0]), abs(self._error[1])
        a = self._acceleration
        gentle = (2.0 * d + math.sqrt(4.0 * d * d + 6.0 * e * a)) / a
        return max(LEAD_S, 1.5 * e / self._speed, gentle)

    def _report_gap(self, time_ns: int, known: bool) -> None:
        """Report how the line differs from the measured one."""
        self.off_m = 0.0
        if known and self._rejoining(time_ns):
            left_s = self._rejoin_s - (time_ns - self._error_ns) * 1e-9
            self.off_m = self._rejoin(time_ns)[0]
            off = f"{self.off_m:+.2f} m from the measured line out"
            self.remark = f"{off}, led over to it in {left_s:.0f} s"
        elif known:
            self.remark = ""
        elif not self._stamps:
            self.remark = "no line out was measured yet; the line stands"
        else:
            missing = (time_ns - self._stamps[-1]) * 1e-9
            self.remark = f"no measured line out for {missing:.2f} s; the last speed runs out"


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

    def forbids(self, switch: str) -> str:
        """Return why no command is executed."""
        right = "set winch.follows to commands in the scene"
        what = f"'{switch}' to a winch that follows its measured line out"
        return phrase("winch command", what, right)

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
        least = max(END_FRACTION * scene.least_line_out_m, self._end_m)
        held = min(max(length, least), scene.most_line_out_m)
        words = []
        if held != length:
            words.append(f"line out {length:.2f} m cannot be followed; held at {held:g} m")
            speed = 0.0
        if abs(speed) > scene.speed_limit_m_per_s:
            limit = scene.speed_limit_m_per_s
            words.append(f"follows {speed:+.2f} m/s, beyond the speed limit of {limit:g} m/s")
        self.at_limit = "; ".join(words)
        self._line = self._nominal = Payout(held, speed)
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
        track.counter.say(track.remark)
        judged = UNJUDGED
        if track.newest_ns is None:
            if now_ns > REQUIRED_NS:
                judged = judged._replace(fault=track.remark)
        else:
            judged = judged._replace(warning=track.warning())
        own = track.counter.health(now_ns, track.stale(now_ns), judged)
        return super().health(now_ns) | {track.counter.name: own}

    def shot(self) -> WinchShot | None:
        """Return its state for operators; it is off the schedule from its first reading on."""
        shot = super().shot()
        assert shot is not None
        since_s = 0.0 if self._track.counter.accepted else None
        return WinchShot(
            shot.name, FOLLOWS_MEASURED, self._line.length_m, shot.at_limit, shot.figures, since_s
        )
