"""Small undamped motion of a rigid body on its slings about rest: stiffness and mass.

The unknowns are the displacements of hook and centre of gravity G and the rotation ψ about G, in
world axes. A sling with the force f = T·n on the body at the arm a from G stretches by n·δ with
δ = δ_hook - δ_G + a × ψ; its force changes by (k·n·nᵀ + T/l·(I - n·nᵀ))·δ, and its moment by that
and by (ψ × a) × f = a·(ψ·f) - ψ·(a·f); so does the moment of buoyancy. The mass is that of core/
body/loads: body, and added mass at the reference point h, M_A·c with c = v + Ω × h. The change of
drag with the attitude is neglected, as for ropes.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rope_twin.core.body import state as at
from rope_twin.core.body.components import bed_pushes, deck_pushes
from rope_twin.core.body.loads import part_of
from rope_twin.core.body.state import (
    LENGTH,
    STIFFNESS,
    Deck,
    GridBed,
    PlaneBed,
    RigidBody,
)
from rope_twin.core.body.step import Pose, pose_of
from rope_twin.core.state import Floats, Rope
from rope_twin.errors import SceneError, phrase
from rope_twin.scene.schema import Scene

HOOK, CENTRE, TURN = slice(0, 3), slice(3, 6), slice(6, 9)  # of the unknowns


class HungBody(NamedTuple):
    """A body at rest; the first three unknowns are the hook's."""

    stiffness: Floats  # (9, 9) [N/m], [N], [N·m]
    mass: Floats  # (9, 9) [kg], [kg·m], [kg·m²]
    reach: float  # largest distance of its points from G [m]


def hung_body(scene: Scene, body: RigidBody, hook: Floats) -> HungBody:
    """Return the body at rest below a hook at this position [m], (3,).

    Raises:
        SceneError: it is not fully submerged where the scene has a surface, or stands on something.
    """
    pose = pose_of(body)
    what = _held_otherwise(body, pose)
    if what:
        right = "lower or lift it until it hangs clear"
        raise SceneError(phrase(f"{scene.path}: effects.rigid_body", what, right))
    K = np.zeros((9, 9))
    for leg in body.legs:
        arm = pose.turn @ leg[:3]
        force, stiffness = _sling(leg, hook - pose.centre - arm)
        follow = np.hstack([np.eye(3), -np.eye(3), _cross(arm)])
        K += follow.T @ stiffness @ follow
        K[TURN, TURN] += _turned(arm, force)
    lift = np.array([0.0, 0.0, body.displaced * body.g])
    K[TURN, TURN] += _turned(pose.turn @ body.buoyed, lift)
    return HungBody(0.5 * (K + K.T), _mass(body, pose), float(body.reach))


class HungMotion(NamedTuple):
    """Motion of a rigid body in a mode; energies are twice the kinetic energy at ω = 1."""

    centre: Floats  # of gravity, (3,)
    mass: Floats  # of its translation, (3, 3) [kg]
    energy: float
    largest: float  # motion of a point of it

    @classmethod
    def of(cls, body: HungBody | None, vector: Floats) -> HungMotion:
        """Return the motion of the body, whose unknowns are the last six; at rest without one."""
        if body is None:
            return cls(np.zeros(3), np.zeros((3, 3)), 0.0, 0.0)
        own = vector[-6:]
        largest = np.linalg.norm(own[:3]) + body.reach * np.linalg.norm(own[3:])
        return cls(
            centre=own[:3],
            mass=body.mass[CENTRE, CENTRE],
            energy=float(own @ body.mass[3:, 3:] @ own),
            largest=float(largest),
        )

    def along(self, direction: Floats) -> float:
        """Return the energy of the translation along a direction."""
        moved = (self.centre @ direction) * direction
        return float(moved @ self.mass @ moved)

    @property
    def turning(self) -> float:
        """Return the energy of the rotation, with what it shares with the translation."""
        return max(self.energy - float(self.centre @ self.mass @ self.centre), 0.0)


def without_body(rope: Rope) -> Rope:
    """Return a rope that carries no body."""
    effects = (own._replace(here=0.0) if isinstance(own, RigidBody) else own
               for own in rope.effects)  # fmt: skip
    return rope._replace(effects=tuple(effects))


def _held_otherwise(body: RigidBody, pose: Pose) -> str:
    """Return what else but slings and water carries the body; or ""."""
    if body.stage[at.WET] < 1.0:
        return "the body is not fully submerged, and a floating one has other modes"
    deck, bed = part_of(body, Deck), part_of(body, PlaneBed, GridBed)
    if deck is not None and deck_pushes(deck, body, pose).any():
        return "the body stands on the deck, and has no modes of a hanging one"
    if bed is not None and bed_pushes(bed, body, pose)[1].any():
        return "the body stands on the seabed, and has no modes of a hanging one"
    return ""


def _sling(leg: Floats, d: Floats) -> tuple[Floats, Floats]:
    """Return a sling's force on the body [N] and its stiffness [N/m]; zero if it is slack.

    d: from its point on the body to the hook.
    """
    k, length = leg[STIFFNESS], float(np.linalg.norm(d))
    if leg[LENGTH] == 0.0:  # a pin
        return k * d, k * np.eye(3)
    T, n = k * (length - leg[LENGTH]), d / length
    if T <= 0.0:
        return np.zeros(3), np.zeros((3, 3))
    along = np.outer(n, n)
    return T * n, k * along + T / length * (np.eye(3) - along)


def _turned(arm: Floats, force: Floats) -> Floats:
    """Return minus the derivative of a constant force's moment to the rotation."""
    return np.asarray((arm @ force) * np.eye(3) - np.outer(arm, force))


def _mass(body: RigidBody, pose: Pose) -> Floats:
    """Return the mass of hook and body with added mass, (9, 9)."""
    added, h = np.diag(body.added[:3]), _cross(body.watered)
    own = np.zeros((6, 6))
    own[:3, :3] = body.m * np.eye(3) + added
    own[:3, 3:] = -added @ h
    own[3:, :3] = own[:3, 3:].T
    own[3:, 3:] = body.inertia + np.diag(body.added[3:]) + h.T @ added @ h
    axes = np.kron(np.eye(2), pose.turn)
    whole = np.zeros((9, 9))
    whole[HOOK, HOOK] = body.hook * np.eye(3)
    whole[3:, 3:] = axes @ own @ axes.T
    return whole


def _cross(a: Floats) -> Floats:
    """Return the matrix of a × ."""
    x, y, z = a
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
