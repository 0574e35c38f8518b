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
- Where a sling of a rigid body was slack or the body on its deck, the load came onto the rope by
  springs below a hook that has mass. The rope's lower end feels a force without jumps, whose rate
  jumps: its velocity jumps in its second derivative only, and a scheme of second order errs by the
  power 5/3 of the elements' length there (Brenner, Thomee and Wahlbin 1975, 2.5 derivatives in the
  mean square). So 0.46 of the difference is the error where both blows go alike; SPRUNG allows for
  those that do not. A rope that is slack while no sling pulls is one without its load: what it does
  meanwhile does not get into that.
- Where a rope that is made fast on the bed lays a node down there, it rings for some seconds, and
  the companion does when a node of its own lands: the difference itself is taken meanwhile.
- While the payload stands on the bed the rope above it lies in loops that elements hardly resolve.
  How wrong they are shows when they are drawn straight: the water holds the rope's sag meanwhile,
  so the difference of the last seconds counts, not that of the last moment.
- A rope whose own tension is next to nothing hangs in loops that no grid resolves: its error is
  taken to be as large as the tension, and a hundredth of the tension at rest at least, since what
  is left of a snap runs up and down in it.
- A motion that comes in samples bends at each of them: its acceleration jumps, and the first step
  afterwards is wrong by more than the next ones. That step has a safety of its own; the others are
  not judged by the companion's steps over such a bend.
- Where the current jumps between two layers the error is of first order, too, and follows the
  elements as they pass the jump (`difference`): the difference itself is taken, of some more time.
- A winch that answers to the tension takes that of one step for its next: an error of first order
  in the step, and the difference itself is taken.
- Where vortices beside the step let the companion's drag grow by other modes, the difference itself
  is taken (`grown_apart`).
- Vortices that set their own pace run out of step for good, and do not ring: `out_of_step`.
- Waves that die within an element load the rope by an error of first order: the difference is as
  large as the error then. How much of a third is wrong there follows from the waves alone
  (`surface_layer`).

The safeties were found on the shipped scenes against converged references, the same for all, and
are tested there: `python -m benchmarks band`.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable

from rope_twin.core import state as rows
from rope_twin.core.state import Floats
from rope_twin.twin.accuracy.grown_apart import REMEMBERED_S, share_where_they_differ

WINDOW_S, SHORT_S, ROUGH_WINDOW_S, SLACK_WINDOW_S = 0.5, 0.2, 0.4, 0.1
THIRD = 1.0 / 3.0  # Richardson's, of two errors of second order
SMOOTH = 1.11  # times the error that the difference tells of
LEFT, BENT, ROUGH = 0.13, 0.85, 1.14  # times the difference
SINE = 0.5 * math.pi  # amplitude of a sine over its mean magnitude
RINGS = 1.29 * SINE  # times the mean error that the difference tells of
ROUGHLY_RINGS = 0.9  # times the mean difference
SPRUNG = 0.6  # of both, where slings or a deck were what the load came on and off by
MEAN_S, FADE_S = 4.0, 11.0
KICK, KICK_MOST = 6.0, 0.5 * SINE  # times what an event's offsets pull; of the mean difference
LOOSE, LOOSE_LEAST = 0.04, 0.01  # of the tension at rest: less is that of a rope in loops
BEND = 0.05  # of the largest jump of acceleration in the window: a larger one is a bend
ROUGH_S = 120.0  # after an element was slack, the rope rings so long
TAUT_S = 3.0  # no element slack for so long: no new snap, what is left of the last one rings
LAID_S = 3.0  # so long what has come down on the bed is felt at the top
EVERY = 2  # of the rope's steps make one of the companion's

