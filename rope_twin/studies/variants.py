"""A scene as it is, but with other elements, another step or tolerance, or an effect more."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from rope_twin.effects import EFFECTS
from rope_twin.effects.payload import PayloadParams
from rope_twin.effects.rigid_body import RigidBodyParams
from rope_twin.scene.model.grid import elements_with
from rope_twin.scene.schema import Scene


def variant(
    scene: Scene,
    elements: int | None = None,
    step_s: float | None = None,
    tolerance_n: float | None = None,
) -> Scene:
    """Return the scene with these values in place of its own; None keeps the scene's value.

    elements: of the first rope; in multi-line systems the others are scaled in proportion. For
    scenes whose damping is in N·s, or a fraction of the first axial mode, the physics is unchanged.
    """
    own = [line.elements for line in scene.ropes]
    counts = own if elements is None else elements_with(own, elements)
    ropes = (replace(one, elements=n) for one, n in zip(scene.ropes, counts, strict=True))
    time = scene.time
    time = time if step_s is None else replace(time, step_s=step_s)
    time = time if tolerance_n is None else replace(time, newton_tolerance_n=tolerance_n)
    return replace(scene, ropes=tuple(ropes), time=time)


def with_effect(scene: Scene, params: Any) -> Scene:
    """Return the scene with one more effect, in the order of EFFECTS; a 6-DOF body replaces the
    point.
    """
    order = [effect.params for effect in EFFECTS]
    body = isinstance(params, RigidBodyParams)
    kept = [own for own in scene.effects if not (body and isinstance(own, PayloadParams))]
    effects = sorted((*kept, params), key=lambda own: order.index(type(own)))
    return replace(scene, effects=tuple(effects))
