"""Ensemble: many ropes of one scene stepped together, each with its own values and inputs.

Members of one kind share a step in the SIMD lanes of the processor; groups of them are
spread over the available cores. A group is stepped for seconds at a time, so that its arrays stay
in the core's cache; the scratch arrays of the step, a hundred times larger than the state of a
rope, belong to the thread. Each member is bit-identical to a `Twin` of its scene and inputs,
whichever members share its group and however the time is divided.

Rare events (a step that is halved or needs a line search, an element that splits or merges) are
computed for the member alone. A member with many of them leaves the group until the end of the
batch of steps.
"""

from __future__ import annotations

import os
import threading
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple, TypeVar

import numpy as np

from rope_twin.core.jit.wide import LANES
from rope_twin.core.lanes.group import Kind
from rope_twin.core.lanes.joined_group import JoinedKind
from rope_twin.core.lanes.step import MIN_TENSION, SAMPLE_COLUMNS, Run
from rope_twin.core.state import ELEMENTS, PULL_COLUMNS, STEPS_PER_CALL, Boundary, Floats
from rope_twin.errors import InputError, SceneError
from rope_twin.scene.load import change_scene
from rope_twin.scene.rigging import is_joined
from rope_twin.scene.rope_model import build
from rope_twin.scene.schema import Scene
from rope_twin.scene.vortex import coupled_settings, model_beside
from rope_twin.twin.ensemble.joined_batch import MAX_ALONE_FRACTION, MIN_ALONE_STEPS, JoinedBatch
from rope_twin.twin.ensemble.member import (
    WATCHED,
    Batch,
    InitialEquilibrium,
    Member,
    MemberResults,
    Scratch,
    SharedBoundaries,
    SteppedMember,
    TwinMember,
    UnstartedMember,
    is_known,
)
from rope_twin.twin.ensemble.member import Variation as Variation
from rope_twin.twin.monitors import NO_MONITORS, Monitors
from rope_twin.twin.pacing import steps_in_slot
from rope_twin.twin.regrid import element_tension
from rope_twin.twin.snapshot import Snapshot
from rope_twin.twin.statics import no_garbage_collection, solve_scene_statics
from rope_twin.twin.twin import Twin
from rope_twin.vortex.coupled import VivDragAmplification

BATCH_STEPS = 800  # of a batch, whose boundary conditions are computed at once
SAMPLING_S = 0.5
MIN_MEMBERS = LANES  # the SIMD step is not compiled for ensembles with fewer members
AnyMember = SteppedMember | UnstartedMember
StartKey = tuple[Scene, bool]  # scene, and whether the member is stepped by a twin
AnyStart = InitialEquilibrium | Twin | str  # str: the reason why there is no equilibrium
Key = TypeVar("Key")
Result = TypeVar("Result")
MIN_GROUP = LANES // 2  # members of a group: a step of all lanes costs about as much as these alone


def cores() -> int:
    """Return the number of cores that this process may use."""
    return len(os.sched_getaffinity(0))


MAX_DURATION_S = 1e7  # four months, as for a run


def whole_steps(name: str, seconds: float, step_s: float) -> int:
    """Return the number of steps in a time; name: of the argument, for messages.

    Raises:
        InputError: the time is not a positive whole number of steps.
    """
    steps = round(seconds / step_s) if np.isfinite(seconds) else 0
    if seconds > MAX_DURATION_S:
        raise InputError(name, f"{seconds:g} s is too long", f"give at most {MAX_DURATION_S:g} s")
    if steps < 1 or abs(steps * step_s - seconds) > 1e-6 * step_s:
        remedy = f"give a whole number of steps of {step_s:g} s"
        raise InputError(name, f"{seconds} s is not possible", remedy)
    return steps


@dataclass(frozen=True)
class Lanes:
    """Number of members stepped in SIMD lanes and by themselves, and steps since the start."""

    members: int  # in lanes
    alone: dict[str, int]  # others, by reason; "": too few members of their kind
    steps: int  # of all members, done in lanes
    given_up: int  # steps of members in groups that the single-rope solver did


class _ThreadScratch(threading.local):
    """Scratch arrays of each thread, allocated on first use."""

    def __init__(self, steps: int, watched: bool) -> None:
        self.steps, self.scratch = steps, Scratch(steps, watched)


