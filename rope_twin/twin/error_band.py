"""How far the present top tension may be from the converged one: a companion rope beside the rope.

The companion has half the elements and twice the step, and the same hang-off, line out and current
to the bit. Elements and step are both of second order, so where the motion is smooth its tension
differs from the rope's by three times the rope's error (Richardson 1911), in space and in time
together, at a quarter of the rope's work. The band is that with a safety, the largest of the last
WINDOW_S since the difference passes through zero, and it knows three cases where a third is wrong:

- Once an element was slack the error falls in proportion to the elements' length, not to its
  square, and the rope rings with it for long: the difference itself is taken, with a safety.
- A rope whose own tension is next to nothing hangs in loops that no grid resolves: its error is
  taken to be as large as the tension.
- A motion that comes in samples bends at each of them: its acceleration jumps, and the first step
  afterwards is wrong by more than the next ones. That step has a safety of its own; the others are
  not judged by the companion's steps over such a bend.

The safeties were found on the shipped scenes against converged references and are tested there:
`rope_twin bench band`.
"""

from __future__ import annotations

import time
from collections import deque
from dataclasses import replace
from pathlib import Path
from typing import Any, Self

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.state import Boundary, Floats, Rope
from rope_twin.core.statics import settle
from rope_twin.core.step import advance
from rope_twin.scene.rigging_rules import refuse_joined
from rope_twin.scene.schema import Scene
from rope_twin.scene.shedding import refuse_shedding
from rope_twin.twin.regrid import HangOff, coarser
from rope_twin.twin.rung import Rung
from rope_twin.twin.saved_state import SavedState
from rope_twin.twin.snapshot import Snapshot, TensionBand
from rope_twin.twin.twin import STEPS_PER_CALL, Twin

WINDOW_S, SHORT_S, SLACK_WINDOW_S = 0.5, 0.2, 0.1
SMOOTH, LEFT, BENT, ROUGH = 0.40, 0.16, 0.85, 1.3  # times the difference; a third is Richardson's
LOOSE = 0.04  # of the tension at rest: less is that of a rope in loops
BEND = 0.05  # of the largest jump of acceleration in the window: a larger one is a bend
ROUGH_S = 120.0  # after an element was slack, the rope rings so long
SETTLING_S = 20.0  # so long a companion that was made on the way knows nothing yet
LOOK_S = 0.1  # between two looks along the rope for slack elements
EVERY = 2  # of the rope's steps make one of the companion's

Borders = tuple[float, float, float, float]  # of heave and line out, at begin and at end


