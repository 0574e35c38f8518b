"""Contact of a rigid body's corners with the seabed: normal force, friction, lift-off.

The law is that of a payload node (effects/seabed.py), with k shared among the corners. Omitted from
the Jacobian: the change of slope of gridded soundings below a corner.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

import numpy as np
from numba.extending import overload

from rope_twin.core.bed import Plane, beds_at, grid_bed, plane_bed
from rope_twin.core.body.change import NONE
from rope_twin.core.body.contact import CREEP, add_push
from rope_twin.core.body.parts import part
from rope_twin.core.body.rotation import along, dot, outward, vector
from rope_twin.core.body.state import GridBed, PlaneBed, RigidBody
from rope_twin.core.jit.decorators import LINKED, jit
from rope_twin.core.state import Floats


@jit
def _push(bed: Any, body: Any, q: float, pose: Any, r: Any, ground: Any) -> Any:
    """Return the contact force at one corner r; ground: height and slopes of the seabed below."""
    z, east, north = ground
    nz = 1.0 / sqrt(1.0 + east * east + north * north)
    d = (z - pose[0][2] - dot(pose[1][2], r)) * nz
    if not d > 0.0:
        return NONE, NONE, 0.0
    touch = (bed.k, bed.chi, bed.mu), d, (-east * nz, -north * nz, nz), NONE
    return add_push(body, q, pose, r, touch)


def _ground(shape: Any, x: Any, y: Any) -> Any:
    """Return the height of the seabed below a position and its slopes to the east and the north."""
    return plane_bed(shape, x, y) if isinstance(shape, Plane) else grid_bed(shape, x, y)


@overload(_ground, jit_options=LINKED, strict=False)
def _ground_by_type(shape: Any, x: Any, y: Any) -> Any:
    chosen = plane_bed if shape.instance_class is Plane else grid_bed

    def choice(shape: Any, x: Any, y: Any) -> Any:
        return chosen(shape, x, y)

    return choice


@part("act", PlaneBed, GridBed)
def act(bed: Any, body: Any, q: float, pose: Any) -> Any:
    """Return the contact force and moment of all corners on the seabed."""
    f, t, size = NONE, NONE, 0.0
    for j in range(body.corners.shape[0]):
        r = vector(body.corners[j], 0)
        place = along(pose[0], 1.0, outward(pose[1], r))
        ground = _ground(bed.shape, place[0], place[1])
        more, twist, N = _push(bed, body, q, pose, r, ground)
        f, t, size = along(f, 1.0, more), along(t, 1.0, twist), size + N
    return f, t, size


@part("floor", PlaneBed, GridBed)
def floor(bed: Any, body: Any, place: Any) -> float:
    """Return the height of the seabed at a position."""
    z, _, _ = _ground(bed.shape, place[0], place[1])
    return float(z)


def bed_pushes(
    bed: PlaneBed | GridBed, body: RigidBody, pose: Any
) -> tuple[Floats, Floats, Floats]:
    """Return clearance of each corner [m], normal force [N], and total contact force (n, 3) [N].

    pose: of core/body/energy.py.
    """
    places, v = pose.place(body.corners), pose.speed(body.corners)
    found = beds_at(bed.shape, places[:, 0].copy(), places[:, 1].copy()).T
    normal = np.column_stack([-found[:, 1:], np.ones(len(found))])
    steep = np.sqrt((normal * normal).sum(axis=1))
    normal /= steep[:, None]
    above, away = places[:, 2] - found[:, 0], (v * normal).sum(axis=1)
    sunk = np.maximum(-above / steep, 0.0)
    push = bed.k * sunk * np.maximum(1.0 - bed.chi * away, 0.0)
    slide = v - away[:, None] * normal
    rub = bed.mu * push / np.sqrt((slide * slide).sum(axis=1) + CREEP**2)
    return above, push, push[:, None] * normal - rub[:, None] * slide


@part("power", PlaneBed, GridBed)
def power(bed: Any, body: RigidBody, pose: Any) -> float:
    """Return the power of contact and friction [W]; energy stored in the soil is given back."""
    return float((bed_pushes(bed, body, pose)[2] * pose.speed(body.corners)).sum())
