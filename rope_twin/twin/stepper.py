"""Stepping of a twin: its ropes, boundary conditions, the cut and the snapshot.

Time is counted in whole nanoseconds since the start, so that a real-time and an offline run with
the same inputs see the same numbers and are bit-identical.
"""

from __future__ import annotations

import copy
import math
import time
from typing import TYPE_CHECKING, Any

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.solve.halving import HALVINGS
from rope_twin.errors import InputError, SolverError, StateError, phrase
from rope_twin.scene.card import KnownError
from rope_twin.scene.schema import Scene
from rope_twin.scene.validation.rigging import is_joined, refuse_body, refuse_joined, winch_of
from rope_twin.scene.validation.vortices import model_beside, refuse_shedding
from rope_twin.twin.accuracy.level import (
    AccuracyLevel,
    SceneMesh,
    change_level,
    error_at_level,
    scene_level,
)
from rope_twin.twin.accuracy.regrid import HangOff
from rope_twin.twin.accuracy.validity import CUT_REASON
from rope_twin.twin.bend_radius import BendMonitor, watches_bends
from rope_twin.twin.body import body_of, with_body
from rope_twin.twin.cutting.rope_cut import CutPosition
from rope_twin.twin.inputs import TwinInputs
from rope_twin.twin.limits import LoadRecord, LoadRules
from rope_twin.twin.motion.boundary_conditions import (
    Blending,
    BoundaryConditions,
    InputSources,
    Present,
)
from rope_twin.twin.multi_line.system import MultiLineRopes
from rope_twin.twin.recovery import Checkpoint, moving_arrays
from rope_twin.twin.ropes import ropes_of
from rope_twin.twin.saving import saved_state
from rope_twin.twin.seabed_contact import seabed_contact, seabed_of
from rope_twin.twin.snapshot import CutShot, Snapshot, amended
from rope_twin.twin.snapshot_builder import Extremes, RunStatistics, SnapshotInputs, build_snapshot
from rope_twin.twin.touchdown import touchdown_of
from rope_twin.twin.winch.payout import Payout

if TYPE_CHECKING:
    from rope_twin.twin.vibration.drag_amplification import VivDragAmplification


STEPS_PER_CALL = 256


