"""Member of an ensemble: its variation, one rope with its state, its results, why it failed.

A member of a multi-line scene, or with tension feedback of its winch, has a `Twin` of its own for
boundary conditions and records: they belong to several ropes, or depend on the rope itself, so that
no other member can share them. It gets its inputs a batch of steps at a time. Its system of ropes
can still be stepped in SIMD lanes.

Members with equal inputs share their boundary conditions (`SharedBoundaries`).
"""

from __future__ import annotations

import copy
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.jit.wide import LANES
from rope_twin.core.joined.joints import System
from rope_twin.core.lanes.batch import sample_of
from rope_twin.core.lanes.group import Kind, kind_of, why_alone
from rope_twin.core.lanes.joined_group import JoinedKind, joined_kind_of, why_joined_alone
from rope_twin.core.lanes.step import SAMPLE_COLUMNS
from rope_twin.core.state import Boundary, Floats, Rope
from rope_twin.core.step import advance
from rope_twin.errors import InputError, SolverError
from rope_twin.scene.load import Change
from rope_twin.scene.rigging import is_joined, places, winch_of, winches_by_name
from rope_twin.scene.schema import WINCH, RopeLine, Scene, Triple
from rope_twin.twin.ensemble.scratch import Scratch
from rope_twin.twin.motion.boundary_conditions import (
    PrescribedMotion,
    SharedBoundary,
    WinchMotion,
    check_commands,
    is_known_in_advance,
)
from rope_twin.twin.motion.heave_track import HeaveSeries
from rope_twin.twin.recovery import step_failure
from rope_twin.twin.regrid import element_tension, is_slack, own_copies
from rope_twin.twin.ropes import OpenSteps
from rope_twin.twin.snapshot import Snapshot, amended
from rope_twin.twin.snapshot_builder import Extremes, build_snapshot, with_body, with_compensator
from rope_twin.twin.twin import Twin
from rope_twin.twin.winch.commands import CommandSample, schedule_samples
from rope_twin.twin.winch.winch import spooled_rope, winch_of_rope
from rope_twin.vortex.coupled import VivDragAmplification

# Columns of a watched step: top tension [N], those of an interval at its end, line out [m]
TOP, LINE_OUT, WATCHED = 0, SAMPLE_COLUMNS + 1, SAMPLE_COLUMNS + 2
HEAVE_LEAD_NS = 1_000_000_000  # lead of heave samples to the twin, which accepts up to 2 s


@dataclass(frozen=True)
class Variation:
    """Changes and inputs of one member."""

    changes: tuple[Change, ...] = ()  # of the scene's numbers
    heave: HeaveSeries | None = None  # None: the ship lies still
    commands: tuple[CommandSample, ...] | None = None  # of the winch; None: the scene's schedule


class SharedBoundaries:
    """Boundary conditions of members; those with equal inputs share them."""

    def __init__(self) -> None:
        self._winches: dict[Any, WinchMotion] = {}
        self._borders: dict[Any, SharedBoundary] = {}

    def of_rope(self, scene: Scene, variation: Variation) -> SharedBoundary:
        """Return the boundary conditions of a member that is one rope."""
        return self._of_hang_off(scene, scene.ropes[0], variation, scene.ship.hang_off_m)

    def of_system(self, scene: Scene, variation: Variation) -> dict[int, SharedBoundary] | None:
        """Return the motion of the hang-offs of a multi-line scene, by rope.

        None: there is one rope, or the payout of a winch depends on its tension.
        """
        if not is_joined(scene) or not is_known(scene, variation):
            return None
        points = places(scene)
        from_ship = [(r, line) for r, line in enumerate(scene.ropes) if line.from_ in points]
        return {
            r: self._of_hang_off(scene, line, variation, points[line.from_])
            for r, line in from_ship
        }

    def _of_hang_off(
        self, scene: Scene, line: RopeLine, variation: Variation, at_m: Triple
    ) -> SharedBoundary:
        """Return the motion of the hang-off at `at_m`, and the payout of its winch."""
        winch, step_s = winch_of(scene, line), scene.time.step_s
        ship = replace(scene.ship, hang_off_m=at_m)
        commands = variation.commands if line.from_ == WINCH else None
        compensated = winch is not None and winch.heave_compensation is not None
        heave_key = (ship, id(variation.heave)) if compensated else None
        joined = is_joined(scene)  # else the winch does not depend on the rope, and is shared
        spooled = spooled_rope(scene, line) if joined and winch is not None else None
        winch_key = (line.from_, winch, line.length_m, commands, heave_key, spooled)
        if winch_key not in self._winches:
            winch_of_line = winch_of_rope(scene, line) if joined else None
            winch_motion = WinchMotion(winch, line.length_m, commands, step_s, winch_of_line)
            self._winches[winch_key] = winch_motion
        boundary_key = (ship, winch_key, id(variation.heave))
        if boundary_key not in self._borders:
            shared = SharedBoundary(ship, self._winches[winch_key], variation.heave, step_s)
            self._borders[boundary_key] = shared
        return self._borders[boundary_key]


