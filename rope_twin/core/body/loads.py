"""Forces on a rigid body, the momenta of body and water, and Newton's matrix of both.

Kirchhoff's equations (Lamb 1932, Hydrodynamics, § 124) for the momenta of body and added mass
about the centre of gravity G, in the world's directions:

    dP/dt = F,  dL/dt = M - (v - u) × p,  P = m·v + p,  L = R·((I + I_A)·Ω + h × Rᵀp)

with the water's momentum p = R·M_A·c, c = Rᵀ(v - u) + Ω × h the velocity against the water u at
the place h of added mass and drag. u in p is held over a substep: a current that jumps gives no
blow; the water's acceleration brings (ρV + M_A) times itself (Morison et al. 1950).

Drag is -½·ρ·CdA_k·|c|·c_k along the body's axes and -½·ρ·C_k·|Ω_k|·Ω_k about them. Along z the
figures blend from sinking to rising as effects/payload has it; the momentum is then
M̄·w + ΔM·(√(w² + δ²) - δ), whose slope is M(w).

A sling pulls with max(0, k·(l - L) + c·dl/dt), a pin with k·d + c·dd/dt in all directions; a deck
pushes as effects/seabed has it. Newton's matrix is symmetric and definite: mass, drag, and of each
place r that is held q·(q·K + C); it leaves out how arms turn, of the order of the squared step over
the squared period of swinging.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

from rope_twin.core.body.rotation import (
    along,
    cross,
    dot,
    inward,
    outward,
    put,
    vector,
)
from rope_twin.core.body.state import (
    DAMPING,
    DECK_PUSH,
    DECK_SPEED,
    DECK_Z,
    FLOW_GROWS,
    FLOW_NOW,
    FORCES,
    FROZEN,
    HELD,
    LENGTH,
    ON_HOOK,
    SHARE,
    STIFFNESS,
)
from rope_twin.core.jit import jit, jit_within

TURN2 = 0.05**2  # δ² of the blend from sinking to rising [m²/s²]
CREEP = 0.01  # friction is within 0.5 % of μ·N from ten times this on [m/s]
NONE = (0.0, 0.0, 0.0)


@jit_within
def water_momentum(body: Any, c: Any) -> Any:
    """M_A·c in body axes, and M along z at this velocity."""
    root = sqrt(c[2] * c[2] + TURN2)
    lift = body.added[2] * c[2] + body.rising * (root - sqrt(TURN2))
    return (body.added[0] * c[0], body.added[1] * c[1], lift), (
        body.added[2] + body.rising * c[2] / root
    )


@jit
def momenta(body: Any, R: Any, v: Any, spin: Any) -> Any:
    """P, L, and Rᵀp; u is the water's velocity that is held."""
    h = vector(body.watered, 0)
    against = along(v, -1.0, vector(body.stage, FROZEN))
    p, _ = water_momentum(body, along(inward(R, against), 1.0, cross(spin, h)))
    own = (
        dot(body.inertia[0], spin) + body.added[3] * spin[0],
        dot(body.inertia[1], spin) + body.added[4] * spin[1],
        dot(body.inertia[2], spin) + body.added[5] * spin[2],
    )
    P = along(outward(R, p), body.m, v)
    return P, outward(R, along(own, 1.0, cross(h, p))), p


@jit
def _add_point(A: Any, r: Any, S: Any) -> None:
    """A += Gᵀ·S·G of a place r that moves by G·(δv, δΩ) = δv - r × δΩ; S: xx, xy, xz, yy, ..."""
    columns = ((S[0], S[1], S[2]), (S[1], S[3], S[4]), (S[2], S[4], S[5]))
    a, b, c = cross(r, columns[0]), cross(r, columns[1]), cross(r, columns[2])
    for i in range(3):
        low = cross(r, (a[i], b[i], c[i]))
        for j in range(3):
            A[i, j] += columns[i][j]
            A[3 + i, 3 + j] += low[j]
        A[3 + i, 0] += a[i]
        A[3 + i, 1] += b[i]
        A[3 + i, 2] += c[i]


