"""The running twin: owns the rope's arrays, its inputs and its clock.

Inputs are offered with a stamp from any thread; `advance` and `snapshot` belong to one thread.
Time is counted in whole nanoseconds since the start, so that a paced and an unpaced run with the
same inputs see the same numbers and agree to the bit.
"""

from __future__ import annotations

import copy
import math
import threading
import time
from dataclasses import replace
from pathlib import Path
from typing import Any, Self

import numpy as np

from rope_twin.core import state as rows
from rope_twin.errors import SolverError, StateError, phrase
from rope_twin.scene.body_rules import refuse_body
from rope_twin.scene.card import KnownError, known_error
from rope_twin.scene.rigging_rules import refuse_joined
from rope_twin.scene.schema import Scene
from rope_twin.scene.shedding import refuse_shedding
from rope_twin.twin import saved_state
from rope_twin.twin.bare_end import without_load
from rope_twin.twin.body import with_body
from rope_twin.twin.contact import bed_contact
from rope_twin.twin.hoisting.feel import Course, feel
from rope_twin.twin.observe import Extremes, Observation, RunStatistics, observe
from rope_twin.twin.parted import PartedRopes
from rope_twin.twin.regrid import HangOff
from rope_twin.twin.ropes import ropes_of
from rope_twin.twin.rung import Rung
from rope_twin.twin.rungs import Base, carry_over, error_at, top_rung
from rope_twin.twin.saved_state import About, SavedState
from rope_twin.twin.severing import Place, sever
from rope_twin.twin.ship import ramp
from rope_twin.twin.snapshot import CutShot, Snapshot
from rope_twin.twin.told import ToldTwin
from rope_twin.twin.winch import LineOut

STEPS_PER_CALL = 256
# What the scene or the caller gives; everything else changes and belongs to a saved state.
_GIVEN = (
    "scene", "step_s", "step_ns", "failure_folder", "_card_error", "_rest", "_lock", "_pulls",
    "_rope", "_ropes", "_base",
)  # fmt: skip


