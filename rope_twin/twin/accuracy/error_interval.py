"""Discretisation-error interval of the top tension, from a coarse solution parallel to the twin.

The coarse solution has half the elements and twice the step, with bit-identical hang-off, paid-out
length and current. Elements and step are both of second order, so for smooth motion its tension
differs from the rope's by three times the rope's error (Richardson 1911), in space and in time
together, at a quarter of the rope's work. Other cases are treated in `error_bound`.

In multi-line scenes the coarse solution covers all ropes, and each rope that hangs from the ship
has an interval. Where a winch responds to the tension the coarse solution has its own
(`CoarseWinch`). The error of a drive is of first order in the step, and longer elements may hide
it: in a scene with a drive the coarse solution has twice the step and all elements.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Self

from rope_twin.core import state as rows
from rope_twin.core.state import Boundary, Floats, Rope
from rope_twin.effects.wake_oscillator import WakeOscillator
from rope_twin.scene.schema import WINCH, Scene
from rope_twin.scene.validation.rigging import winches
from rope_twin.scene.validation.vortices import strouhal_number
from rope_twin.twin.accuracy.coarse_solution import (
    CoarseRope,
    CoarseSolution,
    CoarseSystem,
    CoarseWinch,
)
from rope_twin.twin.accuracy.divergence import drag_divergence
from rope_twin.twin.accuracy.error_bound import (
    EVERY,
    RINGS,
    Border,
    ErrorBound,
    acceleration_jumps,
    border_before,
)
from rope_twin.twin.accuracy.error_fraction import fraction_of_difference, full_difference_s
from rope_twin.twin.accuracy.event_detection import (
    Bed,
    EventDetector,
    bed_below,
    is_slack,
    nodes_on,
    touches,
)
from rope_twin.twin.accuracy.level import AccuracyLevel
from rope_twin.twin.accuracy.phase_drift import PhaseDrift
from rope_twin.twin.accuracy.regrid import HangOff
from rope_twin.twin.recovery import Checkpoint
from rope_twin.twin.results import TensionInterval
from rope_twin.twin.saving.saved_state import SavedState
from rope_twin.twin.snapshot import Snapshot
from rope_twin.twin.twin import Twin
from rope_twin.twin.winch.commands import WinchCommand
from rope_twin.twin.winch.winch import Winch

__all__ = ["SETTLING_S", "ErrorIntervalTwin", "bed_below", "nodes_on", "touches"]

SETTLING_S = 20.0  # settling time of a coarse solution that was started during a run
COMPARED_S = 1.0  # interval at which drag amplifications are compared
_OWN = (  # not in a saved state
    "_rests_n", "_band_s", "_coarse", "_tops", "_sight", "_known_from_s", "_look_s",
    "_compared_s",
)  # fmt: skip
LOOK_S = 0.1  # interval of the checks for slack elements and seabed contact


class ErrorIntervalTwin(Twin):
    """A twin with an error interval of its top tension; the run itself is bit-identical.

    A saved state does not hold the coarse solution; a restored twin makes a new one.
    """

    def __init__(self, scene: Scene) -> None:
        super().__init__(scene)
        self._rests_n = [float(one[rows.PULL]) for one in self._present_pulls()]
        self._band_s = 0.0  # CPU time of the interval
        self._open_band(resting=True)

    @classmethod
    def restore(cls, saved: str | Path | SavedState, scene: Scene) -> Self:
        """Return a twin that resumes from a saved state, with a new coarse solution."""
        twin = super().restore(saved, scene)
        if twin.cut is None:
            twin._open_band(resting=False)
        else:
            twin._close_band()
        return twin

    def offer_command(self, stamp_ns: int | None, command: WinchCommand, winch: str = WINCH) -> str:
        """Command a winch and its copy in the coarse solution; return "" or the rejection."""
        fault = super().offer_command(stamp_ns, command, winch)
        names = [WINCH, *(line.from_ for line in self.scene.ropes[1:])]
        if (
            not fault
            and (own := self._coarse.winches.get(names.index(self.winch_called(winch)))) is not None
        ):
            with self._lock:
                own.take(stamp_ns, command, self.time_ns)
        return fault

    def invalidate_inputs(self) -> None:
        """Invalidate inputs known in advance, also in the winches of the coarse solution."""
        super().invalidate_inputs()
        with self._lock:
            for own in self._coarse.winches.values():
                own.invalidate()

    def snapshot(self) -> Snapshot:
        """Return a frozen copy of the present with the interval, once it is known."""
        taken = super().snapshot()
        if no_band := self._no_band(taken.time_s):
            return replace(taken, no_band=no_band)
        rest = self._computing_s - self._band_s
        cost = 100.0 * self._band_s / rest if rest > 0.0 else 0.0
        first, *others = self._tops
        band = _around(taken.tension_top_n, first.bound_n(taken.time_s), cost)
        ropes = list(taken.ropes)
        for top in others:
            shot, bound = ropes[top.rope], top.bound_n(taken.time_s)
            ropes[top.rope] = replace(shot, band=_around(shot.tension_top_n, bound, cost))
        if ropes:
            ropes[0] = replace(ropes[0], band=band)
        return replace(taken, band=band, ropes=tuple(ropes))

    def set_level(self, level: AccuracyLevel) -> None:
        """Continue on another accuracy level with a new coarse solution."""
        super().set_level(level)
        self._open_band(resting=False)

    def return_to(self, then: Checkpoint) -> bool:
        """Return to an earlier state with a new coarse solution."""
        went = super().return_to(then)
        if self._tops:
            self._open_band(resting=False)
        return went

    @property
    def _band(self) -> ErrorBound:
        """Error estimate of the first rope."""
        return self._tops[0].band

    def _no_band(self, time_s: float) -> str:
        """Return why there is no interval now; "" if there is one."""
        if self.cut is not None:
            at = f"{self.cut.at_s:.2f} s"
            return f"unknown since the cut at {at}: no coarse solution follows a rope in parts"
        if time_s < self._known_from_s:
            known = f"{self._known_from_s:.1f} s"
            return f"unknown until {known}: its coarse solution has to settle"
        return ""

    def _cut_here(self, lost_m: float, rope: int) -> None:
        """Cut a rope and end the coarse solution."""
        super()._cut_here(lost_m, rope)
        self._close_band()

    def _close_band(self) -> None:
        """End the coarse solution."""
        self._tops.clear()
        self._coarse.winches.clear()

    def _all_ropes(self) -> tuple[Rope, ...]:
        joined = self.joined
        return (self._rope,) if joined is None else joined.system(self._rope).ropes

    def _present_pulls(self) -> list[Floats]:
        """Return the force of every rope on its upper end [N], (rows.PULL_COLUMNS,) each."""
        joined = self.joined
        return [self._pull] if joined is None else list(joined.pull)

    def _open_band(self, resting: bool, border: int = 0) -> None:
        """Start a coarse solution from the present, with boundary conditions in row `border`."""
        joined, made_fast = self.joined, [self._rope.model.first_free == 1]
        value, rate = (table[border].copy() for table in self._boundary)
        self._coarse: CoarseSolution
        halves = all(winch.drive is None for _, winch in winches(self.scene))
        if joined is None:
            pull = self._pulls[border - 1] if border else self._pull
            at = HangOff(pull[rows.PULL_X : rows.PULL_Z + 1].copy(), float(rate[rows.LINE]))
            self._coarse = CoarseRope(
                self._rope, at, (value, rate), resting, halves, self._viv_drag
            )
            now = {0: (value, rate)}
        else:
            self._coarse = half = CoarseSystem(
                joined, self._rope, self._boundary, border, resting, halves
            )
            now, made_fast = half.hang_offs, half.made_fast
        ropes = self._all_ropes()
        self._sight = EventDetector(ropes, made_fast)
        self._tops = [self._top(r, ropes[r], at_r) for r, at_r in now.items()]
        self._look_s = 0.0  # time of the next check for slack elements
        self._compared_s = self.time_ns * 1e-9
        settled = self._coarse.rests
        self._known_from_s = 0.0 if settled else self.time_ns * 1e-9 + SETTLING_S

    def _top(self, r: int, rope: Rope, now: tuple[Floats, Floats]) -> TopEstimate:
        share, rest_n = fraction_of_difference(rope, self.joined is not None), self._rests_n[r]
        vortices = None
        if any(isinstance(one, WakeOscillator) for one in rope.effects):
            pace = strouhal_number(self.scene), EVERY * self.step_s
            vortices = PhaseDrift(rest_n, *pace, self._coarse.rests)
        rings = RINGS if vortices is None else 0.0
        band = ErrorBound(
            rest_n, self.step_s, share, full_difference_s(rope), rings, self._sight.unloaded
        )
        return TopEstimate(r, band, now, self.step_s, vortices)

    def _changing(self) -> dict[str, Any]:
        return {name: value for name, value in super()._changing().items() if name not in _OWN}

    def _drop_boundaries(self, done: int) -> None:
        """Advance the coarse solution, then make the boundary after `done` steps the first one."""
        if self._tops:
            self._follow(done)
        super()._drop_boundaries(done)

    def _follow(self, done: int) -> None:
        answering = self._answering()
        if done:
            began = time.perf_counter()
            self._judge(done, bool(answering))
            self._sample_coarse_vortices(done)
            self._band_s += time.perf_counter() - began
        self._share_winches(answering)

    def _sample_coarse_vortices(self, done: int) -> None:
        """Sample the coarse solution's VIV model when the twin's own is due."""
        own = self._viv_drag
        if own is not None and own.steps_to_sampling(self._steps) == 0:
            now = Boundary(*(table[done:] for table in self._boundary))
            self._coarse.look(now, self._steps, self._current.changes)
            now_s = self.time_ns * 1e-9
            if now_s >= self._compared_s + COMPARED_S and self._tops:
                self._compared_s = now_s
                by = drag_divergence(
                    own.drag_amplification(self.rope), self._coarse.drag_amplification()
                )
                self._band.diverge(now_s, by)

    def _answering(self) -> dict[int, Winch]:
        """Return the winches that need tension feedback for the next step, by rope number."""
        first = {0: self._winch} if self._winch.needs_feedback(self.time_ns) else {}
        joined = self.joined
        return first if joined is None else first | joined.needing_feedback(self.time_ns)

    def _share_winches(self, answering: dict[int, Winch]) -> None:
        """Copy winches to the coarse solution that it lacks, once it reached the twin's time."""
        half = self._coarse
        if not half.waiting:
            for r in answering.keys() - half.winches.keys():
                with self._lock:
                    half.winches[r] = CoarseWinch(answering[r], self.scene, r)

    def _judge(self, done: int, answers: bool) -> None:
        """Advance the coarse solution and update the error estimates.

        answers: whether the paid-out length responds to the tension.
        """
        now_s, h = self.time_ns * 1e-9, self.step_s
        waiting = self._coarse.waiting
        followed = self._coarse.follow(self._boundary, done, self._current.effects, now_s)
        if followed is None:  # the coarse solution failed, the rope did not
            self._open_band(resting=False, border=done)
            return
        joined, own = self.joined, self._pulls[:done, rows.PULL].tolist()
        if joined is None:
            (top,) = self._tops
            jumps = (top.no_jumps if answers else top.jumps)(self._boundary, done, h)
            top.judge((now_s, h), jumps, own, followed, waiting)
        else:
            each = []
            for top in self._tops:
                moved = _of(joined.moved, top.rope)
                each.append((top.no_jumps if answers else top.jumps)(moved, done, h))
            jumps = [sum(some) for some in zip(*each, strict=True)]
            for top in self._tops:
                own = joined.pulls[top.rope, :done, rows.PULL].tolist()
                other = self._coarse.further(top.rope)
                top.judge((now_s, h), jumps, own, other, waiting)
        if answers:
            for top in self._tops:
                top.band.answer(now_s)
        self._see(now_s)

    def _see(self, now_s: float) -> None:
        """Detect events whose error the difference to the coarse solution does not show."""
        ropes = self._all_ropes()
        pull_n = self._sight.event_pull_n(ropes)
        if pull_n is not None:
            for top in self._tops:
                top.band.kick(now_s, pull_n)
        if now_s >= self._look_s:
            self._look_s = now_s + LOOK_S
            self._look_for_slack(ropes, now_s)
            vortices = self._tops[0].vortices
            if vortices is not None:
                vortices.look(now_s, self.rope, self._boundary)
            if self._sight.bed is not None:
                self._look_at_bed(self._sight.bed, now_s)

    def _look_for_slack(self, ropes: tuple[Rope, ...], now_s: float) -> None:
        """Report slack ropes, slack slings and a body on its deck to the error estimates."""
        rope, legs, on_deck = is_slack(ropes), self._sight.slack_legs(), self._sight.on_deck()
        for top in self._tops:
            if rope:
                top.band.slacken(now_s)
            if any(legs):
                top.band.loosen(now_s)
            if on_deck:
                top.band.stand_on_deck(now_s)

    def _look_at_bed(self, bed: Bed | None, now_s: float) -> None:
        """Report landing and rope laid down to the estimates; an anchored end does not land."""
        ropes = self._all_ropes()
        stands, lays = self._sight.stands(ropes, bed), self._sight.lays(ropes, bed)
        for top in self._tops:
            if stands:
                top.band.touch(now_s)
            if lays:
                top.band.lay(now_s)


