"""The stepping of a twin: its rope or ropes, what is prescribed to them, the cut, and a snapshot.

Time is counted in whole nanoseconds since the start, so that a paced and an unpaced run with the
same inputs see the same numbers and agree to the bit.
"""

from __future__ import annotations

import math
import time
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from rope_twin.core import state as rows
from rope_twin.errors import InputError, SolverError, StateError, phrase
from rope_twin.scene.card import KnownError, known_error
from rope_twin.scene.rules.body import refuse_body
from rope_twin.scene.rules.rigging import is_joined, refuse_joined, winch_of
from rope_twin.scene.rules.shedding import model_beside, refuse_shedding
from rope_twin.scene.schema import Scene
from rope_twin.twin.accuracy.regrid import HangOff
from rope_twin.twin.accuracy.rung import Rung
from rope_twin.twin.accuracy.rungs import Base, carry_over, error_at, top_rung
from rope_twin.twin.body import with_body
from rope_twin.twin.contact import bed_contact, bed_of
from rope_twin.twin.cutting.severing import Place
from rope_twin.twin.joined.joined import JoinedRopes
from rope_twin.twin.motion.prescribed import Inputs, Prescribed, Present
from rope_twin.twin.observe import Extremes, Observation, RunStatistics, observe
from rope_twin.twin.ropes import ropes_of
from rope_twin.twin.snapshot import CutShot, Snapshot
from rope_twin.twin.stuck import no_next_state
from rope_twin.twin.tightest_bend import BendWatch, watches_bends
from rope_twin.twin.told import ToldTwin
from rope_twin.twin.touchdown import touchdown_of

if TYPE_CHECKING:
    from rope_twin.twin.vibration.shaking import Shaking

STEPS_PER_CALL = 256


