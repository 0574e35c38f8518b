"""Vectors of three numbers, rotations as unit quaternions (x, y, z, w), and small turns.

Body axes turn into the world's by R(Q). Over a step a turn is Q·exp(θ) with a rotation vector θ in
body axes; the angular velocity is then Ω = J(θ)·dθ/dt with the right Jacobian of the exponential

    J(θ) = I - (1 - cos φ)/φ²·[θ] + (φ - sin φ)/φ³·[θ]²,  φ = |θ|

(Chirikjian 2012, Stochastic Models, Information Theory, and Lie Groups 2, eq 10.86; [θ]·a = θ × a).
A quaternion so made is of length 1 but for round-off, which `normalised` takes away.
"""

from __future__ import annotations

from math import cos, sin, sqrt
from typing import Any

from rope_twin.core.guards import UNTURNED2
from rope_twin.core.jit.decorators import jit, jit_within


@jit_within
def vector(table: Any, i: int) -> Any:
    """Three numbers of a table from i on."""
    return table[i], table[i + 1], table[i + 2]


@jit_within
def quaternion(table: Any, i: int) -> Any:
    """Four numbers of a table from i on."""
    return table[i], table[i + 1], table[i + 2], table[i + 3]


@jit_within
def put(table: Any, i: int, a: Any) -> None:
    """A vector into a table from i on."""
    table[i] = a[0]
    table[i + 1] = a[1]
    table[i + 2] = a[2]


@jit_within
def along(a: Any, s: float, b: Any) -> Any:
    """a + s·b."""
    return a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]


@jit_within
def dot(a: Any, b: Any) -> float:
    """a·b."""
    return float(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])


@jit_within
def cross(a: Any, b: Any) -> Any:
    """a × b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@jit
def matrix_of(Q: Any) -> Any:
    """R(Q), rows."""
    x, y, z, w = Q
    return (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)),
        (2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)),
        (2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)),
    )


@jit_within
def outward(R: Any, a: Any) -> Any:
    """R·a: a vector in body axes as the world sees it."""
    return dot(R[0], a), dot(R[1], a), dot(R[2], a)


@jit_within
def inward(R: Any, a: Any) -> Any:
    """Rᵀ·a: a vector of the world in body axes."""
    return along(along(along((0.0, 0.0, 0.0), a[0], R[0]), a[1], R[1]), a[2], R[2])


@jit
def turned(Q: Any, theta: Any) -> Any:
    """Q·exp(θ), of length 1."""
    x, y, z, w = Q
    angle = sqrt(dot(theta, theta) + UNTURNED2)
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
    """Q over its length."""
    s = 1.0 / sqrt(Q[0] * Q[0] + Q[1] * Q[1] + Q[2] * Q[2] + Q[3] * Q[3])
    return s * Q[0], s * Q[1], s * Q[2], s * Q[3]


@jit
def angular_velocity(theta: Any, rate: Any) -> Any:
    """Ω = J(θ)·dθ/dt, in body axes."""
    angle = sqrt(dot(theta, theta) + UNTURNED2)
    half = sin(0.5 * angle) / angle
    once = cross(theta, rate)
    out = along(rate, -2.0 * half * half, once)
    return along(out, (angle - sin(angle)) / (angle * angle * angle), cross(theta, once))
