"""Ensemble: many ropes of one scene stepped together, each with its own values and inputs.

Members of one kind share a step in the SIMD lanes of the processor (`simd.py`); groups of them are
spread over the available cores. A group is stepped for seconds at a time, so that its arrays stay
in the core's cache; the scratch arrays of the step, a hundred times larger than the state of a
rope, belong to the thread. Each member is bit-identical to a `Twin` of its scene and inputs,
whichever members share its group and however the time is divided.
"""

from __future__ import annotations

import os
import threading
from collections import Counter
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.jit.wide import LANES
from rope_twin.core.state import Floats
from rope_twin.errors import InputError, SceneError, phrase
from rope_twin.scene.change import Change, change_scene
from rope_twin.scene.model.rope import build
from rope_twin.scene.schema import Scene
from rope_twin.scene.validation.rigging import is_joined
from rope_twin.scene.validation.vortices import coupled_settings, model_beside
from rope_twin.twin.ensemble.boundary_conditions import (
    SharedBoundary,
    WinchMotion,
    is_known_in_advance,
)
from rope_twin.twin.ensemble.member import (
    WATCHED,
    Member,
    MemberResults,
    Scratch,
    Start,
    UnstartedMember,
)
from rope_twin.twin.ensemble.simd import advance_group, compile_lanes, sort_into_groups
from rope_twin.twin.ensemble.twin_member import SteppedMember, TwinMember
from rope_twin.twin.motion.heave_series import HeaveSeries
from rope_twin.twin.pacing import steps_in_slot
from rope_twin.twin.snapshot import Snapshot
from rope_twin.twin.statics import no_garbage_collection, solve_scene_statics
from rope_twin.twin.twin import Twin
from rope_twin.twin.winch.commands import CommandSample
from rope_twin.vortex.coupled import VivDragAmplification

BATCH_S = 8.0  # time of a batch; less than the 10 s that commands may be known ahead
SAMPLING_S = 0.5
MIN_MEMBERS = LANES  # the SIMD step is not compiled for ensembles with fewer members

AnyMember = SteppedMember | UnstartedMember
StartKey = tuple[Scene, bool]  # the second: the member is stepped by a twin
AnyStart = Start | Twin | str  # str: the reason why there is no equilibrium
Key = TypeVar("Key")
Made = TypeVar("Made")


@dataclass(frozen=True)
class Variation:
    """Changes and inputs of one member."""

    changes: tuple[Change, ...] = ()  # of the scene's numbers
    heave: HeaveSeries | None = None  # None: the ship lies still
    commands: tuple[CommandSample, ...] | None = None  # of the winch; None: the scene's schedule


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
        raise InputError(
            phrase(name, f"{seconds:g} s is too long", f"give at most {MAX_DURATION_S:g} s")
        )
    if steps < 1 or abs(steps * step_s - seconds) > 1e-6 * step_s:
        right = f"give a whole number of steps of {step_s:g} s"
        raise InputError(phrase(name, f"{seconds} s is not possible", right))
    return steps


@dataclass(frozen=True)
class Lanes:
    """Number of members stepped in SIMD lanes and by themselves, and steps since the start."""

    members: int  # in lanes
    alone: dict[str, int]  # others, by reason; "": too few members of their kind
    steps: int  # of all members, done in lanes
    given_up: int  # steps that lanes left to the single-rope solver


class _OfThread(threading.local):
    """Scratch arrays of each thread, made on first use."""

    def __init__(self, steps: int, watched: bool) -> None:
        self.scratch = Scratch(steps, watched)


