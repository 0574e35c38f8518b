"""A scene's rope at rest in its current: shape, tension, stiffness and mass of its free nodes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rope_twin.core.state import Floats
from rope_twin.core.statics.equilibrium import solve_statics
from rope_twin.core.statics.forces import SYMMETRIC, Couplings, Elastic, StillRope
from rope_twin.effects.current import CurrentParams
from rope_twin.errors import SceneError, phrase
from rope_twin.scene.model.rope import build
from rope_twin.scene.schema import Scene
from rope_twin.scene.validation.rigging import refuse_body


@dataclass(frozen=True)
class AtRest:
    """A rope at rest; n free nodes from the lower end up, in the matrices' order."""

    scene: Scene
    first: int
    place: Floats  # (3, nodes)
    tension: Floats
    stiffness: Floats  # dT/dl of the elements [N/m]
    mass: Floats  # (3, 3, n)
    couplings: Couplings | None  # of bending, at all nodes but the hang-off's
    tangent: Floats  # at the free nodes, (3, n)
    s: Floats  # unstretched, of the free nodes from the hang-off [m]
    rest: Floats  # unstretched lengths of the elements [m]


def bring_to_rest(scene: Scene) -> AtRest:
    """Return the static equilibrium of the scene's rope in its current.

    Raises:
        SceneError: it cannot rest, is slack somewhere, or carries a rigid body.
    """
    refuse_body(scene, "the modes of a rope with a body that swings by itself are not known")
    rope, line = build(scene), scene.ropes[0]
    end = solve_statics(rope, line.length_m)
    if not end.found:
        raise SceneError(
            phrase(f"{scene.path}: ropes[0]", "no static equilibrium", "check what holds the rope")
        )
    still = StillRope(rope, line.length_m)
    place = still.place.copy()
    forces = still.forces(place)
    if not (forces.tension > 0.0).all():
        slack = int((forces.tension <= 0.0).sum())
        what = f"{slack} of {still.n} elements are slack at rest, so it has no natural frequency"
        raise SceneError(
            phrase(f"{scene.path}: ropes[0]", what, "give it weight, tension or a payload")
        )
    span = np.diff(place, axis=1)
    law: Elastic = still.elastic(np.sqrt((span * span).sum(axis=0)))
    direction = span / np.sqrt((span * span).sum(axis=0))
    mean = direction.copy()
    mean[:, 1:] += direction[:, :-1]
    first = still.first
    tangent = mean / np.sqrt((mean * mean).sum(axis=0))
    s = np.cumsum(still.rest[::-1])[::-1]
    mass = forces.mass[SYMMETRIC]
    still.rest_at(place)
    couplings = still.couplings() if still.reach > 1 else None
    return AtRest(
        scene, first, place, forces.tension, law.stiffness, mass[:, :, first:], couplings,
        tangent[:, first:], s[first:], still.rest,
    )  # fmt: skip


def water_at(scene: Scene, z: Floats) -> Floats:
    """Return the scene's current at these heights [m/s], (3, n)."""
    water = np.zeros((3, len(z)))
    for params in scene.effects:
        if isinstance(params, CurrentParams):
            rows = np.array([[at, *velocity] for at, velocity in params.points])[::-1]
            for k in (0, 1):
                water[k] += np.interp(z, rows[:, 0], rows[:, 1 + k])
    return water
