"""Pose and energy balance of a rigid body, for Python callers.

Kinetic energy includes that of the added mass at the relative velocity c, and p·u besides, so that
its rate is the power of all forces except the added mass: along z ∫w·M(w)·dw, of which the part
that differs between ascent and descent is ΔM/2·(w·√(w² + δ²) - δ²·asinh(w/δ)). Slings and pin store
½·k·stretch². The dissipation of their dampers and of the components (core/body/parts.py) is charged
to the water's account.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from rope_twin.core.body import state as body_state
from rope_twin.core.body.loads import TURN2
from rope_twin.core.body.parts import power_of
from rope_twin.core.body.state import DAMPING, LENGTH, STIFFNESS, RigidBody
from rope_twin.core.guards import SLING2_MIN, SPEED2_MIN
from rope_twin.core.state import Floats

at = body_state
SOON = 1e-5  # interval of a finite difference in time [s]


class Pose(NamedTuple):
    """Pose of a body at one time; vectors in axes of the frame `map` unless stated otherwise."""

    centre: Floats  # of gravity, (3,) [m]
    velocity: Floats  # of the centre of gravity [m/s]
    quaternion: Floats  # x, y, z, w: turns body axes into the frame's, (4,)
    spin: Floats  # angular velocity in body axes [rad/s]
    turn: Floats  # the rotation matrix, (3, 3)

    def place(self, r: Any) -> Floats:
        """Return the position (..., 3) [m] of a point r, given from the centre in body axes."""
        return np.asarray(self.centre + np.asarray(r) @ self.turn.T)

    def speed(self, r: Any) -> Floats:
        """Return the velocity (..., 3) [m/s] of a point r of the body."""
        return np.asarray(self.velocity + np.cross(self.spin, r) @ self.turn.T)


def pose_of(body: RigidBody) -> Pose:
    """Return the pose of the body after the last accepted substep."""
    now = body.records[int(body.memory[0, 0])]
    Q = now[at.Q : at.Q + 4].copy()
    return Pose(_three(now, at.X), _three(now, at.V), Q, _three(now, at.SPIN), _matrix(Q))


def pulls_of(body: RigidBody, hook: Any, speed: Any) -> tuple[Floats, Floats, Floats]:
    """Return each sling's force on the body (legs, 3) [N], stored energy [J] and dissipation [W].

    hook, speed: position and velocity of the rope's end, (3,).
    """
    pose, legs = pose_of(body), body.legs
    r, k, c = legs[:, :3], legs[:, STIFFNESS], legs[:, DAMPING]
    d, e = hook - pose.place(r), speed - pose.speed(r)
    length = np.sqrt((d * d).sum(axis=1) + SLING2_MIN)
    n = d / length[:, None]
    stretch, rate = length - legs[:, LENGTH], (n * e).sum(axis=1)
    pull = np.maximum(k * stretch + c * rate, 0.0)
    taut = np.maximum(stretch, 0.0)
    pinned = legs[:, LENGTH] == 0.0
    force = np.where(pinned[:, None], k[:, None] * d + c[:, None] * e, pull[:, None] * n)
    stored = 0.5 * k * np.where(pinned, (d * d).sum(axis=1), taut * taut)
    lost = np.where(pinned, c * (e * e).sum(axis=1), (pull - k * taut) * rate)
    return force, stored, lost


def kinetic(body: Any, place: Any) -> Any:
    """Return the kinetic energy of body, added mass and hook [J]."""
    pose, now = pose_of(body), body.records[int(body.memory[0, 0])]
    own = 0.5 * body.m * pose.velocity @ pose.velocity + 0.5 * pose.spin @ body.inertia @ pose.spin
    water = _of_water(body, pose, now[at.WET_THEN], _three(now, at.ARM_THEN))
    return own + water + 0.5 * body.hook * (place.velocity**2).sum(axis=0)


def _of_water(body: Any, pose: Pose, wet: float, arm: Floats) -> float:
    """Return the kinetic energy of the added mass at this submergence ratio [J]."""
    u, spin = _three(body.records[int(body.memory[0, 0])], at.WATER), pose.spin
    c = (pose.velocity - u) @ pose.turn + np.cross(spin, body.watered + arm)
    w, root = c[2], np.sqrt(c[2] ** 2 + TURN2)
    p = body.added[:3] * c
    p[2] += body.rising * (root - np.sqrt(TURN2))
    water = 0.5 * (body.added[:3] * c) @ c + (pose.turn @ p) @ u + 0.5 * body.added[3:] @ spin**2
    water += 0.5 * body.rising * (w * root - TURN2 * np.arcsinh(w / np.sqrt(TURN2)))
    return float(wet * water)


def potential(body: Any, place: Any) -> Any:
    """Return the potential energy of body and hook in water, and of stretched slings [J]."""
    pose = pose_of(body)
    _, stored, _ = pulls_of(body, place.position[:, 0], place.velocity[:, 0])
    height = body.m * pose.centre[2] - body.displaced * pose.place(body.buoyed)[2]
    return body.g * height + stored.sum() + body.hook_weight * place.position[2]


def power(body: Any, place: Any) -> Any:
    """Return the power of drag, water acceleration and components, less sling dissipation [W].

    It includes what a growing submergence ratio adds to the kinetic energy of the added mass.
    """
    pose, now = pose_of(body), body.records[int(body.memory[0, 0])]
    u, grows, wet, arm = (
        _three(now, at.WATER), _three(now, at.GROWS), now[at.WET_THEN], _three(now, at.ARM_THEN)
    )  # fmt: skip
    h = body.watered + arm
    c = (pose.velocity - u) @ pose.turn + np.cross(pose.spin, h)
    blend = c[2] / np.sqrt(c[2] ** 2 + TURN2)
    k, M = wet * body.k[:3], wet * body.added[:3]
    k[2] += wet * body.rising_k * blend
    M[2] += wet * body.rising * blend
    drag = -np.sqrt(c @ c + SPEED2_MIN) * k * c
    swept = M * (grows @ pose.turn)
    total = (drag + swept) @ pose.turn.T @ pose.speed(h) - swept @ pose.turn.T @ u
    total += wet * body.displaced * grows @ pose.speed(body.buoyed + arm)
    total -= wet * (body.k[3:] * np.abs(pose.spin) ** 3).sum()
    more, on = body.stage[at.WET_GROWS], _three(body.stage, at.ARM_GROWS)
    then = _of_water(body, pose, wet + SOON * more, arm + SOON * on)
    total += (then - _of_water(body, pose, wet, arm)) / SOON
    _, _, lost = pulls_of(body, place.position[:, 0], place.velocity[:, 0])
    return total - lost.sum() + power_of(body, pose)


def _three(table: Floats, i: Any) -> Floats:
    return table[i : i + 3].copy()


def _matrix(Q: Floats) -> Floats:
    """Return the rotation matrix of a unit quaternion, (3, 3): I + 2·w·[q] + 2·[q]²."""
    skew = np.cross(np.eye(3), Q[:3])
    return np.asarray(np.eye(3) + 2.0 * Q[3] * skew + 2.0 * skew @ skew)