def is_known(scene: Scene, variation: Variation) -> bool:
    """Return whether the payout of all winches is known in advance."""
    return all(
        is_known_in_advance(winch, variation.commands if name == WINCH else None)
        for name, winch in winches_by_name(scene).items()
    )


def element_changes(ropes: Iterable[Rope]) -> int:
    """Return how many elements of these ropes have split or merged since the start."""
    health = (rope.state.health for rope in ropes)
    return sum(int(counts[rows.SPLITS] + counts[rows.MERGES]) for counts in health)


@dataclass(frozen=True)
class InitialEquilibrium:
    """Static equilibrium of a scene's rope, for all members of the same scene."""

    rope: Rope  # without scratch
    work_shape: tuple[int, int]
    pull: Floats  # force on the hang-off [N], (rows.PULL_COLUMNS,)
    tension: Floats  # of the elements from the lower end up [N]
    viv_drag: VivDragAmplification | None = None  # the scene's loosely coupled VIV model


@dataclass(frozen=True)
class MemberResults:
    """Results of a member since the start; before its first step the tension is the static one.

    If the member never started, its tensions are not finite.
    """

    steps: int
    tension_top_max_n: float
    tension_top_mean_n: float
    tension_top_min_n: float
    slack_share: float  # fraction of the samplings that found an element without tension
    unconverged_substeps: int
    failure: str = ""  # message of the error that stopped it early


class UnstartedMember:
    """A member without a static equilibrium to start from."""

    steps = 0

    def __init__(self, scene: Scene, failure: str) -> None:
        """Store the scene, and the reason why there is no equilibrium."""
        self.scene, self.failure = scene, failure

    def figures(self) -> MemberResults:
        """Return results without a finite tension."""
        empty = Extremes()
        return MemberResults(0, empty.high, empty.mean, empty.low, 0.0, 0, self.failure)


