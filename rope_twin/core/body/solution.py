"""Equations of motion of a rigid body in an implicit stage, and its static equilibrium.

**Motion.** TR-BDF2 steps P, L, the position x and the rotation θ since the start of the substep
(their rates are in core/body/loads.py); the unknowns are v and dθ/dt. Momenta are thus conserved to
round-off for any rotation. The equations are solved to round-off by Newton's method with the exact
Jacobian; the Schur complement on the hook is then the exact derivative of the force there, except
for its skew part.

**Static equilibrium** below a fixed hook, in the water that flows there. The six equations F = 0, M
= 0 are followed in pseudo-time: implicit Euler steps of a massless body with drag, whose step size
grows as the residual falls (pseudo-transient continuation, Kelley and Keyes 1998, SIAM J. Numer.
Anal. 35, 508). The body therefore reaches a stable equilibrium, finally with quadratic convergence.
Rotation about the vertical is free if the hook is the only restraint.

Without friction a body on a slope, or on the seabed in a current, is in equilibrium only where its
slings stop its slide. Where that is far from below the hook, friction is tried: in equilibrium the
regularised friction (core/body/components.py) is that of a creep velocity V, so a steadily creeping
body is sought. V is set to (x - x_0)·v_0/d_0 along the ground, x_0 the position below the hook: a
spring that yields where friction does. Water and hook move with the body, which sees no relative
motion.
"""

from __future__ import annotations

from math import atan, cos, nan, sin, sqrt
from typing import Any

from rope_twin.core.body.loads import highest_support, leg_force, loads, momenta
from rope_twin.core.body.state import (
    ARM_HELD,
    ATTITUDE,
    FLOW_ACCELERATION,
    FLOW_NOW,
    FORCES,
    FRICTION_SPEED,
    FROZEN,
    HELD,
    HOOK,
    L_HAT,
    L_NOW,
    LENGTH,
    MISS,
    P_HAT,
    P_NOW,
    PLACE,
    PULL,
    Q_START,
    RATE_BEFORE,
    RECORD,
    SHARE,
    SOLVED_PLACE,
    SOLVED_SPEED,
    SPEED,
    SPEED_BEFORE,
    SPIN_NOW,
    STIFFNESS,
    SUBMERGED,
    SUBMERGED_ARM,
    SUBMERGED_HELD,
    TURN,
    TURN_HAT,
    TURN_RATE,
    TWIST,
    X_HAT,
    ZERO_VECTOR,
    Q,
    V,
    X,
    angular_velocity,
    axpy,
    dot,
    matrix_of,
    quaternion,
    select,
    store,
    to_body,
    to_world,
    turned,
    unit,
    vector,
)
from rope_twin.core.jit.decorators import jit_exact
from rope_twin.core.jit.functions import anywhere, by_width, fused
from rope_twin.core.jit.wide import choose, widened
from rope_twin.core.state import DIVISOR_MIN

MAX_ITERATIONS, HALVINGS = 60, 8
FORCE_TOL, MOMENTUM_TOL = 1e-9, 1e-12  # of the residual, relative to forces and momenta
NO_LOAD = 1e-200  # N·s: absolute tolerance for a body without loads
ROUND_OFF = 1e-15  # relative round-off of a position, amplified by stiff slings


