"""Components of the loads on a rigid body: deck, seabed, water surface, vortices.

**Contact** of its corners. The law is that of effects/seabed.py: N = k·d·(1 - χ·v_n), at least 0
(Hunt and Crossley 1975), and friction -μ·N·v_t/√(|v_t|² + v_0²) (Oden and Martins 1985), here with
all of its derivatives. The deck is a level plane that heaves.

The seabed's k is that of a payload node, shared among the corners. Omitted from the Jacobian: the
change of slope of gridded soundings below a corner.

**Partial submergence**: buoyancy with righting moments, slamming. The body is cut into columns
along its own z over the height H; their positions and volume fractions are Gauss-Legendre points
and weights, so that volume and moments are exact for a box whose bottom is wet and whose top is
dry. A column whose middle is at height z is submerged below the surface η over the fraction

    s = (η - z)/e + 1/2, from 0 to 1,  e⁸ = (H·n_z)⁸ + (a·n_x)⁸ + (b·n_y)⁸

where n is the vertical in body axes and a, b are its sides: e is its vertical extent at the present
attitude, and stays above 0 where it lies flat. Buoyancy ρ·g·V·w·s acts -½·(1 - s)·∂e/∂n from the
middle: the middle of the submerged part of an upright column. It therefore has a potential,
ρ·g·V·w·½·e·s² while partly submerged, and cannot create energy.

Added mass and drag follow the submergence ratio β of the whole body and act at the middle of the
submerged part (DNV-RP-N103, 4.2 to 4.4). While a column enters at the speed v relative to the
water, ½·ρ·C_s·A·w·v² acts upward at its lower end (4.3.8). β in the momenta is held constant over a
substep: the effect of its change on the added mass is the slamming force, and water exit has none.

**Vortices** shed by the body: a transverse force at its Strouhal frequency. It is that of a payload
that is a point (effects/payload_shedding.py), with the projected area of the body's box across the
flow, Σ a_k·|w_k|/|w| with its faces a_k, and the vertical n in place of the rope's tangent: F =
½·ρ·C_L·(Σ a_k·|w_k|)·sin φ·(w × n) at the reference point of added mass and drag, for the water's
velocity w relative to it; a partly submerged body has its submerged share of it.

φ is that of the substep's start plus its rate, the mean of both ends, times the time since: of
second order. It is kept beside the records (core/body/state.py), in columns that only such a body
has.
"""

from __future__ import annotations

from math import cos, sin, sqrt
from typing import Any, NamedTuple

import numpy as np

from rope_twin.core.bed import Plane
from rope_twin.core.bed_shape import beds_at, grid_bed
from rope_twin.core.body import state as at
from rope_twin.core.body.loads import component_kernel
from rope_twin.core.body.state import (
    FRICTION_SPEED,
    ZERO_VECTOR,
    Afloat,
    Deck,
    GridBed,
    PlaneBed,
    RigidBody,
    add_constant_force,
    add_to_jacobian,
    axpy,
    cross,
    dot,
    moment_derivative,
    point_derivative,
    select,
    store,
    to_body,
    to_world,
    vector,
)
from rope_twin.core.jit.decorators import jit_exact, jit_exact_within
from rope_twin.core.jit.functions import anywhere, by_type, by_width, fused
from rope_twin.core.jit.wide import choose
from rope_twin.core.loads.balance import set_flow
from rope_twin.core.state import ELEMENTS, LOW, POSITION, SPEED2_MIN, SURFACE, VELOCITY, Floats


@jit_exact
def contact_force(soil: Any, d: float, n: Any, v: Any) -> Any:
    """Return the contact force for depth d > 0, normal n and velocity v, and (N, gain, sliding).

    soil: k, χ, μ.
    """
    k, chi, mu = soil
    v_normal = dot(v, n)
    damping = max(fused(-chi, v_normal, 1.0), 0.0)
    N, sliding = k * d * damping, axpy(v, -v_normal, n)
    friction = mu * N / sqrt(dot(sliding, sliding) + FRICTION_SPEED * FRICTION_SPEED)
    return axpy(axpy(ZERO_VECTOR, N, n), -friction, sliding), (N, damping, sliding)