class Ensemble:
    """Members of one scene at one time."""

    def __init__(
        self,
        scene: Scene,
        variations: Sequence[Variation],
        look_s: float = SAMPLING_S,
        threads: int | None = None,
        abreast: int = LANES,
        watched: bool = False,
    ) -> None:
        """Build all members and solve for the static equilibrium of each.

        Args:
            scene: scene that the members have in common.
            variations: one for each member.
            look_s: interval at which each rope is checked for slack [s].
            threads: number of parallel threads; None: as many as there are cores.
            abreast: maximum number of ropes in one SIMD step; 1: all step alone.
            watched: record every step of each rope (`watched`), and look for slack at every step.

        A member without a static equilibrium to start from is marked as failed, like one that fails
        later.

        Raises:
            SceneError: a change is not possible; the message has the member's number.
            InputError: a winch command, or a number given here, is not possible.
        """
        self.step_s = scene.time.step_s
        self._step_ns = round(self.step_s * 1e9)
        self._look_steps = 1 if watched else whole_steps("look_s", look_s, self.step_s)
        self._watched = watched
        self.threads = cores() if threads is None else threads
        if not 1 <= abreast <= LANES:
            right = f"give 1 to {LANES}"
            raise InputError(phrase("ensemble", f"{abreast} ropes abreast", right))
        if self.threads < 1 or not variations:
            what = f"{self.threads} threads, {len(variations)} members"
            raise InputError(phrase("ensemble", what, "give at least one of each"))
        self.scene = scene
        self.abreast = abreast
        self.steps = 0
        self._interrupted = False
        scenes = [_member_scene(scene, own, k) for k, own in enumerate(variations)]
        by_twin = [
            is_joined(one) or not is_known_in_advance(one.winch, own.commands)
            for one, own in zip(scenes, variations, strict=True)
        ]
        if watched and any(by_twin):
            what = "ropes that meet, or a winch with tension feedback, are not watched"
            raise InputError(phrase("ensemble", what, "step them with `rope_twin run`"))
        starts = self._find_starts(list(dict.fromkeys(zip(scenes, by_twin, strict=True))))
        self._heaves = {id(own.heave): own.heave for own in variations if own.heave}
        self._members: list[AnyMember] = []
        borders = _Borders()
        for key, own in zip(zip(scenes, by_twin, strict=True), variations, strict=True):
            self._members.append(_new_member(key[0], starts[key], own, borders))

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
            what = "it was interrupted while some members had stepped and others had not"
            raise InputError(phrase("ensemble", what, "build it anew"))
        for heave in self._heaves.values():
            end_ns = (self.steps + steps) * self._step_ns
            heave.check_reach(end_ns, end_ns)
        self._interrupted = True
        while steps > 0:
            batch = min(steps, max(1, round(BATCH_S / self.step_s)))
            own = _OfThread(batch, self._watched)

            def turn(some: list[SteppedMember], batch: int = batch, own: _OfThread = own) -> None:
                advance_group(some, batch, self._look_steps, own.scratch)

            self._on_threads(turn, self._groups())
            self.steps += batch
            steps -= batch
        self._interrupted = False

    def _groups(self) -> list[list[SteppedMember]]:
        """Return the members that have not failed, grouped by the members they are stepped with."""
        going = [
            one for one in self._members if not isinstance(one, UnstartedMember) and not one.failure
        ]
        return sort_into_groups(going, self.abreast if len(self) >= MIN_MEMBERS else 1)

    def make_ready(self) -> None:
        """Compile the kernels of the first batch, so that it takes no longer than the next."""
        with no_garbage_collection():
            compile_lanes(self._groups())

    def lanes(self) -> Lanes:
        """Return how many members are stepped in SIMD lanes next, and why the others are not."""
        groups = self._groups()
        alone = [some[0] for some in groups if len(some) == 1]
        words = Counter(one.why_alone for one in alone)
        own = [one for one in self._members if isinstance(one, Member)]
        return Lanes(
            members=sum(len(some) for some in groups if len(some) > 1),
            alone=dict(words),
            steps=sum(one.lane_steps for one in own),
            given_up=sum(one.given_up for one in own),
        )

    def figures(self) -> list[MemberResults]:
        """Return the results of each member since the start."""
        return [member.figures() for member in self._members]

    def scene_of(self, number: int) -> Scene:
        """Return the scene of a member, with its changes."""
        return self._members[number].scene

    def watched(self, number: int) -> Floats:
        """Return what was recorded of a member since the last call, (steps, WATCHED).

        Columns are the top tension [N], those of a look (`fold_of`), and the line out [m]. It has
        fewer rows than steps if the member failed, none without `watched`.
        """
        member = self._members[number]
        parts = member.watched if isinstance(member, Member) else []
        found: Floats = np.concatenate(parts) if parts else np.zeros((0, WATCHED))
        parts.clear()
        return found

    def snapshot(self, number: int) -> Snapshot:
        """Return a frozen copy of a member's present.

        Raises:
            InputError: the member never started.
        """
        member = self._members[number]
        if isinstance(member, UnstartedMember):
            raise InputError(phrase(f"member {number}", "it never started", member.failure[:-1]))
        return member.snapshot()

    def _find_starts(self, keys: list[StartKey]) -> dict[StartKey, AnyStart]:
        """Return the static equilibrium of each scene; the first is solved alone to compile."""
        first = _find_start(keys[0])
        return dict(zip(keys, [first, *self._on_threads(_find_start, keys[1:])], strict=True))

    def _on_threads(self, work: Callable[[Key], Made], items: Sequence[Key]) -> list[Made]:
        """Apply the work to each item; an interruption waits only for items in progress."""
        with ThreadPoolExecutor(self.threads) as pool:
            try:
                return list(pool.map(work, items))
            except BaseException:
                pool.shutdown(wait=False, cancel_futures=True)
                raise