@jit_exact
def balance(body: Any, q: float, hook: Any) -> Any:
    """Return the residual of the momenta at the current iterate, relative to its tolerance."""
    s = body.stage
    v, rate = vector(s, SPEED), vector(s, TURN_RATE)
    theta = axpy(vector(s, TURN_HAT), q, rate)
    attitude = turned(quaternion(s, Q_START), theta)
    R, x = matrix_of(attitude), axpy(vector(s, X_HAT), q, v)
    spin = angular_velocity(theta, rate)
    f, t = loads(body, q, (x, R, v, spin), hook, (theta, rate))
    P, L = momenta(body, R, v, spin)
    F, M = to_world(R, f), to_world(R, t)
    p_error = to_body(R, axpy(axpy(vector(s, P_HAT), q, F), -1.0, P))
    l_error = to_body(R, axpy(axpy(vector(s, L_HAT), q, M), -1.0, L))
    store(s, PLACE, x)
    store(s, TURN, theta)
    store(s, SPIN_NOW, spin)
    store(s, PULL, F)
    store(s, TWIST, M)
    store(s, P_NOW, P)
    store(s, L_NOW, L)
    for k in range(4):
        s[ATTITUDE + k] = attitude[k]
    for k in range(3):
        body.matrix[k, MISS] = p_error[k]
        body.matrix[3 + k, MISS] = l_error[k]
    P_hat, L_hat = vector(s, P_HAT), vector(s, L_HAT)
    scale = sqrt(dot(P_hat, P_hat)) + sqrt(dot(L_hat, L_hat)) / body.reach
    round_off = ROUND_OFF * (sqrt(dot(x, x)) + body.reach) * body.stiffness
    allowed = q * (FORCE_TOL * s[FORCES] + round_off) + MOMENTUM_TOL * scale + NO_LOAD
    l_norm = sqrt(dot(l_error, l_error)) / body.reach
    return (sqrt(dot(p_error, p_error)) + l_norm) / allowed


@jit_exact
def _reduce_below(A: Any, j: int) -> None:
    """Subtract row j from those below it, so that their column j vanishes."""
    inverse = 1.0 / A[j, j]
    for i in range(j + 1, 6):
        ratio = A[i, j] * inverse
        for c in range(j, A.shape[1]):
            A[i, c] = fused(-ratio, A[j, c], A[i, c])


@jit_exact
def _substitute(A: Any) -> None:
    """Solve the triangular equations for the columns from HELD on."""
    for j in range(5, -1, -1):
        inverse = 1.0 / A[j, j]
        for c in range(HELD, A.shape[1]):
            value = A[j, c]
            for k in range(j + 1, 6):
                value = fused(-A[j, k], A[k, c], value)
            A[j, c] = value * inverse


@jit_exact
def _eliminate_one(A: Any) -> None:
    for j in range(6):
        pivot_row = j
        for i in range(j + 1, 6):
            if abs(A[i, j]) > abs(A[pivot_row, j]):
                pivot_row = i
        for c in range(A.shape[1]):
            A[j, c], A[pivot_row, c] = A[pivot_row, c], A[j, c]
        _reduce_below(A, j)
    _substitute(A)


@jit_exact
def _eliminate_lanes(A: Any) -> None:
    for j in range(6):
        index, pivot = widened(float(j)), abs(A[j, j])
        for i in range(j + 1, 6):
            larger = abs(A[i, j]) > pivot
            index, pivot = choose(larger, float(i), index), choose(larger, abs(A[i, j]), pivot)
        for i in range(j + 1, 6):
            swapped = index == float(i)
            if anywhere(swapped):
                for c in range(A.shape[1]):
                    above, below = A[j, c], A[i, c]
                    A[j, c], A[i, c] = choose(swapped, below, above), choose(swapped, above, below)
        _reduce_below(A, j)
    _substitute(A)


# Solves six equations in place, with row pivoting, for the columns from HELD on.
eliminate = by_width(_eliminate_one, _eliminate_lanes)


@jit_exact
def correct(body: Any, left: Any) -> None:
    """Apply Newton's correction of velocity and rotation rate where the residual is `left`."""
    A, s = body.matrix, body.stage
    eliminate(A)
    R = matrix_of(quaternion(s, ATTITUDE))
    moved = to_world(R, (A[0, MISS], A[1, MISS], A[2, MISS]))
    store(s, SPEED_BEFORE, vector(s, SPEED))
    store(s, RATE_BEFORE, vector(s, TURN_RATE))
    v, rate = vector(s, SPEED), vector(s, TURN_RATE)
    store(s, SPEED, select(left, axpy(v, 1.0, moved), v))
    turned_by = A[3, MISS], A[4, MISS], A[5, MISS]
    store(s, TURN_RATE, select(left, axpy(rate, 1.0, turned_by), rate))


