"""Many ropes of one scene, stepped together: each has its own numbers and inputs.

Members of one kind share a step in the lanes of the processor's vectors (`lanes.py`), groups of
them are spread over the cores that this process may use. A group is stepped for seconds at a time
before the next one's turn, so its arrays stay in the core's cache; the scratch of the step, a
hundred times larger than what a rope must keep, belongs to the thread. Each member equals a `Twin`
of its scene and inputs to the bit, whoever shares its group and however the time is cut up."""

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
from rope_twin.core.lanes.group import why_alone
from rope_twin.errors import InputError, SceneError, phrase
from rope_twin.scene.arrays.build import build
from rope_twin.scene.change import Change, change_scene
from rope_twin.scene.rules.body import refuse_body
from rope_twin.scene.rules.shedding import refuse_shedding
from rope_twin.scene.schema import Scene
from rope_twin.twin.ensemble.borders import Borders, WinchTrack
from rope_twin.twin.ensemble.lanes import compile_lanes, sort_into_groups, take_turn
from rope_twin.twin.ensemble.member import Member, MemberFigures, Scratch, Start
from rope_twin.twin.hoisting.schedule import OrderSample
from rope_twin.twin.motion.heave_series import HeaveSeries
from rope_twin.twin.snapshot import Snapshot
from rope_twin.twin.start import find_start, no_garbage_collection

BATCH_S = 8.0  # a member's turn; less than the 10 s that commands may be known ahead
LOOK_S = 0.5
FEW = LANES  # an ensemble with fewer members is not worth compiling for

Key = TypeVar("Key")
Made = TypeVar("Made")


@dataclass(frozen=True)
class Variation:
    """What one member has of its own."""

    changes: tuple[Change, ...] = ()  # of the scene's numbers
    heave: HeaveSeries | None = None  # None: the ship lies still
    commands: tuple[OrderSample, ...] | None = None  # of the winch; None: the scene's schedule


def cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0))


LONGEST_S = 1e7  # four months, as of a run


def whole_steps(name: str, seconds: float, step_s: float) -> int:
    """How many steps a time is.

    Raises:
        InputError: it is no whole number of steps, or none; `name` says whose time it is.
    """
    steps = round(seconds / step_s) if np.isfinite(seconds) else 0
    if seconds > LONGEST_S:
        raise InputError(
            phrase(name, f"{seconds:g} s is too long", f"give at most {LONGEST_S:g} s")
        )
    if steps < 1 or abs(steps * step_s - seconds) > 1e-6 * step_s:
        right = f"give a whole number of steps of {step_s:g} s"
        raise InputError(phrase(name, f"{seconds} s is not possible", right))
    return steps


@dataclass(frozen=True)
class Lanes:
    """Who steps in the lanes of the processor's vectors, and who by itself."""

    members: int  # in lanes
    alone: dict[str, int]  # how many are not, by the reason: "" if there are just too few alike


class _OfThread(threading.local):
    """Scratch that each thread finds made for itself."""

    def __init__(self, steps: int) -> None:
        self.scratch = Scratch(steps)


