"""Simulation of one scene (`Twin`): inputs, motion, ropes and monitors, advanced in time.

Inputs carry a time stamp. Time is counted in whole nanoseconds since the start, so that a real-time
and an offline run with the same inputs see the same numbers and are bit-identical.
"""

from __future__ import annotations

import copy
import functools
import math
import operator
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Concatenate, ParamSpec, Self, TypeVar

import numpy as np

from rope_twin.core import state as rows
from rope_twin.errors import InputError, SolverError, StateError
from rope_twin.scene.convergence import known_error
from rope_twin.scene.error_bound import AccuracyLevel, KnownError
from rope_twin.scene.rigging import is_joined, winch_of
from rope_twin.scene.schema import WINCH, Scene
from rope_twin.twin.cut_input import rope_number
from rope_twin.twin.inputs import TwinInputs
from rope_twin.twin.level import Mesh, error_at_level
from rope_twin.twin.monitors import (
    NO_MONITORS,
    Chunk,
    Monitor,
    Monitors,
    TwinView,
    chunk_of,
    new_monitors,
)
from rope_twin.twin.motion.boundary_conditions import BoundaryConditions, LastStep, PrescribedMotion
from rope_twin.twin.multi_line import MultiLineRopes
from rope_twin.twin.multi_line_snapshot import with_vibration
from rope_twin.twin.pacing import steps_in_slot
from rope_twin.twin.recovery import Checkpoint, step_failure
from rope_twin.twin.rope_cut import CutPosition
from rope_twin.twin.ropes import OpenSteps, RopeSystem, new_viv_drag
from rope_twin.twin.run_record import RunRecord
from rope_twin.twin.snapshot import SPEED, CutSnapshot, Snapshot, amended
from rope_twin.twin.snapshot_builder import RunStatistics, build_snapshot
from rope_twin.twin.state import (
    Clock,
    SavedState,
    StateDescription,
    TwinState,
    capture,
    check_scene,
    load_state,
    run_stamp,
)
from rope_twin.twin.validity import CUT_REASON
from rope_twin.twin.winch.commands import Payout, WinchCommand

AnyMonitor = TypeVar("AnyMonitor", bound=Monitor)
Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")


def _delegate_to_inputs(
    method: Callable[Concatenate[TwinInputs, Arguments], Result],
) -> Callable[Concatenate[Twin, Arguments], Result]:
    """Return a method of the twin that delegates to this method of its inputs."""

    @functools.wraps(method)
    def delegate(twin: Twin, /, *args: Arguments.args, **named: Arguments.kwargs) -> Result:
        return method(twin.inputs, *args, **named)

    return delegate


