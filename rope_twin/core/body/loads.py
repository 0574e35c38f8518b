"""Loads on a rigid body, the momenta of body and added mass, and the Jacobian of both.

**Components** are optional loads besides slings, weight and drag. A component is a NamedTuple in a
body's `parts`; its file registers kernels by `@component_kernel(hook, Type)`:

- `load(part, body, q, pose)`: force and moment about G in body axes and the sum of the magnitudes;
  it subtracts q times their derivatives from the matrix (core/body/state.py). pose: position, R,
  velocity, angular velocity.
- `prepare(part, body, rope, stage, pose)`: called before a stage is solved, at its predicted pose.
- `record(part, body, record)`: called with the record that a converged substep is written to.
- `support(part, body, place)`: the height at which the body's corners there would touch it.
- `power(part, body, pose)`, plain Python: power into the body [W]; pose: of core/body/step.py.

The types select the code at compile time, like effects (core/loads/hooks.py).

**Momenta.** Kirchhoff's equations (Lamb 1932, Hydrodynamics, § 124) for the momenta of body and
added mass about the centre of gravity G, in world axes:

    dP/dt = F,  dL/dt = M - (v - u) × p,  P = m·v + p,  L = R·((I + I_A)·Ω + h × Rᵀp)

with the momentum of the added mass p = R·M_A·c, c = Rᵀ(v - u) + Ω × h the velocity relative to the
water u at the reference point h of added mass and drag. u in p is held constant over a substep: a
current that jumps gives no impulse; the water's acceleration contributes (ρV + M_A) times itself
(Morison et al. 1950). For a partially submerged body M_A, I_A and drag are scaled by the
submergence ratio and h is the middle of the submerged part (core/body/components.py); otherwise the
ratio is 1.

Drag is -½·ρ·CdA_k·|c|·c_k along the body axes and -½·ρ·C_k·|Ω_k|·Ω_k about them. Along z the
coefficients blend from descent to ascent as in effects/payload; the momentum is then M̄·w +
ΔM·(√(w² + δ²) - δ), whose slope is M(w).

The tension of a sling is max(0, k·(l - L) + c·dl/dt), the force of a pin k·d + c·dd/dt in all
directions; other loads are components. Newton's matrix is the derivative of all this
(core/body/state.py), including arms and directions that turn with the body.
"""

from __future__ import annotations

from collections.abc import Callable
from math import sqrt
from typing import Any

from numba.extending import overload

from rope_twin.core.body.state import (
    ARM_HELD,
    D_SPEED,
    D_SPIN,
    D_TURN,
    DAMPING,
    FLOW_ACCELERATION,
    FLOW_NOW,
    FORCES,
    FROZEN,
    HELD,
    HOOK_FORCE,
    LENGTH,
    SHARE,
    STIFFNESS,
    SUBMERGED,
    SUBMERGED_ARM,
    SUBMERGED_HELD,
    ZERO_VECTOR,
    Immersed,
    add_constant_force,
    add_moment_to_jacobian,
    add_to_jacobian,
    axpy,
    clear,
    cross,
    dot,
    moment_derivative,
    point_derivative,
    select,
    set_pose_derivatives,
    store,
    to_body,
    to_world,
    unit,
    vector,
)
from rope_twin.core.jit.decorators import LINKED, jit_exact, jit_exact_within
from rope_twin.core.jit.functions import anywhere, fused
from rope_twin.core.jit.wide import choose
from rope_twin.core.loads.hooks import generated
from rope_twin.core.state import SLING2_MIN, SPEED2_MIN

_KERNELS: dict[str, dict[type, Any]] = {
    "load": {}, "prepare": {}, "record": {}, "support": {}, "power": {},
}  # fmt: skip


def component_kernel(hook: str, *kinds: type) -> Callable[[Any], Any]:
    """Register a kernel of component types for a hook.

    Raises:
        ValueError: unknown hook.
    """
    if hook not in _KERNELS:
        raise ValueError(f"unknown hook '{hook}' of a body component; known: {', '.join(_KERNELS)}")

    def register(function: Any) -> Any:
        compiled_kernel = function if hook == "power" else jit_exact(function)
        _KERNELS[hook].update(dict.fromkeys(kinds, compiled_kernel))
        return compiled_kernel

    return register


def power_of(body: Any, pose: Any) -> float:
    """Return the power of all components into a body [W]."""
    return float(
        sum(call(component, body, pose) for component, call in _with_kernel("power", body.parts))
    )


def component_of(body: Any, *kinds: type) -> Any:
    """Return the body's component of one of these types, or None."""
    return next((component for component in body.parts if isinstance(component, kinds)), None)


