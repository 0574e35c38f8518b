"""A partially submerged rigid body: submergence, buoyancy with righting moments, slamming.

The body is cut into columns along its own z over the height H; their positions and volume fractions
are Gauss-Legendre points and weights, so that volume and moments are exact for a box whose bottom
is wet and whose top is dry. A column whose middle is at height z is submerged below the surface η
over the fraction

    s = (η - z)/e + 1/2, from 0 to 1,  e⁸ = (H·n_z)⁸ + (a·n_x)⁸ + (b·n_y)⁸

where n is the vertical in body axes and a, b are its sides: e is its vertical extent at the present
attitude, and stays above 0 where it lies flat. Buoyancy ρ·g·V·w·s acts -½·(1 - s)·∂e/∂n from the
middle: the middle of the submerged part of an upright column. It therefore has a potential,
ρ·g·V·w·½·e·s² while partly submerged, and cannot create energy.

Added mass and drag follow the submergence ratio β of the whole body and act at the middle of the
submerged part (DNV-RP-N103, 4.2 to 4.4). While a column enters at the speed v relative to the
water, ½·ρ·C_s·A·w·v² acts upward at its lower end (4.3.8). β in the momenta is held constant over a
substep: the effect of its change on the added mass is the slamming force, and water exit has none.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

import numpy as np

from rope_twin.core.body import state as at
from rope_twin.core.body.change import (
    NONE,
    add_change,
    add_steady,
    change_of,
    moment_change,
)
from rope_twin.core.body.parts import part
from rope_twin.core.body.rotation import along, cross, dot, inward, outward, put, vector
from rope_twin.core.body.state import Afloat, RigidBody
from rope_twin.core.jit.decorators import jit, jit_within
from rope_twin.core.loads.balance import set_flow
from rope_twin.core.payout import LOW
from rope_twin.core.state import POSITION, SURFACE, Floats

DRY_TOL = 1e-12  # submerged fraction below which a body counts as dry


@jit_within
def _sixth(x: float) -> float:
    return x * x * x * x * x * x


@jit
def _extent(part: Any, n: Any) -> Any:
    """Return the vertical extent e of a column and ∂e/∂n."""
    a, b, H = part.side_x * n[0], part.side_y * n[1], part.height * n[2]
    A, B, C = _sixth(a), _sixth(b), _sixth(H)
    e = sqrt(sqrt(sqrt(A * a * a + B * b * b + C * H * H)))
    s = 1.0 / (_sixth(e) * e)
    return e, (s * A * a * part.side_x, s * B * b * part.side_y, s * C * H * part.height)


@jit
def _extent_change(part: Any, n: Any, found: Any, dn: Any) -> Any:
    """Return the changes of e and ∂e/∂n for a change dn of the vertical in body axes."""
    e, g = found
    a, b, H = part.side_x * n[0], part.side_y * n[1], part.height * n[2]
    de, s = dot(g, dn), 7.0 / (_sixth(e) * e)
    bent = (
        s * _sixth(a) * part.side_x * part.side_x * dn[0],
        s * _sixth(b) * part.side_y * part.side_y * dn[1],
        s * _sixth(H) * part.height * part.height * dn[2],
    )
    return de, along(bent, -7.0 * de / e, g)


@jit
def _share(body: Any, j: int, part: Any, pose: Any, e: float) -> Any:
    """Return the middle of column j and its submerged fraction s before clamping to [0, 1]."""
    r, s = vector(part.columns[j], 0), body.stage
    surface = s[at.SURFACE_Z] + s[at.SURFACE_X] * part.columns[j, 4]
    surface += s[at.SURFACE_Y] * part.columns[j, 5]
    return r, (surface - pose[0][2] - dot(pose[1][2], r)) / e + 0.5


@part("act", Afloat)
def act(part: Any, body: Any, q: float, pose: Any) -> Any:
    """Return buoyancy and slamming of all columns and the Froude-Krylov force."""
    _, R, v, spin = pose
    n, s = R[2], body.stage
    found = _extent(part, n)
    drift = dot(n, inward(R, along(v, -1.0, vector(s, at.FLOW_NOW))))
    f = along(NONE, s[at.WET] * body.displaced, inward(R, vector(s, at.FLOW_GROWS)))
    b = along(vector(body.buoyed, 0), 1.0, vector(s, at.WET_ARM))
    add_steady(body, q, b, f)
    t, size = cross(b, f), body.displaced * body.g
    for j in range(part.columns.shape[0]):
        r, share = _share(body, j, part, pose, found[0])
        if not share > 0.0:
            continue
        wet, weight = min(share, 1.0), part.columns[j, 3]
        arm = along(along(r, 1.0, vector(part.aside, 0)), -0.5 * (1.0 - wet), found[1])
        lift = along(NONE, weight * wet * body.displaced * body.g, n)
        enters = max(-drift - dot(n, cross(spin, r)), 0.0) if share < 1.0 else 0.0
        slam = along(NONE, weight * part.slam * enters * enters, n)
        low = along(r, -0.5, found[1])
        f, t = along(f, 1.0, lift), along(t, 1.0, cross(arm, lift))
        f, t = along(f, 1.0, slam), along(t, 1.0, cross(low, slam))
        size += weight * part.slam * enters * enters
        _add_column(part, body, (q, n, found, share), (r, arm, lift), (low, slam, enters), spin)
    return f, t, size


@jit
def _add_column(part: Any, body: Any, at_n: Any, floats: Any, slams: Any, spin: Any) -> None:
    """Add the derivatives of one column's buoyancy and slamming to the matrix."""
    q, n, found, share = at_n
    r, arm, lift = floats
    low, slam, enters = slams
    e, g = found
    turning, partly = cross(spin, r), 1.0 if share < 1.0 else 0.0
    wet = min(share, 1.0)
    for k in range(6):
        place, speed, _ = change_of(body, k, r, turning)
        psi = vector(body.changes[k], at.D_TURN)
        de, dg = _extent_change(part, n, found, cross(n, psi))
        ds = -partly * (dot(n, place) + (share - 0.5) * de) / e
        w = along(NONE, ds / wet, lift)
        darm = along(cross(psi, arm), 0.5 * ds, g)
        darm = along(darm, -0.5 * (1.0 - wet), dg)
        add_change(body, k, -q, w, moment_change(arm, w, darm, lift))
        if enters > 0.0:
            w = along(NONE, -2.0 / enters * dot(n, speed), slam)
            darm = along(cross(psi, low), -0.5, dg)
            add_change(body, k, -q, w, moment_change(low, w, darm, slam))