class TwinStepper(TwinInputs):
    """One scene that is advanced in time; all but the inputs belongs to one thread.

    Raises:
        SceneError: the scene cannot be built, or its rope has no static equilibrium to start from.
    """

    told = ""  # message for the user before the run
    _viv_drag: VivDragAmplification | None = None  # if the scene's VIV model is loosely coupled
    _bends: BendMonitor | None = None  # if a rope has bending stiffness or a minimum bend radius

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.step_s = scene.time.step_s
        self.step_ns = round(scene.time.step_s * 1e9)
        self._ropes = ropes_of(scene, STEPS_PER_CALL)
        self._rope = self._ropes.first
        self._base = SceneMesh(self._rope.model, self._rope.state.s.shape[0])
        self._level = scene_level(scene)
        self._marks: list[rows.Floats] = []  # node coordinates of the finer grids left so far
        super().__init__(scene, self._ropes)
        self._ahead = BoundaryConditions(scene, STEPS_PER_CALL, self._winch.line.length_m)
        self._lead = Blending(len(scene.ropes))  # transition after a return to an earlier state
        self._pulls = np.zeros((STEPS_PER_CALL, rows.PULL_COLUMNS))
        self._steps = self._unconverged = self._currents = 0
        self._computing_s = 0.0
        self._run, self._recent = Extremes(), Extremes()
        self._pull = self._ropes.solve_statics()
        self._recent.take([float(self._pull[rows.PULL])])
        self._load_rules = LoadRules(scene)
        upper = self._pull[None] if self.joined is None else self.joined.pull
        start_n = upper[:, rows.PULL].tolist()
        start_n[0] += self._load_rules.supported_n(float(self._tension[0]))
        self._loads = LoadRecord(self._load_rules, start_n)
        self._has_bed = seabed_of(self._rope) is not None
        self._has_body = body_of(self._ropes.lowest(self._rope)) is not None
        if watches_bends(scene):
            self._bends = BendMonitor(scene)
        if model_beside(scene) is not None:
            from rope_twin.twin.vibration.drag_amplification import (
                VivDragAmplification,  # imported here: its filters take a second to load
            )

            self._viv_drag = VivDragAmplification(scene, self.rope)
            self.told = self._viv_drag.tracker.told

    @property
    def steps(self) -> int:
        """Number of completed time steps."""
        return self._steps

    @property
    def rope(self) -> rows.Rope:
        """The core's arrays in their present state; use them in the stepping thread only."""
        rope, effects = self._rope, self._current.effects
        return rope if rope.effects is effects else rope._replace(effects=effects)

    @property
    def viv_drag(self) -> VivDragAmplification | None:
        """The scene's loosely coupled VIV model, or None; use it in the stepping thread only."""
        return self._viv_drag

    @property
    def joined(self) -> MultiLineRopes | None:
        """The multi-line system; None for a single rope."""
        return self._ropes if isinstance(self._ropes, MultiLineRopes) else None

    @property
    def card_error(self) -> KnownError:
        """Error of the top tension that is known at present (twin/accuracy/validity.py)."""
        return self._validity.claim(self._card_error, self.time_ns)

    @property
    def level(self) -> AccuracyLevel:
        """Accuracy level in use: number of elements and time step."""
        return self._level

    def set_level(self, level: AccuracyLevel) -> None:
        """Continue with another mesh or time step; call it from the stepping thread.

        Time, paid-out length, payload and the tension at the hang-off are kept.

        Raises:
            SceneError: the scene is multi-line, has a VIV model or a rigid body, which cannot be
                transferred to another mesh.
            StateError: the rope was cut; its parts cannot be transferred either.
        """
        refuse_joined(self.scene)
        if self._cut.done:
            raise StateError(phrase("other elements", "the rope was cut", "its parts keep theirs"))
        refuse_body(self.scene, "it cannot be carried over to another grid")
        refuse_shedding(self.scene, "wakes of vortices cannot be carried over to another grid")
        V = float(self._boundary.rate[0, rows.LINE])
        at = HangOff(self._pull[rows.PULL_X : rows.PULL_Z + 1].copy(), V)
        self._ahead.steps = 0  # boundary conditions ahead are valid for the old step only
        self._rope, self._marks = change_level(self._rope, self._marks, level, self._base, at)
        self._level, self.step_ns, self.step_s = level, level.step_ns, self._rope.model.step
        self._card_error = error_at_level(self.scene, level)

    def invalidate_error(self, why: str) -> None:
        """Mark the tension error as unknown on every accuracy level from now on; why: the reason.

        For callers that know the run differs from the convergence study, as in another sea.
        """
        self._validity.invalidate(why)

    def advance(self, steps: int) -> None:
        """Advance by this number of time steps.

        Raises:
            InputError: the number is negative.
            SolverError: the next state would not be finite; the last good one is kept.
        """
        if steps < 0:
            what = f"{steps} steps would lead back in time"
            raise InputError(phrase("advance", what, "restore an earlier saved state"))
        while steps > 0:
            steps -= self._advance_some(min(steps, STEPS_PER_CALL))

    @property
    def _boundary(self) -> rows.Boundary:
        """Hang-off position and paid-out length at the step boundaries; row 0 is the present."""
        return self._ahead.boundary

    @property
    def _tension(self) -> rows.Floats:
        """Tension of the elements [N], a view of the scratch array."""
        return self._rope.work[rows.TENSION, : self._rope.state.counts[rows.ELEMENTS]]

    def _advance_some(self, steps: int) -> int:
        """Advance as far as inputs can be prescribed without tension feedback; return the steps."""
        began = time.perf_counter()
        if self._viv_drag is not None:
            steps = min(steps, self._viv_drag.steps_to_sampling(self._steps))
        with self._lock:
            if self._current.counter.accepted != self._currents:
                self._currents = self._current.counter.accepted
                at_s = self.time_ns * 1e-9
                self._validity.invalidate(f"a current profile came from elsewhere at {at_s:.2f} s")
            taken = self._cut.take(self.time_ns, self._length_m)
            if taken is not None:
                self._cut_here(*taken)
            steps = self._cut.steps_before(self.time_ns, self.step_ns, steps)
            told = InputSources(self._heave, self._winch, self._ropes, self._lead)
            now = Present(self.time_ns, self.step_ns, self._rope, float(self._pull[rows.PULL]))
            steps = self._ahead.fill(steps, told, now)
            rope = self.rope
        pulls = self._pulls[:steps]
        done = self._ropes.advance(rope, self._boundary, self.time_ns * 1e-9, pulls)
        self._steps += done
        self._time_ns += done * self.step_ns
        self._drop_boundaries(done)
        if done:
            self._pull = self._pulls[done - 1].copy()
            tensions = pulls[:done, rows.PULL].tolist()
            self._run.take(tensions)
            self._recent.take(tensions)
        if self._viv_drag is not None and self._viv_drag.steps_to_sampling(self._steps) == 0:
            currents = self._current.changes
            self._viv_drag.look(self.rope, self._boundary, self._steps, currents)
        self._computing_s += time.perf_counter() - began
        if done < steps:
            raise SolverError(step_failure(self._steps + 1, self.time_ns * 1e-9))
        return done

    def discard_prescribed(self) -> None:
        """Discard motion prescribed in advance; winches continue from their last paid-out length.

        For use after a failed step, whose inputs may be the cause; call it from the stepping
        thread.
        """
        with self._lock:
            self._ahead.steps = 0
            value, rate = self._boundary
            self._winch.continue_from(Payout(float(value[0, rows.LINE]), float(rate[0, rows.LINE])))
            self._ropes.discard_prescribed()

    def checkpoint(self) -> Checkpoint:
        """Return a copy of all that the steps change, for `return_to`; for the stepping thread."""
        border = self._ropes.border(self._boundary)
        kept = {name: array.copy() for name, array in self._changing_arrays().items()}
        run, recent = copy.copy(self._run), copy.copy(self._recent)
        return Checkpoint(self.time_ns, self._level, self.cut, border, kept,
                          self._current.effects, (run, recent))  # fmt: skip

    def return_to(self, then: Checkpoint) -> bool:
        """Return the ropes to an earlier state at the present time; return whether the state fits.

        Hang-offs are blended from their earlier positions into their live motion; winches continue
        from their earlier paid-out length with the present commands. A current profile that came
        since is reverted. Call it from the stepping thread.
        """
        if then.level != self._level or then.cut is not self.cut:
            return False
        present = self._ropes.border(self._boundary)
        self.revert_current(then)
        if self._changing_arrays().keys() != then.kept.keys():
            return False
        for _ in range(2):  # after the first pass the views have the restored element counts
            for name, array in self._changing_arrays().items():
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
        self.discard_prescribed()
        return True

    def revert_current(self, then: Checkpoint) -> bool:
        """Revert a current profile accepted since the checkpoint; return whether there was one."""
        with self._lock:
            return self._current.revert(then.effects, self.time_ns)

    @property
    def top_pull_n(self) -> float:
        """Tension of the first rope at its hang-off after the newest step [N]."""
        return float(self._pull[rows.PULL])

    @property
    def is_finite(self) -> bool:
        """Whether the state is finite and may be published; call it from the stepping thread."""
        count = self._rope.state.counts[rows.ELEMENTS] + 1
        shown = self._rope.state.nodes[: rows.ACCELERATION, :count], self._tension, self._pull
        return all(bool(np.isfinite(one).all()) for one in (*shown, self._boundary.value[0]))

    def _changing_arrays(self) -> dict[str, rows.Floats]:
        """Return views of all arrays that the steps change, by name."""
        parts = saved_state.changing_parts(self._rope)
        kept = {f"rope/{name}": getattr(self._rope, name) for name in parts}
        kept |= self._ropes.changing()
        kept |= {"tension": self._tension, "pull": self._pull, "effects": self._current.effects}
        return {
            name: array for name, part in kept.items() for name, array in moving_arrays(name, part)
        }

    def _drop_boundaries(self, done: int) -> None:
        """Make the step boundary after `done` steps the first one, for all ropes."""
        self._ahead.forget(done)
        self._ropes.forget(done, self._ahead.steps)

    def _length_m(self, rope: int) -> float:
        """Return the present unstretched length of a rope [m]."""
        if rope > 0:
            return self._ropes.length_m(rope)
        return float(self._boundary.value[0, rows.LINE])

    def _cut_here(self, lost_m: float, rope: int) -> None:
        """Cut a rope now at this height above its lower end [m], or at a node close by."""
        lost_m = self._split(lost_m, rope)
        self._record_cut(lost_m, self._length_m(rope), rope)

    def _record_cut(self, lost_m: float, left_m: float, rope: int) -> None:
        """Record a cut at the present time."""
        if rope == 0:
            self._winch.adapt_to_cut(lost_m, left_m)
        else:
            self._ropes.adapt_to_cut(rope, lost_m, left_m)
        name = self.scene.ropes[rope].name if is_joined(self.scene) else ""
        self._cut.done = CutShot(self.time_ns * 1e-9, left_m, lost_m, name)

    def _split(self, lost_m: float, rope: int = 0) -> float:
        """Split a rope in two; return the length below the cut [m]."""
        whole, now_s = self._rope._replace(effects=self._current.effects), self.time_ns * 1e-9
        winch = winch_of(self.scene, self.scene.ropes[rope])
        place = CutPosition(lost_m, winch.least_line_out_m if winch else math.inf, now_s, rope)
        self._ropes, lost_m = self._ropes.cut(whole, self._boundary, place)
        self._rope = self._ropes.first
        self._current.effects = self._rope.effects
        if self._viv_drag is not None:
            self._viv_drag.cut(whole, self._rope)
        if rope == 0:
            self._boundary.value[:, rows.LINE] -= lost_m
        self._validity.invalidate(CUT_REASON)
        return lost_m

    def statistics(self) -> RunStatistics:
        """Return the statistics of the run since its start."""
        simulated = self._time_ns * 1e-9
        factor = simulated / self._computing_s if self._computing_s > 0.0 else 0.0
        run = self._run if self._steps else self._recent
        return RunStatistics(self._steps, self._computing_s, factor, run.high, run.mean, run.low)

    def snapshot(self) -> Snapshot:
        """Return a frozen copy of the present; call it from the stepping thread."""
        unconverged = int(self._rope.state.health[rows.SUBSTEPS_UNCONVERGED])
        with self._lock:
            inputs = self._input_health()
            at_limit, winch = self._winch.at_limit, self._winch.shot()
        taken = build_snapshot(
            self._rope.state,
            self._rope.work,
            SnapshotInputs(
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
        contact = seabed_contact(self._rope) if self._has_bed else None
        if contact is not None:
            amended(taken, seabed=contact)
        if self._viv_drag is not None:
            amended(taken, vibration=self._viv_drag.shot(self.rope))
        return self._judged(self._ropes.complete(taken, self.time_ns))

    def _judged(self, taken: Snapshot) -> Snapshot:
        """Add touchdown and bends (if the scene has them), loads, limits and the known error."""
        self._validity.look(taken, self._motion_judged)
        added: dict[str, Any] = {"card_error": self.card_error}
        bed = seabed_of(self._rope) if self._has_bed else None
        if bed is not None or self._bends is not None:
            ropes = self._ropes.shapes(self._rope, taken)
            if bed is not None:
                found = (touchdown_of(hung, bed) for hung in ropes)
                added["touchdowns"] = tuple(one for one in found if one is not None)
            if self._bends is not None:
                added["bends"] = self._bends.look(ropes, taken.time_s)
        looked = self._loads.look(taken, self._load_rules, added.get("bends", ()))
        added["strength"], added["breaches"] = looked
        return amended(taken, **added)


def step_failure(step: int, time_s: float) -> str:
    """Return the message for a failed step; step: its number, time_s: its start [s]."""
    return phrase(
        f"step {step} at {time_s:.2f} s",
        f"the rope's next state is not finite even at 1/{2**HALVINGS} of the step",
        "the last good state is kept; shorten the step or check the scene",
    )