class Companion:
    """The same rope on half the elements, stepped by the same code with twice the step."""

    def __init__(
        self, rope: Rope, at: HangOff, border: tuple[Floats, Floats], resting: bool
    ) -> None:
        """`border`: value and rate of the prescribed motion now; `resting`: it is to rest."""
        half = coarser(rope, at)
        self._rope = half._replace(model=half.model._replace(step=EVERY * rope.model.step))
        self.rests = resting and settle(self._rope, float(border[0][rows.LINE])).found
        room = (STEPS_PER_CALL // EVERY + 2, rows.MOTIONS)
        self._ahead = Boundary(np.zeros(room), np.zeros(room))
        self._ahead.value[0], self._ahead.rate[0] = border
        self.waiting = 0  # steps of the rope that it has not done
        self._pulls = np.zeros((STEPS_PER_CALL, rows.PULL_COLUMNS))

    def follow(
        self, boundary: Boundary, done: int, effects: Any, time_s: float
    ) -> list[float] | None:
        """Do what the rope has done, `done` steps up to `time_s`; the top tension of each step.

        None: its next state would not be finite.
        """
        first = EVERY - self.waiting  # row of the border at which its next step ends
        steps, self.waiting = divmod(self.waiting + done, EVERY)
        if steps == 0:
            return []
        value, rate = self._ahead
        value[1 : steps + 1] = boundary.value[first : done + 1 : EVERY]
        rate[1 : steps + 1] = boundary.rate[first : done + 1 : EVERY]
        if self._rope.effects is not effects:
            self._rope = self._rope._replace(effects=effects)
        step = self._rope.model.step
        start_s = time_s - (self.waiting / EVERY + steps) * step
        if advance(self._rope, self._ahead, self._pulls, start_s, steps) < steps:
            return None
        value[0], rate[0] = value[steps], rate[steps]
        tensions: list[float] = self._pulls[:steps, rows.PULL].tolist()
        return tensions


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


class ErrorBand:
    """From the difference to the companion to a bound on the error of the top tension."""

    def __init__(self, rest_n: float) -> None:
        """`rest_n`: the tension of the rope at rest."""
        self._loose_n = LOOSE * rest_n
        self._all, self._unbent = Recent(WINDOW_S), Recent(SHORT_S)  # differences
        self._jumps, self._tension = Recent(WINDOW_S), Recent(SLACK_WINDOW_S)
        self._end = (0.0, 0.0)  # accelerations at the newest step's end
        self._bent: deque[bool] = deque(maxlen=EVERY)  # of the newest steps
        self._rough_until_s = 0.0
        self._now_n = rest_n

    def take(self, time_s: float, accelerations: Borders, tension_n: float) -> None:
        """A step to `time_s` with these prescribed accelerations gave this top tension."""
        z_begin, line_begin, z_end, line_end = accelerations
        jump = abs(z_begin - self._end[0]) + abs(line_begin - self._end[1])
        self._end = (z_end, line_end)
        self._jumps.take(time_s, jump)
        self._bent.append(jump > BEND * self._jumps.largest(time_s))
        self._now_n = tension_n
        if tension_n < self._loose_n:
            self._tension.take(time_s, tension_n)

    def compare(self, time_s: float, difference_n: float) -> None:
        """At the newest step the companion's tension differs by this much."""
        self._all.take(time_s, difference_n)
        if True not in self._bent:
            self._unbent.take(time_s, difference_n)

    def slacken(self, time_s: float) -> None:
        """An element of the rope is slack."""
        self._rough_until_s = time_s + ROUGH_S

    def bound_n(self, time_s: float) -> float:
        """The tension of the newest step is at most this wrong, 95 % of the time."""
        if self._now_n < self._loose_n:
            return self._tension.largest(time_s)
        largest = self._all.largest(time_s)
        if time_s < self._rough_until_s:
            return ROUGH * largest
        unbent = 0.0 if self._bent and self._bent[-1] else self._unbent.largest(time_s)
        return max(SMOOTH * unbent, LEFT * largest) if unbent > 0.0 else BENT * largest


class BandedTwin(Twin):
    """A twin with a companion and a band around its top tension: the same run to the bit.

    A saved state does not hold the companion; a restored twin makes a new one.
    """

    def __init__(self, scene: Scene) -> None:
        refuse_joined(scene)
        refuse_shedding(scene, "a companion on half the elements cannot tell of vortices")
        super().__init__(scene)
        self._rest_n = float(self._pull[rows.PULL])
        self._band_s = 0.0  # time spent on it
        self._open_band(resting=True)

    @classmethod
    def restore(cls, saved: str | Path | SavedState, scene: Scene) -> Self:
        """As for a twin."""
        twin = super().restore(saved, scene)
        twin._open_band(resting=False)
        return twin

    def snapshot(self) -> Snapshot:
        """A frozen copy of the present with the band, once that is known."""
        taken = super().snapshot()
        at_s = taken.time_s
        if at_s < self._known_from_s:
            return taken
        bound = self._band.bound_n(at_s)
        rest = self._computing_s - self._band_s
        cost = 100.0 * self._band_s / rest if rest > 0.0 else 0.0
        low = max(taken.tension_top_n - bound, 0.0)
        return replace(taken, band=TensionBand(low, taken.tension_top_n + bound, bound, cost))

    def take_rung(self, rung: Rung) -> None:
        """As for a twin; the companion is made anew, from the rope on its new rung."""
        super().take_rung(rung)
        self._open_band(resting=False)

    def _open_band(self, resting: bool, border: int = 0) -> None:
        """A new companion of the present, whose prescribed motion is in row `border`."""
        value, rate = (table[border].copy() for table in self._boundary)
        pull = self._pulls[border - 1] if border else self._pull
        at = HangOff(pull[rows.PULL_X : rows.PULL_Z + 1].copy(), float(rate[rows.LINE]))
        self._companion = Companion(self._rope, at, (value, rate), resting)
        self._band = ErrorBand(self._rest_n)
        self._look_s = 0.0  # when to look for slack elements again
        settled = self._companion.rests
        self._known_from_s = 0.0 if settled else self.time_ns * 1e-9 + SETTLING_S

    def _changing(self) -> dict[str, Any]:
        own = ("_rest_n", "_band_s", "_companion", "_band", "_known_from_s", "_look_s")
        return {name: value for name, value in super()._changing().items() if name not in own}

    def _forget_borders(self, done: int) -> None:
        """Let the companion follow while the borders of the steps just done are still there."""
        if done:
            began = time.perf_counter()
            self._judge(done)
            self._band_s += time.perf_counter() - began
        super()._forget_borders(done)

    def _judge(self, done: int) -> None:
        now_s, h = self.time_ns * 1e-9, self.step_s
        waiting = self._companion.waiting
        followed = self._companion.follow(self._boundary, done, self._current.effects, now_s)
        if followed is None:  # it failed where the rope did not
            self._open_band(resting=False, border=done)
            return
        band, own = self._band, self._pulls[:done, rows.PULL].tolist()
        for k, accelerations in enumerate(border_accelerations(self._boundary, done, h)):
            at_s = now_s - (done - 1 - k) * h
            band.take(at_s, accelerations, own[k])
            turn, between = divmod(waiting + k + 1, EVERY)
            if not between:
                band.compare(at_s, abs(followed[turn - 1] - own[k]))
        if now_s >= self._look_s:
            self._look_s = now_s + LOOK_S
            if not self._tension.min() > 0.0:
                band.slacken(now_s)


def border_accelerations(boundary: Boundary, steps: int, step_s: float) -> list[Borders]:
    """Accelerations of heave and line out at the begin and end of each step, of its cubic."""
    value = boundary.value[: steps + 1, rows.Z :].tolist()
    rate = boundary.rate[: steps + 1, rows.Z :].tolist()
    scale, found = 2.0 / step_s**2, []
    for k in range(steps):
        (z0, line0), (z1, line1), (v0, V0), (v1, V1) = value[k], value[k + 1], rate[k], rate[k + 1]
        z, line = 3.0 * (z1 - z0), 3.0 * (line1 - line0)
        found.append(
            (
                scale * (z - step_s * (2.0 * v0 + v1)),
                scale * (line - step_s * (2.0 * V0 + V1)),
                scale * (step_s * (v0 + 2.0 * v1) - z),
                scale * (step_s * (V0 + 2.0 * V1) - line),
            )
        )
    return found
