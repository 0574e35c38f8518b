"""Time integration of a rigid body with its rope, its pose and energy, and the types of bodies.

The index of the valid record is an internal variable (core/loads/memory.py): a substep that is
rejected, or a step that fails, leaves the body unchanged.

**Energy.** Kinetic energy includes that of the added mass at the relative velocity c, and p·u
besides, so that its rate is the power of all forces except the added mass: along z ∫w·M(w)·dw, of
which the part that differs between ascent and descent is ΔM/2·(w·√(w² + δ²) - δ²·asinh(w/δ)).
Slings and pin store ½·k·stretch². The dissipation of their dampers and of the components
(core/body/loads.py) is charged to the water's account.

**Types.** There is one type for each set of components, which selects the compiled code
(core/body/loads.py). All types are made on import, so that unpickling of cached code finds them by
name.
"""

from __future__ import annotations

from itertools import product
from math import inf, nan
from typing import Any, NamedTuple

import numpy as np

from rope_twin.core.body import state as at
from rope_twin.core.body.components import OWN_COLUMNS, OWN_ENTRIES, Shedding
from rope_twin.core.body.loads import TURN2, momenta, power_of, prepare_all, record_all
from rope_twin.core.body.solution import hook_residual, is_solved, solve, solve_body_statics
from rope_twin.core.body.state import (
    DAMPING,
    LENGTH,
    STIFFNESS,
    ZERO_VECTOR,
    Afloat,
    Deck,
    GridBed,
    Immersed,
    PlaneBed,
    RigidBody,
    axpy,
    cross,
    dot,
    matrix_of,
    quaternion,
    store,
    to_world,
    turned,
    vector,
)
from rope_twin.core.integrator import GAMMA, K1, K2, TRAPEZOID
from rope_twin.core.jit.decorators import jit_exact
from rope_twin.core.jit.rows import column, rows
from rope_twin.core.loads.accounts import account
from rope_twin.core.loads.balance import add_to_node, set_flow
from rope_twin.core.loads.hooks import Load, has_active_set, kernel
from rope_twin.core.loads.memory import declare_internal_variables
from rope_twin.core.state import (
    ACCELERATION,
    CORRECTION,
    ELEMENTS,
    FLOW,
    FLOW_RATE,
    LOW,
    POSITION,
    SLING2_MIN,
    SPEED2_MIN,
    VELOCITY,
    Floats,
)


def start(body: Any, rope: Any, upto: int) -> None:
    """Mark the static equilibrium as unsolved; record the ship's mean height."""
    if body.here == 0.0:
        return
    body.memory[0, 0] = 0.0
    body.stage[at.FRESH] = 1.0
    body.stage[at.SHIP_Z] = rope.state.nodes[POSITION + 2, rope.state.counts[ELEMENTS]]


@jit_exact
def _set_water(body: Any, rope: Any, stage: Any, position: Any) -> None:
    """Set velocity and acceleration of the water at a position, using a ghost node's column."""
    work, ghost = rope.work, rope.state.s.shape[0] + LOW
    for k in range(3):
        work[POSITION + k, ghost] = position[k]
    set_flow(rope.effects, work, stage, ghost, ghost + 1)
    for k in range(3):
        body.stage[at.FLOW_NOW + k] = work[FLOW + k, ghost]
        body.stage[at.FLOW_ACCELERATION + k] = work[FLOW_RATE + k, ghost]


@jit_exact
def _begin(body: Any, hook: Any) -> None:
    """Initialise the body in static equilibrium below the hook."""
    solve_body_statics(body, hook)
    store(body.records[0], at.WATER, vector(body.stage, at.FLOW_NOW))
    store(body.records[0], at.ARM_THEN, vector(body.stage, at.SUBMERGED_ARM))
    body.records[0, at.WET_THEN] = body.stage[at.SUBMERGED]
    body.stage[at.FRESH] = 0.0


