"""Bound on a rope's error from its difference to the coarse solution.

For smooth motion the difference is three times the rope's error (Richardson 1911), but it passes
through zero, so its maximum over a window counts. A third is known to be wrong in these cases, each
with a rule of its own:

- The coarse error is in phase with the rope's, and a common part of both does not appear in the
  difference: after an impact (a wave on the bed of the wave zone, a landing, a section that passes
  the sheave) both ring, and the difference decays sooner than the error. The error decays no faster
  than the motion: the mean difference, taken as the amplitude of a sine, decays with FADE_S.
- A split or merge in the rope alone excites ringing. Its length offsets times the stiffness of the
  whole rope measure the impulse, limited to half of the ringing present.
- Once an element was slack, the tension close to zero or the bed touched, the error is of first
  order in the element length, and the rope rings with it for long: the difference itself is taken,
  and once the rope stays taut its decaying mean.
- Where a sling of a rigid body was slack or the body on its deck, the load came onto the rope by
  springs below a hook that has mass. The rope's lower end feels a force without jumps, whose rate
  jumps: its velocity jumps in its second derivative only, and a scheme of second order has an error
  of the power 5/3 of the element length there (Brenner, Thomee and Wahlbin 1975, 2.5 derivatives in
  the mean square). So the error is 0.46 of the difference where both impacts are alike; SPRUNG
  allows for those that are not. A rope that is slack while no sling pulls has no load: its response
  meanwhile does not enter.
- Where an anchored rope lays a node down on the bed, it rings for some seconds, and so does the
  coarse solution when one of its own nodes lands: the difference itself is taken meanwhile.
- While the payload stands on the bed the rope above it lies in loops that elements barely resolve.
  Their error shows when they are drawn straight: the water holds the rope's sag meanwhile, so the
  difference of the last seconds counts, not that of the last moment.
- A rope whose own tension is close to zero hangs in loops that no mesh resolves: its error is taken
  as the tension itself, and at least a hundredth of the static tension, since the remainder of a
  snap load travels up and down in it.
- A motion given in samples has a kink at each of them: its acceleration jumps, and the first step
  afterwards has a larger error than the next ones. That step has a safety factor of its own; the
  others are not judged by coarse steps across such a kink.
- Where the current jumps between two layers the error is of first order, too, and follows the
  elements as they pass the jump (`error_fraction`): the difference itself is taken, over a longer
  time.
- A winch that responds to the tension uses that of one step for its next: an error of first order
  in the step, and the difference itself is taken.
- Where a loosely coupled VIV model amplifies the coarse drag by other modes, the difference itself
  is taken (`divergence`).
- Self-excited vortices drift in phase without bound, and do not ring: `phase_drift`.
- Waves that decay within an element load the rope with an error of first order: the error is then
  as large as the difference. The correction to a third follows from the waves alone
  (`error_fraction`).

The safety factors were fitted on the shipped scenes against converged references, the same for all,
and are tested there: `python -m benchmarks band`.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable

from rope_twin.core import state as rows
from rope_twin.core.state import Floats
from rope_twin.twin.accuracy.divergence import DIVERGED_S, diverged_fraction

WINDOW_S, SHORT_S, ROUGH_WINDOW_S, SLACK_WINDOW_S = 0.5, 0.2, 0.4, 0.1
THIRD = 1.0 / 3.0  # Richardson's factor for errors of second order
SMOOTH = 1.11  # times the error that the difference implies
LEFT, BENT, ROUGH = 0.13, 0.85, 1.14  # times the difference
SINE = 0.5 * math.pi  # amplitude of a sine over its mean magnitude
RINGS = 1.29 * SINE  # times the mean error that the difference implies
ROUGHLY_RINGS = 0.9  # times the mean difference
SPRUNG = 0.6  # of both, where the load came on or off by slings or a deck
MEAN_S, FADE_S = 4.0, 11.0
KICK, KICK_MOST = 6.0, 0.5 * SINE  # times the force of an event's offsets; of the mean difference
LOOSE, LOOSE_LEAST = 0.04, 0.01  # of the static tension: less is that of a rope in loops
BEND = 0.05  # of the largest jump of acceleration in the window: a larger one is a kink
ROUGH_S = 120.0  # duration of the ringing after an element was slack
TAUT_S = 3.0  # time without slack after which no new snap load comes and the last one rings out
LAID_S = 3.0  # duration of the effect of a landing at the top
EVERY = 2  # steps of the rope per step of the coarse solution

Border = tuple[list[float], list[float]]  # prescribed hang-off x, y, z and payout; their rates


class Recent:
    """Maximum of a series over a sliding window."""

    def __init__(self, window_s: float) -> None:
        self._window_s = window_s
        self._kept: deque[tuple[float, float]] = deque()  # (time, value), values falling

    def take(self, time_s: float, value: float) -> None:
        """Add a value."""
        while self._kept and self._kept[-1][1] <= value:
            self._kept.pop()
        self._kept.append((time_s, value))

    def largest(self, time_s: float) -> float:
        """Return the maximum over the window that ends now; 0 if it is empty."""
        while self._kept and self._kept[0][0] <= time_s - self._window_s:
            self._kept.popleft()
        return self._kept[0][1] if self._kept else 0.0


class Fading:
    """A value that decays exponentially with the time constant FADE_S unless it is raised."""

    def __init__(self) -> None:
        self._then_s, self._value = 0.0, 0.0

    def now(self, time_s: float) -> float:
        """Return the value at this time."""
        return self._value * math.exp((self._then_s - time_s) / FADE_S)

    def raise_to(self, time_s: float, value: float) -> None:
        """Raise the value to at least this."""
        if value > self.now(time_s):
            self._then_s, self._value = time_s, value

    def add(self, time_s: float, value: float) -> None:
        """Increase the value by this."""
        self._then_s, self._value = time_s, self.now(time_s) + value


class ErrorBound:
    """Bound on the error of a rope's top tension from its difference to the coarse solution."""

    def __init__(
        self,
        rest_n: float,
        step_s: float,
        share: float = THIRD,
        whole_s: float = 0.0,
        rings: float = RINGS,
        unloaded: Callable[[], bool] = lambda: False,
    ) -> None:
        """Start without differences.

        rest_n: static tension of the rope [N]; step_s: its time step [s]; share: fraction of the
        difference that is the error for smooth motion; whole_s: time for which the full difference
        counts [s]; rings: factor on that error for ringing; unloaded: whether the load hangs in
        slings and none is taut now.
        """
        self._whole = Recent(whole_s)
        self._counts_whole = whole_s > 0.0
        self._share, self._rings_most = share, rings
        self._smooth, self._rings = SMOOTH * share, rings * share
        self._diverged = Recent(DIVERGED_S)
        self._loose_n, self._least_n = LOOSE * rest_n, LOOSE_LEAST * rest_n
        self._weight = min(EVERY * step_s / MEAN_S, 1.0)  # of a new difference in a mean
        self._all, self._unbent = Recent(WINDOW_S), Recent(SHORT_S)  # differences
        self._rough, self._kept = Recent(ROUGH_WINDOW_S), Recent(LAID_S)
        self._mean, self._rough_mean = 0.0, 0.0
        self._ringing, self._rough_ringing, self._kicked = Fading(), Fading(), Fading()
        self._jumps, self._tension = Recent(WINDOW_S), Recent(SLACK_WINDOW_S)
        self._bent: deque[bool] = deque(maxlen=EVERY)  # whether the newest steps had a kink
        self._sprung = max(SPRUNG, share)
        self._unloaded = unloaded
        self._rough_until_s, self._slack_s, self._laid_until_s = 0.0, -math.inf, 0.0
        self._stood_until_s = self._sprung_until_s = 0.0
        self._now_n = rest_n

    def take(self, time_s: float, jump: float, tension_n: float) -> None:
        """Take a step to `time_s`: jump of acceleration at its start, and its top tension [N]."""
        self._jumps.take(time_s, jump)
        self._bent.append(jump > BEND * self._jumps.largest(time_s))
        self._now_n = tension_n
        if tension_n < self._loose_n:
            self._tension.take(time_s, tension_n)
            self.slacken(time_s)

    def compare(self, time_s: float, difference_n: float) -> None:
        """Take the difference to the coarse solution at the newest step [N]."""
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
        """Report a slack element of the rope: the error is of first order from now on."""
        if self._unloaded():
            self.loosen(time_s)
            return
        self._slack_s = time_s
        self._rough_until_s = time_s + ROUGH_S

    def loosen(self, time_s: float) -> None:
        """Report a slack sling of the body below: its load comes back as on a spring."""
        self._slack_s = time_s
        self._sprung_until_s = time_s + ROUGH_S

    def stand_on_deck(self, time_s: float) -> None:
        """Report that the body below stands on its deck, which acts as a spring."""
        self._sprung_until_s = time_s + ROUGH_S

    def touch(self, time_s: float) -> None:
        """Report that the lower end stands on the bed: an error of first order.

        The rope keeps the effect for some seconds.
        """
        self._rough_until_s = time_s + ROUGH_S
        self._stood_until_s = time_s + LAID_S

    def diverge(self, time_s: float, by: float) -> None:
        """Report the relative difference of the drag amplified by a loosely coupled VIV model."""
        self._diverged.take(time_s, by)
        share = diverged_fraction(self._share, self._diverged.largest(time_s))
        self._smooth, self._rings = SMOOTH * share, self._rings_most * share

    def answer(self, time_s: float) -> None:
        """Report that the payout responds to the tension: an error of first order in the step."""
        self._rough_until_s = time_s + ROUGH_S

    def lay(self, time_s: float) -> None:
        """Report that a node of the rope has come down on the bed."""
        self._laid_until_s = time_s + LAID_S

    def kick(self, time_s: float, pull_n: float) -> None:
        """Report the force of the length offsets that an event gave the rope [N]."""
        self._kicked.add(time_s, min(KICK * pull_n, KICK_MOST * self._mean))

    def bound_n(self, time_s: float) -> float:
        """Return the 95 % bound on the error of the newest step's tension [N]."""
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
        """Return the fraction of the difference that is a first-order error; 0: second order."""
        if time_s < self._rough_until_s:
            return 1.0
        return self._sprung if time_s < self._sprung_until_s else 0.0


def acceleration_jumps(before: Border, value: Floats, rate: Floats, step_s: float) -> list[float]:
    """Jumps of the prescribed accelerations at the beginning of some steps, summed [m/s²].

    value, rate: at the step boundaries, (steps + 1, MOTIONS); before: at the boundary before those.
    A cubic holds between two boundaries, with 2·(3·(y1 - y0) - h·(2·d0 + d1))/h² at its beginning
    and 2·(h·(d0 + 2·d1) - 3·(y1 - y0))/h² at its end. (On lists: a call usually takes two steps,
    for which arrays cost ten times as much.)
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
    """Return the boundary before one at which the motion had a steady rate."""
    return (value - step_s * rate).tolist(), rate.tolist()