class Twin:
    """Real-time simulation of one scene; its state can be saved, restored and branched.

    Its inputs are accepted from any thread; all else belongs to the stepping thread.

    Raises:
        SceneError: the scene cannot be built, or its rope has no static equilibrium to start from.
    """

    def __init__(self, scene: Scene, monitors: Monitors = NO_MONITORS) -> None:
        """Build the twin of a scene with the monitors that a run asks for."""
        self._monitors = new_monitors(scene, monitors)  # first, as they may reject the scene
        self.scene = scene
        self.restored = False  # whether it resumed from a saved state
        self.failure_folder: Path | None = None  # for the state from which a step failed
        self._clock = Clock()
        self._system = RopeSystem(scene, rows.STEPS_PER_CALL)
        self._mesh = Mesh(scene, self._system.ropes.all_with(self._system.first))
        self.inputs = TwinInputs(scene, self._system.ropes, self._clock)
        length_m = self.inputs.winch.line.length_m
        self._motion = BoundaryConditions(scene, rows.STEPS_PER_CALL, length_m)
        self._study_error = known_error(scene)  # by the scene's convergence study alone
        end_n = float(self._system.tension[0])
        self._record = RunRecord(scene, self._system.ropes, self._system.upper_pulls, end_n)
        self.viv_drag = new_viv_drag(scene, self._system)  # None: the scene has no such model
        for monitor in self._monitors:
            monitor.start(self.inspect(), self._present())
        sources = [one for one in (self.viv_drag, *self._monitors) if one is not None]
        # for the user before the run
        self.notice = "\n".join(source.notice for source in sources if source.notice)

    # Inputs, accepted from any thread

    submit_heave = _delegate_to_inputs(TwinInputs.submit_heave)
    submit_pose = _delegate_to_inputs(TwinInputs.submit_pose)
    submit_lower_end = _delegate_to_inputs(TwinInputs.submit_lower_end)
    submit_current = _delegate_to_inputs(TwinInputs.submit_current)
    submit_cut = _delegate_to_inputs(TwinInputs.submit_cut)
    submit_measurement = _delegate_to_inputs(TwinInputs.submit_measurement)
    submit_figures = _delegate_to_inputs(TwinInputs.submit_figures)
    submit_forecast_score = _delegate_to_inputs(TwinInputs.submit_forecast_score)
    take_remark = _delegate_to_inputs(TwinInputs.take_remark)
    prescribe_motion = _delegate_to_inputs(TwinInputs.prescribe_motion)

    def submit_speed(self, stamp_ns: int | None, speed_m_per_s: float, winch: str = WINCH) -> str:
        """Command a winch speed, + pays out (stamp None: at once); return "" or the rejection."""
        return self.submit_command(stamp_ns, WinchCommand(SPEED, speed_m_per_s), winch)

    def submit_command(
        self, stamp_ns: int | None, command: WinchCommand, winch: str = WINCH
    ) -> str:
        """Command or switch a winch (stamp None: at once); return "" or the rejection.

        A command for an unknown winch counts as rejected by the first one.
        """
        refusal = self.inputs.submit_command(stamp_ns, command, winch)
        if self._monitors and not refusal:
            with self.inputs.lock:
                for monitor in self._monitors:
                    monitor.command(self.time_ns, self.inputs.rope_of(winch), stamp_ns, command)
        return refusal

    def invalidate_inputs(self) -> None:
        """Invalidate inputs that were known in advance, after a pause or a restart."""
        self.inputs.invalidate()
        with self.inputs.lock:
            for monitor in self._monitors:
                monitor.invalidate()

    # Present

    def inspect(self) -> TwinView:
        """Return a read-only view for analyses; use it in the stepping thread, until the next step.

        Its arrays are those in use, with the effects of the present current.
        """
        return TwinView(
            self.scene,
            self._clock,
            self.step_s,
            self.rope,
            self._system.ropes,
            self._motion.boundary,
            self._system.pull,
            self.inputs,
            self.viv_drag,
        )

    def monitor(self, kind: type[AnyMonitor]) -> AnyMonitor | None:
        """Return the run's monitor of this type, or None if the run has none."""
        return next((monitor for monitor in self._monitors if isinstance(monitor, kind)), None)

    def _present(self) -> Chunk:
        """Return the ropes at present, after no step."""
        return chunk_of(self.inspect(), self._system.pull[:0], self._motion.boundary)

    @property
    def time_ns(self) -> int:
        """Time since the start [ns]."""
        return self._clock.time_ns

    @property
    def steps(self) -> int:
        """Number of completed time steps."""
        return self._clock.steps

    @property
    def step_ns(self) -> int:
        """Length of a step [ns]."""
        return self._mesh.level.step_ns

    @property
    def step_s(self) -> float:
        """Length of a step [s]."""
        return self._system.first.model.step

    @property
    def level(self) -> AccuracyLevel:
        """Accuracy level in use: number of elements and time step."""
        return self._mesh.level

    @property
    def rope(self) -> rows.Rope:
        """The core's arrays in their present state; use them in the stepping thread only."""
        return self._system.with_effects(self.inputs.current.effects)

    @property
    def all_ropes(self) -> tuple[rows.Rope, ...]:
        """The core's arrays of all ropes in their present state, the first one as `rope`."""
        return self._system.ropes.all_with(self.rope)

    @property
    def joined(self) -> MultiLineRopes | None:
        """The multi-line system; None for a single rope."""
        return self._system.joined

    @property
    def cut(self) -> CutSnapshot | None:
        """Position and time of the cut; None if no rope was cut."""
        return self.inputs.cut.done

    @property
    def study_error(self) -> KnownError:
        """Error of the top tension that is known at present (twin/validity.py)."""
        return self.inputs.validity.claim(self._study_error, self.time_ns)

    @property
    def top_tension_n(self) -> float:
        """Tension of the first rope at its hang-off after the newest step [N]."""
        return float(self._system.pull[rows.PULL])

    @property
    def is_finite(self) -> bool:
        """Whether the state is finite and may be published; call it from the stepping thread."""
        return self._system.is_finite and bool(np.isfinite(self._motion.boundary.value[0]).all())

    def statistics(self) -> RunStatistics:
        """Return the statistics of the run since its start."""
        return self._record.statistics(self._clock)

    def invalidate_error(self, why: str) -> None:
        """Mark the tension error as unknown on every accuracy level, for the reason `why`."""
        self.inputs.validity.invalidate(why)

    # Steps

    def advance(self, steps: int) -> None:
        """Advance by this number of time steps.

        Raises:
            InputError: the number is negative, or not a whole one.
            SolverError: the next state would not be finite. The last good state is kept; with the
                inputs of the failing step it is written to `failure_folder`, if that is set.
        """
        try:
            steps = operator.index(steps)
        except TypeError:
            remedy = f"give a whole number of steps, each of {self.step_s:g} s"
            raise InputError("advance", f"{steps!r} is not a number of steps", remedy) from None
        if steps < 0:
            problem = f"{steps} steps would lead back in time"
            raise InputError("advance", problem, "restore an earlier saved state")
        try:
            while steps > 0:
                steps -= self._advance_chunk(min(steps, rows.STEPS_PER_CALL))
        except SolverError as error:
            raise SolverError(
                str(error).removesuffix(".") + self._save_failed_state(error)
            ) from error

    def _advance_chunk(self, steps: int) -> int:
        """Advance by at most this number of steps; return how many were done.

        Raises:
            SolverError: the next state would not be finite.
        """
        begin_s, clock = time.perf_counter(), self._clock
        rope, steps = self._prescribe(steps)
        pulls = self._system.advance(rope, self._motion.boundary, clock.time_ns * 1e-9, steps)
        self._complete(pulls, steps, begin_s)
        return len(pulls)

    def follow(self, motion: PrescribedMotion) -> None:
        """Use this prescribed motion for all hang-offs from the next step on."""
        motion.restore(self._motion.state())
        self._motion = motion

    def open_steps(self, steps: int) -> OpenSteps:
        """Prescribe at most this number of steps of a multi-line system, for SIMD lanes to do."""
        begin_s = time.perf_counter()
        rope, steps = self._prescribe(steps)
        return self._system.open(rope, self._motion.boundary, steps, begin_s)

    def close_steps(self, opened: OpenSteps, pulls: rows.Floats, wanted: int) -> None:
        """Complete steps that lanes did, as `advance` does; pulls: (ropes, done, PULL_COLUMNS)."""
        self._complete(self._system.close(opened, pulls), wanted, opened.begin_s)

    def _complete(self, pulls: rows.Floats, steps: int, begin_s: float) -> None:
        """Record the steps just done; raises SolverError if they are fewer than `steps`."""
        clock, motion, done = self._clock, self._motion, len(pulls)
        clock.advance(done, self.step_ns)
        self._record.take(pulls[:, rows.PULL].tolist())
        boundary = motion.until(done) if self._monitors else motion.boundary
        motion.forget(done)
        self._system.ropes.forget(done, motion.steps)
        self._observe(pulls, boundary)
        clock.computing_s += time.perf_counter() - begin_s
        if done < steps:
            raise SolverError(step_failure(clock.steps + 1, clock.time_ns * 1e-9))

    def _prescribe(self, steps: int) -> tuple[rows.Rope, int]:
        """Prescribe the motion of the next steps, after a cut that is due.

        Return the first rope with the effects in use, and the number of steps up to the next
        observation or tension feedback, `steps` at most.
        """
        clock, inputs, system = self._clock, self.inputs, self._system
        if self.viv_drag is not None:
            steps = min(steps, self.viv_drag.steps_to_sampling(clock.steps))
        for monitor in self._monitors:
            steps = min(steps, monitor.steps_to_observation(self.inspect()))
        if inputs.measured.active:
            steps = min(steps, inputs.measured.steps_to_sample(clock.steps, self.step_ns))
        with inputs.lock:
            inputs.check_profiles()
            cut_due = inputs.cut.take(clock.time_ns, self._length_m)
            if cut_due is not None:
                lost_m, number = cut_due
                lost_m = self.split(lost_m, number)
                self._record_cut(lost_m, self._length_m(number), number)
                for monitor in self._monitors:
                    monitor.cut(self.inspect())
            steps = inputs.steps_before(clock.time_ns, self.step_ns, steps)
            present = LastStep(clock.time_ns, self.step_ns, system.first, self.top_tension_n)
            steps = self._motion.fill(steps, inputs, present)
            if inputs.lower_end is not None:
                effects = inputs.current.effects
                inputs.lower_end.prescribe(effects, clock.time_ns, self.step_ns, steps)
            return self.rope, steps

    def _observe(self, pulls: rows.Floats, boundary: rows.Boundary) -> None:
        """Sample the loosely coupled VIV model, if that is due, and let the monitors observe.

        pulls: after each step just done; boundary: boundary conditions of these steps.
        """
        viv_drag, steps, measured = self.viv_drag, self._clock.steps, self.inputs.measured
        if viv_drag is not None and viv_drag.steps_to_sampling(steps) == 0:
            changes = self.inputs.current.changes
            viv_drag.observe(self.all_ropes, self._motion.boundary, steps, changes)
        if measured.active and measured.is_due(steps, self.step_ns):
            measured.record(self.time_ns, self._system.computed(self._motion.boundary))
        if self._monitors:
            view = self.inspect()
            chunk = chunk_of(view, pulls, boundary)
            for monitor in self._monitors:
                monitor.observe(view, chunk)

    def _save_failed_state(self, error: SolverError) -> str:
        """Write the state from which the step failed; return the end of the error message."""
        if self.failure_folder is None:
            return "."
        path = self.failure_folder / f"{self.scene.name}_failed_step_{self.steps + 1}.state"
        try:
            self.capture(str(error)).write(path)
        except StateError as write_error:
            return f"; {write_error}"
        return f"; state and inputs of that step are in {path}."

    def snapshot(self) -> Snapshot:
        """Return a frozen copy of the present; call it from the stepping thread."""
        record, inputs, system = self._record, self.inputs, self._system
        effects, ropes, first = inputs.current.effects, system.ropes, system.first
        boundary = rows.Boundary(*(table[0] for table in self._motion.boundary))
        with inputs.lock:
            health, at_limit, winch = (
                inputs.health(),
                inputs.winch.at_limit,
                inputs.winch.snapshot(),
            )
        ship_moves = self.scene.sea_state.moves or health["heave"].accepted > 0
        at, top = (self.time_ns, self.steps), (record.run, record.recent)
        snapshot = build_snapshot(self.scene, self.rope, boundary, system.pull, at, top, ship_moves)
        amended(
            snapshot,
            winch_at_limit=at_limit,
            not_converged=system.unconverged > record.unconverged,
            solver=snapshot.solver._replace(computing_s=self._clock.computing_s),
            inputs=health,
            winches=() if winch is None else (winch,),
            cut=self.cut,
        )
        record.begin_interval(system.unconverged)
        snapshot = record.add_contact(snapshot, first, ropes)
        snapshot = ropes.complete(snapshot, self.time_ns, effects)
        if self.viv_drag is not None:
            snapshot = with_vibration(self.scene, snapshot, self.viv_drag.snapshots(self.all_ropes))
        inputs.validity.observe(snapshot, inputs.motion_judged)
        snapshot = amended(record.add_loads(snapshot, first, ropes), study_error=self.study_error)
        for monitor in self._monitors:
            snapshot = monitor.amend(self.inspect(), snapshot)
        return record.judge(inputs.complete(snapshot), effects, inputs.factors)

    # Changes of the ropes between steps

    def set_level(self, level: AccuracyLevel) -> None:
        """Continue with another mesh or time step; call it from the stepping thread.

        Time, paid-out lengths, connections, payloads and the tension at the hang-offs are kept.

        Raises:
            StateError: a rope was cut; its parts keep their elements.
        """
        if self.cut is not None:
            raise StateError("other elements", "the rope was cut", "its parts keep theirs")
        boundary, counts = self._motion.boundary, (self.steps, self.inputs.current.changes)
        self._motion.steps = 0  # boundary conditions ahead are valid for the old step only
        if self.viv_drag is not None:
            self.viv_drag.sample_now(self.all_ropes, boundary, *counts)
        self.inputs.current.effects = self._system.regrid(self.rope, self._mesh, level, boundary)
        if self.viv_drag is not None:
            self.viv_drag.set_step(self.step_s, steps_in_slot(self.step_s))
        self._study_error = error_at_level(self.scene, level)
        self._restart_monitors()

    def _restart_monitors(self) -> None:
        for monitor in self._monitors:
            monitor.restart(self.inspect(), self._present())

    def _length_m(self, rope: int) -> float:
        """Return the present unstretched length of a rope [m]."""
        first = self._motion.boundary.value[0, rows.LINE]
        return self._system.ropes.length_m(rope) if rope > 0 else float(first)

    def _record_cut(self, lost_m: float, left_m: float, rope: int) -> None:
        """Record a cut at the present time."""
        if rope == 0:
            self.inputs.winch.adapt_to_cut(lost_m, left_m)
        else:
            self._system.ropes.adapt_to_cut(rope, lost_m, left_m)
        name = self.scene.ropes[rope].name if is_joined(self.scene) else ""
        self.inputs.cut.done = CutSnapshot(self.time_ns * 1e-9, left_m, lost_m, name)

    def split(self, lost_m: float, rope: int = 0) -> float:
        """Split a rope in two; return the length below the cut [m]."""
        ropes, now_s = self.all_ropes, self.time_ns * 1e-9
        winch = winch_of(self.scene, self.scene.ropes[rope])
        position = CutPosition(lost_m, winch.min_line_out_m if winch else math.inf, now_s, rope)
        system, boundary = self._system, self._motion.boundary
        lost_m = system.cut(ropes[0], boundary, position)
        self.inputs.ropes, self.inputs.current.effects = system.ropes, system.first.effects
        if self.viv_drag is not None:
            self.viv_drag.cut(rope, ropes[rope], self.all_ropes[rope])
        if rope == 0:
            boundary.value[:, rows.LINE] -= lost_m
        self.invalidate_error(CUT_REASON)
        return lost_m

    def discard_prescribed(self) -> None:
        """Discard motion prescribed in advance, after a failed step; for the stepping thread.

        Winches continue from their last paid-out length.
        """
        with self.inputs.lock:
            self._motion.steps = 0
            self._record.quality.fail(self.time_ns)
            value, rate = (float(table[0, rows.LINE]) for table in self._motion.boundary)
            self.inputs.winch.continue_from(Payout(value, rate))
            self._system.ropes.discard_prescribed()

    def checkpoint(self) -> Checkpoint:
        """Return a copy of all that the steps change, for `return_to`; for the stepping thread."""
        boundary = self._system.ropes.present_boundary(self._motion.boundary)
        effects = self.inputs.current.effects
        arrays = {name: array.copy() for name, array in self._system.moving_arrays(effects).items()}
        extremes = self._record.extremes()
        return Checkpoint(self.time_ns, self.level, self.cut, boundary, arrays, effects, extremes)

    def return_to(self, checkpoint: Checkpoint) -> bool:
        """Return the ropes to an earlier state at the present time; return whether the state fits.

        Hang-offs are blended from their earlier positions into their live motion; winches continue
        from their earlier paid-out length with the present commands. A current profile accepted
        since then is reverted. Call it from the stepping thread.
        """
        fits = checkpoint.level == self.level and checkpoint.cut is self.cut
        if fits:
            present = self._system.ropes.present_boundary(self._motion.boundary)
            self.revert_current(checkpoint)
            fits = self._system.restore_checkpoint(checkpoint.arrays, self.inputs.current.effects)
        if fits:
            self._motion.return_to(checkpoint.boundary, present, self.time_ns)
            self._record.restore_finite(checkpoint.extremes)
            self.discard_prescribed()
        self._restart_monitors()
        return fits

    def revert_current(self, checkpoint: Checkpoint) -> bool:
        """Revert a current profile accepted since the checkpoint; return whether there was one."""
        with self.inputs.lock:
            return self.inputs.current.revert(checkpoint.effects, self.time_ns)

    # State

    def save(self, path: str | Path) -> None:
        """Write a state from which `restore` resumes bit-identically; for the stepping thread.

        Raises:
            StateError: the file cannot be written; an existing file of this name is kept.
        """
        self.capture().write(Path(path))

    def capture(self, failure: str = "") -> SavedState:
        """Return in memory the state that `save` writes; call it from the stepping thread.

        failure: the error message, if a step from this state failed.
        """
        system, (value, rate) = self._system, self._motion.boundary
        lowest = system.ropes.lowest(system.first).state
        payload = lowest.nodes[rows.POSITION : rows.POSITION + 3, 0]
        cut = self.cut
        about = StateDescription(
            **run_stamp(self.scene, failure),
            time_s=self.time_ns * 1e-9,
            step=self.steps,
            step_s=self.step_s,
            halvings=self.level.halvings,
            elements=int(system.first.state.counts[rows.ELEMENTS]),
            line_out_m=float(value[0, rows.LINE]),
            payout_speed_m_per_s=float(rate[0, rows.LINE]),
            tension_top_n=self.top_tension_n,
            payload_position_m=tuple(payload.tolist()),
            cut_lost_m=cut.lost_m if cut else 0.0,
            cut_left_m=cut.left_m if cut else 0.0,
            cut_rope=cut.rope if cut else "",
        )
        with self.inputs.lock:
            return capture(self._state(), about, self.scene)

    @classmethod
    def restore(
        cls, saved: str | Path | SavedState, scene: Scene, monitors: Monitors = NO_MONITORS
    ) -> Self:
        """Return a twin that resumes from a saved state of this scene.

        saved: the state, or the path of its file. monitors: those of the run; they continue as far
        as the state has them.

        Raises:
            StateError: the file is invalid, or the scene differs; the message names the difference.
            SceneError: as for a new twin.
        """
        state = saved if isinstance(saved, SavedState) else load_state(saved)
        check_scene(state, scene)
        twin = cls(scene, monitors)
        if state.level != twin.level:
            twin.set_level(state.level)
        if (lost_m := state.about.cut_lost_m) > 0.0:  # anywhere: arrays are restored below
            rope = rope_number(scene, state.about.cut_rope)
            twin.split(0.5 * twin._length_m(rope), rope)
            twin._record_cut(lost_m, state.about.cut_left_m, rope)
        twin._continue_from(state.restored(twin._state()))
        if twin.viv_drag is not None:
            twin.viv_drag.take_back(state.read_monitor("viv_drag", twin.viv_drag.kept()))
        for monitor in twin._monitors:
            monitor.restore(twin.inspect(), twin._present(), state)
        twin.restored = True
        return twin

    def branch(self) -> Twin:
        """Return an independent, bit-identical copy; call it from the stepping thread."""
        inputs = self.inputs
        with inputs.lock:
            shared: dict[int, Any] = {
                id(item): item for item in (self.scene, inputs.scene_motion) if item is not None
            }
            shared[id(inputs.lock)] = threading.Lock()
            return copy.deepcopy(self, shared)

    def _state(self) -> TwinState:
        """Return the present state, which shares its arrays and inputs with the twin."""
        monitor_states: dict[str, Any] = (
            {} if self.viv_drag is None else {"viv_drag": self.viv_drag.kept()}
        )
        for monitor in self._monitors:
            monitor_states |= monitor.state()
        return TwinState(
            clock=self._clock,
            mesh=self._mesh.state(),
            ropes=self._system.arrays(),
            motion=self._motion.state(),
            inputs=self.inputs.state(),
            record=self._record.state(),
            monitors=monitor_states,
        )

    def _continue_from(self, state: TwinState) -> None:
        """Continue from the restored state of this twin, whose clock is restored in place."""
        self._mesh.restore(state.mesh)
        self._motion.restore(state.motion)
        self.inputs.restore(state.inputs)
        self._record.restore(state.record)
        self._system.restore(state.ropes, self.inputs.current.effects)