class Twin(ToldTwin):
    """One scene, running.

    Raises:
        SceneError: the scene cannot be built, or its rope has no equilibrium to start from.
    """

    told = ""  # what there is to say before it runs

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.step_s = scene.time.step_s
        self.step_ns = round(scene.time.step_s * 1e9)
        self.failure_folder: Path | None = None  # takes the state that the solver cannot leave
        self._card_error = known_error(scene)
        self._ropes = ropes_of(scene, STEPS_PER_CALL)
        self._rope = self._ropes.first
        self._base = Base(self._rope.model, self._rope.state.s.shape[0])
        self._rung = top_rung(scene)
        self._marks: list[rows.Floats] = []  # of the grids that were left for coarser ones
        super().__init__(scene, self._ropes)
        self._rest = np.array(scene.ship.hang_off_m, dtype=float)
        borders = (STEPS_PER_CALL + 1, rows.MOTIONS)
        self._boundary = rows.Boundary(np.zeros(borders), np.zeros(borders))
        self._pulls = np.zeros((STEPS_PER_CALL, rows.PULL_COLUMNS))
        self._boundary.value[:] = [*self._rest, self._winch.line.length_m]
        self._prescribed = 0  # steps ahead whose borders are filled in
        self._steps = self._unconverged = 0
        self._computing_s = 0.0
        self._run, self._recent = Extremes(), Extremes()
        self._pull = self._ropes.find_start()
        self._recent.take([float(self._pull[rows.PULL])])

    @property
    def steps(self) -> int:
        """Steps done."""
        return self._steps

    @property
    def rope(self) -> rows.Rope:
        """The core's arrays as they are now; for the thread that advances."""
        return self._rope._replace(effects=self._current.effects)

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
        self._prescribed = 0  # borders ahead of a step that failed were for its length
        self._rope, self._marks = carry_over(self._rope, self._marks, rung, self._base, at)
        self._rung, self.step_ns, self.step_s = rung, rung.step_ns, self._rope.model.step
        self._card_error = error_at(self.scene, rung)

    def advance(self, steps: int) -> None:
        """Step on.

        Raises:
            SolverError: the next state would not be finite; the last good one is kept, and with
                the inputs of the failing step it is in a file of `failure_folder`, if that is set.
        """
        while steps > 0:
            some = min(steps, STEPS_PER_CALL)
            try:
                steps -= self._advance_some(some)
            except SolverError as error:
                raise SolverError(
                    str(error).removesuffix(".") + self._keep_failure(error)
                ) from error

    def _keep_failure(self, error: SolverError) -> str:
        """Write the state that the solver cannot leave; the end of the sentence says where."""
        if self.failure_folder is None:
            return "."
        path = self.failure_folder / f"{self.scene.name}_failed_step_{self._steps + 1}.state"
        try:
            self.capture(str(error)).write(path)
        except StateError as trouble:
            return f"; {trouble}"
        return f"; state and inputs of that step are in {path}."

    def save(self, path: str | Path) -> None:
        """Write a state from which `restore` goes on to the bit; for the thread that advances.

        Raises:
            StateError: the file cannot be written; what was there before still is.
        """
        self.capture().write(Path(path))

    @classmethod
    def restore(cls, saved: str | Path | SavedState, scene: Scene) -> Self:
        """A twin that goes on from a saved state (or the file of one) of this scene.

        Raises:
            StateError: one sentence on what is wrong with the file, or which figure of the scene
                is another.
            SceneError: as for a new twin.
        """
        state = saved if isinstance(saved, SavedState) else saved_state.load_state(saved)
        saved_state.judge_scene(state, scene)
        twin = cls(scene)
        if (rung := state.rung) != twin.rung:
            twin.take_rung(rung)
        if (lost_m := state.about.cut_lost_m) > 0.0:  # wherever: what is there is taken back
            twin._sever(0.5 * float(twin._boundary.value[0, rows.LINE]))
            twin._lose(lost_m, state.about.cut_left_m)
        values = state.restore_into(twin._changing())
        twin._rope = twin._rope._replace(
            **{name: values.pop(f"rope/{name}") for name in saved_state.changing_parts(twin._rope)},
            effects=values["_current"].effects,
            model=values.pop("rope/model", twin._rope.model),
        )
        twin._tension[:] = values.pop("rope/tension")
        twin._ropes.take_back(values, twin._rope)
        vars(twin).update(values)
        return twin

    def branch(self) -> Twin:
        """A twin that goes on from here by itself, to the bit; for the thread that advances."""
        with self._lock:
            twin = copy.copy(self)
            shared: dict[int, Any] = {id(self.scene): self.scene, id(self._lock): threading.Lock()}
            vars(twin).update(copy.deepcopy(vars(self), shared))
        return twin

    def capture(self, failure: str = "") -> SavedState:
        """The present as `save` writes it, in memory; for the thread that advances."""
        state, (value, rate) = self._rope.state, self._boundary
        payload = self._ropes.lowest(self._rope).state.nodes[rows.POSITION : rows.POSITION + 3, 0]
        cut = self._cut.done
        about = About(
            **saved_state.stamp(self.scene, failure),
            time_s=self.time_ns * 1e-9,
            step=self._steps,
            step_s=self.step_s,
            halvings=self._rung.halvings,
            elements=int(state.counts[rows.ELEMENTS]),
            line_out_m=float(value[0, rows.LINE]),
            payout_speed_m_per_s=float(rate[0, rows.LINE]),
            tension_top_n=float(self._pull[rows.PULL]),
            payload_position_m=tuple(payload.tolist()),
            cut_lost_m=cut.lost_m if cut else 0.0,
            cut_left_m=cut.left_m if cut else 0.0,
        )
        with self._lock:
            return saved_state.take(self._changing(), about, self.scene)

    def _changing(self) -> dict[str, Any]:
        """Every attribute that a restart needs; the effects in use are those of `_current`."""
        kept = {name: value for name, value in vars(self).items() if name not in _GIVEN}
        parts = saved_state.changing_parts(self._rope)
        rope = {f"rope/{name}": getattr(self._rope, name) for name in parts}
        return kept | rope | {"rope/tension": self._tension} | self._ropes.changing()

    @property
    def _tension(self) -> rows.Floats:
        """Tension of the elements [N], a view of the scratch."""
        return self._rope.work[rows.TENSION, : self._rope.state.counts[rows.ELEMENTS]]

    def _advance_some(self, steps: int) -> int:
        """Step on as far as inputs tell without a look at the rope; how many steps that was."""
        began = time.perf_counter()
        with self._lock:
            lost_m = self._cut.take(self.time_ns, float(self._boundary.value[0, rows.LINE]))
            if lost_m is not None:
                self._part(lost_m)
            steps = self._prescribe(self._cut.steps_before(self.time_ns, self.step_ns, steps))
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
        self._computing_s += time.perf_counter() - began
        if done < steps:
            raise SolverError(
                phrase(
                    f"step {self._steps + 1} at {self.time_ns * 1e-9:.2f} s",
                    "the rope's next state is not finite even at 1/32 of the step",
                    "the last good state is kept; shorten the step or check the scene",
                )
            )
        return done

    def _part(self, lost_m: float) -> None:
        """Cut the rope here and now, so far above its lower end [m], or at a node close by."""
        lost_m = self._sever(lost_m)
        self._lose(lost_m, float(self._boundary.value[0, rows.LINE]))

    def _lose(self, lost_m: float, left_m: float) -> None:
        """Note that the rope was cut now."""
        self._winch.lose(lost_m, left_m)
        self._cut.done = CutShot(self.time_ns * 1e-9, left_m, lost_m)

    def _sever(self, lost_m: float) -> float:
        """Go on with the rope in two; how much of it is below the cut [m]."""
        whole, now_s = self._rope._replace(effects=self._current.effects), self.time_ns * 1e-9
        winch = self.scene.winch
        place = Place(lost_m, winch.least_line_out_m if winch else math.inf, now_s)
        parts = sever(whole, self._boundary, place, without_load(whole.effects))
        self._rope = parts.upper
        self._ropes = PartedRopes(self.scene, parts.upper, parts.lower)
        self._current.effects = parts.upper.effects
        self._boundary.value[:, rows.LINE] -= parts.lost_m
        self._card_error = KnownError(words="unknown: the rope was cut")
        return parts.lost_m

    def _forget_borders(self, done: int) -> None:
        """Make the border after `done` steps the first row; what lies after it is still to come."""
        self._prescribed -= done
        for table in self._boundary:
            table[: self._prescribed + 1] = table[done : done + self._prescribed + 1]
        self._ropes.forget(done, self._prescribed)

    def _prescribe(self, steps: int) -> int:
        """Hang-off motion and line out at the borders of the next steps, from the inputs.

        Steps that an earlier call prescribed and could not do keep what they were given. Where a
        winch feels the rope, the next step must be done first: returns how many can be done now.
        """
        for row in range(self._prescribed + 1, steps + 1):
            begin_ns = self._time_ns + (row - 1) * self.step_ns
            felt = self._winch.feels(begin_ns)
            if row > 1 and (felt or self._ropes.feel(begin_ns)):
                return row - 1
            self._prescribe_border(row, begin_ns, felt)
            self._prescribed = row
        return steps

    def _prescribe_border(self, row: int, begin_ns: int, felt: bool) -> None:
        """The border at the end of the step that begins then; felt: the winch asks for the rope."""
        border_ns, rest_z = begin_ns + self.step_ns, float(self._rest[2])
        value, rate = self._boundary
        z, v = self._heave.at(border_ns)
        share, share_rate = ramp(border_ns * 1e-9, self.scene.ship.motion_ramp_s)
        heave = (share * z, share * v + share_rate * z)
        if self._heave.posed:  # else x and y are those of rest in every row
            for k, (aside, moving) in enumerate(self._heave.aside_at(border_ns)):
                value[row, k] = self._rest[k] + share * aside
                rate[row, k] = share * moving + share_rate * aside
        value[row, rows.Z], rate[row, rows.Z] = rest_z + heave[0], heave[1]
        rope = None
        if felt:
            borders = value[row - 1 : row + 1]
            line, pull = self.scene.ropes[0], float(self._pull[rows.PULL])
            course = Course(float(borders[0, rows.Z]) - rest_z, self._winch.payout_m_per_s2)
            rope = feel(self._rope, line, pull, borders, course)
        length, speed = self._winch.step(begin_ns, self.step_s, heave[1], rope)
        value[row, rows.LINE], rate[row, rows.LINE] = length, speed
        moves = self._heave.further_at(border_ns, (share, share_rate))
        self._ropes.prescribe(row, begin_ns, self.step_s, heave, moves)

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
        share, _ = ramp(self.time_ns * 1e-9, self.scene.ship.motion_ramp_s)
        taken = observe(
            self._rope.state,
            self._rope.work,
            Observation(
                stamp_ns=self.time_ns,
                step=self._steps,
                step_s=self.step_s,
                hang_off_m=self._boundary.value[0, :3].copy(),
                hang_off_m_per_s=self._boundary.rate[0, :3].copy(),
                heave_m=float(self._boundary.value[0, rows.Z] - self._rest[2]),
                pull=self._pull,
                recent=self._recent,
                line=LineOut(*(float(table[0, rows.LINE]) for table in self._boundary)),
                motion_ramp=share,
                winch_at_limit=at_limit,
                doubtful=unconverged > self._unconverged,
                computing_s=self._computing_s,
                inputs=inputs,
                card_error=self._card_error,
            ),
        )
        self._unconverged = unconverged
        self._recent = Extremes()
        taken = with_body(taken, self._rope)
        contact = bed_contact(self._rope)
        if contact is not None:
            taken = replace(taken, seabed=contact)
        taken = replace(taken, winches=() if winch is None else (winch,), cut=self._cut.done)
        return self._ropes.complete(taken, self.time_ns)
