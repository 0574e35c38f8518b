"""Accuracy levels of a twin (larger steps first, then fewer elements) and the change of level."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

from rope_twin.core.state import Floats, Model, Rope
from rope_twin.effects.rigid_body import RigidBodyParams
from rope_twin.errors import StateError, phrase
from rope_twin.scene.card import KnownError, known_error
from rope_twin.scene.schema import Scene
from rope_twin.scene.validation.rigging import is_joined, refuse_body, refuse_joined
from rope_twin.scene.validation.vortices import refuse_shedding, shedding_model
from rope_twin.twin.accuracy.regrid import Grid, HangOff, coarse_room, coarser, finer, marks_of


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
MIN_ELEMENTS = 20  # enough for an error within one per cent in smooth scenes


@dataclass(frozen=True)
class SceneMesh:
    """Mesh of the scene, without its material coordinates."""

    model: Model
    room: int


def scene_level(scene: Scene) -> AccuracyLevel:
    """Return the scene's own mesh and time step."""
    return AccuracyLevel(round(scene.time.step_s * 1e9))


def levels_of(scene: Scene) -> tuple[AccuracyLevel, ...]:
    """Return the accuracy levels from the scene's own down, each with less work than the last.

    Multi-line systems, wakes of vortices and rigid bodies cannot be transferred to another mesh:
    such a scene has one level.
    """
    if is_joined(scene) or shedding_model(scene) or scene.listed(RigidBodyParams) is not None:
        return (scene_level(scene),)
    top, elements = scene_level(scene), scene.ropes[0].elements
    levels = [top, *(AccuracyLevel(step_ns) for step_ns in STEPS_NS if step_ns > top.step_ns)]
    halvings = 1
    while elements >> halvings >= MIN_ELEMENTS:
        levels.append(AccuracyLevel(levels[-1].step_ns, halvings))
        halvings += 1
    return tuple(levels)


def check_transferable(scene: Scene, is_cut: bool) -> None:
    """Check that the ropes of a scene can be transferred to another mesh.

    Raises:
        SceneError: the scene is multi-line, has a VIV model or a rigid body.
        StateError: the rope was cut; its parts cannot be transferred either.
    """
    refuse_joined(scene)
    if is_cut:
        raise StateError(phrase("other elements", "the rope was cut", "its parts keep theirs"))
    refuse_body(scene, "it cannot be carried over to another grid")
    refuse_shedding(scene, "wakes of vortices cannot be carried over to another grid")


def error_at_level(scene: Scene, level: AccuracyLevel) -> KnownError:
    """Return the error of a level that is known from the scene's convergence study."""
    if level == scene_level(scene):
        return known_error(scene)
    line = replace(scene.ropes[0], elements=scene.ropes[0].elements >> level.halvings)
    there = replace(
        scene,
        ropes=(line, *scene.ropes[1:]),
        time=replace(scene.time, step_s=level.step_s),
    )
    return known_error(there)


class MeshState(NamedTuple):
    """Accuracy level in use, and the node coordinates of the finer meshes left so far."""

    level: AccuracyLevel
    marks: list[Floats]


class Mesh:
    """Mesh of a single rope: it changes with the accuracy level, and back again exactly."""

    def __init__(self, scene: Scene, rope: Rope) -> None:
        """Start on the scene's own level, with its rope."""
        self.level = scene_level(scene)
        self._base = SceneMesh(rope.model, rope.state.s.shape[0])
        self._marks: list[Floats] = []  # material coordinates of each finer mesh, the scene's first

    def state(self) -> MeshState:
        """Return level and finer meshes."""
        return MeshState(self.level, self._marks)

    def restore(self, state: MeshState) -> None:
        """Continue from a state; the rope is restored apart."""
        self.level, self._marks = state

    def changed(self, rope: Rope, level: AccuracyLevel, at: HangOff) -> Rope:
        """Return the rope on another level."""
        marks, base = list(self._marks), self._base
        while len(marks) < level.halvings:
            marks.append(marks_of(rope))
            rope = coarser(rope, at)
        while len(marks) > level.halvings:
            rope = finer(rope, _grid(base, rope, len(marks) - 1, marks.pop()), at)
        own = base.model.step  # restores a step that is no whole number of nanoseconds exactly
        model = rope.model._replace(step=own if round(own * 1e9) == level.step_ns else level.step_s)
        self.level, self._marks = level, marks
        return rope._replace(model=model)


def _grid(base: SceneMesh, rope: Rope, halvings: int, marks: Floats) -> Grid:
    """Return the scene's mesh after this many halvings."""
    room, times = base.room, float(1 << halvings)
    for _ in range(halvings):
        room = coarse_room(room, rope.sections)
    model = base.model._replace(
        element_length=times * base.model.element_length,
        split_above=times * base.model.split_above,
        merge_below=times * base.model.merge_below,
    )
    return Grid(model, room, marks)