@jit_exact
def _predict_first(body: Any, record: Any, q: float) -> None:
    """Predict the trapezoidal stage from the valid record `now`."""
    s = body.stage
    v, spin, before = vector(record, at.V), vector(record, at.SPIN), vector(record, at.WATER)
    flow_change = axpy(vector(s, at.FLOW_NOW), -1.0, before)
    store(
        s, at.FROZEN, axpy(before, 0.5 / GAMMA, flow_change)
    )  # velocity at the middle of the substep
    arm_start = vector(record, at.ARM_THEN)
    arm_change = axpy(vector(s, at.SUBMERGED_ARM), -1.0, arm_start)
    store(s, at.ARM_HELD, axpy(arm_start, 0.5 / GAMMA, arm_change))
    store(s, at.ARM_GROWS, axpy(ZERO_VECTOR, 0.5 / q, arm_change))
    wet_change = s[at.SUBMERGED] - record[at.WET_THEN]
    s[at.SUBMERGED_HELD] = record[at.WET_THEN] + 0.5 / GAMMA * wet_change
    s[at.WET_GROWS] = 0.5 / q * wet_change
    P, L = momenta(body, matrix_of(quaternion(record, at.Q)), v, spin)
    store(s, at.P_START, P)
    store(s, at.L_START, L)
    for k in range(4):
        s[at.Q_START + k] = record[at.Q + k]
    store(s, at.X_HAT, axpy(vector(record, at.X), q, v))
    store(s, at.TURN_HAT, axpy((0.0, 0.0, 0.0), q, spin))
    store(s, at.P_HAT, axpy(P, q, vector(record, at.FORCE)))
    store(s, at.L_HAT, axpy(L, q, vector(record, at.MOMENT)))
    store(s, at.SPEED, v)
    store(s, at.TURN_RATE, spin)


@jit_exact
def _put_second(s: Any, hat: int, middle: int, first: Any) -> None:
    store(s, hat, axpy(axpy((0.0, 0.0, 0.0), K1, vector(s, middle)), -K2, first))


@jit_exact
def _predict_second(body: Any, record: Any) -> None:
    """Predict the BDF2 stage from the start of the substep and the first stage."""
    s = body.stage
    _put_second(s, at.X_HAT, at.X_MIDDLE, vector(record, at.X))
    _put_second(s, at.TURN_HAT, at.TURN_MIDDLE, (0.0, 0.0, 0.0))
    _put_second(s, at.P_HAT, at.P_MIDDLE, vector(s, at.P_START))
    _put_second(s, at.L_HAT, at.L_MIDDLE, vector(s, at.L_START))
    store(s, at.SPEED, vector(s, at.SPEED_MIDDLE))
    store(s, at.TURN_RATE, vector(s, at.RATE_MIDDLE))


@jit_exact
def _prepare(body: Any, rope: Any, stage: Any, pose: Any) -> None:
    """Evaluate components and water at the pose predicted for the stage."""
    prepare_all(body.parts, body, rope, stage, pose)
    h = axpy(vector(body.watered, 0), 1.0, vector(body.stage, at.SUBMERGED_ARM))
    _set_water(body, rope, stage, axpy(pose[0], 1.0, to_world(pose[1], h)))


def predict(body: Any, rope: Any, stage: Any, kind: int, low: int, high: int) -> None:
    """Set the explicit part of the stage, and water and deck at its time."""
    if low > 0 or body.here == 0.0:
        return
    s, work = body.stage, rope.work
    body.tangent[at.ALLOWED] = rope.model.tolerance
    body.tangent[at.SOLVED_PLACE] = nan  # not solved for any motion of the hook yet
    if s[at.FRESH] > 0.0:
        hook = (work[POSITION, 0], work[POSITION + 1, 0], work[POSITION + 2, 0])
        _prepare(
            body, rope, stage, (hook, matrix_of((0.0, 0.0, 0.0, 1.0)), ZERO_VECTOR, ZERO_VECTOR)
        )
        _begin(body, hook)
        # repeat, in the water at the equilibrium position
        equilibrium = body.records[0]
        pose = (
            vector(equilibrium, at.X),
            matrix_of(quaternion(equilibrium, at.Q)),
            ZERO_VECTOR,
            ZERO_VECTOR,
        )
        _prepare(body, rope, stage, pose)
        _begin(body, hook)
    predict_stage(body, rope, stage, kind, body.records[int(body.memory[0, 0])])