class Member:
    """One rope of an ensemble."""

    def __init__(
        self, scene: Scene, start: InitialEquilibrium, boundaries: SharedBoundary, watch: bool
    ) -> None:
        """Begin in static equilibrium; watch: record every step."""
        self.scene, self.boundaries, self.watch = scene, boundaries, watch
        self.failure = ""
        self.steps = 0
        self.lane_steps = self.given_up = 0  # steps in SIMD lanes, and by itself within a group
        self._step_ns = round(scene.time.step_s * 1e9)
        self.rope = start.rope._replace(  # without scratch arrays
            state=start.rope.state.copy(), effects=own_copies(start.rope.effects)
        )
        self._viv_drag = copy.deepcopy(start.viv_drag)
        self._work_shape = start.work_shape  # of the scratch array of its steps
        self._submitted = 0, boundaries.boundary  # first step of the motion, and that
        self._kind, self._kind_changes = kind_of(self.rope), 0
        self._tension, self._pull = start.tension, start.pull
        self._value, self._rate = (table[0] for table in boundaries.boundary)
        self._seen, self._recent = Extremes(), Extremes()
        self._recent.take([float(start.pull[rows.PULL])])
        self._intervals = self._slack_samples = 0
        self._unconverged = 0
        self.watched: list[Floats] = []  # steps, (steps, WATCHED) each

    def kind(self) -> Kind | None:
        """Return the properties that members of a SIMD group must share; None: none can join."""
        changes = element_changes((self.rope,))
        if changes != self._kind_changes:
            self._kind, self._kind_changes = kind_of(self.rope), changes
        return self._kind

    @property
    def why_alone(self) -> str:
        """Reason why it is not stepped in SIMD lanes; "": it could be."""
        return why_alone(self.rope)

    def submit(self, steps: int) -> None:
        """Prescribe the motion of the next steps."""
        self._submitted = self.steps, self.boundaries.through(self.steps, steps)

    def open_steps(self, steps: int, scratch: Scratch, lane: int = 0) -> OpenSteps:
        """Return the rope with a lane's scratch and the motion of its next steps, as offered."""
        first, motion = self._submitted
        span = slice(self.steps - first, self.steps - first + steps + 1)
        work = scratch.work((LANES, *self._work_shape))[lane]
        boundary = Boundary(*(table[span] for table in motion))
        return OpenSteps(self.rope._replace(work=work), boundary, steps)

    def go_on(self, steps: int, interval_steps: int, scratch: Scratch) -> None:
        """Do these steps alone, and check for slack after every `interval_steps`; it may fail."""
        opened = self.open_steps(steps, scratch)
        rope, done = opened.member, 0
        pulls, samples = np.zeros((steps, rows.PULL_COLUMNS)), np.zeros((steps, SAMPLE_COLUMNS))
        assert isinstance(rope, Rope)
        while done < steps:
            now = self.steps + done
            count = min(steps - done, interval_steps - now % interval_steps)
            if self._viv_drag is not None:
                count = min(count, self._viv_drag.steps_to_sampling(now))
            boundary = Boundary(*(table[done : done + count + 1] for table in opened.boundary))
            time_s, pull = now * self._step_ns * 1e-9, pulls[done : done + count]
            stepped = advance(rope, boundary, pull, time_s, count)
            done, now = done + stepped, now + stepped
            if stepped < count:
                break
            if self._viv_drag is not None and self._viv_drag.steps_to_sampling(now) == 0:
                present = Boundary(*(table[done:] for table in opened.boundary))
                self._viv_drag.observe((rope,), present, now, 0)
            if now % interval_steps == 0:
                self.count_slack(1, is_slack((rope,)))
            if self.watch:  # then every step is sampled
                samples[done - 1] = sample_of(rope)
        self.close_steps(opened, pulls[:done], samples[:done], done < steps)

    def close_steps(self, opened: OpenSteps, pulls: Floats, samples: Floats, failed: bool) -> None:
        """Record the steps that were done.

        pulls: (done, rows.PULL_COLUMNS); samples: of each step of a watched member, (done,
        SAMPLE_COLUMNS); failed: whether the next step failed.
        """
        done, rope = len(pulls), opened.member
        assert isinstance(rope, Rope)
        self._tension = element_tension(rope).copy()
        self._value, self._rate = (table[done] for table in opened.boundary)
        self.steps += done
        if failed:
            self.failure = step_failure(self.steps + 1, self.steps * self.scene.time.step_s)
        if done:
            self._pull, top = pulls[-1].copy(), pulls[:, rows.PULL]
            for extremes in (self._seen, self._recent):
                extremes.take(top.tolist())
            if self.watch:
                line_out = opened.boundary.value[1 : done + 1, rows.LINE]
                self.watched.append(np.column_stack([top, samples, line_out]))

    def count_slack(self, intervals: int, slack: int) -> None:
        """Add slack checks, of which `slack` found the rope slack."""
        self._intervals += intervals
        self._slack_samples += slack

    def figures(self) -> MemberResults:
        """Return the results since the start."""
        tension = self._seen if self.steps else self._recent
        return MemberResults(
            steps=self.steps,
            tension_top_max_n=tension.high,
            tension_top_mean_n=tension.mean,
            tension_top_min_n=tension.low,
            slack_share=self._slack_samples / self._intervals if self._intervals else 0.0,
            unconverged_substeps=int(self.rope.state.health[rows.SUBSTEPS_UNCONVERGED]),
            failure=self.failure,
        )

    def snapshot(self) -> Snapshot:
        """Return a frozen copy of the present and restart the recent extremes of tension."""
        state: Any = self.rope.state
        work = np.zeros(self._work_shape)
        work[rows.TENSION, : len(self._tension)] = self._tension
        rope = self.rope._replace(work=work)
        unconverged = int(state.health[rows.SUBSTEPS_UNCONVERGED])
        at, top = (self.steps * self._step_ns, self.steps), (self._seen, self._recent)
        boundary = Boundary(self._value, self._rate)
        snapshot = build_snapshot(self.scene, rope, boundary, self._pull, at, top)
        amended(snapshot, not_converged=unconverged > self._unconverged)
        self._unconverged, self._recent = unconverged, Extremes()
        if self._viv_drag is not None:
            (vibration,) = self._viv_drag.snapshots((rope,))
            amended(snapshot, vibration=vibration)
        return with_compensator(with_body(snapshot, rope), rope)