def _with_kernel(hook: str, parts: Any) -> list[tuple[Any, Any]]:
    known = _KERNELS[hook]
    return [(component, known[type(component)]) for component in parts if type(component) in known]


def _calls(hook: str, parts: Any) -> dict[int, Any]:
    known = _KERNELS[hook]
    calls = {i: known.get(component.instance_class) for i, component in enumerate(parts)}
    return {i: call for i, call in calls.items() if call is not None}


def load_all(parts: Any, body: Any, q: Any, pose: Any, total: Any) -> Any:
    """Return the sum of `total` (force, moment, magnitude) and the loads of all components."""
    for component, call in _with_kernel("load", parts):
        total = _add_loads(total, call(component, body, q, pose))
    return total


@overload(load_all, jit_options=LINKED, strict=False)
def _compose_load(parts: Any, body: Any, q: Any, pose: Any, total: Any) -> Any:
    calls = _calls("load", parts)
    lines = [f"total = add(total, kernel_{i}(parts[{i}], body, q, pose))" for i in calls]
    return generated("parts, body, q, pose, total", [*lines, "return total"], calls, add=_add_loads)


def _call_all(hook: str, names: str) -> Any:
    """Return the function that calls the kernels of a hook of all components."""

    def call_all(parts: Any, *rest: Any) -> Any:
        for component, call in _with_kernel(hook, parts):
            call(component, *rest)

    @overload(call_all, jit_options=LINKED, strict=False)
    def compose(parts: Any, *rest: Any) -> Any:
        calls = _calls(hook, parts)
        lines = [f"kernel_{i}(parts[{i}], {names})" for i in calls]
        return generated(f"parts, {names}", [*lines, "return None"], calls)

    return call_all


# At the beginning of a stage, and at the end of a substep.
prepare_all = _call_all("prepare", "body, rope, stage, pose")
record_all = _call_all("record", "body, record")


def highest_support(parts: Any, body: Any, place: Any, height: Any) -> Any:
    """Return the highest support of all components, at least `height`."""
    for component, call in _with_kernel("support", parts):
        height = max(height, call(component, body, place))
    return height


@overload(highest_support, jit_options=LINKED, strict=False)
def _compose_support(parts: Any, body: Any, place: Any, height: Any) -> Any:
    calls = _calls("support", parts)
    lines = [f"height = max(height, kernel_{i}(parts[{i}], body, place))" for i in calls]
    return generated("parts, body, place, height", [*lines, "return height"], calls)


@jit_exact
def _add_loads(a: Any, b: Any) -> Any:
    return axpy(a[0], 1.0, b[0]), axpy(a[1], 1.0, b[1]), a[2] + b[2]


TURN2 = 0.05**2  # δ² of the blend from descent to ascent [m²/s²]


@jit_exact_within
def _scaled(a: Any, b: Any) -> Any:
    return a[0] * b[0], a[1] * b[1], a[2] * b[2]


@jit_exact_within
def water_momentum(body: Any, wet: float, c: Any) -> Any:
    """Return M_A·c in body axes and M along the axes, scaled by the submergence ratio."""
    root = sqrt(fused(c[2], c[2], TURN2))
    lift = wet * fused(body.added[2], c[2], body.rising * (root - sqrt(TURN2)))
    slope = wet * (body.added[2] + body.rising * c[2] / root)
    M = (wet * body.added[0], wet * body.added[1], slope)
    return (M[0] * c[0], M[1] * c[1], lift), M


@jit_exact_within
def _angular_momentum(body: Any, spin: Any) -> Any:
    """Return (I + I_A)·Ω."""
    wet = body.stage[SUBMERGED_HELD]
    return (
        fused(wet * body.added[3], spin[0], dot(body.inertia[0], spin)),
        fused(wet * body.added[4], spin[1], dot(body.inertia[1], spin)),
        fused(wet * body.added[5], spin[2], dot(body.inertia[2], spin)),
    )


@jit_exact_within
def _added_mass_state(body: Any, pose: Any) -> Any:
    """Return h, relative velocity in body axes, and p and M, as held over a substep."""
    _, R, v, spin = pose
    s = body.stage
    h = axpy(vector(body.watered, 0), 1.0, vector(s, ARM_HELD))
    relative = to_body(R, axpy(v, -1.0, vector(s, FROZEN)))
    c = axpy(relative, 1.0, cross(spin, h))
    p, M = water_momentum(body, s[SUBMERGED_HELD], c)
    return h, relative, p, M


