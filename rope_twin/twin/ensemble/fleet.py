"""Fleet: members of one scene that begin from any state and take figures and inputs as arrays.

A forecast or an estimator runs many short simulations of the suspended rope or multi-line system,
each with its own heave, line out or payload. The members of a fleet have a mesh and a time step of
their own, coarser than those of the live twin. They are stepped in SIMD lanes like an ensemble's
(`core/lanes`), but their boundary conditions are arrays, their figures are set by writing to arrays
without another scene or statics, and the top tension of every step is returned. Minimum tension and
the payload's motion are reduced in the lanes over each sampling interval.

A member is bit-identical to a `Twin` of the same mesh, step, state and inputs. Members of a scene
whose effects do not step in lanes step alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.joined.joints import System
from rope_twin.core.lanes.batch import Lanes
from rope_twin.core.lanes.step import (
    LOWEST_TENSION,
    MIN_TENSION,
    PAYLOAD_DEPTH,
    PAYLOAD_DESCENT,
    SAMPLE_COLUMNS,
    Run,
)
from rope_twin.core.state import Boundary, Floats, Ints, Rope
from rope_twin.errors import InputError, did_you_mean, whole_number
from rope_twin.scene.load import at_setting, load_scene
from rope_twin.scene.rigging import is_joined, winch_of, winches_by_name
from rope_twin.scene.schema import Scene
from rope_twin.scene.vortex import model_beside
from rope_twin.twin.ensemble.fleet_members import (
    FleetInputs,
    FleetRecord,
    FleetState,
    LiveState,
)
from rope_twin.twin.ensemble.fleet_ropes import RopeMembers
from rope_twin.twin.ensemble.fleet_systems import SystemMembers
from rope_twin.twin.ensemble.live_state import live_state
from rope_twin.twin.ensemble.scratch import Scratch
from rope_twin.twin.figures import FIGURES, Factors, checked_factors, figures_of
from rope_twin.twin.recovery import step_failure

MAX_RANGE_STEPS = 1200  # a minute of 50 ms


class Record:
    """Results of a call: top tension of each step, and the samples of each interval."""

    def __init__(self, lead: tuple[int, ...], steps: int, intervals: int, members: int) -> None:
        """Allocate results; lead: axes before those of a rope."""
        self.top: Floats = np.full((*lead, steps, members), np.nan)
        self.samples: Floats = np.full((*lead, intervals, SAMPLE_COLUMNS, members), np.nan)
        self.samples[..., MIN_TENSION, :] = np.inf
        self._failed: list[tuple[int, int, int]] = []

    def fail(self, step: int, interval: int, member: int) -> None:
        """Record the step and the sampling interval at which a member failed."""
        self._failed.append((step, interval, member))

    def close(self) -> None:
        """Set the results of failed members to NaN from the failing step on."""
        for step, interval, member in self._failed:
            self.top[..., step:, member] = np.nan
            self.samples[..., interval:, :, member] = np.nan
        min_tension = self.samples[..., MIN_TENSION, :]
        min_tension[np.isinf(min_tension)] = np.nan


class StepRange:
    """Range of steps of all members that have not failed.

    Members of one kind share the lanes, where their states stay for the whole range. When elements
    of a member are added or removed, its group stops (core/lanes/batch), and all continue with
    members that then have as many; members with the same line out change at the same step.
    """

    def __init__(
        self,
        members: RopeMembers | SystemMembers,
        boundaries: Any,
        record: Record,
        interval_steps: int,
        span: tuple[int, int, int],
    ) -> None:
        """Begin a range of steps.

        boundaries: boundary conditions of the members; interval_steps: number of steps of
        an interval; span: first step, number of steps, and time at the beginning [ns].
        """
        self._members, self._boundaries, self._record = members, boundaries, record
        self._first, self._steps, time_ns = span
        self._interval_steps = interval_steps
        self._steps_before = time_ns // round(members.step_s * 1e9)
        self._time_s = time_ns * 1e-9

    def groups(self) -> list[Ints]:
        """Return the members that have not failed, in groups to be stepped one after another.

        Members with the same line out at the end are neighbours: they have the same payout, so that
        elements are added and removed in all lanes of a group at once.
        """
        members = np.array(self._members.running, dtype=np.int64)
        line = self._boundaries.line_out_m[self._first + self._steps]
        if line.ndim:
            members = members[np.argsort(line[members], kind="stable")]
        return list(self._members.groups_by_kind(members))

    def run(self, members: Ints, scratch: Scratch) -> None:
        """Step members of one kind to the end of the range, each in a lane of its own."""
        done = dict.fromkeys(members.tolist(), 0)
        while done:
            first = min(done.values())
            end = min((steps for steps in done.values() if steps > first), default=self._steps)
            behind = np.array([k for k, steps in done.items() if steps == first], dtype=np.int64)
            for same_kind in sorted(self._members.groups_by_kind(behind), key=len, reverse=True):
                end, reached = self._in_lanes(members, same_kind, (first, end), scratch)
                for member in same_kind.tolist():
                    done[member] = reached.get(member, self._steps)
            done = {member: steps for member, steps in done.items() if steps < self._steps}

    def _in_lanes(
        self, members: Ints, same_kind: Ints, span: tuple[int, int], scratch: Scratch
    ) -> tuple[int, dict[int, int]]:
        """Step members of one kind, at most to a step by which elements of one change.

        members: of all lanes, of which those of other kinds are not in use; span: steps done
        before, and at most at the end. Returns the steps done in lanes, and those done by each
        member that has not failed.
        """
        fleet_members, (first, end) = self._members, span
        used = np.isin(members, same_kind)
        lanes = np.flatnonzero(used).tolist()
        members = np.where(used, members, same_kind[0])  # lanes that are not in use get a copy
        kind, begun = fleet_members.kind_of(int(same_kind[0])), self._first + first
        model = fleet_members.alone(int(same_kind[0]), scratch)
        group = scratch.group(kind, model, self._steps, self._interval(self._steps - 1) + 1)
        fleet_members.load(group, members, lanes, scratch)
        boundary = Boundary(*(table[..., first : end + 1, :, :] for table in group.boundary))
        self._boundaries.fill(boundary, members, begun)
        fleet_members.place(boundary, members)

        def member_of(lane: int) -> Rope | System:
            return fleet_members.alone(int(members[lane]), scratch)

        run = Run(self._time_s, first, end, 0, self._first, self._interval_steps, 0)
        done, running, left, failed, _ = group.step(lanes, member_of, run)
        fleet_members.take(group, members, running, scratch)
        self._record_lanes(group, members[lanes], lanes, (first, done))
        for lane, steps in left.items():
            if steps > done:
                self._record_lanes(group, members[[lane]], [lane], (first, steps))
            if lane in failed:
                self._fail(int(members[lane]), steps)
        going_on = {lane: left.get(lane, done) for lane in lanes if lane not in failed}
        return done, {int(members[lane]): steps for lane, steps in going_on.items()}

    def _interval(self, step: int) -> int:
        """Return the sampling interval of a step, from that of the first one on."""
        return (self._first + step) // self._interval_steps - self._first // self._interval_steps

    def _fail(self, member: int, step: int) -> None:
        """Record that a member failed at a step."""
        time_s = self._time_s + step * self._members.step_s
        self._members.failures[member] = step_failure(self._steps_before + step + 1, time_s)
        index = self._first + step
        self._record.fail(index, index // self._interval_steps, member)

    def _record_lanes(
        self, group: Lanes, members: Ints, lanes: list[int], span: tuple[int, int]
    ) -> None:
        """Record the results of members in these lanes over these steps of the range.

        Those of lanes that failed before are overwritten later.
        """
        record, (first, end) = self._record, span
        own = slice(self._interval(first), self._interval(end - 1) + 1)
        steps = slice(self._first + first, self._first + end)
        before = self._first // self._interval_steps
        intervals = slice(before + own.start, before + own.stop)
        samples = group.samples[..., own, :, lanes]
        record.top[..., steps, members] = group.pulls[..., first:end, rows.PULL, lanes]
        lowest = np.minimum(
            record.samples[..., intervals, MIN_TENSION, members], samples[..., MIN_TENSION, :]
        )
        record.samples[..., intervals, :, members] = samples
        record.samples[..., intervals, MIN_TENSION, members] = lowest


__all__ = [
    "FIGURES", "Fleet", "FleetInputs", "FleetRecord", "FleetState", "LiveState", "live_state",
]  # fmt: skip

MAX_LINE_JUMP_M = 1.0  # of the line out at the beginning: more breaks the top element of any rope


class Fleet:
    """Members of one scene that begin from a given state and take inputs as arrays."""

    def __init__(
        self,
        scene: Scene | str | Path,
        members: int,
        *,
        elements: int = 20,
        step_s: float = 0.05,
        threads: int = 1,
    ) -> None:
        """Build members in the scene's static equilibrium, at time 0.

        Args:
            scene: a scene, its name, or the path of its file.
            members: number of members.
            elements: number of elements of each member at the scene's paid-out length; where ropes
                meet, of the main winch's rope, and of the others in proportion.
            step_s: time step [s].
            threads: number of parallel threads.

        Raises:
            InputError: a number given here is not possible, or a scene that fleets do not step.
            SceneError: the scene cannot be built, or has no static equilibrium.
        """
        scene = scene if isinstance(scene, Scene) else load_scene(scene)
        members = whole_number("fleet", "members", members)
        self.threads = whole_number("fleet", "threads", threads)
        if model_beside(scene) is not None:
            problem = f"the VIV model of '{scene.name}' runs beside the step"
            remedy = "remove it from the scene; its drag amplification then has no effect"
            raise InputError("fleet", problem, remedy)
        self.scene = at_setting(scene, elements, step_s)
        members_class = SystemMembers if is_joined(self.scene) else RopeMembers
        self._members: RopeMembers | SystemMembers = members_class(self.scene, members)
        self._step_ns = round(self.scene.time.step_s * 1e9)
        self._time_ns = 0
        self._scratches = [Scratch() for _ in range(self.threads)]

    def __len__(self) -> int:
        """Return the number of members, including failed ones."""
        return self._members.count

    @property
    def time_s(self) -> float:
        """Time of all members [s]."""
        return self._time_ns * 1e-9

    @property
    def figures(self) -> tuple[str, ...]:
        """Figures that the scene has, in the order of FIGURES."""
        known = {name for rope in self._members.ropes for name in figures_of(rope)}
        return tuple(name for name in FIGURES if name in known)

    @property
    def why_alone(self) -> str:
        """Reason why members do not step in SIMD lanes; "": they do."""
        return self._members.why_alone

    # Figures

    def set_figures(self, factors: Factors) -> None:
        """Set figures of all members as factors on the scene's values; others are kept.

        factors: by name of FIGURES, a number or one for each member. The members' motion and state
        stay as they are: a rope whose weight or stiffness jumps then oscillates. A factor applies
        to all ropes of a multi-line member and to its suspended load.

        Raises:
            InputError: an unknown figure or one that the scene does not have, a factor that is not
                finite and positive, or a wrong number of factors.
        """
        self._members.factors |= checked_factors(factors, self.figures, len(self))
        self._members.scale()

    # States

    def state(self, member: int) -> FleetState:
        """Return a copy of a member's state. Raises InputError: there is no such member."""
        member = whole_number("fleet: state", "as a member", member, 0, len(self) - 1)
        return self._members.state(member, self._time_ns)

    def restore(self, states: FleetState | Sequence[FleetState]) -> None:
        """Continue all members from one state, or each from its own; failed ones start again.

        Raises:
            InputError: neither one state nor as many as members, states of different times, or a
                state of another mesh.
        """
        given = [states] if isinstance(states, FleetState) else list(states)
        if not isinstance(states, FleetState) and len(given) != len(self):
            problem = f"{len(given)} states for {len(self)} members"
            raise InputError("fleet", problem, "give one, or one for each")
        if len({state.time_ns for state in given}) > 1:
            raise InputError("fleet", "states of different times", "give states of one")
        for state in given:
            self._members.check(state)
        self._members.restore(given)
        self._time_ns = given[0].time_ns
        self._members.failures = {}

    def begin_from(self, live: LiveState) -> None:
        """Continue all members from the state of a live twin, on the fleet's own mesh.

        The current in force in the twin applies to the members, times their own factor.

        Raises:
            InputError: the state is that of another scene.
        """
        self._members.begin_from(live)
        self._time_ns = live.time_ns
        self._members.failures = {}

    # Steps

    def advance(self, inputs: FleetInputs, interval_steps: int = 10) -> FleetRecord:
        """Advance all members that have not failed over the steps of the inputs.

        interval_steps: number of steps of an interval.

        Raises:
            InputError: inputs of different or wrong shapes or not finite, a line out that is not
                possible, or an interval of no step.
        """
        steps = self._check(inputs, interval_steps)
        members = self._members
        record = Record(members.lead, steps, -(-steps // interval_steps), len(self))
        boundaries = members.boundaries(inputs)
        for first in range(0, steps, MAX_RANGE_STEPS):
            count = min(MAX_RANGE_STEPS, steps - first)
            span = first, count, self._time_ns
            self._run(StepRange(members, boundaries, record, interval_steps, span))
            self._time_ns += count * self._step_ns
        record.close()
        top = record.top.reshape(-1, *record.top.shape[-2:])  # of each rope
        samples = record.samples.reshape(-1, *record.samples.shape[-3:])
        payload_samples = samples[members.payload]
        return FleetRecord(
            top_tension_n=top[0],
            min_tension_n=samples[:, :, MIN_TENSION].min(axis=0),
            payload_depth_m=payload_samples[:, PAYLOAD_DEPTH],
            payload_speed_m_per_s=payload_samples[:, PAYLOAD_DESCENT],
            payload_tension_n=payload_samples[:, LOWEST_TENSION],
            failures=dict(members.failures),
            suspended_tension_n={self.scene.ropes[r].name: top[r] for r in members.from_ship},
        )

    def _check(self, inputs: FleetInputs, interval_steps: int) -> int:
        """Return the number of steps of valid inputs.

        Raises:
            InputError: see `advance`.
        """
        whole_number("fleet", "steps of an interval", interval_steps)
        first = np.shape(inputs.heave_m)[:1]
        series = [
            ("heave_m", inputs.heave_m),
            ("heave_rate_m_per_s", inputs.heave_rate_m_per_s),
            ("line_out_m", inputs.line_out_m),
            ("line_speed_m_per_s", inputs.line_speed_m_per_s),
        ]
        for winch, (out, speed) in inputs.lines.items():
            self._rope_of(winch)
            series += (f"line_out_m of {winch}", out), (f"line_speed_m_per_s of {winch}", speed)
        for name, values in series:
            shape = np.shape(values)
            if shape[:1] != first or shape[1:] not in ((), (len(self),)):
                remedy = f"give (steps + 1,) or (steps + 1, {len(self)}), the same steps in all"
                raise InputError(f"fleet: {name}", f"shape {shape}", remedy)
            if not np.isfinite(values).all():
                raise InputError(f"fleet: {name}", "a value is not finite", "fill gaps before")
        steps = first[0] - 1 if first else 0
        if steps < 1:
            raise InputError("fleet", "inputs of no step", "give at least two borders")
        self._check_line("line_out_m", 0, np.asarray(inputs.line_out_m))
        for winch, (out, _) in inputs.lines.items():
            self._check_line(f"line_out_m of {winch}", self._rope_of(winch), np.asarray(out))
        return int(steps)

    def _rope_of(self, winch: str) -> int:
        """Return the number of the rope from a winch other than the main one.

        Raises:
            InputError: there is no such winch.
        """
        names = [self.scene.ropes[r].from_ for r in self._members.from_ship[1:]]
        known = [name for name in winches_by_name(self.scene) if name in names]
        if winch not in known:
            remedy = did_you_mean(winch, known) if known else "the scene has the main winch alone"
            raise InputError("fleet: lines", f"there is no other winch '{winch}'", remedy)
        return self._members.from_ship[1 + names.index(winch)]

    def _check_line(self, name: str, r: int, line_m: Floats) -> None:
        """Check that members can have this line out of rope r, (steps + 1,) or (..., members).

        Raises:
            InputError: they cannot.
        """
        members, winch = self._members, winch_of(self.scene, self.scene.ropes[r])
        min_m = float(members.marks_m[r][1])
        element_length_m = members.ropes[r].model.element_length
        max_m = winch.max_line_out_m + element_length_m if winch else np.inf
        if not (min_m < line_m.min() and line_m.max() <= max_m):
            problem = f"{float(line_m.min()):g} to {float(line_m.max()):g} m"
            remedy = f"this mesh takes more than {min_m:g} m, and at most {max_m:g} m"
            raise InputError(f"fleet: {name}", problem, remedy)
        length, below = members.ends(r)
        is_wrong = (abs(line_m[0] - length) > MAX_LINE_JUMP_M) | (line_m[0] <= below)
        for k in np.flatnonzero(is_wrong).tolist():
            if k not in members.failures:
                begin_m = float(np.broadcast_to(line_m[0], (len(self),))[k])
                problem = f"it begins at {begin_m:g} m, member {k} has {length[k]:g} m of rope out"
                remedy = f"begin within {MAX_LINE_JUMP_M:g} m of the member's state"
                raise InputError(f"fleet: {name}", problem, remedy)

    def _run(self, step_range: StepRange) -> None:
        """Do the steps of a range."""
        groups = step_range.groups()
        if self.threads == 1 or len(groups) == 1:
            for group in groups:
                step_range.run(group, self._scratches[0])
            return

        def run_groups(number: int) -> None:
            for group in groups[number :: self.threads]:
                step_range.run(group, self._scratches[number])

        with ThreadPoolExecutor(self.threads) as pool:
            list(pool.map(run_groups, range(self.threads)))