@jit_exact
def contact_derivative(soil: Any, d: float, n: Any, contact: Any, motion: Any) -> Any:
    """Return the change of the contact force for a change of position and velocity."""
    k, chi, mu = soil
    N, damping, sliding = contact
    dx, dv = motion
    if not anywhere(damping > 0.0):
        return ZERO_VECTOR
    dv_normal = dot(dv, n)
    dN = -k * fused(damping, dot(dx, n), d * chi * dv_normal)
    across = axpy(dv, -dv_normal, n)
    inverse = 1.0 / sqrt(dot(sliding, sliding) + FRICTION_SPEED * FRICTION_SPEED)
    change = axpy(axpy(ZERO_VECTOR, dN, n), -mu * dN * inverse, sliding)
    change = axpy(change, -mu * N * inverse, across)
    friction = mu * N * inverse * inverse * inverse
    change = axpy(change, friction * dot(sliding, across), sliding)
    return select(damping > 0.0, change, ZERO_VECTOR)


@jit_exact
def add_contact(body: Any, q: float, pose: Any, r: Any, touch: Any) -> Any:
    """Return force and moment in body axes at a point r in contact, and N; add their derivatives.

    touch: soil, depth (> 0, in one lane at least), normal, velocity of the surface touched.
    """
    _, R, v, spin = pose
    soil, d, n, surface_velocity = touch
    rotation_velocity = cross(spin, r)
    speed = axpy(axpy(v, 1.0, to_world(R, rotation_velocity)), -1.0, surface_velocity)
    push, contact = contact_force(soil, d, n, speed)
    f = select(d > 0.0, to_body(R, push), ZERO_VECTOR)
    for k in range(6):
        dx, dv, arm = point_derivative(body, k, r, rotation_velocity)
        w = contact_derivative(soil, d, n, contact, (to_world(R, dx), to_world(R, dv)))
        w = select(d > 0.0, to_body(R, w), ZERO_VECTOR)
        add_to_jacobian(body, k, -q, w, moment_derivative(r, w, arm, f))
    return f, cross(r, f), choose(d > 0.0, contact[0], 0.0)


@component_kernel("load", Deck)
def load_deck(deck: Any, body: Any, q: float, pose: Any) -> Any:
    """Return the contact force and moment of all corners on the deck."""
    x, R, _, _ = pose
    up, deck_velocity = (0.0, 0.0, 1.0), (0.0, 0.0, body.stage[at.DECK_SPEED])
    f, t, total = ZERO_VECTOR, ZERO_VECTOR, 0.0
    for j in range(body.corners.shape[0]):
        r = vector(body.corners[j], 0)
        d = body.stage[at.DECK_Z] - x[2] - dot(R[2], r)
        if anywhere(d > 0.0):
            touch = (deck.k, deck.chi, deck.mu), d, up, deck_velocity
            force, moment, N = add_contact(body, q, pose, r, touch)
            f, t, total = axpy(f, 1.0, force), axpy(t, 1.0, moment), total + N
    return f, t, total


@component_kernel("prepare", Deck)
def prepare_deck(deck: Any, body: Any, rope: Any, stage: Any, pose: Any) -> None:
    """Set height and vertical velocity of the deck at the stage's time."""
    s, n, time = body.stage, rope.state.counts[ELEMENTS], stage.time
    ship = rope.work[POSITION + 2, n] - s[at.SHIP_Z]
    height = deck.height + deck.with_ship * ship
    speed = deck.with_ship * rope.work[VELOCITY + 2, n]
    for j in range(deck.heaves.shape[0]):
        factor, factor_rate, ramp = 1.0, 0.0, deck.heaves[j, 3]
        if anywhere(time < ramp):
            u = max(time, 0.0) / ramp
            factor = choose(time < ramp, u * u * u * (10.0 + u * (6.0 * u - 15.0)), 1.0)
            factor_rate = choose(time < ramp, 30.0 * u * u * (u - 1.0) * (u - 1.0) / ramp, 0.0)
        amplitude, omega = deck.heaves[j, 0], deck.heaves[j, 1]
        angle = omega * time + deck.heaves[j, 2]
        z, w = amplitude * sin(angle), amplitude * omega * cos(angle)
        height = height + factor * z
        speed = speed + factor * w + factor_rate * z
    s[at.DECK_Z], s[at.DECK_SPEED] = height, speed