@jit_exact
def momenta(body: Any, R: Any, v: Any, spin: Any) -> Any:
    """Return P and L, with water velocity and submergence ratio held over the substep."""
    h, _, p, _ = _added_mass_state(body, (v, R, v, spin))
    P = axpy(to_world(R, p), body.m, v)
    return P, to_world(R, axpy(_angular_momentum(body, spin), 1.0, cross(h, p)))


@jit_exact
def _add_momenta(body: Any, q: float, pose: Any) -> Any:
    """Add the derivatives of P and L to the matrix; return the moment -(v - u) × p in body axes."""
    h, relative, p, M = _added_mass_state(body, pose)
    L = axpy(_angular_momentum(body, pose[3]), 1.0, cross(h, p))
    for k in range(6):
        row = body.changes[k]
        dv, psi, dspin = vector(row, D_SPEED), vector(row, D_TURN), vector(row, D_SPIN)
        dc = axpy(axpy(dv, -1.0, cross(psi, relative)), 1.0, cross(dspin, h))
        dp = _scaled(M, dc)
        dL = axpy(axpy(_angular_momentum(body, dspin), 1.0, cross(h, dp)), 1.0, cross(psi, L))
        dp = axpy(dp, 1.0, cross(psi, p))
        add_to_jacobian(body, k, 1.0, axpy(dp, body.m, dv), dL)
        add_moment_to_jacobian(body, k, q, axpy(cross(dv, p), 1.0, cross(relative, dp)))
    return cross(p, relative)


@jit_exact
def _add_drag(body: Any, q: float, pose: Any) -> Any:
    """Return drag force and moment in body axes, without terms in the momenta; add derivatives."""
    _, R, v, spin = pose
    s = body.stage
    wet, h = s[SUBMERGED], axpy(vector(body.watered, 0), 1.0, vector(s, SUBMERGED_ARM))
    relative = to_body(R, axpy(v, -1.0, vector(s, FLOW_NOW)))
    acceleration = to_body(R, vector(s, FLOW_ACCELERATION))
    c = axpy(relative, 1.0, cross(spin, h))
    _, M = water_momentum(body, wet, c)
    speed, root = sqrt(dot(c, c) + SPEED2_MIN), sqrt(fused(c[2], c[2], TURN2))
    k = (wet * body.k[0], wet * body.k[1], wet * (body.k[2] + body.rising_k * c[2] / root))
    f = axpy(_scaled(M, acceleration), -speed, _scaled(k, c))
    e = _scaled(vector(body.k, 3), (abs(spin[0]), abs(spin[1]), abs(spin[2])))
    e = axpy(ZERO_VECTOR, wet, e)
    damping_moment, inverse_speed = _scaled(e, spin), 1.0 / speed
    curvature = (
        wet
        * TURN2
        / (root * root * root)
        * fused(body.rising, acceleration[2], -(body.rising_k * speed * c[2]))
    )
    for i in range(6):
        row = body.changes[i]
        psi, dspin = vector(row, D_TURN), vector(row, D_SPIN)
        dc = axpy(vector(row, D_SPEED), -1.0, cross(psi, relative))
        dc = axpy(dc, 1.0, cross(dspin, h))
        w = _scaled(M, cross(acceleration, psi))
        w = axpy(axpy(w, -speed, _scaled(k, dc)), -dot(c, dc) * inverse_speed, _scaled(k, c))
        w = axpy((w[0], w[1], w[2] + curvature * dc[2]), 1.0, cross(psi, f))
        moment = moment_derivative(h, w, cross(psi, h), f)
        moment = axpy(axpy(moment, -1.0, cross(psi, damping_moment)), -2.0, _scaled(e, dspin))
        add_to_jacobian(body, i, -q, w, moment)
    return f, axpy(cross(h, f), -1.0, damping_moment), sqrt(dot(f, f))


@component_kernel("load", Immersed)
def load_immersed(part: Any, body: Any, q: float, pose: Any) -> Any:
    """Return buoyancy of the whole body and the Froude-Krylov force of the water acceleration."""
    _, R, _, _ = pose
    b, lift = vector(body.buoyed, 0), body.displaced * body.g
    f = axpy(ZERO_VECTOR, body.displaced, to_body(R, vector(body.stage, FLOW_ACCELERATION)))
    f = axpy(f, lift, R[2])
    add_constant_force(body, q, b, f)
    return f, cross(b, f), lift


