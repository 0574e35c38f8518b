"""A rope whose payload is a rigid body, at rest or set in motion by hand."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rigs import NOTHING, Rig

from rope_twin import Twin
from rope_twin.core import state as rows
from rope_twin.core.body import state as at
from rope_twin.core.body.energy import pose_of
from rope_twin.core.body.state import RigidBody
from rope_twin.effects.payload import PayloadParams
from rope_twin.effects.rigid_body import RigidBodyParams
from rope_twin.scene.schema import Scene

Vector = NDArray[np.float64]
# A short rope without weight to speak of.
LINE = Rig(length=20.0, elements=4, mass=0.01, EA=1e8, diameter=0.001, load=2000.0, step=0.005)


def scene_of(rig: Rig, body: RigidBodyParams) -> Scene:
    """The rig's scene with the body in place of the point."""
    scene = rig.scene()
    kept = tuple(own for own in scene.effects if not isinstance(own, PayloadParams))
    at_payload = next(i for i, own in enumerate(scene.effects) if isinstance(own, PayloadParams))
    return replace(scene, effects=(*kept[:at_payload], body, *kept[at_payload:]))


def body_in(twin: Twin) -> Any:
    """The kernels' data of a twin's body."""
    return next(own for own in twin.rope.effects if isinstance(own, RigidBody))


class Hung:
    """A twin whose body can be set in motion after its first step."""

    def __init__(self, rig: Rig, body: RigidBodyParams) -> None:
        self.twin = Twin(scene_of(rig, body))
        self.twin.advance(1)
        self.body = body_in(self.twin)

    @property
    def record(self) -> Vector:
        """The record that holds; of it any part may be changed."""
        return np.asarray(self.body.records[int(self.body.memory[0, 0])])

    def let_go(self, v: Any, spin: Any, force: Any = NOTHING, moment: Any = NOTHING) -> None:
        """The body moves so, at the place and in the attitude that it has, under these forces."""
        for place, value in ((at.V, v), (at.SPIN, spin), (at.FORCE, force), (at.MOMENT, moment)):
            self.record[place : place + 3] = value

    def slacken(self) -> None:
        """Move it up to the hook, so that no sling of any length holds it."""
        self.record[at.X : at.X + 3] = self.hook

    @property
    def hook(self) -> Vector:
        """Where the rope ends [m]."""
        return self.twin.rope.state.nodes[rows.POSITION : rows.POSITION + 3, 0]

    def pose(self) -> Any:
        """Where the body is."""
        return pose_of(self.body)
