"""How far the present top tension may be from the converged one: a companion rope beside the rope.

The companion has half the elements and twice the step, and the same hang-off, line out and current
to the bit. Elements and step are both of second order, so where the motion is smooth its tension
differs from the rope's by three times the rope's error (Richardson 1911), in space and in time
together, at a quarter of the rope's work. What the difference says elsewhere: `twin.error_bound`.
"""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path
from typing import Any, Self

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.bed import Grid, Plane, clearance
from rope_twin.core.state import Boundary, Floats, Rope
from rope_twin.core.statics.equilibrium import settle
from rope_twin.core.step import advance
from rope_twin.errors import SceneError, StateError, phrase
from rope_twin.scene.rules.body import refuse_body
from rope_twin.scene.rules.rigging import refuse_joined
from rope_twin.scene.rules.shedding import refuse_shedding
from rope_twin.scene.schema import Scene
from rope_twin.twin.accuracy.error_bound import EVERY, ErrorBand, acceleration_jumps, border_before
from rope_twin.twin.accuracy.regrid import HangOff, coarser
from rope_twin.twin.accuracy.rung import Rung
from rope_twin.twin.accuracy.surface_layer import error_per_difference
from rope_twin.twin.ensemble.borders import foreseen
from rope_twin.twin.findings import TensionBand
from rope_twin.twin.saving.saved_state import SavedState
from rope_twin.twin.snapshot import Snapshot
from rope_twin.twin.stepped import STEPS_PER_CALL
from rope_twin.twin.twin import Twin

Bed = Plane | Grid

SETTLING_S = 20.0  # so long a companion that was made on the way knows nothing yet
SOFTEST = 1e-9  # N/m, in place of a slack element's stiffness of 0
_PLACE = slice(rows.POSITION, rows.POSITION + 3)
LOOK_S = 0.1  # between two looks along the rope for slack elements and at the bed


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


class BandedTwin(Twin):
    """A twin with a companion and a band around its top tension: the same run to the bit.

    A saved state does not hold the companion; a restored twin makes a new one.
    """

    def __init__(self, scene: Scene) -> None:
        refuse_band(scene)
        super().__init__(scene)
        self._rest_n = float(self._pull[rows.PULL])
        self._band_s = 0.0  # time spent on it
        self._open_band(resting=True)

    @classmethod
    def restore(cls, saved: str | Path | SavedState, scene: Scene) -> Self:
        """As for a twin."""
        twin = super().restore(saved, scene)
        if twin.cut is not None:
            what = "its rope was cut, which an error band's companion cannot follow"
            raise StateError(phrase("saved state", what, "go on without an error band"))
        twin._open_band(resting=False)
        return twin

    def offer_cut(self, stamp_ns: int | None, below_m: float, rope: str = "") -> str:
        """Refused: the companion cannot follow."""
        right = "cut it in a run without an error band"
        return phrase("cut", "the error band's companion rope cannot be cut with it", right)

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
        self._before = border_before(value, rate, self.step_s)
        self._band = ErrorBand(self._rest_n, self.step_s, error_per_difference(self._rope))
        self._elements = int(self._rope.state.counts[rows.ELEMENTS])
        self._bed = bed_below(self._rope)
        self._lying = 0 if self._bed is None else nodes_on(self._bed, self._rope)
        self._look_s = 0.0  # when to look for slack elements again
        settled = self._companion.rests
        self._known_from_s = 0.0 if settled else self.time_ns * 1e-9 + SETTLING_S

    def _changing(self) -> dict[str, Any]:
        own = ("_rest_n", "_band_s", "_companion", "_band", "_before", "_known_from_s",
               "_look_s", "_elements", "_bed", "_lying")  # fmt: skip
        return {name: value for name, value in super()._changing().items() if name not in own}

    def _forget_borders(self, done: int) -> None:
        """Let the companion follow while the borders of the steps just done are still there."""
        if self._winch.feels(self.time_ns):  # of an order just given: line out depends on the error
            self._known_from_s = max(self._known_from_s, self.time_ns * 1e-9 + SETTLING_S)
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
        value, rate = (table[: done + 1] for table in self._boundary)
        jumps = acceleration_jumps(self._before, value, rate, h)
        self._before = value[done - 1].tolist(), rate[done - 1].tolist()
        for k, jump in enumerate(jumps):
            at_s = now_s - (done - 1 - k) * h
            band.take(at_s, jump, own[k])
            turn, between = divmod(waiting + k + 1, EVERY)
            if not between:
                band.compare(at_s, abs(followed[turn - 1] - own[k]))
        if int(self._rope.state.counts[rows.ELEMENTS]) != self._elements:
            self._elements = int(self._rope.state.counts[rows.ELEMENTS])
            band.kick(now_s, offset_pull_n(self._rope))
        if now_s >= self._look_s:
            self._look_s = now_s + LOOK_S
            if not self._tension.min() > 0.0:
                band.slacken(now_s)
            if self._bed is not None:
                self._look_at_bed(self._bed, now_s)

    def _look_at_bed(self, bed: Bed, now_s: float) -> None:
        """An end that is made fast there does not land, but the rope above it is laid down."""
        if self._rope.model.first_free == 0:
            if touches(bed, self._rope):
                self._band.touch(now_s)
            return
        before, self._lying = self._lying, nodes_on(bed, self._rope)
        if self._lying > before:
            self._band.lay(now_s)


def refuse_band(scene: Scene) -> None:
    """Say so if a companion cannot tell the error of such a scene.

    Raises:
        SceneError: ropes that meet, a rigid body, vortices, or a winch that answers to the tension.
    """
    refuse_joined(scene, "an error band")
    refuse_body(scene, "a companion on half the elements would swing it by itself")
    refuse_shedding(scene, "a companion on half the elements cannot tell of vortices")
    if not foreseen(scene.winch, None):
        what = "its drive, brake, or an order by depth or tension answers to the tension"
        right = "the companion's line out is the rope's; run such a scene without a band"
        raise SceneError(phrase(f"{scene.path}: winch", what, right))


def offset_pull_n(rope: Rope) -> float:
    """What the length offsets of events pull [N]: their sum times the whole rope's stiffness."""
    n = int(rope.state.counts[rows.ELEMENTS])
    yielding = 1.0 / np.maximum(rope.work[rows.STIFFNESS, :n], SOFTEST)
    return float(np.abs(rope.state.offset[:n]).sum() / yielding.sum())


def bed_below(rope: Rope) -> Bed | None:
    """The scene's seabed."""
    return next((effect for effect in rope.effects if isinstance(effect, Plane | Grid)), None)


def nodes_on(bed: Bed, rope: Rope) -> int:
    """How many of the nodes below the hang-off lie on the bed."""
    n = int(rope.state.counts[rows.ELEMENTS])
    return int(np.count_nonzero(clearance(bed, rope.state.nodes[_PLACE, :n]) <= 0.0))


def touches(bed: Bed, rope: Rope) -> bool:
    """The lower end stands on the bed."""
    return bool(clearance(bed, rope.state.nodes[_PLACE, :1])[0] <= 0.0)