@jit_exact
def predict_stage(body: Any, rope: Any, stage: Any, kind: int, record: Any) -> None:
    """Set the explicit part of the stage from the valid record `now`, and water and deck."""
    s, q = body.stage, stage.q
    if kind == TRAPEZOID:
        v, spin = vector(record, at.V), vector(record, at.SPIN)
        position = axpy(vector(record, at.X), 2.0 * q, v)
        attitude = turned(quaternion(record, at.Q), axpy(ZERO_VECTOR, 2.0 * q, spin))
        _prepare(body, rope, stage, (position, matrix_of(attitude), v, spin))
        _predict_first(body, record, q)
    else:
        _predict_second(body, record)
        v, spin = vector(s, at.SPEED), vector(s, at.SPIN_NOW)
        position = axpy(vector(s, at.X_HAT), q, v)
        _prepare(body, rope, stage, (position, matrix_of(quaternion(s, at.ATTITUDE)), v, spin))


@jit_exact
def load_hook(body: Any, work: Any, f: Any, Z: Any) -> None:
    """Add the slings' force f on the hook, its weight and inertia, to R_0, and Z + m·I to A_0.

    Z: minus the derivative of f. Both are stored as the linearisation that `unchanged` checks.
    """
    ax, ay, az = rows(work, ACCELERATION, 0)
    store(body.tangent, at.TANGENT_PULL, f)
    store(body.tangent, at.TANGENT_SLOPE, (Z[0], Z[1], Z[2]))
    store(body.tangent, at.TANGENT_ELSE, (Z[3], Z[4], Z[5]))
    m = body.hook
    add_to_node(work, 0, Load(
        f[0] - m * ax[0], f[1] - m * ay[0], f[2] - m * az[0] - body.hook_weight,
        Z[0] + m, Z[1], Z[2], Z[3] + m, Z[4], Z[5] + m,
    ))  # fmt: skip


def load_end(body: Any, work: Any, stage: Any) -> None:
    """Add the slings' force on the hook, its weight and inertia to R_0, their derivative to A_0.

    The residual is set to infinity where the body has no solution: the step is then halved (NaN
    would be ignored by a maximum).
    """
    if body.here == 0.0:
        return
    x, y, z = rows(work, POSITION, 0)
    vx, vy, vz = rows(work, VELOCITY, 0)
    ux, uy, uz = rows(work, FLOW, 0)
    s, hook = body.stage, ((x[0], y[0], z[0]), (vx[0], vy[0], vz[0]))
    if s[at.FRESH] > 0.0:  # no prediction was made
        store(s, at.FLOW_NOW, (ux[0], uy[0], uz[0]))
        _begin(body, hook[0])
        _predict_first(body, body.records[int(body.memory[0, 0])], stage.q)
    solved = solve(body, stage.q, hook, True)
    f = vector(s, at.HOOK_FORCE) if solved else (inf, inf, inf)
    load_hook(body, work, f, hook_residual(body, stage.q))


@jit_exact
def corrected_hook(work: Any, stage: Any, fraction: float) -> Any:
    """Return position and velocity of the hook after share·delta."""
    d = column(work, CORRECTION, 0)
    position = axpy(column(work, POSITION, 0), fraction * stage.p, d)
    return position, axpy(column(work, VELOCITY, 0), fraction * stage.q, d)


@jit_exact
def is_as_linearised(body: Any, work: Any, fraction: float) -> Any:
    """Return whether the force on the hook after share·delta agrees with its linearisation."""
    tangent = body.tangent
    (xx, xy, xz), (yy, yz, zz) = vector(tangent, at.TANGENT_SLOPE), vector(tangent, at.TANGENT_ELSE)
    change = to_world(((xx, xy, xz), (xy, yy, yz), (xz, yz, zz)), column(work, CORRECTION, 0))
    error = axpy(vector(body.stage, at.HOOK_FORCE), -1.0, vector(tangent, at.TANGENT_PULL))
    error = axpy(error, fraction, change)
    return dot(error, error) <= tangent[at.ALLOWED] * tangent[at.ALLOWED]


