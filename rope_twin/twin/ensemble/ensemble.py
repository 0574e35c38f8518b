"""Ensemble: many ropes of one scene stepped together, each with its own values and inputs.

Members of one kind share a step in the SIMD lanes of the processor; groups of them are
spread over the available cores. A group is stepped for seconds at a time, so that its arrays stay
in the core's cache; the scratch arrays of the step, a hundred times larger than the state of a
rope, belong to the thread. Each member is bit-identical to a `Twin` of its scene and inputs,
whichever members share its group and however the time is divided.

Rare events (a step that is halved or needs a line search, an element that splits or merges) are
computed for the member alone (core/lanes/batch).
"""

from __future__ import annotations

import os
import threading
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from typing import TypeVar

import numpy as np

from rope_twin.core.jit.wide import LANES
from rope_twin.core.lanes.group import Kind
from rope_twin.core.lanes.joined_group import JoinedKind, new_group
from rope_twin.core.lanes.step import MIN_TENSION, Run
from rope_twin.core.state import Floats
from rope_twin.errors import InputError, SceneError, whole_number
from rope_twin.scene.load import change_scene
from rope_twin.scene.rigging import is_joined
from rope_twin.scene.rope_model import build
from rope_twin.scene.schema import Scene
from rope_twin.scene.vortex import coupled_settings, model_beside
from rope_twin.twin.ensemble.member import (
    WATCHED,
    InitialEquilibrium,
    Member,
    MemberResults,
    SharedBoundaries,
    SteppedMember,
    TwinMember,
    UnstartedMember,
    is_known,
)
from rope_twin.twin.ensemble.member import Variation as Variation
from rope_twin.twin.ensemble.scratch import Scratch
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

    def __init__(self) -> None:
        self.arrays = Scratch()


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
        self.threads = cores() if threads is None else whole_number("ensemble", "threads", threads)
        self.max_lanes = whole_number("ensemble", "ropes in one step", max_lanes, 1, LANES)
        whole_number("ensemble", "members", len(variations))
        self.scene = scene
        self.steps = 0
        self._interrupted = False
        self._scratch = _ThreadScratch()
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
            self._members.append(_new_member(key[0], starts[key], variation, boundaries, watched))

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

            def advance_members(group: list[SteppedMember], batch: int = batch) -> None:
                advance_group(group, batch, self._interval_steps, self._scratch.arrays)

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
    scene: Scene, start: AnyStart, variation: Variation, boundaries: SharedBoundaries, watch: bool
) -> AnyMember:
    """Return a member that begins in this static equilibrium; watch: record every step of a rope.

    Raises:
        InputError: a winch command is not possible.
    """
    if isinstance(start, str):
        return UnstartedMember(scene, start)
    if isinstance(start, Twin):
        return TwinMember(
            start, variation.heave, variation.commands, boundaries.of_system(scene, variation)
        )
    return Member(scene, start, boundaries.of_rope(scene, variation), watch)


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
            by_types[kind.types] = group[0], kind
    for member, kind in by_types.values():
        lone = member.rope if isinstance(member, Member) else member.system
        new_group(kind, lone, 0).advance(Run(0.0, 0, 0, 0, 0, 1, 0))  # no step at all


def advance_group(
    members: Sequence[SteppedMember], steps: int, interval_steps: int, scratch: Scratch
) -> None:
    """Advance the members of a group by a batch of steps.

    Members whose number of elements changes go on as another group, until they have done as many
    steps as the others.
    """
    end = members[0].steps + steps
    for member in members:
        member.submit(steps)
    while running := [member for member in members if not member.failure and member.steps < end]:
        first = min(member.steps for member in running)
        behind = [member for member in running if member.steps == first]
        later = (member.steps for member in running if member.steps > first)
        count = min(later, default=end) - first
        for group in sorted(sort_into_groups(behind), key=len, reverse=True):
            if len(group) > 1:
                count = _step_in_lanes(group, count, interval_steps, scratch)
                continue
            group[0].given_up += count if len(members) > 1 else 0
            group[0].go_on(count, interval_steps, scratch)


def _step_in_lanes(
    members: Sequence[SteppedMember], steps: int, interval_steps: int, scratch: Scratch
) -> int:
    """Step members of one kind in lanes, this number of steps at most; return those done."""
    opened = [member.open_steps(steps, scratch, lane) for lane, member in enumerate(members)]
    steps, before = min(one.steps for one in opened), members[0].steps
    room, watch = max(one.steps for one in opened), members[0].watch
    group = scratch.group(members[0].kind(), opened[0].member, room, room if watch else 0)
    group.begin([one.member for one in opened], [one.boundary for one in opened])
    time_s = before * round(members[0].scene.time.step_s * 1e9) * 1e-9
    run = Run(time_s, 0, steps, 0, before, interval_steps, 0)
    progress = group.step(range(len(members)), lambda lane: opened[lane].member, run)
    for lane in progress.running:
        group.take(lane, opened[lane].member)
    for lane, member in enumerate(members):
        done, alone = progress.left.get(lane, progress.done), progress.alone[lane]
        pulls = group.pulls[..., :done, :, lane].copy()
        samples = group.samples[..., :done, :, lane].copy()
        slack = (samples[:, MIN_TENSION] <= 0.0).sum() if watch else group.slack(lane)
        member.lane_steps += done - alone
        member.given_up += alone
        member.count_slack((before + done) // interval_steps - before // interval_steps, int(slack))
        member.close_steps(opened[lane], pulls, samples, lane in progress.failed)
    return progress.done
