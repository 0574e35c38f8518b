"""Equations of motion of a rigid body in an implicit stage, and their condensation to the hook.

TR-BDF2 steps P, L, the position x and the rotation θ since the start of the substep (their rates
are in core/body/loads.py); the unknowns are v and dθ/dt. Momenta are thus conserved to round-off
for any rotation. The equations are solved to round-off by Newton's method with the exact Jacobian;
the Schur complement on the hook is then the exact derivative of the force there, except for its
skew part.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

from rope_twin.core.body.loads import loads, momenta
from rope_twin.core.body.rotation import (
    along,
    angular_velocity,
    dot,
    inward,
    matrix_of,
    outward,
    put,
    quaternion,
    turned,
    vector,
)
from rope_twin.core.body.state import (
    ATTITUDE,
    FORCES,
    HELD,
    L_HAT,
    L_NOW,
    MISS,
    P_HAT,
    P_NOW,
    PLACE,
    PULL,
    Q_START,
    RATE_BEFORE,
    SPEED,
    SPEED_BEFORE,
    SPIN_NOW,
    TURN,
    TURN_HAT,
    TURN_RATE,
    TWIST,
    X_HAT,
)
from rope_twin.core.jit.decorators import jit

MAX_ITERATIONS, HALVINGS = 60, 8
FORCE_TOL, MOMENTUM_TOL = 1e-9, 1e-12  # of the residual, relative to forces and momenta
NO_LOAD = 1e-200  # N·s: absolute tolerance for a body without loads
ROUND_OFF = 1e-15  # relative round-off of a position, amplified by stiff slings


@jit
def balance(body: Any, q: float, hook: Any) -> float:
    """Return the residual of the momenta at the current iterate, relative to its tolerance."""
    s = body.stage
    v, rate = vector(s, SPEED), vector(s, TURN_RATE)
    theta = along(vector(s, TURN_HAT), q, rate)
    attitude = turned(quaternion(s, Q_START), theta)
    R, x = matrix_of(attitude), along(vector(s, X_HAT), q, v)
    spin = angular_velocity(theta, rate)
    f, t = loads(body, q, (x, R, v, spin), hook, (theta, rate))
    P, L = momenta(body, R, v, spin)
    F, M = outward(R, f), outward(R, t)
    lost = inward(R, along(along(vector(s, P_HAT), q, F), -1.0, P))
    turn_lost = inward(R, along(along(vector(s, L_HAT), q, M), -1.0, L))
    put(s, PLACE, x)
    put(s, TURN, theta)
    put(s, SPIN_NOW, spin)
    put(s, PULL, F)
    put(s, TWIST, M)
    put(s, P_NOW, P)
    put(s, L_NOW, L)
    for k in range(4):
        s[ATTITUDE + k] = attitude[k]
    for k in range(3):
        body.matrix[k, MISS] = lost[k]
        body.matrix[3 + k, MISS] = turn_lost[k]
    P_hat, L_hat = vector(s, P_HAT), vector(s, L_HAT)
    kept = sqrt(dot(P_hat, P_hat)) + sqrt(dot(L_hat, L_hat)) / body.reach
    blur = ROUND_OFF * (sqrt(dot(x, x)) + body.reach) * body.stiffness
    allowed = q * (FORCE_TOL * s[FORCES] + blur) + MOMENTUM_TOL * kept + NO_LOAD
    turns = sqrt(dot(turn_lost, turn_lost)) / body.reach
    return float((sqrt(dot(lost, lost)) + turns) / allowed)


@jit
def eliminate(A: Any) -> None:
    """Solve six equations in place, with row pivoting, for the columns from HELD on."""
    for j in range(6):
        best = j
        for i in range(j + 1, 6):
            if abs(A[i, j]) > abs(A[best, j]):
                best = i
        for c in range(A.shape[1]):
            A[j, c], A[best, c] = A[best, c], A[j, c]
        for i in range(j + 1, 6):
            part = A[i, j] / A[j, j]
            for c in range(j, A.shape[1]):
                A[i, c] -= part * A[j, c]
    for c in range(HELD, A.shape[1]):
        for j in range(5, -1, -1):
            for k in range(j + 1, 6):
                A[j, c] -= A[j, k] * A[k, c]
            A[j, c] /= A[j, j]


@jit
def _correct(body: Any) -> None:
    """Apply Newton's correction of velocity and rotation rate."""
    A, s = body.matrix, body.stage
    eliminate(A)
    R = matrix_of(quaternion(s, ATTITUDE))
    moved = outward(R, (A[0, MISS], A[1, MISS], A[2, MISS]))
    put(s, SPEED_BEFORE, vector(s, SPEED))
    put(s, RATE_BEFORE, vector(s, TURN_RATE))
    put(s, SPEED, along(vector(s, SPEED), 1.0, moved))
    put(s, TURN_RATE, along(vector(s, TURN_RATE), 1.0, (A[3, MISS], A[4, MISS], A[5, MISS])))


@jit
def solve(body: Any, q: float, hook: Any) -> bool:
    """Solve for velocity and rotation rate at this motion of the hook; return whether it converged.

    A correction that increases the residual is halved (line search).
    """
    s = body.stage
    miss = balance(body, q, hook)
    for _ in range(MAX_ITERATIONS):
        if miss <= 1.0:
            return True
        _correct(body)
        last, miss = miss, balance(body, q, hook)
        for _ in range(HALVINGS):
            if miss < last:
                break
            for k in range(3):
                s[SPEED + k] = 0.5 * (s[SPEED + k] + s[SPEED_BEFORE + k])
                s[TURN_RATE + k] = 0.5 * (s[TURN_RATE + k] + s[RATE_BEFORE + k])
            miss = balance(body, q, hook)
    return bool(miss <= 1.0)


@jit
def left_on_hook(body: Any, q: float) -> Any:
    """Return minus the derivative of the force on the hook to its acceleration, in world axes.

    To be called after `solve`: W + q·w·A⁻¹·W', with the derivatives W and w of the sling forces to
    the acceleration of the hook and to the unknowns, and W' of force and moment on the body, as xx,
    xy, xz, yy, yz, zz. The symmetric part is returned.
    """
    A, H = body.matrix, body.hold
    eliminate(A)
    for j in range(HELD, MISS):
        for i in range(3):
            for k in range(6):
                H[i, j] += q * H[i, k] * A[k, j]
    xy, xz = 0.5 * (H[0, 7] + H[1, 6]), 0.5 * (H[0, 8] + H[2, 6])
    yz = 0.5 * (H[1, 8] + H[2, 7])
    rows = ((H[0, 6], xy, xz), (xy, H[1, 7], yz), (xz, yz, H[2, 8]))
    R = matrix_of(quaternion(body.stage, ATTITUDE))
    a, b = outward(R, outward(rows, R[0])), outward(R, outward(rows, R[1]))
    c = outward(R, outward(rows, R[2]))
    return a[0], a[1], a[2], b[1], b[2], c[2]
