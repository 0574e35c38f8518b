"""Motion of a rigid body: vectors, rotations as unit quaternions (x, y, z, w), and derivatives.

Body axes turn into world axes by R(Q). Over a step a rotation is Q·exp(θ) with a rotation vector θ
in body axes; the angular velocity is then Ω = J(θ)·dθ/dt with the right Jacobian of the exponential
map

    J(θ) = I - (1 - cos φ)/φ²·[θ] + (φ - sin φ)/φ³·[θ]²,  φ = |θ|

(Chirikjian 2012, Stochastic Models, Information Theory, and Lie Groups 2, eq 10.86; [θ]·a = θ × a).
The resulting quaternion has unit length except for round-off, which `normalised` removes.

**Derivatives** of the motion to the unknowns of a stage, the tangents of Newton's matrix. The
unknowns are the velocity v and the rate θ' of the rotation (core/body/solution.py). A change of one
of these six numbers changes the position by q·δv, the attitude by a small rotation ψ = q·J(θ)·δθ'
and the angular velocity by δΩ = J(θ)·δθ' + q·(DJ(θ)[δθ'])·θ', with J as above. All changes are
those seen from the world, in components along the body axes: for a point r of the body

    δx + ψ × r,   δv + δΩ × r + ψ × (Ω × r),   and for its arm from G: ψ × r,

so that a force f there, which itself changes by w, changes the moment by r × w + (ψ × r) × f. The
Jacobian is complete.
"""

from __future__ import annotations

from math import cos, sin, sqrt
from typing import Any

from rope_twin.core.body.state import D_PLACE, D_SPEED, D_SPIN, D_TURN
from rope_twin.core.jit.decorators import jit, jit_within
from rope_twin.core.state import ANGLE2_MIN


@jit_within
def vector(table: Any, i: int) -> Any:
    """Return three entries of a table from index i on."""
    return table[i], table[i + 1], table[i + 2]


@jit_within
def quaternion(table: Any, i: int) -> Any:
    """Return four entries of a table from index i on."""
    return table[i], table[i + 1], table[i + 2], table[i + 3]


@jit_within
def put(table: Any, i: int, a: Any) -> None:
    """Write a vector into a table from index i on."""
    table[i] = a[0]
    table[i + 1] = a[1]
    table[i + 2] = a[2]


@jit_within
def along(a: Any, s: float, b: Any) -> Any:
    """Return a + s·b."""
    return a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]


@jit_within
def dot(a: Any, b: Any) -> float:
    """Return the scalar product a·b."""
    return float(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])


@jit_within
def cross(a: Any, b: Any) -> Any:
    """Return the vector product a × b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@jit
def matrix_of(Q: Any) -> Any:
    """Return the rotation matrix R(Q) as three rows."""
    x, y, z, w = Q
    return (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)),
        (2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)),
        (2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)),
    )


@jit_within
def outward(R: Any, a: Any) -> Any:
    """Return R·a: a vector given in body axes, in world axes."""
    return dot(R[0], a), dot(R[1], a), dot(R[2], a)


@jit_within
def inward(R: Any, a: Any) -> Any:
    """Return Rᵀ·a: a vector given in world axes, in body axes."""
    return along(along(along((0.0, 0.0, 0.0), a[0], R[0]), a[1], R[1]), a[2], R[2])


@jit
def turned(Q: Any, theta: Any) -> Any:
    """Return Q·exp(θ), normalised."""
    x, y, z, w = Q
    angle = sqrt(dot(theta, theta) + ANGLE2_MIN)
    size, c = sin(0.5 * angle) / angle, cos(0.5 * angle)
    a, b, d = size * theta[0], size * theta[1], size * theta[2]
    return normalised(
        (
            w * a + x * c + y * d - z * b,
            w * b - x * d + y * c + z * a,
            w * d + x * b - y * a + z * c,
            w * c - x * a - y * b - z * d,
        )
    )


@jit
def normalised(Q: Any) -> Any:
    """Return Q divided by its norm."""
    s = 1.0 / sqrt(Q[0] * Q[0] + Q[1] * Q[1] + Q[2] * Q[2] + Q[3] * Q[3])
    return s * Q[0], s * Q[1], s * Q[2], s * Q[3]


@jit
def angular_velocity(theta: Any, rate: Any) -> Any:
    """Return Ω = J(θ)·dθ/dt, in body axes."""
    angle = sqrt(dot(theta, theta) + ANGLE2_MIN)
    half = sin(0.5 * angle) / angle
    once = cross(theta, rate)
    out = along(rate, -2.0 * half * half, once)
    return along(out, (angle - sin(angle)) / (angle * angle * angle), cross(theta, once))


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
