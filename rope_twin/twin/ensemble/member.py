"""One rope of an ensemble: its state, what it was seen to do, and why it stopped if it did."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.lanes.group import Group, Kind, kind_of
from rope_twin.core.state import Boundary, Floats, Rope
from rope_twin.core.step import advance
from rope_twin.scene.card import KnownError
from rope_twin.scene.schema import Scene
from rope_twin.twin.ensemble.borders import Borders
from rope_twin.twin.observe import Extremes, Observation, observe
from rope_twin.twin.snapshot import Snapshot
from rope_twin.twin.stuck import no_next_state


class Scratch:
    """What a thread needs while it steps a member; nothing in it outlives a call of the step."""

    def __init__(self, steps: int) -> None:
        """Room for the pull of so many steps."""
        self.pulls = np.zeros((steps, rows.PULL_COLUMNS))
        self._work: dict[tuple[int, int], Floats] = {}
        self._group: Group | None = None

    def work(self, shape: tuple[int, int]) -> Floats:
        """Scratch of the step, for ropes that want it of this shape."""
        if shape not in self._work:
            self._work[shape] = np.zeros(shape)
        return self._work[shape]

    def group(self, kind: Kind) -> Group:
        """Arrays for ropes of this kind, stepped in lanes; those of the kind before it go."""
        if self._group is None or self._group.kind != kind:
            self._group = Group(kind, len(self.pulls))
        return self._group


@dataclass(frozen=True)
class Batch:
    """Steps in a row: what is prescribed, and what comes out."""

    boundary: Boundary  # (steps + 1, rows.MOTIONS) each
    pulls: Floats  # on the hang-off, a result, (steps, rows.PULL_COLUMNS)


@dataclass(frozen=True)
class Start:
    """A scene's rope at rest, for all members of the same scene."""

    rope: Rope  # without scratch
    work_shape: tuple[int, int]
    pull: Floats  # on the hang-off, rows.PULL_COLUMNS [N]
    tension: Floats  # of the elements from the lower end up [N]
    failure: str = ""  # why there is none; the other fields are then of no use


@dataclass(frozen=True)
class MemberFigures:
    """What a member did so far. Before its first step the tension is that at rest.

    If it never started its tensions are not finite.
    """

    steps: int
    tension_top_max_n: float
    tension_top_mean_n: float
    tension_top_min_n: float
    slack_share: float  # of the looks along the rope, those that found an element without tension
    unconverged_substeps: int
    failure: str = ""  # the sentence with which it stopped early


class Member:
    """One rope of an ensemble."""

    def __init__(self, scene: Scene, start: Start, borders: Borders) -> None:
        self.scene, self.borders = scene, borders
        self.failure = start.failure
        self.steps = 0
        self._step_ns = round(scene.time.step_s * 1e9)
        self._rope = start.rope._replace(state=start.rope.state.copy())
        self._work_shape = start.work_shape
        self._kind, self._kind_changes = kind_of(self._rope), 0
        self._tension, self._pull = start.tension, start.pull
        self._value, self._rate = (table[0] for table in borders.boundary)
        self._seen, self._recent = Extremes(), Extremes()
        if not self.failure:
            self._recent.take([float(start.pull[rows.PULL])])
        self._looks = self._slack_looks = 0
        self._unconverged = 0

    @property
    def rope(self) -> Rope:
        """The rope, without scratch."""
        return self._rope

    def kind(self) -> Kind | None:
        """What its rope shares with those beside which it can be stepped."""
        health = self._rope.state.health
        changes = int(health[rows.SPLITS] + health[rows.MERGES])
        if changes != self._kind_changes:
            self._kind, self._kind_changes = kind_of(self._rope), changes
        return self._kind

    @property
    def work_shape(self) -> tuple[int, int]:
        """Of the scratch that its steps want."""
        return self._work_shape

    def advance(self, steps: int, look_steps: int, scratch: Scratch) -> None:
        """Step on, with a look along the rope whenever `look_steps` are done; may fail."""
        boundary = self.borders.through(self.steps, steps)
        self.go_on(Batch(boundary, scratch.pulls[:steps]), 0, look_steps, scratch)

    def go_on(self, batch: Batch, done: int, look_steps: int, scratch: Scratch) -> None:
        """Do what is left of a batch of which `done` steps are done, and close it; may fail."""
        steps = len(batch.pulls)
        work = scratch.work(self._work_shape)
        while done < steps and not self.failure:
            some = min(steps - done, look_steps - self.steps % look_steps)
            done += self.step(batch, done, some, look_steps, work)
        elements = self._rope.state.counts[rows.ELEMENTS]
        self.close(batch, done, work[rows.TENSION, :elements].copy())

    def step(self, batch: Batch, done: int, some: int, look_steps: int, work: Floats) -> int:
        """Do so many steps of a batch after `done`; returns how many, fewer if it failed."""
        rope = self._rope._replace(work=work)
        ahead = Boundary(*(table[done : done + some + 1] for table in batch.boundary))
        pulls = batch.pulls[done : done + some]
        stepped = advance(rope, ahead, pulls, self.steps * self._step_ns * 1e-9, some)
        self.steps += stepped
        if stepped < some:
            self.failure = no_next_state(self.steps + 1, self.steps * self.scene.time.step_s)
        elif self.steps % look_steps == 0:
            self._look(work)
        return stepped

    def close(self, batch: Batch, done: int, tension: Floats) -> None:
        """Take down what the steps of a batch brought; tension: of the elements after the last."""
        self._tension = tension
        self._value, self._rate = (table[done] for table in batch.boundary)
        if done:
            self._pull = batch.pulls[done - 1].copy()
            some = Extremes()
            some.take(batch.pulls[:done, rows.PULL].tolist())
            self._seen.join(some)
            self._recent.join(some)

    def count_looks(self, looks: int, slack: int) -> None:
        """So many looks were taken elsewhere, of which so many found it slack."""
        self._looks += looks
        self._slack_looks += slack

    def _look(self, work: Floats) -> None:
        self._looks += 1
        elements = self._rope.state.counts[rows.ELEMENTS]
        self._slack_looks += bool(work[rows.TENSION, :elements].min() <= 0.0)

    def figures(self) -> MemberFigures:
        """What it did so far."""
        seen = self._seen if self.steps else self._recent
        return MemberFigures(
            steps=self.steps,
            tension_top_max_n=seen.high,
            tension_top_mean_n=seen.mean,
            tension_top_min_n=seen.low,
            slack_share=self._slack_looks / self._looks if self._looks else 0.0,
            unconverged_substeps=int(self._rope.state.health[rows.SUBSTEPS_UNCONVERGED]),
            failure=self.failure,
        )

    def snapshot(self) -> Snapshot:
        """A frozen copy of the present; its recent tensions begin anew."""
        state: Any = self._rope.state
        work = np.zeros(self._work_shape)
        work[rows.TENSION, : len(self._tension)] = self._tension
        unconverged = int(state.health[rows.SUBSTEPS_UNCONVERGED])
        taken = observe(
            state,
            work,
            Observation(
                stamp_ns=self.steps * self._step_ns,
                step=self.steps,
                step_s=self.scene.time.step_s,
                line=self.scene.ropes[0],
                ship=self.scene.ship,
                border=self._value,
                border_rate=self._rate,
                pull=self._pull,
                recent=self._recent,
                run=self._seen,
                winch_at_limit="",
                doubtful=unconverged > self._unconverged,
                computing_s=0.0,
                inputs={},
                card_error=KnownError(),
            ),
        )
        self._unconverged, self._recent = unconverged, Extremes()
        return taken