Border = tuple[list[float], list[float]]  # prescribed hang-off x, y, z and line out; their rates


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

    def __init__(
        self,
        rest_n: float,
        step_s: float,
        share: float = THIRD,
        whole_s: float = 0.0,
        rings: float = RINGS,
        unloaded: Callable[[], bool] = lambda: False,
    ) -> None:
        """`rest_n`: the tension of the rope at rest; `step_s`: its step.

        `share`: of a difference that is the rope's error where its motion is smooth; `whole_s`: for
        so long a difference counts whole; `rings`: times that error for what has rung; `unloaded`:
        whether the load hangs in slings and none of them pulls now.
        """
        self._whole = Recent(whole_s)
        self._counts_whole = whole_s > 0.0
        self._share, self._rings_most = share, rings
        self._smooth, self._rings = SMOOTH * share, rings * share
        self._grown_apart = Recent(REMEMBERED_S)
        self._loose_n, self._least_n = LOOSE * rest_n, LOOSE_LEAST * rest_n
        self._weight = min(EVERY * step_s / MEAN_S, 1.0)  # of a difference in a mean
        self._all, self._unbent = Recent(WINDOW_S), Recent(SHORT_S)  # differences
        self._rough, self._kept = Recent(ROUGH_WINDOW_S), Recent(LAID_S)
        self._mean, self._rough_mean = 0.0, 0.0
        self._ringing, self._rough_ringing, self._kicked = Fading(), Fading(), Fading()
        self._jumps, self._tension = Recent(WINDOW_S), Recent(SLACK_WINDOW_S)
        self._bent: deque[bool] = deque(maxlen=EVERY)  # of the newest steps
        self._sprung = max(SPRUNG, share)
        self._unloaded = unloaded
        self._rough_until_s, self._slack_s, self._laid_until_s = 0.0, -math.inf, 0.0
        self._stood_until_s = self._sprung_until_s = 0.0
        self._now_n = rest_n

    def take(self, time_s: float, jump: float, tension_n: float) -> None:
        """A step to `time_s`, where the acceleration jumped as it began, gave this top tension."""
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
        self._kept.take(time_s, difference_n)
        if self._counts_whole:
            self._whole.take(time_s, difference_n)
        if self._roughness(time_s) > 0.0 and self._now_n >= self._loose_n:
            self._rough_mean += self._weight * (difference_n - self._rough_mean)
            self._rough_ringing.raise_to(time_s, ROUGHLY_RINGS * self._rough_mean)
        if True not in self._bent:
            self._unbent.take(time_s, difference_n)
            self._mean += self._weight * (difference_n - self._mean)
            self._ringing.raise_to(time_s, self._rings * self._mean)

    def slacken(self, time_s: float) -> None:
        """An element of the rope is slack: the error is of first order from now on."""
        if self._unloaded():
            self.loosen(time_s)
            return
        self._slack_s = time_s
        self._rough_until_s = time_s + ROUGH_S

    def loosen(self, time_s: float) -> None:
        """A sling of the body below is slack: what it carries comes back onto it as on a spring."""
        self._slack_s = time_s
        self._sprung_until_s = time_s + ROUGH_S

    def stand_on_deck(self, time_s: float) -> None:
        """The body below stands on its deck, which is a spring, too."""
        self._sprung_until_s = time_s + ROUGH_S

    def touch(self, time_s: float) -> None:
        """The lower end stands on the bed: the same, and the rope keeps it for some seconds."""
        self._rough_until_s = time_s + ROUGH_S
        self._stood_until_s = time_s + LAID_S

    def grow_apart(self, time_s: float, by: float) -> None:
        """The drag that a model beside the step lets grow differs by this part of it."""
        self._grown_apart.take(time_s, by)
        share = share_where_they_differ(self._share, self._grown_apart.largest(time_s))
        self._smooth, self._rings = SMOOTH * share, self._rings_most * share

    def answer(self, time_s: float) -> None:
        """The line out follows from the rope's tension: its error is of first order in the step."""
        self._rough_until_s = time_s + ROUGH_S

    def lay(self, time_s: float) -> None:
        """A node of the rope has come down on the bed."""
        self._laid_until_s = time_s + LAID_S

    def kick(self, time_s: float, pull_n: float) -> None:
        """An event gave the rope length offsets that pull so much."""
        self._kicked.add(time_s, min(KICK * pull_n, KICK_MOST * self._mean))

    def bound_n(self, time_s: float) -> float:
        """The tension of the newest step is at most this wrong, 95 % of the time."""
        return max(self._bound_n(time_s), self._whole.largest(time_s)) + self._kicked.now(time_s)

    def _bound_n(self, time_s: float) -> float:
        if self._now_n < self._loose_n:
            return max(self._tension.largest(time_s), self._least_n)
        if (roughness := self._roughness(time_s)) > 0.0:
            taut = time_s - self._slack_s > TAUT_S
            rings = self._rough_ringing.now(time_s) if taut else 0.0
            recent = self._kept if time_s < self._stood_until_s else self._rough
            return roughness * max(ROUGH * recent.largest(time_s), rings)
        largest = self._all.largest(time_s)
        unbent = 0.0 if self._bent and self._bent[-1] else self._unbent.largest(time_s)
        bound = max(self._smooth * unbent, LEFT * largest) if unbent > 0.0 else BENT * largest
        laid = ROUGH * self._rough.largest(time_s) if time_s < self._laid_until_s else 0.0
        return max(bound, laid, self._ringing.now(time_s))

    def _roughness(self, time_s: float) -> float:
        """Of the difference that is the error, where that is not of second order; else 0."""
        if time_s < self._rough_until_s:
            return 1.0
        return self._sprung if time_s < self._sprung_until_s else 0.0


def acceleration_jumps(before: Border, value: Floats, rate: Floats, step_s: float) -> list[float]:
    """By how much the prescribed accelerations jump where each of some steps begins [m/s²], summed.

    value, rate: at the steps' borders, (steps + 1, MOTIONS); `before`: at the border before those.
    Between two borders a cubic holds, with 2·(3·(y1 - y0) - h·(2·d0 + d1))/h² at its begin and
    2·(h·(d0 + 2·d1) - 3·(y1 - y0))/h² at its end. (On lists: a call takes two steps as a rule, for
    which tables cost ten times as much.)
    """
    scale, h, jumps = 2.0 / step_s**2, step_s, []
    y0, d0 = before
    values, rates = value.tolist(), rate.tolist()
    y1, d1 = values[0], rates[0]
    for y2, d2 in zip(values[1:], rates[1:], strict=True):
        jump = 0.0
        for k in range(rows.MOTIONS):
            jump += abs(3.0 * (y2[k] - y0[k]) - h * (d0[k] + 4.0 * d1[k] + d2[k]))
        jumps.append(scale * jump)
        y0, d0, y1, d1 = y1, d1, y2, d2
    return jumps


def border_before(value: Floats, rate: Floats, step_s: float) -> Border:
    """The border before one at which the motion went on at a steady rate."""
    return (value - step_s * rate).tolist(), rate.tolist()