class Ensemble:
    """Members of one scene at one time."""

    def __init__(
        self,
        scene: Scene,
        variations: Sequence[Variation],
        slack_interval_s: float = SAMPLING_S,
        threads: int | None = None,
        max_lanes: int = LANES,
        watched: bool = False,
        monitors: Monitors = NO_MONITORS,
    ) -> None:
        """Build all members and solve for the static equilibrium of each.

        Args:
            scene: scene that the members have in common.
            variations: one for each member.
            slack_interval_s: interval at which each rope is checked for slack [s].
            threads: number of parallel threads; None: as many as there are cores.
            max_lanes: maximum number of ropes in one SIMD step; 1: all step alone.
            watched: record every step of each rope (`watched`), and check it for slack.
            monitors: of the members that have a twin of their own (`twin_of`).

        A member without a static equilibrium to start from is marked as failed, like one that fails
        later.

        Raises:
            SceneError: a change is not possible; the message has the member's number.
            InputError: a winch command, or a number given here, is not possible.
        """
        self.step_s = scene.time.step_s
        self._step_ns = round(self.step_s * 1e9)
        self._interval_steps = (
            1 if watched else whole_steps("slack_interval_s", slack_interval_s, self.step_s)
        )
        self._watched = watched
        self.threads = cores() if threads is None else threads
        if not 1 <= max_lanes <= LANES:
            raise InputError("ensemble", f"{max_lanes} ropes in one step", f"give 1 to {LANES}")
        if self.threads < 1 or not variations:
            problem = f"{self.threads} threads, {len(variations)} members"
            raise InputError("ensemble", problem, "give at least one of each")
        self.scene = scene
        self.max_lanes = max_lanes
        self.steps = 0
        self._interrupted = False
        self._thread_scratch: _ThreadScratch | None = None
        scenes = [_member_scene(scene, variation, k) for k, variation in enumerate(variations)]
        by_twin = [
            is_joined(member_scene) or not is_known(member_scene, variation)
            for member_scene, variation in zip(scenes, variations, strict=True)
        ]
        if watched and any(by_twin):
            problem = "multi-line systems, or a winch with tension feedback, are not watched"
            raise InputError("ensemble", problem, "step them with `rope_twin run`")
        self._monitors = monitors
        keys = list(dict.fromkeys(zip(scenes, by_twin, strict=True)))
        find_member_start = partial(_find_start, monitors=self._monitors)
        first = find_member_start(keys[0])  # alone: it compiles
        starts = dict(
            zip(keys, [first, *self._on_threads(find_member_start, keys[1:])], strict=True)
        )
        self._heaves = {
            id(variation.heave): variation.heave for variation in variations if variation.heave
        }
        self._members: list[AnyMember] = []
        boundaries = SharedBoundaries()
        for key, variation in zip(zip(scenes, by_twin, strict=True), variations, strict=True):
            self._members.append(_new_member(key[0], starts[key], variation, boundaries))

    @property
    def time_ns(self) -> int:
        """Time since the start [ns]."""
        return self.steps * self._step_ns

    def __len__(self) -> int:
        """Return the number of members, including failed ones."""
        return len(self._members)

    def advance(self, seconds: float) -> None:
        """Advance all members that have not failed.

        Raises:
            InputError: the time is no whole number of steps, a member's heave series is too short,
                or an earlier call was interrupted.
        """
        steps = whole_steps("seconds", seconds, self.step_s)
        if self._interrupted:
            problem = "it was interrupted while some members had stepped and others had not"
            raise InputError("ensemble", problem, "build it again")
        for heave in self._heaves.values():
            end_ns = (self.steps + steps) * self._step_ns
            heave.check_reach(end_ns, end_ns)
        self._interrupted = True
        while steps > 0:
            batch = min(steps, BATCH_STEPS)
            if self._thread_scratch is None or self._thread_scratch.steps != batch:
                self._thread_scratch = _ThreadScratch(batch, self._watched)
            local = self._thread_scratch

            def advance_members(
                group: list[SteppedMember], batch: int = batch, local: _ThreadScratch = local
            ) -> None:
                advance_group(group, batch, self._interval_steps, local.scratch)

            self._on_threads(advance_members, self._groups())
            self.steps += batch
            steps -= batch
        self._interrupted = False

    def _groups(self) -> list[list[SteppedMember]]:
        """Return the members that have not failed, grouped by the members they are stepped with."""
        running = [
            member
            for member in self._members
            if not isinstance(member, UnstartedMember) and not member.failure
        ]
        return sort_into_groups(running, self.max_lanes if len(self) >= MIN_MEMBERS else 1)

    def make_ready(self) -> None:
        """Compile the kernels of the first batch, so that it takes no longer than the next."""
        with no_garbage_collection():
            compile_lanes(self._groups())

    def lanes(self) -> Lanes:
        """Return how many members are stepped in SIMD lanes next, and why the others are not."""
        groups = self._groups()
        single = [group[0] for group in groups if len(group) == 1]
        reasons = Counter(member.why_alone for member in single)
        started = [member for member in self._members if not isinstance(member, UnstartedMember)]
        return Lanes(
            members=sum(len(group) for group in groups if len(group) > 1),
            alone=dict(reasons),
            steps=sum(member.lane_steps for member in started),
            given_up=sum(member.given_up for member in started),
        )

    def figures(self) -> list[MemberResults]:
        """Return the results of each member since the start."""
        return [member.figures() for member in self._members]

    def scene_of(self, number: int) -> Scene:
        """Return the scene of a member, with its changes."""
        return self._members[number].scene

    def twin_of(self, number: int) -> Twin | None:
        """Return the twin of a multi-line member; None: it has none, or never started."""
        member = self._members[number]
        return member.twin if isinstance(member, TwinMember) else None

    def watched(self, number: int) -> Floats:
        """Return the recorded steps of a member since the last call, (steps, WATCHED).

        Columns are the top tension [N], the sampled values (`sample_of`), and the line out [m].
        There are fewer rows than steps if the member failed, none without `watched`.
        """
        member = self._members[number]
        parts = member.watched if isinstance(member, Member) else []
        recorded: Floats = np.concatenate(parts) if parts else np.zeros((0, WATCHED))
        parts.clear()
        return recorded

    def snapshot(self, number: int) -> Snapshot:
        """Return a frozen copy of a member's present.

        Raises:
            InputError: the member never started.
        """
        member = self._members[number]
        if isinstance(member, UnstartedMember):
            raise InputError(f"member {number}", "it never started", member.failure[:-1])
        return member.snapshot()

    def _on_threads(self, work: Callable[[Key], Result], items: Sequence[Key]) -> list[Result]:
        """Apply the work to each item; an interruption waits only for items in progress."""
        if self.threads == 1 or len(items) < 2:
            return [work(item) for item in items]
        with ThreadPoolExecutor(self.threads) as pool:
            try:
                return list(pool.map(work, items))
            except BaseException:
                pool.shutdown(wait=False, cancel_futures=True)
                raise