@jit_exact
def _halve(body: Any, worse: Any) -> None:
    """Halve the last correction where the residual is `worse`."""
    s = body.stage
    for k in range(3):
        v = 0.5 * (s[SPEED + k] + s[SPEED_BEFORE + k])
        rate = 0.5 * (s[TURN_RATE + k] + s[RATE_BEFORE + k])
        s[SPEED + k] = choose(worse, v, s[SPEED + k])
        s[TURN_RATE + k] = choose(worse, rate, s[TURN_RATE + k])


@jit_exact
def _solve(body: Any, q: Any, hook: Any, wanted: Any) -> Any:
    """Solve for velocity and rotation rate at this motion of the hook; return whether it converged.

    A correction that increases the residual is halved (line search). wanted: True, or a mask of the
    lanes to be solved. In lanes q is wide: LLVM would contract the sign of a scalar with other
    terms.
    """
    miss = balance(body, q, hook)
    for _ in range(MAX_ITERATIONS):
        left = wanted ^ (wanted & (miss <= 1.0))
        if not anywhere(left):
            break
        correct(body, left)
        last, miss = miss, balance(body, q, hook)
        for _ in range(HALVINGS):
            worse = left ^ (left & (miss < last))
            if not anywhere(worse):
                break
            _halve(body, worse)
            miss = balance(body, q, hook)
    return wanted & (miss <= 1.0)


@jit_exact
def solve(body: Any, q: Any, hook: Any, wanted: Any) -> Any:
    """Solve as `_solve`, and store the motion of the hook that the solution is for."""
    x0, v0 = vector(body.tangent, SOLVED_PLACE), vector(body.tangent, SOLVED_SPEED)
    x, v = select(wanted, hook[0], x0), select(wanted, hook[1], v0)
    solved = _solve(body, q, (x, v), wanted)
    place = select(solved, x, (nan, nan, nan))
    store(body.tangent, SOLVED_PLACE, select(wanted, place, x0))
    store(body.tangent, SOLVED_SPEED, v)
    return solved


@jit_exact
def is_solved(body: Any, q: Any, hook: Any, wanted: Any) -> Any:
    """Solve for this motion of the hook where it has changed; return whether it is solved."""
    x, v = hook
    x0, v0 = vector(body.tangent, SOLVED_PLACE), vector(body.tangent, SOLVED_SPEED)
    same = wanted & (x[0] == x0[0]) & (x[1] == x0[1]) & (x[2] == x0[2])
    same = same & (v[0] == v0[0]) & (v[1] == v0[1]) & (v[2] == v0[2])
    changed = wanted ^ same
    if not anywhere(changed):
        return same
    return same | solve(body, q, hook, changed)


@jit_exact
def hook_residual(body: Any, q: float) -> Any:
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
                H[i, j] = fused(q * H[i, k], A[k, j], H[i, j])
    xy, xz = 0.5 * (H[0, 7] + H[1, 6]), 0.5 * (H[0, 8] + H[2, 6])
    yz = 0.5 * (H[1, 8] + H[2, 7])
    rows = ((H[0, 6], xy, xz), (xy, H[1, 7], yz), (xz, yz, H[2, 8]))
    R = matrix_of(quaternion(body.stage, ATTITUDE))
    a, b = to_world(R, to_world(rows, R[0])), to_world(R, to_world(rows, R[1]))
    c = to_world(R, to_world(rows, R[2]))
    return a[0], a[1], a[2], b[1], b[2], c[2]