class Ensemble:
    """Members of one scene at one time."""

    def __init__(
        self,
        scene: Scene,
        variations: Sequence[Variation],
        look_s: float = LOOK_S,
        threads: int | None = None,
        abreast: int = LANES,
    ) -> None:
        """Build all members and find where each starts.

        Args:
            scene: what the members have in common.
            variations: one for each member.
            look_s: how often each rope is looked along for slack [s].
            threads: how many step at once; None: as many as there are cores.
            abreast: most ropes that share a step, each in a lane of its own; 1: all step alone.

        A member whose rope has no equilibrium to start from is marked as failed, like one that
        cannot go on later.

        Raises:
            SceneError: a change is not possible; one sentence, with the member's number.
            InputError: a winch command, or a number given here, is not possible.
        """
        refuse_body(scene, "members that start alike would share it")
        refuse_shedding(scene, "members that start alike would share their wakes")
        self.step_s = scene.time.step_s
        self._step_ns = round(self.step_s * 1e9)
        self._look_steps = whole_steps("look_s", look_s, self.step_s)
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
        starts = self._find_starts(list(dict.fromkeys(scenes)))
        self._heaves = {id(own.heave): own.heave for own in variations if own.heave}
        borders = _shared_borders(scenes, variations)
        self._members = [
            Member(scene, starts[scene], border)
            for scene, border in zip(scenes, borders, strict=True)
        ]

    @property
    def time_ns(self) -> int:
        """Time since the start [ns]."""
        return self.steps * self._step_ns

    def __len__(self) -> int:
        """How many members there are, failed ones included."""
        return len(self._members)

    def advance(self, seconds: float) -> None:
        """Step all members on that can go on.

        Raises:
            InputError: it is no whole number of steps, a member's heave ends before, or an earlier
                call was interrupted.
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
            own = _OfThread(batch)

            def turn(some: list[Member], batch: int = batch, own: _OfThread = own) -> None:
                take_turn(some, batch, self._look_steps, own.scratch)

            self._on_threads(turn, self._groups())
            self.steps += batch
            steps -= batch
        self._interrupted = False

    def _groups(self) -> list[list[Member]]:
        """Those that can go on, by whom they take their turn with."""
        going = [one for one in self._members if not one.failure]
        return sort_into_groups(going, self.abreast if len(self) >= FEW else 1)

    def make_ready(self) -> None:
        """Compile what the first turn needs, so that it takes no longer than the next."""
        with no_garbage_collection():
            compile_lanes(self._groups())

    def lanes(self) -> Lanes:
        """How many members take their next turn in lanes, and why the others do not."""
        groups = self._groups()
        alone = [some[0] for some in groups if len(some) == 1]
        words = Counter(why_alone(one.rope) for one in alone)
        return Lanes(sum(len(some) for some in groups if len(some) > 1), dict(words))

    def figures(self) -> list[MemberFigures]:
        """What each member did so far."""
        return [member.figures() for member in self._members]

    def scene_of(self, number: int) -> Scene:
        """The scene of a member, its changes made."""
        return self._members[number].scene

    def snapshot(self, number: int) -> Snapshot:
        """A member's present.

        Raises:
            InputError: the member never started.
        """
        member = self._members[number]
        if member.failure and not member.steps:
            raise InputError(phrase(f"member {number}", "it never started", member.failure[:-1]))
        return member.snapshot()

    def _find_starts(self, scenes: list[Scene]) -> dict[Scene, Start]:
        """Each scene's rope at rest; the first one alone, since it may have to compile."""
        first = _find_start(scenes[0])
        return dict(zip(scenes, [first, *self._on_threads(_find_start, scenes[1:])], strict=True))

    def _on_threads(self, work: Callable[[Key], Made], items: Sequence[Key]) -> list[Made]:
        """The work on each item; whoever interrupts it waits for no more than is under way."""
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


def _find_start(scene: Scene) -> Start:
    """The scene's rope at rest, or why there is none."""
    rope = build(scene)
    try:
        pull, failure = find_start(scene, rope), ""
    except SceneError as error:
        pull, failure = np.full(rows.PULL_COLUMNS, np.nan), str(error)
    tension = rope.work[rows.TENSION, : rope.state.counts[rows.ELEMENTS]].copy()
    high, wide = rope.work.shape
    bare = rope._replace(work=np.zeros((0, 0)))
    return Start(bare, (high, wide), pull, tension, failure)


def _shared_borders(scenes: Sequence[Scene], variations: Sequence[Variation]) -> list[Borders]:
    """The inputs of each member; members for whom they are equal share them."""
    winches: dict[Any, WinchTrack] = {}
    borders: dict[Any, Borders] = {}
    made = []
    for scene, own in zip(scenes, variations, strict=True):
        length, step_s = scene.ropes[0].length_m, scene.time.step_s
        answered = scene.winch is not None and scene.winch.heave_compensation is not None
        heaved = (scene.ship, id(own.heave)) if answered else None
        reeled = (scene.winch, length, own.commands, heaved)
        if reeled not in winches:
            winches[reeled] = WinchTrack(scene.winch, length, own.commands, step_s)
        moved = (scene.ship, reeled, id(own.heave))
        if moved not in borders:
            borders[moved] = Borders(scene.ship, winches[reeled], own.heave, step_s)
        made.append(borders[moved])
    return made