@component_kernel("support", Deck)
def support_deck(deck: Any, body: Any, place: Any) -> float:
    """Return the height of the deck."""
    return float(body.stage[at.DECK_Z])


def deck_forces(deck: Deck, body: RigidBody, pose: Any) -> Floats:
    """Return the deck's force on each corner, (corners, 3) [N]; pose: of core/body/step.py."""
    v = pose.speed(body.corners) - [0.0, 0.0, body.stage[at.DECK_SPEED]]
    depth = np.maximum(body.stage[at.DECK_Z] - pose.place(body.corners)[:, 2], 0.0)
    push = deck.k * depth * np.maximum(1.0 - deck.chi * v[:, 2], 0.0)
    friction = deck.mu * push / np.sqrt((v[:, :2] ** 2).sum(axis=1) + FRICTION_SPEED**2)
    return np.column_stack([-friction * v[:, 0], -friction * v[:, 1], push])


@component_kernel("power", Deck)
def power_deck(deck: Deck, body: RigidBody, pose: Any) -> float:
    """Return the power of contact forces and friction of the deck [W]."""
    return float((deck_forces(deck, body, pose) * pose.speed(body.corners)).sum())


@jit_exact
def _bed_contact(bed: Any, body: Any, q: float, pose: Any, r: Any, ground: Any) -> Any:
    """Return the contact force at one corner r; ground: height and slopes of the seabed below."""
    z, east, north = ground
    nz = 1.0 / sqrt(1.0 + east * east + north * north)
    d = (z - pose[0][2] - dot(pose[1][2], r)) * nz
    if not anywhere(d > 0.0):
        return ZERO_VECTOR, ZERO_VECTOR, 0.0
    touch = (bed.k, bed.chi, bed.mu), d, (-east * nz, -north * nz, nz), ZERO_VECTOR
    return add_contact(body, q, pose, r, touch)


@jit_exact
def _plane(bed: Any, x: float, y: float) -> Any:
    """Return the height of a plane seabed and its slopes, with the rounding of `plane_bed`."""
    return fused(bed.north, y, fused(bed.east, x, bed.height)), bed.east, bed.north


# The height of the seabed below a position and its slopes to the east and the north.
_ground = by_type(Plane, lambda bed, x, y: _plane(bed, x, y), lambda bed, x, y: grid_bed(bed, x, y))


@component_kernel("load", PlaneBed, GridBed)
def load_bed(bed: Any, body: Any, q: float, pose: Any) -> Any:
    """Return the contact force and moment of all corners on the seabed."""
    f, t, total = ZERO_VECTOR, ZERO_VECTOR, 0.0
    for j in range(body.corners.shape[0]):
        r = vector(body.corners[j], 0)
        position = axpy(pose[0], 1.0, to_world(pose[1], r))
        ground = _ground(bed.shape, position[0], position[1])
        force, moment, N = _bed_contact(bed, body, q, pose, r, ground)
        f, t, total = axpy(f, 1.0, force), axpy(t, 1.0, moment), total + N
    return f, t, total


@component_kernel("support", PlaneBed, GridBed)
def support_bed(bed: Any, body: Any, place: Any) -> float:
    """Return the height of the seabed at a position."""
    z, _, _ = _ground(bed.shape, place[0], place[1])
    return float(z)


