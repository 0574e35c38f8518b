"""Beginning of learning: the estimator of a scene for series that begin with the rope at rest."""

from __future__ import annotations

import numpy as np

from rope_twin.core import state as rows
from rope_twin.effects.rigid_body import RigidBodyParams
from rope_twin.effects.seabed import SeabedParams
from rope_twin.effects.splash_zone import SplashZoneParams
from rope_twin.errors import InputError, phrase
from rope_twin.estimation.estimator import Estimator
from rope_twin.estimation.figures import Prior, prior_of
from rope_twin.estimation.lift_model import LiftModel
from rope_twin.estimation.measured_lift import MeasuredLift
from rope_twin.scene.change import Change, change_scene
from rope_twin.scene.model.rope import build
from rope_twin.scene.schema import Scene
from rope_twin.scene.validation.rigging import is_joined
from rope_twin.twin.statics import solve_scene_statics

SAME_LENGTH_M = 0.01
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


def begin_at_rest(scene: Scene, lift: MeasuredLift, *, tared: bool = False) -> Estimator:
    """Return an estimator of measured series that begin with the rope at rest.

    The rope begins with the measured line out. Its first block begins a minute later.

    Raises:
        InputError: the scene cannot be learned yet, or the series are empty.
        SceneError: the measured line out is not possible in this scene.
    """
    check_learnable(scene)
    begin_s = lift.begin_s
    if not np.isfinite(begin_s):
        what = "tension, heave or line out has no sample"
        raise InputError(phrase("measured lift", what, "give all three"))
    line, _ = lift.line_motion(np.array([begin_s]))
    if abs(float(line[0]) - scene.ropes[0].length_m) > SAME_LENGTH_M:
        scene = change_scene(scene, [Change("ropes[0].length_m", float(line[0]))])
    prior = scene_prior(scene, tared)
    lift.pin_noise_n = prior.pin_noise_n
    model = LiftModel(scene, lift)
    return Estimator(model, prior, model.begin_at_rest(begin_s), begin_s)