def _of(all_ropes: Boundary, r: int) -> Boundary:
    """Return the prescribed motion of one rope."""
    return Boundary(*(table[r] for table in all_ropes))


def _around(tension_n: float, bound_n: float, cost_pct: float) -> TensionInterval:
    return TensionInterval(max(tension_n - bound_n, 0.0), tension_n + bound_n, bound_n, cost_pct)


class TopEstimate:
    """Error estimate of one rope, and the second last boundary of its prescribed motion."""

    def __init__(
        self,
        rope: int,
        band: ErrorBound,
        now: tuple[Floats, Floats],
        step_s: float,
        vortices: PhaseDrift | None = None,
    ) -> None:
        """Start at `now`, value and rate of the prescribed motion.

        vortices: phase drift, if self-excited.
        """
        self.rope, self.band, self.vortices = rope, band, vortices
        self._before: Border = border_before(*now, step_s)

    def jumps(self, boundary: Boundary, done: int, step_s: float) -> list[float]:
        """Jumps of the prescribed acceleration at the beginning of the steps just done [m/s²]."""
        value, rate = (table[: done + 1] for table in boundary)
        found = acceleration_jumps(self._before, value, rate, step_s)
        self._before = value[done - 1].tolist(), rate[done - 1].tolist()
        return found

    def no_jumps(self, boundary: Boundary, done: int, step_s: float) -> list[float]:
        """Return zero jumps, for a payout that responds to the tension and has a kink each step."""
        value, rate = boundary
        self._before = value[done - 1].tolist(), rate[done - 1].tolist()
        return [0.0] * done

    def judge(
        self,
        times: tuple[float, float],
        jumps: Sequence[float],
        own: Sequence[float],
        followed: Sequence[float],
        waiting: int,
    ) -> None:
        """Take the steps just done and the coarse solution's tensions.

        times: of the last step, and step length [s]; own, followed: top tensions [N]; waiting:
        steps that the coarse solution had not done before.
        """
        now_s, h = times
        band, done = self.band, len(own)
        for k, jump in enumerate(jumps):
            at_s = now_s - (done - 1 - k) * h
            band.take(at_s, jump, own[k])
            turn, between = divmod(waiting + k + 1, EVERY)
            if not between:
                band.compare(at_s, abs(followed[turn - 1] - own[k]))
                if self.vortices is not None:
                    self.vortices.take(at_s, own[k], followed[turn - 1])

    def bound_n(self, time_s: float) -> float:
        """Return the 95 % bound on the error of the newest step's tension [N]."""
        bound = self.band.bound_n(time_s)
        return bound if self.vortices is None else max(bound, self.vortices.bound_n(time_s))