def unchanged(body: Any, work: Any, stage: Any, n: int, fraction: float) -> bool:
    """Return whether the force on the hook after share·delta agrees with its linearisation.

    It does not where slings tighten or where a deck or the seabed is touched (a change of active
    set).
    """
    if fraction == 0.0 or body.here == 0.0:
        return True
    if not is_solved(body, stage.q, corrected_hook(work, stage, fraction), True):
        return False
    return bool(is_as_linearised(body, work, fraction))


@jit_exact
def store_middle(s: Any) -> None:
    """Store the first stage, from which the second is predicted."""
    store(s, at.X_MIDDLE, vector(s, at.PLACE))
    store(s, at.TURN_MIDDLE, vector(s, at.TURN))
    store(s, at.P_MIDDLE, vector(s, at.P_NOW))
    store(s, at.L_MIDDLE, vector(s, at.L_NOW))
    store(s, at.SPEED_MIDDLE, vector(s, at.SPEED))
    store(s, at.RATE_MIDDLE, vector(s, at.TURN_RATE))


@jit_exact
def write_record(body: Any, record: Any, speed: Any) -> None:
    """Write the state of the converged second stage; speed: NaN where it has no solution."""
    s = body.stage
    store(record, at.X, vector(s, at.PLACE))
    for k in range(4):
        record[at.Q + k] = s[at.ATTITUDE + k]
    store(record, at.V, speed)
    store(record, at.SPIN, vector(s, at.SPIN_NOW))
    store(record, at.FORCE, vector(s, at.PULL))
    store(record, at.MOMENT, vector(s, at.TWIST))
    store(record, at.WATER, vector(s, at.FLOW_NOW))
    store(record, at.GROWS, vector(s, at.FLOW_ACCELERATION))
    store(record, at.ARM_THEN, vector(s, at.SUBMERGED_ARM))
    record[at.WET_THEN] = s[at.SUBMERGED]
    record_all(body.parts, body, record)


def settle(body: Any, rope: Any, stage: Any, kind: int, upto: int) -> None:
    """Store the body for the converged motion of the hook; the second stage writes a record."""
    if body.here == 0.0:
        return
    hook = column(rope.work, POSITION, 0), column(rope.work, VELOCITY, 0)
    solved = is_solved(body, stage.q, hook, True)
    if kind == TRAPEZOID:
        store_middle(body.stage)
        return
    unused = 0
    while unused in (int(body.memory[0, 0]), int(body.memory[2, 0])):
        unused += 1
    speed = vector(body.stage, at.SPEED) if solved else (nan, nan, nan)
    write_record(body, body.records[unused], speed)
    body.memory[1, 0] = float(unused)


@jit_exact
def middle_in(body: Any, record: Any) -> Any:
    """Return height [m] and vertical velocity [m/s] of the body's middle in a record."""
    vertical, r = matrix_of(quaternion(record, at.Q))[2], vector(body.middle, 0)
    x, v = vector(record, at.X), vector(record, at.V)
    return x[2] + dot(vertical, r), v[2] + dot(vertical, cross(vector(record, at.SPIN), r))


def middle(body: Any, height: float, speed: float) -> Any:
    """Return height and vertical velocity of the body's middle."""
    if body.here == 0.0:
        return height, speed
    return middle_in(body, body.records[int(body.memory[0, 0])])


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
    record = body.records[int(body.memory[0, 0])]
    Q = record[at.Q : at.Q + 4].copy()
    return Pose(_three(record, at.X), _three(record, at.V), Q, _three(record, at.SPIN), _matrix(Q))


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
    tension = np.maximum(k * stretch + c * rate, 0.0)
    extension = np.maximum(stretch, 0.0)
    pinned = legs[:, LENGTH] == 0.0
    force = np.where(pinned[:, None], k[:, None] * d + c[:, None] * e, tension[:, None] * n)
    stored = 0.5 * k * np.where(pinned, (d * d).sum(axis=1), extension * extension)
    dissipated = np.where(pinned, c * (e * e).sum(axis=1), (tension - k * extension) * rate)
    return force, stored, dissipated


