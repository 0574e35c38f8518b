"""Parameters of every effect in a scene that is turned about the vertical, or mirrored."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from effect_cases import PARAMS, SMALL
from numpy.typing import NDArray
from rigs import march_to_end, sine

from rope_twin import Snapshot, Twin
from rope_twin.effects.hull_contact import HullContactParams
from rope_twin.effects.rigid_body import RigidBodyParams
from rope_twin.scene.schema import Scene

Vector = NDArray[np.float64]
Triple = tuple[float, float, float]
Turned = Callable[[Any, "Turn"], Any]
RIG = replace(SMALL, added=(150.0, 150.0, 260.0), area=(0.9, 0.9, 1.5))  # round about the vertical


class Turn:
    """Rotation about z by an angle, after north and south are swapped if it mirrors."""

    def __init__(self, degrees: float, mirrored: bool) -> None:
        self.degrees, self.side = degrees, -1.0 if mirrored else 1.0
        c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
        self.matrix = np.array([[c, -s * self.side], [s, c * self.side]])

    def flat(self, vector: tuple[float, float]) -> tuple[float, float]:
        """Transform a horizontal vector."""
        east, north = (float(part) for part in self.matrix @ vector)
        return east, north

    def point(self, vector: Triple) -> Triple:
        """Transform a vector or a position."""
        return (*self.flat(vector[:2]), vector[2])

    def heading(self, degrees: float) -> float:
        """Transform a direction, from east to north."""
        return math.remainder(self.side * degrees + self.degrees, 360.0)

    def follow(self, rows: Vector) -> Vector:
        """Transform rows of x, y, z."""
        full = np.eye(3)
        full[:2, :2] = self.matrix
        return rows @ full.T


def _body(params: RigidBodyParams, turn: Turn) -> RigidBodyParams:
    """Its own axes turn with it; what is mirrored has its y on the other side."""

    def own(vector: Triple) -> Triple:
        return vector[0], turn.side * vector[1], vector[2]

    return replace(
        params,
        heading_deg=turn.heading(params.heading_deg),
        centre_of_gravity_m=own(params.centre_of_gravity_m),
        centre_of_drag_m=own(params.centre_of_drag_m),
        slings=tuple(replace(sling, to_m=own(sling.to_m)) for sling in params.slings),
    )


def _hull(params: HullContactParams, turn: Turn) -> HullContactParams:
    """Its boxes turn with it; what is mirrored has port on the other side."""
    boxes = tuple(
        replace(box, centre_m=(box.centre_m[0], turn.side * box.centre_m[1], box.centre_m[2]))
        for box in params.boxes
    )
    return replace(params, boxes=boxes, heading_deg=turn.heading(params.heading_deg))


# What has a direction. Lift begins on one hand, the same in a mirror: there is none where one is.
TURNED: dict[str, Turned] = {
    "current": lambda p, turn: replace(
        p, profile=tuple((z, (*turn.flat(v[:2]), *v[2:])) for z, v in p.profile)
    ),
    "wind": lambda p, turn: replace(p, velocity_m_per_s=turn.flat(p.velocity_m_per_s)),
    "waves": lambda p, turn: replace(p, heading_deg=turn.heading(p.heading_deg)),
    "bending": lambda p, turn: replace(p, clamped_along=turn.point(p.clamped_along)),
    "seabed": lambda p, turn: replace(p, slope=turn.flat(p.slope)),
    "hull_contact": _hull,
    "rigid_body": _body,
    "net": lambda p, turn: replace(p, facing_deg=turn.heading(p.facing_deg)),
    "net_curtain": lambda p, turn: replace(p, heading_deg=turn.heading(p.heading_deg)),
    "fairing": lambda p, turn: replace(p, axis=turn.point(p.axis)),
}
LIFTLESS: dict[str, Callable[[Any], Any]] = {
    "waves": lambda p: replace(p, spreading=None),  # drawn to the left and right by a seed
    "strouhal_forcing": lambda p: replace(p, lift_over_drag=0.0),
    "wake_oscillator": lambda p: replace(p, lift=0.0),
    "travelling_waves": lambda p: replace(p, lift=(0.0, 0.0)),
    "payload_shedding": lambda p: replace(p, lift_coefficient=0.0),
}


def scene_of(names: list[str], mirrorable: bool, turn: Turn | None = None) -> Scene:
    """Return the small rope with these effects; `mirrorable`: without what has a hand."""
    rig = RIG if turn is None else replace(RIG, hang_off=turn.point(RIG.hang_off))
    effects = []
    for name in names:
        params = PARAMS[name]
        if mirrorable and name in LIFTLESS:
            params = LIFTLESS[name](params)
        effects.append(params if turn is None else TURNED.get(name, lambda p, _: p)(params, turn))
    return replace(rig.scene(), effects=tuple(effects))


def lowered(scene: Scene, seconds: float) -> Snapshot:
    """Pay out under heave; return the last snapshot."""
    snapshot = march_to_end(Twin(scene), sine(0.5, 4.0), seconds, speeds=[(0.0, 2.0)])
    return snapshot
