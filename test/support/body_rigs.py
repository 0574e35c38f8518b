"""A rope with a rigid body as its payload, in static equilibrium or with a prescribed motion."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rigs import CALM, NOTHING, STILL_WATER, Rig
from scipy.spatial.transform import Rotation

from rope_twin import Twin
from rope_twin.core import state as rows
from rope_twin.core.body import state as at
from rope_twin.core.body.state import RigidBody
from rope_twin.core.body.step import pose_of
from rope_twin.effects.current import CurrentParams
from rope_twin.effects.payload import PayloadParams, SplashZoneParams
from rope_twin.effects.rigid_body import RigidBodyParams, Sling
from rope_twin.effects.seabed import SeabedParams
from rope_twin.scene.schema import Scene

Vector = NDArray[np.float64]
# A short rope without weight to speak of.
LINE = Rig(length=20.0, elements=4, mass=0.01, EA=1e8, diameter=0.001, load=2000.0, step=0.005)


def scene_of(rig: Rig, body: RigidBodyParams) -> Scene:
    """Return the rig's scene with the rigid body in place of the point payload.

    One with a deck lists no current, as the shipped scene with a deck: one step serves both.
    """
    scene = rig.scene()
    left_out: tuple[type, ...] = (PayloadParams,)
    if body.deck is not None:
        assert rig.current == STILL_WATER
        left_out = (PayloadParams, CurrentParams)
    kept = tuple(effect for effect in scene.effects if not isinstance(effect, left_out))
    return replace(scene, effects=(*kept, body))


def body_in(twin: Twin) -> Any:
    """Return the kernel data of a twin's rigid body."""
    return next(effect for effect in twin.rope.effects if isinstance(effect, RigidBody))


class Hung:
    """A twin whose rigid body can be given a motion after its first step."""

    def __init__(self, rig: Rig, body: RigidBodyParams) -> None:
        self.twin = Twin(scene_of(rig, body))
        self.twin.advance(1)
        self.body = body_in(self.twin)

    @property
    def record(self) -> Vector:
        """The body's current record; every part of it may be written."""
        return np.asarray(self.body.records[int(self.body.memory[0, 0])])

    def let_go(self, v: Any, spin: Any, force: Any = NOTHING, moment: Any = NOTHING) -> None:
        """Set velocity, spin, force and moment of the body; position and attitude stay."""
        for row, value in ((at.V, v), (at.SPIN, spin), (at.FORCE, force), (at.MOMENT, moment)):
            self.record[row : row + 3] = value

    def slacken(self) -> None:
        """Move the body up to the hook, so that all slings are slack."""
        self.record[at.X : at.X + 3] = self.hook

    @property
    def hook(self) -> Vector:
        """Position of the lower end of the rope [m]."""
        return self.twin.rope.state.nodes[rows.POSITION : rows.POSITION + 3, 0]

    def pose(self) -> Any:
        """Return the pose of the body."""
        return pose_of(self.body)


def between(rig: Rig, body: RigidBodyParams, bed: SeabedParams, bottom_m2: float = 0.0) -> Scene:
    """Return a scene with the body between surface and seabed, in waves of zero height."""
    zone = SplashZoneParams(height_m=body.size_m[2], bottom_area_m2=bottom_m2)
    scene = scene_of(rig, body)
    index = next(i for i, effect in enumerate(scene.effects) if effect is body)
    return replace(
        scene, effects=(CALM, *scene.effects[:index], bed, body, zone, *scene.effects[index + 1 :])
    )


class Adrift(Hung):
    """A rigid body between surface and seabed on a slack sling."""

    def __init__(self, rig: Rig, body: RigidBodyParams, bed: SeabedParams, bottom: float = 0.0):
        self.twin = Twin(between(rig, body, bed, bottom))
        self.twin.advance(1)
        self.body = body_in(self.twin)

    def lay(self, position: Any, turn: Any, v: Any = NOTHING, spin: Any = NOTHING) -> None:
        """Set position, attitude (rotation vector), velocity and spin of the body; no force."""
        self.record[at.X : at.X + 3] = position
        self.record[at.Q : at.Q + 4] = Rotation.from_rotvec(turn).as_quat()
        self.let_go(v, spin)


def aground(turn: Any, side: float, steps: int = 40) -> Vector:
    """Run a tilted box into shallow water over a slope: position, velocity, spin, (n, 3, 3).

    turn: rotation of the whole scene about z; side: -1 mirrors it in x.
    """
    follow = turn @ np.diag([side, 1.0, 1.0])
    slope = turn @ [side * 0.1, -0.05, 0.0]
    bed = SeabedParams(
        depth_m=1.4, slope=(float(slope[0]), float(slope[1])), payload_penetration_m=0.05
    )
    sling = Sling(to_m=(0.0, 0.0, 0.6), length_m=60.0, stiffness_n_per_m=1e5)
    body = RigidBodyParams(
        size_m=(4.0, 3.0, 1.2), centre_of_gravity_m=(side * 0.2, 0.1, -0.1), slings=(sling,),
        heading_deg=float(np.degrees(np.arctan2(turn[1, 0], turn[0, 0]))),
    )  # fmt: skip
    rig = replace(
        LINE, density=1025.0, load=12e3, volume=14.4, added=(2e3, 3e3, 9e3), area=(4.0, 5.0, 12.0),
        step=0.02, hang_off=(0.0, 0.0, 24.0),
    )  # fmt: skip
    hung = Adrift(rig, body, bed, 12.0)
    lean = side * follow @ [0.2, -0.1, 0.3]
    attitude = Rotation.from_rotvec(lean).as_matrix() @ turn
    start = follow @ [0.3, -0.2, 0.0] + [0.0, 0.0, 0.3]
    hung.lay(start, Rotation.from_matrix(attitude).as_rotvec(), follow @ [0.4, 0.2, -0.5])
    rows = []
    for _ in range(steps):
        hung.twin.advance(1)
        pose = hung.pose()
        rows.append([pose.centre, pose.velocity, pose.turn @ pose.spin])
    return np.array(rows)