def kinetic(body: Any, rope: Any) -> Any:
    """Return the kinetic energy of body, added mass and hook [J]."""
    pose, record = pose_of(body), body.records[int(body.memory[0, 0])]
    solid = (
        0.5 * body.m * pose.velocity @ pose.velocity + 0.5 * pose.spin @ body.inertia @ pose.spin
    )
    water = _of_water(body, pose, record[at.WET_THEN], _three(record, at.ARM_THEN))
    return solid + water + 0.5 * body.hook * (rope.velocity**2).sum(axis=0)


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


def potential(body: Any, rope: Any) -> Any:
    """Return the potential energy of body and hook in water, and of stretched slings [J]."""
    pose = pose_of(body)
    _, stored, _ = pulls_of(body, rope.position[:, 0], rope.velocity[:, 0])
    height = body.m * pose.centre[2] - body.displaced * pose.place(body.buoyed)[2]
    return body.g * height + stored.sum() + body.hook_weight * rope.position[2]


def power(body: Any, place: Any) -> Any:
    """Return the power of drag, water acceleration and components, less sling dissipation [W].

    It includes what a growing submergence ratio adds to the kinetic energy of the added mass.
    """
    pose, record = pose_of(body), body.records[int(body.memory[0, 0])]
    u, grows, wet, arm = (
        _three(record, at.WATER), _three(record, at.GROWS), record[at.WET_THEN],
        _three(record, at.ARM_THEN)
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
    _, _, dissipated = pulls_of(body, place.position[:, 0], place.velocity[:, 0])
    return total - dissipated.sum() + power_of(body, pose)


def _three(table: Floats, i: Any) -> Floats:
    return table[i : i + 3].copy()


def _matrix(Q: Floats) -> Floats:
    """Return the rotation matrix of a unit quaternion, (3, 3): I + 2·w·[q] + 2·[q]²."""
    x, y, z, w = Q.tolist()
    skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + 2.0 * w * skew + 2.0 * skew @ skew)


def _where_here(part: Any) -> Any:
    """Return an account that is zero where the rope does not carry the body."""

    def account_of(body: Any, place: Any) -> Any:
        return part(body, place) if body.here else np.zeros(place.velocity.shape[1])

    return account_of


def _make(parts: tuple[type, ...]) -> type[RigidBody]:
    """Return a type of body with its kernels and accounts registered."""
    name = "RigidBody" + "".join(part.__name__ for part in parts)
    kind = type(name, (RigidBody,), {"__slots__": (), "__module__": __name__})
    for function in (start, predict, load_end, unchanged, settle, middle):
        kernel(function.__name__, kind, exact=True)(function)
    for part in (kinetic, potential, power):
        account(f"{part.__name__}_end", kind)(_where_here(part))
    declare_internal_variables(kind, 1, "records", "stage")
    has_active_set(kind)
    globals()[name] = kind
    return kind


_WATERS = ((Immersed,), (Afloat,))
_DECKS: tuple[tuple[type, ...], ...] = ((), (Deck,))
_BEDS: tuple[tuple[type, ...], ...] = ((), (PlaneBed,), (GridBed,))
_WAKES: tuple[tuple[type, ...], ...] = ((), (Shedding,))
KINDS = {sum(some, ()): _make(sum(some, ())) for some in product(_WATERS, _DECKS, _BEDS, _WAKES)}


def with_parts(body: RigidBody, parts: tuple[Any, ...]) -> RigidBody:
    """Return a body with these components: water model, then deck, seabed, vortices."""
    held = float(body.legs[:, STIFFNESS].sum())
    stiffness = held + len(body.corners) * sum(getattr(component, "k", 0.0) for component in parts)
    figures = {**body._asdict(), "parts": parts, "stiffness": stiffness}
    if any(isinstance(component, Shedding) for component in parts):
        figures["records"] = np.pad(body.records, ((0, 0), (0, OWN_COLUMNS)))
        figures["stage"] = np.pad(body.stage, (0, OWN_ENTRIES))
    return KINDS[tuple(map(type, parts))](**figures)