def _member_scene(scene: Scene, own: Variation, number: int) -> Scene:
    for change in own.changes:
        where = f"member {number}: {change.path}"
        if change.path.startswith("time."):
            raise SceneError(phrase(where, "all members have it in common", "vary something else"))
        if change.path.startswith("sea_state.") and own.heave is None:
            right = "give the member the heave of that sea"
            raise SceneError(phrase(where, "a sea moves no ship by itself", right))
    try:
        return change_scene(scene, own.changes)
    except SceneError as error:
        raise SceneError(f"member {number}: {error}") from error


def _find_start(key: StartKey) -> AnyStart:
    """Return the static equilibrium of a scene, or the reason why there is none."""
    scene, by_twin = key
    viv_drag = None
    try:
        if by_twin:
            return Twin(scene)
        rope = build(scene)
        pull = solve_scene_statics(scene, rope)
        if model_beside(scene) is not None:
            cycle = steps_in_slot(scene.time.step_s)
            viv_drag = VivDragAmplification(coupled_settings(scene), (rope,), (False,), cycle)
    except (SceneError, InputError) as error:
        return str(error)
    tension = rope.work[rows.TENSION, : rope.state.counts[rows.ELEMENTS]].copy()
    high, wide = rope.work.shape
    bare = rope._replace(work=np.zeros((0, 0)))
    return Start(bare, (high, wide), pull, tension, viv_drag)


class _Borders:
    """Boundary conditions of members; those with equal inputs share them."""

    def __init__(self) -> None:
        self._winches: dict[Any, WinchMotion] = {}
        self._borders: dict[Any, SharedBoundary] = {}

    def of(self, scene: Scene, own: Variation) -> SharedBoundary:
        """Return the boundary conditions of a member."""
        length, step_s = scene.ropes[0].length_m, scene.time.step_s
        answered = scene.winch is not None and scene.winch.heave_compensation is not None
        heaved = (scene.ship, id(own.heave)) if answered else None
        reeled = (scene.winch, length, own.commands, heaved)
        if reeled not in self._winches:
            self._winches[reeled] = WinchMotion(scene.winch, length, own.commands, step_s)
        winch, moved = self._winches[reeled], (scene.ship, reeled, id(own.heave))
        if moved not in self._borders:
            self._borders[moved] = SharedBoundary(scene.ship, winch, own.heave, step_s)
        return self._borders[moved]


def _new_member(scene: Scene, start: AnyStart, own: Variation, borders: _Borders) -> AnyMember:
    """Return a member that begins in this static equilibrium.

    Raises:
        InputError: a winch command is not possible.
    """
    if isinstance(start, str):
        return UnstartedMember(scene, start)
    if isinstance(start, Twin):
        return TwinMember(start, own.heave, own.commands)
    return Member(scene, start, borders.of(scene, own))