def bed_forces(
    bed: PlaneBed | GridBed, body: RigidBody, pose: Any
) -> tuple[Floats, Floats, Floats]:
    """Return clearance of each corner [m], normal force [N], and total contact force (n, 3) [N].

    pose: of core/body/step.py.
    """
    positions, v = pose.place(body.corners), pose.speed(body.corners)
    ground = beds_at(bed.shape, positions[:, 0].copy(), positions[:, 1].copy()).T
    normal = np.column_stack([-ground[:, 1:], np.ones(len(ground))])
    norm = np.sqrt((normal * normal).sum(axis=1))
    normal /= norm[:, None]
    clearance, v_normal = positions[:, 2] - ground[:, 0], (v * normal).sum(axis=1)
    depth = np.maximum(-clearance / norm, 0.0)
    push = bed.k * depth * np.maximum(1.0 - bed.chi * v_normal, 0.0)
    sliding = v - v_normal[:, None] * normal
    friction = bed.mu * push / np.sqrt((sliding * sliding).sum(axis=1) + FRICTION_SPEED**2)
    return clearance, push, push[:, None] * normal - friction[:, None] * sliding


@component_kernel("power", PlaneBed, GridBed)
def power_bed(bed: Any, body: RigidBody, pose: Any) -> float:
    """Return the power of contact and friction [W]; elastic energy of the soil is returned."""
    return float((bed_forces(bed, body, pose)[2] * pose.speed(body.corners)).sum())


DRY_TOL = 1e-12  # submerged fraction below which a body counts as dry


@jit_exact_within
def _sixth_power(x: float) -> float:
    return x * x * x * x * x * x


@jit_exact
def _extent(part: Any, n: Any) -> Any:
    """Return the vertical extent e of a column and ∂e/∂n."""
    a, b, H = part.side_x * n[0], part.side_y * n[1], part.height * n[2]
    A, B, C = _sixth_power(a), _sixth_power(b), _sixth_power(H)
    e = sqrt(sqrt(sqrt(A * a * a + B * b * b + C * H * H)))
    s = 1.0 / (_sixth_power(e) * e)
    return e, (s * A * a * part.side_x, s * B * b * part.side_y, s * C * H * part.height)


@jit_exact
def _extent_derivative(part: Any, n: Any, extent: Any, dn: Any) -> Any:
    """Return the changes of e and ∂e/∂n for a change dn of the vertical in body axes."""
    e, g = extent
    a, b, H = part.side_x * n[0], part.side_y * n[1], part.height * n[2]
    de, s = dot(g, dn), 7.0 / (_sixth_power(e) * e)
    stretch = (
        s * _sixth_power(a) * part.side_x * part.side_x * dn[0],
        s * _sixth_power(b) * part.side_y * part.side_y * dn[1],
        s * _sixth_power(H) * part.height * part.height * dn[2],
    )
    return de, axpy(stretch, -7.0 * de / e, g)


@jit_exact
def _submerged_fraction(body: Any, j: int, part: Any, pose: Any, e: float) -> Any:
    """Return the middle of column j and its submerged fraction s before clamping to [0, 1]."""
    r, s = vector(part.columns[j], 0), body.stage
    surface = s[at.SURFACE_Z] + s[at.SURFACE_X] * part.columns[j, 4]
    surface += s[at.SURFACE_Y] * part.columns[j, 5]
    return r, (surface - pose[0][2] - dot(pose[1][2], r)) / e + 0.5


@component_kernel("load", Afloat)
def load_afloat(part: Any, body: Any, q: float, pose: Any) -> Any:
    """Return buoyancy and slamming of all columns and the Froude-Krylov force."""
    _, R, v, spin = pose
    n, s = R[2], body.stage
    extent = _extent(part, n)
    drift = dot(n, to_body(R, axpy(v, -1.0, vector(s, at.FLOW_NOW))))
    f = axpy(
        ZERO_VECTOR, s[at.SUBMERGED] * body.displaced, to_body(R, vector(s, at.FLOW_ACCELERATION))
    )
    b = axpy(vector(body.buoyed, 0), 1.0, vector(s, at.SUBMERGED_ARM))
    add_constant_force(body, q, b, f)
    t, size = cross(b, f), body.displaced * body.g
    for j in range(part.columns.shape[0]):
        r, share = _submerged_fraction(body, j, part, pose, extent[0])
        if not anywhere(share > 0.0):
            continue
        wet, weight = choose(share > 0.0, min(share, 1.0), 0.0), part.columns[j, 3]
        arm = axpy(axpy(r, 1.0, vector(part.buoyancy_offset, 0)), -0.5 * (1.0 - wet), extent[1])
        lift = axpy(ZERO_VECTOR, weight * wet * body.displaced * body.g, n)
        enters = choose(share < 1.0, max(-drift - dot(n, cross(spin, r)), 0.0), 0.0)
        enters = choose(share > 0.0, enters, 0.0)
        slam = axpy(ZERO_VECTOR, weight * part.slam * enters * enters, n)
        low = axpy(r, -0.5, extent[1])
        f, t = axpy(f, 1.0, lift), axpy(t, 1.0, cross(arm, lift))
        f, t = axpy(f, 1.0, slam), axpy(t, 1.0, cross(low, slam))
        size += weight * part.slam * enters * enters
        _add_column(part, body, (q, n, extent, share), (r, arm, lift), (low, slam, enters), spin)
    return f, t, size