MAX_ROUNDS, BISECTIONS = 400, 60
STATIC_FORCE_TOL = 1e-12  # of the weight: residual force at which the body is in equilibrium
DIFFERENCE_STEP = 1e-6  # of the reach: increment of finite differences
MAX_CHANGE = 0.2  # of the reach, and in radians: largest change per iteration
FIRST_DRAG, MIN_DRAG = 1.0, 1e-4  # initial and minimum drag over weight and reach
SOFT_STRAIN, STIFFNESS_FACTOR = 0.02, 10.0  # initial strain of slings, factor per round
TINY_WEIGHT = 1e-3  # N, weight assumed for a weightless body
MAX_SLIDE = 0.25  # of the reach: largest slide to an equilibrium without friction
YIELD_DISTANCE = 0.1  # of the reach: d_0
MAX_CREEP = (
    10.0 * FRICTION_SPEED
)  # creep velocity at which friction reaches 99.5 % of its limit [m/s]
SLOPE_STEP = 1e-3  # increment for the slope of the ground [m]
FRICTION_MIN = 1e-9  # of the weight: smallest friction force considered
NO_SUPPORT = -1e300


@jit_exact
def _lift(body: Any, drop: float) -> float:
    """Return the vertical sling force on an upright body with G `drop` below the hook [N]."""
    total = 0.0
    for j in range(body.legs.shape[0]):
        r = vector(body.legs[j], 0)
        tension = leg_force(
            body.legs[j], body.stage[SHARE], (-r[0], -r[1], drop - r[2]), ZERO_VECTOR
        )
        total += tension[0][2]
    return total


@jit_exact
def _drop(body: Any) -> float:
    """Return the approximate depth of G below the hook where the slings carry the body."""
    low, high = 0.0, 1.0
    for j in range(body.legs.shape[0]):
        leg = body.legs[j]
        high = max(
            high, leg[LENGTH] + body.reach + 1.0 + body.W / (body.stage[SHARE] * leg[STIFFNESS])
        )
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        if _lift(body, middle) < body.W:
            low = middle
        else:
            high = middle
    return high


@jit_exact
def creep_speed(body: Any, position: Any, anchor: Any) -> Any:
    """Return the creep velocity along the ground of a body displaced from its friction anchor.

    anchor: that position; v_0/d_0, 0 without friction; and the allowed displacement.
    """
    start, rate, _ = anchor
    if not rate > 0.0:
        return ZERO_VECTOR
    x, y = rate * (position[0] - start[0]), rate * (position[1] - start[1])
    _, east, north = _ground(body, position)
    return x, y, east * x + north * y


@jit_exact
def _forces_at(body: Any, position: Any, attitude: Any, creep: Any) -> Any:
    """Return force and moment in body axes of a body that creeps together with water and hook."""
    s, flow, frozen = body.stage, vector(body.stage, FLOW_NOW), vector(body.stage, FROZEN)
    store(s, FLOW_NOW, axpy(flow, 1.0, creep))
    store(s, FROZEN, axpy(frozen, 1.0, creep))
    pose = (position, matrix_of(attitude), creep, ZERO_VECTOR)
    result = loads(body, 1.0, pose, (vector(s, HOOK), creep), (ZERO_VECTOR, ZERO_VECTOR))
    store(s, FLOW_NOW, flow)
    store(s, FROZEN, frozen)
    return result


@jit_exact
def _forces(body: Any, position: Any, attitude: Any, anchor: Any) -> Any:
    """Return force and moment in body axes."""
    return _forces_at(body, position, attitude, creep_speed(body, position, anchor))


@jit_exact
def _moved(position: Any, attitude: Any, change: Any, turn: Any) -> Any:
    """Return position and attitude after a change given in body axes."""
    return axpy(position, 1.0, to_world(matrix_of(attitude), change)), turned(attitude, turn)


