"""State and motion of a rigid body: data layout, vectors, rotations, and derivatives.

Vectors of the body are in its own axes and from its centre of gravity G. Rotations are unit
quaternions (x, y, z, w). Body axes turn into world axes by R(Q). Over a step a rotation is Q·exp(θ)
with a rotation vector θ in body axes; the angular velocity is then Ω = J(θ)·dθ/dt with the right
Jacobian of the exponential map

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
from typing import Any, NamedTuple

import numpy as np

from rope_twin.core.bed import Grid, Plane
from rope_twin.core.jit.decorators import jit_exact, jit_exact_within
from rope_twin.core.jit.functions import by_width, fused
from rope_twin.core.jit.wide import choose
from rope_twin.core.state import ANGLE2_MIN, Floats


# numpy integers: numba compiles a kernel again for each Python literal that it is called with.
def _places(first: int, last: int, width: int = 3) -> Any:
    return (np.int64(place) for place in range(first, last, width))


# A record: the body at one time. Rates of momentum and angular momentum about G, position of G,
# velocity, angular velocity, velocity and acceleration of the water there, orientation; centre of
# the submerged part relative to the centre of the whole, and submergence ratio.
FORCE, MOMENT, X, V, SPIN, WATER, GROWS, Q = _places(0, 24)
ARM_THEN = np.int64(25)
WET_THEN = 28
RECORD = 29
RECORDS = 4  # current, end of the stage, start of the step, and one to write into

# The stage. Explicit parts of position, rotation, momentum, angular momentum; the water: current
# velocity, velocity held in the momentum of the added mass, acceleration. Then the unknowns and the
# quantities derived from them; start of the substep and end of its first stage; velocity and
# rotation rate before a correction.
(X_HAT, TURN_HAT, P_HAT, L_HAT, FLOW_NOW, FROZEN, FLOW_ACCELERATION,
 SPEED, TURN_RATE, PLACE, TURN, SPIN_NOW, PULL, TWIST, P_NOW, L_NOW, HOOK_FORCE,
 P_START, L_START, X_MIDDLE, TURN_MIDDLE, P_MIDDLE, L_MIDDLE, SPEED_MIDDLE, RATE_MIDDLE,
 SPEED_BEFORE, RATE_BEFORE) = _places(0, 81)  # fmt: skip
ATTITUDE, Q_START = _places(81, 89, 4)  # quaternions
DECK_Z, DECK_SPEED = 89, 90  # height [m], velocity [m/s]
FRESH = 92  # 1: static equilibrium has yet to be solved
SHIP_Z = 93  # mean height of the hang-off [m]
FORCES = 94  # sum of the magnitudes of all forces on the body [N]
SHARE = 95  # factor on the slings' stiffness: less than 1 during the static solution
HOOK = np.int64(96)  # position of the rope's end during the static solution, 3 numbers [m]
# Submergence: centre of the submerged part relative to that of the whole, and ratio; the same as
# held in the momenta over a substep; rates; water surface above the body's middle, its x, y slopes.
SUBMERGED_ARM, ARM_HELD, ARM_GROWS = _places(99, 108)
SUBMERGED, SUBMERGED_HELD, WET_GROWS, SURFACE_Z, SURFACE_X, SURFACE_Y = 108, 109, 110, 111, 112, 113
STAGE = 114

# Cached linearisation last given to the rope's equations: force on the hook, and minus its
# derivative, as xx, xy, xz, yy, yz, zz. Motion of the hook of the last solution; allowed difference
# between predicted and actual force [N].
TANGENT_PULL, TANGENT_SLOPE, TANGENT_ELSE, SOLVED_PLACE, SOLVED_SPEED = _places(0, 15)
ALLOWED = 15
TANGENT = 16

# Columns of the matrix: A; derivatives to the hook's acceleration, without q; residual.
HELD, MISS, COLUMNS = 6, 9, 10
# A change of the body's motion (core/body/state.py): δx, δv, ψ, δΩ.
D_POSITION, D_SPEED, D_TURN, D_SPIN = _places(0, 12)
CHANGES = 12

# A leg: attachment point on the body, length (0: a pin), stiffness, damping
LENGTH, STIFFNESS, DAMPING, LEG = 3, 4, 5, 6

FRICTION_SPEED = 0.01  # v_0: friction is within 0.5 % of μ·N from ten times this on [m/s]


class Immersed(NamedTuple):
    """Component: a fully submerged body."""

    share: float  # submergence ratio: 1


class Afloat(NamedTuple):
    """Component: a body at the water surface; see core/body/components.py."""

    columns: Floats  # middle (3), volume fraction, x and y from the middle, (n, 6)
    height: float  # of the columns [m]
    side_x: float  # sides of each [m]
    side_y: float
    span_x: float  # distance from the middle where the surface is sampled, along x, y [m]
    span_y: float
    buoyancy_offset: Floats  # centre of buoyancy relative to the middle, (3,) [m]
    slam: float  # ½·ρ·C_s·A of the whole bottom [kg/m]


class Deck(NamedTuple):
    """Component: a deck on which the body can stand, a level plane."""

    height: float  # mean height [m]
    with_ship: float  # 1: it heaves with the hang-off
    heaves: Floats  # harmonics of an independent heave: amplitude [m], ω [rad/s], phase [rad],
    # build-up time [s], (harmonics, 4)
    k: float  # stiffness at each corner [N/m]
    chi: float  # N = k·d·(1 - χ·v) [s/m]
    mu: float  # friction


class PlaneBed(NamedTuple):
    """Component: a plane seabed below the body."""

    shape: Plane
    k: float  # stiffness at each corner [N/m]
    chi: float  # N = k·d·(1 - χ·v) [s/m]
    mu: float  # friction


class GridBed(NamedTuple):
    """Component: a gridded seabed below the body."""

    shape: Grid
    k: float  # k, χ, μ as in PlaneBed
    chi: float
    mu: float


class RigidBody(NamedTuple):
    """A payload with six degrees of freedom that hangs on slings, or by a pin, from the hook."""

    memory: Floats  # index of the valid record; see core/loads/memory.py
    records: Floats  # (RECORDS, RECORD)
    stage: Floats  # scratch, (STAGE,)
    matrix: Floats  # scratch, (6, COLUMNS)
    hold: Floats  # scratch: derivatives of the slings' force to the unknowns and to the
    # acceleration of the hook, (3, 9)
    changes: Floats  # scratch, (6, CHANGES)
    tangent: Floats  # scratch, (TANGENT,)
    W: float  # weight in water, including the hook [N]
    hook: float  # mass of the hook [kg]
    hook_weight: float  # weight of the hook in water [N]
    m: float  # of the body [kg]
    g: float  # [m/s²]
    displaced: float  # ρ·V [kg]
    inertia: Floats  # moments of inertia about G, (3, 3) [kg·m²]
    added: Floats  # added mass along, added inertia about the axes at the reference point of the
    # water's forces, (6,); along z the mean of ascent and descent
    rising: float  # half the difference of the added mass along z, ascent less descent [kg]
    k: Floats  # ½·ρ·CdA along, ½·ρ·C about them, (6,) [kg/m], [kg·m²]
    rising_k: float  # half the difference of k along z, ascent less descent
    buoyed: Floats  # centre of buoyancy, (3,) [m]
    watered: Floats  # reference point of the water's forces, (3,)
    middle: Floats  # the middle of the body's outline, (3,)
    size: Floats  # dimensions of the outline, (3,) [m]
    legs: Floats  # (legs, LEG)
    corners: Floats  # contact points with a deck or the seabed, (corners, 3)
    carrying: float  # number of contact points that carry the body when it stands
    parts: tuple[Any, ...]  # further loads (core/body/loads.py)
    heading: float  # of its x axis at the start, from east to north [rad]
    reach: float  # largest distance from G to any of these points [m]
    stiffness: float  # sum of the stiffness of legs and deck [N/m]
    here: float = 1.0  # 0: another rope of the system carries it, or it hangs below a cut


# Arrays of a body that no step writes.
FIXED = "inertia", "added", "k", "buoyed", "watered", "middle", "size", "legs", "corners"


@jit_exact_within
def vector(table: Any, i: int) -> Any:
    """Return three entries of a table from index i on."""
    return table[i], table[i + 1], table[i + 2]


@jit_exact_within
def quaternion(table: Any, i: int) -> Any:
    """Return four entries of a table from index i on."""
    return table[i], table[i + 1], table[i + 2], table[i + 3]


@jit_exact_within
def store(table: Any, i: int, a: Any) -> None:
    """Write a vector into a table from index i on."""
    table[i] = a[0]
    table[i + 1] = a[1]
    table[i + 2] = a[2]


@jit_exact_within
def axpy(a: Any, s: float, b: Any) -> Any:
    """Return a + s·b."""
    return fused(s, b[0], a[0]), fused(s, b[1], a[1]), fused(s, b[2], a[2])


@jit_exact_within
def dot(a: Any, b: Any) -> Any:
    """Return the scalar product a·b."""
    return fused(a[2], b[2], fused(a[1], b[1], a[0] * b[0]))


@jit_exact_within
def select(which: Any, a: Any, b: Any) -> Any:
    """Return vector a where a condition holds, else b."""
    return choose(which, a[0], b[0]), choose(which, a[1], b[1]), choose(which, a[2], b[2])


@jit_exact_within
def _clear_array(table: Any) -> None:
    table[:, :] = 0.0


@jit_exact_within
def _clear_lanes(table: Any) -> None:
    for i in range(table.shape[0]):
        for k in range(table.shape[1]):
            table[i, k] = 0.0


clear = by_width(_clear_array, _clear_lanes)  # sets a matrix to zero


@jit_exact_within
def cross(a: Any, b: Any) -> Any:
    """Return the vector product a × b."""
    return (
        fused(a[1], b[2], -(a[2] * b[1])),
        fused(a[2], b[0], -(a[0] * b[2])),
        fused(a[0], b[1], -(a[1] * b[0])),
    )


@jit_exact
def matrix_of(Q: Any) -> Any:
    """Return the rotation matrix R(Q) as three rows."""
    x, y, z, w = Q
    xx, yy, xw, yw, zw = x * x, y * y, x * w, y * w, z * w
    return (
        (1.0 - 2.0 * fused(z, z, yy), 2.0 * fused(x, y, -zw), 2.0 * fused(x, z, yw)),
        (2.0 * fused(x, y, zw), 1.0 - 2.0 * fused(z, z, xx), 2.0 * fused(y, z, -xw)),
        (2.0 * fused(x, z, -yw), 2.0 * fused(y, z, xw), 1.0 - 2.0 * fused(y, y, xx)),
    )


@jit_exact_within
def to_world(R: Any, a: Any) -> Any:
    """Return R·a: a vector given in body axes, in world axes."""
    return dot(R[0], a), dot(R[1], a), dot(R[2], a)


@jit_exact_within
def to_body(R: Any, a: Any) -> Any:
    """Return Rᵀ·a: a vector given in world axes, in body axes."""
    return axpy(axpy(axpy((0.0, 0.0, 0.0), a[0], R[0]), a[1], R[1]), a[2], R[2])


@jit_exact
def turned(Q: Any, theta: Any) -> Any:
    """Return Q·exp(θ), normalised."""
    x, y, z, w = Q
    angle = sqrt(dot(theta, theta) + ANGLE2_MIN)
    size, c = sin(0.5 * angle) / angle, cos(0.5 * angle)
    a, b, d = size * theta[0], size * theta[1], size * theta[2]
    return normalised(
        (
            fused(w, a, fused(x, c, fused(y, d, -(z * b)))),
            fused(w, b, fused(y, c, fused(z, a, -(x * d)))),
            fused(w, d, fused(x, b, fused(z, c, -(y * a)))),
            fused(w, c, -fused(x, a, fused(y, b, z * d))),
        )
    )


@jit_exact
def normalised(Q: Any) -> Any:
    """Return Q divided by its norm."""
    s = 1.0 / sqrt(fused(Q[3], Q[3], dot(Q, Q)))  # the scalar product is that of three
    return s * Q[0], s * Q[1], s * Q[2], s * Q[3]


@jit_exact
def angular_velocity(theta: Any, rate: Any) -> Any:
    """Return Ω = J(θ)·dθ/dt, in body axes."""
    angle = sqrt(dot(theta, theta) + ANGLE2_MIN)
    half = sin(0.5 * angle) / angle
    once = cross(theta, rate)
    out = axpy(rate, -2.0 * half * half, once)
    return axpy(out, (angle - sin(angle)) / (angle * angle * angle), cross(theta, once))


ZERO_VECTOR = (0.0, 0.0, 0.0)


@jit_exact_within
def unit(k: int, size: float) -> Any:
    """Return a vector of length `size` along axis k; zero for any other k."""
    return (
        size if k == 0 else 0.0, size if k == 1 else 0.0, size if k == 2 else 0.0
    )  # fmt: skip


@jit_exact_within
def _series(f: Any, a: float, b: float, c: float, d: float) -> Any:
    """Return a + b·f + c·f² + d·f³."""
    return fused(f, fused(f, fused(f, d, c), b), a)


@jit_exact
def turn_slope(theta: Any, a: Any, b: Any) -> Any:
    """Return (DJ(θ)[a])·b.

    J(θ)·b = b - α·θ × b + β·θ × (θ × b); α = (1 - cos φ)/φ², β = (φ - sin φ)/φ³ and their slopes
    over φ by their series, to 1e-8 up to a rotation of 0.3 rad in a substep.
    """
    f = dot(theta, theta)
    alpha = _series(f, 1.0 / 2.0, -1.0 / 24.0, 1.0 / 720.0, -1.0 / 40320.0)
    beta = _series(f, 1.0 / 6.0, -1.0 / 120.0, 1.0 / 5040.0, -1.0 / 362880.0)
    alpha_slope = _series(f, -1.0 / 12.0, 1.0 / 180.0, -1.0 / 6720.0, 1.0 / 453600.0)
    beta_slope = _series(f, -1.0 / 60.0, 1.0 / 1260.0, -1.0 / 60480.0, 1.0 / 4989600.0)
    once = cross(theta, b)
    out = axpy(ZERO_VECTOR, -alpha, cross(a, b))
    out = axpy(out, beta, axpy(cross(a, once), 1.0, cross(theta, cross(a, b))))
    toward = dot(theta, a)
    return axpy(axpy(out, -toward * alpha_slope, once), toward * beta_slope, cross(theta, once))


@jit_exact
def set_pose_derivatives(body: Any, q: float, theta: Any, rate: Any) -> None:
    """Set the derivatives of the motion to each of the six unknowns."""
    for k in range(3):
        row, axis = body.changes[k], unit(k, 1.0)
        store(row, D_POSITION, axpy(ZERO_VECTOR, q, axis))
        store(row, D_SPEED, axis)
        store(row, D_TURN, ZERO_VECTOR)
        store(row, D_SPIN, ZERO_VECTOR)
        row, turn = body.changes[3 + k], angular_velocity(theta, axis)
        store(row, D_POSITION, ZERO_VECTOR)
        store(row, D_SPEED, ZERO_VECTOR)
        store(row, D_TURN, axpy(ZERO_VECTOR, q, turn))
        store(row, D_SPIN, axpy(turn, q, turn_slope(theta, axis, rate)))


@jit_exact_within
def point_derivative(body: Any, k: int, r: Any, turning: Any) -> Any:
    """Return changes of position, velocity and arm of a point r; turning: Ω × r."""
    row = body.changes[k]
    psi = vector(row, D_TURN)
    arm = cross(psi, r)
    speed = axpy(vector(row, D_SPEED), 1.0, cross(vector(row, D_SPIN), r))
    return axpy(vector(row, D_POSITION), 1.0, arm), axpy(speed, 1.0, cross(psi, turning)), arm


@jit_exact_within
def add_moment_to_jacobian(body: Any, k: int, s: float, turn: Any) -> None:
    """Add s times a change of moment to column k of the matrix."""
    for i in range(3):
        body.matrix[3 + i, k] = fused(s, turn[i], body.matrix[3 + i, k])


@jit_exact_within
def add_to_jacobian(body: Any, k: int, s: float, w: Any, turn: Any) -> None:
    """Add s times changes of force and moment to column k of the matrix."""
    for i in range(3):
        body.matrix[i, k] = fused(s, w[i], body.matrix[i, k])
        body.matrix[3 + i, k] = fused(s, turn[i], body.matrix[3 + i, k])


@jit_exact_within
def moment_derivative(r: Any, w: Any, arm: Any, f: Any) -> Any:
    """Return the change of moment of a force f at r that changes by w, its arm by `arm`."""
    return axpy(cross(r, w), 1.0, cross(arm, f))


@jit_exact
def add_constant_force(body: Any, q: float, r: Any, f: Any) -> None:
    """Add the derivatives of a force at a point r of the body that is constant in world axes."""
    for k in range(3, 6):
        arm = cross(vector(body.changes[k], D_TURN), r)
        add_moment_to_jacobian(body, k, -q, cross(arm, f))
