"""Motion of a rope's lower end from samples of another simulator, which holds the payload."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from rope_twin.core.moved_end import LedEnd, led_of
from rope_twin.errors import phrase
from rope_twin.scene.schema import Scene
from rope_twin.twin.motion.heave_track import (
    JUMP_M,
    JUMP_WINDOW_NS,
    VELOCITY_LIMIT_M_PER_S,
    HeaveTrack,
)
from rope_twin.twin.snapshot import InputHealth

NAME = "lower_end"
FARTHEST_M = 2e5
Vector3 = tuple[float, float, float]


class LowerEndTrack(HeaveTrack):
    """Track of the height of the end, with two more for east and north.

    Positions are those of the samples, in the axes of map. The end begins at rest where the scene
    fixes it, so that the first sample must lie there too, as far as its speed allows.
    """

    def __init__(self, scene: Scene) -> None:
        super().__init__(FARTHEST_M, VELOCITY_LIMIT_M_PER_S, NAME, NAME)
        place = scene.ropes[0].fixed_at_m
        assert place is not None, "a rule of scenes"
        self._place: Vector3 = place
        self._aside = (self._follower(), self._follower())
        self._newest: tuple[int, Vector3] = (0, place)
        self._borders: list[tuple[int, Vector3, Vector3]] = []  # of the steps that were prescribed

    @staticmethod
    def _follower() -> HeaveTrack:
        return HeaveTrack(FARTHEST_M, VELOCITY_LIMIT_M_PER_S, NAME, NAME)

    def invalidate(self) -> None:
        """Invalidate samples that were known in advance, as the sender was interrupted."""
        super().invalidate()
        for track in self._aside:
            track.invalidate()

    def offer_place(self, stamp_ns: int, place_m: Vector3, velocity_m_per_s: Vector3) -> str:
        """Submit position and velocity at a time; return "" or the reason for the rejection."""
        refuse = self.counter.refuse
        if not all(math.isfinite(one) for one in (*place_m, *velocity_m_per_s)):
            what = f"position {place_m} m, velocity {velocity_m_per_s} m/s"
            return refuse("non_finite", phrase(NAME, what, "all must be finite numbers"))
        speed = math.hypot(*velocity_m_per_s)
        if speed > VELOCITY_LIMIT_M_PER_S:
            right = f"give at most {VELOCITY_LIMIT_M_PER_S:g} m/s"
            return refuse("impossible", phrase(NAME, f"a speed of {speed:.1f} m/s", right))
        before_ns, before = self._newest
        seconds = (stamp_ns - before_ns) * 1e-9
        if not self._in_doubt and seconds * 1e9 <= JUMP_WINDOW_NS:
            jump = math.dist(place_m, before)
            if jump > VELOCITY_LIMIT_M_PER_S * max(seconds, 0.0) + JUMP_M:
                what = f"it jumps by {jump:.2f} m to {place_m} m within {seconds:.3f} s"
                right = f"it begins at {self._place} m and moves by {VELOCITY_LIMIT_M_PER_S:g} m/s"
                return refuse("impossible", phrase(NAME, what, right))
        moved = [a - b for a, b in zip(place_m, self._place, strict=True)]
        fault = self.offer(stamp_ns, moved[2], velocity_m_per_s[2])
        if not fault:
            for track, at, rate in zip(self._aside, moved, velocity_m_per_s, strict=False):
                track.offer(stamp_ns, at, rate)
            self._newest = stamp_ns, place_m
        return fault

    def place_at(self, time_ns: int) -> tuple[Vector3, Vector3]:
        """Return position [m] and velocity [m/s] at a time, called with rising times."""
        (x, u), (y, v), (z, w) = (track.at(time_ns) for track in (*self._aside, self))
        a, b, c = self._place
        return (a + x, b + y, c + z), (u, v, w)

    def prescribe(self, effects: Sequence[Any], time_ns: int, step_ns: int, steps: int) -> None:
        """Write the motion over the next steps to the end among a rope's effects."""
        end = led_of(effects)
        assert isinstance(end, LedEnd), "a scene that lets its end be led has one"
        known = {at: (place, rate) for at, place, rate in self._borders}
        self._borders = []
        for row in range(steps + 1):
            at = time_ns + row * step_ns
            place, rate = known[at] if at in known else self.place_at(at)
            self._borders.append((at, place, rate))
            end.value[row], end.rate[row] = place, rate
        end.clock[:] = time_ns * 1e-9, step_ns * 1e-9

    def health(self, now_ns: int) -> InputHealth:
        """Return the health of the input."""
        return self.counter.health(now_ns, self.stale(now_ns))