@jit_exact
def _difference_matrix(body: Any, position: Any, attitude: Any, forces: Any, anchor: Any) -> None:
    """Set the matrix to -dF/d(position, rotation) by differences, its last column to the forces."""
    # `loads` clears the matrix, so the columns are buffered in a record that is still unused
    buffer, (f, t) = body.records, forces
    for k in range(6):
        step = DIFFERENCE_STEP * body.reach if k < 3 else DIFFERENCE_STEP
        change, turn = unit(k, step), unit(k - 3, step)
        moved, turned_attitude = _moved(position, attitude, change, turn)
        force, twist = _forces(body, moved, turned_attitude, anchor)
        row = buffer[1 + k // 3]
        store(row, 6 * (k % 3), axpy((0.0, 0.0, 0.0), -1.0 / step, axpy(force, -1.0, f)))
        store(row, 6 * (k % 3) + 3, axpy((0.0, 0.0, 0.0), -1.0 / step, axpy(twist, -1.0, t)))
    for k in range(6):
        row = buffer[1 + k // 3]
        for i in range(6):
            body.matrix[i, k] = row[6 * (k % 3) + i]
    for i in range(3):
        body.matrix[i, MISS] = f[i]
        body.matrix[3 + i, MISS] = t[i]


@jit_exact
def _step(body: Any, drag: float) -> Any:
    """Return the change of position and attitude in one iteration, limited to MAX_CHANGE."""
    A = body.matrix
    for k in range(3):
        A[k, k] += drag / body.reach
        A[3 + k, 3 + k] += drag * body.reach
    eliminate(A)
    change, turn = (A[0, MISS], A[1, MISS], A[2, MISS]), (A[3, MISS], A[4, MISS], A[5, MISS])
    distance = max(sqrt(dot(change, change)) / body.reach, sqrt(dot(turn, turn)))
    factor = min(1.0, MAX_CHANGE / (distance + DIVISOR_MIN))
    return axpy(ZERO_VECTOR, factor, change), axpy(ZERO_VECTOR, factor, turn)


@jit_exact
def _norm(body: Any, forces: Any) -> float:
    """Return the norm of force and moment [N]."""
    f, t = forces
    return float(sqrt(dot(f, f)) + sqrt(dot(t, t)) / body.reach)


@jit_exact
def _is_near_anchor(position: Any, anchor: Any) -> bool:
    """Return whether a body is close enough to its starting position."""
    start, _, max_distance = anchor
    x, y = position[0] - start[0], position[1] - start[1]
    return bool(sqrt(x * x + y * y) <= max_distance)


@jit_exact
def _iterate(body: Any, start: Any, weight: float, anchor: Any) -> Any:
    """Iterate position and attitude towards equilibrium; return them and whether they converged.

    The iteration stops if the body moves too far.
    """
    position, attitude = start
    round_off = ROUND_OFF * (body.reach + sqrt(dot(position, position))) * body.stiffness
    drag, tolerance = FIRST_DRAG * weight, STATIC_FORCE_TOL * weight + round_off
    forces = _forces(body, position, attitude, anchor)
    miss = _norm(body, forces)
    for _ in range(MAX_ROUNDS):
        if not (miss > tolerance and _is_near_anchor(position, anchor)):
            break
        _difference_matrix(body, position, attitude, forces, anchor)
        change, turn = _step(body, drag)
        next_position, next_attitude = _moved(position, attitude, change, turn)
        next_forces = _forces(body, next_position, next_attitude, anchor)
        previous, miss = miss, _norm(body, next_forces)
        if not miss < 2.0 * previous + 0.1 * weight:  # overshoot: slings are stiff as it swings
            drag, miss = 10.0 * drag, previous
            continue
        position, attitude, forces = next_position, next_attitude, next_forces
        drag = max(
            drag * (min(miss / previous, 0.5) if miss < previous else 2.0), MIN_DRAG * weight
        )
    return position, attitude, miss <= tolerance and _is_near_anchor(position, anchor)


@jit_exact
def _ground(body: Any, position: Any) -> Any:
    """Return the height of the support below a position, and its slopes (east, north)."""
    height = highest_support(body.parts, body, position, NO_SUPPORT)
    east = highest_support(
        body.parts, body, axpy(position, SLOPE_STEP, (1.0, 0.0, 0.0)), NO_SUPPORT
    )
    north = highest_support(
        body.parts, body, axpy(position, SLOPE_STEP, (0.0, 1.0, 0.0)), NO_SUPPORT
    )
    return height, (east - height) / SLOPE_STEP, (north - height) / SLOPE_STEP


@jit_exact
def _start(body: Any, hook: Any) -> Any:
    """Return the initial guess: upright below the hook, or flat on a higher support."""
    position, lowest = axpy(hook, -_drop(body), (0.0, 0.0, 1.0)), 0.0
    for j in range(body.corners.shape[0]):
        lowest = min(lowest, body.corners[j, 2])
    half = 0.5 * body.heading
    attitude = (0.0, 0.0, sin(half), cos(half))
    ground, east, north = _ground(body, position)
    slope = sqrt(east * east + north * north)
    if not ground > position[2] + lowest:
        return position, attitude
    if slope > 0.0:
        lean = axpy(ZERO_VECTOR, atan(slope) / slope, (north, -east, 0.0))
        attitude = turned(attitude, to_body(matrix_of(attitude), lean))
    return (hook[0], hook[1], ground - lowest * sqrt(1.0 + slope * slope)), attitude


@jit_exact
def _softest(body: Any, weight: float) -> float:
    """Return the initial factor on the slings' stiffness."""
    long = body.reach
    for j in range(body.legs.shape[0]):
        long = max(long, body.legs[j, LENGTH])
    return float(min(1.0, weight / (SOFT_STRAIN * long * body.stiffness)))


@jit_exact
def _continue_stiffness(body: Any, start: Any, weight: float, anchor: Any) -> Any:
    """Solve for position and attitude of equilibrium; return them and whether it converged.

    Continuation in the sling stiffness: it starts with soft slings, which yield while the body
    takes its attitude, and is raised in steps up to the actual stiffness.
    """
    s = body.stage
    s[SHARE] = _softest(body, weight)
    pose = _iterate(body, start, weight, anchor)
    while s[SHARE] < 1.0 and _is_near_anchor(pose[0], anchor):
        s[SHARE] = min(1.0, STIFFNESS_FACTOR * s[SHARE])
        pose = _iterate(body, (pose[0], pose[1]), weight, anchor)
    s[SHARE] = 1.0
    return pose


@jit_exact
def _equilibrium(body: Any, start: Any, weight: float) -> Any:
    """Return position, attitude and creep velocity of equilibrium, and whether it converged."""
    start_position, forever = start[0], -NO_SUPPORT
    position, attitude, converged = _continue_stiffness(
        body, start, weight, (start_position, 0.0, MAX_SLIDE * body.reach)
    )
    if converged:
        return position, attitude, ZERO_VECTOR, converged
    anchor = (start_position, FRICTION_SPEED / (YIELD_DISTANCE * body.reach), forever)
    position, attitude, converged = _continue_stiffness(body, start, weight, anchor)
    creep = creep_speed(body, position, anchor)
    needs_friction = (
        _norm(body, _forces_at(body, position, attitude, ZERO_VECTOR)) > FRICTION_MIN * weight
    )
    if converged and needs_friction and dot(creep, creep) < MAX_CREEP * MAX_CREEP:
        return position, attitude, creep, converged
    position, attitude, converged = _continue_stiffness(
        body, start, weight, (start_position, 0.0, forever)
    )
    return position, attitude, ZERO_VECTOR, converged


@jit_exact
def solve_body_statics(body: Any, hook: Any) -> None:
    """Set record 0 to the static equilibrium below the hook; not finite if there is none.

    The stage gives the water and the deck's height at which the run begins.
    """
    s, record = body.stage, body.records[0]
    store(s, FROZEN, vector(s, FLOW_NOW))
    store(s, FLOW_ACCELERATION, ZERO_VECTOR)
    store(s, ARM_HELD, vector(s, SUBMERGED_ARM))
    s[SUBMERGED_HELD] = s[SUBMERGED]
    store(s, HOOK, hook)
    weight = (body.m + body.displaced) * body.g + TINY_WEIGHT
    s[SHARE] = _softest(body, weight)
    position, attitude, creep, converged = _equilibrium(body, _start(body, hook), weight)
    for k in range(RECORD):
        record[k] = 0.0
    store(record, X, position)
    for k in range(4):
        record[Q + k] = attitude[k]
    store(record, V, creep if converged else (nan, nan, nan))