def _member_scene(scene: Scene, variation: Variation, number: int) -> Scene:
    for change in variation.changes:
        where = f"member {number}: {change.path}"
        if change.path.startswith("time."):
            raise SceneError(where, "all members have it in common", "vary something else")
        if change.path.startswith("sea_state.") and variation.heave is None:
            remedy = "give the member the heave of that sea"
            raise SceneError(where, "a sea moves no ship by itself", remedy)
    try:
        return change_scene(scene, variation.changes)
    except SceneError as error:
        raise SceneError(f"member {number}: {error}") from error


def _find_start(key: StartKey, monitors: Monitors) -> AnyStart:
    """Return the static equilibrium of a scene, or the reason why there is none."""
    scene, by_twin = key
    viv_drag = None
    try:
        if by_twin:
            return Twin(scene, monitors)
        rope = build(scene)
        pull = solve_scene_statics(scene, rope)
        if model_beside(scene) is not None:
            cycle = steps_in_slot(scene.time.step_s)
            viv_drag = VivDragAmplification(coupled_settings(scene), (rope,), (False,), cycle)
    except (SceneError, InputError) as error:
        return str(error)
    tension = element_tension(rope).copy()
    work_rows, columns = rope.work.shape
    without_scratch = rope._replace(work=np.zeros((0, 0)))
    return InitialEquilibrium(without_scratch, (work_rows, columns), pull, tension, viv_drag)