@jit_exact
def _add_column(part: Any, body: Any, at_n: Any, floats: Any, slams: Any, spin: Any) -> None:
    """Add the derivatives of one column's buoyancy and slamming to the matrix."""
    q, n, extent, share = at_n
    r, arm, lift = floats
    low, slam, enters = slams
    e, g = extent
    turning, partly = cross(spin, r), choose(share < 1.0, 1.0, 0.0)
    wet = min(share, 1.0)
    for k in range(6):
        place, speed, _ = point_derivative(body, k, r, turning)
        psi = vector(body.changes[k], at.D_TURN)
        de, dg = _extent_derivative(part, n, extent, cross(n, psi))
        ds = -partly * (dot(n, place) + (share - 0.5) * de) / e
        w = select(share > 0.0, axpy(ZERO_VECTOR, ds / wet, lift), ZERO_VECTOR)
        darm = axpy(cross(psi, arm), 0.5 * ds, g)
        darm = axpy(darm, -0.5 * (1.0 - wet), dg)
        add_to_jacobian(body, k, -q, w, moment_derivative(arm, w, darm, lift))
        if anywhere(enters > 0.0):
            w = axpy(ZERO_VECTOR, -2.0 / enters * dot(n, speed), slam)
            w = select(enters > 0.0, w, ZERO_VECTOR)
            darm = axpy(cross(psi, low), -0.5, dg)
            add_to_jacobian(body, k, -q, w, moment_derivative(low, w, darm, slam))


@jit_exact
def _surface_at(body: Any, rope: Any, stage: Any, place: Any) -> Any:
    """Return the water surface elevation at a position, using a ghost node's column."""
    work, slot = rope.work, rope.state.s.shape[0] + LOW
    for k in range(3):
        work[POSITION + k, slot] = place[k]
    set_flow(rope.effects, work, stage, slot, slot + 1)
    return work[SURFACE, slot]


@component_kernel("prepare", Afloat)
def prepare_afloat(part: Any, body: Any, rope: Any, stage: Any, pose: Any) -> None:
    """Evaluate the water surface as a plane over the body, the submergence ratio and its centre."""
    x, R, _, _ = pose
    s, half_x, half_y = body.stage, part.span_x, part.span_y
    middle = axpy(x, 1.0, to_world(R, vector(body.middle, 0)))
    ahead = (half_x * R[0][0], half_x * R[1][0], half_x * R[2][0])
    across = (half_y * R[0][1], half_y * R[1][1], half_y * R[2][1])
    east = _surface_at(body, rope, stage, axpy(middle, 1.0, ahead))
    west = _surface_at(body, rope, stage, axpy(middle, -1.0, ahead))
    north = _surface_at(body, rope, stage, axpy(middle, 1.0, across))
    south = _surface_at(body, rope, stage, axpy(middle, -1.0, across))
    s[at.SURFACE_Z] = 0.25 * (east + west + north + south)
    s[at.SURFACE_X] = 0.5 * (east - west) / half_x
    s[at.SURFACE_Y] = 0.5 * (north - south) / half_y
    e, g = _extent(part, R[2])
    total, arm = 0.0, ZERO_VECTOR
    for j in range(part.columns.shape[0]):
        r, share = _submerged_fraction(body, j, part, pose, e)
        wet = part.columns[j, 3] * min(max(share, 0.0), 1.0)
        total += wet
        part_of_it = axpy(r, -1.0, vector(body.middle, 0))
        lower = 0.5 * (1.0 - min(max(share, 0.0), 1.0))
        arm = axpy(arm, wet, axpy(part_of_it, -lower, g))
    s[at.SUBMERGED] = total
    store(s, at.SUBMERGED_ARM, axpy(ZERO_VECTOR, 1.0 / max(total, DRY_TOL), arm))