@jit
def _surface_at(body: Any, rope: Any, stage: Any, place: Any) -> float:
    """Return the water surface elevation at a position, using a ghost node's column."""
    work, slot = rope.work, rope.state.s.shape[0] + LOW
    for k in range(3):
        work[POSITION + k, slot] = place[k]
    set_flow(rope.effects, work, stage, slot, slot + 1)
    return float(work[SURFACE, slot])


@part("foresee", Afloat)
def foresee(part: Any, body: Any, rope: Any, stage: Any, pose: Any) -> None:
    """Evaluate the water surface as a plane over the body, the submergence ratio and its centre."""
    x, R, _, _ = pose
    s, half_x, half_y = body.stage, part.span_x, part.span_y
    middle = along(x, 1.0, outward(R, vector(body.middle, 0)))
    ahead = (half_x * R[0][0], half_x * R[1][0], half_x * R[2][0])
    aside = (half_y * R[0][1], half_y * R[1][1], half_y * R[2][1])
    east = _surface_at(body, rope, stage, along(middle, 1.0, ahead))
    west = _surface_at(body, rope, stage, along(middle, -1.0, ahead))
    north = _surface_at(body, rope, stage, along(middle, 1.0, aside))
    south = _surface_at(body, rope, stage, along(middle, -1.0, aside))
    s[at.SURFACE_Z] = 0.25 * (east + west + north + south)
    s[at.SURFACE_X] = 0.5 * (east - west) / half_x
    s[at.SURFACE_Y] = 0.5 * (north - south) / half_y
    e, g = _extent(part, R[2])
    total, arm = 0.0, NONE
    for j in range(part.columns.shape[0]):
        r, share = _share(body, j, part, pose, e)
        wet = part.columns[j, 3] * min(max(share, 0.0), 1.0)
        total += wet
        part_of_it = along(r, -1.0, vector(body.middle, 0))
        lower = 0.5 * (1.0 - min(max(share, 0.0), 1.0))
        arm = along(arm, wet, along(part_of_it, -lower, g))
    s[at.WET] = total
    put(s, at.WET_ARM, along(NONE, 1.0 / max(total, DRY_TOL), arm))


@part("floor", Afloat)
def floor(part: Any, body: Any, place: Any) -> float:
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


@part("power", Afloat)
def power(part: Afloat, body: RigidBody, pose: Any) -> float:
    """Return the power of buoyancy, less that of the fully submerged body, and of slamming [W]."""
    sides = np.array([part.side_x, part.side_y, part.height])
    _, g = _extent_now(sides, pose.turn[2])
    wet, lift, slam = columns_now(part, body, pose)
    r = part.columns[:, :3]
    arm = r + part.aside - 0.5 * (1.0 - wet)[:, None] * g
    whole = body.displaced * body.g * pose.speed(body.buoyed)[2]
    total = (lift * pose.speed(arm)).sum() + (slam * pose.speed(r - 0.5 * g)).sum()
    return float(total - whole)
