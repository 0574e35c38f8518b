"""Contact of points of a rigid body: unilateral normal force and friction; the deck.

The law is that of effects/seabed.py: N = k·d·(1 - χ·v_n), at least 0 (Hunt and Crossley 1975), and
friction -μ·N·v_t/√(|v_t|² + v_0²) (Oden and Martins 1985), here with all of its derivatives. The
deck is a level plane that heaves.
"""

from __future__ import annotations

from math import cos, sin, sqrt
from typing import Any

import numpy as np

from rope_twin.core.body import state as at
from rope_twin.core.body.change import (
    NONE,
    add_change,
    change_of,
    moment_change,
)
from rope_twin.core.body.parts import part
from rope_twin.core.body.rotation import along, cross, dot, inward, outward, vector
from rope_twin.core.body.state import Deck, RigidBody
from rope_twin.core.jit.decorators import jit
from rope_twin.core.state import ELEMENTS, POSITION, VELOCITY, Floats

CREEP = 0.01  # v_0: friction is within 0.5 % of μ·N from ten times this on [m/s]


@jit
def push_of(soil: Any, d: float, n: Any, v: Any) -> Any:
    """Return the contact force for depth d > 0, normal n and velocity v, and (N, gain, sliding).

    soil: k, χ, μ.
    """
    k, chi, mu = soil
    away = dot(v, n)
    gain = max(1.0 - chi * away, 0.0)
    N, slide = k * d * gain, along(v, -away, n)
    rub = mu * N / sqrt(dot(slide, slide) + CREEP * CREEP)
    return along(along(NONE, N, n), -rub, slide), (N, gain, slide)


@jit
def push_change(soil: Any, d: float, n: Any, found: Any, moved: Any) -> Any:
    """Return the change of the contact force for a change of position and velocity."""
    k, chi, mu = soil
    N, gain, slide = found
    place, speed = moved
    if not gain > 0.0:
        return NONE
    off = dot(speed, n)
    dN = -k * (gain * dot(place, n) + d * chi * off)
    across = along(speed, -off, n)
    root = sqrt(dot(slide, slide) + CREEP * CREEP)
    out = along(along(NONE, dN, n), -mu * dN / root, slide)
    out = along(out, -mu * N / root, across)
    return along(out, mu * N * dot(slide, across) / (root * root * root), slide)


@jit
def add_push(body: Any, q: float, pose: Any, r: Any, touch: Any) -> Any:
    """Return force and moment in body axes at a point r in contact, and N; add their derivatives.

    touch: soil, depth > 0, normal, velocity of the surface touched.
    """
    _, R, v, spin = pose
    soil, d, n, under = touch
    turning = cross(spin, r)
    speed = along(along(v, 1.0, outward(R, turning)), -1.0, under)
    push, found = push_of(soil, d, n, speed)
    f = inward(R, push)
    for k in range(6):
        place, rate, arm = change_of(body, k, r, turning)
        w = push_change(soil, d, n, found, (outward(R, place), outward(R, rate)))
        w = inward(R, w)
        add_change(body, k, -q, w, moment_change(r, w, arm, f))
    return f, cross(r, f), found[0]


@part("act", Deck)
def act(deck: Any, body: Any, q: float, pose: Any) -> Any:
    """Return the contact force and moment of all corners on the deck."""
    x, R, _, _ = pose
    up, under = (0.0, 0.0, 1.0), (0.0, 0.0, body.stage[at.DECK_SPEED])
    f, t, size = NONE, NONE, 0.0
    for j in range(body.corners.shape[0]):
        r = vector(body.corners[j], 0)
        d = body.stage[at.DECK_Z] - x[2] - dot(R[2], r)
        if d > 0.0:
            touch = (deck.k, deck.chi, deck.mu), d, up, under
            more, twist, N = add_push(body, q, pose, r, touch)
            f, t, size = along(f, 1.0, more), along(t, 1.0, twist), size + N
    return f, t, size


@part("foresee", Deck)
def foresee(deck: Any, body: Any, rope: Any, stage: Any, pose: Any) -> None:
    """Set height and vertical velocity of the deck at the stage's time."""
    s, n, time = body.stage, rope.state.counts[ELEMENTS], stage.time
    share, rate = 1.0, 0.0
    if time < deck.ramp:
        u = max(time, 0.0) / deck.ramp
        share = u * u * u * (10.0 + u * (6.0 * u - 15.0))
        rate = 30.0 * u * u * (u - 1.0) * (u - 1.0) / deck.ramp
    angle = deck.omega * time + deck.phase
    z, w = deck.amplitude * sin(angle), deck.amplitude * deck.omega * cos(angle)
    ship = rope.work[POSITION + 2, n] - s[at.SHIP_Z]
    s[at.DECK_Z] = deck.height + deck.with_ship * ship + share * z
    s[at.DECK_SPEED] = deck.with_ship * rope.work[VELOCITY + 2, n] + share * w + rate * z


@part("floor", Deck)
def floor(deck: Any, body: Any, place: Any) -> float:
    """Return the height of the deck."""
    return float(body.stage[at.DECK_Z])


def deck_pushes(deck: Deck, body: RigidBody, pose: Any) -> Floats:
    """Return the deck's force on each corner, (corners, 3) [N]; pose: of core/body/energy.py."""
    v = pose.speed(body.corners) - [0.0, 0.0, body.stage[at.DECK_SPEED]]
    sunk = np.maximum(body.stage[at.DECK_Z] - pose.place(body.corners)[:, 2], 0.0)
    push = deck.k * sunk * np.maximum(1.0 - deck.chi * v[:, 2], 0.0)
    rub = deck.mu * push / np.sqrt((v[:, :2] ** 2).sum(axis=1) + CREEP**2)
    return np.column_stack([-rub * v[:, 0], -rub * v[:, 1], push])


@part("power", Deck)
def power(deck: Deck, body: RigidBody, pose: Any) -> float:
    """Return the power of contact forces and friction of the deck [W]."""
    return float((deck_pushes(deck, body, pose) * pose.speed(body.corners)).sum())