@component_kernel("support", Afloat)
def support_afloat(part: Any, body: Any, place: Any) -> float:
    """Return the height of the keel of the body floating in equilibrium."""
    sunk = part.height * body.m / (body.displaced + DRY_TOL)
    return float(body.stage[at.SURFACE_Z] - sunk if body.m < body.displaced else -1e300)


def columns_now(part: Afloat, body: RigidBody, pose: Any) -> tuple[Floats, Floats, Floats]:
    """Return submerged fraction (n,), buoyancy and slamming (n, 3) [N] of each column."""
    n, s, sides = pose.turn[2], body.stage, np.array([part.side_x, part.side_y, part.height])
    e, _ = _extent_now(sides, n)
    r = part.columns[:, :3]
    surface = s[at.SURFACE_Z] + part.columns[:, 4:] @ [s[at.SURFACE_X], s[at.SURFACE_Y]]
    share = (surface - pose.place(r)[:, 2]) / e + 0.5
    wet = np.clip(share, 0.0, 1.0)
    u = body.records[int(body.memory[0, 0]), at.WATER + 2]
    enters = np.where((share > 0.0) & (share < 1.0), np.maximum(u - pose.speed(r)[:, 2], 0.0), 0.0)
    up, weight = np.array([0.0, 0.0, 1.0]), part.columns[:, 3]
    lift = (weight * wet * body.displaced * body.g)[:, None] * up
    return wet, lift, (weight * part.slam * enters**2)[:, None] * up


def _extent_now(sides: Floats, n: Floats) -> tuple[float, Floats]:
    """Return e and ∂e/∂n (plain Python version of `_extent`)."""
    e = float(((sides * n) ** 8).sum() ** 0.125)
    return e, np.asarray((sides * n) ** 7 * sides / e**7)


@component_kernel("power", Afloat)
def power_afloat(part: Afloat, body: RigidBody, pose: Any) -> float:
    """Return the power of buoyancy, less that of the fully submerged body, and of slamming [W]."""
    sides = np.array([part.side_x, part.side_y, part.height])
    _, g = _extent_now(sides, pose.turn[2])
    wet, lift, slam = columns_now(part, body, pose)
    r = part.columns[:, :3]
    arm = r + part.buoyancy_offset - 0.5 * (1.0 - wet)[:, None] * g
    whole = body.displaced * body.g * pose.speed(body.buoyed)[2]
    total = (lift * pose.speed(arm)).sum() + (slam * pose.speed(r - 0.5 * g)).sum()
    return float(total - whole)


PHASE, TIME, RATE = at.RECORD, at.RECORD + 1, at.RECORD + 2  # columns of a record
# Entries of the stage: explicit part of φ, factor on its rate [s], time; φ and rate when last
# evaluated.
HAT, WEIGHT, NOW, PHASE_NOW, RATE_NOW = range(at.STAGE, at.STAGE + 5)
OWN_COLUMNS, OWN_ENTRIES = 3, 5
UNKNOWN = -1.0  # marks the rate before the first stage


class Shedding(NamedTuple):
    """Component: the vortices of a body."""

    k: float  # ½·ρ·C_L [kg/m³]
    turns: float  # 2π·St/D [1/m]
    x: float  # faces normal to the body's axes [m²]
    y: float
    z: float


@jit_exact
def _last_of_one(records: Any, body: Any, time: float) -> Any:
    record = records[int(body.memory[0, 0])]
    if body.stage[at.FRESH] > 0.0:
        record[PHASE], record[TIME], record[RATE] = 0.0, time, UNKNOWN
    return record[PHASE], record[TIME], record[RATE]


