"""Static equilibrium from which a run starts, and the checks on it."""

from __future__ import annotations

import gc
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from math import isfinite

import numpy as np

from rope_twin.core import state as rows
from rope_twin.core.body.step import pose_of
from rope_twin.core.moved_end import without_motion
from rope_twin.core.state import Boundary, Floats, Rope
from rope_twin.core.statics import solve_statics
from rope_twin.core.step import advance
from rope_twin.core.still_rope import Equilibrium
from rope_twin.errors import SceneError, phrase
from rope_twin.quantity import kilonewtons
from rope_twin.scene.lift import suspended_weights
from rope_twin.scene.rigging import places
from rope_twin.scene.rope_data import SAFETY_FACTOR
from rope_twin.scene.schema import Scene
from rope_twin.twin.snapshot_builder import body_of, strength_of

MAX_FLOAT_HEIGHT_M = 1.0


@contextmanager
def no_garbage_collection() -> Iterator[None]:
    """Pause garbage collection while compiling.

    The compiler makes millions of objects that stay alive; scanning them costs a tenth of its time.
    """
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


def solve_scene_statics(scene: Scene, rope: Rope) -> Floats:
    """Solve for static equilibrium, compiling all kernels; return the force on the hang-off.

    The force has rows.PULL_COLUMNS: magnitude and vector [N].

    Raises:
        SceneError: there is no equilibrium, or the rope floats.
    """
    line = scene.ropes[0]
    nodes = rope.state.nodes
    rope = rope._replace(effects=without_motion(rope.effects))
    with no_garbage_collection():
        equilibrium = solve_statics(rope, line.length_m)
    judge_body(scene, rope)
    check_equilibrium(
        scene,
        equilibrium,
        float(nodes[rows.POSITION + 2, : rope.state.counts[rows.ELEMENTS]].max()),
    )
    # One step at equilibrium on a copy gives the static tension at the hang-off.
    copied = rope._replace(state=rope.state.copy())
    boundary = Boundary(np.zeros((2, rows.MOTIONS)), np.zeros((2, rows.MOTIONS)))
    boundary.value[:] = [*scene.ship.hang_off_m, line.length_m]
    pull: Floats = np.zeros((1, rows.PULL_COLUMNS))
    advance(copied, boundary, pull, 0.0, 1)
    return pull.reshape(rows.PULL_COLUMNS)


def judge_body(scene: Scene, rope: Rope) -> None:
    """Check that the rope's rigid body, if any, has an equilibrium position.

    Raises:
        SceneError: it has none: it slides.
    """
    body = body_of(rope)
    if body is not None and not np.isfinite(pose_of(body).velocity).all():
        problem = "the body finds no rest: friction does not hold it and its slings are slack"
        remedy = "shorten the slings or the rope, raise friction, or lay it on a flatter bed"
        raise SceneError(f"{scene.path}: effects.rigid_body", problem, remedy)


def check_equilibrium(scene: Scene, equilibrium: Equilibrium, highest_m: float) -> None:
    """Check that ropes can start from this equilibrium; highest_m: z of their highest node [m].

    Raises:
        SceneError: there is no equilibrium, or the ropes float.
    """
    where = f"{scene.path}: ropes[0]"
    if not equilibrium.found:
        reason = f"{equilibrium.residual_n:.3g} N pull at a node of the best shape found"
        if not isfinite(equilibrium.residual_n):
            reason = "forces on the rope are not finite"
        raise SceneError(
            where,
            f"no static equilibrium ({reason})",
            "check that rope and payload sink, or fix the lower end",
        )
    highest_hang_off_m = max(position[2] for position in places(scene).values())
    if highest_m > max(highest_hang_off_m, 0.0) + MAX_FLOAT_HEIGHT_M:
        raise SceneError(
            where,
            f"at rest it floats up to z = {highest_m:.1f} m",
            "check mass_kg and displaced_volume_m3 of the payload, or take a heavier rope",
        )


def weak_ropes(scene: Scene, ropes: Sequence[Rope]) -> Iterator[str]:
    """Yield a warning for each rope at rest with a section that is too weak for its load.

    The first rope is left out if it alone carries the suspended load: the sense checks of the scene
    cover it.
    """
    suspended = suspended_weights(scene)
    alone = suspended is not None and len(suspended.lines) == 1
    for number, (line, rope) in enumerate(zip(scene.ropes, ropes, strict=True)):
        if number == 0 and alone:
            continue
        strength = strength_of(line, 0.0, rope)
        breaking = strength.breaking_load_n
        load = strength.utilisation * breaking
        if load > breaking / SAFETY_FACTOR:
            problem = (
                f"'{line.name}' carries {kilonewtons(load)} at rest against a breaking load "
                f"of {kilonewtons(breaking)}, a safety factor of {breaking / load:.2f}"
            )
            remedy = f"below {SAFETY_FACTOR:g} take a stronger rope, or a steeper bridle"
            yield phrase(f"{scene.path}: ropes[{number}]", problem, remedy)
