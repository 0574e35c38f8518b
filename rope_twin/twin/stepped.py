"""The stepping of a twin: its rope or ropes, what is prescribed to them, the cut, and a snapshot.

Time is counted in whole nanoseconds since the start, so that a paced and an unpaced run with the
same inputs see the same numbers and agree to the bit.
"""

from __future__ import annotations

import copy
import math
import time
from typing import TYPE_CHECKING, Any

import numpy as np

from rope_twin.core import state as rows
from rope_twin.errors import InputError, SolverError, StateError, phrase
from rope_twin.scene.card import KnownError
from rope_twin.scene.rules.body import refuse_body
from rope_twin.scene.rules.rigging import is_joined, refuse_joined, winch_of
from rope_twin.scene.rules.shedding import model_beside, refuse_shedding
from rope_twin.scene.schema import Scene
from rope_twin.twin.accuracy.card_validity import CUT_WORDS
from rope_twin.twin.accuracy.regrid import HangOff
from rope_twin.twin.accuracy.rung import Rung
from rope_twin.twin.accuracy.rungs import Base, carry_over, error_at, top_rung
from rope_twin.twin.body import body_of, with_body
from rope_twin.twin.contact import bed_contact, bed_of
from rope_twin.twin.cutting.severing import Place
from rope_twin.twin.hoisting.line import LineOut
from rope_twin.twin.joined.joined import JoinedRopes
from rope_twin.twin.limits import LoadRecord, LoadRules
from rope_twin.twin.motion.prescribed import Inputs, LeadOver, Prescribed, Present
from rope_twin.twin.observe import Extremes, Observation, RunStatistics, observe
from rope_twin.twin.recovery import Checkpoint, moving_arrays
from rope_twin.twin.ropes import ropes_of
from rope_twin.twin.saving import saved_state
from rope_twin.twin.snapshot import CutShot, Snapshot, amended
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
        self._ropes = ropes_of(scene, STEPS_PER_CALL)
        self._rope = self._ropes.first
        self._base = Base(self._rope.model, self._rope.state.s.shape[0])
        self._rung = top_rung(scene)
        self._marks: list[rows.Floats] = []  # of the grids that were left for coarser ones
        super().__init__(scene, self._ropes)
        self._ahead = Prescribed(scene, STEPS_PER_CALL, self._winch.line.length_m)
        self._lead = LeadOver(len(scene.ropes))  # after a return to an earlier state
        self._pulls = np.zeros((STEPS_PER_CALL, rows.PULL_COLUMNS))
        self._steps = self._unconverged = self._currents = 0
        self._computing_s = 0.0
        self._run, self._recent = Extremes(), Extremes()
        self._pull = self._ropes.find_start()
        self._recent.take([float(self._pull[rows.PULL])])
        self._load_rules = LoadRules(scene)
        upper = self._pull[None] if self.joined is None else self.joined.pull
        start_n = upper[:, rows.PULL].tolist()
        start_n[0] += self._load_rules.supported_n(float(self._tension[0]))
        self._loads = LoadRecord(self._load_rules, start_n)
        self._has_bed = bed_of(self._rope) is not None
        self._has_body = body_of(self._ropes.lowest(self._rope)) is not None
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
        rope, effects = self._rope, self._current.effects
        return rope if rope.effects is effects else rope._replace(effects=effects)

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
        """What is known of its top tension's error now (twin/accuracy/card_validity.py)."""
        return self._validity.claim(self._card_error, self.time_ns)

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
        self._card_error = error_at(self.scene, rung)

    def doubt_card(self, why: str) -> None:
        """From here on its tension's error is unknown on every rung; `why` in words.

        For who knows that the run is none like the card's, as in another sea.
        """
        self._validity.doubt(why)

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
            if self._current.counter.accepted != self._currents:
                self._currents = self._current.counter.accepted
                at_s = self.time_ns * 1e-9
                self._validity.doubt(f"a current profile came from elsewhere at {at_s:.2f} s")
            taken = self._cut.take(self.time_ns, self._length_m)
            if taken is not None:
                self._part(*taken)
            steps = self._cut.steps_before(self.time_ns, self.step_ns, steps)
            told = Inputs(self._heave, self._winch, self._ropes, self._lead)
            now = Present(self.time_ns, self.step_ns, self._rope, float(self._pull[rows.PULL]))
            steps = self._ahead.fill(steps, told, now)
            rope = self.rope
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
            currents = self._current.changes
            self._shaking.look(self.rope, self._boundary, self._steps, currents)
        self._computing_s += time.perf_counter() - began
        if done < steps:
            raise SolverError(no_next_state(self._steps + 1, self.time_ns * 1e-9))
        return done

    def prescribe_again(self) -> None:
        """Drop the motion prescribed ahead: winches go on from the line out of the last step.

        After a failed step, whose inputs may be at fault; for the thread that advances.
        """
        with self._lock:
            self._ahead.steps = 0
            value, rate = self._boundary
            self._winch.continue_from(
                LineOut(float(value[0, rows.LINE]), float(rate[0, rows.LINE]))
            )
            self._ropes.prescribe_again()

    def checkpoint(self) -> Checkpoint:
        """A copy of what the steps change, for `go_back`; for the thread that advances."""
        border = self._ropes.border(self._boundary)
        kept = {name: array.copy() for name, array in self._moving().items()}
        run, recent = copy.copy(self._run), copy.copy(self._recent)
        return Checkpoint(self.time_ns, self._rung, self.cut, border, kept,
                          self._current.effects, (run, recent))  # fmt: skip

    def go_back(self, then: Checkpoint) -> bool:
        """Put the ropes back to an earlier state at the present time; whether they fit it.

        Hang-offs are led over from their places then to their live motion, winches go on from
        the line out of then by the orders of now. A current profile that came since is reverted.
        For the thread that advances.
        """
        if then.rung != self._rung or then.cut is not self.cut:
            return False
        present = self._ropes.border(self._boundary)
        self.keep_current_of(then)
        if self._moving().keys() != then.kept.keys():
            return False
        for _ in range(2):  # the second time views are as long as the counts of elements say
            for name, array in self._moving().items():
                if array.shape == then.kept[name].shape:
                    array[...] = then.kept[name]
        self._boundary.value[0], self._boundary.rate[0] = (table[0] for table in then.border)
        error, rate = self._lead.at(self.time_ns)
        moved = [
            np.nan_to_num((old - new)[: len(error), : rows.LINE])
            for old, new in zip(then.border, present, strict=True)
        ]
        self._lead.begin(self.time_ns, error + moved[0], rate + moved[1])
        if not self._run.empty and not math.isfinite(self._run.mean):
            self._run, self._recent = (copy.copy(one) for one in then.extremes)
        self.prescribe_again()
        return True

    def keep_current_of(self, then: Checkpoint) -> bool:
        """Revert a current profile that came since then; whether there was one."""
        with self._lock:
            return self._current.revert(then.effects, self.time_ns)

    @property
    def top_pull_n(self) -> float:
        """Pull of the first rope on its hang-off after the newest step [N]."""
        return float(self._pull[rows.PULL])

    @property
    def is_finite(self) -> bool:
        """Whether the state is one that may be published; for the thread that advances."""
        count = self._rope.state.counts[rows.ELEMENTS] + 1
        shown = self._rope.state.nodes[: rows.ACCELERATION, :count], self._tension, self._pull
        return all(bool(np.isfinite(one).all()) for one in (*shown, self._boundary.value[0]))

    def _moving(self) -> dict[str, rows.Floats]:
        """Views of all arrays that the steps change, by name."""
        parts = saved_state.changing_parts(self._rope)
        kept = {f"rope/{name}": getattr(self._rope, name) for name in parts}
        kept |= self._ropes.changing()
        kept |= {"tension": self._tension, "pull": self._pull, "effects": self._current.effects}
        return {
            name: array for name, part in kept.items() for name, array in moving_arrays(name, part)
        }

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
        self._validity.doubt(CUT_WORDS)
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
                winches=() if winch is None else (winch,),
                cut=self._cut.done,
            ),
        )
        self._unconverged = unconverged
        self._recent = Extremes()
        if self._has_body:
            taken = with_body(taken, self._ropes.lowest(self._rope))
        contact = bed_contact(self._rope) if self._has_bed else None
        if contact is not None:
            amended(taken, seabed=contact)
        if self._shaking is not None:
            amended(taken, vibration=self._shaking.shot(self.rope))
        return self._judged(self._ropes.complete(taken, self.time_ns))

    def _judged(self, taken: Snapshot) -> Snapshot:
        """With touchdown and bends, where the scene has them, loads and limits, and the error."""
        self._validity.look(taken, self._motion_judged)
        added: dict[str, Any] = {"card_error": self.card_error}
        bed = bed_of(self._rope) if self._has_bed else None
        if bed is not None or self._bends is not None:
            ropes = self._ropes.hung(self._rope, taken)
            if bed is not None:
                found = (touchdown_of(hung, bed) for hung in ropes)
                added["touchdowns"] = tuple(one for one in found if one is not None)
            if self._bends is not None:
                added["bends"] = self._bends.look(ropes, taken.time_s)
        looked = self._loads.look(taken, self._load_rules, added.get("bends", ()))
        added["strength"], added["breaches"] = looked
        return amended(taken, **added)
