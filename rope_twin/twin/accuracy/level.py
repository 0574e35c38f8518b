"""Accuracy levels of a twin (larger steps first, then fewer elements) and the change of level."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

from rope_twin.core.state import ELEMENTS, Floats, Model, Rope
from rope_twin.scene.card import KnownError, known_error
from rope_twin.scene.schema import Scene
from rope_twin.twin.accuracy.regrid import Grid, UpperEnd, coarse_room, coarser, finer, marks_of


@dataclass(frozen=True)
class AccuracyLevel:
    """Time step and mesh coarseness of a twin."""

    step_ns: int
    halvings: int = 0  # number of times the scene's element count was halved

    @property
    def step_s(self) -> float:
        """Time step [s]."""
        return self.step_ns / 1e9


STEPS_NS = (2_000_000, 5_000_000, 10_000_000, 20_000_000, 50_000_000)
MIN_ELEMENTS = 20  # of the finest rope: enough for an error within one per cent in smooth scenes
MIN_HALVED = 4  # a rope with fewer elements is not halved, as ropes of a system need at least two


@dataclass(frozen=True)
class SceneMesh:
    """Mesh of a rope in the scene, without its material coordinates."""

    model: Model
    room: int


def scene_level(scene: Scene) -> AccuracyLevel:
    """Return the scene's own mesh and time step."""
    return AccuracyLevel(round(scene.time.step_s * 1e9))


def elements_at(scene: Scene, halvings: int) -> tuple[int, ...]:
    """Return the elements of each rope of the scene after this many halvings."""
    counts = [line.elements for line in scene.ropes]
    for _ in range(halvings):
        counts = [count >> 1 if count >= MIN_HALVED else count for count in counts]
    return tuple(counts)


def levels_of(scene: Scene) -> tuple[AccuracyLevel, ...]:
    """Return the accuracy levels from the scene's own down, each with less work than the last."""
    top = scene_level(scene)
    levels = [top, *(AccuracyLevel(step_ns) for step_ns in STEPS_NS if step_ns > top.step_ns)]
    while max(elements_at(scene, levels[-1].halvings + 1)) >= MIN_ELEMENTS:
        levels.append(AccuracyLevel(levels[-1].step_ns, levels[-1].halvings + 1))
    return tuple(levels)


def error_at_level(scene: Scene, level: AccuracyLevel) -> KnownError:
    """Return the error of a level that is known from the scene's convergence study."""
    if level == scene_level(scene):
        return known_error(scene)
    counts = elements_at(scene, level.halvings)
    lines = [replace(line, elements=n) for line, n in zip(scene.ropes, counts, strict=True)]
    time = replace(scene.time, step_s=level.step_s)
    return known_error(replace(scene, ropes=tuple(lines), time=time))


Marks = list[Floats | None]  # of each rope: node coordinates of a finer mesh; None: not halved


class MeshState(NamedTuple):
    """Accuracy level in use, and the node coordinates of the finer meshes left so far."""

    level: AccuracyLevel
    marks: list[Marks]


class Mesh:
    """Mesh of all ropes: it changes with the accuracy level, and back again exactly."""

    def __init__(self, scene: Scene, ropes: Sequence[Rope]) -> None:
        """Start on the scene's own level, with its ropes."""
        self.level = scene_level(scene)
        self._base = [SceneMesh(rope.model, rope.state.s.shape[0]) for rope in ropes]
        self._marks: list[Marks] = []  # of each finer mesh, the scene's first

    def state(self) -> MeshState:
        """Return level and finer meshes."""
        return MeshState(self.level, self._marks)

    def restore(self, state: MeshState) -> None:
        """Continue from a state; the ropes are restored apart."""
        self.level, self._marks = state

    def changed(
        self, ropes: Sequence[Rope], level: AccuracyLevel, ends: Sequence[UpperEnd]
    ) -> list[Rope]:
        """Return the ropes on another level; ends: the upper end of each."""
        marks, on_mesh = list(self._marks), list(ropes)
        while len(marks) < level.halvings:
            halved = [int(rope.state.counts[ELEMENTS]) >= MIN_HALVED for rope in on_mesh]
            pairs = zip(on_mesh, halved, strict=True)
            marks.append([marks_of(rope) if halve else None for rope, halve in pairs])
            for r, left in enumerate(marks[-1]):
                if left is not None:
                    on_mesh[r] = coarser(on_mesh[r], ends[r])
        while len(marks) > level.halvings:
            for r, left in enumerate(marks.pop()):
                if left is not None:
                    grid = self._grid(r, on_mesh[r], marks, left)
                    on_mesh[r] = finer(on_mesh[r], grid, ends[r])
        self.level, self._marks = level, marks
        own = self._base[0].model.step  # restores a step that is no whole number of nanoseconds
        step = own if round(own * 1e9) == level.step_ns else level.step_s
        return [rope._replace(model=rope.model._replace(step=step)) for rope in on_mesh]

    def _grid(self, r: int, rope: Rope, marks: Sequence[Marks], left: Floats) -> Grid:
        """Return a finer mesh of rope r; marks: of the meshes that are finer still."""
        base, halvings = self._base[r], sum(own[r] is not None for own in marks)
        room, times = base.room, float(1 << halvings)
        for _ in range(halvings):
            room = coarse_room(room, rope.sections)
        model = base.model._replace(
            element_length=times * base.model.element_length,
            split_above=times * base.model.split_above,
            merge_below=times * base.model.merge_below,
        )
        return Grid(model, room, left)