@jit_exact
def _last_of_lanes(records: Any, body: Any, time: float) -> Any:
    record = body.changes[0]  # the valid one, while a stage is predicted (core/body/lanes)
    return record[PHASE], record[TIME], record[RATE]


# φ, the time and the rate of φ in the valid record, which begins here in static equilibrium.
_last = by_width(_last_of_one, _last_of_lanes)


@component_kernel("prepare", Shedding)
def prepare_shedding(part: Any, body: Any, rope: Any, stage: Any, pose: Any) -> None:
    """Set the explicit part of φ; it is 0 in static equilibrium, whose time is 0."""
    s, (phase, then, rate) = body.stage, _last(body.records, body, stage.time)
    passed = stage.time - then
    known = rate >= 0.0  # it is UNKNOWN otherwise
    s[NOW] = stage.time
    s[WEIGHT] = choose(known, 0.5 * passed, passed)
    s[HAT] = phase + choose(known, 0.5 * passed * rate, 0.0)


@jit_exact_within
def _sign(x: Any) -> Any:
    return choose(x > 0.0, 1.0, -1.0)


@component_kernel("load", Shedding)
def load_shedding(part: Any, body: Any, q: float, pose: Any) -> Any:
    """Return the force and its moment in body axes; subtract q times their derivatives."""
    _, R, v, spin = pose
    s, n = body.stage, R[2]
    h = axpy(vector(body.watered, 0), 1.0, vector(s, at.SUBMERGED_ARM))
    against = to_body(R, axpy(v, -1.0, vector(s, at.FLOW_NOW)))
    w = axpy(ZERO_VECTOR, -1.0, axpy(against, 1.0, cross(spin, h)))
    speed = sqrt(dot(w, w) + SPEED2_MIN)
    s[RATE_NOW] = part.turns * speed
    s[PHASE_NOW] = s[HAT] + s[WEIGHT] * s[RATE_NOW]
    wave, slope = sin(s[PHASE_NOW]), cos(s[PHASE_NOW])
    side = cross(w, n)
    signs = part.x * _sign(w[0]), part.y * _sign(w[1]), part.z * _sign(w[2])
    faces, k = dot(signs, w), s[at.SUBMERGED] * part.k
    f = axpy(ZERO_VECTOR, k * faces * wave, side)
    for i in range(6):
        row = body.changes[i]
        psi, dspin = vector(row, at.D_TURN), vector(row, at.D_SPIN)
        dc = axpy(vector(row, at.D_SPEED), -1.0, cross(psi, against))
        dw = axpy(ZERO_VECTOR, -1.0, axpy(dc, 1.0, cross(dspin, h)))
        turned = s[WEIGHT] * part.turns * dot(w, dw) / speed
        df = axpy(ZERO_VECTOR, k * (dot(signs, dw) * wave + faces * slope * turned), side)
        dside = axpy(cross(dw, n), 1.0, cross(w, cross(n, psi)))
        df = axpy(axpy(df, k * faces * wave, dside), 1.0, cross(psi, f))
        add_to_jacobian(body, i, -q, df, moment_derivative(h, df, cross(psi, h), f))
    return f, cross(h, f), sqrt(dot(f, f))


@component_kernel("record", Shedding)
def record_shedding(part: Any, body: Any, record: Any) -> None:
    """Store φ of the converged stage in the record of the body's motion."""
    s = body.stage
    record[PHASE], record[TIME], record[RATE] = s[PHASE_NOW], s[NOW], s[RATE_NOW]


@component_kernel("power", Shedding)
def power_shedding(part: Shedding, body: Any, pose: Any) -> float:
    """Return the power of the force [W]."""
    record = body.records[int(body.memory[0, 0])]
    h: Floats = body.watered + record[at.ARM_THEN : at.ARM_THEN + 3]
    u = record[at.WATER : at.WATER + 3]
    w = (u - pose.velocity) @ pose.turn - np.cross(pose.spin, h)
    faces = np.abs(w) @ np.array([part.x, part.y, part.z])
    force = record[at.WET_THEN] * part.k * faces * np.sin(record[PHASE]) * np.cross(w, pose.turn[2])
    return float(force @ pose.turn.T @ pose.speed(h))
