"""Plain rules on measured samples, before any statistics: stuck sensors and a lost payload.

Stuck: a sensor repeats its value for REPEATED_S while what it measures cannot stand still. Load pin
and motion sensor always move (noise, the sea); a repeat is ordinary where their resolution is
coarse, so the time is at least twice the longest repeat of the last minutes that ended by itself.
A winch stands still often: its encoder is stuck if it repeats while the line must have moved, by
the speed before (which the winch's acceleration limit lets fall only so fast) or by the twin's own.

Payload lost: the mean of the measured tension over LOST_S is below the weight of the rope and half
the payload, and that below the predicted mean by more than a quarter of the payload: in a storm the
waves unload the rope as deeply, but in the prediction too.
"""

from __future__ import annotations

import math
from collections import deque

REPEATED_S = 1.0
LEAST_REPEATS = 5  # samples: a slow sensor has not repeated after two
ORDINARY_S = 600.0  # repeats of the last ten minutes are ordinary
ORDINARY_FACTOR = 2.0
STARTING_S, STARTING_LIMIT_S = 60.0, 5.0  # until ordinary repeats are known
LOST_S = 2.0
LEAST_SAMPLES = 8  # of the mean
MOVED = 3.0  # resolutions of the encoder
COARSE_M = 0.01  # resolution that an encoder has at least
SPEED_S = 0.5  # over which the speed before a repeat is taken


class RepeatedSample:
    """Length of the present run of equal samples of one sensor."""

    def __init__(self) -> None:
        self._value = math.nan
        self._since_s = self._now_s = 0.0
        self._count = 0
        self._ended: deque[tuple[float, float]] = deque()  # end and length of runs that ended
        self._begun_s = math.nan
        self._changed = False  # a sensor that has not begun to move is not stuck

    def take(self, time_s: float, value: float) -> None:
        """Take a sample; one that is not finite is missing."""
        if not math.isfinite(value):
            return
        if value == self._value:
            self._count += 1
        else:
            if self._count >= LEAST_REPEATS:
                self._end(self._now_s)
            self._changed |= not math.isnan(self._value)
            self._value, self._since_s, self._count = value, time_s, 1
        if math.isnan(self._begun_s):
            self._begun_s = time_s
        self._now_s = time_s
        while self._ended and self._ended[0][0] < time_s - ORDINARY_S:
            self._ended.popleft()

    def _end(self, time_s: float) -> None:
        """Keep a run that ended; of a stuck sensor, or before it moved, it is no ordinary one."""
        if self._changed and not self.stuck:
            self._ended.append((time_s, time_s - self._since_s))

    @property
    def since_s(self) -> float:
        """Return the time of the first of the equal samples."""
        return self._since_s

    @property
    def length_s(self) -> float:
        """Return the time from the first to the last of the equal samples."""
        return self._now_s - self._since_s

    @property
    def limit_s(self) -> float:
        """Return the length from which on the sensor is stuck."""
        longest = max((length for _, length in self._ended), default=0.0)
        starting = self._since_s - self._begun_s < STARTING_S
        return max(STARTING_LIMIT_S if starting else REPEATED_S, ORDINARY_FACTOR * longest)

    @property
    def stuck(self) -> bool:
        """Return whether the sensor repeats its value for too long, after it had another one."""
        if not self._changed or self._count < LEAST_REPEATS:
            return False
        return self.length_s >= self.limit_s - 1e-9


class StuckEncoder:
    """Line out that repeats while the line must have moved."""

    def __init__(self, acceleration_limit_m_per_s2: float, resolution_m: float) -> None:
        """Take the largest deceleration of the winch, and the resolution of the line out [m]."""
        self._limit = acceleration_limit_m_per_s2
        self._resolution_m = max(resolution_m, COARSE_M)
        self._repeat = RepeatedSample()
        self._recent: deque[tuple[float, float]] = deque()  # the last SPEED_S before the repeat
        self._speed = 0.0  # before the repeat [m/s]
        self._moved_m = 0.0  # by the twin's own speed since the repeat began
        self._at_s = math.nan

    def take(self, time_s: float, line_out_m: float, twin_speed_m_per_s: float = math.nan) -> None:
        """Take a sample, with the twin's line speed if it does not follow the measured one."""
        if not math.isfinite(line_out_m):
            return
        recent = self._recent
        if recent and line_out_m != recent[-1][1]:
            self._moved_m = 0.0
            recent.append((time_s, line_out_m))
            while recent[0][0] < time_s - SPEED_S and len(recent) > 2:
                recent.popleft()
            (first_s, first_m), (last_s, last_m) = recent[0], recent[-1]
            self._speed = (last_m - first_m) / (last_s - first_s) if last_s > first_s else 0.0
        elif not recent:
            recent.append((time_s, line_out_m))
        elif math.isfinite(twin_speed_m_per_s) and math.isfinite(self._at_s):
            self._moved_m += twin_speed_m_per_s * (time_s - self._at_s)
        self._repeat.take(time_s, line_out_m)
        self._at_s = time_s

    @property
    def since_s(self) -> float:
        """Return the time of the first of the equal samples."""
        return self._repeat.since_s

    @property
    def stuck(self) -> bool:
        """Return whether it repeats for REPEATED_S while the line moved by MOVED resolutions."""
        held_s = self._repeat.length_s
        if held_s < REPEATED_S - 1e-9:
            return False
        # at the end of those SPEED_S the line may have been slower than over them
        slower = 0.5 * self._limit * SPEED_S + self._resolution_m / SPEED_S
        speed, least = max(abs(self._speed) - slower, 0.0), MOVED * self._resolution_m
        stopping_s = speed / self._limit if self._limit > 0.0 else 0.0
        ran_s = min(held_s, stopping_s)
        ran_m = ran_s * (speed - 0.5 * self._limit * ran_s)
        return ran_m > least or abs(self._moved_m) > least


class LostPayload:
    """Mean tension of the last seconds against the weight of the rope and half the payload."""

    def __init__(self) -> None:
        self._samples: deque[tuple[float, float, float]] = deque()
        self._begun_s: float | None = None

    def take(
        self, time_s: float, measured_n: float, predicted_n: float, rope_n: float, payload_n: float
    ) -> float | None:
        """Take means of the same interval; return since when the payload is gone, or None.

        measured_n, predicted_n: NaN: missing; rope_n, payload_n: submerged weight of the rope that
        is out and of the payload [N].
        """
        if math.isfinite(measured_n) and math.isfinite(predicted_n):
            self._samples.append((time_s, measured_n, predicted_n))
        while self._samples and self._samples[0][0] <= time_s - LOST_S:
            self._samples.popleft()
        n = len(self._samples)
        if n < LEAST_SAMPLES:
            return None
        measured = sum(one[1] for one in self._samples) / n
        predicted = sum(one[2] for one in self._samples) / n
        limit_n = rope_n + 0.5 * payload_n
        if measured < min(limit_n, predicted - 0.25 * payload_n):
            if self._begun_s is None:
                self._begun_s = self._first_below(limit_n)
            return self._begun_s
        self._begun_s = None
        return None

    def _first_below(self, limit_n: float) -> float:
        """Return the time of the oldest sample from which on all are below the limit."""
        begun_s = self._samples[-1][0]
        for time_s, measured_n, _ in reversed(self._samples):
            if measured_n >= limit_n:
                break
            begun_s = time_s
        return begun_s
