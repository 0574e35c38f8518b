"""From the difference between a rope and its coarser companion to a bound on the rope's error.

Where the motion is smooth the difference is three times the rope's error (Richardson 1911), but it
passes through zero, so the largest of a window counts. That a third is right is known to fail, and
each failure has a rule of its own:

- The companion's error is in step with the rope's, and what both have may grow alike in the
  difference's shadow: after a blow (a wave on the bed of the wave zone, a landing, a section that
  passes the sheave) both ring, and the difference dies sooner than the error. A rope forgets no
  sooner than its motion fades: the mean difference, read as the amplitude of a sine, fades with
  FADE_S and no faster.
- A split or merge in the rope alone moves what rings. Its length offsets times the stiffness of the
  whole rope tell how hard it was; it cannot move more than there is, half of the ringing.
- Once an element was slack, the tension next to nothing or the bed touched, the error falls in
  proportion to the elements' length, not to its square, and the rope rings with it for long: the
  difference itself is taken, and once the rope stays taut its fading mean.
- A rope whose own tension is next to nothing hangs in loops that no grid resolves: its error is
  taken to be as large as the tension, and a hundredth of the tension at rest at least, since what
  is left of a snap runs up and down in it.
- A motion that comes in samples bends at each of them: its acceleration jumps, and the first step
  afterwards is wrong by more than the next ones. That step has a safety of its own; the others are
  not judged by the companion's steps over such a bend.

The safeties were found on the shipped scenes against converged references, the same for all, and
are tested there: `rope_twin bench band`.
"""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.state import Boundary

WINDOW_S, SHORT_S, ROUGH_WINDOW_S, SLACK_WINDOW_S = 0.5, 0.2, 0.4, 0.1
SMOOTH, LEFT, BENT, ROUGH = 0.37, 0.16, 0.85, 1.14  # times the difference; a third is Richardson's
SINE = 0.5 * math.pi  # amplitude of a sine over its mean magnitude
RINGS, ROUGHLY_RINGS = 0.43 * SINE, 0.9  # times the mean difference
MEAN_S, FADE_S = 4.0, 11.0
KICK, KICK_MOST = 6.0, 0.5 * SINE  # times what an event's offsets pull; of the mean difference
LOOSE, LOOSE_LEAST = 0.04, 0.01  # of the tension at rest: less is that of a rope in loops
BEND = 0.05  # of the largest jump of acceleration in the window: a larger one is a bend
ROUGH_S = 120.0  # after an element was slack, the rope rings so long
TAUT_S = 3.0  # no element slack for so long: no new snap, what is left of the last one rings
EVERY = 2  # of the rope's steps make one of the companion's

Borders = tuple[list[float], list[float]]  # of hang-off x, y, z and line out, at begin and end


class Recent:
    """The largest of a series over a time just past."""

    def __init__(self, window_s: float) -> None:
        self._window_s = window_s
        self._kept: deque[tuple[float, float]] = deque()  # falling values, rising times

    def take(self, time_s: float, value: float) -> None:
        """Add a value."""
        while self._kept and self._kept[-1][1] <= value:
            self._kept.pop()
        self._kept.append((time_s, value))

    def largest(self, time_s: float) -> float:
        """Of the window that ends now; 0 if it is empty."""
        while self._kept and self._kept[0][0] <= time_s - self._window_s:
            self._kept.popleft()
        return self._kept[0][1] if self._kept else 0.0


class Fading:
    """A value that falls by the factor e in FADE_S unless it is raised."""

    def __init__(self) -> None:
        self._then_s, self._value = 0.0, 0.0

    def now(self, time_s: float) -> float:
        """What is left of it."""
        return self._value * math.exp((self._then_s - time_s) / FADE_S)

    def raise_to(self, time_s: float, value: float) -> None:
        """It is as large as this at least."""
        if value > self.now(time_s):
            self._then_s, self._value = time_s, value

    def add(self, time_s: float, value: float) -> None:
        """It is larger by this."""
        self._then_s, self._value = time_s, self.now(time_s) + value