@jit
def _add_hold(body: Any, r: Any, S: Any) -> None:
    """Gᵀ·S of a place that the hook holds, and S itself."""
    columns = ((S[0], S[1], S[2]), (S[1], S[3], S[4]), (S[2], S[4], S[5]))
    for k in range(3):
        low = cross(r, columns[k])
        for i in range(3):
            body.matrix[i, HELD + k] += columns[k][i]
            body.matrix[3 + i, HELD + k] += low[i]
    for k in range(6):
        body.hold[k] += S[k]


@jit_within
def _times(s: float, S: Any) -> Any:
    return s * S[0], s * S[1], s * S[2], s * S[3], s * S[4], s * S[5]


@jit
def _along_and_across(n: Any, a: float, b: float) -> Any:
    """a·n·nᵀ + b·(I - n·nᵀ)."""
    d = a - b
    return (
        b + d * n[0] * n[0], d * n[0] * n[1], d * n[0] * n[2], b + d * n[1] * n[1],
        d * n[1] * n[2], b + d * n[2] * n[2],
    )  # fmt: skip


@jit
def pull_of(leg: Any, share: float, q: float, d: Any, e: Any) -> Any:
    """Pull of a leg on the body, along d, and its S = q·K + C; share: of its stiffness.

    d: from the body to the hook; e: its rate.
    """
    k, c, L = share * leg[STIFFNESS], leg[DAMPING], leg[LENGTH]
    if L == 0.0:
        S = q * k + c
        return along(along(NONE, k, d), c, e), (S, 0.0, 0.0, S, 0.0, S)
    length = sqrt(dot(d, d) + 1e-20)
    n = along(NONE, 1.0 / length, d)
    T = k * (length - L) + c * dot(n, e)
    if not T > 0.0:
        return NONE, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    return along(NONE, T, n), _along_and_across(n, q * k + c, q * T / length)


@jit
def _push_of(deck: Any, q: float, above: float, v: Any) -> Any:
    """Push of the deck, upward and against sliding, in the world's axes, and its S."""
    sunk = max(-above, 0.0)
    gain = max(1.0 - deck.chi * v[2], 0.0)
    push = deck.k * sunk * gain
    rub = deck.mu * push / sqrt(v[0] * v[0] + v[1] * v[1] + CREEP * CREEP)
    stiff = q * deck.k * gain + deck.chi * deck.k * sunk if push > 0.0 else 0.0
    return (-rub * v[0], -rub * v[1], push), (stiff, rub)


@jit
def _add_slings(body: Any, q: float, pose: Any, hook: Any) -> Any:
    """Force and moment of all slings in body axes, and the sum of their sizes."""
    x, R, v, spin = pose
    f, t, size = NONE, NONE, 0.0
    for j in range(body.legs.shape[0]):
        leg = body.legs[j]
        r = vector(leg, 0)
        d = along(inward(R, along(hook[0], -1.0, x)), -1.0, r)
        e = along(inward(R, along(hook[1], -1.0, v)), -1.0, cross(spin, r))
        pull, S = pull_of(leg, body.stage[SHARE], q, d, e)
        f, t = along(f, 1.0, pull), along(t, 1.0, cross(r, pull))
        size += sqrt(dot(pull, pull))
        _add_point(body.matrix, r, _times(q, S))
        _add_hold(body, r, S)
    put(body.stage, ON_HOOK, outward(R, along(NONE, -1.0, f)))
    return f, t, size