def _new_member(
    scene: Scene, start: AnyStart, variation: Variation, boundaries: SharedBoundaries
) -> AnyMember:
    """Return a member that begins in this static equilibrium.

    Raises:
        InputError: a winch command is not possible.
    """
    if isinstance(start, str):
        return UnstartedMember(scene, start)
    if isinstance(start, Twin):
        return TwinMember(
            start, variation.heave, variation.commands, boundaries.of_system(scene, variation)
        )
    return Member(scene, start, boundaries.of_rope(scene, variation))


def sort_into_groups(
    members: Iterable[SteppedMember], max_lanes: int = LANES
) -> list[list[SteppedMember]]:
    """Return groups of at most `max_lanes` members of a kind; those of small groups are alone."""
    kinds: dict[Kind | JoinedKind | None, list[SteppedMember]] = {}
    for member in members:
        kinds.setdefault(member.kind(), []).append(member)
    groups = []
    for kind, same_kind in kinds.items():
        for first in range(0, len(same_kind), max_lanes):
            group = same_kind[first : first + max_lanes]
            in_lanes = kind is not None and len(group) >= MIN_GROUP
            groups += [group] if in_lanes else [[member] for member in group]
    return groups


def compile_lanes(groups: Iterable[Sequence[SteppedMember]]) -> None:
    """Compile the SIMD step for groups of several members, if it is not compiled yet."""
    by_types = {}
    for group in groups:
        if len(group) > 1 and (kind := group[0].kind()) is not None:
            by_types[kind.types] = group[0]
    for member in by_types.values():
        member.new_group().advance(Run(0.0, 0, 0, 0, 0, 1, 0))  # no step at all


def advance_group(
    members: Sequence[SteppedMember], steps: int, interval_steps: int, scratch: Scratch
) -> None:
    """Advance the members of a group by a batch of steps.

    Members whose number of elements changes at the same step, as of ropes with equal payout,
    continue as a group of their own.
    """
    if len(members) == 1:
        members[0].advance(steps, interval_steps, scratch)
        return
    twin_members = [member for member in members if isinstance(member, TwinMember)]
    if twin_members:
        _advance_joined(twin_members, steps, interval_steps, scratch)
        return
    waiting = [
        _Progress(member, member.open_batch(steps, scratch), 0)
        for member in members
        if isinstance(member, Member)
    ]
    while waiting:
        same_kind = [progress for progress in waiting if progress.can_join(waiting[0])]
        waiting = [progress for progress in waiting if not progress.can_join(waiting[0])]
        if same_kind[0].member.kind() is not None and len(same_kind) >= MIN_GROUP:
            waiting += _LaneBatch(same_kind, interval_steps, scratch).run()
        else:
            for member, batch, done in same_kind:
                member.given_up += steps - done
                member.go_on(batch, done, interval_steps, scratch)


def _advance_joined(
    members: Sequence[TwinMember], steps: int, interval_steps: int, scratch: Scratch
) -> None:
    """Advance multi-line members to the end of a batch.

    Members whose number of elements changes continue as another group until they have done as many
    steps as the others.
    """
    end = members[0].steps + steps
    for member in members:
        member.submit(steps)
    while running := [member for member in members if not member.failure and member.steps < end]:
        first_step = min(member.steps for member in running)
        behind = [member for member in running if member.steps == first_step]
        next_step = min(
            (member.steps for member in running if member.steps > first_step), default=end
        )
        count = min(next_step - first_step, STEPS_PER_CALL)
        for group in sort_into_groups(behind):
            same_kind = [member for member in group if isinstance(member, TwinMember)]
            kind = same_kind[0].kind()
            if len(same_kind) > 1 and isinstance(kind, JoinedKind):
                JoinedBatch(same_kind, kind, scratch).run(count, interval_steps)
                continue
            for member in same_kind:
                member.given_up += count
                member.go_on(count, interval_steps)


class _Progress(NamedTuple):
    """Progress of a member in its batch of steps."""

    member: Member
    batch: Batch
    done: int

    def can_join(self, other: _Progress) -> bool:
        """Return whether both can be stepped in one group."""
        return self.done == other.done and self.member.kind() == other.member.kind()