class TwinMember:
    """A member with a twin of its own."""

    watch = False  # its steps are not recorded

    def __init__(
        self,
        start: Twin,
        heave: HeaveSeries | None,
        commands: Sequence[CommandSample] | None,
        boundaries: Mapping[int, SharedBoundary] | None = None,
    ) -> None:
        """Start as a copy of a twin in static equilibrium.

        heave: None: the ship lies still; commands: of the first winch; None: its schedule;
        boundaries: motion of the hang-offs of a multi-line scene, by rope, or None if it depends on
        the ropes.

        Raises:
            InputError: the winch rejects a command, or the series moves a hang-off sideways, as
                ship poses do.
        """
        scene = start.scene
        check_commands(winch_of(scene, scene.ropes[0]), scene.ropes[0].length_m, commands or ())
        if heave is not None and heave.lateral is not None:
            problem = (
                "the ship's poses move its hang-offs sideways, which this scene takes from a run"
            )
            raise InputError("ensemble", problem, "give heave, or step it with `rope_twin run`")
        self.twin = start.branch()  # must not be stepped elsewhere
        self.twin.prescribe_motion()
        self._heave, self._commands = heave, commands
        self._samples = 0  # of the heave, given to the twin
        self._intervals = self._slack_samples = 0
        self.failure = ""
        self.lane_steps = self.given_up = 0  # steps in SIMD lanes, and by itself within a group
        self._boundaries = boundaries
        self._motion: PrescribedMotion | None = None
        joined = self.twin.joined
        if boundaries is not None and joined is not None:
            self._motion = PrescribedMotion(scene, joined.take_motion)
            self.twin.follow(self._motion)
            winches = {r: boundary.winch for r, boundary in boundaries.items()}
            self.twin.inputs.winch = winches[0]
            joined.share_winches(winches)
        self._kind: JoinedKind | None = None
        self._kind_changes = -1

    @property
    def scene(self) -> Scene:
        """The member's scene, with its changes."""
        return self.twin.scene

    @property
    def steps(self) -> int:
        """Number of completed steps."""
        return self.twin.steps

    @property
    def why_alone(self) -> str:
        """Reason why it is not stepped in SIMD lanes; "": it could be."""
        if self._boundaries is None:
            return "tension feedback of the winch"
        return why_joined_alone(self.system)

    @property
    def system(self) -> System:
        """The system of ropes, which there is in a multi-line scene only."""
        joined = self.twin.joined
        assert joined is not None
        return joined.system(self.twin.rope)

    def kind(self) -> JoinedKind | None:
        """Return the properties that members of a SIMD group must share; None: none can join."""
        if self._boundaries is None:
            return None
        system = self.system
        changes = element_changes(system.ropes)
        if changes != self._kind_changes:
            known = self._kind
            self._kind = known.with_elements_of(system) if known else joined_kind_of(system)
            self._kind_changes = changes
        return self._kind

    def submit(self, steps: int) -> None:
        """Pass the inputs of the next steps to the twin; the member fails if one is rejected."""
        now_ns, first = self.twin.time_ns, self.steps
        self.failure = self._submit(now_ns, now_ns + steps * self.twin.step_ns)
        if self._motion is not None and self._boundaries is not None:
            motion = {r: boundary.through(first, steps) for r, boundary in self._boundaries.items()}
            self._motion.give(first, motion)

    def go_on(self, steps: int, interval_steps: int, scratch: Scratch) -> None:
        """Do these steps alone, and check for slack after every `interval_steps`; it may fail."""
        end = self.steps + steps
        try:
            while self.steps < end:
                self.twin.advance(
                    min(end - self.steps, interval_steps - self.steps % interval_steps)
                )
                if self.steps % interval_steps == 0:
                    self.count_slack(1, is_slack(self.twin.all_ropes))
        except SolverError as error:
            self.failure = str(error)

    def open_steps(self, steps: int, scratch: Scratch, lane: int = 0) -> OpenSteps:
        """Return the next steps, this number at most, for lanes to do."""
        return self.twin.open_steps(min(steps, rows.STEPS_PER_CALL))

    def close_steps(self, opened: OpenSteps, pulls: Floats, samples: Floats, failed: bool) -> None:
        """Record the steps that were done, (ropes, done, rows.PULL_COLUMNS).

        failed: whether the next step failed.
        """
        try:
            self.twin.close_steps(opened, pulls, pulls.shape[1] + failed)
        except SolverError as error:
            self.failure = str(error)

    def count_slack(self, intervals: int, slack: int) -> None:
        """Add slack checks, of which `slack` found an element without tension."""
        self._intervals += intervals
        self._slack_samples += slack

    def _submit(self, from_ns: int, to_ns: int) -> str:
        """Pass the inputs of a batch to the twin; return why it rejects one of the member's own."""
        faults = []
        if (series := self._heave) is not None:
            stamps, reach_ns = series.stamp_ns, to_ns + HEAVE_LEAD_NS + series.start_ns
            while self._samples < len(stamps) and stamps[self._samples] <= reach_ns:
                k, self._samples = self._samples, self._samples + 1
                at_ns = int(stamps[k]) - series.start_ns
                if at_ns > -HEAVE_LEAD_NS:
                    motion = float(series.position_m[k]), float(series.velocity_m_per_s[k])
                    faults.append(self.twin.submit_heave(at_ns, *motion))
        if self._boundaries is not None:
            return next(filter(None, faults), "")
        for name, winch in winches_by_name(self.scene).items():
            if name == WINCH and self._commands is not None:
                continue
            for sample in schedule_samples(winch, from_ns, to_ns):
                self.twin.submit_command(sample.stamp_ns, sample.command, name)
        for sample in self._commands or ():
            if from_ns <= sample.stamp_ns < to_ns:
                faults.append(self.twin.submit_command(sample.stamp_ns, sample.command))
        return next(filter(None, faults), "")

    def figures(self) -> MemberResults:
        """Return the results since the start; tensions are those of the first rope."""
        statistics = self.twin.statistics()
        return MemberResults(
            steps=statistics.steps,
            tension_top_max_n=statistics.tension_top_max_n,
            tension_top_mean_n=statistics.tension_top_mean_n,
            tension_top_min_n=statistics.tension_top_min_n,
            slack_share=self._slack_samples / self._intervals if self._intervals else 0.0,
            unconverged_substeps=int(self.twin.rope.state.health[rows.SUBSTEPS_UNCONVERGED]),
            failure=self.failure,
        )

    def snapshot(self) -> Snapshot:
        """Return a frozen copy of the present and restart the recent extremes of tension."""
        return self.twin.snapshot()


SteppedMember = Member | TwinMember