class SteppedTwin(ToldTwin):
    """One scene that is stepped on; all but the inputs belongs to one thread.

    Raises:
        SceneError: the scene cannot be built, or its rope has no equilibrium to start from.
    """

    told = ""  # what there is to say before it runs
    _shaking: Shaking | None = None  # where the scene's model of vortices is beside the step
    _bends: BendWatch | None = None  # where a rope has bending stiffness or a minimum bend radius

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.step_s = scene.time.step_s
        self.step_ns = round(scene.time.step_s * 1e9)
        self._card_error, self._doubt = known_error(scene), ""
        self._ropes = ropes_of(scene, STEPS_PER_CALL)
        self._rope = self._ropes.first
        self._base = Base(self._rope.model, self._rope.state.s.shape[0])
        self._rung = top_rung(scene)
        self._marks: list[rows.Floats] = []  # of the grids that were left for coarser ones
        super().__init__(scene, self._ropes)
        self._ahead = Prescribed(scene, STEPS_PER_CALL, self._winch.line.length_m)
        self._pulls = np.zeros((STEPS_PER_CALL, rows.PULL_COLUMNS))
        self._steps = self._unconverged = 0
        self._computing_s = 0.0
        self._run, self._recent = Extremes(), Extremes()
        self._pull = self._ropes.find_start()
        self._recent.take([float(self._pull[rows.PULL])])
        if watches_bends(scene):
            self._bends = BendWatch(scene)
        if model_beside(scene) is not None:
            from rope_twin.twin.vibration.shaking import (
                Shaking,  # here: its filters take a second to load
            )

            self._shaking = Shaking(scene, self.rope)
            self.told = self._shaking.tracker.told

    @property
    def steps(self) -> int:
        """Steps done."""
        return self._steps

    @property
    def rope(self) -> rows.Rope:
        """The core's arrays as they are now; for the thread that advances."""
        return self._rope._replace(effects=self._current.effects)

    @property
    def shaking(self) -> Shaking | None:
        """The scene's model of vortices if it is beside the step; for the thread that advances."""
        return self._shaking

    @property
    def joined(self) -> JoinedRopes | None:
        """The ropes, where several meet."""
        return self._ropes if isinstance(self._ropes, JoinedRopes) else None

    @property
    def card_error(self) -> KnownError:
        """What is known of its top tension's error on the present rung, by the scene's card."""
        return self._card_error

    @property
    def rung(self) -> Rung:
        """Elements and step that it goes with at present."""
        return self._rung

    def take_rung(self, rung: Rung) -> None:
        """Go on from here with other elements or another step; for the thread that advances.

        Time, line out, payload and the pull on the hang-off stay as they are.

        Raises:
            SceneError: the scene joins ropes, sheds vortices or has a rigid body: none of these
                can be carried over.
            StateError: the rope was cut: its parts cannot either.
        """
        refuse_joined(self.scene)
        if self._cut.done:
            raise StateError(phrase("other elements", "the rope was cut", "its parts keep theirs"))
        refuse_body(self.scene, "it cannot be carried over to another grid")
        refuse_shedding(self.scene, "wakes of vortices cannot be carried over to another grid")
        V = float(self._boundary.rate[0, rows.LINE])
        at = HangOff(self._pull[rows.PULL_X : rows.PULL_Z + 1].copy(), V)
        self._ahead.steps = 0  # borders ahead of a step that failed were for its length
        self._rope, self._marks = carry_over(self._rope, self._marks, rung, self._base, at)
        self._rung, self.step_ns, self.step_s = rung, rung.step_ns, self._rope.model.step
        if not self._doubt:
            self._card_error = error_at(self.scene, rung)

    def doubt_card(self, why: str) -> None:
        """From here on its tension's error is unknown on every rung; `why` in words.

        For who knows that the run is none like the card's, as in another sea.
        """
        self._doubt = why
        self._card_error = KnownError(words=f"unknown: {why}")

    def advance(self, steps: int) -> None:
        """Step on.

        Raises:
            InputError: a twin cannot go back.
            SolverError: the next state would not be finite; the last good one is kept.
        """
        if steps < 0:
            what = f"{steps} steps would lead back in time"
            raise InputError(phrase("advance", what, "restore an earlier saved state"))
        while steps > 0:
            steps -= self._advance_some(min(steps, STEPS_PER_CALL))

    @property
    def _boundary(self) -> rows.Boundary:
        """Hang-off and line out from now on, row 0 the present."""
        return self._ahead.boundary

    @property
    def _tension(self) -> rows.Floats:
        """Tension of the elements [N], a view of the scratch."""
        return self._rope.work[rows.TENSION, : self._rope.state.counts[rows.ELEMENTS]]

    def _advance_some(self, steps: int) -> int:
        """Step on as far as inputs tell without a look at the rope; how many steps that was."""
        began = time.perf_counter()
        if self._shaking is not None:
            steps = min(steps, self._shaking.steps_to_look(self._steps))
        with self._lock:
            taken = self._cut.take(self.time_ns, self._length_m)
            if taken is not None:
                self._part(*taken)
            steps = self._cut.steps_before(self.time_ns, self.step_ns, steps)
            told = Inputs(self._heave, self._winch, self._ropes)
            now = Present(self.time_ns, self.step_ns, self._rope, float(self._pull[rows.PULL]))
            steps = self._ahead.fill(steps, told, now)
            rope = self._rope._replace(effects=self._current.effects)
        pulls = self._pulls[:steps]
        done = self._ropes.advance(rope, self._boundary, self.time_ns * 1e-9, pulls)
        self._steps += done
        self._time_ns += done * self.step_ns
        self._forget_borders(done)
        if done:
            self._pull = self._pulls[done - 1].copy()
            tensions = pulls[:done, rows.PULL].tolist()
            self._run.take(tensions)
            self._recent.take(tensions)
        if self._shaking is not None and self._shaking.steps_to_look(self._steps) == 0:
            currents = self._current.counter.accepted
            self._shaking.look(self.rope, self._boundary, self._steps, currents)
        self._computing_s += time.perf_counter() - began
        if done < steps:
            raise SolverError(no_next_state(self._steps + 1, self.time_ns * 1e-9))
        return done

    def _forget_borders(self, done: int) -> None:
        """Make the border after `done` steps the first one, of all ropes."""
        self._ahead.forget(done)
        self._ropes.forget(done, self._ahead.steps)

    def _length_m(self, rope: int) -> float:
        """Unstretched length of a rope now [m]."""
        if rope > 0:
            return self._ropes.length_m(rope)
        return float(self._boundary.value[0, rows.LINE])

    def _part(self, lost_m: float, rope: int) -> None:
        """Cut a rope here and now, so far above its lower end [m], or at a node close by."""
        lost_m = self._sever(lost_m, rope)
        self._lose(lost_m, self._length_m(rope), rope)

    def _lose(self, lost_m: float, left_m: float, rope: int) -> None:
        """Note that a rope was cut now."""
        if rope == 0:
            self._winch.lose(lost_m, left_m)
        else:
            self._ropes.lose(rope, lost_m, left_m)
        name = self.scene.ropes[rope].name if is_joined(self.scene) else ""
        self._cut.done = CutShot(self.time_ns * 1e-9, left_m, lost_m, name)

    def _sever(self, lost_m: float, rope: int = 0) -> float:
        """Go on with a rope in two; how much of it is below the cut [m]."""
        whole, now_s = self._rope._replace(effects=self._current.effects), self.time_ns * 1e-9
        winch = winch_of(self.scene, self.scene.ropes[rope])
        place = Place(lost_m, winch.least_line_out_m if winch else math.inf, now_s, rope)
        self._ropes, lost_m = self._ropes.part(whole, self._boundary, place)
        self._rope = self._ropes.first
        self._current.effects = self._rope.effects
        if self._shaking is not None:
            self._shaking.part(whole, self._rope)
        if rope == 0:
            self._boundary.value[:, rows.LINE] -= lost_m
        self._card_error = KnownError(words="unknown: the rope was cut")
        return lost_m

    def statistics(self) -> RunStatistics:
        """The run so far."""
        simulated = self._time_ns * 1e-9
        factor = simulated / self._computing_s if self._computing_s > 0.0 else 0.0
        run = self._run if self._steps else self._recent
        return RunStatistics(self._steps, self._computing_s, factor, run.high, run.mean, run.low)

    def snapshot(self) -> Snapshot:
        """A frozen copy of the present; call it from the thread that advances."""
        unconverged = int(self._rope.state.health[rows.SUBSTEPS_UNCONVERGED])
        with self._lock:
            inputs = self._input_health()
            at_limit, winch = self._winch.at_limit, self._winch.shot()
        taken = observe(
            self._rope.state,
            self._rope.work,
            Observation(
                stamp_ns=self.time_ns,
                step=self._steps,
                step_s=self.step_s,
                line=self.scene.ropes[0],
                ship=self.scene.ship,
                border=self._boundary.value[0],
                border_rate=self._boundary.rate[0],
                pull=self._pull,
                recent=self._recent,
                run=self._run,
                winch_at_limit=at_limit,
                doubtful=unconverged > self._unconverged,
                computing_s=self._computing_s,
                inputs=inputs,
                card_error=self._card_error,
            ),
        )
        self._unconverged = unconverged
        self._recent = Extremes()
        taken = with_body(taken, self._ropes.lowest(self._rope))
        contact = bed_contact(self._rope)
        if contact is not None:
            taken = replace(taken, seabed=contact)
        taken = replace(taken, winches=() if winch is None else (winch,), cut=self._cut.done)
        if self._shaking is not None:
            taken = replace(taken, vibration=self._shaking.shot(self.rope))
        return self._with_shape(self._ropes.complete(taken, self.time_ns))

    def _with_shape(self, taken: Snapshot) -> Snapshot:
        """With what the scene asks to be told of its ropes' shape: touchdown, tightest bend."""
        bed = bed_of(self._rope)
        if bed is None and self._bends is None:
            return taken
        ropes = self._ropes.hung(self._rope, taken)
        if bed is not None:
            found = (touchdown_of(hung, bed) for hung in ropes)
            taken = replace(taken, touchdowns=tuple(one for one in found if one is not None))
        if self._bends is not None:
            taken = replace(taken, bends=self._bends.look(ropes, taken.time_s))
        return taken