class _LaneBatch:
    """Remaining steps of a batch, in SIMD lanes, of members of one kind with equal progress."""

    def __init__(
        self, progress: Sequence[_Progress], interval_steps: int, scratch: Scratch
    ) -> None:
        kind = progress[0].member.kind()
        assert kind is not None
        self._interval_steps, self._scratch = interval_steps, scratch
        self._first, self._steps = progress[0].done, len(progress[0].batch.pulls)
        self._before = progress[0].member.steps - self._first
        self._time = self._before * round(kind.step * 1e9) * 1e-9
        self._batches = [entry.batch for entry in progress]
        self._group = scratch.group(kind)
        self._group.begin(
            [entry.member.rope for entry in progress], [entry.boundary for entry in self._batches]
        )
        # by lane, those still in the group
        self._members = {lane: entry.member for lane, entry in enumerate(progress)}
        self._alone: dict[int, list[int]] = {lane: [] for lane in self._members}  # steps done alone
        self._tension: dict[int, Floats] = {}  # by lane, after the last step alone
        self._left: list[_Progress] = []

    def run(self) -> list[_Progress]:
        """Do the steps; return the members that left with other elements, with their progress."""
        done = self._first
        while self._members and done < self._steps:
            wanted = sum(1 << lane for lane in self._members)
            late = self._group.late(self._before + done)
            run = Run(
                self._time, done, self._steps, wanted, self._before, self._interval_steps, late
            )
            done, undone_lanes = self._group.advance(run)
            for lane in undone_lanes:
                self._step_alone(lane, done)
        for lane in list(self._members):
            self._leave(lane, done)
        return self._left

    def _step_alone(self, lane: int, done: int) -> None:
        """Do the last of `done` steps for the rope of one lane."""
        member, group, batch = self._members[lane], self._group, self._batches[lane]
        state, work = member.rope.state, self._scratch.work(member.work_shape)
        group.take(lane, member.rope)
        member.steps = self._before + done - 1
        boundary = Boundary(*(table[done - 1 : done + 1] for table in batch.boundary))
        alone = self._alone[lane]
        samples = None if batch.samples is None else np.zeros((1, SAMPLE_COLUMNS))
        single_step = Batch(boundary, np.zeros((1, PULL_COLUMNS)), samples)
        member.step(single_step, 0, 1, self._interval_steps, work)
        self._tension[lane] = element_tension(member.rope._replace(work=work)).copy()
        if member.failure:
            self._leave(lane, done - 1)
            return
        alone.append(done)
        group.pulls[done - 1, :, lane] = single_step.pulls[0]
        if samples is not None:
            group.samples[done - 1, :, lane] = samples[0]
        too_often = len(alone) > MIN_ALONE_STEPS + MAX_ALONE_FRACTION * (done - self._first)
        if too_often or state.counts[ELEMENTS] != group.kind.elements:
            self._leave(lane, done, too_often)
        else:
            group.put(lane, member.rope)

    def _leave(self, lane: int, done: int, too_often: bool = False) -> None:
        """Take a rope out of the group after `done` steps.

        too_often: it was stepped alone too often, and completes the batch in this way.
        """
        member, group, alone = self._members.pop(lane), self._group, self._alone[lane]
        batch, first = self._batches[lane], self._first
        if not member.failure and not (alone and alone[-1] == done):
            group.take(lane, member.rope)
            self._tension[lane] = group.tension(lane)
        steps, slack = group.account(lane, member.rope.state.health)
        if batch.samples is not None:
            batch.samples[first:done] = group.samples[first:done, :, lane]
            rows_alone = [step - 1 - first for step in alone if step <= done]
            slack = int(
                (np.delete(batch.samples[first:done, MIN_TENSION], rows_alone) <= 0.0).sum()
            )
        member.lane_steps += steps
        member.given_up += done - first - steps
        steps_alone = [self._before + step for step in alone]
        samplings = (self._before + done) // self._interval_steps
        samplings -= (self._before + first) // self._interval_steps
        member.count_slack(
            samplings - sum(step % self._interval_steps == 0 for step in steps_alone), slack
        )
        member.steps = self._before + done
        batch.pulls[first:done] = group.pulls[first:done, :, lane]
        if member.failure or done == self._steps:
            member.close(batch, done, self._tension[lane])
        elif too_often:
            member.given_up += self._steps - done
            member.go_on(batch, done, self._interval_steps, self._scratch)
        else:
            self._left.append(_Progress(member, batch, done))