class ErrorBand:
    """From the difference to the companion to a bound on the error of the top tension."""

    def __init__(self, rest_n: float, step_s: float) -> None:
        """`rest_n`: the tension of the rope at rest; `step_s`: its step."""
        self._loose_n, self._least_n = LOOSE * rest_n, LOOSE_LEAST * rest_n
        self._weight = min(EVERY * step_s / MEAN_S, 1.0)  # of a difference in a mean
        self._all, self._unbent = Recent(WINDOW_S), Recent(SHORT_S)  # differences
        self._rough = Recent(ROUGH_WINDOW_S)
        self._mean, self._rough_mean = 0.0, 0.0
        self._ringing, self._rough_ringing, self._kicked = Fading(), Fading(), Fading()
        self._jumps, self._tension = Recent(WINDOW_S), Recent(SLACK_WINDOW_S)
        self._end = [0.0] * rows.MOTIONS  # accelerations at the newest step's end
        self._bent: deque[bool] = deque(maxlen=EVERY)  # of the newest steps
        self._rough_until_s, self._slack_s = 0.0, -math.inf
        self._now_n = rest_n

    def take(self, time_s: float, accelerations: Borders, tension_n: float) -> None:
        """A step to `time_s` with these prescribed accelerations gave this top tension."""
        begin, end = accelerations
        jump = sum(abs(a - b) for a, b in zip(begin, self._end, strict=True))
        self._end = end
        self._jumps.take(time_s, jump)
        self._bent.append(jump > BEND * self._jumps.largest(time_s))
        self._now_n = tension_n
        if tension_n < self._loose_n:
            self._tension.take(time_s, tension_n)
            self.slacken(time_s)

    def compare(self, time_s: float, difference_n: float) -> None:
        """At the newest step the companion's tension differs by this much."""
        self._all.take(time_s, difference_n)
        self._rough.take(time_s, difference_n)
        if time_s < self._rough_until_s and self._now_n >= self._loose_n:
            self._rough_mean += self._weight * (difference_n - self._rough_mean)
            self._rough_ringing.raise_to(time_s, ROUGHLY_RINGS * self._rough_mean)
        if True not in self._bent:
            self._unbent.take(time_s, difference_n)
            self._mean += self._weight * (difference_n - self._mean)
            self._ringing.raise_to(time_s, RINGS * self._mean)

    def slacken(self, time_s: float) -> None:
        """An element of the rope is slack."""
        self._slack_s = time_s
        self.touch(time_s)

    def touch(self, time_s: float) -> None:
        """Something happens that no grid resolves: the error is of first order from now on."""
        self._rough_until_s = time_s + ROUGH_S

    def kick(self, time_s: float, pull_n: float) -> None:
        """An event gave the rope length offsets that pull so much."""
        self._kicked.add(time_s, min(KICK * pull_n, KICK_MOST * self._mean))

    def bound_n(self, time_s: float) -> float:
        """The tension of the newest step is at most this wrong, 95 % of the time."""
        return self._bound_n(time_s) + self._kicked.now(time_s)

    def _bound_n(self, time_s: float) -> float:
        if self._now_n < self._loose_n:
            return max(self._tension.largest(time_s), self._least_n)
        if time_s < self._rough_until_s:
            taut = time_s - self._slack_s > TAUT_S
            rings = self._rough_ringing.now(time_s) if taut else 0.0
            return max(ROUGH * self._rough.largest(time_s), rings)
        largest = self._all.largest(time_s)
        unbent = 0.0 if self._bent and self._bent[-1] else self._unbent.largest(time_s)
        bound = max(SMOOTH * unbent, LEFT * largest) if unbent > 0.0 else BENT * largest
        return max(bound, self._ringing.now(time_s))


def border_accelerations(boundary: Boundary, steps: int, step_s: float) -> list[Borders]:
    """Accelerations of hang-off and line out at the begin and end of each step, of its cubic."""
    value, rate = boundary.value[: steps + 1], boundary.rate[: steps + 1]
    way = 3.0 * np.diff(value, axis=0)
    begin = way - step_s * (2.0 * rate[:-1] + rate[1:])
    end = step_s * (rate[:-1] + 2.0 * rate[1:]) - way
    scale = 2.0 / step_s**2
    return list(zip((scale * begin).tolist(), (scale * end).tolist(), strict=True))
