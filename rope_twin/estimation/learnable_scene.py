"""Scenes whose figures can be learned, and what is known of them before: limits and prior."""

from __future__ import annotations

from rope_twin.core import state as rows
from rope_twin.effects.payload import SplashZoneParams
from rope_twin.effects.rigid_body import RigidBodyParams
from rope_twin.effects.seabed import SeabedParams
from rope_twin.errors import InputError, phrase
from rope_twin.estimation.figures import Prior, prior_of
from rope_twin.scene.rigging import is_joined
from rope_twin.scene.rope_model import build
from rope_twin.scene.schema import Scene
from rope_twin.twin.statics import solve_scene_statics

_CANNOT = {
    RigidBodyParams: "its payload is a rigid body",
    SplashZoneParams: "its payload may be in the splash zone",
    SeabedParams: "it has a seabed",
}


def check_learnable(scene: Scene) -> None:
    """Check that a scene's figures can be learned.

    Raises:
        InputError: one sentence, if they cannot be learned yet.
    """
    right = "one rope with a point payload in open water can be learned"
    if is_joined(scene):
        raise InputError(phrase(f"learn {scene.name}", "its ropes meet", right))
    for kind, what in _CANNOT.items():
        if scene.listed(kind) is not None:
            raise InputError(phrase(f"learn {scene.name}", what, right))
    if scene.ropes[0].to not in [one.name for one in scene.payloads]:
        raise InputError(phrase(f"learn {scene.name}", "its rope carries no payload", right))


def scene_prior(scene: Scene, tared: bool = False) -> Prior:
    """Return the prior of a scene by its section `learning` and its static top tension.

    tared: the load pin was tared with an empty hook.

    Raises:
        SceneError: the scene has no static equilibrium.
    """
    static_n = float(solve_scene_statics(scene, build(scene))[rows.PULL])
    prior = prior_of(scene.learning, static_n)
    return prior.tared() if tared else prior
