"""Vectors of three numbers, rotations as unit quaternions (x, y, z, w), and incremental rotations.

Body axes turn into world axes by R(Q). Over a step a rotation is Q·exp(θ) with a rotation vector θ
in body axes; the angular velocity is then Ω = J(θ)·dθ/dt with the right Jacobian of the exponential
map

    J(θ) = I - (1 - cos φ)/φ²·[θ] + (φ - sin φ)/φ³·[θ]²,  φ = |θ|

(Chirikjian 2012, Stochastic Models, Information Theory, and Lie Groups 2, eq 10.86; [θ]·a = θ × a).
The resulting quaternion has unit length except for round-off, which `normalised` removes.
"""

from __future__ import annotations

from math import cos, sin, sqrt
from typing import Any

from rope_twin.core.guards import ANGLE2_MIN
from rope_twin.core.jit.decorators import jit, jit_within


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