@jit_exact
def leg_force(leg: Any, share: float, d: Any, e: Any) -> Any:
    """Return the force of a leg on the body along d, its length and magnitude.

    share: factor on its stiffness; d: vector from the body to the hook; e: its rate. The magnitude
    is 0 where the sling is slack. Lanes have pins or slings alike.
    """
    k, c, L = share * leg[STIFFNESS], leg[DAMPING], leg[LENGTH]
    if anywhere(L == 0.0):
        pull = axpy(axpy(ZERO_VECTOR, k, d), c, e)
        return pull, 1.0 + L, sqrt(dot(pull, pull))
    length = sqrt(dot(d, d) + SLING2_MIN)
    n = axpy(ZERO_VECTOR, 1.0 / length, d)
    T = fused(k, length - L, c * dot(n, e))
    return select(T > 0.0, axpy(ZERO_VECTOR, T, n), ZERO_VECTOR), length, choose(T > 0.0, T, 0.0)


@jit_exact
def _leg_force_derivative(leg: Any, share: float, reach: Any, sling: Any, changes: Any) -> Any:
    """Return the change of a leg's force for changes of d and e; zero for a slack sling."""
    k, c, L = share * leg[STIFFNESS], leg[DAMPING], leg[LENGTH]
    d, e = reach
    dd, de = changes
    if anywhere(L == 0.0):
        return axpy(axpy(ZERO_VECTOR, k, dd), c, de)
    _, length, T = sling
    k, c = choose(T > 0.0, k, 0.0), choose(T > 0.0, c, 0.0)  # nothing changes in a slack sling
    inverse = 1.0 / length
    n = axpy(ZERO_VECTOR, inverse, d)
    axial = dot(n, dd)
    dn = axpy(axpy(ZERO_VECTOR, inverse, dd), -axial * inverse, n)
    dT = fused(k, axial, c * (dot(dn, e) + dot(n, de)))
    return axpy(axpy(ZERO_VECTOR, dT, n), T, dn)


@jit_exact
def _add_leg(body: Any, q: float, leg: Any, reach: Any, sling: Any, spin: Any) -> None:
    """Add the derivatives of a leg's force to the unknowns and to the acceleration of the hook."""
    r, share, f = vector(leg, 0), body.stage[SHARE], sling[0]
    rotation_velocity = cross(spin, r)
    for k in range(6):
        place, speed, arm = point_derivative(body, k, r, rotation_velocity)
        changes = axpy(ZERO_VECTOR, -1.0, place), axpy(ZERO_VECTOR, -1.0, speed)
        w = _leg_force_derivative(leg, share, reach, sling, changes)
        add_to_jacobian(body, k, -q, w, moment_derivative(r, w, arm, f))
        for i in range(3):
            body.hold[i, k] += w[i]
    for k in range(3):
        w = _leg_force_derivative(leg, share, reach, sling, (unit(k, q * q), unit(k, q)))
        add_to_jacobian(body, HELD + k, 1.0, w, cross(r, w))
        for i in range(3):
            body.hold[i, HELD + k] += w[i]


@jit_exact
def _add_slings(body: Any, q: float, pose: Any, hook: Any) -> Any:
    """Return force and moment of all slings in body axes, and the sum of their magnitudes."""
    x, R, v, spin = pose
    f, t, size = ZERO_VECTOR, ZERO_VECTOR, 0.0
    for j in range(body.legs.shape[0]):
        leg = body.legs[j]
        r = vector(leg, 0)
        d = axpy(to_body(R, axpy(hook[0], -1.0, x)), -1.0, r)
        e = axpy(to_body(R, axpy(hook[1], -1.0, v)), -1.0, cross(spin, r))
        sling = leg_force(leg, body.stage[SHARE], d, e)
        if anywhere(sling[2] > 0.0):
            f, t = axpy(f, 1.0, sling[0]), axpy(t, 1.0, cross(r, sling[0]))
            size += sling[2]
            _add_leg(body, q, leg, (d, e), sling, spin)
    store(body.stage, HOOK_FORCE, to_world(R, axpy(ZERO_VECTOR, -1.0, f)))
    return f, t, size


@jit_exact
def loads(body: Any, q: float, pose: Any, hook: Any, turn: Any) -> Any:
    """Return force and moment about G in body axes, and assemble Newton's matrix.

    pose: position, R, velocity, angular velocity; hook: position and velocity; turn: θ and its
    rate.
    """
    clear(body.matrix)
    clear(body.hold)
    set_pose_derivatives(body, q, turn[0], turn[1])
    munk_moment = _add_momenta(body, q, pose)
    f, t, size = load_all(body.parts, body, q, pose, _add_drag(body, q, pose))
    sling_force, sling_moment, sling_size = _add_slings(body, q, pose, hook)
    f = axpy(axpy(f, 1.0, sling_force), -body.m * body.g, pose[1][2])
    body.stage[FORCES] = size + sling_size + body.m * body.g
    return f, axpy(axpy(t, 1.0, sling_moment), 1.0, munk_moment)