@jit
def _add_deck(body: Any, q: float, pose: Any) -> Any:
    """The same of the deck."""
    x, R, v, spin = pose
    f, t, total = NONE, NONE, 0.0
    for j in range(body.corners.shape[0]):
        r = vector(body.corners[j], 0)
        place = along(x, 1.0, outward(R, r))
        speed = along(v, 1.0, outward(R, cross(spin, r)))
        moving = (speed[0], speed[1], speed[2] - body.stage[DECK_SPEED])
        push, (stiff, rub) = _push_of(body.deck, q, place[2] - body.stage[DECK_Z], moving)
        own = inward(R, push)
        f, t = along(f, 1.0, own), along(t, 1.0, cross(r, own))
        total += push[2]
        _add_point(body.matrix, r, _times(q, _along_and_across(R[2], stiff, rub)))
    body.stage[DECK_PUSH] = total
    return f, t, total


@jit
def _add_water(body: Any, q: float, pose: Any) -> Any:
    """Force and moment of weight, buoyancy and water in body axes, less those in `momenta`."""
    _, R, v, spin = pose
    h, b, s = vector(body.watered, 0), vector(body.buoyed, 0), body.stage
    c = along(inward(R, along(v, -1.0, vector(s, FLOW_NOW))), 1.0, cross(spin, h))
    _, Mz = water_momentum(body, c)
    speed = sqrt(dot(c, c) + 1e-20)
    root = sqrt(c[2] * c[2] + TURN2)
    kx, ky, kz = body.k[0], body.k[1], body.k[2] + body.rising_k * c[2] / root
    grows = inward(R, vector(s, FLOW_GROWS))
    at_h = (
        body.added[0] * grows[0] - kx * speed * c[0],
        body.added[1] * grows[1] - ky * speed * c[1],
        Mz * grows[2] - kz * speed * c[2],
    )
    at_b = along(along(NONE, body.displaced * body.g, R[2]), body.displaced, grows)
    f = along(along(at_h, 1.0, at_b), -body.m * body.g, R[2])
    t = along(cross(h, at_h), 1.0, cross(b, at_b))
    ex, ey, ez = body.k[3] * abs(spin[0]), body.k[4] * abs(spin[1]), body.k[5] * abs(spin[2])
    t = along(t, -1.0, (ex * spin[0], ey * spin[1], ez * spin[2]))
    slope = q * body.rising_k * TURN2 / (root * root * root) * speed * c[2]
    D = (
        body.added[0] + q * kx * (speed + c[0] * c[0] / speed), 0.0, 0.0,
        body.added[1] + q * ky * (speed + c[1] * c[1] / speed), 0.0,
        Mz + q * kz * (speed + c[2] * c[2] / speed) + slope,
    )  # fmt: skip
    _add_point(body.matrix, h, D)
    for k, extra in enumerate((ex, ey, ez)):
        body.matrix[3 + k, 3 + k] += 2.0 * q * extra
    size = (body.m + body.displaced) * body.g + sqrt(dot(at_h, at_h))
    return f, t, size


@jit
def loads(body: Any, q: float, pose: Any, hook: Any) -> Any:
    """Force and moment about G in body axes, with Newton's matrix of masses and slopes.

    pose: place, R, velocity, spin; hook: place and velocity.
    """
    A = body.matrix
    A[:, :] = 0.0
    body.hold[:] = 0.0
    for k in range(3):
        A[k, k] = body.m
        for j in range(3):
            A[3 + k, 3 + j] = body.inertia[k, j]
        A[3 + k, 3 + k] += body.added[3 + k]
    f, t, size = _add_water(body, q, pose)
    more, twist, total = _add_slings(body, q, pose, hook)
    f, t, size = along(f, 1.0, more), along(t, 1.0, twist), size + total
    more, twist, total = _add_deck(body, q, pose)
    f, t, size = along(f, 1.0, more), along(t, 1.0, twist), size + total
    _, R, v, spin = pose
    _, _, p = momenta(body, R, v, spin)
    against = inward(R, along(v, -1.0, vector(body.stage, FROZEN)))
    body.stage[FORCES] = size
    return f, along(t, -1.0, cross(against, p))
