"""Derivatives of a rigid body's motion to the unknowns of a stage: the tangents of Newton's matrix.

The unknowns are the velocity v and the rate θ' of the rotation (core/body/balance.py). A change of
one of these six numbers changes the position by q·δv, the attitude by a small rotation ψ =
q·J(θ)·δθ' and the angular velocity by δΩ = J(θ)·δθ' + q·(DJ(θ)[δθ'])·θ', with J of
core/body/rotation.py. All changes are those seen from the world, in components along the body axes:
for a point r of the body

    δx + ψ × r,   δv + δΩ × r + ψ × (Ω × r),   and for its arm from G: ψ × r,

so that a force f there, which itself changes by w, changes the moment by r × w + (ψ × r) × f. The
Jacobian is complete.
"""

from __future__ import annotations

from typing import Any

from rope_twin.core.body.rotation import along, angular_velocity, cross, dot, put, vector
from rope_twin.core.body.state import D_PLACE, D_SPEED, D_SPIN, D_TURN
from rope_twin.core.jit.decorators import jit, jit_within

NONE = (0.0, 0.0, 0.0)


@jit_within
def unit(k: int, size: float) -> Any:
    """Return a vector of length `size` along axis k; zero for any other k."""
    return (
        size if k == 0 else 0.0, size if k == 1 else 0.0, size if k == 2 else 0.0
    )  # fmt: skip


@jit
def turn_slope(theta: Any, a: Any, b: Any) -> Any:
    """Return (DJ(θ)[a])·b.

    J(θ)·b = b - α·θ × b + β·θ × (θ × b); α = (1 - cos φ)/φ², β = (φ - sin φ)/φ³ and their slopes
    over φ by their series, to 1e-8 up to a rotation of 0.3 rad in a substep.
    """
    f = dot(theta, theta)
    alpha = 1.0 / 2.0 - f * (1.0 / 24.0 - f * (1.0 / 720.0 - f / 40320.0))
    beta = 1.0 / 6.0 - f * (1.0 / 120.0 - f * (1.0 / 5040.0 - f / 362880.0))
    alpha_slope = -1.0 / 12.0 + f * (1.0 / 180.0 - f * (1.0 / 6720.0 - f / 453600.0))
    beta_slope = -1.0 / 60.0 + f * (1.0 / 1260.0 - f * (1.0 / 60480.0 - f / 4989600.0))
    once = cross(theta, b)
    out = along(NONE, -alpha, cross(a, b))
    out = along(out, beta, along(cross(a, once), 1.0, cross(theta, cross(a, b))))
    toward = dot(theta, a)
    return along(along(out, -toward * alpha_slope, once), toward * beta_slope, cross(theta, once))


@jit
def set_changes(body: Any, q: float, theta: Any, rate: Any) -> None:
    """Set the derivatives of the motion to each of the six unknowns."""
    for k in range(3):
        row, axis = body.changes[k], unit(k, 1.0)
        put(row, D_PLACE, along(NONE, q, axis))
        put(row, D_SPEED, axis)
        put(row, D_TURN, NONE)
        put(row, D_SPIN, NONE)
        row, turn = body.changes[3 + k], angular_velocity(theta, axis)
        put(row, D_PLACE, NONE)
        put(row, D_SPEED, NONE)
        put(row, D_TURN, along(NONE, q, turn))
        put(row, D_SPIN, along(turn, q, turn_slope(theta, axis, rate)))


@jit_within
def change_of(body: Any, k: int, r: Any, turning: Any) -> Any:
    """Return changes of position, velocity and arm of a point r; turning: Ω × r."""
    row = body.changes[k]
    psi = vector(row, D_TURN)
    arm = cross(psi, r)
    speed = along(vector(row, D_SPEED), 1.0, cross(vector(row, D_SPIN), r))
    return along(vector(row, D_PLACE), 1.0, arm), along(speed, 1.0, cross(psi, turning)), arm


@jit_within
def add_moment_change(body: Any, k: int, s: float, turn: Any) -> None:
    """Add s times a change of moment to column k of the matrix."""
    for i in range(3):
        body.matrix[3 + i, k] += s * turn[i]


@jit_within
def add_change(body: Any, k: int, s: float, w: Any, turn: Any) -> None:
    """Add s times changes of force and moment to column k of the matrix."""
    for i in range(3):
        body.matrix[i, k] += s * w[i]
        body.matrix[3 + i, k] += s * turn[i]


@jit_within
def moment_change(r: Any, w: Any, arm: Any, f: Any) -> Any:
    """Return the change of moment of a force f at r that changes by w, its arm by `arm`."""
    return along(cross(r, w), 1.0, cross(arm, f))


@jit
def add_steady(body: Any, q: float, r: Any, f: Any) -> None:
    """Add the derivatives of a force at a point r of the body that is constant in world axes."""
    for k in range(3, 6):
        arm = cross(vector(body.changes[k], D_TURN), r)
        add_moment_change(body, k, -q, cross(arm, f))
